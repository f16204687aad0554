"""First looks at a dataset, and a study file for a vessel and its runs: sensible choices, each with its reason."""

from __future__ import annotations

import os
import re
import textwrap
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import reduce
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomlkit

from shipid import document as documents
from shipid.data.checks import check_dataset, way_not_travelled
from shipid.data.dataset import Dataset, read_dataset, stretches_by_run, stretches_of_runs
from shipid.data.windows import cut_windows
from shipid.errors import DataError, DivergenceError, DocumentError, ShipidError, placed_errors
from shipid.hybrid.physics import check_columns
from shipid.identification.diagnosis import NONE, Diagnosis, diagnose
from shipid.physics.signals import SIGNALS, drive_scale, is_steering, signal_of
from shipid.simulation.approach import Controls, vessel_service_speed
from shipid.simulation.manoeuvre import order_keys
from shipid.simulation.standard import shaft_speed
from shipid.study.plan import Plan, build_plan
from shipid.study.prepare import kinds_of_runs, longest_piece, obtain_runs, partition, prepare
from shipid.units import RPM, percent_text, plural_word
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import derivative_order
from shipid.vessel.schema import SHARED

LEAST_OF_A_KIND = 3  # runs of a kind from which one may be set aside: two are left that train


@dataclass(frozen=True)
class Survey:
    """Measures of the runs of a dataset, from which `study new` makes its choices.

    runs : a row per run, by name: `duration` [s] of its longest unbroken piece, `kind` (see `kinds_of_runs`), `speed`
        [m/s], `rate` [rad/s] (RMS of r), `helm` [rad] (spread of the angles), `whole` (unbroken).
    step : usual time between rows [s].
    failed : rows of `check_dataset` that are not ok.
    """

    runs: pd.DataFrame
    step: float
    failed: pd.DataFrame

    @property
    def speed(self) -> float:
        """Median of the runs' mean speeds [m/s]."""
        return float(self.runs["speed"].median())


def survey_dataset(dataset: Dataset) -> Survey:
    """Look at every run of a dataset: how long, how fast, what manoeuvre, in which order."""
    by_run, kinds, checks = stretches_by_run(dataset), kinds_of_runs(dataset), check_dataset(dataset)
    angles = [name for name in dataset.commands if is_steering(name)]
    runs = {}
    for run, parts in by_run.items():
        rows = longest_piece(parts)
        runs[run] = {
            "duration": float(np.ptp(rows["t"])),
            "kind": kinds[run],
            "speed": float(np.hypot(rows["u"], rows["v"]).mean()),
            "rate": float(np.sqrt((rows["r"] ** 2).mean())),
            "helm": float(rows[angles].std(ddof=0).mean()) if angles else 0.0,
            "whole": len(parts) == 1,
        }
    steps = np.concatenate([np.diff(part["t"]) for parts in by_run.values() for part in parts])
    step = round(float(np.median(steps)), 6) if len(steps) else 1.0
    return Survey(pd.DataFrame(list(runs.values()), index=list(runs)), step, checks[~checks["ok"].astype(bool)])


def separation_of_sources(dataset: Dataset, lag: float) -> float:
    """RMS distance [m] by which positions and integrated velocities part within a lag [s]; 0 where no run is so long.

    Jitter of the positions does not grow with the lag, errors of the velocities do.
    """
    parted = []
    for _, rows in stretches_of_runs(dataset):
        t = rows["t"].to_numpy()
        apart = way_not_travelled(rows)
        early = t <= t[-1] - lag
        parted.append(np.interp(t[early] + lag, t, apart) - apart[early])
    every = np.abs(np.concatenate(parted))
    return float(np.sqrt(np.mean(every**2))) if len(every) else 0.0


def typical_runs(seen: Survey) -> list[str]:
    """From each kind that has three runs or more, the one in the middle; one of all where that leaves too few."""
    runs = seen.runs
    groups = [group for _, group in runs.groupby("kind", sort=False) if len(group) >= LEAST_OF_A_KIND]
    many = len(runs) > 2 * LEAST_OF_A_KIND or len(groups) == 1
    return [_middle_run(group, set(seen.failed["run"])) for group in (groups if many else []) or [runs]]


