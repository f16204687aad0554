"""A ship that is an FMU: a table says which variables are which signals, and FMPy runs it.

The standard: Functional Mock-up Interface 1.0, 2.0 and 3.0 for co-simulation, fmi-standard.org.
"""

from __future__ import annotations

import hashlib
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from shipid import document as documents
from shipid.arguments import whole_steps
from shipid.checked import CheckedModel, Positive
from shipid.errors import DocumentError, ShipidError, suggest_name
from shipid.foundations.fmu_process import FmuCall, FmuRun, run_fmu
from shipid.logs.mapping import UNITS
from shipid.physics.signals import SIGNALS, is_command, signal_of
from shipid.units import DEGREE

Array = np.ndarray
STATES = ("north", "east", "psi", "u", "v", "r")
Role = Literal["input", "output", "start", "parameter"]
BEFORE = ("output", "local", "parameter", "input")  # what may be set before the start
ROLES = {"input": ("input",), "output": ("output", "local"), "start": BEFORE, "parameter": BEFORE}
"""Role of a row -> causalities of the variables that it may name."""
RESPONSE = 120.0  # s of a step response
SLOPE = 0.1  # by which the changes of place and heading may differ from the integrals of u, v and r, as a share


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
    """`[fmu]`: a file, its step, and a row, or a list of rows, for each signal."""

    model_config = ConfigDict(extra="forbid")
    file: str
    step: Annotated[Positive | None, Field(description="s of communication; default: that of the prediction")] = None
    limit: Annotated[Positive, Field(description="s that one run may take")] = 60.0
    rows: dict[str, list[FmuRow]] = {}


