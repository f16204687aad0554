"""Write a study file for a vessel and its runs: sensible choices, each with its reason, to be read and changed."""

from __future__ import annotations

import os
import re
import textwrap
import tomllib
import unicodedata
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from tomlkit.items import Table

from shipid import document as documents
from shipid.data.dataset import STANDARD_DEVIATIONS, Dataset, read_dataset
from shipid.data.held import warn_of_constant_commands
from shipid.data.windows import cut_windows
from shipid.errors import DataError, DivergenceError, DocumentError, ShipidError
from shipid.hybrid.physics import check_columns, missing_columns
from shipid.physics.signals import SIGNALS, is_shaft, is_steering, signal_of
from shipid.simulation.approach import Controls, vessel_service_speed
from shipid.simulation.manoeuvre import order_keys
from shipid.simulation.standard import shaft_speed
from shipid.study.declared import NO_MODEL
from shipid.study.first_look import Look, first_look
from shipid.study.plan import Plan, build_plan
from shipid.study.prepare import all_windows, obtain_runs, over_gaps, partition, prepare
from shipid.study.survey import Survey, separation_of_sources, survey_dataset, typical_runs
from shipid.units import GRAVITY, RPM, plural_word
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import derivative_order
from shipid.vessel.schema import SHARED, term_blocks

INACCURATE = "inaccurate"
LEAST_AMOUNT = 2  # the smallest amount of data of a new study: one run trains too, if it is long enough to be parted
MOST_AMOUNTS, MOST_STUDY_WINDOWS = 6, 20000
# Ship lengths: the paper's experiments look 2.3 (15 s at full scale) and 2.4 (30 s, simulated) ahead.
LENGTHS_AHEAD = 2.5
WIND_SPEED, WIND_LENGTH = 6.0, 28.9  # m/s, m: up to a moderate breeze on R/V Gunnerus, as in the bundled studies
SHARE_OF_RUN = 1 / 3  # of the median run that the horizon may take
STEP_PARTS = (1, 2, 4, 8)  # of the step: a small craft is stiff in yaw
STEPS_AHEAD, STEPS_AHEAD_OF_LOG, LONGEST_STEP = (
    15,
    30,
    2.0,
)  # steps ahead at least, of constant and of recorded orders; s
SCATTER_OF_POSITIONS = ((1.2, 0.001), (2**0.75, 0.01))
"""Positions scatter whose distance to the integrated velocities grows by less than this factor in twice the time, and
is above this share of the way: jitter grows by 1, scatter that adds up by sqrt(2), a wrong speed by 2.

Jitter is a floor of every error; what adds up may be noise of the velocities, unless it is large. Shares of the way: a
towing carriage 1e-4, jitter of 0.3 m on a ship of 30 m 0.008, GPS of some metres 0.09 (`test_recorded_sets`).
"""
RUNS_FOR_FOLDS, PROPOSED_FOLDS = 6, 3
MANOEUVRES, TEST_MANOEUVRES, INSTANTS_A_MANOEUVRE = 60, 10, 50  # of a simulated study
PAST_IN_WAVE_TIMES, LAGS_OF_MEMORY, LEAST_PAST_STEPS = (
    11.6,
    (0.1, 0.2, 0.4, 0.5, 1.0),
    8,
)  # sqrt(L / g): 20 s of a ship of 29 m; shares; steps
HELM_DEG, STEPS_A_LENGTH = 35.0, 150  # the helm of a turning circle (MSC.137(76)); of the truth
STEERING_DERIVATIVES = (
    "N_ur",
    "Y_ur",
    "N_uv",
    "N_r",
    "Y_r",
    "N_v",
)  # linear in v, r at a speed: products with u or scaled by U
HIGHER_ORDER_DAMPING = "hull.*[order >= 3]"
DRAG_COEFFICIENTS = (
    "C_d",
    *(f"R_{power}" for power in range(5)),
)  # coefficients of the hull whose names are no formula
INERTIA_PATHS = ("inertia.m", "inertia.I_z", "added_mass.X_udot", "added_mass.Y_vdot", "added_mass.N_rdot")


