"""Parts of a guess: the usual names of columns and units, suggestions, findings, and the state of the search."""

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
"""Key of a mapping that becomes other columns -> pattern of its names in logs, lower case, without a unit.

The patterns of all other columns are in `shipid.physics.signals.SIGNALS`.
"""
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
    """A guessed column of the dataset.

    name : column of the dataset. source, unit : column of the log, and its unit.
    confidence : 0 to 1. evidence : the reason, in words.
    extra : further keys of the mapping, such as `sign`.
    """

    name: str
    source: str
    unit: str
    confidence: float
    evidence: str
    extra: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Finding:
    """A defect of the log, or a sign or unit that is easily mistaken.

    kind : a few words, the same for all findings of this kind. columns : columns of the log that have it.
    confidence : 0 to 1. sentence : what was seen, with numbers.
    repair : keys of a [[repair]] that would correct it; None if there is none.
    """

    kind: str
    columns: tuple[str, ...]
    confidence: float
    sentence: str
    repair: dict[str, Any] | None = None


def _pattern(meaning: str) -> str:
    return INPUT_NAMES.get(meaning) or SIGNALS[meaning].names or "(?!)"  # a signal that no log has matches no name


def stem(name: str) -> str:
    """Return the name of a column in lower case, without brackets and without a unit at its end."""
    base = plain(name)
    head, underscore, tail = base.rpartition("_")
    is_unit = underscore and any(re.fullmatch(words, tail) for words in UNIT_WORDS.values())
    return head if is_unit and tail != "rpm" else base


def unit_said(name: str, si: str) -> str | None:
    """Return the unit in the name of a column; None if there is none, or none that converts to the SI unit `si`."""
    inside = re.search(r"[\[(]([^\])]*)[\])]", name)
    *before, last = re.split("[_ ]", name)
    words = inside.group(1) if inside else last if before or si == "rev/s" else ""
    said = words.strip().lower()
    return next(
        (unit for unit, expected in UNIT_WORDS.items() if unit in UNITS[si] and re.fullmatch(expected, said)), None
    )


@dataclass
class State:
    """What the guess knows so far; each step of `guess` adds to it.

    t : time [s], (N,). clock_unit : unit of the log's clock. columns : name -> values as logged, (N,).
    chosen : windows over which changes are compared. taken : columns of the log that already have a meaning.
    position : north + i east [m]. psi : heading [rad]. r : yaw rate [rad/s].
    velocity : earth-fixed, north + i east [m/s]. body : u + i v [m/s].
    """

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
    velocity: Complex | None = None
    body: Complex | None = None

    def free(self) -> list[str]:
        """Return the columns that have no meaning yet."""
        return [name for name in self.columns if name not in self.taken]

    def called(self, meaning: str) -> list[str]:
        """Return the free columns whose name fits this meaning."""
        return [name for name in self.free() if re.fullmatch(_pattern(meaning), stem(name))]

    def suggest(self, name: str, source: str, unit: str, confidence: float, why: str, **extra: Any) -> None:
        """Suggest column `source` of the log for column `name` of the dataset; it is then taken."""
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
        """Add a finding."""
        self.findings.append(Finding(kind, columns, round(confidence, 2), sentence, repair))

    def all_called(self, meaning: str) -> list[str]:
        """Return all columns whose name fits this meaning, taken or free."""
        return [name for name in self.columns if re.fullmatch(_pattern(meaning), stem(name))]
