"""A survey of runs against motion known in closed form."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.simulation.manoeuvre import StepManoeuvre, TurningCircle, Zigzag
from shipid.simulation.perform import perform_manoeuvres
from shipid.study.survey import Look, Survey, first_look, separation_of_sources, survey_dataset, typical_runs
from shipid.vessel.load import Vessel, load_vessel
from tests.logs.conftest import as_dataset, turning

T = np.arange(0.0, 100.0, 0.5)


def test_a_steady_turn_is_described_by_its_numbers() -> None:
    summary = survey_dataset(as_dataset(turning(T), turning(T[:81])))
    assert list(summary.runs.index) == ["a", "b"]
    assert summary.runs["duration"].tolist() == [99.5, 40.0]
    assert summary.step == 0.5
    assert summary.speed == pytest.approx(np.hypot(4.0, 0.5))
    np.testing.assert_allclose(summary.runs["rate"], 0.05)
    assert summary.runs["whole"].all()


def test_a_broken_run_is_judged_by_its_longest_piece() -> None:
    frame = turning(T)
    frame["flags"] = np.where(T == 30.0, 1, 0)
    summary = survey_dataset(as_dataset(frame)).runs.loc["a"]
    assert not summary["whole"]
    assert summary["duration"] == 99.5 - 30.0


def test_jitter_does_not_grow_with_the_lag_and_a_wrong_speed_does() -> None:
    rng, frame = np.random.default_rng(2), turning(T)
    jitter = as_dataset(frame.assign(north=frame["north"] + rng.normal(0, 2.0, len(T))))
    wrong = as_dataset(frame.assign(u=1.1 * frame["u"]))
    assert separation_of_sources(jitter, 20.0) == pytest.approx(separation_of_sources(jitter, 5.0), rel=0.3)
    assert separation_of_sources(wrong, 20.0) > 3 * separation_of_sources(wrong, 5.0)
    assert separation_of_sources(wrong, 1000.0) == 0.0


def surveyed(kinds: list[str], speeds: list[float], failed: str = "") -> Survey:
    numbers = {"kind": kinds, "speed": speeds, "rate": 0.05, "helm": 0.2, "whole": True, "duration": 60.0}
    runs = pd.DataFrame(numbers, index=list("abcdefgh"[: len(kinds)]))
    runs.loc["a", "duration"] = 90.0
    return Survey(runs, 1.0, pd.DataFrame({"run": list(failed)}))


def test_the_typical_run_is_the_middle_one_and_neither_broken_nor_faulty() -> None:
    one = surveyed(["zigzag"] * 5, [5.0, 3.0, 3.9, 4.0, 4.1])
    assert typical_runs(one) == ["d"]
    one.runs.loc["d", "whole"] = False
    assert typical_runs(one)[0] in ("c", "e")
    assert typical_runs(surveyed(["zigzag"] * 5, [5.0, 3.0, 3.9, 4.0, 4.1], "ed")) == ["c"]


def test_each_kind_gives_a_typical_run_where_more_than_six_runs_are_there() -> None:
    for count, chosen in ((6, 1), (8, 2)):
        assert len(typical_runs(surveyed(["zigzag", "turning"] * (count // 2), [3.0] * count))) == chosen


SHIP, RPM = "kvlcc2-l7", 627.0
D_P = "thruster.propeller.D_p"


def logged(vessel: Vessel, kinds: list[Zigzag | TurningCircle | StepManoeuvre], interval: float) -> Dataset:
    frame = perform_manoeuvres(vessel, kinds, step=0.1, interval=interval)
    kept = [name for name in frame if not str(name).startswith("actual.")]
    return Dataset(frame[kept].astype({"run": "str"}), {"clock": "run", "flags": []})


@pytest.fixture(scope="module")
def log() -> Dataset:
    """Zigzags and circles of the model, without noise."""
    how = {"n_rpm": RPM, "duration": 90.0, "execute_at": 20.0}
    kinds = [Zigzag(name=f"zz {angle}", angle_deg=angle, **how) for angle in (10, 20)]
    kinds += [TurningCircle(name=f"circle {side}", angle_deg=25, side=side, **how) for side in ("port", "starboard")]
    return logged(load_vessel(SHIP), kinds, 1.0)


def look(vessel: Vessel, log: Dataset) -> Look:
    return first_look(vessel, log, log.runs, ahead=16.0, step=1.0)


def test_the_vessel_that_made_the_log_agrees(log: Dataset) -> None:
    view = look(load_vessel(SHIP), log)
    assert view.vessel_error < 0.05 * view.constant_error
    assert (view.turning, view.speed) == pytest.approx((1.0, 1.0), abs=0.05)
    assert not view.wrong
    assert "is better than constant u, v, r: mean error over 16 s" in view.sentence


def test_a_ship_at_rest_with_stopped_shafts_is_not_wrong(log: Dataset) -> None:
    """An error of rounding, 3e-8 m, is no worse than that of constant motion, 0 m."""
    still = dict.fromkeys((*log.commands, "u", "v", "r", "north", "east"), 0.0)
    view = look(load_vessel(SHIP), Dataset(log.frame.assign(psi=0.3, **still), log.metadata))
    assert view.vessel_error < 1e-6
    assert np.isnan([view.turning, view.speed]).all()
    assert not view.wrong


def test_a_screw_too_large_shows_in_the_speed(log: Dataset) -> None:
    truth = load_vessel(SHIP)
    view = look(truth.with_values({D_P: 2.0 * truth.parameters[D_P]}), log)
    assert view.speed > 1.5
    assert view.wrong
    assert "is no better than constant u, v, r" in view.sentence
    assert "\n" not in view.sentence


def test_a_rudder_of_the_other_sign_is_reported(log: Dataset) -> None:
    mirrored = Dataset(log.frame.assign(**{"rudder.delta": -log.frame["rudder.delta"]}), log.metadata)
    view = look(load_vessel(SHIP), mirrored)
    assert view.turning < 0
    assert view.wrong
    assert "turns the other way than the ship of the log: check the signs" in view.sentence


def test_a_wrong_sign_is_wrong_where_constant_motion_is_worse() -> None:
    """From rest the speed counts more than a little turning: constant motion is worse than the wrong vessel."""
    ship = load_vessel("gunnerus-28.9")
    how = {"n_rpm": 150.0, "approach": "rest", "angle_deg": 5.0, "execute_at": 50.0, "duration": 100.0}
    log = logged(ship, [TurningCircle(name=side, side=side, **how) for side in ("port", "starboard")], 1.0)
    angles = {name: -log.frame[name] for name in ("port.alpha", "starboard.alpha")}
    view = look(ship, Dataset(log.frame.assign(**angles), log.metadata))
    assert view.vessel_error < view.constant_error
    assert view.wrong


def test_swapped_sides_of_a_craft_that_steers_by_them_are_reported() -> None:
    craft = load_vessel("otter")
    orders = {"port.n_rpm": (300.0, 900.0), "starboard.n_rpm": (300.0, 900.0)}
    right = logged(
        craft, [StepManoeuvre(name=f"s{seed}", duration=90.0, orders=orders, seed=seed) for seed in (1, 2)], 0.5
    )
    swapped = Dataset(right.frame.rename(columns={"port.n": "starboard.n", "starboard.n": "port.n"}), right.metadata)
    views = [first_look(craft, one, one.runs, ahead=5.0, step=0.5) for one in (right, swapped)]
    assert [view.turning < 0 for view in views] == [False, True]
