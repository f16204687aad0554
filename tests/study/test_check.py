"""`shipid study check`: what is wrong with a folder, in lines."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from shipid.errors import ResultError
from shipid.hybrid.methods import METHODS
from shipid.study import seals, store
from shipid.study.check import check_folder
from tests.study.tiny import make_run, tiny_plan


def test_a_sound_folder_has_no_fault(tiny_run: Path) -> None:
    check = check_folder(tiny_run)
    assert check.lines == ["8 of 8 cells finished, 0 faults"]
    assert not check.faults


def test_every_fault_is_a_line(tiny_run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(tiny_run, folder)
    next((folder / "cells").iterdir()).unlink()
    (folder / "test.npz").write_bytes(b"half")
    store.note_session(folder, {"shipid": "9.9"})
    check = check_folder(folder)
    assert sorted(fault.kind for fault in check.faults) == ["changed", "missing"]
    text = "\n".join(check.lines)
    for words in (
        "computes it again",
        "is damaged",
        "2 faults",
        "computed in parts: shipid was",
    ):
        assert words in text


def test_a_run_that_has_just_begun(tmp_path: Path) -> None:
    make_run(tmp_path / "run", tiny_plan(tmp_path))
    assert check_folder(tmp_path / "run").lines == ["0 of 8 cells finished, 0 faults"]
    with pytest.raises(ResultError, match=r"no study\.toml"):
        check_folder(tmp_path)


def test_files_of_a_study_whose_method_is_not_here_are_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the file of a user's method is gone, the check of files gave up, too."""
    folder, changes = tmp_path / "run", {"method": [{"name": "mine", "kind": "mine"}], "repeat": {"seed": [0, 1]}}
    with monkeypatch.context() as patch:
        patch.setitem(METHODS, "mine", type("Mine", (METHODS["kernel"],), {"__module__": "mine"}))
        plan = tiny_plan(tmp_path, changes)
        make_run(folder, plan)
        for name, part in plan.parts.items():
            make_run(store.part_folder(folder, name), part.plan)
    check = check_folder(folder)
    assert not check.faults
    (line,) = check.lines
    assert line.startswith("0 faults; how far the run is cannot be said: ")
    assert "install the package, or name `--with` the file, that has its methods and terms: `shipid study rep" in line
    part = store.part_folder(folder, next(iter(plan.parts)))
    (part / "test.npz").write_bytes(b"whole")
    seals.write_seal(part, "common", [part / "test.npz"])
    (part / "test.npz").write_bytes(b"half")
    check = check_folder(folder)
    assert [fault.file for fault in check.faults] == ["test.npz"]
    assert check.lines[0].startswith(f"{part / 'test.npz'}: was changed")
