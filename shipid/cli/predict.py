"""`shipid predict`, `aboard` and `export`: use the predictor of a cell on a log, or write it for others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

import shipid
from shipid.cli.options import Adaptive, Folder, Kind, Level, check_band, check_output, command_line
from shipid.errors import DocumentError, ShipidError
from shipid.files import TABLES
from shipid.units import percent_text


def predict_command(
    folder: Folder,
    log: Annotated[Path, typer.Argument(help="dataset (Parquet), or a raw log with --mapping")],
    cell: Annotated[str, typer.Option(help="cell whose predictor to use; see results.parquet")],
    mapping: Annotated[str | None, typer.Option(help="mapping of a raw log")] = None,
    out: Annotated[Path | None, typer.Option(help="file to write: .parquet or .csv; default: <cell>.parquet")] = None,
    level: Level = None,
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
        frame.attrs["errors"],
        *frame.attrs["limits"],
        frame.attrs["coarse"],
        frame.attrs["gaps"] and f"{frame.attrs['gaps']}: a past over one of them is interpolated",
        outside
        and f"{percent_text(outside)} of the instants lie outside what the cell was trained on (column "
        f"`outside`){'' if level is None else ': no band is promised there'}",
    ]
    for note in filter(None, notes):
        typer.echo(note)


def aboard_command(
    log: Annotated[Path, typer.Argument(help="dataset (Parquet), or a raw log with --mapping")],
    predictor: Annotated[Path, typer.Option("--predictor", help="a cell, FOLDER/cells/NAME.npz")],
    mapping: Annotated[str | None, typer.Option(help="mapping of a raw log")] = None,
    every: Annotated[
        float | None, typer.Option(help="seconds between predictions; default the predictor's step")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="table of every point: .parquet or .csv")] = None,
    html: Annotated[Path | None, typer.Option(help="page to write, with plots")] = None,
    level: Level = None,
    kind: Kind = None,
    adaptive: Adaptive = None,
) -> None:
    """Play a log as if at sea: every instant uses the past alone. Show what an officer would have seen."""
    from shipid.study.aboard import play_aboard, replay_summary, write_replay_points

    check_band(level, kind, adaptive)
    played = play_aboard(predictor, log, mapping, every, level=level, kind=kind, rate=adaptive)
    lines = replay_summary(played)
    typer.echo("\n".join(line.text for line in lines))
    if out is not None:
        write_replay_points(played, out)
        typer.echo(f"{len(played.points)} points -> {out}")
    if html is not None:
        from shipid.report.aboard import AboardContent, write_aboard

        content = AboardContent(
            title=f"{log.stem}, played as if at sea",
            name=predictor.stem,
            lines=lines,
            instants=played.instants,
            points=played.points,
            track=played.track,
            provenance={"Log": str(log), "Predictor": str(predictor), "shipid": shipid.__version__},
            command=command_line(),
        )
        typer.echo(f"page -> {write_aboard(content, html)}")


def export_command(
    what: Annotated[
        str, typer.Argument(help="a cell, FOLDER/cells/NAME.npz, or a vessel: a document or a bundled name")
    ],
    to: Annotated[str, typer.Option("--to", help="c, fmu, casadi or onnx")],
    out: Annotated[Path, typer.Option("--out", help="the folder for c, else the file to write")],
    single: Annotated[bool, typer.Option("--single", help="single precision (onnx)")] = False,
    integrator: Annotated[
        Literal["rk4", "euler"] | None, typer.Option(help="of a vessel's step", show_default="rk4")
    ] = None,
    name: Annotated[str | None, typer.Option(help="name in the source; default from --out")] = None,
) -> None:
    """Write a predictor, or a vessel alone, as C99, FMU, CasADi function or ONNX."""
    from shipid.document import bundled_documents
    from shipid.export.write import EXAMPLE_FILE, export_predictor, export_vessel
    from shipid.study.store import read_predictor

    if what.endswith(".npz") or (what not in bundled_documents("models") and Path(what).is_dir()):
        if integrator is not None:
            raise DocumentError("a predictor keeps that of its study: leave it out", path="--integrator")
        written = export_predictor(read_predictor(Path(what)), to, out, single=single, name=name)
    else:
        if single:
            raise DocumentError("a vessel is always in double precision: leave it out", path="--single")
        written = export_vessel(shipid.load_vessel(what), to, out, integrator=integrator or "rk4", name=name)
    for file in written:
        typer.echo(f"{file} ({file.stat().st_size / 1000:.0f} kB)")
    if to == "c" and out / EXAMPLE_FILE not in written:
        typer.echo(f"{out / EXAMPLE_FILE} is there already and is kept; without it, an example is written")
