"""What every command refuses before it begins, such as to write over what it reads."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from math import isfinite
from pathlib import Path
from typing import Any

import typer
import typer.core

from shipid.errors import ShipidError
from shipid.interrupts import raise_interrupts

OUTPUTS = ("out", "csv", "html", "log")
"""Names of options that say what to write."""
ENDINGS = {".parquet": "a dataset is a Parquet file", ".html": "a page is an HTML file"}
"""Ending -> what is written to such a file."""
RESULTS = ("study.toml", "provenance.json")
"""Files that a folder of results has."""


class GuardedCommand(typer.core.TyperCommand):
    """A command that refuses numbers that are not finite, and a file named to be read and written, or written twice."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; ShipidError for a number that is not finite, or for a file that must not be written.

        An error of compiled code that Ctrl-C became is KeyboardInterrupt again.
        """
        for one in self.params:
            values = ctx.params.get(one.name)
            for value in values if isinstance(values, list | tuple) else [values]:
                if isinstance(value, float) and not isfinite(value):
                    path = one.opts[0] if one.param_type_name == "option" else one.name.upper()
                    raise ShipidError(f"{value:g}: must be a finite number", path=path)
        options = {one.name for one in self.params if one.param_type_name == "option"}
        written = {name: value for name, value in ctx.params.items() if name in OUTPUTS and name in options and value}
        read = [one for name, value in ctx.params.items() if name not in written for one in _existing_files(value)]
        for name, value in written.items():
            check_output(Path(value), read, f"--{name}")
            read.append(Path(value))
        with raise_interrupts():
            return super().invoke(ctx)


def check_output(file: Path, read: Iterable[Path], option: str) -> None:
    """Raise ShipidError where a file to write is one of those that are read, is no file, or cannot be there."""
    if any(_is_same_file(file, one) for one in read):
        message = "is named twice, and would be written over: name another file to write"
        raise ShipidError(message, file=file, path=option)
    if file.exists() and not (file.is_file() or file.is_dir()):
        raise ShipidError("is a device or a pipe: name a file to write", file=file, path=option)
    folder = next(one for one in (file.absolute(), *file.absolute().parents) if one.exists())
    if folder.is_file() and folder != file.absolute():
        raise ShipidError("is a file, not a folder: name another place to write", file=folder, path=option)
    if not os.access(folder.parent if folder.is_file() else folder, os.W_OK | os.X_OK):
        message = "is in a folder that this user may not write into: name another place to write"
        raise ShipidError(message, file=file, path=option)
    if file.is_file() and (results := results_folder(file)) is not None:
        message = f"belongs to the results in {results}, and would be written over: name another file to write"
        raise ShipidError(message, file=file, path=option)


def check_ending(file: Path | None, ending: str) -> None:
    """Raise ShipidError for the name of a dataset or page that does not end so; None: nothing is written."""
    if file is not None and file.suffix != ending:
        raise ShipidError(f"{ENDINGS[ending]}: let the name end in {ending}", file=file)


def results_folder(file: Path) -> Path | None:
    """The folder of results that a file belongs to, if it does."""
    return next((one for one in file.absolute().parents if all((one / name).is_file() for name in RESULTS)), None)


def _existing_files(value: Any) -> Iterator[Path]:
    """Files that exist among the values of a parameter."""
    for one in value if isinstance(value, list | tuple) else [value]:
        if isinstance(one, Path | str) and one and len(str(one)) < 4096 and "\0" not in str(one):
            try:
                if Path(one).is_file():
                    yield Path(one)
            except OSError:  # no name of a file
                continue


def _is_same_file(one: Path, other: Path) -> bool:
    try:
        return one.resolve() == other.resolve() or one.samefile(other)
    except (OSError, RuntimeError):  # not there, or a link to itself
        return False
