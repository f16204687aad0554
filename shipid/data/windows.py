"""Windows: every instant of prediction with its future; and splits by run that share no moment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from shipid.arguments import check_choice, check_class, check_positive, check_whole_number
from shipid.data.checks import GAP_STEPS
from shipid.data.dataset import (
    Array,
    Dataset,
    StretchRows,
    clock_slack,
    mean_commands,
    sample_columns,
    shares_clock,
    stretch_columns,
    stretches_of_runs,
    travelled_position,
)
from shipid.errors import DataError
from shipid.units import plural_word

WindowMask = NDArray[np.bool_]
Commands = Literal["held", "known"]
PathSource = Literal["position", "velocity"]
"""Columns that give the true path: logged positions, or velocities that are integrated."""
NESTED, HELD_OUT, FOLDED = 1, 2, 3
"""Purposes of a draw of runs: one seed gives each a separate order."""
VALIDATION_SHARE = 0.2  # method, section 4: 80 % of the manoeuvres train, 20 % validate
INSTANTS_PER_ROW = 100  # instants asked for each row, from which on every row is one
COARSE_STEPS = 1.1  # times the step: rows farther apart are no jitter
GOLDEN = 0.6180339887498949  # multiples of it are spread evenly over a step
LARGEST_MISS = 0.25  # of the way between two rows: where velocities miss more of it, a straight line is safer
FUTURE_STATES = ("u", "v", "r", "psi")
"""True states that a window holds over its horizon, beside the path."""


@dataclass(frozen=True, eq=False)
class Instants:
    """What is known at S instants of prediction; every array is in SI units, time first.

    columns : every measured column at the instant, name -> (S,); angles, also of thrusters and rudders, go on within
        the run as in an imported log: -10 deg after 0, not 350.
    past : the same columns P, ..., 1 steps before the instant, the oldest first, name -> (P, S); empty where no method
        needs them.
    planned : command in force from step i-1 to i of the horizon, i = 1..T, name -> (T, S); None where commands are held
        at their value at the instant.
    hidden : states of actuators at the instant, name -> (S,); None takes each actuator as having reached its order.
    estimates : what an observer knows at the instant, `observer.u`, ... -> (S,); empty without an observer.
    step : time [s] between the entries of past and planned; None: that of the predictor.
    run, t : name of the run of each instant and its time on the clock of the run [s], (S,); None where nobody knows.
    """

    columns: Mapping[str, NDArray[Any]] = field(repr=False)
    past: Mapping[str, Array] = field(default_factory=dict, repr=False)
    planned: Mapping[str, Array] | None = field(default=None, repr=False)
    hidden: Mapping[str, Array] | None = field(default=None, repr=False)
    estimates: Mapping[str, Array] = field(default_factory=dict, repr=False)
    step: float | None = None
    run: NDArray[np.str_] | None = field(default=None, repr=False)
    t: Array | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.columns["u"])

    def select(self, chosen: NDArray[Any] | Sequence[int] | slice) -> Instants:
        """Choose instants by a mask, by indices or by a slice; DataError for anything else."""
        chosen = _checked_choice(chosen, len(self))

        def last(values: Mapping[str, Array] | None) -> dict[str, Array] | None:
            return None if values is None else {name: array[..., chosen] for name, array in values.items()}

        return Instants(
            last(self.columns) or {},
            last(self.past) or {},
            last(self.planned),
            last(self.hidden),
            last(self.estimates) or {},
            self.step,
            None if self.run is None else self.run[chosen],
            None if self.t is None else self.t[chosen],
        )


@dataclass(frozen=True, eq=False)
class Windows:
    """S windows with a horizon of T steps; every array is in SI units, time first.

    run : name of the run, (S,).
    t : instant of prediction on the clock of the recording [s], (S,).
    columns : every dataset column at that instant, name -> (S,); angles unwrapped within the run.
    future : x, y [m] of eq. (11) after 1..T steps, (T, S, 2).
    planned : command in force from step i-1 to i, i = 1..T, its mean over the step, name -> (T, S).
    horizon, step : T, and its step [s].
    shared_clock : whether all runs lie on one clock; if not, equal times of two runs are different moments.
    past : the columns P, ..., 1 steps before the instant, the oldest first, name -> (P, S); empty for P = 0.
    states : true u, v, r [m/s, rad/s] and psi [rad] after 1..T steps, name -> (T, S).
    """

    run: NDArray[np.str_] = field(repr=False)
    t: Array = field(repr=False)
    columns: dict[str, NDArray[Any]] = field(repr=False)
    future: Array = field(repr=False)
    planned: dict[str, Array] = field(repr=False)
    horizon: int
    step: float
    shared_clock: bool = True
    past: dict[str, Array] = field(default_factory=dict, repr=False)
    states: dict[str, Array] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def num_past(self) -> int:
        """Number P of past steps that every window holds."""
        return len(next(iter(self.past.values()), ()))

    @property
    def begin(self) -> Array:
        """First instant of every past [s], (S,): the instant of prediction itself where there is no past."""
        return self.t - self.num_past * self.step

    @property
    def end(self) -> Array:
        """Last instant of every future [s], (S,)."""
        return self.t + self.horizon * self.step

    def instants(
        self,
        *,
        known: bool = False,
        hidden: Mapping[str, Array] | None = None,
        estimates: Mapping[str, Array] | None = None,
    ) -> Instants:
        """Input of a predictor: no future, except for the commands where they are `known` over the horizon."""
        planned = self.planned if known else None
        return Instants(self.columns, self.past, planned, hidden, estimates or {}, self.step, self.run, self.t)

    @property
    def spans(self) -> dict[str, tuple[float, float]]:
        """First and last instant [s] that the windows of every run see, pasts and futures included."""
        names, index = np.unique(self.run, return_inverse=True)
        first, last = np.full(len(names), np.inf), np.full(len(names), -np.inf)
        np.minimum.at(first, index, self.begin)
        np.maximum.at(last, index, self.end)
        return {str(name): (float(a), float(b)) for name, a, b in zip(names, first, last, strict=True)}

    def select(self, chosen: NDArray[Any] | Sequence[int] | slice) -> Windows:
        """Choose windows by a mask, by indices or by a slice; DataError for anything else."""
        chosen = _checked_choice(chosen, len(self))
        return Windows(
            run=self.run[chosen],
            t=self.t[chosen],
            columns={name: values[chosen] for name, values in self.columns.items()},
            future=self.future[:, chosen],
            planned={name: values[:, chosen] for name, values in self.planned.items()},
            horizon=self.horizon,
            step=self.step,
            shared_clock=self.shared_clock,
            past={name: values[:, chosen] for name, values in self.past.items()},
            states={name: values[:, chosen] for name, values in self.states.items()},
        )

    def locked(self) -> Windows:
        """The same windows, whose numbers nobody can change: who writes into them gets an error."""
        tables: dict[str, Any] = {
            name: {key: locked_view(values) for key, values in getattr(self, name).items()}
            for name in ("columns", "planned", "past", "states")
        }
        return replace(self, t=locked_view(self.t), future=locked_view(self.future), **tables)

    def touching(self, intervals: Iterable[tuple[float, float]]) -> WindowMask:
        """Windows that share a moment, past and future included, with any closed interval of the recording, (S,)."""
        touched = np.zeros(len(self), dtype=bool)
        for start, end in intervals:
            touched |= (self.begin <= end) & (self.end >= start)
        return touched


def locked_view(array: NDArray[Any]) -> NDArray[Any]:
    """A view of an array that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def _checked_choice(chosen: Any, count: int) -> NDArray[Any] | slice:
    """A mask, indices (n,) or a slice of so many entries; DataError for what chooses no row of them."""
    if isinstance(chosen, slice):
        return chosen
    places = np.asarray(chosen, dtype=np.intp if np.shape(chosen) == (0,) else None)
    try:
        known = places.ndim == 1 and np.arange(count)[places].ndim == 1
    except IndexError:
        known = False
    if not known:
        raise DataError(f"give a mask, indices or a slice of {count} entries to select by, not {chosen!r}")
    return places


