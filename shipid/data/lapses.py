"""Lapses: rows in which a rudder or a shaft is 0 or far off, or a sensor is stuck, and none can have been so."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Array, cumulative_integral
from shipid.physics.signals import is_all_round, is_steering

RowMask = NDArray[np.bool_]
Plane = NDArray[np.complex128]

LONGEST_USABLE_STEP = 2.0  # s: in longer steps a rudder goes anywhere and back
LONGEST_ZERO = 20.0  # s: of a zero
LEAST_LOG_ROWS = 50  # rows of a log
LEAST_FAULT_ANGLE, LEAST_SHARE_OF_VALUE, LEAST_SHARE_OF_RANGE = (
    np.radians(5.0),
    0.1,
    0.25,
)  # least size of an angle, of a usual value, of the range
AGREEMENT_SHARE = 0.25  # of its size: by so much at most are the values before and after a lapse apart
NOISY_STEP_RATIO, ZERO_STEP_RATIO, SPIKE_STEP_RATIO = (
    1.2,
    2.0,
    4.0,
)  # times the largest other step: rows of 0 in noise, other zeros, spikes
BEYOND_RANGE = 0.1  # of the range, that a spike of 1.2 times the largest other step lies outside of it
STEPPED_SHARE = 0.2  # share of the changes that are large, of an order, at least
NOISY_SHARE = 0.3  # of noise: share of the rows that change, and of the changes that turn back, at least
MOST_ZERO_ROWS, MOST_SPIKE_ROWS = 0.05, 0.02  # share of the rows that are zeros, and spikes, at most
WIDEST_RUDDER, FASTEST_GEAR = np.radians(47.0), np.radians(40.0)  # rad, no rudder is there; rad/s, no gear is faster
STUCK_SECONDS, STUCK_REPEATS = 4.5, 4.0  # s; times the usual repetition, at least
MISSED_TURN, MISSED_WAY = np.radians(6.0), 0.02  # rad; share of the way: IMO MSC.96(72) allows a log 2 %
MISSED_STEPS = 2.0  # large steps of a position


@dataclass(frozen=True)
class CommandFault:
    """Rows from `first` until before `end` of a command that lapses, and how.

    size : distance [SI] from the values before and after, at least.
    """

    first: int
    end: int
    kind: Literal["zero", "spike"]
    size: float


def find_command_faults(name: str, t: Array, values: Array, follows: RowMask) -> list[CommandFault]:
    """Return the rows in which a command lapses, by time.

    name : of the command. t, values : (N,) [s], [SI]. follows : (N - 1,) whether nothing is missing between a row and
    the next.

    A zero comes and goes faster than the column moves elsewhere; in an order, which steps, it may be ordered. A spike
    is a row or two far from the rows before and after, which agree.
    """
    if len(values) < LEAST_LOG_ROWS or not follows.any() or not np.ptp(values) > 0:
        return []
    return sorted(_zeros_and_spikes(name, t, values, follows), key=lambda one: one.first)


def stuck_spans(
    name: str, t: Array, values: Array, pose: tuple[Array, Plane], rates: tuple[Array, Plane], follows: RowMask
) -> list[tuple[int, int]]:
    """First and last row of each stretch in which a sensor repeats one value and the others say that it cannot.

    name : psi, r, course or speed, of which values (N,) are readings at t [s]. pose : psi [rad] without jumps, and
    position, north + i east [m]. rates : r [rad/s], and velocity over ground [m/s]. follows : as in
    `find_command_faults`.
    """
    edges = np.flatnonzero(np.concatenate([[True], (np.diff(values) != 0) | ~follows, [True]]))
    lengths = np.diff(edges)
    long = lengths >= STUCK_REPEATS * np.median(np.repeat(lengths, lengths))
    first, last = edges[:-1][long], edges[1:][long] - 1
    turned = cumulative_integral(t, rates[0])
    missed, least = {"psi": turned, "r": pose[0] - turned}.get(name, pose[0]), np.array(MISSED_TURN)
    if name == "speed":
        speed, steps = np.abs(rates[1]), np.diff(pose[1])
        ahead = steps * np.exp(-1j * np.angle(rates[1][1:]))  # noise of a position makes no way
        missed = np.append(0.0, np.cumsum(ahead.real)) - cumulative_integral(t, speed)
        digit = np.median(np.abs(np.diff(speed))[np.diff(values) != 0]) if len(lengths) > 1 else 0.0
        least = (MISSED_WAY * speed[first] + digit) * (t[last] - t[first])
        least += MISSED_STEPS * np.percentile(np.abs(steps), 95)
    off = np.array([np.ptp(missed[a : b + 1]) for a, b in zip(first, last, strict=True)])
    stuck = (t[last] - t[first] >= STUCK_SECONDS) & (off > least)
    return list(zip(first[stuck].tolist(), last[stuck].tolist(), strict=True))


def _zeros_and_spikes(name: str, t: Array, values: Array, follows: RowMask) -> Iterator[CommandFault]:
    step = float(np.median(np.diff(t)[follows]))
    if step > LONGEST_USABLE_STEP:
        return
    low, high = np.percentile(values, [0.5, 99.5])
    floor = LEAST_FAULT_ANGLE if is_steering(name) else LEAST_SHARE_OF_VALUE * float(np.percentile(np.abs(values), 75))
    least = max(floor, LEAST_SHARE_OF_RANGE * float(high - low)) if is_steering(name) else floor
    zeros = _find_zeros(t, values, follows, floor, step)
    spikes = _find_spikes(name, values, follows, least)
    other = follows.copy()  # steps that no lapse makes
    kept = np.ones(len(values), dtype=bool)
    for one in (*zeros, *spikes):
        other[one.first - 1 : one.end] = False
        kept[one.first : one.end] = False
    steps = np.abs(np.diff(values))
    changes = steps[other & (steps > 0)]
    most = float(changes.max(initial=0.0))
    if not len(changes) or np.mean(changes > least) > STEPPED_SHARE:
        zeros = []  # somebody may have ordered them
        spikes = [  # farther than all orders are apart
            one for one in spikes if one.size > np.ptp(values[kept]) and _is_beyond_range(values, one, kept, 0.0)
        ]
    else:
        noise = _is_noise(np.diff(values)[other])
        zeros = [one for one in zeros if _is_fast(name, values, one, most, noise)]
        spikes = [
            one for one in spikes if one.size > SPIKE_STEP_RATIO * most or _is_beyond_range(values, one, kept, most)
        ]
    spikes = [one for one in spikes if _is_no_kick(name, values, one, step)]
    for some, share in ((zeros, MOST_ZERO_ROWS), (spikes, MOST_SPIKE_ROWS)):
        if sum(one.end - one.first for one in some) <= share * len(values):
            yield from some


def _is_fast(name: str, values: Array, zero: CommandFault, most: float, noise: bool) -> bool:
    """Whether a zero comes and goes faster than a column does elsewhere, whose largest other step is `most`.

    Among noise, some rows of exactly 0 say more, also where an angle is another one afterwards.
    """
    long = noise and zero.end - zero.first > 1
    back = bool(abs(values[zero.end] - values[zero.first - 1]) < AGREEMENT_SHARE * zero.size)
    return zero.size > (NOISY_STEP_RATIO if long and back else ZERO_STEP_RATIO) * most and (
        back or (long and is_steering(name))
    )


def _is_no_kick(name: str, values: Array, spike: CommandFault, step: float) -> bool:
    """Whether a spike of an angle begins away from 0, goes where no rudder goes, or is faster than all gears."""
    beside, top = abs(values[spike.first - 1]), float(np.abs(values[spike.first : spike.end]).min())
    away = bool(beside > LEAST_FAULT_ANGLE) or (top > WIDEST_RUDDER and not is_all_round(name))
    return away or spike.size > FASTEST_GEAR * step or not is_steering(name)


def _find_zeros(t: Array, values: Array, follows: RowMask, least: float, step: float) -> list[CommandFault]:
    """Stretches of 0 between values far from it."""
    found = []
    edges = np.flatnonzero(np.diff(values == 0.0, prepend=False, append=False))
    for first, end in edges.reshape(-1, 2).tolist():
        if first == 0 or end == len(values) or not follows[first - 1 : end].all():
            continue
        size = float(min(abs(values[first - 1]), abs(values[end])))
        if size > least and t[end] - t[first - 1] < LONGEST_ZERO + 1.5 * step:
            found.append(CommandFault(first, end, "zero", size))
    return found


def _find_spikes(name: str, values: Array, follows: RowMask, least: float) -> list[CommandFault]:
    """One or two rows that leave the values before and after, which agree."""
    found: dict[int, CommandFault] = {}
    for rows in (1, 2):
        before, after = values[: -rows - 1], values[rows + 1 :]
        inside = np.stack([values[1 + k : len(values) - rows + k] for k in range(rows)])
        off = inside - (before + after) / 2
        size = np.minimum(np.abs(inside - before), np.abs(inside - after)).min(axis=0)
        one_side = np.abs(np.sum(np.sign(off), axis=0)) == rows
        whole = np.stack([follows[k : len(follows) - rows + k] for k in range(rows + 1)]).all(axis=0)
        hit = (
            (size > least)
            & one_side
            & (np.abs(after - before) < AGREEMENT_SHARE * size)
            & whole
            & ~(inside == 0).any(axis=0)
        )
        if is_all_round(name):
            hit &= np.abs(size / (2 * np.pi) - 1) > 0.05  # it crosses its 0 for a row
        if not is_steering(name):
            hit &= np.abs(before) > LEAST_SHARE_OF_VALUE * size  # a thruster that runs for a moment lapses not
        for row in map(int, np.flatnonzero(hit) + 1):
            if row not in found and row - 1 not in found:
                found[row] = CommandFault(row, row + rows, "spike", float(size[row - 1]))
    return list(found.values())


def _is_beyond_range(values: Array, spike: CommandFault, kept: RowMask, most: float) -> bool:
    """Whether a spike lies outside of all that is no lapse, and is larger than all other steps."""
    low, high = float(values[kept].min()), float(values[kept].max())
    inside = values[spike.first : spike.end]
    off = np.maximum(low - inside, inside - high).min()
    return bool(off > BEYOND_RANGE * (high - low) and spike.size > NOISY_STEP_RATIO * most)


def _is_noise(changes: Array) -> bool:
    """Whether changes (N,) from row to row are those of a noisy column: there are many, to and fro."""
    signs = np.sign(changes[changes != 0])
    many = len(signs) > NOISY_SHARE * len(changes) and len(signs) > 1
    return bool(many and np.mean(signs[1:] != signs[:-1]) > NOISY_SHARE)
