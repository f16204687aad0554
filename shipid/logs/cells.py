"""Cells of a table: a column by its name, texts as numbers, and angles in several columns or digits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.errors import DataError, suggest_name
from shipid.logs.formats import Format, TableFormat, TextFormat
from shipid.logs.mapping import (
    OF_SHIP,
    degrees_and_minutes,
    degrees_in_parts,
    degrees_to_side,
    quaternion_size,
    quaternion_yaw,
)
from shipid.logs.readers import in_points

OFF_ONE = 0.05  # of the size of a quaternion from 1: more is no rounding


Parts = list[NDArray[np.float64]]
CODES: dict[str, tuple[Callable[[Parts], Any], Callable[[Parts], Any], Callable[[Parts], Any], str]] = {
    "ddmm": (
        lambda parts: degrees_and_minutes(parts[0]),
        lambda parts: np.abs(parts[0]) % 100.0 >= 60.0,
        lambda parts: parts[0],
        "60 minutes or more: is the unit deg?",
    ),
    "deg": (
        degrees_in_parts,
        lambda parts: np.max(np.abs(parts[1:]), axis=0) >= 60.0,
        lambda parts: np.max(np.abs(parts[1:]), axis=0),
        "60 or more: are these minutes or seconds?",
    ),
    "quaternion": (
        quaternion_yaw,
        lambda parts: (quaternion_size(parts) > 0.0) & (np.abs(quaternion_size(parts) - 1.0) > OFF_ONE),
        lambda parts: np.round(quaternion_size(parts), 4),
        "the size of what has to be a quaternion, of size 1: are these x, y, z, w?",
    ),
}
"""Unit of numbers that are a code, or of several columns -> their values (N,), which are wrong, what is shown of these,
and why."""


def of_curve(
    numbers: NDArray[np.float64], curve: Sequence[tuple[float, float]], log: pd.DataFrame, file: Path, path: str
) -> NDArray[np.float64]:
    """Numbers (N,) of a log as a curve of pairs (number, value) has them, linear between; none may lie outside it."""
    ends, values = np.array(curve).T
    why = (
        f" is outside the curve, {ends[0]:g} to {ends[-1]:g}: give it another end, flat where the drive stays as it is"
    )
    wrong = np.flatnonzero((numbers < ends[0]) | (numbers > ends[-1]))
    if len(wrong):
        raise DataError(f"{numbers[wrong[0]]:.10g} in {row_in_words(log, wrong[0])}{why}", file=file, path=path)
    return np.asarray(np.interp(numbers, ends, values), dtype=np.float64)


def decode_numbers(
    parts: Parts, names: tuple[str, ...], unit: str, log: pd.DataFrame, file: Path, path: str
) -> NDArray[np.float64]:
    """Values (N,) of columns (N,) of these names in a unit of `CODES`; raises DataError at the first that is none."""
    values, are_wrong, shown, why = CODES[unit]
    wrong = np.flatnonzero(are_wrong(parts))
    if len(wrong):
        what = f"{', '.join(map(repr, names))}: {shown(parts)[wrong[0]]:.10g} in {row_in_words(log, wrong[0])} is {why}"
        raise DataError(what, file=file, path=path)
    return np.asarray(values(parts), dtype=np.float64)


def row_in_words(log: pd.DataFrame, place: int) -> str:
    """A row of a log in words, by its number among all rows of the file: of `log` some may have been left out."""
    return f"row {int(log.index[place]) + 1}"


def log_column(log: pd.DataFrame, source: str, file: Path, path: str) -> pd.Series[Any]:
    """A column (N,) of a log by its name; raises DataError at `path` where it is missing, or there twice."""
    names = [str(name) for name in log.columns]
    if names.count(source) > 1:
        raise DataError(f"column {source!r} appears twice in the log: rename one of them", file=file, path=path)
    if source in log.attrs.get("other", {}):
        raise DataError(f"{source!r} is {log.attrs['other'][source]}", file=file, path=path)
    if source not in names:
        alone = f"the header is one column, {names[0]!r}: is the separator right?" if names else "there is none"
        remedy = alone if len(names) <= 1 else suggest_name(source, names)
        raise DataError(f"column {source!r} is not in the log: {remedy}", file=file, path=path)
    return log.iloc[:, names.index(source)]


def parse_numbers(
    log: pd.DataFrame, source: str, form: Format, file: Path, path: str, sides: str = "", fillers: Sequence[float] = ()
) -> NDArray[np.float64]:
    """Turn a column into numbers, NaN where missing; text that is no number raises with its row.

    sides : letters of an angle in degrees, such as 59°26'12.3"N. fillers : numbers that stand for no value.
    """
    column = log_column(log, source, file, path)
    numeric = pd.api.types.is_numeric_dtype(column.dtype)
    text = column if numeric else column.fillna("").astype(str).str.strip()

    def refuse(wrong: Any, what: str, remedy: str = "") -> None:
        rows = np.flatnonzero(wrong)
        if len(rows):
            message = f"{text.iloc[rows[:1]].tolist()[0]!r} {what} (column {source!r}; {len(rows)} such rows){remedy}"
            raise DataError(message, file=file, path=row_in_words(log, rows[0]))

    if numeric:
        numbers = column.to_numpy(dtype=np.float64, na_value=np.nan)
        refuse(np.isinf(numbers), "is no number")
        return numbers
    read = form if isinstance(form, TableFormat) else TextFormat()
    if read.decimal == "," and read.thousands is None:
        pointed = text.str.contains(".", regex=False)
        if text[pointed].str.fullmatch(r"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?").all():  # 1.250 may be 1250
            refuse(
                pointed,
                "has a point, and the decimal is a comma",
                ": is it a mark of thousands? Write [format] thousands = '.'. Is it the decimal of this column? Write "
                "a comma there",
            )
    missing = text.isin(read.missing)
    numbers = text_numbers(text.mask(missing), read.decimal, read.thousands)
    missing |= np.isin(numbers, fillers)
    if sides and np.any(~np.isfinite(numbers) & ~missing):
        words = in_points(text, read.decimal, None).mask(missing)
        angles = degrees_to_side(words, sides)
        if sides != OF_SHIP or np.isfinite(angles).sum() > np.isfinite(numbers).sum():
            numbers = angles
    sided = f" and no {'angle' if sides == OF_SHIP else 'position'} with {' or '.join(sides)}" if sides else ""
    refuse(
        ~np.isfinite(numbers) & ~missing,
        f"is no number{sided}",
        ": correct it, or list it in [format] missing, or check decimal and thousands",
    )
    return numbers


def text_numbers(text: pd.Series[Any], decimal: str, thousands: str | None) -> NDArray[np.float64]:
    """Texts (N,) as numbers, NaN for what is none."""
    numbers = pd.to_numeric(in_points(text, decimal, thousands), errors="coerce")
    return numbers.to_numpy(dtype=np.float64, na_value=np.nan, copy=True)
