"""First estimate of a vessel from its main particulars, by regression formulae; each value names its formula.

The result is a normal vessel document. Replace its values when better ones are known.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shipid.document import bundled, get, read
from shipid.errors import ShipidError, choices
from shipid.physics.signals import is_shaft, neutral
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel, check_vessel

RHO, RHO_AIR, NU, G = 1025.0, 1.225, 1.19e-6, 9.81  # sea water at 15 deg C, air; SI
LEAST_YAW = 0.005  # of Clarke's N_rdot: a tenth of what ships have
PROPULSORS = ("propeller-rudder", "azimuth")

# Blendermann (1994), J. Wind Eng. Ind. Aerodyn. 51, 339-351: C_Dt, C_Dl of bow and stern, delta, kappa
WIND = {
    "cargo": (0.85, 0.65, 0.55, 0.40, 1.7),
    "container": (0.90, 0.55, 0.55, 0.40, 1.4),
    "ferry": (0.90, 0.45, 0.50, 0.80, 1.1),
    "fishing": (0.95, 0.70, 0.70, 0.40, 1.1),
    "offshore": (0.90, 0.55, 0.80, 0.55, 1.2),
    "passenger": (0.90, 0.40, 0.40, 0.80, 1.2),
    "research": (0.85, 0.55, 0.65, 0.60, 1.4),
    "tanker": (0.70, 0.90, 0.55, 0.40, 3.1),
}


@dataclass(frozen=True)
class Particulars:
    """What is known of a vessel: lengths [m], block coefficient [-], service speed [m/s], wind areas [m^2].

    length is that between perpendiculars; speed, areas : None takes a guess.
    """

    length: float
    beam: float
    draught: float
    block: float
    speed: float | None = None
    propulsor: str = "propeller-rudder"
    ship_type: str = "cargo"
    frontal_area: float | None = None
    lateral_area: float | None = None

    @property
    def service(self) -> float:
        """Service speed [m/s]: as given, else that of a Froude number of 0.2."""
        return 0.2 * math.sqrt(G * self.length) if self.speed is None else self.speed

    @property
    def volume(self) -> float:
        """Displaced volume [m^3]."""
        return self.block * self.length * self.beam * self.draught


@dataclass(frozen=True)
class Value:
    """A number of the document with its unit and where it comes from."""

    number: float
    unit: str
    note: str


Values = dict[str, Value]


@dataclass(frozen=True)
class FirstGuess:
    """A template filled in.

    text : TOML.  vessel : the same, checked.  n : shaft speed [rev/s] that holds the service speed.
    growth : the largest growth rate [1/s] of a small yaw at that speed, helm amidships; negative: course-stable.
    """

    text: str
    vessel: Vessel
    n: float
    growth: float


def first_guess(given: Particulars, name: str, file: str) -> FirstGuess:
    """Fill a vessel document from main particulars; ShipidError for a ship that the formulae do not know."""
    _check(given)
    body = "\n".join(_blocks(given, name))
    vessel = check_vessel(tomllib.loads(body), file)
    n = _shaft(vessel, given.service)
    growth = _growth(vessel, given.service, n)
    verdict = (
        f"course-{'stable' if growth < 0 else 'UNSTABLE'} by these formulae (a small yaw goes as exp({growth:+.4f} t))"
    )
    head = [
        "# A FIRST GUESS from main particulars by regression formulae: nothing is measured. Replace what you know.",
        f"# At {given.service:.3g} m/s the ship needs {60 * n:.4g} rpm and is {verdict}.",
        "# SI units; x forward, y starboard, z down, from amidships, where the centre of gravity is assumed to be.",
    ]
    return FirstGuess("\n".join([*head, body]), vessel, n, growth)


def _check(given: Particulars) -> None:
    """ShipidError for particulars outside the range of the formulae."""
    if given.propulsor not in PROPULSORS:
        raise ShipidError(f"propulsor {given.propulsor!r}: {choices(given.propulsor, PROPULSORS)}")
    if given.ship_type not in WIND:
        raise ShipidError(f"ship type {given.ship_type!r}: {choices(given.ship_type, WIND)}")
    for what, value, low, high in _ranges(given):
        if not low <= value <= high:
            raise ShipidError(f"{what} = {value:.3g}: the formulae hold for {low:g} to {high:.3g}")
    if _yaw_inertia(given) < LEAST_YAW:
        raise ShipidError("so short and deep a hull has no added yaw inertia by Clarke's formula")


def _ranges(given: Particulars) -> Iterator[tuple[str, float, float, float]]:
    """Name, value, lower and upper limit of each quantity; sizes before the ratios derived from them."""
    yield "length [m]", given.length, 1.0, 450.0
    yield "beam [m]", given.beam, 0.1, 80.0
    yield "draught [m]", given.draught, 0.02, 30.0
    yield "block", given.block, 0.4, 0.9
    yield "length / beam", given.length / given.beam, 3.0, 9.0
    yield "beam / draught", given.beam / given.draught, 1.8, 6.0
    yield "speed [m/s]", given.service, 0.1, 0.4 * math.sqrt(G * given.length)
    for what, area in (("frontal", given.frontal_area), ("lateral", given.lateral_area)):
        if area is not None:
            yield f"{what} area [m^2]", area, 1e-3, 4e4


def inertia(given: Particulars) -> Values:
    """Mass and yaw inertia."""
    m = RHO * given.volume
    return {
        "m": Value(m, "kg", "rho C_b L B T"),
        "I_z": Value(m * (0.25 * given.length) ** 2, "kg m^2", "m (0.25 L)^2, a usual radius of gyration"),
        "x_G": Value(0.0, "m", "assumed amidships"),
    }


def added_mass(given: Particulars) -> Values:
    """Clarke et al. (1983); surge by Soeding, in Brix (1993)."""
    L, B, T, C_b = given.length, given.beam, given.draught, given.block
    prime = -math.pi * (T / L) ** 2 * RHO / 2 * L**3
    clarke = "Clarke et al. (1983)"
    return {
        "X_udot": Value(-_surge_mass(given), "kg", "-m / (pi sqrt(L^3 / volume) - 14), Soeding in Brix (1993)"),
        "Y_vdot": Value(prime * (1 + 0.16 * C_b * B / T - 5.1 * (B / L) ** 2), "kg", clarke),
        "Y_rdot": Value(prime * L * (0.67 * B / L - 0.0033 * (B / T) ** 2), "kg m", clarke),
        "N_vdot": Value(prime * L * (1.1 * B / L - 0.041 * B / T), "kg m", clarke),
        "N_rdot": Value(prime * L**2 * _yaw_inertia(given), "kg m^2", clarke),
    }


def _yaw_inertia(given: Particulars) -> float:
    B = given.beam
    return 1 / 12 + 0.017 * given.block * B / given.draught - 0.33 * B / given.length


def _surge_mass(given: Particulars) -> float:
    return RHO * given.volume / (math.pi * math.sqrt(given.length**3 / given.volume) - 14)


def hull(given: Particulars) -> Values:
    """Derivatives in the primes of [hull.mmg]: linear by Clarke et al. (1983), the others by Kijima et al. (1990)."""
    L, B, T, C_b = given.length, given.beam, given.draught, given.block
    s, full, slender = -math.pi * T / L, C_b * B / L, (1 - C_b) * T / B
    m_x, m_y = (-added_mass(given)[name].number / (RHO / 2 * L**2 * T) for name in ("X_udot", "Y_vdot"))
    clarke, kijima = "Clarke et al. (1983), x L / T", "Kijima et al. (1990)"
    masumoto = "Yoshimura and Masumoto (2012)"
    return {
        "R_0": _resistance(given),
        "X_vv": Value(min(1.15 * full - 0.18, 0.0), "prime", f"1.15 C_b B / L - 0.18, at most 0, {masumoto}"),
        "X_vr": Value(m_y - 1.91 * full + 0.08, "prime", f"m_y' - 1.91 C_b B / L + 0.08, {masumoto}"),
        "X_rr": Value(-0.085 * full + 0.008, "prime", f"-0.085 C_b B / L + 0.008, {masumoto}"),
        "X_vvvv": Value(max(-6.68 * full + 1.1, 0.0), "prime", f"-6.68 C_b B / L + 1.1, at least 0, {masumoto}"),
        "Y_v": Value(s * (1 + 0.4 * C_b * B / T), "prime", clarke),
        "Y_r": Value(s * (-0.5 + 2.2 * B / L - 0.08 * B / T) + m_x, "prime", f"{clarke}, + m_x', which turns apart"),
        "Y_|v|v": Value(-2.5 * slender - 0.5, "prime", f"-2.5 (1 - C_b) T / B - 0.5, {kijima}"),
        "Y_|r|r": Value(0.343 * C_b * T / B - 0.07, "prime", f"0.343 C_b T / B - 0.07, {kijima}"),
        "Y_vrr": Value(-5.95 * slender, "prime", f"-5.95 (1 - C_b) T / B, {kijima}"),
        "Y_vvr": Value(1.5 * C_b * T / B - 0.65, "prime", f"1.5 C_b T / B - 0.65, {kijima}"),
        "N_v": Value(s * (0.5 + 2.4 * T / L), "prime", clarke),
        "N_r": Value(s * (0.25 + 0.039 * B / T - 0.56 * B / L), "prime", clarke),
        "N_|v|v": Value(0.96 * slender - 0.066, "prime", f"0.96 (1 - C_b) T / B - 0.066, {kijima}"),
        "N_|r|r": Value(0.5 * full - 0.09, "prime", f"0.5 C_b B / L - 0.09, {kijima}"),
        "N_vrr": Value(0.5 * C_b * T / B - 0.05, "prime", f"0.5 C_b T / B - 0.05, {kijima}"),
        "N_vvr": Value(
            -(57.5 * full**2 - 18.4 * full + 1.6), "prime", f"-(57.5 (C_b B / L)^2 - 18.4 C_b B / L + 1.6), {kijima}"
        ),
    }


def _resistance(given: Particulars) -> Value:
    """(1 + k) C_F S / (L T): ITTC-57, form factor of Watanabe, wetted surface of Mumford; no waves."""
    L, B, T, C_b = given.length, given.beam, given.draught, given.block
    C_F = 0.075 / (math.log10(given.service * L / NU) - 2) ** 2
    k = max(-0.095 + 25.6 * C_b / ((L / B) ** 2 * math.sqrt(B / T)), 0.0)
    S = 1.025 * L * (C_b * B + 1.7 * T)
    note = f"(1 + k) C_F S / (L T): ITTC-57, k = {k:.2f} (Watanabe), S = {S:.4g} m^2 (Mumford); without waves"
    return Value((1 + k) * C_F * S / (L * T), "-", note)


def wind(given: Particulars) -> Values:
    """Blendermann's coefficients of the type of ship; areas guessed where not given."""
    B, L_oa = given.beam, 1.05 * given.length
    names = ("C_Dt", "C_Dl_bow", "C_Dl_stern", "delta", "kappa")
    coefficients = {
        name: Value(number, "-", f"Blendermann (1994), {given.ship_type}")
        for name, number in zip(names, WIND[given.ship_type], strict=True)
    }
    frontal, lateral = given.frontal_area, given.lateral_area
    A_F = Value(0.8 * B**2, "m^2", "0.8 B^2: a guess") if frontal is None else Value(frontal, "m^2", "given")
    A_L = Value(0.5 * L_oa * B, "m^2", "0.5 L_oa B: a guess") if lateral is None else Value(lateral, "m^2", "given")
    return coefficients | {
        "A_FW": A_F,
        "A_LW": A_L,
        "L_oa": Value(L_oa, "m", "1.05 L: a guess"),
        "s_L": Value(0.0, "m", "centroid of the lateral area amidships: a guess"),
        "s_H": Value(0.5 * A_L.number / L_oa, "m", "half its mean height: a guess"),
    }


