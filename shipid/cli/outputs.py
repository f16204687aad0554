"""What every command refuses before it begins, such as to write over what it reads."""

from __future__ import annotations

import os
from collections.abc import Iterable
from math import isfinite
from pathlib import Path
from typing import Any

import typer
import typer.core

from shipid.errors import ShipidError
from shipid.files import TABLES
from shipid.interrupts import raise_interrupts

OUTPUTS: dict[str, tuple[str, ...]] = {"out": (), "csv": TABLES, "html": (".html",), "log": (".parquet",)}
"""Name of an option that says what to write -> how such a file may end, if that is the same in all commands."""
RESULTS = ("study.toml", "provenance.json")
"""Files that a folder of results has."""


class GuardedCommand(typer.core.TyperCommand):
    """A command that refuses numbers that are not finite, and a file named to be read and written, or written twice."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; an error of compiled code that Ctrl-C became is KeyboardInterrupt again."""
        read: list[Path] = []
        written: dict[str, Path] = {}
        for one in self.params:
            value = ctx.params.get(one.name)
            values = value if isinstance(value, list | tuple) else [value]
            if odd := [number for number in values if isinstance(number, float) and not isfinite(number)]:
                path = one.opts[0] if one.param_type_name == "option" else str(one.name).upper()
                raise ShipidError(f"{odd[0]:g}: must be a finite number", path=path)
            if one.name in OUTPUTS and one.param_type_name == "option" and value:
                written[one.name] = Path(value)
            else:
                read += [Path(one) for one in values if isinstance(one, Path | str) and os.path.isfile(one)]
        for name, file in written.items():
            check_output(file, read, OUTPUTS[name], f"--{name}")
            read.append(file)
        with raise_interrupts():
            return super().invoke(ctx)


def check_output(file: Path, read: Iterable[Path] = (), endings: tuple[str, ...] = (), option: str = "--out") -> Path:
    """Return a file to write; ShipidError where it has another ending, is read, or cannot be there.

    A TOML document that exists is not written over.
    """
    fault, named = None, file
    folder = next(one for one in (file.absolute(), *file.absolute().parents) if one.exists())
    if endings and file.suffix not in endings:
        fault = f"let the name end in {' or '.join(endings)}"
    elif any(os.path.realpath(file) == os.path.realpath(one) for one in read):
        fault = "is named twice, and would be written over: name another file to write"
    elif endings == (".toml",) and file.exists():
        fault = "exists already and is not written over: name another file to write"
    elif file.exists() and not (file.is_file() or file.is_dir()):
        fault = "is a device or a pipe: name a file to write"
    elif folder.is_file() and folder != file.absolute():
        fault, named = "is a file, not a folder: name another place to write", folder
    elif not os.access(folder.parent if folder.is_file() else folder, os.W_OK | os.X_OK):
        fault = "is in a folder that this user may not write into: name another place to write"
    elif file.is_file() and any(all((one / name).is_file() for name in RESULTS) for one in file.absolute().parents):
        fault = "belongs to the results of a study, and would be written over: name another file to write"
    if fault is not None:
        raise ShipidError(fault, file=named, path=option)
    return file
