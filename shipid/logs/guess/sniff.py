"""Read an unknown log: recognise its format, and return its columns as numbers."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Array
from shipid.errors import DataError
from shipid.logs.cells import OFF_ONE, text_numbers
from shipid.logs.formats import TableFormat, TextFormat
from shipid.logs.guess.clock import (
    are_whole,
    clock_restarts,
    clock_without_repeats,
    column_called,
    is_clock,
    other_clocks,
)
from shipid.logs.guess.layout import format_of_sheet, guess_format
from shipid.logs.guess.words import NO_VALUE, is_run, meaning_scores, name_parts, units_in_name
from shipid.logs.mapping import (
    OF_SHIP,
    SIDES,
    degrees_in_parts,
    degrees_to_side,
    quaternion_size,
    quaternion_yaw,
    source_columns,
)
from shipid.logs.readers import (
    LONGEST_LINE,
    READERS,
    in_points,
    parse_text,
    read_log_table,
    require_file,
)

SAMPLE, BLOCK, BLOCKS = 12_000_000, 600_000, 10  # bytes: a longer text is looked at in its head and that many blocks
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
NOT_AVAILABLE = {
    "psi": {511.0: 360.0},
    "n": {-1.0: 10.0},
    "speed": {102.3: 51.0, 1023.0: 600.0},
    "latitude": {91.0: 90.0, 99.0: 90.0, 54_600_000.0: 54e6},
    "longitude": {181.0: 180.0, 108_600_000.0: 108e6},
}
"""Meaning -> number for none, as AIS writes it (ITU-R M.1371), decoded or not, or 99 N -> the largest of the others;
below 0 the least: a shaft that never stops is not at -1 rpm."""
VISITS, SELDOM = 3, 0.3  # rows at which a number for no value begins, at least; share of the rows, at most
BEYOND, LEVELS, BEYOND_LEVELS = 4.0, 20, 50.0  # times the largest other; of one that has so few values, an order, more
QUATERNIONS = ("xyzw", "XYZW", "1230", "2341")
"""How the names of x, y, z, w of a quaternion differ; numbers begin with the scalar, as in PX4 and ArduPilot."""
MINUTES = frozenset("min minute minutes m mm ' sec second seconds s ss".split()) | {'"'}
SHIPS = re.compile(
    "mmsi|userid|imo|imonumber|callsign"
    "|(ship|vessel|boat|schiffs?|skip|skib|fartyg|navire|buque|nave|schip)s?(name|namn|navn|naam|nombre|nom|id|no|nr|number)*"
)
UNKNOWN = ("0", "unknown")
"""Names of columns that say the ship, in small letters alone; what they hold for an unknown one."""


@dataclass(frozen=True)
class LogTable:
    """An unknown log as numbers: how it is written, its clock and all other columns, NaN where a value is missing.

    form, clock : keys of [format] and [clock]. t : [s], rising. notes : sentences on columns left out.
    seams : places where rows were not read, or runs begin. runs : column that says the run, and their number, where the
    clock begins again with each. sides : letters that columns beside positions hold. words : columns of words, with
    their first. other : columns that cannot be read, and why. in_parts : of several.
    doubts : questions on other clocks.
    fillers : column -> numbers that stand for no value of it. channels : column -> the further file that it is in.
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
    other: dict[str, str] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()
    in_parts: dict[str, tuple[str, ...]] = field(default_factory=dict)
    fillers: dict[str, list[float]] = field(default_factory=dict)
    channels: dict[str, tuple[Path, LogTable]] = field(default_factory=dict)

    @property
    def scattered(self) -> bool:
        """Whether a row is a single sentence, or of one file of several, so that empty cells are no defect."""
        return READERS[self.form.get("kind", "text")].scattered or bool(self.channels)


