"""Claims on units of work, so that several runs of one plan may share a folder.

A claim is a file that says who works, renewed while they do. One that is no longer renewed, or whose process is gone,
is taken over. If two take it over at the same moment both compute the unit: they write the same numbers.
"""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from shipid.files import is_alive, make_folder, temporary_folder

FOLDER = "claims"
RENEWED, LATE = 10.0, 60.0  # s: how often a claim is renewed, and after how long without it may be taken over
WAIT = 1.0  # s between looks at what others finish


class Claims:
    """Claims of one run on units of work in a folder.

    Safe against other processes on this machine and on others that share the folder. Use it in `with`: claims are
    renewed by a thread, and given back at the end.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER
        self._mine: set[str] = set()
        self._lock, self._stop = threading.Lock(), threading.Event()
        self._words = f"{socket.gethostname()} {os.getpid()}\n"

    def __enter__(self) -> Claims:
        make_folder(self._folder)
        threading.Thread(target=self._renew, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        with self._lock:
            for unit in self._mine:
                with suppress(OSError):
                    self._file(unit).unlink(missing_ok=True)
            self._mine.clear()
        for file in self._folder.glob("*"):  # of runs that were killed when a unit was finished already
            if self._is_abandoned(file):
                with suppress(OSError):
                    file.unlink(missing_ok=True)
        with suppress(OSError):
            self._folder.rmdir()  # fails while others have claims

    def take(self, unit: str) -> bool:
        """Claim a unit of work; False if another run is at work on it."""
        file = self._file(unit)
        with self._lock:
            if not self._made(file):
                if not self._is_abandoned(file):
                    return False
                with suppress(OSError):
                    file.unlink()
                if not self._made(file):
                    return False
            self._mine.add(unit)
        return True

    def give_back(self, unit: str) -> None:
        """End the claim on a unit."""
        with self._lock:
            self._mine.discard(unit)
            self._file(unit).unlink(missing_ok=True)

    def _made(self, file: Path) -> bool:
        """Make the file of a claim with its words at once; False if it is there already."""
        make_folder(self._folder)  # another run may have removed it when its last claim ended
        with temporary_folder(self._folder.parent) as folder:
            fresh = folder / file.name
            fresh.write_text(self._words, encoding="utf-8")
            try:
                os.link(fresh, file)
            except FileExistsError:
                return False
            except FileNotFoundError:
                return self._made(file)
            except OSError:  # a file system without links
                try:
                    with file.open("x", encoding="utf-8") as stream:
                        stream.write(self._words)
                except FileExistsError:
                    return False
        return True

    def _is_abandoned(self, file: Path) -> bool:
        """Whether nobody renews a claim any more; the clock is that of the file system."""
        try:
            words, renewed = file.read_text(encoding="utf-8").split(), file.stat().st_mtime
            if len(words) == 2 and words[0] == socket.gethostname() and words[1].isdecimal():
                process = int(words[1])
                if not is_alive(process):
                    return True
            with temporary_folder(self._folder.parent) as folder:
                return folder.stat().st_mtime - renewed > LATE
        except FileNotFoundError:
            return True
        except (OSError, ValueError):
            return False

    def _renew(self) -> None:
        while not self._stop.wait(RENEWED):
            with self._lock:
                for unit in self._mine:
                    with suppress(OSError):
                        os.utime(self._file(unit))

    def _file(self, unit: str) -> Path:
        return self._folder / unit


def held(folder: Path) -> Sequence[str]:
    """Units of work that are claimed in a folder, by anyone."""
    return sorted(file.name for file in (folder / FOLDER).glob("*"))


def pause() -> None:
    """Wait a little for what other runs finish."""
    time.sleep(WAIT)
