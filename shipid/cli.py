"""The command line: arguments to calls, events to lines; no logic. Heavy imports wait until a command needs them."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shipid.errors import DocumentError, ShipidError

if TYPE_CHECKING:
    from pandas import DataFrame
    from rich.table import Table

    from shipid.data.dataset import Dataset
    from shipid.identification.outcome import Identified
    from shipid.measures.record import Record
    from shipid.report import ReportContent
    from shipid.report.identification import IdentificationContent
    from shipid.report.manoeuvre import ManoeuvreContent
    from shipid.simulation.standard import Standard
    from shipid.study.results import Results
    from shipid.study.run import Event
    from shipid.vessel.load import Vessel

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="How good must the physics be, and how much data is needed, to predict a ship's trajectory?",
)
vessel_app = typer.Typer(no_args_is_help=True, help="Vessels: declared ships, bundled or your own.")
data_app = typer.Typer(no_args_is_help=True, help="Data: import, check and fetch logs of sea trials.")
study_app = typer.Typer(no_args_is_help=True, help="Studies: questions, run and answered.")
app.add_typer(vessel_app, name="vessel")
app.add_typer(data_app, name="data")
app.add_typer(study_app, name="study")

Folder = Annotated[Path, typer.Argument(help="folder of a run, such as results/quick-1a2b3c4d")]
Changes = Annotated[list[str] | None, typer.Option("--set", help="path=value: change the study, such as grid.N_D=[10]")]
Workers = Annotated[int | None, typer.Option(min=1, help="processes; default one per core")]
Scheduler = Annotated[str | None, typer.Option(help="address of a Dask scheduler to use instead")]
Device = Annotated[str, typer.Option(help="PyTorch device: cpu or cuda")]


def main() -> None:
    """Entry point: what the user can mend is one line, never a traceback."""
    try:
        app()
    except ShipidError as error:
        sys.stderr.write(f"error: {error}\n")
        sys.exit(1)
    except BrokenPipeError:
        sys.exit(141)
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.exit(130)
    except OSError as error:  # a full disk, a folder that is a file, a place where one may not write
        sys.stderr.write(f"error: {error.filename or 'system'}: {error.strerror or error}\n")
        sys.exit(1)


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="show the version")] = False) -> None:
    if version:
        from shipid import __version__

        typer.echo(__version__)
        raise typer.Exit


@vessel_app.command("list")
def vessel_list() -> None:
    """List the bundled vessels."""
    from shipid.document import bundled, read

    _print(_table(["name", "vessel"], ((name, read(file)["name"]) for name, file in bundled("models").items())))


@vessel_app.command("show")
def vessel_show(
    vessel: Annotated[str, typer.Argument(help="bundled name, or path of a vessel or patch document")] = "",
    schema: Annotated[
        bool, typer.Option("--schema", help="print the JSON schema of vessel documents for editors")
    ] = False,
) -> None:
    """Show particulars, terms, and every parameter with its dotted path and unit."""
    if schema:
        import json

        from shipid.vessel.schema import vessel_model

        typer.echo(json.dumps(vessel_model().model_json_schema(), indent=1))
        return
    if not vessel:
        raise ShipidError("name a vessel (see `shipid vessel list`), or ask for --schema")
    from shipid.vessel.load import load_vessel
    from shipid.vessel.schema import PARTICULARS, term_blocks

    found = load_vessel(vessel)
    document = found.document
    typer.echo(
        "\n".join(filter(None, [found.name, document.get("description"), f"file {found.file}, digest {found.digest}"]))
    )
    particulars = document.get("particulars", {})
    typer.echo(
        "particulars: " + ", ".join(f"{k} {particulars[k]:g} {u}" for k, u in PARTICULARS.items() if k in particulars)
    )
    fallback = document.get("source", "")
    rows = [
        (path, key.split(".")[1] + (", off" if off else ""), block.get("source") or fallback)
        for off in (False, True)
        for path, key, block in term_blocks(document, off)
    ]
    _print(_table(["term", "kind", "source"], rows))
    for path, _, block in term_blocks(document):
        if "table" in block:
            omega, beta = block["table"]["omega"], block["table"]["beta_deg"]
            typer.echo(f"{path}: {min(omega):g} to {max(omega):g} rad/s, {len(set(beta))} headings from 0 to 180 deg")
    _print(_table(["parameter", "value", "unit"], _parameter_rows(found.parameters, found.units)))


@vessel_app.command("new")
def vessel_new(
    length: Annotated[float, typer.Option(help="m, between perpendiculars")],
    beam: Annotated[float, typer.Option(help="m")],
    draught: Annotated[float, typer.Option(help="m")],
    block: Annotated[float, typer.Option(help="block coefficient")],
    out: Annotated[Path, typer.Option(help="TOML file to write; one that is there stays as it is")],
    speed: Annotated[float | None, typer.Option(help="m/s, in service; default: a Froude number of 0.2")] = None,
    propulsor: Annotated[str, typer.Option(help="propeller-rudder or azimuth (two units)")] = "propeller-rudder",
    ship_type: Annotated[str, typer.Option(help="for the wind: cargo, tanker, research, ...")] = "cargo",
    frontal_area: Annotated[float | None, typer.Option(help="m^2, to the wind; default: a guess")] = None,
    lateral_area: Annotated[float | None, typer.Option(help="m^2, to the wind; default: a guess")] = None,
    name: Annotated[str | None, typer.Option(help="for people; default: first guess and length")] = None,
) -> None:
    """Write a first guess of a vessel from its main particulars: runnable, each number with its formula."""
    if out.suffix != ".toml":
        raise ShipidError("a vessel is a TOML file: let the name end in .toml", file=out)
    if out.exists():
        raise ShipidError("is there already: choose another name", file=out)
    from shipid.vessel.template import Particulars, first_guess

    given = Particulars(length, beam, draught, block, speed, propulsor, ship_type, frontal_area, lateral_area)
    found = first_guess(given, name or f"First guess, {length:g} m", str(out))
    out.write_text(found.text, encoding="utf-8")
    typer.echo(f"{len(found.vessel.parameters)} parameters by formula, none of them measured -> {out}")
    typer.echo(f"{60 * found.n:.4g} rpm hold {given.service:.3g} m/s")
    if found.growth < 0:
        typer.echo("course-stable by these formulae")
    else:
        typer.echo(f"course-UNSTABLE by these formulae: a small yaw grows e-fold in {1 / found.growth:.3g} s")


@app.command("simulate")
def simulate(
    study: Annotated[str, typer.Argument(help="bundled name or path of a study with a [truth]")],
    out: Annotated[Path | None, typer.Option(help="Parquet file to write; default: <study>.parquet beside you")] = None,
    changes: Changes = None,
) -> None:
    """Simulate the truth of a study into a dataset, and show its envelope beside the published one."""
    from shipid.data.dataset import write_dataset
    from shipid.study.envelope import envelope, envelope_table
    from shipid.study.plan import read_plan
    from shipid.study.prepare import obtain, partition

    if out is not None and out.suffix != ".parquet":
        raise ShipidError("a dataset is a Parquet file: let the name end in .parquet", file=out)
    plan = read_plan(study, _parsed(changes))
    if plan.truth is None:
        raise DocumentError("has no [truth]: its runs are recorded", file=plan.file)
    dataset = obtain(plan)
    pool, test, _ = partition(plan, dataset)
    found = envelope_table(envelope(plan, pool, test, dataset.commands), plan.study.published)
    units = dict(zip(found["quantity"], found["unit"], strict=True))
    rows = [
        [str(name), *(_limits(part[part["quantity"] == quantity]) for quantity in units)]
        for name, part in found.groupby("set", sort=False)
    ]
    file = write_dataset(dataset, out or Path(f"{plan.name}.parquet"))
    typer.echo(f"{len(dataset.runs)} runs, {len(dataset.frame)} rows -> {file}")
    typer.echo("least / mean / greatest at the instants of prediction:")
    _print(_table(["set", *(f"{quantity} [{unit}]" for quantity, unit in units.items())], rows))


def _limits(row: Any) -> str:
    return " / ".join(f"{row[name].iloc[0]:.1f}" for name in ("min", "mean", "max")) if len(row) else ""


@data_app.command("fetch")
def data_fetch(name: Annotated[str, typer.Argument(help="a public log, such as gunnerus-2022")]) -> None:
    """Get a public log by URL and checksum, or take it from the folder SHIPID_DATA."""
    from shipid.logs.catalogue import fetch

    typer.echo(str(fetch(name)))


@data_app.command("import")
def data_import(
    mapping: Annotated[str, typer.Argument(help="bundled mapping or path of one")] = "",
    log: Annotated[Path | None, typer.Argument(help="raw log; default: the public original of the mapping")] = None,
    out: Annotated[
        Path | None, typer.Option(help="file to write, .parquet (with --guess .toml); default: beside you")
    ] = None,
    without: Annotated[list[str] | None, typer.Option(help="repair to leave out, such as heading_offset")] = None,
    guess: Annotated[Path | None, typer.Option(help="draft a mapping of this log instead of importing it")] = None,
    names: Annotated[str, typer.Option(help="with --guess: names of the columns, a,b,c, of a log without any")] = "",
) -> None:
    """Import a raw log by a declared mapping into a dataset; every repair is counted and flagged."""
    if guess is not None:
        if mapping or log or without:
            raise ShipidError("--guess drafts a mapping of one log: give neither mapping nor repairs", file=guess)
        _draft(guess, tuple(filter(None, names.split(","))), out or Path(f"{guess.stem}.toml"))
        return
    if not mapping:
        raise ShipidError("name a mapping, or draft one with --guess LOG")
    from shipid.data.dataset import write_dataset
    from shipid.logs.catalogue import fetch
    from shipid.logs.importing import import_log
    from shipid.logs.mapping import read_mapping

    if out is not None and out.suffix != ".parquet":
        raise ShipidError("a dataset is a Parquet file: let the name end in .parquet", file=out)
    declared = read_mapping(mapping)
    dataset = import_log(declared, log or fetch(mapping), without=without or ())
    file = write_dataset(dataset, out or Path(f"{Path(mapping).stem}.parquet"))
    repairs = dataset.metadata.get("repairs", [])
    if repairs:
        rows = ((r["kind"], r["column"], str(r["count"]), r["note"]) for r in repairs)
        _print(_table(["repair", "column", "count", "what was done"], rows))
    typer.echo(f"{len(dataset.frame)} rows in {len(dataset.runs)} runs -> {file}")


def _draft(log: Path, names: tuple[str, ...], out: Path) -> None:
    from shipid.files import write_new
    from shipid.logs.guess.columns import guess
    from shipid.logs.guess.draft import draft_mapping

    found = guess(log, names)
    file = write_new(draft_mapping(found), out)
    rows = ((c.name, c.source, c.unit, f"{c.confidence:.0%}", c.evidence) for c in found.columns)
    _print(_table(["column", "from", "unit", "sure", "why"], rows))
    if found.findings:
        _print(_table(["found", "sure", "what"], ((f.kind, f"{f.confidence:.0%}", f.sentence) for f in found.findings)))
    typer.echo(f"draft -> {file}: read it before you import with it")


@data_app.command("segment")
def data_segment(
    mapping: Annotated[str, typer.Argument(help="bundled mapping or path of one")],
    log: Annotated[Path | None, typer.Argument(help="raw log; default: the public original of the mapping")] = None,
    out: Annotated[Path | None, typer.Option(help="TOML file to write; default: beside you")] = None,
) -> None:
    """Find the manoeuvres of a log and write them as segments, to be corrected and put into the mapping."""
    from shipid.files import write_new
    from shipid.logs.catalogue import fetch
    from shipid.logs.guess.draft import moment, segment_log, segments_text
    from shipid.logs.mapping import read_mapping

    declared = read_mapping(mapping)
    unit = declared.clock.unit
    found = segment_log(declared, log or fetch(mapping))
    file = write_new(segments_text(found, unit), out or Path(f"{Path(mapping).stem}-segments.toml"))
    _print(_table(["run", "start", "end"], ((s.run, moment(s.start, unit), moment(s.end, unit)) for s in found)))
    typer.echo(f"{len(found)} segments -> {file}")


@data_app.command("check")
def data_check(
    dataset: Annotated[Path, typer.Argument(help="dataset written by `shipid data import`")],
    html: Annotated[Path | None, typer.Option(help="page to write, with plots of what the checks compare")] = None,
) -> None:
    """Check a dataset: gaps, jitter, ranges, d(psi)/dt against r, velocity against position."""
    from shipid.data.checks import check_dataset
    from shipid.data.dataset import read_dataset

    if html is not None and html.suffix != ".html":
        raise ShipidError("a page is an HTML file: let the name end in .html", file=html)
    log = read_dataset(dataset)
    checks = check_dataset(log)
    if html is not None:
        _check_page(html, dataset.stem, log, checks)
    ok = checks["ok"].astype(bool)
    counts = (
        (str(name), str(len(group)), str(int((~group["ok"].astype(bool)).sum())))
        for name, group in checks.groupby("check", sort=False)
    )
    _print(_table(["check", "runs", "failed"], counts))
    failed = int((~ok).sum())
    if failed:
        rows = ((str(r.run), str(r.check), str(r.sentence)) for r in checks[~ok].itertuples())
        _print(_table(["run", "failed", "what to look at"], rows))
    typer.echo(f"{len(checks) - failed} of {len(checks)} checks passed")
    if failed:
        raise typer.Exit(1)


def _check_page(file: Path, name: str, log: Dataset, checks: Any) -> None:
    import pandas as pd

    from shipid.data.checks import check_series
    from shipid.report.checks import write_checks

    tracks = log.frame[["run", "north", "east"]].assign(set="the log")
    repairs = pd.DataFrame(log.metadata.get("repairs", []), columns=["kind", "column", "count", "note"])
    source = log.metadata.get("source", "")
    words = source if isinstance(source, str) else ", ".join(f"{key} {value}" for key, value in source.items())
    provenance = {"log": words, "vessel": str(log.metadata.get("vessel") or "not said"), "rows": str(len(log.frame))}
    written = write_checks(file, name, checks, check_series(log), tracks, repairs, provenance)
    typer.echo(f"plots: {written}")


@data_app.command("measures")
def data_measures(
    dataset: Annotated[Path, typer.Argument(help="dataset (Parquet)")],
    manoeuvre: Annotated[
        str | None, typer.Option(help="what every run is, such as zigzag or spiral; default: what is recognised")
    ] = None,
    length: Annotated[float | None, typer.Option(help="of the ship between perpendiculars in m, for criteria")] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file of the measures to write")] = None,
) -> None:
    """Measure the standard manoeuvres of a dataset: overshoots, advance, tactical diameter, ..."""
    from shipid.data.dataset import read_dataset
    from shipid.logs.measuring import measure_dataset

    found = measure_dataset(read_dataset(dataset), manoeuvre, length)
    if len(found.measures):
        _print(_measure_table(found.measures.to_dict("records"), ["run", "kind"]))
    if len(found.criteria):
        _print(_criterion_table(found.criteria.to_dict("records"), ["run"]))
    if found.left:
        _print(_table(["run", "not measured, because"], found.left.items()))
    measured = found.measures["run"].nunique() if len(found.measures) else 0
    typer.echo(f"{measured} runs measured, {len(found.left)} not")
    if csv is not None:
        _write_measures(found.measures, csv)


@study_app.command("list")
def study_list() -> None:
    """List the bundled studies."""
    from shipid.document import bundled, read

    _print(_table(["name", "question"], ((name, read(file)["question"]) for name, file in bundled("studies").items())))


@study_app.command("new")
def study_new(
    vessel: Annotated[list[str], typer.Option(help="bundled name, or path of a vessel or patch; may be repeated")],
    data: Annotated[
        Path | None, typer.Option(help="dataset (Parquet) of recorded runs; without it the vessel is simulated")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="TOML file to write; default: <data or vessel>-study.toml beside you")
    ] = None,
) -> None:
    """Write a study of your vessel and runs that runs as it is, each choice with its reason."""
    import shlex

    from shipid.files import check_new, write_new
    from shipid.study.new import draft_study

    file = out or Path(f"{_stem(data or vessel[0])}-study.toml")
    check_new(file, "study")
    draft = draft_study(vessel, data, file)
    write_new(draft.text, file, "study")
    rows = ((choice.path, str(choice.value), choice.why) for choice in draft.choices)
    _print(_table(["choice", "value", "because"], rows))
    for warning in draft.warnings:
        typer.echo(f"warning: {warning}", err=True)
    names = ", ".join(model.name for model in draft.plan.foundations)
    typer.echo(f"{draft.plan.cells} cells of {len(draft.plan.foundations)} foundations ({names}) -> {file}")
    typer.echo(f"run it with: {shlex.join(['shipid', 'study', 'run', str(file)])}")


@study_app.command("variants")
def study_variants(
    study: Annotated[str, typer.Argument(help="bundled study or path of one")],
    save: Annotated[Path | None, typer.Option(help="folder for one patch document per variant")] = None,
    accuracy: Annotated[bool, typer.Option(help="also simulate or import the data, and show A")] = True,
    changes: Changes = None,
) -> None:
    """Show the foundations of a study with their factors and accuracy A; save patches that rebuild them exactly."""
    from shipid.study.plan import read_plan
    from shipid.study.prepare import obtain, prepare

    plan = read_plan(study, _parsed(changes))
    models, scores = plan.foundations, {}
    if accuracy or save is not None:  # what diverges on training windows is redrawn, so a patch needs the data
        prepared = prepare(plan, obtain(plan))
        models = prepared.foundations
        known = [model.name for model in models if model.vessel and model.identify is None]
        scores = {name: prepared.accuracy(name)["mean"] for name in known}
    rows = []
    for model in models:
        if model.identify is not None:
            rows.append((model.name, "-", "-", "identified from the runs of each cell, and so its A"))
            continue
        factors = model.variant.factors if model.variant else {}
        changed = ((path.rsplit(".", 1)[-1], factor) for path, factor in factors.items())
        shown = ", ".join(f"{name} x{factor:.2f}" if factor else f"{name} removed" for name, factor in changed)
        score = scores.get(model.name)
        rows.append((model.name, "-" if score is None else f"{score:.2f}", str(len(factors)), shown))
    _print(_table(["foundation", "A [m]", "changed", "factors"], rows))
    if save is not None:
        from shipid.study.store import write_patches

        typer.echo(f"{write_patches(save, models)} patches -> {save}")


@study_app.command("screen")
def study_screen(
    study: Annotated[str, typer.Argument(help="bundled study or path of one")],
    family: Annotated[str | None, typer.Argument(help="family; default: all that draw factors from a range")] = None,
    members: Annotated[int, typer.Option(min=2, max=100000, help="members of each family")] = 1000,
    out: Annotated[
        Path | None, typer.Option(help="file for a row per member: .csv or .parquet; default: <study>-screen.csv")
    ] = None,
    changes: Changes = None,
    device: Device = "cpu",
) -> None:
    """Show how accurate many members of a study's families are on all its windows, and which factors drive that."""
    from shipid.files import check_table, write_table
    from shipid.hybrid.training import check_device
    from shipid.study import screen
    from shipid.study.plan import read_plan
    from shipid.study.prepare import obtain

    check_device(device)
    plan = read_plan(study, _parsed(changes))
    file = out or Path(f"{plan.name}-screen.csv")
    check_table(file)
    wanted, dataset = screen.families(plan, family), obtain(plan)
    for note in screen.notes(plan, dataset, wanted):
        typer.echo(note, err=True)
    blocks = _counted(screen.screen(plan, dataset, wanted, members, device), members * len(wanted))
    frame = screen.joined(list(blocks))
    write_table(file, frame)
    table = screen.spread(frame)
    shares = [f"{share:.0%}" for share in screen.SHARES]
    rows = [[*map(str, row[:3]), *(f"{value:.2f}" for value in row[3:])] for row in table.itertuples(index=False)]
    typer.echo("accuracy A [m] that so many of the members reach:")
    _print(_table(["family", "members", "diverged", *shares], rows))
    found = screen.drivers(frame)
    typer.echo("what drives A: rank correlation with a factor, and with its distance from 1:")
    pairs = [(str(row.family), str(row.paths), f"{row.factor:+.2f}", f"{row.away:+.2f}") for row in found.itertuples()]
    _print(_table(["family", "parameter", "factor", "distance"], pairs))
    typer.echo(f"{len(frame)} members -> {file}")


