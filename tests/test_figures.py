"""Every figure of the reports as a function, from results, contents or simple frames."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import pytest

from shipid import figures
from shipid.answer.pages import report_content
from shipid.data.checks import check_dataset
from shipid.data.dataset import read_dataset
from shipid.errors import ShipidError
from shipid.report import ReportContent
from shipid.report.figure import page_colours
from shipid.simulation.families import VesselFamily, read_family
from shipid.study.results import read_results
from shipid.study.store import DATASET
from shipid.vessel.load import load_vessel
from shipid.vessel.perturb import Family
from tests.report import test_identification, test_logs, test_motion, test_shares
from tests.report.test_cost import priced

OTHERS = {
    **dict.fromkeys(("estimates", "correlations", "free_runs", "residuals", "profiles"), test_identification.content),
    **dict.fromkeys(("track", "histories", "spiral"), lambda: test_motion.content("spiral")),
    "shares": test_shares.content,
    "motion": lambda: test_logs.content("log"),
    "spread": lambda: read_family("quick", "moderate").trajectories("zigzag", 20),
}


@pytest.fixture(scope="module")
def content(tiny_run: Path) -> ReportContent:
    return priced(report_content(read_results(tiny_run)), per_metre=30.0)


def test_every_option_of_a_signature_is_one_of_the_figure(content: ReportContent) -> None:
    """What a type checker takes is what the function takes."""
    drawn = 0
    for name in set(figures.__all__) - set(OTHERS):
        function = getattr(figures, name)
        kinds = get_type_hints(function, vars(figures) | {"Source": object, "VesselFamily": VesselFamily})
        for argument, kind in kinds.items():
            literals = [one for one in (kind, *get_args(kind)) if get_origin(one) is Literal]
            for option in (option for one in literals for option in get_args(one)):
                assert function(content, **{argument: option}).data, f"{name}: {argument} = {option!r}"
                drawn += 1
    assert drawn == 13


def test_every_colour_of_dark_is_one_of_light() -> None:
    """So a figure that can be drawn in dark can be drawn in light."""
    light, dark = (page_colours(theme) for theme in ("light", "dark"))
    assert dark.keys() <= light.keys()
    assert not any("var(" in light[name] for name in dark)
    assert light["ink"] != dark["ink"]


def test_the_factors_of_a_family_have_a_row_a_number_and_a_dot_a_member() -> None:
    drawn = figures.factors(read_family("quick", "moderate"))
    assert sum(len(trace.x) for trace in drawn.data if trace.x[0] is not None) == 3 * 32
    assert len(drawn.layout.yaxis.ticktext) == 32


@pytest.mark.parametrize("rules", [[], [{"set": {"inertia.x_G": 1.0}}]])
def test_a_family_that_has_no_factors_is_refused(rules: list[dict[str, Any]]) -> None:
    """One without rules, and one whose only number is 0 in the base."""
    base = load_vessel("gunnerus-28.9")
    with pytest.raises(ShipidError, match="family 'f' has no factors"):
        figures.factors(VesselFamily(Family(name="f", perturb=rules), base))


@pytest.mark.parametrize("name", figures.__all__)
def test_a_plain_plotly_figure(name: str, content: ReportContent) -> None:
    """It has data, a title, units at its axes, and no name of a colour that only the page knows."""
    made = getattr(figures, name)(OTHERS[name]() if name in OTHERS else content, dark=True)
    assert made.layout.paper_bgcolor == page_colours("dark")["page"]
    assert isinstance(made, go.Figure)
    assert len(made.data) > 0
    assert made.layout.title.text
    assert "var(" not in made.to_json()
    assert "A figure" not in inspect.getdoc(getattr(figures, name)).splitlines()[0]


def test_results_and_their_content_draw_the_same(tiny_run: Path) -> None:
    results = read_results(tiny_run)
    drawn = [figures.error_over_horizon(source).to_json() for source in (results, report_content(results))]
    assert drawn[0] == drawn[1]


def test_a_table_of_cells_is_enough() -> None:
    cells = pd.DataFrame({"model": ["a", "a", "b", "b"], "N_D": [10, 30, 10, 30], "H": [2.0, 1.0, 3.0, np.nan]})
    cells = cells.assign(
        family="given", seed=0, status=["ok", "ok", "ok", "failed"], sentence="", A=[4.0, 4.0, 5.0, 5.0]
    )
    cells = cells.assign(A_90=9.0, A_rms=9.0, H_90=9.0, rms=9.0)
    made = figures.gain(cells)
    lines = {trace.name: np.array(trace.y, dtype=float) for trace in made.data if len(trace.x) == 3}
    np.testing.assert_array_equal(lines["a"], [4.0, 2.0, 1.0])
    np.testing.assert_array_equal(lines["b"], [5.0, 3.0, np.nan])
    assert len(figures.error_map(cells).data[0].x) == 3 + 2
    with pytest.raises(ShipidError, match="there is nothing to draw: it needs rows of cells"):
        figures.gain(cells[:0])


def test_what_is_no_source_is_one_sentence() -> None:
    with pytest.raises(ShipidError, match=r"cells: lacks the columns N_D, H"):
        figures.gain(pd.DataFrame({"model": ["a"]}))
    with pytest.raises(ShipidError, match="source must be a Results, as of `read_results`, or a table of cells"):
        figures.gain("results/quick")  # type: ignore[arg-type]


@pytest.mark.parametrize("t", ["12", float("nan"), True])
def test_the_instant_of_a_prediction_is_a_number(content: ReportContent, t: object) -> None:
    with pytest.raises(ShipidError, match="t must be a"):
        figures.prediction(content, t=t)  # type: ignore[arg-type]


def test_the_path_of_a_prediction_is_the_recorded_one(content: ReportContent) -> None:
    window = content.snapshots[0]
    made = figures.prediction(content, run=window.run, t=window.t)
    truth = next(trace for trace in made.data if trace.name == "true path" and len(trace.x) > 1)
    np.testing.assert_allclose(truth.x, window.truth[:, 1], atol=1e-6)
    np.testing.assert_allclose(truth.y, window.truth[:, 0], atol=1e-6)
    hulls = [trace for trace in made.data if trace.name == "ship"]
    assert (
        np.ptp(np.hypot(np.diff(hulls[0].x), np.diff(hulls[0].y)) - np.hypot(np.diff(hulls[1].x), np.diff(hulls[1].y)))
        < 1e-4
    )
    with pytest.raises(ShipidError, match="Test run: 'M9' is none"):
        figures.prediction(content, run="M9")
    with pytest.raises(ShipidError, match="N_D: '5' is none"):
        figures.prediction(content, N_D=5)


def test_the_page_of_a_log_holds_its_runs_and_repairs(tiny_run):
    log = read_dataset(tiny_run / DATASET)
    repair = {"kind": "jump", "column": "north", "count": 3, "note": "interpolated"}
    log = type(log)(log.frame, {**log.metadata, "repairs": [repair], "source": {"file": "a.csv", "rows": 9}})
    checks = check_dataset(log)
    content = figures.check_content("tiny", log, checks)
    assert list(pd.unique(content.tracks["run"])) == log.runs
    assert list(pd.unique(content.series["run"])) == log.runs
    assert content.repairs.to_dict("records") == [repair]
    assert content.provenance["log"] == "file a.csv, rows 9"
    assert content.provenance["rows"] == str(len(log.frame))
    assert content.answer[0].text.startswith(("All ", f"{int((~checks['ok'].astype(bool)).sum())} of "))
