"""Kernel ridge regression as plain NumPy writes it; port and starboard are alike."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.data.windows import cut_windows
from shipid.hybrid.compensator import smooth_basis
from shipid.hybrid.features import Memory
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.kernel_compensator import GROUPS, KernelCompensator, kernel_group
from shipid.hybrid.method import Case, FitResult, Task
from shipid.hybrid.physics import Physics
from shipid.observer import Observer, run_observer
from shipid.study.prepare import at_instants
from shipid.vessel.load import load_vessel
from tests.hybrid.tasks import (
    FOLDS,
    RUDDER,
    STEPS,
    TWINS,
    compensation,
    drawn_columns,
    mirrored_columns,
    missed_paths,
    tune,
)
from tests.study.test_whole import windy

SIDES = {"port": "starboard", "starboard": "port"}
ODD = (
    "east",
    "psi",
    "phi",
    "v",
    "r",
    "p",
    "beta_w",
    "alpha",
    "delta",
)  # change sign; written apart from the table of signals


def mirrored(dataset: Dataset) -> Dataset:
    """The same runs as a mirror shows them: east is west, port is starboard."""
    columns = {}
    for name in map(str, dataset.frame.columns):
        component, dot, signal = name.rpartition(".")
        image = f"{SIDES.get(component, component)}{dot}{signal}"
        columns[image] = -dataset.frame[name] if signal in ODD else dataset.frame[name]
    frame = dataset.frame.assign(**columns)
    return Dataset(frame, dataset.metadata)


SMALL = Kernel(trials=1, steps=6, terms=4)
MEMORY = Memory(history=(2.0, 4.0), turned=6.0, positions=(1.0, 5.0), error=(3.0, 6.0), observer=True)  # type: ignore[arg-type]


def tuned(columns: dict, targets: np.ndarray, method: Kernel = SMALL, commands: tuple[str, ...] = TWINS) -> FitResult:
    return tune(columns, commands, {"one": targets}, FOLDS, method, 3)["one"]


def by_hand(columns: dict, targets: np.ndarray, params: dict, seen: dict) -> np.ndarray:
    """Errors (T, S, 2) [m] as a kernel ridge regression without a mirror says them, window by window."""
    names = ["u", "v", "r", *TWINS]
    table, new = ({name: one[name] for name in names} for one in (columns, seen))
    for one, source in ((table, columns), (new, seen)):
        angle = source["beta_w"] - source["psi"]
        one["u_rw"] = source["u"] - source["V_w"] * np.cos(angle)
        one["v_rw"] = source["v"] - source["V_w"] * np.sin(angle)
    scale = {name: "motion" if name in "uvr" else "wind" if name.endswith("rw") else "command" for name in table}
    z, points = (
        np.stack([(one[n] - table[n].mean()) / table[n].std() / params[f"{scale[n]}_scale"] for n in table], axis=1)
        for one in (table, new)
    )

    def kernel(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.exp(-np.sum((a - b) ** 2) / 2) + params["linear"] * (1 + a @ b))

    gram = np.array([[kernel(a, b) for b in z] for a in z])
    around = np.array([[kernel(a, b) for b in z] for a in points])
    basis = smooth_basis(STEPS, 4)
    wanted = np.einsum("tk,tsc->skc", basis, targets)
    weights = np.linalg.solve(gram + params["ridge"] * np.eye(len(z)), wanted.reshape(len(z), -1))
    return np.einsum("tk,skc->tsc", basis, (around @ weights).reshape(len(points), 4, 2))


@pytest.mark.parametrize("fixed", [{}, {"trials": 2}, {"linear": 0.5}, {"ridge": 0.1}, {"linear": 0.5, "ridge": 0.1}])
def test_it_is_the_kernel_ridge_regression_of_plain_numpy(fixed: dict) -> None:
    columns, fresh = drawn_columns(), drawn_columns(seed=5, count=9)
    fit = tuned(columns, missed_paths(columns), SMALL.model_copy(update={"mirror": False} | fixed))
    assert isinstance(fit.corrector, KernelCompensator)
    assert fixed.items() - {("trials", 2)} <= fit.corrector.hyperparameters.items()
    made = [by_hand(columns, missed_paths(columns), row["params"], fresh) for row in fit.trials]
    assert len(made) == fixed.get("trials", 1)
    expected = np.mean(made, axis=0)
    np.testing.assert_allclose(compensation(fit.corrector, fresh), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("commands", [TWINS, RUDDER])
def test_mirrored_instants_have_the_mirrored_path(commands: tuple[str, ...]) -> None:
    columns, fresh = drawn_columns(commands), drawn_columns(commands, seed=5, count=9)
    targets = np.random.default_rng(0).normal(size=(STEPS, 120, 2))
    fit = tuned(columns, targets, commands=commands)
    paths, image = (compensation(fit.corrector, one) for one in (fresh, mirrored_columns(fresh)))
    np.testing.assert_allclose(image, paths * [1.0, -1.0], atol=1e-9)
    assert np.abs(paths[..., 1]).max() > 0.01


def test_with_a_mirror_it_is_the_fit_to_each_window_and_its_image() -> None:
    """Twice the windows, the images with the other sign of y; the ridge of one that is seen twice is the same."""
    columns = drawn_columns()
    fit = tuned(columns, missed_paths(columns))
    both = {name: np.concatenate([columns[name], mirrored_columns(columns)[name]]) for name in columns}
    targets = np.concatenate([missed_paths(columns), missed_paths(columns) * [1.0, -1.0]], axis=1)
    expected = by_hand(both, targets, dict(fit.corrector.hyperparameters), drawn_columns(seed=5, count=9))
    np.testing.assert_allclose(compensation(fit.corrector, drawn_columns(seed=5, count=9)), expected, rtol=0, atol=1e-8)


def test_a_descent_ends_below_its_start_and_is_made_again_to_the_digit() -> None:
    columns = drawn_columns()
    fits = (tuned(columns, missed_paths(columns), SMALL.model_copy(update={"steps": n})) for n in (1, 12, 12))
    first, longer, again = (fit.trials[0] for fit in fits)
    assert longer["value"] < 0.97 * first["value"]
    assert longer["params"] == again["params"]
    assert longer["epochs"] > first["epochs"]


def test_where_the_physics_misses_nothing_nothing_is_added() -> None:
    """The logarithm of an error of 0 was a warning."""
    fit = tuned(drawn_columns(), np.zeros((STEPS, 120, 2)))
    np.testing.assert_array_equal(compensation(fit.corrector, drawn_columns(seed=5, count=9)), 0.0)


def test_only_scales_of_inputs_that_there_are_are_searched() -> None:
    columns = {name: values for name, values in drawn_columns().items() if name not in ("V_w", "beta_w")}
    fit = tuned(columns, missed_paths(columns))
    assert {*fit.trials[0]["params"]} == {*SMALL.ranges()} - {"wind_scale"}


def observed(dataset: Dataset, physics: Physics) -> Task:
    """A task on the windows of a dataset, with what the observer of the physics knows; every run left out in turn."""
    assert physics.vessel is not None
    windows = cut_windows(dataset, horizon=5, past=6)
    known = at_instants(dataset, windows, run_observer(physics.vessel, dataset, physics.observer))
    folds = [(np.flatnonzero(windows.run != run), np.flatnonzero(windows.run == run)) for run in windows.spans]
    case = Case(physics, physics.paths(windows.instants(estimates=known)))
    return Task({"one": case}, windows, folds, tuple(dataset.commands), estimates={"one": known})


def test_with_every_kind_of_memory_mirrored_runs_have_mirrored_paths() -> None:
    vessel = load_vessel("gunnerus-28.9").with_values({"hull.derivatives.N_ur": -3e5})
    physics, dataset = Physics(vessel, 5, 1.0, "euler", Observer()), windy()
    tasks = [observed(data, physics) for data in (dataset, mirrored(dataset))]
    corrector = SMALL.model_copy(update={"memory": MEMORY}).fit(tasks[0])["one"].corrector
    assert isinstance(corrector, KernelCompensator)
    assert corrector.reflection is not None
    assert {*map(kernel_group, corrector.normaliser.names)} == {*GROUPS}
    paths = [corrector.predict(physics, task.instants("one"), task.cases["one"].paths) for task in tasks]
    np.testing.assert_allclose(paths[1], paths[0] * [1.0, -1.0], rtol=0.0, atol=1e-5)
    assert np.abs(paths[0] - tasks[0].cases["one"].paths).max() > 0.01