def waves() -> Values:
    """Wave resistance: 0 by default; to be identified from trials at speed."""
    note = "wave resistance grows with about the sixth power of speed: 0 until it is measured or identified"
    return {"R_4": Value(0.0, "kg m^-5 s^4", note)}


def _wake(given: Particulars) -> float:
    return 0.5 * given.block - 0.05


def propeller(given: Particulars) -> Values:
    """One screw behind the hull."""
    L, T = given.length, given.draught
    w_P0 = _wake(given)
    opens = read(bundled("models")["kvlcc2-l7"])["thruster"]["propeller"]["K_T"]
    note = "open water of KVLCC2's screw, P / D = 0.72: a guess"
    return {
        "x": Value(-0.48 * L, "m", "-0.48 L"),
        "z": Value(0.65 * T, "m", "0.65 T below the waterline: a guess"),
        "D_p": Value(min(0.7 * T, 10.0), "m", "0.7 T, at most 10 m: a guess"),
        "t_P": Value(0.6 * w_P0, "-", "0.6 w_P0: a rule of thumb"),
        "w_P0": Value(w_P0, "-", "0.5 C_b - 0.05, Taylor"),
        "C_1": Value(2.0, "-", "KVLCC2, Yasukawa and Yoshimura (2015)"),
        "C_2_plus": Value(1.35, "-", "KVLCC2, mean of both sides"),
        "C_2_minus": Value(1.35, "-", "KVLCC2, mean of both sides"),
        **{f'K_T."{name}"': Value(number, "-", note) for name, number in opens.items()},
    }


