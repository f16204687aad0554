"""Faults of a folder of results, for `shipid study check`."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from shipid.files import TEMPORARY, read_json
from shipid.study import claims, seals, store
from shipid.study.seals import Fault

WORDS = {
    "missing": "missing: `shipid study resume` computes it again",
    "damaged": "damaged: `shipid study resume` computes it again",
    "edited": "changed after it was written: put it back, or delete it and resume",
}


@dataclass(frozen=True)
class Checked:
    """Result of a check: lines for people, and the files that are not as they were written."""

    lines: list[str]
    faults: list[Fault]


def check_folder(folder: Path) -> Checked:
    """Check the files of a run's folder against their digests.

    Raises ResultError if it is not the folder of a run, or if its study, vessels or provenance were edited.
    """
    plan = store.stored_plan(folder)
    faults = seals.faults(folder)
    lines = [f"{folder / fault.file}: {WORDS[fault.kind]}" for fault in faults]
    done = sum(len(unit.pairs) for unit in store.finished(folder, plan.units))
    lines.append(f"{done} of {plan.cells} cells finished, {len(faults)} faults")
    if held := claims.held(folder):
        lines.append(f"at work, or ended without giving back: {', '.join(held)}")
    left = [place for place in folder.rglob(f"{TEMPORARY}*") if place.is_dir()]
    if left:
        lines.append(f"{len(left)} temporary folders of runs that were killed: the next run removes them")
    sessions = read_json(folder / store.PROVENANCE).get("sessions", [])
    for before, after in pairwise(sessions):
        lines.append(f"computed in parts: {'; '.join(store.differences(before, after))}")
    return Checked(lines, faults)
