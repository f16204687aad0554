"""`shipid study`: questions, run and answered."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from shipid.cli.answer import Answer, Json, open_answer
from shipid.cli.options import Changes, Device, Folder, Scheduler, StudyName, Workers, document_stem, parse_changes
from shipid.cli.outputs import check_output
from shipid.cli.terminal import (
    count_blocks,
    end_on_interrupt,
    four_digits,
    shorten_text,
    show_steps,
    text_table,
)
from shipid.errors import DocumentError, ShipidError, escape_unprintable
from shipid.units import digit_decimals, length_decimals, length_text, level_text, percent_text, plural_word

if TYPE_CHECKING:
    from pandas import DataFrame

    from shipid.answer.compare import Comparison
    from shipid.study.plan import Plan
    from shipid.study.results import Results

app = typer.Typer(no_args_is_help=True, help="Studies: questions, run and answered.")
MOST_DIFFERENCES = 20  # of documents, on a terminal
FINDING: tuple[Literal["id", "claim", "verdict", "evidence"], ...] = ("id", "claim", "verdict", "evidence")


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
        list[str],
        typer.Option(help="bundled name, or path of a vessel or patch; may be repeated"),
    ],
    data: Annotated[
        Path | None, typer.Option(help="dataset (Parquet) of recorded runs; without it the vessel is simulated")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="TOML file to write; default: <data or vessel>-study.toml in this folder")
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a study of your vessel and runs that runs as it is, each choice with its reason."""
    from shipid.files import check_new, quote_argument, write_new
    from shipid.study.new import draft_study

    file = out or Path(f"{document_stem(data or vessel[0])}-study.toml")
    check_new(file, "study")
    check_output(file, [], "--out")
    draft = draft_study(vessel, data, file)
    write_new(draft.text, file, "study")
    with open_answer(as_json) as answer:
        choices = [
            {"path": choice.path, "value": _toml_text(choice.value), "why": choice.why} for choice in draft.choices
        ]
        answer.rows("choices", choices, None)
        for choice in choices:
            answer.say(f"{choice['path']} = {choice['value']}" + (f"  # {choice['why']}" if choice["why"] else ""))
        for warning in draft.warnings:
            typer.echo(f"warning: {warning}", err=True)
        for look in draft.looks.values():
            if not look.wrong:
                answer.say(look.sentence)
        models = [model.name for model in draft.plan.foundations]
        sentence = f"{draft.plan.cells} cells of {len(models)} foundations ({', '.join(models)}) -> {file}"
        answer.say(sentence, file=file, cells=draft.plan.cells, foundations=models, warnings=draft.warnings)
        answer.say(f"run it with: shipid study run {quote_argument(file)}")


def _toml_text(value: Any) -> str:
    """A value as the study document has it; a text alone without quotes."""
    from tomlkit import item

    def inline(one: Any) -> str:
        if isinstance(one, dict):
            return f"{{{', '.join(f'{key} = {inline(inner)}' for key, inner in one.items())}}}"
        if isinstance(one, list | tuple):
            return f"[{', '.join(map(inline, one))}]"
        return str(item(one).as_string())

    return value if isinstance(value, str) else inline(value)


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
    as_json: Json = False,
) -> None:
    """Show how accurate many members of a study's families are on all its windows, and which factors drive that."""
    from shipid.engine.engines import ENGINES, REPEATED, engine_by_name
    from shipid.files import write_table
    from shipid.study import screen
    from shipid.study.prepare import obtain_runs, partition

    engine = "single" if single else REPEATED
    engine_by_name(engine, device)
    if single and not ENGINES[engine].available():
        raise ShipidError("needs a C compiler, and there is none: install gcc, or leave it out", path="--single")
    plan, file = _prepare_command(study, changes, device, out, "screen")
    wanted, dataset = screen.drawn_families(plan, family), obtain_runs(plan)
    cut = partition(plan, dataset)
    for note in screen.notes_on_windows(plan, cut, wanted):
        typer.echo(note, err=True)
    blocks = count_blocks(screen.screen(plan, dataset, wanted, members, device, engine, cut), members * len(wanted))
    frame = screen.join_blocks(list(blocks))
    write_table(file, frame)
    spread = screen.accuracy_quantiles(frame)
    shares = [percent_text(share) for share in screen.QUANTILES_OF_A]
    rows = [[*map(str, row[:3]), *map(length_text, row[3:])] for row in spread.itertuples(index=False)]
    correlations = screen.drivers_of_accuracy(frame)
    pairs = [
        (str(row.family), str(row.paths), f"{row.factor:+.2f}", f"{row.away:+.2f}") for row in correlations.itertuples()
    ]
    with open_answer(as_json) as answer:
        answer.say("accuracy A [m] that so many of the members reach:")
        answer.rows("accuracy", spread, text_table(["family", "members", "diverged", *shares], rows))
        if pairs:
            answer.say("what drives A: rank correlation with a factor, and with its distance from 1:")
        shown = text_table(["family", "parameter", "factor", "distance"], pairs)
        answer.rows("drivers", correlations, shown if pairs else None)
        for row in spread[~spread["family"].isin(correlations["family"])].to_dict("records"):
            count = row["members"] - row["diverged"]
            answer.say(f"{row['family']}: {count} {plural_word(count, 'member shows', 'members show')} no driver of A")
        answer.say(f"{len(frame)} members -> {file}", file=file)


