"""A unit, a sign or a frame that a part of a log has alone: a file of a folder, or a stretch of one log."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from shipid.logs.guess import evidence
from shipid.logs.guess.clues import State, unit_in_name
from shipid.logs.guess.defects import clock_text
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.search import senses_of_angle
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.mapping import to_si
from shipid.physics.signals import is_command, is_steering, signal_of

Windows = NDArray[np.bool_]
STRETCHES, FEWEST = 10, 20  # of one log; windows of a file or stretch that decides, at least
SCALED = 0.005  # share of a motion that one scale leaves, at least, where there are two
APART = np.radians(1.0)  # by which the track keeps to a heading more than to a course, at least
UNDER_WAY = 0.4  # of the larger speeds: below, thrust turns a ship as much as an angle does
REMEDY = "Write the log in one unit, or cut it there, import the parts and join them (shipid data join)"


def ask_for_changes(state: State, pause: float) -> None:
    """Ask where a part has another scale or sense than the rest, or a file another frame; `pause` [s] parts files."""
    edges = [0, *(1 + np.flatnonzero(np.diff(state.t) > 0.5 * pause)).tolist(), len(state.t)]
    files = len(edges) > 2
    if not files:
        edges = np.linspace(0, len(state.t), STRETCHES + 1).astype(int).tolist()
    middle = (state.chosen.first + state.chosen.last) // 2
    parts = [(middle >= first) & (middle < end) for first, end in pairwise(edges)]
    _ask_about_scales(state, edges, parts, files)
    _ask_about_senses(state, edges, parts, files)
    if files:
        _ask_about_exchange(state, edges, parts)
    track, heading = state.chosen.change(state.position), np.exp(1j * state.psi[middle])
    psi = next(one.source for one in state.suggestions if one.name == "psi") if files else ""
    for number, part in enumerate(parts if files and not state.astern else ()):
        (misfit, sense), (other, _) = senses_of_angle(track[part], heading[part])
        odd = sense.quarter != 0 or (sense.sign < 0 and other > 2.0 * misfit)
        if odd and misfit < SETTINGS.poor and part.sum() >= FEWEST:
            words = f"{_place_of_parts(state, edges, [number], files)} the track does not keep to {psi!r} as in the"
            words += " others: are its axes, or its heading, others? Then leave it out, and import it alone"
            state.ask(("psi", "north", "east", "latitude", "longitude"), words)


def _ask_about_scales(state: State, edges: list[int], parts: list[Windows], files: bool) -> None:
    """Ask where the integral of velocities, or of a yaw rate, is the motion with another scale than in most parts."""
    sources, change = {one.name: one.source for one in state.suggestions}, state.chosen.change
    relations: list[tuple[tuple[str, ...], list[str], Complex, Complex]] = []
    if state.velocity is not None:
        of = [name for name in ("u", "v", "speed") if name in sources]
        path = evidence.integrate_rate(state.t, state.velocity)
        relations.append(((*of,), [sources[name] for name in of], change(state.position), path))
    for name in [sources["r"]] if "r" in sources else state.called("r")[:1]:
        ran = evidence.integrate_rate(state.t, state.columns[name])
        relations.append((("r",), [name], change(state.psi), ran))
    for about, columns, seen, path in relations:
        odd, ratio = odd_scales(seen, change(path), parts)
        if odd:
            place = _place_of_parts(state, edges, odd, files)
            words = f"has {' and '.join(map(repr, columns))} another unit or sign {place}? There the motion is"
            state.ask(about, f"{words} {ratio:.3g} times as much, beside its integral, as elsewhere. {REMEDY}")


def _ask_about_exchange(state: State, edges: list[int], parts: list[Windows]) -> None:
    """Ask where the track of a file keeps to the heading, and in others to the course."""
    psi = next(one for one in state.suggestions if one.name == "psi")
    middle, track = (state.chosen.first + state.chosen.last) // 2, state.chosen.change(state.position)
    for name in dict.fromkeys([*state.all_called("course"), *state.all_called("psi")]):
        if name == psi.source:
            continue
        turn = to_si(unit_in_name(name, "rad") or psi.unit, "psi")
        ways = np.exp(1j * np.stack([state.psi, turn * state.columns[name]])[:, middle])
        away = np.abs(np.angle(track * np.conj(ways)))
        off = np.array([np.median(away[:, one], axis=1) if one.sum() >= FEWEST else (1.0, 1.0) for one in parts])
        odd = off[:, 0] < 0.5 * off[:, 1] - APART
        if odd.any() and np.any(off[:, 1] < 0.5 * off[:, 0] + APART * (name in state.all_called("course"))):
            place = _place_of_parts(state, edges, np.flatnonzero(odd).tolist(), True)
            words = f"{place} the track keeps to {psi.source!r}, in the others to {name!r}: are they exchanged there"
            state.ask(("psi", "course", "u", "v", "r"), f"{words}? Then import it alone")


def odd_scales(seen: Complex, ran: Complex, parts: list[Windows]) -> tuple[list[int], float]:
    """The parts of the windows (W,) in which seen = scale * ran has another scale than in most; its ratio to theirs."""
    fits = [evidence.fit_without_outliers(seen[one], ran[one]) if one.sum() >= FEWEST else None for one in parts]
    scales = {number: fit.scale for number, fit in enumerate(fits) if fit and fit.left < SETTINGS.two_left}
    usual = sorted(scales.values())[len(scales) // 2] if scales else 0.0
    odd = [one for one, scale in scales.items() if not 1 / SETTINGS.alike < scale / usual < SETTINGS.alike]
    if not odd:
        return [], 1.0
    there = np.any([parts[one] for one in odd], axis=0)
    two = [evidence.fit_scale(seen[rows], ran[rows]) for rows in (there, ~there)]
    motion = [float(np.sum(np.abs(seen[rows]) ** 2)) for rows in (there, ~there)]
    one_left = evidence.fit_scale(seen, ran).left
    left = sum(fit.left * size for fit, size in zip(two, motion, strict=True)) / sum(motion)
    clear = one_left > SCALED and left < SETTINGS.two_left * one_left
    return (odd, two[0].scale / two[1].scale) if clear else ([], 1.0)


def _ask_about_senses(state: State, edges: list[int], parts: list[Windows], files: bool) -> None:
    """Ask where an angle turns the ship, that is under way, to the other side than in most parts."""
    span = state.t[state.chosen.last] - state.t[state.chosen.first]
    speed = np.abs(state.chosen.change(state.position)) / span
    fast = UNDER_WAY * float(np.percentile(speed, 90))
    r = state.r if state.r is not None else np.gradient(state.psi, state.t)
    for one in state.suggestions:
        if not is_command(one.name) or not is_steering(signal_of(one.name)):
            continue
        senses: dict[int, float] = {}
        for number, (part, ends) in enumerate(zip(parts, pairwise(edges), strict=True)):
            if part.sum() < FEWEST or np.median(speed[part]) < fast:
                continue
            rows = slice(*ends)
            effect = evidence.order_effect(state.t[rows], r[rows], state.columns[one.source][rows], state.part)
            if abs(effect) > 2.0 * SETTINGS.seen:
                senses[number] = float(np.sign(effect))
        usual = sum(senses.values()) + 0.5 * state.turning.get(one.source, next(iter(senses.values()), 0.0))
        odd = [number for number, sense in senses.items() if sense * usual < 0.0]
        if odd:
            place = _place_of_parts(state, edges, odd, files)
            words = f"{place} {one.source!r} turns the ship to the other side than elsewhere: has it another sign?"
            state.ask((one.name,), f"{words} Then import it alone")


def _place_of_parts(state: State, edges: list[int], odd: list[int], files: bool) -> str:
    if files:
        return f"in file {' and '.join(str(one + 1) for one in odd)} of {len(edges) - 1}"
    if state.joined:
        return "in a part of the files"
    rows = edges[odd[0]], min(edges[odd[-1] + 1], len(state.t) - 1)
    return "from {} to {}".format(*(clock_text(state, float(state.t[row])) for row in rows))
