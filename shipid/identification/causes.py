"""Causes of a misfit, as changes of a resampled log or of the numbers of a vessel: the hypotheses of a diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Array
from shipid.identification.sensitivities import is_thrust
from shipid.physics.signals import is_shaft, is_steering, signal_of
from shipid.vessel.load import Vessel
from shipid.vessel.schema import SHARED

VELOCITY, POSITION = ("u", "v"), ("north", "east")
GEOMETRY = frozenset((*SHARED, "x_aft", "x_fwd", "L_pp", "T", "rho", "nabla"))
LATE, EARLY = (0.3, 1.0, 2.0, 4.0), (-1.0, -0.3)  # delays from which a fit may begin, in times of a ship length
UNITS = tuple(sign * float(np.log(unit)) for unit in (1852 / 3600, np.pi / 180, 1 / 60) for sign in (1, -1))
"""Logarithms of the factors of a wrong unit: knots, degrees, minutes."""
SPEEDS, COURSES = "runs at several speeds", "runs on opposite courses"
BESIDE = "the command read beside its instrument"
SEVERAL, ASYMMETRY = "several coefficients", "asymmetry of hull or screw"


@dataclass(frozen=True)
class Motion:
    """A log at equal steps: columns (N,) SI of all stretches one after the other, and the numbers of the vessel (P,).

    stretches : slice of each stretch. runs : number of the run of each stretch. step : [s].
    course : whether its heading is a course, of which the physics must say the drift.
    """

    columns: Mapping[str, Array]
    parameters: Array
    stretches: tuple[slice, ...]
    runs: tuple[int, ...]
    step: float
    course: bool = False

    def put(self, columns: Mapping[str, Array]) -> Motion:
        """The same log with some columns replaced."""
        return replace(self, columns={**self.columns, **columns})


@dataclass(frozen=True)
class Scales:
    """Length [m], speed [m/s] and interval of the rows [s] of a log, which set the size of trials."""

    length: float
    speed: float
    interval: float

    @property
    def passing(self) -> float:
        """Time [s] in which the ship runs its length."""
        return self.length / self.speed


@dataclass(frozen=True)
class Cause:
    """What may be wrong.

    key : its name. change : (log, size) -> the log as it would be without it. trial : size of a trial step, one number
        for each entry of the size; empty for a cause without a size. unit : of the size.
    least : a smaller size is what any log has. ratio : whether the size is the logarithm of a factor.
    scaled : residuals 0 to 5 (u, v, r, heading, along, across) that shrink with a factor of the size.
    repair : text with {0}, {1} for the size, {minus0} and {over0} for its negative and inverse, {offset0} for the
        offset of a column. offset : the SI value of 1 of its unit, and the offset that the mapping has.
    equals : keys of its class. tells : the run that tells them apart. starts : sizes from which the fit may begin.
    cost : added to the misfit: for free signs, or for one column alone of an instrument that gives two.
    of_runs : whether each run has a size of its own.
    """

    key: str
    change: Callable[[Motion, Array], Motion]
    trial: tuple[float, ...] = ()
    unit: str = ""
    least: float = 0.0
    ratio: bool = False
    scaled: tuple[int, ...] = ()
    repair: str = ""
    offset: tuple[float, float] = (1.0, 0.0)
    equals: tuple[str, ...] = ()
    tells: str = ""
    starts: tuple[float, ...] = ()
    cost: float = 0.0
    of_runs: bool = False

    @property
    def remedy(self) -> str:
        """What would tell the class apart, as the end of a sentence."""
        return f": to tell them apart, {self.tells}" * bool(self.tells)

    @property
    def name(self) -> str:
        """The key without the words that tell variants of a cause apart."""
        return self.key.partition(" / ")[0]

    @property
    def is_of_forces(self) -> bool:
        """Whether coefficients of the vessel make up for it."""
        return any(key.startswith("coefficient") for key in (self.name, *self.equals))

    def is_like(self, other: Cause) -> bool:
        """Whether both are of one class."""
        return self.name in (other.name, *other.equals) or other.name in self.equals

    def sizes(self, theta: Array) -> tuple[float, ...]:
        """Size in SI units of the numbers (k,) of the fit."""
        return tuple((np.exp(theta) if self.ratio else theta).tolist())

    def repair_text(self, theta: Array) -> str:
        """The repair with the size in it, as lines of a mapping where it is a table."""
        sizes, (unit, there) = self.sizes(theta), self.offset
        words = {
            f"{name}{i}": f"{value:.4g}"
            for i, size in enumerate(sizes)
            for name, value in (("minus", -size), ("over", 1 / (size or np.inf)), ("offset", there - size / unit))
        }
        text = self.repair.format(*(f"{size:.4g}" for size in sizes), **words)
        return text + '\nreason = "diagnosis"' * text.startswith("[[repair]]")


def list_causes(
    vessel: Vessel | None,
    commands: Sequence[str],
    motion: Motion,
    scales: Scales,
    mapped: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
) -> list[Cause]:
    """All causes that a vessel and a log can have.

    mapped : `unit`, its `size` in SI and `offset` of each column in the mapping of the log.
    """
    moving = [name for name in commands if np.ptp(motion.columns[name]) > 0]
    causes = [
        *(cause for name in moving for cause in _command_causes(name, motion.columns[name], scales)),
        *_exchanged_thrusters(commands, motion),
        *_sensor_causes(scales),
        *_water_causes(motion, scales),
        *(() if vessel is None else _coefficient_causes(vessel)),
    ]
    return [_with_offset(one, mapped) for one in causes]


def _with_offset(cause: Cause, mapped: Mapping[str, Mapping[str, Any]]) -> Cause:
    """A cause that subtracts from a column, with the offset that repairs it; of a column without a mapping in SI."""
    if not isinstance(cause.change, partial) or cause.change.func is not _subtract:
        return cause
    name = cause.change.args[0]
    known, title = mapped.get(name), f'[columns."{name}"]' if "." in name else f"[columns.{name}]"
    unit, there = (1.0, 0.0) if known is None else (known["size"], known["offset"])
    words = f"{cause.unit}, added to what is there" if known is None else known["unit"]
    return replace(cause, repair=f"{title}\noffset = {{offset0}}  # {words}", offset=(unit, there))


def _subtract(name: str, motion: Motion, size: Array) -> Motion:
    return motion.put({name: motion.columns[name] - size[0]})


def _divide(names: Sequence[str], motion: Motion, size: Array, *, below: float = np.inf) -> Motion:
    columns = {name: motion.columns[name] for name in names}
    return motion.put({name: np.where(x < below, x * np.exp(-size[0]), x) for name, x in columns.items()})


def multiply_signs(names: Sequence[str], signs: Array | float, motion: Motion, _: Array | None = None) -> Motion:
    """The log with columns times their signs (N,), or one of all rows."""
    return motion.put({name: signs * motion.columns[name] for name in names})


def _advance(names: Sequence[str], motion: Motion, size: Array) -> Motion:
    """The log with columns moved to the time that they belong to, `size` [s] before they were logged."""
    ends = np.repeat(
        [(part.start, part.stop - 1) for part in motion.stretches],
        [part.stop - part.start for part in motion.stretches],
        axis=0,
    ).T
    at = np.arange(len(ends[0]))
    then = np.clip(at + size[0] / motion.step, *ends)
    return motion.put({name: np.interp(then, at, motion.columns[name]) for name in names})


def _exchange(pairs: Sequence[tuple[str, str]], motion: Motion, _: Array) -> Motion:
    return motion.put({a: motion.columns[b] for pair in pairs for a, b in (pair, pair[::-1])})


def rotate_heading(motion: Motion, size: Array | Sequence[Array]) -> Motion:
    """The heading less a bias, and velocities turned with it: those over ground stay."""
    columns = motion.columns
    turned = (columns["u"] + 1j * columns["v"]) * np.exp(1j * size[0])
    return motion.put({"psi": columns["psi"] - size[0], "u": turned.real, "v": turned.imag})


def _heading_from_course(motion: Motion, _: Array) -> Motion:
    columns = motion.columns
    return motion.put({"psi": columns["psi"] - np.arctan2(columns["v"], columns["u"])})


def _heading_about_pivot(motion: Motion, ahead: Array) -> Motion:
    """The heading of a log whose drift is lost: of a ship that turns about a point so far ahead [m]."""
    u = motion.columns["u"]
    return rotate_heading(motion, [-np.arctan2(ahead[0] * motion.columns["r"] * np.sign(u), np.abs(u))])


def _move_to_origin(moves: str, motion: Motion, arm: Array) -> Motion:
    """The log of the origin, where it is of a point (x, y) [m] ahead and to starboard."""
    columns, (x, y), moved = motion.columns, arm, dict[str, Array]()
    if "position" in moves:
        point = (x + 1j * y) * np.exp(1j * columns["psi"])
        moved |= {"north": columns["north"] - point.real, "east": columns["east"] - point.imag}
    if "velocity" in moves:
        moved |= {"u": columns["u"] + y * columns["r"], "v": columns["v"] - x * columns["r"]}
    return motion.put(moved)


def _add_current(run: NDArray[np.intp], motion: Motion, size: Array) -> Motion:
    """The log in further currents, north and then east of each [m/s], of which a step (N,) has number `run`."""
    current = (size[: len(size) // 2] + 1j * size[len(size) // 2 :])[run]
    current = current + motion.columns.get("V_c", 0.0) * np.exp(1j * motion.columns.get("beta_c", 0.0))
    return motion.put({"V_c": np.abs(current), "beta_c": np.angle(current)})


def _add_drift(motion: Motion, size: Array, *, along: bool = False) -> Motion:
    """Velocities over ground in a current (north, east) [m/s], where they are logged through the water.

    along : whether it was a speed, resolved along the course.
    """
    through = motion.columns["u"] + 1j * motion.columns["v"]
    body = (size[0] + 1j * size[1]) * np.exp(-1j * motion.columns["psi"])
    course = through / np.maximum(np.abs(through), 1e-9)
    over = through + (course * (body * course.conj()).real if along else body)
    return _add_current(np.zeros(len(body), dtype=np.intp), motion.put({"u": over.real, "v": over.imag}), size)


def _scale_numbers(groups: NDArray[np.bool_], motion: Motion, size: Array) -> Motion:
    """The log with the numbers of each group (k, P) of a vessel times a factor of their own."""
    return replace(motion, parameters=motion.parameters * np.exp(size @ groups))


def _command_causes(name: str, values: Array, scales: Scales) -> Iterator[Cause]:
    size, angle, key = float(np.sqrt(np.mean(values**2))), is_steering(name), f"command {name}"
    column, unit = f'[columns."{name}"]\n', "rad" if angle else "rev/s" if is_shaft(name) else ""
    strength = ("coefficient rudder",) if angle else (f"{key} zero", "coefficient thrust", "coefficient damping")
    yield Cause(
        f"{key} zero", partial(_subtract, name), (0.05 * size,), unit, 0.003 if angle else 0.01 * size,
        equals=(ASYMMETRY,) if angle else (f"{key} scale", *strength[1:]),
        tells="the angle read on a slip, and a run at another speed" if angle else SPEEDS,
    )  # fmt: skip
    yield Cause(
        f"{key} scale", partial(_divide, [name]), (0.05,), "1", 0.02, ratio=True,
        repair=f"{column}factor = {{over0}}  # times what is there", equals=strength, tells=BESIDE,
    )  # fmt: skip
    yield Cause(
        f"{key} sign", partial(multiply_signs, [name], -1.0), repair=f"{column}sign = -1  # times what is there",
        equals=("mirror image of the motion",) if angle else (), tells="one turn whose side is known",
    )  # fmt: skip
    yield Cause(
        f"{key} delay", partial(_advance, [name]), (max(0.05 * scales.passing, 0.25 * scales.interval),), "s",
        max(1.01 * scales.interval, 0.03 * scales.passing), starts=tuple(scales.passing * share for share in LATE),
        repair=f"{column}# move this column {{0}} s earlier", equals=("slower actuator", "sensors early"),
        tells="a step of the command at rest, seen at the thruster",
    )  # fmt: skip
    if is_shaft(name) and (values < 0).any() and (values > 0).any():
        yield Cause(
            f"{key} scale astern", partial(_divide, [name], below=0.0), (0.05,), "1", 0.05, ratio=True,
            repair=f"{column}# times {{over0}} where it is below 0",
            equals=("coefficient thrust astern",), tells=BESIDE,
        )  # fmt: skip


def _exchanged_thrusters(commands: Sequence[str], motion: Motion) -> Iterator[Cause]:
    signals: dict[str, list[str]] = {}
    for name in commands:
        signals.setdefault(name.rpartition(".")[0], []).append(signal_of(name))
    for a, b in combinations(signals, 2):
        pairs = [(f"{a}.{one}", f"{b}.{one}") for one in signals[a]]
        if signals[a] == signals[b] and any((motion.columns[x] != motion.columns[y]).any() for x, y in pairs):
            yield Cause(
                f"exchange {a} {b}", partial(_exchange, pairs), repair=f"exchange the columns of {a} and {b}",
                equals=("command sign of both",), tells="a run with one of the two alone",
            )  # fmt: skip


def _sensor_causes(scales: Scales) -> Iterator[Cause]:
    size = {"u": scales.speed, "v": scales.speed, "r": 1 / scales.passing, "psi": 1.0}
    unit = {"u": "m/s", "v": "m/s", "r": "rad/s", "psi": "rad"}
    of_log, drift = ("sensor u scale", "sensor velocity scale", "sensor u bias"), ("velocity through water",)
    bias = {"u": of_log + drift, "v": ("sensor psi bias", *drift), "r": ("sensor r scale",)}
    bias["psi"] = ("positions in turned axes", "sensor v bias", "current", *drift)
    for name, equals in bias.items():
        yield Cause(
            f"sensor {name} bias", partial(_subtract, name), (0.02 * size[name],), unit[name], 0.003 * size[name],
            equals=equals, tells=f"{COURSES} and at several speeds",
        )  # fmt: skip
    yield Cause(
        "sensor psi bias / with velocities", rotate_heading, (0.02,), "rad", 0.015,
        repair='[[repair]]\nkind = "heading_offset"\noffset = {minus0}',
        equals=(ASYMMETRY, "sensor v bias", "current"), tells=COURSES,
    )  # fmt: skip
    scaled: dict[str, tuple[tuple[str, ...], tuple[int, ...]]] = {
        "u": (("u",), (0, 4)), "v": (("v",), (1,)), "r": (("r",), (2, 3)), "velocity": (VELOCITY, (0, 1, 4, 5))
    }  # fmt: skip
    same = {"u": of_log + drift, "velocity": of_log + drift, "r": ("sensor r bias",)}
    for key, (names, rows) in scaled.items():
        yield Cause(
            f"sensor {key} scale", partial(_divide, names), (0.03,), "1", 0.003, ratio=True, scaled=rows, starts=UNITS,
            repair=f'[[repair]]\nkind = "scale"\ncolumns = {[*names]}\nfactor = {{over0}}',
            equals=same.get(key, ()), tells=SPEEDS, cost=float(key == "u"),
        )  # fmt: skip
    for name in ("v", "r", "psi"):
        yield Cause(
            f"sensor {name} sign", partial(multiply_signs, [name], -1.0),
            repair=f"[columns.{name}]\nsign = -1  # times what is there",
        )  # fmt: skip
    gyro = "name the column of a gyro or a compass as psi"
    late: dict[str, tuple[tuple[str, ...], str, tuple[str, ...]]] = {
        "u": (("u",), "velocity", ("sensor velocity delay",)),
        "v": (("v",), "velocity", ("sensor velocity delay",)),
        "r": (("r",), "yaw rate", ()),
        "psi": (("psi",), "heading", ()),
        "velocity": (VELOCITY, "velocity", ("sensor u delay", "sensor v delay")),
        "position": (POSITION, "position", ("lever arm position",)),
    }
    for key, (names, kind, equals) in late.items():
        yield Cause(
            f"sensor {key} delay", partial(_advance, names), (max(0.03 * scales.passing, 0.25 * scales.interval),), "s",
            0.01 * scales.passing, starts=tuple(share * scales.passing for share in (*EARLY, *LATE)),
            repair=f'[[repair]]\nkind = "latency"\nsignal = "{kind}"\nseconds = {{0}}',
            equals=equals, tells="turns to both sides", cost=float(key in "uv"),
        )  # fmt: skip
    yield Cause("heading is course", _heading_from_course, repair=gyro)
    yield Cause(
        "heading is course / and drift is lost", _heading_about_pivot, (0.05 * scales.length,), "m", repair=gyro,
        starts=(0.4 * scales.length,), equals=("sensor v scale",),
    )  # fmt: skip
    yield Cause(
        "heading is course / and drift is that of the physics", lambda log, _: replace(log, course=True), repair=gyro
    )
    arms = {"position": ("lever arm velocity", "sensor position delay"), "velocity": ("lever arm position",)}
    for moves, word in (("position", "position"), ("velocity", "velocity"), ("position and velocity", "both")):
        yield Cause(
            f"lever arm {moves}", partial(_move_to_origin, moves), 2 * (0.05 * scales.length,), "m",
            0.02 * scales.length, repair=f'[[repair]]\nkind = "lever_arm"\nx = {{0}}\ny = {{1}}\nmoves = "{word}"',
            equals=arms.get(moves, ()), tells="turns to both sides, and runs at another speed",
        )  # fmt: skip


def _water_causes(motion: Motion, scales: Scales) -> Iterator[Cause]:
    trial, least, count = 0.03 * scales.speed, 0.01 * scales.speed, max(motion.runs) + 1
    run = np.repeat(motion.runs, [part.stop - part.start for part in motion.stretches])
    drift = ("sensor psi bias", "sensor v bias", "wind that the log lacks")
    equals = (*drift, "current", "current by run", "velocity through water")
    yield Cause(
        "current", partial(_add_current, 0 * run), 2 * (trial,), "m/s", least,
        repair="--set current=one  # north {0}, east {1} m/s", equals=equals, tells=COURSES,
    )  # fmt: skip
    if count > 1:
        yield Cause(
            "current by run", partial(_add_current, run), 2 * count * (trial,), "m/s", least * count**0.5,
            repair='--set current="by run"', equals=equals, tells=COURSES, of_runs=True,
        )  # fmt: skip
    yield Cause(
        "velocity through water", _add_drift, 2 * (trial,), "m/s", least, equals=(*equals, "sensor u bias"),
        repair="u and v are through the water: take [estimate] in their place", tells=COURSES,
    )  # fmt: skip
    yield Cause(
        "velocity through water / along the course", partial(_add_drift, along=True), 2 * (trial,), "m/s", least,
        repair="the speed is one through the water: take [estimate] in its place", equals=equals, tells=COURSES,
    )  # fmt: skip
    if "V_w" in motion.columns and np.any(motion.columns["V_w"]):
        yield Cause(
            "wind scale", partial(_divide, ["V_w"]), (0.05,), "1", 0.05, ratio=True, equals=("force of the wind",),
            repair="[columns.V_w]\nfactor = {over0}  # times what is there", tells="the wind read at rest",
        )  # fmt: skip
        yield Cause("wind direction", partial(_subtract, "beta_w"), (0.1,), "rad", 0.05)


def _coefficient_causes(vessel: Vessel) -> Iterator[Cause]:
    names, shaft = list(vessel.parameters), "command scale of a shaft"
    groups: dict[str, tuple[list[str], tuple[str, ...]]] = {
        "damping": (
            [path for path in names if path.startswith("hull.") and path.rpartition(".")[2] not in GEOMETRY],
            ("coefficient thrust", "coefficient mass", shaft),
        ),
        "mass": (
            [path for path in names if path in ("inertia.m", "inertia.I_z") or path.startswith("added_mass.")],
            ("coefficient thrust", "coefficient damping"),
        ),
        "thrust": ([*filter(is_thrust, names)], ("coefficient damping", "coefficient mass", shaft)),
        "rudder": ([*filter(_is_rudder_force, names)], ("command scale of an angle",)),
    }
    there = {group: np.isin(names, paths) for group, (paths, _) in groups.items() if paths}
    for group, where in there.items():
        paths, equals = groups[group]
        yield Cause(
            f"coefficient {group}", partial(_scale_numbers, where[None]), (0.05,), "1", 0.03, ratio=True,
            repair=f"--parameters {','.join(paths)}  # factor {{0}}", equals=equals,
            tells=BESIDE if group == "rudder" else "runs that speed up and slow down",
        )  # fmt: skip
    if len(there) > 1:
        factors = ", ".join(f"{group} x {{{i}}}" for i, group in enumerate(there))
        yield Cause(
            SEVERAL, partial(_scale_numbers, np.array([*there.values()])), len(there) * (0.05,), "1", 0.03, ratio=True,
            repair=f"shipid identify, as the forces are a guess: {factors}", equals=("scales of commands",),
            tells=BESIDE,
        )  # fmt: skip


def _is_rudder_force(path: str) -> bool:
    """Whether a parameter is one in which the force of a rudder is linear: a slope, or a derivative by its angle."""
    name = path.rpartition(".")[2]
    return path.startswith("thruster.") and ".actuator." not in path and (name == "f_alpha" or "delta" in name)
