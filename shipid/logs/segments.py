"""Cut a recording into manoeuvres: zigzags, turnings, speed runs and transits, by helm, heading and shaft speed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Array, Dataset, stretches_of_runs
from shipid.logs.kinds import MIXED
from shipid.logs.mapping import Segment
from shipid.physics.signals import drive_scale, is_steering

HELM = np.radians(3.0)  # rad: less is steering a course
TURN = np.radians(120.0)  # rad of heading over one helm: a turning, not a leg of a zigzag
LEAD, FEWEST_LEGS = 10.0, 3  # s before the first order; legs of a zigzag
SHORT, LONGEST_PAUSE = 4.0, 0.6  # s; of the leg before: helm amidships for longer ends a zigzag
STRAIGHT = 60.0  # s
CHANGE = 0.12  # of the shaft speed: a speed run


@dataclass(frozen=True)
class Leg:
    """Rows first to last with the helm on one side: 1, -1, or 0 amidships."""

    side: int
    first: int
    last: int


def find_manoeuvres(dataset: Dataset, unit: float = 1.0, *, files: bool = False) -> list[Segment]:
    """Manoeuvres of every run in the order of time, with names that are unique; a draft for a person to correct.

    unit : of the log's clock [s], in which starts and ends are given. files : whether each run is a file of several.
    """
    counts: dict[str, int] = {}
    segments = []
    for run, rows in stretches_of_runs(dataset):
        t, file = rows["t"].to_numpy() / unit, run if files else None
        for kind, (first, last) in _of_stretch(rows):
            counts[kind] = counts.get(kind, 0) + 1
            named: Any = {"run": f"{kind} {counts[kind]}", "file": file, "manoeuvre": kind}
            segments.append(Segment(start=float(t[first]), end=float(t[last]), **named))
    return segments


def run_kind(rows: pd.DataFrame) -> str:
    """The kind of manoeuvre that takes more than half of a run; mixed where none does."""
    t = rows["t"].to_numpy()
    spans = {MIXED: (t[-1] - t[0]) / 2}
    for kind, (first, last) in _of_stretch(rows):
        spans[kind] = spans.get(kind, 0.0) + t[last] - t[first]
    return max(spans, key=lambda kind: spans[kind])


def _of_stretch(rows: pd.DataFrame) -> Iterator[tuple[str, tuple[int, int]]]:
    """Yield the kind, and the first and last row, of every manoeuvre in one unbroken stretch."""
    t, psi = rows["t"].to_numpy(), np.unwrap(rows["psi"].to_numpy())
    if len(t) < 3:
        return
    legs = _helm_legs(_steering_angle(rows), t)
    index, start = 0, 0
    while index < len(legs):
        leg = legs[index]
        size = _zigzag_length(legs[index:], psi, t)
        if size:
            kind, last = "zigzag", legs[index + size - 1].last
            index += size
        elif leg.side and abs(psi[leg.last] - psi[leg.first]) >= TURN:
            kind, last = "turning", leg.last
            index += 1
        else:
            index += 1
            continue
        first = max(start, int(np.searchsorted(t, t[leg.first] - LEAD)))
        yield from _between_manoeuvres(rows, start, first)
        yield kind, (first, last)
        start = last
    yield from _between_manoeuvres(rows, start, len(t) - 1)


def _steering_angle(rows: pd.DataFrame) -> Array:
    """Mean steering angle [rad], about its median in the straightest rows; yaw rate in its place if none is logged."""
    names = [name for name in map(str, rows.columns) if is_steering(name)]
    if not names:
        r = rows["r"].to_numpy()
        return np.asarray(r / max(float(np.percentile(np.abs(r), 95)), 1e-9) * 4 * HELM)
    helm = rows[names].to_numpy().mean(axis=1)
    small = helm[np.abs(helm) < HELM]
    return np.asarray(helm - (np.median(small) if len(small) else 0.0))


def _helm_legs(helm: Array, t: Array) -> list[Leg]:
    """The stretches with the helm on one side; stretches of less than a few seconds join the one before."""
    side = np.where(np.abs(helm) >= HELM, np.sign(helm), 0.0).astype(int)
    short = min(SHORT, (t[-1] - t[0]) / 50)
    legs: list[Leg] = []
    edges = [0, *(np.flatnonzero(np.diff(side)) + 1), len(side)]
    for first, end in pairwise(edges):
        last = min(end, len(t) - 1)
        if legs and (t[last] - t[first] < short or legs[-1].side == side[first]):
            legs[-1] = Leg(legs[-1].side, legs[-1].first, last)
        else:
            legs.append(Leg(int(side[first]), int(first), int(last)))
    return legs


def _zigzag_length(legs: list[Leg], psi: Array, t: Array) -> int:
    """How many legs from here on are one zigzag, helm from side to side, only briefly amidships; 0 if none."""
    sides: list[Leg] = []
    size = 0
    for index, leg in enumerate(legs):
        long = t[leg.last] - t[leg.first]
        if leg.side == 0:
            if not sides or long > LONGEST_PAUSE * (t[sides[-1].last] - t[sides[-1].first]):
                break
            continue
        if abs(psi[leg.last] - psi[leg.first]) >= TURN or (sides and leg.side == sides[-1].side):
            break
        sides.append(leg)
        size = index + 1
    return size if len(sides) >= FEWEST_LEGS else 0


def _between_manoeuvres(rows: pd.DataFrame, first: int, last: int) -> Iterator[tuple[str, tuple[int, int]]]:
    """The part between manoeuvres: a speed run if the shaft changes speed, else a transit; nothing if short."""
    t = rows["t"].to_numpy()
    if t[last] - t[first] < min(STRAIGHT, 0.5 * (t[-1] - t[0])):
        return
    part = rows.iloc[first : last + 1]
    shafts = [name for name in map(str, rows.columns) if drive_scale(name)]
    # The speed through the water is no sign where shafts are logged: it changes after every turn, too.
    watched = part[shafts or ["u"]].to_numpy()
    low, high = np.quantile(watched, (0.02, 0.98), axis=0)
    usual = np.maximum(np.median(np.abs(watched), axis=0), 1e-9)
    moved = bool((high - low > CHANGE * usual).any())
    yield ("speed run" if moved else "transit"), (first, last)
