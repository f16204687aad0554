"""A vessel against its log, before any study: what is off, and which few numbers would explain it.

The log decides by prediction: the vessel starts from recorded instants with the recorded commands, and its mean
position error over the horizon is compared with that of constant u, v, r. Groups of numbers that a first guess gets
wrong, such as the size of the screw, are scaled by one factor each. The factor that lowers the error most is taken,
then the next.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import tomlkit
from numpy.typing import NDArray
from tomlkit.items import KeyType, SingleKey

from shipid.data.dataset import Dataset, clock_slack, pieces
from shipid.data.windows import Instants, PathSource, Windows, cut_windows
from shipid.engine.engines import REPEATED
from shipid.engine.integrate import Method as Integrator
from shipid.errors import DocumentError
from shipid.hybrid.physics import Physics, check_columns
from shipid.identification.late import Late, between_rows, late_commands
from shipid.identification.plausible import outside
from shipid.metrics import position_error
from shipid.physics.signals import is_shaft, steers
from shipid.simulation.approach import acceleration
from shipid.study.prepare import constant_motion, window_memory
from shipid.units import RPM
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel

Array = NDArray[np.float64]
Gear = tuple[tuple[str, float], ...]
"""Changed numbers of actuators: dotted path and value of each."""

MOST_WINDOWS = 120
MOST_CHANGES = 5
FACTORS = (0.35, 0.55, 0.75, 1.3, 1.8, 2.8)
FAR = (0.15, 0.4, 2.5, 7.0)  # of what may be off by more: lags and rates
FINER = (0.82, 0.93, 1.07, 1.22)
SWEEPS = 2  # over all groups taken, once every one is taken
WORTH = 0.06  # of the error that a further group must save
SAVING = 0.15  # of the error that all groups together must save, else nothing is reported
LEAST_ERROR = 1e-3  # m: no log has positions that are so near to the truth; a smaller error is none
PENALTY = 30.0  # times the error of constant u, v, r: no window counts more, such as one that diverges
STRAIGHT, STEADY = np.radians(4.0), 0.03  # of heading at every step and of the speed at the end: a steady straight run
TURNS, LEAST_TURN = 10, np.radians(5.0)  # windows, and how far one turns, from which the turning is judged
FEW = 3  # windows
MODEST = 5.0  # factor
NEWTON = 3  # steps of the search for a current
FASTEST = 40.0  # m/s: 78 kn, above the speed of ships
STRONG = 0.7  # of the median speed: a stronger current is none
UNITS = (60.0, 1 / 60.0)  # rev/s read as rpm, and rpm as rev/s
ALIKE = 1.5  # factor within which a speed is explained by a unit
NEAR = 0.5  # of the error of constant u, v, r, at most, where vessel and log agree
OFF = 1.15  # a factor by which speed or turning may differ before it is reported

_HULL = r"hull\.(?:derivatives|prime_derivatives|mmg|abkowitz)\."


@dataclass(frozen=True)
class Group:
    """Numbers of a vessel that share one factor.

    name : what they say, in words. pattern : regular expression of their dotted paths. low, high : of the factor.
    """

    name: str
    pattern: str
    low: float
    high: float


GROUPS = (
    Group("size of the screw", r"thruster\.[^.]+\.D_p", 0.35, 2.5),
    Group("shaft speed of the service speed", r"thruster\.[^.]+\.n_0", 0.3, 3.0),
    Group("resistance", rf"hull\.mmg\.R_0|hull\.resistance\.R_\d|{_HULL}X_[u|]+", 0.3, 4.0),
    Group("rudder", r"thruster\.[^.]+\.(?:A_R|[YN]_u*delta(?:delta){0,2})", 0.3, 3.0),
    Group("flow at the rudder", r"thruster\.[^.]+\.gamma_R_(?:plus|minus)", 0.3, 2.5),
    Group("rate of the steering gear", r"thruster\.[^.]+\.actuator\.(?:delta|alpha)\.rate", 0.1, 10.0),
    Group("lag of the steering gear", r"thruster\.[^.]+\.actuator\.(?:delta|alpha)\.T", 0.1, 10.0),
    Group("lag of the shaft", r"thruster\.[^.]+\.actuator\.n\.T", 0.1, 10.0),
    Group("yaw damping", rf"{_HULL}N_(?=[ur|]*r)[ur|]+", 0.25, 4.0),
    Group("moment of drift", rf"{_HULL}N_(?=[uv|]*v)[uv|]+", 0.25, 3.0),
    Group("side force of drift", rf"{_HULL}Y_(?=[uv|]*v)[uv|]+|hull\.crossflow\.C_d", 0.3, 3.0),
    Group("side force of turning", rf"{_HULL}Y_(?=[ur|]*r)[ur|]+", 0.25, 3.0),
    Group("speed lost in turns", rf"{_HULL}X_(?:vr|vv|rr)", 0.25, 4.0),
    Group("inertia in yaw", r"inertia\.I_z|added_mass\.N_rdot", 0.4, 2.5),
    Group("thrust of the tunnel thruster", r"thruster\.[^.]+\.F_[123]", 0.1, 4.0),
)
"""Groups in which a first guess errs, and how far at most."""


@dataclass(frozen=True)
class Change:
    """A group of numbers scaled.

    values : dotted path -> new value. error : mean error [m] with this change and those before it.
    """

    group: Group
    factor: float
    values: Mapping[str, float]
    error: float


@dataclass(frozen=True)
class Current:
    """A steady current of all runs, V_c [m/s] towards beta_c [rad]. error : mean error [m] with it.

    each : whether every run has another one; V_c is then their root mean square, and beta_c is NaN.
    """

    V_c: float
    beta_c: float
    error: float
    each: bool = False

    @property
    def words(self) -> str:
        """What it is, in words."""
        if self.each:
            remedy = f"identify with --nuisance current={self.V_c:.1g}"
            return f"another current in each run, {self.V_c:.2g} m/s, which is not in the log ({remedy}),"
        towards = np.degrees(self.beta_c) % 360.0
        return f"a steady current of {self.V_c:.2g} m/s towards {towards:.0f} deg, which is not in the log,"


@dataclass(frozen=True)
class Look:
    """How a vessel and a log agree.

    ahead : [s]. alone, constant : mean position error [m] over it of the vessel, with the recorded commands, and of
        constant u, v, r. facts : what differs, in words. changes : those that explain it, in the order of their worth.
    late : commands that come late, where the vessel errs less if they change between the rows, and its mean error [m]
        then; what else explains the error is beside them.
    current : that explains more than all changes alone; the changes are then beside it.
    integrator : by which the vessel errs so.
    """

    vessel: Vessel
    ahead: float
    alone: float
    constant: float
    facts: tuple[str, ...]
    changes: tuple[Change, ...] = field(default=())
    current: Current | None = None
    late: tuple[Late, float] | None = None
    integrator: Integrator = "rk4"

    @property
    def timely(self) -> float:
        """Mean error [m] of the vessel as it is, with commands that are not late."""
        return self.alone if self.late is None else self.late[1]

    @property
    def corrected(self) -> float:
        """Mean error [m] with all that explains it."""
        before = self.timely if self.current is None else self.current.error
        return self.changes[-1].error if self.changes else before

    @property
    def wrong(self) -> bool:
        """Whether the vessel should not be used as it is."""
        explained = bool(self.changes) or self.current is not None
        return explained or bool(self.facts) or self._worse

    @property
    def _worse(self) -> bool:
        """Whether the vessel errs as much as constant u, v, r, or more."""
        return self.timely >= max(self.constant, LEAST_ERROR)

    @property
    def values(self) -> dict[str, float]:
        """Dotted path -> value of all changes."""
        return {path: value for change in self.changes for path, value in change.values.items()}

    @property
    def sentence(self) -> str:
        """One line: what is off, and which number would explain it."""
        errors = f"mean error over {self.ahead:g} s {self.alone:.3g} m, of constant u, v, r {self.constant:.3g} m"
        seen = f"{'; '.join(self.facts)}; {errors}" if self.facts else errors
        causes: list[tuple[str, float]] = []
        if self.late is not None:
            causes.append((self.late[0].words, self.late[1]))
        if self.current is not None:
            causes.append((self.current.words, self.current.error))
        causes += [(_shown(self.vessel, one), one.error) for one in self.changes]
        if not causes:
            if self._worse:
                return f"{self.vessel.name} is worse than constant u, v, r, and no single number explains it: {seen}"
            if self.facts:
                return f"{self.vessel.name} and the log differ, and no single number explains it: {seen}"
            near = self.timely <= max(NEAR * self.constant, LEAST_ERROR)
            how = "and the log agree" if near else "is better than constant u, v, r"
            return f"{self.vessel.name} {how}, and no single number would explain the rest: {seen}"
        (first, error), *others = causes
        explained = (
            f"{first}{', which' * (self.late is not None)} would explain {self._part(error)} of it ({error:.3g} m)"
        )
        more = f", then {', '.join(words for words, _ in others)} ({self.corrected:.3g} m)" if others else ""
        return f"{self.vessel.name}: {seen}: {explained}{more}"

    def _part(self, error: float) -> str:
        """How much of the error is explained where so much [m] is left."""
        return "most" if error <= self.alone / 2 else "a part"

    def patch(self, base: str) -> str:
        """The changes as a patch document (TOML) on a vessel that is called `base` there; empty without changes."""
        if not self.changes:
            return ""
        document = tomlkit.document()
        document.add(tomlkit.comment("A draft from the runs of a log that do not test: one factor for each group."))
        document.add("base", tomlkit.item(base))
        document.add("name", tomlkit.item(f"{self.vessel.name}, corrected from its log"))
        table = tomlkit.table()
        for change in self.changes:
            for path, value in change.values.items():
                number = tomlkit.item(value)
                number.comment(f"was {self.vessel.parameters[path]:.6g}: {change.group.name} x {change.factor:.3g}")
                table.append(SingleKey(path, KeyType.Basic), number)
        document.add("set", table)
        return tomlkit.dumps(document)


def first_look(
    vessel: Vessel,
    dataset: Dataset,
    runs: Iterable[str],
    *,
    ahead: float,
    step: float,
    path: PathSource = "position",
    integrator: Integrator = "rk4",
) -> Look:
    """Compare a vessel with the runs of a log.

    Parameters
    ----------
    runs : names of the runs to look at. ahead, step : of the predictions [s]. path : as in `cut_windows`.
    integrator : of the predictions; what is wrong with their paths is blamed on numbers, so its error must be small.

    Raises
    ------
    DataError : no run is as long as the horizon, or a command of the vessel is missing.
    """
    check_columns(vessel, dataset.frame.columns, str(vessel.file))
    part = dataset.select(runs)
    late = late_commands(vessel, part, part.runs)
    finer = 1 if late is None else max(1, math.ceil(step / late.delay - 1e-9))  # steps in which orders change in time
    windows = _some(part, max(round(ahead / step), 1) * finer, step / finer, path)
    constant = float(position_error(constant_motion(windows), windows.future).mean())
    trial = _Trial(vessel, part, windows, constant, integrator)
    alone = trial.errors([{}])[0]
    timely = None
    if late is not None:
        other = _between(trial)
        error = other.errors([{}])[0]
        if error < (1 - WORTH) * alone:
            trial, timely = other, (late, error)
    least = alone if timely is None else timely[1]
    share = _turning(trial.physics(), windows, trial.instants())
    facts = tuple(_facts(vessel, windows, share))
    mistaken = share is not None and share < 0  # a sign, which no factor mends
    done = mistaken or least < LEAST_ERROR
    changes = [] if done else _worthwhile(trial, least)
    limit = min(changes[-1].error if changes else least, (1 - SAVING) * least)
    current: Current | None = None
    for find in () if done else (_current, _own_currents):
        found = find(trial)
        if found is not None and found[0].error <= limit:
            current, inside = found
            limit = current.error - WORTH * least
    if current is not None:
        changes = _worthwhile(inside, current.error)
    length = windows.horizon * windows.step
    return Look(vessel, length, alone, constant, facts, tuple(changes), current, timely, integrator)


def euler_apart(
    vessel: Vessel, dataset: Dataset, runs: Iterable[str], *, ahead: float, step: float, path: PathSource = "position"
) -> tuple[float, float]:
    """Mean distance [m] of the paths of explicit Euler from those of RK4, and the mean error [m] of the latter.

    Parameters and errors as of `first_look`. Infinite where Euler diverges and RK4 does not; 0 where RK4 always does.
    """
    part = dataset.select(runs)
    windows = _some(part, max(round(ahead / step), 1), step, path)
    trial = _Trial(vessel, part, windows, 0.0)
    rk4, euler = (replace(trial, integrator=rule).physics().paths(trial.instants()) for rule in ("rk4", "euler"))
    sound = np.isfinite(rk4).all(axis=(0, 2))
    if not sound.any():
        return 0.0, 0.0
    apart, error = (position_error(rk4[:, sound], to[:, sound]).mean() for to in (euler, windows.future))
    return float(apart) if np.isfinite(apart) else math.inf, float(error)


def _some(dataset: Dataset, horizon: int, step: float, path: PathSource) -> Windows:
    """At most so many windows, evenly over all runs."""
    windows = cut_windows(dataset, horizon=horizon, step=step, interval=max(step, horizon * step / 4), path=path)
    if len(windows) <= MOST_WINDOWS:
        return windows
    return windows.select(np.linspace(0, len(windows) - 1, MOST_WINDOWS).astype(int))


@dataclass(frozen=True)
class _Trial:
    """Mean errors of a vessel with changed numbers on windows of a log."""

    vessel: Vessel
    dataset: Dataset
    windows: Windows
    constant: float
    integrator: Integrator = "rk4"
    known: dict[Gear, Instants] = field(default_factory=dict)
    reached: dict[Gear, dict[str, Array] | None] = field(default_factory=dict)  # by actuators, in any current

    def instants(self, gear: Gear = ()) -> Instants:
        """Instants for the vessel with changed actuators: planned commands, and positions of the actuators."""
        if gear not in self.known:
            if gear not in self.reached:
                self.reached[gear] = window_memory(self.vessel.with_values(dict(gear)), self.dataset, self.windows)
            self.known[gear] = self.windows.instants(known=True, hidden=self.reached[gear])
        return self.known[gear]

    def physics(self, gear: Gear = ()) -> Physics:
        """What predicts, with changed actuators: where they are depends on them."""
        vessel = self.vessel.with_values(dict(gear))
        return Physics(vessel, self.windows.horizon, self.windows.step, self.integrator)

    def errors(self, rows: Sequence[Mapping[str, float]]) -> list[float]:
        """Mean error [m] for each set of changed numbers; a window counts `PENALTY` times constant motion at most."""
        by_gear: dict[Gear, list[int]] = {}
        for number, row in enumerate(rows):
            gear = tuple(sorted((path, value) for path, value in row.items() if ".actuator." in path))
            by_gear.setdefault(gear, []).append(number)
        result = [np.inf] * len(rows)
        names = list(self.vessel.parameters)
        for gear, places in by_gear.items():
            physics = self.physics(gear)
            base = np.array(list(physics.ship.parameters.values()))
            parameters = np.tile(base, (len(places), 1))
            for number, place in enumerate(places):
                for path, value in rows[place].items():
                    parameters[number, names.index(path)] = value
            distances = physics.distances(self.instants(gear), self.windows.future, parameters, engine=REPEATED)
            mean = np.where(distances.diverged, np.inf, distances.total / self.windows.horizon)
            capped = np.minimum(np.nan_to_num(mean, nan=np.inf), PENALTY * max(self.constant, 1e-9))
            for number, place in enumerate(places):
                result[place] = float(capped[number].mean())
        return result


def _between(trial: _Trial) -> _Trial:
    """The trial with commands that change between the rows, as they are in the middle of each step."""
    windows, planned = trial.windows, {name: values.copy() for name, values in trial.windows.planned.items()}
    middle = windows.t + windows.step * (np.arange(windows.horizon)[:, None] + 0.5)
    for run, rows in pieces(trial.dataset):
        t = rows["t"].to_numpy()
        slack = clock_slack(t)
        inside = (windows.run == run) & (windows.t >= t[0] - slack) & (windows.t <= t[-1] + slack)
        columns = {name: rows[name].to_numpy() for name in ("t", *trial.dataset.commands)}
        for name, values in between_rows(trial.vessel, columns, middle[:, inside]).items():
            planned[name][:, inside] = values
    return replace(trial, windows=replace(windows, planned=planned), known={}, reached={})


def _in_current(trial: _Trial, V_c: float | Array, beta_c: float | Array) -> _Trial:
    """The trial in a steady current [m/s, rad], or in that of each window (N,)."""
    vessel, windows = trial.vessel, trial.windows
    if "current" not in vessel.document:
        vessel = vessel.with_values({"current.kind": "uniform"})
    columns = {**windows.columns, "V_c": np.full(len(windows), V_c), "beta_c": np.full(len(windows), beta_c)}
    return replace(trial, vessel=vessel, windows=replace(windows, columns=columns), known={})


def _current(trial: _Trial) -> tuple[Current, _Trial] | None:
    """The steady current of all runs with which the paths fit best, and the trial in it; None where none is found.

    Runs of one heading cannot tell it from a thrust that is wrong: their error is then explained by both alike.
    """
    currents = _currents(trial, np.zeros(len(trial.windows), dtype=int))
    if not np.isfinite(currents).all():
        return None
    V_c, beta_c = float(np.hypot(*currents[0])), float(np.arctan2(currents[0, 1], currents[0, 0]))
    inside = _in_current(trial, V_c, beta_c)
    return Current(V_c, beta_c, inside.errors([{}])[0]), inside


def _own_currents(trial: _Trial) -> tuple[Current, _Trial] | None:
    """The currents of the runs, each with its own, and the trial in them; None where there are too few windows.

    Each half of a run is judged in the current of the other half, so that chance explains nothing.
    """
    run, t = trial.windows.run, trial.windows.t
    names = np.unique(run)
    middle = np.array([np.median(t[run == name]) for name in names])
    number = np.searchsorted(names, run)
    late = (t > middle[number]).astype(int)
    groups = 2 * number + late
    if len(names) < 2 or np.bincount(groups, minlength=2 * len(names)).min() < FEW:
        return None
    currents = _currents(trial, groups)
    if not np.isfinite(currents).all():
        return None
    north, east = currents[2 * number + 1 - late].T
    inside = _in_current(trial, np.hypot(north, east), np.arctan2(east, north))
    size = float(np.sqrt(np.mean(np.sum(currents**2, axis=1))))
    return Current(size, np.nan, inside.errors([{}])[0], each=True), inside


def _currents(trial: _Trial, groups: NDArray[np.int_]) -> Array:
    """The steady current (G, 2) [m/s], north and east, with which the paths of each group of windows (N,) fit best.

    NaN where a group has none that is slower than the ship.
    """

    def away(currents: Array) -> Array:  # (T, N, 2) [m], of all points
        north, east = currents[groups].T
        one = _in_current(trial, np.hypot(north, east), np.arctan2(east, north))
        return np.asarray(one.physics().paths(one.instants()) - one.windows.future)

    speed = float(np.median(np.hypot(trial.windows.columns["u"], trial.windows.columns["v"])))
    currents, step = np.zeros((int(groups.max()) + 1, 2)), 0.02 * speed
    for _ in range(NEWTON):
        base = away(currents)
        with np.errstate(invalid="ignore"):  # paths that diverge
            slopes = np.stack([(away(currents + step * axis) - base) / step for axis in np.eye(2)], axis=-1)
        sound = np.isfinite(base) & np.isfinite(slopes).all(axis=-1)
        for group in range(len(currents)):
            here = sound & (groups == group)[:, None]
            if not here.any():
                return np.full_like(currents, np.nan)
            currents[group] -= np.linalg.lstsq(slopes[here], base[here])[0]
        if not np.all((np.hypot(*currents.T) > 0) & (np.hypot(*currents.T) < STRONG * speed)):
            return np.full_like(currents, np.nan)
    return currents


def _worthwhile(trial: _Trial, alone: float) -> list[Change]:
    """The changes that explain the error; none where all together save too little."""
    changes = _explained(trial, alone)
    return [] if changes and changes[-1].error > (1 - SAVING) * alone else changes


def _explained(trial: _Trial, alone: float) -> list[Change]:
    """Groups and factors that lower the error most, one after another; the earlier ones refined with the later."""
    vessel = trial.vessel
    groups = {group: paths for group in GROUPS if (paths := _members(vessel, group))}
    factors: dict[Group, float] = {}
    errors: list[float] = []
    best = alone
    while len(factors) < MOST_CHANGES:
        options = [
            (group, factor)
            for group in groups
            if group not in factors
            for factor in (FAR if group.high > MODEST else FACTORS)
            if group.low <= factor <= group.high
        ]
        least = _least(trial, groups, [{**factors, group: factor} for group, factor in options])
        if least is None or least[1] > (1 - WORTH) * best:
            break
        chosen, best = _refined(trial, groups, *least)
        factors = chosen
        errors.append(best)
    for _ in range(SWEEPS if len(factors) > 1 else 0):
        factors, best = _refined(trial, groups, factors, best)
    if not factors:
        return []
    errors[-1] = best
    return [
        Change(group, factor, _values(vessel, groups, {group: factor}), error)
        for (group, factor), error in zip(factors.items(), errors, strict=True)
    ]


def _refined(
    trial: _Trial, groups: Mapping[Group, Sequence[str]], factors: dict[Group, float], error: float
) -> tuple[dict[Group, float], float]:
    """The factors, each in turn moved a little where that lowers the error."""
    for group in list(factors):
        near = [
            {**factors, group: moved}
            for change in FINER
            if group.low <= (moved := factors[group] * change) <= group.high
        ]
        least = _least(trial, groups, near)
        if least is not None and least[1] < error:
            factors, error = least
    return factors, error


def _least(
    trial: _Trial, groups: Mapping[Group, Sequence[str]], options: Sequence[dict[Group, float]]
) -> tuple[dict[Group, float], float] | None:
    """The option with the least error, of those that the vessel's checks accept and whose numbers a ship can have."""
    rows, kept = [], []
    for option in options:
        values = _values(trial.vessel, groups, option)
        before = {path: trial.vessel.parameters[path] for path in values}
        if outside(trial.vessel, values) - outside(trial.vessel, before):
            continue
        try:
            trial.vessel.with_values(values)
        except DocumentError:
            continue
        rows.append(values)
        kept.append(option)
    if not rows:
        return None
    errors = trial.errors(rows)
    place = int(np.argmin(errors))
    return kept[place], errors[place]


