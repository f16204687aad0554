"""What a method and its corrector must have: classes that somebody wrote are looked at before anything is computed."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel

from shipid.users import definition_file

PREDICT = ("physics", "instants", "paths")  # what a corrector is called with
CORRECTOR_STORAGE = ("header", "arrays", "from_arrays")  # functions of a corrector by which it is saved and read back
CORRECTOR_FIELDS = ("hyperparameters", "past")  # what a corrector has beside them
CLASS_VARIABLES = {
    "validation": "str",
    "compensates": "bool",
    "meets_none": "bool",
    "meets_observer": "bool",
    "corrector": "type",
}
SPLITS = ("share", "runs")
NAME_LISTS = ("SEARCHED", "COUNTS", "LINEAR")  # of names of settings


def fault_of_method(kind: type[BaseModel]) -> str:
    """What a class of `Method` lacks, one sentence with its file; empty where it has all that it is asked for."""
    for name, what in CLASS_VARIABLES.items():
        if name in kind.model_fields:
            return f"{name_of_class(kind)} must have `{name}` as a class variable: `{name}: ClassVar[{what}] = ...`"
    if getattr(kind, "validation", None) not in SPLITS:
        return (
            f"`validation` of {name_of_class(kind)} must be one of {SPLITS}, not {getattr(kind, 'validation', None)!r}"
        )
    for group in NAME_LISTS:
        names: Any = getattr(kind, group, ())
        if isinstance(names, str):
            return f"`{group}` of {name_of_class(kind)} must be a tuple, such as ({names!r},)"
        unknown = next((name for name in names if name not in kind.model_fields), None)
        if unknown is not None:
            return f"`{group}` of {name_of_class(kind)} names {unknown!r}, which is none of its settings"
    if fault := _fault_of_signature(kind, "fit", ("task",)):
        return fault
    if not hasattr(kind, "corrector"):
        return f"{name_of_class(kind)} lacks `corrector`, the class of what `fit` gives"
    corrector: Any = kind.corrector
    if not isinstance(corrector, type):
        return f"`corrector` of {name_of_class(kind)} must be a class, not {corrector!r}"
    lacking = next((name for name in CORRECTOR_STORAGE if not callable(getattr(corrector, name, None))), None)
    if lacking is not None:
        return f"{name_of_class(corrector)} lacks `{lacking}`: a class of `StoredData`, shipid.hybrid.stored, has it"
    return _fault_of_signature(corrector, "predict", PREDICT)


def fault_of_corrector(corrector: object) -> str:
    """What an object that a method gives lacks to be a corrector, one sentence; empty where it lacks nothing."""
    if isinstance(corrector, type):
        return f"the corrector must be an object of {name_of_class(corrector)}, not the class"
    for name in ("predict", *CORRECTOR_STORAGE[:2], *CORRECTOR_FIELDS):
        if not hasattr(corrector, name):
            return f"{name_of_class(type(corrector))} lacks `{name}`"
    return ""


def _fault_of_signature(kind: type, name: str, taken: Sequence[str]) -> str:
    """Why a function of a class cannot be called as shipid does, with what it takes; empty where it can."""
    function = getattr(kind, name, None)
    if function is None:
        return f"{name_of_class(kind)} lacks `{name}`"
    if not callable(function):
        return f"`{name}` of {name_of_class(kind)} must be a function"
    given = ("self", *taken) if inspect.isfunction(inspect.getattr_static(kind, name)) else taken
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # one of a compiled module may not say
        return ""
    try:
        signature.bind(*given)
    except TypeError:
        return f"`{name}` of {name_of_class(kind)} must take ({', '.join(given)}), not {signature}"
    return ""


def name_of_class(kind: type) -> str:
    """The name of a class, and its file where it has one."""
    return f"{kind.__name__} in {file}" if (file := definition_file(kind)) else kind.__name__
