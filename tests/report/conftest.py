"""Two studies as a report sees them: a simulation (7 models, 3 sizes, 2 seeds) and full scale (4 models, 1 size)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pytest

from shipid.report import AnswerSentence, ReportContent, WindowSnapshot
from shipid.report.page import DrawnSection, draw_sections
from shipid.report.sections import SECTIONS

NASTY = "<script>alert('x')</script>"
OUTLINE = np.array([[14.5, 0.0], [9.0, 4.8], [-14.4, 4.8], [-14.4, -4.8], [9.0, -4.8]])


@dataclass(frozen=True)
class Model:
    name: str
    family: str
    accuracy: float  # A [m], NaN without physics
    gain: float  # H at 10 manoeuvres [m]


SIMULATION = [
    Model("nominal", "nominal", 0.9, 0.62),
    Model("moderate-1", "moderate", 1.8, 0.8),
    Model("moderate-2", "moderate", 3.1, 1.1),
    Model("moderate-3", "moderate", 4.4, 1.4),
    Model("high-1", "high", 7.5, 2.2),
    Model("high-2", "high", 13.0, 4.6),
    Model("no physics", "none", np.nan, 3.6),
]
FULL_SCALE = [
    Model("accurate (Gunnerus, 28.9 m)", "accurate", 2.1, 0.94),
    Model("inaccurate", "inaccurate", 5.2, 2.05),
    Model(f"bare hull {NASTY}", "bare", 6.4, np.nan),
    Model("no physics", "none", np.nan, 4.3),
]


def _cells(models: list[Model], sizes: list[int], seeds: int, generator: np.random.Generator) -> pd.DataFrame:
    rows = []
    for model in models:
        for size in sizes:
            for seed in range(seeds):
                H = model.gain * (sizes[0] / size) ** 0.4 * (1 + 0.1 * generator.uniform(-1, 1) * (seeds > 1))
                bad = not np.isfinite(H)
                rows.append(
                    {
                        "cell": f"{model.name}/{size}/{seed}",
                        "model": model.name,
                        "family": model.family,
                        "member": 0,
                        "A": model.accuracy,
                        "A_90": 2.1 * model.accuracy,
                        "A_rms": 1.2 * model.accuracy,
                        "A_end": 2.3 * model.accuracy,
                        "A_end_90": 4.4 * model.accuracy,
                        "N_D": size,
                        "runs": size,
                        "minutes": size * 50 / 60,
                        "seed": seed,
                        "H_end": 2.4 * H,
                        "H_end_90": 4.8 * H,
                        "H": H,
                        "H_90": 2.2 * H,
                        "rms": 1.2 * H,
                        "status": "diverged" if bad else "ok",
                        "sentence": "4 % of the test windows left the sea" if bad else "",
                        "physics_diverged": 0.0,
                        "seconds": 41.5,
                        "hyperparameters": "2 layers of 120, drop-out 0.1, rate 2e-3",
                    }
                )
    return pd.DataFrame(rows)


def _errors(models: list[Model], sizes: list[int], axis: pd.DataFrame, growth: np.ndarray) -> pd.DataFrame:
    """Long frame of errors for every model, source and size along an axis."""
    parts = [axis.assign(model="", N_D=0, seed=0, source="naive", value=5.0 * growth)]
    for model in models:
        if np.isfinite(model.accuracy):
            value = model.accuracy * growth
            parts.append(axis.assign(model=model.name, N_D=0, seed=0, source="physics", value=value))
        if np.isfinite(model.gain):
            for size in sizes:
                value = model.gain * (sizes[0] / size) ** 0.4 * growth
                parts.append(axis.assign(model=model.name, N_D=size, seed=0, source="cooperative", value=value))
    return pd.concat(parts, ignore_index=True)


def _snapshots(
    models: list[Model], sizes: list[int], runs: list[str], times: np.ndarray, ahead: int
) -> list[WindowSnapshot]:
    steps, result = np.arange(ahead + 1.0), []
    for number, run in enumerate(runs):
        for t in times:
            rate = 0.03 * np.sin(t / 12 + number)
            psi = rate * steps
            truth = np.column_stack([np.cumsum(4.6 * np.cos(psi)), np.cumsum(4.6 * np.sin(psi))])
            truth -= truth[0]
            paths = {}
            for index, model in enumerate(models):
                drift = np.column_stack([0.4 * steps**2, (-1) ** index * steps**2]) / ahead**2
                if np.isfinite(model.accuracy):
                    paths[model.name, "physics", 0] = truth + 2.5 * model.accuracy * drift
                for size in sizes:
                    if np.isfinite(model.gain):
                        left = model.gain * (sizes[0] / size) ** 0.4
                        paths[model.name, "cooperative", size] = truth - 2.5 * left * drift
            wind = (5.3, 2.2) if len(sizes) > 1 else None
            result.append(WindowSnapshot(run, float(t), OUTLINE, float(psi[-1]), truth, paths, wind))
    return result


def _tracks(sets: dict[str, list[str]], generator: np.random.Generator) -> pd.DataFrame:
    parts = []
    for name, runs in sets.items():
        for run in runs:
            heading = generator.uniform(0, 2 * np.pi) + np.cumsum(np.full(160, generator.uniform(-0.03, 0.03)))
            start = generator.uniform(-300, 300, 2)
            north, east = start[0] + np.cumsum(2 * np.cos(heading)), start[1] + np.cumsum(2 * np.sin(heading))
            parts.append(pd.DataFrame({"run": run, "set": name, "north": north, "east": east}))
    return pd.concat(parts, ignore_index=True)


def _envelope(sets: list[str]) -> pd.DataFrame:
    quantities = [
        ("surge speed u", "m/s", 0.0, 2.3, 6.0),
        ("sway speed v", "m/s", -1.1, 0.0, 1.1),
        ("yaw rate r", "deg/s", -8.2, 0.0, 7.8),
        ("shaft speed n", "rpm", 50.0, 125.0, 200.0),
        ("azimuth angle", "deg", -49.0, -2.0, 49.0),
    ]
    rows = []
    for index, name in enumerate(sets):
        for quantity, unit, low, mean, high in quantities:
            wider = 1.2 if name == "test" and quantity.startswith("sway") else 1.0 - 0.02 * (len(sets) - index)
            rows.append((name, quantity, unit, low * wider, mean, high * wider))
    return pd.DataFrame(rows, columns=["set", "quantity", "unit", "min", "mean", "max"])


def _factors(models: list[Model], generator: np.random.Generator) -> pd.DataFrame:
    """Hull factors of moderate and high models, more of the high ones; the bare hull lost its thrusters' data."""
    rows = []
    for model in models:
        paths = {"moderate": 32, "high": 32, "bare": 2}.get(model.family, 0)
        for i in range(paths):
            factor = 0.0 if model.family == "bare" else generator.uniform(0.4, 1.6)
            rows.append((model.name, f"hull.derivatives.X_{i}", "hull", factor))
        if model.family == "high":
            for path, group in [
                ("inertia.m", "inertia"),
                ("inertia.I_z", "inertia"),
                ("added_mass.X_udot", "added mass"),
                ("added_mass.Y_vdot", "added mass"),
                ("thruster.*.propeller.D", "thruster"),
            ]:
                rows.append((model.name, path, group, generator.uniform(0.6, 1.4)))
    return pd.DataFrame(rows, columns=["model", "path", "group", "factor"])


