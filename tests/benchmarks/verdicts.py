"""How often every verdict rule errs: tables of errors whose truth is known, judged by the rules."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from shipid.answer.verdict import Verdict
from tests.answer.made_up import CASES, Size, rule

SIZES = {"20 manoeuvres, 1 seed": Size(), "20 manoeuvres, 5 seeds": Size(seeds=5), "7 manoeuvres, 3 seeds": Size(7, 3)}
Rule = Callable[[np.random.Generator, Size, float], Verdict]


def share(judge: Rule, case: str, size: Size, effect: float, tables: int) -> str:
    """Percent of tables confirmed / refuted; the same tables for every rule."""
    rng = np.random.default_rng([1, CASES.index(case), size.runs, size.seeds])
    verdicts = [judge(rng, size, effect) for _ in range(tables)]
    return " / ".join(f"{verdicts.count(word) / tables:.0%}" for word in ("confirmed", "refuted"))  # type: ignore[arg-type]


def run(tables: int = 200) -> dict[str, Any]:
    """Figures: rule, truth, size -> confirmed / refuted."""
    figures: dict[str, Any] = {"tables": tables}
    for case in CASES:
        for words, size in SIZES.items():
            for truth, effect in (("no effect", 0.0), ("plain effect", 1.0)):
                figures[f"{case}, {truth}, {words}"] = share(rule(case), case, size, effect, tables)
    return figures
