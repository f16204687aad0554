"""Methods side by side: their error by family and amount of data, and what each gains on one of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd
import plotly.graph_objects as go

from shipid.report.content import DATA_DRIVEN, PageContent, ReportContent, Sentence, rows_in, spoken
from shipid.report.figure import (
    INK,
    OKABE_ITO,
    SYMBOLS,
    Chip,
    Control,
    Figure,
    Trace,
    category,
    escaped,
    intervals,
    line,
    log_axis,
    names_axis,
    plot,
    run_names,
    zero_axis,
)
from shipid.report.section import Section
from shipid.report.tables import Cell, Column, Table, frame_table, with_cells, word_cell
from shipid.report.wording import counted, difference_text, ends, listed, number, shortened
from shipid.units import plural_word

EVERY = "with physics"
STEPS = (  # greatest by least error below which an axis has these ticks in a decade: two at least are within it
    (2.5, (1, 1.2, 1.4, 1.6, 1.8, 2, 2.5, 3, 3.5, 4, 5, 6, 7, 8, 9)),
    (6.0, (1, 1.5, 2, 3, 4, 6, 8)),
    (100.0, (1, 2, 5)),
)
ROW, AROUND = 34, 96  # heights of a method in a panel, and around them [px]
ALIKE = 1e-9  # relative: errors that differ by rounding
LONGEST = 20  # characters of a name at the axis: half of a narrow window
METHODS = {
    "condition": Column("condition"),
    "family": Column("family"),
    "method": Column("method"),
    "N_D [1]": Column("N_D", 0),
    "H [m]": Column("H", "length"),
    "H_90 [m]": Column("H_90", "length"),
    "end [m]": Column("end", "length"),
    "core-seconds [s]": Column("seconds", 1),
    "trials [1]": Column("trials", 0),
    "no result": Column("without", numeric=True),
    "difference of H [m]": Column("difference", "length"),
    "95 % interval, runs [m]": Column("over_runs", numeric=True),
    "better runs": Column("better_runs", numeric=True),
    "by world [m]": Column("by_world", numeric=True),
}


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
    for condition in run_names(frame, "condition"):
        mine = frame[frame.condition.eq(condition) & frame.family.eq(EVERY)]
        ends = sorted({int(mine.N_D.min()), int(mine.N_D.max())}) if len(mine) else []
        if ends:
            text = "; ".join(_verdict_at_size(mine[mine.N_D.eq(N_D)], N_D, first=ends[0] == N_D) for N_D in ends)
            sentences.append(f"{condition}: {text}." if condition else f"{text}.")
    return [sentence[0].upper() + sentence[1:] for sentence in sentences]


def _verdict_at_size(mine: pd.DataFrame, N_D: int, *, first: bool) -> str:
    """The best method at an amount of data, of those that have every cell; only the first says over what."""
    whole = mine[mine.missing.eq(0)].sort_values("H", kind="stable")
    if whole.empty:
        return f"with N_D = {N_D} no method has a result in every cell with physics"
    best, alike = whole.iloc[0], whole.H.iloc[0] * (1 + ALIKE) >= whole.H
    tied, over = [str(name) for name in whole.method[alike]], " over all cells with physics" if first else ""
    err = plural_word(len(tied), "errs", "err alike,")
    text = f"with N_D = {N_D} {listed(tied)} {err} least{over}, {number(best.H)} m"
    leads = best.reference in tied
    for row in rows_in(whole[~alike if leads else alike][:1]):
        if math.isfinite(row.low):
            its = f"{row.method} is next, its" if leads else plural_word(len(tied), "its", "their")
            text += f" ({its} difference to {row.reference} is {difference_text(row.difference, row.low, row.high)})"
    partial = set(mine.method[mine.missing.gt(0)])
    if ahead := [name for name in best.ahead.split(", ") if name in partial]:
        text += f", but over the cells that both have {listed(ahead)} {plural_word(len(ahead), 'errs', 'err')} less"
    failed = [f"{row.method} ({row.failed} of {row.cells})" for row in rows_in(mine[mine.failed.gt(0)])]
    text += f", without a result: {listed(failed)}" if failed else ""
    partly = [str(row.method) for row in rows_in(mine[mine.missing.gt(mine.failed)])]
    return text + (f" (left out: {listed(partly)}, not on every model)" if partly else "")


def methods(content: ReportContent | MethodsContent) -> Figure:
    """H of every method by family, and its difference to the reference."""
    frame, reference = content.frames["methods"], content.frames["methods"].reference.iloc[0]
    conditions, amounts = run_names(frame, "condition"), sorted(int(value) for value in pd.unique(frame.N_D))
    families = [name for name in run_names(frame, "family") if name not in (EVERY, DATA_DRIVEN)]
    families += [DATA_DRIVEN] if frame.family.eq(DATA_DRIVEN).any() else []
    order, worlds = _order_of_methods(frame), max(int(frame.worlds.max()), 1)
    sizes = Control("Manoeuvres, N_D", amounts)
    return Figure(
        id="methods",
        title="Methods on the same cells",
        takeaway="".join(verdicts(frame)[:1]) or "No method has physics to improve.",
        how="Methods are in the order of their mean H with physics, or without where they have none. "
        "All methods see the same windows, folds and known quantities. Left: H (15) of each family. Right: H less "
        f"that of {reference} over the cells in which both have a result, mean over members, seeds and "
        f"{counted(worlds, 'world')}; the 95 % interval comes from a bootstrap over test runs, each drawn with "
        "all its windows and cells, or Student's where that is wider, with what another training would give; with "
        "fewer than five runs there is none. An interval is for one comparison alone: of many, one in twenty excludes "
        "0 by chance. A cell without a result is counted in the table, not averaged.",
        alternative="Dots of the position error of each method by family, and of the difference to one of them with "
        "intervals. The numbers are in the table below.",
        height=AROUND + ROW * len(order),
        draw=lambda *chosen: _draw_methods(
            frame[frame.condition.eq([*conditions, *chosen][-2]) & frame.N_D.eq(chosen[-1])], order, families
        ),
        controls=[Control("Condition", conditions), sizes] if len(conditions) > 1 else [sizes],
        chips=[
            Chip(f"family:{name}", spoken(name), str(look["color"]), "none", symbol=str(look["symbol"]))
            for name in families
            for look in [_family_marker(name, families)]
        ],
        captions=[
            "H, mean over the cells that have a result",
            f"difference of H to {reference}, 95 % interval over test runs",
        ],
    )


def _order_of_methods(frame: pd.DataFrame) -> list[str]:
    """Methods by falling mean H, so that the best is at the top; those without any result first.

    The mean is that with physics, or without where a method has none.
    """
    pure, physics = (frame[frame.family.eq(family)].groupby("method").H.mean() for family in (DATA_DRIVEN, EVERY))
    means = physics.combine_first(pure).reindex(pd.unique(frame.method))
    return [str(name) for name in means.sort_values(ascending=False, kind="stable", na_position="first").index]


def _family_marker(family: str, families: Sequence[str]) -> dict[str, Any]:
    """Colour and marker of a family: ink without physics, as in every figure; further markers beyond the colours."""
    k = families.index(family)
    return {"color": INK if family == DATA_DRIVEN else category(k), "symbol": SYMBOLS[k // len(OKABE_ITO)], "size": 8}


def _draw_methods(mine: pd.DataFrame, order: Sequence[str], families: Sequence[str]) -> list[go.Figure]:
    """Panels of the errors and of the differences: a row for each method, in it a little lower for each family."""
    errors, differences = [], []
    for k, family in enumerate(families):
        known = mine[mine.family.eq(family) & mine.H.notna()]
        paired = mine[mine.family.eq(family) & mine.difference.notna() & mine.method.ne(mine.reference)]
        shift = 0.14 * ((len(families) - 1) / 2 - k)
        prices = [f"{number(row.H)} m, {row.seconds:.1f} s" for row in rows_in(known)]
        errors.append(_dots_of_family(family, families, known, known.H, order, shift, prices))
        words = [difference_text(row.difference, row.low, row.high) for row in rows_in(paired)]
        dots = _dots_of_family(family, families, paired, paired.difference, order, shift, words)
        middle, low, high = (paired[column].to_numpy(dtype=float) for column in ("difference", "low", "high"))
        differences.append(dots | {"error_x": intervals(middle, low, high, dots["marker"]["color"])})
    positive = mine.H[mine.H > 0]
    span = float(positive.max() / positive.min()) if len(positive) else 1.0
    fine = next((steps for most, steps in STEPS if span < most), (1,))
    y = names_axis([shortened(name, LONGEST) for name in order], range=[-0.6, len(order) - 0.4])
    return [
        plot(errors, log_axis("position error, H [m]", fine), y),
        plot(differences, zero_axis("difference of H [m]", INK), y),
    ]


def _dots_of_family(
    family: str,
    families: Sequence[str],
    rows: pd.DataFrame,
    values: pd.Series[float],
    order: Sequence[str],
    shift: float,
    words: Sequence[str],
) -> Trace:
    y = [order.index(name) + shift for name in rows.method]
    hover = [f"{spoken(family)}, {name}: {text}" for name, text in zip(rows.method, words, strict=True)]
    look: Trace = {"mode": "markers", "marker": _family_marker(family, families)}
    return line(spoken(family), values, y, [f"family:{family}"], hover=list(map(escaped, hover)), **look)


def methods_table(content: ReportContent | MethodsContent) -> Table:
    """Every method by condition, family and N_D, with its price, its failures and its difference to the reference."""
    frame = content.frames["methods"]
    records = frame.to_dict("records")
    failed = [Cell(f"{row['failed']} of {row['cells']}", float(row["failed"]), bool(row["failed"])) for row in records]
    paired = {name: [_paired_cell(row, name) for row in records] for name in ("over_runs", "better_runs", "by_world")}
    shown = with_cells(frame.assign(family=frame.family.map(spoken)), without=failed, **paired)
    shown = shown.drop(columns="condition") if frame.condition.nunique() < 2 else shown
    counts = frame.loc[frame.family.ne(EVERY), ["failed", "cells"]].sum()
    bad, every = int(counts["failed"]), counted(int(counts["cells"]), "cell")
    takeaway = "Core-seconds and errors are means over the cells of a row; differences are to "
    takeaway += f"{frame.reference.iloc[0]}. "
    takeaway += f"{bad} of {every} gave no result." if bad else f"All {every} gave a result."
    return frame_table("methods-table", "Every method", takeaway, shown, METHODS, like="H")


def _paired_cell(row: Mapping[Any, Any], name: str) -> Cell:
    """Interval over runs, count of better runs, or range over worlds of a difference; a dash where there is none."""
    known = row["method"] != row["reference"] and math.isfinite(row["difference"])
    if known and name == "over_runs" and math.isfinite(row["low"]):
        return Cell(ends(row["low"], row["high"]), float(row["low"]))
    if known and name == "better_runs":
        return Cell(f"{row['better']} of {row['runs']}", float(row["better"]))
    if known and name == "by_world" and row["worlds"] > 1:
        words = f"{ends(row['least'], row['greatest'])} in {row['worlds']}"
        over = f"; 95 % {ends(row['world_low'], row['world_high'])}" if math.isfinite(row["world_low"]) else ""
        return Cell(words + over, float(row["least"]))
    return word_cell(None)


THE_METHODS = Section(
    "Methods",
    draw=lambda content: (methods(content), methods_table(content)),
    needs=("methods",),
    anchors=("methods", "methods-table"),
)
