"""Every method with settings that make it quick, that of docs/extending.md too, and a small world for them."""

from __future__ import annotations

from typing import Any

import pytest

from shipid.hybrid.methods import METHODS, method_of
from tests.documented import module
from tests.hybrid.worlds import World, ship, world

#: settings that make slow methods quick; the laws hold for any
QUICK: dict[str, dict[str, Any]] = {
    "calibrator": {"trials": 2, "steps": 4, "search_windows": 40, "centres": 60},
    "forest": {"trials": 2, "trees": 6},
    "hankel-dmd": {"delays": (2.0, 4.0)},
    "kernel": {"trials": 2, "steps": 4, "search_windows": 40, "centres": 60},
    "learned-force": {"trials": 2, "units": 4, "iterations": 4},
    "modules": {"trials": 2, "units": 4, "centres": 16, "ridge": 1e-3},
    "one-step": {"trials": 2, "units": 16, "averaged": 2},
    "path-trained": {"trials": 2, "epochs": 20, "units": 8, "layers": 1, "input_dropout": 0.0, "hidden_dropout": 0.0},
    "recurrent": {"trials": 2, "epochs": 3, "units": 6, "seconds": 4.0},
    "stack": {"kernel": {"trials": 2, "steps": 4, "search_windows": 40, "centres": 60}},
}
DOCUMENTED = "linear"  # the method of docs/extending.md


def list_documented(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, DOCUMENTED, module("A method", "linear_of_the_page", monkeypatch).Linear)


def small_world() -> World:
    return world(ship().with_values({"hull.derivatives.N_ur": -2.0e6}), ship(), runs=6, seconds=30, past=4, known=True)


def quick(kind: str, **settings: Any) -> Any:
    if kind == "forest":
        pytest.importorskip("sklearn")
    return method_of(kind, QUICK.get(kind, {}) | settings)
