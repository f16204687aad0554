"""Findings of a study: which claims it judges, R1-R4 at full scale (method, section 5), and B1-B2 on bands.

Rules and their error rates: docs/findings.md. "Shown" is a paired difference of logarithms over test manoeuvres whose
95 % interval is free of 0 (`shipid.evidence`); R3 and B1, on metres, take differences in metres. The width of a band
is its mean radius [m] over the horizon, a mean over windows of each test manoeuvre, and is judged as errors are.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.answer.bands import cell_regions, of_methods, uncalibrated_kinds
from shipid.answer.error_table import PHYSICS_ONLY, ErrorTable, error_table
from shipid.answer.findings_simulation import (
    SIMULATION_RULES,
    simulation_findings,
    trend_over_accuracy,
)
from shipid.answer.verdict import (
    EQUAL_A,
    ClaimRule,
    ClaimVerdict,
    Judgement,
    UndecidedClaim,
    difference_with_interval,
    judge_claims,
    least_to_greatest,
    leave_undecided,
    quoted_model,
    ratio_with_interval,
    too_few_manoeuvres,
    verdict_of,
)
from shipid.evidence import (
    Differences,
    all_significant,
    any_significant,
    log_error,
    paired_difference,
    share_interval,
)
from shipid.metrics import Array, coverage_share, position_error
from shipid.report.wording import counted_text, join_few_names, metres_text
from shipid.study.declared import NO_MODEL
from shipid.study.plan import unfair_reason, verdict_method
from shipid.study.results import Results
from shipid.units import level_text, percent_text

ABOUT = 0.10  # R2: "about as good" means a mean error at most 10 % above
BROKEN_BY = 0.05  # B2: a share that lies so far below its level is a broken promise


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


def _judge_gain(rivals: Rivals) -> Judgement:
    table, last, models = rivals.table, rivals.last, (rivals.good, rivals.bad)
    gains = table.compare([[(1.0, model, PHYSICS_ONLY), (-1.0, model, last)] for model in models])
    parts = [
        f"{m} {table.metres(m, PHYSICS_ONLY)} -> {table.metres(m, last)}, {ratio_with_interval(gains, k)} times less"
        for k, m in enumerate(models)
    ]
    good, bad = (table.mean(model, last) / table.mean(model, PHYSICS_ONLY) for model in models)
    decided = verdict_of(all_significant(gains.above), any_significant(gains.below))
    return decided, "; ".join(parts), {"H / A, accurate": good, "H / A, inaccurate": bad}


def _judge_equal(rivals: Rivals) -> Judgement:
    table, last, (less, more) = rivals.table, rivals.last, rivals.by_accuracy
    apart = all_significant(table.compare([[(1.0, more, PHYSICS_ONLY), (-1.0, less, PHYSICS_ONLY)]]).above)
    sides = [(less, more)] if apart else [(less, more), (more, less)]
    terms = [[(1.0, one, PHYSICS_ONLY), (-1.0, other, last)] for one, other in sides]
    about, by = table.compare(terms, np.log(1 + ABOUT)), table.compare([[(-f, *of) for f, *of in terms[0]]])  # type: ignore[misc]
    evidence = (
        f"inaccurate and compensated {table.metres(more, last)}, accurate alone {table.metres(less, PHYSICS_ONLY)}: "
        f"{ratio_with_interval(by)} times{'' if apart else f'; {EQUAL_A}'}"
    )
    decided = verdict_of(all_significant(about.above), all_significant(about.below))
    return decided, evidence, {"H inaccurate / A accurate": table.mean(more, last) / table.mean(less, PHYSICS_ONLY)}


def _judge_gap(rivals: Rivals) -> Judgement:
    table, last, (less, more) = rivals.table, rivals.last, rivals.by_accuracy
    gap = [(1.0, more, PHYSICS_ONLY), (-1.0, less, PHYSICS_ONLY)]
    gaps = table.compare([[*gap, (sign, more, last), (-sign, less, last)] for sign in (-1.0, 1.0)], logs=False)
    before, after = (abs(table.mean(rivals.bad, at) - table.mean(rivals.good, at)) for at in (PHYSICS_ONLY, last))
    counts = 0 if gaps.mean[0] < gaps.mean[1] else 1  # the gap of H has the sign of that of A, or not
    evidence = (
        f"gap {metres_text(before)} before, {metres_text(after)} after: {difference_with_interval(gaps, counts)} less"
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
    """How much smaller than errors (T, R) without physics those of other predictors are, step by step, as logarithms.

    Other draws of runs count as for the model that they move most.
    """
    last = len(table.amounts) - 1
    noise = [table.noise([[(1.0, NO_MODEL, last), (-1.0, model, last)]]) for model in table.models if model != NO_MODEL]
    ahead = np.concatenate([log_error(pure) - log_error(error) for error in others])
    return paired_difference(ahead, *max(noise, key=lambda known: float(known[0][0])))


FULL_SCALE_RULES: dict[str, ClaimRule] = {
    "R1": ClaimRule("compensated physics beats the physics alone, accurate or not", _judge_gain),
    "R2": ClaimRule("the inaccurate model, compensated, is about as good as the accurate physics alone", _judge_equal),
    "R3": ClaimRule("the gap between accurate and inaccurate physics shrinks after compensation", _judge_gap),
    "R4": ClaimRule(f"{quoted_model(NO_MODEL)} is worst over the whole horizon", _judge_worst),
}


def full_scale_findings(results: Results, families: Iterable[str | None]) -> list[ClaimVerdict]:
    """R1-R4 on the test manoeuvres of a study. families : the accurate and the inaccurate one."""
    names = {one.family: one.name for one in results.plan.foundations}
    good, bad = (names[str(family)] for family in families)
    table = error_table(results, (good, bad))
    if not ({good, bad, NO_MODEL} <= set(table.H) and {good, bad} <= set(table.A)):
        reason = "a cell that it needs has no result, or its physics, identified again in every cell, has no single A"
        return leave_undecided(FULL_SCALE_RULES, reason)
    note = counted_text(table.runs, "test manoeuvre")
    if few := too_few_manoeuvres(table.runs):
        note = f'{few}: [repeat] "split.test" tests other runs in turn'
    rivals = Rivals(table, good, bad, _errors_by_step(results, table.amounts[-1]))
    return judge_claims(FULL_SCALE_RULES, rivals, note)


def _errors_by_step(results: Results, N_D: int) -> dict[str, Array]:
    """(T, R) errors by step of predictors but means over foundations at an amount of data, mean over seeds."""
    aside = {one.name for one in results.plan.foundations if one.family in results.aside or one.mean_of}
    run, cells = results.test.run, results.judged_cells
    cells = cells[cells["N_D"].eq(N_D) & cells["cell"].isin(list(results.paths)) & ~cells["foundation"].isin(aside)]
    paths = {
        str(name): [results.paths[cell] for cell in mine] for name, mine in cells.groupby("model", sort=False)["cell"]
    }
    alone = {name: path for name, path in results.physics.items() if name not in (NO_MODEL, *aside)}
    paths |= {f"{name} alone": [path] for name, path in alone.items() if np.isfinite(path).all()}

    def by_step(path: Array) -> Array:
        error = position_error(path, results.test.future)
        return np.stack([error[:, run == name].mean(axis=1) for name in np.unique(run)], axis=1)

    return {name: np.mean([by_step(path) for path in mine], axis=0) for name, mine in paths.items()}


@dataclass(frozen=True)
class Widths:
    """What B1 compares: widths in place of H, at the amounts of data at which every model has a band.

    physics : models with physics. rivals : whether they are the accurate and the inaccurate model. shares : of whole
    paths that the bands of each hold at the largest amount.
    """

    table: ErrorTable
    physics: tuple[str, ...]
    rivals: bool = False
    shares: tuple[float, ...] = ()


@dataclass(frozen=True)
class Promise:
    """What B2 judges: the share (S,) of models whose band of a level holds the path of a window, and its run (S,)."""

    held: Array
    run: NDArray[np.str_]
    level: float


def band_findings(results: Results, physics: Sequence[str], rivals: bool) -> list[ClaimVerdict]:
    """Verdicts on B1 and B2 for models with physics (none of them sees the test); undecided where none has a band.

    rivals : as in `Widths`.
    """
    if not results.complete:
        return leave_undecided(BAND_RULES, results.missing)
    level, run = results.plan.study.bands.level, results.test.run
    of = of_methods(results, [verdict_method(results.plan)])
    widths, held = {}, {}
    for row, by_level, apart in cell_regions(results, [level]):
        region, cell = by_level[level], str(row["cell"])
        widths[cell], held[cell] = results.by_run(region.radius.mean(axis=0)), region.holds(apart)
    errors, cells = error_table(results, physics), results.judged_cells
    cells = cells[cells["foundation"].isin(errors.H)]  # a model with a failed cell may have no band
    table = _width_table(errors, cells[~cells["N_D"].isin(cells["N_D"][~cells["cell"].isin(widths)])], widths)
    sound = tuple(name for name in physics if name in table.H and name in table.A)
    if not table.amounts or len(sound) < 2:
        return leave_undecided(BAND_RULES, f"no two models with physics{of} have a band of {level_text(level)}")
    cells = cells[(cells["N_D"] == table.amounts[-1]) & cells["foundation"].isin([*sound, NO_MODEL])]
    of_model = {str(name): [held[cell] for cell in mine] for name, mine in cells.groupby("foundation")["cell"]}
    new = uncalibrated_kinds(results, cells["cell"])
    like = np.array([results.kinds[str(name)] not in new for name in run])
    inside = np.mean([one for ones in of_model.values() for one in ones], axis=0)
    lost = counted_text(len(set(run[~like])), "test manoeuvre")
    left_out = f"no run of the kind {join_few_names(sorted(new))} calibrated them, so they promise nothing for {lost}"
    shares = tuple(coverage_share(np.mean(of_model[name], axis=0), run) for name in sound)
    compared = Widths(replace(table, A={name: table.A[name] for name in sound}), sound, rivals, shares)
    notes = [f"bands{of}" if of else "", too_few_manoeuvres(table.runs)]
    promise = Promise(inside[like], run[like], level)
    verdicts = judge_claims({"B1": BAND_RULES["B1"]}, compared, *notes)
    return verdicts + judge_claims({"B2": BAND_RULES["B2"]}, promise, left_out if new else "", *notes)


def _width_table(errors: ErrorTable, cells: pd.DataFrame, widths: Mapping[str, Array]) -> ErrorTable:
    """Widths [m] of cells by test manoeuvre in place of H."""
    amounts = tuple(N for N in errors.amounts if N in set(cells["N_D"]))
    H = {
        str(name): [np.array([widths[cell] for cell in mine["cell"][mine["N_D"] == N]]) for N in amounts]
        for name, mine in cells.sort_values("seed", kind="stable").groupby("foundation")
    }
    return replace(errors, amounts=amounts, H=H)


def _judge_widths(widths: Widths) -> Judgement:
    table, models, last = widths.table, widths.physics, len(widths.table.amounts) - 1
    shares = [percent_text(share) for share in (min(widths.shares), max(widths.shares))] if widths.shares else []
    hold = f"; these bands hold {least_to_greatest(*shares)} of whole paths" if shares else ""
    if widths.rivals:
        good, bad = sorted(models, key=lambda model: table.mean(model, PHYSICS_ONLY))
        wider = table.compare([[(1.0, bad, last), (-1.0, good, last)]])
        apart = all_significant(table.compare([[(1.0, bad, PHYSICS_ONLY), (-1.0, good, PHYSICS_ONLY)]]).above)
        evidence = (
            f"at N_D = {table.amounts[last]} the mean radius of the band is {table.metres(bad, last)} "
            f"for {bad}, {table.metres(good, last)} for {good}: {ratio_with_interval(wider)} times"
            f"{'' if apart else f'; {EQUAL_A}'}{hold}"
        )
        decided = verdict_of(apart and all_significant(wider.above), apart and any_significant(wider.below))
        return decided, evidence, {"ratio of widths": table.mean(bad, last) / table.mean(good, last)}
    trend = trend_over_accuracy(table, models)
    ends = [f"{difference_with_interval(trend.slopes, k)} at N_D = {table.amounts[k]}" for k in sorted({0, last})]
    evidence = (
        f"for twice the A the mean radius rises by {' and by '.join(ends)}; rank correlation of width and A "
        f"{trend.words}{hold}"
    )
    numbers = {"least rank correlation of width and A": trend.least}
    numbers |= {f"rise for twice the A at N_D = {table.amounts[last]} [m]": float(trend.slopes.mean[last])}
    return trend.verdict, evidence, numbers


def _judge_promise(promise: Promise) -> Judgement:
    if not len(promise.held):
        raise UndecidedClaim("bands promise nothing for any test manoeuvre")
    low, high = share_interval(promise.held, promise.run)
    share, sizes = coverage_share(promise.held, promise.run), np.unique(promise.run, return_counts=True)[1]
    few, level = too_few_manoeuvres(len(sizes)), promise.level
    interval = "" if few else f" [{percent_text(low)}, {percent_text(high)}]"
    each = "" if (sizes == sizes[0]).all() else ", each counts the same"
    hold = f"bands of {level_text(level)} hold {percent_text(share)}{interval} of whole paths"
    decided = "undecided" if few else verdict_of(low >= level - BROKEN_BY, high < level)
    return (
        decided,
        f"{hold} ({counted_text(len(sizes), 'test manoeuvre')}{each})",
        {f"share at {level_text(level)}": share},
    )


BAND_RULES: dict[str, ClaimRule] = {
    "B1": ClaimRule("more accurate physics gives a narrower band", _judge_widths),
    "B2": ClaimRule("bands hold the share of whole paths that they promise", _judge_promise),
}


def judge_findings(results: Results) -> list[ClaimVerdict]:
    """Verdicts on what the study claims: R1-R4 (method, section 5), S1-S7 (section 4), both or none; then B1-B2."""
    claims = results.plan.study.claims
    if claims is None or not (results.cells["status"] == "ok").any():
        return []
    rivals, simulated = claims.accurate is not None, claims.moderate is not None
    if not (rivals or simulated):
        return []
    rules = (FULL_SCALE_RULES if rivals else {}) | (SIMULATION_RULES if simulated else {}) | BAND_RULES
    if unfair := unfair_reason(results.plan, results.test.spans):
        return leave_undecided(rules, unfair)
    roles = (claims.moderate, claims.high) if simulated else (claims.accurate, claims.inaccurate)
    physics = [one.name for role in roles for one in results.plan.foundations if one.family == role]
    verdicts = full_scale_findings(results, (claims.accurate, claims.inaccurate)) if rivals else []
    verdicts += simulation_findings(results, (claims.moderate, claims.high)) if simulated else []
    return verdicts + band_findings(results, physics, not simulated)
