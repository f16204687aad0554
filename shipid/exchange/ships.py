"""Ships drawn by seed, for the study over ships: particulars of a type, and a truth that `vessel new` would not write.

Linear derivatives by regressions that the template does not use, cross-flow drag in place of its polynomial, bilinear
thrust, rudders with a slipstream by momentum theory; every number scattered. A ship that does not hold a turn is drawn
again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shipid.document import bundled_documents, read_document, value_at_path
from shipid.errors import ShipidError
from shipid.simulation.approach import Controls
from shipid.simulation.manoeuvre import ConstantOrders
from shipid.simulation.perform import perform_manoeuvres
from shipid.units import DEGREE, GRAVITY
from shipid.vessel.load import Vessel, check_document
from shipid.vessel.perturb import uniform_draw
from shipid.vessel.regressions import ittc_friction
from shipid.vessel.similar import TAYLOR
from shipid.vessel.stability import service_shaft, yaw_growth
from shipid.vessel.template import NU, RHO_AIR, RHO_SEA, Particulars

Ends = tuple[float, float]
MOST_DRAWS = 200  # of a ship until one holds its turns
TURN_HELM, TURN_LENGTHS, TURN_STEPS = (
    20.0,
    12.0,
    60,
)  # deg of helm of the turn that a ship must hold; L / U; steps in one of them
MOST_GROWTH = 0.3  # of a small yaw, in U / L: tankers reach 0.1 to 0.2
TURN_RATES = (0.08, 1.8)  # r L / U of the steady turn
LEAST_SPEED = 0.15  # of the service speed, in the turn
HOERNER_RATIO = (0.011, 0.35, 0.45, 0.49, 0.56, 0.65, 0.83, 0.99, 1.31, 1.64, 1.86, 2.31, 2.6, 3.0, 3.45, 4.0)
HOERNER_DRAG = (1.97, 1.90, 1.79, 1.28, 1.08, 1.0, 0.88, 0.83, 0.76, 0.69, 0.66, 0.63, 0.60, 0.59, 0.59, 0.56)
"""Cross-flow drag of a section over B / 2T by Hoerner's curve (Fossen 2021, fig. 6.8)."""


@dataclass(frozen=True)
class ShipType:
    """Ranges of a type of ship: length [m] (by its logarithm), Froude number, L / B, B / T, C_b; drives; wind areas.

    like : type of the template whose wind coefficients it takes.
    """

    length: Ends
    froude: Ends
    slender: Ends
    beamy: Ends
    block: Ends
    drives: tuple[str, ...]
    like: str


SHIP_TYPES = {
    "tanker": ShipType((130, 320), (0.12, 0.17), (5.2, 6.6), (2.3, 3.0), (0.77, 0.84), ("rudder",), "tanker"),
    "usv": ShipType((2, 6), (0.20, 0.40), (2.6, 4.5), (2.6, 4.5), (0.45, 0.6), ("differential",), "research"),
    "cargo": ShipType((60, 200), (0.15, 0.24), (5.5, 7.2), (2.2, 3.2), (0.58, 0.76), ("rudder",), "cargo"),
    "offshore": ShipType((45, 95), (0.16, 0.28), (3.8, 5.0), (2.8, 3.8), (0.6, 0.72), ("azimuth",), "offshore"),
    "model": ShipType((2, 7), (0.14, 0.26), (5.0, 7.2), (2.2, 3.4), (0.55, 0.8), ("rudder", "rudders"), "cargo"),
    "ferry": ShipType((40, 190), (0.2, 0.32), (4.6, 7.0), (3.0, 4.5), (0.5, 0.62), ("rudders", "azimuth"), "ferry"),
    "fishing": ShipType((12, 60), (0.22, 0.33), (3.2, 4.6), (2.2, 3.0), (0.5, 0.64), ("rudder",), "fishing"),
    "container": ShipType((140, 320), (0.19, 0.26), (6.0, 7.6), (2.4, 3.4), (0.56, 0.68), ("rudder",), "container"),
    "research": ShipType(
        (20, 100), (0.18, 0.28), (3.6, 5.4), (2.4, 3.6), (0.5, 0.64), ("azimuth", "rudders", "rudder"), "research"
    ),
    "passenger": ShipType((90, 300), (0.17, 0.25), (6.0, 7.6), (3.4, 4.6), (0.58, 0.68), ("rudders",), "passenger"),
}


