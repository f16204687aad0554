"""Gusts: the spectra of their sources, and series that have them."""

from __future__ import annotations

from itertools import pairwise
from math import gamma
from typing import Any

import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.simulation.gusts import Gusts, series, spectrum, variance

KINDS = {
    "npd": Gusts(kind="npd"),
    "kaimal": Gusts(kind="kaimal", turbulence_intensity=0.12),
    "kaimal, high and slow": Gusts(kind="kaimal", turbulence_intensity=0.2, height=80.0, length_scale=200.0),
    "npd, few harmonics": Gusts(kind="npd", height=20.0, harmonics=12, frequencies=(0.005, 1.0)),
}
every_kind = pytest.mark.parametrize("gusts", KINDS.values(), ids=KINDS.keys())


def keys(count: int, seed: int = 1) -> list[tuple[object, ...]]:
    return [(seed, "manoeuvre", number) for number in range(count)]


def test_npd_integrates_to_its_closed_form() -> None:
    """With y = x^n the integral over all f is 320/172 (U/10)^2.75 (z/10)^(0.45-2/3) B(1/n, 5/(3n) - 1/n) / n."""
    n, U, z = 0.468, np.array([4.0, 10.0, 25.0]), 15.0
    beta = gamma(1 / n) * gamma(5 / (3 * n) - 1 / n) / gamma(5 / (3 * n))
    expected = 320 / 172 * (U / 10) ** 2.75 * (z / 10) ** (0.45 - 2 / 3) * beta / n
    everything = Gusts(kind="npd", height=z, frequencies=(1e-9, 1e9), harmonics=500)
    np.testing.assert_allclose(variance(everything, U), expected, rtol=1e-5)


def test_npd_at_ten_metres_and_ten_metres_a_second() -> None:
    at = spectrum(KINDS["npd"], np.array(10.0), np.array([0.0, 1 / 172]))
    np.testing.assert_allclose(at, [320.0, 320 * 2 ** (-5 / (3 * 0.468))])


def test_kaimal_integrates_to_its_closed_form() -> None:
    """sigma^2 ((1 + 6 a L/U)^(-2/3) - (1 + 6 b L/U)^(-2/3)) between a and b; L = 56.7 m at 10 m, 340.2 m above 60 m."""
    U, (a, b) = np.array([3.0, 12.0]), (0.01, 2.0)
    for height, length in ((10.0, 56.7), (90.0, 340.2)):
        gusts = Gusts(kind="kaimal", turbulence_intensity=0.1, height=height, frequencies=(a, b))
        part = (1 + 6 * a * length / U) ** (-2 / 3) - (1 + 6 * b * length / U) ** (-2 / 3)
        np.testing.assert_allclose(variance(gusts, U), (0.1 * U) ** 2 * part, rtol=1e-9)


@every_kind
def test_high_frequencies_fall_by_five_thirds(gusts: Gusts) -> None:
    f = np.array([1e7, 1e8])
    S = spectrum(gusts, np.array(10.0), f)
    assert np.log(S[1] / S[0]) / np.log(10) == pytest.approx(-5 / 3, abs=0.01)


@every_kind
def test_variance_of_a_long_series_is_the_integral(gusts: Gusts) -> None:
    U = np.array([2.0, 8.0, 15.0])
    f = np.geomspace(*gusts.frequencies, 20001)
    density = spectrum(gusts, U[:, None], f)
    integral = ((density[:, 1:] + density[:, :-1]) / 2 * np.diff(f)).sum(axis=1)
    time = np.arange(0.0, 40000.0, 0.9)
    gust = series(gusts, U, time, keys(3))
    np.testing.assert_allclose(gust.var(axis=0), integral, rtol=0.05)
    assert np.all(np.abs(gust.mean(axis=0)) < 0.03 * U)


