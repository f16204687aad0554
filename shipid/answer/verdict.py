"""Findings: when one counts as shown, and how its numbers are written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal, TypedDict

import numpy as np
from numpy.typing import NDArray

from shipid.evidence import FEWEST_RUNS, SIGNIFICANT, Contrasts, holm
from shipid.report.content import spoken
from shipid.report.wording import listed
from shipid.study.declared import NO_MODEL
from shipid.units import decimals_of, plural

Verdict = Literal["confirmed", "undecided", "refuted", "not testable"]
MOST_NAMES = 5  # in one sentence
SAME_A = "all physics models have the same A, so nothing can rise with it"
WHICH = "it is not shown which of them is more accurate"


class Finding(TypedDict):
    """A claim of the method with its verdict, the evidence in words, and its key numbers by name and unit."""

    id: str
    claim: str
    verdict: Verdict
    evidence: str
    numbers: Mapping[str, float]


def verdict(shown: bool, opposite: bool) -> Verdict:
    """Confirmed if the claim is shown, refuted if its opposite is shown, else undecided."""
    return "confirmed" if shown else "refuted" if opposite else "undecided"


def every(chances: NDArray[np.float64]) -> bool:
    """Whether each difference is shown: "all of them" needs no correction for their number (Berger 1982)."""
    return bool(len(chances) and (chances <= SIGNIFICANT).all())


def some(chances: NDArray[np.float64]) -> bool:
    """Whether at least one difference is shown, corrected for their number (Holm)."""
    return bool((shown(chances)).any())


def shown(chances: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which differences are shown: all where each is, else those that are after Holm's correction."""
    return np.full(len(chances), True) if every(chances) else holm(chances) <= SIGNIFICANT


def weakest(verdicts: Iterable[Verdict]) -> Verdict:
    """Verdict on a claim of several parts: refuted if one is, confirmed if all are, else undecided."""
    parts = list(verdicts)
    return "refuted" if "refuted" in parts else verdict(set(parts) == {"confirmed"}, False)


def finding(claims: Mapping[str, str], key: str, decided: Verdict, evidence: str, **numbers: float) -> Finding:
    """The claim of this key with its verdict, the evidence in words, and its key numbers by name and unit."""
    return Finding(id=key, claim=claims[key], verdict=decided, evidence=evidence, numbers=numbers)


def undecided(claims: Mapping[str, str], reason: str) -> list[Finding]:
    """Every claim undecided, for the same reason."""
    return [finding(claims, key, "undecided", reason) for key in claims]


def metres(value: float) -> str:
    """Return a length with two decimals, from 10 m on with one, of a model below 0.1 m with two digits or more."""
    return f"{_written(value, _places(value))} m"


def _places(value: float) -> int:
    return 1 if abs(value) >= 9.995 else decimals_of(value)


def interval(low: float, high: float, beside: float) -> str:
    """Return ` [low, high]` with the decimals of the number that it stands beside, or nothing where there is none."""
    places = _places(beside)
    return f" [{_written(low, places)}, {_written(high, places)}]" if np.isfinite([low, high]).all() else ""


def _written(value: float, places: int) -> str:
    """Return a number with so many decimals, and no minus zero."""
    return f"{round(value, places) + 0.0:.{places}f}"


def measured(differences: Contrasts, index: int) -> str:
    """Return a difference with its 95 % interval, all with the decimals of the greatest."""
    mean, low, high = (float(values[index]) for values in (differences.mean, differences.low, differences.high))
    greatest = float(np.nanmax(np.abs([mean, low, high])))
    return f"{_written(mean, _places(greatest))} m{interval(low, high, greatest)}"


def span(*numbers: str) -> str:
    """Return `least to greatest`, or the one number that both are written as."""
    return " to ".join(dict.fromkeys(numbers))


def manoeuvres(count: int) -> str:
    """Return `1 test manoeuvre`, `20 test manoeuvres`, ..."""
    return f"{count} {plural(count, 'test manoeuvre')}"


def too_few(count: int) -> str:
    """Say that so many test manoeuvres give no interval; empty if they do."""
    if count >= FEWEST_RUNS:
        return ""
    return f"{manoeuvres(count)} {plural(count, 'gives', 'give')} no interval, {FEWEST_RUNS} would"


def runs(count: int) -> str:
    """Return `1 run`, `2 runs`, ..."""
    return f"{count} {plural(count, 'run')}"


def words(model: str) -> str:
    """Name a model inside a sentence; that without physics in quotes: `no physics is worse` would say that none is."""
    name, plus, method = model.partition(" + ")  # of a method beside the one that the study judges by
    return f'"{spoken(name)}"{plus}{method}' if name == NO_MODEL else model


def named(models: Iterable[str]) -> str:
    """Return names as in a sentence, the first few of many."""
    names = [words(model) for model in models]
    return listed(names, MOST_NAMES + 1) if names else ""
