"""Datasets of one vessel joined: every run keeps its rows, and nothing that must agree is guessed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import BREAK, Dataset, read_dataset, stretches_of_runs, write_dataset
from shipid.data.windows import cut_windows
from shipid.errors import DataError
from shipid.logs.joining import join_datasets
from tests.cli.running import ended, output_of
from tests.drawn import seeds

ORIGIN = {"latitude": 54.0, "longitude": 10.0}


def recording(seed: int, runs: tuple[str, ...] = ("a", "b"), begin: float = 0.0, **metadata: Any) -> Dataset:
    """Runs of 20 to 40 rows, one after another, with drawn motion; the second flag marks a break."""
    random, frames, t0 = np.random.default_rng(seed), [], begin
    for run in runs:
        count = int(random.integers(20, 40))
        t = t0 + np.arange(count, dtype=float)
        names = ("north", "east", "psi", "u", "v", "r", "rudder.delta", "propeller.n")
        motion = {name: random.normal(size=count).cumsum() / 9 for name in names}
        frames.append(pd.DataFrame({"run": run, "t": t, **motion, "flags": 2 * (np.arange(count) == 7)}))
        t0 = t[-1] + 5.0
    flags = ["despiked", BREAK] if seed % 2 else ["scale", BREAK]
    whole = pd.concat(frames, ignore_index=True).astype({"run": "str", "flags": "int64"})
    return Dataset(whole, {"flags": flags, "clock": "shared", "manoeuvres": {runs[0]: "zigzag"}, **metadata})


def joined(*parts: Dataset) -> tuple[Dataset, list[str]]:
    return join_datasets({Path(f"day {number}.parquet"): part for number, part in enumerate(parts)})


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_every_run_keeps_its_rows_its_breaks_and_its_windows(seed: int) -> None:
    parts = recording(seed), recording(seed + 1, ("c", "d", "e"), begin=1000.0)
    whole, notes = joined(*parts)
    assert notes == []
    assert whole.runs == ["a", "b", "c", "d", "e"]
    assert whole.metadata["manoeuvres"] == {"a": "zigzag", "c": "zigzag"}
    for part in parts:
        again = whole.select(part.runs)
        pd.testing.assert_frame_equal(again.frame.drop(columns="flags"), part.frame.drop(columns="flags"))
        assert [len(rows) for _, rows in stretches_of_runs(again)] == [len(rows) for _, rows in stretches_of_runs(part)]
        cut = [cut_windows(one, horizon=5, step=1.0, interval=2.0) for one in (again, part)]
        np.testing.assert_array_equal(cut[0].future, cut[1].future)


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_a_run_that_is_in_two_datasets_is_refused_whatever_it_is_called(seed: int) -> None:
    """Renamed, at another place, on another clock, cut short: it would train on what it tests."""
    random = np.random.default_rng(seed)
    first, other = recording(seed), recording(seed + 50, ("c", "d"), begin=5000.0)
    run = str(random.choice(["a", "b"]))
    rows = first.frame[first.frame["run"] == run]
    rows = rows.iloc[int(random.integers(0, 8)) : len(rows) - int(random.integers(0, 8))]
    rows = rows.assign(run="e", north=rows["north"] + 100.0, t=rows["t"] + random.uniform(6000, 9000))
    both = pd.concat([other.frame, rows], ignore_index=True).astype({"run": "str"})
    copy = Dataset(both, other.metadata)
    parts = [first, other.select(["c"]), copy] if seed % 2 else [copy, first]
    with pytest.raises(DataError, match=r"of its rows from day \d\.parquet: a copy would train on what it tests"):
        joined(*parts)
    still = dict.fromkeys(("u", "v", "r"), 0.0)  # at rest in both: no copy
    joined(*(Dataset(one.frame.assign(**still), one.metadata) for one in (first, other)))


def test_runs_of_one_name_are_told_apart_by_their_files() -> None:
    whole, notes = joined(recording(1), recording(2, begin=900.0))
    assert whole.runs == ["day 0 a", "day 0 b", "day 1 a", "day 1 b"]
    assert whole.metadata["manoeuvres"] == {"day 0 a": "zigzag", "day 1 a": "zigzag"}
    assert "names begin with day 0, day 1" in notes[0]
    same = join_datasets({Path("one/log.parquet"): recording(1), Path("two/log.parquet"): recording(2, begin=900.0)})[0]
    assert same.runs == ["log a", "log b", "log a (2)", "log b (2)"]


def test_positions_have_the_first_origin() -> None:
    """A minute of latitude is a nautical mile, 1852 m, within half a per cent."""
    there = recording(2, ("c",), begin=900.0, origin={"latitude": 54.0 + 1 / 60, "longitude": 10.0})
    whole, notes = joined(recording(1, origin=ORIGIN), there)
    moved = whole.select(["c"]).frame["north"] - there.frame["north"]
    np.testing.assert_allclose(moved, 1852.0, rtol=5e-3)
    np.testing.assert_allclose(whole.select(["c"]).frame["east"], there.frame["east"], atol=1e-6)
    assert "positions moved by" in notes[0]
    assert whole.metadata["origin"] == ORIGIN
    with pytest.raises(DataError, match=r"day 1.parquet: origin: positions have no origin"):
        joined(recording(1, origin=ORIGIN), recording(2, ("c",), begin=900.0))


def test_clocks_that_overlap_are_those_of_runs_unless_they_have_dates() -> None:
    whole, notes = joined(recording(1), recording(2, ("c",)))
    assert whole.metadata["clock"] == "run"
    assert "clocks overlap" in notes[0]
    dated = [recording(seed, runs, begin=1.7e9) for seed, runs in ((1, ("a",)), (2, ("c",)))]
    assert joined(*dated)[1] == [], "two recorders of one hour: windows of one moment stay apart from each other"
    assert joined(*dated)[0].frame["t"].min() == 1.7e9


def test_a_clock_for_each_run_stays_one() -> None:
    whole, _ = joined(recording(1, clock="run"), recording(2, ("c", "d")))
    assert whole.metadata["clock"] == "run"
    over = recording(2, ("c", "d"))
    over = Dataset(over.frame.assign(t=over.frame.groupby("run").cumcount().astype(float)), over.metadata)
    with pytest.raises(DataError, match="run 'd' shares moments"):
        joined(recording(1, clock="run"), over)


def test_what_not_all_have_is_left_out_and_said() -> None:
    windy = recording(2, ("c",), begin=900.0)
    windy = Dataset(windy.frame.assign(V_w=3.0, beta_w=1.0), windy.metadata)
    whole, notes = joined(recording(1), windy)
    assert "V_w" not in whole.frame
    assert notes == ["left out, because not all have them: V_w, beta_w"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda one: {"frame": one.frame.rename(columns={"rudder.delta": "stern.delta"})}, "no command rudder.delta"),
        (lambda one: {"frame": one.frame.assign(**{"bow.n": 0.0})}, "day 0.parquet: no command bow.n, which day 1"),
        (lambda one: {"metadata": one.metadata | {"vessel": "another"}}, "another vessel"),
    ],
)
def test_what_must_agree_is_not_guessed(change: Any, message: str) -> None:
    other = recording(2, ("c",), begin=900.0)
    other = Dataset(**{"frame": other.frame, "metadata": other.metadata, **change(other)})
    with pytest.raises(DataError, match=message):
        joined(recording(1, vessel="this"), other)


def test_the_command_writes_one_dataset_and_none_over_another(tmp_path: Path) -> None:
    files = [write_dataset(recording(seed), tmp_path / f"{name}.parquet") for seed, name in ((1, "mon"), (2, "tue"))]
    said = output_of("data", "join", *files, "--out", tmp_path / "both.parquet")
    assert "note: clocks overlap" in said
    assert read_dataset(tmp_path / "both.parquet").runs == ["mon a", "mon b", "tue a", "tue b"]
    before = files[0].read_bytes()
    assert "is named twice" in ended("data", "join", *files, "--out", files[0])[2]
    assert files[0].read_bytes() == before
    assert "needs two or more" in ended("data", "join", files[0], files[0], "--out", tmp_path / "x.parquet")[2]


def test_a_copy_mixed_clocks_and_another_sea_are_refused() -> None:
    with pytest.raises(DataError, match=r"day 1\.parquet: run 'a' has 100 % of its rows from day 0\.parquet"):
        joined(recording(1), recording(1))
    with pytest.raises(DataError, match=r"day 1\.parquet: its clock has no date, that of another has"):
        joined(recording(1, begin=1.7e9), recording(2, ("c",)))
    far = recording(2, ("c",), begin=900.0, origin={"latitude": 60.0, "longitude": 20.0})
    with pytest.raises(DataError, match=r"its origin is \d+ km from that of day 0\.parquet"):
        joined(recording(1, origin=ORIGIN), far)
