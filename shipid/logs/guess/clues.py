"""What a guess is made of: names that columns often have, suggestions, findings, and what is known so far."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from shipid.data.dataset import Array
from shipid.logs.guess.evidence import Complex, Windows
from shipid.logs.guess.sniff import plain
from shipid.logs.mapping import UNITS
from shipid.physics.signals import SIGNALS

INPUT_NAMES: dict[str, str] = {
    "latitude": r"lat|latitude",
    "longitude": r"lon|long|lng|longitude",
    "speed": r"sog|speed|spd|speed_?over_?ground",
    "course": r"cog|course|track|course_?over_?ground",
}
"""How logs call what a mapping turns into columns, in lower case, without its unit; for signals see their table."""
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
    "%": r"%|percent|pct",
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


def _pattern(meaning: str) -> str:
    return INPUT_NAMES.get(meaning) or SIGNALS[meaning].names or "(?!)"  # a signal that no log has matches no name


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
        return [name for name in self.free() if re.fullmatch(_pattern(meaning), stem(name))]

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
        return [name for name in self.columns if re.fullmatch(_pattern(meaning), stem(name))]
