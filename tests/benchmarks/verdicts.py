"""How often every verdict rule errs: tables of errors whose truth is known, judged by the rules of today and before."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from shipid.answer.verdict import Verdict
from tests.answer.made_up import CASES, FULL_SCALE, Size, grids, rivals, roughness, rule
from tests.benchmarks import by_seeds

SIZES = {"20 manoeuvres, 1 seed": Size(), "20 manoeuvres, 5 seeds": Size(seeds=5), "7 manoeuvres, 3 seeds": Size(7, 3)}
NEW = ("B1",)  # not before version 0.2
Rule = Callable[[np.random.Generator, Size, float], Verdict]


def before(case: str) -> Rule:
    """Return the verdict that the rule before version 0.2 gives on a table drawn for a claim."""

    def judge(rng: np.random.Generator, size: Size, effect: float) -> Verdict:
        if case in FULL_SCALE:
            return by_seeds.R(rivals(rng, size, case, effect))[case]
        if case == "S7":
            return by_seeds.S7(*roughness(rng, size, effect))
        grid = grids(rng, size, case, effect)
        both = grid, replace(grid, table=grid.by_90)
        if case == "S5":
            return by_seeds.S5(*both)
        verdict: Verdict = getattr(by_seeds, case)(both[0])
        return verdict

    return judge


def share(judge: Rule, case: str, size: Size, effect: float, tables: int) -> str:
    """Percent of tables confirmed / refuted; the same tables for every rule."""
    rng = np.random.default_rng([1, CASES.index(case), size.runs, size.seeds])
    verdicts = [judge(rng, size, effect) for _ in range(tables)]
    return " / ".join(f"{verdicts.count(word) / tables:.0%}" for word in ("confirmed", "refuted"))  # type: ignore[arg-type]


def run(tables: int = 200) -> dict[str, Any]:
    """Figures: rule, truth, size -> confirmed / refuted before and now."""
    figures: dict[str, Any] = {"tables": tables}
    for case in CASES:
        for words, size in SIZES.items():
            for truth, effect in (("no effect", 0.0), ("plain effect", 1.0)):
                judges = (rule(case),) if case in NEW else (before(case), rule(case))
                rates = [share(judge, case, size, effect, tables) for judge in judges]
                figures[f"{case}, {truth}, {words}"] = ", ".join([*(f"before {one}" for one in rates[:-1]), rates[-1]])
    return figures
