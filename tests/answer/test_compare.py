"""Any runs side by side: which cells match, and differences that follow by hand."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from shipid.answer.compare import compare, compare_results, document_differences
from shipid.cli import app
from shipid.errors import DocumentError, ResultError, ShipidError
from shipid.study.results import Results
from tests.answer.byhand import grid
from tests.study.tiny import run_here, tiny_plan

H = {"good": (1.0, 0.8), "bad": (2.0, 1.5), "none": (9.0, 5.0)}
Made = Callable[..., Results]


@pytest.fixture(scope="module")
def other_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tiny study with another method, more seeds, fewer amounts and a longer horizon."""
    folder = tmp_path_factory.mktemp("other")
    changes = {"method.0.name": "mine", "method.0.steps": 3, "grid.N_D": [4], "prediction.ahead": 6.0}
    run_here(tiny_plan(folder, changes), folder / "run")
    return folder / "run"


def placed(results: Results, name: str) -> Results:
    return replace(results, folder=results.folder / name)


def test_cells_of_runs_on_the_disk(tiny_run: Path, other_run: Path) -> None:
    """The means are those of the cells; windows that one run lacks are left out in both."""
    comparison = compare([tiny_run, other_run], {"kernel": "mine"})
    assert len(comparison.names) == 2
    assert set(comparison.documents["path"]) == {
        "method.kernel.name",
        "method.kernel.steps",
        "grid.N_D",
        "prediction.ahead",
    }
    assert list(comparison.errors["N_D"].unique()) == [0, 4], "6 is in one of them"
    assert set(comparison.errors["method"]) == {"alone", "kernel ~ mine"}
    assert comparison.errors.set_index(["family", "N_D"]).loc[("wrong", 4), "cells"] == 2
    assert any("on the 60 windows of both" in note for note in comparison.notes), comparison.notes
    whole = compare([other_run, tiny_run], {"mine": "kernel"}).errors  # turned round
    turned = 100 / (1 + comparison.errors["difference"] / 100) - 100
    np.testing.assert_allclose(whole["difference"], turned, atol=1e-9)
    np.testing.assert_allclose(whole["first"], comparison.errors["other"])


def test_a_run_and_itself_differ_in_nothing(made: Made) -> None:
    one = made(grid(H), runs=8)
    comparison = compare_results([placed(one, "a"), placed(one, "b")])
    assert comparison.documents.empty
    assert (comparison.errors["difference"] == 0).all()
    assert set(comparison.errors["verdict"]) == {"identical"}
    assert (comparison.errors[["low", "high"]] == 0).all(axis=None), "no training sets equal cells apart"
    assert "8 of 8 rows are identical to the digit" in comparison.notes[-1]
    assert comparison.errors["N_D"].tolist() == [0, 0, 10, 10, 10, 30, 30, 30]


def test_paired_differences_by_hand(made: Made) -> None:
    """Errors are hard * H with hard 0.9 to 1.1 over manoeuvres: a difference of means, and what training adds."""
    one, other = (made(grid({**H, "bad": bad}), runs=8) for bad in ((2.0, 1.5), (1.0, 1.5 + 1e-6)))
    comparison = compare_results([placed(one, "a"), placed(other, "b")]).errors.set_index(["family", "method", "N_D"])
    row = comparison.loc[("bad", "kernel", 10)]
    assert row[["first", "other", "difference"]].tolist() == pytest.approx([2.0, 1.0, -50.0])
    assert row[["first_end", "other_end"]].tolist() == pytest.approx([2.0, 1.0])
    assert row["first_end_90"] == pytest.approx(2.0 * np.quantile(np.linspace(0.9, 1.1, 8), 0.9))
    assert row["verdict"] == "lower"
    noise = 0.03 * 2**0.5  # of one draw each, and no other knowledge: 3 % of both
    assert [row["low"], row["high"]] == pytest.approx(
        [100 * (0.5 * np.exp(side * 2.3646 * noise) - 1) for side in (-1, 1)], rel=1e-3
    )
    same = comparison.loc[("bad", "kernel", 30)]
    assert same["difference"] == pytest.approx(0, abs=1e-3)
    assert same["low"] < 0 < same["high"], "alike, but trained apart: only what is equal to the digit is identical"
    assert same["verdict"] == ""
    assert comparison.loc[("bad", "alone", 0), ["low", "high"]].tolist() == [0, 0], "physics alone is not trained"


def test_the_same_orders_on_another_ship_are_pairs(made: Made) -> None:
    one, other = made(grid(H), runs=8), made(grid(H), runs=8)
    moved = replace(other.test, columns={**other.test.columns, "u": other.test.columns["u"] + 1.0})
    assert compare_results([placed(one, "a"), placed(replace(other, test=moved), "b")]).errors["cells"].all()


def test_counterparts_by_name_and_what_is_left_over(made: Made) -> None:
    one = made(grid(H), runs=8)
    renamed = {"clean": (1.0, 0.8), "bad": (2.0, 1.5), "none": (9.0, 5.0)}
    alone = {"clean": 2.0, "bad": 6.0}
    other = made(grid(renamed), runs=8, alone=alone, claims=None)
    notes = compare_results([placed(one, "a"), placed(other, "b")]).notes
    assert "b: only the first has family good (--pair FIRST=OTHER names counterparts)" in notes
    with pytest.raises(DocumentError, match="'goood' is no family or method of the first run: did you mean 'good'"):
        compare_results([placed(one, "a"), placed(other, "b")], {"goood": "bad"})
    with pytest.raises(DocumentError, match="'cleen' is no family or method of any other run: did you mean 'clean'"):
        compare_results([placed(one, "a"), placed(other, "b")], {"good": "cleen"})
    turned = compare_results([placed(one, "a"), placed(other, "b")], {"good": "bad", "bad": "clean"})
    rows = turned.errors.set_index(["family", "N_D"])
    assert rows.loc[("good ~ bad", 10), "difference"] == pytest.approx(100.0)
    assert rows.loc[("bad ~ clean", 10), "difference"] == pytest.approx(-50.0)


