"""Read an unknown log: recognise its format, and return its columns as numbers."""

from __future__ import annotations

import csv
import io
import itertools
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.dates import (
    DAY,
    DAY_OF,
    HALF_DAY,
    HOUR,
    NEXT_DAY,
    TIME_OF_DAY,
    date_of,
    date_texts,
    dated,
    days_by,
    hour_twice,
    in_one_number,
    moment_of,
    seconds,
    time_texts,
    ways_of,
)
from shipid.logs.foreign import foreign
from shipid.logs.formats import LOOKED_AT, SheetFormat, TableFormat, TextFormat
from shipid.logs.guess.words import fits, is_run, known_words, parts_of, units_in
from shipid.logs.importing import OFF_ONE, even_clock, repeated_rows, rounding_of
from shipid.logs.mapping import (
    AGAIN,
    EPOCHS,
    SIDES,
    clock_seconds,
    degrees_in_parts,
    degrees_in_text,
    names_of,
    since_midnight,
    size_of,
    to_si,
    yaw_of,
)
from shipid.logs.readers import (
    LONGEST_LINE,
    READERS,
    grouped_by,
    in_points,
    parse_text,
    read_table,
    require_file,
    widest,
)
from shipid.logs.workbook import NOT_CALCULATED, SEPARATOR, sheet_text, sheets_of

Rows = NDArray[np.bool_]
SAMPLE, BLOCK, BLOCKS = 12_000_000, 600_000, 10  # bytes: a longer text is looked at in its head and that many blocks
LONG = 1e4  # rows between two runs that have a clock each
ELSEWHERE = ("cp932", "gb18030", "cp949", "cp1251")  # encodings of texts whose words no other one shows
SEPARATORS = (",", ";", "\t", "|", "whitespace")
GROUPS = (",", ".", "'", "’", " ", "\u00a0", "\u202f")  # marks of thousands
MARKS = ("#", "##", "%", "%%", "//")  # before a header that is written as a comment
SENTINELS = tuple(
    sign * value
    for value in (
        *(99.0, 999.0, 9999.0, 99999.0, 999999.0, 9999999.0, 99999999.0, 999.9, 9999.9, 999.25),
        *(3276.7, 3276.8, 6553.5, 327.67, 327.68, 655.35, 32767.0, 32768.0, 65535.0),  # of 16 bits, as such or scaled
        *(2147483647.0, 2147483648.0, 4294967295.0),  # of 32 bits
        *(1e20, 1e30, 9.96921e36, 9.969209968386869e36),  # netCDF
    )
    for sign in (-1, 1)
)
NOT_AVAILABLE = {"psi": (511.0, 360.0), "speed": (102.3, 51.0), "latitude": (91.0, 90.0), "longitude": (181.0, 180.0)}
"""Meaning -> number [deg, kn] that AIS writes for none (ITU-R M.1371), and the largest of the others."""
VISITS, SELDOM = 3, 0.3  # rows at which a number for no value begins, at least; share of the rows, at most
BEYOND, LEVELS, BEYOND_LEVELS = 4.0, 20, 50.0  # times the largest other; of one that has so few values, an order, more
LONG_WIDTH = 8  # cells, at most, of a row with one value: time, name, value, unit, quality and the like
MOST_HEADS = 3  # lines above the data: names in two, and units
FEWEST_TIMES = 10  # of a second clock that are compared with the first
APART, OFF = 10, 0.02  # steps of the first clock, and share of its span, by which a second one may go otherwise
LOST = 0.1  # share of the rows that may be lost at a rate, at most; a pause loses none
REPEATED = 0.05  # share of the rows that may repeat the row before, at most
WIDE = 0.9  # share of every second byte that is 0, in text of two bytes a character
NUMERIC = 0.8  # share of the cells of a line of data that are numbers
CLOCK_WORDS = frozenset(
    (
        "t tvec time timestamp stamp clock sec secs seconds date datetime utc ms zeit messzeit zeitstempel "
        "tid tidspunkt sekunden millis epoch zulu hora temps heure elapsed stempel mess uhrzeit klokke tiempo "
        "gmt datenum tow itow sow sod ticks filetime mjd jd julian"
    ).split()
)
WRITTEN = {
    "ns": "ns nsec nanos nanosec nanoseconds",
    "us": "us usec micros microsec microseconds",
    "ms": "ms msec millis millisec milliseconds",
    "s": "s sec secs second seconds sekunden",
    "min": "min mins minute minutes minuten",
    "h": "h hr hrs hour hours stunden",
    "d": "d day days tage",
}
"""Unit of a clock -> words for it, in brackets or at the end of a name."""
FIELDS = {
    "year": ("year yr yyyy yy jahr annee anno ano jaar aar ar", 0.0, 2100.0),
    "month": ("month mon mo mm m monat mois mese mes maand maaned manad", 1.0, 12.0),
    "day": ("day dd d dom tag jour giorno dia dag", 1.0, 31.0),
    "day of the year": ("doy yday jday", 1.0, 366.0),
    "hour": ("hour hours hr hh h stunde heure ora hora uur timme", 0.0, 23.0),
    "minute": ("minute minutes min mm m mi minuto minuut minutt", 0.0, 59.0),
    "second": ("second seconds sec ss s sekunde seconde secondo segundo sekund sek", 0.0, 60.0),
}
"""Field of a date or time in columns -> words for it, and its least and largest number."""
YEARS = 1990.0, 2050.0  # of a log
OF_YEARS = "is a year with decimals, {:.12g}: write a date, 2024-05-14 08:00:00, or seconds"
MINUTES = frozenset("min minute minutes m mm ' sec second seconds s ss".split()) | {'"'}
FINE = {"ns": (1e17, 1e8), "us": (1e14, 1e5)}
"""Unit of a clock -> least number that counts from 1970 in it, and least step of whole numbers: 0.1 s."""
DATES = {unit: (epoch + 7305.0, epoch + 29220.0) for unit, epoch in {**EPOCHS, "d": 0.0}.items()}
"""Unit of a clock in days -> its numbers of 1990 and 2050, `d` since 1970. Those of Excel from 2031 and
modified Julian dates to 2008 are the same numbers."""
TICKS = {11_644_473_600: "1601, as Windows does", 62_135_596_800: "the year 1, as .NET does"}
"""Seconds from the begin of a clock of ticks of 100 ns to 1970 -> who counts so."""
COUNTERS, LONG_STEP = (2**16, 2**32), 10.0  # numbers of a counter; usual steps that lie over its end, at most
SHORT_YEAR = 2e-6  # years, a minute: no clock of a ship has steps of as many seconds, or hours, without a unit
SHORT_DAY = 1e-3  # d, 86 s: rows of a log are closer; in seconds no log of a ship has a thousand rows in one
NO_CLOCK_WORDS = frozenset(["delay", "constant", "zone", "diff", "delta", "step"])
SHIPS, UNKNOWN = ("mmsi", "userid", "imo", "imonumber", "callsign"), ("0", "unknown")
"""Names of columns that say the ship, in small letters alone, the surest first; what they hold for an unknown one."""
_UNIT = re.compile(
    r"[\[(]?(s|secs?|seconds|ms|us|ns|mins?|minutes|h|hrs?|hours?|d|days?|m|mm|cm|km|meters?|metres?|ft|deg(rees)?|°|grad|rad|m/s|mps|m\*s-1|kn|kts?|knots?|km/h|kmh|mph|cm/s|mm/s|"
    r"(deg|°|grad)/(s|sec|min)|dps|rad/s(ec)?|rpm|rps|1/(s|min)|u/min|min-1|s-1|hz|n|kn|nm|knm|kw|w|%|pct|percent|bar|v|a|°c|c|"
    r"l/h|kg/h|t|t/h|m/s2|m/s\^2|m/s²|-|utc|iso|\[-\]|)[\])]?$"
)
_NOTHING = re.compile(
    r"[-–—*.?_/# ]*|#?n[/.]?a\.?|null|none|nil|-?nan(\(ind\))?|[+-]?inf(inity)?|-?1\.#(ind|q?nan|inf)\d*|no ?data|"
    r"missing"
)
"""What logs write in a cell without a value, in lower case."""


