"""`shipid identify`: numbers of a vessel from runs."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shipid.cli.answer import Answer, Json, answering
from shipid.cli.completion import files
from shipid.cli.options import VesselName, command_line, pairs, parsed, stem
from shipid.cli.terminal import digits, iterations, table
from shipid.errors import ShipidError

if TYPE_CHECKING:
    from shipid.data.dataset import Dataset
    from shipid.identification.outcome import Identified
    from shipid.vessel.load import Vessel


def identify(
    vessel: VesselName,
    dataset: Annotated[Path, typer.Argument(help="dataset (Parquet) of runs", autocompletion=files(".parquet"))],
    parameters: Annotated[
        list[str] | None,
        typer.Option(help='numbers to identify: dotted paths, "hull.derivatives.*", "...\\[order >= 3]"'),
    ] = None,
    fixed: Annotated[list[str] | None, typer.Option(help="paths to leave out of --parameters")] = None,
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
    band: Annotated[
        float | None, typer.Option(help="level of bands on the measures of standard manoeuvres, such as 0.9")
    ] = None,
    design: Annotated[bool, typer.Option("--design", help="rank the manoeuvres to run next")] = False,
    out: Annotated[
        Path | None, typer.Option(help="patch to write, .toml; default: <vessel>-identified.toml in this folder")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="page to write, with plots")] = None,
    as_json: Json = False,
) -> None:
    """Identify numbers of a vessel from runs: estimates with intervals, tests on runs held out, a patch."""
    from shipid.data.dataset import read_dataset
    from shipid.files import check_new
    from shipid.identification.outcome import check, read_settings, run_identification, write_patch
    from shipid.vessel.load import load_vessel

    file = out or Path(f"{stem(vessel)}-identified.toml")
    check_new(file, "patch")
    if html is not None and html.suffix != ".html":
        raise ShipidError("a page is an HTML file: let the name end in .html", file=html)
    given: dict[str, Any] = {
        "parameters": parameters,
        "fixed": fixed,
        "together": together and [group.split(",") for group in together],
        "prior": prior and pairs(prior, "--prior", "paths=0.3"),
        "bounds": bounds and pairs(bounds, "--bounds", "paths=[0.5,2]"),
        "nuisance": nuisance and _widths(nuisance),
        "horizon": horizon,
    }
    options = {key: value for key, value in given.items() if value is not None}
    declared = read_settings(settings, options | parsed(changes))
    ship, log = load_vessel(vessel), read_dataset(dataset)
    check(ship, log, declared, runs or (), test or (), ahead=ahead, profiles=profile or ())
    with answering(as_json) as answer:
        _look(ship, log, runs or (), test or (), answer)
        try:
            with iterations() as progress:
                outcome = run_identification(
                    ship, log, declared, runs or (), test or (), ahead=ahead, profiles=profile or (), programme=design,
                    band=band, progress=progress,
                )  # fmt: skip
        except KeyboardInterrupt:
            sys.stderr.write("interrupted: nothing was written\n")
            sys.exit(130)
        _show_identified(outcome, answer)
        write_patch(outcome, file)
        count = len(outcome.solution.values)
        answer.say(f"{count} number{'s' * (count != 1)} as a patch on {ship.key} -> {file}", file=file)
        if html is not None:
            from shipid.identification.contents import identification_content
            from shipid.report.identification import write_identification

            content = identification_content(outcome, dataset, command_line())
            answer.say(f"page -> {write_identification(content, html)}", page=html)


def _look(ship: Vessel, log: Dataset, runs: Sequence[str], test: Sequence[str], answer: Answer) -> None:
    """Say what is off between vessel and log before anything is fitted, and draft the correction."""
    from shipid.errors import DataError
    from shipid.identification.outcome import pick_runs
    from shipid.study.first_look import first_look
    from shipid.study.new import proposed_horizon

    fitted, _ = pick_runs(log, runs, test)
    try:
        ahead, step = proposed_horizon(ship, log)
        found = first_look(ship, log, fitted, ahead=ahead, step=step)
    except DataError:
        return  # the fit says what is missing
    if found.wrong:
        typer.echo(f"warning: {found.sentence}", err=True)
    else:
        answer.say(found.sentence)
    answer.say(first_look=found.sentence)
    if found.changes:
        answer.say("draft of a correction, to begin with:")
        patch = found.patch(str(ship.file))
        answer.say(patch, correction=patch)


def _widths(given: list[str]) -> list[str] | dict[str, Any]:
    """Return the names; or name -> width if any has one, with the default width for the others."""
    if not any("=" in name for name in given):
        return given
    from shipid.identification.settings import WIDE

    named = {name: WIDE.get(name, 1.0) for name in given if "=" not in name}
    return named | pairs([name for name in given if "=" in name], "--nuisance", "current=0.3")


def _show_identified(outcome: Identified, answer: Answer) -> None:
    """Print estimates, what is not identified, free runs, manoeuvres, manoeuvres to run next, and warnings."""
    solution = outcome.solution
    fitted = (
        f"{len(outcome.runs)} of {len(outcome.runs) + len(outcome.held_out)} runs, {len(solution.residuals)} residuals"
    )
    status = {"status": solution.status, "runs": outcome.runs, "held_out": outcome.held_out}
    answer.say(f"{outcome.vessel.name}: {solution.sentence}; {fitted}, {solution.seconds:.1f} s", **status)
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
        for row in outcome.estimates.to_dict("records")
    ]
    columns = ["parameter", "unit", "base", "estimate", "factor", "std error", "95 % interval", "identified"]
    answer.rows("estimates", outcome.estimates, table(columns, rows))
    words = {"fisher": "Fisher information", "sandwich": "sandwich by runs", "blocks": "sandwich by stretches of runs"}
    answer.say(
        f"Factors are on the base; standard errors and intervals are theirs, by {words[outcome.statistics.chosen]}."
    )
    answer.say("\n".join(f"  {sentence}" for sentence in outcome.unseen), unseen=outcome.unseen)
    answer.say(f"Free runs {f'of {outcome.ahead:g} s' if outcome.ahead else 'as long as the runs'}, root mean square:")
    heads = ["runs", "model", "u [m/s]", "v [m/s]", "r [deg/s]", "position [m]"]
    answer.rows("free_runs", outcome.errors, table(heads, _free_rows(outcome)))
    banded = "low" in outcome.manoeuvres
    compared = [
        [
            *(row["manoeuvre"], row["measure"], digits(row["before"]), digits(row["after"])),
            *([f"{digits(row['low'])} ... {digits(row['high'])}"] if banded else []),
            *(row["unit"], row["note"]),
        ]
        for row in outcome.manoeuvres.to_dict("records")
    ]
    heads = ["calm water", "measure", "before", "after", *["band"] * banded, "unit", "note"]
    answer.rows("manoeuvres", outcome.manoeuvres, table(heads, compared))
    profiles = [curve.sentence for curve in outcome.profiles]
    answer.say("\n".join(f"profile: {sentence}" for sentence in profiles), profiles=profiles)
    if outcome.programme is not None:
        answer.say("To run next, by information per hour:")
        ranked = [
            [row["manoeuvre"], *(f"{row[name]:.2f}" for name in ("hours", "gain", "per_hour")), row["narrows"],
             f"{1 - row['after'] / row['before']:.0%}"]
            for row in outcome.programme.head(10).to_dict("records")
        ]  # fmt: skip
        heads = ["manoeuvre", "h", "gain [bit]", "bit/h", "narrows most", "by"]
        answer.rows("to_run_next", outcome.programme, table(heads, ranked))
    answer.say(warnings=outcome.warnings)
    for warning in outcome.warnings:
        typer.echo(f"warning: {warning}", err=True)


def _free_rows(outcome: Identified) -> Iterator[list[str]]:
    from math import degrees

    from shipid.identification.free_run import ALL

    for row in outcome.errors.to_dict("records"):
        if row["run"] == ALL:
            numbers = (row["u"], row["v"], degrees(row["r"]), row["position"])
            named = {"fit": f"{len(outcome.runs)} fitted", "test": f"{len(outcome.held_out)} held out"}[row["set"]]
            yield [named, row["model"], *(f"{value:.3g}" if value == value else "diverges" for value in numbers)]
