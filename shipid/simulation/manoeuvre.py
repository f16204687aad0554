"""Kinds of manoeuvres for any vessel: orders as functions of time or of the state (helmsman), and initial states.

Sign convention: helm > 0 turns the ship to starboard, whatever sign the command of the vessel has.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, Field, FiniteFloat

from shipid.checked import CheckedModel, NotNegative, Positive
from shipid.errors import DocumentError, suggest_name
from shipid.measures.record import Array, Measures, Record
from shipid.measures.spiral import SpiralLevels, helm_levels, spiral_measures
from shipid.measures.stopping import stopping_measures
from shipid.measures.turning import pull_out_measures, turning_measures
from shipid.measures.zigzag import zigzag_measures
from shipid.physics import helm
from shipid.physics.helm import Helmsman
from shipid.physics.signals import SIGNALS, signal_of
from shipid.simulation.approach import Controls
from shipid.units import DEGREE, RPM
from shipid.vessel.perturb import check_rising, uniform_draw
from shipid.vessel.schema import term_blocks
from shipid.vessel.stability import yaw_growths

STRATA = 8  # strata of the range of levels


def aprbs_series(
    time: Array, *, hold: tuple[float, float], levels: tuple[float, float], key: tuple[object, ...]
) -> Array:
    """Amplitude-modulated pseudo-random binary sequence (T,) at times (T,) [s]: levels held for random times.

    Hold times are uniform in `hold` [s]. Of every eight successive levels one lies in each eighth of `levels`, at
    random (Nelles 2001, Nonlinear System Identification, ch. 17). A longer series begins with the shorter one.
    """
    most = int((time[-1] - time[0]) / hold[0]) + 1
    draws = np.array([uniform_draw(*key, "hold", number) for number in range(most)])
    ends = time[0] + np.cumsum(hold[0] + (hold[1] - hold[0]) * draws)
    slack = 1e-9 * max(1.0, float(np.abs(time).max()))  # a level ends at 3 * 0.1 where it should at 0.3
    number = np.searchsorted(ends, time + slack, side="right")
    return np.asarray(levels[0] + (levels[1] - levels[0]) * _stratified_draws(int(number[-1]) + 1, key)[number])


def limit_rate(series: Array, step: float, rate: float) -> Array:
    """Rate-limited copy of a series (T,) or (T, S): it changes by at most rate [1/s] * step [s] per sample.

    It starts at the first value and follows the series at full rate until it reaches it, like an actuator with a rate
    limit.
    """
    result = np.array(series, dtype=np.float64)
    for now in range(1, len(result)):
        result[now] = result[now - 1] + np.clip(result[now] - result[now - 1], -rate * step, rate * step)
    return result


def _stratified_draws(count: int, key: tuple[object, ...]) -> Array:
    """Stratified random numbers (count,) in [0, 1): each block of STRATA numbers has one in each equal part."""
    blocks = range(-(-count // STRATA))
    order = np.array([[uniform_draw(*key, "order", block, part) for part in range(STRATA)] for block in blocks])
    within = np.array([[uniform_draw(*key, "level", block, part) for part in range(STRATA)] for block in blocks])
    return np.asarray(((np.argsort(order, axis=1) + within) / STRATA).ravel()[:count])


Side = Literal["starboard", "port"]
DECAYS, LONGEST = 8.0, 200.0  # until a turn is steady: time constants of a small yaw, and at most ship lengths


@dataclass(frozen=True)
class Request:
    """Angles, side and times of a standard manoeuvre.

    controls, n, speed : the ship with its commands, shaft speed [rev/s] and speed [m/s] of the approach.
    angles : those that were given, at most as many as the kind takes, in its units. side : of the first turn.
    duration : of the log, or of each level of a kind that holds levels [s]; None: the default of the kind.
    passing : time for one ship length at the speed of the approach [s]. interval : between rows of the log [s].
    keys : values of the keys that all kinds have: `n_rpm`, `execute_at`, `course_deg`, `approach`.
    """

    controls: Controls
    n: float
    speed: float
    angles: tuple[float, ...]
    side: Side
    duration: float | None
    passing: float
    interval: float
    keys: Mapping[str, Any]

    def angle(self, default: float, place: int = 0) -> float:
        """The angle at a place of those given, else the default, in the unit of the kind."""
        return self.angles[place] if place < len(self.angles) else default

    def time(self, lengths: float) -> float:
        """Length of the log [s]: as asked, else a number of ship lengths after the first order."""
        return self.keys["execute_at"] + lengths * self.passing if self.duration is None else self.duration

    def settling(self, least: float) -> float:
        """Ship lengths until a turn is steady, `least` or more: the rate of a nearly neutral ship takes long.

        The time is eight time constants of a small yaw about the straight course of the approach, the slowest of all
        turns, but at most that for 200 ship lengths.
        """
        rates = yaw_growths(self.controls.vessel, self.speed, self.controls.ahead(self.n))
        decay = min(map(abs, rates)) * self.passing  # in a ship length
        return float(np.clip(DECAYS / decay if decay > 0 else np.inf, least, LONGEST))


def round_to_rows(time: float, interval: float) -> float:
    """The time [s] in whole intervals, rounded up."""
    return float(np.ceil(time / interval) * interval)


Range = tuple[FiniteFloat, FiniteFloat]
MOST_HELM, MOST_HEADING = 90.0, 180.0  # deg
Helm = Annotated[FiniteFloat, Field(ge=-MOST_HELM, le=MOST_HELM)]

STARBOARD_HELMS = (25, 20, 15, 10, 5, 3, 1)
HELMS = (*STARBOARD_HELMS, 0, *(-angle for angle in reversed(STARBOARD_HELMS)))
SPIRAL = (*HELMS, *HELMS[-2::-1])  # to the other side and back
ZIGZAG, TURN, LEVEL, STOP = 30.0, 60.0, 40.0, 80.0  # ship lengths of standard manoeuvres


Hold = Annotated[tuple[Positive, Positive], AfterValidator(check_rising)]


@dataclass(frozen=True)
class StartState:
    """Initial state of the ship: upright, all velocities 0 except the speed ahead.

    shaft : shaft speed [rev/s] of a steady straight approach in calm water; None: no approach.
    speed : speed ahead [m/s] without an approach.
    at_order : whether actuators with lag have reached their first orders; else they are at 0.
    held : whether a helmsman holds the approach on course; else the helm is amidships.
    """

    shaft: float | None = None
    speed: float = 0.0
    at_order: bool = False
    held: bool = False


class Manoeuvre(CheckedModel, BaseModel, ABC):
    """Base class of all kinds of manoeuvre: name, initial heading, initial state and orders."""

    name: Annotated[str | None, Field(description="of the run; absent: M001, M002, ...")] = None
    course_deg: Annotated[FiniteFloat, Field(description="deg, heading at t = 0")] = 0.0

    @property
    @abstractmethod
    def length(self) -> float:
        """Length of the log [s]."""

    @property
    @abstractmethod
    def start(self) -> StartState:
        """State of the ship at t = 0."""

    def helmsman(self, controls: Controls) -> Helmsman | None:  # noqa: ARG002
        """The helmsman that gives the orders from the state; None if orders depend on time only."""
        return None

    @classmethod
    def reacts(cls) -> bool:
        """Whether a helmsman gives the orders of this kind, so that they react to the motion of the ship."""
        return cls.helmsman is not Manoeuvre.helmsman

    @abstractmethod
    def inputs(self, controls: Controls, t: Array, speed: float) -> dict[str, Array]:
        """Name -> (T,): the commands [SI] at times t (T,) [s], or the inputs of the helmsman.

        speed : speed ahead [m/s] at t = 0.
        """

    def check(self, controls: Controls) -> None:
        """Raise DocumentError if the vessel with these controls cannot perform the manoeuvre."""
        self.helmsman(controls)


class OrderedManoeuvre(Manoeuvre):
    """Orders to the single commands of the vessel, from an initial speed ahead, without an approach.

    A key of `orders` is a signal with its unit, for all commands of that signal (`n_rpm`, `alpha_deg`, `delta_deg`), or
    one command (`bow.n_rpm`), which has priority. Every command needs an order.
    """

    orders: dict[str, Any] = {}
    duration: Annotated[Positive, Field(description="s")]
    start_speed: Annotated[FiniteFloat, Field(description="m/s ahead at t = 0")] = 0.0
    actuators_at: Annotated[
        Literal["order", "rest"], Field(description="where lagged actuators are at t = 0: at their first order, or 0")
    ] = "order"

    @property
    def length(self) -> float:
        """Length of the log [s]."""
        return self.duration

    @property
    def start(self) -> StartState:
        """At `start_speed`, without an approach."""
        return StartState(speed=self.start_speed, at_order=self.actuators_at == "order")

    @abstractmethod
    def series(self, key: str, t: Array) -> Array:
        """Order of a key at times (T,) [s], in the unit of the key."""

    def inputs(self, controls: Controls, t: Array, speed: float) -> dict[str, Array]:  # noqa: ARG002
        """Command -> (T,) [SI] at times t (T,) [s]; DocumentError for a command without order, or an unknown key."""
        series = {key: self.series(key, t) for key in self.orders}
        chosen = {name: order_keys(name) for name in controls.commands}
        valid = [key for pair in chosen.values() for key in pair]
        unknown = next((key for key in series if key not in valid), None)
        if unknown is not None:
            known = {*valid, *type(self).model_fields} - {"orders"}
            raise DocumentError(
                f"orders no command of {controls.vessel.name}: {suggest_name(unknown, known)}",
                path=f"manoeuvre.{unknown}",
            )
        result = {}
        for name, (single, common) in chosen.items():
            key = single if single in series else common
            if key not in series:
                raise DocumentError(
                    f"missing: {controls.vessel.name} has the command {name}, give {common} = [low, high]",
                    path=f"manoeuvre.{common}",
                )
            result[name] = series[key] * order_unit(name)
        return result

    def check(self, controls: Controls) -> None:
        """Raise DocumentError for a command without an order, or an order without a command."""
        self.inputs(controls, np.zeros(1), 0.0)


class ConstantOrders(OrderedManoeuvre):
    """Constant orders: a turn, or a straight run where the angle is zero."""

    orders: Annotated[dict[str, FiniteFloat], Field(description="key -> order, in the unit of the key")] = {}

    def series(self, key: str, t: Array) -> Array:
        """Order at times (T,), constant."""
        return np.full(len(t), self.orders[key])


class StepManoeuvre(OrderedManoeuvre):
    """Orders that change within a run: each key has random levels in its range, each held for a random time.

    Levels and times follow `excitation.aprbs`: keys change independently of each other.
    """

    orders: Annotated[dict[str, Range], Field(description="key -> least and greatest level, in the unit of the key")]
    hold: Annotated[Hold, Field(description="s, least and greatest time of a level")] = (10.0, 40.0)
    seed: Annotated[int, Field(description="of levels and times")] = 0

    def series(self, key: str, t: Array) -> Array:
        """Order at times (T,), piecewise constant."""
        return aprbs_series(t, hold=self.hold, levels=self.orders[key], key=(self.seed, "steps", key))


class ApproachedManoeuvre(Manoeuvre):
    """A manoeuvre by helm and shaft speed after an approach; t = 0 is the end of it, straight until the first order."""

    n_rpm: Annotated[FiniteFloat, Field(description="rpm ordered of all that drive the ship ahead; of forces N")]
    approach: Annotated[
        Literal["steady", "helmsman", "rest"],
        Field(description="in calm water at n_rpm until steady, helm amidships or by a helmsman; or at rest"),
    ] = "steady"
    execute_at: Annotated[NotNegative, Field(description="s of the log that go by before the first order")] = 0.0

    @property
    def start(self) -> StartState:
        """Initial state: steady straight ahead, or at rest."""
        if self.approach == "rest":
            return StartState()
        return StartState(shaft=self.n_rpm * RPM, held=self.approach == "helmsman")

    @property
    def greatest_orders(self) -> tuple[float, float]:
        """Largest helm angle [deg] and shaft speed [rpm] that the manoeuvre may order, to either side."""
        return 0.0, abs(self.n_rpm)

    def shaft(self, t: Array) -> Array:
        """Ordered shaft speed [rev/s] at times (T,) [s]."""
        return np.full(len(t), self.n_rpm * RPM)

    def helm(self, t: Array) -> Array:
        """Ordered helm angle [rad] at times (T,) [s], > 0 to starboard; amidships by default."""
        return np.zeros(len(t))

    def inputs(self, controls: Controls, t: Array, speed: float) -> dict[str, Array]:  # noqa: ARG002
        """Name -> (T,): the commands [SI] at times t (T,) [s], or the inputs of the helmsman."""
        return controls.orders(self.shaft(t), self.helm(t))

    def held(self, inputs: dict[str, Array], t: Array, helm: Mapping[str, float]) -> dict[str, Array]:
        """The inputs with the helm that holds the course of the approach [rad], by command, until the first order."""
        before = ~_is_after(self.execute_at, t)
        return inputs | {name: np.where(before, angle, inputs[name]) for name, angle in helm.items()}

    def check(self, controls: Controls) -> None:
        """Raise DocumentError for a vessel without drive or helm for it, and where the log ends before the order."""
        if not self.execute_at < self.length:
            raise DocumentError(
                f"{self.execute_at:g} s: the run ends at {self.length:g} s, before the first order: give less",
                path="manoeuvre.execute_at",
            )
        controls.orders(np.zeros(1), np.full(1, self.greatest_orders[0] * DEGREE))
        self.helmsman(controls)


class TimedManoeuvre(ApproachedManoeuvre):
    """A manoeuvre of a given duration."""

    duration: Annotated[Positive, Field(description="s")]

    @property
    def length(self) -> float:
        """Length of the log [s]."""
        return self.duration


class Trial(ApproachedManoeuvre):
    """A standard manoeuvre: `shipid manoeuvre` performs it at the scale of a ship, and runs of it are measured.

    angles : what the angles on the command line are, in their order; a `helm` is in deg.
    straight : whether the track is straight, and so is drawn from left to right.
    first : measures that the page says first, as in its table: "overshoot 1".
    ends : the measure, a time counted from the execute, at which the manoeuvre ends; "": it ends with the log.
    """

    angles: ClassVar[tuple[str, ...]] = ("helm",)
    straight: ClassVar[bool] = False
    first: ClassVar[tuple[str, ...]] = ()
    ends: ClassVar[str] = ""

    @classmethod
    @abstractmethod
    def scaled(cls, request: Request) -> Self:
        """The manoeuvre as asked, with durations in ship lengths."""

    def title(self, words: str) -> str:
        """Title with angles and side; `words` are the name of the kind."""
        return words

    @staticmethod
    @abstractmethod
    def measures(record: Record) -> Measures:
        """Measures of a run of this kind, recorded or simulated."""

    def measured(self, record: Record) -> Measures:
        """Measures of a run of this manoeuvre, of which the orders are known."""
        return self.measures(record)

    @staticmethod
    def levels(record: Record) -> SpiralLevels:  # noqa: ARG004
        """Steady levels of a spiral; of other kinds none."""
        return SpiralLevels(np.empty(0), np.empty(0), 0)


class HelmOverManoeuvre(TimedManoeuvre):
    """A manoeuvre that begins with the helm put over to one side."""

    angle_deg: Annotated[Positive, Field(le=MOST_HELM, description="deg of helm")] = 20.0
    side: Annotated[Side, Field(description="to which the ship turns first")] = "starboard"

    @property
    def greatest_orders(self) -> tuple[float, float]:
        """Helm of the turn [deg], and shaft speed [rpm]."""
        return self.angle_deg, abs(self.n_rpm)

    @property
    def sense(self) -> float:
        """+1 to starboard, -1 to port."""
        return 1.0 if self.side == "starboard" else -1.0

    def title(self, words: str) -> str:
        """Title with the helm."""
        return f"{words}, {self.angle_deg:g} deg of helm to {self.side}"

    def helm(self, t: Array) -> Array:
        """Helm angle [rad] at times (T,) [s]: amidships, then the first helm angle."""
        return np.where(_is_after(self.execute_at, t), self.sense * self.angle_deg * DEGREE, 0.0)


class TurningCircle(HelmOverManoeuvre, Trial):
    """The helm is put over and held."""

    measures = staticmethod(turning_measures)
    first: ClassVar[tuple[str, ...]] = ("advance", "tactical diameter", "steady diameter", "steady drift")
    angle_deg: Annotated[Positive, Field(le=MOST_HELM, description="deg of helm")] = 35.0

    @classmethod
    def scaled(cls, request: Request) -> Self:
        """A turning circle of 60 ship lengths."""
        return cls(angle_deg=request.angle(35.0), side=request.side, duration=request.time(TURN), **request.keys)


class PullOut(HelmOverManoeuvre, Trial):
    """A turn, then the helm amidships: a stable ship's yaw rate decays to zero."""

    measures = staticmethod(pull_out_measures)
    first: ClassVar[tuple[str, ...]] = ("turning rate", "residual rate")
    turn: Annotated[Positive, Field(description="s that the helm is over")]

    def helm(self, t: Array) -> Array:
        """Helm angle [rad] at times (T,)."""
        return np.where(_is_after(self.execute_at + self.turn, t), 0.0, super().helm(t))

    @classmethod
    def scaled(cls, request: Request) -> Self:
        """A turn of 30 ship lengths, then as many amidships or more: until the rate of a stable ship has decayed."""
        begin, end = request.keys["execute_at"], request.time(TURN)
        turn = round_to_rows(
            (end - begin) / 2, request.interval
        )  # between two rows the log would show the release after it
        if request.duration is None:
            end = begin + turn + request.passing * request.settling(TURN / 2)
        return cls(angle_deg=request.angle(20.0), side=request.side, turn=turn, duration=end, **request.keys)


