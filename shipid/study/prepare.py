"""From a plan to arrays: the truth or the log, windows, and what every physics model predicts for them."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid import document as documents
from shipid.capacity import excess_memory_words
from shipid.data.causal import causal_columns
from shipid.data.checks import copies_of_earlier_runs, warn_of_constant_commands
from shipid.data.dataset import (
    Dataset,
    clock_slack,
    keep_rows,
    read_dataset,
    rows_outside_spans,
    stretch_columns,
    stretches_by_run,
    stretches_of_runs,
)
from shipid.data.windows import (
    Instants,
    PathSource,
    Windows,
    coarse_in_words,
    constant_motion,
    cut_windows,
    gaps_of_runs,
    longest_gap_in_words,
    nested_runs,
    part_folds,
    run_folds,
    to_frame,
    windows_over_spans,
)
from shipid.engine.casadi import memory_along
from shipid.errors import DataError, DivergenceError, DocumentError, placed_errors, suggest_name
from shipid.foundations.fmu import SimulatorFmu
from shipid.hybrid.features import count_steps
from shipid.hybrid.method import Case, Task
from shipid.hybrid.physics import Physics, check_columns, missing_columns
from shipid.hybrid.regression import Regression
from shipid.hybrid.search import best_trials
from shipid.hybrid.simulated import SimulatedPhysics, Simulator
from shipid.logs.catalogue import fetch_log
from shipid.logs.importing import import_log
from shipid.logs.kinds import kind_in_name
from shipid.logs.mapping import read_mapping
from shipid.logs.segments import run_kind
from shipid.metrics import position_error
from shipid.observer import Array, Estimates, Observer, estimates_at_windows, run_observer, tune_observer
from shipid.simulation.manoeuvre import kind_name
from shipid.simulation.truth import Truth, draw_manoeuvres, simulate_truth
from shipid.study.declared import Foundation
from shipid.study.plan import Batch, Plan, mapping_of, past_steps, path_from_study
from shipid.study.schema import Study
from shipid.units import percent_text, plural_word
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel
from shipid.vessel.perturb import Family, draw_variant

MOST_REDRAWS = 100


@dataclass(frozen=True)
class FoundationPrediction:
    """What a foundation predicts before any method improves it.

    foundation : after redraws; with the numbers that were identified and the observer that was chosen, if any.
    paths, test_paths : (T, S, 2) [m] in the frame (11) on windows of training and of the test; zeros without physics.
    diverged, test_diverged : (S,) the windows on which it diverges.
    estimates : what its observer knows at every row of the runs; None without one.
    sentence : the message of the identification; empty where nothing was identified. seconds : core-seconds that
        identification and choice took.
    """

    foundation: Foundation
    paths: Array
    test_paths: Array
    diverged: Array
    test_diverged: Array
    estimates: Estimates | None = None
    sentence: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class PreparedStudy:
    """All that cells need, the same for every worker.

    study : the checked document, with the seeds of its world.
    data : the runs themselves.
    pool, test : windows for training and validation, and windows of the untouched test runs.
    known : foundation -> what it predicts on pool and test, by the numbers that it has before it is fitted to a batch.
    notes : what was assumed, redrawn or left out, in sentences.
    kinds : run -> kind of manoeuvre, see `kinds_of_runs`.
    """

    study: Study
    data: Dataset
    pool: Windows
    test: Windows
    known: Mapping[str, FoundationPrediction]
    notes: tuple[str, ...]
    kinds: Mapping[str, str] = field(default_factory=dict)

    @property
    def foundations(self) -> tuple[Foundation, ...]:
        """The foundations, after redraws."""
        return tuple(one.foundation for one in self.known.values())

    @property
    def commands(self) -> tuple[str, ...]:
        """Command columns of the runs."""
        return tuple(self.data.commands)

    @cached_property
    def naive(self) -> Array:
        """Error (T, S) [m] of constant u, v, r on the test windows: the floor that any predictor must beat."""
        return position_error(constant_motion(self.test), self.test.future)

    def runs(self, batch: Batch) -> tuple[str, ...]:
        """Training and validation runs of a batch: nested over N_D for one seed."""
        return nested_runs(self.pool.spans, self.study.grid.N_D, batch.seed)[batch.N_D]

    def folds(self, batch: Batch, windows: Windows, validation: str) -> list[tuple[Array, Array]]:
        """(Training, validation) indices into the windows of a batch, split by run, sharing no moment.

        With one fold, 20 % of the runs validate; a method with `validation` = `runs` leaves out every run in turn. A
        single run is left out part by part.
        """
        return run_folds(windows, validation, batch.seed, self.study.split.folds)


def obtain_runs(plan: Plan) -> Dataset:
    """The runs of a study: simulated by its truth, imported from its log, or read."""
    study, folder = plan.study, Path(plan.file).parent
    if study.truth is not None and plan.truth is not None:
        with placed_errors(DocumentError, file=plan.file):
            frame = _simulate(plan, study.truth, plan.truth)
        runs = map(str, frame["run"].unique())
        kinds = {run: kind_in_name(kind_name(one)) for run, one in zip(runs, draw_manoeuvres(study.truth), strict=True)}
        manoeuvres = {run: kind for run, kind in kinds.items() if kind is not None}
        known = {"vessel": study.truth.vessel, "source": "simulated", "clock": "run", "flags": []}
        return Dataset(frame, {**known, "manoeuvres": manoeuvres})
    assert study.data is not None
    if study.data.dataset is not None:
        return read_dataset(path_from_study(folder, study.data.dataset))
    source = mapping_of(study.data, Path(plan.file))
    assert source is not None
    log = fetch_log(source) if study.data.log is None else path_from_study(folder, study.data.log)
    return import_log(read_mapping(source), log, without=study.data.without)


def _simulate(plan: Plan, truth: Truth, vessel: Vessel) -> pd.DataFrame:
    """The runs of a truth, by its vessel or by its FMU."""
    simulator = plan.simulators.get(truth.fmu or "")
    return simulate_truth(truth, vessel, *([simulator.perform] if isinstance(simulator, SimulatorFmu) else []))


def partition(plan: Plan, dataset: Dataset) -> tuple[Windows, Windows, list[str]]:
    """Cut windows and set the test runs aside: windows that may train, those of the test, and what was left out.

    Raises DocumentError where the runs do not suffice.
    """
    with placed_errors(DocumentError, file=plan.file):
        windows = all_windows(plan, dataset)
        is_test = np.isin(windows.run, _test_runs(plan.study, windows))
        test, rest = _against_truth(plan, windows.select(is_test)), windows.select(~is_test)
        coarse = coarse_in_words(dataset, windows.step)
        notes = [
            *([coarse] if coarse else []),
            *warn_of_constant_commands(dataset, windows.spans),
            *over_gaps(dataset, windows),
        ]
        if windows.shared_clock:
            touching = rest.touching(test.spans.values())
            if touching.any():
                notes.append(f"{int(touching.sum())} windows that touch the test runs in time never train")
            rest = rest.select(~touching)
        _check_amounts(plan, rest, len(test.spans))
    return rest, test, notes


def _against_truth(plan: Plan, test: Windows) -> Windows:
    """Test windows of a simulated study with the exact future path, seen from the measured position and heading."""
    truth = plan.study.truth
    if truth is None or plan.truth is None or not truth.sensors:
        return test
    exact = _simulate(plan, truth.model_copy(update={"sensors": {}, "interval": truth.step}), plan.truth)
    ahead, columns, future = test.step * np.arange(1, test.horizon + 1)[:, None], test.columns, test.future.copy()
    for run, rows in exact.groupby("run", sort=False):
        mine = test.run == run
        at = (np.interp(test.t[mine] + ahead, rows["t"], rows[name]) for name in ("north", "east"))
        future[:, mine] = np.stack(to_frame(*at, *(columns[name][mine] for name in ("north", "east", "psi"))), axis=-1)
    return replace(test, future=future)


def _check_amounts(plan: Plan, rest: Windows, tests: int) -> None:
    """Refuse amounts of data that the runs left to train do not give, or whose single run cannot be cut into parts."""
    left, amounts = len(rest.spans), plan.study.grid.N_D
    if left < max(amounts):
        there = f"only {left} {plural_word(left, 'run is', 'runs are')} left for training"
        tested = f"{tests} {plural_word(tests, 'tests', 'test')} (split.test)"
        raise DocumentError(f"{max(amounts)}: {there}, {tested}", path="grid.N_D")
    for seed in plan.study.seeds_of(1) if 1 in amounts else ():
        try:
            part_folds(rest.select(rest.run == nested_runs(rest.spans, amounts, seed)[1][0]))
        except DataError as error:
            raise DocumentError(f"1: {error.message}; take 2 runs or more", path="grid.N_D") from None


def over_gaps(dataset: Dataset, windows: Windows) -> list[str]:
    """A sentence on windows that reach over times without rows, longer than a step; none where there are none."""
    spans = gaps_of_runs(dataset, windows.step)
    over = windows_over_spans(windows, spans)
    if not over.any():
        return []
    longest = longest_gap_in_words({run: spans[run] for run in np.unique(windows.run[over]).tolist()})
    return [
        f"{int(over.sum())} of {len(windows)} windows hold a time without rows, {longest}: path and motion are only "
        "interpolated there; set max_gap in [clock] of the mapping and import again"
    ]


def all_windows(plan: Plan, dataset: Dataset) -> Windows:
    """Every window of a study, test and training; DocumentError where no run is as long as the horizon."""
    study, prediction, past = plan.study, plan.study.prediction, past_steps(plan)
    cut = partial(
        cut_windows,
        horizon=prediction.horizon,
        step=prediction.step,
        interval=prediction.interval,
        path=path_source(study),
        past=past,
    )
    lengths = np.array([np.ptp(rows["t"]) for _, rows in stretches_of_runs(dataset)])
    count = (np.maximum(lengths - (prediction.horizon + past) * prediction.step, 0) // prediction.interval + 1).sum()
    columns = len(dataset.frame.columns)
    each = (prediction.horizon + 1) * (columns + 6 + 2 * len(plan.foundations)) + past * columns
    if fault := excess_memory_words(float(count * each)):
        words = f"{prediction.interval:g} s: {len(lengths)} runs cut into windows at this interval {fault}"
        raise DocumentError(words, path="prediction.interval")
    with placed_errors(DataError, path="prediction.ahead", into=DocumentError):
        windows = cut(dataset)
    if study.data is not None and study.data.causal:
        known = cut(known_by_then(study, dataset))  # the truth is that of the log, inputs are what was known
        windows = replace(windows, columns=known.columns, past=known.past)
    if prediction.samples is not None:
        windows = windows.select(pd.Series(windows.run).groupby(windows.run).cumcount().to_numpy() < prediction.samples)
    return windows


def prepare(plan: Plan, dataset: Dataset, device: str = "cpu") -> PreparedStudy:
    """Cut windows, set the test runs aside, and roll every model out on all of them.

    A member that diverges on windows of the pool stays, see `hold_velocity`, or is redrawn with the next counter where
    its family says so; the test set is never looked at.
    """
    dataset = _in_order(plan, dataset)
    rest, test, notes = partition(plan, dataset)
    notes += [
        f"{way.name} takes no observer: not fitted to {', '.join(way.left_out)}" for way in plan.methods if way.left_out
    ]
    if same := copies_of_earlier_runs(dataset, (*rest.spans, *test.spans)):
        copies = ", ".join(f"{run!r} as {other!r}" for run, other in same.items())
        notes.append(
            f"runs that move as others do ({copies}): errors and intervals take them for new: leave out copies"
        )
    plan = replace(plan, foundations=tuple(one.with_runs(dataset) for one in plan.foundations))
    looked_at: set[tuple[str, str]] = set()
    for foundation in plan.foundations:
        if isinstance(foundation.base, Vessel):
            check_columns(foundation.base, test.columns, plan.file)
            notes += not_measured(foundation.base, test)
        elif foundation.base is not None and (one := (foundation.family, foundation.base.key)) not in looked_at:
            looked_at.add(one)
            place = f"family.{foundation.family}.{foundation.base.kind}"
            meant = any(documents.match_paths(str(pattern), [place]) for pattern in plan.study.unusual)
            remedy = "" if meant else f'if it is meant so, write unusual = ["{place}"] at the top of the study'
            notes += foundation.base.check(rest, test, steps_before(plan, foundation.name), remedy)
    for way in plan.methods:
        if absent := [name for name in way.method.traits.memory.states if name not in test.columns]:
            raise DocumentError(
                f"the runs have no {absent[0]!r}; there are {', '.join(sorted(test.columns))}",
                file=plan.file,
                path=f"method.{way.name}.memory.states",
            )
    with placed_errors(DocumentError, file=plan.file):
        known = _roll_out(plan, dataset, [rest, test], notes, device)
    return PreparedStudy(
        study=plan.study,
        data=dataset,
        pool=rest,
        test=test,
        known=known,
        notes=tuple(dict.fromkeys(notes)),
        kinds=kinds_of_runs(dataset),
    )


def _in_order(plan: Plan, dataset: Dataset) -> Dataset:
    """Put the commands in the order of the first vessel, others last: a drawn network depends on it as on a seed."""
    vessel = next((one.base for one in plan.foundations if isinstance(one.base, Vessel)), None)
    order = () if vessel is None else vessel_dynamics(vessel).commands
    places = {name: place for place, name in enumerate(order)}
    commands = sorted(dataset.commands, key=lambda name: (places.get(name, len(order)), name))
    others = [name for name in dataset.frame if name not in commands]
    return Dataset(dataset.frame[[*others, *commands]], dataset.metadata)


def runs_by_amount(study: Study, pool: Windows) -> dict[int, tuple[str, ...]]:
    """Training and validation runs of each amount of data, fewest first, for the least seed."""
    runs = nested_runs(pool.spans, study.grid.N_D, min(study.seeds_of(max(study.grid.N_D))))
    return {amount: runs[amount] for amount in sorted(runs)}


def _test_runs(study: Study, windows: Windows) -> list[str]:
    wanted, runs = study.split.test, windows.spans
    if isinstance(wanted, int):
        if wanted >= len(runs):
            raise DocumentError(f"{wanted} of only {len(runs)} runs: one must be left to train", path="split.test")
        return list(nested_runs(runs, [wanted], study.split.seed)[wanted])
    if unknown := next((name for name in wanted if name not in runs), None):
        message = f"{unknown!r} is no run with windows: {suggest_name(unknown, runs)}"
        raise DocumentError(message, path="split.test")
    return wanted


Alike = tuple[str, ...]  # structure of a vessel and the numbers of its actuators: their hidden states are equal


def _roll_out(
    plan: Plan, dataset: Dataset, parts: Sequence[Windows], notes: list[str], device: str
) -> dict[str, FoundationPrediction]:
    """What every foundation predicts, with the members that its family redraws."""
    study, calls = plan.study, sum(one.observer is not None for one in plan.foundations)
    families = {family.name: family for family in plan.families}
    known: dict[str, FoundationPrediction] = {}
    waiting = [one for one in plan.foundations if one.base and one.identify is None and one.observer is None]
    instants: dict[Alike, list[Instants]] = {}
    while waiting:
        again = []
        for one in _one_round(study, dataset, parts, waiting, device, instants):
            foundation, lost = one.foundation, int(one.diverged.sum())
            family = families[foundation.family]
            words = f"{foundation.name} diverges on {percent_text(lost / len(parts[0]), 1)} of the training windows"
            fixed = foundation.vessel is not None and not any(block.drawn for block in family.perturb)
            if lost and (family.redraw or fixed):
                again.append(_redraw(foundation, family, words, plan.file, notes))
                continue
            known[foundation.name] = one
            if lost:
                notes.append(f"{words}: its path goes on there, no farther than the present speed takes the ship")
        waiting = again
    for foundation in plan.foundations:
        if foundation.name not in known and foundation.variant is not None:
            same = known[foundation.variant.name]
            foundation = replace(foundation, variant=same.foundation.variant)
            known[foundation.name] = replace(same, foundation=foundation)
        if foundation.name not in known or (foundation.observer is not None and not foundation.fitted):
            known[foundation.name] = predict_foundation(study, dataset, parts, foundation, device, calls)
    return {one.name: known[one.name] for one in plan.foundations}


def physics_of(study: Study, source: Vessel | Simulator | None, observer: Observer | None = None) -> Physics:
    """The physics of a study: a vessel or a simulator over the horizon of the study, or none."""
    ahead, path = study.prediction, path_source(study)
    if isinstance(source, Simulator):
        return SimulatedPhysics(None, ahead.horizon, ahead.step, ahead.integrator, None, path, simulator=source)
    return Physics(source, ahead.horizon, ahead.step, ahead.integrator, observer, path)


def steps_before(plan: Plan, foundation: str) -> list[int]:
    """Numbers of steps before a window from which a method that meets the foundation takes the error of the physics."""
    memories = [way.method.traits.memory for way in plan.methods if foundation in way.foundations]
    step = plan.study.prediction.step
    return sorted({count_steps(seconds, step) for memory in memories for seconds in memory.error})


def known_by_then(study: Study, dataset: Dataset) -> Dataset:
    """The runs as a predictor sees them: columns that the study calls `causal` hold their last fix."""
    if study.data is None or not study.data.causal:
        return dataset
    with placed_errors(DataError, path="data.causal", into=DocumentError):
        return causal_columns(dataset, study.data.causal)


def path_source(study: Study) -> PathSource:
    """Where the true path of a study comes from."""
    return study.data.path if study.data else "position"


def estimates_of(study: Study, foundation: Foundation, dataset: Dataset, test: Windows, calls: int = 1) -> Estimates:
    """Estimates of the observer of a foundation at every row of the runs; `calls` as for `run_observer`.

    Where runs share a clock, an observer along another run sees no moment of the test windows.
    """
    assert foundation.vessel is not None
    known = known_by_then(study, dataset)
    whole = run_observer(foundation.vessel, known, foundation.observer, calls=calls)
    kept = rows_outside_test(dataset, test)
    rest = np.flatnonzero(kept & ~dataset.frame["run"].isin(list(test.spans)).to_numpy())
    if kept.all() or not len(rest):
        return whole
    others = rows_apart_from_test(known, test)
    mine = ~others.frame["run"].isin(list(test.spans)).to_numpy()
    part = run_observer(foundation.vessel, others, foundation.observer, calls=calls).select(mine)
    for name, values in part.columns.items():
        whole.columns[name][rest] = values
    return whole


def rows_outside_test(dataset: Dataset, test: Windows) -> NDArray[np.bool_]:
    """Rows (N,) that share no moment with the test windows; all, where every run has its clock."""
    return rows_outside_spans(dataset, test.spans.values() if test.shared_clock else ())


def rows_apart_from_test(dataset: Dataset, test: Windows) -> Dataset:
    """The dataset without the moments that the test windows see, broken there: on a shared clock runs may overlap."""
    return keep_rows(dataset, rows_outside_test(dataset, test))


def chosen_observer(study: Study, foundation: Foundation, dataset: Dataset, windows: Windows) -> Observer:
    """Settings of the observer of a foundation with which its physics alone predicts these windows best.

    dataset : the runs of the windows.
    """
    vessel = foundation.vessel
    assert vessel is not None
    hidden = window_memory(vessel, dataset, windows)

    def paths(observer: Observer, columns: Mapping[str, Array]) -> Array:
        instants = windows.instants(known=study.prediction.known, hidden=hidden, estimates=columns)
        return physics_of(study, vessel, observer).paths(instants)

    return tune_observer(vessel, known_by_then(study, dataset), windows, paths, foundation.observer)[0]


def instants_of(
    study: Study, vessel: Vessel | None, dataset: Dataset, windows: Windows, estimates: Estimates | None = None
) -> Instants:
    """Instants of a study at each window, with the states of the actuators and of the observer."""
    hidden = None if vessel is None else window_memory(vessel, dataset, windows)
    known = study.prediction.known
    return windows.instants(known=known, hidden=hidden, estimates=at_instants(dataset, windows, estimates))


def at_instants(dataset: Dataset, windows: Windows, estimates: Estimates | None) -> dict[str, Array]:
    """Estimates of an observer at the instants of windows, `observer.u`, ... -> (S,); none without an observer."""
    if estimates is None:
        return {}
    columns = estimates_at_windows(dataset, estimates, windows)
    return {name: columns[name] for name in estimates.columns}


def _one_round(
    study: Study,
    dataset: Dataset,
    parts: Sequence[Windows],
    foundations: Sequence[Foundation],
    device: str,
    known: dict[Alike, list[Instants]],
) -> Iterator[FoundationPrediction]:
    """What each foundation predicts.

    Foundations of one structure are one rollout. known : instants of earlier rounds, to which those of this are added.
    """
    alike: dict[Alike, list[tuple[Foundation, Vessel]]] = {}
    for foundation in foundations:
        vessel = foundation.vessel
        if vessel is None:  # a simulator is asked for one member at a time
            yield predict_foundation(study, dataset, parts, foundation, device)
            continue
        lags = (f"{path} {value}" for path, value in vessel.parameters.items() if ".actuator." in path)
        alike.setdefault((vessel.structure, *lags), []).append((foundation, vessel))
    for key, group in alike.items():
        vessel = group[0][1]
        if key not in known:
            known[key] = [instants_of(study, vessel, dataset, windows) for windows in parts]
        parameters = np.array([one.variant.parameters for one, _ in group if one.variant is not None])
        physics = physics_of(study, vessel)
        pool, test = (physics.variant_paths(instants, parameters, device) for instants in known[key])
        for place, (foundation, _) in enumerate(group):
            paths = pool[0][:, place], test[0][:, place]
            yield FoundationPrediction(foundation, *paths, pool[1][place], test[1][place])


def predict_foundation(
    study: Study, dataset: Dataset, parts: Sequence[Windows], foundation: Foundation, device: str, calls: int = 1
) -> FoundationPrediction:
    """What one foundation predicts on windows of training and of the test; `calls` as for `run_observer`."""
    vessel, physics = foundation.vessel, physics_of(study, foundation.source, foundation.observer)
    estimates = estimates_of(study, foundation, dataset, parts[1], calls) if foundation.observer is not None else None
    pool, test = (
        physics.variant_paths(instants_of(study, vessel, dataset, windows, estimates), None, device)
        for windows in parts
    )
    return FoundationPrediction(foundation, pool[0][:, 0], test[0][:, 0], pool[1][0], test[1][0], estimates)


def _redraw(foundation: Foundation, family: Family, words: str, file: str, notes: list[str]) -> Foundation:
    """The member drawn again with the next counter, noted after `words`; DivergenceError where nothing can be drawn."""
    assert foundation.variant is not None
    assert foundation.base is not None
    counter = foundation.variant.counter + 1
    if counter > MOST_REDRAWS or not any(block.drawn for block in family.perturb):
        tries = f" after {MOST_REDRAWS} redraws" if counter > MOST_REDRAWS else ""
        remedy = "take a smaller [prediction] step, rk4, or narrower factors"
        raise DivergenceError(f"{words}{tries}: {remedy}", path=f"family.{foundation.family}")
    notes.append(f"{words}: redrawn, counter {counter}")
    return replace(foundation, variant=draw_variant(family, foundation.member, foundation.base, counter, file))


def not_measured(vessel: Vessel, windows: Windows) -> list[str]:
    """A sentence on what a vessel feels and the windows do not hold; none where they hold all."""
    missing = missing_columns(vessel, windows.columns)
    return [f"{vessel.name}: {', '.join(missing)} not measured, assumed 0"] if missing else []


def window_memory(vessel: Vessel, dataset: Dataset, windows: Windows) -> dict[str, Array] | None:
    """Hidden actuator states (S,) at the start of each window, modelled from the earlier orders; None if none."""
    if not vessel_dynamics(vessel).memory:
        return None
    tracks: dict[str, list[tuple[Array, dict[str, Array]]]] = {}
    spans = windows.spans
    for run, columns in stretch_columns(dataset):
        if run in spans:
            states = memory_along(vessel, {name: columns[name] for name in dataset.commands}, columns["t"])
            assert states is not None
            tracks.setdefault(run, []).append((columns["t"], states))
    result = {name: np.full(len(windows), np.nan) for name in next(iter(tracks.values()))[0][1]}
    for run in spans:
        mask = windows.run == run
        for t, states in tracks[run]:
            slack = clock_slack(t)
            inside = mask & (windows.t >= t[0] - slack) & (windows.t <= t[-1] + slack)
            for name, values in states.items():
                result[name][inside] = np.interp(windows.t[inside], t, values)
    return result


def states_along(vessel: Vessel, commands: Sequence[str], rows: pd.DataFrame) -> dict[str, Array] | None:
    """Hidden actuator states (n,) along one unbroken stretch of a run, modelled from its orders; None if none."""
    return memory_along(vessel, {name: rows[name].to_numpy() for name in commands}, rows["t"].to_numpy())


def regression_paths(prepared: PreparedStudy, batches: Iterable[Batch]) -> tuple[dict[str, Array], dict[str, float]]:
    """Paths (T, S, 2) [m] on the test windows by `Regression` on the runs of each batch, by its key, and losses [m^2].

    A batch whose runs do not suffice for one is left out.
    """
    study, paths, losses, method = prepared.study, dict[str, Array](), dict[str, float](), Regression()
    physics, known = physics_of(study, None), study.prediction.known
    test = prepared.test.instants(known=known)
    for batch in batches:
        windows = prepared.pool.select(np.isin(prepared.pool.run, prepared.runs(batch)))
        cases = {batch.key: Case(physics, np.zeros_like(windows.future))}
        with suppress(DataError):
            folds = prepared.folds(batch, windows, method.validation)
            fitted = method.fit(Task(cases, windows, folds, prepared.commands, known, batch.seed))[batch.key]
            if fitted.corrector is not None:
                paths[batch.key] = fitted.corrector.predict(physics, test, np.empty(0))
                losses[batch.key] = best_trials(fitted.trials)[0]["value"]
    return paths, losses


def foundation_record(foundation: Foundation) -> dict[str, Any]:
    """A foundation as plain data: what it is, where it comes from, its factors."""
    variant = foundation.variant
    row: dict[str, Any] = {
        "foundation": foundation.name,
        "family": foundation.family,
        "member": foundation.member,
        "description": foundation.description,
    }
    if variant is not None:
        row |= {"base": variant.base, "base_digest": variant.base_digest, "counter": variant.counter}
        row |= {"seed": variant.seed, "factors": dict(variant.factors), "values": dict(variant.values)}
    return row


def kinds_of_runs(dataset: Dataset, runs: Container[str] | None = None) -> dict[str, str]:
    """Run -> kind of manoeuvre: as the mapping says, else as the words in its name say, else by orders and motion.

    runs : those wanted; all by default.
    """
    declared = dataset.metadata.get("manoeuvres", {})
    return {
        run: declared.get(run) or kind_in_name(run) or run_kind(longest_piece(parts))
        for run, parts in stretches_by_run(dataset).items()
        if runs is None or run in runs
    }


def longest_piece(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """The longest of the unbroken pieces of a run."""
    return max(parts, key=lambda part: float(part["t"].iloc[-1] - part["t"].iloc[0]))
