"""Tables, progress and numbers as lines of text."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import typer

from shipid.errors import escape_unprintable

SILENCE = 15.0  # s between lines of a long calculation


@dataclass(frozen=True)
class TextTable:
    """A table of text: the headings of its columns, and rows with one cell for each."""

    columns: list[str]
    rows: list[list[str]]


def text_table(columns: list[str], rows: Iterable[Iterable[Any]]) -> TextTable:
    """Make a table of the headings of its columns and rows of values."""
    return TextTable(
        [escape_unprintable(column) for column in columns],
        [[escape_unprintable(str(cell)) for cell in row] for row in rows],
    )


def print_table(table: TextTable) -> None:
    """Print a table, a line for each row, however long."""
    widths = [max(map(len, column)) for column in zip(table.columns, *table.rows, strict=True)]

    def line(cells: Iterable[str]) -> str:
        return f" {' '.join(f' {cell:<{width}} ' for cell, width in zip(cells, widths, strict=True))}".rstrip()

    rule = ("\u2500" if "utf" in (sys.stdout.encoding or "").lower() else "-") * (sum(widths) + 3 * len(widths) - 1)
    typer.echo("\n".join(["", line(table.columns), f" {rule}", *map(line, table.rows), ""]))


def shorten_text(text: str, most: int) -> str:
    """Shorten a text to so many characters, with dots in its middle."""
    return text if len(text) <= most else f"{text[: most // 2 - 1]}...{text[-(most - most // 2 - 2) :]}"


def four_digits(value: float) -> str:
    """Write a number with four digits; a dash where it is NaN."""
    if abs(value) >= 1e6:  # a moment on a clock of dates
        return f"{value:.1f}"
    return "-" if value != value else f"{round(value, 4) + 0.0:.4g}"


def motion_errors(row: Mapping[Any, Any]) -> list[str]:
    """Errors of u, v [m/s], r [deg/s] and position [m] of a run; that it diverges, where it does."""
    values = (row["u"], row["v"], math.degrees(row["r"]), row["position"])
    return ["diverges" if value != value else four_digits(value) for value in values]


def measure_table(rows: Iterable[Any], first: list[str]) -> TextTable:
    """Return a table of measures; `first` are the names of its leading columns."""
    rows = list(rows)
    missing = any(row["note"] for row in rows)
    body = [
        [
            *(row[key] for key in first),
            row["measure"],
            four_digits(row["value"]),
            row["unit"],
            "" if row["lengths"] != row["lengths"] else f"{row['lengths']:z.2f}",
            *[row["note"]] * missing,
        ]
        for row in rows
    ]
    return text_table([*first, "measure", "value", "unit", "ship lengths", *["why missing"] * missing], body)


def criterion_table(rows: Iterable[Any], first: list[str]) -> TextTable:
    """Return a table of criteria; `first` are the names of its leading columns."""
    body = [
        [
            *(row[key] for key in first),
            row["criterion"],
            *(four_digits(row[key]) for key in ("value", "limit")),
            row["unit"],
            row["verdict"],
            row["note"],
        ]
        for row in rows
    ]
    return text_table([*first, "IMO MSC.137(76)", "value", "limit", "unit", "verdict", "note"], body)


NOTHING = "interrupted: nothing was written"


@contextmanager
def end_on_interrupt(interrupted: str = NOTHING) -> Iterator[None]:
    """Answer Ctrl-C with a sentence on standard error, and end with 130."""
    try:
        yield
    except KeyboardInterrupt:
        sys.stderr.write(f"{interrupted}\n")
        sys.exit(130)


def count_blocks(blocks: Iterable[Any], total: int, what: str = "members", interrupted: str = NOTHING) -> Iterator[Any]:
    """Yield the blocks of rows unchanged; show how many of `total` rows are there.

    interrupted : what Ctrl-C is answered with.
    """
    with end_on_interrupt(interrupted), show_steps() as show:
        count = 0
        show(f"{count} of {total} {what}")
        for block in blocks:
            count += len(block)
            show(f"{count} of {total} {what}")
            yield block


@contextmanager
def show_steps(first: str = "", look: Callable[[], str] | None = None) -> Iterator[Callable[[str], None]]:
    """Give a function that takes the step of a long calculation: it is printed to standard error every 15 s, if new.

    look : gives the step instead, each time that it is printed.
    """
    from threading import Event, Thread

    ended, last, printed = Event(), [first], [""]

    def report() -> None:
        with suppress(OSError):  # the block ends the process where it cannot print either
            while not ended.wait(SILENCE):
                step = look() if look else last[0]
                if step != printed[0]:
                    printed[0] = step
                    sys.stderr.write(f"{escape_unprintable(step)}\n")

    thread = Thread(target=report, daemon=True)
    thread.start()
    try:
        yield lambda step: last.__setitem__(0, step)
    finally:
        ended.set()
        thread.join()


def log_to_stderr(verbose: bool) -> None:
    """Write the warnings of shipid to standard error, or all its log messages."""
    import logging

    logger = logging.getLogger("shipid")
    handler = logging.StreamHandler()
    handler.setLevel(logging.DEBUG if verbose else logging.WARNING)
    handler.setFormatter(logging.Formatter("%(name)s: %(message)s" if verbose else "warning: %(message)s"))
    logger.handlers = [handler]
    if verbose:
        logger.setLevel(logging.DEBUG)
