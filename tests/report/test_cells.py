from dataclasses import replace

import pytest

from shipid.report.cells import cells_table as cells


def test_every_cell_is_a_row(content):
    table = cells(content)
    assert len(table.rows) == len(content.cells)
    column = list(table.columns).index("H [m]")
    keys = [row[column].key for row in table.rows]
    expected = content.cells.H.fillna(1e300).tolist()
    assert keys == pytest.approx(expected)


def test_the_failed_cell_gives_its_reason(full_scale):
    table = cells(full_scale)
    bad = [cell.text for row in table.rows for cell in row if cell.bad]
    assert bad == ["diverged: 4 % of the test windows left the sea"]
    assert table.takeaway == "4 cells in 3 min of computing; 1 cell gave no result."


def test_cells_count_their_trials(simulation):
    table = cells(simulation)
    first = simulation.trials[simulation.trials.cell == simulation.cells.cell.iloc[0]]
    numbers = dict(zip(table.columns, table.rows[0], strict=True))
    assert numbers["trials [1]"].key == len(first) == 12
    assert numbers["diverged [1]"].key == first.state.eq("diverged").sum()
    assert "trials [1]" not in cells(replace(simulation, trials=simulation.trials.iloc[:0])).columns


def test_errors_of_a_small_model_are_no_zeros(simulation):
    """A 300th of the errors, as of a model of a metre: no column of 0.00."""
    small = simulation.cells.assign(H=simulation.cells.H / 300, A=simulation.cells.A / 300)
    table = cells(replace(simulation, cells=small))
    for name in ("H [m]", "A [m]"):
        texts = [row[list(table.columns).index(name)].text for row in table.rows]
        assert not {"0.00", "0.000"} & set(texts)
        assert len({len(text.partition(".")[2]) for text in texts if text != "–"}) == 1, "points align"
