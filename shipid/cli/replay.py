"""`shipid replay`: recorded runs on a vessel."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from shipid.cli.answer import Json, open_answer
from shipid.cli.options import VesselName, command_line, document_stem
from shipid.cli.outputs import check_ending, check_output
from shipid.cli.terminal import motion_errors, text_table
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
    from shipid.data.dataset import read_dataset
    from shipid.data.windows import gaps_in_words
    from shipid.files import check_table, write_table
    from shipid.identification.free_run import missing_inputs, simulate_free_runs
    from shipid.identification.late import late_commands
    from shipid.identification.outcome import pick_runs
    from shipid.identification.segments import too_short
    from shipid.identification.settings import Identify
    from shipid.report.motion import REPLAYED, ReplayContent, write_replay
    from shipid.version import __version__
    from shipid.vessel.load import load_vessel

    file = out or Path(f"{document_stem(vessel)}-replay.html")
    check_ending(file, ".html")
    check_output(file, [], "--out")
    if not step > 0:
        raise ShipidError(f"{step:g} s must be positive", path="--step")
    if csv is not None:
        check_table(csv)
    ship, log = load_vessel(vessel), read_dataset(dataset)
    chosen, _ = pick_runs(log, runs or ())
    short = too_short(log, chosen, step, ahead)
    chosen = tuple(run for run in chosen if run not in short) or chosen
    settings = Identify(parameters=[next(iter(ship.parameters))], step=step, horizon=0.0, commands=commands)
    replayed = simulate_free_runs({REPLAYED: ship}, log, chosen, settings, ahead)
    zero = missing_inputs(ship, log, settings, chosen)
    holes = gaps_in_words(log.select(chosen), step)
    late = late_commands(ship, log, chosen) if commands == "held" else None
    rows = [[row["run"], *motion_errors(row)] for row in replayed.errors.to_dict("records")]
    timing = "; commands change between rows" if commands == "between" else ""
    content = ReplayContent(
        title=f"{ship.name}: recorded runs, replayed",
        name=ship.key,
        series=replayed.series,
        errors=replayed.errors.drop(columns="model"),
        ahead=ahead,
        provenance={
            "Vessel": f"{ship.name}, digest {ship.digest}",
            "Dataset": f"{dataset}, digest {log.digest}",
            "Simulation": f"rk4, steps of {step:g} s{timing}" + (f"; {', '.join(zero)} taken as 0" if zero else ""),
            "shipid": __version__,
        },
        command=command_line(),
    )
    with open_answer(as_json) as answer:
        answer.say(f"{ship.name}: root mean square errors, {f'{ahead:g} s' if ahead else 'whole runs'}")
        heads = ["run", "u [m/s]", "v [m/s]", "r [deg/s]", "position [m]"]
        answer.say(assumed=zero, late=None if late is None else late.words)
        if zero:
            answer.say(f"not in the log, taken as 0: {', '.join(zero)}")
        left_out = [run for run in short if run not in chosen]
        answer.say(left_out=left_out, gaps=holes)
        if left_out:
            answer.say(f"too short, left out: {', '.join(left_out)}")
        if holes:
            answer.say(f"{holes}: orders are held there")
        if late is not None:
            answer.say(f"{late.words}: the turns are late; compare with --commands between")
        answer.rows("errors", replayed.errors.drop(columns="model"), text_table(heads, rows))
        if csv is not None:
            write_table(csv, replayed.series)
            answer.say(f"motions -> {csv}", csv=csv)
        page = write_replay(content, file)
        answer.say(f"page -> {page}", page=page)
