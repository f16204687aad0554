"""One writer: a second one is refused in one line, and a kill frees the folder."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock

from shipid.errors import ResultError
from shipid.study.check import check_folder
from shipid.study.seals import has_writer, sole_writer
from tests.study.tiny import events_here, make_run, run_here, tiny_plan


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
