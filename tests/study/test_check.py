"""`shipid study check`: what is wrong with a folder, in lines."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from shipid.errors import ResultError
from shipid.files import TEMPORARY
from shipid.study import store
from shipid.study.check import check_folder
from tests.study.tiny import tiny_plan


def test_a_sound_folder_has_no_fault(tiny_run: Path) -> None:
    check = check_folder(tiny_run)
    assert check.lines == ["8 of 8 cells finished, 0 faults"]
    assert not check.faults


def test_every_fault_is_a_line(tiny_run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(tiny_run, folder)
    next((folder / "cells").iterdir()).unlink()
    (folder / "test.npz").write_bytes(b"half")
    (folder / f"{TEMPORARY}x-1-abc").mkdir()
    store.note_session(folder, {"shipid": "9.9"})
    check = check_folder(folder)
    assert sorted(fault.kind for fault in check.faults) == ["damaged", "missing"]
    text = "\n".join(check.lines)
    for words in (
        "computes it again",
        "2 faults",
        "1 temporary folder of killed runs: the next run removes it",
        "computed in parts: shipid was",
    ):
        assert words in text


def test_a_run_that_has_just_begun(tmp_path: Path) -> None:
    store.open_folder(tmp_path / "run", tiny_plan(tmp_path))
    assert check_folder(tmp_path / "run").lines == ["0 of 8 cells finished, 0 faults"]
    with pytest.raises(ResultError, match=r"no study\.toml"):
        check_folder(tmp_path)
