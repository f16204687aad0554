"""Similar ships as physics: the nearest three, scaled, against the first guess, on ships that are not among them.

`python docs/similar_ships.py compute FOLDER 1-30` keeps errors of bundled ships, each left out with all its variants,
and of ships drawn by seed with noise, current and gusts (`tests/strangers.py`); what is there is not computed again.
`python docs/records.py similar-ships python docs/similar_ships.py measure FOLDER 1-30` writes the record. What is known
of a ship are the options of `shipid vessel new`; with runs, `kernel` learns from five, and every ship
is ranked by its error on these.
"""

from __future__ import annotations

import argparse
import pickle
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from shipid.data.dataset import read_dataset, write_dataset
from shipid.errors import DivergenceError
from shipid.metrics import position_error
from shipid.study.cells import evaluate_cell, fit_method, work_of
from shipid.study.new import draft_study, proposed_horizon, survey_dataset
from shipid.study.plan import build_plan
from shipid.study.prepare import obtain_runs, prepare, runs_by_amount
from shipid.vessel.load import load_vessel
from shipid.vessel.similar import read_ships, similar_vessels, vessel_particulars
from shipid.vessel.stability import service_shaft

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.strangers import stranger
from tests.strangers_ships import options_of

BUNDLED = {  # that is left out: its variants, propulsor, shafts
    "gunnerus-33.9": ("gunnerus", "azimuth", 2),
    "kvlcc2-l7": ("kvlcc2", "propeller-rudder", 1),
    "container-175": ("container", "propeller-rudder", 1),
    "cybership2": ("cybership2", "propeller-rudder", 2),
    "esso-190k": ("esso", "propeller-rudder", 1),
    "mariner": ("mariner", "propeller-rudder", 1),
    "naval-51": ("naval", "propeller-rudder", 2),
    "supply-vessel": ("supply", "differential", 2),
}
UNKNOWN = {"cybership2": {"T": 0.1}, "supply-vessel": {"B": 18.8, "T": 6.25}, "gunnerus-33.9": {"U_0": 5.0}}
"""Particulars that the files of vessels do not give: CyberShip II (a guess), Northern Clipper, Gunnerus."""
RUNS, NEAREST, LOG_RUNS = 5, 3, 24
DRAWS = 2000  # of the bootstrap over ships
COLUMNS = {
    "near 1": "nearest",
    "near of 3": "median of three",
    "mean of 3": "mean path of three",
    "mean of 4": "mean path with the guess",
    "by log": "best of all by five runs",
    "mean by log": "mean path of the best three by five runs",
    "with runs, guess": "guess, five runs",
    "with runs, near 1": "nearest, five runs",
    "with runs, mean of 3": "mean of three, five runs",
    "with runs, mean of 4": "mean with the guess, five runs",
    "with runs, none": "no physics, five runs",
}


def bundled_options(name: str) -> dict[str, Any]:
    """Options of `shipid vessel new` for a bundled ship, its shaft speed at the service speed among them."""
    vessel, (_, propulsor, shafts) = load_vessel(name), BUNDLED[name]
    known = vessel.document["particulars"] | UNKNOWN.get(name, {})
    L, B, T, U = (float(known[key]) for key in ("L_pp", "B", "T", "U_0"))
    block = vessel.parameters["inertia.m"] / (vessel.document["constants"]["rho"] * L * B * T)
    sizes = {"length": L, "beam": B, "draught": T, "block": min(max(block, 0.4), 0.9)}
    sizes |= {"propeller-diameter": 6.7} if name == "mariner" else {}  # 22 feet: the guess is too small for 60 rpm
    rpm = 60 * (service_shaft(vessel, U) or 0.0)
    return sizes | {"speed": U, "rpm": rpm, "propulsor": propulsor, "shafts": shafts}


