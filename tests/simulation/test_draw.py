"""Blocks of manoeuvres: what is drawn, what is fixed, what is refused; laws over all kinds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DocumentError
from shipid.simulation.manoeuvre import KINDS, Spiral, StepManoeuvre, Zigzag
from shipid.simulation.truth import ManoeuvreDraw, Truth, check_truth, draw_manoeuvres, simulate_truth
from shipid.vessel.load import load_vessel
from tests.conftest import LAG

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