def _middle_run(runs: pd.DataFrame, failed: set[str]) -> str:
    """The run whose rank of speed, yaw rate and helm is nearest to the middle.

    Neither one that is broken, nor one that fails a check, nor the longest, where there are others.
    """
    allowed = runs
    for good in (~runs.index.isin(failed), runs["whole"], runs["duration"] < runs["duration"].max()):
        left = allowed.index.intersection(runs.index[good])
        allowed = allowed.loc[left] if len(left) else allowed
    ranks = runs[["speed", "rate", "helm"]].rank(pct=True)
    return str(((ranks - ranks.median()) ** 2).sum(axis=1)[allowed.index].idxmin())


INACCURATE = "inaccurate"
LEAST_AMOUNT = 2  # the smallest amount of data of a new study: one run trains too, if it is long enough to be parted
MOST_AMOUNTS, MOST_STUDY_WINDOWS = 6, 20000
# Ship lengths: the paper's experiments look 2.3 (15 s at full scale) and 2.4 (30 s, simulated) ahead.
LENGTHS_AHEAD = 2.5
WIND_SPEED, WIND_LENGTH = 6.0, 28.9  # m/s, m: up to a moderate breeze on R/V Gunnerus, as in the bundled studies
CURRENT_SHARE, SPEED_NOISE = 0.05, 0.005  # of the service speed
MOST_JITTER, JITTER_SHARE, COMPASS_NOISE = 0.5, 1 / 200, 0.0044  # m, of the length, rad
SHARE_OF_RUN = 1 / 3  # of the median run that the horizon may take
STEP_PARTS = (1, 2, 4, 8)  # of the step: a small craft is stiff in yaw
STEPS_AHEAD, STEPS_AHEAD_OF_LOG, LONGEST_STEP = 15, 30, 2.0  # least, of constant and of recorded orders; s
SCATTER_OF_POSITIONS = ((1.2, 0.001), (2**0.75, 0.01))
"""Positions scatter whose distance to the integrated velocities grows by less than this factor in twice the time, and
is above this share of the way: jitter grows by 1, scatter that adds up by sqrt(2), a wrong speed by 2.

Shares of the way: a towing carriage 1e-4, jitter of 0.3 m on a ship of 30 m 0.008, GPS of some metres 0.09
(`test_recorded_sets`).
"""
MANOEUVRES, TEST_MANOEUVRES, INSTANTS_A_MANOEUVRE = 60, 10, 50  # of a simulated study
PAST_LENGTHS, LEAST_PAST_STEPS = 1.5, 8  # L / U: of 0.8, 1.5, 2.5 and 11.6 sqrt(L / g) the best on four ships; steps
LAGS_OF_MEMORY = (0.1, 0.2, 0.4, 0.5, 1.0)  # shares of the past
DRAWS_OF_FEW = "few runs are drawn up to three times; finding S4 needs seeds = [0, 1, 2, 3, 4]"
HELM_DEG, STEPS_A_LENGTH = 35.0, 150  # the helm of a turning circle (MSC.137(76)); of the truth
STEERING_DERIVATIVES = ("N_ur", "Y_ur", "N_uv", "N_r", "Y_r", "N_v")  # linear in v, r at a speed
DRAG_COEFFICIENTS = ("C_d", "R_0", "R_1", "R_2", "R_3", "R_4")  # coefficients whose names are no formula
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
    warnings : failed checks of the log, notes of the study, and vessels that do not fit the log.
    diagnoses : what is wrong with each vessel and the runs that do not test, by its name in the study.
    """

    text: str
    choices: Sequence[Choice]
    plan: Plan
    warnings: Sequence[str] = ()
    diagnoses: Mapping[str, Diagnosis] = field(default_factory=dict)


def draft_study(vessels: Sequence[str], data: Path | None, out: Path) -> Draft:
    """Draft a study of vessels on recorded runs, or on simulated ones where `data` is None, to be written to `out`.

    vessels : bundled names or paths; the first one is made inaccurate, too, and gives the ship length. Without any the
        runs are studied without physics, as those of a log without commands must be.

    Raises ShipidError for a vessel or dataset that cannot be read or do not fit each other, or too few runs.
    """
    loaded = {_vessel_key(name, out): load_vessel(name) for name in vessels}
    if data is None:
        return draft_simulated(loaded, out)
    dataset = read_dataset(data)
    for vessel in loaded.values():
        check_columns(vessel, dataset.frame.columns, str(data))
    return _recorded_study(loaded, dataset, data, out)


def draft_families(vessel: str, members: int, out: Path) -> str:
    """A document of families of a vessel as TOML, to be written to `out`; each that is drawn has so many members."""
    blocks = [
        {key: members if key == "members" else value for key, value in block.items() if key != "base"}
        for block in _degraded_families("", load_vessel(vessel))
    ]
    words = f"Written by `shipid family new`. `shipid family show {out}` shows what is drawn."
    return _comment([words]) + tomlkit.dumps({"vessel": _vessel_key(vessel, out), "family": blocks})


def horizon_of(
    length: float | None, speed: float, durations: Sequence[float], lengths: float = LENGTHS_AHEAD
) -> tuple[float, str]:
    """Horizon [s], and why: some ship lengths at the usual speed, but a part of the median run."""
    longest = float(np.median(durations)) * SHARE_OF_RUN
    if length is None or speed <= 0:
        why = "a third of the median run: without particulars.L_pp and speed there is no L/U"
        return float(f"{longest:.2g}"), why
    wanted = lengths * length / speed
    chosen = float(f"{min(wanted, longest):.2g}")
    why = (
        f"{chosen:g} s, in which the ship runs {chosen * speed / length:.2g} ship lengths at {speed:.3g} m/s "
        f"(L/U = {length / speed:.3g} s): over about {lengths:g} its dynamics decide, later the next orders"
    )
    short = f"; no longer than a third of the median run, {3 * longest:.3g} s" if wanted > longest else ""
    return chosen, why + short


def proposed_horizon(vessel: Vessel | None, seen: Survey) -> tuple[float, float, str]:
    """Horizon in whole steps, step [s], and why the horizon, of a new study of a vessel and its runs."""
    durations = seen.runs["duration"].tolist()
    horizon, why = horizon_of(vessel.length if vessel else None, seen.speed, durations)
    most = STEPS_AHEAD_OF_LOG * seen.step
    if vessel is None and most < horizon:
        horizon, why = most, f"{most:g} s, {STEPS_AHEAD_OF_LOG} rows of the log: no vessel gives a length"
    step = step_of(horizon, seen.step)
    return max(round(horizon / step), 2) * step, step, why


def step_of(horizon: float, log_step: float) -> float:
    """Step of the predictor [s]: a round number, no shorter than the log's; without a log, 0, orders are constant.

    At most a thirtieth of the horizon, a twelfth of the time in which the ship runs its length: recorded orders change
    within it. Where rows are further apart than half of the horizon, two of them are the horizon.
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
    every, first = survey_dataset(dataset), next(iter(vessels.values()), None)
    ahead, step, why = proposed_horizon(first, every)
    passing = (first.length or 0.0) / every.speed if first and every.speed > 0 else ahead / LENGTHS_AHEAD
    for spare in (float(every.runs["duration"].median()) - ahead, 0.0):
        method = _proposed_method(passing, step, spare, "L/U" if first else f"of {passing:.3g} s")
        usable = _runs_that_hold(dataset, ahead, step, _past_of_method(method))
        if len(usable) > LEAST_AMOUNT:
            break
    else:
        few = f"{len(usable)} {plural_word(len(usable), 'run')} of {ahead:g} s or more"
        remedy = "cut the log into its manoeuvres, [[segment]]s of the mapping (`shipid data segment` proposes them)"
        raise DataError(f"{few}, a study needs {LEAST_AMOUNT + 1}, one of them for the test: {remedy}", file=data)
    short = [run for run in every.runs.index if run not in usable]
    why += f"; too short for it: {', '.join(short)}" if short else ""
    seen = Survey(every.runs.loc[usable], every.step, every.failed)
    tests = typical_runs(seen)
    true_path = _true_path(dataset, ahead, seen.speed)
    interval = max(step, seen.step, _round_number_below(2.5 * float(seen.runs["duration"].sum()) / MOST_STUDY_WINDOWS))
    families = _families_of_vessels(vessels, dataset.runs)
    fixed = [
        Choice(
            "question",
            f"How well can the path of {first.name if first else data.stem} be predicted, with how many runs?",
        ),
        Choice("description", _log_in_words(seen, dataset), "what the log holds"),
        Choice("data.dataset", _path_from_study(str(data), out), f"commands {', '.join(dataset.commands) or 'none'}"),
        true_path,
        Choice("split.test", tests, _why_test(seen, tests)),
        Choice("prediction.ahead", float(f"{ahead:.9g}"), why),
        Choice("prediction.interval", interval, "s between instants of prediction"),
        _mean_with_law(method),
    ]
    steps = Choice("prediction.step", step, f"s; rows of the log come every {seen.step:.3g} s")
    least = [Choice("grid.N_D", [LEAST_AMOUNT]), *([Choice("family", families[:1])] if families else [])]
    plan = build_plan(tomllib.loads(_study_text([*fixed, steps, *least])), out, vessels)
    amounts = amounts_of_data(len(partition(plan, dataset)[0].spans))
    fixed += [
        Choice("split.folds", 1, f"{amounts[-1]} runs train: each validates in turn"),
        Choice("grid.N_D", amounts, f"runs for training and validation: from the fewest to all; {DRAWS_OF_FEW}"),
    ]
    failed = _warn_of_failed_checks(seen, data)
    try:
        choices, plan, notes = _first_that_runs(fixed, steps, families, out, vessels, dataset)
    except DivergenceError as error:
        if not failed:
            raise
        raise DivergenceError(f"{error.message}; but first: {failed[0]}", file=error.file, path=error.path) from None
    others = [name for name in usable if name not in tests]
    found = dict[str, Diagnosis]()
    for name, vessel in vessels.items():
        with suppress(DataError):  # runs of a few rows
            found[name] = diagnose(vessel, dataset, others)
    wrong = [f"{vessels[name].name}: {one.sentence}" for name, one in found.items() if one.cause != NONE]
    warnings = [*failed, *notes, *wrong]
    return Draft(_study_text(choices, warnings), choices, plan, warnings, found)


