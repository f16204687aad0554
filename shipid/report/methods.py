"""Methods side by side: their error by family and amount of data, and what each gains on one of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from shipid.report.content import DATA_DRIVEN, PageContent, ReportContent, Sentence, spoken
from shipid.report.figure import Chip, Control, Figure, Panel, Plot, axis, label, layout, line, logarithmic
from shipid.report.palette import INK, OKABE_ITO, SYMBOLS, Style, category
from shipid.report.section import Section
from shipid.report.tables import Cell, Table, figure, length_places, text
from shipid.report.wording import counted, difference, ends, listed, number, shortened
from shipid.units import plural

EVERY = "with physics"
STEPS = (  # greatest by least error below which an axis has these ticks in a decade: two at least are within it
    (2.5, (1, 1.2, 1.4, 1.6, 1.8, 2, 2.5, 3, 3.5, 4, 5, 6, 7, 8, 9)),
    (6.0, (1, 1.5, 2, 3, 4, 6, 8)),
    (100.0, (1, 2, 5)),
)
ROW, MARGIN = 34, 96  # heights of a method in a panel, and around them [px]
ALIKE = 1e-9  # relative: errors that differ by rounding
LONGEST = 20  # characters of a name at the axis: half of a narrow window


@dataclass(frozen=True, eq=False, kw_only=True)
class MethodsContent(PageContent):
    """The page of a study of several parts.

    Parameters
    ----------
    title, name : the question, and the short name of the study.
    frames : `methods`, as in the page of a study.
    """

    frames: Mapping[str, pd.DataFrame]

    @property
    def answer(self) -> list[Sentence]:
        """A sentence for each condition: the method with the lowest H at the least and the largest amount of data."""
        return [Sentence(words, "methods") for words in verdicts(self.frames["methods"])]


def verdicts(frame: pd.DataFrame) -> list[str]:
    """Which method errs least with physics, at the smallest and the largest N_D: a sentence for each condition."""
    sentences = []
    for condition in _conditions(frame):
        mine = frame[frame.condition.eq(condition) & frame.family.eq(EVERY)]
        ends = sorted({int(mine.N_D.min()), int(mine.N_D.max())}) if len(mine) else []
        if ends:
            text = "; ".join(_verdict(mine[mine.N_D.eq(N_D)], N_D, first=ends[0] == N_D) for N_D in ends)
            sentences.append(f"{condition}: {text}." if condition else f"{text}.")
    return [sentence[0].upper() + sentence[1:] for sentence in sentences]


def _verdict(mine: pd.DataFrame, N_D: int, *, first: bool) -> str:
    """The best method at an amount of data, of those that have every cell; only the first says over what."""
    whole = mine[mine.missing.eq(0)].sort_values("H", kind="stable")
    if whole.empty:
        return f"with N_D = {N_D} no method has a result in every cell with physics"
    best, alike = whole.iloc[0], whole.H.iloc[0] * (1 + ALIKE) >= whole.H
    tied, over = [str(name) for name in whole.method[alike]], " over all cells with physics" if first else ""
    err = plural(len(tied), "errs", "err alike,")
    text = f"with N_D = {N_D} {listed(tied)} {err} least{over}, {number(best.H)} m"
    leads = best.reference in tied
    for row in whole[~alike if leads else alike][:1].itertuples():
        if math.isfinite(row.low):
            its = f"{row.method} is next, its" if leads else plural(len(tied), "its", "their")
            text += f" ({its} difference to {row.reference} is {difference(row.difference, row.low, row.high)})"
    partial = set(mine.method[mine.missing.gt(0)])
    if ahead := [name for name in best.ahead.split(", ") if name in partial]:
        text += f", but over the cells that both have {listed(ahead)} {plural(len(ahead), 'errs', 'err')} less"
    failed = [f"{row.method} ({row.failed} of {row.cells})" for row in mine[mine.failed.gt(0)].itertuples()]
    text += f", without a result: {listed(failed)}" if failed else ""
    partly = [str(row.method) for row in mine[mine.missing.gt(mine.failed)].itertuples()]
    return text + (f" (left out: {listed(partly)}, not on every model)" if partly else "")


def _frame(content: ReportContent | MethodsContent) -> pd.DataFrame:
    return content.frames.get("methods", pd.DataFrame())


def _conditions(frame: pd.DataFrame) -> list[str]:
    return [str(name) for name in pd.unique(frame.condition)]


def _families(frame: pd.DataFrame) -> list[str]:
    """Families in their order, without physics last; not the sum of them."""
    names = [str(name) for name in pd.unique(frame.family) if name not in (EVERY, DATA_DRIVEN)]
    return [*names, *([DATA_DRIVEN] if frame.family.eq(DATA_DRIVEN).any() else [])]


def methods(content: ReportContent | MethodsContent) -> Figure | None:
    """H of every method by family, and its difference to the reference; None where nothing is compared."""
    frame = _frame(content)
    if frame.empty:
        return None
    conditions, families = _conditions(frame), _families(frame)
    amounts = sorted(int(value) for value in pd.unique(frame.N_D))
    order = _order(frame)
    reference = str(frame.reference.iloc[0])
    controls = [Control("Condition", conditions)] if len(conditions) > 1 else []
    controls += [Control("Manoeuvres, N_D", [str(amount) for amount in amounts])]
    views = {}
    for (i, condition), (j, N_D) in itertools.product(enumerate(conditions), enumerate(amounts)):
        mine = frame[frame.condition.eq(condition) & frame.N_D.eq(N_D)]
        key = f"{i}-{j}" if len(conditions) > 1 else str(j)
        views[key] = [
            Panel(_errors(mine, order, families), "H, mean over the cells that have a result"),
            Panel(_differences(mine, order, families), f"difference of H to {reference}, 95 % interval over test runs"),
        ]
    worlds = int(frame.worlds.max())
    return Figure(
        id="methods",
        title="Methods on the same cells",
        takeaway="".join(verdicts(frame)[:1]) or "No method has physics to improve.",
        how="Methods are in the order of their mean H with physics, or without where they have none. "
        "All methods see the same windows, folds and known quantities. Left: H (15) of each family. Right: H less "
        f"that of {reference} over the cells in which both have a result, mean over members, seeds and "
        f"{counted(max(worlds, 1), 'world')}; the 95 % interval comes from a bootstrap over test runs, each drawn with "
        "all its windows and cells, or Student's where that is wider, with what another training would give; with "
        "fewer than five runs there is none. An interval is for one comparison alone: of many, one in twenty excludes "
        "0 by chance. A cell without a result is counted in the table, not averaged.",
        alternative="Dots of the position error of each method by family, and of the difference to one of them with "
        "intervals. The numbers are in the table below.",
        height=MARGIN + ROW * len(order),
        views=views,
        controls=controls,
        chips=[
            Chip(f"family:{name}", spoken(name), look.colour, "none", symbol=look.symbol)
            for name in families
            for look in [_look(name, families)]
        ],
    )


def _order(frame: pd.DataFrame) -> list[str]:
    """Methods by falling mean H, so that the best is at the top; those without any result first.

    The mean is that with physics, or without where a method has none.
    """
    means: dict[str, float] = {}
    for family in (DATA_DRIVEN, EVERY):
        mine = frame[frame.family.eq(family) & frame.H.notna()]
        means |= {str(name): float(H) for name, H in mine.groupby("method", sort=False).H.mean().items()}
    names = [str(name) for name in pd.unique(frame.method)]
    return sorted(names, key=lambda name: -means.get(name, math.inf))


def _look(family: str, families: Sequence[str]) -> Style:
    """Colour and marker of a family: ink without physics, as in every figure; further markers beyond the colours."""
    k = families.index(family)
    return Style(INK if family == DATA_DRIVEN else category(k), SYMBOLS[k // len(OKABE_ITO)], 0.0)


def _place(row: Mapping[Any, Any], order: Sequence[str], families: Sequence[str]) -> float:
    """Height of a point: the method, and a little for the family."""
    return order.index(row["method"]) + 0.14 * ((len(families) - 1) / 2 - families.index(row["family"]))


def _methods_axis(order: Sequence[str]) -> dict[str, Any]:
    ticks = {"tickvals": list(range(len(order))), "ticktext": [label(shortened(name, LONGEST)) for name in order]}
    return axis("", **ticks, range=[-0.6, len(order) - 0.4])


def _errors(mine: pd.DataFrame, order: Sequence[str], families: Sequence[str]) -> Plot:
    traces = []
    for family in families:
        look = _look(family, families)
        rows = mine[mine.family.eq(family) & mine.H.notna()].to_dict("records")
        y = [_place(row, order, families) for row in rows]
        trace = line(spoken(family), [row["H"] for row in rows], y, [f"family:{family}"], mode="markers",
                     marker={"color": look.colour, "symbol": look.symbol, "size": 8})  # fmt: skip
        trace.update(
            customdata=[f"{label(row['method'])}: {number(row['H'])} m, {row['seconds']:.1f} s" for row in rows]
        )
        trace.update(hovertemplate=f"{label(spoken(family))}, %{{customdata}}<extra></extra>")
        traces.append(trace)
    errors = mine.H[mine.H > 0]
    span = float(errors.max() / errors.min()) if len(errors) else 1.0
    fine = next((steps for most, steps in STEPS if span < most), (1,))
    x = logarithmic("position error, H [m]", fine)
    return Plot(traces, layout(x, _methods_axis(order), hovermode="closest"))


def _differences(mine: pd.DataFrame, order: Sequence[str], families: Sequence[str]) -> Plot:
    traces = []
    for family in families:
        look = _look(family, families)
        rows = mine[mine.family.eq(family) & mine.difference.notna() & mine.method.ne(mine.reference)].to_dict(
            "records"
        )
        y = [_place(row, order, families) for row in rows]
        middle = [float(row["difference"]) for row in rows]
        reach = {"type": "data", "symmetric": False, "color": look.colour, "thickness": 1.5, "width": 3}
        reaches = [(row["difference"], row["low"], row["high"]) for row in rows]
        reach |= {"array": [_finite(high - value) for value, _, high in reaches]}
        reach |= {"arrayminus": [_finite(value - low) for value, low, _ in reaches]}
        marker = {"color": look.colour, "symbol": look.symbol, "size": 6}
        trace = line(spoken(family), middle, y, [f"family:{family}"], mode="markers", marker=marker)
        trace.update(error_x=reach, customdata=[f"{label(row['method'])}: {_interval(row)}" for row in rows])
        trace.update(hovertemplate=f"{label(spoken(family))}, %{{customdata}}<extra></extra>")
        traces.append(trace)
    zero = {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": 0, "x1": 0, "line": {"color": INK, "width": 1}}
    shown = layout(axis("difference of H [m]"), _methods_axis(order), hovermode="closest", shapes=[zero])
    return Plot(traces, shown)


def _finite(value: float) -> float:
    return value if math.isfinite(value) else 0.0


def _interval(row: Mapping[Any, Any]) -> str:
    if math.isfinite(float(row["low"])):
        return difference(float(row["difference"]), float(row["low"]), float(row["high"]))
    return f"{number(float(row['difference']))} m, no interval from fewer than five runs"


def table(content: ReportContent | MethodsContent) -> Table | None:
    """Every method by condition, family and N_D, with its price, its failures and its difference to the reference."""
    frame = _frame(content)
    if frame.empty:
        return None
    several, places = len(_conditions(frame)) > 1, length_places(frame["H"])
    rows: list[list[Cell]] = []
    for row in frame.to_dict("records"):
        names = [text(spoken(row[name])) for name in (*(["condition"] if several else []), "family", "method")]
        failed = Cell(f"{row['failed']} of {row['cells']}", float(row["failed"]), bad=bool(row["failed"]))
        numbers = [figure(row["N_D"], 0), *(figure(row[name], places) for name in ("H", "H_90", "end"))]
        price = [figure(row["seconds"], 1), figure(row["trials"], 0), failed]
        rows.append([*names, *numbers, *price, figure(row["difference"], places), *_intervals(row)])
    headings = [*(["condition"] if several else []), "family", "method", "N_D [1]", "H [m]", "H_90 [m]", "end [m]"]
    headings += ["core-seconds [s]", "trials [1]", "no result", "difference of H [m]", "95 % interval, runs [m]"]
    headings += ["better runs", "by world [m]"]
    reference = str(frame.reference.iloc[0])
    counts = frame.loc[frame.family.ne(EVERY), ["failed", "cells"]].sum()
    bad, every = int(counts["failed"]), counted(int(counts["cells"]), "cell")
    takeaway = f"Core-seconds and errors are means over the cells of a row; differences are to {reference}. "
    takeaway += f"{bad} of {every} gave no result." if bad else f"All {every} gave a result."
    words = 3 if several else 2
    return Table("methods-table", "Every method", takeaway, headings, [False] * words + [True] * 11, rows)


def _intervals(row: Mapping[Any, Any]) -> list[Cell]:
    none = text(None)
    if row["method"] == row["reference"] or not math.isfinite(float(row["difference"])):
        return [none, none, none]
    over_runs = none
    if math.isfinite(float(row["low"])):
        over_runs = Cell(ends(row["low"], row["high"]), float(row["low"]))
    better = Cell(f"{row['better']} of {row['runs']}", float(row["better"]))
    by_world = none
    if row["worlds"] > 1:
        spread = f"{ends(row['least'], row['greatest'])} in {row['worlds']}"
        if math.isfinite(float(row["world_low"])):
            spread += f"; 95 % {ends(row['world_low'], row['world_high'])}"
        by_world = Cell(spread, float(row["least"]))
    return [over_runs, better, by_world]


SECTION = Section(
    "Methods",
    draw=lambda content: (methods(content), table(content)),
    needs=("methods",),
    anchors=("methods", "methods-table"),
)
