"""First estimate of a vessel from its main particulars, by regression formulae; each value names its formula.

What is known is taken as it is; the rest is guessed for the size, so that thrust equals resistance at the service
speed. Times of a model are those of the ship over the square root of the scale (Froude).
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from shipid.arguments import check_choice
from shipid.document import bundled_documents, read_document, value_at_path
from shipid.errors import ShipidError
from shipid.units import GRAVITY
from shipid.vessel.load import Vessel, check_document
from shipid.vessel.regressions import (
    PITCHES,
    correlation_allowance,
    form_factor,
    ittc_friction,
    motora_added_mass,
    mumford_surface,
    thrust_polynomial,
    wave_resistance,
)
from shipid.vessel.stability import bisect_root, service_shaft, straight_orders, yaw_growth

RHO_SEA, RHO_FRESH, RHO_AIR = 1025.0, 1000.0, 1.225  # sea and fresh water at 15 deg C, air; SI
NU = 1.19e-6  # m^2/s, sea water at 15 deg C
BEAMY = 0.5  # of the charts' yaw inertia: where Clarke's formula, which falls with the beam, gives less, charts do,
NARROW = 4.0  # but not from this length / beam on, which Clarke's ships had
MOST_N_RR = -0.003  # of full and beamy ships, to which the formula gives 0 and more: yaw is damped, and can be fitted
ROUNDING = 1e-9  # of the quotient of two numbers as people write them, such as 5.4 / 3
SHORTEST = 3.0  # length / beam of the ships behind most formulae
PROPULSORS = ("propeller-rudder", "azimuth", "differential")
MODEL, TYPICAL = 10.0, 160.0  # m: a shorter ship is taken for a model of one as long as the second number
STEERING = 65 / 28  # deg/s: 35 deg on one side to 30 on the other in 28 s, SOLAS II-1/29
AZIMUTHING = 12.0  # deg/s: two turns a minute
PITCH = 0.8  # P / D of a screw of which neither diameter nor shaft speed is known
DIAMETERS = (0.35, 1.0)  # of the draught
AZIMUTH_DIAMETER, SCALES = 0.6, (0.1, 5.0)  # of the draught; of k_T: the speed of an engine gives a hundredth
FULL = 0.75  # block coefficient of bulk carriers and tankers, whose screws are small for the draught
J_MOST, FASTEST = 1.5, 1e3  # largest J of a propeller's polynomial, as in the document; rev/s
SIMILAR = dict.fromkeys(
    ("block", "length / beam", "beam / draught", "block x beam / length"),
    ": for another ship, take a similar vessel and change it (`shipid vessel list`)",
) | {"speed [m/s]": ": is it in m/s? For a faster craft, take a similar vessel and change it (`shipid vessel list`)"}
"""What is outside the formulae -> remedy."""
LARGEST_SCREW, STRONG_PITCH = 10.5, 1.2  # m; P / D from which a larger screw is the likelier guess

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
    """What is known of a vessel; None takes a guess, for all but the four main particulars.

    length, beam, draught : [m], length between perpendiculars. block : block coefficient [-].
    speed : service speed [m/s]. rpm : shaft speed of the screw at that speed [rpm].
    propulsor : `propeller-rudder`, `azimuth` or `differential`, two screws without a rudder.
    shafts : 1 or 2 of them; default 1 with a rudder, else 2.
    propeller_diameter : [m]. rudder_area : of each rudder [m^2].
    tunnel_thruster : whether a tunnel thruster is at the bow.
    scale : length of the ship over that of this model, 1 for the ship. Default: 1 from 10 m on, else 160 m / length.
    """

    length: float
    beam: float
    draught: float
    block: float
    speed: float | None = None
    propulsor: str = "propeller-rudder"
    ship_type: str = "cargo"
    rpm: float | None = None
    shafts: int | None = None
    propeller_diameter: float | None = None
    rudder_area: float | None = None
    tunnel_thruster: bool = False
    scale: float | None = None

    @property
    def service(self) -> float:
        """Service speed [m/s]: as given, else that of a Froude number of 0.2."""
        return 0.2 * math.sqrt(GRAVITY * self.length) if self.speed is None else self.speed

    @property
    def volume(self) -> float:
        """Displaced volume [m^3]."""
        return self.block * self.length * self.beam * self.draught

    @property
    def units(self) -> int:
        """Number of screws."""
        return (1 if self.propulsor == "propeller-rudder" else 2) if self.shafts is None else self.shafts

    @property
    def reduction(self) -> float:
        """Length of the ship over that of this model; 1 for a ship."""
        if self.scale is not None:
            return self.scale
        return 1.0 if self.length >= MODEL else TYPICAL / self.length

    @property
    def rho(self) -> float:
        """Density of the water [kg/m^3]: sea water, and fresh water for a model."""
        return RHO_SEA if self.reduction == 1.0 else RHO_FRESH

    @property
    def faster(self) -> tuple[float, str]:
        """How much faster than on the ship everything on the model is, and in words: sqrt(scale), Froude."""
        if self.reduction == 1.0:
            return 1.0, ""
        why = "given" if self.scale is not None else f"taken for a model of a ship of {TYPICAL:g} m"
        return math.sqrt(self.reduction), f" times sqrt(scale), scale {self.reduction:.3g} {why}"


@dataclass(frozen=True)
class TemplateValue:
    """A number of the document with its unit and where it comes from."""

    number: float
    unit: str
    note: str


Values = dict[str, TemplateValue]


@dataclass(frozen=True)
class FirstGuess:
    """A template filled in.

    text : TOML.  vessel : the same, checked.  n : shaft speed [rev/s] that holds the service speed [m/s].
    unit : of 60 n, rpm, or N of each thruster.
    remarks : what the numbers given imply and a reader should know, one sentence each.
    growth : the largest growth rate [1/s] of a small yaw at that speed, helm amidships; negative: course-stable.
    """

    text: str
    vessel: Vessel
    n: float
    speed: float
    growth: float
    remarks: tuple[str, ...] = ()
    unit: str = "rpm"


def first_guess(given: Particulars, name: str, file: str) -> FirstGuess:
    """Fill a vessel document from main particulars; ShipidError for a ship that the formulae do not know."""
    _check_particulars(given)
    return finish_guess(_document_lines(given, name), file, given.service, tuple(_guess_remarks(given)))


def finish_guess(
    lines: Iterable[str],
    file: str,
    speed: float,
    remarks: tuple[str, ...],
    unit: str = "rpm",
) -> FirstGuess:
    """Check a document, line by line, and put above it what it needs for a speed [m/s] and whether it is stable."""
    body = "\n".join(lines)
    vessel = check_document(tomllib.loads(body), file)
    n = service_shaft(vessel, speed)
    if n is None:
        raise ShipidError(f"no shaft speed or force drives this ship at {speed:.3g} m/s: give a lower speed")
    rate = yaw_growth(vessel, speed, straight_orders(vessel, n))
    verdict = (
        f"course-{'stable' if rate < 0 else 'UNSTABLE'} by these formulae (a small yaw goes as exp({rate:+.4f} t))"
    )
    head = [
        "# A FIRST GUESS from main particulars by regression formulae: nothing is measured. Replace what you know.",
        f"# At {speed:.3g} m/s the ship needs {60 * n:.4g} {unit} and is {verdict}.",
        "# SI units; x forward, y starboard, z down, from amidships, where the centre of gravity is assumed to be.",
    ]
    return FirstGuess("\n".join([*head, body]), vessel, n, speed, rate, remarks, unit)


def _guess_remarks(given: Particulars) -> Iterator[str]:
    """The most important assumptions of the guess, one sentence each."""
    if given.scale is None and given.reduction != 1.0:
        steered = "how fast rudder or azimuth turns"
        sets = "fresh water and a smooth hull" if given.propulsor == "differential" else steered
        yield (
            f"{given.length:g} m counts as a model at a scale of {given.reduction:.3g}: give the scale by --scale; "
            f"it sets {sets}"
        )
    if given.length / given.beam < SHORTEST:
        yield (
            f"length / beam = {given.length / given.beam:.3g}: most formulae are of ships from {SHORTEST:g} on, and "
            "are rougher here"
        )
    if given.rpm is None:
        unknown = "The shaft speed is a guess" if given.propeller_diameter else "Diameter and shaft speed are guesses"
        yield f"{unknown}: give the shaft speed at {given.service:.3g} m/s by --rpm"


def _check_particulars(given: Particulars) -> None:
    """ShipidError for particulars outside the range of the formulae."""
    check_choice("propulsor", given.propulsor, PROPULSORS)
    check_choice("ship type", given.ship_type, WIND)
    if given.propulsor == "differential" and given.units != 2:
        raise ShipidError(
            "two screws steer by their difference: leave it out, or take another propulsor", path="--shafts"
        )
    if given.rudder_area is not None and given.propulsor != "propeller-rudder":
        raise ShipidError(f"there is none with {given.propulsor}: leave it out", path="--rudder-area")
    for what, value, low, high in _formula_ranges(given):
        if value is not None and not low * (1 - ROUNDING) <= value <= high * (1 + ROUNDING):
            raise ShipidError(
                f"{what} = {value:.3g}: the formulae hold for {low:g} to {high:.3g}{SIMILAR.get(what, '')}"
            )


def _formula_ranges(given: Particulars) -> Iterator[tuple[str, float | None, float, float]]:
    """Name, value, lower and upper limit of each quantity; sizes before the ratios derived from them."""
    L, B, T, C_b = given.length, given.beam, given.draught, given.block
    yield from (
        ("length [m]", L, 1.0, 450.0),
        ("beam [m]", B, 0.1, 80.0),
        ("draught [m]", T, 0.02, 30.0),
        ("block", C_b, 0.4, 0.9),
    )
    yield from (
        ("length / beam", L / B, 2.0, 9.0),
        ("beam / draught", B / T, 1.8, 6.0),
        ("block x beam / length", C_b * B / L, 0.04, 0.3),
        ("speed [m/s]", given.service, 0.1, 0.4 * math.sqrt(GRAVITY * L)),
        ("shafts", given.units, 1, 2),
        ("scale", given.scale, 1.0, 400.0),
        ("rpm", given.rpm, 1.0, 20000.0),
        ("propeller diameter [m]", given.propeller_diameter, 0.1 * T, 1.2 * T),
        ("rudder area [m^2]", given.rudder_area, 2e-3 * L * T, 0.1 * L * T),
    )


def inertia_values(given: Particulars) -> Values:
    """Mass and yaw inertia."""
    m = given.rho * given.volume
    return {
        "m": TemplateValue(m, "kg", "rho C_b L B T"),
        "I_z": TemplateValue(m * (0.25 * given.length) ** 2, "kg m^2", "m (0.25 L)^2, a usual radius of gyration"),
        "x_G": TemplateValue(0.0, "m", "assumed amidships"),
    }


def added_mass_values(given: Particulars) -> Values:
    """Clarke et al. (1983), surge by Soeding, in Brix (1993); of a beamy ship Motora's charts.

    Clarke's regressions are of ships from L / B = 4 on: of a beamier one the water would move with an energy below 0.
    """
    L, B, T, C_b = given.length, given.beam, given.draught, given.block
    prime = -math.pi * (T / L) ** 2 * given.rho / 2 * L**3
    yaw = prime * L**2 * (1 / 12 + 0.017 * C_b * B / T - 0.33 * B / L)
    sway = prime * (1 + 0.16 * C_b * B / T - 5.1 * (B / L) ** 2)
    by_yaw, by_sway = prime * L * (0.67 * B / L - 0.0033 * (B / T) ** 2), prime * L * (1.1 * B / L - 0.041 * B / T)
    m = given.rho * given.volume
    m_x, m_y, k_zz = motora_added_mass(L, B, T, C_b)
    if (L / B < NARROW and -yaw < BEAMY * m * k_zz**2) or sway * yaw <= ((by_yaw + by_sway) / 2) ** 2:
        charts, symmetric = "Motora's charts, by Zhou et al. (1983)", "a beamy ship counts as alike fore and aft"
        return {
            "X_udot": TemplateValue(-m * m_x, "kg", charts),
            "Y_vdot": TemplateValue(-m * m_y, "kg", charts),
            "Y_rdot": TemplateValue(0.0, "kg m", symmetric),
            "N_vdot": TemplateValue(0.0, "kg m", symmetric),
            "N_rdot": TemplateValue(-m * k_zz**2, "kg m^2", charts),
        }
    clarke = "Clarke et al. (1983)"
    surge = m / (math.pi * math.sqrt(L**3 / given.volume) - 14)
    return {
        "X_udot": TemplateValue(-surge, "kg", "-m / (pi sqrt(L^3 / volume) - 14), Soeding in Brix (1993)"),
        "Y_vdot": TemplateValue(sway, "kg", clarke),
        "Y_rdot": TemplateValue(by_yaw, "kg m", clarke),
        "N_vdot": TemplateValue(by_sway, "kg m", clarke),
        "N_rdot": TemplateValue(yaw, "kg m^2", clarke),
    }


def hull_values(given: Particulars) -> Values:
    """Derivatives in the primes of [hull.mmg]: linear by Clarke et al. (1983), the others by Kijima et al. (1990)."""
    L, B, T, C_b = given.length, given.beam, given.draught, given.block
    s, full, slender = -math.pi * T / L, C_b * B / L, (1 - C_b) * T / B
    added = {name: -value.number / (given.rho / 2 * L**2 * T) for name, value in added_mass_values(given).items()}
    m_x, m_y, centre = added["X_udot"], added["Y_vdot"], (added["Y_rdot"] + added["N_vdot"]) / 2 / L
    clarke, kijima = "Clarke et al. (1983), x L / T", "Kijima et al. (1990)"
    masumoto = "Yoshimura and Masumoto (2012)"
    X_vv = min(1.15 * full - 0.18, 0.0)
    return {
        "R_0": _resistance_value(given),
        "X_vv": TemplateValue(X_vv, "prime", f"1.15 C_b B / L - 0.18, at most 0, {masumoto}"),
        "X_vr": TemplateValue(
            1.91 * full - 0.08 - m_y, "prime", f"1.91 C_b B / L - 0.08 - m_y', {masumoto}: v = -U beta"
        ),
        "X_rr": TemplateValue(
            -0.085 * full + 0.008 - centre,
            "prime",
            f"-0.085 C_b B / L + 0.008, {masumoto}, + (Y_rdot + N_vdot) / 2 in primes, which turn apart",
        ),
        "X_vvvv": TemplateValue(
            min(max(-6.68 * full + 1.1, 0.0), -X_vv),
            "prime",
            f"-6.68 C_b B / L + 1.1, 0 to -X_vv: no drift drives it ahead, {masumoto}",
        ),
        "Y_v": TemplateValue(s * (1 + 0.4 * C_b * B / T), "prime", clarke),
        "Y_r": TemplateValue(
            s * (-0.5 + 2.2 * B / L - 0.08 * B / T) + m_x, "prime", f"{clarke}, + m_x', which turns apart"
        ),
        "Y_|v|v": TemplateValue(-2.5 * slender - 0.5, "prime", f"-2.5 (1 - C_b) T / B - 0.5, {kijima}"),
        "Y_|r|r": TemplateValue(0.343 * C_b * T / B - 0.07, "prime", f"0.343 C_b T / B - 0.07, {kijima}"),
        "Y_vrr": TemplateValue(-5.95 * slender, "prime", f"-5.95 (1 - C_b) T / B, {kijima}"),
        "Y_vvr": TemplateValue(1.5 * C_b * T / B - 0.65, "prime", f"1.5 C_b T / B - 0.65, {kijima}"),
        "N_v": TemplateValue(s * (0.5 + 2.4 * T / L), "prime", clarke),
        "N_r": TemplateValue(s * (0.25 + 0.039 * B / T - 0.56 * B / L), "prime", clarke),
        "N_|v|v": TemplateValue(0.96 * slender - 0.066, "prime", f"0.96 (1 - C_b) T / B - 0.066, {kijima}"),
        "N_|r|r": TemplateValue(
            min(0.5 * full - 0.09, MOST_N_RR), "prime", f"0.5 C_b B / L - 0.09, at most {MOST_N_RR:g}, {kijima}"
        ),
        "N_vrr": TemplateValue(0.5 * C_b * T / B - 0.05, "prime", f"0.5 C_b T / B - 0.05, {kijima}"),
        "N_vvr": TemplateValue(
            -(57.5 * full**2 - 18.4 * full + 1.6), "prime", f"-(57.5 (C_b B / L)^2 - 18.4 C_b B / L + 1.6), {kijima}"
        ),
    }


def _resistance_value(given: Particulars) -> TemplateValue:
    """[(1 + k) C_F + C_A] S / (L T): ITTC-57, form factor of Watanabe, wetted surface of Mumford; without waves."""
    sizes = given.length, given.beam, given.draught, given.block
    C_F, k, S = ittc_friction(given.service, given.length, NU), form_factor(*sizes), mumford_surface(*sizes)
    C_A = correlation_allowance(given.length) if given.reduction == 1.0 else 0.0
    rough = f", C_A = {C_A:.2g} (Holtrop and Mennen 1982)" if C_A else ""
    note = f"((1 + k) C_F + C_A) S / (L T): ITTC-57, k = {k:.2f} (Watanabe), S = {S:.4g} m^2 (Mumford){rough}"
    return TemplateValue(((1 + k) * C_F + C_A) * S / (given.length * given.draught), "-", note)


def wave_resistance_values(given: Particulars) -> Values:
    """Wave resistance as a sixth power of the speed, through that of Holtrop and Mennen (1982) at the service speed."""
    sizes = given.length, given.beam, given.draught, given.block
    R_W = wave_resistance(*sizes, given.service) * given.rho * GRAVITY * given.volume
    note = f"wave resistance {R_W:.3g} N at {given.service:.3g} m/s (Holtrop and Mennen 1982), as u^6"
    return {"R_4": TemplateValue(R_W / given.service**6, "kg m^-5 s^4", note)}


def total_resistance(given: Particulars) -> float:
    """Resistance [N] at the service speed, as the document has it."""
    U, calm = given.service, given.rho / 2 * given.length * given.draught
    return calm * _resistance_value(given).number * U**2 + wave_resistance_values(given)["R_4"].number * U**6


def wind_values(given: Particulars) -> Values:
    """Blendermann's coefficients of the type of ship, and guessed areas."""
    B, L_oa = given.beam, 1.05 * given.length
    names = ("C_Dt", "C_Dl_bow", "C_Dl_stern", "delta", "kappa")
    coefficients = {
        name: TemplateValue(number, "-", f"Blendermann (1994), {given.ship_type}")
        for name, number in zip(names, WIND[given.ship_type], strict=True)
    }
    return coefficients | {
        "A_FW": TemplateValue(0.8 * B**2, "m^2", "0.8 B^2: a guess"),
        "A_LW": TemplateValue(0.5 * L_oa * B, "m^2", "0.5 L_oa B: a guess"),
        "L_oa": TemplateValue(L_oa, "m", "1.05 L: a guess"),
        "s_L": TemplateValue(0.0, "m", "centroid of the lateral area amidships: a guess"),
        "s_H": TemplateValue(0.25 * B, "m", "half its mean height: a guess"),
    }


