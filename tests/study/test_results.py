"""Frames for the report: recomputed from the folder, in the units that they are labelled with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import read_dataset
from shipid.study import results as frames
from shipid.study import store
from shipid.study.plan import read_plan
from shipid.study.results import Results, read_results


@pytest.fixture(scope="module")
def read(tiny_run: Path) -> Results:
    return read_results(tiny_run)


def test_errors_over_the_horizon_average_to_A_and_H(read: Results) -> None:
    frame = frames.horizon_frame(read)
    assert sorted(frame["ahead"].unique()) == [1.0, 2.0, 3.0, 4.0, 5.0]
    mean = frame.groupby(["model", "source", "N_D"])["mean"].mean()
    for row in read.cells.itertuples():
        assert mean[row.model, "cooperative", row.N_D] == pytest.approx(row.H)
        if row.model != "none":
            assert mean[row.model, "physics", 0] == pytest.approx(row.A)
    assert mean["naive", "naive", 0] == pytest.approx(frames.naive_summary(read)["mean"])
    assert ("none", "physics", 0) not in mean


def test_errors_over_time_average_to_A(read: Results) -> None:
    """The tiny study has four test runs, and as many are shown."""
    frame = frames.time_frame(read)
    mean = frame.groupby(["model", "source", "N_D"])["error"].mean()
    for row in read.cells.itertuples():
        assert mean[row.model, "cooperative", row.N_D] == pytest.approx(row.H)
    assert not frame.duplicated(["run", "t", "model", "source", "N_D"]).any()


def test_commands_are_what_was_ordered(read: Results, tiny_run: Path) -> None:
    frame = frames.commands_frame(read)
    assert list(frame.columns) == ["run", "t", "port and starboard shaft [rpm]", "port and starboard azimuth [deg]"]
    log = read_dataset(tiny_run / store.DATASET).frame.set_index(["run", "t"])
    ordered = log.loc[list(zip(frame["run"], frame["t"], strict=True))]
    np.testing.assert_allclose(frame.iloc[:, 2], ordered["port.n"] * 60)
    np.testing.assert_allclose(frame.iloc[:, 3], np.degrees(ordered["port.alpha"]))


def test_envelope_in_sailors_units(read: Results) -> None:
    frame = frames.envelope_frame(read).set_index(["set", "quantity"])
    columns = read.test.columns
    assert frame.loc[("test", "port.n"), "max"] == pytest.approx(columns["port.n"].max() * 60)
    assert frame.loc[("test", "r"), "min"] == pytest.approx(np.degrees(columns["r"].min()))
    towards = columns["beta_w"] - columns["psi"]
    assert frame.loc[("test", "u_rw"), "mean"] == pytest.approx(
        (columns["u"] - columns["V_w"] * np.cos(towards)).mean()
    )
    assert ("test", "starboard.n") not in frame.index, "equal commands are one input"
    assert frame["unit"]["test"].to_dict()["r"] == "deg/s"


def test_tracks_know_their_part(read: Results) -> None:
    frame = frames.tracks_frame(read)
    parts = frame.groupby("run")["set"].unique()
    assert {run for run, part in parts.items() if list(part) == ["test"]} == set(read.test.spans)
    assert len(parts) == 12


def test_snapshots_start_at_the_ship_and_end_at_its_heading(read: Results, tiny_run: Path) -> None:
    found = frames.snapshots(read)
    log = read_dataset(tiny_run / store.DATASET).frame
    assert {snapshot["run"] for snapshot in found} == set(read.test.spans)
    for snapshot in found:
        rows = log[log["run"] == snapshot["run"]].set_index("t")
        start, end = rows.loc[snapshot["t"]], rows.loc[snapshot["t"] + 5.0]
        assert snapshot["psi_end"] == pytest.approx(end["psi"] - start["psi"])
        distance = np.hypot(end["north"] - start["north"], end["east"] - start["east"])
        assert np.hypot(*snapshot["truth"][-1]) == pytest.approx(distance)
        assert snapshot["wind"] == pytest.approx((start["V_w"], start["beta_w"] - start["psi"]))
        for path in (snapshot["truth"], *snapshot["paths"].values()):
            assert path.shape == (6, 2)
            assert not path[0].any()
        naive = snapshot["paths"]["", "naive", 0]
        assert np.hypot(*naive[1]) == pytest.approx(np.hypot(start["u"], start["v"]), rel=1e-3)


def test_outline_is_to_scale(read: Results) -> None:
    outline = frames.snapshots(read)[0]["outline"]
    assert np.ptp(outline[:, 0]) == pytest.approx(31.25)  # over all
    assert np.ptp(outline[:, 1]) == pytest.approx(9.6)


def test_provenance_says_what_it_stands_on(read: Results) -> None:
    words = frames.provenance_words(read)
    assert read.plan.digest in words["study"]
    assert words["cells"] == "8 of 8 finished"
    assert "gunnerus-28.9" in words["vessels"]
    assert "redrawn" not in words
    redrawn = replace(read, models=read.models.assign(counter=[2.0, 0.0, 1.0, np.nan]))
    assert frames.provenance_words(redrawn)["redrawn"] == "right: counter 2; wrong-2: counter 1"


def test_the_command_reproduces_the_study(read: Results) -> None:
    """A bundled study by its name, any other by its file; with what `--set` changed."""
    assert frames.reproducing_command(read) == f"shipid study run {read.plan.file}"
    plan = read_plan("quick")
    quick = replace(read, plan=plan, provenance={"file": plan.file})
    assert frames.reproducing_command(quick) == "shipid study run quick"
    changed = replace(quick, provenance={"file": plan.file, "changes": {"grid.N_D": [10], "recipe.kind": "paper"}})
    expected = "shipid study run quick --set 'grid.N_D=[10]' --set 'recipe.kind=\"paper\"'"
    assert frames.reproducing_command(changed) == expected


def test_a_diverged_model_is_marked_and_left_out_of_curves(read: Results) -> None:
    physics = dict(read.physics)
    physics["right"] = np.where(np.arange(physics["right"].shape[1])[None, :, None] == 0, np.nan, physics["right"])
    paths = {cell: path for cell, path in read.paths.items() if not cell.startswith("right")}
    shown = replace(read, physics=physics, paths=paths)
    for frame in (frames.horizon_frame(shown), frames.time_frame(shown)):
        assert "right" not in set(frame["model"])
        assert not frame.drop(columns=["run"], errors="ignore").isna().any(axis=None)


def test_repairs_have_their_columns(read: Results) -> None:
    assert list(frames.repairs_frame(read).columns) == ["kind", "column", "count", "note"]
    assert isinstance(frames.repairs_frame(read), pd.DataFrame)
