"""The search of a method: which trials are left, how many fit into a budget, and what has been tried before.

Trials are numbered, and whatever is random in one is seeded by its number. So a search that was interrupted goes on
from its journal and gives the digits of one that was not. A budget becomes a number of trials by the time of the first
ones; the number is written down before it is used, and read back.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from statistics import fmean
from typing import TypeVar

from shipid.hybrid.method import Row, Task
from shipid.hybrid.settings import Searched

Point = TypeVar("Point")
TIMED = 4  # first trials from whose time the number of all follows; `choose` takes three kinds of memory in turn
TOGETHER = 5.0  # s for which quick trials are kept, to be written together
CLOSING = 1  # trials that the last fit costs, about


def affordable(budget: float, before: float, seconds: Sequence[float], closing: int = CLOSING) -> int | None:
    """How many trials fit into a budget; None before enough have been timed, or half of the budget is gone.

    Parameters
    ----------
    budget : core-seconds for everything [s].
    before : what the search has cost before its first trial [s].
    seconds : of the trials so far [s]; the first one also warms up, so the others tell the price.
    closing : trials that what follows the search costs, about.
    """
    if not seconds or (len(seconds) < TIMED and before + sum(seconds) < budget / 2):
        return None
    price = max(fmean(seconds[1:] or seconds), 1e-6)
    return max(len(seconds), int((budget - before) / price) - closing)


class Search:
    """The trials of one or several foundations that go trial by trial together.

    Parameters
    ----------
    task, method : what is searched.
    names : the foundations.
    closing : as in `affordable`.
    again : each trial needs what the one before left behind, so nothing is taken over from an interrupted search but
        its number of trials; the digits are the same.

    Attributes
    ----------
    rows : foundation -> its trials so far, those of an interrupted search first.
    """

    def __init__(
        self, task: Task, names: Iterable[str], method: Searched, *, again: bool = False, closing: int = CLOSING
    ) -> None:
        self.begun, self.closing = time.process_time(), closing
        self.method, self.journal = method, task.journal
        self.cells = {name: task.cells.get(name, name) for name in names}
        self.rows: dict[str, list[Row]] = {name: [] for name in self.cells}
        self.written = dict.fromkeys(self.cells, 0)
        self.count = method.num_trials()
        self.before: float | None = None
        self._earlier = 0.0
        self._wrote = time.monotonic()
        if self.journal is None:
            return
        known = {name: self.journal.rows(cell) for name, cell in self.cells.items()}
        self.written = {name: len(rows) for name, rows in known.items()}
        if method.budget:
            self.count = next(filter(None, map(self.journal.count, self.cells.values())), None)
        if not again:
            done = min(self.written.values(), default=0)
            self.rows = {name: rows[:done] for name, rows in known.items()}
            self._earlier = sum(row["seconds"] for rows in self.rows.values() for row in rows)

    @property
    def done(self) -> int:
        """Number of trials that have ended for every foundation."""
        return min(map(len, self.rows.values()), default=0)

    @property
    def seconds(self) -> float:
        """Core-seconds [s] of the search so far, those of an interrupted one included, for all foundations."""
        return time.process_time() - self.begun + self._earlier

    def left(self, points: Iterable[Point]) -> Iterator[tuple[int, Point]]:
        """Number and point of each trial that has not been made; its rows must be recorded before the next."""
        for number, point in enumerate(points):
            if self.count is not None and number >= self.count:
                return
            if number >= self.done:
                if self.before is None:
                    self.before = time.process_time() - self.begun
                yield number, point
            if self.count is None:
                self._decide(number + 1)

    def record(self, rows: Mapping[str, Row]) -> None:
        """Keep a trial of every foundation, and write it to the journal."""
        self.keep(rows)
        self.write()

    def keep(self, rows: Mapping[str, Row]) -> None:
        """Keep a trial of every foundation; written with others, at most so often that a search can be followed."""
        for name, row in rows.items():
            self.rows[name].append(row)
        if time.monotonic() - self._wrote > TOGETHER:
            self.write()

    def write(self) -> None:
        """Write what is kept and not in the journal yet, all at once."""
        self._wrote = time.monotonic()
        if self.journal is None:
            return
        new = {name: rows[self.written[name] :] for name, rows in self.rows.items()}
        self.written = {name: max(self.written[name], len(rows)) for name, rows in self.rows.items()}
        if any(new.values()):
            self.journal.add({self.cells[name]: rows for name, rows in new.items()}, self.method.space())

    def _decide(self, done: int) -> None:
        """Turn the budget into a number of trials, as soon as enough are timed, and write it down."""
        assert self.method.budget is not None
        seconds = [sum(rows[k]["seconds"] for rows in self.rows.values()) for k in range(done)]
        before = time.process_time() - self.begun if self.before is None else self.before
        self.count = affordable(self.method.budget * len(self.rows), before, seconds, self.closing)
        if self.count is not None and self.journal is not None:
            self.journal.decide(list(self.cells.values()), self.count)
