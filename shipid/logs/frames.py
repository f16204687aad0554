"""Angles and frames of rows in SI units: angles that wrap, positions on the ellipsoid, velocities, true wind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from shipid.data.dataset import Array, clock_slack
from shipid.errors import DataError
from shipid.logs.dates import format_moment
from shipid.logs.mapping import Column, Mapping
from shipid.logs.repairs import Despike, Records, interpolate_missing, remove_spikes
from shipid.physics.signals import is_all_round, is_command, is_wrapped_angle, signal_row

BLOCK = 200_000  # rows that are projected, or unwrapped, at once
JUMP, JUMPY = np.radians(1.0), 20.0  # rad of a meridian; s, for half of which positions may jump: repairs come later
PARALLEL = np.radians(0.05)  # rad: meridians that differ by less are parallel
NEAR = 3.0  # usual steps: rows further apart are no neighbours
TURN, ABOUT = 2 * np.pi, np.pi / 4  # rad: a jump of an angle that counts from 0 again, and how far from it one may be


def unwrap_angles(rows: pd.DataFrame, mapping: Mapping, file: Path) -> pd.DataFrame:
    """Unwrap angles, and turn winds "from" into "towards"; DataError for a jump of one that does not wrap."""
    turned: dict[str, NDArray[np.float64]] = {}
    for name, column in mapping.columns.items():
        check_wraps(rows["t"].to_numpy(), rows[name].to_numpy(), name, column, mapping.clock.max_gap or 0.0, file)
        if column.direction != "from" and not column.wrap:
            continue
        values = rows[name].to_numpy().copy()
        if column.direction == "from":
            values += np.pi
        if column.wrap:
            known = np.isfinite(values)
            if known.all():
                unwrap_in_place(values)
            else:
                values[known] = np.unwrap(values[known])
            if is_command(name) and known.any():  # an azimuth about 360 deg is one about 0
                values -= 2 * np.pi * np.round(np.median(values[known]) / (2 * np.pi))
        turned[name] = values
    return rows.assign(**turned)


def check_wraps(t: Array, values: Array, name: str, column: Column, max_gap: float, file: Path) -> None:
    """Raise DataError where an angle jumps by a whole turn from row to row, or over a gap of at most `max_gap` [s].

    The mean of 359 and 1 deg is 180.
    """
    row = signal_row(name)
    ordered = row is not None and row.angle and is_command(name)
    if column.wrap and ordered and not is_all_round(name) and not may_wrap(values[np.isfinite(values)], name):
        raise DataError(f"{column.source!r} {_not_of_turns(values)}", file=file, path=f"columns.{name}")
    begin = next(iter(values[np.isfinite(values)]), 0.0)
    if column.wrap and abs(begin) > 1.5 * TURN:  # half a turn may be an offset; later ones may count on
        words = f"begins with {np.degrees(begin):.4g} deg, more than a turn: is the unit right?"
        raise DataError(f"{column.source!r} {words}", file=file, path=f"columns.{name}")
    if column.wrap or not (is_wrapped_angle(name) or name == "course" or ordered):
        return
    if not np.nanmax(values, initial=-np.inf) - np.nanmin(values, initial=np.inf) > TURN - ABOUT:
        return  # none can: of a large log there is no room for what follows
    known = np.isfinite(values)
    times = t[known]
    steps, jumps = np.diff(times), np.diff(values[known])
    near = (steps < NEAR * np.median(steps)) | (steps <= max_gap + clock_slack(t)) if len(steps) else steps > 0
    places = np.flatnonzero(near & is_turn(jumps))
    if len(places):
        count = "once" if len(places) == 1 else f"{len(places)} times, first"
        sentence = f"{column.source!r} jumps by a whole turn, {count} at {format_moment(times[places[0] + 1])}"
        remedy = "write wrap = true"
        if ordered and not may_wrap(values[known], name):
            remedy = f"it {_not_of_turns(values)}"
        elif ordered and not is_all_round(name):
            remedy = "is the unit right? If it counts from 0 to 360 deg, write wrap = true"
        raise DataError(f"{sentence}: {remedy}", file=file, path=f"columns.{name}")


def _not_of_turns(values: Array) -> str:
    low, high = np.degrees(np.nanmin(values)), np.degrees(np.nanmax(values))
    return f"goes from {low:.4g} to {high:.4g} deg, as no such angle does that begins again: is the unit right?"


def may_wrap(values: Array, command: str) -> bool:
    """Whether angles (N,) [rad] of a command may begin again after a whole turn; a rudder does so about amidships."""
    near = is_all_round(command) or bool(np.all(np.cos(values) > 0.0))
    return near and bool(np.max(values, initial=-np.inf) - np.min(values, initial=np.inf) < 1.02 * TURN)


def is_turn(jumps: Array) -> NDArray[np.bool_]:
    """Whether differences (N,) [rad] of an angle are those of one that begins again: a turn, or nearly."""
    return np.asarray(np.abs(np.abs(jumps) - TURN) < ABOUT)


def unwrap_in_place(values: NDArray[np.float64]) -> None:
    """Unwrap an angle (N,) [rad] in place, as `numpy.unwrap` does, with the memory of one block of rows."""
    for first in range(0, len(values), BLOCK):
        part = slice(max(first - 1, 0), first + BLOCK)
        values[part] = np.unwrap(values[part])


def project_positions(
    rows: pd.DataFrame, mapping: Mapping, file: Path
) -> tuple[pd.DataFrame, Records, tuple[float, float]]:
    """North and east [m] in the plane that touches WGS 84 at the origin; directions count from its north.

    Also the record of that, and the origin [deg].
    """
    from pymap3d import geodetic2ned

    latitude, longitude = np.degrees(rows["latitude"].to_numpy()), np.degrees(rows["longitude"].to_numpy())
    for name, values, most in (("latitude", latitude, 90.0), ("longitude", longitude, 360.0)):
        wrong = np.flatnonzero(np.abs(values) > most)
        if len(wrong):
            reached = (
                f"{values[wrong[0]]:.6g} deg at {format_moment(rows['t'].iloc[wrong[0]])}, one of {len(wrong)} rows"
            )
            raise DataError(
                f"{reached}: is the unit right? List what stands for a missing value in [format] missing",
                file=file,
                path=f"columns.{name}",
            )
    known = np.flatnonzero(np.isfinite(latitude) & np.isfinite(longitude))
    if mapping.origin is not None:
        origin = mapping.origin.latitude, mapping.origin.longitude
    else:
        first = known[0] if len(known) else 0
        origin = float(latitude[first]), float(longitude[first])
    turn = np.empty(len(rows))
    for first in range(0, len(rows), BLOCK):  # of a large log there is no room for all steps of the projection
        part = slice(first, first + BLOCK)
        turn[part] = meridian_convergence(latitude[part], longitude[part], *origin)
        latitude[part], longitude[part], _ = geodetic2ned(latitude[part], longitude[part], 0.0, *origin, 0.0)
    rows, records = rotate_to_plane(rows, turn, mapping.columns)
    return rows.drop(columns=["latitude", "longitude"]).assign(north=latitude, east=longitude), records, origin


def meridian_convergence(latitude: ArrayLike, longitude: ArrayLike, latitude_0: float, longitude_0: float) -> Array:
    """Angle [rad] of true north at positions [deg], clockwise from the north of the plane that touches at the origin.

    gamma = atan2(-sin(lat) sin(d), sin(lat) sin(lat_0) cos(d) + cos(lat) cos(lat_0)), d = lon - lon_0: the horizontal
    parts of the unit vector to the north there; about -d sin(lat).
    """
    lat, lat_0, d = np.radians(latitude), np.radians(latitude_0), np.radians(np.subtract(longitude, longitude_0))
    ahead = np.sin(lat) * np.sin(lat_0) * np.cos(d) + np.cos(lat) * np.cos(lat_0)
    return np.asarray(np.arctan2(-np.sin(lat) * np.sin(d), ahead))


def rotate_to_plane(
    rows: pd.DataFrame, turn: NDArray[np.float64], columns: dict[str, Column]
) -> tuple[pd.DataFrame, Records]:
    """Turn psi, course, true wind and earth-fixed velocities of rows (N,) by `turn` (N,) [rad]; also a record of that.

    Where no angle is above `PARALLEL`, nothing is turned.
    """
    t, known = rows["t"].to_numpy(), np.isfinite(turn)
    turn[known] = np.unwrap(turn[known])
    if np.any(np.abs(turn[known]) > PARALLEL):
        window = max(JUMPY, 2 * float(np.median(np.diff(t))))
        jumps = Despike(kind="despike", reason="of positions", columns=("turn",), window=window, threshold=JUMP)
        turn = remove_spikes(rows[["t", "flags"]].assign(turn=turn), jumps).rows["turn"].to_numpy()
        turn = interpolate_missing(t, turn, ~np.isfinite(turn))
    if not np.any(np.abs(turn) > PARALLEL):
        return rows, []
    turned = {name: rows[name].to_numpy() + turn for name in ("psi", "course") if name in rows}
    if "beta_w" in rows and not columns["beta_w"].relative:
        turned["beta_w"] = rows["beta_w"].to_numpy() + turn
    if "u" in rows and columns["u"].frame == "earth":
        ground = (rows["u"].to_numpy() + 1j * rows["v"].to_numpy()) * np.exp(1j * turn)
        turned |= {"u": ground.real, "v": ground.imag}
    most = np.degrees(np.max(np.abs(turn)))
    note = f"by up to {most:.2f} deg, from true north to the north of the plane of the origin"
    record = {"kind": "turned", "column": ", ".join(turned), "count": len(rows), "note": note}
    return rows.assign(**turned), [record]


def in_body(rows: pd.DataFrame, columns: dict[str, Column]) -> pd.DataFrame:
    """Turn speed and course over ground, or earth-fixed velocities, into u and v [m/s] by the heading psi."""
    if "speed" in columns:
        drift = rows["course"] - rows["psi"]
        turned = rows.drop(columns=["speed", "course"])
        return turned.assign(u=rows["speed"] * np.cos(drift), v=rows["speed"] * np.sin(drift))
    if "u" not in columns or columns["u"].frame == "body":
        return rows
    c, s = np.cos(rows["psi"].to_numpy()), np.sin(rows["psi"].to_numpy())
    north, east = rows["u"].to_numpy(), rows["v"].to_numpy()
    return rows.assign(u=c * north + s * east, v=c * east - s * north)


def true_wind(rows: pd.DataFrame) -> pd.DataFrame:
    """Wind relative to the bow and the moving ship as wind over ground: its velocity plus the ship's, turned by psi."""
    ahead = rows["V_w"] * np.cos(rows["beta_w"]) + rows["u"]
    abeam = rows["V_w"] * np.sin(rows["beta_w"]) + rows["v"]
    beta_w = np.unwrap(np.arctan2(abeam, ahead) + rows["psi"])
    return rows.assign(V_w=np.hypot(ahead, abeam), beta_w=beta_w)
