"""Observer: the motion without the waves', slow forces and current, along a run and never looking ahead.

A bank of extended Kalman filters on the vessel's equations of motion. The state x of each is

    north, east, psi, u, v, r            low-frequency motion over ground [m, rad, m/s, rad/s],
    a_u, a_v, a_r                        slow body-fixed disturbance M^-1 tau [m/s^2, rad/s^2],
    current_north, current_east          current [m/s]; it sets towards north and east,
    x_w, y_w, psi_w, u_w, v_w, r_w       wave-frequency motion in body axes [m, rad, m/s, rad/s],

    nu' = f(nu - nu_c, commands, wind - current) + d(nu_c)/dt + a + white noise,   a' and current' white noise,
    xi_w'' + 2 zeta omega xi_w' + omega^2 xi_w = white noise,   measured = low frequency + wave frequency + noise.

Steady uniform current moves the water and everything in it, so the equations hold for nu - nu_c with any vessel, with
or without a [current] block. d(nu_c)/dt is that of a steady current in turning axes: where a current changes, the
ship keeps its motion over ground at first. Where an order changes the physics are least sure: the white noise of nu
grows by the change of acceleration that they compute, and fades. Filters differ in the waves, the current and the
model error that they assume; each weighs by the likelihood of its recent innovations. Sources: Fossen, Handbook of
Marine Craft Hydrodynamics and Motion Control (2021), ch. 13 (wave model) and sec. 10.3 (current); Bar-Shalom, Li,
Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), ch. 11 (multiple models).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from typing import Annotated, Any, Literal

import casadi as ca
import numpy as np
from casadi import SX
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from shipid.arguments import check_class
from shipid.checked import CheckedModel, NotNegative, Positive
from shipid.data.dataset import STANDARD_DEVIATIONS, Dataset, after_pauses, clock_slack, stretch_rows
from shipid.data.windows import PathSource, Windows
from shipid.engine.casadi import summed_rates
from shipid.engine.samples import map_over_samples
from shipid.errors import DataError, DocumentError, ShipidError, suggest_name
from shipid.metrics import position_error
from shipid.units import GRAVITY
from shipid.vessel.dynamics import Dynamics, vessel_dynamics
from shipid.vessel.load import Vessel

Array = np.ndarray

Motion = Literal["north", "east", "psi", "u", "v", "r"]
MEASURED_MOTION: tuple[Motion, ...] = ("north", "east", "psi", "u", "v", "r")
FILTER_STATES = (
    *MEASURED_MOTION,
    "a_u",
    "a_v",
    "a_r",
    "current_north",
    "current_east",
    "x_w",
    "y_w",
    "psi_w",
    "u_w",
    "v_w",
    "r_w",
)
NUM_LOW_STATES = 11  # states before those of the waves
FILTER_NUMBERS = (
    *("q_u", "q_v", "q_r", "force_u", "force_v", "force_r", "current", "jump", "settle", "memory"),
    *("wave_u", "wave_v", "wave_r", "omega", "zeta"),
)
ESTIMATE_COLUMNS = (*MEASURED_MOTION, "X", "Y", "N", "current_north", "current_east")
"""Estimates as columns, `observer.u`, ...; X, Y, N are the slow force as acceleration, M^-1 tau [m/s^2, rad/s^2]."""
AGE_COLUMN = "observer.age"
"""Column: time [s] since the observer began. It needs some 20 sqrt(L / g) to settle."""
DIVERGED = 1e9  # SI: no state, variance or likelihood of a sound filter is so large
SPIKE = 300.0  # standard deviations: a measurement as far off is a fault of the log and moves nothing
FADES = (0.0, 3.0, 6.0, 12.0, 20.0, 40.0, 1e6)  # x sqrt(L / g): between which `tune_observer` chooses
YAW_CHANGE = 3.0  # change of the moment, x I_z g / L, over that of the force, x m g
LONGEST_FILTER_STEP = (
    0.6  # x sqrt(L / g): by longer steps of the filters the midpoint rule takes its own error for a force
)
MOST_FILTER_STEPS = 1000  # steps of the filters between two rows: rows further apart are a clock in a wrong unit
LONGEST_PAUSE = 6.0  # x sqrt(L / g): after a longer time without rows what the physics did is worse than to begin anew
STEP_SLACK = 1e-5  # of a step: so much longer than the longest it is still one
CALM_WIND = 1e-6  # m/s: keeps the direction of no wind defined
TRACE_OF_WIND = 1e-12  # m/s: of a wind that is exactly 0, so that its direction has a derivative


class Observer(CheckedModel, BaseModel):
    """The `[observer]` block of a study. Without a unit: by the ship's size, in units of L, g, sqrt(g L), sqrt(L / g).

    With L = 28.9 m these are 28.9 m, 9.81 m/s^2, 16.8 m/s, 1.72 s; for yaw g / L = 0.339 rad/s^2, sqrt(g / L) = 0.583
    rad/s.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    measured: Annotated[tuple[Motion, ...], Field(description="columns that are measurements; always `psi`")] = (
        MEASURED_MOTION
    )
    force: Annotated[NotNegative, Field(description="standard deviation of the slow force at first, x m g")] = 3e-3
    moment: Annotated[NotNegative, Field(description="the same of the yaw moment, x I_z g / L")] = 9e-3
    change: Annotated[
        tuple[NotNegative, ...],
        Field(
            min_length=1,
            description="levels: change of the force in 1 s, x m g; of the moment 3 times, x I_z g / L",
        ),
    ] = (1e-5, 2e-4)
    model_error: Annotated[
        NotNegative,
        Field(description="white acceleration over the change of the slow one, sqrt(s); level 0 of `waves` alone"),
    ] = 10.0
    jump: Annotated[NotNegative, Field(description="share of a change by an order that the physics may miss")] = 1.0
    settle: Annotated[Positive, Field(description="time in which that ends, x sqrt(L / g)")] = 2.0
    current: Annotated[NotNegative, Field(description="standard deviation of the current, x sqrt(g L); 0: none")] = 0.03
    waves: Annotated[
        tuple[NotNegative, ...], Field(min_length=1, description="levels of wave-frequency u and v, x sqrt(g L)")
    ] = (0.0, 5e-3, 2e-2)
    period: Annotated[Positive, Field(description="of the waves met, x sqrt(L / g)")] = 2.9
    damping: Annotated[FiniteFloat, Field(gt=0, lt=1, description="of the wave model: how broad the waves are")] = 0.5
    noise: Annotated[
        dict[Motion, Positive], Field(description="column -> standard deviation of a sample, SI; others by size")
    ] = {}
    memory: Annotated[Positive, Field(description="time in which likelihoods are forgotten, x sqrt(L / g)")] = 20.0
    fade: Annotated[
        NotNegative,
        Field(description="time in which the force fades ahead, x sqrt(L / g); 0: no force; very large: it lasts"),
    ] = 12.0
    choose: Annotated[
        bool,
        Field(description="levels of waves, current, change, and fade by the error of prediction on training runs"),
    ] = False

    @model_validator(mode="after")
    def _seen(self) -> Observer:
        if "psi" not in self.measured:
            raise ValueError("measured lacks 'psi': every force turns with the heading, add it")
        if self.current and not {"north", "east"} <= set(self.measured):
            raise ValueError("current cannot be seen without the positions 'north' and 'east' in measured: set it to 0")
        return self


