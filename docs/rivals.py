"""Methods on the windows of `quick`, each with its core-seconds, from one run in turn.

`python docs/records.py rivals python docs/rivals.py FOLDER`. All meet the first member of moderate and of high, and no
physics, with 10, 30 and 100 runs; those that take long meet moderate with 30 runs. Settings are defaults, but for
what is named here.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from shipid import read_plan
from shipid.metrics import position_error
from shipid.study.results import read_results
from shipid.study.run import run_study

MEMORY = read_plan("quick").document["method"][0]["memory"]
FAST: tuple[dict[str, Any], ...] = (
    {"kind": "hankel-dmd", "families": ["moderate", "high", "none"]},
    {"kind": "one-step", "families": ["moderate", "high", "none"]},
)
SLOW: tuple[dict[str, Any], ...] = (
    {"kind": "calibrator", "memory": MEMORY},
    {"kind": "forest", "memory": MEMORY},
    {"kind": "recurrent"},
    {"kind": "path-trained", "trials": 24},
)
CHANGES: dict[str, Any] = {"family.0.members": 1, "family.1.members": 1, "grid.seeds": [0]}


def run_methods(folder: Path, others: tuple[dict[str, Any], ...], amounts: list[int]) -> dict[str, dict[str, str]]:
    """Method -> column -> H [m] and core-seconds of a cell; `quick` is run once."""
    own = read_plan("quick").document["method"]
    blocks = [*own, *({"name": one["kind"], "families": ["moderate"], **one} for one in others)]
    for event in run_study(read_plan("quick", CHANGES | {"grid.N_D": amounts, "method": blocks}), folder, workers=1):
        print(event.text, file=sys.stderr)
    results, table = read_results(folder), {}
    for row in results.rows:
        name = own[0]["kind"] if row["method"] == own[0]["name"] else row["method"]
        error = f"{row['H']:.3f} ({row['seconds']:.1f})" if row["status"] == "ok" else row["status"]
        table.setdefault(name, {})[f"{row['model'].split(' + ')[0]}, {row['N_D']}"] = error
    for batch in results.plan.batches:
        error = position_error(results.regression[batch.key], results.test.future).mean()
        table.setdefault("regression", {})[f"none, {batch.N_D}"] = f"{error:.3f}"
        table.setdefault("constant u, v, r", {})[f"none, {batch.N_D}"] = f"{results.naive.mean():.3f}"
    return table


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="new folder for the two runs")
    folder = parser.parse_args().folder
    print("H [m] on the test of `quick`, core-seconds of the cell in brackets.")
    for name, others, amounts in (("fast", FAST, [10, 30, 100]), ("slow", SLOW, [30])):
        table = run_methods(folder / name, others, amounts)
        columns = [f"{model}, {N_D}" for model in ("moderate", "high", "none") for N_D in amounts]
        print(f"\n| method | {' | '.join(columns)} |\n| --- |{' ---: |' * len(columns)}")
        for method, cells in table.items():
            print(f"| {method} | {' | '.join(cells.get(column, '') for column in columns)} |", flush=True)


if __name__ == "__main__":
    main()
