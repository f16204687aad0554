"""A simulated truth: seeded draws of manoeuvres, weather and sea, run as one batch, logged like a sea trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from shipid.engine.rollout import Trajectories, rollout
from shipid.errors import DocumentError, choices
from shipid.simulation import gusts
from shipid.simulation.gusts import Gusts
from shipid.simulation.sea import Sea, draw_components, share_outside, table_range, wave_loads
from shipid.simulation.sensors import Sensor, measure
from shipid.units import DEGREE, RPM
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel
from shipid.vessel.perturb import uniform

Range = tuple[FiniteFloat, FiniteFloat]
NotNegative = tuple[Annotated[FiniteFloat, Field(ge=0)], Annotated[FiniteFloat, Field(ge=0)]]
MOST_LOST = 0.05  # of the energy of a sea may lie beyond the frequencies of a vessel's tables
ON_BOARD = ("V_w", "beta_w")  # what of the environment a ship logs: neither current nor waves


class Truth(BaseModel):
    """The `[truth]` block of a study: a vessel, and turning manoeuvres with constant random orders and weather.

    Every quantity is drawn uniformly from its range by hash(seed, manoeuvre, quantity), so that more manoeuvres never
    change those that exist. Directions are in [0, 360) deg.
    """

    model_config = ConfigDict(extra="forbid")
    vessel: str
    set: dict[str, Any] = Field(default={}, description="dotted path -> number or block, added to the vessel")
    manoeuvres: Annotated[int, Field(ge=2, le=100000)]
    duration: Annotated[FiniteFloat, Field(gt=0, description="s")]
    step: Annotated[FiniteFloat, Field(gt=0, description="s")] = 0.05
    method: Literal["euler", "rk4"] = "rk4"
    interval: Annotated[FiniteFloat, Field(gt=0, description="s between logged rows")] = 1.0
    seed: int = 0
    n_rpm: Range = (50.0, 200.0)
    alpha_deg: Range = (-50.0, 50.0)
    wind_speed: NotNegative = (0.0, 6.0)
    gusts: Gusts | None = None
    waves: Sea | None = None
    current_speed: Annotated[NotNegative, Field(description="m/s, for a vessel with a [current] block")] = (0.0, 0.0)
    sensors: dict[str, Sensor] = Field(default={}, description="logged column -> sensor model")
    start_speed: Annotated[Range, Field(description="m/s ahead at the start of a manoeuvre")] = (0.0, 0.0)
    actuators_at: Annotated[
        Literal["order", "rest"], Field(description="where lagged actuators stand when the manoeuvre starts")
    ] = "order"

    @model_validator(mode="after")
    def _fits(self) -> Truth:
        if abs(self.interval / self.step - round(self.interval / self.step)) > 1e-9 * self.interval / self.step:
            raise ValueError(f"interval {self.interval:g} s must be a multiple of step {self.step:g} s")
        if self.duration < self.interval:
            raise ValueError(f"duration {self.duration:g} s holds no interval of {self.interval:g} s")
        for name in ("n_rpm", "alpha_deg", "wind_speed", "current_speed", "start_speed"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name} runs backwards: give [low, high], found [{low:g}, {high:g}]")
        return self


def check_truth(truth: Truth, vessel: Vessel) -> None:
    """Refuse what this vessel cannot do: waves, current or gusts that act on no term, or a sea beyond its tables."""
    model = dynamics(vessel)
    if truth.waves is not None:
        _check_sea(truth, truth.waves, vessel)
    if truth.current_speed != (0.0, 0.0) and "V_c" not in model.environment:
        raise DocumentError(f"{truth.vessel} has no [current]: set it, or no current", path="truth.current_speed")
    if truth.gusts is not None and "V_w" not in model.environment:
        raise DocumentError(f"{truth.vessel} has no [wind]: take a vessel that has, or no gusts", path="truth.gusts")
    columns = [_column(name) for name in model.state]
    columns += [*model.commands, *(name for name in ON_BOARD if name in model.environment)]
    unknown = next((name for name in truth.sensors if name not in columns), None)
    if unknown is not None:
        raise DocumentError(f"no column that is measured: {choices(unknown, columns)}", path=f"truth.sensors.{unknown}")


def _check_sea(truth: Truth, sea: Sea, vessel: Vessel) -> None:
    if not dynamics(vessel).drawn:
        raise DocumentError(f"{truth.vessel} has no [waves]: take a vessel that has, or no waves", path="truth.waves")
    low, high = table_range(vessel)
    lost = share_outside(sea, low, high)
    if lost > MOST_LOST:
        message = f"{sea.T_p:g} s: {lost:.0%} of the sea's energy lies outside the tables of {truth.vessel}"
        remedy = f"{low:g} to {high:g} rad/s; at most {MOST_LOST:.0%} may"
        raise DocumentError(f"{message}, {remedy}", path="truth.waves.T_p")


def simulate(truth: Truth, vessel: Vessel) -> pd.DataFrame:
    """Run all manoeuvres in one batch and log them: a frame with the columns of a dataset, runs `M001`, `M002`, ...

    Both propulsors take the same orders, from t = 0 on; mean wind, current and the direction of the waves are constant.
    Every ship starts upright and still but for her speed ahead: the first ten seconds of her roll are a transient.
    What is logged is that of the origin, the centre of gravity projected on the calm waterline: u and v horizontal,
    along and across the heading, and r = d(psi)/dt. Raises DocumentError if a manoeuvre diverges.
    """
    check_truth(truth, vessel)
    model = dynamics(vessel)
    start, commands, environment, chi = _draw(truth, model.commands, model.environment)
    rows = int(truth.duration / truth.interval + 1e-9)
    steps_a_row = round(truth.interval / truth.step)
    every = 1 if truth.sensors else steps_a_row
    num_steps = rows * steps_a_row
    weather = dict(environment)
    if truth.gusts is not None and "V_w" in weather:
        keys = [(truth.seed, "manoeuvre", number) for number in range(truth.manoeuvres)]
        time = truth.step * np.arange(num_steps + 1, dtype=float)
        weather["V_w"] = environment["V_w"] + gusts.series(truth.gusts, environment["V_w"], time, keys)
    path = rollout(
        vessel,
        start,
        commands,
        {name: values if values.ndim == 1 else values[:-1] for name, values in weather.items()},
        step=truth.step,
        num_steps=num_steps,
        every=every,
        method=truth.method,
        memory=dict.fromkeys(model.memory, np.zeros(truth.manoeuvres)) if truth.actuators_at == "rest" else None,
        components=_sea(truth, vessel, chi),
        keep=model.state,
    )
    if path.diverged.any():
        worst = int(np.argmax(path.diverged[0]))
        raise DocumentError(
            f"{truth.vessel} diverges in manoeuvre {worst + 1} of {truth.manoeuvres}: take a smaller step than "
            f"{truth.step:g} s or narrower ranges",
            path="truth",
        )
    measured = {name: values[::every] if values.ndim == 2 else values for name, values in weather.items()}
    frame = _log(path, {**commands, **{name: measured[name] for name in ON_BOARD if name in measured}})
    if truth.sensors:
        frame = measure(frame, truth.sensors, truth.interval, truth.seed)
    frame["flags"] = 0
    return frame


def _sea(truth: Truth, vessel: Vessel, chi: np.ndarray) -> dict[str, np.ndarray] | None:
    """Wave loads of every manoeuvre's own sea; None in calm water."""
    if truth.waves is None:
        return None
    names = [(truth.seed, "manoeuvre", number) for number in range(truth.manoeuvres)]
    return wave_loads(vessel, draw_components(truth.waves, chi, names))