def to_frame(north: Any, east: Any, north0: Any, east0: Any, psi0: Any) -> tuple[Any, Any]:
    """Position [m] in the body axes frozen at the moment of prediction (method, eq. 11); arguments broadcast.

    x = cos psi0 (N - N0) + sin psi0 (E - E0); y = -sin psi0 (N - N0) + cos psi0 (E - E0).
    """
    c, s = np.cos(psi0), np.sin(psi0)
    return c * (north - north0) + s * (east - east0), c * (east - east0) - s * (north - north0)


def from_frame(x: Any, y: Any, north0: Any, east0: Any, psi0: Any) -> tuple[Any, Any]:
    """North, east [m] of a position in frozen body axes: the inverse of `to_frame`."""
    c, s = np.cos(psi0), np.sin(psi0)
    return north0 + c * x - s * y, east0 + s * x + c * y


def cut_windows(
    dataset: Dataset,
    *,
    horizon: int,
    step: float = 1.0,
    interval: float = 1.0,
    path: PathSource = "position",
    past: int = 0,
) -> Windows:
    """Cut a window every `interval` [s], its whole past and future inside one unbroken stretch of one run.

    An instant of prediction is a row: the last one at or before each multiple of the interval, so that what is known
    depends on no later row. Windows come run by run, by name, whatever the order of the runs in the table.

    dataset : the recorded or simulated runs.
    horizon, step : T, and its step [s].
    interval : time between instants of prediction [s].
    path : the true path: recorded north, east, between rows farther apart than the step bent as u, v, psi turn; or the
        integral (trapezoid on the clock of the dataset) of u, v, psi from the start of the window, where positions are
        coarser than velocities.
    past : number P of steps before the instant that a window holds. The first instant of a run is P steps after its
        first row.

    DataError for an argument that does not fit, or where no run is as long as past and horizon together.
    """
    check_class("dataset", dataset, Dataset, "as of `read_dataset`", DataError)
    horizon, past = check_whole_number("horizon", horizon, 1, DataError), check_whole_number("past", past, 0, DataError)
    step, interval = check_positive("step", step, DataError), check_positive("interval", interval, DataError)
    check_choice("path", path, get_args(PathSource), DataError)
    shared = shares_clock(dataset)
    parts = []
    for run, rows in sorted(stretch_columns(dataset), key=itemgetter(0)):
        t = rows["t"]
        instants = _instants(t, past * step, horizon * step, interval)
        if len(instants):
            grid = np.minimum(instants + step * np.arange(horizon + 1)[:, None], t[-1])  # (T + 1, S)
            values = sample_columns(rows, grid)
            parts.append(
                Windows(
                    run=np.full(len(instants), run),
                    t=instants,
                    columns={name: column[0] for name, column in values.items()},
                    future=true_path_at(rows, grid, values, path, longest=step)[1:],
                    planned=mean_commands(rows, instants + step * np.arange(horizon + 1)[:, None]),
                    horizon=horizon,
                    step=step,
                    shared_clock=shared,
                    past=past_of_instants(rows, instants, past, step, path),
                    states={name: values[name][1:] for name in FUTURE_STATES},
                )
            )
    if not parts:
        history = f" and the past of {past * step:g} s" if past else ""
        raise DataError(f"no run is as long as the horizon of {horizon * step:g} s{history}")
    return join_windows(parts)


