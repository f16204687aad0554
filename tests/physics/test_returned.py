"""What functions of symbols return is checked before CasADi makes something else of it."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from casadi import SX

from shipid.errors import ShipidError
from shipid.physics.hull import derivatives_wrench
from shipid.physics.returned import check_returned

v = SX.sym("v")
C = SX.sym("C")


def term() -> None: ...


@pytest.mark.parametrize("value", [ca.vertcat(v, v), np.ones(2), [1.0, 2.0], ca.DM([1, 2]), np.array([v, C])])
def test_symbols_and_numbers_pass(value: Any) -> None:
    symbols = check_returned("mine", term, value, [v, {"C": C}], 2)
    assert isinstance(symbols, SX)
    assert symbols.shape == (2, 1)


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (v, r"a matrix of \(1, 1\)"),
        (ca.vertcat(v, v, v), r"a matrix of \(3, 1\)"),
        (ca.horzcat(v, v), r"a matrix of \(1, 2\)"),
        (None, "NoneType"),
        ([v, v], "list"),
        ([[1.0, 2.0], [3.0]], "list"),
        (ca.MX.sym("v", 2), "MX"),
        ({}, "dict"),
    ],
)
def test_anything_else_is_named(value: Any, found: str) -> None:
    with pytest.raises(ShipidError, match=rf"^mine must return 2 numbers, not {found} in {__file__}, line \d+$"):
        check_returned("mine", term, value, [v], 2)
    with pytest.raises(ShipidError, match=rf"^mine must return two, not {found}$"):
        check_returned("mine", derivatives_wrench, value, [v], 2, "two")


def test_numbers_that_are_none_are_refused_and_infinite_ones_pass() -> None:
    with pytest.raises(ShipidError, match=r"^mine returns what is not a number \(NaN\)"):
        check_returned("mine", term, v * np.nan, [v], 1)
    assert check_returned("mine", term, ca.fmin(v, np.inf), [v], 1).shape == (1, 1)