def log_of(ship: str, folder: Path) -> tuple[str, Sequence[str], str, list[str]]:
    """Words on a ship, options of its first guess, what is left out, and its runs; its log is written."""
    if ship in BUNDLED:
        options = [word for key, value in bundled_options(ship).items() for word in (f"--{key}", str(value))]
        plan = build_plan(tomllib.loads(draft_study([ship], None, folder / "truth.toml").text), folder / "truth.toml")
        dataset, words = obtain_runs(plan), load_vessel(ship).name
    else:
        drawn = stranger(int(ship), LOG_RUNS)
        options, dataset, words = options_of(drawn.known), drawn.dataset, drawn.words
    write_dataset(dataset, folder / "log.parquet")
    return words, options, BUNDLED.get(ship, ("",))[0], list(dataset.runs)


def compute_ship(ship: str) -> dict[str, Any]:
    """Words on a ship; what is near -> errors [m] of the physics alone on the test runs, and with five runs."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        words, options, without, runs = log_of(ship, folder)
        guess = folder / "guess.toml"
        command = [sys.executable, "-m", "shipid", "vessel", "new", *options, "--out", str(guess)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            return {"words": words, "fault": done.stderr.strip()}
        own, log = load_vessel(guess), folder / "log.parquet"
        ships = [one for one in read_ships() if not (without and one.key.startswith(without))]
        found = [*similar_vessels(vessel_particulars(own), ships, own)]
        files = {"guess": str(guess)}
        for place, (_, one) in enumerate(found, start=1):
            files[f"near-{place}"] = str(folder / f"near-{place}.toml")
            Path(files[f"near-{place}"]).write_text(tomlkit.dumps(one.document), encoding="utf-8")
        dataset = read_dataset(log)
        ahead, step, _ = proposed_horizon(own, survey_dataset(dataset))
        tests = np.random.default_rng(len(runs)).choice(runs, len(runs) // 3, replace=False).tolist()
        document: dict[str, Any] = {
            "question": "Which physics?",
            "data": {"dataset": str(log)},
            "split": {"test": tests, "folds": 1},
            "prediction": {
                "ahead": ahead,
                "step": step,
                "interval": round(ahead / 8 / step) * step,
                "integrator": "rk4",
            },
            "grid": {"N_D": [RUNS], "seeds": [0]},
            "method": [{"name": "kernel", "kind": "kernel"}],
        }
        near = [f"near-{place}" for place in range(1, NEAREST + 1)]
        document["method"][0]["families"] = ["guess", *near, "none"]
        document["method"].append({"name": "alone", "kind": "alone", "families": ["near-*"]})
        lost = list[str]()
        while True:
            document["family"] = [{"name": key, "base": file} for key, file in files.items() if key not in lost]
            plan = build_plan(document, folder / "study.toml")
            try:
                prepared = prepare(plan, dataset)
                break
            except DivergenceError as error:
                lost.append(str(error.path).removeprefix("family."))
    return {
        "words": words,
        "lost": lost,
        "near": [(one.key, one.name, distance) for distance, one in found],
    } | errors_of(plan, prepared)


def errors_of(plan: Any, prepared: Any) -> dict[str, Any]:
    """Errors [m] on the test of each physics and of means, alone and with five runs, and which is best on these."""
    known = prepared.known
    names = [name for name in known if name == "guess" or name.startswith("near-")]
    alone = {name: float(position_error(known[name].test_paths, prepared.test.future).mean()) for name in names}

    def mean_error(of: Sequence[str], by_name: Any = None) -> float:
        paths = np.mean([by_name[name] if by_name else known[name].test_paths for name in of], axis=0)
        return float(position_error(paths, prepared.test.future).mean())

    rows = np.isin(prepared.pool.run, runs_by_amount(plan.study, prepared.pool)[RUNS])
    on_runs = {name: float(position_error(known[name].paths, prepared.pool.future)[..., rows].mean()) for name in names}
    near, best = [f"near-{place}" for place in range(1, NEAREST + 1)], sorted(on_runs, key=on_runs.__getitem__)
    result = {
        "guess": alone["guess"],
        "near 1": alone["near-1"],
        "near of 3": float(np.median([alone[name] for name in near])),
        "mean of 3": mean_error(near),
        "mean of 4": mean_error(["guess", *near]),
        "by log": alone[best[0]],
        "mean by log": mean_error(best[:NEAREST]),
    }
    learned = dict[str, Any]()
    for unit in plan.units:
        work = work_of(prepared, unit, plan.methods, "cpu")
        fitted = {name: fit_method(work, way) for name, way in work.ways.items()}
        pairs = [pair for pair in unit.pairs if pair[1] == "kernel"]
        learned |= {pair[0]: evaluate_cell(work, pair, fitted, {}, {}).paths for pair in pairs}
    names = {"guess": ["guess"], "near 1": near[:1], "mean of 3": near, "mean of 4": ["guess", *near], "none": ["none"]}
    result |= {f"with runs, {key}": mean_error(of, learned) for key, of in names.items()}
    return {"errors": result, "alone": alone, "best": best[0]}


def ratio_words(values: Sequence[float]) -> str:
    """Median of ratios with its 95 % interval over ships, and on how many ships it is below 1."""
    known = np.array(values)
    draws = np.random.default_rng(0).integers(0, len(known), (DRAWS, len(known)))
    low, high = np.quantile(np.median(known[draws], axis=1), [0.025, 0.975])
    return f"{np.median(known):.2f} [{low:.2f}, {high:.2f}], lower on {(known < 1).sum()} of {len(known)}"


def main() -> None:
    """Compute the errors of ships, or print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["compute", "measure"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("seeds", help="first and last seed of drawn ships, such as 1-30")
    given = parser.parse_args()
    first, last = map(int, given.seeds.split("-"))
    given.folder.mkdir(parents=True, exist_ok=True)
    files = {ship: given.folder / f"{ship}.pkl" for ship in [*BUNDLED, *map(str, range(first, last + 1))]}
    if given.what == "compute":
        for ship, file in files.items():
            if not file.exists():
                file.write_bytes(pickle.dumps(compute_ship(ship)))
                print(ship, pickle.loads(file.read_bytes()), flush=True)
        return
    found = {ship: pickle.loads(file.read_bytes()) for ship, file in files.items()}
    for group in ("bundled", "drawn", "all"):
        rows = [one["errors"] for ship, one in found.items() if "errors" in one and group in ("all", kind_of(ship))]
        print(f"{group}, {len(rows)} ships: error over that of the first guess alone, median over ships\n")
        print("| what | ratio |\n| --- | --- |")
        for key, words in COLUMNS.items():
            print(f"| {words} | {ratio_words([row[key] / row['guess'] for row in rows])} |")
        pairs = [(f"with runs, {key}", "with runs, guess") for key in ("near 1", "mean of 3", "mean of 4", "none")]
        for key, other in pairs:
            print(f"| {COLUMNS[key]}, over guess, five runs | {ratio_words([row[key] / row[other] for row in rows])} |")
        print()
    print("| ship | nearest three (distance) | guess [m] | nearest | three | best by log |")
    print("| --- | --- | ---: | ---: | ---: | --- |")
    for ship, one in found.items():
        if "errors" not in one:
            print(f"| {ship}: {one['words']} | {one['fault']} | | | | |")
            continue
        near = ", ".join(f"{key} ({far:.2f})" for key, _, far in one["near"][:NEAREST])
        errors = one["errors"]
        cells = [f"{errors[key]:.3g}" for key in ("guess", "near 1", "mean of 3")]
        print(f"| {ship}: {one['words']} | {near} | {' | '.join(cells)} | {one['best']}, {errors['by log']:.3g} |")


def kind_of(ship: str) -> str:
    """Whether a ship is bundled or drawn."""
    return "bundled" if ship in BUNDLED else "drawn"


if __name__ == "__main__":
    main()
