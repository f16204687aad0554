"""Predictions of others: scored as the study scores its own, and what is wrong with them is named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import shipid
from shipid.data.windows import Windows, from_frame
from shipid.errors import DataError
from shipid.foundations.predictions import prediction_table
from shipid.study.results import Results, read_results
from shipid.study.score import read_predictions
from shipid.study.windows import windows
from tests.cli.running import output_of
from tests.hybrid.quick import QUICK
from tests.study.tiny import run_here, tiny_plan, without_figures

Array = np.ndarray
KINDS = ["alone", *(kind for kind in QUICK if kind != "forest")]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """A small study of every bundled method that needs no further package, on physics that is far from the truth."""
    folder = tmp_path_factory.mktemp("scored")
    blocks = [{"name": kind, "kind": kind, "families": ["*"], **QUICK.get(kind, {})} for kind in KINDS]
    rough = [{"parameters": ["hull.derivatives.*"], "factor": [0.4, 1.6]}]
    family = [{"name": "wrong", "base": "gunnerus-28.9", "members": 2, "perturb": rough}]
    changes = {"method": json.loads(json.dumps(blocks)), "family": family, "grid.N_D": [4], "prediction.past": 4.0}
    noise = {name: {"noise": 0.02} for name in ("u", "v", "north", "east")}
    plan = tiny_plan(folder, {**changes, "truth.duration": 40.0, "truth.sensors": noise})
    run_here(plan, folder / "run")
    return read_results(folder / "run")


def written(file: Path, results: Results, path: Array, **columns: Any) -> Path:
    prediction_table(results.test, path).assign(**columns).to_parquet(file)
    return file


def test_own_predictions_have_the_score_of_the_study_and_are_not_accused(tmp_path: Path, results: Results) -> None:
    rows = [row for row in results.rows if row["status"] == "ok"]
    assert {row["method"] for row in rows} == {*KINDS}
    for row in rows:
        file = written(tmp_path / "mine.parquet", results, results.paths[row["cell"]], N_D=4, seed=0)
        (one,) = read_predictions(file, results)
        assert (one.label, one.N_D, one.doubt) == ("mine", 4, ""), row["cell"]
        error = shipid.position_error(one.paths, results.test.future)
        assert [error.mean(), np.quantile(error, 0.9)] == pytest.approx([row["H"], row["H_90"]], rel=1e-9)


def turned(path: Array, test: Windows, psi: Array) -> Array:
    """Places (T, S, 2) [m] of a path that another heading turns."""
    return np.stack(from_frame(path[..., 0], path[..., 1], test.columns["north"], test.columns["east"], psi), axis=-1)


FAULTS: dict[str, Callable[[Array, Windows], Array]] = {
    "wrong frame, north and east are exchanged": lambda p, w: turned(p, w, w.columns["psi"])[..., ::-1],
    "wrong frame, north and east count": lambda p, w: turned(p, w, w.columns["psi"]) - turned(0 * p, w, np.zeros(1)),
    "wrong frame, north and east are x and y": lambda p, _: p,
    "wrong frame, x and y are added": lambda p, w: turned(p, w, np.zeros(1)),
    "wrong frame, the heading": lambda p, w: turned(p, w, -w.columns["psi"]),
    "mirrored, port": lambda p, w: turned(p * [1, -1], w, w.columns["psi"]),
    "mirrored, ahead": lambda p, w: turned(-p, w, w.columns["psi"]),
    "in degrees, the heading": lambda p, w: turned(p, w, np.degrees(w.columns["psi"])),
    "in degrees, north": lambda p, w: [63.0, 10.0] + turned(p, w, w.columns["psi"]) / [111120.0, 50448.0],
    "in mm, north and east": lambda p, w: 1000 * turned(p, w, w.columns["psi"]),
    "in km, north and east": lambda p, w: turned(p, w, w.columns["psi"]) / 1000,
    "in ft, north and east": lambda p, w: turned(p, w, w.columns["psi"]) / 0.3048,
    "late by 1 step": lambda p, w: turned(np.concatenate([0 * p[:1], p[:-1]]), w, w.columns["psi"]),
    "saw the future, early by 1 step": lambda p, w: turned(
        np.concatenate([p[1:], 2 * p[-1:] - p[-2:-1]]), w, w.columns["psi"]
    ),
    "the path does not start": lambda p, w: turned(p + np.array([9.0, -4.0]), w, w.columns["psi"]),
    "saw the future: at": lambda p, w: turned(0.03 * p + 0.97 * w.future, w, w.columns["psi"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_named(tmp_path: Path, results: Results, fault: str) -> None:
    """In predictions of cells that are drawn among those that err less than half as much as constant u, v, r."""
    good = [row["cell"] for row in results.rows if row["H"] < results.naive.mean() / 2]
    for cell in np.random.default_rng(len(fault)).choice(good, 3, replace=False):
        places = FAULTS[fault](results.paths[str(cell)], results.test)
        table = prediction_table(results.test, 0 * places).assign(
            north=np.asarray(places)[..., 0].T.ravel(), east=np.asarray(places)[..., 1].T.ravel()
        )
        table.to_parquet(tmp_path / "p.parquet")
        (one,) = read_predictions(tmp_path / "p.parquet", results)
        assert one.doubt.startswith(fault), cell
        with pytest.raises(DataError, match="if it is meant so, --anyway scores it as doubtful"):
            shipid.score(results.folder, tmp_path / "p.parquet")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.drop(columns="north"), "north: lacks this column; it has run, instant"),
        (lambda t: t.drop(index=7), "1 of .* steps are missing; the first: run"),
        (lambda t: t.assign(run="Z"), "640 of 640 steps are none of the test"),
        (lambda t: pd.concat([t, t[3:5]]), "2 of .* steps are there twice"),
        (lambda t: t.assign(run="other"), "are none of the test"),
        (lambda t: t.assign(ahead=t["ahead"] - 1.0), "ahead 0 s"),
        (lambda t: t.assign(east="x"), "east: x in row 0 is no number"),
        (lambda t: t.assign(east=np.nan), "east: nan in row 0 is no number; 640 of 640 rows have none"),
        (lambda t: t.assign(instant=t["instant"].where(t.index != 4)), "instant: nan in row 4 is no number; 1 of"),
        (lambda t: t.assign(N_D=999), "N_D: 999 is not of the study: give one of 4, or -1 for any"),
        (lambda t: t.assign(N_D="all"), "N_D: all is not of the study"),
        (lambda t: t.assign(seed=np.nan), "seed: nan is not of the study"),
        (lambda t: t.assign(model=None), "model: a row has no name"),
        (lambda t: t[:0], "model: a row has no name, or there is no row"),
    ],
)
def test_faults_of_rows_are_one_line(tmp_path: Path, results: Results, change: Any, words: str) -> None:
    path = next(iter(results.paths.values()))
    change(prediction_table(results.test, path)).to_parquet(tmp_path / "p.parquet")
    with pytest.raises(DataError, match=words):
        read_predictions(tmp_path / "p.parquet", results)


@pytest.mark.parametrize(
    ("content", "words"), [(None, "no such file"), (b"", "is an empty file"), (b"run,north\n", "is no Parquet file")]
)
def test_a_file_that_is_no_table_is_told_in_one_line(
    tmp_path: Path, results: Results, content: bytes | None, words: str
) -> None:
    file = tmp_path / "p.parquet"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(DataError, match=words):
        read_predictions(file, results)


def test_a_name_of_the_study_is_marked(tmp_path: Path, results: Results) -> None:
    path = next(iter(results.paths.values()))
    for name, label in (("kernel", "kernel (given)"), ("wrong-1", "wrong-1 (given)"), ("own", "own")):
        file = written(tmp_path / "p.parquet", results, path, model=name)
        assert [one.label for one in read_predictions(file, results)] == [label]


def test_a_score_has_intervals_and_rows_in_the_page_and_says_whether_it_was_blind(
    tmp_path: Path, results: Results
) -> None:
    cell = next(row for row in results.rows if row["method"] == "kernel" and row["family"] == "wrong")
    file = written(tmp_path / "rival.parquet", results, results.paths[cell["cell"]])
    table = shipid.score(results.folder, file)["rival"]
    same = table[table["method"].eq("kernel") & table["family"].eq("none")].iloc[0]
    ratios = [np.log(results.errors[row["cell"]]) - np.log(results.errors[cell["cell"]]) for row in results.rows
              if row["method"] == "kernel" and row["family"] == "none" and row["N_D"] == same["N_D"]]  # fmt: skip
    assert same["difference"] == pytest.approx(100 * np.expm1(np.mean(ratios)))
    assert (shipid.compare_methods(results)["method"] == "rival").sum() == 3
    with without_figures():
        said = output_of("study", "score", results.folder, file)
        assert f"rival: at the horizon {cell['H_end']:.4g} m" in said
        assert f"H {cell['H']:.4g} m; beside N_D 4\n" in said
    # the tables carry it, also beside the predictions, and the folder of the run remembers it
    with pytest.raises(DataError, match="'rival' is scored already, from another table"):
        shipid.score(
            results.folder, written(tmp_path / "other.pq", results, results.paths[cell["cell"]], model="rival")
        )
    out = windows(results.plan, with_truth=True)
    passed = written(tmp_path / "passed.parquet", results, out.physics["wrong-1"][:, out.keys["split"] == "test"])
    out.write(tmp_path / "beside")
    beside = written(tmp_path / "beside" / "mine.parquet", results, results.paths[cell["cell"]])
    assert read_predictions(passed, results)[0].label == "passed"
    assert read_predictions(beside, results)[0].label == "mine (not blind)"
    output_of("study", "windows", results.folder, "--with-truth", "--out", tmp_path / "out")
    assert read_predictions(passed, results)[0].label == "passed (not blind)"
    (kept,) = (results.folder / "scores").glob("*")
    assert (kept.name, read_predictions(kept, results)[0].label) == ("rival.parquet", "rival")  # it was blind
