from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.physics import wind
from shipid.vessel.load import load_vessel


def numbers(expression: Any) -> np.ndarray:
    return np.array(ca.evalf(ca.densify(expression))).ravel()


def parameters(name: str, rho_a: float) -> dict[str, Any]:
    block = load_vessel(name).document["wind"]
    return {key: value for key, value in block.items() if key not in ("kind", "source")} | {"rho_a": rho_a}


AT_REST = ca.SX(6, 1)


def test_beam_wind_on_the_28_9_m_ship() -> None:
    """15 m/s on the beam: Y = 20.2 kN, N = 29.8 kN m, digits printed with the parameters."""
    from_port = wind.wind_table_wrench(
        AT_REST, ca.SX(0), ca.SX(15.0), ca.SX(np.pi / 2), **parameters("gunnerus-28.9", 1.23)
    )
    wrench = numbers(from_port)
    assert wrench[1] == pytest.approx(20.2e3, abs=50)
    assert wrench[5] == pytest.approx(29.8e3, abs=50)
    from_starboard = wind.wind_table_wrench(
        AT_REST, ca.SX(0), ca.SX(15.0), ca.SX(-np.pi / 2), **parameters("gunnerus-28.9", 1.23)
    )
    np.testing.assert_allclose(numbers(from_starboard)[[1, 5]], -wrench[[1, 5]])


def test_relative_wind_follows_the_method() -> None:
    """Method eqs. (6)-(9), re-computed."""
    u, v, psi, V_w, beta_w = 3.0, -0.4, 0.6, 5.0, 2.2
    square, gamma = wind.relative_wind(ca.SX(ca.DM([u, v, 0, 0, 0, 0.1])), ca.SX(psi), ca.SX(V_w), ca.SX(beta_w))
    u_rw, v_rw = u - V_w * np.cos(beta_w - psi), v - V_w * np.sin(beta_w - psi)
    assert float(square) == pytest.approx(u_rw**2 + v_rw**2)
    assert float(gamma) == pytest.approx(-np.arctan2(v_rw, u_rw))


def test_interpolation_is_piecewise_linear_and_flat_beyond() -> None:
    grid, values = [0.0, 1.0, 3.0, 4.0], [2.0, -1.0, 5.0, 5.5]
    x = np.linspace(-1, 5, 61)
    computed = [float(wind.interpolate_ramps(ca.SX(at), ca.SX(ca.DM(grid)), ca.SX(ca.DM(values)))) for at in x]
    np.testing.assert_allclose(computed, np.interp(x, grid, values), atol=1e-14)


@pytest.mark.parametrize("gamma_deg", [0, 30, 75, 90, 120, 180])
def test_blendermann_by_hand(gamma_deg: float) -> None:
    """Blendermann (1994) for the 33.9 m ship, written out from the printed formula."""
    gamma, V_w, rho_a = np.radians(gamma_deg), 10.0, 1.224
    C_Dt, delta, kappa, A_F, A_L, L, s_L, s_H = 0.85, 0.60, 1.4, 85.0, 210.0, 36.25, 2.0, 3.5
    C_Dl_AF = 0.55 if gamma_deg <= 90 else 0.65
    C_Dl = C_Dl_AF * A_F / A_L
    den = 1 - delta / 2 * (1 - C_Dl / C_Dt) * np.sin(2 * gamma) ** 2
    q = 0.5 * rho_a * V_w**2
    C_Y = C_Dt * np.sin(gamma) / den
    X = q * A_F * (-C_Dl_AF * np.cos(gamma) / den)
    N = q * A_L * L * (s_L / L - 0.18 * (gamma - np.pi / 2)) * C_Y
    K = q * A_L * (A_L / L) * kappa * s_H / (A_L / L) * C_Y
    towards = ca.SX(np.pi - gamma)  # from gamma off the port bow
    forces = numbers(
        wind.blendermann_wrench(AT_REST, ca.SX(0), ca.SX(V_w), towards, **parameters("gunnerus-33.9", rho_a))
    )
    np.testing.assert_allclose(forces, [X, q * A_L * C_Y, 0, K, 0, N], rtol=1e-9, atol=1e-6)
