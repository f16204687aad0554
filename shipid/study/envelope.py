"""The envelope of a study's inputs, as the paper's Tables 1 and 2: in the data, and beside what others published."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.windows import Windows
from shipid.hybrid.features import choose_features, feature_table
from shipid.physics.signals import read_unit, signal_of
from shipid.study.schema import PublishedEnvelope, published_keys

ENVELOPE_COLUMNS = ("min", "mean", "max")


def input_envelope(
    pool: Windows, test: Windows, runs: Mapping[int, Sequence[str]], commands: Sequence[str]
) -> list[dict[str, Any]]:
    """Least, mean and greatest input [SI] at the instants of prediction, per D_10 ... and test.

    runs : N_D -> the runs of the pool that train with so many, in the order of the rows.
    """
    tables = {"test": feature_table(test.columns, commands)}
    for N_D, names in runs.items():
        tables[f"D_{N_D}"] = feature_table(pool.select(np.isin(pool.run, names)).columns, commands)
    whole = feature_table(pool.columns, commands)
    alike = choose_features(whole) | {name: (name,) for name, values in whole.items() if np.ptp(values) == 0}
    return [
        {"set": name, "quantity": quantity, "min": values.min(), "mean": values.mean(), "max": values.max()}
        for name, table in tables.items()
        for quantity, values in table.items()
        if quantity in alike  # equal commands are one input: the first represents all
    ]


def envelope_table(rows: Iterable[Mapping[str, Any]], published: PublishedEnvelope | None) -> pd.DataFrame:
    """The envelope in degrees and rpm, a row per set and quantity; what is published is the set of that name."""
    shown = []
    for row in rows:
        unit, factor = read_unit(row["quantity"])
        shown.append({**row, "unit": unit, **{name: row[name] * factor for name in ENVELOPE_COLUMNS}})
    return pd.DataFrame([*shown, *_published_rows(published, [row["quantity"] for row in shown])])


def _published_rows(published: PublishedEnvelope | None, quantities: Sequence[str]) -> list[dict[str, Any]]:
    """Rows of the published envelope for those quantities that the study has."""
    rows = []
    for key, limits in (published.envelope if published else {}).items():
        signal, to_SI = published_keys()[key]
        for quantity in dict.fromkeys(quantities):
            if signal_of(quantity) == signal:
                unit, factor = read_unit(quantity)
                values = dict(zip(ENVELOPE_COLUMNS, (to_SI * factor * limit for limit in limits), strict=True))
                rows.append({"set": "published", "quantity": quantity, "unit": unit, **values})
    return rows
