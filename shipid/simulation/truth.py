"""Simulated runs, logged like a sea trial: the truth of a study, drawn at random, and a document of manoeuvres."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np
import pandas as pd
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from shipid.arguments import check_class, whole_steps
from shipid.checked import CheckedModel, NotNegative, Positive
from shipid.document import requirement_words, taken_for_numbers
from shipid.engine.integrate import Array, Method
from shipid.errors import DocumentError, ShipidError, placed_errors, suggest_name
from shipid.physics.signals import ACTUAL, is_output, is_wrapped_angle, measurable_signals
from shipid.simulation.approach import Controls
from shipid.simulation.log import state_column
from shipid.simulation.manoeuvre import KINDS, Manoeuvre, order_keys, order_unit
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.weather import (
    Gusts,
    Sea,
    draw_components,
    gust_series,
    share_outside,
    wave_loads,
    wave_table_range,
)
from shipid.units import DEGREE, percent_text
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel
from shipid.vessel.perturb import check_rising, uniform_draw

At = Callable[[str], float]
"""Name of a quantity -> where in its range it lies, in [0, 1)."""

SHARED = ("name", "duration")  # keys of a kind that [truth] sets for all runs
SEEDS = 2**31  # number of different seeds that may be drawn
COURSE = "course_deg"
SpeedRange = Annotated[tuple[NotNegative, NotNegative], AfterValidator(check_rising)]
MOST_LOST = 0.05  # largest share of the energy of a sea outside the frequencies of a vessel's tables
WEATHER = ("V_w", "beta_w", "V_c", "beta_c")  # drawn from wind_speed, current_speed, and directions from anywhere
LONGEST = 1e6  # s of a run: a longer one is a slip of unit or exponent
SAME = 1e-6  # of a step of the record: two instants closer than this are equal


class ManoeuvreDraw(CheckedModel, BaseModel):
    """`[[truth.manoeuvre]]`: a kind of manoeuvre, its share of the runs, and the keys of the kind.

    A number is a fixed value. A pair [low, high] in place of a number is a range; each run draws from it uniformly.
    From a list of texts each run draws one with equal probability. `course_deg` and `seed` are drawn if absent. In
    kinds with `orders`, every other key is an order to commands: `n_rpm`, `alpha_deg`, `bow.n_rpm`.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    kind: str = "turning"
    share: Annotated[FiniteFloat, Field(gt=0, description="weight among all blocks")] = 1.0

    @model_validator(mode="after")
    def _fits(self) -> ManoeuvreDraw:
        if self.kind not in KINDS:
            raise ValueError(f"{self.kind!r} is no kind of manoeuvre: {suggest_name(self.kind, KINDS)}")
        for place in (0.0, 1.0):  # valid at both ends of every range: valid between them
            self.manoeuvre(1.0, lambda _, place=place: place)  # type: ignore[misc]
        return self

    def manoeuvre(self, duration: float, at: At) -> Manoeuvre:
        """Return the manoeuvre of one run.

        duration : length of the log [s].
        at : quantity -> position in its range, in [0, 1). A quantity is a key without its unit (`n`, `angle`), or `psi`
            for the course.

        Raises
        ------
        ValueError : a key that the kind does not have, or an invalid value.
        """
        kind = KINDS[self.kind]
        fields = {name: field.annotation for name, field in kind.model_fields.items() if name not in SHARED}
        given: dict[str, Any] = {}
        orders: dict[str, Any] = {}
        level = get_args(fields["orders"])[1] if "orders" in fields else None
        for key, value in _flatten_keys(self.model_extra or {}):
            if key in fields and key != "orders":
                given[key] = value if is_collection_type(fields[key]) else _draw_value(key, value, at)
            elif level is not None and key not in SHARED:
                orders[key] = range_limits(key, value) if is_collection_type(level) else _draw_value(key, value, at)
            else:
                remedy = "[truth] gives it for all runs" if key in SHARED else suggest_name(key, fields)
                raise ValueError(f"{key}: no key of {self.kind}: {remedy}")
        if level is not None:
            given["orders"] = orders
        if "seed" in fields:
            given.setdefault("seed", int(at("seed") * SEEDS))
        if "duration" in kind.model_fields:
            given["duration"] = duration
        given.setdefault(COURSE, 360.0 * at("psi"))
        try:
            manoeuvre: Manoeuvre = kind.__pydantic_validator__.validate_python(given)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            key = ".".join(str(part) for part in first["loc"] if part != "orders")
            raise ValueError(f"{key or self.kind}: {requirement_words(first)}") from None
        for key, value in taken_for_numbers(given, manoeuvre):
            raise ValueError(f"{key}: {value!r}: must be a number")
        return manoeuvre


