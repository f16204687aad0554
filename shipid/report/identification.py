"""The page of an identification: estimates with intervals, errors on runs held out, and residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
import pandas as pd

from shipid.report import tables
from shipid.report.content import Floats, PageContent, Sentence
from shipid.report.figure import Chip, Control, Figure, Panel, Plot, axis, label, layout, line, marks, silent
from shipid.report.motion import LOG, MOTIONS, panels
from shipid.report.page import page, write
from shipid.report.palette import INK, MUTED, category
from shipid.report.section import Section
from shipid.report.structures import group_table
from shipid.report.tables import Cell, Table, decimals, figure, text
from shipid.report.wording import bound, counted, listed, number, scientific
from shipid.units import interval_text

ROW, HEAD = 22, 74  # height of a parameter, and of what is around them [px]
WIDTH, SIDE = 18, 150  # of a cell of the heat map, and of what is around them [px]
MOST_NAMED = 16  # estimates whose names have room below the columns on a phone
FARTHEST = 4.0  # an interval may reach so many spans of the estimates beyond them before it is cut
BEFORE, AFTER = "before", "after"
INKS = {LOG: INK, BEFORE: category(1), AFTER: category(0)}
DASHES = {LOG: "solid", BEFORE: "dot", AFTER: "solid"}


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentificationContent(PageContent):
    """Everything the page shows.

    Parameters
    ----------
    title, name : the vessel in words, and a short name.
    estimates : `name`, `path`, `with`, `unit`, `base`, `value`, `error`, `factor`, `factor_low`, `factor_high`,
        `identified`, `reason`; infinite where nothing is known.
    correlations : (n, n) of the estimates, in their order.
    unseen, warnings : sentences.
    errors : `set` (`fit`, `test`), `run` (`all` at first), `model` (`before`, `after`), root mean squares `u`, `v`
        [m/s], `r` [rad/s], `position` [m].
    series : `run`, `piece`, `t` [s], `model` (`measured`, `before`, `after`), `north`, `east` [m], `psi` [rad],
        `u`, `v` [m/s], `r` [rad/s], of runs held out; of fitted ones where `held_out` is empty.
    held_out, ahead : runs, and length of a free run [s], 0 for whole runs.
    manoeuvres : `manoeuvre`, `measure`, `unit`, `before`, `after`, `note`.
    colours : `signal`, `lag` [s], `correlation` of the residuals.
    profiles : `path`, `factor`, `rise`, `limit`, `sentence`, a row for each point; without rows there is no figure.
    groups : errors by side, helm and speed. beyond : sentences on manoeuvres that go farther than the data.
    programme : `manoeuvre`, `hours`, `gain` [bit], `per_hour`, `narrows`, `before`, `after`; may be empty.
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
    profiles: pd.DataFrame = field(default_factory=pd.DataFrame)
    programme: pd.DataFrame = field(default_factory=pd.DataFrame)
    groups: pd.DataFrame = field(default_factory=pd.DataFrame)
    beyond: Sequence[str] = ()

    @property
    def answer(self) -> list[Sentence]:
        """Sentences: how many parameters are identified, errors on runs held out before and after, warnings."""
        known, count = int(self.estimates["identified"].sum()), len(self.estimates)
        sentences = [Sentence(f"{known} of {counted(count, 'parameter')} are identified by these runs.", "estimates")]
        sentences.append(Sentence(_bought(self), "free-runs"))
        return [*sentences, *(Sentence(f"Careful: {warning}.") for warning in self.warnings)]


def write_identification(content: IdentificationContent, file: Path) -> Path:
    """Write the page as one HTML file that makes no request; returns the file. Raises ResultError if it cannot."""
    return write(page(content, SECTIONS, "identification"), file)


def _bought(content: IdentificationContent) -> str:
    which = "test" if content.held_out else "fit"
    rows = content.errors[(content.errors["set"] == which) & (content.errors["run"] == "all")]
    rms = rows.set_index("model")[[*MOTIONS, "position"]].astype(float)
    runs = counted(len(content.held_out), "run") + " held out" if content.held_out else "the fitted runs"
    changes = [
        f"{name} from {number(factor * rms[name][BEFORE])} to {number(factor * rms[name][AFTER])} {unit}"
        for name, (_, unit, factor) in {**MOTIONS, "position": ("", "m", 1.0)}.items()
    ]
    return f"On {runs}, the root mean square error of a free run {_length(content)} goes in {listed(changes)}."


