"""The page of an identification: estimates with intervals, errors on runs held out, and residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from textwrap import wrap

import numpy as np
import pandas as pd

from shipid.report.content import AnswerSentence, Floats, PageContent, empty_frame, rows_as_tuples
from shipid.report.figure import (
    INK,
    MUTED,
    Chip,
    PageFigure,
    Panel,
    Trace,
    category_colour,
    error_bars,
    escape_name,
    make_axis,
    make_line,
    make_plot,
    names_axis,
    names_in,
    zero_axis,
)
from shipid.report.motion import LOG_SERIES, MOTION_AXES, motion_figure
from shipid.report.page import Section, write_page
from shipid.report.tables import (
    MISSING,
    PageTable,
    TableCell,
    digits_cell,
    frame_table,
    note_cells,
    with_cells,
    word_cell,
)
from shipid.report.wording import counted_text, join_few_names, number_text, set_sentence
from shipid.units import interval_text

PARAMETER_HEIGHT, HEAD = 22, 74  # height of a parameter, and of what is around them [px]
WIDTH, SIDE = 18, 150  # of a cell of the heat map, and of what is around them [px]
MOST_NAMED = 16  # estimates whose names have room below the columns on a phone
FARTHEST_INTERVAL = 4.0  # an interval may reach so many spans of the estimates beyond them before it is cut
BEFORE, AFTER = "before", "after"
ESTIMATE_CHIPS = (
    Chip("identified", "identified", category_colour(0), symbol="circle"),
    Chip("vague", "not identified", MUTED, symbol="circle-open"),
)
RUN_INKS = {
    LOG_SERIES: {"color": INK, "dash": "solid"},
    BEFORE: {"color": category_colour(1), "dash": "dot"},
    AFTER: {"color": category_colour(0), "dash": "solid"},
}
ESTIMATE_COLUMNS = {
    "parameter": "words",
    "unit": "unit",
    "base": "base",
    "estimate": "value",
    "standard error": "error",
    "factor": "factor",
    "factor, 95 %": "interval",
    "identified": "identified",
}
MEASURES_BEFORE_AND_AFTER = {
    "manoeuvre": "manoeuvre",
    "measure": "measure",
    BEFORE: BEFORE,
    AFTER: AFTER,
    "band from": "low",
    "to": "high",
    "unit": "unit",
    "why missing": "missing",
}
PROGRAMME_COLUMNS = {
    "manoeuvre": "manoeuvre",
    "time [h]": "hours",
    "gain [bit]": "gain",
    "gain [bit/h]": "per_hour",
    "narrows most": "narrows",
    "by [%]": "by",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentificationContent(PageContent):
    """Everything the page shows.

    estimates : name, path, with, unit, base, value, error, factor, factor_low, factor_high (infinite where nothing is
    known), identified, reason. correlations : (n, n) of them.
    errors : set (`fit`, `test`), run (`all` at first), model (`before`, `after`), root mean squares u, v [m/s], r
    [rad/s], position [m].
    series : run, piece, t [s], model (`measured`, `before`, `after`), north, east [m], psi [rad], u, v [m/s], r
    [rad/s].
    unseen : sentences that explain unidentified parameters. held_out : runs of the set `test`.
    ahead : length of a free run [s], 0 for whole runs. manoeuvres : manoeuvre, measure, unit, before, after, note; with
    a band also low and high.
    colours : signal, lag [s], correlation of the residuals. profiles : path, factor, rise, limit, sentence.
    beyond : manoeuvres that go farther than the data.
    programme : manoeuvre, hours, gain [bit], per_hour, narrows, before, after.
    """

    estimates: pd.DataFrame
    correlations: Floats
    unseen: Sequence[str]
    warnings: Sequence[str]
    errors: pd.DataFrame
    series: pd.DataFrame
    held_out: Sequence[str]
    ahead: float
    manoeuvres: pd.DataFrame
    colours: pd.DataFrame
    profiles: pd.DataFrame = field(default_factory=empty_frame())
    programme: pd.DataFrame = field(default_factory=empty_frame())
    beyond: Sequence[str] = ()

    @property
    def answer(self) -> list[AnswerSentence]:
        """Sentences: how many parameters are identified, errors on runs held out before and after, warnings."""
        known, count = int(self.estimates["identified"].sum()), len(self.estimates)
        first = f"{known} of {counted_text(count, 'parameter')} are identified by these runs."
        sentences = [AnswerSentence(first, "estimates"), AnswerSentence(_errors_before_and_after(self), "free-runs")]
        return [*sentences, *(AnswerSentence(f"Careful: {warning}.") for warning in self.warnings)]


def _errors_before_and_after(content: IdentificationContent) -> str:
    which = "test" if content.held_out else "fit"
    rows = content.errors[(content.errors["set"] == which) & (content.errors["run"] == "all")].set_index("model")
    runs = counted_text(len(content.held_out), "run") + " held out" if content.held_out else "the fitted runs"
    changes = [
        f"{name} from {number_text(factor * rms[BEFORE])} to {number_text(factor * rms[AFTER])} {unit}"
        for name, (_, unit, factor) in {**MOTION_AXES, "position": ("", "m", 1.0)}.items()
        for rms in [rows[name].astype(float)]
    ]
    return (
        f"On {runs}, the root mean square error of a free run {_run_length(content)} goes in {join_few_names(changes)}."
    )


def _run_length(content: IdentificationContent) -> str:
    return f"of {content.ahead:g} s" if content.ahead else "over the whole run"


def estimates_figure(content: IdentificationContent) -> PageFigure:
    """Estimates with 95 % intervals as factors on the base values; hollow where not identified."""
    frame = content.estimates
    low, high = _span_of_factors(frame)
    cut = bool(((frame["factor_low"] < low) | (frame["factor_high"] > high)).any())
    vague = frame.loc[~frame["identified"].astype(bool), "name"].tolist()
    none = frame.loc[frame["base"] == 0, "name"].tolist()
    return PageFigure(
        id="estimates",
        title="The estimates",
        takeaway=f"Not identified: {join_few_names(vague, 8)}." if vague else "Every parameter is identified.",
        how="Dot: estimate; bar: 95 % interval; dotted: the base value. Hollow: the interval holds 0, no effect, or is "
        "wider than ±100 % of the base value by the runs alone, without priors; or a bound or a drop ended the fit."
        + (
            f" The base has 0 for {join_few_names(none, 8)}: there factors are on the scale, which is dotted."
            if none
            else ""
        )
        + (" Bars that reach an edge go on." if cut else ""),
        alternative="Estimates with intervals; the table below has the numbers.",
        height=PARAMETER_HEIGHT * len(frame) + HEAD,
        draw=lambda: [_draw_estimates(frame, low, high)],
        chips=ESTIMATE_CHIPS,
    )


def _draw_estimates(frame: pd.DataFrame, low: float, high: float) -> Panel:
    base_ink = {"color": INK, "width": 1, "dash": "dot"}
    traces = [make_line("base", [1.0, 1.0], [-0.7, len(frame) - 0.3], [], line=base_ink, hover="")]
    numbered = frame.assign(row=np.arange(len(frame), dtype=float))
    for chip in ESTIMATE_CHIPS:
        mine = numbered[frame["identified"].astype(bool) == (chip.key == "identified")]
        near, far = np.clip(mine[["factor_low", "factor_high"]].to_numpy(dtype=float), low, high).T
        marker = {"symbol": chip.symbol, "color": chip.colour, "size": 9, "line": {"color": chip.colour, "width": 2}}
        look: Trace = {"marker": marker, "error_x": error_bars(mine["factor"].to_numpy(float), near, far, chip.colour)}
        words = [
            f"<b>{escape_name(row.path)}</b> x {row.factor:.4g}, 95 % {interval_text(row.factor_low, row.factor_high)}"
            f"<br>{'<br>'.join(wrap(escape_name(row.reason), 70))}"
            for row in rows_as_tuples(mine)
        ]
        traces.append(
            make_line("estimate", mine["factor"], mine["row"], [chip.key], mode="markers", hover=words, **look)
        )
    y = names_axis(list(frame["name"]), showgrid=False, range=[len(frame) - 0.4, -0.6])
    x_axis = make_axis("factor on the base value [1]", nticks=9, range=[low, high])
    return make_plot(traces, x_axis, y, margin={"l": 8, "r": 12, "t": 4, "b": 44})


def _span_of_factors(frame: pd.DataFrame) -> tuple[float, float]:
    """The range of factors drawn: all estimates, and intervals as far as estimates stay distinguishable."""
    dots = np.append(frame["factor"].to_numpy(dtype=float), 1.0)
    reach = FARTHEST_INTERVAL * max(float(np.ptp(dots)), 0.25)
    given = frame[["factor_low", "factor_high"]].to_numpy(dtype=float)
    ends = np.append(given[np.isfinite(given)], dots)
    low, high = max(float(ends.min()), dots.min() - reach), min(float(ends.max()), dots.max() + reach)
    return low - 0.04 * (high - low), high + 0.04 * (high - low)


def estimates_table(content: IdentificationContent) -> PageTable:
    """The table of all estimates in their units."""
    frame = content.estimates
    words = [row["path"] + (f" (with {row['with']})" if row["with"] else "") for row in frame.to_dict("records")]
    numbers = {name: list(map(digits_cell, frame[name])) for name in ("base", "value", "error", "factor")}
    intervals = [
        TableCell(interval_text(low, high, " … ").replace("-", "−"), float(low))
        if np.isfinite(high - low)
        else TableCell("none", MISSING)
        for low, high in zip(frame["factor_low"], frame["factor_high"], strict=True)
    ]
    identified = [word_cell("yes" if known else "no", bad=not known) for known in frame["identified"]]
    shown = with_cells(frame.assign(words=words), interval=intervals, identified=identified, **numbers)
    return frame_table("numbers", "Every estimate", "", shown, ESTIMATE_COLUMNS)


def unseen_table(content: IdentificationContent) -> PageTable:
    """The table of what is not identified, and why."""
    rows = [[word_cell(set_sentence(f"{sentence[0].upper()}{sentence[1:]}"))] for sentence in content.unseen]
    takeaway = "Fix, tie or give priors to some of these, or run manoeuvres that separate them."
    return PageTable("unseen", "What is not identified", takeaway, ["why"], [False], rows)


def correlations_figure(content: IdentificationContent) -> PageFigure | None:
    """Correlations of the estimates; None for a single one."""
    names, matrix = [str(name) for name in content.estimates["name"]], np.asarray(content.correlations, dtype=float)
    if len(names) < 2:
        return None
    i, j = np.unravel_index(int(np.argmax(np.abs(matrix - np.eye(len(names))))), matrix.shape)
    order = " Columns are in the order of the rows." if len(names) > MOST_NAMED else ""
    return PageFigure(
        id="correlations",
        title="Correlated estimates",
        takeaway=f"Most correlated are {names[i]} and {names[j]}: {number_text(float(matrix[i, j]))}.",
        how="Correlations of the errors of the estimates: near 1 or −1, a change of one is compensated by a change "
        f"of the other, and only their combination is known.{order}",
        alternative="Heat map of the correlations of all pairs of estimates.",
        height=WIDTH * len(names) + SIDE,
        draw=lambda: [_draw_correlations([escape_name(name) for name in names], matrix)],
    )


def _draw_correlations(names: Sequence[str], matrix: Floats) -> Panel:
    scale = [[0.0, "var(--category-0)"], [0.5, "var(--page)"], [1.0, "var(--category-1)"]]
    bar = {"thickness": 12, "title": {"text": "correlation [1]", "side": "right"}}
    heat: Trace = {
        "type": "heatmap",
        "z": matrix.astype(np.float32),
        "x": names,
        "y": names,
        "zmin": -1,
        "zmax": 1,
        "colorscale": scale,
        "colorbar": bar,
        "hovertemplate": "%{y} and %{x}: %{z:.2f}<extra></extra>",
    }
    x = make_axis("", tickangle=-90, showticklabels=len(names) <= MOST_NAMED, showgrid=False)
    return make_plot([heat], x, make_axis("", autorange="reversed"), margin={"l": 8, "r": 8, "t": 8, "b": 8})


def free_runs_figure(content: IdentificationContent) -> PageFigure:
    """Measured motion and free runs before and after, one run at a time."""
    return motion_figure(
        content.series,
        RUN_INKS,
        (LOG_SERIES, AFTER),
        id="free-runs",
        title="Free runs " + ("of runs held out" if content.held_out else "of the fitted runs"),
        takeaway=_errors_before_and_after(content),
        how=f"Each free run {_run_length(content)} begins at the measured state and goes by the commands alone, with "
        "no current, bias or other unknown of the run."
        + (" New pieces begin where lines are broken." if content.ahead else "")
        + " The map, north up with equal axes, shows what is measured and identified; the base may leave it.",
        alternative="Speeds, yaw rate and tracks, measured and predicted; the table below has the errors.",
    )


def free_run_errors(content: IdentificationContent) -> PageTable:
    """Root mean square errors of the free runs, run by run: of all runs first, and of those held out before others."""
    factors = {name: factor for name, (_, _, factor) in MOTION_AXES.items()} | {"position": 1.0}
    scaled = content.errors.assign(**{name: factor * content.errors[name] for name, factor in factors.items()})
    wide = scaled.pivot(index=["set", "run"], columns="model", values=list(factors))
    wide.columns = wide.columns.map(" ".join)
    pairs = dict.fromkeys(zip(content.errors["set"], content.errors["run"], strict=True))
    wide = wide.reindex(sorted(pairs, key=lambda pair: (pair[1] != "all", pair[0] != "test"))).reset_index()
    named = wide["run"].where(wide["run"].ne("all"), "all " + wide["set"].map({"fit": "fitted", "test": "held out"}))
    heads = ["run", "set", *(f"{name} {model}" for name in factors for model in (BEFORE, AFTER))]
    title = f"Root mean square errors of free runs {_run_length(content)}"
    takeaway = "u, v in m/s, r in deg/s, position in m."
    return frame_table("errors", title, takeaway, wide.assign(run=named), dict(zip(heads, heads, strict=True)))


def manoeuvres_before_and_after(content: IdentificationContent) -> PageTable | None:
    """Measures of standard manoeuvres before and after; None where there are none."""
    performed = content.manoeuvres[content.manoeuvres["measure"] != ""]
    if performed.empty:
        return None
    numbers = [name for name in (BEFORE, AFTER, "low", "high") if name in performed]
    shown = with_cells(performed, **{name: list(map(digits_cell, performed[name])) for name in numbers})
    if performed["note"].ne("").any():
        shown = with_cells(shown, missing=note_cells(performed["note"]))
    takeaway = "Simulated in calm deep water, from U_0 of the vessel or a Froude number of 0.2."
    takeaway += "".join(f" Extrapolated: {sentence}." for sentence in content.beyond)
    takeaway += " The band is what the uncertainty of the estimates leaves open." if "low" in performed else ""
    return frame_table("manoeuvres", "Standard manoeuvres", takeaway, shown, MEASURES_BEFORE_AND_AFTER)


def residuals_figure(content: IdentificationContent) -> PageFigure:
    """Autocorrelation of the residuals."""
    frame = content.colours
    parts = {name: frame[frame["signal"] == name] for name in names_in(frame, "signal")}
    first = [f"{name} {number_text(([*mine['correlation'], 0.0, 0.0])[1])}" for name, mine in parts.items()]
    return PageFigure(
        id="residuals",
        title="Autocorrelation of the residuals",
        takeaway=f"The correlation of residuals one sample apart is {join_few_names(first)}.",
        how="Autocorrelation of the weighted residuals, pooled over runs. White residuals drop to 0; a long "
        "tail shows effects that the model, or the data on wind and current, lack; standard errors then count runs.",
        alternative="Autocorrelation of the residuals of each signal over lag.",
        height=300,
        draw=lambda: [_draw_residuals(parts)],
        chips=[Chip(name, name, category_colour(i)) for i, name in enumerate(parts)],
    )


def _draw_residuals(parts: Mapping[str, pd.DataFrame]) -> Panel:
    traces = [
        make_line(name, mine["lag"], mine["correlation"], [name], "", line={"color": category_colour(i), "width": 2})
        for i, (name, mine) in enumerate(parts.items())
    ]
    least = min(-0.5, *(float(mine["correlation"].min()) for mine in parts.values()))
    y = zero_axis("autocorrelation [1]", INK, nticks=6, range=[least - 0.05, 1.05])
    return make_plot(traces, make_axis("lag [s]", nticks=9), y)


def profiles_figure(content: IdentificationContent) -> PageFigure:
    """The figure of the profile likelihoods."""
    curves = content.profiles.groupby("path", sort=False)
    return PageFigure(
        id="profiles",
        title="Profile likelihood",
        takeaway="; ".join(curves["sentence"].first()) + ".",
        how="How much worse the best fit becomes when one factor is held away from its estimate and all others are "
        "fitted again; the 95 % interval is where the curve lies below the dotted line.",
        alternative="Curves of the profile likelihood.",
        height=290,
        draw=lambda: [_draw_profile(str(path), mine) for path, mine in curves],
    )


def _draw_profile(path: str, mine: pd.DataFrame) -> Panel:
    x, limit = mine["factor"].to_numpy(dtype=float), float(mine["limit"].iloc[0])
    curve: Trace = {"mode": "lines+markers", "line": {"color": category_colour(0), "width": 2}}
    traces = [
        make_line("limit", [x[0], x[-1]], [limit, limit], [], "", line={"color": MUTED, "width": 1, "dash": "dot"}),
        make_line("profile", x, mine["rise"].clip(upper=3 * limit), [], "", **curve),
    ]
    y = make_axis("worse by [variances]", nticks=6, rangemode="tozero")
    return make_plot(traces, make_axis(f"factor of {escape_name(path)} [1]", nticks=6), y)


def programme_table(content: IdentificationContent) -> PageTable:
    """The table of manoeuvres to run next."""
    frame = content.programme
    takeaway = f"Most information per hour about these parameters: {frame['manoeuvre'].iloc[0]}."
    shown = frame.assign(by=100 * (1 - frame["after"] / frame["before"]))
    return frame_table("programme", "Candidates", takeaway, shown, PROGRAMME_COLUMNS)


IDENTIFICATION_PAGE = {
    "what-is-known": Section(
        "What is known",
        {
            "estimates": (estimates_figure, "estimates"),
            "numbers": (estimates_table, "estimates"),
            "unseen": (unseen_table, "unseen"),
            "correlations": (correlations_figure, "estimates"),
        },
    ),
    "what-it-buys": Section(
        "What it buys",
        {
            "free-runs": (free_runs_figure, "series"),
            "errors": (free_run_errors, "errors"),
            "manoeuvres": (manoeuvres_before_and_after, "manoeuvres"),
        },
    ),
    "what-is-left": Section(
        "What is left over",
        {
            "residuals": (residuals_figure, "colours"),
            "profiles": (profiles_figure, "profiles"),
        },
    ),
    "next": Section("What to run next", {"programme": (programme_table, "programme")}),
}
write_identification = partial(write_page, "identification", IDENTIFICATION_PAGE)
