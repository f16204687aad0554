"""Sensor models: a measured log from a true record, with noise, bias, latency, sampling and quantisation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from shipid.arguments import whole_steps
from shipid.checked import CheckedModel, NotNegative, Positive
from shipid.errors import DocumentError
from shipid.physics.signals import is_wrapped_angle
from shipid.vessel.perturb import uniform_draw

Array = NDArray[np.float64]

SAME = 1e-6  # of a step of the record: two instants closer than this are equal


class Sensor(CheckedModel, BaseModel):
    """One sensor of a `sensors` table: column -> block, in the SI unit of the column."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    noise: Annotated[NotNegative, Field(description="standard deviation of the white noise on each sample")] = 0.0
    bias: Annotated[
        NotNegative, Field(description="standard deviation over runs of an offset that is constant in a run")
    ] = 0.0
    latency: Annotated[NotNegative, Field(description="s by which a sample is old when it is taken")] = 0.0
    interval: Annotated[Positive | None, Field(description="s between samples; absent: one per logged row")] = None
    quantum: Annotated[NotNegative, Field(description="samples are rounded to its multiples; 0: not rounded")] = 0.0


def measure_record(fine: pd.DataFrame, sensors: Mapping[str, Sensor], interval: float, seed: int) -> pd.DataFrame:
    """Measured log of a true record: a frame with the columns of `fine` and a row every `interval` [s] of each run.

    A sample is the true value at the time minus `latency` (linear between rows; the first value before the start), plus
    bias and noise, rounded to `quantum`. Samples are taken every `Sensor.interval` from the first row on and held until
    the next. Bias and noise are normal, drawn by hash(seed, run, column). A column without a sensor is copied.

    fine : columns `run`, `t` [s] and others (SI), `t` in equal steps within each run.

    DocumentError where `interval` is no multiple of the record's step.
    """
    logs = [_measure_run(str(run), rows, sensors, interval, seed) for run, rows in fine.groupby("run", sort=False)]
    return pd.concat(logs, ignore_index=True)


def _measure_run(
    run: str, rows: pd.DataFrame, sensors: Mapping[str, Sensor], interval: float, seed: int
) -> pd.DataFrame:
    """Measured log of one run."""
    step = float(rows["t"].iloc[-1] - rows["t"].iloc[0]) / (len(rows) - 1)
    stride = whole_steps(interval, step)
    if not stride:
        raise DocumentError(
            f"{interval:g} s between logged rows must be a multiple of the record's step, {step:g} s", path="interval"
        )
    log = rows.iloc[::stride].copy()
    for name, sensor in sensors.items():
        truth = rows[name].to_numpy(dtype=np.float64)
        truth = np.unwrap(truth) if is_wrapped_angle(name) else truth
        log[name] = _sensor_samples(sensor, truth, step, stride, (seed, run, name))
    return log


def _sensor_samples(sensor: Sensor, truth: Array, step: float, stride: int, key: tuple[Any, ...]) -> Array:
    """Output of a sensor at every `stride`-th row of the true values (N,), which are `step` [s] apart."""
    logged = np.arange(0, len(truth), stride)  # all clocks below count rows of the record from the run's first
    period = stride if sensor.interval is None else sensor.interval / step
    latest = np.floor(logged / period + SAME)  # number of the last sample taken by each logged row
    taken, which = np.unique(latest, return_inverse=True)  # samples between logged rows are not needed
    values = (
        _value_at_row(truth, taken * period - sensor.latency / step)
        + sensor.bias * _normal_draws(1, *key, "bias")
        + sensor.noise * _normal_draws(len(taken), *key, "noise")
    )
    if sensor.quantum > 0:
        values = sensor.quantum * np.rint(values / sensor.quantum)
    return np.asarray(values[which])


def _value_at_row(truth: Array, place: Array) -> Array:
    """Values (N,) at fractional row numbers: linear between rows, constant before the first, exact at a row."""
    nearest = np.rint(place)
    place = np.where(np.abs(place - nearest) < SAME, nearest, place)
    return np.interp(place, np.arange(len(truth)), truth)


def _normal_draws(count: int, *key: Any) -> Array:
    """Standard normal draws (count,) that depend only on the key; a longer series begins with the shorter one.

    Box-Muller transform of PCG64's raw output: NumPy guarantees the raw output for all versions, but not its normals.
    """
    raw = np.random.PCG64(int(uniform_draw(*key) * 2**53)).random_raw(2 * count).reshape(count, 2)
    first, second = ((raw >> np.uint64(11)) / 2.0**53).T
    return np.asarray(np.sqrt(-2 * np.log1p(-first)) * np.cos(2 * np.pi * second))
