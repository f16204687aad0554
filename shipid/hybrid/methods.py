"""The methods that a study may name: to add one, write its file and name its class here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shipid.document import parse_model
from shipid.errors import RETIRED, DataError, DocumentError, suggest_name
from shipid.hybrid.alone import Alone
from shipid.hybrid.calibrator import Calibrator
from shipid.hybrid.forest import Forest
from shipid.hybrid.hankel_dmd import HankelDMD
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.learned_force import LearnedForce
from shipid.hybrid.method import Method, fault_of_method
from shipid.hybrid.modules import Modules
from shipid.hybrid.one_step import OneStep
from shipid.hybrid.path_trained import PathTrained
from shipid.hybrid.recurrent import Recurrent
from shipid.hybrid.regression import Regression
from shipid.hybrid.stack import Stack
from shipid.plugins import Registry

METHODS: Registry[type[Method]] = Registry("shipid.methods", fault_of_method)
METHODS |= {
    "alone": Alone,
    "calibrator": Calibrator,
    "forest": Forest,
    "hankel-dmd": HankelDMD,
    "kernel": Kernel,
    "learned-force": LearnedForce,
    "modules": Modules,
    "one-step": OneStep,
    "path-trained": PathTrained,
    "recurrent": Recurrent,
    "regression": Regression,
    "stack": Stack,
}


def method_of(kind: str, settings: Mapping[str, Any], path: str = "method") -> Method:
    """Return the method of a kind with settings; DocumentError with the path for a wrong kind, key or value."""
    if kind not in METHODS:
        raise DocumentError(f"{kind!r} is no kind of method: {method_names(kind)}", path=f"{path}.kind")
    method: Method = parse_model(METHODS[kind], dict(settings), None, path)
    return method


def method_names(kind: str) -> str:
    """Return the names of the methods that there are, as the remedy where `kind` is none of them."""
    if kind in RETIRED:
        return RETIRED[kind]
    remedy = "one that you wrote needs its package, or `--with` the file that puts it into METHODS"
    return f"{suggest_name(kind, METHODS.names)} ({remedy})"


def method_kind(method: Method) -> str:
    """Return the name under which the class of a method is listed; DataError where it has none, or lacks a part."""
    kind = METHODS.name_of(type(method))
    if kind is None:
        name = type(method).__name__
        raise DataError(f"the method {name} has no name yet: write shipid.hybrid.methods.METHODS['mine'] = {name}")
    return kind
