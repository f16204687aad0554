"""What a finding is, and how its numbers are said."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal, TypedDict

from shipid.study.plan import NO_MODEL

Verdict = Literal["confirmed", "undecided", "refuted"]
MOST_NAMES = 5  # in one sentence


class Finding(TypedDict):
    """A claim of the method with its verdict, the evidence in words, and its key numbers by name and unit."""

    id: str
    claim: str
    verdict: Verdict
    evidence: str
    numbers: Mapping[str, float]


def verdict(always: bool, on_average: bool) -> Verdict:
    """Confirmed if it holds for every seed (R4: at every step), undecided if only on average, else refuted."""
    return "confirmed" if always else "undecided" if on_average else "refuted"


def undecided(claims: Mapping[str, str], reason: str) -> list[Finding]:
    """Every claim undecided, for the same reason."""
    return [Finding(id=key, claim=claims[key], verdict="undecided", evidence=reason, numbers={}) for key in claims]


def metres(value: float) -> str:
    """Return a length with two decimals, from 10 m on with one."""
    return f"{value:.2f} m" if value < 10 else f"{value:.1f} m"


def interval(low: float, high: float, seeds: int) -> str:
    """Return ` [least, greatest] over n seeds`, or nothing for one seed."""
    return f" [{low:.2f}, {high:.2f}] over {seeds} seeds" if seeds > 1 else ""


def runs(count: int) -> str:
    """Return `1 run`, `2 runs`, ..."""
    return f"{count} run{'s' * (count != 1)}"


def words(model: str) -> str:
    """Name a model inside a sentence, where `none` would say something else."""
    return "pure data-driven" if model == NO_MODEL else model


def named(models: Iterable[str]) -> str:
    """Return names as in a sentence, the first few of many."""
    names = [words(model) for model in models]
    if len(names) <= MOST_NAMES + 1:
        return ", ".join(names)
    return f"{', '.join(names[:MOST_NAMES])} and {len(names) - MOST_NAMES} more"
