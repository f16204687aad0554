"""Numbers of a study that no one means are refused before anything is computed; a word overrides it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipid import capacity
from shipid import document as documents
from shipid.data.windows import cut_windows
from shipid.document import bundled_documents
from shipid.errors import DocumentError
from shipid.study.plan import read_plan
from shipid.study.ranges import window_numbers
from shipid.study.schema import Prediction
from tests.study.tiny import logged, tiny_plan

NONSENSE: dict[str, Any] = {
    "truth.manoeuvre.0.alpha_deg": [-50.0, 1e20],
    "truth.manoeuvre.0.n_rpm": [50.0, 1e9],
    "truth.step": 1e-9,
    "truth.duration": 1e9,
    "truth.wind_speed": [0.0, 500.0],
    "prediction.interval": 1e-9,
    "method.0.trials": 10**9,
    "family.1.perturb.0.factor": [0.5, 1e6],
}


@pytest.mark.parametrize("path", NONSENSE)
def test_nonsense_is_refused_with_the_range_and_the_word(path: str, tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"expected .* if it is meant, write unusual") as caught:
        tiny_plan(tmp_path, {path: NONSENSE[path]})
    assert str(caught.value.path).startswith(documents.path_with_names(tiny_plan(tmp_path).document, path))


def test_what_is_meant_is_taken(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, {"truth.wind_speed": [0.0, 500.0], "unusual": ["truth.wind_speed.*"]})
    assert plan.study.unusual == ["truth.wind_speed.*"]


@pytest.mark.parametrize("name", list(bundled_documents("studies")))
def test_bundled_studies_are_usual(name: str) -> None:
    assert not read_plan(name).study.unusual


@pytest.mark.parametrize("seeds", [[2**32], [10**14]])
def test_seeds_that_generators_do_not_take(seeds: list[int], tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="at most 4294967295"):
        tiny_plan(tmp_path, {"grid.seeds": seeds})


def test_names_that_no_file_can_have(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="shorten the names of families and methods"):
        tiny_plan(tmp_path, {"family.0.name": "n" * 245})


LONG: dict[str, tuple[dict[str, float], int]] = {  # changes, and bytes of memory that all but this take
    "truth.step": ({"truth.step": 0.01, "truth.interval": 20.0, "truth.duration": 40.0}, 1_000_000),
    "truth.interval": ({"truth.step": 0.5, "truth.interval": 0.5}, 40_000),
    "prediction.interval": ({"truth.step": 1.0, "prediction.interval": 0.1}, 1_000_000),
}


@pytest.mark.parametrize("path", LONG)
def test_memory_that_cannot_be_had_is_refused_with_its_cause(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes, most = LONG[path]
    monkeypatch.setattr(capacity, "usable_memory", lambda: most)
    with pytest.raises(DocumentError, match="GiB of memory, and there are") as caught:
        tiny_plan(tmp_path, changes)
    assert caught.value.path == path


@pytest.mark.parametrize("horizon", [1, 9])
@pytest.mark.parametrize("past", [0, 7])
def test_the_numbers_are_those_that_windows_hold(horizon: int, past: int) -> None:
    """Not fewer, and no more than what comes and goes while they are cut: a column each at every step."""
    columns = dict.fromkeys(("u", "v", "r", "psi", "north", "east", "propeller.n"), 0.1)
    log = logged({"a": columns, "b": columns}, np.arange(0.0, 60.5, 0.5))
    windows = cut_windows(log, horizon=horizon, past=past, step=2.0, interval=3.0)
    parts = [windows.t, windows.future]
    for group in (windows.columns, windows.planned, windows.past, windows.states):
        parts += group.values()
    held = sum(np.size(part) for part in parts)
    wide = len(log.frame.columns)
    ahead = Prediction.model_construct(ahead=2.0 * horizon, step=2.0, interval=3.0)
    numbers = 2 * window_numbers(ahead, past, wide, 0, 60.0)
    assert held <= numbers <= len(windows.t) * ((horizon + 1) * 2 * wide + (past + 1) * wide)
    more = 2 * window_numbers(ahead, past, wide, 2, 60.0)
    assert more - numbers == len(windows.t) * (horizon + 1) * 4, "north and east of two foundations"
    assert window_numbers(ahead, past, wide, 0, 0.0) > 0
