from dataclasses import replace

import pandas as pd

from shipid.report.content import model_text


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


def test_further_frames_have_that_name(simulation):
    frame = pd.DataFrame({"model": ["none", "a"], "N_D": [1, 1]})
    again = replace(simulation, frames={"memory": frame})
    assert list(again.frames["memory"].model) == ["no physics", "a"]
    assert list(frame.model) == ["none", "a"], "what was given is not changed"
