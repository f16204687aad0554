"""Parts of a guess: the units in names, suggestions, findings, questions, and the state of the search."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Array
from shipid.logs.amounts import UNIT_WORDS, is_known, north_reference, without_prefix
from shipid.logs.guess.evidence import WINDOW, Complex, RowWindows, order_effects, window_length
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.guess.words import (
    how_much_says,
    is_note,
    is_order,
    may_be_measured,
    meaning_scores,
    name_parts,
    shaft_unit,
    side_in_name,
    unit_in_name,
    units_in_name,
)
from shipid.logs.mapping import UNITS
from shipid.logs.repairs import INPUTS
from shipid.physics.signals import SIGNALS, is_steering, signal_of

FOREIGN = re.compile(r"kn\W?m|mnm|[km]w|bar|[kmh]?pa|°c|degc|l/h|kg/h|t/h|kg|db|m/s\^?2|m/s²|kwh|kv|ma|bfts?|beaufort")
"""Units of quantities that no column of a dataset has, in lower case."""


PART, SLOWEST = 0.4, 100.0  # of a radian of usual turning; s, in which the slowest ship turns by one
LONGEST_UNIT = 6  # letters of a unit that is not known
PART_OF_UNIT = re.compile(r"[\d.,/]+ ?[*×x]? ?([^\W\d]+|°)|([^\W\d]+|°) ?[*×x/] ?[\d.,]+")
"""A part or a multiple of a unit, as in 0.1 deg and deg x 10, in lower case."""
LIKELY = 0.6  # confidence from which a suggestion is not marked as unsure
OF_POSE = ("latitude", "longitude", "north", "east", "x", "y", "psi")
NEARLY, STRONG = 0.1, 0.65  # how much worse than its best meaning a name may fit another; a name that says something


@dataclass(frozen=True)
class Suggestion:
    """A guessed column of the dataset.

    name : column of the dataset. source, unit : column of the log, and its unit.
    confidence : 0 to 1. extra : further keys of the mapping, such as `sign`.
    """

    name: str
    source: str
    unit: str
    confidence: float
    evidence: str
    extra: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Clue:
    """A defect of the log, or a sign or unit that is easily mistaken.

    kind : a few words. columns : of the log. confidence : 0 to 1. sentence : what was seen, with numbers.
    repair : keys of a [[repair]] that would correct it; None if there is none.
    """

    kind: str
    columns: tuple[str, ...]
    confidence: float
    sentence: str
    repair: dict[str, Any] | None = None


@dataclass(frozen=True)
class Question:
    """A question that the log cannot decide: columns of the dataset concerned, and its text for a person."""

    about: tuple[str, ...]
    sentence: str


def unknown_unit(name: str) -> str:
    """What a name has in brackets where it looks like a unit and is none known here; empty where it does not."""
    for text in map(str.strip, units_in_name(name)):
        known = is_known(without_prefix(text)[0]) or north_reference(text) or is_note(text)
        short = len(text) <= LONGEST_UNIT and (text == "V" or len(re.findall(r"[^\W\d_]", text)) > 1)
        part = PART_OF_UNIT.fullmatch(text.lower())
        if (not known and (short or re.search(r"\w[/^]\w", text))) or (part and is_known(part[1] or part[2])):
            return text
    return ""


@cache
def unit_of_another(name: str, meaning: str) -> str | None:
    """The unit set off in a name where a column of this meaning cannot have it; None if it can, or none is there."""
    si = si_unit(meaning)
    if si not in UNITS or unit_in_name(name, si) is not None:
        return None
    last = re.split(r"[_ ]", name.strip())[-1]
    said = units_in_name(name) or ([last] if last in ("kN", "kNm", "Nm", "kW") or shaft_unit(name) else [])
    for word in said:
        text = word.strip().lower()
        if meaning in SIGNALS and is_steering(meaning) and re.fullmatch(UNIT_WORDS["%"], text):
            continue
        if (
            is_known(without_prefix(text)[0])
            or (si != "rev/s" and FOREIGN.fullmatch(text))
            or word in ("kN", "Nm", "kNm", "N")
        ):
            return word
    return None


def names_another(name: str, meaning: str) -> bool:
    """Whether a word of a name, not a mere letter, says a quantity of another unit: a roll is no yaw rate."""
    scores = meaning_scores(name)
    best = max(scores, key=lambda one: scores[one], default=meaning)
    word = max((len(part) for part in name_parts(name)), default=0) > 2
    clear = scores.get(best, 0.0) >= 0.9 and scores.get(meaning, 0.0) < STRONG
    return (word and clear and si_unit(best) != si_unit(meaning)) or unit_of_another(name, meaning) is not None


def si_unit(meaning: str) -> str:
    """The SI unit of a meaning; empty for a quantity of no use."""
    if meaning in SIGNALS:
        return SIGNALS[meaning].unit
    return INPUTS.get(meaning, {"x": "m", "y": "m", "": ""}.get(meaning, "m/s"))


def _may_be(scores: dict[str, float], meanings: tuple[str, ...]) -> bool:
    best = max(scores.values(), default=0.0)
    return best < STRONG or max(scores.get(meaning, 0.0) for meaning in meanings) >= best - NEARLY


@dataclass
class State:
    """What the guess knows so far; each step of `guess` adds to it.

    t : time [s], (N,). clock_unit : of the log. columns : name -> values as logged, (N,), without `spikes`.
    chosen : windows over which changes are compared. taken : columns of the log that have a meaning.
    joined : whether t runs over several files. spikes : column -> rows, and the least by how much they leave it.
    scaled : column -> factor that `columns` has already, and why. units : column -> unit of the log where `columns` has
    another. sides : letters that columns beside positions hold. negated : columns whose sign is turned.
    words : columns of words, with their first. other : columns that cannot be read, and why.
    commands : of the vessel, where it is known. turning : column that steers -> sign that turns the ship to starboard.
    position, psi : north + i east [m], heading [rad]; from `choose_pose` on. r : yaw rate [rad/s].
    velocity : earth-fixed, north + i east [m/s]. body : u + i v [m/s].
    """

    t: Array
    clock_unit: str
    columns: dict[str, Array]
    chosen: RowWindows
    joined: bool = False
    spikes: dict[str, tuple[NDArray[np.intp], float]] = field(default_factory=dict)
    scaled: dict[str, tuple[float, str]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    sides: frozenset[str] = frozenset()
    negated: set[str] = field(default_factory=set)
    words: dict[str, str] = field(default_factory=dict)
    other: dict[str, str] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)
    suggestions: list[Suggestion] = field(default_factory=list)
    findings: list[Clue] = field(default_factory=list)
    questions: list[Question] = field(default_factory=list)
    commands: tuple[str, ...] = ()
    turning: dict[str, float] = field(default_factory=dict)
    position: Complex = field(init=False)
    psi: Array = field(init=False)
    r: Array | None = None
    velocity: Complex | None = None
    body: Complex | None = None

    def effect(self, r: Array, order: Array) -> float:
        """The t value of the effect of an order (N,) on the yaw rate r (N,) [rad/s], in parts of usual turns."""
        return float(order_effects(self.t, r, order[None], self.part)[0])

    @property
    def part(self) -> float:
        """Duration [s] of the windows in which effects of orders are seen, a part of a usual turn."""
        longest = SLOWEST if np.ptp(self.psi) > SETTINGS.turned else WINDOW  # noise of a straight course is no turning
        return PART * window_length(self.t, self.psi, self.chosen, longest)

    def command_of(self, name: str) -> str:
        """The command of the vessel whose component and signal the name of a column says; empty if none does."""
        several = Counter(map(signal_of, self.commands))
        found = {
            command: how_much_says(name, command)
            for command in self.commands
            if several[signal_of(command)] > 1 and unit_of_another(name, signal_of(command)) is None
        }
        most = max(found.values(), default=0)
        best = [command for command, count in found.items() if count == most]
        return best[0] if most and len(best) == 1 else ""

    def side_of(self, name: str) -> str | None:
        """The side or place in the name of a column; L and R are sides where the log has both."""
        parts = name_parts(name)
        for letter, other, side in (("l", "r", "port"), ("r", "l", "starboard")):
            twin = tuple(other if part == letter else part for part in parts)
            if letter in parts and any(name_parts(column) == twin for column in self.columns):
                return side
        return side_in_name(name)

    def free(self) -> list[str]:
        """The columns that have no meaning yet."""
        return [name for name in self.columns if name not in self.taken]

    def called(self, meaning: str) -> list[str]:
        """The free columns whose name fits this meaning, the best first."""
        return self._fitting(meaning, self.free())

    def all_called(self, meaning: str) -> list[str]:
        """All columns whose name fits this meaning, taken or free, the best first."""
        return self._fitting(meaning, list(self.columns))

    def _fitting(self, meaning: str, names: list[str]) -> list[str]:
        scores = {name: meaning_scores(name).get(meaning, 0.0) for name in names}
        scores = {name: 0.0 if score and unit_of_another(name, meaning) else score for name, score in scores.items()}
        chosen = [
            name for name in names if scores[name] > 0 and scores[name] >= max(meaning_scores(name).values()) - NEARLY
        ]
        if not chosen and meaning in OF_POSE:
            return [name for name in names if meaning_scores(may_be_measured(name)).get(meaning, 0.0) > STRONG]
        return sorted(chosen, key=lambda name: -scores[name])

    def movable(self, meaning: str) -> list[str]:
        """The free columns that vary, and have no unit that this meaning cannot have; a word is no hindrance."""
        free = [name for name in self.free() if np.ptp(self.columns[name]) > 0]
        return [name for name in free if unit_of_another(name, meaning) is None]

    def eligible(self, *meanings: str) -> list[str]:
        """The free columns that may have one of these meanings, or any: they vary, and no name says otherwise."""
        free = [name for name in self.free() if np.ptp(self.columns[name]) > 0 and not is_order(name)]
        if not meanings:
            return [name for name in free if meaning_scores(name).get("", 0.0) < STRONG]
        unfit = {name for name in free if all(unit_of_another(name, meaning) for meaning in meanings)}
        return [name for name in free if _may_be({"": 1.0} if name in unfit else meaning_scores(name), meanings)]

    @property
    def numbered(self) -> bool:
        """Whether the log has no names, so that its columns are called by numbers."""
        return all(name.isdecimal() for name in self.columns)

    def ask(self, about: tuple[str, ...], sentence: str) -> None:
        """Add a question."""
        self.questions.append(Question(about, sentence))

    def ask_for_unit(self, about: str, name: str, unit: str) -> bool:
        """Ask where a name has a unit that is not known here; return whether it does."""
        said = "" if name in self.scaled or name in self.units else unknown_unit(name)
        if said:
            self.ask(
                (about,),
                f"{name!r} says {said!r}, no unit that is known here: write `unit` and `factor`. {unit} is a guess",
            )
        return said != ""

    def suggest(self, name: str, source: str, unit: str, confidence: float, why: str, **extra: Any) -> None:
        """Suggest column `source` of the log for column `name` of the dataset; it is then taken."""
        self.taken.add(source)
        if source in self.scaled:
            factor, what = self.scaled[source]
            extra["factor"] = float(f"{factor * extra.get('factor', 1.0):.9g}")
            why = f"{why}; {what}"
        if source in self.negated:
            extra["sign"] = -extra.get("sign", 1)
        unit = self.units.get(source, unit)
        self.suggestions.append(Suggestion(name, source, unit, round(confidence, 2), why, extra))

    def negate(self, source: str) -> None:
        """Turn the sign of a column, here and in the draft."""
        self.columns[source] = -self.columns[source]
        self.negated ^= {source}

    def find(
        self,
        kind: str,
        columns: tuple[str, ...],
        confidence: float,
        sentence: str,
        repair: dict[str, Any] | None = None,
    ) -> None:
        """Add a finding."""
        self.findings.append(Clue(kind, columns, round(confidence, 2), sentence, repair))
