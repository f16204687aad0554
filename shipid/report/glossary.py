"""Short names that every page explains where the pointer rests on them."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

MEANINGS = {
    "H_90": "90th percentile of the position error of the prediction [m]: nine errors in ten are smaller",
    "N_D": "number of recorded runs (manoeuvres) used to train and to validate",
    "H": "mean position error of the prediction, compensated or of no physics, over all tests [m], equation (15)",
    "A": "mean position error of the physics alone over the test manoeuvres [m], equation (14)",
    "(11)": "equation (11): the frame with x ahead and y to starboard at the instant of prediction",
    "(14)": "equation (14): A, the mean distance between true and predicted places, physics alone",
    "(15)": "equation (15): H, the mean distance between true and predicted places, with compensation",
    "(16)": "equation (16): each derivative of the hull times a random factor",
}
# A and H are words, too ("A runs from"): a letter counts before = [ (, or after a small word, never at the start alone.
LETTER = r"(?<![\w.>-])(?:A|H)(?=\s(?:=|\[m\]|of\b|over\b|against\b|falls\b|rises\b|and\s[AH]\b|runs\s(?:from|over)))"
PATTERN = re.compile(rf"H_90|N_D(?![\w])|\((?:11|14|15|16)\)|{LETTER}")
AFTER = re.compile(r"\b(by|its|is|has|error|below|equal|along|less) (A|H)(?![\w-])")


def mark_short_names(text: str) -> Markup:
    """Escape a text and mark its short names with what they mean."""
    marked = PATTERN.sub(lambda match: _abbreviation(match[0]), str(escape(text)))
    return Markup(AFTER.sub(lambda match: f"{match[1]} {_abbreviation(match[2])}", marked))


def _abbreviation(name: str) -> str:
    return f'<abbr title="{escape(MEANINGS[name])}">{name}</abbr>'
