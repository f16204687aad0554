"""Numbers of a study that no one means are refused before anything is computed; a word overrides it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from shipid import capacity
from shipid import document as documents
from shipid.errors import DocumentError
from tests.study.tiny import tiny_plan

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


def test_seeds_that_generators_do_not_take(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="at most 2"):
        tiny_plan(tmp_path, {"grid.seeds": [2**32]})


def test_names_that_no_file_can_have(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="pattern"):
        tiny_plan(tmp_path, {"family.0.name": "n" * 245})


LONG: dict[str, tuple[dict[str, float], int]] = {  # changes, and bytes of memory that all but this take
    "truth.step": ({"truth.step": 0.01, "truth.interval": 20.0, "truth.duration": 40.0}, 1_000_000),
    "truth.interval": ({"truth.step": 0.5, "truth.interval": 0.5}, 40_000),
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
