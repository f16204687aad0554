"""A sensor is stuck where it repeats one value and the other signals of the same motion say that it cannot."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.stuck import stuck_spans
from tests.drawn import seeds

STEP, COUNT, FIRST, LAST = 0.5, 600, 200, 300


@pytest.mark.parametrize("name", ["psi", "r", "course", "speed"])
@pytest.mark.parametrize("seed", seeds(2, 10))
def test_a_value_that_stays_in_a_turn_is_stuck_and_on_a_straight_course_it_is_not(seed: int, name: str) -> None:
    random, t = np.random.default_rng(seed), STEP * np.arange(COUNT)
    for most in (random.uniform(0.5, 1.5), 0.0):  # deg/s
        r = np.radians(most) * np.sin(t / random.uniform(20.0, 60.0)) + most * 1e-4
        psi, speed = np.cumsum(r) * STEP, 4.0 + most * np.sin(t / 30.0)
        velocity = speed * np.exp(1j * psi)
        seen = {"psi": psi, "r": r, "course": psi, "speed": speed}[name] + random.normal(0.0, 1e-4, COUNT)
        repeated = np.concatenate([seen[:FIRST], np.full(LAST - FIRST, seen[FIRST]), seen[LAST:]])
        parts = {"psi": psi, "r": r, "speed": speed}
        if most and name in parts:
            parts[name] = repeated
        pose, rates = (parts["psi"], np.cumsum(velocity) * STEP), (parts["r"], parts["speed"] * np.exp(1j * psi))
        spans = stuck_spans(name, t, repeated, pose, rates, np.ones(COUNT - 1, dtype=bool))
        assert spans == ([(FIRST, LAST - 1)] if most else [])
