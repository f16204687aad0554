"""Arguments of any type that means the same are taken, and all others are refused in one line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch

from shipid.arguments import numbers, one_of, positive, whole
from shipid.errors import DataError, ShipidError


@pytest.mark.parametrize("value", [3, 3.0, np.int32(3), np.uint8(3), np.float32(3), np.array(3)])
def test_a_whole_number_of_any_type_is_an_int(value: Any) -> None:
    assert type(whole("horizon", value, 1)) is int
    assert whole("horizon", value, 1) == 3


@pytest.mark.parametrize("value", [0, -3, 2.5, "3", None, True, np.bool_(True), np.nan, np.inf, [3], 3 + 0j])
def test_anything_else_is_no_whole_number(value: Any) -> None:
    with pytest.raises(DataError, match="horizon must be a whole number, 1 or more, not"):
        whole("horizon", value, 1, DataError)


@pytest.mark.parametrize("value", [0.5, np.float64(0.5), np.float32(0.5), np.float16(0.5)])
def test_a_number_of_any_type_is_a_float(value: Any) -> None:
    assert type(positive("step", value)) is float
    assert positive("step", value) == 0.5


@pytest.mark.parametrize("value", [0, -0.5, "0.5", None, True, np.nan, np.inf, [0.5], 0.5 + 0j, np.complex128(0.5)])
def test_anything_else_is_no_positive_number(value: Any) -> None:
    with pytest.raises(ShipidError, match="step must be a number above 0 and finite, not"):
        positive("step", value)


def test_an_unknown_name_comes_with_those_that_are_valid() -> None:
    one_of("method", "rk4", ("euler", "rk4"))
    with pytest.raises(ShipidError, match=r"method 'Euler' is not known: did you mean 'euler'\?"):
        one_of("method", "Euler", ("euler", "rk4"))
    with pytest.raises(ShipidError, match="method None is not known: valid: euler, rk4"):
        one_of("method", None, ("euler", "rk4"))


@pytest.mark.parametrize(
    "values",
    [
        [1, 2],
        (1.0, 2.0),
        pd.Series([1, 2], index=[7, 3]),
        torch.tensor([1, 2]),
        np.array([1, 2], dtype=np.uint8),
        np.array([1, 2], dtype=object),
        np.array([1, 9, 2], dtype=np.float32)[::2],
    ],
)
def test_numbers_of_any_type_are_floats(values: Any) -> None:
    assert numbers("u", values).dtype == np.float64
    np.testing.assert_array_equal(numbers("u", values), [1.0, 2.0])


def test_a_masked_value_is_none() -> None:
    np.testing.assert_array_equal(numbers("u", np.ma.masked_array([1, 2], [False, True])), [1.0, np.nan])


@pytest.mark.parametrize("values", [["1"], [1j], [[1], [1, 2]], [pd.NA], {"u": 1}, torch.ones(1).requires_grad_()])
def test_what_holds_no_numbers_is_refused(values: Any) -> None:
    with pytest.raises(ShipidError, match="u must be an array of numbers, not"):
        numbers("u", values)