@study_app.command("rotate")
def study_rotate(
    study: Annotated[str, typer.Argument(help="bundled study or path of one")],
    tests: Annotated[list[str], typer.Option(help="runs that test in turn, * for any part of a name; may be repeated")],
    out: Annotated[
        Path | None,
        typer.Option(help="file for a row per turn and cell: .csv or .parquet; default: <study>-rotate.csv"),
    ] = None,
    changes: Changes = None,
    device: Device = "cpu",
) -> None:
    """Let every run test in its turn, all others train: how much the answer owes to the choice of the test run."""
    from shipid.files import check_table, write_table
    from shipid.hybrid.training import check_device
    from shipid.study import rotate
    from shipid.study.plan import read_plan
    from shipid.study.prepare import obtain

    check_device(device)
    plan = read_plan(study, _parsed(changes))
    file = out or Path(f"{plan.name}-rotate.csv")
    check_table(file)
    dataset = obtain(plan)
    wanted = rotate.turns(plan, dataset, tests)
    cells = len(wanted) * len(plan.pairs) * len(set(plan.study.grid.seeds))
    import pandas as pd

    frame = pd.concat(list(_counted(rotate.rotate(plan, dataset, wanted, device), cells, "cells")), ignore_index=True)
    write_table(file, frame)
    typer.echo(f"H and A [m], each of {len(wanted)} runs tested in its turn, the others trained:")
    columns, rows = ["A", "H", "least", "greatest", "H_90"], []
    for row in rotate.spread(frame).to_dict("records"):
        better = "-" if row["better"] != row["better"] else f"{row['better']:.0f} of {row['turns']}"
        name = plan.label(row["foundation"], row["method"])
        rows.append([name, *(_digits(row[column]) for column in columns), better])
    _print(_table(["foundation", "A", "H", "least H", "greatest H", "H_90", "H below A"], rows))
    typer.echo(f"naive floor {_digits(frame.groupby('test')['naive'].first().mean())} m")
    found = rotate.contrasts(frame, plan).to_dict("records")
    if found:
        typer.echo("paired differences over the turns [m], with a 95 % interval:")
        pairs = [
            (
                row["id"],
                row["difference"],
                "{:+.2f} [{:+.2f}, {:+.2f}]".format(*(row[n] for n in ("mean", "low", "high"))),
                f"{row['above']} of {row['turns']}",
            )
            for row in found
        ]
        _print(_table(["finding", "difference", "mean", "above 0"], pairs))
    typer.echo(f"{len(frame)} cells -> {file}")


