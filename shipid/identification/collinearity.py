"""Collinearity of sensitivities: which parameters the data distinguish, and which only in combination.

Columns are scaled to unit length, as both sources ask, so that nothing depends on units. Then

    gamma_K = 1 / sqrt(smallest eigenvalue of S_K^T S_K)      collinearity index of a set K (Brun et al. 2001, eq. 10)
    eta_k   = largest / k-th singular value of S              condition index (Belsley, Kuh, Welsch 1980, ch. 3)
    pi_kj   = (V_jk / s_k)^2 / sum_k (V_jk / s_k)^2           share of the variance of parameter j that comes from k

gamma above 10 to 15: the other parameters can compensate a change of one parameter to within 1 / gamma. eta above 30
with two shares above 0.5: a harmful dependency. Neither index depends on the noise: collinear parameters may still be
identified from enough good data. So the indices explain a wide interval; they are not a criterion by themselves.

Sources: Brun, Reichert, Kuensch, Water Resources Research 37 (2001) 1015; Belsley, Kuh, Welsch, Regression Diagnostics
(1980), ch. 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipid.document import short_names

Array = NDArray[np.float64]

MOST_COLLINEAR = 15.0  # Brun et al.: "critical" from 10 to 15 on
UNSEEN = 1e-10  # of the largest eigenvalue, with columns of unit length: below it no data, only rounding


@dataclass(frozen=True)
class Combination:
    """A set of parameters of which the data determine only a combination.

    paths : dotted paths of the parameters. names : the shortest unambiguous names.
    weights : relative change of each factor along the direction that leaves the residuals unchanged; the largest is 1.
    gamma : collinearity index of the set; infinite for a parameter without any effect.
    """

    paths: tuple[str, ...]
    names: tuple[str, ...]
    weights: tuple[float, ...]
    gamma: float

    def sentence(self) -> str:
        """One sentence that names the parameters and the unidentified direction."""
        if len(self.names) == 1:
            return f"{self.names[0]} has no effect on these data"
        moves = [f"{digits(10 * w, 2, '+')} % of {name}" for w, name in zip(self.weights, self.names, strict=True)]
        return f"only {listed(self.names)} together; {' with '.join(moves)} has no effect on these data"


def digits(value: float, most: int = 3, sign: str = "") -> str:
    """Format with so many significant digits, but never round digits before the decimal point."""
    return f"{value:{sign}.0f}" if abs(value) >= 10**most else f"{value:{sign}.{most}g}"


def listed(names: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


@dataclass(frozen=True)
class Collinearity:
    """Diagnostics of sensitivities (num_residuals, n).

    sensitivity : root mean square of each column, (n,): delta^msqr of Brun et al.
    gamma : collinearity index of all parameters that have an effect.
    indices : condition indices, rising, (n,). shares : variance shares, (n, n), rows as the indices; columns sum to 1.
    directions : (n, n), one direction of the factors in each row, in the order of `indices`; each factor is scaled by
        the length of its column.
    combinations : the smallest sets of parameters that the data do not distinguish.
    """

    paths: tuple[str, ...]
    sensitivity: Array
    gamma: float
    indices: Array
    shares: Array
    directions: Array
    combinations: tuple[Combination, ...]


def collinearity(jacobian: Array, paths: Sequence[str]) -> Collinearity:
    """Collinearity diagnostics of the sensitivities d residual / d factor (m, n); `paths` names the n columns."""
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
    """Collinearity index gamma_K of all columns: 1 for orthogonal columns, infinite for dependent ones."""
    if jacobian.shape[1] == 0:
        return 1.0
    smallest = float(np.linalg.eigvalsh(_gram(jacobian))[0])
    return float(1 / np.sqrt(smallest)) if smallest > UNSEEN else float("inf")


def combinations(jacobian: Array, paths: Sequence[str]) -> tuple[Combination, ...]:
    """Smallest sets with a collinearity index above `MOST_COLLINEAR`; worst first.

    Backward elimination: parameters are removed one by one, each time the one whose removal leaves the most collinear
    rest, until every further removal brings the index below that. What is left is one set. Its parameter with the
    greatest weight is then excluded, and the search is repeated.
    """
    lengths = np.sqrt((jacobian**2).sum(axis=0))
    silent = np.flatnonzero(lengths <= np.sqrt(UNSEEN) * lengths.max(initial=0.0)).tolist()
    names = short_names(paths)
    result = [Combination((paths[j],), (names[j],), (1.0,), float("inf")) for j in silent]
    gram = _gram(jacobian)
    left = [j for j in range(len(paths)) if j not in silent]
    while len(left) > 1 and _gamma(gram, left) > MOST_COLLINEAR:
        chosen = _shrunk(gram, left)
        weights = _weakest(gram, chosen) / lengths[chosen]
        weights = weights / weights[np.argmax(np.abs(weights))]
        labels = tuple(paths[j] for j in chosen), tuple(names[j] for j in chosen)
        result.append(Combination(*labels, tuple(map(float, weights)), _gamma(gram, chosen)))
        left.remove(chosen[int(np.argmax(np.abs(_weakest(gram, chosen))))])
    return tuple(result)


def _shrunk(gram: Array, members: list[int]) -> list[int]:
    """Remove members one by one while the collinearity index stays above the limit; the members that are left."""
    while len(members) > 2:
        without = [[smaller for smaller in members if smaller != gone] for gone in members]
        gammas = [_gamma(gram, smaller) for smaller in without]
        best = int(np.argmax(gammas))
        if gammas[best] <= MOST_COLLINEAR:
            break
        members = without[best]
    return members


def _gamma(gram: Array, members: list[int]) -> float:
    smallest = float(np.linalg.eigvalsh(gram[np.ix_(members, members)])[0])
    return float(1 / np.sqrt(max(smallest, UNSEEN)))


def _weakest(gram: Array, members: list[int]) -> Array:
    """Unit vector of the smallest eigenvalue of the scaled Gram matrix: the direction with the least effect."""
    return np.asarray(np.linalg.eigh(gram[np.ix_(members, members)])[1][:, 0])


def _unit(jacobian: Array) -> Array:
    """The columns scaled to unit length; zero columns stay 0."""
    lengths = np.sqrt((jacobian**2).sum(axis=0))
    return np.asarray(jacobian / np.where(lengths > 0, lengths, 1.0))


def _gram(jacobian: Array) -> Array:
    scaled = _unit(jacobian)
    return np.asarray(scaled.T @ scaled)


def _eigen(matrix: Array) -> tuple[Array, Array]:
    """Eigenvalues in falling order, and the eigenvectors as columns in that order."""
    values, vectors = np.linalg.eigh(matrix)
    return values[::-1], vectors[:, ::-1]
