"""How far the searches of a run are, read from its journals while others write them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
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


@dataclass(frozen=True)
class Watch:
    """The journals in the folder of a run, or of its parts; the plan says how many trials a method makes."""

    plan: Plan
    folder: Path

    def look(self) -> list[SearchProgress]:
        """Return the searches that go on, those that were written to last first; none of units that are finished."""
        plans = {part_folder(self.folder, name): part.plan for name, part in self.plan.parts.items()}
        left: list[tuple[float, list[SearchProgress]]] = []
        for folder, plan in (plans or {self.folder: self.plan}).items():
            counts = {way.name: way.method.num_trials() for way in plan.methods if way.method.compensates}
            finished = seals.seal_names(folder)
            for file in (folder / JOURNALS).glob("*.log"):
                with suppress(OSError):  # taken away
                    if file.stem not in finished:
                        left.append((file.stat().st_mtime, _searches_of_journal(file.read_bytes(), counts)))
        newest = sorted(left, key=lambda pair: -pair[0])
        return [one for _, searches in newest for one in searches if one.done != one.count]


def _searches_of_journal(content: bytes, counts: Mapping[str, int | None]) -> list[SearchProgress]:
    """The searches of a journal, those that were written to last first. counts : method -> trials of a search."""
    cells: list[str] = []
    known: dict[str, SearchProgress] = {}
    for line in content.splitlines():
        try:
            entry = json.loads(line)
            if entry["op_code"] == BEGUN:
                cells.append(entry["study_name"])
            elif entry["op_code"] in (COUNTED, TRIED):
                cell, count, value = (
                    cells[entry["study_id"]],
                    entry.get("user_attr", {}).get("trials"),
                    entry.get("value"),
                )
                method = next((name for name in counts if f"{WITH}{name}-N" in cell), "")
                one = known.pop(cell, None) or SearchProgress(cell, 0, counts.get(method), inf)
                if entry["op_code"] == TRIED:
                    one = replace(one, done=one.done + 1, best=min(one.best, inf if value is None else value))
                known[cell] = replace(one, count=count or one.count)
        except (ValueError, KeyError, IndexError, TypeError, AttributeError):
            continue  # half a line, or an entry of someone else
    return [*reversed(known.values())]
