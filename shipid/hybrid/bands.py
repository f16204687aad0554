"""Bands: a region around every step of a predicted path that holds the whole path, or each step, with a probability.

The region at step k is an ellipse along and across the predicted track, with half axes
`radius(level) * scale[k] * growth`: how errors grow over the horizon, and how much harder this prediction is than
others. The radius is calibrated on runs that no model saw: `shipid.hybrid.calibration`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipid.errors import DataError, suggest_name
from shipid.hybrid.features import MOTIONS
from shipid.hybrid.stored import StoredData
from shipid.metrics import Array, vector_lengths

Places = NDArray[np.int64]
LEVELS = np.arange(1, 100) / 100
"""Levels that the tables of a band hold; between them it interpolates."""
FEWEST = 3  # runs: one is left out, and two are needed to see how much runs differ
TRAITS = ("length", "turn", "change", "slip", "distance")
"""What the growth of a band depends on, see `prediction_traits`."""


@dataclass(frozen=True, eq=False)
class Region:
    """Regions around predicted paths, in the frame (11) of the instants.

    ahead : unit vector (T, S, 2) of the predicted track. along, across : half axes (T, S) [m].
    """

    ahead: Array
    along: Array
    across: Array

    @property
    def radius(self) -> Array:
        """Radius (T, S) [m] of the circle with the area of the region."""
        return np.asarray(np.sqrt(self.along * self.across))

    def reach(self, errors: Array) -> Array:
        """How far errors (T, S, 2) [m] reach, (T, S): 1 at the border of the region; 0 without an error."""
        along, across = split_along_track(errors, self.ahead)
        with np.errstate(divide="ignore", invalid="ignore"):
            parts = np.stack([along / self.along, across / self.across], axis=-1)
        return vector_lengths(np.where(np.stack([along, across], axis=-1) == 0, 0.0, parts))

    def holds(self, errors: Array) -> NDArray[np.bool_]:
        """Whether the whole path, with errors (T, S, 2) [m], lies in its band, (S,)."""
        return np.asarray(np.all(self.reach(errors) <= 1, axis=0))


@dataclass(frozen=True, eq=False)
class FastMotion(StoredData):
    """Growth of a band with motion that is faster than manoeuvres, such as that of waves: errors grow in proportion.

    past : rows before the instant that are looked at. weights : (6,) of each of `fast_power`: the band grows with the
    root of the greatest weighted one, from 1 on. So longer waves count as shorter and higher ones do.
    """

    past: int
    weights: Array

    def growth(self, columns: Mapping[str, Array], past: Mapping[str, Array]) -> Array:
        """How much wider (S,) a band is, 1 or more."""
        power = fast_power(columns, past, self.past) * self.weights
        size: Array = np.sqrt(np.maximum(power.max(axis=1), 1.0))
        return size


@dataclass(frozen=True, eq=False)
class Bands(StoredData):
    """Calibrated bands of a predictor.

    runs : number of runs that calibrated it.
    along, across : scale (T,) [m] of the errors along the predicted track and across it.
    whole : (99,) radius for each of `LEVELS` that holds whole paths.
    steps : (99, T) the same for each step alone.
    names : columns in which the distance from training is measured. centres : (m, d) points of the training windows.
    spread : (d,) what counts as distance 1 in each column.
    far : the greatest distance that calibration has seen: beyond it the band grows in proportion.
    middle, deviation, low, high : (5,) mean, standard deviation, least and greatest value of each of `TRAITS`.
    slopes : (5,) growth per standard deviation of each trait, as the logarithm.
    length : mean length [m] of the predicted paths of calibration.
    kinds : kind of manoeuvre -> number of runs, where it was known.
    by_kind : (kinds, 99) radius that holds whole paths of runs of each kind, and scales : (kinds, T, 2) [m] of their
    errors along and across.
    fast : growth with fast motion; None where windows hold too short a past.
    """

    runs: int
    along: Array
    across: Array
    whole: Array
    steps: Array
    names: tuple[str, ...]
    centres: Array
    spread: Array
    far: float
    middle: Array
    deviation: Array
    low: Array
    high: Array
    slopes: Array
    length: float
    kinds: Mapping[str, int]
    by_kind: Array
    scales: Array
    fast: FastMotion | None = None

    def region(
        self,
        paths: Array,
        columns: Mapping[str, Array],
        step: float,
        level: float,
        *,
        pointwise: bool = False,
        kind: str | None = None,
        past: Mapping[str, Array] | None = None,
        size: Array | None = None,
    ) -> Region:
        """Return the region around paths (T, S, 2) [m] in the frame (11); DataError as of `check`.

        columns : measured columns at the instants, name -> (S,). step : of the path [s].
        level : share of whole paths that the region holds, such as 0.9; with `pointwise`, of positions at each step.
        kind : kind of manoeuvre of the run: the share then holds for runs of this kind.
        past : of the instants, name -> (P, S): taken where the band grows with fast motion.
        size : `growth` of these paths (S,), where it is known.
        """
        self.check(level, kind)
        if kind is not None and pointwise:
            raise DataError("bands of each step alone are not calibrated by kind of manoeuvre: leave `kind` out")
        radius = radius_at_level(self.steps if pointwise else self.table(kind), level)
        size = self.growth(paths, columns, step, past) if size is None else size
        half = (self.along, self.across) if kind is None else self.scales[list(self.kinds).index(kind)].T
        return Region(track_directions(paths), *(np.outer(scale * radius, size) for scale in half))

    def table(self, kind: str | None = None) -> Array:
        """Radius (99,) for each of `LEVELS` that holds whole paths, of runs of a kind."""
        return self.whole if kind is None else self.by_kind[list(self.kinds).index(kind)]

    def growth(
        self, paths: Array, columns: Mapping[str, Array], step: float, past: Mapping[str, Array] | None = None
    ) -> Array:
        """How much wider (S,) the band of each prediction is than that of an average one [1]."""
        away = self.away(np.stack([columns[name] for name in self.names], axis=1))
        seen = np.clip(
            prediction_traits(paths, columns, step, np.minimum(away, self.far), self.length), self.low, self.high
        )
        fast = 1.0 if self.fast is None else self.fast.growth(columns, past or {})
        size: Array = np.exp(((seen - self.middle) / self.deviation) @ self.slopes) * np.maximum(away / self.far, 1.0)
        return size * fast

    def away(self, points: Array) -> Array:
        """Distance (S,) of points (S, d) from the windows of training."""
        return nearest_distances(points / self.spread, self.centres / self.spread)

    def check(self, level: float, kind: str | None = None) -> None:
        """Raise DataError, one sentence, where no band of this level can be promised."""
        if not isinstance(level, int | float | np.floating) or not 0 < level <= LEVELS[-1]:
            raise DataError(f"{level} is no level of a band: give a share above 0 and up to 0.99, such as 0.9")
        if kind is not None and not (isinstance(kind, str) and kind in self.kinds):
            raise DataError(f"no run of the kind {kind!r} calibrated this band: {suggest_name(kind, self.kinds)}")
        if not self.promises(level, kind):
            of, runs = ("", self.runs) if kind is None else (f" of the kind {kind!r}", self.kinds[kind])
            need = f"a band of {100 * level:g} % needs {runs_needed(level)} runs or more{of} to calibrate it"
            raise DataError(f"{need}: there are {runs}")

    def promises(self, level: float, kind: str | None = None) -> bool:
        """Whether there were enough runs for a level, or enough runs of a kind of manoeuvre."""
        runs = self.runs if kind is None else self.kinds.get(kind, 0)
        return 0 < level <= LEVELS[-1] and runs >= runs_needed(level)


def runs_needed(level: float) -> int:
    """Fewest runs that a level needs, 9 for 0.9: a new run is the worst of G + 1 with the probability 1 / (G + 1)."""
    return max(FEWEST, math.ceil(level / (1 - level) - 1e-9))


def radius_at_level(table: Array, level: float) -> Array:
    """Radius for a level from a table (99, ...) for `LEVELS`; below the first level it goes to 0."""
    place = level * 100 - 1
    if place < 0:
        return np.asarray(table[0] * (place + 1))
    lower = min(int(place + 1e-9), len(table) - 1)
    share = max(place - lower, 0.0)
    upper = min(lower + 1, len(table) - 1)
    return np.asarray(table[lower] + share * (table[upper] - table[lower]))


def track_directions(paths: Array) -> Array:
    """Unit vectors (T, S, 2) along paths (T, S, 2) that start at the origin; ahead where a path does not move."""
    flat = paths.reshape(len(paths), -1)
    first = np.concatenate([np.zeros_like(flat[:1]), flat[:-1]])
    chords = np.concatenate([flat[1:] - first[:-1], flat[-1:] - first[-1:]])
    x, y = chords[:, ::2], chords[:, 1::2]
    size = np.hypot(x, y)
    moves = size > 1e-12 * size.max(axis=0)
    length = np.where(moves, size, 1.0)
    return np.stack([np.where(moves, x / length, 1.0), np.where(moves, y / length, 0.0)], axis=-1)


def split_along_track(errors: Array, ahead: Array) -> tuple[Array, Array]:
    """Errors (..., 2) along the unit vectors `ahead` and across them, to starboard."""
    along = errors[..., 0] * ahead[..., 0] + errors[..., 1] * ahead[..., 1]
    return along, errors[..., 1] * ahead[..., 0] - errors[..., 0] * ahead[..., 1]


def fast_filters(rows: int) -> Array:
    """Matrices (2, N, N) for series of N rows: third differences; the sum of what a cubic leaves, less a parabola."""
    time = np.linspace(-1, 1, rows)
    cubic, parabola = (np.linalg.qr(np.polynomial.legendre.legvander(time, degree))[0] for degree in (3, 2))
    total = np.tri(rows) @ (np.eye(rows) - cubic @ cubic.T)
    third = np.zeros((rows, rows))
    third[: max(rows - 3, 0)] = np.diff(np.eye(rows), 3, axis=0)
    return np.stack([third, total - parabola @ (parabola.T @ total)])


def fast_power(columns: Mapping[str, Array], past: Mapping[str, Array], rows: int) -> Array:
    """Mean squares (S, 6) of u, v, r over the last rows and the instant, each through both `fast_filters`."""
    series = [np.concatenate([past[name][-rows:], np.stack([columns[name]])]) for name in MOTIONS]  # (N, S) each
    filters = fast_filters(rows + 1)
    return np.stack([np.square(one @ values).mean(axis=0) for values in series for one in filters], axis=1)


def path_chords(paths: Array) -> tuple[Array, Array]:
    """Three chords of paths (T, S, 2) [m] that start at the origin, one for each third of the steps: x, y (3, S)."""
    flat = paths.reshape(len(paths), -1)
    ends = [-(-len(paths) * part // 3) - 1 for part in (1, 2, 3)]
    chords = np.diff(np.concatenate([np.zeros_like(flat[:1]), flat[ends]]), axis=0)
    return chords[:, ::2], chords[:, 1::2]


def prediction_traits(paths: Array, columns: Mapping[str, Array], step: float, away: Array, length: float) -> Array:
    """What makes a prediction easy or hard, (S, 5), a column for each of `TRAITS`.

    length : logarithm of the length of the predicted path, by three chords, over that of an average one.
    turn : by how much the predicted track turns between the chords [rad]. change : by how much faster or slower it
    turns later [rad]. slip : how far the turn is from what the present yaw rate would give [rad].
    distance : logarithm of 1 + the distance from the windows of training.
    """
    x, y = path_chords(paths)
    dot = x[:-1] * x[1:] + y[:-1] * y[1:]
    angles = np.arctan2(x[:-1] * y[1:] - y[:-1] * x[1:], np.where(dot == 0, 0.0, dot))  # a ship at rest does not turn
    first, second = angles
    held = columns["r"] * step * len(paths) * 2 / 3
    return np.column_stack(
        [
            np.log(np.hypot(x, y).sum(axis=0) / length + 0.02),
            np.abs(first + second),
            np.abs(second - first),
            np.minimum(np.abs(first + second - held), np.pi),
            np.log1p(away),
        ]
    )


def nearest_distances(
    points: Array, centres: Array, run: Places | None = None, run_of_centre: Places | None = None
) -> Array:
    """Root mean square distance over coordinates of points (S, d) from the nearest of the centres (m, d), (S,).

    run, run_of_centre : of each point (S,) and centre (m,): those of the same run are passed over.
    """
    middle = centres.mean(axis=0)
    points, centres = points - middle, centres - middle  # else large coordinates would cost digits
    squares = (centres**2).sum(axis=1)[:, None] - 2 * centres @ points.T
    if run is not None and run_of_centre is not None:
        squares[run_of_centre[:, None] == run] = np.inf
    which = squares.argmin(axis=0)
    away = points - centres[which]  # anew: sums of squares leave half the digits
    return np.asarray(np.sqrt((away**2).mean(axis=1)))


class AdaptiveState(NamedTuple):
    """State of a band that adapts along a run.

    miss : share of paths that it now aims to miss; below 0 the band grows until it holds, above 1 it is empty.
    wanted : 1 - level. rate : how fast it adapts, per horizon.
    """

    miss: float
    wanted: float
    rate: float


def start_adaptation(level: float, rate: float = 0.02) -> AdaptiveState:
    """Return the state at the start of a run: the band is as calibrated."""
    return AdaptiveState(1 - level, 1 - level, rate)


def adapt_band(state: AdaptiveState, missed: bool, together: int = 1) -> AdaptiveState:
    """Return the state after one more path could be judged: Gibbs and Candes (2021), eq. (2).

    The long-run share of misses goes to that wanted: |share - wanted| <= const / (rate n) after n horizons.

    missed : whether the path, predicted a horizon ago, left the band that was then given for it.
    together : how many paths begin within a horizon: each counts so much less, for they miss by the same error.
    """
    return state._replace(miss=state.miss + state.rate / together * (state.wanted - float(missed)))


def adaptive_factor(state: AdaptiveState, whole: Array) -> float:
    """Return how much wider than calibrated the band is now, from the table `whole` (99,) of its `Bands`.

    Beyond the levels of the table it grows by e for each 0.05.
    """
    usual = float(radius_at_level(whole, min(1 - state.wanted, LEVELS[-1])))
    level = 1 - state.miss
    if level <= 0 or usual == 0:
        return 0.0 if level <= 0 else 1.0
    inside = float(radius_at_level(whole, min(level, float(LEVELS[-1]))))
    return inside / usual * math.exp(max(level - float(LEVELS[-1]), 0.0) / 0.05)
