"""A simulated truth: seeded draws of manoeuvres and weather, run as one batch, logged like a sea trial."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from shipid.errors import DocumentError
from shipid.simulation.rollout import rollout
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel
from shipid.vessel.perturb import uniform

Range = tuple[FiniteFloat, FiniteFloat]
RPM = 1 / 60
DEGREE = np.pi / 180
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
    wind_speed: Range = (0.0, 6.0)
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
        for name in ("n_rpm", "alpha_deg", "wind_speed", "start_speed"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name} runs backwards: give [low, high], found [{low:g}, {high:g}]")
        return self


def simulate(truth: Truth, vessel: Vessel) -> pd.DataFrame:
    """Run all manoeuvres in one batch and log them: a frame with the columns of a dataset, runs `M001`, `M002`, ...

    Both propulsors take the same orders, from t = 0 on; the wind is constant. Raises DocumentError if one diverges.
    """
    model = dynamics(vessel)
    start, commands, environment = _draw(truth, model.commands, model.environment)
    steps_a_row = round(truth.interval / truth.step)
    rows = int(truth.duration / truth.interval + 1e-9)
    at_rest = {name: np.zeros(truth.manoeuvres) for name in model.memory} if truth.actuators_at == "rest" else None
    path = rollout(
        vessel,
        start,
        commands,
        environment,
        step=truth.step,
        num_steps=rows * steps_a_row,
        every=steps_a_row,
        method=truth.method,
        memory=at_rest,
        keep=model.state,
        engine="casadi",
    )
    if path.diverged.any():
        worst = int(np.argmax(path.diverged[0]))
        raise DocumentError(
            f"{truth.vessel} diverges in manoeuvre {worst + 1} of {truth.manoeuvres}: take a smaller step than "
            f"{truth.step:g} s or narrower ranges",
            path="truth",
        )
    names = run_names(truth.manoeuvres)
    frame = pd.DataFrame(
        {"run": np.repeat(names, rows + 1), "t": np.tile(np.arange(rows + 1) * truth.interval, len(names))}
    )
    for name in model.state:
        frame["z" if name == "down" else name] = path[name][:, 0].T.ravel()
    measured = {name: values for name, values in environment.items() if name in ON_BOARD}
    for name, values in {**commands, **measured}.items():
        frame[name] = np.repeat(values, rows + 1)
    frame["flags"] = 0
    return frame


def run_names(count: int) -> list[str]:
    """`M001`, `M002`, ...: as many digits as sort well."""
    return [f"M{number + 1:0{max(3, len(str(count)))}d}" for number in range(count)]


def _draw(
    truth: Truth, command_names: tuple[str, ...], environment_names: tuple[str, ...]
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Start, commands and environment of every manoeuvre, name -> (manoeuvres,), SI."""

    def between(quantity: str, limits: tuple[float, float], unit: float = 1.0) -> np.ndarray:
        low, high = limits
        draws = [uniform(truth.seed, "manoeuvre", number, quantity) for number in range(truth.manoeuvres)]
        return (low + (high - low) * np.array(draws)) * unit

    zero = np.zeros(truth.manoeuvres)
    start = dict.fromkeys(("north", "east", "down", "phi", "theta", "v", "w", "p", "q", "r"), zero)
    start |= {"psi": between("psi", (0.0, 360.0), DEGREE), "u": between("start_speed", truth.start_speed)}
    orders = {"n": between("n", truth.n_rpm, RPM), "alpha": between("alpha", truth.alpha_deg, DEGREE)}
    orders["delta"] = orders["alpha"]
    commands = {name: orders[name.rpartition(".")[2]] for name in command_names}
    weather = {"V_w": between("V_w", truth.wind_speed), "beta_w": between("beta_w", (0.0, 360.0), DEGREE)}
    return start, commands, {name: weather.get(name, zero) for name in environment_names}
