"""A run's folder, read: cells, paths and the command that reproduces it."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid import figures
from shipid.study.plan import read_plan, run_command
from shipid.study.results import Results, read_cells, read_results


@pytest.fixture(scope="module")
def read(tiny_run: Path) -> Results:
    return read_results(tiny_run)


def test_cells_in_one_call_are_those_of_the_whole_results(read: Results, tiny_run: Path) -> None:
    cells = read_cells(tiny_run)
    pd.testing.assert_frame_equal(cells, read.cells[list(cells.columns)])
    assert {"foundation", "method", "model", "N_D", "seed", "A", "H", "status"} <= set(cells.columns)
    assert figures.gain(cells).data  # a figure takes the table as it is


def test_errors_by_test_manoeuvre_are_those_of_the_cells(read: Results) -> None:
    for row in read.rows:
        assert read.errors[row["cell"]] @ read.windows / read.windows.sum() == pytest.approx(row["H"])
    assert read.windows.sum() == len(read.test)


def test_errors_by_axis_of_every_model(read: Results) -> None:
    models = read.models.set_index("model")
    assert models.loc["none", ["A_along", "A_across"]].isna().all()
    error = np.abs(read.physics["wrong-1"] - read.test.future).mean(axis=(0, 1))
    assert models.loc["wrong-1", ["A_along", "A_across"]].tolist() == pytest.approx(error.tolist())


def test_the_command_reproduces_the_study(read: Results) -> None:
    """A bundled study by its name, any other by its file; with what `--set` changed."""
    assert run_command(read.plan) == f"shipid study run {read.plan.file}"
    changed = read_plan("quick", {"grid.N_D": [10], "question": "How far?"})
    assert run_command(changed) == "shipid study run quick --set 'grid.N_D=[10]' --set 'question=\"How far?\"'"
    asked = read_plan("quick", {"question": "How good is the captain's model?"})
    assert shlex.split(run_command(asked))[-1] == 'question="How good is the captain\'s model?"'
