"""Standard manoeuvres of any vessel, as blocks: turning, zigzag, pull-out, spirals, crash stop, excitation, DP.

Helm angles are counted by what they do: helm > 0 turns the ship to starboard, whatever sign a command needs for it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from shipid.errors import DocumentError, choices
from shipid.physics import SIGNALS, helm
from shipid.physics.helm import Helmsman
from shipid.simulation.approach import Controls, helm_effect, thrust_sharing
from shipid.simulation.excitation import aprbs, deal, limit_rate, multisine
from shipid.units import DEGREE, RPM

Array = NDArray[np.float64]
Positive = Annotated[FiniteFloat, Field(gt=0)]
NotNegative = Annotated[FiniteFloat, Field(ge=0)]

HELMS = (25, 20, 15, 10, 5, 3, 1, 0, -1, -3, -5, -10, -15, -20, -25)
SPIRAL = (*HELMS, *HELMS[-2::-1])  # to the other side and back
RATES = (3, 2, 1, 0.5, 0, -0.5, -1, -2, -3)
SETTLES = 40.0  # rad: omega x hold of the reverse spiral's helmsman


class Manoeuvre(BaseModel, ABC):
    """What all kinds share: the approach, at whose end the log begins with t = 0."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    name: Annotated[str | None, Field(description="of the run; absent: M001, M002, ...")] = None
    n_rpm: Annotated[FiniteFloat, Field(description="rpm ordered of all that drive the ship ahead")]
    approach: Annotated[
        Literal["steady", "rest"], Field(description="straight ahead at n_rpm in calm water until steady, or at rest")
    ] = "steady"
    course_deg: Annotated[FiniteFloat, Field(description="deg, heading at t = 0")] = 0.0

    @property
    @abstractmethod
    def length(self) -> float:
        """Length of the log [s]."""

    @property
    def greatest_helm(self) -> float:
        """Greatest angle [deg] that it may order, to either side."""
        return 0.0

    @property
    def greatest_shaft(self) -> float:
        """Greatest shaft speed [rpm] that it may order, ahead or astern."""
        return abs(self.n_rpm)

    def shaft(self, t: Array) -> Array:
        """Ordered shaft speed [rev/s] at times (T,) [s]."""
        return np.full(len(t), self.n_rpm * RPM)

    def helm(self, t: Array) -> Array:
        """Ordered helm angle [rad] at times (T,) [s], > 0 to starboard; amidships by default."""
        return np.zeros(len(t))

    def helmsman(self, controls: Controls) -> Helmsman | None:  # noqa: ARG002
        """Who gives the orders; None where the clock does."""
        return None

    def told(self, controls: Controls, t: Array, speed: float) -> dict[str, Array]:  # noqa: ARG002
        """Commands, or what the helmsman is told, in force from times (T,) on; `speed` [m/s] is that at t = 0."""
        return controls.orders(self.shaft(t), self.helm(t))


class Executed(Manoeuvre):
    """A manoeuvre that goes straight ahead until its first order is executed."""

    execute_at: Annotated[NotNegative, Field(description="s of the log that go by before the first order")] = 0.0


class Timed(Executed):
    """A manoeuvre that ends by the clock."""

    duration: Annotated[Positive, Field(description="s")]

    @property
    def length(self) -> float:
        """Length of the log [s]."""
        return self.duration


class Turning(Timed):
    """Constant commands, each on its own: `orders` by command in SI (`port.alpha`, rad), the others at n_rpm and 0."""

    kind: Literal["turning"] = "turning"
    orders: Annotated[dict[str, FiniteFloat], Field(description="command -> rev/s or rad, as the vessel takes it")]

    @property
    def greatest_helm(self) -> float:
        """Of the orders that are angles [deg]."""
        return max((abs(order) / DEGREE for name, order in self.orders.items() if not _is_shaft(name)), default=0.0)

    @property
    def greatest_shaft(self) -> float:
        """Of n_rpm and the orders that are shaft speeds [rpm]."""
        return max(abs(self.n_rpm), *(abs(order) / RPM for name, order in self.orders.items() if _is_shaft(name)), 0.0)

    def told(self, controls: Controls, t: Array, speed: float) -> dict[str, Array]:
        """Commands from times (T,) on."""
        straight = super().told(controls, t, speed)
        unknown = next((name for name in self.orders if name not in straight), None)
        if unknown is not None:
            raise DocumentError(f"{unknown!r} is no command: {choices(unknown, straight)}", path="manoeuvre.orders")
        return straight | {
            name: np.where(_from(self.execute_at, t), order, straight[name]) for name, order in self.orders.items()
        }


