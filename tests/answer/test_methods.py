"""What the comparison of methods says, on tables made by hand and drawn by seed."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from shipid.answer.methods import METHOD_COLUMNS, WITH_PHYSICS, method_table, sentences_on_worlds
from shipid.evidence import CellErrors
from shipid.report.wording import difference_text


def cells(
    rng: np.random.Generator, effect: float, worlds: int = 2, runs: int = 12, noise: float = 0.3, trained: bool = False
) -> pd.DataFrame:
    """Cells of `kernel` and of `other`, which errs by `effect` [m] more, in runs and worlds that differ much.

    The runs of one world are longer than those of another, as the parts of a study with each run as the test in turn.
    """
    rows = []
    for world in range(worlds):
        windows = np.array([5.0 + k % 3 for k in range(runs)]) * (1 + 4 * world)
        for family, members in (("moderate", 2), ("none", 1)):
            for member in range(members):
                hard = rng.uniform(1.0, 4.0, runs)
                for method, more in (("kernel", 0.0), ("other", effect)):
                    error = hard + more + noise * rng.standard_normal(runs)
                    one = CellErrors(f"{family}-{member}", error, windows, trained, str(world))
                    rows.append(
                        {"condition": "", "world": str(world), "foundation": one.model, "family": family,
                         "method": method, "N_D": 10, "seed": world, "status": "ok", "H": one.mean,
                         "H_90": 2 * one.mean, "H_end": 1.5 * one.mean, "H_end_90": 3 * one.mean, "seconds": 3.0,
                         "trials": 4, "apart": False, "errors": one}
                    )  # fmt: skip
    return pd.DataFrame(rows)


def row(frame: pd.DataFrame, method: str = "other", family: str = WITH_PHYSICS) -> Any:
    return frame[frame.method.eq(method) & frame.family.eq(family)].iloc[0]


def test_the_difference_is_that_of_the_means() -> None:
    made = cells(np.random.default_rng(0), 0.5)
    table = method_table(made, "kernel")
    assert list(table.columns) == METHOD_COLUMNS
    for family in ("moderate", "none"):
        mine = made[made.family.eq(family)].groupby("method")
        logs = mine["errors"].apply(lambda cells: np.mean([np.log(one.errors).mean() for one in cells]))
        ratio = np.exp(logs["other"] - logs["kernel"])
        assert row(table, family=family).difference == pytest.approx(100 * (ratio - 1))
        assert pytest.approx(mine.H.mean()["other"]) == row(table, family=family).H
    assert row(table, "kernel").difference == 0
    assert row(table).pairs == 4
    assert row(table).runs == 24  # 12 runs of each world, whatever the number of members
    assert row(table).worlds == 2
    assert row(table).least <= row(table).difference <= row(table).greatest
    assert np.isnan(row(table).world_low)
    assert row(method_table(cells(np.random.default_rng(0), 0.5, worlds=4), "kernel")).world_low < 60


def test_a_family_that_saw_the_test_is_shown_and_not_in_the_mean() -> None:
    made = cells(np.random.default_rng(0), 0.5)
    tuned = made[made.family.eq("moderate")].assign(family="tuned", H=lambda rows: 0.1 * rows.H, apart=True)
    table = method_table(pd.concat([made, tuned], ignore_index=True), "kernel")
    for key in ("H", "difference", "cells", "missing"):
        assert getattr(row(table), key) == getattr(row(method_table(made, "kernel")), key)
    assert pytest.approx(0.1 * row(table).H) == row(table, family="tuned").H


def test_another_training_is_in_the_interval() -> None:
    """Two methods alike, each trained once: networks differ by 3 %, alike in all runs, which is no difference."""
    rng, free = np.random.default_rng(6), 0
    for _ in range(60):
        made = cells(rng, 0.0, worlds=1, noise=0.01, trained=True)
        moved = [replace(one, errors=rng.normal(1.0, 0.03) * one.errors) for one in made["errors"]]
        one = row(method_table(made.assign(errors=moved, H=[cell.mean for cell in moved]), "kernel"))
        free += one.high < 0 or one.low > 0
    assert free <= 9, "5 % of 60, but for one time in a thousand"
    alike = row(method_table(cells(rng, 0.0, worlds=1, noise=0.0, trained=True), "kernel"))
    assert (alike.low, alike.high) == (0.0, 0.0)


def test_a_failed_cell_is_counted_and_not_averaged() -> None:
    made = cells(np.random.default_rng(2), 1.0)
    worst = made.index[made.method.eq("other") & made.family.eq("moderate")][0]
    made.loc[worst, "status"] = "diverged"
    made.loc[worst, ["H", "H_90", "H_end", "H_end_90"]] = np.nan
    made.at[worst, "errors"] = None
    one = row(method_table(made, "kernel"))
    assert (one.failed, one.cells, one.pairs) == (1, 4, 3)
    assert np.isfinite([one.H, one.difference, one.low, one.high]).all()
    assert row(method_table(made, "kernel"), "kernel").failed == 0
    assert (one.missing, row(method_table(made, "kernel"), "kernel").missing) == (1, 0)
    apart = row(method_table(made.drop(worst), "kernel"))
    assert (apart.failed, apart.cells, apart.missing) == (0, 3, 1), "the method does not run on this model"
    every = made.assign(status=np.where(made.method.eq("other"), "failed", made.status))
    lost = row(method_table(every, "kernel"))
    assert lost.failed == lost.cells
    assert lost.pairs == 0
    assert np.isnan(lost.H)
    assert np.isnan(lost.difference)


@pytest.mark.parametrize(("worlds", "conditions"), [(4, 1), (4, 2), (2, 1)])
def test_a_study_of_several_worlds_has_an_interval_over_them(worlds: int, conditions: int) -> None:
    """Physics errs by half of what none does in every world, and worlds differ: the ratio is sharp, errors are not."""
    rows, names = [], [f"c{k}" for k in range(conditions)] if conditions > 1 else [""]
    for condition in names:
        for world in range(worlds):
            for family, share in (("moderate", 0.5), ("none", 1.0)):
                row = {"condition": condition, "world": f"{condition}-{world}", "family": family, "method": "kernel"}
                rows += [{**row, "N_D": N, "status": "ok", "H_end": share * 2.0**world / N} for N in (1, 2, 3)]
    study = SimpleNamespace(
        repeat={"seed": [*range(worlds)]}, claims=SimpleNamespace(method="kernel", not_judged=set()), model=[]
    )
    plan: Any = SimpleNamespace(study=study, methods=[])
    told = sentences_on_worlds(plan, pd.DataFrame(rows))
    assert len(told) == (0 if worlds < 3 else 4 * conditions), "of the least and the largest N_D"
    study.repeat = {"split.test": [["a"], ["b"], ["c"]]}
    assert not sentences_on_worlds(plan, pd.DataFrame(rows)), "tests in turn are no worlds"
    wide = stats.t.ppf(0.975, worlds - 1) * (np.log(2) * np.arange(worlds)).std(ddof=1) / worlds**0.5
    mean = 0.5 * 2**1.5 / 3
    for text in told[:1]:
        assert (
            f"physics of 'moderate' errs by {difference_text(mean, mean / np.exp(wide), mean * np.exp(wide))} at"
            in text
        )
        assert "Its difference to no physics is −50.0 % [−50.0, −50.0]" in text
