"""How far off a prediction may be: bands, what share of test paths they hold, their width, and who pays."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from typing import Any

import pandas as pd

from shipid.report.content import ReportContent
from shipid.report.error_map import cells_map
from shipid.report.figure import Chip, Control, Figure, Panel, Plot, axis, label, layout, line
from shipid.report.palette import MUTED, close_styles
from shipid.report.section import Section
from shipid.report.selection import exemplars, sizes
from shipid.report.tables import Cell, Table, figure, length_places, text
from shipid.report.wording import counted, listed, metres
from shipid.units import level_text, percent, plural

WORST = 12  # test runs in the table of those that pay
BY = {"kind": "manoeuvre", "ahead": "time ahead", "speed": "speed"}


def _judged(frame: pd.DataFrame) -> float:
    """The level of the sentences: 0.9 where it is promised, else the highest."""
    levels = [float(level) for level in pd.unique(frame.level)]
    return 0.9 if 0.9 in levels else max(levels)


def coverage(content: ReportContent) -> Figure | None:
    """Nominal against measured coverage, with intervals; None where no model of a close-up has a band."""
    frame = content.frame("coverage")
    names = [name for name in exemplars(content) if len(frame) and name in set(frame.model)]
    if not names:
        return None
    counts, looks, banded = sizes(frame.N_D), close_styles(content), frame.model.nunique()
    drawn = f" Of {banded} models, {listed(names, 6)} {plural(len(names), 'is', 'are')} drawn; the table has all."
    views = {}
    for place, size in enumerate(counts):
        traces = [
            line(
                "as promised",
                [0.45, 1.0],
                [0.45, 1.0],
                ["nominal"],
                "",
                line={"color": MUTED, "width": 1, "dash": "dash"},
            )
        ]
        for i, name in enumerate(names):
            mine = frame[frame.model.eq(name) & frame.N_D.eq(size)].sort_values("level")
            shift = 0.004 * (i - (len(names) - 1) / 2)  # intervals of several models would hide each other
            x, y = mine.level.to_numpy(dtype=float) + shift, mine.coverage.to_numpy(dtype=float)
            reach = {"type": "data", "symmetric": False, "thickness": 1.5, "width": 4, "color": looks[name].colour}
            reach |= {"array": mine.high.to_numpy() - y, "arrayminus": y - mine.low.to_numpy()}
            ink = {"color": looks[name].colour, "width": looks[name].width}
            points = line(name, x, y, [f"model:{name}"], "", mode="lines+markers", line=ink)
            points["marker"] = {"symbol": looks[name].symbol, "size": 7}
            points.update(error_y=reach, customdata=[_words(row) for row in mine.to_dict("records")])
            points.update(hovertemplate=f"{label(name)}: %{{customdata}}<extra></extra>")
            traces.append(points)
        x_axis = axis(
            "share promised [1]", range=[min(0.5, frame.level.min()) - 0.05, 1.0], tickvals=sorted(set(frame.level))
        )
        y_axis = axis("share of whole test paths in the band [1]", range=[0, 1.02])
        views[str(place)] = [Panel(Plot(traces, layout(x_axis, y_axis, hovermode="closest")))]
    return Figure(
        id="coverage",
        title="What bands promise, and what they hold",
        takeaway=_takeaway(frame, counts[-1]),
        how="A band is a region around every step of a predicted path; it holds a path if it holds all its steps. It "
        "is calibrated on errors of models that saw the run neither in training nor in the choice of hyperparameters, "
        "and counts runs, not windows. Measured on the test runs, on which no cell trained. Bars are exact binomial "
        f"95 % intervals for so many windows as the {counted(int(frame.runs.max()), 'test run')} are worth: windows "
        "of one run are alike. The share is over all kinds of manoeuvre as they are mixed; a single kind may get less."
        + (drawn if len(names) < banded else ""),
        alternative="Points of the measured over the promised share of paths with intervals, one line per model. The "
        "numbers are in the table below.",
        height=420,
        views=views,
        controls=[Control("Manoeuvres, N_D", [str(count) for count in counts], len(counts) - 1)],
        chips=[
            Chip(f"model:{name}", name, looks[name].colour, width=looks[name].width, symbol=looks[name].symbol)
            for name in names
        ],
    )


def _words(row: dict[Hashable, Any]) -> str:
    inside = f"{percent(row['coverage'])} [{percent(row['low'])}, {percent(row['high'])}] of {level_text(row['level'])}"
    return f"{inside}, mean radius {metres(row['width'])}"


def _takeaway(frame: pd.DataFrame, size: int) -> str:
    level = _judged(frame[frame.N_D.eq(size)] if frame.N_D.eq(size).any() else frame)
    mine = frame[frame.N_D.eq(size) & frame.level.eq(level)]
    if mine.empty:
        return f"No band is promised at N_D = {size}."
    below = mine[mine.high < level]
    by_width = mine.sort_values("width")
    least, most = by_width.iloc[0], by_width.iloc[-1]
    text = (
        f"With N_D = {size}, bands of {level_text(level)} hold {percent(float(mine.coverage.mean()))} of the test "
        "paths "
    )
    text += f"on average over {counted(len(mine), 'model')}; "
    text += f"the mean radius is {metres(least.width)} ({least.model})"
    text += f" to {metres(most.width)} ({most.model}). " if len(mine) > 1 else ". "
    if below.empty:
        return text + "No interval lies below its promise."
    return text + f"Below their promise, interval and all: {listed([str(name) for name in below.model])}."


def width_map(content: ReportContent) -> Figure | None:
    """Mean radius of the bands over A and N_D; None where there is no map of the error either."""
    cells, frame = content.cells, content.frame("coverage")
    if "width" not in cells:
        return None
    if cells.width.notna().sum() < 2 and len(frame):  # too few runs for the level of the study: the highest there is
        top = frame[frame.level.eq(_judged(frame))][["model", "N_D", "width"]]
        cells = cells.drop(columns="width").merge(top, how="left", on=["model", "N_D"])
    cells = cells[cells.width.notna()]
    if len(cells) < 2:
        return None
    shown = replace(content, cells=cells.assign(H=cells.width, H_90=cells.width))
    return cells_map(
        shown,
        id="width-map",
        title="Better physics, narrower promise",
        scale="mean radius of the band [m]",
        how="Each cell is a model, at its A on a square-root scale, given N_D manoeuvres; colour is the mean radius of "
        "its band over the horizon and all test windows, mean over seeds. Cells with too few runs for the level are "
        "left out.",
        hatched="not narrower than the band of no physics at the same N_D.",
    )


def table(content: ReportContent) -> Table | None:
    """Coverage and width by model, N_D and level."""
    frame = content.frame("coverage")
    if frame.empty:
        return None
    width, end = length_places(frame["width"]), length_places(frame["end"])
    rows = [
        [
            text(row["model"]),
            figure(row["N_D"], 0),
            Cell(level_text(row["level"]), row["level"]),
            _share(row),
            figure(row["width"], width),
            figure(row["end"], end),
            figure(row["lengths"], 3),
        ]
        for row in frame.to_dict("records")
    ]
    columns = [
        "model",
        "N_D [1]",
        "promised",
        "held [95 %]",
        "mean radius [m]",
        "radius at the end [m]",
        "in lengths [1]",
    ]
    return Table("coverage-table", "Bands by model", _refused(content), columns, [False, *[True] * 6], rows)


def _share(row: dict[Hashable, Any]) -> Cell:
    return Cell(f"{percent(row['coverage'])} [{percent(row['low'])}, {percent(row['high'])}]", row["coverage"])


def _refused(content: ReportContent) -> str:
    frame = content.frame("no_band")
    if frame.empty:
        return ""
    parts = [
        f"{listed([f'{row.model} at N_D = {row.N_D}' for row in part.itertuples()])}: {reason}"
        for reason, part in frame.groupby("reason", sort=False)
    ]
    return f"Without a band: {'; '.join(parts)}."


def groups(content: ReportContent) -> Table | None:
    """Coverage at one level by kind of manoeuvre, time ahead and speed."""
    frame = content.frame("coverage_groups")
    if frame.empty:
        return None
    frame = frame[frame.model.isin(exemplars(content))]
    width = length_places(frame["width"])
    rows = [
        [
            text(row["model"]),
            text(BY[row["by"]]),
            text(row["group"]),
            _share(row),
            figure(row["width"], width),
            figure(row["runs"], 0),
            text(row["note"] or None),
        ]
        for row in frame.to_dict("records")
    ]
    columns = ["model", "by", "group", "held [95 %]", "mean radius [m]", "test runs [1]", "note"]
    numeric = [False, False, False, True, True, True, False]
    return Table("coverage-groups", "Where bands hold more and less", _lowest(frame), columns, numeric, rows)


def _lowest(frame: pd.DataFrame) -> str:
    kinds = frame[frame.by.isin(["kind", "speed"])]
    if kinds.empty:
        return ""
    worst = kinds.sort_values("coverage").iloc[0]
    text = f"Bands hold least at {worst.group} ({worst.model}): {percent(worst.coverage)} of the paths."
    better = worst.by == "kind" and not worst.note and kinds.group[kinds.by.eq("kind")].nunique() > 1
    return f"{text} --kind of shipid predict gives the band that is calibrated for this kind alone." if better else text


def worst(content: ReportContent) -> Table | None:
    """Test runs whose paths leave their bands most often."""
    frame = content.frame("coverage_runs")
    if frame.empty:
        return None
    shown = frame[frame.model.isin(exemplars(content))].head(WORST)
    rows = [
        [
            text(row["run"]),
            text(row["kind"]),
            text(row["model"]),
            Cell(percent(row["coverage"]), row["coverage"]),
            figure(row["reach"], 2),
        ]
        for row in shown.to_dict("records")
    ]
    mean = frame.groupby("run").coverage.mean()
    half = int((mean < 0.5).sum())
    have = "has less than half of its" if half == 1 else "have less than half of their"
    takeaway = f"Mean over models, {counted(half, 'run')} of {len(mean)} {have} paths in the bands."
    columns = ["test run", "manoeuvre", "model", "paths in the band", "greatest error over the band [1]"]
    return Table(
        "coverage-runs", "Runs that bands hold least", takeaway, columns, [False, False, False, True, True], rows
    )


SECTION = Section(
    "How far off it may be",
    draw=lambda content: (
        coverage(content),
        table(content),
        width_map(content),
        groups(content),
        worst(content),
    ),
    needs=("coverage",),
    anchors=("coverage", "coverage-table", "width-map", "coverage-groups", "coverage-runs"),
)
