"""Colours: one per model, the same in every figure, as names of CSS variables that the page resolves.

Figures hold `var(--...)` instead of colours, so that one figure serves a light, a dark and a printed page.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd
from plotly.colors import sample_colorscale

from shipid.report.content import DATA_DRIVEN, ReportContent
from shipid.report.selection import FEW_MODELS, exemplars, families, same_physics

INK, MUTED, GRID, TRUTH, NAIVE = "var(--ink)", "var(--muted)", "var(--grid)", "var(--truth)", "var(--muted)"
LEVELS = 24
ROUNDING = 1e-9  # of the greatest error: that of an exact model
# Okabe and Ito (2008), "Color universal design"; yellow and black are left out: one page is white, one nearly black.
OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
SYMBOLS = ("circle", "diamond", "square", "triangle-up", "cross", "star")
# Of the second, third, ... model without physics: all are ink.
FURTHER = ("cross", "circle-open", "square-open", "diamond-open", "triangle-up-open", "star", "square", "diamond")
DASHES = {"cooperative": "solid", "physics": "dot", "naive": "dash"}


@dataclass(frozen=True)
class Style:
    """How one model is drawn: colour (CSS variable), marker of its family, line width [px]."""

    colour: str
    symbol: str
    width: float


def variables(dark: bool) -> str:
    """CSS declarations: viridis (for lines only its colours with contrast to the page) and the Okabe-Ito colours."""
    ends = (0.28, 1.0) if dark else (0.0, 0.72)
    scale = sample_colorscale("Viridis", list(np.linspace(*ends, LEVELS)))
    lines = [f"--scale-{i}: {colour};" for i, colour in enumerate(scale)]
    # Dark blue has contrast to white but not to black: the dark page takes sky blue instead, and the reverse.
    named = (OKABE_ITO[-1], *OKABE_ITO[1:-1], OKABE_ITO[0]) if dark else OKABE_ITO
    lines += [f"--category-{i}: {colour};" for i, colour in enumerate(named)]
    lines.append(f"--scale: linear-gradient(90deg, {', '.join(scale)});")
    whole = sample_colorscale("Viridis", list(np.linspace(0.0, 1.0, LEVELS)))
    lines += [f"--heat-{i}: {colour};" for i, colour in enumerate(whole)]
    lines.append(f"--heat: linear-gradient(90deg, {', '.join(whole)});")
    return " ".join(lines)


def category(index: int) -> str:
    """Return the CSS variable of the index-th category colour."""
    return f"var(--category-{index % len(OKABE_ITO)})"


def accuracy_range(content: ReportContent) -> tuple[float, float] | None:
    """Smallest and largest A [m] if models are coloured by A; None if there are few and each has a separate colour."""
    frame = families(content)
    physics = frame.A[frame.A.notna() & (frame.family != DATA_DRIVEN)]
    if len(frame) <= FEW_MODELS or physics.empty:
        return None
    return float(physics.min()), float(physics.max())


@lru_cache(maxsize=4)  # every figure asks for it
def styles(content: ReportContent) -> Mapping[str, Style]:
    """Style of every model: colour by A for many models, Okabe-Ito for few, thick ink for no physics."""
    frame, span = families(content), accuracy_range(content)
    kinds = [kind for kind in pd.unique(frame.family) if kind != DATA_DRIVEN]
    same = same_physics(frame).to_numpy()
    result: dict[str, Style] = {}
    for index, row in enumerate(frame.itertuples()):
        if row.family == DATA_DRIVEN:
            result[str(row.model)] = _without_physics(sum(style.colour == INK for style in result.values()))
            continue
        colour = category(index) if span is None else _by_accuracy(float(str(row.A)), span)
        symbol = SYMBOLS[kinds.index(row.family) % len(SYMBOLS)]
        again = span is not None and same[index]  # of several methods on one model the first is filled
        result[str(row.model)] = Style(colour, f"{symbol}-open" if again else symbol, 2.0)
    return result


@lru_cache(maxsize=4)
def close_styles(content: ReportContent) -> Mapping[str, Style]:
    """Style of the models of a close-up: a colour and a marker each, whatever their A; no physics in ink.

    When all colours are used, they come again with other markers: 36 models are told apart.
    """
    frame = families(content)
    result: dict[str, Style] = {}
    of_family = dict(zip(frame.model.astype(str), frame.family, strict=True))
    physics = [name for name in exemplars(content) if of_family[name] != DATA_DRIVEN]
    for index, name in enumerate(physics):
        again = index // len(OKABE_ITO)
        result[name] = Style(category(index), SYMBOLS[(index + again) % len(SYMBOLS)], 2.0)
    for name in exemplars(content):
        if of_family[name] == DATA_DRIVEN:
            result[name] = _without_physics(len([other for other in result if of_family[other] == DATA_DRIVEN]))
    return result


def _without_physics(number: int) -> Style:
    """Ink: thick for the first model without physics, thin and with other markers for others."""
    return Style(INK, "x", 3.0) if number == 0 else Style(INK, FURTHER[(number - 1) % len(FURTHER)], 1.5)


def least_coloured(span: tuple[float, float]) -> float:
    """Where a scale of colours begins: at its least magnitude; where that is nothing or rounding, at 1e-4 of its end.

    Above 0, also for a scale of zeros alone.
    """
    low, high = span
    return (low if low >= ROUNDING * high else 1e-4 * high) or 1.0


def level(value: float, span: tuple[float, float]) -> int:
    """Place of a magnitude on a logarithmic scale of `LEVELS` colours: errors are factors apart, a few far off."""
    low, high, here = np.log(np.maximum([*span, value], least_coloured(span)))
    return round(float(np.clip((here - low) / (high - low), 0, 1)) * (LEVELS - 1)) if high > low else 0


def _by_accuracy(accuracy: float, span: tuple[float, float]) -> str:
    if not np.isfinite(accuracy):  # A is unknown: the physics diverged
        return MUTED
    return f"var(--scale-{level(accuracy, span)})"
