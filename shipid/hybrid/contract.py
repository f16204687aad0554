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
SPLITS = ("share", "runs")


def fault_of_method(kind: type[BaseModel]) -> str:
    """What a class of `Method` lacks, one sentence with its file; empty where it has all that it is asked for."""
    name, validation = name_of_class(kind), getattr(kind, "validation", None)
    if validation not in SPLITS:
        return f"`validation` of {name} must be a class variable, one of {SPLITS}, not {validation!r}"
    for setting in getattr(kind, "SEARCHED", ()):
        if setting not in kind.model_fields:
            return f"`SEARCHED` of {name} must be a tuple of names of its settings, {setting!r} is none"
    if fault := _fault_of_signature(kind, "fit", ("task",)):
        return fault
    corrector: Any = getattr(kind, "corrector", None)
    if not isinstance(corrector, type):
        return f"{name} must have `corrector` as a class variable, the class of what `fit` gives"
    lacking = next((part for part in CORRECTOR_STORAGE if not callable(getattr(corrector, part, None))), None)
    if lacking is not None:
        return f"{name_of_class(corrector)} lacks `{lacking}`: a class of `StoredData`, shipid.hybrid.stored, has it"
    return _fault_of_signature(corrector, "predict", PREDICT)


def fault_of_corrector(corrector: object) -> str:
    """What an object that a method gives lacks to be a corrector, one sentence; empty where it lacks nothing."""
    for name in ("predict", *CORRECTOR_STORAGE[:2], *CORRECTOR_FIELDS):
        if not hasattr(corrector, name):
            return f"{name_of_class(type(corrector))} lacks `{name}`"
    return ""


def _fault_of_signature(kind: type, name: str, taken: Sequence[str]) -> str:
    """Why a function of a class cannot be called as shipid does, with what it takes; empty where it can."""
    function = getattr(kind, name, None)
    if not inspect.isroutine(function):
        return f"{name_of_class(kind)} lacks the function `{name}`"
    given = ("self", *taken) if inspect.isfunction(inspect.getattr_static(kind, name)) else taken
    try:
        inspect.signature(function).bind(*given)
    except TypeError as error:
        return f"`{name}` of {name_of_class(kind)} must take ({', '.join(given)}): {error}"
    return ""


def name_of_class(kind: type) -> str:
    """The name of a class, and its file where it has one."""
    return f"{kind.__name__} in {file}" if (file := definition_file(kind)) else kind.__name__
