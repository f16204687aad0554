"""How each model was degraded: every perturbed number as a dot at its factor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from shipid.report import tables
from shipid.report.content import DATA_DRIVEN, ReportContent
from shipid.report.figure import Chip, Figure, Panel, Plot, axis, label, layout, line
from shipid.report.palette import INK, MUTED, SYMBOLS, category
from shipid.report.section import Section
from shipid.report.selection import families
from shipid.report.wording import counted, listed, metres, number, shortened

ROW = 42  # height of a model [px]
LONGEST = 11  # characters of a name that fit beside its errors on a phone
TICKS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 5.0, 10.0, 20.0, 50.0, 100.0)


def factors(content: ReportContent) -> Figure | None:
    """Dot strips of the factors, a row per model by rising A; None without rows."""
    frame = content.factors[content.factors.factor.notna()]
    if frame.empty:
        return None
    names = [str(name) for name in families(content).model if name in set(frame.model)]
    bases = set(content.models.model[content.models.family.ne(DATA_DRIVEN)])  # further methods have their numbers
    untouched = [str(name) for name in families(content).model if name in bases and name not in names]
    groups = [str(name) for name in pd.unique(frame.group)]
    return Figure(
        id="factors",
        title="How the models were degraded",
        takeaway=_takeaway(frame, names),
        how="One dot per perturbed number, at its factor on the base model, logarithmic; rows by "
        "rising A, with the mean absolute error along and across the heading at the instant of prediction where known."
        + (" A factor that is not positive lies at the left edge: 0 removes the term." if _crosses(frame) else "")
        + (f" Not perturbed: {listed(untouched, 6)}." if untouched else ""),
        alternative=f"Dots at the factors of {counted(len(names), 'model')}; the table of models has A.",
        height=ROW * len(names) + 70,
        views={"": [Panel(_strips(content, frame, names, groups))]},
        chips=[
            Chip(f"group:{name}", name.replace("_", " "), category(i), "none", symbol=SYMBOLS[i % len(SYMBOLS)])
            for i, name in enumerate(groups)
        ],
    )


def _strips(content: ReportContent, frame: pd.DataFrame, names: list[str], groups: list[str]) -> Plot:
    (low, high), rows = _span(frame), {name: i for i, name in enumerate(names)}
    edge = low - 0.08 * (high - low)
    traces = []
    for i, group in enumerate(groups):
        mine = frame[frame.group.eq(group) & frame.model.isin(names)]
        # Each group is drawn a little below the one before, so that equal factors do not hide each other.
        y = mine.model.map(rows).to_numpy(dtype=float) + 0.24 * i / max(1, len(groups) - 1)
        x = np.array([math.log(factor) if factor > 0 else edge for factor in mine.factor])
        marker = {"symbol": SYMBOLS[i % len(SYMBOLS)], "size": 8, "color": category(i), "opacity": 0.75}
        trace = line(group, x, y, [f"group:{group}"], mode="markers", marker=marker)
        trace["customdata"] = [
            f"{label(str(model))}: {label(str(path))} × {factor:.3g}"
            for model, path, factor in zip(mine.model, mine.path, mine.factor, strict=True)
        ]
        trace["hovertemplate"] = "%{customdata}<extra></extra>"
        traces.append(trace)
    room = 0.03 * (high - low)
    span = [(edge if _crosses(frame) else low) - room, high + room]
    x_axis = axis("factor [1]", range=span, **_ticks(frame, low, high, edge))
    y_axis = axis("", range=[len(names) - 0.5, -0.85], showticklabels=False, showgrid=False)
    texts = [_row_text(content, name, row) for name, row in rows.items()]
    plot = layout(x_axis, y_axis, annotations=texts, hovermode="closest", margin={"l": 12, "r": 12, "t": 4, "b": 44})
    plot["shapes"] = [_rule(row, span) for row in rows.values()] + [
        {"type": "line", "yref": "paper", "x0": 0, "x1": 0, "y0": 0, "y1": 1, "layer": "below"}
        | {"line": {"color": INK, "width": 1}}
    ]
    return Plot(traces, plot)


def _rule(row: int, span: list[float]) -> dict[str, Any]:
    ink = {"color": MUTED, "width": 0.5}
    return {"type": "line", "x0": span[0], "x1": span[1], "y0": row, "y1": row, "layer": "below", "line": ink}


def _row_text(content: ReportContent, name: str, row: int) -> dict[str, Any]:
    """Name and accuracy of a row, written above its dots."""
    mine = content.models[content.models.model == name]
    short = shortened(name, LONGEST)
    words = f"<b>{label(short)}</b>"
    if len(mine):
        record = mine.iloc[0]
        words += (
            f"  A {metres(float(record.A))}" if math.isfinite(float(record.A)) else f"  {label(str(record.status))}"
        )
        split = [float(record.get(column, math.nan)) for column in ("A_along", "A_across")]
        if all(map(math.isfinite, split)):
            words += f": {number(split[0])} along, {number(split[1])} across"
    place = {"x": 0, "xref": "paper", "xanchor": "left", "y": row, "yshift": 17, "showarrow": False}
    return {**place, "text": words, "font": {"size": 12}, "bgcolor": "var(--page)", "borderpad": 0}


def _crosses(frame: pd.DataFrame) -> bool:
    """Whether some factor has no logarithm."""
    return bool((frame.factor <= 0).any())


def _span(frame: pd.DataFrame) -> tuple[float, float]:
    """Logarithms of the smallest and largest positive factor, at least a quarter down and up."""
    logs = np.log(frame.factor[frame.factor > 0].to_numpy(dtype=float))
    least = math.log(1.25)
    return min(float(logs.min(initial=0.0)), -least), max(float(logs.max(initial=0.0)), least)


def _ticks(frame: pd.DataFrame, low: float, high: float, edge: float) -> dict[str, list[Any]]:
    shown = [1.0]
    for tick in sorted(TICKS, key=lambda value: abs(math.log(value))):
        far = all(abs(math.log(tick / other)) > 0.08 * (high - low) for other in shown)
        if far and low - 0.02 <= math.log(tick) <= high + 0.02:
            shown.append(tick)
    named = [("0" if (frame.factor[frame.factor <= 0] == 0).all() else "≤ 0", edge)] if _crosses(frame) else []
    return {
        "tickvals": [place for _, place in named] + [math.log(tick) for tick in shown],
        "ticktext": [word for word, _ in named] + [f"{tick:g}" for tick in shown],
    }


def _takeaway(frame: pd.DataFrame, names: list[str]) -> str:
    """How many numbers, how far from 1, and which model is farthest from its base."""
    positive = frame[frame.factor > 0]
    removed = int((frame.factor == 0).sum())
    kept = frame.factor[frame.factor != 0]
    text = f"{counted(len(kept), 'number')} in {counted(len(names), 'model')}"
    if len(kept):
        low, high = number(kept.min()), number(kept.max())
        text += f", times {low}" if low == high else f", times factors from {low} to {high}"
    else:
        text = f"{counted(len(names), 'model')} changed"
    text += f"; {counted(removed, 'term')} removed" if removed else ""
    if positive.model.nunique() > 1:
        squared = pd.Series(np.log(positive.factor.to_numpy(dtype=float)) ** 2, index=positive.model)
        away = squared.groupby(level=0).mean()
        far = str(away.idxmax())
        text += f"; {far} is farthest from its base, by a factor of {math.exp(math.sqrt(float(away[far]))):.2f}"
        text += f" (root mean square{' of those not removed' if removed else ''})"
    return f"{text}."


SECTION = Section(
    "The models",
    draw=lambda content: (factors(content), tables.models(content)),
    needs=("models",),
    anchors=("factors", "models"),
)
