"""Import of a log by a declared mapping: its tables to SI columns, repairs, gaps, conversions, runs."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from collections.abc import Mapping as PlainMapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.arguments import of_class, path_of
from shipid.data.dataset import (
    BREAK,
    STANDARD_DEVIATIONS,
    Array,
    Dataset,
    clock_slack,
    optional,
    pieces,
    required,
    sample,
    units_of,
)
from shipid.data.kinematics import Noise, smooth
from shipid.errors import DataError, choices, is_utf_8
from shipid.logs.dates import date_texts, dated, hour_twice, moment_of, seconds, span_of, time_texts
from shipid.logs.formats import Format, SheetFormat, TableFormat, TextFormat
from shipid.logs.mapping import (
    OF_SHIP,
    Clock,
    Column,
    FileClock,
    Mapping,
    Named,
    Parts,
    Segment,
    Source,
    clock_seconds,
    degrees_in_parts,
    degrees_in_text,
    degrees_of,
    degrees_to_sides,
    is_dated,
    names_of,
    rate_of_ais,
    read_mapping,
    sides_of,
    size_of,
    to_si,
    yaw_of,
)
from shipid.logs.readers import Progress, in_points, read_table, require_file
from shipid.logs.repairs import (
    FLAGS,
    REPAIRS,
    Break,
    Despike,
    Latency,
    Repair,
    Scale,
    WrapInterpolation,
    apply_repairs,
    interpolate_at,
)
from shipid.logs.workbook import NOT_CALCULATED
from shipid.physics.signals import is_command, is_output, row_of, wraps

__all__ = ["digest_of", "import_log", "read_mapping", "runs_of", "sha256_of"]

OFF_ONE = 0.05  # of the size of a quaternion from 1: more is no rounding
BLOCK = 200_000  # rows that are projected at once
NEAR = 3.0  # usual steps: rows further apart are no neighbours
TURN, ABOUT = 2 * np.pi, np.pi / 4  # rad: a jump of an angle that counts from 0 again, and how far from it one may be
Records = list[dict[str, Any]]
Begins = list[tuple[float, str]]
Channel = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class Imported:
    """One log in SI units and body-fixed axes, with its repairs, the number of rows read and the origin [deg].

    begins : time [s] and name of every run in it, where the mapping parts it.
    """

    rows: pd.DataFrame
    records: Records
    read: int
    origin: tuple[float, float] | None
    begins: Begins


def import_log(
    mapping: Mapping, file: str | Path, *, without: Iterable[str] = (), progress: Progress | None = None
) -> Dataset:
    """Turn a log into a dataset as its mapping declares; nothing is repaired that is not declared.

    Order: units, resampling of channels, repair of wrapping channels, unwrapping, `despike` and `scale` of speed,
    course, latitude or longitude, `despike` of a heading that turns velocities over ground, position on the Earth to
    north and east, gaps, speed and course or earth-fixed to body velocities, the other repairs in the order of the
    mapping, estimation of u, v, r, apparent to true wind, runs, resampling. `metadata["repairs"]` counts every repair,
    `flags` marks its rows.

    Parameters
    ----------
    mapping : what the columns are, from `read_mapping`.
    file : the log; with `source.runs`, the folder of its files.
    without : kinds of repair to leave out.
    progress : called with the share of a large log that has been read, 0 to 1.

    Raises
    ------
    DataError : with the log, the row or the key of the mapping, and what would be right.
    """
    of_class("mapping", mapping, Mapping, "as of `read_mapping`", DataError)
    source, off = path_of("file", file, DataError), tuple(without)
    for kind in off:
        if kind not in REPAIRS:
            raise DataError(f"no repair of this kind: {choices(kind, REPAIRS)}", path=kind)
    digest = digest_of(mapping, source)
    if mapping.source.sha256 not in (None, digest):
        raise DataError(
            "not the file this mapping was written for (sha256 differs): fetch that file, or copy the mapping, "
            "check its repairs and segments, and remove [source] sha256",
            file=source,
            path="source.sha256",
        )
    logs = runs_of(mapping.source, source)
    each = [(run, _imported(mapping, log, table, off)) for run, log, table in _tables(mapping, logs, progress)]
    parts, alone = [part for _, part in each], mapping.source.runs is not None or len(each) > 1
    rows = parts[0].rows
    metadata = {
        "vessel": mapping.vessel,
        "source": {**mapping.source.model_dump(exclude_defaults=True), "log": source.name, "sha256": digest},
        "mapping": {"name": mapping.name, "digest": mapping.digest},
        "rows": sum(part.read for part in parts),
        "clock": "run" if alone else "shared",
        "units": units_of(rows.columns),
        "flags": list(FLAGS),
        "repairs": _added([part.records for part in parts]),
    }
    if parts[0].origin is not None:
        metadata["origin"] = dict(zip(("latitude", "longitude"), parts[0].origin, strict=True))
    kinds = {segment.run: segment.manoeuvre for segment in mapping.segment if segment.manoeuvre is not None}
    if mapping.parts is not None:
        frame = pd.concat(_distinct(piece for run, part in each for piece in _parted(part, run)), ignore_index=True)
    elif mapping.source.runs is None:
        segments = mapping.segment or (_whole(rows, mapping, source),)
        frame = _cut(rows, segments, to_si(mapping.clock.unit, "t"), source)
    else:
        frame = pd.concat([_named(part.rows, run) for run, part in each], ignore_index=True)
    kinds |= {run: kind for run, kind in mapping.source.manoeuvres.items() if run in set(frame["run"])}
    metadata |= {"manoeuvres": kinds} if kinds else {}
    dataset = Dataset(frame, metadata)
    return _resampled(dataset, mapping.resample.step) if mapping.resample else dataset


def runs_of(source: Source, log: Path) -> dict[str, Path]:
    """Return run -> file: every file of the folder that fits `source.runs`; without that pattern, the log itself."""
    if source.runs is None:
        if log.is_dir():
            fault = 'cannot be read: a folder, and the mapping reads one file; for a file a run write runs = "*.csv"'
            raise DataError(fault, file=log, path="source.runs")
        return {log.stem: log}
    if not log.is_dir():
        fault = "is a file, and the mapping takes a folder of runs" if log.is_file() else "there is no such folder"
        raise DataError(f"{fault}: files {source.runs!r}", file=log, path="source.runs")
    left = {log / name for name in source.skip}
    files = sorted(file for file in log.glob(source.runs) if file.is_file() and file not in left)
    if not files:
        raise DataError(f"no file {source.runs!r} in this folder", file=log, path="source.runs")
    foreign = [file for file in files if not is_utf_8(str(file.relative_to(log)))]
    if foreign:
        raise DataError("its name is not UTF-8, and names the run: rename it", file=foreign[0])
    return {run_of(file, log, source.runs): file for file in files}


def run_of(file: Path, folder: Path, pattern: str) -> str:
    """Return the name of the run in a file: the text that a single star matches, else its path without ending."""
    if pattern.count("*") == 1 and "/" not in pattern:
        before, _, after = pattern.partition("*")
        return file.name.removeprefix(before).removesuffix(after)
    return file.relative_to(folder).with_suffix("").as_posix()


def digest_of(mapping: Mapping, log: Path) -> str:
    """Return the SHA-256 of the log in hex; for several files, the SHA-256 of their SHA-256s joined."""
    files = [*runs_of(mapping.source, log).values(), *(log.parent / entry.path for entry in mapping.file.values())]
    digests = [sha256_of(file) for file in files]
    several = mapping.source.runs is not None or mapping.file
    return hashlib.sha256("".join(digests).encode()).hexdigest() if several else digests[0]


def sha256_of(file: Path) -> str:
    """Return the SHA-256 of a file in hex; raises DataError if it cannot be read."""
    require_file(file)
    try:
        with file.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", file=file) from None


def _tables(
    mapping: Mapping, logs: PlainMapping[str, Path], progress: Progress | None
) -> Iterator[tuple[str, Path, pd.DataFrame]]:
    """Yield name, file and rows of each log; those of each run separately where the clock begins again with a run."""
    here = {name for column in mapping.columns.values() if not column.file for name in names_of(column.source)}
    here |= {*mapping.clock.sources}
    here |= {mapping.parts.source} if mapping.parts is not None and mapping.parts.source is not None else set()
    whole_rows = mapping.clock.repeated == "drop" and mapping.clock.every is not None  # compared in all columns
    for run, file in logs.items():
        log = read_table(file, mapping.format, mapping.clock.sources[0], () if whole_rows else here, progress)
        first = 0
        for end in [*_restarts(log, mapping, file), len(log)]:
            part = log.iloc[first:end] if first or end < len(log) else log
            part.attrs = {} if first else log.attrs
            yield run, file, part
            first = end


def _restarts(log: pd.DataFrame, mapping: Mapping, file: Path) -> list[int]:
    """Rows of a log at which a run begins with another clock; none where time goes back within a run, too."""
    if mapping.parts is None or mapping.parts.source is None or mapping.file:
        return []
    t, texts = _times(log, mapping.clock, mapping.format, file, "clock"), _texts(log, mapping.parts.source, file)
    changed = np.append(False, texts[1:] != texts[:-1])
    back = np.append(False, np.diff(t) < 0)
    return np.flatnonzero(changed).tolist() if back.any() and not (back & ~changed).any() else []


def _comes_first(repair: Repair, fixed: bool, read: set[str]) -> bool:
    """Whether a repair mends columns that become others, or the heading by which velocities over ground are turned.

    fixed : whether there are such. read : names of the columns that the log has.
    """
    if not isinstance(repair, Despike | Scale):
        return False
    mended = {*repair.columns}
    turns = fixed and isinstance(repair, Despike) and "psi" in mended and not {"u", "v"} & mended and mended <= read
    return repair.of_inputs or turns


def _check_breaks(mapping: Mapping, t: Array, off: tuple[str, ...], file: Path) -> None:
    """Raise DataError for an interval of a break that no time t (N,) [s] of a log reaches: its clock is another one.

    Where each run has a separate clock, or part, the interval may be of another run.
    """
    alone = mapping.source.runs is None and mapping.parts is None and BREAK not in off
    for index, repair in enumerate(mapping.repair if alone else ()):
        for start, end in repair.intervals if isinstance(repair, Break) and repair.enabled else ():
            if end < t[0] or start > t[-1]:
                message = f"{span_of(start, end)} is not in the log, which has {span_of(t[0], t[-1])}"
                raise DataError(message, file=file, path=f"repair.{index}.intervals")


def _texts(log: pd.DataFrame, source: str, file: Path) -> NDArray[np.object_]:
    """The column that says the run, as texts (N,); whole numbers without a point."""
    column = _column(log, source, file, "parts.from").ffill().bfill()
    if pd.api.types.is_float_dtype(column.dtype) and (column == column.round()).all():
        column = column.astype("int64")
    return np.asarray(column.astype(str).str.strip().to_numpy(dtype=object))


def _imported(mapping: Mapping, file: Path, log: pd.DataFrame, off: tuple[str, ...]) -> Imported:
    rows, first, read, begins = _columns(mapping, file, log)
    _check_breaks(mapping, rows["t"].to_numpy(), off, file)
    wrapping = [repair for repair in mapping.repair if isinstance(repair, WrapInterpolation)]
    fixed = "speed" in mapping.columns or ("u" in mapping.columns and mapping.columns["u"].frame == "earth")
    early = [repair for repair in mapping.repair if _comes_first(repair, fixed, {*mapping.columns})]
    others = [repair for repair in mapping.repair if repair not in [*wrapping, *early]]
    rows, records = apply_repairs(rows, wrapping, off, file)
    rows = _unwrapped(rows, mapping, file)
    rows, mended = apply_repairs(rows, early, off, file)
    records += mended
    rows, origin = _projected(rows, mapping, file) if "latitude" in rows else (rows, None)
    rows, gaps = _close_gaps(rows, mapping.clock.max_gap, file)
    rows = _in_body(rows, mapping.columns)
    others = [
        repair.model_copy(update={"turn": fixed}) if isinstance(repair, Latency) and repair.turn is None else repair
        for repair in others
    ]
    rows, more = apply_repairs(rows, others, off, file)
    rows, estimated = _estimated(rows, mapping, file) if mapping.estimate is not None else (rows, [])
    relative = mapping.columns["beta_w"].relative if "beta_w" in mapping.columns else False
    if relative == "angle":
        rows = rows.assign(beta_w=rows["beta_w"] + rows["psi"])
    elif relative:
        rows = _true_wind(rows)
    known = [name for name in (*required(), *optional()) if name in rows]
    commands = [str(name) for name in rows.columns if is_command(str(name))]
    outputs = [str(name) for name in rows.columns if is_output(str(name))]
    order = (
        [*known, *commands, *outputs, "flags"]
        if mapping.resamples or "latitude" in mapping.columns
        else list(rows.columns)
    )
    return Imported(rows[order].reset_index(drop=True), first + records + gaps + more + estimated, read, origin, begins)


def _added(parts: list[Records]) -> Records:
    """Return the records of all files; counts of one kind and column are added up."""
    if len(parts) == 1:
        return parts[0]
    total: dict[tuple[str, str, int], dict[str, Any]] = {}
    for records in parts:
        seen: list[tuple[str, str]] = []
        for record in records:
            key = (record["kind"], record["column"])
            entry = total.setdefault((*key, seen.count(key)), {**record, "count": 0})
            entry["count"] += record["count"]
            entry["note"] = record["note"] if record["note"] == entry["note"] else f"over {len(parts)} files"
            seen.append(key)
    return list(total.values())


def _columns(mapping: Mapping, file: Path, log: pd.DataFrame) -> tuple[pd.DataFrame, Records, int, Begins]:
    """Columns `t`, those of the mapping in SI units, NaN where a value is missing, and `flags` = 0; begins of runs."""
    records = _passed_over(log)
    if mapping.clock.repeated == "drop":
        log, more = _once(log, mapping.clock, mapping.format, file)
        records += more
    t = _instants(log, mapping.clock, mapping.format, file, "clock")
    begins = _begins(log, t, mapping.parts, file) if mapping.parts is not None else []
    files = {"": (log, t, mapping.format, file)}
    for name, entry in mapping.file.items():
        other = file.parent / entry.path
        table = read_table(other, entry.format, entry.clock.sources[0])
        times = _instants(table, entry.clock, entry.format, other, f"file.{name}.clock")
        files[name] = (table, times, entry.format, other)
        records += _passed_over(table)
    channels: dict[str, Channel] = {}
    for name, column in mapping.columns.items():
        table, _, _, other = files[column.file or ""]
        for source in names_of(column.source):
            _column(table, source, other, f"columns.{name}.from")
    uses = Counter((one.file or "", source) for one in mapping.columns.values() for source in names_of(one.source))
    for name, column in mapping.columns.items():
        table, times, form, other = files[column.file or ""]
        sides = sides_of(name) if column.unit == "deg" and isinstance(column.source, str) else ""
        parts = [_numbers(table, one, form, other, f"columns.{name}.from", sides) for one in names_of(column.source)]
        numbers = parts[0]
        if column.unit == "ddmm":
            numbers = _of_minutes(numbers, table, other, f"columns.{name}.unit")
        if column.unit == "ais":
            numbers = _of_ais(numbers, table, other, f"columns.{name}.unit")
        if column.unit == "quaternion":
            numbers = _of_quaternion(parts, names_of(column.source), table, other, f"columns.{name}.from")
        elif len(parts) > 1:
            numbers = _of_parts(parts, names_of(column.source), table, other, f"columns.{name}.from")
        unit = to_si(column.unit, name)
        factor = column.sign * column.factor * unit
        values = numbers * factor if factor != 1.0 else numbers
        for source in names_of(column.source):
            uses[column.file or "", source] -= 1
            if not uses[column.file or "", source]:
                table.pop(source)  # of a large log there is room for one copy only
        values = values + column.offset * unit if column.offset else values
        channels[name] = (times - column.latency if column.latency else times, values)
    read = len(log)
    if mapping.resamples:
        gap = mapping.clock.max_gap or np.inf
        for name, (times, values) in channels.items():  # afterwards the jump is not seen: it is between two instants
            if mapping.columns[name].interpolation != "angle":
                _check_wraps(times, values, name, mapping.columns[name], gap, file)
        how = {name: _interpolation(name, column) for name, column in mapping.columns.items()}
        held = {name for name in channels if how[name] == "previous"}
        t = _common_clock(channels, held, t, mapping.clock.step, file)
        columns = {name: _brought(t, *channels[name], how[name], gap) for name in channels}
        notes = [(name, f"{how[name]}, latency {column.latency:g} s") for name, column in mapping.columns.items()]
        records += [{"kind": "resampled", "column": name, "count": len(t), "note": note} for name, note in notes]
    else:
        columns = {name: values for name, (_, values) in channels.items()}
    flags, numbered = np.zeros(len(t), dtype=np.int64), None if mapping.resamples else log.index
    rows = pd.DataFrame({"t": t, **columns, "flags": flags}, index=numbered, copy=False)
    return rows, records, read, begins


def _of_minutes(numbers: NDArray[np.float64], log: pd.DataFrame, file: Path, path: str) -> NDArray[np.float64]:
    """Degrees and minutes (N,) as degrees."""
    degrees = degrees_of(numbers)
    wrong = np.isfinite(numbers) & ~np.isfinite(degrees)
    if wrong.any():
        row = int(np.argmax(wrong))
        message = f"{numbers[row]:.10g} in {_row(log, row)} has 60 minutes or more: is the unit deg?"
        raise DataError(message, file=file, path=path)
    return degrees


def _of_ais(numbers: NDArray[np.float64], log: pd.DataFrame, file: Path, path: str) -> NDArray[np.float64]:
    """Rates of turn (N,) as messages of AIS have them, in deg/min."""
    wrong = ~np.isnan(numbers) & ~((numbers >= -128) & (numbers <= 127))
    if wrong.any():
        row = int(np.argmax(wrong))
        message = f"{numbers[row]:.10g} in {_row(log, row)} is none of -128 to 127, as AIS has: is the unit deg/min?"
        raise DataError(message, file=file, path=path)
    return rate_of_ais(numbers)


def _of_parts(
    parts: list[NDArray[np.float64]], names: tuple[str, ...], log: pd.DataFrame, file: Path, path: str
) -> NDArray[np.float64]:
    """Degrees, minutes and seconds (N,), of columns of these names, as degrees."""
    degrees = degrees_in_parts(parts)
    for name, part in zip(names[1:], parts[1:], strict=True):
        wrong = np.abs(part) >= 60.0
        if wrong.any():
            row = int(np.argmax(wrong))
            message = f"{name!r} is {part[row]:.10g} in {_row(log, row)}, 60 or more: are these minutes or seconds?"
            raise DataError(message, file=file, path=path)
    return degrees


def _of_quaternion(
    parts: list[NDArray[np.float64]], names: tuple[str, ...], log: pd.DataFrame, file: Path, path: str
) -> NDArray[np.float64]:
    """Quaternions (4, N), of columns of these names, as yaw angles [rad]."""
    size = size_of(parts)
    wrong = (size > 0) & (np.abs(size - 1.0) > OFF_ONE)
    if wrong.any():
        row = int(np.argmax(wrong))
        said = ", ".join(map(repr, names))
        message = (
            f"{said} have the size {size[row]:.4g} in {_row(log, row)}, and a quaternion has 1: are these x, y, z, w?"
        )
        raise DataError(message, file=file, path=path)
    return yaw_of(parts)


def _begins(log: pd.DataFrame, t: NDArray[np.float64], parts: Parts, file: Path) -> Begins:
    """Return where runs begin in the rows of a log at t (N,) [s]: after a pause, or where the column changes.

    Runs are named after the value of the column, else after their number.
    """
    new = np.append(True, np.diff(t) > (np.inf if parts.pause is None else parts.pause))
    if parts.source is None:
        return [(float(t[row]), str(number)) for number, row in enumerate(np.flatnonzero(new), 1)]
    texts = _texts(log, parts.source, file)
    new |= np.append(True, texts[1:] != texts[:-1])
    return [(float(t[row]), str(texts[row])) for row in np.flatnonzero(new)]


def _passed_over(table: pd.DataFrame) -> Records:
    count = int(table.attrs.get("unreadable", 0))
    note = "no NMEA 0183 sentence, or its checksum fails"
    records: Records = [{"kind": "unreadable", "column": "", "count": count, "note": note}] if count else []
    ragged = table.attrs.get("ragged", [])
    note = (
        f"lines that repeat the header or have another number of cells, the first is line {ragged[0]}" if ragged else ""
    )
    return [*records, {"kind": "ragged", "column": "", "count": len(ragged), "note": note}] if ragged else records


def _once(log: pd.DataFrame, clock: Clock, form: Format, file: Path) -> tuple[pd.DataFrame, Records]:
    """The log without rows that repeat the time of the row before (with `every`: the whole row), and their number."""
    if clock.every is None:
        again = np.diff(_times(log, clock, form, file, "clock"), prepend=-np.inf) == 0
    else:
        again = repeated_rows(log)
    note = "rows that repeat the row before" if clock.every is not None else "rows with the time of the row before"
    records: Records = [{"kind": "repeated", "column": "", "count": int(again.sum()), "note": note}]
    return (log.loc[~again], records) if again.any() else (log, [])


def repeated_rows(table: pd.DataFrame) -> NDArray[np.bool_]:
    """Whether each row (N,) has the values of the row before in all columns."""
    same = np.ones(len(table), dtype=bool)
    same[:1] = False
    for index in range(table.shape[1]):
        if not same.any():  # most often the first column is a time
            break
        column = table.iloc[:, index]
        same &= (column.eq(column.shift()) | (column.isna() & column.shift().isna())).to_numpy(dtype=bool)
    return same


def _times(log: pd.DataFrame, clock: Clock | FileClock, form: Format, file: Path, path: str) -> NDArray[np.float64]:
    """The column of time [s] as it is written, not a number where it is missing."""
    if clock.unit == "date":
        times = _as_text(log, clock.source, time_texts, form, file, f"{path}.from")
        if clock.date is None:
            return seconds(times)
        return seconds(dated(_as_text(log, clock.date, date_texts, form, file, f"{path}.date"), times))
    assert isinstance(clock.source, str)
    return clock_seconds(_numbers(log, clock.source, form, file, f"{path}.from"), clock.unit)


def _as_text(
    log: pd.DataFrame,
    source: Named,
    write: Callable[[list[Array]], pd.Series[Any]],
    form: Format,
    file: Path,
    path: str,
) -> pd.Series[Any]:
    """The column of dates or times, or those of its parts as one."""
    if isinstance(source, str):
        return _column(log, source, file, path)
    return write([_numbers(log, name, form, file, path) for name in source]).set_axis(log.index)


def _instants(log: pd.DataFrame, clock: Clock | FileClock, form: Format, file: Path, path: str) -> NDArray[np.float64]:
    """Return the time of every row [s]; raises DataError where it is missing or does not rise."""
    t = _times(log, clock, form, file, path)
    twice = hour_twice(t) if np.isfinite(t).all() and (is_dated(clock.unit) or clock.unit == "hhmmss") else None
    if twice is not None:
        raise DataError(twice[1], file=file, path=_row(log, twice[0]))
    if isinstance(clock, Clock) and clock.every is not None and np.isfinite(t).all():
        return evenly(t, clock.every, log, file)
    wrong = np.flatnonzero(~(np.diff(t) > 0)) if np.isfinite(t).all() else np.flatnonzero(~np.isfinite(t)) - 1
    if len(wrong):
        row = int(wrong[0]) + 1
        if not np.isfinite(t[row]):
            what = _unread(log, clock, row, file, path)
        elif t[row] == t[row - 1]:
            what = (
                f"the time {moment_of(t[row])} appears twice: remove one of the rows, or set [clock] repeated = 'drop'"
            )
        else:
            what = f"time goes back from {moment_of(t[row - 1])} to {moment_of(t[row])}: sort or split the log"
        raise DataError(what, file=file, path=_row(log, row))
    return t


def _unread(log: pd.DataFrame, clock: Clock | FileClock, row: int, file: Path, path: str) -> str:
    """Say what is wrong with the time of a row: nothing is there, or a text that is no date."""
    times, days = names_of(clock.source), names_of(clock.date) if clock.date is not None else ()
    places = [*((name, f"{path}.date") for name in days), *((name, f"{path}.from") for name in times)]
    cells = [_column(log, name, file, place).iloc[row] for name, place in places]
    if any(pd.isna(cell) or not str(cell).strip() for cell in cells):
        return "no time here: remove the row"
    text = " ".join(str(cell).strip() for cell in cells)
    if len(times) > 1 or len(days) > 1:
        said = " and ".join(filter(None, (", ".join(map(repr, days)), ", ".join(map(repr, times)))))
        return f"{text!r} is no date or time of day, as {said} have to say: correct it, or list them in their order"
    if clock.unit != "date":
        return f"{text} is no time of day, hours, minutes and seconds as in 123005.5: correct it, or write another unit"
    if np.isfinite(seconds(pd.Series([text]))[0]):
        return f"{text!r} has no time zone, while other rows have one: write it in every row, or in none"
    return (
        f"{text!r} is no date or time of day that can be read: write dates as 2024-05-14 08:00:00; "
        'for a number of seconds write [clock] unit = "s"'
    )


def evenly(t: NDArray[np.float64], every: float, log: pd.DataFrame, file: Path) -> NDArray[np.float64]:
    """Return instants `every` [s] apart in place of a rounded column of time t (N,) [s] of a log.

    The rows run on from the first. Where the column pauses, or where rows were lost, whole steps are left out. Raises
    DataError where the column leaves the instants by more than it is rounded.
    """
    even, _ = even_clock(t, every)
    rounding = rounding_of(t)
    off = np.abs(even - t)
    wrong = (off > rounding + every) | (np.diff(even, prepend=-np.inf) <= 0)
    if np.any(wrong):
        row = int(np.argmax(wrong))
        message = f"the time is {off[row]:.3g} s from rows every {every:g} s: the clock has another rate"
        raise DataError(message, file=file, path=f"{_row(log, row)}, clock.every")
    return even


def even_clock(t: NDArray[np.float64], every: float) -> tuple[NDArray[np.float64], int]:
    """Return instants `every` [s] apart that follow a rounded column of time, and the number of pauses in it."""
    rounding = rounding_of(t)
    pauses = np.flatnonzero(np.diff(t) > 2.0 * rounding[1:] + 3.0 * every) + 1
    even = np.empty(len(t))
    for first, last in zip([0, *pauses], [*pauses, len(t)], strict=True):
        part = slice(first, last)
        count = every * np.arange(last - first)
        even[part] = count + np.median(t[part] - count)
        if np.any(np.abs(even[part] - t[part]) > 0.6 * rounding[part] + 0.5 * every):  # rows were lost
            even[part] = _with_losses(t[part], every, rounding[part])
    return even, len(pauses)


def _with_losses(t: NDArray[np.float64], every: float, rounding: NDArray[np.float64]) -> NDArray[np.float64]:
    """Instants a whole number of steps apart, as few as the rounded times t (N,) allow.

    A row at offset + every n fits while one offset in [low, high] lies within half a rounding of all rows so far; where
    none does, n leaves out as many steps as it must, or the offset starts anew, for a rate that is slightly off.
    """
    half = 0.5 * rounding + 1e-9 * (t - t[0]) + 4.0 * np.spacing(np.abs(t).max())  # digits of `every`, and of t
    steps, low, high = np.zeros(len(t)), t[0] - half[0], t[0] + half[0]
    offset, number, begin = np.empty(len(t)), 0.0, 0
    for row in range(1, len(t)):
        number += 1.0
        least, most = t[row] - half[row] - every * number, t[row] + half[row] - every * number
        if least > high:
            lost = np.ceil((least - high) / every - 1e-9)
            number, least, most = number + lost, least - every * lost, most - every * lost
        if most < low:
            offset[begin:row] = (low + high) / 2
            begin, low, high = row, least, most
        low, high = max(low, least), min(high, most)
        steps[row] = number
    offset[begin:] = (low + high) / 2
    return np.asarray(offset + every * steps)


def rounding_of(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far a rounded column of time may be from the truth in each row [s]: its step to the next other value.

    Of numbers written with a few digits the step grows with the number; the largest so far is taken.
    """
    values = np.unique(t)
    if len(values) < 3:
        return np.full(len(t), np.inf)
    steps = np.diff(values)
    near = np.append(steps, steps[-1])
    usual = pd.Series(near).rolling(9, center=True, min_periods=1).median().to_numpy()
    return np.asarray(np.maximum.accumulate(usual)[np.searchsorted(values, t)])