def _warn_of_failed_checks(seen: Survey, data: Path) -> list[str]:
    """One warning that counts the failed checks of a log and shows the first; none where all passed."""
    if seen.failed.empty:
        return []
    counts = seen.failed["check"].value_counts(sort=False).items()
    words = ", ".join(f"{name} ({count} {plural_word(count, 'run')})" for name, count in counts)
    first = seen.failed.iloc[0]
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
) -> tuple[list[Choice], Plan, Sequence[str]]:
    """The study with the longest step at which it runs, without the inaccurate family where that one diverges.

    Also its plan, and what it notes of the runs.
    """
    without = [family for family in families if family["name"] != INACCURATE]
    for parts, chosen in product(STEP_PARTS, [families] if without == families else [families, without]):
        shorter = f"; {parts} times as long diverges" if parts > 1 else ""
        choices = [
            *fixed,
            Choice(step.path, step.value / parts, step.why + shorter),
            Choice("prediction.integrator", "rk4", "euler, the paper's, takes a quarter of the time; steps show then"),
            *_claims_of_families([family["name"] for family in chosen]),
        ]
        words = "models, each improved by data; `none` is no physics, beside constant u, v, r"
        choices += [Choice("family", chosen, words)] if chosen else []
        plan = build_plan(tomllib.loads(_study_text(choices)), out, vessels)
        try:
            return choices, plan, prepare(plan, obtain_runs(plan) if dataset is None else dataset).notes
        except DivergenceError as error:
            last = error
    raise last