def _instants(t: Array, past: float, ahead: float, interval: float) -> Array:
    """Times of the rows t (N,) at which windows are cut, (S,): a past and a future [s] of each lie within t."""
    slack, first = clock_slack(t), t[0] + past
    last = np.floor((t[-1] - first - ahead + slack) / interval)
    if last > INSTANTS_PER_ROW * len(t):  # so close that no row is left out
        rows = np.flatnonzero((t >= first - slack) & (t <= t[-1] - ahead + slack))
        return np.asarray(t[rows])
    wanted = first + interval * np.arange(max(0, int(last) + 1))
    rows = np.unique(np.searchsorted(t, wanted + slack, side="right") - 1)
    return np.asarray(t[rows[t[rows] >= first - slack]])


def past_of_instants(rows: StretchRows, instants: Array, past: int, step: float, path: PathSource) -> dict[str, Array]:
    """Columns of one unbroken stretch at P, ..., 1 steps before the instants (S,) [s], name -> (P, S); none for P = 0.

    x, y [m] are the positions then in the frame (11) of the instant, by the same true path as the future, but straight
    between rows, as in exported predictors; the columns north and east and the flags are left out.
    """
    if not past:
        return {}
    t = np.asarray(rows["t"])
    grid = np.concatenate([instants - step * np.arange(past, 0, -1)[:, None], instants[None]])  # (P + 1, S)
    grid = np.clip(grid, t[0], t[-1])
    values = sample_columns(rows, grid)
    before = true_path_at(rows, grid, values, path, origin=-1)[:-1]
    kept = {name: column[:-1] for name, column in values.items() if name not in ("flags", "north", "east")}
    return {**kept, "x": before[..., 0], "y": before[..., 1]}


