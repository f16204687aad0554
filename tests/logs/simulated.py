"""Logs of a simulated trial, clean or with a defect put into them, as a bridge might write them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from pymap3d import ned2geodetic

from shipid.data.dataset import Dataset
from shipid.engine.rollout import rollout
from shipid.logs.guess.clues import State
from shipid.logs.guess.columns import Guess, guess
from shipid.logs.guess.draft import draft_mapping
from shipid.logs.guess.evidence import row_windows
from shipid.logs.importing import import_log, read_mapping
from shipid.vessel.load import load_vessel

KNOT = 1852 / 3600
FINE = 0.1  # s

SCHEDULE = [  # seconds, rpm, azimuth [deg]
    *((120, 170, 0), (20, 170, -20), (40, 170, 20), (40, 170, -20), (40, 170, 20), (40, 170, -20), (20, 170, 20)),
    *((90, 170, 0), (240, 170, 25), (90, 170, 0), (240, 170, -25), (90, 140, 0), (150, 110, 0), (150, 190, 0)),
]
"""Straight, a zigzag, straight, a turning circle to port, straight, one to starboard, and a speed run."""


@cache
def motion() -> pd.DataFrame:
    """Motion of the Gunnerus in SI units every 0.1 s, without noise, in a light wind."""
    orders = np.repeat([row[1:] for row in SCHEDULE], [round(row[0] / FINE) for row in SCHEDULE], axis=0)
    alpha = _rate_limited(np.radians(orders[:, 1]), np.radians(5.0) * FINE)
    n = _rate_limited(orders[:, 0] / 60.0, 0.1 * FINE)
    commands = {
        f"{side}.{name}": x[:, None] for side in ("port", "starboard") for name, x in (("n", n), ("alpha", alpha))
    }
    start = {name: np.zeros(1) for name in ("north", "east", "v", "r")} | {"psi": np.full(1, 5.9), "u": np.full(1, 4.5)}
    wind = {"V_w": np.full((len(n), 1), 3.0), "beta_w": np.full((len(n), 1), 0.5)}
    path = rollout(load_vessel("gunnerus-33.9"), start, commands, wind, step=FINE, num_steps=len(n), method="rk4")
    frame = pd.DataFrame({name: path[name][:-1, 0, 0] for name in ("north", "east", "psi", "u", "v", "r")})
    return frame.assign(t=FINE * np.arange(len(frame)), n=n, alpha=alpha)


def _rate_limited(orders: np.ndarray, most: float) -> np.ndarray:
    result, now = np.empty(len(orders)), orders[0]
    for index, order in enumerate(orders):
        now += np.clip(order - now, -most, most)
        result[index] = now
    return result


def si_log(seed: int = 0, every: int = 5) -> pd.DataFrame:
    """The motion every 0.5 s with the noise of good sensors, SI units."""
    random = np.random.default_rng(seed)
    frame = motion().iloc[::every].reset_index(drop=True)
    noise = {"north": 0.15, "east": 0.15, "psi": 1e-3, "u": 0.01, "v": 0.01, "r": 2e-4}
    return frame.assign(**{name: frame[name] + random.normal(0, std, len(frame)) for name, std in noise.items()})


def as_bridge(frame: pd.DataFrame) -> pd.DataFrame:
    """Write as a log: degrees 0..360, deg/s, rpm; u, v in m/s."""
    return pd.DataFrame(
        {
            "time": frame["t"].round(3),
            "N": frame["north"],
            "E": frame["east"],
            "psi": np.degrees(frame["psi"]) % 360.0,
            "u": frame["u"],
            "v": frame["v"],
            "r": np.degrees(frame["r"]),
            "rpm": frame["n"] * 60.0,
            "rudder": -np.degrees(frame["alpha"]),  # > 0 to starboard
        }
    )


def guess_of(folder: Path, frame: pd.DataFrame) -> Guess:
    """Write a frame as log.csv into a folder, and guess it."""
    frame.to_csv(folder / "log.csv", index=False)
    return guess(folder / "log.csv")


def import_draft(folder: Path, proposal: Guess, **options: object) -> Dataset:
    """Import log.csv in a folder by its draft, the whole of it."""
    (folder / "draft.toml").write_text(draft_mapping(proposal))
    whole = read_mapping(folder / "draft.toml").model_copy(update={"segment": ()})
    return import_log(whole, folder / "log.csv", **options)  # type: ignore[arg-type]


def drafted(frame: pd.DataFrame, folder: Path) -> tuple[Guess, Dataset]:
    """Guess of a frame, and what its draft makes of it."""
    proposal = guess_of(folder, frame)
    return proposal, import_draft(folder, proposal)


def state_of(columns: dict[str, np.ndarray], t: np.ndarray, unit: str = "s") -> State:
    """Return the start of a guess of columns (N,) at instants t (N,) [s], drafted from a clock in this unit."""
    return State(t, unit, columns, row_windows(t))


def state_with_pose(columns: dict[str, np.ndarray], wrong: float = 1.0, unit: str = "s") -> State:
    """Return a guess of columns (N,) at the instants of `si_log()`, whose position and heading are already known.

    wrong : times that these instants are too long, as where the clock is drafted in a wrong unit.
    """
    log = si_log()
    state = state_of(columns, wrong * log["t"].to_numpy(), unit)
    state.position = np.asarray(log["north"] + 1j * log["east"])
    state.psi = log["psi"].to_numpy()
    return state


def globe(seed: int) -> pd.DataFrame:
    """The clean log with the noise of another seed and positions on the Earth, in a bridge's words."""
    log = si_log(seed)
    lat, lon, _ = ned2geodetic(log["north"], log["east"], 0.0, 63.44, 10.40, 0.0)
    frame = as_bridge(log).round(4).drop(columns=["N", "E", "u", "v"]).rename(columns={"psi": "HDG", "r": "ROT"})
    return frame.assign(Lat=lat.round(7), Lon=lon.round(7))
