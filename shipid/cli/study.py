"""`shipid study`: questions, run and answered."""

from __future__ import annotations

import re
from contextlib import closing
from math import isnan
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING, Annotated

import typer

import shipid
from shipid.cli.answer import Answer, Json, end_on_interrupt, open_answer, show_steps
from shipid.cli.options import (
    Changes,
    Device,
    Folder,
    Scheduler,
    StudyName,
    Trust,
    Workers,
    check_output,
    document_stem,
    parse_changes,
)
from shipid.errors import DocumentError, ShipidError, escape_unprintable
from shipid.files import TABLES, quote_argument, write_new
from shipid.units import percent_text, plural_word

if TYPE_CHECKING:
    from pandas import DataFrame

    from shipid.answer.compare import Comparison
    from shipid.study.plan import Plan

app = typer.Typer(no_args_is_help=True, help="Studies: questions, run and answered.")
MOST_DIFFERENCES = 20  # of documents, on a terminal
DIFFERENCE = {"difference": "difference", "low": "95 % from", "high": "to"}
CELL = {"family": "family", "method": "method", "N_D": "N_D"}


@app.command("list")
def study_list(as_json: Json = False) -> None:
    """List the bundled studies."""
    from shipid.document import bundled_documents, read_document

    rows = [
        {"name": name, "question": read_document(file)["question"]}
        for name, file in bundled_documents("studies").items()
    ]
    with open_answer(as_json) as answer:
        answer.records("studies", rows)


@app.command("new")
def study_new(
    vessel: Annotated[
        list[str] | None,
        typer.Option(help="bundled name, or path of a vessel or patch; may be repeated; default: data alone"),
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="dataset (Parquet) of recorded runs; without it the vessel is simulated")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="TOML file to write; default: <data or vessel>-study.toml in this folder")
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a study of your vessel and runs that runs as it is, each choice with its reason."""
    from shipid.study.new import draft_study

    if not vessel and data is None:
        raise ShipidError("missing: give a vessel, or recorded runs as --data, or both", path="--vessel")
    file = check_output(out or Path(f"{document_stem(data or (vessel or [''])[0])}-study.toml"), endings=(".toml",))
    draft = draft_study(vessel or [], data, file)
    write_new(draft.text, file)
    with open_answer(as_json) as answer:
        choices = [{"path": choice.path, "value": str(choice.value), "why": choice.why} for choice in draft.choices]
        answer.records("choices", choices, shown=[])
        answer.say("\n".join(f"{one['path']} = {one['value']}  # {one['why']}".removesuffix("  # ") for one in choices))
        answer.warn(draft.warnings)
        sound = [f"{name}: {one.sentence}" for name, one in draft.diagnoses.items() if one.cause == "none"]
        answer.say("\n".join(sound), causes={name: one.cause for name, one in draft.diagnoses.items()})
        models = [model.name for model in draft.plan.foundations]
        named = f"{len(models)} {plural_word(len(models), 'foundation')} ({', '.join(models)})"
        answer.say(
            f"{draft.plan.cells} cells of {named} -> {file}", file=file, cells=draft.plan.cells, foundations=models
        )
        answer.say(f"run it with: shipid study run {quote_argument(file)}")


@app.command("screen")
def study_screen(
    study: StudyName,
    family: Annotated[str | None, typer.Argument(help="family; default: all that draw factors from a range")] = None,
    members: Annotated[int, typer.Option(min=2, max=100000, help="members of each family")] = 1000,
    out: Annotated[
        Path | None, typer.Option(help="file for a row per member: .csv or .parquet; default: <study>-screen.csv")
    ] = None,
    single: Annotated[
        bool, typer.Option("--single", help="single precision: half the time, A to about six digits")
    ] = False,
    changes: Changes = None,
    device: Device = "cpu",
    trust: Trust = False,
    as_json: Json = False,
) -> None:
    """Show how accurate many members of a study's families are on all its windows."""
    from shipid.engine.engines import REPEATED, check_device
    from shipid.study import screen
    from shipid.study.plan import input_files
    from shipid.study.prepare import obtain_runs, partition

    engine = "single" if single else REPEATED
    check_device(device)
    plan = shipid.read_plan(study, parse_changes(changes), trust=trust)
    file = check_output(out or Path(f"{plan.name}-screen.csv"), input_files(plan), TABLES)
    wanted, dataset = screen.drawn_families(plan, family), obtain_runs(plan)
    cut = partition(plan, dataset)
    for note in screen.notes_on_windows(plan, cut, wanted):
        typer.echo(note, err=True)
    blocks: list[DataFrame] = []
    with end_on_interrupt(), show_steps() as say:
        for block in screen.screen(plan, dataset, wanted, members, device, engine, cut):
            blocks.append(block)
            say(f"{sum(map(len, blocks))} of {members * len(wanted)} members")
    frame = screen.join_blocks(blocks)
    with open_answer(as_json) as answer:
        answer.say("accuracy A [m] that so many of the members reach:")
        answer.records("accuracy", screen.accuracy_quantiles(frame))
        answer.save(f"{len(frame)} members", file, frame)