def future_of_instants(rows: StretchRows, instants: Array, horizon: int, step: float, path: PathSource) -> Array:
    """True paths (T, S, 2) [m] in the frame (11) after instants (S,) [s] of one unbroken stretch that holds them."""
    grid = np.minimum(instants + step * np.arange(horizon + 1)[:, None], np.asarray(rows["t"])[-1])
    return true_path_at(rows, grid, sample_columns(rows, grid), path, longest=step)[1:]


def true_path_at(
    rows: StretchRows,
    instants: Array,
    values: Mapping[str, Array],
    path: PathSource,
    *,
    origin: int = 0,
    longest: float = np.inf,
) -> Array:
    """True positions (T, ..., 2) [m] at instants (T, ...) [s] of one unbroken stretch, in the frame (11) of the first.

    values : what `sample_columns` gives at the instants. origin : index of another instant to take the frame of.
    longest : time [s]; logged positions are joined by straight lines; rows farther apart as in `_bent_positions`.
    """
    north, east = (
        travelled_position(rows, instants) if path == "velocity" else _bent_positions(rows, instants, values, longest)
    )
    return np.stack(to_frame(north, east, north[origin], east[origin], values["psi"][origin]), axis=-1)


def _bent_positions(
    rows: StretchRows, instants: Array, values: Mapping[str, Array], longest: float
) -> tuple[Array, Array]:
    """North and east [m] at instants, of one stretch whose rows farther apart than `longest` [s] a curve joins.

    The curve is what u, v, psi travel, and what is then missing to the next row grows evenly: a steady current bends
    nothing. Where the velocities miss more than `LARGEST_MISS` of the way between two rows the line stays straight.
    """
    t = np.asarray(rows["t"])
    slack, apart = clock_slack(t), np.diff(t)
    names = ("north", "east")
    if not (apart > longest + slack).any():
        return values["north"], values["east"]
    at_rows = travelled_position(rows, t)
    way = np.hypot(*(np.diff(np.asarray(rows[name])) for name in names))
    missed = np.hypot(*(np.diff(np.asarray(rows[name]) - along) for name, along in zip(names, at_rows, strict=True)))
    bends = np.append((apart > longest + slack) & (missed <= LARGEST_MISS * way), False)
    row = np.clip(np.searchsorted(t, instants + slack, side="right") - 1, 0, len(t) - 1)
    between = bends[row] & (instants > t[row] + slack)
    north, east = (
        np.where(between, values[name] + along - np.interp(instants, t, at), values[name])
        for name, along, at in zip(names, travelled_position(rows, instants), at_rows, strict=True)
    )
    return north, east


def join_windows(parts: Sequence[Windows]) -> Windows:
    """All windows of several sets with the same horizon, step, clock and columns, in order."""
    first = parts[0]
    return Windows(
        run=np.concatenate([part.run for part in parts]),
        t=np.concatenate([part.t for part in parts]),
        columns={name: np.concatenate([part.columns[name] for part in parts]) for name in first.columns},
        future=np.concatenate([part.future for part in parts], axis=1),
        planned={name: np.concatenate([part.planned[name] for part in parts], axis=1) for name in first.planned},
        horizon=first.horizon,
        step=first.step,
        shared_clock=first.shared_clock,
        past={name: np.concatenate([part.past[name] for part in parts], axis=1) for name in first.past},
        states={name: np.concatenate([part.states[name] for part in parts], axis=1) for name in first.states},
    )


def choose_evenly(indices: NDArray[np.int64], count: int, phase: float = 0.5) -> NDArray[np.int64]:
    """At most `count` of some indices, evenly spread; `phase`, from 0 to 1, is the place of each in its stretch."""
    if len(indices) <= count:
        return indices
    places = np.round((np.arange(count) + phase) / count * len(indices) - 0.5).astype(int)
    return np.asarray(indices[places])


def part_of_runs(run: NDArray[np.str_], most: int) -> NDArray[np.int64]:
    """Places of about `most` of the windows (S,), evenly taken from each run, one at least; all where they are few.

    run : name of the run of each window, (S,), in the order of time. Each run begins at another part of a step, so that
    all moments of alike manoeuvres are seen.
    """
    if len(run) <= most:
        return np.arange(len(run))
    taken = []
    for number, name in enumerate(np.unique(run)):
        mine = np.flatnonzero(run == name)
        count = max(1, round(len(mine) * most / len(run)))
        taken.append(choose_evenly(mine, count, (0.5 + number * GOLDEN) % 1.0))
    return np.sort(np.concatenate(taken))


