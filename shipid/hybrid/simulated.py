"""Physics of somebody else, which has no equations here: a simulator gives its paths. Members: `shipid.foundations`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from shipid.data.dataset import Dataset
from shipid.data.windows import Instants, Windows
from shipid.engine.engines import AUTO
from shipid.engine.rollout import SPEED_LIMIT
from shipid.errors import DocumentError, ShipidError, suggest_name
from shipid.hybrid.physics import MOTION, Needs, Physics, check_instants, hold_velocity, positions_in_frame
from shipid.metrics import vector_lengths
from shipid.vessel.load import Vessel, check_document

Array = np.ndarray


class Simulator(ABC):
    """What a `SimulatedPhysics` asks for paths.

    key : its name in a document. file : of its code or paths; may be empty. digest : of all that its paths depend on.
    parameters : numbers that families change.
    gives : what a method may ask of it, see `Needs`. kind : key of a family that names it.
    """

    key: str
    file: str
    digest: str
    parameters: Mapping[str, float]
    gives: tuple[Needs, ...]
    kind: ClassVar[str] = ""

    @abstractmethod
    def states(self, instants: Instants, horizon: int, step: float) -> Mapping[str, Array]:
        """Return north, east [m] and, where it knows them, psi [rad], u, v, r after 1..T steps, name -> (T, S)."""

    def with_runs(self, dataset: Dataset) -> Simulator:
        """Return the simulator with the runs of a study, which it may have to go along from their beginnings."""
        del dataset
        return self

    def check(self, training: Windows, test: Windows, before: Collection[int], remedy: str) -> Sequence[str]:
        """Refuse a simulator that does not fit the windows of a study; what to note of it, in sentences.

        before : numbers of steps before each window at which it is asked, too. remedy : what to write where it only
            seems to be wrong; empty where it is taken so.
        """
        del training, test, before, remedy  # a function can be asked anywhere
        return ()

    @abstractmethod
    def header(self) -> dict[str, Any]:
        """Return what a folder of results keeps of it, as plain data: `kind`, `key` and more."""

    def with_values(self, values: Mapping[str, float]) -> Simulator:
        """Return the simulator with other parameters; DocumentError for one that it does not have."""
        for name in values:
            raise DocumentError(f"{self.key} has no parameter {name!r}: {suggest_name(name, self.parameters)}")
        return self


class NamedSimulator(Simulator):
    """A simulator that a document names: one member of `shipid.foundations.SIMULATORS`."""

    @classmethod
    @abstractmethod
    def read(cls, value: Any, folder: Path, trust: bool) -> Sequence[Self]:
        """Return what the value of the key of a family names, from the folder of the document; DocumentError.

        trust : whether code of the document may run.
        """

    @classmethod
    @abstractmethod
    def from_header(cls, header: Mapping[str, Any], folder: Path, trust: bool) -> Self:
        """Return what `header` gave, and a folder of results kept; no code of the document runs."""


@dataclass(frozen=True)
class SimulatedPhysics(Physics):
    """The physics of a simulator; it has no vessel, and no equations."""

    simulator: Simulator = field(kw_only=True)

    absent: ClassVar[bool] = False

    @property
    def gives(self) -> tuple[Needs, ...]:
        """What a method may ask of it."""
        return self.simulator.gives

    @property
    def absence(self) -> Physics:
        """No physics, of the same steps."""
        return Physics(None, self.horizon, self.step, self.integrator, path=self.path)

    @property
    def ship(self) -> Vessel:
        """There is none: ShipidError."""
        raise ShipidError(f"{self.simulator.key} has no equations that could be changed or differentiated: {REMEDY}")

    def variant_paths(
        self,
        instants: Instants,
        parameters: Array | None = None,  # noqa: ARG002
        device: str = "cpu",  # noqa: ARG002
    ) -> tuple[Array, Array]:
        """Paths (T, 1, S, 2) [m] in the frame (11), and which diverged (1, S): no number, or faster than any ship."""
        states = self.states(instants)
        paths = np.stack([states["x"], states["y"]], axis=-1)
        begun = self.step * np.stack(
            [instants.columns.get(name, np.zeros(len(instants))) for name in ("u", "v")], axis=-1
        )
        with np.errstate(all="ignore"):
            steps = np.diff(np.concatenate([np.zeros_like(paths[:1]), paths]), axis=0)
            bad = np.logical_not((vector_lengths(steps) <= SPEED_LIMIT * self.step).all(axis=0))
        paths[:, bad] = hold_velocity(paths[:, bad], begun[bad], SPEED_LIMIT * self.step)
        return paths[:, None], bad[None]

    def states(self, instants: Instants, *, engine: str = AUTO) -> dict[str, Array]:  # noqa: ARG002
        """Return x, y [m] in the frame (11) and what it knows of u, v, r, psi after 1..T steps, name -> (T, S)."""
        check_instants(instants)
        states = self.simulator.states(instants, self.horizon, self.step)
        x, y = positions_in_frame(instants, states["north"], states["east"])
        return {"x": x, "y": y, **{name: states[name] for name in MOTION if name in states}}


REMEDY = "take a method that works on the path, such as kernel"


@dataclass(frozen=True)
class SimulatorRecord(Simulator):
    """What a saved predictor knows of its simulator: neither its code nor its paths."""

    key: str
    known: Mapping[str, Any]
    file: str = ""
    digest: str = ""
    gives: tuple[Needs, ...] = ("path",)
    parameters: Mapping[str, float] = field(default_factory=dict)

    def states(self, instants: Instants, horizon: int, step: float) -> Mapping[str, Array]:  # noqa: ARG002
        """It has none: ShipidError."""
        words = f"the physics is {self.key}, which is not in the file of a predictor"
        raise ShipidError(f"{words}: in Python give its `paths` to `predict`, (T, S, 2) [m] in the frame (11)")

    def header(self) -> dict[str, Any]:
        """Return what is known of it."""
        return dict(self.known)


def physics_entry(physics: Physics) -> dict[str, Any] | None:
    """What a file keeps of the physics: a vessel, a simulator, or None for no physics."""
    if isinstance(physics, SimulatedPhysics):
        return {"simulator": physics.simulator.header()}
    return None if physics.vessel is None else {"document": physics.vessel.document, "file": physics.vessel.file}


def physics_of_entry(entry: Mapping[str, Any] | None, **rule: Any) -> Physics:
    """The physics of `physics_entry`; rule : horizon, step and more of `Physics`."""
    if entry is not None and "simulator" in entry:
        known = entry["simulator"]
        return SimulatedPhysics(None, **rule, simulator=SimulatorRecord(known["key"], known))
    return Physics(None if entry is None else check_document(entry["document"], entry["file"]), **rule)
