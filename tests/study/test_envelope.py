"""The envelope of the paper's simulation study, beside what the paper published."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.data.dataset import read_dataset
from shipid.study.envelope import envelope_table, input_envelope
from shipid.study.plan import read_plan
from shipid.study.prepare import obtain_runs, partition, runs_by_amount

AT_REST = 0.25  # m/s: what waves add to a ship that starts at rest


def test_the_truth_fills_the_published_envelope() -> None:
    """All manoeuvres together: every least and greatest value within 20 % of the paper's Table 1."""
    plan = read_plan("simulation")
    dataset = obtain_runs(plan)
    pool, test, _ = partition(plan, dataset)
    rows = envelope_table(
        input_envelope(pool, test, runs_by_amount(plan.study, pool), dataset.commands), plan.study.published
    )
    theirs = rows[rows["set"] == "published"].set_index("quantity")
    ours = rows[rows["set"].isin(["D_100", "test"])].groupby("quantity").agg({"min": "min", "max": "max"})
    assert list(theirs.index) == ["u", "v", "r", "port.n", "port.alpha", "u_rw", "v_rw"]
    for quantity, row in theirs.iterrows():
        for limit in ("min", "max"):
            assert ours.loc[quantity, limit] == pytest.approx(row[limit], rel=0.2, abs=AT_REST), (quantity, limit)


def test_simulate_writes_a_dataset_and_shows_the_envelope(tmp_path: Path) -> None:
    file = tmp_path / "few.parquet"
    given = ["--set", "truth.manoeuvres=12", "--set", "split.test=2", "--set", "grid.N_D=[4,10]", "--out", str(file)]
    result = CliRunner().invoke(app, ["simulate", "simulation-small", *given])
    assert result.exit_code == 0, result.output
    for words in ("12 runs", "D_4", "D_10", "test", "published", "deg/s"):
        assert words in result.output
    frame = read_dataset(file).frame
    assert np.allclose(frame.groupby("run")["t"].max(), 80.0)
    assert {"z", "phi", "theta", "V_w", "beta_w"} <= set(frame.columns)