@dataclass(frozen=True)
class Choice:
    """A value of the study and the reason for it, one sentence or more."""

    path: str
    value: Any
    why: str = ""


@dataclass(frozen=True)
class Draft:
    """A study that has been checked to run.

    text : TOML with the reasons as comments.
    warnings : what is wrong with the log or the vessels, as far as it shows, one sentence each.
    looks : how each vessel and the runs that do not test agree, by its name in the study.
    """

    text: str
    choices: tuple[Choice, ...]
    plan: Plan
    warnings: tuple[str, ...] = ()
    looks: Mapping[str, Look] = field(default_factory=dict)


def draft_study(vessels: Sequence[str], data: Path | None, out: Path) -> Draft:
    """Draft a study of vessels on recorded runs, or on simulated ones where `data` is None, to be written to `out`.

    Parameters
    ----------
    vessels : bundled names or paths; the first one is made inaccurate, too, and gives the ship length.

    Raises
    ------
    ShipidError : a vessel or dataset that cannot be read or do not fit each other, or too few runs.
    """
    twice = next((name for name in vessels if list(vessels).count(name) > 1), None)
    if twice is not None:
        raise ShipidError(f"{twice!r} is named twice: name each vessel once", path="--vessel")
    loaded = {_vessel_key(name, out): load_vessel(name) for name in vessels}
    if not loaded:
        raise ShipidError("name a vessel: a bundled name (see `shipid vessel list`) or a path", path="--vessel")
    if data is None:
        return _simulated_study(loaded, out)
    dataset = read_dataset(data)
    for vessel in loaded.values():
        check_columns(vessel, dataset.frame.columns, str(data))
    return _recorded_study(loaded, dataset, data, out)


def horizon_of(length: float | None, speed: float, durations: Sequence[float]) -> tuple[float, str]:
    """Horizon [s], and why: some ship lengths at the usual speed, but a part of the median run."""
    longest = float(np.median(durations)) * SHARE_OF_RUN
    if length is None or speed <= 0:
        why = "a third of the median run: without particulars.L_pp and speed there is no L/U"
        return _round_to_two_digits(longest), why
    wanted = LENGTHS_AHEAD * length / speed
    chosen = _round_to_two_digits(min(wanted, longest))
    why = (
        f"{chosen:g} s, in which the ship runs {chosen * speed / length:.2g} ship lengths at {speed:.3g} m/s "
        f"(L/U = {length / speed:.3g} s): over about {LENGTHS_AHEAD:g} its dynamics decide, later the next orders"
    )
    short = f"; no longer than a third of the median run, {3 * longest:.3g} s" if wanted > longest else ""
    return chosen, why + short


def proposed_horizon(vessel: Vessel, dataset: Dataset) -> tuple[float, float]:
    """Horizon and step [s] that a new study of a vessel and its runs would have."""
    horizon, step, _ = _horizon_and_step(vessel, survey_dataset(dataset))
    return horizon, step


def _horizon_and_step(vessel: Vessel, seen: Survey) -> tuple[float, float, str]:
    """Horizon in whole steps, step [s], and why the horizon."""
    horizon, why = horizon_of(vessel.length, seen.speed, seen.runs["duration"].tolist())
    step = step_of(horizon, seen.step)
    return max(round(horizon / step), 2) * step, step, why


def step_of(horizon: float, log_step: float) -> float:
    """Step of the predictor [s]: a round number, no shorter than the log's; without a log, 0, orders are constant.

    At most a thirtieth of the horizon, a twelfth of the time in which the ship runs its length: recorded orders change
    within it. Where rows are further apart than half of the horizon, the step is their distance, and two steps are the
    horizon.
    """
    most = min(horizon / (STEPS_AHEAD_OF_LOG if log_step else STEPS_AHEAD), LONGEST_STEP)
    return max(min(_round_number_below(most), horizon / 2), log_step)


