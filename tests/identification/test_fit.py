"""Laws of the search: eliminated unknowns are optimal, gradients are exact, bounds hold, progress can end it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shipid.identification import fit
from shipid.identification.fit import Point, _Evaluation, evaluate_factors, huber_loss, initial_point, search_factors
from shipid.identification.residuals import Problem, build_problem
from shipid.identification.settings import Identify
from shipid.vessel.load import load_vessel
from tests.identification.trials import noisy, trials

SHIP = load_vessel("gunnerus-28.9")
PATHS = ["hull.derivatives.Y_uv", "hull.derivatives.N_uv", "hull.derivatives.N_ur"]


def problem(**more: object) -> Problem:
    log = noisy(trials(SHIP, runs=3, steps=30), {"u": 0.05, "r": 3e-3}, 4)
    settings = Identify(**{"parameters": PATHS, "horizon": 0, "weights": {"u": 0.05, "v": 0.05, "r": 0.003}, **more})
    return build_problem(SHIP, log, log.runs, settings)


@pytest.mark.parametrize(
    ("nuisance", "loss_kind"), [(["initial_state"], "squared"), (["velocity_bias", "current"], "huber")]
)
def test_the_gradient_is_that_of_the_objective(nuisance: list[str], loss_kind: str) -> None:
    """With the unknowns of the runs eliminated anew at each place, priors of the factors included."""
    task = problem(nuisance=nuisance, loss=loss_kind, prior={"hull.*": 0.5})
    factors = np.array([1.1, 0.9, 1.05])
    here = evaluate_factors(task, factors, initial_point(task))
    point = Point(here.at.nuisances, here.at.away)
    for j, unit in enumerate(np.eye(3)):
        ends = [evaluate_factors(task, factors + sign * 1e-5 * unit, point).objective for sign in (1, -1)]
        assert 2 * (here.J.T @ here.f)[j] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4, abs=1e-2)


def test_a_prior_is_about_the_base_vessel_also_where_that_is_zero() -> None:
    task, factors = problem(), np.array([0.4, 0.9, 1.05])
    centre, prior = np.array([0.0, 1.0, 1.0]), np.array([0.5, 0.25, np.inf])
    believed = replace(task, unknown=replace(task.unknown, centre=centre, prior=prior))
    costs = [evaluate_factors(each, factors, initial_point(each)).objective for each in (task, believed)]
    assert costs[1] - costs[0] == pytest.approx((0.4 / 0.5) ** 2 + (0.1 / 0.25) ** 2)


def test_the_unknowns_of_the_runs_are_where_they_are_best() -> None:
    task, rng = problem(nuisance=["initial_state", "velocity_bias"]), np.random.default_rng(1)
    factors = np.array([1.1, 0.9, 1.05])
    best = evaluate_factors(task, factors, initial_point(task))
    for _ in range(5):
        moved = task.whole, rng.normal(0, 0.05, best.at.nuisances.shape), rng.normal(0, 0.05, best.at.away.shape)
        again = evaluate_factors(task, factors, Point(best.at.nuisances + moved[1], best.at.away + moved[2]))
        assert again.objective == pytest.approx(best.objective, rel=1e-8)


def test_the_loss_is_linear_beyond_its_threshold() -> None:
    r = np.array([-5.0, -1.0, 0.0, 2.0, 3.0])
    assert huber_loss(r, 2.0).tolist() == [16.0, 1.0, 0.0, 4.0, 8.0]


def test_a_factor_that_is_pushed_ends_at_its_bound() -> None:
    task = problem(bounds={PATHS[0]: (1.2, 3.0)})
    end = search_factors(task, np.array([2.0, 1.0, 1.0]), initial_point(task))
    assert end.status == "ok"
    assert end.factors[0] == 1.2
    slope = (
        evaluate_factors(task, end.factors, initial_point(task)).J.T
        @ evaluate_factors(task, end.factors, initial_point(task)).f
    )
    assert slope[0] > 0
    assert np.abs(slope[1:]).max() < 1e-3 * slope[0]


def test_it_ends_where_whoever_looks_on_asks() -> None:
    task, begin = problem(), np.array([1.5, 0.5, 1.5])
    end = search_factors(task, begin, initial_point(task), progress=lambda iteration, _: iteration == 4, before=3)
    assert (end.status, end.iterations) == ("stopped", 4)
    none = search_factors(task, begin, initial_point(task), progress=lambda *_: True)
    assert (none.status, none.iterations, none.factors.tolist()) == ("stopped", 0, begin.tolist())


def test_a_search_goes_on_along_a_kink(monkeypatch: pytest.MonkeyPatch) -> None:
    """(1 + 10 |y - x|)^2 + (x - 3)^2 / 9 is least at (3, 3); from (0, 0) every step of one side's slope goes up."""

    def kinked(_: object, at: np.ndarray, __: object) -> _Evaluation:
        side = 1.0 if at[1] >= at[0] else -1.0
        f = np.array([1 + 10.0 * side * (at[1] - at[0]), (at[0] - 3) / 3])
        J = np.array([[-10.0 * side, 10.0 * side], [1 / 3, 0.0]])
        return _Evaluation(at, SimpleNamespace(nuisances=None, away=None), f, J)  # type: ignore[arg-type]

    monkeypatch.setattr(fit, "evaluate_factors", kinked)
    unknown = SimpleNamespace(low=np.full(2, -10.0), high=np.full(2, 10.0))
    end = search_factors(SimpleNamespace(unknown=unknown, names=()), np.zeros(2), Point(np.zeros(0), np.zeros(0)))  # type: ignore[arg-type]
    assert end.status == "ok"
    assert end.objective < 1.05
    np.testing.assert_allclose(end.factors, 3, atol=0.7)