class Zigzag(HelmOverManoeuvre, Trial):
    """The helm is reversed each time the heading has changed from that at the first order by the execute heading."""

    measures = staticmethod(zigzag_measures)
    angles: ClassVar[tuple[str, ...]] = ("helm", "execute heading")
    straight: ClassVar[bool] = True
    first: ClassVar[tuple[str, ...]] = ("overshoot 1", "overshoot 2", "initial turning", "period")
    execute_heading_deg: Annotated[
        Positive | None,
        Field(
            le=MOST_HEADING, description="deg off the heading at the first order, to either side; absent: as the helm"
        ),
    ] = None

    @property
    def reversal_deg(self) -> float:
        """Change of heading [deg] at which the helm is reversed."""
        return self.angle_deg if self.execute_heading_deg is None else self.execute_heading_deg

    def helmsman(self, controls: Controls) -> Helmsman:
        """The zigzag helmsman: reverses the helm at the execute heading."""
        return helm.zigzag_helmsman(controls.commands)

    def inputs(self, controls: Controls, t: Array, speed: float) -> dict[str, Array]:
        """Name -> (T,) [SI]: first helm angle, shaft speeds, whether executed, execute heading: for the helmsman."""
        reversal = np.full(len(t), self.sense * self.reversal_deg * DEGREE)
        more = {"executed": np.where(_is_after(self.execute_at, t), 1.0, 0.0), "execute_heading": reversal}
        return super().inputs(controls, t, speed) | more

    @classmethod
    def scaled(cls, request: Request) -> Self:
        """A zigzag of 30 ship lengths."""
        angle = request.angle(10.0)
        heading, time = request.angle(angle, 1), request.time(ZIGZAG)
        return cls(angle_deg=angle, execute_heading_deg=heading, side=request.side, duration=time, **request.keys)

    def title(self, words: str) -> str:
        """Title with helm and execute heading."""
        return f"{words} {self.angle_deg:g}/{self.reversal_deg:g}, first to {self.side}"

    def measured(self, record: Record) -> Measures:
        """Measures at the execute heading that was ordered; of a log it is estimated."""
        return zigzag_measures(record, execute_heading=self.reversal_deg * DEGREE)