@dataclass(frozen=True)
class Sniffed:
    """An unknown log as numbers: how it is written, its clock and all other columns, NaN where a value is missing.

    `form` holds the keys of [format] and `clock` those of [clock]; `t` [s] rises; `notes` are sentences on columns
    that were left out. `seams` counts the places where rows of a large log were not read, or runs begin. `runs` has the
    column that says the run, and the number of runs, where the clock begins again with each; `t` goes on then. `sides`
    are the letters, N, S, E or W, that columns beside positions hold. `words` are columns of words, with their first.
    `doubts` are questions on what the dates of the clock mean. `in_parts` are columns made of several, with those.
    """

    form: dict[str, Any]
    clock: dict[str, Any]
    t: Array
    columns: dict[str, Array]
    notes: tuple[str, ...]
    seams: int = 0
    runs: dict[str, int] = field(default_factory=dict)
    sides: frozenset[str] = frozenset()
    words: dict[str, str] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()
    in_parts: dict[str, tuple[str, ...]] = field(default_factory=dict)

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
    size = require_file(file)
    try:
        with file.open("rb") as stream:
            head = stream.read(LONGEST_LINE)
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", file=file) from None
    if not head[:200_000].strip():
        raise DataError("the file is empty", file=file)
    form = _format(head[:200_000], file, names)
    notes: tuple[str, ...] = ()
    sampled = False
    if form.get("kind") == "sheet":
        form, lines, notes = _sheet(file, names)
    model = READERS[form.get("kind", "text")].options.model_validate(form)
    if isinstance(model, TextFormat):
        widest(head, model.separator, file)
        sampled = size > SAMPLE
        lines = _sample(file, model.encoding, size)
    if isinstance(model, TableFormat):
        table = parse_text(io.StringIO(lines), model.text().model_copy(update={"ragged": "drop"}), file)
        if sampled:
            notes = (f"{len(table)} rows from {BLOCKS + 1} places of {size / 1e6:.0f} MB were looked at",)
        ragged = table.attrs["ragged"]
        if ragged and not sampled:
            form["ragged"] = "drop"
            count = "1 line repeats" if len(ragged) == 1 else f"{len(ragged)} lines repeat"
            have = "has" if len(ragged) == 1 else "have"
            first = f"{count} the header or {have} another number of cells, the first is line {ragged[0]}"
            notes = (*notes, f"{first}: left out")
        if len(table) < 2:
            raise DataError(f"a header and {len(table)} rows: a log needs two rows or more", file=file)
    else:
        table = read_table(file, model, "time")
        notes = tuple(f"{name!r} is {table.attrs['other'][name]}" for name in table.attrs.get("to save anew", ()))
    _refuse_ships(table, file)
    columns, words = _numbers(table, form.get("decimal", "."), form.get("thousands"))
    in_parts = _degrees(columns)
    turned = _quaternions(columns)
    rarely = [name for name, values in columns.items() if np.isnan(values).mean() > 0.5]
    in_text, letters = _in_text(table, [*words, *rarely], form.get("decimal", "."))
    columns |= dict(in_text.values())
    notes += (f"{form['thousands']!r} is read as a mark of thousands",) if "thousands" in form else ()
    if isinstance(model, TableFormat):
        missing = [*_words_for_nothing(table, columns, model), *_sentinels(table, columns)]
        if missing:
            form["missing"] = [*model.missing, *missing]
            notes += (f"{', '.join(map(repr, missing))} stand{'s' * (len(missing) == 1)} for a value that is missing",)
    made = {name: degrees_in_parts([columns[part] for part in parts]) for name, parts in in_parts.items()}
    made |= {name: yaw_of([columns[part] for part in parts]) for name, parts in turned.items()}
    made |= {name: values for name, (source, values) in in_text.items() if name != source}
    in_parts |= turned
    in_parts |= {name: (in_text[name][0],) for name in made.keys() & in_text.keys()}
    words = [name for name in words if name not in columns]
    runs, since = _restarts(table, columns)
    clock, t, once = _clock_once(table, columns if since is None else columns | since, file)
    columns = {name: values[once] for name, values in (columns | made).items()}
    named = {one for key in ("from", "date") if key in clock for one in names_of(clock[key])}
    named |= {part for parts in in_parts.values() for part in parts}
    texts = {name: _called(table, name).dropna().astype(str).str.strip() for name in words}
    says = {name: next(filter(None, column), "") for name, column in texts.items()}
    notes += tuple(
        f"column {name!r} holds words, not numbers{_as_number(name, says[name])}"
        for name in words
        if name and name not in named
    )
    constant = [name for name, values in columns.items() if np.isnan(values).all()]
    kept = {name: values for name, values in columns.items() if name not in {*named, *constant}}
    empty = tuple(f"column {name!r} is empty" for name in constant if name)
    form.pop("ragged", None) if form.get("ragged") == "refuse" else None
    if not once.all():
        notes += ("rows that repeat the row before are left out",)
    kept = {name: values for name, values in kept.items() if name not in runs}
    seams = BLOCKS if sampled else sum(runs.values()) - len(runs)
    doubts = tuple(_doubts(table.loc[once], clock, t))
    doubts += tuple(_minus_ones(columns))
    doubts += () if runs else tuple(_other_clocks(table.loc[once], columns, clock, t))
    return Sniffed(
        form, clock, t, kept, notes + empty, seams, runs, letters | _sides(table, words), says, doubts, in_parts
    )


def _as_number(name: str, text: str) -> str:
    """What to do with a column of words whose name says a quantity and whose texts have a number, such as P12.5."""
    if text.startswith("="):
        return f": {text[:40]!r} is {NOT_CALCULATED}"
    quantity = any(meaning and score > 0.6 for meaning, score in fits(name).items())
    remedy = f", such as {text[:40]!r}: write it as a number with a sign"
    return remedy if quantity and re.search(r"\d", text) else ""


def _sample(file: Path, encoding: str, size: int) -> str:
    """Return the text of a log; of a large one its head, and whole lines from places spread over it."""
    with file.open("rb") as stream:
        if size <= SAMPLE:
            return stream.read().decode(encoding, "replace")
        text = stream.read(4 * BLOCK).decode(encoding, "ignore").rpartition("\n")[0]
        wide = encoding.startswith("utf-16")
        stream.seek(0)
        order = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}.get(stream.read(2), encoding) if wide else encoding
        for index in range(1, BLOCKS + 1):
            start = 4 * BLOCK + (size - 5 * BLOCK) * index // BLOCKS
            stream.seek(start - start % 4)
            block = stream.read(BLOCK).decode(order, "ignore")
            text += "\n" + block.partition("\n")[2].rpartition("\n")[0]
        return text


def _format(head: bytes, file: Path, names: tuple[str, ...]) -> dict[str, Any]:
    other = foreign(head)
    if other is not None:
        raise DataError(other.sentence, file=file)
    for reader in READERS.values():
        form = reader.detect(file, head) if reader.detect else None
        if form is not None:
            return form
    encoding = _encoding(head, file)
    return _text_format(head.decode(encoding, "ignore").splitlines()[:LOOKED_AT], encoding, file, names)