def _wake_fraction(given: Particulars) -> tuple[float, str]:
    """Wake fraction of Taylor."""
    if given.units == 2:
        return max(0.55 * given.block - 0.20, 0.0), "0.55 C_b - 0.20, Taylor, two screws"
    return 0.5 * given.block - 0.05, "0.5 C_b - 0.05, Taylor"


def _thrust_deduction(given: Particulars, D: float) -> tuple[float, str]:
    """Thrust deduction."""
    if given.units == 2:
        t = 0.325 * given.block - 0.1885 * D / math.sqrt(given.beam * given.draught)
        return max(t, 0.05), "0.325 C_b - 0.1885 D_p / sqrt(B T), Holtrop and Mennen (1982), two screws"
    return 0.6 * _wake_fraction(given)[0], "0.6 w_P0: a rule of thumb"


def guess_screw(given: Particulars) -> tuple[float, tuple[float, float, float], str, str]:
    """Diameter [m] and K_T polynomial of a screw whose thrust at the service speed is the resistance, and their notes.

    What is given of diameter and shaft speed is kept. Of the others the pitch gives way first, then the diameter.
    ShipidError where no screw of the series does that.
    """
    share = 0.5 if given.block > FULL else 0.65 if given.units == 1 else 0.55
    usual = min(share * given.draught, LARGEST_SCREW)
    D = given.propeller_diameter or usual
    words = "given" if given.propeller_diameter else f"{share:g} T, at most {LARGEST_SCREW:g} m: a guess"
    if given.rpm is None:
        return D, thrust_polynomial(PITCH), words, f"P / D = {PITCH:g}: a guess"
    n = given.rpm / 60
    if given.propeller_diameter is None and not _is_pitch_between(given, D, n, (PITCHES[0], STRONG_PITCH)):
        least, most = (share * given.draught for share in DIAMETERS)
        wanted = bisect_root(lambda size: _thrust_surplus(given, size, n, PITCH), least, most)
        if least < wanted < most:
            D, words = wanted, f"drives {given.service:.3g} m/s at {60 * n:.4g} rpm with P / D = {PITCH:g}"
    if not _is_pitch_between(given, D, n, PITCHES):
        low, high = sorted(
            60 * bisect_root(partial(_thrust_surplus, given, D, pitch=ratio), 0, FASTEST) for ratio in PITCHES
        )
        raise ShipidError(
            f"no screw of {D:.3g} m drives this ship at {given.service:.3g} m/s with {60 * n:.4g} rpm: {low:.3g} to "
            f"{high:.3g} rpm could. Is it the engine's speed, not the screw's? Is --speed another one?",
            path="--rpm",
        )
    pitch = bisect_root(lambda ratio: _thrust_surplus(given, D, n, ratio), *PITCHES)
    balance = f"P / D = {pitch:.3g} balances the resistance at {given.service:.3g} m/s and {60 * n:.4g} rpm"
    return D, thrust_polynomial(pitch), words, balance


