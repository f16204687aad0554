"""The data of a study: the tracks of the ship, and the range of the inputs in each set of manoeuvres."""

from __future__ import annotations

import pandas as pd

from shipid.report.content import PUBLISHED, ReportContent
from shipid.report.figure import (
    MOST_LINE_POINTS,
    MUTED,
    Chip,
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
from shipid.report.page import Section
from shipid.report.tables import PageTable, TableCell, frame_table, word_cell
from shipid.report.wording import counted_text, distance_text, join_few_names, number_text

TRAINING_COLOUR, TEST_COLOUR, VALIDATION_COLOUR = (category_colour(i) for i in range(3))
REPAIR_COLUMNS = {
    "repair": "kind",
    "column": "column",
    "samples [1]": "count",
    "note": "note",
}


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
