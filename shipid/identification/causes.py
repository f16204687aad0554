"""Causes of a misfit, as changes of a resampled log or of the numbers of a vessel: the hypotheses of a diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np

from shipid.data.dataset import Array
from shipid.identification.sensitivities import is_thrust
from shipid.physics.signals import is_shaft, is_steering, signal_of
from shipid.vessel.load import Vessel
from shipid.vessel.schema import SHARED

VELOCITY, POSITION = ("u", "v"), ("north", "east")
GEOMETRY = frozenset((*SHARED, "x_aft", "x_fwd", "L_pp", "T", "rho", "nabla"))
RUDDER_NUMBERS = ("f_alpha", "k_f", "k_X", "k_Y", "k_N")
"""Numbers of a rudder in which its force is linear; besides them derivatives by `delta`."""


@dataclass(frozen=True)
class Motion:
    """A log at equal steps: columns (N,) SI of all stretches one after the other, and the numbers of the vessel (P,).

    stretches : slice of each stretch. runs : number of the run of each stretch. step : [s].
    """

    columns: Mapping[str, Array]
    parameters: Array
    stretches: tuple[slice, ...]
    runs: tuple[int, ...]
    step: float

    def changed(self, **columns: Array) -> Motion:
        """The same log with some columns replaced; a dot in a name is written as two underscores."""
        return replace(self, columns={**self.columns, **{name.replace("__", "."): x for name, x in columns.items()}})

    def put(self, columns: Mapping[str, Array]) -> Motion:
        """The same log with some columns replaced."""
        return replace(self, columns={**self.columns, **columns})

    def earlier(self, names: Sequence[str], seconds: float) -> Motion:
        """The log with some columns moved to the time that they belong to, `seconds` [s] before they were logged."""
        moved = {name: np.array(self.columns[name]) for name in names}
        for values in moved.values():
            for part in self.stretches:
                at = np.arange(part.stop - part.start, dtype=float)
                values[part] = np.interp(at + seconds / self.step, at, values[part])
        return self.put(moved)


Change = Callable[[Motion, Array], Motion]


@dataclass(frozen=True)
class Cause:
    """What may be wrong.

    key : its name. change : (log, size) -> the log as it would be without it. trial : size of a trial step, one number
        for each entry of the size; empty for a cause without a size. unit : of the size.
    least : a smaller size is what any log has. ratio : whether the size is the logarithm of a factor.
    scaled : residuals 0 to 5 (u, v, r, heading, along, across) that shrink with a factor of the size.
    repair : text with {0}, {1} for the size. equals : keys of its class. tells : the run that tells them apart.
    cost : what its free signs add to the misfit. starts : sizes, beside none, from which the fit may begin.
    """

    key: str
    change: Change
    trial: tuple[float, ...] = ()
    unit: str = ""
    least: float = 0.0
    ratio: bool = False
    scaled: tuple[int, ...] = ()
    repair: str = ""
    equals: tuple[str, ...] = ()
    tells: str = ""
    cost: float = 0.0
    starts: tuple[float, ...] = ()

    def repair_text(self, theta: Array) -> str:
        """The repair with the size in it."""
        text = self.repair
        for i, size in enumerate(self.sizes(theta)):
            ways = {f"{{minus{i}}}": -size, f"{{over{i}}}": 1 / size if size else 0.0, f"{{{i}}}": size}
            for word, value in ways.items():
                text = text.replace(word, f"{value:.4g}")
        return text

    def sizes(self, theta: Array) -> tuple[float, ...]:
        """Size in SI units of the numbers (k,) of the fit."""
        return tuple(np.exp(theta).tolist() if self.ratio else np.asarray(theta).tolist())


@dataclass(frozen=True)
class Scales:
    """Length [m], speed [m/s] and interval of the rows [s] of a log, which set the size of trials."""

    length: float
    speed: float
    interval: float
    angle: float = field(default=0.02)

    @property
    def passing(self) -> float:
        """Time [s] in which the ship runs its length."""
        return self.length / self.speed


def list_causes(vessel: Vessel, commands: Sequence[str], motion: Motion, scales: Scales) -> list[Cause]:
    """All causes that a vessel and a log can have."""
    moving = [name for name in commands if np.ptp(motion.columns[name]) > 0]
    return [
        *_command_causes(moving, motion, scales),
        *_exchanged_thrusters(commands, motion),
        *_sensor_causes(motion, scales),
        *_water_causes(motion, scales),
        *_coefficient_causes(vessel),
    ]


def _command_causes(commands: Sequence[str], motion: Motion, scales: Scales) -> Iterator[Cause]:
    for name in commands:
        values = motion.columns[name]
        size = float(np.sqrt(np.mean(values**2)))
        column = f'[columns."{name}"]\n'
        angle = is_steering(name)
        unit = "rad" if angle else "rev/s" if is_shaft(name) else ""
        strength = ("coefficient rudder",) if angle else ("coefficient thrust", "coefficient damping")
        zero = ("asymmetry of hull or screw",) if angle else ()
        yield Cause(
            f"command {name} zero",
            lambda m, x, name=name: m.put({name: m.columns[name] - x[0]}),
            (0.05 * size,),
            unit,
            least=0.003 if angle else 0.01 * size,
            repair=column + "offset = {minus0}  # " + unit + ", added to what is there",
            equals=zero,
            tells="the rudder's angle read with the ship on a slip, or a run at another speed",
        )
        yield Cause(
            f"command {name} scale",
            lambda m, x, name=name: m.put({name: m.columns[name] / np.exp(x[0])}),
            (0.05,),
            "1",
            least=0.02,
            ratio=True,
            repair=column + "factor = {over0}  # times what is there",
            equals=strength,
            tells="the command read beside its instrument",
        )
        yield Cause(
            f"command {name} sign",
            lambda m, x, name=name: m.put({name: -m.columns[name]}),
            repair=column + "sign = -1  # times what is there",
            equals=("mirror image of the motion",) if angle else (),
            tells="one turn whose side is known",
        )
        yield Cause(
            f"command {name} delay",
            lambda m, x, name=name: m.earlier([name], x[0]),
            (max(0.05 * scales.passing, 0.25 * scales.interval),),
            "s",
            least=max(1.01 * scales.interval, 0.03 * scales.passing),
            starts=tuple(share * scales.passing for share in (0.3, 1.0, 2.0, 4.0)),
            repair=column + "# move this column {0} s earlier",
            equals=("slower actuator", "sensors early"),
            tells="a step of the command at rest, seen at the thruster",
        )
        if is_shaft(name) and (values < 0).any() and (values > 0).any():
            yield Cause(
                f"command {name} scale astern",
                lambda m, x, name=name: m.put({
                    name: np.where(m.columns[name] < 0, m.columns[name] / np.exp(x[0]), m.columns[name])
                }),
                (0.05,),
                "1",
                least=0.05,
                ratio=True,
                repair=column + "# times {over0} where it is below 0",
                equals=("coefficient thrust astern",),
                tells="the shaft read astern",
            )  # fmt: skip


def _exchanged_thrusters(commands: Sequence[str], motion: Motion) -> Iterator[Cause]:
    signals: dict[str, set[str]] = {}
    for name in commands:
        signals.setdefault(name.rpartition(".")[0], set()).add(signal_of(name))
    for a, b in combinations(signals, 2):
        names = [(f"{a}.{one}", f"{b}.{one}") for one in sorted(signals[a] & signals[b])]
        if signals[a] == signals[b] and any((motion.columns[x] != motion.columns[y]).any() for x, y in names):
            yield Cause(
                f"exchange {a} {b}",
                lambda m, x, names=names: m.put({
                    one: m.columns[other] for pair in names for one, other in (pair, pair[::-1])
                }),
                repair=f"exchange the columns of {a} and {b} in the mapping",
                equals=("command sign of both",),
                tells="a run with one of the two alone",
            )  # fmt: skip


def _sensor_causes(motion: Motion, scales: Scales) -> Iterator[Cause]:
    speed, rate = scales.speed, scales.speed / scales.length
    size = {"u": speed, "v": speed, "r": rate, "psi": 1.0}
    units = {"u": "m/s", "v": "m/s", "r": "rad/s", "psi": "rad"}
    equals = {
        "u": ("sensor u scale", "sensor velocity scale", "velocity through water"),
        "v": ("sensor psi bias", "velocity through water"),
        "r": (),
        "psi": ("positions in turned axes", "sensor v bias", "velocity through water", "current"),
    }
    for name in ("u", "v", "r", "psi"):
        yield Cause(
            f"sensor {name} bias",
            lambda m, x, name=name: m.put({name: m.columns[name] - x[0]}),
            (0.02 * size[name],),
            units[name],
            least=0.003 * size[name],
            repair=f"[columns.{name}]\noffset = {{minus0}}  # {units[name]}, added to what is there",
            equals=equals[name],
            tells="runs on opposite courses and at several speeds",
        )
    yield Cause(
        "sensor psi bias / with velocities",
        lambda m, x: m.put(_turned_velocity(m.columns, x[0])),
        (0.02,),
        "rad",
        least=0.003,
        repair='[[repair]]\nkind = "heading_offset"\noffset = {minus0}',
        equals=("sensor v bias", "current"),
        tells="runs on opposite courses and at several speeds",
    )
    for names, key, rows in (
        (("u",), "u", (0, 4)), (("v",), "v", (1,)), (("r",), "r", (2, 3)), (VELOCITY, "velocity", (0, 1, 4, 5)),
    ):  # fmt: skip
        yield Cause(
            f"sensor {key} scale",
            lambda m, x, names=names: m.put({name: m.columns[name] / np.exp(x[0]) for name in names}),
            (0.03,),
            "1",
            least=0.01,
            ratio=True,
            scaled=rows,
            repair="[[repair]]\n" + f'kind = "scale"\ncolumns = {[*names]}\n' + "factor = {over0}",
            equals=("sensor u bias", "sensor velocity scale", "sensor u scale", "velocity through water")
            if key in ("u", "velocity")
            else (),
            tells="runs at several speeds",
        )
    for name in ("v", "r", "psi"):
        yield Cause(
            f"sensor {name} sign",
            lambda m, x, name=name: m.put({name: -m.columns[name]}),
            repair=f"[columns.{name}]\nsign = -1  # times what is there",
        )
    for names, key, kind in (
        (("u",), "u", ""), (("v",), "v", ""), (("r",), "r", "yaw rate"), (("psi",), "psi", "heading"),
        (VELOCITY, "velocity", "velocity"), (POSITION, "position", "position"),
    ):  # fmt: skip
        yield Cause(
            f"sensor {key} delay",
            lambda m, x, names=names: m.earlier(names, x[0]),
            (max(0.03 * scales.passing, 0.25 * scales.interval),),
            "s",
            least=0.01 * scales.passing,
            starts=tuple(share * scales.passing for share in (-1.0, -0.3, 0.3, 1.0, 2.0)),
            repair=f'[[repair]]\nkind = "latency"\nsignal = "{kind or key}"\nseconds = {{0}}',
            equals={"position": ("lever arm position",), "u": ("sensor velocity delay",), "v": ("sensor velocity delay",), 
                    "velocity": ("sensor u delay", "sensor v delay")}.get(key, ()),
            tells="turns to both sides",
        )  # fmt: skip
    yield Cause("heading is course", _heading_from_course, repair="name the column of a gyro or a compass as psi")
    for moves in ("position", "velocity", "position and velocity"):
        yield Cause(
            f"lever arm {moves}",
            lambda m, x, moves=moves: _to_origin(m, x, moves),
            (0.05 * scales.length, 0.05 * scales.length),
            "m",
            least=0.02 * scales.length,
            repair='[[repair]]\nkind = "lever_arm"\nx = {0}\ny = {1}\nmoves = '
            + f'"{"both" if "and" in moves else moves}"',
            equals=("sensor position delay",) if moves == "position" else (),
            tells="turns to both sides at several speeds",
        )


def _turned_velocity(columns: Mapping[str, Array], bias: float) -> dict[str, Array]:
    turned = (columns["u"] + 1j * columns["v"]) * np.exp(1j * bias)
    return {"psi": columns["psi"] - bias, "u": turned.real, "v": turned.imag}


def _heading_from_course(motion: Motion, _: Array) -> Motion:
    columns = motion.columns
    drift = np.arctan2(columns["v"], columns["u"])
    return motion.put({"psi": columns["psi"] - drift})


def _to_origin(motion: Motion, arm: Array, moves: str) -> Motion:
    """The log of the origin, where it is of a point (x, y) [m] ahead and to starboard."""
    columns, (x, y), moved = motion.columns, arm, dict[str, Array]()
    if "position" in moves:
        point = (x + 1j * y) * np.exp(1j * columns["psi"])
        moved |= {"north": columns["north"] - point.real, "east": columns["east"] - point.imag}
    if "velocity" in moves:
        moved |= {"u": columns["u"] + y * columns["r"], "v": columns["v"] - x * columns["r"]}
    return motion.put(moved)


def _water_causes(motion: Motion, scales: Scales) -> Iterator[Cause]:
    trial, count = 0.03 * scales.speed, max(motion.runs) + 1
    run_of = np.concatenate([np.full(part.stop - part.start, run) for part, run in zip(motion.stretches, motion.runs, strict=True)])  # fmt: skip
    drift = ("sensor psi bias", "sensor v bias", "wind that the log lacks")
    how: dict[str, Any] = {"unit": "m/s", "least": 0.01 * scales.speed}
    how |= {"tells": "runs on opposite courses", "equals": (*drift, "current by run", "velocity through water")}
    yield Cause(
        "current",
        lambda m, x: _in_current(m, np.full(len(run_of), x[0] + 1j * x[1])),
        (trial, trial),
        repair="--set current=one  # north {0}, east {1} m/s",
        **how,
    )
    if count > 1:
        yield Cause(
            "current by run",
            lambda m, x: _in_current(m, (x[:count] + 1j * x[count:])[run_of]),
            2 * count * (trial,),
            repair='--set current="by run"',
            **how | {"equals": (*drift, "current", "velocity through water")},
        )
    yield Cause(
        "velocity through water",
        lambda m, x: m.put(_over_ground(m.columns, x[0] + 1j * x[1])),
        (trial, trial),
        repair="u and v are through the water: take [estimate] of positions and heading in their place",
        **how | {"equals": (*drift, "current", "sensor u bias")},
    )
    if "V_w" in motion.columns and np.any(motion.columns["V_w"]):
        yield Cause(
            "wind scale",
            lambda m, x: m.put({"V_w": m.columns["V_w"] * np.exp(-x[0])}),
            (0.05,), "1", least=0.05, ratio=True,
            repair="[columns.V_w]\nfactor = {over0}  # times what is there",
            equals=("coefficient wind",), tells="a reading of the wind at rest",
        )  # fmt: skip
        yield Cause(
            "wind direction",
            lambda m, x: m.put({"beta_w": m.columns["beta_w"] - x[0]}),
            (0.1,), "rad", least=0.05,
            repair="[columns.beta_w]\noffset = {minus0}  # rad, added to what is there",
        )  # fmt: skip


def _in_current(motion: Motion, current: Array) -> Motion:
    return motion.put({"V_c": np.abs(current), "beta_c": np.angle(current)})


def _over_ground(columns: Mapping[str, Array], current: complex) -> dict[str, Array]:
    """Velocities over ground, and the current, of a log whose velocities are through the water."""
    body = current * np.exp(-1j * columns["psi"])
    calm = np.zeros(len(body))
    return {
        "u": columns["u"] + body.real, "v": columns["v"] + body.imag,
        "V_c": calm + abs(current), "beta_c": calm + float(np.angle(current)),
    }  # fmt: skip


def _coefficient_causes(vessel: Vessel) -> Iterator[Cause]:
    names = list(vessel.parameters)
    groups = {
        "damping": [p for p in names if p.startswith("hull.") and p.rpartition(".")[2] not in GEOMETRY],
        "mass": [p for p in names if p in ("inertia.m", "inertia.I_z") or p.startswith("added_mass.")],
        "thrust": [p for p in names if is_thrust(p)],
        "rudder": [p for p in names if _is_rudder_force(p)],
    }
    equals = {
        "damping": ("coefficient thrust", "coefficient mass"),
        "mass": ("coefficient thrust", "coefficient damping"),
        "thrust": ("coefficient damping", "coefficient mass"),
    }
    for group, paths in groups.items():
        where = np.isin(names, paths)
        if not where.any():
            continue
        yield Cause(
            f"coefficient {group}",
            lambda m, x, where=where: replace(m, parameters=np.where(where, m.parameters * np.exp(x[0]), m.parameters)),
            (0.05,),
            "1",
            least=0.03,
            ratio=True,
            repair=f"--parameters {','.join(paths)}  # factor {{0}}",
            equals=equals.get(group, ()),
            tells="runs that speed up and slow down" if group in equals else "the command read beside its instrument",
        )


def _is_rudder_force(path: str) -> bool:
    name = path.rpartition(".")[2]
    return path.startswith("thruster.") and ".actuator." not in path and (name in RUDDER_NUMBERS or "delta" in name)
