"""Methods side by side: their error by family and amount of data, and what each gains on one of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import pandas as pd

from shipid.report.content import DATA_DRIVEN, AnswerSentence, PageContent, ReportContent, model_text, rows_as_tuples
from shipid.report.figure import (
    INK,
    MARKERS,
    OKABE_ITO,
    Chip,
    Control,
    PageFigure,
    Panel,
    Trace,
    category_colour,
    error_bars,
    escape_name,
    log_axis,
    make_line,
    make_plot,
    names_axis,
    names_in,
    zero_axis,
)
from shipid.report.page import Section, write_page
from shipid.report.tables import PageTable, TableCell, frame_table, range_cell, with_cells, word_cell
from shipid.report.wording import counted_text, difference_text, ends_text, join_few_names, number_text, shorten_name
from shipid.units import plural_word

ALL_WITH_PHYSICS = "with physics"
METHOD_HEIGHT, METHODS_MARGIN = 34, 96  # heights of a method in a panel, and around them [px]
PERCENT = "%"
ALIKE_ERRORS = 1e-9  # relative: errors that differ by rounding
METHOD_COLUMNS = {
    "condition": "condition",
    "family": "family",
    "method": "method",
    "N_D [1]": "N_D",
    "at the horizon [m]": "H_end",
    "nine in ten below [m]": "H_end_90",
    "H [m]": "H",
    "H_90 [m]": "H_90",
    "core-seconds [s]": "seconds",
    "trials [1]": "trials",
    "no result": "without",
    "difference of H [%]": "difference",
    "95 % interval, runs [%]": "over_runs",
    "better runs": "better_runs",
    "by world [m]": "by_world",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class MethodsContent(PageContent):
    """The page of a study of several parts; `frames` has `methods`, as in the page of a study.

    worlds : sentences on errors over worlds, if the parts are worlds.
    """

    frames: Mapping[str, pd.DataFrame]
    worlds: Sequence[str] = ()

    @property
    def answer(self) -> list[AnswerSentence]:
        """Over worlds; then for each condition the method with the lowest H at the least and the largest N_D."""
        return [
            AnswerSentence(words, "methods") for words in (*self.worlds, *sentences_on_methods(self.frames["methods"]))
        ]


def sentences_on_methods(frame: pd.DataFrame) -> list[str]:
    """Which method errs least with physics, at the smallest and the largest N_D: a sentence for each condition."""
    sentences = []
    for condition in names_in(frame, "condition"):
        mine = frame[frame.condition.eq(condition) & frame.family.eq(ALL_WITH_PHYSICS)]
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
    best, alike = whole.iloc[0], whole.H.iloc[0] * (1 + ALIKE_ERRORS) >= whole.H
    tied, over = (
        [str(name) for name in whole.method[alike]],
        " in the mean over all foundations with physics" if first else "",
    )
    err = plural_word(len(tied), "errs", "err alike,")
    text = f"with N_D = {N_D} {join_few_names(tied)} {err} least{over}, {number_text(best.H_end)} m at the horizon, "
    text += f"H {number_text(best.H)} m"
    leads = best.reference in tied
    for row in rows_as_tuples(whole[~alike if leads else alike][:1]):
        if math.isfinite(row.low):
            its = f"{row.method} is next, its" if leads else plural_word(len(tied), "its", "their")
            words = difference_text(row.difference, row.low, row.high, PERCENT)
            text += f" ({its} difference of H to {row.reference} is {words})"
    failed = [f"{row.method} ({row.failed} of {row.cells})" for row in rows_as_tuples(mine[mine.failed.gt(0)])]
    text += f", without a result: {join_few_names(failed)}" if failed else ""
    partly = [str(row.method) for row in rows_as_tuples(mine[mine.missing.gt(mine.failed)])]
    return text + (f" (left out: {join_few_names(partly)}, not on every model)" if partly else "")


def methods_figure(content: ReportContent | MethodsContent) -> PageFigure:
    """H of every method by family, and its difference to the reference."""
    frame, reference = content.frames["methods"], content.frames["methods"].reference.iloc[0]
    conditions, amounts = names_in(frame, "condition"), sorted(int(value) for value in pd.unique(frame.N_D))
    families = [name for name in names_in(frame, "family") if name not in (ALL_WITH_PHYSICS, DATA_DRIVEN)]
    families += [DATA_DRIVEN] if frame.family.eq(DATA_DRIVEN).any() else []
    order, worlds = _order_of_methods(frame), max(int(frame.worlds.max()), 1)
    sizes = Control("Manoeuvres, N_D", amounts)
    return PageFigure(
        id="methods",
        title="Methods on the same cells",
        takeaway="".join(sentences_on_methods(frame)[:1]) or "No method has physics to improve.",
        how="Methods are in the order of their mean H with physics, or without where they have none. "
        "All methods of the study see the same windows, folds and known quantities. Left: H (15) of each family. "
        "Right: by how much "
        f"H is above that of {reference}, a geometric mean over the cells in which both have a result and over the "
        f"test runs of {counted_text(worlds, 'world')}, which count alike; Student's 95 % interval holds other test "
        "runs and other training runs; with fewer than five test runs there is none. An interval is for one "
        "comparison alone: of many, one in twenty excludes 0 by chance. A cell without a result is counted in the "
        "table, not averaged.",
        alternative="Dots of the position error of each method by family, and of the difference to one of them with "
        "intervals. The numbers are in the table below.",
        height=METHODS_MARGIN + METHOD_HEIGHT * len(order),
        draw=lambda *chosen: _draw_methods(
            frame[frame.condition.eq([*conditions, *chosen][-2]) & frame.N_D.eq(chosen[-1])], order, families
        ),
        controls=[Control("Condition", conditions), sizes] if len(conditions) > 1 else [sizes],
        chips=[
            Chip(f"family:{name}", model_text(name), str(look["color"]), "none", symbol=str(look["symbol"]))
            for name in families
            for look in [_family_marker(name, families)]
        ],
        captions=[
            "H, mean over the cells that have a result",
            f"difference of H to {reference}, 95 % interval",
        ],
    )


def _order_of_methods(frame: pd.DataFrame) -> list[str]:
    """Methods by falling mean H with physics (or without), the best last; those without any result first."""
    pure, physics = (
        frame[frame.family.eq(family)].groupby("method").H.mean() for family in (DATA_DRIVEN, ALL_WITH_PHYSICS)
    )
    means = physics.combine_first(pure).reindex(pd.unique(frame.method))
    return [str(name) for name in means.sort_values(ascending=False, kind="stable", na_position="first").index]


def _family_marker(family: str, families: Sequence[str]) -> dict[str, Any]:
    """Colour and marker of a family: ink without physics, as in every figure; further markers beyond the colours."""
    k = families.index(family)
    colour = INK if family == DATA_DRIVEN else category_colour(k)
    return {"color": colour, "symbol": MARKERS[k // len(OKABE_ITO)], "size": 8}


def _draw_methods(mine: pd.DataFrame, order: Sequence[str], families: Sequence[str]) -> list[Panel]:
    """Panels of the errors and of the differences: a row for each method, in it a little lower for each family."""
    errors, differences = [], []
    for k, family in enumerate(families):
        known = mine[mine.family.eq(family) & mine.H.notna()]
        paired = mine[mine.family.eq(family) & mine.difference.notna() & mine.method.ne(mine.reference)]
        shift = 0.14 * ((len(families) - 1) / 2 - k)
        prices = [f"{number_text(row.H)} m, {row.seconds:.1f} s" for row in rows_as_tuples(known)]
        errors.append(_dots_of_family(family, families, known, known.H, order, shift, prices))
        words = [difference_text(row.difference, row.low, row.high, PERCENT) for row in rows_as_tuples(paired)]
        dots = _dots_of_family(family, families, paired, paired.difference, order, shift, words)
        middle, low, high = (paired[column].to_numpy(dtype=float) for column in ("difference", "low", "high"))
        differences.append(dots | {"error_x": error_bars(middle, low, high, dots["marker"]["color"])})
    y = names_axis([shorten_name(name, 20) for name in order], range=[-0.6, len(order) - 0.4])
    return [
        make_plot(errors, log_axis("position error, H [m]"), y),
        make_plot(differences, zero_axis("difference of H [%]", INK), y),
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
    hover = [f"{model_text(family)}, {name}: {text}" for name, text in zip(rows.method, words, strict=True)]
    look: Trace = {"mode": "markers", "marker": _family_marker(family, families)}
    return make_line(model_text(family), values, y, [f"family:{family}"], hover=list(map(escape_name, hover)), **look)


def methods_table(content: ReportContent | MethodsContent) -> PageTable:
    """Every method by condition, family and N_D, with its price, its failures and its difference to the reference."""
    frame = content.frames["methods"]
    records = frame.to_dict("records")
    failed = [
        TableCell(f"{row['failed']} of {row['cells']}", float(row["failed"]), bool(row["failed"])) for row in records
    ]
    paired = {name: [_paired_cell(row, name) for row in records] for name in ("over_runs", "better_runs", "by_world")}
    shown = with_cells(frame.assign(family=frame.family.map(model_text)), without=failed, **paired)
    shown = shown.drop(columns="condition") if frame.condition.nunique() < 2 else shown
    own = frame.family.ne(ALL_WITH_PHYSICS) & (
        frame.seconds.notna() | frame.failed.gt(0)
    )  # those of others cost nothing
    counts = frame.loc[own, ["failed", "cells"]].sum()
    bad, every = int(counts["failed"]), counted_text(int(counts["cells"]), "cell")
    takeaway = "Core-seconds and errors are means over the cells of a row; differences are to "
    takeaway += f"{frame.reference.iloc[0]}. "
    takeaway += f"{bad} of {every} gave no result." if bad else f"All {every} gave a result."
    return frame_table("methods-table", "Every method", takeaway, shown, METHOD_COLUMNS)


def _paired_cell(row: Mapping[Any, Any], name: str) -> TableCell:
    """Interval over runs, count of better runs, or range over worlds of a difference; a dash where there is none."""
    known = row["method"] != row["reference"] and math.isfinite(row["difference"])
    if known and name == "over_runs":
        return range_cell(row["low"], row["high"])
    if known and name == "better_runs":
        return TableCell(f"{row['better']} of {row['runs']}", float(row["better"]))
    if known and name == "by_world" and row["worlds"] > 1:
        words = f"{ends_text(row['least'], row['greatest'])} in {row['worlds']}"
        over = f"; 95 % {ends_text(row['world_low'], row['world_high'])}" if math.isfinite(row["world_low"]) else ""
        return TableCell(words + over, float(row["least"]))
    return word_cell(None)


THE_METHODS = Section("Methods", {"methods": (methods_figure, "methods"), "methods-table": (methods_table, "methods")})
write_comparison = partial(write_page, "methods", {"the-methods": THE_METHODS})
