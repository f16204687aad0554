"""Files appear whole or not at all, whatever goes wrong while they are written."""

from __future__ import annotations

import errno
import io
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid import files
from shipid.errors import DataError, ResultError

FRAME = pd.DataFrame({"run": ["a", "b"], "H": [1.5, 2.5]})
WRITERS: dict[str, Callable[[Path], None]] = {
    "text.md": lambda file: files.write_text(file, "new ä"),
    "text.json": lambda file: files.write_json(file, {"H": 1.0}),
    "table.csv": lambda file: files.write_table(file, FRAME),
    "table.parquet": lambda file: files.write_table(file, FRAME),
    "arrays.npz": lambda file: files.write_arrays(file, {"x": np.arange(3.0)}),
}


def full(*_: Any, **__: Any) -> None:
    """A disk without space."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("name", WRITERS)
def test_only_the_file_is_left(name: str, tmp_path: Path) -> None:
    file = tmp_path / "deep" / "er" / name
    WRITERS[name](file)
    assert file.stat().st_size > 0
    assert list(file.parent.iterdir()) == [file]


@pytest.mark.parametrize("broken", ["replace", "fsync"])
@pytest.mark.parametrize("name", WRITERS)
def test_a_failing_disk_leaves_the_old_file(
    name: str, broken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / name
    file.write_bytes(b"old")
    monkeypatch.setattr(files.os, broken, full)
    with pytest.raises(OSError, match="No space"):
        WRITERS[name](file)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.skipif(os.name != "posix", reason="no permissions of files")
@pytest.mark.parametrize("mode", [0o600, 0o666])
@pytest.mark.parametrize("name", WRITERS)
def test_who_may_read_and_write_a_file_may_do_so_with_the_one_that_replaces_it(
    name: str, mode: int, tmp_path: Path
) -> None:
    """A colleague with a closed umask locked all others out of a shared folder, file by file."""
    file = tmp_path / name
    file.write_bytes(b"old")
    file.chmod(mode)
    before = os.umask(0o077)
    try:
        WRITERS[name](file)
    finally:
        os.umask(before)
    assert file.read_bytes() != b"old"
    assert file.stat().st_mode & 0o777 == mode


@pytest.mark.parametrize("moment", range(17))
def test_of_files_that_belong_together_none_is_old_beside_a_new_one(
    moment: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed at any call that changes the folder."""
    old, new = ({tmp_path / name: f"{age} {name}" for name in ("a.c", "a.h")} for age in ("old", "new"))
    files.write_set(old)
    calls = iter(range(100))

    def killed(call: Callable[..., Any]) -> Callable[..., Any]:
        def maybe(*arguments: Any, **more: Any) -> Any:
            if next(calls) == moment:
                raise KeyboardInterrupt
            return call(*arguments, **more)

        return maybe

    for place, name in ((Path, "write_text"), (Path, "unlink"), (os, "replace"), (files, "sync_to_disk")):
        monkeypatch.setattr(place, name, killed(getattr(place, name)))
    try:
        files.write_set(new)
        done = True
    except KeyboardInterrupt:
        done = False
    left = {file.name: file.read_text() for file in tmp_path.iterdir() if file.is_file()}
    assert len({text.split()[0] for text in left.values()}) <= 1
    assert not done or left == {file.name: text for file, text in new.items()}
    assert done == (next(calls) <= moment)


def test_what_is_not_finite_is_null_in_json(tmp_path: Path) -> None:
    files.write_json(tmp_path / "a.json", {"x": np.float64(2.5), 3: [np.nan, (np.inf, np.int64(7))], "s": "ä"})
    assert json.loads((tmp_path / "a.json").read_text()) == {"x": 2.5, "3": [None, [None, 7]], "s": "ä"}
    assert files.read_json(tmp_path / "a.json")["x"] == 2.5


def test_json_that_cannot_be_read_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ResultError, match="is this the folder of a run"):
        files.read_json(tmp_path / "gone.json")
    (tmp_path / "half.json").write_text('{"a": ')
    with pytest.raises(ResultError, match=r"half\.json.*damaged"):
        files.read_json(tmp_path / "half.json")


@pytest.mark.parametrize(("name", "read"), [("a.csv", pd.read_csv), ("a.parquet", pd.read_parquet)])
def test_tables_come_back(name: str, read: Callable[[Path], pd.DataFrame], tmp_path: Path) -> None:
    files.write_table(tmp_path / name, FRAME)
    pd.testing.assert_frame_equal(read(tmp_path / name), FRAME, check_dtype=False)


@pytest.mark.parametrize("name", ["a.xlsx", "a"])
def test_a_table_of_another_kind_is_refused_before_it_is_written(name: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"ending in \.parquet or \.csv"):
        files.write_table(tmp_path / name, FRAME)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("compressed", [False, True])
def test_arrays_come_back(compressed: bool, tmp_path: Path) -> None:
    arrays = {"x": np.arange(6.0).reshape(2, 3), "words": np.array(["a", "bc"])}
    files.write_arrays(tmp_path / "a.npz", arrays, compressed=compressed)
    again = files.read_arrays(tmp_path / "a.npz")
    assert list(again) == ["x", "words"]
    for name, values in arrays.items():
        np.testing.assert_array_equal(again[name], values)