def _common_clock(
    channels: dict[str, Channel], held: set[str], t: NDArray[np.float64], step: float | None, file: Path
) -> NDArray[np.float64]:
    """Return the instants [s] that every channel covers: `step` [s] apart, or the instants of the log.

    Those in `held` hold their last value to the last row, whether it has a value or not.
    """
    spans = {name: times[np.isfinite(values)] for name, (times, values) in channels.items()}
    empty = [name for name, times in spans.items() if not len(times)]
    if empty:
        raise DataError(
            "has no number in any row: name another column, or check decimal and separator",
            file=file,
            path=f"columns.{empty[0]}.from",
        )
    spans |= {name: np.append(spans[name], channels[name][0][-1]) for name in held}
    first, last = max(times[0] for times in spans.values()), min(times[-1] for times in spans.values())
    slack = clock_slack(t)
    if step is not None:
        count = max(0, int(np.floor((last - first + slack) / step)) + 1)
        t = np.asarray(first + step * np.arange(count), dtype=np.float64)
    shared: NDArray[np.float64] = t[(t >= first - slack) & (t <= last + slack)]
    if len(shared) < 2:
        late, early = (pick(spans, key=lambda name: spans[name][end]) for pick, end in ((max, 0), (min, -1)))
        message = f"columns share no time: {late!r} begins at {first:g} s, {early!r} ends at {last:g} s"
        raise DataError(message, file=file, path=f"columns.{late}")
    return shared


