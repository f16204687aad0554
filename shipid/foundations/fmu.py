"""A simulator that is an FMU, which FMPy runs in a process of its own."""

from __future__ import annotations

import logging
import tempfile
import zipfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd

from shipid.arguments import whole_steps
from shipid.data.dataset import Dataset, clock_slack, stretches_of_runs
from shipid.data.windows import Instants, Windows, from_frame
from shipid.document import find_document
from shipid.engine.fmu_process import FmuCall, FmuRun, run_fmu
from shipid.errors import DataError, DocumentError
from shipid.foundations.fmu_table import Fmu, read_fmu
from shipid.foundations.function import STATES, SimulatorFunction
from shipid.physics.signals import ACTUAL, SIGNALS, signal_of
from shipid.units import DEGREE

log = logging.getLogger(__name__)

Array = np.ndarray
RESPONSE = 120.0  # s of a step response
SLOPE = 0.1  # by which the changes of place and heading may differ from the integrals of u, v and r, as a share
LOOKED_AT = 100  # training windows on which the signs of orders are tried
OTHER_WAY = 0.5  # times the error at the horizon as it is: an order with another sign that leaves less has it


@dataclass(frozen=True)
class Along:
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
        one = cls(value, file=str(find_document(Path(value), "models", folder).absolute()), trust=trust)
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

    def along(self, dataset: Dataset) -> Self:
        """Return the FMU with the runs that it may have to go along."""
        return replace(self, runs=dataset)

    def check(self, training: Windows, test: Windows, before: Collection[int], remedy: str) -> Sequence[str]:  # noqa: ARG002
        """Say how it responds to its orders; DocumentError, DataError where signs, units or frames seem to be wrong."""
        columns = training.columns
        usual = {name: float(np.median(values)) for name, values in columns.items() if name == "u" or "." in name}
        inputs = {name: usual.get(name, 0.0) for name in columns}
        high = {name: float(np.quantile(columns[name], 0.95)) for name in usual if "." in name}
        changes = {name: value - usual[name] for name, value in high.items() if value > usual[name]}
        said = self.describe_response(np.array([0.0, 0.0, 0.0, usual["u"], 0.0, 0.0]), inputs, changes)
        some = training.select(np.arange(0, len(training), max(len(training) // LOOKED_AT, 1)))
        given, own = some.instants(known=True), [link.signal for link in self.fmu.links["input"] if link.signal in high]
        begun, orders, weather = self.arguments_of(given, some.horizon)
        goal = np.stack(from_frame(*some.future[-1].T, *begun[:, :3].T), axis=-1)
        errors = dict[str, float]()
        for name in ("", *own):  # as it is, and with each order the other way
            turned = {key: -values if key == name else values for key, values in orders.items()}
            motion, _ = self.simulate(begun, turned | weather, some.step, self._along(given, some.step))
            errors[name] = float(np.hypot(*(motion[:, -1, :2] - goal).T).mean())
        least = min(errors, key=errors.__getitem__)
        if remedy and errors[least] < OTHER_WAY * errors[""]:
            words = f"{least} acts the other way in the runs: check sign (scale) and frame of its row"
            raise DataError(f"{words}; {remedy}", file=self.file, path=f"fmu.{least}")
        way = "starts from the state of each window" if self.fmu.startable else "takes no u and r: runs along each run"
        return [f"{self.key}: {words}" for words in (way, *said)]

    def states(self, instants: Instants, horizon: int, step: float) -> Mapping[str, Array]:
        """Return the states that the FMU gives, name -> (T, S); no numbers from where it fails on."""
        begun, orders, weather = self.arguments_of(instants, horizon)
        motion, faults = self.simulate(begun, orders | weather, step, self._along(instants, step))
        if faults:
            log.warning("%s fails in %d of %d runs; the first: %s", self.key, len(faults), len(motion), faults[0])
        return {name: motion[:, 1:, place].T for place, name in enumerate(STATES)}

    def perform(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The runs of a log with the motion of the FMU by the same orders, from the same start; DataError if it fails.

        frame : columns of a dataset, runs of equal length and equal steps. Motion other than in the plane is left out.
        """
        runs = [rows for _, rows in frame.groupby("run", sort=False)]
        columns = {name: values.reshape(len(runs), -1) for name, values in _columns(frame).items()}
        states = np.stack([columns[name][:, 0] for name in STATES], axis=-1)
        along = [Along({name: columns[name][place] for name in columns}, [place], [0]) for place in range(len(runs))]
        ahead = {name: values[:, :-1] for name, values in columns.items() if name not in STATES}
        motion, faults = self.simulate(states, ahead, float(np.diff(columns["t"][0, :2])[0]), along)
        if faults:
            raise DataError(f"the FMU fails: {faults[0]}", file=self.file)
        others = [name for name in frame if name in SIGNALS and SIGNALS[name].role == "motion" and name not in STATES]
        moved = {name: motion[..., place].ravel() for place, name in enumerate(STATES)}
        return frame.drop(columns=others).assign(**moved)

    def _along(self, instants: Instants, step: float) -> list[Along]:
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
                along.append(Along(record, mine.tolist(), at.tolist()))
        return along

    def simulate(
        self,
        states: Array,
        inputs: Mapping[str, Array],
        step: float,
        along: Sequence[Along] = (),
    ) -> tuple[Array, list[str]]:
        """Motion (S, K + 1, 6) after 0..K steps [s], no numbers from where it fails on, and the faults.

        It begins at the states. Where the FMU cannot be started with u and r, it runs along the run from its beginning,
        and goes on from each window; its motion is then moved and turned to the place and heading of the states, its
        speeds are its own.

        states : (S, 6) north, east [m], psi [rad], u, v [m/s], r [rad/s]. inputs : orders and weather, name -> (S, K)
            [SI]. along : the runs of the windows; without them actuators begin at their orders.
        """
        begun, every = dict(zip(STATES, np.asarray(states, float).T, strict=True)), self.steps_within(step)
        given = self._variables("input", {"psi": begun["psi"][:, None], **inputs}).repeat(every, axis=1).tolist()
        names = {link.signal for link in self.fmu.links["start"]}
        reached = {name for name in names if name.startswith(ACTUAL)}
        if self.fmu.startable:
            begun |= {name: values[:, 0] for name, values in inputs.items()}
            begun |= {name: begun[name.removeprefix(ACTUAL)].copy() for name in reached}
            tracks = [FmuRun(self._start_of(one), [], self._record_of(one)) for one in along if reached]
            for one, values in zip(along, self._signals(tracks, step / every, 1)[0], strict=False):
                for name in reached:
                    begun[name][one.windows] = values[name][one.rows]
            order: Sequence[int] = range(len(given))
            starts = self._variables("start", begun).tolist()
            runs = [FmuRun(start, [], branch) for start, branch in zip(starts, given, strict=True)]
        else:
            order, runs = [place for one in along for place in one.windows], []
            for one in along:
                record, last = self._record_of(one), None
                for place, row in zip(one.windows, one.rows, strict=True):
                    start = self._start_of(one) if last is None else None
                    runs.append(FmuRun(start, record[last or 0 : row], given[place], self.fmu.branches))
                    last = row if self.fmu.branches else None
        found, faults = self._signals(runs, step / every, every)
        motion = np.full((len(given), len(given[0]) // every + 1, len(STATES)), np.nan)
        motion[list(order)] = [np.stack([one[name] for name in STATES], axis=-1) for one in found]
        turned = not (self.fmu.startable and "psi" in names)
        return _move_motion(motion, states, turned or not {"north", "east"} <= names, turned), faults

    def describe_response(self, state: Array, inputs: Mapping[str, float], changes: Mapping[str, float]) -> list[str]:
        """A sentence on each order that changes by a step: which way the ship turns, how fast it is in the end.

        state : (6,) at the start. inputs, changes : name -> value, and how much more it is from the start on [SI].
        DocumentError where heading and place do not follow from r, u and v: a wrong sign, unit or frame.
        """
        step, still = self.fmu.table.step or RESPONSE / 200, dict(zip(STATES, np.reshape(state, (6, 1)), strict=True))
        held = [
            {key: np.array([value + changes[one] * (key == one)]) for key, value in inputs.items()} for one in changes
        ]
        ahead = {key: np.stack([one[key] for one in held]).repeat(round(RESPONSE / step), axis=1) for key in inputs}
        along = [Along(still | one, [place], [0]) for place, one in enumerate(held)]
        motion, faults = self.simulate(np.tile(state, (len(held), 1)), ahead, step, along)
        if not np.isfinite(motion).all():
            raise DocumentError(f"the FMU fails in a step response: {'; '.join(faults[:1])}", file=self.file)
        self._check_rates(motion, step)
        sides = ["starboard" if r > 0 else "port" for r in motion[:, -1, 5]]
        return [
            f"{name} {change:+.3g} {SIGNALS[signal_of(name)].unit}: after {RESPONSE:g} s it turns to {side} by "
            f"{abs(end[5]) / DEGREE:.2g} deg/s at {np.hypot(*end[3:5]):.3g} m/s"
            for (name, change), side, end in zip(changes.items(), sides, motion[:, -1], strict=True)
        ]

    def _check_rates(self, motion: Array, step: float) -> None:
        """Raise DocumentError where changes of heading and place are not the integrals of r, u and v."""
        north, east, psi, u, v, r = np.moveaxis(motion, -1, 0)
        middle, *rates = [(one[:, 1:] + one[:, :-1]) / 2 for one in (psi, r, u, v)]
        along = np.diff(north + 1j * east) * np.exp(-1j * middle)
        fastest = np.hypot(*rates[1:]).max()
        for name, change, rate in zip("ruv", (np.diff(psi), along.real, along.imag), rates, strict=True):
            size = float((rate**2).sum())
            slope = float((change * rate).sum()) / (step * size) if size else 1.0
            if abs(slope - 1) > SLOPE and (name != "v" or np.sqrt(size) > SLOPE * fastest):
                what = "heading changes" if name == "r" else "place changes"
                words = (
                    f"{what} by {slope:.3g} times the integral of {name}: check sign (scale), unit and frame of both"
                )
                raise DocumentError(words, file=self.file, path=f"fmu.{name}")

    def steps_within(self, step: float) -> int:
        """Steps of the FMU in one of the prediction."""
        every = whole_steps(step, self.fmu.table.step or step)
        if not every:
            words = f"{self.fmu.table.step:g} s: the step of the prediction, {step:g} s, must be a multiple"
            raise DocumentError(words, file=self.file, path="fmu.step")
        return every

    def _start_of(self, along: Along) -> list[float]:
        """Start values at the beginning of a run, where actuators are at their orders."""
        first = {name: values[:1] for name, values in along.record.items()}
        orders = {f"{ACTUAL}{name}": values for name, values in first.items()}
        return list(self._variables("start", orders | first)[0].tolist())

    def _record_of(self, along: Along) -> Any:
        """Inputs of the FMU in each step of a record."""
        return self._variables("input", along.record).tolist()

    def _variables(self, role: str, signals: Mapping[str, Array]) -> Array:
        """Values (..., n) of the variables of a role; ShipidError where a signal is not there."""
        links = self.fmu.links[role]
        if missing := next((link.signal for link in links if link.signal not in signals), None):
            raise DocumentError(
                f"the FMU takes {missing}, which the runs do not have", file=self.file, path=f"fmu.{missing}"
            )
        values = dict(signals)
        if any(link.over_ground for link in links):
            over = (signals["u"] + 1j * signals["v"]) * np.exp(1j * signals["psi"])
            values |= {"ned u": over.real, "ned v": over.imag, "enu u": over.imag, "enu v": over.real}
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
                    over = values["u"] + 1j * values["v"] if frames == {"ned"} else values["v"] + 1j * values["u"]
                    ahead = over * np.exp(-1j * values["psi"])
                    values |= {"u": ahead.real, "v": ahead.imag}
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
        way = motion[..., 0] + 1j * motion[..., 1]
        way = (way - way[:, :1]) * np.exp(1j * turn) + (goal[:, :1] + 1j * goal[:, 1:2])
        motion[..., 0], motion[..., 1] = way.real, way.imag
    motion[..., 2] += turn
    return motion
