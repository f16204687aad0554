"""Checks of a dataset: one row per run and check, each with a value, a limit and a sentence."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.arguments import check_class
from shipid.data.dataset import (
    Array,
    Dataset,
    clock_slack,
    cumulative_integral,
    shares_clock,
    stretches_by_run,
    stretches_of_runs,
    travelled_position,
    unit_of_column,
)
from shipid.errors import DataError
from shipid.physics.signals import signal_row
from shipid.units import DEGREE, join_names, plural_word

RowMask = NDArray[np.bool_]
Plane = NDArray[np.complex128]

STUCK_SECONDS, STUCK_REPEATS = 4.5, 4.0  # s; times the usual repetition, at least
MISSED_TURN, MISSED_WAY = np.radians(6.0), 0.02  # rad; share of the way: IMO MSC.96(72) allows a log 2 %
MISSED_STEPS = 2.0  # large steps of a position


def stuck_spans(
    name: str, t: Array, values: Array, pose: tuple[Array, Plane], rates: tuple[Array, Plane], follows: RowMask
) -> list[tuple[int, int]]:
    """First and last row of each stretch in which a sensor repeats one value and the others say that it cannot.

    name : psi, r, course or speed, of which values (N,) are readings at t [s]. pose : psi [rad] without jumps, and
    position, north + i east [m]. rates : r [rad/s], and velocity over ground [m/s]. follows : (N - 1,)
    whether nothing is missing between a row and the next.
    """
    edges = np.flatnonzero(np.concatenate([[True], (np.diff(values) != 0) | ~follows, [True]]))
    lengths = np.diff(edges)
    long = lengths >= STUCK_REPEATS * np.median(np.repeat(lengths, lengths))
    first, last = edges[:-1][long], edges[1:][long] - 1
    turned = cumulative_integral(t, rates[0])
    missed, least = {"psi": turned, "r": pose[0] - turned}.get(name, pose[0]), np.array(MISSED_TURN)
    if name == "speed":
        speed, steps = np.abs(rates[1]), np.diff(pose[1])
        ahead = steps * np.exp(-1j * np.angle(rates[1][1:]))  # noise of a position makes no way
        missed = np.append(0.0, np.cumsum(ahead.real)) - cumulative_integral(t, speed)
        digit = np.median(np.abs(np.diff(speed))[np.diff(values) != 0]) if len(lengths) > 1 else 0.0
        least = (MISSED_WAY * speed[first] + digit) * (t[last] - t[first])
        least += MISSED_STEPS * np.percentile(np.abs(steps), 95)
    off = np.array([np.ptp(missed[a : b + 1]) for a, b in zip(first, last, strict=True)])
    stuck = (t[last] - t[first] >= STUCK_SECONDS) & (off > least)
    return list(zip(first[stuck].tolist(), last[stuck].tolist(), strict=True))


GAP_STEPS = 3.0  # usual steps: a longer one is a time without rows
JITTER_LIMIT, FROZEN_LIMIT, OVERLAP_LIMIT = 0.05, 0.02, 0.5
ROUGHNESS_RATIO = 1.2  # times, on an uneven clock or on an even one: this one is wrong, by more than the noise hides
DRIFT_SECONDS = 30.0
TURN_RATIO = 6.0  # far from 1, and from the 57 of degrees taken for radians
ALIKE_TURNS = 0.9  # least correlation of turns by r and by the heading
FEEDBACK_NOISE = {True: 0.5 * DEGREE, False: 0.01}
"""Standard deviation that counts as none, of angles [rad] and as a share of others: assumed for measured feedback."""
KICK_SIZE = 4.0  # times this noise: a departure that is an order, where it lasts
# Seconds between the rows around a departure, and share of rows: below, faulty rows and no order.
SPIKE_SECONDS, SPIKE_SHARE = 3.0, 1e-3


def check_dataset(dataset: Dataset) -> pd.DataFrame:
    """Check every run of a dataset: its clock, plausible ranges, rows that are frozen or of two runs.

    Returns a table with columns `check`, `run`, `value`, `unit`, `limit`, `ok`, `sentence`. A check reports what is
    suspicious; it changes nothing. Whether its signals are one motion says `shipid.identification.diagnosis`.
    Raises DataError for what is no dataset.
    """
    check_class("dataset", dataset, Dataset, "as of `read_dataset`", DataError)
    by_run = stretches_by_run(dataset)
    motions = {run: _motion(stretches) for run, stretches in by_run.items()}
    table = [
        {"run": run, **row}
        for run, stretches in by_run.items()
        for row in (
            *_check_clock(stretches),
            *_check_ranges(stretches),
            _check_frozen(stretches),
            _check_overlap(run, motions, shares_clock(dataset)),
        )
    ]
    return pd.DataFrame(table)[["check", "run", "value", "unit", "limit", "ok", "sentence"]]


def _check_row(
    check: str, value: float, unit: str, limit: float, sentence: str, ok: bool | None = None
) -> dict[str, Any]:
    passed = value <= limit if ok is None else ok
    return {"check": check, "value": value, "unit": unit, "limit": limit, "ok": bool(passed), "sentence": sentence}


def _check_clock(stretches: list[pd.DataFrame]) -> Iterator[dict[str, Any]]:
    steps = np.concatenate([np.diff(rows["t"]) for rows in stretches])
    if not len(steps):
        yield _check_row("gap", 0.0, "s", 0.0, "a single row", ok=False)
        return
    usual, longest = float(np.median(steps)), float(steps.max())
    slack = max(clock_slack(rows["t"].to_numpy()) for rows in stretches)
    yield _check_row(
        "gap",
        longest,
        "s",
        GAP_STEPS * usual + slack,
        f"the longest step is {longest:.3g} s, the usual one {usual:.3g} s",
    )
    jitter = float(np.std(steps)) / usual
    even = jitter <= JITTER_LIMIT
    fits = even or (longest <= GAP_STEPS * usual + slack and _clock_fits_motion(stretches))
    words = "" if even else "; are the times those of the samples, or of their arrival?"
    words = "; positions and heading bear them out" if fits and not even else words
    sentence = f"steps differ from {usual:.3g} s by {100 * jitter:.2g} % (RMS){words}"
    yield _check_row("jitter", jitter, "1", JITTER_LIMIT, sentence, ok=fits)


def _clock_fits_motion(stretches: list[pd.DataFrame]) -> bool:
    """Whether positions or heading are smoother on their clock than on one with even steps, and neither is rougher."""
    ratios = []
    for names in (("north", "east"), ("psi",)):
        columns = [(rows, name) for rows in stretches if len(rows) >= 5 for name in names]
        uneven, even = (
            float(np.sum([_roughness_on_clock(rows, name, clock) ** 2 for rows, name in columns]))
            for clock in (True, False)
        )
        ratios.append(np.sqrt(uneven / even) if even else 1.0)
    return bool(ratios and max(ratios) <= ROUGHNESS_RATIO and min(ratios) < 1 / ROUGHNESS_RATIO)


def _roughness_on_clock(rows: pd.DataFrame, name: str, clock: bool) -> float:
    """Median distance of the values of a column from the line between their neighbours, by the clock or even steps."""
    values, t = rows[name].to_numpy(), rows["t"].to_numpy()
    values = np.unwrap(values) if name == "psi" else values
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2]) if clock else 0.5
    return float(np.median(np.abs(values[1:-1] - (1 - share) * values[:-2] - share * values[2:])))


def _check_ranges(stretches: list[pd.DataFrame]) -> Iterator[dict[str, Any]]:
    """Whether values are plausible."""
    for name in map(str, stretches[0].columns):
        row = signal_row(name)
        if row is not None and row.plausible is not None:
            largest = max(float(rows[name].abs().max()) for rows in stretches)
            unit, limit = unit_of_column(name) or "", row.plausible
            sentence = f"{name} reaches {largest:.3g} {unit}: right unit?"
            if name == "r" and (times := _turn_ratio(stretches)) > TURN_RATIO:
                sentence, limit = f"r is {times:.3g} times as fast as the heading turns: right unit?", largest / times
            yield _check_row(f"range {name}", largest, unit, limit, sentence)


def _turn_ratio(stretches: list[pd.DataFrame]) -> float:
    """How many times as fast as the heading r turns, by what both leave of a line in time; 1 where they are not alike.

    A bias of r is such a line. A heading that turns a quarter of a circle in a step says nothing.
    """
    products = np.zeros((2, 2))
    for rows in stretches:
        t, psi, r = (rows[name].to_numpy() for name in ("t", "psi", "r"))
        turned = np.unwrap(psi)
        if len(t) > 2 and np.abs(np.diff(turned)).max() < np.pi / 2:
            turns = np.stack([cumulative_integral(t, r), turned], axis=1)
            line = np.stack([np.ones(len(t)), t - t.mean()], axis=1)
            turns -= line @ np.linalg.lstsq(line, turns)[0]
            products += turns.T @ turns
    (by_rate, both), (_, by_heading) = products
    return float(both / by_heading) if both > ALIKE_TURNS * (by_rate * by_heading) ** 0.5 else 1.0


def white_noise_of(*stretches: Array) -> float:
    """Standard deviation of the white noise of a smooth signal in stretches (N,), from its second differences.

    E (x[i-1] - 2 x[i] + x[i+1])^2 = 6 sigma^2 for a signal that is straight over three rows; what curves adds to it, so
    that the noise is rather too large. The median, 0.6745 sigma of normal values, makes jumps count little.
    """
    second = np.concatenate([np.diff(one, 2) for one in stretches])
    return float(np.median(np.abs(second))) / 0.6745 / 6**0.5 if len(second) > 2 else 0.0


def way_not_travelled(rows: pd.DataFrame) -> Plane:
    """Positions of a stretch less the integral of u, v, psi from its first row, north + i east [m]."""
    north, east = travelled_position(rows, rows["t"].to_numpy())
    return (rows["north"] - north + 1j * (rows["east"] - east)).to_numpy()


def _drift_of_positions(rows: pd.DataFrame) -> Array:
    """Distance [m] between positions and integrated velocities, which start together every 30 s, (N,)."""
    t = rows["t"].to_numpy()
    part = np.floor((t - t[0]) / DRIFT_SECONDS + 1e-9).astype(int)
    start = np.flatnonzero(np.diff(part, prepend=-1))[np.cumsum(np.diff(part, prepend=-1) > 0) - 1]
    error = way_not_travelled(rows)
    return np.asarray(np.abs(error - error[start]))


def check_series(dataset: Dataset) -> pd.DataFrame:
    """Signals that the checks of motion compare: run, t [s], r and psi_rate [rad/s], drift [m], u, v [m/s]."""
    parts = []
    for run, rows in stretches_of_runs(dataset):
        t = rows["t"].to_numpy()
        rate = np.gradient(np.unwrap(rows["psi"]), t) if len(t) > 2 else np.full(len(t), np.nan)
        parts.append(rows[["t", "r", "u", "v"]].assign(run=run, psi_rate=rate, drift=_drift_of_positions(rows)))
    return pd.concat(parts, ignore_index=True)


@dataclass(frozen=True)
class _Motion:
    """A run to compare with others: t [s] and a key of the motion, each (N,); whether it moves in most rows."""

    t: Array
    keys: np.ndarray[Any, np.dtype[np.integer[Any]]]
    lively: bool


def _motion(stretches: list[pd.DataFrame]) -> _Motion:
    rows = pd.concat(stretches)
    values = rows[["psi", "u", "v", "r"]].round(9)
    lively = (values.diff() != 0).all(axis=1).to_numpy()  # a ship at rest, or held steady, is the same everywhere
    keys = pd.util.hash_pandas_object(values, index=False).to_numpy()
    return _Motion(rows["t"].to_numpy(), keys, bool(lively.sum() >= 0.5 * len(rows)))


def _check_frozen(stretches: list[pd.DataFrame]) -> dict[str, Any]:
    """Largest share of the rows that repeat the row before: all of its motion, or one signal that others contradict."""
    states, counts = ["north", "east", "psi", "u", "v", "r"], Counter[str]({"motion": 0})
    for rows in stretches:
        t, north, east, psi, u, v, r = (rows[name].to_numpy() for name in ("t", *states))
        velocity, psi = (u + 1j * v) * np.exp(1j * psi), np.unwrap(psi)
        course = np.where(velocity == 0.0, psi, np.angle(velocity)).round(9)
        seen = {"psi": psi, "r": r, "course": course, "speed": np.abs(velocity).round(9)}
        counts["motion"] += int((rows[states].diff().iloc[1:] == 0).all(axis=1).sum())
        for name, values in seen.items():
            pose, rates = (psi, north + 1j * east), (r, velocity)
            spans = stuck_spans(name, t, values, pose, rates, np.ones(len(t) - 1, dtype=bool))
            counts[name] += sum(last - first for first, last in spans)
    ((name, count),) = counts.most_common(1)
    frozen = count / max(sum(len(rows) - 1 for rows in stretches), 1)
    words = "" if name == "motion" else ", which the other signals contradict"
    sentence = f"{100 * frozen:.3g} % of the rows repeat the {name} of the row before{words}"
    return _check_row("frozen", frozen, "1", FROZEN_LIMIT, sentence)


def _check_overlap(run: str, motions: Mapping[str, _Motion], shared: bool) -> dict[str, Any]:
    """Share of the rows of a run that another run has, too."""
    others = ((_share_in_other_run(motions[run], one, shared), name) for name, one in motions.items() if name != run)
    double, other = max(others, default=(0.0, ""))
    where = f", most in {other!r}" if double > 0 else ""
    sentence = f"{100 * double:.3g} % of the rows belong to another run, too{where}"
    return _check_row("overlap", double, "1", OVERLAP_LIMIT, sentence)


def copies_of_earlier_runs(dataset: Dataset, runs: Iterable[str]) -> dict[str, str]:
    """Runs, and the one before them with their motion in most rows: recorded twice, or cut from one log twice."""
    motions = {run: _motion(parts) for run, parts in stretches_by_run(dataset).items()}
    known, earlier, found = set[Any](), list[str](), dict[str, str]()
    for run in runs:
        keys = motions[run].keys.tolist()
        if earlier and sum(key in known for key in keys) >= OVERLAP_LIMIT * len(keys):  # only then one by one
            share, other = max((_share_of_same_motion(motions[run], motions[name]), name) for name in earlier)
            found |= {run: other} if share >= OVERLAP_LIMIT else {}
        earlier.append(run)
        known.update(keys)
    return found


def _share_in_other_run(mine: _Motion, other: _Motion, shared: bool) -> float:
    """Share of the rows of a run that another run has, too: the same instants of one clock, or the same motion."""
    same = float(np.mean(np.isin(mine.t, other.t))) if shared else 0.0
    return max(same, _share_of_same_motion(mine, other))


def _share_of_same_motion(mine: _Motion, other: _Motion) -> float:
    """Share of the rows of a run that have the motion of a row of another run."""
    return float(np.mean(np.isin(mine.keys, other.keys))) if mine.lively else 0.0


def constant_commands(dataset: Dataset, runs: Iterable[str]) -> tuple[str, ...]:
    """Commands that are the same in every row of some runs, but for measuring noise and a faulty row in a thousand.

    One that varies in one run varies, also where that is for a few seconds of a long run.
    """
    frame = dataset.frame[dataset.frame["run"].isin(list(runs))]
    by_run, held = frame.groupby("run", sort=False), []
    for name in dataset.commands:
        usual = by_run[name].median()
        row = signal_row(name)
        angle = row is not None and row.angle
        noise = FEEDBACK_NOISE[angle] * (1.0 if angle else float(usual.abs().max()))
        if (
            len(usual)
            and np.ptp(usual) <= noise
            and all(_is_constant(run["t"].to_numpy(float), run[name].to_numpy(float), noise) for _, run in by_run)
        ):
            held.append(name)
    return tuple(held)


def _is_constant(t: Array, values: Array, noise: float) -> bool:
    """Whether a command is the same in every row of a run; t, values : its rows; noise : standard deviation."""
    far = np.abs(values - np.median(values)) > KICK_SIZE * noise
    first, behind = np.flatnonzero(np.diff(far, prepend=False, append=False)).reshape(-1, 2).T
    lasting = t[np.minimum(behind, len(t) - 1)] - t[np.maximum(first - 1, 0)]
    return bool(far.mean() <= SPIKE_SHARE and (lasting < SPIKE_SECONDS).all() and values[~far].std() <= noise)


def warn_of_constant_commands(dataset: Dataset, runs: Iterable[str]) -> list[str]:
    """A sentence where some runs vary no command at all; none where they vary one, as ships at one shaft speed do."""
    runs = list(runs)
    held = constant_commands(dataset, runs)
    if not held or len(held) < len(dataset.commands):
        return []
    are, do = plural_word(len(held), "is", "are"), plural_word(len(held), "it does", "they do")
    where = f"in all {len(runs)} runs" if len(runs) > 1 else "throughout the only run"
    return [
        f"{join_names(held)} {are} the same {where}: what {do} cannot be learnt from this log, nor can damping be told "
        "from the force that steers, or resistance from thrust"
    ]
