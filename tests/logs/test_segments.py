"""Manoeuvres of a recording are cut where they were made: helm, heading and shaft speed are given."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset, stretches_of_runs
from shipid.logs.segments import find_manoeuvres, run_kind
from tests.logs.conftest import as_dataset

Part = tuple[float, float, float, float]  # seconds, helm [deg], yaw rate [deg/s], shaft [rev/s]
STRAIGHT: Part = (120, 0, 0, 2.5)
ZIGZAG: list[Part] = [(20, 10, 1, 2.5), (30, -10, -1, 2.5), (30, 10, 1, 2.5), (20, -10, -1, 2.5)]
TURN: Part = (200, 20, 1.5, 2.5)
FASTER: Part = (100, 0, 0, 3.5)


def recording(*parts: Part, helm: bool = True) -> Dataset:
    """A recording, a row a second, put together from parts."""
    rows = np.repeat([part[1:] for part in parts], [int(part[0]) for part in parts], axis=0)
    r = np.radians(rows[:, 1])
    still = dict.fromkeys(("north", "east", "v"), np.zeros(len(rows)))
    columns = {"t": np.arange(float(len(rows))), **still, "psi": np.cumsum(r), "u": np.full(len(rows), 4.0), "r": r}
    columns |= {"rudder.delta": np.radians(rows[:, 0])} if helm else {}
    return as_dataset(pd.DataFrame({**columns, "propeller.n": rows[:, 2]}))


def cut(dataset: Dataset) -> list[tuple[str | None, float, float]]:
    return [(one.manoeuvre, one.start, one.end) for one in find_manoeuvres(dataset)]


def test_each_manoeuvre_begins_ten_seconds_before_its_first_order() -> None:
    segments = cut(recording(STRAIGHT, *ZIGZAG, STRAIGHT, TURN, STRAIGHT))
    assert segments == [
        ("transit", 0.0, 110.0),
        ("zigzag", 110.0, 220.0),
        ("transit", 220.0, 330.0),
        ("turning", 330.0, 540.0),
        ("transit", 540.0, 659.0),
    ]
    assert all(first[2] == second[1] for first, second in pairwise(segments))


def test_names_count_each_kind() -> None:
    names = [one.run for one in find_manoeuvres(recording(STRAIGHT, TURN, STRAIGHT, TURN, STRAIGHT))]
    assert names == ["transit 1", "turning 1", "transit 2", "turning 2", "transit 3"]


def test_without_a_helm_the_yaw_rate_takes_its_place() -> None:
    assert [kind for kind, *_ in cut(recording(STRAIGHT, *ZIGZAG, STRAIGHT, helm=False))] == [
        "transit",
        "zigzag",
        "transit",
    ]


def test_two_legs_are_no_zigzag() -> None:
    assert {kind for kind, *_ in cut(recording(STRAIGHT, *ZIGZAG[:2], STRAIGHT))} == {"transit"}


def test_a_long_pause_amidships_ends_a_zigzag() -> None:
    parts = [STRAIGHT, *ZIGZAG, (90.0, 0.0, 0.0, 2.5), *ZIGZAG, STRAIGHT]
    assert [kind for kind, *_ in cut(recording(*parts))].count("zigzag") == 2
    parts[5] = (8.0, 0.0, 0.0, 2.5)
    assert [kind for kind, *_ in cut(recording(*parts))].count("zigzag") == 1


def test_a_straight_with_another_shaft_speed_is_a_speed_run() -> None:
    assert [kind for kind, *_ in cut(recording(STRAIGHT, FASTER))] == ["speed run"]


def test_times_are_in_the_unit_of_the_clock() -> None:
    (transit, *_) = find_manoeuvres(recording(STRAIGHT, TURN), unit=60.0)
    assert (transit.start, transit.end) == (0.0, pytest.approx(110.0 / 60.0))


@pytest.mark.parametrize(
    ("parts", "kind"),
    [([(30, 0, 0, 2.5), TURN], "turning"), ([(20, 0, 0, 2.5), *ZIGZAG], "zigzag"), ([STRAIGHT], "transit")],
)
def test_the_kind_of_a_run_is_what_takes_most_of_it(parts: list[Part], kind: str) -> None:
    ((_, rows),) = stretches_of_runs(recording(*parts))
    assert run_kind(rows) == kind


def test_a_run_without_a_kind_that_takes_half_of_it_is_mixed() -> None:
    dataset = recording((150, 0, 0, 2.5), TURN, *ZIGZAG, TURN)
    (_, rows), *_ = stretches_of_runs(dataset)
    assert run_kind(rows) == "turning"  # 400 of 650 s
    (_, rows), *_ = stretches_of_runs(recording((150, 0, 0, 2.5), TURN, *ZIGZAG, *ZIGZAG))
    assert run_kind(rows) == "mixed"  # a third each


def test_segments_of_several_files_name_theirs() -> None:
    assert {one.file for one in find_manoeuvres(recording(STRAIGHT, TURN), files=True)} == {"a"}
