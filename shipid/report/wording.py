"""Numbers and lists as text for a sentence or a table."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from shipid import units
from shipid.units import length_decimals, plural_word

CONSTANT_MOTION = "constant u, v, r"
"""Name of the path that no model and no data are needed for: the motion at the instant goes on."""
REGRESSION = "regression on accelerations"
"""Name of the simplest path that data give without physics; no family has such a name."""

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number_text(value: float) -> str:
    """Three digits, two decimals at most, and two digits below 0.1: 0.0083, 0.83, 12.4, 131; NaN is a dash."""
    if not math.isfinite(value):
        return "–"
    return fixed_text(value, _decimals(value))


def _decimals(value: float) -> int:
    return 0 if abs(value) >= 99.95 else 1 if abs(value) >= 9.995 else length_decimals(value)


def fixed_text(value: float, decimals: int) -> str:
    """Write a finite number with so many decimals, a true minus sign and no minus zero."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}".replace("-", "−")


def scientific_text(value: float, digits: int = 4) -> str:
    """So many digits, with a power of ten where the number is very large or small: 803, 1.175 × 10⁵, 10⁻⁶."""
    text = f"{value:.{digits}g}".replace("-", "−")
    front, _, power = text.partition("e")
    raised = str(int(power.replace("−", "-"))) if power else ""
    return f"{'' if front == '1' else f'{front} × '}10{raised.translate(RAISED)}" if raised else text


def shorten_name(name: str, most: int = 12) -> str:
    """Name of at most so many characters, its middle left out: names that differ mostly do so at an end."""
    return name if len(name) <= most else f"{name[: most // 2 - 1]}…{name[most // 2 - most :]}"


def metres_text(value: float) -> str:
    """Write a length with its unit."""
    return f"{number_text(value)} m"


def difference_text(value: float, low: float, high: float, unit: str = "m") -> str:
    """Write a difference and its interval with the decimals of the greatest of them: it may be nearly 0."""
    if not math.isfinite(low):
        return f"{number_text(value)} {unit}, no interval from fewer than five runs"
    places = _decimals(max(map(abs, (value, low, high))))
    return f"{fixed_text(value, places)} {unit} [{fixed_text(low, places)}, {fixed_text(high, places)}]"


def ends_text(low: float, high: float) -> str:
    """Write two lengths [m] as `low to high`, with the decimals of the greater."""
    places = _decimals(max(abs(low), abs(high)))
    return f"{fixed_text(low, places)} to {fixed_text(high, places)}"


def distance_text(value: float) -> str:
    """Write a distance between places: metres, or kilometres from 1,000 m on."""
    return f"{value / 1000:.1f} km" if value >= 1000 else f"{value:.0f} m"


def join_few_names(names: Sequence[str], limit: int = 4) -> str:
    """Join as `a, b and c`; what exceeds the limit is counted."""
    shown = [*names] if len(names) <= limit else [*names[: limit - 1], f"{len(names) - limit + 1} more"]
    return units.join_names(shown) or "none"


def set_sentence(text: str) -> str:
    """Write a sentence as a page sets it: signs, powers of ten, a space before %, none that breaks before a unit."""
    plain = text.replace("+-", "±").replace("->", "→")
    text = re.sub(r"(?<![\w.])(\d+(?:\.\d+)?e[+-]\d+)(?!\w)", lambda match: scientific_text(float(match[1])), plain)
    text = re.sub(r"`([^`]+)`", r"“\1”", text)
    text = re.sub(r"(?<=\d)%", " %", re.sub(r"(?<![^\s\[(])-(?=\d)", "−", text))
    return re.sub(r"(?<=[\d⁰¹²³⁴⁵⁶⁷⁸⁹]) (?=(?:m|km|s|min|deg|rpm)\b|%)|(?<=\w) (?== \S)|(?<==) (?=\d)", "\u00a0", text)


def counted_text(count: int, noun: str) -> str:
    """`1 run`, `3 runs`."""
    return f"{count:,} {plural_word(count, noun)}"


def price_text(amount: float, unit: str) -> str:
    """Write a price with its unit, such as `16,000 EUR` or `2.5 h`."""
    return f"{amount:,.0f} {unit}" if abs(amount) >= 100 else f"{amount:.3g} {unit}"


def duration_text(seconds: float) -> str:
    """Write a duration [s] as text in s, min or h."""
    if seconds >= 7200:
        return f"{seconds / 3600:.1f} h"
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"