def _sheet(file: Path, names: tuple[str, ...]) -> tuple[dict[str, Any], str, tuple[str, ...]]:
    """Keys of [format] of a workbook, the lines of its largest sheet with a clock, and what is said of the others."""
    found = sheets_of(file)
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
    """Whether one of the first lines of a sheet has the name of a clock in a cell."""
    first = lines.split("\n", LOOKED_AT)[:LOOKED_AT]
    return any(is_clock(cell) for line in first for cell in cells(line, SEPARATOR) if cell and not _is_number(cell))


def _encoding(head: bytes, file: Path) -> str:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    for order, zeros, others in (("utf-16-le", head[1::2], head[::2]), ("utf-16-be", head[::2], head[1::2])):
        if zeros.count(b"\0") > WIDE * len(zeros) and b"\0" not in others:  # without the mark of its order
            return order
    if b"\0" in head:
        raise DataError("a binary file of unknown format: export it as text, Parquet, .mat or NMEA", file=file)
    begin = head[:-4] if len(head) > 4 else head  # the last character may be cut
    utf8 = "utf-8-sig" if head.startswith(b"\xef\xbb\xbf") else "utf-8"
    with suppress(UnicodeDecodeError):
        begin.decode(utf8)
        return utf8
    words = {one: known_words(begin.decode(one, "ignore")) for one in ELSEWHERE}
    best = max(ELSEWHERE, key=lambda one: words[one])
    if words[best] > 1:
        return best
    with suppress(UnicodeDecodeError):
        begin.decode("cp1252")
        return "cp1252"
    return "latin-1"


def _text_format(
    lines: list[str], encoding: str, file: Path, names: tuple[str, ...], separators: tuple[str, ...] = SEPARATORS
) -> dict[str, Any]:
    """Return the keys of [format] of a text, or of a sheet, by its first lines; the header is above the data."""
    score, separator, decimal, mark = _marks(lines, separators)
    _refuse_long([cells(line, separator) for line in lines if line.strip()] if separator else [], file)
    if score < NUMERIC / 2:
        raise DataError("no table of numbers with any separator: export it as CSV", file=file)
    rows = [cells(line, separator) for line in lines]
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
    words = {i: line.split() for i, line in enumerate(lines[:data])}
    marked = [i for i, some in words.items() if some and some[0] in MARKS]  # a header as a comment, as NumPy writes it
    for i in marked:
        blanks = len(words[i]) == width + 1 and rows[i][0] not in MARKS  # between names, and not between numbers
        rows[i] = words[i][1:] if blanks else rows[i][rows[i][0] in MARKS :]
    above = [i for i in range(data - 1, -1, -1) if any(rows[i])][:MOST_HEADS]
    if above and separator == "whitespace" and len(rows[above[0]]) > width:
        joined = cells(re.sub(r"\s+(?=[\[(])", "", lines[above[0]]), separator)[above[0] in marked :]
        if len(joined) == width:  # blanks before units
            return form | {"skip_rows": data, "names": _distinct(joined)}
    heads = [i for i in above if width - 1 <= len(rows[i]) <= width]
    dated_at = _date_and_time(rows[data]) if separator == "whitespace" else None
    if dated_at is not None and heads and len(rows[heads[0]]) == width - 1:  # one name for date and time
        wide = [[*rows[i][:dated_at], "date", *rows[i][dated_at:]] for i in heads if len(rows[i]) == width - 1]
        if len(wide) > 1 and _is_units(rows[heads[0]]):
            pairs = zip(wide[1], ["" if k == dated_at else unit for k, unit in enumerate(wide[0])], strict=True)
            return form | {"skip_rows": data, "names": _distinct([_with_unit(*pair) for pair in pairs])}
        return form | {"skip_rows": data, "names": _distinct(wide[0])}
    called = _called_in([[*rows[i], ""][:width] for i in heads])
    if called:
        return form | {"skip_rows": data, "names": _distinct(called)}
    if heads and heads[0] == above[0] and heads[0] in marked and rows[heads[0]] != cells(lines[heads[0]], separator):
        return form | {"skip_rows": data, "names": _distinct([*rows[heads[0]], ""][:width])}
    if heads and heads[0] == above[0]:
        return form | {"skip_rows": heads[0]}
    longer = [i for i in range(data) if len(rows[i]) > width and all(rows[i][:width]) and not shares[i]]
    if longer and not heads:  # a table beside the log ends above this line
        beside = [""] * (max(len(row) for row in rows[longer[-1] + 1 :]) - width)
        return form | {"skip_rows": longer[-1] + 1, "names": [*_distinct(rows[longer[-1]][:width]), *beside]}
    return form | {"skip_rows": data, "header": False}


def _marks(lines: list[str], separators: tuple[str, ...]) -> tuple[float, str, str, str | None]:
    """Return the separator, decimal sign and mark of thousands that give most numbers in lines of equal length.

    Before them stands their share of numbers, less for lines of another length; 0 where there are none.
    """
    best: tuple[float, str, str, str | None] = (0.0, "", "", None)
    quoted = any('"' in line for line in lines)  # between quotes a decimal comma separates nothing
    for separator in separators:
        rows = [cells(line, separator) for line in lines if line.strip()]
        width, count = Counter(len(row) for row in rows).most_common(1)[0]
        for decimal in (".", ",") if separator != "," or quoted else (".",):
            mark = _thousands(rows, decimal)
            share = float(np.mean([_number_share(row, decimal, mark) for row in rows if len(row) == width]))
            score = share * count / len(rows) * (width > 1) * (1 + width / 1000)
            score *= 0.97 if separator == "whitespace" else 1.0  # names may have blanks
            if score > best[0]:  # the first of equals: tabs are blanks, too
                best = (score, separator, decimal, mark)
    return best


def _refuse_long(rows: list[list[str]], file: Path) -> None:
    """Raise DataError where a row has one value, and a cell that says of what, as historians write."""
    width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    held = [row for row in rows if len(row) == width][1:]
    for place in range(width if 3 <= width <= LONG_WIDTH else 0):
        column = [row[place] for row in held]
        quantities = {next(filter(None, fits(cell)), "") for cell in {*column}} - {""}
        if any(map(_is_number, column)) or len(quantities) < 3 or len({*column}) > len(column) / 2:
            continue
        if np.mean([one != other for one, other in itertools.pairwise(column)]) > 0.5:  # the tags take turns
            first = ", ".join(map(repr, list(dict.fromkeys(column))[:3]))
            message = f"a row for each value, called {first} and so on: write a row for each time, a column for each"
            how = "such as with pandas: pivot_table(index=..., columns=..., values=...)"
            raise DataError(f"{message}, {how}", file=file)


def _refuse_ships(table: pd.DataFrame, file: Path) -> None:
    """Raise DataError where a log holds several ships, as columns of AIS name them: the surest of these decides."""
    names = {re.sub(r"[^a-z]", "", name.lower()): name for name in reversed([*map(str, table.columns)])}
    name = next((names[one] for one in SHIPS if one in names), None)
    if name is None:
        return
    texts = _called(table, name).dropna().astype(str).str.strip()
    ships = [one for one in texts.unique() if not _NOTHING.fullmatch(one.lower()) and one.lower() not in UNKNOWN]
    if len(ships) > 1:
        first = ", ".join(ships[:3])
        message = f"holds {len(ships)} ships ({name!r} is {first}{', ...' if len(ships) > 3 else ''})"
        raise DataError(f"{message}: write the rows of each ship to a separate log", file=file)


