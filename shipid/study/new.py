"""Write a study file for a vessel and its runs: sensible choices, each with its reason, to be read and changed."""

from __future__ import annotations

import os
import re
import textwrap
import tomllib
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomlkit
from tomlkit.items import Table

from shipid import document as documents
from shipid.data.dataset import STANDARD_DEVIATIONS, Dataset, read_dataset
from shipid.data.held import nothing_varies
from shipid.data.windows import cut_windows
from shipid.engine.integrate import Method as Integrator
from shipid.errors import DataError, Diverges, DocumentError, ShipidError
from shipid.hybrid.physics import assumed, check_columns
from shipid.logs.kinds import COASTING, LOW_SPEED, RANDOM
from shipid.physics.signals import SIGNALS, is_shaft, signal_of, steers
from shipid.simulation.approach import Controls, service_speed
from shipid.simulation.manoeuvre import order_keys
from shipid.simulation.standard import shaft_speed
from shipid.study.declared import NO_MODEL
from shipid.study.first_look import LEAST_ERROR, Look, euler_apart, first_look
from shipid.study.plan import Plan, build_plan
from shipid.study.prepare import all_windows, obtain, over_gaps, partition, prepare
from shipid.study.survey import Survey, helm_sense, separation, survey, typical_runs
from shipid.units import GRAVITY, RPM, percent, plural
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import order_of
from shipid.vessel.schema import SHARED, term_blocks

LETTERS = {"ä": "ae", "ö": "oe", "ü": "ue", "ø": "oe", "å": "aa", "æ": "ae", "ß": "ss", "ł": "l", "đ": "d"}
CORRECTED = "-corrected"  # ends the name of a family whose numbers the log corrects
LEAST_RUNS = 2  # the smallest amount of data of a new study: one run trains too, if it is long enough to be parted
MOST_AMOUNTS, MOST_WINDOWS = 6, 20000
# Ship lengths: the paper's experiments look 2.3 (15 s at full scale) and 2.4 (30 s, simulated) ahead.
LENGTHS_AHEAD = 2.5
WIND, WIND_LENGTH = 6.0, 28.9  # m/s, m: up to a moderate breeze on R/V Gunnerus, as in the bundled studies
HORIZONS = (1, 1.5, 2, 3, 5, 7, 10, 15, 20, 30, 45, 60, 90, 120, 180, 240, 300, 450, 600)  # s
SHARE_OF_RUN = 1 / 3  # of the median run that the horizon may take
SMALLER = (2, 4, 8)  # parts of the step: a small craft is stiff in yaw
EULER = 0.1
"""Share of the error of a vessel by which explicit Euler may move its paths.

Below `SAVING` of the first look: what makes up for Euler alone is no correction that is reported. Measured: 0.09 to
0.21 for three models of R/V Gunnerus on the log of 2022, 0.64 and 0.67 for two of KVLCC2 on the zigzags of HSVA, 26 and
40 for the Mariner and KVLCC2 on zigzags and circles that their own models made.
"""
STEPS, LOGGED_STEPS, LONGEST_STEP = 15, 30, 2.0  # steps ahead at least, of constant and of recorded orders; s
DIVERGES = "explicit Euler diverges on these runs"
LEAST_SENSE = 0.1  # correlation of an angle with the change of r
SYSTEMATIC = 0.05  # positions and velocities differ by a factor, not by scatter
GROWING = 1.2  # times as far apart after twice the time: less is jitter
UNTRUE_PATHS = 0.25  # of the runs whose positions leave their velocities
FEW_RUNS, FOLDS = 6, 3
MANOEUVRES, TESTS, INSTANTS, MEMBERS = 60, 10, 50, {"moderate": 3, "high": 2}
PAST, LAGS, LEAST_PAST = 11.6, (0.1, 0.2, 0.4, 0.5, 1.0), 8  # sqrt(L / g): 20 s of a ship of 29 m; shares; steps
HELM_DEG, STEPS_A_LENGTH = 35.0, 150
STEERING = ("N_ur", "Y_ur", "N_uv", "N_r", "Y_r", "N_v")  # linear in v, r at a speed: products with u or scaled by U
HIGHER = "hull.*[order >= 3]"
DRAG = ("C_d", *(f"R_{power}" for power in range(5)))  # coefficients of the hull whose names are no formula
INERTIA = ("inertia.m", "inertia.I_z", "added_mass.X_udot", "added_mass.Y_vdot", "added_mass.N_rdot")


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
    loaded = {_named(name, out): load_vessel(name) for name in vessels}
    if not loaded:
        raise ShipidError("name a vessel: a bundled name (see `shipid vessel list`) or a path", path="--vessel")
    if data is None:
        return _simulated(loaded, out)
    dataset = read_dataset(data)
    for vessel in loaded.values():
        check_columns(vessel, dataset.frame.columns, str(data))
    return _recorded(loaded, dataset, data, out)


