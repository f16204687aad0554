"""The page of one standard manoeuvre: its measures, the track of the ship, and its motion over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.report.content import Floats, PageContent, Sentence
from shipid.report.figure import Chip, Figure, Panel, Plot, Trace, axis, layout, line, plane, silent
from shipid.report.page import page, write
from shipid.report.palette import GRID, MUTED, category
from shipid.report.section import Section
from shipid.report.tables import Cell, Table, figure, text
from shipid.report.wording import distance, number

POINTS = 2000  # a line needs no more
OUTLINES = 12  # ships drawn along the track
EXECUTE = "execute heading"  # the measure that is drawn beside the heading
TOGETHER = np.deg2rad(120)  # a heading that stays within this is drawn with the helm
ROUNDING = 1e-9  # deg, m/s, deg/s, rpm: what changes by less is constant, and an axis is no picture of its rounding
Values = Sequence[float] | Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class ManoeuvreContent(PageContent):
    """Everything the page shows.

    Parameters
    ----------
    title, name : the manoeuvre in words, and its kind.
    first : names of the measures that the answer says.
    log : `t` [s], `north`, `east` [m], `psi`, `helm` [rad], `u`, `v` [m/s], `r` [rad/s], `shaft` [rev/s].
    measures, criteria : rows from `shipid.measures.rows`.
    levels : `helm` [rad], `rate` [rad/s] of a spiral in the order performed; without rows there is no figure.
    outline : (k, 2) outline of the ship from above, body axes x ahead, y to starboard [m].
    """

    first: Sequence[str]
    log: pd.DataFrame
    measures: pd.DataFrame
    criteria: pd.DataFrame
    outline: Floats
    levels: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=["helm", "rate"]))

    @property
    def answer(self) -> list[Sentence]:
        """Return sentences: the main measures, and how many criteria are met."""
        known = self.measures[self.measures["measure"].isin(self.first)]
        measures = [f"{row.measure}: {_amount(float(str(row.value)), str(row.unit))}" for row in known.itertuples()]
        sentences = [Sentence("; ".join(measures).capitalize() + ".", "measures")]
        judged = self.criteria[self.criteria["verdict"] != "not judged"] if len(self.criteria) else self.criteria
        if len(judged):
            met = int((judged["verdict"] == "met").sum())
            notes = {str(note) for note in judged["note"]}
            common = f"; {notes.pop()}" if len(notes) == 1 and "" not in notes else ""
            words = f"{met} of {len(judged)} criteria of IMO MSC.137(76) are met{common}."
            sentences.append(Sentence(words, "criteria"))
        return sentences


def write_manoeuvre(content: ManoeuvreContent, file: Path) -> Path:
    """Write the page as one HTML file that makes no request; returns the file. Raises ResultError if it cannot."""
    return write(page(content, SECTIONS, "manoeuvre"), file)


def _amount(value: float, unit: str) -> str:
    return f"{number(round(value, 3) + 0.0)} {unit}" if np.isfinite(value) else "not reached"


def measures(content: ManoeuvreContent) -> Table:
    """Every measure; one that is missing says why."""
    missing = bool(content.measures["note"].ne("").any())
    rows = []
    for row in content.measures.to_dict("records"):
        numbers = [
            figure(row["value"], _decimals(row["value"], row["unit"])),
            text(row["unit"]),
            figure(row["lengths"], 2),
        ]
        note = [Cell(str(row["note"]), str(row["note"]), bad=bool(row["note"]))] if missing else []
        rows.append([text(row["measure"]), *numbers, *note])
    columns = ["measure", "value", "unit", "ship lengths", *["why missing"] * missing]
    return Table("measures", "Measures", "", columns, [False, True, False, True, *[False] * missing], rows)


def _decimals(value: float, unit: str) -> int:
    """Return the number of decimals for three digits: at most three; none for a count."""
    if not np.isfinite(value):
        return 2
    if unit == "-" and value == round(value):
        return 0
    return 2 if abs(value) < 1e-3 else int(np.clip(2 - np.floor(np.log10(abs(value))), 0, 3))


def criteria(content: ManoeuvreContent) -> Table | None:
    """Criteria of IMO MSC.137(76) that apply to this kind of manoeuvre; None without."""
    if content.criteria.empty:
        return None
    rows = []
    for row in content.criteria.to_dict("records"):
        verdict = str(row["verdict"])
        numbers = [figure(row["value"], 2), figure(row["limit"], 2), text(row["unit"])]
        rows.append(
            [text(row["criterion"]), *numbers, Cell(verdict, verdict, bad=verdict == "not met"), text(row["note"])]
        )
    columns = ["criterion", "value", "limit", "unit", "verdict", "note"]
    numeric = [False, True, True, False, False, False]
    return Table("criteria", "Criteria of IMO MSC.137(76)", "", columns, numeric, rows)


def track(content: ManoeuvreContent) -> Figure:
    """Path of the ship with its outline to scale, north up, equal axes."""
    log = _thinned(content.log)
    places = np.linspace(0, len(log) - 1, OUTLINES).astype(int)
    hulls = [_outline(content.outline, *log.iloc[i][["north", "east", "psi"]]) for i in places]
    gap = np.full((1, 2), np.nan)
    drawn = np.vstack([part for hull in hulls for part in (hull, gap)])
    ships = line("ship", drawn[:, 0], drawn[:, 1], ["ship"], line={"color": MUTED, "width": 1})
    ships = silent(ships)
    path = line(
        "track", log["east"].to_numpy(), log["north"].to_numpy(), ["track"], line={"color": category(0), "width": 2.5}
    )
    path["customdata"] = log["t"].to_numpy(dtype=np.float32)
    path["hovertemplate"] = "t = %{customdata:.1f} s<br>%{x:.1f} m east, %{y:.1f} m north<extra></extra>"
    spans = [(float(np.nanmin(column)), float(np.nanmax(column))) for column in drawn.T]
    bounds = [
        (min(low, float(log[name].min())), max(high, float(log[name].max())))
        for (low, high), name in zip(spans, ("east", "north"), strict=True)
    ]
    east, north = (distance(high - low) for low, high in bounds)
    return Figure(
        id="track",
        title="The track",
        takeaway=f"With her outline the ship takes {north} from south to north and {east} from west to east.",
        how="Path of the logged point, north up, equal axes; the outline of the ship is to scale, at even times.",
        alternative="Map of the track.",
        height=460,
        views={"": [Panel(Plot([ships, path], plane("east [m]", "north [m]", bounds)))]},
        chips=[Chip("track", "track", category(0), width=2.5), Chip("ship", "ship", MUTED, width=1)],
    )


def _outline(outline: Floats, north: float, east: float, psi: float) -> Floats:
    """Closed outline (k + 1, 2) as east, north [m]."""
    x, y = np.vstack([outline, outline[:1]]).T
    return np.column_stack([east + x * np.sin(psi) + y * np.cos(psi), north + x * np.cos(psi) - y * np.sin(psi)])


def histories(content: ManoeuvreContent) -> Figure:
    """Heading, helm, speeds, yaw rate and shaft over time."""
    log = _thinned(content.log)
    t = log["t"].to_numpy()
    psi, helm, r = (np.rad2deg(log[name].to_numpy()) for name in ("psi", "helm", "r"))
    off = psi - psi[0]
    lines = {
        "heading": line("heading", t, off, ["heading"], "deg", line=_ink(0)),
        "helm": line("helm", t, helm, ["helm"], "deg", line={**_ink(1), "shape": "hv"}),
        "u": line("ahead, u", t, log["u"].to_numpy(), ["u"], "m/s", line=_ink(0)),
        "v": line("to starboard, v", t, log["v"].to_numpy(), ["v"], "m/s", line=_ink(2)),
        "r": line("yaw rate, r", t, r, ["r"], "deg/s", line=_ink(3)),
        "shaft": line("shaft", t, 60 * log["shaft"].to_numpy(), ["shaft"], "rpm", line={**_ink(4), "shape": "hv"}),
    }
    if np.ptp(off) < np.rad2deg(TOGETHER):
        panels = [_panel("heading, helm [deg]", [lines["heading"], lines["helm"]], content)]
    else:
        panels = [_panel("heading [deg]", [lines["heading"]], content), _panel("helm [deg]", [lines["helm"]])]
    panels += [_panel("speed [m/s]", [lines["u"], lines["v"]]), _panel("yaw rate [deg/s]", [lines["r"]])]
    shown = [key for key in lines if key != "shaft"]
    if np.ptp(log["shaft"].to_numpy()) > 0:
        panels, shown = [*panels, _panel("shaft [rpm]", [lines["shaft"]])], list(lines)
    return Figure(
        id="histories",
        title="Over time",
        takeaway=f"Yaw rate from {number(float(r.min()))} to {number(float(r.max()))} deg/s, "
        f"speed ahead from {number(float(log['u'].max()))} down to {number(float(log['u'].min()))} m/s.",
        how="Heading counted from that at the start of the log; helm and shaft as ordered, helm above 0 turns the ship "
        "to starboard." + (" Dotted: the execute headings." if EXECUTE in set(content.measures["measure"]) else ""),
        alternative="Heading, helm, speeds and yaw rate over time.",
        height=270,
        views={"": panels},
        chips=[Chip(key, lines[key]["name"], lines[key]["line"]["color"]) for key in shown],
    )


def _ink(index: int) -> dict[str, object]:
    return {"color": category(index), "width": 2}


def _panel(title: str, traces: list[Trace], content: ManoeuvreContent | None = None) -> Panel:
    """One quantity over time; execute headings are drawn where they are measured."""
    heading = _value(content, EXECUTE) if content else float("nan")
    ends = [float(traces[0]["x"][0]), float(traces[0]["x"][-1])]
    marks = [
        line(
            f"{level:g} deg", ends, [level, level], ["heading"], "deg", line={"color": MUTED, "width": 1, "dash": "dot"}
        )
        for level in ((heading, -heading) if np.isfinite(heading) else ())
    ]
    y = axis(title, nticks=6, zeroline=True, zerolinecolor=GRID)
    drawn = np.concatenate([trace["y"] for trace in [*marks, *traces]])
    if len(drawn) and np.nanmax(drawn) - np.nanmin(drawn) < ROUNDING:
        y["range"] = [float(np.nanmin(drawn)) - 1, float(np.nanmax(drawn)) + 1]
    return Panel(Plot([*marks, *traces], layout(axis("time [s]", nticks=4), y, hovermode="closest")))


def _value(content: ManoeuvreContent, measure: str) -> float:
    values = content.measures.loc[content.measures["measure"] == measure, "value"]
    return float(values.iloc[0]) if len(values) else float("nan")


def spiral(content: ManoeuvreContent) -> Figure | None:
    """Steady yaw rate over helm; None where no level was held."""
    if content.levels.empty:
        return None
    helm, rate = (np.rad2deg(content.levels[name].to_numpy(dtype=float)) for name in ("helm", "rate"))
    marks = {"color": category(3), "size": 7}
    trace = line("yaw rate", helm, rate, [], "deg/s", mode="lines+markers", line=_ink(3), marker=marks)
    width = _value(content, "loop width")
    y = axis("yaw rate [deg/s]", nticks=8, zeroline=True, zerolinecolor=GRID)
    x = axis("helm [deg]", nticks=9, zeroline=True, zerolinecolor=GRID)
    return Figure(
        id="spiral",
        title="Yaw rate over helm",
        takeaway=f"The loop is {_amount(width, 'deg')} of helm wide.",
        how="One point for each level that became steady, joined in the order performed; > 0 is to starboard.",
        alternative="Steady yaw rate over helm angle.",
        height=420,
        views={"": [Panel(Plot([trace], layout(x, y, hovermode="closest")))]},
    )


def _thinned(log: pd.DataFrame) -> pd.DataFrame:
    return log.iloc[:: max(1, len(log) // POINTS)]


SECTIONS: dict[str, Section] = {
    "results": Section(
        "What was measured",
        lambda content: (measures(content), criteria(content)),
        anchors=("measures", "criteria"),
    ),
    "motion": Section(
        "What the ship did",
        lambda content: (track(content), histories(content), spiral(content)),
        needs=("log",),
        anchors=("track", "histories", "spiral"),
    ),
}
