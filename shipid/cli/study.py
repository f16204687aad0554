"""`shipid study`: questions, run and answered."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from shipid.cli.options import Changes, Device, Folder, Scheduler, Workers, parsed, stem
from shipid.cli.terminal import counted, digits, draw, show, show_reasons, table

if TYPE_CHECKING:
    from shipid.study.plan import Plan

app = typer.Typer(no_args_is_help=True, help="Studies: questions, run and answered.")
FINDING: tuple[Literal["id", "claim", "verdict", "evidence"], ...] = ("id", "claim", "verdict", "evidence")


@app.command("list")
def study_list() -> None:
    """List the bundled studies."""
    from shipid.document import bundled, read

    show(table(["name", "question"], ((name, read(file)["question"]) for name, file in bundled("studies").items())))


@app.command("new")
def study_new(
    vessel: Annotated[list[str], typer.Option(help="bundled name, or path of a vessel or patch; may be repeated")],
    data: Annotated[
        Path | None, typer.Option(help="dataset (Parquet) of recorded runs; without it the vessel is simulated")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="TOML file to write; default: <data or vessel>-study.toml in this folder")
    ] = None,
) -> None:
    """Write a study of your vessel and runs that runs as it is, each choice with its reason."""
    import shlex

    from shipid.files import check_new, write_new
    from shipid.study.new import draft_study

    file = out or Path(f"{stem(data or vessel[0])}-study.toml")
    check_new(file, "study")
    draft = draft_study(vessel, data, file)
    write_new(draft.text, file, "study")
    show_reasons([(choice.path, str(choice.value), choice.why) for choice in draft.choices])
    for warning in draft.warnings:
        typer.echo(f"warning: {warning}", err=True)
    for named, look in draft.looks.items():
        if not look.wrong:
            typer.echo(look.sentence)
        elif look.changes:
            typer.echo(f"draft of a correction, in the study as {look.vessel.key}-corrected; as a patch of its own:")
            typer.echo(look.patch(named))
    names = ", ".join(model.name for model in draft.plan.foundations)
    typer.echo(f"{draft.plan.cells} cells of {len(draft.plan.foundations)} foundations ({names}) -> {file}")
    typer.echo(f"run it with: {shlex.join(['shipid', 'study', 'run', str(file)])}")


@app.command("variants")
def study_variants(
    study: Annotated[str, typer.Argument(help="bundled study or path of one")],
    save: Annotated[Path | None, typer.Option(help="folder for one patch document per variant")] = None,
    accuracy: Annotated[bool, typer.Option(help="also simulate or import the data, and show A")] = True,
    changes: Changes = None,
) -> None:
    """Show the foundations of a study with their factors and accuracy A; save patches that rebuild them exactly."""
    from shipid.study.plan import read_plan
    from shipid.study.prepare import obtain, prepare

    plan = read_plan(study, parsed(changes))
    models, scores = plan.foundations, {}
    if accuracy or save is not None:  # what diverges on training windows is redrawn, so a patch needs the data
        prepared = prepare(plan, obtain(plan))
        models = prepared.foundations
        known = [model.name for model in models if model.vessel and model.identify is None]
        scores = {name: prepared.accuracy(name)["mean"] for name in known}
    rows = []
    for model in models:
        if model.identify is not None:
            rows.append((model.name, "-", "-", "identified from the runs of each cell, so A differs by cell"))
            continue
        factors = model.variant.factors if model.variant else {}
        changed = ((path.rsplit(".", 1)[-1], factor) for path, factor in factors.items())
        shown = ", ".join(f"{name} x{factor:.2f}" if factor else f"{name} removed" for name, factor in changed)
        score = scores.get(model.name)
        rows.append((model.name, "-" if score is None else f"{score:.2f}", str(len(factors)), shown))
    show(table(["foundation", "A [m]", "changed", "factors"], rows))
    if save is not None:
        from shipid.study.store import write_patches

        typer.echo(f"{write_patches(save, models)} patches -> {save}")


@app.command("screen")
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
    from shipid.files import write_table
    from shipid.study import screen
    from shipid.study.prepare import obtain

    plan, file = _before_work(study, changes, device, out, "screen")
    wanted, dataset = screen.families(plan, family), obtain(plan)
    for note in screen.notes(plan, dataset, wanted):
        typer.echo(note, err=True)
    blocks = counted(screen.screen(plan, dataset, wanted, members, device), members * len(wanted))
    frame = screen.joined(list(blocks))
    write_table(file, frame)
    spread = screen.spread(frame)
    shares = [f"{share:.0%}" for share in screen.SHARES]
    rows = [[*map(str, row[:3]), *(f"{value:.2f}" for value in row[3:])] for row in spread.itertuples(index=False)]
    typer.echo("accuracy A [m] that so many of the members reach:")
    show(table(["family", "members", "diverged", *shares], rows))
    correlations = screen.drivers(frame)
    typer.echo("what drives A: rank correlation with a factor, and with its distance from 1:")
    pairs = [
        (str(row.family), str(row.paths), f"{row.factor:+.2f}", f"{row.away:+.2f}") for row in correlations.itertuples()
    ]
    show(table(["family", "parameter", "factor", "distance"], pairs))
    typer.echo(f"{len(frame)} members -> {file}")


@app.command("rotate")
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
    """Test on every run in turn and train on all others: how much the answer depends on the choice of the test run."""
    from shipid.files import write_table
    from shipid.study import rotate
    from shipid.study.prepare import obtain

    plan, file = _before_work(study, changes, device, out, "rotate")
    dataset = obtain(plan)
    wanted = rotate.turns(plan, dataset, tests)
    cells = len(wanted) * len(plan.pairs) * len(set(plan.study.grid.seeds))
    import pandas as pd

    frame = pd.concat(list(counted(rotate.rotate(plan, dataset, wanted, device), cells, "cells")), ignore_index=True)
    write_table(file, frame)
    typer.echo(f"H and A [m], each of {len(wanted)} runs is the test run in turn, the others train:")
    columns, rows = ["A", "H", "least", "greatest", "H_90", "width"], []
    for row in rotate.spread(frame).to_dict("records"):
        better = "-" if row["better"] != row["better"] else f"{row['better']:.0f} of {row['turns']}"
        name = plan.label(row["foundation"], row["method"])
        inside = "-" if row["coverage"] != row["coverage"] else f"{row['coverage']:.0%}"
        rows.append([name, *(digits(row[column]) for column in columns), inside, better])
    band = f"in band of {plan.study.bands.level:.0%}"
    heads = ["foundation", "A", "H", "least H", "greatest H", "H_90", "radius of band", band, "H below A"]
    show(table(heads, rows))
    typer.echo(f"naive floor {digits(frame.groupby('test')['naive'].first().mean())} m")
    if found := rotate.turn_findings(frame, plan):
        typer.echo("findings over the turns, in brackets 95 % intervals:")
        show(table(["finding", "claim", "verdict", "evidence"], (tuple(one[key] for key in FINDING) for one in found)))
    typer.echo(f"{len(frame)} cells -> {file}")


@app.command("run")
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

    plan = read_plan(study, parsed(changes))
    _run(plan, out or plan.folder, workers, scheduler, device)


@app.command("resume")
def study_resume(folder: Folder, workers: Workers = None, scheduler: Scheduler = None, device: Device = "cpu") -> None:
    """Continue an interrupted run."""
    from shipid.study.store import stored_plan

    _run(stored_plan(folder), folder, workers, scheduler, device)


@app.command("report")
def study_report(folder: Folder) -> None:
    """Write report.html, summary.md and results.parquet from what is stored."""
    from shipid.study.contents import write_pages

    typer.echo(str(write_pages(folder)))


@app.command("check")
def study_check(folder: Folder) -> None:
    """Check that the files of a run's folder are whole and as they were written; ends with 1 if one is not."""
    from shipid.study.check import check_folder

    found = check_folder(folder)
    for line in found.lines:
        typer.echo(line)
    if found.faults:
        raise typer.Exit(1)


