"""Runs: the same numbers whoever computes them and however often they are interrupted; a folder tells all."""

from __future__ import annotations

import importlib
import re
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
import pytest
import tomlkit

from shipid.answer.frames import provenance_words
from shipid.answer.pages import write_pages
from shipid.data.dataset import read_dataset
from shipid.engine import native
from shipid.errors import ResultError, ShipidError
from shipid.files import read_json
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.method import FitResult, Method, Task
from shipid.hybrid.methods import METHODS
from shipid.hybrid.search import trial_row
from shipid.metrics import position_error, summarise_errors
from shipid.physics import TERMS
from shipid.predictor import Predictor
from shipid.study import run, seals, store
from shipid.study.check import check_folder
from shipid.study.plan import Plan
from shipid.study.prepare import obtain_runs, prepare
from shipid.study.results import read_results
from shipid.study.run import run_study, run_unit
from shipid.vessel.load import load_vessel
from tests.documented import code
from tests.study.tiny import events_here, make_run, mixed_plan, run_here, tiny_plan, whole_unit


class Silent:
    """A line on which nothing was sent."""

    def sent(self) -> list[Any]:
        return []


def numbers(folder: Path) -> list[dict[str, Any]]:
    """Rows of all cells without what a clock measured."""
    rows = []
    for row in store.read_rows(folder).drop(columns="seconds").to_dict("records"):
        row["trials"] = [{key: value for key, value in trial.items() if key != "seconds"} for trial in row["trials"]]
        rows.append({key: None if value != value else value for key, value in row.items()})
    return sorted(rows, key=lambda row: row["cell"])


def test_interrupted_on_workers_and_resumed_here_gives_the_same_numbers(tmp_path: Path, tiny_run: Path) -> None:
    """Two processes, stopped after the first cell; the others are done in this process."""
    plan, folder = tiny_plan(tmp_path), tmp_path / "run"
    events = run_study(plan, folder, workers=2)
    kinds = []
    for event in events:
        kinds.append(event.kind)
        if event.kind == "cell":
            break
    events.close()  # type: ignore[attr-defined]
    assert kinds[-2:] == ["start", "cell"]
    stored = list((folder / "batches").glob("*.json"))
    assert len(stored) == 1
    before = stored[0].read_bytes()
    partial = read_results(folder)
    assert not partial.complete
    resumed = run_here(store.stored_plan(folder), folder)
    assert [event.done for event in resumed if event.kind in ("start", "cell", "end")] == [*range(1, 9), 8]
    assert stored[0].read_bytes() == before
    assert numbers(folder) == numbers(tiny_run)
    assert read_results(folder).complete


def test_another_code_that_goes_on_is_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another commit of one version."""
    plan, folder = tiny_plan(tmp_path), tmp_path / "run"
    for event in events_here(plan, folder):
        if event.kind == "cell":
            break
    words = "code 12345678"
    monkeypatch.setattr(run, "code_digest", lambda: "12345678")
    notes = [event.text for event in events_here(plan, folder) if event.kind == "note"]
    assert any("computed otherwise: shipid was" in note and words in note for note in notes)
    assert any(words in line for line in check_folder(folder).lines)
    assert words in provenance_words(read_results(folder))["computed in parts"]


@pytest.mark.parametrize(
    ("step", "before", "after"),
    [
        ("obtain_runs", [], [run.DATA, run.COMMON]),
        ("prepare", [run.DATA], [run.COMMON]),
        ("run_unit", [run.COMMON], []),
    ],
)
def test_an_engine_that_is_given_up_is_noted_before_anything_of_another_is_stored(
    step: str, before: list[str], after: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A compiler that passed its probe and failed on a model: the numbers of two engines were mixed without a word."""
    monkeypatch.setattr(native, "_refused", [])
    if native.find_compiler() is None:
        pytest.skip("no compiler")
    plan, folder, stored = tiny_plan(tmp_path), tmp_path / "run", dict[str, str]()
    work, write_seal = getattr(run, step), seals.write_seal

    def refused(*given: Any, **named: Any) -> Any:
        native.refuse_compiling("the C compiler failed (Killed)")
        return work(*given, **named)

    def noted(place: Path, name: str, files: Any) -> None:
        stored[name] = read_json(folder / store.PROVENANCE)["sessions"][-1]["engine"]
        write_seal(place, name, files)

    with monkeypatch.context() as patch:
        patch.setattr(run, step, refused)
        patch.setattr(seals, "write_seal", noted)
        events = events_here(plan, folder)
        while next(events).kind != "cell":
            pass
        events.close()
    assert all(stored.pop(name).startswith("native, ") for name in before)
    assert {stored[name] for name in [*after, plan.units[0].key]} == {"casadi"}
    one, other = (session["engine"] for session in read_json(folder / store.PROVENANCE)["sessions"])
    assert f"computed in parts: engine was {one}, now {other}" in check_folder(folder).lines
    assert provenance_words(read_results(folder))["computed in parts"] == f"engine was {one}, now {other}"
    monkeypatch.setattr(native, "_refused", [])
    notes = [event.text for event in events_here(plan, folder) if event.kind == "note"]
    assert f"earlier results were computed otherwise: engine was {other}, now {one}" in notes


