"""What a predictor holds: physics, a fitted method, and the limits and bands of its predictions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from shipid.data.windows import Commands
from shipid.hybrid.bands import Bands
from shipid.hybrid.features import NO_MEMORY, Inputs
from shipid.hybrid.method import Corrector
from shipid.hybrid.novelty import NoveltyAlarm
from shipid.hybrid.physics import Physics
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
