"""The dataset: recorded or simulated runs as one table, its schema, and its Parquet file."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from shipid.arguments import as_names, as_path, check_class
from shipid.document import requirement_words
from shipid.errors import DataError, suggest_name
from shipid.files import open_file, read_arrow, replace_whole
from shipid.notebooks import NotebookView
from shipid.physics.signals import SIGNALS, is_command, is_output, is_wrapped_angle, rows_of_role, signal_of

Array = NDArray[np.float64]
StretchRows = pd.DataFrame | Mapping[str, NDArray[Any]]
"""Rows of one unbroken stretch, as `stretches_of_runs` or `stretch_columns` gives them."""

STANDARD_DEVIATIONS = {"u": "std_u", "v": "std_v", "r": "std_r"}
"""State -> column of its standard deviation, where it was estimated instead of measured."""
BREAK = "break"
"""Name of the flag on the first row after a break: nothing connects it to the row before."""

FIRST_DATED_TIME = 1e8  # s: a clock that is farther is one of dates, seconds since 1970
MOST_FLAGS = 62  # bits of an integer
PAUSE_STEPS = 3.0  # times the shortest interval of late: a pause is longer
SHORTEST_STEP_GROWTH = 1.1  # times: by so much the shortest interval of late grows with each row
_METADATA_KEY = b"shipid"


@dataclass(frozen=True, eq=False, repr=False)
class Dataset(NotebookView, shown=("runs", "commands", "frame")):
    """Runs of one vessel: a table that has passed `check_schema`, and where it came from. `==` compares by identity.

    frame : columns `run`, `t`, `north`, `east`, `psi`, `u`, `v`, `r`, `flags`, one per command
        (`port.n` [rev/s], `port.alpha` [rad], `rudder.delta` [rad]) and, where measured, `V_w`, `beta_w`, outputs
        (`propeller.thrust` [N]) and the rest of `optional_columns()`. SI units, radians; time increases within a run;
        no NaN. u and v are horizontal, along and across the heading, and r = d(psi)/dt, also where the ship heels.
    metadata : plain data (JSON). `flags` names the bits of the column `flags`; `clock` is `"run"` where every run
        has a separate clock (simulation) and `"shared"` where all runs are parts of one recording (the default).
    """

    frame: pd.DataFrame
    metadata: dict[str, Any]

    def __post_init__(self) -> None:
        check_schema(self.frame, self.metadata)
        # what passed the check stays: later changes of the caller's table are not seen (pandas copies on write)
        object.__setattr__(self, "frame", self.frame.reset_index(drop=True))
        object.__setattr__(self, "metadata", deepcopy(self.metadata))

    @property
    def commands(self) -> list[str]:
        """Names of the command columns, in the order of the table."""
        return [str(name) for name in self.frame.columns if is_command(str(name))]

    @property
    def outputs(self) -> list[str]:
        """Names of the columns of measured outputs (`propeller.thrust`), in the order of the table."""
        return [str(name) for name in self.frame.columns if is_output(str(name))]

    @property
    def runs(self) -> list[str]:
        """Names of the runs, in the order of the table."""
        return [str(name) for name in self.frame["run"].unique()]

    def select(self, runs: Iterable[str]) -> Dataset:
        """Return the dataset with these runs alone, in the order of the table; DataError where none is left.

        Names that no run has are passed over.
        """
        names = as_names("runs", runs, DataError)
        chosen = self.frame["run"].isin(names)
        if not chosen.any():
            raise DataError(f"no run is named {', '.join(names)}: there are {', '.join(self.runs)}", path="run")
        return replace(self, frame=self.frame[chosen].reset_index(drop=True))

    @property
    def digest(self) -> str:
        """SHA-256 (first 16 hex digits) of the table, its flags and its clock; the file does not matter."""
        sha = hashlib.sha256("\0".join([*self.metadata.get("flags", []), str(shares_clock(self))]).encode())
        for name, column in self.frame.items():
            text = name == "run"
            sha.update(f"{name}\0".encode())
            sha.update("\0".join(column).encode() if text else np.ascontiguousarray(column.to_numpy()).tobytes())
        return sha.hexdigest()[:16]


def required_columns() -> dict[str, str]:
    """Columns that every dataset has beside `run` and `flags`, with their SI units: the clock, position and motion."""
    return {"t": "s"} | {name: row.unit for name, row in SIGNALS.items() if row.column == "required"}


def optional_columns() -> dict[str, str]:
    """Columns that a dataset may have beside its commands, with their SI units."""
    measured = {name: row.unit for name, row in SIGNALS.items() if row.column == "optional"}
    return measured | {column: SIGNALS[name].unit for name, column in STANDARD_DEVIATIONS.items()}


def unit_of_column(name: str) -> str | None:
    """SI unit of a column by its name; None if no column may have this name."""
    if is_command(name) or is_output(name):
        return SIGNALS[signal_of(name)].unit
    return (required_columns() | optional_columns()).get(name)


def units_of_columns(names: Iterable[str]) -> dict[str, str]:
    """SI unit of every column that has one."""
    return {name: unit for name in names if (unit := unit_of_column(name)) is not None}


def flag_bit(metadata: dict[str, Any], name: str) -> int:
    """Value of a named flag in the column `flags`; 0 where the dataset does not use it."""
    names = metadata.get("flags", [])
    return 1 << names.index(name) if name in names else 0


def stretches_of_runs(dataset: Dataset) -> Iterator[tuple[str, pd.DataFrame]]:
    """Unbroken stretches of every run, as (run, rows): a new one starts at each row flagged `break`."""
    for name, places in stretch_rows(dataset):
        yield name, dataset.frame.iloc[places]


def stretch_columns(dataset: Dataset) -> Iterator[tuple[str, dict[str, NDArray[Any]]]]:
    """Unbroken stretches of every run, as (run, columns): name -> array (N,), the column `run` left out.

    With 120 runs `cut_windows` takes 0.4 of the time that it takes with `stretches_of_runs`.
    """
    columns = {str(name): column.to_numpy() for name, column in dataset.frame.items() if name != "run"}
    for name, places in stretch_rows(dataset):
        yield name, {column: values[places] for column, values in columns.items()}


def stretches_by_run(dataset: Dataset) -> dict[str, list[pd.DataFrame]]:
    """Run -> its unbroken stretches, in the order of the table."""
    by_run: dict[str, list[pd.DataFrame]] = {}
    for run, rows in stretches_of_runs(dataset):
        by_run.setdefault(run, []).append(rows)
    return by_run


def stretch_rows(dataset: Dataset) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """Yield (run, indices of rows in the table) of every stretch that `stretches_of_runs` yields."""
    broken = (dataset.frame["flags"].to_numpy() & flag_bit(dataset.metadata, BREAK)) != 0
    for name, places in dataset.frame.groupby("run", sort=False).indices.items():
        rows = np.asarray(places)
        starts = np.flatnonzero(broken[rows[1:]]) + 1
        for first, last in zip([0, *starts], [*starts, len(rows)], strict=True):
            yield str(name), rows[first:last]


def shares_clock(dataset: Dataset) -> bool:
    """Whether all runs lie on one clock; if not, equal times of two runs are different moments."""
    return bool(dataset.metadata.get("clock", "shared") != "run")


def rows_outside_spans(dataset: Dataset, spans: Iterable[tuple[float, float]]) -> NDArray[np.bool_]:
    """Rows (N,) at no moment of the spans (start, end) [s]."""
    t = dataset.frame["t"].to_numpy()
    seen = np.zeros(len(t), dtype=bool)
    for start, end in spans:
        seen |= (t >= start) & (t <= end)
    return ~seen


def keep_rows(dataset: Dataset, kept: NDArray[np.bool_]) -> Dataset:
    """The dataset with the rows `kept` (N,) alone, broken where rows are missing."""
    if kept.all():
        return dataset
    names = list(dict.fromkeys([*dataset.metadata.get("flags", []), BREAK]))
    after = np.concatenate([[False], ~kept[:-1]])
    flags = dataset.frame["flags"] | np.where(after, 1 << names.index(BREAK), 0)
    frame = dataset.frame.assign(flags=flags)[kept].reset_index(drop=True)
    return replace(dataset, frame=frame, metadata={**dataset.metadata, "flags": names})


def without_shared_moments(dataset: Dataset, runs: Iterable[str]) -> Dataset:
    """The dataset in which no other run sees a moment of these runs, which stay whole; broken where rows are missing.

    On a shared clock runs may overlap: the same rows of a log, cut twice.
    """
    if not shares_clock(dataset):
        return dataset
    mine = dataset.frame["run"].isin(list(runs)).to_numpy()
    t = dataset.frame["t"].to_numpy()
    spans = [(t[places[0]], t[places[-1]]) for _, places in stretch_rows(dataset) if mine[places[0]]]
    return keep_rows(dataset, mine | rows_outside_spans(dataset, spans))


def clock_slack(t: Array) -> float:
    """Difference [s] under which two instants on a clock t (N,) [s] are the same: a thousandth of its least step.

    A part of the step, not of t: 1e-9 of Unix time is longer than most steps. Never less than four roundings of t.
    """
    rounding = 4.0 * float(np.spacing(np.abs(t).max()))
    return max(rounding, 1e-3 * float(np.diff(t).min())) if len(t) > 1 else rounding


def after_pauses(t: Array, longest: float) -> NDArray[np.bool_]:
    """Whether each row at t (N,) [s] of one stretch comes after a pause, by it and the rows before it alone.

    A pause is longer than `longest` [s] and than `PAUSE_STEPS` times the shortest interval so far, which grows by the
    factor `SHORTEST_STEP_GROWTH` with each row. The recorder of exported C has the same rule.
    """
    found, least = np.zeros(len(t), dtype=bool), 0.0
    for i, apart in enumerate(np.diff(t).tolist(), start=1):
        found[i] = apart > longest and not apart <= PAUSE_STEPS * least
        least = min(least * SHORTEST_STEP_GROWTH, apart) if least else apart
    return found


def cumulative_integral(t: Array, rate: Array) -> Array:
    """Integral of a rate (N,) from t[0] to each t (N,) [s] by the trapezoid rule, (N,)."""
    return np.append(0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(t)))


def travelled_position(rows: StretchRows, instants: Array) -> tuple[Array, Array]:
    """North and east [m] travelled since the first row: trapezoid of R(psi) (u, v), exact between rows too."""
    t, psi, u, v = (np.asarray(rows[name]) for name in ("t", "psi", "u", "v"))
    row = np.clip(np.searchsorted(t, instants, side="right") - 1, 0, len(t) - 1)

    def along(rate: Array) -> Array:
        return np.asarray(
            cumulative_integral(t, rate)[row] + (instants - t[row]) * (rate[row] + np.interp(instants, t, rate)) / 2
        )

    return along(u * np.cos(psi) - v * np.sin(psi)), along(u * np.sin(psi) + v * np.cos(psi))


def sample_columns(rows: StretchRows, instants: Array) -> dict[str, NDArray[Any]]:
    """Every column of one unbroken stretch at given instants [s] (any shape): name -> array of that shape.

    States and wind are linear between rows (angles unwrapped first); commands and flags keep the value of the last
    row at or before the instant, because an order holds until the next one.
    """
    t = np.asarray(rows["t"])
    # t0 + 3 * 0.1 must find the row written as 0.3, but no row of the future
    last = np.clip(np.searchsorted(t, instants + clock_slack(t), side="right") - 1, 0, len(t) - 1)
    result: dict[str, NDArray[Any]] = {}
    for name in map(str, rows):
        if name in ("run", "t"):
            continue
        values = np.asarray(rows[name])
        if name == "flags" or is_command(name):
            result[name] = values[last]
        else:
            result[name] = np.interp(instants, t, np.unwrap(values) if is_wrapped_angle(name) else values)
    return result


def mean_commands(rows: StretchRows, edges: Array) -> dict[str, Array]:
    """Commands of one unbroken stretch in force in steps between instants `edges` [s] (T + 1, ...): name -> (T, ...).

    The mean over each step of the commands, which hold from row to row and after the last row; so an order that changes
    within a step counts for the rest of it.
    """
    t, widths = np.asarray(rows["t"]), np.diff(edges, axis=0)
    orders = {name: np.asarray(rows[name], dtype=float) for name in filter(is_command, map(str, rows))}
    at_start, slack = sample_columns({"t": t, **orders}, edges[:-1]), clock_slack(t)
    later = np.maximum(edges - t[-1], 0.0)
    result: dict[str, Array] = {}
    for name, values in orders.items():
        passed = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(t))])
        mean = np.diff(np.interp(edges, t, passed) + values[-1] * later, axis=0) / widths
        most = float(np.abs(np.diff(values)).max(initial=0.0))
        rounding = 2 * slack * most / widths + 1e-9 * np.abs(values).max()  # of the clock, and of the sums
        result[name] = np.where(np.abs(mean - at_start[name]) > rounding, mean, at_start[name])
    return result


def check_schema(frame: pd.DataFrame, metadata: dict[str, Any]) -> None:
    """Raise DataError unless the table holds what `Dataset` promises."""
    check_metadata(metadata)
    if not isinstance(frame, pd.DataFrame):
        raise DataError(f"the table must be a pandas DataFrame, not {type(frame).__name__}")
    if len(frame) == 0:
        raise DataError("the dataset has no rows: it needs at least one run")
    other = next((name for name in frame.columns if not isinstance(name, str)), None)
    if other is not None:
        raise DataError(f"the column {other!r} has no name: names of columns are text")
    names = [str(name) for name in frame.columns]
    for name in ("run", "flags", *required_columns()):
        if name not in names:
            raise DataError(f"missing column; there are: {', '.join(names)}", path=name)
    for name in names:
        if names.count(name) > 1:
            raise DataError("this column appears twice", path=name)
        _check_column(name, frame[name])
    for name, other in (("V_w", "beta_w"), ("beta_w", "V_w")):
        if name in names and other not in names:
            raise DataError(f"wind needs V_w and beta_w: {other} is missing", path=name)
    if int(frame["flags"].max()) >= 1 << len(metadata.get("flags", [])) or int(frame["flags"].min()) < 0:
        raise DataError("a row has a flag bit that metadata['flags'] does not name", path="flags")
    units = metadata.get("units", {})
    for name, unit in units_of_columns(names).items():
        if units.get(name, unit) != unit:
            raise DataError(f"metadata['units'] says {units[name]!r}, must be {unit!r}", path=name)
    run, names_of_runs = pd.factorize(frame["run"])
    t = frame["t"].to_numpy()
    if np.any(run[1:] < run[:-1]):  # rows of runs are mixed
        order = np.argsort(run, kind="stable")
        run, t = run[order], t[order]
    backwards = np.flatnonzero((t[1:] <= t[:-1]) & (run[1:] == run[:-1]))
    if len(backwards):
        row = backwards[0] + 1
        raise DataError(f"run {names_of_runs[run[row]]!r}: time does not increase at t = {t[row]:g} s", path="t")


class _Metadata(BaseModel):
    """The entries of the metadata that are read here; there may be more."""

    model_config = ConfigDict(strict=True)
    flags: Annotated[list[str], Field(max_length=MOST_FLAGS)] = []
    units: dict[str, Any] = {}
    clock: Literal["run", "shared"] = "shared"
    repairs: list[dict[str, Any]] = []


def check_metadata(metadata: Any) -> None:
    """Raise DataError unless the metadata are a table whose known entries have their types."""
    try:
        _Metadata.model_validate(metadata)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        path = ".".join(map(str, first["loc"])) or None
        raise DataError(f"damaged metadata: {requirement_words(first)}", path=path) from None


def _check_column(name: str, column: pd.Series[Any]) -> None:
    unit = unit_of_column(name)
    if name == "run":
        right, wanted = pd.api.types.is_string_dtype(column.dtype), "text"
    elif name == "flags":
        right, wanted = pd.api.types.is_integer_dtype(column.dtype), "integers"
    elif unit is None:
        raise DataError(
            f"unknown column: {suggest_name(name, [*required_columns(), *optional_columns(), 'run', 'flags'])} "
            f"(or <component>.<signal>, signals {', '.join((*rows_of_role('command'), *rows_of_role('output')))})",
            path=name,
        )
    else:
        right, wanted = column.dtype == np.float64, f"float64 in {unit}"
    if not right:
        raise DataError(f"holds {column.dtype}, must hold {wanted}", path=name)
    bad = ~np.isfinite(column.to_numpy()) if unit is not None else column.isna().to_numpy()
    if bad.any():
        raise DataError(
            f"{int(bad.sum())} values are not finite, the first in row {int(np.argmax(bad))}; fill or cut them first",
            path=name,
        )


def write_dataset(dataset: Dataset, file: str | os.PathLike[str]) -> Path:
    """Write a dataset as Parquet (zstd), metadata as JSON in its schema; the file appears whole or not at all.

    Raises DataError for a name that does not end in .parquet, for metadata that JSON cannot hold, or where the file
    cannot be written.
    """
    check_class("dataset", dataset, Dataset, "such as Dataset(frame, metadata)", DataError)
    target = as_path("file", file, DataError)
    if target.suffix != ".parquet":
        raise DataError("a dataset is a Parquet file: let the name end in .parquet", file=target)
    metadata = {"units": units_of_columns(map(str, dataset.frame.columns)), **dataset.metadata}
    try:
        text = json.dumps(metadata)
    except (TypeError, ValueError) as error:
        raise DataError(f"the metadata must be plain data, as JSON holds it ({error})", file=target) from None
    table = pyarrow.Table.from_pandas(dataset.frame, preserve_index=False)
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), _METADATA_KEY: text.encode()})
    try:
        with replace_whole(target) as part, part.open("wb") as stream:  # Arrow takes no name that is not UTF-8
            pyarrow.parquet.write_table(table, stream, compression="zstd")
    except OSError as error:
        raise DataError(f"cannot be written ({error.strerror or error})", file=target) from None
    return target


def read_dataset(file: str | os.PathLike[str], *, remedy: str = "") -> Dataset:
    """Read a dataset that `write_dataset` wrote; raises DataError for anything else, naming file and column.

    remedy : what else helps where the file is no Parquet file, added to the sentence that says so.
    """
    file = as_path("file", file, DataError)
    if os.path.isdir(file):
        raise DataError("is a folder: name one dataset", file=file)
    try:
        with open_file(file) as stream:
            table = read_arrow(stream)
    except (pyarrow.ArrowException, ValueError, TypeError):
        raise DataError(
            f"not a Parquet file: make one from a log with `shipid data import`{remedy}", file=file
        ) from None
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror or error})", file=file) from None
    stored = (table.schema.metadata or {}).get(_METADATA_KEY)
    if stored is None:
        raise DataError("a Parquet file, but not a dataset of shipid: no metadata under 'shipid'", file=file)
    try:
        return Dataset(table.to_pandas(use_threads=False), json.loads(stored))
    except DataError as error:
        raise DataError(error.message, file=file, path=error.path) from None
    except (
        pyarrow.ArrowException,
        ValueError,
        RecursionError,
        TypeError,
        KeyError,
        AttributeError,
        OverflowError,
    ) as error:
        raise DataError(f"damaged: {error}", file=file) from None
