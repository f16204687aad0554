"""The section on bands: what it says and draws, from frames made by hand."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from shipid.report import ReportContent, bands
from shipid.report.page import render_page
from shipid.report.section import draw_sections
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
            ("speed", "1 to 2 m/s", 0.9, ""),
            ("ahead", "5 s", 0.99, ""),
        ]
    ]
    worst = [{"model": "nominal", "run": "M003", "kind": "turning", "coverage": 0.1, "reach": 3.0}]
    refused = [{"model": "none", "N_D": 10, "reason": "a band of 90 % needs 9 runs or more"}]
    frames = {"coverage": pd.DataFrame(rows), "coverage_groups": pd.DataFrame(groups)}
    frames |= {"coverage_runs": pd.DataFrame(worst), "no_band": pd.DataFrame(refused)}
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
    worst = bands.table_of_run_coverage(banded)
    assert worst is not None
    assert worst.rows[0][0].text == "M003"


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


def test_the_coverage_says_which_models_are_drawn(banded: ReportContent) -> None:
    """Bands of methods that the study does not judge by are in the table; of these alone there is no figure."""
    frame = banded.frames["coverage"]
    other = frame.assign(model=frame.model + " + other")
    both = replace(banded, frames={**banded.frames, "coverage": pd.concat([frame, other], ignore_index=True)})
    figure = bands.coverage_figure(both)
    assert figure is not None
    names = [chip.label for chip in figure.chips]
    assert all(name in figure.how.partition(f" Of {2 * frame.model.nunique()} models, ")[2] for name in names)
    assert "drawn; the table has all." in figure.how
    alone = replace(banded, frames={**banded.frames, "coverage": other})
    assert bands.coverage_figure(alone) is None
    assert bands.coverage_table(alone) is not None


def test_bands_of_a_small_model_are_no_zeros(banded: ReportContent) -> None:
    frames = {name: frame.copy() for name, frame in banded.frames.items()}
    for name in ("coverage", "coverage_groups"):
        for column in {"width", "end"} & set(frames[name].columns):
            frames[name][column] /= 1000
    small = replace(banded, frames=frames)
    for table in (bands.coverage_table(small), bands.coverage_by_group(small)):
        assert table is not None
        place = list(table.columns).index("mean radius [m]")
        assert not {"0.00", "0.000"} & {row[place].text for row in table.rows}


def test_the_map_of_the_width(banded: ReportContent) -> None:
    figure = bands.width_figure(banded)
    assert figure is not None
    assert figure.takeaway.startswith("The mean radius of the band goes from ")
    least, most = banded.cells.groupby(["model", "N_D"]).width.mean().agg(["min", "max"])
    assert figure.scale is not None
    assert (figure.scale.low, figure.scale.high) == (pytest.approx(least), pytest.approx(most))


def test_the_map_of_the_width_speaks_of_hatching_where_there_is_some(banded: ReportContent) -> None:
    pure = banded.cells.family.eq("none")
    for factor, told in ((100.0, False), (0.01, True)):
        cells = banded.cells.assign(width=banded.cells.width.where(~pure, factor * banded.cells.width.mean()))
        figure = bands.width_figure(replace(banded, cells=cells))
        assert figure is not None
        assert ("Hatched: not narrower than the band of no physics" in figure.how) == told


def test_the_page_holds_it_and_no_tag(banded: ReportContent) -> None:
    only = {"how-far-off": SECTIONS["how-far-off"]}
    none = {name: getattr(banded, name).iloc[:0] for name in ("horizon", "over_time", "trials")}
    text = render_page("study", only, replace(banded, snapshots=[], answer=[], findings=[], **none))
    assert "How far off it may be" in text
    assert NASTY not in text
    (section,) = draw_sections(only, banded)
    assert [item.id for item in section.items] == list(bands.HOW_FAR_OFF.anchors)


def test_without_bands_nothing_is_drawn(simulation: ReportContent) -> None:
    assert bands.coverage_figure(simulation) is None
    assert bands.width_figure(simulation) is None
    assert draw_sections({"how-far-off": SECTIONS["how-far-off"]}, simulation) == []