def test_arrays_with_pickles_are_neither_written_nor_read(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="allow_pickle"):
        files.write_arrays(tmp_path / "a.npz", {"x": np.array([{}], dtype=object)})
    assert not list(tmp_path.iterdir())
    np.savez(tmp_path / "b.npz", x=np.array([{}], dtype=object))
    with pytest.raises(ValueError, match="allow_pickle"):
        files.read_arrays(tmp_path / "b.npz")


@pytest.mark.parametrize("length", [0, 1, 40, -1])
def test_half_a_file_of_arrays_is_a_value_error(length: int, tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    files.write_arrays(file, {"x": np.arange(50.0)})
    file.write_bytes(file.read_bytes()[:length])
    with pytest.raises(ValueError, match=r"a\.npz is not a whole \.npz"):
        files.read_arrays(file)


def with_header(text: str, **settings: Any) -> bytes:
    """An archive, right in itself, whose one array has this header."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", **settings) as archive:
        archive.writestr("x.npy", b"\x93NUMPY\1\0" + len(text).to_bytes(2, "little") + text.encode() + bytes(40))
    return stream.getvalue()


WHOLE = "{'descr': '<f8', 'fortran_order': False, 'shape': (5,)}"


@pytest.mark.parametrize(
    "content",
    [
        *map(with_header, ("{[]: 1}", "(", "0 0", WHOLE.replace("'<f8'", "(('<f8',),)"))),
        *(with_header(WHOLE.replace("5", size)) for size in ("True", "-1", "9" * 12, "9" * 30)),
        with_header(WHOLE).replace(b"PK\1\2\x14\3\x14\0\0", b"PK\1\2\x14\3\x14\0\1"),  # said to be encrypted
        with_header(WHOLE, compression=zipfile.ZIP_LZMA).replace(b"\x5d\0\0", b"\xff\0\0"),
    ],
)
def test_a_foreign_file_of_arrays_is_a_value_error(content: bytes, tmp_path: Path) -> None:
    """Errors of eight kinds, of which five ended in a traceback."""
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"a\.npz is not a whole \.npz"):
        files.read_arrays(tmp_path / "a.npz")


def test_a_new_document_is_never_written_over(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    assert files.write_new("x = 1\n", file) == file
    with pytest.raises(DataError, match="is not written over"):
        files.write_new("x = 2\n", file)
    assert file.read_text() == "x = 1\n"
    with pytest.raises(DataError, match=r"let the name end in \.toml"):
        files.write_new("x = 2\n", tmp_path / "a.txt")


def killed_while_it_writes(file: Path) -> int:
    """The process, which nobody has waited for."""
    process = os.fork()
    if not process:
        with files.replace_whole(file) as temporary:
            temporary.write_text("half")
            os._exit(0)
    os.waitid(os.P_PID, process, os.WEXITED | os.WNOWAIT)
    return process


def test_what_a_killed_process_leaves_is_swept(tmp_path: Path) -> None:
    with files.replace_whole(tmp_path / "b.txt") as mine:
        mine.write_text("whole")
        os.waitpid(killed_while_it_writes(tmp_path / "a.txt"), 0)
        assert len(list(tmp_path.iterdir())) == 2
        files._SWEPT.clear()
        files.write_text(tmp_path / "c.txt", "whole")
        (tmp_path / "c.txt").unlink()
        assert list(tmp_path.iterdir()) == [mine.parent], "only what is at work stays"
    assert [file.name for file in tmp_path.iterdir()] == ["b.txt"]


def test_folder_and_file_are_synced_before_and_after_the_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    replace = os.replace
    monkeypatch.setattr(files, "sync_to_disk", lambda place: calls.append(f"sync {Path(place).name}"))
    monkeypatch.setattr(files.os, "replace", lambda one, other: (calls.append("replace"), replace(one, other)))
    files.write_text(tmp_path / "new" / "a.txt", "x")
    assert calls == [f"sync {tmp_path.name}", "sync a.txt", "replace", "sync new"]


def test_a_link_stays_and_leads_to_the_new_file(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    link, real = tmp_path / "link.txt", tmp_path / "there" / "real.txt"
    link.symlink_to(real)
    files.write_text(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"


def test_devices_and_pipes_are_neither_written_nor_waited_for(tmp_path: Path) -> None:
    """As root, a file would replace a device for every program of the machine."""
    os.mkfifo(tmp_path / "pipe")
    for use in (lambda: files.write_text(tmp_path / "pipe", "new"), lambda: files.read_arrays(tmp_path / "pipe")):
        with pytest.raises(OSError, match="a device or a pipe"):
            use()


@pytest.mark.parametrize(
    ("path", "typed"),
    [("results/a", "results/a"), ("a b", "'a b'"), ("-x", "./-x"), ("-x y", "'./-x y'"), ("/a/-x", "/a/-x")],
)
def test_a_path_in_a_command_can_be_typed_as_it_is(path: str, typed: str) -> None:
    assert files.quote_argument(Path(path)) == typed


def test_nothing_is_written_again_where_a_folder_was_moved_away(tmp_path: Path) -> None:
    """Before, an empty folder came back at the old place."""
    files.write_json(tmp_path / "results" / "cells" / "a.json", {"a": 1})
    (tmp_path / "results").rename(tmp_path / "moved")
    for file in ("cells/b.json", "b.json", "new/b.json"):
        with pytest.raises(OSError, match="the folder has gone"):
            files.write_json(tmp_path / "results" / file, {"b": 1})
    assert not (tmp_path / "results").exists()