def _log(path: Trajectories, beside: dict[str, np.ndarray]) -> pd.DataFrame:
    """Records as rows of a log; `beside` are orders and weather, (S,) or (R, S)."""
    count, _, num_samples, _ = path.states.shape
    names = run_names(num_samples)
    time = np.arange(count) * path.interval
    columns = {**logged(path, path.names), **{k: np.broadcast_to(v, (count, num_samples)) for k, v in beside.items()}}
    flat = {name: values.T.ravel() for name, values in columns.items()}
    return pd.DataFrame({"run": np.repeat(names, count), "t": np.tile(time, num_samples), **flat})


def logged(path: Trajectories, names: Sequence[str]) -> dict[str, np.ndarray]:
    """States of the first variant as a log has them, column -> (R, S): u, v and r are those of the horizontal plane."""
    columns = {_column(name): path[name][:, 0] for name in names}
    return columns | horizontal(columns)


def _column(state: str) -> str:
    """Name of a state in a log."""
    return "z" if state == "down" else state


def horizontal(columns: Mapping[str, Any], maths: Any = np) -> dict[str, Any]:
    """Horizontal u and v along and across the heading, r = d(psi)/dt (Fossen 2021, eqs. 2.31 and 2.40).

    maths : what has cos and sin for the columns; casadi for symbols.
    """
    zero = 0.0 * columns["u"]
    phi, theta, w, q = (columns.get(name, zero) for name in ("phi", "theta", "w", "q"))
    u, v, r = columns["u"], columns["v"], columns["r"]
    across = v * maths.cos(phi) - w * maths.sin(phi)
    down = v * maths.sin(phi) + w * maths.cos(phi)
    turning = (q * maths.sin(phi) + r * maths.cos(phi)) / maths.cos(theta)
    return {"u": u * maths.cos(theta) + down * maths.sin(theta), "v": across, "r": turning}


