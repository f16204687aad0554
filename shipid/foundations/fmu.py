"""A simulator that is an FMU: a table says which variables are which signals, FMPy runs it in a process of its own.

The standard: Functional Mock-up Interface 1.0, 2.0 and 3.0 for co-simulation, fmi-standard.org.
"""

from __future__ import annotations

import hashlib
import logging
import tempfile
import zipfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import pandas as pd
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from shipid import document as documents
from shipid.arguments import whole_steps
from shipid.checked import CheckedModel, Positive
from shipid.data.dataset import Dataset, clock_slack, stretches_of_runs
from shipid.data.windows import Instants, Windows, from_frame, to_frame
from shipid.engine.fmu_process import FmuCall, FmuRun, run_fmu
from shipid.errors import DataError, DocumentError, ShipidError, suggest_name
from shipid.foundations.faults import Array, doubt_of_rates
from shipid.foundations.function import SimulatorFunction
from shipid.logs.mapping import UNITS
from shipid.observer import MEASURED_MOTION
from shipid.physics.signals import ACTUAL, SIGNALS, is_command, is_steering, signal_of
from shipid.units import DEGREE

log = logging.getLogger(__name__)

RESPONSE = 120.0  # s of a step response
EXACT = 0.1  # by which, in a step response, changes may differ from integrals of rates, as a share


Role = Literal["input", "output", "start", "parameter"]
BEFORE = ("output", "local", "parameter", "input")  # what may be set before the start
ROLES = {"input": ("input",), "output": ("output", "local"), "start": BEFORE, "parameter": BEFORE}
"""Role of a row -> causalities of the variables that it may name."""


class FmuRow(BaseModel):
    """A row of `[fmu]`, `signal = { variable = ... }`: the signal is scale * variable + offset in `unit`."""

    model_config = ConfigDict(extra="forbid")
    variable: str
    unit: str | None = Field(default=None, description="default: that of the variable, else that of the signal")
    scale: Annotated[FiniteFloat, Field(description="not 0")] = 1.0
    offset: FiniteFloat = 0.0
    frame: Literal["ned", "enu", "body"] | None = Field(
        default=None,
        description="ned: angles from north to the right; enu: from east to the left; u, v in these or body axes",
    )
    role: Role | None = Field(default=None, description="default: by the causality of the variable")


class FmuTable(CheckedModel, BaseModel):
    """Keys of `[fmu]` beside its rows: a row, or a list of rows, for each signal."""

    file: str
    step: Annotated[Positive | None, Field(description="s of communication; default: that of the prediction")] = None
    limit: Annotated[Positive, Field(description="s that one run may take")] = 60.0


@dataclass(frozen=True)
class Link:
    """A signal and its variable: signal [SI] = factor * (scale * variable + offset), then turned by its frame."""

    signal: str
    reference: int
    factor: float
    row: FmuRow

    @property
    def over_ground(self) -> bool:
        """Whether it is a speed along north or east, in place of u or v."""
        return self.signal in ("u", "v") and self.row.frame in ("ned", "enu")

    def to_signal(self, values: Array) -> Array:
        """The signal [SI] of values of the variable."""
        return self._turned(self.factor * (self.row.scale * values + self.row.offset))

    def to_variable(self, values: Array) -> Array:
        """Values of the variable of a signal [SI]."""
        return np.asarray((self._turned(values) / self.factor - self.row.offset) / self.row.scale)

    def _turned(self, values: Array) -> Array:
        """An angle or a rate of turn to or from the axes east, north and up; the same both ways."""
        if self.row.frame != "enu" or self.signal in ("north", "east", "u", "v"):
            return values
        return np.pi / 2 - values if SIGNALS[signal_of(self.signal)].angle else -values


@dataclass(frozen=True)
class Fmu:
    """What an FMU and its table say.

    path : of the FMU. digest : of both.
    links : role -> rows, `parameter` with `start`. parameters : name -> value of each real parameter that is no signal.
    references : name of a parameter -> its value reference. branches : whether it can go back to a state that it had.
    """

    path: Path
    digest: str
    table: FmuTable
    links: Mapping[str, Sequence[Link]]
    parameters: Mapping[str, float]
    references: Mapping[str, int]
    branches: bool

    @property
    def startable(self) -> bool:
        """Whether it can be started with given u and r; else it runs along a run from its beginning."""
        return {"u", "r"} <= {link.signal for link in self.links["start"]}


