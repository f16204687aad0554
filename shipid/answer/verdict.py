"""Findings: a claim and its rule, when it counts as shown, and how its numbers are written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import NDArray

from shipid.evidence import FEWEST_RUNS, SIGNIFICANT, Differences, which_significant
from shipid.report.content import model_text
from shipid.report.wording import counted_text, difference_text, join_few_names, metres_text
from shipid.study.declared import NO_MODEL
from shipid.units import plural_word

Verdict = Literal["confirmed", "undecided", "refuted", "not testable"]
Judgement = tuple[Verdict, str, Mapping[str, float]]  # with the evidence in words, and key numbers by name and unit
MOST_NAMES = 5  # in one sentence
EQUAL_A = "it is not shown which of them is more accurate"


class ClaimVerdict(TypedDict):
    """A claim of the method with its verdict, the evidence in words, and its key numbers by name and unit."""

    id: str
    claim: str
    verdict: Verdict
    evidence: str
    numbers: Mapping[str, float]


class UndecidedClaim(Exception):
    """Raised by a rule that lacks what it needs; its text says what that is."""


@dataclass(frozen=True)
class ClaimRule:
    """A claim and how it is judged: `judge` takes what the claim is about, or raises UndecidedClaim."""

    claim: str
    judge: Callable[[Any], Judgement]

    def decide(self, case: object) -> Judgement:
        """Verdict, evidence and numbers; undecided, with the reason as evidence, where something lacks."""
        try:
            return self.judge(case)
        except UndecidedClaim as reason:
            return "undecided", str(reason), {}


def judge_claims(rules: Mapping[str, ClaimRule], case: object, *notes: str) -> list[ClaimVerdict]:
    """The finding of each rule, in order. notes : what is added to the evidence of all."""
    findings: list[ClaimVerdict] = []
    for key, rule in rules.items():
        decided, evidence, numbers = rule.decide(case)
        words = "; ".join(part for part in (evidence, *notes) if part)
        findings.append(ClaimVerdict(id=key, claim=rule.claim, verdict=decided, evidence=words, numbers=numbers))
    return findings


def leave_undecided(rules: Mapping[str, ClaimRule], reason: str) -> list[ClaimVerdict]:
    """Every claim undecided, for the same reason."""
    return [
        ClaimVerdict(id=k, claim=r.claim, verdict="undecided", evidence=reason, numbers={}) for k, r in rules.items()
    ]


def verdict_of(confirmed: bool, refuted: bool) -> Verdict:
    """Confirmed if the claim is shown, refuted if its opposite is shown, else undecided."""
    return "confirmed" if confirmed else "refuted" if refuted else "undecided"


def weakest_verdict(verdicts: Iterable[Verdict]) -> Verdict:
    """Verdict on a claim of several parts: refuted if one is, confirmed if all are, else undecided."""
    parts = list(verdicts)
    return "refuted" if "refuted" in parts else verdict_of(set(parts) == {"confirmed"}, False)


def length_with_interval(value: float, low: float, high: float) -> str:
    """Return a length [m] with its interval, if it has one."""
    return difference_text(value, low, high) if np.isfinite([low, high]).all() else metres_text(value)


def difference_with_interval(differences: Differences, index: int = 0) -> str:
    """Return a difference [m] with its 95 % interval, if it has one."""
    return length_with_interval(*(float(ends[index]) for ends in (differences.mean, differences.low, differences.high)))


def ratio_with_interval(differences: Differences, index: int = 0) -> str:
    """Return a ratio, whose logarithm is one of some differences, with its 95 % interval, if it has one."""
    value, low, high = np.exp([differences.mean[index], differences.low[index], differences.high[index]])
    return f"{value:.2f}" + (f" [{low:.2f}, {high:.2f}]" if np.isfinite([low, high]).all() else "")


def stricter_list(models: Iterable[str], chances: NDArray[np.float64], *, names: bool = True) -> str:
    """Say which models, or how many, are shown after Holm's correction, where those are fewer than by single tests."""
    shown = which_significant(chances)
    if shown.sum() == (chances <= SIGNIFICANT).sum():
        return ""
    which = model_list(np.array(list(models))[shown]) if names and shown.any() else str(shown.sum() or "none")
    return f" (after correction for {len(chances)} comparisons, Holm: {which})"


def least_to_greatest(*numbers: str) -> str:
    """Return `least to greatest`, or the one number that both are written as."""
    return " to ".join(dict.fromkeys(numbers))


def too_few_manoeuvres(count: int) -> str:
    """Say that so many test manoeuvres give no interval; empty if they do."""
    if count >= FEWEST_RUNS:
        return ""
    give = plural_word(count, "gives", "give")
    return f"{counted_text(count, 'test manoeuvre')} {give} no interval, {FEWEST_RUNS} would"


def quoted_model(model: str) -> str:
    """Name a model inside a sentence; that without physics in quotes: `no physics is worse` would say that none is."""
    name, plus, method = model.partition(" + ")  # of a method beside the one that the study judges by
    return f'"{model_text(name)}"{plus}{method}' if name == NO_MODEL else model


def model_list(models: Iterable[str]) -> str:
    """Return names as in a sentence, the first few of many."""
    names = [quoted_model(model) for model in models]
    return join_few_names(names, MOST_NAMES + 1) if names else ""
