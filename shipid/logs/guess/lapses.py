"""Commands that lapse for a moment, or stand still while the ship turns, with what mends them."""

from __future__ import annotations

from typing import Any

import numpy as np

from shipid.data.dataset import Array
from shipid.data.lapses import CommandFault, find_command_faults
from shipid.logs.guess.clues import State
from shipid.logs.guess.defects import FEW, clock_text
from shipid.logs.guess.evidence import GAP
from shipid.logs.guess.sniff import LogTable
from shipid.logs.mapping import to_si
from shipid.physics.signals import is_command

SURE, UNSURE = 0.9, 0.6  # that it is no order: of what is unsure the repair is drafted switched off
FAULTS = {
    "zero": ("lapses of a command", SURE, "is 0 {}: faster than it moves elsewhere."),
    "spike": ("lapses of a command", SURE, "leaves its course {} and comes back: faster than it moves elsewhere."),
    "pause": ("lapses of a command", UNSURE, "is 0 {} with the same order before and after. Was that ordered?"),
    "still": (
        "frozen sensor",
        UNSURE,
        "repeats one value {} while the ship turns to both sides, and is noisy in other turns. Was it ordered so?",
    ),
}
"""Kind of a fault -> the kind of its finding, how sure it is, and what is seen."""


def report_command_faults(state: State, sniffed: LogTable) -> None:
    """Report zeros, spikes and still stretches of commands, as they are in the log; the repair breaks the run there."""
    for one in state.suggestions:
        if not is_command(one.name):
            continue
        raw = sniffed.columns[one.source]
        known = np.isfinite(raw)
        values = raw[known] * to_si(one.unit, one.name) * one.extra.get("factor", 1.0)
        values = np.unwrap(values) if one.extra.get("wrap") else values
        t = state.t[known]
        if len(t) < 2:
            continue
        follows = np.diff(t) <= GAP * np.median(np.diff(t))
        found = find_command_faults(one.name, t, values, state.psi[known], follows)
        for kind, (title, sure, words) in FAULTS.items():
            some = [fault for fault in found if fault.kind == kind]
            if not some:
                continue
            sentence = f"{one.source!r} {words.format(_fault_places(state, some, t))}"
            if state.joined or sure == UNSURE:
                remedy = "leave these cells empty, and draft again" if state.joined else "switch the repair on"
                state.ask((one.name,), f"{sentence} Unless it was ordered, {remedy}")
            state.find(title, (one.source,), sure, sentence, None if state.joined else _break_repair(state, some, t))


def _fault_places(state: State, some: list[CommandFault], t: Array) -> str:
    count = sum(fault.end - fault.first for fault in some)
    words = f"in {count} row{'s' * (count > 1)} at {len(some)} place{'s' * (len(some) > 1)}"
    if state.joined:
        return f"{words} of the files"
    times = ", ".join(clock_text(state, float(t[fault.first])) for fault in some[:FEW])
    return f"{words}, {'the first ' * (len(some) > FEW)}near {times},"


def _break_repair(state: State, found: list[CommandFault], t: Array) -> dict[str, Any]:
    unit, last = to_si(state.clock_unit, "t"), len(t) - 1
    intervals = [[t[max(one.first - 1, 0)] / unit, t[min(one.end, last)] / unit] for one in found]
    return {"kind": "break", "intervals": intervals}
