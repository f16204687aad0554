"""Excitation: rate limits kept, holds and levels in their ranges."""

from __future__ import annotations

from typing import Any

import numpy as np

from shipid.simulation.excitation import aprbs_series, limit_rate


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


def test_levels_fill_their_range_evenly() -> None:
    series = steps()
    levels = series[np.concatenate([[0], np.flatnonzero(np.diff(series) != 0) + 1])]
    assert levels.min() >= -0.5
    assert levels.max() < 0.3
    eighth = np.floor((levels + 0.5) / 0.1).astype(int)
    for first in range(0, len(levels) - 8, 8):
        assert sorted(eighth[first : first + 8]) == list(range(8))
    assert len({tuple(eighth[first : first + 8]) for first in range(0, 80, 8)}) > 5  # in another order each time
