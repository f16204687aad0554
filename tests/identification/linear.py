"""A linear model with known truth: sensitivities of runs that differ, noise of any colour."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from shipid.identification.statistics import LinearFit

SIGNALS = ("u", "v", "r")
LEVELS = {"u": 1.3, "v": 0.6, "r": 1.0}  # what the noise is, over what was declared


def design(runs: int, samples: int, count: int, seed: int = 0) -> np.ndarray:
    """Sensitivities (runs * 3 * samples, count): slow random waves, of another amplitude in each run."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples)
    blocks = []
    for _ in range(runs * len(SIGNALS)):
        phases, periods = rng.uniform(0, 2 * np.pi, (2, count)), rng.uniform(10, 60, (2, count))
        waves = np.sin(2 * np.pi * t[:, None, None] / periods + phases).sum(axis=1)
        blocks.append(rng.uniform(0.2, 1.5, count) * (waves + rng.normal(0, 0.5, count)))
    return np.concatenate(blocks)


def labels(runs: int, samples: int) -> tuple[np.ndarray, tuple[str, ...]]:
    """Run and signal of each row of `design`."""
    clusters = np.repeat(np.arange(runs), len(SIGNALS) * samples)
    return clusters, tuple(np.tile(np.repeat(SIGNALS, samples), runs).tolist())


def noise(rng: np.random.Generator, runs: int, samples: int, phi: float) -> np.ndarray:
    """Stationary AR(1) errors with a level for each signal, independent between runs and signals."""
    white = rng.normal(size=(runs, len(SIGNALS), samples))
    error = np.empty_like(white)
    error[..., 0] = white[..., 0]
    for k in range(1, samples):
        error[..., k] = phi * error[..., k - 1] + np.sqrt(1 - phi**2) * white[..., k]
    return (error * np.array([LEVELS[name] for name in SIGNALS])[:, None]).ravel()


def linear_fit(
    paths: Sequence[str],
    factors: np.ndarray,
    residuals: np.ndarray,
    jacobian: np.ndarray,
    clusters: np.ndarray,
    signals: Sequence[str],
    **more: Any,
) -> LinearFit:
    """A fit without nuisances, priors, bounds, held factors or factors about 0, but for what `more` says."""
    m, n = jacobian.shape
    plain: dict[str, Any] = {
        "prior_widths": np.full(n, np.inf), "spent": np.zeros(m), "at_bound": np.zeros(n, dtype=bool),
        "held": np.zeros(n, dtype=bool), "dropped": (), "runs": tuple(f"R{run}" for run in range(max(clusters) + 1)),
        "centre": np.ones(n), "sizes": n * ((1.0, "m"),),
    }  # fmt: skip
    return LinearFit(tuple(paths), factors, residuals, jacobian, clusters, tuple(signals), **plain | more)


def fitted(
    jacobian: np.ndarray, error: np.ndarray, clusters: np.ndarray, signals: tuple[str, ...], **more: Any
) -> LinearFit:
    """Least squares on J (x - truth) = error; the factors returned are 1 + estimate - truth."""
    widths = more.get("prior_widths")
    precision = np.zeros(jacobian.shape[1]) if widths is None else 1 / np.asarray(widths) ** 2
    away = np.linalg.lstsq(
        np.vstack([jacobian, np.diag(np.sqrt(precision))]), np.append(error, 0 * precision), rcond=None
    )[0]
    paths = tuple(f"p{j}" for j in range(jacobian.shape[1]))
    return linear_fit(paths, 1 + away, error - jacobian @ away, -jacobian, clusters, signals, **more)
