"""Manoeuvres whose motion is known in closed form, sampled as densely as one likes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shipid.measures.record import Record
from shipid.units import DEGREE

Array = np.ndarray
FINE = 0.01  # s
START = 10.0  # s: the first execute
GAIN, TIME = 0.08, 9.0  # K [1/s] and T [s] of Nomoto's T r' + r = K delta
SPEED, SWAY, DRAG = 5.0, -8.0, 90.0  # u = SPEED - DRAG r^2, v = SWAY r
RATE, DRIFT = 0.05, 0.2  # rad/s, rad: of the perfect circle
DECELERATION, VEER = 0.04, 0.002  # m/s^2, rad/s: of the stop


def made_record(t: Array, psi: Array, r: Array, helm: Array, u: Array, v: Array, shaft: Array | None = None) -> Record:
    """Record with the place integrated from the velocities, to 1e-5 m at the fine step."""
    rates = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)
    north, east = (np.append(0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(t))) for rate in rates)
    return Record(t, north, east, psi, u, v, r, helm, shaft)


def nomoto(t: Array, legs: list[tuple[float, float]]) -> tuple[Array, Array, Array]:
    """Heading, rate and helm of Nomoto's ship whose helm is put to an angle [rad] at each instant [s]."""
    psi, r, helm = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    heading, rate = 0.0, 0.0
    for (begin, delta), (end, _) in zip(legs, [*legs[1:], (np.inf, 0.0)], strict=True):
        on, since = t >= begin - 1e-9, t - begin
        decay = np.exp(-np.maximum(since, 0) / TIME)
        r[on] = (GAIN * delta + (rate - GAIN * delta) * decay)[on]
        psi[on] = (heading + GAIN * delta * since + TIME * (rate - GAIN * delta) * (1 - decay))[on]
        helm[on] = delta
        if np.isfinite(end):
            decay = np.exp(-(end - begin) / TIME)
            heading += GAIN * delta * (end - begin) + TIME * (rate - GAIN * delta) * (1 - decay)
            rate = GAIN * delta + (rate - GAIN * delta) * decay
    return psi, r, helm


def zigzag_legs(
    delta: float, heading: float, count: int
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Executes (instant, helm) of a perfect helmsman, and (overshoot [rad], time to check [s]) after each reversal."""
    legs, peaks = [(START, delta)], []
    psi, rate = 0.0, 0.0
    for number in range(count):
        sense = 1.0 if number % 2 == 0 else -1.0
        pull = GAIN * sense * delta

        def turned(s: float, psi: float = psi, rate: float = rate, pull: float = pull, sense: float = sense) -> float:
            return sense * (psi + pull * s + TIME * (rate - pull) * (1 - np.exp(-s / TIME))) - heading

        low, high = 0.0, 500.0
        if turned(low) > 0:  # the last peak is behind him: he waits on the way back
            raise AssertionError("reversed late")
        for _ in range(100):
            middle = (low + high) / 2
            low, high = (low, middle) if turned(middle) >= 0 else (middle, high)
        rate = pull + (rate - pull) * np.exp(-high / TIME)
        psi = sense * heading
        legs.append((legs[-1][0] + high, -sense * delta))
        s = TIME * np.log(1 + abs(rate) / abs(pull))
        peaks.append((TIME * abs(rate) - abs(pull) * s, s))
    return legs, peaks


def clock(end: float) -> Array:
    return np.arange(round(end / FINE) + 1) * FINE


def zigzag_10() -> Record:
    t = clock(200.0)
    psi, r, helm = nomoto(t, zigzag_legs(10 * DEGREE, 10 * DEGREE, 8)[0])
    return made_record(t, psi, r, helm, SPEED - DRAG * r**2, SWAY * r)


def circle() -> Record:
    t = clock(250.0)
    psi, r, helm = nomoto(t, [(START, 35 * DEGREE)])
    return made_record(t, psi, r, helm, SPEED - DRAG * r**2, SWAY * r)


def perfect_circle() -> Record:
    """Straight at SPEED, then at once on a circle at RATE, DRIFT and SPEED."""
    t = clock(300.0)
    turning = t >= START
    r = np.where(turning, RATE, 0.0)
    psi, beta = RATE * np.maximum(t - START, 0), np.where(turning, DRIFT, 0.0)
    radius = SPEED / RATE
    north = np.where(turning, SPEED * START + radius * (np.sin(psi - DRIFT) + np.sin(DRIFT)), SPEED * t)
    east = np.where(turning, radius * (np.cos(DRIFT) - np.cos(psi - DRIFT)), 0.0)
    helm = np.where(turning, 35 * DEGREE, 0.0)
    return Record(t, north, east, psi, SPEED * np.cos(beta), -SPEED * np.sin(beta), r, helm)


def released() -> Record:
    t = clock(250.0)
    psi, r, helm = nomoto(t, [(START, 20 * DEGREE), (110.0, 0.0)])
    return made_record(t, psi, r, helm, SPEED - DRAG * r**2, SWAY * r)


LEVELS = [20, 10, 5, 2, 0, -2, -5, -10, -20, -10, -5, -2, 0, 2, 5, 10, 20]
HOLD = 100.0


def stable_spiral() -> Record:
    t = clock(START + HOLD * len(LEVELS))
    psi, r, helm = nomoto(t, [(START + i * HOLD, level * DEGREE) for i, level in enumerate(LEVELS)])
    return made_record(t, psi, r, helm, SPEED - DRAG * r**2, SWAY * r)


def stopped() -> Record:
    """Constant deceleration along a slowly veering heading."""
    t = clock(200.0)
    since = np.maximum(t - START, 0)
    u = SPEED - DECELERATION * since
    shaft = np.where(t >= START, -1.5, 2.0)
    return made_record(t, VEER * since, np.where(t >= START, VEER, 0.0), np.zeros_like(t), u, np.zeros_like(t), shaft)


RECORDS: dict[str, Callable[[], Record]] = {
    "zigzag": zigzag_10,
    "turning": circle,
    "pull-out": released,
    "spiral": stable_spiral,
    "stop": stopped,
}


def every(record: Record, interval: float) -> Record:
    """The same run sampled at an interval [s]."""
    return rows(record, slice(None, None, round(interval / FINE)))


def rows(record: Record, chosen: slice) -> Record:
    names = ("t", "north", "east", "psi", "u", "v", "r", "helm")
    shaft = None if record.shaft is None else record.shaft[chosen]
    return replace(record, **{name: getattr(record, name)[chosen] for name in names}, shaft=shaft)