@dataclass(frozen=True)
class FilterBank:
    """Numbers of every filter of one vessel in SI units.

    numbers : (K, len(NUMBERS)). noise : (6,) standard deviations of samples. first : (K, 17) those of the first state
    in addition to the measured ones. fade : time constant [s] of the force ahead. mass : (3, 3), tau = mass @ a.
    longest : step [s] beyond which the time between two rows is divided. pause : time [s] between two rows, see
    `after_pauses`, beyond which the filters begin anew.
    """

    vessel: Vessel
    settings: Observer
    numbers: Array
    noise: Array
    first: Array
    fade: float
    mass: Array
    longest: float
    pause: float

    @cached_property
    def model(self) -> Dynamics:
        """Equations of the vessel."""
        return vessel_dynamics(self.vessel)

    @property
    def num_filters(self) -> int:
        """Number of filters K."""
        return len(self.numbers)

    def parts(self, dt: Array) -> NDArray[np.int64]:
        """Number of equal steps that the filters take in a time dt [s] between rows, the last with the measurement."""
        return np.maximum(np.ceil(dt / self.longest - STEP_SLACK), 1).astype(np.int64)


def filter_bank(vessel: Vessel, settings: Observer | None = None) -> FilterBank:
    """Filters for a vessel of three degrees of freedom; DocumentError for another, and for no vessel."""
    check_class("vessel", vessel, Vessel, "as of `load_vessel`", DocumentError)
    settings = Observer() if settings is None else settings
    check_class("settings", settings, Observer, "such as Observer(), or None", DocumentError)
    model = vessel_dynamics(vessel)
    if model.num_dof != 3 or model.hidden:
        raise DocumentError(
            f"{vessel.name} has {model.num_dof} degrees of freedom, the observer takes 3: use the model it extends",
            file=vessel.file,
            path="dof",
        )
    length = vessel.length or 0.0
    if not length:
        raise DocumentError(
            f"{vessel.name} has no particulars.L_pp, by which the observer scales its numbers: add it",
            file=vessel.file,
            path="particulars.L_pp",
        )
    time, speed = np.sqrt(length / GRAVITY), np.sqrt(GRAVITY * length)
    linear, yaw = GRAVITY, GRAVITY / length
    currents = dict.fromkeys([0.0, settings.current])
    omega = 2 * np.pi / (settings.period * time)
    numbers, first = [], []
    for change, current, wave in product(settings.change, currents, settings.waves):
        a = change * linear, change * linear, change * YAW_CHANGE * yaw
        w = wave * speed + 1e-9, wave * speed + 1e-9, 2.5 * wave / time + 1e-9
        q = (0.0 if wave else settings.model_error * x for x in a)  # in waves their motion takes its place
        numbers.append(
            [
                *(*q, *a, current / 300 * speed, settings.jump),
                *(settings.settle * time, settings.memory * time, *w, omega, settings.damping),
            ]
        )
        slow = [settings.force * linear, settings.force * linear, settings.moment * yaw]
        first.append([0.0] * 6 + slow + [current * speed] * 2 + [x / omega for x in w] + [*w])
    sizes = zip(MEASURED_MOTION, (length, length, 1.0, speed, speed, 1 / time), strict=True)
    noise = np.array([settings.noise.get(name, 5e-4 * size) for name, size in sizes])
    return FilterBank(
        vessel, settings, np.array(numbers), noise, np.array(first), settings.fade * time, vessel.mass,
        LONGEST_FILTER_STEP * time, LONGEST_PAUSE * time,
    )  # fmt: skip


