"""Kinematic tests on motion whose scale, delay, arm and jumps are known."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.logs.guess import evidence

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


@pytest.mark.parametrize("seed", range(8))
def test_a_clock_that_was_set_does_not_hide_the_sign_of_a_rudder(seed: int) -> None:
    """No mean reaches over the hole in time, of decades, that it leaves."""
    order = 120.0 + np.sin(2 * np.pi * T / 90.0) * (T > 40.0)
    r = np.zeros(len(T))
    for row in range(1, len(T)):
        r[row] = r[row - 1] + 0.5 * (-0.1 * r[row - 1] + 0.01 * (order[row - 1] - 120.0))
    first = int(np.random.default_rng(seed).integers(2, 40))
    late = T + np.where(np.arange(len(T)) < first, 315_964_800.0, 1_715_673_600.0)
    assert evidence.order_effect(late, r, order) == pytest.approx(evidence.order_effect(T, r, order), rel=0.05)
    assert evidence.order_effect(T, r, order) > 20


@pytest.mark.parametrize("seed", range(20))
def test_a_heading_that_stood_still_in_a_turn_does_not_turn_the_sign_of_the_rudder(seed: int) -> None:
    """It jumps when it goes on: of 60 such logs 14 had a rudder of wrong sign, with t values up to 8."""
    random, t = np.random.default_rng(seed), np.arange(0.0, 1800.0)
    order = 1.0 * ((t > 600.0) & (t <= 1400.0)) + 0.02 * np.sin(t / 20.0)
    r = np.zeros(len(t))
    for row in range(1, len(t)):
        r[row] = 0.97 * r[row - 1] + 0.0004 * order[row - 1]
    psi, first = np.cumsum(r) + random.normal(0, 0.008, len(t)), int(random.integers(650, 1390))
    psi[first : first + 40] = psi[first]
    assert evidence.order_effect(t, np.gradient(psi, t), order) > -4.0


def test_a_jump_stays_and_a_spike_does_not() -> None:
    jumped = PATH + np.where(T >= 200.0, 40.0, 0.0) + np.where(T == 400.0, 60.0j, 0.0)
    jump, spike = evidence.position_jumps(T, jumped, PATH)
    assert jump[0] < 200.0 < jump[1]
    assert jump[2] == pytest.approx(40.0)
    assert spike[0] < 400.0 < spike[1]
    assert spike[2] == pytest.approx(0.0, abs=1e-9)
    assert evidence.position_jumps(T, PATH, PATH) == []


@pytest.mark.parametrize("late", [0.0, 1.0, 2.0, 4.0, 9.0])
def test_a_jump_ends_where_a_hole_of_the_clock_begins(late: float) -> None:
    """What lies beyond a hole is another run, however near to it the position jumps."""
    half = len(T) // 2
    clock = T + np.where(np.arange(len(T)) >= half, 1e4, 0.0)
    at = T[half - 1] - late
    jumped = PATH + np.where(at <= T, 40.0, 0.0) + np.where(np.arange(len(T)) >= half, 1e5, 0.0)
    jumped = jumped + np.where(T[half] + late < T, 40.0j, 0.0)  # and soon after the hole
    found = evidence.position_jumps(clock, jumped, PATH)
    assert len(found) == 2
    assert found[1][0] >= clock[half]
    assert found[1][2] < 50.0
    start, end, stays = found[0]
    assert start < at <= end <= clock[half - 1]
    assert stays < 50.0
    assert late < 1.0 or stays == pytest.approx(40.0)


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


@pytest.mark.parametrize("seed", range(8))
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


@pytest.mark.parametrize("heading", [False, True])
def test_a_value_that_stands_for_none_in_many_rows_is_a_spike_in_each(heading: bool) -> None:
    """Also within the range of an angle; of different values so many are none."""
    random, t = np.random.default_rng(1), np.arange(2000.0)
    signal = np.round(200 + 170 * np.sin(t / 200) + random.normal(0, 0.1, len(t)), 1)
    signal = np.round((signal + t / 4) % 360, 1) if heading else signal
    wrong = np.zeros(len(t), dtype=bool)
    wrong[random.choice(np.arange(5, 1990, 8), 90, replace=False)] = True
    wrong &= np.abs((signal - 102.3 + 180) % 360 - 180) > 30
    found = evidence.spike_rows(np.where(wrong, 102.3, signal))
    assert not (found & ~wrong).any()
    assert (found & wrong).sum() > 0.7 * wrong.sum()
    assert not evidence.spike_rows(np.where(wrong, 102.3 + random.normal(0, 3, len(t)), signal)).any()


def test_orders_angles_and_stays_are_no_spikes() -> None:
    t = np.arange(2000.0)
    helm = np.where((t % 300) < 150, 0.0, 20.0)
    helm[777] = 0.0  # for a moment, within what is usual
    heading = (10 * t) % 360
    rest = np.where(t > 1990, 6.0, 0.0)
    parts = np.repeat([0.0, 900.0, -300.0], [600, 700, 700]) + np.sin(t / 50)
    for signal in (helm, heading, np.radians(heading), rest, parts, np.zeros(2000), t[:20]):
        assert not evidence.spike_rows(signal).any()


def test_what_a_ship_does_after_a_long_stay_is_no_spike() -> None:
    """Of a day in port, an hour of zigzags: what is rare is not wrong; and a short crossing turns round once."""
    t = np.arange(20_000.0)
    under_way = (t > 12_000) & (t < 12_180)
    random = np.random.default_rng(1)
    noise = random.normal(0, 0.01, len(t))
    roll = np.where(under_way, 8 * np.sin(2 * np.pi * t / 5), 0.0) + noise
    rate = np.where(under_way, 3 * np.sin(2 * np.pi * t / 8), 0.0) + noise
    out = np.clip(10 - np.abs(t - 12_000), 0, None) * 1e-4 + 54
    north = (noise * 10 + np.where(t < 9000, 0.5, 359.5)) % 360
    for signal in (roll, rate, out, north, north * 10, np.radians(north), north / 360 * 400):
        assert not evidence.spike_rows(signal).any()
    absent = np.where(np.isin(t, [500.0, 15_000.0]), 511.0, north)
    np.testing.assert_array_equal(np.flatnonzero(evidence.spike_rows(absent)), [500, 15_000])


@pytest.mark.parametrize("turn", [360.0, 2 * np.pi, 400.0, 3600.0, 6400.0])
def test_what_is_no_angle_may_be_off_by_the_number_of_a_whole_turn(turn: float) -> None:
    """A speed of 8 kn that is 14.28 kn for a row, a yaw rate of 40 deg/min that is 400 deg/min."""
    t = np.arange(2000.0)
    speed = turn / 10 + np.round(0.02 * turn * np.sin(t / 90), 2)
    rate = np.round(0.04 * turn * np.sin(t / 60), 2)
    for signal in (speed, rate):
        spoilt = signal.copy()
        spoilt[[300, 900]] += turn
        np.testing.assert_array_equal(np.flatnonzero(evidence.spike_rows(spoilt)), [300, 900])


@pytest.mark.parametrize("seed", range(300))
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


@pytest.mark.parametrize(("low", "turn"), [(0.0, 360.0), (-180.0, 360.0), (-np.pi, 2 * np.pi)])
def test_an_angle_that_is_logged_in_every_third_row_is_filled_the_short_way(low: float, turn: float) -> None:
    """Between 359 and 1 deg lies 0: 180 was a sample that the draft then wanted to repair."""
    t = np.arange(300.0)
    angle = (0.013 * turn * t - low) % turn + low
    filled = evidence.fill_columns(t, [("psi", np.where(t % 3 == 0, angle, np.nan))])["psi"][:298]
    np.testing.assert_allclose(np.exp(2j * np.pi * filled / turn), np.exp(2j * np.pi * angle[:298] / turn), atol=1e-9)
    assert filled.min() >= low
    assert filled.max() < low + turn
    assert not evidence.heal_angle(filled, turn, t[:298])[1].any()
