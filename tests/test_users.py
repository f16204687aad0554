"""What a user wrote is known, and its mistakes have a place."""

from __future__ import annotations

import sys
from functools import partial

import numpy as np
import pytest

from shipid.errors import ShipidError
from shipid.hybrid.alone import Alone
from shipid.hybrid.method import fit_all
from shipid.physics import TERMS
from shipid.users import error_location, is_user_code, locate_errors, unwrap_callable


class Called:
    """An object that is called."""

    def __call__(self) -> None:
        raise ValueError("mine")


def plain() -> None:
    raise ValueError("mine")


BEGIN = plain.__code__.co_firstlineno


def test_functions_and_classes_of_a_user_are_known_in_any_dress() -> None:
    """A term may hold a plain function, a part of one, or an object that is called."""
    assert all(map(is_user_code, (plain, partial(plain), Called(), Called, lambda: None)))
    assert not any(map(is_user_code, (fit_all, partial(fit_all), Alone, *TERMS["radiation.roll"].functions)))
    assert not any(map(is_user_code, (str.upper, np.ndarray.sum)))
    assert unwrap_callable(partial(plain)) is plain
    assert unwrap_callable(Called()) is Called


@pytest.mark.parametrize("kind", [plain, Called])
def test_an_error_in_the_file_of_a_user_has_a_place(kind: type) -> None:
    words = rf"^mine: ValueError: mine in {__file__}, line {BEGIN + 1}$"
    with pytest.raises(ShipidError, match=words), locate_errors("mine", kind, "term"):
        plain()
    with pytest.raises(ValueError, match="mine") as caught, locate_errors("mine", fit_all):
        plain()
    assert error_location(caught.value, fit_all) == ""


def test_ends_of_the_process_and_right_errors() -> None:
    words = r"^mine calls sys\.exit \(no\): a term may not end the process"
    with pytest.raises(ShipidError, match=words), locate_errors("mine", fit_all, "term"):
        sys.exit("no")
    error = ShipidError("right")
    with pytest.raises(ShipidError) as caught, locate_errors("mine", plain):
        raise error
    assert caught.value is error
