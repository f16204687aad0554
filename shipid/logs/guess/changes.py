"""A unit, a sign or a frame that a part of a log has alone: a file of a folder, or a stretch of one log."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.lapses import clock_text
from shipid.logs.guess.search import senses_of_angle
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.guess.words import unit_in_name
from shipid.logs.mapping import to_si
from shipid.physics.signals import is_command, is_steering

Windows = NDArray[np.bool_]
Change = tuple[tuple[str, ...], str, list[int]]
"""Columns that it is about, a sentence with a place for where it is, and numbers of the parts."""
STRETCHES, FEWEST = 10, 20  # of one log; windows of a file or stretch that decides, at least
CLEAR = 4.0  # times the misfit of the better unit, that the other leaves at least
SCALED = 0.005  # share of a motion that one scale leaves, at least, where there are two
APART = np.radians(1.0)  # by which the track keeps to a heading more than to a course, at least
UNDER_WAY = 0.4  # of the larger speeds: below, thrust turns a ship as much as an angle does


def ask_for_changes(state: State, pause: float) -> None:
    """Ask where a part has another scale or sense than the rest, or a file another frame; `pause` [s] parts files."""
    edges = [0, *(1 + np.flatnonzero(np.diff(state.t) > 0.5 * pause)).tolist(), len(state.t)]
    files = len(edges) > 2
    if not files:
        edges = np.linspace(0, len(state.t), STRETCHES + 1).astype(int).tolist()
    middle = (state.chosen.first + state.chosen.last) // 2
    parts = [(middle >= first) & (middle < end) for first, end in pairwise(edges)]
    changes = [*_other_units_of_heading(state, parts)] or [*_other_scales(state, parts)]
    changes += _other_senses(state, parts, edges)
    changes += [*_course_as_heading(state, parts, middle), *_other_axes(state, parts, middle)] if files else []
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
            yield about, f"{words} in one unit, or cut it there, import the parts and join them (shipid data join)", odd


def odd_scales(seen: Complex, ran: Complex, parts: list[Windows]) -> tuple[list[int], float]:
    """The parts of the windows (W,) in which seen = scale * ran has another scale than in most; its ratio to theirs."""
    fits = [evidence.fit_without_outliers(seen[one], ran[one]) if one.sum() >= FEWEST else None for one in parts]
    scales = {number: fit.scale for number, fit in enumerate(fits) if fit and fit.left < SETTINGS.two_left}
    usual = sorted(scales.values())[len(scales) // 2] if scales else 0.0
    odd = [one for one, scale in scales.items() if not 1 / SETTINGS.alike < scale / usual < SETTINGS.alike]
    if not odd:
        return [], 1.0
    both = [np.any([parts[one] for one in of], axis=0) for of in (odd, scales.keys() - {*odd})]  # no part that is mixed
    two = [evidence.fit_scale(seen[rows], ran[rows]) for rows in both]
    motion = [float(np.sum(np.abs(seen[rows]) ** 2)) for rows in both]
    one_left = evidence.fit_scale(seen[both[0] | both[1]], ran[both[0] | both[1]]).left
    left = sum(fit.left * size for fit, size in zip(two, motion, strict=True)) / sum(motion)
    clear = one_left > SCALED and left < SETTINGS.two_left * one_left
    return (odd, two[0].scale / two[1].scale) if clear else ([], 1.0)


def _other_units_of_heading(state: State, parts: list[Windows]) -> Iterator[Change]:
    """Yield where the track turns with a heading in degrees, while elsewhere it turns with one in radians."""
    psi = next((one.source for one in state.suggestions if one.name == "psi"), None)
    values = state.columns.get(psi or "", 0.0 * state.t)[state.chosen.first]
    track, ways = state.chosen.change(state.position), (np.exp(1j * values * to_si("deg", "psi")), np.exp(1j * values))
    kinds: tuple[list[int], list[int]] = [], []
    for number, part in enumerate(parts):
        degrees, radians = (senses_of_angle(track[part], way[part])[0][0] for way in ways)
        good, bad = sorted((degrees, radians))
        in_radians = radians < degrees and bool(np.abs(values[part]).max(initial=0.0) < 3 * np.pi)
        if part.sum() >= FEWEST and good < SETTINGS.poor and bad > max(CLEAR * good, SETTINGS.spread):
            kinds[in_radians].append(number)
    if all(kinds):
        words = f"is {psi!r} in radians {{}}, and elsewhere in degrees, as the track turns? Then write it in one"
        yield ("psi",), f"{words} unit, or cut it there, import the parts and join them (shipid data join)", kinds[True]


def _course_as_heading(state: State, parts: list[Windows], middle: NDArray[np.intp]) -> Iterator[Change]:
    """Yield where the track of a file keeps to the heading, and in others to the course."""
    psi = next(one for one in state.suggestions if one.name == "psi")
    track, courses = state.chosen.change(state.position), state.all_called("course")
    for name in dict.fromkeys([*courses, *state.all_called("psi")]):
        turn = to_si(unit_in_name(name, "rad") or psi.unit, "psi")
        ways = np.exp(1j * np.stack([state.psi, turn * state.columns[name]])[:, middle])
        away = np.abs(np.angle(track * np.conj(ways)))
        off = np.array([np.median(away[:, one], axis=1) if one.sum() >= FEWEST else (1.0, 1.0) for one in parts])
        odd = np.flatnonzero(off[:, 0] < 0.5 * off[:, 1] - APART).tolist()
        if name != psi.source and odd and np.any(off[:, 1] < 0.5 * off[:, 0] + APART * (name in courses)):
            words = f"{{}} the track keeps to {psi.source!r}, in the others to {name!r}: are they exchanged there"
            yield ("psi", "course", "u", "v", "r"), f"{words}? Then import it alone", odd


def _other_axes(state: State, parts: list[Windows], middle: NDArray[np.intp]) -> Iterator[Change]:
    """Yield each file whose track keeps to the heading with other axes, or another sense, than in the others."""
    track, heading = state.chosen.change(state.position), np.exp(1j * state.psi[middle])
    psi = next(one.source for one in state.suggestions if one.name == "psi")
    for number, part in enumerate(parts if not state.astern else ()):
        (misfit, sense), (other, _) = senses_of_angle(track[part], heading[part])
        odd = sense.quarter != 0 or (sense.sign < 0 and other > 2.0 * misfit)
        if odd and misfit < SETTINGS.poor and part.sum() >= FEWEST:
            words = f"{{}} the track does not keep to {psi!r} as in the others: are its axes, or its heading, others?"
            about = "psi", "north", "east", "latitude", "longitude"
            yield about, f"{words} Then leave it out, and import it alone", [number]


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
                effect = evidence.order_effect(state.t[rows], r[rows], state.columns[one.source][rows], state.part)
                senses |= {number: float(np.sign(effect))} if abs(effect) > 2.0 * SETTINGS.seen else {}
        usual = sum(senses.values()) + 0.5 * state.turning.get(one.source, next(iter(senses.values()), 0.0))
        odd = [number for number, sense in senses.items() if sense * usual < 0.0]
        if odd:
            words = f"{{}} {one.source!r} turns the ship to the other side than elsewhere: has it another sign?"
            yield (one.name,), f"{words} Then import it alone", odd
