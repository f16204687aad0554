"""What a simulated ship logs: names of runs and columns, and velocities of the horizontal plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shipid.engine.rollout import Trajectories

ON_BOARD = ("V_w", "beta_w")
"""What of the environment a ship logs: neither current nor waves."""


def logged(path: Trajectories, names: Sequence[str]) -> dict[str, np.ndarray]:
    """States of the first variant as a log has them, column -> (R, S): u, v and r are those of the horizontal plane."""
    columns = {column_of(name): path[name][:, 0] for name in names}
    return columns | horizontal(columns)


def column_of(state: str) -> str:
    """Name of a state in a log."""
    return "z" if state == "down" else state


def horizontal(columns: Mapping[str, Any], maths: Any = np) -> dict[str, Any]:
    """Horizontal u and v along and across the heading, r = d(psi)/dt (Fossen 2021, eqs. 2.31 and 2.40).

    maths : what has cos and sin for the columns; casadi for symbols.
    """
    zero = 0.0 * columns["u"]
    phi, theta, w, q = (columns.get(name, zero) for name in ("phi", "theta", "w", "q"))
    u, v, r = columns["u"], columns["v"], columns["r"]
    across = v * maths.cos(phi) - w * maths.sin(phi)
    down = v * maths.sin(phi) + w * maths.cos(phi)
    turning = (q * maths.sin(phi) + r * maths.cos(phi)) / maths.cos(theta)
    return {"u": u * maths.cos(theta) + down * maths.sin(theta), "v": across, "r": turning}


def aboard(columns: Mapping[str, Any], maths: Any = np) -> dict[str, Any]:
    """Body-fixed u, v and r of a log's columns: the reverse of `horizontal`, whose w and q are body-fixed already."""
    zero = 0.0 * columns["u"]
    phi, theta, w, q = (columns.get(name, zero) for name in ("phi", "theta", "w", "q"))
    v = (columns["v"] + w * maths.sin(phi)) / maths.cos(phi)
    u = (columns["u"] - (v * maths.sin(phi) + w * maths.cos(phi)) * maths.sin(theta)) / maths.cos(theta)
    r = (columns["r"] * maths.cos(theta) - q * maths.sin(phi)) / maths.cos(phi)
    return {"u": u, "v": v, "r": r}


def run_names(count: int) -> list[str]:
    """`M001`, `M002`, ...: as many digits as sort well."""
    return [f"M{number + 1:0{max(3, len(str(count)))}d}" for number in range(count)]
