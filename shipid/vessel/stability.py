"""Course stability: how fast a small yaw of a ship that goes straight ahead grows or dies out."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from shipid.physics.signals import drive_scale, is_shaft, is_steering, neutral_value
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel

HELD = ("north", "east", "psi", "u")  # states that no transverse force depends on in calm water, and the speed
WATER = "waves."  # prefix of states of the water, which no motion changes: time, and where the current carries it
STEP, FINE = 1e-4, 1e-2  # size of a small yaw over the speed; of differences about it over that size
MOST_SHAFT = 1000.0  # rev/s: no screw turns so fast
MOST_FORCE = 1e6  # the same of a force, which is then 60 MN: no ship has so much thrust
SHARE = 0.1  # of sway or yaw in a motion: a motion with less, such as roll or heave, is no yaw
TURNS = 2  # of the search for the motion that grows most to one side


def bisect_root(function: Callable[[float], float], low: float, high: float, halvings: int = 60) -> float:
    """Root of a function that is negative at low and positive at high; the upper end if it never is."""
    for _ in range(halvings):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) < 0 else (low, middle)
    return high


def straight_orders(vessel: Vessel, n: float) -> dict[str, float]:
    """Commands [SI] with all that drives the ship at n [rev/s] (`drive_scale`), and the helm amidships."""
    return {name: n * drive_scale(name) or neutral_value(name) for name in vessel_dynamics(vessel).commands}


def service_shaft(vessel: Vessel, speed: float) -> float | None:
    """Shaft speed [rev/s] or force (`drive_scale`) that holds a speed [m/s] straight ahead; None if there is none."""

    def surplus(n: float) -> float:
        return float(straight_acceleration(vessel, speed, straight_orders(vessel, n))[0])

    drives = filter(drive_scale, vessel_dynamics(vessel).commands)
    most = MOST_SHAFT if all(map(is_shaft, drives)) else MOST_FORCE
    low, high = 0.0, 1.0
    while surplus(high) < 0:
        if high >= most:
            return None
        low, high = high, min(2 * high, most)
    return bisect_root(surplus, low, high)


def straight_acceleration(vessel: Vessel, u: float, commands: Mapping[str, float]) -> np.ndarray:
    """Surge, sway and yaw acceleration (3,) [m/s^2, rad/s^2] of the ship straight ahead at u [m/s] in calm water.

    Surge is that of a ship that keeps its trim, as on a steady course: a deep screw would trim it first.

    commands : command -> value [SI], reached by the actuators; other commands are neutral.
    """
    model = vessel_dynamics(vessel)
    state = [u if name == "u" else 0.0 for name in (*model.state, *model.hidden)]
    memory, orders = (
        [commands.get(name, neutral_value(name)) for name in names] for names in (model.memory, model.commands)
    )
    calm, values = np.zeros(len(model.environment)), np.array(list(vessel.parameters.values()))
    rates = np.array(model.rates(state, memory, orders, calm, values, np.zeros(model.num_dof))).ravel()
    motions, mass = model.state[model.num_dof :], vessel.mass
    result = rates[[model.state.index(name) for name in ("u", "v", "r")]]
    trim = [motions.index(name) for name in motions if name in "wq"]
    surge = motions.index("u")
    result[0] += mass[surge, trim] @ rates[model.num_dof :][: model.num_dof][trim] / mass[surge, surge]
    return result


def yaw_growth(vessel: Vessel, speed: float, orders: Mapping[str, float]) -> float:
    """Largest real part [1/s] of the eigenvalues of sway and yaw, with what moves with them, in calm water.

    Negative where the ship is course-stable (Fossen 2021), -inf where the equations give no number; to the side to
    which it turns more.

    speed : straight ahead [m/s], above 0. orders : commands [SI] that actuators have reached; helms are amidships.
    """
    return max(yaw_growths(vessel, speed, orders))


def yaw_growths(vessel: Vessel, speed: float, orders: Mapping[str, float]) -> tuple[float, float]:
    """As `yaw_growth`, of a small yaw to starboard and to port: different where the wake or the rudder's inflow is."""
    from scipy.linalg import eig  # a study is read without it

    model = vessel_dynamics(vessel)
    given = {name: neutral_value(name) if is_steering(name) else orders[name] for name in model.commands}
    names = (*model.state, *model.hidden)
    moving = [place for place, name in enumerate(names) if name not in HELD and not name.startswith(WATER)]
    straight = np.array([speed if name == "u" else 0.0 for name in names])
    rest = (
        [given[name] for name in model.memory],
        list(given.values()),
        np.zeros(len(model.environment)),
        list(vessel.parameters.values()),
        np.zeros(model.num_dof),
    )
    size = STEP * speed / np.where([name in "pqr" for name in names], vessel.length or 1.0, 1.0)
    turning = [names[place] in "vr" for place in moving]

    def rates(change: np.ndarray) -> np.ndarray:
        return np.array(model.rates(straight + change, *rest)).ravel()

    def fastest(about: np.ndarray, fine: float) -> tuple[float, np.ndarray]:
        """Growth of what grows most near a small motion, and that motion, as large as `size` and to starboard."""
        steps = np.diag(fine * size)[moving]
        slopes = np.column_stack([(rates(about + d) - rates(about - d))[moving] / (2 * d.max()) for d in steps])
        if not np.isfinite(slopes).all():
            return -np.inf, np.zeros(len(names))
        values, left, right = eig(slopes, left=True)
        whole = np.maximum(np.abs((left.conj() * right).sum(axis=0)), np.finfo(float).tiny)
        shares = np.abs(left * right)[turning].max(axis=0) / whole  # participation factors
        yaws = np.where(shares >= min(SHARE, shares.max()), values.real, -np.inf)
        motion = np.zeros(len(names))
        motion[moving] = right[:, np.argmax(yaws)].real
        motion /= np.abs(motion / size).max()
        return float(yaws.max()), motion if motion[names.index("r")] >= 0 else -motion

    _, begun = fastest(np.zeros(len(names)), 1.0)

    def to_side(side: float) -> float:
        found, motion = fastest(side * begun, FINE)
        for _ in range(TURNS):
            found, motion = fastest(side * motion, FINE)
        return found

    return to_side(1.0), to_side(-1.0)
