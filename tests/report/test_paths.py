import json
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from shipid.report import paths

window_data = lru_cache(maxsize=2)(paths.window_data)  # the same content is drawn once


def test_windows_hold_truth_and_paths_closer_than_a_pixel(full_scale):
    data = window_data(full_scale)
    np.testing.assert_allclose(np.transpose(data["outline"]), full_scale.snapshots[0].outline)
    json.dumps(data, allow_nan=False)
    (run,) = data["runs"]
    by_time = {snapshot.t: snapshot for snapshot in full_scale.snapshots}
    for window in run:
        source = by_time[window["t"]]
        pixel = np.ptp(source.truth, axis=0).max() / 500
        np.testing.assert_allclose(np.transpose(window["truth"]), source.truth, atol=pixel)
        assert len(window["paths"]) == len(source.paths)
        for line, size, x, y, end in window["paths"]:
            name = data["lines"][line]["name"]
            key = next(k for k in source.paths if name.startswith(k[0]) and (size == 0) == (k[1] == "cooperative"))
            np.testing.assert_allclose(np.transpose([x, y]), source.paths[key], atol=pixel / 2)
            assert end == pytest.approx(np.hypot(*(source.paths[key] - source.truth)[-1]), abs=0.0051)


def test_end_errors_of_a_ship_model_keep_the_digits_that_the_page_writes(full_scale):
    """Errors of tenths of a millimetre: rounded to millimetres they were 0.00 m and 0.0080 m on the page."""
    first = full_scale.snapshots[0]
    key = next(iter(first.paths))
    for error in (0.0004, 0.0079):
        moved = first.truth + np.array([error, 0.0])
        (run,) = paths.window_data(replace(full_scale, snapshots=[replace(first, paths={key: moved})]))["runs"]
        assert run[0]["paths"][0][4] == pytest.approx(error, abs=1e-6)


def test_a_diverged_path_becomes_gaps(full_scale):
    first = full_scale.snapshots[0]
    paths = {key: np.where(np.arange(16)[:, None] > 7, np.inf, path) for key, path in first.paths.items()}
    text = json.dumps(window_data(replace(full_scale, snapshots=[replace(first, paths=paths)])), allow_nan=False)
    assert "null" in text


def test_the_page_begins_with_the_window_of_the_median_error(simulation):
    key, windows = (simulation.best, "cooperative", 100), simulation.snapshots[:7]
    errors = np.random.default_rng(0).permutation(7) + 1.0
    windows = [
        replace(one, paths={key: one.truth + np.array([error, 0.0])})
        for one, error in zip(windows, errors, strict=True)
    ]
    figure = paths.glance_figure(replace(simulation, snapshots=windows))
    assert "errs here by 4.00 m" in figure.takeaway
    (drawn,) = figure.draw()
    true = next(trace for trace in drawn["data"] if trace["name"] == "true path")
    np.testing.assert_allclose(true["y"], windows[int(np.flatnonzero(errors == 4)[0])].truth[:, 0], rtol=1e-5)
    assert paths.glance_figure(replace(simulation, snapshots=[])) is None
    unseen = [replace(one, paths={("of no close-up", *key[1:]): one.truth}) for one in windows]
    assert paths.glance_figure(replace(simulation, snapshots=unseen)) is None