class Spiral(Trial):
    """Direct (Dieudonne) spiral: one helm angle after another, each held until the turn is steady."""

    measures = staticmethod(spiral_measures)
    levels = staticmethod(helm_levels)
    first: ClassVar[tuple[str, ...]] = ("neutral helm", "loop width")
    angles_deg: Annotated[tuple[Helm, ...], Field(min_length=1, description="deg, > 0 to starboard, in order")] = SPIRAL
    hold: Annotated[Positive, Field(description="s that each is held")]

    @property
    def greatest_orders(self) -> tuple[float, float]:
        """Greatest angle of the levels [deg], and shaft speed [rpm]."""
        return max(map(abs, self.angles_deg)), abs(self.n_rpm)

    @property
    def length(self) -> float:
        """Length of the log [s]."""
        return self.execute_at + len(self.angles_deg) * self.hold

    def helm(self, t: Array) -> Array:
        """Helm angle [rad] at times (T,)."""
        number = np.floor((t - self.execute_at) / self.hold + 1e-9).astype(int)
        levels = np.array(self.angles_deg, dtype=float)
        return np.where(number < 0, 0.0, levels[np.clip(number, 0, len(levels) - 1)]) * DEGREE

    @classmethod
    def scaled(cls, request: Request) -> Self:
        """There and back on 29 levels of 40 ship lengths, or more: until the turn of a stable ship is steady."""
        sense = 1.0 if request.side == "starboard" else -1.0
        there = [sense * request.angle(HELMS[0]) / HELMS[0] * helm for helm in HELMS]
        hold = request.settling(LEVEL) * request.passing if request.duration is None else request.duration
        return cls(angles_deg=(*there, *there[-2::-1]), hold=hold, **request.keys)

    def title(self, words: str) -> str:
        """Title with the greatest helm."""
        return f"{words}, {max(self.angles_deg):g} deg of helm to either side"