def horizon_of(length: float | None, speed: float, durations: Sequence[float]) -> tuple[float, str]:
    """Horizon [s], and why: some ship lengths at the usual speed, but a part of the median run."""
    longest = float(np.median(durations)) * SHARE_OF_RUN
    possible = [seconds for seconds in HORIZONS if seconds <= longest] or [HORIZONS[0]]
    if length is None or speed <= 0:
        return possible[-1], "a third of the median run at most: without particulars.L_pp and speed there is no L/U"
    wanted = LENGTHS_AHEAD * length / speed
    chosen = min(possible, key=lambda seconds: abs(np.log(seconds / wanted)))
    why = (
        f"{chosen:g} s, in which the ship runs {chosen * speed / length:.2g} ship lengths at {speed:.3g} m/s "
        f"(L/U = {length / speed:.3g} s): over about {LENGTHS_AHEAD:g} its dynamics decide, later the next orders"
    )
    short = f"; no longer than a third of the median run, {3 * longest:.3g} s" if wanted > longest else ""
    return chosen, why + short


def proposed_horizon(vessel: Vessel, dataset: Dataset) -> tuple[float, float]:
    """Horizon and step [s] that a new study of a vessel and its runs would have."""
    seen = survey(dataset)
    horizon, _ = horizon_of(vessel.length, seen.speed, seen.runs["duration"].tolist())
    step = step_of(horizon, seen.step)
    return max(round(horizon / step), 2) * step, step


def step_of(horizon: float, log_step: float) -> float:
    """Step of the predictor [s]: a round number, no shorter than the log's; without a log, 0, orders are constant.

    At most a thirtieth of the horizon, a twelfth of the time in which the ship runs her length: recorded orders change
    within it. Where rows are further apart than half of the horizon, the step is their distance, and two steps are the
    horizon.
    """
    most = min(horizon / (LOGGED_STEPS if log_step else STEPS), LONGEST_STEP)
    return max(min(_round_down(most), horizon / 2), log_step)


def _ahead(horizon: float, steps: int, step: float, why: str) -> Choice:
    """The horizon [s] as whole steps, and why; where that is another number, the reason says so."""
    value = float(f"{steps * step:.9g}")
    near = "" if np.isclose(value, horizon) else f"{steps} steps of {step:g} s, as near as they come to "
    return Choice("prediction.ahead", value, near + why)


def ladder(total: int) -> list[int]:
    """Amounts of data from the least to all runs, by equal factors of at least two."""
    factor = max(2.0, (total / LEAST_RUNS) ** (1 / (MOST_AMOUNTS - 1)))
    amounts = [round(LEAST_RUNS * factor**power) for power in range(MOST_AMOUNTS)]
    return [amount for amount in amounts if amount < 0.8 * total] + [total]


def _recorded(vessels: Mapping[str, Vessel], dataset: Dataset, data: Path, out: Path) -> Draft:
    seen = survey(dataset)
    first = next(iter(vessels.values()))
    horizon, why = horizon_of(first.length, seen.speed, seen.runs["duration"].tolist())
    step = step_of(horizon, seen.step)
    steps = max(round(horizon / step), 2)
    usable = _usable(dataset, steps, step, data)
    method = _method(first.length, step, float(seen.runs.loc[usable, "duration"].median()) - steps * step)
    past = _past(method)
    held = _held(dataset, steps, step, past)
    if len(held) > LEAST_RUNS:
        usable = held
    else:
        method = _method(first.length, step, 0.0)
    runs = seen.runs.loc[usable]
    interval = max(step, seen.step, _round_up(float(runs["duration"].sum()) / MOST_WINDOWS))
    tests = typical_runs(runs)
    true_path = _path(seen, dataset, steps * step)
    others = [name for name in usable if name not in tests]
    how: dict[str, Any] = {"ahead": steps * step, "path": true_path.value}
    why_not_euler = _needs_rk4(
        {named: euler_apart(vessel, dataset, others, step=step, **how) for named, vessel in vessels.items()}
    )
    learned = _learned(vessels, dataset.runs)
    fixed = [
        *_question(vessels, dataset, seen, steps * step),
        Choice("data.dataset", _relative(str(data), out), _measured(vessels, dataset)),
        true_path,
        Choice("split.test", tests, _why_test(runs, tests)),
    ]
    ahead = [
        _ahead(horizon, steps, step, why + _left_out(seen.runs, usable)),
        Choice("prediction.step", step, f"s; rows of the log come every {seen.step:.3g} s"),
    ]
    rest = [Choice("prediction.interval", interval, "s between instants of prediction")]
    plain = _families(vessels, {}, learned, others)
    some = [Choice("split.folds", 1), Choice("grid.N_D", [LEAST_RUNS]), *ahead, *rest]
    least = _planned([*fixed, *some, method], plain[:1], out, vessels)
    amounts = ladder(len(partition(least, dataset)[0].spans))
    fixed += [_folds(amounts[-1])]
    tail = [*rest, *_grid(amounts), method]
    failing = [_failing(seen, data)] if seen.faults else []
    failing += over_gaps(dataset, all_windows(least, dataset))
    warnings = [*failing, *nothing_varies(dataset, usable), *_wrong_velocities(seen), *_wrong_helm(first, dataset)]
    warnings += _knowing(_learned(vessels, tests))

    def corrected(step: float, integrator: Integrator) -> _Content:
        """Families and warnings by looks that predict as the study does."""
        seen = {
            named: first_look(vessel, dataset, others, step=step, integrator=integrator, **how)
            for named, vessel in vessels.items()
        }
        wrong = [look.sentence for look in seen.values() if look.wrong]
        return _Content(_softer(_families(vessels, seen, learned, others)), (*warnings, *wrong), seen)

    try:
        return _first_that_runs(
            fixed, _ways(*ahead, why_not_euler=why_not_euler), tail, corrected, out, vessels, dataset
        )
    except Diverges as error:
        if not seen.faults:
            raise
        message = f"{error.message}; but first {_failing(seen, data)}"
        raise Diverges(message, file=error.file, path=error.path) from None