@app.command("run")
def study_run(
    study: StudyName,
    workers: Workers = None,
    scheduler: Scheduler = None,
    out: Annotated[Path | None, typer.Option(help="folder; default results/<study>-<digest>")] = None,
    changes: Changes = None,
    device: Device = "cpu",
    shard: Annotated[
        str | None, typer.Option(help="i/n: every n-th unit of work from the i-th on, after `study prepare`")
    ] = None,
    trust: Trust = False,
) -> None:
    """Run a study and write its report; an interrupted run resumes when started again."""
    from shipid.study.workers import import_for_workers

    if scheduler is None and workers != 0:
        import_for_workers()  # before this process imports for itself
    from shipid.study.plan import default_folder

    part = _parse_shard(shard)
    plan = shipid.read_plan(study, parse_changes(changes), trust=trust)
    _run_to_report(plan, out or default_folder(plan), workers, scheduler, device, part)


def _parse_shard(shard: str | None) -> tuple[int, int] | None:
    """Part and number of parts of `i/n`."""
    part = re.fullmatch(r"(\d+)/(\d+)", shard or "")
    if shard is not None and part is None:
        raise ShipidError(f"{shard!r}: write i/n, such as 3/20", path="--shard")
    return part and (int(part[1]), int(part[2]))


@app.command("prepare")
def study_prepare(
    study: StudyName,
    out: Annotated[Path | None, typer.Option(help="folder; default results/<study>-<digest>")] = None,
    changes: Changes = None,
    device: Device = "cpu",
    trust: Trust = False,
) -> None:
    """Make the folder of a study with its runs, so that the tasks of a job array can work there with --shard."""
    from shipid.study.plan import default_folder
    from shipid.study.run import prepare_study

    plan = shipid.read_plan(study, parse_changes(changes), trust=trust)
    for event in prepare_study(plan, out or default_folder(plan), device=device):
        typer.echo(event.text)


@app.command("resume")
def study_resume(
    folder: Folder,
    workers: Workers = None,
    scheduler: Scheduler = None,
    device: Device = "cpu",
    trust: Trust = False,
) -> None:
    """Continue an interrupted run."""
    from shipid.study.store import stored_plan

    _run_to_report(stored_plan(folder, trust), folder, workers, scheduler, device)


@app.command("report")
def study_report(folder: Folder) -> None:
    """Write report.html, summary.md and results.parquet from what is stored."""
    with show_steps() as say:
        report = shipid.write_pages(folder, say)
    typer.echo(str(report))


@app.command("check")
def study_check(folder: Folder, as_json: Json = False) -> None:
    """Check that the files of a run's folder are whole and as they were written; ends with 1 if one is not."""
    from shipid.study.check import check_folder

    report = check_folder(folder)
    with open_answer(as_json) as answer:
        answer.say("\n".join(report.lines), lines=report.lines, faults=report.faults)
    if report.faults:
        raise typer.Exit(1)


@app.command("windows")
def study_windows(
    study: Annotated[str, typer.Argument(help="bundled study, path of one, or folder of a run")],
    out: Annotated[Path, typer.Option(help="folder for windows, past, future and physics, each .parquet")],
    N_D: Annotated[int | None, typer.Option("--N_D", help="amount of data; default: the largest of the grid")] = None,
    seed: Annotated[int | None, typer.Option(help="seed of the grid; default: the least")] = None,
    with_truth: Annotated[
        bool, typer.Option("--with-truth", help='with the future of the test; scores are then "not blind"')
    ] = False,
    device: Device = "cpu",
    every: Annotated[
        bool, typer.Option("--every", help="of all runs, and what a memory asks for: for `predictions` of a family")
    ] = False,
    trust: Trust = False,
) -> None:
    """Write the windows of a study for a method of your own: what is known, what the physics says, what it misses."""
    folder = check_output(out / "windows.parquet", option="--out").parent
    cut = shipid.windows(study, N_D=N_D, seed=seed, with_truth=with_truth, device=device, every=every, trust=trust)
    for file in cut.write(folder):
        typer.echo(f"{file} ({file.stat().st_size / 1000:.0f} kB)")


