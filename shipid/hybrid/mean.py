"""What a predictor holds: physics, a fitted method, limits and bands; and the mean of the paths of several such."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

from shipid.data.windows import Commands, Instants
from shipid.files import arrays_with_prefix
from shipid.hybrid.bands import Bands
from shipid.hybrid.features import NO_MEMORY, Inputs
from shipid.hybrid.method import Array, Corrector
from shipid.hybrid.methods import METHODS
from shipid.hybrid.novelty import NoveltyAlarm
from shipid.hybrid.physics import Physics
from shipid.hybrid.simulated import physics_entry, physics_of_entry
from shipid.hybrid.stack import sum_paths
from shipid.vessel.load import Vessel


@dataclass(frozen=True, eq=False)
class DeployedMethod:
    """Physics and a fitted method: what a predictor holds, and what an export writes.

    method : a name in `shipid.hybrid.methods.METHODS`.
    limits : column -> (least, greatest) seen in training.
    commands : `held` at their value at the instant, or `known` over the horizon: instants then hold `planned`.
    causal : columns of a log that were interpolated between fixes: inputs hold the last fix, see `shipid.data.causal`.
    bands : None where no runs could calibrate them.
    run_up : time [s] from the begin of an unbroken stretch of rows to the earliest instant in training, by which an
        observer has settled; 0 without one. An earlier instant is outside.
    alarm : sees every input of the method; None where no runs could calibrate it: the limits then are the alarm.
    """

    physics: Physics
    method: str
    corrector: Corrector = field(repr=False)
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict, repr=False)
    provenance: Mapping[str, Any] = field(default_factory=dict, repr=False)
    commands: Commands = "held"
    causal: tuple[str, ...] = ()
    bands: Bands | None = field(default=None, repr=False)
    run_up: float = 0.0
    alarm: NoveltyAlarm | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """A number of NumPy's becomes a plain one, as in `Physics`."""
        object.__setattr__(self, "run_up", float(self.run_up))

    @property
    def vessel(self) -> Vessel | None:
        """The vessel of the physics; None for no physics."""
        return self.physics.vessel

    @property
    def no_band(self) -> str:
        """Why it has no band, if it has none."""
        return reason_of_no_band(self.provenance)

    @property
    def physics_with_force(self) -> Physics:
        """The physics that moves in a prediction: with the force of a corrector that adds one to it."""
        add = getattr(self.corrector, "with_force", None)
        return self.physics if add is None else add(self.physics)

    @property
    def inputs(self) -> Inputs:
        """Inputs of the method at the instant and from its past, and every order."""
        known = getattr(self.corrector, "inputs", None)
        orders = tuple(name for name in self.limits if "." in name)
        return Inputs(orders, known.memory if isinstance(known, Inputs) else NO_MEMORY)

    @property
    def past(self) -> int:
        """Steps of the past that `Instants.past` must hold."""
        return math.ceil(self.corrector.past / self.physics.step - 1e-9)


def reason_of_no_band(provenance: Mapping[str, Any]) -> str:
    """Why a predictor of this provenance has no band."""
    return str(provenance.get("no_band", "it was made without"))


@dataclass(frozen=True, eq=False)
class MeanCorrector:
    """Foundations with their fitted methods, and the weights (K,) of their paths."""

    parts: tuple[DeployedMethod, ...]
    weights: Array

    @property
    def hyperparameters(self) -> Mapping[str, float]:
        """The weights, for the record."""
        return {f"weight {number}": float(weight) for number, weight in enumerate(self.weights, start=1)}

    @property
    def past(self) -> float:
        """Length of the past that a prediction needs [s]."""
        return max(part.corrector.past for part in self.parts)

    @property
    def inputs(self) -> Any:
        """Inputs of the first method, where it has some: of all, as they have the same settings."""
        return getattr(self.parts[0].corrector, "inputs", None)

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:  # noqa: ARG002
        """Return paths (T, S, 2) [m] in the frame (11); each part rolls out its physics, from its own actuators."""
        each = [
            part.corrector.predict(part.physics, at, part.physics.paths(at)) for part, at in self.at_parts(instants)
        ]
        return sum_paths(each, self.weights)

    def at_parts(self, instants: Instants) -> list[tuple[DeployedMethod, Instants]]:
        """Return each part with the instants as it takes them: the hidden states are those of its own actuators."""
        known = instants.hidden or {}
        own = [{name.removeprefix(f"{k}:"): values for name, values in known.items()} for k in range(len(self.parts))]
        return [(part, replace(instants, hidden=one or None)) for part, one in zip(self.parts, own, strict=True)]

    def header(self) -> dict[str, Any]:
        """Return all that is not an array."""
        return {"mean_of": [_part_header(part) for part in self.parts]}

    def arrays(self) -> dict[str, Array]:
        """Return all arrays by name, those of a part after its number."""
        tables = {f"{number}.": part.corrector.arrays() for number, part in enumerate(self.parts)}
        arrays = {prefix + name: values for prefix, table in tables.items() for name, values in table.items()}
        return {"weights": self.weights, **arrays}

    @classmethod
    def from_arrays(cls, header: Mapping[str, Any], arrays: Mapping[str, Array]) -> Self:
        """Rebuild what `header` and `arrays` gave."""
        parts = []
        for number, part in enumerate(header["mean_of"]):
            physics = physics_of_entry(part, **part["physics"])
            own = arrays_with_prefix(arrays, f"{number}.")
            corrector = METHODS[part["method"]].corrector.from_arrays(part["corrector"], own)
            parts.append(DeployedMethod(physics, part["method"], corrector))
        return cls(tuple(parts), arrays["weights"])


def _part_header(part: DeployedMethod) -> dict[str, Any]:
    physics = part.physics
    names = ("horizon", "step", "integrator", "path")
    return {
        **(physics_entry(physics) or {}),
        "physics": {name: getattr(physics, name) for name in names},
        "method": part.method,
        "corrector": part.corrector.header(),
    }
