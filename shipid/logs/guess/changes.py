"""A unit or a sign that another part of a log has, as where files of two recorders were put together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Array
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State
from shipid.logs.guess.defects import clock_text
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.search import senses_of_angle
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.mapping import to_si
from shipid.physics.signals import is_command, is_shaft, is_steering, signal_of

NODES = 120  # places at which a part may begin or end
NOTHING = 5e-4  # ratio of two scales of a column that stands still
SHAFTS = [np.log(to_si(unit, "propeller.n")) for unit in ("rpm", "rad/s", "rev/s")]
OF_UNITS = np.array([one - other for one in SHAFTS for other in SHAFTS if one != other])  # logarithms of their ratios


@dataclass(frozen=True)
class ScalePart:
    """Windows from `first` until before `end`, and how many times the scale is there what it is elsewhere."""

    first: int
    end: int
    ratio: float


@dataclass(frozen=True)
class Relation:
    """Changes (W,) that are a scale times others: columns of the dataset, of the log, first rows (W,), what is seen."""

    about: tuple[str, ...]
    sources: list[str]
    seen: Complex
    ran: Complex
    rows: NDArray[np.intp]
    what: str


def ask_for_changes(state: State) -> None:
    """Ask where velocities, a yaw rate, an angle or a shaft have another scale to the motion in a part of the log."""
    for one in _relations(state):
        part = other_part(one.seen, one.ran)
        if part is None or (is_shaft(one.about[0]) and not _is_of_units(state, one, part)):
            continue
        rows = np.append(one.rows, len(state.t))
        first, end = int(rows[part.first]) if part.first else 0, int(rows[part.end])
        columns = " and ".join(map(repr, one.sources))
        words = f"has {columns} another unit or sign {_from_to(state, first, end)}? There {one.what.format(part.ratio)}"
        remedy = "Write the log in one unit, or cut it there, import the parts and join them (shipid data join)"
        state.changed |= {*one.about}
        state.ask(one.about, f"{words}. {remedy}")


def ask_about_files(state: State, pause: float) -> None:
    """Ask where a file has another frame, heading or sense of an angle than the others; `pause` [s] parts the files."""
    edges = [0, *(1 + np.flatnonzero(np.diff(state.t) > 0.5 * pause)), len(state.t)]
    middle, track = (state.chosen.first + state.chosen.last) // 2, state.chosen.change(state.position)
    psi = next(one.source for one in state.suggestions if one.name == "psi")
    r = state.r if state.r is not None else np.gradient(state.psi, state.t)
    for number, (first, end) in enumerate(pairwise(edges), 1):
        inside, place = (middle >= first) & (middle < end), f"in file {number} of {len(edges) - 1}"
        if not state.joined or len(edges) < 3 or inside.sum() < 20:
            continue
        (misfit, sense), (other, _) = senses_of_angle(track[inside], np.exp(1j * state.psi[middle[inside]]))
        odd = sense.quarter != 0 or (sense.sign < 0 and other > 2.0 * misfit)
        if odd and misfit < SETTINGS.poor and not state.astern:
            words = (
                f"{place} the track does not keep to {psi!r} as in the others: are its axes, or its heading, others?"
            )
            state.ask(
                ("psi", "north", "east", "latitude", "longitude"), f"{words} Then leave it out, and import it alone"
            )
        for source, sign in state.turning.items():
            rows = slice(first, end)
            signals = state.t[rows], r[rows], state.columns[source][rows]
            effect = evidence.order_effect(*signals, state.part) / SETTINGS.seen
            follows = evidence.order_correlation(*signals, 2 * state.part) / SETTINGS.followed
            if sign * effect < -2 or (abs(effect) < 1 and sign * follows < -2):
                names = tuple(one.name for one in state.suggestions if one.source == source)
                words = f"{place} {source!r} turns the ship to the other side than in the others: has it another sign?"
                state.ask(names, f"{words} Then import it alone")


def _relations(state: State) -> Iterator[Relation]:
    sources = {one.name: one.source for one in state.suggestions}
    chosen, middle = state.chosen, (state.chosen.first + state.chosen.last) // 2
    rates = [sources["r"]] if "r" in sources else state.called("r")[:1]
    beside = "is {:.3g} times as much, beside its integral, as elsewhere"
    if state.velocity is not None:
        about = tuple(name for name in ("u", "v", "speed") if name in sources)
        ran = chosen.change(evidence.integrate_rate(state.t, state.velocity))
        columns = [sources[name] for name in about]
        yield Relation(about, columns, chosen.change(state.position), ran, middle, f"the track {beside}")
    for name in rates:
        ran = chosen.change(evidence.integrate_rate(state.t, state.columns[name]))
        yield Relation(("r",), rates, chosen.change(state.psi), ran, middle, f"the change of the heading {beside}")
    way = np.abs(chosen.change(state.position))
    speed = way / (state.t[chosen.last] - state.t[chosen.first])
    for name, source in sources.items():
        if is_command(name) and is_steering(signal_of(name)):
            under = np.interp(state.t, state.t[chosen.first], speed) > 0.4 * np.percentile(speed, 90)
            if (start := _other_turns(state, state.columns[source], under)) is not None:  # else thrust turns the ship
                ran = np.ones(len(chosen.first), dtype=complex)
                what = "its numbers turn the ship {:.2g} times as fast: to the other side where that is negative"
                yield Relation((name,), [source], np.where(middle < start[0], ran, start[1]), ran, middle, what)
        elif is_command(name) and is_shaft(name):
            turns = np.abs(chosen.change(evidence.integrate_rate(state.t, state.columns[source])))
            driven = (speed > 0.2 * np.median(speed)) & (turns > 0.0)
            what = "the way of the ship is {:.2g} times as much for the same numbers"
            yield Relation((name,), [source], way[driven] + 0j, turns[driven] + 0j, chosen.first[driven], what)


def _other_turns(state: State, order: Array, under_way: NDArray[np.bool_]) -> tuple[int, float] | None:
    """The row from which an order (N,) turns the ship otherwise, and how many times as fast; None where it does not."""
    r = state.r if state.r is not None else np.gradient(state.psi, state.t)
    rows, design, change = evidence.yaw_regression(state.t, r, order, state.part)
    kept = under_way[rows]
    rows, design, change = rows[kept], design[kept], change[kept]
    least, found = SETTINGS.two_left_of_turns * evidence.solve_least_squares(design, change)[2], None
    for row in rows[np.unique(np.linspace(0, len(rows), NODES // 2 + 2).astype(int))[1:-1]]:
        before = np.where(rows < row, design[:, 0], 0.0)
        apart = np.column_stack([before, design[:, 0] - before, design[:, 1:]])
        both, errors, left = evidence.solve_least_squares(apart, change)
        clear = np.all(np.abs(both[:2]) > 2 * SETTINGS.seen * errors[:2])
        if left < least and clear and not 0.05 < both[1] / both[0] < 20.0:  # else the speed is another one
            least, found = left, (int(row), float(both[1] / both[0]))
    return found


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
    possible = np.minimum(share, 1.0 - share) > SETTINGS.least_part
    possible &= np.minimum(of_part, of_rest) > 0.0
    if not possible.any():
        return None
    inside = (cross[None, :] - cross[:, None]) / np.where(possible, of_part, 1.0)
    outside = (cross[-1] - cross[None, :] + cross[:, None]) / np.where(possible, of_rest, 1.0)
    explained = np.where(possible, inside**2 * of_part + outside**2 * of_rest, -np.inf)
    first, end = np.unravel_index(int(np.argmax(explained)), explained.shape)
    one, two = total - cross[-1] ** 2 / power[-1], total - float(explained[first, end])
    ratio = float(inside[first, end] / outside[first, end]) if outside[first, end] else 0.0
    if one < 0.005 * total or two > SETTINGS.two_left * one or not NOTHING < abs(ratio) < 1 / NOTHING:
        return None
    return None if 1 / SETTINGS.alike < ratio < SETTINGS.alike else ScalePart(int(nodes[first]), int(nodes[end]), ratio)


def _is_of_units(state: State, one: Relation, part: ScalePart) -> bool:
    """Whether the numbers of a shaft step where a part begins or ends as the ratio of two units says."""
    size: Array = np.abs(state.columns[one.sources[0]])
    near = float(np.min(np.abs(OF_UNITS + np.log(abs(part.ratio)))))
    for edge in (part.first, part.end):
        row = int(one.rows[min(edge, len(one.rows) - 1)])
        about = size[max(row - 40, 0) : row + 40]
        steps = np.abs(np.diff(np.log(np.maximum(about, 1e-3 * about.max())))) if about.max() > 0 else np.zeros(1)
        if 0 < edge < len(one.rows) and near < 0.3 and np.min(np.abs(steps.max() - np.abs(OF_UNITS))) < 0.4:
            return True
    return False


def _from_to(state: State, first: int, end: int) -> str:
    if state.joined:
        return "in a part of the files"
    begins, ends = (clock_text(state, float(state.t[row])) for row in (first, min(end, len(state.t) - 1)))
    if end >= len(state.t):
        return f"from {begins} on"
    return f"until {ends}" if first == 0 else f"from {begins} to {ends}"
