"""Instants between samples."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.measures.record import (
    cubic_value_at,
    find_plateaus,
    integral_between,
    maximum_between,
    mean_between,
    settled_mean,
    start_of_change,
    time_of_crossing,
)

T = np.cumsum(np.array([0.0, 0.7, 0.4, 0.5, 0.9, 0.3, 0.6, 0.8, 0.5, 0.4]))


def test_a_cubic_is_met_between_uneven_samples() -> None:
    cubic = (T - 2.0) * (T - 2.5) * (T - 6.0)
    for when in (0.1, 1.0, 3.33, 5.0):
        assert cubic_value_at(T, cubic, when) == pytest.approx((when - 2) * (when - 2.5) * (when - 6))
    assert np.isnan(cubic_value_at(T, cubic, -0.1))
    assert np.isnan(cubic_value_at(T, cubic, T[-1] + 0.1))


def test_crossings_go_the_way_that_is_asked_for() -> None:
    cubic = (T - 1.0) * (T - 2.9) * (T - 4.5)
    assert time_of_crossing(T, cubic, 0.0, 0.0) == pytest.approx(1.0)
    assert time_of_crossing(T, cubic, 0.0, 1.5, rising=False) == pytest.approx(2.9)
    assert time_of_crossing(T, cubic, 0.0, 3.0) == pytest.approx(4.5)
    assert time_of_crossing(T, cubic, 0.0, 4.8) == 4.8  # beyond it by then
    assert np.isnan(time_of_crossing(T, cubic, 1e3, 0.0))
    dip = (T - 1.4) * (T - 1.58)  # between two samples
    assert time_of_crossing(T, dip, 0.0, 1.45) == pytest.approx(1.58)


def test_what_has_settled_does_not_depend_on_its_sign() -> None:
    """The last quarter less the one before is 1.4 % of the rate, for a turn to either side."""
    t = np.linspace(0.0, 40.0, 81)
    rate = 1.0 - np.exp(-t / 7.0)
    for sense in (1.0, -1.0):
        assert settled_mean(t, sense * rate, 0.0, 40.0, sense) == pytest.approx(
            sense * mean_between(t, rate, 30.0, 40.0)
        )
        assert np.isnan(settled_mean(t, sense * rate, 0.0, 40.0, sense / 10))


@pytest.mark.parametrize("decay", [0.002, 0.005, 0.02])
def test_a_decay_that_goes_on_for_long_has_not_settled(decay: float) -> None:
    """From quarter to quarter it changes by less than 5 % of the rate: it was taken for the rate that remains."""
    t = np.linspace(0.0, 40.0, 81)
    for rate in (np.exp(-decay * t), 1 / np.sqrt(1 + 2 * 10 * decay * t)):  # to 0; near neutral dr/dt goes with r^3
        assert np.isnan(settled_mean(t, rate, 0.0, 40.0, 1.0))
        assert settled_mean(t, np.full_like(t, rate[-1]), 0.0, 40.0, 1.0) == pytest.approx(rate[-1])


def test_integrals_begin_and_end_between_samples() -> None:
    assert integral_between(T, 3.0 + 2 * T, 0.3, 4.1) == pytest.approx(3 * 3.8 + 4.1**2 - 0.3**2)
    assert mean_between(T, 3.0 + 2 * T, 0.3, 4.1) == pytest.approx(3.0 + 4.4)


def test_extremes_lie_inside() -> None:
    when, value = maximum_between(T, 3.0 - (T - 2.2) ** 2, 0.0, 5.0)
    assert (when, value) == (pytest.approx(2.2), pytest.approx(3.0))
    assert np.isnan(maximum_between(T, T, 0.0, 5.0)[0])  # still rising where it ends


@pytest.mark.parametrize("cubic", [0.0, 1e-12, 1e-6, 0.02])
def test_extremes_of_drawn_records_are_exact(cubic: float) -> None:
    """Polynomials of degree 2 and 3 at drawn times: the fit has rounding, or nearly nothing, in its higher powers."""
    rng = np.random.default_rng(5)
    for _ in range(200):
        t = np.cumsum(rng.uniform(0.1, 0.6, 40)) * 10.0 ** rng.integers(-1, 3)
        middle, spread = t[20] + rng.uniform(-0.4, 0.4) * (t[20] - t[19]), t[30] - t[20]
        x = (t - middle) / spread
        when, value = maximum_between(t, 3.0 - x**2 + cubic * x**3, t[14], t[26])
        assert when == pytest.approx(middle, abs=1e-7 * spread)
        assert value == pytest.approx(3.0, abs=1e-12)


@pytest.mark.parametrize("rate", [2.3, 5.0, 20.0])
def test_an_angle_in_motion_is_traced_back(rate: float) -> None:
    """A rudder that moves to 35 deg at `rate` from 3.21 s on, sampled at 10 Hz."""
    t = np.arange(200) * 0.1
    angle = np.clip(rate * (t - 3.21), 0, 35)
    half = int(np.argmax(angle >= 17.5))
    assert start_of_change(t, angle, half) == pytest.approx(3.21, abs=1e-6)


@pytest.mark.parametrize("seed", [0])
@pytest.mark.parametrize("interval", [0.02, 0.1])
@pytest.mark.parametrize("digits", ["noise", "coarse"])
def test_a_noisy_or_coarse_angle_is_traced_back_to_its_level(digits: str, interval: float, seed: int) -> None:
    """A rudder from 3 to 35 deg at 2.5 deg/s: half of its way takes 6 s, which would be counted as too late."""
    random = np.random.default_rng(seed)
    t = np.arange(0, 60, interval)
    begin = 20 + random.uniform(0, interval)
    angle = 3 + np.clip(2.5 * (t - begin), 0, 32)
    angle = angle + random.normal(0, 0.1, len(t)) if digits == "noise" else np.round(2 * angle) / 2
    half = int(np.argmax(angle >= 17.5))
    assert start_of_change(t, angle, half) == pytest.approx(begin, abs=0.3)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_an_earlier_level_is_not_that_before_a_change(noise: float) -> None:
    """A shaft at 2.0 rev/s, slower from 300 s on, and astern by a ramp from 400 s on."""
    t = np.arange(0.0, 420.0, 0.5)
    order = np.interp(t, [0, 300, 300.5, 400, 440], [2.0, 2.0, 1.5, 1.5, -1.5])
    order = order + np.random.default_rng(0).normal(0, noise, len(t))
    assert start_of_change(t, -order, len(t) - 1) == pytest.approx(400.0, abs=1.0)


def test_plateaus_are_distinguished_from_the_way_between_them() -> None:
    t = np.arange(0, 90.0, 0.5)
    values = np.where(t < 30, 5.0, np.where(t < 60, 0.0 + 5 * np.exp(-(t - 30) / 3), -5 + 5 * np.exp(-(t - 60) / 3)))
    levels = find_plateaus(t, values, 0.1)
    assert [round(values[b]) for _, b in levels] == [5, 0, -5]
    assert [t[b] for _, b in levels] == [30.0, 60.0, 89.5]  # a row at the jump belongs to both
