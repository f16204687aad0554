"""Frames as tables of text: every number of the report can be read, searched and sorted."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup, escape

from shipid.report.wording import ends_text, fixed_text, scientific_text

LONG_TEXT = 30  # characters that a column shows of a text
MISSING = 1e300  # sorts after every number (page.js knows it)


@dataclass(frozen=True)
class TableCell:
    """Text of a table cell and the key it is sorted by; `bad` marks a cell without a result."""

    text: str
    key: float | str
    bad: bool = False


@dataclass(frozen=True)
class PageTable:
    """A table of the page; numeric columns are set flush right."""

    id: str
    title: str
    takeaway: str
    columns: Sequence[str]
    numeric: Sequence[bool]
    rows: Sequence[Sequence[TableCell]]


def frame_table(id: str, title: str, takeaway: str, frame: pd.DataFrame, columns: Mapping[str, str]) -> PageTable:
    """Make a table of a frame of values, or of cells as they are.

    Lengths, in [m], have two digits of their median and two decimals at least; whole numbers none; others three digits
    of their median, three decimals at most. columns : heading -> column of the frame; one that it lacks is left out.
    """
    known = {heading: source for heading, source in columns.items() if source in frame}
    cells = [_column_cells(frame[source], heading.endswith("[m]")) for heading, source in known.items()]
    numeric = [any(isinstance(cell.key, float | int) for cell in column) for column in cells]
    return PageTable(id, title, takeaway, list(known), numeric, list(zip(*cells, strict=True)))


def _column_cells(values: pd.Series[Any], lengths: bool) -> list[TableCell]:
    if values.dtype == object or values.dtype == bool or not pd.api.types.is_numeric_dtype(values):
        return [value if isinstance(value, TableCell) else word_cell(value) for value in values]
    places = decimals_for_median(values, 2, 2, 6) if lengths else decimals_for_median(values)
    places = 0 if not lengths and values.dropna().mod(1).eq(0).all() else places
    return [number_cell(value, places) for value in values]


def with_cells(frame: pd.DataFrame, **cells: Sequence[TableCell]) -> pd.DataFrame:
    """The frame with columns of cells."""
    return frame.assign(**{name: pd.Series(list(some), frame.index, object) for name, some in cells.items()})


def cell_html(cell: TableCell, numeric: bool, first: bool) -> Markup:
    """Write a cell as an element of HTML; its key is left out where page.js reads the same from the text.

    Of a long text the begin is shown, a long name whole: names of models often differ at the end alone.
    """
    long = len(cell.text) > LONG_TEXT
    name = long and (" + " in cell.text or max(map(len, cell.text.split()), default=0) > LONG_TEXT)
    classes = " ".join(["words"] * (not numeric) + (["bad"] if cell.bad else ["name" if name else "long"] * long))
    read, key = cell.text.lower(), f"{cell.key:.6g}" if isinstance(cell.key, float | int) else cell.key
    given = {"scope": "row" if first else "", "class": classes, "data-key": "" if key == read else key}
    given["title"] = cell.text if long else ""
    attributes = "".join(f' {name}="{escape(value)}"' for name, value in given.items() if value)
    tag = "th" if first else "td"
    return Markup(f"<{tag}{attributes}>{escape(cell.text)}</{tag}>")  # all that is not ours is escaped


def word_cell(value: object, *, bad: bool = False) -> TableCell:
    """Make a cell of words; a missing value is a dash."""
    missing = value is None or value is pd.NA or (isinstance(value, float) and math.isnan(value))
    return TableCell("–" if missing else str(value), "" if missing else str(value).lower(), bad)


def number_cell(value: object, decimals: int) -> TableCell:
    """Make a cell with a number of fixed decimals, so that points align; NaN is a dash and sorts last."""
    amount = math.nan if value is None or value is pd.NA else float(str(value))
    return TableCell(fixed_text(amount, decimals), amount) if math.isfinite(amount) else TableCell("–", MISSING)


def digits_cell(value: float, digits: int = 4) -> TableCell:
    """Make a cell with a number of so many digits; a dash that sorts last where it is not finite."""
    return TableCell(scientific_text(value, digits), float(value)) if math.isfinite(value) else TableCell("–", MISSING)


def note_cells(notes: Iterable[str]) -> list[TableCell]:
    """Make cells of notes on what is missing, empty for none."""
    return [word_cell(note, bad=bool(note)) for note in notes]


def range_cell(low: float, high: float) -> TableCell:
    """Make a cell of two lengths [m], sorted by the lower; a dash where one is not finite."""
    return TableCell(ends_text(low, high), low) if math.isfinite(high - low) else TableCell("–", MISSING)


def decimals_for_median(values: pd.DataFrame | pd.Series[Any], digits: int = 3, least: int = 0, most: int = 3) -> int:
    """Decimals, from least to most, that leave so many digits to the median; two where all are 0 or missing."""
    sizes = np.abs(np.asarray(values.apply(pd.to_numeric, errors="coerce"), dtype=float))
    sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
    return int(np.clip(digits - 1 - np.floor(np.log10(np.median(sizes))), least, most)) if len(sizes) else 2
