"""The pages of a run's folder, assembled from its results."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd
import pytest

from shipid.study import contents
from shipid.study.contents import report_content, write_pages
from shipid.study.results import read_results


def test_content_holds_what_the_results_hold(tiny_run: Path) -> None:
    results = read_results(tiny_run)
    content = report_content(results)
    assert content.title == results.plan.study.question
    pd.testing.assert_frame_equal(content.cells, results.cells)
    assert set(content.horizon["model"]) >= {"right", "wrong-1", "wrong-2", "none"}
    assert content.naive["mean"] == pytest.approx(results.naive.mean())
    assert content.answer


def test_a_further_frame_is_one_line(tiny_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(contents.FRAMES, "failed", lambda results: results.cells[results.cells["status"] != "ok"])
    assert len(report_content(read_results(tiny_run)).frames["failed"]) == 0


def test_pages_are_written_anew_from_the_folder(tiny_run: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(tiny_run, tmp_path / "run")
    report = write_pages(folder)
    assert report == folder / "report.html"
    answer = (folder / "answer.txt").read_text().splitlines()
    assert answer == [sentence.text for sentence in report_content(read_results(folder)).answer]
    assert all(line in (folder / "summary.md").read_text() for line in answer)
    first = report.read_bytes()
    assert write_pages(folder).read_bytes() == first, "the same folder gives the same page"
