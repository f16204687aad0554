"""How far off a prediction may be: bands, what share of test paths they hold, and their width."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from typing import Any

import pandas as pd

from shipid.report.content import ReportContent, rows_as_tuples
from shipid.report.figure import (
    MUTED,
    ColourScale,
    Control,
    PageFigure,
    Panel,
    Trace,
    error_bars,
    escape_name,
    make_axis,
    make_line,
    make_plot,
)
from shipid.report.page import Section
from shipid.report.physics_and_data import HEIGHT, draw_map, ends_of_map, map_of_cells
from shipid.report.selection import close_styles, close_up_models, figure_sizes, model_chips
from shipid.report.tables import PageTable, TableCell, frame_table, with_cells
from shipid.report.wording import counted_text, join_few_names, metres_text
from shipid.units import level_text, percent_text, plural_word

BAND_COLUMNS = {
    "model": "model",
    "N_D [1]": "N_D",
    "promised": "promised",
    "held [95 %]": "held",
    "mean radius [m]": "width",
    "radius at the end [m]": "end",
}


def _level_of_sentences(frame: pd.DataFrame) -> float:
    """The level of the sentences: 0.9 where it is promised, else the highest."""
    return 0.9 if frame.level.eq(0.9).any() else float(frame.level.max())


def coverage_figure(content: ReportContent) -> PageFigure | None:
    """Nominal against measured coverage, with intervals; None where no model of a close-up has a band."""
    frame = content.frame("coverage")
    names = [name for name in close_up_models(content) if name in set(frame.model)]
    if not names:
        return None
    counts, banded = figure_sizes(frame.N_D), frame.model.nunique()
    drawn = f" Of {banded} models, {join_few_names(names, 6)} {plural_word(len(names), 'is', 'are')} drawn."
    return PageFigure(
        id="coverage",
        title="What bands promise, and what they hold",
        takeaway=content.sentence_of("coverage", f"Bands of {counted_text(banded, 'model')} are calibrated."),
        how="A band is a region around every step of a predicted path; it holds a path if it holds all its steps. It "
        "is calibrated on errors of models that saw the run neither in training nor in the choice of hyperparameters, "
        "and counts runs, not windows. Measured on the test runs, on which no cell trained. Bars are exact binomial "
        f"95 % intervals for as many windows as {counted_text(int(frame.runs.max()), 'test run')} are worth: windows "
        "of one run are alike. The share is over all kinds of manoeuvre as they are mixed; a single kind may get less."
        + (drawn if len(names) < banded else ""),
        alternative="Points of the measured over the promised share of paths with intervals, one line per model. The "
        "numbers are in the table below.",
        height=420,
        draw=lambda size: [_draw_coverage(content, frame, names, size)],
        controls=[Control("Manoeuvres, N_D", counts, len(counts) - 1)],
        chips=model_chips(names, close_styles(content)),
    )


def _draw_coverage(content: ReportContent, frame: pd.DataFrame, names: list[str], size: int) -> Panel:
    diagonal = {"color": MUTED, "width": 1, "dash": "dash"}
    traces = [make_line("as promised", [0.45, 1.0], [0.45, 1.0], ["nominal"], "", line=diagonal)]
    for i, name in enumerate(names):
        look, mine = close_styles(content)[name], frame[frame.model.eq(name) & frame.N_D.eq(size)].sort_values("level")
        shift = 0.004 * (i - (len(names) - 1) / 2)  # intervals of several models would hide each other
        held, low, high = (mine[column].to_numpy(dtype=float) for column in ("coverage", "low", "high"))
        words = [
            f"{escape_name(name)}: {_share_words(row)} of {level_text(row['level'])}, to {metres_text(row['width'])}"
            for row in mine.to_dict("records")
        ]
        ink = {"color": look.colour, "width": look.width}
        drawn: Trace = {"mode": "lines+markers", "line": ink, "marker": {"symbol": look.symbol, "size": 7}}
        reach = error_bars(held, low, high, look.colour)
        traces.append(make_line(name, mine.level + shift, held, [f"model:{name}"], hover=words, error_y=reach, **drawn))
    least = min(0.5, frame.level.min()) - 0.05
    x = make_axis("share promised [1]", range=[least, 1.0], tickvals=sorted(set(frame.level)))
    return make_plot(traces, x, make_axis("share of whole test paths in the band [1]", range=[0, 1.02]))


def _share_words(row: dict[Hashable, Any]) -> str:
    return f"{percent_text(row['coverage'])} [{percent_text(row['low'])}, {percent_text(row['high'])}]"


def width_figure(content: ReportContent) -> PageFigure | None:
    """Mean radius of the bands over A and N_D; None where there is no map of the error either."""
    cells, frame = content.cells, content.frame("coverage")
    if "width" not in cells:
        return None
    if cells.width.notna().sum() < 2:  # too few runs for the level of the study: the highest there is
        top = frame[frame.level.eq(_level_of_sentences(frame))][["model", "N_D", "width"]]
        cells = cells.drop(columns="width").merge(top, how="left", on=["model", "N_D"])
    cells = cells[cells.width.notna()]
    shown = map_of_cells(replace(content, cells=cells.assign(H=cells.width)), with_physics=False)
    if shown is None:
        return None
    words = [
        f"<b>{escape_name(row.model)}</b>, N_D = {row.N_D}<br>{metres_text(row.H)}"
        for row in rows_as_tuples(shown.cells)
    ]
    shown = shown._replace(cells=shown.cells.assign(words=words))
    hatched = " Hatched: not narrower than the band of no physics at the same N_D." if shown.cells.worse.any() else ""
    return PageFigure(
        id="width-map",
        title="Physics and data: the band",
        takeaway=f"The mean radius of the band goes from {ends_of_map(shown.cells)}.",
        how="Each cell is a model, at its A on a square-root scale, given N_D manoeuvres; colour is the mean radius of "
        "its band over the horizon and all test windows, mean over seeds. Cells with too few runs for the level are "
        f"left out.{hatched}",
        alternative=f"Cells of the mean radius [m] for {counted_text(len(shown.rows), 'model')} by A and N_D. "
        "The numbers are in a table.",
        height=HEIGHT,
        draw=lambda: [draw_map(shown)],
        scale=ColourScale(
            "mean radius of the band [m]", float(shown.cells.H.min()), float(shown.cells.H.max()), "heat"
        ),
    )


def coverage_table(content: ReportContent) -> PageTable:
    """Coverage and width by model, N_D and level."""
    frame, refused = content.frame("coverage"), content.frame("no_band")
    reasons = [
        f"{join_few_names([f'{row.model} at N_D = {row.N_D}' for row in rows_as_tuples(part)])}: {reason}"
        for reason, part in (refused.groupby("reason", sort=False) if len(refused) else ())
    ]
    promised = [TableCell(level_text(level), level) for level in frame.level]
    held = [TableCell(_share_words(row), row["coverage"]) for row in frame.to_dict("records")]
    takeaway = f"Without a band: {'; '.join(reasons)}." if reasons else ""
    return frame_table(
        "coverage-table",
        "Bands by model",
        takeaway,
        with_cells(frame, promised=promised, held=held),
        BAND_COLUMNS,
    )


HOW_FAR_OFF = Section(
    "How far off it may be",
    {
        "coverage": (coverage_figure, "coverage"),
        "coverage-table": (coverage_table, "coverage"),
        "width-map": (width_figure, "coverage"),
    },
)