def _counted(blocks: Iterable[Any], total: int, what: str = "members") -> Iterator[Any]:
    """Pass blocks of rows on, with a bar of how many rows of all are there; on a terminal only."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    try:
        with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
            task = progress.add_task(what, total=total)
            for block in blocks:
                progress.advance(task, len(block))
                yield block
    except KeyboardInterrupt:
        sys.stderr.write("interrupted: nothing was written\n")
        raise


@study_app.command("run")
def study_run(
    study: Annotated[str, typer.Argument(help="bundled study or path of one")],
    workers: Workers = None,
    scheduler: Scheduler = None,
    out: Annotated[Path | None, typer.Option(help="folder; default results/<study>-<digest>")] = None,
    changes: Changes = None,
    device: Device = "cpu",
) -> None:
    """Run a study and write its report; an interrupted run resumes when started again."""
    from shipid.study.workers import import_for_workers

    if scheduler is None:
        import_for_workers()  # before this process imports for itself
    from shipid.study.plan import read_plan

    plan = read_plan(study, _parsed(changes))
    _run(plan, out or Path("results") / f"{plan.name}-{plan.digest[:8]}", workers, scheduler, device)


@study_app.command("resume")
def study_resume(folder: Folder, workers: Workers = None, scheduler: Scheduler = None, device: Device = "cpu") -> None:
    """Continue an interrupted run."""
    from shipid.study.store import stored_plan

    _run(stored_plan(folder), folder, workers, scheduler, device)


@study_app.command("report")
def study_report(folder: Folder) -> None:
    """Write report.html, summary.md and results.parquet from what is stored."""
    typer.echo(str(_report(folder)))


@study_app.command("compare")
def study_compare(
    folders: Annotated[list[Path], typer.Argument(help="finished runs of one study, each with another --set seed=")],
) -> None:
    """Show findings and errors of one study in several worlds: other manoeuvres, families and training."""
    from shipid.study.compare import compare_errors, compare_findings, read_worlds

    worlds = read_worlds(folders)
    found = compare_findings(worlds)
    if len(found):
        words = ["finding", f"in {len(worlds)} worlds", "number", "mean [least, greatest]"]
        values = [f"{row.mean:.3g} [{row.low:.3g}, {row.high:.3g}]" * bool(row.number) for row in found.itertuples()]
        _print(_table(words, zip(found["id"], found["verdicts"], found["number"], values, strict=True)))
    errors = compare_errors(worlds)
    errors["text"] = [f"{row.mean:.2f} [{row.low:.2f}, {row.high:.2f}]" for row in errors.itertuples()]
    wide = errors.pivot(index="family", columns="N_D", values="text").reindex(errors["family"].unique()).fillna("-")
    columns = ["H [m]", *(f"N_D = {amount}" for amount in wide.columns)]
    _print(_table(columns, wide.reset_index().to_numpy().tolist()))


@app.command("predict")
def predict(
    folder: Folder,
    log: Annotated[Path, typer.Argument(help="dataset (Parquet), or a raw log with --mapping")],
    cell: Annotated[str, typer.Option(help="cell whose predictor to use; see results.parquet")],
    mapping: Annotated[str | None, typer.Option(help="mapping of a raw log")] = None,
    out: Annotated[Path | None, typer.Option(help="file to write: .parquet or .csv")] = None,
) -> None:
    """Write physics and cooperative paths in north-east for every instant of a log."""
    from shipid.study.apply import predict_log

    file = out or Path(f"{cell}.parquet")
    frame, outside = predict_log(folder, cell, log, mapping, file)
    typer.echo(f"{frame.groupby(['run', 't']).ngroups} instants, {len(frame)} points -> {file}")
    if outside:
        typer.echo(f"{outside:.0%} of the instants lie outside what the cell was trained on (column `outside`)")


@app.command("identify")
def identify(
    vessel: Annotated[str, typer.Argument(help="bundled name, or path of a vessel or patch document")],
    dataset: Annotated[Path, typer.Argument(help="dataset (Parquet) of runs")],
    parameters: Annotated[
        list[str] | None, typer.Option(help='what is unknown: dotted paths, "hull.derivatives.*", "...[order >= 3]"')
    ] = None,
    fixed: Annotated[list[str] | None, typer.Option(help="what of it is not, after all")] = None,
    together: Annotated[list[str] | None, typer.Option(help="paths that share one factor, with commas between")] = None,
    prior: Annotated[
        list[str] | None, typer.Option(help="paths=0.3: standard deviation of a factor around the base")
    ] = None,
    bounds: Annotated[list[str] | None, typer.Option(help="paths=[0.5, 2]: least and greatest factor")] = None,
    nuisance: Annotated[
        list[str] | None,
        typer.Option(help="unknown of each run, with =WIDTH if wanted: initial_state, current, heading_bias, ..."),
    ] = None,
    horizon: Annotated[float | None, typer.Option(help="s of each prediction that is fitted; 0: whole runs")] = None,
    changes: Annotated[
        list[str] | None, typer.Option("--set", help="key=value: any other key of \\[identify], such as weights.u=0.05")
    ] = None,
    settings: Annotated[Path | None, typer.Option(help="TOML file with an \\[identify] table to begin with")] = None,
    runs: Annotated[list[str] | None, typer.Option(help="runs to fit, * for any part of a name; default: all")] = None,
    test: Annotated[list[str] | None, typer.Option(help="runs held out to test the result on; * as above")] = None,
    ahead: Annotated[float, typer.Option(help="s of each free run that tests the result; 0: whole runs")] = 0.0,
    profile: Annotated[list[str] | None, typer.Option(help="path whose profile likelihood is followed")] = None,
    design: Annotated[bool, typer.Option("--design", help="rank the manoeuvres to run next")] = False,
    out: Annotated[
        Path | None, typer.Option(help="patch to write, .toml; default: <vessel>-identified.toml beside you")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="page to write, with plots")] = None,
) -> None:
    """Identify numbers of a vessel from runs: estimates with intervals, tests on runs held out, a patch."""
    from shipid.data.dataset import read_dataset
    from shipid.files import check_new
    from shipid.identification.outcome import read_settings, run_identification, write_patch
    from shipid.vessel.load import load_vessel

    file = out or Path(f"{_stem(vessel)}-identified.toml")
    check_new(file, "patch")
    if html is not None and html.suffix != ".html":
        raise ShipidError("a page is an HTML file: let the name end in .html", file=html)
    given: dict[str, Any] = {
        "parameters": parameters,
        "fixed": fixed,
        "together": together and [group.split(",") for group in together],
        "prior": prior and _pairs(prior, "--prior", "paths=0.3"),
        "bounds": bounds and _pairs(bounds, "--bounds", "paths=[0.5,2]"),
        "nuisance": nuisance and _widths(nuisance),
        "horizon": horizon,
    }
    options = {key: value for key, value in given.items() if value is not None}
    declared = read_settings(settings, options | _parsed(changes))
    ship, log = load_vessel(vessel), read_dataset(dataset)
    try:
        with _iterations() as progress:
            found = run_identification(
                ship, log, declared, runs or (), test or (), ahead=ahead, profiles=profile or (), programme=design,
                progress=progress,
            )  # fmt: skip
    except KeyboardInterrupt:
        sys.stderr.write("interrupted: nothing was written\n")
        sys.exit(130)
    _show_identified(found)
    write_patch(found, file)
    count = len(found.solution.values)
    typer.echo(f"{count} number{'s' * (count != 1)} as a patch on {ship.key} -> {file}")
    if html is not None:
        from shipid.report.identification import write_identification

        typer.echo(f"page -> {write_identification(_identified_content(found, dataset), html)}")


def _identified_content(found: Identified, dataset: Path) -> IdentificationContent:
    import shlex

    import pandas as pd

    from shipid import __version__
    from shipid.report.identification import IdentificationContent

    curves = [
        pd.DataFrame({"factor": own.values, "rise": own.rises}).assign(
            path=own.path, limit=own.limit, sentence=own.sentence
        )
        for own in found.profiles
    ]
    return IdentificationContent(
        title=f"{found.vessel.name}, identified",
        name=found.vessel.key,
        estimates=found.estimates,
        correlations=found.statistics.correlations,
        unseen=found.unseen,
        warnings=found.warnings,
        errors=found.errors,
        series=found.free["test" if found.held_out else "fit"].series,
        held_out=found.held_out,
        ahead=found.ahead,
        manoeuvres=found.manoeuvres,
        colours=found.colours,
        profiles=pd.concat(curves, ignore_index=True) if curves else pd.DataFrame(),
        programme=pd.DataFrame() if found.programme is None else found.programme,
        provenance={
            "Vessel": f"{found.vessel.name}, digest {found.vessel.digest}",
            "Dataset": f"{dataset}, digest {found.digest}",
            "Fitted": ", ".join(found.runs),
            "Held out": ", ".join(found.held_out) or "none",
            "Fit": f"{found.solution.sentence}; objective {found.solution.objective:.6g}, at first "
            f"{found.solution.objective_start:.6g}",
            "shipid": __version__,
        },
        command=shlex.join(["shipid", *sys.argv[1:]]),
        study_document=found.patch(Path()),
    )


def _pairs(given: list[str], option: str, example: str) -> dict[str, Any]:
    """`paths=value`, the value TOML; paths may hold a comparison."""
    import tomllib

    result = {}
    for pair in given:
        path, equals, text = pair.rpartition("=")
        try:
            if not equals or not path:
                raise ValueError
            result[path] = tomllib.loads(f"value = {text}")["value"]
        except ValueError:
            raise DocumentError(f"{pair!r}: write {example}", path=option) from None
    return result


def _widths(given: list[str]) -> list[str] | dict[str, Any]:
    """Names, or names with widths; the ordinary width where only others have one."""
    if not any("=" in name for name in given):
        return given
    from shipid.identification.problem import WIDE

    named = {name: WIDE.get(name, 1.0) for name in given if "=" not in name}
    return named | _pairs([name for name in given if "=" in name], "--nuisance", "current=0.3")


@contextmanager
def _iterations() -> Iterator[Any]:
    """What `identify` calls after each iteration: a line that is written over, on a terminal only."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    with console.status("cutting runs") as status:
        yield lambda count, objective: status.update(f"iteration {count}, objective {objective:.6g}")


