"""Commands that lapse for a moment, or stand still while the ship turns, with what mends them."""

from __future__ import annotations

import numpy as np

from shipid.data.lapses import find_command_faults
from shipid.logs.guess.clues import State
from shipid.logs.guess.defects import break_repair, places_in_words
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
            spans = np.array([[fault.first, fault.end] for fault in some])
            sentence = f"{one.source!r} {words.format(places_in_words(state, t, spans))}"
            if state.joined or sure == UNSURE:
                remedy = "leave these cells empty, and draft again" if state.joined else "switch the repair on"
                state.ask((one.name,), f"{sentence} Unless it was ordered, {remedy}")
            repair = break_repair(state, [(t[max(a - 1, 0)], t[min(b, len(t) - 1)]) for a, b in spans])
            state.find(title, (one.source,), sure, sentence, repair)