@lru_cache(maxsize=16)
def filter_function(model: Dynamics) -> ca.Function:
    """One step of a filter as a pure SX function; the midpoint rule integrates the motion.

    (state, commands, environment, parameters, measured, noise, numbers, dt) -> (state, estimate, innovation, spread).
    state packs x, P by columns, actuators' memory, unsettled acceleration, the commands before and the log-likelihood
    remembered; their lengths are `filter_state_sizes`. commands and environment are those in force since the instant
    before; a measurement (6,) that is NaN is left out. innovation (6,) and spread (6,) are those of the prediction,
    before any update.
    """
    count = len(FILTER_STATES)
    state = SX.sym("state", sum(filter_state_sizes(model)))
    x, packed, memory, unsettled, before, likelihood = ca.vertsplit(
        state, [0, *np.cumsum(filter_state_sizes(model)).tolist()]
    )
    covariance = ca.reshape(packed, count, count)
    commands, environment = SX.sym("commands", len(model.commands)), SX.sym("environment", len(model.environment))
    parameters, measured = SX.sym("parameters", len(model.parameters)), SX.sym("measured", 6)
    noise, numbers, dt = SX.sym("noise", 6), SX.sym("numbers", len(FILTER_NUMBERS)), SX.sym("dt")
    number = dict(zip(FILTER_NUMBERS, ca.vertsplit(numbers), strict=True))

    def rates(low: SX, inner: SX, orders: SX) -> SX:
        return _low_rates(model, low, inner, orders, environment, parameters)

    def advance(inner: SX, step: Any) -> SX:
        return model.advance(x[:6], inner, commands, environment, parameters, step)

    middle = x[:NUM_LOW_STATES] + dt / 2 * rates(x[:NUM_LOW_STATES], memory, commands)
    low = x[:NUM_LOW_STATES] + dt * rates(middle, advance(memory, dt / 2), commands)
    reached = advance(memory, dt)
    jump = ca.fabs(rates(x[:NUM_LOW_STATES], reached, commands) - rates(x[:NUM_LOW_STATES], memory, before))[3:6]
    restless = unsettled * ca.exp(-dt / number["settle"]) + jump
    wave, wave_noise = _wave_transition(number, dt)
    ahead = ca.vertcat(low, wave @ x[NUM_LOW_STATES:])
    spread = ca.diagcat(_covariance_growth(number, x[2], restless, dt), wave_noise)
    slope = ca.jacobian(ahead, x)
    predicted = _symmetric_from_lower(slope @ covariance @ slope.T + spread)
    seen = SX.sym("seen", count)
    output = _measured_output(seen)
    rows = ca.substitute(ca.jacobian(output, seen), seen, ahead)
    output = ca.substitute(output, seen, ahead)
    after, left, likelihood = ahead, predicted, likelihood * ca.exp(-dt / number["memory"])
    innovations, spreads = [], []
    for i in range(6):  # one at a time: independent noise, and no matrix to invert
        given = ca.fabs(measured[i]) < np.inf  # false for NaN; x == x would be simplified away
        innovation = ca.if_else(given, measured[i], output[i]) - output[i]
        if MEASURED_MOTION[i] == "psi":  # a compass counts from 0 again
            innovation -= 2 * np.pi * ca.floor(innovation / (2 * np.pi) + 0.5)
        innovations.append(innovation)
        spreads.append(rows[i, :] @ predicted @ rows[i, :].T + noise[i] ** 2)
        column = left @ rows[i, :].T
        variance = rows[i, :] @ column + noise[i] ** 2
        surprise = innovation - rows[i, :] @ (after - ahead)
        square = surprise**2 / variance
        share = ca.if_else(ca.logic_and(given, square < SPIKE**2), 1 / variance, 0)
        after, left = after + column * (share * surprise), _symmetric_from_lower(left - column @ column.T * share)
        likelihood -= ca.if_else(given, (ca.fmin(square, SPIKE**2) + ca.log(variance)) / 2, 0)
    left = ca.reshape(ca.densify(left), -1, 1)
    packed_after = ca.vertcat(after, left, reached, restless, commands, likelihood)
    return ca.Function(
        "observer_filter",
        [state, commands, environment, parameters, measured, noise, numbers, dt],
        [packed_after, after[:NUM_LOW_STATES], ca.vertcat(*innovations), ca.vertcat(*spreads)],
        ["state", "commands", "environment", "parameters", "measured", "noise", "numbers", "dt"],
        ["after", "estimate", "innovation", "spread"],
        {"cse": True},
    )


