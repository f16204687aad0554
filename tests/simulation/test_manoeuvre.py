"""Manoeuvres do what the field means by them, on a ship whose turns are known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
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
from shipid.simulation.truth import ManoeuvreDraw, Truth, check_truth, draw_manoeuvres, simulate_truth
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


SHIP = load_vessel("gunnerus-28.9")
LAGGED = SHIP.with_values({f"thruster.{side}.actuator": LAG for side in ("port", "starboard")})
SHAFT = {"n_rpm": [80.0, 150.0]}
BLOCKS: dict[str, dict[str, Any]] = {
    "turning": {**SHAFT, "alpha_deg": [-40.0, 40.0], "start_speed": [0.0, 2.0]},
    "steps": {**SHAFT, "alpha_deg": [-40.0, 40.0], "hold": [2.0, 6.0]},
    "turning_circle": {**SHAFT, "angle_deg": [10.0, 35.0], "side": ["starboard", "port"]},
    "pull_out": {**SHAFT, "turn": [5.0, 10.0]},
    "zigzag": {**SHAFT, "angle_deg": [10.0, 30.0], "side": ["starboard", "port"], "approach": "rest"},
    "spiral": {**SHAFT, "hold": 4.0, "angles_deg": [20.0, -20.0, 5.0]},
    "crash_stop": {**SHAFT, "astern_rpm": [50.0, 100.0], "execute_at": [0.0, 5.0]},
    "excitation": {**SHAFT, "angle_deg": 15.0, "hold": [2.0, 6.0]},
}


def truth(*blocks: dict[str, Any], **changes: Any) -> Truth:
    given = {"vessel": "gunnerus-28.9", "manoeuvres": 3, "duration": 20.0, "step": 0.1, "seed": 5}
    return Truth(**{**given, "manoeuvre": list(blocks), **changes})


def test_every_kind_has_an_example() -> None:
    assert set(BLOCKS) == set(KINDS)


@pytest.mark.parametrize("kind", list(BLOCKS))
def test_every_kind_is_a_truth(kind: str) -> None:
    """A dataset, each run as long as run-up and duration say, no two runs alike; more runs change none that exist."""
    block = {"kind": kind, **BLOCKS[kind]}
    few = simulate_truth(truth(block, manoeuvres=2, run_up=5.0), LAGGED)
    many = simulate_truth(truth(block, manoeuvres=4, run_up=5.0), LAGGED)
    pd.testing.assert_frame_equal(many.iloc[: len(few)], few, rtol=1e-9, atol=1e-9)
    runs = [run for _, run in many.groupby("run")]
    assert len(Dataset(many, {"clock": "run", "flags": []}).frame) == 4 * 26
    for run in runs:
        np.testing.assert_allclose(run["t"], np.arange(26.0))
    for name in ("psi", "port.n", "V_w"):
        assert len({tuple(run[name].round(9)) for run in runs}) == 4, name


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if "execute_at" in kind.model_fields])
def test_a_first_order_after_the_end_of_the_run_is_refused(kind: str) -> None:
    """Such a run was straight, and was called a zigzag."""
    block = {"kind": kind, **BLOCKS[kind]}
    check_truth(truth({**block, "execute_at": 19.0}), SHIP)
    if "duration" not in KINDS[kind].model_fields:  # it ends so long after its first order
        check_truth(truth({**block, "execute_at": 300.0}), SHIP)
        return
    for late in (20.0, [0.0, 300.0]):
        with pytest.raises(DocumentError, match="the run ends at 20 s, before the first order: give less") as caught:
            check_truth(truth({**block, "execute_at": late}), SHIP)
        assert caught.value.path == "truth.manoeuvre.0.execute_at"


def test_shares_are_met_and_no_run_depends_on_their_number() -> None:
    """400 draws: a share of 0.3 within 5 standard errors."""
    blocks = {"kind": "zigzag", "share": 0.3, **SHAFT}, {"kind": "turning", "share": 0.7, **BLOCKS["turning"]}
    many = draw_manoeuvres(truth(*blocks, manoeuvres=400))
    zigzags = [isinstance(one, Zigzag) for one in many]
    assert abs(np.mean(zigzags) - 0.3) < 5 * np.sqrt(0.3 * 0.7 / 400)
    assert many[:50] == draw_manoeuvres(truth(*blocks, manoeuvres=50))
    doubled = [{**block, "share": 2 * block["share"]} for block in blocks]
    assert many == draw_manoeuvres(truth(*doubled, manoeuvres=400))


def test_pairs_are_drawn_where_a_number_is_wanted() -> None:
    def at(place: float) -> Any:
        return lambda _: place

    zigzag = ManoeuvreDraw(kind="zigzag", n_rpm=[80, 150], angle_deg=20, side=["starboard", "port"])
    low, high = (zigzag.manoeuvre(60.0, at(place)) for place in (0.0, 0.999))
    assert low == Zigzag(n_rpm=80, angle_deg=20, side="starboard", duration=60, course_deg=0)
    assert isinstance(high, Zigzag)
    assert (high.n_rpm, high.angle_deg, high.side) == (pytest.approx(149.93), 20, "port")
    assert high.course_deg == pytest.approx(359.64)
    fixed = ManoeuvreDraw(kind="zigzag", n_rpm=100, course_deg=[30, 40]).manoeuvre(60.0, at(0.5))
    assert fixed.course_deg == 35
    spiral = ManoeuvreDraw(kind="spiral", n_rpm=100, hold=10, angles_deg=[15, -15]).manoeuvre(60.0, at(0.5))
    assert isinstance(spiral, Spiral)
    assert spiral.angles_deg == (15, -15)
    steps = ManoeuvreDraw(kind="steps", n_rpm=100, alpha_deg=[-10, 20]).manoeuvre(60.0, at(0.5))
    assert isinstance(steps, StepManoeuvre)
    assert steps.orders == {"n_rpm": (100, 100), "alpha_deg": (-10, 20)}


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ({"kind": "zigzags", **SHAFT}, "did you mean 'zigzag'"),
        ({"kind": "zigzag", "n_rpm": [150.0, 80.0]}, "n_rpm has low > high"),
        ({"kind": "zigzag", "n_rpm": [1.0, 2.0, 3.0]}, r"n_rpm: give a number or \[low, high\]"),
        ({"kind": "zigzag", **SHAFT, "angle_deg": [-5.0, 5.0]}, "angle_deg: must be above 0"),
        ({"kind": "zigzag", **SHAFT, "duration": 5.0}, r"duration: no key of zigzag: \[truth\] gives it"),
        ({"kind": "zigzag", **SHAFT, "side": ["port", "left"]}, "side: must be"),
        ({"kind": "zigzag"}, "n_rpm: missing"),
        ({"kind": "steps", **SHAFT, "hold": [5.0]}, "hold.1: missing"),
        ({"kind": "steps", **SHAFT, "hold": [20.0, 5.0]}, r"hold: low > high: give \[low, high\]"),
        ({"kind": "excitation", **SHAFT, "hold": [20.0, 5.0]}, "hold: low > high"),
        ({"kind": "steps", "n_rpm": [1.0, True]}, "n_rpm: give a number"),
        ({"kind": "turning", "share": 0.0, **SHAFT}, "must be above 0"),
    ],
)
def test_blocks_that_mean_nothing_are_refused(block: dict[str, Any], message: str) -> None:
    with pytest.raises(DocumentError, match=message):
        truth(block)


def test_a_vessel_that_cannot_is_refused_beforehand() -> None:
    rudder = load_vessel("mariner")
    blocks = {"kind": "zigzag", **SHAFT}, {"kind": "crash_stop", **BLOCKS["crash_stop"]}
    with pytest.raises(DocumentError, match="cannot stop") as caught:
        check_truth(truth(*blocks), rudder)
    assert caught.value.path == "truth.manoeuvre.1"