def _is_pitch_between(given: Particulars, D: float, n: float, pitches: tuple[float, float]) -> bool:
    """Whether a pitch ratio between two gives a screw the thrust that the ship needs."""
    weak, strong = (_thrust_surplus(given, D, n, pitch) for pitch in pitches)
    return weak <= 0 <= strong


def _thrust_surplus(given: Particulars, D: float, n: float, pitch: float) -> float:
    """Thrust less resistance [N] at the service speed with screws of diameter D [m] at n [rev/s]."""
    k_0, k_1, k_2 = thrust_polynomial(pitch)
    J = min((1 - _wake_fraction(given)[0]) * given.service / (max(n, 1e-3) * D), J_MOST)
    thrust = given.rho * n**2 * D**4 * (k_0 + J * (k_1 + J * k_2))
    return given.units * (1 - _thrust_deduction(given, D)[0]) * thrust - total_resistance(given)


def propeller_values(given: Particulars, side: int = 0) -> Values:
    """One screw behind the hull; side -1 is that to port of two."""
    L, B, T = given.length, given.beam, given.draught
    (D, K_T, size, balance), (w_P0, wake) = guess_screw(given), _wake_fraction(given)
    drift = "KVLCC2, mean of both sides"
    t_P, deduction = _thrust_deduction(given, D)
    series = f"Wageningen B 4-55, {balance}"
    return {
        "x": TemplateValue(-0.48 * L, "m", "-0.48 L"),
        **({"y": TemplateValue(side * 0.22 * B, "m", "0.22 B off the middle: a guess")} if side else {}),
        "z": TemplateValue(0.65 * T, "m", "0.65 T below the waterline: a guess"),
        "D_p": TemplateValue(D, "m", size),
        "k_astern": TemplateValue(0.7, "-", "thrust astern over ahead of a fixed screw: a guess"),
        "t_P": TemplateValue(t_P, "-", deduction),
        "w_P0": TemplateValue(w_P0, "-", wake),
        "C_1": TemplateValue(2.0, "-", "KVLCC2, Yasukawa and Yoshimura (2015)"),
        "C_2_plus": TemplateValue(1.35 if given.units == 1 else 1.0, "-", drift if given.units == 1 else "a guess"),
        "C_2_minus": TemplateValue(1.35 if given.units == 1 else 1.0, "-", drift if given.units == 1 else "a guess"),
        **{f'K_T."{name}"': TemplateValue(k, "-", series) for name, k in zip(("1", "J", "JJ"), K_T, strict=True)},
    }


