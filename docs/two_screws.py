"""Drawn craft of two screws without a rudder, from a raw log by the default path, against a regression.

`python docs/records.py two-screws python docs/two_screws.py FOLDER` from the root of a checkout. Each craft is an Otter
of 1 to 6 m with other numbers, in a current that nobody measured; a raw log of 14 runs; the guess of the craft has
other numbers again. The commands are `data import --guess`, `data import`, `identify`, `study new`; the study has
four drawn runs as its test, and trains on 4 and on 10 runs.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomlkit

from shipid import read_plan
from shipid.engine.rollout import rollout
from shipid.metrics import position_error
from shipid.simulation.log import log_columns
from shipid.study.results import read_results
from shipid.study.run import run_study
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.identification import drawn_logs

CRAFT, ROWS, RUNS, HELD = 10, 120, 14, 12
MASSES = ("inertia.m", "inertia.I_z", "added_mass.X_udot", "added_mass.Y_vdot", "added_mass.N_rdot")
IDENTIFY = ["--parameters", "hull.derivatives.*,hull.crossflow.C_d"]


def draw_craft(seed: int) -> tuple[str, Vessel, pd.DataFrame]:
    """Words on a craft, the guess of it, and its raw log."""
    random = np.random.default_rng([seed, 581])
    base, length = load_vessel("otter"), float(np.exp(random.uniform(np.log(1.0), np.log(6.0))))
    speed = float(random.uniform(0.08, 0.2)) * np.sqrt(9.81 * length)

    def factor(spread: float) -> float:
        return float(np.exp(random.normal(0, spread)))

    def other_numbers(vessel: Vessel, hull: float, screws: float) -> Vessel:
        known = vessel.parameters
        values = {
            path: known[path] * factor(hull)
            for path in known
            if path.startswith(("hull.derivatives", "hull.crossflow.C_d"))
        }
        values |= {path: known[path] * factor(0.15) for path in MASSES}
        both = factor(screws)
        return vessel.with_values(values | {path: known[path] * both for path in known if path.endswith("T_nn")})

    truth = other_numbers(drawn_logs.scaled_vessel(base, length / float(base.length or 1)), 0.3, 0.2)
    guess = other_numbers(truth, 0.35, 0.2)
    step = round(0.15 * length / speed, 2) or 0.05
    drawn_logs.ROWS, drawn_logs.RUNS, drawn_logs.TESTS, drawn_logs.HELD = ROWS, RUNS, 0, HELD
    orders = drawn_logs._orders(truth, speed, random)
    towards, current = random.uniform(-np.pi, np.pi), random.uniform(0.03, 0.12) * speed
    model = vessel_dynamics(sea := truth.with_values({"current.kind": "uniform"}))
    weather = {name: np.zeros(RUNS) for name in model.environment}
    weather |= {"V_c": np.full(RUNS, current), "beta_c": np.full(RUNS, towards)}
    start = {name: np.zeros(RUNS) for name in model.state}
    start |= {"psi": random.uniform(-3, 3, RUNS), "u": speed * random.uniform(0.6, 1, RUNS)}
    before = {name: values[:-1] for name, values in orders.items()}
    path = rollout(sea, start, before, weather, step=step, num_steps=ROWS - 1, method="rk4", engine="casadi")
    noise = float(np.exp(random.uniform(np.log(0.005), np.log(0.02))))
    spread = {"u": speed, "v": speed, "r": speed / length, "psi": 0.3, "north": 0.1 * length, "east": 0.1 * length}
    seen = {
        name: values + random.normal(0, noise * spread.get(name, 0.0), values.shape)
        for name, values in log_columns(path, model.state).items()
    }
    frames = [
        pd.DataFrame(
            {"run": f"run{run:02d}", "time [s]": np.round(step * np.arange(ROWS), 3),
             "north [m]": seen["north"][:, run], "east [m]": seen["east"][:, run],
             "heading [deg]": np.degrees(seen["psi"][:, run]) % 360, "u [m/s]": seen["u"][:, run],
             "v [m/s]": seen["v"][:, run], "yaw rate [deg/s]": np.degrees(seen["r"][:, run]),
             "port rpm [rpm]": orders["port.n"][:, run] * 60, "starboard rpm [rpm]": orders["starboard.n"][:, run] * 60}
        )
        for run in range(RUNS)
    ]  # fmt: skip
    return f"{length:.1f} m, {speed:.2f} m/s, rows {step:g} s apart", guess, pd.concat(frames)


def command(folder: Path, *words: str) -> str:
    """Type a command in a folder; what it says last where it fails."""
    done = subprocess.run([sys.executable, "-m", "shipid", *words], cwd=folder, capture_output=True, text=True)
    (folder / "commands.txt").open("a").write(f"$ shipid {' '.join(words)}\n{done.stdout}{done.stderr}")
    return done.stderr.strip().splitlines()[-1] if done.returncode else ""


def errors_of_craft(folder: Path, guess: Vessel, log: pd.DataFrame) -> tuple[str, dict[int, Any]]:
    """What `identify` says where it fails; by amount of data the H of regression, and of the models."""
    folder.mkdir(parents=True)
    (folder / "guess.toml").write_text(tomlkit.dumps(json.loads(json.dumps(guess.document))))
    log.to_csv(folder / "log.csv", index=False)
    faults = [
        command(folder, "data", "import", "--guess", "log.csv", "--vessel", "./guess.toml", "--out", "map.toml"),
        command(folder, "data", "import", "map.toml", "log.csv", "--out", "log.parquet"),
        command(folder, "study", "new", "--vessel", "./guess.toml", "--data", "log.parquet", "--out", "study.toml"),
    ]
    if any(faults):
        raise SystemExit("; ".join(faults))
    fault = command(folder, "identify", "./guess.toml", "log.parquet", *IDENTIFY, "--out", "identified.toml")
    changes = {"grid.N_D": [4, 10], "grid.seeds": [0], "split.test": 4}
    for _ in run_study(read_plan(folder / "study.toml", changes), folder / "run", workers=1):
        pass
    results, errors = read_results(folder / "run"), {}
    for batch in results.plan.batches:
        cells = results.judged_cells[results.judged_cells["N_D"].eq(batch.N_D)]
        rival = position_error(results.regression[batch.key], results.test.future).mean()
        errors[batch.N_D] = float(rival), dict(zip(cells["foundation"], cells["H"], strict=True))
    return fault, errors


def main() -> None:
    """Print a row a craft."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="new folder for logs, studies and runs")
    folder = parser.parse_args().folder
    print("H [m] of a regression, and of the draft: the guess, the guess made inaccurate, no physics.\n")
    print("| craft | 4 runs | 10 runs | `identify` |\n| --- | --- | --- | --- |")
    lower: dict[int, int] = {}
    for seed in range(CRAFT):
        words, guess, log = draw_craft(seed)
        fault, errors = errors_of_craft(folder / str(seed), guess, log)
        cells = []
        for N_D in sorted(errors):
            rival, models = errors[N_D]
            lower[N_D] = lower.get(N_D, 0) + (models["guess"] <= rival)
            cells.append(f"{rival:.3f}: {', '.join(f'{value:.3f}' for value in models.values())}")
        print(f"| {seed}: {words} | {' | '.join(cells)} | {fault or 'ok'} |", flush=True)
    counts = ", ".join(f"{count} of {CRAFT} with {N_D} runs" for N_D, count in lower.items())
    print(f"\nThe guess is at most the regression on {counts}.")


if __name__ == "__main__":
    main()
