from __future__ import annotations

import casadi as ca
import pytest

from shipid.physics.grammar import (
    ADDED_MASS,
    DERIVATIVES,
    THRUST,
    acceleration_unit,
    derivative_unit,
    hull_derivative,
    prime_scale,
    thrust_monomial,
)

U, V, P, R = 3.0, -0.5, 0.02, -0.1
MOTIONS = {"u": ca.SX(U), "v": ca.SX(V), "w": ca.SX(0.1), "p": ca.SX(P), "q": ca.SX(0.03), "r": ca.SX(R)}


@pytest.mark.parametrize(
    ("name", "value", "order", "unit"),
    [
        ("X_u|u|", U * abs(U), 2, "kg m^-1"),
        ("X_uu", U * U, 2, "kg m^-1"),
        ("Y_v", V, 1, "kg s^-1"),
        ("Y_r", R, 1, "kg m s^-1"),
        ("N_r", R, 1, "kg m^2 s^-1"),
        ("N_ur", U * R, 2, "kg m"),
        ("X_rr", R * R, 2, "kg m"),
        ("N_|v|v", abs(V) * V, 2, "kg"),
        ("Y_vvr", V * V * R, 3, "kg m^-1 s"),
        ("Y_|r|v", abs(R) * V, 2, "kg"),
        ("Y_v|r|", V * abs(R), 2, "kg"),
        ("N_rrr", R**3, 3, "kg m^2 s"),
        ("X_vvvv", V**4, 4, "kg m^-3 s^2"),
        ("K_p|p|", P * abs(P), 2, "kg m^2"),
        ("X_u|v|", U * abs(V), 2, "kg m^-1"),
    ],
)
def test_a_name_is_its_formula(name: str, value: float, order: int, unit: str) -> None:
    formula = hull_derivative(name)
    assert float(formula.value(MOTIONS)) == pytest.approx(value, rel=1e-15)
    assert (formula.order, formula.axis, derivative_unit(name)) == (order, name[0], unit)


@pytest.mark.parametrize(
    ("first", "second"),
    [("Y_rv", "Y_vr"), ("Y_v|v|", "Y_|v|v"), ("X_|v||v|", "X_vv"), ("Y_u|r||r|", "Y_rur"), ("N_|v|r|v|", "N_vvr")],
)
@pytest.mark.parametrize("turned", [False, True])
def test_two_names_of_one_monomial_are_refused(first: str, second: str, turned: bool) -> None:
    names = [second, first] if turned else [first, second]
    with pytest.raises(ValueError, match="same monomial") as caught:
        DERIVATIVES.check(["X_uu", *names, "N_r"])
    assert repr(first) in str(caught.value)
    assert repr(second) in str(caught.value)


@pytest.mark.parametrize(
    ("name", "unit"),
    [("X_udot", "kg"), ("Y_rdot", "kg m"), ("N_vdot", "kg m"), ("N_rdot", "kg m^2"), ("K_pdot", "kg m^2")],
)
def test_added_mass_units(name: str, unit: str) -> None:
    ADDED_MASS.check([name])
    assert acceleration_unit(name) == ADDED_MASS.unit(name) == unit


@pytest.mark.parametrize(("name", "value"), [("1", 1.0), ("J", 0.4), ("Jyy", 0.4 * 0.09), ("y|y|", -0.09), ("Jt", 0.2)])
def test_thruster_coefficients(name: str, value: float) -> None:
    symbols = {"J": ca.SX(0.4), "y": ca.SX(-0.3), "t": ca.SX(0.5)}
    assert float(thrust_monomial(name).value(symbols)) == pytest.approx(value, rel=1e-15)
    assert THRUST.unit(name) == "-"


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Y_v", 0.5 * 1000 * 20**2 * 4),  # 1/2 rho L^2 U
        ("Y_r", 0.5 * 1000 * 20**3 * 4),
        ("N_v", 0.5 * 1000 * 20**3 * 4),
        ("N_r", 0.5 * 1000 * 20**4 * 4),
        ("X_uu", 0.5 * 1000 * 20**2),
        ("N_ur", 0.5 * 1000 * 20**4),
        ("Y_vvr", 0.5 * 1000 * 20**3 / 4),
        ("N_rrr", 0.5 * 1000 * 20**6 / 4),
    ],
)
def test_prime_scale(name: str, expected: float) -> None:
    assert float(prime_scale(name, ca.SX(1000.0), ca.SX(20.0), ca.SX(4.0))) == pytest.approx(expected, rel=1e-14)
