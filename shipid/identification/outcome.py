"""A complete identification: settings, fit, uncertainty, free runs before and after, and the vessel as a patch."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
from pydantic import BaseModel, ConfigDict

from shipid import document as documents
from shipid.arguments import as_names, check_class, check_function_or_none, check_number
from shipid.data.checks import constant_commands, warn_of_constant_commands
from shipid.data.dataset import Array, Dataset, without_shared_moments
from shipid.data.windows import gaps_in_words
from shipid.document import short_names
from shipid.errors import DataError, DocumentError, ShipidError, suggest_name
from shipid.files import write_new
from shipid.identification import design
from shipid.identification.bands import (
    LONG,
    Trial,
    band_refusal,
    check_level,
    extrapolation_sentences,
    measure_bands,
    memory_of_signals,
    perform_trials,
    residual_spacing,
    select_measures,
)
from shipid.identification.fit import Progress, Solution
from shipid.identification.free_run import (
    ALL,
    ERRORS_OF,
    FreeRuns,
    check_length,
    missing_inputs,
    simulate_free_runs,
)
from shipid.identification.plausible import implausibility
from shipid.identification.profile import Profile, profile_factor, profile_table, variance_ratio
from shipid.identification.settings import (
    BLOCK,
    Identify,
    free_factors,
    resolve_overrides,
    run_overrides,
    weighted_columns,
)
from shipid.identification.solve import identify
from shipid.identification.statistics import (
    Statistics,
    against_priors,
    factors_of_single_runs,
    fit_statistics,
    open_to_drift,
    pooled_autocorrelation,
    runs_of_signal,
)
from shipid.interrupts import hold_interrupts
from shipid.physics.signals import is_steering
from shipid.report.identification import IdentificationContent
from shipid.simulation.measured import TRIALS, MeasuredManoeuvre
from shipid.units import join_names, percent_text, plural_word, significant_digits
from shipid.version import __version__
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import patch_text
from shipid.vessel.ranges import find_contradictions

BEFORE, AFTER = "before", "after"
LITTLE_HELM = (
    1.0  # deg, range of the angles: with 0.4 intervals held the truth in 85 % of cases, with 2 in 92 % (record)
)
BETTER = 0.01  # of the limit of a profile: a point this much below the estimate is a better fit
WORSE = 0.02  # of the error of free runs before the fit: what is more by less is not worse
EXACT = 1e-3  # of its deviation: what a signal counts with that the vessel repeats exactly
TRIED = tuple(sorted(TRIALS, key=lambda trial: trial[0] == "turning"))
"""Standard manoeuvres [deg] that both vessels perform in calm water: those that have criteria, turning last."""
STARBOARD_TRIALS: dict[str, Trial] = {
    f"{kind} {'/'.join(f'{angle:g}' for angle in angles)}": (kind, angles, "starboard") for kind, angles in TRIED
}
COMPARED = {
    "zigzag": ("overshoot 1", "overshoot 2", "initial turning", "period"),
    "turning": ("advance", "transfer", "tactical diameter", "steady diameter", "steady speed"),
}
"""Kind of a standard manoeuvre -> measures of it that are set beside each other, those of the base and of the fit."""


class SettingsFile(BaseModel):
    """A settings file: one `[identify]` table."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    identify: Identify