@dataclass(frozen=True)
class Dice:
    """Draws by name, so that a further one changes no other: `dice("k_0", 0.3, 0.4)`."""

    key: tuple[Any, ...]

    def __call__(self, name: str, low: float, high: float) -> float:
        """A number between two ends."""
        return low + (high - low) * uniform_draw(*self.key, name)

    def choose(self, name: str, values: tuple[Any, ...]) -> Any:
        """One of some values."""
        return values[int(uniform_draw(*self.key, name) * len(values))]

    def scatter(self, name: str, spread: float = 0.25) -> float:
        """A factor about 1, as far below as above: from 1 / (1 + spread) to 1 + spread."""
        most = math.log1p(spread)
        return math.exp(self(name, -most, most))


@dataclass(frozen=True)
class DrawnShip:
    """A ship of the study: its type, particulars, and the dice of its truth.

    dice : by which the numbers of its truth are drawn, whatever its length.
    """

    name: str
    type: str
    particulars: Particulars
    dice: Dice

    def vessel(self) -> Vessel:
        """The truth."""
        return check_document(_document(self.particulars, self.dice), f"{self.name}.toml")


def draw_ship(seed: int, number: int) -> DrawnShip:
    """The ship of a number; ShipidError where no draw holds a turn. The types take turns."""
    kind = list(SHIP_TYPES)[number % len(SHIP_TYPES)]
    for counter in range(MOST_DRAWS):
        dice = Dice((seed, "ship", number, counter))
        ship = DrawnShip(f"drawn-{number:02d}", kind, _draw_particulars(SHIP_TYPES[kind], dice), dice)
        if holds_turn(vessel := ship.vessel(), ship.particulars):
            n = service_shaft(vessel, ship.particulars.service) or 0.0
            return replace(ship, particulars=replace(ship.particulars, rpm=60 * n))
    raise ShipidError(f"no ship of {MOST_DRAWS} draws of type {kind} holds a turn: take another seed")


def _draw_particulars(kind: ShipType, dice: Dice) -> Particulars:
    """Main particulars within the ranges of a type."""
    length = math.exp(dice("length", *map(math.log, kind.length)))
    beam = length / dice("slender", *kind.slender)
    drive = dice.choose("drive", kind.drives)
    return Particulars(
        length=length,
        beam=beam,
        draught=beam / dice("beamy", *kind.beamy),
        block=dice("block", *kind.block),
        speed=dice("froude", *kind.froude) * math.sqrt(GRAVITY * length),
        propulsor="propeller-rudder" if drive.startswith("rudder") else drive,
        ship_type=kind.like,
        shafts=1 if drive == "rudder" else 2,
    )


def holds_turn(vessel: Vessel, given: Particulars) -> bool:
    """Whether the ship reaches its speed, is not too unstable, and turns steadily to the side of its helm."""
    controls, service = Controls(vessel), given.service
    try:
        n = service_shaft(vessel, service)
        if n is None:
            return False
        unit = given.length / service
        if yaw_growth(vessel, service, controls.ahead(n)) * unit > MOST_GROWTH:
            return False
        turns = [
            ConstantOrders(orders=_turn_orders(controls, n, side), duration=TURN_LENGTHS * unit, start_speed=service)
            for side in (1.0, -1.0)
        ]
        log = perform_manoeuvres(vessel, turns, step=unit / TURN_STEPS)
    except ShipidError:
        return False
    late = log[log["t"] > 0.75 * TURN_LENGTHS * unit].groupby("run", sort=False)[["u", "r"]].agg(["min", "max"])
    rates, speed = late["r"].to_numpy() * unit * np.array([[1.0], [-1.0]]), late["u"]["min"].min()
    return bool(
        (np.sort(rates) > TURN_RATES[0]).all() and rates.max() < TURN_RATES[1] and speed > LEAST_SPEED * service
    )


def _turn_orders(controls: Controls, n: float, side: float) -> dict[str, float]:
    """Orders of a turn to a side: the helm, or of two screws the inner one at half speed."""
    if controls.differential:
        return {"port.n_rpm": 60 * n * min(1 + side / 2, 1.0), "starboard.n_rpm": 60 * n * min(1 - side / 2, 1.0)}
    angle = "alpha_deg" if any(name.endswith("alpha") for name in controls.helm) else "delta_deg"
    return {"n_rpm": 60 * n, angle: side * next(iter(controls.helm.values())) * TURN_HELM}