def amounts_of_data(total: int) -> list[int]:
    """Amounts of data from the least to all runs, by equal factors of at least two."""
    factor = max(2.0, (total / LEAST_AMOUNT) ** (1 / (MOST_AMOUNTS - 1)))
    amounts = [round(LEAST_AMOUNT * factor**power) for power in range(MOST_AMOUNTS)]
    return [amount for amount in amounts if amount < 0.8 * total] + [total]


def _recorded_study(vessels: Mapping[str, Vessel], dataset: Dataset, data: Path, out: Path) -> Draft:
    """A study of all vessels on recorded runs; the first one is made inaccurate, too (method, section 5)."""
    seen, first = survey_dataset(dataset), next(iter(vessels.values()))
    ahead, step, why = _horizon_and_step(first, seen)
    usable = _runs_that_hold(dataset, ahead, step, 0.0)
    if len(usable) <= LEAST_AMOUNT:
        few = f"{len(usable)} {plural_word(len(usable), 'run')} of {ahead:g} s or more"
        remedy = "cut the log into its manoeuvres, [[segment]]s of the mapping (`shipid data segment` proposes them)"
        raise DataError(f"{few}, a study needs {LEAST_AMOUNT + 1}, one of them for the test: {remedy}", file=data)
    short = [run for run in seen.runs.index if run not in usable]
    method = _proposed_method(first.length, step, float(seen.runs.loc[usable, "duration"].median()) - ahead)
    held = _runs_that_hold(dataset, ahead, step, _past_of_method(method))
    if len(held) > LEAST_AMOUNT:
        usable = held
    else:
        method = _proposed_method(first.length, step, 0.0)
    seen = Survey(seen.runs.loc[usable], seen.step, seen.failed)
    tests = typical_runs(seen)
    others = [name for name in usable if name not in tests]
    true_path = _true_path(dataset, ahead, seen.speed)
    interval = max(step, seen.step, _round_number_below(2.5 * float(seen.runs["duration"].sum()) / MOST_STUDY_WINDOWS))
    why += f"; too short for it: {', '.join(short)}" if short else ""
    fixed = [
        Choice("question", f"How well can {first.name} be predicted {ahead:g} s ahead, with how many runs?"),
        Choice("description", _log_in_words(seen, dataset), "what the log holds"),
        Choice("data.dataset", _path_from_study(str(data), out), _inputs_in_words(vessels, dataset)),
        true_path,
        Choice("split.test", tests, _why_test(seen, tests)),
        Choice("prediction.ahead", float(f"{ahead:.9g}"), why),
        Choice("prediction.interval", interval, "s between instants of prediction"),
    ]
    every = Choice("prediction.step", step, f"s; rows of the log come every {seen.step:.3g} s")
    families = _families_of_vessels(vessels, dataset.runs)
    least = [Choice("split.folds", 1), Choice("grid.N_D", [LEAST_AMOUNT]), method, Choice("family", families[:1])]
    plan = _build_draft_plan([*fixed, every, *least], out, vessels)
    amounts = amounts_of_data(len(partition(plan, dataset)[0].spans))
    fixed += [*_folds_and_grid(amounts), method]
    warnings = _warn_of_failed_checks(seen, data)
    warnings += [*over_gaps(dataset, all_windows(plan, dataset)), *warn_of_constant_commands(dataset, usable)]
    warnings += _warn_of_identified_tests(families, tests)
    try:
        choices, plan = _first_that_runs(fixed, every, families, out, vessels, dataset)
    except DivergenceError as error:
        if not warnings:
            raise
        raise DivergenceError(f"{error.message}; but first: {warnings[0]}", file=error.file, path=error.path) from None
    how: dict[str, Any] = {"ahead": ahead, "step": plan.study.prediction.step, "path": true_path.value}
    looks = {name: first_look(vessel, dataset, others, **how) for name, vessel in vessels.items()}
    warnings += [look.sentence for look in looks.values() if look.wrong]
    return Draft(_study_text(choices, warnings), tuple(choices), plan, tuple(warnings), looks)


