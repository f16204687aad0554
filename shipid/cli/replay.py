"""`shipid replay`: recorded runs on a vessel."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

import shipid
from shipid.cli.answer import Json, open_answer
from shipid.cli.options import VesselName, command_line, document_stem
from shipid.cli.outputs import check_output
from shipid.cli.terminal import MOTION, MOTION_FORMATS
from shipid.errors import ShipidError


def replay_command(
    vessel: VesselName,
    dataset: Annotated[Path, typer.Argument(help="dataset (Parquet) of runs")],
    runs: Annotated[
        list[str] | None, typer.Option("--run", help="runs, * for any part of a name; default: all")
    ] = None,
    ahead: Annotated[float, typer.Option(help="s of each simulation; 0: whole runs")] = 0.0,
    step: Annotated[float, typer.Option(help="s, of the integration")] = 0.1,
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
    from shipid.identification.free_run import missing_inputs, simulate_free_runs
    from shipid.identification.late import late_commands
    from shipid.identification.outcome import pick_runs
    from shipid.identification.segments import too_short
    from shipid.report.motion import REPLAYED, ReplayContent, write_replay

    file = check_output(out or Path(f"{document_stem(vessel)}-replay.html"), endings=(".html",))
    if not step > 0:
        raise ShipidError(f"{step:g} s must be positive", path="--step")
    ship, log = shipid.load_vessel(vessel), shipid.read_dataset(dataset)
    chosen, _ = pick_runs(log, runs or ())
    short = too_short(log, chosen, step, ahead)
    chosen = tuple(run for run in chosen if run not in short) or chosen
    settings = shipid.Identify(parameters=[next(iter(ship.parameters))], step=step, horizon=0.0, commands=commands)
    replayed = simulate_free_runs({REPLAYED: ship}, log, chosen, settings, ahead)
    zero = missing_inputs(ship, log, settings, chosen)
    holes = gaps_in_words(log.select(chosen), step)
    late = late_commands(ship, log, chosen) if commands == "held" else None
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
            f"{late.words}: the turns are late; compare with --commands between" if late is not None else "",
        ]
        answer.say(
            "\n".join(filter(None, notes)), assumed=zero, left_out=left_out, gaps=holes, late=late and late.words
        )
        answer.records("errors", errors, {"run": "run"} | MOTION, MOTION_FORMATS)
        answer.save("motions", csv, replayed.series)
        page = write_replay(content, file)
        answer.say(f"page -> {page}", page=page)
