"""The section on bands: what it says and draws, from frames made by hand."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from shipid.report import ReportContent, bands
from shipid.report.page import draw_sections
from shipid.report.sections import SECTIONS
from tests.report.views import views

NASTY = "<b>wrong</b>"


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
        | {"low": level - 0.1, "high": min(level + 0.1, 1.0), "width": 1.0 + level, "end": 3.0, "lengths": 0.1}
        | {"runs": 20, "seeds": 2}
        for model in pd.unique(cells.model)
        for size in (10, 30, 100)
        for level in (0.5, 0.8, 0.9)
    ]
    groups = [
        {"model": "nominal", "by": by, "group": group, "coverage": share, "low": 0.5, "high": 0.95, "width": 1.0}
        | {"runs": 5, "note": note}
        for by, group, share, note in [
            ("kind", NASTY, 0.6, "2 runs of this kind calibrated the band: too few"),
            ("ahead", "5 s", 0.99, ""),
        ]
    ]
    refused = [{"model": "none", "N_D": 10, "reason": "a band of 90 % needs 9 runs or more"}]
    frames = {"coverage": pd.DataFrame(rows), "coverage_groups": pd.DataFrame(groups)}
    frames |= {"no_band": pd.DataFrame(refused)}
    return replace(simulation, cells=cells, frames=frames)


def test_it_says_what_was_held(banded: ReportContent) -> None:
    figure = bands.coverage_figure(banded)
    assert figure is not None
    assert "bands of 90 % hold 89 % of the test paths" in figure.takeaway
    assert len(views(figure)) == 3
    groups = bands.coverage_by_group(banded)
    assert groups is not None
    assert NASTY in groups.takeaway
    assert groups.takeaway.startswith("Bands hold least at ")
    assert "60 % of the paths" in groups.takeaway
    notes = [row[-1].text for row in groups.rows if row[1].text == "manoeuvre"]
    assert notes == ["2 runs of this kind calibrated the band: too few"]
    assert "--kind" not in groups.takeaway, "too few runs of this kind: it has no band"
    table = bands.coverage_table(banded)
    assert table is not None
    assert "needs 9 runs" in table.takeaway


@pytest.mark.parametrize(("kinds", "said"), [(("zigzag", "turning"), True), (("zigzag",), False)])
def test_a_band_for_one_kind_is_named_where_there_is_one(
    banded: ReportContent, kinds: tuple[str, ...], said: bool
) -> None:
    rows = [
        {"model": "nominal", "by": "kind", "group": kind, "coverage": 0.6, "low": 0.5, "high": 0.7, "width": 1.0}
        | {"runs": 5, "note": ""}
        for kind in kinds
    ]
    table = bands.coverage_by_group(replace(banded, frames={**banded.frames, "coverage_groups": pd.DataFrame(rows)}))
    assert table is not None
    assert ("--kind of shipid predict" in table.takeaway) is said


def test_lines_of_the_coverage_are_those_of_a_close_up(banded: ReportContent) -> None:
    """Colours by A of two models of like accuracy cannot be told apart."""
    figure = bands.coverage_figure(banded)
    assert figure is not None
    looks = {(chip.colour, chip.symbol) for chip in figure.chips}
    assert len(looks) == len(figure.chips)
    assert all(chip.symbol and "scale" not in chip.colour for chip in figure.chips)
    symbols = [trace.marker.symbol for trace in views(figure)["0"][0].data if trace.mode == "lines+markers"]
    assert symbols == [chip.symbol for chip in figure.chips]


def test_the_map_of_the_width(banded: ReportContent) -> None:
    figure = bands.width_figure(banded)
    assert figure is not None
    assert figure.takeaway.startswith("The mean radius of the band goes from ")
    least, most = banded.cells.groupby(["model", "N_D"]).width.mean().agg(["min", "max"])
    assert figure.scale is not None
    assert (figure.scale.low, figure.scale.high) == (pytest.approx(least), pytest.approx(most))


def test_without_bands_nothing_is_drawn(simulation: ReportContent) -> None:
    assert draw_sections({"how-far-off": SECTIONS["how-far-off"]}, simulation) == []
