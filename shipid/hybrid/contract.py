"""What a method and its corrector must have: classes that somebody wrote are looked at before anything is computed."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel

from shipid.users import definition_file

PREDICT = ("physics", "instants", "paths")  # what a corrector is called with
KEPT = ("header", "arrays", "from_arrays")  # functions of a corrector by which it is saved and read back
HELD = ("hyperparameters", "past")  # what a corrector has beside them
SAID = {"validation": "str", "compensates": "bool", "meets_none": "bool", "meets_observer": "bool", "corrector": "type"}
SPLITS = ("share", "runs")
LISTS = ("SEARCHED", "COUNTS", "LINEAR")  # of names of settings


def fault_of_method(kind: type[BaseModel]) -> str:
    """What a class of `Method` lacks, one sentence with its file; empty where it has all that it is asked for."""
    for name, what in SAID.items():
        if name in kind.model_fields:
            return f"{named(kind)} must have `{name}` as a class variable: `{name}: ClassVar[{what}] = ...`"
    if getattr(kind, "validation", None) not in SPLITS:
        return f"`validation` of {named(kind)} must be one of {SPLITS}, not {getattr(kind, 'validation', None)!r}"
    for group in LISTS:
        names: Any = getattr(kind, group, ())
        if isinstance(names, str):
            return f"`{group}` of {named(kind)} must be a tuple, such as ({names!r},)"
        unknown = next((name for name in names if name not in kind.model_fields), None)
        if unknown is not None:
            return f"`{group}` of {named(kind)} names {unknown!r}, which is none of its settings"
    if fault := _uncallable(kind, "fit", ("task",)):
        return fault
    if not hasattr(kind, "corrector"):
        return f"{named(kind)} lacks `corrector`, the class of what `fit` gives"
    corrector: Any = kind.corrector
    if not isinstance(corrector, type):
        return f"`corrector` of {named(kind)} must be a class, not {corrector!r}"
    lacking = next((name for name in KEPT if not callable(getattr(corrector, name, None))), None)
    if lacking is not None:
        return f"{named(corrector)} lacks `{lacking}`: a class of `Stored`, shipid.hybrid.stored, has it"
    return _uncallable(corrector, "predict", PREDICT)


def fault_of_corrector(corrector: object) -> str:
    """What an object that a method gives lacks to be a corrector, one sentence; empty where it lacks nothing."""
    if isinstance(corrector, type):
        return f"the corrector must be an object of {named(corrector)}, not the class"
    for name in ("predict", *KEPT[:2], *HELD):
        if not hasattr(corrector, name):
            return f"{named(type(corrector))} lacks `{name}`"
    return ""


def _uncallable(kind: type, name: str, taken: Sequence[str]) -> str:
    """Why a function of a class cannot be called as shipid does, with what it takes; empty where it can."""
    function = getattr(kind, name, None)
    if function is None:
        return f"{named(kind)} lacks `{name}`"
    if not callable(function):
        return f"`{name}` of {named(kind)} must be a function"
    given = ("self", *taken) if inspect.isfunction(inspect.getattr_static(kind, name)) else taken
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # one of a compiled module may not say
        return ""
    try:
        signature.bind(*given)
    except TypeError:
        return f"`{name}` of {named(kind)} must take ({', '.join(given)}), not {signature}"
    return ""


def named(kind: type) -> str:
    """The name of a class, and its file where it has one."""
    return f"{kind.__name__} in {file}" if (file := definition_file(kind)) else kind.__name__