def filters_function(model: Dynamics, num_filters: int) -> ca.Function:
    """`filter_function` for the states (n, K) and numbers (., K) of K filters; their other inputs are the same."""
    one, count = filter_function(model), num_filters
    each = {"state": count, "numbers": count}
    inputs = [ca.MX.sym(name, one.size1_in(name), each.get(name, 1)) for name in one.name_in()]
    repeated = [part if part.shape[1] == count else ca.MX(0, count) if part.is_empty() else ca.repmat(part, 1, count)
                for part in inputs]  # fmt: skip
    return ca.Function("filters", inputs, one.map(count).call(repeated), one.name_in(), one.name_out())


@lru_cache(maxsize=16)
def observer_function(model: Dynamics, num_filters: int) -> ca.Function:
    """The whole observer's step as a pure function of CasADi, for K filters; `run_observer` and exported C follow it.

    (states (n, K), commands, environment, parameters, measured, noise, numbers (., K), dt) -> (states, estimate (11,),
    innovation (6,), spread (6,), weights (K,)); estimates are means by the weights, the innovation that of the mixture.
    A dt beyond `Bank.longest` is to be divided by `Bank.parts`: call it for each part, with NaN for the measurement in
    all but the last. After a pause beyond `Bank.pause` take the states of `first_filter_states`.
    """
    filters = filters_function(model, num_filters)
    inputs = [ca.MX.sym(name, *filters.size_in(name)) for name in filters.name_in()]
    after, estimate, innovation, spread = filters(*inputs)
    sound = ca.sum1(ca.fabs(after) < DIVERGED) > after.size1() - 0.5  # false for what is not a number, too
    after = _bounded_expression(after)
    likelihood = after[-1, :] * sound - DIVERGED * (1 - sound)
    weights = ca.exp(likelihood - ca.mmax(likelihood)).T
    weights = weights / ca.sum1(weights)
    best = likelihood == ca.mmax(likelihood)
    likely = after @ (best / ca.sum2(best)).T
    after = after * ca.repmat(sound, after.size1(), 1) + likely @ (1 - sound)  # a filter that diverged begins again
    results = [after, *(_bounded_expression(part) @ weights for part in (estimate, innovation, spread)), weights]
    return ca.Function("observer", inputs, results, filters.name_in(), [*filters.name_out(), "weights"])


def _bounded_expression(matrix: ca.MX) -> ca.MX:
    """The matrix within +-DIVERGED; what is not a number becomes a bound, since fmax and fmin leave NaN out."""
    return ca.fmin(ca.fmax(matrix, -DIVERGED), DIVERGED)


def _symmetric_from_lower(matrix: SX) -> SX:
    """The lower triangle on both sides: the other half is never computed."""
    return ca.tril2symm(ca.tril(matrix))


def filter_state_sizes(model: Dynamics) -> tuple[int, ...]:
    """Lengths of what a filter's state packs: x, P, memory, unsettled, commands before, log-likelihood."""
    return len(FILTER_STATES), len(FILTER_STATES) ** 2, len(model.memory), 3, len(model.commands), 1


