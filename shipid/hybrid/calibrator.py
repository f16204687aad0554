"""Calibrator: networks that see where the physics says the ship will go, and correct the path by it.

[dx, dy] = f(u, v, r, commands, wind, trajectory of the physics), solved as `path-drawn`: x, y in the frame (11), u, v
and r of the physics at a few instants of the horizon are inputs, too. After Wang et al. (2021).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from pydantic import PositiveInt

from shipid.data.windows import Instants
from shipid.hybrid.compensator import Compensator
from shipid.hybrid.features import Inputs
from shipid.hybrid.method import Array
from shipid.hybrid.path_drawn import PathDrawn
from shipid.hybrid.physics import Needs, Physics
from shipid.hybrid.search import Scale

TRAJECTORY_SIGNALS = ("x", "y", "u", "v", "r")


@dataclass(frozen=True)
class TrajectoryInputs(Inputs):
    """Inputs with the trajectory of the physics: `physics-15.x` is x after 15 s.

    moments : at how many instants of the horizon it is seen, evenly spread, the end among them.
    """

    moments: int = 3

    def of_physics(self, physics: Physics, instants: Instants) -> dict[str, Array]:
        """Return the inputs (S,) that the physics gives; a trajectory that diverged gives zeros."""
        inputs = super().of_physics(physics, instants)
        if physics.absent:
            return inputs
        states = physics.states(instants)
        with np.errstate(invalid="ignore"):
            sound = np.isfinite(np.stack([states[name] for name in TRAJECTORY_SIGNALS])).all(axis=(0, 1))
        for k in np.unique(np.round(np.linspace(0, physics.horizon, self.moments + 1)[1:]).astype(int)):
            label = f"physics-{k * physics.step:g}"
            inputs |= {f"{label}.{name}": np.where(sound, states[name][k - 1], 0.0) for name in TRAJECTORY_SIGNALS}
        return inputs


@dataclass(frozen=True)
class TrajectoryCompensator(Compensator):
    """A compensator whose inputs hold the trajectory of the physics."""

    inputs: TrajectoryInputs


class Calibrator(PathDrawn):
    """`path-drawn` with the trajectory of the physics over the horizon among the inputs.

    All other settings are those of `path-drawn`.

    Parameters
    ----------
    moments : at how many instants of the horizon the trajectory is seen, evenly spread, the end among them.
    physics_scale : how far it must move, in its standard deviations, to change a hidden unit by about one.
    """

    SEARCHED: ClassVar[tuple[str, ...]] = (*PathDrawn.SEARCHED, "physics_scale")
    needs: ClassVar[Needs] = "motion"
    meets_none: ClassVar[bool] = False
    corrector: ClassVar[type[Any]] = TrajectoryCompensator

    moments: PositiveInt = 3
    physics_scale: Scale = (2.0, 32.0)

    def inputs(self, commands: tuple[str, ...]) -> Inputs:
        """Return which quantities the networks may take, given the names of the command columns."""
        return TrajectoryInputs(commands, self.memory, self.moments)