def _trials(cells: pd.DataFrame, count: int, generator: np.random.Generator) -> pd.DataFrame:
    """A search whose error falls with the learning rate; every tenth trial is stopped, some diverge."""
    parts = []
    for cell in cells.itertuples():
        rate, decay = 10 ** generator.uniform(-4, -1.5, count), 10 ** generator.uniform(-4, 0, count)
        value = 0.3 * (1 + 0.8 * (np.log10(rate) + 2.2) ** 2) * np.exp(0.2 * generator.standard_normal(count))
        state = np.where(np.arange(count) % 10 == 9, "stopped", "complete")
        state = np.where(rate > 0.025, "diverged", state)
        value = np.where(state == "diverged", np.nan, value)
        best = np.nanargmin(np.where(state == "complete", value, np.inf))
        frame = {"cell": cell.cell, "model": cell.model, "N_D": cell.N_D, "seed": cell.seed, "number": np.arange(count)}
        frame |= {"state": state, "value": value, "epochs": 215, "seconds": 1.25, "chosen": np.arange(count) == best}
        frame |= {"learning_rate": rate, "weight_decay": decay, "units": 2.0 ** generator.integers(4, 8, count)}
        parts.append(pd.DataFrame(frame))
    return pd.concat(parts, ignore_index=True)