def recognise_log(file: Path, names: tuple[str, ...] = ()) -> LogTable:
    """Recognise the format of a log and read it; `names` are the columns of a text log without a header.

    Raises DataError where it cannot be read as a log, or no column can be its clock.
    """
    size = require_file(file)
    try:
        with file.open("rb") as stream:
            head = stream.read(LONGEST_LINE)
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", file=file) from None
    if not head[:200_000].strip(b" \t\r\n\xef\xbb\xbf\xff\xfe"):
        raise DataError("the file is empty", file=file)
    form = guess_format(head[:200_000], file, names)
    notes: tuple[str, ...] = ()
    sampled = False
    if form.get("kind") == "sheet":
        form, lines, notes = format_of_sheet(file, names)
    model = READERS[form.get("kind", "text")].options.model_validate(form)
    if isinstance(model, TextFormat):
        sampled = size > SAMPLE
        lines = _text_sample(file, model.encoding, size)
    if isinstance(model, TableFormat):
        table = parse_text(lines, model.text().model_copy(update={"ragged": "drop"}), file)
        if sampled:
            notes = (f"{len(table)} rows from {BLOCKS + 1} places of {size / 1e6:.0f} MB were looked at",)
        ragged = table.attrs["ragged"]
        if ragged and not sampled:
            form["ragged"] = "drop"
            left_out = "lines that repeat the header or have another number of cells are left out"
            notes += (f"{left_out}: {len(ragged)}, the first is line {ragged[0]}",)
        if len(table) < 2:
            raise DataError(f"a header and {len(table)} rows: a log needs two rows or more", file=file)
    else:
        table = read_log_table(file, model, "time")
        notes = tuple(table.attrs.get("notes", ()))
        if READERS[form["kind"]].scattered:  # a time alone, before the first fix, is no row
            table = table.loc[table.drop(columns="time").notna().any(axis=1)].reset_index(drop=True)
    other: dict[str, str] = table.attrs.get("other", {})
    _refuse_ships(table, file)
    decimal = form.get("decimal", ".")
    columns, words = _number_columns(table, decimal, form.get("thousands"))
    rarely = [
        name for name, one in columns.items() if np.isfinite(one).mean() < 0.5 * _cells_of(table, name).ne("").mean()
    ]
    in_text, letters = _in_text(table, [*words, *rarely], decimal)
    columns |= dict(in_text.values())
    notes += (f"{form['thousands']!r} is read as a mark of thousands",) if "thousands" in form else ()
    fillers = _take_fillers(columns)
    missing = []
    if isinstance(model, TableFormat) and (missing := _words_for_nothing(table, columns, model)):
        form["missing"] = [*model.missing, *missing]
    if missing or fillers:
        said = [
            *map(repr, missing),
            *(f"{', '.join(map('{:.10g}'.format, fillers[one]))} of {one!r}" for one in fillers),
        ]
        notes += tuple(f"{one} stands for a value that is missing" for one in said)
    for values in columns.values():  # of no ship, and squares would overflow
        values[np.abs(values) > np.finfo(np.float32).max] = np.nan
    made = _degree_columns(columns) | _quaternion_columns(columns)
    made |= {name: ((source,), values) for name, (source, values) in in_text.items() if name != source}
    in_parts = {name: parts for name, (parts, _) in made.items()}
    words = [name for name in words if name not in columns]
    lost = next(filter(is_clock, other), None)
    if lost is not None and not any(map(is_clock, map(str, table.columns))):
        raise DataError(f"no column can be the clock: {lost!r} is {other[lost]}", file=file)
    runs, since = clock_restarts(table, columns)
    clock, t, once = clock_without_repeats(table.assign(**since), columns | since, model, file)
    columns = {name: values[once] for name, values in columns.items()}
    columns |= {name: values[once] for name, (_, values) in made.items()}
    named = {one for key in ("from", "date") if key in clock for one in source_columns(clock[key])}
    named |= {part for parts in in_parts.values() for part in parts}
    says = {name: next(filter(None, column_called(table, name).dropna().astype(str).str.strip()), "") for name in words}
    notes += tuple(
        f"column {name!r} holds words, not numbers{_as_number(name, says[name])}"
        for name in words
        if name and name not in named
    )
    notes += () if once.all() else ("rows that repeat the row before are left out",)
    empty = [name for name, values in columns.items() if np.isnan(values).all()]
    return LogTable(
        form,
        clock,
        t,
        {name: values for name, values in columns.items() if name not in {*named, *empty, *runs}},
        notes + tuple(f"column {name!r} is empty" for name in empty if name),
        BLOCKS if sampled else sum(runs.values()) - len(runs),
        runs,
        letters | _side_columns(table, words),
        says,
        other,
        () if runs else tuple(other_clocks(table.loc[once], columns, clock, t)),
        in_parts,
        fillers,
    )


def _as_number(name: str, text: str) -> str:
    """What to do with a column of words whose name says a quantity and whose texts have a number, such as P12.5."""
    quantity = any(meaning and score > 0.6 for meaning, score in meaning_scores(name).items())
    remedy = f", such as {text[:40]!r}: write it as a number with a sign"
    return remedy if quantity and re.search(r"\d", text) else ""


def _text_sample(file: Path, encoding: str, size: int) -> str:
    """The text of a log; of a large one its head, and whole lines from places spread over it."""
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