def rudder(given: Particulars) -> Values:
    """One rudder behind that screw."""
    L, B, T, C_b = given.length, given.beam, given.draught, given.block
    A_R = L * T / 100 * (1 + 25 * (B / L) ** 2)
    H_R = min(math.sqrt(1.6 * A_R), 0.9 * T)
    aspect = H_R**2 / A_R
    epsilon = 2.26 - 1.82 * (1 - _wake(given))
    masumoto = "Yoshimura and Masumoto (2012)"
    gamma_R = Value(2.06 * C_b * B / L + 0.14, "-", f"2.06 C_b B / L + 0.14, {masumoto}")
    return {
        "x": Value(-0.5 * L, "m", "aft perpendicular"),
        "z": Value(T - 0.55 * H_R, "m", "middle of its height: a guess"),
        "A_R": Value(A_R, "m^2", "L T / 100 (1 + 25 (B / L)^2), Det Norske Veritas' least"),
        "H_R": Value(H_R, "m", "aspect ratio 1.6, at most 0.9 T: a guess"),
        "f_alpha": Value(6.13 * aspect / (aspect + 2.25), "-", "6.13 a / (a + 2.25), a = H_R^2 / A_R, Fujii"),
        "epsilon": Value(epsilon, "-", f"2.26 - 1.82 (1 - w_P0), {masumoto}"),
        "kappa": Value(0.55 / epsilon, "-", f"0.55 / epsilon, {masumoto}"),
        "gamma_R_plus": gamma_R,
        "gamma_R_minus": gamma_R,
        "ell_R": Value(-0.9 * L, "m", f"-0.9 L, {masumoto}"),
        "t_R": Value(0.39, "-", masumoto),
        "a_H": Value(0.627 * C_b - 0.153, "-", "0.627 C_b - 0.153, Quadvlieg (2013)"),
        "x_H": Value(-0.45 * L, "m", "-0.45 L, Aoki et al. (2006)"),
        "actuator.delta.T": Value(1.0, "s", "a guess"),
        "actuator.delta.rate": Value(math.radians(65 / 28), "rad/s", "35 to -30 deg in 28 s, SOLAS II-1/29"),
    }