def _low_rates(model: Dynamics, low: SX, memory: SX, commands: SX, environment: SX, parameters: SX) -> SX:
    """d(low)/dt (11): the vessel's equations in water that moves with the current."""
    psi, r, north, east = low[2], low[5], low[9], low[10]
    c, s = ca.cos(psi), ca.sin(psi)
    u_c, v_c = c * north + s * east, c * east - s * north
    names = dict(zip(model.environment, ca.vertsplit(environment) if model.environment else [], strict=True))
    if "V_w" in names:
        ahead = names["V_w"] * ca.cos(names["beta_w"]) - north + CALM_WIND
        across = names["V_w"] * ca.sin(names["beta_w"]) - east
        names |= {"V_w": ca.sqrt(ahead**2 + across**2), "beta_w": ca.atan2(across, ahead)}
    names |= {name: SX(0) for name in ("V_c", "beta_c") if name in names}
    through = ca.vertcat(low[:3], low[3] - u_c, low[4] - v_c, r)
    inputs = [through, memory, commands, ca.vertcat(SX(0, 1), *names.values()), parameters]
    forced = summed_rates(model, inputs, SX.zeros(3), {})
    turning = ca.vertcat(r * v_c, -r * u_c, 0)
    return ca.vertcat(
        c * low[3] - s * low[4], s * low[3] + c * low[4], r, forced[3:6] + turning + low[6:9], SX.zeros(5)
    )


def _covariance_growth(number: Mapping[str, SX], psi: SX, restless: SX, dt: SX) -> SX:
    """Covariance (11, 11) that white accelerations, changing forces and currents add in dt."""
    turn = SX(3, 3)
    turn[0, 0], turn[0, 1], turn[1, 0], turn[1, 1], turn[2, 2] = ca.cos(psi), -ca.sin(psi), ca.sin(psi), ca.cos(psi), 1
    white = ca.vertcat(*(number[f"q_{name}"] for name in "uvr"))
    power = ca.diag(white**2 + (number["jump"] * restless) ** 2)
    force = ca.diag(ca.vertcat(*(number[f"force_{name}"] for name in "uvr")) ** 2)
    cross = turn @ power * dt**2 / 2
    moving = ca.blockcat([[turn @ power @ turn.T * dt**3 / 3, cross], [cross.T, power * dt]])
    return ca.diagcat(moving, force * dt, SX.eye(2) * number["current"] ** 2 * dt)


def _wave_transition(number: Mapping[str, SX], dt: SX) -> tuple[SX, SX]:
    """Exact transition (6, 6) of the three wave oscillators in dt, and the covariance that keeps them stationary."""
    omega, zeta = number["omega"], number["zeta"]
    damped = omega * ca.sqrt(1 - zeta**2)
    decay, c, s = ca.exp(-zeta * omega * dt), ca.cos(damped * dt), ca.sin(damped * dt) / damped
    block = SX(2, 2)
    block[0, 0], block[0, 1] = decay * (c + zeta * omega * s), decay * s
    block[1, 0], block[1, 1] = -decay * omega**2 * s, decay * (c - zeta * omega * s)
    speeds = ca.vertcat(*(number[f"wave_{name}"] for name in "uvr")) ** 2
    transition = ca.kron(block, SX.eye(3))
    steady = ca.diag(ca.vertcat(speeds / omega**2, speeds))
    return transition, steady - transition @ steady @ transition.T


def _measured_output(x: SX) -> SX:
    """The measurement (6) of a state."""
    c, s = ca.cos(x[2]), ca.sin(x[2])
    return ca.vertcat(x[0] + c * x[11] - s * x[12], x[1] + s * x[11] + c * x[12], x[2] + x[13], x[3:6] + x[14:17])


def first_filter_states(filters: FilterBank, measured: Array, commands: Array) -> Array:
    """States (n, K) at the first instant: measured (6,) and commands (nc,), which every actuator has reached.

    What is missing (NaN) is zero with a wide spread.
    """
    model, wide = filters.model, np.array([1e3, 1e3, np.pi, 5.0, 1.0, 0.1])
    missing = ~np.isfinite(measured) | ~np.isin(MEASURED_MOTION, filters.settings.measured)
    x = np.zeros(len(FILTER_STATES))
    x[:6] = np.where(missing, 0.0, measured)
    memory = np.asarray(commands)[[model.commands.index(name) for name in model.memory]]
    columns = []
    for first in filters.first:
        motion = np.hypot(2 * filters.noise, first[NUM_LOW_STATES:])
        deviations = np.concatenate([np.where(missing, wide, motion), first[6:]])
        columns.append(np.concatenate([x, np.diag(deviations**2).ravel(), memory, np.zeros(3), commands, [0.0]]))
    return np.stack(columns, axis=1)


