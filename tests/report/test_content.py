from dataclasses import FrozenInstanceError, replace

import pandas as pd
import pytest

from shipid.report import ReportContent
from shipid.report.content import model_text


def test_every_frame_but_cells_and_models_may_be_absent(full_scale):
    content = ReportContent(
        title="Question?", name="bare", cells=full_scale.cells, naive=full_scale.naive, models=full_scale.models
    )
    for name in ("horizon", "over_time", "commands", "tracks", "envelope", "factors", "trials", "repairs"):
        assert len(getattr(content, name)) == 0
        assert set(getattr(full_scale, name).columns) >= set(getattr(content, name).columns)
    assert content.frames == {}
    with pytest.raises(FrozenInstanceError):
        content.title = "Another?"


def test_the_model_without_physics_has_one_name(full_scale):
    """`none` in files; in figures and tables it had three names, and in sentences it said that nobody does."""
    old = {"no physics": "none"}
    named = {
        name: getattr(full_scale, name).assign(model=getattr(full_scale, name).model.replace(old))
        for name in ("cells", "models", "horizon", "over_time")
    }
    other = named["cells"][named["cells"].model.eq("none")].assign(model="none + plain")
    again = replace(full_scale, **named | {"cells": pd.concat([named["cells"], other])})
    assert set(again.cells.model) == {*full_scale.cells.model, "no physics + plain"}
    for name in ("models", "horizon", "over_time"):
        pd.testing.assert_frame_equal(getattr(again, name), getattr(full_scale, name))
    assert [model_text(name) for name in ("none", "none-1", "none of these")] == [
        "no physics",
        "none-1",
        "none of these",
    ]


def test_windows_and_further_frames_have_that_name(simulation):
    old = {"no physics": "none"}
    paths = [
        {(old.get(model, model), source, size): path for (model, source, size), path in window.paths.items()}
        for window in simulation.snapshots
    ]
    windows = [replace(window, paths=mine) for window, mine in zip(simulation.snapshots, paths, strict=True)]
    frame = pd.DataFrame({"model": ["none", "a"], "N_D": [1, 1]})
    again = replace(simulation, snapshots=windows, frames={"memory": frame})
    assert [[*window.paths] for window in again.snapshots] == [[*window.paths] for window in simulation.snapshots]
    assert list(again.frames["memory"].model) == ["no physics", "a"]
    assert list(frame.model) == ["none", "a"], "what was given is not changed"