def aboard(columns: Mapping[str, Any], maths: Any = np) -> dict[str, Any]:
    """Body-fixed u, v and r of a log's columns: the reverse of `horizontal`, whose w and q are body-fixed already."""
    zero = 0.0 * columns["u"]
    phi, theta, w, q = (columns.get(name, zero) for name in ("phi", "theta", "w", "q"))
    v = (columns["v"] + w * maths.sin(phi)) / maths.cos(phi)
    u = (columns["u"] - (v * maths.sin(phi) + w * maths.cos(phi)) * maths.sin(theta)) / maths.cos(theta)
    r = (columns["r"] * maths.cos(theta) - q * maths.sin(phi)) / maths.cos(phi)
    return {"u": u, "v": v, "r": r}


def run_names(count: int) -> list[str]:
    """`M001`, `M002`, ...: as many digits as sort well."""
    return [f"M{number + 1:0{max(3, len(str(count)))}d}" for number in range(count)]


def _draw(
    truth: Truth, command_names: tuple[str, ...], environment_names: tuple[str, ...]
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """Start, commands and environment of every manoeuvre, name -> (manoeuvres,), and where its waves go; SI."""

    def between(quantity: str, limits: tuple[float, float], unit: float = 1.0) -> np.ndarray:
        low, high = limits
        draws = [uniform(truth.seed, "manoeuvre", number, quantity) for number in range(truth.manoeuvres)]
        return (low + (high - low) * np.array(draws)) * unit

    zero, around = np.zeros(truth.manoeuvres), (0.0, 360.0)
    start = dict.fromkeys(("north", "east", "down", "phi", "theta", "v", "w", "p", "q", "r"), zero)
    start |= {"psi": between("psi", around, DEGREE), "u": between("start_speed", truth.start_speed)}
    orders = {"n": between("n", truth.n_rpm, RPM), "alpha": between("alpha", truth.alpha_deg, DEGREE)}
    orders["delta"] = orders["alpha"]
    commands = {name: orders[name.rpartition(".")[2]] for name in command_names}
    weather = {
        "V_w": between("V_w", truth.wind_speed),
        "beta_w": between("beta_w", around, DEGREE),
        "V_c": between("V_c", truth.current_speed),
        "beta_c": between("beta_c", around, DEGREE),
    }
    return start, commands, {name: weather[name] for name in environment_names}, between("chi", around, DEGREE)