def gaps_of_runs(dataset: Dataset, least: float) -> dict[str, list[tuple[float, float]]]:
    """Times (start, end) [s] without rows, inside the unbroken stretches of each run; runs that have none are left out.

    They are longer than `least` [s] and than three usual steps of the stretch, as in the check `gap`. A window that
    reaches over one is interpolated there.
    """
    spans: dict[str, list[tuple[float, float]]] = {}
    for run, rows in stretches_of_runs(dataset):
        t = rows["t"].to_numpy()
        steps = np.diff(t)
        if not len(steps):
            continue
        for k in np.flatnonzero(steps > _longest_step(t, least)):
            spans.setdefault(run, []).append((float(t[k]), float(t[k + 1])))
    return spans


def longest_gap_in_words(spans: Mapping[str, Iterable[tuple[float, float]]]) -> str:
    """The longest of some times without rows, in words."""
    length, start, run = max((end - start, start, run) for run, times in spans.items() for start, end in times)
    return f"the longest {length:.3g} s after t = {start:g} s of {run!r}"


def gaps_in_words(dataset: Dataset, least: float) -> str:
    """How many times without rows the runs have, and the longest; empty without one. least : as of `gaps_of_runs`."""
    spans = gaps_of_runs(dataset, least)
    count = sum(map(len, spans.values()))
    return f"{count} {plural_word(count, 'time')} without rows, {longest_gap_in_words(spans)}" if count else ""


def coarse_in_words(dataset: Dataset, step: float) -> str:
    """That rows of the coarsest run are farther apart than a step [s], in words; empty where they are not."""
    between = float(dataset.frame.groupby("run", sort=False)["t"].agg(lambda t: t.diff().median()).max())
    if not between > COARSE_STEPS * step:
        return ""
    return f"rows are {between:.3g} s apart and the step is {step:g} s: path and motion between rows are interpolated"


def is_without_rows(t: Array, instants: Array, least: float) -> NDArray[np.bool_]:
    """Whether instants [s], any shape, lie in a gap of a stretch with rows at t (N,). least : as of `gaps_of_runs`."""
    steps, slack = np.diff(t), clock_slack(t)
    if not len(steps):
        return np.zeros(np.shape(instants), dtype=bool)
    row = np.clip(np.searchsorted(t, instants + slack, side="right") - 1, 0, len(steps) - 1)
    inside = (instants > t[row] + slack) & (instants < t[row + 1] - slack)
    return np.asarray(inside & (steps[row] > _longest_step(t, least)))


def _longest_step(t: Array, least: float) -> float:
    """Longest time [s] between two rows of a stretch at t (N,) that is no time without rows."""
    return max(least, GAP_STEPS * float(np.median(np.diff(t)))) + clock_slack(t)


def windows_over_spans(windows: Windows, spans: Mapping[str, Iterable[tuple[float, float]]]) -> WindowMask:
    """Windows (S,) that see a part of the spans (start, end) [s] of their run, pasts and futures included."""
    seen = np.zeros(len(windows), dtype=bool)
    for run, times in spans.items():
        of_run = windows.run == run
        for start, end in times:
            seen |= of_run & (windows.begin < end) & (windows.end > start)
    return seen


def covered_time(windows: Windows) -> float:
    """Recorded time [s] that windows see, pasts and futures included: the length of the union of their intervals.

    Runs with separate clocks are added up; on a shared clock a moment in two runs counts once.
    """
    length = (windows.num_past + windows.horizon) * windows.step
    runs = [windows.t] if windows.shared_clock else [windows.t[windows.run == run] for run in windows.spans]
    # intervals of one length: each adds what lies after the start of the one before, at most all of itself
    return sum((length + float(np.minimum(np.diff(np.sort(t)), length).sum()) for t in runs if len(t)), 0.0)


def fold_masks(windows: Windows, validation_runs: Iterable[str]) -> tuple[WindowMask, WindowMask]:
    """Split windows into (training, validation), (S,) each, so that no moment is seen by both, futures included.

    Validation windows are those of the validation runs. A training window is one of another run that touches none
    of the validation runs' spans; so none of the validation windows touches a training window either.
    """
    names = sorted(validation_runs)
    validation = np.isin(windows.run, names)
    training = ~validation
    if windows.shared_clock:
        training &= ~windows.touching(windows.spans[name] for name in names)
    for part, mask in (("training", training), ("validation", validation)):
        if not mask.any():
            raise DataError(f"no {part} window is left when {', '.join(names)} validate")
    return training, validation