def _length(content: IdentificationContent) -> str:
    return f"of {content.ahead:g} s" if content.ahead else "over the whole run"


def estimates(content: IdentificationContent) -> Figure:
    """Estimates with 95 % intervals as factors on the base values; hollow where not identified."""
    frame = content.estimates
    low, high = _span(frame)
    traces = []
    for known in (True, False):
        mine = frame["identified"].to_numpy(dtype=bool) == known
        rows = np.flatnonzero(mine)
        ends = np.clip(frame.loc[mine, ["factor_low", "factor_high"]].to_numpy(dtype=float), low, high)
        x = np.column_stack([ends, np.full(len(rows), np.nan)]).ravel()
        y = np.repeat(rows, 3).astype(float)
        ink = category(0) if known else MUTED
        bar = line("interval", x, y, [_key(known)], line={"color": ink, "width": 2.5 if known else 1.2})
        bar = silent(bar)
        marker = {
            "symbol": "circle" if known else "circle-open",
            "color": ink,
            "size": 9,
            "line": {"color": ink, "width": 2},
        }
        dots = frame.loc[mine, "factor"].to_numpy(dtype=float)
        dot = line("estimate", dots, rows.astype(float), [_key(known)], mode="markers", marker=marker)
        dot["customdata"] = [_hover(row) for row in frame[mine].to_dict("records")]
        dot["hovertemplate"] = "%{customdata}<extra></extra>"
        traces += [bar, dot]
    base = line("base", [1.0, 1.0], [-0.7, len(frame) - 0.3], [], line={"color": INK, "width": 1, "dash": "dot"})
    base = silent(base)
    y_axis = axis("", tickvals=list(range(len(frame))), ticktext=list(map(label, frame["name"])), showgrid=False)
    y_axis["range"] = [len(frame) - 0.4, -0.6]
    x_axis = axis("factor on the base value [1]", nticks=9, range=[low, high])
    plot = layout(x_axis, y_axis, hovermode="closest", margin={"l": 8, "r": 12, "t": 4, "b": 44})
    cut = bool(((frame["factor_low"] < low) | (frame["factor_high"] > high)).any())
    vague = frame.loc[~frame["identified"].astype(bool), "name"].tolist()
    none = frame.loc[frame["base"] == 0, "name"].tolist()
    return Figure(
        id="estimates",
        title="The estimates",
        takeaway=f"Not identified: {listed(vague, 8)}." if vague else "Every parameter is identified.",
        how="Dot: estimate; bar: 95 % interval; dotted: the base value. Hollow: the runs alone, without priors, leave "
        "an interval wider than ±100 % of the base value, or the estimate is at a bound or was dropped."
        + (f" The base has 0 for {listed(none, 8)}: there factors are on the scale, which is dotted." if none else "")
        + (" Bars that reach an edge go on." if cut else ""),
        alternative="Estimates with intervals; the table below has the numbers.",
        height=ROW * len(frame) + HEAD,
        views={"": [Panel(Plot([base, *traces], plot))]},
        chips=[
            Chip(_key(True), "identified", category(0), symbol="circle"),
            Chip(_key(False), "not identified", MUTED, symbol="circle-open", width=1.2),
        ],
    )


def _key(known: bool) -> str:
    return "identified" if known else "vague"


def _span(frame: pd.DataFrame) -> tuple[float, float]:
    """Return the range of factors drawn: all estimates, and intervals as far as estimates stay distinguishable."""
    dots = np.append(frame["factor"].to_numpy(dtype=float), 1.0)
    reach = FARTHEST * max(float(np.ptp(dots)), 0.25)
    ends = frame[["factor_low", "factor_high"]].to_numpy(dtype=float)
    ends = ends[np.isfinite(ends)]
    low = max(float(min(ends.min(initial=1.0), dots.min())), float(dots.min()) - reach)
    high = min(float(max(ends.max(initial=1.0), dots.max())), float(dots.max()) + reach)
    room = 0.04 * (high - low)
    return low - room, high + room


