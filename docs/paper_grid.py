"""The paper's grid by the paper's own recipe, a cell at a time: 18 models and none, Adam, 50 trials of TPE a cell.

`python docs/records.py paper-grid python docs/paper_grid.py RUN --hours 2` computes cells that
`docs/records/paper-grid.csv` lacks, in the folder RUN, adds each to that file as it ends, and writes their table as the
record. Amounts of 10, 30 and 100 runs come first. It may be interrupted at any time: a cell goes on from its last trial
as long as RUN is there.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from pathlib import Path

import pandas as pd

from shipid import read_plan
from shipid.study.plan import Plan
from shipid.study.run import prepare_study, run_study
from shipid.study.store import read_rows, shard_folder
from shipid.version import __version__

FILE = Path(__file__).parent / "records" / "paper-grid.csv"
COLUMNS = ["model", "N_D", "A", "H", "H_90", "H_end", "seconds", "version"]
FIRST = (10, 30, 100)
"""Amounts of data that are computed to the end before the others begin."""


def missing_cells(plan: Plan, known: pd.DataFrame) -> list[int]:
    """Numbers from 1 of the units of the paper's grid that the record lacks, in the order of computing."""
    done = set(zip(known["model"], known["N_D"], strict=True))
    units = []
    for number, unit in enumerate(plan.units, 1):
        [(model, method)] = unit.pairs
        if method == "trained" and model != "nominal" and (model, unit.batch.N_D) not in done:
            units.append((unit.batch.N_D not in FIRST, unit.batch.N_D, number))
    return [number for _, _, number in sorted(units)]


def table_of_errors(rows: pd.DataFrame) -> str:
    """The cells as a table of H over models and amounts, and what the cells took."""
    models = rows.groupby("model")["A"].first().sort_values(na_position="last")
    wide = rows.pivot(index="model", columns="N_D", values="H").reindex(models.index)
    lines = [f"| model | A [m] | {' | '.join(map(str, wide.columns))} |", f"| --- |{' ---: |' * (1 + wide.shape[1])}"]
    for (model, accuracy), values in zip(models.items(), wide.to_numpy(), strict=True):
        cells = [f"{value:.2f}" if value == value else "-" for value in (accuracy, *values)]
        lines.append(f"| {model} | {' | '.join(cells)} |")
    took = f"{len(rows)} of 190 cells, {rows['seconds'].sum() / 3600:.1f} core-hours."
    return "\n".join([f"H [m], mean over the horizon of 30 s. One world. {took}", "", *lines])


def main() -> None:
    """Compute what is missing until the time is over."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="folder of the run, made where there is none")
    parser.add_argument("--hours", type=float, default=1.0, help="no cell begins later")
    given = parser.parse_args()
    end, plan = time.monotonic() + 3600 * given.hours, read_plan("simulation")
    if not FILE.exists():
        FILE.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    if not given.run.exists():
        for event in prepare_study(plan, given.run):
            print(event.text, file=sys.stderr)
    for number in missing_cells(plan, pd.read_csv(FILE)):
        if time.monotonic() > end:
            break
        shard = (number, len(plan.units))
        for event in run_study(plan, given.run, shard=shard, workers=1):
            print(event.text or event.row.get("cell", ""), file=sys.stderr)
        place = shard_folder(given.run, shard)
        row = read_rows(place).rename(columns={"foundation": "model"}).assign(version=__version__)
        row[COLUMNS].to_csv(FILE, mode="a", header=False, index=False)
        shutil.rmtree(place)
    print(table_of_errors(pd.read_csv(FILE)))


if __name__ == "__main__":
    main()
