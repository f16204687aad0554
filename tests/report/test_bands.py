"""The section on bands: what it says and draws, from frames made by hand."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from shipid.report import AnswerSentence, ReportContent, bands
from shipid.report.page import draw_sections
from shipid.report.sections import SECTIONS
from tests.report.views import views


@pytest.fixture
def banded(simulation: ReportContent) -> ReportContent:
    cells = simulation.cells.assign(width=2.0 * simulation.cells.H, coverage=0.9)
    rows = [
        {
            "model": str(model),
            "family": "f",
            "N_D": size,
            "level": level,
            "coverage": level - 0.05 * (model == "high-1"),
        }
        | {"low": level - 0.1, "high": min(level + 0.1, 1.0), "width": 1.0 + level, "end": 3.0}
        | {"runs": 20, "seeds": 2}
        for model in pd.unique(cells.model)
        for size in (10, 30, 100)
        for level in (0.5, 0.8, 0.9)
    ]
    refused = [{"model": "none", "N_D": 10, "reason": "a band of 90 % needs 9 runs or more"}]
    frames = {"coverage": pd.DataFrame(rows)}
    frames |= {"no_band": pd.DataFrame(refused)}
    return replace(simulation, cells=cells, frames=frames)


def test_it_says_what_was_held(banded: ReportContent) -> None:
    figure = bands.coverage_figure(banded)
    words = "Bands of 90 % held 89 % of the whole test paths."
    told = replace(banded, answer=[AnswerSentence(words, "coverage")])
    assert bands.coverage_figure(told).takeaway == words
    assert len(views(figure)) == 3
    table = bands.coverage_table(banded)
    assert "needs 9 runs" in table.takeaway


def test_lines_of_the_coverage_are_those_of_a_close_up(banded: ReportContent) -> None:
    """Colours by A of two models of like accuracy cannot be told apart."""
    figure = bands.coverage_figure(banded)
    looks = {(chip.colour, chip.symbol) for chip in figure.chips}
    assert len(looks) == len(figure.chips)
    assert all(chip.symbol and "scale" not in chip.colour for chip in figure.chips)
    symbols = [trace.marker.symbol for trace in views(figure)["0"][0].data if trace.mode == "lines+markers"]
    assert symbols == [chip.symbol for chip in figure.chips]


def test_the_map_of_the_width(banded: ReportContent) -> None:
    figure = bands.width_figure(banded)
    assert figure.takeaway.startswith("The mean radius of the band goes from ")
    least, most = banded.cells.groupby(["model", "N_D"]).width.mean().agg(["min", "max"])
    assert (figure.scale.low, figure.scale.high) == (pytest.approx(least), pytest.approx(most))


def test_without_bands_nothing_is_drawn(simulation: ReportContent) -> None:
    assert draw_sections({"how-far-off": SECTIONS["how-far-off"]}, simulation) == []