def _interpolation(name: str, column: Column) -> str:
    """Return the rule of interpolation: as declared, else `previous` for orders, `angle` where it wraps, `linear`."""
    usual = "short way" if name == "longitude" else "linear"
    return column.interpolation or ("previous" if is_command(name) else "angle" if column.wrap else usual)


def _brought(
    t: NDArray[np.float64], times: NDArray[np.float64], values: NDArray[np.float64], how: str, max_gap: float
) -> NDArray[np.float64]:
    """Interpolate a channel at instants t [s]; NaN between samples more than max_gap [s] apart, unless it is held."""
    known = np.isfinite(values)
    times, values = times[known], values[known]
    if how == "previous":
        held = np.searchsorted(times, t + clock_slack(times), side="right") - 1
        return values[np.clip(held, 0, len(values) - 1)]
    if len(times) == 1:
        return np.full(len(t), values[0])
    result = np.interp(t, times, np.unwrap(values) if how == "angle" else values)
    index = np.clip(np.searchsorted(times, t, side="right"), 1, len(times) - 1)
    if how == "short way":  # from 180 to -180 deg, or from 360 to 0: nothing else is changed, a wrong value stays one
        step = values[index] - values[index - 1]
        share = (t - times[index - 1]) / (times[index] - times[index - 1])
        around = values[index - 1] + share * (step - np.sign(step) * TURN)
        result = np.where(_is_turn(step), np.remainder(around + np.pi, TURN) - np.pi, result)
    on_sample = (t == times[index]) | (t == times[index - 1])
    return np.where((times[index] - times[index - 1] > max_gap + clock_slack(times)) & ~on_sample, np.nan, result)


