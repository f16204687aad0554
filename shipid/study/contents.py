"""What the report of a study shows, assembled from its results; the pages written from a run's folder."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from pathlib import Path

import pandas as pd
from threadpoolctl import threadpool_limits

from shipid.arguments import path_of
from shipid.errors import ResultError
from shipid.files import temporary_folder, write_table, write_text
from shipid.report import Finding, ReportContent, Sentence, Snapshot, write_report, write_summary
from shipid.report.comparison import write_comparison
from shipid.report.methods import MethodsContent, verdicts
from shipid.study import advise, bands, memory, methods, seals, store
from shipid.study import results as parts
from shipid.study.declared import NO_MODEL
from shipid.study.error_table import intervals_frame
from shipid.study.findings import findings
from shipid.study.lock import PAGES, sole_writer
from shipid.study.plan import Plan, judged_method, model_label, plan_text, run_command
from shipid.study.results import Results, read_results

log = logging.getLogger(__name__)

Say = Callable[[str], object]
ANSWER, SUMMARY, REPORT, METHODS = "answer.txt", "summary.md", "report.html", "methods.csv"
FRAMES: dict[str, Callable[[Results], pd.DataFrame]] = {
    "observer": memory.observer_frame,
    "orders": memory.orders_frame,
    "kinds": parts.kinds_frame,
    "memory": memory.memory_frame,
    "memory_over_time": memory.memory_time_frame,
    "coverage": bands.coverage_frame,
    "coverage_groups": bands.groups_frame,
    "coverage_runs": bands.worst_frame,
    "no_band": bands.refused_frame,
    "methods": methods.methods_frame,
    "intervals": intervals_frame,
}
"""Further frames of the report by name: what a section names in `needs` that is no field of `ReportContent`."""


def report_content(results: Results, say: Say | None = None) -> ReportContent:
    """Assemble everything that the report of a study shows. say : called with a few words on how far it is."""
    frames = {}
    for name, frame in FRAMES.items():
        if say is not None:
            say(f"{results.plan.name}: table {name.replace('_', ' ')} of {len(results.cells)} cells")
        frames[name] = parts.in_the_run(results, frame(results))
    if say is not None:
        say(f"{results.plan.name}: answer, findings and errors of {len(results.cells)} cells")
    answer = advise.answer(results, verdicts(frames["methods"])), bands.answer(results)
    return ReportContent(
        title=results.plan.study.question,
        name=results.plan.name,
        answer=[Sentence(text, figure) for part in answer for text, figure in part],
        findings=[Finding(f["id"], f["claim"], f["verdict"], f["evidence"]) for f in findings(results)],
        cells=results.cells,
        naive=parts.naive_summary(results),
        models=_shown_models(results),
        factors=parts.factors_frame(results),
        trials=parts.trials_frame(results),
        horizon=parts.horizon_frame(results),
        over_time=parts.in_the_run(results, parts.time_frame(results)),
        commands=parts.in_the_run(results, parts.commands_frame(results)),
        snapshots=[Snapshot(**snapshot) for snapshot in parts.snapshots(results)],
        tracks=parts.tracks_frame(results),
        envelope=parts.envelope_frame(results),
        repairs=parts.repairs_frame(results),
        provenance=parts.provenance_words(results),
        study_document=plan_text(results.plan),
        command=run_command(results.plan),
        best=model_label(results.plan, best, judged_method(results.plan))
        if (best := advise.best_model(results))
        else "",
        alone=parts.alone_models(results),
        frames=frames,
    )


def _shown_models(results: Results) -> pd.DataFrame:
    """The models; without `none` where no method that the study judges by meets it: nothing of it can be drawn."""
    judged = (NO_MODEL, judged_method(results.plan)) in {(name, way.name) for name, way in results.plan.pairs}
    return results.models if judged else results.models[results.models["model"].ne(NO_MODEL)]


def write_pages(folder: str | os.PathLike[str], say: Say | None = None) -> Path:
    """Write report.html, summary.md, answer.txt and the tables from what a run's folder holds; returns the report.

    A study of several parts has these in the folder of each part, and a page that compares its methods over all parts,
    with `methods.csv` beside it. say : called with a few words on how far it is.

    Raises ResultError if the folder holds no run or cannot be written.
    """
    folder = path_of("folder", folder)
    store.stored_plan(folder)
    store.check_writable(folder)
    with sole_writer(folder, PAGES, wait=True):
        return _write(folder, say)


def _write(folder: Path, say: Say | None) -> Path:
    """Write the pages, alone; those of an unfinished run are as old as the results that were read for them."""
    plan = store.stored_plan(folder)
    with temporary_folder(folder) as place:
        read = place.stat().st_mtime_ns
    with threadpool_limits(1, user_api="blas"):  # products are small: on a busy machine threads cost half of the time
        report, whole = _write_parts(plan, folder, say) if plan.parts else _write_one(folder, say)
    if not whole:
        os.utime(report, ns=(read, read))
    return report


def _write_one(folder: Path, say: Say | None) -> tuple[Path, bool]:
    """The pages of one run, and whether all of its cells are in them."""
    results = read_results(folder, say)
    store.write_results(folder, results.plan, results.cells, whole=results.complete)
    content = report_content(results, say)
    write_text(folder / ANSWER, "\n".join(sentence.text for sentence in content.answer) + "\n")
    write_summary(content, folder / SUMMARY)
    report = write_report(content, folder / REPORT, say)
    log.debug("report written: %s", report)
    return report, results.complete


def share_pages(folder: Path, say: Say | None = None) -> Path:
    """Write the pages of a run that has ended, unless they are newer than its tables.

    say : called with a few words on how far it is.
    """
    report, parts = folder / REPORT, store.stored_plan(folder).parts
    places = [store.part_folder(folder, name) for name in parts] or [folder]
    pages = [place / name for place in places for name in (ANSWER, SUMMARY, REPORT)]
    pages += [folder / name for name in (ANSWER, METHODS, REPORT)] if parts else []

    try:
        tables = max(seals.seal_file(place, store.RESULTS).stat().st_mtime for place in places)
        done = report.stat().st_mtime >= tables and all(page.stat().st_size for page in pages)
    except FileNotFoundError:
        done = False
    return report if done else write_pages(folder, say)


def _write_parts(plan: Plan, folder: Path, say: Say | None) -> tuple[Path, bool]:
    """The pages of all parts that have results and one that compares methods over them, and whether all is in it."""
    cells: list[pd.DataFrame] = []
    notes: dict[str, str] = {}
    whole: list[bool] = []
    for name, part in plan.parts.items():
        mine = store.check_part(folder, name, part.plan)
        if not (mine / store.STUDY).is_file() or not store.finished(mine, part.plan.units):
            notes[name] = "no cell is finished yet"
            continue
        write_pages(mine, say)
        results = read_results(mine)
        whole.append(results.complete)
        cells.append(methods.method_cells(results, part.condition, name))
        notes[name] = f"{len(results.cells)} of {part.plan.cells} cells"
    if not cells:
        raise ResultError("no cell is finished yet: continue with `shipid study resume`", file=folder)
    frame = methods.compared(methods.joined(cells), judged_method(plan))
    write_table(folder / METHODS, frame)
    content = MethodsContent(
        title=plan.study.question,
        name=plan.name,
        frames={"methods": frame},
        provenance={"study": f"{plan.name}, digest {plan.digest}", **notes},
        study_document=plan_text(plan),
        command=run_command(plan),
    )
    write_text(folder / ANSWER, "\n".join(sentence.text for sentence in content.answer) + "\n")
    return write_comparison(content, folder / REPORT), len(whole) == len(plan.parts) and all(whole)
