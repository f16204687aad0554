"""The paper's grid by the paper's own recipe, a cell at a time: 18 models and none, Adam, 50 trials of TPE a cell.

`python docs/records.py paper-grid python docs/paper_grid.py RUN --hours 2` computes cells that
`docs/records/paper-grid.csv` lacks, in the folder RUN, adds each to that file as it ends, and writes their table as the
record. Amounts of 10, 30 and 100 runs come first. It may be interrupted at any time: a cell goes on from its last trial
as long as RUN is there. With `--kernel` it computes the cells of `kernel` at the first amounts, all at once, and writes
`docs/records/paper-grid-kernel.csv`. The site draws figures 8, 9 and 10 of both files whenever it is built.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from shipid import ShipidError, figures, read_plan
from shipid.files import read_arrays
from shipid.metrics import path_roughness, rank_correlation
from shipid.report.content import DATA_DRIVEN
from shipid.study.plan import Plan
from shipid.study.run import prepare_study, run_study
from shipid.study.store import paths_file, read_rows, read_test, shard_folder
from shipid.version import __version__

FILE = Path(__file__).parent / "records" / "paper-grid.csv"
KERNEL = FILE.with_name("paper-grid-kernel.csv")
COLUMNS = ["model", "N_D", "A", "H", "H_90", "H_end", "seconds", "version", "roughness"]
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


def table_of_errors(rows: pd.DataFrame, kernel: pd.DataFrame) -> str:
    """The cells as a table of H over models and amounts, each beside that of `kernel`, and what the cells took."""
    amounts = sorted(set(rows["N_D"]))
    wide = [one.pivot(index="model", columns="N_D", values="H") for one in (rows, kernel)]
    heads = [f"{N_D}{words}" for N_D in amounts for words in ("", ", `kernel`")]
    lines = [f"| model | A [m] | {' | '.join(heads)} |", f"| --- |{' ---: |' * (1 + len(heads))}"]
    for model, accuracy in rows.groupby("model")["A"].first().sort_values(na_position="last").items():
        values = [one.get(N_D, pd.Series(dtype=float)).get(model, np.nan) for N_D in amounts for one in wide]
        cells = [f"{value:.2f}" if value == value else "-" for value in (accuracy, *values)]
        lines.append(f"| {model} | {' | '.join(cells)} |")
    took = f"{len(rows)} of 190 cells, {rows['seconds'].sum() / 3600:.1f} core-hours."
    return "\n".join([f"H [m], mean over the horizon of 30 s. One world. {took}", "", *lines])


def counts_of_findings(rows: pd.DataFrame) -> list[str]:
    """What the cells so far say of S1 to S6, as counts: the findings themselves need a whole grid and errors by run."""
    wide = rows.pivot(index="model", columns="N_D", values="H")
    accuracy = rows.groupby("model")["A"].first()
    pure = wide.loc[DATA_DRIVEN] if DATA_DRIVEN in wide.index else pd.Series(np.nan, wide.columns)
    physics = wide[wide.index != DATA_DRIVEN]
    lines = []
    for N_D in wide:
        known = physics[N_D].dropna()
        A = accuracy[known.index]
        lines.append(f"N_D = {N_D}: compensated H is below A for {int((known < A).sum())} of {len(known)} models.")
        if pure[N_D] == pure[N_D]:
            for finding, family in (("S1", "moderate"), ("S4", "high")):
                mine = known[known.index.str.startswith(family)]
                better = f"{int((mine < pure[N_D]).sum())} of {len(mine)} {family} models"
                lines.append(f"{finding}, N_D = {N_D}: {better} have a lower H than none.")
        if len(known) > 2:
            by_90 = rows[rows["N_D"] == N_D].set_index("model")["H_90"][known.index]
            lines.append(f"S3, N_D = {N_D}: rank correlation of H and A {rank_correlation(A, known):.2f}.")
            lines.append(f"S5, N_D = {N_D}: rank correlation of H and H_90 {rank_correlation(known, by_90):.2f}.")
    for few, many in pairwise(wide):
        both = wide[[few, many]].dropna()
        fallen = int((both[many] < both[few]).sum())
        lines.append(f"S2: H is lower at {many} runs than at {few} for {fallen} of {len(both)} models.")
        sooner = physics.index[physics[few] < pure[many]]
        if pure[many] == pure[many]:
            lines.append(f"S6: {len(sooner)} models have a lower H with {few} runs than none with {many}.")
    for N_D, rows_of in rows.groupby("N_D"):
        kept = rows_of.dropna(subset="roughness").set_index("model")["roughness"]
        if DATA_DRIVEN in kept and len(kept) > 1:
            joined = kept.drop(DATA_DRIVEN)
            lines.append(
                f"S7, N_D = {N_D}: paths without physics are {kept[DATA_DRIVEN]:.2f} times as rough as the true ones, "
                f"those of {len(joined)} models {joined.min():.2f} to {joined.max():.2f} times."
            )
    return lines


def beside_kernel(rows: pd.DataFrame, kernel: pd.DataFrame) -> str:
    """How H of the cells compares with that of `kernel` on the same cells."""
    both = rows.merge(kernel, on=["model", "N_D"], suffixes=("", "_kernel"))
    ratio = both["H"] / both["H_kernel"]
    lower = f"lower in {int((ratio < 1).sum())} of {len(ratio)} cells"
    return f"Against `kernel` H is {np.exp(np.log(ratio).mean()):.2f} times as large (geometric mean), {lower}."


def figures_page() -> str:
    """The page of the site with figures 8, 9 and 10 of the paper, for both methods."""
    lines = [
        "# The paper's grid",
        "",
        "H over the models, sorted by A, and N_D (8), H over N_D (9), H_90 over N_D (10).",
    ]
    lines += ["The first bar or point, N_D = 0, is the physics alone. [Record](../records/paper-grid.md).", ""]
    lines += ["```{raw} html", '<script src="../_static/plotly-cartesian.min.js"></script>', "```", ""]
    for file, name in ((FILE, "The paper's recipe"), (KERNEL, "`kernel` on the same cells")):
        cells = pd.read_csv(file)
        family = cells["model"].str.rpartition("-")[0].where(cells["model"] != DATA_DRIVEN, DATA_DRIVEN)
        content = figures.content_of(cells.assign(family=family))
        drawers = (
            figures.error_map,
            lambda one: figures.gain(one, "mean"),
            lambda one: figures.gain(one, "90th percentile"),
        )
        for number, draw in enumerate(drawers, 8):
            lines += [f"## {name}: figure {number}", ""]
            try:
                drawn = draw(content).to_html(full_html=False, include_plotlyjs=False)
                lines += ["```{raw} html", drawn, "```", ""]
            except ShipidError as error:  # a grid that has just begun
                lines += [f"Not drawn yet: {error}.", ""]
    return "\n".join(lines)


def compute_kernel(folder: Path) -> None:
    """Compute the cells of `kernel`, the default of the product, and write their rows."""
    method = [{"name": "kernel", "kind": "kernel"}]
    plan = read_plan("simulation", {"method": method, "grid.N_D": list(FIRST)})
    for event in [*prepare_study(plan, folder), *run_study(plan, folder, workers=1)]:
        print(event.text or event.row.get("cell", ""), file=sys.stderr)
    rows = read_rows(folder).rename(columns={"foundation": "model"}).assign(version=__version__)
    rows.loc[rows["model"] != "nominal", COLUMNS].to_csv(KERNEL, index=False)


def main() -> None:
    """Compute what is missing until the time is over."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="folder of the run, made where there is none")
    parser.add_argument("--hours", type=float, default=1.0, help="no cell begins later")
    parser.add_argument("--kernel", action="store_true", help="compute the cells of `kernel` instead")
    given = parser.parse_args()
    if given.kernel:
        compute_kernel(given.run)
        return
    end, plan = time.monotonic() + 3600 * given.hours, read_plan("simulation")
    if not FILE.exists():
        FILE.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    if given.hours and not given.run.exists():
        for event in prepare_study(plan, given.run):
            print(event.text, file=sys.stderr)
    true = path_roughness(read_test(given.run)[0].future) if given.run.exists() else float("nan")
    for number in missing_cells(plan, pd.read_csv(FILE)):
        if time.monotonic() > end:
            break
        shard = (number, len(plan.units))
        for event in run_study(plan, given.run, shard=shard, workers=1):
            print(event.text or event.row.get("cell", ""), file=sys.stderr)
        place = shard_folder(given.run, shard)
        row = read_rows(place).rename(columns={"foundation": "model"}).assign(version=__version__)
        row["roughness"] = [
            path_roughness(read_arrays(paths_file(place, cell))["paths"]) / true for cell in row["cell"]
        ]
        row[COLUMNS].to_csv(FILE, mode="a", header=False, index=False)
        shutil.rmtree(place)
    rows, kernel = pd.read_csv(FILE), pd.read_csv(KERNEL)
    print(table_of_errors(rows, kernel), beside_kernel(rows, kernel), *counts_of_findings(rows), sep="\n\n")


if __name__ == "__main__":
    main()
