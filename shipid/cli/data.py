"""`shipid data`: import, check, cut and measure logs of sea trials."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

import shipid
from shipid.cli.answer import CRITERIA, MEASURE_FORMATS, MEASURES, Answer, Json, open_answer, show_steps
from shipid.cli.options import MappingName, check_output
from shipid.errors import DataError, ShipidError
from shipid.files import write_new
from shipid.units import percent_text, plural_word

if TYPE_CHECKING:
    from shipid.logs.guess.search import Frame

app = typer.Typer(no_args_is_help=True, help="Data: import, check and fetch logs of sea trials.")


@app.command("fetch")
def data_fetch(
    name: Annotated[str, typer.Argument(help="a public log, such as gunnerus-2022")],
) -> None:
    """Get a public log by URL and checksum, or take it from the folder SHIPID_DATA."""
    from shipid.logs.catalogue import fetch_log

    typer.echo(str(fetch_log(name)))


@app.command("import")
def data_import(
    mapping: MappingName = "",
    log: Annotated[Path | None, typer.Argument(help="raw log; default: the public original of the mapping")] = None,
    out: Annotated[
        Path | None, typer.Option(help="file to write, .parquet (with --guess .toml); default: in this folder")
    ] = None,
    without: Annotated[list[str] | None, typer.Option(help="repair to leave out, such as heading_offset")] = None,
    guess: Annotated[
        Path | None,
        typer.Option(help="draft a mapping of this log, folder of logs or glob in quotes, instead of importing it"),
    ] = None,
    topics: Annotated[Path | None, typer.Option(help="list the topics of this recording (ROS, PX4, ArduPilot)")] = None,
    names: Annotated[
        str,
        typer.Option(help="with --guess: names of the columns, a,b,c, of a log without any, or of the topics to read"),
    ] = "",
    vessel: Annotated[
        str | None,
        typer.Option(help="with --guess: vessel whose names the commands take"),
    ] = None,
    frame: Annotated[
        Literal["ned", "enu", "zup", "ros"] | None,
        typer.Option(
            help="with --guess: ned (x north, y east, heading clockwise), enu (x east, y north, heading clockwise), "
            "zup (y and heading to port of x), ros (x east, y north, heading counter-clockwise from east)"
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Import a raw log by a declared mapping into a dataset; every repair is counted and flagged."""
    if topics is not None:
        from shipid.logs.readers import list_topics

        with open_answer(as_json) as answer:
            answer.records("topics", list_topics(topics), formats={"rate": "{:.3g} Hz".format})
        return
    if guess is not None:
        if mapping or log or without:
            raise ShipidError("--guess drafts a mapping of one log: give neither mapping nor repairs", file=guess)
        with open_answer(as_json) as answer:
            _draft_mapping(guess, tuple(filter(None, names.split(","))), vessel, frame, out, answer)
        return
    if names or vessel or frame:
        raise ShipidError("is for drafts: give it with --guess LOG", path="--names, --vessel or --frame")
    if not mapping:
        raise ShipidError("missing: name a mapping, or draft one with --guess LOG", path="MAPPING")
    from shipid.logs.catalogue import fetch_log

    declared = shipid.read_mapping(mapping)
    file = check_output(out or Path(f"{Path(mapping).stem}.parquet"), [Path(mapping)], (".parquet",))
    source = log or fetch_log(mapping)
    check_output(file, [source, *source.glob("*")])
    with show_steps() as say:
        dataset = shipid.import_log(
            declared,
            source,
            without=without or (),
            progress=lambda share: say(f"{source.name}: {percent_text(share)} read"),
        )
    with open_answer(as_json) as answer:
        answer.records("repairs", dataset.metadata.get("repairs", []))
        answer.say_dataset(dataset, shipid.write_dataset(dataset, file))


def _draft_mapping(
    log: Path, names: tuple[str, ...], vessel: str | None, frame: Frame | None, out: Path | None, answer: Answer
) -> None:
    from shipid.logs.guess.draft import NOT_YET, draft_mapping

    if out is not None:
        check_output(out, endings=(".toml",))
    guessed = shipid.guess(log, names, shipid.load_vessel(vessel) if vessel else None, frame)
    file = check_output(out or Path(f"{guessed.file.resolve().stem}.toml"), endings=(".toml",))
    text = draft_mapping(guessed)
    write_new(text, file)
    columns = [
        {"column": c.name, "from": c.source, "unit": c.unit, "sure": c.confidence, "why": c.evidence}
        for c in guessed.columns
    ]
    answer.records("columns", columns, formats={"sure": percent_text})
    findings = [{"finding": f.kind, "sure": f.confidence, "what": f.sentence} for f in guessed.findings]
    answer.records("findings", findings, formats={"sure": percent_text})
    source = guessed.source
    questions = [question.sentence for question in guessed.questions]
    faults = [line.removeprefix("# ") for line in text.splitlines() if line.startswith(NOT_YET)]
    lines = [
        f"{len(source.files)} files {source.pattern!r} are one source" if source.pattern is not None else "",
        *(f"left out: {name}: {why}" for name, why in source.skipped.items()),
        *(f"not used: {name}: {why}" for name, why in guessed.unused.items()),
        *(f"note: {note}" for note in guessed.sniffed.notes),
        *(f"? {question}" for question in questions),
        *faults,
    ]
    answer.say(
        "\n".join(filter(None, lines)),
        files=len(source.files),
        left_out=source.skipped,
        unused=guessed.unused,
        notes=guessed.sniffed.notes,
        questions=questions,
        faults=faults,
    )
    answer.say(f"draft -> {file}: read it before you import with it", file=file)


