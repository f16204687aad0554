"""Bands of a study: what its cells keep, what the frames say, refits, and a log with a band."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from typer.testing import CliRunner

from shipid.answer import bands
from shipid.answer.findings import judge_findings
from shipid.cli import app
from shipid.errors import DataError
from shipid.hybrid.bands import LEVELS, Bands
from shipid.predictor import NO_BAND, Predictor
from shipid.study import store
from shipid.study.apply import BandSettings, adapt_along_run
from shipid.study.plan import read_plan
from shipid.study.results import Results, read_results
from tests.study.tiny import run_here, tiny_plan

LEVEL = 0.8  # the tiny study has 6 runs at most


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("bands")
    run_here(
        tiny_plan(
            made, {"bands.level": LEVEL, "family.1.members": 1, "claims": {"accurate": "right", "inaccurate": "wrong"}}
        ),
        made / "run",
    )
    return made / "run"


@pytest.fixture(scope="module")
def results(folder: Path) -> Results:
    return read_results(folder)


def spoken(results: Results) -> list[tuple[str, str]]:
    return bands.answer_on_bands(results, bands.coverage_frame(results))


def test_cells_keep_coverage_and_width(results: Results) -> None:
    for row in results.rows:
        kept = results.bands.get(row["cell"])
        if kept is None or not kept.promises(LEVEL):
            assert np.isnan(row["coverage"])
            assert results.no_band[row["cell"]]
        else:
            region = kept.region(results.paths[row["cell"]], results.test.columns, results.test.step, LEVEL)
            errors = results.test.future - results.paths[row["cell"]]
            held, run = region.holds(errors), results.test.run
            by_run = [held[run == name].mean() for name in np.unique(run)]
            assert row["coverage"] == pytest.approx(np.mean(by_run))
            assert row["width"] == pytest.approx(region.radius.mean())
    assert results.cells["width"].notna().any()


def test_a_study_of_several_methods_says_whose_bands_it_speaks_of(results: Results) -> None:
    """Findings speak of the method that the study judges by, this sentence of all that have a band."""
    (way,) = results.plan.methods
    plan = replace(results.plan, methods=(way, replace(way, name="other")))
    assert "of the method" not in spoken(results)[0][0]
    assert f" models of the method {way.name!r} with " in spoken(replace(results, plan=plan))[0][0]
    most = results.cells["N_D"].max()
    cells = results.cells.assign(method=np.where(results.cells["family"].eq("none"), "other", way.name))
    said = spoken(replace(results, plan=plan, cells=cells))[0][0]
    named = [repr(name) for name in cells["method"][cells["width"].notna() & cells["N_D"].eq(most)].unique()]
    assert f" models of the methods {' and '.join(named)} with {most} runs" in said


def test_the_higher_the_level_the_wider(results: Results) -> None:
    frame = bands.coverage_frame(results)
    width = frame.pivot_table(index=["model", "N_D"], columns="level", values="width").diff(axis=1)
    assert (width.fillna(0.0) >= 0).all(axis=None)


def test_a_model_without_physics_that_has_failed_has_no_part_in_the_promise(results: Results) -> None:
    """Its cell has no band: the report of a whole study ended in a traceback for it."""
    lost = results.cells["foundation"].eq("none")
    cells = results.cells.assign(status=results.cells["status"].mask(lost, "failed"))
    kept = {cell: path for cell, path in results.paths.items() if cell not in set(cells["cell"][lost])}
    known = {cell: band for cell, band in results.bands.items() if cell in kept}
    verdicts = judge_findings(replace(results, cells=cells, paths=kept, bands=known))
    assert [one["id"] for one in verdicts][-2:] == ["B1", "B2"]
    assert verdicts[-1]["numbers"]


def test_findings_say_what_the_cells_hold(results: Results) -> None:
    verdicts = {one["id"]: one for one in judge_findings(results)}
    top = results.cells[results.cells["N_D"] == results.cells["N_D"].max()].groupby("foundation")[
        ["A", "coverage", "width"]
    ]
    means = top.mean()
    good, bad = means["A"].dropna().sort_values().index
    ratio = means.loc[bad, "width"] / means.loc[good, "width"]
    assert verdicts["B1"]["numbers"]["ratio of widths"] == pytest.approx(ratio)
    assert verdicts["B2"]["numbers"]["share at 80 %"] == pytest.approx(means["coverage"].mean())
    assert verdicts["B2"]["verdict"] == "undecided", "two test runs decide nothing"


def test_a_kind_that_no_run_of_calibration_has_is_promised_nothing(results: Results) -> None:
    """The sentence spoke of a band for this kind alone; that of all kinds promises it nothing either."""
    other = {cell: replace(band, kinds={"spiral": band.runs}) for cell, band in results.bands.items()}
    words = [sentence for sentence, _ in spoken(replace(results, bands=other))]
    (kind,) = set(results.kinds.values())
    assert f"Nothing is promised for {kind}: no such run calibrated the bands." in words
    promise = judge_findings(replace(results, bands=other))[-1]
    assert promise["verdict"] == "undecided"
    assert f"no run of the kind {kind} calibrated them, so they promise nothing for 4" in promise["evidence"]


def test_too_few_runs_are_reported(tiny_run: Path) -> None:
    results = read_results(tiny_run)  # 0.9 of 6 runs
    assert results.cells["coverage"].isna().all()
    assert "needs 9 runs or more" in spoken(results)[0][0]


def test_predict_writes_the_band(folder: Path, tmp_path: Path, results: Results) -> None:
    cell = next(cell for cell, kept in results.bands.items() if kept.promises(LEVEL))
    out, log = tmp_path / "band.csv", folder / store.DATASET
    plain = CliRunner().invoke(app, ["predict", str(folder), str(log), "--cell", cell, "--out", str(out)])
    assert plain.exit_code == 0, plain.output
    assert "band_along" not in pd.read_csv(out)
    asked = ["predict", str(folder), str(log), "--cell", cell, "--out", str(out), "--level", str(LEVEL)]
    assert CliRunner().invoke(app, asked).exit_code == 0
    frame = pd.read_csv(out)
    assert (frame[["band_along", "band_across"]] > 0).all(axis=None)
    assert frame["band_course"].between(0, 2 * np.pi).all()
    assert CliRunner().invoke(app, [*asked, "--adaptive", "0.1"]).exit_code == 0
    adaptive = pd.read_csv(out)
    np.testing.assert_allclose(adaptive["band_along"], frame["band_along"] * adaptive["band_factor"])
    assert adaptive["band_factor"].nunique() > 1
    since = adaptive["t"] - adaptive.groupby("run")["t"].transform("min")
    before = since < adaptive["ahead"].max() - 1e-6  # no path of the run has ended yet
    np.testing.assert_allclose(adaptive["band_factor"][before], 1.0)
    with pytest.raises(DataError, match="needs 99 runs"):
        CliRunner().invoke(app, [*asked[:-1], "0.99"], catch_exceptions=False)


def test_an_adaptive_band_looks_at_ended_paths_alone() -> None:
    """A miss at instant 0 whose path ends at 5 s widens the band from 5 s on, not before."""
    now, table = np.arange(12.0), -np.log1p(-LEVELS)
    reach = np.where(now == 0, 2.0, 0.5)
    factors = adapt_along_run(reach, now + 5.0, now, BandSettings(0.9, rate=0.05), table)
    np.testing.assert_array_equal(factors[:5], 1.0)
    assert factors[5] > 1.0
    assert (np.diff(factors[5:]) < 0).all()
    later = adapt_along_run(np.where(now > 6, np.nan, reach), now + 5.0, now, BandSettings(0.9, rate=0.05), table)
    np.testing.assert_array_equal(later, factors)


@pytest.mark.parametrize("horizon", [15, 60])
def test_paths_that_begin_within_a_horizon_do_not_widen_a_band_for_one_error_each(horizon: int) -> None:
    """Errors three times those of training, alike from row to row: a band that is three times as wide is right.

    Each path counted whole, before: the factor came to 1e3 with 15 and 1e9 with 60 paths within a horizon.
    """
    rng, now = np.random.default_rng(3), np.arange(4000.0)
    table = np.sqrt(-2 * np.log1p(-LEVELS))  # radii of Rayleigh's law
    plane = lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], rng.normal(size=(2, len(now))))
    reach = 3 * np.hypot(*plane) / float(np.interp(0.9, LEVELS, table))
    factors = adapt_along_run(reach, now + horizon, now, BandSettings(0.9, rate=0.02), table)
    later = now > 2000
    assert np.mean(reach[later] > factors[later]) == pytest.approx(0.1, abs=0.03)
    assert np.median(factors[later]) == pytest.approx(3.0, rel=0.2)
    assert factors.max() < 12.0


@pytest.mark.slow
def test_refits_calibrate_what_has_no_errors_left_out(tmp_path: Path) -> None:
    """An identified family and a method trained step by step: without a band by default, with one from refits."""
    changes = {
        "bands": {"level": 0.7, "refits": 3},
        "method": [
            {"name": "alone", "kind": "alone"},
            {"name": "steps", "kind": "one-step", "trials": 1, "families": ["wrong"]},
        ],
        "grid.N_D": [6],
    }
    file = tmp_path / "tiny.toml"
    from tests.study.tiny import TINY

    file.write_text(
        TINY.read_text()
        + '\n[[family]]\nname = "fitted"\nextends = "wrong"\n'
        + '[family.identify]\nparameters = ["hull.derivatives.N_ur"]\n'
    )
    run_here(read_plan(file, changes), tmp_path / "run")
    results = read_results(tmp_path / "run")
    assert set(results.bands) == set(results.paths)
    assert {kept.runs for kept in results.bands.values()} == {6}
    run_here(read_plan(file, {**changes, "bands": {"level": 0.7}}), tmp_path / "without")
    plain = read_results(tmp_path / "without")
    lost = set(results.bands) - set(plain.bands)
    assert {(cell.partition("-")[0], cell.partition("+")[2].partition("-")[0]) for cell in lost} == {
        ("fitted", "alone"),
        ("wrong", "steps"),
    }
    assert all("refits" in plain.no_band[cell] for cell in lost)
    for cell, kept in plain.bands.items():
        same: Bands = results.bands[cell]
        np.testing.assert_array_equal(same.whole, kept.whole)
    stored = Predictor.load(store.cell_file(tmp_path / "run", next(iter(lost))))
    assert stored.bands is not None


def test_why_no_band_is_promised_is_the_reason_of_the_cells_with_most_runs(results: Results) -> None:
    most = max(row["N_D"] for row in results.rows)
    reasons = {row["cell"]: f"{NO_BAND}{row['N_D']} runs calibrate it" for row in results.rows}
    ((sentence, _),) = spoken(replace(results, bands={}, no_band=reasons))
    assert sentence.startswith(f"No band is promised: {most} runs calibrate it (")


def test_a_refit_that_has_too_little_to_train_leaves_its_runs_without_errors(tmp_path: Path) -> None:
    """Before, it ended the whole study: two of three runs leave one, whose windows cannot be parted in time."""
    step = {"name": "step", "kind": "one-step", "trials": 1, "units": 8}
    changes = {"method": [step], "grid.N_D": [3], "truth.duration": 12.0, "bands.refits": 2}
    plan = tiny_plan(tmp_path, changes)
    run_here(plan, tmp_path / "run")
    results = read_results(tmp_path / "run")
    assert (results.cells["status"] == "ok").all()
    assert all(results.no_band[cell] for cell in results.cells["cell"])
