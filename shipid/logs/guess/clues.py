"""What a guess is made of: names that columns often have, suggestions, findings, and what is known so far."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from shipid.data.dataset import Array
from shipid.logs.guess.evidence import Complex, Windows
from shipid.logs.guess.sniff import plain
from shipid.logs.mapping import UNITS

NAMES: dict[str, str] = {
    "north": r"n|north|northing|x0|x|xn|pos_?n|x_?earth|y_north",
    "east": r"e|east|easting|y0|y|ye|pos_?e|y_?earth",
    "latitude": r"lat|latitude",
    "longitude": r"lon|long|lng|longitude",
    "psi": r"psi|heading|hdg|hdt|head|yaw|true_?heading|gyro",
    "u": r"u|surge|surge_?(speed|vel\w*)|vx|u_?b(ody)?|speed_?long\w*|dx0?",
    "v": r"v|sway|sway_?(speed|vel\w*)|vy|v_?b(ody)?|speed_?(trans|lat)\w*|dy0?",
    "r": r"r|rot|yaw_?rate|rate_?of_?turn|psi_?dot|dpsi\w*|wz",
    "speed": r"sog|speed|spd|speed_?over_?ground",
    "course": r"cog|course|track|course_?over_?ground",
    "phi": r"phi|roll",
    "theta": r"theta|pitch",
    "p": r"p|roll_?rate",
    "q": r"q|pitch_?rate",
    "V_w": r"v_?w|(true_?)?wind_?(speed)?|tws",
    "beta_w": r"beta_?w|(true_?)?wind_?(dir\w*|from|angle)|twd",
    "n": r"n_?(port|stbd|starboard|stern|bow)?|rpm\w*|rev\w*|rps\w*|shaft\w*|\w+_(rpm|shaft|rev)|n_p|n_s",
    "alpha": r"alpha\w*|azi\w*|\w+_(azi\w*|alpha)",
    "delta": r"delta\w*|rud\w*|\w+_(rud\w*|delta)",
}
"""What a column may be -> how it is often called, in lower case, without its unit."""
UNIT_WORDS = {
    "kn": r"kn|kts?|knots?",
    "m/s": r"mps|m/s|ms",
    "km/h": r"kmh|km/h|kph",
    "deg": r"degs?|°",
    "rad": r"rads?",
    "deg/s": r"deg/s|dps|degs?_?p?e?r?_?s(ec)?",
    "deg/min": r"deg/min|dpm|deg_?p?e?r?_?min",
    "rad/s": r"rad/s|rads|rad_?s",
    "rpm": r"rpm|1/min|min-1",
    "rev/s": r"rps|1/s|rev/s|hz",
    "m": r"m|metres?|meters?",
}
SIDES = r"(port|starboard|stbd|stern|bow|fore|aft|main)"


@dataclass(frozen=True)
class Suggestion:
    """A column of the dataset: where from, how sure (0 to 1), why; `extra` holds further keys of the mapping."""

    name: str
    source: str
    unit: str
    confidence: float
    evidence: str
    extra: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Finding:
    """A defect or a trap: its kind, the columns that have it, how sure, a sentence, and a repair that would mend it."""

    kind: str
    columns: tuple[str, ...]
    confidence: float
    sentence: str
    repair: dict[str, Any] | None = None


def stem(name: str) -> str:
    """A name without brackets and without a unit at its end."""
    base = plain(name)
    head, underscore, tail = base.rpartition("_")
    is_unit = underscore and any(re.fullmatch(words, tail) for words in UNIT_WORDS.values())
    return head if is_unit and tail != "rpm" else base


def unit_said(name: str, si: str) -> str | None:
    """Unit that a name says, if a column of this SI unit can have it."""
    inside = re.search(r"[\[(]([^\])]*)[\])]", name)
    *before, last = re.split("[_ ]", name)
    words = inside.group(1) if inside else last if before or si == "rev/s" else ""
    said = words.strip().lower()
    return next(
        (unit for unit, expected in UNIT_WORDS.items() if unit in UNITS[si] and re.fullmatch(expected, said)), None
    )


@dataclass
class State:
    """What is known so far; each step adds to it."""

    t: Array
    clock_unit: str
    columns: dict[str, Array]
    chosen: Windows
    taken: set[str] = field(default_factory=set)
    suggestions: list[Suggestion] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    position: Complex | None = None
    psi: Array | None = None
    r: Array | None = None
    velocity: Complex | None = None  # in the earth's frame
    body: Complex | None = None

    def free(self) -> list[str]:
        """Columns that nothing claims yet."""
        return [name for name in self.columns if name not in self.taken]

    def called(self, meaning: str) -> list[str]:
        """Free columns whose name says that they may be this."""
        return [name for name in self.free() if re.fullmatch(NAMES[meaning], stem(name))]

    def suggest(self, name: str, source: str, unit: str, confidence: float, why: str, **extra: Any) -> None:
        """Claim a column."""
        self.taken.add(source)
        self.suggestions.append(Suggestion(name, source, unit, round(confidence, 2), why, extra))

    def find(
        self,
        kind: str,
        columns: tuple[str, ...],
        confidence: float,
        sentence: str,
        repair: dict[str, Any] | None = None,
    ) -> None:
        """Note a finding."""
        self.findings.append(Finding(kind, columns, round(confidence, 2), sentence, repair))

    def all_called(self, meaning: str) -> list[str]:
        """Columns whose name says that they may be this, claimed or not."""
        return [name for name in self.columns if re.fullmatch(NAMES[meaning], stem(name))]