class CrashStop(TimedManoeuvre, Trial):
    """Full astern, the helm amidships: a shaft turns the other way, of a controllable pitch the pitch is reversed."""

    measures = staticmethod(stopping_measures)
    angles: ClassVar[tuple[str, ...]] = ()
    straight: ClassVar[bool] = True
    first: ClassVar[tuple[str, ...]] = ("track reach", "head reach", "stopping time")
    ends: ClassVar[str] = "stopping time"  # when it no longer moves ahead; the log goes on astern
    astern_rpm: Annotated[
        Positive,
        Field(description="rpm ordered astern; with a controllable pitch rpm of the shaft while the pitch is astern"),
    ]

    def check(self, controls: Controls) -> None:
        """Raise DocumentError for a vessel whose thrust is known about its service speed alone."""
        super().check(controls)
        vessel = controls.vessel
        about = next((path for path, key, _ in term_blocks(vessel.document) if key == "thruster.service_speed"), None)
        if about is not None:
            message = f"{vessel.name} cannot stop: its thrust (kind service_speed) holds near its service speed alone"
            raise DocumentError(f"{message}, take a vessel with a propeller", file=vessel.file, path=about)

    @property
    def greatest_orders(self) -> tuple[float, float]:
        """No helm, and the largest shaft speed [rpm], ahead or astern."""
        return 0.0, max(abs(self.n_rpm), self.astern_rpm)

    def shaft(self, t: Array) -> Array:
        """Shaft speed [rev/s] at times (T,)."""
        return np.where(_is_after(self.execute_at, t), -self.astern_rpm, self.n_rpm) * RPM

    def inputs(self, controls: Controls, t: Array, speed: float) -> dict[str, Array]:
        """Name -> (T,): the commands [SI] at times t (T,) [s]."""
        orders, astern = super().inputs(controls, t, speed), _is_after(self.execute_at, t)
        for shaft in controls.drives:
            pitch = f"{shaft.rpartition('.')[0]}.pitch"
            if pitch in orders:
                orders |= {part: np.where(astern, -orders[part], orders[part]) for part in (shaft, pitch)}
        return orders

    @classmethod
    def scaled(cls, request: Request) -> Self:
        """A stop of 80 ship lengths, as fast astern as ahead."""
        return cls(astern_rpm=request.keys["n_rpm"], duration=request.time(STOP), **request.keys)


