from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.data.windows import cut_windows, run_folds
from shipid.hybrid.method import Case, Task
from shipid.hybrid.physics import Physics
from shipid.hybrid.regression import MARGIN, Regression, RegressionProblem, law_terms, successive_windows
from tests.drawn import seeds

STEP = 1.0
NAMES = ("u", "v", "r", "port.n", "rudder.delta")
SMALL = np.array([2.0, 0.3, 0.1])  # m/s, m/s, rad/s


def drawn_law(random: np.random.Generator) -> np.ndarray:
    """Weights (M, 3) of a ship that is damped: surge feels what is even in the mirror, sway and yaw what is odd."""
    table = {name: random.uniform(-1, 1, 4) for name in NAMES}
    image = {name: values * (-1.0 if name in ("v", "r", "rudder.delta") else 1.0) for name, values in table.items()}
    even = np.array([np.allclose(a, b) for a, b in zip(law_terms(table, NAMES), law_terms(image, NAMES), strict=True)])
    odd = np.array([np.allclose(a, -b) for a, b in zip(law_terms(table, NAMES), law_terms(image, NAMES), strict=True)])
    weights = 0.002 * random.normal(size=(len(even), 3)) * np.stack([even, odd, odd], axis=1) * SMALL
    for place in range(3):
        weights[1 + place, place] = random.uniform(-0.3, -0.1)
    weights[[term_place("port.n"), term_place("rudder.delta")], [0, 2]] = random.uniform(0.1, 0.3), 0.05
    return weights


def term_place(name: str) -> int:
    """Place of the term that is an order alone."""
    marked = {other: np.full(1, 1e-3 if other == name else 0.0) for other in NAMES}
    return int(np.argmax([abs(float(term[0])) * (k > 0) for k, term in enumerate(law_terms(marked, NAMES))]))


def log_of(weights, current, random, runs=6, seconds=60, noise=0.0) -> Dataset:
    """Runs that obey a law to the last digit, step by step; places are the trapezoid of the velocities."""
    frames = []
    for run in range(runs):
        nu, psi, place = random.uniform(-1, 1, 3) * SMALL + [1.0, 0, 0], random.uniform(-3, 3), np.zeros(2)
        order = {"port.n": random.uniform(0.2, 1.5), "rudder.delta": random.uniform(-0.6, 0.6)}
        rows = []
        for t in range(seconds + 1):
            if t % 15 == 14:
                order = {"port.n": random.uniform(0.2, 1.5), "rudder.delta": random.uniform(-0.6, 0.6)}
            rows.append({"t": float(t), "north": place[0], "east": place[1], "psi": psi,
                         **dict(zip("uvr", nu, strict=True)), **order})  # fmt: skip
            turn = rotation(psi)
            through = nu - np.append(turn.T @ current, 0)
            table = {**dict(zip("uvr", through, strict=True)), **order}
            after = through + STEP * np.array(law_terms(table, NAMES)) @ weights
            later = psi + STEP / 2 * (nu[2] + after[2])
            over_ground = after + np.append(rotation(later).T @ current, 0)
            place = place + STEP / 2 * (turn @ nu[:2] + rotation(later) @ over_ground[:2])
            nu, psi = over_ground, later
        frames.append(pd.DataFrame(rows).assign(run=f"R{run}", flags=0))
    frame = pd.concat(frames, ignore_index=True)
    for name in "uvr":
        frame[name] += noise * random.normal(size=len(frame)) * frame[name].std()
    return Dataset(frame, {"clock": "run"})


def rotation(psi: float) -> np.ndarray:
    c, s = np.cos(psi), np.sin(psi)
    return np.array([[c, -s], [s, c]])


def task_of(windows, seed=0) -> Task:
    physics = Physics(None, windows.horizon, windows.step)
    folds = run_folds(windows, "runs", seed, 5)
    return Task(
        {"none": Case(physics, np.zeros_like(windows.future))}, windows, folds, tuple(windows.planned), True, seed
    )


def learned(windows, method=None):
    task = task_of(windows)
    return task.cases["none"].physics, (method or Regression()).fit(task)["none"].corrector


def split(dataset, horizon=20):
    windows = cut_windows(dataset, horizon=horizon, interval=5.0)
    test = windows.run == "R0"
    return windows.select(~test), windows.select(test)


@pytest.mark.parametrize("seed", seeds(3, 30))
def test_a_law_that_is_linear_in_its_numbers_is_found_to_the_last_digits(seed: int) -> None:
    random = np.random.default_rng([seed, 5])
    train, test = split(log_of(drawn_law(random), np.zeros(2), random, runs=12))
    physics, corrector = learned(train, Regression(ridge=(1e-13,), steps=1))
    paths = corrector.predict(physics, test.instants(known=True), np.empty(0))
    scale = np.hypot(*np.moveaxis(test.future, -1, 0)).max()
    starts = np.stack([test.columns[name] for name in "uvr"], axis=1)
    inside = ((starts > corrector.low) & (starts < corrector.high)).all(axis=1)
    assert inside.mean() > 0.7
    assert np.abs(paths - test.future)[:, inside].max() < 1e-4 * scale