def _row(log: pd.DataFrame, place: int) -> str:
    """A row of a log in words, by its number among all rows of the file: of `log` some may have been left out."""
    return f"row {int(log.index[place]) + 1}"


def _column(log: pd.DataFrame, source: str, file: Path, path: str) -> pd.Series[Any]:
    names = [str(name) for name in log.columns]
    if names.count(source) > 1:
        raise DataError(f"column {source!r} appears twice in the log: rename one of them", file=file, path=path)
    if source in log.attrs.get("other", {}):
        raise DataError(f"{source!r} is {log.attrs['other'][source]}", file=file, path=path)
    if source not in names:
        alone = f"the header is one column, {names[0]!r}: is the separator right?" if names else "there is none"
        remedy = alone if len(names) <= 1 else choices(source, names)
        raise DataError(f"column {source!r} is not in the log: {remedy}", file=file, path=path)
    return log.iloc[:, names.index(source)]


def _numbers(
    log: pd.DataFrame, source: str, form: Format, file: Path, path: str, sides: str = ""
) -> NDArray[np.float64]:
    """Turn a column into numbers, NaN where it is missing; text that is no number raises with its row.

    With the letters of its `sides` it is an angle in degrees, which may be written as 59°26'12.3"N, or P12.5.
    """
    column = _column(log, source, file, path)
    if pd.api.types.is_numeric_dtype(column.dtype):
        numbers = column.to_numpy(dtype=np.float64, na_value=np.nan)
        infinite = np.flatnonzero(np.isinf(numbers))
        if len(infinite):
            message = f"{numbers[infinite[0]]} is no number (column {source!r}; {len(infinite)} such rows)"
            raise DataError(message, file=file, path=_row(log, infinite[0]))
        return numbers
    read = form if isinstance(form, TableFormat) else TextFormat()
    text = column.fillna("").astype(str).str.strip()
    missing = text.isin(read.missing)
    if read.decimal == "," and read.thousands is None and (grouped := _grouped(text)) is not None:
        message = (
            f"{text.iloc[grouped]!r} has a point, and the decimal is a comma (column {source!r}): is it a mark of "
            "thousands? Write [format] thousands = '.'. Is it the decimal of this column? Write a comma there"
        )
        raise DataError(message, file=file, path=_row(log, grouped))
    plain = in_points(text, read.decimal, read.thousands).mask(missing)
    numbers = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=np.float64, copy=True)
    if sides and np.any(~np.isfinite(numbers) & ~missing.to_numpy()):
        words = in_points(text, read.decimal, None).mask(missing)
        angles = degrees_to_sides(words) if sides == OF_SHIP else degrees_in_text(words, sides)
        if sides != OF_SHIP or np.isfinite(angles).sum() > np.isfinite(numbers).sum():
            numbers = angles
    bad = np.flatnonzero(~np.isfinite(numbers) & ~missing.to_numpy())
    if len(bad):
        kind = "angle" if sides == OF_SHIP else "position"
        what = f"no number and no {kind} with {' or '.join(sides)}" if sides else "no number"
        message = (
            f"{text.iloc[bad[0]]!r} is {what} (column {source!r}; {len(bad)} such rows): "
            "correct it, or list it in [format] missing, or check decimal and thousands"
        )
        if isinstance(form, SheetFormat) and text.iloc[bad[0]].startswith("="):
            message = f"{text.iloc[bad[0]]!r} (column {source!r}; {len(bad)} such rows) is {NOT_CALCULATED}"
        raise DataError(message, file=file, path=_row(log, bad[0]))
    return numbers