def _flatten_keys(given: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Pairs of key and value; a key in a table becomes `table.key`, because `bow.n_rpm = 0` is a table in TOML."""
    return [
        (f"{key}.{inner}" if inner else key, one)
        for key, value in given.items()
        for inner, one in (value.items() if isinstance(value, Mapping) else [("", value)])
    ]


def is_collection_type(annotation: Any) -> bool:
    """Whether the type of a field is a tuple, list or table, so that a list is its value and not a range."""
    if get_origin(annotation) is Annotated:
        return is_collection_type(get_args(annotation)[0])
    if get_origin(annotation) in (Union, UnionType):
        return any(map(is_collection_type, get_args(annotation)))
    return get_origin(annotation) in (tuple, list, dict)


def _draw_value(key: str, value: Any, at: At) -> Any:
    """The value itself, a number from the range [low, high], or one of several texts."""
    if not isinstance(value, list | tuple):
        return value
    if value and all(isinstance(one, str) for one in value):
        return value[min(int(at(key) * len(value)), len(value) - 1)]
    low, high = range_limits(key, value)
    quantity = "psi" if key == COURSE else key.removesuffix("_rpm").removesuffix("_deg")
    return low + (high - low) * at(quantity)


def range_limits(key: str, value: Any) -> tuple[float, float]:
    """(low, high) of a pair; (x, x) of a number x; ValueError for anything else."""
    pair = value if isinstance(value, list | tuple) else [value, value]
    if len(pair) != 2 or not all(isinstance(one, int | float) and not isinstance(one, bool) for one in pair):
        raise ValueError(f"{key}: give a number or [low, high], not {value!r}")
    low, high = pair
    if low > high:
        raise ValueError(f"{key} has low > high: give [low, high], not [{low:g}, {high:g}]")
    return low, high


class Truth(CheckedModel, BaseModel):
    """The `[truth]` block of a study: a vessel, its manoeuvres, weather, sea and sensors.

    Every quantity is drawn uniformly from its range by hash(seed, manoeuvre, quantity), so that additional manoeuvres
    do not change the others. Directions are in [0, 360) deg.
    """

    vessel: str
    set: dict[str, Any] = Field(default={}, description="dotted path -> number or block, added to the vessel")
    fmu: str | None = Field(
        default=None, description="an FMU that moves by the orders made for the vessel, in its place: as in a family"
    )
    manoeuvres: Annotated[int, Field(ge=2, le=100000)]
    duration: Annotated[FiniteFloat, Field(gt=0, description="s of a run from the first instant of prediction on")]
    run_up: Annotated[FiniteFloat, Field(ge=0, description="s of a run, logged, before that instant")] = 0.0
    step: Annotated[FiniteFloat, Field(gt=0, description="s")] = 0.05
    method: Method = "rk4"
    interval: Annotated[FiniteFloat, Field(gt=0, description="s between logged rows")] = 1.0
    seed: int = 0
    wind_speed: SpeedRange = (0.0, 6.0)
    gusts: Gusts | None = None
    waves: Sea | None = None
    current_speed: Annotated[SpeedRange, Field(description="m/s, for a vessel with a [current] block")] = (0.0, 0.0)
    environment: dict[str, FiniteFloat | tuple[FiniteFloat, FiniteFloat]] = Field(
        default={},
        description="other signals of the environment: signal with its unit -> value or [low, high]",
    )
    sensors: dict[str, Sensor] = Field(
        default={}, description="logged column -> sensor model; an output (propeller.thrust) is logged where it has one"
    )
    manoeuvre: Annotated[list[ManoeuvreDraw], Field(min_length=1, description="kinds, drawn by their shares")] = [
        ManoeuvreDraw()
    ]

    @model_validator(mode="after")
    def _fits(self) -> Truth:
        if not whole_steps(self.interval, self.step):
            raise ValueError(f"interval {self.interval:g} s must be a multiple of step {self.step:g} s")
        if self.duration < self.interval:
            raise ValueError(f"duration {self.duration:g} s holds no interval of {self.interval:g} s")
        for name, value in self.environment.items():
            range_limits(f"environment.{name}", value)
        return self

    @property
    def length(self) -> float:
        """Length [s] of every log: run-up and duration, in whole intervals."""
        return int((self.run_up + self.duration) / self.interval + 1e-9) * self.interval


def check_truth(truth: Truth, vessel: Vessel) -> None:
    """Raise DocumentError for manoeuvres, weather, sensors or a sea that this vessel cannot be simulated with."""
    model = vessel_dynamics(vessel)
    if truth.waves is not None:
        _check_sea(truth, truth.waves, vessel)
    if truth.current_speed != (0.0, 0.0) and "V_c" not in model.environment:
        raise DocumentError(f"{truth.vessel} has no [current]: set it, or no current", path="truth.current_speed")
    if truth.gusts is not None and "V_w" not in model.environment:
        raise DocumentError(f"{truth.vessel} has no [wind]: take a vessel that has, or no gusts", path="truth.gusts")
    _check_environment(truth, vessel)
    columns = [state_column(name) for name in model.state]
    columns += [*model.commands, *measurable_signals(model.environment), *model.outputs]
    unknown = next((name for name in truth.sensors if name not in columns), None)
    controls = Controls(vessel)
    for place, block in enumerate(truth.manoeuvre):
        if truth.fmu is not None and KINDS[block.kind].reacts():
            words = f"the helmsman of {block.kind} steers {truth.vessel}, not the FMU: take a kind with given orders"
            raise DocumentError(words, path=f"truth.manoeuvre.{place}.kind")
        with placed_errors(DocumentError, path=partial(path_in_block, f"truth.manoeuvre.{place}")):
            for end in (0.0, 1.0):  # of every range
                block.manoeuvre(truth.length, lambda _, end=end: end).check(controls)  # type: ignore[misc]
    if unknown is not None:
        raise DocumentError(f"no logged column: {suggest_name(unknown, columns)}", path=f"truth.sensors.{unknown}")


def _further_signals(vessel: Vessel) -> dict[str, str]:
    """Signal -> key in `[truth.environment]`, of what a vessel feels and no other key of the block gives."""
    return {name: order_keys(name)[1] for name in vessel_dynamics(vessel).environment if name not in WEATHER}


def _check_environment(truth: Truth, vessel: Vessel) -> None:
    """Raise DocumentError for a key that the vessel does not feel, or a signal that it feels without a key."""
    keys, path = _further_signals(vessel), "truth.environment"
    unknown = next((key for key in truth.environment if key not in keys.values()), None)
    if unknown is not None:
        remedy = suggest_name(unknown, keys.values()) if keys else "remove it"
        raise DocumentError(
            f"no term of {truth.vessel} takes it, or another key of [truth] gives it: {remedy}",
            path=f"{path}.{unknown}",
        )
    missing = next((name for name, key in keys.items() if key not in truth.environment), None)
    if missing is not None:
        raise DocumentError(
            f"missing: {truth.vessel} takes {missing}, give {keys[missing]} = [low, high]",
            path=f"{path}.{keys[missing]}",
        )


def _check_sea(truth: Truth, sea: Sea, vessel: Vessel) -> None:
    if not vessel_dynamics(vessel).drawn:
        raise DocumentError(f"{truth.vessel} has no [waves]: take a vessel that has, or no waves", path="truth.waves")
    low, high = wave_table_range(vessel)
    lost = share_outside(sea, low, high)
    if lost > MOST_LOST:
        raise DocumentError(
            f"{sea.T_p:g} s: {percent_text(lost)} of the sea's energy lies outside the tables of {truth.vessel}, "
            f"{low:g} to {high:g} rad/s; at most {percent_text(MOST_LOST)} may",
            path="truth.waves.T_p",
        )


def path_in_block(block: str, path: str) -> str:
    """Path in a document of an error in one of its manoeuvres; one of the vessel, which is named, gets the block's."""
    group, _, key = path.partition(".")
    return f"{block}.{key}" if key and group == "manoeuvre" else block


def truth_vessel(truth: Truth, vessel: Vessel) -> Vessel:
    """The vessel with the values and blocks of `truth.set`; DocumentError names the path of an error there."""
    with placed_errors(DocumentError, path="truth.set.{}".format):
        return vessel.with_values(truth.set) if truth.set else vessel


def simulate_truth(
    truth: Truth, vessel: Vessel, perform: Callable[[pd.DataFrame], pd.DataFrame] = lambda log: log
) -> pd.DataFrame:
    """Simulate and log all manoeuvres: a frame with the columns of a dataset, runs `M001`, `M002`, ...

    Mean wind, current and wave direction are constant in a run. Every run starts upright, so the first ten seconds of
    roll are a transient. u and v are horizontal, along and across the heading, and r = d(psi)/dt.

    vessel : the ship, on which the values of `truth.set` are set. perform : the log of the vessel -> that of another
        ship by the same orders, before sensors measure it.

    Raises ShipidError for a truth that is none, DocumentError if it does not fit the vessel or a manoeuvre diverges.
    """
    check_class("truth", truth, Truth, "such as Truth.model_validate(...)")
    vessel = truth_vessel(truth, vessel)
    check_truth(truth, vessel)
    environment, chi = _draw_weather(truth, vessel)
    keys = [(truth.seed, "manoeuvre", number) for number in range(truth.manoeuvres)]
    if truth.gusts is not None and "V_w" in environment:
        instants = np.arange(whole_steps(truth.length, truth.step) + 1, dtype=float)
        mean = environment["V_w"]
        environment["V_w"] = mean + gust_series(truth.gusts, mean, truth.step * instants, keys)
    with placed_errors(ShipidError, path="truth", into=DocumentError):
        frame = perform_manoeuvres(
            vessel,
            draw_manoeuvres(truth),
            step=truth.step,
            interval=truth.step if truth.sensors else truth.interval,
            duration=truth.length,
            method=truth.method,
            environment=environment,
            components=None if truth.waves is None else wave_loads(vessel, draw_components(truth.waves, chi, keys)),
            outputs=[name for name in truth.sensors if is_output(name)],
        )
    frame = perform(frame.drop(columns=[name for name in frame if str(name).startswith(ACTUAL)]))
    return measure_record(frame, truth.sensors, truth.interval, truth.seed) if truth.sensors else frame


def draw_manoeuvres(truth: Truth) -> list[Manoeuvre]:
    """The manoeuvre of every run: its block is drawn by the shares, then the quantities of the block."""
    ends = np.cumsum([block.share for block in truth.manoeuvre])
    result = []
    for number in range(truth.manoeuvres):
        at = partial(uniform_draw, truth.seed, "manoeuvre", number)
        place = int(np.searchsorted(ends, at("kind") * ends[-1], side="right"))
        result.append(truth.manoeuvre[place].manoeuvre(truth.length, at))
    return result


def _draw_weather(truth: Truth, vessel: Vessel) -> tuple[dict[str, Array], Array]:
    """What the vessel feels, channel -> (manoeuvres,) [SI], and the wave directions (manoeuvres,) [rad, towards]."""

    def between(quantity: str, limits: tuple[float, float], unit: float = 1.0) -> Array:
        low, high = limits
        draws = [uniform_draw(truth.seed, "manoeuvre", number, quantity) for number in range(truth.manoeuvres)]
        return np.asarray((low + (high - low) * np.array(draws)) * unit)

    around = (0.0, 360.0)
    further = {
        name: between(name, range_limits(key, truth.environment[key]), order_unit(name))
        for name, key in _further_signals(vessel).items()
    }
    weather = further | {
        "V_w": between("V_w", truth.wind_speed),
        "beta_w": between("beta_w", around, DEGREE),
        "V_c": between("V_c", truth.current_speed),
        "beta_c": between("beta_c", around, DEGREE),
    }
    return {name: weather[name] for name in vessel_dynamics(vessel).environment}, between("chi", around, DEGREE)


class Sensor(CheckedModel, BaseModel):
    """One sensor of a `sensors` table: column -> block, in the SI unit of the column."""

    noise: Annotated[NotNegative, Field(description="standard deviation of the white noise on each sample")] = 0.0
    bias: Annotated[
        NotNegative, Field(description="standard deviation over runs of an offset that is constant in a run")
    ] = 0.0
    latency: Annotated[NotNegative, Field(description="s by which a sample is old when it is taken")] = 0.0
    interval: Annotated[Positive | None, Field(description="s between samples; absent: one per logged row")] = None
    quantum: Annotated[NotNegative, Field(description="samples are rounded to its multiples; 0: not rounded")] = 0.0


def measure_record(fine: pd.DataFrame, sensors: Mapping[str, Sensor], interval: float, seed: int) -> pd.DataFrame:
    """Measured log of a true record: a frame with the columns of `fine` and a row every `interval` [s] of each run.

    A sample is the true value at the time minus `latency` (linear between rows; the first value before the start), plus
    bias and noise, rounded to `quantum`. Samples are taken every `Sensor.interval` from the first row on and held until
    the next. Bias and noise are normal, drawn by hash(seed, run, column). A column without a sensor is copied.

    fine : columns `run`, `t` [s] and others (SI), `t` in equal steps of which `interval` is a multiple.
    """
    logs = [_measure_run(str(run), rows, sensors, interval, seed) for run, rows in fine.groupby("run", sort=False)]
    return pd.concat(logs, ignore_index=True)


def _measure_run(
    run: str, rows: pd.DataFrame, sensors: Mapping[str, Sensor], interval: float, seed: int
) -> pd.DataFrame:
    """Measured log of one run."""
    step = float(rows["t"].iloc[-1] - rows["t"].iloc[0]) / (len(rows) - 1)
    stride = whole_steps(interval, step)
    log = rows.iloc[::stride].copy()
    for name, sensor in sensors.items():
        truth = rows[name].to_numpy(dtype=np.float64)
        truth = np.unwrap(truth) if is_wrapped_angle(name) else truth
        log[name] = _sensor_samples(sensor, truth, step, stride, (seed, run, name))
    return log


def _sensor_samples(sensor: Sensor, truth: Array, step: float, stride: int, key: tuple[Any, ...]) -> Array:
    """Output of a sensor at every `stride`-th row of the true values (N,), which are `step` [s] apart."""
    logged = np.arange(0, len(truth), stride)  # all clocks below count rows of the record from the run's first
    period = stride if sensor.interval is None else sensor.interval / step
    latest = np.floor(logged / period + SAME)  # number of the last sample taken by each logged row
    taken, which = np.unique(latest, return_inverse=True)  # samples between logged rows are not needed
    values = (
        _value_at_row(truth, taken * period - sensor.latency / step)
        + sensor.bias * _normal_draws(1, *key, "bias")
        + sensor.noise * _normal_draws(len(taken), *key, "noise")
    )
    if sensor.quantum > 0:
        values = sensor.quantum * np.rint(values / sensor.quantum)
    return np.asarray(values[which])


def _value_at_row(truth: Array, place: Array) -> Array:
    """Values (N,) at fractional row numbers: linear between rows, constant before the first, exact at a row."""
    nearest = np.rint(place)
    place = np.where(np.abs(place - nearest) < SAME, nearest, place)
    return np.asarray(np.interp(place, np.arange(len(truth)), truth))


def _normal_draws(count: int, *key: Any) -> Array:
    """Standard normal draws (count,) that depend only on the key; a longer series begins with the shorter one.

    Box-Muller transform of PCG64's raw output: NumPy guarantees the raw output for all versions, but not its normals.
    """
    raw = np.random.PCG64(int(uniform_draw(*key) * 2**53)).random_raw(2 * count).reshape(count, 2)
    first, second = ((raw >> np.uint64(11)) / 2.0**53).T
    return np.asarray(np.sqrt(-2 * np.log1p(-first)) * np.cos(2 * np.pi * second))
