"""The refined path: what training the hidden weights of drawn networks keeps, and what it gains."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shipid.hybrid.path_drawn import PathDrawn
from shipid.hybrid.path_refined import PathRefined
from tests.hybrid.quick import small_world
from tests.hybrid.tasks import compensation, tune

SMALL: dict[str, Any] = {"trials": 3, "units": 16, "averaged": 2, "terms": 3, "mirror": 1.0}


def by_run(here: Any) -> Any:
    runs = here.train.run
    folds = [(np.flatnonzero(runs != name), np.flatnonzero(runs == name)) for name in here.train.spans]
    return replace(here.task(), folds=folds)


def test_the_trials_are_those_of_the_drawn_path_and_errors_left_out_are_not_taken_over() -> None:
    """Hidden weights have seen every run in training: errors of the drawn networks are not theirs."""
    task = by_run(small_world())
    drawn, refined = (kind(**SMALL).fit(task)["physics"] for kind in (PathDrawn, PathRefined))
    assert [row["value"] for row in drawn.trials] == [row["value"] for row in refined.trials]
    assert drawn.left_out is not None
    assert refined.left_out is None
    for one, other in zip(drawn.corrector.networks, refined.corrector.networks, strict=True):
        assert one.normaliser.names == other.normaliser.names
        assert 0 < np.abs(one.layers[0][0] - other.layers[0][0]).max() < 0.15  # ten steps of 0.01


@pytest.mark.parametrize("mirror", [0.0, 1.0])
def test_without_a_step_the_networks_are_those_of_the_drawn_path(mirror: float) -> None:
    task, settings = by_run(small_world()), SMALL | {"mirror": mirror}
    drawn, refined = (
        kind(**settings, **more).fit(task)["physics"].corrector
        for kind, more in ((PathDrawn, {}), (PathRefined, {"epochs": 1, "learning_rate": 1e-300}))
    )
    for one, other in zip(drawn.networks, refined.networks, strict=True):
        for mine, theirs in zip(one.layers[0], other.layers[0], strict=True):
            np.testing.assert_array_equal(mine, theirs)
        scale = np.abs(one.layers[1][0]).max()
        np.testing.assert_allclose(other.layers[1][0], one.layers[1][0], rtol=0, atol=1e-8 * scale)


def test_a_mirrored_ship_gets_the_mirrored_path() -> None:
    rng = np.random.default_rng(0)
    names = ("psi", "u", "v", "r", "V_w", "beta_w", "port.n", "port.delta")
    columns = {name: rng.normal(size=240) for name in names}
    columns |= {"starboard.n": columns["port.n"].copy(), "starboard.delta": columns["port.delta"].copy()}
    steps = np.arange(1.0, 7.0)[:, None]
    targets = {"none": np.stack([steps * columns["u"], steps**2 * columns["r"] * columns["port.delta"]], axis=-1)}
    folds = [(np.arange(80, 240), np.arange(80)), (np.arange(160), np.arange(160, 240))]
    commands = ("port.n", "port.delta", "starboard.n", "starboard.delta")
    corrector: Any = tune(columns, commands, targets, folds, PathRefined(**SMALL), seed=4)["none"].corrector
    odd = ("psi", "v", "r", "beta_w", "port.delta", "starboard.delta")
    image = {name: -values if name in odd else values for name, values in columns.items()}
    here, there = (compensation(corrector, seen) for seen in (columns, image))
    assert np.abs(here).max() > 0.01
    np.testing.assert_allclose(there, here * [1.0, -1.0], atol=1e-9)
