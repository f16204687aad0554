"""Values interpolated between fixes are replaced by the last one that was known by then."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.causal import causal_columns, last_known_rows
from shipid.errors import DataError
from tests.logs.conftest import as_dataset, turning


def interpolated(seed: int, count: int = 80) -> tuple[np.ndarray, np.ndarray]:
    """Fixes a random number of rows apart, and straight lines between them."""
    rng = np.random.default_rng(seed)
    fixes = np.unique(np.append(np.cumsum(rng.integers(2, 6, count)), [0]))
    fixes = fixes[fixes < count]
    return np.arange(float(count)), np.interp(np.arange(count), fixes, rng.normal(size=len(fixes)))


@pytest.mark.parametrize("seed", range(8))
def test_no_row_takes_a_later_one_and_none_goes_back(seed: int) -> None:
    known = last_known_rows(*interpolated(seed))
    assert (known <= np.arange(len(known))).all()
    assert (np.diff(known) >= 0).all()


@pytest.mark.parametrize("seed", range(8))
def test_a_later_fix_changes_no_earlier_row(seed: int) -> None:
    """Everything from a fix on replaced, and the line to it with it: rows up to the fix before stay."""
    t, values = interpolated(seed)
    bends = 1 + np.flatnonzero(np.abs(np.diff(values, 2)) > 1e-9)
    last, fix = bends[len(bends) // 2], bends[len(bends) // 2 + 1]
    changed = values.copy()
    changed[fix:] += 3.0
    changed[last : fix + 1] = np.interp(t[last : fix + 1], t[[last, fix]], changed[[last, fix]])
    frames = [turning(t).assign(u=column) for column in (values, changed)]
    one, other = (causal_columns(as_dataset(frame), ["u"]).frame["u"].to_numpy() for frame in frames)
    np.testing.assert_array_equal(one[:fix], other[:fix])
    assert not np.array_equal(one, other)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_fixes_between_rows_reach_no_row_before_them(seed: int, even: bool) -> None:
    """Fixes on another clock: whatever comes at a fix and later, rows before it hold what they held."""
    rng = np.random.default_rng(seed)
    rows = np.arange(80.0) + (0.0 if even else rng.uniform(-0.4, 0.4, 80))
    fixes = np.cumsum(rng.uniform(2.0, 6.0, 60)) - 3.0
    heights = rng.normal(size=len(fixes))
    one = causal_columns(as_dataset(turning(rows).assign(u=np.interp(rows, fixes, heights))), ["u"]).frame["u"]
    for first in np.flatnonzero((fixes > 10.0) & (fixes < 70.0)):
        changed = np.where(np.arange(len(fixes)) < first, heights, heights + rng.normal(size=len(fixes)))
        data = as_dataset(turning(rows).assign(u=np.interp(rows, fixes, changed)))
        before = rows < fixes[first]
        np.testing.assert_array_equal(causal_columns(data, ["u"]).frame["u"][before], one[before])


def test_what_holds_still_is_known_and_other_columns_stay() -> None:
    data = as_dataset(turning(np.arange(30.0)).assign(u=4.0))
    held = causal_columns(data, ["u"])
    np.testing.assert_array_equal(held.frame["u"], 4.0)
    np.testing.assert_array_equal(held.frame["psi"], data.frame["psi"])
    assert held.metadata["causal"] == ["u"]


def test_a_column_that_is_not_there_is_named() -> None:
    with pytest.raises(DataError, match="missing column"):
        causal_columns(as_dataset(turning(np.arange(30.0))), ["V_w"])


def test_what_holds_still_is_known_until_it_moves() -> None:
    """The row that moves lies on a line to a later fix, so the last one before it is what is known."""
    assert last_known_rows(np.arange(7.0), np.array([4.0, 4.0, 4.0, 4.0, 5.0, 6.0, 7.0])).tolist() == [
        0,
        1,
        2,
        3,
        3,
        3,
        3,
    ]