def _show_identified(found: Identified) -> None:
    """Estimates, what is not seen, free runs, manoeuvres, what to run next, warnings."""
    solution = found.solution
    fitted = f"{len(found.runs)} of {len(found.runs) + len(found.held_out)} runs, {len(solution.residuals)} residuals"
    typer.echo(f"{found.vessel.name}: {solution.sentence}; {fitted}, {solution.seconds:.1f} s")
    rows: list[list[str]] = [
        [
            row["path"] + (f" (with {row['with']})" if row["with"] else ""),
            row["unit"],
            *(f"{row[name]:.4g}" for name in ("base", "value", "factor")),
            *(
                (f"{row['factor_error']:.4g}", f"{row['factor_low']:.3g} ... {row['factor_high']:.3g}")
                if row["factor_error"] < float("inf")
                else ("-", "none")
            ),
            "yes" if row["identified"] else "no",
        ]
        for row in found.estimates.to_dict("records")
    ]
    columns = ["parameter", "unit", "base", "estimate", "factor", "std error", "95 % interval", "identified"]
    _print(_table(columns, rows))
    words = {"fisher": "Fisher information", "sandwich": "sandwich by runs", "blocks": "sandwich by stretches of runs"}
    typer.echo(
        f"Factors are on the base; standard errors and intervals are theirs, by {words[found.statistics.chosen]}."
    )
    for sentence in found.unseen:
        typer.echo(f"  {sentence}")
    typer.echo(f"Free runs {f'of {found.ahead:g} s' if found.ahead else 'as long as the runs'}, root mean square:")
    _print(_table(["runs", "model", "u [m/s]", "v [m/s]", "r [deg/s]", "position [m]"], _free_rows(found)))
    compared = [
        [row["manoeuvre"], row["measure"], _digits(row["before"]), _digits(row["after"]), row["unit"], row["note"]]
        for row in found.manoeuvres.to_dict("records")
    ]
    _print(_table(["calm water", "measure", "before", "after", "unit", "note"], compared))
    for curve in found.profiles:
        typer.echo(f"profile: {curve.sentence}")
    if found.programme is not None:
        typer.echo("To run next, by information per hour:")
        ranked = [
            [row["manoeuvre"], *(f"{row[name]:.2f}" for name in ("hours", "gain", "per_hour")), row["narrows"],
             f"{1 - row['after'] / row['before']:.0%}"]
            for row in found.programme.head(10).to_dict("records")
        ]  # fmt: skip
        _print(_table(["manoeuvre", "h", "gain [bit]", "bit/h", "narrows most", "by"], ranked))
    for warning in found.warnings:
        typer.echo(f"warning: {warning}", err=True)