def rudder_values(given: Particulars, side: int = 0) -> Values:
    """One rudder behind a screw; side -1 is that to port of two."""
    L, B, T, C_b = given.length, given.beam, given.draught, given.block
    share, words = (1.0, "") if given.units == 1 else (0.6, ", 0.6 of it each")
    A_R = given.rudder_area or share * L * T / 100 * (1 + 25 * (B / L) ** 2)
    H_R = min(math.sqrt(1.6 * A_R), 0.9 * T)
    aspect = H_R**2 / A_R
    epsilon = 2.26 - 1.82 * (1 - _wake_fraction(given)[0])
    masumoto = "Yoshimura and Masumoto (2012)"
    gamma_R = TemplateValue(2.06 * C_b * B / L + 0.14, "-", f"2.06 C_b B / L + 0.14, {masumoto}")
    gear = f"35 to -30 deg in 28 s, SOLAS II-1/29{given.faster[1]}"
    return {
        "x": TemplateValue(-0.5 * L, "m", "aft perpendicular"),
        **({"y": TemplateValue(side * 0.22 * B, "m", "behind its screw")} if side else {}),
        "z": TemplateValue(T - 0.55 * H_R, "m", "middle of its height: a guess"),
        "A_R": TemplateValue(
            A_R,
            "m^2",
            "given" if given.rudder_area else f"L T / 100 (1 + 25 (B / L)^2), Det Norske Veritas' least{words}",
        ),
        "H_R": TemplateValue(H_R, "m", "aspect ratio 1.6, at most 0.9 T: a guess"),
        "f_alpha": TemplateValue(6.13 * aspect / (aspect + 2.25), "-", "6.13 a / (a + 2.25), a = H_R^2 / A_R, Fujii"),
        "epsilon": TemplateValue(epsilon, "-", f"2.26 - 1.82 (1 - w_P0), {masumoto}"),
        "kappa": TemplateValue(0.55 / epsilon, "-", f"0.55 / epsilon, {masumoto}"),
        "gamma_R_plus": gamma_R,
        "gamma_R_minus": gamma_R,
        "ell_R": TemplateValue(-0.9 * L, "m", f"-0.9 L, {masumoto}"),
        "t_R": TemplateValue(0.39, "-", masumoto),
        "a_H": TemplateValue(0.627 * C_b - 0.153, "-", "0.627 C_b - 0.153, Quadvlieg (2013)"),
        "x_H": TemplateValue(-0.45 * L, "m", "-0.45 L, Aoki et al. (2006)"),
        "actuator.delta.T": TemplateValue(1.0 / given.faster[0], "s", f"1 s of a ship: a guess{_over_words(given)}"),
        "actuator.delta.rate": TemplateValue(math.radians(STEERING * given.faster[0]), "rad/s", gear),
    }


