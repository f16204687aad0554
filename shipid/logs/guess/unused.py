"""Why a column of a log has no place in the draft: a sentence for each, so that a person may put it in by hand."""

from __future__ import annotations

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
    numbers = dict.fromkeys(numbering, "it holds the numbers of the rows")
    return numbers | {name: _unused_reason(state, name) for name in state.free() if name not in numbers}


def _unused_reason(state: State, name: str) -> str:
    scores = meaning_scores(name)
    if not scores:
        plain = "its name says no known quantity, and no other column is like it"
        plain = "it is another clock" if is_clock(name) else plain
        return next((REMEDIES[part] for part in name_parts(name) if part in REMEDIES), plain)
    meaning = max(scores, key=scores.__getitem__)
    if meaning not in {*SIGNALS, *INPUTS, "x", "y", "velocity_north", "velocity_east"}:
        return "it is a quantity that a dataset does not take"
    word = SIGNALS[meaning].word if meaning in SIGNALS and len(meaning) > 1 else meaning.replace("_", " ")
    if (unit := unit_of_another(name, meaning)) is not None:
        return f"its unit {unit} does not fit {word}"
    group = next((alike for alike in ALIKE if meaning in alike), {meaning})
    better = " and ".join(repr(one.source) for one in state.suggestions if one.name.rsplit(".", 1)[-1] in group)
    if better:
        return f"{'an order, and the measured ' * is_order(name)}{word} is read from {better}"
    if meaning in ("speed", "course"):
        return f"it may be {word}: speed and course are read where both are there and fit the track"
    return f"it may be {word}, but it is the same in every row, or the motion in the log does not bear that out"