def _warn_of_identified_tests(families: Sequence[Mapping[str, Any]], tests: Sequence[str]) -> Iterator[str]:
    """A warning for each family as it is whose vessel was identified from test runs."""
    for family in families:
        runs = [run for run in family.get("seen", []) if run in tests]
        if runs and family["name"] != INACCURATE:
            words = f"{family['name']} was identified from {', '.join(runs)}, which now tests it"
            yield f"{words}: choose other test runs, or let the study identify ([family.identify])"


def _warn_of_failed_checks(seen: Survey, data: Path) -> list[str]:
    """One warning that counts the failed checks of a log and shows the first; none where all passed."""
    if seen.failed.empty:
        return []
    counts = Counter(seen.failed["check"])
    first = seen.failed.iloc[0]
    words = ", ".join(f"{name} ({count} {plural_word(count, 'run')})" for name, count in counts.items())
    return [f"`shipid data check {data}` fails: {words}. In {first['run']!r} {first['sentence']}"]


def _runs_that_hold(dataset: Dataset, ahead: float, step: float, past: float) -> list[str]:
    """Runs that hold the horizon and the past [s] before it."""
    try:
        windows = cut_windows(dataset, horizon=round(ahead / step), step=step, interval=step, past=round(past / step))
    except DataError:
        return []
    return [run for run in dataset.runs if run in windows.spans]


def _first_that_runs(
    fixed: Sequence[Choice],
    step: Choice,
    families: list[dict[str, Any]],
    out: Path,
    vessels: Mapping[str, Vessel],
    dataset: Dataset | None = None,
) -> tuple[list[Choice], Plan]:
    """The study with the longest step at which it runs, without the inaccurate family where that one diverges."""
    without = [family for family in families if family["name"] != INACCURATE]
    for parts, chosen in product(STEP_PARTS, [families] if without == families else [families, without]):
        shorter = f"; {parts} times as long diverges" if parts > 1 else ""
        choices = [
            *fixed,
            Choice(step.path, step.value / parts, step.why + shorter),
            Choice("prediction.integrator", "rk4", "euler, the paper's, takes a quarter of the time; steps show then"),
            *_claims_of_families([family["name"] for family in chosen]),
            Choice("family", chosen, "models, each improved by data; `none` is no physics, beside constant u, v, r"),
        ]
        plan = _build_draft_plan(choices, out, vessels)
        try:
            _check_that_runs(plan, obtain_runs(plan) if dataset is None else dataset)
        except DivergenceError as error:
            last = error
        else:
            return choices, plan
    raise last


def _check_that_runs(plan: Plan, dataset: Dataset) -> None:
    """Do all that a run of the plan does but the training."""
    prepared = prepare(plan, dataset)
    for batch in plan.batches:
        windows = prepared.pool.select(np.isin(prepared.pool.run, prepared.runs(batch)))
        for way in plan.methods:
            prepared.folds(batch, windows, way.method.validation)


def _build_draft_plan(choices: Sequence[Choice], out: Path, vessels: Mapping[str, Vessel]) -> Plan:
    return build_plan(tomllib.loads(_study_text(choices)), out, vessels)


def _log_in_words(seen: Survey, dataset: Dataset) -> str:
    """How many runs of which kinds, how long and how fast."""
    runs = seen.runs
    kinds = ", ".join(f"{kind} {count}" for kind, count in Counter(runs["kind"]).most_common())
    times, speeds = (f"{runs[name].min():.3g} to {runs[name].max():.3g}" for name in ("duration", "speed"))
    return f"{len(runs)} runs ({kinds}) of {times} s at {speeds} m/s, {len(dataset.frame)} rows"


def _inputs_in_words(vessels: Mapping[str, Vessel], dataset: Dataset) -> str:
    """Commands and wind of the log, what each vessel misses there, and which velocities are estimates."""
    columns = [str(name) for name in dataset.frame]
    parts = [f"commands {', '.join(dataset.commands) or 'none'}"]
    parts += ["wind is measured" if "V_w" in columns else "wind is not measured and is no input"]
    lacking = {key: ", ".join(missing_columns(vessel, columns)) for key, vessel in vessels.items()}
    parts += [f"{key} takes {names} as 0" for key, names in lacking.items() if names]
    estimated = ", ".join(name for name, std in STANDARD_DEVIATIONS.items() if std in columns)
    return "; ".join([*parts, f"{estimated} are estimated from positions and heading"] if estimated else parts)


