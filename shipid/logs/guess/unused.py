"""Why a column of a log has no place in the draft: a sentence for each, so that a person may put it in by hand."""

from __future__ import annotations

import numpy as np

from shipid.logs.guess.clock import is_clock
from shipid.logs.guess.clues import State, unit_of_another
from shipid.logs.guess.words import is_order, meaning_scores, name_parts
from shipid.logs.repairs import INPUTS
from shipid.physics.signals import SIGNALS

ALIKE = (
    {"latitude", "longitude", "north", "east", "x", "y"},
    {"u", "v", "speed", "course", "velocity_north", "velocity_east"},
)
"""Meanings of which a log needs one pair: what gives the position, what gives the velocity."""

NEARLY_AS_FAST = 0.1  # share by which two clocks of seconds may go otherwise
PARTNERS = {"speed": "course", "course": "speed"}
"""Meanings that take the place of u and v together alone."""

REMEDIES = {
    "week": "it may be the week of the clock, whose seconds begin again with each: for dates write seconds since 1970, "
    "315964800 + 604800 weeks + seconds, less 18 s by which GPS is ahead of UTC since 2017",
    "awd": "it may be the direction of the apparent wind from north: write the angle from the bow, less the heading",
    "blowing": "it may be a direction of the wind: map it to beta_w with direction = 'from' or 'towards'",
    **dict.fromkeys(
        ("telegraph", "eot"),
        "it may be an order of the shaft: map it to a command .n with factor = rpm / its largest value",
    ),
}
"""Word of a name that says no known quantity -> what the column may be, and what to do."""


def unused_reasons(state: State, numbering: tuple[str, ...] = ()) -> dict[str, str]:
    """Column of the log without a meaning -> why: no known quantity, its values, its unit, or a better candidate.

    numbering : columns that hold the numbers of the rows.
    """
    return {name: _unused_reason(state, name, name in numbering) for name in [*numbering, *state.free()]}


def _unused_reason(state: State, name: str, numbers: bool) -> str:
    if numbers:
        return "it holds the numbers of the rows"
    meanings = sorted((scores := meaning_scores(name)), key=lambda meaning: -scores[meaning])
    if not meanings:
        if is_clock(name) and np.all(np.diff(state.columns[name]) > 0):
            rate = float(np.ptp(state.columns[name]) / np.ptp(state.t))
            goes = (
                f", which goes {rate:.5g} times as fast as that of the draft"
                if abs(rate - 1.0) < NEARLY_AS_FAST
                else ""
            )
            return f"it is another clock{goes}"
        remedy = next((REMEDIES[part] for part in name_parts(name) if part in REMEDIES), None)
        if remedy is not None:
            return remedy
        return "its name says no known quantity, and no other column is like it"
    meaning = meanings[0]
    if not meaning or meaning not in {*SIGNALS, *INPUTS, "x", "y", "velocity_north", "velocity_east"}:
        return "it is a quantity that a dataset does not take"
    if (unit := unit_of_another(name, meaning)) is not None:
        return f"its unit {unit} does not fit {_meaning_in_words(meaning)}"
    group = next((alike for alike in ALIKE if meaning in alike), {meaning})
    better = [one.source for one in state.suggestions if one.name.rsplit(".", 1)[-1] in group]
    if better:
        what = "an order, and the measured " if is_order(name) else ""
        return f"{what}{_meaning_in_words(meaning)} is read from {' and '.join(map(repr, better))}"
    if np.ptp(state.columns[name]) == 0:
        return f"it may be {_meaning_in_words(meaning)}, but it is the same in every row"
    partner = PARTNERS.get(meaning)
    if partner and not any(partner in meaning_scores(other) for other in state.free() if other != name):
        words = _meaning_in_words(meaning)
        return f"it may be {words}, which says something together with a {partner} alone: there is none"
    return f"it may be {_meaning_in_words(meaning)}, but the motion in the log does not bear that out"


def _meaning_in_words(meaning: str) -> str:
    return {"x": "the position", "y": "the position"}.get(meaning) or (
        SIGNALS[meaning].word if meaning in SIGNALS else meaning.replace("_", " ")
    )
