"""Faults of a folder of results, for `shipid study check`."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from shipid.files import TEMPORARY
from shipid.study import claims, seals, store
from shipid.study.plan import Plan
from shipid.study.seals import Fault
from shipid.units import plural

WORDS = {
    "missing": "missing: `shipid study resume` computes it again",
    "damaged": "damaged: `shipid study resume` computes it again",
    "edited": "changed after it was written: put it back, or delete it and resume",
    "foreign": "is of another study: delete it and {}, and resume",
    "unreadable": "cannot be read ({}): let this user read it, or delete it and resume",
}


@dataclass(frozen=True)
class Checked:
    """Result of a check: lines for people, and the files that are not as they were written."""

    lines: list[str]
    faults: list[Fault]


def check_folder(folder: Path) -> Checked:
    """Check the files of a run's folder against their digests, those of all its parts included.

    Raises ResultError if it is not the folder of a run, or if its study, vessels or provenance were edited. Of a study
    that this shipid does not take the files are checked, and a line says why nothing else is.
    """
    try:
        plan = store.stored_plan(folder)
    except store.NotTaken as error:
        faults = [_faults(place) for place in (folder, *sorted((folder / store.PARTS).glob("*/")))]
        every = [fault for _, found in faults for fault in found]
        counted = f"{len(every)} {plural(len(every), 'fault')}; how far the run is cannot be said: {error}"
        return Checked([*(line for lines, _ in faults for line in lines), counted], every)
    parts = {name: part.plan for name, part in plan.parts.items() if store.part_folder(folder, name).is_dir()}
    checked = [_checked(store.check_part(folder, name, part), part, name) for name, part in parts.items()]
    checked.append(_checked(folder, plan))
    lines = [line for one in checked for line in one.lines]
    if plan.parts:
        lines += [f"{name}: not begun" for name in plan.parts if name not in parts]
    return Checked(lines, [fault for one in checked for fault in one.faults])


def _faults(folder: Path) -> tuple[list[str], list[Fault]]:
    """Files of one folder that are not as they were written, with a line each."""
    faults = seals.faults(folder)
    return [f"{folder / fault.file}: {WORDS[fault.kind].format(fault.reason)}" for fault in faults], faults


def _checked(folder: Path, plan: Plan, part: str = "") -> Checked:
    """Check one folder of cells; `part` is its name in a study of several parts."""
    if part:
        store.stored_plan(folder)  # says what was edited
    lines, faults = _faults(folder)
    if plan.parts:
        return Checked(lines, faults)
    done = sum(len(unit.pairs) for unit in store.finished(folder, plan.units))
    counted = f"{done} of {plan.cells} cells finished, {len(faults)} {plural(len(faults), 'fault')}"
    lines.append(f"{part}: {counted}" if part else counted)
    keys = {unit.key for unit in plan.units}
    if held := [name for name in claims.held(folder) if name in keys]:  # other claims are no work of a user's
        lines.append(f"at work, or ended without giving back: {', '.join(held)}")
    left = [place for place in folder.rglob(f"{TEMPORARY}*") if place.is_dir()]
    if left:
        folders = f"{len(left)} {plural(len(left), 'temporary folder')}"
        lines.append(f"{folders} of killed runs: the next run removes {plural(len(left), 'it', 'them')}")
    sessions = store.provenance(folder).get("sessions", [])
    for before, after in pairwise(sessions):
        lines.append(f"computed in parts: {'; '.join(store.differences(before, after))}")
    return Checked(lines, faults)
