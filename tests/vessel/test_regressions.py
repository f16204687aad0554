"""Regressions against published ships and screws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import elliprd

from shipid.vessel.regressions import (
    form_factor,
    ittc_friction,
    motora_added_mass,
    mumford_surface,
    series_thrust_coefficient,
    wave_resistance_of_hull,
)

KVLCC2 = (320.0, 58.0, 20.8, 0.81)
KCS = (230.0, 32.2, 10.8, 0.651)


def test_friction_is_the_ittc_line() -> None:
    """Re 7.2e6: the 7 m model of KVLCC2, see models/kvlcc2-l7.toml; Re 1e9: 1.53e-3 (ITTC 1957, table)."""
    assert ittc_friction(1.0, 1e9, 1.0) == pytest.approx(1.53e-3, rel=0.005)
    assert ittc_friction(1.0, 1e7, 1.0) == pytest.approx(3.0e-3, rel=0.005)


def test_surface_and_form_of_published_ships() -> None:
    """SIMMAN: 27,194 m^2 of KVLCC2, 9,539 m^2 of KCS; k of KVLCC2 about 0.2 to 0.3, of KCS 0.1."""
    assert mumford_surface(*KVLCC2) == pytest.approx(27194, rel=0.05)
    assert mumford_surface(*KCS) == pytest.approx(9539, rel=0.05)
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
    surge, sway, gyration = motora_added_mass(*sizes)
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
    surge, sway, gyration = motora_added_mass(1.0, 2 * b, c, np.pi / 6)
    assert surge == pytest.approx(alpha / (2 - alpha), rel=0.4)
    assert 1.0 < sway / (beta / (2 - beta)) < 1.6  # a ship's sides are flatter
    assert gyration == pytest.approx(np.sqrt(far / 5), rel=0.35)


def test_wave_resistance_of_the_worked_example() -> None:
    """The example of Holtrop and Mennen (1982): 557.11 kN at 25 knots, with c_2 of a bulb and c_5 of a transom."""
    weight = 37500 * 1025 * 9.81
    over = wave_resistance_of_hull(
        205.0, 32.0, 10.0, volume=37500.0, C_P=0.5833, entrance=12.08, speed=25 * 1852 / 3600
    )
    assert over * weight * 0.7595 * 0.9592 == pytest.approx(557.11e3, rel=2e-3)


def test_the_series_is_near_the_screw_of_kvlcc2() -> None:
    """P / D = 0.721: K_T = 0.2931 - 0.2753 J - 0.1385 J^2 (Yasukawa and Yoshimura 2015), another area ratio."""
    J = np.linspace(0, 0.6, 7)
    assert series_thrust_coefficient(J, 0.721) == pytest.approx(0.2931 - 0.2753 * J - 0.1385 * J**2, abs=0.025)


# Oosterveld and van Oossanen (1975), table 5, as printed: c, and powers of J, P / D, A_E / A_O, Z
TABLE_5 = (
    (0.00880496, 0, 0, 0, 0), (-0.204554, 1, 0, 0, 0), (0.166351, 0, 1, 0, 0), (0.158114, 0, 2, 0, 0),
    (-0.147581, 2, 0, 1, 0), (-0.481497, 1, 1, 1, 0), (0.415437, 0, 2, 1, 0), (0.0144043, 0, 0, 0, 1),
    (-0.0530054, 2, 0, 0, 1), (0.0143481, 0, 1, 0, 1), (0.0606826, 1, 1, 0, 1), (-0.0125894, 0, 0, 1, 1),
    (0.0109689, 1, 0, 1, 1), (-0.133698, 0, 3, 0, 0), (0.00638407, 0, 6, 0, 0), (-0.00132718, 2, 6, 0, 0),
    (0.168496, 3, 0, 1, 0), (-0.0507214, 0, 0, 2, 0), (0.0854559, 2, 0, 2, 0), (-0.0504475, 3, 0, 2, 0),
    (0.010465, 1, 6, 2, 0), (-0.00648272, 2, 6, 2, 0), (-0.00841728, 0, 3, 0, 1), (0.0168424, 1, 3, 0, 1),
    (-0.00102296, 3, 3, 0, 1), (-0.0317791, 0, 3, 1, 1), (0.018604, 1, 0, 2, 1), (-0.00410798, 0, 2, 2, 1),
    (-0.000606848, 0, 0, 0, 2), (-0.0049819, 1, 0, 0, 2), (0.0025983, 2, 0, 0, 2), (-0.000560528, 3, 0, 0, 2),
    (-0.00163652, 1, 2, 0, 2), (-0.000328787, 1, 6, 0, 2), (0.000116502, 2, 6, 0, 2), (0.000690904, 0, 0, 1, 2),
    (0.00421749, 0, 3, 1, 2), (0.0000565229, 3, 6, 1, 2), (-0.00146564, 0, 3, 2, 2),
)  # fmt: skip


@pytest.mark.parametrize("pitch", [0.5, 1.4])
def test_the_series_is_the_published_table(pitch: float) -> None:
    """Four blades, area ratio 0.55."""
    J = np.linspace(0, 1.4, 8)
    K_T = sum(c * J**s * pitch**t * 0.55**u * 4.0**v for c, s, t, u, v in TABLE_5)
    assert series_thrust_coefficient(J, pitch) == pytest.approx(K_T, abs=1e-8)
