"""Sensors that stand still for a while: a value that is repeated although the rest of the log says that it changed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from shipid.data.dataset import Array
from shipid.logs.guess.clues import State
from shipid.logs.guess.defects import report_breaks
from shipid.logs.guess.evidence import GAP, integrate_rate

LEAST_ROWS, LEAST, LONG = 5, 4.5, 4.0  # rows; s; times as long as nearly all other repetitions
TURNED = np.radians(6.0)  # by which the ship turns meanwhile


def find_stuck(state: State) -> None:
    """Report a heading, yaw rate or course that stands still while the ship turns, with a break as the repair."""
    t, still = state.t, np.zeros(len(state.t))
    ran = still if state.r is None else integrate_rate(t, state.r).real
    for one in state.suggestions:
        if one.name not in ("psi", "r", "course"):
            continue
        others = ran if one.name == "psi" else state.psi
        steady = state.r if one.name == "r" and state.r is not None else still
        places = []
        for first, last in _held_stretches(t, state.columns[one.source]):
            turn = float(others[last] - others[first] - steady[first] * (t[last] - t[first]))
            if abs(turn) > TURNED:  # a jump that follows may be taken for one across 360
                places.append((float(t[first]), float(t[min(last + 2, len(t) - 1)]), np.degrees(turn)))
        if places:
            words = f"{one.source!r} repeats one value while the ship turns"
            report_breaks(state, "frozen sensor", (one.source,), words, places, "deg")


def _held_stretches(t: Array, values: Array) -> Iterator[tuple[int, int]]:
    """Yield first and last row of every stretch of one value that is longer than nearly all others."""
    usual = float(np.median(np.diff(t)))
    edges = np.flatnonzero(np.concatenate([[True], (np.diff(values) != 0) | (np.diff(t) > GAP * usual), [True]]))
    lengths = np.diff(edges)
    typical = float(np.percentile(np.repeat(lengths, lengths), 90)) if len(lengths) else 1.0
    for first, count in zip(edges[:-1], lengths, strict=True):
        last = int(first + count - 1)
        if count >= max(LEAST_ROWS, LONG * typical) and t[last] - t[first] >= LEAST:
            yield int(first), last
