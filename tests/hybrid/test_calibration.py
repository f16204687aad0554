"""Calibration: the share that was promised, whatever the runs are like; no unit and no order matters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f_oneway

from shipid.hybrid.calibration import (
    PRIOR,
    WIDER,
    _fit_scores,
    _growth_slopes,
    _intraclass_correlation,
    band_radii,
    calibrate_bands,
    shares_of_runs,
)
from tests.hybrid.runs import NAMES, Array, made, runs

AT = [49, 79, 89]  # 50, 80, 90 %


@pytest.mark.parametrize("alike", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("count", [10, 22])
def test_radii_hold_their_share_of_new_runs(count: int, alike: float) -> None:
    """Mean over many draws: scores of windows that share so much within a run, of a law with a heavy tail."""
    rng, windows, rounds = np.random.default_rng([count, int(10 * alike)]), 12, 250
    place, held = np.repeat(np.arange(count), windows), []
    for _ in range(rounds):
        shared, single = rng.standard_normal((count + 20, 1)), rng.standard_normal((count + 20, windows))
        scores = np.exp(np.sqrt(alike) * shared + np.sqrt(1 - alike) * single)
        radius = band_radii(scores[:count].ravel(), shares_of_runs(place))[AT]
        held.append([(scores[count:] <= one).mean() for one in radius])
    np.testing.assert_allclose(np.mean(held, axis=0), [0.5, 0.8, 0.9], atol=0.03)
    assert np.mean(held, axis=0)[2] > 0.885  # rather more than less


@pytest.mark.parametrize(("count", "windows"), [(3, 2), (4, 12), (9, 5)])
def test_how_alike_windows_are_is_the_intraclass_correlation(count: int, windows: int) -> None:
    """Of runs of equal length, by the analysis of variance: (F - 1) / (F - 1 + windows)."""
    rng = np.random.default_rng(count)
    values = 2.0 * rng.standard_normal((count, 1)) + rng.standard_normal((count, windows))
    F = f_oneway(*values).statistic
    alike = _intraclass_correlation(values.ravel(), shares_of_runs(np.repeat(np.arange(count), windows)))
    assert alike == pytest.approx(max(F - 1, 0) / (F - 1 + windows))
    assert (
        _intraclass_correlation(np.ones(6), shares_of_runs(np.repeat(np.arange(3), 2))) == 1.0
    )  # nothing differs: a run is one window


def test_one_window_a_run_is_the_order_statistic() -> None:
    scores = np.arange(1.0, 20.0)  # 19 runs: the 18th of 19 holds a share of 18 / 20 of new ones
    radius = band_radii(scores, shares_of_runs(np.arange(19)))
    assert 17.5 <= radius[89] <= 18.5
    assert radius[94] == pytest.approx(19.0, abs=0.5)
    assert (np.diff(radius) >= 0).all()


def test_calibrated_bands_hold_whole_paths_of_new_runs() -> None:
    """Scale, growth and radius together, each fitted to the same few runs: their freedom is allowed for."""
    held = []
    for seed in range(30):
        drawn, bands = made(seed)
        fresh = runs(1000 + seed, count=30)
        regions = [bands.region(fresh.paths, fresh.columns, 1.0, level) for level in (0.5, 0.8, 0.9)]
        held.append([region.holds(fresh.errors).mean() for region in regions])
        assert drawn is not None
    np.testing.assert_allclose(np.mean(held, axis=0), [0.5, 0.8, 0.9], atol=0.035)


def test_neither_order_nor_unit_matters() -> None:
    drawn, bands = made(2)
    size = len(drawn.run) // 22
    places = np.random.default_rng(0).permutation(22)[:, None] * size + np.arange(size)
    shuffled = drawn.bands(places.ravel())
    for name in ("along", "across", "whole", "slopes"):
        np.testing.assert_allclose(getattr(shuffled, name), getattr(bands, name), rtol=1e-6)
    miles = drawn.bands(scale=1 / 1852)
    here = bands.region(drawn.paths, drawn.columns, 1.0, 0.9)
    columns = {**drawn.columns, "u": drawn.columns["u"] / 1852}
    there = miles.region(drawn.paths / 1852, columns, 1.0, 0.9)
    np.testing.assert_allclose(there.radius * 1852, here.radius, rtol=1e-4)


def test_each_kind_has_its_radii() -> None:
    """Zigzags whose errors are three times those of turning circles: each kind holds its share for itself."""
    held = {"zigzag": [], "turning": []}
    for seed in range(16):
        drawn, fresh = runs(seed, count=30), runs(2000 + seed, count=30)
        for one in (drawn, fresh):
            wild = np.array([one.kinds[str(name)] == "zigzag" for name in one.run])
            one.errors[:, wild] *= 3.0
        bands = drawn.bands()
        assert bands.kinds == {"turning": 15, "zigzag": 15}
        for kind, shares in held.items():
            mine = np.array([fresh.kinds[str(name)] == kind for name in fresh.run])
            region = bands.region(fresh.paths, fresh.columns, 1.0, 0.9, kind=kind)
            shares.append(region.holds(fresh.errors)[mine].mean())
    assert min(np.mean(shares) for shares in held.values()) > 0.86
    assert max(np.mean(shares) for shares in held.values()) < 0.96


def test_runs_without_errors_do_not_calibrate() -> None:
    drawn = runs(0, count=6)
    errors = drawn.errors.copy()
    errors[:, drawn.run != "M000"] = np.nan
    assert calibrate_bands(errors, drawn.paths, drawn.run, drawn.columns, NAMES, 1.0) is None
    errors[:, np.isin(drawn.run, ["M001", "M002", "M003"])] = 1.0
    bands = calibrate_bands(errors, drawn.paths, drawn.run, drawn.columns, NAMES, 1.0)
    assert bands.runs == 4


def test_what_a_score_is_divided_by_comes_from_the_other_runs() -> None:
    """Errors of one run three times as large: its scores are three times as large, those of the others smaller."""
    rng = np.random.default_rng(4)
    of = shares_of_runs(np.repeat(np.arange(6), 8))
    apart, mine = rng.uniform(0.5, 2.0, (5, 48, 2)), of.place == 2
    larger = np.where(mine[:, None], 3.0, 1.0) * apart
    still = np.zeros((48, 5))  # no traits: no growth
    one, other = (_fit_scores(of, errors, still)[2] for errors in (apart, larger))
    np.testing.assert_allclose(other[:, mine], 3.0 * one[:, mine], rtol=1e-12)
    assert (other[:, ~mine] < one[:, ~mine]).all()


def test_slopes_without_a_run_are_those_of_the_other_runs() -> None:
    """A ridge regression by least squares with rows that stand for the prior; every run counts as one sample."""
    rng, place = np.random.default_rng(4), np.repeat(np.arange(4), [3, 9, 5, 7])
    runs, traits = shares_of_runs(place), rng.standard_normal((24, 5))
    scores = np.exp(0.4 * traits[:, 0] + 0.3 * traits[:, 4] + 0.2 * rng.standard_normal(24))
    slopes, without = _growth_slopes(runs, traits, scores)
    target = np.log(scores)
    noise = runs.weight @ (target - runs.weight @ target) ** 2
    prior = np.sqrt(noise) / PRIOR * np.eye(6)[1:]
    for found, kept in [(slopes, place >= 0), *((without[i], place != i) for i in range(4))]:
        root = np.sqrt(runs.count * runs.weight[kept])[:, None]
        rows = np.concatenate([root * np.column_stack([np.ones(kept.sum()), traits[kept]]), prior])
        wanted = np.linalg.lstsq(rows, np.append(root[:, 0] * target[kept], np.zeros(5)), rcond=None)[0]
        assert wanted[-1] > 0
        np.testing.assert_allclose(found, wanted[1:], rtol=1e-6)


def rough(seed: int, count: int, waves: float) -> tuple[Array, Array, dict[str, Array], dict[str, Array], Array]:
    """Errors, paths, columns, past and run of windows in a sea: motion and errors are in proportion to its height."""
    drawn, rng = runs(seed, count, alike=0.1), np.random.default_rng(seed)
    of = np.repeat(np.arange(count), len(drawn.run) // count)
    height = waves * np.exp(0.2 * rng.standard_normal(count))[of]
    swell = 0.1 * height * rng.standard_normal((3, 21, len(of)))
    slow = np.linspace(-1, 1, 21)[:, None] * rng.standard_normal((3, 1, len(of)))  # of a manoeuvre: it does not count
    series = dict(zip("uvr", swell + slow + 3.0, strict=True))
    columns = drawn.columns | {name: values[-1] for name, values in series.items() if name == "v"}
    past = {name: values[:-1] + (columns[name] - values[-1]) for name, values in series.items()}
    return height[:, None] * drawn.errors, drawn.paths, columns, past, drawn.run


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_a_higher_sea_widens_the_band_and_a_lower_one_does_not(unit: float) -> None:
    """Twice the motion and twice the errors, of which training has seen nothing; speeds in any unit."""
    held, plain = [], []
    for seed in range(6):
        errors, paths, columns, past, run = rough(seed, 40, 1.0)
        rescaled = {name: unit * values for name, values in past.items()}
        here = {**columns, **{name: unit * columns[name] for name in "uvr"}}
        bands = calibrate_bands(errors, paths + errors, run, here, NAMES, 1.0 / unit, past=rescaled)
        assert bands.fast.growth(here, rescaled).min() == 1
        errors, paths, columns, past, run = rough(100 + seed, 40, 2.0)
        here = {**columns, **{name: unit * columns[name] for name in "uvr"}}
        rescaled = {name: unit * values for name, values in past.items()}
        still = replace(bands, fast=None)
        held.append(bands.region(paths, here, 1.0 / unit, 0.9, past=rescaled).holds(errors).mean())
        plain.append(still.region(paths, here, 1.0 / unit, 0.9).holds(errors).mean())
    assert np.mean(held) > 0.85
    assert np.mean(plain) < 0.8


@pytest.mark.parametrize("period", [2.5, 12.0])
def test_waves_of_another_period_widen_the_band_and_training_pays_a_tenth(period: float) -> None:
    """Waves of 5 s, then as high ones that are shorter or longer; no band is narrower than it would be without."""

    def waves(seconds: float, seed: int) -> tuple[dict[str, Array], dict[str, Array]]:
        rng, height = np.random.default_rng(seed), np.exp(0.3 * np.random.default_rng(seed).standard_normal(count))
        phase = 2 * np.pi * (np.arange(21)[:, None] / seconds + rng.random((3, 1, count)))
        series = dict(zip("uvr", 3.0 + height * np.sin(phase), strict=True))
        here = {**drawn.columns, **{name: values[-1] for name, values in series.items()}}
        return here, {name: values[:-1] for name, values in series.items()}

    drawn = runs(3, 30)
    count = len(drawn.run)
    here, past = waves(5.0, 1)
    bands = calibrate_bands(drawn.errors, drawn.paths + drawn.errors, drawn.run, here, NAMES, 1.0, past=past)
    size = replace(bands, fast=None).growth(drawn.paths, here, 1.0)
    usual = bands.fast.growth(here, past)
    assert (usual * size).mean() / size.mean() == pytest.approx(WIDER, abs=0.01)
    assert usual.min() == 1
    assert np.median(bands.fast.growth(*waves(period, 2))) > 1.2 * np.median(usual)
