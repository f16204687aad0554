"""The method of a draft: `kernel` against `path-drawn` on logs of drawn ships, by the test and by runs left out.

From the root of a checkout, `python docs/draft_methods.py compute FOLDER METHOD 101-110` keeps errors of a method in
worlds; what is there is not computed again. `python docs/records.py draft-methods python docs/draft_methods.py measure
FOLDER 101-110` writes the record. A world is a ship drawn by seed with its log of 12 to 38 runs; every third is R/V
Gunnerus in a drawn sea. The study is that which `shipid study new` writes for the template of such a ship, which is all
that the draft knows, with eight drawn runs as its test; both methods meet the same windows.

The rule, written before the worlds were drawn: the method of drafts is `kernel` where its H on the eight runs, which
are left out of all, is lower in the geometric mean over foundations and worlds at each of three amounts of data (4, 10,
all), and no 95 % interval over worlds lies above 0. Errors on folds of the training stand beside it: those of
`path-drawn` have chosen its settings, so they are too low.
"""

from __future__ import annotations

import argparse
import pickle
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student

from shipid import read_plan
from shipid.data.dataset import read_dataset, write_dataset
from shipid.errors import ShipidError
from shipid.metrics import position_error
from shipid.study.cells import evaluate_cell, fit_method, work_of
from shipid.study.new import draft_study
from shipid.study.plan import build_plan
from shipid.study.prepare import obtain_runs, prepare

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.strangers import stranger
from tests.strangers_ships import options_of

OLD, NEW = "path-drawn", "kernel"
FOLDS = {OLD: 0, NEW: 1}  # 0: as drafted, in thirds from six runs on; 1: every run is left out in its turn
AMOUNTS, TEST = (4, 10), 8  # runs, beside all
SEAS = 3  # every so many worlds one with waves
KINDS = ("turning", "steps", "zigzag")


def draw_log(seed: int, folder: Path) -> tuple[str, str, Path]:
    """Words on a world, the vessel that a draft takes, and its log."""
    random = np.random.default_rng([seed, 58])
    runs, log = int(random.integers(12, 39)), folder / "log.parquet"
    if seed % SEAS:
        ship = stranger(seed, runs)
        vessel = folder / "ship.toml"
        command = [sys.executable, "-m", "shipid", "vessel", "new", *options_of(ship.known), "--out", str(vessel)]
        subprocess.run(command, check=True, capture_output=True)
        write_dataset(ship.dataset, log)
        return f"{ship.words}, {runs} runs", str(vessel), log
    H_s, T_p, kind = random.uniform(0.3, 1.5), random.uniform(4.0, 8.0), str(random.choice(KINDS))
    orders: dict[str, Any] = {"kind": kind, "n_rpm": [60.0, 180.0]}
    if kind == "zigzag":
        orders |= {"angle_deg": [10.0, 30.0], "execute_at": [22.0, 28.0], "side": ["starboard", "port"]}
    else:
        orders |= {"alpha_deg": [-40.0, 40.0], "start_speed": [0.5, 2.5], "actuators_at": "order"}
    changes = {"truth.seed": seed, "truth.manoeuvres": runs, "truth.waves.H_s": H_s, "truth.waves.T_p": T_p,
               "truth.duration": 120.0, "truth.manoeuvre": [orders], "split.test": 1, "grid.N_D": [2]}  # fmt: skip
    write_dataset(obtain_runs(read_plan("quick", changes)), log)
    return f"R/V Gunnerus, {kind}, H_s {H_s:.1f} m, T_p {T_p:.1f} s, {runs} runs", "gunnerus-28.9", log


def method_block(kind: str, drafted: dict[str, Any]) -> dict[str, Any]:
    """The method of a draft as it was, or `kernel` with the same past and the positions in it."""
    memory = {name: value for name, value in drafted.get("memory", {}).items() if name != "positions"}
    if not memory:
        return {"name": kind, "kind": kind}
    past = sorted({*memory.get("history", []), *memory.get("turned", [])})
    more = {"memory": memory | {"positions": past[1:]}} if kind == NEW else {"choose": True, "memory": memory}
    return {"name": kind, "kind": kind, **more}