def test_cells_without_a_result_do_not_match(made: Made) -> None:
    failed = {**H, "bad": (None, 1.5)}
    comparison = compare_results([placed(made(grid(H), runs=8), "a"), placed(made(grid(failed), runs=8), "b")])
    assert ("bad", 10) not in set(zip(comparison.errors["family"], comparison.errors["N_D"], strict=True))
    assert any(note.startswith("b: 5 of 6 cells have a result") for note in comparison.notes)
    nothing = dict.fromkeys(H, (None, None))
    with pytest.raises(ResultError, match="has no cell with a result"):
        compare_results([placed(made(grid(H)), "a"), placed(made(grid(nothing)), "b")])


def test_nothing_in_common_is_one_line(made: Made, tiny_run: Path) -> None:
    one, other = made(grid(H, (10, 30))), made(grid(H, (5, 7)))
    with pytest.raises(
        ShipidError, match=r"no cell of .* N_D 10, 30; .* N_D 5, 7; .*--pair FIRST=OTHER, or .* --set grid.N_D="
    ):
        compare_results([placed(one, "a"), placed(other, "b")])
    moved = replace(one.test, columns={**one.test.columns, "u": one.test.columns["u"] + 1.0})
    foreign = made(grid(H), changes={"truth": {**one.plan.document["truth"], "seed": 99}})
    with pytest.raises(ShipidError, match=r"b: tests on other manoeuvres than .*a: nothing can be paired"):
        compare_results([placed(one, "a"), placed(replace(foreign, test=moved), "b")])
    for folders in ([tiny_run], str(tiny_run), [tiny_run, tiny_run]):
        with pytest.raises(ShipidError, match="two folders or more, each once"):
            compare(folders)


def test_seeds_are_those_of_the_document(made: Made) -> None:
    """Another world adds 1000 to every seed; its cells match all the same."""
    one = made(grid(H), runs=8)
    other = made(grid(H), runs=8, changes={"seed": 1})
    other.cells["seed"] += 1000
    assert (compare_results([placed(one, "a"), placed(other, "b")]).errors["cells"] == 1).all()


def test_the_command(tiny_run: Path, other_run: Path, tmp_path: Path) -> None:
    folders = [str(tiny_run), str(other_run)]
    shown = CliRunner().invoke(app, ["study", "compare", *folders, "--pair", "kernel=mine"])
    assert shown.exit_code == 0, shown.output
    lines = [" ".join(line.split()) for line in shown.output.splitlines()]
    assert "method.kernel.steps 2 3" in lines
    assert any(" wrong kernel ~ mine 4 2 " in line for line in lines)
    assert any(
        line.startswith("other run family method N_D cells") and line.endswith("difference 95 % from to verdict")
        for line in lines
    )
    table = tmp_path / "rows.csv"
    result = CliRunner().invoke(
        app, ["study", "compare", *folders, "--pair", "kernel=mine", "--json", "--out", str(table)]
    )
    document: dict[str, Any] = json.loads(result.stdout)
    assert {"folders", "documents", "errors", "notes", "file"} == set(document)
    assert document["errors"][0]["low"] is None, "four manoeuvres have no interval"
    assert len(table.read_text().splitlines()) == 1 + len(document["errors"])
    wrong = CliRunner().invoke(app, ["study", "compare", *folders, "--pair", "kernel"])
    assert isinstance(wrong.exception, DocumentError)


def test_equal_documents_and_defaults_written_out(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path)
    assert document_differences([plan, plan]).empty
    written = tiny_plan(tmp_path, {"split.folds": 1, "bands.level": 0.9, "prediction.step": 1, "method.0.mirror": True})
    assert document_differences([plan, written]).empty


def test_every_change_is_named_with_both_values(tmp_path: Path) -> None:
    changes = {"grid.N_D": [4, 5], "method.0.steps": 3, "truth.manoeuvre.0.n_rpm": [60.0, 100.0], "family.1.members": 3}
    changes_ = document_differences([tiny_plan(tmp_path), tiny_plan(tmp_path, changes)]).set_index("path")
    assert dict(zip(changes_.index, changes_[["0", "1"]].to_numpy().tolist(), strict=True)) == {
        "truth.manoeuvre.0.n_rpm": ["[50.0, 200.0]", "[60.0, 100.0]"],
        "grid.N_D": ["[4, 6]", "[4, 5]"],
        "method.kernel.steps": ["2", "3"],
        "family.wrong.members": ["2", "3"],
    }


def test_blocks_go_by_name_and_a_counterpart_by_the_name_of_the_first(tmp_path: Path) -> None:
    one, other = tiny_plan(tmp_path), tiny_plan(tmp_path, {"method.0.name": "mine", "method.0.steps": 3})
    assert set(document_differences([one, other])["path"]) == {"method.kernel", "method.mine"}
    changes_ = document_differences([one, other], called=[{}, {"mine": "kernel"}])
    assert set(changes_["path"]) == {"method.kernel.name", "method.kernel.steps"}


def test_one_name_for_two_ships(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path)
    ship = plan.vessels["gunnerus-28.9"]
    heavier = ship.with_values({"inertia.m": 1.01 * ship.parameters["inertia.m"]})
    changes_ = document_differences([plan, replace(plan, vessels={"gunnerus-28.9": heavier})])
    assert set(changes_["path"]) == {"vessel.gunnerus-28.9.digest", "vessel.gunnerus-28.9.inertia.m"}
