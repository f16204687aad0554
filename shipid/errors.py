"""Errors that a user can correct; each is a line with file, path, problem and remedy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import partial
from os import PathLike

LONGEST = 500  # characters of one part of a message
NEAR_NAME = 0.85  # similarity (difflib) from which on a retired name is a valid one, mistyped: `units` for `unit`
_DRAFTED = "no option now: write the number into the drafted vessel"
RETIRED = {
    **dict.fromkeys(("path-drawn", "path-refined"), "it is retired, take kernel"),
    **dict.fromkeys(("units", "budget", "choose", "averaged"), "a key of former methods: delete it"),
    "resample": "it is retired: write `step` and `max_gap` into [clock]",
    "kaimal": "it is retired, take npd",
    "harmonics": "it is retired, with signal and period: levels are random",
    "station_keeping": "it is retired, and nothing takes its place",
    "dof": "this is a vessel: `shipid study new --vessel FILE` writes a study of it",
    "join": "it is retired: give both mappings one [origin], and join the tables with pandas",
    "rotate": 'it is retired: write [repeat] "split.test" into the study',
    "variants": "it is retired: factors and A are in the report of a run",
    "schema": "it is retired: errors name the valid keys",
    "ships": "it is retired: `docs/exchange_ships.py` of the source makes the cells of the law",
    "--manoeuvres": "it is retired: `shipid study new --vessel FILE` writes a study of it, which `simulate` takes",
    "--step": "it is retired: a manoeuvre takes 1/500 of the time for a ship length",
    "--leave": "it is retired: take `study prepare` and `study run --shard i/n`",
    **dict.fromkeys(("--rudder-span", "--rudder-rate", "--density", "--frontal-area", "--lateral-area"), _DRAFTED),
}
"""Kinds, keys, commands and options that went, or that belong to another document -> what to do instead."""


class ShipidError(Exception):
    """An error that the user can correct: what is wrong and what would be right, in one sentence.

    file : the document or log. path : dotted path, column or row in it. others : more errors of it, a line each.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | PathLike[str] | None = None,
        path: str | None = None,
        others: Iterable[ShipidError] = (),
    ) -> None:
        super().__init__(message)
        self.message = str(message)  # of a user it may be another error
        self.file = None if file is None else str(file)
        self.path = path
        self.others = tuple(others)

    def __str__(self) -> str:
        parts = [part for part in (self.file, self.path, self.message) if part]
        line = ": ".join(shorten_line(part) for part in parts)
        return "\n".join([line, *map(str, self.others)])

    def __reduce__(self) -> tuple[object, ...]:  # errors of worker processes are pickled
        return partial(type(self), file=self.file, path=self.path, others=self.others), (self.message,)


class DocumentError(ShipidError):
    """A TOML document (vessel, study, mapping, patch) that is invalid."""


class DivergenceError(DocumentError):
    """A model of a study whose prediction diverges; another integrator, a smaller step or a milder family may not."""


class DataError(ShipidError):
    """A log or dataset that does not agree with its mapping or schema."""


class ResultError(ShipidError):
    """A results folder or a saved predictor that is missing, foreign or damaged."""


@contextmanager
def placed_errors(
    kind: type[ShipidError],
    *,
    file: str | PathLike[str] | None = None,
    path: str | Callable[[str], str] | None = None,
    into: type[ShipidError] | None = None,
) -> Iterator[None]:
    """Say where errors of a kind in the block are.

    file : for those that name none. path : another, or what makes it of theirs; it is in `file`, whatever they name.
    into : another kind.
    """
    try:
        yield
    except kind as error:
        place = (path(error.path or "") or None) if callable(path) else path or error.path
        raise (into or type(error))(error.message, file=file if path else error.file or file, path=place) from None


def is_utf_8(text: str) -> bool:
    """Whether a name that the system gave is UTF-8 throughout: Python keeps other bytes as lone surrogates."""
    return not any("\ud800" <= sign <= "\udfff" for sign in text)


def escape_unprintable(text: str) -> str:
    """The text with characters that could control a terminal written out; ends of lines stay."""
    return "".join(
        sign if sign.isprintable() or sign == "\n" else sign.encode("unicode_escape").decode() for sign in text
    )


def shorten_line(text: str) -> str:
    """The text as one line of printable characters, shortened: contents of a file must not flood a terminal."""
    shown = escape_unprintable(" ".join(text.split()))
    return shown if len(shown) <= LONGEST else f"{shown[: LONGEST // 2]} ... {shown[-LONGEST // 2 :]}"


def suggest_name(value: object, valid: Iterable[str], limit: int = 12) -> str:
    """Hint for an invalid name: what to do for a retired one, `did you mean 'x'?`, or the first `limit` valid names."""
    names = sorted(valid)
    same = [name for name in names if name.casefold() == str(value).casefold()]
    close = same or get_close_matches(str(value), names, n=1, cutoff=NEAR_NAME)
    if not close and str(value) in RETIRED:
        return RETIRED[str(value)]
    close = close or get_close_matches(str(value), names, n=1)
    if close:
        return f"did you mean {close[0]!r}?"
    shown = ", ".join(names[:limit]) + (", ..." if len(names) > limit else "")
    return f"valid: {shown}" if names else "nothing is defined there"