def _called_in(heads: list[list[str]]) -> list[str]:
    """Return the names that lines above the data give the columns, the nearest line first; none where that one has all.

    A line of units goes behind the names. Of two others the line is taken that names most quantities, or both: the
    upper one has groups, such as GPS, over the first of their columns.
    """
    units = next((row for row in heads if _is_units(row)), None) if len(heads) > 1 else None
    lines = [row for row in heads if row is not units][:2]
    if not lines:
        return []
    ways = list(lines)
    if len(lines) == 2:
        group = ""
        upper = [group := cell or group for cell in lines[1]]
        ways.append([" ".join(filter(None, pair)) for pair in zip(upper, lines[0], strict=True)])
    sense = [_sense(way) for way in ways]
    best = ways[int(np.argmax(sense))] if max(sense) > sense[0] + 0.5 else ways[0]
    if len(ways) == 3 and len({*ways[2]}) == len(ways[2]):  # Wind and Wind over Speed and Direction
        twice = {name for name, count in Counter(best).items() if count > 1}
        best = [both if name in twice else name for name, both in zip(best, ways[2], strict=True)] if twice else best
    if best is heads[0] and units is None:
        return []
    named = [_with_unit(*pair) for pair in zip(best, units or [""] * len(best), strict=True)]
    while named and not named[-1]:
        named.pop()
    return named


def _sense(names: list[str]) -> float:
    """How much the names of columns say: the sum of how well they fit a quantity, or a clock."""
    known = {name for name in names if name}
    return sum(1.0 if is_clock(name) else max([0.0, *(fits(name)[one] for one in fits(name) if one)]) for name in known)


def _with_unit(name: str, unit: str) -> str:
    """Return a name with its unit in brackets."""
    return f"{name} [{unit.strip('[]()')}]" if unit else name


def _date_and_time(row: list[str]) -> int | None:
    """Return the index of a cell that is a date before a time of day; None where there is none."""
    pairs = enumerate(itertools.pairwise(row))
    return next(
        (k for k, (one, other) in pairs if re.fullmatch(DAY_OF, one) and re.fullmatch(TIME_OF_DAY, other)), None
    )


def _distinct(names: list[str]) -> list[str]:
    """Return the names with a number added to those that are there already or empty."""
    result: list[str] = []
    for index, name in enumerate(names):
        known = name or f"column {index + 1}"
        while known in result:
            known += " (2)"
        result.append(known)
    return result


def _is_units(row: list[str]) -> bool:
    """Whether the cells of a line are units."""
    words = [cell.lower() for cell in row if cell]
    fitting = sum(bool(_UNIT.match(cell)) for cell in words)
    return len(words) >= 2 and fitting >= 0.7 * len(words)


def cells(line: str, separator: str) -> list[str]:
    """Split a line of text into cells; a separator between quotes is part of a cell."""
    if separator == "whitespace":
        return line.split()
    row = line.split(separator)
    if '"' in line:
        with suppress(csv.Error):  # a line with a NUL
            row = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    return [cell.strip().strip('"') for cell in row]


def _thousands(rows: list[list[str]], decimal: str) -> str | None:
    """Return the mark of thousands in the cells of lines, where all cells with that mark are numbers in groups.

    1,800 alone may be 1.8: it is 1800 where another number has a decimal point.
    """
    held = {cell for row in rows for cell in row if re.fullmatch(r"[+-]?\d[\d.,'’ \u00a0\u202f]*", cell)}
    whole = any(re.fullmatch(rf"[+-]?\d+{re.escape(decimal)}(\d{{1,2}}|\d{{4,}})", cell) for cell in held)
    for mark in GROUPS:
        cells = [cell for cell in held if mark in cell]
        if mark == decimal or not cells or not all(re.fullmatch(grouped_by(decimal, mark), cell) for cell in cells):
            continue
        if mark not in ".," or whole or any(decimal in cell or cell.count(mark) > 1 for cell in cells):
            return mark
    return None


def _places_of_numbers(rows: list[list[str]], decimal: str, thousands: str | None) -> list[int]:
    """Places of a line's cells that hold numbers in most lines where they hold anything; all where none do.

    Words beside the first lines, such as the weather, are in other cells.
    """
    found = []
    for place in range(len(rows[0])):
        column = [row[place] for row in rows]
        if _number_share(column, decimal, thousands) > 0.5:
            found.append(place)
    return found or [*range(len(rows[0]))]


def _number_share(row: list[str], decimal: str, thousands: str | None = None) -> float:
    """Return the share of cells that are numbers; empty cells are not counted."""
    cells = [cell for cell in row if not _NOTHING.fullmatch(cell.lower())]
    grouped = re.compile(grouped_by(decimal, thousands)) if thousands is not None else None
    cells = [cell.replace(str(thousands), "") if grouped and grouped.fullmatch(cell) else cell for cell in cells]
    cells = [cell.replace(",", ".") if decimal == "," else cell for cell in cells]
    return sum(map(_is_number, cells)) / len(cells) if cells else 0.0


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _numbers(table: pd.DataFrame, decimal: str, thousands: str | None) -> tuple[dict[str, Array], list[str]]:
    """Return the columns that are mostly numbers, and the names of the columns of words."""
    columns: dict[str, Array] = {}
    words = []
    for index, name in enumerate(map(str, table.columns)):
        column = table.iloc[:, index]
        if pd.api.types.is_bool_dtype(column.dtype):
            words.append(name)
            continue
        if not pd.api.types.is_numeric_dtype(column.dtype):
            text = in_points(column.astype(str).str.strip(), decimal, thousands)
            column = pd.to_numeric(text, errors="coerce")
        values = column.to_numpy(dtype=np.float64, na_value=np.nan).copy()
        values[np.isinf(values)] = np.nan
        if np.isnan(values).any() and is_run(name):  # names of runs, as numbers
            values = pd.factorize(table.iloc[:, index].ffill().bfill())[0].astype(np.float64)
        lost = np.isnan(values)
        texts = table.iloc[:, index][lost].dropna().astype(str).str.strip() if lost.any() else pd.Series(dtype=str)
        said = sum(count for text, count in texts.value_counts().items() if not _NOTHING.fullmatch(str(text).lower()))
        if (lost.all() and texts.ne("").any()) or said > len(values) - lost.sum():
            words.append(name)
        elif name and name not in columns:
            columns[name] = values
    return columns, words


def _degrees(columns: dict[str, Array]) -> dict[str, tuple[str, ...]]:
    """Latitudes and longitudes in columns of whole degrees, minutes and perhaps seconds, by the names of all."""
    found: dict[str, tuple[str, ...]] = {}
    names = list(columns)
    for place, name in enumerate(names[:-1]):
        meant = next((one for one in ("latitude", "longitude") if fits(name).get(one, 0.0) > 0.5), None)
        if meant is None or any(name in parts for parts in found.values()) or not _is_whole(columns[name], 180.0):
            continue
        parts = [name]
        for other in names[place + 1 : place + 3]:
            last = parts_of(other)[-1:] + tuple(units_in(other))
            of_angle = meant in fits(other) or bool(MINUTES & {*last})
            if not of_angle or (meant != "longitude" and "longitude" in fits(other)):
                break
            if not np.nanmax(np.abs(columns[other]), initial=0.0) < 60.0:
                break
            parts.append(other)
            if not _is_whole(columns[other], 60.0):
                break
        if len(parts) > 1 and not _is_whole(columns[parts[-1]], 60.0):
            found[" + ".join(parts)] = tuple(parts)
    return found


def _quaternions(columns: dict[str, Array]) -> dict[str, tuple[str, ...]]:
    """Yaw angle -> columns x, y, z, w of a quaternion: names that differ by these letters alone, and its size is 1."""
    found: dict[str, tuple[str, ...]] = {}
    for name in columns:
        place = name.lower().rfind("w")
        four = tuple(f"{name[:place]}{letter}{name[place + 1 :]}" for letter in ("XYZW" if "W" in name else "xyzw"))
        if place >= 0 and {*four} <= columns.keys():
            size = size_of([columns[one] for one in four])
            known = np.isfinite(size) & (size > 0)
            if known.any() and np.all(np.abs(size[known] - 1.0) < OFF_ONE):
                found[f"{name[:place].rstrip('._/ [(')} yaw".strip()] = four
    return found


