"""Options that several commands share, how their text is read, and what every command refuses before it begins."""

from __future__ import annotations

import os
import re
import shlex
import sys
from collections.abc import Iterable
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer
import typer.core

from shipid.errors import DocumentError, ShipidError
from shipid.files import TABLES
from shipid.interrupts import raise_interrupts

HIGHEST = 0.99  # level of the bands of a predictor; `shipid.hybrid.bands.LEVELS` ends there
VesselName = Annotated[
    str,
    typer.Argument(help="bundled name, or path of a vessel or patch document"),
]
StudyName = Annotated[str, typer.Argument(help="bundled study or path of one")]
MappingName = Annotated[str, typer.Argument(help="bundled mapping or path of one")]
Folder = Annotated[Path, typer.Argument(help="folder of a run, such as results/quick-1a2b3c4d")]
Changes = Annotated[list[str] | None, typer.Option("--set", help="path=value: change the study, such as grid.N_D=[10]")]
Workers = Annotated[int | None, typer.Option(min=0, help="processes, 0 for this one; default one per core")]
Scheduler = Annotated[str | None, typer.Option(help="address of a Dask scheduler to use instead")]
Trust = Annotated[bool, typer.Option("--trust", help="run code that the study names, such as that of a function")]
Device = Annotated[str, typer.Option(help="PyTorch device: cpu or cuda")]


def parse_changes(changes: list[str] | None) -> dict[str, Any]:
    """Return path -> value of `--set path=value`; a value is read as TOML, or taken as text."""
    return parse_assignments(changes or [], "--set", "--set path=value, such as --set grid.N_D=[10,30]", text=True)


def parse_assignments(given: list[str], option: str, example: str, *, text: bool = False) -> dict[str, Any]:
    """Return path -> value of `path=value` texts, the value TOML, or also text; paths may hold a comparison."""
    from shipid.document import check_values, parse_toml

    result: dict[str, Any] = {}
    for pair in given:
        path, *values = re.split("(?<![<>=])=(?!=)", pair, maxsplit=1)  # not the sign of a comparison
        words = "".join(values)
        try:
            value = parse_toml(f"value = {words}")["value"]
        except DocumentError:
            value = words if text and values else None
        if not path.strip() or value is None:
            raise DocumentError(f"{pair!r}: write {example}", path=option)
        result[path.strip()] = value
    check_values(result, option)
    return result


Kind = Annotated[str | None, typer.Option(help="kind of manoeuvre under way: its band, such as zigzag")]
Level = Annotated[
    float | None,
    typer.Option(min=0.001, max=HIGHEST, help="share of whole paths that a band is to hold, such as 0.9: shows it"),
]
Adaptive = Annotated[
    float | None,
    typer.Option(min=1e-6, max=1, help="rate at which the band adapts along each run, such as 0.02; default: none"),
]


def check_band(level: float | None, kind: str | None, adaptive: float | None) -> None:
    """Raise ShipidError where --kind or --adaptive come without --level."""
    if level is None and (kind is not None or adaptive is not None):
        raise ShipidError("goes with a band: give --level too, such as --level 0.9", path="--kind or --adaptive")


def document_stem(name: str | Path) -> str:
    """Return the name of a document or dataset without folder and ending; a dot in a vessel's name is no ending."""
    return Path(name).name.removesuffix(".toml").removesuffix(".parquet")


def command_line() -> str:
    """Return the command that is running, as one would type it again."""
    return shlex.join(["shipid", *sys.argv[1:]])


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
