"""Findings S1-S7 (method, section 4): verdicts on the map H(A, N_D) of a simulated study.

All are taken over the members of the moderate and the high family that have a result in every cell; a member that
failed anywhere is left out and named. Unless said otherwise a finding is a condition on H(model, N_D): confirmed if it
holds for the mean over seeds and for every seed, undecided if only for the mean, else refuted.

S1 : every moderate member has a lower H than pure data-driven at the smallest N_D, and more than half of them have it
    at every N_D.
S2 : for every model, pure data-driven included, the rank correlation of H and N_D is at most -0.5 and H is lower at
    the largest N_D than at the smallest; refuted only if H is not lower there, for the mean over seeds.
S3 : at every N_D the rank correlation of H and A over physics models is at least 0.5; the median slope of H over A
    [m/m] is positive at the smallest N_D and lower at the largest, and its rank correlation with N_D is at most -0.5;
    refuted only if, for the mean over seeds, H does not rise with A at some N_D or the slope does not fall.
S4 : at the largest N_D at least one high member beats pure data-driven and at least one does not; and H of those that
    do not varies more, as standard deviation over seeds by mean, averaged over N_D, than that of the moderate members
    in the median. Never decided with fewer than five seeds: each is another nested order of runs.
S5 : the rank correlation of H and H_90 over cells is at least 0.95 and H_90 gives S1-S4 the same verdicts; refuted if
    it is below 0.8 or H_90 turns a confirmed finding into a refuted one, or the other way round.
S6 : a moderate member with a small N_D (at most half of the largest) beats pure data-driven with a larger one, and one
    beats physics alone that is more accurate than that member's physics. Confirmed if a pair of each kind holds in
    every seed, undecided if only for the mean, else refuted.
S7 : at the smallest N_D the roughness of pure data-driven paths is more than 1.5 times that of the true paths, and
    that of the cooperative models in the median is not.

The thresholds are free: the paper gives none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.metrics import median_slope, rank_correlation, roughness
from shipid.study.plan import NO_MODEL
from shipid.study.results import Results, judged_cells
from shipid.study.verdict import Finding, Verdict, interval, metres, named, undecided, verdict

Array = NDArray[np.float64]
Condition = Callable[[Mapping[str, Array]], bool]  # on H: model -> (amounts,)
CLAIMS = {
    "S1": "every moderate cooperative model beats pure data-driven at the smallest N_D, and most keep the lead",
    "S2": "H falls with N_D for every model",
    "S3": "H rises with A at fixed N_D, most steeply at small N_D",
    "S4": "some high models beat pure data-driven; the worst stay worse even at the largest N_D, and fluctuate",
    "S5": "H_90 tells the same story as H",
    "S6": "moderate models with small N_D beat pure data-driven with a larger one, and more accurate physics alone",
    "S7": "paths of pure data-driven at small N_D are rough, those of cooperative models are not",
}
TREND = 0.5  # S2, S3: rank correlation from which something rises or falls
TOLERANCE = 0.05  # S2: a step that rises by less is counted apart
FEWEST_MODELS = 4  # S3: fewer points are no trend
FEWEST_ORDERS = 5  # S4: nested orders of runs that a fluctuation needs
ALIKE, UNLIKE = 0.95, 0.8  # S5
ROUGH = 1.5  # S7: times the roughness of the true paths
MOST_PAIRS = 2  # S6: of each kind, in words


@dataclass(frozen=True)
class Grid:
    """H or H_90 [m] of one study: model -> (amounts, seeds), for members that have a result in every cell."""

    amounts: tuple[int, ...]
    seeds: tuple[int, ...]
    moderate: tuple[str, ...]
    high: tuple[str, ...]
    A: Mapping[str, float]
    H: Mapping[str, Array]
    left_out: tuple[str, ...]

    @property
    def physics(self) -> tuple[str, ...]:
        """Members of both families."""
        return (*self.moderate, *self.high)

    @property
    def mean(self) -> dict[str, Array]:
        """Model -> (amounts,), mean over seeds."""
        return {model: values.mean(axis=1) for model, values in self.H.items()}

    def judge(self, holds: Condition, weakly: Condition | None = None) -> Verdict:
        """Verdict on a condition, asked of the mean over seeds and of each seed; refuted where `weakly` fails too."""
        on_average = holds(self.mean)
        each = ({model: values[:, k] for model, values in self.H.items()} for k in range(len(self.seeds)))
        return verdict(on_average and all(holds(one) for one in each), (weakly or holds)(self.mean))

    def value(self, model: str, amount: int) -> str:
        """H of a model at the amount of this place, with its range over seeds."""
        values = self.H[model][amount]
        return metres(values.mean()) + interval(values.min(), values.max(), len(values))


def simulation_findings(results: Results) -> list[Finding]:
    """Verdicts on S1-S7; all undecided where the study cannot tell, with the reason."""
    H, H_90 = read_grid(results, "H"), read_grid(results, "H_90")
    if isinstance(H, str) or isinstance(H_90, str):
        return undecided(CLAIMS, str(H))
    four = (_S1, _S2, _S3, _S4)
    by_H, by_H_90 = [judged(H) for judged in four], [judged(H_90) for judged in four]
    found = [*by_H, _S5(H, H_90, by_H, by_H_90), _S6(H), _S7(results, H)]
    if not H.left_out:
        return found
    left_out = f"; left out for want of results: {named(H.left_out)}"
    return [Finding(**{**finding, "evidence": finding["evidence"] + left_out}) for finding in found]


def read_grid(results: Results, metric: str) -> Grid | str:
    """H or H_90 of a finished study as a grid, or the reason why there is none."""
    claims, cells = results.plan.study.claims, judged_cells(results)
    assert claims is not None
    if not results.complete:
        return f"{results.plan.cells - len(results.cells)} of {results.plan.cells} cells are not finished"
    failed = set(cells["model"][cells["status"] != "ok"])
    if NO_MODEL in failed:
        return "pure data-driven has no result in every cell"
    amounts, seeds = tuple(sorted(set(cells["N_D"]))), tuple(sorted(set(cells["seed"])))
    if len(amounts) < 2:
        return "the findings are about a growing N_D, and the study has one"
    members = {
        family: [one.name for one in results.plan.foundations if one.family == family]
        for family in (claims.moderate, claims.high)
    }
    sound = {family: tuple(name for name in names if name not in failed) for family, names in members.items()}
    moderate, high = sound[claims.moderate], sound[claims.high]
    wide = cells.set_index(["model", "N_D", "seed"])[metric].unstack("seed")
    return Grid(
        amounts=tuple(int(amount) for amount in amounts),
        seeds=tuple(int(seed) for seed in seeds),
        moderate=moderate,
        high=high,
        A={str(model): float(A) for model, A in cells.groupby("model")["A"].mean().items() if model != NO_MODEL},
        H={model: wide.loc[model].to_numpy(dtype=float) for model in (*moderate, *high, NO_MODEL)},
        left_out=tuple(name for names in members.values() for name in names if name in failed),
    )


def _finding(key: str, found: Verdict, evidence: str, **numbers: float) -> Finding:
    return Finding(id=key, claim=CLAIMS[key], verdict=found, evidence=evidence, numbers=numbers)


def _without(key: str, what: str) -> Finding:
    return _finding(key, "undecided", f"no {what} model has a result in every cell")


def _lead(H: Mapping[str, Array], members: tuple[str, ...]) -> Array:
    """(members, amounts): whether a member has a lower H than pure data-driven."""
    return np.array([H[model] < H[NO_MODEL] for model in members])


def _S1(grid: Grid) -> Finding:
    if not grid.moderate:
        return _without("S1", "moderate")

    def holds(H: Mapping[str, Array]) -> bool:
        lead = _lead(H, grid.moderate)
        return bool(lead[:, 0].all() and lead.all(axis=1).mean() > 0.5)

    lead, count, first, last = _lead(grid.mean, grid.moderate), len(grid.moderate), grid.amounts[0], grid.amounts[-1]
    at_first = [grid.mean[model][0] for model in grid.moderate]
    evidence = (
        f"at N_D = {first}, {lead[:, 0].sum()} of {count} moderate models ({metres(min(at_first))} to "
        f"{metres(max(at_first))}) beat pure data-driven ({grid.value(NO_MODEL, 0)}); "
        f"{lead.all(axis=1).sum()} of {count} lead at every N_D, {lead[:, -1].sum()} of {count} at {last}"
    )
    numbers = {
        f"share in the lead at N_D = {first}": lead[:, 0].mean(),
        "share in the lead at every N_D": lead.all(axis=1).mean(),
        f"share in the lead at N_D = {last}": lead[:, -1].mean(),
    }
    return _finding("S1", grid.judge(holds), evidence, **numbers)


def _S2(grid: Grid) -> Finding:
    amounts = np.array(grid.amounts, dtype=float)

    def falls(H: Array) -> bool:
        return rank_correlation(amounts, H) <= -TREND and H[-1] < H[0]

    means = grid.mean
    trends = {model: rank_correlation(amounts, H) for model, H in means.items()}
    fallen = [model for model, H in means.items() if falls(H)]
    left = float(np.median([H[-1] / H[0] for H in means.values()]))
    steps = np.array([H[1:] / H[:-1] for H in means.values()])
    evidence = (
        f"{len(fallen)} of {len(means)} models fall from N_D = {amounts[0]:g} to {amounts[-1]:g}, to {left:.0%} in the "
        f"median (rank correlation {min(trends.values()):.2f} to {max(trends.values()):.2f}); {(steps < 1).sum()} of "
        f"{steps.size} steps fall, {(steps > 1 + TOLERANCE).sum()} rise by more than {TOLERANCE:.0%}"
    )
    if len(fallen) < len(means):
        evidence += f"; not: {named(model for model in means if model not in fallen)}"
    return _finding(
        "S2",
        grid.judge(
            lambda H: all(falls(values) for values in H.values()),
            weakly=lambda H: all(bool(values[-1] < values[0]) for values in H.values()),
        ),
        evidence,
        **{
            "share of models that fall": len(fallen) / len(means),
            "share of steps that fall": float((steps < 1).mean()),
            f"H at N_D = {amounts[-1]:g} / at {amounts[0]:g}, median": left,
        },
    )


def _S3(grid: Grid) -> Finding:
    if len(grid.physics) < FEWEST_MODELS:
        return _finding("S3", "undecided", f"{len(grid.physics)} physics models, a trend needs {FEWEST_MODELS}")
    A, amounts = np.array([grid.A[model] for model in grid.physics]), np.array(grid.amounts, dtype=float)

    def trends(H: Mapping[str, Array]) -> tuple[Array, Array]:
        columns = np.array([H[model] for model in grid.physics]).T
        return np.array([rank_correlation(A, at) for at in columns]), np.array([median_slope(A, at) for at in columns])

    def holds(H: Mapping[str, Array]) -> bool:
        rises, slopes = trends(H)
        flatter = slopes[-1] < slopes[0] and rank_correlation(amounts, slopes) <= -TREND
        return bool((rises >= TREND).all() and slopes[0] > 0 and flatter)

    def holds_weakly(H: Mapping[str, Array]) -> bool:
        rises, slopes = trends(H)
        return bool((rises > 0).all() and slopes[-1] < slopes[0])

    rises, slopes = trends(grid.mean)
    first, last = grid.amounts[0], grid.amounts[-1]
    each = np.array([trends({m: H[:, k] for m, H in grid.H.items()})[1] for k in range(len(grid.seeds))])
    ends = [f"{each[:, k].mean():.2f}{interval(*_ends(each[:, k]), len(each))}" for k in (0, -1)]
    evidence = (
        f"rank correlation of H and A {rises.min():.2f} to {rises.max():.2f} over N_D ({len(A)} models); median slope "
        f"of H over A [m/m] {ends[0]} at N_D = {first}, {ends[1]} at {last}; steepest at "
        f"{grid.amounts[int(slopes.argmax())]}"
    )
    numbers = {
        "least rank correlation of H and A": float(rises.min()),
        f"slope at N_D = {first} [m/m]": float(each[:, 0].mean()),
        f"slope at N_D = {last} [m/m]": float(each[:, -1].mean()),
    }
    return _finding("S3", grid.judge(holds, holds_weakly), evidence, **numbers)


def _ends(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _S4(grid: Grid) -> Finding:
    if not grid.high:
        return _without("S4", "high")

    def holds(H: Mapping[str, Array]) -> bool:
        lead = _lead(H, grid.high)[:, -1]
        return bool(lead.any() and not lead.all())

    lead, last, orders = _lead(grid.mean, grid.high)[:, -1], grid.amounts[-1], len(grid.seeds)
    worse = [model for model, ahead in zip(grid.high, lead, strict=True) if not ahead]
    said = ", ".join(f"{model} {metres(grid.mean[model][-1])}" for model in worse[:3])
    evidence = (
        f"at N_D = {last}, {lead.sum()} of {len(lead)} high models beat pure data-driven ({grid.value(NO_MODEL, -1)}), "
        f"{len(worse)} {'does' if len(worse) == 1 else 'do'} not{f' ({said})' if said else ''}"
    )
    numbers = {f"share of high models in the lead at N_D = {last}": float(lead.mean())}
    if orders < FEWEST_ORDERS:
        plural = "s" * (orders > 1)
        evidence += (
            f"; fluctuation needs {FEWEST_ORDERS} nested orders (grid seeds), the study has {orders} seed{plural}"
        )
        return _finding("S4", "undecided", evidence, **numbers)
    found, moving = grid.judge(holds), False
    if not grid.moderate:
        return _finding(
            "S4", "undecided", f"{evidence}; no moderate model to compare their fluctuation with", **numbers
        )
    if worse:
        worst, calm = (float(np.median([_variation(grid.H[m]) for m in group])) for group in (worse, grid.moderate))
        moving = worst > calm
        evidence += f"; over {orders} nested orders H of these varies by {worst:.0%}, of moderate models by {calm:.0%}"
        numbers |= {"variation of the worst": worst, "variation of moderate models": calm}
    if worse and not moving:
        evidence += ", so not more"
    return _finding("S4", found if moving else "refuted", evidence, **numbers)


def _variation(H: Array) -> float:
    """Standard deviation over seeds by mean of H (amounts, seeds), averaged over amounts."""
    return float((H.std(axis=1, ddof=1) / H.mean(axis=1)).mean())


def _S5(H: Grid, H_90: Grid, by_H: list[Finding], by_H_90: list[Finding]) -> Finding:
    both = [np.concatenate([grid.H[model].ravel() for model in grid.H]) for grid in (H, H_90)]
    alike = rank_correlation(*both)
    changed = [
        (one["id"], one["verdict"], other["verdict"])
        for one, other in zip(by_H, by_H_90, strict=True)
        if one["verdict"] != other["verdict"]
    ]
    opposite = any("undecided" not in change for change in changed)
    same = alike >= ALIKE and not changed
    evidence = f"rank correlation of H and H_90 over {both[0].size} cells {alike:.3f}; by H_90 "
    evidence += ", ".join(f"{key} is {other} instead of {one}" for key, one, other in changed) or "S1-S4 are the same"
    found = verdict(same, not opposite and alike >= UNLIKE)
    numbers = {"rank correlation of H and H_90": alike, "verdicts of S1-S4 that differ": float(len(changed))}
    return _finding("S5", found, evidence, **numbers)


@dataclass(frozen=True)
class Pair:
    """A moderate model that does better than something dearer; `sure` if in every seed. The best pair comes first."""

    sure: bool
    gain: float
    text: str


def _S6(grid: Grid) -> Finding:
    if not grid.moderate:
        return _without("S6", "moderate")
    if len(grid.physics) < 2:
        return _finding("S6", "undecided", "one physics model: there is no other to compare it with")
    if not _small(grid):
        return _finding("S6", "undecided", f"no N_D is at most half of the largest, {grid.amounts[-1]}")
    if min(grid.A[model] for model in grid.physics) >= max(grid.A[model] for model in grid.moderate):
        return _finding("S6", "undecided", "no physics model is more accurate than a moderate one")
    data = {model: pair for model in grid.moderate if (pair := _against_data(grid, model))}
    physics = {model: pair for model in grid.moderate if (pair := _against_physics(grid, model))}
    kinds = (("pure data-driven with more runs", data), ("more accurate physics alone", physics))
    evidence = "; ".join(
        f"{len(pairs)} of {len(grid.moderate)} moderate models beat {what}"
        + (f": {', '.join(pair.text for pair in _best(pairs.values()))}" if pairs else "")
        for what, pairs in kinds
    )
    found = verdict(
        *(all(any(test(pair) for pair in pairs.values()) for _, pairs in kinds) for test in (lambda p: p.sure, bool))
    )
    numbers = {f"share that beats {what}": len(pairs) / len(grid.moderate) for what, pairs in kinds}
    return _finding("S6", found, evidence, **numbers)


def _best(pairs: Any) -> list[Pair]:
    return sorted(pairs, key=lambda pair: (not pair.sure, -pair.gain))[:MOST_PAIRS]


def _small(grid: Grid) -> list[int]:
    """Places of the small amounts: at most half of the largest."""
    return [k for k, amount in enumerate(grid.amounts) if amount <= grid.amounts[-1] / 2]


def _against_data(grid: Grid, model: str) -> Pair | None:
    """The pair of amounts with which a model saves most runs against pure data-driven."""
    errors, pure, found = grid.H[model], grid.H[NO_MODEL], []
    for i in _small(grid):
        for j in range(i + 1, len(grid.amounts)):
            if errors[i].mean() < pure[j].mean():
                text = f"{model} with {grid.amounts[i]} runs {metres(errors[i].mean())} beats "
                text += f"{grid.amounts[j]} runs without physics, {metres(pure[j].mean())}"
                saved = (
                    grid.amounts[j] - grid.amounts[i] + 1 - errors[i].mean() / pure[j].mean()
                )  # ties: the wider margin
                found.append(Pair(bool((errors[i] < pure[j]).all()), saved, text))
    return next(iter(_best(found)), None)


def _against_physics(grid: Grid, model: str) -> Pair | None:
    """The most accurate physics alone, better than the model's physics alone, that a model beats with few runs."""
    found = []
    for i in _small(grid):
        errors = grid.H[model][i]
        for other in grid.physics:
            if errors.mean() < grid.A[other] < grid.A[model]:
                text = f"{model} ({metres(grid.A[model])} alone) with {grid.amounts[i]} runs {metres(errors.mean())} "
                text += f"beats {other} alone, {metres(grid.A[other])}"
                gain = grid.A[model] / grid.A[other] + 1e-6 / grid.amounts[i]  # ties: the fewest runs
                found.append(Pair(bool((errors < grid.A[other]).all()), gain, text))
    return next(iter(_best(found)), None)