def _in_text(
    table: pd.DataFrame, names: list[str], decimal: str
) -> tuple[dict[str, tuple[str, Array]], frozenset[str]]:
    """Name -> column of text and degrees (N,) of each latitude and longitude in it, and the letters of their sides.

    A column that holds both is called `Position latitude` and `Position longitude`.
    """
    found: dict[str, tuple[str, Array]] = {}
    letters: set[str] = set()
    for name in filter(None, names):
        texts = in_points(_called(table, name).astype(str).str.strip(), decimal, None)
        meant = [one for one in SIDES if fits(name).get(one, 0.0) > 0.5]
        read = {one: degrees_in_text(texts, SIDES[one]) for one in meant or SIDES}
        known = {one: values for one, values in read.items() if np.mean(np.isfinite(values)) > 0.5}
        # a time of day may be both: then they are equal
        lettered = meant or np.nanmax(np.abs(read["latitude"] - read["longitude"]), initial=0.0) > 0
        if len(known) != len(read) or not lettered:
            continue
        found |= {name if meant else f"{name} {one}": (name, values) for one, values in known.items()}
        for one in known:
            letters |= {letter for letter in SIDES[one] if texts.str.contains(letter, case=False).any()}
    return found, frozenset(letters)


def _is_whole(values: Array, most: float) -> bool:
    """Whether all numbers (N,) that are there are whole, and at most that large."""
    known = values[np.isfinite(values)]
    return bool(len(known) and np.all(known % 1 == 0.0) and np.all(np.abs(known) <= most))


def _fields(columns: dict[str, Array]) -> dict[str, str]:
    """Field of a date or time -> column of whole numbers that is called so: year, month, day, hour, minute, second."""
    found: dict[str, str] = {}
    names, order = [*columns], [one for one in FIELDS if one != "day of the year"]
    for place in range(len(names) - len(order) + 1 if all(map(str.isdecimal, names)) else 0):
        six = dict(zip(order, names[place:], strict=False))  # as datevec of MATLAB writes
        limits = {**FIELDS, "year": ("", *YEARS)}
        parts = [np.floor(columns[name]) if one == "second" else columns[name] for one, name in six.items()]
        inside = zip(parts, order, strict=True)
        if all(_is_whole(part, limits[one][2]) and np.min(part) >= limits[one][1] for part, one in inside):
            return six
    for name, values in columns.items():
        word = (parts_of(name) or ("",))[-1]
        called = [one for one, (words, _, _) in FIELDS.items() if word in words.split() and one not in found]
        one = "minute" if "minute" in called and "hour" in found else next(iter(called), "")
        if one and one in ("minute", "second") and "hour" not in found:
            continue
        whole = np.floor(values) if one == "second" else values
        if one and _is_whole(whole, FIELDS[one][2]) and np.nanmin(whole) >= FIELDS[one][1]:
            found[one] = name
    return found


def _day_in(fields: dict[str, str]) -> list[str]:
    """Columns of year, month and day, or of year and day of the year; none where one is not there."""
    ways = (("year", "month", "day"), ("year", "day of the year"))
    return next(([fields[one] for one in way] for way in ways if {*way} <= fields.keys()), [])


def _in_columns(
    table: pd.DataFrame, columns: dict[str, Array], dates: str | None
) -> tuple[dict[str, Any], Array] | None:
    """Return the clock of a log with hour, minute and second in columns; `dates` is a column of dates."""
    fields = _fields(columns)
    times, days = [fields[one] for one in ("hour", "minute", "second") if one in fields], _day_in(fields)
    if not {"hour", "minute"} <= fields.keys():
        return None
    texts = time_texts([columns[name] for name in times])
    day: str | list[str] | None = dates or days or None
    if day is not None:
        written = _called(table, day) if isinstance(day, str) else date_texts([columns[name] for name in day])
        texts = dated(written, texts)
    since = seconds(texts)
    if not np.isfinite(since).all():
        return None
    keys = {"from": times, "unit": "date"} | ({"date": day} if day is not None else {})
    if np.all(np.diff(since) > 0):
        return keys, since
    rate = _rate(since)
    return None if rate is None else (keys | {"every": rate[0]}, rate[1])


def _sides(table: pd.DataFrame, words: list[str]) -> frozenset[str]:
    """Return the letters of the columns that hold a side of the Earth alone: N or S, E or W.

    Such a column is beside that of a position, or is called so: the letters of another say a status.
    """
    letters: set[str] = set()
    names = list(map(str, table.columns))
    for index, name in enumerate(names):
        held = (
            set() if name not in words else {*_called(table, name).dropna().astype(str).str.strip().str.upper()} - {""}
        )
        for meaning, both in (("latitude", "NS"), ("longitude", "EW")):
            near = any(meaning in fits(one) for one in names[max(0, index - 1) : index + 2])
            if held and held <= set(both) and (near or both.lower() in re.sub("[^a-z]", "", name.lower())):
                letters |= held
    return frozenset(letters)


def _words_for_nothing(table: pd.DataFrame, columns: dict[str, Array], form: TableFormat) -> list[str]:
    """Return the texts in columns of numbers that say that there is no value, such as `---` or `N/A`."""
    texts: dict[str, None] = {}
    for name, values in columns.items():
        lost = np.isnan(values)
        if lost.any():
            texts |= dict.fromkeys(_called(table, name)[lost].dropna().astype(str).str.strip().unique())
    return [text for text in texts if text not in form.missing and _NOTHING.fullmatch(text.lower())]


def _sentinels(table: pd.DataFrame, columns: dict[str, Array]) -> list[str]:
    """Return the texts that stand for a missing value, and set them to NaN: far beyond all other values of a column.

    A shaft that makes 98 and 99 rpm, or stands and then makes 99, has no missing value: such a number must be twice as
    large as all others of its sign, and one of three digits says nothing beside zeros alone.
    """
    texts: dict[str, None] = {}
    for name, values in columns.items():
        never = dict(NOT_AVAILABLE[one] for one in fits(name) if one in NOT_AVAILABLE)
        finite = values[np.isfinite(values)]
        ends = {float(finite.max()), float(finite.min())} if len(finite) else set()
        for value in dict.fromkeys([*SENTINELS, *never, *ends]):
            hit = values == value
            others = values[~hit & ~np.isin(values, SENTINELS) & np.isfinite(values)]
            if not hit.any() or len(others) < 2:
                continue
            low, high = float(others.min()), float(others.max())
            if value in never:
                known = max(-low, high) > never[value]
            elif value not in SENTINELS:  # of no recorder that is known
                known = not _stands_out(values, value) or _is_elsewhere(table, name, hit)
            else:
                known = low - max(high - low, -low) <= value <= high + max(high - low, high)
                known |= low == high == 0.0 and 0.0 < value < 1000.0
            if not known:
                texts |= dict.fromkeys(_called(table, name)[hit].astype(str).str.strip())
                values[hit] = np.nan
    for name, values in columns.items() if texts else ():  # the import takes them so in every column
        if not is_clock(name):
            values[_called(table, name).astype(str).str.strip().isin(texts).to_numpy()] = np.nan
    return list(texts)


def _stands_out(values: Array, value: float) -> bool:
    """Whether a column (N,) takes a value again and again that is far beyond all others.

    A few others are not mostly near 0: a thruster that is switched on has no value but 0 else.
    """
    hit, others = values == value, values[(values != value) & np.isfinite(values)]
    visits = int(np.sum(hit[1:] & ~hit[:-1]))
    if visits < VISITS or hit.mean() > SELDOM:
        return False
    usual, many = np.abs(others), len(np.unique(others)) > LEVELS
    on_and_off = not many and np.median(usual) <= usual.max() / BEYOND
    return bool(abs(value) > (BEYOND if many else BEYOND_LEVELS) * usual.max() and not on_and_off)


