"""What a method and its corrector must have, before anything is computed."""

from __future__ import annotations

import inspect
from typing import Any

from pydantic import BaseModel

from shipid.users import definition_file

SPLITS = ("share", "runs")
CORRECTOR_CALLS = {
    "predict": ("physics", "instants", "paths"),
    "header": (),
    "arrays": (),
    "from_arrays": ("header", "arrays"),
}
"""Functions of a corrector, and what they are called with."""


def fault_of_method(kind: type[BaseModel]) -> str:
    """What a class of `Method` lacks, one sentence with its file; empty where it has all that it is asked for."""
    if not (isinstance(kind, type) and issubclass(kind, BaseModel)) or inspect.isabstract(kind):
        return "must be a class of Method with `fit`, such as shipid.hybrid.alone.Alone"
    corrector, validation = getattr(kind, "corrector", None), getattr(kind, "validation", None)
    if validation not in SPLITS:
        return f"`validation` of {name_of_class(kind)} must be a class variable, one of {SPLITS}, not {validation!r}"
    if unknown := [setting for setting in getattr(kind, "SEARCHED", ()) if setting not in kind.model_fields]:
        return f"`SEARCHED` of {name_of_class(kind)} must be a tuple of names of its settings, {unknown[0]!r} is none"
    if not isinstance(corrector, type):
        return f"{name_of_class(kind)} must have `corrector` as a class variable, the class of what `fit` gives"
    calls = [(kind, "fit", ("task",)), *((corrector, name, taken) for name, taken in CORRECTOR_CALLS.items())]
    return next(filter(None, (_fault_of_call(*call) for call in calls)), "")


def fault_of_corrector(corrector: object) -> str:
    """What an object that a method gives lacks to be a corrector, one sentence; empty where it lacks nothing."""
    for name in (*CORRECTOR_CALLS, "hyperparameters", "past"):
        if not hasattr(corrector, name):
            return f"{name_of_class(type(corrector))} lacks `{name}`"
    return ""


def _fault_of_call(kind: type, name: str, taken: tuple[str, ...]) -> str:
    """Why a function of a class cannot be called as shipid does, with what it takes; empty where it can."""
    function: Any = getattr(kind, name, None)
    if not inspect.isroutine(function):
        return f"{name_of_class(kind)} lacks the function `{name}`: a corrector of `StoredData` has all but `predict`"
    given = ("self", *taken) if inspect.isfunction(inspect.getattr_static(kind, name)) else taken
    try:
        inspect.signature(function).bind(*given)
    except TypeError as error:
        return f"`{name}` of {name_of_class(kind)} must take ({', '.join(given)}): {error}"
    return ""


def name_of_class(kind: type) -> str:
    """The name of a class, and its file where it has one."""
    return f"{kind.__name__} in {file}" if (file := definition_file(kind)) else kind.__name__