@app.command("rotate")
def study_rotate(
    study: StudyName,
    tests: Annotated[list[str], typer.Option(help="runs that test in turn, * for any part of a name; may be repeated")],
    out: Annotated[
        Path | None,
        typer.Option(help="file for a row per turn and cell: .csv or .parquet; default: <study>-rotate.csv"),
    ] = None,
    changes: Changes = None,
    device: Device = "cpu",
    as_json: Json = False,
) -> None:
    """Test on every run in turn and train on all others; the same command goes on after an interruption."""
    from shipid.answer import rotate
    from shipid.files import write_table
    from shipid.study.prepare import obtain_runs

    plan, file = _prepare_command(study, changes, device, out, "rotate")
    dataset = obtain_runs(plan)
    wanted = rotate.choose_turns(plan, dataset, tests)
    from shipid.study.plan import grid_seeds

    cells = len(wanted) * len(plan.pairs) * len(grid_seeds(plan))
    import pandas as pd

    kept = rotate.kept_folder(file, plan, dataset, device)
    blocks = rotate.rotate_test_runs(plan, dataset, wanted, device, kept)
    sentence = f"interrupted; what is finished is kept in {kept.parent}: the same command goes on from there"
    frame = pd.concat(list(count_blocks(blocks, cells, "cells", sentence)), ignore_index=True)
    write_table(file, frame)
    rotate.remove_kept(kept)
    columns, rows = ["A", "H", "least", "greatest", "H_90", "width"], []
    over = rotate.turns_table(frame)
    from shipid.study.plan import model_label

    for row in over.to_dict("records"):
        better = "-" if row["better"] != row["better"] else f"{row['better']:.0f} of {row['turns']}"
        name = model_label(plan, row["foundation"], row["method"])
        inside = "-" if row["coverage"] != row["coverage"] else percent_text(row["coverage"])
        rows.append([name, *(four_digits(row[column]) for column in columns), inside, better])
    band = f"in band of {level_text(plan.study.bands.level)}"
    heads = ["foundation", "A", "H", "least H", "greatest H", "H_90", "radius of band", band, "H below A"]
    verdicts = rotate.turn_findings(frame, plan)
    naive = frame.groupby("test")["naive"].first().mean()
    from shipid.study.plan import families_set_from

    with open_answer(as_json) as answer:
        answer.say(f"H and A [m], each of {len(wanted)} runs is the test run in turn, the others train:", tests=wanted)
        answer.rows("turns", over, text_table(heads, rows))
        answer.say(f"constant u, v, r: {four_digits(naive)} m", naive=naive)
        if saw := families_set_from(plan, wanted):
            answer.say(
                f"{', '.join(saw)}: numbers set from runs that test here, A and H are not those of new runs", saw=saw
            )
        if verdicts:
            answer.say("findings over the turns, in brackets 95 % intervals:")
        shown = text_table(
            ["finding", "claim", "verdict", "evidence"], (tuple(one[key] for key in FINDING) for one in verdicts)
        )
        answer.rows("findings", verdicts, shown if verdicts else None)
        answer.say(f"{len(frame)} cells -> {file}", file=file)


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
) -> None:
    """Run a study and write its report; an interrupted run resumes when started again."""
    from shipid.study.workers import import_for_workers

    if scheduler is None:
        import_for_workers()  # before this process imports for itself
    from shipid.study.plan import read_plan

    plan = read_plan(study, parse_changes(changes))
    from shipid.study.plan import default_folder

    _run_to_report(plan, out or default_folder(plan), workers, scheduler, device, _shard(shard))