def _log_in_words(seen: Survey, dataset: Dataset) -> str:
    """How many runs of which kinds, how long and how fast."""
    runs = seen.runs
    kinds = ", ".join(f"{kind} {count}" for kind, count in runs["kind"].value_counts().items())
    times, speeds = (f"{runs[name].min():.3g} to {runs[name].max():.3g}" for name in ("duration", "speed"))
    return f"{len(runs)} runs ({kinds}) of {times} s at {speeds} m/s, {len(dataset.frame)} rows"


def _true_path(dataset: Dataset, ahead: float, speed: float) -> Choice:
    """The true path: positions, unless they scatter where the integral of the velocities does not."""
    half, whole = (separation_of_sources(dataset, lag) for lag in (ahead / 2, ahead))
    apart = (
        f"positions and the integral of u, v, psi part by {half:.2g} m in {ahead / 2:g} s, "
        f"{whole:.2g} m in {ahead:g} s (RMS)"
    )
    if any(whole < growth * half and whole > share * speed * ahead for growth, share in SCATTER_OF_POSITIONS):
        return Choice("data.path", "velocity", f"{apart}: it grows as positions that scatter do")
    return Choice("data.path", "position", f"{apart}: positions do not scatter")


def _why_test(seen: Survey, tests: Sequence[str]) -> str:
    """Each test run with its kind, speed and duration."""
    rows = seen.runs.loc[list(tests)].to_dict("index").items()
    words = [f"{name!r} ({run['kind']}, {run['speed']:.2g} m/s, {run['duration']:.0f} s)" for name, run in rows]
    return f"in the middle of their kind: {', '.join(words)}. Never look at them while you choose models"


