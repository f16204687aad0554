"""Manoeuvres do what the field means by them, on a ship whose turns are known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DocumentError
from shipid.measures.recognise import record_of
from shipid.measures.zigzag import zigzag_measures
from shipid.simulation.approach import Controls
from shipid.simulation.manoeuvre import (
    KINDS,
    CrashStop,
    Excitation,
    Manoeuvre,
    Request,
    Spiral,
    StepManoeuvre,
    TurningCircle,
    Zigzag,
    aprbs_series,
    limit_rate,
    round_to_rows,
)
from shipid.simulation.perform import perform_manoeuvres
from shipid.units import DEGREE
from shipid.vessel.load import Vessel, load_vessel
from tests.conftest import LAG

SHIP = load_vessel("gunnerus-28.9")
LAGGED = SHIP.with_values({f"thruster.{side}.actuator": LAG for side in ("port", "starboard")})
PAIRS = [(10, 10), (20, 20), (20, 10), (10, 20)]


def runs(frame: pd.DataFrame) -> list[pd.DataFrame]:
    return [run.reset_index(drop=True) for _, run in frame.groupby("run", sort=False)]


def one(vessel: Vessel, manoeuvre: Manoeuvre, **how: Any) -> pd.DataFrame:
    return perform_manoeuvres(vessel, [manoeuvre], **{"step": 0.1, **how})


def held(log: pd.DataFrame, hold: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Helm [deg, > 0 to starboard: the azimuths turn the other way] and yaw rate [deg/s] at the end of each level."""
    last = np.isclose(log["t"] % hold, hold - step)
    return -log["port.alpha"].to_numpy()[last] / DEGREE, log["r"].to_numpy()[last] / DEGREE


@cache
def zigzags() -> pd.DataFrame:
    """Every pair to either side, at two speeds."""
    chosen = [
        Zigzag(n_rpm=n, angle_deg=angle, execute_heading_deg=heading, side=side, duration=90, course_deg=30)
        for n in (110, 160)
        for angle, heading in PAIRS
        for side in ("starboard", "port")
    ]
    return perform_manoeuvres(SHIP, chosen, step=0.1)


def test_zigzag_reverses_at_the_execute_heading_within_one_step() -> None:
    """At each reversal the ship has just come to the execute heading: not before, at most one step's turning ago."""
    logs = runs(zigzags())
    assert len(logs) == 16
    for log, (_, heading) in zip(logs, [pair for pair in PAIRS * 2 for _ in range(2)], strict=True):
        turned, order = log["psi"].to_numpy() / DEGREE - 30, log["port.alpha"].to_numpy()
        reversals = np.flatnonzero(np.diff(order)) + 1
        assert len(reversals) >= 2
        sides = np.sign(order[reversals - 1])
        np.testing.assert_array_equal(np.sign(order[reversals]), -sides)
        beyond = -sides * turned[reversals] - heading
        one_step = 0.1 * np.abs(log["r"]).max() / DEGREE
        assert (beyond >= -1e-9).all()
        assert (beyond <= one_step).all()


@pytest.mark.parametrize("side", ["starboard", "port"])
@pytest.mark.parametrize("beta", [45.0, 90.0, 135.0])
def test_a_zigzag_counts_from_the_heading_at_the_first_order(side: str, beta: float) -> None:
    """Wind turns the ship by 2 to 44 deg before it: the zigzag begins to the side asked for, about that heading."""
    chosen = Zigzag(n_rpm=145, angle_deg=10, side=side, execute_at=60, duration=160)  # type: ignore[arg-type]
    log = one(SHIP, chosen, environment={"V_w": 20.0, "beta_w": beta * DEGREE})
    psi, order, r = (log[name].to_numpy() / DEGREE for name in ("psi", "port.alpha", "r"))
    executes = np.flatnonzero(np.diff(order)) + 1
    first, sense = executes[0], 1.0 if side == "starboard" else -1.0
    assert log["t"][first] == pytest.approx(60.0)
    assert abs(psi[first]) > 1
    helm = -order[executes] / 10  # the azimuths turn the other way
    np.testing.assert_allclose(helm, sense * (-1.0) ** np.arange(len(executes)))
    assert len(executes) >= 4
    beyond = helm[:-1] * (psi[executes[1:]] - psi[first]) - 10
    assert (beyond >= 0).all()
    assert (beyond <= 0.1 * np.abs(r).max()).all()
    measures = zigzag_measures(record_of({name: log[name].to_numpy() for name in log if name != "run"}))
    assert measures["execute_heading"].value == pytest.approx(10 * DEGREE)
    assert 0 < measures["overshoot_1"].value < 2 * DEGREE