def test_a_method_of_a_user_that_was_edited_is_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The finished cells are those of the method as it was; nothing said so."""
    file = tmp_path / "mine.py"
    file.write_text("from shipid.hybrid.kernel import Kernel\n\n\nclass Mine(Kernel):\n    pass\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    module, folder = importlib.import_module("mine"), tmp_path / "run"

    def planned() -> Plan:
        monkeypatch.setitem(METHODS, "mine", module.Mine)
        method = {"name": "own", "kind": "mine", "trials": 1, "terms": 4}
        return tiny_plan(tmp_path, {"method": [method], "grid.N_D": [4]})

    plan = planned()
    run_here(plan, folder)
    assert not any("otherwise" in event.text for event in events_here(plan, folder))
    file.write_text(file.read_text() + "\n")
    importlib.reload(module)
    plan = planned()
    notes = [event.text for event in events_here(plan, folder) if event.kind == "note"]
    assert any("earlier results were computed otherwise: code of the method.own was" in note for note in notes)
    assert "code of the method.own" in provenance_words(read_results(folder))["computed in parts"]


def skeg_plan(folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[ModuleType, Plan]:
    """The skeg of docs/extending.md as a file in a folder and a term, and a tiny study of a vessel with it."""
    (folder / "skeg.py").write_text(code("A term")[1])
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, "skeg", raising=False)
    monkeypatch.setitem(TERMS, "hull.skeg", TERMS["hull.mmg"])
    module = importlib.import_module("skeg")
    values = {"x": -10.0, "A": 6.0, "C": 1.8, "source": "made up"}
    (folder / "ship.toml").write_text(tomlkit.dumps({"extends": "gunnerus-28.9", "hull": {"skeg": values}}))
    return module, tiny_plan(folder, {"truth.vessel": "ship.toml", "family.0.base": "ship.toml", "grid.N_D": [4]})


def test_more_cells_change_none_that_exist(tmp_path: Path, tiny_run: Path) -> None:
    """A wider grid, another seed and another family leave the cells of the smaller study as they were."""
    plan = tiny_plan(tmp_path, {"grid.seeds": [0, 1], "family.1.members": 3})
    run_here(plan, tmp_path / "run")
    wider = {row["cell"]: row for row in numbers(tmp_path / "run")}
    for row in numbers(tiny_run):
        twin = wider[row["cell"]]
        assert twin["H"] == pytest.approx(row["H"], rel=1e-4), row["cell"]  # stacked products round differently
        assert twin["A"] == pytest.approx(row["A"], nan_ok=True) if row["A"] is not None else twin["A"] is None


def test_a_unit_has_the_digits_of_its_whole_batch(tmp_path: Path) -> None:
    """Every method, an identified family and refits: units of work against all cells at once, bit by bit."""
    plan = mixed_plan(tmp_path, {"bands": {"refits": 2}})
    prepared = prepare(plan, obtain_runs(plan))
    whole = {
        row["cell"]: (row, one) for row, one, _ in run_unit(plan, prepared, whole_unit(plan, plan.batches[0]), "cpu")
    }
    parts = [pair for unit in reversed(plan.units) for pair in run_unit(plan, prepared, unit, "cpu")]
    assert len(parts) == len(whole) == plan.cells
    for row, predictor, _ in parts:
        expected, other = whole[row["cell"]]
        assert _plain(row) == _plain(expected)
        predictor.save(tmp_path / "one.npz")
        other.save(tmp_path / "other.npz")
        assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "other.npz").read_bytes()


def _plain(row: dict[str, Any]) -> str:
    """A row without what a clock measured."""
    trials = [{key: value for key, value in trial.items() if key != "seconds"} for trial in row["trials"]]
    return repr({**row, "trials": trials, "seconds": 0})


def test_H_is_what_the_stored_predictor_does_on_the_test_windows(tmp_path: Path, tiny_run: Path) -> None:
    """From the stored dataset anew: windows cut, physics rolled out by the predictor itself, compensation added."""
    rows = store.read_rows(tiny_run)
    prepared = prepare(tiny_plan(tmp_path), read_dataset(tiny_run / store.DATASET))
    assert len(rows) == 8
    for row in rows.itertuples():
        predictor = Predictor.load(store.cell_file(tiny_run, str(row.cell)))
        paths = predictor.predict(prepared.test.instants())
        error = summarise_errors(position_error(paths, prepared.test.future))
        assert error["mean"] == pytest.approx(row.H, rel=1e-9)
        assert error["p90"] == pytest.approx(row.H_90, rel=1e-9)
        assert error["rms"] == pytest.approx(row.rms, rel=1e-9)
        alone = summarise_errors(position_error(predictor.alone(prepared.test.instants()), prepared.test.future))
        assert np.isnan(row.A) if row.foundation == "none" else alone["mean"] == pytest.approx(row.A, rel=1e-9)
        assert set(predictor.provenance["runs"]) == set(prepared.runs(_batch(tmp_path, row.N_D)))
        assert not set(predictor.provenance["runs"]) & set(prepared.test.spans)


def _batch(tmp_path: Path, N_D: Any) -> Any:
    return next(batch for batch in tiny_plan(tmp_path).batches if batch.N_D == N_D)


def test_a_training_that_fails_is_a_value(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One model without a compensator: its row says so, the others keep their results, the report's frames stand."""
    fit = Kernel.fit

    def failing(method: Kernel, task: Task) -> dict[str, FitResult]:
        return fit(method, task) | {"wrong-1": FitResult(None, [], 0.0)}

    monkeypatch.setattr(Kernel, "fit", failing)
    run_here(tiny_plan(tmp_path), tmp_path / "run")
    rows = store.read_rows(tmp_path / "run").set_index("foundation")
    assert set(rows.loc["wrong-1", "status"]) == {"failed"}
    assert rows.loc["wrong-1", "H"].isna().all()
    assert set(rows.drop("wrong-1")["status"]) == {"ok"}
    assert len(read_results(tmp_path / "run").paths) == 6