def _shard(text: str | None) -> tuple[int, int] | None:
    """The numbers of `--shard i/n`."""
    if text is None:
        return None
    number, _, count = text.partition("/")
    if not (number.isdecimal() and count.isdecimal()):
        raise ShipidError(f"{text!r}: write i/n, such as 3/20", path="--shard")
    return int(number), int(count)


@app.command("prepare")
def study_prepare(
    study: StudyName,
    out: Annotated[Path | None, typer.Option(help="folder; default results/<study>-<digest>")] = None,
    changes: Changes = None,
    device: Device = "cpu",
) -> None:
    """Make the folder of a study with its runs, so that the tasks of a job array can work there with --shard."""
    from shipid.study.plan import read_plan
    from shipid.study.run import prepare_study

    plan = read_plan(study, parse_changes(changes))
    from shipid.study.plan import default_folder

    for event in prepare_study(plan, out or default_folder(plan), device=device):
        typer.echo(event.text)


@app.command("resume")
def study_resume(
    folder: Folder,
    workers: Workers = None,
    scheduler: Scheduler = None,
    device: Device = "cpu",
) -> None:
    """Continue an interrupted run."""
    from shipid.study.store import stored_plan

    _run_to_report(stored_plan(folder), folder, workers, scheduler, device)


@app.command("report")
def study_report(folder: Folder) -> None:
    """Write report.html, summary.md and results.parquet from what is stored."""
    from shipid.answer.pages import write_pages

    with show_steps() as say:
        report = write_pages(folder, say)
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
    """Compare runs with the first one: what their documents differ in, and H of equal cells with paired intervals.

    Finished runs of one study in several worlds (another --set seed= each) are repetitions: then it shows findings and
    errors over the worlds.
    """
    from shipid.answer import compare
    from shipid.files import check_table, write_table

    if out is not None:
        check_table(out)
    with open_answer(as_json) as answer:
        if pair is None and compare.are_worlds(folders):
            errors = _show_worlds(compare.read_worlds(folders), answer)
        else:
            pairs = dict(_parse_counterpart(one) for one in pair or ())
            errors = _show_matched(compare.compare(folders, pairs), answer)
        if out is not None:
            write_table(out, errors)
            answer.say(f"{len(errors)} rows -> {out}", file=out)


def _parse_counterpart(pair: str) -> tuple[str, str]:
    first, equals, other = pair.partition("=")
    if not (first and equals and other):
        raise DocumentError(f"{pair!r}: write --pair FIRST=OTHER, such as --pair drawn=trained", path="--pair")
    return first, other


def _show_matched(compared: Comparison, answer: Answer) -> DataFrame:
    """Show what differs between runs, and the errors of cells that match; returns these."""
    documents, errors = compared.documents, compared.errors
    answer.say("", folders=compared.names)
    rows = [[shorten_text(str(text), 60) for text in row] for row in documents.itertuples(index=False)]
    shown = text_table(["what differs", *compared.names], rows[:MOST_DIFFERENCES])
    answer.rows("documents", documents, shown if rows else None)
    if not rows:
        answer.say("the documents are equal")
    elif len(rows) > MOST_DIFFERENCES:
        answer.say(f"and {len(rows) - MOST_DIFFERENCES} more: --json shows all")
    banded = bool(errors[["coverage_first", "coverage_other"]].notna().any(axis=None))
    for name, part in errors.groupby("folder", sort=False):
        first = compared.names[0]
        answer.say(f"H [m] of {first}, of {name}, and the difference, {name} less {first}, with its 95 % interval:")
        heads = [
            "family",
            "method",
            "N_D",
            "cells",
            first,
            str(name),
            "difference",
            *["in band"] * banded,
            "verdict",
        ]
        places = max(3, *map(length_decimals, part[["first", "other"]].max(axis=1)))
        lines = [_difference_words(row, places, banded) for row in part.to_dict("records")]
        answer.rows("errors", errors, text_table(heads, lines))
        answer.say(
            f"verdict: lower or higher where the test shows it, corrected for {len(part)} rows; empty: it does not"
        )
    if banded:
        answer.say("in band: share of the test paths that lie whole in the bands of the first and of the other run")
    answer.say("\n".join(compared.notes), notes=compared.notes)
    return errors


def _difference_words(row: Mapping[Any, Any], places: int, banded: bool) -> list[str]:
    """One row of a comparison as words, with so many decimals."""
    known = row["low"] == row["low"] and row["verdict"] != "identical"
    interval = f" [{row['low']:+.{places}f}, {row['high']:+.{places}f}]" if known else ""
    amount = "A" if row["N_D"] == 0 else str(row["N_D"])
    shares = row["coverage_first"], row["coverage_other"]
    inside = ", ".join("-" if share != share else percent_text(share) for share in shares)
    return [
        *(row["family"], row["method"], amount, str(row["cells"])),
        *(f"{row[side]:.{places}f}" for side in ("first", "other")),
        f"{row['difference']:+.{places}f}{interval}",
        *["" if inside == "-, -" else inside] * banded,
        row["verdict"],
    ]