def _over_words(given: Particulars) -> str:
    return given.faster[1].replace(" times ", " over ", 1)


def azimuth_values(given: Particulars, side: int) -> Values:
    """One azimuth unit at the stern; of two, side -1 is that to port; 0 is one in the middle."""
    unit = value_at_path(read_document(bundled_documents("models")["gunnerus-28.9"]), "thruster.port")
    D, k_T, size, strength = _azimuth_size(given, unit)
    placed = {
        "x": TemplateValue(-0.46 * given.length, "m", "-0.46 L: a guess"),
        "y": TemplateValue(
            side * 0.28 * given.beam, "m", "0.28 B off the middle: a guess" if side else "in the middle"
        ),
        "z": TemplateValue(0.75 * given.draught, "m", "0.75 T: a guess"),
        "D_p": TemplateValue(D, "m", size),
        "k_T": TemplateValue(k_T, "-", strength),
    }
    tables = {f'{name}."{key}"': one for name in ("K_x", "K_y") for key, one in unit[name].items()}
    copied = {
        name: TemplateValue(number, "-", "unit of R/V Gunnerus")
        for name, number in (unit | tables).items()
        if isinstance(number, float) and name not in placed
    }
    gear = f"two turns a minute: a guess{given.faster[1]}"
    lag = {
        "actuator.alpha.T": TemplateValue(0.5 / given.faster[0], "s", f"0.5 s of a ship: a guess{_over_words(given)}"),
        "actuator.alpha.rate": TemplateValue(math.radians(AZIMUTHING * given.faster[0]), "rad/s", gear),
    }
    return placed | copied | lag