class Excitation(TimedManoeuvre):
    """Helm and shaft move about zero and n_rpm by random levels (APRBS), within rate limits."""

    angle_deg: Annotated[NotNegative, Field(le=MOST_HELM, description="deg, greatest helm; 0: not moved")] = 0.0
    amplitude_rpm: Annotated[NotNegative, Field(description="rpm about n_rpm at most; 0: not moved")] = 0.0
    hold: Annotated[Hold, Field(description="s, least and most of a level")] = (5.0, 20.0)
    angle_rate_deg: Annotated[Positive | None, Field(description="deg/s, limit of the ordered helm")] = None
    shaft_rate_rpm: Annotated[Positive | None, Field(description="rpm/s, limit of the ordered shaft")] = None
    seed: Annotated[int, Field(description="of the levels")] = 0

    @property
    def greatest_orders(self) -> tuple[float, float]:
        """Greatest angle [deg], and shaft speed [rpm]: mean plus amplitude."""
        return self.angle_deg, abs(self.n_rpm) + self.amplitude_rpm

    def helm(self, t: Array) -> Array:
        """Helm angle [rad] at times (T,)."""
        return self._series(t, 0, self.angle_deg, self.angle_rate_deg) * DEGREE

    def shaft(self, t: Array) -> Array:
        """Shaft speed [rev/s] at times (T,)."""
        return np.asarray((self.n_rpm + self._series(t, 1, self.amplitude_rpm, self.shaft_rate_rpm)) * RPM)

    def _series(self, t: Array, channel: int, amplitude: float, rate: float | None) -> Array:
        """Excitation (T,) of one channel (0: helm, 1: shaft) about zero, in the unit of `amplitude`."""
        after = _is_after(self.execute_at, t)
        series = np.zeros(len(t))
        if amplitude == 0 or not after.any():
            return series
        key = (self.seed, "excitation", channel)
        time = t[after] - self.execute_at
        series[after] = aprbs_series(time, hold=self.hold, levels=(-amplitude, amplitude), key=key)
        if rate is None or len(t) < 2:
            return series
        return np.asarray(limit_rate(np.concatenate([[0.0], series]), float(t[1] - t[0]), rate)[1:])


