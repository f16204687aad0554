"""Water jets for shipid: a signal, a term, a method and a reader of logs, each by an entry point of the package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import casadi as ca
import numpy as np
import pandas as pd
from casadi import SX

from shipid.hybrid.method import Array, FitResult, Method, Task
from shipid.hybrid.search import trial_row
from shipid.hybrid.stored import StoredData
from shipid.logs.formats import Format
from shipid.logs.readers import LogReader
from shipid.physics import Term
from shipid.physics.frames import wrench_of_force
from shipid.physics.signals import Signal

THROTTLE = Signal("command", "-", "jet throttle", names=r"throttle\w*|\w+_throttle", usual=(0.2, 0.8), component="jet")


def jet(throttle: SX, *, x: Annotated[SX, "m"], F_max: Annotated[SX, "N"]) -> SX:
    """Wrench (6) of a jet at x: X = F_max throttle |throttle|."""
    return wrench_of_force(x, SX(0), SX(0), F_max * throttle * ca.fabs(throttle), SX(1, 1))


JET = Term(jet)


@dataclass(frozen=True)
class Shift(StoredData):
    """The mean error (T, 1, 2) [m] of the physics."""

    shift: Array
    hyperparameters: Mapping[str, float]
    past: float = 0.0

    def predict(self, physics: Any, instants: Any, paths: Any) -> Any:  # noqa: ARG002
        return paths + self.shift


class MeanError(Method):
    """Takes the mean error of the physics over the training windows away."""

    corrector: ClassVar[type[Any]] = Shift

    def fit(self, task: Task) -> dict[str, FitResult]:
        shifts = {name: missed.mean(axis=1, keepdims=True) for name, missed in task.targets.items()}
        return {name: FitResult(Shift(one, {}), [trial_row(0, {}, 0.0, 0.0)], 0.0) for name, one in shifts.items()}


def straight(states: Any, orders: Any, weather: Any, step: float, *, hold: float = 1.0) -> Any:  # noqa: ARG001
    """States (S, K, 6) of a ship that goes on at `hold` times its velocity u, v, and keeps its heading."""
    ahead, psi = step * np.arange(1, next(iter(orders.values())).shape[1] + 1), states[:, 2]
    u, v = hold * states[:, 3], hold * states[:, 4]
    over_ground = np.cos(psi) * u - np.sin(psi) * v, np.sin(psi) * u + np.cos(psi) * v
    paths = np.repeat(states[:, None], len(ahead), axis=1)
    paths[..., :2] += np.stack(over_ground, axis=-1)[:, None] * ahead[:, None]
    return paths


def read_toy(file: Any, *_: Any) -> pd.DataFrame:
    lines = file.read_text().splitlines()[1:]
    return pd.DataFrame({name: values.split() for name, values in (line.split(": ") for line in lines)})


TOY = LogReader(Format, read_toy, lambda _, head: {"kind": "toy"} if head.startswith(b"TOY\n") else None)
