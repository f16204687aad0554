import json
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from shipid.report import paths
from shipid.report.paths import browser_figure, windows_of
from shipid.report.selection import FEW_RUNS
from shipid.report.wording import number_text
from tests.report.views import views

window_data = lru_cache(maxsize=2)(paths.window_data)  # the same content is drawn once
snapshots = lru_cache(maxsize=2)(paths.snapshots_figure)


def test_windows_hold_truth_and_paths_closer_than_a_pixel(full_scale, away):
    data = window_data(full_scale)
    np.testing.assert_allclose(np.transpose(data["outline"]), full_scale.snapshots[0].outline)
    json.dumps(data, allow_nan=False)
    (run,) = data["runs"]
    by_time = {snapshot.t: snapshot for snapshot in full_scale.snapshots}
    for window in run:
        source = by_time[window["t"]]
        pixel = np.ptp(source.truth, axis=0).max() / 500
        assert away(source.truth, np.transpose(window["truth"])).max() < pixel
        assert len(window["paths"]) == len(source.paths)
        for line, size, x, y, end in window["paths"]:
            name = data["lines"][line]["name"]
            key = next(k for k in source.paths if name.startswith(k[0]) and (size == 0) == (k[1] == "cooperative"))
            assert away(source.paths[key], np.column_stack([x, y])).max() < pixel
            np.testing.assert_allclose([x[-1], y[-1]], source.paths[key][-1], atol=pixel / 2)
            assert end == pytest.approx(np.hypot(*(source.paths[key] - source.truth)[-1]), abs=0.0051)


def test_end_errors_of_a_ship_model_keep_the_digits_that_the_page_writes(full_scale):
    """Errors of tenths of a millimetre: rounded to millimetres they were 0.00 m and 0.0080 m on the page."""
    first = full_scale.snapshots[0]
    key = next(iter(first.paths))
    for error in (0.0004, 0.0079):
        moved = first.truth + np.array([error, 0.0])
        (run,) = paths.window_data(replace(full_scale, snapshots=[replace(first, paths={key: moved})]))["runs"]
        assert run[0]["paths"][0][4] == pytest.approx(error, abs=1e-6)


def test_axes_are_equal_and_in_metres(content):
    layout = window_data(content)["layout"]
    assert layout["xaxis"]["scaleanchor"] == "y"
    assert layout["xaxis"]["scaleratio"] == 1
    assert [layout[axis]["title"]["text"] for axis in ("xaxis", "yaxis")] == ["y, to starboard [m]", "x, ahead [m]"]


def test_many_instants_are_spread_with_both_ends(full_scale):
    (run,) = window_data(full_scale)["runs"]
    times = [window["t"] for window in run]
    assert len(times) == 120
    assert times == sorted(set(times))
    assert (times[0], times[-1]) == (4150, 4329)


def test_many_runs_share_the_room_of_the_page(simulation):
    first = simulation.snapshots[0]
    many = [replace(first, run=f"run-{i:02d}", t=float(t)) for i in range(60) for t in range(50)]
    runs = windows_of(replace(simulation, snapshots=many))
    assert len(runs) == FEW_RUNS
    assert sum(map(len, runs.values())) <= 600
    assert all(windows[0].t == 0 and windows[-1].t == 49 for windows in runs.values())


def test_a_diverged_path_becomes_gaps(full_scale):
    first = full_scale.snapshots[0]
    paths = {key: np.where(np.arange(16)[:, None] > 7, np.inf, path) for key, path in first.paths.items()}
    text = json.dumps(window_data(replace(full_scale, snapshots=[replace(first, paths=paths)])), allow_nan=False)
    assert "null" in text
    assert snapshots(replace(full_scale, snapshots=[replace(first, paths=paths)])) is not None


def test_where_nothing_has_physics_the_panels_are_of_what_has_none(full_scale):
    """Paths were drawn below the sentence that none was recorded."""
    first = full_scale.snapshots[0]
    error = number_text(float(np.hypot(*(first.paths["no physics", "cooperative", 15] - first.truth)[-1])))
    pure = {key: path for key, path in first.paths.items() if key[0] == "no physics" or key[1] != "cooperative"}
    figure = snapshots(replace(full_scale, snapshots=[replace(first, paths=pure)]))
    assert figure.takeaway == f"From panel to panel, the paths without physics end {error} m from the true place."


def test_takeaway_is_the_mean_end_error(full_scale):
    ends = {"cooperative": [], "physics": []}
    for snapshot in full_scale.snapshots:
        for (model, source, _), path in snapshot.paths.items():
            if model != "no physics":
                ends[source].append(np.linalg.norm(path[-1] - snapshot.truth[-1]))
    text = browser_figure(full_scale).takeaway
    assert f"compensated paths by {np.mean(ends['cooperative']):.2f} m" in text
    assert f"physics alone by {np.mean(ends['physics']):.1f} m" in text


def test_no_windows_no_browser(full_scale):
    empty = replace(full_scale, snapshots=[])
    assert browser_figure(empty) is None
    assert snapshots(empty) is None


def test_a_row_per_model_and_a_column_per_size_share_their_axes(simulation):
    """All panels are of one window and hold its ship at both ends, also a long one that has turned round."""
    outline = np.array([[50.0, 0.0], [40.0, 8.0], [-50.0, 8.0], [-50.0, -8.0], [40.0, -8.0]])
    shots = [replace(shot, outline=outline, psi_end=2.5) for shot in simulation.snapshots]
    figure = snapshots(replace(simulation, snapshots=shots))
    names = ["no physics", "moderate-2", "high-2"]
    assert figure.captions == [f"{name}, N_D = {size}" for name in names for size in (10, 30, 100)]
    assert {chip.key for chip in figure.chips if chip.key.startswith("model:")} == {f"model:{name}" for name in names}
    panels = views(figure)[""]
    drawn = [{trace.name for trace in panel.data} for panel in panels]
    assert drawn[0] == {"true path", "ship", "no physics"}
    assert drawn[3] == {"true path", "ship", "moderate-2, compensated", "moderate-2, physics alone"}
    assert len({(panel.layout.xaxis.range, panel.layout.yaxis.range) for panel in panels}) == 1
    hulls = [trace for trace in panels[0].data if trace.name == "ship"]
    for axis, column in ((panels[0].layout.xaxis, "x"), (panels[0].layout.yaxis, "y")):
        every = np.concatenate([hull[column] for hull in hulls])
        assert axis.range[0] < every.min()
        assert every.max() < axis.range[1]
    assert figure.takeaway.startswith(
        'Distance from the true place at the end, with N_D = 10, 30 and 100: "no physics" '
    )


def test_one_family_shows_all_its_models_in_one_row(simulation):
    kept = simulation.models.family.isin(["moderate", "none"])
    names = set(simulation.models.model[kept])
    shots = [
        replace(shot, paths={key: path for key, path in shot.paths.items() if key[0] in names})
        for shot in simulation.snapshots[:20]
    ]
    cells = simulation.cells[simulation.cells.model.isin(names)]
    figure = snapshots(replace(simulation, models=simulation.models[kept], cells=cells, snapshots=shots))
    assert [caption.partition(", N_D")[2] for caption in figure.captions] == [" = 10", " = 30", " = 100"]
    assert figure.takeaway.startswith("From panel to panel")


def test_one_size_gives_three_instants_of_one_run(full_scale):
    times = [float(caption.split("t = ")[1].split()[0]) for caption in snapshots(full_scale).captions]
    np.testing.assert_allclose(times, 4150 + 179 * np.array([1, 3, 5]) / 6, atol=2)