def _claims_of_families(families: Sequence[str]) -> list[Choice]:
    """Which family each finding speaks of; none where there is nothing to compare."""
    if INACCURATE in families:
        roles, findings = {"accurate": families[0], "inaccurate": INACCURATE}, "R1-R4 of experiment 2"
    elif {"moderate", "high"} <= set(families):
        roles, findings = {name: name for name in ("moderate", "high", "nominal")}, "S1-S7 of experiment 1"
    else:
        return []
    return [Choice(f"claims.{role}", name, f"for the findings {findings}") for role, name in roles.items()]


def _families_of_vessels(vessels: Mapping[str, Vessel], runs: Sequence[str]) -> list[dict[str, Any]]:
    """Every vessel as it is, with the runs that it was identified from; the first made inaccurate, too."""
    families: list[dict[str, Any]] = []
    for named, vessel in vessels.items():
        known = documents.read_document(vessel.file).get("provenance", {}).get("runs", [])
        seen = [run for run in runs if run in known]
        name = re.sub(r"[^A-Za-z0-9_.+-]+", "-", vessel.key).strip("-")
        name = name if name[:1].isalpha() else f"ship-{name}"
        family = {"name": name, "description": f"{vessel.name}, as it is", "base": named}
        families.append({**family, "seen": seen} if seen else family)
    if families and (blocks := _inaccurate_blocks(next(iter(vessels.values())))):
        words = f"{families[0]['name']} made wrong on purpose: what does it cost to know the ship less well?"
        families.append({**families[0], "name": INACCURATE, "description": words, "perturb": blocks})
    return families


def _inaccurate_blocks(vessel: Vessel) -> list[dict[str, Any]]:
    """Higher-order damping removed, steering derivatives times 0.6 (method, section 5), as far as there are any."""
    hull = [path for path in vessel.parameters if path.startswith("hull.")]
    steering = [path for path in hull if path.rpartition(".")[2] in STEERING_DERIVATIVES]
    blocks: list[dict[str, Any]] = []
    if any((derivative_order(path) or 0) >= 3 for path in hull):
        blocks.append({"remove": ["hull.*[order >= 3]"]})
    if steering or (hull and not blocks):
        blocks.append({"parameters": steering or _hull_coefficients(hull), "factor": 0.6})
    return blocks


