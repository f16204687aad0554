"""Motion as pages show it, over time and on a map: the pages of a replay and of a standard manoeuvre."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from shipid.errors import ShipidError
from shipid.report.content import AnswerSentence, Floats, PageContent, empty_frame, rows_as_tuples
from shipid.report.figure import (
    INK,
    MOST_LINE_POINTS,
    MUTED,
    Chip,
    Control,
    PageFigure,
    Panel,
    Trace,
    category_colour,
    even_places,
    make_axis,
    make_chart,
    make_line,
    make_plot,
    names_in,
    zero_axis,
)
from shipid.report.page import Section, write_page
from shipid.report.paths import outline_at
from shipid.report.tables import PageTable, digits_cell, frame_table, note_cells, with_cells, word_cell
from shipid.report.wording import counted_text, distance_text, number_text

LOG_SERIES = "measured"
DEGREES = float(np.rad2deg(1.0))
MOTION_AXES = {"u": ("speed ahead, u", "m/s", 1.0), "v": ("to starboard, v", "m/s", 1.0)} | {
    "r": ("yaw rate, r", "deg/s", DEGREES)
}
"""Column -> what it is, the unit shown, and how many of those an SI unit is."""

REPLAYED = "replayed"
REPLAY_INKS = {LOG_SERIES: {"color": INK, "dash": "solid"}, REPLAYED: {"color": category_colour(0), "dash": "solid"}}
REPLAY_ERRORS = {
    "run": "run",
    "u [m/s]": "u",
    "v [m/s]": "v",
    "r [deg/s]": "r",
    "position [m]": "position",
}
SPREAD_LINES = 40  # members of a family that are drawn: more fill the plane
SPREAD_QUANTILES = {0.05: "dash", 0.5: "solid", 0.95: "dash"}
OUTLINES = 12  # ships drawn along the track
EXECUTE_HEADING = "execute heading"  # the measure that is drawn beside the heading
MEASURE_COLUMNS = {
    "measure": "measure",
    "value": "value",
    "unit": "unit",
    "ship lengths": "lengths",
    "why missing": "missing",
}
CRITERION_COLUMNS = {
    "criterion": "criterion",
    "value": "value",
    "limit": "limit",
    "unit": "unit",
    "verdict": "verdict",
    "note": "note",
}
MANOEUVRE_LINES = {  # key -> name, whether it is held from order to order
    "heading": ("heading", False),
    "helm": ("helm", True),
    "u": ("ahead, u", False),
    "v": ("to starboard, v", False),
    "r": ("yaw rate, r", False),
    "shaft": ("shaft", True),
}


def motion_figure(
    series: pd.DataFrame, inks: Mapping[str, Mapping[str, Any]], framed: Sequence[str], **texts: Any
) -> PageFigure:
    """Panels of a run that a reader picks: u, v, r over time, and the map, north up with equal axes.

    series : run, model, piece, t [s], north, east [m], u, v [m/s], r [rad/s]. framed : models that the map shows whole.
    """
    runs = names_in(series)
    return PageFigure(
        **texts,
        height=290,
        draw=lambda run: _draw_motion(series[series["run"] == run], inks, framed),
        controls=[Control("Run", runs)],
        chips=[Chip(name, name, ink["color"], ink["dash"]) for name, ink in inks.items()],
    )


def _draw_motion(rows: pd.DataFrame, inks: Mapping[str, Mapping[str, Any]], framed: Sequence[str]) -> list[Panel]:
    parts = {name: _with_gaps(rows[rows["model"] == name]) for name in inks}
    looks = {name: {**ink, "width": 1.4 if name == LOG_SERIES else 2} for name, ink in inks.items()}
    panels = []
    for column, (title, unit, factor) in MOTION_AXES.items():
        traces = [
            make_line(name, mine["t"] - rows["t"].min(), factor * mine[column], [name], unit, line=looks[name])
            for name, mine in parts.items()
        ]
        panels.append(
            make_plot(traces, make_axis("time in the run [s]", nticks=6), zero_axis(f"{title} [{unit}]", nticks=6))
        )
    tracks = [make_line(name, mine["east"], mine["north"], [name], line=looks[name]) for name, mine in parts.items()]
    shown = pd.concat([parts[name] for name in framed])
    bounds = [(float(shown[name].min()), float(shown[name].max())) for name in ("east", "north")]
    bounds = [(low, high) if high > low else (low - 1, low + 1) for low, high in bounds]
    return [*panels, make_chart(tracks, "east [m]", "north [m]", bounds, nticks=4)]  # the panel is narrow


def _with_gaps(mine: pd.DataFrame) -> pd.DataFrame:
    """Join the pieces of a line, of no more rows than a line needs, with a gap between them."""
    pieces = mine.groupby("piece", sort=False)
    kept = mine[(pieces.cumcount() % max(1, len(mine) // MOST_LINE_POINTS) == 0).to_numpy()]
    gaps = pieces.tail(1).assign(**dict.fromkeys(("north", "east", "u", "v", "r"), np.nan))
    whole = pd.concat([kept, gaps])
    order = {name: i for i, name in enumerate(pd.unique(mine["piece"]))}
    return whole.iloc[np.argsort(whole["piece"].map(order).to_numpy(), kind="stable")]


@dataclass(frozen=True, eq=False, kw_only=True)
class ReplayContent(PageContent):
    """Everything the page shows.

    series : run, piece, t [s], model (`measured`, `replayed`), north, east [m], u, v [m/s], r [rad/s].
    errors : run (`all` at first), root mean squares u, v [m/s], r [rad/s], position [m].
    ahead : length of each simulation [s]; 0 for whole runs.
    """

    series: pd.DataFrame
    errors: pd.DataFrame
    ahead: float

    @property
    def answer(self) -> list[AnswerSentence]:
        """The error over all runs."""
        error = number_text(float(self.errors.set_index("run")["position"]["all"]))
        return [AnswerSentence(f"Position is {error} m off, RMS over all rows, {_length_words(self.ahead)}.", "errors")]


def _length_words(ahead: float) -> str:
    return f"in simulations of {ahead:g} s" if ahead else "in simulations as long as the runs"


def replayed_motion(content: ReplayContent) -> PageFigure:
    """Measured and replayed motion, one run at a time."""
    return motion_figure(
        content.series,
        REPLAY_INKS,
        (LOG_SERIES, REPLAYED),
        id="motion",
        title="Recorded and replayed",
        takeaway=content.answer[0].text,
        how="The vessel begins at the measured state and goes by the recorded orders and wind alone."
        + (" New simulations begin where lines are broken." if content.ahead else ""),
        alternative="Speeds, yaw rate and tracks, measured and replayed; the table below has the errors.",
    )


def replay_errors(content: ReplayContent) -> PageTable:
    """Root mean square errors, run by run."""
    title = f"Root mean square errors {_length_words(content.ahead)}"
    return frame_table("errors", title, "", content.errors.assign(r=DEGREES * content.errors["r"]), REPLAY_ERRORS)


REPLAY_PAGE = {
    "replay": Section(
        "Recorded and replayed", {"motion": (replayed_motion, "series"), "errors": (replay_errors, "series")}
    )
}
write_replay = partial(write_page, "replay", REPLAY_PAGE)


@dataclass(frozen=True, eq=False, kw_only=True)
class ManoeuvreContent(PageContent):
    """Everything the page shows.

    first : names of the measures that the answer says. measures, criteria : rows from `shipid.measures.criteria`.
    log : t [s], north, east [m], psi, helm [rad], u, v [m/s], r [rad/s], shaft [rev/s].
    levels : helm [rad], rate [rad/s] of a spiral in the order performed. outline : (k, 2) of the ship [m].
    drive_unit : of 60 times the shaft.
    """

    first: Sequence[str]
    log: pd.DataFrame
    measures: pd.DataFrame
    criteria: pd.DataFrame
    outline: Floats
    drive_unit: str
    levels: pd.DataFrame = field(default_factory=empty_frame("helm", "rate"))

    @property
    def answer(self) -> list[AnswerSentence]:
        """Sentences: the main measures, and how many criteria are met."""
        known = self.measures[self.measures["measure"].isin(self.first)]
        measures = [f"{row.measure}: {_amount_words(row.value, row.unit)}" for row in rows_as_tuples(known)]
        sentences = [AnswerSentence("; ".join(measures).capitalize() + ".", "measures")]
        judged = self.criteria[self.criteria["verdict"] != "not judged"] if len(self.criteria) else self.criteria
        if len(judged):
            met, notes = int((judged["verdict"] == "met").sum()), {str(note) for note in judged["note"]}
            common = f"; {notes.pop()}" if len(notes) == 1 and "" not in notes else ""
            words = f"{met} of {len(judged)} criteria of IMO MSC.137(76) are met{common}."
            sentences.append(AnswerSentence(words, "criteria"))
        return sentences


def _amount_words(value: float, unit: str) -> str:
    return f"{number_text(round(value, 3) + 0.0)} {unit}" if np.isfinite(value) else "not reached"


def measures_table(content: ManoeuvreContent) -> PageTable:
    """Every measure; one that is missing says why."""
    frame = content.measures
    shown = with_cells(frame, value=[digits_cell(round(value, 3), 3) for value in frame["value"]])
    if frame["note"].ne("").any():
        shown = with_cells(shown, missing=note_cells(frame["note"]))
    return frame_table("measures", "Measures", "", shown, MEASURE_COLUMNS)


def criteria_table(content: ManoeuvreContent) -> PageTable:
    """Criteria of IMO MSC.137(76) that apply to this kind of manoeuvre."""
    frame = content.criteria
    shown = with_cells(frame, verdict=[word_cell(verdict, bad=verdict == "not met") for verdict in frame["verdict"]])
    return frame_table("criteria", "Criteria of IMO MSC.137(76)", "", shown, CRITERION_COLUMNS)


def track_figure(content: ManoeuvreContent) -> PageFigure:
    """Path of the ship with its outline to scale, north up, equal axes."""
    log = content.log.iloc[even_places(len(content.log), MOST_LINE_POINTS)]
    poses = log[["north", "east", "psi"]].iloc[np.linspace(0, len(log) - 1, OUTLINES).astype(int)]
    gap = np.full((1, 2), np.nan)
    hulls = [np.vstack([outline_at(content.outline, pose), gap]) for pose in poses.to_numpy()]
    drawn = np.vstack([*hulls, log[["north", "east"]].to_numpy()])
    bounds = [(float(np.nanmin(drawn[:, i])), float(np.nanmax(drawn[:, i]))) for i in (1, 0)]
    east, north = (distance_text(high - low) for low, high in bounds)
    ships = np.vstack(hulls)
    words = [
        f"t = {row.t:.1f} s<br>{row.east:.1f} m east, {row.north:.1f} m north"
        for row in rows_as_tuples(log[["t", "east", "north"]])
    ]
    ink = {"color": category_colour(0), "width": 2.5}
    traces = [
        make_line("ship", ships[:, 1], ships[:, 0], ["ship"], line={"color": MUTED, "width": 1}, hover=""),
        make_line("track", log["east"], log["north"], ["track"], line=ink, hover=words),
    ]
    return PageFigure(
        id="track",
        title="The track",
        takeaway=f"With its outline the ship takes {north} from south to north and {east} from west to east.",
        how="Path of the logged point, north up, equal axes; the outline of the ship is to scale, at even times.",
        alternative="Map of the track.",
        height=460,
        draw=lambda: [make_chart(traces, "east [m]", "north [m]", bounds)],
        chips=[Chip("track", "track", category_colour(0), width=2.5), Chip("ship", "ship", MUTED, width=1)],
    )


def histories_figure(content: ManoeuvreContent) -> PageFigure:
    """Heading, helm, speeds, yaw rate and shaft over time."""
    log = content.log.iloc[even_places(len(content.log), MOST_LINE_POINTS)]
    executed, degrees = _value_of_measure(content, EXECUTE_HEADING), DEGREES * log[["psi", "helm", "r"]]
    values = degrees.assign(heading=degrees["psi"] - degrees["psi"].iloc[0], shaft=60 * log["shaft"])
    values = values.assign(u=log["u"], v=log["v"]).round(6)  # an axis is no picture of the rounding of a constant
    panels = {"heading, helm [deg]": ["heading", "helm"], "speed [m/s]": ["u", "v"], "yaw rate [deg/s]": ["r"]}
    panels |= {f"shaft [{content.drive_unit}]": ["shaft"]} if np.ptp(values["shaft"]) > 0 else {}
    return PageFigure(
        id="histories",
        title="Over time",
        takeaway=f"Yaw rate from {number_text(values['r'].min())} to {number_text(values['r'].max())} deg/s, "
        f"speed ahead from {number_text(values['u'].max())} down to {number_text(values['u'].min())} m/s.",
        how="Heading counted from that at the start of the log; helm and shaft as ordered, helm above 0 turns the ship "
        "to starboard." + (" Dotted: the execute headings." if np.isfinite(executed) else ""),
        alternative="Heading, helm, speeds and yaw rate over time.",
        height=270,
        draw=lambda: [_draw_history(log["t"], values[keys], title, executed) for title, keys in panels.items()],
        chips=[Chip(key, MANOEUVRE_LINES[key][0], _line_colour(key)) for keys in panels.values() for key in keys],
    )


def spread_figure(interval: float, motion: Mapping[str, Floats], diverged: int) -> PageFigure:
    """Tracks of the members of a family, and their headings over time with quantiles.

    interval : between records [s]. motion : north, east [m], psi [rad], each (records, members), of those that do not
    diverge; `diverged` counts the others. ShipidError where all do.
    """
    north, east, heading = motion["north"], motion["east"], DEGREES * motion["psi"]
    count, t = north.shape[1], interval * np.arange(len(north))
    if not count:
        raise ShipidError("there is nothing to draw: every member diverges", path="figures")
    away = np.hypot(*(values[-1] - np.median(values[-1]) for values in (north, east)))
    few, rows = even_places(count, SPREAD_LINES), even_places(len(t), MOST_LINE_POINTS)
    thin: dict[str, Any] = {"line": {"color": MUTED, "width": 1}, "opacity": 0.6, "hover": ""}
    every = [
        np.pad(values[rows][:, few], ((0, 1), (0, 0)), constant_values=np.nan).T.ravel()  # a gap between two members
        for values in (np.broadcast_to(t[:, None], north.shape), north, east, heading)
    ]
    track, spans = make_line("members", every[2], every[1], ["member"], **thin), [np.ptp(east), np.ptp(north)]
    flat = min(spans) < max(spans) / 3  # on equal axes a strip
    levels = np.quantile(heading[rows], list(SPREAD_QUANTILES), axis=1)
    turns = [
        make_line("members", every[0], every[3], ["member"], **thin),
        *(
            make_line(f"{100 * p:g} %", t[rows], level, ["q"], "deg", line={"color": category_colour(0), "dash": dash})
            for (p, dash), level in zip(SPREAD_QUANTILES.items(), levels, strict=True)
        ),
    ]
    return PageFigure(
        id="spread",
        title="How far the members come apart",
        takeaway=f"After {t[-1]:.4g} s half of {counted_text(count, 'member')} are within "
        f"{distance_text(np.quantile(away, 0.5))} of the median position, nine in ten within "
        f"{distance_text(np.quantile(away, 0.9))}; {diverged or 'none'} diverged.",
        how="One start, the same orders. The lines are those of a few members, the quantiles those of all."
        + (" Each axis of the tracks has a scale of its own." if flat else ""),
        alternative="Tracks and headings of the members.",
        height=420,
        draw=lambda: [
            make_plot([track], *(make_axis(name, nticks=6) for name in ("east [m]", "north [m]")))
            if flat
            else make_chart([track], "east [m]", "north [m]"),
            make_plot(turns, make_axis("time [s]", nticks=6), zero_axis("heading [deg]", nticks=6)),
        ],
        chips=[Chip("member", "members", MUTED, width=1), Chip("q", "5, 50, 95 %", category_colour(0))],
        captions=("Tracks", "Heading"),
    )


def _line_colour(key: str) -> str:
    return category_colour([*MANOEUVRE_LINES].index(key))


def _draw_history(t: pd.Series[float], values: pd.DataFrame, title: str, executed: float) -> Panel:
    """Some quantities over time, of the unit at the end of the title; execute headings are drawn with the heading."""
    traces: list[Trace] = []
    unit = title.rpartition("[")[2].rstrip("]")
    for level in (executed, -executed) if "heading" in values and np.isfinite(executed) else ():
        rule = {"color": MUTED, "width": 1, "dash": "dot"}
        traces.append(make_line(f"{level:g} deg", [t.iloc[0], t.iloc[-1]], [level] * 2, ["heading"], "deg", line=rule))
    for key in values:
        name, held = MANOEUVRE_LINES[str(key)]
        ink = {"color": _line_colour(str(key)), "shape": "hv" if held else "linear"}
        traces.append(make_line(name, t, values[key], [str(key)], unit, line=ink))
    return make_plot(traces, make_axis("time [s]", nticks=4), zero_axis(title, nticks=6))


def _value_of_measure(content: ManoeuvreContent, name: str) -> float:
    """Value of a measure; NaN where it was not measured."""
    values = content.measures.loc[content.measures["measure"] == name, "value"]
    return float(values.iloc[0]) if len(values) else float("nan")


def spiral_figure(content: ManoeuvreContent) -> PageFigure:
    """Steady yaw rate over helm."""
    levels = np.rad2deg(content.levels[["helm", "rate"]].astype(float))
    ink = {"color": category_colour(3)}
    trace = make_line("yaw rate", levels["helm"], levels["rate"], [], "deg/s", mode="lines+markers", line=ink)
    axes = zero_axis("helm [deg]", nticks=9), zero_axis("yaw rate [deg/s]", nticks=8)
    return PageFigure(
        id="spiral",
        title="Yaw rate over helm",
        takeaway=f"The loop is {_amount_words(_value_of_measure(content, 'loop width'), 'deg')} of helm wide.",
        how="One point for each level that became steady, joined in the order performed; > 0 is to starboard.",
        alternative="Steady yaw rate over helm angle.",
        height=420,
        draw=lambda: [make_plot([trace], *axes)],
    )


MANOEUVRE_PAGE = {
    "results": Section(
        "What was measured", {"measures": (measures_table, "measures"), "criteria": (criteria_table, "criteria")}
    ),
    "motion": Section(
        "What the ship did",
        {"track": (track_figure, "log"), "histories": (histories_figure, "log"), "spiral": (spiral_figure, "levels")},
    ),
}
write_manoeuvre = partial(write_page, "manoeuvre", MANOEUVRE_PAGE)
