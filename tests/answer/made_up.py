"""Tables of errors by test manoeuvre, drawn by seed, in which the truth of every claim is known.

Error = true mean x how hard the manoeuvre is x how it suits the model x what one training made of it. The last differs
by model, amount and seed, and has a part that all models of one amount and seed share (the runs that were drawn).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from shipid.answer.error_table import ErrorTable
from shipid.answer.findings import BAND_RULES, FULL_SCALE_RULES, Rivals, Widths
from shipid.answer.findings_simulation import SIMULATION_RULES, ErrorGrid, compare_roughness
from shipid.answer.verdict import Verdict
from shipid.study.declared import NO_MODEL

Array = np.ndarray
HARD, SUITS, TRAINED, DRAWN = 0.5, 0.25, 0.03, 0.02  # standard deviations of the logarithm
STEPS = 5
WINDOWS = 50


@dataclass(frozen=True)
class Size:
    """How much evidence a table holds."""

    runs: int = 20
    seeds: int = 1
    amounts: tuple[int, ...] = (10, 20, 30, 50, 70, 100)
    moderate: int = 6
    high: int = 4

    @property
    def members(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of the moderate and the high members."""
        return tuple(
            tuple(f"{family}-{k + 1}" for k in range(count))
            for family, count in (("moderate", self.moderate), ("high", self.high))
        )  # type: ignore[return-value]


def factor(rng: np.random.Generator, spread: float, shape: tuple[int, ...]) -> Array:
    """Factors with mean 1."""
    drawn: Array = rng.lognormal(-(spread**2) / 2, spread, shape)
    return drawn


