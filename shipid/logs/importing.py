"""Import of a log by a declared mapping: its tables to SI columns, repairs, gaps, conversions, runs."""

from __future__ import annotations

import hashlib
import itertools
import logging
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from collections.abc import Mapping as PlainMapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.arguments import as_path, check_choice, check_class
from shipid.data.dataset import (
    BREAK,
    STANDARD_DEVIATIONS,
    Array,
    Dataset,
    clock_slack,
    optional_columns,
    required_columns,
    unit_of_column,
    units_of_columns,
)
from shipid.data.kinematics import Noise, smooth_motion
from shipid.errors import DataError, is_utf_8, suggest_name
from shipid.logs.cells import CODES, decode_numbers, log_column, of_curve, parse_numbers
from shipid.logs.channels import (
    Channel,
    close_gaps,
    common_instants,
    interpolation_rule,
    resample_channel,
)
from shipid.logs.dates import format_moment, format_span
from shipid.logs.frames import check_wraps, in_body, project_positions, true_wind, unwrap_angles
from shipid.logs.instants import read_clock, read_time_column, without_repeats
from shipid.logs.mapping import (
    LogSource,
    Mapping,
    PlaneOrigin,
    RunParts,
    read_mapping,
    side_letters,
    source_columns,
    to_si,
)
from shipid.logs.readers import Progress, read_log_table, require_file
from shipid.logs.repairs import (
    FLAGS,
    INPUTS,
    REPAIRS,
    Break,
    Despike,
    Latency,
    Records,
    Repair,
    ScaleRepair,
    WrapInterpolation,
    apply_repairs,
)
from shipid.physics.signals import is_command, is_output

__all__ = ["file_digest", "import_log", "log_digest", "read_mapping", "run_files"]

logger = logging.getLogger(__name__)
_STEERING = r"[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]"
_UNSAFE = re.compile(rf"^(?:(?:{_STEERING}|\s)*(?:[=@]|[+-](?!\d[\w .+-]*$)))+|{_STEERING}")
LIMITS = {"s": 1e12, "m": 1e8, "m/s": 200.0, "rad": 1e6, "rad/s": 100.0, "rev/s": 1e4, "N": 1e10, "N m": 1e12, "-": 1e4}
"""SI unit of a column -> the largest number that a ship may have: far beyond any, so that a wrong unit may pass."""
Begins = list[tuple[float, str]]


