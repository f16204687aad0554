"""Predictions of others on the test windows of a run: read, checked for what is wrong with them, and kept to be scored.

What is wrong is a search over hypotheses: a change of the given places that would undo a mistake is believed where it
lowers the error at the first step and over the whole horizon, and does not do so for constant u, v, r as well.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from shipid.data.windows import Windows, from_frame, to_frame
from shipid.errors import DataError
from shipid.files import write_table
from shipid.metrics import position_error
from shipid.report.wording import counted_text
from shipid.study.plan import grid_seeds
from shipid.study.prepare import constant_motion
from shipid.study.results import Results
from shipid.study.windows import TRUTH_RECORD, prediction_table

Array = np.ndarray
SCORES = "scores"  # folder in that of a run, of the tables that were scored
KEYS, PLACES = ["run", "instant", "ahead"], ["north", "east"]
BELIEVED = 0.75  # times the error as given: a change of the places that leaves less undoes a mistake
GENERAL = 0.3  # times the error under any other hypothesis: a wrong start explains more if less is left
FORESEEN = 0.2  # times the least error that can be believed: less is knowledge of the future


class RivalPrediction(NamedTuple):
    """A prediction of somebody else on the test windows.

    label : its name, and whether it is `not blind` or `doubtful`; `given` where the study has a method or foundation
        of its name.
    paths : (T, S, 2) [m] in the frame (11).
    N_D, seed : -1 for any. doubt : what seems to be wrong with it, in one sentence; empty where nothing does.
    """

    label: str
    paths: Array
    N_D: int
    seed: int
    doubt: str


def read_predictions(file: Path, results: Results) -> list[RivalPrediction]:
    """Read a table of predictions: run, instant [s], ahead [s], north, east [m], each step of each test window once.

    Columns `model`, `N_D`, `seed` tell several predictions apart.

    Raises DataError for a file that is no table, a missing column, a value that is no number, and for steps that are
    missing, doubled or none of a test window.
    """
    if not file.is_file() or not file.stat().st_size:
        raise DataError("is an empty file" if file.is_file() else "no such file", file=file)
    try:
        frame = pd.read_parquet(file)
    except (OSError, ValueError):
        raise DataError("is no Parquet file: write one by `DataFrame.to_parquet`", file=file) from None
    for name in (*KEYS, *PLACES):
        if name not in frame:
            raise DataError(f"lacks this column; it has {', '.join(map(str, frame))}", file=file, path=name)
    for name in (*KEYS[1:], *PLACES):
        given, frame[name] = frame[name], pd.to_numeric(frame[name], errors="coerce").astype(float)
        if (bad := np.flatnonzero(~np.isfinite(frame[name]))).size:
            fault = f"{given.iloc[bad[0]]} in row {bad[0]} is no number; {len(bad)} of {len(frame)} rows have none"
            raise DataError(fault, file=file, path=name)
    rivals: list[RivalPrediction] = []
    blind = is_blind(file, frame, results.folder)
    groups = pd.DataFrame({"model": file.stem, "N_D": -1, "seed": -1} | {name: frame[name] for name in frame})
    for name, offered in (("N_D", results.plan.study.grid.N_D), ("seed", grid_seeds(results.plan))):
        if odd := [value for value in pd.unique(groups[name]) if value not in {-1, *offered}]:
            fault = f"{odd[0]} is not of the study: give one of {', '.join(map(str, offered))}, or -1 for any"
            raise DataError(fault, file=file, path=name)
    if groups["model"].isna().any() or not len(groups):
        raise DataError("a name is missing, or every row: give each step of each window", file=file, path="model")
    for (model, N_D, seed), part in groups.groupby(["model", "N_D", "seed"], sort=False):
        places = _ordered_places(part, results.test, file)
        plan, doubt = results.plan, doubt_of_places(places, results)
        known = {way.name for way in plan.methods} | {one.name for one in plan.foundations}
        marks = {"not blind": not blind, "doubtful": bool(doubt), "given": str(model) in known}
        words, paths = [word for word, holds in marks.items() if holds], path_of_places(places, results.test)
        label = f"{model} ({', '.join(words)})" if words else str(model)
        rivals.append(RivalPrediction(label, paths, int(float(str(N_D))), int(float(str(seed))), doubt))
    return rivals


def is_blind(file: Path, frame: pd.DataFrame, folder: Path) -> bool:
    """Whether nothing says that the test windows went out with their future.

    What can say so: the folder of the run; a table of windows beside the predictions; and the predictions themselves,
    to which a frame of `StudyWindows` passes it on.
    """
    notes = [frame.attrs.get("shipid")]
    kept = file.parent == folder / SCORES  # it says what was so when it was scored
    for beside in () if kept else file.parent.glob("windows.parquet"):
        with suppress(OSError, ValueError):
            notes.append(pd.read_parquet(beside).attrs.get("shipid"))
    given = any(isinstance(note, dict) and note.get("with_truth") for note in notes)
    return not given and (kept or not (folder / TRUTH_RECORD).is_file())


def _ordered_places(frame: pd.DataFrame, test: Windows, file: Path) -> Array:
    """North and east (T, S, 2) [m] in the order of the windows; DataError for a fault of the rows."""
    wanted: Any = pd.MultiIndex.from_frame(prediction_table(test, test.future)[KEYS].round(4))
    given = frame.round(dict.fromkeys(KEYS[1:], 4)).set_index(KEYS)
    for rows, fault in (
        (given.index[~given.index.isin(wanted)], "are none of the test: `shipid study windows` lists it"),
        (given.index[given.index.duplicated()], "are there twice: give each once"),
        (wanted.difference(given.index), "are missing"),
    ):
        for run, instant, ahead in rows[:1]:
            where = f"run {run!r}, instant {instant:g} s, ahead {ahead:g} s"
            raise DataError(f"{len(rows)} of {len(wanted)} steps {fault}; the first: {where}", file=file)
    places = given.reindex(wanted)[PLACES].to_numpy(dtype=float)
    return places.reshape(len(test), test.horizon, 2).swapaxes(0, 1)


def path_of_places(places: Array, test: Windows, turn: Array | float = 0.0) -> Array:
    """Paths (T, S, 2) [m] in the frame (11), turned by angles [rad], of places (T, S, 2) [m], north and east."""
    north, east, psi = (test.columns[name] for name in (*PLACES, "psi"))
    return np.stack(to_frame(places[..., 0], places[..., 1], north, east, psi + turn), axis=-1)


def _places_of_path(path: Array, test: Windows) -> Array:
    """Places (T, S, 2) [m], north and east, of a path (T, S, 2) [m] in the frame (11)."""
    north, east, psi = (test.columns[name] for name in (*PLACES, "psi"))
    return np.stack(from_frame(path[..., 0], path[..., 1], north, east, psi), axis=-1)


def _undo_delay(steps: int) -> Undoing:
    """What undoes a delay by so many steps; below 0 places are too early. Steps that are not given are NaN."""

    def shift(places: Array, test: Windows) -> Array:
        moved = np.roll(path_of_places(places, test), -steps, axis=0)
        moved[slice(-steps, None) if steps > 0 else slice(-steps)] = np.nan
        return moved

    return shift


def _undo_degrees(places: Array, test: Windows) -> Array:
    """Places that are latitudes and longitudes, from the first step of constant u, v, r on."""
    scale = 60 * 1852.0 * np.array([1.0, np.cos(np.radians(places[..., 0].mean()))])
    first = _places_of_path(constant_motion(test), test)[:1]
    return path_of_places(first + (places - places[:1]) * scale, test)


def _undo_offset(places: Array, test: Windows) -> Array:
    """Paths moved so that the line through their first two steps starts at the ship."""
    path = path_of_places(places, test)
    return np.asarray(path - 2 * path[:1] + path[min(1, len(path) - 1)])


# places (T, S, 2) as given, test windows -> paths (T, S, 2) [m] in the frame (11) without a mistake
Undoing = Callable[[Array, Windows], Array]
# what may be wrong -> what undoes it; `hypotheses_of` adds delays
HYPOTHESES: dict[str, Undoing] = {
    "wrong frame, north and east are exchanged": lambda places, test: path_of_places(places[..., ::-1], test),
    "wrong frame, north and east count from the ship": lambda places, test: path_of_places(
        places + _places_of_path(0 * places, test), test
    ),
    "wrong frame, north and east are x and y in the axes of the ship": lambda places, _: places,
    "wrong frame, x and y are added to north and east without the heading": lambda places, test: (
        places - _places_of_path(0 * places, test)
    ),
    "wrong frame, the heading turns the path the wrong way": lambda places, test: path_of_places(
        places, test, -2 * test.columns["psi"]
    ),
    "mirrored, port is starboard": lambda places, test: path_of_places(places, test) * [1.0, -1.0],
    "mirrored, ahead is astern": lambda places, test: -path_of_places(places, test),
    "in degrees, the heading that turns the path": lambda places, test: path_of_places(
        places, test, np.degrees(test.columns["psi"]) - test.columns["psi"]
    ),
    "in degrees, north and east": _undo_degrees,
    "in mm, north and east": lambda places, test: path_of_places(places / 1000, test),
    "in km, north and east": lambda places, test: path_of_places(places * 1000, test),
    "in ft, north and east": lambda places, test: path_of_places(places * 0.3048, test),
}


def hypotheses_of(test: Windows) -> dict[str, Undoing]:
    """The hypotheses for some windows: delays are of a step, and of the time between two instants."""
    between = np.round(np.diff(test.t[:2]) / test.step).astype(int).tolist()
    delays = {
        f"{words} by {counted_text(steps, 'step')}": _undo_delay(sign * steps)
        for steps in {1, *between} & set(range(1, test.horizon))
        for words, sign in (("late", 1), ("saw the future, early", -1))
    }
    return HYPOTHESES | delays


def doubt_of_places(places: Array, results: Results) -> str:
    """Say in one sentence what seems to be wrong with places (T, S, 2) [m]; empty where nothing does."""
    test, doubt, least = results.test, "", 1.0
    naive = _places_of_path(constant_motion(test), test)
    for words, undo in {**hypotheses_of(test), "the path does not start at the ship": _undo_offset}.items():
        gain, fair = (_error_ratio(undo(given, test), path_of_places(given, test), test) for given in (places, naive))
        if gain < BELIEVED * min(1.0, fair) and gain < least * (GENERAL if undo is _undo_offset else 1.0):
            least, doubt = gain, f"{words}: undone, the error is {gain:.2g} times as large"
    share = float((_errors_at_steps(path_of_places(places, test), test) / believable_errors(results)).min())
    return doubt or (
        f"saw the future: at a step its error is {share:.2g} of the least that can be known" if share < FORESEEN else ""
    )


def _errors_at_steps(path: Array, test: Windows) -> Array:
    """Mean error (T,) [m] at each step, with a millimetre added; NaN for steps that are not given."""
    return np.asarray(position_error(path, test.future).mean(axis=1)) + 1e-3


def _error_ratio(path: Array, given: Array, test: Windows) -> float:
    """How many times as large errors are, geometric mean over steps; 1 at least where the first one is no better."""
    ratio = _errors_at_steps(path, test) / _errors_at_steps(given, test)
    ratio = ratio[np.isfinite(ratio)]
    return max(float(np.exp(np.log(ratio).mean())), float(ratio[0] > 1))


@lru_cache(maxsize=1)
def believable_errors(results: Results) -> Array:
    """The least mean error (T,) [m] at each step that can be believed.

    That of the cells, of the physics, and of a quadratic law of the state and the orders that is fitted to the test
    itself, which nobody can know.
    """
    test, plain = results.test, constant_motion(results.test)
    values = np.stack([test.columns[name] for name in ("u", "v", "r", *test.planned)]).astype(float)
    values -= values.mean(axis=1, keepdims=True)
    rows = np.concatenate([np.ones((1, len(test))), values, *(values * row for row in values)])
    rows = rows.T / np.maximum(np.abs(rows).max(axis=1), 1e-12)
    missed = (test.future - plain).swapaxes(0, 1)
    law = rows @ np.linalg.lstsq(rows, missed.reshape(len(test), -1), rcond=1e-9)[0]
    fitted = plain + law.reshape(missed.shape).swapaxes(0, 1)
    known = [*results.physics.values(), *results.paths.values(), fitted]
    return np.asarray(np.nanmin([_errors_at_steps(path, test) for path in known], axis=0))


def keep_predictions(file: Path, folder: Path) -> None:
    """Keep a table of predictions in the folder of a run, under its name, and whether it was blind.

    One of this name that was kept before is replaced.
    """
    frame = pd.read_parquet(file)
    frame.attrs["shipid"] = {"with_truth": not is_blind(file, frame, folder)}
    write_table(folder / SCORES / f"{file.stem}.parquet", frame)


def kept_predictions(results: Results, but: str = "") -> list[RivalPrediction]:
    """The predictions that the folder of a run keeps, but those of one table; errors as of `read_predictions`."""
    files = [file for file in sorted((results.folder / SCORES).glob("*.parquet")) if file.stem != but]
    return [one for file in files for one in read_predictions(file, results)]
