"""Calibrator: kernel ridge regression that sees where the physics says the ship will go, and corrects the path by it.

[dx, dy] = f(u, v, r, commands, wind, trajectory of the physics), solved as `kernel`: x, y in the frame (11), u, v
and r of the physics at a few instants of the horizon are inputs, too. After Wang et al. (2021).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from pydantic import PositiveInt

from shipid.data.windows import Instants
from shipid.hybrid.features import Inputs
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.kernel_compensator import KernelCompensator
from shipid.hybrid.method import Array
from shipid.hybrid.physics import Needs, Physics

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
        sound = (np.abs(np.concatenate([states[name] for name in TRAJECTORY_SIGNALS])) < np.inf).all(axis=0)
        for k in np.unique(np.round(np.linspace(0, physics.horizon, self.moments + 1)[1:]).astype(int)):
            label = f"physics-{k * physics.step:g}"
            inputs |= {f"{label}.{name}": np.where(sound, states[name][k - 1], 0.0) for name in TRAJECTORY_SIGNALS}
        return inputs


@dataclass(frozen=True)
class TrajectoryCompensator(KernelCompensator):
    """A compensator whose inputs hold the trajectory of the physics."""

    inputs: TrajectoryInputs


class Calibrator(Kernel):
    """`kernel` with the trajectory of the physics over the horizon among the inputs.

    All other settings are those of `kernel`.

    Parameters
    ----------
    moments : at how many instants of the horizon the trajectory is seen, evenly spread, the end among them.
    """

    needs: ClassVar[Needs] = "motion"
    meets_none: ClassVar[bool] = False
    corrector: ClassVar[type[Any]] = TrajectoryCompensator

    moments: PositiveInt = 3

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return what a descent chooses: name -> (low, high)."""
        return super().ranges() | {"physics_scale": self.scale}

    def inputs(self, commands: tuple[str, ...]) -> Inputs:
        """Return which quantities the method may take, given the names of the command columns."""
        return TrajectoryInputs(commands, self.memory, self.moments)
