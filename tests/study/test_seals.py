"""Seals: what is not as it was written is refused, what is missing is computed again."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from filelock import FileLock

from shipid.errors import ResultError
from shipid.files import read_json, write_json
from shipid.study import seals, store
from shipid.study.check import check_folder
from shipid.study.results import read_cells
from shipid.study.seals import has_writer, sole_writer
from tests.cli.running import ended
from tests.study.tiny import events_here, make_run, run_here, tiny_plan


@pytest.fixture
def folder(tiny_run: Path, tmp_path: Path) -> Path:
    shutil.copytree(tiny_run, tmp_path / "run")
    return tmp_path / "run"


def test_a_finished_run_is_sealed(folder: Path) -> None:
    assert seals.sealed_faults(folder) == []
    seals.check_seals(folder)
    assert list(seals.unseal_missing(folder)) == []
    lines = [line for file in (folder / "seals").iterdir() for line in file.read_text().splitlines()]
    sealed = {line.split("  ")[1] for line in lines if not line.startswith("#")}
    for name in ("dataset.parquet", "test.npz", "envelope.json", "foundations.json", "results.parquet"):
        assert name in sealed
    assert {f"cells/{file.name}" for file in (folder / "cells").iterdir()} <= sealed


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="no sha256sum here")
def test_the_usual_tool_reads_seals(folder: Path) -> None:
    files = [str(file.relative_to(folder)) for file in (folder / "seals").iterdir()]
    done = subprocess.run(["sha256sum", "--check", "--strict", "--quiet", *files], cwd=folder, capture_output=True)
    assert done.returncode == 0


@pytest.mark.parametrize("pattern", ["cells/*.npz", "batches/*.json", "dataset.parquet", "test.npz"])
def test_what_is_missing_is_computed_again_and_what_is_damaged_is_refused(pattern: str, folder: Path) -> None:
    file = sorted(folder.glob(pattern))[0]
    file.write_bytes(file.read_bytes()[:-1])
    before = sorted(folder.rglob("*"))
    for look in (seals.check_seals, seals.unseal_missing):
        with pytest.raises(ResultError, match=r"is damaged, or .*: put it back, or delete it and continue") as caught:
            look(folder)
        assert caught.value.file == str(file)
    assert sorted(folder.rglob("*")) == before
    file.unlink()
    (words,) = seals.unseal_missing(folder)
    assert words == f"{file.relative_to(folder)} missing: computed again"
    assert seals.sealed_faults(folder) == []


def test_what_the_system_does_not_give_may_be_whole_and_is_not_removed(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files of another user, a disk or a file server with an error."""
    file = next((folder / "cells").glob("*.npz"))
    before, digest = sorted(folder.rglob("*")), seals._digest

    def refuse(asked: Path) -> str:
        if asked == file:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(asked))
        return digest(asked)

    monkeypatch.setattr(seals, "_digest", refuse)
    for look in (seals.unseal_missing, seals.check_seals, check_folder):
        with pytest.raises(PermissionError):
            look(folder)
    assert sorted(folder.rglob("*")) == before


def test_every_command_that_reads_a_cell_asks_its_seal(folder: Path, tmp_path: Path) -> None:
    """`aboard` and `export` took a cell that had been changed; one that was copied elsewhere has no seal."""
    one, other = sorted((folder / "cells").glob("right+*"))[:2]
    log, out = folder / "dataset.parquet", tmp_path / "out"
    commands = [
        ["predict", folder, log, "--cell", one.stem, "--out", f"{out}.csv"],
        ["aboard", log, "--predictor", one],
    ]
    for command in commands:
        assert ended(*command)[0] == 0
    shutil.copyfile(other, one)
    for command in commands:
        code, _, error = ended(*command)
        assert code == 1
        assert re.fullmatch(rf"error: {re.escape(str(one))}: was changed after it was written[^\n]*\n", error)
    shutil.move(one, tmp_path / "mine.npz")
    assert ended("aboard", log, "--predictor", tmp_path / "mine.npz")[0] == 0