def test_together_is_one_at_a_time() -> None:
    """Kinds, speeds, sides and starts mixed: each run is what it is alone, in the order given."""
    mixed = [
        Zigzag(name="zigzag 20/20", n_rpm=145, duration=40),
        TurningCircle(name="circle", n_rpm=120, duration=30, side="port"),
        Zigzag(name="zigzag 10/10", n_rpm=110, angle_deg=10, execute_heading_deg=10, duration=60, approach="rest"),
        CrashStop(name="stop", n_rpm=120, astern_rpm=100, duration=20, execute_at=5),
    ]
    wind = {"V_w": np.arange(4.0), "beta_w": np.full(4, 0.4)}
    together = perform_manoeuvres(LAGGED, mixed, step=0.1, environment=wind)
    assert list(together["run"].unique()) == [manoeuvre.name for manoeuvre in mixed]
    for number, manoeuvre in enumerate(mixed):
        alone = one(LAGGED, manoeuvre, environment={name: float(values[number]) for name, values in wind.items()})
        log = together[together["run"] == manoeuvre.name].reset_index(drop=True)
        pd.testing.assert_frame_equal(log, alone, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("n_rpm", "u", "v", "r"), [(145, 2.76, 0.60, 3.54), (200, 3.81, 0.72, 4.95)])
def test_turning_circle_is_the_known_steady_turn(n_rpm: float, u: float, v: float, r: float) -> None:
    """Steady turns at 35 deg of the 2015 derivatives, integrated separately in NumPy [m/s, m/s, deg/s]."""
    to_either = [TurningCircle(n_rpm=n_rpm, duration=200, side=side) for side in ("starboard", "port")]
    for log, sense in zip(runs(perform_manoeuvres(SHIP, to_either, step=0.1)), (1, -1), strict=True):
        end = log.iloc[-1]
        assert end["u"] == pytest.approx(u, abs=0.01)
        assert end["v"] == pytest.approx(-sense * v, abs=0.01)
        assert end["r"] / DEGREE == pytest.approx(sense * r, abs=0.02)


def test_steps_hold_levels_in_their_ranges() -> None:
    """Levels differ, each holds for 2 to 5 s, shaft and angle change at different times; another seed, other orders."""
    steps = StepManoeuvre(orders={"n_rpm": (60, 90), "alpha_deg": (-20, 10)}, hold=(2.0, 5.0), seed=3, duration=60)
    log = one(SHIP, steps)
    for signal, unit, low, high in (("n", 1 / 60, 60, 90), ("alpha", DEGREE, -20, 10)):
        series = log[f"port.{signal}"].to_numpy() / unit
        assert low <= series.min() < low + 0.25 * (high - low)
        assert high - 0.25 * (high - low) < series.max() <= high
        changes = np.flatnonzero(np.diff(series))
        assert 11 <= len(changes) <= 30
        held_for = np.diff(changes) * 0.1
        assert held_for.min() > 1.9
        assert held_for.max() < 5.1
        np.testing.assert_array_equal(log[f"starboard.{signal}"], log[f"port.{signal}"])
    times = [set(np.flatnonzero(np.diff(log[name]))) for name in ("port.n", "port.alpha")]
    assert len(times[0] & times[1]) < len(times[0]) / 2
    other = one(SHIP, steps.model_copy(update={"seed": 4}))
    assert np.abs(other["port.n"] - log["port.n"]).max() > 0.1


def test_the_direct_spiral_jumps_across_the_loop_of_an_unstable_ship() -> None:
    changes = {"N_uv": 0.0, "N_ur": 3e6, "N_uur": 0.0}  # yaw damping turned round
    unstable = SHIP.with_values({f"hull.derivatives.{name}": value for name, value in changes.items()})
    direct = Spiral(n_rpm=145, hold=100, angles_deg=(10, 0, -10, 0, 10))
    _, jumped = held(one(unstable, direct, step=0.2), 100, 0.2)
    assert jumped[1] > 5
    assert jumped[3] < -5


@pytest.mark.parametrize("vessel", [SHIP, LAGGED], ids=["ideal", "lagged"])
def test_crash_stop_reverses_the_thrust_and_stops(vessel: Vessel) -> None:
    log = one(vessel, CrashStop(n_rpm=145, astern_rpm=120, execute_at=3, duration=63))
    t, u = log["t"].to_numpy(), log["u"].to_numpy()
    np.testing.assert_allclose(log["port.n"][t < 2.95], 145 / 60)
    np.testing.assert_allclose(log["port.n"][t > 2.95], -120 / 60)
    np.testing.assert_allclose(u[t < 2.95], u[0], atol=2e-3)  # still the approach
    stopped = np.flatnonzero(u <= 0)[0]
    assert 5 < t[stopped] - 3 < 60
    assert (np.diff(u[(t > 3.5) & (t < t[stopped])]) < 0).all()
    assert np.abs(log["r"]).max() < 1e-12


