"""The pages of a run's folder, assembled from its results."""

from __future__ import annotations

import shutil
import threading
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shipid.answer import pages
from shipid.answer.pages import report_content, write_pages
from shipid.report import errors_over
from shipid.report.figure import PageFigure
from shipid.report.page import draw_sections
from shipid.report.paths import window_data
from shipid.report.sections import SECTIONS
from shipid.study import seals
from shipid.study.plan import build_plan
from shipid.study.results import read_cells, read_results
from tests.report.views import views
from tests.study.tiny import events_here, run_here, tiny_plan, without_figures


def test_no_model_is_named_that_no_cell_has(tmp_path: Path) -> None:
    methods = [{"name": "kernel", "kind": "kernel", "trials": 1, "steps": 2, "families": ["right", "wrong"]}]
    plan, folder = tiny_plan(tmp_path, {"method": methods, "grid.N_D": [4]}), tmp_path / "run"
    with without_figures():
        run_here(plan, folder)
    content = report_content(read_results(folder))
    assert set(content.models["model"]) == {"right", "wrong-1", "wrong-2"}
    assert "no physics" not in [chip.label for chip in errors_over.horizon_figure(content).chips]


def test_pages_are_written_anew_from_the_folder(tiny_run: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(tiny_run, tmp_path / "run")
    report = write_pages(str(folder))
    assert report == folder / "report.html"
    answer = (folder / "answer.txt").read_text().splitlines()
    assert answer == [sentence.text for sentence in report_content(read_results(folder)).answer]
    assert all(line in (folder / "summary.md").read_text() for line in answer)
    first = report.read_bytes()
    assert write_pages(folder).read_bytes() == first, "the same folder gives the same page"


def test_a_report_of_a_run_that_goes_on_is_no_end_of_it(
    tmp_path: Path, tiny_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run waits with its tables until the report of its first half is written; they are those of the whole run."""
    plan, folder = tiny_plan(tmp_path), tmp_path / "run"
    events = events_here(plan, folder)
    next(event for event in events if event.kind == "cell" and event.done == 4)
    events.close()  # type: ignore[attr-defined]
    run = threading.Thread(target=run_here, args=(plan, folder))

    def meanwhile(*args: Any) -> Any:
        content = report_content(*args)
        run.start()
        return content

    with without_figures():
        monkeypatch.setattr(pages, "report_content", meanwhile)
        report = write_pages(folder)
        monkeypatch.undo()
        run.join()
        assert "4 of 8 cells" in report.read_text()
        assert set(pd.read_parquet(folder / "results.parquet")["cell"]) == set(read_results(tiny_run).cells["cell"])
        assert seals.sealed_faults(folder) == []
        assert "4 of 8 cells" not in write_pages(folder).read_text()


def test_a_study_of_physics_alone_has_a_page_and_says_so(tmp_path: Path) -> None:
    """No method learns: there are no trials, no validation and no best model, and the errors are those of physics."""
    document = tiny_plan(tmp_path).document | {"method": [{"name": "alone", "kind": "alone"}]}
    folder = tmp_path / "run"
    run_here(build_plan(document, tmp_path / "tiny.toml"), folder)
    write_pages(folder)
    cells = read_cells(folder)
    assert (cells["H"] == cells["A"]).all()
    answer = (folder / "answer.txt").read_text()
    assert answer.startswith("No result joins physics and data, so there is no conclusion. Mean errors ")
    assert f"{cells['H_end'].min():.2f} m" in answer
    assert "best in validation" not in answer
    assert (folder / "report.html").stat().st_size > 1e5
    content = report_content(read_results(folder))
    assert content.alone == set(cells["model"])
    shown = [item for section in draw_sections(SECTIONS, content) for item in section.items]
    figures = [item for item in shown if isinstance(item, PageFigure)]
    assert {"horizon", "over-time", "browser"} <= {figure.id for figure in figures}
    assert not {"map", "gain"} & {figure.id for figure in figures}, "H is A everywhere"
    words = [text for item in shown for text in (item.title, item.takeaway, getattr(item, "how", ""))]
    words += [chip.label for figure in figures for chip in figure.chips]
    panels = [panel for figure in figures for panels in views(figure).values() for panel in panels]
    words += [str(trace.name) for panel in panels for trace in panel.data]
    words += (lines := [line["name"] for line in window_data(content)["lines"]])
    assert not [text for text in words if "ompensat" in text]
    assert len(lines) == len(set(lines))
