"""Output of a command: tables and lines for people, or one JSON object for programs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shipid.cli.terminal import four_digits, print_table
from shipid.files import json_text, write_table
from shipid.units import plural_word

if TYPE_CHECKING:
    from pandas import DataFrame

    from shipid.data.dataset import Dataset

    Rows = DataFrame | Sequence[Mapping[Any, Any]]

Json = Annotated[bool, typer.Option("--json", help="print one JSON object instead of tables; all else goes to stderr")]


class Answer:
    """Collects the output of a command for JSON, or prints it immediately."""

    def __init__(self, as_json: bool) -> None:
        self.as_json = as_json
        self.contents: dict[str, Any] = {}

    def say(self, text: str = "", **values: Any) -> None:
        """Print a line, if it is not empty; for programs only its values, by name."""
        if self.as_json:
            self.contents.update(values)
        elif text:
            typer.echo(text)

    def warn(self, warnings: Iterable[str]) -> None:
        """Print warnings on standard error; programs get them, too."""
        self.contents["warnings"] = list(warnings)
        for warning in self.contents["warnings"]:
            typer.echo(f"warning: {warning}", err=True)

    def records(
        self,
        name: str,
        rows: Rows,
        heads: Mapping[str, str] | None = None,
        formats: Mapping[str, Callable[[Any], str]] | None = None,
        *,
        shown: Rows | None = None,
    ) -> None:
        """Print dicts or rows of a frame, if there are any, as a table; programs get all of them, SI and not rounded.

        heads : key -> heading of the columns to print; default: all, headed by their keys. formats : key -> how its
        values are written; default: floats with four digits. shown : rows to print instead.
        """
        given: Any = rows if shown is None or self.as_json else shown
        records: list[dict[str, Any]] = (
            given.to_dict("records") if hasattr(given, "to_dict") else [dict(row) for row in given]
        )
        if self.as_json:
            self.contents[name] = records
        elif records:
            heads, formats = heads or {key: str(key) for key in records[0]}, formats or {}
            cells = [
                [
                    formats.get(key, lambda one: four_digits(one) if isinstance(one, float) else str(one))(record[key])
                    for key in heads
                ]
                for record in records
            ]
            print_table(list(heads.values()), cells)

    def save(self, what: str, file: Path | None, rows: DataFrame) -> None:
        """Write a table, if a file is given, and say so."""
        if file is not None:
            write_table(file, rows)
            self.say(f"{what} -> {file}", file=file)

    def say_page(self, page: Path) -> None:
        """Say where a page was written."""
        self.say(f"page -> {page}", page=page)

    def say_dataset(self, dataset: Dataset, file: Path) -> None:
        """Say how large a dataset is that was written."""
        runs, rows = len(dataset.runs), len(dataset.frame)
        self.say(f"{rows} rows in {runs} {plural_word(runs, 'run')} -> {file}", file=file, rows=rows, runs=runs)


@contextmanager
def open_answer(as_json: bool) -> Iterator[Answer]:
    """Give an `Answer`, and print it as JSON at the end of the block."""
    answer = Answer(as_json)
    yield answer
    if as_json:
        sys.stdout.write(json_text(answer.contents) + "\n")