def _needs_rk4(apart: Mapping[str, tuple[float, float]]) -> str:
    """Why Euler is not to be taken, nothing where it may be; apart : vessel -> as of `euler_apart`."""
    worst = max(apart, key=lambda name: apart[name][0] / max(apart[name][1], LEAST_ERROR))
    moved, error = apart[worst]
    one = len(apart) == 1
    if np.isinf(moved):
        return DIVERGES if one else f"{DIVERGES} with {worst}"
    if moved <= EULER * max(error, LEAST_ERROR):
        return ""
    paths, vessel = ("the paths", "the vessel") if one else (f"the paths of {worst}", worst)
    return (
        f"explicit Euler (the paper's) with this step moves {paths} by {moved:.2g} m (mean), and with rk4 {vessel} "
        f"errs {error:.2g} m: too much to tell which numbers are wrong"
    )


def _learned(vessels: Mapping[str, Vessel], runs: Sequence[str]) -> dict[str, list[str]]:
    """Which of some runs each vessel was identified from, as its patch says; a vessel that is no patch from none."""
    known = {
        name: documents.read(vessel.file).get("provenance", {}).get("runs", []) for name, vessel in vessels.items()
    }
    return {name: [run for run in runs if run in of_vessel] for name, of_vessel in known.items()}