class HelmOver(Timed):
    """A manoeuvre that begins with the helm put over to one side."""

    angle_deg: Annotated[Positive, Field(description="deg of helm")] = 20.0
    side: Annotated[Literal["starboard", "port"], Field(description="to which the ship turns first")] = "starboard"

    @property
    def greatest_helm(self) -> float:
        """Greatest angle [deg]."""
        return self.angle_deg

    @property
    def sense(self) -> float:
        """+1 to starboard, -1 to port."""
        return 1.0 if self.side == "starboard" else -1.0

    def helm(self, t: Array) -> Array:
        """Helm angle [rad] at times (T,) as first executed."""
        return np.where(_from(self.execute_at, t), self.sense * self.angle_deg * DEGREE, 0.0)


class TurningCircle(HelmOver):
    """The helm is put over and held."""

    kind: Literal["turning_circle"] = "turning_circle"
    angle_deg: Annotated[Positive, Field(description="deg of helm")] = 35.0


class PullOut(HelmOver):
    """A turn, then the helm amidships: a stable ship's yaw rate decays to zero."""

    kind: Literal["pull_out"] = "pull_out"
    turn: Annotated[Positive, Field(description="s that the helm is over")]

    def helm(self, t: Array) -> Array:
        """Helm angle [rad] at times (T,)."""
        return np.where(_from(self.execute_at + self.turn, t), 0.0, super().helm(t))


class Zigzag(HelmOver):
    """The helm is reversed each time the heading has changed from the course by the execute heading."""

    kind: Literal["zigzag"] = "zigzag"
    execute_heading_deg: Annotated[Positive, Field(description="deg off the course, to either side")] = 20.0

    def helmsman(self, controls: Controls) -> Helmsman:
        """He sees the heading."""
        return helm.zigzag(controls.commands)

    def told(self, controls: Controls, t: Array, speed: float) -> dict[str, Array]:
        """The helm as first executed, the course and the execute heading."""
        headings = {"course": self.course_deg, "execute_heading": self.sense * self.execute_heading_deg}
        more = {name: np.full(len(t), value * DEGREE) for name, value in headings.items()}
        return super().told(controls, t, speed) | more


class Spiral(Executed):
    """Direct (Dieudonne) spiral: one helm angle after another, each held until the turn is steady."""

    kind: Literal["spiral"] = "spiral"
    angles_deg: Annotated[
        tuple[FiniteFloat, ...], Field(min_length=1, description="deg, > 0 to starboard, in order")
    ] = SPIRAL
    hold: Annotated[Positive, Field(description="s that each is held")]

    @property
    def greatest_helm(self) -> float:
        """Greatest angle [deg]."""
        return max(map(abs, self.angles_deg))

    @property
    def length(self) -> float:
        """Length of the log [s]."""
        return self.execute_at + len(self.angles_deg) * self.hold

    def helm(self, t: Array) -> Array:
        """Helm angle [rad] at times (T,)."""
        return _levels(self.angles_deg, self.hold, self.execute_at, t) * DEGREE