def _free_rows(found: Identified) -> Iterator[list[str]]:
    from math import degrees

    from shipid.identification.free_run import ALL

    for row in found.errors.to_dict("records"):
        if row["run"] == ALL:
            numbers = (row["u"], row["v"], degrees(row["r"]), row["position"])
            named = {"fit": f"{len(found.runs)} fitted", "test": f"{len(found.held_out)} held out"}[row["set"]]
            yield [named, row["model"], *(f"{value:.3g}" if value == value else "diverges" for value in numbers)]


@app.command("manoeuvre")
def manoeuvre(
    vessel: Annotated[str, typer.Argument(help="bundled name, or path of a vessel or patch document")],
    name: Annotated[str, typer.Argument(help="zigzag, turning, pull-out, spiral, reverse-spiral or stop")],
    angles: Annotated[
        list[float] | None,
        typer.Argument(
            help="helm in deg, of a zigzag also the execute heading; of a reverse-spiral the greatest rate in deg/s",
            metavar="[ANGLES]...",
        ),
    ] = None,
    speed: Annotated[float | None, typer.Option(help="of the approach in m/s; default: Froude number 0.2")] = None,
    side: Annotated[str, typer.Option(help="starboard or port: where she turns first")] = "starboard",
    duration: Annotated[float | None, typer.Option(help="of the log, of a spiral that of each level, in s")] = None,
    step: Annotated[float | None, typer.Option(help="of the integration in s; ten make a row of the log")] = None,
    out: Annotated[Path | None, typer.Option(help="HTML page to write; default: <vessel>-<name>.html")] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file of the measures to write")] = None,
    log: Annotated[Path | None, typer.Option(help="dataset of the run to write, .parquet")] = None,
) -> None:
    """Simulate a standard manoeuvre: measures with the IMO criteria, and a page with plots."""
    from shipid.data.dataset import Dataset, write_dataset
    from shipid.measures import MEASURES
    from shipid.measures.criteria import criteria
    from shipid.measures.recognise import record_of
    from shipid.measures.rows import criterion_rows, measure_rows
    from shipid.report.manoeuvre import write_manoeuvre
    from shipid.simulation.perform import perform
    from shipid.simulation.standard import length_of, standard
    from shipid.vessel.load import load_vessel

    if log is not None and log.suffix != ".parquet":
        raise ShipidError("a dataset is a Parquet file: let the name end in .parquet", file=log)
    ship = load_vessel(vessel)
    chosen = standard(ship, name, angles or (), speed=speed, side=side, duration=duration, step=step)
    frame = perform(ship, [chosen.manoeuvre], step=chosen.step, interval=chosen.interval)
    frame = frame[[column for column in frame if not str(column).startswith("actual.")]]
    record = record_of({str(column): frame[column].to_numpy() for column in frame if column != "run"})
    found, length = MEASURES[chosen.kind](record), length_of(ship)
    rows, judged = measure_rows(found, length), criterion_rows(criteria(chosen.kind, found, length))
    typer.echo(f"{ship.name}: {chosen.title}, approach at {chosen.speed:.3g} m/s ({chosen.manoeuvre.n_rpm:.4g} rpm)")
    _print(_measure_table(rows, []))
    if judged:
        _print(_criterion_table(judged, []))
    if csv is not None:
        import pandas as pd

        _write_measures(pd.DataFrame(rows), csv)
    if log is not None:
        source = f"simulated: {ship.name}, {chosen.title}"
        typer.echo(f"log -> {write_dataset(Dataset(frame, {'clock': 'run', 'flags': [], 'source': source}), log)}")
    content = _manoeuvre_content(ship, chosen, record, rows, judged)
    page = out or Path(f"{_stem(vessel)}-{name}.html")
    typer.echo(f"page -> {write_manoeuvre(content, page)}")


