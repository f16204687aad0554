"""Turns: each is the study with that run as its test, and their findings follow by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.answer.rotate import (
    choose_turns,
    rotate_test_runs,
    turn_findings,
    turns_table,
)
from shipid.data.dataset import Dataset
from shipid.errors import DocumentError
from shipid.study.plan import Plan, whole_unit
from shipid.study.prepare import prepare
from shipid.study.run import run_unit
from tests.study.test_commands import weaving
from tests.study.tiny import tiny_plan, without_workers


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


def test_a_turn_is_the_study_with_that_test_run(recorded: Callable[..., tuple[Plan, Dataset]], tmp_path: Path) -> None:
    """The same call goes on where it was interrupted, and yields the same digits."""
    plan, dataset = recorded(weaving(), split={"test": ["f"]}, prediction={"ahead": 5.0}, grid={"N_D": [5]})
    with without_workers():
        next(rotate_test_runs(plan, dataset, ["a", "b"], tmp_path / "kept"))
        before = [file.stat().st_mtime_ns for file in tmp_path.glob("kept/*/batches/*")]
        rows_of_turns = pd.concat(list(rotate_test_runs(plan, dataset, ["a", "b"], tmp_path / "kept")))
    after = [file.stat().st_mtime_ns for file in tmp_path.glob("kept/*/batches/*")]
    assert set(before) < set(after), "the first turn is not computed again"
    for test in ("a", "b"):
        single, _ = recorded(weaving(), split={"test": [test]}, prediction={"ahead": 5.0}, grid={"N_D": [5]})
        prepared = prepare(single, dataset)
        rows = [row for row, *_ in run_unit(single, prepared, whole_unit(single, single.batches[0]), "cpu")]
        turn = rows_of_turns[rows_of_turns["test"] == test]
        assert list(turn["foundation"]) == [row["foundation"] for row in rows]
        for name in ("A", "H"):
            np.testing.assert_allclose(turn[name], [row[name] for row in rows], rtol=1e-12)
        np.testing.assert_allclose(turn["naive"], prepared.naive.mean())


def test_which_runs_take_turns(recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    plan, dataset = recorded(weaving(), split={"test": 1})
    assert choose_turns(plan, dataset, ["c", "a*"]) == ["a", "c"]
    with pytest.raises(DocumentError, match="'z' matches no run: valid: a, b, c"):
        choose_turns(plan, dataset, ["z"])


def test_spread_by_hand() -> None:
    rows = turns_table(by_hand()).set_index("foundation")
    assert rows.loc["bad", ["turns", "A", "H", "least", "greatest"]].tolist() == pytest.approx([3, 6.0, 2.5, 1.5, 3.5])
    assert rows["better"].tolist() == pytest.approx([3, 3, 0, np.nan], nan_ok=True)


def many() -> pd.DataFrame:
    """Six turns: those by hand, and the same a little harder."""
    again = by_hand().assign(test=lambda rows: rows["test"] + " again", H=lambda rows: 1.02 * rows["H"])
    return pd.concat([by_hand(), again], ignore_index=True)


def test_findings_over_turns_by_hand(claimed: Plan, tmp_path: Path) -> None:
    """A less H of `bad` is 2.5, 3.5, 4.5 in the turns by hand; in one turn of three `none` is not the worst."""
    by_claim = {one["id"]: one for one in turn_findings(many(), claimed)}
    assert {key: one["verdict"] for key, one in by_claim.items()} == {
        "R1": "confirmed",
        "R2": "confirmed",
        "R3": "confirmed",
        "R4": "refuted",
    }
    assert "bad 6.00 m -> 2.52 m, 3.4" in by_claim["R1"]["evidence"]
    assert by_claim["R1"]["evidence"].endswith("6 test manoeuvres")
    assert by_claim["R4"]["evidence"].startswith("worst over the horizon, physics alone included: bad alone")
    assert turn_findings(by_hand(), tiny_plan(tmp_path)) == []


def test_no_finding_is_about_numbers_that_were_set_from_runs_that_test(made: Callable[..., Any]) -> None:
    """As of `good`: then nothing is decided. A family of no claim is left out, and `none` is the worst at once."""
    cells = {(model, 2, 0): 1.0 for model in ("good", "bad", "tuned", "none")}
    claims = {"accurate": "good", "inaccurate": "bad"}
    plan: Plan = made(cells, claims=claims, alone={"good": 1.0, "bad": 2.0, "tuned": 0.5}).plan

    def seen(**runs: list[str]) -> Plan:
        families = [one.model_copy(update={"seen": runs.get(one.name, [])}) for one in plan.families]
        return replace(plan, families=tuple(families))

    for name in ("good", "bad"):
        unfair = turn_findings(many(), seen(**{name: ["another run", "ZZ 1"]}))
        assert {(one["verdict"], one["evidence"]) for one in unfair} == {
            ("undecided", f"the numbers of {name} were set from runs that test: name another in [claims]")
        }
    shown, left_out = (
        {one["id"]: one["evidence"] for one in turn_findings(many(), seen(tuned=runs, good=["another run"]))}
        for runs in (["another run"], ["ZZ 2"])
    )
    assert "most often worst: tuned" in shown["R4"] or "included: tuned" in shown["R4"]
    assert "tuned" not in left_out["R4"]


def test_few_turns_decide_nothing(claimed: Plan) -> None:
    claims = turn_findings(by_hand(), claimed)
    assert all(one["evidence"].endswith("5 would: name more runs with --tests") for one in claims)
    assert {one["verdict"] for one in claims} == {"undecided"}
    assert "3 test manoeuvres give no interval, 5 would" in claims[0]["evidence"]


def test_a_failed_cell_is_left_out(claimed: Plan) -> None:
    frame = many()
    frame.loc[(frame["foundation"] == "good") & (frame["test"] == "ZZ 0"), ["status", "H"]] = ["failed", np.nan]
    assert turn_findings(frame, claimed)[0]["evidence"].endswith("5 test manoeuvres")
    assert turns_table(frame).set_index("foundation").loc["good", "turns"] == 5
