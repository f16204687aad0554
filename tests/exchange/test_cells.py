"""The table of cells: what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.errors import DataError
from shipid.exchange.law import check_cells, read_cell_table
from tests.exchange.drawn_cells import draw_cells


@pytest.fixture(scope="module")
def cells():
    return draw_cells(2, 1, ("nominal", "none"))


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_a_table_is_read_as_it_was_written(cells, tmp_path, ending):
    file = tmp_path / f"cells{ending}"
    getattr(cells, f"to_{ending[1:]}")(file, index=False)
    assert read_cell_table(file)["H"].to_numpy() == pytest.approx(cells["H"].to_numpy())


def test_cells_that_diverged_are_left_out(cells):
    wild = cells.assign(H=cells["H"].where(cells["N_D"] > 1, np.nan))
    assert set(check_cells(wild)["N_D"]) == {2, 4, 8, 16, 32, 64}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"kind": "guess"}, "cells.csv: kind: 'guess' is no kind: give one of nominal, "),
        ({"baseline": 0.0}, "cells.csv: baseline: 0 is not above 0"),
        ({"A": -1.0}, "cells.csv: A: -1 is not above 0"),
        ({"H": 0.0}, "cells.csv: H: 0 is not above 0"),
    ],
)
def test_a_wrong_value_is_one_line(cells, tmp_path, changed, words):
    cells.assign(**changed).to_csv(tmp_path / "cells.csv", index=False)
    with pytest.raises(DataError) as error:
        read_cell_table(tmp_path / "cells.csv")
    assert words in str(error.value)


def test_a_missing_column_is_named(cells, tmp_path):
    cells.drop(columns="floor").to_csv(tmp_path / "cells.csv", index=False)
    with pytest.raises(DataError, match="floor: missing: a table of cells has the columns ship, type"):
        read_cell_table(tmp_path / "cells.csv")


@pytest.mark.parametrize("content", [b"", b"PAR1 and no more", b"ship,H\nmariner,wide\n", b"\xff\xfe\x00"])
@pytest.mark.parametrize("name", ["cells.csv", "cells.parquet"])
def test_what_is_no_table_is_one_line(content, name, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError) as error:
        read_cell_table(tmp_path / name)
    assert str(tmp_path / name) in str(error.value)
