"""One study in several worlds: comparison of finished folders that differ in their top-level seed alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.answer.findings import findings
from shipid.errors import ResultError
from shipid.evidence import world_interval
from shipid.files import as_argument
from shipid.study.declared import NO_METHOD, NO_MODEL
from shipid.study.results import Results, read_results
from shipid.study.store import stored_plan

POSSIBLE = {
    "rank correlation": (-1.0, 1.0),
    "share": (0.0, 1.0),
    **dict.fromkeys(("H ", "gap", "ratio", "roughness", "variation", "verdicts"), (0.0, np.inf)),
}
"""What a key number of a finding can be, by a word in its name; others can be any."""


def are_worlds(folders: Sequence[Path]) -> bool:
    """Whether folders hold one study in different worlds, so that they are repetitions of one another."""
    plans = [stored_plan(folder) for folder in folders]
    same = len({plan.digest_in_any_world for plan in plans}) == 1
    return same and len(plans) > 1 and len({plan.study.seed for plan in plans}) == len(plans)


def read_worlds(folders: Sequence[Path]) -> list[Results]:
    """Read finished runs of one study in different worlds, see `are_worlds`; ResultError for one not finished."""
    worlds = [read_results(folder) for folder in folders]
    for results in worlds:
        if not results.complete:
            message = f"is not finished: continue with `shipid study resume {as_argument(results.folder)}`"
            raise ResultError(message, file=results.folder)
    return worlds


def compare_findings(worlds: Sequence[Results]) -> pd.DataFrame:
    """One row per finding and key number: id, claim, verdicts, number, mean over the worlds that have it, low, high.

    low and high are Student's 95 % interval over worlds, within what the number can be.
    """
    rows = []
    for same in zip(*(findings(results) for results in worlds), strict=True):
        verdicts = ", ".join(f"{count} {word}" for word, count in Counter(one["verdict"] for one in same).most_common())
        for name in dict.fromkeys(name for one in same for name in one["numbers"]) or [""]:
            values = np.array([one["numbers"][name] for one in same if name in one["numbers"]], dtype=float)
            within = next((limits for word, limits in POSSIBLE.items() if word in name), (-np.inf, np.inf))
            mean = values.mean() if len(values) else np.nan
            rows.append((same[0]["id"], same[0]["claim"], verdicts, name, mean, *world_interval(values, *within)))
    return pd.DataFrame(rows, columns=["id", "claim", "verdicts", "number", "mean", "low", "high"])


def compare_errors(worlds: Sequence[Results]) -> pd.DataFrame:
    """H [m], coverage [1] and width [m] of bands per family, method and N_D, over worlds; of N_D = 0, A in place of H.

    Columns: family, method, N_D; H, H_low, H_high: mean, least and greatest over the worlds of the means over members
    and seeds; so for coverage and width, not numbers without a band; worlds (that have a result). Failed cells are left
    out.
    """
    parts, keys, numbers = [], ["family", "method", "N_D"], ["H", "coverage", "width"]
    for results in worlds:
        good = results.cells[results.cells["status"] == "ok"].reindex(columns=[*keys, "foundation", "A", *numbers])
        known = ~good["family"].isin([NO_MODEL, *results.plan.fitted])
        alone = good[known].drop_duplicates("foundation")
        alone = alone.assign(N_D=0, H=alone["A"], method=NO_METHOD, coverage=np.nan, width=np.nan)
        every = pd.concat([alone, good]).astype(dict.fromkeys(numbers, float))
        parts.append(every.groupby(keys, sort=False)[numbers].mean().reset_index())
    ends = {"": "mean", "_low": "min", "_high": "max"}
    named = {f"{name}{end}": (name, how) for name in numbers for end, how in ends.items()}
    return pd.concat(parts).groupby(keys, sort=False).agg(**named, worlds=("H", "size")).reset_index()
