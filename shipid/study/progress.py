"""How far the searches of a run are, read from its journals while others write them."""

from __future__ import annotations

import json
from contextlib import suppress
from math import inf
from pathlib import Path

from shipid.study import seals
from shipid.study.plan import WITH, Plan
from shipid.study.store import JOURNALS, part_folder

BEGUN, COUNTED, TRIED = 0, 2, 4  # entries of Optuna's journal: a study, an attribute of it, a trial that ended


def search_words(plan: Plan, folder: Path) -> str:
    """The search of a run, or of its parts, that was written to last, in a few words; empty where there is none."""
    places = [part_folder(folder, name) for name in plan.parts] or [folder]
    journals = [
        file for place in places for file in (place / JOURNALS).glob("*.log") if not seals.is_sealed(place, file.stem)
    ]
    with suppress(OSError, ValueError):  # taken away, or there is none
        return _words_of_journal(plan, max(journals, key=lambda file: file.stat().st_mtime))
    return ""


def _words_of_journal(plan: Plan, file: Path) -> str:
    """Cell, number of the trial and best value [m rms] of the last search of a journal."""
    cells, cell = [], ""
    counts: dict[str, int | None] = {}
    values: dict[str, list[float]] = {}
    for line in file.read_bytes().splitlines():
        with suppress(ValueError, KeyError, IndexError, TypeError, AttributeError):  # half a line, or of someone else
            entry = json.loads(line)
            if entry["op_code"] == BEGUN:
                cells.append(entry["study_name"])
            elif entry["op_code"] == COUNTED and "trials" in entry["user_attr"]:
                counts[cells[entry["study_id"]]] = entry["user_attr"]["trials"]
            elif entry["op_code"] == TRIED:
                cell = cells[entry["study_id"]]
                values.setdefault(cell, []).append(inf if entry["value"] is None else entry["value"])
    if not cell:
        return ""
    planned = next((way.method.num_trials() for way in plan.methods if f"{WITH}{way.name}-N" in cell), None)
    count, best = counts.get(cell, planned), min(values[cell])
    of, reached = f"/{count}" if count else "", f", best so far {best**0.5:.3g} m rms" if best < inf else ""
    return f"{cell}: trial {len(values[cell])}{of}{reached}"