def _true_path(dataset: Dataset, ahead: float, speed: float) -> Choice:
    """The true path: positions, unless they scatter where the integral of the velocities does not."""
    half, whole = (separation_of_sources(dataset, lag) for lag in (ahead / 2, ahead))
    apart = f"positions and the integral of u, v, psi part by {half:.2g} m in {ahead / 2:g} s"
    apart += f", {whole:.2g} m in {ahead:g} s"
    if any(whole < growth * half and whole > share * speed * ahead for growth, share in SCATTER_OF_POSITIONS):
        return Choice("data.path", "velocity", f"{apart} (RMS): it grows as positions that scatter do")
    return Choice("data.path", "position", f"{apart} (RMS): positions do not scatter")


def _why_test(seen: Survey, tests: Sequence[str]) -> str:
    """Each test run with its kind, speed and duration."""
    rows = seen.runs.loc[list(tests)].to_dict("index").items()
    words = [f"{name!r} ({run['kind']}, {run['speed']:.2g} m/s, {run['duration']:.0f} s)" for name, run in rows]
    return f"in the middle of their kind: {', '.join(words)}. Never look at them while you choose models"


def _folds_and_grid(amounts: list[int]) -> Iterator[Choice]:
    total = amounts[-1]
    if total < RUNS_FOR_FOLDS:
        yield Choice("split.folds", 1, f"{total} runs train: each validates in turn")
    else:
        yield Choice("split.folds", PROPOSED_FOLDS, f"{total} runs: two thirds train, one third validates, in turn")
    yield Choice("grid.N_D", amounts, "runs for training and validation: from the fewest to all, the learning curve")
    yield Choice("grid.seeds", [0, 1, 2], "three draws of which runs come first: with fewer there is no range")


def _claims_of_families(families: Sequence[str]) -> Iterator[Choice]:
    """Which family each finding speaks of; none where there is nothing to compare."""
    if INACCURATE in families:
        yield Choice("claims.accurate", families[0], "asks for verdicts on the findings R1-R4 of experiment 2")
        yield Choice("claims.inaccurate", INACCURATE)
    elif {"moderate", "high"} <= set(families):
        yield Choice("claims.moderate", "moderate", "asks for verdicts on the findings S1-S7 of experiment 1")
        yield Choice("claims.high", "high")
        yield Choice("claims.nominal", "nominal")


def _families_of_vessels(vessels: Mapping[str, Vessel], runs: Sequence[str]) -> list[dict[str, Any]]:
    """Every vessel as it is, with the runs that it was identified from; the first made inaccurate, too."""
    families: list[dict[str, Any]] = []
    for named, vessel in vessels.items():
        known = documents.read_document(vessel.file).get("provenance", {}).get("runs", [])
        seen = [run for run in runs if run in known]
        name = _family_name(vessel.key, [family["name"] for family in families])
        family = {"name": name, "description": f"{vessel.name}, as it is", "base": named}
        families.append({**family, "seen": seen} if seen else family)
    if blocks := _inaccurate_blocks(next(iter(vessels.values()))):
        words = f"{families[0]['name']} made wrong on purpose: what does it cost to know the ship less well?"
        families.append({**families[0], "name": INACCURATE, "description": words, "perturb": blocks})
    return families


def _family_name(key: str, taken: Sequence[str]) -> str:
    """The name of a vessel's file in letters of English, unlike all that are taken: no two may be one file."""
    ascii_key = unicodedata.normalize("NFKD", key).encode("ascii", "ignore").decode()
    name = re.sub(r"[^A-Za-z0-9_.+-]+", "-", ascii_key).strip("-") or "ship"
    name = name if name[0].isalpha() else f"ship-{name}"
    while name.lower() in {NO_MODEL, INACCURATE, *map(str.lower, taken)}:
        name += "-own"
    return name


