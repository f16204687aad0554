import json
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from shipid.report import paths
from shipid.report.paths import browser, fixed_data, windows_of
from shipid.report.selection import FEW_RUNS
from shipid.report.wording import listed, number

window_data = lru_cache(maxsize=2)(paths.window_data)  # the same content is drawn once
snapshots = lru_cache(maxsize=2)(paths.snapshots)


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


def test_points_that_are_no_numbers_are_gaps():
    tracks = paths._Tracks()
    sound = tracks.columns(np.array([[0.0, 0.0], [1.2345, -2.0]]))
    wild = tracks.columns(np.array([[0.0, np.nan], [1e306, 2.0], [np.inf, 3.0004]]))
    tracks.fill(0.001)
    assert sound == ([0.0, 1.234], [0.0, -2.0])
    assert wild == ([0.0, None, None], [None, 2.0, 3.0])


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


def test_a_row_per_model_and_a_column_per_size(simulation):
    figure = snapshots(simulation)
    names = ["no physics", "moderate-2", "high-2"]
    assert [(w.model, w.size) for w in figure.windows] == [(name, size) for name in names for size in (0, 1, 2)]
    assert len({(window.run, window.instant) for window in figure.windows}) == 1
    assert figure.windows[4].caption == "moderate-2, N_D = 30"
    assert {chip.key for chip in figure.chips if chip.key.startswith("model:")} == {f"model:{name}" for name in names}


def test_the_takeaway_names_each_model_and_its_ends(simulation):
    figure = snapshots(simulation)
    data = window_data(simulation)
    first = data["runs"][figure.windows[0].run][figure.windows[0].instant]
    shot = next(s for s in simulation.snapshots if s.t == first["t"] and s.run == next(iter(windows_of(simulation))))
    ends = [np.linalg.norm(shot.paths["no physics", "cooperative", c][-1] - shot.truth[-1]) for c in (10, 30, 100)]
    assert f'"no physics" {listed([number(end) for end in ends])} m' in figure.takeaway


def test_panels_share_axes_and_show_one_model(simulation):
    data = window_data(simulation)
    panels = fixed_data(snapshots(simulation).windows, data)
    names = [{data["lines"][i]["name"] for i in panel["lines"]} for panel in panels]
    assert names[0] == {"no physics"}
    assert names[3] >= {"moderate-2, compensated", "moderate-2, physics alone"}
    assert not any(name.startswith("high") for name in names[3])
    assert len({json.dumps(panel["spans"]) for panel in panels}) == 1
    (low, high), _ = panels[0]["spans"]
    truth = data["runs"][panels[0]["run"]][panels[0]["instant"]]["truth"]
    assert low < min(truth[1]) <= max(truth[1]) < high


def test_panels_that_share_axes_hold_the_ship_at_both_ends(simulation):
    """A long ship that has turned round at the end of a short path."""
    outline = np.array([[50.0, 0.0], [40.0, 8.0], [-50.0, 8.0], [-50.0, -8.0], [40.0, -8.0]])
    shots = [replace(shot, outline=outline, psi_end=2.5) for shot in simulation.snapshots]
    content = replace(simulation, snapshots=shots)
    data = window_data(content)
    for panel in fixed_data(snapshots(content).windows, data):
        shot = data["runs"][panel["run"]][panel["instant"]]
        end = np.array([shot["truth"][0][-1], shot["truth"][1][-1]])
        turn = np.array([[np.cos(2.5), -np.sin(2.5)], [np.sin(2.5), np.cos(2.5)]])
        hulls = np.vstack([outline, end + outline @ turn.T])
        for (low, high), place in zip(panel["spans"], (1, 0), strict=True):
            assert low < hulls[:, place].min()
            assert hulls[:, place].max() < high


def test_one_family_shows_all_its_models_in_one_row(simulation):
    kept = simulation.models.family.isin(["moderate", "none"])
    names = set(simulation.models.model[kept])
    shots = [
        replace(shot, paths={key: path for key, path in shot.paths.items() if key[0] in names})
        for shot in simulation.snapshots[:20]
    ]
    cells = simulation.cells[simulation.cells.model.isin(names)]
    figure = snapshots(replace(simulation, models=simulation.models[kept], cells=cells, snapshots=shots))
    assert [(window.model, window.size) for window in figure.windows] == [("", 0), ("", 1), ("", 2)]
    assert figure.takeaway.startswith("From panel to panel")


def test_one_size_gives_three_instants_of_one_run(full_scale):
    figure = snapshots(full_scale)
    times = [float(window.caption.split("t = ")[1].split()[0]) for window in figure.windows]
    np.testing.assert_allclose(times, 4150 + 179 * np.array([1, 3, 5]) / 6, atol=2)


def test_where_nothing_has_physics_the_panels_are_of_what_has_none(full_scale):
    """Paths were drawn below the sentence that none was recorded."""
    first = full_scale.snapshots[0]
    error = number(float(np.hypot(*(first.paths["no physics", "cooperative", 15] - first.truth)[-1])))
    pure = {key: path for key, path in first.paths.items() if key[0] == "no physics" or key[1] != "cooperative"}
    figure = snapshots(replace(full_scale, snapshots=[replace(first, paths=pure)]))
    assert figure.takeaway == f"From panel to panel, the paths without physics end {error} m from the true place."


def test_takeaway_is_the_mean_end_error(full_scale):
    ends = {"cooperative": [], "physics": []}
    for snapshot in full_scale.snapshots:
        for (model, source, _), path in snapshot.paths.items():
            if model != "no physics":
                ends[source].append(np.linalg.norm(path[-1] - snapshot.truth[-1]))
    text = browser(full_scale).takeaway
    assert f"compensated paths by {np.mean(ends['cooperative']):.2f} m" in text
    assert f"physics alone by {np.mean(ends['physics']):.1f} m" in text


def test_no_windows_no_browser(full_scale):
    empty = replace(full_scale, snapshots=[])
    assert browser(empty) is None
    assert snapshots(empty) is None


def test_models_are_compared_where_no_path_without_physics_was_recorded(simulation):
    shots = [
        replace(shot, paths={key: path for key, path in shot.paths.items() if key[0] != "no physics"})
        for shot in simulation.snapshots
    ]
    figure = paths.snapshots(replace(simulation, snapshots=shots))
    assert {window.model for window in figure.windows} == {"moderate-2", "high-2"}
