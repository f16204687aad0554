"""Excitation: limits kept, energy only where declared, peaks low, holds and levels in their ranges."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.simulation.excitation import aprbs_series, deal_harmonics, limit_rate, multisine_series

PERIOD = 100.0
TIME = np.arange(2000) * 0.05  # one period
BANDS = {
    "successive": tuple(range(1, 13)),
    "sparse": (2, 3, 7, 11, 13, 21, 34),
    "narrow": (17, 18, 19, 20, 21),
    "dealt": deal_harmonics(range(2, 30), 3)[1],
    "many": tuple(range(3, 43)),
}
REACHED = {"successive": 1.45, "sparse": 1.96, "narrow": 1.75, "dealt": 1.45, "many": 1.45}  # crest factors
every_band = pytest.mark.parametrize("harmonics", BANDS.values(), ids=BANDS.keys())


def sines(harmonics: tuple[int, ...], time: np.ndarray = TIME, **changes: Any) -> np.ndarray:
    return multisine_series(time, **{"period": PERIOD, "harmonics": harmonics, "amplitude": 0.4, **changes})


def crest_factor(series: np.ndarray) -> float:
    return float(np.abs(series).max() / np.sqrt(np.mean(series**2)))


@every_band
def test_amplitude_limit_is_kept_and_used(harmonics: tuple[int, ...]) -> None:
    fine = np.abs(sines(harmonics, np.linspace(0, PERIOD, 50001))).max()
    assert 0.4 * 0.99 < fine <= 0.4


@every_band
def test_spectrum_lies_on_the_harmonics_alone_and_is_flat(harmonics: tuple[int, ...]) -> None:
    lines = np.abs(np.fft.rfft(sines(harmonics))) / len(TIME) * 2
    declared = np.isin(np.arange(len(lines)), harmonics)
    assert lines[~declared].max() < 1e-12
    np.testing.assert_allclose(lines[declared], lines[declared][0], rtol=1e-9)


@pytest.mark.parametrize("name", BANDS)
def test_peaks_are_below_schroeders(name: str) -> None:
    """Phases -pi k (k - 1) / K (Schroeder 1970)."""
    k = np.arange(1, len(BANDS[name]) + 1)
    turns = 2 * np.pi * np.outer(TIME, BANDS[name]) / PERIOD
    by_formula = crest_factor(np.sin(turns - np.pi * k * (k - 1) / len(k)).sum(axis=1))
    assert crest_factor(sines(BANDS[name])) < min(0.95 * by_formula, REACHED[name])


def test_dealt_commands_are_orthogonal_and_share_the_band() -> None:
    parts = deal_harmonics(range(2, 30), 3)
    assert sorted(harmonic for part in parts for harmonic in part) == list(range(2, 30))
    assert all(min(part) < 5 and max(part) > 26 for part in parts)
    commands = np.stack([sines(part) for part in parts], axis=1)
    products = commands.T @ commands / len(TIME)
    off_diagonal = products - np.diag(np.diag(products))
    assert np.abs(off_diagonal).max() < 1e-12


def steps(**changes: Any) -> np.ndarray:
    return aprbs_series(
        np.arange(20001) * 0.1, **{"hold": (4.0, 15.0), "levels": (-0.5, 0.3), "key": (7, 1), **changes}
    )


def test_a_longer_series_begins_with_the_shorter() -> None:
    time = np.arange(5001) * 0.1
    short = aprbs_series(time[:1001], hold=(4.0, 15.0), levels=(-0.5, 0.3), key=(7, 1))
    np.testing.assert_array_equal(aprbs_series(time, hold=(4.0, 15.0), levels=(-0.5, 0.3), key=(7, 1))[:1001], short)
    np.testing.assert_array_equal(
        aprbs_series(time + 40.0, hold=(4.0, 15.0), levels=(-0.5, 0.3), key=(7, 1))[:1001], short
    )
    assert not np.isin(short, steps(key=(7, 2))).any()


def test_rate_limit_is_respected_and_caught_up_with() -> None:
    ordered = np.stack([steps(), steps(key=(7, 2))], axis=1)
    executed = limit_rate(ordered, 0.1, 0.5)
    assert np.abs(np.diff(executed, axis=0)).max() <= 0.05 * (1 + 1e-9)
    np.testing.assert_array_equal(limit_rate(ordered[:, 0], 0.1, 0.5), executed[:, 0])
    assert executed.min() >= ordered.min()
    assert executed.max() <= ordered.max()
    assert np.mean(np.isclose(executed, ordered)) > 0.8  # 0.8 units at most take 1.6 s of holds of 4 s and more
    ends = np.flatnonzero(np.diff(ordered[:, 0]) != 0)
    np.testing.assert_allclose(executed[ends, 0], ordered[ends, 0])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sines((1000,)), "too fast for steps of 0.05 s"),
        (lambda: deal_harmonics((1, 2), 3), "cannot be shared by 3"),
    ],
)
def test_wrong_orders_are_refused(call: Any, message: str) -> None:
    with pytest.raises(DocumentError, match=message):
        call()


def test_levels_fill_their_range_evenly() -> None:
    series = steps()
    levels = series[np.concatenate([[0], np.flatnonzero(np.diff(series) != 0) + 1])]
    assert levels.min() >= -0.5
    assert levels.max() < 0.3
    eighth = np.floor((levels + 0.5) / 0.1).astype(int)
    for first in range(0, len(levels) - 8, 8):
        assert sorted(eighth[first : first + 8]) == list(range(8))
    assert len({tuple(eighth[first : first + 8]) for first in range(0, 80, 8)}) > 5  # in another order each time
