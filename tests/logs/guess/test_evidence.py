"""Kinematic tests on motion whose scale, delay, arm and jumps are known."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.logs.guess import evidence
from tests.draws import seeds

T = np.arange(0.0, 600.0, 0.5)
PSI = 0.8 * np.sin(2 * np.pi * T / 90.0)
R = np.gradient(PSI, T)
VELOCITY = (4.0 + 0.5j * np.sin(2 * np.pi * T / 70.0)) * np.exp(1j * PSI)
PATH = evidence.integrate_rate(T, VELOCITY)
CHOSEN = evidence.row_windows(T)


def test_windows_have_their_length_and_no_hole() -> None:
    late = np.where(T > 300.0, T + 20.0, T)
    chosen = evidence.row_windows(late)
    lengths = late[chosen.last] - late[chosen.first]
    assert ((lengths >= 10.0) & (lengths < 10.6)).all()
    assert not ((late[chosen.first] <= 300.0) & (late[chosen.last] > 300.0)).any()
    assert (late[chosen.first] > 300.0).any()


def test_an_integral_of_a_linear_rate_is_exact() -> None:
    np.testing.assert_allclose(evidence.integrate_rate(T, (1 + 2j) * T), (1 + 2j) * T**2 / 2, atol=1e-6)


@pytest.mark.parametrize("scale", [1.0, 0.51444, -2.0])
def test_a_fit_gives_the_scale_back(scale: float) -> None:
    change = CHOSEN.change(PATH)
    fit = evidence.fit_scale(scale * change, change)
    assert fit.scale == pytest.approx(scale)
    assert fit.left == pytest.approx(0.0, abs=1e-12)
    assert fit.error < 1e-9


def test_noise_is_left_and_nothing_fits_nothing() -> None:
    random = np.random.default_rng(1)
    change = CHOSEN.change(PATH)
    noise = np.abs(change).mean() * (random.normal(size=len(change)) + 1j * random.normal(size=len(change)))
    fit = evidence.fit_scale(change + noise, change)
    assert fit.left == pytest.approx(2 / 3, abs=0.08)
    assert abs(fit.scale - 1.0) < 4 * fit.error < 0.3
    assert evidence.fit_scale(0 * change, change).left == 1.0


def test_outliers_are_left_out() -> None:
    change = CHOSEN.change(PATH)
    seen = change + 0.01
    seen[[5, 70]] += 300.0
    assert np.flatnonzero(~evidence.windows_without_outliers(seen, change)).tolist() == [5, 70]


@pytest.mark.parametrize("offset", [0.0, 0.3, np.pi / 2])
def test_agreement_is_the_angle_between_course_and_heading(offset: float) -> None:
    middle = PSI[(CHOSEN.first + CHOSEN.last) // 2]
    track = np.exp(1j * (middle + offset))
    assert evidence.course_agreement(track, middle) == pytest.approx(np.exp(1j * offset))
    assert evidence.course_agreement(0 * track, middle) == 0


def test_an_angle_is_unwrapped_and_false_samples_within_a_jump_are_replaced() -> None:
    true = np.degrees(5.8 + 0.01 * T)
    logged = true % 360.0
    healed, false = evidence.heal_angle(logged, 360.0, T)
    np.testing.assert_allclose(healed, true, atol=1e-9)
    assert not false.any()
    jump = int(np.flatnonzero(np.diff(logged) < -180)[0])
    logged[jump] = 180.0  # interpolated across 360
    healed, false = evidence.heal_angle(logged, 360.0, T)
    assert false.any()
    np.testing.assert_allclose(healed, true, atol=1.0)


def test_an_arm_is_seen() -> None:
    lever = 7.0 - 2.0j
    turned = np.exp(1j * PSI)
    off, error, explained = evidence.lever_arm(
        CHOSEN.change(PATH + lever * turned), CHOSEN.change(PATH), CHOSEN.change(turned)
    )
    assert off == pytest.approx(lever)
    assert error < 1e-9
    assert explained == pytest.approx(1.0)
    assert evidence.lever_arm(CHOSEN.change(PATH), CHOSEN.change(PATH), 0 * CHOSEN.change(turned)) == (0j, np.inf, 0.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_sign_of_an_order_is_its_effect_on_the_yaw_rate(sign: int) -> None:
    order = sign * np.sign(np.sin(2 * np.pi * T / 90.0))
    r = np.zeros(len(T))
    for row in range(1, len(T)):
        r[row] = r[row - 1] + 0.5 * (-0.1 * r[row - 1] + 0.01 * sign * order[row - 1])
    assert sign * evidence.order_effect(T, r, order) > 20
    assert evidence.order_effect(T, r, np.zeros(len(T))) == 0.0


def test_a_jump_stays_and_a_spike_does_not() -> None:
    jumped = PATH + np.where(T >= 200.0, 40.0, 0.0) + np.where(T == 400.0, 60.0j, 0.0)
    jump, spike = evidence.position_jumps(T, jumped, PATH)
    assert jump[0] < 200.0 < jump[1]
    assert jump[2] == pytest.approx(40.0)
    assert spike[0] < 400.0 < spike[1]
    assert spike[2] == pytest.approx(0.0, abs=1e-9)
    assert evidence.position_jumps(T, PATH, PATH) == []


def test_straight_parts_are_those_without_turning() -> None:
    r = np.where(T < 300.0, 0.0, 0.02)
    rows = evidence.straight_rows(r, T)
    assert rows[T < 280.0].all()
    assert not rows[T >= 300.0].any()


def test_visits_count_how_often_the_top_is_reached() -> None:
    assert evidence.maximum_visits(np.array([0, 2, 2, 1, 2, 0, 2.0])) == 3
    assert evidence.maximum_visits(np.array([2, 2, 1.0])) == 0


def test_an_interpolated_log_has_rows_on_lines() -> None:
    random = np.random.default_rng(2)
    slow = random.normal(size=20001)
    fast = np.interp(np.arange(0, 20000, 0.25), np.arange(20001.0), slow)
    assert evidence.interpolated_share(fast) == pytest.approx(0.75, abs=0.02)
    assert evidence.interpolated_share(random.normal(size=400)) == 0.0
    assert evidence.interpolated_share(np.round(fast, 1)) == 0.0


def test_rounding_shows_the_factor_of_a_conversion() -> None:
    random = np.random.default_rng(3)
    knots = np.round(random.uniform(2.0, 14.0, 200), 1)
    speed = np.repeat(knots * 0.5144, 2)
    multiplier, roundness, count = evidence.value_lattice(speed, 1.8, 2.1)
    assert multiplier == pytest.approx(1 / 0.5144, rel=1e-4)
    assert roundness > 0.99
    assert count >= 30
    assert evidence.value_lattice(np.repeat(random.uniform(2.0, 14.0, 200), 2), 1.8, 2.2)[0] == 0.0


def test_missing_values_are_interpolated() -> None:
    t = np.array([0.0, 1.0, 4.0])
    columns = evidence.fill_columns(t, [("a", np.array([0.0, np.nan, 8.0])), ("b", np.full(3, np.nan))])
    np.testing.assert_allclose(columns["a"], [0.0, 2.0, 8.0])
    assert np.isnan(columns["b"]).all()


@pytest.mark.parametrize("seed", seeds(8))
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


@pytest.mark.parametrize("seed", seeds(10))
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