@app.command("segment")
def data_segment(
    mapping: MappingName,
    log: Annotated[Path | None, typer.Argument(help="raw log; default: the public original of the mapping")] = None,
    out: Annotated[Path | None, typer.Option(help="TOML file to write; default: in this folder")] = None,
    as_json: Json = False,
) -> None:
    """Find the manoeuvres of a log and write them as segments, to be corrected and put into the mapping."""
    from shipid.logs.catalogue import fetch_log
    from shipid.logs.guess.draft import clock_moment, segment_log, segments_text

    declared = shipid.read_mapping(mapping)
    if declared.parts is not None:
        raise ShipidError("its [parts] say where runs begin: import it as it is", file=mapping)
    file = check_output(out or Path(f"{Path(mapping).stem}-segments.toml"), endings=(".toml",))
    unit = declared.clock.unit
    segments = segment_log(declared, log or fetch_log(mapping))
    write_new(segments_text(segments, unit), file)
    with open_answer(as_json) as answer:
        rows = [one.model_dump(exclude={"manoeuvre"}, exclude_none=True) for one in segments]
        answer.records("segments", rows, formats=dict.fromkeys(("start", "end"), lambda time: clock_moment(time, unit)))
        answer.say(f"{len(segments)} segments -> {file}", file=file)


@app.command("check")
def data_check(
    dataset: Annotated[Path, typer.Argument(help="dataset written by `shipid data import`")],
    vessel: Annotated[str | None, typer.Option(help="vessel that made the log: what is wrong with both")] = None,
    html: Annotated[Path | None, typer.Option(help="page to write, with plots of what the checks compare")] = None,
    as_json: Json = False,
) -> None:
    """Check a dataset: its clock, ranges and frozen rows, and whether its signals are one motion."""
    from shipid.data.checks import warn_of_constant_commands
    from shipid.identification.diagnosis import NONE, diagnose

    log, ship = shipid.read_dataset(dataset), shipid.load_vessel(vessel) if vessel else None
    checks = shipid.check_dataset(log)
    failed = checks[~checks["ok"].astype(bool)]
    counts = checks.assign(failed=checks.index.isin(failed.index)).groupby("check", sort=False)
    with open_answer(as_json) as answer:
        if html is not None:
            from shipid.figures import check_content
            from shipid.report.logs import write_checks

            answer.say_page(write_checks(check_content(dataset.stem, log, checks), html))
        shown = counts.agg(runs=("ok", "size"), failed=("failed", "sum")).reset_index()
        answer.records("checks", checks, shown=shown)
        answer.records("failed", failed, {"run": "run", "check": "failed", "sentence": "what to look at"})
        passed = len(checks) - len(failed)
        answer.say(f"{passed} of {len(checks)} checks passed", passed=passed)
        notes = warn_of_constant_commands(log, log.runs)
        answer.say("\n".join(f"note: {note}" for note in notes), notes=notes)
        cause = NONE
        with suppress(DataError):  # of runs too short for it the checks say all there is
            found = diagnose(ship, log)
            cause = found.cause
            answer.say(f"{ship.name if ship else 'the motion alone'}: {found.sentence}", cause=cause)
    if len(failed) or cause != NONE:
        raise typer.Exit(1)


@app.command("measures")
def data_measures(
    dataset: Annotated[Path, typer.Argument(help="dataset (Parquet)")],
    manoeuvre: Annotated[
        str | None, typer.Option(help="what every run is, such as zigzag or spiral; default: what is recognised")
    ] = None,
    length: Annotated[float | None, typer.Option(help="of the ship between perpendiculars in m, for criteria")] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file of the measures to write")] = None,
    as_json: Json = False,
) -> None:
    """Measure the standard manoeuvres of a dataset: overshoots, advance, tactical diameter, ..."""
    from shipid.logs.measuring import measure_dataset

    result = measure_dataset(shipid.read_dataset(dataset), manoeuvre, length)
    left = [{"run": run, "because": why} for run, why in result.left.items()]
    run = {"run": "run"}
    with open_answer(as_json) as answer:
        answer.records("measures", result.measures, run | {"kind": "kind"} | MEASURES, MEASURE_FORMATS)
        answer.records("criteria", result.criteria, run | CRITERIA)
        answer.records("left", left)
        measured = len(set(result.measures.get("run", ())))
        answer.say(f"{measured} {plural_word(measured, 'run')} measured, {len(left)} not")
        answer.save("measures", csv, result.measures)
