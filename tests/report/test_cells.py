from shipid.report.cells import THE_CELLS


def test_every_cell_is_a_row(simulation):
    (table,) = THE_CELLS.draw(simulation)
    assert table.id == "cells"
    assert len(table.rows) == len(simulation.cells) == 7 * 3 * 2
