"""Lines of equal value over a grid of cells, drawn only where all corners have a value."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np

from shipid.report.content import Floats

Node = tuple[int, int]
Edge = frozenset[Node]
FEWEST = 6.0  # times the radius: rows or columns that are enough to smooth, else the bell reaches over all of them
NICE = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)  # digits that a contour may have


def nice_levels(values: Floats, most: int) -> list[float]:
    """At most `most` round levels inside the middle nine tenths of the finite values."""
    finite = values[np.isfinite(values) & (values > 0)]
    if finite.size < 4:
        return []
    low, high = np.quantile(finite, [0.05, 0.95])
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    inside = [digit * 10.0**decade for decade in decades for digit in NICE if low < digit * 10.0**decade < high]
    chosen = np.linspace(0, len(inside) - 1, min(most, len(inside))).round().astype(int)
    return [inside[i] for i in chosen]


def smoothed(values: Floats, radius: tuple[float, float]) -> Floats:
    """Positive values (m, n), each the geometric mean of its neighbours under a bell of `radius` rows and columns.

    Values that are not finite stay so and have no weight. A grid with fewer rows or columns than six radii is not
    smoothed along them.
    """
    finite = np.isfinite(values) & (values > 0)
    total, weight = np.where(finite, np.log(np.where(finite, values, 1.0)), 0.0), finite.astype(float)
    for axis, width in enumerate(radius):
        count = values.shape[axis]
        if count < FEWEST * width:
            continue
        distance = np.subtract.outer(np.arange(count), np.arange(count))
        bell = np.exp(-((distance / width) ** 2) / 2)
        total, weight = (np.moveaxis(np.tensordot(bell, part, (1, axis)), 0, axis) for part in (total, weight))
    mean = np.exp(total / np.where(weight > 0, weight, 1.0))
    return np.where(finite, mean, np.nan)


def contour(x: Floats, y: Floats, values: Floats, level: float) -> list[Floats]:
    """Follow a level through a grid, linear between neighbours: each cell of the grid is two triangles.

    Parameters
    ----------
    x, y : (n,) columns and (m,) rows, rising.
    values : (m, n); a triangle with a corner that is not finite carries no line.
    level : value to follow.

    Returns
    -------
    Pieces (k, 2) of x, y; a closed one ends where it began.
    """
    links: dict[Edge, list[Edge]] = {}
    for corners in _triangles(len(y), len(x)):
        heights = [values[node] for node in corners]
        if not np.isfinite(heights).all():
            continue
        sides = [(corners[i], corners[(i + 1) % 3]) for i in range(3)]
        crossed = [frozenset((a, b)) for a, b in sides if (values[a] >= level) != (values[b] >= level)]
        if len(crossed) == 2:
            links.setdefault(crossed[0], []).append(crossed[1])
            links.setdefault(crossed[1], []).append(crossed[0])
    return [np.array([_crossing(edge, x, y, values, level) for edge in piece]) for piece in _chains(links)]


def _triangles(rows: int, columns: int) -> list[tuple[Node, Node, Node]]:
    triangles = []
    for i, j in product(range(rows - 1), range(columns - 1)):
        a, b, c, d = (i, j), (i, j + 1), (i + 1, j), (i + 1, j + 1)
        triangles += [(a, b, d), (a, d, c)]
    return triangles


def _crossing(edge: Edge, x: Floats, y: Floats, values: Floats, level: float) -> tuple[float, float]:
    (i, j), (k, n) = edge
    share = (level - values[i, j]) / (values[k, n] - values[i, j])
    return float(x[j] + share * (x[n] - x[j])), float(y[i] + share * (y[k] - y[i]))


def _chains(links: dict[Edge, list[Edge]]) -> list[list[Edge]]:
    """Join segments end to end; open pieces start at an end, closed ones return to their start."""
    left = {frozenset((a, b)) for a, others in links.items() for b in others}
    pieces = []
    # Ends first: what is left after them is closed.
    for start in sorted(links, key=lambda edge: len(links[edge])):
        piece = [start]
        while True:
            onward = [other for other in links[piece[-1]] if frozenset((piece[-1], other)) in left]
            if not onward:
                break
            left.remove(frozenset((piece[-1], onward[0])))
            piece.append(onward[0])
        if len(piece) > 1:
            pieces.append(piece)
    return pieces


def length(piece: Floats) -> float:
    """Length of a broken line, in the unit of its points."""
    return float(sum(np.linalg.norm(b - a) for a, b in pairwise(piece)))