@dataclass(frozen=True, eq=False)
class Estimates:
    """What the observer knows at every row of a dataset, from that row and those before it alone.

    columns : `observer.u`, ... (N,), in the order of the table; see ESTIMATE_COLUMNS and AGE_COLUMN. `observer.test` is
        the mean normalised innovation squared of the measurements that are not left out: 1 where the assumptions hold.
    """

    columns: dict[str, Array]

    def select(self, rows: Array) -> Estimates:
        """Estimates at some rows: a mask or indices."""
        return Estimates({name: values[rows] for name, values in self.columns.items()})


def run_observer(vessel: Vessel, dataset: Dataset, settings: Observer | None = None, *, calls: float = 1) -> Estimates:
    """Run the observer along every unbroken stretch of a dataset, all of them together.

    It begins anew after a pause in the rows of more than 6 sqrt(L / g), as the recorder of exported C does. Wind that
    is not measured is zero. `calls` is how many calls of this size are to come in all: for many it pays to
    compile. Raises DocumentError for a vessel that is not of three degrees of freedom, ShipidError for a command that
    the dataset lacks, DataError for rows hours apart.
    """
    check_class("dataset", dataset, Dataset, "as of `read_dataset`", DataError)
    filters, frame = filter_bank(vessel, settings), dataset.frame
    model = filters.model
    missing = next((name for name in model.commands if name not in frame), None)
    if missing is not None:
        raise ShipidError(f"{vessel.name} takes {missing!r}: {suggest_name(missing, dataset.commands)}")
    table = {name: frame[name].to_numpy(dtype=float) for name in map(str, frame) if name not in ("run", "flags")}
    places = [
        part
        for _, rows in stretch_rows(dataset)
        for part in np.split(rows, np.flatnonzero(after_pauses(table["t"][rows], filters.pause)))
    ]
    _check_intervals(dataset, filters, places)
    places = sorted(places, key=len, reverse=True)  # those that end first last
    zero = np.zeros(len(frame))
    commands, weather = (
        np.array([table.get(name, zero) for name in names]).reshape(-1, len(frame)).T
        for names in (model.commands, model.environment)  # a ship adrift has no commands
    )
    measured = np.stack([table[name] for name in MEASURED_MOTION], axis=1)
    measured[:, [name not in filters.settings.measured for name in MEASURED_MOTION]] = np.nan
    noise = np.tile(filters.noise, (len(frame), 1))
    for name, column in STANDARD_DEVIATIONS.items():
        if column in table:
            noise[:, MEASURED_MOTION.index(name)] = np.hypot(noise[:, MEASURED_MOTION.index(name)], table[column])
    count = filters.num_filters
    innovation, spread = np.full((len(frame), 6), np.nan), np.full((len(frame), 6), np.nan)
    estimate, age = np.zeros((len(frame), NUM_LOW_STATES)), np.zeros(len(frame))
    starts = np.array([rows[0] for rows in places])
    states = np.concatenate([first_filter_states(filters, measured[row], commands[row]) for row in starts], axis=1)
    estimate[starts, :6] = np.where(np.isnan(measured[starts]), 0.0, measured[starts])
    values = np.array(list(vessel.parameters.values()))
    step = map_over_samples(filter_function(model), calls * len(frame) * count, shared=["parameters"])
    for k in range(1, len(places[0])):
        going = sum(len(rows) > k for rows in places)
        now, past = (np.array([rows[i] for rows in places[:going]]) for i in (k, k - 1))
        dt = table["t"][now] - table["t"][past]
        each = (np.repeat(part[rows].T, count, axis=1) for part, rows in ((commands, past), (weather, past)))
        seen = (np.repeat(part[now].T, count, axis=1) for part in (measured, noise))
        given = (*each, values, *seen, np.tile(filters.numbers.T, (1, going)))
        results = _step_in_parts(step, filters, states[:, : going * count], given, np.repeat(dt, count))
        states, estimate[now], innovation[now], spread[now] = _mix_filters(results, count)
        innovation[now] = np.where(np.isnan(measured[now]), np.nan, innovation[now])
        age[now] = age[past] + dt
    columns = {f"observer.{name}": estimate[:, i] for i, name in enumerate(ESTIMATE_COLUMNS)}
    with np.errstate(invalid="ignore"):
        squares = innovation**2 / spread
        given = squares < SPIKE**2  # false for NaN, and for a fault of the log, which moves nothing
    columns["observer.test"] = np.where(given, squares, 0.0).sum(axis=1) / np.maximum(given.sum(axis=1), 1)
    columns[AGE_COLUMN] = age
    return Estimates(columns)


