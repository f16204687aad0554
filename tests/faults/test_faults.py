"""A few seconds of the campaign of faults; `make faults` runs more of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from shipid.logs.readers import read_log_table
from shipid.study.plan import read_plan
from tests.faults import recordings
from tests.faults.campaign import ROWS
from tests.faults.mutations import MUTATIONS, documents, mutated
from tests.faults.trials import Failure, outcome, outcomes, table
from tests.logs.conftest import T

QUICK = {
    "study": 12,
    "vessel": 25,
    "mapping": 25,
    "log": 25,
    "predictor": 15,
    "dataset": 8,
    "memory": 6,
    "mcap log": 4,
    "ulg log": 4,
    "exchanged log": 20,
    "function": 6,
    "predictions": 6,
    "package": 3,
    "options": 10,
    "damaged": 4,
    "killed": 3,
}


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.filterwarnings("ignore")
def test_a_few_faults(name: str) -> None:
    drawn = [outcome(ROWS[name].trial, seed) for seed in range(5000, 5000 + QUICK[name])]
    assert not [one for one in drawn if one.failed], table({name: drawn})


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(ROWS.keys() - QUICK.keys()))
@pytest.mark.filterwarnings("ignore")
def test_a_few_slow_faults(name: str) -> None:
    drawn = [outcome(ROWS[name].trial, seed) for seed in range(6 if name == "exported" else 2)]
    for one in drawn:
        if one.kind == "skipped":
            pytest.skip(one.words)
    assert not [one for one in drawn if one.failed], table({name: drawn})


@pytest.mark.parametrize("ending", recordings.SOUND)
def test_a_recording_that_is_not_damaged_is_read(ending: str, tmp_path: Path) -> None:
    write, form = recordings.SOUND[ending]
    assert len(read_log_table(write(tmp_path), form, "time")) >= len(T)


def test_the_study_with_every_block_is_sound() -> None:
    """It was not for a while, and no mutation of it was ever run."""
    assert read_plan(documents("study")["rich"]).study.cost is not None


def test_mutations_are_drawn_by_seed() -> None:
    assert [mutated("study", seed) for seed in range(20)] == [mutated("study", seed) for seed in range(20)]
    texts = {mutated(kind, seed)[0] for kind in ("study", "vessel", "mapping") for seed in range(50)}
    sources = {file.read_bytes() for kind in ("study", "vessel", "mapping") for file in documents(kind).values()}
    assert len(texts - sources) > 100
    assert len(MUTATIONS) > 5


def _hangs(_: int) -> None:
    while True:
        pass


def _dies(seed: int) -> None:
    import os

    os._exit(seed)


def _wrong(_: int) -> None:
    raise Failure("mixed", "two runs")


def _fails(_: int) -> None:
    raise KeyError("no line")


@pytest.mark.filterwarnings("ignore")  # a fork in a process with threads
def test_every_way_to_fail_is_distinguished() -> None:
    """The campaign can fail: each outcome is recognised, and the next trial runs."""
    kinds = {"hang": _hangs, "died": _dies, "mixed": _wrong, "traceback": _fails}
    for kind, work in kinds.items():
        trials = list(outcomes(work, [3, 4], 0.3 if kind == "hang" else 60.0))
        assert [(one.trial, one.kind) for one in trials] == [(3, kind), (4, kind)]
        assert f"2 {kind}" in table({"row": trials})
