"""Windows that go out: what the methods of a study are trained on, and nothing of the future of the test."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

from shipid.errors import ShipidError
from shipid.study.cells import work_of
from shipid.study.prepare import obtain_runs, prepare
from shipid.study.windows import windows
from tests.study.tiny import mixed_plan, tiny_plan, whole_unit

PAST = {"prediction.past": 3.0}


def test_residuals_are_the_targets_of_the_methods_of_the_study(tmp_path: Path) -> None:
    """Also of a family whose numbers are identified from the runs of the batch."""
    plan = mixed_plan(tmp_path)
    out, prepared = windows(plan), prepare(plan, obtain_runs(plan))
    work = work_of(prepared, whole_unit(plan, plan.batches[0]), plan.methods, "cpu")
    train = out.keys["split"].eq("train").to_numpy()
    for name, one in work.known.items():
        np.testing.assert_array_equal(out.residual[name][:, train], work.windows.future - one.paths)
        np.testing.assert_array_equal(out.physics[name][:, ~train], one.test_paths)


@pytest.mark.parametrize("known", [False, True])
def test_the_future_of_the_test_stays_unless_it_is_asked_for(tmp_path: Path, known: bool) -> None:
    plan = tiny_plan(tmp_path, {**PAST, "prediction.commands": "known" if known else "held"})
    for with_truth in (False, True):
        out = windows(plan, with_truth=with_truth)
        tables = {file.stem: pd.read_parquet(file) for file in out.write(tmp_path / "out")}
        test = tables["future"].merge(out.keys)["split"].eq("test")
        truth = tables["future"][["north", "east", "x", "y", "psi", "u", "v", "r"]]
        assert truth[test].notna().all(axis=None) == truth[test].notna().any(axis=None) == with_truth
        assert truth[~test].notna().all(axis=None)
        now = np.stack([out.windows.columns[name] for name in out.names["orders"]], axis=-1)
        assert known or (out.arrays()["orders"] == now).all()
        assert all(table.attrs["shipid"]["with_truth"] == with_truth for table in tables.values())
    assert tables["past"]["ahead"].max() < 0 < tables["physics"]["ahead"].min()


def test_folds_leave_out_every_training_window_once_and_tensors_are_one_call(tmp_path: Path) -> None:
    out = windows(tiny_plan(tmp_path, PAST), N_D=4, seed=0)
    train, fold = np.flatnonzero(out.keys["split"] == "train"), out.keys["fold"].to_numpy()
    assert sorted(np.concatenate([validation for _, validation in out.folds])) == train.tolist()
    for number, (training, validation) in enumerate(out.folds):
        assert (fold[validation] == number).all()
        assert not {*out.windows.run[training]} & {*out.windows.run[validation]}
    for array in (*out.arrays().values(), *out.residual.values(), *out.physics.values()):
        assert torch.from_numpy(array).is_contiguous()


def test_what_the_grid_does_not_have_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ShipidError, match=r"N_D.*'5'.*4, 6|N_D.*4, 6.*'5'"):
        windows(tiny_plan(tmp_path), N_D=5)
    with pytest.raises(ShipidError, match="has several parts: give the folder parts/1 of its run"):
        windows(tiny_plan(tmp_path, {"repeat": {"seed": [0, 1]}}))