def _is_elsewhere(table: pd.DataFrame, name: str, hit: Rows) -> bool:
    """Whether another column of a table holds a text that one of this name has in some rows (N,)."""
    texts = _called(table, name)[hit].astype(str).str.strip().unique()
    others = (table.iloc[:, index] for index, one in enumerate(map(str, table.columns)) if one != name)
    return any(other.astype(str).str.strip().isin(texts).any() for other in others)


def _minus_ones(columns: dict[str, Array]) -> Iterator[str]:
    """Yield a question for each speed, direction or shaft that is -1 and otherwise never negative, nor near it.

    It is no missing value of the whole log: a rudder may be at -1 deg.
    """
    for name, values in columns.items():
        hit = values == -1.0
        others = values[~hit & np.isfinite(values)]
        if not hit.any() or len(others) < 2 or others.min() < 0.0:
            continue
        meant = fits(name).keys()
        lost = bool({"speed", "V_w"} & meant and np.any(others % 1))  # whole knots may be one astern
        lost |= bool({"psi", "course", "beta_w"} & meant and others.max() > 180.0)
        lost |= "n" in meant and others.min() > 10.0
        if lost:
            span = f"{others.min():g} to {others.max():g}"
            remedy = "Then take it out of the log, or list it in [format] missing if no other column has such a value"
            yield f"{name!r} is -1 in {int(hit.sum())} rows and {span} in the others: is there no value? {remedy}"


def _restarts(table: pd.DataFrame, columns: dict[str, Array]) -> tuple[dict[str, int], dict[str, Array] | None]:
    """Return the column that says the run with the number of runs, and the clock, where it begins again with each.

    The clock goes on from run to run then, after a time of `LONG` rows.
    """
    for name in filter(is_clock, columns):
        steps = np.diff(columns[name])
        if not np.isfinite(columns[name]).all() or not np.any(steps < 0) or _again(columns[name]):
            continue
        for run in (str(run) for run in table.columns if str(run) and is_run(str(run))):
            texts = _called(table, run).astype(str).str.strip().to_numpy(dtype=object)
            changed = texts[1:] != texts[:-1]
            if np.all(changed[steps < 0]) and np.mean(changed) < 0.1:
                length = float(np.ptp(columns[name])) + LONG * float(np.median(steps))
                return {run: 1 + int(changed.sum())}, {name: columns[name] + np.append(0, np.cumsum(changed)) * length}
    return {}, None


def _clock_once(table: pd.DataFrame, columns: dict[str, Array], file: Path) -> tuple[dict[str, Any], Array, Rows]:
    """Return the clock, its times, and which rows it takes: all but a few that repeat the row before."""
    again = repeated_rows(table)
    if 0 < again.sum() <= REPEATED * len(table):
        kept = {name: values[~again] for name, values in columns.items()}
        clock, t = _clock(table.loc[~again].reset_index(drop=True), kept, file)
        return {**clock, "repeated": "drop"}, t, ~again
    try:
        return *_clock(table, columns, file), np.ones(len(table), dtype=bool)
    except DataError:
        once = _once(table, columns)
        if once is None:
            raise
        kept = {name: values[once] for name, values in columns.items()}
        clock, t = _clock(table.loc[once].reset_index(drop=True), kept, file)
        if "every" in clock:  # a rounded clock has rows of one time that are not repeated
            raise
        return {**clock, "repeated": "drop"}, t, once


def _once(table: pd.DataFrame, columns: dict[str, Array]) -> Rows | None:
    """Return the rows that do not say the time of the row before once more; None where no clock has a few of these."""
    for name in map(str, table.columns):
        if not is_clock(name):
            continue
        times = columns[name] if name in columns else seconds(_called(table, name))
        steps = np.diff(times, prepend=-np.inf)
        if np.isfinite(times).all() and np.all(steps >= 0) and 0 < np.sum(steps == 0) <= REPEATED * len(table):
            return np.asarray(steps > 0)
    return None


def _clock(table: pd.DataFrame, columns: dict[str, Array], file: Path) -> tuple[dict[str, Any], Array]:
    """Return the clock: a column that rises, by its name if several do; dates; or a rounded one, by its rate."""
    finite = {name: values for name, values in columns.items() if np.isfinite(values).all() and len(values)}
    rising = [name for name, values in finite.items() if np.all(np.diff(values) > 0)]
    called = [name for name in columns if is_clock(name)]
    texts = [name for name in map(str, table.columns) if name not in columns and name]
    times: dict[str, Array] = {}
    for name in sorted(texts, key=lambda name: not is_clock(name)):
        column = _called(table, name)
        of_day = column.dropna().astype(str).str.fullmatch(TIME_OF_DAY)
        whole = len(of_day) and of_day.all()
        day = (_dates(table, texts) or _day_in(_fields(columns))) if whole else None
        if day:
            of_date = _called(table, day) if isinstance(day, str) else date_texts([columns[one] for one in day])
            with_date = seconds(dated(of_date, column))
            if np.isfinite(with_date).all() and np.all(np.diff(with_date) > 0):
                return {"from": name, "unit": "date", "date": day}, with_date
        since = seconds(column) if is_clock(name) or _looks_dated(column) else np.full(len(table), np.nan)
        times[name] = since
        if not np.isfinite(since).all():
            called += [name] if is_clock(name) else []
            continue
        if np.all(np.diff(since) > 0):
            return {"from": name, "unit": "date"}, since
        rate = _rate(since)
        if rate is not None:
            return {"from": name, "unit": "date", "every": rate[0]}, rate[1]
        called.append(name)
    in_columns = _in_columns(table, columns, _dates(table, texts))
    if in_columns is not None:
        return in_columns
    if not any(name in called for name in rising):  # another column that happens to rise is no clock then
        for name, since in times.items():
            if np.isfinite(since).all() and np.any(np.diff(since) < 0):
                twice = hour_twice(since)
                if twice is not None:
                    raise DataError(twice[1], file=file, path=f"row {twice[0] + 1}")
                raise DataError(f"no column can be the clock: {name!r} {_fault(since)}", file=file)
        dates = _dates(table, texts)
        called = [name for name in called if name != dates] or called  # that repeat: the times beside them are at fault
        for name in called if dates is not None else ():
            if name in texts:
                fault = _unread(table, name, times[name]) or _fault(times[name])
                raise DataError(f"no column can be the clock: {name!r} {fault}", file=file)
    candidates = [name for name in rising if name in called] or [name for name in rising if not _counts(columns[name])]
    unnamed = list(columns)[:1] if not called and all(name.isdecimal() for name in columns) else []
    rounded = [name for name in called or unnamed if name in finite and name not in rising]
    for name in [*candidates[:1], *rounded] if candidates and candidates[0] in called else [*rounded, *candidates[:1]]:
        unit, t = _read_clock(table, name, finite[name], file)
        rises = bool(np.all(np.diff(t) > 0))  # after midnight, too
        rate = _rate(t) if not rises or _is_coarse(t) else None
        if rate is not None:
            return {"from": name, "unit": unit, "every": rate[0]}, rate[1]
        if rises:
            return {"from": name, "unit": unit}, t
    if rising:
        unit, t = _read_clock(table, rising[0], finite[rising[0]], file)
        return {"from": rising[0], "unit": unit}, t
    first = {**times, **columns}.get(called[0], np.empty(0)) if called else np.empty(0)
    if called and called[0] in finite:
        first = clock_seconds(first, _unit_of_clock(called[0], first))
    counted = _counter(finite[called[0]]) if called and called[0] in finite else ""
    fault = "none rises from row to row"
    if called:
        fault = f"{called[0]!r} {counted or _unread(table, called[0], first) or _fault(first)}"
    if called and called[0] in finite and _is_years(called[0], finite[called[0]]):
        fault = f"{called[0]!r} {OF_YEARS.format(finite[called[0]][0])}"
    raise DataError(f"no column can be the clock: {fault}", file=file)


