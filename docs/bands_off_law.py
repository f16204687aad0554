"""Bands and alarm where the runs are not those of the training: a table over laws.

`python docs/records.py bands-off-law python docs/bands_off_law.py RUN` trains moderate-1 of `quick` with 100 runs in
the folder RUN and predicts 120 fresh runs of each law: seven that are given, and five drawn from `FURTHER` by a seed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shipid import read_plan
from shipid.metrics import coverage_share, position_error
from shipid.predictor import Predictor
from shipid.study.prepare import all_windows, instants_of, obtain_runs
from shipid.study.run import run_study

CELL, LEVEL, SEED, DRAWN = "moderate-1+memory-N0100-s0", 0.9, 57, 5
TURNING = {"kind": "turning", "n_rpm": [50.0, 200.0], "alpha_deg": [-50.0, 50.0], "start_speed": [0.0, 2.5]}
Changes = Mapping[str, Any]


def orders(**changes: Any) -> Changes:
    """A law of other orders."""
    return {"truth.manoeuvre": [{**TURNING, **changes}]}


LAWS: Mapping[str, Changes] = {
    "the same law": {},
    "H_s 0.3 m for 1.0": {"truth.waves.H_s": 0.3},
    "H_s 2 m, T_p 6.5 s": {"truth.waves.H_s": 2.0, "truth.waves.T_p": 6.5},
    "T_p 9 s for 5": {"truth.waves.T_p": 9.0},
    "wind 8 to 14 m/s for 0 to 6": {"truth.wind_speed": [8.0, 14.0]},
    "200 to 240 rpm for 50 to 200": orders(n_rpm=[200.0, 240.0]),
    "orders in steps": orders(kind="steps"),
}
FURTHER: Mapping[str, Changes] = {
    "current 0.3 to 0.7 m/s": {"truth.set": {"current.kind": "uniform"}, "truth.current_speed": [0.3, 0.7]},
    "gusts": {"truth.gusts": {"kind": "npd"}},
    "zigzags": {
        "truth.manoeuvre": [
            {"kind": "zigzag", "n_rpm": [80.0, 150.0], "angle_deg": [10.0, 30.0], "execute_at": [22.0, 28.0]}
        ]
    },
    "start at 3 to 5 m/s for 0 to 2.5": orders(start_speed=[3.0, 5.0]),
    "thrusters at rest at the start": orders(actuators_at="rest"),
    "noise of u, v 0.05 m/s, r 0.003 rad/s": {
        "truth.sensors": {"u": {"noise": 0.05}, "v": {"noise": 0.05}, "r": {"noise": 0.003}}
    },
    "azimuths 50 to 65 deg for -50 to 50": orders(alpha_deg=[50.0, 65.0]),
    "20 to 45 rpm for 50 to 200": orders(n_rpm=[20.0, 45.0]),
    "thrusters apart": {
        "truth.manoeuvre": [
            {**{key: value for key, value in TURNING.items() if key != "n_rpm"},
             "port.n_rpm": [50.0, 200.0], "starboard.n_rpm": [50.0, 200.0]}
        ]
    },
    "one thruster lost": orders(**{"starboard.n_rpm": 0.0}),
    "H_s 0.1 m for 1.0": {"truth.waves.H_s": 0.1},
    "H_s 0.6 m for 1.0": {"truth.waves.H_s": 0.6},
    "T_p 4 s for 5": {"truth.waves.T_p": 4.0},
    "wind 5 to 8 m/s for 0 to 6": {"truth.wind_speed": [5.0, 8.0]},
}  # fmt: skip


def row_of_law(predictor: Predictor, changes: Changes, seed: int) -> list[str]:
    """Cells of a law: H, share of whole paths inside, of instants with alarm, of those of leaving paths, and width."""
    plan = read_plan("quick", {**changes, "truth.seed": seed})
    data = obtain_runs(plan)
    windows = all_windows(plan, data)
    instants = instants_of(plan.study, predictor.vessel, data, windows)
    given = predictor.predict(instants, level=LEVEL)
    missed = windows.future - given.paths
    holds, alarm = given.region.holds(missed), given.outside
    width = float(np.nanmean(given.region.radius))
    shares = [coverage_share(holds, windows.run), coverage_share(alarm, windows.run), alarm[~holds].mean()]
    error = position_error(
        given.paths[:, np.isfinite(missed).all(axis=(0, 2))], windows.future[:, np.isfinite(missed).all(axis=(0, 2))]
    )
    return [f"{error.mean():.2f}", *(f"{100 * share:.1f}" for share in shares), f"{width:.2f}"]


def main() -> None:
    """Train once, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="folder of the run, made where there is none")
    given = parser.parse_args()
    file = given.run / "cells" / f"{CELL}.npz"
    if not file.exists():
        for event in run_study(read_plan("quick", {"grid.N_D": [100]}), given.run, workers=1):
            print(event.text, file=sys.stderr)
    drawn = np.random.default_rng(SEED).choice([*FURTHER], DRAWN, replace=False).tolist()
    print(f"moderate-1 of `quick`, 100 runs, {LEVEL:.0%} of whole paths asked; 120 fresh runs each; the last {DRAWN} "
          f"laws are drawn by seed {SEED} from {len(FURTHER)}.\n")  # fmt: skip
    print("| fresh runs | H [m] | inside [%] | instants with alarm [%] | those of leaving paths [%] | width [m] |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    predictor = Predictor.load(file)
    for law in [*LAWS, *drawn]:
        cells = row_of_law(predictor, {**LAWS, **FURTHER}[law], 5919)
        print(f"| {law} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