def _inaccurate_blocks(vessel: Vessel) -> list[dict[str, Any]]:
    """Higher-order damping removed, steering derivatives times 0.6 (method, section 5), as far as there are any."""
    hull = [path for path in vessel.parameters if path.startswith("hull.")]
    steering = [path for path in hull if path.rpartition(".")[2] in STEERING_DERIVATIVES]
    blocks: list[dict[str, Any]] = []
    if any((derivative_order(path) or 0) >= 3 for path in hull):
        blocks.append({"remove": [HIGHER_ORDER_DAMPING]})
    if steering or (hull and not blocks):
        blocks.append({"parameters": steering or _hull_coefficients(hull), "factor": 0.6})
    return blocks


def _simulated_study(vessels: Mapping[str, Vessel], out: Path) -> Draft:
    """A study of degraded models of the first vessel, which makes the truth (method, section 4)."""
    if len(vessels) > 1:
        message = "one vessel makes the truth of a simulated study: give one, or --data with recorded runs"
        raise ShipidError(message, path="--vessel")
    (named, vessel), *_ = vessels.items()
    length = vessel.length
    if length is None:
        raise ShipidError("particulars.L_pp is missing: the manoeuvres are timed in ship lengths", file=vessel.file)
    service, controls = vessel_service_speed(vessel), Controls(vessel)
    if not controls.differential:
        _ = controls.helm  # DocumentError where nothing turns the ship
    try:
        rpm = shaft_speed(controls, service) / RPM
    except ShipidError as error:
        place = "particulars.U_0" if error.path == "--speed" else error.path  # here no option gives the speed
        raise DocumentError(error.message, file=vessel.file, path=place) from None
    horizon, why = horizon_of(length, 0.75 * service, [np.inf])
    step = step_of(horizon, 0.0)
    ahead = round(horizon / step) * step
    amounts = amounts_of_data(MANOEUVRES - TEST_MANOEUVRES)
    method = _proposed_method(length, step, np.inf)
    fixed = [
        Choice(
            "question",
            f"How good must a model of {vessel.name} be, and how many manoeuvres, to predict {ahead:g} s?",
        ),
        Choice("description", f"simulated: {vessel.name} as it is makes the truth, and degraded models predict it"),
        *_truth_choices(named, controls, service, rpm, ahead, step, _past_of_method(method)),
        Choice("split.test", TEST_MANOEUVRES, f"manoeuvres, drawn: a sixth of {MANOEUVRES}"),
        Choice("split.folds", 1, "with the method `path-drawn` every run validates in turn"),
        Choice("prediction.ahead", float(f"{ahead:.9g}"), why),
        Choice("prediction.interval", step, "s between instants of prediction"),
        Choice("prediction.samples", INSTANTS_A_MANOEUVRE, "instants a manoeuvre"),
        Choice("grid.N_D", amounts, f"from the fewest to all {amounts[-1]} that are not for the test"),
        Choice("grid.seeds", [0], "take [0, 1, 2, 3, 4] for verdicts: findings about scatter need five"),
        method,
    ]
    first = Choice("prediction.step", step, "s; the truth is stepped more finely")
    choices, plan = _first_that_runs(fixed, first, _degraded_families(named, vessel), out, vessels)
    return Draft(_study_text(choices), tuple(choices), plan)


def _proposed_method(length: float | None, step: float, spare: float) -> Choice:
    """Compensation of the path with a memory, which validation may refuse; without one where runs are too short.

    spare : time [s] of the median run beyond the horizon; a third of it may be past.
    """
    plain = [{"name": "drawn", "kind": "path-drawn"}]
    past = PAST_IN_WAVE_TIMES * float(np.sqrt((length or 0.0) / GRAVITY))
    if not length or past < LEAST_PAST_STEPS * step:
        return Choice("method", plain, "no memory: the step is too long for the past of a ship of this length")
    if past > spare / 3:
        why = f"a third of what the median run holds beyond the horizon is {spare / 3:.3g} s"
        return Choice("method", plain, f"no memory: of {past:.3g} s, {why}")
    lags = [
        float(f"{lag:.6g}") for lag in sorted({step * max(round(share * past / step), 1) for share in LAGS_OF_MEMORY})
    ]
    memory = {"history": lags[:-2], "turned": lags[-2:], "error": [lags[-3]]}
    why = (
        f"inputs of the last {lags[-1]:g} s ({PAST_IN_WAVE_TIMES:g} sqrt(L / g)): what ship and orders did, and "
        "what the physics got wrong; validation chooses how much of it is taken. The first instants of a run are left "
        "out: they have no past"
    )
    return Choice("method", [{"name": "memory", "kind": "path-drawn", "choose": True, "memory": memory}], why)


