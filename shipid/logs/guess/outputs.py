"""Choose measured outputs of components, such as thrust and torque: by their names, which the motion does not check."""

from __future__ import annotations

import numpy as np

from shipid.logs.guess.clues import STRONG, State, unit_of_another
from shipid.logs.guess.commands import are_pulses, unique_name
from shipid.logs.guess.words import is_order, meaning_scores, name_parts, side_in_name, unit_in_name
from shipid.physics.signals import SIGNALS, is_command, is_shaft, rows_of_role, signal_of


def reserve_outputs(state: State) -> dict[str, str]:
    """Column -> output, for columns whose name says one and nothing else; they are taken, so that no other step is."""
    chosen: dict[str, str] = {}
    for signal, row in rows_of_role("output").items():
        for name in state.called(signal):
            scores, unit = meaning_scores(name), unit_in_name(name, row.unit)
            rivals = [score for meaning, score in scores.items() if meaning != signal]
            clear = unit not in (None, "%") or max(rivals, default=0.0) < scores[signal]
            clear = clear and scores[signal] >= STRONG and unit_of_another(name, signal) is None
            clear = clear and not (
                (signal == "thrust" and unit is None)
                and ("thruster" in name_parts(name) or are_pulses(state.columns[name]))  # its order
            )
            if clear and not is_order(name) and np.ptp(state.columns[name]) > 0:
                chosen.setdefault(name, signal)
    state.taken.update(chosen)
    return chosen


def suggest_outputs(state: State, chosen: dict[str, str]) -> None:
    """Suggest the reserved columns, for the component of the shaft or rudder on their side.

    In a log without a shaft a thrust is taken for the order of one, and that is asked.
    """
    used: dict[str, int] = {}
    commands = [one.name for one in state.suggestions if is_command(one.name)]
    for name, signal in chosen.items():
        row, usual = SIGNALS[signal], SIGNALS[signal].component
        shafts = SIGNALS["n"].component == usual
        alike = [one for one in commands if is_shaft(one) == shafts]
        alike = [one for one in alike if shafts or SIGNALS[signal_of(one)].component == usual]
        component = side_in_name(name) or (alike[0].partition(".")[0] if len(alike) == 1 else usual)
        unit, top = unit_in_name(name, row.unit), float(np.abs(state.columns[name]).max())
        if unit is None:
            state.ask((signal,), f"in which unit is {name!r}, up to {top:.4g}? {row.unit} is a guess")
        sure, why, extra = 0.8 if unit else 0.4, f"by its name; up to {top:.4g}", {}
        if signal == "thrust" and not any(map(is_shaft, commands)):
            words = f"is {name!r} the thrust that is ordered, or what is measured? Order is a guess"
            signal, sure, why = "force", min(sure, 0.5), f"{why}; there is no other order of this screw"
            if state.commands and "force" not in map(signal_of, state.commands):
                words += f"; the vessel takes a shaft speed: write a curve of pairs ({unit or row.unit}, rpm)"
                signal, unit, extra = "n", "rpm", {"factor": 1.0}
            state.ask((signal, "thrust"), words)
        state.suggest(unique_name(f"{component}.{signal}", used), name, unit or row.unit, sure, why, **extra)
