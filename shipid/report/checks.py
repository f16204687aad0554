"""The checks of a log as one page: what failed and why, the tracks, and run by run what the checks compare."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.report import logs, tables
from shipid.report.content import PageContent, Sentence
from shipid.report.figure import Chip, Control, Figure, Panel, Plot, axis, layout, line
from shipid.report.page import page, write
from shipid.report.palette import category
from shipid.report.section import Section
from shipid.report.tables import Cell, Table
from shipid.report.wording import bound, counted, listed, scientific, short

POINTS = 600  # of one line: more than pixels are wide
HEADING, RATE = 0, 1  # colours


@dataclass(frozen=True, eq=False, kw_only=True)
class CheckContent(PageContent):
    """Everything the page of a checked log shows.

    Parameters
    ----------
    name : short name of the log.
    checks : check, run, value, unit, limit, ok, sentence.
    series : run, t [s], r and psi_rate [rad/s], drift [m], u, v [m/s].
    tracks : run, set, north, east [m].
    repairs : kind, column, count, note; may be empty.
    provenance : label -> value.
    """

    checks: pd.DataFrame
    series: pd.DataFrame
    tracks: pd.DataFrame
    repairs: pd.DataFrame
    title: str = "Is this log in order?"

    @property
    def answer(self) -> list[Sentence]:
        """How many checks passed, and which failed."""
        return _answer(self.checks)


def write_checks(content: CheckContent, file: Path) -> Path:
    """Write the page as one HTML file that makes no request; returns the file. Raises ResultError if it cannot."""
    return write(page(content, SECTIONS, "data check"), file)


def _answer(checks: pd.DataFrame) -> list[Sentence]:
    failed = checks[~checks["ok"].astype(bool)]
    runs = counted(checks["run"].nunique(), "run")
    if failed.empty:
        return [Sentence(f"All {counted(len(checks), 'check')} of {runs} passed.")]
    kinds = [str(kind) for kind in pd.unique(failed["check"])]
    return [
        Sentence(f"{len(failed)} of {counted(len(checks), 'check')} failed, in {failed['run'].nunique()} of {runs}."),
        Sentence(f"What failed: {listed(kinds, 8)}."),
    ]


def _table(checks: pd.DataFrame) -> Table:
    """Return the table of all checks, failed ones first; what these say is shown whole."""
    ordered = checks.assign(ok=checks["ok"].astype(bool)).sort_values("ok", kind="stable")
    rows = [
        [
            tables.text(row.run),
            tables.text(row.check),
            Cell("passed", "passed") if row.ok else Cell("failed", "failed", bad=True),
            Cell(_amount(float(str(row.value)), str(row.unit)), float(str(row.value))),
            Cell(scientific(float(str(row.limit)), 3), float(str(row.limit))),
            replace(tables.text(bound(str(row.sentence))), bad=not row.ok),
        ]
        for row in ordered.itertuples()
    ]
    headings = ["run", "check", "result", "value", "limit", "what it says"]
    return Table("all-checks", "Every check", "", headings, [False, False, False, True, True, False], rows)


def _amount(value: float, unit: str) -> str:
    """Three digits and the unit, which a share or a ratio does not have."""
    return scientific(value, 3) + (f" {unit}" if unit != "1" else "")


def motion(series: pd.DataFrame) -> Figure | None:
    """Rate of the heading and yaw rate, drift of the position, and velocities, over time, one run at a time."""
    runs = [str(run) for run in pd.unique(series["run"])]
    if not runs:
        return None
    views = {str(index): _panels(series[series["run"] == run]) for index, run in enumerate(runs)}
    worst = series.groupby("run")["drift"].max()
    return Figure(
        id="motion-figure",
        title="Heading, yaw rate, position and velocity",
        takeaway=f"Positions leave integrated velocities furthest in {worst.idxmax()}: {short(float(worst.max()))} m.",
        how="Rate of the heading by central differences; distance between the position and integrated u, v, psi, which "
        "start together every 30 s.",
        alternative="Lines over time; the table below has the results of the checks.",
        height=240,
        views=views,
        controls=[Control("Run", runs, runs.index(str(worst.idxmax())))],
        chips=[
            Chip("psi", "rate of the heading", category(HEADING)),
            Chip("r", "yaw rate r", category(RATE)),
            Chip("drift", "position off integrated velocities", category(2)),
            Chip("u", "u", category(3)),
            Chip("v", "v", category(4)),
        ],
    )


def _panels(rows: pd.DataFrame) -> list[Panel]:
    thin = rows.iloc[np.unique(np.linspace(0, len(rows) - 1, min(POINTS, len(rows))).astype(int))]
    t = thin["t"].to_numpy() - float(rows["t"].iloc[0])  # single precision would not do for a clock since 1970
    degrees = {name: np.degrees(thin[name].to_numpy()) for name in ("psi_rate", "r")}
    rates = [
        line(
            "rate of the heading",
            t,
            degrees["psi_rate"],
            ["psi"],
            "deg/s",
            line={"color": category(HEADING), "width": 1},
        ),
        line("yaw rate r", t, degrees["r"], ["r"], "deg/s", line={"color": category(RATE), "width": 1.5}),
    ]
    drift = [line("drift", t, thin["drift"].to_numpy(), ["drift"], line={"color": category(2), "width": 1.5})]
    speeds = [
        line(name, t, thin[name].to_numpy(), [name], "m/s", line={"color": category(colour), "width": 1.5})
        for name, colour in (("u", 3), ("v", 4))
    ]
    shown = (("rate [deg/s]", rates), ("distance [m]", drift), ("velocity [m/s]", speeds))
    return [Panel(Plot(traces, layout(axis("time in the run [s]"), axis(title)))) for title, traces in shown]


SECTIONS: dict[str, Section] = {
    "motion": Section(
        "What the checks compare", lambda content: (motion(content.series),), ("series",), ("motion-figure",)
    ),
    "checks": Section("The checks", lambda content: (_table(content.checks),), ("checks",), ("all-checks",)),
    "data": Section(
        "The data",
        lambda content: (logs.manoeuvres(content), tables.repairs(content)),
        anchors=("manoeuvres", "repairs"),
    ),
}
