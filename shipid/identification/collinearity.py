"""Collinearity of sensitivities: which parameters the data distinguish, and which only in combination.

Columns are scaled to unit length. The collinearity index of a set K is

gamma_K = 1 / sqrt(smallest eigenvalue of S_K^T S_K)

gamma above 10 to 15: the others compensate a change of one parameter to within 1 / gamma. It does not depend on the
noise, so it explains a wide interval and is no criterion by itself.

Source: Brun, Reichert, Kuensch, Water Resources Research 37 (2001) 1015, eq. 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Array
from shipid.document import short_names
from shipid.units import join_names, significant_digits

MOST_COLLINEAR = 15.0  # Brun et al.: "critical" from 10 to 15 on
UNSEEN = 1e-10  # of the largest eigenvalue, with columns of unit length: below it no data, only rounding


@dataclass(frozen=True)
class Combination:
    """A set of parameters of which the data determine only a combination.

    names : short ones. weights : relative change of each factor along the direction that leaves the residuals
    unchanged;
    the largest is 1. gamma : collinearity index; infinite for a parameter without any effect.
    """

    paths: tuple[str, ...]
    names: tuple[str, ...]
    weights: tuple[float, ...]
    gamma: float

    def sentence(self) -> str:
        """One sentence that names the parameters and the unidentified direction."""
        if len(self.names) == 1:
            return f"{self.names[0]} has no effect on these data"
        moves = [
            f"{significant_digits(10 * w, 2, '+')} % of {name}"
            for w, name in zip(self.weights, self.names, strict=True)
        ]
        return f"only {join_names(self.names)} together; {' with '.join(moves)} has no effect on these data"


def collinear_sets(jacobian: Array, paths: Sequence[str]) -> tuple[Combination, ...]:
    """Smallest sets with a collinearity index above `MOST_COLLINEAR`; worst first.

    Backward elimination; the parameter of greatest weight of a set is then excluded, and the search is repeated.
    """
    lengths = np.sqrt((jacobian**2).sum(axis=0))
    silent = np.flatnonzero(lengths <= UNSEEN * lengths.max(initial=0.0)).tolist()
    names = short_names(paths)
    result = [Combination((paths[j],), (names[j],), (1.0,), float("inf")) for j in silent]
    scaled = jacobian / np.where(lengths > 0, lengths, 1.0)
    gram, left = np.asarray(scaled.T @ scaled), [j for j in range(len(paths)) if j not in silent]
    while len(left) > 1 and _collinearity_index(gram, left)[0] > MOST_COLLINEAR:
        chosen = _shrink_set(gram, left)
        gamma, direction = _collinearity_index(gram, chosen)
        weights = direction / lengths[chosen]
        weights = weights / weights[np.argmax(np.abs(weights))]
        labels = tuple(paths[j] for j in chosen), tuple(names[j] for j in chosen)
        result.append(Combination(*labels, tuple(map(float, weights)), gamma))
        left.remove(chosen[int(np.argmax(np.abs(direction)))])
    return tuple(result)


def _shrink_set(gram: Array, members: list[int]) -> list[int]:
    while len(members) > 2:
        without = [[smaller for smaller in members if smaller != gone] for gone in members]
        gammas = [_collinearity_index(gram, smaller)[0] for smaller in without]
        best = int(np.argmax(gammas))
        if gammas[best] <= MOST_COLLINEAR:
            break
        members = without[best]
    return members


def _collinearity_index(gram: Array, members: list[int]) -> tuple[float, Array]:
    """The index, and the unit vector of the smallest eigenvalue of the scaled Gram matrix, of the least effect."""
    values, vectors = np.linalg.eigh(gram[np.ix_(members, members)])
    return float(1 / np.sqrt(max(float(values[0]), UNSEEN))), np.asarray(vectors[:, 0])


def invert_information(information: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Pseudo-inverse (n, n) of an information matrix, and a mask (n,) of parameters along its null directions."""
    scale = np.sqrt(np.diag(information))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    silent = values <= UNSEEN * max(float(values[-1]), UNSEEN)
    kept = vectors[:, ~silent]
    inverse = (kept / values[~silent]) @ kept.T / np.outer(scale, scale)
    return inverse, np.asarray((np.abs(vectors[:, silent]) > np.sqrt(UNSEEN)).any(axis=1))
