"""How far the searches of a run are, read from its journals while others write them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path

from shipid.study.plan import WITH, Plan
from shipid.study.store import JOURNALS, part_folder

BEGUN, COUNTED, TRIED = 0, 2, 4  # entries of Optuna's journal: a study, an attribute of it, a trial that ended


@dataclass(frozen=True)
class Searching:
    """A search that goes on: its cell, how many trials have ended, how many there will be, and the best value [m^2].

    count : None where a budget has not yet been turned into a number. best : inf where no trial has a value.
    """

    cell: str
    done: int
    count: int | None
    best: float

    @property
    def words(self) -> str:
        """The search in a few words."""
        of = f"/{self.count}" if self.count else ""
        best = f", best so far {self.best**0.5:.3g} m rms" if isfinite(self.best) else ""
        return f"{self.cell}: trial {self.done}{of}{best}"


class Watch:
    """Follows the journals in the folder of a run; each look reads what has been written since the last one.

    Parameters
    ----------
    plan : says how many trials a method makes. folder : of the run; its parts are followed, too.
    """

    def __init__(self, plan: Plan, folder: Path) -> None:
        plans = {part_folder(folder, name): part.plan for name, part in plan.parts.items()} or {folder: plan}
        self._trials = {
            place: {way.name: getattr(way.method, "trials", None) for way in one.methods if way.method.compensates}
            for place, one in plans.items()
        }
        self._ends: dict[Path, int] = {}
        self._cells: dict[Path, list[str]] = {}
        self._found: dict[str, Searching] = {}
        self._last: dict[str, int] = {}
        self._looks = 0

    def look(self, done: Iterable[str] = ()) -> list[Searching]:
        """Return the searches that go on, those that were written to last first; without cells that are done."""
        self._looks += 1
        for folder, trials in self._trials.items():
            for file in (folder / JOURNALS).glob("*.log"):
                self._read(file, trials)
        finished = set(done)
        left = [one for cell, one in self._found.items() if cell not in finished and one.done != one.count]
        return sorted(left, key=lambda one: -self._last[one.cell])

    def _read(self, file: Path, trials: Mapping[str, int | None]) -> None:
        """Take over the whole lines that have been added to a journal."""
        begin = self._ends.get(file, 0)
        try:
            with file.open("rb") as stream:
                stream.seek(begin)
                text = stream.read()
        except OSError:  # taken away
            return
        text = text[: text.rfind(b"\n") + 1]
        self._ends[file] = begin + len(text)
        cells = self._cells.setdefault(file, [])
        for line in text.splitlines():
            try:
                entry = json.loads(line)
                code = entry["op_code"]
                if code == BEGUN:
                    cells.append(entry["study_name"])
                elif code == COUNTED and "trials" in entry["user_attr"]:
                    self._count(cells[entry["study_id"]], entry["user_attr"]["trials"], trials)
                elif code == TRIED:
                    self._tried(cells[entry["study_id"]], entry.get("value"), trials)
            except (ValueError, KeyError, IndexError, TypeError):
                continue  # half a line, or an entry of someone else

    def _known(self, cell: str, trials: Mapping[str, int | None]) -> Searching:
        method = next((name for name in trials if f"{WITH}{name}-N" in cell), "")
        return self._found.get(cell) or Searching(cell, 0, trials.get(method), inf)

    def _count(self, cell: str, count: int, trials: Mapping[str, int | None]) -> None:
        known = self._known(cell, trials)
        self._found[cell] = Searching(cell, known.done, count, known.best)
        self._last[cell] = self._looks

    def _tried(self, cell: str, value: float | None, trials: Mapping[str, int | None]) -> None:
        known = self._known(cell, trials)
        best = min(known.best, inf if value is None else value)
        self._found[cell] = Searching(cell, known.done + 1, known.count, best)
        self._last[cell] = self._looks
