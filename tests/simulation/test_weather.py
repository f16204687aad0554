"""The sea: its spectrum, its draws, its directions, and the loads that a table gives in it."""

from __future__ import annotations

from math import gamma
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.simulation.weather import (
    Gusts,
    Sea,
    _bin_variances,
    draw_components,
    gust_series,
    gust_spectrum,
    heading_series,
    interpolate_lagrange,
    jonswap_spectrum,
    spread_angles,
    wave_loads,
)
from shipid.units import GRAVITY
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.drawn import seeds
from tests.simulation.linear import MIRROR, all_round, heading_weights, lagrange, linear

SHIP = load_vessel("gunnerus-28.9-6dof")
HULLS = {"gunnerus-28.9-6dof": "gunnerus_289.npz", "gunnerus-33.9-6dof": "gunnerus_339.npz"}
SEA = Sea(H_s=1.0, T_p=5.0)


def draw(sea: Sea = SEA, direction: float = 0.7, count: int = 3) -> dict[str, np.ndarray]:
    return draw_components(sea, np.full(count, direction), list(range(count)))


@pytest.mark.parametrize(("H_s", "T_p", "gamma"), [(1.0, 5.0, 3.3), (0.5, 4.0, 1.0), (3.0, 9.0, 7.0)])
def test_spectrum_has_its_height_and_its_peak(H_s: float, T_p: float, gamma: float) -> None:
    sea, peak = Sea(H_s=H_s, T_p=T_p, gamma=gamma), 2 * np.pi / T_p
    omega = np.linspace(0.3 * peak, 15 * peak, 60001)
    S = jonswap_spectrum(omega, sea)
    assert np.trapezoid(S, omega) == pytest.approx(H_s**2 / 16, rel=2e-3)
    assert omega[S.argmax()] == pytest.approx(peak, rel=1e-3)


def test_elevation_has_the_standard_deviation_of_the_sea_and_does_not_repeat() -> None:
    """An hour at one place: H_s / 4; and equal bins would repeat after 2 pi / width."""
    drawn = draw(count=1)
    time = np.arange(0, 3600, 0.25)
    wave = np.exp(1j * (np.outer(time, drawn["omega"][0]) + drawn["epsilon"][0])) @ drawn["amplitude"][0]
    assert wave.real.std() == pytest.approx(SEA.H_s / 4, rel=0.02)
    period = round(2 * np.pi / (np.diff(SEA.range)[0] / SEA.components) / 0.25)
    assert abs(np.corrcoef(wave.real[:-period], wave.real[period:])[0, 1]) < 0.5


def test_draws_of_a_sample_depend_on_its_name_alone() -> None:
    """Not on their number, nor on the row, nor on the direction."""
    few = draw_components(SEA, np.array([0.1, 0.2]), ["a", "b"])
    many = draw_components(SEA, np.array([0.3, 0.2, 2.0, 0.1]), ["c", "b", "d", "a"])
    for name in ("omega", "epsilon", "amplitude", "chi"):
        np.testing.assert_array_equal(few[name], many[name][[3, 1]])
    assert not np.isin(many["epsilon"][0], many["epsilon"][2]).any()
    np.testing.assert_array_equal(few["chi"], np.repeat([[0.1], [0.2]], SEA.components, axis=1))


@pytest.mark.parametrize("s", [1, 4, 25])
def test_directions_follow_cos_2s(s: int) -> None:
    """Mean direction and variance of the law within +-90 deg, by quadrature."""
    sea = Sea(H_s=1.0, T_p=5.0, spreading=s)
    apart = (draw(sea, direction=2.0, count=200)["chi"] - 2.0).ravel()
    angle = np.linspace(-np.pi / 2, np.pi / 2, 4001)
    density = np.cos(angle) ** (2 * s)
    width = np.sqrt(np.trapezoid(density * angle**2, angle) / np.trapezoid(density, angle))
    assert abs(apart.mean()) < 4 * width / np.sqrt(len(apart))
    assert apart.std() == pytest.approx(width, rel=0.03)
    np.testing.assert_allclose(spread_angles(s, np.array([0.0, 0.5, 1.0])), [-np.pi / 2, 0, np.pi / 2], atol=1e-9)


@pytest.mark.parametrize(
    "wrong", [{"H_s": -1.0}, {"T_p": 0.0}, {"gamma": 0.5}, {"components": 0}, {"spreading": 0}, {"height": 1.0}]
)
def test_impossible_seas_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(DocumentError):
        Sea(**{"H_s": 1.0, "T_p": 5.0, **wrong})