def azimuth(given: Particulars, side: int) -> Values:
    """One of two azimuth units at the stern; side -1 is port."""
    unit = get(read(bundled("models")["gunnerus-28.9"]), "thruster.port")
    placed = {
        "x": Value(-0.46 * given.length, "m", "-0.46 L: a guess"),
        "y": Value(side * 0.28 * given.beam, "m", "0.28 B off the middle: a guess"),
        "z": Value(0.75 * given.draught, "m", "0.75 T: a guess"),
        "D_p": Value(0.7 * given.draught, "m", "0.7 T: a guess"),
    }
    copied: Values = {}
    for name, number in unit.items():
        if isinstance(number, float) and name not in placed:
            copied[name] = Value(number, "-", "unit of R/V Gunnerus")
        elif isinstance(number, Mapping):
            copied |= {f'{name}."{key}"': Value(v, "-", "unit of R/V Gunnerus") for key, v in number.items()}
    return (
        placed
        | copied
        | {
            "actuator.alpha.T": Value(0.5, "s", "a guess"),
            "actuator.alpha.rate": Value(0.2, "rad/s", "two turns a minute: a guess"),
        }
    )


def _blocks(given: Particulars, name: str) -> Iterator[str]:
    """The document, line by line."""
    known = "given" if given.speed is not None else "a Froude number of 0.2: a guess"
    main: Values = {
        "L_pp": Value(given.length, "m", "given"),
        "B": Value(given.beam, "m", "given"),
        "T": Value(given.draught, "m", "given"),
        "C_b": Value(given.block, "-", "given"),
        "U_0": Value(given.service, "m s^-1", known),
    }
    yield f"name = {_quoted(name)}"
    yield 'description = "A first guess from main particulars by regression formulae: no number of it is measured"'
    yield 'source = "shipid vessel new: the formula of each number is beside it"\ndof = 3\n'
    yield from _block("particulars", main)
    yield from _block("constants", {"rho": Value(RHO, "kg m^-3", "sea"), "rho_a": Value(RHO_AIR, "kg m^-3", "air")})
    yield from _block("inertia", inertia(given))
    yield from _block("added_mass", added_mass(given), coriolis="mmg")
    yield from _block("hull.mmg", hull(given))
    yield from _block("hull.resistance", waves())
    yield from _block("wind", wind(given), kind="blendermann")
    if given.propulsor == "azimuth":
        for side, unit in ((-1, "port"), (1, "starboard")):
            words = {"kind": "azimuth", "actuator.alpha.kind": "first_order"}
            yield from _block(f"thruster.{unit}", azimuth(given, side), **words)
    else:
        yield from _block("thruster.propeller", propeller(given), kind="propeller")
        words = {"kind": "rudder", "behind": "propeller", "actuator.delta.kind": "first_order"}
        yield from _block("thruster.rudder", rudder(given), **words)


