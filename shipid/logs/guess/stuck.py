"""Sensors that stand still for a while: a value that is repeated although the rest of the log says that it changed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from shipid.data.dataset import Array
from shipid.logs.guess.clues import State
from shipid.logs.guess.defects import FEW, clock_text
from shipid.logs.guess.evidence import GAP, integrate_rate
from shipid.logs.mapping import to_si

LEAST_ROWS, LEAST, LONG = 5, 4.5, 4.0  # rows; s; times as long as nearly all other repetitions
TURNED = np.radians(6.0)  # by which the ship turns meanwhile


def find_stuck(state: State) -> None:
    """Report a heading, yaw rate or course that stands still while the ship turns, with a break as the repair."""
    for one in state.suggestions:
        if one.name not in ("psi", "r", "course"):
            continue
        places = list(_stuck_stretches(state, one.name, state.columns[one.source]))
        if not places:
            continue
        unit = to_si(state.clock_unit, "t")
        words = [
            f"{clock_text(state, a)} to {clock_text(state, b)} ({np.degrees(turn):.0f} deg)"
            for a, b, turn in places[:FEW]
        ]
        where = f"at {len(places)} places of the files" if state.joined else f"from {', '.join(words)}"
        sentence = f"{one.source!r} repeats one value while the ship turns, {where}"
        intervals = [[start / unit, end / unit] for start, end, _ in places]
        repair = None if state.joined else {"kind": "break", "intervals": intervals}
        state.find("frozen sensor", (one.source,), 0.9, sentence, repair)


def _stuck_stretches(state: State, name: str, values: Array) -> Iterator[tuple[float, float, float]]:
    """Yield start and end [s] of every stretch of one value in which the ship turned, and by how much [rad]."""
    t = state.t
    usual = float(np.median(np.diff(t)))
    edges = np.flatnonzero(np.concatenate([[True], (np.diff(values) != 0) | (np.diff(t) > GAP * usual), [True]]))
    lengths = np.diff(edges)
    rows = np.repeat(lengths, lengths)
    typical = float(np.percentile(rows, 90)) if len(rows) else 1.0
    for first, count in zip(edges[:-1], lengths, strict=True):
        last = first + count - 1
        if count < max(LEAST_ROWS, LONG * typical) or t[last] - t[first] < LEAST:
            continue
        turn = _turn_by_others(state, name, int(first), int(last))
        if abs(turn) > TURNED:
            end = min(last + 2, len(t) - 1)  # a jump that follows may be taken for one across 360
            yield float(t[first]), float(t[end]), turn


def _turn_by_others(state: State, name: str, first: int, last: int) -> float:
    """By how much [rad] the rest of the log says that the ship turned, beyond what the column itself says."""
    if name == "psi":
        if state.r is None:
            return 0.0
        span = slice(first, last + 1)
        return float(np.real(integrate_rate(state.t[span], state.r[span])[-1]))
    turned = float(state.psi[last] - state.psi[first])
    if name == "course" or state.r is None:
        return turned
    return turned - float(state.r[first]) * float(state.t[last] - state.t[first])
