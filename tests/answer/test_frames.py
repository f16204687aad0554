"""Frames for the report: recomputed from the folder, in the units that they are labelled with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.answer import frames
from shipid.answer.pages import report_content
from shipid.data.dataset import Dataset, read_dataset
from shipid.hybrid.bands import Region
from shipid.hybrid.kernel import Kernel
from shipid.study import store
from shipid.study.results import Results, read_results
from tests.answer.byhand import grid


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
    assert mean["naive", "naive", 0] == pytest.approx(read.naive.mean())
    assert ("none", "physics", 0) not in mean
    assert (frame["mean"] <= frame["along"] + frame["across"] + 1e-9).all(), "a hypotenuse is no longer than both legs"
    assert (frame["mean"] >= np.maximum(frame["along"], frame["across"]) - 1e-9).all()
    for row in read.models[read.models.A_along.notna()].itertuples():
        mine = frame[frame["model"].eq(row.model) & frame["source"].eq("physics")]
        assert (mine["along"].mean(), mine["across"].mean()) == pytest.approx((row.A_along, row.A_across))


def test_the_outline_of_a_band_is_closed_and_where_its_region_ends() -> None:
    ahead = np.broadcast_to([1.0, 0.0], (3, 1, 2))
    region = Region(ahead, np.full((3, 1), 2.0), np.full((3, 1), 1.0))
    path = np.array([[[1.0, 0.0]], [[2.0, 0.0]], [[3.0, 0.0]]])
    outline = frames.region_outline(region, path, 0)
    np.testing.assert_array_equal(outline[0], outline[-1])
    np.testing.assert_allclose(outline.max(axis=0), [5.0, 1.0])
    np.testing.assert_allclose(outline.min(axis=0), [0.0, -1.0])


def test_commands_are_what_was_ordered(read: Results, tiny_run: Path) -> None:
    frame = frames.commands_frame(read)
    assert list(frame.columns)[:3] == ["run", "t", "port shaft [rpm]"]
    log = read_dataset(tiny_run / store.DATASET).frame.set_index(["run", "t"])
    ordered = log.loc[list(zip(frame["run"], frame["t"], strict=True))]
    np.testing.assert_allclose(frame["port shaft [rpm]"], ordered["port.n"] * 60)
    np.testing.assert_allclose(frame["port azimuth [deg]"], np.degrees(ordered["port.alpha"]))


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("rudder.delta", "propeller.n"), ["rudder [deg]", "propeller shaft [rpm]"]),
        (("port_rudder.delta", "starboard_rudder.delta"), ["port rudder [deg]", "starboard rudder [deg]"]),
    ],
)
def test_commands_have_their_words_once(names: tuple[str, str], expected: list[str], read: Results) -> None:
    frame = read.dataset.frame.drop(columns=read.dataset.commands)
    orders = {name: np.arange(len(frame)) * (place + 1.0) for place, name in enumerate(names)}
    dataset = Dataset(frame.assign(**orders), read.dataset.metadata)
    assert list(frames.commands_frame(replace(read, dataset=dataset)).columns)[2:] == expected


def test_envelope_in_sailors_units(read: Results) -> None:
    frame = report_content(read).envelope.set_index(["set", "quantity"])
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
    snapshots = [vars(one) for one in frames.window_snapshots(read)]
    log = read_dataset(tiny_run / store.DATASET).frame
    assert {snapshot["run"] for snapshot in snapshots} == set(read.test.spans)
    for snapshot in snapshots:
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


def test_the_report_does_not_depend_on_when_a_log_was_recorded(read: Results) -> None:
    """Figures are in single precision, in which a clock that counts seconds from 1970 has steps of two minutes."""
    data, test, later = read.dataset, read.test, float(2**31)  # exact: no time loses a digit
    moved = data.frame.assign(t=data.frame["t"] + later)
    epoch = replace(read, dataset=Dataset(moved, data.metadata), test=replace(test, t=test.t + later))
    expected, content = report_content(read), report_content(epoch)
    for name in ("over_time", "commands", "tracks"):
        pd.testing.assert_frame_equal(getattr(content, name), getattr(expected, name))
    for name, frame in expected.frames.items():
        pd.testing.assert_frame_equal(content.frames[name], frame)
    assert [one.t for one in content.snapshots] == [one.t for one in expected.snapshots]
    assert content.over_time["t"].min() >= 0.0


def test_physics_alone_is_not_said_to_have_data(made: Any) -> None:
    methods = [
        {"name": "kernel", "kind": "kernel", "families": ["bad"]},
        {"name": "alone", "kind": "alone", "families": ["good"]},
    ]
    read = made(grid({"good": (1.5, 1.0), "bad": (3.0, 2.0)}), changes={"method": methods})
    alone = read.cells["model"].eq("good")
    lost = replace(read, cells=read.cells.assign(method=read.cells["method"].mask(alone, "alone")))
    rows = frames.kinds_frame(lost)
    assert set(rows.loc[rows["source"].eq("cooperative"), "model"]) == {"bad"}
    assert set(rows.loc[rows["source"].eq("physics"), "model"]) == {"good", "bad"}


def test_provenance_names_what_was_used(read: Results) -> None:
    words = frames.provenance_words(read)
    assert read.plan.digest in words["study"]
    assert words["cells"] == "8 of 8 finished"
    assert "gunnerus-28.9" in words["vessels"]
    assert "redrawn" not in words
    redrawn = replace(read, models=read.models.assign(counter=[2.0, 0.0, 1.0, np.nan]))
    assert frames.provenance_words(redrawn)["redrawn"] == "right: counter 2; wrong-2: counter 1"


def test_a_diverged_model_is_marked_and_left_out_of_curves(read: Results) -> None:
    physics = dict(read.physics)
    physics["right"] = np.where(np.arange(physics["right"].shape[1])[None, :, None] == 0, np.nan, physics["right"])
    paths = {cell: path for cell, path in read.paths.items() if not cell.startswith("right")}
    shown = replace(read, physics=physics, paths=paths)
    for frame in (frames.horizon_frame(shown), frames.time_frame(shown)):
        assert "right" not in set(frame["model"])
        assert not frame.drop(columns=["run"], errors="ignore").isna().any(axis=None)


def test_trials_know_the_chosen_one(read: Results) -> None:
    frame = frames.trials_frame(read)
    assert len(frame) == 16
    assert frame["chosen"].all()
    assert frame.columns[10:].tolist() == [*Kernel().varied()]
    first = read.rows[0]
    two = [{**first["trials"][0], "number": k, "value": value} for k, value in enumerate((2.0, 1.0))]
    two.append({**two[0], "number": 2, "state": "diverged", "value": None})
    two += [{**two[0], "number": number, "value": None} for number in (3, 4)]  # not a number: it ended in a traceback
    for trials, chosen in ((1, [False, True, *[False] * 3]), (8, [True, True, *[False] * 3])):
        (way,) = read.plan.methods
        plan = replace(read.plan, methods=(replace(way, method=way.method.model_copy(update={"trials": trials})),))
        frame = frames.trials_frame(replace(read, plan=plan, cells=pd.DataFrame([{**first, "trials": two}])))
        assert frame["chosen"].tolist() == chosen
    assert frame["value"].tolist() == pytest.approx([2.0, 1.0, *[np.nan] * 3], nan_ok=True)
    diverged = [{**trial, "state": "diverged", "value": None} for trial in two]
    assert not frames.trials_frame(replace(read, cells=pd.DataFrame([{**first, "trials": diverged}])))["chosen"].any()


def test_factors_are_those_of_the_members(read: Results) -> None:
    frame = frames.factors_frame(read)
    assert set(frame["model"]) == {"wrong-1", "wrong-2"}
    variant = next(model.variant for model in read.plan.foundations if model.name == "wrong-1")
    assert frame[frame["model"] == "wrong-1"].set_index("path")["factor"].to_dict() == pytest.approx(variant.factors)
