"""Figures of predictions: a window browser, and three windows side by side.

The page holds every window once, as finely as a pixel can show, and draws it itself (page.js).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from shipid.errors import ShipidError, choices
from shipid.report.content import DATA_DRIVEN, Floats, PathKey, ReportContent, Snapshot
from shipid.report.errors_over import model_chips
from shipid.report.figure import Chip, Control, Figure, FixedWindow, Plot, line, plane
from shipid.report.palette import DASHES, MUTED, NAIVE, TRUTH, close_styles
from shipid.report.section import Section
from shipid.report.selection import (
    FEW_RUNS,
    data_driven,
    drawn_source,
    exemplars,
    families,
    in_words,
    middles,
    sizes,
    spread,
    thinned,
)
from shipid.report.wording import CONSTANT, counted, listed, metres, number

MOST_INSTANTS = 120  # per test run: one step of the slider is then a few pixels
MOST_WINDOWS = 600  # in all
MOST_PATHS = 2400  # in all: with their bands about 0.7 MB of the page
PIXELS = 1000  # a window is drawn about half as large
HOW = (
    "Axes are the ship's at the instant of prediction (11), equal in metres; the outline is to scale, at the start and "
    "where the ship truly was at the end. The pale broad line is the true path. "
)


def windows_of(content: ReportContent) -> dict[str, list[Snapshot]]:
    """Sort windows by test run and time; at most `FEW_RUNS`, `MOST_INSTANTS` each, `MOST_WINDOWS` and `MOST_PATHS`."""
    by_run: dict[str, list[Snapshot]] = {}
    for snapshot in content.snapshots:
        by_run.setdefault(snapshot.run, []).append(snapshot)
    shown = set(exemplars(content))
    paths = max((sum(key[0] in shown for key in window.paths) for window in content.snapshots), default=0)
    windows = min(MOST_WINDOWS, MOST_PATHS // max(1, paths))
    result, most = {}, min(MOST_INSTANTS, max(1, windows // max(1, min(FEW_RUNS, len(by_run)))))
    for run in spread(sorted(by_run), FEW_RUNS):
        ordered = sorted(by_run[run], key=lambda window: window.t)
        chosen = np.linspace(0, len(ordered) - 1, min(len(ordered), most)).round().astype(int)
        result[run] = [ordered[i] for i in chosen]
    return result


def window_sizes(content: ReportContent) -> list[int]:
    """List the N_D a reader can choose from."""
    return sizes(pd.Series([size for window in content.snapshots for _, _, size in window.paths], dtype=int))


def browser(content: ReportContent) -> Figure | None:
    """Pick a test run and an instant; None without windows."""
    runs, counts = windows_of(content), window_sizes(content)
    if not runs:
        return None
    return Figure(
        id="browser",
        title="Look at predictions",
        takeaway=_takeaway(content, counts[-1]),
        how=HOW + f"{counted(sum(map(len, runs.values())), 'window')} of {counted(len(runs), 'test run')}; "
        "arrow keys move the slider.",
        alternative="True path and predicted paths of one window, with the outline of the ship at start and end. "
        "The line of text beside it gives the end errors.",
        height=520,
        views={},
        controls=[
            Control("Test run", list(runs)),
            Control("Manoeuvres, N_D", [str(c) for c in counts], len(counts) - 1),
        ],
        chips=_chips(content),
        browser=True,
    )


def snapshots(content: ReportContent) -> Figure | None:
    """Draw some windows side by side, as in the paper's Fig. 7; None without windows.

    With several N_D, one window: a row per model (without physics and one of each of the two largest families) and a
    column per N_D; with a single family, all models in one row. At a single N_D, three instants of one run.
    """
    runs, counts = windows_of(content), window_sizes(content)
    if not runs:
        return None
    names, models = list(runs), _compared(content)
    if len(counts) > 1:
        run, instant = _middle(runs)
        window = runs[names[run]][instant]
        where = f"{names[run]}, t = {window.t:g} s"
        title, chosen = (
            "One window, more and more data",
            f"{where}: the window of middle physics error. All panels share their axes; physics alone and bands may "
            "leave them.",
        )
        windows = [
            FixedWindow(f"{name or where}, N_D = {c}", run, instant, i, name)
            for name in models or [""]
            for i, c in enumerate(counts)
        ]
        takeaway = _takeaway_models(window, models, counts) if models else _takeaway_row(content, [window] * 3, counts)
    else:
        run = max(range(len(names)), key=lambda i: len(runs[names[i]]))
        mine = runs[names[run]]
        instants = sorted({round(share * (len(mine) - 1)) for share in (1 / 6, 1 / 2, 5 / 6)})
        windows = [FixedWindow(f"{names[run]}, t = {mine[i].t:g} s", run, i, 0) for i in instants]
        title = "Instants of a test run"
        chosen = "Instants at one, three and five sixths of the run." if len(instants) == 3 else ""
        takeaway = _takeaway_row(content, [mine[i] for i in instants], counts * len(instants))
    return Figure(
        id="snapshots",
        title=title,
        takeaway=takeaway,
        how=HOW + chosen,
        alternative=f"{len(windows)} small plots of true and predicted paths; captions name what they show.",
        height=300 if models and len(counts) > 1 else 380,
        views={},
        chips=_chips(content, models if len(counts) > 1 else []),
        windows=windows,
    )


def _compared(content: ReportContent) -> list[str]:
    """The model without physics and one of each of the two largest families, by A; empty if families are too few."""
    recorded = {model for window in content.snapshots for model, source, _ in window.paths if source == "cooperative"}
    middle = {family: name for family, name in middles(content).items() if name in recorded}
    physics = [name for family, name in middle.items() if family != DATA_DRIVEN][:2]
    if len(physics) < 2:
        return []
    order = [str(name) for name in families(content).model]
    pure = [middle[DATA_DRIVEN]] if DATA_DRIVEN in middle else []
    return [*pure, *sorted(physics, key=order.index)]


def window_data(content: ReportContent) -> dict[str, Any]:
    """Collect what page.js draws: layout, line styles, ship outline and the windows by run.

    A path is `[line, size, x, y, end error]`, then x, y of its band's outline if it has one;
    `line` is an index into `lines`, `size` into the N_D offered or -1 for a path that does not depend on N_D. Lengths
    are metres, angles radians.
    """
    runs, counts, drawn = windows_of(content), window_sizes(content), exemplars(content)
    lines: dict[tuple[str, str], int] = {}
    detail = _detail([window for windows in runs.values() for window in windows])
    packed: dict[str, list[dict[str, Any]]] = {}
    tracks = _Tracks()
    for run, windows in runs.items():
        packed[run] = []
        for window in windows:
            paths = []
            for (model, source, size), points in window.paths.items():
                if (source == "cooperative" and size not in counts) or (source != "naive" and model not in drawn):
                    continue
                which = lines.setdefault(("" if source == "naive" else model, source), len(lines))
                at = counts.index(size) if source == "cooperative" else -1
                paths.append([which, at, *tracks.columns(points), _rounded(_end_error(window, points), 1e-6)])
                if (model, source, size) in window.bands:
                    paths[-1] += tracks.columns(window.bands[model, source, size])
            wind = None if window.wind is None else [round(value, 3) for value in window.wind]
            packed[run].append(
                {"t": window.t, "psi": round(window.psi_end, 4), "wind": wind, "truth": tracks.columns(window.truth)}
                | {"paths": paths}
            )
    tracks.fill(detail)
    first = next(iter(runs.values()))[0] if runs else None
    return {
        "runs": list(packed.values()),
        "outline": [[_rounded(value, 0.0) for value in column] for column in np.transpose(first.outline)]
        if first
        else [[], []],
        "lines": [_line(content, model, source) for model, source in lines],
        "truth": {"color": TRUTH, "width": 9},
        "layout": plane("y, to starboard [m]", "x, ahead [m]"),
    }


def fixed_data(panels: Sequence[FixedWindow], data: dict[str, Any]) -> list[dict[str, Any]]:
    """What page.js needs for panels that show a window of `window_data`: indices and lines.

    Panels of one window share their axes, so that they can be compared; these reach over the true path, the ship at
    both of its ends and what was compensated or learned. Physics alone and bands may leave them.
    """
    together = {i for i, line in enumerate(data["lines"]) if line["cell"]}
    result = []
    for panel in panels:
        shot = data["runs"][panel.run][panel.instant]
        lines = [
            i
            for i, line in enumerate(data["lines"])
            if not panel.model or f"model:{panel.model}" in line["keys"] or "source:naive" in line["keys"]
        ]
        result.append({"run": panel.run, "instant": panel.instant, "size": panel.size, "lines": lines})
        same = [other for other in panels if (other.run, other.instant) == (panel.run, panel.instant)]
        if len(same) > 1:
            models = {f"model:{other.model}" for other in same}
            shown = {i for i in together if not panel.model or models & set(data["lines"][i]["keys"])}
            result[-1]["spans"] = _spans(shot, shown, data["outline"])
    return result


def _spans(shot: dict[str, Any], lines: set[int], outline: Sequence[Sequence[float]]) -> list[list[float]]:
    """Range of y, then of x [m] that holds the true path, the ship at both of its ends and the paths of some lines."""
    spans, (ahead, aside), psi = [], outline, shot["psi"]
    turned = (
        [x * math.cos(psi) - y * math.sin(psi) for x, y in zip(ahead, aside, strict=True)],
        [x * math.sin(psi) + y * math.cos(psi) for x, y in zip(ahead, aside, strict=True)],
    )
    for place in (1, 0):
        paths = [shot["truth"][place], *(path[2 + place] for path in shot["paths"] if path[0] in lines)]
        end = shot["truth"][place][-1] if shot["truth"][place] else None
        paths += [outline[place], [end + value for value in turned[place]] if end is not None else []]
        values = [value for path in paths for value in path if value is not None]
        spans.append([min(values), max(values)])
    room = 0.06 * max(high - low for low, high in spans)
    return [[round(low - room, 2), round(high + room, 2)] for low, high in spans]


def window_plot(content: ReportContent, run: str | None = None, t: float | None = None, N_D: int | None = None) -> Plot:
    """Draw one window of a test run as the browser of the page draws it.

    Parameters
    ----------
    content : with `snapshots`.
    run : test run; default: the first.
    t : instant of prediction [s], the nearest recorded one is taken; default: the middle of the run.
    N_D : manoeuvres that compensated models were trained on; default: the most that were recorded.

    Raises ShipidError for a run or an N_D that no window holds.
    """
    runs, counts = windows_of(content), window_sizes(content)
    if not runs:
        raise ShipidError("there is nothing to draw: the results hold no windows", path="prediction")
    if run is not None and run not in runs:
        raise ShipidError(f"no window of run {run!r}; {choices(run, runs)}", path="prediction")
    if N_D is not None and N_D not in counts:
        raise ShipidError(f"no window with N_D = {N_D}; valid: {', '.join(map(str, counts))}", path="prediction")
    windows, size = runs[run or next(iter(runs))], N_D or counts[-1]
    window = windows[len(windows) // 2] if t is None else min(windows, key=lambda shot: abs(shot.t - t))
    end, drawn = np.asarray(window.truth)[-1], exemplars(content)
    traces = [line("true path", *_aside(window.truth), ["truth"], line={"color": TRUTH, "width": 9})]
    ink = {"color": MUTED, "width": 1}
    for x, y, psi in ((0.0, 0.0, 0.0), (*end, window.psi_end)):
        turned = np.column_stack([np.cos(psi), -np.sin(psi), np.sin(psi), np.cos(psi)]).reshape(2, 2)
        hull = np.vstack([window.outline, window.outline[:1]]) @ turned.T + [x, y]
        traces.append(line("ship", *_aside(hull), ["ship"], line=ink, fill="toself", fillcolor="var(--hull)"))
    for (model, source, count), points in window.paths.items():
        if source == "naive" or (model in drawn and (source != "cooperative" or count == size)):
            look = _line(content, model, source)
            if (model, source, count) in window.bands:
                outline, ink = window.bands[model, source, count], {"color": look["line"]["color"], "width": 0.5}
                shade = {"fill": "toself", "fillcolor": look["line"]["color"], "opacity": 0.15}
                keys = [*look["keys"], "band"]
                traces.append(line(f"{look['name']}, band", *_aside(outline), keys, line=ink, **shade))
            traces.append(line(look["name"], *_aside(points), look["keys"], line=look["line"]))
    return Plot(traces, plane("y, to starboard [m]", "x, ahead [m]"))


def _aside(points: Floats) -> tuple[Floats, Floats]:
    """Columns of a path (n, 2) of x, y as a plot has them: y to the right, x up."""
    path = np.asarray(points, dtype=float)
    return path[:, 1], path[:, 0]


def _line(content: ReportContent, model: str, source: str) -> dict[str, Any]:
    style = close_styles(content).get(model)
    pure = model == data_driven(content)
    words = {"cooperative": model if pure else f"{model}, compensated", "physics": f"{model}, physics alone"}
    of_cell = source == "cooperative"
    width = style.width if style and of_cell else 1.5
    source = drawn_source(content, model, source)
    return {
        "name": words.get(source, CONSTANT),
        "cell": of_cell,
        "keys": [f"source:{source}"] + ([f"model:{model}"] if model else []),
        "line": {"color": style.colour if style else NAIVE, "dash": DASHES[source], "width": width},
    }


def _chips(content: ReportContent, only: Sequence[str] = ()) -> list[Chip]:
    """Legend of the windows; of some models, if they are given."""
    sources = {source for window in content.snapshots for _, source, _ in window.paths}
    chips = [Chip("truth", "true path", TRUTH, width=9), *model_chips(content, sources)]
    chips += [Chip("band", "bands", MUTED, width=9)] * any(window.bands for window in content.snapshots)
    others = {f"model:{name}" for name in exemplars(content) if name not in only} if only else set()
    return [chip for chip in chips if chip.key not in others]


def _detail(windows: list[Snapshot]) -> float:
    """Return half the length [m] of a pixel in a usual window, as wide as the ship or its path over the horizon."""
    extents = [float(np.ptp(np.vstack([window.truth, window.outline]), axis=0).max()) for window in windows]
    return float(np.median(extents)) / PIXELS if extents else 0.0


class _Tracks:
    """Columns x and y of many paths, handed out empty and filled together: it takes a fifth of the time."""

    def __init__(self) -> None:
        self.paths: list[Floats] = []
        self.handed: list[tuple[list[float | None], list[float | None]]] = []

    def columns(self, path: Floats) -> tuple[list[float | None], list[float | None]]:
        """Lists for x and y of a path (n, 2), empty until `fill`."""
        self.paths.append(np.asarray(path, dtype=float))
        self.handed.append(([], []))
        return self.handed[-1]

    def fill(self, detail: float) -> None:
        """Fill them with the points that differ by `detail` [m]; a path that diverged keeps its gaps."""
        sound = [i for i, path in enumerate(self.paths) if detail > 0 and np.isfinite(path).all()]
        for i, kept in zip(sound, thinned([self.paths[i] for i in sound], detail), strict=True):
            self.paths[i] = self.paths[i][kept]
        for path, columns in zip(self.paths, self.handed, strict=True):
            with np.errstate(over="ignore"):  # a path that diverged: its points are left out
                rounded = np.round(path.T, _decimals(detail))
            whole = np.isfinite(rounded).all()
            for column, values in zip(columns, rounded.tolist(), strict=True):
                column += values if whole else [value if math.isfinite(value) else None for value in values]


def _rounded(value: float, detail: float) -> float | None:
    """Round to as many decimals as `detail` needs; None for what is not finite."""
    return round(float(value), _decimals(detail)) if math.isfinite(value) else None


def _decimals(detail: float) -> int:
    """Number of decimals that show a difference of `detail` [m]; 3 where it is 0."""
    return max(0, math.ceil(-math.log10(detail or 0.001)))


def _end_error(window: Snapshot, points: Floats) -> float:
    return float(np.linalg.norm(np.asarray(points)[-1] - np.asarray(window.truth)[-1]))


def _middle(runs: dict[str, list[Snapshot]]) -> tuple[int, int]:
    """Run and instant of the window whose mean physics error at the end is the middle one."""
    errors = [
        (np.mean([_end_error(w, p) for (_, source, _), p in w.paths.items() if source != "cooperative"] or [0]), i, j)
        for i, windows in enumerate(runs.values())
        for j, w in enumerate(windows)
    ]
    _, run, instant = sorted(errors)[len(errors) // 2]
    return run, instant


def _mean_end_error(windows: list[Snapshot], keys: set[PathKey]) -> float:
    errors = [_end_error(w, points) for w in windows for key, points in w.paths.items() if key in keys]
    return float(np.mean(errors)) if errors else float("nan")


def _takeaway(content: ReportContent, size: int) -> str:
    """Mean end errors over all windows, per source."""
    pure, drawn, windows = data_driven(content), exemplars(content), content.snapshots
    keys = {key for window in windows for key in window.paths if key[0] in drawn and key[2] in (0, size)}
    called = {key: drawn_source(content, key[0], key[1]) for key in keys if key[0] != pure}
    together = _mean_end_error(windows, {key for key, source in called.items() if source == "cooperative"})
    alone = _mean_end_error(windows, {key for key, source in called.items() if source == "physics"})
    learned = _mean_end_error(windows, {k for k in keys if k[0] == pure and k[2] == size})
    parts = [(together, "the compensated paths"), (alone, "physics alone"), (learned, in_words(pure or ""))]
    errors = [f"{word} by {metres(value)}" for value, word in parts if np.isfinite(value)]
    where = f", N_D = {size}" if size else ""  # where no cell has a result there is physics alone
    return (
        f"In the {counted(len(windows), 'window')} to look at{where}, the models drawn miss the true place at "
        f"the end of the horizon on average: {'; '.join(errors)}."
    )


def _takeaway_row(content: ReportContent, windows: list[Snapshot], counts: list[int]) -> str:
    """How far the compensated paths end from the truth in each panel, or those without physics where there are none."""
    pure, drawn = data_driven(content), exemplars(content)
    physics = [name for name in drawn if name != pure]
    learned, alone = ([name for name in physics if (name in content.alone) == which] for which in (False, True))
    sets = (
        (learned, "the compensated paths"),
        (alone, "the paths of physics alone"),
        ([pure], "the paths without physics"),
    )
    for models, words in sets:
        means = []
        for window, size in zip(windows, counts, strict=False):
            keys = {k for k in window.paths if k[1] == "cooperative" and k[2] == size and k[0] in models}
            means.append(_mean_end_error([window], keys))
        if np.isfinite(means).any():
            return f"From panel to panel, {words} end {listed([number(m) for m in means])} m from the true place."
    return "No compensated path was recorded for these windows."


def _takeaway_models(window: Snapshot, models: list[str], counts: list[int]) -> str:
    """How far each model ends from the truth, by rising N_D."""
    parts = []
    for name in models:
        ends = [_mean_end_error([window], {(name, "cooperative", size)}) for size in counts]
        alone = _mean_end_error([window], {(name, "physics", 0)})
        text = f"{in_words(name)} {listed([number(end) for end in ends])} m"
        parts.append(text + (f" (physics alone {metres(alone)})" if np.isfinite(alone) else ""))
    numbers = listed([str(size) for size in counts])
    return f"Distance from the true place at the end, with N_D = {numbers}: {'; '.join(parts)}."


SECTION = Section(
    "The predictions",
    draw=lambda content: (browser(content), snapshots(content)),
    needs=("snapshots",),
    anchors=("browser", "snapshots"),
)