def _members(vessel: Vessel, group: Group) -> list[str]:
    """Paths of a group in a vessel whose value is not 0."""
    return [path for path, value in vessel.parameters.items() if value and re.fullmatch(group.pattern, path)]


def _values(vessel: Vessel, groups: Mapping[Group, Sequence[str]], factors: Mapping[Group, float]) -> dict[str, float]:
    return {
        path: float(f"{vessel.parameters[path] * factor:.6g}")
        for group, factor in factors.items()
        for path in groups[group]
    }


def _turning(physics: Physics, windows: Windows, instants: Instants) -> float | None:
    """How far the vessel turns over how far the ship of the log does, median; None where the ship hardly turns."""
    turned = windows.states["psi"][-1] - windows.columns["psi"]
    predicted = physics.states(instants)["psi"][-1] - windows.columns["psi"]
    much = (np.abs(turned) > LEAST_TURN) & np.isfinite(predicted)
    return float(np.median(predicted[much] / turned[much])) if much.sum() >= TURNS else None


def _facts(vessel: Vessel, windows: Windows, share: float | None) -> Iterable[str]:
    """Sentences on speed against shaft, and turning against helm; share : as of `_turning`."""
    steady = _steady_speeds(vessel, windows)
    if steady is not None:
        seen, orders, gained, error = steady
        least, held, most = (steady_speed(vessel, orders, gained + way * error) for way in (1, 0, -1))
        if least > OFF * seen or seen > OFF * most:
            rpm = max((value for name, value in orders.items() if is_shaft(name)), key=abs) / RPM
            unit = _unit(vessel, seen, orders)
            yield f"at {rpm:.4g} rpm the log runs {seen:.3g} m/s and the vessel {held:.3g} m/s{unit}"
    backwards = _backwards(windows)
    yield from (f"{name} is negative where the ship of the log goes ahead: is its sign right?" for name in backwards)
    if share is None:
        return
    if share < 0:
        angle = any(steers(name) for name in dynamics(vessel).commands)
        what = "the sign of the angle" if angle else "port and starboard of the shafts"
        yield f"the vessel turns the other way than the ship of the log: check {what}, and of heading and yaw rate"
    elif not 1 / OFF < share < OFF:
        yield f"over {windows.horizon * windows.step:g} s the vessel turns {share:.2g} times as far as the ship"


