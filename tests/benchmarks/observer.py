"""What the observer buys in seeded worlds with waves, wind and current."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.data.dataset import Dataset
from shipid.data.windows import Instants, cut_windows
from shipid.engine.rollout import rollout
from shipid.hybrid.physics import Physics
from shipid.metrics import position_error
from shipid.observer import MEASURED_MOTION, Estimates, Observer, estimates_at_windows, run_observer
from shipid.simulation.log import log_columns
from shipid.simulation.manoeuvre import aprbs_series
from shipid.simulation.weather import Sea, draw_components, wave_loads
from shipid.units import DEGREE, RPM
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import Family, draw_members, resolve_families, uniform_draw

Array = np.ndarray
STEP, ROW, HORIZON, SETTLED = 0.05, 1.0, 30, 60.0
SMOOTH = 11  # s: zero-phase Hann low pass, which takes out the waves; for the floor alone, because it looks ahead


@dataclass(frozen=True)
class World:
    """Runs and the current in them: north and east [m/s] by run name."""

    data: Dataset
    current: dict[str, tuple[float, float]]


def world(vessel: str, seed: int, *, runs: int, duration: float, waves: bool, current: bool, changing: bool) -> World:
    """Runs of a vessel, everything drawn by hash(seed, run, quantity): orders, weather, sea, current, start."""
    truth = load_vessel(vessel).with_values({"current.kind": "uniform"})
    model, count = vessel_dynamics(truth), round(duration / STEP)
    length = float(truth.document["particulars"]["L_pp"])
    pace = float(min(length / 28.9, 1.0) ** 0.5)  # speeds and times of a model, by Froude

    def draw(name: str, low: float, high: float) -> Array:
        return np.array([low + (high - low) * uniform_draw(seed, "observer", run, name) for run in range(runs)])

    def order(name: str, low: float, high: float) -> Array:
        if not changing:
            return np.tile(draw(name, low, high), (count, 1))
        t = STEP * np.arange(count)
        hold = 25.0 * pace, 70.0 * pace
        series = [aprbs_series(t, hold=hold, levels=(low, high), key=(seed, run, name)) for run in range(runs)]
        every = round(ROW / STEP)  # orders change in logged rows
        return np.repeat(np.stack(series, axis=1)[::every], every, axis=0)[:count]

    fast = pace if pace == 1.0 else 1 / pace
    orders = {"n": order("n", 50 * RPM * fast, 200 * RPM * fast), "alpha": order("alpha", -50 * DEGREE, 50 * DEGREE)}
    orders["delta"] = 0.6 * orders["alpha"]
    commands = {name: orders[name.rpartition(".")[2]] for name in model.commands}
    speed, towards = draw("V_c", 0.2 * pace, 0.7 * pace) * current, draw("beta_c", 0.0, 2 * np.pi)
    weather = {"V_w": draw("V_w", 0.0, 6.0 * pace), "beta_w": draw("beta_w", 0.0, 2 * np.pi)}
    weather |= {"V_c": speed, "beta_c": towards}
    environment = {name: weather[name] for name in model.environment}
    start = {name: np.zeros(runs) for name in model.state}
    start |= {"psi": draw("psi", 0.0, 2 * np.pi), "u": draw("u", 0.5 * pace, 2.5 * pace)}
    sea = None
    if waves:
        names = [(seed, "sea", run) for run in range(runs)]
        sea = wave_loads(truth, draw_components(Sea(H_s=1.0, T_p=5.0), draw("chi", 0.0, 2 * np.pi), names))
    every = round(ROW / STEP)
    path = rollout(
        truth, start, commands, environment, step=STEP, num_steps=count, every=every, method="rk4", components=sea,
        keep=model.state,
    )  # fmt: skip
    assert not path.diverged.any()
    log = log_columns(path, path.names)
    rows = len(log["u"])
    held = np.minimum(np.arange(rows) * every, count - 1)
    columns = {name: log[name] for name in MEASURED_MOTION} | {name: values[held] for name, values in commands.items()}
    columns |= {name: np.tile(environment[name], (rows, 1)) for name in ("V_w", "beta_w") if name in environment}
    names = [f"M{run:03d}" for run in range(runs)]
    frame = pd.DataFrame({"run": np.repeat(names, rows), "t": np.tile(ROW * np.arange(rows), runs)})
    frame = frame.assign(**{name: values.T.ravel() for name, values in columns.items()}, flags=0)
    north, east = speed * np.cos(towards), speed * np.sin(towards)
    return World(
        Dataset(frame, {"clock": "run", "flags": []}), dict(zip(names, zip(north, east, strict=True), strict=True))
    )


def physics(names: tuple[str, ...]) -> dict[str, Vessel]:
    """Nominal model and perturbed variants of it, by name."""
    blocks = tomllib.loads((Path(__file__).parents[2] / "studies" / "simulation.toml").read_text())["family"]
    base = load_vessel("gunnerus-28.9")
    families = resolve_families([Family(**block) for block in blocks if "base" in block or "extends" in block])
    variants = [one for family in families for one in draw_members(family, base)]
    return {one.name: base.with_values(one.values) for one in variants if one.name in names}


def smoothed(data: Dataset) -> Dataset:
    """The same runs without motion at wave frequency; it looks ahead."""
    frame, weight = data.frame.copy(), np.hanning(SMOOTH + 2)[1:-1]
    half, weight = SMOOTH // 2, weight / weight.sum()
    for rows in data.frame.groupby("run", sort=False).indices.values():
        for name in MEASURED_MOTION:
            x = frame[name].to_numpy()[rows]
            padded = np.concatenate([2 * x[0] - x[half:0:-1], x, 2 * x[-1] - x[-2 : -half - 2 : -1]])
            frame.loc[frame.index[rows], name] = np.convolve(padded, weight, "valid")
    return Dataset(frame, data.metadata)


def errors(
    vessel: Vessel,
    made: World,
    settings: Observer | None = None,
    known: bool = True,
    estimates: Estimates | None = None,
) -> dict[str, float]:
    """Mean error [m] over 30 s of windows after the first 60 s: physics alone, with the observer, and the floor.

    The floor is the same physics from the low-passed start with the true current. estimates : of the observer, if they
    are there already.
    """
    whole = cut_windows(made.data, horizon=HORIZON, interval=5.0)
    late = whole.t >= SETTLED
    windows = whole.select(late)
    planned = windows.planned if known else None

    observed = Physics(vessel, HORIZON, ROW, observer=settings or Observer())

    def mean(columns: Mapping[str, Array]) -> float:
        paths = observed.paths(Instants(columns, planned=planned, estimates=columns))
        return float(position_error(paths, windows.future).mean())

    zero = np.zeros(len(windows))
    unseen = {f"observer.{name}": zero for name in (*"XYN", "current_north", "current_east")}
    plain = {**windows.columns, **unseen, **{f"observer.{name}": windows.columns[name] for name in MEASURED_MOTION}}
    alone = mean(plain)
    columns = estimates_at_windows(made.data, estimates or run_observer(vessel, made.data, settings), windows)
    seen = mean(columns)
    low = cut_windows(smoothed(made.data), horizon=HORIZON, interval=5.0).select(late).columns
    current = np.array([made.current[str(run)] for run in windows.run]).T
    ideal = {**windows.columns, **{f"observer.{name}": low[name] for name in MEASURED_MOTION}}
    ideal |= {f"observer.{name}": np.zeros(len(windows)) for name in "XYN"}
    ideal |= {"observer.current_north": current[0], "observer.current_east": current[1]}
    floor = mean(ideal)
    return {"alone": alone, "observer": seen, "floor": floor}
