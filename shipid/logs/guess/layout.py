"""How an unknown log is written: kind of file, encoding, separator, decimal sign, marks of thousands, header."""

from __future__ import annotations

import codecs
import csv
import itertools
import re
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from shipid.errors import DataError
from shipid.logs.dates import DAY_OF, TIME_OF_DAY
from shipid.logs.foreign import foreign_format
from shipid.logs.formats import LOOKED_AT, SheetFormat
from shipid.logs.guess.clock import is_clock
from shipid.logs.guess.words import NO_VALUE, known_words, meaning_scores
from shipid.logs.importing import distinct_names
from shipid.logs.mapping import is_position
from shipid.logs.nmea import is_nmea
from shipid.logs.readers import READERS, grouped_number
from shipid.logs.workbook import SEPARATOR, check_width, sheet_text, sheets_with_values
from shipid.plugins import describe_error, is_user_code, log_warning

ELSEWHERE = ("cp932", "gb18030", "cp949", "cp1251")  # encodings of texts whose words no other one shows
SEPARATORS = (",", ";", "\t", "|", "whitespace")
GROUPS = (",", ".", "'", "’", " ", "\u00a0", "\u202f")  # marks of thousands
MARKS = ("#", "##", "%", "%%", "//")  # before a header that is written as a comment
MOST_HEADS = 3  # lines above the data: names in two, and units
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
NUMERIC = 0.8  # share of the cells of a line of data that are numbers
_UNIT = re.compile(
    r"[\[(]?(s|secs?|seconds|ms|us|ns|mins?|minutes|h|hrs?|hours?|d|days?|m|mm|cm|km|meters?|metres?|ft|deg(rees)?|°|grad|rad|m/s|mps|m\*s-1|kn|kts?|knots?|km/h|kmh|mph|cm/s|mm/s|"
    r"(deg|°|grad)/(s|sec|min)|dps|rad/s(ec)?|rpm|rps|1/(s|min)|u/min|min-1|s-1|hz|n|kn|nm|knm|kw|w|%|pct|percent|bar|v|a|°c|c|"
    r"l/h|kg/h|t|t/h|m/s2|m/s\^2|m/s²|-|utc|iso|\[-\]|)[\])]?$"
)


def guess_format(head: bytes, file: Path, names: tuple[str, ...]) -> dict[str, Any]:
    """Keys of [format] of a log by its first bytes; `names` are its columns if it is text without a header.

    Raises DataError where no reader reads it, or it is no table.
    """
    for kind, reader in READERS.load_all().items():
        try:
            form = reader.detect(file, head) if reader.detect else None
            if form is not None:
                return form | {"kind": kind} | ({"topics": list(names)} if reader.topics and names else {})
        except Exception as error:
            if not is_user_code(reader.read):
                raise
            log_warning(f"the reader {kind!r} is left out: {describe_error(error)}")
    other = foreign_format(head)
    if other is not None:
        raise DataError(other.sentence, file=file)
    encoding = _guess_encoding(head, file)
    text = head.decode(encoding, "ignore")
    if is_nmea(file, text.encode("latin-1", "replace")) is not None:
        raise DataError(f"NMEA 0183 in {encoding}: save it in utf-8", file=file)
    return _text_format(text.splitlines()[:LOOKED_AT], encoding, file, names)


def format_of_sheet(file: Path, names: tuple[str, ...]) -> tuple[dict[str, Any], str, tuple[str, ...]]:
    """Keys of [format] of a workbook, the lines of its largest sheet with a clock, and what is said of the others."""
    found = sheets_with_values(file)
    sheet, lines = found[0], sheet_text(file, found[0])
    for other in found[1:] if not _has_clock(lines) else ():
        text = sheet_text(file, other)
        if _has_clock(text):
            sheet, lines = other, text
            break
    others = [name for name in found if name != sheet]
    layout = _text_format(lines.splitlines()[:LOOKED_AT], "utf-8", file, names, (SEPARATOR,))
    keys = {key: value for key, value in layout.items() if key in SheetFormat.model_fields}
    notes = (f"of the workbook the sheet {sheet!r} is read, not {', '.join(map(repr, others))}",) if others else ()
    named = {"sheet": sheet} if others else {}  # each run of a folder may have a sheet of another name
    return {"kind": "sheet"} | named | keys, lines, notes


def _has_clock(lines: str) -> bool:
    first = lines.split("\n", LOOKED_AT)[:LOOKED_AT]
    return any(
        is_clock(cell)
        for line in first
        for cell in split_cells(line, SEPARATOR)
        if cell and not _NUMBER.fullmatch(cell)
    )


