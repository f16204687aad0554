"""Sensors that are stuck: stretches in which one repeats a value, and the others say that it cannot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Array, cumulative_integral

RowMask = NDArray[np.bool_]
Plane = NDArray[np.complex128]

STUCK_SECONDS, STUCK_REPEATS = 4.5, 4.0  # s; times the usual repetition, at least
MISSED_TURN, MISSED_WAY = np.radians(6.0), 0.02  # rad; share of the way: IMO MSC.96(72) allows a log 2 %
MISSED_STEPS = 2.0  # large steps of a position


def stuck_spans(
    name: str, t: Array, values: Array, pose: tuple[Array, Plane], rates: tuple[Array, Plane], follows: RowMask
) -> list[tuple[int, int]]:
    """First and last row of each stretch in which a sensor repeats one value and the others say that it cannot.

    name : psi, r, course or speed, of which values (N,) are readings at t [s]. pose : psi [rad] without jumps, and
    position, north + i east [m]. rates : r [rad/s], and velocity over ground [m/s]. follows : (N - 1,)
    whether nothing is missing between a row and the next.
    """
    edges = np.flatnonzero(np.concatenate([[True], (np.diff(values) != 0) | ~follows, [True]]))
    lengths = np.diff(edges)
    long = lengths >= STUCK_REPEATS * np.median(np.repeat(lengths, lengths))
    first, last = edges[:-1][long], edges[1:][long] - 1
    turned = cumulative_integral(t, rates[0])
    missed, least = {"psi": turned, "r": pose[0] - turned}.get(name, pose[0]), np.array(MISSED_TURN)
    if name == "speed":
        speed, steps = np.abs(rates[1]), np.diff(pose[1])
        ahead = steps * np.exp(-1j * np.angle(rates[1][1:]))  # noise of a position makes no way
        missed = np.append(0.0, np.cumsum(ahead.real)) - cumulative_integral(t, speed)
        digit = np.median(np.abs(np.diff(speed))[np.diff(values) != 0]) if len(lengths) > 1 else 0.0
        least = (MISSED_WAY * speed[first] + digit) * (t[last] - t[first])
        least += MISSED_STEPS * np.percentile(np.abs(steps), 95)
    off = np.array([np.ptp(missed[a : b + 1]) for a, b in zip(first, last, strict=True)])
    stuck = (t[last] - t[first] >= STUCK_SECONDS) & (off > least)
    return list(zip(first[stuck].tolist(), last[stuck].tolist(), strict=True))