@dataclass(frozen=True)
class RunTrack:
    """A record of a run from its beginning, and the windows that begin in it.

    record : states, orders and weather, name -> (N,) [SI], a row for each step of the FMU. windows : places of some of
        the S windows. rows : of the record, rising, at which they begin.
    """

    record: Mapping[str, Array]
    windows: Sequence[int]
    rows: Sequence[int]


@dataclass(frozen=True)
class SimulatorFmu(SimulatorFunction):
    """An FMU with its table.

    key : as the document names it. file : of the table, or of the FMU itself, whose variables are then signals by their
    names. parameters : of the FMU, in its own units. runs : records of the runs from their beginnings.
    """

    runs: Dataset | None = field(default=None, compare=False, repr=False)

    kind: ClassVar[str] = "fmu"

    @classmethod
    def read(cls, value: Any, folder: Path, trust: bool) -> Sequence[Self]:
        """Return the FMU that a document in a folder names; DocumentError where it may or can not be used."""
        one = cls(value, file=str(documents.find_document(Path(value), "models", folder).absolute()), trust=trust)
        known = replace(one, digest=one.fmu.digest, parameters=one.fmu.parameters)
        return [known if one.fmu.startable else replace(known, gives=("path", "motion"))]

    @cached_property
    def fmu(self) -> Fmu:
        """What the FMU and its table say; DocumentError where it may not be run, or is none."""
        self.require_trust()
        return read_fmu(Path(self.file))

    @property
    def code_digest(self) -> str:
        """Digest of the FMU and its table as they are now; as when the study was read, where it may not be run."""
        return self.fmu.digest if self.trust else self.digest

    def with_runs(self, dataset: Dataset) -> Self:
        """Return the FMU with the runs that it may have to go along."""
        return replace(self, runs=dataset)

    def check(self, training: Windows, test: Windows, before: Collection[int], remedy: str) -> Sequence[str]:
        """Say how it responds to its orders; DocumentError, DataError where signs, units or frames seem to be wrong."""
        columns = training.columns
        usual = {
            name: 0.0 if name != "u" and is_steering(name) else float(np.median(values))  # the helm amidships
            for name, values in columns.items()
            if name == "u" or "." in name
        }
        inputs = {name: usual.get(name, 0.0) for name in columns}
        high = {name: float(np.quantile(columns[name], 0.95)) for name in usual if "." in name}
        changes = {name: value - usual[name] for name, value in high.items() if value > usual[name]}
        said = self.describe_response(np.array([0.0, 0.0, 0.0, usual["u"], 0.0, 0.0]), inputs, changes)
        super().check(training, test, before, remedy)
        way = "starts from the state of each window" if self.fmu.startable else "takes no u and r: runs along each run"
        return [f"{self.key}: {words}" for words in (way, *said)]

    def states(self, instants: Instants, horizon: int, step: float) -> Mapping[str, Array]:
        """Return the states that the FMU gives, name -> (T, S); no numbers from where it fails on."""
        begun, orders, weather = self.arguments_of(instants, horizon)
        motion, faults = self.simulate(begun, orders | weather, step, self._tracks_of(instants, step))
        if faults:
            log.warning("%s fails in %d of %d runs; the first: %s", self.key, len(faults), len(motion), faults[0])
        return {name: motion[:, 1:, place].T for place, name in enumerate(MEASURED_MOTION)}

    def perform(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The runs of a log with the motion of the FMU by the same orders, from the same start; DataError if it fails.

        frame : columns of a dataset, runs of equal length and equal steps. Motion other than in the plane is left out.
        """
        runs = [rows for _, rows in frame.groupby("run", sort=False)]
        columns = {name: values.reshape(len(runs), -1) for name, values in _columns(frame).items()}
        states = np.stack([columns[name][:, 0] for name in MEASURED_MOTION], axis=-1)
        along = [RunTrack({name: columns[name][place] for name in columns}, [place], [0]) for place in range(len(runs))]
        ahead = {name: values[:, :-1] for name, values in columns.items() if name not in MEASURED_MOTION}
        motion, faults = self.simulate(states, ahead, float(np.diff(columns["t"][0, :2])[0]), along)
        if faults:
            raise DataError(f"the FMU fails: {faults[0]}", file=self.file)
        others = [
            name
            for name in map(str, frame)
            if name in SIGNALS and SIGNALS[name].role == "motion" and name not in MEASURED_MOTION
        ]
        moved = {name: motion[..., place].ravel() for place, name in enumerate(MEASURED_MOTION)}
        return frame.drop(columns=others).assign(**moved)

    def _tracks_of(self, instants: Instants, step: float) -> list[RunTrack]:
        """The runs of instants from their beginnings, in steps of the FMU; none where nobody knows them."""
        if self.runs is None or instants.run is None or instants.t is None:
            return []
        along, within = [], step / self.steps_within(step)
        for run, rows in stretches_of_runs(self.runs):
            t, now = rows["t"].to_numpy(), instants.t
            slack = clock_slack(t)
            mine = np.flatnonzero((instants.run == run) & (now >= t[0] - slack) & (now <= t[-1] + slack))
            if len(mine):
                mine = mine[np.argsort(now[mine], kind="stable")]
                at = np.rint((now[mine] - t[0]) / within).astype(int)
                held = np.searchsorted(t, t[0] + within * np.arange(max(at[-1], 1)) + slack, side="right") - 1
                record = {name: values[held] for name, values in _columns(rows).items()}
                along.append(RunTrack(record, mine.tolist(), at.tolist()))
        return along

    def simulate(
        self,
        states: Array,
        inputs: Mapping[str, Array],
        step: float,
        along: Sequence[RunTrack] = (),
    ) -> tuple[Array, list[str]]:
        """Motion (S, K + 1, 6) after 0..K steps [s], no numbers from where it fails on, and the faults.

        It begins at the states. Where the FMU cannot be started with u and r, it runs along the run from its beginning,
        and goes on from each window; its motion is then moved and turned to the place and heading of the states, its
        speeds are its own.

        states : (S, 6) north, east [m], psi [rad], u, v [m/s], r [rad/s]. inputs : orders and weather, name -> (S, K)
            [SI]. along : the runs of the windows; without them actuators begin at their orders.
        """
        begun, every = dict(zip(MEASURED_MOTION, np.asarray(states, float).T, strict=True)), self.steps_within(step)
        given = self._variables("input", {"psi": begun["psi"][:, None], **inputs}).repeat(every, axis=1).tolist()
        names = {link.signal for link in self.fmu.links["start"]}
        reached = {name for name in names if name.startswith(ACTUAL)}
        if self.fmu.startable:
            begun |= {name: values[:, 0] for name, values in inputs.items()}
            begun |= {name: begun[name.removeprefix(ACTUAL)].copy() for name in reached}
            tracks = [
                FmuRun(self._start_of(one), [], self._variables("input", one.record).tolist())
                for one in along
                if reached
            ]
            for one, values in zip(along, self._signals(tracks, step / every, 1)[0], strict=False):
                for name in reached:
                    begun[name][one.windows] = values[name][one.rows]
            order: Sequence[int] = range(len(given))
            starts = self._variables("start", begun).tolist()
            runs = [FmuRun(start, [], branch) for start, branch in zip(starts, given, strict=True)]
        else:
            order, runs = [place for one in along for place in one.windows], []
            for one in along:
                record, last = self._variables("input", one.record).tolist(), None
                for place, row in zip(one.windows, one.rows, strict=True):
                    start = self._start_of(one) if last is None else None
                    runs.append(FmuRun(start, record[last or 0 : row], given[place], self.fmu.branches))
                    last = row if self.fmu.branches else None
        found, faults = self._signals(runs, step / every, every)
        motion = np.full((len(given), len(given[0]) // every + 1, len(MEASURED_MOTION)), np.nan)
        motion[list(order)] = [np.stack([one[name] for name in MEASURED_MOTION], axis=-1) for one in found]
        turned = not (self.fmu.startable and "psi" in names)
        return _move_motion(motion, states, turned or not {"north", "east"} <= names, turned), faults

    def describe_response(self, state: Array, inputs: Mapping[str, float], changes: Mapping[str, float]) -> list[str]:
        """A sentence on each order that changes by a step: which way the ship turns, how fast it is in the end.

        state : (6,) at the start. inputs, changes : name -> value, and how much more it is from the start on [SI].
        DocumentError where heading and place do not follow from r, u and v: a wrong sign, unit or frame.
        """
        step, still = (
            self.fmu.table.step or RESPONSE / 200,
            dict(zip(MEASURED_MOTION, np.reshape(state, (6, 1)), strict=True)),
        )
        held = [
            {key: np.array([value + changes[one] * (key == one)]) for key, value in inputs.items()} for one in changes
        ]
        ahead = {key: np.stack([one[key] for one in held]).repeat(round(RESPONSE / step), axis=1) for key in inputs}
        along = [RunTrack(still | one, [place], [0]) for place, one in enumerate(held)]
        motion, faults = self.simulate(np.tile(state, (len(held), 1)), ahead, step, along)
        if not np.isfinite(motion).all():
            at = np.argwhere(~np.isfinite(motion))[:, 1].min()
            fault = faults[0] if faults else f"its motion is no number after {at * step:g} s"
            raise DocumentError(f"the FMU fails in a step response: {fault}", file=self.file)
        if doubt := doubt_of_rates(motion, step, EXACT):
            raise DocumentError(f"fmu.{doubt}", file=self.file)
        return [
            f"{name} {change:+.3g} {SIGNALS[signal_of(name)].unit}: after {RESPONSE:g} s it turns "
            f"to {'starboard' if end[5] > 0 else 'port'} by {abs(end[5]) / DEGREE:.2g} deg/s "
            f"at {np.hypot(*end[3:5]):.3g} m/s"
            for (name, change), end in zip(changes.items(), motion[:, -1], strict=True)
        ]

    def steps_within(self, step: float) -> int:
        """Steps of the FMU in one of the prediction."""
        every = whole_steps(step, self.fmu.table.step or step)
        if not every:
            words = f"{self.fmu.table.step:g} s: {step:g} s (prediction.step or truth.step) is no multiple of it"
            raise DocumentError(words, file=self.file, path="fmu.step")
        return every

    def _start_of(self, along: RunTrack) -> list[float]:
        """Start values at the beginning of a run, where actuators are at their orders."""
        first = {name: values[:1] for name, values in along.record.items()}
        reached = {f"{ACTUAL}{name}": values for name, values in first.items()}
        return list(self._variables("start", reached | first)[0].tolist())

    def _variables(self, role: str, signals: Mapping[str, Array]) -> Array:
        """Values (..., n) of the variables of a role; ShipidError where a signal is not there."""
        links = self.fmu.links[role]
        if missing := next((link.signal for link in links if link.signal not in signals), None):
            words = f"the FMU takes {missing}, which the runs do not have: {suggest_name(missing, signals)}"
            raise DocumentError(words, file=self.file, path=f"fmu.{missing}")
        values = dict(signals)
        if any(link.over_ground for link in links):
            north, east = from_frame(signals["u"], signals["v"], 0.0, 0.0, signals["psi"])
            values |= {"ned u": north, "ned v": east, "enu u": east, "enu v": north}
        keys = [f"{link.row.frame} {link.signal}" if link.over_ground else link.signal for link in links]
        found = [link.to_variable(values[key]) for key, link in zip(keys, links, strict=True)]
        return np.stack(np.broadcast_arrays(*found), axis=-1) if found else np.empty((*np.shape(signals["psi"]), 0))

    def _signals(self, runs: Sequence[FmuRun], step: float, every: int) -> tuple[list[dict[str, Array]], list[str]]:
        """Signals of each run [SI], name -> (K + 1,) in the axes of the FMU, from its branch on, and the faults."""
        start, inputs, outputs = (
            [link.reference for link in self.fmu.links[role]] for role in ("start", "input", "output")
        )
        changed = {name: value for name, value in self.parameters.items() if value != self.fmu.parameters[name]}
        before = [self.fmu.references[name] for name in changed]
        call = FmuCall(before, [*changed.values()], start, inputs, outputs, step, every)
        found, faults, links = list[dict[str, Array]](), list[str](), self.fmu.links["output"]
        with tempfile.TemporaryDirectory(prefix="shipid-fmu-") as folder:
            with zipfile.ZipFile(self.fmu.path) as archive:
                archive.extractall(folder)
            for run, (rows, fault) in zip(runs, run_fmu(Path(folder), call, runs, self.fmu.table.limit), strict=True):
                records = np.full((len(run.branch) // every + 1, len(outputs)), np.nan)
                records[: len(rows)] = np.reshape(rows, (-1, len(outputs)))
                values = {link.signal: link.to_signal(records[:, at]) for at, link in enumerate(links)}
                values["psi"] = np.unwrap(values["psi"])
                frames = {link.row.frame for link in links if link.over_ground}
                if frames:
                    north, east = (values[name] for name in ("uv" if frames == {"ned"} else "vu"))
                    values |= dict(zip("uv", to_frame(north, east, 0.0, 0.0, values["psi"]), strict=True))
                found.append(values)
                faults += [fault] if fault else []
        return found, faults


def _columns(frame: pd.DataFrame) -> dict[str, Array]:
    """Columns (N,) of numbers."""
    return {str(name): frame[name].to_numpy() for name in frame if name not in ("run", "flags")}


def _move_motion(motion: Array, states: Array, moved: bool, turned: bool) -> Array:
    """Motion (S, K + 1, 6) moved, and turned, so that it begins at the place and heading of the states (S, 6)."""
    motion, goal = motion.copy(), np.asarray(states, float)
    turn = goal[:, 2:3] - motion[:, :1, 2] if turned else 0.0 * goal[:, 2:3]
    if moved:
        x, y = to_frame(motion[..., 0], motion[..., 1], motion[:, :1, 0], motion[:, :1, 1], -turn)
        motion[..., 0], motion[..., 1] = x + goal[:, :1], y + goal[:, 1:2]
    motion[..., 2] += turn
    return motion


def read_fmu(name: str | Path, relative_to: Path | None = None) -> Fmu:
    """An FMU by its table, or by its own path where its variables have the names of signals.

    DocumentError for a file that is no FMU for co-simulation, and for rows that are wrong or missing.
    """
    file = documents.find_document(Path(name), "models", relative_to)
    raw = {"file": file.name} if file.suffix == ".fmu" else documents.read_document(file).get("fmu")
    if not isinstance(raw, dict):
        raise DocumentError("has no table [fmu]: give file, step, and a row for each signal", file=file)
    own = {key: raw[key] for key in FmuTable.model_fields if key in raw}
    table: FmuTable = documents.parse_model(FmuTable, own, file, "fmu")
    rows: dict[str, list[FmuRow]] = {
        signal: [
            documents.parse_model(FmuRow, row, file, f"fmu.{signal}")
            for row in (its if isinstance(its, list) else [its])
        ]
        for signal, its in raw.items()
        if signal not in own
    }
    path = documents.find_document(Path(table.file), "models", file.parent)
    description = _read_description(path)
    variables = _numbers(description)
    for one in variables.values():  # by its name, where no row says else
        if one.causality in ("input", "output") and _is_signal(one.name):
            rows.setdefault(one.name, [FmuRow(variable=one.name)])
    links: dict[str, list[Link]] = {role: [] for role in ROLES}
    for signal, its in rows.items():
        for row in its:
            for role, link in _links_of_row(signal, row, variables, file):
                links[role].append(link)
    have = {link.signal for link in links["output"]}
    missing: dict[str, list[str]] = {
        "output": [name for name in MEASURED_MOTION if name not in have],
        "input": [] if links["input"] else ["orders"],
    }
    for role, names in missing.items():
        if names:
            there = ", ".join(one.name for one in variables.values() if one.causality in ROLES[role]) or "none"
            words = f"no row gives {', '.join(names)}; variables of the FMU for a row of role {role}: {there}"
            raise DocumentError(words, file=file, path="fmu")
    used = {link.reference for some in links.values() for link in some}
    free = {
        name: one
        for name, one in variables.items()
        if one.causality == "parameter" and one.start is not None and one.valueReference not in used
    }
    return Fmu(
        path,
        hashlib.sha256(path.read_bytes() + documents.digest_document(raw).encode()).hexdigest()[:8],
        table,
        links | {"start": links["start"] + links["parameter"]},
        {name: float(one.start) for name, one in free.items()},
        {name: one.valueReference for name, one in free.items()},
        description.fmiVersion[0] != "1" and description.coSimulation.canGetAndSetFMUstate,
    )


def _read_description(path: Path) -> Any:
    """The model description of an FMU for co-simulation; DocumentError where it is none that runs here."""
    try:
        import fmpy
    except ImportError:
        raise ShipidError("FMPy runs an FMU: pip install 'shipid[fmu]'", file=path) from None
    try:
        description = fmpy.read_model_description(str(path), validate=False)
        platforms = fmpy.supported_platforms(str(path))
        with zipfile.ZipFile(path) as archive:
            if damaged := archive.testzip():
                raise ValueError(f"{damaged!r} in it is damaged")
        _ = [float(one.start) for one in _numbers(description).values() if one.start is not None]
    except Exception as error:  # of the archive, of its XML or of what that says
        raise DocumentError(f"is no FMU: {' '.join(str(error).split())[:200]}", file=path) from None
    if description.coSimulation is None:
        raise DocumentError("is an FMU for model exchange: export it for co-simulation", file=path)
    if fmpy.platform not in platforms:
        there = ", ".join(platforms) or "no platform"
        raise DocumentError(f"has no binary for {fmpy.platform}, but for {there}: `fmpy compile` makes one", file=path)
    return description


def _numbers(description: Any) -> dict[str, Any]:
    """The real variables of an FMU that are no arrays, by name."""
    return {
        one.name: one for one in description.modelVariables if one.type in ("Real", "Float64") and not one.dimensions
    }


def _is_signal(name: str) -> bool:
    """Whether a name is that of a state, an order or the weather."""
    return (
        name in MEASURED_MOTION
        or is_command(name.removeprefix(ACTUAL))
        or (name in SIGNALS and SIGNALS[name].role == "environment")
    )


def _links_of_row(signal: str, row: FmuRow, variables: Mapping[str, Any], file: Path) -> Iterator[tuple[str, Link]]:
    """Role and link of a row; of an output that may be set before the start, too, two."""
    path = f"fmu.{signal}"
    if not _is_signal(signal):
        words = f"no signal: give {', '.join(MEASURED_MOTION)}, an order such as rudder.delta, or wind such as V_w"
        raise DocumentError(words, file=file, path=path)
    if row.variable not in variables:
        words = f"no real variable {row.variable!r}: {suggest_name(row.variable, variables)}"
        raise DocumentError(words, file=file, path=f"{path}.variable")
    variable = variables[row.variable]
    roles = [role for role, kinds in ROLES.items() if variable.causality in kinds]
    role: Any = row.role or next(iter(roles), None)
    if role not in roles or role == ("input" if signal in MEASURED_MOTION or signal.startswith(ACTUAL) else "output"):
        words = f"{row.variable!r} has the causality {variable.causality}, no {role or 'variable'} of {signal}"
        raise DocumentError(words, file=file, path=f"{path}.role")
    si = SIGNALS[signal_of(signal)].unit
    declared = variable.unit or getattr(variable.declaredType, "unit", None)
    unit, known = row.unit or declared or si, UNITS.get(si, {si: 1.0})
    if unit not in known or row.scale == 0:
        words = f"{unit!r}: give one of {', '.join(known)}, and a scale that is not 0"
        raise DocumentError(words, file=file, path=f"{path}.unit")
    link = Link(signal, variable.valueReference, known[unit], row)
    yield role, link
    settable = variable.start is not None and variable.initial in ("exact", "approx", None)
    if row.role is None and role == "output" and settable:
        yield "start", link
