"""`shipid simulate`, `manoeuvre` and `replay`: a vessel simulated, without recorded runs or along them."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated, Literal

import typer

import shipid
from shipid.cli.answer import CRITERIA, MEASURE_FORMATS, MEASURES, MOTION, MOTION_FORMATS, Json, open_answer
from shipid.cli.options import (
    Changes,
    StudyName,
    Trust,
    VesselName,
    check_output,
    command_line,
    document_stem,
    parse_changes,
)
from shipid.errors import DataError, DocumentError


def simulate_command(
    study: StudyName,
    out: Annotated[Path | None, typer.Option(help="Parquet file; default: <study>.parquet")] = None,
    changes: Changes = None,
    trust: Trust = False,
    as_json: Json = False,
) -> None:
    """Simulate the truth of a study into a dataset, and print its envelope beside the published one."""
    from shipid.study.envelope import envelope_table, input_envelope
    from shipid.study.plan import input_files
    from shipid.study.prepare import obtain_runs, partition, runs_by_amount

    plan = shipid.read_plan(study, parse_changes(changes), trust=trust)
    if plan.truth is None:
        raise DocumentError("has no [truth]: its runs are recorded, so there is nothing to simulate", file=plan.file)
    file = check_output(out or Path(f"{plan.name}.parquet"), input_files(plan), (".parquet",))
    dataset = obtain_runs(plan)
    pool, test, _ = partition(plan, dataset)
    rows_of_sets = input_envelope(pool, test, runs_by_amount(plan.study, pool), dataset.commands)
    ranges = envelope_table(rows_of_sets, plan.study.published)
    shipid.write_dataset(dataset, file)
    with open_answer(as_json) as answer:
        answer.say_dataset(dataset, file)
        answer.say("at the instants of prediction:")
        heads = {"min": "least", "mean": "mean", "max": "greatest"}
        answer.records("envelope", ranges, {"set": "set", "quantity": "quantity", "unit": "unit"} | heads)


def manoeuvre_command(
    vessel: VesselName,
    name: Annotated[str, typer.Argument(help="zigzag, turning, pull-out, spiral or stop")],
    angles: Annotated[
        list[float] | None,
        typer.Argument(
            help="helm in deg, of a zigzag also the execute heading",
            metavar="ANGLES",
        ),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="of the approach in m/s; default: U_0, else Froude number 0.2")
    ] = None,
    side: Annotated[str, typer.Option(help="starboard or port: side of the first turn")] = "starboard",
    duration: Annotated[float | None, typer.Option(help="of the log, of a spiral that of each level, in s")] = None,
    approach: Annotated[
        str | None,
        typer.Option(
            help="steady (helm amidships), helmsman (holds the course) or rest; default: steady, and the helmsman for "
            "a ship that does not go straight"
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="HTML page to write; default: <vessel>-<name>.html")] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV file of the measures to write")] = None,
    log: Annotated[Path | None, typer.Option(help="dataset of the run to write, .parquet")] = None,
    as_json: Json = False,
) -> None:
    """Simulate a standard manoeuvre: measures with the IMO criteria, and a page with plots."""
    from pandas import DataFrame

    from shipid.report.motion import write_manoeuvre
    from shipid.simulation.measured import approach_words, manoeuvre_content

    out = check_output(out or Path(f"{document_stem(vessel)}-{name}.html"), endings=(".html",))
    ship = shipid.load_vessel(vessel)
    done = shipid.measure_standard(
        ship, name, angles or (), speed=speed, side=side, duration=duration, approach=approach
    )
    title, approached_by = done.standard.title, done.standard.manoeuvre
    with open_answer(as_json) as answer:
        answer.say(
            f"{ship.name}: {title}, {approach_words(done)}",
            title=title,
            approach=approached_by.approach,
            speed=done.standard.speed,
            n=approached_by.n_rpm / 60,
        )
        answer.records("measures", done.measures, MEASURES, MEASURE_FORMATS)
        answer.records("criteria", done.criteria, CRITERIA)
        answer.save("measures", csv, DataFrame(done.measures))
        if log is not None:
            source = {"clock": "run", "flags": [], "source": f"simulated: {ship.name}, {title}"}
            answer.say(f"log -> {shipid.write_dataset(shipid.Dataset(done.frame, source), log)}", log=log)
        answer.say_page(write_manoeuvre(manoeuvre_content(done, command_line()), out))


def replay_command(
    vessel: VesselName,
    dataset: Annotated[Path, typer.Argument(help="dataset (Parquet) of runs")],
    runs: Annotated[
        list[str] | None, typer.Option("--run", help="runs, * for any part of a name; default: all")
    ] = None,
    ahead: Annotated[float, typer.Option(help="s of each simulation; 0: whole runs")] = 0.0,
    step: Annotated[float, typer.Option(min=1e-9, help="s, of the integration")] = 0.1,
    commands: Annotated[
        Literal["held", "between"],
        typer.Option(help="held: a command counts from its row to the next; between: it changes between the rows"),
    ] = "held",
    out: Annotated[Path | None, typer.Option(help="page to write; default: <vessel>-replay.html")] = None,
    csv: Annotated[Path | None, typer.Option(help="CSV or Parquet file of both motions to write")] = None,
    as_json: Json = False,
) -> None:
    """Replay recorded runs on a vessel: from the measured state, with the recorded orders; errors, and a page."""
    from shipid.data.windows import gaps_in_words
    from shipid.identification.diagnosis import diagnose
    from shipid.identification.free_run import missing_inputs, simulate_free_runs
    from shipid.identification.outcome import pick_runs
    from shipid.identification.segments import too_short
    from shipid.report.motion import REPLAYED, ReplayContent, write_replay

    file = check_output(out or Path(f"{document_stem(vessel)}-replay.html"), endings=(".html",))
    ship, log = shipid.load_vessel(vessel), shipid.read_dataset(dataset)
    chosen, _ = pick_runs(log, runs or ())
    short = too_short(log, chosen, step, ahead)
    chosen = tuple(run for run in chosen if run not in short) or chosen
    settings = shipid.Identify(parameters=[next(iter(ship.parameters))], step=step, horizon=0.0, commands=commands)
    replayed = simulate_free_runs({REPLAYED: ship}, log, chosen, settings, ahead)
    zero = missing_inputs(ship, log, settings, chosen)
    holes = gaps_in_words(log.select(chosen), step)
    found = ""
    with suppress(DataError):  # of runs too short for it the errors say all there is
        found = diagnose(ship, log, chosen).sentence
    errors = replayed.errors.drop(columns="model")
    timing = "; commands change between rows" if commands == "between" else ""
    content = ReplayContent(
        title=f"{ship.name}: recorded runs, replayed",
        name=ship.key,
        series=replayed.series,
        errors=errors,
        ahead=ahead,
        provenance={
            "Vessel": f"{ship.name}, digest {ship.digest}",
            "Dataset": f"{dataset}, digest {log.digest}",
            "Simulation": f"rk4, steps of {step:g} s{timing}" + (f"; {', '.join(zero)} taken as 0" if zero else ""),
            "shipid": shipid.__version__,
        },
        command=command_line(),
    )
    with open_answer(as_json) as answer:
        answer.say(f"{ship.name}: root mean square errors, {f'{ahead:g} s' if ahead else 'whole runs'}")
        left_out = [run for run in short if run not in chosen]
        notes = [
            f"not in the log, taken as 0: {', '.join(zero)}" if zero else "",
            f"too short, left out: {', '.join(left_out)}" if left_out else "",
            f"{holes}: orders are held there" if holes else "",
            found,
        ]
        answer.say("\n".join(filter(None, notes)), assumed=zero, left_out=left_out, gaps=holes, diagnosis=found)
        answer.records("errors", errors, {"run": "run"} | MOTION, MOTION_FORMATS)
        answer.save("motions", csv, replayed.series)
        answer.say_page(write_replay(content, file))