@dataclass(frozen=True, eq=False, kw_only=True)
class Identification(IdentificationContent):
    """Result of an identification with its statistics and its validation: the content of its page, and more.

    vessel : the base vessel. runs : those fitted. digest : of the dataset.
    estimates also has `with` (tied paths), `low`, `high` [unit], `factor_error`.
    curves : the profiles. programme : manoeuvres to run next, of `shipid.identification.design.rank_candidates`.
    """

    vessel: Vessel
    solution: Solution
    statistics: Statistics
    runs: tuple[str, ...]
    digest: str
    curves: tuple[Profile, ...]

    def page(self, dataset: str | Path, command: str = "") -> Identification:
        """The content of a page; dataset : file of the runs. command : command line that reproduces the outcome."""
        origin = {**self.provenance, "Dataset": f"{dataset}, digest {self.digest}"}
        return replace(self, provenance=origin, command=command, study_document=self.patch(Path()))

    def patch(self, file: Path) -> str:
        """The patch as TOML, to be written to `file`: `load_vessel` on it rebuilds the identified vessel exactly.

        Raises ShipidError where more than numbers of the vessel were changed after it was read.
        """
        vessel, solution = self.vessel, self.solution
        bundled = documents.bundled_documents("models").get(vessel.key)
        is_bundled = bundled is not None and bundled.resolve() == Path(vessel.file).resolve()
        base = vessel.key if is_bundled else os.path.relpath(vessel.file, file.parent)
        count = f"{len(self.runs)} {plural_word(len(self.runs), 'run')}"
        digest, changed = _as_read(vessel)
        identified = vessel.with_values(solution.values)
        return patch_text(
            name=f"{vessel.name}, identified",
            base=base,
            base_digest=digest,
            source=f"identified from {count} of dataset {self.digest} by shipid {__version__}",
            values=changed | dict(solution.values),
            provenance=documents.plain_values(self._provenance()),
            unusual=tuple(find_contradictions(identified.document, identified.parameters)),
        )

    def _provenance(self) -> dict[str, Any]:
        solution, rows = self.solution, self.estimates
        known = dict(zip(rows["path"], zip(rows["factor"], rows["factor_error"], strict=True), strict=True))
        free = [row for row in self.errors.to_dict("records") if row["run"] == ALL]
        return {
            "shipid": __version__,
            "dataset": self.digest,
            "runs": list(self.runs),
            "held_out": list(self.held_out),
            "status": solution.status,
            "sentence": solution.sentence,
            "residuals": len(solution.residuals),
            "objective_start": _round_significant(solution.objective_start),
            "objective": _round_significant(solution.objective),
            "standard_errors_by": self.statistics.chosen,
            "not_identified": rows.loc[~rows["identified"].astype(bool), "path"].tolist(),
            "warnings": list(self.warnings),
            "factors": {path: _round_significant(factor) for path, (factor, _) in known.items()},
            "standard_errors": {path: _round_significant(error) for path, (_, error) in known.items()},
            "free_run_rms": {
                f"{row['set']} {row['model']}": {name: _round_significant(row[name]) for name in ERRORS_OF}
                for row in free
            },
            "settings": solution.settings.model_dump(exclude_none=True),
        }


def read_settings(file: Path | None = None, changes: Mapping[str, Any] | None = None) -> Identify:
    """Read settings from the `[identify]` table of a TOML file (None: defaults).

    changes : dotted path in the table -> value that replaces the file's.
    """
    document = {BLOCK: {}} if file is None else documents.read_document(file)
    if not isinstance(document.get(BLOCK, {}), dict):
        raise DocumentError("must be a table", file=file, path=BLOCK)
    inside = {f"{BLOCK}.{path}": value for path, value in (changes or {}).items()}
    block = documents.replace_values({BLOCK: {}, **document}, inside, file)
    return cast(SettingsFile, documents.parse_model(SettingsFile, block, file)).identify


