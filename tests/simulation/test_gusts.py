"""Gusts: the spectra of their sources, and series that have them."""

from __future__ import annotations

from math import gamma
from typing import Any

import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.simulation.weather import Gusts, _bin_variances, gust_series, gust_spectrum

KINDS = {
    "npd": Gusts(kind="npd"),
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
    np.testing.assert_allclose(_bin_variances(everything, U).sum(axis=1), expected, rtol=1e-5)


@every_kind
def test_variance_of_a_long_series_is_the_integral(gusts: Gusts) -> None:
    U = np.array([2.0, 8.0, 15.0])
    f = np.geomspace(*gusts.frequencies, 20001)
    density = gust_spectrum(gusts, U[:, None], f)
    integral = ((density[:, 1:] + density[:, :-1]) / 2 * np.diff(f)).sum(axis=1)
    time = np.arange(0.0, 40000.0, 0.9)
    gust = gust_series(gusts, U, time, keys(3))
    np.testing.assert_allclose(gust.var(axis=0), integral, rtol=0.05)
    assert np.all(np.abs(gust.mean(axis=0)) < 0.03 * U)


@every_kind
def test_a_series_depends_on_its_key_alone(gusts: Gusts) -> None:
    time, U = np.arange(200) * 0.5, np.array([1.0, 5.0, 9.0, 5.0])
    four = gust_series(gusts, U, time, keys(4))
    np.testing.assert_array_equal(gust_series(gusts, U, time, keys(4)), four)
    np.testing.assert_array_equal(gust_series(gusts, U[1:2], time, keys(4)[1:2]), four[:, 1:2])
    assert np.abs(four[:, 1] - four[:, 3]).max() > 0.1  # the same wind, another manoeuvre
    assert np.abs(gust_series(gusts, U, time, keys(4, seed=2)) - four).max() > 0.1


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ({"kind": "kaimal"}, "npd"),
        ({"kind": "npd", "frequencies": (0.5, 0.1)}, "low, high"),
        ({"kind": "npd", "frequencies": (0.0, 0.1)}, "must be above 0"),
        ({"kind": "npd", "height": -1.0}, "must be above 0"),
        ({"kind": "npd", "gustiness": 1.0}, "unknown key"),
    ],
)
def test_wrong_blocks_are_refused(block: dict[str, Any], message: str) -> None:
    with pytest.raises(DocumentError, match=message):
        Gusts(**block)


def test_gusts_of_one_frequency_are_refused() -> None:
    with pytest.raises(DocumentError, match=r"frequencies must be \[low, high\]"):
        Gusts(kind="npd", frequencies=(0.1, 0.1))
