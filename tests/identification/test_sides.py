"""Errors by side, helm and speed: what is wrong on one side only is reported, and noise is not."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.identification.sides import HEADS, _ratio_of_sums, by_group, side_table_rows, uneven_side_warnings
from shipid.units import DEGREE
from shipid.vessel.load import load_vessel

SHIP = load_vessel("kvlcc2-l7")
STEP, ROWS = 0.5, 400


def compared(port: float, starboard: float, noise: float = 0.0) -> pd.DataFrame:
    """Groups of a zigzag whose predicted yaw rate is wrong by these shares."""
    rng, t = np.random.default_rng(1), STEP * np.arange(ROWS)
    side = np.sign(np.sin(2 * np.pi * t / 50))
    r = 0.03 * side
    predicted = r * np.where(side > 0, 1 + starboard, 1 + port) + noise * rng.normal(size=ROWS)
    motion = {"run": "A", "piece": (t // 20).astype(int), "t": t, "u": 1.0 + 0.1 * np.cos(t / 9), "v": 0.0}
    series = pd.concat(
        [
            pd.DataFrame({**motion, "r": r, "model": "measured"}),
            pd.DataFrame({**motion, "r": predicted, "model": "after"}),
        ]
    )
    helm = np.where(t < 100, 10.0, 30.0) * DEGREE * side
    still = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    frame = pd.DataFrame({"run": "A", "t": t, **still, "rudder.delta": helm, "propeller.n": 10.0, "flags": 0})
    return by_group(series, "after", SHIP, Dataset(frame, {"clock": "run", "flags": []}))


def test_the_error_of_the_turning_is_that_of_each_side() -> None:
    groups = compared(port=-0.14, starboard=0.02)
    of = groups[groups["group"] == "all"].set_index("side")
    assert of["turning"]["port"] == pytest.approx(-0.14)
    assert of["turning"]["starboard"] == pytest.approx(0.02)
    assert of["r"]["port"] == pytest.approx(0.14 * 0.03)
    assert {"helm about 10 deg", "helm about 30 deg"} <= set(groups["group"])
    assert sum(name.startswith("speed ") for name in groups["group"]) == 3
    assert all(len(row) == len(HEADS) for row in side_table_rows(groups))


@pytest.mark.parametrize("after", [0.0, 0.3, 0.999])
@pytest.mark.parametrize("seed", range(3))
def test_an_error_that_comes_with_a_helm_is_found_at_that_helm_alone(seed: int, after: float) -> None:
    """Orders at drawn instants, rows at or after those of the log: an order holds until the next one."""
    rng, t = np.random.default_rng(seed), STEP * np.arange(ROWS)
    hard = np.cumsum(rng.random(ROWS) < 0.1) % 2 == 1
    side = np.sign(np.sin(2 * np.pi * t / 50) + 1e-3)
    r = 0.03 * side
    motion = {"run": "A", "piece": (t // 20).astype(int), "t": t + after * STEP, "u": 1.0, "v": 0.0}
    turns = {"measured": r, "after": r * np.where(hard, 1.2, 1.0)}
    series = pd.concat([pd.DataFrame({**motion, "r": values, "model": name}) for name, values in turns.items()])
    still = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    helm = np.where(hard, 30.0, 10.0) * DEGREE * side
    frame = pd.DataFrame({"run": "A", "t": t, **still, "rudder.delta": helm, "propeller.n": 10.0, "flags": 0})
    groups = by_group(series, "after", SHIP, Dataset(frame, {"clock": "run", "flags": []}))
    found = groups[groups["group"].str.startswith("helm")].set_index(["group", "side"])
    assert len(found) == 4
    for degrees, error in ((10, 0.0), (30, 0.2)):
        here = found.loc[f"helm about {degrees} deg"]
        assert here["turning"].tolist() == pytest.approx([error, error], abs=1e-12)
        assert here["r"].tolist() == pytest.approx([0.03 * error] * 2, abs=1e-12)


def test_one_side_that_is_worse_is_reported_with_what_to_run_next() -> None:
    sentences = uneven_side_warnings(compared(port=-0.14, starboard=0.02))
    assert sentences[0].startswith("the error of the turning is -14 % to port and +2 % to starboard")
    assert any(
        "at helm about 30 deg" in sentence and "to run next: turns to both sides" in sentence for sentence in sentences
    )


@pytest.mark.parametrize(("port", "starboard", "noise"), [(-0.14, -0.13, 0.0), (0.01, 0.0, 0.003), (0.0, 0.0, 0.02)])
def test_sides_alike_and_noise_are_not_reported(port: float, starboard: float, noise: float) -> None:
    assert uneven_side_warnings(compared(port, starboard, noise)) == ()


def alike(seed: int) -> pd.DataFrame:
    """Groups of ten zigzags of many helm angles whose errors are drawn from one law for both sides, a level a piece."""
    rng, rows = np.random.default_rng(seed), 320
    t = np.tile(STEP * np.arange(rows), 10)
    run = np.repeat([f"R{k}" for k in range(10)], rows)
    piece, half = (t // 40).astype(int), (t // 10).astype(int)
    side = np.where(half % 2, 1.0, -1.0)
    r = 0.03 * side
    place = pd.Series(run + piece.astype(str) + side.astype(str)).factorize()[0]
    level = rng.normal(0, 0.12, place.max() + 1)[place]
    helm = np.repeat(np.array([5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 5.0, 15.0, 25.0]), rows) * DEGREE * side
    motion = {"run": run, "piece": piece, "t": t, "u": 1.0, "v": 0.0}
    measured, after = (
        pd.DataFrame({**motion, "r": r * (1 + k * level), "model": name}) for k, name in ((0, "measured"), (1, "after"))
    )
    still = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    frame = pd.DataFrame({"run": run, "t": t, **still, "rudder.delta": helm, "propeller.n": 10.0, "flags": 0})
    return by_group(pd.concat([measured, after]), "after", SHIP, Dataset(frame, {"clock": "run", "flags": []}))


def test_of_many_groups_alike_few_are_reported_to_differ() -> None:
    """Eight groups are tested twice each: where nothing differs, not one in ten logs may say that something does."""
    reports = [uneven_side_warnings(alike(seed)) for seed in range(30)]
    assert sum(map(bool, reports)) <= 3


def test_the_error_of_the_yaw_rate_is_tested_too() -> None:
    """Twice as large on one side by the chance of a piece is not reported; by every piece it is."""
    row = {"group": "all", "rows": 200, "u": 0.1, "v": 0.1, "turning": 0.0, "error": 0.001, "pieces": 10}
    sides = {"starboard": {"r": 0.01, "r_error": 0.004}, "port": {"r": 0.025, "r_error": 0.009}}
    groups = pd.DataFrame([{**row, "side": side, **error} for side, error in sides.items()])
    assert uneven_side_warnings(groups) == ()
    sure = groups.assign(r_error=[0.001, 0.002])
    assert uneven_side_warnings(sure) == ("the error of the yaw rate is 2.5 times as large to port as to starboard",)


@pytest.mark.parametrize("count", [2, 3, 8])
def test_the_error_of_a_ratio_of_equal_pieces_is_that_of_a_mean(count: int) -> None:
    values = np.random.default_rng(count).normal(1.0, 0.3, count)
    share, error = _ratio_of_sums(3.0 * values, np.full(count, 3.0))
    assert share == pytest.approx(values.mean())
    assert error == pytest.approx(values.std(ddof=1) / count**0.5)
    assert np.isinf(_ratio_of_sums(values[:1], np.ones(1))[1])


def test_a_craft_without_an_angle_has_no_groups_by_helm() -> None:
    t = STEP * np.arange(ROWS)
    motion = {"run": "A", "piece": 0, "t": t, "u": 1.0, "v": 0.0, "r": 0.1 * np.sign(np.sin(t / 8))}
    series = pd.concat([pd.DataFrame({**motion, "model": name}) for name in ("measured", "after")])
    still = dict.fromkeys(("north", "east", "psi", "u", "v", "r", "port.n", "starboard.n"), 0.0)
    log = Dataset(pd.DataFrame({"run": "A", "t": t, **still, "flags": 0}), {"clock": "run", "flags": []})
    groups = by_group(series, "after", load_vessel("otter"), log)
    assert {name.split()[0] for name in groups["group"]} == {"all", "speed"}


def test_a_turning_that_one_piece_shows_has_no_error_beside_it() -> None:
    groups = compared(port=-0.14, starboard=0.02)
    lone = groups.assign(error=np.inf)
    assert {row[-1] for row in side_table_rows(lone) if row[1] == "port"} == {"-14.0"}
    assert not any("inf" in cell for row in side_table_rows(lone) for cell in row)


def test_instants_between_far_rows_are_none() -> None:
    """What is interpolated between two rows is no measurement: a prediction that is right at the rows has no error."""
    t = STEP * np.arange(ROWS)
    at_row = np.arange(ROWS) % 4 == 0
    r = 0.03 * np.sign(np.sin(2 * np.pi * t / 50) + 1e-3)
    motion = {"run": "A", "piece": (t // 20).astype(int), "t": t, "u": 1.0, "v": 0.0}
    turns = {"measured": r, "after": np.where(at_row, r, 1.2 * r)}
    series = pd.concat([pd.DataFrame({**motion, "r": values, "model": name}) for name, values in turns.items()])
    still = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    frame = pd.DataFrame({"run": "A", "t": t, **still, "rudder.delta": 0.1, "propeller.n": 10.0, "flags": 0})
    groups = by_group(series, "after", SHIP, Dataset(frame[at_row], {"clock": "run", "flags": []}))
    whole = groups[groups["group"] == "all"]
    assert whole["rows"].sum() == at_row.sum() - series["piece"].nunique()  # a piece begins at its first row
    assert (whole[["r", "turning"]].abs() < 1e-12).all(axis=None)