def _knowing(learned: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """A warning for each vessel that was identified from test runs; learned : as of `_learned`, of the test runs."""
    for name, seen in learned.items():
        if seen:
            words = f"{name} was identified from {', '.join(seen)}, which now {plural(len(seen), 'tests', 'test')} it"
            yield f"{words}: choose other test runs, or let the study identify ([family.identify])"


def _failing(seen: Survey, data: Path) -> str:
    """Where to look at the log: the first fault, and how many checks fail."""
    count = len(seen.faults)
    return f"look at `shipid data check {data}`, {count} failed{', such as' if count > 1 else ':'} {seen.faults[0]}"


def _held(dataset: Dataset, steps: int, step: float, past: float) -> list[str]:
    """Runs that hold the horizon and the past [s] before it."""
    try:
        names = cut_windows(dataset, horizon=steps, step=step, interval=step, past=round(past / step)).spans
    except DataError:
        return []
    return [run for run in dataset.runs if run in names]


def _usable(dataset: Dataset, steps: int, step: float, data: Path) -> list[str]:
    """Runs as long as the horizon; DataError where they are too few for a study."""
    try:
        names = cut_windows(dataset, horizon=steps, step=step, interval=step).spans
    except DataError as error:
        raise DataError(error.message, file=data) from None
    usable = [run for run in dataset.runs if run in names]
    if len(usable) <= LEAST_RUNS:
        few = f"{len(usable)} {plural(len(usable), 'run')} of {steps * step:g} s or more"
        remedy = "cut the log into its manoeuvres, [[segment]]s of the mapping (`shipid data segment` proposes them)"
        raise DataError(f"{few}, a study needs {LEAST_RUNS + 1}, one of them for the test: {remedy}", file=data)
    return usable


@dataclass(frozen=True)
class _Content:
    """Families of a study, then milder ones; what is wrong, one sentence each; and the looks that say so."""

    families: Sequence[list[Any]]
    warnings: tuple[str, ...] = ()
    looks: Mapping[str, Look] = field(default_factory=dict)


def _ways(horizon: Choice, step: Choice, *, why_not_euler: str = "") -> Iterator[list[Choice]]:
    """Explicit Euler unless there is a reason not to, else RK4, else RK4 at smaller and smaller steps."""
    if not why_not_euler:
        yield [
            horizon,
            step,
            Choice("prediction.integrator", "euler", "the paper's; take rk4 if you take a longer step"),
        ]
    method = Choice("prediction.integrator", "rk4", why_not_euler or DIVERGES)
    yield [horizon, step, method]
    for parts in SMALLER:
        yield [horizon, Choice(step.path, step.value / parts, f"{step.why}; twice as long diverges"), method]


def _first_that_runs(
    before: Sequence[Choice],
    ways: Iterator[list[Choice]],
    after: Sequence[Choice],
    content: Callable[[float, Integrator], _Content],
    out: Path,
    vessels: Mapping[str, Vessel],
    dataset: Dataset | None = None,
) -> Draft:
    """The first way to step that runs, with the first of its families that do; content : by step [s] and integrator."""
    for way in ways:
        held = content(way[1].value, way[2].value)
        for chosen in held.families:
            choices = [*before, *way, *after, *_claims([family["name"] for family in chosen])]
            plan = _planned(choices, chosen, out, vessels)
            try:
                _check_runs(plan, obtain(plan) if dataset is None else dataset)
            except Diverges as error:
                last = error
            else:
                text = _text(choices, chosen, held.warnings)
                return Draft(text, tuple(choices), plan, held.warnings, held.looks)
    raise last


def _check_runs(plan: Plan, dataset: Dataset) -> None:
    """Do all that a run of the plan does but the training."""
    prepared = prepare(plan, dataset)
    for batch in plan.batches:
        windows = prepared.pool.select(np.isin(prepared.pool.run, prepared.runs(plan, batch)))
        for way in plan.methods:
            prepared.folds(plan, batch, windows, way.method.validation)


def _planned(choices: Sequence[Choice], families: Sequence[Any], out: Path, vessels: Mapping[str, Vessel]) -> Plan:
    return build_plan(tomllib.loads(_text(choices, families)), out, vessels)


def _question(vessels: Mapping[str, Vessel], dataset: Dataset, seen: Survey, horizon: float) -> Iterator[Choice]:
    name = next(iter(vessels.values())).name
    yield Choice("question", f"How well can {name} be predicted {horizon:g} s ahead, with how many runs?")
    counts = Counter(seen.runs["kind"])
    kinds = ", ".join(_of_kind(count, kind) for kind, count in counts.most_common())
    low, high = seen.runs["duration"].min(), seen.runs["duration"].max()
    slow, fast = seen.runs["speed"].min(), seen.runs["speed"].max()
    text = f"{len(seen.runs)} runs ({kinds}) of {low:.0f} to {high:.0f} s at {slow:.2g} to {fast:.2g} m/s"
    wind = "" if "V_w" in dataset.frame else ", wind not measured"
    yield Choice("description", f"{text}, {len(dataset.frame)} rows{wind}", "what the log holds")


def _of_kind(count: int, kind: str) -> str:
    """Return `3 zigzags`, `9 random runs`, `1 run of coasting`."""
    if kind in (LOW_SPEED, COASTING):
        return f"{count} {plural(count, 'run')} of {kind}"
    return f"{count} {plural(count, f'{kind} run' if kind == RANDOM else kind)}"


def _measured(vessels: Mapping[str, Vessel], dataset: Dataset) -> str:
    columns = [str(name) for name in dataset.frame]
    orders = ", ".join(dataset.commands)
    lacking = {name: assumed(vessel, columns) for name, vessel in vessels.items()}
    missing = [f"{key} takes {', '.join(names)} as 0" for key, names in lacking.items() if names]
    estimated = [name for name, std in STANDARD_DEVIATIONS.items() if std in columns]
    wind = "wind is measured" if "V_w" in columns else "wind is not measured and is no input"
    parts = [f"commands {orders or 'none'}", wind, *missing]
    parts += [f"{', '.join(estimated)} are estimated from positions and heading"] if estimated else []
    return "; ".join(parts)


def _path(seen: Survey, dataset: Dataset, horizon: float) -> Choice:
    """The true path: positions, unless they scatter where the integral of the velocities does not."""
    share = float(seen.runs["straying"].mean())
    away = f"positions leave the integral of u, v, psi in {int(seen.runs['straying'].sum())} of {len(seen.runs)} runs"
    size, turn = abs(seen.factor), float(np.degrees(np.angle(seen.factor)))
    half, whole = (separation(dataset, lag) for lag in (horizon / 2, horizon))
    parting = f"{half:.2g} m in {horizon / 2:g} s, {whole:.2g} m in {horizon:g} s"
    apart = f"positions and the integral of u, v, psi part by {parting}"
    if seen.stream is not None:
        what = f"u and v look like speeds through the water ({_flow(seen)}), and the true path is the positions"
        return Choice("data.path", "position", f"{apart} (RMS): {what}")
    if share <= UNTRUE_PATHS and whole < GROWING * half:
        why = f"{apart} (RMS): that does not grow, so it is jitter of the positions, and the true path is the integral"
        return Choice("data.path", "velocity", why)
    if share <= UNTRUE_PATHS:
        return Choice("data.path", "position", f"{apart} (RMS): that is little, and the true path is the positions")
    if abs(seen.factor - 1) > SYSTEMATIC:
        return Choice("data.path", "position", f"{away}, and not by scatter: u, v or psi are wrong, see above")
    scatter = f"they scatter (factor {size:.3g}, {turn:.2g} deg), so the true path is that integral"
    return Choice("data.path", "velocity", f"{away} by more than 5 % of the way; {scatter}")


def _flow(seen: Survey) -> str:
    """The current that u and v lack, in words."""
    assert seen.stream is not None
    current, share = seen.stream
    towards = float(np.degrees(np.angle(current))) % 360.0
    return f"a steady {abs(current):.2g} m/s towards {towards:.0f} deg explains {percent(share)} of the difference"


def _wrong_velocities(seen: Survey) -> Iterator[str]:
    if seen.stream is not None:
        yield (
            f"u and v look like speeds through the water, not over ground: {_flow(seen)}. "
            "Leave them out of the mapping, write [estimate] in their place, and import again"
        )
        return
    if abs(seen.factor - 1) > SYSTEMATIC:
        size, turn = abs(seen.factor), float(np.degrees(np.angle(seen.factor)))
        yield (
            f"positions say {size:.3g} times the way that u, v and psi say, turned by {turn:.2g} deg: "
            "a wrong unit or direction? Look at `shipid data check`, mend the mapping and import again"
        )


def _wrong_helm(vessel: Vessel, dataset: Dataset) -> Iterator[str]:
    """Angles that turn the vessel one way and the ship of the log the other."""
    seen = helm_sense(dataset)
    try:
        expected = Controls(vessel).helm
    except ShipidError:
        return  # nothing drives or turns the ship
    for name, sign in expected.items():
        if sign * seen.get(name, 0.0) < -LEAST_SENSE:
            yield (
                f"{name} > 0 turns {vessel.name} to {'starboard' if sign > 0 else 'port'}, in the log the other way: "
                "should its `sign` in the mapping be the other one? Mend it and import again"
            )


def _why_test(runs: pd.DataFrame, tests: Sequence[str]) -> str:
    words = []
    for name in tests:
        run = runs.loc[name]
        alike = int((runs["kind"] == run["kind"]).sum())
        words.append(
            f"{name!r} is in the middle of {_of_kind(alike, str(run['kind']))}: {run['speed']:.2g} m/s, "
            f"{np.degrees(run['rate']):.2g} deg/s, {run['duration']:.0f} s"
        )
    return f"{'; '.join(words)}. Never look at them while you choose models. More tests make surer answers"


def _left_out(runs: pd.DataFrame, usable: Sequence[str]) -> str:
    short = [str(name) for name in runs.index if name not in usable]
    return f"; too short for it: {', '.join(short)}" if short else ""


def _folds(total: int) -> Choice:
    if total < FEW_RUNS:
        return Choice("split.folds", 1, f"{total} runs train: each validates in turn")
    return Choice(
        "split.folds", FOLDS, f"{total} runs train and validate: two thirds train, one third validates, in turn"
    )


def _grid(amounts: list[int]) -> Iterator[Choice]:
    yield Choice("grid.N_D", amounts, "runs for training and validation: from the fewest to all, the learning curve")
    yield Choice("grid.seeds", [0, 1, 2], "three draws of which runs come first: with fewer there is no range")


def _claims(families: Sequence[str]) -> Iterator[Choice]:
    """Which family each finding speaks of; none where there is nothing to compare."""
    if "inaccurate" in families:
        accurate = next((name for name in families if name.endswith(CORRECTED)), families[0])
        yield Choice("claims.accurate", accurate, "asks for verdicts on the findings R1-R4 of experiment 2")
        yield Choice("claims.inaccurate", "inaccurate")
    elif {"moderate", "high"} <= set(families):
        yield Choice("claims.moderate", "moderate", "asks for verdicts on the findings S1-S7 of experiment 1")
        yield Choice("claims.high", "high")
        yield Choice("claims.nominal", "nominal")


def _families(
    vessels: Mapping[str, Vessel], looks: Mapping[str, Look], learned: Mapping[str, list[str]], others: list[str]
) -> list[Any]:
    """Every vessel as it is and as its log corrects it; the first made inaccurate as in the paper's experiment 2.

    learned : the runs that each vessel was identified from. others : the runs that corrected it.
    """
    families: list[Any] = []
    names = family_names(vessels)
    for named, vessel in vessels.items():
        name, better = names[named]
        seen = {"seen": learned[named]} if learned[named] else {}
        families.append({"name": name, "description": f"{vessel.name}, as it is", "base": named, **seen})
        look = looks.get(named)
        if look is not None and look.changes:
            groups = ", ".join(f"{change.group.name} x {change.factor:.3g}" for change in look.changes)
            words = f"{vessel.name} with {groups}: from all runs that do not test, whatever N_D"
            corrected = {"name": better, "description": words, "base": named}
            runs = list(dict.fromkeys([*learned[named], *others]))
            families.append({**corrected, "seen": runs, "perturb": [{"set": look.values}]})
    named, vessel = next(iter(vessels.items()))
    blocks = _inaccurate(vessel)
    words = f"{families[0]['name']} made wrong on purpose: what does it cost to know the ship less well?"
    if blocks:
        seen = {"seen": learned[named]} if learned[named] else {}
        families.append({"name": "inaccurate", "description": words, "base": named, **seen, "perturb": blocks})
    return families


def family_names(vessels: Mapping[str, Vessel]) -> dict[str, tuple[str, str]]:
    """Names of the families of each vessel of a study: as it is, and as its log corrects it. No two are one file."""
    taken = {NO_MODEL, "inaccurate"}

    def free(name: str, more: str, end: str = "") -> str:
        while f"{name}{end}".lower() in taken:
            name += more
        taken.add(f"{name}{end}".lower())
        return f"{name}{end}"

    own = {named: free(_spelt(vessel.key), "-own") for named, vessel in vessels.items()}
    return {named: (name, free(name, "-log", CORRECTED)) for named, name in own.items()}


def _spelt(key: str) -> str:
    """The name of a file as the name of a family, which has letters of English alone: `ærø` is `aeroe`."""
    words = unicodedata.normalize("NFKD", re.sub(r"[^\x00-\x7f]", _letter, key))
    name = re.sub(r"[^A-Za-z0-9_.+-]+", "-", "".join(sign for sign in words if not unicodedata.combining(sign)))
    name = name.strip("-") or "ship"
    return name if name[0].isalpha() else f"ship-{name}"


def _letter(match: re.Match[str]) -> str:
    spelt = LETTERS.get(match[0].lower(), match[0])
    return spelt.capitalize() if spelt.isascii() and match[0].isupper() else spelt


def _inaccurate(vessel: Vessel) -> list[dict[str, Any]]:
    """Higher-order damping removed, steering derivatives times 0.6 (method, section 5), as far as there are any."""
    hull = [path for path in vessel.parameters if path.startswith("hull.")]
    steering = [path for path in hull if path.rpartition(".")[2] in STEERING]
    blocks: list[dict[str, Any]] = []
    if any((order_of(path) or 0) >= 3 for path in hull):
        blocks.append({"remove": [HIGHER]})
    if steering or (hull and not blocks):
        blocks.append({"parameters": steering or _shapeless(hull), "factor": 0.6})
    return blocks


def _softer(families: list[Any]) -> list[list[Any]]:
    """The families, then without removing, then without the inaccurate one."""
    *first, last = families
    if last["name"] != "inaccurate":
        return [families]
    scaled = [block for block in last["perturb"] if "factor" in block]
    milder = [[*first, {**last, "perturb": scaled}]] if scaled and scaled != last["perturb"] else []
    return [families, *milder, first]


def _simulated(vessels: Mapping[str, Vessel], out: Path) -> Draft:
    """A study of degraded models of the first vessel, which makes the truth (method, section 4)."""
    if len(vessels) > 1:
        message = "one vessel makes the truth of a simulated study: give one, or --data with recorded runs"
        raise ShipidError(message, path="--vessel")
    (named, vessel), *_ = vessels.items()
    length = vessel.length
    if length is None:
        raise ShipidError("particulars.L_pp is missing: the manoeuvres are timed in ship lengths", file=vessel.file)
    service = service_speed(vessel)
    controls = Controls(vessel)
    if not controls.differential:
        _ = controls.helm  # DocumentError where nothing turns the ship
    try:
        rpm = shaft_speed(controls, service) / RPM
    except ShipidError as error:
        place = "particulars.U_0" if error.path == "--speed" else error.path  # here no option gives the speed
        raise DocumentError(error.message, file=vessel.file, path=place) from None
    speed = 0.75 * service
    horizon, why = horizon_of(length, speed, [np.inf])
    step = step_of(horizon, 0.0)
    amounts = ladder(MANOEUVRES - TESTS)
    families = _degraded(named, vessel)
    method = _method(length, step, np.inf)
    past = _past(method)
    fixed = [
        Choice(
            "question",
            f"How good must a model of {vessel.name} be, and how many manoeuvres, to predict "
            f"{round(horizon / step) * step:g} s?",
        ),
        Choice("description", f"simulated: {vessel.name} as it is makes the truth, and degraded models predict it"),
        *_truth(named, controls, service, rpm, horizon, step, past),
        Choice("split.test", TESTS, f"manoeuvres, drawn: a sixth of {MANOEUVRES}"),
        Choice("split.folds", 1, "with the method `path-drawn` every run validates in turn"),
    ]
    ahead = [
        _ahead(horizon, round(horizon / step), step, why),
        Choice("prediction.step", step, "s; the truth is stepped more finely, that is a part of what models get wrong"),
    ]
    tail = [
        Choice("prediction.interval", step, "s between instants of prediction"),
        Choice("prediction.samples", INSTANTS, "instants a manoeuvre"),
        Choice("grid.N_D", amounts, f"from the fewest to all {amounts[-1]} that are not for the test"),
        Choice("grid.seeds", [0], "take [0, 1, 2, 3, 4] for verdicts: findings about scatter need five"),
        method,
    ]
    return _first_that_runs(fixed, _ways(*ahead), tail, lambda *_: _Content([families]), out, vessels)


def _method(length: float | None, step: float, spare: float) -> Choice:
    """Compensation of the path with a memory, which validation may refuse; without one where runs are too short.

    spare : time [s] of the median run beyond the horizon; a third of it may be past.
    """
    plain = {"name": "drawn", "kind": "path-drawn"}
    past = PAST * float(np.sqrt((length or 0.0) / GRAVITY))
    lags = sorted({step * max(round(share * past / step), 1) for share in LAGS})
    if not length or past < LEAST_PAST * step:
        return Choice("method", [plain], "no memory: the step is too long for the past of a ship of this length")
    if past > spare / 3:
        why = (
            f"no memory: of {past:.3g} s, a third of what the median run holds beyond the horizon is {spare / 3:.3g} s"
        )
        return Choice("method", [plain], why)
    rounded = [float(f"{lag:.6g}") for lag in lags]
    memory = {"history": rounded[:-2], "turned": rounded[-2:], "error": [rounded[-3]]}
    why = (
        f"inputs of the last {rounded[-1]:g} s ({PAST:g} sqrt(L / g)): what ship and orders did, and what the physics "
        "got wrong; validation chooses how much of it is taken. The first instants of a run have no past: left out"
    )
    return Choice("method", [{"name": "memory", "kind": "path-drawn", "choose": True, "memory": memory}], why)


def _past(method: Choice) -> float:
    """Longest past [s] that a method of `_method` reads; 0 without a memory."""
    return float(max(method.value[0].get("memory", {}).get("turned", [0.0])))


def _truth(
    named: str, controls: Controls, service: float, rpm: float, horizon: float, step: float, past: float
) -> Iterator[Choice]:
    vessel = controls.vessel
    length = vessel.length or 0.0
    fine = min(_round_down(length / service / STEPS_A_LENGTH), step / 10)
    waves = any(key.startswith("waves.") for _, key, _ in term_blocks(vessel.document))
    calm = "in calm water: a table [truth.waves] with H_s and T_p draws a sea for the [waves] of the vessel"
    yield Choice("truth.vessel", named, calm if waves else "")
    yield Choice("truth.manoeuvres", MANOEUVRES, f"{MANOEUVRES - TESTS} for training, {TESTS} for the test")
    if past:
        yield Choice("truth.run_up", past, "s before the first instant of prediction: the past of the memory")
    yield Choice("truth.duration", float(f"{horizon + INSTANTS * step:.6g}"), f"s: {INSTANTS} instants and the horizon")
    yield Choice("truth.step", fine, f"s: the ship takes {length / service:.3g} s for its length")
    yield Choice("truth.interval", step, "s between logged rows")
    weather = dynamics(vessel).environment
    if "V_w" in weather:
        yield wind_for(length)
    yield _turning(controls, service, rpm)


def wind_for(length: float) -> Choice:
    """Wind for a ship of a length [m]: WIND, on a ship shorter than WIND_LENGTH by Froude's rule, and why.

    V = WIND sqrt(L / WIND_LENGTH): as hard for her as the wind of the bundled studies is for their ship.
    """
    if length >= WIND_LENGTH:
        return Choice("truth.wind_speed", [0.0, WIND], "m/s, from anywhere: up to a moderate breeze")
    speed = float(f"{WIND * (length / WIND_LENGTH) ** 0.5:.2g}")
    why = f"{WIND:g} m/s on a ship of {WIND_LENGTH:g} m (R/V Gunnerus in the bundled studies), by Froude's rule"
    return Choice("truth.wind_speed", [0.0, speed], f"m/s, from anywhere: {why} (sqrt of length) on {length:.3g} m")


def _turning(controls: Controls, service: float, rpm: float) -> Choice:
    """Turns with constant orders; each shaft, or angle, has its own where they steer by their difference.

    A shaft that does not drive her ahead, such as that of a tunnel thruster, rests.
    """
    low, high = float(f"{rpm / 2:.3g}"), float(f"{rpm:.3g}")
    drives, helm = controls.effects
    signs = {(signal_of(name), sign) for name, sign in helm.items()}
    apart = {signal for signal, sign in signs if (signal, -sign) in signs}  # at both ends: one angle drives her aside
    orders: dict[str, Any] = {}
    resting = [name for name in controls.commands if is_shaft(name) and name not in drives]
    for name in controls.commands:
        row = SIGNALS[signal_of(name)]
        usual = [value / row.factor for value in row.usual]
        limits = [low, high] if is_shaft(name) else [-HELM_DEG, HELM_DEG] if steers(name) else usual
        single, common = order_keys(name)
        if name in resting:
            orders[single] = 0.0
        elif controls.differential and name in drives:
            orders[single] = [0.0, high]
        else:
            orders[single if signal_of(name) in apart else common] = limits
    speeds = [float(f"{service / 2:.3g}"), float(f"{service:.3g}")]
    turned = "each shaft apart: their difference turns her" if controls.differential else "and hard over either way"
    turned += ", each angle apart: units at both ends turn her by their difference" if apart else ""
    turned += f"; what does not drive her ahead rests: {', '.join(resting)}" if resting else ""
    why = f"constant orders: up to {high:g} rpm, which hold {service:.3g} m/s in calm water, {turned}"
    return Choice("truth.manoeuvre", [{"kind": "turning", **orders, "start_speed": speeds}], why)


def _degraded(named: str, vessel: Vessel) -> list[Any]:
    """Nominal, moderate and high: the families of experiment 1 (method, section 4), as far as the vessel has them."""
    hull = [path for path in vessel.parameters if path.startswith("hull.")]
    drag = [path for path in hull if path.rpartition(".")[2] in DRAG]
    damping = ["hull.*[order >= 1]", *drag] if any(order_of(path) for path in hull) else _shapeless(hull)
    heavy = [path for path in INERTIA if path in vessel.parameters]
    if not damping:
        raise ShipidError("has no [hull] numbers to degrade: declare families by hand", file=vessel.file)
    blocks = [{"parameters": damping, "factor": [0.4, 1.6]}]
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
            "members": MEMBERS["moderate"],
            "seed": 1,
            "perturb": blocks,
        },
        {
            "name": "high",
            "description": "as moderate, and mass, yaw inertia and added mass times factors in 0.6-1.4",
            "extends": "moderate",
            "members": MEMBERS["high"],
            "seed": 2,
            "perturb": [{"parameters": heavy, "factor": [0.6, 1.4]}],
        },
    ]


