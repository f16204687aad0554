"""Checks of a dataset: one row per run and check, each with a value, a limit and a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from shipid.data.dataset import Array, Dataset, cumulative_integral, pieces, unit_of
from shipid.physics.signals import row_of

GAP, JITTER, FROZEN, OVERLAP = 3.0, 0.05, 0.02, 0.5
CORRELATION, SCALE_ERROR, RATE_ERROR, PATH_ERROR = 0.8, 0.1, 0.5, 0.05
TURNING = np.radians(0.2)  # rms of r under which a run is too straight to compare headings
STRETCH = 30.0


def check_dataset(dataset: Dataset) -> pd.DataFrame:
    """Check every run of a dataset against the clock, plausible ranges and the laws of plane motion.

    Returns a table with columns `check`, `run`, `value`, `unit`, `limit`, `ok`, `sentence`. A check reports what is
    suspicious; it changes nothing. Limits are engineering judgement, wide enough for a log in good order.
    """
    by_run: dict[str, list[pd.DataFrame]] = {}
    for run, rows in pieces(dataset):
        by_run.setdefault(run, []).append(rows)
    shared = dataset.metadata.get("clock", "shared") != "run"
    table = []
    for run, stretches in by_run.items():
        others = dataset.frame.loc[dataset.frame["run"] != run, "t"] if shared else pd.Series(dtype=float)
        results = [*_clock(stretches), *_ranges(stretches), *_heading(stretches), *_path(stretches)]
        table += [{"run": run, **row} for row in [*results, *_repetition(stretches, others)]]
    return pd.DataFrame(table)[["check", "run", "value", "unit", "limit", "ok", "sentence"]]


def _row(check: str, value: float, unit: str, limit: float, sentence: str, ok: bool | None = None) -> dict[str, Any]:
    passed = value <= limit if ok is None else ok
    return {"check": check, "value": value, "unit": unit, "limit": limit, "ok": bool(passed), "sentence": sentence}


def _clock(stretches: list[pd.DataFrame]) -> Iterator[dict[str, Any]]:
    steps = np.concatenate([np.diff(rows["t"]) for rows in stretches])
    if not len(steps):
        yield _row("gap", 0.0, "s", 0.0, "a single row", ok=False)
        return
    usual, longest = float(np.median(steps)), float(steps.max())
    yield _row("gap", longest, "s", GAP * usual, f"the longest step is {longest:.3g} s, the usual one {usual:.3g} s")
    jitter = float(np.sqrt(np.mean((steps - usual) ** 2))) / usual
    yield _row("jitter", jitter, "1", JITTER, f"steps differ from {usual:.3g} s by {100 * jitter:.2g} % (RMS)")


def _ranges(stretches: list[pd.DataFrame]) -> Iterator[dict[str, Any]]:
    for name in map(str, stretches[0].columns):
        row = row_of(name)
        if row is not None and row.plausible is not None:
            largest = max(float(rows[name].abs().max()) for rows in stretches)
            unit = unit_of(name) or ""
            yield _row(
                f"range {name}", largest, unit, row.plausible, f"{name} reaches {largest:.3g} {unit}: right unit?"
            )


def _heading(stretches: list[pd.DataFrame]) -> Iterator[dict[str, Any]]:
    """d(psi)/dt (central differences) against r: correlation, k of d(psi)/dt = k r by least squares, RMS difference."""
    long = [rows for rows in stretches if len(rows) > 2]
    if not long:
        return
    r = np.concatenate([rows["r"].to_numpy() for rows in long])
    rate = np.concatenate([np.gradient(np.unwrap(rows["psi"]), rows["t"].to_numpy()) for rows in long])
    size, error = _rms(r), _rms(rate - r)
    if max(size, _rms(rate)) < TURNING:
        yield _row("heading rate", 0.0, "1", 0.0, "too straight to compare heading and rate", ok=True)
        return
    product = float(np.mean(r * rate))
    correlation = product / (size * _rms(rate) or 1.0)  # not centred: a steady turn counts
    scale = product / (size**2 or 1.0)
    words = "; wrong sign of r or psi?" if correlation < 0 else ""
    sentence = f"d(psi)/dt and r correlate by {correlation:.3f}{words}"
    yield _row("heading rate", correlation, "1", CORRELATION, sentence, ok=correlation >= CORRELATION)
    sentence = f"d(psi)/dt is {scale:.3f} times r; degrees or another unit?"
    yield _row("heading scale", scale, "1", SCALE_ERROR, sentence, ok=abs(scale - 1) <= SCALE_ERROR)
    yield _row(
        "heading error", error, "rad/s", RATE_ERROR * size, f"d(psi)/dt - r is {np.degrees(error):.2g} deg/s (RMS)"
    )


def _path(stretches: list[pd.DataFrame]) -> Iterator[dict[str, Any]]:
    """RMS distance between positions and integrated u, v, psi over stretches of 30 s that start together."""
    lengths = [
        cumulative_integral(rows["t"].to_numpy(), np.hypot(rows["u"].to_numpy(), rows["v"].to_numpy()))[-1]
        for rows in stretches
    ]
    error = _rms(np.concatenate([_drift(rows) for rows in stretches]))
    duration = sum(float(rows["t"].iloc[-1] - rows["t"].iloc[0]) for rows in stretches)
    distance = sum(lengths) / duration * min(STRETCH, duration) if duration > 0 else 0.0
    sentence = f"positions leave integrated velocities by {error:.2g} m (RMS) in {STRETCH:g} s, {distance:.3g} m run"
    yield _row("path", error, "m", PATH_ERROR * distance, sentence)


def _drift(rows: pd.DataFrame) -> Array:
    """Distance [m] between positions and integrated velocities, which start together every 30 s, (N,)."""
    t, psi, u, v = (rows[name].to_numpy() for name in ("t", "psi", "u", "v"))
    rates = (u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi))
    part = np.floor((t - t[0]) / STRETCH + 1e-9).astype(int)
    start = np.flatnonzero(np.diff(part, prepend=-1))[np.cumsum(np.diff(part, prepend=-1) > 0) - 1]
    errors = [
        rows[name].to_numpy() - cumulative_integral(t, rate)
        for name, rate in zip(("north", "east"), rates, strict=True)
    ]
    return np.asarray(np.hypot(*(error - error[start] for error in errors)))


def check_series(dataset: Dataset) -> pd.DataFrame:
    """What the checks of motion compare, row by row: run, t [s], r and psi_rate [rad/s], drift [m], u, v [m/s]."""
    parts = []
    for run, rows in pieces(dataset):
        t = rows["t"].to_numpy()
        rate = np.gradient(np.unwrap(rows["psi"]), t) if len(t) > 2 else np.full(len(t), np.nan)
        part = rows[["t", "r", "u", "v"]].assign(run=run, psi_rate=rate, drift=_drift(rows))
        parts.append(part)
    return pd.concat(parts, ignore_index=True)


def _repetition(stretches: list[pd.DataFrame], others: pd.Series[Any]) -> Iterator[dict[str, Any]]:
    states = ["north", "east", "psi", "u", "v", "r"]
    same = np.concatenate([(rows[states].diff().iloc[1:] == 0).all(axis=1).to_numpy() for rows in stretches])
    frozen = float(same.mean()) if len(same) else 0.0
    yield _row("frozen", frozen, "1", FROZEN, f"{100 * frozen:.2g} % of the rows repeat the row before")
    t = np.concatenate([rows["t"].to_numpy() for rows in stretches])
    double = float(np.isin(t, others.to_numpy()).mean())
    yield _row("overlap", double, "1", OVERLAP, f"{100 * double:.2g} % of the rows belong to another run, too")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