@app.command("compare")
def study_compare(
    folders: Annotated[list[Path], typer.Argument(help="finished runs of one study, each with another --set seed=")],
) -> None:
    """Show findings and errors of one study in several worlds: other manoeuvres, families and training."""
    from shipid.study.compare import compare_bands, compare_errors, compare_findings, read_worlds

    worlds = read_worlds(folders)
    findings = compare_findings(worlds)
    if len(findings):
        words = ["finding", f"in {len(worlds)} worlds", "number", "mean [95 % over worlds]"]
        values = [f"{row.mean:.3g} [{row.low:.3g}, {row.high:.3g}]" * bool(row.number) for row in findings.itertuples()]
        show(table(words, zip(findings["id"], findings["verdicts"], findings["number"], values, strict=True)))
    errors = compare_errors(worlds)
    errors["text"] = [f"{row.mean:.2f} [{row.low:.2f}, {row.high:.2f}]" for row in errors.itertuples()]
    wide = errors.pivot(index="family", columns="N_D", values="text").reindex(errors["family"].unique()).fillna("-")
    columns = ["H [m], mean [least, greatest]", *(f"N_D = {amount}" for amount in wide.columns)]
    show(table(columns, wide.reset_index().to_numpy().tolist()))
    bands = compare_bands(worlds)
    if len(bands):
        level = worlds[0].plan.study.bands.level
        typer.echo(
            f"bands of {level:.0%}: share of whole test paths inside, and mean radius [m], mean [least, greatest]:"
        )
        columns = ["family", "method", "N_D", "coverage", "width [m]", "worlds"]
        rows = [
            [
                *(str(row[name]) for name in ("family", "method", "N_D")),
                *(f"{row[n]:.2f} [{row[f'{n}_low']:.2f}, {row[f'{n}_high']:.2f}]" for n in ("coverage", "width")),
                str(row["worlds"]),
            ]
            for row in bands.to_dict("records")
        ]
        show(table(columns, rows))


def _before_work(
    study: str, changes: list[str] | None, device: str, out: Path | None, command: str
) -> tuple[Plan, Path]:
    """The plan of a study and the file of a command's table, after all that can be refused before anything is done."""
    from shipid.files import check_table
    from shipid.hybrid.training import check_device
    from shipid.study.plan import read_plan

    check_device(device)
    plan = read_plan(study, parsed(changes))
    file = out or Path(f"{plan.name}-{command}.csv")
    check_table(file)
    return plan, file


def _run(plan: Plan, folder: Path, workers: int | None, scheduler: str | None, device: str) -> None:
    from shipid.study import run
    from shipid.study.contents import ANSWER, write_pages

    try:
        draw(run.run_study(plan, folder, workers=workers, scheduler=scheduler, device=device))
    except KeyboardInterrupt:
        sys.stderr.write(f"interrupted; what is finished is kept. Continue with: shipid study resume {folder}\n")
        sys.exit(130)
    report = write_pages(folder)
    for line in (folder / ANSWER).read_text(encoding="utf-8").splitlines():
        typer.echo(f"  {line}")
    typer.echo(f"report: {report}")
