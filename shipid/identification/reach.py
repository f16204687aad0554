"""How far the data reach, and which standard manoeuvres go beyond: what a model says there is extrapolated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from shipid.data.dataset import Array, Dataset
from shipid.physics.signals import is_steering
from shipid.units import DEGREE, join_names
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

ORDINARY = 0.995  # of the rows: what only fewer rows exceed may be noise
MARGIN = 1.1  # a manoeuvre within this factor of the data is no extrapolation
SLOW = 0.1  # of the greatest speed: slower rows have no drift angle


@dataclass(frozen=True)
class Reach:
    """Greatest drift angle [deg], yaw rate r L / U [1] and rudder or azimuth angle [deg], and least speed [m/s]."""

    drift: float
    rate: float
    helm: float
    speed: float

    @classmethod
    def of(cls, vessel: Vessel, columns: Mapping[str, Array], share: float = 1.0) -> Reach:
        """Reach of a motion: `u`, `v` [m/s], `r` [rad/s] and commands [rad], each (N,).

        share : of the rows that lie within the reach.
        """
        u, v, r = (np.asarray(columns[name], dtype=float) for name in ("u", "v", "r"))
        speed = np.hypot(u, v)
        moving = speed >= SLOW * np.quantile(speed, share)
        length = vessel.length or 1.0
        helms = [np.abs(columns[name]) for name in vessel_dynamics(vessel).commands if is_steering(name)]
        return cls(
            float(np.quantile(np.abs(np.arctan2(v, np.abs(u)))[moving], share)) / DEGREE,
            float(np.quantile((np.abs(r) * length / np.maximum(speed, 1e-9))[moving], share)),
            max((float(np.quantile(angle, share)) for angle in helms), default=0.0) / DEGREE,
            float(np.quantile(speed, 1 - share)),
        )


def data_reach(vessel: Vessel, dataset: Dataset, runs: Sequence[str]) -> Reach:
    """Reach of the runs of a dataset."""
    rows = dataset.frame[dataset.frame["run"].isin(runs)]
    names = ["u", "v", "r", *vessel_dynamics(vessel).commands]
    rows = rows[names].dropna()
    return Reach.of(vessel, {name: rows[name].to_numpy() for name in names}, ORDINARY)


def extrapolation_sentence(title: str, one: Reach, data: Reach) -> str:
    """Sentence where a manoeuvre goes beyond the data: `turning 35 reaches 20 deg of drift; the data reach 13`."""
    parts = [
        (f"{one.drift:.0f} deg of drift", f"{data.drift:.0f}", one.drift > max(MARGIN * data.drift, data.drift + 1)),
        (f"r L / U of {one.rate:.2f}", f"{data.rate:.2f}", one.rate > max(MARGIN * data.rate, data.rate + 0.02)),
        (f"{one.helm:.0f} deg of helm", f"{data.helm:.0f}", one.helm > max(MARGIN * data.helm, data.helm + 1)),
        (f"a speed of {one.speed:.3g} m/s", f"{data.speed:.3g}", one.speed < data.speed / MARGIN),
    ]
    far = [(there, here) for there, here, yes in parts if yes]
    if not far:
        return ""
    return f"{title} reaches {join_names([a for a, _ in far])}; the data reach {join_names([b for _, b in far])}"


def of_log(vessel: Vessel, frame: pd.DataFrame) -> Reach:
    """Reach of a simulated manoeuvre, with the columns of `perform`."""
    return Reach.of(vessel, {str(name): frame[name].to_numpy() for name in frame if name != "run"})
