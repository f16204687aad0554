"""A unit, a sign or a frame that a part of a log has alone: a file of a folder, or a stretch of one log."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.lapses import clock_text
from shipid.logs.guess.search import WAYS, Sense, senses_by_quarters, senses_of_angle
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.mapping import to_si
from shipid.physics.signals import is_command, is_steering

Windows = NDArray[np.bool_]
Change = tuple[tuple[str, ...], str, list[int]]
"""Columns that it is about, a sentence with a place for where it is, and numbers of the parts."""
STRETCHES, FEWEST = 10, 20  # of one log; windows of a file or stretch that decides, at least
CLEAR = 4.0  # times the misfit of the better reading, that the usual one leaves at least
SCALED = 0.005  # share of a motion that one scale leaves, at least, where there are two
APART = 1.5e-4  # 1 - cos(1 deg): by which the track keeps more to another reading, at least
UNDER_WAY = 0.4  # of the larger speeds: below, thrust turns a ship as much as an angle does


def ask_for_changes(state: State, pause: float) -> None:
    """Ask where a part has another scale or sense than the rest, or a file another frame; `pause` [s] parts files."""
    edges = [0, *(1 + np.flatnonzero(np.diff(state.t) > 0.5 * pause)).tolist(), len(state.t)]
    files = len(edges) > 2
    if not files:
        edges = np.linspace(0, len(state.t), STRETCHES + 1).astype(int).tolist()
    middle = (state.chosen.first + state.chosen.last) // 2
    parts = [(middle >= first) & (middle < end) for first, end in pairwise(edges)]
    changes = [*_other_readings(state, parts, middle, files)] or [*_other_scales(state, parts)]
    changes += _other_senses(state, parts, edges)
    for about, words, odd in changes:
        ends = edges[odd[0]], min(edges[odd[-1] + 1], len(state.t) - 1)
        place = f"from {' to '.join(clock_text(state, float(state.t[row])) for row in ends)}"
        if files:
            place = f"in file {' and '.join(str(one + 1) for one in odd)} of {len(parts)}"
        elif state.joined:
            place = "in a part of the files"
        state.ask(about, words.replace("{}", place))


def _other_scales(state: State, parts: list[Windows]) -> Iterator[Change]:
    """Yield where the integral of velocities, or of a yaw rate, is the motion with another scale than in most parts."""
    sources = {one.name: one.source for one in state.suggestions}
    relations: list[tuple[tuple[str, ...], NDArray[Any], NDArray[Any]]] = []
    if state.velocity is not None:
        relations.append((tuple(sources.keys() & {"u", "v", "speed"}), state.position, state.velocity))
    for name in [sources["r"]] if "r" in sources else state.called("r")[:1]:
        sources["r"] = name
        relations.append((("r",), state.psi, state.columns[name]))
    for about, motion, rate in relations:
        seen, ran = map(state.chosen.change, (motion, evidence.integrate_rate(state.t, rate)))
        odd, ratio = odd_scales(seen, ran, parts)
        if odd:
            words = f"has {' and '.join(repr(sources[name]) for name in sorted(about))} another unit or sign {{}}?"
            words += f" There the motion is {ratio:.3g} times as much, beside its integral, as elsewhere. Write the log"
            yield about, f"{words} in one unit, or cut it there", odd


def odd_scales(seen: Complex, ran: Complex, parts: list[Windows]) -> tuple[list[int], float]:
    """The parts of the windows (W,) in which seen = scale * ran has another scale than in most; its ratio to theirs."""
    fits = [evidence.fit_without_outliers(seen[one], ran[one]) if one.sum() >= FEWEST else None for one in parts]
    scales = {number: fit.scale for number, fit in enumerate(fits) if fit and fit.left < SETTINGS.named_left}
    usual = sorted(scales.values())[len(scales) // 2] if scales else 0.0
    alike = float(np.exp(SETTINGS.alike_left))
    odd = [one for one, scale in scales.items() if not 1 / alike < scale / usual < alike]
    if not odd:
        return [], 1.0
    both = [np.any([parts[one] for one in of], axis=0) for of in (odd, scales.keys() - {*odd})]  # no part that is mixed
    two = [evidence.fit_scale(seen[rows], ran[rows]) for rows in both]
    motion = [float(np.sum(np.abs(seen[rows]) ** 2)) for rows in both]
    one_left = evidence.fit_scale(seen[both[0] | both[1]], ran[both[0] | both[1]]).left
    left = sum(fit.left * size for fit, size in zip(two, motion, strict=True)) / sum(motion)
    clear = one_left > SCALED and left < SETTINGS.named_left * one_left
    return (odd, two[0].scale / two[1].scale) if clear else ([], 1.0)


def _other_readings(state: State, parts: list[Windows], middle: NDArray[np.intp], files: bool) -> Iterator[Change]:
    """Yield where the track keeps to the heading in another unit than in most parts.

    In files also by another sense, or to another column.
    """
    psi = next(one.source for one in state.suggestions if one.name == "psi")
    sure = [number for number, part in enumerate(parts) if part.sum() >= FEWEST]
    track, left = state.chosen.change(state.position), dict[tuple[str, str, Sense | None], list[float]]()
    for name in dict.fromkeys([psi, *[*state.all_called("course"), *state.all_called("psi")] * files]):
        for unit, part in product(("deg", "rad"), (parts[number] for number in sure)):
            seen, way = track[part], np.exp(1j * to_si(unit, "psi") * state.columns[name][middle[part]])
            for misfit, sense in senses_by_quarters(seen, way) if files else [(senses_of_angle(seen, way)[0][0], None)]:
                left.setdefault((name, unit, sense), []).append(misfit)
    own = {f"{psi!r} {_sense_in_words(*key[1:])}": np.array(one) for key, one in left.items() if key[0] == psi}
    every = {repr(name): np.min([left[key] for key in left if key[0] == name], axis=0) for name, *_ in left}
    for about, kinds, remedy in (
        (("psi", "north", "east", "latitude", "longitude"), own, "has it, or have the axes, another unit or sense"),
        (("psi", "course", "u", "v", "r"), every, "are they exchanged"),
    ):
        usual = min(kinds, key=lambda one: float(np.median(kinds[one])), default="")
        best = [min(kinds, key=lambda one: kinds[one][place]) for place in range(len(sure))]
        least = np.array([kinds[one][place] for place, one in enumerate(best)])
        odd = np.flatnonzero((kinds.get(usual, least) > CLEAR * least + APART) & (least < SETTINGS.poor))
        if len(odd):
            words = (
                f"{{}} the track keeps to {best[odd[0]]}, elsewhere to {usual}: {remedy} there? Then import it alone"
            )
            yield about, words, [sure[place] for place in odd]


def _sense_in_words(unit: str, sense: Sense | None) -> str:
    side = "starboard" if sense is None or sense.sign > 0 else "port"
    return f"in {unit}" + (f" to {side} from {WAYS[sense.quarter % 4]}" if sense else "")


def _other_senses(state: State, parts: list[Windows], edges: list[int]) -> Iterator[Change]:
    """Yield where an angle turns the ship, that is under way, to the other side than in most parts."""
    span = state.t[state.chosen.last] - state.t[state.chosen.first]
    speed = np.abs(state.chosen.change(state.position)) / span
    fast = UNDER_WAY * float(np.percentile(speed, 90))
    r = state.r if state.r is not None else np.gradient(state.psi, state.t)
    for one in (one for one in state.suggestions if is_command(one.name) and is_steering(one.name)):
        senses: dict[int, float] = {}
        for number, (part, ends) in enumerate(zip(parts, pairwise(edges), strict=True)):
            rows = slice(*ends)
            if part.sum() >= FEWEST and np.median(speed[part]) >= fast:
                order = state.columns[one.source][None, rows]
                effect = float(evidence.order_effects(state.t[rows], r[rows], order, state.part)[0])
                senses |= {number: float(np.sign(effect))} if abs(effect) > 2.0 * SETTINGS.seen else {}
        usual = sum(senses.values()) + 0.5 * state.turning.get(one.source, next(iter(senses.values()), 0.0))
        odd = [number for number, sense in senses.items() if sense * usual < 0.0]
        if odd:
            words = f"{{}} {one.source!r} turns the ship to the other side than elsewhere: has it another sign?"
            yield (one.name,), f"{words} Then import it alone", odd
