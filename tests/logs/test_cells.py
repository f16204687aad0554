"""Cells of a table as numbers and angles, and what is said of one that is none."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.logs.cells import decode_numbers, log_column, parse_numbers
from shipid.logs.formats import TextFormat

FILE = Path("log.csv")


def test_texts_become_numbers_as_the_format_says() -> None:
    log = pd.DataFrame({"n": ["1.250,5", " -3,25", "n/a", ""]})
    form = TextFormat(decimal=",", thousands=".", missing=("", "n/a"))
    np.testing.assert_equal(parse_numbers(log, "n", form, FILE, "columns.n.from"), [1250.5, -3.25, np.nan, np.nan])


def test_a_text_that_is_no_number_is_named_with_its_row_in_the_file() -> None:
    log = pd.DataFrame({"n": ["1", "2", "off"]}, index=[0, 1, 7])
    with pytest.raises(DataError, match=r"log\.csv: row 8: 'off' is no number \(column 'n'; 1 such rows\)"):
        parse_numbers(log, "n", TextFormat(), FILE, "columns.n.from")


def test_a_column_that_is_there_twice_or_not_at_all_is_refused() -> None:
    log = pd.DataFrame([[1.0, 2.0, 3.0]], columns=["n", "n", "speed"])
    with pytest.raises(DataError, match="'n' appears twice"):
        log_column(log, "n", FILE, "columns.n.from")
    with pytest.raises(DataError, match=r"columns\.u\.from: column 'sped' is not in the log: .*speed"):
        log_column(log, "sped", FILE, "columns.u.from")


def test_degrees_and_minutes() -> None:
    log = pd.DataFrame(index=range(2))
    np.testing.assert_allclose(
        decode_numbers([np.array([5930.0, -1045.0])], ("x",), "ddmm", log, FILE, "p"), [59.5, -10.75]
    )
    with pytest.raises(DataError, match="60 minutes or more"):
        decode_numbers([np.array([5930.0, 5975.0])], ("x",), "ddmm", log, FILE, "p")


def test_a_quaternion_that_is_none_is_named() -> None:
    """A turn by 90 deg about the vertical axis, and one of twice its size."""
    log, half = pd.DataFrame(index=range(2)), np.sqrt(0.5)
    parts = [np.zeros(2), np.zeros(2), np.array([half, half]), np.array([half, half])]
    np.testing.assert_allclose(decode_numbers(parts, tuple("xyzw"), "quaternion", log, FILE, "p"), np.pi / 2)
    with pytest.raises(DataError, match="2 in row 1 is the size of what has to be a quaternion"):
        decode_numbers([2 * part for part in parts], tuple("xyzw"), "quaternion", log, FILE, "p")


@pytest.mark.parametrize("sign", [",", "."])
def test_one_sign_for_decimals_and_thousands_is_refused(sign: Literal[",", "."]) -> None:
    """1,500 may be 1.5 or 1500."""
    with pytest.raises(ValueError, match="must be another sign than decimal"):
        TextFormat(decimal=sign, thousands=sign)
