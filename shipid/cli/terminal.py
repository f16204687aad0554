"""Tables, progress and numbers on a terminal; plain lines anywhere else."""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from shipid.errors import escape_unprintable
from shipid.units import length_text

if TYPE_CHECKING:
    from shipid.study.progress import Watch
    from shipid.study.run import Event


SILENCE, LOOK = 15.0, 2.0  # s without a line before there is one; between looks at the searches on a terminal


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


def _open_console(*, stderr: bool = False) -> Any:
    """Return the terminal; with NO_COLOR in the environment without bold and dim text, too (no-color.org)."""
    from rich.console import Console

    return Console(stderr=stderr, color_system=None if os.environ.get("NO_COLOR") else "auto")


def print_table(table: TextTable) -> None:
    """Print a table: folded to the width of a terminal; elsewhere a line for each row, however long."""
    if sys.stdout.isatty():
        _open_console().print(_folded_table(table))
    else:
        typer.echo("\n".join(_table_lines(table)))


def _folded_table(table: TextTable) -> Any:
    """Return the table as one of rich's, which folds its cells."""
    from rich import box
    from rich.table import Table as Folded
    from rich.text import Text

    result = Folded(box=box.SIMPLE_HEAD)
    for column in table.columns:
        # As text: rich would take [m] for markup. Folded: in a narrow terminal it would cut 5.067 to "5.…".
        result.add_column(Text(column), overflow="fold")
    for row in table.rows:
        result.add_row(*map(Text, row))
    return result


def _table_lines(table: TextTable) -> list[str]:
    """Return the lines of a table that looks as on a terminal, but is as wide as it is."""
    widths = [max(map(_text_width, column)) for column in zip(table.columns, *table.rows, strict=True)]

    def line(cells: Iterable[str]) -> str:
        padded = (f" {cell}{' ' * (width - _text_width(cell))} " for cell, width in zip(cells, widths, strict=True))
        return f" {' '.join(padded)}".rstrip()

    rule = ("\u2500" if "utf" in (sys.stdout.encoding or "").lower() else "-") * (sum(widths) + 3 * len(widths) - 1)
    return ["", line(table.columns), f" {rule}", *map(line, table.rows), ""]


def _text_width(text: str) -> int:
    """Return the places that a text takes on a line: two for a Chinese, Japanese or Korean sign."""
    if text.isascii():
        return len(text)
    from rich.cells import cell_len

    return cell_len(text)


def print_reasons(choices: Iterable[Mapping[str, str]]) -> None:
    """Print choices, each with its path, value and reason why: a table on a terminal, else a line each."""
    if sys.stdout.isatty():
        print_table(text_table(["choice", "value", "because"], (choice.values() for choice in choices)))
        return
    for choice in choices:
        typer.echo(f"{choice['path']} = {choice['value']}" + (f"  # {choice['why']}" if choice["why"] else ""))


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
def show_steps(first: str = "") -> Iterator[Callable[[str], None]]:
    """Give a function that takes the step of a long calculation: shown on a terminal, else printed once if long."""
    if sys.stderr.isatty():
        with _open_console(stderr=True).status(first) as status:
            yield lambda step: status.update(escape_unprintable(step))
        return
    last, said = [first], [""]

    def say() -> None:
        if last[0] != said[0]:
            said[0] = last[0]
            sys.stderr.write(f"{escape_unprintable(said[0])}\n")

    with look_repeatedly(say, SILENCE):
        yield lambda step: last.__setitem__(0, step)


@contextmanager
def look_repeatedly(look: Callable[[], None], every: float) -> Iterator[None]:
    """Call a function every so many seconds, in a thread beside the block, until what it prints cannot be written."""
    from threading import Event, Thread

    ended = Event()

    def go() -> None:
        with suppress(OSError):  # the block ends the process where it cannot print either
            while not ended.wait(every):
                look()

    thread = Thread(target=go, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


class PlainLines:
    """Plain lines of a run: after a silence, how far the searches are, if that is new."""

    def __init__(self, watch: Watch) -> None:
        self.watch = watch
        self.last = time.monotonic()
        self.words = ""

    def say(self, line: str) -> None:
        """Print a line."""
        typer.echo(escape_unprintable(line))
        self.last = time.monotonic()

    def look(self) -> None:
        """Print the search that moved last, if it is time to."""
        if time.monotonic() - self.last >= SILENCE and (searches := self.watch.look()):
            more = f" ({len(searches)} searches are running)" if len(searches) > 1 else ""
            words = f"... {searches[0].words}{more}"
            if words != self.words:
                self.words = words
                self.say(words)


def draw_events(events: Iterable[Event], watch: Watch) -> Event | None:
    """Show the events of a run: live progress on a terminal, else one plain line per finished cell. Return the last.

    watch : what says how far searches are, so that there is news within long cells, too.
    """
    from shipid.answer.start import event_line

    event = None
    if not sys.stdout.isatty():
        quiet = PlainLines(watch)
        with look_repeatedly(quiet.look, min(SILENCE, 5.0)):
            for event in events:
                line = event_line(event)
                if line:
                    quiet.say(line)
        return event
    from rich.markup import escape
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    best: dict[str, Any] = {}
    worst: dict[str, Any] = {}
    progress = Progress(*columns, console=_open_console(), refresh_per_second=2)  # drawing takes time from workers
    task, inner = progress.add_task("cells", total=None), progress.add_task("", total=None, visible=False)

    def look() -> None:
        searches = watch.look()
        progress.update(inner, visible=bool(searches))
        if searches:
            text = escape(escape_unprintable(searches[0].words))
            progress.update(inner, description=text, completed=searches[0].done, total=searches[0].count)

    with progress, look_repeatedly(look, LOOK):
        for event in events:
            if event.kind == "note":
                progress.console.print(escape_unprintable(event.text), markup=False, highlight=False)
            elif event.kind == "start":
                progress.update(task, total=event.total, completed=event.done)
            elif event.kind == "cell":
                row = event.row
                if row["status"] == "ok":
                    best = min((best or row, row), key=lambda r: r["H"])
                    worst = max((worst or row, row), key=lambda r: r["H"])
                label = (
                    f"best {best['cell']} {length_text(best['H'])} m, worst {worst['cell']} {length_text(worst['H'])} m"
                    if best
                    else "cells"
                )
                progress.update(task, completed=event.done, description=label)
    return event


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
