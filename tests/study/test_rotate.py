"""Turns: each is the study with that run as its test, and their findings follow by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DocumentError
from shipid.study import rotate as rotate_module
from shipid.study.plan import Plan, whole_unit
from shipid.study.prepare import prepare
from shipid.study.rotate import copied, rotate, spread, turn_findings, turns
from shipid.study.run import run_unit
from shipid.study.verdict import Finding
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
    rows_of_turns = pd.concat(list(rotate(plan, dataset, ["a", "b"])))
    for test in ("a", "b"):
        single, _ = recorded(weaving(), split={"test": [test]}, prediction={"ahead": 5.0}, grid={"N_D": [5]})
        prepared = prepare(single, dataset)
        rows = [row for row, *_ in run_unit(single, prepared, whole_unit(single, single.batches[0]), "cpu")]
        turn = rows_of_turns[rows_of_turns["test"] == test]
        assert list(turn["foundation"]) == [row["foundation"] for row in rows]
        assert (turn["N_D"] == 5).all()
        for name in ("A", "H"):
            np.testing.assert_allclose(turn[name], [row[name] for row in rows], rtol=1e-12)


def test_copies_of_runs_are_named_before_their_errors_are_believed(
    recorded: Callable[..., tuple[Plan, Dataset]],
) -> None:
    """Of two copies one trained while the other tested: errors of millimetres, without a word."""
    log = weaving()
    copy = log.frame[log.frame["run"] == "a"].assign(run="again", t=lambda rows: rows["t"] + 1e4)
    twice = Dataset(pd.concat([log.frame, copy], ignore_index=True), {**log.metadata, "clock": "run"})
    plan, dataset = recorded(twice, split={"test": ["f"]}, prediction={"ahead": 5.0})
    assert copied(plan, dataset).startswith("runs that move as others do ('again' as 'a'): where one tests")
    plan, dataset = recorded(log, split={"test": ["f"]}, prediction={"ahead": 5.0})
    assert not copied(plan, dataset)


@pytest.mark.parametrize("after", [3, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 2, 4))])
def test_an_interrupted_rotation_goes_on_to_the_same_digits(
    after: int, recorded: Callable[..., tuple[Plan, Dataset]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Interrupted in the n-th batch, whatever turn it is of: nothing that was finished is computed again."""
    plan, dataset = recorded(
        weaving(), split={"test": ["f"]}, prediction={"ahead": 5.0}, grid={"N_D": [5], "seeds": [0, 1]}
    )
    whole = pd.concat(list(rotate(plan, dataset, ["a", "b"])))
    kept, begun = rotate_module.kept_folder(tmp_path / "rows.csv", plan, dataset), []

    def counted(*arguments: Any) -> Any:
        begun.append(arguments)
        if len(begun) == after:
            raise KeyboardInterrupt
        return run_unit(*arguments)

    monkeypatch.setattr(rotate_module, "run_unit", counted)
    with pytest.raises(KeyboardInterrupt):
        list(rotate(plan, dataset, ["a", "b"], kept=kept))
    again = pd.concat(list(rotate(plan, dataset, ["a", "b"], kept=kept)))
    assert len(begun) == 4 + 1, "the interrupted batch alone is begun twice"
    pd.testing.assert_frame_equal(again, whole, check_exact=True)
    rotate_module.forget(kept)
    assert not (tmp_path / "rows.csv.turns").exists()


def test_what_is_kept_belongs_to_one_question(
    recorded: Callable[..., tuple[Plan, Dataset]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Other settings, data, devices or code have another folder; a damaged or edited file is computed again.

    So have two vessels that are exchanged, whose digests are the same two.
    """
    plan, dataset = recorded(weaving(), split={"test": ["f"]}, prediction={"ahead": 5.0}, grid={"N_D": [5]})
    file = tmp_path / "rows.csv"
    other, _ = recorded(weaving(), split={"test": ["f"]}, prediction={"ahead": 6.0}, grid={"N_D": [5]})
    moved = Dataset(dataset.frame.assign(u=dataset.frame["u"] + 0.1), dataset.metadata)
    here = next(iter(plan.vessels.values()))
    two = {"here": here, "there": here.with_values({"inertia.m": 1.1 * here.parameters["inertia.m"]})}
    placed = [replace(plan, vessels=dict(zip(two, pair, strict=True))) for pair in permutations(two.values())]
    folders = [
        rotate_module.kept_folder(file, *one)
        for one in ((plan, dataset), (other, dataset), (plan, moved), (plan, dataset, "cuda"))
    ]
    folders += [rotate_module.kept_folder(file, each, dataset) for each in placed]
    monkeypatch.setattr(rotate_module, "code_digest", lambda: "another commit")
    folders.append(rotate_module.kept_folder(file, plan, dataset))
    assert len(set(folders)) == 7
    first = pd.concat(list(rotate(plan, dataset, ["a", "b"], kept=folders[0])))
    next(folders[0].glob("*.parquet")).write_bytes(b"PAR1 no more")
    again = pd.concat(list(rotate(plan, dataset, ["a", "b"], kept=folders[0])))
    pd.testing.assert_frame_equal(again, first, check_exact=True)
    edited = next(folders[0].glob("*.parquet"))
    pd.read_parquet(edited).assign(H=0.0).to_parquet(edited)
    again = pd.concat(list(rotate(plan, dataset, ["a", "b"], kept=folders[0])))
    pd.testing.assert_frame_equal(again, first, check_exact=True)


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
    assert spread(frame).set_index("foundation").loc["good", "turns"] == 5


def test_families_of_several_members_and_models_without_any_result(claimed: Plan) -> None:
    """Members are averaged; where a side of a difference has no result at all there is no finding."""
    frame = many()
    two = frame.assign(foundation=frame["foundation"] + "-2", H=frame["H"] + 1.0)
    assert "bad 6.00 m -> 3.02 m" in turn_findings(pd.concat([frame, two]), claimed)[0]["evidence"]
    assert turn_findings(frame[frame["foundation"] != "good"], claimed) == []


def test_no_physics_is_compared_with_every_member_of_a_family_and_with_its_physics_alone(claimed: Plan) -> None:
    """As in a run. `none` has 33 m in the mean, the members 1 and 49 m, or 60 m alone: their mean would hide it."""
    frame = many()
    frame["H"] += 30.0 * (frame["foundation"] == "none")

    def judged(H: float, A: float) -> Finding:
        good = frame[frame["foundation"] == "good"].assign(family="wide", A=1.0, H=1.0)
        wide = [good.assign(foundation="wide-1"), good.assign(foundation="wide-2", A=A, H=H)]
        return turn_findings(pd.concat([frame, *wide]), claimed)[3]

    worst = {'"no physics"': judged(H=1.0, A=1.0), "wide-2": judged(H=49.0, A=1.0), "wide-2 alone": judged(1.0, 60.0)}
    for name, one in worst.items():
        assert one["evidence"].startswith(f"worst over the horizon, physics alone included: {name}; ")
        assert (one["verdict"] == "refuted") == name.startswith("wide")


def test_a_run_without_windows_takes_no_turn(recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    dataset = weaving()
    short = dataset.frame[(dataset.frame["run"] != "c") | (dataset.frame["t"] < 3.0)].reset_index(drop=True)
    plan, cut = recorded(Dataset(short, dataset.metadata), split={"test": 1}, prediction={"ahead": 5.0})
    assert turns(plan, cut, ["*"]) == ["a", "b", "d", "e", "f"]
