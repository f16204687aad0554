"""Twelve made-up ships, from their raw files to a report by the commands of the README, without an edit of any file.

`python -m tests.benchmarks strangers`. Each ship has a folder, in which the command line is called as a user would:
the log is drafted, imported and checked, the vessel guessed from what people know, a study written and run. For each:
the stage reached, commands, questions, time; mean error of physics alone and compensated over that of constant u, v, r,
with known commands, at the proposed horizon and at twice that, and of the vessel that made the log; wrong guesses.

The study that runs has all runs and one seed, and predicts at every third instant: the rest of the learning curve
takes longer and says nothing of these errors. `--whole` runs it as `study new` wrote it, too.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset
from shipid.data.windows import constant_motion
from shipid.hybrid.physics import Physics
from shipid.metrics import position_error
from shipid.study.plan import Plan, read_plan
from shipid.study.prepare import obtain_runs, partition, path_source, window_memory
from shipid.study.results import read_results
from shipid.vessel.load import load_vessel
from tests.logs.judged_raw import judge_raw
from tests.strangers_raw import RawStranger, raw_stranger
from tests.strangers_ships import options_of
from tests.study.tiny import run_here

FIRST, SHIPS = 20261122, 12
GOAL, NEAR = 0.25, 1.3  # of constant u, v, r; of the true vessel, where that is above the goal
FEWER = 3  # times as long between instants of prediction as in the study
STAGES = ("vessel", "draft", "import", "check", "study", "report")
WHOLE = "the study as written"  # a further stage, if asked for
HORIZONS = {"1x": 1, "2x": 2}
FRAMES = {"xy": "ned", "ned": "ned", "enu": "enu", "zup": "zup", "ros": "ros"}  # of a team -> what it answers
TEN = 10.0  # s between rows, at most, where runs are compared


class Stopped(Exception):
    """A command failed: its stage and last line."""


@dataclass
class Desk:
    """A person at the command line, in a folder: what was typed, and what came of it."""

    folder: Path
    commands: list[str] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    questions: list[str] = field(default_factory=list)
    stage: str = ""

    def type(self, stage: str, *words: str, allowed: Sequence[int] = (0,)) -> dict[str, Any]:
        """Run a command and return what it answers; Stopped where it fails."""
        self.commands.append(" ".join(words))
        begun = time.perf_counter()
        environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).parents[2])}
        done = subprocess.run(
            [sys.executable, "-m", "shipid", *words], cwd=self.folder, env=environment, capture_output=True, text=True
        )
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begun
        (self.folder / f"{stage}.txt").write_text(f"$ shipid {' '.join(words)}\n{done.stdout}{done.stderr}")
        if done.returncode not in allowed:
            raise Stopped(f"{stage}: {(done.stderr or done.stdout).strip().splitlines()[-1]}")
        self.stage = stage
        answer: dict[str, Any] = json.loads(done.stdout) if "--json" in words else {}
        return answer


def run(ships: int = SHIPS, first: int = FIRST, whole: bool = False, folder: Path | None = None) -> dict[str, Any]:
    """Figures of all ships, failures included; what they left is kept in `folder`, if one is given."""
    figures: dict[str, Any] = {}
    passed = dict.fromkeys(HORIZONS, 0)
    reports = silent = 0
    for seed in range(first, first + ships):
        with tempfile.TemporaryDirectory() as name:
            outcome = one(seed, (folder or Path(name)) / str(seed), whole=whole)
        reports += outcome["stage"] in (STAGES[-1], WHOLE)
        silent += len(outcome["silent"])
        for far in HORIZONS:
            passed[far] += outcome.get(far, {}).get("passed", False)
        figures |= {f"{seed} {key}": value for key, value in words_of(outcome).items()}
        print(json.dumps(outcome), *words_of(outcome).values(), sep="\n", file=sys.stderr, flush=True)
    figures["reports"] = f"{reports} of {ships}"
    figures["within the goal at the proposed horizon, at twice that"] = f"{passed['1x']}, {passed['2x']} of {ships}"
    figures["wrong guesses that nothing says"] = silent
    return figures


def words_of(outcome: dict[str, Any]) -> dict[str, str]:
    """An outcome in words, for a table."""
    minutes = {key: value / 60 for key, value in outcome["seconds"].items()}
    last, whole = minutes.pop(STAGES[-1], 0.0), minutes.pop(WHOLE, 0.0)
    words = {
        "": f"{outcome['words']}; {outcome['stage']}{': ' * bool(outcome['failed'])}{outcome['failed']}; "
        f"{len(outcome['commands'])} commands, {len(outcome['questions'])} questions, "
        f"{sum(minutes.values()):.1f} min to the study, {last:.1f} min for it"
        f"{f', {whole:.1f} min as written' if whole else ''}",
        "wrong": f"said: {'; '.join(outcome['said']) or '-'} | silent: {'; '.join(outcome['silent']) or '-'}"[:600],
    }
    for far in HORIZONS:
        if far in outcome:
            numbers = outcome[far]
            words[far] = (
                f"{numbers['ahead']:g} s: alone {numbers['alone']:.2f}, "
                f"compensated {numbers['compensated']:.2f}, without physics {numbers['none']:.2f}, true vessel "
                f"{numbers['true']:.2f} of {numbers['constant']:.3g} m{'' if numbers['passed'] else ' MISSED'}"
            )
    return words


def one(seed: int, folder: Path, whole: bool = False) -> dict[str, Any]:
    """What came of one ship."""
    ship = raw_stranger(seed, folder / "raw")
    desk = Desk(folder)
    outcome: dict[str, Any] = {"seed": seed, "words": ship.words, "team": ship.style["team"], "failed": ""}
    said: list[str] = []
    silent: list[str] = []
    try:
        drafted = _to_the_study(ship, desk)
        for far, times in HORIZONS.items():
            outcome[far] = _studied(ship, desk, times, STAGES[-1])
        if whole:
            desk.type(WHOLE, "study", "run", "study.toml", "--workers", "1")
        _judged(drafted, outcome["1x"], said, silent)
    except Stopped as error:
        outcome["failed"] = str(error)
    except Exception as error:  # of the benchmark itself; the others go on
        outcome["failed"] = f"{desk.stage}: {type(error).__name__}: {error}"
    if "draft" in desk.seconds:
        known = {"frame": FRAMES[ship.style["frame"]]} if (folder / "answered.toml").exists() else {}
        verdict = judge_raw(ship, vessel=load_vessel(str(folder / "ship.toml")), **known)
        for reason in verdict.reasons:
            (silent if reason.startswith("SILENT") else said).append(reason.partition(": ")[2] or reason)
    shown = {"stage": desk.stage, "commands": desk.commands, "seconds": desk.seconds, "questions": desk.questions}
    return outcome | shown | {"said": said, "silent": silent}


def _to_the_study(ship: RawStranger, desk: Desk) -> list[str]:
    """Draft, import, check, vessel, study; returns the warnings about the vessel."""
    desk.type("vessel", "vessel", "new", *options_of(ship.known), "--out", "ship.toml")
    drafting = ("data", "import", "--guess", "raw", "--vessel", "./ship.toml", "--json", "--out")
    asked = desk.type("draft", *drafting, "log.toml")["questions"]
    desk.questions += asked
    if any("--frame" in question for question in asked):
        desk.type("draft", *drafting, "answered.toml", "--frame", FRAMES[ship.style["frame"]])
    mapping = "answered.toml" if (desk.folder / "answered.toml").exists() else "log.toml"
    desk.type("import", "data", "import", mapping, "raw", "--out", "log.parquet")
    desk.type("check", "data", "check", "log.parquet", allowed=(0, 1))
    words = ("study", "new", "--vessel", "./ship.toml", "--data", "log.parquet", "--out", "study.toml", "--json")
    return list(desk.type("study", *words)["warnings"])


def _judged(warnings: Sequence[str], numbers: dict[str, Any], said: list[str], silent: list[str]) -> None:
    """Whether the guess of the vessel is wrong, and whether `study new` says so."""
    if numbers["alone"] > 1.0:
        words = f"vessel: alone {numbers['alone']:.2f} of constant u, v, r"
        (said if any("constant u, v, r" in warning for warning in warnings) else silent).append(words)


def _studied(ship: RawStranger, desk: Desk, times: int, stage: str) -> dict[str, Any]:
    """Run the study at `times` its horizon, and return its errors."""
    document = tomllib.loads((desk.folder / "study.toml").read_text())
    prediction = document["prediction"]
    changes: dict[str, Any] = {
        "prediction.commands": "known", "prediction.ahead": times * prediction["ahead"],
        "prediction.interval": FEWER * prediction["interval"], "grid.N_D": document["grid"]["N_D"][:1],
        "grid.seeds": [0],
    }  # fmt: skip
    plan = read_plan(str(desk.folder / "study.toml"), changes)
    left = len(partition(plan, obtain_runs(plan))[0].spans)  # fewer at a longer horizon, if some runs are short
    changes["grid.N_D"] = [min(left, document["grid"]["N_D"][-1])]
    words = [word for path, value in changes.items() for word in ("--set", f"{path}={json.dumps(value)}")]
    folder = desk.folder / f"results-{times}"
    plan = read_plan(str(desk.folder / "study.toml"), changes)
    if times > 1:  # no part of the way to a report
        run_here(plan, folder)
        return figures_of(ship, plan, folder)
    desk.type(stage, "study", "run", "study.toml", *words, "--out", folder.name, "--workers", "1")
    if not (folder / "report.html").exists():
        raise Stopped(f"{stage}: no report")
    return figures_of(ship, plan, folder)


def figures_of(ship: RawStranger, plan: Plan, folder: Path) -> dict[str, Any]:
    """Errors over that of constant u, v, r, on the test runs."""
    results = read_results(folder)
    cells, imported = results.judged_cells, results.dataset
    _, test, _ = partition(plan, imported)
    constant = float(position_error(constant_motion(test), test.future).mean())
    with_physics = cells[cells["family"] != "none"]
    losses = [
        min((t["value"] for t in trials if t["value"] is not None), default=np.inf) for trials in with_physics["trials"]
    ]
    best = with_physics.iloc[int(np.argmin(losses))]  # by validation
    known = true_dataset(ship, imported, list(test.spans))
    _, seen, _ = partition(plan, known)
    physics = Physics(ship.truth, seen.horizon, seen.step, "rk4", None, path_source(plan.study))
    paths = physics.paths(seen.instants(known=True, hidden=window_memory(ship.truth, known, seen)))
    true = float(position_error(paths, seen.future).mean())
    numbers = {
        "ahead": test.horizon * test.step, "constant": constant, "alone": with_physics.iloc[0]["A"] / constant,
        "compensated": best["H"] / constant, "family": str(best["family"]), "true": true / constant,
        "none": float(cells[cells["family"] == "none"]["H"].min()) / constant,
    }  # fmt: skip
    bound = GOAL if numbers["true"] <= GOAL else NEAR * numbers["true"]
    return numbers | {"passed": bool(numbers["compensated"] <= bound)}


def true_dataset(ship: RawStranger, imported: Dataset, tests: Sequence[str]) -> Dataset:
    """Imported runs as the true vessel needs them: with its orders, at its origin, on its side of a mirrored frame.

    Instants and errors of the instruments stay. Runs that are not in `tests` are as they were, with orders of 0.
    """
    names = [*ship.dataset.commands, *(name for name in ("V_w", "beta_w") if name in ship.dataset.frame)]
    frame = imported.frame.copy()
    frame = frame.drop(columns=[name for name in ("V_w", "beta_w") if name in frame])
    for name in names:
        frame[name] = 0.0
    order = [run for file in sorted(ship.files, key=lambda one: Path(one.path)) for run in file.runs]
    same = len(order) == len(imported.runs)  # or the import has cut the files in another way
    named = dict(zip(imported.runs, order, strict=True)) if same else {}
    found = {way: [_match(ship, frame[frame["run"] == run], way, named.get(run)) for run in tests] for way in (1, -1)}
    mirrored = sum(one[2] for one in found[-1]) < sum(one[2] for one in found[1])
    matched = dict(zip(tests, found[-1 if mirrored else 1], strict=True))
    if mirrored:
        frame[["east", "psi", "v", "r"]] *= -1.0
    truths = []
    for run, (name, shift, _) in matched.items():
        rows = frame["run"] == run
        true = ship.record[ship.record["run"] == name]
        t = (frame.loc[rows, "t"] - frame.loc[rows, "t"].iloc[0] + shift).to_numpy()
        states = {key: np.interp(t, true["t"], true[key]) for key in ("north", "east", "v", "r")}
        states["psi"] = np.interp(t, true["t"], np.unwrap(true["psi"]))
        truths.append(pd.DataFrame(states, index=frame.index[rows]))
        held = np.clip(np.searchsorted(true["t"], t + 1e-6, side="right") - 1, 0, len(true) - 1)
        for key in names:
            frame.loc[rows, key] = ship.dataset.frame.loc[true.index, key].to_numpy()[held]
    _to_origin(frame, truths)
    return replace(imported, frame=frame)


def _match(ship: RawStranger, rows: pd.DataFrame, way: int, known: str | None) -> tuple[str, float, float]:
    """The true run of an imported one, mirrored if `way` is -1: its name, s after its begin, and how far off it is.

    Yaw rate and speed decide, about parts of a step the heading: it is not late.
    """
    t = (rows["t"] - rows["t"].iloc[0]).to_numpy()
    step = min(TEN, float(ship.known["length"]) / float(np.hypot(rows["u"], rows["v"]).mean()) / 10)
    grid = np.arange(0.0, t[-1], step)
    r, u = (np.interp(grid, t, rows[name]) for name in ("r", "u"))
    runs = {str(name): true for name, true in ship.record.groupby("run", sort=False)}

    def cost(name: str, shift: float) -> float:
        true = runs[name]
        at = np.clip(grid + shift, 0.0, float(true["t"].iloc[-1]))
        off = np.mean((np.interp(at, true["t"], true["u"]) - u) ** 2) / np.mean(u**2)
        turned = np.interp(at, true["t"], true["r"])
        return float(off + np.mean((turned - way * r) ** 2) / max(np.mean(r**2), 1e-12))

    coarse = [
        (name, shift)
        for name, true in runs.items()
        if known in (None, name)
        for shift in np.arange(-2 * step, max(float(true["t"].iloc[-1]) - t[-1], 0.0) + 3 * step, step)
    ]
    name, about = min(coarse, key=lambda one: cost(*one))
    true, psi = runs[name], way * np.interp(grid, t, rows["psi"])
    heading = np.unwrap(true["psi"])
    shifts = about + step * np.linspace(-1, 1, 41)
    off = [float(np.std(np.interp(grid + shift, true["t"], heading) - psi)) for shift in shifts]
    return name, float(shifts[int(np.argmin(off))]), cost(name, about)


def _to_origin(frame: pd.DataFrame, truths: Sequence[pd.DataFrame]) -> None:
    """Turn the frame of imported rows to that of the truth, and move positions and velocities to its origin."""
    true = pd.concat(truths)
    rows = frame.loc[true.index]
    turned = float(np.angle(np.mean(np.exp(1j * (true["psi"] - rows["psi"])))))
    if abs(turned) > np.radians(20):  # another north; less is an error of the instrument
        place = (frame["north"] + 1j * frame["east"]).to_numpy() * np.exp(1j * turned)
        frame["north"], frame["east"], frame["psi"] = place.real, place.imag, frame["psi"] + turned
        rows = frame.loc[true.index]
    ahead = np.exp(1j * true["psi"].to_numpy())
    off = (rows["north"] - true["north"] + 1j * (rows["east"] - true["east"])).to_numpy()
    groups = rows["run"].to_numpy()
    inner, outer = ahead.copy(), off.copy()
    for run in np.unique(groups):
        inner[groups == run] -= ahead[groups == run].mean()
        outer[groups == run] -= off[groups == run].mean()
    arm = complex(np.vdot(inner, outer) / np.vdot(inner, inner))
    place = arm * np.exp(1j * frame["psi"].to_numpy())
    frame["north"], frame["east"] = frame["north"] - place.real, frame["east"] - place.imag
    swing = float(np.dot(rows["v"] - true["v"], true["r"]) / np.dot(true["r"], true["r"]))
    frame["v"] = frame["v"] - swing * frame["r"]


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    for chosen in map(int, sys.argv[2:]):
        run(1, chosen, folder=Path(sys.argv[1]))
