"""The figure of predictions: a browser of windows.

The page holds every window once, as finely as a pixel can show, and draws the one that a reader picks (page.js).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd

from shipid.report.content import Floats, PathKey, ReportContent, WindowSnapshot
from shipid.report.errors_over import close_up_chips, line_look
from shipid.report.figure import (
    MUTED,
    TRUTH,
    Chip,
    Control,
    PageFigure,
    Panel,
    Trace,
    escape_name,
    even_places,
    make_chart,
    make_line,
)
from shipid.report.page import Section
from shipid.report.selection import close_styles, close_up_models, family_words, figure_sizes, in_words
from shipid.report.wording import counted_text, metres_text

MOST_POINTS = 40  # of a path or of the outline of a band
PLACES_OF_METRE = 3  # a window 1 m wide is drawn to 0.001 m, one of 100 m to 0.1 m: less than a pixel
TO_STARBOARD, AHEAD = "y, to starboard [m]", "x, ahead [m]"


def windows_of(content: ReportContent) -> dict[str, list[WindowSnapshot]]:
    """Sort windows by test run and time."""
    ordered = sorted(content.snapshots, key=lambda window: (window.run, window.t))
    return {run: list(mine) for run, mine in groupby(ordered, key=lambda window: window.run)}


def window_sizes(content: ReportContent) -> list[int]:
    """List the N_D a reader can choose from."""
    return figure_sizes(pd.Series([size for window in content.snapshots for _, _, size in window.paths], dtype=int))


def _end_error(window: WindowSnapshot, key: PathKey) -> float:
    """Distance [m] of the end of a path from the true place."""
    return float(np.linalg.norm(window.paths[key][-1] - window.truth[-1]))


def glance_figure(content: ReportContent) -> PageFigure | None:
    """A test window as the best model, or another, predicts it with the most data: that with the median error."""
    styles = close_styles(content)
    known = [key for one in content.snapshots for key in one.paths if key[1] == "cooperative" and key[0] in styles]
    if not known:
        return None
    key = max(known, key=lambda one: (one[0] == content.best, one[2]))
    windows = sorted((one for one in content.snapshots if key in one.paths), key=lambda one: _end_error(one, key))
    window = windows[(len(windows) - 1) // 2]
    name, style = line_look(content, key[0], key[1])["name"], styles[key[0]]
    bands = [Chip("band", "its band", style.colour, width=9)] * (key in window.bands)
    return PageFigure(
        id="glance",
        title="A prediction, and what happened",
        takeaway=f"At the horizon {in_words(key[0])} with {counted_text(key[2], 'run')} errs here by "
        f"{metres_text(_end_error(window, key))}, the middle one of {len(windows)} windows on this page.",
        how=f"{window.run} from t = {window.t:g} s, in the axes of the ship at that instant (11). The outline is to "
        "scale, at the start and where the ship truly was at the end."
        + family_words(content, content.cells.family[content.cells.model.eq(key[0])]),
        alternative="The true path of one test window, the predicted path and its band.",
        height=400,
        draw=lambda: [draw_window(content, window, [key])],
        chips=[
            Chip("truth", "true path", TRUTH, width=9),
            Chip(f"model:{key[0]}", name, style.colour, width=style.width),
            *bands,
        ],
    )


def browser_figure(content: ReportContent) -> PageFigure | None:
    """Pick a test run and an instant; None without windows."""
    runs, counts = windows_of(content), window_sizes(content)
    if not runs:
        return None
    return PageFigure(
        id="browser",
        title="Look at predictions",
        takeaway=f"{counted_text(sum(map(len, runs.values())), 'window')} of {counted_text(len(runs), 'test run')}.",
        how="Axes are the ship's at the instant of prediction (11), equal in metres; the outline is to scale, at "
        "the start and where the ship truly was at the end. The pale broad line is the true path. Arrow "
        "keys move the slider.",
        alternative="True path and predicted paths of one window, with the outline of the ship at start and end. "
        "The line of text beside it gives the end errors.",
        height=520,
        draw=lambda run, size: [  # as page.js does
            draw_window(content, one, [key for key in one.paths if _is_drawn(content, key, [size])])
            for one in [runs[run][len(runs[run]) // 2]]
        ],
        controls=[Control("Test run", list(runs)), Control("Manoeuvres, N_D", counts, len(counts) - 1)],
        chips=_window_chips(content),
        browser=True,
    )


def window_data(content: ReportContent) -> dict[str, Any]:
    """What page.js draws: layout, line styles, ship outline and the windows by run.

    A path is `[line, size, x, y, end error]`, then x, y of its band's outline if it has one; `line` is an index into
    `lines`, `size` into the N_D offered or -1. Lengths are metres, angles radians.
    """
    runs, counts = windows_of(content), window_sizes(content)
    lines: dict[tuple[str, str], int] = {}
    shots = [window for windows in runs.values() for window in windows]
    extents = [np.ptp(np.vstack([window.truth, window.outline]), axis=0).max() for window in shots]
    places = max(0, PLACES_OF_METRE - math.floor(math.log10(np.median(extents)))) if shots else 0

    def path_of(window: WindowSnapshot, key: PathKey) -> list[Any]:
        model, source, size = key
        which = lines.setdefault(("" if source == "naive" else model, source), len(lines))
        error = round(_end_error(window, key), 6)
        band = _rounded_columns(window.bands[key], places) if key in window.bands else []
        at, path = counts.index(size) if source == "cooperative" else -1, _rounded_columns(window.paths[key], places)
        return [which, at, *path, error if math.isfinite(error) else None, *band]

    packed = [
        [
            {
                "t": window.t,
                "psi": round(window.psi_end, 4),
                "wind": None if window.wind is None else [round(value, 3) for value in window.wind],
                "truth": _rounded_columns(window.truth, places),
                "paths": [path_of(window, key) for key in window.paths if _is_drawn(content, key, counts)],
            }
            for window in windows
        ]
        for windows in runs.values()
    ]
    outline = np.transpose(shots[0].outline).round(3).tolist() if shots else [[], []]
    return {
        "runs": packed,
        "outline": outline,
        "lines": [line_look(content, model, source) for model, source in lines],
        "truth": {"color": TRUTH, "width": 9},
        "layout": make_chart([], TO_STARBOARD, AHEAD)["layout"],
    }


def _is_drawn(content: ReportContent, key: PathKey, counts: Sequence[int]) -> bool:
    """Whether windows show a path: constant u, v, r, or a model of the close-up, at one of some N_D."""
    model, source, size = key
    return source == "naive" or (model in close_up_models(content) and (source != "cooperative" or size in counts))


def draw_window(content: ReportContent, window: WindowSnapshot, keys: Sequence[PathKey]) -> Panel:
    """Draw the true path of a window, the ship at its ends, and some predicted paths with their bands."""
    truth = np.asarray(window.truth)
    traces = [_path_line("true path", truth, ["truth"], line={"color": TRUTH, "width": 9}, hover="true path")]
    for pose in (np.zeros(3), np.append(truth[-1], window.psi_end)):
        hull = outline_at(window.outline, pose)
        fill: Trace = {"line": {"color": MUTED, "width": 1}, "fill": "toself", "fillcolor": "var(--hull)"}
        traces.append(_path_line("ship", hull, ["ship"], hover="", **fill))
    for key in keys:
        look = line_look(content, "" if key[1] == "naive" else key[0], key[1])
        if key in window.bands:
            colour = look["line"]["color"]
            shade: Trace = {"line": {"color": colour, "width": 0.5}, "fill": "toself", "fillcolor": colour}
            hides = [*look["keys"], "band"]
            traces.append(_path_line(look["name"], window.bands[key], hides, hover="", opacity=0.15, **shade))
        words, ink = escape_name(look["name"]), look["line"]
        traces.append(_path_line(look["name"], window.paths[key], look["keys"], line=ink, hover=words))
    return make_chart(traces, TO_STARBOARD, AHEAD)


def _path_line(name: str, path: Floats, keys: Sequence[str], **options: Any) -> Trace:
    """A path (n, 2) of x, y as a plot has it: y to the right, x up."""
    return make_line(name, np.asarray(path)[:, 1], np.asarray(path)[:, 0], keys, **options)


def outline_at(outline: Floats, pose: Floats) -> Floats:
    """Closed outline (k + 1, 2) of a ship at a pose: x, y [m] and heading [rad]."""
    turn = np.array([[np.cos(pose[2]), np.sin(pose[2])], [-np.sin(pose[2]), np.cos(pose[2])]])
    return np.asarray(np.vstack([outline, outline[:1]]) @ turn + pose[:2])


def _window_chips(content: ReportContent) -> list[Chip]:
    """Legend of the windows."""
    sources = {source for window in content.snapshots for _, source, _ in window.paths}
    chips = [Chip("truth", "true path", TRUTH, width=9), *close_up_chips(content, sources)]
    return [*chips, *[Chip("band", "bands", MUTED, width=9)] * any(window.bands for window in content.snapshots)]


def _rounded_columns(path: Floats, places: int) -> list[list[float | None]]:
    """Columns x and y [m] of a path (n, 2), of some points where it has many; None where it diverged."""
    some = np.asarray(path, dtype=float)[even_places(len(path), MOST_POINTS)]
    with np.errstate(over="ignore"):
        columns = np.round(some.T, places).tolist()
    return [[value if math.isfinite(value) else None for value in column] for column in columns]


AT_A_GLANCE = Section("At a glance", {"glance": (glance_figure, "snapshots")})
PREDICTIONS = Section("The predictions", {"browser": (browser_figure, "snapshots")})
