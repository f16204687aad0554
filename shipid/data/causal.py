"""Logs whose rows hold part of the future: values interpolated between fixes, replaced by what was known by then.

A log that was brought to a regular clock by linear interpolation holds, in every row between two fixes, part of the
next one. No column says so; but between fixes the second difference is zero, and it is not where a fix lies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Array, Dataset, stretch_rows
from shipid.errors import DataError, suggest_name

LEAST_BEND = 1e-7  # of a column's largest step: below it a second difference is zero


def last_known_rows(t: Array, values: Array) -> NDArray[np.intp]:
    """For each row (N,) the latest row whose value depends on no fix after it; the first rows hold the first.

    A bend at row i (slopes before and after differ) says that a fix lies within one step of row i. The line through row
    j ends at the first fix after it, which has come by row i if a bend has been seen at a row between them: at j or
    later, and before i. Where a value holds still
    (equal to the one before), it counts as known.
    """
    count, steps = len(values), np.diff(t)
    slope = np.diff(values) / steps
    limit = LEAST_BEND * max(float(np.abs(slope).max(initial=0.0)), 1e-300)
    of_clock = np.abs(slope) * 2 * np.spacing(np.abs(t).max()) / steps  # seconds since 1970 are rounded to some 1e-7
    bend = np.zeros(count, dtype=bool)
    bend[1:-1] = np.abs(np.diff(slope)) > limit + of_clock[1:] + of_clock[:-1]
    known = np.zeros(count, dtype=np.intp)
    latest = 0
    for i in range(1, count):
        still = abs(slope[i - 1]) <= limit
        if i >= 2 and bend[i - 1]:  # seen with row i: a fix came between rows i - 2 and i
            latest = max(latest, i - 2)
        known[i] = i if still and known[i - 1] == i - 1 else latest
        latest = max(latest, int(known[i]))
    return known


def causal_columns(dataset: Dataset, columns: Sequence[str] = ("u", "v")) -> Dataset:
    """Dataset whose `columns` hold in each row the last value that depends on no later fix.

    Raises DataError for a column that is not there.
    """
    frame = dataset.frame.copy()
    for name in columns:
        if name not in frame:
            raise DataError(f"missing column: {suggest_name(name, list(map(str, frame.columns)))}", path=name)
        whole = frame[name].to_numpy(dtype=float).copy()
        for _, rows in stretch_rows(dataset):
            t, values = frame["t"].to_numpy()[rows], whole[rows]
            if len(rows) < 3:
                continue
            whole[rows] = values[last_known_rows(t, values)]
        frame[name] = whole
    metadata = {**dataset.metadata, "causal": list(columns)}
    return replace(dataset, frame=frame, metadata=metadata)