def _azimuth_size(given: Particulars, unit: Mapping[str, Any]) -> tuple[float, float, str, str]:
    """Diameter [m] and k_T of a unit whose thrust at the given shaft speed is the resistance, and their derivation.

    A diameter that is not given follows from the shaft speed first, then k_T.
    """
    known, usual = given.propeller_diameter, AZIMUTH_DIAMETER * given.draught
    D, size = (known, "given") if known else (usual, f"{AZIMUTH_DIAMETER:g} T: a guess")
    if given.rpm is None:
        return D, 1.0, size, "unit of R/V Gunnerus"
    n = given.rpm / 60

    def thrust(diameter: float) -> float:
        J = min(given.service / (n * diameter), unit["J_max"])
        K_x = sum(number * J ** name.count("J") for name, number in unit["K_x"].items() if set(name) <= {"1", "J"})
        return float(given.units * given.rho * n**2 * diameter**4 * K_x)

    needed, balanced = total_resistance(given), f"{given.service:.3g} m/s and {given.rpm:.4g} rpm"
    if known is None:
        D = bisect_root(lambda one: thrust(one) - needed, DIAMETERS[0] * given.draught, DIAMETERS[1] * given.draught)
        size = f"balances the resistance at {balanced}"
    scale = needed / thrust(D) if thrust(D) > 0 else math.inf
    if not SCALES[0] <= scale <= SCALES[1]:
        raise ShipidError(
            f"azimuth units of {D:.3g} m at {given.rpm:.4g} rpm would need {scale:.2g} times the usual thrust to "
            f"drive this ship at {given.service:.3g} m/s: is it the engine's speed, not the screw's?",
            path="--rpm",
        )
    return D, scale, size, f"balances the resistance at {balanced}"