@dataclass(frozen=True)
class Link:
    """A signal and its variable: signal [SI] = factor * (scale * variable + offset), then turned by its frame."""

    signal: str
    reference: int
    factor: float
    row: FmuRow

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
    """An FMU with its table.

    file : of the table, or of the FMU itself, whose variables are then signals by their names. path : of the FMU.
    start, inputs, outputs : the rows by their use. parameters : name -> value of each real parameter that is no signal.
    references : name of a parameter -> its value reference. branches : whether it can go back to a state that it had.
    """

    file: Path
    path: Path
    table: FmuTable
    start: tuple[Link, ...]
    inputs: tuple[Link, ...]
    outputs: tuple[Link, ...]
    parameters: Mapping[str, float]
    references: Mapping[str, int]
    branches: bool

    @property
    def startable(self) -> bool:
        """Whether it can be started with given u and r; else it runs along a run from its beginning."""
        return {"u", "r"} <= {link.signal for link in self.start}

    @property
    def digest(self) -> str:
        """Digest (8 hex digits) of the FMU and its table."""
        return hashlib.sha256(self.path.read_bytes() + self.table.model_dump_json().encode()).hexdigest()[:8]

    def simulate(
        self, states: Array, inputs: Mapping[str, Array], step: float, parameters: Mapping[str, float]
    ) -> tuple[Array, list[str]]:
        """Motion (S, K, 6) after 1..K steps [s] from each state, no numbers from where it fails on, and the faults.

        states : (S, 6) north, east [m], psi [rad], u, v [m/s], r [rad/s]. inputs : orders and weather, name -> (S, K)
            [SI]. parameters : of the FMU, in its own units; others keep the values that they have there.
        """
        every = self._steps_within(step)
        begun = dict(zip(STATES, np.asarray(states, float).T, strict=True)) | {k: v[:, 0] for k, v in inputs.items()}
        start, branches = _variables(self.start, begun), self._branches(states, inputs, every)
        runs = [FmuRun(one, [], branch) for one, branch in zip(start.tolist(), branches, strict=True)]
        names = {link.signal for link in self.start}
        motion, faults = self._motion(runs, step, every, parameters)
        moved, turned = not {"north", "east"} <= names, "psi" not in names
        return _move_motion(motion, states, moved or turned, turned)[:, 1:], faults

    def simulate_along(
        self,
        record: Mapping[str, Array],
        rows: Sequence[int],
        states: Array,
        inputs: Mapping[str, Array],
        step: float,
        parameters: Mapping[str, float],
    ) -> tuple[Array, list[str]]:
        """The same, for an FMU that starts at the beginning of a run: it branches off at some rows of the record.

        Its motion from there on is moved and turned to the true place and heading; its speeds stay its own.

        record : states, orders and weather of the run, name -> (N,), every `fmu.step`, or `step`. rows : rising, of S.
        """
        every = self._steps_within(step)
        given = _variables(self.inputs, record).tolist()
        start = _variables(self.start, {name: values[:1] for name, values in record.items()})[0].tolist()
        runs: list[FmuRun] = []
        last = 0
        for place, branch in zip(rows, self._branches(states, inputs, every), strict=True):
            on = self.branches and bool(runs)
            runs.append(FmuRun(None if on else start, given[last if on else 0 : place], branch, self.branches))
            last = place
        motion, faults = self._motion(runs, step, every, parameters)
        return _move_motion(motion, states, True, True)[:, 1:], faults

    def describe_response(self, state: Array, inputs: Mapping[str, float], changes: Mapping[str, float]) -> list[str]:
        """A sentence on each order that changes by a step: which way the ship turns, how fast it is in the end.

        state : (6,) at the start. inputs, changes : name -> value, and how much more it is from the start on [SI].
        DocumentError where heading and place do not follow from r, u and v: a wrong sign, unit or frame.
        """
        names, step = list(changes), self.table.step or RESPONSE / 200
        values = {
            key: np.full(len(names), value) + [changes[key] * (key == one) for one in names]
            for key, value in inputs.items()
        }
        held = {key: np.repeat(value[:, None], round(RESPONSE / step), axis=1) for key, value in values.items()}
        motion, faults = self.simulate(np.tile(state, (len(names), 1)), held, step, {})
        if not np.isfinite(motion).all():
            raise DocumentError(f"the FMU fails in a step response: {'; '.join(faults[:1])}", file=self.file)
        self._check_rates(motion, step)
        ends = [
            (name, changes[name], one[-1, 5], np.hypot(one[-1, 3], one[-1, 4]))
            for name, one in zip(names, motion, strict=True)
        ]
        return [
            f"{name} {change:+.3g} {SIGNALS[signal_of(name)].unit}: after {RESPONSE:g} s it turns to "
            f"{'starboard' if r > 0 else 'port'} by {abs(r) / DEGREE:.2g} deg/s at {speed:.3g} m/s"
            for name, change, r, speed in ends
        ]

    def _check_rates(self, motion: Array, step: float) -> None:
        """Raise DocumentError where changes of heading and place are not the integrals of r, u and v."""
        north, east, psi, u, v, r = np.moveaxis(motion, -1, 0)
        between = [(one[:, 1:] + one[:, :-1]) / 2 for one in (psi, u, v, r)]
        along = np.diff(north + 1j * east) * np.exp(-1j * between[0])
        moved = {"psi": np.diff(psi), "u": along.real, "v": along.imag}
        for (name, change), rate in zip(moved.items(), (between[3], *between[1:3]), strict=True):
            size = float((rate**2).sum())
            slope = float((change * rate).sum()) / (step * size) if size else 1.0
            if abs(slope - 1) > SLOPE and np.sqrt(size) > SLOPE * np.hypot(*between[1:3]).max() * (name == "v"):
                what, of = ("heading changes", "r") if name == "psi" else ("place changes", name)
                words = f"{what} by {slope:.3g} times the integral of {of}: check sign (scale), unit and frame of both"
                raise DocumentError(words, file=self.file, path=f"fmu.{of}")

    def _steps_within(self, step: float) -> int:
        """Steps of the FMU in one of the prediction."""
        every = whole_steps(step, self.table.step or step)
        if not every:
            words = f"{self.table.step:g} s: the step of the prediction, {step:g} s, must be a multiple"
            raise DocumentError(words, file=self.file, path="fmu.step")
        return every

    def _branches(self, states: Array, inputs: Mapping[str, Array], every: int) -> Any:
        """Inputs of the FMU in each of its steps, S lists of rows."""
        psi = {"psi": np.asarray(states, float)[:, 2:3]}
        return np.repeat(_variables(self.inputs, psi | dict(inputs)), every, axis=1).tolist()

    def _motion(
        self, runs: Sequence[FmuRun], step: float, every: int, parameters: Mapping[str, float]
    ) -> tuple[Array, list[str]]:
        """Motion (S, K + 1, 6) of runs as the FMU has it, from its branch on, and the faults."""
        if unknown := next((name for name in parameters if name not in self.parameters), None):
            words = f"no parameter of the FMU: {suggest_name(unknown, self.parameters)}"
            raise DocumentError(words, file=self.file, path=unknown)
        start, inputs, outputs = ([one.reference for one in links] for links in (self.start, self.inputs, self.outputs))
        begun = [self.references[name] for name in parameters]
        call = FmuCall(begun, list(map(float, parameters.values())), start, inputs, outputs, step / every, every)
        records = np.full((len(runs), len(runs[0].branch) // every + 1, len(self.outputs)), np.nan)
        faults = []
        with tempfile.TemporaryDirectory(prefix="shipid-fmu-") as folder:
            with zipfile.ZipFile(self.path) as archive:
                archive.extractall(folder)
            for place, (rows, fault) in enumerate(run_fmu(Path(folder), call, runs, self.table.limit)):
                records[place, : len(rows)] = np.reshape(rows, (-1, len(self.outputs)))
                faults += [fault] if fault else []
        values = {link.signal: link.to_signal(records[..., place]) for place, link in enumerate(self.outputs)}
        values["psi"] = np.unwrap(values["psi"])
        frames = {link.signal: link.row.frame for link in self.outputs}
        if frames["u"] in ("ned", "enu"):
            over = values["u"] + 1j * values["v"] if frames["u"] == "ned" else values["v"] + 1j * values["u"]
            ahead = over * np.exp(-1j * values["psi"])
            values |= {"u": ahead.real, "v": ahead.imag}
        return np.stack([values[name] for name in STATES], axis=-1), faults


def _variables(links: Sequence[Link], signals: Mapping[str, Array]) -> Array:
    """Values (..., n) of the variables of links; ShipidError where a signal is not there."""
    if missing := next((link.signal for link in links if link.signal not in signals), None):
        raise ShipidError(f"the FMU takes {missing}, which the runs do not have")
    values = dict(signals)
    if any(link.signal in ("u", "v") and link.row.frame in ("ned", "enu") for link in links):
        over = (signals["u"] + 1j * signals["v"]) * np.exp(1j * signals["psi"])
        values |= {"ned u": over.real, "ned v": over.imag, "enu u": over.imag, "enu v": over.real}
    keys = [f"{link.row.frame} {link.signal}" for link in links]
    found = [
        link.to_variable(values[key if key in values else link.signal]) for key, link in zip(keys, links, strict=True)
    ]
    shape = np.broadcast_shapes(*(np.shape(one) for one in found)) if found else np.shape(signals["psi"])
    return np.stack([np.broadcast_to(one, shape) for one in found], axis=-1) if found else np.empty((*shape, 0))


def _move_motion(motion: Array, states: Array, moved: bool, turned: bool) -> Array:
    """Motion (S, K + 1, 6) moved, and turned, so that it begins at the place and heading of the states (S, 6)."""
    motion, goal = motion.copy(), np.asarray(states, float)
    turn = goal[:, 2:3] - motion[:, :1, 2] if turned else 0.0 * goal[:, 2:3]
    if moved:
        way = motion[..., 0] + 1j * motion[..., 1]
        way = (way - way[:, :1]) * np.exp(1j * turn) + (goal[:, :1] + 1j * goal[:, 1:2])
        motion[..., 0], motion[..., 1] = way.real, way.imag
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
    own = {key: raw[key] for key in FmuTable.model_fields.keys() - {"rows"} if key in raw}
    rows = {key: row if isinstance(row, list) else [row] for key, row in raw.items() if key not in own}
    table: FmuTable = documents.parse_model(FmuTable, own | {"rows": rows}, file, "fmu")
    path = documents.find_document(Path(table.file), "models", file.parent)
    description = _read_description(path)
    variables = {
        one.name: one for one in description.modelVariables if one.type in ("Real", "Float64") and not one.dimensions
    }
    for one in variables.values():  # by its name, where no row says else
        if one.name not in table.rows and _is_signal(one.name):
            table.rows[one.name] = [FmuRow(variable=one.name)]
    links: dict[str, list[Link]] = {role: [] for role in ROLES}
    for signal, its in table.rows.items():
        for row in its:
            for role, link in _links_of_row(signal, row, variables, file):
                links[role].append(link)
    before = (*links["start"], *links["parameter"])
    for role, wanted in (("output", STATES), ("input", ("orders",))):
        have = {link.signal for link in links[role]} | ({"orders"} if links["input"] else set())
        if missing := [name for name in wanted if name not in have]:
            there = ", ".join(one.name for one in variables.values() if one.causality in ROLES[role]) or "none"
            words = f"no row gives {', '.join(missing)}; variables of the FMU for a row of role {role}: {there}"
            raise DocumentError(words, file=file, path="fmu")
    used = {link.reference for some in links.values() for link in some}
    free = {
        name: one
        for name, one in variables.items()
        if one.causality == "parameter" and one.start is not None and one.valueReference not in used
    }
    return Fmu(
        file,
        path,
        table,
        before,
        tuple(links["input"]),
        tuple(link for link in links["output"] if link.signal in STATES),
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
    except Exception as error:  # of the archive, of its XML or of what that says
        raise DocumentError(f"is no FMU: {' '.join(str(error).split())[:200]}", file=path) from None
    if description.coSimulation is None:
        raise DocumentError("is an FMU for model exchange: export it for co-simulation", file=path)
    if fmpy.platform not in platforms:
        there = ", ".join(platforms) or "no platform"
        raise DocumentError(f"has no binary for {fmpy.platform}, but for {there}: `fmpy compile` makes one", file=path)
    return description


def _is_signal(name: str) -> bool:
    """Whether a name is that of a state, an order or the weather."""
    return name in STATES or is_command(name) or (name in SIGNALS and SIGNALS[name].role == "environment")


def _links_of_row(signal: str, row: FmuRow, variables: Mapping[str, Any], file: Path) -> Iterator[tuple[str, Link]]:
    """Role and link of a row; of an output that may be set before the start, too, two."""
    path = f"fmu.{signal}"
    if not _is_signal(signal):
        words = f"no signal: give {', '.join(STATES)}, an order such as rudder.delta, or wind such as V_w"
        raise DocumentError(words, file=file, path=path)
    if row.variable not in variables:
        words = f"no real variable {row.variable!r}: {suggest_name(row.variable, variables)}"
        raise DocumentError(words, file=file, path=f"{path}.variable")
    variable = variables[row.variable]
    roles = [role for role, kinds in ROLES.items() if variable.causality in kinds]
    role: Any = row.role or next(iter(roles), None)
    if role not in roles or role == ("input" if signal in STATES else "output"):
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