def _manoeuvre_content(
    ship: Vessel, chosen: Standard, record: Record, rows: list[dict[str, Any]], judged: list[dict[str, Any]]
) -> ManoeuvreContent:
    import shlex

    import numpy as np
    import pandas as pd

    from shipid import __version__
    from shipid.measures.spiral import Levels, levels, rate_levels
    from shipid.report.manoeuvre import ManoeuvreContent
    from shipid.study.results import ship_outline

    columns = {key: getattr(record, key) for key in ("t", "north", "east", "psi", "u", "v", "r", "helm")}
    shaft = np.zeros(len(record.t)) if record.shaft is None else record.shaft
    points = {"spiral": levels, "reverse-spiral": rate_levels}.get(chosen.kind)
    steady = points(record) if points else Levels(np.empty(0), np.empty(0), 0)
    particulars = ship.document["particulars"]
    return ManoeuvreContent(
        title=f"{ship.name}: {chosen.title}",
        name=chosen.kind,
        kind=chosen.kind,
        log=pd.DataFrame({**columns, "shaft": shaft}),
        measures=pd.DataFrame(rows),
        criteria=pd.DataFrame(judged),
        outline=ship_outline(
            particulars.get("L_oa", particulars["L_pp"]), particulars.get("B", particulars["L_pp"] / 6)
        ),
        levels=pd.DataFrame({"helm": steady.helm, "rate": steady.rate}),
        provenance={
            "Vessel": f"{ship.name}, digest {ship.digest}",
            "Approach": f"{chosen.speed:.4g} m/s at {chosen.manoeuvre.n_rpm:.5g} rpm, calm deep water, no wind",
            "Simulation": f"steps of {chosen.step:g} s, rows of {chosen.interval:g} s",
            "shipid": __version__,
        },
        command=shlex.join(["shipid", *sys.argv[1:]]),
    )


