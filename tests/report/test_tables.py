import numpy as np
import pandas as pd
import pytest

from shipid.report.tables import cells, envelope, figure, models, repairs, text


def test_numbers_align_and_what_is_missing_sorts_last():
    assert figure(0.9, 2).text == "0.90"
    assert figure(-12.345, 1).text == "−12.3"
    assert figure(np.nan, 2).text == "–"
    assert figure(np.nan, 2).key > 1e200
    assert text(None).text == text(np.nan).text == text(pd.NA).text == "–"


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


def test_models_are_ordered_by_accuracy(simulation):
    table = models(simulation)
    assert [row[0].text for row in table.rows][:2] == ["nominal", "moderate-1"]
    assert table.takeaway == "A runs from 0.90 m (nominal) to 13.0 m (high-2)."


def test_envelope_and_repairs_hold_their_numbers(full_scale):
    table = envelope(full_scale)
    assert list(table.columns) == ["input", "unit", "train, all folds", "test"]
    assert table.rows[0][3].text == "0.00 / 2.30 / 5.88"
    assert repairs(full_scale).takeaway == "2 repairs: repeated samples and jump in position."
