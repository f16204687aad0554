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
TWINS = ("port.n", "port.alpha", "starboard.n", "starboard.alpha")
RUDDER = ("engine.n", "rudder.delta")
STEPS, LENGTHS = 9, (18, 25, 18, 30, 11, 18)  # windows of the runs
ALL = np.arange(sum(LENGTHS))
ENDS = np.cumsum(LENGTHS)
RUNS = [np.arange(end - length, end) for length, end in zip(LENGTHS, ENDS, strict=True)]
FOLDS = [(np.setdiff1d(ALL, run), run) for run in RUNS]


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


def drawn_columns(commands: Sequence[str] = TWINS, seed: int = 0, count: int = len(ALL)) -> dict[str, Array]:
    """Columns that are mirrored nowhere, all different."""
    rng = np.random.default_rng(seed)
    columns = {name: rng.normal(0.5, 1.0, count) for name in ("psi", "u", "v", "r", "beta_w", *commands)}
    return columns | {"V_w": rng.uniform(1.0, 9.0, count)}


def mirrored_columns(columns: Mapping[str, Array]) -> dict[str, Array]:
    """The ship and the wind as a mirror shows them."""
    sides, images = {"port": "starboard", "starboard": "port"}, {}
    for name, values in columns.items():
        component, _, signal = name.rpartition(".")
        odd = signal in ("psi", "v", "r", "beta_w", "alpha", "delta")
        images[f"{sides.get(component, component)}.{signal}" if component else name] = -values if odd else values
    return images


def missed_paths(columns: Mapping[str, Array]) -> Array:
    """What the physics misses (T, S, 2) [m]: smooth in time, a function of motion and orders."""
    t = np.arange(1.0, STEPS + 1)[:, None] / STEPS
    x = t * columns["u"] + 2.0 * t**2 * np.tanh(columns["port.n"])
    y = t * columns["v"] - 1.5 * t**2 * columns["r"]
    return np.stack([x, y], axis=-1)
