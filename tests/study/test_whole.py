"""One study of every foundation with every method: nothing looks ahead, and each way to use it says the same."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest

from shipid.answer.pages import write_pages
from shipid.data.dataset import Dataset, read_dataset, write_dataset
from shipid.data.windows import Windows, cut_windows, from_frame
from shipid.errors import DocumentError
from shipid.hybrid.features import Inputs, Memory, input_group
from shipid.hybrid.methods import METHODS
from shipid.hybrid.physics import Physics
from shipid.observer import Estimates, Observer, run_observer
from shipid.predictor import Predictor
from shipid.study import apply, store
from shipid.study.apply import predict_log
from shipid.study.plan import Plan, build_plan
from shipid.study.prepare import at_instants, instants_of, prepare
from shipid.study.results import Results, read_results
from shipid.vessel.load import Vessel, load_vessel
from tests.study.test_commands import weaving
from tests.study.tiny import run_here, tiny_plan

Array = np.ndarray
EVERYTHING = {"history": [2.0, 4.0], "turned": [6.0], "error": [3.0, 6.0], "observer": True}
SMALL: Mapping[str, Mapping[str, Any]] = {  # settings that make a method cheap; one without an entry takes its defaults
    "path-trained": {"trials": 1, "layers": 1, "units": 8, "epochs": 3},
    "learned-force": {"trials": 1, "ridge": 0.1, "units": 2, "iterations": 3},
    "calibrator": {"trials": 1, "terms": 3},
    "forest": {"trials": 1, "trees": 3},
    "hankel-dmd": {"delays": [2.0]},
    "modules": {"trials": 1, "units": 2},
    "one-step": {"trials": 1, "units": 8},
    "recurrent": {"trials": 1, "units": 4, "epochs": 2, "seconds": 2.0},
}
PATHS = ["hull.derivatives.X_u|u|", "hull.derivatives.N_uv", "hull.derivatives.N_ur"]
IDENTIFY = {"parameters": PATHS, "weights": {"u": 0.01, "v": 0.01, "r": 0.001}, "method": "euler"}
FAMILIES: list[dict[str, Any]] = [
    {"name": "wrong", "base": "gunnerus-28.9", "perturb": [{"parameters": PATHS, "factor": 1.3}]},
    {"name": "seen", "extends": "wrong", "observer": {}},
    {"name": "fitted", "extends": "wrong", "identify": IDENTIFY},
    {"name": "both", "extends": "fitted", "observer": {"current": 0.0}},
]
KINDS = {kind: method for kind, method in METHODS.items() if kind != "forest" or find_spec("sklearn") is not None}
NOW = 20.0  # s: what lies after it is changed


def windy(names: str = "abcd") -> Dataset:
    """Runs of the 28.9 m ship with a helm of each azimuth for itself and wind that is measured."""
    dataset = weaving(names)
    t = dataset.frame["t"]
    wind = {"V_w": 0.4 + 0.2 * np.sin(t), "beta_w": 1.0 + 0.1 * np.cos(t)}
    starboard = dataset.frame["starboard.alpha"] + 0.05 * np.sin(0.7 * t)
    return Dataset(dataset.frame.assign(**wind, **{"starboard.alpha": starboard}), dataset.metadata)


def methods() -> list[dict[str, Any]]:
    """A block of every kind, with all the memory that it can have."""
    blocks = []
    for kind, method in KINDS.items():
        memory = {"memory": EVERYTHING} if "memory" in method.model_fields else {}
        blocks.append({"name": kind, "kind": kind, **SMALL.get(kind, {}), **memory})
    return blocks


@dataclass(frozen=True)
class Finished:
    """A study that has run."""

    plan: Plan
    folder: Path
    rows: pd.DataFrame


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """Every foundation with every method."""
    folder = tmp_path_factory.mktemp("whole")
    document = tiny_plan(folder).document
    del document["truth"]
    document |= {"data": {"dataset": str(write_dataset(windy(), folder / "log.parquet"))}, "grid": {"N_D": [2]}}
    document |= {"prediction": {"ahead": 5.0}, "split": {"test": ["d"]}, "family": FAMILIES, "method": methods()}
    plan = build_plan(document, folder / "tiny.toml")
    run_here(plan, folder / "run")
    return Finished(plan, folder / "run", store.read_rows(folder / "run"))


@pytest.fixture(scope="module")
def results(whole: Finished) -> Results:
    """What its folder holds."""
    return read_results(whole.folder)


@pytest.fixture(scope="module", autouse=True)
def observed_once() -> Iterator[None]:
    """Predictors of one vessel share what its observer sees along one log."""
    seen: dict[tuple[Any, ...], Estimates] = {}

    def once(vessel: Vessel, dataset: Dataset, observer: Observer) -> Estimates:
        key = (vessel.digest, tuple(vessel.parameters.items()), dataset.digest, observer.model_dump_json())
        if key not in seen:
            seen[key] = run_observer(vessel, dataset, observer)
        return seen[key]

    with patch.object(apply, "run_observer", once):
        yield


@pytest.fixture(scope="module")
def along(whole: Finished, tmp_path_factory: pytest.TempPathFactory) -> dict[str, pd.DataFrame]:
    """What each cell predicts along the log of the study."""
    out = tmp_path_factory.mktemp("along") / "paths.parquet"
    log = whole.folder / store.DATASET
    return {cell: predict_log(whole.folder, cell, log, None, out)[0] for cell in whole.rows["cell"]}


def later_changed(dataset: Dataset, spared: tuple[str, ...] = ()) -> Dataset:
    """The dataset with every measured value and order after `NOW` replaced, in every run."""
    frame, rng = dataset.frame.copy(), np.random.default_rng(5)
    later = frame["t"] > NOW
    for name in map(str, frame.columns):
        if name not in ("run", "t", "flags", *spared):
            frame.loc[later, name] += rng.normal(0.0, 0.5, int(later.sum()))
    return Dataset(frame, dataset.metadata)


def test_all_cells_are_there(whole: Finished, results: Results) -> None:
    """Foundations that are variants, observed, identified, and both, each with each method that meets it."""
    pairs = {(row.foundation, row.method) for row in whole.rows.itertuples()}
    meets_none = {("none", name) for name, method in KINDS.items() if method.meets_none}
    no_observer = {name for name, method in KINDS.items() if not method.meets_observer}
    refused = {(f["name"], kind) for f in FAMILIES if "observer" in f for kind in no_observer}
    assert pairs == {(f["name"], kind) for f in FAMILIES for kind in KINDS} - refused | meets_none
    assert len(refused) >= 2
    notes = results.provenance["notes"]
    assert {f"{kind} takes no observer: not fitted to seen, both" for kind in no_observer} <= set(notes)
    assert (whole.rows["status"] == "ok").all(), whole.rows[["cell", "status", "sentence"]]


def test_an_identified_and_observed_family_has_both(whole: Finished) -> None:
    rows = whole.rows.set_index(["foundation", "method"])
    saved = {
        f["name"]: Predictor.load(store.cell_file(whole.folder, rows.loc[(f["name"], "alone"), "cell"]))
        for f in FAMILIES
    }
    numbers = {name: one.vessel.parameters for name, one in saved.items() if one.vessel is not None}
    assert numbers["both"] == numbers["fitted"] != numbers["wrong"] == numbers["seen"]
    observers = {name: one.physics.observer for name, one in saved.items()}
    assert observers["wrong"] is observers["fitted"] is None
    assert observers["both"] == Observer(current=0.0)
    assert observers["seen"] == Observer()
    accuracy = {name: rows.loc[(name, "alone"), "A"] for name in saved}
    assert len(set(accuracy.values())) == 4
    assert "converged" in rows.loc[("both", "alone"), "sentence"]
    assert accuracy["fitted"] < accuracy["wrong"]


def test_an_observer_changes_what_every_method_predicts_that_meets_it(whole: Finished, results: Results) -> None:
    cells = whole.rows.set_index(["foundation", "method"])["cell"]
    for kind, method in KINDS.items():
        if method.meets_observer:
            apart = results.paths[cells[("seen", kind)]] - results.paths[cells[("wrong", kind)]]
            assert np.abs(apart).max() > 1e-3, kind


def test_a_family_with_an_observer_is_refused_by_name(whole: Finished) -> None:
    """A pattern leaves it out, a name is refused, and so is a family that no method is left for."""
    document = whole.plan.document
    for families, message in (
        (["seen"], "'seen' has an observer, which one-step does not take: name the family it extends"),
        (["seen*"], "no method meets 'wrong': name its family in `families`"),
        (["*"], "no method meets 'seen': name its family in `families`; one with an observer needs"),
    ):
        method = [{"name": "steps", "kind": "one-step", "families": families}]
        with pytest.raises(DocumentError, match=re.escape(message)):
            build_plan({**document, "method": method}, Path(whole.plan.file))
    plan = build_plan(
        {**document, "method": [{"name": "steps", "kind": "one-step"}, {"name": "alone", "kind": "alone"}]},
        Path(whole.plan.file),
    )
    assert [way.left_out for way in plan.methods] == [("seen", "both"), ()]
    assert plan.methods[0].foundations == ("wrong", "fitted", "none")


def test_stored_predictors_give_the_paths_of_the_results(whole: Finished, results: Results) -> None:
    for cell in whole.rows["cell"]:
        first = Predictor.load(store.cell_file(whole.folder, cell))
        again = Predictor.load(first.save(whole.folder.parent / "again.npz"))
        estimates = None
        if again.vessel is not None and again.physics.observer is not None:
            estimates = apply.run_observer(again.vessel, results.dataset, again.physics.observer)
        instants = instants_of(whole.plan.study, again.vessel, results.dataset, results.test, estimates)
        np.testing.assert_allclose(again.predict(instants), results.paths[cell], atol=1e-9, err_msg=cell)


@pytest.mark.slow
def test_the_report_shows_every_cell(whole: Finished) -> None:
    page = write_pages(whole.folder).read_text()
    for name in ("seen", "fitted", "both", *KINDS):
        assert name in page


def test_along_a_log_predictions_are_those_of_the_study(results: Results, along: dict[str, pd.DataFrame]) -> None:
    """Memory, observers and identified numbers: what `predict_log` writes is what the study judged."""
    test = results.test
    north, east, psi = (test.columns[name] for name in ("north", "east", "psi"))
    for cell, frame in along.items():
        path = results.paths[cell]
        there_north, there_east = from_frame(path[..., 0], path[..., 1], north, east, psi)
        for step in range(test.horizon):
            rows = frame[(frame["ahead"] == step + 1.0) & (frame["run"] == "d")].set_index("t").loc[test.t]
            np.testing.assert_allclose(rows["cooperative_north"], there_north[step], atol=1e-8, err_msg=cell)
            np.testing.assert_allclose(rows["cooperative_east"], there_east[step], atol=1e-8, err_msg=cell)


# Nothing looks ahead.


def test_no_prediction_sees_a_later_row(whole: Finished, along: dict[str, pd.DataFrame], tmp_path: Path) -> None:
    """Every row after an instant replaced: no prediction up to that instant moves, and later ones do."""
    dataset = read_dataset(whole.folder / store.DATASET)
    file = write_dataset(later_changed(dataset), tmp_path / "changed.parquet")
    for cell, one in along.items():
        other = predict_log(whole.folder, cell, file, None, tmp_path / "paths.parquet")[0]
        known = one["t"] <= NOW
        assert known.sum() >= 4 * 5 * 10
        pd.testing.assert_frame_equal(one[known], other[known], rtol=0.0, atol=1e-12, obj=cell)
        assert not np.allclose(one["cooperative_north"][~known], other["cooperative_north"][~known]), cell


def inputs_at(dataset: Dataset, physics: Physics, known: bool) -> tuple[Windows, dict[str, Array]]:
    """Every input there is at windows of a dataset."""
    windows = cut_windows(dataset, horizon=5, past=6)
    estimates = at_instants(dataset, windows, run_observer(physics.vessel, dataset, physics.observer))
    inputs = Inputs(tuple(dataset.commands), Memory(**EVERYTHING))
    return windows, inputs.table(physics, windows.instants(known=known, estimates=estimates))


@pytest.mark.parametrize("known", [False, True])
def test_no_input_sees_a_later_row(known: bool) -> None:
    """Planned orders are the only thing that is known ahead, and only where commands are known."""
    dataset = windy()
    physics = Physics(
        load_vessel("gunnerus-28.9").with_values({"hull.derivatives.N_ur": -3e5}), 5, 1.0, "euler", Observer()
    )
    spared = tuple(dataset.commands) if known else ()
    (windows, table), (_, changed) = (inputs_at(d, physics, known) for d in (dataset, later_changed(dataset, spared)))
    groups = {input_group(name) for name in table}
    assert groups == {"motion", "wind", "command", "history", "error", "observer"}
    before = windows.t <= NOW
    for name, values in table.items():
        np.testing.assert_allclose(changed[name][before], values[before], rtol=0.0, atol=1e-12, err_msg=name)
        if not name.startswith(tuple(f"{command.partition('.')[0]}." for command in spared)):
            assert not np.allclose(changed[name][~before], values[~before]), name


@pytest.mark.parametrize("past", [0.0, 8.0])
@pytest.mark.parametrize("validation", ["runs", "share"])
def test_on_a_shared_clock_no_training_window_touches_a_test_window(
    tmp_path: Path, past: float, validation: str
) -> None:
    """Pasts and futures included; nor do those of training and validation touch each other in any fold."""
    dataset = windy("abcdef")
    place = dataset.frame["run"].str[0].map(ord) - ord("a")
    frame = dataset.frame.assign(t=dataset.frame["t"] + 30.0 * place)  # the next run begins before one ends
    shared = Dataset(frame, {**dataset.metadata, "clock": "shared"})
    document = tiny_plan(tmp_path).document
    del document["truth"]
    document |= {"data": {"dataset": str(write_dataset(shared, tmp_path / "log.parquet"))}, "grid": {"N_D": [2, 4]}}
    document |= {"prediction": {"ahead": 5.0, "past": past}, "split": {"test": ["c"]}}
    plan = build_plan(document, tmp_path / "tiny.toml")
    prepared = prepare(plan, shared)
    assert prepared.pool.num_past == past
    assert any("touch the test runs" in note for note in prepared.notes)

    def moments(windows: Windows) -> list[tuple[float, float]]:
        return list(zip(windows.begin, windows.end, strict=True))

    def touch(one: Windows, other: Windows) -> bool:
        return any(a <= d and c <= b for a, b in moments(one) for c, d in moments(other))

    assert not touch(prepared.pool, prepared.test)
    for batch in plan.batches:
        windows = prepared.pool.select(np.isin(prepared.pool.run, prepared.runs(batch)))
        for training, judged in prepared.folds(batch, windows, validation):
            assert not touch(windows.select(training), windows.select(judged))
