from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.errors import ShipidError
from shipid.hybrid.mean import DeployedMethod, MeanCorrector
from shipid.hybrid.method import fit_all
from shipid.hybrid.stack import weigh_errors
from shipid.predictor import Predictor
from tests.drawn import seeds
from tests.hybrid.quick import quick, small_world
from tests.hybrid.worlds import ship

RUNS = np.repeat(["a", "b", "c", "d"], [5, 9, 4, 7])


def drawn_errors(seed: int, count: int) -> np.ndarray:
    """Errors of foundations that share a part."""
    random = np.random.default_rng([seed, 31])
    own = random.normal(size=(count, 3, len(RUNS), 2)) * random.uniform(0.3, 2, (count, 1, 1, 1))
    return own + random.normal(size=(1, 3, len(RUNS), 2))


def by_run(errors: np.ndarray) -> float:
    """Mean over runs of the mean squared error."""
    return float(np.mean([np.square(errors[:, run == RUNS]).mean() for run in np.unique(RUNS)]))


@pytest.mark.parametrize("seed", seeds(5, 100))
def test_weights_are_shares_that_no_other_shares_beat(seed: int) -> None:
    count = 2 + seed % 4
    errors = drawn_errors(seed, count)
    weights, _ = weigh_errors(errors, RUNS, by_left_out=True)
    assert (weights >= 0).all()
    assert weights.sum() == pytest.approx(1, abs=1e-12)
    mine = by_run(np.tensordot(weights, errors, 1))
    others = np.random.default_rng(seed).dirichlet(np.ones(count), 300)
    tried = [by_run(np.tensordot(other, errors, 1)) for other in (*np.eye(count), *others, np.full(count, 1 / count))]
    assert mine <= min(tried) * (1 + 1e-6)


@pytest.mark.parametrize("by_left_out", [False, True])
def test_the_error_on_a_run_is_by_weights_that_did_not_see_it(by_left_out: bool) -> None:
    errors = drawn_errors(1, 3)
    _, left_out = weigh_errors(errors, RUNS, by_left_out=by_left_out)
    spoilt = errors.copy()
    spoilt[0][:, RUNS == "b"] *= 100.0
    _, again = weigh_errors(spoilt, RUNS, by_left_out=by_left_out)
    ratio = (again - left_out)[:, RUNS == "b"] / (spoilt - errors)[0][:, RUNS == "b"]
    assert np.ptp(ratio) < 1e-9  # the weight of the first is the same
    assert by_left_out == (not np.allclose(again[:, RUNS == "a"], left_out[:, RUNS == "a"]))


def test_of_one_run_and_without_errors_weights_are_equal() -> None:
    errors = drawn_errors(2, 3)
    weights, left_out = weigh_errors(errors, np.full(len(RUNS), "a"), by_left_out=True)
    np.testing.assert_allclose(weights, 1 / 3)
    np.testing.assert_allclose(left_out, errors.mean(axis=0))
    errors[1, 0, 3, 0] = np.nan
    weights, left_out = weigh_errors(errors, RUNS, by_left_out=True)
    assert np.isfinite(weights).all()
    assert np.isnan(left_out[0, 3, 0])
    errors[:, :, RUNS != "b"] = np.nan
    _, left_out = weigh_errors(errors, RUNS, by_left_out=True)
    np.testing.assert_allclose(left_out[:, RUNS == "b"], errors.mean(axis=0)[:, RUNS == "b"])
    np.testing.assert_allclose(weigh_errors(np.full_like(errors, np.nan), RUNS, by_left_out=True)[0], 1 / 3)


def test_a_mean_predicts_the_mean_and_comes_back_from_its_file(tmp_path) -> None:
    here = small_world()
    doubtful = replace(here.physics, vessel=ship().with_values({"hull.derivatives.X_u|u|": -3000.0}))
    cases = {"physics": here.physics, "doubtful": doubtful}
    fitted = fit_all(quick("kernel"), here.task(cases))
    parts = tuple(DeployedMethod(cases[name], "kernel", fitted[name].corrector) for name in cases)
    weights = np.array([0.3, 0.7])
    predictor = Predictor(here.physics, "kernel", MeanCorrector(parts, weights), {"u": (0.0, 9.0)}, commands="known")
    instants = here.test.instants(known=True)
    paths = [Predictor(one.physics, one.method, one.corrector, commands="known").predict(instants) for one in parts]
    np.testing.assert_allclose(predictor.predict(instants), 0.3 * paths[0] + 0.7 * paths[1], atol=1e-9)
    again = Predictor.load(predictor.save(tmp_path / "mean.npz"))
    np.testing.assert_array_equal(again.predict(instants), predictor.predict(instants))
    errors = [here.error(path) for path in (again.predict(instants), *paths)]
    assert errors[0] <= 0.3 * errors[1] + 0.7 * errors[2]
    with pytest.raises(ShipidError, match="a mean over foundations cannot be exported: export the cells of its"):
        again.export("c", tmp_path / "c")
