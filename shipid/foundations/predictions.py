"""A simulator that is a table of paths: what any program predicted for the windows of a study."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd

from shipid.arguments import as_names
from shipid.data.windows import Instants, Windows, from_frame
from shipid.errors import DataError, DocumentError, ResultError
from shipid.foundations.faults import PLACES, doubt_of_motion
from shipid.hybrid.physics import Needs
from shipid.hybrid.simulated import Array, NamedSimulator
from shipid.logs.importing import file_digest
from shipid.observer import MEASURED_MOTION

KEYS = ["run", "instant", "ahead"]


@dataclass(frozen=True)
class PredictionTable(NamedSimulator):
    """Paths in a Parquet file: run, instant [s], ahead [s], north, east [m] and, where known, psi, u, v, r.

    It covers every window of the study, and the earlier instants from which a memory takes the error of the physics.
    """

    key: str
    digest: str
    file: str
    gives: tuple[Needs, ...] = ("path",)
    parameters: Mapping[str, float] = field(default_factory=dict)

    kind: ClassVar[str] = "predictions"

    @classmethod
    def read(cls, value: Any, folder: Path, trust: bool) -> Sequence[Self]:  # noqa: ARG003
        """Return a table for each file that a document in a folder names, a member each; DocumentError, DataError."""
        tables = []
        for name in as_names("predictions", [value] if isinstance(value, str) else value, DocumentError):
            file = folder / name if (folder / name).exists() else Path(name)
            if not file.is_file():  # `study windows` writes what it is to be made of
                tables.append(cls(name, "", str((folder / name).absolute()), ("path", "motion")))
                continue
            columns = read_prediction_frame(file).columns
            gives: tuple[Needs, ...] = ("path", "motion") if {*MEASURED_MOTION} <= {*columns} else ("path",)
            tables.append(cls(name, file_digest(file), str(file.absolute()), gives))
        return tables

    @classmethod
    def from_header(cls, header: Mapping[str, Any], folder: Path, trust: bool) -> Self:  # noqa: ARG003
        """Return the table of a stored study, whose folder keeps its file."""
        return cls(header["key"], header["digest"], str(folder / header["file"]), tuple(header["gives"]))

    def header(self) -> dict[str, Any]:
        """Return its name, the digest and the name of the file that a folder of results keeps, and what it gives."""
        return {
            "kind": self.kind,
            "key": self.key,
            "digest": self.digest,
            "file": f"{self.digest}.parquet",
            "gives": list(self.gives),
        }

    def require(self) -> None:
        """Raise DataError where the table was not there when the study was read."""
        if not self.digest:
            words = "no such file: `shipid study windows STUDY --every --out FOLDER` writes what your simulator needs"
            raise DataError(words, file=self.file)

    @cached_property
    def frame(self) -> pd.DataFrame:
        """The rows by run, instant and ahead; ResultError where the file has changed since the study was read."""
        self.require()
        if not Path(self.file).is_file() or file_digest(Path(self.file)) != self.digest:
            raise ResultError("is gone, or not as it was when the study was read: put it back", file=self.file)
        return index_predictions(read_prediction_frame(Path(self.file)))

    def states(self, instants: Instants, horizon: int, step: float) -> Mapping[str, Array]:
        """Return what the table says of these instants; DataError where it lacks one."""
        if instants.run is None or instants.t is None:
            raise DataError("nobody knows the runs of these instants: give the paths of the physics", file=self.file)
        names = [name for name in MEASURED_MOTION if name in self.frame]
        keys = prediction_keys(instants.run, instants.t, step * np.arange(1, horizon + 1))
        values = ordered_values(self.frame, keys, names, Path(self.file))
        return {name: values[:, place].reshape(-1, horizon).T for place, name in enumerate(names)}

    def check(self, training: Windows, test: Windows, before: Collection[int], remedy: str) -> Sequence[str]:
        """Refuse a table whose rows are not those of the study, and, with a remedy, one that seems to be wrong."""
        file, wanted = Path(self.file), study_keys((training, test), before)
        check_keys(self.frame, wanted, file, " --every")
        states = self.states(training.instants(), training.horizon, training.step)
        if remedy and (doubt := doubt_of_motion(states, training)):
            raise DataError(f"{doubt}; {remedy}", file=self.file)
        return ()


def read_prediction_frame(file: Path) -> pd.DataFrame:
    """Read a table of predictions; DataError for a file that is none, a missing column, and what is no number."""
    if not file.is_file() or not file.stat().st_size:
        raise DataError("is an empty file" if file.is_file() else "no such file", file=file)
    try:
        frame = pd.read_parquet(file)
    except (OSError, ValueError):
        raise DataError("is no Parquet file: write one by `DataFrame.to_parquet`", file=file) from None
    for name in (*KEYS, *PLACES):
        if name not in frame:
            raise DataError(f"lacks this column; it has {', '.join(map(str, frame))}", file=file, path=name)
    for name in [*KEYS[1:], *(name for name in MEASURED_MOTION if name in frame)]:
        texts = frame[name].astype(str) if frame[name].dtype == object else frame[name]  # of lists, for example
        given, frame[name] = frame[name], pd.to_numeric(texts, errors="coerce").astype(float)
        if (bad := np.flatnonzero(~np.isfinite(frame[name]))).size:
            raise DataError(
                f"{given.iloc[bad[0]]} in row {bad[0]} is no number; {len(bad)} of {len(frame)} rows have none",
                file=file,
                path=name,
            )
    return frame


def index_predictions(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows by run, instant and ahead, times to 0.1 ms."""
    return frame.round(dict.fromkeys(KEYS[1:], 4)).astype({KEYS[0]: str}).set_index(KEYS)


