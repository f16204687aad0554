"""Files appear whole or not at all, whatever goes wrong while they are written."""

from __future__ import annotations

import errno
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


def forbidden(*_: Any) -> None:
    """A group that this user is not in."""
    raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))


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


@pytest.mark.parametrize("before", [b"old", None])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_inside_leaves_what_was_there(before: bytes | None, error: type[Exception], tmp_path: Path) -> None:
    file = tmp_path / "out.txt"
    if before is not None:
        file.write_bytes(before)

    def write() -> None:
        with files.whole(file) as temporary:
            temporary.write_text("half")
            raise error("stop")

    with pytest.raises(error):
        write()
    assert [(one.name, one.read_bytes()) for one in tmp_path.iterdir()] == ([("out.txt", before)] if before else [])


@pytest.mark.skipif(os.name != "posix", reason="no permissions of files")
@pytest.mark.parametrize("mode", [0o664, 0o600, 0o644, 0o666])
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


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give files away")
def test_a_file_in_place_of_a_colleagues_is_not_closed_to_him(tmp_path: Path) -> None:
    file = tmp_path / "text.md"
    file.write_text("old")
    file.chmod(0o600)
    os.chown(file, 12345, -1)
    before = os.umask(0o022)
    try:
        files.write_text(file, "new")
    finally:
        os.umask(before)
    assert file.stat().st_uid == 0
    assert file.stat().st_mode & 0o777 == 0o644


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give files away")
@pytest.mark.parametrize(
    ("may", "group", "mode"), [(True, 12345, 0o664), (False, os.getgid() if os.name == "posix" else 0, 0o604)]
)
def test_a_file_keeps_its_group_or_opens_to_no_other(
    may: bool, group: int, mode: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "text.md"
    file.write_text("old")
    os.chown(file, -1, 12345)
    file.chmod(0o664)
    if not may:
        monkeypatch.setattr(files.os, "chown", forbidden)
    before = os.umask(0o077)
    try:
        files.write_text(file, "new")
    finally:
        os.umask(before)
    assert file.read_text() == "new"
    assert (file.stat().st_gid, file.stat().st_mode & 0o777) == (group, mode)


def test_the_old_file_is_there_until_the_new_one_is_whole(tmp_path: Path) -> None:
    file = tmp_path / "out.txt"
    file.write_text("old")
    with files.whole(file) as temporary:
        temporary.write_text("new")
        assert file.read_text() == "old"
        assert temporary.name == file.name
    assert file.read_text() == "new"


@pytest.mark.parametrize("moment", range(18))
def test_of_files_that_belong_together_none_is_old_beside_a_new_one(
    moment: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed at any call that changes the folder."""
    old, new = ({tmp_path / name: f"{age} {name}" for name in ("a.c", "a.h")} for age in ("old", "new"))
    former = {tmp_path / "a-band.c": "old a-band.c"}
    files.write_together(old | former)
    calls = iter(range(100))

    def killed(call: Callable[..., Any]) -> Callable[..., Any]:
        def maybe(*arguments: Any, **more: Any) -> Any:
            if next(calls) == moment:
                raise KeyboardInterrupt
            return call(*arguments, **more)

        return maybe

    for place, name in ((Path, "write_text"), (Path, "unlink"), (os, "replace"), (files, "sync")):
        monkeypatch.setattr(place, name, killed(getattr(place, name)))
    try:
        files.write_together(new, former)
        done = True
    except KeyboardInterrupt:
        done = False
    left = {file.name: file.read_text() for file in tmp_path.iterdir() if file.is_file()}
    assert len({text.split()[0] for text in left.values()}) <= 1
    assert not done or left == {file.name: text for file, text in new.items()}
    assert done == (next(calls) <= moment)


@pytest.mark.parametrize("seed", range(8))
def test_where_one_of_files_that_belong_together_cannot_be_written_all_stay(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error names the file; before, it named none, and left a folder behind that it had made."""
    rng = np.random.default_rng(seed)
    names = [f"{n}.c" for n in range(rng.integers(1, 5))]
    first, failing, folder = rng.choice(names), rng.choice(names), tmp_path / "deep" / "er"
    if old := bool(rng.integers(2)):
        files.write_together({folder / name: "old" for name in names})
        (folder / first).rename(tmp_path / "elsewhere")
        (folder / first).symlink_to(tmp_path / "elsewhere")  # a link stays
    write = Path.write_text

    def limited(file: Path, *arguments: Any, **options: Any) -> int:
        return full() if file.name == failing else write(file, *arguments, **options)

    monkeypatch.setattr(Path, "write_text", limited)
    with pytest.raises(OSError, match="No space") as caught:
        files.write_together({folder / name: "new" for name in names}, [folder / "former"])
    assert Path(caught.value.filename).resolve() == (folder / failing).resolve()
    assert {file.name: file.read_text() for file in tmp_path.glob("deep/er/*")} == dict.fromkeys(names * old, "old")
    assert old or not list(tmp_path.iterdir())
    monkeypatch.undo()
    (folder / "former").parent.mkdir(parents=True, exist_ok=True)
    (folder / "former").symlink_to(tmp_path)
    files.write_together({folder / name: "new" for name in names}, [folder / first, folder / "former"])
    assert {file.name: file.read_text() for file in folder.iterdir()} == dict.fromkeys(names, "new")
    assert (folder / first).is_symlink() == old


def test_only_an_empty_folder_is_new(tmp_path: Path) -> None:
    files.check_empty(tmp_path)
    files.check_empty(tmp_path / "new")
    (tmp_path / "a").touch()
    for place in (tmp_path, tmp_path / "a"):
        with pytest.raises(DataError, match="name a new one"):
            files.check_empty(place)


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
    with pytest.raises(ValueError, match=r"a\.npz is not a whole \.npz|allow_pickle"):
        files.read_arrays(file)


def test_arrays_in_an_unknown_compression_are_a_value_error(tmp_path: Path) -> None:
    """Method 99 of the zip format, which Python does not know, in both headers of the member."""
    file = tmp_path / "a.npz"
    files.write_arrays(file, {"x": np.arange(50.0)})
    content = bytearray(file.read_bytes())
    for sign, place in ((b"PK\x03\x04", 8), (b"PK\x01\x02", 10)):
        content[content.index(sign) + place] = 99
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"a\.npz is not a whole \.npz"):
        files.read_arrays(file)


@pytest.mark.parametrize("header", ["{'descr': '<f8', 'shape': (2,", "{'descr': '<f8'\n  x", "((((", "{" * 300])
def test_an_array_whose_header_is_damaged_is_a_value_error(header: str, tmp_path: Path) -> None:
    """NumPy reads it as a piece of Python: what has no end was an error of the tokenizer, with a traceback."""
    file, text = tmp_path / "a.npz", f"{header}\n".encode()
    with zipfile.ZipFile(file, "w") as stored:
        stored.writestr("x.npy", b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + bytes(16))
    with pytest.raises(ValueError, match=r"a\.npz is not a whole \.npz|Cannot parse header|header"):
        files.read_arrays(file)


def test_a_new_document_is_never_written_over(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    assert files.write_new("x = 1\n", file) == file
    with pytest.raises(DataError, match="is not written over"):
        files.write_new("x = 2\n", file)
    assert file.read_text() == "x = 1\n"
    with pytest.raises(DataError, match=r"a study is a TOML file: let the name end in \.toml"):
        files.write_new("x = 2\n", tmp_path / "a.txt", "study")


def test_a_document_on_a_full_disk_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(DataError, match=r"a\.toml.*cannot be written \(No space"):
        files.write_new("x = 1\n", tmp_path / "a.toml")
    assert not list(tmp_path.iterdir())


def killed_while_it_writes(file: Path) -> int:
    """The process, which nobody has waited for."""
    process = os.fork()
    if not process:
        with files.whole(file) as temporary:
            temporary.write_text("half")
            os._exit(0)
    os.waitid(os.P_PID, process, os.WEXITED | os.WNOWAIT)
    return process


def test_what_a_killed_process_leaves_is_swept(tmp_path: Path) -> None:
    with files.whole(tmp_path / "b.txt") as mine:
        mine.write_text("whole")
        os.waitpid(killed_while_it_writes(tmp_path / "a.txt"), 0)
        assert len(list(tmp_path.iterdir())) == 2
        files.sweep(tmp_path)
        assert list(tmp_path.iterdir()) == [mine.parent], "only what is at work stays"
    assert [file.name for file in tmp_path.iterdir()] == ["b.txt"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_a_process_that_nobody_has_waited_for_is_gone(tmp_path: Path) -> None:
    """Before, a container whose first process waits for no other kept its temporary folders for a day."""
    process = killed_while_it_writes(tmp_path / "a.txt")
    assert files.is_alive(os.getpid())
    assert not files.is_alive(process)
    files.sweep(tmp_path)
    assert not list(tmp_path.iterdir())
    os.waitpid(process, 0)
    assert not files.is_alive(process)


def test_the_next_process_that_writes_sweeps(tmp_path: Path) -> None:
    """Before, what a killed import or export left behind stayed beside its file for good."""
    os.waitpid(killed_while_it_writes(tmp_path / "a.txt"), 0)
    assert len(list(tmp_path.iterdir())) == 1
    files.write_text(tmp_path / "b.txt", "whole")
    assert [file.name for file in tmp_path.iterdir()] == ["b.txt"]


def test_folder_and_file_are_synced_before_and_after_the_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    replace = os.replace
    monkeypatch.setattr(files, "sync", lambda place: calls.append(f"sync {Path(place).name}"))
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


def test_devices_pipes_and_circles_are_refused(tmp_path: Path) -> None:
    """As root, a file would replace a device for every program of the machine."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    for place, why in ((tmp_path / "pipe", "a device or a pipe"), (tmp_path / "circle", "leads to itself")):
        with pytest.raises(OSError, match=why):
            files.write_text(place, "new")
        assert not place.is_file()


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.npz")
    with pytest.raises(OSError, match="a device or a pipe"):
        files.read_arrays(tmp_path / "pipe.npz")


def test_a_table_may_have_a_name_that_is_not_utf_8(tmp_path: Path) -> None:
    file = tmp_path / os.fsdecode(b"\xe9.parquet")
    files.write_table(file, pd.DataFrame({"a": [1.0]}))
    with file.open("rb") as stream:
        assert pd.read_parquet(stream)["a"].tolist() == [1.0]


def test_text_may_name_a_file_that_is_not_utf_8(tmp_path: Path) -> None:
    files.write_text(tmp_path / "a.html", f"made in {os.fsdecode(b'caf')}{os.fsdecode(bytes([0xE9]))}")
    assert (tmp_path / "a.html").read_text() == r"made in caf\udce9"


def test_a_folder_that_cannot_be_written_is_no_temporary_one_to_the_user(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(place: str, *_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), place)

    monkeypatch.setattr(os, "mkdir", refused)
    with pytest.raises(OSError, match="Read-only") as caught:
        files.write_json(tmp_path / "a.json", {})
    assert caught.value.filename == str(tmp_path / "a.json")


def test_a_write_that_fails_names_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a full disk the system says that there is no space, and not for which file."""

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space") as caught:
        files.write_json(tmp_path / "a.json", {})
    assert caught.value.filename == str(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("path", "typed"),
    [("results/a", "results/a"), ("a b", "'a b'"), ("-x", "./-x"), ("-x y", "'./-x y'"), ("/a/-x", "/a/-x")],
)
def test_a_path_in_a_command_can_be_typed_as_it_is(path: str, typed: str) -> None:
    assert files.as_argument(Path(path)) == typed
