"""Tasks made by hand: columns and what the physics misses, without a vessel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shipid.data.windows import Instants, Windows
from shipid.hybrid.compensator import Compensator
from shipid.hybrid.method import Case, FitResult, Method, Task
from shipid.hybrid.physics import Physics

Array = np.ndarray


def azimuth_columns() -> dict[str, Array]:
    """Columns (50,) of a ship in wind whose two azimuths act as one."""
    rng = np.random.default_rng(0)
    columns = {name: rng.normal(size=50) for name in ("north", "east", "psi", "u", "v", "r", "V_w", "beta_w")}
    columns["port.n"], columns["port.alpha"] = rng.uniform(1, 3, 50), rng.uniform(-1, 1, 50)
    return columns | {"starboard.n": columns["port.n"].copy(), "starboard.alpha": columns["port.alpha"].copy()}


def task_of(
    columns: Mapping[str, Array],
    commands: Sequence[str],
    targets: Mapping[str, Array],
    folds: Sequence[tuple[Array, Array]],
    seed: int,
    **options: Any,
) -> Task:
    """A task whose physics misses just the targets (T, S, 2) [m]: true paths of zero."""
    first = next(iter(targets.values()))
    count = len(columns["u"])
    windows = Windows(
        run=np.full(count, "a"),
        t=np.arange(float(count)),
        columns=dict(columns),
        future=np.zeros_like(first),
        planned={},
        horizon=len(first),
        step=1.0,
    )
    cases = {name: Case(Physics(None, len(first), 1.0), -paths) for name, paths in targets.items()}
    return Task(cases, windows, folds, tuple(commands), seed=seed, **options)


def tune(
    columns: Mapping[str, Array],
    commands: Sequence[str],
    targets: Mapping[str, Array],
    folds: Sequence[tuple[Array, Array]],
    method: Method,
    seed: int,
    **options: Any,
) -> dict[str, FitResult]:
    """Fit a method to such a task."""
    return method.fit(task_of(columns, commands, targets, folds, seed, **options))


def compensation(corrector: Compensator, columns: Mapping[str, Array]) -> Array:
    """Compensation (T, S, 2) [m] for columns at instants."""
    return corrector.compensation(corrector.inputs.table(Physics(None, 1, 1.0), Instants(columns)))