def _refuse_ships(table: pd.DataFrame, file: Path) -> None:
    """Raise DataError where a log holds several ships, as any column names them."""
    for name in (one for one in map(str, table.columns) if SHIPS.fullmatch(re.sub(r"[^a-z]", "", one.lower()))):
        texts = column_called(table, name).dropna().astype(str).str.strip().unique()
        known = [one for one in texts if not NO_VALUE.fullmatch(one.lower()) and one.lower() not in UNKNOWN]
        ships = [*{one.casefold(): one for one in reversed(known)}.values()][::-1]
        if len(ships) > 1:
            raise DataError(
                f"holds {len(ships)} ships ({name!r} is {', '.join(ships[:3])}{', ...' * (len(ships) > 3)}): write the "
                "rows of each ship to a separate log, or take the column out of the log if it is one ship",
                file=file,
            )


def _number_columns(table: pd.DataFrame, decimal: str, thousands: str | None) -> tuple[dict[str, Array], list[str]]:
    """The columns that are mostly numbers, and the names of the columns of words."""
    columns: dict[str, Array] = {}
    words = []
    for index, name in enumerate(map(str, table.columns)):
        column = table.iloc[:, index]
        if pd.api.types.is_bool_dtype(column.dtype):
            words.append(name)
            continue
        numeric = pd.api.types.is_numeric_dtype(column.dtype)
        values = (
            column.to_numpy(dtype=np.float64, na_value=np.nan, copy=True)
            if numeric
            else text_numbers(column.astype(str).str.strip(), decimal, thousands)
        )
        values[np.isinf(values)] = np.nan
        if np.isnan(values).any() and is_run(name):  # names of runs, as numbers
            values = pd.factorize(table.iloc[:, index].ffill().bfill())[0].astype(np.float64)
        lost = np.isnan(values)
        texts = table.iloc[:, index][lost].dropna().astype(str).str.strip() if lost.any() else pd.Series(dtype=str)
        said = sum(count for text, count in texts.value_counts().items() if not NO_VALUE.fullmatch(str(text).lower()))
        if (lost.all() and texts.ne("").any()) or said > len(values) - lost.sum():
            words.append(name)
        elif name and name not in columns:
            columns[name] = values
    return columns, words


Made = dict[str, tuple[tuple[str, ...], Array]]
"""Name of a column that is made of others -> these, and its values (N,)."""


def _degree_columns(columns: dict[str, Array]) -> Made:
    """Latitudes and longitudes in columns of whole degrees, minutes and perhaps seconds, by the names of all."""
    found, names = Made(), tuple(columns)
    for place, count in itertools.product(range(len(names)), (3, 2)):
        parts = names[place : place + count]
        meant = next((one for one in ("latitude", "longitude") if meaning_scores(parts[0]).get(one, 0.0) > 0.5), None)
        used = {part for others, _ in found.values() for part in others}
        if meant and len(parts) == count and not used & {*parts} and _are_parts_of_angle(columns, parts, meant):
            found[" + ".join(parts)] = parts, degrees_in_parts([columns[part] for part in parts])
    return found


def _are_parts_of_angle(columns: dict[str, Array], parts: tuple[str, ...], meant: str) -> bool:
    """Whether columns are degrees, and minutes and perhaps seconds below 60, the last of which alone is not whole."""
    _, *others = ([name, *name_parts(name)[-1:], *units_in_name(name)] for name in parts)
    called = all(
        (meant in meaning_scores(name) or MINUTES & {*words})
        and (meant == "longitude" or "longitude" not in meaning_scores(name))
        for name, *words in others
    )
    small = all(np.nanmax(np.abs(columns[name]), initial=0.0) < 60.0 for name, *_ in others)
    whole = [are_whole(columns[name], 180.0) for name in parts]
    return called and small and all(whole[:-1]) and not whole[-1]


def _quaternion_columns(columns: dict[str, Array]) -> Made:
    """Yaw angles of columns x, y, z, w of a quaternion: names that differ by these alone, and its size is 1."""
    found: Made = {}
    for name, letters in itertools.product(columns, QUATERNIONS):
        place = name.rfind(letters[3])
        four = tuple(f"{name[:place]}{letter}{name[place + 1 :]}" for letter in letters)
        if place >= 0 and {*four} <= columns.keys():
            size = quaternion_size([columns[one] for one in four])
            known = np.isfinite(size) & (size > 0)
            if known.any() and np.all(np.abs(size[known] - 1.0) < OFF_ONE):
                yaw = quaternion_yaw([columns[one] for one in four])
                found[f"{name[:place].rstrip('._/ [(')} yaw".strip()] = four, yaw
    return found


