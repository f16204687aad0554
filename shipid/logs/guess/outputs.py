"""Choose measured outputs of components, such as thrust and torque: by their names, which the motion does not check."""

from __future__ import annotations

import numpy as np

from shipid.logs.guess.clues import STRONG, State, unit_in_name, unit_of_another
from shipid.logs.guess.commands import unique_name
from shipid.logs.guess.words import is_order, meaning_scores, side_in_name
from shipid.physics.signals import SIGNALS, is_shaft, rows_of_role, signal_of, signal_row


def reserve_outputs(state: State) -> dict[str, str]:
    """Column -> output, for columns whose name says one and nothing else; they are taken, so that no other step is."""
    chosen: dict[str, str] = {}
    for signal, row in rows_of_role("output").items():
        for name in state.called(signal):
            scores, unit = meaning_scores(name), unit_in_name(name, row.unit)
            rivals = [score for meaning, score in scores.items() if meaning != signal]
            clear = unit not in (None, "%") or max(rivals, default=0.0) < scores[signal]
            clear = clear and scores[signal] >= STRONG and unit_of_another(name, signal) is None
            if clear and not is_order(name) and np.ptp(state.columns[name]) > 0 and name not in chosen:
                chosen[name] = signal
    state.taken.update(chosen)
    return chosen


def suggest_outputs(state: State, chosen: dict[str, str]) -> None:
    """Suggest the reserved columns, for the component of the shaft or rudder on their side."""
    used: dict[str, int] = {}
    for name, signal in chosen.items():
        row = SIGNALS[signal]
        component = side_in_name(name) or _output_component(state, signal)
        unit = unit_in_name(name, row.unit)
        if unit is None:
            largest = float(np.abs(state.columns[name]).max())
            state.ask((signal,), f"in which unit is {name!r}, up to {largest:.4g}? {row.unit} is a guess")
        why = f"by its name; up to {float(np.abs(state.columns[name]).max()):.4g}"
        state.suggest(unique_name(f"{component}.{signal}", used), name, unit or row.unit, 0.8 if unit else 0.4, why)


def _output_component(state: State, signal: str) -> str:
    usual = SIGNALS[signal].component
    commands = [
        one.name for one in state.suggestions if (row := signal_row(one.name)) is not None and row.role == "command"
    ]
    alike = [name for name in commands if is_shaft(name) == (SIGNALS["n"].component == usual)]
    alike = [name for name in alike if is_shaft(name) or SIGNALS[signal_of(name)].component == usual]
    return alike[0].partition(".")[0] if len(alike) == 1 else usual