def _hover(row: Mapping[Any, Any]) -> str:
    interval = interval_text(row["factor_low"], row["factor_high"])
    words = [f"<b>{label(str(row['path']))}</b> x {row['factor']:.4g}, 95 % {interval}"]
    return "<br>".join([*words, *wrap(label(str(row["reason"])), 70)])


def numbers(content: IdentificationContent) -> Table:
    """Return the table of all estimates in their units."""
    rows = [
        [
            text(row["path"] + (f" (with {row['with']})" if row["with"] else "")),
            text(row["unit"]),
            *(_short(row[name]) for name in ("base", "value", "error", "factor")),
            _interval(row["factor_low"], row["factor_high"]),
            Cell("yes" if row["identified"] else "no", "yes" if row["identified"] else "no", bad=not row["identified"]),
        ]
        for row in content.estimates.to_dict("records")
    ]
    head = ["parameter", "unit", "base", "estimate", "standard error", "factor", "factor, 95 %", "identified"]
    return Table("numbers", "Every estimate", "", head, [False, False, *[True] * 5, False], rows)


def _interval(low: float, high: float) -> Cell:
    if not np.isfinite(high - low):
        return Cell("none", tables.MISSING)
    return Cell(interval_text(low, high, " … ").replace("-", "−"), float(low))


def unseen(content: IdentificationContent) -> Table | None:
    """Return the table of what is not identified, and why; None if everything is."""
    rows = [[text(bound(f"{sentence[0].upper()}{sentence[1:]}"))] for sentence in content.unseen]
    takeaway = "Fix, tie or give priors to some of these, or run manoeuvres that separate them."
    return Table("unseen", "What is not identified", takeaway, ["why"], [False], rows) if rows else None


def _short(value: float) -> Cell:
    if not np.isfinite(value):
        return Cell("–", tables.MISSING)
    return Cell(scientific(value), float(value))


def correlations(content: IdentificationContent) -> Figure | None:
    """Correlations of the estimates; None for a single one."""
    names, matrix = list(map(label, content.estimates["name"])), np.asarray(content.correlations, dtype=float)
    if len(names) < 2:
        return None
    scale = [[0.0, "var(--category-0)"], [0.5, "var(--page)"], [1.0, "var(--category-1)"]]
    font = {"font": {"size": 13}}
    heat = marks(
        "heatmap",
        z=matrix.astype(np.float32), x=names, y=names, zmin=-1, zmax=1, colorscale=scale, xgap=1, ygap=1,
        colorbar={"thickness": 12, "dtick": 0.5, "title": {"text": "correlation [1]", "side": "right"} | font},
        hovertemplate="%{y} and %{x}: %{z:.2f}<extra></extra>",
    )  # fmt: skip
    apart = np.abs(matrix - np.eye(len(names)))
    i, j = np.unravel_index(int(np.argmax(apart)), matrix.shape)
    y_axis = axis("", showgrid=False, tickmode="array", tickvals=names, ticktext=names, autorange="reversed")
    many = len(names) > MOST_NAMED
    x_axis = axis("", showgrid=False, tickmode="array", tickvals=names, ticktext=names, tickangle=-90)
    x_axis |= {"showticklabels": not many}
    plot = layout(x_axis, y_axis, hovermode="closest", margin={"l": 8, "r": 8, "t": 8, "b": 8})
    return Figure(
        id="correlations",
        title="Correlated estimates",
        takeaway=f"Most correlated are {content.estimates['name'].iloc[i]} and {content.estimates['name'].iloc[j]}: "
        f"{number(float(matrix[i, j]))}.",
        how="Correlations of the errors of the estimates: near 1 or −1, a change of one is compensated by a change "
        "of the other, and only their combination is known."
        + (" Columns are in the order of the rows." if many else ""),
        alternative="Heat map of the correlations of all pairs of estimates.",
        height=WIDTH * len(names) + SIDE,
        views={"": [Panel(Plot([heat], plot))]},
    )


