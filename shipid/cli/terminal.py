"""Tables, progress and numbers as lines of text."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress

import typer

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
