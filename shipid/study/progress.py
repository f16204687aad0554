"""How far the searches of a run are, read from its journals while others write them."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

from shipid.study import seals
from shipid.study.plan import WITH, Plan
from shipid.study.store import JOURNALS, part_folder

BEGUN, COUNTED, TRIED = 0, 2, 4  # entries of Optuna's journal: a study, an attribute of it, a trial that ended


def search_words(plan: Plan, folder: Path) -> str:
    """Cell and trial of the search of a run, or of its parts, that was written to last; empty where there is none."""
    places = [part_folder(folder, name) for name in plan.parts] or [folder]
    journals = [
        file for place in places for file in (place / JOURNALS).glob("*.log") if not seals.is_sealed(place, file.stem)
    ]
    with suppress(OSError, ValueError, KeyError, IndexError, TypeError):  # taken away, damaged, or there is none
        return _words_of_journal(plan, max(journals, key=lambda file: file.stat().st_mtime))
    return ""


def _words_of_journal(plan: Plan, file: Path) -> str:
    *whole, _ = file.read_bytes().split(b"\n")  # the last line may be half written
    entries = [json.loads(line) for line in whole]
    tried = [entry["study_id"] for entry in entries if entry["op_code"] == TRIED]
    cell = [entry["study_name"] for entry in entries if entry["op_code"] == BEGUN][tried[-1]]
    planned = [way.method.num_trials() for way in plan.methods if f"{WITH}{way.name}-N" in cell]
    noted = [
        entry["user_attr"]["trials"]  # of a budget
        for entry in entries
        if entry["op_code"] == COUNTED and entry["study_id"] == tried[-1] and "trials" in entry["user_attr"]
    ]
    counts = [f"/{count}" for count in (*planned, *noted) if count]
    return f"{cell}: trial {tried.count(tried[-1])}{''.join(counts[-1:])}"
