"""Whether two fits of the same runs say the same: the test for a bias that no standard error shows.

If the model is right, fits over a short and over a long horizon estimate the same factors and differ by chance alone.
How much that is, is known without assuming anything within a run: run g moves the first estimate by a_g and the second
by b_g (`Covariance.influences`), so cov(difference) = sum over runs of (a_g - b_g)(a_g - b_g)^T. What differs by more
is biased in one of the two. The longer horizon has fewer starts to find, so it is the one to believe.

Source: Hausman, Econometrica 46 (1978) 1251, in the form that needs no efficient estimate: clustered as in Cameron,
Miller, Journal of Human Resources 50 (2015) 317.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from shipid.errors import ShipidError
from shipid.identification.collinearity import listed, short
from shipid.identification.statistics import LEVEL, Statistics

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Agreement:
    """Two fits compared.

    paths : factors that both have found and that their data see. differences, errors : (n,) first less second, and
        its standard error.
    probability : (n,) of a difference this large by chance. agree : whether all may be chance. sentence : in words.
    """

    paths: tuple[str, ...]
    differences: Array
    errors: Array
    probability: Array
    agree: bool
    sentence: str


def agreement(one: Statistics, other: Statistics) -> Agreement:
    """Compare two fits of the same runs; 5 % for all factors together (Holm), t by the fewer degrees of freedom.

    Raises
    ------
    ShipidError : the fits have other runs, or no factor in common.
    """
    runs = [_runs(own) for own in (one, other)]
    if set(runs[0]) != set(runs[1]):
        apart = listed(sorted(set(runs[0]) ^ set(runs[1])))
        raise ShipidError(f"the fits must be of the same runs to be compared; only one of them has {apart}")
    inner = [own.collinearity.paths for own in (one, other)]
    unseen = {path for own in (one, other) for path in np.array(own.fit.paths)[np.isinf(own.alone)].tolist()}
    paths = tuple(path for path in inner[0] if path in inner[1] and path not in unseen)  # unseen: left where begun
    if not paths:
        raise ShipidError("the fits have no factor in common")
    sandwiches = [own.covariances["sandwich"] for own in (one, other)]
    a, b = (own.influences for own in sandwiches)
    assert a is not None
    assert b is not None
    b = b[[runs[1].index(run) for run in runs[0]]]
    places = [[own.index(path) for path in paths] for own in inner]
    factors = [own.fit.factors[[own.fit.paths.index(path) for path in paths]] for own in (one, other)]
    differences = factors[0] - factors[1]
    errors = np.sqrt(((a[:, places[0]] - b[:, places[1]]) ** 2).sum(axis=0))
    freedom = np.minimum(sandwiches[0].freedom[places[0]], sandwiches[1].freedom[places[1]])
    ratio = np.abs(differences) / np.where(errors > 0, errors, np.inf)
    probability = 2 * stats.t.sf(ratio, freedom)
    rejected = _holm(probability)
    names = [name for name, bad in zip(short(paths), rejected, strict=True) if bad]
    told = "the two fits agree within chance"
    if names:
        worst = int(np.argmin(probability))
        told = (
            f"the two fits disagree in {listed(names)} (at most {ratio[worst]:.1f} standard errors of the difference): "
            "one is biased; believe the longer horizon"
        )
    return Agreement(paths, differences, errors, probability, not names, told)


def _runs(own: Statistics) -> list[str]:
    """Name of each run, as the rows of the influences."""
    numbers = np.unique(own.fit.clusters).tolist()
    return [own.fit.runs[number] if own.fit.runs else str(number) for number in numbers]


def _holm(probability: Array) -> NDArray[np.bool_]:
    """What is rejected at 5 % for all together (Holm, Scandinavian Journal of Statistics 6 (1979) 65)."""
    order = np.argsort(probability)
    passed = probability[order] <= (1 - LEVEL) / (len(order) - np.arange(len(order)))
    result = np.zeros(len(order), dtype=bool)
    result[order] = np.logical_and.accumulate(passed)
    return result
