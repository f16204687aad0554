"""Predictions of others on the test windows of a run: read, checked for what is wrong with them, and kept to be scored.

What is wrong is a search over hypotheses: a change of the given places that would undo a mistake is believed where it
lowers the error at the first step and over the whole horizon, and does not do so for constant u, v, r as well.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.windows import Windows, from_frame, to_frame
from shipid.errors import DataError, ResultError, suggest_name
from shipid.files import arrays_with_prefix, read_arrays, write_arrays
from shipid.metrics import position_error
from shipid.study.prepare import constant_motion
from shipid.study.results import Results
from shipid.study.windows import TRUTH_RECORD

Array = np.ndarray
SCORES = "scores"  # folder in that of a run
KEYS, PLACES, GROUPS = ("run", "instant", "ahead"), ("north", "east"), ("model", "N_D", "seed")
CLOCK_DIGITS = 4  # after the point of an instant [s]
BELIEVED = 0.75  # times the error as given: a change of the places that leaves less undoes a mistake
CLEARER = 0.9  # times the error under another hypothesis: one further down the list needs less
FORESEEN = 0.2  # times the least error that can be believed: less is knowledge of the future
METRES_A_DEGREE = 60 * 1852.0


@dataclass(frozen=True, eq=False)
class RivalPrediction:
    """A prediction of somebody else on the test windows.

    paths : (T, S, 2) [m] in the frame (11). N_D, seed : None for any.
    """

    model: str
    paths: Array
    N_D: int | None = None
    seed: int | None = None
    blind: bool = True
    doubt: str = ""

    @property
    def label(self) -> str:
        """Its name in tables, with what limits a comparison."""
        words = [*([] if self.blind else ["not blind"]), *(["doubtful"] if self.doubt else [])]
        return f"{self.model} ({', '.join(words)})" if words else self.model


def read_predictions(file: str | os.PathLike[str], results: Results) -> list[RivalPrediction]:
    """Read a table of predictions: run, instant [s], ahead [s], north, east [m], each step of each test window once.

    Columns `model`, `N_D`, `seed` tell several predictions apart; `psi` [rad] is checked where it is given. A
    prediction with a `doubt` says in one sentence what seems to be wrong with it.

    Raises DataError for a file that is no table, a missing column, a place that is no number, and for windows that are
    missing, doubled or none of the test.
    """
    file = Path(file)
    try:
        frame = pd.read_parquet(file)
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read as Parquet ({error})", file=file) from None
    for name in (*KEYS, *PLACES):
        if name not in frame:
            raise DataError(f"lacks this column; it has {', '.join(map(str, frame))}", file=file, path=name)
    given = [name for name in GROUPS if name in frame]
    blind, rivals = is_blind(file, frame, results.folder), list[RivalPrediction]()
    for key, part in frame.groupby(given, sort=False, dropna=False) if given else [((), frame)]:
        values: dict[str, Any] = dict(zip(given, key, strict=True))
        whole = {name: int(values[name]) for name in GROUPS[1:] if name in values}
        model = str(values.get("model", file.stem))
        try:
            places = _ordered_columns(part, results.test, PLACES)
            doubt = doubt_of_places(places, results)
            if not doubt and "psi" in part:
                doubt = doubt_of_heading(_ordered_columns(part, results.test, ["psi"])[..., 0], results.test)
        except DataError as error:
            raise DataError(error.message, file=file, path=error.path) from None
        rivals.append(RivalPrediction(model, path_of_places(places, results.test), **whole, blind=blind, doubt=doubt))
    return rivals


def is_blind(file: Path, frame: pd.DataFrame, folder: Path) -> bool:
    """Whether nothing says that the test windows went out with their future.

    What can say so: the folder of the run, the predictions, to which a frame of `StudyWindows` passes it on, and a
    table of windows in the folder of the predictions.
    """
    said = [frame.attrs]
    if (beside := file.parent / "windows.parquet").is_file():
        said.append(pd.read_parquet(beside, columns=["run"]).attrs)
    given = any(Mapping.get(attrs.get("shipid", {}), "with_truth", False) for attrs in said)
    return not given and not (folder / TRUTH_RECORD).is_file()


def _ordered_columns(frame: pd.DataFrame, test: Windows, names: Sequence[str]) -> Array:
    """Columns of a table, (T, S, n) in the order of the windows; DataError for a fault of its rows."""
    clock = test.t.round(CLOCK_DIGITS).tolist()
    rows = {key: place for place, key in enumerate(zip(test.run.tolist(), clock, strict=True))}
    keys = zip(frame["run"].astype(str), frame["instant"].astype(float).round(CLOCK_DIGITS), strict=True)
    window = np.array([rows.get(key, -1) for key in keys], dtype=int)
    ahead = frame["ahead"].to_numpy(dtype=float) / test.step
    step = np.nan_to_num(ahead).round().astype(int) - 1
    if (window < 0).any():
        run, t = frame[["run", "instant"]].iloc[int(np.argmax(window < 0))]
        remedy = "`shipid study windows` lists them" if run in test.spans else suggest_name(str(run), test.spans)
        raise DataError(f"run {run!r}, instant {t:g} s is no test window: {remedy}")
    strange = ~(np.abs(ahead - step - 1) <= 10.0**-CLOCK_DIGITS) | (step < 0) | (step >= test.horizon)
    if strange.any():
        value, last = float(frame["ahead"].iloc[int(np.argmax(strange))]), test.horizon * test.step
        raise DataError(f"ahead {value:g} s is none of {test.step:g}, {2 * test.step:g}, ..., {last:g} s")
    count = np.zeros((len(test), test.horizon), dtype=int)
    np.add.at(count, (window, step), 1)
    for fault, words in ((count > 1, "there twice or more"), (count < 1, "missing")):
        if fault.any():
            s, k = np.argwhere(fault)[0]
            where = f"run {str(test.run[s])!r}, instant {test.t[s]:g} s, ahead {(k + 1) * test.step:g} s"
            raise DataError(f"{int(fault.sum())} of {count.size} rows are {words}, first {where}: give each once")
    values = np.empty((test.horizon, len(test), len(names)))
    values[step, window] = frame[list(names)].to_numpy(dtype=float)
    if not np.isfinite(values).all():
        raise DataError("a value is no number: give one in every row", path=" or ".join(names))
    return values


def path_of_places(places: Array, test: Windows) -> Array:
    """Paths (T, S, 2) [m] in the frame (11) of places (T, S, 2) [m], north and east."""
    now = test.columns
    return np.stack(to_frame(places[..., 0], places[..., 1], now["north"], now["east"], now["psi"]), axis=-1)


def _turned_places(places: Array, test: Windows, turn: Array) -> Array:
    """Paths in the frame (11) of places whose way from the ship was turned by angles (S,) [rad] by mistake."""
    north, east = np.moveaxis(places, -1, 0)
    now = test.columns
    return np.stack(to_frame(north, east, now["north"], now["east"], now["psi"] + turn), axis=-1)


def _shifted_path(steps: int) -> Undoing:
    """What undoes a delay by so many steps; below 0 places are too early. Steps that are not given are NaN."""

    def shift(places: Array, test: Windows) -> Array:
        path, moved = path_of_places(places, test), np.full_like(places, np.nan)
        if steps > 0:
            moved[:-steps] = path[steps:]
        else:
            moved[-steps:] = path[:steps]
        return moved

    return shift


def _from_degrees(places: Array, test: Windows) -> Array:
    """Places that are latitudes and longitudes, from where constant u, v, r has its first step on."""
    scale = METRES_A_DEGREE * np.array([1.0, float(np.cos(np.radians(places[..., 0].mean())))])
    first = np.stack(from_frame(*np.moveaxis(constant_motion(test)[:1], -1, 0), *_now(test)), axis=-1)
    return path_of_places(first + (places - places[:1]) * scale, test)


def _from_start(places: Array, test: Windows) -> Array:
    """Paths moved so that the line through their first two steps starts at the ship."""
    path = path_of_places(places, test)
    return path - (2 * path[:1] - path[1:2] if len(path) > 1 else path[:1])


def _now(test: Windows) -> tuple[Array, Array, Array]:
    return test.columns["north"], test.columns["east"], test.columns["psi"]


Undoing = Callable[[Array, Windows], Array]
"""Places (T, S, 2) as given, test windows -> paths (T, S, 2) [m] in the frame (11) without a mistake."""
HYPOTHESES: dict[str, Undoing] = {
    "north and east are exchanged": lambda places, test: path_of_places(places[..., ::-1], test),
    "north and east count from the ship: add its place": lambda places, test: path_of_places(
        places + np.stack(_now(test)[:2], axis=-1), test
    ),
    "north and east are x and y of the ship's frame": lambda places, _: places,
    "the path is mirrored: port is starboard": lambda places, test: path_of_places(places, test) * [1.0, -1.0],
    "the path goes astern": lambda places, test: -path_of_places(places, test),
    "x and y are added to north and east without the heading": lambda places, test: (
        places - np.stack(_now(test)[:2], axis=-1)
    ),
    "the heading is taken with the wrong sign": lambda places, test: _turned_places(
        places, test, -2 * test.columns["psi"]
    ),
    "the heading is in degrees where radians are needed": lambda places, test: _turned_places(
        places, test, np.degrees(test.columns["psi"]) - test.columns["psi"]
    ),
    "north and east are degrees, not metres": _from_degrees,
    "the path is late by a step": _shifted_path(1),
    "the path is early by a step: it saw the future": _shifted_path(-1),
    "the path does not start at the ship": _from_start,
}
"""What may be wrong -> what undoes it; the likelier first."""


def hypotheses_of(test: Windows) -> dict[str, Undoing]:
    """The hypotheses for some windows: also a delay by the time between instants, where that is no step."""
    times = np.diff(test.t)[test.run[1:] == test.run[:-1]]
    between = round(float(np.median(times)) / test.step) if len(times) else 1
    if not 1 < between < test.horizon:
        return HYPOTHESES
    words = f"the path is late by {between} steps: that of the instant before", f"the path is early by {between} steps"
    shifts = {words[0]: _shifted_path(between), f"{words[1]}: it saw the future": _shifted_path(-between)}
    return {**HYPOTHESES, **shifts}


def doubt_of_places(places: Array, results: Results) -> str:
    """Say in one sentence what seems to be wrong with places (T, S, 2) [m], north and east; empty where nothing does."""
    test, doubt, least = results.test, "", 1.0
    naive = np.stack(from_frame(*np.moveaxis(constant_motion(test), -1, 0), *_now(test)), axis=-1)
    for words, undo in hypotheses_of(test).items():
        gain, fair = (_error_ratio(undo(given, test), path_of_places(given, test), test) for given in (places, naive))
        if gain < BELIEVED * min(1.0, fair) and gain < CLEARER * least:
            least = gain
            doubt = f"{words}: undone, the error is {gain:.2g} times as large"
    if doubt:
        return doubt
    share = float((_errors_by_step(path_of_places(places, test), test) / believable_errors(results)).min())
    return (
        f"it saw the future: at a step its error is {share:.2g} of what the best can know" if share < FORESEEN else ""
    )


def doubt_of_heading(psi: Array, test: Windows) -> str:
    """Say that headings (T, S) seem to be in degrees; empty where they do not."""
    missed = [np.abs(np.sin((one - test.states["psi"]) / 2)).mean() for one in (psi, np.radians(psi))]
    return "psi is in degrees where radians are needed" if missed[1] < BELIEVED * missed[0] else ""


def _errors_by_step(path: Array, test: Windows) -> Array:
    """Mean error (T,) [m] at each step, with a millimetre added; NaN for steps that are not given."""
    return np.asarray(position_error(path, test.future).mean(axis=1)) + 1e-3


def _error_ratio(path: Array, given: Array, test: Windows) -> float:
    """How many times as large errors are, geometric mean over the steps; 1 at least where the first one is no better."""
    ratio = _errors_by_step(path, test) / _errors_by_step(given, test)
    ratio = ratio[np.isfinite(ratio)]
    mean = float(np.exp(np.log(ratio).mean()))
    return max(mean, 1.0) if ratio[0] > 1 else mean


@lru_cache(maxsize=1)
def believable_errors(results: Results) -> Array:
    """The least mean error (T,) [m] at each step that can be believed.

    That of the cells, of the physics, and of a quadratic law of the state and the orders that is fitted to the test
    itself, which nobody can know.
    """
    test, known = results.test, [*results.physics.values(), *(results.paths[cell] for cell in results.paths)]
    names = ("u", "v", "r", *test.planned)
    values = np.stack([np.asarray(test.columns[name], dtype=float) for name in names])
    scaled = (values - values.mean(axis=1, keepdims=True)) / np.maximum(values.std(axis=1, keepdims=True), 1e-12)
    rows = np.concatenate([np.ones((1, len(test))), scaled, *(scaled * row for row in scaled)]).T
    flat = constant_motion(test).swapaxes(0, 1).reshape(len(test), -1)
    missed = test.future.swapaxes(0, 1).reshape(len(test), -1) - flat
    law = flat + rows @ np.linalg.lstsq(rows, missed, rcond=1e-9)[0]
    known.append(law.reshape(len(test), test.horizon, 2).swapaxes(0, 1))
    return np.nanmin([_errors_by_step(path, test) for path in known], axis=0)


def write_score(folder: Path, one: RivalPrediction) -> Path:
    """Keep a prediction in the folder of a run, under its name; an earlier one of that name is replaced."""
    header = {name: getattr(one, name) for name in ("model", "N_D", "seed", "blind", "doubt")}
    name = re.sub(r"[^\w.+-]+", "_", "-".join(str(header[key]) for key in GROUPS if header[key] is not None))
    file = folder / SCORES / f"{name}.npz"
    write_arrays(file, {"paths": one.paths, "header": np.array(json.dumps(header))})
    return file


def read_scores(folder: Path) -> Iterator[RivalPrediction]:
    """The predictions that a folder keeps; ResultError for a file that is none."""
    for file in sorted((folder / SCORES).glob("*.npz")):
        try:
            arrays = read_arrays(file)
            yield RivalPrediction(paths=arrays["paths"], **json.loads(str(arrays["header"])))
        except (OSError, ValueError, KeyError, TypeError):
            raise ResultError("damaged: delete it, and score the predictions again", file=file) from None
