"""How far the searches of a run are, read from its journals while others write them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf, isfinite
from pathlib import Path

from shipid.study import seals
from shipid.study.plan import WITH, Plan
from shipid.study.store import JOURNALS, part_folder

BEGUN, COUNTED, TRIED = 0, 2, 4  # entries of Optuna's journal: a study, an attribute of it, a trial that ended


@dataclass(frozen=True)
class SearchProgress:
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
            place: {way.name: way.method.num_trials() for way in one.methods if way.method.compensates}
            for place, one in plans.items()
        }
        self._ends: dict[Path, int] = {}
        self._cells: dict[Path, list[str]] = {}
        self._searches: dict[Path, dict[str, SearchProgress]] = {}  # parts of a study have cells of the same names
        self._last: dict[tuple[Path, str], int] = {}
        self._looks = 0

    def look(self) -> list[SearchProgress]:
        """Return the searches that go on, those that were written to last first; none of units that are finished."""
        self._looks += 1
        left: list[tuple[int, SearchProgress]] = []
        for folder, trials in self._trials.items():
            finished = seals.seal_names(folder)
            for file in (folder / JOURNALS).glob("*.log"):
                if file.stem in finished:
                    continue
                self._read(file, trials)
                known = self._searches.get(file, {})
                left += [(self._last[file, one.cell], one) for one in known.values() if one.done != one.count]
        return [one for _, one in sorted(left, key=lambda pair: -pair[0])]

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
                    self._count(file, cells[entry["study_id"]], entry["user_attr"]["trials"], trials)
                elif code == TRIED:
                    self._tried(file, cells[entry["study_id"]], entry.get("value"), trials)
            except (ValueError, KeyError, IndexError, TypeError):
                continue  # half a line, or an entry of someone else

    def _known(self, file: Path, cell: str, trials: Mapping[str, int | None]) -> SearchProgress:
        method = next((name for name in trials if f"{WITH}{name}-N" in cell), "")
        return self._searches.get(file, {}).get(cell) or SearchProgress(cell, 0, trials.get(method), inf)

    def _count(self, file: Path, cell: str, count: int, trials: Mapping[str, int | None]) -> None:
        self._keep(file, replace(self._known(file, cell, trials), count=count))

    def _tried(self, file: Path, cell: str, value: float | None, trials: Mapping[str, int | None]) -> None:
        known = self._known(file, cell, trials)
        self._keep(file, replace(known, done=known.done + 1, best=min(known.best, inf if value is None else value)))

    def _keep(self, file: Path, now: SearchProgress) -> None:
        self._searches.setdefault(file, {})[now.cell] = now
        self._last[file, now.cell] = self._looks
