"""Shards: the digits of a single run, whoever computes a unit; what does not belong together is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

from shipid.errors import ResultError
from shipid.files import read_json, write_json
from shipid.study import seals, store
from shipid.study.plan import Plan
from shipid.study.run import prepare_study, run_study
from shipid.study.store import SHARDS, shard_folder
from tests.faults.folders import stored
from tests.study.tiny import mixed_plan, run_here, tiny_plan, without_workers


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
    assert notes == ["shard 1-of-3: 3 units taken in", "shard 3-of-3: 2 units taken in"]
    left = sum(len(unit.pairs) for unit in plan.units[1::3])
    assert sum(event.kind == "cell" for event in events) == left
    for name in ("pool", "dask", "shards"):
        alike(tmp_path / name, tmp_path / "here")
        journals = [{file.name for file in (tmp_path / one / store.JOURNALS).iterdir()} for one in (name, "here")]
        assert journals[0] == journals[1]
    assert not list((tmp_path / "shards" / SHARDS).glob("*"))


def test_shards_of_a_study_of_parts_go_on_counting(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, {"repeat": {"seed": [0, 1]}, "grid.N_D": [4]})
    compute(plan, tmp_path / "run", (1, 2), (2, 2))
    places = [(tmp_path / "run" / "parts" / name, part.plan) for name, part in plan.parts.items()]
    computed = [
        len(store.finished_units(shard, part.units)) for place, part in places for shard in (place / SHARDS).glob("*")
    ]
    assert sorted(computed) == [0, 0, 1, 1]
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
    with pytest.raises(ResultError, match=rf"batches/{key}\.json: differs from .*1-of-2/batches/{key}\.json"):
        run_here(plan, folder)
    shutil.rmtree(place)
    shutil.copytree(tmp_path / "kept", place)
    assert run_here(plan, folder)[-1].done == 8