def draft_simulated(
    vessels: Mapping[str, Vessel], out: Path, lengths: float = LENGTHS_AHEAD, steps: int | None = None
) -> Draft:
    """A study of degraded models of a vessel, which makes the truth (method, section 4).

    vessels : the vessel, by the name that the study gives it. lengths : horizon in ship lengths, of so many `steps`.
    """
    if len(vessels) > 1:
        message = "one vessel makes the truth of a simulated study: give one, or --data with recorded runs"
        raise ShipidError(message, path="--vessel")
    ((named, vessel),) = vessels.items()
    length = vessel.length
    if length is None:
        raise ShipidError("particulars.L_pp is missing: the manoeuvres are timed in ship lengths", file=vessel.file)
    service, controls = vessel_service_speed(vessel), Controls(vessel)
    if not controls.differential:
        _ = controls.helm  # DocumentError where nothing turns the ship
    with placed_errors(ShipidError, file=vessel.file, path="particulars.U_0", into=DocumentError):
        rpm = shaft_speed(controls, service) / RPM
    horizon, why = horizon_of(length, 0.75 * service, [np.inf], lengths)
    step = horizon / steps if steps else step_of(horizon, 0.0)
    ahead = round(horizon / step) * step
    amounts = amounts_of_data(MANOEUVRES - TEST_MANOEUVRES)
    method = _proposed_method(horizon / lengths, step, np.inf)
    past, ship_time = _past_of_method(method), length / service
    duration = float(f"{ahead + INSTANTS_A_MANOEUVRE * step:.6g}")
    fine = step / 10 if steps else min(_round_number_below(ship_time / STEPS_A_LENGTH), step / 10)
    question = f"How good must a model of {vessel.name} be, and how many manoeuvres, to predict its path?"
    fixed = [
        Choice("question", question),
        Choice("description", f"simulated: {vessel.name} as it is makes the truth, and degraded models predict it"),
        Choice("truth.vessel", named),
        Choice("truth.manoeuvres", MANOEUVRES, f"{amounts[-1]} for training, {TEST_MANOEUVRES} for the test"),
        *([Choice("truth.run_up", past, "s before the first instant: the past of the memory")] if past else []),
        Choice("truth.duration", duration, f"s: {INSTANTS_A_MANOEUVRE} instants and the horizon"),
        Choice("truth.step", fine, f"s: the ship takes {ship_time:.3g} s for its length"),
        Choice("truth.interval", step, "s between logged rows"),
        *_ordinary_weather(vessel, length, service),
        _turning_orders(controls, service, rpm),
        *_ordinary_sensors(length, service),
        Choice("split.test", TEST_MANOEUVRES, f"manoeuvres, drawn: a sixth of {MANOEUVRES}"),
        Choice("split.folds", 1, "every run validates in turn"),
        Choice("prediction.ahead", float(f"{ahead:.9g}"), why),
        Choice("prediction.interval", step, "s between instants of prediction"),
        Choice("prediction.samples", INSTANTS_A_MANOEUVRE, "instants a manoeuvre"),
        Choice("grid.N_D", amounts, f"from the fewest to all {amounts[-1]} that are not for the test; {DRAWS_OF_FEW}"),
        method,
    ]  # fmt: skip
    first = Choice("prediction.step", step, "s; the truth is stepped more finely")
    choices, plan, _ = _first_that_runs(fixed, first, _degraded_families(named, vessel), out, vessels)
    return Draft(_study_text(choices), choices, plan)


def _proposed_method(passing: float, step: float, spare: float, of: str = "L/U") -> Choice:
    """Kernel ridge regression on the path with a memory; without one where runs are too short.

    passing : time [s] in which the ship runs its length; 0: not known. of : what it is, behind a number.
    spare : time [s] of the median run beyond the horizon; a third of it may be past.
    """
    past = min(PAST_LENGTHS * passing, spare / 3)
    if past < LEAST_PAST_STEPS * step:
        why = (
            f"no memory: a past of {past:.3g} s, {PAST_LENGTHS:g} L/U or a third of what the median run holds beyond "
            f"the horizon, is below {LEAST_PAST_STEPS} steps"
        )
        return Choice("method", [{"name": "instant", "kind": "kernel"}], why)
    lags = [
        float(f"{lag:.6g}") for lag in sorted({step * max(round(share * past / step), 1) for share in LAGS_OF_MEMORY})
    ]
    memory = {"history": lags[:-2], "turned": lags[-2:], "positions": lags[1:], "error": [lags[-3]]}
    why = (
        f"inputs of the last {lags[-1]:g} s, {past / passing:.2g} {of}: where ship and orders were, and what the "
        "physics got wrong; runs left out choose the length scale of each group. The first instants of a run are left "
        "out: they have no past"
    )
    return Choice("method", [{"name": "memory", "kind": "kernel", "memory": memory}], why)


