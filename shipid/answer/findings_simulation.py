"""Findings S1-S7 (method, section 4): verdicts on the map H(A, N_D) of a simulated study.

Rules and their error rates: docs/findings.md. Taken over the members of the moderate and the high family with a result
in every cell. "Shown" is a paired difference of logarithms, in S3 of metres, over test manoeuvres whose
95 % interval is free of 0 (`shipid.evidence`). The thresholds are free: the paper gives none.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shipid.answer.error_table import PHYSICS_ONLY, ErrorTable, ErrorTerm, error_table
from shipid.answer.verdict import (
    ClaimRule,
    ClaimVerdict,
    Judgement,
    UndecidedClaim,
    Verdict,
    difference_with_interval,
    judge_claims,
    least_to_greatest,
    leave_undecided,
    model_list,
    quoted_model,
    ratio_with_interval,
    stricter_list,
    too_few_manoeuvres,
    verdict_of,
    weakest_verdict,
)
from shipid.evidence import (
    FEWEST_MODELS,
    FEWEST_RUNS,
    SIGNIFICANT,
    SMALLEST_ERROR,
    Differences,
    all_significant,
    any_significant,
    doubling_weights,
    log_error,
    order_chance,
    paired_difference,
    partial_conjunction,
    which_significant,
)
from shipid.metrics import Array, path_roughness, rank_correlation
from shipid.report.wording import counted_text, join_few_names, metres_text
from shipid.study.declared import NO_MODEL
from shipid.study.plan import verdict_method
from shipid.study.results import Results
from shipid.units import percent_text, plural_word

FEWEST_ORDERS = 5  # S4: nested orders of runs that a fluctuation needs
ALIKE, UNLIKE = 0.95, 0.8  # S5
ROUGH = 1.5  # S7: times the roughness of the true paths


@dataclass(frozen=True)
class ErrorGrid:
    """The errors that S1-S6 judge, and which members belong to the moderate and the high family.

    by_90 : the same of H_90, for S5. results : what S7 takes the roughness of paths from.
    """

    table: ErrorTable
    moderate: tuple[str, ...]
    high: tuple[str, ...]
    by_90: ErrorTable
    results: Results | None = None

    @property
    def physics(self) -> tuple[str, ...]:
        """Members of both families."""
        return (*self.moderate, *self.high)


def simulation_findings(results: Results, families: Iterable[str | None]) -> list[ClaimVerdict]:
    """Verdicts on S1-S7; all undecided, with the reason, where the study is no evidence.

    families : the moderate and the high one.
    """
    cells = results.judged_cells
    pure = cells["status"][cells["model"] == NO_MODEL]
    lacks = {
        results.missing: not results.complete,
        f"{quoted_model(NO_MODEL)} has no result in every cell": pure.empty or pure.ne("ok").any(),
        "the findings are about a growing N_D, and the study has one": cells["N_D"].nunique() < 2,
    }
    if reason := next((words for words, lacking in lacks.items() if lacking), ""):
        return leave_undecided(SIMULATION_RULES, reason)
    names = [[one.name for one in results.plan.foundations if one.family == family] for family in families]
    every = [*names[0], *names[1]]
    known = [error_table(results, every, metric) for metric in ("H", "H_90")]
    by_mean, by_90 = (replace(one, A={name: A for name, A in one.A.items() if name in one.H}) for one in known)
    moderate, high = (tuple(name for name in family if name in by_mean.A) for family in names)
    lost = [name for name in every if name not in by_mean.A]
    if not (moderate and high):
        return leave_undecided(
            SIMULATION_RULES, f"of one family no model has a result in every cell: {model_list(lost)}"
        )
    left_out = f"left out for want of results: {model_list(lost)}" if lost else ""
    grid = ErrorGrid(by_mean, moderate, high, by_90, results)
    return judge_claims(SIMULATION_RULES, grid, too_few_manoeuvres(by_mean.runs), left_out)


def _ratio_range(differences: Differences) -> str:
    """The least and the greatest of some ratios, with their intervals."""
    ends = dict.fromkeys((int(differences.mean.argmin()), int(differences.mean.argmax())))
    return " to ".join(ratio_with_interval(differences, index) for index in ends)


def _judge_lead(grid: ErrorGrid) -> Judgement:
    moderate, amounts, table = grid.moderate, grid.table.amounts, grid.table
    count, most = len(moderate), len(moderate) // 2 + 1
    leads = [table.lead(NO_MODEL, moderate, place) for place in range(len(amounts))]
    begins = verdict_of(all_significant(leads[0].above), any_significant(leads[0].below))
    ahead = np.array([partial_conjunction(lead.above, most) for lead in leads])
    behind = np.array([partial_conjunction(lead.below, most) for lead in leads])
    keeps = verdict_of(all_significant(ahead), any_significant(behind))
    won = [int((lead.above <= SIGNIFICANT).sum()) for lead in leads]
    later = ", ".join(f"{number} at {N}" for number, N in zip(won[1:], amounts[1:], strict=True))
    evidence = (
        f"at N_D = {amounts[0]} {begins}: {won[0]} of {count} moderate models {plural_word(won[0], 'is', 'are')} shown "
        f"to beat no physics{stricter_list(moderate, leads[0].above)}, whose error of {table.metres(NO_MODEL, 0)} is "
        f"{_ratio_range(leads[0])} times theirs; that most keep the lead is {keeps}: {later}"
    )
    numbers = {f"share shown to lead at N_D = {amounts[k]}": won[k] / count for k in (0, -1)}
    return weakest_verdict((begins, keeps)), evidence, numbers


def _judge_fall(grid: ErrorGrid) -> Judgement:
    weights = -doubling_weights(np.log(np.array(grid.table.amounts, dtype=float)))
    models, (first, *_, last) = [*grid.physics, NO_MODEL], grid.table.amounts
    falls = grid.table.compare([[(float(w), model, k) for k, w in enumerate(weights)] for model in models])
    fallen = which_significant(falls.above)
    end = len(weights) - 1
    left = float(np.median([grid.table.mean(model, end) / grid.table.mean(model, 0) for model in models]))
    evidence = (
        f"H is shown to fall for {fallen.sum() or 'none'} of {len(models)} models; twice the runs divide it by "
        f"{_ratio_range(falls)}; N_D = {last} leaves {percent_text(left)} of the error at {first} in the median"
    )
    if not fallen.all():
        evidence += f"; not shown for: {model_list(m for m, good in zip(models, fallen, strict=True) if not good)}"
    numbers = {"share of models shown to fall": float(fallen.mean()), f"H at N_D = {last} / at {first}, median": left}
    return verdict_of(all_significant(falls.above), any_significant(falls.below)), evidence, numbers


@dataclass(frozen=True)
class AccuracyTrend:
    """How values rise along ln A over models.

    slopes : for twice the A at each N_D; where asked for, last, how much larger at the least N_D than at the largest.
    verdict : whether all are above 0, and hardly by chance. words, least : range of the rank correlations with A, the
    least.
    """

    slopes: Differences
    verdict: Verdict
    words: str
    least: float


def trend_over_accuracy(table: ErrorTable, models: Sequence[str], *, flattens: bool = False) -> AccuracyTrend:
    """Judge how the values of a table rise with A; flattens : whether they must rise most at the least N_D."""
    if len(models) < FEWEST_MODELS:
        raise UndecidedClaim(f"{len(models)} physics models, a trend needs {FEWEST_MODELS}")
    A = np.array([table.mean(model, PHYSICS_ONLY) for model in models])
    if np.isclose(A.min(), A.max()):
        raise UndecidedClaim("all physics models have the same A, so nothing can rise with it")
    weights, places = doubling_weights(np.log(A)), range(len(table.amounts))
    each = [[(float(w), model, k) for w, model in zip(weights, models, strict=True)] for k in places]
    order = np.array([[table.mean(model, k) for model in models] for k in places])
    rises = [rank_correlation(A, values) for values in order]
    if flattens:
        each.append([*each[0], *((-factor, model, place) for factor, model, place in each[-1])])
        order = np.vstack([order, order[0] - order[-1]])
    slopes = table.compare(each, logs=False)
    risen, fallen = np.maximum(slopes.above, order_chance(A, order)), np.maximum(slopes.below, order_chance(A, -order))
    words = f"{least_to_greatest(f'{min(rises):.2f}', f'{max(rises):.2f}')} over N_D ({len(A)} models)"
    return AccuracyTrend(slopes, verdict_of(all_significant(risen), any_significant(fallen)), words, min(rises))


def _judge_rise(grid: ErrorGrid) -> Judgement:
    trend, amounts = trend_over_accuracy(grid.table, grid.physics, flattens=True), grid.table.amounts
    at_first, at_last, less = (difference_with_interval(trend.slopes, k) for k in (0, len(amounts) - 1, len(amounts)))
    evidence = (
        f"for twice the A, H rises by {at_first} at N_D = {amounts[0]} and by {at_last} at {amounts[-1]}, "
        f"a difference of {less}; "
        f"rank correlation of H and A {trend.words}"
    )
    numbers = {"least rank correlation of H and A": trend.least}
    ends = (0, len(amounts) - 1)
    numbers |= {f"rise for twice the A at N_D = {amounts[k]} [m]": float(trend.slopes.mean[k]) for k in ends}
    return trend.verdict, evidence, numbers


def _judge_harm(grid: ErrorGrid) -> Judgement:
    high, table, place = grid.high, grid.table, len(grid.table.amounts) - 1
    lead = table.lead(NO_MODEL, high, place)
    better, worse = which_significant(lead.above), which_significant(lead.below)
    worst = [model for model, behind in zip(high, worse, strict=True) if behind]
    names = f" ({join_few_names([f'{model} {grid.table.metres(model, place)}' for model in worst])})" if worst else ""
    evidence = (
        f"at N_D = {grid.table.amounts[-1]}, {better.sum()} of {len(better)} high models "
        f"{plural_word(better.sum(), 'is', 'are')} shown to beat no physics ({grid.table.metres(NO_MODEL, place)}), "
        f"{len(worst)} {plural_word(len(worst), 'is', 'are')} shown to be worse{names}"
    )
    numbers = {
        f"share of high models shown to lead at N_D = {grid.table.amounts[-1]}": float(better.mean()),
        f"share of high models shown to be worse at N_D = {grid.table.amounts[-1]}": float(worse.mean()),
    }
    orders, moves = max(map(len, table.H[NO_MODEL])), verdict_of(False, False)
    if orders < FEWEST_ORDERS:
        lacks = f"fluctuation needs {FEWEST_ORDERS} nested orders (grid seeds), the study has"
        evidence += f"; {lacks} {orders} {plural_word(orders, 'seed')}"
    elif worst:
        of_worst, calm = (_fluctuation(table, group) for group in (worst, grid.moderate))
        more = paired_difference((of_worst - calm)[None])
        moves = verdict_of(any_significant(more.above), any_significant(more.below))
        evidence += (
            f"; over {orders} nested orders H of these varies by {percent_text(of_worst.mean())}, of moderate models "
            f"by {percent_text(calm.mean())}"
        )
        numbers |= {"variation of the worst": of_worst.mean(), "variation of moderate models": calm.mean()}
    one_sided = all_significant(lead.above) or all_significant(lead.below)
    return weakest_verdict((verdict_of(bool(better.any() and worse.any()), one_sided), moves)), evidence, numbers


def _fluctuation(table: ErrorTable, models: Sequence[str]) -> Array:
    """(seeds,) distance of H from its mean over seeds, relative to it, in the mean over amounts and models."""
    most = max(map(len, table.H[models[0]]))
    errors = [[one @ table.weights for one in table.H[model] if len(one) == most] for model in models]
    H = np.maximum(errors, SMALLEST_ERROR)
    return np.asarray(np.abs(H / H.mean(axis=2, keepdims=True) - 1).mean(axis=(0, 1)))


def _judge_metric(grid: ErrorGrid) -> Judgement:
    grids = (grid, replace(grid, table=grid.by_90))
    both = [np.concatenate([H @ one.table.weights for m in grid.table.H for H in one.table.H[m]]) for one in grids]
    alike = rank_correlation(*both)
    verdicts = {key: [SIMULATION_RULES[key].decide(one)[0] for one in grids] for key in FIRST_FOUR}
    changed = {key: pair for key, pair in verdicts.items() if pair[0] != pair[1]}
    opposite = any({"confirmed", "refuted"} <= set(pair) for pair in changed.values())
    words = [f"{key} is {by_90} instead of {by_mean}" for key, (by_mean, by_90) in changed.items()]
    evidence = (
        f"rank correlation of H and H_90 over {both[0].size} cells {alike:.3f}; by H_90 "
        f"{join_few_names(words) if words else 'S1-S4 are the same'}"
    )
    enough = grid.table.runs >= FEWEST_RUNS
    decided = verdict_of(enough and alike >= ALIKE and not opposite, enough and (opposite or alike < UNLIKE))
    numbers = {"rank correlation of H and H_90": alike, "verdicts of S1-S4 that differ": float(len(changed))}
    return decided, evidence, numbers


def _judge_savings(grid: ErrorGrid) -> Judgement:
    small = [k for k, amount in enumerate(grid.table.amounts) if amount <= grid.table.amounts[-1] / 2]
    if not small:
        raise UndecidedClaim(f"no N_D is at most half of the largest, {grid.table.amounts[-1]}")
    kinds = {
        "no physics with more runs": _pairs_with_more_data(grid, small),
        "more accurate physics alone": _pairs_with_better_physics(grid, small[-1]),
    }
    if not all(kinds.values()):
        raise UndecidedClaim("no physics model is more accurate than a moderate one")
    parts, examples, numbers = [], [], {}
    for what, pairs in kinds.items():
        texts, terms, also = zip(*pairs, strict=True)
        first, second = grid.table.compare(terms), grid.table.compare(also)
        chances = np.maximum(first.above, second.above)
        sure = [text for text, shown in zip(texts, which_significant(chances), strict=True) if shown]
        parts.append(verdict_of(bool(sure), all_significant(first.below)))
        text = f"{(chances <= SIGNIFICANT).sum()} of {len(pairs)} comparisons show a moderate model better than {what}"
        text += stricter_list(texts, chances, names=False)
        examples.append(text + (f", such as {sure[0]}" if sure else ""))
        numbers[f"share shown to beat {what}"] = len(sure) / len(pairs)
    return weakest_verdict(parts), "; ".join(examples), numbers


SavingPair = tuple[str, list[ErrorTerm], list[ErrorTerm]]
"""A moderate model against something dearer: the words, and two differences that must be shown."""


def _pairs_with_more_data(grid: ErrorGrid, small: Sequence[int]) -> list[SavingPair]:
    """Every moderate model with a small amount against no physics with the next larger one."""
    table, amounts = grid.table, grid.table.amounts
    return [
        (
            f"{model} with {amounts[k]} runs {table.metres(model, k)} against {amounts[k + 1]} runs without "
            f"physics, {table.metres(NO_MODEL, k + 1)}",
            [(1.0, NO_MODEL, k + 1), (-1.0, model, k)],
            [(1.0, NO_MODEL, k + 1), (-1.0, model, k)],
        )
        for model in grid.moderate
        for k in small
    ]


def _pairs_with_better_physics(grid: ErrorGrid, k: int) -> list[SavingPair]:
    """Every moderate model with the largest small amount against every more accurate physics alone."""
    table = grid.table
    return [
        (
            f"{model} ({table.metres(model, PHYSICS_ONLY)} alone) with {table.amounts[k]} runs "
            f"{table.metres(model, k)} against {other} alone, {table.metres(other, PHYSICS_ONLY)}",
            [(1.0, other, PHYSICS_ONLY), (-1.0, model, k)],
            [(1.0, model, PHYSICS_ONLY), (-1.0, other, PHYSICS_ONLY)],
        )
        for model in grid.moderate
        for other in grid.physics
        if table.mean(other, PHYSICS_ONLY) < table.mean(model, PHYSICS_ONLY)
    ]


def _judge_paths(grid: ErrorGrid) -> Judgement:
    physics, results = grid.physics, grid.results
    assert results is not None
    if results.test.horizon < 3:
        raise UndecidedClaim("a second difference needs three steps ahead")
    terms = next(way.method.traits.terms for way in results.plan.methods if way.name == verdict_method(results.plan))
    if terms is not None and terms < results.plan.study.prediction.horizon:
        evidence = "the compensation is a polynomial of time, which is smooth whatever it learned"
        return "not testable", f"{evidence}; 'path-trained' is not", {}
    cells, run = results.judged_cells, results.test.run
    cells = cells[cells["N_D"] == grid.table.amounts[0]]
    names = np.unique(run)

    def by_run(paths: Sequence[Array]) -> Array:
        by_path = [[path_roughness(path[:, run == name]) for name in names] for path in paths]
        return np.asarray(np.mean(by_path, axis=0))

    pure, together = (
        by_run([results.paths[cell] for model in models for cell in cells["cell"][cells["model"] == model]])
        for models in ([NO_MODEL], physics)
    )
    decided, numbers = compare_roughness(by_run([results.test.future]), pure, together, results.windows)
    rough, cooperative, true = (metres_text(value) for value in numbers.values())
    evidence = (
        f"at N_D = {grid.table.amounts[0]}: {quoted_model(NO_MODEL)} {rough}, cooperative {cooperative} in the mean, "
        f"true paths {true} ({counted_text(len(names), 'test manoeuvre')})"
    )
    return decided, evidence, numbers


def compare_roughness(true: Array, pure: Array, together: Array, counts: Array) -> tuple[Verdict, dict[str, float]]:
    """Verdict on S7 from the roughness (R,) [m] of true paths, those without physics and cooperative ones, by run."""
    pure_, true_, together_ = (log_error(values) for values in (pure, ROUGH * true, together))
    differences = paired_difference(np.stack([pure_ - true_, true_ - together_]))
    of = {"no physics": pure, "cooperative models": together, "true paths": true}
    numbers = {f"roughness of {what} [m]": float(values @ counts / counts.sum()) for what, values in of.items()}
    return verdict_of(all_significant(differences.above), any_significant(differences.below)), numbers


FIRST_FOUR = ("S1", "S2", "S3", "S4")
SIMULATION_RULES: dict[str, ClaimRule] = {
    "S1": ClaimRule(
        "every moderate cooperative model beats no physics at the smallest N_D, and most keep the lead", _judge_lead
    ),
    "S2": ClaimRule("H falls with N_D for every model", _judge_fall),
    "S3": ClaimRule("H rises with A at fixed N_D, most steeply at small N_D", _judge_rise),
    "S4": ClaimRule(
        "some high models beat no physics; the worst stay worse even at the largest N_D, and fluctuate", _judge_harm
    ),
    "S5": ClaimRule("H_90 leads to the same findings as H", _judge_metric),
    "S6": ClaimRule(
        "moderate models with small N_D beat no physics with a larger one, and more accurate physics alone",
        _judge_savings,
    ),
    "S7": ClaimRule("paths without physics are rough at small N_D, those of cooperative models are not", _judge_paths),
}
