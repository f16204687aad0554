"""Shared libraries that a C compiler made, kept in a folder: only whole ones that this user wrote are ever loaded.

A library ends in a seal, a digest of its bytes and its name: a truncated, exchanged or foreign file does not match it.
"""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import logging
import os
import signal
import stat
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from shipid.errors import ShipidError, escape_unprintable
from shipid.files import temporary_folder

MOST_WORDS = 100_000  # characters of each output of a compiler
PROBE_LIMIT, LIMIT = 10.0, 120.0  # s that a compiler may take: for a probe of two lines, for a model

log = logging.getLogger(__name__)


class NoLibrary(ShipidError):
    """A library could not be compiled or loaded on this machine; other engines can do its work."""


@cache
def _library_folders(kept: str) -> list[Path]:
    """Folders to try for libraries: `shipid` in the one that is kept, then a temporary one of this process."""
    temporary = tempfile.TemporaryDirectory(prefix="shipid-")
    atexit.register(temporary.cleanup)
    return [Path(kept) / "shipid", Path(temporary.name)]


def obtain_library(command: Sequence[str], source: str, kept: str, name: str) -> Any:
    """Function `run` of C source, from the library of this name or compiled anew; NoLibrary where that fails.

    command : compiler and options, with `{source}` and `{library}` where the names of the files belong.
    kept : folder for what can be made anew. One that is another's, or where nothing can be written or run, is left for
        a temporary one.
    """
    try:
        folders = _library_folders(kept)
        while True:
            try:
                with suppress(OSError):  # not there, or damaged, or another's
                    return load_library(folders[0] / name)
                build_library(command, source, folders[0] / name)
                return load_library(folders[0] / name)
            except OSError as error:
                if len(folders) == 1:
                    raise
                folders.pop(0)
                log.warning("compiled equations are not kept for the next run: %s", escape_unprintable(str(error)))
    except OSError as error:
        raise NoLibrary(f"{error}: set TMPDIR to a folder that may hold and run programs") from None


def run_compiler(arguments: Sequence[str], folder: Path | None = None, limit: float = LIMIT) -> tuple[str | None, str]:
    """Run a compiler: (its complaint in one text, None if it succeeded; what it printed).

    folder : for its temporary files. A compiler that takes longer than `limit` [s] is ended, and so are the processes
        that it leaves. Of what it prints the first `MOST_WORDS` characters are kept, so that none can fill the memory.
    """
    environment = os.environ | ({"TMPDIR": str(folder)} if folder else {})
    with tempfile.TemporaryFile(dir=folder) as printed, tempfile.TemporaryFile(dir=folder) as complaint:
        try:
            process = subprocess.Popen(
                arguments, stdin=subprocess.DEVNULL, stdout=printed, stderr=complaint, env=environment, process_group=0
            )
            try:
                process.wait(limit)
            except subprocess.TimeoutExpired:
                return f"hangs: not done after {limit:g} s", ""
            finally:
                with suppress(OSError):  # all have ended
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        except OSError as error:
            return f"cannot be started: {error.strerror}", ""
        for stream in (printed, complaint):
            stream.seek(0)
        texts = [stream.read(MOST_WORDS).decode(errors="replace") for stream in (printed, complaint)]
    return (texts[1].strip() or "it gave no reason") if process.returncode else None, texts[0]


def build_library(command: Sequence[str], source: str, library: Path, limit: float = LIMIT) -> None:
    """Compile C source into a sealed library, which appears whole or not at all.

    command : as of `obtain_library`. NoLibrary if the compiler fails, OSError where nothing can be written.
    """
    library.parent.mkdir(0o700, parents=True, exist_ok=True)  # a cache may be cleared at any time
    with temporary_folder(library.parent) as folder:
        text, fresh = folder / "step.c", folder / "step.so"
        text.write_text(source, encoding="utf-8")
        places = {"{source}": str(text), "{library}": str(fresh)}
        complaint, _ = run_compiler([places.get(word, word) for word in command], folder, limit)
        if complaint is None and not (fresh.is_file() and fresh.stat().st_size):
            complaint = "it ended without an error and without a library"
        if complaint is not None:
            raise NoLibrary(f"the C compiler {command[0]} failed ({complaint.splitlines()[0]})")
        with fresh.open("ab") as stream:
            stream.write(_library_seal(fresh.read_bytes(), library.name))
        fresh.chmod(0o700)
        os.replace(fresh, library)


def load_library(library: Path) -> Any:
    """Function `run` of a library that `build_library` made; OSError for one that is not there, not whole or another's.

    The file is read and compared with its seal before the system maps it: one that is truncated would end the process.
    """
    _check_owner(library)
    content = library.read_bytes()
    if content[-32:] != _library_seal(content[:-32], library.name):
        raise OSError(f"{library} is damaged")
    run = ctypes.CDLL(str(library)).run
    run.restype = None
    return run


def _library_seal(content: bytes, name: str) -> bytes:
    return hashlib.sha256(content + name.encode()).digest()


def _check_owner(place: Path) -> None:
    """OSError for a file that may be the work of another user.

    The file and its folder must belong to this user and be writable by no other. The folders above must belong to this
    user or the system, and may be open to others only where nobody can rename what is another's (as in /tmp).
    """
    entry, user = os.lstat(place), os.geteuid()
    if not stat.S_ISREG(entry.st_mode):
        raise OSError(f"{place} is no file")
    trusted = {0, user, os.stat("/").st_uid}
    for part in (place, place.parent, *place.parent.resolve().parents):
        status, own = os.stat(part), part in (place, place.parent)
        if status.st_uid not in ({user} if own else trusted):
            raise OSError(f"{part} belongs to another user")
        if status.st_mode & (0o022 if own else 0o002) and (own or not status.st_mode & stat.S_ISVTX):
            raise OSError(f"{part} can be written by other users")
