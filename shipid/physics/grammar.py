"""Grammar of coefficient names: a name gives the monomial, the unit and the prime scaling of the coefficient.

`Y_vvr` is v^2 r, `X_u|u|` is u|u|, `Y_|r|v` is |r| v, `N_vdot` multiplies the sway acceleration. The same grammar
reads the polynomials of a thruster in J and J_y.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache, partial
from typing import TypeVar

from shipid.physics import symbols as ca
from shipid.physics.frames import SX

Names = TypeVar("Names", bound=Iterable[str])

AXES = "XYZKMN"
MOTIONS = "uvwpqr"
HEEL = "phi"
DEVIATIONS = ("u", "v", "r", "delta")
ACCELERATIONS = rf"[{AXES}]_[{MOTIONS}]dot"
POSITIVE = object()  # marks a parameter that must be greater than zero


@dataclass(frozen=True)
class Monomial:
    """Formula of a coefficient: axis of the force or moment, and factors (symbol, whether the absolute value)."""

    axis: str
    factors: tuple[tuple[str, bool], ...]

    @property
    def order(self) -> int:
        """Number of factors."""
        return len(self.factors)

    @cached_property
    def canonical(self) -> tuple[str, tuple[tuple[str, bool], ...]]:
        """Normal form: equal for names of one monomial, because the order of factors is free and |x||x| = x x."""
        moduli = [symbol for symbol, absolute in self.factors if absolute]
        pairs = {symbol: moduli.count(symbol) // 2 * 2 for symbol in moduli}
        plain = [(symbol, False) for symbol, absolute in self.factors if not absolute]
        plain += [(symbol, False) for symbol, count in pairs.items() for _ in range(count)]
        plain += [(symbol, True) for symbol, count in pairs.items() if moduli.count(symbol) > count]
        return self.axis, tuple(sorted(plain))

    def value(self, symbols: Mapping[str, SX]) -> SX:
        """Product of the factors; `symbols` maps each symbol to its value."""
        product = ca.SX(1)
        for symbol, absolute in self.factors:
            product *= ca.fabs(symbols[symbol]) if absolute else symbols[symbol]
        return product


@cache
def parse_monomial(name: str, alphabet: str | tuple[str, ...], axes: str = AXES) -> Monomial:
    """Parse a coefficient name whose factors are words of the alphabet; ValueError shows the expected form."""
    word = f"(?:{'|'.join(alphabet)})"
    factor = rf"{word}|\|{word}\|"
    parts = re.fullmatch(rf"{f'([{axes}])_' if axes else '()'}((?:{factor})+)", name)
    if parts is None:
        start = f"one of {', '.join(axes)}, an underscore, then " if axes else ""
        one, other = ("v", "r") if {"v", "r"} <= {*alphabet} else (alphabet[0], alphabet[-1])
        example = f"{'Y_' if axes else ''}{one}|{other}|"
        raise ValueError(
            f"{name!r} is not a coefficient: {start}factors of {', '.join(alphabet)}, bare or as |x|, like {example!r}"
        )
    tokens = re.findall(factor, parts[2])
    return Monomial(parts[1], tuple((token.strip("|"), token.startswith("|")) for token in tokens))


@dataclass(frozen=True)
class Grammar:
    """Rules of an open table of coefficients: the valid names, and the unit that follows from a name."""

    check_name: Callable[[str], Monomial]
    unit: Callable[[str], str]

    def check(self, names: Names) -> Names:
        """The names as they are; ValueError for the first invalid one, or for a second name of one monomial."""
        _check_coefficient_names(self, tuple(names))
        return names


@lru_cache(maxsize=256)
def _check_coefficient_names(grammar: Grammar, names: tuple[str, ...]) -> None:
    """See `Grammar.check`: once for all members of a family, whose names are equal."""
    seen: dict[object, str] = {}
    for name in names:
        formula = grammar.check_name(name).canonical
        if formula in seen:
            raise ValueError(f"{name!r} and {seen[formula]!r} name the same monomial: keep one")
        seen[formula] = name


def hull_derivative(name: str) -> Monomial:
    """Monomial of a hull derivative from its name (SNAME 1950); ValueError for acceleration derivatives.

    Factors are the motions and the angle of heel, phi.
    """
    if name.endswith("dot"):
        raise ValueError(f"{name!r} is an acceleration derivative: it belongs in [added_mass]")
    if "delta" in name:
        where = "a block such as [thruster.rudder] with kind = 'rudder_derivatives'"
        raise ValueError(f"{name!r} is a rudder derivative: it belongs in {where}")
    return parse_monomial(name, (HEEL, *MOTIONS))


def reverses_astern(formula: Monomial) -> bool:
    """Whether the force of a hull that is alike fore and aft has the other sign where it goes astern.

    Mirrored fore and aft, X, M, N and u, q, r change their signs. So Y_v v is the same astern, N_v v is not (Munk's
    moment goes with u v); what has a factor u turns by itself.
    """
    turned = sum(symbol in "uqr" and not absolute for symbol, absolute in formula.factors)
    return (formula.axis in "XMN") ^ (turned % 2 == 1)


def count_rates(formula: Monomial) -> int:
    """Number of factors that are velocities or angular velocities."""
    return sum(symbol != HEEL for symbol, _ in formula.factors)


def acceleration_derivative(name: str) -> Monomial:
    """Monomial of an added-mass derivative from its name, such as `Y_rdot`."""
    if not re.fullmatch(ACCELERATIONS, name):
        raise ValueError(f"{name!r} is not an added-mass derivative: write it like 'X_udot' or 'N_vdot'")
    return Monomial(name[0], ((name[2], False),))


def kg_unit(metre: int, second: int) -> str:
    """The unit `kg m^metre s^second` as text, without factors of power 0."""
    powers = [f"{symbol}^{power}" if power != 1 else symbol for symbol, power in (("m", metre), ("s", second)) if power]
    return " ".join(["kg", *powers])


def derivative_unit(name: str) -> str:
    """SI unit of a hull derivative; radians count as 1."""
    formula = hull_derivative(name)
    linear = sum(symbol in "uvw" for symbol, _ in formula.factors)
    return kg_unit((1 if formula.axis in "XYZ" else 2) - linear, count_rates(formula) - 2)


def acceleration_unit(name: str) -> str:
    """SI unit of an added-mass derivative: kg, kg m or kg m^2."""
    return kg_unit((name[0] in "KMN") + (name[2] in "pqr"), 0)


def prime_scale(name: str, rho: SX, L: SX, U: SX) -> SX:
    """Factor from a derivative in the prime system to SI: 1/2 rho L^a U^(2 - order) (SNAME 1950); heel has no order.

    Force = 1/2 rho L^2 U^2, moment = 1/2 rho L^3 U^2, motions u/U, v/U, r L/U; so a = 2 or 3 plus the number of
    angular factors. U [m/s] is the instantaneous speed and cancels for second-order derivatives.
    """
    formula = hull_derivative(name)
    angular = sum(symbol in "pqr" for symbol, _ in formula.factors)
    length = (2 if formula.axis in "XYZ" else 3) + angular
    return rho / 2 * L**length * U ** (2 - count_rates(formula))


def bis_scale(name: str, rho: SX, g: SX, nabla: SX, L: SX) -> SX:
    """Factor from a derivative in the bis system to SI (Norrbin 1970): force rho g nabla, length L, time sqrt(L / g).

    Moment rho g nabla L; motions u / sqrt(g L), v / sqrt(g L), r sqrt(L / g). g cancels for second-order derivatives.
    """
    formula = hull_derivative(name)
    linear = sum(symbol in "uvw" for symbol, _ in formula.factors)
    length = (0 if formula.axis in "XYZ" else 1) + count_rates(formula) - linear
    order = count_rates(formula)
    return rho * nabla * g * L**length * (1 / (g * L) if order == 2 else (g * L) ** (-order / 2))


def service_deviation(name: str) -> Monomial:
    """Monomial of an Abkowitz derivative about the service speed: factors u (change of speed), v, r and delta."""
    return parse_monomial(name, DEVIATIONS)


def hull_deviation(name: str) -> Monomial:
    """Monomial of an Abkowitz derivative of the hull: no factor delta; ValueError for a rudder derivative."""
    formula = service_deviation(name)
    if any(symbol == "delta" for symbol, _ in formula.factors):
        raise ValueError(f"{name!r} is a rudder derivative: it belongs in a rudder of kind 'rudder_derivatives'")
    return formula


def rudder_deviation(name: str) -> Monomial:
    """Monomial of an Abkowitz derivative of the rudder: at least one factor delta; ValueError without it."""
    formula = service_deviation(name)
    if all(symbol != "delta" for symbol, _ in formula.factors):
        raise ValueError(f"{name!r} has no factor delta: it belongs in [hull.abkowitz]")
    return formula


def rudder_flow(name: str) -> Monomial:
    """Monomial of a rudder coefficient: two factors c, the flow at the rudder, then delta and the drift angle beta."""
    formula = parse_monomial(name, ("beta", "delta", "c"))
    if sum(symbol == "c" for symbol, _ in formula.factors) != 2:
        raise ValueError(f"{name!r} must have two factors c, the flow at the rudder, like 'Y_|c|cdelta'")
    return formula


def cross_flow_monomial(name: str) -> Monomial:
    """Monomial of the flow across a rudder: factors v and r, in primes."""
    return parse_monomial(name, "vr", axes="")


def thrust_monomial(name: str, alphabet: str = "Jyt") -> Monomial:
    """Monomial of a thruster coefficient: factors J, y (J_y) and t (tanh(|J_y| / width)); `1` is the constant term."""
    return Monomial("", ()) if name == "1" else parse_monomial(name, alphabet, axes="")


DERIVATIVES = Grammar(hull_derivative, derivative_unit)
PRIME_DERIVATIVES = Grammar(hull_derivative, lambda _: "prime")
BIS_DERIVATIVES = Grammar(hull_derivative, lambda _: "bis")
HULL_DEVIATIONS = Grammar(hull_deviation, lambda _: "prime")
RUDDER_DEVIATIONS = Grammar(rudder_deviation, lambda _: "prime")
ADDED_MASS = Grammar(acceleration_derivative, acceleration_unit)
RUDDER_FLOWS = Grammar(rudder_flow, lambda _: "prime")
CROSS_FLOWS = Grammar(cross_flow_monomial, lambda _: "prime")
THRUST = Grammar(thrust_monomial, lambda _: "-")
ADVANCE = Grammar(partial(thrust_monomial, alphabet="J"), lambda _: "-")  # of a screw behind a hull: factors J alone