def _linear_derivatives(given: Particulars, dice: Dice) -> dict[str, float]:
    """Y_v, Y_r, N_v, N_r in primes of 1/2 rho L^2 (L^3, L^4) by Wagner Smitt (1970), Norrbin (1971) or Inoue (1978).

    As Clarke et al. (1983) list them in units of q = pi (T / L)^2.
    """
    L, B, T, C_b = given.length, given.beam, given.draught, given.block
    q, full = math.pi * (T / L) ** 2, C_b * B / (math.pi * T)
    rows = {
        "smitt": (-5.0 / math.pi, 1.02 / math.pi, -1.94 / math.pi, -0.65 / math.pi),
        "norrbin": (-1.69 - 0.08 * full, 0.645 - 0.38 * full, -0.64 + 0.04 * full, -0.47 + 0.18 * full),
        "inoue": (-1.0 - 1.4 * full, 0.5, -2 / math.pi, -1.04 / math.pi + 4 * T / (math.pi * L)),
    }
    chosen = dice.choose("regression", tuple(rows.values()))
    return {
        name: q * value * dice.scatter(name) for name, value in zip(("Y_v", "Y_r", "N_v", "N_r"), chosen, strict=True)
    }


def _document(given: Particulars, dice: Dice) -> dict[str, Any]:
    """The document of a truth."""
    L, B, T, U = given.length, given.beam, given.draught, given.service
    m = RHO_SEA * given.volume
    prime = RHO_SEA / 2 * L**3
    sway = math.pi / 2 * RHO_SEA * T**2 * L * dice("Y_vdot", 0.8, 1.2)  # strips of a flat plate: Newman (1977)
    centre = dice("Y_rdot", -0.03, 0.01) * L
    drag = float(np.interp(B / (2 * T), HOERNER_RATIO, HOERNER_DRAG)) * dice("C_d", 0.5, 1.1)
    hull = {
        **_linear_derivatives(given, dice),
        "X_vr": dice("X_vr", 0.3, 0.7) * sway / prime,
        "X_vv": -dice("X_vv", 0.0, 0.05) * T / L,
        "X_rr": -dice("X_rr", 0.0, 0.01) * T / L,
    }
    wetted = TAYLOR * math.sqrt(given.volume * L)
    friction = ittc_friction(U, L, NU) + dice("C_A", 0.0, 5e-4) * (L > 10)
    residuary = dice("C_R", 0.5, 1.8) * 1e-3  # Guldhammer and Harvald (1974): of ordinary forms at a service speed
    return {
        "name": "drawn", "dof": 3,
        "particulars": {"L_pp": L, "B": B, "T": T, "C_b": given.block, "U_0": U},
        "constants": {"rho": RHO_SEA, "rho_a": RHO_AIR},
        "inertia": {"m": m, "I_z": m * (dice("I_z", 0.22, 0.27) * L) ** 2, "x_G": dice("x_G", -0.03, 0.02) * L},
        "added_mass": {
            "coriolis": "none", "X_udot": -m * dice("X_udot", 0.02, 0.08), "Y_vdot": -sway, "Y_rdot": -sway * centre,
            "N_vdot": -sway * centre, "N_rdot": -sway * L**2 * dice("N_rdot", 0.05, 0.08),
        },
        "hull": {
            "prime_derivatives": hull,
            "crossflow": {
                "strips": 12, "C_d": drag, "x_aft": -L / 2, "x_fwd": L / 2, "T": T, "k_fwd": dice("k_fwd", -0.3, 0.5),
            },
            "resistance": {
                "R_0": RHO_SEA / 2 * wetted * (friction + residuary / 2),
                "R_2": RHO_SEA / 4 * wetted * residuary / U**2,
            },
        },
        "wind": _wind(given, dice),
        "thruster": dict(_thrusters(given, dice)),
    }  # fmt: skip


def _wind(given: Particulars, dice: Dice) -> dict[str, Any]:
    """Wind forces from the simplest curves over the angle that tests show, areas of the beam and length."""
    angle = np.linspace(0.0, math.pi, 13)
    curves = {
        "C_X": -dice("C_X", 0.5, 0.9) * np.cos(angle),
        "C_Y": dice("C_Y", 0.7, 1.0) * np.sin(angle),
        "C_N": dice("C_N", 0.03, 0.12) * np.sin(2 * angle) + dice("C_N_0", -0.05, 0.05) * np.sin(angle),
    }
    return {
        "kind": "table",
        "gamma_deg": np.degrees(angle).tolist(),
        **{name: curve.tolist() for name, curve in curves.items()},
        "A_FW": dice("A_FW", 0.5, 1.0) * given.beam**2,
        "A_LW": dice("A_LW", 0.3, 0.7) * given.length * given.beam,
        "L_oa": 1.05 * given.length,
    }


