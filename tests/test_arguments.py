"""Arguments of any type that means the same are taken, and all others are refused in one line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch

import shipid
from shipid.arguments import numbers, of_class, one_of, positive, whole_number
from shipid.errors import DataError, ShipidError
from shipid.export.write import export_predictor, export_vessel


@pytest.mark.parametrize("value", [3, 3.0, np.int32(3), np.uint8(3), np.float32(3), np.array(3)])
def test_a_whole_number_of_any_type_is_an_int(value: Any) -> None:
    assert type(whole_number("horizon", value, 1)) is int
    assert whole_number("horizon", value, 1) == 3


@pytest.mark.parametrize("value", [0, -3, 2.5, "3", None, True, np.bool_(True), np.nan, np.inf, [3], 3 + 0j])
def test_anything_else_is_no_whole_number(value: Any) -> None:
    with pytest.raises(DataError, match="horizon must be a whole number, 1 or more, not"):
        whole_number("horizon", value, 1, DataError)


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
    with pytest.raises(ShipidError, match="is not known: valid: euler, rk4"):
        one_of("method", np.array(["euler", "rk4"]), ("euler", "rk4"))


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


def test_an_object_of_another_class_comes_with_the_way_to_the_right_one() -> None:
    of_class("step", 1, int, "such as 1")
    with pytest.raises(DataError, match=r"vessel must be an int, such as 1, not 'mariner'"):
        of_class("vessel", "mariner", int, "such as 1", DataError)
    with pytest.raises(ShipidError, match=r"vessel must be an int, such as 1, not list"):
        of_class("vessel", [1], int, "such as 1")


ANY: Any = object()
CALLS: dict[str, tuple[Callable[[], Any], str]] = {
    "rollout": (lambda: shipid.rollout(ANY, {}, {}, step=1.0, num_steps=1), "vessel must be a Vessel, as of"),
    "members": (lambda: shipid.members(shipid.Family(name="f"), ANY), "base must be a Vessel, as of"),
    "simulate": (lambda: shipid.simulate(ANY, ANY), "truth must be a Truth, such as"),
    "cut_windows": (lambda: shipid.cut_windows(ANY, horizon=1), "dataset must be a Dataset, as of"),
    "write_dataset": (lambda: shipid.write_dataset(ANY, "x.parquet"), "dataset must be a Dataset, such as"),
    "check_dataset": (lambda: shipid.check_dataset(ANY), "dataset must be a Dataset, as of"),
    "import_log": (lambda: shipid.import_log(ANY, "log.csv"), "mapping must be a Mapping, as of"),
    "identify": (lambda: shipid.identify(ANY, ANY, [], ANY), "dataset must be a Dataset, as of"),
    "rollout commands": (
        lambda: shipid.rollout(shipid.load_vessel("mariner"), {}, ANY, step=1.0, num_steps=1),
        "commands must be a dict, of a name to an array, not object",
    ),
    "Vessel": (lambda: shipid.Vessel({}, "x"), "no document of a vessel: read one with `load_vessel`"),
    "standard": (lambda: shipid.standard(ANY, "zigzag"), "vessel must be a Vessel, as of"),
    "Physics": (lambda: shipid.Physics(None, 2, 1.0, observer=ANY), "observer must be an Observer, such as"),
    "draw": (lambda: shipid.draw(ANY, 0, ANY), "family must be a Family, such as"),
    "numbers": (lambda: shipid.members(shipid.Family(name="f"), ANY, numbers=ANY), "base must be a Vessel"),
    "run_identification": (lambda: shipid.run_identification(ANY, ANY, ANY), "settings must be an Identify, such as"),
    "screen": (lambda: next(shipid.screen(ANY, ANY, [], 1)), "plan must be a Plan, as of"),
    "compare": (lambda: shipid.compare(ANY), "name two folders or more"),
    "compare_methods": (lambda: shipid.compare_methods(ANY), "results must be a Results, as of"),
    "read_dataset": (lambda: shipid.read_dataset(ANY), "file must be a path, a text or a Path, not <object"),
    "read_results": (lambda: shipid.read_results(ANY), "folder must be a path"),
    "read_cells": (lambda: shipid.read_cells(ANY), "folder must be a path"),
    "write_pages": (lambda: shipid.write_pages(ANY), "folder must be a path"),
    "guess": (lambda: shipid.guess(ANY), "path must be a path"),
    "export_predictor": (lambda: export_predictor(ANY, "c", "x"), "give a Predictor, as of `fit` or `Predictor.load`"),
    "export_vessel": (lambda: export_vessel(ANY, "c", ANY), "out must be a path"),
    "run_study": (lambda: next(shipid.run_study(ANY, "run")), "plan must be a Plan, as of"),
}


@pytest.mark.parametrize(("call", "message"), CALLS.values(), ids=CALLS)
def test_public_functions_refuse_what_they_do_not_take(call: Callable[[], Any], message: str) -> None:
    """Before, an AttributeError from deep inside."""
    with pytest.raises(ShipidError, match=message):
        call()
