"""The table of signals (motion, commands, environment): unit, mirror sign, names in logs, ranges.

To add a signal, write one row in `SIGNALS`, and a term that uses it. All other code reads this table at run time: the
schema of vessels, datasets, the importer and its guesses, checks, truths, corrections, figures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import Literal

from shipid.plugins import Registry, fault_of_kind
from shipid.units import DEGREE, RPM

Role = Literal["motion", "command", "output", "environment", "derived"]
ACTUAL = "actual."
"""Begins the name of a state of an actuator, `actual.port.n`: what the order `port.n` has reached."""


@dataclass(frozen=True)
class Signal:
    """One row of the table.

    role : `motion` of the ship; `command`, named `<component>.<signal>` in data; `output`, what a component shows on
        an instrument, named likewise; `environment`; `derived` from others.
    unit : SI unit, `-` for a pure number.
    word : label in figures.
    shown : unit in tables and figures; None: `unit`.
    factor : SI units in one `shown` unit.
    angle : whether it is an angle, interpolated across its wrap.
    shaft : whether it is a shaft speed.
    turns : sign of the yaw rate by a positive angle aft of the origin; 0: the signal does not steer.
    mirror : sign under port-starboard reflection.
    column : whether a dataset must, may, or cannot have this column. Commands and outputs are always allowed.
    names : regular expression of its names in logs, in lower case and without the unit; empty: not in logs.
    plausible : a magnitude [SI] that no craft reaches; None: not checked.
    read_as_SI : a log column without a unit is read as SI up to this magnitude, in `shown` above it.
    reach : least and greatest value [SI] in the tests of physical laws.
    usual : the same of a command in normal operation: the default range of a simulated truth.
    neutral : default value [SI] of a command.
    component : of a log column that does not name its side.
    """

    role: Role
    unit: str
    word: str
    _: KW_ONLY
    shown: str | None = None
    factor: float = 1.0
    angle: bool = False
    shaft: bool = False
    turns: Literal[-1, 0, 1] = 0
    mirror: Literal[-1, 1] = 1
    column: Literal["required", "optional", "none"] = "none"
    names: str = ""
    plausible: float | None = None
    read_as_SI: float | None = None
    reach: tuple[float, float] = (-1.0, 1.0)
    usual: tuple[float, float] = (0.0, 0.0)
    neutral: float = 0.0
    component: str = "thruster"

    @property
    def read_in(self) -> str:
        """Unit in tables and figures."""
        return self.shown or self.unit


SIGNALS: Registry[Signal] = Registry("shipid.signals", partial(fault_of_kind, Signal))
SIGNALS |= {
    "north": Signal(
        "motion", "m", "north", column="required", names=r"n|north|northing|x0|x|xn|pos_?n|x_?earth|y_north"
    ),
    "east": Signal(
        "motion", "m", "east", mirror=-1, column="required", names=r"e|east|easting|y0|y|ye|pos_?e|y_?earth"
    ),
    "psi": Signal(
        "motion",
        "rad",
        "heading",
        shown="deg",
        factor=DEGREE,
        angle=True,
        mirror=-1,
        column="required",
        names=r"psi|heading|hdg|hdt|head|yaw|true_?heading|gyro",
        reach=(-math.pi, math.pi),
    ),
    "u": Signal(
        "motion",
        "m/s",
        "speed ahead",
        column="required",
        names=r"u|surge|surge_?(speed|vel\w*)|vx|u_?b(ody)?|speed_?long\w*|dx0?",
        plausible=50.0,  # the SES-100B of 1980 made 91.9 kn, 47 m/s
    ),
    "v": Signal(
        "motion",
        "m/s",
        "speed to starboard",
        mirror=-1,
        column="required",
        names=r"v|sway|sway_?(speed|vel\w*)|vy|v_?b(ody)?|speed_?(trans|lat)\w*|dy0?",
        plausible=25.0,  # a drift of 30 deg at 50 m/s
    ),
    "r": Signal(
        "motion",
        "rad/s",
        "yaw rate",
        shown="deg/s",
        factor=DEGREE,
        mirror=-1,
        column="required",
        names=r"r|rot|yaw_?rate|rate_?of_?turn|psi_?dot|dpsi\w*|wz",
        plausible=2 * math.pi,  # a turn a second: small craft on two screws turn at 100 to 200 deg/s
    ),
    "z": Signal("motion", "m", "heave", column="optional"),
    "phi": Signal(
        "motion",
        "rad",
        "roll",
        shown="deg",
        factor=DEGREE,
        angle=True,
        mirror=-1,
        column="optional",
        names=r"phi|roll",
        plausible=math.pi / 2,  # on its beam ends
        read_as_SI=0.8,
    ),
    "theta": Signal(
        "motion",
        "rad",
        "trim",
        shown="deg",
        factor=DEGREE,
        angle=True,
        column="optional",
        names=r"theta|pitch",
        plausible=math.pi / 2,
        read_as_SI=0.8,
    ),
    "w": Signal("motion", "m/s", "speed down", column="optional"),
    "p": Signal(
        "motion",
        "rad/s",
        "roll rate",
        shown="deg/s",
        factor=DEGREE,
        mirror=-1,
        column="optional",
        names=r"p|roll_?rate",
    ),
    "q": Signal(
        "motion", "rad/s", "pitch rate", shown="deg/s", factor=DEGREE, column="optional", names=r"q|pitch_?rate"
    ),
    "V_w": Signal(
        "environment",
        "m/s",
        "wind speed",
        column="optional",
        names=r"v_?w|(true_?)?wind_?(speed)?|tws",
        plausible=113.0,  # the strongest gust on record, Barrow Island 1996 (WMO)
        reach=(0.0, 20.0),
    ),
    "beta_w": Signal(
        "environment",
        "rad",
        "wind direction",
        shown="deg",
        factor=DEGREE,
        angle=True,
        mirror=-1,
        column="optional",
        names=r"beta_?w|(true_?)?wind_?(dir\w*|from|angle)|twd",
        read_as_SI=7.0,
        reach=(-math.pi, math.pi),
    ),
    "V_c": Signal("environment", "m/s", "current speed", reach=(0.0, 2.0)),
    "beta_c": Signal(
        "environment",
        "rad",
        "current direction",
        shown="deg",
        factor=DEGREE,
        angle=True,
        mirror=-1,
        reach=(-math.pi, math.pi),
    ),
    "u_rw": Signal("derived", "m/s", "speed ahead through the wind"),
    "v_rw": Signal("derived", "m/s", "speed to starboard through the wind", mirror=-1),
    "x": Signal("derived", "m", "way ahead"),
    "y": Signal("derived", "m", "way to starboard", mirror=-1),
    "n": Signal(
        "command",
        "rev/s",
        "shaft",
        shown="rpm",
        factor=RPM,
        shaft=True,
        names=r"n_?(port|stbd|starboard|stern|bow)?|rpm\w*|rev\w*|rps\w*|shaft\w*|\w+_(rpm|shaft|rev)|n_p|n_s",
        plausible=100.0,  # 6000 rpm: an outboard, or the electric screw of a small craft
        read_as_SI=25.0,
        reach=(-3.5, 3.5),
        usual=(50 * RPM, 200 * RPM),
        component="propeller",
    ),
    "force": Signal("command", "N", "thrust order", reach=(-300.0, 300.0), usual=(0.0, 100.0)),
    "alpha": Signal(
        "command",
        "rad",
        "azimuth",
        shown="deg",
        factor=DEGREE,
        angle=True,
        turns=-1,
        mirror=-1,
        names=r"alpha\w*|azi\w*|\w+_(azi\w*|alpha)",
        plausible=12.6,
        read_as_SI=1.6,
        reach=(-math.pi, math.pi),
        usual=(-50 * DEGREE, 50 * DEGREE),
    ),
    "delta": Signal(
        "command",
        "rad",
        "rudder",
        shown="deg",
        factor=DEGREE,
        angle=True,
        turns=1,
        mirror=-1,
        names=r"delta\w*|rud\w*|\w+_(rud\w*|delta)",
        plausible=1.6,
        read_as_SI=1.6,
        reach=(-0.7, 0.7),
        usual=(-35 * DEGREE, 35 * DEGREE),
        component="rudder",
    ),
    "pitch": Signal(  # ratio P/D at 0.7 of the radius
        "command",
        "-",
        "pitch ratio P/D",
        names=r"cpp(?!\w*(rpm|rps|shaft|speed|rev|thrust|torque|power|load|oil|hyd|pump|temp|press))\w*"
        r"|pitch_?(ratio|p_?d)\w*|prop(eller)?_?pitch\w*|(port|starboard|stbd)_pitch|pitch_(port|starboard|stbd)|p_?/?_?d",
        plausible=2.0,
        reach=(-1.4, 1.4),
        usual=(0.4, 1.0),
        neutral=0.8,
        component="propeller",
    ),
    "thrust": Signal(  # in the shaft: before the thrust deduction
        "output",
        "N",
        "thrust",
        names=r"thrust\w*|t_?prop\w*|(port|starboard|stbd)_thrust|f_?thrust",
        component="propeller",
    ),
    "torque": Signal(
        "output",
        "N m",
        "torque",
        names=r"torque\w*|q|q_?(prop|p|shaft)\w*|(port|starboard|stbd)_torque",
        component="propeller",
    ),
    "normal_force": Signal(
        "output",
        "N",
        "normal force",
        mirror=-1,
        names=r"(rudder_)?normal_?force\w*|f_?n|rudder_force",
        component="rudder",
    ),
    "side_force": Signal(  # > 0 to starboard
        "output",
        "N",
        "side force",
        mirror=-1,
        names=r"((bow|stern)_?)?(tunnel|thruster|tunnel_?thruster)_?(side_?)?force|(bow|stern)_?(side_?)?force",
        component="bow",
    ),
}
"""Name -> row. Columns of datasets and messages list signals in the order of this table."""
_UNKNOWN = Signal("derived", "-", "")


def signal_of(name: str) -> str:
    """Name of the signal of a command, `port.n` -> `n`; of anything else, the name itself."""
    return name.rpartition(".")[2]


def signal_row(name: str) -> Signal | None:
    """Row of a command (`port.n`) or of another signal (`u`); None for an unknown name."""
    return SIGNALS.get(signal_of(name))


def _row_or_unknown(name: str) -> Signal:
    """Row of a command or another signal; one without any property for an unknown name."""
    return signal_row(name) or _UNKNOWN


def rows_of_role(role: Role) -> dict[str, Signal]:
    """Rows of one role, in the order of the table."""
    return {name: row for name, row in SIGNALS.items() if row.role == role}


def measurable_signals(names: Iterable[str]) -> list[str]:
    """Signals of the environment among some names that a dataset may hold: wind, but no current."""
    rows = ((name, SIGNALS.get(name)) for name in names)
    return [name for name, row in rows if row is not None and row.role == "environment" and row.column != "none"]


def direct_inputs(names: Iterable[str]) -> list[str]:
    """Those of them that are an input of a method as they are: no direction, and not the wind, which is relative."""
    return [name for name in measurable_signals(names) if not SIGNALS[name].angle and name != "V_w"]


def is_command(name: str) -> bool:
    """Whether a name is that of a command, `<component>.<signal>`."""
    return _is_of_component(name, "command")


def is_output(name: str) -> bool:
    """Whether a name is that of a measured output of a component, such as `propeller.thrust`."""
    return _is_of_component(name, "output")


def _is_of_component(name: str, role: Role) -> bool:
    component, dot, signal = name.partition(".")
    row = SIGNALS.get(signal)
    is_name = component.replace("-", "_").isidentifier() and component.isascii()
    return bool(dot) and row is not None and row.role == role and is_name


def is_shaft(command: str) -> bool:
    """Whether a command is a shaft speed, such as `port.n`."""
    return _row_or_unknown(command).shaft


def drive_scale(command: str) -> float:
    """What 1 rev/s of the ship's drives is in the unit of this one: 1 of a shaft speed, 60 N of a force, else 0.

    So `n_rpm` of a manoeuvre is in newtons where forces drive the ship.
    """
    row = _row_or_unknown(command)
    return row.factor / RPM if row.role == "command" and row.unit in ("rev/s", "N") else 0.0


def is_steering(command: str) -> bool:
    """Whether a command is an angle that turns the ship, such as `port.alpha` or `rudder.delta`."""
    return _row_or_unknown(command).turns != 0


def is_all_round(command: str) -> bool:
    """Whether a command is an angle of a unit that may turn all round, such as `port.alpha`; a rudder does not."""
    row = _row_or_unknown(command)
    return row.angle and row.reach[1] - row.reach[0] >= 2 * math.pi


def is_wrapped_angle(name: str) -> bool:
    """Whether a column is an angle of the ship or the weather, unwrapped before it is interpolated."""
    return name in SIGNALS and SIGNALS[name].angle


def is_thrust_order(name: str) -> bool:
    """Whether the last part of a name is a command that does not steer: a shaft speed, a force or a pitch."""
    return _row_or_unknown(name).role == "command" and _row_or_unknown(name).turns == 0


def neutral_value(command: str) -> float:
    """Default value [SI] of a command: helm amidships, shaft stopped, service pitch."""
    return _row_or_unknown(command).neutral


def mirror_sign(name: str) -> float:
    """Factor of a signal in the port-starboard mirror, 1 or -1."""
    return float(_row_or_unknown(name).mirror)


def read_unit(name: str) -> tuple[str, float]:
    """Unit of a signal in tables and figures, and the factor from SI to it."""
    row = SIGNALS[signal_of(name)]
    return row.read_in, 1.0 / row.factor


def signal_units(names: Iterable[str]) -> dict[str, str]:
    """Name -> SI unit of the given commands or signals."""
    return {name: SIGNALS[signal_of(name)].unit for name in names}
