"""The rules before version 0.2, to measure what today's replaced: seeds were the evidence, "confirmed" if all agreed.

A condition on mean errors was confirmed if it held for the mean over seeds and for every seed, undecided if only for
the mean, else refuted; with one seed nothing was ever undecided.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from shipid.answer.findings import Rivals
from shipid.answer.findings_simulation import ErrorGrid
from shipid.answer.verdict import Verdict
from shipid.metrics import rank_correlation
from shipid.study.declared import NO_MODEL

Array = np.ndarray
Means = Mapping[str, Array]  # model -> (amounts,)


def median_slope(x: Array, y: Array) -> float:
    """Return the median slope of y over x (n,) over all pairs of points (Theil 1950, Sen 1968).

    It is robust against single outliers. NaN if all x are equal.
    """
    i, j = np.triu_indices(len(x), k=1)
    apart = x[i] != x[j]
    return float(np.median((y[j] - y[i])[apart] / (x[j] - x[i])[apart])) if apart.any() else float("nan")


def verdict(always: bool, on_average: bool) -> Verdict:
    """Confirmed if for every seed, undecided if only on average."""
    return "confirmed" if always else "undecided" if on_average else "refuted"


def by_seed(grid: ErrorGrid) -> dict[str, Array]:
    """Model -> (amounts, seeds) mean errors [m]."""
    return {model: values @ grid.table.weights for model, values in grid.table.H.items()}


def asked(
    H: Mapping[str, Array], holds: Callable[[Means], bool], weakly: Callable[[Means], bool] | None = None
) -> Verdict:
    """Ask a condition of the mean over seeds and of every seed."""
    mean = {model: values.mean(axis=1) for model, values in H.items()}
    seeds = next(iter(H.values())).shape[1]
    each = all(holds({model: values[:, k] for model, values in H.items()}) for k in range(seeds))
    return verdict(holds(mean) and each, (weakly or holds)(mean))


def S1(grid: ErrorGrid) -> Verdict:
    """Every moderate member leads at the smallest amount, more than half at every amount."""

    def holds(H: Means) -> bool:
        lead = np.array([H[model] < H[NO_MODEL] for model in grid.moderate])
        return bool(lead[:, 0].all() and lead.all(axis=1).mean() > 0.5)

    return asked(by_seed(grid), holds)


def S2(grid: ErrorGrid) -> Verdict:
    """Rank correlation of H and N_D at most -0.5, and H lower at the end."""
    amounts = np.array(grid.amounts, dtype=float)
    return asked(
        by_seed(grid),
        lambda H: all(rank_correlation(amounts, h) <= -0.5 and bool(h[-1] < h[0]) for h in H.values()),
        lambda H: all(bool(h[-1] < h[0]) for h in H.values()),
    )


def S3(grid: ErrorGrid) -> Verdict:
    """Rank correlation of H and A at least 0.5 everywhere, and a slope that falls."""
    A = np.array([grid.table.A[model] @ grid.table.weights for model in grid.physics])
    amounts = np.array(grid.amounts, dtype=float)

    def trends(H: Means) -> tuple[Array, Array]:
        columns = np.array([H[model] for model in grid.physics]).T
        return np.array([rank_correlation(A, at) for at in columns]), np.array([median_slope(A, at) for at in columns])

    def holds(H: Means) -> bool:
        rises, slopes = trends(H)
        return bool(
            (rises >= 0.5).all()
            and slopes[0] > 0
            and slopes[-1] < slopes[0]
            and rank_correlation(amounts, slopes) <= -0.5
        )

    def weakly(H: Means) -> bool:
        rises, slopes = trends(H)
        return bool((rises > 0).all() and slopes[-1] < slopes[0])

    return asked(by_seed(grid), holds, weakly)


def S4(grid: ErrorGrid) -> Verdict:
    """Some high members lead at the end and some do not, and those fluctuate more than the moderate ones."""
    H = by_seed(grid)
    if H[NO_MODEL].shape[1] < 5:
        return "undecided"

    def holds(H: Means) -> bool:
        lead = [bool(H[model][-1] < H[NO_MODEL][-1]) for model in grid.high]
        return any(lead) and not all(lead)

    worse = [model for model in grid.high if H[model][-1].mean() >= H[NO_MODEL][-1].mean()]
    if not worse:
        return "refuted"
    moved = [
        float(np.median([(H[m].std(axis=1, ddof=1) / H[m].mean(axis=1)).mean() for m in group]))
        for group in (worse, grid.moderate)
    ]
    return asked(H, holds) if moved[0] > moved[1] else "refuted"


def S5(H: ErrorGrid, H_90: ErrorGrid) -> Verdict:
    """Rank correlation of H and H_90 at least 0.95 and the same verdicts on S1-S4."""
    both = [np.concatenate([values.ravel() for values in by_seed(grid).values()]) for grid in (H, H_90)]
    alike = rank_correlation(*both)
    pairs = [(rule(H), rule(H_90)) for rule in (S1, S2, S3, S4)]
    changed = [pair for pair in pairs if pair[0] != pair[1]]
    opposite = any("undecided" not in pair for pair in changed)
    return verdict(alike >= 0.95 and not changed, not opposite and alike >= 0.8)


def S6(grid: ErrorGrid) -> Verdict:
    """Any moderate member with few runs below `none` with more, and any below more accurate physics alone."""
    H = by_seed(grid)
    A = {model: float(values @ grid.table.weights) for model, values in grid.table.A.items()}
    small = [k for k, amount in enumerate(grid.amounts) if amount <= grid.amounts[-1] / 2]
    data = [(H[m][i], H[NO_MODEL][j]) for m in grid.moderate for i in small for j in range(i + 1, len(grid.amounts))]
    physics = [(H[m][i], np.array(A[o])) for m in grid.moderate for i in small for o in grid.physics if A[o] < A[m]]
    sure = [any(bool((mine < other).all()) for mine, other in pairs) for pairs in (data, physics)]
    mean = [any(bool(mine.mean() < other.mean()) for mine, other in pairs) for pairs in (data, physics)]
    return verdict(all(sure), all(mean))


def S7(true: Array, pure: Array, together: Array, counts: Array) -> Verdict:
    """Roughness of `none` above 1.5 times the true one, that of cooperative models not."""
    share = counts / counts.sum()
    limit = 1.5 * float(true @ share)
    holds = float(pure @ share) > limit >= float(together @ share)
    return verdict(holds, holds)


def R(rivals: Rivals) -> dict[str, Verdict]:
    """R1-R4 at one amount, over seeds."""
    table, good, bad = rivals.table, rivals.good, rivals.bad
    A = {model: float(table.A[model] @ table.weights) for model in (good, bad)}
    H = {model: table.H[model][-1] @ table.weights for model in (good, bad)}
    gap = abs(A[bad] - A[good])
    means = np.stack([error @ table.weights for error in rivals.steps.values()])
    share = float((means.argmax(axis=0) == list(rivals.steps).index(NO_MODEL)).mean())
    return {
        "R1": verdict(*(all(bool(of(H[m]) < A[m]) for m in (good, bad)) for of in (np.max, np.mean))),
        "R2": verdict(H[bad].max() <= 1.1 * A[good], H[bad].mean() <= 1.1 * A[good]),
        "R3": verdict(bool((np.abs(H[good] - H[bad]) < gap).all()), abs(float(H[good].mean() - H[bad].mean())) < gap),
        "R4": verdict(share == 1.0, share > 0.5),
    }
