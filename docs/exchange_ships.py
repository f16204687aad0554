"""Ships whose cells teach the law of exchange: bundled and drawn ones, each with its own study.

`python docs/exchange_ships.py FOLDER --seed 0` studies nine bundled ships and 30 drawn by the seed, of 1.25 to 320 m,
with the same families, amounts of data and horizons, and writes `cells.csv`: a row per ship, foundation, N_D and
horizon. A ship that is finished is not studied again; `--ships otter drawn-03` studies these only, so that machines may
share the folder.

The truth of a drawn ship is none that `vessel new` would write: linear derivatives by regressions that the template
does not use, cross-flow drag in place of its polynomial, bilinear thrust, rudders with a slipstream by momentum theory;
every number scattered. A ship that does not hold a turn is drawn again.
"""

from __future__ import annotations

import argparse
import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.capacity import usable_cores
from shipid.document import bundled_documents, read_document, value_at_path
from shipid.errors import DivergenceError, ShipidError
from shipid.files import write_table
from shipid.metrics import position_error
from shipid.simulation.approach import Controls, vessel_service_speed
from shipid.simulation.manoeuvre import ConstantOrders
from shipid.simulation.perform import perform_manoeuvres
from shipid.study.declared import NO_MODEL
from shipid.study.new import draft_simulated
from shipid.study.plan import Plan, build_plan
from shipid.study.prepare import PreparedStudy, obtain_runs, prepare
from shipid.study.run import run_unit
from shipid.study.workers import on_workers
from shipid.units import DEGREE, GRAVITY
from shipid.vessel.load import Vessel, check_document, load_vessel
from shipid.vessel.perturb import derivative_order, uniform_draw
from shipid.vessel.regressions import ittc_friction
from shipid.vessel.similar import TAYLOR, similar_vessels, vessel_particulars
from shipid.vessel.stability import service_shaft, yaw_growth
from shipid.vessel.template import NU, RHO_AIR, RHO_SEA, Particulars, first_guess

BUNDLED = {
    "mariner": "cargo",
    "otter": "usv",
    "gunnerus-28.9": "research",
    "esso-190k": "tanker",
    "kvlcc2-l7": "model",
    "container-175": "container",
    "naval-51": "naval",
    "cybership2": "model",
    "supply-vessel": "offshore",
}
"""Ships that shipid ships, one file of each, and their types."""
IN_WAVES = {"gunnerus-28.9": ("gunnerus-28.9-6dof", {"H_s": 1.0, "T_p": 5.0})}  # truth of it, and the sea of `quick`
DRAWN = 30
AMOUNTS, TESTS = (1, 2, 4, 8, 16, 32, 64), 12  # runs for training and for the test
HORIZONS = (1.0, 2.0, 4.0)  # ship lengths at 0.75 of the service speed
ZIGZAG = "zigzag"
ROUGHNESS = {"weather": (0.03, 1.0), "noise": (0.03, 2.0)}
"""Of what `study new` drafts, from next to nothing: a towing tank on a good day, and the open sea."""
STEPS = 32  # of the horizon
SAMPLES = 12  # instants of a run
PARTED = 2.1  # windows between the first and the last instant of a run: a single one can be parted to validate
COUPLING = ("X_vr", "Y_r", "Y_ur", "N_v", "N_uv")
DRIVING, STEERING = ("T_nn", "T_nu", "k_T", "X_u", "X_uu", "X_uuu", "F_2"), ("f_alpha",)
CROSS_FLOW = "C_d"

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


@dataclass(frozen=True)
class StudiedShip:
    """A ship of the study: its truth, its physics in 3 degrees of freedom, particulars where they are known, a sea."""

    name: str
    type: str
    truth: Vessel
    physics: Vessel
    particulars: Particulars | None
    sea: Mapping[str, float] | None = None


