"""Angles that wrap, and angles from true north far from the origin, where meridians are not parallel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pymap3d import geodetic2ned, ned2geodetic

from shipid.data.dataset import Dataset, read_dataset, write_dataset
from shipid.errors import DataError
from shipid.logs.frames import PARALLEL, meridian_convergence, unwrap_in_place
from tests.drawn import seeds
from tests.logs.conftest import import_written, turning

T = np.arange(0.0, 60.0, 0.5)
SPEEDS = {
    "body": 'u = { from = "u", unit = "m/s" }\nv = { from = "v", unit = "m/s" }\n',
    "earth": 'u = { from = "vn", unit = "m/s", frame = "earth" }\nv = { from = "ve", unit = "m/s", frame = "earth" }\n',
    "ground": 'speed = { from = "sog", unit = "m/s" }\ncourse = { from = "cog", unit = "deg", wrap = true }\n',
}
WINDS = {
    "true": '{ from = "twd", unit = "deg", wrap = true, direction = "from" }',
    "bow": '{ from = "twa", unit = "deg", wrap = true, direction = "from", relative = "angle" }',
}
MAPPING = """
name = "m"
[clock]
from = "t"
unit = "s"
max_gap = 3
[columns]
latitude = { from = "lat", unit = "deg" }
longitude = { from = "lon", unit = "deg" }
psi = { from = "psi", unit = "deg", wrap = true }
r = { from = "r", unit = "rad/s" }
V_w = { from = "tws", unit = "m/s" }
"""


def test_angles_are_unwrapped_as_numpy_does() -> None:
    random = np.random.default_rng(0)
    turns = np.cumsum(random.normal(0.0, 1.5, 500))
    for values in (
        turns % (2 * np.pi),
        np.angle(np.exp(1j * turns)),
        np.pi * random.integers(-3, 4, 500).astype(float),
    ):
        expected = np.unwrap(values)
        unwrap_in_place(values)
        np.testing.assert_allclose(values, expected, atol=1e-9)


def bearing(way: Any, psi: Any, place: tuple[float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Latitude and longitude [deg] of points (N,), north + i east [m] in the plane at a place, and true heading [rad].

    The heading is that of psi (N,) [rad]: the direction, in the plane at the point, to another one 10 m ahead.
    """
    here, ahead = (ned2geodetic(z.real, z.imag, 0.0, *place, 0.0)[:2] for z in (way, way + 10.0 * np.exp(1j * psi)))
    north, east, _ = geodetic2ned(*ahead, 0.0, *here, 0.0)
    return np.asarray(here[0]), np.asarray(here[1]), np.asarray(np.arctan2(east, north))


def away(place: tuple[float, float], distance: float, towards: float) -> tuple[float, float]:
    lat, lon, _ = ned2geodetic(distance * np.cos(towards), distance * np.sin(towards), 0.0, *place, 0.0)
    return float(lat), float(lon)


def recorded(place: tuple[float, float], u: float = 4.0, begin: float = 0.0) -> pd.DataFrame:
    """A steady turn at a place as a bridge logs it; the wind comes from 50 deg on the bow all the time."""
    motion = turning(T, u=u)
    lat, lon, true = bearing((motion["north"] + 1j * motion["east"]).to_numpy(), motion["psi"].to_numpy(), place)
    ground = u + 1j * motion["v"].to_numpy()
    velocity = ground * np.exp(1j * true)
    log = motion.assign(t=T + begin, lat=lat, lon=lon, psi=np.degrees(true) % 360.0, sog=np.abs(ground))
    log = log.assign(cog=np.degrees(true + np.angle(ground)) % 360.0, vn=velocity.real, ve=velocity.imag)
    return log.assign(tws=9.0, twd=(log["psi"] + 50.0) % 360.0, twa=50.0).drop(columns=["north", "east", "port.n"])


def imported(log: pd.DataFrame, folder: Path, speeds: str = "body", wind: str = "true", more: str = "") -> Dataset:
    return import_written(f"{MAPPING}beta_w = {WINDS[wind]}\n{SPEEDS[speeds]}{more}", log, folder)


def origin(place: tuple[float, float]) -> str:
    return f"[origin]\nlatitude = {place[0]!r}\nlongitude = {(place[1] + 180.0) % 360.0 - 180.0!r}\n"


def told(dataset: Dataset) -> list[str]:
    return [f"{one['column']}: {one['note']}" for one in dataset.metadata["repairs"] if one["kind"] == "turned"]