@pytest.mark.parametrize("seed", seeds(3, 30))
def test_a_steady_current_is_found(seed: int) -> None:
    random = np.random.default_rng([seed, 9])
    current = random.uniform(-0.3, 0.3, 2)
    train, _ = split(log_of(drawn_law(random), current, random, runs=12))
    problem = RegressionProblem(Regression(), task_of(train), "none")
    found = problem.fit_current()
    assert np.hypot(*(found - current)) < 0.3 * np.hypot(*current) + 0.02


@pytest.mark.parametrize("seed", seeds(3, 30))
def test_errors_left_out_are_by_laws_of_the_other_runs(seed: int) -> None:
    random = np.random.default_rng([seed, 12])
    train, _ = split(log_of(drawn_law(random), np.zeros(2), random, noise=0.2))
    task, method = task_of(train), Regression(ridge=(1e-3,))
    fit = method.fit_one(task, "none", left_out=True)
    problem, physics = RegressionProblem(method, task, "none"), task.cases["none"].physics
    for training, judged in task.folds:
        law = replace(fit.corrector, weights=problem.laws([training])[0, [fit.corrector.current.any() * 1]])
        paths = law.predict(physics, task.instants("none").select(judged), np.empty(0))
        np.testing.assert_allclose(train.future[:, judged] - paths, fit.left_out[:, judged], atol=1e-9)


@pytest.mark.parametrize("seed", seeds(3, 30))
def test_it_is_plain_least_squares(seed: int) -> None:
    """Written here once more, without currents, mirrors and means."""
    random = np.random.default_rng([seed, 6])
    train, _ = split(log_of(drawn_law(random), np.zeros(2), random, noise=0.05))
    task = task_of(train)
    problem = RegressionProblem(Regression(ridge=(1e-12,), steps=1), task, "none")
    rows, change = [], []
    for s in successive_windows(task):
        motion = {name: np.append(train.columns[name][s], train.states[name][:, s]) for name in "uvr"}
        table = {name: values[:-1] for name, values in motion.items()}
        table |= {name: values[:, s] for name, values in train.planned.items()}
        rows.append(np.stack(law_terms(table, NAMES), axis=1))
        change.append(np.stack([np.diff(motion[name]) for name in "uvr"], axis=1) / STEP)
    terms = np.concatenate(rows)
    weights = np.linalg.lstsq(terms, np.concatenate(change), rcond=None)[0]
    still = problem.laws([np.arange(len(train))])[0, 0]
    np.testing.assert_allclose(terms @ still, terms @ weights, atol=1e-5 * SMALL.max())


@pytest.mark.parametrize("seed", seeds(5, 100))
def test_no_path_leaves_the_velocities_of_training_far(seed: int) -> None:
    """Whatever the log is, and wherever a prediction starts."""
    random = np.random.default_rng([seed, 7])
    dataset = log_of(drawn_law(random), np.zeros(2), random, runs=int(random.integers(3, 6)))
    frame = dataset.frame.copy()
    for name in ("u", "v", "r", "north", "east", "port.n", "rudder.delta"):
        if random.random() < 0.7:
            frame[name] = np.clip(random.standard_cauchy(len(frame)) * 10 ** random.uniform(-3, 1), -20, 20)
    train, _ = split(Dataset(frame, dataset.metadata))
    physics, corrector = learned(train)
    instants = train.instants(known=True)
    wild = {name: values * 1e3 for name, values in instants.planned.items()}
    paths = corrector.predict(physics, replace(instants, planned=wild), np.empty(0))
    speed = np.hypot(*np.diff(paths, axis=0, prepend=0).T) / STEP
    motion = np.stack([np.append(train.columns[name], train.states[name]) for name in "uv"])
    most = 2 * np.hypot(*((1 + 2 * MARGIN) * np.abs(motion).max(axis=1) + 2 * np.abs(corrector.current).max()))
    assert np.isfinite(paths).all()
    assert not (speed > most).any()


def test_runs_left_out_choose_a_heavier_ridge_where_noise_is_all() -> None:
    random = np.random.default_rng(8)
    quiet, _ = split(log_of(drawn_law(random), np.zeros(2), random, runs=3))
    noisy, _ = split(log_of(drawn_law(random), np.zeros(2), random, runs=3, noise=2.0))
    method = Regression(ridge=(1e-9, 1.0), steps=1)
    ridges = [learned(windows, method)[1].hyperparameters["ridge"] for windows in (quiet, noisy)]
    assert ridges == [1e-9, 1.0]