def table(
    rng: np.random.Generator,
    size: Size,
    A: Mapping[str, float],
    H: Mapping[str, Array],
    trained: Mapping[str, float] | None = None,
) -> ErrorTable:
    """Draw errors around true means: A by model [m], H by model (amounts,) [m]; `trained`: other spreads."""
    runs, counts = size.runs, rng.integers(WINDOWS // 2, WINDOWS, size.runs).astype(float)
    hard, (amounts, seeds) = factor(rng, HARD, (runs,)), (len(size.amounts), size.seeds)
    drawn = factor(rng, DRAWN, (amounts, seeds, 1))
    errors = {}
    for model, means in H.items():
        suits = factor(rng, SUITS, (runs,)) * factor(rng, SUITS / 2, (amounts, 1, runs))
        spread = (trained or {}).get(model, TRAINED)
        errors[model] = means[:, None, None] * hard * suits * drawn * factor(rng, spread, (amounts, seeds, 1))
    alone = {model: mean * hard * factor(rng, SUITS, (runs,)) for model, mean in A.items()}
    return ErrorTable(size.amounts, counts, alone, errors)


def grids(rng: np.random.Generator, size: Size, case: str, effect: float) -> ErrorGrid:
    """Tables of H and H_90 in a world without an effect in the claim `case` (0), with the paper's (1), or between."""
    moderate, high = size.members
    share = np.array(size.amounts) / size.amounts[0]
    fall = (1 - effect if case == "S2" else 0.0) + (effect if case == "S2" else 1.0) * share**-0.4
    none = 4.0 * (np.ones(len(share)) if case == "S6" else fall)
    names = (*moderate, *high)
    apart = effect if case == "S6" else 1.0
    A = dict(zip(names, 4.0 * 1.25 ** (apart * np.arange(len(names))), strict=True))
    level = np.linspace(0.55, 0.8, len(moderate))
    H = {NO_MODEL: none}
    for k, model in enumerate(moderate):
        H[model] = none * (1 - effect * (1 - level[k])) if case in ("S1", "S6") else none * level[k]
    for k, model in enumerate(high):
        H[model] = none * (0.6, 1.6)[k % 2] ** (effect if case == "S4" else 1.0)
    if case in ("S3", "B1"):  # H without order in A, or along it, steeper where data are few
        order = rng.permutation(len(names))
        for k, model in enumerate(names):
            steep = 0.8 * share**-0.4 if case == "S3" else 0.4
            along = (1 - effect) * 0.05 * order[k] + effect * steep * np.log(A[model] / 8.0)
            H[model] = none * np.exp(along - 0.2)
    trained = {m: TRAINED * (1 + 4 * effect * (k % 2)) for k, m in enumerate(high)} if case == "S4" else None
    by_mean = table(rng, size, A, H, trained)
    if case == "S5":
        other = {m: means**effect * rng.uniform(0.5, 8.0, len(share)) ** (1 - effect) for m, means in H.items()}
        by_90 = table(rng, size, {m: 2 * a for m, a in A.items()}, other)
    else:
        tails = {model: 2.2 * values * factor(rng, 0.05, values.shape) for model, values in by_mean.H.items()}
        by_90 = ErrorTable(size.amounts, by_mean.counts, {m: 2.2 * a for m, a in by_mean.A.items()}, tails)
    return ErrorGrid(by_mean, moderate, high, by_90=by_90)


def rivals(rng: np.random.Generator, size: Size, case: str, effect: float) -> Rivals:
    """Accurate and inaccurate physics and none in a world without an effect in the claim `case` (0), or with it (1)."""
    good, bad, none = 1.3, 1.8, 2.0
    trained_good, trained_bad = 0.8, 0.9
    if case == "R1":
        trained_good, trained_bad = (A * (1 - 0.4 * effect) for A in (good, bad))
    elif case == "R2":
        trained_bad = 1.1 * good * (1 - 0.4 * effect)
    elif case == "R3":
        trained_bad = trained_good + (bad - good) * (1 - 0.9 * effect)
    elif case == "R4":
        none, trained_good, trained_bad, good, bad = 1.0 + 0.8 * effect, 1.0, 1.0, 1.0, 1.0
    one = Size(runs=size.runs, seeds=size.seeds, amounts=(size.amounts[-1],))
    H = {"good": np.array([trained_good]), "bad": np.array([trained_bad]), NO_MODEL: np.array([none])}
    drawn = table(rng, one, {"good": good, "bad": bad}, H)
    grows = np.linspace(0.2, 1.8, STEPS)[:, None]

    def curve(values: Array) -> Array:
        return grows * values * factor(rng, 0.1, (STEPS, len(values)))

    steps = {model: curve(values[0].mean(axis=0)) for model, values in drawn.H.items()}
    steps |= {f"{model} alone": curve(values) for model, values in drawn.A.items()}
    return Rivals(drawn, "good", "bad", steps)


def roughness(rng: np.random.Generator, size: Size, effect: float) -> tuple[Array, Array, Array, Array]:
    """Roughness of true, pure and cooperative paths by manoeuvre, and windows: at the limits of S7, or well beyond."""
    true = factor(rng, HARD, (size.runs,))
    pure, together = (1.5 * mean * true * factor(rng, SUITS, (size.runs,)) for mean in (1 + effect, 1 - 0.3 * effect))
    return true, pure, together, np.full(size.runs, float(WINDOWS))


SIMULATION, FULL_SCALE = ("S1", "S2", "S3", "S4", "S5", "S6"), ("R1", "R2", "R3", "R4")


def rule(case: str) -> Callable[[np.random.Generator, Size, float], Verdict]:
    """Return the verdict that today's rule gives on a table drawn for a claim."""

    def judge(rng: np.random.Generator, size: Size, effect: float) -> Verdict:
        if case == "B1":
            grid = grids(rng, size, case, effect)
            return BAND_RULES["B1"].decide(Widths(grid.table, grid.physics))[0]
        if case == "S7":
            return compare_roughness(*roughness(rng, size, effect))[0]
        if case in FULL_SCALE_RULES:
            return FULL_SCALE_RULES[case].decide(rivals(rng, size, case, effect))[0]
        return SIMULATION_RULES[case].decide(grids(rng, size, case, effect))[0]

    return judge


CASES = (*SIMULATION, "S7", *FULL_SCALE, "B1")


def rates(case: str, size: Size, effect: float, tables: int, seed: int = 0) -> dict[str, float]:
    """Share of tables that are confirmed and refuted."""
    judge, rng = rule(case), np.random.default_rng([seed, CASES.index(case), size.runs, size.seeds])
    verdicts = [judge(rng, size, effect) for _ in range(tables)]
    return {word: verdicts.count(word) / tables for word in ("confirmed", "refuted")}  # type: ignore[arg-type]
