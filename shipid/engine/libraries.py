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


def build_library(command: Sequence[str], source: str, library: Path, limit: float = LIMIT) -> str | None:
    """Compile C source into a sealed library, which appears whole or not at all; the complaint if that fails.

    command : compiler and options, with `{source}` and `{library}` where the names of the files belong.
    """
    try:
        library.parent.mkdir(0o700, parents=True, exist_ok=True)  # a cache may be cleared at any time
        with temporary_folder(library.parent) as folder:
            text, fresh = folder / "step.c", folder / "step.so"
            text.write_text(source, encoding="utf-8")
            places = {"{source}": str(text), "{library}": str(fresh)}
            complaint, _ = run_compiler([places.get(word, word) for word in command], folder, limit)
            if complaint is not None:
                return complaint
            if not fresh.is_file() or not fresh.stat().st_size:
                return "it ended without an error and without a library"
            with fresh.open("ab") as stream:
                stream.write(_library_seal(fresh.read_bytes(), library.name))
            fresh.chmod(0o700)
            os.replace(fresh, library)
    except OSError as error:
        return f"{error.strerror or error}"
    return None


def load_library(library: Path) -> Any:
    """Function `run` of a library that `build_library` made; FileNotFoundError without one, NoLibrary if unloadable.

    The file is read and compared with its seal before the system maps it: one that is truncated would end the process.
    """
    reason = foreign_owner_words(library)
    if reason is None:
        content = library.read_bytes()
        whole = content[-32:] == _library_seal(content[:-32], library.name)
        reason = None if whole else f"{library} is damaged"
    if reason is not None:
        raise NoLibrary(reason)
    try:
        run = ctypes.CDLL(str(library)).run
    except (OSError, AttributeError) as error:
        raise NoLibrary(f"{library} cannot be loaded ({str(error).rpartition(': ')[2]})") from None
    run.restype = None
    return run


def _library_seal(content: bytes, name: str) -> bytes:
    return hashlib.sha256(content + name.encode()).digest()


def foreign_owner_words(place: Path) -> str | None:
    """Why a file may be the work of another user, in words; None if only this user or the system can have written it.

    The file and its folder must belong to this user and be writable by no other. The folders above must belong to this
    user or the system, and may be open to others only where nobody can rename what is another's (as in /tmp).
    FileNotFoundError if there is no such file.
    """
    entry, user = os.lstat(place), os.geteuid()
    if not stat.S_ISREG(entry.st_mode):
        return f"{place} is no file"
    trusted = {0, user, os.stat("/").st_uid}
    for part in (place, place.parent, *place.parent.resolve().parents):
        status, own = os.stat(part), part in (place, place.parent)
        if status.st_uid not in ({user} if own else trusted):
            return f"{part} belongs to another user"
        if status.st_mode & (0o022 if own else 0o002) and (own or not status.st_mode & stat.S_ISVTX):
            return f"{part} can be written by other users"
    return None


@cache
def library_folder(wanted: str, probe: bytes) -> Path | None:
    """Folder of libraries: `shipid` in the wanted one, else a temporary one of this process; None if neither serves.

    A folder serves if only this user can write there, and if a library written there can be loaded.

    probe : content of a compiled library, to try it.
    """
    reasons: list[str] = []
    for kept in (Path(wanted) / "shipid", None):
        try:
            if kept is None:
                temporary = tempfile.TemporaryDirectory(prefix="shipid-")
                atexit.register(temporary.cleanup)
            place = kept or Path(temporary.name)
            place.mkdir(0o700, parents=True, exist_ok=True)
            with temporary_folder(place) as inside:
                trial = inside / "probe.so"
                trial.write_bytes(probe)
                trial.chmod(0o700)
                reason = foreign_owner_words(trial)
                if reason is None:
                    ctypes.CDLL(str(trial))
        except OSError as error:
            words = error.strerror or str(error).rpartition(": ")[2]
            reason = f"{wanted}: {words}" if kept else f"a temporary folder: {words}: set TMPDIR to one that serves"
        if reason is None:
            if reasons:
                log.warning("compiled equations are not kept for the next run: %s", escape_unprintable(reasons[0]))
            return place
        reasons.append(reason)
    log.warning("engine 'native' is not used, others are slower: %s", escape_unprintable(reasons[-1]))
    return None