def _past_of_method(method: Choice) -> float:
    """Longest past [s] that a method of `_proposed_method` reads; 0 without a memory."""
    return float(max(method.value[0].get("memory", {}).get("turned", [0.0])))


def _truth_choices(
    named: str, controls: Controls, service: float, rpm: float, ahead: float, step: float, past: float
) -> Iterator[Choice]:
    """The manoeuvres that the vessel performs as the truth, and their weather."""
    vessel = controls.vessel
    length = vessel.length or 0.0
    fine = min(_round_number_below(length / service / STEPS_A_LENGTH), step / 10)
    waves = any(key.startswith("waves.") for _, key, _ in term_blocks(vessel.document))
    calm = "in calm water: a table [truth.waves] with H_s and T_p draws a sea for the [waves] of the vessel"
    yield Choice("truth.vessel", named, calm if waves else "")
    yield Choice(
        "truth.manoeuvres", MANOEUVRES, f"{MANOEUVRES - TEST_MANOEUVRES} for training, {TEST_MANOEUVRES} for the test"
    )
    if past:
        yield Choice("truth.run_up", past, "s before the first instant of prediction: the past of the memory")
    yield Choice(
        "truth.duration",
        float(f"{ahead + INSTANTS_A_MANOEUVRE * step:.6g}"),
        f"s: {INSTANTS_A_MANOEUVRE} instants and the horizon",
    )
    yield Choice("truth.step", fine, f"s: the ship takes {length / service:.3g} s for its length")
    yield Choice("truth.interval", step, "s between logged rows")
    if "V_w" in vessel_dynamics(vessel).environment:
        yield wind_for_length(length)
    yield _turning_orders(controls, service, rpm)


def wind_for_length(length: float) -> Choice:
    """Wind for a ship of a length [m]: WIND; below WIND_LENGTH times sqrt(L / WIND_LENGTH), by Froude's rule."""
    speed = float(f"{WIND_SPEED * min(length / WIND_LENGTH, 1.0) ** 0.5:.2g}")
    why = f"m/s, from anywhere: at most {WIND_SPEED:g} m/s, on a ship below {WIND_LENGTH:g} m less by Froude's rule"
    return Choice("truth.wind_speed", [0.0, speed], why)


def _turning_orders(controls: Controls, service: float, rpm: float) -> Choice:
    """Turns with constant orders; each shaft, or angle, has its own where they steer by their difference.

    A shaft that does not drive the ship ahead, such as that of a tunnel thruster, rests.
    """
    low, high = float(f"{rpm / 2:.3g}"), float(f"{rpm:.3g}")
    drives, helm = controls.effects
    signs = {(signal_of(name), sign) for name, sign in helm.items()}
    apart = {signal for signal, sign in signs if (signal, -sign) in signs}  # at both ends: one angle drives it aside
    orders: dict[str, Any] = {}
    resting = []
    for name in controls.commands:
        single, common = order_keys(name)
        if is_shaft(name) and name not in drives:
            orders[single] = 0.0
            resting.append(name)
        elif is_shaft(name):
            orders[single if controls.differential else common] = [0.0 if controls.differential else low, high]
        else:
            row = SIGNALS[signal_of(name)]
            usual = [value / row.factor for value in row.usual]
            key = single if signal_of(name) in apart else common
            orders[key] = [-HELM_DEG, HELM_DEG] if is_steering(name) else usual
    speeds = [float(f"{service / 2:.3g}"), float(f"{service:.3g}")]
    why = f"constant orders: up to {high:g} rpm, which hold {service:.3g} m/s in calm water"
    why += ", each shaft by itself: their difference steers" if controls.differential else ", and hard over either way"
    why += ", each angle by itself: units at both ends steer by their difference" if apart else ""
    why += f"; what does not drive the ship ahead rests: {', '.join(resting)}" if resting else ""
    return Choice("truth.manoeuvre", [{"kind": "turning", **orders, "start_speed": speeds}], why)


