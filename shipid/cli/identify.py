"""`shipid identify`: numbers of a vessel from runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import shipid
from shipid.cli.answer import MOTION, MOTION_FORMATS, Answer, Json, end_on_interrupt, open_answer, show_steps
from shipid.cli.options import VesselName, check_output, command_line, document_stem, parse_assignments, parse_changes
from shipid.errors import DataError, DocumentError, ShipidError
from shipid.units import join_names, plural_word

if TYPE_CHECKING:
    from shipid.data.dataset import Dataset
    from shipid.identification.outcome import Identification
    from shipid.identification.settings import Identify
    from shipid.study.structures import StructureComparison
    from shipid.vessel.load import Vessel

INTERVAL = {"low": "95 % from", "high": "to"}
MEASURE = {"manoeuvre": "calm water", "measure": "measure"}


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
        typer.Option(help="unknown of each run, all with =WIDTH or none: initial_state, current, heading_bias, ..."),
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
        float | None,
        typer.Option(min=0.001, max=0.999, help="level of bands on the measures of standard manoeuvres, such as 0.9"),
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
    from shipid.identification.outcome import check_identification, read_settings, write_patch
    from shipid.identification.structures import PRESENT, STRUCTURES
    from shipid.study.structures import check_comparison

    if structures is None and folds is not None:
        raise ShipidError("goes with --structures: name structures to compare, or leave it out", path="--folds")
    default = Path(f"{document_stem(vessel)}-{'structure' if structures else 'identified'}.toml")
    file = check_output(out or default, endings=(".toml",))
    given: dict[str, Any] = {
        "parameters": parameters and _split_paths(parameters),
        "fixed": fixed and _split_paths(fixed),
        "together": together and [_split_paths([group]) for group in together],
        "prior": prior and parse_assignments(prior, "--prior", "paths=0.3"),
        "bounds": bounds and parse_assignments(bounds, "--bounds", "paths=[0.5,2]"),
        "nuisance": parse_assignments(nuisance, "--nuisance", "current=0.3")
        if nuisance and "=" in "".join(nuisance)
        else nuisance,
        "horizon": horizon,
    }
    options = {key: value for key, value in given.items() if value is not None}
    if structures is not None and settings is None and parameters is None:
        options["parameters"] = ["hull.*"]
    declared = read_settings(settings, options | parse_changes(changes))
    ship, log = shipid.load_vessel(vessel), shipid.read_dataset(dataset)
    names = [PRESENT, *STRUCTURES] if structures == "all" else _split_paths([structures or ""])
    how: dict[str, Any] = {"runs": runs or (), "held_out": test or (), "ahead": ahead}
    how |= {} if folds is None else {"folds": folds}
    alone = {"--profile": profile, "--design": design, "--html": html}
    needless = [name for name, value in alone.items() if value and structures]
    if needless:
        raise ShipidError(
            "does not go with --structures: give it when you identify the structure chosen", path=needless[0]
        )
    with open_answer(as_json) as answer, _errors_of_settings(settings):
        if structures is not None:
            check_comparison(log, declared, names, **how)
        else:
            check_identification(
                ship, log, declared, runs or (), test or (), ahead=ahead or 0.0, profiles=profile or ()
            )
        _diagnose_first(ship, log, runs or (), test or (), answer)
        if structures is not None:
            _compare_structures(ship, log, declared, names, how, band, file, answer)
            return
        with end_on_interrupt(), show_steps("cutting runs") as say:
            outcome = shipid.run_identification(
                ship, log, declared, runs or (), test or (), ahead=ahead or 0.0, profiles=profile or (),
                programme=design, band=band,
                progress=lambda count, objective: say(f"iteration {count}, objective {objective:.6g}"),
            )  # fmt: skip
        _show_identified(outcome, answer)
        write_patch(outcome, file)
        count = len(outcome.solution.values)
        answer.say(f"{count} {plural_word(count, 'number')} as a patch on {ship.key} -> {file}", file=file)
        if html is not None:
            from shipid.report.identification import write_identification

            answer.say_page(write_identification(outcome.page(dataset, command_line()), html))


@contextmanager
def _errors_of_settings(settings: Path | None) -> Iterator[None]:
    """Errors of the block of settings are those of its file, where it has one."""
    try:
        yield
    except DocumentError as error:
        if settings is not None and error.file is None and (error.path or "").startswith("identify"):
            error.file = str(settings)
        raise


def _split_paths(given: Sequence[str]) -> list[str]:
    return [path.strip() for words in given for path in words.split(",")]


def _compare_structures(
    ship: Vessel,
    log: Dataset,
    declared: Identify,
    names: list[str],
    how: dict[str, Any],
    band: float | None,
    file: Path,
    answer: Answer,
) -> None:
    """Compare structures of the hull, print the comparison, and write the vessel with the structure chosen."""
    from shipid.identification.statistics import LEVEL
    from shipid.study.structures import compare_structures, write_chosen_structure

    with end_on_interrupt(), show_steps() as say:
        compared = compare_structures(ship, log, declared, names, level=LEVEL if band is None else band, say=say, **how)
    _show_structures(compared, answer)
    written = write_chosen_structure(compared, file)
    answer.say(f"vessel with the structure {compared.chosen} -> {written}", chosen=compared.chosen, file=written)


def _show_structures(compared: StructureComparison, answer: Answer) -> None:
    """Print errors on runs held out, standard manoeuvres, and errors by side."""
    length = f"of {compared.ahead:g} s" if compared.ahead else "as long as the runs"
    answer.say(
        f"{compared.vessel.name}: {len(compared.runs)} runs; free runs {length} that the fit has not seen, mean of RMS:"
    )
    heads = {"structure": "structure", "numbers": "numbers"} | MOTION | {"more": "more [m]"} | INTERVAL
    answer.records("structures", compared.table, heads | {"test": "test runs [m]", "note": ""}, MOTION_FORMATS)
    measured = compared.manoeuvres["measure"] != ""
    heads = {"structure": "structure", "value": "value"} | INTERVAL | {"unit": "unit"}
    answer.records("manoeuvres", compared.manoeuvres, MEASURE | heads, shown=compared.manoeuvres[measured])
    answer.say("between: range over the structures not shown to be worse; within: the widest interval of one of them")
    answer.records("spread", compared.spread, MEASURE | {"spread": "between", "width": "within"})
    answer.say("\n".join(compared.sentences), sentences=list(compared.sentences))
    notes = compared.manoeuvres[(compared.manoeuvres["note"].fillna("") != "") & ~measured]
    answer.warn(
        [
            *compared.shared,
            *(f"intervals of {name}: {fit.caution}" for name, fit in compared.fits.items() if fit.caution),
            *(f"{row['structure']}, {row['manoeuvre']}: {row['note']}" for row in notes.to_dict("records")),
        ]
    )


def _diagnose_first(ship: Vessel, log: Dataset, runs: Sequence[str], test: Sequence[str], answer: Answer) -> None:
    """Say before anything is fitted what is wrong with the vessel as it is and the log."""
    from shipid.identification.diagnosis import NONE, diagnose
    from shipid.identification.outcome import pick_runs, without_shared

    log, fitted, _ = without_shared(log, *pick_runs(log, runs, test))
    with suppress(DataError), show_steps("comparing the vessel as it is with the runs, before the fit"):
        found = diagnose(ship, log, fitted)  # where it cannot, the fit says what is missing
        sentence = f"{ship.name} as it is: {found.sentence}"
        if found.cause != NONE:
            typer.echo(f"warning: {sentence}", err=True)
        else:
            answer.say(sentence)
        answer.say(diagnosis=sentence, cause=found.cause)


def _show_identified(outcome: Identification, answer: Answer) -> None:
    """Print estimates, what is not identified, free runs, manoeuvres, manoeuvres to run next, and warnings."""
    from shipid.identification.free_run import ALL
    from shipid.identification.settings import UNITS_OF_NUISANCES

    _show_estimates(outcome, answer)
    of_runs = outcome.solution.nuisances
    scalars = dict.fromkeys(name for numbers in of_runs.values() for name in numbers if name in UNITS_OF_NUISANCES)
    heads = {name: f"{name.replace('_', ' ')} [{UNITS_OF_NUISANCES[name]}]" for name in scalars}
    rows = [{"run": run, **numbers} for run, numbers in of_runs.items() if numbers]  # initial states are many: JSON
    if scalars:
        answer.say("Unknowns of each run, estimated beside the factors:")
    answer.records("nuisances", rows, {"run": "run"} | heads, shown=rows if scalars else [])
    answer.say(f"Free runs {f'of {outcome.ahead:g} s' if outcome.ahead else 'as long as the runs'}, root mean square:")
    sets = {"fit": f"{len(outcome.runs)} fitted", "test": f"{len(outcome.held_out)} held out"}
    heads = {"set": "runs", "model": "model"} | MOTION
    errors = outcome.errors[outcome.errors["run"] == ALL]
    answer.records("free_runs", outcome.errors, heads, {"set": sets.__getitem__, **MOTION_FORMATS}, shown=errors)
    _show_manoeuvres(outcome, answer)
    worth = outcome.solution.effective
    if worth:
        words = ", ".join(f"{name} {count:.0f}" for name, count in worth.items())
        answer.say(f"number of independent residuals that they are worth: {words}", independent_residuals=dict(worth))
    profiles = [curve.sentence for curve in outcome.curves]
    answer.say("\n".join(f"profile: {sentence}" for sentence in profiles), profiles=profiles)
    ranked = outcome.programme
    if len(ranked):
        answer.say("To run next, by information per hour:")
        heads = {"manoeuvre": "manoeuvre", "hours": "h", "gain": "gain [bit]", "per_hour": "bit/h"}
        answer.records("to_run_next", ranked, heads | {"narrows": "narrows most"}, shown=ranked.head(10))
    answer.warn(outcome.warnings)


def _show_estimates(outcome: Identification, answer: Answer) -> None:
    """Print how the fit ended, the factors with their intervals, and what the data cannot separate."""
    solution = outcome.solution
    fitted = (
        f"{len(outcome.runs)} of {len(outcome.runs) + len(outcome.held_out)} runs, {len(solution.residuals)} residuals"
    )
    answer.say(
        f"{outcome.vessel.name}: {solution.sentence}; {fitted}, {solution.seconds:.1f} s",
        status=solution.status,
        sentence=solution.sentence,
        residuals=len(solution.residuals),
        runs=outcome.runs,
        held_out=outcome.held_out,
    )
    heads = {
        "path": "parameter",
        "with": "with",
        "unit": "unit",
        "base": "base",
        "value": "estimate",
        "factor": "factor",
        "factor_error": "std error",
        "factor_low": "95 % from",
        "factor_high": "to",
        "identified": "identified",
    }
    formats: dict[str, Any] = dict.fromkeys(("base", "value"), "{:.4g}".format)
    answer.records("estimates", outcome.estimates, heads, formats | {"identified": lambda one: "yes" if one else "no"})
    words = {"fisher": "Fisher information", "sandwich": "sandwich by runs", "blocks": "sandwich by stretches of runs"}
    none = outcome.estimates.loc[outcome.estimates["base"] == 0, "name"].tolist()
    answer.say(
        f"Factors are relative to the base, and so are errors and intervals, by {words[outcome.statistics.chosen]}."
        + (f" The base has 0 for {join_names(none)}: there they are relative to the scale." if none else ""),
        standard_errors_by=outcome.statistics.chosen,
    )
    answer.say("\n".join(f"  {sentence}" for sentence in outcome.unseen), unseen=outcome.unseen)


def _show_manoeuvres(outcome: Identification, answer: Answer) -> None:
    """Print measures of standard manoeuvres before the fit and after it, and which of them the runs do not cover."""
    manoeuvres = outcome.manoeuvres
    heads = MEASURE | {"before": "before", "after": "after"} | (INTERVAL if "low" in manoeuvres else {})
    measured = manoeuvres["measure"] != ""
    answer.records("manoeuvres", manoeuvres, heads | {"unit": "unit", "note": "note"}, shown=manoeuvres[measured])
    for note, titles in manoeuvres[~measured].groupby("note", sort=False)["manoeuvre"]:
        typer.echo(f"note: no {', '.join(titles)}: {note}", err=True)
    beyond = list(outcome.beyond)
    answer.say("\n".join(f"extrapolated: {sentence}" for sentence in beyond), extrapolated=beyond)
