"""A vessel against its log: a planted mistake is detected, named and explained; a true vessel is left alone."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset, write_dataset
from shipid.data.windows import cut_windows
from shipid.hybrid.physics import Physics
from shipid.identification.plausible import outside
from shipid.metrics import position_error
from shipid.simulation.approach import acceleration
from shipid.simulation.manoeuvre import Steps, TurningCircle, Zigzag
from shipid.simulation.perform import perform
from shipid.study.first_look import (
    GROUPS,
    Change,
    Look,
    _backwards,
    _facts,
    _members,
    _shown,
    _some,
    _steady_speeds,
    _Trial,
    euler_apart,
    first_look,
    steady_speed,
)
from shipid.study.new import draft_study
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.template import Particulars, first_guess

SHIP, RPM = "kvlcc2-l7", 627.0
D_P, RUDDER = "thruster.propeller.D_p", "thruster.rudder.A_R"


@pytest.fixture(scope="module")
def log() -> Dataset:
    """Zigzags and circles of the model, without noise."""
    how = {"n_rpm": RPM, "duration": 90.0, "execute_at": 20.0}
    kinds = [Zigzag(name=f"zz {angle}", angle_deg=angle, **how) for angle in (10, 20)]
    kinds += [TurningCircle(name=f"circle {side}", angle_deg=25, side=side, **how) for side in ("port", "starboard")]
    frame = perform(load_vessel(SHIP), kinds, step=0.1, interval=1.0)
    frame = frame[[name for name in frame if not str(name).startswith("actual.")]]
    return Dataset(frame.astype({"run": "str"}), {"clock": "run", "flags": []})


def look(vessel: Vessel, log: Dataset) -> Look:
    return first_look(vessel, log, log.runs, ahead=16.0, step=1.0)


def test_the_vessel_that_made_the_log_is_left_alone(log: Dataset) -> None:
    view = look(load_vessel(SHIP), log)
    assert not view.changes
    assert not view.facts
    assert not view.wrong
    assert view.patch(SHIP) == ""
    assert view.alone < 0.05 * view.constant
    assert view.late is not None  # orders between rows of 1 s
    assert view.timely < view.alone
    assert view.corrected == view.timely
    frame = perform(load_vessel(SHIP), [Zigzag(n_rpm=RPM, angle_deg=10, duration=90.0)], step=0.1, interval=0.1)
    kept = frame[[name for name in frame if not str(name).startswith("actual.")]]
    often = Dataset(kept.astype({"run": "str"}), {"clock": "run", "flags": []})
    assert look(load_vessel(SHIP), often).late is None
    assert "the log agree" in look(load_vessel(SHIP), often).sentence


def test_a_ship_at_rest_with_stopped_shafts_corrects_no_number(log: Dataset) -> None:
    """The error of rounding, 3e-8 m, was explained by a screw of a third, and worse than constant motion, 0 m."""
    still = dict.fromkeys((*log.commands, "u", "v", "r", "north", "east"), 0.0)
    view = look(load_vessel(SHIP), Dataset(log.frame.assign(psi=0.3, **still), log.metadata))
    assert view.alone < 1e-6
    assert not view.changes
    assert view.current is None
    assert not view.wrong
    assert "the log agree" in view.sentence


@pytest.fixture(scope="module")
def ways() -> list[dict[str, float]]:
    """Currents [m/s, rad] of four runs, in one direction and in others."""
    rng = np.random.default_rng(3)
    return [{"V_c": float(rng.uniform(0.3, 0.6)), "beta_c": float(rng.uniform(-3, 3))} for _ in range(4)]


def in_currents(ways: list[dict[str, float]]) -> Dataset:
    """The runs of `log`, longer, with each in its current."""
    how = {"n_rpm": RPM, "duration": 160.0, "execute_at": 10.0}
    kinds = [Zigzag(name=f"zz {angle}", angle_deg=angle, **how) for angle in (10, 20)]
    kinds += [TurningCircle(name=f"circle {side}", angle_deg=25, side=side, **how) for side in ("port", "starboard")]
    vessel = load_vessel(SHIP).with_values({"current.kind": "uniform"})
    frames = [
        perform(vessel, [one], step=0.1, interval=1.0, environment=way) for one, way in zip(kinds, ways, strict=True)
    ]
    frame = pd.concat(frames, ignore_index=True)
    kept = [name for name in frame if not str(name).startswith("actual.") and name not in ("V_c", "beta_c")]
    return Dataset(frame[kept].astype({"run": "str"}), {"clock": "run", "flags": []})


def test_another_current_in_each_run_is_named_with_its_remedy(ways: list[dict[str, float]]) -> None:
    """The line said that vessel and log agree, at four fifths of the error of constant u, v, r."""
    view = look(load_vessel(SHIP), in_currents(ways))
    assert view.current is not None
    assert view.current.each
    assert view.current.V_c == pytest.approx(np.sqrt(np.mean([way["V_c"] ** 2 for way in ways])), rel=0.2)
    assert view.corrected < 0.3 * view.alone
    assert "another current in each run" in view.sentence
    assert "--nuisance current=0." in view.sentence
    assert view.wrong
    same = look(load_vessel(SHIP), in_currents([ways[0]] * 4))
    assert same.current is not None
    assert not same.current.each
    assert "a steady current of" in same.sentence


def test_where_the_vessel_errs_nearly_as_much_as_constant_motion_nothing_agrees(log: Dataset) -> None:
    view = replace(look(load_vessel(SHIP), log), late=None)
    for share, agrees in ((0.4, True), (0.8, False)):
        one = replace(view, alone=share * view.constant)
        assert ("the log agree" in one.sentence) is agrees
        assert not one.wrong


def test_a_screw_too_large_is_reported_and_explained(log: Dataset) -> None:
    """Twice the thrust: the speed tells at once, and a smaller screw explains it."""
    truth = load_vessel(SHIP)
    view = look(truth.with_values({D_P: 1.4 * truth.parameters[D_P]}), log)
    assert any("at 627 rpm the log runs" in fact for fact in view.facts)
    assert view.changes[0].group.name in ("size of the screw", "resistance")
    assert view.values.get(D_P, 0.0) == pytest.approx(truth.parameters[D_P], rel=0.1)
    assert view.corrected < 0.3 * view.alone
    assert "would explain most of it" in view.sentence
    assert "would explain a part of it" in replace(view, alone=1.5 * view.changes[0].error).sentence
    assert "\n" not in view.sentence


def test_a_rudder_of_the_other_sign_is_reported(log: Dataset) -> None:
    mirrored = Dataset(log.frame.assign(**{"rudder.delta": -log.frame["rudder.delta"]}), log.metadata)
    view = look(load_vessel(SHIP), mirrored)
    assert any("turns the other way" in fact and "the sign of the angle" in fact for fact in view.facts)
    assert not view.changes, "no factor mends a sign"
    assert view.wrong


def test_a_wrong_sign_is_no_agreement_where_constant_motion_is_worse() -> None:
    """From rest the speed counts more than a little turning: constant motion is worse than the wrong vessel."""
    ship = load_vessel("gunnerus-28.9")
    how = {"n_rpm": 150.0, "approach": "rest", "angle_deg": 5.0, "execute_at": 50.0, "duration": 100.0}
    kinds = [TurningCircle(name=side, side=side, **how) for side in ("port", "starboard")]
    frame = perform(ship, kinds, step=0.1, interval=1.0)
    frame = frame[[name for name in frame if not str(name).startswith("actual.")]]
    angles = {name: -frame[name] for name in ("port.alpha", "starboard.alpha")}
    view = look(ship, Dataset(frame.assign(**angles).astype({"run": "str"}), {"clock": "run", "flags": []}))
    assert view.alone < view.constant
    assert "the log differ, and no single number explains it: the vessel turns the other way" in view.sentence
    assert view.wrong


def test_a_current_that_nobody_measured_is_found_and_no_number_is_blamed() -> None:
    truth = load_vessel(SHIP).with_values({"current.kind": "uniform"})
    kinds: list[Zigzag | TurningCircle] = [
        TurningCircle(n_rpm=RPM, angle_deg=25, duration=90.0, execute_at=20.0, course_deg=60),
        *(Zigzag(n_rpm=RPM, angle_deg=20, duration=90.0, execute_at=20.0, course_deg=one) for one in (0, 110, 200)),
    ]
    stream = {"V_c": 0.12, "beta_c": np.radians(250.0)}
    frame = perform(truth, kinds, step=0.1, interval=1.0, environment=stream)
    kept = [str(name) for name in frame if not str(name).startswith("actual.") and name not in stream]
    drifting = Dataset(frame[kept].astype({"run": "str"}), {"clock": "run", "flags": []})
    view = look(load_vessel(SHIP), drifting)
    assert view.current is not None
    assert view.current.V_c == pytest.approx(0.12, rel=0.1)
    assert np.degrees(view.current.beta_c) % 360.0 == pytest.approx(250.0, abs=5.0)
    assert not view.changes
    assert view.corrected < 0.2 * view.alone
    assert view.wrong
    assert "a steady current of 0.12 m/s towards 250 deg, which is not in the log, would explain" in view.sentence


@pytest.mark.parametrize(("name", "n_rpm", "interval"), [("gunnerus-28.9", 145.0, 1.0), ("container-175", 100.0, 2.0)])
def test_commands_that_come_late_are_named_and_no_number_is_blamed(name: str, n_rpm: float, interval: float) -> None:
    """The vessel that made the log; Gunnerus got 0.8 times her inertia in yaw."""
    ship, rng = load_vessel(name), np.random.default_rng(11)
    kinds = [
        Zigzag(n_rpm=n_rpm, angle_deg=angle, side=side, duration=200.0, execute_at=20.0 + round(rng.uniform(0, 2), 2))
        for side in ("starboard", "port")
        for angle in (10.3, 20.7)
    ]
    frame = perform(ship, kinds, step=0.02, interval=0.1)
    frame = frame.groupby("run", sort=False).nth(slice(3, None, round(interval / 0.1)))
    kept = frame[[name for name in frame if not str(name).startswith("actual.")]].reset_index(drop=True)
    dataset = Dataset(kept.astype({"run": "str"}), {"clock": "run", "flags": []})
    view = first_look(ship, dataset, dataset.runs, ahead=20 * interval, step=interval)
    assert view.late is not None
    assert not view.changes
    assert view.current is None
    assert not view.wrong
    assert view.corrected == view.timely < 0.9 * view.alone
    when = f"commands count from their row, {interval / 2:g} s late on average, which would explain"
    assert f"rows are {interval:g} s apart and {when}" in view.sentence


@pytest.mark.parametrize(("factor", "read", "right"), [(60.0, "rev/s", "rpm"), (1 / 60, "rpm", "rev/s")])
def test_a_shaft_in_another_unit_is_asked_for(log: Dataset, factor: float, read: str, right: str) -> None:
    wrong = Dataset(log.frame.assign(**{"propeller.n": factor * log.frame["propeller.n"]}), log.metadata)
    view = look(load_vessel(SHIP), wrong)
    assert any(f"is the shaft speed in {right}, and the mapping says {read}?" in fact for fact in view.facts)


def test_swapped_sides_of_a_craft_that_steers_by_them_are_reported() -> None:
    craft = load_vessel("otter")
    orders = {"port.n_rpm": (300.0, 900.0), "starboard.n_rpm": (300.0, 900.0)}
    kinds = [Steps(name=f"steps {seed}", duration=90.0, orders=orders, seed=seed) for seed in (1, 2)]
    frame = perform(craft, kinds, step=0.1, interval=0.5)
    frame = frame[[name for name in frame if not str(name).startswith("actual.")]]
    swapped = frame.rename(columns={"port.n": "starboard.n", "starboard.n": "port.n"})
    logs = [Dataset(one.astype({"run": "str"}), {"clock": "run", "flags": []}) for one in (frame, swapped)]
    right, wrong = (first_look(craft, one, one.runs, ahead=5.0, step=0.5) for one in logs)
    assert not right.facts
    assert any("port and starboard of the shafts" in fact for fact in wrong.facts)
    assert not wrong.changes


def test_a_trial_errs_as_the_vessel_with_its_numbers(log: Dataset) -> None:
    """Also with another steering gear: where its rudder was before each instant follows from the new one."""
    ship, windows = load_vessel(SHIP), _some(log, 16, 1.0, "position")
    rate = next(path for path in ship.parameters if path.endswith("actuator.delta.rate"))
    rows = [{}, {rate: 0.15 * ship.parameters[rate]}, {D_P: 0.8 * ship.parameters[D_P]}]
    rows.append(rows[1] | rows[2])
    errors = _Trial(ship, log, windows, 1e9).errors(rows)
    alone = [_Trial(ship.with_values(row), log, windows, 1e9).errors([{}])[0] for row in rows]
    assert errors == pytest.approx(alone, rel=1e-9)
    assert errors[1] > 1.5 * errors[0]


def test_a_shaft_that_goes_astern_at_times_has_no_wrong_sign(log: Dataset) -> None:
    windows = _some(log, 16, 1.0, "position")
    name = next(name for name in windows.planned if name.endswith(".n"))
    some = np.arange(len(windows)) % 5 == 0
    for astern, expected in ((some, []), (np.full(len(windows), True), [name])):
        planned = {**windows.planned, name: np.where(astern, -1.0, 1.0) * np.abs(windows.planned[name])}
        assert _backwards(replace(windows, planned=planned)) == expected


def test_a_zigzag_whose_heading_comes_back_within_the_horizon_is_no_straight_run() -> None:
    """Its speed is that of a ship in turns, which the vessel that made the log does not hold straight ahead."""
    ship = load_vessel("gunnerus-28.9")
    how = {"n_rpm": 150.0, "duration": 90.0, "execute_at": 15.0}
    frame = perform(
        ship, [Zigzag(name=f"zz {angle}", angle_deg=angle, **how) for angle in (10, 20)], step=0.1, interval=1.0
    )
    frame = frame[[name for name in frame if not str(name).startswith("actual.")]]
    dataset = Dataset(frame.astype({"run": "str"}), {"clock": "run", "flags": []})
    for ahead in (20.0, 24.0, 28.0):
        view = first_look(ship, dataset, dataset.runs, ahead=ahead, step=1.0)
        assert not view.facts, view.sentence


@pytest.mark.parametrize(("begin", "duration"), [(0.7, 30), (0.5, 60)])
def test_a_ship_that_still_gains_speed_is_compared_where_the_vessel_gains_as_much(begin: float, duration: int) -> None:
    """Before, less than 3 % within the horizon was steady, and the ship that made the log was said to be too fast."""
    ship, orders = load_vessel(SHIP), {"propeller.n": RPM / 60, "rudder.delta": 0.0}
    top, rng = steady_speed(ship, orders), np.random.default_rng(1)
    frames = []
    for run in ("a", "b", "c", "d"):
        u = [begin * top]
        for _ in range(duration):
            u.append(u[-1] + float(acceleration(ship, u[-1], orders)[0]))
        noise = rng.normal(0, 0.005 * top, len(u))
        states = {"t": np.arange(len(u), dtype=float), "north": np.cumsum(u), "u": u + noise}
        frames.append(pd.DataFrame({"run": run, **states, **dict.fromkeys(("east", "psi", "v", "r"), 0.0), **orders}))
    dataset = Dataset(pd.concat(frames, ignore_index=True).assign(flags=0), {"clock": "run", "flags": []})
    windows = _some(dataset, 8, 1.0, "position")
    assert _steady_speeds(ship, windows) is not None
    assert list(_facts(ship, windows, None)) == []
    for factor in (0.75, 1.4):
        other = ship.with_values({D_P: factor * ship.parameters[D_P]})
        assert len(list(_facts(other, windows, None))) == 1


def test_steady_speed_is_that_of_the_published_approach() -> None:
    vessel, orders = load_vessel(SHIP), {"propeller.n": RPM / 60, "rudder.delta": 0.0}
    assert steady_speed(vessel, orders) == pytest.approx(1.179, rel=0.02)
    assert steady_speed(vessel, orders | {"propeller.n": 0.0}) == 0.0


def test_groups_share_no_number() -> None:
    """A number that two groups scaled would be counted twice."""
    for name in ("gunnerus-33.9-template", SHIP, "mariner", "gunnerus-28.9"):
        paths = [path for group in GROUPS for path in _members(load_vessel(name), group)]
        assert len(paths) == len(set(paths)) > 3, name
    assert np.all([group.low < 1 < group.high for group in GROUPS])


def test_no_number_is_proposed_that_no_ship_has(log: Dataset) -> None:
    """With a log three times as slow to turn, the first look stays within the ranges of ships."""
    truth = load_vessel(SHIP)
    wrong = {
        path: value * (0.35 if ".Y_v" in path or "R_0" in path else 1.0) for path, value in truth.parameters.items()
    }
    view = look(truth.with_values({path: value for path, value in wrong.items() if ".actuator" not in path}), log)
    assert view.changes
    assert outside(view.vessel, view.values) <= outside(
        view.vessel, {path: view.vessel.parameters[path] for path in view.values}
    )


@pytest.mark.parametrize(
    ("more", "words"),
    [(0, ""), (1, " (1 more number by the same factor)"), (2, " (2 more numbers by the same factor)")],
)
def test_a_change_says_how_many_numbers_it_scales(more: int, words: str) -> None:
    ship = load_vessel(SHIP)
    paths = [D_P, RUDDER, "hull.mmg.R_0"][: more + 1]
    change = Change(GROUPS[0], 0.5, {path: 0.5 * ship.parameters[path] for path in paths}, 1.0)
    assert (
        _shown(ship, change)
        == f"{D_P} = {0.5 * ship.parameters[D_P]:.4g} in place of {ship.parameters[D_P]:.4g}{words}"
    )


@pytest.mark.parametrize("seed", [1, 2])
def test_a_study_has_the_integrator_by_which_its_correction_errs_less(tmp_path: Path, seed: int) -> None:
    """Steps of Euler erred more than the numbers: the family declared accurate was worse than the guess."""
    rng = np.random.default_rng(seed)
    length, file = float(rng.uniform(5, 12)), tmp_path / "small.toml"
    given = Particulars(length, length / rng.uniform(5, 7), length / 17, rng.uniform(0.6, 0.8))
    first = first_guess(given, "small", str(file))
    file.write_text(first.text)
    guess, factors = load_vessel(file), {"yaw damping": rng.uniform(1.2, 1.5), "resistance": rng.uniform(0.75, 1.3)}
    truth = guess.with_values(
        {
            path: factors[group.name] * guess.parameters[path]
            for group in GROUPS
            if group.name in factors
            for path in _members(guess, group)
        }
    )
    how = {"n_rpm": 60 * first.n, "approach": "helmsman", "duration": 120.0, "execute_at": 10.0}
    kinds = [Zigzag(name=f"zz {angle}", angle_deg=angle, **how) for angle in (10, 15, 20)]
    kinds += [TurningCircle(name=f"circle {side}", angle_deg=25, side=side, **how) for side in ("port", "starboard")]
    frame = perform(truth, kinds, step=0.1, interval=1.0)
    kept = frame[[name for name in frame if not str(name).startswith("actual.")]]
    dataset = Dataset(kept.astype({"run": "str"}), {"clock": "run", "flags": []})
    draft = draft_study([str(file)], write_dataset(dataset, tmp_path / "log.parquet"), tmp_path / "study.toml")
    (view,), prediction = draft.looks.values(), draft.plan.study.prediction
    assert prediction.integrator == view.integrator == "rk4"
    assert "explicit Euler (the paper's) with this step moves the paths by" in draft.text.replace("\n# ", " ")
    assert view.changes
    horizon = round(prediction.ahead / prediction.step)
    windows = cut_windows(dataset, horizon=horizon, step=prediction.step, interval=5.0, path="position")
    errors = [
        position_error(
            Physics(vessel, horizon, prediction.step, prediction.integrator).paths(windows.instants(known=True)),
            windows.future,
        ).mean()
        for vessel in (guess, guess.with_values(view.values))
    ]
    assert errors[1] < 0.9 * errors[0]


def test_a_look_errs_by_the_integrator_that_it_is_given(log: Dataset) -> None:
    ship, how = load_vessel(SHIP), {"ahead": 16.0, "step": 1.0}
    apart, error = euler_apart(ship, log, log.runs, **how)
    fine = first_look(ship, log, log.runs, **how)
    rough = first_look(ship, log, log.runs, **how, integrator="euler")
    assert fine.alone == pytest.approx(error, rel=0.2)  # with late commands in finer steps
    assert fine.alone < rough.alone <= fine.alone + apart
    assert (fine.integrator, rough.integrator) == ("rk4", "euler")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_where_euler_diverges_its_paths_are_infinitely_far(
    value: float, log: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Infinite paths were 1.8e308 m apart, a number."""
    physics = _Trial.physics

    def diverging(trial: _Trial) -> Any:
        sound = physics(trial)
        if trial.integrator != "euler":
            return sound
        return SimpleNamespace(paths=lambda instants: np.full_like(sound.paths(instants), value))

    monkeypatch.setattr(_Trial, "physics", diverging)
    apart, error = euler_apart(load_vessel(SHIP), log, log.runs, ahead=16.0, step=1.0)
    assert math.isinf(apart)
    assert math.isfinite(error)