def _unit(vessel: Vessel, seen: float, orders: Mapping[str, float]) -> str:
    """Question about the unit of the shaft, where another one explains the speed of the log and this one is far off."""
    for factor in UNITS:
        other = {name: value * factor if is_shaft(name) else value for name, value in orders.items()}
        if 1 / ALIKE < steady_speed(vessel, other) / seen < ALIKE:
            read, right = ("rpm", "rev/s") if factor > 1 else ("rev/s", "rpm")
            return f" (is the shaft speed in {right}, and the mapping says {read}?)"
    return ""


def _steady_speeds(vessel: Vessel, windows: Windows) -> tuple[float, dict[str, float], float, float] | None:
    """Speed of the log [m/s], and its commands [SI], where it goes straight at its fastest; or None.

    Also what it still gains there [m/s^2], for a large ship takes many horizons to her speed, and the error of that.
    """
    commands = dynamics(vessel).commands
    shafts = [name for name in commands if is_shaft(name) and name in windows.planned]
    if not shafts:
        return None
    u = windows.states["u"]
    aside = np.abs(windows.states["psi"] - windows.columns["psi"]).max(axis=0)  # in a zigzag the heading comes back
    change = np.abs(u[-1] - windows.columns["u"]) < STEADY * np.abs(u[-1])
    orders = [windows.planned[name] for name in shafts]
    same = np.all([np.ptp(order, axis=0) <= STEADY * np.abs(order[0]) for order in orders], axis=0)
    straight = change & same & (aside < STRAIGHT) & (u[-1] > 0)
    if not straight.any():
        return None
    driving = max(orders, key=lambda order: float(np.abs(order[0, straight]).max()))[0]
    straight &= driving >= (1 - STEADY) * driving[straight].max()  # the fastest, where there are several speeds
    if straight.sum() < FEW:
        return None
    held = {name: 0.0 if steers(name) else float(np.median(windows.planned[name][0, straight])) for name in commands}
    t = windows.step * (np.arange(windows.horizon + 1) - windows.horizon / 2)
    gained = t @ np.vstack([windows.columns["u"], u])[:, straight] / float(t @ t)
    error = 2 * float(np.std(gained)) / math.sqrt(len(gained))
    return float(np.median(u[-1, straight])), held, float(np.median(gained)), error


