"""The results of a study as Markdown, to be read by programs and in a terminal."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path

from shipid.report import tables
from shipid.report.content import ReportContent, Sentence
from shipid.report.page import LEAD, write
from shipid.report.wording import CONSTANT, metres


def summary(content: ReportContent) -> str:
    """Answer, findings, errors of constant u, v, r, models, cells and provenance as Markdown."""
    naive = content.naive
    findings = [[f.id, f.claim, f.verdict, f.evidence] for f in content.findings]
    parts = [
        f"# {_plain(content.title)}",
        _listed(content.answer[:LEAD]),
        *(["## In detail", _listed(content.answer[LEAD:])] if content.answer[LEAD:] else []),
        *(["## Findings", _grid(["", "claim", "verdict", "evidence"], findings)] if findings else []),
        f"## {CONSTANT.capitalize()}",
        f"Mean error {metres(naive['mean'])}, 90th percentile {metres(naive['p90'])}, "
        f"root mean square {metres(naive['rms'])}.",
    ]
    for table in filter(None, (tables.kinds(content), tables.models(content), tables.cells(content))):
        rows = [[cell.text for cell in row] for row in table.rows]
        parts += [f"## {table.title}", _plain(table.takeaway), _grid(table.columns, rows)]
    parts += ["## Provenance", _grid(["", ""], [[key, value] for key, value in content.provenance.items()])]
    if content.command:
        parts.append("\n".join(f"    {line}" for line in content.command.splitlines()))
    return "\n\n".join(part for part in parts if part) + "\n"


def write_summary(content: ReportContent, file: Path) -> Path:
    """Write the summary as Markdown; returns the file. Raises ResultError if it cannot."""
    return write(summary(content), file)


def _listed(sentences: Sequence[Sentence]) -> str:
    return "\n".join(f"- {_plain(sentence.text)}" for sentence in sentences)


def _grid(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [
        [_plain(name) for name in columns],
        ["---"] * len(columns),
        *([_plain(cell) for cell in row] for row in rows),
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) if rows else ""


def _plain(text: str) -> str:
    """One line of text that Markdown reads as text: no tag, no column."""
    return html.escape(" ".join(text.split()), quote=False).replace("|", "\\|")