def _degraded_families(named: str, vessel: Vessel) -> list[dict[str, Any]]:
    """Nominal, moderate and high: the families of experiment 1 (method, section 4), as far as the vessel has them."""
    hull = [path for path in vessel.parameters if path.startswith("hull.")]
    drag = [path for path in hull if path.rpartition(".")[2] in DRAG_COEFFICIENTS]
    damping = (
        ["hull.*[order >= 1]", *drag] if any(derivative_order(path) for path in hull) else _hull_coefficients(hull)
    )
    heavy = [path for path in INERTIA_PATHS if path in vessel.parameters]
    if not damping:
        raise ShipidError("has no [hull] numbers to degrade: declare families by hand", file=vessel.file)
    return [
        {
            "name": "nominal",
            "description": "the numbers of the truth: the error that steps and held orders leave",
            "base": named,
        },
        {
            "name": "moderate",
            "description": "each hull coefficient times a separate factor in 0.4-1.6",
            "base": named,
            "members": 3,
            "seed": 1,
            "perturb": [{"parameters": damping, "factor": [0.4, 1.6]}],
        },
        {
            "name": "high",
            "description": "as moderate, and mass, yaw inertia and added mass times factors in 0.6-1.4",
            "extends": "moderate",
            "members": 2,
            "seed": 2,
            "perturb": [{"parameters": heavy, "factor": [0.6, 1.4]}],
        },
    ]


def _hull_coefficients(paths: Sequence[str]) -> list[str]:
    """Paths of coefficients, without those of geometry and of the water."""
    return [path for path in paths if path.rpartition(".")[2] not in ("x_aft", "x_fwd", *SHARED)]


def _study_text(choices: Sequence[Choice], warnings: Sequence[str] = ()) -> str:
    """The study as TOML, each reason above its value."""
    document, tables = tomlkit.document(), dict[str, Table]()
    head = "Written by `shipid study new`. Above each value is its reason. Change what you know better."
    for line in (head, *(line for one in warnings for line in textwrap.wrap(f"WRONG? {one}", 110))):
        document.add(tomlkit.comment(line))
    last = ("method", "family")  # tables of tables: what follows them in the file would belong to them
    for choice in sorted(choices, key=lambda choice: choice.path in last):
        block, _, key = choice.path.rpartition(".")
        if choice.path in last or (block and block not in tables):
            document.add(tomlkit.nl())
        if block and block not in tables:
            tables[block] = tomlkit.table()
            document.add(block, tables[block])
        place: Any = tables[block] if block else document
        for line in textwrap.wrap(choice.why, 110):
            place.add(tomlkit.comment(line))
        place.add(key, choice.value)
    return tomlkit.dumps(document)


def _vessel_key(name: str, out: Path) -> str:
    """A vessel as the study names it: a bundled name as it is, a path from the study's folder."""
    return _path_from_study(name, out) if "/" in name or "\\" in name or name.endswith(".toml") else name


def _path_from_study(name: str, out: Path) -> str:
    path = Path(os.path.relpath(name, out.parent)).as_posix()
    return path if "/" in path or path.endswith((".toml", ".parquet")) else f"./{path}"


def _round_to_two_digits(value: float) -> float:
    return float(f"{value:.2g}")


def _round_number_below(value: float) -> float:
    """Greatest of 1, 2, 5 and their tens, up to a value."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(f"{max(step * decade for step in (1, 2, 5) if step * decade <= value * (1 + 1e-9)):.6g}")