def _write_measures(frame: DataFrame, file: Path) -> None:
    from shipid.files import write_table

    write_table(file, frame)
    typer.echo(f"measures -> {file}")


def _measure_table(rows: Iterable[Any], first: list[str]) -> Table:
    """Table of measures; `first` are columns that come before."""
    rows = list(rows)
    missing = any(row["note"] for row in rows)
    body = [
        [
            *(row[key] for key in first),
            row["measure"],
            _digits(row["value"]),
            row["unit"],
            "" if row["lengths"] != row["lengths"] else f"{row['lengths']:.2f}",
            *[row["note"]] * missing,
        ]
        for row in rows
    ]
    return _table([*first, "measure", "value", "unit", "ship lengths", *["why missing"] * missing], body)


def _criterion_table(rows: Iterable[Any], first: list[str]) -> Table:
    """Table of criteria; `first` are columns that come before."""
    body = [
        [
            *(row[key] for key in first),
            row["criterion"],
            *(_digits(row[key]) for key in ("value", "limit")),
            row["unit"],
            row["verdict"],
            row["note"],
        ]
        for row in rows
    ]
    return _table([*first, "IMO MSC.137(76)", "value", "limit", "unit", "verdict", "note"], body)


def _digits(value: float) -> str:
    if abs(value) >= 1e6:  # a moment on a clock of dates
        return f"{value:.1f}"
    return "-" if value != value else f"{round(value, 4) + 0.0:.4g}"


