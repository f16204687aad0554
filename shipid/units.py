"""Factors from common units to SI: value in SI = value * factor; gravity; how units, numbers and lists are written."""

import math
import re
from collections.abc import Mapping, Sequence

RPM = 1.0 / 60.0
"""Revolutions per second in one revolution per minute."""
DEGREE = math.pi / 180.0
"""Radians in one degree; also rad/s in one deg/s."""
KNOT = 1852.0 / 3600.0
"""Metres per second in one knot (the international nautical mile is 1,852 m)."""
MINUTE = 60.0
"""Seconds in one minute."""
GRAVITY = 9.81
"""Acceleration of gravity [m/s^2], where a vessel gives no other one; 9.80665 (BIPM, SI Brochure) to three digits."""

SYMBOLS = ("kg", "m", "s", "N", "rad", "deg", "rev", "Pa", "W", "J", "K", "Hz", "-", "prime")
"""Symbols of units of parameters; `prime`: by half rho and powers of length and speed (SNAME 1950)."""
_POWER = r"\^-?\d+(?:\.\d+)?"
_PRODUCT = rf"(?:{'|'.join(SYMBOLS)})(?:{_POWER})?"
_PRODUCT = rf"{_PRODUCT}(?: {_PRODUCT})*"
_DERIVED = {"N": "kg m/s^2", "Pa": "kg/m/s^2", "J": "kg m^2/s^2", "W": "kg m^2/s^3", "Hz": "1/s"}
_FACTOR = re.compile(r"([^\s^]+)(?:\^(\S+))?")
_QUOTIENT = rf"(?:{_PRODUCT}|1(?=/))(?:/{_PRODUCT})*"


def unit_fault(unit: str) -> str:
    """What to write in place of a unit that is no product of powers, such as `kg m^-1`; empty for one that is.

    Powers may have decimals. All behind a `/` divides, up to the next one: `m/s^2`, `kg/m/s`. There may be brackets.
    """
    symbols = join_names([one for one in SYMBOLS if one not in ("-", "prime")])
    remedy = f"write a product of powers of {symbols}, such as 'kg m^-1' or 'N s^1.5/m', or '-' for a pure number"
    return "" if _is_unit_product(unit) else remedy


def _is_unit_product(unit: str) -> bool:
    """Whether a text is a quotient of products; what is in brackets counts as one unit, from the inside on."""
    while (flat := re.sub(rf"\({_QUOTIENT}\)", "m", unit)) != unit:
        unit = flat
    return re.fullmatch(_QUOTIENT, unit) is not None


def unit_value(unit: str, sizes: Mapping[str, float]) -> float:
    """The value of a unit, see `unit_fault`, in which m, s and kg have these values, or 1; N is kg m s^-2, and so on.

    With ratios of length, time and mass as `sizes` it is the ratio of numbers in this unit.
    """
    while inner := re.search(r"\(([^()]*)\)", unit):
        sizes = {**sizes, (name := f"<{len(unit)}>"): unit_value(inner[1], sizes)}
        unit = unit.replace(inner[0], name)
    above, *below = (
        math.prod(
            (unit_value(_DERIVED[symbol], sizes) if symbol in _DERIVED else sizes.get(symbol, 1.0)) ** float(power or 1)
            for symbol, power in _FACTOR.findall(part)
        )
        for part in unit.split("/")
    )
    return float(above / math.prod(below))


def length_decimals(length: float) -> int:
    """Number of decimals of a length [m]: two, or more where it has two digits only so, up to six."""
    size = abs(length)
    power = int(f"{size:.1e}".partition("e")[2]) if 0.0000005 <= size < 0.0995 else 0  # once two digits are rounded
    return min(max(1 - power, 2), 6)


def length_text(length: float) -> str:
    """A length [m] as text, with the decimals of `length_decimals`."""
    return f"{length:.{length_decimals(length)}f}"


def digit_decimals(value: float, digits: int) -> int:
    """Number of decimals that gives a number so many digits, none at least; that of 1 for 0."""
    return max(digits - 1 - math.floor(math.log10(abs(value))), 0) if value else digits - 1


def significant_digits(value: float, most: int = 3, sign: str = "") -> str:
    """Format with so many significant digits, but never round digits before the decimal point."""
    return f"{value:{sign}.0f}" if abs(value) >= 10**most - 0.5 else f"{value:{sign}.{most}g}"


def interval_text(low: float, high: float, between: str = " ... ") -> str:
    """Both ends of an interval with the same decimals: those that give half its width two digits, six at most."""
    half = (high - low) / 2
    places = min(digit_decimals(half, 2), 6) if math.isfinite(half) else 0
    return f"{low:z.{places}f}{between}{high:z.{places}f}"


def percent_text(share: float, decimals: int = 0, *, signed: bool = False) -> str:
    """A share as text, with a space before the sign as after any number (ISO 80000-1): 0.284 is 28 %."""
    return f"{100 * share:{'+' if signed else ''}.{decimals}f} %"


def level_text(level: float) -> str:
    """The level of a band as text, with the decimals that it has: 0.9 is 90 %, and 0.975 is 97.5 %."""
    return f"{100 * level:.10g} %"


def plural_word(count: int, one: str, many: str | None = None) -> str:
    """Return the word for so many: `one` for 1, else `many`, which by default is `one` with an s."""
    return one if count == 1 else f"{one}s" if many is None else many


def join_names(names: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
