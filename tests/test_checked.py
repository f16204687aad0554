"""Classes that callers from Python make: a wrong argument is one line with class, argument and remedy."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import BaseModel

import shipid
from shipid.errors import DocumentError
from shipid.hybrid.features import Memory
from shipid.hybrid.methods import METHODS
from shipid.identification.settings import Identify
from shipid.observer import Observer
from shipid.simulation.manoeuvre import KINDS
from shipid.simulation.truth import Truth
from shipid.vessel.perturb import Family, Perturbation

MADE: list[type[BaseModel]] = [
    Memory,
    Observer,
    Identify,
    Family,
    Perturbation,
    Truth,
    *METHODS.values(),
    *KINDS.values(),
]


@pytest.mark.parametrize("kind", MADE, ids=lambda kind: kind.__name__)
def test_an_unknown_argument_is_one_line(kind: Any) -> None:
    with pytest.raises(DocumentError, match=rf"^{kind.__name__}\.typo: unknown key: [^\n]+$"):
        kind(typo=1)
    assert kind.model_config["frozen"]


@pytest.mark.parametrize(
    ("kind", "given", "line"),
    [
        (shipid.Kernel, {"trials": 0}, "Kernel.trials: 0: must be above 0"),
        (shipid.Kernel, {"trials": True}, "Kernel.trials: True: must be a number"),
        (shipid.Kernel, {"memory": {"error": [4.0, "8"]}}, "Kernel.memory.error.1: '8': must be a number"),
        (Memory, {"error": True}, "Memory.error: True: must be a number"),
        (Memory, {"history": (2.0, -1.0)}, "Memory.history: -1.0: must be above 0"),
        (Identify, {"parameters": "hull.*"}, "Identify.parameters: 'hull.*': must be a list"),
        (Family, {"name": "a", "perturb": [{"parameters": ["hull.*"]}]}, "Family.perturb.0: give `parameters`"),
        (
            Perturbation,
            {"parameters": ["hull.*"], "factor": "x"},
            "Perturbation.factor: 'x': must be a number or a list",
        ),
        (Observer, {"measured": ("u",)}, "Observer: measured lacks 'psi'"),
    ],
)
def test_a_wrong_value_is_named(kind: Any, given: dict[str, Any], line: str) -> None:
    with pytest.raises(DocumentError) as caught:
        kind(**given)
    assert str(caught.value).startswith(line)


def test_an_argument_without_its_name_is_one_line() -> None:
    with pytest.raises(DocumentError, match=r"write the name of each argument: .*parameters"):
        Identify(["hull.*"])  # type: ignore[misc]
