"""Options that several commands share, and how their text is read."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from shipid.errors import DocumentError, ShipidError

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