KINDS: dict[str, type[Manoeuvre]] = {
    "turning": ConstantOrders,
    "steps": StepManoeuvre,
    "turning_circle": TurningCircle,
    "pull_out": PullOut,
    "zigzag": Zigzag,
    "spiral": Spiral,
    "crash_stop": CrashStop,
    "excitation": Excitation,
}
"""Name -> class of every kind. To add one, write the class and name it here."""


def kind_name(manoeuvre: Manoeuvre) -> str:
    """Name of the kind of a manoeuvre in `KINDS`."""
    return next(name for name, kind in KINDS.items() if type(manoeuvre) is kind)


def order_unit(command: str) -> float:
    """SI units in one unit of the key that orders a command."""
    return SIGNALS[signal_of(command)].factor


def order_keys(command: str) -> tuple[str, str]:
    """Keys that order a command: its full name with the unit (`bow.n_rpm`), and its signal's for all (`n_rpm`)."""
    signal = signal_of(command)
    shown = SIGNALS[signal].shown
    suffix = f"_{shown}" if shown else ""
    return f"{command}{suffix}", f"{signal}{suffix}"


def _is_after(moment: float, t: Array) -> NDArray[np.bool_]:
    """Mask (T,): whether t >= moment [s], with a tolerance for rounding."""
    return np.asarray(t >= moment - 1e-9 * max(1.0, moment))
