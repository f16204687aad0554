"""What differs between documents: defaults written out, blocks by name, one name for two ships."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from shipid.answer.compare import document_differences
from tests.study.tiny import tiny_plan


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
