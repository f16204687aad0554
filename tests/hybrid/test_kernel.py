"""Kernel ridge regression as plain NumPy writes it; port and starboard are alike."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.hybrid.compensator import smooth_basis
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.kernel_compensator import KernelCompensator
from tests.hybrid.tasks import compensation
from tests.hybrid.test_ridge import RUDDER, STEPS, TWINS, drawn, mirrored, missed, tuned

SMALL = Kernel(trials=1, steps=6, terms=4)


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


@pytest.mark.parametrize("fixed", [{}, {"linear": 0.5}, {"ridge": 0.1}, {"linear": 0.5, "ridge": 0.1}])
def test_it_is_the_kernel_ridge_regression_of_plain_numpy(fixed: dict) -> None:
    columns, fresh = drawn(), drawn(seed=5, count=9)
    fit = tuned(columns, {"one": missed(columns)}, SMALL.model_copy(update={"mirror": False} | fixed))["one"]
    assert isinstance(fit.corrector, KernelCompensator)
    assert fixed.items() <= fit.corrector.hyperparameters.items()
    expected = by_hand(columns, missed(columns), dict(fit.corrector.hyperparameters), fresh)
    np.testing.assert_allclose(compensation(fit.corrector, fresh), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("commands", [TWINS, RUDDER])
def test_mirrored_instants_have_the_mirrored_path(commands: tuple[str, ...]) -> None:
    columns, fresh = drawn(commands), drawn(commands, seed=5, count=9)
    targets = np.random.default_rng(0).normal(size=(STEPS, 120, 2))
    fit = tuned(columns, {"one": targets}, SMALL, commands=commands)["one"]
    paths, image = (compensation(fit.corrector, one) for one in (fresh, mirrored(fresh)))
    np.testing.assert_allclose(image, paths * [1.0, -1.0], atol=1e-9)
    assert np.abs(paths[..., 1]).max() > 0.01


def test_with_a_mirror_it_is_the_fit_to_each_window_and_its_image() -> None:
    """Twice the windows, the images with the other sign of y; the ridge of one that is seen twice is the same."""
    columns = drawn()
    fit = tuned(columns, {"one": missed(columns)}, SMALL)["one"]
    both = {name: np.concatenate([columns[name], mirrored(columns)[name]]) for name in columns}
    targets = np.concatenate([missed(columns), missed(columns) * [1.0, -1.0]], axis=1)
    expected = by_hand(both, targets, dict(fit.corrector.hyperparameters), drawn(seed=5, count=9))
    np.testing.assert_allclose(compensation(fit.corrector, drawn(seed=5, count=9)), expected, rtol=0, atol=1e-8)


def test_a_descent_ends_below_its_start_and_is_made_again_to_the_digit() -> None:
    columns = drawn()
    fits = (tuned(columns, {"one": missed(columns)}, SMALL.model_copy(update={"steps": n}))["one"] for n in (1, 12, 12))
    first, longer, again = (fit.trials[0] for fit in fits)
    assert longer["value"] < 0.97 * first["value"]
    assert longer["params"] == again["params"]
    assert longer["epochs"] > first["epochs"]


def test_only_scales_of_inputs_that_there_are_are_searched() -> None:
    columns = {name: values for name, values in drawn().items() if name not in ("V_w", "beta_w")}
    fit = tuned(columns, {"one": missed(columns)}, SMALL)["one"]
    assert {*fit.trials[0]["params"]} == {*SMALL.ranges()} - {"wind_scale"}