@app.command("score")
def study_score(
    folder: Folder,
    predictions: Annotated[
        Path, typer.Argument(help="table (Parquet) with run, instant, ahead, north, east; every test window once")
    ],
    anyway: Annotated[
        bool, typer.Option("--anyway", help="score predictions that seem to be wrong, as doubtful")
    ] = False,
    as_json: Json = False,
) -> None:
    """Score predictions of others on the test windows of a run, beside its methods, also in its page."""
    with open_answer(as_json) as answer:
        heads = CELL | {"H_end": "at horizon [m]", "H_end_90": "nine in ten below [m]", "H": "H [m]"} | DIFFERENCE
        for label, table in shipid.score(folder, predictions, anyway=anyway).items():
            mine = table[table["method"].eq(label)].iloc[0]
            end, end_90, H = (f"{mine[name]:.4g} m" for name in ("H_end", "H_end_90", "H"))
            words = f"{label}: at the horizon {end}, nine in ten below {end_90}, H {H}"
            words += f"; beside N_D {' and '.join(map(str, sorted({*table['N_D'][table['method'].eq(label)]})))}"
            answer.say(f"{words}\nothers, and by how many % their H is above this one, with its 95 % interval:")
            answer.records(label, table, heads | {"better": "better runs"}, shown=table[table["method"].ne(label)])
    with show_steps() as say:
        shipid.write_pages(folder, say)


@app.command("compare")
def study_compare(
    folders: Annotated[
        list[Path],
        typer.Argument(help="two or more folders of runs; the first is what others meet"),
    ],
    pair: Annotated[
        list[str] | None,
        typer.Option(help="FIRST=OTHER: a family or method of the first run and its counterpart; may be repeated"),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="file for a row per comparison: .csv or .parquet")] = None,
    as_json: Json = False,
) -> None:
    """Compare runs with the first one: what their documents differ in, and errors of equal cells, paired."""
    if out is not None:
        check_output(out, endings=TABLES)
    matched = [one.partition("=") for one in pair or ()]
    if wrong := next(("".join(one) for one in matched if not all(one)), None):
        raise DocumentError(f"{wrong!r}: write --pair FIRST=OTHER, such as --pair instant=trained", path="--pair")
    with open_answer(as_json) as answer:
        errors = _show_matched(shipid.compare(folders, {first: other for first, _, other in matched}), answer)
        answer.save(f"{len(errors)} rows", out, errors)


def _show_matched(compared: Comparison, answer: Answer) -> DataFrame:
    """Show what differs between runs, and the errors of cells that match; returns these."""
    documents, errors, first = compared.documents, compared.errors, compared.names[0]
    heads = dict(zip(documents.columns, ["what differs", *compared.names], strict=True))
    shorten = dict.fromkeys(heads, lambda text: f"{text:.60}")
    answer.records("documents", documents, heads, shorten, shown=documents.head(MOST_DIFFERENCES))
    more = len(documents) - MOST_DIFFERENCES
    words = "the documents are equal" if documents.empty else f"and {more} more: --json shows all" if more > 0 else ""
    answer.say(words, folders=compared.names)
    answer.say(
        f"error at the horizon [m] and H [m], its mean over the horizon, of {first} and of the other run, and the "
        f"difference of H [%], by how much the other is above {first}, with its 95 % interval:"
    )
    heads = {"folder": "other run"} | CELL
    bands = {"coverage_first": f"in band of {first}", "coverage_other": "of the other"}
    banded = bool(errors[list(bands)].notna().any(axis=None))
    heads |= (
        {"cells": "cells", "first_end": f"at horizon, {first}", "other_end": "other"}
        | {"first": f"H, {first}", "other": "other"}
        | DIFFERENCE
        | (bands if banded else {})
        | {"verdict": "verdict"}
    )
    answer.records(
        "errors", errors, heads, dict.fromkeys(bands, lambda share: "-" if isnan(share) else percent_text(share))
    )
    answer.say("verdict: lower or higher where the test shows it, corrected for the rows of a run; empty: it does not")
    answer.say("\n".join(compared.notes), notes=compared.notes)
    return errors


def _run_to_report(
    plan: Plan,
    folder: Path,
    workers: int | None,
    scheduler: str | None,
    device: str,
    shard: tuple[int, int] | None = None,
) -> None:
    from shipid.answer.pages import ANSWER
    from shipid.answer.start import event_line
    from shipid.study import run, store
    from shipid.study.check import search_words
    from shipid.study.plan import program_of

    resume = f"{program_of(plan)} study resume {quote_argument(folder)}"
    with end_on_interrupt(f"interrupted; what is finished is kept. Continue with: {resume}"):
        events = run.run_study(plan, folder, workers=workers, scheduler=scheduler, device=device, shard=shard)
        # closing: where a line cannot be printed, the lock is given back before the process ends
        with closing(events), show_steps(look=lambda: search_words(plan, folder)):
            for event in events:
                if line := event_line(event):
                    typer.echo(escape_unprintable(line))
    if shard is not None:
        typer.echo(f"shard {shard[0]} of {shard[1]} is finished. When all are: {resume}")
        return
    with store.in_place(folder, plan), show_steps() as say:
        report = shipid.write_pages(folder, say)
    typer.echo(indent((folder / ANSWER).read_text(encoding="utf-8", errors="replace").rstrip("\n"), "  "))
    typer.echo(f"report: {report}")
