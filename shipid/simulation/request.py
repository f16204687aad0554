"""A standard manoeuvre as the user asks for it, at the scale of a ship: from this each kind sets its keys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from shipid.simulation.approach import Controls
from shipid.vessel.stability import yaw_growths

Side = Literal["starboard", "port"]
DECAYS, LONGEST = 8.0, 200.0  # until a turn is steady: time constants of a small yaw, and at most ship lengths


@dataclass(frozen=True)
class Request:
    """Angles, side and times of a standard manoeuvre.

    controls, n, speed : the ship with its commands, shaft speed [rev/s] and speed [m/s] of the approach.
    angles : those that were given, at most as many as the kind takes, in its units. side : of the first turn.
    duration : of the log, or of each level of a kind that holds levels [s]; None: the default of the kind.
    passing : time for one ship length at the speed of the approach [s]. interval : between rows of the log [s].
    keys : values of the keys that all kinds have: `n_rpm`, `execute_at`, `course_deg`, `approach`.
    """

    controls: Controls
    n: float
    speed: float
    angles: tuple[float, ...]
    side: Side
    duration: float | None
    passing: float
    interval: float
    keys: Mapping[str, Any]

    def angle(self, default: float, place: int = 0) -> float:
        """The angle at a place of those given, else the default, in the unit of the kind."""
        return self.angles[place] if place < len(self.angles) else default

    def time(self, lengths: float) -> float:
        """Length of the log [s]: as asked, else a number of ship lengths after the first order."""
        return self.keys["execute_at"] + lengths * self.passing if self.duration is None else self.duration

    def settling(self, least: float) -> float:
        """Ship lengths until a turn is steady, `least` or more: the rate of a nearly neutral ship takes long.

        The time is eight time constants of a small yaw about the straight course of the approach, the slowest of all
        turns, but at most that for 200 ship lengths.
        """
        rates = yaw_growths(self.controls.vessel, self.speed, self.controls.ahead(self.n))
        decay = min(map(abs, rates)) * self.passing  # in a ship length
        return float(np.clip(DECAYS / decay if decay > 0 else np.inf, least, LONGEST))


def round_to_rows(time: float, interval: float) -> float:
    """The time [s] in whole intervals, rounded up."""
    return float(np.ceil(time / interval) * interval)
