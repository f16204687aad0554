"""Regressions against published ships and screws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import elliprd

from shipid.vessel.regressions import (
    K_T_TERMS,
    correlation_allowance,
    form_factor,
    friction,
    motora,
    thrust_coefficient,
    thrust_polynomial,
    wave_resistance,
    waves_of,
    wetted_surface,
)

KVLCC2 = (320.0, 58.0, 20.8, 0.81)
KCS = (230.0, 32.2, 10.8, 0.651)
LIMITS = {  # of a part of wave resistance, and L, B, T, C_b there
    "B / L = 0.11": (120.0, 13.2, 6.0, 0.6),
    "B / L = 0.25": (40.0, 10.0, 4.0, 0.55),
    "L / B = 12": (120.0, 10.0, 4.0, 0.5),
    "L^3 / volume = 512": (120.0, 120.0**2 / (512 * 2.0), 4.0, 0.5),
    "L^3 / volume = 1727": (120.0, 120.0**2 / (1727 * 0.9), 2.0, 0.45),
}


def test_friction_is_the_ittc_line() -> None:
    """Re 7.2e6: the 7 m model of KVLCC2, see models/kvlcc2-l7.toml; Re 1e9: 1.53e-3 (ITTC 1957, table)."""
    assert friction(1.0, 1e9, 1.0) == pytest.approx(1.53e-3, rel=0.005)
    assert friction(1.0, 1e7, 1.0) == pytest.approx(3.0e-3, rel=0.005)


def test_surface_and_form_of_published_ships() -> None:
    """SIMMAN: 27,194 m^2 of KVLCC2, 9,539 m^2 of KCS; k of KVLCC2 about 0.2 to 0.3, of KCS 0.1."""
    assert wetted_surface(*KVLCC2) == pytest.approx(27194, rel=0.05)
    assert wetted_surface(*KCS) == pytest.approx(9539, rel=0.05)
    assert 0.15 < form_factor(*KVLCC2) < 0.35
    assert 0.05 < form_factor(*KCS) < 0.15


@pytest.mark.parametrize(
    ("sizes", "m_x", "m_y", "J_z"),
    [
        (KVLCC2, 0.022 / 0.2936, 0.223 / 0.2936, 0.011 / 0.2936),
        ((175.0, 25.4, 8.5, 0.559), 0.000238 / 0.00792, 0.007049 / 0.00792, 0.000419 / 0.00792),
    ],
    ids=["KVLCC2", "S-175"],
)
def test_added_masses_of_published_ships(
    sizes: tuple[float, float, float, float], m_x: float, m_y: float, J_z: float
) -> None:
    """Over the mass, J_z over m L^2 too: Yasukawa and Yoshimura (2015), table 3; Son and Nomoto (1982)."""
    surge, sway, gyration = motora(*sizes)
    assert surge == pytest.approx(m_x, rel=0.15)
    assert sway == pytest.approx(m_y, rel=0.05)
    assert (gyration / sizes[0]) ** 2 == pytest.approx(J_z, rel=0.12)


@pytest.mark.parametrize("ratio", [2.0, 2.5, 3.0])
def test_added_masses_of_a_beamy_ship_are_near_those_of_an_ellipsoid(ratio: float) -> None:
    """The submerged half of an ellipsoid has those of the whole one, exactly (Lamb 1932, articles 114 and 373)."""
    a, b, c = 0.5, 0.5 / ratio, 0.4 / ratio  # half length, half beam, draught
    alpha, beta = (
        2 / 3 * a * b * c * elliprd(*others, axis) for axis, others in ((a**2, (b**2, c**2)), (b**2, (a**2, c**2)))
    )
    far = (a**2 - b**2) ** 2 * (beta - alpha) / (2 * (a**2 - b**2) + (a**2 + b**2) * (alpha - beta))
    surge, sway, gyration = motora(1.0, 2 * b, c, np.pi / 6)
    assert surge == pytest.approx(alpha / (2 - alpha), rel=0.4)
    assert 1.0 < sway / (beta / (2 - beta)) < 1.6  # a ship's sides are flatter
    assert gyration == pytest.approx(np.sqrt(far / 5), rel=0.35)


def test_waves_matter_for_a_fast_ship_alone() -> None:
    """Over dynamic pressure and surface: KCS at 24 kn has about 1e-3, a tanker at 15.5 kn hardly any."""

    def C_W(sizes: tuple[float, float, float, float], speed: float) -> float:
        L, B, T, C_b = sizes
        weight = 9.81 * C_b * L * B * T
        return wave_resistance(*sizes, speed) * weight / (0.5 * speed**2 * wetted_surface(*sizes))

    assert C_W(KVLCC2, 7.97) < 2e-4
    assert 3e-4 < C_W(KCS, 12.35) < 2e-3
    rising = [wave_resistance(*KCS, speed) for speed in (6.0, 8.0, 10.0, 12.0, 14.0)]
    assert np.all(np.diff(rising) > 0)


def test_wave_resistance_of_the_worked_example() -> None:
    """The example of Holtrop and Mennen (1982): 557.11 kN at 25 knots, with c_2 of a bulb and c_5 of a transom."""
    weight = 37500 * 1025 * 9.81
    over = waves_of(205.0, 32.0, 10.0, volume=37500.0, C_P=0.5833, entrance=12.08, speed=25 * 1852 / 3600)
    assert over * weight * 0.7595 * 0.9592 == pytest.approx(557.11e3, rel=2e-3)


@pytest.mark.parametrize("limit", LIMITS)
@pytest.mark.parametrize("froude", [0.2, 0.3, 0.4])
def test_the_parts_of_wave_resistance_meet(limit: str, froude: float) -> None:
    """Holtrop and Mennen give other formulae for slender and for full ships: none jumps at its limit."""
    L, B, T, C_b = LIMITS[limit]
    speed = froude * (9.81 * L) ** 0.5
    narrow, wide = (wave_resistance(L, B * factor, T, C_b, speed) for factor in (1 - 1e-6, 1 + 1e-6))
    assert wide == pytest.approx(narrow, rel=2e-3)


def test_allowance_falls_with_length() -> None:
    assert 0 < correlation_allowance(320.0) < correlation_allowance(100.0) < 1e-3


def test_the_series_is_near_the_screw_of_kvlcc2() -> None:
    """P / D = 0.721: K_T = 0.2931 - 0.2753 J - 0.1385 J^2 (Yasukawa and Yoshimura 2015), another area ratio."""
    J = np.linspace(0, 0.6, 7)
    assert thrust_coefficient(J, 0.721) == pytest.approx(0.2931 - 0.2753 * J - 0.1385 * J**2, abs=0.025)


def test_the_table_of_the_series_adds_up() -> None:
    """Sums over the printed table, compared with it term by term once: small terms hide in the tests above."""
    c, *powers = np.array(K_T_TERMS).T
    assert len(c) == 39
    assert np.abs(c).sum() == pytest.approx(2.3598490919, rel=1e-9)
    assert c @ (powers[0] + 10 * powers[1] + 100 * powers[2] + 1000 * powers[3]) == pytest.approx(
        18.3911023657, rel=1e-9
    )


@pytest.mark.parametrize("pitch", [0.4, 0.8, 1.0, 1.2, 1.5])
def test_a_parabola_holds_the_series_where_it_pushes(pitch: float) -> None:
    J = np.linspace(0, 0.9 * pitch, 20)
    k_0, k_1, k_2 = thrust_polynomial(pitch)
    assert k_0 + k_1 * J + k_2 * J**2 == pytest.approx(thrust_coefficient(J, pitch), abs=0.015)
    assert k_0 > 0 > k_1