@dataclass(frozen=True)
class ImportedLog:
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
    north and east, and directions to the north of that plane, gaps, speed and course or earth-fixed to body velocities,
    the other repairs in the order of the mapping, estimation of u, v, r, apparent to true wind, runs.
    `metadata["repairs"]` counts every repair, `flags` marks its rows.

    file : the log; with `source.runs`, the folder of its files. without : kinds of repair to leave out.
    progress : called with the share of a large log that has been read, 0 to 1.
    Raises DataError with the log, the row or the key of the mapping, and what would be right.
    """
    check_class("mapping", mapping, Mapping, "as of `read_mapping`", DataError)
    source, off = as_path("file", file, DataError), tuple(without)
    for kind in off:
        check_choice("repair", kind, REPAIRS, DataError)
    digest, state = log_digest(mapping, source), _state_of_files(mapping, source)
    if mapping.source.sha256 not in (None, digest):
        raise DataError(
            "not the file this mapping was written for (sha256 differs): fetch that file, or copy the mapping, "
            "check its repairs and segments, and remove [source] sha256",
            file=source,
            path="source.sha256",
        )
    logs = run_files(mapping.source, source)
    each: list[tuple[str, ImportedLog]] = []
    for run, log, table in _run_tables(mapping, logs, progress):
        each.append((run, _import_table(mapping, log, table, off)))
        if mapping.origin is None and (first := each[0][1].origin) is not None:  # that of all runs
            mapping = mapping.model_copy(
                update={"origin": PlaneOrigin.model_construct(latitude=first[0], longitude=first[1])}
            )
    if (digest, state) != (log_digest(mapping, source), _state_of_files(mapping, source)):  # or a link led elsewhere
        raise DataError("has changed while it was read: import it again when nothing writes to it", file=source)
    parts, alone = [part for _, part in each], mapping.source.runs is not None or len(each) > 1
    rows, repairs = parts[0].rows, _add_records([part.records for part in parts])
    written = {
        name: {"unit": column.unit, "size": to_si(column.unit, name), "offset": column.offset}
        for name, column in mapping.columns.items()
    }
    metadata = {
        "vessel": mapping.vessel,
        "source": {**mapping.source.model_dump(exclude_defaults=True), "log": source.name, "sha256": digest},
        "mapping": {"name": mapping.name, "digest": mapping.digest, "columns": written},
        "rows": sum(part.read for part in parts),
        "clock": "run" if alone else "shared",
        "units": units_of_columns(rows.columns),
        "flags": list(FLAGS),
        "repairs": repairs,
    }
    if parts[0].origin is not None:
        metadata["origin"] = dict(zip(("latitude", "longitude"), parts[0].origin, strict=True))
    kinds = {segment.run: segment.manoeuvre for segment in mapping.segment if segment.manoeuvre is not None}
    if mapping.parts is not None:
        pieces = [piece for run, part in each for piece in _split_runs(part, run)]
    else:
        pieces, outside = _runs_of_segments(mapping, each, logs)
        repairs += outside
    names = distinct_names(name for name, _ in pieces)
    frames = [_name_run(rows, name) for name, (_, rows) in zip(names, pieces, strict=True)]
    frame = frames[0] if len(frames) == 1 else pd.concat(frames, ignore_index=True)
    kinds |= {run: kind for run, kind in mapping.source.manoeuvres.items() if run in set(frame["run"])}
    metadata |= {"manoeuvres": kinds} if kinds else {}
    return Dataset(frame, metadata)


def run_files(source: LogSource, log: Path) -> dict[str, Path]:
    """Run -> file: every file of the folder that fits `source.runs`; without that pattern, the log itself."""
    if source.runs is None:
        if log.is_dir():
            raise DataError(
                'cannot be read: a folder, and the mapping reads one file; for a file a run write runs = "*.csv"',
                file=log,
                path="source.runs",
            )
        return {clean_name(log.stem): log}
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
    names = distinct_names([run_name(file, log, source.runs) for file in files])
    return dict(zip(names, files, strict=True))


def run_name(file: Path, folder: Path, pattern: str) -> str:
    """The name of the run in a file: the text that a single star matches, else its path without ending; clean."""
    if pattern.count("*") == 1 and "/" not in pattern:
        before, _, after = pattern.partition("*")
        return clean_name(file.name.removeprefix(before).removesuffix(after))
    return clean_name(file.relative_to(folder).with_suffix("").as_posix())


def clean_name(name: str) -> str:
    """A name of a run without characters that steer a terminal, and without a begin that makes it a formula in a sheet.

    A number with its sign stays.
    """
    return _UNSAFE.sub("", name) or "run"


def log_digest(mapping: Mapping, log: Path) -> str:
    """The SHA-256 of the log in hex; for several files, the SHA-256 of their SHA-256s joined."""
    digests = [file_digest(file) for file in _files_of_log(mapping, log)]
    several = mapping.source.runs is not None or mapping.file
    return hashlib.sha256("".join(digests).encode()).hexdigest() if several else digests[0]


def _files_of_log(mapping: Mapping, log: Path) -> list[Path]:
    return [*run_files(mapping.source, log).values(), *(log.parent / entry.path for entry in mapping.file.values())]


def _state_of_files(mapping: Mapping, log: Path) -> list[tuple[int, int]]:
    """Number and time of change [ns] of files and of links on the way to them: a change that was taken back differs."""
    files = _files_of_log(mapping, log)
    links = [place.lstat() for file in files for place in (file, *file.absolute().parents) if place.is_symlink()]
    return [(state.st_ino, state.st_ctime_ns) for state in (*links, *(file.stat() for file in files))]


def file_digest(file: Path) -> str:
    """The SHA-256 of a file in hex; raises DataError if it cannot be read."""
    require_file(file)
    try:
        with file.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", file=file) from None


def _run_tables(
    mapping: Mapping, logs: PlainMapping[str, Path], progress: Progress | None
) -> Iterator[tuple[str, Path, pd.DataFrame]]:
    """Yield name, file and rows of each log; those of each run separately where the clock begins again with a run."""
    here = {name for column in mapping.columns.values() if not column.file for name in source_columns(column.source)}
    here |= {*mapping.clock.sources}
    here |= {mapping.parts.source} if mapping.parts is not None and mapping.parts.source is not None else set()
    whole_rows = mapping.clock.repeated == "drop" and mapping.clock.every is not None  # compared in all columns
    for run, file in logs.items():
        log = read_log_table(file, mapping.format, mapping.clock.sources[0], () if whole_rows else here, progress)
        first = 0
        for end in [*_clock_restart_rows(log, mapping, file), len(log)]:
            part = log.iloc[first:end] if first or end < len(log) else log
            part.attrs = {} if first else log.attrs
            yield run, file, part
            first = end


def _clock_restart_rows(log: pd.DataFrame, mapping: Mapping, file: Path) -> list[int]:
    """Rows of a log at which a run begins with another clock; none where time goes back within a run, too."""
    if mapping.parts is None or mapping.parts.source is None or mapping.file:
        return []
    t, texts = (
        read_time_column(log, mapping.clock, mapping.format, file, "clock"),
        _run_texts(log, mapping.parts.source, file),
    )
    changed = np.append(False, texts[1:] != texts[:-1])
    back = np.append(False, np.diff(t) < 0)
    return np.flatnonzero(changed).tolist() if back.any() and not (back & ~changed).any() else []


def _comes_first(repair: Repair, fixed: bool, read: set[str]) -> bool:
    """Whether a repair mends columns that become others, or the heading by which velocities over ground are turned.

    fixed : whether there are such. read : names of the columns that the log has.
    """
    if not isinstance(repair, Despike | ScaleRepair):
        return False
    mended = {*repair.columns}
    turns = fixed and isinstance(repair, Despike) and "psi" in mended and not {"u", "v"} & mended and mended <= read
    return repair.of_inputs or turns


def _check_breaks(mapping: Mapping, t: Array, off: tuple[str, ...], file: Path) -> None:
    """Raise DataError for an interval of a break that no time t (N,) [s] of a log reaches: its clock is another one."""
    alone = mapping.source.runs is None and mapping.parts is None and BREAK not in off
    for index, repair in enumerate(mapping.repair if alone else ()):
        for start, end in repair.intervals if isinstance(repair, Break) and repair.enabled else ():
            if end < t[0] or start > t[-1]:
                raise DataError(
                    f"{format_span(start, end)} is not in the log, which has {format_span(t[0], t[-1])}",
                    file=file,
                    path=f"repair.{index}.intervals",
                )


def _run_texts(log: pd.DataFrame, source: str, file: Path) -> NDArray[np.object_]:
    """The column that says the run, as texts (N,); whole numbers without a point."""
    column = log_column(log, source, file, "parts.from").ffill().bfill()
    if pd.api.types.is_float_dtype(column.dtype) and (column == column.round()).all():
        column = column.astype("int64")
    return np.asarray(column.astype(str).str.strip().to_numpy(dtype=object))


def _import_table(mapping: Mapping, file: Path, log: pd.DataFrame, off: tuple[str, ...]) -> ImportedLog:
    rows, first, read, begins = _mapped_columns(mapping, file, log)
    t, numbered = rows["t"].to_numpy(), None if mapping.resamples else rows.index
    turns = [name for name, column in mapping.columns.items() if column.wrap or column.direction == "from"]
    _check_limits(rows[["t", *turns]], t, numbered, file)  # unwrapped, any number is an angle
    _check_breaks(mapping, t, off, file)
    wrapping = [repair for repair in mapping.repair if isinstance(repair, WrapInterpolation)]
    fixed = "speed" in mapping.columns or ("u" in mapping.columns and mapping.columns["u"].frame == "earth")
    early = [repair for repair in mapping.repair if _comes_first(repair, fixed, {*mapping.columns})]
    others = [repair for repair in mapping.repair if repair not in [*wrapping, *early]]
    rows, records = apply_repairs(rows, wrapping, off, file)
    rows = unwrap_angles(rows, mapping, file)
    rows, mended = apply_repairs(rows, early, off, file)
    records += mended
    origin = None
    if "latitude" in rows:
        rows, turned, origin = project_positions(rows, mapping, file)
        records += turned
    rows, gaps = close_gaps(rows, mapping.clock.max_gap, file)
    rows = in_body(rows, mapping.columns)
    others = [
        repair.model_copy(update={"turn": fixed}) if isinstance(repair, Latency) and repair.turn is None else repair
        for repair in others
    ]
    rows, more = apply_repairs(rows, others, off, file)
    _check_limits(rows, t, numbered, file)  # which would overflow in the filter
    rows, estimated = _estimate_velocities(rows, mapping, file) if mapping.estimate is not None else (rows, [])
    relative = mapping.columns["beta_w"].relative if "beta_w" in mapping.columns else False
    if relative == "angle":
        rows = rows.assign(beta_w=rows["beta_w"] + rows["psi"])
    elif relative:
        rows = true_wind(rows)
    known = [name for name in (*required_columns(), *optional_columns()) if name in rows]
    commands = [str(name) for name in rows.columns if is_command(str(name))]
    outputs = [str(name) for name in rows.columns if is_output(str(name))]
    _check_limits(rows, t, numbered, file)
    order = (
        [*known, *commands, *outputs, "flags"]
        if mapping.resamples or "latitude" in mapping.columns
        else list(rows.columns)
    )
    return ImportedLog(
        rows[order].reset_index(drop=True), first + records + gaps + more + estimated, read, origin, begins
    )


def _check_limits(rows: pd.DataFrame, t: Array, numbered: pd.Index[int] | None, file: Path) -> None:
    """Raise DataError for a value that no ship has; t (N,) [s] and `numbered` are times and places of its rows."""
    for name in map(str, rows.columns.drop("flags", errors="ignore")):
        unit, values = str(INPUTS.get(name) or unit_of_column(name)), rows[name].to_numpy()
        if not (np.fmax.reduce(values) > LIMITS[unit] or np.fmin.reduce(values) < -LIMITS[unit]):  # past NaN, fast
            continue
        place = int(np.argmax(np.abs(values) > LIMITS[unit]))
        at = rows["t"].iloc[place]
        raise DataError(
            f"{name} is {values[place]:.4g} {unit} at {format_moment(at)}, and no ship has more than {LIMITS[unit]:g}: "
            "is the unit right? List what stands for a missing value in [format] missing, or mend it by a despike",
            file=file,
            path=f"columns.{name}" if numbered is None else f"row {int(numbered[np.searchsorted(t, at)]) + 1}",
        )


def _add_records(parts: list[Records]) -> Records:
    """The records of all files; counts of one kind and column are added up."""
    alike: dict[tuple[str, str, int], Records] = {}
    for records in parts:
        seen = Counter[tuple[str, str]]()
        for record in records:
            key = (record["kind"], record["column"])
            alike.setdefault((*key, seen[key]), []).append(record)
            seen[key] += 1
    notes = [{one["note"] for one in same} for same in alike.values()]
    return [
        {**same[0], "count": sum(one["count"] for one in same), "note": f"over {len(parts)} files"}
        | ({"note": same[0]["note"]} if len(said) == 1 else {})
        for same, said in zip(alike.values(), notes, strict=True)
    ]


def _mapped_columns(mapping: Mapping, file: Path, log: pd.DataFrame) -> tuple[pd.DataFrame, Records, int, Begins]:
    """Columns `t`, those of the mapping in SI units, NaN where a value is missing, and `flags` = 0; begins of runs."""
    records = _skipped_line_records(log)
    if mapping.clock.repeated == "drop":
        log, more = without_repeats(log, mapping.clock, mapping.format, file)
        records += more
    t = read_clock(log, mapping.clock, mapping.format, file, "clock")
    begins = _run_begins(log, t, mapping.parts, file) if mapping.parts is not None else []
    files = {"": (log, t, mapping.format, file)}
    for name, entry in mapping.file.items():
        other = file.parent / entry.path
        needed = [
            one for column in mapping.columns.values() if column.file == name for one in source_columns(column.source)
        ]
        table = read_log_table(other, entry.format, entry.clock.sources[0], [*entry.clock.sources, *needed])
        times = read_clock(table, entry.clock, entry.format, other, f"file.{name}.clock")
        files[name] = (table, times, entry.format, other)
        records += _skipped_line_records(table)
    channels: dict[str, Channel] = {}
    for name, column in mapping.columns.items():
        table, _, _, other = files[column.file or ""]
        for source in source_columns(column.source):
            log_column(table, source, other, f"columns.{name}.from")
    uses = Counter(
        (one.file or "", source) for one in mapping.columns.values() for source in source_columns(one.source)
    )
    for name, column in mapping.columns.items():
        table, times, form, other = files[column.file or ""]
        sides = side_letters(name) if column.unit == "deg" and isinstance(column.source, str) else ""
        place = f"columns.{name}.from"
        parts = [
            parse_numbers(table, one, form, other, place, sides, column.missing)
            for one in source_columns(column.source)
        ]
        parts = [np.where(np.isin(one, column.missing), np.nan, one) for one in parts] if column.missing else parts
        names, coded = source_columns(column.source), column.unit in CODES and (column.unit != "deg" or len(parts) > 1)
        numbers = decode_numbers(parts, names, column.unit, table, other, place) if coded else parts[0]
        if column.curve is not None:
            numbers = of_curve(numbers, column.curve, table, other, f"columns.{name}.curve")
        size = to_si(column.unit, name)
        factor = column.sign * column.factor * size
        values = numbers * factor if factor != 1.0 else numbers
        for source in source_columns(column.source):
            uses[column.file or "", source] -= 1
            if not uses[column.file or "", source]:
                table.pop(source)  # of a large log there is room for one copy only
        values = values + column.offset * size if column.offset else values
        channels[name] = (times - column.latency if column.latency else times, values)
    read = len(log)
    if mapping.resamples:
        gap = mapping.clock.max_gap or np.inf
        for name, (times, values) in channels.items():  # afterwards the jump is not seen: it is between two instants
            if mapping.columns[name].interpolation != "angle":
                check_wraps(times, values, name, mapping.columns[name], gap, file)
        how = {name: interpolation_rule(name, column) for name, column in mapping.columns.items()}
        held = {name for name in channels if how[name] == "previous"}
        t = common_instants(channels, held, t, mapping.clock.step, file)
        columns = {name: resample_channel(t, *channels[name], how[name], gap) for name in channels}
        notes = [(name, f"{how[name]}, latency {column.latency:g} s") for name, column in mapping.columns.items()]
        records += [{"kind": "resampled", "column": name, "count": len(t), "note": note} for name, note in notes]
    else:
        columns = {name: values for name, (_, values) in channels.items()}
    flags, numbered = np.zeros(len(t), dtype=np.int64), None if mapping.resamples else log.index
    rows = pd.DataFrame({"t": t, **columns, "flags": flags}, index=numbered, copy=False)
    return rows, records, read, begins


def _run_begins(log: pd.DataFrame, t: NDArray[np.float64], parts: RunParts, file: Path) -> Begins:
    """Where runs begin in the rows of a log at t (N,) [s]: after a pause, or where the column changes."""
    new = np.append(True, np.diff(t) > (np.inf if parts.pause is None else parts.pause))
    if parts.source is None:
        return [(float(t[row]), str(number)) for number, row in enumerate(np.flatnonzero(new), 1)]
    texts = _run_texts(log, parts.source, file)
    new |= np.append(True, texts[1:] != texts[:-1])
    return [(float(t[row]), str(texts[row])) for row in np.flatnonzero(new)]


def _skipped_line_records(table: pd.DataFrame) -> Records:
    count = int(table.attrs.get("unreadable", 0))
    note = "no NMEA 0183 sentence, or its checksum fails"
    records: Records = [{"kind": "unreadable", "column": "", "count": count, "note": note}] if count else []
    ragged = table.attrs.get("ragged", [])
    note = (
        f"lines that repeat the header or have another number of cells, the first is line {ragged[0]}" if ragged else ""
    )
    return [*records, {"kind": "ragged", "column": "", "count": len(ragged), "note": note}] if ragged else records


def _estimate_velocities(rows: pd.DataFrame, mapping: Mapping, file: Path) -> tuple[pd.DataFrame, Records]:
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
            at = format_moment(stretch["t"].iloc[0])
            raise DataError(f"a single row between two breaks at {at}: nothing to estimate from; remove it", file=file)
        logged = {name: stretch[name].to_numpy() for name in ("north", "east", "psi", "u", "v", "r") if name in rows}
        smoothed = smooth_motion(stretch["t"].to_numpy(), logged, noise)
        squares += smoothed.consistency * len(stretch)
        columns = {name: smoothed.state(name) for name in lacking}
        columns |= {STANDARD_DEVIATIONS[name]: smoothed.deviation(name) for name in lacking}
        parts.append(stretch.assign(**columns))
    note = f"innovations {np.sqrt(squares / len(rows)):.2f} times as large as the noise declared (1 if it fits)"
    records = [{"kind": "estimated", "column": ", ".join(lacking), "count": len(rows), "note": note}]
    return pd.concat(parts, ignore_index=True), records


def _runs_of_segments(
    mapping: Mapping, each: list[tuple[str, ImportedLog]], logs: PlainMapping[str, Path]
) -> tuple[list[tuple[str, pd.DataFrame]], Records]:
    """Name and rows of the segments of each log, of a whole log where it has none; rows in none are counted.

    Rows that belong to two segments are repeated.
    """
    unit, left, whole = to_si(mapping.clock.unit, "t"), 0, logs.keys() - {cut.file for cut in mapping.segment}
    for index, one in enumerate(mapping.segment if mapping.source.runs is not None else ()):
        file, path = next(iter(logs.values())).parent, f"segment.{index}"
        if one.file not in logs:
            remedy = suggest_name(str(one.file), logs)
            raise DataError(f"no file {one.file!r}: {remedy}", file=file, path=f"{path}.file")
        if one.run in whole:
            raise DataError(f"a run {one.run!r} exists, a whole file: take another name", file=file, path=path)
    pieces: list[tuple[str, pd.DataFrame]] = []
    for run, part in each:
        rows, t = part.rows, part.rows["t"].to_numpy()
        slack, step, outside = clock_slack(t), float(np.median(np.diff(t))), np.ones(len(t), dtype=bool)
        inside = [(index, one) for index, one in enumerate(mapping.segment) if one.file in (None, run)]
        for index, segment in inside:
            start, end = segment.start * unit, segment.end * unit
            kept = (t >= start - slack) & (t <= end + slack)
            if start < t[0] - step - slack or end > t[-1] + step + slack or kept.sum() < 2:
                message = f"run {segment.run!r}, {format_span(start, end)}, is not in the log, "
                message += f"which has {format_span(t[0], t[-1])}"
                raise DataError(message, file=logs[run], path=f"segment.{index}")
            pieces.append((segment.run, rows if kept.all() else rows.loc[kept].reset_index(drop=True)))
            outside &= ~kept
        if not inside:
            pieces.append((run, rows))
        left += int(outside.sum()) * bool(inside)
    note = f"of {sum(len(part.rows) for _, part in each)} rows: in no segment"
    return pieces, [{"kind": "left out", "column": "", "count": left, "note": note}] if left else []


def _split_runs(log: ImportedLog, name: str) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield name and rows of the runs of a log, each after its name in it; a run of a single row is no run."""
    t = log.rows["t"].to_numpy()
    starts = np.array([start for start, _ in log.begins])
    number = np.searchsorted(starts, t + clock_slack(t), side="right") - 1
    for index, (_, run) in enumerate(log.begins):
        rows = log.rows.loc[number == index]
        if len(rows) > 1:
            yield f"{name} {clean_name(run)}", rows.reset_index(drop=True)


def distinct_names(names: Iterable[str]) -> list[str]:
    """Names with a number after one that was there already."""
    taken: dict[str, None] = {}
    for name in names:
        numbered = (f"{name} ({number})" for number in itertools.count(2))
        taken[name if name not in taken else next(one for one in numbered if one not in taken)] = None
    return list(taken)


def _name_run(rows: pd.DataFrame, run: str) -> pd.DataFrame:
    named = rows.copy(deep=False)
    named.insert(0, "run", pd.Series(run, index=rows.index, dtype="str"))
    return named
