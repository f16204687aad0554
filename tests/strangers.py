"""Made-up ships that the template has never seen, with their logs in SI, drawn by seed: `strangers_ships.py`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shipid.data.dataset import Dataset
from shipid.errors import ShipidError
from shipid.study.new import _round_number_below
from shipid.vessel.load import Vessel
from tests.strangers_ships import candidates, dataset_columns, known_of, programme_of, record_of


@dataclass(frozen=True)
class Stranger:
    """A ship that nobody has seen.

    words : how it was drawn. truth : the vessel that made the log. dataset : the log, with noise.
    known : option of `shipid vessel new` -> what people know of the ship.
    """

    words: str
    truth: Vessel
    dataset: Dataset
    known: Mapping[str, float | str | bool]


def stranger(seed: int, runs: int = 24) -> Stranger:
    """Draw a ship and its log."""
    random = np.random.default_rng([seed, 20])
    for drawn, vessel, n in candidates(random, f"stranger-{seed}.toml"):
        try:
            dataset = _log(random, vessel, n, drawn, runs)
        except ShipidError:
            continue
        break
    return Stranger(drawn["words"], vessel, dataset, known_of(random, drawn, n))


def strange_vessel(seed: int) -> tuple[Vessel, float, float]:
    """Draw a ship without a log: the vessel, its service speed U [m/s], and the shaft speed [rev/s] of that speed."""
    drawn, vessel, n = next(candidates(np.random.default_rng([seed, 21]), f"stranger-{seed}.toml"))
    return vessel, drawn["U"], n


def _log(random: np.random.Generator, vessel: Vessel, n: float, drawn: Mapping[str, Any], count: int) -> Dataset:
    """Runs of several kinds, in a current and gusts that nobody measured, with noise of the sensors."""
    U, L = drawn["U"], drawn["L"]
    style = {
        "team": "basin" if drawn["model"] else "yard",
        "hz": 1 / _round_number_below(L / U / 12),
        "a day": 12,
        "tidy": False,
    }
    record, _ = record_of(random, vessel, n, drawn, style, programme_of(random, count, style))
    frame = record[dataset_columns(record, wind=False)].copy()
    noise = {
        "u": 0.008 * U, "v": 0.008 * U, "r": np.radians(0.04) * drawn["quick"], "psi": np.radians(0.2),
        "north": 0.008 * L, "east": 0.008 * L,
    }  # fmt: skip
    for name, size in noise.items():
        frame[name] = frame[name] + random.normal(0, size, len(frame))
    return Dataset(frame, {"clock": "run", "flags": []})
