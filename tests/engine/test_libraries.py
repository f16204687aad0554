"""Compiled libraries: whatever lies in the cache or happens to the compiler, a rollout gives its numbers or a line."""

from __future__ import annotations

import logging
import os
import stat
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from shipid.engine import libraries, native
from shipid.engine.libraries import build_library, load_library, run_compiler
from shipid.engine.native import CompilerTarget, find_compiler
from shipid.engine.rollout import rollout
from shipid.errors import ShipidError
from shipid.vessel.load import load_vessel
from tests.drawn import seeds
from tests.engine.conftest import QUICK

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
SHIP = load_vessel("gunnerus-28.9")
SOURCE = "double run(void) { return 1.0; }"


def forget() -> None:
    """As a new process: nothing is compiled, no folder is chosen, no compiler is known."""
    native._compile_rollout.cache_clear()
    native._compiler_on_path.cache_clear()
    native.compiler_target.cache_clear()
    native.compiler_version.cache_clear()
    libraries._library_folders.cache_clear()


@pytest.fixture(autouse=True)
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(native, "_refused", [])
    monkeypatch.setattr(native, "OPTIONS", QUICK)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    forget()
    yield tmp_path / "cache" / "shipid"
    forget()


@pytest.fixture
def numbers(draw_inputs: Callable[..., Any]) -> Callable[..., np.ndarray]:
    given = draw_inputs(SHIP, 3)

    def run(engine: str = "repeated") -> np.ndarray:
        return rollout(SHIP, **given, step=1.0, num_steps=4, engine=engine).states

    return run


def made(folder: Path) -> Path:
    """A library in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    library = folder / "model.so"
    library.write_bytes(compiled())
    return library


@cache
def compiled() -> bytes:
    """The library of `SOURCE`, as `build_library` leaves it."""
    command = find_compiler()
    with TemporaryDirectory() as folder:
        library = Path(folder) / "model.so"
        build_library(native._compiler_command(command, CompilerTarget(1)), SOURCE, library)
        return library.read_bytes()


@pytest.mark.parametrize("kept", [0, 100, 0.9, -1])
def test_a_truncated_library_is_never_loaded(kept: float, tmp_path: Path) -> None:
    library = made(tmp_path / "a")
    content = library.read_bytes()
    library.write_bytes(content[: int(kept * len(content)) if isinstance(kept, float) else kept])
    with pytest.raises(OSError, match="is damaged"):
        load_library(library)


@pytest.mark.parametrize("seed", seeds(4, 20))
def test_a_library_with_another_byte_or_name_is_never_loaded(seed: int, tmp_path: Path) -> None:
    library = made(tmp_path / "a")
    other = library.with_name("other.so")
    other.write_bytes(library.read_bytes())
    content, rng = bytearray(library.read_bytes()), np.random.default_rng(seed)
    content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
    library.write_bytes(content)
    for wrong in (library, other):
        with pytest.raises(OSError, match="is damaged"):
            load_library(wrong)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no owners of files")
def test_the_work_of_others_is_never_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = made(tmp_path / "a")
    for place, mode in ((library, 0o720), (library, 0o702), (library.parent, 0o720), (tmp_path, 0o707)):
        before = stat.S_IMODE(place.stat().st_mode)
        place.chmod(mode)
        with pytest.raises(OSError, match="written by other"):
            load_library(library)
        place.chmod(before)
    tmp_path.chmod(0o1707)  # where nobody can put another folder in the place of this one
    assert load_library(library) is not None
    link = library.with_name("link.so")
    link.symlink_to(library)
    with pytest.raises(OSError, match="no file"):
        load_library(link)
    monkeypatch.setattr(os, "geteuid", lambda: 12345)
    with pytest.raises(OSError, match="belongs to another user"):
        load_library(library)


@pytest.mark.slow
@pytest.mark.parametrize("damage", ["truncated", "open to others", "folder"])
def test_a_rollout_mends_the_cache_or_goes_without(
    damage: str, empty_cache: Path, numbers: Callable[..., np.ndarray], caplog: pytest.LogCaptureFixture
) -> None:
    sound = numbers()
    (library,) = empty_cache.iterdir()
    content = library.read_bytes()
    library.unlink()  # what is loaded stays as it is
    if damage == "folder":
        library.mkdir()
    else:
        library.write_bytes(content[:5000] if damage == "truncated" else content)
        library.chmod(0o777 if damage == "open to others" else 0o700)
    forget()
    with caplog.at_level(logging.WARNING):
        np.testing.assert_array_equal(numbers(), sound)
    if damage != "folder":
        assert load_library(library) is not None
    assert len(caplog.records) == (damage == "folder")


def test_a_folder_of_another_user_is_not_used(
    empty_cache: Path, numbers: Callable[..., np.ndarray], caplog: pytest.LogCaptureFixture
) -> None:
    sound = numbers()
    if os.geteuid():
        pytest.skip("only root can give folders away")
    os.chown(empty_cache, 12345, 12345)
    forget()
    with caplog.at_level(logging.WARNING):
        np.testing.assert_array_equal(numbers(), sound)
    (line,) = [record.getMessage() for record in caplog.records]
    assert "not kept for the next run" in line
    assert "another user" in line


@pytest.mark.parametrize("everywhere", [False, True])
def test_a_place_that_runs_no_programs(
    everywhere: bool,
    empty_cache: Path,
    numbers: Callable[..., np.ndarray],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A cache mounted noexec, and a machine on which every such place is: the call of the system is replaced."""
    sound, load_it = numbers("native"), libraries.ctypes.CDLL

    def refused(name: str) -> Any:
        if everywhere or name.startswith(str(empty_cache)):
            raise OSError(f"{name}: failed to map segment from shared object: Operation not permitted")
        return load_it(name)

    monkeypatch.setattr(libraries.ctypes, "CDLL", refused)
    forget()
    with caplog.at_level(logging.WARNING):
        np.testing.assert_allclose(numbers(), sound, rtol=1e-9)
    lines = [record.getMessage() for record in caplog.records]
    assert all("Operation not permitted" in line for line in lines)
    assert ["not used" in line for line in lines] == ([False, True] if everywhere else [False])
    if everywhere:
        with pytest.raises(ShipidError, match="use engine 'torch'"):
            numbers("native")


