"""Content of the page of a checked log, assembled from the dataset."""

from __future__ import annotations

import pandas as pd

from shipid.data.checks import check_series
from shipid.data.dataset import Dataset
from shipid.report.logs import CheckContent


def check_content(name: str, log: Dataset, checks: pd.DataFrame) -> CheckContent:
    """Return the content of the page of a log: `name` is a short name, `checks` the table from `check_dataset`."""
    source = log.metadata.get("source", "")
    words = source if isinstance(source, str) else ", ".join(f"{key} {value}" for key, value in source.items())
    return CheckContent(
        name=name,
        checks=checks,
        series=check_series(log),
        tracks=log.frame[["run", "north", "east"]].assign(set="the log"),
        repairs=pd.DataFrame(log.metadata.get("repairs", []), columns=["kind", "column", "count", "note"]),
        provenance={
            "log": words,
            "vessel": str(log.metadata.get("vessel") or "not given"),
            "rows": str(len(log.frame)),
        },
    )