def _run(plan: Any, folder: Path, workers: int | None, scheduler: str | None, device: str) -> None:
    from shipid.study.run import run_study

    try:
        _draw(run_study(plan, folder, workers=workers, scheduler=scheduler, device=device))
    except KeyboardInterrupt:
        sys.stderr.write(f"interrupted; what is finished is kept. Continue with: shipid study resume {folder}\n")
        sys.exit(130)
    report = _report(folder)
    for line in (folder / "answer.txt").read_text(encoding="utf-8").splitlines():
        typer.echo(f"  {line}")
    typer.echo(f"report: {report}")


def _draw(events: Iterable[Event]) -> None:
    """Live progress on a terminal; plain lines, one per finished cell, anywhere else."""
    from rich.console import Console

    console = Console()
    if not console.is_terminal:
        for event in events:
            line = _line(event)
            if line:
                typer.echo(line)
        return
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
    with Progress(*columns, console=console, refresh_per_second=2) as progress:  # drawing takes time from workers
        task = progress.add_task("cells", total=None)
        for event in events:
            if event.kind == "note":
                progress.console.print(event.text, markup=False, highlight=False)
            elif event.kind == "start":
                progress.update(task, total=event.total, completed=event.done)
            elif event.kind == "cell":
                row = event.row
                if row["status"] == "ok":
                    best = min((best or row, row), key=lambda r: r["H"])
                    worst = max((worst or row, row), key=lambda r: r["H"])
                label = (
                    f"best {best['cell']} {best['H']:.2f} m, worst {worst['cell']} {worst['H']:.2f} m"
                    if best
                    else "cells"
                )
                progress.update(task, completed=event.done, description=label)


def _line(event: Event) -> str:
    row = event.row
    if event.kind != "cell":
        return {"note": event.text, "start": f"{event.total - event.done} of {event.total} cells to do"}.get(
            event.kind, ""
        )
    result = (
        f"H {row['H']:.3f} m, H_90 {row['H_90']:.3f} m"
        if row["status"] == "ok"
        else f"{row['status']}: {row['sentence']}"
    )
    return f"[{event.done}/{event.total}] {row['cell']}: {result}, {row['seconds']:.1f} s"


def _stem(name: str | Path) -> str:
    """Name of a document or dataset without folder and ending; a dot in the name of a vessel is no ending."""
    return Path(name).name.removesuffix(".toml").removesuffix(".parquet")


def _report(folder: Path) -> Path:
    from shipid.files import write_text
    from shipid.report import write_report, write_summary
    from shipid.study.results import read_results
    from shipid.study.store import write_results

    results = read_results(folder)
    write_results(folder, results.cells)
    content = _content(results)
    write_text(folder / "answer.txt", "\n".join(sentence.text for sentence in content.answer) + "\n")
    write_summary(content, folder / "summary.md")
    return write_report(content, folder / "report.html")


def _content(results: Results) -> ReportContent:
    from shipid.report import Finding, ReportContent, Sentence, Snapshot
    from shipid.study import advise
    from shipid.study import results as frames
    from shipid.study.findings import findings

    return ReportContent(
        title=results.plan.study.question,
        name=results.plan.name,
        answer=[Sentence(text, figure) for text, figure in advise.answer(results)],
        findings=[Finding(f["id"], f["claim"], f["verdict"], f["evidence"]) for f in findings(results)],
        cells=results.cells,
        naive=frames.naive_summary(results),
        models=results.models,
        factors=frames.factors_frame(results),
        trials=frames.trials_frame(results),
        horizon=frames.horizon_frame(results),
        over_time=frames.time_frame(results),
        commands=frames.commands_frame(results),
        snapshots=[Snapshot(**snapshot) for snapshot in frames.snapshots(results)],
        tracks=frames.tracks_frame(results),
        envelope=frames.envelope_frame(results),
        repairs=frames.repairs_frame(results),
        provenance=frames.provenance_words(results),
        study_document=results.plan.text(),
        command=frames.reproducing_command(results),
    )


def _parsed(changes: list[str] | None) -> dict[str, Any]:
    """`path=value` pairs; a value is TOML, or text as it stands."""
    import tomllib

    result: dict[str, Any] = {}
    for change in changes or []:
        path, equals, text = change.partition("=")
        if not equals or not path:
            raise DocumentError(f"{change!r}: write --set path=value, such as --set grid.N_D=[10,30]", path="--set")
        try:
            result[path] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            result[path] = text
    return result


def _parameter_rows(values: dict[str, float], units: dict[str, str]) -> Iterator[tuple[str, str, str]]:
    """Dotted path, value, unit; the entries of one table column share a row, addressed `path.0`, `path.1`, ..."""
    import re
    from itertools import groupby

    for stem, group in groupby(values, key=lambda path: re.sub(r"\.\d+$", "", path)):
        paths = list(group)
        if len(paths) == 1:
            yield paths[0], f"{values[paths[0]]:.10g}", units[paths[0]]
        else:
            yield f"{stem}.0 ... .{len(paths) - 1}", " ".join(f"{values[p]:g}" for p in paths), units[paths[0]]


def _table(columns: list[str], rows: Iterable[Iterable[str]] | Iterator[Any]) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD)
    for column in columns:
        table.add_column(Text(column))  # as text: rich would take [m] for markup
    for row in rows:
        table.add_row(*(Text(str(cell)) for cell in row))
    return table


def _print(table: Table) -> None:
    from rich.console import Console

    console = Console()
    if console.is_terminal:
        console.print(table)
    else:
        Console(width=200).print(table)
