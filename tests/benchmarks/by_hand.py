"""The same rollouts by C that is written by hand for AVX-512 and this one ship: how fast a step can be here.

Terms are ordered, coefficients joined and tables scaled by hand; there are no checks, no extra force, no records. What
depends on parameters and commands is computed beforehand, in NumPy, and not timed.
"""

from __future__ import annotations

import ctypes
import math
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shipid.engine.vectors import DOUBLE, SINGLE
from shipid.vessel.load import Vessel

SIDES = ("port", "starboard")
UNIT = "J_min J_max Jy_max J_t K_x.1 K_x.J K_x.JJ K_x.JJJ K_x.Jt K_x.yy K_x.Jyy k_over k_over2 k_under".split()
UNIT += "K_y.y K_y.Jy K_y.y|y| k_side k_sideJ".split()
SIDE = "vvv rrv v|v| v|r| uv uuv rrr vvr r|v| r|r| ur uur".split()
GROUPS = 2  # vectors that step together

Array = np.ndarray[Any, Any]


def roll_out_by_hand(
    vessel: Vessel, given: Sequence[Array], values: Array, precision: str, steps: int
) -> Callable[[], Array]:
    """A call that gives final states (6, V, S); given : states, commands, wind (channel, S); values (V, P)."""
    of = {"float64": DOUBLE, "float32": SINGLE}[precision]
    lanes = 512 // of.bits
    run = _compiled(of, lanes)
    names = list(vessel.parameters)
    count = given[0].shape[1]
    stride = -(-count // (GROUPS * lanes)) * GROUPS * lanes
    start, commands, wind = (np.pad(part, ((0, 0), (0, stride - count)), "edge") for part in given)

    members = [dict(zip(names, row, strict=True)) for row in values.tolist()]
    numbers = np.array([_numbers(member) for member in members], of.dtype)
    tables = np.array([_tables(member, lanes) for member in members], of.dtype)
    held = np.array([_held(member, commands, wind) for member in members], of.dtype)
    out = np.empty((6, len(members), stride), of.dtype)
    arrays = [numbers, tables, start.astype(of.dtype), held, out]
    sizes = [ctypes.c_long(size) for size in (len(members), stride, steps)]

    def roll_out() -> Array:
        run(*sizes, *(ctypes.c_void_p(part.ctypes.data) for part in arrays))
        return out[..., :count]

    return roll_out


def _compiled(of: Any, lanes: int) -> Any:
    """The C function `run` of a precision."""
    quarter, half = of.quarter, of.half
    arc = _arc_coefficients(12 if of is DOUBLE else 5)
    lists = {"SINE": of.sin, "COSINE": (-0.5, *of.cos), "ARC": arc, "EXP": (2.0, *of.exp)}
    macros = {f"{name}_COEFFICIENTS": numbers for name, numbers in lists.items()} | {
        "QUARTERS": quarter,
        "HALVES": half,
    }
    sizes = {
        "REAL": of.real,
        "INTEGER": of.integer,
        "W": lanes,
        "BITS": of.bits,
        "MANTISSA": of.mantissa,
        "GROUPS": GROUPS,
    }
    words = [f"-D{name}={','.join(map(repr, numbers))}" for name, numbers in macros.items()]
    words += [f"-D{name}={value}" for name, value in sizes.items()]
    options = [
        "-O3",
        "-fschedule-insns",
        "-fsched-pressure",
        "-march=native",
        "-mprefer-vector-width=512",
        "-fno-math-errno",
        "-shared",
        "-fPIC",
        "-w",
    ]
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "by_hand.so"
        subprocess.run(["gcc", *options, *words, str(Path(__file__).with_suffix(".c")), "-o", str(library)], check=True)
        return ctypes.CDLL(str(library)).run


def _arc_coefficients(count: int) -> list[float]:
    """(atan(x) / x - 1) / x^2 as a polynomial in x^2, x <= tan(pi / 8)."""
    end = math.tan(math.pi / 8) ** 2
    series = np.polynomial.Polynomial([(-1) ** (k + 1) / (2 * k + 3) for k in range(60)])
    near = np.polynomial.Chebyshev.interpolate(series, count - 1, [0, end])
    return near.convert(kind=np.polynomial.Polynomial, domain=[-1, 1], window=[-1, 1]).coef.tolist()


def _numbers(of: dict[str, float]) -> list[float]:
    """Numbers of a member in the order of the C code."""
    hull = {key.rsplit(".", 1)[1]: x for key, x in of.items() if key.startswith("hull.")}
    m, I_z = of["inertia.m"], of["inertia.I_z"]
    surge, sway, yaw = m - of["added_mass.X_udot"], m - of["added_mass.Y_vdot"], I_z - of["added_mass.N_rdot"]
    Y_r, N_v = -of["added_mass.Y_rdot"], -of["added_mass.N_vdot"]
    turn = (Y_r + N_v) / 2
    hull["X_rv"] += sway
    hull["X_rr"] += turn
    hull["Y_ur"] -= surge
    hull["N_uv"] += surge - sway
    hull["N_ur"] -= turn
    ahead = [hull[f"X_{name}"] for name in "u|u| u|v| rvu uvv urr vv rv rr".split()]
    aside = [hull[f"{axis}_{name}"] for axis in "YN" for name in SIDE]
    determinant = sway * yaw - Y_r * N_v
    solve = [1 / surge, *(x / determinant for x in (yaw, -Y_r, -N_v, sway))]
    units = []
    for side in SIDES:
        unit = {name: of[f"thruster.{side}.{name}"] for name in ("x", "y", *UNIT)}
        unit["J_t"] = 1 / unit["J_t"]
        units += unit.values()
    return [*ahead, *aside, *solve, *units]


def _tables(of: dict[str, float], lanes: int) -> list[Array]:
    """Ordinates and slopes of each table, with the pressure's area."""
    area = of["constants.rho_a"] / 2 * of["wind.A_FW"], *[-of["constants.rho_a"] / 2 * of["wind.A_LW"]] * 2
    parts: list[Array] = []
    for name, factor in zip("XYN", (*area[:2], area[2] * of["wind.L_oa"]), strict=True):
        values = factor * np.array([x for key, x in of.items() if key.startswith(f"wind.C_{name}.")])
        rows = values, np.diff(values, append=values[-1])
        parts += [np.pad(row, (0, (3 if lanes == 8 else 2) * lanes - len(row))) for row in rows]
    return parts


def _held(of: dict[str, float], commands: Array, wind: Array) -> Array:
    """What the commands give (18, S): of each unit its J and forces; then the wind from north and east."""
    rows = []
    for side, n, alpha in zip(SIDES, commands[0::2], commands[1::2], strict=True):
        unit = f"thruster.{side}."
        D, x, y = of[f"{unit}D_p"], of[f"{unit}x"], of[f"{unit}y"]
        scale = of[f"{unit}k_T"] * of["constants.rho"] * D**4 * n**2
        c, s = np.cos(alpha), np.sin(alpha)
        A, B = scale * c, scale * s
        rows += [c / (n * D), s / (n * D), A, B, x * B - y * A, B, A, x * A + y * B]
    return np.stack([*rows, wind[0] * np.cos(wind[1]), wind[0] * np.sin(wind[1])])
