"""Laws that every method obeys, on one small world; a method is added to METHODS and is tested here unasked."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipid.errors import DataError, DocumentError, ShipidError
from shipid.hybrid.alone import Alone
from shipid.hybrid.method import Case, FitResult, Method
from shipid.hybrid.methods import METHODS, method_kind, method_of
from shipid.hybrid.one_step import OneStep
from shipid.hybrid.physics import Physics
from shipid.hybrid.search import spread_points
from tests.hybrid.quick import DOCUMENTED, QUICK, list_documented, quick, small_world
from tests.hybrid.worlds import HORIZON, ship

documented = pytest.fixture(autouse=True)(list_documented)
here = pytest.fixture(scope="module")(small_world)
EVERY = pytest.mark.parametrize("kind", [*METHODS, DOCUMENTED])
LEARNING = [kind for kind, method in METHODS.items() if method.compensates] + [DOCUMENTED]
COMPENSATING = pytest.mark.parametrize("kind", LEARNING)
CLOSE = 1e-9  # m
#: methods that train several foundations as one batch, whose rounding then grows over the epochs
IN_STACKS = {"path-trained": 0.05}


@pytest.fixture(scope="module")
def fitted(here) -> Callable[[str], FitResult]:
    """What a method learns beside the physics: fitted once a kind, not to be changed."""
    return cache(lambda kind: quick(kind).fit(here.task())["physics"])


def others(here, kind):
    """Foundations beside the first: another ship, and none where the method meets it."""
    doubtful = replace(here.physics, vessel=ship().with_values({"hull.derivatives.X_u|u|": -3000.0}))
    none = {"none": Physics(None, HORIZON, 1.0)} if METHODS[kind].meets_none else {}
    return {"physics": here.physics, "doubtful": doubtful, **none}


def predicted(here, fit, physics, chosen=slice(None)):
    instants = here.test.instants(known=True).select(chosen)
    return fit.corrector.predict(physics, instants, physics.paths(instants))


@EVERY
def test_a_method_is_named_and_its_settings_are_checked(kind):
    method = quick(kind)
    assert method_kind(method) == kind
    with pytest.raises(DocumentError, match="unknown key"):
        method_of(kind, {"nonsense": 1})
    assert method.past <= 10.0
    assert set(QUICK) <= set(METHODS)


@EVERY
def test_what_is_saved_says_the_same_numbers(kind, here, fitted):
    """Beside the physics, and alone where the method meets none."""
    method, none = quick(kind), Physics(None, HORIZON, 1.0)
    learned = [(here.physics, fitted(kind))]
    if method.meets_none:
        learned.append((none, method.fit(here.task({"none": none}))["none"]))
    for physics, fit in learned:
        header = json.loads(json.dumps(fit.corrector.header()))
        arrays = {key: np.asarray(values) for key, values in fit.corrector.arrays().items()}
        again = type(fit)(METHODS[kind].corrector.from_arrays(header, arrays), [], 0.0)
        np.testing.assert_array_equal(predicted(here, again, physics), predicted(here, fit, physics))
        assert again.corrector.hyperparameters == fit.corrector.hyperparameters
        assert again.corrector.past == fit.corrector.past <= method.past


@pytest.mark.slow
@EVERY
def test_a_foundation_does_not_notice_its_company(kind, here):
    together = quick(kind).fit(here.task(others(here, kind)))
    for name, physics in others(here, kind).items():
        alone = quick(kind).fit(here.task({name: physics}))[name]
        np.testing.assert_allclose(
            predicted(here, alone, physics),
            predicted(here, together[name], physics),
            rtol=0,
            atol=IN_STACKS.get(kind, CLOSE),
        )


@COMPENSATING
def test_a_foundation_that_diverged_is_a_value_and_harms_nobody(kind, here, fitted):
    task = here.task()
    broken = Case(here.physics, np.full_like(task.cases["physics"].paths, np.nan))
    fit = quick(kind).fit(replace(task, cases={"broken": broken, **task.cases}))
    assert fit["broken"].corrector is None
    assert {row["state"] for row in fit["broken"].trials} == {"diverged"}
    np.testing.assert_allclose(
        predicted(here, fit["physics"], here.physics),
        predicted(here, fitted(kind), here.physics),
        rtol=0,
        atol=IN_STACKS.get(kind, CLOSE),
    )


@EVERY
def test_an_instant_does_not_notice_the_others(kind, here, fitted):
    corrector = fitted(kind)
    chosen = np.array([7, 2, 11])
    whole = predicted(here, corrector, here.physics)
    np.testing.assert_allclose(predicted(here, corrector, here.physics, chosen), whole[:, chosen], rtol=0, atol=CLOSE)
    assert whole.shape == here.test.future.shape
    assert np.isfinite(whole).all()


@COMPENSATING
def test_the_rows_of_a_search_are_whole(kind, here):
    method = quick(kind)
    fit = method.fit(here.task())["physics"]
    assert [row["number"] for row in fit.trials] == list(range(len(fit.trials)))
    for row in fit.trials:
        assert {"number", "params", "value", "seconds", "epochs", "state"} <= set(row)
        assert {*method.varied()} - {"wind_scale"} <= set(row["params"])  # no wind is measured here
        assert row["state"] == "complete"
        assert row["value"] > 0
    assert fit.seconds > 0
    best = min(row["value"] for row in fit.trials)
    assert fit.corrector.hyperparameters in [row["params"] for row in fit.trials if row["value"] == best]


@COMPENSATING
def test_windows_that_are_in_no_fold_are_not_seen(kind, here):
    task = here.task()
    training, validation = task.folds[0]
    task = replace(task, folds=[(training[5:], validation)])
    spoilt = replace(
        here.train, future=here.train.future.copy(), states={k: v.copy() for k, v in here.train.states.items()}
    )
    outside = training[:5]
    spoilt.future[:, outside] = 1e3
    for values in spoilt.states.values():
        values[:, outside] = 50.0
    for one in (task, replace(task, windows=spoilt)):
        fit = quick(kind).fit(one)["physics"]
        paths = predicted(here, fit, here.physics)
        if one is task:
            first = paths
    np.testing.assert_allclose(paths, first, rtol=0, atol=CLOSE)


@pytest.mark.parametrize("kind", [kind for kind, method in METHODS.items() if method.meets_none] + [DOCUMENTED])
def test_without_physics_a_method_learns_the_path(kind, here):
    physics = Physics(None, HORIZON, 1.0)
    longer = {"path-trained": {"epochs": 400, "learning_rate": 0.01}, "recurrent": {"epochs": 60, "batch": 16}}
    method = quick(kind).model_copy(update=longer.get(kind, {}))
    fit = method.fit(here.task({"none": physics}))["none"]
    left = here.error(predicted(here, fit, physics))
    assert left < 0.75 * here.error(np.zeros_like(here.test.future))


@pytest.mark.parametrize("kind", ["hankel-dmd", "recurrent"])
def test_a_past_that_is_too_short_is_refused(kind, here, fitted):
    corrector = fitted(kind)
    instants = replace(here.test.instants(known=True), past={})
    with pytest.raises(DataError, match="past"):
        corrector.corrector.predict(here.physics, instants, here.physics.paths(instants))


class Unfinished(Method):
    """A method without `fit`."""


@pytest.mark.parametrize("listed", [Alone(), int, "Alone", Unfinished])
def test_what_is_listed_and_no_method_is_one_line(listed: object, monkeypatch: pytest.MonkeyPatch) -> None:
    """A line of a user's file; it ended in a traceback."""
    with pytest.raises(ShipidError, match=r"^'mine' in shipid\.methods: must be a class of Method with `fit`"):
        monkeypatch.setitem(METHODS, "mine", listed)


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("kernel", {"trails": 4}, r"method\.trails: unknown key: did you mean 'trials'"),
        ("kernel", {"trials": 0}, r"method\.trials"),
        ("kernel", {"mirror": 1.5}, r"method\.mirror"),
        ("kernel", {"ridge": [1.0, 0.1]}, "ridge: a range goes from low to high"),
        ("kernel", {"scale": [0.0, 1.0]}, r"method\.scale"),  # searched by its logarithm
        ("kernel", {"epochs": 3}, r"method\.epochs: unknown key"),  # of the other method
        ("path-trained", {"hidden_dropout": 1.5}, r"method\.hidden_dropout"),
        ("path-trained", {"units": [64, 32]}, "units: a range goes from low to high"),
        ("path-trained", {"weight_decay": [0.0, 1.0]}, r"method\.weight_decay"),  # searched by its logarithm
        ("path-trained", {"ridge": 1.0}, r"method\.ridge: unknown key"),
        ("kernel", {"memory": {"turned": float("inf")}}, r"method\.memory\.turned: inf: must be a finite number"),
        ("recurrent", {"seconds": float("inf")}, r"method\.seconds: inf: must be a finite number"),
        ("hankel-dmd", {"delays": [float("inf")]}, r"method\.delays.*: inf: must be a finite number"),
    ],
)
def test_a_method_that_cannot_be_meant_is_refused_in_one_line(name, changes, message):
    with pytest.raises(DocumentError, match=message):
        method_of(name, changes)