def tunnel_values(given: Particulars) -> Values:
    """A tunnel thruster at the bow: F_2 n|n|, the thrust of a screw of 0.35 T with K_T 0.3."""
    D = min(0.35 * given.draught, 3.0)
    return {
        "x": TemplateValue(0.4 * given.length, "m", "0.4 L: a guess"),
        "z": TemplateValue(0.6 * given.draught, "m", "0.6 T: a guess"),
        "F_1": TemplateValue(0.0, "N s", "thrust goes with n|n|"),
        "F_2": TemplateValue(0.3 * given.rho * D**4, "N s^2", f"0.3 rho D^4, D = {D:.3g} m, 0.35 T up to 3 m: a guess"),
        "F_3": TemplateValue(0.0, "N s^3", "thrust goes with n|n|"),
    }


def _document_lines(given: Particulars, name: str) -> Iterator[str]:
    """The document, line by line."""
    known = "given" if given.speed is not None else "a Froude number of 0.2: a guess"
    main: Values = {
        "L_pp": TemplateValue(given.length, "m", "given"),
        "B": TemplateValue(given.beam, "m", "given"),
        "T": TemplateValue(given.draught, "m", "given"),
        "C_b": TemplateValue(given.block, "-", "given"),
        "U_0": TemplateValue(given.service, "m s^-1", known),
    }
    yield from head_lines(name, main, given.rho)
    yield from block_lines("inertia", inertia_values(given))
    yield from block_lines("added_mass", added_mass_values(given), coriolis="mmg")
    yield from block_lines("hull.mmg", hull_values(given))
    yield from block_lines("hull.resistance", wave_resistance_values(given))
    yield from block_lines("wind", wind_values(given), kind="blendermann")
    yield from _thruster_lines(given)
    if given.tunnel_thruster:
        yield from block_lines("thruster.bow", tunnel_values(given), kind="tunnel")


