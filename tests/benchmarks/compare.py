"""Figures held against what was recorded: which ratios regressed, which promises are kept.

`recorded.json`: group -> label -> `better` (`higher` or `lower`), and `value`, the recorded ratio (null: not recorded
yet), or `promise`, the bound that the project promises, or both. A time has no `value`: it is of one machine.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

RECORDED = Path(__file__).with_name("recorded.json")
TOLERANCE = 0.2

Figures = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Ratio:
    """A figure beside the recorded or the promised one.

    Parameters
    ----------
    group, label : where the figure is.
    value : measured now.
    recorded : measured when it was accepted; None if never.
    better : whether `higher` or `lower` is better.
    promise : the bound it is to keep; None if nothing is promised.
    """

    group: str
    label: str
    value: float
    recorded: float | None
    better: Literal["higher", "lower"]
    promise: float | None = None

    @property
    def worse_by(self) -> float:
        """Return by which factor less 1 it is worse than recorded; negative where it is better, 0 if never recorded."""
        if self.recorded is None:
            return 0.0
        lower = self.better == "lower"
        return (self.value / self.recorded if lower else self.recorded / self.value) - 1.0

    @property
    def regressed(self) -> bool:
        """Tell whether it is worse than recorded by more than the tolerance; what is no number is."""
        return not self.worse_by <= TOLERANCE

    @property
    def kept(self) -> bool | None:
        """Tell whether the promise is kept; None if nothing is promised."""
        if self.promise is None:
            return None
        return self.value <= self.promise if self.better == "lower" else self.value >= self.promise


def read_recorded() -> dict[str, dict[str, dict[str, Any]]]:
    """Read group -> label -> entry."""
    document: dict[str, dict[str, dict[str, Any]]] = json.loads(RECORDED.read_text())
    return document


def compare(figures: Figures, recorded: Figures) -> list[Ratio]:
    """Hold the groups that were measured against their recorded ratios; KeyError where a ratio was not measured."""
    return [
        Ratio(group, label, float(measured[label]), entry.get("value"), entry["better"], entry.get("promise"))
        for group, measured in figures.items()
        for label, entry in recorded.get(group, {}).items()
    ]


def best(first: Figures, again: Figures, recorded: Figures) -> dict[str, dict[str, Any]]:
    """Take the better of two measurements of each recorded ratio, and all other figures from the second."""
    merged = {group: dict(measured) for group, measured in {**first, **again}.items()}
    for one in compare({group: first[group] for group in again}, recorded):
        other = merged[one.group][one.label]
        merged[one.group][one.label] = (max if one.better == "higher" else min)(one.value, other)
    return merged


def accepted(figures: Figures, recorded: Figures) -> dict[str, dict[str, Any]]:
    """Return what is recorded with the values of all ratios that were measured replaced."""
    new = {group: {label: dict(entry) for label, entry in entries.items()} for group, entries in recorded.items()}
    for ratio in compare(figures, recorded):
        if "value" in new[ratio.group][ratio.label]:
            new[ratio.group][ratio.label]["value"] = ratio.value
    return new