def _in_text(
    table: pd.DataFrame, names: list[str], decimal: str
) -> tuple[dict[str, tuple[str, Array]], frozenset[str]]:
    """Name -> column of text and degrees (N,) of each latitude, longitude and angle to a side of the ship in it.

    Also the letters of the sides of the Earth. Numbers for no value stay. A column that holds a latitude and
    a longitude is called `Position latitude` and `Position longitude`; so is one whose letters alone say it.
    """
    found: dict[str, tuple[str, Array]] = {}
    letters: set[str] = set()
    for name in filter(None, names):
        texts = in_points(_cells_of(table, name), decimal, None)
        least, plain = 0.5 * texts.ne("").mean(), text_numbers(texts, ".", None)
        sure = [one for one, score in meaning_scores(name).items() if score > 0.5]
        meant = [one for one in SIDES if one in sure] or [one for one in sure if one in ("delta", "alpha", "phi")]
        read = {one: degrees_to_side(texts, SIDES.get(one, OF_SHIP)) for one in meant or SIDES}
        read = {
            one: values
            for one, values in read.items()
            if np.mean(np.isfinite(values)) > least
            and (meant or texts.str.contains(rf"[{SIDES[one]}]", case=False).mean() > least)
        }
        # a time of day may be both: then they are equal
        alike = (
            not meant and len(read) > 1 and np.nanmax(np.abs(read["latitude"] - read["longitude"]), initial=0.0) == 0
        )
        if alike or len(read) < len(meant):
            continue
        for one, values in read.items():
            found[name if meant else f"{name} {one}"] = name, np.where(np.isin(plain, SENTINELS), plain, values)
        held = [letter for one in read for letter in SIDES.get(one, "")]
        letters |= {letter for letter in held if texts.str.contains(letter, case=False).any()}
    return found, frozenset(letters)


def _cells_of(table: pd.DataFrame, name: str) -> pd.Series[Any]:
    """The cells (N,) of the first column of this name as text, empty where there is none."""
    column = column_called(table, name)
    return column.astype(str).str.strip().where(column.notna(), "")


def _side_columns(table: pd.DataFrame, words: list[str]) -> frozenset[str]:
    """The letters of the columns that hold a side of the Earth alone: N or S, E or W."""
    letters: set[str] = set()
    names = list(map(str, table.columns))
    for index, name in enumerate(names):
        held = (
            set()
            if name not in words
            else {*column_called(table, name).dropna().astype(str).str.strip().str.upper()} - {""}
        )
        for meaning, both in (("latitude", "NS"), ("longitude", "EW")):
            near = any(meaning in meaning_scores(one) for one in names[max(0, index - 1) : index + 2])
            if held and held <= set(both) and (near or both.lower() in re.sub("[^a-z]", "", name.lower())):
                letters |= held
    return frozenset(letters)


def _words_for_nothing(table: pd.DataFrame, columns: dict[str, Array], form: TableFormat) -> list[str]:
    """The texts in columns of numbers that say that there is no value, such as `---` or `N/A`."""
    texts: dict[str, None] = {}
    for name, values in columns.items():
        lost = np.isnan(values)
        if lost.any():
            texts |= dict.fromkeys(column_called(table, name)[lost].dropna().astype(str).str.strip().unique())
    return [text for text in texts if text not in form.missing and NO_VALUE.fullmatch(text.lower())]


def _take_fillers(columns: dict[str, Array]) -> dict[str, list[float]]:
    """Column -> numbers that stand for a missing value of it, far beyond all its others; they are set to NaN."""
    fillers: dict[str, list[float]] = {}
    for name, values in columns.items():
        never = {value: most for one in meaning_scores(name) for value, most in NOT_AVAILABLE.get(one, {}).items()}
        finite = values[np.isfinite(values)]
        ends = {float(finite.max()), float(finite.min())} if len(finite) else set()
        for value in dict.fromkeys([*SENTINELS, *never, *ends]):
            hit = values == value
            if not hit.any():
                continue
            others = values[~hit & ~np.isin(values, SENTINELS) & np.isfinite(values)]
            if len(others) < 2:
                continue
            low, high = float(others.min()), float(others.max())
            if value in never:
                known = max(-low, high) > never[value] if value > 0.0 else low < never[value]
            elif value not in SENTINELS:  # of no recorder that is known
                known = not _is_filler(values, value)
            else:
                known = low - max(high - low, -low) <= value <= high + max(high - low, high)
                known |= low == high == 0.0 and 0.0 < value < 1000.0
            if not known:
                fillers.setdefault(name, []).append(float(value))
                values[hit] = np.nan
    return fillers


def _is_filler(values: Array, value: float) -> bool:
    """Whether a column (N,) takes a value again and again that is far beyond all others."""
    hit, others = values == value, values[(values != value) & np.isfinite(values)]
    visits = int(np.sum(hit[1:] & ~hit[:-1]))
    if visits < VISITS or hit.mean() > SELDOM:
        return False
    usual, many = np.abs(others), len(np.unique(others)) > LEVELS
    on_and_off = not many and np.median(usual) <= usual.max() / BEYOND
    return bool(abs(value) > (BEYOND if many else BEYOND_LEVELS) * usual.max() and not on_and_off)
