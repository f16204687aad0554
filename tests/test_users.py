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
from shipid.users import of_users, place_of, placed, written


class Called:
    """An object that is called."""

    def __call__(self) -> None:
        raise ValueError("mine")


def plain() -> None:
    raise ValueError("mine")


BEGIN = plain.__code__.co_firstlineno


def test_functions_and_classes_of_a_user_are_known_in_any_dress() -> None:
    """A term may hold a plain function, a part of one, or an object that is called."""
    assert all(map(of_users, (plain, partial(plain), Called(), Called, lambda: None)))
    assert not any(map(of_users, (fit_all, partial(fit_all), Alone, *TERMS["radiation.roll"].functions)))
    assert not any(map(of_users, (str.upper, np.ndarray.sum)))
    assert written(partial(plain)) is plain
    assert written(Called()) is Called


@pytest.mark.parametrize("kind", [plain, Called])
def test_an_error_in_the_file_of_a_user_has_a_place(kind: type) -> None:
    words = rf"^mine: ValueError: mine in {__file__}, line {BEGIN + 1}$"
    with pytest.raises(ShipidError, match=words), placed("mine", kind, "term"):
        plain()
    with pytest.raises(ValueError, match="mine") as caught, placed("mine", fit_all):
        plain()
    assert place_of(caught.value, fit_all) == ""


def test_ends_of_the_process_and_right_errors() -> None:
    words = r"^mine calls sys\.exit \(no\): a term may not end the process"
    with pytest.raises(ShipidError, match=words), placed("mine", fit_all, "term"):
        sys.exit("no")
    error = ShipidError("right")
    with pytest.raises(ShipidError) as caught, placed("mine", plain):
        raise error
    assert caught.value is error