def test_fourier_series_pass_through_the_table() -> None:
    """Every heading of the table, both sides; and a series of fewer harmonics is the nearest in the mean square."""
    columns = {name: np.array(values) for name, values in SHIP.document["waves"]["first_order"]["table"].items()}
    for axis, side in (("Z", 1), ("K", -1)):
        values = columns[f"{axis}_real"] + 1j * columns[f"{axis}_imag"]
        series = heading_series(columns, values, side, 12)
        beta, m = np.radians(columns["beta_deg"]), np.arange(13)
        rows = np.searchsorted(np.unique(columns["omega"]), columns["omega"])
        for sign in (1, -1):
            basis = np.cos(np.outer(beta, m)) if side > 0 else np.sin(sign * np.outer(beta, m))
            summed, expected = (series[rows] * basis).sum(axis=1), values if side > 0 else sign * values
            # a sine series is zero at 0 and 180 deg, where the table holds rounding of the mesh
            np.testing.assert_allclose(summed, expected, rtol=0, atol=1e-3 * np.abs(values).max())
        np.testing.assert_array_equal(heading_series(columns, values, side, 6), series[:, :7])


def test_interpolation_is_exact_for_cubics_and_ends_with_the_table() -> None:
    grid = np.array([0.3, 0.4, 0.6, 0.7, 1.0, 1.4])
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0])
    inside = np.linspace(0.3, 1.4, 23)
    np.testing.assert_allclose(
        interpolate_lagrange(inside, grid, cubic(grid)[:, None])[:, 0], cubic(inside), rtol=1e-10
    )
    np.testing.assert_allclose(
        interpolate_lagrange(np.array([0.1, 1.5]), grid, cubic(grid)[:, None])[:, 0], [cubic(0.3), 0]
    )


def simulated_loads(vessel: Vessel, drawn: dict[str, np.ndarray], t: float, pose: np.ndarray) -> dict[str, np.ndarray]:
    """Wrench (6) of each wave term of sample 0, by the functions that every engine runs."""
    model, loads = vessel_dynamics(vessel), wave_loads(vessel, drawn)
    state = dict.fromkeys((*model.state, *model.hidden), 0.0)
    state |= dict(zip(("north", "east", "psi"), pose, strict=True)) | {"waves.first_order.t": t}
    rest = [0.0] * len(model.memory), [0.0] * len(model.commands), [0.0] * len(model.environment)
    by_term = {}
    for term in model.drawn:
        one = [
            term.function([*state.values()], *rest, [*vessel.parameters.values()], row) for row in loads[term.path][0]
        ]
        by_term[term.path] = np.array(sum(one)).ravel()
    return by_term


@pytest.mark.parametrize("spreading", [None, 4])
@pytest.mark.parametrize("seed", seeds(1, 3))
def test_loads_are_those_of_the_table(seed: int, spreading: int | None) -> None:
    """Summed over components against the Dirichlet kernel over 24 headings, anywhere, at any time."""
    t, *pose = np.random.default_rng(seed).uniform([0, -200, -200, -4], [1000, 200, 200, 4])
    drawn = draw(Sea(H_s=1.0, T_p=6.0, components=20, spreading=spreading), direction=2.0, count=1)
    omega, amplitude, epsilon, chi = (drawn[name][0] for name in ("omega", "amplitude", "epsilon", "chi"))
    weights, ship = heading_weights(chi - pose[2], 24), linear(SHIP)
    transfer = np.einsum("kb,kbj->kj", weights, lagrange(omega, *ship.table))
    phase = omega * t - omega**2 / GRAVITY * (pose[0] * np.cos(chi) + pose[1] * np.sin(chi)) + epsilon
    expected = (transfer * (amplitude * np.exp(1j * phase))[:, None]).sum(axis=0).real
    loads = simulated_loads(SHIP, drawn, t, np.array(pose))
    scale = np.sqrt((np.abs(transfer * amplitude[:, None]) ** 2).sum(axis=0))
    assert (np.abs(loads["waves.first_order"] - expected) < 1e-3 * scale).all()

    columns = {name: np.array(values) for name, values in SHIP.document["waves"]["drift"]["table"].items()}
    half = np.stack([columns[f"{axis}_drift"] for axis in "XYN"], axis=-1).reshape(len(ship.table[0]), -1, 3)
    table = lagrange(omega, ship.table[0], all_round(half, np.array([1, -1, -1])))
    mean = np.einsum("k,kb,kbj->j", amplitude**2, weights, table)
    np.testing.assert_allclose(loads["waves.drift"][[0, 1, 5]], mean, rtol=0, atol=2e-3 * np.abs(mean).max())