def _guess_encoding(head: bytes, file: Path) -> str:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in head:
        message = "a binary file of unknown format, or text with NUL bytes as after a power cut: export it as text"
        raise DataError(message, file=file)
    utf8 = "utf-8-sig" if head.startswith(b"\xef\xbb\xbf") else "utf-8"
    if _is_encoded(head, utf8):
        return utf8
    words = {one: known_words(head.decode(one, "ignore")) for one in ELSEWHERE}
    best = max(ELSEWHERE, key=lambda one: words[one])
    return best if words[best] > 1 else "cp1252" if _is_encoded(head, "cp1252") else "latin-1"


def _is_encoded(head: bytes, encoding: str) -> bool:
    """Whether the first bytes of a text are of an encoding; the last character may be cut."""
    with suppress(UnicodeDecodeError):
        codecs.getincrementaldecoder(encoding)().decode(head)
        return True
    return False


def _text_format(
    lines: list[str], encoding: str, file: Path, names: tuple[str, ...], separators: tuple[str, ...] = SEPARATORS
) -> dict[str, Any]:
    """The keys of [format] of a text, or of a sheet, by its first lines; the header is above the data."""
    for line, sign in itertools.product(lines, separators):
        check_width(len(line.split()) if sign == "whitespace" else line.count(sign) + 1, file)
    score, separator, decimal, mark = _guess_marks(lines, separators)
    if score < NUMERIC / 2:
        raise DataError(
            "no table of numbers with any separator: export it as CSV, a row for each time, no unit behind a number",
            file=file,
        )
    rows = [split_cells(line, separator) for line in lines]
    width = Counter(len(row) for row in rows if any(row)).most_common(1)[0][0]
    places = _places_of_numbers([row for row in rows if len(row) == width], decimal, mark)
    shares = [_number_share([row[k] for k in places if k < len(row)], decimal, mark) for row in rows]
    usual = float(np.median([share for row, share in zip(rows, shares, strict=True) if len(row) == width]))
    least = max(NUMERIC / 2, usual - 0.9 / width)  # a header may hold numbers, too, but fewer
    data = next(
        (i for i, row in enumerate(rows) if len(row) == width and shares[i] >= least),
        next(i for i, row in enumerate(rows) if len(row) == width and shares[i] >= NUMERIC / 2),
    )
    form: dict[str, Any] = {"separator": separator, "decimal": decimal, "encoding": encoding}
    form |= {"thousands": mark} if mark is not None else {}
    if names:
        return form | {"skip_rows": data, "names": list(names)}
    return form | _header_keys(lines, rows, data, width, separator)


def _header_keys(lines: list[str], rows: list[list[str]], data: int, width: int, separator: str) -> dict[str, Any]:
    """The keys of [format] that say the names of the columns, by the lines above that at which the data begin."""
    dated = _date_and_time(rows[data]) if separator == "whitespace" else None
    above = [i for i in range(data - 1, -1, -1) if any(rows[i])][:MOST_HEADS]
    heads = {i: cells for i in above if (cells := _fit_header(lines[i], rows[i], width, separator, dated))}
    called, first = _header_above([*heads.values()]), next(iter(heads), None)
    if not called and first is not None and first == above[0]:
        if heads[first] == [*rows[first], ""][:width]:
            return {"skip_rows": first}
        called = heads[first]
    if called:
        return {
            "skip_rows": data,
            "names": distinct_names(name or f"column {place}" for place, name in enumerate(called, start=1)),
        }
    return {"skip_rows": data, "header": False}


def _fit_header(line: str, row: list[str], width: int, separator: str, dated: int | None) -> list[str]:
    """The cells of a line above the data, as many as its columns; none where it cannot have a name for each.

    A mark of a comment is left out, blanks before units are of the name, and a date gets one (`dated`: its column).
    """
    words = line.split()
    marked = bool(words) and words[0] in MARKS
    ways = [row[1:]] if marked and row[0] in MARKS else []
    ways += [words[1:]] if marked and len(words) == width + 1 and row[0] not in MARKS else []  # as NumPy writes it
    ways.append(row)
    if separator == "whitespace":
        ways.append(split_cells(re.sub(r"\s+(?=[\[(])", "", line), separator)[marked:])
    if dated is not None:
        ways.append([*row[:dated], "" if _is_units(row) else "date", *row[dated:]])
    fitting = sorted((way for way in ways if width - 1 <= len(way) <= width), key=len, reverse=True)
    return [*fitting[0], ""][:width] if fitting else []


def _guess_marks(lines: list[str], separators: tuple[str, ...]) -> tuple[float, str, str, str | None]:
    """Share of numbers, separator, decimal sign, mark of thousands that give most numbers in lines of equal length."""
    best: tuple[float, str, str, str | None] = (0.0, "", "", None)
    alike = 0  # lines of one length with the best
    quoted = any('"' in line for line in lines)  # between quotes a decimal comma separates nothing
    for separator in separators:
        rows = [split_cells(line, separator) for line in lines if line.strip()]
        width, count = Counter(len(row) for row in rows).most_common(1)[0]
        if separator == "whitespace" and best[1] == "\t" and best[0] >= NUMERIC / 2 and count < alike:
            continue  # the header, too, has as many cells between tabs as the data: blanks are in cells
        for decimal in (".", ",") if separator != "," or quoted else (".",):
            mark = _thousands_mark(rows, decimal)
            share = float(np.mean([_number_share(row, decimal, mark) for row in rows if len(row) == width]))
            score = share * count / len(rows) * (width > 1) * (1 + width / 1000)
            score *= 0.97 if separator == "whitespace" else 1.0  # names may have blanks
            if score > best[0]:  # the first of equals: tabs are blanks, too
                best, alike = (score, separator, decimal, mark), count
    return best


