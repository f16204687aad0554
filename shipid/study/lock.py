"""One writer of a folder: a lock of the operating system, which ends with its process, whatever ends that."""

from __future__ import annotations

import errno
import logging
from collections.abc import Iterator
from contextlib import contextmanager
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

    Raises ResultError where another process is in the folder.
    """
    lock = FileLock(folder / f".{name}.lock", blocking=wait, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout:
        raise ResultError("another process works in it: wait until it has ended, or end it", file=folder) from None
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        log.warning("%s is on a file system without locks: let one process at a time work in it", folder)
    try:
        yield
    finally:
        lock.release()


def has_writer(folder: Path) -> bool:
    """Whether a process works in a folder; False where the folder cannot be locked, such as one that is read only."""
    try:
        with FileLock(folder / f".{WRITER}.lock", blocking=False, fallback_to_soft=False):
            return False
    except Timeout:
        return True
    except OSError:
        return False