@pytest.mark.parametrize("name", list(HULLS))
def test_bundled_tables_are_those_of_the_data_base(name: str, shared_data: Path) -> None:
    """Excitation and drift of the data base, moved from the centre of gravity to the origin: K - z Y, M + z X."""
    source = shared_data.parent / "reference" / "seakeeping" / HULLS[name]
    if not source.is_file():
        pytest.skip(f"no {source.name} beside the recorded data")
    base, ship = np.load(source), linear(load_vessel(name))
    z = float(base["z_CG"])
    F = base["F"].copy()
    F[..., 3] -= z * F[..., 1]
    F[..., 4] += z * F[..., 0]
    omega, table = ship.table
    np.testing.assert_allclose(omega, base["omega"])
    expected = all_round(F, MIRROR)
    assert (np.abs(table - expected) <= 1e-4 * np.abs(expected).max(axis=(0, 1))).all()
    columns = load_vessel(name).document["waves"]["drift"]["table"]
    drift = np.stack([np.reshape(columns[f"{axis}_drift"], base["drift"].shape[:2]) for axis in "XYN"], axis=-1)
    assert (np.abs(drift - base["drift"]) <= 1e-4 * np.abs(base["drift"]).max(axis=(0, 1))).all()


KINDS = {
    "npd": Gusts(kind="npd"),
    "npd, few harmonics": Gusts(kind="npd", height=20.0, harmonics=12, frequencies=(0.005, 1.0)),
}
every_kind = pytest.mark.parametrize("gusts", KINDS.values(), ids=KINDS.keys())


def keys(count: int, seed: int = 1) -> list[tuple[object, ...]]:
    return [(seed, "manoeuvre", number) for number in range(count)]


def test_npd_integrates_to_its_closed_form() -> None:
    """With y = x^n the integral over all f is 320/172 (U/10)^2.75 (z/10)^(0.45-2/3) B(1/n, 5/(3n) - 1/n) / n."""
    n, U, z = 0.468, np.array([4.0, 10.0, 25.0]), 15.0
    beta = gamma(1 / n) * gamma(5 / (3 * n) - 1 / n) / gamma(5 / (3 * n))
    expected = 320 / 172 * (U / 10) ** 2.75 * (z / 10) ** (0.45 - 2 / 3) * beta / n
    everything = Gusts(kind="npd", height=z, frequencies=(1e-9, 1e9), harmonics=500)
    np.testing.assert_allclose(_bin_variances(everything, U).sum(axis=1), expected, rtol=1e-5)


@every_kind
def test_variance_of_a_long_series_is_the_integral(gusts: Gusts) -> None:
    U = np.array([2.0, 8.0, 15.0])
    f = np.geomspace(*gusts.frequencies, 20001)
    density = gust_spectrum(gusts, U[:, None], f)
    integral = ((density[:, 1:] + density[:, :-1]) / 2 * np.diff(f)).sum(axis=1)
    time = np.arange(0.0, 40000.0, 0.9)
    gust = gust_series(gusts, U, time, keys(3))
    np.testing.assert_allclose(gust.var(axis=0), integral, rtol=0.05)
    assert np.all(np.abs(gust.mean(axis=0)) < 0.03 * U)


@every_kind
def test_a_series_depends_on_its_key_alone(gusts: Gusts) -> None:
    time, U = np.arange(200) * 0.5, np.array([1.0, 5.0, 9.0, 5.0])
    four = gust_series(gusts, U, time, keys(4))
    np.testing.assert_array_equal(gust_series(gusts, U, time, keys(4)), four)
    np.testing.assert_array_equal(gust_series(gusts, U[1:2], time, keys(4)[1:2]), four[:, 1:2])
    assert np.abs(four[:, 1] - four[:, 3]).max() > 0.1  # the same wind, another manoeuvre
    assert np.abs(gust_series(gusts, U, time, keys(4, seed=2)) - four).max() > 0.1


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ({"kind": "kaimal"}, "npd"),
        ({"kind": "npd", "frequencies": (0.5, 0.1)}, "low, high"),
        ({"kind": "npd", "frequencies": (0.1, 0.1)}, r"frequencies must be \[low, high\]"),
        ({"kind": "npd", "frequencies": (0.0, 0.1)}, "must be above 0"),
        ({"kind": "npd", "height": -1.0}, "must be above 0"),
        ({"kind": "npd", "gustiness": 1.0}, "unknown key"),
    ],
)
def test_wrong_blocks_are_refused(block: dict[str, Any], message: str) -> None:
    with pytest.raises(DocumentError, match=message):
        Gusts(**block)
