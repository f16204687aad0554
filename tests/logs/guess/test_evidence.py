"""Kinematic tests on motion whose scale, delay, arm and jumps are known."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.logs.guess import evidence
from tests.drawn import seeds

T = np.arange(0.0, 600.0, 0.5)
PSI = 0.8 * np.sin(2 * np.pi * T / 90.0)
VELOCITY = (4.0 + 0.5j * np.sin(2 * np.pi * T / 70.0)) * np.exp(1j * PSI)
PATH = evidence.integrate_rate(T, VELOCITY)
CHOSEN = evidence.row_windows(T)


@pytest.mark.parametrize("scale", [1.0, 0.51444, -2.0])
def test_a_fit_gives_the_scale_back(scale: float) -> None:
    change = CHOSEN.change(PATH)
    fit = evidence.fit_scale(scale * change, change)
    assert fit.scale == pytest.approx(scale)
    assert fit.left == pytest.approx(0.0, abs=1e-12)
    assert fit.error < 1e-9


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_drawn_spikes_are_all_and_the_only_ones(seed: int) -> None:
    """Of one or two rows, in a smooth track, in a noisy speed and in a yaw rate; none in what was there before."""
    random, t = np.random.default_rng(seed), np.arange(2000.0)
    track = np.cumsum(5 + np.cos(t / 90)) / 1e5 + 54
    speed = 6 + np.cumsum(random.normal(0, 0.02, len(t))) + random.normal(0, 0.05, len(t))
    rate = np.round(40 * np.sin(t / 60) + random.normal(0, 1, len(t)), 1)
    for signal, size in ((track, 0.01), (speed, 90.0), (rate, 600.0)):
        assert not evidence.spike_rows(signal).any()
        wrong = np.zeros(len(t), dtype=bool)
        wrong[random.choice(np.arange(5, 1990, 8), 9, replace=False)] = True
        if seed % 2:
            wrong |= np.roll(wrong, 1)
        spoilt = np.where(
            wrong, signal + size * random.choice([-1.0, 1.0], len(t)) * random.uniform(0.8, 1.2, len(t)), signal
        )
        np.testing.assert_array_equal(evidence.spike_rows(spoilt), wrong)


def test_orders_angles_and_stays_are_no_spikes() -> None:
    t = np.arange(2000.0)
    helm = np.where((t % 300) < 150, 0.0, 20.0)
    helm[777] = 0.0  # for a moment, within what is usual
    heading = (10 * t) % 360
    rest = np.where(t > 1990, 6.0, 0.0)
    parts = np.repeat([0.0, 900.0, -300.0], [600, 700, 700]) + np.sin(t / 50)
    for signal in (helm, heading, np.radians(heading), rest, parts, np.zeros(2000), t[:20]):
        assert not evidence.spike_rows(signal).any()


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_a_heading_that_crosses_north_for_a_row_has_no_spike(seed: int) -> None:
    """Fast small craft, rows far apart; and a row far off is one, as an angle and as a length."""
    random = np.random.default_rng(seed)
    t = np.arange(240.0)
    size, period, middle = random.uniform(20, 40), random.uniform(6, 30), random.uniform(-40, 40)
    heading = middle + size * np.sin(2 * np.pi * t / period + random.uniform(0, 7))
    assert not evidence.spike_rows(np.round(heading % 360, 1)).any()
    assert not evidence.spike_rows(np.round(90 - heading % 360, 1)).any()  # to port from east
    slow = np.round((middle + 100 + 20 * np.sin(t / 40)) % 360, 1)
    slow[100] = (slow[100] + 120) % 360
    assert np.flatnonzero(evidence.spike_rows(slow)).tolist() == [100]


def test_rows_of_one_moment_are_no_usual_step() -> None:
    """Sensors of one moment, a millisecond apart, made every step between moments a hole."""
    t = np.sort(np.concatenate([np.arange(100.0) + offset for offset in (0.0, 0.001, 0.002)]))
    assert evidence.usual_step(t) == pytest.approx(0.998)
    assert evidence.usual_step(np.arange(100.0)) == 1.0
