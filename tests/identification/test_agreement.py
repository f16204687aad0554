"""Two fits compared: chance is let through at its rate, a bias is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.errors import ShipidError
from shipid.identification.agreement import agreement
from shipid.identification.statistics import Statistics, statistics
from tests.identification.linear import design, fitted, labels, noise

RUNS, COUNT = 16, 4
LONG, SHORT = design(RUNS, 40, COUNT), design(RUNS, 40, COUNT, seed=9)
LABELS = labels(RUNS, 40)


def two(seed: int, bias: float = 0.0) -> tuple[Statistics, Statistics]:
    """Fits that share noise but not sensitivities; the second is pulled in its first factor."""
    error = noise(np.random.default_rng(seed), RUNS, 40, 0.8)
    second = fitted(SHORT, error + bias * SHORT[:, 0], *LABELS)
    return statistics(fitted(LONG, error, *LABELS)), statistics(second)


def test_chance_is_rejected_at_its_rate() -> None:
    """5 % for all factors together: of 100 pairs, 12 or fewer (99.8 %)."""
    assert sum(not agreement(*two(seed)).agree for seed in range(100)) <= 12


def test_a_bias_is_told() -> None:
    found = agreement(*two(0, bias=0.5))
    assert not found.agree
    assert "disagree in p0 " in found.sentence
    assert found.differences[0] == pytest.approx(-0.5, abs=4 * found.errors[0])


def test_a_fit_agrees_with_itself_and_other_runs_are_refused() -> None:
    one, _ = two(0)
    assert agreement(one, one).agree
    np.testing.assert_array_equal(agreement(one, one).differences, 0)
    kept = one.fit.clusters < 8
    part = replace(
        one.fit,
        residuals=one.fit.residuals[kept],
        jacobian=one.fit.jacobian[kept],
        clusters=one.fit.clusters[kept],
        signals=tuple(np.array(one.fit.signals)[kept].tolist()),
    )
    with pytest.raises(ShipidError, match="same runs"):
        agreement(one, statistics(part))
    with pytest.raises(ShipidError, match="in common"):
        agreement(one, statistics(replace(one.fit, paths=tuple("abcd"))))


def test_what_the_data_do_not_see_is_not_compared() -> None:
    """Two columns that are one: each factor alone stays where its fit began, which says nothing about a bias."""
    error = noise(np.random.default_rng(0), RUNS, 40, 0.8)
    begun = []
    for jacobian, away in ((LONG, 0.0), (SHORT, 0.3)):
        fit = fitted(np.column_stack([jacobian, jacobian[:, :1]]), error, *LABELS)
        begun.append(statistics(replace(fit, factors=fit.factors + away * np.array([1, 0, 0, 0, -1]))))
    found = agreement(*begun)
    assert found.agree
    assert set(found.paths) == {"p1", "p2", "p3"}


def test_runs_are_matched_by_name() -> None:
    """The same fit with its runs numbered the other way round agrees with itself to the last digit of its errors."""
    one, other = (
        statistics(replace(own.fit, runs=tuple(f"M{number}" for number in range(RUNS)))) for own in two(0, bias=0.1)
    )
    turned = statistics(replace(other.fit, clusters=RUNS - 1 - other.fit.clusters, runs=other.fit.runs[::-1]))
    np.testing.assert_allclose(agreement(one, turned).errors, agreement(one, other).errors, rtol=1e-9)
    renamed = statistics(replace(other.fit, runs=("M99", *other.fit.runs[1:])))
    with pytest.raises(ShipidError, match=r"same runs.*M0 and M99"):
        agreement(one, renamed)


def test_nothing_free_is_nothing_to_compare() -> None:
    one, other = two(0)
    with pytest.raises(ShipidError, match="in common"):
        agreement(one, statistics(replace(other.fit, held=np.ones(COUNT, dtype=bool))))