def free_runs(content: IdentificationContent) -> Figure:
    """Measured motion and free runs before and after, one run at a time."""
    runs = [str(run) for run in pd.unique(content.series["run"])]
    views = {str(i): _panels(content.series[content.series["run"] == run]) for i, run in enumerate(runs)}
    return Figure(
        id="free-runs",
        title="Free runs " + ("of runs held out" if content.held_out else "of the fitted runs"),
        takeaway=_bought(content),
        how=f"Each free run {_length(content)} begins at the measured state and goes by the commands alone, with no "
        "current, bias or other unknown of the run."
        + (" New pieces begin where lines are broken." if content.ahead else "")
        + " The map, north up with equal axes, shows what is measured and identified; the base may leave it.",
        alternative="Speeds, yaw rate and tracks, measured and predicted; the table below has the errors.",
        height=290,
        views=views,
        controls=[Control("Run", runs)],
        chips=[Chip(name, name, INKS[name], DASHES[name]) for name in INKS],
    )


def _panels(rows: pd.DataFrame) -> list[Panel]:
    return panels(rows, {name: {"color": INKS[name], "dash": DASHES[name]} for name in INKS}, (LOG, AFTER))


def errors(content: IdentificationContent) -> Table:
    """Root mean square errors of the free runs, run by run."""
    words, places = {"fit": "fitted", "test": "held out"}, decimals(content.errors["position"])
    factors = {name: factor for name, (_, _, factor) in MOTIONS.items()} | {"position": 1.0}
    rows = []
    for kind, run in _all_first(content.errors[["set", "run"]]):
        mine = content.errors[(content.errors["set"] == kind) & (content.errors["run"] == run)].set_index("model")
        cells = [
            figure(factor * mine[name][model], places if name == "position" else 3)
            for name, factor in factors.items()
            for model in (BEFORE, AFTER)
        ]
        rows.append([text(f"all {words[kind]}" if run == "all" else run), text(kind), *cells])
    heads = [f"{name} {model}" for name in factors for model in (BEFORE, AFTER)]
    title = f"Root mean square errors of free runs {_length(content)}"
    takeaway = "u, v in m/s, r in deg/s, position in m."
    return Table("errors", title, takeaway, ["run", "set", *heads], [False, False, *[True] * len(heads)], rows)


def _all_first(frame: pd.DataFrame) -> list[tuple[str, str]]:
    """Sets and runs: runs held out before fitted ones, and all of each before any of them."""
    pairs = list(dict.fromkeys((str(kind), str(run)) for kind, run in frame.itertuples(index=False)))
    return sorted(pairs, key=lambda pair: (pair[1] != "all", pair[0] != "test"))


def manoeuvres(content: IdentificationContent) -> Table | None:
    """Measures of standard manoeuvres before and after; None where there are none."""
    performed = content.manoeuvres[content.manoeuvres["measure"] != ""]
    if performed.empty:
        return None
    noted = bool(performed["note"].ne("").any())
    banded = "low" in content.manoeuvres
    rows = [
        [
            text(row["manoeuvre"]),
            text(row["measure"]),
            *(_short(row[name]) for name in (BEFORE, AFTER, *(("low", "high") if banded else ()))),
            text(row["unit"]),
            *[Cell(str(row["note"]), str(row["note"]), bad=bool(row["note"]))] * noted,
        ]
        for row in performed.to_dict("records")
    ]
    head = ["manoeuvre", "measure", BEFORE, AFTER, *["band from", "to"] * banded, "unit", *["why missing"] * noted]
    takeaway = "Simulated in calm deep water, from U_0 of the vessel or a Froude number of 0.2."
    takeaway += "".join(f" Extrapolated: {sentence}." for sentence in content.beyond)
    takeaway += " The band is what the uncertainty of the estimates leaves open." if banded else ""
    numeric = [False, False, True, True, *[True, True] * banded, False, *[False] * noted]
    return Table("manoeuvres", "Standard manoeuvres", takeaway, head, numeric, rows)