def _grouped(text: pd.Series[Any]) -> int | None:
    """Return the first row whose point may mark thousands, 1.250 for 1250; None where a point of a column may not."""
    pointed = text.str.contains(".", regex=False)
    groups = text.str.fullmatch(r"[+-]?[1-9]\d{0,2}(\.\d{3})+(,\d*)?")
    return int(np.argmax(pointed)) if pointed.any() and groups[pointed].all() else None


def _unwrapped(rows: pd.DataFrame, mapping: Mapping, file: Path) -> pd.DataFrame:
    """Unwrap angles, and turn winds "from" into "towards"; DataError for a jump of one that does not wrap."""
    turned: dict[str, NDArray[np.float64]] = {}
    for name, column in mapping.columns.items():
        _check_wraps(rows["t"].to_numpy(), rows[name].to_numpy(), name, column, mapping.clock.max_gap or 0.0, file)
        if column.direction != "from" and not column.wrap:
            continue
        values = rows[name].to_numpy().copy()
        if column.direction == "from":
            values += np.pi
        if column.wrap:
            known = np.isfinite(values)
            if known.all():
                _unwrap(values)
            else:
                values[known] = np.unwrap(values[known])
            if is_command(name) and known.any():  # an azimuth about 360 deg is one about 0
                values -= 2 * np.pi * np.round(np.median(values[known]) / (2 * np.pi))
        turned[name] = values
    return rows.assign(**turned)


