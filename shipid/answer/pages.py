"""What the report of a study shows, assembled from its results; the pages written from a run's folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from threadpoolctl import threadpool_limits

from shipid.answer import bands, frames, methods, sentences
from shipid.answer.findings import judge_findings
from shipid.arguments import as_path
from shipid.errors import ResultError
from shipid.exchange import cost
from shipid.exchange.shares import shares_frame
from shipid.files import read_json, write_json, write_table, write_text
from shipid.metrics import summarise_errors
from shipid.report import AnswerSentence, ReportContent, summary_text, write_report
from shipid.report.methods import MethodsContent, sentences_on_methods, write_comparison
from shipid.study import seals, store
from shipid.study.declared import NO_MODEL
from shipid.study.envelope import envelope_table
from shipid.study.plan import Plan, model_label, plan_text, run_command, verdict_method
from shipid.study.results import Results, read_results
from shipid.study.seals import PAGES, sole_writer

Say = Callable[[str], object]
REPAIR_COLUMNS = ["kind", "column", "count", "note"]
ANSWER, SUMMARY, REPORT, METHODS = "answer.txt", "summary.md", "report.html", "methods.csv"
SHARES, COST = "shares.csv", "cost.json"
REPORT_FRAMES: dict[str, Callable[[Results], pd.DataFrame]] = {
    "kinds": frames.kinds_frame,
    "regression": frames.regression_frame,
    "coverage": bands.coverage_frame,
    "no_band": bands.refused_frame,
    "methods": methods.compare_methods,
    "shares": shares_frame,
    "cost": cost.cost_frame,
}
"""Further frames of the report by name: what a section names in `needs` that is no field of `ReportContent`."""


def report_content(results: Results) -> ReportContent:
    """Assemble everything that the report of a study shows."""
    plan, tables = results.plan, {name: frame(results) for name, frame in REPORT_FRAMES.items()}
    said = sentences.answer_sentences(results, sentences_on_methods(tables["methods"]))
    words = (
        *said[:1],
        *((text, "frontier") for text in cost.cost_sentences(results)),
        *said[1:],
        *bands.answer_on_bands(results, tables["coverage"]),
    )
    best, models = sentences.best_model(results), results.models
    if (NO_MODEL, verdict_method(plan)) not in {(name, way.name) for name, way in plan.pairs}:
        models = models[models["model"].ne(NO_MODEL)]  # nothing of it can be drawn
    naive: Mapping[str, Any] = summarise_errors(results.naive)
    return ReportContent(
        title=plan.study.question,
        name=plan.name,
        answer=[AnswerSentence(text, figure) for text, figure in words],
        findings=judge_findings(results),
        cells=results.cells,
        naive={name: naive[name] for name in ("end", "end_90", "mean", "p90", "rms")},
        models=models,
        factors=frames.factors_frame(results),
        trials=frames.trials_frame(results),
        horizon=frames.horizon_frame(results),
        over_time=frames.time_frame(results),
        commands=frames.commands_frame(results),
        snapshots=frames.window_snapshots(results),
        tracks=frames.tracks_frame(results),
        envelope=envelope_table(read_json(results.folder / store.ENVELOPE), plan.study.published),
        repairs=pd.DataFrame(results.dataset.metadata.get("repairs", []), columns=REPAIR_COLUMNS),
        provenance=frames.provenance_words(results),
        study_document=plan_text(plan),
        command=run_command(plan),
        best="" if best is None else model_label(plan, best, verdict_method(plan)),
        alone=frames.alone_models(results),
        frames=tables,
    )


def write_pages(folder: str | os.PathLike[str], say: Say | None = None) -> Path:
    """Write report.html, summary.md, answer.txt and the tables from what a run's folder holds; returns the report.

    Parts of a study have theirs in their folders; the page of the whole compares methods, with `methods.csv` beside it.
    say : called with words on the progress. Raises ResultError if the folder holds no run, OSError if it cannot be
    written.
    """
    folder = as_path("folder", folder)
    plan = store.stored_plan(folder)
    # Products are small: on a busy machine threads cost half of the time.
    with sole_writer(folder, PAGES, wait=True), threadpool_limits(1, user_api="blas"):
        return _write_pages_of_parts(plan, folder, say) if plan.parts else _write_pages_of_run(folder, say)


def _write_pages_of_run(folder: Path, say: Say | None) -> Path:
    """Write the pages of one run."""
    results = read_results(folder, say)
    if not (results.complete and seals.is_sealed(folder, store.RESULTS)):
        store.write_results(folder, results.plan, results.cells, whole=results.complete)
    if say is not None:
        say(f"{results.plan.name}: answer, findings and tables of {len(results.cells)} cells")
    content = report_content(results)
    write_text(folder / ANSWER, "\n".join(sentence.text for sentence in content.answer) + "\n")
    write_text(folder / SUMMARY, summary_text(content))
    write_table(folder / SHARES, content.frame("shares"))
    if len(ways := content.frame("cost")):
        said = [sentence.text for sentence in content.answer if sentence.figure == "frontier"]
        write_json(folder / COST, {"answer": said, "ways": ways.to_dict("records")})
    return write_report(content, folder / REPORT)


def _write_pages_of_parts(plan: Plan, folder: Path, say: Say | None) -> Path:
    """Write the pages of all parts that have results, and one that compares methods over them."""
    cells: list[pd.DataFrame] = []
    notes: dict[str, str] = {}
    for name, part in plan.parts.items():
        mine = store.check_part(folder, name, part.plan)
        if not (mine / store.STUDY).is_file() or not store.finished_units(mine, part.plan.units):
            notes[name] = "no cell is finished yet"
            continue
        write_pages(mine, say)
        results = read_results(mine)
        cells.append(methods.method_cells(results, part.condition, name))
        notes[name] = f"{len(results.cells)} of {part.plan.cells} cells"
    if not cells:
        raise ResultError("no cell is finished yet: continue with `shipid study resume`", file=folder)
    every = pd.concat(cells, ignore_index=True)
    frame = methods.method_table(every, verdict_method(plan))
    write_table(folder / METHODS, frame)
    content = MethodsContent(
        title=plan.study.question,
        name=plan.name,
        frames={"methods": frame},
        worlds=methods.sentences_on_worlds(plan, every),
        provenance={"study": f"{plan.name}, digest {plan.digest}", **notes},
        study_document=plan_text(plan),
        command=run_command(plan),
    )
    write_text(folder / ANSWER, "\n".join(sentence.text for sentence in content.answer) + "\n")
    return write_comparison(content, folder / REPORT)
