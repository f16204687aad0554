"""The kind of a run, from its orders and its motion."""

from __future__ import annotations

from collections.abc import Container

import pandas as pd

from shipid.data.dataset import Dataset, stretches_by_run
from shipid.logs.kinds import kind_in_name
from shipid.logs.segments import run_kind


def kinds_of_runs(dataset: Dataset, runs: Container[str] | None = None) -> dict[str, str]:
    """Run -> kind of manoeuvre: as the mapping says, else as the words in its name say, else by orders and motion.

    runs : those wanted; all by default.
    """
    declared = dataset.metadata.get("manoeuvres", {})
    return {
        run: declared.get(run) or kind_in_name(run) or run_kind(longest_piece(parts))
        for run, parts in stretches_by_run(dataset).items()
        if runs is None or run in runs
    }


def longest_piece(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """The longest of the unbroken pieces of a run."""
    return max(parts, key=lambda part: float(part["t"].iloc[-1] - part["t"].iloc[0]))
