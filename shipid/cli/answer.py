"""Output of a command: tables, lines and progress for people, or one JSON object for programs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shipid.files import json_text, write_table
from shipid.units import plural_word

if TYPE_CHECKING:
    from pandas import DataFrame

    from shipid.data.dataset import Dataset

    Rows = DataFrame | Sequence[Mapping[Any, Any]]
import math
from collections.abc import Sequence
from contextlib import suppress

from shipid.errors import escape_unprintable

SILENCE = 15.0  # s between lines of a long calculation
NOTHING = "interrupted: nothing was written"


def print_table(columns: Sequence[str], rows: Iterable[Iterable[str]]) -> None:
    """Print a table, a line for each row, however long."""
    table = [[escape_unprintable(cell) for cell in cells] for cells in (columns, *rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    sign = "\u2500" if "utf" in (sys.stdout.encoding or "").lower() else "-"
    lines = [f"  {'   '.join(map(str.ljust, cells, widths))}".rstrip() for cells in table]
    lines.insert(1, f" {sign * (sum(widths) + 3 * len(widths) - 1)}")
    typer.echo("\n".join(["", *lines, ""]))


def four_digits(value: float, missing: str = "-") -> str:
    """Write a number with four digits; a dash, or another word, where it is NaN."""
    if abs(value) >= 1e6:  # a moment on a clock of dates
        return f"{value:.1f}"
    return missing if math.isnan(value) else f"{round(value, 4) + 0.0:.4g}"


MOTION = {"u": "u [m/s]", "v": "v [m/s]", "r": "r [deg/s]", "position": "position [m]"}
"""Column of errors of free runs -> heading."""
MOTION_FORMATS: dict[str, Callable[[float], str]] = dict.fromkeys(
    MOTION, lambda error: four_digits(error, "diverges")
) | {"r": lambda error: four_digits(math.degrees(error), "diverges")}
MEASURES = {
    "measure": "measure", "value": "value", "unit": "unit", "lengths": "ship lengths", "note": "why missing"
}  # fmt: skip
MEASURE_FORMATS = {"lengths": lambda lengths: "" if math.isnan(lengths) else f"{lengths:z.2f}"}
CRITERIA = {"criterion": "IMO MSC.137(76)", **{key: key for key in ("value", "limit", "unit", "verdict", "note")}}


@contextmanager
def end_on_interrupt(interrupted: str = NOTHING) -> Iterator[None]:
    """Answer Ctrl-C with a sentence on standard error, and end with 130."""
    try:
        yield
    except KeyboardInterrupt:
        sys.stderr.write(f"{interrupted}\n")
        sys.exit(130)


@contextmanager
def show_steps(first: str = "", look: Callable[[], str] | None = None) -> Iterator[Callable[[str], None]]:
    """Give a function that takes the step of a long calculation: it is printed to standard error every 15 s, if new.

    look : gives the step instead, each time that it is printed.
    """
    from threading import Event, Thread

    ended, steps = Event(), [first]

    def report() -> None:
        printed = ""
        with suppress(OSError):  # the block ends the process where it cannot print either
            while not ended.wait(SILENCE):
                step = look() if look else steps[-1]
                if step != printed:
                    printed = step
                    sys.stderr.write(f"{escape_unprintable(step)}\n")

    thread = Thread(target=report, daemon=True)
    thread.start()
    try:
        yield steps.append
    finally:
        ended.set()
        thread.join()


def log_to_stderr(verbose: bool) -> None:
    """Write the warnings of shipid to standard error, or all its log messages."""
    import logging

    logger, handler = logging.getLogger("shipid"), logging.StreamHandler()
    handler.setLevel(logging.DEBUG if verbose else logging.WARNING)
    handler.setFormatter(logging.Formatter("%(name)s: %(message)s" if verbose else "warning: %(message)s"))
    logger.handlers = [handler]
    if verbose:
        logger.setLevel(logging.DEBUG)


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
