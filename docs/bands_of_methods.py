"""Coverage and width of bands of `kernel` and of `path-drawn` in the worlds of `python -m tests.benchmarks bands`.

From the root of a checkout, `python docs/bands_of_methods.py compute FOLDER --worlds 200` keeps a table for each world,
22 runs for training; what is there is not computed again. `python docs/records.py bands-of-methods python
docs/bands_of_methods.py measure FOLDER` writes the record.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import pandas as pd

from shipid.hybrid.kernel import Kernel

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.benchmarks import bands
from tests.benchmarks.worlds import world

METHODS = {"path-drawn": bands.METHODS["drawn"], "kernel": Kernel()}
RUNS, FRESH = 22, 1000


def compute_world(seed: int) -> pd.DataFrame:
    """A row for each method and level: coverage of whole paths of fresh runs, mean radius [m], width over ideal."""
    made, rows = world(seed, FRESH), []
    for name, method in METHODS.items():
        one = bands.cell(made, list(made.pool.spans)[:RUNS], method, made.physics, seed)
        rows += [] if one is None else bands.promised(made, one, RUNS, {"world": seed, "method": name})
    return pd.DataFrame(rows)


def main() -> None:
    """Compute worlds, or print the table of those that are there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["compute", "measure"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--worlds", type=int, default=200)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    files = [given.folder / f"{seed}.parquet" for seed in range(given.worlds)]
    if given.what == "compute":
        for seed, file in enumerate(files):
            if not file.exists():
                compute_world(seed).to_parquet(file)
        return
    table = pd.concat([pd.read_parquet(file) for file in files if file.exists()])
    width = table.pivot_table(index=["world", "level"], columns="method", values="width").dropna()
    count = table["world"].nunique()
    print(f"{count} worlds, {RUNS} runs for training, {FRESH} fresh runs each; 95 % intervals over worlds.\n")
    print("| method | level | held | width over ideal | radius over that of `path-drawn` |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for (method, level), part in table.groupby(["method", "level"]):
        ratio = (width[method] / width["path-drawn"]).xs(level, level="level")
        cells = (bands.mean_interval(values) for values in (part["coverage"], part["ratio"], ratio))
        print(f"| {method} | {level:.0%} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