def residuals(content: IdentificationContent) -> Figure | None:
    """Autocorrelation of the residuals; None without any."""
    if content.colours.empty:
        return None
    names = [str(name) for name in pd.unique(content.colours["signal"])]
    parts = {name: content.colours[content.colours["signal"] == name] for name in names}
    traces = [
        line(
            name,
            mine["lag"].to_numpy(),
            mine["correlation"].to_numpy(),
            [name],
            "",
            line={"color": category(i), "width": 2},
        )
        for i, (name, mine) in enumerate(parts.items())
    ]
    least = min(-0.5, float(content.colours["correlation"].min()))
    y = axis("autocorrelation [1]", nticks=6, zeroline=True, zerolinecolor=INK, range=[least - 0.05, 1.05])
    first = {name: float(mine["correlation"].iloc[1]) if len(mine) > 1 else 0.0 for name, mine in parts.items()}
    correlated = [f"{name} {number(value)}" for name, value in first.items()]
    return Figure(
        id="residuals",
        title="Autocorrelation of the residuals",
        takeaway=f"The correlation of residuals one sample apart is {listed(correlated)}.",
        how="Autocorrelation of the weighted residuals, pooled over runs. White residuals drop to 0; a long "
        "tail shows effects that the model, or the data on wind and current, lack; standard errors then count runs.",
        alternative="Autocorrelation of the residuals of each signal over lag.",
        height=300,
        views={"": [Panel(Plot(traces, layout(axis("lag [s]", nticks=9), y, hovermode="closest")))]},
        chips=[Chip(name, name, category(i)) for i, name in enumerate(names)],
    )


def sides(content: IdentificationContent) -> Table | None:
    """Errors by side, helm and speed; None without rows."""
    runs = "Runs held out" if content.held_out else "Fitted runs"
    return group_table(content.groups, f"{runs}, over the horizon of the fit.")


def profiles(content: IdentificationContent) -> Figure | None:
    """Return the figure of the profile likelihoods; None if none was asked for."""
    if content.profiles.empty:
        return None
    panels, sentences = [], []
    for path, mine in content.profiles.groupby("path", sort=False):
        x, limit = mine["factor"].to_numpy(dtype=float), float(mine["limit"].iloc[0])
        y = np.minimum(mine["rise"].to_numpy(dtype=float), 3 * limit)
        curve = line("profile", x, y, [], "", mode="lines+markers", line={"color": category(0), "width": 2})
        end = line("limit", [x[0], x[-1]], [limit, limit], [], "", line={"color": MUTED, "width": 1, "dash": "dot"})
        axes = (
            axis(f"factor of {label(str(path))} [1]", nticks=6),
            axis("worse by [variances]", nticks=6, rangemode="tozero"),
        )
        panels.append(Panel(Plot([end, curve], layout(*axes, hovermode="closest"))))
        sentences.append(str(mine["sentence"].iloc[0]))
    return Figure(
        id="profiles",
        title="Profile likelihood",
        takeaway="; ".join(sentences) + ".",
        how="How much worse the best fit becomes when one factor is held away from its estimate and all others are "
        "fitted again; the 95 % interval is where the curve lies below the dotted line.",
        alternative="Curves of the profile likelihood.",
        height=290,
        views={"": panels},
    )


def programme(content: IdentificationContent) -> Table | None:
    """Return the table of manoeuvres to run next; None if it was not asked for."""
    if content.programme.empty:
        return None
    rows = [
        [
            text(row["manoeuvre"]),
            *(figure(row[name], 2) for name in ("hours", "gain", "per_hour")),
            text(row["narrows"]),
            figure(100 * (1 - row["after"] / row["before"]), 0),
        ]
        for row in content.programme.to_dict("records")
    ]
    head = ["manoeuvre", "time [h]", "gain [bit]", "gain [bit/h]", "narrows most", "by [%]"]
    best = content.programme.iloc[0]
    takeaway = f"Most information per hour about these parameters: {best['manoeuvre']}."
    return Table("programme", "Candidates", takeaway, head, [False, True, True, True, False, True], rows)


SECTIONS: dict[str, Section] = {
    "what-is-known": Section(
        "What is known",
        lambda content: (estimates(content), numbers(content), unseen(content), correlations(content)),
        needs=("estimates",),
        anchors=("estimates", "numbers", "unseen", "correlations"),
    ),
    "what-it-buys": Section(
        "What it buys",
        lambda content: (free_runs(content), errors(content), manoeuvres(content)),
        needs=("series", "errors"),
        anchors=("free-runs", "errors", "manoeuvres"),
    ),
    "what-is-left": Section(
        "What is left over",
        lambda content: (sides(content), residuals(content), profiles(content)),
        anchors=("sides", "residuals", "profiles"),
    ),
    "next": Section(
        "What to run next", lambda content: (programme(content),), needs=("programme",), anchors=("programme",)
    ),
}
