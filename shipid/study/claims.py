"""Claims on units of work, so that any number of processes may work on one plan in one folder.

A claim is a file that says who works: host, owner, process and since when. All claims of a process are links to one
file, whose time is renewed while the process lives. A claim that is no longer renewed, or whose process is gone, is
taken over. A process that was only held up, and so has lost a claim, sees that before it writes anything more.
"""

from __future__ import annotations

import getpass
import json
import math
import os
import random
import secrets
import socket
import threading
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from shipid.errors import ShipidError
from shipid.files import is_alive, make_folder

FOLDER = "claims"
RENEWED, LATE = 10.0, 60.0  # s: how often a claim is renewed, and after how long without it may be taken over
WAIT, LONGEST_WAIT = 1.0, 15.0  # s between looks at what others finish: it grows
SHORT_WAIT = 0.05  # s, for what takes others a moment
MISSED = 8  # claims that are refused until the folder is listed anew
SHARE = 50  # or one in so many units: a listing costs about as much as a hundred refusals among 10,000


class TakenOver(ShipidError):
    """A claim that this process has lost: it was held up for so long that another one works on the unit."""


@dataclass(frozen=True)
class Holder:
    """A process with claims in a folder, known to its workers by the words of its claims."""

    folder: Path
    words: str

    def check(self, unit: str) -> None:
        """Raise TakenOver unless the claim on a unit is this process's."""
        try:
            words = (self.folder / FOLDER / unit).read_text(encoding="utf-8", errors="replace")
        except FileNotFoundError:
            raise TakenOver("no longer claimed: another process has taken it over and ended", path=unit) from None
        except OSError:  # a file server that is slow to answer: as long as it says nothing else
            return
        if words == self.words:
            return
        with suppress(ValueError, KeyError, TypeError):
            other = json.loads(words)
            who = f"process {other['process']} on {other['host']}"
            raise TakenOver(f"{who} has taken it over, since this one was held up: left to it", path=unit)
        raise TakenOver("another process has taken it over, since this one was held up: left to it", path=unit)