def _header_above(heads: list[list[str]]) -> list[str]:
    """The names that lines above the data give the columns, the nearest first; none where that one has all."""
    units = next((row for row in heads if _is_units(row)), None) if len(heads) > 1 else None
    lines = [row for row in heads if row is not units][:2]
    if not lines:
        return []
    ways = list(lines)
    if len(lines) == 2:
        group = ""
        upper = [group := cell or group for cell in lines[1]]
        ways.append([" ".join(filter(None, pair)) for pair in zip(upper, lines[0], strict=True)])
    sense = [_header_meaning(way) for way in ways]
    best = ways[int(np.argmax(sense))] if max(sense) > sense[0] + 0.5 else ways[0]
    if len(ways) == 3 and len({*ways[2]}) == len(ways[2]):  # Wind and Wind over Speed and Direction
        twice = {name for name, count in Counter(best).items() if count > 1}
        best = [both if name in twice else name for name, both in zip(best, ways[2], strict=True)] if twice else best
    if best is heads[0] and units is None:
        return []
    pairs = zip(best, units or [""] * len(best), strict=True)
    named = [f"{name} [{unit.strip('[]()')}]" if unit else name for name, unit in pairs]
    while named and not named[-1]:
        named.pop()
    return named


def _header_meaning(names: list[str]) -> float:
    known = {name for name in names if name}
    return sum(
        1.0 if is_clock(name) else max([0.0, *(meaning_scores(name)[one] for one in meaning_scores(name) if one)])
        for name in known
    )


def _date_and_time(row: list[str]) -> int | None:
    pairs = enumerate(itertools.pairwise(row))
    return next(
        (k for k, (one, other) in pairs if re.fullmatch(DAY_OF, one) and re.fullmatch(TIME_OF_DAY, other)), None
    )


def _is_units(row: list[str]) -> bool:
    words = [cell.lower() for cell in row if cell]
    fitting = sum(bool(_UNIT.match(cell)) for cell in words)
    return len(words) >= 2 and fitting >= 0.7 * len(words)


def split_cells(line: str, separator: str) -> list[str]:
    """Split a line of text into cells; a separator between quotes is part of a cell."""
    if separator == "whitespace":
        return line.split()
    row = line.split(separator)
    with suppress(csv.Error):  # a cell that is too long
        row = next(csv.reader([line], delimiter=separator, skipinitialspace=True), row)
    return [cell.strip().strip('"') for cell in row]


def _thousands_mark(rows: list[list[str]], decimal: str) -> str | None:
    """The mark of thousands in the cells of lines, where all cells with that mark are numbers in groups."""
    held = {cell for row in rows for cell in row if re.fullmatch(r"[+-]?\d[\d.,'’ \u00a0\u202f]*", cell)}
    held = {cell for cell in held if not re.fullmatch(DAY_OF, cell)}
    whole = any(re.fullmatch(rf"[+-]?\d+{re.escape(decimal)}(\d{{1,2}}|\d{{4,}})", cell) for cell in held)
    for mark in GROUPS:
        cells = [cell for cell in held if mark in cell]
        if mark == decimal or not cells or not all(re.fullmatch(grouped_number(decimal, mark), cell) for cell in cells):
            continue
        if mark not in ".," or whole or any(decimal in cell or cell.count(mark) > 1 for cell in cells):
            return mark
    return None


def _places_of_numbers(rows: list[list[str]], decimal: str, thousands: str | None) -> list[int]:
    """Places of a line's cells that hold numbers in most lines where they hold anything; all where none do."""
    columns = enumerate(zip(*rows, strict=True))
    return [place for place, one in columns if _number_share(one, decimal, thousands) > 0.5] or [*range(len(rows[0]))]


def _number_share(row: Iterable[str], decimal: str, thousands: str | None = None) -> float:
    cells = [cell for cell in row if not NO_VALUE.fullmatch(cell.lower())]
    grouped = re.compile(grouped_number(decimal, thousands)) if thousands is not None else None
    cells = [cell.replace(str(thousands), "") if grouped and grouped.fullmatch(cell) else cell for cell in cells]
    cells = [cell.replace(",", ".") if decimal == "," else cell for cell in cells]
    known = [bool(_NUMBER.fullmatch(cell)) or is_position(cell) for cell in cells]
    return sum(known) / len(known) if known else 0.0
