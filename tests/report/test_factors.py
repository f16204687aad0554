from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid.report.factors import cells_table, factors_figure
from tests.report.views import views


def test_one_dot_per_number_at_its_factor(simulation):
    figure = factors_figure(simulation)
    plot = views(figure)[""][0]
    assert [trace.name for trace in plot.data] == ["hull", "inertia", "added mass", "thruster"]
    assert [chip.label for chip in figure.chips] == [trace.name for trace in plot.data]
    rows = ["moderate-1", "moderate-2", "moderate-3", "high-1", "high-2"]
    for trace in plot.data:
        mine = simulation.factors[simulation.factors.group == trace.name]
        np.testing.assert_allclose(trace.x, mine.factor, rtol=1e-5)
        assert [rows[int(y)] for y in np.asarray(trace.y)] == list(mine.model)
        assert trace.customdata[0] == f"{mine.model.iloc[0]}: {mine.path.iloc[0]} × {mine.factor.iloc[0]:.3g}"
    low, high = plot.layout.xaxis.range
    assert low < np.log10(simulation.factors.factor.min())
    assert high > np.log10(simulation.factors.factor.max())
    assert "Not perturbed: nominal." in figure.how, "what has no physics is no model that was spared"


def test_takeaway_counts_and_finds_the_farthest(simulation):
    squared = np.log(simulation.factors.factor) ** 2
    away = np.exp(np.sqrt(squared.groupby(simulation.factors.model).mean()))
    text = factors_figure(simulation).takeaway
    assert text.startswith(f"{len(simulation.factors)} numbers in 5 models, times ")
    assert f"{away.idxmax()} is farthest from its base, by a factor of {away.max():.2f}" in text


def test_removed_terms_are_no_numbers_times_a_factor(full_scale):
    """`10 numbers, times factors from 0.60 to 0.67; 5 terms removed` counted the five twice."""
    row = full_scale.factors.iloc[0]
    frame = pd.DataFrame(
        [{**row, "path": path, "factor": factor} for path, factor in zip("abc", (0.0, 0.6, 0.7), strict=True)]
    )
    assert factors_figure(replace(full_scale, factors=frame)).takeaway == (
        "2 numbers in 1 model, times 0.60 to 0.70; 1 term removed."
    )
    same = factors_figure(replace(full_scale, factors=frame.assign(factor=0.6))).takeaway
    assert same == "3 numbers in 1 model, times 0.60."
    gone = frame.assign(factor=0.0)
    assert factors_figure(replace(full_scale, factors=gone)).takeaway == "1 model changed; 3 terms removed."


@pytest.mark.parametrize("factor", [0.0, -0.5])
def test_a_removed_term_lies_at_the_left_edge(full_scale, factor):
    figure = factors_figure(replace(full_scale, factors=full_scale.factors.assign(factor=[factor, 1.2])))
    plot = views(figure)[""][0]
    assert 10 ** plot.layout.xaxis.range[0] < plot.data[0].x[0] < 0.8
    assert "0 removes the term" in figure.how


def test_every_cell_is_a_row(content):
    table = cells_table(content)
    assert len(table.rows) == len(content.cells)
    column = list(table.columns).index("H [m]")
    keys = [row[column].key for row in table.rows]
    expected = content.cells.H.fillna(1e300).tolist()
    assert keys == pytest.approx(expected)


def test_the_failed_cell_gives_its_reason(full_scale):
    table = cells_table(full_scale)
    bad = [cell.text for row in table.rows for cell in row if cell.bad]
    assert bad == ["diverged: 4 % of the test windows left the sea"]
    assert table.takeaway == "4 cells in 3 min of computing; 1 cell gave no result."


def test_cells_count_their_trials(simulation):
    table = cells_table(simulation)
    first = simulation.trials[simulation.trials.cell == simulation.cells.cell.iloc[0]]
    numbers = dict(zip(table.columns, table.rows[0], strict=True))
    assert numbers["trials [1]"].key == len(first) == 12
    assert numbers["diverged [1]"].key == first.state.eq("diverged").sum()
    assert "trials [1]" not in cells_table(replace(simulation, trials=simulation.trials.iloc[:0])).columns


def test_errors_of_a_small_model_are_no_zeros(simulation):
    """A 300th of the errors, as of a model of a metre: no column of 0.00."""
    small = simulation.cells.assign(H=simulation.cells.H / 300, A=simulation.cells.A / 300)
    table = cells_table(replace(simulation, cells=small))
    for name in ("H [m]", "A [m]"):
        texts = [row[list(table.columns).index(name)].text for row in table.rows]
        assert not {"0.00", "0.000"} & set(texts)
        assert len({len(text.partition(".")[2]) for text in texts if text != "–"}) == 1, "points align"