def _S7(results: Results, grid: Grid) -> Finding:
    if not grid.physics:
        return _without("S7", "physics")
    if results.test.horizon < 3:
        return _finding("S7", "undecided", "a second difference needs three steps ahead")
    first = grid.amounts[0]
    true = roughness(results.test.future)
    judged = judged_cells(results)
    cells = judged[judged["N_D"] == first].set_index(["model", "seed"])["cell"]
    rough = {m: np.array([roughness(results.paths[cells[m, seed]]) for seed in grid.seeds]) for m in grid.H}
    alone = float(np.median([roughness(results.physics[model]) for model in grid.physics]))

    def holds(of: Mapping[str, float]) -> bool:
        return of[NO_MODEL] > ROUGH * true >= float(np.median([of[model] for model in grid.physics]))

    on_average = holds({model: values.mean() for model, values in rough.items()})
    every = all(holds({model: values[k] for model, values in rough.items()}) for k in range(len(grid.seeds)))
    pure, together = rough[NO_MODEL], np.median([rough[model] for model in grid.physics], axis=0)
    evidence = (
        f"at N_D = {first}: pure data-driven {metres(pure.mean())}{interval(*_ends(pure), len(pure))}, cooperative "
        f"{metres(together.mean())}{interval(*_ends(together), len(together))} in the median, physics alone "
        f"{metres(alone)}, true paths {metres(true)}"
    )
    numbers = {
        "roughness of pure data-driven [m]": float(pure.mean()),
        "roughness of cooperative models, median [m]": float(together.mean()),
        "roughness of true paths [m]": true,
    }
    return _finding("S7", verdict(on_average and every, on_average), evidence, **numbers)