def head_lines(name: str, particulars: Values, rho: float) -> Iterator[str]:
    """What every first guess begins with: its name, particulars, and the densities of water and air [kg/m^3]."""
    yield f"name = {_quote_toml(name)}"
    yield 'description = "A first guess from main particulars by regression formulae: no number of it is measured"'
    yield 'source = "shipid vessel new: the formula of each number is beside it"\ndof = 3\n'
    yield from block_lines("particulars", particulars)
    water = "sea" if rho == RHO_SEA else "fresh water of a tank"
    densities = {"rho": TemplateValue(rho, "kg m^-3", water), "rho_a": TemplateValue(RHO_AIR, "kg m^-3", "air")}
    yield from block_lines("constants", densities)


def _thruster_lines(given: Particulars) -> Iterator[str]:
    """What drives and steers the ship: names as in logs, `port` and `starboard` where there are two."""
    sides = ((-1, "port"), (1, "starboard")) if given.units == 2 else ((0, ""),)
    steered = "alpha" if given.propulsor == "azimuth" else "delta"
    for side, name in sides:
        if given.propulsor == "azimuth":
            words = {"kind": "azimuth", f"actuator.{steered}.kind": "first_order"}
            yield from block_lines(f"thruster.{name or 'azimuth'}", azimuth_values(given, side), **words)
            continue
        behind = name or "propeller"
        yield from block_lines(f"thruster.{behind}", propeller_values(given, side), kind="propeller")
        if given.propulsor == "differential":
            continue
        words = {"kind": "rudder", "behind": behind, f"actuator.{steered}.kind": "first_order"}
        yield from block_lines(f"thruster.{name and f'{name}_'}rudder", rudder_values(given, side), **words)


def block_lines(path: str, values: Values, **words: str | int) -> Iterator[str]:
    """A block of a vessel document: words without a unit first, then each number with its note."""
    yield f"[{path}]"
    yield 'source = "the formula or guess beside each number"'
    yield from (f"{key} = {word if isinstance(word, int) else _quote_toml(word)}" for key, word in words.items())
    for key, value in values.items():
        shown = _quote_toml(key) if "|" in key and '"' not in key else key
        yield f"{shown} = {float(f'{value.number:.6g}')!r}  # {value.unit}; {value.note}"
    yield ""


def _quote_toml(text: str) -> str:
    """A string of TOML: that of JSON, but for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