def ship_names(drawn: int = DRAWN) -> list[str]:
    """Names of all ships; bundled and drawn ones alternate, so that a part of them is already mixed."""
    every = max(drawn // len(BUNDLED), 1)
    groups = [[f"drawn-{number:02d}" for number in range(k, drawn, every)] for k in range(every)]
    return [name for row in zip_longest(BUNDLED, *groups) for name in row if name is not None]


@cache
def drawn_ships(seed: int, drawn: int) -> tuple[DrawnShip, ...]:
    """The drawn ships of a study."""
    return tuple(draw_ship(seed, number) for number in range(drawn))


def studied_ship(name: str, seed: int, drawn: int) -> StudiedShip:
    """A ship of the study by its name."""
    if name not in BUNDLED:
        ship = drawn_ships(seed, drawn)[int(name.rpartition("-")[2])]
        vessel = ship.vessel()
        return StudiedShip(name, ship.type, vessel, vessel, ship.particulars)
    truth, sea = IN_WAVES.get(name, (name, None))
    vessel = load_vessel(name)
    return StudiedShip(name, BUNDLED[name], load_vessel(truth), vessel, _known_particulars(vessel), sea=sea)


def _known_particulars(vessel: Vessel) -> Particulars | None:
    """Particulars of a bundled vessel; None where beam or draught are missing."""
    known, controls, U = vessel_particulars(vessel), Controls(vessel), vessel_service_speed(vessel)
    if not {"L_pp", "B", "T", "C_b"} <= known.keys():
        return None
    signals = {name.rpartition(".")[2] for name in controls.commands}
    propulsor = "azimuth" if "alpha" in signals else "propeller-rudder" if "delta" in signals else "differential"
    n = service_shaft(vessel, U)
    L, B, T, block = (known[name] for name in ("L_pp", "B", "T", "C_b"))
    return Particulars(L, B, T, block, U, propulsor, rpm=None if n is None else 60 * n, shafts=len(controls.drives))


def _sister_of(ship: StudiedShip, seed: int, drawn: int) -> Vessel | None:
    """The nearest drawn ship with the same drive, as `vessel similar` scales it; None where there is none."""
    mine = ship.particulars
    if mine is None:
        return None
    near = [
        one.vessel()
        for one in drawn_ships(seed, drawn)
        if one.name != ship.name and (one.particulars.propulsor, one.particulars.units) == (mine.propulsor, mine.units)
    ]
    return next((vessel for _, vessel in similar_vessels(_known_numbers(mine), near, ship.physics)), None)


def _known_numbers(given: Particulars) -> dict[str, float]:
    """Particulars by their keys in a document of a vessel."""
    return {"L_pp": given.length, "B": given.beam, "T": given.draught, "C_b": given.block, "U_0": given.service}


def _template_of(ship: StudiedShip) -> Vessel | None:
    """What `vessel new` gives from the particulars; None where its formulae do not hold."""
    if ship.particulars is None:
        return None
    for given in (ship.particulars, replace(ship.particulars, rpm=None)):
        with suppress(ShipidError):
            return first_guess(given, "template", "template.toml").vessel
    return None


def _families(
    ship: StudiedShip, drafted: list[dict[str, Any]], others: Iterable[str], seed: int
) -> list[dict[str, Any]]:
    """Families of a ship: those of `study new`, one kind of number wrong, a part missing, and vessels of others."""
    paths = list(ship.physics.parameters)
    hull = [path for path in paths if path.startswith("hull.")]
    nominal, moderate, high = drafted
    last = {path: path.rpartition(".")[2] for path in paths}
    drives = [path for path in paths if path.startswith("thruster.") and (last[path] in DRIVING or ".K_T." in path)]
    steers = [
        path
        for path in paths
        if (last[path] in STEERING or (path.startswith("thruster.") and "delta" in last[path]))
        and ".actuator." not in path
    ]
    thrust = [
        {"parameters": group, "factor": ends, "together": True}
        for group, ends in ((drives, [0.4, 1.6]), (steers, [0.6, 1.4]))
        if group
    ]
    curved = [path for path in hull if (derivative_order(path) or 0) >= 3 or last[path] == CROSS_FLOW]
    curved = curved or [path for path in hull if (derivative_order(path) or 0) == 2 and path.split(".")[-1][0] in "YN"]
    coupled = [path for path in hull if last[path] in COUPLING]
    base = {"base": "physics"}
    families = [
        nominal,
        moderate | {"members": 2},
        high,
        base | {"name": "damping", "members": 2, "perturb": moderate["perturb"]},
        base | {"name": "mass", "members": 2, "perturb": high["perturb"]},
        base | {"name": "thrust", "members": 2, "perturb": thrust},
        *(
            base | {"name": f"missing-{words}", "perturb": [{"remove": gone}]}
            for words, gone in (("curved", curved), ("coupling", coupled))
            if gone
        ),
        *({"name": name, "base": name} for name in others),
    ]
    return [one | {"seed": seed + place} for place, one in enumerate(families) if one.get("perturb") != []]


def plan_ship(ship: StudiedShip, seed: int, drawn: int, amounts: Iterable[int] = AMOUNTS) -> Plan:
    """The study of a ship: that of `study new`, with other families, manoeuvres, weather and sensors."""
    out, dice = Path(f"{ship.name}-study.toml"), Dice((seed, "study", ship.name))
    draft = draft_simulated({"physics": ship.physics}, out, max(HORIZONS), STEPS)
    document: dict[str, Any] = tomllib.loads(draft.text)
    found = {"truth": ship.truth, "physics": ship.physics, "template": _template_of(ship)}
    vessels = {
        name: one for name, one in (found | {"sister": _sister_of(ship, seed, drawn)}).items() if one is not None
    }
    amounts = sorted(amounts)
    truth, prediction = document["truth"], document["prediction"]
    turning = truth["manoeuvre"][0]
    passing = ship.physics.length / vessel_service_speed(ship.physics)  # type: ignore[operator]
    shafts = next(values for key, values in turning.items() if "n_rpm" in key and isinstance(values, list))
    kinds = [
        turning | {"share": dice("turning", 0.3, 1.0)},
        turning | {"kind": "steps", "hold": [passing, 5 * passing], "share": dice("steps", 0.5, 1.5)},
    ]
    if not Controls(ship.truth).differential:
        sides, angles = ["starboard", "port"], [10.0, 25.0]
        zigzag = {"kind": ZIGZAG, "n_rpm": shafts, "angle_deg": angles, "side": sides}
        kinds.append(zigzag | {"share": dice("zigzag", 0.2, 0.8)})
    truth |= {
        "vessel": "truth",
        "manoeuvres": amounts[-1] + TESTS,
        "seed": int(dice("seed", 0, 1e6)),
        "manoeuvre": kinds,
    }
    if ship.sea:
        truth["waves"] = dict(ship.sea)
    weather, noise = (math.exp(dice(name, *map(math.log, ends))) for name, ends in ROUGHNESS.items())
    for name, most in (("current_speed", 1.0), ("wind_speed", 1.6)):
        if name in truth:
            truth[name] = [0.0, truth[name][1] * weather * dice(name, 0.5, most)]
    truth["sensors"] = {name: {"noise": noise * one["noise"]} for name, one in truth["sensors"].items()}
    step = prediction["step"]
    steps = round(prediction["ahead"] / step)
    interval = step * math.ceil(PARTED * (steps + truth.get("run_up", 0.0) / step) / (SAMPLES - 1))
    prediction |= {"commands": "known", "interval": interval, "samples": SAMPLES}
    truth["duration"] = prediction["ahead"] + SAMPLES * interval
    document |= {"split": {"test": TESTS, "folds": 1}, "grid": {"N_D": list(amounts), "seeds": [0]}}
    others = [name for name in vessels if name not in ("truth", "physics")]
    document["family"] = _families(ship, document["family"], others, truth["seed"])
    del document["claims"]
    return build_plan(document, out, vessels)


def prepare_ship(plan: Plan) -> tuple[Plan, PreparedStudy]:
    """Runs and physics of a ship, without the families of fixed numbers that diverge; DivergenceError for its own.

    There are zigzags where the ship reaches a straight course, by itself or with a helmsman.
    """
    for approach in ("steady", "helmsman", None):
        kinds = [
            one | {"approach": approach} if one["kind"] == ZIGZAG else one
            for one in plan.document["truth"]["manoeuvre"]
            if one["kind"] != ZIGZAG or approach
        ]
        document = {**plan.document, "truth": {**plan.document["truth"], "manoeuvre": kinds}}
        plan = build_plan(document, Path(plan.file), plan.vessels)
        try:
            data = obtain_runs(plan)
            break
        except ShipidError:
            if approach is None:
                raise
    while True:
        try:
            return plan, prepare(plan, data)
        except DivergenceError as error:
            lost = (error.path or "").removeprefix("family.")
            families = [one for one in plan.document["family"] if one["name"] != lost]
            if lost in ("", "nominal") or len(families) == len(plan.document["family"]):
                raise
            plan = build_plan({**plan.document, "family": families}, Path(plan.file), plan.vessels)


def study_ship(name: str, seed: int, drawn: int, amounts: Iterable[int] = AMOUNTS) -> pd.DataFrame:
    """Cells of a ship, see `CELL_COLUMNS` of the law; ShipidError where it cannot be studied."""
    ship = studied_ship(name, seed, drawn)
    plan, prepared = prepare_ship(plan_ship(ship, seed, drawn, amounts))
    test, speed, length = prepared.test, vessel_service_speed(ship.physics), float(ship.physics.length or 0)
    ends = [round(test.horizon * ahead / max(HORIZONS)) for ahead in HORIZONS]
    paths = [(one, 0, known.test_paths) for one, known in prepared.known.items() if one != NO_MODEL]
    paths += [
        (cell.row["foundation"], unit.batch.N_D, cell.paths)
        for unit in plan.units
        for cell in run_unit(plan, prepared, unit, "cpu")
        if cell.paths is not None
    ]
    errors = [(foundation, N_D, position_error(path, test.future)) for foundation, N_D, path in paths]
    alone = {foundation: error for foundation, N_D, error in errors if N_D == 0}
    kinds = {one.name: one.family.partition("-")[0] for one in prepared.foundations}
    rows = [
        {
            "ship": name, "type": ship.type, "bundled": name in BUNDLED, "length": length, "speed": speed,
            "froude": speed / math.sqrt(GRAVITY * length), "foundation": foundation, "kind": kinds[foundation],
            "A": float(alone[foundation][:end].mean()) if foundation in alone else math.nan, "N_D": N_D,
            "ahead": ahead, "H": float(error[:end].mean()), "baseline": float(prepared.naive[:end].mean()),
            "floor": float(alone["nominal"][:end].mean()),
        }
        for foundation, N_D, error in errors
        for ahead, end in zip(HORIZONS, ends, strict=True)
    ]  # fmt: skip
    return pd.DataFrame(rows)


def _try_ship(seed: int, drawn: int, name: str) -> pd.DataFrame | str:
    """Cells of a ship, or why it has none."""
    try:
        return study_ship(name, seed, drawn)
    except ShipidError as error:
        return str(error)


def main() -> None:
    """Study the ships whose tables are not in the folder yet, and join all that are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of one seed: a file per ship, and cells.csv")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--drawn", type=int, default=DRAWN, help="number of drawn ships")
    parser.add_argument("--ships", nargs="*", help="names; default: all")
    parser.add_argument("--workers", type=int, default=usable_cores())
    given = parser.parse_args()
    names, tables = ship_names(given.drawn), given.folder / f"seed-{given.seed}-of-{given.drawn}"
    left = [name for name in given.ships or names if not (tables / f"{name}.parquet").is_file()]
    for name, cells in on_workers(partial(_try_ship, given.seed, given.drawn), left, given.workers):
        print(f"{name}: {f'left out, {cells}' if isinstance(cells, str) else f'{len(cells)} cells'}", flush=True)
        if not isinstance(cells, str):
            write_table(tables / f"{name}.parquet", cells)
    found = [file for name in names if (file := tables / f"{name}.parquet").is_file()]
    write_table(given.folder / "cells.csv", pd.concat(map(pd.read_parquet, found), ignore_index=True))
    print(f"{len(found)} of {len(names)} ships -> {given.folder / 'cells.csv'}")


if __name__ == "__main__":
    main()