def test_an_unknown_kind_is_refused_with_the_names_and_a_retired_one_with_what_to_take():
    with pytest.raises(DocumentError, match="did you mean 'path-trained'"):
        method_of("path-traind", {})
    for kind in ("path-drawn", "path-refined"):
        with pytest.raises(
            DocumentError, match=rf"method\.kind: '{kind}' is no kind of method: it is retired, take kernel$"
        ):
            method_of(kind, {})


def test_points_spread_evenly_and_keep_their_start():
    points = np.array(list(spread_points(3, 64)))
    np.testing.assert_array_equal(list(spread_points(3, 5)), points[:5])
    np.testing.assert_array_equal(points[0], 0.5)
    for quarter in range(4):  # each quarter of a range gets a quarter of the trials, give or take four
        share = (points >= quarter / 4) & (points < (quarter + 1) / 4)
        assert (abs(share.sum(axis=0) - 16) <= 4).all()


def test_trials_fill_their_ranges_by_the_logarithm():
    method = OneStep(trials=64, offset=1.5)
    points = list(method.points())
    assert len(points) == 64
    for name, (low, high) in method.ranges().items():
        if name == "ridge":
            continue
        values = np.array([point[name] for point in points])
        assert ((values >= low) & (values <= high)).all()
        assert np.log(values).mean() == pytest.approx(np.log([low, high]).mean(), abs=0.1)
        assert values.min() < low * (high / low) ** 0.1
        assert values.max() > low * (high / low) ** 0.9
    assert {point["offset"] for point in points} == {1.5}
    assert points[:5] == list(OneStep(trials=5, offset=1.5).points())
