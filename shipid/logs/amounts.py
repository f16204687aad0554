"""Units as logs write them in the names of columns."""

from __future__ import annotations

import re
from functools import cache

UNIT_WORDS = {
    "kn": r"kn|kts?|knots?|[节節]|ノット|노트|узл?ов|уз",
    "m/s": r"mps|m/s|ms|m/sec|m s-1|ms-1|米/秒|м/с",
    "km/h": r"kmh|km/h|kph",
    "mph": r"mph|mi/h|miles/h",
    "cm/s": r"cm/s|cmps|cms|cm/sec|cm s-1",
    "mm/s": r"mm/s|mmps|mms|mm/sec|mm s-1",
    "deg": r"degs?|°|degrees?|grad|deg t|deg true|grader|grados|gradi|graden|degres?|º|[度도]|град",
    "rad": r"rads?|radians?",
    "deg/s": r"(deg|°|º|grad|[度도]|град)/(s(ec)?|秒|초|с)|dps|degs?_?p?e?r?_?s(ec)?",
    "deg/min": r"(deg|°|º|grad|[度도]|град)/(min|分|분|мин)|dpm|deg_?p?e?r?_?min",
    "rad/s": r"rad/s(ec)?|rads|rad_?p?e?r?_?s(ec)?",
    "rpm": r"rpm|1/min|min-1|min\^-1|u/min|r/min|o/min|revs?/min|tr/min|omw/min|varv/min|giri/min|rev_?p?e?r?_?min"
    r"|об/мин|[转轉転]/分",
    "rev/s": r"rps|1/s|revs?/s(ec)?|hz|s-1",
    "m": r"m|metres?|meters?|meter",
    "km": r"km",
    "cm": r"cm|centimet(er|re)s?",
    "mm": r"mm|millimet(er|re)s?",
    "ft": r"ft|feet|foot",
    "nmi": r"nmi|nm|nautical miles?",
    "N": r"n|newtons?",
    "kN": r"kn|kilo ?newtons?",
    "N m": r"n[ .*·]?m|newton ?met(er|re)s?",
    "kN m": r"kn[ .*·]?m",
    "%": r"%|percent|pct|prozent",
}
"""Unit -> regular expression of how logs write it, in lower case."""
PREFIXED = ("deg", "rad", "deg/s", "deg/min", "rad/s", "rpm")
"""Units of which logs write parts or multiples with a prefix, as in mrad."""
_PREFIXES = {"kilo": 1e3, "k": 1e3, "deci": 0.1, "d": 0.1, "centi": 0.01, "c": 0.01, "milli": 1e-3, "m": 1e-3}
_PREFIX = re.compile(r"(kilo|deci|centi|milli|[kdcm])([a-z].*)")
_NORTH = re.compile(r"(?:°|deg)? ?(t|m|true|mag)")
"""Behind an angle: of true, or of magnetic north."""


@cache
def without_prefix(text: str) -> tuple[str, float]:
    """A unit without its prefix, and what that multiplies it by: mrad is rad and 0.001; 1 where it has none."""
    found = _PREFIX.fullmatch(text.strip().lower())
    if found and not is_known(found[0]) and any(re.fullmatch(UNIT_WORDS[unit], found[2]) for unit in PREFIXED):
        return found[2], _PREFIXES[found[1]]
    return text, 1.0


def is_known(text: str) -> bool:
    """Whether a text is a unit of the list."""
    return any(re.fullmatch(words, text.strip().lower()) for words in UNIT_WORDS.values())


def north_reference(text: str) -> str:
    """Return T or M for a text behind an angle that says true or magnetic north; empty for any other one."""
    found = _NORTH.fullmatch(text.lower())
    return found[1][0].upper() if found else ""
