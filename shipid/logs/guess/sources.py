"""What a guess reads: one file, a folder, or a glob; several files are one source of several runs."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shipid.data.dataset import Array
from shipid.errors import DataError, ShipidError
from shipid.logs.guess.sniff import SAMPLE, LogTable, recognise_log
from shipid.logs.guess.words import is_run
from shipid.logs.importing import run_name
from shipid.logs.kinds import kind_in_name

ENDINGS = (
    *(".csv", ".txt", ".dat", ".log", ".tsv", ".asc", ".xlsx", ".ods", ".parquet", ".mat", ".nmea"),
    *(".bag", ".mcap", ".db3", ".ulg", ".bin"),
)
PAUSE, MOST = 1e4, 24  # s between two files; files that decide, spread over all
STOPPED, FEWEST, HELD = 20.0, 10.0, 10  # usual steps, and s, of a pause between two runs; rows of a run


@dataclass(frozen=True)
class GuessFiles:
    """The files of a guess.

    path : the file, or the folder. pattern : key `runs` of [source]; None for a single file. files : run -> file.
    skipped : files left out, with the reason. manoeuvres : run -> kind. parts : keys of [parts]; else empty.
    held : runs that this gives. sniffed : all rows, as of one log.
    """

    path: Path
    pattern: str | None
    files: dict[str, Path]
    skipped: dict[str, str]
    manoeuvres: dict[str, str]
    parts: dict[str, Any]
    held: int
    sniffed: LogTable


def read_source(path: Path, names: tuple[str, ...] = ()) -> GuessFiles:
    """Read a file, a folder or a glob (`trials/*/ZZ*.csv`); `names` are the columns of files without a header.

    Raises DataError where no file can be read as a log; each is named with its reason.
    """
    folder, patterns = _file_patterns(path)
    if not patterns:
        log = recognise_log(path, names)
        parts, held = _parts_of_runs({path: log}, by_pause=False)
        return GuessFiles(path, None, {path.stem: path}, {}, {}, parts, held, log)
    sniffed: dict[Path, LogTable] = {}
    skipped: dict[str, str] = {}
    taken = ""
    for pattern in patterns:  # a folder of one log and a readme has two endings: that of the log is taken
        for file in sorted(filter(Path.is_file, folder.glob(pattern))):
            try:
                if taken:
                    raise DataError(f"the logs are files {taken!r}")
                sniffed[file] = recognise_log(file, names)
            except ShipidError as error:
                skipped[file.relative_to(folder).as_posix()] = error.message
        taken = taken or pattern * bool(sniffed)
    if not sniffed:
        first, why = next(iter(skipped.items()), ("no file", f"none is called {patterns[-1]!r}"))
        more = f"; so are {len(skipped) - 1} others" if len(skipped) > 1 else ""
        raise DataError(f"no file of this folder can be read: {first}: {why}{more}", file=folder)
    if _are_channels(sniffed):
        longest = max(sniffed, key=lambda file: len(sniffed[file].t))
        log = _join_channels(longest, sniffed)
        return GuessFiles(longest, None, {longest.stem: longest}, skipped, {}, {}, 0, log)
    kept = _files_alike(sniffed, folder, skipped)
    runs = {run_name(file, folder, taken): file for file in kept}
    kinds = {run: kind for run, file in runs.items() if (kind := kind_in_name(file.stem))}
    parts, held = _parts_of_runs(kept, by_pause=True)
    return GuessFiles(folder, taken, runs, skipped, kinds, parts, held, _join_files(list(kept.values())))


def _parts_of_runs(logs: dict[Path, LogTable], *, by_pause: bool) -> tuple[dict[str, Any], int]:
    """Keys of [parts] for files of several runs, and the number of runs; nothing, 0 where each holds one."""
    first = next(iter(logs.values()))
    begun = [log.runs for log in logs.values() if log.runs]
    if begun:
        return {"from": next(iter(begun[0]))}, sum(sum(log.runs.values()) or 1 for log in logs.values())
    told = [name for name in first.columns if is_run(name) and all(_is_held(name, log) for log in logs.values())]
    column = next((name for name in told if any(np.ptp(log.columns[name]) > 0 for log in logs.values())), None)
    steps = [np.diff(log.t) for file, log in logs.items() if file.stat().st_size <= SAMPLE] if by_pause else []
    usual = float(np.median(np.concatenate(steps))) if steps else 0.0
    long = max(STOPPED * usual, FEWEST)
    pauses = np.concatenate([part[part > long] for part in steps]) if steps else np.empty(0)
    keys: dict[str, Any] = {"from": column} if column is not None else {}
    if len(pauses):
        rest = max((float(part[part <= long].max()) for part in steps if np.any(part <= long)), default=usual)
        keys["pause"] = float(f"{np.sqrt(rest * float(pauses.min())):.2g}") if rest > 0 else long
        keys["pause"] = max(keys["pause"], float(f"{rest:.2g}") + usual)
    if not keys:
        return {}, 0
    return keys, sum(_count_runs(log, column, keys.get("pause", np.inf)) for log in logs.values())


def _is_held(name: str, log: LogTable) -> bool:
    """Whether a column has whole values, each in a long stretch of rows."""
    values = log.columns.get(name)
    if values is None or not np.isfinite(values).all() or np.any(values % 1):
        return False
    stretches = np.diff(np.flatnonzero(np.concatenate([[True], np.diff(values) != 0, [True]])))
    return bool(np.median(stretches) >= HELD)


def _count_runs(log: LogTable, column: str | None, pause: float) -> int:
    new = np.diff(log.t) > pause
    return 1 + int(np.sum(new | (np.diff(log.columns[column]) != 0) if column is not None else new))


def _file_patterns(path: Path) -> tuple[Path, list[str]]:
    """Folder and patterns of a folder or glob, that of most files first; a file has no pattern."""
    text = path.as_posix()
    if "*" in text and not path.exists():
        folder, slash, _ = text[: text.index("*")].rpartition("/")
        return Path(folder or ("/" if slash else ".")), [text[len(folder) + len(slash) :]]
    if not path.is_dir():
        return path, []
    logs = [file for file in path.rglob("*") if file.is_file() and file.suffix.lower() in ENDINGS]
    if not logs:
        raise DataError(f"cannot be read: a folder without a log ({', '.join(ENDINGS)})", file=path)
    endings = dict.fromkeys(file.suffix for file in logs)
    files = {ending: [file for file in logs if file.suffix == ending] for ending in endings}
    size = {ending: (len(some), sum(file.stat().st_size for file in some)) for ending, some in files.items()}
    deep = {ending: "" if all(file.parent == path for file in some) else "**/" for ending, some in files.items()}
    return path, [
        f"{deep[ending]}*{ending}" for ending in sorted(endings, key=lambda ending: size[ending], reverse=True)
    ]


def _files_alike(sniffed: dict[Path, LogTable], folder: Path, skipped: dict[str, str]) -> dict[Path, LogTable]:
    """The files of the commonest columns and format; the others are skipped with a reason."""

    def written(log: LogTable) -> tuple[object, ...]:
        form = {key: value for key, value in log.form.items() if key not in ("ragged", "missing", "thousands")}
        unit = (str(log.clock["from"]), log.clock["unit"])
        return (*sorted((key, str(value)) for key, value in form.items()), unit)

    commonest = Counter(written(log) for log in sniffed.values()).most_common(1)[0][0]
    kept = {file: log for file, log in sniffed.items() if written(log) == commonest}
    wanted = Counter(name for log in kept.values() for name in log.columns)
    names = {name for name, count in wanted.items() if count > len(kept) / 2}
    for file, log in sniffed.items():
        lacking = sorted(names - set(log.columns))
        if lacking or file not in kept:
            reason = f"lacks {', '.join(map(repr, lacking[:3]))}, which the others have"
            if kept.pop(file, None) is None:
                reason = "written otherwise than the others (separator, decimal sign, encoding, header or clock)"
            skipped[file.relative_to(folder).as_posix()] = f"{reason}: guess it alone"
    if not kept:
        raise DataError("no two files have the same columns: guess them one by one", file=folder)
    return kept


def _are_channels(sniffed: dict[Path, LogTable]) -> bool:
    """Whether the files of a folder are of the same time, and most of their columns are in one of them alone."""
    logs = [*sniffed.values()]
    names = Counter(name for log in logs for name in log.columns)
    shared = min(log.t[-1] for log in logs) - max(log.t[0] for log in logs)
    alone = sum(count == 1 for count in names.values()) > len(names) / 2
    together = len({file.parent for file in sniffed}) == 1 < len(logs)
    return alone and together and shared > max(float(np.ptp(log.t)) for log in logs) / 2


def _join_channels(file: Path, logs: dict[Path, LogTable]) -> LogTable:
    """The columns of a file and of others of its time, each at its own instants; a second of a name gets its file's."""
    first, others = logs[file], {other: log for other, log in logs.items() if other != file}
    t = np.unique(np.concatenate([log.t for log in logs.values()]))
    columns, channels = dict[str, Array](), dict[str, tuple[Path, LogTable]]()
    in_parts, fillers = dict(first.in_parts), dict(first.fillers)
    for other, log in {file: first, **others}.items():
        rows = np.searchsorted(t, log.t)
        for name, values in log.columns.items():
            new = f"{other.stem} {name}" if name in columns else name
            columns[new] = np.full(len(t), np.nan)
            columns[new][rows] = values
            channels |= {new: (other, log)} if other != file else {}
            in_parts |= {new: log.in_parts.get(name, (name,))} if new != name or name in log.in_parts else {}
            fillers |= {new: log.fillers[name]} if name in log.fillers else {}
    names = ", ".join(other.name for other in others)
    notes = (*first.notes, f"files of the same time are channels of one log: import {file.name}, {names} belong to it")
    doubts = first.doubts
    if first.t[0] < np.ptp(first.t):
        doubts += (f"do the clocks of the files begin at one moment? {file.name}, {names} are read so",)
    joined = replace(first, t=t, columns=columns, channels=channels, notes=notes, doubts=doubts)
    return replace(joined, in_parts=in_parts, fillers=fillers)


