"""What the report of a study shows, assembled from its results; the pages written from a run's folder."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from shipid.files import write_text
from shipid.report import Finding, ReportContent, Sentence, Snapshot, write_report, write_summary
from shipid.study import advise, memory
from shipid.study import results as parts
from shipid.study.findings import findings
from shipid.study.results import Results, read_results
from shipid.study.store import write_results

log = logging.getLogger(__name__)

ANSWER, SUMMARY, REPORT = "answer.txt", "summary.md", "report.html"
FRAMES: dict[str, Callable[[Results], pd.DataFrame]] = {
    "observer": memory.observer_frame,
    "orders": memory.orders_frame,
    "kinds": parts.kinds_frame,
    "memory": memory.memory_frame,
    "memory_over_time": memory.memory_time_frame,
}
"""Further frames of the report by name: what a section names in `needs` that is no field of `ReportContent`."""


def report_content(results: Results) -> ReportContent:
    """Assemble everything that the report of a study shows."""
    return ReportContent(
        title=results.plan.study.question,
        name=results.plan.name,
        answer=[Sentence(text, figure) for text, figure in advise.answer(results)],
        findings=[Finding(f["id"], f["claim"], f["verdict"], f["evidence"]) for f in findings(results)],
        cells=results.cells,
        naive=parts.naive_summary(results),
        models=results.models,
        factors=parts.factors_frame(results),
        trials=parts.trials_frame(results),
        horizon=parts.horizon_frame(results),
        over_time=parts.time_frame(results),
        commands=parts.commands_frame(results),
        snapshots=[Snapshot(**snapshot) for snapshot in parts.snapshots(results)],
        tracks=parts.tracks_frame(results),
        envelope=parts.envelope_frame(results),
        repairs=parts.repairs_frame(results),
        provenance=parts.provenance_words(results),
        study_document=results.plan.text(),
        command=parts.reproducing_command(results),
        frames={name: frame(results) for name, frame in FRAMES.items()},
    )


def write_pages(folder: Path) -> Path:
    """Write report.html, summary.md, answer.txt and the tables from what a run's folder holds; returns the report.

    Raises ResultError if the folder holds no run or cannot be written.
    """
    results = read_results(folder)
    write_results(folder, results.cells)
    content = report_content(results)
    write_text(folder / ANSWER, "\n".join(sentence.text for sentence in content.answer) + "\n")
    write_summary(content, folder / SUMMARY)
    report = write_report(content, folder / REPORT)
    log.debug("report written: %s", report)
    return report
