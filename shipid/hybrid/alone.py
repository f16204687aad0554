"""Physics alone: nothing is learned, the path of the foundation is the prediction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from shipid.data.windows import Instants
from shipid.hybrid.method import Array, FitResult, Method, Task
from shipid.hybrid.physics import Physics
from shipid.hybrid.stored import StoredData


@dataclass(frozen=True)
class UnchangedPath(StoredData):
    """The corrector that leaves the path of the physics as it is."""

    hyperparameters: Mapping[str, float]
    past: float = 0.0

    def predict(self, physics: Physics, instants: Instants, paths: Array) -> Array:  # noqa: ARG002
        """Return the paths (T, S, 2) [m] of the physics."""
        return paths


class Alone(Method):
    """H = A: the prediction is the path of the physics. It has no settings and does not meet `none`."""

    compensates: ClassVar[bool] = False
    meets_none: ClassVar[bool] = False
    corrector: ClassVar[type[Any]] = UnchangedPath

    @property
    def together(self) -> bool:
        """There is nothing to compute: a unit of work for each foundation would cost more than the fit."""
        return True

    def fit(self, task: Task) -> dict[str, FitResult]:
        """Return the unchanged physics for every foundation; its errors on the windows are fair: it learned nothing."""
        return {name: FitResult(UnchangedPath({}), [], 0.0, left_out) for name, left_out in task.targets.items()}
