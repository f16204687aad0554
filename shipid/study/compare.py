"""One study in several worlds: comparison of finished folders that differ in their top-level seed alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.errors import ResultError, ShipidError
from shipid.files import as_argument
from shipid.study.declared import NO_METHOD, NO_MODEL
from shipid.study.evidence import over_worlds
from shipid.study.findings import findings
from shipid.study.plan import digest_without_seed, fitted_families
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
    same = len({digest_without_seed(plan) for plan in plans}) == 1
    return same and len(plans) > 1 and len({plan.study.seed for plan in plans}) == len(plans)


def read_worlds(folders: Sequence[Path]) -> list[Results]:
    """Read finished runs of one study in different worlds; ResultError where they are not."""
    if len(folders) < 2:
        raise ShipidError("name two folders or more: runs of one study with another `--set seed=` each")
    plans = {folder: stored_plan(folder) for folder in folders}
    first, known = plans[folders[0]], dict[int, Path]()
    for folder, plan in plans.items():
        if digest_without_seed(plan) != digest_without_seed(first):
            raise ResultError(f"holds another study than {folders[0]}: only `seed` may differ", file=folder)
        seed = plan.study.seed
        if seed in known:
            raise ResultError(f"has seed = {seed}, as {known[seed]} has: nothing is repeated", file=folder, path="seed")
        known[seed] = folder
    if len(plans) < len(folders):
        raise ShipidError("a folder is named twice")
    worlds = [read_results(folder) for folder in folders]
    for results in worlds:
        if not results.complete:
            message = f"is not finished: continue with `shipid study resume {as_argument(results.folder)}`"
            raise ResultError(message, file=results.folder)
        if not (results.cells["status"] == "ok").any():
            raise ResultError("has no cell with a result", file=results.folder)
    return worlds


def compare_findings(worlds: Sequence[Results]) -> pd.DataFrame:
    """One row per finding and key number: id, claim, verdicts, number, mean over the worlds that have it, low, high.

    low and high are Student's 95 % interval over worlds, as of `over_worlds`, within what the number can be.
    """
    by_world = [findings(results) for results in worlds]
    rows = []
    for same in zip(*by_world, strict=True):
        counts = Counter(one["verdict"] for one in same)
        verdicts = ", ".join(f"{count} {word}" for word, count in counts.most_common())
        names = dict.fromkeys(name for one in same for name in one["numbers"])
        for name in names or [""]:
            values = pd.Series([one["numbers"][name] for one in same if name in one["numbers"]], dtype=float)
            row = {"id": same[0]["id"], "claim": same[0]["claim"], "verdicts": verdicts, "number": name}
            within = next((limits for word, limits in POSSIBLE.items() if word in name), (-np.inf, np.inf))
            low, high = over_worlds(values.to_numpy(), *within)
            rows.append({**row, "mean": values.mean(), "low": low, "high": high})
    return pd.DataFrame(rows, columns=["id", "claim", "verdicts", "number", "mean", "low", "high"])


def compare_errors(worlds: Sequence[Results]) -> pd.DataFrame:
    """H [m] per family, method and N_D: mean over members and seeds, then mean, low and high over worlds; N_D = 0 is A.

    Failed cells are left out; `worlds` says how many have a result.
    """
    parts = []
    for world, results in enumerate(worlds):
        good = results.cells[results.cells["status"] == "ok"]
        known = ~good["family"].isin([NO_MODEL, *fitted_families(results.plan)])
        alone = good[known].drop_duplicates("foundation").assign(N_D=0, H=lambda rows: rows["A"], method=NO_METHOD)
        means = pd.concat([alone, good]).groupby(["family", "method", "N_D"], sort=False)["H"].mean()
        parts.append(means.reset_index().assign(world=world))
    grouped = pd.concat(parts).groupby(["family", "method", "N_D"], sort=False)["H"]
    return grouped.agg(mean="mean", low="min", high="max", worlds="size").reset_index()


def compare_bands(worlds: Sequence[Results]) -> pd.DataFrame:
    """Coverage and width [m] of the bands per family, method and N_D: means over members and seeds, then over worlds.

    Columns: family, method, N_D, coverage, coverage_low, coverage_high, width, width_low, width_high, worlds (that have
    a band); without rows where no cell has one.
    """
    parts = []
    for results in worlds:
        keys = ["family", "method", "N_D", "status", "coverage", "width"]
        good = results.cells.reindex(columns=keys).astype({"coverage": float, "width": float})
        good = good[(good["status"] == "ok") & good["coverage"].notna()]
        parts.append(good.groupby(["family", "method", "N_D"], sort=False)[["coverage", "width"]].mean().reset_index())
    grouped = pd.concat(parts).groupby(["family", "method", "N_D"], sort=False)
    named = {
        f"{name}{suffix}": (name, how)
        for name in ("coverage", "width")
        for suffix, how in (("", "mean"), ("_low", "min"), ("_high", "max"))
    }
    return grouped.agg(**named, worlds=("width", "size")).reset_index()
