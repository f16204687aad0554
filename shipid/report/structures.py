"""The page of a comparison of structures: errors on runs held out, and standard manoeuvres side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import Any

import pandas as pd

from shipid.report.content import PageContent, Sentence
from shipid.report.page import page, write
from shipid.report.section import Section
from shipid.report.tables import Cell, Table, decimals, figure, text
from shipid.report.wording import fixed, listed
from shipid.units import decimals_for

Row = Mapping[Any, Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class StructuresContent(PageContent):
    """Everything the page shows; the frames are those of `shipid.study.structures.Compared`."""

    sentences: Sequence[str]
    table: pd.DataFrame
    errors: pd.DataFrame
    manoeuvres: pd.DataFrame
    spread: pd.DataFrame
    groups: pd.DataFrame
    chosen: str
    cautions: Mapping[str, str]
    ahead: float
    level: float | None

    @property
    def answer(self) -> list[Sentence]:
        """The structure chosen, and the sentences on it."""
        return [
            Sentence(f"{sentence[0].upper()}{sentence[1:]}.", "structures" if number == 0 else "")
            for number, sentence in enumerate(self.sentences)
        ]


def write_structures(content: StructuresContent, file: Path) -> Path:
    """Write the page as one HTML file that makes no request; returns the file. Raises ResultError if it cannot."""
    return write(page(content, SECTIONS, "structures"), file)


def structures(content: StructuresContent) -> Table:
    """Mean errors on runs that the fit has not seen, best first, with paired intervals."""
    places = decimals(content.table[["position", "test"]])
    rows = [
        [
            text(row["structure"]),
            figure(row["numbers"], 0),
            figure(row["u"], 3),
            figure(row["v"], 3),
            figure(degrees(row["r"]), 3),
            figure(row["position"], places),
            figure(row["more"], places),
            _between(row["low"], row["high"], places),
            figure(row["test"], places),
            Cell("yes" if row["equal"] else "no", "yes" if row["equal"] else "no"),
            text(row["note"]),
        ]
        for row in content.table.to_dict("records")
    ]
    head = ["structure", "numbers", "u [m/s]", "v [m/s]", "r [deg/s]", "position [m]", "above the least [m]"]
    head += ["95 % interval [m]", "test runs [m]", "not worse", "why missing"]
    length = f"of {content.ahead:g} s" if content.ahead else "as long as the runs"
    takeaway = "Means over runs of root mean square errors; intervals of differences are paired over runs."
    numeric = [False, *[True] * 8, False, False]
    return Table("structures", f"Free runs {length}, of runs that the fit has not seen", takeaway, head, numeric, rows)


def _between(low: float, high: float, places: int) -> Cell:
    if low != low or high != high:
        return figure(float("nan"), 0)
    return Cell(f"{figure(low, places).text} … {figure(high, places).text}", float(low))


def runs(content: StructuresContent) -> Table:
    """Error of the position, run by run."""
    known = [row for row in content.errors.to_dict("records") if row["run"] != "all"]
    named = {row["structure"] for row in known}
    names = [str(name) for name in content.table["structure"] if name in named]
    by_run = {(row["set"], row["run"], row["structure"]): row["position"] for row in known}
    places = decimals(content.errors["position"])
    rows = [
        [
            text(run),
            text("test" if of == "test" else "held out"),
            *(figure(by_run.get((of, run, name)), places) for name in names),
        ]
        for of, run in dict.fromkeys((row["set"], row["run"]) for row in known)
    ]
    head = ["run", "set", *(f"{name} [m]" for name in names)]
    title = "Position, run by run"
    return Table("runs", title, "Root mean square errors.", head, [False, False, *[True] * len(names)], rows)


def manoeuvres(content: StructuresContent) -> Table:
    """Measures of standard manoeuvres by structure, the spread between structures beside the interval within one."""
    known: list[Row] = [row for row in content.manoeuvres.to_dict("records") if row["measure"]]
    named = {row["structure"] for row in known}
    names = [str(name) for name in content.table["structure"] if name in named]
    wide = {(row["manoeuvre"], row["measure"]): row for row in content.spread.to_dict("records")}
    rows = []
    for place in dict.fromkeys((row["manoeuvre"], row["measure"]) for row in known):
        by = {row["structure"]: row for row in known if (row["manoeuvre"], row["measure"]) == place}
        cells = [_valued(by[name]) if name in by else text(None) for name in names]
        two = [figure(wide[place][name], 3) if place in wide else text(None) for name in ("spread", "width")]
        rows.append([*map(text, place), *cells, *two, text(next(iter(by.values()))["unit"])])
    head = ["manoeuvre", "measure", *names, "between structures", "within one", "unit"]
    takeaway = "" if content.level is None else f"With {100 * content.level:g} % intervals. "
    takeaway += "Between: range over the structures not shown to be worse; "
    takeaway += "within: the widest interval of one of them."
    alike: dict[str, list[str]] = {}
    for name, why in content.cautions.items():
        alike.setdefault(why, []).append(name)
    cautions = [f"{listed(which, len(which))}: {why}" for why, which in alike.items() if why]
    if cautions:
        takeaway += f" Intervals may be too narrow. {'; '.join(cautions)}."
    numeric = [False, False, *[True] * (len(names) + 2), False]
    return Table("manoeuvres", "Standard manoeuvres in calm deep water", takeaway, head, numeric, rows)


def _valued(row: Row) -> Cell:
    value, low, high = (float(row[name]) for name in ("value", "low", "high"))
    if value != value:
        return text(None)
    places = decimals_for(value, 4)
    shown = fixed(value, places)
    if low == low and high == high:
        shown += f" ({fixed(low, places)} … {fixed(high, places)})"
    return Cell(shown, value)


def groups(content: StructuresContent) -> Table | None:
    """Errors of the chosen structure by side, helm and speed; None without rows."""
    return group_table(content.groups, f"{content.chosen}, on runs that the fit has not seen.")


def group_table(frame: pd.DataFrame, takeaway: str) -> Table | None:
    """Errors by side, helm and speed, the frame of `shipid.identification.sides.by_group`; None without rows."""
    if frame.empty:
        return None
    rows = [
        [
            text(row["group"]),
            text(row["side"]),
            figure(row["rows"], 0),
            figure(row["u"], 3),
            figure(row["v"], 3),
            figure(degrees(row["r"]), 3),
            figure(100 * row["turning"], 1),
            figure(100 * row["error"], 1),
        ]
        for row in frame.to_dict("records")
    ]
    head = ["group", "turning to", "rows", "u [m/s]", "v [m/s]", "r [deg/s]", "turning [%]", "standard error"]
    more = " Turning: predicted change of heading over the measured one, less 1."
    return Table("sides", "Errors by side, helm and speed", takeaway + more, head, [False, False, *[True] * 6], rows)


SECTIONS: dict[str, Section] = {
    "structures": Section(
        "Which structure",
        lambda content: (structures(content), runs(content)),
        needs=("table", "errors"),
        anchors=("structures", "runs"),
    ),
    "manoeuvres": Section(
        "What each says of standard manoeuvres",
        lambda content: (manoeuvres(content),),
        needs=("manoeuvres",),
        anchors=("manoeuvres",),
    ),
    "sides": Section("Where it is wrong", lambda content: (groups(content),), needs=("groups",), anchors=("sides",)),
}
"""Sections of the page in order."""
