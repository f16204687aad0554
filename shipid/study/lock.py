"""One writer of a folder: a lock of the operating system, which ends with its process, whatever ends that."""

from __future__ import annotations

import errno
import logging
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from filelock import FileLock, Timeout

from shipid.errors import ResultError

WRITER, PAGES = "writer", "pages"  # locks: on all that a run computes, and on its tables and pages
NO_LOCKS = (errno.ENOSYS, errno.ENOTSUP, errno.ENOLCK)  # what a file system says that has none

log = logging.getLogger(__name__)


@contextmanager
def sole_writer(folder: Path, name: str = WRITER, *, wait: bool = False) -> Iterator[None]:
    """Keep other processes out of a folder, or wait until they have left it.

    Where the file system has no locks there is a warning, and nobody is kept out.

    Raises ResultError, with the process, its host and since when it works, where another one is in the folder.
    """
    lock = FileLock(folder / f".{name}.lock", blocking=wait, fallback_to_soft=False)
    holder = folder / f".{name}.txt"
    try:
        lock.acquire()
    except Timeout:
        message = f"{_holder_words(holder)} works in it: wait until it has ended, or end it"
        raise ResultError(message, file=folder) from None
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        log.warning("%s is on a file system without locks: let one process at a time work in it", folder)
    try:
        with suppress(OSError):  # only to say who it is
            since = datetime.now(UTC).isoformat(timespec="seconds")
            holder.write_text(f"process {os.getpid()} on {socket.gethostname()}, since {since},", encoding="utf-8")
        yield
    finally:
        holder.unlink(missing_ok=True)
        lock.release()


def current_writer(folder: Path) -> str:
    """The process that works in a folder, in words; empty if there is none, or where the folder cannot be locked."""
    try:
        with FileLock(folder / f".{WRITER}.lock", blocking=False, fallback_to_soft=False):
            return ""
    except Timeout:
        return _holder_words(folder / f".{WRITER}.txt")
    except OSError:  # a folder that this user may only read
        return ""


def _holder_words(holder: Path) -> str:
    try:
        return holder.read_text(encoding="utf-8", errors="replace") or "another process"
    except OSError:
        return "another process"
