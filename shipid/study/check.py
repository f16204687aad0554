"""How far a folder of results is, also while others write it, and its faults, for `shipid study check`."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from shipid.hybrid.journal import read_entries
from shipid.study import seals, store
from shipid.study.plan import WITH, Plan
from shipid.study.seals import Fault, has_writer
from shipid.units import plural_word


@dataclass(frozen=True)
class FolderCheck:
    """Result of a check: lines for people, and the files that are not as they were written."""

    lines: list[str]
    faults: list[Fault]


def check_folder(folder: Path) -> FolderCheck:
    """Check the files of a run's folder against their digests, those of all its parts included.

    Raises ResultError if it is not the folder of a run, or if its study, vessels or provenance were edited. Of a study
    that this shipid does not take the files are checked, and a line says why nothing else is.
    """
    lines: list[str] = []
    faults: dict[Path, list[Fault]] = {}
    for place in (*sorted((folder / store.PARTS).glob("*/")), folder):
        faults[place] = seals.sealed_faults(place)
        lines += [f"{place / fault.file}: {fault.words}" for fault in faults[place]]
    every = [fault for found in faults.values() for fault in found]
    try:
        plan = store.stored_plan(folder)
    except store.NotTaken as error:
        return FolderCheck([*lines, f"{_count_words(every)}; how far the run is cannot be said: {error}"], every)
    for name, part in plan.parts.items():
        place = store.check_part(folder, name, part.plan)
        lines += _state(place, part.plan, faults[place], f"{name}: ") if place in faults else [f"{name}: not begun"]
    return FolderCheck([*lines, *_state(folder, plan, faults[folder])], every)


def _count_words(faults: list[Fault]) -> str:
    return f"{len(faults)} {plural_word(len(faults), 'fault')}"


def _state(folder: Path, plan: Plan, faults: list[Fault], name: str = "") -> list[str]:
    """Lines on how far one folder is, who works in it, and by what it was computed."""
    store.stored_plan(folder)  # reports what was edited
    done = sum(len(unit.pairs) for unit in store.finished_units(folder, plan.units))
    lines = [] if plan.parts else [f"{name}{done} of {plan.cells} cells finished, {_count_words(faults)}"]
    if has_writer(folder):
        lines.append(f"{name}a process works in it")
    for before, after in pairwise(store.provenance(folder).get("sessions", [])):
        lines.append(f"{name}computed in parts: {'; '.join(store.differences(before, after))}")
    return lines


def search_words(plan: Plan, folder: Path) -> str:
    """Cell and trial of the search of a run, or of its parts, that was written to last; empty where there is none."""
    places = [store.part_folder(folder, name) for name in plan.parts] or [folder]
    journals = [
        file
        for place in places
        for file in (place / store.JOURNALS).glob("*.log")
        if not seals.is_sealed(place, file.stem)
    ]
    with suppress(OSError, ValueError, KeyError, IndexError, TypeError):  # taken away, damaged, or there is none
        return _words_of_journal(plan, max(journals, key=lambda file: file.stat().st_mtime))
    return ""


def _words_of_journal(plan: Plan, file: Path) -> str:
    entries = read_entries(file.read_bytes())
    tried = [name for _, name, entry in entries if isinstance(entry, dict)]
    planned = [way.method.num_trials() for way in plan.methods if f"{WITH}{way.name}-N" in tried[-1]]
    noted = [entry for _, name, entry in entries if name == tried[-1] and isinstance(entry, int)]  # of a budget
    counts = [f"/{count}" for count in (*planned, *noted) if count]
    return f"{tried[-1]}: trial {tried.count(tried[-1])}{''.join(counts[-1:])}"
