"""Structures of the hull compared on the same runs, and chosen by runs that no fit has seen.

The runs are dealt into folds. Every structure is fitted to all folds but one and predicts that one, fold after fold, so
each run is predicted by a fit without it. The structure with the least mean error of the position is chosen; intervals
of the differences are paired over runs. Then every structure is fitted to all runs, and performs the standard
manoeuvres: those that are as good on the runs may differ there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomlkit

from shipid import document as documents
from shipid.data.dataset import Dataset
from shipid.errors import DataError, ShipidError
from shipid.evidence import FEWEST_RUNS, paired_difference, which_significant
from shipid.files import write_new
from shipid.identification.bands import (
    Trial,
    band_refusal,
    check_level,
    extrapolation_sentences,
    measure_bands,
    perform_trials,
    select_measures,
)
from shipid.identification.fit import Solution
from shipid.identification.free_run import ALL, ERRORS_OF, FreeRuns, check_length, simulate_free_runs
from shipid.identification.outcome import (
    TRIED,
    pick_runs,
    unrecorded_time_warning,
    warn_of_unmeasured_inputs,
    without_shared,
)
from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.identification.statistics import LEVEL, Statistics, fit_statistics
from shipid.identification.structures import PRESENT, STRUCTURES, check_structures, exchange_structure
from shipid.simulation.measured import MeasuredManoeuvre
from shipid.study.new import proposed_horizon, survey_dataset
from shipid.version import __version__
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.ranges import UNUSUAL, find_contradictions

SayStep = Callable[[str], object]
STRUCTURE_FOLDS = 3
SIDES_OF_TRIALS = ("starboard", "port")
MEASURES_SHOWN = {"zigzag": ("overshoot 1", "overshoot 2"), "turning": ("advance", "tactical diameter")}
"""Kind of a standard manoeuvre -> measures shown, few of `COMPARED` of `identify`: each has a row a structure."""


@dataclass(frozen=True, eq=False)
class FittedStructure:
    """A structure fitted to all runs: vessel, solution and its statistics; `caution` where its intervals mislead."""

    vessel: Vessel
    solution: Solution
    statistics: Statistics
    caution: str


@dataclass(frozen=True, eq=False, kw_only=True)
class StructureComparison:
    """Result of a comparison of structures.

    sentences : on the structure chosen, the reason, and notes. chosen : its name.
    errors : `structure`, `set` (`folds`, `test`), `run` (`all` at first), RMS `u`, `v` [m/s], `r` [rad/s], `position`
        [m] of runs that the fit has not seen.
    table : `structure`, `numbers`, means over runs `u`, `v`, `r`, `position`; `test`, that of the position on the test
        runs; `more`, `low`, `high`: difference of the position to the chosen one with its interval; `equal`: whether
        it is not shown to be worse, corrected for how many there are (Holm), and says something; `note`.
    manoeuvres : `manoeuvre`, `measure`, `unit`, `structure`, `value`, `low`, `high`, `note`.
    spread : `manoeuvre`, `measure`, `unit`, `least`, `greatest` over the structures that are equally good, `spread`
        and `width`, the greatest width of the interval within one of them.
    vessel : the base. runs, test : of the folds, and held out of all. digest : of the dataset. shared : warnings of
        runs that share moments with those held out. ahead : length of a free run [s], 0: whole runs.
    fits : structure -> the fit to all runs; structures that could not be fitted are missing.
    """

    sentences: Sequence[str]
    table: pd.DataFrame
    errors: pd.DataFrame
    manoeuvres: pd.DataFrame
    spread: pd.DataFrame
    chosen: str
    ahead: float
    vessel: Vessel
    runs: tuple[str, ...]
    test: tuple[str, ...]
    digest: str
    shared: tuple[str, ...]
    fits: Mapping[str, FittedStructure]

    def document(self) -> str:
        """The vessel with the chosen structure, fitted to all runs, as TOML."""
        vessel = self.fits[self.chosen].vessel
        odd = find_contradictions(vessel.document, vessel.parameters)  # refused where it is read, unless it is named
        unusual = [*vessel.document.get(UNUSUAL, []), *odd]
        document = {
            **vessel.document,
            **({UNUSUAL: unusual} if unusual else {}),
            "name": f"{self.vessel.name}, {self.chosen}",
            "source": f"structure {self.chosen} identified from {len(self.runs)} runs of dataset {self.digest} by "
            f"shipid {__version__}, on {self.vessel.key}, digest {self.vessel.digest}",
        }
        return tomlkit.dumps(documents.plain_values(document))


def write_chosen_structure(compared: StructureComparison, file: Path) -> Path:
    """Write the vessel with the chosen structure; it is read again to be sure. An existing file is kept."""
    written = write_new(compared.document(), file)
    load_vessel(str(written.resolve()))
    return written


def compare_structures(
    vessel: Vessel,
    dataset: Dataset,
    settings: Identify,
    names: Sequence[str],
    runs: Sequence[str] = (),
    held_out: Sequence[str] = (),
    *,
    ahead: float | None = None,
    folds: int = STRUCTURE_FOLDS,
    level: float | None = LEVEL,
    say: SayStep | None = None,
) -> StructureComparison:
    """Compare structures of the hull on the same runs.

    Parameters
    ----------
    settings : numbers outside of the hull that are free, weights, horizon and solver; see `exchange_structure`.
    names : of `shipid.identification.structures.STRUCTURES`, or `present`.
    runs, held_out : names or patterns, as `pick_runs` takes them; runs held out choose nothing.
    ahead : length of the free runs [s], 0 for whole runs; default: the horizon that a new study would have.
    folds : parts into which the runs are dealt. level : of the intervals on manoeuvres; None: none.
    say : called with each step.

    Raises
    ------
    DocumentError, DataError : vessel, dataset, settings and runs do not fit together.
    ShipidError : fewer than two structures or runs, or no structure that can be fitted.
    """
    check_level(level)
    digest = dataset.digest
    dataset, fitted, tested, shared = check_comparison(
        dataset, settings, names, runs, held_out, ahead=ahead, folds=folds
    )
    length = proposed_horizon(vessel, survey_dataset(dataset))[0] if ahead is None else ahead
    check_length(settings, length)
    settings, report = settings.with_current_named(), say or (lambda _: None)
    parts = [part for number in range(folds) if (part := fitted[number::folds])]
    errors, fits, notes = list[pd.DataFrame](), dict[str, FittedStructure](), dict[str, str]()
    for name in names:
        try:
            frames, whole = _errors_and_fit(vessel, name, dataset, settings, parts, fitted, tested, length, report)
        except DataError:
            raise
        except ShipidError as error:
            notes[name] = error.message
            continue
        errors += [frame.assign(structure=name) for frame in frames]
        fits[name] = whole
    if not fits:
        raise ShipidError("; ".join(f"{name}: {note}" for name, note in notes.items()))
    every = pd.concat(errors, ignore_index=True)
    table = _structure_table(names, every, {name: len(fit.solution.paths) for name, fit in fits.items()}, notes, fitted)
    if not np.isfinite(table["position"].iloc[0]):
        raise ShipidError(
            "no structure predicts every run that was held out: give priors, more runs, or a shorter --ahead",
            path="--structures",
        )
    chosen = str(table["structure"].iloc[0])
    equal = [str(name) for name in table.loc[table["equal"], "structure"]]
    report("standard manoeuvres")
    manoeuvres, done = _manoeuvre_table(fits, chosen, equal, level)
    far = extrapolation_sentences(fits[chosen].vessel, done, dataset, fitted)
    silent = uninformative_structures(manoeuvres)
    for name in silent.keys() - {chosen}:
        table.loc[table["structure"] == name, ["equal", "note"]] = False, silent[name]
    spread = _spread_of_measures(manoeuvres, [name for name in equal if name not in silent])
    return StructureComparison(
        sentences=_comparison_sentences(table, spread, silent, fitted, length, far),
        vessel=vessel,
        runs=fitted,
        test=tested,
        digest=digest,
        shared=(
            *shared,
            *warn_of_unmeasured_inputs(vessel, dataset, fitted, settings),
            *unrecorded_time_warning(dataset, fitted, settings),
        ),
        ahead=length,
        errors=every,
        table=table,
        chosen=chosen,
        fits=fits,
        manoeuvres=manoeuvres,
        spread=spread,
    )


def _comparison_sentences(
    table: pd.DataFrame,
    spread: pd.DataFrame,
    silent: Mapping[str, str],
    runs: Sequence[str],
    ahead: float,
    beyond: Sequence[str],
) -> list[str]:
    """The structure chosen, the reason, and notes. silent : structures left out of the spread, and why."""
    best, *rest = table.to_dict("records")
    others = [str(row["structure"]) for row in rest if row["equal"]]
    length = f"{ahead:g} s" if ahead else "whole runs"
    notes = [
        f"structure {best['structure']} has the least error of the position over {length} on runs that the fit has not "
        f"seen: {best['position']:.3g} m"
    ]
    if len(runs) < FEWEST_RUNS:
        notes.append(f"{len(runs)} runs give no interval of the differences, {FEWEST_RUNS} would")
    elif others:
        notes.append(f"not shown to be worse: {', '.join(others)}")
    elif table["low"].notna().any() and not silent:
        notes.append("all others that could be judged are shown to be worse")
    notes += [f"left out of the spread: {name}, {why}" for name, why in silent.items()]
    wide = spread[spread["spread"] > spread["width"]]
    if len(wide):
        share = wide["spread"] / wide[["least", "greatest"]].abs().max(axis=1)
        worst = wide.iloc[int(share.argmax())]
        notes.append(
            f"structures differ by more than the interval within one in {len(wide)} of {len(spread)} measures, most in "
            f"the {worst['measure']} of {worst['manoeuvre']}: {worst['least']:.3g} to {worst['greatest']:.3g} "
            f"{worst['unit']}"
        )
    return [*notes, *beyond]


def check_comparison(
    dataset: Dataset,
    settings: Identify,
    names: Sequence[str],
    runs: Sequence[str] = (),
    held_out: Sequence[str] = (),
    *,
    ahead: float | None = None,
    folds: int = STRUCTURE_FOLDS,
) -> tuple[Dataset, tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """The dataset whose runs to fit see nothing of those held out, the runs to fit, those held out, and warnings.

    Raises what `compare_structures` raises of these arguments, before anything is simulated.
    """
    check_structures(names)
    if not names:
        raise ShipidError(f"name structures to compare: {', '.join((PRESENT, *STRUCTURES))}", path="structures")
    check_length(settings, ahead or 0.0)
    fitted, tested = pick_runs(dataset, runs, held_out)
    dataset, fitted, shared = without_shared(dataset, fitted, tested)
    if not 2 <= folds <= max(len(fitted), STRUCTURE_FOLDS):
        raise ShipidError(f"{folds} folds of {len(fitted)} runs: give 2 or more, at most one a run", path="folds")
    if len(fitted) < 2:
        raise DataError(
            "only one run: give two or more, because each run is predicted by a fit to the others", path="runs"
        )
    return dataset, fitted, tested, shared


def _errors_and_fit(
    vessel: Vessel,
    name: str,
    dataset: Dataset,
    settings: Identify,
    parts: Sequence[Sequence[str]],
    fitted: Sequence[str],
    tested: Sequence[str],
    ahead: float,
    report: SayStep,
) -> tuple[list[pd.DataFrame], FittedStructure]:
    """Errors of runs by fits that have not seen them, and the fit to all runs."""

    def fit(runs: Sequence[str], others: Sequence[str]) -> tuple[Vessel, Solution]:
        """A fit to some runs; the others decide nothing in it, neither its start nor its priors."""
        report(f"{name}: {len(runs)} of {len(fitted)} runs")
        seen, runs, _ = without_shared(dataset, runs, others)
        other = exchange_structure(vessel, name, seen, runs, settings)
        solution = identify(other.vessel, seen, runs, other.settings)
        if solution.status != "ok":
            raise ShipidError(solution.sentence)
        return other.vessel.with_values(solution.values), solution

    def replay(ship: Vessel, found: Solution, runs: Sequence[str]) -> FreeRuns:
        """Free runs, in the current of all runs that was estimated with the vessel."""
        return simulate_free_runs({name: ship}, dataset, runs, settings, ahead, {name: found.common_current})

    whole, solution = fit(fitted, ())
    frames = []
    for part in parts:
        rest = [run for run in fitted if run not in part]
        replayed = replay(*fit(rest, part), part)
        frames.append(replayed.errors[replayed.errors["run"] != ALL])
    errors = [_with_mean(pd.concat(frames, ignore_index=True)).assign(set="folds")]
    if tested:
        test = replay(whole, solution, tested)
        errors.append(_with_mean(test.errors[test.errors["run"] != ALL]).assign(set="test"))
    judged = fit_statistics(solution)
    return errors, FittedStructure(whole, solution, judged, band_refusal(solution, judged))


def _with_mean(errors: pd.DataFrame) -> pd.DataFrame:
    """Errors of runs below their mean over runs; a run whose prediction diverges makes it infinite."""
    known = errors.assign(**{name: errors[name].fillna(np.inf) for name in ERRORS_OF})
    mean = {name: float(known[name].mean()) for name in ERRORS_OF}
    return pd.concat([pd.DataFrame([{"run": ALL, **mean}]), known.drop(columns=["model", "samples"])])


def _structure_table(
    names: Sequence[str],
    errors: pd.DataFrame,
    counts: Mapping[str, int],
    notes: Mapping[str, str],
    fitted: Sequence[str],
) -> pd.DataFrame:
    """One row for each structure, best first; those that could not be fitted last."""
    means = {(row["set"], row["structure"]): row for row in errors[errors["run"] == ALL].to_dict("records")}
    of_run = errors[(errors["set"] == "folds") & (errors["run"] != ALL)]
    position = {name: of_run[of_run["structure"] == name].set_index("run")["position"].to_dict() for name in counts}
    known = sorted(counts, key=lambda name: float(means["folds", name]["position"]))
    best = known[0]
    sound = [name for name in known if np.isfinite(list(position[name].values())).all()]
    between, worse = dict.fromkeys(known, (np.nan, np.nan)), set[str]()
    if best in sound and len(sound) > 1:
        apart = np.array([[position[name][run] - position[best][run] for run in fitted] for name in sound[1:]])
        differences = paired_difference(apart)
        between |= dict(zip(sound[1:], np.stack([differences.low, differences.high], axis=1).tolist(), strict=True))
        worse = {name for name, behind in zip(sound[1:], which_significant(differences.above), strict=True) if behind}
    rows: list[dict[str, Any]] = [
        {
            "structure": name,
            "numbers": counts[name],
            **{signal: float(means["folds", name][signal]) for signal in ERRORS_OF},
            "test": float(means["test", name]["position"]) if ("test", name) in means else np.nan,
            "more": float(means["folds", name]["position"] - means["folds", best]["position"])
            if name in sound
            else np.inf,
            "low": between[name][0],
            "high": between[name][1],
            "equal": name == best or (name in sound and name not in worse),
            "note": "" if name in sound else "diverges on a run that was held out",
        }
        for name in known
    ]
    nothing = dict.fromkeys((*ERRORS_OF, "test", "more", "low", "high"), np.nan)
    rows += [
        {"structure": name, "numbers": 0, **nothing, "equal": False, "note": notes[name]}
        for name in names
        if name in notes
    ]
    return pd.DataFrame(rows)


def with_actuators_on(vessel: Vessel) -> Vessel:
    """The vessel with every actuator that its document holds: one that is off for a log of measured angles, too."""
    off = {
        f"thruster.{name}.actuator.{command}.off": False
        for name, block in vessel.document.get("thruster", {}).items()
        for command, actuator in (block.get("actuator") or {}).items()
        if isinstance(actuator, Mapping) and actuator.get("off", False)
    }
    return vessel.with_values(off) if off else vessel


STANDARD_TRIALS: dict[str, Trial] = {
    f"{kind} {'/'.join(f'{angle:g}' for angle in angles)} to {side}": (kind, angles, side)
    for kind, angles in TRIED
    for side in SIDES_OF_TRIALS
}


def _manoeuvre_table(
    fits: Mapping[str, FittedStructure], chosen: str, equal: Sequence[str], level: float | None
) -> tuple[pd.DataFrame, dict[str, MeasuredManoeuvre]]:
    """Measures of standard manoeuvres, with intervals for the equally good, and what the chosen one performed."""

    def perform(vessel: Vessel) -> dict[str, dict[str, float]]:
        return select_measures(perform_trials(with_actuators_on(vessel), STANDARD_TRIALS)[0], MEASURES_SHOWN)

    rows = list[dict[str, Any]]()
    each = {name: perform_trials(with_actuators_on(fit.vessel), STANDARD_TRIALS) for name, fit in fits.items()}
    for name, (done, refused) in each.items():
        fit, notes = fits[name], refused if done else {"all": next(iter(refused.values()))}
        units = {row["measure"]: row["unit"] for one in done.values() for row in one.measures}
        frames: list[Any] = [
            {"manoeuvre": title, "measure": measure, "value": value}
            for title, measures in select_measures(done, MEASURES_SHOWN).items()
            for measure, value in measures.items()
        ]
        if level is not None and name in equal:
            frames = measure_bands(fit.solution.vessel, fit.solution, fit.statistics, perform, level).to_dict("records")
        frames += [{"manoeuvre": title, "measure": "", "note": note} for title, note in notes.items()]
        rows += [{"note": "", **row, "structure": name, "unit": units.get(row["measure"], "")} for row in frames]
    columns = ["manoeuvre", "measure", "unit", "structure", "value", "low", "high", "note"]
    return pd.DataFrame(rows, columns=columns), each[chosen][0]


def uninformative_structures(manoeuvres: pd.DataFrame) -> dict[str, str]:
    """Structure -> a sentence on the first length of a standard manoeuvre [m] that it gives an interval with 0 for."""
    lengths = manoeuvres[(manoeuvres["unit"] == "m") & (manoeuvres["low"] <= 0) & (manoeuvres["high"] >= 0)]
    return {
        str(row["structure"]): f"whose {row['measure']} of {row['manoeuvre']} says nothing: "
        f"{row['low']:.3g} to {row['high']:.3g} m"
        for row in lengths.drop_duplicates("structure").to_dict("records")
    }


def _spread_of_measures(manoeuvres: pd.DataFrame, equal: Sequence[str]) -> pd.DataFrame:
    """Range of every measure over the structures that are equally good, and the greatest interval within one."""
    good = manoeuvres[manoeuvres["structure"].isin(equal) & (manoeuvres["measure"] != "")]
    good = good.assign(width=(good["high"] - good["low"]).astype(float), value=good["value"].astype(float))
    spread = good.groupby(["manoeuvre", "measure"], sort=False, as_index=False).agg(
        unit=("unit", "first"), least=("value", "min"), greatest=("value", "max"), width=("width", "max")
    )
    spread.insert(5, "spread", spread["greatest"] - spread["least"])
    return spread
