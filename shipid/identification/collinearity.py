"""Which parameters a set of sensitivities can tell apart, and which only together.

Columns are scaled to unit length, as both sources ask, so that nothing depends on units. Then

    gamma_K = 1 / sqrt(smallest eigenvalue of S_K^T S_K)      collinearity index of a set K (Brun et al. 2001, eq. 10)
    eta_k   = largest / k-th singular value of S              condition index (Belsley, Kuh, Welsch 1980, ch. 3)
    pi_kj   = (V_jk / s_k)^2 / sum_k (V_jk / s_k)^2           share of the variance of parameter j that comes from k

gamma above 10 to 15: a change of one parameter is made good to within 1 / gamma by the others. eta above 30 with two
shares above 0.5: a dependency that harms. Neither knows the noise: parameters may be collinear and still be found, from
data that are many or good enough; so these explain an interval that is too wide, they do not judge alone.

Sources: Brun, Reichert, Kuensch, Water Resources Research 37 (2001) 1015; Belsley, Kuh, Welsch, Regression Diagnostics
(1980), ch. 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_COLLINEAR = 15.0  # Brun et al.: "critical" from 10 to 15 on
MOST_CONDITION = 30.0  # Belsley et al.
HALF = 0.5  # share of the variance of a parameter from which on a direction harms it (Belsley et al.)
UNSEEN = 1e-10  # of the largest eigenvalue, with columns of unit length: below it no data, only rounding


@dataclass(frozen=True)
class Combination:
    """Parameters that only their combination is known of.

    paths : its members, and names : as short as is clear. weights : change of each factor along the unseen direction,
    the largest 1. gamma : collinearity index of the members; infinite for one that has no effect at all.
    """

    paths: tuple[str, ...]
    names: tuple[str, ...]
    weights: tuple[float, ...]
    gamma: float

    def sentence(self) -> str:
        """What is not seen, in words."""
        if len(self.names) == 1:
            return f"{self.names[0]} has no effect on what these data hold"
        moves = [f"{10 * w:+.2g} % of {name}" for w, name in zip(self.weights, self.names, strict=True)]
        return f"only {listed(self.names)} together; {' with '.join(moves)} is not seen by these data"


def short(paths: Sequence[str]) -> tuple[str, ...]:
    """Names for people: the last part of a path where it is the only one so called."""
    last = [path.rsplit(".", 1)[-1] for path in paths]
    return tuple(name if last.count(name) == 1 else path for name, path in zip(last, paths, strict=True))


def listed(names: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


@dataclass(frozen=True)
class Collinearity:
    """Diagnostics of sensitivities (num_residuals, n).

    sensitivity : root mean square of each column, (n,): delta^msqr of Brun et al.
    gamma : collinearity index of all parameters that have an effect.
    indices : condition indices, rising, (n,). shares : variance shares, (n, n), rows as the indices; columns sum to 1.
    directions : changes of the factors, one a row as the indices, columns of unit length in the residuals.
    combinations : the smallest sets that cannot be told apart.
    """

    paths: tuple[str, ...]
    sensitivity: Array
    gamma: float
    indices: Array
    shares: Array
    directions: Array
    combinations: tuple[Combination, ...]


def collinearity(jacobian: Array, paths: Sequence[str]) -> Collinearity:
    """Diagnose the sensitivities d residual / d factor (m, n) of parameters by name."""
    lengths = np.sqrt((jacobian**2).sum(axis=0))
    moved = lengths > 0
    scaled = _unit(jacobian)
    values, vectors = _eigen(scaled.T @ scaled)
    largest = values.max(initial=UNSEEN)
    indices = np.sqrt(largest / np.maximum(values, UNSEEN * max(largest, 1.0)))
    variances = (vectors**2 / np.maximum(values, UNSEEN * max(largest, 1.0))).T
    effective = np.flatnonzero(moved)
    return Collinearity(
        paths=tuple(paths),
        sensitivity=lengths / np.sqrt(max(len(jacobian), 1)),
        gamma=index_of(jacobian[:, effective]),
        indices=indices,
        shares=variances / variances.sum(axis=0),
        directions=(vectors / np.where(moved, lengths, 1.0)[:, None]).T,
        combinations=combinations(jacobian, paths),
    )


def index_of(jacobian: Array) -> float:
    """Collinearity index gamma_K of all columns; 1 for columns at right angles, infinite for a dependency."""
    if jacobian.shape[1] == 0:
        return 1.0
    smallest = float(np.linalg.eigvalsh(_gram(jacobian))[0])
    return float(1 / np.sqrt(smallest)) if smallest > UNSEEN else float("inf")


def combinations(jacobian: Array, paths: Sequence[str], most: float = MOST_COLLINEAR) -> tuple[Combination, ...]:
    """Smallest sets whose collinearity index is above `most`, each parameter in one at most; worst first.

    From all parameters, those are taken out one by one without which the rest is most collinear; what cannot shrink
    further is a set. Its member of the greatest weight is then set aside and the search goes on.
    """
    lengths = np.sqrt((jacobian**2).sum(axis=0))
    silent = np.flatnonzero(lengths <= np.sqrt(UNSEEN) * lengths.max(initial=0.0)).tolist()
    names = short(paths)
    found = [Combination((paths[j],), (names[j],), (1.0,), float("inf")) for j in silent]
    gram = _gram(jacobian)
    left = [j for j in range(len(paths)) if j not in silent]
    while len(left) > 1 and _gamma(gram, left) > most:
        own = _shrunk(gram, left, most)
        weights = _weakest(gram, own) / lengths[own]
        weights = weights / weights[np.argmax(np.abs(weights))]
        members = tuple(paths[j] for j in own), tuple(names[j] for j in own)
        found.append(Combination(*members, tuple(map(float, weights)), _gamma(gram, own)))
        left.remove(own[int(np.argmax(np.abs(_weakest(gram, own))))])
    return tuple(found)


def _shrunk(gram: Array, members: list[int], most: float) -> list[int]:
    """The smallest set with an index above `most` that taking out one member after another leads to."""
    while len(members) > 2:
        without = [[own for own in members if own != gone] for gone in members]
        gammas = [_gamma(gram, own) for own in without]
        best = int(np.argmax(gammas))
        if gammas[best] <= most:
            break
        members = without[best]
    return members


def _gamma(gram: Array, members: list[int]) -> float:
    smallest = float(np.linalg.eigvalsh(gram[np.ix_(members, members)])[0])
    return float(1 / np.sqrt(max(smallest, UNSEEN)))


def _weakest(gram: Array, members: list[int]) -> Array:
    """Direction of unit columns that the residuals see least."""
    return np.asarray(np.linalg.eigh(gram[np.ix_(members, members)])[1][:, 0])


def _unit(jacobian: Array) -> Array:
    """Columns of unit length; those of no effect stay 0."""
    lengths = np.sqrt((jacobian**2).sum(axis=0))
    return np.asarray(jacobian / np.where(lengths > 0, lengths, 1.0))


def _gram(jacobian: Array) -> Array:
    scaled = _unit(jacobian)
    return np.asarray(scaled.T @ scaled)


def _eigen(matrix: Array) -> tuple[Array, Array]:
    """Eigenvalues falling, and eigenvectors as columns in their order."""
    values, vectors = np.linalg.eigh(matrix)
    return values[::-1], vectors[:, ::-1]