def compute_world(kind: str, seed: int) -> dict[str, Any]:
    """Words on a world; by N_D and foundation, errors (T, S, 2) [m] on runs left out, H [m], core-seconds."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        words, vessel, log = draw_log(seed, folder)
        try:
            document = tomllib.loads(draft_study([vessel], log, folder / "study.toml").text)
        except ShipidError as error:
            return {"words": f"{words}: no draft: {error.message}"}
        document["method"] = [method_block(kind, document["method"][0])]
        runs = read_dataset(log).runs
        document["split"]["folds"] = FOLDS[kind] or document["split"]["folds"]
        document["split"]["test"] = np.random.default_rng(seed).choice(runs, TEST, replace=False).tolist()
        total = len(runs) - TEST
        document["grid"] = {"N_D": sorted({*(one for one in AMOUNTS if one < total), total}), "seeds": [0]}
        plan = build_plan(document, folder / "study.toml")
        prepared = prepare(plan, read_dataset(log))
    found: dict[int, dict[str, tuple[Any, float, float]]] = {}
    for unit in plan.units:
        work = work_of(prepared, unit, plan.methods, "cpu")
        fitted = {name: fit_method(work, way) for name, way in work.ways.items()}
        place = unit.batch.N_D if unit.batch.N_D in AMOUNTS and total > unit.batch.N_D else 0
        for one, way in unit.pairs:
            row, result = evaluate_cell(work, (one, way), fitted, {}, {}).row, fitted[way][one]
            found.setdefault(place, {})[one] = result.left_out, row["H"], result.seconds
    return {"words": words, "errors": found}


def compare_world(old: dict[str, Any], new: dict[str, Any]) -> list[float]:
    """Logarithms of errors of NEW over OLD: left out and of the test, at each amount; NaN where there is none."""
    ratios = []
    for place in (*AMOUNTS, 0):
        rows = []
        for name, before in old["errors"].get(place, {}).items():
            pair = before, new["errors"][place][name]
            both = np.isfinite(np.stack([one[0] for one in pair])).all(axis=(0, 1, 3))
            left_out = [position_error(one[0][:, both], 0 * one[0][:, both]).mean() for one in pair]
            rows.append([left_out[1] / left_out[0], pair[1][1] / pair[0][1]])
        ratios += np.log(rows).mean(axis=0).tolist() if rows else [np.nan, np.nan]
    return ratios


def main() -> None:
    """Compute the errors of a method in worlds, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["compute", "measure"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("method", nargs="?", choices=[OLD, NEW])
    parser.add_argument("seeds", help="first and last seed, such as 101-110")
    given = parser.parse_args()
    first, last = map(int, given.seeds.split("-"))
    given.folder.mkdir(parents=True, exist_ok=True)
    files = {
        (kind, seed): given.folder / f"{kind}-{seed}.pkl" for kind in (OLD, NEW) for seed in range(first, last + 1)
    }
    if given.what == "compute":
        for (kind, seed), file in files.items():
            if kind == given.method and not file.exists():
                file.write_bytes(pickle.dumps(compute_world(kind, seed)))
        return
    heads = [f"{what}, {amount} runs" for amount in (*AMOUNTS, "all") for what in ("left out", "test")]
    print("H of `kernel` above that of `path-drawn` [%], geometric mean over foundations.\n")
    print(f"| world | {' | '.join(heads)} | core-seconds, old and new |")
    print("| --- |" + " ---: |" * (len(heads) + 1))
    every: list[list[float]] = []
    for seed in range(first, last + 1):
        old, new = (pickle.loads(files[kind, seed].read_bytes()) for kind in (OLD, NEW))
        if "errors" not in old:
            print(f"| {seed}: {old['words']} |" + "  |" * (len(heads) + 1))
            continue
        every.append(compare_world(old, new))
        cells = ["" if np.isnan(value) else f"{100 * np.expm1(value):+.0f}" for value in every[-1]]
        seconds = (sum(cell[2] for cells in one["errors"].values() for cell in cells.values()) for one in (old, new))
        cells.append(", ".join(f"{value:.1f}" for value in seconds))
        print(f"| {seed}: {old['words']} | {' | '.join(cells)} |")
    cells = []
    for column in np.array(every).T:
        known = column[np.isfinite(column)]
        half = student.ppf(0.975, len(known) - 1) * known.std(ddof=1) / np.sqrt(len(known))
        low, value, high = (100 * np.expm1(known.mean() + side * half) for side in (-1, 0, 1))
        cells.append(f"{value:+.0f} [{low:+.0f}, {high:+.0f}], lower in {(known < 0).sum()} of {len(known)}")
    print(f"| mean | {' | '.join(cells)} | |")


if __name__ == "__main__":
    main()