def _thrusters(given: Particulars, dice: Dice) -> Iterator[tuple[str, dict[str, Any]]]:
    """Screws, rudders or azimuth units by the names that `vessel new` gives them."""
    y = dice("y", 0.17, 0.27) * given.beam
    sides = (("port", -y), ("starboard", y)) if given.units == 2 else (("", 0.0),)
    for side, place in sides:
        if given.propulsor == "azimuth":
            yield side, _azimuth(given, dice, place)
            continue
        screw = side or "propeller"
        yield screw, _screw(given, dice, place)
        if given.propulsor == "propeller-rudder":
            yield (f"{side}_rudder" if side else "rudder"), {"behind": screw, **_rudder(given, dice, place)}


def _screw(given: Particulars, dice: Dice, y: float) -> dict[str, Any]:
    """A screw with the bilinear thrust of Blanke (1981): K_T = k_0 - k_1 J."""
    D = dice("D_p", 0.5, 0.72 if given.units == 1 else 0.6) * given.draught
    wake = dice("w_P0", 0.4, 0.6) * given.block * (1.0 if given.units == 1 else 0.4)
    return {
        "kind": "quadratic", "x": -0.48 * given.length, "y": y, "z": 0.6 * given.draught, "D_p": D,
        "T_nn": RHO_SEA * D**4 * dice("k_0", 0.32, 0.46),
        "T_nu": RHO_SEA * D**3 * dice("k_1", 0.32, 0.46),
        "k_astern": dice("k_astern", 0.6, 0.9), "w_P0": wake, "t_P": dice("t_P", 0.5, 0.8) * wake,
    }  # fmt: skip


def _azimuth(given: Particulars, dice: Dice, y: float) -> dict[str, Any]:
    """An azimuth unit: bilinear along, linear across; beyond the range of its polynomials as that of R/V Gunnerus."""
    unit = value_at_path(read_document(bundled_documents("models")["gunnerus-28.9"]), "thruster.port")
    D = dice("D_p", 0.5, 0.7) * given.draught
    k_0, k_1 = dice("k_0", 0.45, 0.8), dice("k_1", 0.45, 0.7)
    return {
        **{name: one for name, one in unit.items() if name not in ("source", "actuator")},
        "x": -dice("x", 0.42, 0.48) * given.length, "y": y, "z": 0.7 * given.draught, "D_p": D,
        "k_T": 1.0,
        "K_x": {"1": k_0, "J": -k_1, "yy": dice("K_yy", 0.0, 0.3)},
        "K_y": {"y": -dice("K_y", 0.5, 1.1), "Jy": -dice("K_Jy", 0.2, 0.6)},
        "actuator": {"alpha": _gear(given, dice, (9.0, 15.0))},
    }  # fmt: skip


def _rudder(given: Particulars, dice: Dice, y: float) -> dict[str, Any]:
    """A rudder; lift slope by Whicker and Fehlner (1958)."""
    L, T = given.length, given.draught
    area = dice("A_R", 0.017, 0.03) * L * T * (1.0 if given.units == 1 else 0.6)
    height = min(math.sqrt(dice("aspect", 1.3, 2.0) * area), 0.9 * T)
    aspect = height**2 / area
    inflow = dice("gamma_R", 0.35, 0.65)
    return {
        "kind": "rudder", "x": -0.5 * L, "y": y, "z": 0.5 * T, "A_R": area, "H_R": height,
        "f_alpha": 1.8 * math.pi * aspect / (1.8 + math.sqrt(aspect**2 + 4)) * dice.scatter("f_alpha", 0.15),
        "epsilon": dice("epsilon", 0.9, 1.2), "kappa": dice("kappa", 0.4, 0.65),
        "gamma_R_plus": inflow * dice.scatter("gamma_R_plus", 0.1), "gamma_R_minus": inflow,
        "ell_R": -dice("ell_R", 0.7, 1.0) * L, "t_R": dice("t_R", 0.2, 0.4), "a_H": dice("a_H", 0.1, 0.4),
        "x_H": -dice("x_H", 0.38, 0.47) * L,
        "actuator": {"delta": _gear(given, dice, (2.4, 4.5))},
    }  # fmt: skip


def _gear(given: Particulars, dice: Dice, rates: Ends) -> dict[str, Any]:
    """Lag and rate [deg/s] of steering gear; on a ship below 60 m as much faster as sqrt(L) is less."""
    faster = math.sqrt(max(60.0 / given.length, 1.0))
    return {"kind": "first_order", "T": dice("gear", 0.5, 1.5) / faster, "rate": dice("rate", *rates) * faster * DEGREE}