def _doubts(table: pd.DataFrame, clock: dict[str, Any], t: Array) -> Iterator[str]:
    """Yield questions on dates and times of day at t (N,) [s] that may mean another moment."""
    if clock["unit"] == "excel" and DATES["mjd"][0] < t[0] / DAY + EPOCHS["excel"]:
        excel, other = (date_of(t[0] + days * DAY)[:10] for days in (0.0, EPOCHS["excel"] - EPOCHS["mjd"]))
        yield f"{clock['from']!r} is read as a day of Excel, {excel}: or is it a modified Julian date (mjd), {other}?"
    if clock["unit"] not in ("date", "hhmmss") or {type(clock["from"]), type(clock.get("date", ""))} != {str}:
        return
    texts = _called(table, clock["from"])
    texts = dated(_called(table, clock["date"]), texts) if "date" in clock else texts
    if pd.api.types.is_string_dtype(texts.dtype):
        texts = texts.astype(str).str.strip()
        ways = ways_of(texts)
        spans = {way: days_by(texts, way) for way in ways}
        least = min((since[-1] - since[0] for since in spans.values()), default=0.0)
        alike = [s for s in spans.values() if np.all(np.diff(s) >= 0) and s[-1] - s[0] == least]  # false where NaN
        firsts = sorted({date_of(since[0])[:10] for since in alike} - {date_of(t[0])[:10]})
        if firsts and len(alike) > 1:
            others = " or ".join(firsts)
            yield f"{texts.iloc[0]!r} is read as {date_of(t[0])[:10]}: or is it {others}? Then write 2024-05-14"
    steps = np.diff(t)
    usual = float(np.median(steps))
    of_day = t % DAY
    late = np.flatnonzero((steps >= HALF_DAY) & (steps <= HALF_DAY + NEXT_DAY))
    if len(late) and t[-1] - t[0] < 3 * DAY and of_day.min() >= HOUR and of_day.max() < HOUR + HALF_DAY:
        before, after = (date_of(of_day[late[0] + k])[11:] for k in (0, 1))
        words = f"after {before} comes {after}, read as 12 hours later: has the clock twelve hours without AM and PM?"
        yield f"{words} Then write 24 hours"
    for row in np.flatnonzero((steps >= HOUR) & (steps <= HOUR + 3 * usual)):
        if -t[row] % HOUR <= t[row + 1] - t[row] - HOUR:  # from one full hour to the next
            before, after = date_of(t[row])[11:], date_of(t[row + 1])[11:]
            words = f"after {before} comes {after}: is it local time as daylight saving begins, and no pause?"
            yield f"{words} Then write UTC, or in every row the zone that holds there"
            return


def _other_clocks(table: pd.DataFrame, columns: dict[str, Array], clock: dict[str, Any], t: Array) -> Iterator[str]:
    """Yield a question for each further clock that goes otherwise than the times t (N,) [s] of the rows.

    So it is where each channel has a time beside it, or where a second log is beside the first.
    """
    of_rows = {one for key in ("from", "date") if key in clock for one in names_of(clock[key])}
    for name in map(str, table.columns):
        if name in of_rows or not is_clock(name):
            continue
        other = columns[name] if name in columns else seconds(_called(table, name))
        known = np.isfinite(other)
        values, times = other[known], t[known]
        if len(values) < FEWEST_TIMES or not np.all(np.diff(values) > 0):
            continue
        since = clock_seconds(values, _unit_of_clock(name, values)) if name in columns else values
        off = float(np.ptp(since - times))
        if off > max(APART * float(np.median(np.diff(t))), OFF * float(times[-1] - times[0])):
            how = f"{name!r} is a clock, too, and goes otherwise than that of the rows: they part by {off:.3g} s"
            yield f"{how}. Are the columns beside it of its times? Then write them to another file ([file.<name>])"


def _called(table: pd.DataFrame, name: str) -> pd.Series[Any]:
    """Return the first column of this name."""
    return table.iloc[:, list(map(str, table.columns)).index(name)]


def _dates(table: pd.DataFrame, names: list[str]) -> str | None:
    """Return the first of these columns that holds a date in every row, without a time."""
    for name in names:
        cells = _called(table, name).astype(str).str.strip()
        if cells.str.fullmatch(DAY_OF).all():
            return name
    return None


def is_clock(name: str) -> bool:
    """Whether a column has the name of a clock."""
    parts = set(parts_of(name)) | {plain(name)}
    return bool(parts & CLOCK_WORDS) and not parts & NO_CLOCK_WORDS


def _looks_dated(column: pd.Series[Any]) -> bool:
    texts = column.dropna().astype(str).head(20)
    dated = texts.str.fullmatch(rf"{TIME_OF_DAY}|\d{{4}}-\d\d-\d\d[T ].*|(?:{DAY_OF}),? .*")
    return bool(len(texts) and dated.all())


def _read_clock(table: pd.DataFrame, name: str, values: Array, file: Path) -> tuple[str, Array]:
    """Return the unit of a clock of numbers, and its times [s]."""
    if in_one_number(values):
        return "date", seconds(_called(table, name))
    if values.min() > 1e9 and _is_time_of_day(values % 1e6):
        message = f"{name!r} is a date and a time of day in one number, {values[0]:.15g}: write 2024-05-14 08:00:00"
        raise DataError(f"no column can be the clock: {message}", file=file)
    if _is_years(name, values):
        message = f"{name!r} {OF_YEARS.format(values[0])}"
        raise DataError(f"no column can be the clock: {message}", file=file)
    for epoch, what in TICKS.items():
        if DATES["d"][0] < (values[0] / 1e7 - epoch) / DAY < DATES["d"][1] and np.median(np.diff(values)) >= 1e5:
            message = f"{name!r} counts 100 ns since {what}: write seconds since 1970, value / 1e7 - {epoch}"
            raise DataError(f"no column can be the clock: {message}", file=file)
    unit = _unit_of_clock(name, values)
    return unit, clock_seconds(values, unit)


def _is_years(name: str, values: Array) -> bool:
    """Whether a clock is in years with decimals: its name says so, or it says no unit and a minute is no step of it."""
    inside = YEARS[0] < values[0] < YEARS[1] and np.ptp(values) < 1.0 and np.any(values % 1)
    said = {*FIELDS["year"][0].split(), "years"} & {*parts_of(name)}
    return bool(inside and (said or (not units_in(name) and float(np.median(np.diff(values))) < SHORT_YEAR)))


def _unit_of_clock(name: str, values: Array) -> str:
    """Return the unit of a clock: as its name says; else dates, times of day, or ms, us or ns if it counts so."""
    again = _again(values)
    if again is not None and not _is_time_of_day(values):
        return again
    inside = [text.strip().lower().replace("µ", "u").replace("μ", "u") for text in units_in(name)]
    parts = parts_of(name)
    last = [] if "of" in parts else parts[-1:]  # seconds of the day
    written, ends = (next((one for one in WRITTEN if {*WRITTEN[one].split()} & {*said}), "") for said in (inside, last))
    steps = np.diff(values)
    rising = steps[steps > 0]  # a rounded clock often stands
    short = len(rising) > 0 and float(np.median(rising)) < SHORT_DAY
    dates = next((unit for unit in _calendars(parts) if DATES[unit][0] < values[0] < DATES[unit][1]), "")
    if dates and (written == "d" if written else short and ends in ("", "d")):
        return dates
    if written or ends not in ("", "s"):
        return written or ends
    if {"day", "year"} <= set(parts) or {"doy", "yday", "jday"} & set(parts):
        return "d"  # the day of the year
    if _is_time_of_day(values):
        return "hhmmss"
    if ends and DATES["d"][0] < values[0] / DAY < DATES["d"][1]:
        return "s"  # since 1970, however far apart; without the name it may be milliseconds of some weeks
    if len(steps) and np.median(steps) >= 20 and not np.any(values % 1):
        slow = DATES["d"][0] < 1e-3 * values[0] / DAY < DATES["d"][1]  # milliseconds since 1970, however far apart
        step = 0.0 if slow else float(np.median(steps))
        return next((unit for unit, (least, far) in FINE.items() if values[0] > least or step >= far), "ms")
    return "s"