def _check_wraps(t: Array, values: Array, name: str, column: Column, max_gap: float, file: Path) -> None:
    """Raise DataError where an angle jumps by a whole turn: the mean of 359 and 1 deg is 180.

    It does so from row to row, or over a gap of at most `max_gap` [s], which will be interpolated. An order is not
    interpolated, but a gear that follows it would go the whole turn back.
    """
    row = row_of(name)
    ordered = row is not None and row.angle and is_command(name)
    if column.wrap or not (wraps(name) or name == "course" or ordered):
        return
    if not np.nanmax(values, initial=-np.inf) - np.nanmin(values, initial=np.inf) > TURN - ABOUT:
        return  # none can: of a large log there is no room for what follows
    known = np.isfinite(values)
    times = t[known]
    steps, jumps = np.diff(times), np.diff(values[known])
    near = (steps < NEAR * np.median(steps)) | (steps <= max_gap + clock_slack(t)) if len(steps) else steps > 0
    places = np.flatnonzero(near & _is_turn(jumps))
    if len(places):
        count = "once" if len(places) == 1 else f"{len(places)} times, first"
        sentence = f"{column.source!r} jumps by a whole turn, {count} at {moment_of(times[places[0] + 1])}"
        raise DataError(f"{sentence}: write wrap = true", file=file, path=f"columns.{name}")


