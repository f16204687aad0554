"""Findings R1-R4 (method, section 5): verdicts on accurate and inaccurate physics in a study at full scale.

They are taken at the largest amount of data, from paired differences over test manoeuvres; "shown" means a 95 %
interval free of 0.

R1 : both models have H below A.
R2 : H of the inaccurate model is less than 10 % above A of the accurate one: the one whose A is smaller on the test,
    whichever the study calls accurate. Where that is not shown of either, it must hold of both.
R3 : the models differ less in H than in A: both A gap - H gap and A gap + H gap are above 0, where a gap is the error
    of the model with the larger A less that of the other.
R4 : at every step ahead no physics has a larger error than every other predictor, physics alone included; refuted
    if one of them is worse over the whole horizon.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipid.answer.error_table import PHYSICS_ONLY, ErrorTable, error_table
from shipid.answer.verdict import (
    EQUAL_A,
    ClaimRule,
    ClaimVerdict,
    Judgement,
    count_manoeuvres,
    difference_with_interval,
    judge_claims,
    leave_undecided,
    length_in_metres,
    quoted_model,
    too_few_manoeuvres,
    verdict_of,
)
from shipid.evidence import Differences, all_significant, any_significant, paired_difference
from shipid.metrics import position_error
from shipid.study.declared import NO_MODEL
from shipid.study.results import Results
from shipid.units import percent_text

Array = NDArray[np.float64]
ABOUT = 0.10  # R2: "about as good" means a mean error at most 10 % above


@dataclass(frozen=True)
class Rivals:
    """What R1-R4 compare at one amount of data.

    table : errors by test manoeuvre; its last amount counts.
    good, bad : the accurate and the inaccurate model.
    steps : predictor -> (T, R) mean error [m] at every step ahead; `none` and all others that do not see the test.
    """

    table: ErrorTable
    good: str
    bad: str
    steps: dict[str, Array]

    @property
    def last(self) -> int:
        """Place of the amount of data that counts."""
        return len(self.table.amounts) - 1

    @property
    def by_accuracy(self) -> tuple[str, str]:
        """The model with the smaller A on the test, and the other: the names of the study say nothing of the test."""
        less, more = sorted((self.good, self.bad), key=lambda model: self.table.mean(model, PHYSICS_ONLY))
        return less, more

    def metres(self, model: str, place: int) -> str:
        """Error of a model at an amount, or alone, in words."""
        return length_in_metres(self.table.mean(model, place))


def _judge_gain(rivals: Rivals) -> Judgement:
    table, last, models = rivals.table, rivals.last, (rivals.good, rivals.bad)
    gains = table.compare([[(1.0, model, PHYSICS_ONLY), (-1.0, model, last)] for model in models])
    parts = [
        f"{m} {rivals.metres(m, PHYSICS_ONLY)} -> {rivals.metres(m, last)}, {difference_with_interval(gains, k)} less"
        for k, m in enumerate(models)
    ]
    good, bad = (table.mean(model, last) / table.mean(model, PHYSICS_ONLY) for model in models)
    decided = verdict_of(all_significant(gains.above), any_significant(gains.below))
    return decided, "; ".join(parts), {"H / A, accurate": good, "H / A, inaccurate": bad}


def _judge_equal(rivals: Rivals) -> Judgement:
    table, last, (less, more) = rivals.table, rivals.last, rivals.by_accuracy
    apart = all_significant(table.compare([[(1.0, more, PHYSICS_ONLY), (-1.0, less, PHYSICS_ONLY)]]).above)
    sides = [(less, more)] if apart else [(less, more), (more, less)]
    about = table.compare([[(1 + ABOUT, one, PHYSICS_ONLY), (-1.0, other, last)] for one, other in sides])
    by = table.compare([[(1.0, less, PHYSICS_ONLY), (-1.0, more, last)]])
    evidence = (
        f"inaccurate and compensated {rivals.metres(more, last)}, accurate alone {rivals.metres(less, PHYSICS_ONLY)}: "
        f"{difference_with_interval(by)} less{'' if apart else f'; {EQUAL_A}'}"
    )
    decided = verdict_of(all_significant(about.above), all_significant(about.below))
    return decided, evidence, {"H inaccurate / A accurate": table.mean(more, last) / table.mean(less, PHYSICS_ONLY)}


def _judge_gap(rivals: Rivals) -> Judgement:
    table, last, (less, more) = rivals.table, rivals.last, rivals.by_accuracy
    gap = [(1.0, more, PHYSICS_ONLY), (-1.0, less, PHYSICS_ONLY)]
    gaps = table.compare([[*gap, (sign, more, last), (-sign, less, last)] for sign in (-1.0, 1.0)])
    before, after = (abs(table.mean(rivals.bad, at) - table.mean(rivals.good, at)) for at in (PHYSICS_ONLY, last))
    counts = 0 if gaps.mean[0] < gaps.mean[1] else 1  # the gap of H has the sign of that of A, or not
    evidence = (
        f"gap {length_in_metres(before)} before, {length_in_metres(after)} after: "
        f"{difference_with_interval(gaps, counts)} less"
    )
    decided = verdict_of(all_significant(gaps.above), any_significant(gaps.below))
    return decided, evidence, {"gap before [m]": before, "gap after [m]": after}


def _judge_worst(rivals: Rivals) -> Judgement:
    table, names = rivals.table, list(rivals.steps)
    means = np.stack([error @ table.weights for error in rivals.steps.values()])
    most = np.bincount(means.argmax(axis=0), minlength=len(names))
    share, worst = float(most[names.index(NO_MODEL)] / most.sum()), quoted_model(names[int(most.argmax())])
    pure, others = rivals.steps[NO_MODEL], [error for name, error in rivals.steps.items() if name != NO_MODEL]

    over_horizon = [error.mean(axis=0)[None] for error in (pure, *others)]
    each, whole = _lead_of_others(table, pure, others), _lead_of_others(table, over_horizon[0], over_horizon[1:])
    evidence = (
        f"{quoted_model(NO_MODEL)} is worst at {percent_text(share)} of the steps, physics alone included; "
        f"most often worst: {worst}"
        if len(pure) > 1
        else f"worst over the horizon, physics alone included: {worst}"
    )
    decided = verdict_of(all_significant(each.above), any_significant(whole.below))
    return decided, evidence, {"share of steps where it is worst": share}


def _lead_of_others(table: ErrorTable, pure: Array, others: list[Array]) -> Differences:
    """How much smaller [m] than errors (T, R) without physics those of other predictors are, step by step."""
    noise = [np.hypot(pure @ table.weights, error @ table.weights) for error in others]
    ahead = np.concatenate([pure - error for error in others])
    return paired_difference(ahead, table.counts, float(table.noise[-1]) * np.concatenate(noise))


FULL_SCALE_RULES = {
    "R1": ClaimRule("compensated physics beats the physics alone, accurate or not", _judge_gain),
    "R2": ClaimRule("the inaccurate model, compensated, is about as good as the accurate physics alone", _judge_equal),
    "R3": ClaimRule("the gap between accurate and inaccurate physics shrinks after compensation", _judge_gap),
    "R4": ClaimRule(f"{quoted_model(NO_MODEL)} is worst over the whole horizon", _judge_worst),
}


def judge_rivals(rivals: Rivals, remedy: str = "`shipid study rotate` tests other runs in turn") -> list[ClaimVerdict]:
    """Verdicts on R1-R4; all undecided with fewer test manoeuvres than give an interval, which needs a remedy."""
    few = too_few_manoeuvres(rivals.table.runs)
    return judge_claims(FULL_SCALE_RULES, rivals, f"{few}: {remedy}" if few else count_manoeuvres(rivals.table.runs))


def full_scale_findings(results: Results) -> list[ClaimVerdict]:
    """R1-R4 on the test manoeuvres of a study."""
    claims = results.plan.study.claims
    assert claims is not None
    names = {one.family: one.name for one in results.plan.foundations if one.family in claims.roles.values()}
    good, bad = names[str(claims.accurate)], names[str(claims.inaccurate)]
    table = error_table(results, (good, bad))
    if any(name not in table.H for name in (good, bad, NO_MODEL)):
        return leave_undecided(FULL_SCALE_RULES, "a cell that it needs has failed or is missing")
    if any(name not in table.A for name in (good, bad)):
        return leave_undecided(
            FULL_SCALE_RULES, "the physics of a claim is identified again in every cell, so it has no single A"
        )
    return judge_rivals(Rivals(table, good, bad, _errors_by_step(results, table.amounts[-1])))


def _errors_by_step(results: Results, N_D: int) -> dict[str, Array]:
    """(T, R) errors by step of every predictor at an amount of data, mean over seeds, and of physics alone."""
    aside = {one.name for one in results.plan.foundations if one.family in results.aside}
    names = np.unique(results.test.run)

    def by_step(path: Array) -> Array:
        error = position_error(path, results.test.future)
        return np.stack([error[:, results.test.run == name].mean(axis=1) for name in names], axis=1)

    parts: dict[str, list[Array]] = {}
    cells = results.judged_cells
    for row in cells[cells["N_D"] == N_D].itertuples():
        if row.cell in results.paths and row.model not in aside:
            parts.setdefault(str(row.model), []).append(by_step(results.paths[str(row.cell)]))
    for model, path in results.physics.items():
        if model not in (NO_MODEL, *aside) and np.isfinite(path).all():
            parts[f"{model} alone"] = [by_step(path)]
    return {name: np.mean(errors, axis=0) for name, errors in parts.items()}