def _check_intervals(dataset: Dataset, filters: FilterBank, places: Sequence[NDArray[np.intp]]) -> None:
    """DataError where rows that are no pause lie so far apart that the filters would take all day between them."""
    t = dataset.frame["t"].to_numpy()
    apart = max((float(np.max(np.diff(t[rows]), initial=0.0)) for rows in places), default=0.0)
    if apart > MOST_FILTER_STEPS * filters.longest:
        longest = f"{MOST_FILTER_STEPS * filters.longest:.3g} s"
        raise DataError(
            f"rows are up to {apart:.3g} s apart: the observer takes rows of {filters.vessel.name} at most {longest} "
            "apart; is the unit of the clock right?",
            path="t",
        )


def _step_in_parts(
    step: Callable[..., list[Array]], filters: FilterBank, states: Array, given: Sequence[Array], dt: Array
) -> list[Array]:
    """What `step` gives after dt (S,), in the parts that the filters take; `given` as by `filter_function`.

    On the way nothing is measured.
    """
    parts = filters.parts(dt)
    for part in range(1, parts.max()):
        on = parts > part
        commands, weather, values, measured, noise, numbers = given
        some = commands[:, on], weather[:, on], values, np.full_like(measured[:, on], np.nan), noise[:, on]
        states[:, on] = step(states[:, on], *some, numbers[:, on], (dt / parts)[None, on])[0]
    return step(states, *given, (dt / parts)[None])


