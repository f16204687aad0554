"""Loops of spirals: none for a stable ship, the fold of the curve for an unstable one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.measures.spiral import _at_zero, helm_levels, spiral_measures
from shipid.units import DEGREE
from tests.measures.made_records import GAIN, HOLD, LEVELS, START, every, stable_spiral


def test_a_stable_ship_has_no_loop() -> None:
    record = every(stable_spiral(), 0.5)
    measures, points = spiral_measures(record), helm_levels(record)
    assert measures["loop_width"].value == pytest.approx(0.0, abs=1e-3 * DEGREE)
    assert measures["loop_height"].value == pytest.approx(0.0, abs=1e-3 * DEGREE)
    assert measures["levels"].value == len(LEVELS)
    np.testing.assert_allclose(points.helm, np.array(LEVELS) * DEGREE, atol=1e-9)
    np.testing.assert_allclose(points.rate, GAIN * np.array(LEVELS) * DEGREE, atol=1e-5)


def test_what_is_left_of_a_turn_is_no_loop() -> None:
    """Rates that lag by 0.4 % of a level, as they do eight time constants after the helm."""
    record = every(stable_spiral(), 0.5)
    back = record.t >= START + HOLD * 8
    late = np.where(back, -1.0, 1.0) * np.where(record.t >= START, 0.004 * GAIN * DEGREE, 0.0)
    measures = spiral_measures(replace(record, r=record.r + late))
    assert measures["loop_width"].value == measures["loop_height"].value == 0.0


@pytest.mark.parametrize(("share", "noise"), [(1.0, 0.05), (0.2, 0.03), (0.2, 0.0), (0.04, 0.0)])
def test_levels_may_be_as_close_as_the_helm_is_quiet(share: float, noise: float) -> None:
    """Helm angles of 20 deg to 0.8 deg at most, with noise [deg]: levels that run together made a loop."""
    record = every(stable_spiral(), 0.5)
    scatter = noise * np.random.default_rng(0).standard_normal(len(record.t)) * DEGREE
    less = replace(record, helm=share * record.helm + scatter, r=share * record.r, psi=share * record.psi)
    measures, points = spiral_measures(less), helm_levels(less)
    assert measures["levels"].value == len(LEVELS)
    np.testing.assert_allclose(points.helm, share * np.array(LEVELS) * DEGREE, atol=1e-9 + 0.5 * noise * DEGREE)
    assert measures["loop_width"].value == pytest.approx(0.0, abs=(1e-3 + 0.5 * noise) * DEGREE)


def test_a_loop_as_wide_as_it_was_made() -> None:
    """Rate K delta + 1 deg/s on the way to port, K delta - 1 deg/s on the way back: 2 deg/s high, 2 / K deg wide."""
    record = every(stable_spiral(), 0.5)
    back = record.t >= START + HOLD * 8
    jump = np.where(back, -1.0, 1.0) * np.where(record.t >= START, 0.2 * DEGREE, 0.0)
    measures = spiral_measures(replace(record, r=record.r + jump))
    assert measures["loop_height"].value == pytest.approx(0.4 * DEGREE, rel=1e-2)
    assert measures["loop_width"].value == pytest.approx(0.4 / GAIN * DEGREE, rel=1e-2)
    assert measures["neutral_helm"].value == pytest.approx(0.0, abs=0.02 * DEGREE)


@pytest.mark.parametrize(
    ("x", "value"), [([2, 1, -1], 3.5), ([2, 1, 0], 3.0), ([0, 1, 2], 5.0), ([2, 0, -1], 4.0), ([2, 1, 1], np.nan)]
)
def test_the_value_where_another_changes_its_sign(x: list[float], value: float) -> None:
    assert _at_zero(np.array(x, dtype=float), np.array([5.0, 4.0, 3.0])) == pytest.approx(value, nan_ok=True)