def _shapeless(paths: Sequence[str]) -> list[str]:
    """Paths of coefficients, without those of geometry and of the water."""
    return [path for path in paths if path.rpartition(".")[2] not in ("x_aft", "x_fwd", *SHARED)]


def _text(choices: Sequence[Choice], families: Sequence[Mapping[str, Any]], warnings: Sequence[str] = ()) -> str:
    """The study as TOML, each reason above its value."""
    document = tomlkit.document()
    document.add(
        tomlkit.comment("Written by `shipid study new`. Above each value is its reason. Change what you know better.")
    )
    for line in (line for warning in warnings for line in textwrap.wrap(f"WRONG? {warning}", 110)):
        document.add(tomlkit.comment(line))
    tables: dict[str, Table] = {}
    for choice in choices:
        if choice.path == "method":
            continue
        block, _, key = choice.path.rpartition(".")
        place: Any = document
        if block:
            if block not in tables:
                document.add(tomlkit.nl())
                tables[block] = tomlkit.table()
                document.add(block, tables[block])
            place = tables[block]
        for line in textwrap.wrap(choice.why, 110):
            place.add(tomlkit.comment(line))
        place.add(key, choice.value)
    text = tomlkit.dumps(document).rstrip("\n")
    methods = [choice for choice in choices if choice.path == "method"]
    return "\n".join([text, "", *_method_lines(methods), *_family_lines(families)]) + "\n"


