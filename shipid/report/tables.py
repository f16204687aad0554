"""Frames as tables of text: every number of the report can be read, searched and sorted."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from markupsafe import Markup, escape

from shipid.report.content import PUBLISHED, Floats, ReportContent, spoken
from shipid.report.selection import nothing_learns
from shipid.report.wording import CONSTANT, counted, fixed, listed, number


@dataclass(frozen=True)
class Cell:
    """Text of a table cell and the key it is sorted by; `bad` marks a cell without a result."""

    text: str
    key: float | str
    bad: bool = False


@dataclass(frozen=True)
class Table:
    """A table of the page; numeric columns are set flush right."""

    id: str
    title: str
    takeaway: str
    columns: Sequence[str]
    numeric: Sequence[bool]
    rows: Sequence[Sequence[Cell]]


LONG = 30  # characters that a column shows of a text


def cell_html(cell: Cell, numeric: bool, first: bool) -> Markup:
    """Write a cell as an element of HTML; its key is left out where page.js reads the same from the text.

    Of a long text the begin is shown. A long name is shown whole: names of models often differ at the end alone.
    """
    long = len(cell.text) > LONG
    name = long and (" + " in cell.text or max(map(len, cell.text.split()), default=0) > LONG)
    classes = " ".join(["words"] * (not numeric) + (["bad"] if cell.bad else ["name" if name else "long"] * long))
    read, key = cell.text.lower(), f"{cell.key:.6g}" if isinstance(cell.key, float | int) else cell.key
    given = {"scope": "row" if first else "", "class": classes, "data-key": "" if key == read else key}
    given["title"] = cell.text if long else ""
    attributes = "".join(f' {name}="{escape(value)}"' for name, value in given.items() if value)
    tag = "th" if first else "td"
    return Markup(f"<{tag}{attributes}>{escape(cell.text)}</{tag}>")  # all that is not ours is escaped


def text(value: object) -> Cell:
    """Make a cell of words; a missing value is a dash."""
    missing = value is None or value is pd.NA or (isinstance(value, float) and math.isnan(value))
    return Cell("–" if missing else str(value), "" if missing else str(value).lower())


def figure(value: object, decimals: int) -> Cell:
    """Make a cell with a number of fixed decimals, so that points align; NaN is a dash and sorts last."""
    amount = math.nan if value is None or value is pd.NA else float(str(value))
    if not math.isfinite(amount):
        return Cell("–", MISSING)
    return Cell(fixed(amount, decimals), amount)


def decimals(values: pd.DataFrame | pd.Series[float]) -> int:
    """Decimals, three at most, that leave three digits to the median of some values."""
    return _places(np.asarray(values, dtype=float), 3, 0, 3)


def length_places(lengths: pd.Series[float]) -> int:
    """Decimals of a column of lengths [m], from two to six, that leave two digits to the median."""
    return _places(pd.to_numeric(lengths, errors="coerce").to_numpy(dtype=float), 2, 2, 6)


def _places(values: Floats, digits: int, least: int, most: int) -> int:
    """Decimals, from least to most, that leave so many digits to the median; two where all are 0 or missing."""
    sizes = np.abs(values)
    sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
    return int(np.clip(digits - 1 - np.floor(np.log10(np.median(sizes))), least, most)) if len(sizes) else 2


MISSING = 1e300  # sorts after every number (page.js knows it)
# Column of the frame -> heading and, of numbers, the decimals.
CELLS = {
    "model": ("model", None),
    "A": ("A [m]", 2),
    "N_D": ("N_D [1]", 0),
    "minutes": ("data [min]", 1),
    "seed": ("seed", 0),
    "H": ("H [m]", 2),
    "H_90": ("H_90 [m]", 2),
    "rms": ("rms [m]", 2),
    "coverage": ("in band [1]", 2),
    "width": ("radius of band [m]", 2),
    "status": ("status", None),
    "seconds": ("time [s]", 0),
    "trials": ("trials [1]", 0),
    "stopped": ("stopped [1]", 0),
    "diverged": ("diverged [1]", 0),
    "hyperparameters": ("chosen", None),
}
MODELS = {
    "model": ("model", None),
    "family": ("family", None),
    "A": ("A [m]", 2),
    "A_90": ("A_90 [m]", 2),
    "A_rms": ("rms [m]", 2),
    "A_along": ("A along [m]", 2),
    "A_across": ("A across [m]", 2),
    "status": ("status", None),
    "description": ("what it is", None),
}
KINDS = {
    "kind": ("kind of run", None),
    "runs": ("test runs", None),
    "model": ("model", None),
    "how": ("how", None),
    "mean": ("over the horizon [m]", 2),
    "end": ("at its end [m]", 2),
}
HOW = {"naive": CONSTANT, "physics": "physics alone", "cooperative": "with data"}
REPAIRS = {
    "kind": ("repair", None),
    "column": ("column", None),
    "count": ("samples [1]", 0),
    "note": ("note", None),
}


def cells(content: ReportContent) -> Table:
    """Every cell of the study; a failed one shows its status in place of numbers."""
    frame = content.cells
    bad = int((frame.status.ne("ok") | frame.H.isna()).sum())
    takeaway = f"{counted(len(frame), 'cell')} in {duration(float(frame.seconds.sum()))} of computing; "
    takeaway += f"{counted(bad, 'cell')} gave no result." if bad else "all gave a result."
    return _table("cells", "Every cell", takeaway, _with_trials(frame, content.trials), CELLS)


def _with_trials(cells: pd.DataFrame, trials: pd.DataFrame) -> pd.DataFrame:
    """Cells with how many trials they had, and how many of them were stopped or diverged."""
    cells = cells.drop(columns="trials", errors="ignore")  # of a stored cell: the list of them
    if trials.empty:
        return cells
    states = pd.crosstab(trials.cell, trials.state).reindex(columns=["complete", "stopped", "diverged"], fill_value=0)
    states = states.assign(trials=trials.groupby("cell").size()).drop(columns="complete")
    return cells.merge(states, how="left", left_on="cell", right_index=True)


def kinds(content: ReportContent) -> Table | None:
    """Error over the horizon and at its end, by kind of test run; None without rows."""
    frame = content.frame("kinds")
    if frame.empty:
        return None
    pairs = zip(frame.source, frame.N_D, strict=True)
    how = [HOW[source] + (f", {counted(N_D, 'run')}" if N_D else "") for source, N_D in pairs]
    shown = frame.assign(how=how, model=frame.model.where(frame.source.ne("naive"), ""))
    of, source = ("of physics alone", "physics") if nothing_learns(content) else ("with data", "cooperative")
    learned = frame[frame.source.eq(source)]
    best = learned.loc[learned.groupby("kind", sort=False)["mean"].idxmin()] if len(learned) else learned
    parts = [
        f"{row['kind']}: {number(row['mean'])} m, at the end {number(row['end'])} m ({row['model']})"
        for row in best.to_dict("records")
    ]
    takeaway = f"Least error {of}: {'; '.join(parts)}." if parts else "No model with data has a result."
    return _table("kinds", "Errors by kind of run", takeaway, shown, KINDS)


def models(content: ReportContent) -> Table:
    """List the models, by rising A."""
    frame = content.models.sort_values("A", kind="stable", na_position="last")
    valid = frame.A.dropna()
    names = frame.model[frame.A.notna()]
    takeaway = "No physics model could be judged."
    if len(valid):
        takeaway = f"A of {names.iloc[0]} is {number(valid.iloc[0])} m."
    if len(valid) > 1:
        takeaway = f"A runs from {number(valid.iloc[0])} m ({names.iloc[0]}) to {number(valid.iloc[-1])} m "
        takeaway += f"({names.iloc[-1]})."
    return _table("models", "Every model", takeaway, frame, MODELS)


def repairs(content: ReportContent) -> Table | None:
    """Return the table of repairs by the importer; None if nothing is recorded."""
    frame = content.repairs
    if frame.empty:
        return None
    kinds = [str(kind) for kind in pd.unique(frame.kind)]
    takeaway = f"{counted(len(frame), 'repair')}: {listed(kinds)}."
    return _table("repairs", "What the importer repaired", takeaway, frame, REPAIRS)


def envelope(content: ReportContent) -> Table | None:
    """Smallest, mean and largest value of every input, a row per set; None without rows."""
    frame = content.envelope
    if frame.empty:
        return None
    units = dict(zip(frame["quantity"], frame["unit"], strict=True))
    sets = sorted((str(name) for name in pd.unique(frame["set"])), key=lambda name: name == PUBLISHED)
    rows = []
    for name in sets:
        mine = frame[frame["set"].eq(name)].set_index("quantity")
        rows.append([text(name), *(_range(mine, quantity) for quantity in units)])
    headings = ["set", *(f"{quantity} [{unit}]" for quantity, unit in units.items())]
    return Table("envelope-table", "Minimum / mean / maximum", "", headings, [False, *[True] * len(units)], rows)


def _range(mine: pd.DataFrame, quantity: str) -> Cell:
    if quantity not in mine.index:
        return text(None)
    values = [float(str(mine.loc[quantity, column])) for column in ("min", "mean", "max")]
    return Cell(" / ".join(number(value) for value in values), values[1])


def _table(
    id_: str, title: str, takeaway: str, frame: pd.DataFrame, columns: Mapping[str, tuple[str, int | None]]
) -> Table:
    headings = {name: heading for name, (heading, _) in columns.items() if name in frame.columns}
    places = {
        name: length_places(frame[name]) if heading.endswith("[m]") else columns[name][1]
        for name, heading in headings.items()
    }
    rows = []
    for record in frame.to_dict("records"):
        record["family"] = spoken(str(record.get("family")))
        row = [text(record[name]) if count is None else figure(record[name], count) for name, count in places.items()]
        if "status" in places and record["status"] != "ok":
            status = f"{record['status']}: {record['sentence']}" if record.get("sentence") else str(record["status"])
            row[list(places).index("status")] = Cell(status, status.lower(), bad=True)
        rows.append(row)
    return Table(id_, title, takeaway, [*headings.values()], [count is not None for count in places.values()], rows)


def duration(seconds: float) -> str:
    """Write a duration [s] as text in s, min or h."""
    return (
        f"{seconds:.0f} s"
        if seconds < 120
        else f"{seconds / 60:.0f} min"
        if seconds < 7200
        else f"{seconds / 3600:.1f} h"
    )
