"""Checks of a dataset: one row per run and check, each with a value, a limit and a sentence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from shipid.arguments import check_class
from shipid.data.dataset import (
    Array,
    Dataset,
    clock_slack,
    cumulative_integral,
    shares_clock,
    stretches_by_run,
    stretches_of_runs,
    unit_of_column,
)
from shipid.errors import DataError
from shipid.physics.signals import signal_row

Plane = np.ndarray[Any, np.dtype[np.complex128]]

GAP_STEPS = 3.0  # usual steps: a longer one is a time without rows
JITTER_LIMIT, FROZEN_LIMIT, OVERLAP_LIMIT = 0.05, 0.02, 0.5
ROUGHNESS_RATIO = 1.2  # times, on an uneven clock or on an even one: this one is wrong, by more than the noise hides
SCALE_ERROR, HEADING_ERROR, PATH_ERROR = 0.1, 0.25, 0.05
LEAST_YAW_RATE = np.radians(0.2)  # rms of r under which a run is too straight to compare headings
DRIFT_SECONDS, WINDOW_SECONDS = 30.0, 10.0  # s
STANDARD_ERRORS = 4.0  # standard errors beyond which a difference is no chance: one clean run in some ten thousand
ROUNDING_OF_CHANGE = 1e-4  # of a change: a smaller misfit is none
LEAST_DELAY, LONGEST_DELAY, DELAY_SHARE = (
    0.3,
    3.0,
    0.35,
)  # s: least delay reported, longest tried; share of the misfit it explains
LEAST_DELAY_WINDOWS, MOST_DELAY_WINDOWS = 20, 5000  # windows that show a delay
LEAST_CHANGE, SPIKE_MISFIT = 0.1, 6.0  # of the larger changes: less says nothing; of the usual misfit: more is a spike


def check_dataset(dataset: Dataset) -> pd.DataFrame:
    """Check every run of a dataset against the clock, plausible ranges and the laws of plane motion.

    Returns a table with columns `check`, `run`, `value`, `unit`, `limit`, `ok`, `sentence`. A check reports what is
    suspicious; it changes nothing. Limits are engineering judgement, and widened by what the noise of the log makes.
    Raises DataError for what is no dataset.
    """
    check_class("dataset", dataset, Dataset, "as of `read_dataset`", DataError)
    by_run = stretches_by_run(dataset)
    motions = {run: _motion(stretches) for run, stretches in by_run.items()}
    table = []
    for run, stretches in by_run.items():
        heading = [*_check_heading(stretches)]
        rate_is_right = any(row["check"] == "heading scale" and row["ok"] and row["value"] for row in heading)
        table += [
            {"run": run, **row}
            for row in (
                *_check_clock(stretches),
                *_check_ranges(stretches, {"r"} if rate_is_right else set()),
                *heading,
                *_check_path(stretches),
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


def _check_ranges(stretches: list[pd.DataFrame], proved: set[str]) -> Iterator[dict[str, Any]]:
    """Whether values are plausible; those that others prove are, however large."""
    for name in map(str, stretches[0].columns):
        row = signal_row(name)
        if row is not None and row.plausible is not None:
            largest = max(float(rows[name].abs().max()) for rows in stretches)
            unit = unit_of_column(name) or ""
            sentence = f"{name} reaches {largest:.3g} {unit}" + ("" if name in proved else ": right unit?")
            yield _check_row(f"range {name}", largest, unit, row.plausible, sentence, ok=name in proved or None)


def white_noise_of(values: Array) -> float:
    """Standard deviation of the white noise of a smooth signal (N,), from its second differences.

    E (x[i-1] - 2 x[i] + x[i+1])^2 = 6 sigma^2 for a signal that is straight over three rows; what curves adds to it, so
    that the noise is rather too large. The median makes jumps count little.
    """
    if len(values) < 5:
        return 0.0
    return float(np.median(np.abs(np.diff(values, 2))) / (0.6745 * np.sqrt(6.0)))


def _compare_turning(stretches: list[pd.DataFrame]) -> tuple[Array, Array, Array]:
    """Changes of heading and integrals of r over windows (K,) [rad], and the standard deviation of their difference."""
    seen, integrated, errors = [], [], []
    for rows in stretches:
        t, psi, r = (rows[name].to_numpy() for name in ("t", "psi", "r"))
        psi = np.unwrap(psi)
        if len(t) < 5:
            continue
        usual = float(np.median(np.diff(t)))
        width = max(4, min(round(WINDOW_SECONDS / usual), (len(t) - 1) // 4))
        edges = np.arange(0, len(t), width)
        total = cumulative_integral(t, r)
        seen.append(np.diff(psi[edges]))
        integrated.append(np.diff(total[edges]))
        # noise of both ends, noise of the rate, and what the trapezoid rule leaves of its curvature
        curvature = float(np.sqrt(np.mean(np.diff(r, 2) ** 2)))
        variance = (
            2 * white_noise_of(psi) ** 2
            + width * (usual * white_noise_of(r)) ** 2
            + width * (usual * curvature / 12) ** 2
        )
        errors.append(np.full(len(edges) - 1, np.sqrt(variance)))
    joined = [np.concatenate([np.empty(0), *parts]) for parts in (seen, integrated, errors)]
    return joined[0], joined[1], joined[2]


def _check_heading(stretches: list[pd.DataFrame]) -> Iterator[dict[str, Any]]:
    """Changes of psi over windows against the integral of r: scale, and the difference beyond the noise.

    A difference is reported where it is large and not made by noise: neither a noisy log in good order nor a small
    error of an exact one fails.
    """
    turned, integrated, errors = _compare_turning(stretches)
    if len(turned) < 2:
        return
    size = root_mean_square(np.concatenate([rows["r"].to_numpy() for rows in stretches]))
    change = root_mean_square(turned)
    if max(size, change / WINDOW_SECONDS) < LEAST_YAW_RATE:
        yield _check_row("heading scale", 0.0, "1", 0.0, "too straight to compare heading and rate", ok=True)
        return
    error, noise = turned - integrated, root_mean_square(errors)
    chance = noise * np.sqrt(1 + STANDARD_ERRORS * np.sqrt(2 / len(error)))  # of a mean square of so many
    power = float(np.sum(integrated**2)) or 1.0
    scale = float(np.sum(turned * integrated)) / power
    spread = root_mean_square(turned - scale * integrated) / np.sqrt(power)
    words = "; wrong sign of r or psi?" if scale < 0 else "; degrees or another unit?"
    sentence = f"changes of psi are {scale:.3f} +- {spread:.2g} times the integral of r{words}"
    limit = SCALE_ERROR + STANDARD_ERRORS * spread
    yield _check_row(
        "heading scale", scale, "1", limit, sentence, ok=root_mean_square(error) <= chance or abs(scale - 1) <= limit
    )
    off, by_noise = np.degrees(root_mean_square(error)), np.degrees(noise)
    sentence = f"changes of psi leave the integral of r by {off:.2g} deg (RMS), {by_noise:.2g} by noise"
    yield _check_row("heading error", root_mean_square(error), "rad", HEADING_ERROR * change + chance, sentence)
    seen = [np.unwrap(rows["psi"]).astype(complex) for rows in stretches]
    total = [cumulative_integral(rows["t"].to_numpy(), rows["r"].to_numpy()).astype(complex) for rows in stretches]
    yield from _check_latency("heading latency", "heading", "yaw rate", stretches, seen, total)


def travelled_path(rows: pd.DataFrame) -> Plane:
    """Integral of u, v, psi from the first row of a stretch, north + i east [m]."""
    t, psi, u, v = (rows[name].to_numpy() for name in ("t", "psi", "u", "v"))
    rate = (u + 1j * v) * np.exp(1j * psi)
    return cumulative_integral(t, rate.real) + 1j * cumulative_integral(t, rate.imag)


def _check_latency(
    check: str, what: str, against: str, stretches: list[pd.DataFrame], seen: list[Plane], integrated: list[Plane]
) -> Iterator[dict[str, Any]]:
    delay = measure_delay(zip((rows["t"].to_numpy() for rows in stretches), seen, integrated, strict=True))
    if delay is not None:
        yield _check_row(check, abs(delay.seconds), "s", delay.limit, delay.said(what, against)[1])


@dataclass(frozen=True)
class Delay:
    """Delay of a signal behind the integral of its rate.

    seconds, limit : the delay [s], 0 where none is sure, and the least one that counts. explained : share (0 to 1) of
    the misfit that it explains.
    """

    seconds: float
    limit: float
    explained: float

    def said(self, what: str, against: str) -> tuple[str, str]:
        """Which of the signal `what` and the rate `against` is late, and the sentence that says so."""
        late, other = (what, against) if self.seconds >= 0 else (against, what)
        by = f"{abs(self.seconds):.2g} s later than the {other} says ({100 * self.explained:.0f} % of the misfit)"
        return late, f"{late} comes {by}"


def measure_delay(stretches: Iterable[tuple[Array, Plane, Plane]]) -> Delay | None:
    """Delay at which changes of a signal over windows fit those of an integral times any scale; None for few windows.

    stretches : t (N,) [s] without a hole, signal and integral of its rate (N,). A delay is sure if it explains much of
    the misfit, and more than noise does. Windows that fit at no delay, as those with a spike, are left out.
    """
    stretches = [one for one in stretches if len(one[0]) >= 8]
    usual = max((float(np.median(np.diff(t))) for t, _, _ in stretches), default=1.0)
    longest = max(LONGEST_DELAY, 3 * usual)
    none = round(longest / max(usual / 2, longest / 24))
    delays = np.linspace(-longest, longest, 2 * none + 1)
    changes, integrals, variances = [np.empty(0, complex)], [np.empty((len(delays), 0), complex)], [np.empty(0)]
    least = max(usual, sum(t[-1] - t[0] for t, _, _ in stretches) / MOST_DELAY_WINDOWS)
    for t, signal, total in stretches:
        width = min(max(WINDOW_SECONDS, 4 * usual), (t[-1] - t[0]) / 6)
        first = np.arange(t[0] + longest, t[-1] - longest - width, max(width / 4, least))
        changes.append(np.interp(first + width, t, signal) - np.interp(first, t, signal))
        moved = [np.interp(first + width - delay, t, total) - np.interp(first - delay, t, total) for delay in delays]
        integrals.append(np.array(moved))
        variances.append(np.full(len(first), 2 * (white_noise_of(signal.real) ** 2 + white_noise_of(signal.imag) ** 2)))
    change, integrated = np.concatenate(changes), np.concatenate(integrals, axis=1)
    if len(change) < LEAST_DELAY_WINDOWS:
        return None
    misfit, size = _misfit(change, integrated), np.abs(integrated[none])
    moving = size >= LEAST_CHANGE * np.percentile(size, 90)
    keep = (misfit <= SPIKE_MISFIT * np.median(misfit[:, moving], axis=1, keepdims=True) + 1e-9).any(axis=0)
    left = (_misfit(change[keep], integrated[:, keep]) ** 2).sum(axis=1)
    noise, best = float(np.concatenate(variances)[keep].sum()), int(np.argmin(left))
    gain = float(left[none] - left[best])
    explained = gain / float(left[none]) if gain > 0 else 0.0
    # without a delay both misfits are noise, of the log or of its digits, and differ by its scatter alone
    chance = STANDARD_ERRORS * noise * np.sqrt(2 / keep.sum()) + ROUNDING_OF_CHANGE**2 * float(
        np.sum(np.abs(change[keep]) ** 2)
    )
    sure = gain > chance and left[none] > 2 * noise and explained > DELAY_SHARE
    return Delay(float(delays[best]) if sure else 0.0, max(LEAST_DELAY, 0.75 * usual), explained)


def _misfit(change: Plane, integrated: Plane) -> Array:
    """Distance (D, W) of changes (W,) from those of integrals (D, W) times the scale, 0 or more, that fits best."""
    power = np.maximum((np.abs(integrated) ** 2).sum(axis=1), 1e-30)
    scale = np.maximum((integrated.conj() * change).real.sum(axis=1), 0.0)
    return np.asarray(np.abs(change - (scale / power)[:, None] * integrated))


def _check_path(stretches: list[pd.DataFrame]) -> Iterator[dict[str, Any]]:
    """RMS distance between positions and integrated u, v, psi over stretches of 30 s that start together."""
    speeds = [np.hypot(rows["u"].to_numpy(), rows["v"].to_numpy()) for rows in stretches]
    lengths = [
        cumulative_integral(rows["t"].to_numpy(), speed)[-1] for rows, speed in zip(stretches, speeds, strict=True)
    ]
    error = root_mean_square(np.concatenate([_drift_of_positions(rows) for rows in stretches]))
    duration = sum(float(rows["t"].iloc[-1] - rows["t"].iloc[0]) for rows in stretches)
    distance = sum(lengths) / duration * min(DRIFT_SECONDS, duration) if duration > 0 else 0.0
    noise = root_mean_square(
        np.array([_path_noise(rows, speed) for rows, speed in zip(stretches, speeds, strict=True)])
    )
    sentence = (
        f"positions leave integrated velocities by {error:.2g} m (RMS) in {DRIFT_SECONDS:g} s, {distance:.3g} m run"
    )
    yield _check_row(
        "path", error, "m", PATH_ERROR * distance + STANDARD_ERRORS / 2 * noise, f"{sentence}; {noise:.2g} m by noise"
    )
    seen = [(rows["north"] + 1j * rows["east"]).to_numpy() for rows in stretches]
    yield from _check_latency(
        "path latency", "position", "velocity", stretches, seen, [travelled_path(rows) for rows in stretches]
    )


def _path_noise(rows: pd.DataFrame, speed: Array) -> float:
    """Distance [m] that the noise of position, velocities and heading makes over 30 s, RMS."""
    steps = np.diff(rows["t"])
    if len(steps) < 4:
        return 0.0
    step = float(np.median(steps))
    position, velocity = (
        sum(white_noise_of(rows[name].to_numpy()) ** 2 for name in pair) for pair in (("north", "east"), "uv")
    )
    heading = (float(np.mean(speed)) * white_noise_of(np.unwrap(rows["psi"]))) ** 2
    return float(np.sqrt(2 * position + DRIFT_SECONDS * step * (velocity + heading)))


def _drift_of_positions(rows: pd.DataFrame) -> Array:
    """Distance [m] between positions and integrated velocities, which start together every 30 s, (N,)."""
    t = rows["t"].to_numpy()
    part = np.floor((t - t[0]) / DRIFT_SECONDS + 1e-9).astype(int)
    start = np.flatnonzero(np.diff(part, prepend=-1))[np.cumsum(np.diff(part, prepend=-1) > 0) - 1]
    error = (rows["north"] + 1j * rows["east"]).to_numpy() - travelled_path(rows)
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
    """Share of the rows whose motion is that of the row before."""
    states = ["north", "east", "psi", "u", "v", "r"]
    same = np.concatenate([(rows[states].diff().iloc[1:] == 0).all(axis=1).to_numpy() for rows in stretches])
    frozen = float(same.mean()) if len(same) else 0.0
    return _check_row("frozen", frozen, "1", FROZEN_LIMIT, f"{100 * frozen:.3g} % of the rows repeat the row before")


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


def root_mean_square(values: Array) -> float:
    """Root mean square of values of any shape."""
    return float(np.sqrt(np.mean(values**2)))