def _mean_with_law(method: Choice) -> Choice:
    """A kernel in a mean with a regression: few runs of a log teach a law of accelerations more than a kernel."""
    (block,) = method.value
    settings = {key: value for key, value in block.items() if key not in ("name", "kind")}
    stack = {"name": block["name"], "kind": "stack", **({"kernel": settings} if settings else {})}
    law = "a kernel on paths beside a regression on accelerations: runs left out say how much each counts"
    return Choice(method.path, [stack], f"{law}; {method.why}")


def _past_of_method(method: Choice) -> float:
    """Longest past [s] that a method of `_proposed_method` reads; 0 without a memory."""
    return float(max(method.value[0].get("memory", {}).get("turned", [0.0])))


def _ordinary_weather(vessel: Vessel, length: float, service: float) -> list[Choice]:
    """A current that no model knows; gusts where the vessel feels wind: without them nothing disturbs the truth.

    Wind is WIND_SPEED; on a ship below WIND_LENGTH times sqrt(L / WIND_LENGTH), by Froude's rule.
    """
    feels, most = vessel_dynamics(vessel).environment, float(f"{CURRENT_SHARE * service:.2g}")
    wind = float(f"{WIND_SPEED * min(length / WIND_LENGTH, 1.0) ** 0.5:.2g}")
    choices = {
        "truth.current_speed": (
            [0.0, most],
            f"m/s, over ground, another in each run, unknown to the models: up to {percent_text(CURRENT_SHARE)} of the "
            f"service speed of {service:.3g} m/s, as a weak tide is (0.4 m/s for a ship of 8 m/s)",
        ),
        "truth.set.current.kind": ("uniform", "the truth alone drifts: models are as they are"),
        "truth.wind_speed": (
            [0.0, wind],
            f"m/s, from anywhere: {WIND_SPEED:g} m/s at most, on a ship below {WIND_LENGTH:g} m less by Froude's rule",
        ),
        "truth.gusts.kind": ("npd", "ISO 19901-1: a predictor knows the wind of the moment only"),
    }
    apply = dict.fromkeys(("truth.wind_speed", "truth.gusts.kind"), "V_w" in feels)
    apply["truth.set.current.kind"] = "V_c" not in feels
    return [Choice(path, value, why) for path, (value, why) in choices.items() if apply.get(path, True)]


def _ordinary_sensors(length: float, service: float) -> list[Choice]:
    """Noise of ordinary sensors, scaled with the ship, so that an error has a floor; test paths are the exact ones."""
    position, speed, rate = (
        min(MOST_JITTER, JITTER_SHARE * length),
        SPEED_NOISE * service,
        SPEED_NOISE * service / length,
    )
    noises = {
        "north": (
            position,
            f"m: DGNSS on a ship of 100 m or more, {JITTER_SHARE:g} L below: RTK on a boat, cameras over a model. "
            "Models learn from these fixes; the exact path judges what they predict from them",
        ),
        "east": (position, "as north"),
        "psi": (COMPASS_NOISE, "rad: 0.25 deg RMS, which IMO A.424(XI) allows a gyro compass"),
        "u": (speed, f"m/s: {percent_text(SPEED_NOISE, 1)} of the service speed; IMO MSC.96(72) allows a log 2 %"),
        "v": (speed, "as u"),
        "r": (rate, "rad/s: that of u over the length; IMO A.526(13) allows a rate gyro 0.5 deg/min and 5 %"),
    }
    return [Choice(f"truth.sensors.{name}.noise", float(f"{noise:.2g}"), why) for name, (noise, why) in noises.items()]


