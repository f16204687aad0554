"""Output of a command: tables and lines for people, or one JSON object for programs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shipid.cli.terminal import four_digits, print_table, text_table

if TYPE_CHECKING:
    from pandas import DataFrame

    from shipid.cli.terminal import TextTable

Json = Annotated[bool, typer.Option("--json", help="print one JSON object instead of tables; all else goes to stderr")]


class Answer:
    """Collects the output of a command for JSON, or prints it immediately.

    Parameters
    ----------
    as_json : whether standard output is to hold one JSON object and nothing else.
    """

    def __init__(self, as_json: bool) -> None:
        self.as_json = as_json
        self.contents: dict[str, Any] = {}

    def say(self, text: str = "", **values: Any) -> None:
        """Print a line, if it is not empty; for programs only its values, by name."""
        if self.as_json:
            self.contents.update(values)
        elif text:
            typer.echo(text)

    def rows(self, name: str, rows: DataFrame | Iterable[Mapping[Any, Any]], shown: TextTable | None) -> None:
        """Print a table, if there is one to be shown; for programs its rows under a name, SI and not rounded."""
        if self.as_json:
            self.contents[name] = rows.to_dict("records") if hasattr(rows, "to_dict") else [dict(row) for row in rows]
        elif shown is not None:
            print_table(shown)

    def records(
        self,
        name: str,
        rows: DataFrame | Sequence[Mapping[Any, Any]],
        heads: Mapping[str, str] | None = None,
        formats: Mapping[str, Callable[[Any], str]] | None = None,
    ) -> None:
        """Print dicts or rows of a frame, if there are any, as a table; programs get all of their columns.

        heads : key -> heading of the columns to print; default: all, headed by their keys. formats : key -> how its
        values are written; default: floats with four digits.
        """
        records: Any = rows.to_dict("records") if hasattr(rows, "to_dict") else rows
        heads = heads or {key: key for record in records[:1] for key in record}
        formats = dict.fromkeys(heads, _format_cell) | dict(formats or {})
        cells = [[formats[key](record[key]) for key in heads] for record in records]
        self.rows(name, rows, text_table(list(heads.values()), cells) if cells else None)


def _format_cell(value: Any) -> str:
    return four_digits(value) if isinstance(value, float) else str(value)


@contextmanager
def open_answer(as_json: bool) -> Iterator[Answer]:
    """Give an `Answer`, and print it as JSON at the end of the block, also where that ends with an exit status."""
    answer = Answer(as_json)
    try:
        yield answer
    except typer.Exit:
        _print_answer(answer)
        raise
    _print_answer(answer)


def _print_answer(answer: Answer) -> None:
    if answer.as_json:
        from shipid.files import json_text

        sys.stdout.write(json_text(answer.contents) + "\n")