def part_folds(windows: Windows) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """(Training, validation) indices that leave out one run part by part, in time, so that no moment is seen by both.

    Three parts, or two where the middle one leaves nothing. Raises DataError where even that leaves nothing.
    """
    order = np.argsort(windows.t, kind="stable")
    for count in (3, 2):
        folds = []
        for part in np.array_split(order, count):
            if len(part):
                touched = windows.touching([(float(windows.begin[part].min()), float(windows.end[part].max()))])
                folds.append((np.flatnonzero(~touched), np.sort(part)))
        if all(len(training) for training, _ in folds):
            return folds
    (run,) = windows.spans
    length, span = (windows.num_past + windows.horizon) * windows.step, float(windows.end.max() - windows.begin.min())
    raise DataError(
        f"the {len(windows)} {plural_word(len(windows), 'window spans', 'windows span')} in run {run!r} "
        f"{span:g} s, too short to train and validate with windows of "
        f"{length:g} s, which takes more than {3 * length:g} s: shorten the horizon, or raise prediction.samples if set"
    )


def run_folds(
    windows: Windows, validation: str, seed: int, num_folds: int = 1
) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """(Training, validation) indices of windows, split by run, so that no moment is seen by both.

    validation : `runs` leaves out every run in turn; `share` holds out a fifth of the runs, drawn by `seed`.
    num_folds : with 2 or more, runs are dealt into so many folds instead, or as many as there are runs.

    A single run is left out part by part. Raises DataError where a part would have no windows.
    """
    runs = list(windows.spans)
    if len(runs) == 1:
        return part_folds(windows)
    if num_folds > 1:
        held_out = list(split_folds(runs, min(num_folds, len(runs)), seed))
    elif validation == "runs":
        held_out = [(run,) for run in runs]
    else:
        held_out = [split_runs(runs, VALIDATION_SHARE, seed)[1]]
    masks = [fold_masks(windows, names) for names in held_out]
    return [(np.flatnonzero(training), np.flatnonzero(judged)) for training, judged in masks]


def _draw_order(runs: Iterable[str], seed: int, purpose: int) -> list[str]:
    """Draw the runs in random order, the same for any order in which they are given, another for each purpose.

    Else the first runs held out of the largest amount would be just the runs of a smaller one.
    """
    names = sorted(set(runs))
    return [names[index] for index in np.random.default_rng([seed, purpose]).permutation(len(names))]


def split_folds(runs: Iterable[str], num_folds: int, seed: int) -> list[tuple[str, ...]]:
    """Deal the runs into folds of (nearly) equal number: the validation runs of every fold."""
    drawn = _draw_order(runs, seed, FOLDED)
    return [tuple(drawn[fold::num_folds]) for fold in range(num_folds)]


def split_runs(runs: Iterable[str], share: float, seed: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Split the runs into (rest, held out), `share` of them held out, at least one on each side."""
    drawn = _draw_order(runs, seed, HELD_OUT)
    count = min(max(round(share * len(drawn)), 1), len(drawn) - 1)
    return tuple(drawn[count:]), tuple(drawn[:count])


def nested_runs(runs: Iterable[str], amounts: Iterable[int], seed: int) -> dict[int, tuple[str, ...]]:
    """Nested draws D_a c D_b c ... for amounts a < b < ...: the first ones of one random order."""
    drawn = _draw_order(runs, seed, NESTED)
    return {amount: tuple(drawn[:amount]) for amount in sorted(set(amounts))}


def constant_motion(windows: Windows) -> Array:
    """Paths (T, S, 2) [m] in the frame (11) if u, v, r stayed as they are: exact arcs, straight as r goes to 0."""
    u, v, r = (windows.columns[name] for name in ("u", "v", "r"))
    time = windows.step * np.arange(1, windows.horizon + 1)[:, None]
    half = r * time / 2
    chord = time * np.sinc(half / np.pi)  # integral of cos and sin over a turn of 2 half
    along, across = chord * np.cos(half), chord * np.sin(half)
    return np.asarray(np.stack([u * along - v * across, u * across + v * along], axis=-1))
