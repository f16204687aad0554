"""Journals of searches: the trials of a unit of work in a file, from which a search that was interrupted goes on.

One process writes a journal, a line for each trial that has ended, with a checksum and the digest of its plan. A last
line that a killed process left half written is cut off when the file is opened again.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from shipid.errors import ResultError

Entry = dict[str, Any] | int
REMEDY = "take the journal away, and searches that were interrupted begin again"


class Journal:
    """Searches by cell, and what writes them down; one process writes those of a file.

    Parameters
    ----------
    content : lines that are there already. ResultError where they are none, or not as they were written.
    write : called with further lines, whole ones. What it raises ends the search.
    study : digest of the plan that the searches belong to: those of another are refused. Empty for any.
    file : where the lines are, for messages.
    """

    def __init__(
        self, content: bytes, write: Callable[[bytes], object], study: str = "", file: Path | None = None
    ) -> None:
        self.write, self.digest = write, study
        self._entries: dict[str, list[Entry]] = {}
        try:
            entries = read_entries(content)
        except ValueError:
            raise ResultError(f"damaged: no journal of trials, or not as written; {REMEDY}", file=file) from None
        for digest, cell, entry in entries:
            if study and digest != study:
                raise ResultError(f"the trials of {cell} are of another study; {REMEDY}", file=file)
            self._entries.setdefault(cell, []).append(entry)

    def rows(self, cell: str) -> list[dict[str, Any]]:
        """Return the trials of a search that ended, in order, each once."""
        rows: list[dict[str, Any]] = []
        for entry in self._entries.get(cell, []):
            if isinstance(entry, dict) and entry["number"] == len(rows):  # not one that came twice
                rows.append(entry)
        return rows

    def count(self, cell: str) -> int | None:
        """Return how many trials the budget of a search allowed; None before that is decided."""
        return next((entry for entry in self._entries.get(cell, []) if isinstance(entry, int)), None)

    def add(self, entries: Mapping[str, Sequence[Entry]]) -> None:
        """Append to searches: cell -> trials, each with the next number, or how many there will be."""
        lines = []
        for cell, several in entries.items():
            self._entries.setdefault(cell, []).extend(several)
            for entry in several:
                text = json.dumps([self.digest, cell, entry]).encode()
                lines.append(b"%08x %b\n" % (zlib.crc32(text), text))
        self.write(b"".join(lines))


def open_journal(file: Path, check: Callable[[], object] = lambda: None, study: str = "") -> Journal:
    """A journal in a file, which is made where there is none; a last line that is not whole is cut off.

    check : called before each write; what it raises, where this process may not write any more, ends the search.
    """
    return Journal(whole_lines(file), partial(append_lines, file, check), study, file)


def whole_lines(file: Path) -> bytes:
    """Lines of a journal, none where there is no file; a last one that is not whole is cut off it."""
    content = file.read_bytes() if file.exists() else b""
    whole = content[: content.rfind(b"\n") + 1]
    if whole != content:
        os.truncate(file, len(whole))  # a kill leaves one or the other
    return whole


def append_lines(file: Path, check: Callable[[], object], lines: bytes) -> None:
    """Append lines to a journal, if a check lets them."""
    check()
    with open(file, "ab") as stream:
        stream.write(lines)


def read_entries(content: bytes) -> list[tuple[str, str, Entry]]:
    """Digest of the plan, cell, and trial or number of trials of each whole line; ValueError where one is damaged."""
    entries = []
    for line in content.split(b"\n")[:-1]:
        checksum, text = line.split(b" ", 1)
        if int(checksum, 16) != zlib.crc32(text):
            raise ValueError("not as written")
        entries.append(json.loads(text))
    return entries
