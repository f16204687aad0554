"""The data of a study: the tracks of the ship, and the range of the inputs in each set of manoeuvres."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from shipid.report import tables
from shipid.report.content import PUBLISHED, ReportContent
from shipid.report.figure import Chip, Figure, Panel, Plot, Trace, axis, label, layout, line, plane
from shipid.report.palette import MUTED, category
from shipid.report.section import Section
from shipid.report.selection import thinned
from shipid.report.wording import counted, distance, listed, number

TRAIN, TEST, VALIDATION = 0, 1, 2  # indices of the category colours
NEAR = 0.2  # of the published range: an end this close is met
PIXELS = 2000  # a track needs no more detail than extent / PIXELS


def set_colour(name: str) -> str:
    """Blue for what trains, green for what validates, vermillion for the test, for any names of the sets."""
    word = name.lower()
    return category(TEST if word.startswith("test") else VALIDATION if word.startswith("valid") else TRAIN)


def manoeuvres(content: ReportContent) -> Figure | None:
    """Tracks of all manoeuvres by set, north up, equal axes; None without rows."""
    tracks = content.tracks
    if tracks.empty:
        return None
    bounds = [(float(tracks[column].min()), float(tracks[column].max())) for column in ("east", "north")]
    extent = max(high - low for low, high in bounds)
    traces, names = [], _sets(tracks["set"])
    # Test last, so that it lies on top.
    for name in sorted(names, key=lambda name: (set_colour(name) == category(TEST), names.index(name))):
        for run, mine in tracks[tracks["set"] == name].groupby("run", sort=False):
            points = mine[["east", "north"]].to_numpy(dtype=float)
            points = points[thinned([points], extent / PIXELS)[0]]
            ink = {"color": set_colour(name), "width": 2.2 if set_colour(name) == category(TEST) else 1.2}
            traces.append(line(str(run), points[:, 0], points[:, 1], [f"set:{name}"], line=ink))
            traces[-1]["hovertemplate"] = f"{label(str(run))} ({label(name)})<extra></extra>"
    counts = tracks.groupby("set").run.nunique()
    east, north = (distance(high - low) for low, high in bounds)
    runs = listed([f"{counted(int(counts[name]), 'run')} ({name})" for name in names], 6)
    return Figure(
        id="manoeuvres",
        title="The manoeuvres",
        takeaway=f"{runs} cover {north} from south to north and {east} from west to east.",
        how="Logged positions, north up, equal axes; points closer to the line than a pixel are left out.",
        alternative="Map of the tracks of all manoeuvres, coloured by set.",
        height=520,
        views={"": [Panel(Plot(traces, plane("east [m]", "north [m]", bounds)))]},
        chips=[Chip(f"set:{name}", name, set_colour(name)) for name in names],
    )


def envelope(content: ReportContent) -> Figure | None:
    """Range and mean of every input per set, one panel per quantity; None without rows."""
    frame = content.envelope
    if frame.empty:
        return None
    frame = frame.iloc[frame["set"].eq(PUBLISHED).to_numpy().argsort(kind="stable")]
    panels = [Panel(_ranges(mine)) for _, mine in frame.groupby("quantity", sort=False)]
    compared = " The open bar is what the paper published, not data of this study."
    return Figure(
        id="envelope",
        title="What the inputs cover",
        takeaway=_takeaway(frame),
        how="Bar: smallest to largest value at the instants of prediction; dot: mean. The table below has the numbers."
        + (" D_ and a number: so many runs, to train and to validate." if _counted_sets(frame) else "")
        + (compared if frame["set"].eq(PUBLISHED).any() else ""),
        alternative="Ranges of the inputs per set; the table below holds the same numbers.",
        height=24 * frame["set"].nunique() + 74,
        views={"": panels},
    )


def _counted_sets(frame: pd.DataFrame) -> bool:
    """Whether some sets are called by their number of runs, such as D_10."""
    return bool(frame["set"].str.fullmatch(r"D_\d+").any())


def _ranges(mine: pd.DataFrame) -> Plot:
    """One quantity: a bar from smallest to largest and a dot at the mean, one row per set."""
    traces, names = [], [str(name) for name in mine["set"]]
    quantity, unit = str(mine.quantity.iloc[0]), str(mine.unit.iloc[0])
    for row, values in enumerate(mine.itertuples()):
        ink = set_colour(names[row])
        numbers = [float(str(value)) for value in (values.min, values.mean, values.max)]
        bar = line(names[row], [numbers[0], numbers[2]], [row, row], [], line={"color": ink, "width": 5})
        dot = line(names[row], numbers[1:2], [row], [], mode="markers", marker={"color": ink, "size": 11})
        text = " / ".join(number(value) for value in numbers)
        bar["opacity"] = 0.55
        if names[row] == PUBLISHED:
            bar, dot = _open_bar(numbers, row)
        for trace in (bar, dot):
            trace["hovertemplate"] = f"{label(names[row])}: {text} {label(unit)}<extra></extra>"
        traces += [bar, dot]
    y = axis("", tickvals=list(range(len(names))), ticktext=[label(name) for name in names], showgrid=False)
    y["range"] = [len(names) - 0.4, -0.6]
    low, high = float(mine["min"].min()), float(mine["max"].max())
    room = 0.06 * (high - low) or 1.0
    x = axis(f"{label(quantity)} [{label(unit)}]", nticks=6, range=[low - room, high + room])
    return Plot(traces, layout(x, y, hovermode="closest", margin={"l": 8, "r": 12, "t": 4, "b": 44}))


def _open_bar(numbers: Sequence[float], row: int) -> tuple[Trace, Trace]:
    """Return the outline of a bar and an open dot: the published range and mean."""
    low, mean, high = numbers
    x, y = [low, high, high, low, low], [row - 0.2, row - 0.2, row + 0.2, row + 0.2, row - 0.2]
    bar = line(PUBLISHED, x, y, [], line={"color": MUTED, "width": 1.5})
    ink = {"symbol": "circle-open", "color": MUTED, "size": 9, "line": {"width": 2}}
    return bar, line(PUBLISHED, [mean], [row], [], mode="markers", marker=ink)


def _takeaway(frame: pd.DataFrame) -> str:
    """Return whether the test set leaves the range of the other sets, and how near the published ranges are."""
    ours, published = frame[frame["set"] != PUBLISHED], frame[frame["set"] == PUBLISHED]
    return " ".join(part for part in (_beyond(ours), _near(ours, published)) if part)


def _near(ours: pd.DataFrame, published: pd.DataFrame) -> str:
    """Count the ends of all sets together that lie within a fifth of the published range from the published end."""
    if ours.empty or published.empty:
        return ""
    num_known, far = 0, []
    for theirs in published.itertuples():
        mine = ours[ours.quantity == theirs.quantity]
        low, high = float(str(theirs.min)), float(str(theirs.max))
        for word, end, value in (("min", low, mine["min"].min()), ("max", high, mine["max"].max())):
            num_known += bool(pd.notna(value))
            if abs(float(value) - end) > NEAR * (high - low):
                far.append(f"{word} of {theirs.quantity}")
    text = (
        f"{num_known - len(far)} of {num_known} published ends are met within {100 * NEAR:.0f} % of the published range"
    )
    return f"{text}; not {listed(far, 6)}." if far else f"{text}."


def _beyond(frame: pd.DataFrame) -> str:
    is_test = frame["set"].map(lambda name: set_colour(name) == category(TEST))
    tested = frame[is_test].groupby("quantity", sort=False).agg(low=("min", "min"), high=("max", "max"))
    seen = frame[~is_test].groupby("quantity").agg(low=("min", "min"), high=("max", "max")).reindex(tested.index)
    if tested.empty or seen.low.isna().all():
        return f"{counted(frame.quantity.nunique(), 'input')} in {counted(frame['set'].nunique(), 'set')}."
    outside = tested.index[(tested.low < seen.low) | (tested.high > seen.high)]
    if len(outside) == 0:
        return f"The test stays inside what the other sets cover in all {counted(len(tested), 'input')}."
    reach = f"{len(outside)} of {counted(len(tested), 'input')}"
    return f"The test reaches outside what the other sets cover in {reach}: {listed([str(name) for name in outside])}."


def _sets(column: pd.Series[str]) -> Sequence[str]:
    return [str(name) for name in pd.unique(column)]


SECTION = Section(
    "The data",
    draw=lambda content: (manoeuvres(content), envelope(content), tables.envelope(content), tables.repairs(content)),
    anchors=("manoeuvres", "envelope", "envelope-table", "repairs"),
)