def _block(path: str, values: Values, **words: str) -> Iterator[str]:
    yield f"[{path}]"
    yield 'source = "the formula or guess beside each number"'
    yield from (f"{key} = {_quoted(word)}" for key, word in words.items())
    for key, value in values.items():
        shown = _quoted(key) if "|" in key and '"' not in key else key
        yield f"{shown} = {float(f'{value.number:.6g}')!r}  # {value.unit}; {value.note}"
    yield ""


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _accelerations(vessel: Vessel) -> Callable[[tuple[float, float, float], float], np.ndarray]:
    """(u, v, r), shaft speed -> accelerations (3,) in calm water, helm amidships."""
    model = dynamics(vessel)
    calm, values = np.zeros(len(model.environment)), np.array(list(vessel.parameters.values()))

    def accelerations(nu: tuple[float, float, float], n: float) -> np.ndarray:
        commands = [n if is_shaft(name) else neutral(name) for name in model.commands]
        memory = [n if is_shaft(name) else neutral(name) for name in model.memory]
        rates: Any = model.rates([0.0, 0.0, 0.0, *nu], memory, commands, calm, values, np.zeros(3))
        return np.array(rates).ravel()[3:]

    return accelerations


def _shaft(vessel: Vessel, speed: float) -> float:
    """Shaft speed [rev/s] at which thrust equals resistance, by bisection."""
    acceleration = _accelerations(vessel)
    low, high = 0.0, 1.0
    while acceleration((speed, 0.0, 0.0), high)[0] < 0 and high < 1e3:
        low, high = high, 2 * high
    if high >= 1e3:
        raise ShipidError(f"no shaft speed drives this ship at {speed:.3g} m/s: ask for less")
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if acceleration((speed, 0.0, 0.0), middle)[0] < 0 else (low, middle)
    return high


def _growth(vessel: Vessel, speed: float, n: float) -> float:
    """Largest real part [1/s] of the eigenvalues of sway and yaw about straight running."""
    acceleration = _accelerations(vessel)
    h = 1e-4 * speed
    steps = ((h, 0.0), (0.0, h / vessel.document["particulars"]["L_pp"]))
    columns = [
        (acceleration((speed, v, r), n) - acceleration((speed, -v, -r), n))[1:] / (2 * (v + r)) for v, r in steps
    ]
    return float(np.linalg.eigvals(np.column_stack(columns)).real.max())