def _content(models: list[Model], sizes: list[int], seeds: int, runs: list[str], times: np.ndarray, ahead: int):
    generator = np.random.default_rng(7)
    seconds = pd.DataFrame({"ahead": np.arange(1.0, ahead + 1)})
    horizon = _errors(models, sizes, seconds, seconds.ahead.to_numpy() ** 1.5 / ahead**1.5 * 2.5)
    instants = pd.DataFrame([(run, t) for run in runs for t in times], columns=["run", "t"])
    over_time = _errors(models, sizes, instants, 1.0 + 0.5 * np.sin(instants.t.to_numpy() / 9))
    t = instants.t.to_numpy()
    azimuth = 20 * np.sign(np.sin(t / 14))
    commands = instants.assign(**{"port azimuth [deg]": azimuth, "starboard azimuth [deg]": 0.9 * azimuth})
    commands = commands.assign(**{"port shaft [rpm]": 145.0 + 0 * t, "starboard shaft [rpm]": 143.0 + 0 * t})
    training = [f"train-{i}" for i in range(3 * len(runs))]
    sets = {"train": training, "validation": [f"val-{i}" for i in range(2)], "test": runs}
    if len(sizes) == 1:
        sets = {"train, all folds": training, "test": runs}
    cells = _cells(models, sizes, seeds, generator)
    return ReportContent(
        title="How much does the cooperative model gain from physics and from data?",
        name="simulation" if len(sizes) > 1 else f"full-scale {NASTY}",
        answer=[
            AnswerSentence(
                "With 30 manoeuvres, a model of 3 m accuracy predicts with 0.6 m mean error [0.5, 0.7].", "gain"
            ),
            AnswerSentence("Errors grow to 3 m at the horizon, least for compensated models.", "horizon"),
            AnswerSentence("These data say nothing about waves."),
        ],
        findings=[
            {
                "id": "R1",
                "claim": "Cooperative beats its physics model.",
                "verdict": "confirmed",
                "evidence": "2.10 m to 0.94 m; 5.20 m to 2.05 m.",
            },
            {
                "id": "R2",
                "claim": "Inaccurate and compensated is as good as accurate alone.",
                "verdict": "undecided",
                "evidence": "2.05 m, 2.10 m.",
            },
            {
                "id": "R4",
                "claim": "Pure data-driven is worst over the whole horizon.",
                "verdict": "refuted",
                "evidence": "Not in the first 2 s.",
            },
        ],
        cells=cells,
        factors=_factors(models, generator),
        trials=_trials(cells, 12, generator),
        naive={"end": 11.6, "end_90": 22.0, "mean": 5.01, "p90": 11.2, "rms": 6.3},
        models=pd.DataFrame(
            {
                "A_along": [0.7 * model.accuracy for model in models],
                "A_across": [0.6 * model.accuracy for model in models],
                "model": [model.name for model in models],
                "family": [model.family for model in models],
                "A": [model.accuracy for model in models],
                "A_90": [2.1 * model.accuracy for model in models],
                "A_rms": [1.2 * model.accuracy for model in models],
                "status": "ok",
                "description": [f"family {model.family}" for model in models],
            }
        ),
        horizon=horizon.rename(columns={"value": "mean"}).assign(p90=lambda frame: 2 * frame["mean"]),
        over_time=over_time.rename(columns={"value": "error"}),
        commands=commands,
        best=models[0].name,
        snapshots=_snapshots(models, sizes, runs, times, ahead),
        tracks=_tracks(sets, generator),
        envelope=_envelope(["D_10", "D_30", "D_100", "published", "test"] if len(sizes) > 1 else list(sets)),
        repairs=pd.DataFrame(
            {
                "kind": ["repeated samples", "jump in position"],
                "column": ["t", "north"],
                "count": [412, 3],
                "note": ["dropped", "interpolated over 0.5 s"],
            }
        ),
        provenance={"shipid": "0.2.0", "study digest": "09f6a2c1d4e5b7a8", "seed": "0", "wall time": "2 h 10 min"},
        study_document='question = "How much?"\n\n[recipe]\ntrials = 50 # a < b & c\n',
        command="shipid study run simulation",
        frames={
            "kinds": pd.DataFrame(
                {"kind": "turning", "runs": 4, "model": models[0].name, "source": ["physics", "cooperative"]}
                | {"N_D": [0, sizes[-1]], "mean": [2.0, 0.8], "end": [4.0, 1.6]}
            )
        },
    )


@pytest.fixture(scope="session")
def simulation() -> ReportContent:
    runs = [f"turn-{i:03d}" for i in range(4)]
    return _content(SIMULATION, [10, 30, 100], 2, runs, np.arange(0.0, 50.0), 30)


@pytest.fixture(scope="session")
def full_scale() -> ReportContent:
    return _content(FULL_SCALE, [15], 1, ["zigzag 20/20"], np.arange(4150.0, 4330.0), 15)


@pytest.fixture(scope="session", params=["simulation", "full_scale"])
def content(request: pytest.FixtureRequest) -> ReportContent:
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="session")
def simulation_drawn(simulation: ReportContent) -> list[DrawnSection]:
    """Every section of the simulation, drawn once; not to be changed."""
    return draw_sections(SECTIONS, simulation)


@pytest.fixture(scope="session")
def full_scale_drawn(full_scale: ReportContent) -> list[DrawnSection]:
    """Every section of the full scale, drawn once; not to be changed."""
    return draw_sections(SECTIONS, full_scale)


@pytest.fixture(params=["simulation_drawn", "full_scale_drawn"])
def sections(request: pytest.FixtureRequest) -> list[DrawnSection]:
    """The sections of each study in turn."""
    return request.getfixturevalue(request.param)