@every_kind
def test_periodogram_follows_the_spectrum(gusts: Gusts) -> None:
    """Energy per third of the band, mean of 12 series: that of the spectrum, so its slope too."""
    U, step = np.full(12, 10.0), 0.45
    time = np.arange(16384) * step
    energy = (np.abs(np.fft.rfft(series(gusts, U, time, keys(12)), axis=0)) ** 2).mean(axis=1) * 2 / len(time) ** 2
    frequency = np.fft.rfftfreq(len(time), step)
    limits = np.geomspace(*gusts.frequencies, 4)
    for low, high in pairwise(limits):
        inside = energy[(frequency >= low) & (frequency < high)].sum()
        band = gusts.model_copy(update={"frequencies": (low, high)})
        assert inside == pytest.approx(variance(band, U[:1])[0], rel=0.1)


@every_kind
def test_a_series_depends_on_its_key_alone(gusts: Gusts) -> None:
    time, U = np.arange(200) * 0.5, np.array([1.0, 5.0, 9.0, 5.0])
    four = series(gusts, U, time, keys(4))
    np.testing.assert_array_equal(series(gusts, U, time, keys(4)), four)
    np.testing.assert_array_equal(series(gusts, U[1:2], time, keys(4)[1:2]), four[:, 1:2])
    assert np.abs(four[:, 1] - four[:, 3]).max() > 0.1  # the same wind, another manoeuvre
    assert np.abs(series(gusts, U, time, keys(4, seed=2)) - four).max() > 0.1


def test_nothing_repeats() -> None:
    """Equally spaced harmonics would come back after 1 / spacing; these do not within hours."""
    time = np.arange(0.0, 100.0, 0.5)
    first = series(KINDS["npd"], np.array([10.0]), time, keys(1))[:, 0]
    for later in 600.0 * np.arange(1, 37):
        again = series(KINDS["npd"], np.array([10.0]), time + later, keys(1))[:, 0]
        assert (again - first).std() > 0.2 * first.std()


def test_harmonics_are_jittered() -> None:
    """The strongest lines of 8 series, in a band of few, lie apart: far more than the resolution of 1/16,384 Hz."""
    few = Gusts(kind="npd", harmonics=2, frequencies=(0.05, 0.4))
    lines = np.abs(np.fft.rfft(series(few, np.full(8, 10.0), np.arange(16384.0), keys(8)), axis=0)).argmax(axis=0)
    assert np.diff(np.sort(lines)).min() > 0
    assert np.ptp(lines) > 1000


@every_kind
def test_no_wind_no_gusts(gusts: Gusts) -> None:
    gust = series(gusts, np.array([0.0, 1e-3, 6.0]), np.arange(50.0), keys(3))
    assert np.all(gust[:, 0] == 0.0)
    assert 0 < np.abs(gust[:, 1]).max() < 1e-3
    assert np.abs(gust[:, 2]).max() > 0.1


def test_wind_never_turns_round() -> None:
    wild, U = Gusts(kind="kaimal", turbulence_intensity=1.0), np.array([5.0])
    total = U + series(wild, U, np.arange(3000.0), keys(1))
    assert total.min() == 0.0  # cut, and only there
    assert (total == 0.0).mean() < 0.3


def test_negative_mean_is_refused() -> None:
    with pytest.raises(DocumentError, match="at least 0 m/s, not -1"):
        series(KINDS["npd"], np.array([2.0, -1.0]), np.arange(3.0), keys(2))


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ({"kind": "davenport"}, "npd"),
        ({"kind": "kaimal"}, "needs turbulence_intensity"),
        ({"kind": "npd", "turbulence_intensity": 0.1}, "neither turbulence_intensity nor length_scale"),
        ({"kind": "npd", "length_scale": 50.0}, "neither turbulence_intensity nor length_scale"),
        ({"kind": "npd", "frequencies": (0.5, 0.1)}, "low, high"),
        ({"kind": "npd", "frequencies": (0.0, 0.1)}, "must be above 0"),
        ({"kind": "npd", "height": -1.0}, "must be above 0"),
        ({"kind": "npd", "gustiness": 1.0}, "unknown key"),
    ],
)
def test_wrong_blocks_are_refused(block: dict[str, Any], message: str) -> None:
    with pytest.raises(DocumentError, match=message):
        Gusts(**block)
