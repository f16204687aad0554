"""Columns of a simulated log: names of runs and columns, and velocities in the horizontal plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shipid.engine.rollout import Trajectories


def log_columns(path: Trajectories, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Log columns of the first variant, column -> (R, S); u, v [m/s] and r [rad/s] in the horizontal plane."""
    columns = {state_column(name): path[name][:, 0] for name in names}
    return columns | horizontal_velocities(columns)


def state_column(state: str) -> str:
    """Name of the log column of a state."""
    return "z" if state == "down" else state


LEANING = ("phi", "theta", "w", "q")
"""States by which velocities along the ship's axes differ from those of a log, which are horizontal."""


def horizontal_velocities(columns: Mapping[str, Any], maths: Any = np) -> dict[str, Any]:
    """Horizontal velocities u, v [m/s] along and across the heading, and r = d(psi)/dt [rad/s], from body-fixed ones.

    Fossen 2021, eqs. 2.31 and 2.40. maths : module with cos and sin for the columns: numpy, or casadi for symbols.
    """
    zero = 0.0 * columns["u"]
    phi, theta, w, q = (columns.get(name, zero) for name in LEANING)
    u, v, r = columns["u"], columns["v"], columns["r"]
    across = v * maths.cos(phi) - w * maths.sin(phi)
    down = v * maths.sin(phi) + w * maths.cos(phi)
    turning = (q * maths.sin(phi) + r * maths.cos(phi)) / maths.cos(theta)
    return {"u": u * maths.cos(theta) + down * maths.sin(theta), "v": across, "r": turning}


def body_velocities(columns: Mapping[str, Any], maths: Any = np) -> dict[str, Any]:
    """Body-fixed u, v [m/s], r [rad/s] of a log: inverse of `horizontal_velocities`; w, q are body-fixed."""
    if not any(name in columns for name in LEANING):
        return {name: columns[name] for name in ("u", "v", "r")}
    zero = 0.0 * columns["u"]
    phi, theta, w, q = (columns.get(name, zero) for name in LEANING)
    v = (columns["v"] + w * maths.sin(phi)) / maths.cos(phi)
    u = (columns["u"] - (v * maths.sin(phi) + w * maths.cos(phi)) * maths.sin(theta)) / maths.cos(theta)
    r = (columns["r"] * maths.cos(theta) - q * maths.sin(phi)) / maths.cos(phi)
    return {"u": u, "v": v, "r": r}


def number_runs(count: int) -> list[str]:
    """Names `M001`, `M002`, ... of `count` runs, with enough digits to sort by name."""
    return [f"M{number + 1:0{max(3, len(str(count)))}d}" for number in range(count)]
