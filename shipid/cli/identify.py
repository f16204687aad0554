"""`shipid identify`: numbers of a vessel from runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from shipid.cli.answer import Answer, Json, open_answer
from shipid.cli.options import VesselName, command_line, document_stem, parse_assignments, parse_changes
from shipid.cli.outputs import check_ending, check_output
from shipid.cli.terminal import end_on_interrupt, four_digits, motion_errors, show_steps, text_table
from shipid.errors import DocumentError, ShipidError
from shipid.units import interval_text, join_names, plural_word

if TYPE_CHECKING:
    from shipid.data.dataset import Dataset
    from shipid.identification.outcome import Identification
    from shipid.identification.settings import Identify
    from shipid.study.structures import StructureComparison
    from shipid.vessel.load import Vessel


def identify_command(
    vessel: VesselName,
    dataset: Annotated[Path, typer.Argument(help="dataset (Parquet) of runs")],
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            help='numbers to identify: dotted paths with commas between, "hull.derivatives.*", "...[order >= 3]"'
        ),
    ] = None,
    fixed: Annotated[
        list[str] | None, typer.Option(help="paths to leave out of --parameters, with commas between")
    ] = None,
    together: Annotated[list[str] | None, typer.Option(help="paths that share one factor, with commas between")] = None,
    prior: Annotated[
        list[str] | None, typer.Option(help="paths=0.3: standard deviation of a factor around the base")
    ] = None,
    bounds: Annotated[list[str] | None, typer.Option(help="paths=[0.5, 2]: least and greatest factor")] = None,
    nuisance: Annotated[
        list[str] | None,
        typer.Option(help="unknown of each run, with =WIDTH if wanted: initial_state, current, heading_bias, ..."),
    ] = None,
    horizon: Annotated[
        float | None, typer.Option(help="s of each prediction that is fitted; 0: whole runs; default: 30")
    ] = None,
    changes: Annotated[
        list[str] | None, typer.Option("--set", help="key=value: any other key of [identify], such as weights.u=0.05")
    ] = None,
    settings: Annotated[Path | None, typer.Option(help="TOML file with an [identify] table to begin with")] = None,
    runs: Annotated[list[str] | None, typer.Option(help="runs to fit, * for any part of a name; default: all")] = None,
    test: Annotated[list[str] | None, typer.Option(help="runs held out to test the result on; * as above")] = None,
    ahead: Annotated[
        float | None,
        typer.Option(
            help="s of each free run that tests the result; 0: whole runs (default); with --structures that of a study"
        ),
    ] = None,
    profile: Annotated[list[str] | None, typer.Option(help="path whose profile likelihood is followed")] = None,
    band: Annotated[
        float | None, typer.Option(help="level of bands on the measures of standard manoeuvres, such as 0.9")
    ] = None,
    design: Annotated[bool, typer.Option("--design", help="rank the manoeuvres to run next")] = False,
    structures: Annotated[
        str | None,
        typer.Option(
            help="compare structures of the hull by runs held out: present, mmg, modulus, cubic, abkowitz with commas "
            "between, or all"
        ),
    ] = None,
    folds: Annotated[
        int | None,
        typer.Option(help="of --structures: parts of the runs, each held out in turn", show_default="3"),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="patch to write, .toml; default: <vessel>-identified.toml in this folder; with --structures the "
            "vessel with the structure chosen, <vessel>-structure.toml"
        ),
    ] = None,
    html: Annotated[Path | None, typer.Option(help="page to write, with plots")] = None,
    as_json: Json = False,
) -> None:
    """Identify numbers of a vessel from runs: estimates with intervals, tests on runs held out, a patch.

    With --structures, hulls of several structures are fitted to the same runs and compared on runs held out.
    """
    from shipid.data.dataset import read_dataset
    from shipid.files import check_new
    from shipid.identification.outcome import check_identification, read_settings, run_identification, write_patch
    from shipid.study.structures import check_comparison
    from shipid.vessel.load import load_vessel

    if structures is None and folds is not None:
        raise ShipidError("goes with --structures: name structures to compare, or leave it out", path="--folds")
    if band is not None and not 0 < band < 1:
        raise ShipidError(f"{band:g}: must be between 0 and 1, such as 0.9", path="--band")
    file = out or Path(f"{document_stem(vessel)}-{'structure' if structures else 'identified'}.toml")
    check_new(file, "vessel" if structures else "patch")
    check_ending(html, ".html")
    check_output(file, [], "--out")
    given: dict[str, Any] = {
        "parameters": parameters and _split_paths(parameters),
        "fixed": fixed and _split_paths(fixed),
        "together": together and [_split_paths([group]) for group in together],
        "prior": prior and parse_assignments(prior, "--prior", "paths=0.3"),
        "bounds": bounds and parse_assignments(bounds, "--bounds", "paths=[0.5,2]"),
        "nuisance": nuisance and _nuisance_widths(nuisance),
        "horizon": horizon,
    }
    options = {key: value for key, value in given.items() if value is not None}
    if structures is not None and settings is None and parameters is None:
        options["parameters"] = ["hull.*"]
    declared = read_settings(settings, options | parse_changes(changes))
    ship, log = load_vessel(vessel), read_dataset(dataset)
    names = [] if structures is None else _structure_names(structures)
    how: dict[str, Any] = {"runs": runs or (), "held_out": test or (), "ahead": ahead}
    how |= {} if folds is None else {"folds": folds}
    if structures is None:
        with _errors_of_settings(settings):
            check_identification(
                ship, log, declared, runs or (), test or (), ahead=ahead or 0.0, profiles=profile or ()
            )
    elif needless := next((name for name, value in {"--profile": profile, "--design": design}.items() if value), None):
        raise ShipidError("does not go with --structures: identify the structure chosen", path=needless)
    else:
        check_comparison(log, declared, names, **how)
    with open_answer(as_json) as answer, _errors_of_settings(settings):
        _look_first(ship, log, runs or (), test or (), answer)
        if structures is not None:
            _compare_structures(ship, log, declared, names, how, band, file, html, dataset, answer)
            return
        with end_on_interrupt(), show_steps("cutting runs") as say:
            outcome = run_identification(
                ship, log, declared, runs or (), test or (), ahead=ahead or 0.0, profiles=profile or (),
                programme=design, band=band,
                progress=lambda count, objective: say(f"iteration {count}, objective {objective:.6g}"),
            )  # fmt: skip
        _show_identified(outcome, answer)
        write_patch(outcome, file)
        count = len(outcome.solution.values)
        answer.say(f"{count} {plural_word(count, 'number')} as a patch on {ship.key} -> {file}", file=file)
        if html is not None:
            from shipid.identification.contents import identification_content
            from shipid.report.identification import write_identification

            content = identification_content(outcome, dataset, command_line())
            answer.say(f"page -> {write_identification(content, html)}", page=html)


@contextmanager
def _errors_of_settings(settings: Path | None) -> Iterator[None]:
    """Errors of the block of settings are those of its file, where it has one."""
    try:
        yield
    except DocumentError as error:
        if error.file is not None or not (error.path or "").startswith("identify"):
            raise
        raise DocumentError(error.message, file=settings, path=error.path) from None


def _split_paths(given: Sequence[str]) -> list[str]:
    return [path.strip() for words in given for path in words.split(",")]


def _structure_names(given: str) -> list[str]:
    """Names of the structures of `--structures`."""
    from shipid.identification.structures import PRESENT, STRUCTURES

    return [PRESENT, *STRUCTURES] if given == "all" else [name.strip() for name in given.split(",")]


def _compare_structures(
    ship: Vessel,
    log: Dataset,
    declared: Identify,
    names: list[str],
    how: dict[str, Any],
    band: float | None,
    file: Path,
    html: Path | None,
    dataset: Path,
    answer: Answer,
) -> None:
    """Compare structures of the hull, print the comparison, and write the vessel with the structure chosen."""
    from shipid.identification.statistics import LEVEL
    from shipid.study.structures import compare_structures, structures_content, write_chosen_structure

    with end_on_interrupt(), show_steps() as say:
        compared = compare_structures(ship, log, declared, names, level=LEVEL if band is None else band, say=say, **how)
    _show_structures(compared, answer)
    written = write_chosen_structure(compared, file)
    answer.say(f"vessel with the structure {compared.chosen} -> {written}", chosen=compared.chosen, file=written)
    if html is not None:
        from shipid.report.structures import write_structures

        page = structures_content(compared, dataset, command_line())
        answer.say(f"page -> {write_structures(page, html)}", page=html)


def _show_structures(compared: StructureComparison, answer: Answer) -> None:
    """Print errors on runs held out, standard manoeuvres, and errors by side."""
    from shipid.identification.sides import HEADS, side_table_rows

    length = f"of {compared.ahead:g} s" if compared.ahead else "as long as the runs"
    answer.say(
        f"{compared.vessel.name}: {len(compared.runs)} runs; free runs {length} that the fit has not seen, mean of RMS:"
    )
    rows = [
        [
            row["structure"],
            str(row["numbers"]),
            *motion_errors(row),
            four_digits(row["more"]),
            interval_text(row["low"], row["high"]) if row["low"] == row["low"] else "-",
            four_digits(row["test"]),
            row["note"],
        ]
        for row in compared.table.to_dict("records")
    ]
    heads = ["structure", "numbers", "u [m/s]", "v [m/s]", "r [deg/s]", "position [m]", "more [m]", "95 % interval"]
    answer.rows("structures", compared.table, text_table([*heads, "test runs [m]", ""], rows))
    known = [row for row in compared.manoeuvres.to_dict("records") if row["measure"]]
    names = [name for name in compared.table["structure"] if name in {row["structure"] for row in known}]
    wide = {(row["manoeuvre"], row["measure"]): row for row in compared.spread.to_dict("records")}
    rows = []
    for place in dict.fromkeys((row["manoeuvre"], row["measure"]) for row in known):
        by = {row["structure"]: row for row in known if (row["manoeuvre"], row["measure"]) == place}
        cells = [_value_with_interval(by[name]) if name in by else "-" for name in names]
        two = [four_digits(wide[place][name]) if place in wide else "-" for name in ("spread", "width")]
        rows.append([*place, *cells, *two, next(iter(by.values()))["unit"]])
    heads = ["calm water", "measure", *names, "between", "within", "unit"]
    answer.rows("manoeuvres", compared.manoeuvres, text_table(heads, rows))
    answer.say("between: range over the structures not shown to be worse; within: the widest interval of one of them")
    if len(compared.groups):
        answer.say(f"Errors of {compared.chosen} by side, helm and speed, on runs that the fit has not seen:")
        answer.rows("groups", compared.groups, text_table(list(HEADS), side_table_rows(compared.groups)))
    answer.say("\n".join(compared.sentences), sentences=list(compared.sentences))
    answer.rows("spread", compared.spread, None)
    notes = compared.manoeuvres[(compared.manoeuvres["note"].fillna("") != "") & (compared.manoeuvres["measure"] == "")]
    warnings = [
        *compared.shared,
        *(f"intervals of {name}: {fit.caution}" for name, fit in compared.fits.items() if fit.caution),
        *(f"{row['structure']}, {row['manoeuvre']}: {row['note']}" for row in notes.to_dict("records")),
    ]
    answer.say(warnings=warnings)
    for warning in warnings:
        typer.echo(f"warning: {warning}", err=True)


def _value_with_interval(row: Any) -> str:
    within = f" ({interval_text(row['low'], row['high'])})" if row["low"] == row["low"] else ""
    return f"{four_digits(row['value'])}{within}"


def _look_first(ship: Vessel, log: Dataset, runs: Sequence[str], test: Sequence[str], answer: Answer) -> None:
    """Say before anything is fitted whether the vessel predicts the log better than constant u, v, r."""
    from shipid.errors import DataError
    from shipid.identification.outcome import pick_runs, without_shared
    from shipid.study.first_look import first_look
    from shipid.study.new import proposed_horizon
    from shipid.study.survey import survey_dataset

    log, fitted, _ = without_shared(log, *pick_runs(log, runs, test))
    try:
        with show_steps("comparing the vessel as it is with the runs, before the fit"):
            ahead, step, _ = proposed_horizon(ship, survey_dataset(log))
            look = first_look(ship, log, fitted, ahead=ahead, step=step)
    except DataError:
        return  # the fit says what is missing
    if look.wrong:
        typer.echo(f"warning: {look.sentence}", err=True)
    else:
        answer.say(look.sentence)
    answer.say(first_look=look.sentence)


def _nuisance_widths(given: list[str]) -> list[str] | dict[str, Any]:
    """Return the names; or name -> width if any has one, with the default width for the others."""
    if not any("=" in name for name in given):
        return given
    from shipid.identification.settings import WIDE

    named = {name: WIDE.get(name, 1.0) for name in given if "=" not in name}
    return named | parse_assignments([name for name in given if "=" in name], "--nuisance", "current=0.3")


def _show_nuisances(outcome: Identification, answer: Answer) -> None:
    """Print the unknowns of each run, such as a current; initial states are many: the answer for programs has them."""
    from shipid.identification.settings import UNITS_OF_NUISANCES

    of_runs = outcome.solution.nuisances
    rows = [{"run": run, **numbers} for run, numbers in of_runs.items() if numbers]
    scalars = dict.fromkeys(name for numbers in of_runs.values() for name in numbers if name in UNITS_OF_NUISANCES)
    if not rows:
        return
    shown = [[run, *(four_digits(numbers[name]) for name in scalars)] for run, numbers in of_runs.items()]
    heads = [f"{name.replace('_', ' ')} [{UNITS_OF_NUISANCES[name]}]" for name in scalars]
    if scalars:
        answer.say("Unknowns of each run, estimated beside the factors:")
    answer.rows("nuisances", rows, text_table(["run", *heads], shown) if scalars else None)


def _show_identified(outcome: Identification, answer: Answer) -> None:
    """Print estimates, what is not identified, free runs, manoeuvres, manoeuvres to run next, and warnings."""
    from shipid.identification.sides import HEADS, side_table_rows

    _show_estimates(outcome, answer)
    _show_nuisances(outcome, answer)
    _show_free_runs(outcome, answer)
    _show_manoeuvres(outcome, answer)
    if len(outcome.groups):
        answer.say(f"Errors by side, helm and speed, on {'runs held out' if outcome.held_out else 'the fitted runs'}:")
        answer.rows("groups", outcome.groups, text_table(list(HEADS), side_table_rows(outcome.groups)))
    if outcome.solution.effective:
        worth = ", ".join(f"{name} {count:.0f}" for name, count in outcome.solution.effective.items())
        counts = dict(outcome.solution.effective)
        answer.say(f"number of independent residuals that they are worth: {worth}", independent_residuals=counts)
    profiles = [curve.sentence for curve in outcome.profiles]
    answer.say("\n".join(f"profile: {sentence}" for sentence in profiles), profiles=profiles)
    if outcome.programme is not None:
        answer.say("To run next, by information per hour:")
        heads = {"manoeuvre": "manoeuvre", "hours": "h", "gain": "gain [bit]", "per_hour": "bit/h"}
        ranked = outcome.programme if answer.as_json else outcome.programme.head(10)
        answer.records("to_run_next", ranked, heads | {"narrows": "narrows most"})
    answer.say(warnings=outcome.warnings)
    for warning in outcome.warnings:
        typer.echo(f"warning: {warning}", err=True)


def _show_estimates(outcome: Identification, answer: Answer) -> None:
    """Print how the fit ended, the factors with their intervals, and what the data cannot separate."""
    solution = outcome.solution
    fitted = (
        f"{len(outcome.runs)} of {len(outcome.runs) + len(outcome.held_out)} runs, {len(solution.residuals)} residuals"
    )
    status = {"status": solution.status, "sentence": solution.sentence, "residuals": len(solution.residuals)}
    status |= {"runs": outcome.runs, "held_out": outcome.held_out}
    answer.say(f"{outcome.vessel.name}: {solution.sentence}; {fitted}, {solution.seconds:.1f} s", **status)
    rows: list[list[str]] = [
        [
            row["path"] + (f" (with {row['with']})" if row["with"] else ""),
            row["unit"],
            *(f"{row[name]:.4g}" for name in ("base", "value", "factor")),
            *(
                (f"{row['factor_error']:.4g}", interval_text(row["factor_low"], row["factor_high"]))
                if row["factor_error"] < float("inf")
                else ("-", "none")
            ),
            "yes" if row["identified"] else "no",
        ]
        for row in outcome.estimates.to_dict("records")
    ]
    columns = ["parameter", "unit", "base", "estimate", "factor", "std error", "95 % interval", "identified"]
    answer.rows("estimates", outcome.estimates, text_table(columns, rows))
    words = {"fisher": "Fisher information", "sandwich": "sandwich by runs", "blocks": "sandwich by stretches of runs"}
    none = outcome.estimates.loc[outcome.estimates["base"] == 0, "name"].tolist()
    answer.say(
        f"Factors are relative to the base, and so are errors and intervals, by {words[outcome.statistics.chosen]}."
        + (f" The base has 0 for {join_names(none)}: there they are relative to the scale." if none else ""),
        standard_errors_by=outcome.statistics.chosen,
    )
    answer.say("\n".join(f"  {sentence}" for sentence in outcome.unseen), unseen=outcome.unseen)


def _show_free_runs(outcome: Identification, answer: Answer) -> None:
    """Print errors of free runs, and of measured outputs, before the fit and after it."""
    from shipid.identification.free_run import ALL

    answer.say(f"Free runs {f'of {outcome.ahead:g} s' if outcome.ahead else 'as long as the runs'}, root mean square:")
    heads = ["runs", "model", "u [m/s]", "v [m/s]", "r [deg/s]", "position [m]"]
    sets = {"fit": f"{len(outcome.runs)} fitted", "test": f"{len(outcome.held_out)} held out"}
    rows = [
        [sets[row["set"]], row["model"], *motion_errors(row)]
        for row in outcome.errors.to_dict("records")
        if row["run"] == ALL
    ]
    answer.rows("free_runs", outcome.errors, text_table(heads, rows))
    if len(outcome.outputs):
        columns = {"output": "measured output", "unit": "unit", "measured": "rms", "before": "error before"}
        answer.records("outputs", outcome.outputs, columns | {"after": "after"})


def _show_manoeuvres(outcome: Identification, answer: Answer) -> None:
    """Print measures of standard manoeuvres before the fit and after it, and which of them the runs do not cover."""
    banded = "low" in outcome.manoeuvres
    compared = [
        [
            *(row["manoeuvre"], row["measure"], four_digits(row["before"]), four_digits(row["after"])),
            *([interval_text(row["low"], row["high"]) if row["low"] == row["low"] else "-"] if banded else []),
            *(row["unit"], row["note"]),
        ]
        for row in outcome.manoeuvres.to_dict("records")
        if row["measure"]
    ]
    heads = ["calm water", "measure", "before", "after", *["band"] * banded, "unit", "note"]
    answer.rows("manoeuvres", outcome.manoeuvres, text_table(heads, compared) if compared else None)
    refused = outcome.manoeuvres[outcome.manoeuvres["measure"] == ""]
    for note, titles in refused.groupby("note", sort=False)["manoeuvre"]:
        typer.echo(f"note: no {', '.join(titles)}: {note}", err=True)
    beyond = list(outcome.beyond)
    answer.say("\n".join(f"extrapolated: {sentence}" for sentence in beyond), extrapolated=beyond)