def prediction_keys(run: Array, instant: Array, ahead: Array) -> pd.MultiIndex:
    """Run, instant and ahead of each window and step (K,) [s], window by window."""
    times = [np.round(np.repeat(instant, len(ahead)), 4), np.round(np.tile(ahead, len(run)), 4)]
    return pd.MultiIndex.from_arrays([np.repeat(run, len(ahead)), *times], names=KEYS)


def study_keys(parts: Sequence[Windows], before: Collection[int]) -> pd.MultiIndex:
    """What a table must hold for some windows, and for the instants so many steps before each of them."""
    wanted = []
    for cut in parts:
        steps = cut.step * np.arange(1, max(cut.horizon, *before, 0) + 1)
        wanted.append(prediction_keys(cut.run, cut.t, steps[: cut.horizon]))
        wanted += [prediction_keys(cut.run, cut.t - count * cut.step, steps[:count]) for count in before]
    return wanted[0].append(wanted[1:]).drop_duplicates()


def check_keys(frame: pd.DataFrame, wanted: pd.MultiIndex, file: Path, option: str = "") -> None:
    """DataError where steps are there twice or missing, or, without an option of `study windows`, not wanted."""
    given: Any = frame.index
    listing = f"`shipid study windows{option}` lists them"
    for rows, fault in (
        (given[:0] if option else given[~given.isin(wanted)], f"are none of the test: {listing}"),
        (given[given.duplicated()], "are there twice: give each once"),
        (wanted.difference(given), f"are missing{f': {listing}' if option else ''}"),
    ):
        for run, instant, ahead in rows[:1]:
            where = f"run {run!r}, instant {instant:g} s, ahead {ahead:g} s"
            raise DataError(f"{len(rows)} of {len(wanted)} steps {fault}; the first: {where}", file=file)


def ordered_values(frame: pd.DataFrame, keys: pd.MultiIndex, names: Sequence[str], file: Path) -> Array:
    """Columns (len(keys), n) of the rows of some keys; DataError where one is missing."""
    places = frame.index.get_indexer(keys)
    for run, instant, ahead in keys[places < 0][:1]:
        raise DataError(f"lacks run {run!r}, instant {instant:g} s, ahead {ahead:g} s", file=file)
    return frame[[*names]].to_numpy(dtype=float)[places]


def ordered_places(frame: pd.DataFrame, test: Windows, file: Path) -> Array:
    """North and east (T, S, 2) [m] in the order of the windows; DataError for a fault of the rows."""
    wanted, given = study_keys([test], ()), index_predictions(frame)
    check_keys(given, wanted, file)
    return ordered_values(given, wanted, PLACES, file).reshape(len(test), test.horizon, 2).swapaxes(0, 1)


def prediction_table(cut: Windows, paths: Array, **columns: Array) -> pd.DataFrame:
    """Paths (T, S, 2) [m] in the frame (11) as a table: run, instant, ahead [s], north, east [m], x, y [m].

    columns : further ones, (T, S). `shipid study score` takes such a table of the test windows.
    """
    now, (x, y) = cut.columns, np.moveaxis(paths, -1, 0)
    north, east = from_frame(x, y, now["north"], now["east"], now["psi"])
    steps = cut.step * np.arange(1, cut.horizon + 1)
    return long_table(cut, steps, {"north": north, "east": east, "x": x, "y": y, **columns})


def long_table(cut: Windows, ahead: Array, columns: Mapping[str, Array]) -> pd.DataFrame:
    """A row for each window and time ahead (K,) [s], window by window; columns (K, S) by name."""
    keys: dict[str, Any] = {"run": np.repeat(cut.run, len(ahead)), "instant": np.repeat(cut.t, len(ahead))}
    keys["ahead"] = np.tile(ahead, len(cut))
    return pd.DataFrame(keys | {name: np.asarray(values).T.ravel() for name, values in columns.items()})