def test_a_cell_of_another_study_is_refused_though_its_seal_came_with_it(folder: Path) -> None:
    """Where two folders are merged, cells of one name take each other's place: the report mixed two studies."""
    record = read_json(folder / store.PROVENANCE)
    write_json(folder / store.PROVENANCE, {**record, "digest": "0123456789abcdef"})
    found = seals.sealed_faults(folder)
    assert {fault.kind for fault in found} == {"changed"}
    assert {fault.seal for fault in found} == seals.seal_names(folder)
    with pytest.raises(ResultError, match=r"is of another study: put it back, or delete it and cont") as caught:
        list(seals.unseal_missing(folder))
    assert caught.value.file == str(folder / found[0].file)


def test_the_quick_table_is_of_rows_as_they_were_written(folder: Path) -> None:
    """`read_cells` took what was in the files."""
    rows = read_cells(folder)
    (folder / "cells" / f"{rows['cell'][0]}.npz").unlink()
    pd.testing.assert_frame_equal(read_cells(folder), rows)  # which needs no predictor
    file = next((folder / "batches").iterdir())
    write_json(file, [{**row, "H": 7.7} for row in read_json(file)])
    with pytest.raises(ResultError, match="was changed after it was written"):
        read_cells(folder)


def entries(journal: Path) -> list[dict[str, Any]]:
    """Entries of a journal without what is drawn anew at each writing."""
    new = ("worker_id", "datetime_start", "datetime_complete")
    return [json.loads(line) | dict.fromkeys(new, "") for line in journal.read_text().splitlines()]


def test_copies_of_a_program_that_synchronises_are_no_results(folder: Path) -> None:
    """As "N0004-s0 (1).json": a cell counted twice, and later searches vanished from the merged journal."""
    rows, whole = read_cells(folder), entries(folder / store.TRIALS)
    for place, ending in (("batches", "json"), ("trials", "log")):
        for file in list((folder / place).glob("*")):
            shutil.copyfile(file, folder / place / f"{file.stem} (1).{ending}")
    for file in list((folder / "seals").glob("*")):
        shutil.copyfile(file, folder / "seals" / f"{file.stem} (1).sha256")
    plan = store.stored_plan(folder)
    assert store.read_rows(folder, plan)["cell"].tolist() == rows["cell"].tolist()
    store.write_results(folder, plan, store.read_rows(folder, plan))
    assert entries(folder / store.TRIALS) == whole


def test_a_seal_names_files_inside_the_folder_only(folder: Path) -> None:
    seal = next((folder / "seals").glob("*"))
    seal.write_text(f"{'0' * 64}  ../../etc/passwd\n")
    (fault,) = seals.sealed_faults(folder)
    assert (fault.kind, fault.file) == ("changed", f"seals/{seal.name}")


def test_a_second_writer_is_refused_in_one_line(tmp_path: Path) -> None:
    with sole_writer(tmp_path):
        with pytest.raises(ResultError, match="works in it: wait until it has ended, or end it"):
            sole_writer(tmp_path).__enter__()
        assert has_writer(tmp_path)
    assert not has_writer(tmp_path)


def test_a_kill_frees_the_folder(tmp_path: Path) -> None:
    program = "import sys; from pathlib import Path; from shipid.study.seals import sole_writer\n"
    program += "with sole_writer(Path(sys.argv[1])):\n    print('in', flush=True)\n    sys.stdin.read()\n"
    command = [sys.executable, "-c", program, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "in\n"
        assert has_writer(tmp_path)
        process.send_signal(signal.SIGKILL)
        process.wait()
    with sole_writer(tmp_path):
        pass


def test_a_run_keeps_a_second_start_out_and_a_check_names_it(tmp_path: Path) -> None:
    plan, folder = tiny_plan(tmp_path), tmp_path / "run"
    events = events_here(plan, folder)
    assert next(events).kind == "note"
    with pytest.raises(ResultError, match="another process works in it"):
        run_here(plan, folder)
    assert any(line == "a process works in it" for line in check_folder(folder).lines)
    events.close()  # type: ignore[attr-defined]
    make_run(folder, plan)


def test_a_file_system_without_locks_is_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refused(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(FileLock, "acquire", refused)
    with sole_writer(tmp_path):
        pass
    assert "is on a file system without locks: let one process at a time work in it" in caplog.text


def test_nobody_is_said_to_work_in_a_folder_that_may_only_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`study check` of a colleague's folder reads it; it named another process there."""

    def refused(*_: Any, **__: Any) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(FileLock, "acquire", refused)
    assert not has_writer(tmp_path)
