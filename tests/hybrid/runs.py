"""Runs made by hand: predicted paths, and errors that are alike within a run and drawn anew for each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipid.hybrid.bands import Bands
from shipid.hybrid.calibration import calibrate_bands

HORIZON, NAMES = 8, ("u", "r", "port.n")
Array = np.ndarray


@dataclass(frozen=True)
class Runs:
    """Windows of runs: predicted paths and errors (T, S, 2) [m], columns (S,), run and kind of each."""

    paths: Array
    errors: Array
    columns: dict[str, Array]
    run: Array
    kinds: dict[str, str]

    def bands(self, order: Array | None = None, scale: float = 1.0) -> Bands:
        """Calibrate on all of them, in another order or with another unit of length."""
        chosen = np.arange(len(self.run)) if order is None else order
        errors, paths = scale * self.errors[:, chosen], scale * self.paths[:, chosen]
        columns = {name: values[chosen] * (scale if name == "u" else 1.0) for name, values in self.columns.items()}
        bands = calibrate_bands(errors, paths + errors, self.run[chosen], columns, NAMES, 1.0, self.kinds)
        return bands


def runs(seed: int, count: int = 22, windows: int = 15, alike: float = 0.7) -> Runs:
    """Draw runs: `alike` is the share of the variance of the logarithm of the error that windows of a run share."""
    rng = np.random.default_rng(seed)
    size = count * windows
    of = np.repeat(np.arange(count), windows)
    u, r = (rng.uniform(1, 6, count) + 0.0)[of] + rng.normal(0, 0.2, size), rng.normal(0, 0.05, count)[of]
    time = np.arange(1, HORIZON + 1)[:, None]
    angle = r * time
    paths = np.stack([u * time * np.sinc(angle / np.pi), u * time * angle / 2], axis=-1)
    spread = 0.8 * (np.sqrt(alike) * rng.standard_normal(count)[of] + np.sqrt(1 - alike) * rng.standard_normal(size))
    steps = rng.standard_normal((HORIZON, size, 2)).cumsum(axis=0) * np.exp(spread)[None, :, None] * [1.0, 0.4]
    errors = 0.1 * steps * (1 + np.abs(r) * 10)[None, :, None]
    columns = {"u": u, "r": r, "port.n": np.sign(r) + 0.1 * u}
    names = np.array([f"M{number:03d}" for number in of])
    kinds = {f"M{number:03d}": "zigzag" if number % 2 else "turning" for number in range(count)}
    return Runs(paths, errors, columns, names, kinds)


def made(seed: int, count: int = 22) -> tuple[Runs, Bands]:
    """Runs, and bands calibrated on them."""
    drawn = runs(seed, count)
    return drawn, drawn.bands()
