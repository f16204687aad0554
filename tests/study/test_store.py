"""The folder of a run: whose it is, what it holds, and the message where it is damaged."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import ResultError
from shipid.files import read_json, write_json
from shipid.physics import TERMS
from shipid.study import seals, store
from shipid.study.check import check_folder
from shipid.study.plan import Batch, Plan, Unit, read_plan, run_command
from shipid.study.results import read_results
from shipid.study.run import prepare_study, run_study
from shipid.study.store import SHARDS, shard_folder
from tests.faults.folders import stored
from tests.study.test_run import skeg_plan
from tests.study.tiny import TINY, make_run, mixed_plan, run_here, tiny_plan, without_workers


def test_a_folder_opens_again_for_the_same_study_alone(tmp_path: Path) -> None:
    plan, other = tiny_plan(tmp_path), tiny_plan(tmp_path, {"grid.N_D": [4]})
    make_run(tmp_path / "run", plan)
    make_run(tmp_path / "run", plan)
    assert store.stored_plan(tmp_path / "run").digest == plan.digest
    make_run(tmp_path / "run", other)  # a run that ended before its first cell does not stand in the way
    assert store.stored_plan(tmp_path / "run").digest == other.digest
    for mark in (tmp_path / "run" / store.SHARDS, tmp_path / "run" / "notes"):  # it waits for shards; a user's own
        mark.mkdir()
        (mark / "any.txt").write_text("")
        with pytest.raises(ResultError, match="another study"):
            make_run(tmp_path / "run", plan)
        shutil.rmtree(mark)
    make_run(tmp_path / "run", plan)


def test_the_working_folder_holds_no_new_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan, folder = tiny_plan(tmp_path), tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    with pytest.raises(ResultError, match="is the working folder"):
        make_run(Path(), plan)
    monkeypatch.chdir(tmp_path)
    make_run(folder, plan)
    monkeypatch.chdir(folder)
    make_run(Path(), plan)  # a run that is there goes on from anywhere


def test_a_stored_plan_knows_what_was_changed(tmp_path: Path) -> None:
    """Of a study of several parts too: its page and its resumed parts name the command with all changes."""
    changes = {"grid.N_D": [4], "repeat": {"seed": [0, 1]}}
    plan = read_plan(TINY, changes)
    make_run(tmp_path / "run", plan)
    stored = store.stored_plan(tmp_path / "run")
    assert run_command(stored) == run_command(plan)
    assert "--set 'grid.N_D=[4]'" in run_command(stored)
    assert [run_command(part.plan) for part in stored.parts.values()] == [
        run_command(part.plan) for part in plan.parts.values()
    ]


@pytest.mark.parametrize("key", ["digest", "sessions"])
def test_an_entry_of_the_provenance_that_is_none_is_one_line(key: str, tiny_run: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(tiny_run, tmp_path / "run")
    write_json(folder / store.PROVENANCE, {**read_json(folder / store.PROVENANCE), key: None})
    for look in (check_folder, read_results, lambda folder: store.note_session(folder, {"shipid": "0"})):
        with pytest.raises(ResultError, match=f"provenance.json: {key}: is not what shipid writes there"):
            look(folder)


def test_a_folder_of_another_version_is_named_itself_not_the_study_it_came_from(tmp_path: Path) -> None:
    """The file of the study may be gone, or be written anew as the message says: what is in the folder stays."""
    plan, study, ship = tiny_plan(tmp_path), tmp_path / "study", tmp_path / "ship"
    for folder in (study, ship):
        make_run(folder, plan)
    text = (study / store.STUDY).read_text()
    (study / store.STUDY).write_text(text.replace("ahead = 5.0", "horizon = 5"))
    with pytest.raises(ResultError, match=r"prediction.horizon: shipid .* does not take it .*new folder") as caught:
        store.stored_plan(study)
    assert caught.value.file == str(study / store.STUDY)
    vessels = (ship / store.VESSELS).read_text()
    (ship / store.VESSELS).write_text(vessels.replace('"inertia"', '"inertias"'))
    with pytest.raises(ResultError, match="does not take it") as caught:
        store.stored_plan(ship)
    assert caught.value.file == str(ship / store.VESSELS)


def test_a_folder_with_a_term_of_a_user_names_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It said that the run is of another version, and to compute it again."""
    monkeypatch.setattr("shipid.study.plan.TRIED_FILES", [Path("mine.py")])
    _, plan = skeg_plan(tmp_path, monkeypatch)
    folder = tmp_path / "run"
    make_run(folder, plan)
    assert store.stored_plan(folder).digest == plan.digest
    monkeypatch.delitem(TERMS, "hull.skeg")
    words = rf"hull\.skeg.*name `--with` the file, .*`shipid --with mine.py study report {re.escape(str(folder))}`$"
    with pytest.raises(store.NotTaken, match=words):
        store.stored_plan(folder)
    assert "study report" in check_folder(folder).lines[-1]


