"""Turning circle and pull-out against motions in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.measures.criteria import judge_criteria
from shipid.measures.turning import pull_out_measures, turning_measures
from shipid.units import DEGREE
from tests.measures.made_records import (
    DRIFT,
    GAIN,
    RATE,
    SPEED,
    START,
    circle,
    every,
    perfect_circle,
    released,
    rows,
)


def test_a_perfect_circle_has_exact_measures() -> None:
    """x = R (sin(psi - b) + sin b), y = R (cos b - cos(psi - b)) with R = V / r and drift b."""
    measures, radius = turning_measures(every(perfect_circle(), 0.1)), SPEED / RATE
    exact = {
        "execute": START,
        "helm": 35 * DEGREE,
        "approach_speed": SPEED,
        "advance": radius * (np.cos(DRIFT) + np.sin(DRIFT)),
        "transfer": radius * (np.cos(DRIFT) - np.sin(DRIFT)),
        "tactical_diameter": 2 * radius * np.cos(DRIFT),
        "greatest_advance": radius * (1 + np.sin(DRIFT)),
        "greatest_transfer": radius * (1 + np.cos(DRIFT)),
        "time_to_90": np.pi / 2 / RATE,
        "time_to_180": np.pi / RATE,
        "time_to_360": 2 * np.pi / RATE,
        "steady_diameter": 2 * radius,
        "steady_speed": SPEED,
        "steady_rate": RATE,
        "steady_drift": DRIFT,
        "speed_loss": 0.0,
        "current_speed": 0.0,
    }
    assert set(measures) == set(exact)
    for name, value in exact.items():
        assert measures[name].value == pytest.approx(value, abs=2e-3), name


@pytest.mark.parametrize("towards", [0.0, 1.0, 4.0])
def test_a_current_shows_in_a_whole_circle_and_its_track_is_not_judged(towards: float) -> None:
    """The tactical diameter over ground is then anything: the current carries the ship by 0.2 V in half a turn."""
    calm = every(perfect_circle(), 0.1)
    stream = 0.2 * SPEED
    carried = replace(
        calm,
        north=calm.north + stream * np.cos(towards) * calm.t,
        east=calm.east + stream * np.sin(towards) * calm.t,
        u=calm.u + stream * np.cos(towards - calm.psi),
        v=calm.v + stream * np.sin(towards - calm.psi),
    )
    measures = turning_measures(carried)
    assert measures["current_speed"].value == pytest.approx(stream, rel=0.01)
    rows_of = judge_criteria("turning", measures, 200.0)
    assert [row.met for row in rows_of] == [None, None]
    assert all(f"carried the ship at {stream:.2g} m/s" in row.note for row in rows_of)
    assert all("carried" not in row.note for row in judge_criteria("turning", turning_measures(calm), 200.0))


def test_an_unsteady_turn_has_no_steady_diameter() -> None:
    """Short of a full turn, or while the rate still falls by 5 % from one quarter turn to the next."""
    whole = every(perfect_circle(), 0.1)
    short = turning_measures(rows(whole, slice(0, round((START + 6.0 / RATE) / 0.1))))
    assert np.isfinite(short["tactical_diameter"].value)
    assert short["steady_diameter"].why == "the heading changes by less than 360 deg"
    slowing = replace(whole, psi=6.0 * np.log1p(whole.psi / 6.0), helm=whole.helm)
    assert "not steady" in turning_measures(slowing)["steady_rate"].why


def test_steady_rate_of_nomoto() -> None:
    assert turning_measures(every(circle(), 0.5))["steady_rate"].value == pytest.approx(GAIN * 35 * DEGREE, rel=1e-4)


def test_pull_out_of_a_stable_and_of_an_unstable_ship() -> None:
    record = every(released(), 0.5)
    measures = pull_out_measures(record)
    assert measures["turning_rate"].value == pytest.approx(GAIN * 20 * DEGREE, rel=1e-4)
    assert measures["residual_rate"].value == pytest.approx(0.0, abs=1e-5)
    left = 0.3 * DEGREE
    measures = pull_out_measures(replace(record, r=record.r + left * (record.t > 110)))
    assert measures["residual_rate"].value == pytest.approx(left, rel=1e-3)
    again = replace(record, helm=record.helm - 20 * DEGREE * (record.t > 200), r=record.r + (record.t > 200))
    same = pull_out_measures(again)  # the helm goes over to the other side later
    assert same["residual_rate"].value == pytest.approx(0.0, abs=1e-4)
    early = pull_out_measures(rows(record, slice(0, 2 * 120)))
    assert "still changes" in early["residual_rate"].why
