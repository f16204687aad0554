"""Collected terms: the same function to rounding, with no more multiplications where inputs are not known early."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from shipid.document import bundled_documents
from shipid.engine.collect import collect_terms
from shipid.engine.graph import InstructionGraph
from shipid.engine.printing import STAGES
from shipid.engine.tables import find_tables, inside_tables
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.drawn import seeds
from tests.drawn_ships import drawn_ship

EARLY = frozenset(name for stage in STAGES for name in stage)
PRODUCTS = {ca.OP_MUL, ca.OP_SQ, ca.OP_DIV}


def late_products(function: ca.Function) -> int:
    """Number of multiplications and divisions that an input which is not early has a part in, tables left out."""
    graph, tables = InstructionGraph(function), inside_tables(function)
    late: list[bool] = []
    for k, (operation, operands) in enumerate(zip(graph.operation, graph.operands, strict=True)):
        given = operation == ca.OP_INPUT and function.name_in(function.instruction_input(k)[0]) not in EARLY
        late.append(given or any(late[i] for i in operands))
    return sum(late[k] and graph.operation[k] in PRODUCTS and k not in tables for k in range(len(late)))


def check(vessel: Vessel, seed: int) -> None:
    rates = vessel_dynamics(vessel).rates
    collected = collect_terms(rates, EARLY)
    assert collected.name_in() == rates.name_in()
    assert len(find_tables(collected)) == len(find_tables(rates))
    assert late_products(collected) <= late_products(rates)
    random = np.random.default_rng(seed)
    for _ in range(20):
        given = {name: random.normal(size=rates.size1_in(name)) for name in rates.name_in()}
        given["parameters"] = np.array(list(vessel.parameters.values())) * random.uniform(0.8, 1.2)
        expected, found = (np.array(f(*given.values())).ravel() for f in (rates, collected))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("dof", [3, 4, 6])
@pytest.mark.parametrize("seed", seeds(2, 6))
def test_drawn_ships_keep_their_rates(seed: int, dof: int) -> None:
    check(drawn_ship(seed + 700, dof), seed)


@pytest.mark.parametrize("name", sorted(bundled_documents("models")))
def test_bundled_vessels_keep_their_rates(name: str) -> None:
    check(load_vessel(name), 1)


def function(result: ca.SX, p: ca.SX, x: ca.SX) -> ca.Function:
    return ca.Function("f", [p, x], [ca.densify(result)], ["parameters", "state"], ["result"])


def test_coefficients_of_one_product_are_added_early() -> None:
    """A Coriolis force and a term of the hull, both of v r: one coefficient."""
    p, x = ca.SX.sym("p", 3), ca.SX.sym("x", 2)
    v, r = x[0], x[1]
    made = function((p[0] * v + p[1] * r) * r + p[2] * v * r, p, x)
    collected = collect_terms(made, EARLY)
    assert late_products(made) == 5
    assert late_products(collected) == 3  # r ((p_0 + p_2) v + p_1 r)
    assert float(collected([2.0, 3.0, 5.0], [0.5, 7.0])) == pytest.approx(7.0 * (7.0 * 0.5 + 3.0 * 7.0))


@pytest.mark.parametrize("seed", seeds(2, 5))
def test_a_polynomial_is_written_by_horner(seed: int) -> None:
    """Of degree n in one variable: n products, and the value that NumPy gives."""
    random = np.random.default_rng(seed)
    degree = int(random.integers(2, 7))
    p, x = ca.SX.sym("p", degree + 1), ca.SX.sym("x")
    power, result = ca.SX(1), ca.SX(0)
    for k in range(degree + 1):
        result += p[k] * power
        power = power * x
    collected = collect_terms(function(result, p, x), EARLY)
    numbers, at = random.normal(size=degree + 1), float(random.normal())
    assert late_products(collected) == degree
    assert float(collected(numbers, at)) == pytest.approx(np.polynomial.polynomial.polyval(at, numbers))


def test_a_difference_keeps_its_digits() -> None:
    """Of two large numbers that are nearly equal; multiplied out, it would have lost them."""
    p, x = ca.SX.sym("p"), ca.SX.sym("x", 2)
    collected = collect_terms(function(p * (x[0] - x[1]), p, x), EARLY)
    assert float(collected(0.1, [5e6 + 2**-20, 5e6])) == 0.1 * 2**-20


@pytest.mark.parametrize("seed", seeds(6, 30))
def test_drawn_sums_of_products_and_quotients_keep_their_value(seed: int) -> None:
    """A product of coefficients was another one's where its place in memory had been that of a quotient."""
    random = np.random.default_rng(seed)
    p, x = ca.SX.sym("p", 12), ca.SX.sym("x", 12)
    numbers, at = random.uniform(0.5, 2.0, 12), random.uniform(0.5, 2.0, 12)
    forms = [
        lambda a, b, y, z: a * y / b,  # noqa: ARG005
        lambda a, b, y, z: y / (a * b),  # noqa: ARG005
        lambda a, b, y, z: (a * y) * (1 / b) * z,
        lambda a, b, y, z: -(a * y) / b,  # noqa: ARG005
        lambda a, b, y, z: (a * y + b * z) * y / a,
    ]
    made, expected = ca.SX(0), 0.0
    for _ in range(60):
        form, (i, j, k, m) = forms[random.integers(len(forms))], random.integers(12, size=4)
        made += form(p[i], p[j], x[k], x[m])
        expected += form(numbers[i], numbers[j], at[k], at[m])
    assert float(collect_terms(function(made, p, x), EARLY)(numbers, at)) == pytest.approx(expected, rel=1e-12)
