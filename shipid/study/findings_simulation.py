"""Findings S1-S7 (method, section 4): verdicts on the map H(A, N_D) of a simulated study.

All are taken over the members of the moderate and the high family that have a result in every cell; a member that
failed anywhere is left out and named. The unit of evidence is the test manoeuvre: "shown" means a paired difference
whose 95 % interval over test manoeuvres is free of 0 (`shipid.study.evidence`). A claim about all needs each of its
differences shown; a claim about some, and a list of names, is corrected for how many could have been (Holm). A finding
is confirmed if it is shown, refuted if its opposite is shown, else undecided: too few manoeuvres decide nothing.

S1 : every moderate member has a lower H than no physics at the smallest N_D, and more than half of them have it
    at every N_D.
S2 : for every model, no physics included, H falls along ln N_D (slope by least squares over all N_D).
S3 : at every N_D H rises along ln A over the physics models, and it rises more steeply at the smallest N_D than at the
    largest; and neither the rise nor its fall would come by chance if the models had their A in any other order.
S4 : at the largest N_D at least one high member is better than no physics and at least one is worse; and over the
    seeds, each another nested order of runs, H of those that are worse varies more than that of the moderate members.
    Never decided with fewer than five seeds.
S5 : the rank correlation of H and H_90 over cells is at least 0.95 and H_90 turns none of S1-S4 round; refuted if it is
    below 0.8 or H_90 confirms what H refutes, or the other way round. Undecided with too few manoeuvres, as all are.
S6 : a moderate member with a small N_D (at most half of the largest) is better than no physics with the next
    larger one, and one is better than physics alone that is more accurate than its physics.
S7 : at the smallest N_D the roughness of paths without physics is more than 1.5 times that of the true paths, and that
    of the cooperative models, in the mean, is less. Not testable where the compensation is a polynomial of time.

The thresholds are free: the paper gives none. Error rates of every rule: docs/findings.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from shipid.hybrid.method import Method
from shipid.metrics import rank_correlation, roughness
from shipid.report.wording import listed
from shipid.study.declared import NO_MODEL
from shipid.study.error_table import ALONE, PLAIN, ErrorTable, Metric, error_table
from shipid.study.evidence import (
    FEWEST_MODELS,
    FEWEST_RUNS,
    SIGNIFICANT,
    Contrasts,
    at_least,
    by_chance,
    contrasts,
    doubling,
)
from shipid.study.plan import judged_method
from shipid.study.results import Results, judged_cells
from shipid.study.verdict import (
    SAME_A,
    Finding,
    Verdict,
    every,
    finding,
    manoeuvres,
    measured,
    metres,
    named,
    shown,
    some,
    span,
    too_few,
    undecided,
    verdict,
    weakest,
    words,
)
from shipid.units import percent, plural

Array = NDArray[np.float64]
CLAIMS = {
    "S1": "every moderate cooperative model beats no physics at the smallest N_D, and most keep the lead",
    "S2": "H falls with N_D for every model",
    "S3": "H rises with A at fixed N_D, most steeply at small N_D",
    "S4": "some high models beat no physics; the worst stay worse even at the largest N_D, and fluctuate",
    "S5": "H_90 leads to the same findings as H",
    "S6": "moderate models with small N_D beat no physics with a larger one, and more accurate physics alone",
    "S7": "paths without physics are rough at small N_D, those of cooperative models are not",
}
FEWEST_ORDERS = 5  # S4: nested orders of runs that a fluctuation needs
ALIKE, UNLIKE = 0.95, 0.8  # S5
ROUGH = 1.5  # S7: times the roughness of the true paths
MOST_PAIRS = 2  # S6: of each kind, in words


@dataclass(frozen=True)
class Grid:
    """The errors that S1-S6 judge, and which members belong to the moderate and the high family."""

    table: ErrorTable
    moderate: tuple[str, ...]
    high: tuple[str, ...]
    left_out: tuple[str, ...] = ()

    @property
    def physics(self) -> tuple[str, ...]:
        """Members of both families."""
        return (*self.moderate, *self.high)

    @property
    def amounts(self) -> tuple[int, ...]:
        """N_D, rising."""
        return self.table.amounts

    def value(self, model: str, place: int) -> str:
        """H of a model, in words."""
        return metres(self.table.mean(model, place))


def simulation_findings(results: Results) -> list[Finding]:
    """Verdicts on S1-S7; all undecided, with the reason, where the study is no evidence."""
    H, H_90 = read_grid(results, "H"), read_grid(results, "H_90")
    if isinstance(H, str) or isinstance(H_90, str):
        return undecided(CLAIMS, str(H))
    verdicts = [*judged(H, H_90), _S7(results, H)]
    few, left_out = too_few(H.table.runs), named(H.left_out)
    notes = [*([few] if few else []), *([f"left out for want of results: {left_out}"] if left_out else [])]
    return [Finding(**{**one, "evidence": "; ".join([one["evidence"], *notes])}) for one in verdicts]


def judged(H: Grid, H_90: Grid) -> list[Finding]:
    """Verdicts on S1-S6 from tables of both metrics."""
    by_H, by_H_90 = ([RULES[key](grid) for key in ("S1", "S2", "S3", "S4")] for grid in (H, H_90))
    return [*by_H, _S5(H, H_90, by_H, by_H_90), RULES["S6"](H)]


def read_grid(results: Results, metric: Metric) -> Grid | str:
    """H or H_90 of a finished study as a grid, or the reason why there is none."""
    claims, cells = results.plan.study.claims, judged_cells(results)
    assert claims is not None
    if not results.complete:
        return results.missing
    if NO_MODEL not in set(cells["model"]):
        return f"the method {judged_method(results.plan)!r} is not run without physics"
    failed = set(cells["model"][cells["status"] != "ok"])
    if NO_MODEL in failed:
        return f"{words(NO_MODEL)} has no result in every cell"
    if cells["N_D"].nunique() < 2:
        return "the findings are about a growing N_D, and the study has one"
    members = {
        family: [one.name for one in results.plan.foundations if one.family == family]
        for family in (claims.moderate, claims.high)
    }
    table = error_table(results, [name for names in members.values() for name in names], metric)
    sound = {
        family: tuple(name for name in names if name in table.H and name in table.A)
        for family, names in members.items()
    }
    left_out = tuple(name for names in members.values() for name in names if name not in table.H or name not in table.A)
    kept = (*sound[claims.moderate], *sound[claims.high])
    table = replace(table, A={name: table.A[name] for name in kept})
    return Grid(table, sound[claims.moderate], sound[claims.high], left_out)


def _without(key: str, what: str) -> Finding:
    return finding(CLAIMS, key, "undecided", f"no {what} model has a result in every cell")


def _range(differences: Contrasts) -> str:
    """The least and the greatest of some differences, with their intervals."""
    least, most = int(differences.mean.argmin()), int(differences.mean.argmax())
    return measured(differences, least) + (f" to {measured(differences, most)}" if least != most else "")


def _S1(grid: Grid) -> Finding:
    if not grid.moderate:
        return _without("S1", "moderate")
    count, amounts, table = len(grid.moderate), grid.amounts, grid.table
    leads = [table.against(NO_MODEL, grid.moderate, place) for place in range(len(amounts))]
    begins = verdict(every(leads[0].above), some(leads[0].below))
    most = count // 2 + 1
    ahead, behind = (np.array([at_least(side, most) for side in sides]) for sides in _sides(leads))
    keeps = verdict(every(ahead), some(behind))
    won = [int(shown(lead.above).sum()) for lead in leads]
    plain = ""
    if PLAIN in table.H:
        over_plain = shown(table.against(PLAIN, grid.moderate, 0).above).sum()
        plain = f" ({over_plain} of {count} beat networks without mirror symmetry, {metres(table.mean(PLAIN, 0))})"
    evidence = (
        f"at N_D = {amounts[0]} {begins}: {won[0]} of {count} moderate models {plural(won[0], 'is', 'are')} shown to "
        f"beat no physics ({grid.value(NO_MODEL, 0)}), whose H less theirs is {_range(leads[0])}{plain}; "
        f"that most keep the lead is {keeps}: "
        f"{', '.join(f'{number} at {N}' for number, N in zip(won[1:], amounts[1:], strict=True))}"
    )
    numbers = {
        f"share shown to lead at N_D = {N}": number / count
        for number, N in ((won[0], amounts[0]), (won[-1], amounts[-1]))
    }
    return finding(CLAIMS, "S1", weakest((begins, keeps)), evidence, **numbers)


def _sides(differences: Sequence[Contrasts]) -> tuple[list[Array], list[Array]]:
    return [one.above for one in differences], [one.below for one in differences]


def _S2(grid: Grid) -> Finding:
    weights = -doubling(np.log(np.array(grid.amounts, dtype=float)))
    models = [*grid.physics, NO_MODEL]
    places = range(len(grid.amounts))
    falls = grid.table.compare([[(float(weights[k]), model, k) for k in places] for model in models])
    fallen = shown(falls.above)
    left = float(np.median([grid.table.mean(model, places[-1]) / grid.table.mean(model, 0) for model in models]))
    shown_for = f"{fallen.sum()} of {len(models)}" if fallen.any() else f"none of {len(models)}"
    evidence = (
        f"H is shown to fall for {shown_for} models; twice the runs lower it by {_range(falls)}; "
        f"N_D = {grid.amounts[-1]} leaves {percent(left)} of the error at {grid.amounts[0]} in the median"
    )
    if not fallen.all():
        evidence += f"; not shown for: {named(m for m, good in zip(models, fallen, strict=True) if not good)}"
    return finding(
        CLAIMS,
        "S2",
        verdict(every(falls.above), some(falls.below)),
        evidence,
        **{
            "share of models shown to fall": float(fallen.mean()),
            f"H at N_D = {grid.amounts[-1]:g} / at {grid.amounts[0]:g}, median": left,
        },
    )


def _S3(grid: Grid) -> Finding:
    models, table = grid.physics, grid.table
    if len(models) < FEWEST_MODELS:
        return finding(CLAIMS, "S3", "undecided", f"{len(models)} physics models, a trend needs {FEWEST_MODELS}")
    A = np.array([table.mean(model, ALONE) for model in models])
    if np.isclose(A.min(), A.max()):
        return finding(CLAIMS, "S3", "undecided", SAME_A)
    weights = doubling(np.log(A))
    each = [[(float(w), m, k) for w, m in zip(weights, models, strict=True)] for k in range(len(grid.amounts))]
    last = len(grid.amounts) - 1
    flatter = [*each[0], *((-factor, model, last) for factor, model, _ in each[last])]
    slopes = table.compare([*each, flatter])
    H = np.array([[table.mean(model, k) for model in models] for k in range(len(grid.amounts))])
    order = np.vstack([H, H[0] - H[last]])
    rises = [rank_correlation(A, values) for values in H]
    evidence = (
        f"for twice the A, H rises by {measured(slopes, 0)} at N_D = {grid.amounts[0]} and by {measured(slopes, last)} "
        f"at {grid.amounts[last]}, {measured(slopes, len(each))} less; rank correlation of H and A "
        f"{span(f'{min(rises):.2f}', f'{max(rises):.2f}')} over N_D ({len(A)} models)"
    )
    numbers = {
        "least rank correlation of H and A": min(rises),
        f"rise for twice the A at N_D = {grid.amounts[0]} [m]": float(slopes.mean[0]),
        f"rise for twice the A at N_D = {grid.amounts[last]} [m]": float(slopes.mean[last]),
    }
    risen = np.maximum(slopes.above, by_chance(A, order))
    fallen = np.maximum(slopes.below, by_chance(A, -order))
    return finding(CLAIMS, "S3", verdict(every(risen), some(fallen)), evidence, **numbers)


def _S4(grid: Grid) -> Finding:
    if not grid.high:
        return _without("S4", "high")
    table, last = grid.table, grid.amounts[-1]
    place = len(grid.amounts) - 1
    lead = table.against(NO_MODEL, grid.high, place)
    better, worse = shown(lead.above), shown(lead.below)
    worst = [model for model, behind in zip(grid.high, worse, strict=True) if behind]
    orders = table.H[NO_MODEL].shape[1]
    names = listed([f"{model} {grid.value(model, place)}" for model in worst]) if worst else ""
    are = plural(len(worst), "is", "are")
    evidence = (
        f"at N_D = {last}, {better.sum()} of {len(better)} high models {plural(better.sum(), 'is', 'are')} shown to "
        f"beat no physics ({grid.value(NO_MODEL, place)}), {len(worst)} {are} shown to be worse"
        f"{f' ({names})' if names else ''}"
    )
    numbers = {
        f"share of high models shown to lead at N_D = {last}": float(better.mean()),
        f"share of high models shown to be worse at N_D = {last}": float(worse.mean()),
    }
    if orders < FEWEST_ORDERS:
        seeds = f"{orders} {plural(orders, 'seed')}"
        evidence += f"; fluctuation needs {FEWEST_ORDERS} nested orders (grid seeds), the study has {seeds}"
        return finding(CLAIMS, "S4", "undecided", evidence, **numbers)
    if not grid.moderate:
        evidence += "; no moderate model to compare their fluctuation with"
        return finding(CLAIMS, "S4", "undecided", evidence, **numbers)
    one_sided = every(lead.above) or every(lead.below)
    moves: Verdict = "undecided"
    if worst:
        worst_moves, calm = (_fluctuation(table, group) for group in (worst, grid.moderate))
        chance = _student(worst_moves - calm)
        moves = verdict(chance <= SIGNIFICANT, 1 - chance <= SIGNIFICANT)
        evidence += (
            f"; over {orders} nested orders H of these varies by {percent(worst_moves.mean())}, of moderate models by "
            f"{percent(calm.mean())}"
        )
        numbers |= {"variation of the worst": worst_moves.mean(), "variation of moderate models": calm.mean()}
    split = verdict(bool(better.any() and worse.any()), one_sided)
    return finding(CLAIMS, "S4", weakest((split, moves)), evidence, **numbers)


def _fluctuation(table: ErrorTable, models: Sequence[str]) -> Array:
    """(seeds,) distance of H from its mean over seeds, relative to it, in the mean over amounts and models."""
    H = np.array([table.H[model] @ table.weights for model in models])
    moved: Array = np.abs(H / H.mean(axis=2, keepdims=True) - 1).mean(axis=(0, 1))
    return moved


def _student(values: Array) -> float:
    """Chance of a mean as far above 0 if there were none (Student's t, one-sided)."""
    spread = values.std(ddof=1) / len(values) ** 0.5
    return float(stdtr(len(values) - 1, -values.mean() / spread)) if spread > 0 else float(values.mean() <= 0)


def _S5(H: Grid, H_90: Grid, by_H: list[Finding], by_H_90: list[Finding]) -> Finding:
    both = [np.concatenate([grid.table.H[m] @ grid.table.weights for m in grid.table.H]).ravel() for grid in (H, H_90)]
    alike = rank_correlation(*both)
    changed = [
        (one["id"], one["verdict"], other["verdict"])
        for one, other in zip(by_H, by_H_90, strict=True)
        if one["verdict"] != other["verdict"]
    ]
    opposite = any({"confirmed", "refuted"} <= set(change) for change in changed)
    evidence = f"rank correlation of H and H_90 over {both[0].size} cells {alike:.3f}; by H_90 "
    said = [f"{key} is {other} instead of {one}" for key, one, other in changed]
    evidence += listed(said) if said else "S1-S4 are the same"
    decided = verdict(alike >= ALIKE and not opposite, opposite or alike < UNLIKE)
    numbers = {"rank correlation of H and H_90": alike, "verdicts of S1-S4 that differ": float(len(changed))}
    return finding(CLAIMS, "S5", decided if H.table.runs >= FEWEST_RUNS else "undecided", evidence, **numbers)


@dataclass(frozen=True)
class Pair:
    """A moderate model against something dearer: its difference, how much is saved, and the words."""

    terms: tuple[tuple[float, str, int], ...]
    saved: float
    text: str
    also: tuple[tuple[float, str, int], ...] = ()  # a second difference that must be shown, too


def _S6(grid: Grid) -> Finding:
    if not grid.moderate:
        return _without("S6", "moderate")
    if len(grid.physics) < 2:
        return finding(CLAIMS, "S6", "undecided", "one physics model: there is no other to compare it with")
    small = [k for k, amount in enumerate(grid.amounts) if amount <= grid.amounts[-1] / 2]
    if not small:
        return finding(CLAIMS, "S6", "undecided", f"no N_D is at most half of the largest, {grid.amounts[-1]}")
    kinds: list[tuple[str, Callable[[Grid, Sequence[int]], list[Pair]]]] = [
        ("no physics with more runs", _more_data),
        ("more accurate physics alone", _better_physics),
    ]
    parts, examples, numbers = [], [], {}
    for what, pairs_of in kinds:
        pairs = pairs_of(grid, small)
        if not pairs:
            return finding(CLAIMS, "S6", "undecided", "no physics model is more accurate than a moderate one")
        first = grid.table.compare([pair.terms for pair in pairs])
        above, below = first.above, first.below
        if pairs[0].also:
            second = grid.table.compare([pair.also for pair in pairs])
            above = np.maximum(above, second.above)
        sure = [pair for pair, good in zip(pairs, shown(above), strict=True) if good]
        best = sorted(sure, key=lambda pair: -pair.saved)[:MOST_PAIRS]
        parts.append(verdict(bool(sure), every(below)))
        examples.append(f"{len(sure)} of {len(pairs)} comparisons show a moderate model better than {what}")
        examples[-1] += f": {', '.join(pair.text for pair in best)}" if best else ""
        numbers[f"share shown to beat {what}"] = len(sure) / len(pairs)
    return finding(CLAIMS, "S6", weakest(parts), "; ".join(examples), **numbers)


def _more_data(grid: Grid, small: Sequence[int]) -> list[Pair]:
    """Every moderate model with a small amount against no physics with the next larger one."""
    return [
        Pair(
            ((1.0, NO_MODEL, k + 1), (-1.0, model, k)),
            grid.amounts[k + 1] / grid.amounts[k] - grid.table.mean(model, k) / grid.table.mean(NO_MODEL, k + 1),
            f"{model} with {grid.amounts[k]} runs {grid.value(model, k)} against {grid.amounts[k + 1]} runs without "
            f"physics, {grid.value(NO_MODEL, k + 1)}",
        )
        for model in grid.moderate
        for k in small
    ]


def _better_physics(grid: Grid, small: Sequence[int]) -> list[Pair]:
    """Every moderate model with the largest small amount against every more accurate physics alone."""
    table, k = grid.table, small[-1]
    return [
        Pair(
            ((1.0, other, ALONE), (-1.0, model, k)),
            table.mean(model, ALONE) / table.mean(other, ALONE),
            f"{model} ({metres(table.mean(model, ALONE))} alone) with {grid.amounts[k]} runs {grid.value(model, k)} "
            f"against {other} alone, {metres(table.mean(other, ALONE))}",
            ((1.0, model, ALONE), (-1.0, other, ALONE)),
        )
        for model in grid.moderate
        for other in grid.physics
        if table.mean(other, ALONE) < table.mean(model, ALONE)
    ]


RULES: Mapping[str, Callable[[Grid], Finding]] = {"S1": _S1, "S2": _S2, "S3": _S3, "S4": _S4, "S6": _S6}
"""The rules that judge one table."""


def smooth_by_construction(method: Method, steps: int) -> bool:
    """Whether the compensation of a method is a polynomial of time with fewer terms than steps."""
    terms = method.traits.terms
    return terms is not None and terms < steps


def _S7(results: Results, grid: Grid) -> Finding:
    if not grid.physics:
        return _without("S7", "physics")
    if results.test.horizon < 3:
        return finding(CLAIMS, "S7", "undecided", "a second difference needs three steps ahead")
    judged = next(way.method for way in results.plan.methods if way.name == judged_method(results.plan))
    if smooth_by_construction(judged, results.plan.study.prediction.horizon):
        evidence = (
            "the compensation is a polynomial of time, which is smooth whatever it learned; 'path-trained' is not"
        )
        return finding(CLAIMS, "S7", "not testable", evidence)
    first = grid.amounts[0]
    cells = judged_cells(results)
    cells = cells[cells["N_D"] == first]
    runs, place, counts = np.unique(results.test.run, return_inverse=True, return_counts=True)

    def by_run(path: Array) -> Array:
        return np.array([roughness(path[:, place == k]) for k in range(len(runs))])

    paths: Mapping[str, list[Array]] = {
        model: [by_run(results.paths[cell]) for cell in cells["cell"][cells["model"] == model]]
        for model in (NO_MODEL, *grid.physics)
    }
    true, pure = by_run(results.test.future), np.mean(paths[NO_MODEL], axis=0)
    together = np.mean([values for model in grid.physics for values in paths[model]], axis=0)
    decided, numbers = rough(true, pure, together, counts.astype(float))
    evidence = (
        f"at N_D = {first}: {words(NO_MODEL)} {metres(numbers['roughness of no physics [m]'])}, cooperative "
        f"{metres(numbers['roughness of cooperative models [m]'])} in the mean, true paths "
        f"{metres(numbers['roughness of true paths [m]'])} ({manoeuvres(len(runs))})"
    )
    return finding(CLAIMS, "S7", decided, evidence, **numbers)


def rough(true: Array, pure: Array, together: Array, counts: Array) -> tuple[Verdict, dict[str, float]]:
    """Verdict on S7 from the roughness (R,) [m] of true paths, those without physics and cooperative ones, by run."""
    differences = contrasts(np.stack([pure - ROUGH * true, ROUGH * true - together]), counts)
    share = counts / counts.sum()
    numbers = {
        "roughness of no physics [m]": float(pure @ share),
        "roughness of cooperative models [m]": float(together @ share),
        "roughness of true paths [m]": float(true @ share),
    }
    return verdict(every(differences.above), some(differences.below)), numbers
