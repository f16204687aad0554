"""Manoeuvre measures of the runs of a dataset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import pandas as pd

from shipid.data.dataset import FIRST_DATED_TIME, Dataset, stretches_of_runs
from shipid.errors import DataError, suggest_name
from shipid.measures.criteria import criterion_rows, judge_criteria, measure_rows
from shipid.measures.recognise import recognise_kinds, record_of
from shipid.physics.signals import is_command, is_steering
from shipid.simulation.standard import standard_manoeuvres

NO_HELM = (
    "the log has no angle that steers, by which zigzags and turning circles are measured, and the shafts are not "
    "reversed, as in a stop"
)


@dataclass(frozen=True, eq=False)
class MeasuredDataset:
    """Tables of a dataset's manoeuvres, one row each: `run`, `kind`, and the rows of `shipid.measures.criteria`.

    left : run -> sentence: why it was not measured.
    """

    measures: pd.DataFrame
    criteria: pd.DataFrame
    left: dict[str, str]


def measure_dataset(dataset: Dataset, kind: str | None = None, length: float | None = None) -> MeasuredDataset:
    """Measure every run; a run with breaks is measured in its unbroken pieces, named `run/1`, `run/2`, ...

    kind : of all runs, a key of `standard_manoeuvres()`; default: what is recognised.
    length : between perpendiculars [m]; without it nothing is judged by ship lengths.
    Raises DataError for an unknown kind, or a length that is not positive.
    """
    trials = standard_manoeuvres()
    if kind is not None and kind not in trials:
        raise DataError(f"no manoeuvre is called {kind!r}: {suggest_name(kind, trials)}", path="--manoeuvre")
    if length is not None and not length > 0:
        raise DataError(f"a length of {length:g} m: it must be positive", path="--length")
    measures, judged, left = [], [], {}
    for name, rows in _named_runs(dataset):
        if len(rows) < 2:
            left[name] = "it has one row"
            continue
        columns = {str(column): rows[column].to_numpy() for column in rows if column != "run"}
        if columns["t"][0] > FIRST_DATED_TIME:
            columns["t"] = columns["t"] - columns["t"][0]
        record = record_of(columns)
        kinds, why = recognise_kinds(record) if kind is None else ((kind,), "")
        if not kinds:
            helm = any(is_command(column) and is_steering(column) for column in columns)
            left[name] = why if helm else NO_HELM
        for seen in kinds:
            result = trials[seen].measures(record)
            measures += [{"run": name, "kind": seen, **row} for row in measure_rows(result, length)]
            judged += [
                {"run": name, "kind": seen, **row} for row in criterion_rows(judge_criteria(seen, result, length))
            ]
    return MeasuredDataset(pd.DataFrame(measures), pd.DataFrame(judged), left)


def _named_runs(dataset: Dataset) -> Iterator[tuple[str, pd.DataFrame]]:
    parts = list(stretches_of_runs(dataset))
    count, number = Counter(name for name, _ in parts), Counter[str]()
    for name, rows in parts:
        number[name] += 1
        yield (name if count[name] == 1 else f"{name}/{number[name]}"), rows