def _join_files(logs: list[LogTable]) -> LogTable:
    """The rows of several files one after another, `PAUSE` s apart; those of one file by its clock."""
    first = logs[0]
    if len(logs) == 1:
        return first
    chosen = logs if len(logs) <= MOST else [logs[i] for i in np.linspace(0, len(logs) - 1, MOST).astype(int)]
    names = [name for name in first.columns if all(name in log.columns for log in chosen)]
    starts = np.cumsum([0.0, *(float(np.ptp(log.t)) + PAUSE for log in chosen)])
    t = np.concatenate([log.t - log.t[0] + start for log, start in zip(chosen, starts, strict=False)])
    columns = {name: np.concatenate([log.columns[name] for log in chosen]) for name in names}
    form = first.form | ({"ragged": "drop"} if any(log.form.get("ragged") for log in logs) else {})
    form |= next(({"thousands": log.form["thousands"]} for log in logs if "thousands" in log.form), {})
    missing = dict.fromkeys(text for log in logs for text in log.form.get("missing", ()))
    form |= {"missing": list(missing)} if missing else {}
    fillers = {name: [x for log in logs for x in log.fillers.get(name, ())] for name in names}
    rates = [log.clock["every"] for log in logs if "every" in log.clock]
    clock = first.clock | ({"every": float(np.median(rates))} if rates else {})
    clock |= {"repeated": "drop"} if any("repeated" in log.clock for log in logs) else {}
    return replace(
        first,
        form=form,
        clock=clock,
        t=t,
        columns=columns,
        fillers=fillers,
        notes=tuple(dict.fromkeys(note for log in logs for note in log.notes)),
        doubts=tuple(dict.fromkeys(doubt for log in logs for doubt in log.doubts)),
        seams=sum(log.seams for log in chosen) + len(chosen) - 1,
        sides=frozenset[str]().union(*(log.sides for log in logs)),
    )
