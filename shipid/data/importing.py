"""Import of a log by a declared mapping: text to SI columns, repairs, gaps, runs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.data.dataset import BREAK, Dataset, clock_slack, is_command, pieces, sample, units_of
from shipid.data.mapping import Column, Format, Mapping, Segment, read_mapping, to_si
from shipid.data.repairs import FLAGS, REPAIRS, WrapInterpolation, apply_repairs, interpolate_at
from shipid.errors import DataError, choices

__all__ = ["import_log", "read_log", "read_mapping", "sha256_of"]


def import_log(mapping: Mapping, file: str | Path, *, without: Iterable[str] = ()) -> Dataset:
    """Turn a log into a dataset as its mapping declares; nothing is mended that is not declared.

    Order: units, repair of wrapping channels, unwrapping, earth to body velocities, gaps, the other repairs in the
    order of the mapping, runs, resampling. `metadata["repairs"]` counts every repair, `flags` marks its rows.

    Parameters
    ----------
    mapping : what the columns are, from `read_mapping`.
    file : the log.
    without : kinds of repair to leave out.

    Raises
    ------
    DataError : with the log, the row or the key of the mapping, and what would be right.
    """
    source, off = Path(file), tuple(without)
    for kind in off:
        if kind not in REPAIRS:
            raise DataError(f"no repair of this kind: {choices(kind, REPAIRS)}", path=kind)
    digest = sha256_of(source)
    if mapping.source.sha256 not in (None, digest):
        raise DataError(
            "not the file this mapping was written for (sha256 differs): fetch that file, or copy the mapping, "
            "check its repairs and segments, and remove [source] sha256",
            file=source,
            path="source.sha256",
        )
    log = read_log(source, mapping.format)
    rows = _columns(log, mapping, source)
    wrapping = [repair for repair in mapping.repair if isinstance(repair, WrapInterpolation)]
    others = [repair for repair in mapping.repair if not isinstance(repair, WrapInterpolation)]
    rows, records = apply_repairs(rows, wrapping, off)
    rows = _turn(rows, mapping.columns)
    rows, gaps = _close_gaps(rows, mapping.clock.max_gap, source)
    rows, more = apply_repairs(rows, others, off)
    metadata = {
        "vessel": mapping.vessel,
        "source": {**mapping.source.model_dump(exclude_none=True), "log": source.name, "sha256": digest},
        "mapping": {"name": mapping.name, "digest": mapping.digest},
        "rows": len(log),
        "clock": "shared",
        "units": units_of(rows.columns),
        "flags": list(FLAGS),
        "repairs": records + gaps + more,
    }
    segments = mapping.segment or (_whole(rows, mapping, source),)
    dataset = Dataset(_cut(rows, segments, to_si(mapping.clock.unit, "t"), source), metadata)
    return _resampled(dataset, mapping.resample.step) if mapping.resample else dataset


def sha256_of(file: Path) -> str:
    """SHA-256 of a file, in hex; raises DataError if it cannot be read."""
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror})", file=file) from None


def read_log(file: Path, form: Format) -> pd.DataFrame:
    """Read a delimited text log as columns of text, named by its header or by `form.names`."""
    if file.stat().st_size == 0:
        raise DataError("the file is empty", file=file)
    with file.open("rb") as stream:
        if b"\0" in stream.read(4096) and not form.encoding.startswith(("utf-16", "utf-32")):
            raise DataError(
                "holds NUL bytes: binary, or UTF-16 text; export it as text or set the encoding",
                file=file,
                path="format.encoding",
            )
    try:
        table = pd.read_csv(
            file,
            sep=r"\s+" if form.separator == "whitespace" else form.separator,
            encoding=form.encoding,
            skiprows=form.skip_rows,
            comment=form.comment,
            header=None,
            dtype=str,
            keep_default_na=False,
        )
    except UnicodeDecodeError as error:
        message = f"not {form.encoding} text (byte {error.start}): set the encoding it was saved in, often cp1252"
        raise DataError(message, file=file, path="format.encoding") from None
    except pd.errors.EmptyDataError:
        message = f"nothing is left after {form.skip_rows} skipped lines"
        raise DataError(message, file=file, path="format.skip_rows") from None
    except (pd.errors.ParserError, ValueError) as error:
        message = f"not a table with this separator ({error}): check separator and skip_rows"
        raise DataError(message, file=file, path="format.separator") from None
    if form.names is None:
        table.columns = pd.Index([str(name).strip() for name in table.iloc[0]])
        table = table.iloc[1:].reset_index(drop=True)
    elif len(form.names) != table.shape[1]:
        message = f"{len(form.names)} names for the {table.shape[1]} columns of the log"
        raise DataError(message, file=file, path="format.names")
    else:
        table.columns = pd.Index(form.names)
    if len(table) < 2:
        raise DataError(f"a header and {len(table)} rows: a log needs two rows or more", file=file)
    return table


def _columns(log: pd.DataFrame, mapping: Mapping, file: Path) -> pd.DataFrame:
    """Columns `t`, those of the mapping in SI units, NaN where a value is missing, and `flags` = 0."""
    t = _numbers(log, mapping.clock.source, mapping.format, file, "clock.from") * to_si(mapping.clock.unit, "t")
    wrong = np.flatnonzero(~(np.diff(t) > 0)) if np.isfinite(t).all() else np.flatnonzero(~np.isfinite(t)) - 1
    if len(wrong):
        row = int(wrong[0]) + 1
        if not np.isfinite(t[row]):
            what = "no time here: remove the row"
        elif t[row] == t[row - 1]:
            what = f"time {t[row]:g} s stands twice: remove one of the rows"
        else:
            what = f"time goes back from {t[row - 1]:g} to {t[row]:g} s: sort or split the log"
        raise DataError(what, file=file, path=f"row {row + 1}")
    columns = {"t": t}
    for name, column in mapping.columns.items():
        numbers = _numbers(log, column.source, mapping.format, file, f"columns.{name}.from")
        columns[name] = numbers * (column.sign * column.factor * to_si(column.unit, name))
    return pd.DataFrame(columns).assign(flags=np.zeros(len(t), dtype=np.int64))


def _numbers(log: pd.DataFrame, source: str, form: Format, file: Path, path: str) -> NDArray[np.float64]:
    """Turn a column of text into numbers, NaN where it is missing; text that is no number raises with its row."""
    names = [str(name) for name in log.columns]
    if names.count(source) > 1:
        raise DataError(f"column {source!r} stands twice in the log: rename one of them", file=file, path=path)
    if source not in names:
        alone = f"the header is one column, {names[0]!r}: is the separator right?"
        remedy = alone if len(names) == 1 else choices(source, names)
        raise DataError(f"column {source!r} is not in the log: {remedy}", file=file, path=path)
    text = log[source].fillna("").str.strip()
    missing = text.isin(form.missing)
    plain = text.str.replace(",", ".", regex=False) if form.decimal == "," else text
    numbers = pd.to_numeric(plain.mask(missing), errors="coerce").to_numpy(dtype=np.float64, copy=True)
    bad = np.flatnonzero(~np.isfinite(numbers) & ~missing.to_numpy())
    if len(bad):
        message = (
            f"{text.iloc[bad[0]]!r} is no number (column {source!r}; {len(bad)} such rows): "
            "correct it, or list it in [format] missing, or check decimal"
        )
        raise DataError(message, file=file, path=f"row {bad[0] + 1}")
    return numbers


def _turn(rows: pd.DataFrame, columns: dict[str, Column]) -> pd.DataFrame:
    """Unwrap angles, turn earth-fixed velocities by psi into the body, and winds "from" into "towards"."""
    turned: dict[str, NDArray[np.float64]] = {}
    for name, column in columns.items():
        values = rows[name].to_numpy().copy()
        if column.direction == "from":
            values += np.pi
        if column.wrap:
            known = np.isfinite(values)
            values[known] = np.unwrap(values[known])
        turned[name] = values
    if columns["u"].frame == "earth":
        c, s = np.cos(turned["psi"]), np.sin(turned["psi"])
        turned["u"], turned["v"] = c * turned["u"] + s * turned["v"], c * turned["v"] - s * turned["u"]
    return rows.assign(**turned)


def _close_gaps(rows: pd.DataFrame, max_gap: float | None, file: Path) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """Fill gaps of at most `max_gap` [s] between known values, remove the other rows, and break the run there."""
    t, flags = rows["t"].to_numpy(), rows["flags"].to_numpy().copy()
    removed, records, filled = np.zeros(len(t), dtype=bool), [], {}
    for name in rows.columns.drop(["t", "flags"]):
        values = rows[name].to_numpy()
        missing = ~np.isfinite(values)
        if not missing.any():
            continue
        if max_gap is None:
            message = f"no number in {int(missing.sum())} rows of {name!r}: set max_gap to interpolate short gaps"
            raise DataError(message, file=file, path=f"row {int(np.argmax(missing)) + 1}, clock.max_gap")
        before = np.maximum.accumulate(np.where(missing, -np.inf, t))
        after = np.minimum.accumulate(np.where(missing, np.inf, t)[::-1])[::-1]
        short = missing & (after - before <= max_gap)
        held = pd.Series(values).ffill().to_numpy() if is_command(name) else interpolate_at(t, values, missing)
        filled[name] = np.where(short, held, values)
        flags |= np.where(short, 1 << FLAGS.index("interpolated"), 0)
        removed |= missing & ~short
        note = f"{int((missing & ~short).sum())} rows removed"
        records.append({"kind": "interpolated", "column": name, "count": int(short.sum()), "note": note})
    kept = t[~removed]
    if len(kept) < 2:
        raise DataError("every row has a gap longer than max_gap", file=file, path="clock.max_gap")
    if max_gap is not None and max_gap < np.median(np.diff(t)):
        message = f"{max_gap:g} s is shorter than the log's own step of {np.median(np.diff(t)):g} s"
        raise DataError(message, file=file, path="clock.max_gap")
    broken = np.diff(kept, prepend=kept[0]) > (np.inf if max_gap is None else max_gap)
    if broken.any():
        note = f"gaps longer than {max_gap:g} s"
        records.append({"kind": BREAK, "column": "", "count": int(broken.sum()), "note": note})
    rows = rows.assign(**filled, flags=flags).loc[~removed].reset_index(drop=True)
    return rows.assign(flags=rows["flags"] | np.where(broken, 1 << FLAGS.index(BREAK), 0)), records


def _whole(rows: pd.DataFrame, mapping: Mapping, file: Path) -> Segment:
    unit = to_si(mapping.clock.unit, "t")
    return Segment(run=file.stem, start=rows["t"].iloc[0] / unit, end=rows["t"].iloc[-1] / unit)


def _cut(rows: pd.DataFrame, segments: Iterable[Segment], unit: float, file: Path) -> pd.DataFrame:
    """Put the runs one after another; rows that belong to two runs stand twice."""
    t = rows["t"].to_numpy()
    slack, step = clock_slack(t), float(np.median(np.diff(t)))
    runs = []
    for index, segment in enumerate(segments):
        start, end = segment.start * unit, segment.end * unit
        inside = (t >= start - slack) & (t <= end + slack)
        if start < t[0] - step - slack or end > t[-1] + step + slack or inside.sum() < 2:
            message = f"run {segment.run!r}, {start:g} to {end:g} s, is not in the log, {t[0]:g} to {t[-1]:g} s"
            raise DataError(message, file=file, path=f"segment.{index}")
        run = rows.loc[inside].reset_index(drop=True)
        run.insert(0, "run", pd.Series([segment.run] * len(run), dtype="str"))
        runs.append(run)
    return pd.concat(runs, ignore_index=True)


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
