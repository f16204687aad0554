"""Findings B1 and B2: how often they err where the truth is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from shipid.answer.findings import BAND_RULES, Promise, Widths
from tests.answer.made_up import Size, table

LEVEL = 0.9


def promise(inside: np.ndarray, run: np.ndarray) -> tuple[str, str, Any]:
    return BAND_RULES["B2"].decide(Promise(inside.astype(float), run, LEVEL))


def trend(widths: Widths) -> tuple[str, str, Any]:
    return BAND_RULES["B1"].decide(widths)


def held(rng: np.random.Generator, share: float, runs: int = 20, windows: int = 50) -> str:
    """Verdict on B2 where bands hold a share of the paths, more in some manoeuvres than in others."""
    each = rng.beta(4 * share, 4 * (1 - share), runs)
    inside = rng.random((runs, windows)) < each[:, None]
    return promise(inside.ravel(), np.repeat(np.arange(runs).astype(str), windows))[0]


def test_a_kept_promise_is_refuted_and_a_broken_one_confirmed_in_at_most_5_percent() -> None:
    rng, count = np.random.default_rng(3), 120
    assert sum(held(rng, LEVEL) == "refuted" for _ in range(count)) <= 14  # 5 % of 120, but for 1 in 1,000
    assert sum(held(rng, LEVEL - 0.05) == "confirmed" for _ in range(count)) <= 14


def test_long_manoeuvres_that_are_harder_break_no_promise() -> None:
    """A band promises whole paths of a new run, long or short: 84 % in long and 96 % in short ones are 90 %."""
    rng, verdicts = np.random.default_rng(6), []
    share, windows = np.tile([0.84, 0.96], 12), np.tile([60, 6], 12)
    run = np.repeat(np.arange(24).astype(str), windows)
    for _ in range(120):
        each = np.repeat(rng.beta(8 * share, 8 * (1 - share)), windows)
        verdict, evidence, _ = promise(rng.random(len(run)) < each, run)
        verdicts.append(verdict)
    assert verdicts.count("refuted") <= 14
    assert "(24 test manoeuvres, each counts the same)" in evidence


@pytest.mark.parametrize(
    ("shares", "expected"), [((0.88, 0.92), "confirmed"), ((0.76, 1.0), "undecided"), ((0.8, 0.92), "refuted")]
)
def test_a_promise_is_kept_from_5_points_below_the_level_on(shares: tuple[float, float], expected: str) -> None:
    """40 manoeuvres of 25 windows, by Student: of the first the interval ends between 0.85 and 0.9."""
    inside = [np.arange(25) < round(25 * share) for share in np.tile(shares, 20)]
    error = stats.t.ppf(0.975, 39) * np.tile(shares, 20).std(ddof=1) / np.sqrt(40)
    low, high = np.mean(shares) - error, np.mean(shares) + error
    assert expected == ("confirmed" if low >= 0.85 else "refuted" if high < 0.9 else "undecided")
    assert low < 0.9
    assert promise(np.concatenate(inside), np.repeat(np.arange(40).astype(str), 25))[0] == expected


@pytest.mark.parametrize(("bad", "expected"), [(2.0, "confirmed"), (0.5, "refuted")])
def test_of_two_models_the_less_accurate_has_the_wider_band(bad: float, expected: str) -> None:
    size = Size(runs=20, amounts=(5, 20))
    widths = {"good": np.array([2.0, 1.0]), "bad": bad * np.array([2.0, 1.0])}
    drawn = table(np.random.default_rng(1), size, {"good": 1.0, "bad": 2.0}, widths)
    verdict, _evidence, numbers = trend(Widths(drawn, ("good", "bad"), rivals=True))
    assert verdict == expected
    assert numbers["ratio of widths"] == pytest.approx(bad, rel=0.3)


@pytest.mark.parametrize(("A", "expected"), [(0.5, "confirmed"), (1.0, "undecided")])
def test_which_of_two_models_is_more_accurate_is_seen_from_the_test(A: float, expected: str) -> None:
    """The band of the model that the study calls accurate is wider: the claim was refuted where so is its A."""
    widths = {"good": np.array([4.0, 2.0]), "bad": np.array([2.0, 1.0])}
    drawn = table(np.random.default_rng(1), Size(runs=20, amounts=(5, 20)), {"good": 1.0, "bad": A}, widths)
    drawn = replace(drawn, A={"good": drawn.A["good"], "bad": A * drawn.A["good"][::-1]})
    verdict, evidence, _numbers = trend(Widths(drawn, ("good", "bad"), rivals=True))
    assert verdict == expected
    assert ("it is not shown which of them is more accurate" in evidence) == (expected == "undecided")


@pytest.mark.parametrize(("power", "expected"), [(1.0, "confirmed"), (-1.0, "refuted")])
def test_an_order_of_many_models_and_its_opposite_are_seen(power: float, expected: str) -> None:
    A = {f"model-{k}": float(k) for k in range(1, 9)}
    widths = {name: value**power * np.array([2.0, 1.0]) for name, value in A.items()}
    drawn = table(np.random.default_rng(1), Size(runs=20, amounts=(5, 20)), A, widths)
    verdict, _evidence, numbers = trend(Widths(drawn, tuple(A)))
    assert verdict == expected
    assert np.sign(numbers["least rank correlation of width and A"]) == power