@pytest.mark.parametrize("seed", seeds(4, 5))
@pytest.mark.parametrize("name", ["psi", "twd"])
def test_an_angle_in_tenths_of_a_degree_is_refused(seed: int, name: str, tmp_path: Path) -> None:
    """A wind direction was read ten times too large, without a word."""
    random = np.random.default_rng(seed)
    log = recorded((60.0, 5.0)).assign(twd=random.uniform(60.0, 300.0) + random.normal(0.0, 5.0, len(T)))
    imported(log, tmp_path)
    log.loc[::9, name] = np.nan
    with pytest.raises(DataError, match=f"'{name}' begins with .* deg, more than a turn: is the unit right"):
        imported(log.assign(**{name: 10.0 * log[name]}), tmp_path)


@pytest.mark.parametrize("seed", seeds(3, 5))
def test_true_north_is_seen_in_the_plane_where_a_step_to_the_north_leads(seed: int) -> None:
    """Also over the date line and about a pole; a plane is a picture of the Earth but for (distance / radius)^2."""
    random = np.random.default_rng(seed)
    latitude = random.choice([random.uniform(0.0, 85.0), 89.99]) * random.choice([-1.0, 1.0])
    place = float(latitude), float(random.uniform(170.0, 190.0))
    way = random.uniform(0.0, 1e5, 50) * np.exp(1j * random.uniform(-np.pi, np.pi, 50))
    lat, lon, true = bearing(way, random.uniform(-np.pi, np.pi, 50), place)
    ahead = ned2geodetic(10.0 * np.cos(true), 10.0 * np.sin(true), 0.0, lat, lon, 0.0)[:2]
    steps = [geodetic2ned(*one, 0.0, *place, 0.0) for one in ((lat, lon), ahead)]
    seen = np.arctan2(steps[1][1] - steps[0][1], steps[1][0] - steps[0][0])
    lon %= 360.0
    off = np.angle(np.exp(1j * (seen - true - meridian_convergence(lat, lon, *place))))
    np.testing.assert_allclose(off, 0.0, atol=(1e5 / 6.37e6) ** 2)
    assert meridian_convergence(*place, *place) == 0.0


@pytest.mark.parametrize(("speeds", "wind"), [("body", "true"), ("earth", "bow"), ("ground", "true")])
def test_far_from_the_origin_a_ship_moves_as_near_it(speeds: str, wind: str, tmp_path: Path) -> None:
    """Its path is that of its velocities along its heading, and the wind is where it was from the bow."""
    random = np.random.default_rng(0)
    place = float(random.choice([-1, 1]) * random.uniform(40, 80)), float(random.uniform(-180, 180))
    log = recorded(place)
    far = imported(log, tmp_path, speeds, wind, origin(away(place, random.uniform(5e4, 2e5), np.pi / 2)))
    rows = far.frame
    np.testing.assert_allclose(rows[["u", "v"]], [(4.0, -0.5)] * len(rows), atol=1e-6)
    middle = np.interp(T[:-1] + 0.25, T, rows["psi"])
    path = np.diff(rows["north"] + 1j * rows["east"]) / 0.5
    assert abs(np.angle(np.mean(path * np.exp(-1j * middle)) / (4.0 - 0.5j))) < np.radians(0.02)
    np.testing.assert_allclose(np.exp(1j * (rows["beta_w"] - rows["psi"])), np.exp(1j * np.radians(230.0)), atol=1e-6)
    (said,) = told(far)
    columns = ["psi", *["course"] * (speeds == "ground"), *["beta_w"] * (wind == "true")]
    columns += ["u", "v"] * (speeds == "earth")
    assert said.startswith(f"{', '.join(columns)}: by up to ")
    turned = np.radians(float(said.split()[-14]))
    assert abs(turned) > PARALLEL
    np.testing.assert_allclose(np.abs(np.angle(np.exp(1j * (rows["psi"] - np.radians(log["psi"]))))), turned, atol=5e-4)


@pytest.mark.parametrize("seed", seeds(3, 5))
def test_recordings_of_two_days_with_one_origin_are_one_dataset(seed: int, tmp_path: Path) -> None:
    """At places up to 100 km apart: what the how-to does in place of a command."""
    random = np.random.default_rng(seed)
    place = float(random.choice([-1, 1]) * random.uniform(40, 80)), float(random.uniform(-175, 175))
    distance, towards = random.uniform(2e4, 9e4), random.uniform(0.5, 2.5)
    logs = recorded(place), recorded(away(place, distance, towards), u=5.0, begin=500.0)
    a, b = (imported(log, tmp_path, more=origin(place)) for log in logs)
    rows = pd.concat([a.frame.assign(run="a"), b.frame.assign(run="b")], ignore_index=True)
    whole = read_dataset(write_dataset(Dataset(rows, a.metadata), tmp_path / "ab.parquet"))
    assert whole.runs == ["a", "b"]
    begun = whole.frame.groupby("run")[["north", "east"]].first() @ [1, 1j]
    assert begun["b"] - begun["a"] == pytest.approx(distance * np.exp(1j * towards), rel=(distance / 6.37e6) ** 2)
