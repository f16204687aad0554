"""A unit or a sign that another part of a log has, as where files of two recorders were put together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Array
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State
from shipid.logs.guess.defects import clock_text
from shipid.logs.guess.evidence import Complex
from shipid.logs.mapping import to_si
from shipid.physics.signals import is_command, is_shaft, is_steering, signal_of

NODES, SPLITS = 120, 60  # places at which a part may begin or end
LEAST = 0.05  # share of all motion that a part has, at least
SEEN, BETTER = 0.005, 0.3  # share of the motion that one scale leaves, at least; of that what two leave, at most
ALIKE, NOTHING = 1.4, 5e-4  # ratio of two scales, that are one; and that of a column that stands still
CLEAR, TIMES = 8.0, 20.0  # t value of the effect of an order in each part, and ratio of the effects, at least
MAKES_WAY = 0.4  # of the larger speeds, at least: an angle steers
MOST_LEFT = 0.75  # share of what one effect leaves, that two leave, at most
UNDER_WAY = 0.2  # of the median speed: of a slower ship, her way says little of the shaft
SHAFTS = [np.log(to_si(unit, "propeller.n")) for unit in ("rpm", "rad/s", "rev/s")]
OF_UNITS = [one - other for one in SHAFTS for other in SHAFTS if one != other]  # logarithms of ratios of two units
NEAR, ROUGHLY = np.log(1.25), np.log(2.0)  # how far a step is off one at most, and what is seen less well
RUNNING = 0.2  # of the usual speed of the shaft in a part: of less, a step says little
APART = 0.2  # of the logarithm of that ratio: how far revolutions over a metre scatter in each part, at most


@dataclass(frozen=True)
class ScalePart:
    """Windows from `first` until before `end`, and how many times the scale is there what it is elsewhere."""

    first: int
    end: int
    ratio: float


def ask_for_changes(state: State) -> None:
    """Ask where the scale or the sign of velocities, a yaw rate or an angle that steers is another one in a part."""
    sources = {one.name: one.source for one in state.suggestions}
    pairs: list[tuple[tuple[str, ...], str, Array | Complex, Array | Complex]] = []
    if state.velocity is not None:
        names = tuple(name for name in ("u", "v", "speed") if name in sources)
        pairs.append((names, "track", state.position, state.velocity))
    rates = [sources["r"]] if "r" in sources else state.called("r")[:1]
    pairs += [(("r",), "change of the heading", state.psi, state.columns[name]) for name in rates]
    for about, what, whole, rate in pairs:
        named = [sources[name] for name in about if name in sources] or rates
        part = other_part(state.chosen.change(whole), state.chosen.change(evidence.integrate_rate(state.t, rate)))
        if part is not None:
            middle = np.append((state.chosen.first + state.chosen.last) // 2, len(state.t))
            first, end = int(middle[part.first]) if part.first else 0, int(middle[part.end])
            columns = " and ".join(map(repr, named))
            how = f"the {what} is {part.ratio:.3g} times as much, beside its integral, as elsewhere"
            _ask_about_change(
                state, about, f"has {columns} another unit or sign {_from_to(state, first, end)}? There {how}"
            )
    for one in state.suggestions:
        if is_command(one.name) and is_steering(signal_of(one.name)):
            _ask_for_angle(state, one.name, one.source)
        elif is_command(one.name) and is_shaft(one.name):
            _ask_for_shaft(state, one.name, one.source)


def other_part(seen: Complex, ran: Complex) -> ScalePart | None:
    """The part of the windows in which seen = scale * ran has another scale than elsewhere; None if none has."""
    if len(seen) < 40:
        return None
    nodes = np.unique(np.linspace(0, len(seen), NODES + 1).astype(int))
    sums = np.real(np.conj(ran) * seen), np.abs(ran) ** 2, np.abs(seen) ** 2
    cross, power, motion = (np.append(0.0, np.cumsum(one))[nodes] for one in sums)
    total = float(motion[-1])
    share = (motion[None, :] - motion[:, None]) / max(total, 1e-30)
    of_part, of_rest = (power[None, :] - power[:, None]), power[-1] - (power[None, :] - power[:, None])
    possible = (np.minimum(share, 1.0 - share) > LEAST) & (np.minimum(of_part, of_rest) > 0.0)
    if not possible.any():
        return None
    inside = (cross[None, :] - cross[:, None]) / np.where(possible, of_part, 1.0)
    outside = (cross[-1] - cross[None, :] + cross[:, None]) / np.where(possible, of_rest, 1.0)
    explained = np.where(possible, inside**2 * of_part + outside**2 * of_rest, -np.inf)
    first, end = np.unravel_index(int(np.argmax(explained)), explained.shape)
    one, two = total - cross[-1] ** 2 / power[-1], total - float(explained[first, end])
    if one < SEEN * total or two > BETTER * one:
        return None
    ratio = float(inside[first, end] / outside[first, end]) if outside[first, end] else 0.0
    if not NOTHING < abs(ratio) < 1 / NOTHING or 1 / ALIKE < ratio < ALIKE:
        return None
    return ScalePart(int(nodes[first]), int(nodes[end]), ratio)


def _ask_for_angle(state: State, name: str, source: str) -> None:
    """Ask where an angle turns the ship to the other side, or many times as fast, from some row on."""
    r = state.r if state.r is not None else np.gradient(state.psi, state.t)
    rows, design, change = evidence.yaw_regression(state.t, r, state.columns[source], state.part)
    seen = state.chosen
    speed = np.abs(seen.change(state.position)) / (state.t[seen.last] - state.t[seen.first])
    makes_way = np.interp(rows, seen.first, speed) > MAKES_WAY * np.percentile(speed, 90)  # else thrust turns her
    rows, design, change = rows[makes_way], design[makes_way], change[makes_way]
    whole = evidence.solve_least_squares(design, change)[2]
    least, start, ratio = MOST_LEFT * whole, 0, 1.0
    for row in np.unique(np.linspace(0, len(rows), SPLITS + 2).astype(int))[1:-1]:
        before = np.where(np.arange(len(rows)) < row, design[:, 0], 0.0)
        apart = np.column_stack([before, design[:, 0] - before, design[:, 1:]])
        found, errors, left = evidence.solve_least_squares(apart, change)
        if left >= least or not np.all(np.abs(found[:2]) > CLEAR * errors[:2]):
            continue
        if not 1 / TIMES < found[1] / found[0] < TIMES:  # else the speed is another one
            least, start, ratio = left, int(rows[row]), float(found[1] / found[0])
    if start == 0:
        return
    how = "to the other side" if ratio < 0 else f"{ratio:.2g} times as fast"
    words = f"has {source!r} another unit or sign {_from_to(state, start, len(state.t))}?"
    _ask_about_change(state, (name,), f"{words} There its numbers turn the ship {how}")


def _ask_for_shaft(state: State, name: str, source: str) -> None:
    """Ask where the numbers of a shaft are at once some 6, 10 or 60 times as many, for the same way of the ship."""
    size = np.abs(state.columns[source])
    way = np.abs(state.chosen.change(state.position))
    turns = np.abs(state.chosen.change(evidence.integrate_rate(state.t, state.columns[source])))
    driven = np.flatnonzero((way > UNDER_WAY * np.median(way)) & (turns > 0.0))
    if len(driven) < SPLITS:
        return
    first, a_metre = state.chosen.first[driven], np.log(turns[driven] / way[driven])
    broken = np.diff(state.t) > evidence.GAP * np.median(np.diff(state.t))
    least, start, more = APART, 0, 0.0
    for row in _unit_change_rows(size, broken):
        before = first < row
        if not LEAST < np.mean(before) < 1 - LEAST:
            continue
        usual, level = (np.array([np.median(of[part]) for part in (before, ~before)]) for of in (size[first], a_metre))
        here = usual if broken[row - 1] else size[row - 1 : row + 1]
        if usual.min() == 0.0 or np.any(here < RUNNING * usual):
            continue
        change, step = level[1] - level[0], np.log(here[1] / here[0])
        of_units = min(OF_UNITS, key=lambda one: abs(change - one))
        near = (NEAR, ROUGHLY) if broken[row - 1] else (ROUGHLY, NEAR)
        left = float(np.mean(np.abs(a_metre - np.where(before, *level)))) / max(abs(change), 1e-9)
        if left < least and abs(change - of_units) < near[0] and abs(step - of_units) < near[1]:
            least, start, more = left, row, float(np.exp(change))
    if start:
        words = f"has {source!r} another unit or sign {_from_to(state, start, len(state.t))}?"
        _ask_about_change(
            state, (name,), f"{words} There its numbers are {more:.2g} times as many for the same way of the ship"
        )


def _unit_change_rows(size: Array, broken: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Rows (K,) whose numbers may be the first of another unit: the `SPLITS` largest steps, and rows behind a pause."""
    low, high = np.minimum(size[:-1], size[1:]), np.maximum(size[:-1], size[1:])
    leaps = np.flatnonzero(~broken & (low > 0.0) & (high > np.exp(min(map(abs, OF_UNITS)) - NEAR) * low))
    leaps = leaps[np.argsort(-(low * high)[leaps], kind="stable")][:SPLITS]
    breaks = np.flatnonzero(broken)
    return 1 + np.union1d(leaps, breaks[:: max(1, len(breaks) // SPLITS)])


def _from_to(state: State, first: int, end: int) -> str:
    if state.joined:
        return "in a part of the files"
    begins, ends = (clock_text(state, float(state.t[row])) for row in (first, min(end, len(state.t) - 1)))
    if end >= len(state.t):
        return f"from {begins} on"
    return f"until {ends}" if first == 0 else f"from {begins} to {ends}"


def _ask_about_change(state: State, about: tuple[str, ...], words: str) -> None:
    remedy = "Write the log in one unit, or cut it there, import the parts and join them (shipid data join)"
    state.changed |= {*about}
    state.ask(about, f"{words}. {remedy}")
