"""Data as pages show them: tracks of the ship, the range of the inputs, and, as its own page, the checks of a log."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import pandas as pd

from shipid.report.content import PUBLISHED, AnswerSentence, PageContent, ReportContent, rows_as_tuples
from shipid.report.figure import (
    MOST_LINE_POINTS,
    MUTED,
    Chip,
    Control,
    PageFigure,
    Panel,
    Trace,
    category_colour,
    escape_name,
    even_places,
    make_axis,
    make_chart,
    make_line,
    make_plot,
    names_axis,
    names_in,
)
from shipid.report.motion import DEGREES
from shipid.report.page import Section, write_page
from shipid.report.tables import PageTable, TableCell, digits_cell, frame_table, with_cells, word_cell
from shipid.report.wording import (
    counted_text,
    distance_text,
    join_few_names,
    metres_text,
    number_text,
    scientific_text,
    set_sentence,
)

TRAINING_COLOUR, TEST_COLOUR, VALIDATION_COLOUR = (category_colour(i) for i in range(3))
REPAIR_COLUMNS = {
    "repair": "kind",
    "column": "column",
    "samples [1]": "count",
    "note": "note",
}
CHECK_COLUMNS = {
    "run": "run",
    "check": "check",
    "result": "ok",
    "value": "value",
    "limit": "limit",
    "what it says": "sentence",
}
SIGNALS_OF_CHECKS = {
    "rate [deg/s]": {"psi_rate": "rate of the heading", "r": "yaw rate r"},
    "distance [m]": {"drift": "position off integrated velocities"},
    "velocity [m/s]": {"u": "u", "v": "v"},
}
"""Title of an axis with its unit -> column of the series -> name."""


def set_colour(name: str) -> str:
    """Colour of what trains, validates or tests, by the first letters of the name; grey for what a paper published."""
    starts = {"test": TEST_COLOUR, "valid": VALIDATION_COLOUR, PUBLISHED: MUTED}
    return next((colour for start, colour in starts.items() if name.lower().startswith(start)), TRAINING_COLOUR)


def tracks_figure(content: ReportContent) -> PageFigure:
    """Tracks of all manoeuvres by set, north up, equal axes. Takes the content of any page."""
    tracks = content.tracks
    bounds = [(float(tracks[column].min()), float(tracks[column].max())) for column in ("east", "north")]
    names, counts = names_in(tracks, "set"), tracks.groupby("set").run.nunique()
    east, north = (distance_text(high - low) for low, high in bounds)
    runs = join_few_names([f"{counted_text(int(counts[name]), 'run')} ({name})" for name in names], 6)
    return PageFigure(
        id="manoeuvres",
        title="The manoeuvres",
        takeaway=f"{runs} cover {north} from south to north and {east} from west to east.",
        how="Logged positions, north up, equal axes; a run of many rows is drawn by some of them.",
        alternative="Map of the tracks of all manoeuvres, coloured by set.",
        height=520,
        draw=lambda: [_draw_tracks(tracks, bounds)],
        chips=[Chip(f"set:{name}", name, set_colour(name)) for name in names],
    )


def _draw_tracks(tracks: pd.DataFrame, bounds: list[tuple[float, float]]) -> Panel:
    """Tracks on a map; those of the test last, so that they lie on top."""
    traces = []
    for name in sorted(names_in(tracks, "set"), key=lambda name: set_colour(name) == TEST_COLOUR):
        for run, mine in tracks[tracks["set"] == name].groupby("run", sort=False):
            shown = mine.iloc[even_places(len(mine), MOST_LINE_POINTS)]
            ink = {"color": set_colour(name), "width": 2.2 if set_colour(name) == TEST_COLOUR else 1.2}
            words = f"{escape_name(run)} ({escape_name(name)})"
            traces.append(make_line(str(run), shown.east, shown.north, [f"set:{name}"], line=ink, hover=words))
    return make_chart(traces, "east [m]", "north [m]", bounds)


def envelope_figure(content: ReportContent) -> PageFigure:
    """Range and mean of every input per set, one panel per quantity."""
    frame = content.envelope
    by_count = frame["set"].str.fullmatch(r"D_\d+").any()  # sets called by their number of runs
    return PageFigure(
        id="envelope",
        title="What the inputs cover",
        takeaway=_beyond_words(frame[frame["set"] != PUBLISHED]),
        how="Bar: smallest to largest value at the instants of prediction; dot: mean. The table below has the numbers."
        + (" D_ and a number: so many runs, to train and to validate." if by_count else ""),
        alternative="Ranges of the inputs per set; the table below holds the same numbers.",
        height=24 * frame["set"].nunique() + 74,
        draw=lambda: [_draw_ranges(mine) for _, mine in frame.groupby("quantity", sort=False)],
    )


def _draw_ranges(mine: pd.DataFrame) -> Panel:
    """One quantity: a bar from smallest to largest and a dot at the mean, one row per set."""
    traces, quantity, unit = [], mine.quantity.iloc[0], mine.unit.iloc[0]
    for row, (name, low, mean, high) in enumerate(mine[["set", "min", "mean", "max"]].itertuples(index=False)):
        words = f"{escape_name(name)}: {_range_words(low, mean, high)} {escape_name(unit)}"
        bar: Trace = {"line": {"color": set_colour(name), "width": 5}, "opacity": 0.55}
        dot: Trace = {"color": set_colour(name), "size": 11}
        traces.append(make_line(name, [low, high], [row, row], [], hover=words, **bar))
        traces.append(make_line(name, [mean], [row], [], mode="markers", marker=dot, hover=words))
    y_axis = names_axis(names_in(mine, "set"), showgrid=False, range=[len(mine) - 0.4, -0.6])
    x_axis = make_axis(f"{escape_name(quantity)} [{escape_name(unit)}]", nticks=6)
    return make_plot(traces, x_axis, y_axis, margin={"l": 8, "r": 12, "t": 4, "b": 44})


def _range_words(low: float, mean: float, high: float) -> str:
    return " / ".join(number_text(float(value)) for value in (low, mean, high))


def _beyond_words(frame: pd.DataFrame) -> str:
    """Whether the test set leaves the range of the other sets."""
    is_test = frame["set"].map(set_colour).eq(TEST_COLOUR)
    tested, seen = (
        part.groupby("quantity", sort=False).agg(low=("min", "min"), high=("max", "max"))
        for part in (frame[is_test], frame[~is_test])
    )
    seen = seen.reindex(tested.index)
    if tested.empty or seen.low.isna().all():
        return f"{counted_text(frame.quantity.nunique(), 'input')} in {counted_text(frame['set'].nunique(), 'set')}."
    outside = [str(name) for name in tested.index[(tested.low < seen.low) | (tested.high > seen.high)]]
    if not outside:
        return f"The test stays inside what the other sets cover in all {counted_text(len(tested), 'input')}."
    reach = f"{len(outside)} of {counted_text(len(tested), 'input')}"
    return f"The test reaches outside what the other sets cover in {reach}: {join_few_names(outside)}."


def input_ranges(content: ReportContent) -> PageTable:
    """Smallest, mean and largest value of every input, a row per set."""
    frame = content.envelope
    ranges = {
        (row["set"], row["quantity"]): TableCell(_range_words(row["min"], row["mean"], row["max"]), float(row["mean"]))
        for row in frame.to_dict("records")
    }
    sets = sorted(names_in(frame, "set"), key=lambda name: name == PUBLISHED)
    units = dict(zip(frame["quantity"], frame["unit"], strict=True))
    rows = {name: [ranges.get((of, name), word_cell(None)) for of in sets] for name in units}
    columns = {f"{name} [{unit}]": name for name, unit in units.items()}
    shown = pd.DataFrame({"the set": sets, **rows})
    return frame_table("envelope-table", "Minimum / mean / maximum", "", shown, {"set": "the set", **columns})


def repairs_table(content: ReportContent) -> PageTable:
    """The table of repairs by the importer. Takes the content of any page."""
    kinds = names_in(content.repairs, "kind")
    takeaway = f"{counted_text(len(content.repairs), 'repair')}: {join_few_names(kinds)}."
    return frame_table("repairs", "What the importer repaired", takeaway, content.repairs, REPAIR_COLUMNS)


THE_DATA = Section(
    "The data",
    {
        "manoeuvres": (tracks_figure, "tracks"),
        "envelope": (envelope_figure, "envelope"),
        "envelope-table": (input_ranges, "envelope"),
        "repairs": (repairs_table, "repairs"),
    },
)


@dataclass(frozen=True, eq=False, kw_only=True)
class CheckContent(PageContent):
    """Everything the page of a checked log shows.

    checks : check, run, value, unit, limit, ok, sentence. tracks : run, set, north, east [m].
    series : run, t [s], r and psi_rate [rad/s], drift [m], u, v [m/s]. repairs : kind, column, count, note.
    """

    checks: pd.DataFrame
    series: pd.DataFrame
    tracks: pd.DataFrame
    repairs: pd.DataFrame
    title: str = "Is this log in order?"

    @property
    def answer(self) -> list[AnswerSentence]:
        """How many checks passed, and which failed."""
        failed, runs = self.checks[~self.checks["ok"].astype(bool)], counted_text(self.checks["run"].nunique(), "run")
        every = counted_text(len(self.checks), "check")
        if failed.empty:
            return [AnswerSentence(f"All {every} of {runs} passed.")]
        return [
            AnswerSentence(f"{len(failed)} of {every} failed, in {failed['run'].nunique()} of {runs}."),
            AnswerSentence(f"What failed: {join_few_names(names_in(failed, 'check'), 8)}."),
        ]


def checks_table(content: CheckContent) -> PageTable:
    """The table of all checks, failed ones first; what these say is shown whole."""
    frame = content.checks.assign(ok=content.checks["ok"].astype(bool)).sort_values("ok", kind="stable")
    units = frame["unit"].mask(frame["unit"].eq("1"), "")
    values = zip(frame["value"], units, strict=True)
    cells = {
        "ok": [word_cell("passed" if ok else "failed", bad=not ok) for ok in frame["ok"]],
        "value": [TableCell(f"{scientific_text(one, 3)} {unit}".rstrip(), float(one)) for one, unit in values],
        "limit": [digits_cell(limit, 3) for limit in frame["limit"]],
        "sentence": [word_cell(set_sentence(row.sentence), bad=not row.ok) for row in rows_as_tuples(frame)],
    }
    return frame_table("all-checks", "Every check", "", with_cells(frame, **cells), CHECK_COLUMNS)


def checked_motion(content: CheckContent) -> PageFigure:
    """Rate of the heading and yaw rate, drift of the position, and velocities, over time, one run at a time."""
    series, runs = content.series, names_in(content.series)
    worst = series.groupby("run")["drift"].max()
    names = [name for columns in SIGNALS_OF_CHECKS.values() for name in columns.items()]
    return PageFigure(
        id="motion-figure",
        title="Heading, yaw rate, position and velocity",
        takeaway=f"Positions leave integrated velocities most in {worst.idxmax()}: {metres_text(worst.max())}.",
        how="Rate of the heading by central differences; distance between the position and integrated u, v, psi, which "
        "start together every 30 s.",
        alternative="Lines over time; the table below has the results of the checks.",
        height=240,
        draw=lambda run: _draw_checked(series[series["run"] == run]),
        controls=[Control("Run", runs, runs.index(str(worst.idxmax())))],
        chips=[Chip(column, name, category_colour(i)) for i, (column, name) in enumerate(names)],
    )


def _draw_checked(rows: pd.DataFrame) -> list[Panel]:
    shown = rows.iloc[even_places(len(rows), MOST_LINE_POINTS)]
    t = shown["t"] - rows["t"].iloc[0]  # single precision would not do for a clock since 1970
    shown = shown.assign(psi_rate=DEGREES * shown["psi_rate"], r=DEGREES * shown["r"])
    order, panels = [column for columns in SIGNALS_OF_CHECKS.values() for column in columns], []
    for title, columns in SIGNALS_OF_CHECKS.items():
        unit = title.partition("[")[2].rstrip("]")
        traces = [
            make_line(
                name,
                t,
                shown[column],
                [column],
                unit,
                line={"color": category_colour(order.index(column)), "width": 1.5},
            )
            for column, name in columns.items()
        ]
        panels.append(make_plot(traces, make_axis("time in the run [s]"), make_axis(title)))
    return panels


CHECK_PAGE = {
    "motion": Section("What the checks compare", {"motion-figure": (checked_motion, "series")}),
    "checks": Section("The checks", {"all-checks": (checks_table, "checks")}),
    "data": Section("The data", {"manoeuvres": (tracks_figure, "tracks"), "repairs": (repairs_table, "repairs")}),
}
write_checks = partial(write_page, "data check", CHECK_PAGE)
