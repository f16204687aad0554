"""Run a study from its name or path to its report: the words of the command line, as functions."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from shipid.answer.pages import write_pages
from shipid.arguments import as_path
from shipid.errors import ShipidError
from shipid.study.plan import default_folder, read_plan
from shipid.study.results import Results, read_results
from shipid.study.run import Event, run_study
from shipid.units import length_decimals

log = logging.getLogger(__name__)


def run(
    study: str | Path,
    set: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
    *,
    scheduler: str | None = None,
    device: str = "cpu",
    trust: bool = False,
) -> Results:
    """Run a study to its end, write its report, and return its results; what is finished already is not run again.

    Progress is logged at level INFO to the logger "shipid". Call it under `if __name__ == "__main__":`: workers are
    processes.

    Parameters
    ----------
    study : name of a bundled study, or path of a study document.
    set : dotted path -> value, such as `{"grid.N_D": [10, 30]}`.
    out : folder of the run; default: `results/<study>-<digest>`.
    workers : local processes of one thread each; default: one per core.
    scheduler : address of a Dask scheduler to use instead.
    device : PyTorch device: "cpu" or "cuda".
    trust : whether code that the study names may run, such as that of a function.

    Raises ShipidError for whatever a user can mend.
    """
    if read_plan(study, set, trust=trust).parts:
        raise ShipidError("has several parts: run it by `shipid.events`, read each folder in parts/", path=str(study))
    for event in events(study, set, out, workers, scheduler=scheduler, device=device, trust=trust):
        if line := event_line(event):
            log.info("%s", line)
        if event.kind == "end":
            folder = Path(event.text)
    write_pages(folder)
    return read_results(folder)


def events(
    study: str | Path,
    set: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
    *,
    scheduler: str | None = None,
    device: str = "cpu",
    trust: bool = False,
) -> Iterator[Event]:
    """Run a study and yield what happens: notes, the start, every finished cell, the end, whose text is the folder.

    Arguments as of `run`. The report is not written: `write_pages(folder)` does.
    """
    plan = read_plan(study, set, trust=trust)
    folder = default_folder(plan) if out is None else as_path("out", out)
    yield from run_study(plan, folder, workers=workers, scheduler=scheduler, device=device)


def event_line(event: Event) -> str:
    """Write an event as one line of text; empty for the end."""
    row = event.row
    if event.kind != "cell":
        start = f"{event.total - event.done} of {event.total} cells to do"
        return {"note": event.text, "start": start}.get(event.kind, "")
    result = f"{row['status']}: {row['sentence']}"
    if row["status"] == "ok":
        end, end_90, H = (
            f"{row[name]:.{max(length_decimals(row[name]), 3)}f} m" for name in ("H_end", "H_end_90", "H")
        )
        result = f"at the horizon {end}, nine in ten below {end_90}, H {H}"
    return f"[{event.done}/{event.total}] {row['cell']}: {result}, {row['seconds']:.1f} s"
