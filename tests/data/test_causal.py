"""Values interpolated between fixes are replaced by the last one that was known by then."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.causal import causal_columns, last_known_rows
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


def test_what_holds_still_is_known_and_other_columns_stay() -> None:
    data = as_dataset(turning(np.arange(30.0)).assign(u=4.0))
    held = causal_columns(data, ["u"])
    np.testing.assert_array_equal(held.frame["u"], 4.0)
    np.testing.assert_array_equal(held.frame["psi"], data.frame["psi"])
    assert held.metadata["causal"] == ["u"]
