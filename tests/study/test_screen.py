"""Screening: the errors of the paths themselves, whatever the block, the engine and the rest of the family."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.engine import engines, native
from shipid.errors import DocumentError, ShipidError
from shipid.hybrid.physics import Physics
from shipid.metrics import position_error, summarise_errors
from shipid.study import screen as module
from shipid.study.plan import Plan
from shipid.study.prepare import obtain_runs, partition, window_memory
from shipid.study.screen import (
    accuracy_quantiles,
    drawn_families,
    join_blocks,
    screen,
)
from shipid.vessel.perturb import Family, draw_members
from tests.study.tiny import tiny_plan


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return tiny_plan(tmp_path)


def screened(plan: Plan, count: int, name: str = "wrong") -> pd.DataFrame:
    return join_blocks(list(screen(plan, obtain_runs(plan), drawn_families(plan, name), count)))


def by_paths(plan: Plan, count: int) -> list[dict[str, Any]]:
    """A, A_90 and share of failures of each member by way of its paths on pool and test."""
    (family,), base = drawn_families(plan, "wrong"), plan.vessels["gunnerus-28.9"]
    dataset = obtain_runs(plan)
    rows = []
    for variant in draw_members(family.model_copy(update={"members": count}), base):
        vessel, errors = base.with_values(variant.values), []
        for windows in partition(plan, dataset)[:2]:
            hidden = window_memory(vessel, dataset, windows)
            paths, _ = Physics(vessel, windows.horizon, 1.0).variant_paths(windows.instants(hidden=hidden))
            errors.append(position_error(paths[:, 0], windows.future))
        whole = summarise_errors(np.concatenate(errors, axis=1))
        rows.append({"member": variant.name, "factors": variant.factors, **whole})
    return rows


@pytest.mark.parametrize("compiled", [True, False])
def test_numbers_are_those_of_the_paths(plan: Plan, compiled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a C compiler, where errors are summed on the way, and without one."""
    if not compiled:
        for place in (native, engines):
            monkeypatch.setattr(place, "find_compiler", lambda: None)
    frame, expected = screened(plan, 5), by_paths(plan, 5)
    assert list(frame["member"]) == [row["member"] for row in expected]
    np.testing.assert_allclose(frame["A"], [row["mean"] for row in expected], rtol=1e-12)
    np.testing.assert_allclose(frame["A_90"], [row["p90"] for row in expected], rtol=2e-3)
    for row, (_, screened_row) in zip(expected, frame.iterrows(), strict=True):
        assert row["factors"] == {path: screened_row[path] for path in row["factors"]}


def test_the_size_of_a_block_changes_no_bit(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = screened(plan, 7)
    monkeypatch.setattr(module, "MEMBERS_OF_BLOCK", 3)
    pd.testing.assert_frame_equal(screened(plan, 7), whole, check_exact=True)
    monkeypatch.setattr(module, "NUMBERS_OF_BLOCK", 1)
    assert [len(block) for block in screen(plan, obtain_runs(plan), drawn_families(plan, "wrong"), 3)] == [1, 1, 1]


def test_a_member_that_diverges_errs_as_in_a_study_and_is_counted(tmp_path: Path) -> None:
    wild = [
        {
            "parameters": ["hull.derivatives.N_r|r|", "hull.derivatives.N_rrr"],
            "factor": [-3e4, 1.0],
            "change_sign": True,
        }
    ]
    family = [{"name": "wrong", "base": "gunnerus-28.9", "members": 2, "perturb": wild}]
    meant = {"unusual": ["family.0.perturb.0.factor*"]}
    plan = tiny_plan(tmp_path, {"family": family, **meant})
    frame = screened(plan, 6)
    bad = frame["diverged"] > 0
    assert bad.any()
    expected = by_paths(plan, 6)
    np.testing.assert_allclose(frame["A"], [row["mean"] for row in expected], rtol=1e-9)
    np.testing.assert_allclose(frame["A_90"], [row["p90"] for row in expected], rtol=2e-3)
    assert (frame["diverged"] <= 1).all()
    assert accuracy_quantiles(frame)["diverged"].item() == bad.sum()


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("wrnog", "'wrnog' draws no factor from a range: did you mean 'wrong'"),
        ("right", "'right' draws no factor from a range"),
    ],
)
def test_families_that_cannot_be_screened(plan: Plan, name: str, remedy: str) -> None:
    with pytest.raises(DocumentError, match=remedy):
        drawn_families(plan, name)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"count": -1}, "count must be a whole number, 1 or more, not -1"),
        ({"wanted": [Family(name="z", base="mariner")]}, "base of the family 'z' 'mariner' is not known"),
    ],
)
def test_a_wrong_argument_is_one_line(plan: Plan, wrong: dict[str, Any], message: str) -> None:
    """Before, a negative count gave no rows without a word, and the others were tracebacks."""
    given: dict[str, Any] = {"wanted": plan.families, "count": 2, **wrong}
    with pytest.raises(ShipidError, match=message):
        next(screen(plan, obtain_runs(plan), **given))