def _method_lines(choices: Sequence[Choice]) -> Iterator[str]:
    for choice in choices:
        yield from (f"# {line}" for line in textwrap.wrap(choice.why, 110))
        for method in choice.value:
            yield "[[method]]"
            yield from _pairs(method)
            yield ""


def _family_lines(families: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    yield "# Models, each compensated by data; `none`, without physics, and constant u, v, r are beside them all."
    for family in families:
        yield "[[family]]"
        yield from _pairs({key: value for key, value in family.items() if key != "perturb"})
        for block in family.get("perturb", []):
            yield "[[family.perturb]]"
            yield from _pairs(block)
        yield ""


def _pairs(block: Mapping[str, Any]) -> Iterator[str]:
    for key, value in block.items():
        if isinstance(value, Mapping):
            table = tomlkit.inline_table()
            table.update(value)
            yield f"{key} = {table.as_string()}"
            continue
        yield f"{key} = {tomlkit.item(value).as_string()}"


def _named(name: str, out: Path) -> str:
    """A vessel as the study names it: a bundled name as it is, a path from the study's folder."""
    return _relative(name, out) if "/" in name or "\\" in name or name.endswith(".toml") else name


def _relative(name: str, out: Path) -> str:
    path = Path(os.path.relpath(name, out.parent)).as_posix()
    return path if "/" in path or path.endswith((".toml", ".parquet")) else f"./{path}"


def _round_down(value: float) -> float:
    """Greatest of 1, 2, 5 and their tens, up to a value."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(f"{max(step * decade for step in (1, 2, 5) if step * decade <= value * (1 + 1e-9)):.6g}")


def _round_up(value: float) -> float:
    below = _round_down(value)
    return below if below >= value else _round_down(2.5 * below)