class UnitClaims:
    """Claims of one process on units of work in a folder.

    Safe against other processes on this machine and on others that share the folder. Use it in `with`: claims are
    renewed by a thread, and given back at the end.
    """

    def __init__(self, folder: Path) -> None:
        self._root, self._folder = folder, folder / FOLDER
        self._me = self._folder / f".{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}"
        self._mine: set[str] = set()
        self._apart: set[str] = set()  # claims that are no links
        self._seen: dict[tuple[int, int], float] = {}  # file and its time, which says nothing -> when it was first seen
        self._clock: float | None = None  # time of the file system less that of a clock that nobody sets
        self._set = -math.inf  # when, by the latter, the former was last set forward
        self._lock, self._stop = threading.RLock(), threading.Event()
        since = datetime.now(UTC).isoformat(timespec="seconds")
        owner = {"host": socket.gethostname(), "owner": _user(), "process": os.getpid(), "since": since}
        self._words = json.dumps({**owner, "system": _system(), "key": self._me.name}) + "\n"
        self.holder = Holder(folder.absolute(), self._words)

    def __enter__(self) -> UnitClaims:
        self._sign_in()
        self._renew_all()
        threading.Thread(target=self._renew, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        with self._lock:
            for unit in list(self._mine):
                with suppress(OSError):
                    self.give_back(unit)
            with suppress(OSError):
                files = list(self._folder.iterdir())  # before the look at others: one that joins now keeps its claims
                if not self._others():  # what killed processes left behind is removed by the last one
                    for file in files:
                        file.unlink(missing_ok=True)
            with suppress(OSError):
                self._me.unlink(missing_ok=True)
                self._folder.rmdir()  # fails while others are at work

    def take(self, unit: str) -> bool:
        """Claim a unit of work; False if another process, or this one, is at work on it."""
        file = self._file(unit)
        with self._lock:
            if unit in self._mine or not (self._made(file) or (self._taken_away(file) and self._made(file))):
                return False
            self._mine.add(unit)
        return True

    def give_back(self, unit: str) -> None:
        """End the claim on a unit."""
        file = self._file(unit)
        with self._lock:
            if unit in self._mine and self._is_mine(file):
                file.unlink(missing_ok=True)
            self._mine.discard(unit)
            self._apart.discard(unit)

    def free(
        self, units: Sequence[str], finished: Callable[[], Collection[str]], is_finished: Callable[[str], bool]
    ) -> Iterator[str]:
        """Units that are not finished and that nobody works on, about in their order, claimed when taken from here.

        finished, is_finished : which units are finished, and whether one is; others finish more all the time.
        """
        left = list(units)
        while True:
            done, claimed = finished(), set(held(self._root))
            left = [unit for unit in left if unit not in done]
            free = [unit for unit in left if unit not in claimed]
            if not free:
                break
            reach, missed = 1, 0  # where many take from one list, they move apart
            while free and missed <= max(MISSED, len(units) // SHARE):  # a list is used as long as most of it holds
                unit = free.pop(random.randrange(min(reach, len(free))))
                if self._takes(unit, is_finished):
                    yield unit
                    left.remove(unit)
                    reach = max(1, reach // 2)
                else:
                    reach, missed = 2 * reach, missed + 1
        for unit in left:
            if self._takes(unit, is_finished):  # the claim of a process that is gone
                yield unit

    def _takes(self, unit: str, is_finished: Callable[[str], bool]) -> bool:
        if not self.take(unit):
            return False
        if is_finished(unit):  # by another process, since they were listed
            self.give_back(unit)
            return False
        return True

    def once(self, name: str, is_done: Callable[[], bool], do: Callable[[], object]) -> None:
        """Do what is not done yet, unless another process does it, or has taken it over: then wait for it."""
        wait = SHORT_WAIT
        while not is_done():
            if self.take(name):
                try:
                    if not is_done():
                        do()
                    return
                except TakenOver:
                    pass
                finally:
                    self.give_back(name)
            wait = pause(wait)

    @contextmanager
    def alone(self, name: str) -> Iterator[None]:
        """Keep other processes from what this block does."""
        while not self.take(name):
            pause(SHORT_WAIT)
        try:
            yield
        finally:
            self.give_back(name)

    def others(self) -> bool:
        """Whether other processes are at work in the folder."""
        with self._lock:
            return self._others()

    def _others(self) -> bool:
        return any(self._lives(file) for file in self._folder.glob(".*") if file != self._me)

    def _lives(self, sign: Path) -> bool:
        try:
            return not self._is_abandoned(sign, sign.stat())
        except FileNotFoundError:  # its process has ended since the folder was listed
            return False

    def _sign_in(self) -> None:
        """Write the file of this process, to which its claims are links."""
        while True:
            make_folder(self._folder)  # another process may have removed it when its last claim ended
            with suppress(FileNotFoundError):
                self._write(self._me, "w")
                return

    def _write(self, file: Path, mode: str) -> None:
        """Write the words of this process; on a full disk nothing is left, which others would take for alive.

        A file that is there already stays.
        """
        stream = file.open(mode, encoding="utf-8")
        try:
            with stream:
                stream.write(self._words)
        except OSError as error:
            file.unlink(missing_ok=True)
            error.filename = str(file)
            raise

    def _made(self, file: Path) -> bool:
        """Make the file of a claim; False if it is there already."""
        while True:
            try:
                os.link(self._me, file)
                return True
            except FileExistsError:
                return self._is_mine(file)  # a file server may have lost its answer
            except FileNotFoundError:
                self._sign_in()
            except OSError:  # a file system without links, or with few
                try:
                    make_folder(self._folder)
                    self._write(file, "x")
                except FileExistsError:
                    return False
                self._apart.add(file.name)
                return True

    def _taken_away(self, file: Path) -> bool:
        """Remove the claim of a process that is gone; False if it is not, or if another one has just done so."""
        away = self._folder / f".gone-{self._me.name}"
        try:
            before = file.stat()
            if not self._is_abandoned(file, before):
                return False
            os.rename(file, away)
        except FileNotFoundError:
            return True
        except OSError:
            return False
        try:
            if os.path.samestat(before, away.stat()):
                return True
            with suppress(OSError):
                os.link(away, file)  # it was taken over meanwhile
            return False
        finally:
            away.unlink(missing_ok=True)

    def _is_abandoned(self, file: Path, status: os.stat_result) -> bool:
        """Whether nobody renews a file any more; the clock is that of the file system, as this process renews.

        FileNotFoundError if the file is removed meanwhile.
        """
        try:
            who: Any = json.loads(file.read_text(encoding="utf-8"))
            if who["host"] == socket.gethostname() and who["system"] == _system() and not is_alive(int(who["process"])):
                return True
        except (ValueError, KeyError, TypeError):
            pass
        except FileNotFoundError:
            raise
        except PermissionError:  # of another user, for whom alone it is: its time says the same
            pass
        except OSError:
            return False
        age = self._now() - status.st_mtime
        if abs(age) <= LATE:
            return False
        if age > 0 and time.monotonic() - self._set > LATE:
            return True
        # The clock was set back, or just now forward: a living process renews its file with the time of now.
        first = self._seen.setdefault((status.st_ino, status.st_mtime_ns), time.monotonic())
        return time.monotonic() - first > LATE

    def _now(self) -> float:
        """Time at which this process last renewed its file."""
        while True:
            with suppress(FileNotFoundError):
                return self._me.stat().st_mtime
            self._sign_in()

    def _is_mine(self, file: Path) -> bool:
        try:
            if file.name in self._apart:
                return file.read_text(encoding="utf-8") == self._words
            return os.path.samefile(self._me, file)
        except (OSError, ValueError):
            return False

    def _renew(self) -> None:
        while not self._stop.wait(RENEWED):
            self._renew_all()

    def _renew_all(self) -> None:
        """Give all files of this process the time of now; see whether the clock was set since the last time."""
        with self._lock:
            for file in (self._me, *map(self._file, self._apart)):
                with suppress(OSError):
                    os.utime(file)
            with suppress(OSError):
                clock = self._me.stat().st_mtime - time.monotonic()
                if self._clock is not None and clock - self._clock > RENEWED:
                    self._set = time.monotonic()
                self._clock = clock

    def _file(self, unit: str) -> Path:
        return self._folder / unit


def held(folder: Path) -> list[str]:
    """Units of work that are claimed in a folder, by anyone."""
    try:
        return sorted(entry.name for entry in os.scandir(folder / FOLDER) if not entry.name.startswith("."))
    except FileNotFoundError:
        return []


def pause(seconds: float) -> float:
    """Wait a little for what other processes finish; returns how long to wait next."""
    time.sleep(seconds)
    return min(1.5 * seconds, LONGEST_WAIT)


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):  # a number without a name
        return str(os.getuid()) if hasattr(os, "getuid") else "?"


def _system() -> str:
    """Where numbers of processes mean the same: a start of a machine, and in it a container."""
    words = []
    with suppress(OSError):
        words.append(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8").strip())
    with suppress(OSError):
        words.append(os.readlink("/proc/self/ns/pid"))
    return " ".join(words)