def test_excitation_moves_within_its_limits() -> None:
    asked = {"angle_deg": 15, "amplitude_rpm": 30, "angle_rate_deg": 4, "shaft_rate_rpm": 8, "execute_at": 10}
    excitation = Excitation(n_rpm=130, duration=310, seed=4, **asked)
    log = one(SHIP, excitation)
    helm, shaft = log["port.alpha"].to_numpy() / DEGREE, log["port.n"].to_numpy() * 60 - 130
    for series, most, rate in ((helm, 15, 4), (shaft, 30, 8)):
        assert (np.abs(series[:100]) < 1e-9).all()
        assert 0.7 * most < np.abs(series).max() <= most * 1.0000001
        assert np.abs(np.diff(series)).max() <= rate * 0.1 * 1.0000001
        assert series.std() > 0.25 * most
    assert abs(np.corrcoef(helm, shaft)[0, 1]) < 0.3
    pd.testing.assert_frame_equal(log, one(SHIP, excitation))
    other = one(SHIP, excitation.model_copy(update={"seed": 5}))
    assert np.abs(other["port.alpha"] - log["port.alpha"]).max() > 1 * DEGREE


@pytest.mark.parametrize(
    ("kind", "block"),
    [
        ("zigzag", {"n_rpm": 145, "duration": 60, "angle": 20}),
        ("zigzag", {"n_rpm": 145}),
        ("turning", {"duration": 60, "n_rpm": 145}),
        ("turning_circle", {"n_rpm": 145, "duration": 60, "angle_deg": -35}),
        ("spiral", {"n_rpm": 145, "hold": 60, "angles_deg": []}),
        ("excitation", {"n_rpm": 145, "duration": 60, "hold": [20.0, 5.0]}),
        ("steps", {"orders": {"n_rpm": 145}, "duration": 60}),
    ],
)
def test_impossible_blocks_are_refused(kind: str, block: dict[str, Any]) -> None:
    with pytest.raises(DocumentError):
        KINDS[kind](**block)


def steps(**changes: Any) -> np.ndarray:
    return aprbs_series(
        np.arange(20001) * 0.1, **{"hold": (4.0, 15.0), "levels": (-0.5, 0.3), "key": (7, 1), **changes}
    )


def test_a_longer_series_begins_with_the_shorter() -> None:
    time = np.arange(5001) * 0.1
    short = aprbs_series(time[:1001], hold=(4.0, 15.0), levels=(-0.5, 0.3), key=(7, 1))
    np.testing.assert_array_equal(aprbs_series(time, hold=(4.0, 15.0), levels=(-0.5, 0.3), key=(7, 1))[:1001], short)
    np.testing.assert_array_equal(
        aprbs_series(time + 40.0, hold=(4.0, 15.0), levels=(-0.5, 0.3), key=(7, 1))[:1001], short
    )
    assert not np.isin(short, steps(key=(7, 2))).any()


def test_rate_limit_is_respected_and_caught_up_with() -> None:
    ordered = np.stack([steps(), steps(key=(7, 2))], axis=1)
    executed = limit_rate(ordered, 0.1, 0.5)
    assert np.abs(np.diff(executed, axis=0)).max() <= 0.05 * (1 + 1e-9)
    np.testing.assert_array_equal(limit_rate(ordered[:, 0], 0.1, 0.5), executed[:, 0])
    assert executed.min() >= ordered.min()
    assert executed.max() <= ordered.max()
    assert np.mean(np.isclose(executed, ordered)) > 0.8  # 0.8 units at most take 1.6 s of holds of 4 s and more
    ends = np.flatnonzero(np.diff(ordered[:, 0]) != 0)
    np.testing.assert_allclose(executed[ends, 0], ordered[ends, 0])


def test_levels_fill_their_range_evenly() -> None:
    series = steps()
    levels = series[np.concatenate([[0], np.flatnonzero(np.diff(series) != 0) + 1])]
    assert levels.min() >= -0.5
    assert levels.max() < 0.3
    eighth = np.floor((levels + 0.5) / 0.1).astype(int)
    for first in range(0, len(levels) - 8, 8):
        assert sorted(eighth[first : first + 8]) == list(range(8))
    assert len({tuple(eighth[first : first + 8]) for first in range(0, 80, 8)}) > 5  # in another order each time


KEYS = {"n_rpm": 120.0, "execute_at": 10.0, "course_deg": 0.0, "approach": "steady"}
ASKED = Request(Controls(load_vessel("gunnerus-28.9")), 2.0, 3.0, (15.0,), "port", None, 8.0, 0.5, KEYS)


def test_times_are_in_ship_lengths_unless_they_are_given() -> None:
    """A log has what goes by before the first order, too."""
    assert (ASKED.time(30), replace(ASKED, duration=70.0).time(30)) == (250.0, 70.0)


def test_rows_are_whole() -> None:
    assert [round_to_rows(time, ASKED.interval) for time in (1.0, 1.1, 1.5)] == [1.0, 1.5, 1.5]


def test_a_turn_settles_in_time_constants_of_the_ship_within_limits() -> None:
    """The number of lengths is that of the ship between 0 and 200; never less than asked."""
    lengths = ASKED.settling(0.0)
    assert 0 < lengths < 200
    assert ASKED.settling(150.0) == pytest.approx(max(150.0, lengths))
    assert replace(ASKED, passing=1e-6).settling(0.0) == 200.0
