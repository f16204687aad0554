"""A survey of runs against motion known in closed form."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.study.survey import helm_sense, separation, survey, typical_runs
from tests.logs.conftest import as_dataset, turning

T = np.arange(0.0, 100.0, 0.5)


def test_a_steady_turn_is_described_by_its_numbers() -> None:
    summary = survey(as_dataset(turning(T), turning(T[:81])))
    assert list(summary.runs.index) == ["a", "b"]
    assert summary.runs["duration"].tolist() == [99.5, 40.0]
    assert summary.step == 0.5
    assert summary.speed == pytest.approx(np.hypot(4.0, 0.5))
    np.testing.assert_allclose(summary.runs["rate"], 0.05)
    assert summary.factor == pytest.approx(1.0, abs=1e-3)
    assert summary.runs["whole"].all()


def test_a_run_that_is_there_twice_is_a_fault() -> None:
    """A copy in the training tells the test: no study of it says how well a ship is predicted."""
    weave = turning(T).assign(u=4 + np.sin(T / 9), v=np.sin(T / 8), r=0.05 + 0.01 * np.sin(T / 7))
    other = turning(T).assign(u=4 + np.cos(T / 9), v=np.cos(T / 8), r=0.05 + 0.01 * np.cos(T / 7))
    (first, second) = survey(as_dataset(weave, weave, other, clock="run")).faults
    assert first == "run 'a': 100 % of the rows belong to another run, too, most in 'b'"
    assert second.endswith("most in 'a'")


@pytest.mark.parametrize(("scale", "turn"), [(0.5, 0.0), (1.2, 0.3)])
def test_the_factor_is_how_positions_differ_from_velocities(scale: float, turn: float) -> None:
    frame = turning(T)
    place = scale * np.exp(1j * turn) * (frame["north"].to_numpy() + 1j * frame["east"].to_numpy())
    summary = survey(as_dataset(frame.assign(north=place.real, east=place.imag)))
    assert summary.factor == pytest.approx(scale * np.exp(1j * turn), abs=2e-3)


def test_a_broken_run_is_judged_by_its_longest_piece() -> None:
    frame = turning(T)
    frame["flags"] = np.where(T == 30.0, 1, 0)
    summary = survey(as_dataset(frame)).runs.loc["a"]
    assert not summary["whole"]
    assert summary["duration"] == 99.5 - 30.0


def test_jitter_does_not_grow_with_the_lag_and_a_wrong_speed_does() -> None:
    rng, frame = np.random.default_rng(2), turning(T)
    jitter = as_dataset(frame.assign(north=frame["north"] + rng.normal(0, 2.0, len(T))))
    wrong = as_dataset(frame.assign(u=1.1 * frame["u"]))
    assert separation(jitter, 20.0) == pytest.approx(separation(jitter, 5.0), rel=0.3)
    assert separation(wrong, 20.0) > 3 * separation(wrong, 5.0)
    assert separation(wrong, 1000.0) == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_sense_of_a_helm_is_that_of_the_yaw_it_starts(sign: float) -> None:
    helm = np.where((T // 10) % 2 == 0, 0.2, -0.2)
    r = np.append(0.0, np.cumsum(0.01 * helm[:-1]))
    frame = turning(T).assign(r=r, **{"rudder.delta": sign * helm, "other.delta": 0.0})
    assert helm_sense(as_dataset(frame)) == {"rudder.delta": pytest.approx(sign)}


def test_the_typical_run_is_the_middle_one_and_neither_broken_nor_the_longest() -> None:
    speeds = [3.0, 3.9, 4.0, 4.1, 5.0]
    runs = pd.DataFrame(
        {"kind": "zigzag", "speed": speeds, "rate": 0.05, "helm": 0.2, "whole": True, "sound": True, "duration": 60.0},
        index=list("abcde"),
    )
    runs.loc["e", "duration"] = 90.0
    assert typical_runs(runs) == ["c"]
    runs.loc["c", "whole"] = False
    assert typical_runs(runs)[0] in ("b", "d")


def test_each_kind_gives_a_typical_run_where_more_than_six_runs_are_there() -> None:
    def runs(count: int) -> pd.DataFrame:
        numbers = {"speed": 3.0, "rate": 0.05, "helm": 0.2, "whole": True, "sound": True, "duration": 60.0}
        return pd.DataFrame({"kind": ["zigzag", "turning"] * (count // 2), **numbers}, index=list("abcdefgh"[:count]))

    assert len(typical_runs(runs(6))) == 1
    assert len(typical_runs(runs(8))) == 2


@pytest.mark.parametrize("seed", range(6))
def test_speeds_through_the_water_lack_a_steady_vector(seed: int) -> None:
    """Before, `study new` called such positions scattered, or the velocities wrong by a factor."""
    rng, frame = np.random.default_rng(seed), turning(T)
    drift = complex(rng.uniform(0.2, 1.0) * np.exp(1j * rng.uniform(-3, 3)))
    moved = frame.assign(
        north=frame["north"] + drift.real * T + rng.normal(0, 0.3, len(T)),
        east=frame["east"] + drift.imag * T + rng.normal(0, 0.3, len(T)),
    )
    seen = survey(as_dataset(moved))
    assert seen.stream is not None
    assert seen.stream[0] == pytest.approx(drift, abs=0.05)
    assert seen.stream[1] > 0.8


def test_the_share_of_a_stream_is_that_of_the_squared_misfit() -> None:
    rng, frame = np.random.default_rng(1), turning(T)
    noise = rng.normal(0, 2.0, (2, len(T)))
    moved = frame.assign(north=frame["north"] + 0.8 * T + noise[0], east=frame["east"] + noise[1])
    seen = survey(as_dataset(moved)).stream
    assert seen is not None
    run, scatter = (0.8 * 10.0) ** 2, 4 * 2.0**2  # m^2 in 10 s: two positions, each 2 m off in both directions
    assert seen[1] == pytest.approx(run / (run + scatter), abs=0.06)


@pytest.mark.parametrize("seed", range(6))
def test_jitter_and_a_wrong_unit_are_no_stream(seed: int) -> None:
    rng, frame = np.random.default_rng(seed), turning(T)
    jitter = frame.assign(
        north=frame["north"] + rng.normal(0, 2, len(T)), east=frame["east"] + rng.normal(0, 2, len(T))
    )
    straight = turning(T, r=1e-7)
    wrong = [frame.assign(u=1.3 * frame["u"], v=1.3 * frame["v"]), straight.assign(u=1.3 * straight["u"])]
    for one in (frame, jitter, *wrong):
        assert survey(as_dataset(one)).stream is None


def drifting(current: complex, *runs: pd.DataFrame) -> Dataset:
    """Runs with u and v through the water of a steady current, north + i east [m/s]."""
    return as_dataset(
        *(run.assign(north=run["north"] + current.real * T, east=run["east"] + current.imag * T) for run in runs)
    )


def test_speeds_through_the_water_show_the_current() -> None:
    noise = np.random.default_rng(3).normal(0, 0.2, (2, len(T)))
    circles = [
        turning(T, psi0=psi0).assign(north=lambda x: x["north"] + noise[0], east=lambda x: x["east"] + noise[1])
        for psi0 in (0.0, 2.0)
    ]
    stream = survey(drifting(0.4 + 0.6j, *circles)).stream
    assert stream is not None
    current, share = stream
    assert current == pytest.approx(0.4 + 0.6j, abs=0.02)
    assert share > 0.9
    assert survey(as_dataset(*circles)).stream is None


def test_what_is_no_current_is_none() -> None:
    """A wrong unit, a turned heading, a drift of one straight run, and a weak current."""
    straight = turning(T, r=1e-6)
    assert survey(as_dataset(turning(T).assign(u=lambda x: 1.3 * x["u"], v=lambda x: 1.3 * x["v"]))).stream is None
    assert survey(as_dataset(turning(T).assign(psi=lambda x: x["psi"] + 0.1))).stream is None
    assert survey(drifting(0.5 + 0.3j, straight)).stream is None
    assert survey(drifting(0.05 + 0.02j, turning(T))).stream is None
