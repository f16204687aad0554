"""`shipid predict`: use the predictor of a cell on a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shipid.cli.options import Adaptive, Folder, Kind, check_band
from shipid.cli.outputs import check_output
from shipid.errors import ShipidError
from shipid.files import TABLES
from shipid.units import percent_text


def predict_command(
    folder: Folder,
    log: Annotated[Path, typer.Argument(help="dataset (Parquet), or a raw log with --mapping")],
    cell: Annotated[str, typer.Option(help="cell whose predictor to use; see results.parquet")],
    mapping: Annotated[str | None, typer.Option(help="mapping of a raw log")] = None,
    out: Annotated[Path | None, typer.Option(help="file to write: .parquet or .csv; default: <cell>.parquet")] = None,
    level: Annotated[
        float | None, typer.Option(help="share of whole paths that a band is to hold, such as 0.9: adds its columns")
    ] = None,
    kind: Kind = None,
    adaptive: Adaptive = None,
) -> None:
    """Write physics and cooperative paths in north-east for every instant of a log."""
    from shipid.study.apply import predict_log

    if not cell:
        raise ShipidError("is empty: name a cell, as results.parquet does", path="--cell")
    check_band(level, kind, adaptive)
    file = check_output(out or Path(f"{cell}.parquet"), [log], TABLES)
    frame, outside = predict_log(folder, cell, log, mapping, file, level=level, kind=kind, rate=adaptive)
    typer.echo(f"{frame.groupby(['run', 't']).ngroups} instants, {len(frame)} points -> {file}")
    notes = [
        frame.attrs["coarse"],
        frame.attrs["gaps"] and f"{frame.attrs['gaps']}: a past over one of them is interpolated",
        outside
        and f"{percent_text(outside)} of the instants lie outside what the cell was trained on (column "
        f"`outside`){'' if level is None else ': no band is promised there'}",
    ]
    for note in filter(None, notes):
        typer.echo(note)