class ReverseSpiral(Executed):
    """Reverse (Bech) spiral: one yaw rate after another, each held by the helm until that is steady."""

    kind: Literal["reverse_spiral"] = "reverse_spiral"
    rates_deg: Annotated[
        tuple[FiniteFloat, ...], Field(min_length=1, description="deg/s, > 0 to starboard, in order")
    ] = RATES
    hold: Annotated[Positive, Field(description="s that each is held")]
    angle_deg: Annotated[Positive, Field(description="deg: greatest helm")] = 35.0

    @property
    def greatest_helm(self) -> float:
        """Greatest angle [deg]."""
        return self.angle_deg

    @property
    def length(self) -> float:
        """Length of the log [s]."""
        return self.execute_at + len(self.rates_deg) * self.hold

    def helmsman(self, controls: Controls) -> Helmsman:
        """He sees the yaw rate."""
        return helm.yaw_rate(controls.commands)

    def told(self, controls: Controls, t: Array, speed: float) -> dict[str, Array]:
        """The greatest helm, the yaw rate, and a PI law that places both poles of r' = b s at omega = 40 / hold."""
        greatest, omega = self.angle_deg * DEGREE, SETTLES / self.hold
        effect = greatest * helm_effect(controls, self.n_rpm * RPM, speed)
        if effect <= 0:
            raise DocumentError(f"at {self.n_rpm:g} rpm the helm does not turn the ship", path="manoeuvre.n_rpm")
        law = {"gain": np.full(len(t), 2 * omega / effect), "reset": np.full(len(t), 2 / omega)}
        rate = _levels(self.rates_deg, self.hold, self.execute_at, t) * DEGREE
        return controls.orders(self.shaft(t), np.full(len(t), greatest)) | {"rate": rate, **law}


class CrashStop(Timed):
    """Full astern, the helm amidships."""

    kind: Literal["crash_stop"] = "crash_stop"
    astern_rpm: Annotated[Positive, Field(description="rpm ordered astern")]

    @property
    def greatest_shaft(self) -> float:
        """Ahead or astern [rpm]."""
        return max(abs(self.n_rpm), self.astern_rpm)

    def shaft(self, t: Array) -> Array:
        """Shaft speed [rev/s] at times (T,)."""
        return np.where(_from(self.execute_at, t), -self.astern_rpm, self.n_rpm) * RPM


class Excitation(Timed):
    """Helm and shaft move about zero and n_rpm by a multisine or by random levels (APRBS), within rate limits."""

    kind: Literal["excitation"] = "excitation"
    signal: Literal["multisine", "aprbs"]
    angle_deg: Annotated[NotNegative, Field(description="deg, greatest helm; 0: not moved")] = 0.0
    amplitude_rpm: Annotated[NotNegative, Field(description="rpm about n_rpm at most; 0: not moved")] = 0.0
    period: Annotated[Positive, Field(description="s, of the multisine")] = 200.0
    harmonics: Annotated[
        tuple[int, int], Field(description="lowest and highest of the multisine; dealt in turn to helm and shaft")
    ] = (1, 20)
    hold: Annotated[tuple[Positive, Positive], Field(description="s, least and most of an APRBS level")] = (5.0, 20.0)
    angle_rate_deg: Annotated[Positive | None, Field(description="deg/s, limit of the ordered helm")] = None
    shaft_rate_rpm: Annotated[Positive | None, Field(description="rpm/s, limit of the ordered shaft")] = None
    seed: Annotated[int, Field(description="of the levels, and of the search for phases")] = 0

    @property
    def greatest_helm(self) -> float:
        """Greatest angle [deg]."""
        return self.angle_deg

    @property
    def greatest_shaft(self) -> float:
        """About n_rpm [rpm]."""
        return abs(self.n_rpm) + self.amplitude_rpm

    def helm(self, t: Array) -> Array:
        """Helm angle [rad] at times (T,)."""
        return self._series(t, 0, self.angle_deg, self.angle_rate_deg) * DEGREE

    def shaft(self, t: Array) -> Array:
        """Shaft speed [rev/s] at times (T,)."""
        return np.asarray((self.n_rpm + self._series(t, 1, self.amplitude_rpm, self.shaft_rate_rpm)) * RPM)

    def _series(self, t: Array, channel: int, amplitude: float, rate: float | None) -> Array:
        """One channel (helm 0, shaft 1) about zero."""
        after = _from(self.execute_at, t)
        series = np.zeros(len(t))
        if amplitude == 0 or not after.any():
            return series
        key = (self.seed, "excitation", channel)
        time = t[after] - self.execute_at
        if self.signal == "aprbs":
            series[after] = aprbs(time, hold=self.hold, levels=(-amplitude, amplitude), key=key)
        else:
            band = range(self.harmonics[0], self.harmonics[1] + 1)
            own = deal(band, 2)[channel] if self.angle_deg and self.amplitude_rpm else band
            series[after] = multisine(time, period=self.period, harmonics=own, amplitude=amplitude, key=key)
        if rate is None or len(t) < 2:
            return series
        return np.asarray(limit_rate(np.concatenate([[0.0], series]), float(t[1] - t[0]), rate)[1:])