def _turning_orders(controls: Controls, service: float, rpm: float) -> Choice:
    """Turns with constant orders; each shaft, or angle, has its own where they steer by their difference.

    A shaft that does not drive the ship ahead, such as that of a tunnel thruster, rests.
    """
    low, high = float(f"{rpm / 2:.3g}"), float(f"{rpm:.3g}")
    drives, helm = controls.effects
    signs = {(signal_of(name), sign) for name, sign in helm.items()}
    orders: dict[str, Any] = {}
    for name in controls.commands:
        (single, common), row = order_keys(name), SIGNALS[signal_of(name)]
        if drive_scale(name) and name not in drives:
            orders[single] = 0.0
        elif drive_scale(name):
            orders[single if controls.differential else common] = [0.0 if controls.differential else low, high]
        elif is_steering(name):
            both_ends = {(signal_of(name), 1), (signal_of(name), -1)} <= signs  # one angle for all drives it aside
            orders[single if both_ends else common] = [-HELM_DEG, HELM_DEG]
        else:
            orders[common] = [value / row.factor for value in row.usual]
    speeds = [float(f"{service / 2:.3g}"), float(f"{service:.3g}")]
    why = (
        f"constant orders: up to {high:g} {controls.drive_unit}, which hold {service:.3g} m/s in calm water; what does "
        "not drive the ship ahead rests"
    )
    return Choice("truth.manoeuvre", [{"kind": "turning", **orders, "start_speed": speeds}], why)


def _degraded_families(named: str, vessel: Vessel) -> list[dict[str, Any]]:
    """Nominal, moderate and high: the families of experiment 1 (method, section 4), as far as the vessel has them."""
    hull = [path for path in vessel.parameters if path.startswith("hull.")]
    damping = _hull_coefficients(hull)
    if any(derivative_order(path) for path in hull):
        damping = ["hull.*[order >= 1]", *(path for path in hull if path.rpartition(".")[2] in DRAG_COEFFICIENTS)]
    if not damping:
        raise ShipidError("has no [hull] numbers to degrade: declare families by hand", file=vessel.file)
    moderate = {"parameters": damping, "factor": [0.4, 1.6]}
    high = {"parameters": [path for path in INERTIA_PATHS if path in vessel.parameters], "factor": [0.6, 1.4]}
    words = (
        "the numbers of the truth: the error that disturbances and sensors leave",
        "each hull coefficient times a separate factor in 0.4-1.6",
        "as moderate, and mass, yaw inertia and added mass times factors in 0.6-1.4",
    )
    return [
        {"name": "nominal", "description": words[0], "base": named},
        {"name": "moderate", "description": words[1], "base": named, "members": 3, "seed": 1, "perturb": [moderate]},
        {"name": "high", "description": words[2], "extends": "moderate", "members": 2, "seed": 2, "perturb": [high]},
    ]


def _hull_coefficients(paths: Sequence[str]) -> list[str]:
    """Paths of coefficients, without those of geometry and of the water."""
    return [path for path in paths if path.rpartition(".")[2] not in ("x_aft", "x_fwd", *SHARED)]


def _study_text(choices: Sequence[Choice], warnings: Sequence[str] = ()) -> str:
    """The study as TOML, each reason above its value."""
    head = ["Written by `shipid study new`. Above each value is its reason. Change what you know better."]
    blocks = {"": _comment([*head, *(f"NOTE {one}" for one in warnings)])}
    last = {"method": "", "family": ""}  # lists of tables: what follows them in the file would belong to them
    for choice in choices:
        block = choice.path.rpartition(".")[0]
        title = f"[{block}]\n" if block else ""
        nested = reduce(lambda inner, part: {part: inner}, reversed(choice.path.split(".")), choice.value)
        value = tomlkit.dumps(nested).removeprefix(title)
        text = f"{_comment([choice.why])}{value}"
        if choice.path in last:
            last[choice.path] = text
        else:
            blocks[block] = blocks.get(block, title) + text
    return "\n".join([*blocks.values(), *filter(None, last.values())])


def _comment(sentences: Sequence[str]) -> str:
    lines = (line for one in sentences for line in textwrap.wrap(one, 110))
    return "".join(f"# {line}\n" for line in lines)


def _vessel_key(name: str, out: Path) -> str:
    """A vessel as the study names it: a bundled name as it is, a path from the study's folder."""
    return _path_from_study(name, out) if "/" in name or "\\" in name or name.endswith(".toml") else name


def _path_from_study(name: str, out: Path) -> str:
    path = Path(os.path.relpath(name, out.parent)).as_posix()
    return path if "/" in path or path.endswith((".toml", ".parquet")) else f"./{path}"


def _round_number_below(value: float) -> float:
    """Greatest of 1, 2, 5 and their tens, up to a value."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(f"{max(step * decade for step in (1, 2, 5) if step * decade <= value * (1 + 1e-9)):.6g}")
