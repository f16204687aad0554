"""The section on what to buy: what it says and draws, from ways made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.exchange.cost import Ways
from shipid.report import AnswerSentence, ReportContent, cost
from shipid.report.page import draw_sections
from shipid.report.sections import SECTIONS
from shipid.study.schema import Cost
from tests.report.views import views

NASTY = "<b>sister</b>"


def priced(content: ReportContent, **goal: float) -> ReportContent:
    """Content with three kinds of physics and four amounts: 2 m at 8 runs, a run for 10, a sister for 35."""
    error = np.array([[12, 8, 4, 2], [9, 4, 3, 2], [3, 2.5, 2, 1]])
    block = Cost(unit="h", run=10.0, mobilisation=20.0, **goal)
    prices, amounts = np.array([0.0, 5.0, 35.0]), np.array([0.0, 2, 4, 8])
    ways = Ways(block, ("none", "template", NASTY), amounts, error * np.array([[[0.9]], [[1.0]], [[1.1]]]), prices)
    return replace(
        content,
        answer=[AnswerSentence("Buy.", "frontier"), AnswerSentence("Stop.", "frontier")],
        frames={**content.frames, "cost": ways.table()},
    )


@pytest.mark.parametrize("goal", [{"per_metre": 30.0}, {"H_end_required": 2.5}], ids=str)
def test_each_way_is_a_point_at_its_price_and_those_of_the_frontier_have_a_ring(
    simulation: ReportContent, goal: dict[str, float]
) -> None:
    content = priced(simulation, **goal)
    figure = cost.frontier_figure(content)
    (panel,) = views(figure).values()
    none, template, sister, *rest = panel[0].data
    assert np.array(none.x).tolist() == [0, 40, 60, 100]
    np.testing.assert_allclose(np.array(sister.y), [3, 2.5, 2, 1])
    assert np.array(template.marker.line.width).tolist() == [2, 0, 0, 0]
    assert np.array(sister.marker.line.width).tolist() == [2, 2, 2, 2]
    assert len(rest) == ("H_end_required" in goal)
    assert figure.takeaway == "Buy. From 12.0 m for 0 h to 1.00 m for 135 h."
    assert [chip.label for chip in figure.chips] == ["no physics", "template", NASTY]
    assert "<b>" not in f"{sister.name} {sister.customdata}"


def test_the_table_has_the_best_way_with_each_physics(simulation: ReportContent) -> None:
    """Goal 2.5 m: 8 runs do it for no physics and template; the sister needs 4, since 2.5 m is its mean at 2."""
    table = cost.ways_table(priced(simulation, H_end_required=2.5))
    runs = [row[table.columns.index("runs, N_D [1]")].text for row in table.rows]
    assert sorted(runs) == ["4", "8", "8"]
    assert "chance" in table.columns
    assert "*" not in table.takeaway, "text of a page is no Markdown"
    assert "chance" not in cost.ways_table(priced(simulation, per_metre=30.0)).columns


def test_without_costs_nothing_is_drawn(simulation: ReportContent) -> None:
    assert draw_sections({"cost": SECTIONS["cost"]}, simulation) == []