def pick_runs(
    dataset: Dataset, runs: Sequence[str] = (), held_out: Sequence[str] = ()
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the runs to fit (default: all) and of those held out: names or patterns in which `*` is any characters.

    Raises DataError for an unknown run.
    """

    def chosen(patterns: Sequence[str] | str, option: str) -> list[str]:
        selected: set[str] = set()
        for pattern in as_names(option, () if patterns is None else patterns, DataError):
            names = documents.match_paths(pattern, dataset.runs)
            if not names:
                raise DataError(f"{pattern!r} is no run: {suggest_name(pattern, dataset.runs)}", path=option)
            selected.update(names)
        return [run for run in dataset.runs if run in selected]

    tested = chosen(held_out, "--test")
    fitted = [run for run in (chosen(runs, "runs") or dataset.runs) if run not in tested]
    if not fitted:
        raise DataError("every run is held out: leave at least one run for the fit", path="runs")
    return tuple(fitted), tuple(tested)


def without_shared(
    dataset: Dataset, runs: Sequence[str], held_out: Sequence[str]
) -> tuple[Dataset, tuple[str, ...], tuple[str, ...]]:
    """The dataset whose runs to fit see no moment of the runs held out, the runs that are left, and warnings.

    Raises DataError where no run is left.
    """
    apart = without_shared_moments(dataset, held_out)
    before, after = (one.frame["run"].value_counts() for one in (dataset, apart))
    lost = {run: 1.0 - int(after.get(run, 0)) / int(before[run]) for run in runs}
    left = tuple(run for run in runs if after.get(run, 0) > 1)
    if not left and not any(lost.values()):
        raise DataError("every run to fit has a single row: a prediction needs several", path="runs")
    if not left:
        clocks = "where every run has its clock, metadata['clock'] must be 'run'"
        raise DataError(f"every run shares its moments with the runs held out: hold out others ({clocks})", path="runs")
    warnings = tuple(
        f"run {run} shares {'less than 1 %' if share < 0.01 else percent_text(share)} of its rows in time with the "
        "runs held out: " + ("they take no part in the fit" if run in left else "it takes no part in the fit")
        for run, share in lost.items()
        if share > 0
    )
    alone = [run for run, share in lost.items() if not share and run not in left]
    warnings += tuple(f"run {run} has a single row: it takes no part in the fit" for run in alone)
    return apart, left, warnings


def run_identification(
    vessel: Vessel,
    dataset: Dataset,
    settings: Identify,
    runs: Sequence[str] = (),
    held_out: Sequence[str] = (),
    *,
    ahead: float = 0.0,
    profiles: Sequence[str] = (),
    programme: bool = False,
    band: float | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify a vessel from recorded runs, and validate it by free runs, also of the runs held out.

    runs, held_out : as `pick_runs` takes them. ahead : length of the free runs [s], 0 for whole runs.
    profiles : factors whose profile is computed. programme : whether to rank manoeuvres to run next.
    band : level of the bands on the measures of standard manoeuvres, such as 0.9; None: none.
    progress : called with the iteration number and the objective; a true return value stops.

    Raises DocumentError or DataError where vessel, dataset, settings and runs do not fit together, ShipidError where
    the fit did not converge.
    """
    check_class("settings", settings, Identify, "such as Identify(parameters=[...])", DocumentError)
    check_class("dataset", dataset, Dataset, "as of `read_dataset`", DataError)
    profiles, ahead = as_names("profiles", profiles, DataError), check_number("ahead", ahead, DataError)
    check_function_or_none("progress", progress)
    check_level(band)
    fitted, tested = check_identification(vessel, dataset, settings, runs, held_out, ahead=ahead, profiles=profiles)
    digest = dataset.digest
    dataset, fitted, shared = without_shared(dataset, fitted, tested)
    sets = {"fit": fitted, "test": tested} if tested else {"fit": fitted}
    ranked, lacking = pd.DataFrame(), ""
    with hold_interrupts() as held:  # an interrupted library call raises an unrelated error
        for each in sets.values():  # an error in the free runs is raised before the long fit
            simulate_free_runs({BEFORE: vessel}, dataset, each, settings, ahead)
        _go_on(held)
        fit_settings = settings.model_copy(update={"runs": run_overrides(settings, fitted)})
        solution = identify(vessel, dataset, fitted, fit_settings, progress=progress)
        if solution.status != "ok":
            raise ShipidError(solution.sentence)
        _go_on(held)
        settings = settings.model_copy(update={"step": solution.settings.step})
        judged = fit_statistics(solution)
        determined = [path for path in profiles if path in judged.free]
        curves = tuple(_profile(path, dataset, solution, judged) for path in determined)
        identified = vessel.with_values(solution.values)
        pair, flows = {BEFORE: vessel, AFTER: identified}, {AFTER: solution.common_current}
        free = {name: simulate_free_runs(pair, dataset, each, settings, ahead, flows) for name, each in sets.items()}
        manoeuvres, done = _compare_manoeuvres(pair)
        refused = "" if band is None else band_refusal(solution, judged)
        if band is not None and not refused:

            def perform(ship: Vessel) -> dict[str, dict[str, float]]:
                return select_measures(perform_trials(ship, STARBOARD_TRIALS)[0], COMPARED)

            ends = measure_bands(vessel, solution, judged, perform, band)
            manoeuvres = manoeuvres.merge(
                ends[["manoeuvre", "measure", "low", "high"]], how="left", on=["manoeuvre", "measure"]
            )
        _go_on(held)
        if programme:
            ranked, lacking = _next_manoeuvres(identified, dataset, fitted, solution, judged)
        warnings = (
            *shared,
            *solution.warnings,
            *warn_of_unmeasured_inputs(vessel, dataset, fitted, solution.settings),
            *unrecorded_time_warning(dataset, fitted, settings),
            *_not_varied(dataset, fitted, solution.paths),
            *_fit_warnings(solution, judged, free, settings),
            *_better_fit_warnings(solution, curves),
            *(
                f"no profile of {path}: it is at a bound, fixed or dropped"
                for path in profiles
                if path not in determined
            ),
            *_implausible_estimates(vessel, identified, solution.values),
            lacking,
            refused and f"no bands on standard manoeuvres: {refused}",
        )
        estimates = _estimate_table(vessel, solution, judged)
        return Identification(
            title=f"{vessel.name}, identified",
            name=vessel.key,
            provenance={
                "Vessel": f"{vessel.name}, digest {vessel.digest}",
                "Dataset": f"digest {digest}",
                "Fitted": ", ".join(fitted),
                "Held out": ", ".join(tested) or "none",
                "Fit": f"{solution.sentence}; objective {solution.objective:.6g}, at first "
                f"{solution.objective_start:.6g}",
                "shipid": __version__,
            },
            vessel=vessel,
            solution=solution,
            statistics=judged,
            runs=fitted,
            held_out=tested,
            digest=digest,
            estimates=estimates,
            correlations=judged.correlations,
            unseen=_unseen_sentences(estimates, judged),
            ahead=ahead,
            errors=pd.concat([runs.errors.assign(set=name) for name, runs in free.items()], ignore_index=True),
            series=free["test" if tested else "fit"].series,
            manoeuvres=manoeuvres,
            colours=_whiteness_table(solution),
            programme=ranked,
            curves=curves,
            profiles=pd.concat([pd.DataFrame(), *map(profile_table, curves)], ignore_index=True),
            warnings=tuple(filter(None, warnings)),
            beyond=extrapolation_sentences(identified, done, dataset, fitted),
        )


def _unseen_sentences(estimates: pd.DataFrame, judged: Statistics) -> tuple[str, ...]:
    """What explains unidentified parameters: collinear combinations first, then other reasons."""
    vague = estimates[~estimates["identified"].astype(bool)]
    sets = [one for one in judged.combinations if not set(one.paths).isdisjoint(vague["path"])]
    explained = {path for one in sets for path in one.paths}
    return (*(one.sentence() for one in sets), *vague.loc[~vague["path"].isin(explained), "reason"].astype(str))


def _as_read(vessel: Vessel) -> tuple[str, dict[str, float]]:
    """Digest of the document in the vessel's file, and the numbers that were changed since it was read."""
    try:
        read = load_vessel(vessel.file)
    except ShipidError:
        return vessel.digest, {}
    if read.digest == vessel.digest:
        return read.digest, {}
    before = read.parameters
    changed = {path: value for path, value in vessel.parameters.items() if before.get(path) != value}
    if vessel.units.keys() != before.keys() or read.with_values(changed).digest != vessel.digest:
        message = "more than numbers of it were changed after it was read: a patch on it is another vessel"
        raise ShipidError(f"{message}; write the change in a file that `extends` it, and load that", file=vessel.file)
    return read.digest, changed


def _implausible_estimates(vessel: Vessel, identified: Vessel, values: Mapping[str, float]) -> tuple[str, ...]:
    judgements = {path: implausibility(vessel, path, values) for path in values}
    judgements |= {
        path: f"{path}: {words}; hold it, or give it a prior"
        for path, words in find_contradictions(identified.document, identified.parameters).items()
        if not judgements.get(path)
    }
    return tuple(filter(None, judgements.values()))


def _go_on(held: Sequence[int]) -> None:
    """Raise KeyboardInterrupt if Ctrl-C was pressed since the last check."""
    if held:
        raise KeyboardInterrupt


def check_identification(
    vessel: Vessel,
    dataset: Dataset,
    settings: Identify,
    runs: Sequence[str] = (),
    held_out: Sequence[str] = (),
    *,
    ahead: float = 0.0,
    profiles: Sequence[str] = (),
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The runs to fit and those held out, when all arguments of `run_identification` fit; raises as it does."""
    fitted, tested = pick_runs(dataset, runs, held_out)
    check_length(settings, ahead)
    resolve_overrides(settings, (*fitted, *tested), vessel, vessel_dynamics(vessel).environment, known=dataset.runs)
    known = free_factors(vessel, settings).paths
    wrong = next((path for path in profiles if path not in known), None)
    if wrong is not None:
        raise DataError(f"{wrong!r} is not free in the fit: {suggest_name(wrong, known)}", path="profile")
    return fitted, tested


def write_patch(outcome: Identification, file: Path) -> Path:
    """Write the identified vessel as a patch on its base; an existing file is never overwritten."""
    return write_new(outcome.patch(file), file)


def _estimate_table(vessel: Vessel, solution: Solution, judged: Statistics) -> pd.DataFrame:
    unknown = free_factors(solution.vessel, solution.settings)
    rows = []
    parts = zip(unknown.groups, unknown.scale, short_names(unknown.paths), strict=True)
    for j, (group, scales, name) in enumerate(parts):
        path, scale = group[0], scales[0]
        low, high = sorted((scale * judged.low[j], scale * judged.high[j]))
        dropped = path in solution.dropped
        rows.append(
            {
                "path": path,
                "name": name,
                "with": ", ".join(group[1:]),
                "unit": vessel.units.get(path, "m/s"),
                "base": vessel.parameters.get(path, 0.0),
                "value": scale * solution.factors[j],
                "error": abs(scale) * judged.errors[j],
                "low": low,
                "high": high,
                "factor": solution.factors[j],
                "factor_error": judged.errors[j],
                "factor_low": judged.low[j],
                "factor_high": judged.high[j],
                "identified": bool(judged.identifiable[j]) and not dropped,
                "reason": "dropped: the data do not support a change" if dropped else judged.sentences[j],
            }
        )
    return pd.DataFrame(rows)


def _compare_manoeuvres(pair: Mapping[str, Vessel]) -> tuple[pd.DataFrame, dict[str, MeasuredManoeuvre]]:
    """Manoeuvre measures of both vessels, and by title what the last vessel performed.

    Where a vessel cannot perform one: NaN, and the reason in `note`.
    """
    rows = list[dict[str, Any]]()
    each = {name: perform_trials(vessel, STARBOARD_TRIALS) for name, vessel in pair.items()}
    for title, (kind, *_) in STARBOARD_TRIALS.items():
        said = [f"{name}: {refused[title]}" for name, (_, refused) in each.items() if title in refused]
        if len(said) == len(pair):
            why = {refused[title] for _, refused in each.values()}
            note = why.pop() if len(why) == 1 else "; ".join(said)
            rows.append({"manoeuvre": title, "measure": "", "note": note})
            continue
        known = {
            name: {row["measure"]: row for row in done[title].measures}
            for name, (done, _) in each.items()
            if title in done
        }
        for measure in COMPARED[kind]:
            found = {name: by_measure[measure] for name, by_measure in known.items() if measure in by_measure}
            notes = [*said, *(f"{name}: {row['note']}" for name, row in found.items() if row["note"])]
            numbers = {name: row["value"] for name, row in found.items()}
            unit = next((row["unit"] for row in found.values()), "")
            rows.append({"manoeuvre": title, "measure": measure, "unit": unit, **numbers, "note": "; ".join(notes)})
    frame = pd.DataFrame(rows, columns=["manoeuvre", "measure", "unit", *pair, "note"]).astype(
        dict.fromkeys(pair, float)
    )
    return frame.fillna({"unit": ""}), each[AFTER][0]


def _longest_run(solution: Solution) -> float:
    """Time from the first to the last residual of the run where it is longest [s]."""
    return max(float(np.ptp(solution.times[solution.clusters == run])) for run in np.unique(solution.clusters))


def _whiteness_table(solution: Solution) -> pd.DataFrame:
    between, frames = residual_spacing(solution), []
    for name in dict.fromkeys(solution.signals):
        rho = pooled_autocorrelation([solution.residuals[run] for run in runs_of_signal(solution, name)])[:61]
        frames.append(pd.DataFrame({"signal": name, "lag": between * np.arange(len(rho)), "correlation": rho}))
    return pd.concat(frames, ignore_index=True)


def _next_manoeuvres(
    vessel: Vessel, dataset: Dataset, runs: Sequence[str], solution: Solution, judged: Statistics
) -> tuple[pd.DataFrame, str]:
    """Ranked manoeuvres at the median speed of the fitted runs and at half, and a sentence on those that cannot be."""
    speed, most = design.recorded_limits(vessel, dataset, runs)
    unknown, settings = free_factors(solution.vessel, solution.settings), solution.settings
    own = sum(path in vessel.parameters for path in unknown.paths)  # no manoeuvre has the current
    motions = {name: width for name, width in settings.weights.items() if name not in settings.outputs}
    levels = {name: judged.whiteness[weighted_columns(name)[0]].level for name in motions}
    spread = {name: width * (levels[name] or EXACT) for name, width in motions.items()}
    try:
        choice = design.candidate_manoeuvres(vessel, (speed / 2, speed), most)
        settings = settings.model_copy(update={"weights": spread})
        contributions = design.information_where_possible(solution.vessel, choice, settings, solution.factors[:own])
    except ShipidError as error:  # no shaft speed gives these speeds, or the ship has no length
        return pd.DataFrame(), f"no manoeuvres to run next: {error.message}"
    possible = {one.candidate.title for one in contributions}
    lacking = [one.title for one in choice if one.title not in possible]
    words = f"not among the manoeuvres to run next, for the identified ship cannot perform them: {'; '.join(lacking)}"
    prior = np.where(np.isfinite(solution.prior_widths), 1 / solution.prior_widths**2, 0.0)
    whole = judged.information + np.diag(prior)  # what the current takes away is not known of the others
    known = whole[:own, :own] - whole[:own, own:] @ np.linalg.solve(whole[own:, own:], whole[own:, :own])
    table = design.rank_candidates(contributions, unknown.paths[:own], known)
    return table, words if lacking else ""


def _profile(path: str, dataset: Dataset, solution: Solution, judged: Statistics) -> Profile:
    index = solution.paths.index(path)
    unknown = free_factors(solution.vessel, solution.settings)
    held = {
        gone: (factor, factor)
        for gone, factor in zip(solution.paths, solution.factors, strict=True)
        if gone in solution.dropped and gone in solution.values
    }

    def refit(name: str, factor: float, start: Array) -> tuple[float, Array]:
        given = {path: ends for path, ends in solution.settings.bounds.items() if path not in {*held, name}}
        limits = {**given, **held, name: (factor, factor)}  # later ones hold, and patterns may select the same
        changed = solution.settings.model_copy(update={"bounds": limits, "drop": None})
        begin = dict(zip(solution.paths, start.tolist(), strict=True))
        again = identify(solution.vessel, dataset, solution.runs, changed, start=begin)
        return (again.objective if again.status == "ok" else float("inf")), again.factors

    return profile_factor(
        path,
        solution.factors,
        index,
        solution.objective,
        refit,
        half_width=float(judged.high[index] - solution.factors[index]),
        freedom=float(judged.covariances[judged.chosen].freedom[judged.free.index(path)]),
        ratio=variance_ratio(judged, path),
        bounds=(float(unknown.low[index]), float(unknown.high[index])),
        unit="its base value" if unknown.centre[index] else "its scale",
    )


def warn_of_unmeasured_inputs(vessel: Vessel, dataset: Dataset, runs: Sequence[str], settings: Identify) -> list[str]:
    """A warning if the vessel feels what nobody measured: the numbers make up for it."""
    lacking = missing_inputs(vessel, dataset, settings, runs)
    if not lacking:
        return []
    current = "; --nuisance current=0.2 gives each run a current" if "V_c" in lacking else ""
    return [f"not in the log, taken as 0: {', '.join(lacking)}: the estimates make up for what they do{current}"]


def unrecorded_time_warning(dataset: Dataset, runs: Sequence[str], settings: Identify) -> list[str]:
    """A warning if the runs to fit hold times without rows, over which predictions go on with the last orders."""
    words = gaps_in_words(dataset.select(runs), settings.step)
    remedy = "orders are held and weather is interpolated there; set max_gap in [clock] of the mapping and import again"
    return [f"{words}: {remedy}"] if words else []


def _not_varied(dataset: Dataset, runs: Sequence[str], paths: Sequence[str]) -> list[str]:
    """Warnings if the runs vary no command, or not one of a component with numbers to identify, or a helm by little."""
    said, components = warn_of_constant_commands(dataset, runs), {path.split(".")[1] for path in paths if "." in path}
    held = [name for name in constant_commands(dataset, runs) if name.rpartition(".")[0] in components]
    helms = dataset.select(runs).frame[[name for name in dataset.commands if is_steering(name)]]
    if said:
        return said
    if held:
        are = plural_word(len(held), "is", "are")
        said = [f"{join_names(held)} {are} the same in all runs to fit: what other orders do there is not learnt"]
    if len(helms.columns) and (width := np.degrees(np.ptp(helms.to_numpy(), axis=0).max())) < LITTLE_HELM:
        words = f"{join_names([*helms])}: all angles lie within {width:.2g} deg, and 95 % intervals may be too short"
        said.append(f"{words}; compare with --profile, or fit runs with more helm")
    return said


def _better_fit_warnings(solution: Solution, curves: Sequence[Profile]) -> Iterator[str]:
    for curve in curves:
        estimate = solution.factors[solution.paths.index(curve.path)]
        if curve.rises[np.argmin(np.abs(curve.values - estimate))] > BETTER * curve.limit:
            yield (
                f"the estimate is not the optimum: the profile of {curve.path} fits better at "
                f"{curve.values[np.argmin(curve.rises)]:.4g}; give priors, or another start or horizon"
            )


def _fit_warnings(
    solution: Solution, judged: Statistics, free: Mapping[str, FreeRuns], settings: Identify
) -> list[str]:
    """Warnings about the fit: coloured residuals, horizon, untrusted errors, bounds, no test, worse free runs.

    settings : as given, with what priors they name.
    """
    warnings, coloured = list[str](), memory_of_signals(solution, judged)
    horizon = solution.settings.horizon
    if coloured:
        longest = max(coloured.values())
        begun = "initial_state" in solution.settings.widths
        starts = "" if begun else ", or predictions begin at noisy rows (compare with --nuisance initial_state)"
        warnings.append(
            f"residuals of {join_names(list(coloured))} are correlated over {significant_digits(longest)} s: the "
            f"model, or the wind and current data, are incomplete{starts}"
        )
        if 0 < horizon < LONG * longest:
            longer = [f"{significant_digits(LONG * longest)} s"] if LONG * longest < _longest_run(solution) else []
            warnings.append(
                f"the horizon of {horizon:g} s is short in comparison: estimates may be biased beyond their intervals"
                f"; compare with {', or '.join([*longer, 'whole runs (horizon 0) if the ship keeps its course'])}"
            )
    best = judged.covariances[judged.chosen]
    if not best.trusted:
        warnings.append(f"standard errors ({best.kind}) are not to be trusted: {best.reason}")
    if best.kind == "sandwich":
        warnings += [
            f"run {run} alone decides {path}: the interval takes the errors of this run to be like those of others; "
            f"excite {path} in another run, too"
            for path, run in factors_of_single_runs(judged).items()
        ]
    drifting = open_to_drift(judged) if best.kind == "fisher" and best.trusted else {}
    if drifting:
        said = [
            f"{name} {times:.1f}" for name, times in zip(short_names(tuple(drifting)), drifting.values(), strict=True)
        ]
        warnings.append(
            "so few runs may hide a slow drift of sensors, wind or current, which makes errors larger than their "
            f"intervals say, by these factors: {join_names(said)}; fit more runs"
        )
    named = isinstance(settings.nuisance, Mapping) and "current" in settings.nuisance
    contrary = {path: of for path, of in against_priors(judged).items() if named or path in solution.values}
    if contrary:
        of_path = dict(zip(solution.paths, short_names(solution.paths), strict=True))
        said = [
            f"{'the factor of ' if path in solution.values else ''}{of_path[path]} would be "
            f"{significant_digits(factor * size)} +- {significant_digits(half * size, 2)}"
            f"{'' if path in solution.values else ' m/s'} (prior {width * size:g})"
            for path, (width, factor, half) in contrary.items()
            for size in [1.0 if path in solution.values else solution.settings.widths["current"]]
        ]
        warnings.append(
            f"the runs contradict the priors: by the runs alone {join_names(said)}; base, log or "
            "priors are wrong, and the intervals take the priors for true"
        )
    bound = [path for path, there in zip(solution.paths, solution.at_bound, strict=True) if there]
    if bound:
        others = "the intervals of the others hold if the bound is the true value"
        warnings.append(f"at a bound, so without an interval: {join_names(bound)}; {others}")
    if "test" not in free:
        warnings.append("no run was held out: the accuracy on other runs is not known")
    known = {"initial_state", *(["current"] if solution.settings.current == "one" else [])}
    left_out = [name for name in solution.settings.widths if name not in known]  # a new run has none
    without = f", which leave out {join_names(left_out)}," if left_out else ""
    for name, runs in free.items():
        every = runs.errors[runs.errors["run"] == ALL].set_index("model")
        diverged = [str(model) for model in every.index if not np.isfinite(every["u"][model])]
        if diverged:
            warnings.append(f"free runs of the {name} runs diverge {join_names(diverged)} identification")
        worse = [] if diverged else _worse_signals(every)
        if worse:
            warnings.append(f"free runs of the {name} runs{without} are worse than before in {join_names(worse)}")
    return warnings


def _worse_signals(errors: pd.DataFrame) -> list[str]:
    """Signals with more error after the fit than before, and by how much; errors : by model."""
    ratios = {name: float(errors[name][AFTER]) / max(float(errors[name][BEFORE]), 1e-12) for name in ERRORS_OF}
    return [
        f"{name} by {significant_digits(100 * (ratio - 1), 2)} %" for name, ratio in ratios.items() if ratio > 1 + WORSE
    ]


def _round_significant(value: float) -> float:
    """Round to 6 significant digits, so that the text does not depend on the machine."""
    return float(f"{value:.6g}")
