"""What numbers a ship can have: physical ranges by kind of number, wider than those of the ships in the sources.

Sources: added mass and radii of gyration, Clarke et al. (1983), Brix (1993); propulsion factors, Carlton (2018);
rudder factors, Yasukawa and Yoshimura (2015), Quadvlieg (2013).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from shipid.vessel.load import Vessel

FARTHEST = 1e4  # factor
NEAR = 0.02  # of the range: nearer to an end is at it


@dataclass(frozen=True)
class Kind:
    """A kind of number: `ratio` of a value and the vessel's other numbers, which lies between low and high for ships.

    pattern : regular expression of the dotted paths. words : what the ratio is. A ratio of None is not judged.
    """

    pattern: str
    words: str
    low: float
    high: float
    ratio: Callable[[float, Mapping[str, float], float | None], float | None]


def _own_value(value: float, _: Mapping[str, float], __: float | None) -> float:
    return value


def _ratio_to(path: str) -> Callable[[float, Mapping[str, float], float | None], float | None]:
    """Minus a value over another number of the vessel: the derivatives of added mass are negative."""

    def ratio(value: float, numbers: Mapping[str, float], _: float | None) -> float | None:
        return -value / numbers[path] if numbers.get(path) else None

    return ratio


def _over_length(value: float, _: Mapping[str, float], length: float | None) -> float | None:
    return value / length if length else None


def _gyration_ratio(value: float, numbers: Mapping[str, float], length: float | None) -> float | None:
    m, x_G = numbers.get("inertia.m"), numbers.get("inertia.x_G", 0.0)
    if not m or not length:
        return None
    return math.sqrt(max(value / m - x_G**2, 0.0)) / length


_HULL = r"hull\.(?:derivatives|prime_derivatives|mmg)\."
_SQUARE = r"(?:\|{0}\|{0}|{0}\|{0}\|)"  # both ways to write a signed square
KINDS = (
    Kind(r"added_mass\.X_udot", "added mass in surge over the mass", 0.01, 0.25, _ratio_to("inertia.m")),
    Kind(r"added_mass\.Y_vdot", "added mass in sway over the mass", 0.25, 1.8, _ratio_to("inertia.m")),
    Kind(r"added_mass\.N_rdot", "added moment in yaw over I_z", 0.15, 2.0, _ratio_to("inertia.I_z")),
    Kind(r"inertia\.I_z", "radius of gyration in yaw over L_pp", 0.18, 0.36, _gyration_ratio),
    Kind(
        rf"{_HULL}(?:Y_u?v|N_u?r|Y_{_SQUARE.format('v')}|N_{_SQUARE.format('r')}|X_u|X_{_SQUARE.format('u')})"
        r"|hull\.abkowitz\.(?:Y_v|N_r)",
        "damping, on the force side",
        -math.inf,
        0.0,
        _own_value,
    ),
    Kind(r"hull\.crossflow\.C_d", "cross-flow drag", 0.1, 2.5, _own_value),
    Kind(r"hull\.mmg\.R_0", "resistance", 0.003, 0.1, _own_value),
    Kind(r"thruster\..*\.t_P", "thrust deduction", 0.0, 0.45, _own_value),
    Kind(r"thruster\..*\.w_P0", "wake", -0.05, 0.65, _own_value),
    Kind(r"thruster\..*\.a_H", "rudder force increase", 0.0, 0.9, _own_value),
    Kind(r"thruster\..*\.t_R", "steering resistance deduction", 0.0, 0.7, _own_value),
    Kind(r"thruster\..*\.gamma_R_(?:plus|minus)", "flow straightening", 0.1, 1.1, _own_value),
    Kind(r"thruster\..*\.epsilon", "wake at the rudder over that at the screw", 0.5, 1.6, _own_value),
    Kind(r"thruster\..*\.kappa", "share of the race", 0.2, 1.0, _own_value),
    Kind(r"thruster\..*\.f_alpha", "lift gradient of the rudder", 0.8, 5.5, _own_value),
    Kind(r"thruster\..*\.ell_R", "lever of the flow at the rudder over L_pp", -1.5, -0.2, _over_length),
    Kind(r"thruster\..*\.k_T", "thrust over that of the open-water curve", 0.3, 2.0, _own_value),
)
"""Kinds of numbers with the ranges that ships have."""


def _coefficient_kind(path: str) -> Kind | None:
    return next((one for one in KINDS if re.fullmatch(one.pattern, path)), None)


def plausible_factors(vessel: Vessel, path: str) -> tuple[float, float]:
    """Least and greatest factor on a number with which it stays in the range of ships; infinite where none is known."""
    kind = _coefficient_kind(path)
    base, numbers = vessel.parameters[path], vessel.parameters
    if kind is None or base == 0:
        return -math.inf, math.inf

    def ratio(factor: float) -> float | None:
        return kind.ratio(factor * base, numbers, vessel.length)

    one, far = ratio(1.0), ratio(FARTHEST)
    if one is None or far is None or one == far:
        return -math.inf, math.inf
    ends = [_factor_at_limit(ratio, end, far > one) for end in (kind.low, kind.high)]
    return min(1.0, *ends), max(1.0, *ends)


def _factor_at_limit(ratio: Callable[[float], float | None], end: float, rising: bool) -> float:
    """Factor at which a ratio that rises (or falls) with it reaches an end of the range; infinite where it does not."""
    if not math.isfinite(end):
        return math.inf if (end > 0) == rising else -math.inf
    low, high = -FARTHEST, FARTHEST
    for _ in range(80):
        middle = (low + high) / 2
        value = ratio(middle)
        low, high = (middle, high) if value is not None and (value < end) == rising else (low, middle)
    return high if abs(high) < FARTHEST / 2 else math.copysign(math.inf, high)


def _coefficient_ratio(vessel: Vessel, path: str, numbers: Mapping[str, float]) -> tuple[Kind, float] | None:
    """Kind of a number and its ratio; None where no range is known."""
    kind = _coefficient_kind(path)
    ratio = kind.ratio(numbers[path], numbers, vessel.length) if kind is not None else None
    return None if kind is None or ratio is None else (kind, ratio)


def implausibility(vessel: Vessel, path: str, values: Mapping[str, float]) -> str:
    """Why a number cannot be that of a ship, or that it is at an end of the range; empty where it may.

    values : dotted path -> value of all numbers that were changed.
    """
    numbers = {**vessel.parameters, **values}
    seen = _coefficient_ratio(vessel, path, numbers)
    if seen is None:
        return ""
    kind, ratio = seen
    sentence = f"{path} = {numbers[path]:.4g}: {kind.words} is {ratio:.3g}"
    usual = f"of ships {kind.low:g} to {kind.high:g}" if math.isfinite(kind.low) else "of ships below 0"
    if not kind.low <= ratio <= kind.high:
        return f"{sentence}, {usual}: no ship has that; hold it, or give it a prior"
    width = kind.high - kind.low
    if math.isfinite(width) and min(ratio - kind.low, kind.high - ratio) < NEAR * width:
        return f"{sentence}, at the end of the range {usual}"
    return ""