def test_rows_are_those_of_the_finished_batches(tmp_path: Path) -> None:
    batches = [Unit(batch, (("right", "kernel"),), batch.key) for batch in (Batch(4, 1), Batch(4, 0), Batch(2, 0))]
    row = dict.fromkeys(store.METRICS, 1.0) | {"cell": "", "trials": [], "foundation": "right", "method": "kernel"}
    for unit in batches[:2]:
        file = store.rows_file(tmp_path, unit.key)
        file.parent.mkdir(exist_ok=True)
        file.write_text(json.dumps([{**row, "N_D": unit.batch.N_D, "seed": unit.batch.seed, "H": None}]))
        seals.write_seal(tmp_path, unit.key, [file])
    assert store.finished_units(tmp_path, batches) == batches[:2]
    rows = store.read_rows(tmp_path)
    assert rows["seed"].tolist() == [0, 1]
    assert rows["H"].isna().all()
    seals.remove_seal(tmp_path, batches[0].key)  # as after a damaged predictor: the unit is computed again
    assert store.read_rows(tmp_path)["seed"].tolist() == [0]
    with pytest.raises(ResultError, match="no cell is finished"):
        store.read_rows(tmp_path / "empty")


def test_results_are_a_row_for_each_metric_and_each_trial(tiny_run: Path, tmp_path: Path) -> None:
    rows = store.read_rows(tiny_run)
    file = store.write_results(tmp_path, store.stored_plan(tiny_run), rows)
    table, trials = pd.read_parquet(file), pd.read_parquet(tmp_path / "trials.parquet")
    assert len(table) == len(rows) * len(store.METRICS)
    assert len(trials) == sum(len(each) for each in rows["trials"])
    wide = table[table["metric"] == "H"].set_index("cell")["value"]
    np.testing.assert_array_equal(wide.loc[rows["cell"]], rows["H"])
    assert set(table.loc[table["metric"] == "seconds", "unit"]) == {"s"}


def test_the_test_windows_come_back_as_they_were(tiny_run: Path, tmp_path: Path) -> None:
    windows, paths, naive, regression, losses = store.read_test(tiny_run)
    store.write_test(tmp_path, windows, paths, naive, regression, losses)
    again, others, floor, regressed, kept = store.read_test(tmp_path)
    assert {key: path.tolist() for key, path in regressed.items()} == {k: p.tolist() for k, p in regression.items()}
    np.testing.assert_array_equal(again.future, windows.future)
    np.testing.assert_array_equal(floor, naive)
    assert (again.horizon, again.step, again.shared_clock) == (windows.horizon, windows.step, windows.shared_clock)
    for name in ("columns", "planned", "past", "states"):
        one, other = getattr(windows, name), getattr(again, name)
        assert one.keys() == other.keys()
        assert all(np.array_equal(one[key], other[key]) for key in one)
    assert others.keys() == paths.keys()
    assert kept == losses
    (tmp_path / store.TEST).write_bytes(b"no archive")
    with pytest.raises(ResultError, match="damaged"):
        store.read_test(tmp_path)


def test_each_kind_of_session_is_noted_once(tmp_path: Path) -> None:
    """Two kinds of processors in turns, as the tasks of an array come: two entries, and a sentence at each change."""
    folder = tmp_path / "run"
    make_run(folder, tiny_plan(tmp_path))
    one, other = ({"shipid": "1", "processor": name, "packages": {"torch": "2"}} for name in ("one", "other"))
    notes = [store.note_session(folder, session) for session in (one, one, other, one, other)]
    changes = [f"processor was {before}, now {now}" for before, now in (("one", "other"), ("other", "one"))]
    assert notes == [[], [], changes[:1], changes[1:], changes[:1]]
    assert read_json(folder / store.PROVENANCE)["sessions"] == [one, other]


def compute(plan: Plan, folder: Path, *shards: tuple[int, int]) -> None:
    """Prepare a folder and compute some shards in it, in this process."""
    with without_workers():
        list(prepare_study(plan, folder))
        for shard in shards:
            list(run_study(plan, folder, shard=shard))


def alike(folder: Path, other: Path) -> None:
    """Every predictor, row and table equal to the last digit, and sealed."""
    assert stored(folder) == stored(other)
    tables = [pd.read_parquet(place / "results.parquet") for place in (folder, other)]
    pd.testing.assert_frame_equal(*(table[table["metric"] != "seconds"] for table in tables), check_exact=True)
    assert seals.sealed_faults(folder) == []


