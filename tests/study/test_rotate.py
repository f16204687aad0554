"""Turns: each is the study with that run as its test, and what is said of them follows by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DocumentError
from shipid.study.plan import Plan
from shipid.study.prepare import prepare
from shipid.study.rotate import contrasts, rotate, spread, turns
from shipid.study.run import run_batch
from tests.study.test_commands import weaving
from tests.study.tiny import tiny_plan


@pytest.fixture
def claimed(made: Callable[..., Any]) -> Plan:
    """A plan whose claims are about the models by hand."""
    cells = {(model, 2, 0): 1.0 for model in ("good", "bad", "tuned", "none")}
    claims = {"accurate": "good", "inaccurate": "bad", "aside": ["tuned"]}
    plan: Plan = made(cells, claims=claims, alone={"good": 1.0, "bad": 2.0, "tuned": 0.5}).plan
    return plan


def by_hand() -> pd.DataFrame:
    """Three turns, two seeds, H of both equal to its mean but for 0.1 up and down."""
    A = {"good": [2.0, 3.0, 4.0], "bad": [4.0, 6.0, 8.0], "tuned": [1.0, 1.0, 1.0], "none": [np.nan] * 3}
    H = {"good": [1.0, 1.0, 1.0], "bad": [1.5, 2.5, 3.5], "tuned": [9.0, 9.0, 9.0], "none": [2.0, 4.0, 3.0]}
    rows = [
        {
            "test": f"ZZ {turn}",
            "foundation": name,
            "family": name,
            "method": "drawn",
            "N_D": 5,
            "seed": seed,
            "A": A[name][turn],
        }
        | {"H": H[name][turn] + 0.1 * (-1) ** seed, "H_90": 2.0, "naive": 5.0, "status": "ok"}
        for turn in range(3)
        for seed in (0, 1)
        for name in A
    ]
    return pd.DataFrame(rows)


def test_a_turn_is_the_study_with_that_test_run(recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    plan, dataset = recorded(weaving(), split={"test": ["f"]}, prediction={"ahead": 5.0}, grid={"N_D": [5]})
    found = pd.concat(list(rotate(plan, dataset, ["a", "b"])))
    for test in ("a", "b"):
        own, _ = recorded(weaving(), split={"test": [test]}, prediction={"ahead": 5.0}, grid={"N_D": [5]})
        prepared = prepare(own, dataset)
        rows = [row for row, _ in run_batch(own, prepared, own.batches[0], "cpu")]
        turn = found[found["test"] == test]
        assert list(turn["foundation"]) == [row["foundation"] for row in rows]
        assert (turn["N_D"] == 5).all()
        for name in ("A", "H"):
            np.testing.assert_allclose(turn[name], [row[name] for row in rows], rtol=1e-12)


def test_which_runs_take_turns(recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    plan, dataset = recorded(weaving(), split={"test": 1})
    assert turns(plan, dataset, ["c", "a*"]) == ["a", "c"]
    with pytest.raises(DocumentError, match="'z' matches no run: valid: a, b, c"):
        turns(plan, dataset, ["z"])
    with pytest.raises(DocumentError, match="only 'a' matches"):
        turns(plan, dataset, ["a"])


def test_spread_by_hand() -> None:
    rows = spread(by_hand()).set_index("foundation")
    assert rows.loc["bad", ["turns", "A", "H", "least", "greatest"]].tolist() == pytest.approx([3, 6.0, 2.5, 1.5, 3.5])
    assert rows["better"].tolist() == pytest.approx([3, 3, 0, np.nan], nan_ok=True)


def test_contrasts_by_hand(claimed: Plan, tmp_path: Path) -> None:
    """Student's t for 3 turns is 4.303; the differences of R1, bad, are 2.5, 3.5, 4.5."""
    rows = contrasts(by_hand(), claimed).set_index("difference")
    one = rows.loc["bad: A less H"]
    assert one["mean"] == pytest.approx(3.5)
    assert (one["low"], one["high"]) == pytest.approx((3.5 - 4.303 / 3**0.5, 3.5 + 4.303 / 3**0.5), abs=1e-3)
    assert rows.loc["A of good less H of bad", "mean"] == pytest.approx(0.5)
    assert rows.loc["gap of A less gap of H", "mean"] == pytest.approx(3.0 - 1.5)
    assert rows.loc["H of none less the worst other H", "mean"] == pytest.approx(0.5)  # tuned stands aside
    assert rows.loc["H of none less the worst other H", "above"] == 2
    assert contrasts(by_hand(), tiny_plan(tmp_path)).empty


def test_a_failed_cell_is_left_out(claimed: Plan) -> None:
    frame = by_hand()
    frame.loc[(frame["foundation"] == "good") & (frame["test"] == "ZZ 0"), ["status", "H"]] = ["failed", np.nan]
    rows = contrasts(frame, claimed).set_index("difference")
    assert rows.loc["good: A less H", "turns"] == 2
    assert spread(frame).set_index("foundation").loc["good", "turns"] == 2


def test_families_of_several_members_and_models_without_any_result(claimed: Plan) -> None:
    """Members are averaged; where a side of a difference has no result at all there is no number."""
    frame = by_hand()
    two = frame.assign(foundation=frame["foundation"] + "-2", H=frame["H"] + 1.0)
    rows = contrasts(pd.concat([frame, two]), claimed).set_index("difference")
    assert rows.loc["bad: A less H", "mean"] == pytest.approx(3.0)
    rows = contrasts(frame[frame["foundation"] != "good"], claimed).set_index("difference")
    assert np.isnan(rows.loc["good: A less H", "mean"])
    assert rows.loc["bad: A less H", "turns"] == 3


def test_a_run_without_windows_takes_no_turn(recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    dataset = weaving()
    short = dataset.frame[(dataset.frame["run"] != "c") | (dataset.frame["t"] < 3.0)].reset_index(drop=True)
    plan, cut = recorded(Dataset(short, dataset.metadata), split={"test": 1}, prediction={"ahead": 5.0})
    assert turns(plan, cut, ["*"]) == ["a", "b", "d", "e", "f"]