def _mix_filters(results: Sequence[Array], count: int) -> tuple[Array, ...]:
    """What K = `count` filters of every stretch know together: the rule of `observer_function`, in NumPy.

    results : of the filters, (., R K) each, those of a stretch side by side. Returns states (n, R K), then estimate,
    innovation and spread (R, .).
    """
    after, *parts = (part.reshape(len(part), -1, count) for part in results)
    sound = (np.abs(after) < DIVERGED).all(axis=0)
    likelihood = np.where(sound, np.nan_to_num(after[-1]), -DIVERGED)
    weights = np.exp(likelihood - likelihood.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    if not sound.all():  # a filter that diverged begins again from the likeliest
        after = _bounded_array(after)
        best = likelihood == likelihood.max(axis=1, keepdims=True)
        after = np.where(sound, after, (after * best / best.sum(axis=1, keepdims=True)).sum(axis=2, keepdims=True))
    means = (np.einsum("irk,rk->ri", _bounded_array(part), weights) for part in parts)
    return (after.reshape(len(after), -1), *means)


def _bounded_array(values: Array) -> Array:
    """The values within +-DIVERGED; what is not a number becomes a bound, as by `_bounded_expression`."""
    return np.asarray(np.fmin(np.fmax(values, -DIVERGED), DIVERGED))


@dataclass(frozen=True, eq=False)
class ObservedStart:
    """What the physics starts from with an observer, for S instants and T steps.

    columns : (S,) the filtered state through the water, in place of the measured one.
    environment : wind relative to the moving water, name -> (S,); the current itself is zero.
    tau_extra : (T, S, 3) slow force [N, N m] over the horizon.
    drift : (2, S) velocity of the water towards north and east [m/s], to be added to the path.
    """

    columns: dict[str, Array]
    environment: dict[str, Array]
    tau_extra: Array
    drift: Array


def observed_start(
    filters: FilterBank,
    columns: Mapping[str, Array],
    horizon: int,
    step: float,
    path: PathSource = "position",
) -> ObservedStart:
    """The filtered state, the wind and the slow force that a rollout in moving water takes.

    Parameters
    ----------
    columns : of the instants (S,), measured and `observer.*`; wind that is missing is zero.
    path : as in `cut_windows`: with "velocity" the true path starts where the ship is, whatever its filtered position.
    """
    model, zero = filters.model, np.zeros(len(columns["u"]))
    begun: dict[str, Array] = {**columns}
    begun |= {name: columns[f"observer.{name}"] for name in MEASURED_MOTION}
    if path != "position" or not {"north", "east"} <= set(filters.settings.measured):  # where the ship is
        begun |= {name: columns.get(name, zero) for name in ("north", "east")}
    north, east, psi = columns["observer.current_north"], columns["observer.current_east"], begun["psi"]
    begun["u"] = begun["u"] - north * np.cos(psi) - east * np.sin(psi)
    begun["v"] = begun["v"] + north * np.sin(psi) - east * np.cos(psi)
    environment = {name: columns.get(name, zero) for name in model.environment}
    if "V_w" in environment:
        V_w, beta_w = environment["V_w"], environment["beta_w"]
        ahead, across = V_w * np.cos(beta_w) - north, V_w * np.sin(beta_w) - east
        ahead = ahead + np.where(ahead**2 + across**2 == 0, TRACE_OF_WIND, 0.0)
        environment |= {"V_w": np.hypot(ahead, across), "beta_w": np.arctan2(across, ahead)}
    environment |= {name: zero for name in ("V_c", "beta_c") if name in environment}
    now = np.stack([columns[f"observer.{name}"] for name in "XYN"], axis=1) @ filters.mass.T
    ages = (np.arange(horizon) + 0.5) * step
    faded = np.exp(-ages / filters.fade) if filters.fade > 0 else np.zeros(horizon)
    return ObservedStart(begun, environment, faded[:, None, None] * now, np.stack([north, east]))


def estimates_at_windows(dataset: Dataset, estimates: Estimates, windows: Windows) -> dict[str, Array]:
    """Columns of windows, with the estimates `observer.*` (S,) of the last row at or before each instant.

    `estimates` are of the rows of `dataset`. The heading counts full turns as that of the windows does.
    """
    if len(estimates.columns[AGE_COLUMN]) != len(dataset.frame):
        raise ValueError(f"{len(estimates.columns[AGE_COLUMN])} estimates for {len(dataset.frame)} rows")
    frame, index = dataset.frame, np.zeros(len(windows), dtype=np.intp)
    t, names = frame["t"].to_numpy(), frame["run"].to_numpy()
    for run in windows.spans:
        rows, chosen = np.flatnonzero(names == run), windows.run == run
        index[chosen] = rows[np.searchsorted(t[rows], windows.t[chosen] + clock_slack(t[rows]), side="right") - 1]
    known = {name: values[index] for name, values in estimates.columns.items()}
    known[AGE_COLUMN] = known[AGE_COLUMN] + windows.t - t[index]
    turns = np.round((windows.columns["psi"] - known["observer.psi"]) / (2 * np.pi))
    return {**windows.columns, **known, "observer.psi": known["observer.psi"] + 2 * np.pi * turns}


def tune_observer(
    vessel: Vessel,
    dataset: Dataset,
    windows: Windows,
    paths: Callable[[Observer, Mapping[str, Array]], Array],
    settings: Observer | None = None,
) -> tuple[Observer, dict[str, float]]:
    """Settings with the least mean error of prediction on training runs: coordinate search over a small grid.

    In turn: all levels of `waves` or one of them, a current or none, all levels of `change` or one of them; for each of
    these how the force fades: as given, or by one of `FADES`. The given levels are the grid.

    Parameters
    ----------
    vessel : the physics, without any method.
    dataset : the training runs, as the observer sees them.
    windows : of these runs: instants of prediction and true paths.
    paths : (settings, columns of the windows with the estimates `observer.*`) -> predicted paths (T, S, 2) [m], as of
        `shipid.hybrid.physics.Physics.paths`.
    settings : the levels, and what is not searched.

    Returns
    -------
    The settings, with `choose` false, and the mean error [m] of each that was tried, by what was changed. A window
    whose path is no number counts as 1e9 m.
    """
    first = (settings or Observer()).model_copy(update={"choose": False})
    tried: dict[str, float] = {}

    def loss(one: Observer, columns: Mapping[str, Array]) -> float:
        with np.errstate(invalid="ignore", over="ignore"):
            each = position_error(paths(one, columns), windows.future).mean(axis=0)
        return float(np.where(np.isfinite(each), each, DIVERGED).mean())

    def faded(given: Observer, label: str) -> tuple[float, Observer]:
        alike = samples / filter_bank(vessel, given).num_filters  # the fewer the filters, the smaller the call
        columns = estimates_at_windows(dataset, run_observer(vessel, dataset, given, calls=alike), windows)
        options = [given.model_copy(update={"fade": fade}) for fade in dict.fromkeys((given.fade, *FADES))]
        losses = [loss(one, columns) for one in options]
        tried.update({f"{label}, fade {one.fade}": each for one, each in zip(options, losses, strict=True)})
        place = int(np.argmin(losses))
        return losses[place], options[place]

    waves, change = ([(one,) for one in several] if len(several) > 1 else [] for several in (first.waves, first.change))
    levels: dict[str, Sequence[Any]] = {"waves": waves, "current": (0.0,), "change": change}
    samples = (1 + sum(map(len, levels.values()))) * filter_bank(vessel, first).num_filters
    least, best = faded(first, "as given")
    for name, values in levels.items():
        begun = best
        for value in values:
            if getattr(begun, name) != value:
                error, one = faded(begun.model_copy(update={name: value}), f"{name} {value}")
                least, best = (error, one) if error < least else (least, best)
    return best, tried