def _calendars(parts: tuple[str, ...]) -> list[str]:
    """Units of clocks in days that count from a date, first the one that a name with these parts says."""
    said = "mjd" if {"mjd", "modified"} & {*parts} else ""
    return sorted(EPOCHS, key=lambda unit: unit != said)


def _again(values: Array) -> str | None:
    """Return the unit of a clock that begins again after a day or a week; None where none does.

    A row may be missing there, so that a clock goes back by a little less than that, but not by an hour.
    """
    steps = np.diff(values)
    back = steps[steps < 0]
    for unit, seconds_of in AGAIN.items():
        period, next_day = seconds_of / to_si(unit, "t"), NEXT_DAY / to_si(unit, "t")
        if len(back) and values.min() >= 0 and values.max() < period and np.all(back + period < next_day):
            return unit
    return None


def _is_time_of_day(values: Array) -> bool:
    """Whether numbers (N,) are hours, minutes and seconds: only so do they go on evenly where a minute is full.

    As seconds they would leave out 41 s in every minute: 123059, 123100.
    """
    since, steps = since_midnight(values), np.diff(values)
    full = np.flatnonzero(steps - np.diff(since) > 1.0)
    if not np.isfinite(since).all() or not len(full):
        return False
    usual = float(np.median(np.diff(since)))
    return bool(np.median(np.diff(since)[full]) <= 1.5 * usual and np.median(steps[full]) > 1.2 * np.median(steps))


def _is_coarse(t: Array) -> bool:
    """Whether the steps of a rising clock differ as if it were rounded: they take few values, a quantum apart."""
    steps = np.diff(t)
    usual = float(np.median(steps))
    spread = float(np.percentile(np.abs(steps - usual), 90))
    if spread < 0.05 * usual or len(t) < 20:
        return False
    return len(np.unique(np.round(steps / usual, 6))) <= max(4, len(steps) // 50)


def _rate(t: Array) -> tuple[float, Array] | None:
    """Return the step [s] of even rows and their instants (N,) that explain a rounded clock; None if none does."""
    if len(t) < 20 or np.any(np.diff(t) < 0) or len(np.unique(t)) < 10:
        return None
    _values, first = np.unique(t, return_index=True)
    early = float(np.median(np.diff(t[: max(3, int(first[min(len(first) - 1, 40)]))])))
    mean = float(t[-1] - t[0]) / (len(t) - 1)
    rounding = rounding_of(t)
    slack = float(rounding[-1]) / (len(t) - 1)
    stretches = [  # whatever rows were lost, most short stretches are whole
        _roundest(float(np.median(t[far:] - t[:-far])) / far, float(rounding[-1]) / far)
        for far in (min(len(t) - 1, most) for most in (200, 60))
    ]
    for step in (_roundest(mean, slack), *stretches, early, mean):
        if not step > 0:
            continue
        even, _ = even_clock(t, step)
        ahead = np.diff(even) / step
        lost = float((ahead[ahead < 4 + 2 * rounding[1:] / step] - 1).sum())
        if lost > LOST * len(t) and step is not mean:
            continue
        if np.all(np.abs(even - t) <= 0.6 * rounding + 0.5 * step) and np.all(np.diff(even) > 0):
            return float(f"{step:.9g}"), even
    return None


def _roundest(value: float, slack: float) -> float:
    """Return the number with the fewest digits within `slack` of a value, or one over such a number."""
    for digits in range(1, 7):
        near = float(f"{value:.{digits}g}")
        if abs(near - value) <= slack:
            return near
        inverse = float(f"{1 / value:.{digits}g}") if value > 0 else 0.0
        if inverse and abs(1 / inverse - value) <= slack:
            return 1.0 / inverse
    return value


def _counts(values: Array) -> bool:
    """Whether a column only counts rows."""
    return bool(np.all(np.diff(values) == 1.0) and values[0] in (0.0, 1.0))


def _unread(table: pd.DataFrame, name: str, values: Array) -> str:
    """Say which text in a clock is no time, or that there is none; empty where all are."""
    wrong = ~np.isfinite(values)
    if not wrong.any():
        text = str(_called(table, name).iloc[0]).strip()
        short = re.fullmatch(r"\d([.,]\d+)?[eE]\+?\d+", text) and np.any(np.diff(values) == 0)
        return f"holds {text!r} in row 1, with too few digits: export it with all of them" if short else ""
    texts = _called(table, name).astype(str).str.strip()
    of_day = texts.str.fullmatch(TIME_OF_DAY).to_numpy(dtype=bool)
    wrong = ~of_day if wrong.all() and of_day.mean() > 0.5 else wrong  # a single other text, and none is read
    row = int(np.argmax(wrong))
    text = texts.iloc[row]
    if _NOTHING.fullmatch(text.lower()):
        return f"has no value in row {row + 1}"
    begin = f"holds {text[:40]!r} in row {row + 1}"
    if re.fullmatch(r"\d{1,3}([,.' \u00a0]\d{3})+([.,]\d*)?", text):
        return f"{begin}: take the mark of thousands out of the log"
    if text.startswith("="):
        return f"{begin}, {NOT_CALCULATED}"
    if wrong.all() and re.fullmatch(r"\d{1,2}:\d\d[.,]\d+", text):
        return f"{begin}, without the hour, as Excel shows times: show them as hh:mm:ss.000, and export again"
    if wrong.all():
        return f"{begin}, no number, date or time of day that can be read: write dates as 2024-05-14 08:00:00"
    what = "a leap second" if re.search(r":60(\D|$)", text) else "a comment" if text[:1] in "#%/;" else "no time"
    lines = "the line" if wrong.sum() == 1 else f"the {wrong.sum()} such lines"
    return f"{begin}, {what}: remove {lines}"


def _counter(values: Array) -> str:
    """Say where a counter of a few bits (N,) is full and begins again; empty where it is none."""
    steps = np.diff(values)
    back = np.flatnonzero(steps < 0)
    for size in COUNTERS:
        over = steps[back] + size
        if len(back) and values.max() < size and np.all((over > 0) & (over < LONG_STEP * np.median(steps))):
            row = int(back[0]) + 2
            return f"is a counter that begins again at {size} in row {row}: add {size} from there on, and so each time"
    return ""


def _fault(values: Array) -> str:
    if not np.isfinite(values).any():
        return "holds no numbers and no dates"
    if not np.isfinite(values).all():
        return f"has no value in row {int(np.argmax(~np.isfinite(values))) + 1}"
    row = int(np.argmax(np.diff(values) < 0)) + 1
    if values[row] < values[row - 1]:  # rows of one time alone may be a rounded clock
        before, after = moment_of(values[row - 1]), moment_of(values[row])
        return (
            f"goes back from {before} to {after} in row {row + 1}: sort the log, or split it there, and join the parts"
        )
    return f"repeats in row {int(np.argmax(np.diff(values) == 0)) + 2}"


def plain(name: str) -> str:
    """Return a name in lower case without its unit in brackets."""
    return re.sub(r"[\[(].*", "", name).strip().lower().replace(" ", "_").replace("-", "_")
