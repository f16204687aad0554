"""Bands: regions, their growth, what they refuse, and how they adapt along a run."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from shipid.errors import DataError
from shipid.hybrid.bands import (
    LEVELS,
    Region,
    adapt_band,
    adaptive_factor,
    nearest_distances,
    prediction_traits,
    radius_at_level,
    start_adaptation,
)
from tests.hybrid.runs import HORIZON, made

STRANGE = [made(seed) for seed in range(4)]


@pytest.mark.parametrize("seed", range(4))
def test_a_higher_level_holds_all_of_a_lower_one(seed: int) -> None:
    made_, bands = STRANGE[seed]
    regions = [bands.region(made_.paths, made_.columns, 1.0, level) for level in (0.2, 0.505, 0.8, 0.9)]
    for inner, outer in itertools.pairwise(regions):
        assert (inner.along <= outer.along).all()
        assert (inner.across <= outer.across).all()
    apart = [region.holds(made_.errors).mean() for region in regions]
    assert apart == sorted(apart)


def test_far_from_training_bands_grow_without_bound() -> None:
    made_, bands = STRANGE[0]
    away = [{**made_.columns, "u": made_.columns["u"] + shift} for shift in (0.0, 1e2, 1e3, 1e4)]
    sizes = [bands.growth(made_.paths, columns, 1.0).min() for columns in away]
    assert sizes == sorted(sizes)
    assert sizes[-1] > 50 * sizes[0]


def test_too_few_runs_are_one_sentence() -> None:
    made_, bands = STRANGE[0]
    few = replace(bands, runs=8)
    with pytest.raises(DataError, match=r"a band of 90 % needs 9 runs or more to calibrate it: there are 8"):
        few.region(made_.paths, made_.columns, 1.0, 0.9)
    few.region(made_.paths, made_.columns, 1.0, 0.85)
    for level in (0.0, 1.0, -0.1, 90.0, float("nan")):
        with pytest.raises(DataError, match="is no level of a band"):
            bands.region(made_.paths, made_.columns, 1.0, level)
    mixed = replace(bands, kinds={"zigzag": 4, "turning": 18})  # enough runs, and too few of one kind
    mixed.region(made_.paths, made_.columns, 1.0, 0.8, kind="zigzag")
    mixed.region(made_.paths, made_.columns, 1.0, 0.9, kind="turning")
    many = replace(bands, runs=99)
    assert many.promises(0.99)
    many.region(made_.paths, made_.columns, 1.0, 0.99)
    with pytest.raises(DataError, match=r"needs 9 runs or more of the kind 'zigzag' to calibrate it: there are 4"):
        mixed.region(made_.paths, made_.columns, 1.0, 0.9, kind="zigzag")
    for kind in ("spiral", ["zigzag"], np.array(["zigzag", "turning"])):
        with pytest.raises(DataError, match="calibrated this band"):
            mixed.region(made_.paths, made_.columns, 1.0, 0.8, kind=kind)


def test_a_region_is_an_ellipse_along_the_track() -> None:
    course = 0.7
    ahead = np.array([np.cos(course), np.sin(course)])
    region = Region(np.tile(ahead, (1, 3, 1)), np.full((1, 3), 4.0), np.full((1, 3), 1.0))
    aside = np.array([-ahead[1], ahead[0]])
    errors = np.stack([4 * ahead, 1 * aside, 2 * aside])[None]
    np.testing.assert_allclose(region.reach(errors)[0], [1.0, 1.0, 2.0])
    np.testing.assert_allclose(region.radius, 2.0)
    np.testing.assert_array_equal(region.holds(0.999 * errors), [True, True, False])


def test_a_predictor_that_never_erred_has_a_band_of_its_path_alone() -> None:
    nothing = np.zeros((2, 3))
    region = Region(np.tile([1.0, 0.0], (2, 3, 1)), nothing, nothing)
    errors = np.zeros((2, 3, 2))
    errors[1, 2] = [0.0, 1e-3]
    assert region.holds(errors).tolist() == [True, True, False]
    assert region.reach(errors)[:, :2].max() == 0


def test_centres_of_the_same_run_are_passed_over() -> None:
    rng = np.random.default_rng(3)
    points, centres = rng.normal(size=(40, 3)), rng.normal(size=(12, 3))
    run, of_centre = rng.integers(0, 4, 40), np.arange(12) % 4
    by_hand = [
        nearest_distances(point[None], centres[of_centre != mine])[0] for point, mine in zip(points, run, strict=True)
    ]
    np.testing.assert_allclose(nearest_distances(points, centres, run, of_centre), by_hand, rtol=1e-12)
    nearest = cdist(points, centres).min(axis=1) / np.sqrt(3)
    np.testing.assert_allclose(nearest_distances(points, centres), nearest, rtol=1e-12)


def test_levels_between_those_of_the_table() -> None:
    table = LEVELS**2
    assert radius_at_level(table, 0.9) == pytest.approx(0.81)
    assert radius_at_level(table, 0.905) == pytest.approx((0.81 + 0.91**2) / 2)
    assert radius_at_level(table, 0.985) == pytest.approx((0.98**2 + 0.99**2) / 2)
    assert radius_at_level(table, 0.99) == pytest.approx(0.99**2)
    assert radius_at_level(table, 0.005) == pytest.approx(table[0] / 2)


@pytest.mark.parametrize("drift", [0.0, 1.5, -0.5])
@pytest.mark.parametrize("level", [0.5, 0.9])
def test_an_adaptive_band_keeps_its_long_run_rate(level: float, drift: float) -> None:
    """Scores drift away from those of calibration, with bursts: the share of misses goes to that wanted."""
    rng, table = np.random.default_rng(5), -np.log1p(-LEVELS)  # radii of exponential scores
    state, misses, fixed = start_adaptation(level, 0.02), [], []
    for i in range(6000):
        score = rng.exponential() * np.exp(drift * i / 6000 + (i % 500 < 50))
        usual = float(radius_at_level(table, level))
        missed = score > usual * adaptive_factor(state, table)
        state = adapt_band(state, bool(missed))
        misses.append(missed)
        fixed.append(score > usual)
    assert np.mean(misses) == pytest.approx(1 - level, abs=0.012)
    if drift > 0:
        assert np.mean(fixed) > 1 - level + 0.05


@pytest.mark.parametrize("step", [0.25, 2.0])
def test_a_steady_turn_has_no_slip_and_no_change(step: float) -> None:
    """Circles by their yaw rate: the chords of thirds of the horizon turn by two thirds of the whole angle."""
    r = np.array([-0.05, 0.0, 0.02])
    angle = r * step * np.arange(1, HORIZON * 3 + 1)[:, None]
    paths = (
        4.0
        * step
        * np.arange(1, HORIZON * 3 + 1)[:, None, None]
        * np.stack([np.sinc(angle / np.pi), np.sinc(angle / 2 / np.pi) * np.sin(angle / 2)], axis=-1)
    )
    length, turn, change, slip, _ = prediction_traits(paths, {"r": r}, step, np.zeros(3), 1.0).T
    np.testing.assert_allclose(turn, np.abs(angle[-1]) * 2 / 3, atol=1e-12)
    np.testing.assert_allclose(change, 0.0, atol=1e-12)
    np.testing.assert_allclose(slip, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.exp(length[1]) - 0.02, 4.0 * step * HORIZON * 3)  # straight ahead
    (slow,) = prediction_traits(paths[:, 2:], {"r": r[2:] / 2}, step, np.zeros(1), 1.0)  # it turns more than it would
    assert slow[3] == pytest.approx(slow[1] / 2)
    (fast,) = prediction_traits(paths[:, 2:], {"r": r[2:] * 1.5}, step, np.zeros(1), 1.0)  # it turns less than it would
    assert fast[3] == pytest.approx(fast[1] / 2)
    (twice,) = prediction_traits(paths[:, 1:2], {"r": r[1:2]}, step, np.zeros(1), 2 * step)
    assert np.exp(twice[0]) - 0.02 == pytest.approx(2.0 * HORIZON * 3)  # over the length of an average path