def _length_with_ends(mean: float, low: float, high: float) -> str:
    """A length [m] with an interval, in the decimals of the length."""
    places = length_decimals(mean)
    return f"{mean:.{places}f} [{low:.{places}f}, {high:.{places}f}]"


def _number_with_ends(mean: float, low: float, high: float) -> str:
    """A number with its interval, if it has one, in the decimals that give the largest of them three digits."""
    size = max((abs(value) for value in (mean, low, high) if math.isfinite(value)), default=0.0)
    places = digit_decimals(size, 3)
    interval = f" [{low:z.{places}f}, {high:z.{places}f}]" if math.isfinite(low) else ""
    return f"{mean:z.{places}f}{interval}"


def _show_worlds(worlds: list[Results], answer: Answer) -> DataFrame:
    """Show findings, errors and bands of one study over several worlds; returns the errors."""
    from shipid.answer.compare import compare_errors, compare_findings

    findings, errors = compare_findings(worlds), compare_errors(worlds)
    bands = errors[errors["width"].notna()]
    words = ["finding", f"in {len(worlds)} worlds", "number", "mean [95 % over worlds]"]
    values = [
        _number_with_ends(row["mean"], row["low"], row["high"]) if row["number"] else ""
        for row in findings.to_dict("records")
    ]
    shown = text_table(words, zip(findings["id"], findings["verdicts"], findings["number"], values, strict=True))
    answer.rows("findings", findings, shown if len(findings) else None)
    texts = [_length_with_ends(*numbers) for numbers in errors[["H", "H_low", "H_high"]].to_numpy()]
    several = bool(errors.duplicated(["family", "N_D"]).any())
    names = errors["family"] + (" + " + errors["method"]).where((errors["N_D"] > 0) & several, "")
    wide = errors.assign(text=texts, family=names).pivot(index="family", columns="N_D", values="text")
    wide = wide.reindex(names.unique()).fillna("-")
    columns = ["H [m], mean [least, greatest]", *(f"N_D = {amount}" for amount in wide.columns)]
    answer.rows("errors", errors, text_table(columns, wide.reset_index().to_numpy().tolist()))
    if len(bands):
        level = worlds[0].plan.study.bands.level
        answer.say(
            f"bands of {level_text(level)}: share of whole test paths inside, and mean radius [m], "
            "mean [least, greatest]:"
        )
    rows = [
        [
            *(str(row[name]) for name in ("family", "method", "N_D")),
            "{:.2f} [{:.2f}, {:.2f}]".format(*(row[f"coverage{end}"] for end in ("", "_low", "_high"))),
            _length_with_ends(*(row[f"width{end}"] for end in ("", "_low", "_high"))),
            str(row["worlds"]),
        ]
        for row in bands.to_dict("records")
    ]
    heads = ["family", "method", "N_D", "coverage", "width [m]", "worlds"]
    answer.rows("bands", bands, text_table(heads, rows) if rows else None)
    return errors


def _prepare_command(
    study: str, changes: list[str] | None, device: str, out: Path | None, command: str
) -> tuple[Plan, Path]:
    """The plan of a study and the file of a command's table, after all that can be refused before anything is done."""
    from shipid.engine.engines import check_device
    from shipid.files import check_table
    from shipid.study.plan import read_plan

    check_device(device)
    plan = read_plan(study, parse_changes(changes))
    file = out or Path(f"{plan.name}-{command}.csv")
    check_table(file)
    from shipid.study.plan import input_files

    check_output(file, input_files(plan), "--out")
    return plan, file


def _run_to_report(
    plan: Plan,
    folder: Path,
    workers: int | None,
    scheduler: str | None,
    device: str,
    shard: tuple[int, int] | None = None,
) -> None:
    from shipid.answer.pages import ANSWER, write_pages
    from shipid.answer.start import event_line
    from shipid.files import quote_argument
    from shipid.study import run, store
    from shipid.study.plan import program_of
    from shipid.study.progress import search_words

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
        report = write_pages(folder, say)
    for line in (folder / ANSWER).read_text(encoding="utf-8", errors="replace").splitlines():
        typer.echo(f"  {line}")
    typer.echo(f"report: {report}")
