"""Angles of thrusters and rudders aboard, by the turn that goes on: 350 deg is -10 deg."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from shipid.physics.signals import row_of, turns_round
from shipid.vessel.load import Vessel

SAME_TURN = """/* Of all angles that differ by whole turns, the one nearest to a goal. */
static double nearest_turn(double angle, double goal)
{
    const double turn = 6.283185307179586476925;
    return angle + turn * floor(0.5 + (goal - angle) / turn);
}

/* The first angle of a stretch of rows: the turn nearest to the training, where that is narrower than a turn. */
static real first_turn(real angle, const real *limits)
{
    const double least = (double)limits[0], most = (double)limits[1];
    return most - least <= 6.283185307179586476925 ? (real)nearest_turn((double)angle, (least + most) / 2) : angle;
}

/* An angle of a thruster or rudder, which may differ by whole turns, by the turn that goes on. before: the last
 * one. limits: of training. low, high: stops of the unit. all_round: whether it may turn without end. moved: by how
 * much the past is to be moved, so that it goes on to the result; a null pointer where it cannot be. */
static real same_turn(real given, real before, const real *limits, real low, real high, int all_round, real *moved)
{
    const double turn = 6.283185307179586476925, least = (double)limits[0], most = (double)limits[1];
    const double angle = (double)given, last = (double)before;
    const int narrow = most - least <= turn, stopped = (double)high - (double)low < turn;
    double next, within;
    if (moved) *moved = 0;
    if (!all_round || stopped) { /* one turn alone is right, so a jump is real */
        next = nearest_turn(angle, stopped ? ((double)low + (double)high) / 2 : 0);
        if (stopped && next >= (double)low && next <= (double)high) return (real)next;
        within = angle + turn * ceil((least - angle) / turn);
        if (narrow && within <= most) return (real)within;
        return stopped || !narrow ? (real)next : first_turn(given, limits);
    }
    next = nearest_turn(angle, last);
    if (next < (double)low && next + turn <= (double)high) return (real)(next + turn); /* it turns back from a stop */
    if (next > (double)high && next - turn >= (double)low) return (real)(next - turn);
    if (next >= least && next <= most) return (real)next;
    within = next < least ? next + turn * ceil((least - next) / turn) : next - turn * ceil((next - most) / turn);
    if (!(within >= least && within <= most)) return (real)next;
    if (narrow && last >= least && last <= most && fabs(within - last) <= 0.875 * turn) return (real)within;
    if (!moved) return (real)next;
    *moved = (real)(within - next);
    return (real)within;
}
"""


@dataclass(frozen=True)
class Turned:
    """An angle of a row that may wrap.

    command : such as `port.alpha`. place : in the row. stops : of the unit, as C. round : whether it turns all round.
    """

    command: str
    place: int
    stops: tuple[str, str]
    round: bool

    def call(self, name: str, angle: str, last: str, moved: str) -> str:
        """C of the angle by its turn."""
        low, high = self.stops
        limits = f"{name}_limits + {2 * self.place}"
        return f"same_turn({angle}, {last}, {limits}, {low}, {high}, {int(self.round)}, {moved})"

    def first(self, name: str, angle: str) -> str:
        """C of the angle that a first row goes on from."""
        return f"first_turn({angle}, {name}_limits + {2 * self.place})"


def turned(row: Sequence[str], vessel: Vessel | None, parameters: Sequence[str]) -> list[Turned]:
    """Angles of thrusters and rudders in a row. parameters : names of those that may be changed aboard."""
    found = []
    for place, key in enumerate(row):
        signal = row_of(key)
        if "." in key and signal is not None and signal.angle:
            found.append(Turned(key, place, _stops(key, vessel, parameters), turns_round(key)))
    return found


def _stops(command: str, vessel: Vessel | None, parameters: Sequence[str]) -> tuple[str, str]:
    """Stops of a unit as C: numbers of the vessel that may be changed aboard, or constants."""
    component, _, signal = command.rpartition(".")
    document: Mapping[str, Any] = {} if vessel is None else vessel.document
    gear = document.get("thruster", {}).get(component, {}).get("actuator", {}).get(signal, {})
    stops = []
    for name, none in (("low", "-INFINITY"), ("high", "INFINITY")):
        path = f"thruster.{component}.actuator.{signal}.{name}"
        if path in parameters:
            stops.append(f"self->parameters[{parameters.index(path)}]")
        else:
            stops.append(f"(real){float(gear[name])!r}" if name in gear else none)
    return stops[0], stops[1]
