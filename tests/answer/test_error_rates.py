"""Error rates of every verdict rule on tables in which the truth is known: the law that all findings keep."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from tests.answer.made_up import CASES, Size, rates

TABLES, FEW = 40, 10  # FEW: of S5, which judges S1-S4 twice
SMALL = {"amounts": (10, 30, 100), "moderate": 3, "high": 3}


def allowed(tables: int) -> int:
    """So many tables are confirmed by a rule that errs in 5 % of cases, but for one time in a thousand."""
    return int(binom.ppf(0.999, tables, 0.05))


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("runs", "seeds"), [(20, 1), pytest.param(6, 5, marks=pytest.mark.slow)])
def test_no_effect_is_confirmed_in_at_most_5_percent(case: str, runs: int, seeds: int) -> None:
    tables = FEW if case == "S5" else TABLES
    moved = rates(case, Size(runs=runs, seeds=seeds, **SMALL), 0.0, tables)  # type: ignore[arg-type]
    assert round(moved["confirmed"] * tables) <= allowed(tables)
    if case != "S5":  # there, H_90 that has nothing to do with H is the opposite of the claim
        assert round(moved["refuted"] * tables) <= allowed(tables)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_more_evidence_never_makes_a_true_effect_less_likely_confirmed(case: str) -> None:
    """More test manoeuvres, then more seeds: the share may fall by what 20 tables leave to chance, no more."""
    seeds = 5 if case == "S4" else 1
    sizes = [Size(runs=8, seeds=seeds, **SMALL), Size(runs=32, seeds=seeds, **SMALL)]  # type: ignore[arg-type]
    sizes.append(Size(runs=32, seeds=seeds + 4, **SMALL))  # type: ignore[arg-type]
    tables = FEW if case == "S5" else 20
    shares = [rates(case, size, 1.0, tables)["confirmed"] for size in sizes]
    chance = 3.3 * np.sqrt(2 * 0.25 / tables)
    assert shares[1] >= shares[0] - chance
    assert shares[2] >= shares[1] - chance
    assert shares[2] > 0.5, "a plain effect is confirmed by 32 manoeuvres"
