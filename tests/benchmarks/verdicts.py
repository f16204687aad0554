"""How often every verdict rule errs: tables of errors whose truth is known."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.answer.made_up import CASES, Size, rule

SIZES = {"20 manoeuvres, 1 seed": Size(), "20 manoeuvres, 5 seeds": Size(seeds=5), "7 manoeuvres, 3 seeds": Size(7, 3)}


def share(case: str, size: Size, effect: float, tables: int) -> str:
    """Percent of tables confirmed / refuted."""
    judge, rng = rule(case), np.random.default_rng([1, CASES.index(case), size.runs, size.seeds])
    verdicts = [judge(rng, size, effect) for _ in range(tables)]
    return " / ".join(f"{verdicts.count(word) / tables:.0%}" for word in ("confirmed", "refuted"))  # type: ignore[arg-type]


def run(tables: int = 200) -> dict[str, Any]:
    """Figures: rule, truth, size -> confirmed / refuted."""
    cases = [(case, words, truth) for case in CASES for words in SIZES for truth in ("no effect", "plain effect")]
    figures = {
        f"{case}, {truth}, {words}": share(case, SIZES[words], float(truth == "plain effect"), tables)
        for case, words, truth in cases
    }
    return {"tables": tables, **figures}
