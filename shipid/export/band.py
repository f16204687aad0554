"""The band of a predictor as a graph of blocks, with the arithmetic of `shipid.hybrid.bands`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from casadi import MX, SX

from shipid.export.blocks import Block, Formula, Graph, Nearest, Precision, formula
from shipid.hybrid.bands import LEVELS, Bands

Array = np.ndarray
CHOICE = ("level", "pointwise", "kind")
"""Inputs of a band: its level, whether each step is taken alone (0 or 1), the kind of manoeuvre (0: any)."""
COLUMNS = ("along", "across", "ahead_x", "ahead_y")
"""Outputs of a band for each step: half axes [m], and the unit vector of the track in body axes."""


@dataclass(frozen=True, eq=False)
class Radii(Block):
    """(level, pointwise, kind) -> radius of a band for each of T steps, by linear interpolation in tables.

    whole : (1 + kinds, 99) for `LEVELS`, of whole paths: of all kinds, then of each. steps : (99, T) of steps alone.
    """

    whole: Array
    steps: Array
    name: str = "radii"

    @property
    def inputs(self) -> tuple[tuple[str, int], ...]:  # type: ignore[override]
        """Three numbers."""
        return tuple((name, 1) for name in CHOICE)

    @property
    def size(self) -> int:  # type: ignore[override]
        """Number of steps T."""
        return int(self.steps.shape[1])

    @cached_property
    def function(self) -> ca.Function:
        """Each table times a weight that is 1 at its place and 0 at the next ones."""
        level, pointwise, kind = (MX.sym(name) for name in CHOICE)
        near = ca.fmax(0, 1 - ca.fabs(100 * level - ca.DM(100 * LEVELS)))
        of = ca.fmax(0, 1 - ca.fabs(kind - ca.DM(np.arange(len(self.whole)))))
        whole = ca.repmat(ca.dot(of, ca.mtimes(ca.DM(self.whole), near)), self.size, 1)
        steps = ca.mtimes(ca.DM(self.steps.T), near)
        radii = ca.if_else(pointwise != 0, steps, whole)
        return ca.Function(self.name, [level, pointwise, kind], [radii], list(CHOICE), ["out"])

    def numbers(self) -> int:
        """Entries of the tables."""
        return int(self.whole.size + self.steps.size)

    def statements(self, call: dict[int, str], precision: Precision) -> list[str]:  # noqa: ARG002
        """Tables, and the two levels beside the one that is asked for."""
        last, steps = len(LEVELS) - 1, self.size
        return [
            f"static const real whole[{self.whole.size}] = {{{precision.table(self.whole)}}};",
            f"static const real steps[{self.steps.size}] = {{{precision.table(self.steps)}}};",
            "real place = 100 * level[0] - 1, share;",
            "int i, lower, upper;",
            f"if (!(place <= {last})) place = {last};",
            "if (!(place >= -1)) place = -1;",
            "lower = place < 0 ? -1 : (int)place;",
            f"upper = lower < {last} ? lower + 1 : {last};",
            "share = place - (real)lower;",
            f"for (i = 0; i < {steps}; ++i) {{",
            f"    const real *table = pointwise[0] != 0 ? steps + i : whole + {last + 1} * (int)kind[0];",
            f"    const int apart = pointwise[0] != 0 ? {steps} : 1;",
            "    const real below = lower < 0 ? 0 : table[lower * apart];",
            "    out[i] = below + share * (table[upper * apart] - below);",
            "}",
        ]


def radii(bands: Bands) -> Radii:
    """The radii of some bands."""
    return Radii(np.vstack([bands.whole[None], bands.by_kind.reshape(-1, len(LEVELS))]), bands.steps)


def band_graph(bands: Bands, now: Sequence[str], step: float, radius: Radii) -> Graph:
    """(now, path, level, pointwise, kind) -> a row of `COLUMNS` for each step, one after the other.

    Parameters
    ----------
    now : names of the entries measured at the instant, with r and the columns of the distance among them.
    step : of the path [s]. radius : `radii(bands)`.
    """
    horizon, graph = len(bands.along), Graph("band")
    measured, path = graph.input("now", len(now)), graph.input("path", 2 * horizon)
    chosen = [graph.input(name, 1) for name in CHOICE]
    origin = graph.constant([0.0, 0.0])
    places = [now.index(name) for name in bands.names]
    point = graph.call(_point(len(now), places, bands), measured)
    away = graph.call(Nearest(bands.centres / bands.spread), point)
    marks = [-(-horizon * part // 3) - 1 for part in (1, 2, 3)]
    points = graph.pack(*(path[2 * mark : 2 * mark + 2] for mark in marks))
    rate = measured[now.index("r")]
    growth = graph.call(_growth(bands, step, horizon), points, rate, away)
    first = graph.pack(origin, path[: 2 * horizon - 2])
    after = graph.pack(path[2:], path[2 * horizon - 2 :])
    chords = graph.map(_chord(), [first, after], [], horizon)
    greatest = graph.scan(_greatest(), origin[0], [chords], [], horizon)[horizon - 1]
    scales = [graph.constant(bands.along), graph.constant(bands.across), graph.call(radius, *chosen)]
    return graph.finish(graph.map(_row(), [chords, *scales], [greatest, growth], horizon))


def _point(size: int, places: Sequence[int], bands: Bands) -> Formula:
    """Measured columns, each divided by its unit of distance."""
    now = SX.sym("now", size)
    return formula("point", [("now", now)], [now[place] / bands.spread[i] for i, place in enumerate(places)])


def _growth(bands: Bands, step: float, horizon: int) -> Formula:
    """(Three points, r, distance) -> `Bands.growth`."""
    points, r, nearest = SX.sym("points", 6), SX.sym("r"), SX.sym("away")
    away = nearest / np.sqrt(bands.centres.shape[1])
    x = [points[0], points[2] - points[0], points[4] - points[2]]
    y = [points[1], points[3] - points[1], points[5] - points[3]]
    length = sum(ca.sqrt(x[k] ** 2 + y[k] ** 2) for k in range(3))
    cross = [x[k] * y[k + 1] - y[k] * x[k + 1] for k in range(2)]
    dot = [x[k] * x[k + 1] + y[k] * y[k + 1] for k in range(2)]
    first, second = (ca.atan2(cross[k], ca.if_else(dot[k] == 0, 0, dot[k])) for k in range(2))  # 0 and not -0
    held = r * step * horizon * 2 / 3
    traits = ca.vertcat(
        ca.log(length / bands.length + 0.02),
        ca.fabs(first + second),
        ca.fabs(second - first),
        ca.fmin(ca.fabs(first + second - held), np.pi),
        ca.log(1 + ca.fmin(away, bands.far)),
    )
    seen = ca.fmin(ca.fmax(traits, ca.DM(bands.low)), ca.DM(bands.high))
    harder = ca.dot((seen - ca.DM(bands.middle)) / ca.DM(bands.deviation), ca.DM(bands.slopes))
    grown = ca.exp(harder) * ca.fmax(away / bands.far, 1)
    return formula("growth", [("points", points), ("r", r), ("away", nearest)], grown)


def _chord() -> Formula:
    """(Point before, point after) -> what lies between, and its length."""
    before, after = SX.sym("before", 2), SX.sym("after", 2)
    x, y = after[0] - before[0], after[1] - before[1]
    return formula("chord", [("before", before), ("after", after)], [x, y, ca.sqrt(x**2 + y**2)])


def _greatest() -> Formula:
    """The greatest length of the chords so far."""
    so_far, chord = SX.sym("so_far"), SX.sym("chord", 3)
    return formula("greatest", [("so_far", so_far), ("chord", chord)], ca.fmax(so_far, chord[2]))


def _row() -> Formula:
    """A row of `COLUMNS`; the track goes ahead where a path does not move."""
    chord, greatest, growth = SX.sym("chord", 3), SX.sym("greatest"), SX.sym("growth")
    along, across, radius = SX.sym("along"), SX.sym("across"), SX.sym("radius")
    moves = chord[2] > 1e-12 * greatest
    size = ca.if_else(moves, chord[2], 1)
    ahead = [ca.if_else(moves, chord[0] / size, 1), ca.if_else(moves, chord[1] / size, 0)]
    given = [("chord", chord), ("along", along), ("across", across), ("radius", radius)]
    given += [("greatest", greatest), ("growth", growth)]
    return formula("row", given, [along * radius * growth, across * radius * growth, *ahead])
