"""Commands that lapse for a moment, or stand still while the ship turns, with what mends them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import BREAK, Array
from shipid.data.lapses import CommandFault, RowMask, find_command_faults
from shipid.logs.guess.clues import State, Suggestion
from shipid.logs.guess.defects import FEW, clock_text
from shipid.logs.guess.evidence import GAP
from shipid.logs.guess.sniff import LogTable
from shipid.logs.mapping import to_si
from shipid.logs.repairs import FLAGS, Despike, remove_spikes
from shipid.physics.signals import is_command, is_shaft, is_steering, read_unit

SHARES = (0.5, 0.75, 0.9)  # of the size of the smallest lapse, that may part lapses from all other rows

SAME = 0.05  # of that size: a row that is changed by less stays as it is
SURE, UNSURE = 0.9, 0.6  # that it is no order: of what is unsure the repair is drafted switched off


def report_command_faults(state: State, sniffed: LogTable) -> None:
    """Report zeros, spikes and still stretches of commands, as they are in the log."""
    for one in state.suggestions:
        if not is_command(one.name):
            continue
        raw = sniffed.columns[one.source]
        known = np.isfinite(raw)
        values = raw[known] * to_si(one.unit, one.name) * one.extra.get("factor", 1.0)
        values = np.unwrap(values) if one.extra.get("wrap") else values
        t, psi = state.t[known], state.psi[known]
        if len(t) < 2:
            continue
        follows = np.diff(t) <= GAP * np.median(np.diff(t))
        found = find_command_faults(one.name, t, values, psi, follows)
        brief = [lapse for lapse in found if lapse.kind in ("zero", "spike")]
        repair, mended = _despike_repair(one.name, brief, t, values, follows) if brief else (None, [])
        if mended:
            _report_brief(state, one, mended, t, repair)
        left = [lapse for lapse in brief if lapse not in mended]
        if left:
            _report_brief(state, one, left, t, None)
        if pauses := [lapse for lapse in found if lapse.kind == "pause"]:
            _report_pauses(state, one, pauses, t)
        if still := [lapse for lapse in found if lapse.kind == "still"]:
            _report_still(state, one, still, t, psi)


def _report_brief(
    state: State, one: Suggestion, found: list[CommandFault], t: Array, repair: dict[str, Any] | None
) -> None:
    unit, factor = read_unit(one.name)
    said = []
    for kind in ("zero", "spike"):
        some = [lapse for lapse in found if lapse.kind == kind]
        if some:
            far = f"{min(lapse.size for lapse in some) * factor:.3g} {unit}{' or more' * (len(some) > 1)}"
            how = "is 0" if kind == "zero" else f"leaves its course by {far} and comes back"
            beside = f" between values of {far}" * (kind == "zero")
            said.append(f"{how} {_fault_places(state, some, t)}{beside}")
    what = "shaft" if is_shaft(one.name) else "rudder" if is_steering(one.name) else "gear"
    sentence = f"{one.source!r} {', and '.join(said).rstrip(',')}: faster than the {what} moves elsewhere"
    if repair is None and state.joined:
        state.ask((one.name,), f"{sentence}. Leave these cells empty, and draft again")
    elif repair is None:
        repair = _break_repair(state, found, t)
    state.find("lapses of a command", (one.source,), SURE, sentence, repair)


def _report_pauses(state: State, one: Suggestion, found: list[CommandFault], t: Array) -> None:
    sentence = f"{one.source!r} is 0 {_fault_places(state, found, t)} with the same order before and after"
    _report_unsure(state, one, "lapses of a command", found, t, f"{sentence}. Was that ordered?")


def _report_unsure(
    state: State, one: Suggestion, kind: str, found: list[CommandFault], t: Array, sentence: str
) -> None:
    """Ask of what may be as it is in the log; the repair is there, switched off."""
    remedy = "leave these cells empty, and draft again" if state.joined else "switch the repair on"
    state.ask((one.name,), f"{sentence} If not, {remedy}")
    state.find(kind, (one.source,), UNSURE, sentence, None if state.joined else _break_repair(state, found, t))


def _fault_places(state: State, some: list[CommandFault], t: Array) -> str:
    count = sum(lapse.end - lapse.first for lapse in some)
    words = f"in {count} row{'s' * (count > 1)} at {len(some)} place{'s' * (len(some) > 1)}"
    if state.joined:
        return f"{words} of the files"
    times = ", ".join(clock_text(state, float(t[lapse.first])) for lapse in some[:FEW])
    return f"{words}, {'the first ' * (len(some) > FEW)}near {times},"


def _report_still(state: State, one: Suggestion, found: list[CommandFault], t: Array, psi: Array) -> None:
    words = []
    for lapse in found[:FEW]:
        span = slice(lapse.first, lapse.end)
        times = f"{clock_text(state, float(t[lapse.first]))} to {clock_text(state, float(t[lapse.end - 1]))}"
        words.append(f"{times} ({np.degrees(np.ptp(psi[span])):.0f} deg)")
    where = f"at {len(found)} places of the files" if state.joined else f"from {', '.join(words)}"
    sentence = (
        f"{one.source!r} repeats one value while the ship turns to both sides, {where}, and is noisy in other turns"
    )
    _report_unsure(state, one, "frozen sensor", found, t, f"{sentence}. Was it held so?")


def _break_repair(state: State, found: list[CommandFault], t: Array) -> dict[str, Any]:
    unit, last = to_si(state.clock_unit, "t"), len(t) - 1
    intervals = [[t[max(one.first - 1, 0)] / unit, t[min(one.end, last)] / unit] for one in found]
    return {"kind": "break", "intervals": intervals}


def _despike_repair(
    name: str, found: list[CommandFault], t: Array, values: Array, follows: RowMask
) -> tuple[dict[str, Any] | None, list[CommandFault]]:
    """The repair that mends most lapses and changes no other row, and those that it mends; none where there is none."""
    unit, factor = read_unit(name)
    others = np.ones(len(t), dtype=bool)
    for one in found:
        others[one.first : one.end] = False
    broken = np.where(np.append(False, ~follows), 1 << FLAGS.index(BREAK), 0)
    rows = pd.DataFrame({"t": t, name: values, "flags": broken})
    width = max(5, 2 * max(one.end - one.first for one in found) + 3)
    window = round(max(width * float(np.median(np.diff(t))), 1e-3), 3)
    least = min(one.size for one in found)
    for share in SHARES:
        threshold = float(f"{share * least * factor:.2g}")
        repair = {"kind": "despike", "columns": [name], "window": window, "threshold": threshold, "unit": unit}
        size = threshold / factor
        trial = Despike(kind="despike", reason="of a draft", columns=(name,), window=window, threshold=size)
        outcome = remove_spikes(rows, trial)
        mended = [one for one in found if outcome.touched[one.first : one.end].all()]
        changed = np.abs(outcome.rows[name].to_numpy() - values)[others].max(initial=0.0)
        if changed < SAME * least and 2 * len(mended) > len(found):
            return repair, mended
    return None, []