@pytest.mark.parametrize("seed", range(3))
def test_what_a_strange_compiler_says_is_one_line_that_names_it_and_controls_no_terminal(
    seed: int,
    tmp_path: Path,
    numbers: Callable[..., np.ndarray],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Also of one that ends without an error, and without a library."""
    words = bytes(np.random.default_rng(seed).integers(1, 256, 40, dtype=np.uint8)) + b"\x1b[31m"
    (tmp_path / "said").write_bytes(b"error: " + words.replace(b"\n", b" "))
    (tmp_path / "tools").mkdir()
    empty = 'while [ "$1" != -o ]; do shift; done; : > "$2"'
    ends = (f"/bin/cat {tmp_path / 'said'} >&2; exit 1", "exit 0", empty)[seed % 3]
    (tmp_path / "tools" / "gcc").write_text(f"#!/bin/sh\n{ends}\n")
    (tmp_path / "tools" / "gcc").chmod(0o700)
    monkeypatch.setenv("PATH", str(tmp_path / "tools"))
    forget()
    with caplog.at_level(logging.WARNING):
        assert np.isfinite(numbers()).all()
        numbers()
    assert native.engine_description() == "casadi"
    (line,) = [record.getMessage() for record in caplog.records]
    assert f"the C compiler {tmp_path / 'tools' / 'gcc'} failed (" in line
    assert ("without a library" in line) == bool(seed % 3)
    assert line.isprintable()


def test_a_compiler_that_never_returns_is_ended_with_its_children(tmp_path: Path) -> None:
    child = tmp_path / "child"
    reason, _ = run_compiler(["sh", "-c", f"sleep 600 & echo $! > {child}; wait"], limit=2.0)
    assert reason == "hangs: not done after 2 s"
    limit = time.monotonic() + 60.0
    while _alive(int(child.read_text())) and time.monotonic() < limit:
        time.sleep(0.02)
    assert not _alive(int(child.read_text()))


def _alive(number: int) -> bool:
    try:
        return Path(f"/proc/{number}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False


def test_what_a_compiler_leaves_running_is_not_waited_for() -> None:
    """Such as a server that keeps its results: it holds the pipe of what is printed."""
    start = time.monotonic()
    assert run_compiler(["sh", "-c", "echo done; sleep 60 &"]) == (None, "done\n")
    assert time.monotonic() - start < 50.0


def test_a_compiler_that_cannot_be_started_is_a_reason(tmp_path: Path) -> None:
    reason, _ = run_compiler([str(tmp_path / "none")])
    assert reason.startswith("cannot be started")
