"""Read an unknown log: recognise its format, and return its columns as numbers."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.readers import LOOKED_AT, READERS, read_table, seconds

SEPARATORS = (",", ";", "\t", "|", "whitespace")
NUMERIC = 0.8  # share of the cells of a line of data that are numbers
CLOCK_WORDS = re.compile(r"^(t|tvec|time.*|timestamp|stamp|clock|sec|seconds|date.*|utc.*|.*_time|ms|zeit)$")
_UNIT = re.compile(
    r"[\[(]?(s|ms|m|km|deg|°|rad|m/s|kn|kts|knots|km/h|deg/s|deg/min|rad/s|rpm|1/s|hz|nm?|kw|%|-|)[\])]?$"
)
_WORDS_FOR_NOTHING = ("", "nan", "null", "none", "n/a", "na", "-", "--")


@dataclass(frozen=True)
class Sniffed:
    """An unknown log as numbers: how it is written, its clock and all other columns, NaN where a value is missing.

    `form` holds the keys of [format] and `clock` those of [clock]; `t` [s] rises; `notes` are sentences on columns
    that were left out.
    """

    form: dict[str, Any]
    clock: dict[str, Any]
    t: Array
    columns: dict[str, Array]
    notes: tuple[str, ...]

    @property
    def scattered(self) -> bool:
        """Whether a row is a single sentence, so that empty cells are no defect."""
        return READERS[self.form.get("kind", "text")].scattered


def sniff(file: Path, names: tuple[str, ...] = ()) -> Sniffed:
    """Recognise the format of a log and read it; `names` are the columns of a text log without a header.

    Raises
    ------
    DataError : the file cannot be read as a log, or no column can be its clock.
    """
    try:
        head = file.read_bytes()[:200_000]
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", file=file) from None
    if not head.strip():
        raise DataError("the file is empty", file=file)
    form = _format(head, file, names)
    model = READERS[form.get("kind", "text")].options.model_validate(form)
    table = read_table(file, model, "time")
    columns, words = _numbers(table, form.get("decimal", "."))
    clock, t = _clock(table, columns, file)
    named = clock["from"]
    notes = tuple(f"column {name!r} holds words, not numbers" for name in words if name != named)
    constant = [name for name, values in columns.items() if np.isnan(values).all()]
    kept = {name: values for name, values in columns.items() if name != named and name not in constant}
    return Sniffed(form, clock, t, kept, notes + tuple(f"column {name!r} is empty" for name in constant))


def _format(head: bytes, file: Path, names: tuple[str, ...]) -> dict[str, Any]:
    for reader in READERS.values():
        form = reader.detect(file, head) if reader.detect else None
        if form is not None:
            return form
    encoding = _encoding(head, file)
    return _text_format(head.decode(encoding, "ignore").splitlines()[:LOOKED_AT], encoding, file, names)


def _encoding(head: bytes, file: Path) -> str:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in head:
        raise DataError("a binary file of unknown format: export it as text, Parquet, .mat or NMEA", file=file)
    for encoding in ("utf-8-sig" if head.startswith(b"\xef\xbb\xbf") else "utf-8", "cp1252"):
        try:
            # the last character may be cut
            head[:-4].decode(encoding) if len(head) > 4 else head.decode(encoding)
            return encoding
        except UnicodeDecodeError:
            continue
    return "latin-1"


def _text_format(lines: list[str], encoding: str, file: Path, names: tuple[str, ...]) -> dict[str, Any]:
    """Return the separator and decimal sign that give most numbers in lines of equal length; the header is above."""
    best: tuple[float, str, str] = (0.0, "", "")
    for separator in SEPARATORS:
        rows = [cells(line, separator) for line in lines if line.strip()]
        width, count = Counter(len(row) for row in rows).most_common(1)[0]
        for decimal in (".", ",") if separator != "," else (".",):
            share = float(np.mean([_number_share(row, decimal) for row in rows if len(row) == width]))
            score = share * count / len(rows) * (width > 1) * (1 + width / 1000)
            if score > best[0]:  # the first of equals: tabs are blanks, too
                best = (score, separator, decimal)
    score, separator, decimal = best
    if score < NUMERIC / 2:
        raise DataError("no table of numbers with any separator: export it as CSV", file=file)
    rows = [cells(line, separator) for line in lines]
    width = Counter(len(row) for row in rows if row != [""]).most_common(1)[0][0]
    data = next(i for i, row in enumerate(rows) if len(row) == width and _number_share(row, decimal) >= NUMERIC / 2)
    above = rows[data - 1] if data else []
    form: dict[str, Any] = {"separator": separator, "decimal": decimal, "encoding": encoding}
    named = rows[data - 2] if data > 1 else []
    if len(above) == len(named) == width and not names and all(_UNIT.match(cell.lower()) for cell in above):
        form |= {"skip_rows": data, "names": [f"{name} [{unit}]" for name, unit in zip(named, above, strict=True)]}
    elif len(above) == width and not names:
        form["skip_rows"] = data - 1
    else:
        form["skip_rows"] = data
        form |= {"names": list(names)} if names else {"header": False}
    return form


def cells(line: str, separator: str) -> list[str]:
    """Split a line of text into cells."""
    return line.split() if separator == "whitespace" else [cell.strip().strip('"') for cell in line.split(separator)]


def _number_share(row: list[str], decimal: str) -> float:
    """Return the share of cells that are numbers; empty cells are not counted."""
    said = [
        cell.replace(",", ".") if decimal == "," else cell for cell in row if cell.lower() not in _WORDS_FOR_NOTHING
    ]
    return sum(map(_is_number, said)) / len(said) if said else 0.0


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _numbers(table: pd.DataFrame, decimal: str) -> tuple[dict[str, Array], list[str]]:
    """Return the columns that are mostly numbers, and the names of the columns of words."""
    columns: dict[str, Array] = {}
    words = []
    for index, name in enumerate(map(str, table.columns)):
        column = table.iloc[:, index]
        if not pd.api.types.is_numeric_dtype(column.dtype):
            text = column.astype(str).str.strip()
            column = pd.to_numeric(text.str.replace(",", ".") if decimal == "," else text, errors="coerce")
        values = column.to_numpy(dtype=np.float64, na_value=np.nan).copy()
        values[np.isinf(values)] = np.nan
        said = table.iloc[:, index].dropna().astype(str).str.strip()
        if np.isnan(values).all() and said.ne("").any():
            words.append(name)
        elif name not in columns:
            columns[name] = values
    return columns, words


def _clock(table: pd.DataFrame, columns: dict[str, Array], file: Path) -> tuple[dict[str, Any], Array]:
    """Return the clock, a column that rises: by its name if several do; a column of dates if no number rises."""
    rising = [name for name, values in columns.items() if np.isfinite(values).all() and np.all(np.diff(values) > 0)]
    called = [name for name in columns if CLOCK_WORDS.match(plain(name))]
    for name in [name for name in map(str, table.columns) if CLOCK_WORDS.match(plain(name)) and name not in columns]:
        since = seconds(table[name])
        if np.isfinite(since).all() and np.all(np.diff(since) > 0):
            return {"from": name, "unit": "date"}, since
        called.append(name)
    candidates = [name for name in rising if name in called] or [name for name in rising if not _counts(columns[name])]
    candidates = candidates or rising
    if not candidates:
        said = (
            f"{called[0]!r} {_fault(columns.get(called[0], np.empty(0)))}" if called else "none rises from row to row"
        )
        raise DataError(f"no column can be the clock: {said}", file=file)
    t: Array = columns[candidates[0]]
    name = plain(candidates[0])
    milliseconds = name.endswith("ms") or (np.median(np.diff(t)) >= 20 and not np.any(t % 1))
    return {"from": candidates[0], "unit": "ms" if milliseconds else "s"}, np.asarray(
        t * (1e-3 if milliseconds else 1.0), dtype=np.float64
    )


def _counts(values: Array) -> bool:
    """Whether a column only counts rows."""
    return bool(np.all(np.diff(values) == 1.0) and values[0] in (0.0, 1.0))


def _fault(values: Array) -> str:
    if not len(values):
        return "holds no numbers and no dates"
    if not np.isfinite(values).all():
        return f"has no value in row {int(np.argmax(~np.isfinite(values))) + 1}"
    row = int(np.argmax(np.diff(values) <= 0)) + 1
    return f"{'repeats' if values[row] == values[row - 1] else 'goes back'} in row {row + 1}"


def plain(name: str) -> str:
    """Return a name in lower case without its unit in brackets."""
    return re.sub(r"[\[(].*", "", name).strip().lower().replace(" ", "_").replace("-", "_")