class StationKeeping(Manoeuvre):
    """Azimuth units hold a position and a heading from t = 0 on."""

    kind: Literal["station_keeping"] = "station_keeping"
    n_rpm: FiniteFloat = 0.0
    approach: Literal["steady", "rest"] = "rest"
    duration: Annotated[Positive, Field(description="s")]
    north: Annotated[FiniteFloat, Field(description="m, to hold")] = 0.0
    east: Annotated[FiniteFloat, Field(description="m, to hold")] = 0.0
    heading_deg: Annotated[FiniteFloat | None, Field(description="deg, to hold; absent: course_deg")] = None
    natural_period: Annotated[Positive, Field(description="s, of the controlled ship; longer is softer")] = 60.0
    bias_rpm: Annotated[Positive, Field(description="rpm at which the units push against each other")] = 60.0
    most_rpm: Annotated[Positive, Field(description="rpm, limit of a unit")] = 200.0

    @property
    def greatest_helm(self) -> float:
        """Units may push anywhere [deg]."""
        return 180.0

    @property
    def greatest_shaft(self) -> float:
        """Of a unit [rpm]."""
        return max(abs(self.n_rpm), self.most_rpm)

    @property
    def length(self) -> float:
        """Length of the log [s]."""
        return self.duration

    def helmsman(self, controls: Controls) -> Helmsman:
        """He sees position and heading; DocumentError for a vessel without two azimuth units that can hold it."""
        units = thrust_sharing(controls.vessel)
        used = {f"{unit.name}.{signal}" for unit in units for signal in ("n", "alpha")}
        return helm.station_keeping(units, tuple(name for name in controls.commands if name not in used))

    def told(self, controls: Controls, t: Array, speed: float) -> dict[str, Array]:  # noqa: ARG002
        """Where to be, how hard to try."""
        heading = self.course_deg if self.heading_deg is None else self.heading_deg
        told = {"north": self.north, "east": self.east, "heading": heading * DEGREE}
        told |= {"omega": 2 * np.pi / self.natural_period, "n_bias": self.bias_rpm * RPM, "n_max": self.most_rpm * RPM}
        return {name: np.full(len(t), value) for name, value in told.items()}


AnyManoeuvre = Annotated[
    Turning | TurningCircle | PullOut | Zigzag | Spiral | ReverseSpiral | CrashStop | Excitation | StationKeeping,
    Field(discriminator="kind"),
]
"""Any kind, told apart by `kind`: a `[[manoeuvre]]` block."""


def _is_shaft(command: str) -> bool:
    return SIGNALS.commands.get(command.rsplit(".", 1)[-1]) == "rev/s"


def _from(moment: float, t: Array) -> NDArray[np.bool_]:
    """Whether the moment has come, to rounding."""
    return np.asarray(t >= moment - 1e-9 * max(1.0, moment))


def _levels(levels: Sequence[float], hold: float, execute: float, t: Array) -> Array:
    """0 until execute, then each level for `hold` [s], the last to the end."""
    number = np.floor((t - execute) / hold + 1e-9).astype(int)
    return np.where(number < 0, 0.0, np.array(levels, dtype=float)[np.clip(number, 0, len(levels) - 1)])