@pytest.mark.parametrize("factor", [1e5, np.nan])
def test_a_path_that_no_ship_can_follow_is_a_cell_without_a_result(
    factor: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A method without bounds may be finite and worth nothing: it has no H, as physics that diverges has none."""
    plan, predict = tiny_plan(tmp_path), Predictor.predict

    def wild(self: Predictor, *given: Any, **options: Any) -> Any:
        paths = np.array(predict(self, *given, **options))
        paths[-1, : paths.shape[1] // 2] *= factor
        return paths

    monkeypatch.setattr(Predictor, "predict", wild)
    rows = [
        row for row, *_ in run_unit(plan, prepare(plan, obtain_runs(plan)), whole_unit(plan, plan.batches[0]), "cpu")
    ]
    assert {row["status"] for row in rows} == {"diverged"}
    assert all("farther than any ship gets, on 50.0" in row["sentence"] for row in rows)
    assert np.isnan([row["H"] for row in rows]).all()


def test_runs_too_short_to_learn_from_are_a_value(tmp_path: Path) -> None:
    """Two runs of one window each: without one of them no input varies. Larger amounts keep their results."""
    method = {"name": "trained", "kind": "path-trained", "trials": 1, "epochs": 2, "units": 4, "layers": 1}
    changes = {"prediction.samples": 1, "grid.N_D": [2, 6], "bands.refits": 2, "method": [method]}
    run_here(tiny_plan(tmp_path, changes), tmp_path / "run")
    rows = store.read_rows(tmp_path / "run").set_index("N_D")
    assert set(rows.loc[2, "status"]) == {"failed"}
    assert all(words.startswith("none of u, v, r, port.n") for words in rows.loc[2, "sentence"])
    assert set(rows.loc[6, "status"]) == {"ok"}
    run_here(tiny_plan(tmp_path, {**changes, "grid.N_D": [2]}), tmp_path / "nothing")
    write_pages(tmp_path / "nothing")
    assert "no result joins physics and data" in (tmp_path / "nothing" / "answer.txt").read_text().lower()


def test_absent_device_is_one_line(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path)
    with pytest.raises(ShipidError, match="no such device") as caught:
        run_unit(plan, prepare(plan, obtain_runs(plan)), whole_unit(plan, plan.batches[0]), "cuda:99")
    assert caught.value.path == "--device cuda:99"


# Folders that are not what they are taken for.


def test_a_folder_of_before_a_vessel_changed_says_so(tmp_path: Path) -> None:
    """The document is the same: it said that the study is another one than itself."""
    vessel, folder = tmp_path / "ship.toml", tmp_path / "run"
    vessel.write_text('extends = "gunnerus-28.9"\n')
    changes = {"truth.vessel": "ship.toml", "family.0.base": "ship.toml"}
    make_run(folder, tiny_plan(tmp_path, changes))
    (folder / "notes.txt").write_text("of the user")  # else the folder of a run without results is made anew
    vessel.write_text('extends = "gunnerus-28.9"\n[inertia]\nm = 5e5\n')
    words = r"from before a vessel, .* changed: choose another --out, or go on with it as it was: `shipid study resume"
    with pytest.raises(ResultError, match=words):
        make_run(folder, tiny_plan(tmp_path, changes))
    make_run(folder, store.stored_plan(folder))


@pytest.mark.parametrize("at", ["note", "cell"])
@pytest.mark.parametrize("replaced", [False, True])
def test_a_folder_that_is_moved_or_replaced_gets_nothing_more(
    replaced: bool, at: str, tmp_path: Path, tiny_run: Path
) -> None:
    """Before, the results of the old plan were stored among those of the new one, and all cells computed twice."""
    events = events_here(tiny_plan(tmp_path), tmp_path / "run")
    while next(events).kind != at:
        pass
    (tmp_path / "run").rename(tmp_path / "moved")
    other = events_here(tiny_plan(tmp_path, {"truth.seed": 99}), tmp_path / "run")
    if replaced:
        while next(other).kind != "start":
            pass
    with pytest.raises(ResultError, match="was moved, removed or replaced while this run worked in it"):
        list(events)
    assert not list((tmp_path / "run").rglob("*.npz" if not replaced else "cells/*"))
    other.close()
    run_here(tiny_plan(tmp_path), tmp_path / "moved")
    assert numbers(tmp_path / "moved") == numbers(tiny_run)


def test_folder_with_other_things_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    (folder / "cat.jpg").write_bytes(b"")
    with pytest.raises(ResultError, match=r"cannot be made \(Directory not empty\): choose another"):
        next(run_study(tiny_plan(tmp_path), folder))
    with pytest.raises(ResultError, match="cannot be made"):
        next(run_study(tiny_plan(tmp_path), folder / "cat.jpg" / "run"))
    assert [file.name for file in folder.iterdir()] == ["cat.jpg"]


def _damage(change: Callable[[bytes], bytes], name: str) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        file = next(folder.glob(name))
        file.write_bytes(change(file.read_bytes()))

    return damage


def _half(content: bytes) -> bytes:
    return content[: len(content) // 2]


DAMAGES = {
    "no study": (lambda folder: (folder / "study.toml").unlink(), "holds no study.toml"),
    "study is no TOML": (_damage(lambda _: b"[[", "study.toml"), "not valid TOML"),
    "study is no text": (_damage(lambda _: b"\xff\xfe", "study.toml"), "not UTF-8 text"),
    "study was edited": (_damage(lambda text: text.replace(b"seed = 3", b"seed = 4"), "study.toml"), "changed by hand"),
    "no provenance": (lambda folder: (folder / "provenance.json").unlink(), "is this the folder of a run"),
    "half a provenance": (_damage(_half, "provenance.json"), "damaged"),
    "foreign provenance": (_damage(lambda _: b"[1, 2]", "provenance.json"), "damaged"),
    "no dataset": (lambda folder: (folder / "dataset.parquet").unlink(), "dataset.parquet: missing"),
}


@pytest.mark.parametrize("kind", DAMAGES)
def test_damaged_folders_are_one_line(tmp_path: Path, tiny_run: Path, kind: str) -> None:

    folder = tmp_path / "run"
    shutil.copytree(tiny_run, folder)
    damage, message = DAMAGES[kind]
    damage(folder)
    with pytest.raises(ShipidError, match=message) as caught:
        read_results(folder)
    line = str(caught.value)
    assert "\n" not in line
    assert str(folder) in line


def test_a_run_needs_no_vessel_file_any_more(tmp_path: Path) -> None:
    """A folder of results opens anywhere, with the vessels as they were when the run began."""
    document = tmp_path / "own.toml"
    document.write_text((Path(load_vessel("gunnerus-28.9").file)).read_text())
    plan = tiny_plan(tmp_path, {"truth.vessel": "./own.toml"})
    next(run_study(plan, tmp_path / "run"))
    assert store.stored_plan(tmp_path / "run").digest == plan.digest
    document.unlink()
    assert store.stored_plan(tmp_path / "run").digest == plan.digest
    stored = tmp_path / "run" / store.VESSELS
    stored.write_text(stored.read_text().replace("410931.81", "410931.82"))
    with pytest.raises(ResultError, match="changed by hand"):
        store.stored_plan(tmp_path / "run")


MISTAKE = ""  # of `Faulty` and `Moved`


@dataclass(frozen=True)
class Moved(UnchangedPath):
    """A corrector that a user wrote, with a mistake."""

    def predict(self, physics: Any, instants: Any, paths: Any) -> Any:  # noqa: ARG002
        if MISTAKE == "raises":
            raise ValueError("first\nsecond")
        return paths


class Faulty(Method):
    """A method that a user wrote, with a mistake."""

    corrector: ClassVar[type[Any]] = Moved

    def fit(self, task: Task) -> dict[str, FitResult]:
        return dict.fromkeys(task.cases, FitResult(Moved({}), [trial_row(0, {}, 1.0, 0.0)], 0.0))


def test_a_mistake_of_a_user_is_one_line_and_loses_no_cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run ends; when the mistake is mended it goes on in the same folder."""
    monkeypatch.setitem(METHODS, "faulty", Faulty)
    monkeypatch.setattr(sys.modules[__name__], "MISTAKE", "raises")
    methods = [
        {"name": "kernel", "kind": "kernel", "trials": 2, "steps": 2, "terms": 4},
        {"name": "mine", "kind": "faulty"},
    ]
    plan = tiny_plan(tmp_path, {"method": methods, "claims": {"method": "mine"}, "grid.N_D": [4]})
    folder = tmp_path / "run"
    with pytest.raises(ShipidError) as caught:
        run_here(plan, folder)
    message = rf"Moved\.predict: ValueError: first second in {re.escape(__file__)}, line \d+"
    assert re.fullmatch(message, str(caught.value))
    finished = {file: file.read_bytes() for file in (folder / "cells").iterdir()}
    assert len(finished) == 1  # the cell before it
    monkeypatch.setattr(sys.modules[__name__], "MISTAKE", "")
    run_here(plan, folder)
    assert {file: file.read_bytes() for file in finished} == finished
    assert set(store.read_rows(folder)["status"]) == {"ok"}


def test_a_method_in_the_script_itself_has_the_code_of_the_script_on_a_cluster(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its class travels by value: what a worker was started by has nothing to do with it."""
    kind = type("Mine", (METHODS["kernel"],), {"__module__": "__main__"})
    monkeypatch.setitem(METHODS, "mine", kind)
    monkeypatch.setattr(run, "run_unit", lambda *_: [])
    monkeypatch.setattr(run, "journal_by_topic", lambda *_: None)
    plan = tiny_plan(tmp_path, {"method": [{"name": "mine", "kind": "mine"}, {"name": "bare", "kind": "alone"}]})
    written = {"code of the method": {"mine": "01234567"}}
    (session, after), _ = run._on_cluster((plan, None, "cpu", written, []), (plan.units[0], b""), Silent())  # type: ignore[arg-type]
    assert session["code of the method"] == {"mine": "01234567"}
    assert after == session
