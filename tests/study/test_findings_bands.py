"""Findings B1 and B2: how often they err where the truth is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from shipid.hybrid.bands import Region
from shipid.study import findings_bands
from shipid.study.error_table import ErrorTable
from shipid.study.findings_bands import Widths, _of_known_kinds, _width_table, band_findings, kept_promise, narrower
from shipid.study.verdict import Verdict
from tests.study.made_up import Size, table

LEVEL = 0.9


def drawn_plan(methods: list[str]) -> Any:
    """A plan that judges by the method `drawn`, of several methods."""
    ways = [SimpleNamespace(name=name, foundations=(), method=SimpleNamespace(compensates=True)) for name in methods]
    study = SimpleNamespace(claims=None, bands=SimpleNamespace(level=LEVEL))
    return SimpleNamespace(methods=ways, study=study)


def held(rng: np.random.Generator, share: float, runs: int = 20, windows: int = 50) -> Verdict:
    """Verdict on B2 where bands hold a share of the paths, more in some manoeuvres than in others."""
    each = rng.beta(4 * share, 4 * (1 - share), runs)
    inside = rng.random((runs, windows)) < each[:, None]
    return kept_promise(inside.ravel().astype(float), np.repeat(np.arange(runs).astype(str), windows), LEVEL)["verdict"]


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
        finding = kept_promise((rng.random(len(run)) < each).astype(float), run, LEVEL)
        verdicts.append(finding["verdict"])
    assert verdicts.count("refuted") <= 14
    assert "(24 test manoeuvres, each counts the same)" in finding["evidence"]


def test_a_kind_that_no_run_of_calibration_has_breaks_no_promise() -> None:
    """Circles keep it, zigzags, which no band knows, do not: the promise was refuted for them."""
    run = np.repeat(np.arange(30).astype(str), 10)
    kinds = {str(k): "zigzag" if k < 10 else "turning" for k in range(30)}
    inside = np.array([kinds[name] == "turning" for name in run], dtype=float)
    inside[-1] = 0.0
    assert kept_promise(inside, run, LEVEL)["verdict"] == "refuted"
    finding = _of_known_kinds(inside, run, LEVEL, kinds, [{"turning": 12}, {}])
    assert finding["verdict"] == "confirmed"
    assert "(20 test manoeuvres); no run of the kind zigzag calibrated them" in finding["evidence"]
    assert _of_known_kinds(inside, run, LEVEL, kinds, [{"steps": 12}])["verdict"] == "undecided"
    assert _of_known_kinds(inside, run, LEVEL, kinds, [{}]) == kept_promise(inside, run, LEVEL)


def test_a_plainly_kept_and_a_plainly_broken_promise_are_seen() -> None:
    rng = np.random.default_rng(4)
    assert [held(rng, 0.97, runs=60) for _ in range(20)].count("confirmed") >= 18
    assert [held(rng, 0.6) for _ in range(20)].count("refuted") >= 18


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
    found = kept_promise(np.concatenate(inside).astype(float), np.repeat(np.arange(40).astype(str), 25), LEVEL)
    assert found["verdict"] == expected


def test_few_test_manoeuvres_decide_nothing() -> None:
    assert held(np.random.default_rng(5), 0.97, runs=4) == "undecided"


@pytest.mark.parametrize(("bad", "expected"), [(2.0, "confirmed"), (0.5, "refuted")])
def test_of_two_models_the_less_accurate_has_the_wider_band(bad: float, expected: str) -> None:
    size = Size(runs=20, amounts=(5, 20))
    widths = {"good": np.array([2.0, 1.0]), "bad": bad * np.array([2.0, 1.0])}
    drawn = table(np.random.default_rng(1), size, {"good": 1.0, "bad": 2.0}, widths)
    finding = narrower(Widths(drawn, ("good", "bad"), rivals=True))
    assert finding["verdict"] == expected
    assert finding["numbers"]["ratio of widths"] == pytest.approx(bad, rel=0.3)


@pytest.mark.parametrize(("A", "expected"), [(0.5, "confirmed"), (1.0, "undecided")])
def test_which_of_two_models_is_more_accurate_is_seen_from_the_test(A: float, expected: str) -> None:
    """The band of the model that the study calls accurate is wider: the claim was refuted where so is its A."""
    widths = {"good": np.array([4.0, 2.0]), "bad": np.array([2.0, 1.0])}
    drawn = table(np.random.default_rng(1), Size(runs=20, amounts=(5, 20)), {"good": 1.0, "bad": A}, widths)
    drawn = replace(drawn, A={"good": drawn.A["good"], "bad": A * drawn.A["good"][::-1]})
    finding = narrower(Widths(drawn, ("good", "bad"), rivals=True))
    assert finding["verdict"] == expected
    assert ("it is not shown which of them is more accurate" in finding["evidence"]) == (expected == "undecided")


def test_fewer_models_than_an_order_needs_decide_nothing() -> None:
    size = Size()
    names = ("a", "b", "c")
    drawn = table(
        np.random.default_rng(1), size, dict.fromkeys(names, 1.0), dict.fromkeys(names, np.ones(len(size.amounts)))
    )
    assert narrower(Widths(drawn, names))["verdict"] == "undecided"


def test_two_members_of_families_are_no_order() -> None:
    """Which of a moderate and a high member is the more accurate is seen from A alone, and two are too few."""
    widths = {"moderate": np.array([4.0, 2.0]), "high": np.array([2.0, 1.0])}
    drawn = table(np.random.default_rng(1), Size(runs=20, amounts=(5, 20)), {"moderate": 2.0, "high": 1.0}, widths)
    finding = narrower(Widths(drawn, ("moderate", "high")))
    assert finding["verdict"] == "undecided"
    assert finding["evidence"] == "2 models with physics, a trend needs 5"


@pytest.mark.parametrize(("power", "expected"), [(1.0, "confirmed"), (-1.0, "refuted")])
def test_an_order_of_many_models_and_its_opposite_are_seen(power: float, expected: str) -> None:
    A = {f"model-{k}": float(k) for k in range(1, 9)}
    widths = {name: value**power * np.array([2.0, 1.0]) for name, value in A.items()}
    drawn = table(np.random.default_rng(1), Size(runs=20, amounts=(5, 20)), A, widths)
    finding = narrower(Widths(drawn, tuple(A)))
    assert finding["verdict"] == expected
    assert np.sign(finding["numbers"]["least rank correlation of width and A"]) == power


@pytest.mark.parametrize(("runs", "interval"), [(4, False), (20, True)])
def test_a_share_has_an_interval_where_there_are_enough_manoeuvres(runs: int, interval: bool) -> None:
    finding = kept_promise(np.tile([1.0, 1.0, 1.0, 0.0], runs), np.repeat(np.arange(runs).astype(str), 4), LEVEL)
    assert ("[" in finding["evidence"]) == interval
    assert finding["numbers"] == {"share at 90 %": 0.75}


@pytest.mark.filterwarnings("error")
def test_no_width_rises_with_an_A_that_all_models_have() -> None:
    models, hard = tuple("abcde"), np.linspace(0.9, 1.1, 8)
    widths = {name: hard[None, None] * (k + 1) for k, name in enumerate(models)}
    same = ErrorTable((10,), np.ones(8), dict.fromkeys(models, 2.0 * hard), widths)
    finding = narrower(Widths(same, models))
    assert finding["verdict"] == "undecided"
    assert "the same A" in finding["evidence"]


def test_widths_are_means_of_each_manoeuvre_where_every_model_has_a_band() -> None:
    """At N_D = 5 the model without physics has none, so that amount of data is left out."""
    run, names = np.array(["a", "a", "b"]), ("good", "none")
    rows = [
        {"cell": f"{name}-{N}", "foundation": name, "method": "drawn", "N_D": N, "seed": 0}
        for name in names
        for N in (5, 20)
    ]
    paths = {str(row["cell"]): np.zeros((2, 3, 2)) for row in rows}
    results: Any = SimpleNamespace(
        cells=pd.DataFrame(rows),
        plan=drawn_plan(["drawn"]),
        test=SimpleNamespace(run=run, future=np.ones((2, 3, 2))),
        paths=paths,
        physics={"good": np.zeros((2, 3, 2))},
    )
    widths = {cell: np.array([1.0, 3.0, 7.0]) for cell in paths if cell != "none-5"}
    drawn = _width_table(results, ["good"], widths)
    assert drawn.amounts == (20,)
    np.testing.assert_array_equal(drawn.counts, [2, 1])
    for name in names:
        np.testing.assert_array_equal(drawn.H[name], [[[2.0, 7.0]]])


@pytest.mark.parametrize(("methods", "of"), [(["drawn"], ""), (["drawn", "memory"], " of the method 'drawn'")])
def test_a_model_without_physics_that_has_failed_has_no_part_in_the_promise(
    methods: list[str], of: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its cell has no band: the report of a whole study ended in a traceback for it."""
    run, models = np.repeat(["a", "b", "c", "d", "e"], 2), ("good", "bad")
    rows = [
        {"cell": f"{name}-9", "foundation": name, "method": "drawn", "N_D": 9, "seed": 0} for name in (*models, "none")
    ]
    results: Any = SimpleNamespace(
        cells=pd.DataFrame(rows),
        complete=True,
        plan=drawn_plan(methods),
        test=SimpleNamespace(run=run, future=np.ones((2, 10, 2))),
        paths={f"{name}-9": np.zeros((2, 10, 2)) for name in models},
        physics=dict.fromkeys(models, np.zeros((2, 10, 2))),
        kinds=dict.fromkeys("abcde", "zigzag"),
        bands={f"{name}-9": SimpleNamespace(kinds={"zigzag": 9}) for name in models},
    )
    wide = np.full((2, 10), 9.0)

    def regions(*_: Any) -> Any:
        return (
            (row, {LEVEL: Region(np.broadcast_to([1.0, 0.0], (2, 10, 2)), wide, wide)}, np.ones((2, 10, 2)))
            for row in rows[:2]
        )

    monkeypatch.setattr(findings_bands, "regions", regions)
    first, second = band_findings(results, models, rivals=True)
    assert first["verdict"] == "undecided"  # both are as wide
    assert second["numbers"] == {"share at 90 %": 1.0}
    for one in (first, second):
        assert one["evidence"].count("of the method") == one["evidence"].count(f"; bands{of}") == bool(of)
    results.bands = {}
    monkeypatch.setattr(findings_bands, "regions", lambda *_: iter(()))
    for one in band_findings(results, models, rivals=True):
        assert one["evidence"] == f"no two models with physics{of} have a band of 90 %"
