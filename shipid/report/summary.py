"""The results of a study as Markdown, to be read by programs and in a terminal."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from shipid.report.content import AnswerSentence, ReportContent
from shipid.report.errors_over import error_by_kind
from shipid.report.factors import cells_table, models_table
from shipid.report.page import split_answer
from shipid.report.wording import CONSTANT_MOTION, REGRESSION, metres_text, number_text


def summary_text(content: ReportContent) -> str:
    """Answer, findings, errors of constant u, v, r and of regressions, models, cells and provenance as Markdown."""
    errors = {name: metres_text(value) for name, value in content.naive.items()}
    known = content.frame("regression")
    regressed = [[str(N_D), *map(number_text, numbers)] for N_D, *numbers in known.to_numpy(object).tolist()]
    headline, more = split_answer(content.answer)
    findings = [[f["id"], f["claim"], f["verdict"], f["evidence"]] for f in content.findings]
    parts = [
        f"# {_one_line(content.title)}",
        _bullet_list(headline),
        *(["## In detail", _bullet_list(more)] if more else []),
        *(["## Findings", _markdown_table(["", "claim", "verdict", "evidence"], findings)] if findings else []),
        f"## {CONSTANT_MOTION.capitalize()}",
        "At the horizon {end}, nine in ten below {end_90}; mean over it {mean}, 90th percentile {p90}.".format(
            **errors
        ),
        *([f"## {REGRESSION.capitalize()}", _markdown_table([*map(str, known)], regressed)] if regressed else []),
    ]
    by_kind = [error_by_kind(content)] if len(content.frame("kinds")) else []
    for table in (*by_kind, models_table(content), cells_table(content)):
        rows = [[cell.text for cell in row] for row in table.rows]
        parts += [f"## {table.title}", _one_line(table.takeaway), _markdown_table(table.columns, rows)]
    parts += ["## Provenance", _markdown_table(["", ""], content.provenance.items())]
    parts.append("\n".join(f"    {line}" for line in content.command.splitlines()))
    return "\n\n".join(part for part in parts if part) + "\n"


def _bullet_list(sentences: Sequence[AnswerSentence]) -> str:
    return "\n".join(f"- {_one_line(sentence.text)}" for sentence in sentences)


def _markdown_table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [list(map(_one_line, line)) for line in (columns, ["---"] * len(columns), *rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) if len(lines) > 2 else ""


def _one_line(text: str) -> str:
    """One line of text that Markdown reads as text: no tag, no column."""
    return html.escape(" ".join(text.split()), quote=False).replace("|", "\\|")