def test_pool_cluster_and_shards_give_the_same_digits(tmp_path: Path) -> None:
    """Of six methods and an identified family; a unit that no shard computed is computed at the end."""
    from dask.distributed import LocalCluster

    plan = mixed_plan(tmp_path)
    run_here(plan, tmp_path / "here")
    list(run_study(plan, tmp_path / "pool", workers=2))
    options = {"processes": False, "protocol": "tcp://", "dashboard_address": ":0", "silence_logs": 50}
    with LocalCluster(n_workers=1, threads_per_worker=1, **options) as cluster:
        list(run_study(plan, tmp_path / "dask", scheduler=cluster.scheduler_address))
    compute(plan, tmp_path / "shards", (1, 3), (3, 3))
    events = run_here(plan, tmp_path / "shards")
    notes = [event.text for event in events if "taken in" in event.text]
    assert notes == ["shard 1-of-3: 4 units taken in", "shard 3-of-3: 4 units taken in"]
    left = sum(len(unit.pairs) for unit in plan.units[1::3])
    assert sum(event.kind == "cell" for event in events) == left
    for name in ("pool", "dask", "shards"):
        alike(tmp_path / name, tmp_path / "here")
        trials = [(tmp_path / one / store.TRIALS).read_text().count('"study_name"') for one in (name, "here")]
        assert trials[0] == trials[1] > 0
    assert not list((tmp_path / "shards" / SHARDS).glob("*"))


def test_shards_of_a_study_of_parts_go_on_counting(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, {"repeat": {"seed": [0, 1]}, "grid.N_D": [4]})
    compute(plan, tmp_path / "run", (1, 2), (2, 2))
    places = [(tmp_path / "run" / "parts" / name, part.plan) for name, part in plan.parts.items()]
    computed = [
        len(store.finished_units(shard, part.units)) for place, part in places for shard in (place / SHARDS).glob("*")
    ]
    assert sorted(computed) == [2, 2, 2, 2]
    events = run_here(plan, tmp_path / "run")
    assert not [event for event in events if event.kind == "cell"]
    assert events[-1].done == events[-1].total == 8


def test_a_shard_goes_on_and_does_not_repeat_what_is_taken_in(tmp_path: Path) -> None:
    plan, folder = tiny_plan(tmp_path), tmp_path / "run"
    compute(plan, folder, (1, 2))
    with without_workers():
        again = [event.kind for event in run_study(plan, folder, shard=(1, 2))]
        assert "cell" not in again
        run_here(plan, folder)
        assert "cell" not in [event.kind for event in run_study(plan, folder, shard=(2, 2))]


@pytest.mark.parametrize("shard", [(0, 3), (4, 3)])
def test_a_shard_that_is_none_is_one_line(shard: tuple[int, int], tmp_path: Path) -> None:
    with pytest.raises(ResultError, match=r"must be i/n, i from 1 to n"):
        shard_folder(tmp_path, shard)


def test_a_folder_that_is_not_prepared_is_refused(tmp_path: Path) -> None:
    plan, folder = tiny_plan(tmp_path), tmp_path / "run"
    with without_workers():
        with pytest.raises(ResultError, match="is not prepared for shards: `shipid study prepare`"):
            list(run_study(plan, folder, shard=(1, 2)))
        list(prepare_study(plan, folder))
        with pytest.raises(ResultError, match="is prepared for another study"):
            list(run_study(tiny_plan(tmp_path, {"truth.seed": 7}), folder, shard=(1, 2)))
        (folder / store.DATASET).write_bytes(b"half")
        with pytest.raises(ResultError, match=r"dataset\.parquet: was changed"):
            list(run_study(plan, folder, shard=(1, 2)))


def test_shards_of_another_study_or_code_are_refused(tmp_path: Path) -> None:
    plan, folder = tiny_plan(tmp_path), tmp_path / "run"
    compute(plan, folder, (1, 2))
    file = shard_folder(folder, (1, 2)) / store.PROVENANCE
    record = read_json(file)
    session = {**record["sessions"][0], "shipid": "9.9, code 01234567"}
    for changed, words in (
        ({"sessions": [session]}, r"was computed with shipid 9\.9, code 01234567, and the folder with "),
        ({"digest": "0" * 64}, "is of another study: move it away"),
    ):
        write_json(file, {**record, **changed})
        with pytest.raises(ResultError, match=words):
            run_here(plan, folder)
    write_json(file, record)
    assert run_here(plan, folder)[-1].done == 8


def test_doubles_that_differ_are_refused_and_equal_ones_are_taken(tmp_path: Path) -> None:
    """Seconds differ always; another H means that two computers do not agree."""
    plan, folder = tiny_plan(tmp_path), tmp_path / "run"
    compute(plan, folder, (1, 1), (1, 2))
    place, key = shard_folder(folder, (1, 2)), plan.units[0].key
    shutil.copytree(place, tmp_path / "kept")
    for name, wrong in (("seconds", 1e3), ("H", 0.1)):
        rows = json.loads(store.rows_file(place, key).read_text())
        rows[0][name] = wrong
        write_json(store.rows_file(place, key), rows)
        seals.write_seal(place, key, [place / file for file in seals.named_files(place, key)])
    file = re.escape(f"batches/{key}.json")
    with pytest.raises(ResultError, match=f"{file}: differs from .*1-of-2/{file}"):
        run_here(plan, folder)
    shutil.rmtree(place)
    shutil.copytree(tmp_path / "kept", place)
    assert run_here(plan, folder)[-1].done == 8