def _is_turn(jumps: Array) -> NDArray[np.bool_]:
    """Whether differences (N,) [rad] of an angle are those of one that begins again: a turn, or nearly."""
    return np.asarray(np.abs(np.abs(jumps) - TURN) < ABOUT)


def _unwrap(values: NDArray[np.float64]) -> None:
    """Unwrap an angle (N,) [rad] in place, bit by bit as `numpy.unwrap` does, with a quarter of its memory."""
    steps = np.diff(values)
    places = np.flatnonzero(~(np.abs(steps) < np.pi))
    jumps = steps[places]
    del steps
    if len(places):
        nearest = np.mod(jumps + np.pi, 2 * np.pi) - np.pi
        nearest[(nearest == -np.pi) & (jumps > 0)] = np.pi
        corrections = np.zeros(len(values))
        corrections[places + 1] = nearest - jumps
        values += np.cumsum(corrections, out=corrections)


def _projected(rows: pd.DataFrame, mapping: Mapping, file: Path) -> tuple[pd.DataFrame, tuple[float, float]]:
    """North and east [m] in the plane that touches the ellipsoid (WGS 84) at the origin, instead of positions on it."""
    from pymap3d import geodetic2ned

    latitude, longitude = np.degrees(rows["latitude"].to_numpy()), np.degrees(rows["longitude"].to_numpy())
    for name, values, most in (("latitude", latitude, 90.0), ("longitude", longitude, 360.0)):
        wrong = np.flatnonzero(np.abs(values) > most)
        if len(wrong):
            reached = f"{values[wrong[0]]:.6g} deg at {moment_of(rows['t'].iloc[wrong[0]])}, one of {len(wrong)} rows"
            message = f"{reached}: is the unit right? List what stands for a missing value in [format] missing"
            raise DataError(message, file=file, path=f"columns.{name}")
    known = np.flatnonzero(np.isfinite(latitude) & np.isfinite(longitude))
    if mapping.origin is not None:
        origin = mapping.origin.latitude, mapping.origin.longitude
    else:
        first = known[0] if len(known) else 0
        origin = float(latitude[first]), float(longitude[first])
    for first in range(0, len(rows), BLOCK):  # of a large log there is no room for all steps of the projection
        part = slice(first, first + BLOCK)
        latitude[part], longitude[part], _ = geodetic2ned(latitude[part], longitude[part], 0.0, *origin, 0.0)
    return rows.drop(columns=["latitude", "longitude"]).assign(north=latitude, east=longitude), origin


def _in_body(rows: pd.DataFrame, columns: dict[str, Column]) -> pd.DataFrame:
    """Turn speed and course over ground, or earth-fixed velocities, into u and v [m/s] by the heading psi."""
    if "speed" in columns:
        drift = rows["course"] - rows["psi"]
        turned = rows.drop(columns=["speed", "course"])
        return turned.assign(u=rows["speed"] * np.cos(drift), v=rows["speed"] * np.sin(drift))
    if "u" not in columns or columns["u"].frame == "body":
        return rows
    c, s = np.cos(rows["psi"].to_numpy()), np.sin(rows["psi"].to_numpy())
    north, east = rows["u"].to_numpy(), rows["v"].to_numpy()
    return rows.assign(u=c * north + s * east, v=c * east - s * north)


def _estimated(rows: pd.DataFrame, mapping: Mapping, file: Path) -> tuple[pd.DataFrame, Records]:
    """Fill in u, v, r that the log lacks, stretch by stretch, and their standard deviations."""
    assert mapping.estimate is not None
    given = mapping.estimate
    errors = {"north": given.position, "east": given.position, "psi": np.radians(given.heading_deg)}
    errors |= {"u": given.velocity, "v": given.velocity, "r": np.radians(given.rate_deg)}
    noise = Noise(errors, given.acceleration, float(np.radians(given.angular_acceleration_deg)))
    lacking = [name for name in STANDARD_DEVIATIONS if name not in rows]
    broken = (rows["flags"].to_numpy() & (1 << FLAGS.index(BREAK))) != 0
    parts, squares = [], 0.0
    for _, stretch in rows.groupby(np.cumsum(broken), sort=False):
        if len(stretch) < 2:
            at = f"t = {stretch['t'].iloc[0]:g} s"
            raise DataError(
                f"a single row between two breaks at {at}: nothing to estimate from; remove the row",
                file=file,
            )
        logged = {name: stretch[name].to_numpy() for name in ("north", "east", "psi", "u", "v", "r") if name in rows}
        smoothed = smooth(stretch["t"].to_numpy(), logged, noise)
        squares += smoothed.consistency * len(stretch)
        columns = {name: smoothed.state(name) for name in lacking}
        columns |= {STANDARD_DEVIATIONS[name]: smoothed.deviation(name) for name in lacking}
        parts.append(stretch.assign(**columns))
    note = f"innovations {np.sqrt(squares / len(rows)):.2f} times as large as the noise declared (1 if it fits)"
    records = [{"kind": "estimated", "column": ", ".join(lacking), "count": len(rows), "note": note}]
    return pd.concat(parts, ignore_index=True), records


def _true_wind(rows: pd.DataFrame) -> pd.DataFrame:
    """Wind relative to the bow and the moving ship as wind over ground: its velocity plus the ship's, turned by psi."""
    ahead = rows["V_w"] * np.cos(rows["beta_w"]) + rows["u"]
    abeam = rows["V_w"] * np.sin(rows["beta_w"]) + rows["v"]
    beta_w = np.unwrap(np.arctan2(abeam, ahead) + rows["psi"])
    return rows.assign(V_w=np.hypot(ahead, abeam), beta_w=beta_w)