def steady_speed(vessel: Vessel, commands: Mapping[str, float], gained: float = 0.0) -> float:
    """Speed [m/s] that a vessel holds straight ahead in calm water with commands [SI]; 0 where they do not drive it.

    gained : [m/s^2] the speed at which it still gains that.
    """

    def surge(speed: float) -> float:
        return float(acceleration(vessel, speed, commands)[0]) - gained

    if surge(1e-3) <= 0:
        return 0.0
    low, high = 1e-3, FASTEST
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if surge(middle) > 0 else (low, middle)
    return (low + high) / 2


def _backwards(windows: Windows) -> list[str]:
    """Shaft speeds that are negative where the ship goes ahead."""
    ahead = windows.columns["u"] > 0.3 * np.quantile(windows.columns["u"], 0.9)
    return [
        name
        for name, values in windows.planned.items()
        if is_shaft(name) and ahead.any() and float(np.quantile(values[0, ahead], 0.9)) < 0
    ]


def _shown(vessel: Vessel, change: Change) -> str:
    """A change in words: the first of its numbers, from and to."""
    path = next(iter(change.values))
    more = len(change.values) - 1
    others = f" ({more} more number{'s' if more > 1 else ''} by the same factor)" if more else ""
    return f"{path} = {change.values[path]:.4g} in place of {vessel.parameters[path]:.4g}{others}"