def _close_gaps(rows: pd.DataFrame, max_gap: float | None, file: Path) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """Fill gaps of at most `max_gap` [s] between known values, remove the other rows, and break the run there."""
    t, flags = rows["t"].to_numpy(), rows["flags"].to_numpy().copy()
    longest = np.inf if max_gap is None else max_gap + clock_slack(t)  # 0.3 s is three steps of 0.1 s, rounded or not
    removed, records, filled = np.zeros(len(t), dtype=bool), [], {}
    for name in rows.columns.drop(["t", "flags"]):
        values = rows[name].to_numpy()
        missing = ~np.isfinite(values)
        if not missing.any():
            continue
        if max_gap is None:
            message = f"no number in {int(missing.sum())} rows of {name!r}: set max_gap to interpolate short gaps"
            raise DataError(message, file=file, path=f"{_row(rows, int(np.argmax(missing)))}, clock.max_gap")
        before = np.maximum.accumulate(np.where(missing, -np.inf, t))
        after = np.minimum.accumulate(np.where(missing, np.inf, t)[::-1])[::-1]
        short = missing & (after - before <= longest)
        held = pd.Series(values).ffill().to_numpy() if is_command(name) else interpolate_at(t, values, missing)
        filled[name] = np.where(short, held, values)
        flags |= np.where(short, 1 << FLAGS.index("interpolated"), 0)
        removed |= missing & ~short
        note = f"{int((missing & ~short).sum())} rows removed"
        records.append({"kind": "interpolated", "column": name, "count": int(short.sum()), "note": note})
    kept = t[~removed] if removed.any() else t
    if len(kept) < 2:
        long = {
            name: int((values.isna() & removed).sum()) for name, values in rows.drop(columns=["t", "flags"]).items()
        }
        worst = str(max(long, key=long.__getitem__))
        message = f"every row has a gap longer than max_gap, {long[worst]} rows of {worst!r} for one"
        message += ": orders written only where they change are held with [clock] step" * is_command(worst)
        raise DataError(message, file=file, path="clock.max_gap")
    if longest < np.median(np.diff(t)):
        message = f"{max_gap:g} s is shorter than the step of the log, {np.median(np.diff(t)):g} s"
        raise DataError(message, file=file, path="clock.max_gap")
    broken = np.append(False, np.diff(kept) > longest)
    if broken.any():
        note = f"gaps longer than {max_gap:g} s"
        records.append({"kind": BREAK, "column": "", "count": int(broken.sum()), "note": note})
    rows = rows.assign(**filled, flags=flags)
    if removed.any():
        rows = rows.loc[~removed].reset_index(drop=True)
    if broken.any():
        rows = rows.assign(flags=rows["flags"] | np.where(broken, 1 << FLAGS.index(BREAK), 0))
    return rows, records


def _whole(rows: pd.DataFrame, mapping: Mapping, file: Path) -> Segment:
    unit = to_si(mapping.clock.unit, "t")
    return Segment(run=file.stem, start=rows["t"].iloc[0] / unit, end=rows["t"].iloc[-1] / unit)


def _cut(rows: pd.DataFrame, segments: Iterable[Segment], unit: float, file: Path) -> pd.DataFrame:
    """Put the runs one after another; rows that belong to two runs are repeated."""
    t = rows["t"].to_numpy()
    slack, step = clock_slack(t), float(np.median(np.diff(t)))
    runs = []
    for index, segment in enumerate(segments):
        start, end = segment.start * unit, segment.end * unit
        inside = (t >= start - slack) & (t <= end + slack)
        if start < t[0] - step - slack or end > t[-1] + step + slack or inside.sum() < 2:
            message = f"run {segment.run!r}, {span_of(start, end)}, is not in the log, which has {span_of(t[0], t[-1])}"
            raise DataError(message, file=file, path=f"segment.{index}")
        part = rows if inside.all() else rows.loc[inside].reset_index(drop=True)
        runs.append(_named(part, segment.run))
    return runs[0] if len(runs) == 1 else pd.concat(runs, ignore_index=True)


def _parted(log: Imported, name: str) -> Iterator[pd.DataFrame]:
    """Yield the runs of a log, each after its name in it; a run of a single row is no run."""
    t = log.rows["t"].to_numpy()
    starts = np.array([start for start, _ in log.begins])
    number = np.searchsorted(starts, t + clock_slack(t), side="right") - 1
    for index, (_, run) in enumerate(log.begins):
        rows = log.rows.loc[number == index]
        if len(rows) > 1:
            yield _named(rows.reset_index(drop=True), f"{name} {run}")


def _distinct(runs: Iterable[pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """Yield runs with a number after a name that was there already."""
    taken: set[str] = set()
    for rows in runs:
        name = called = str(rows["run"].iloc[0])
        number = 1
        while called in taken:
            number += 1
            called = f"{name} ({number})"
        taken.add(called)
        yield rows if called == name else rows.assign(run=pd.Series(called, index=rows.index, dtype="str"))


def _named(rows: pd.DataFrame, run: str) -> pd.DataFrame:
    named = rows.copy(deep=False)
    named.insert(0, "run", pd.Series(run, index=rows.index, dtype="str"))
    return named


def _resampled(dataset: Dataset, step: float) -> Dataset:
    """Rows `step` [s] apart; the first row of a stretch keeps its flags, so breaks stay."""

    def resample() -> Iterator[pd.DataFrame]:
        for run, rows in pieces(dataset):
            t = rows["t"].to_numpy()
            instants = t[0] + step * np.arange(int(np.floor((t[-1] - t[0] + clock_slack(t)) / step)) + 1)
            frame = pd.DataFrame({"t": instants, **sample(rows, instants)})
            frame.insert(0, "run", pd.Series([run] * len(frame), dtype="str"))
            # a break that stays flagged while its row is held over several instants would break each of them
            bit = 1 << FLAGS.index(BREAK)
            yield frame.assign(flags=frame["flags"] & np.where(np.arange(len(frame)) == 0, -1, ~bit))

    return Dataset(pd.concat(list(resample()), ignore_index=True)[list(dataset.frame.columns)], dataset.metadata)
