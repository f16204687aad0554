"""Sensors: each effect alone, their order, and draws that keep to themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DocumentError
from shipid.simulation.truth import Sensor, measure_record

STEP, ROWS = 0.05, 2001


def record(runs: tuple[str, ...] = ("M001", "M002"), rows: int = ROWS, step: float = STEP) -> pd.DataFrame:
    """Two smooth channels, a ramp, a constant and flags; each run a little different."""
    frames = []
    for number, run in enumerate(runs):
        t = np.arange(rows) * step
        frames.append(
            pd.DataFrame(
                {
                    "run": run,
                    "t": t,
                    "north": 3.0 * t + number,
                    "u": 2.0 + np.sin(0.3 * t + number),
                    "v": 0.0,
                    "psi": 0.1 * t + number,
                    "flags": 0,
                }
            )
        )
    return pd.concat(frames, ignore_index=True)


def test_noise_is_white_and_normal() -> None:
    """20,001 samples: mean within 4 standard errors, spread 2 %, no correlation, as much beyond 2 sigma as normal."""
    fine = record(("M001",), rows=20001)
    noise = measure_record(fine, {"v": Sensor(noise=0.2)}, STEP, seed=3)["v"].to_numpy() / 0.2
    assert abs(noise.mean()) < 4 / np.sqrt(len(noise))
    assert noise.std() == pytest.approx(1.0, rel=0.02)
    assert abs(np.mean(noise[1:] * noise[:-1])) < 4 / np.sqrt(len(noise))
    assert np.mean(np.abs(noise) > 2) == pytest.approx(0.0455, rel=0.12)


@pytest.mark.parametrize("latency", [0.4, 0.437])
def test_latency_delays_and_starts_with_the_first_value(latency: float) -> None:
    log = measure_record(record(("M001",)), {"north": Sensor(latency=latency)}, 0.1, seed=1)
    np.testing.assert_allclose(log["north"], 3.0 * np.maximum(log["t"] - latency, 0.0), atol=1e-9)


def test_quantisation_comes_last() -> None:
    """Noise and bias are rounded too: every value is a multiple, none half a quantum off the unrounded."""
    rough, exact = Sensor(noise=0.3, bias=0.1, quantum=0.25), Sensor(noise=0.3, bias=0.1)
    rounded, smooth = (
        measure_record(record(), {"u": sensor}, 1.0, seed=2)["u"].to_numpy() for sensor in (rough, exact)
    )
    np.testing.assert_array_equal(np.round(rounded / 0.25) * 0.25, rounded)
    assert np.abs(rounded - smooth).max() <= 0.125
    assert len(np.unique(rounded)) > 5


@pytest.mark.parametrize("name", ["psi", "beta_w"])
def test_angles_are_interpolated_across_the_wrap(name: str) -> None:
    continuous = record(("M001",)).assign(beta_w=lambda rows: 1.0 - 0.2 * rows["t"])
    wrapped = continuous.assign(**{name: (continuous[name] + np.pi) % (2 * np.pi) - np.pi})
    assert (np.abs(np.diff(wrapped[name])) > 6).any()
    sensor = {name: Sensor(latency=0.42, interval=0.33)}
    away = measure_record(wrapped, sensor, 0.1, seed=1)[name] - measure_record(continuous, sensor, 0.1, seed=1)[name]
    np.testing.assert_allclose(away, away[0], atol=1e-9)
    assert away[0] % (2 * np.pi) == pytest.approx(0.0)


@pytest.mark.parametrize(("step", "rows"), [(0.3, 7), (0.05, 3), (0.1, 10)])
@pytest.mark.parametrize("begin", [0.0, 1.7e9 + 0.7])
def test_no_sample_is_a_row_late(step: float, rows: int, begin: float) -> None:
    """Whatever the clock and its rounding: 2.1 / 0.3 is more than 7."""
    fine = record(("M001",), rows=201, step=step)
    sensor = {"north": Sensor(interval=round(rows * step, 9))}
    log = measure_record(fine.assign(t=fine["t"] + begin), sensor, step, seed=1)["north"]
    np.testing.assert_allclose(log, 3.0 * step * rows * (np.arange(201) // rows), atol=1e-4)


def test_draws_depend_on_seed_run_and_column_alone() -> None:
    noisy = Sensor(noise=0.1, bias=0.1)
    both = measure_record(record(), {"u": noisy, "v": noisy}, 1.0, seed=4)
    one = measure_record(record(("M002",)), {"v": noisy}, 1.0, seed=4)
    np.testing.assert_array_equal(one["v"], both.loc[both["run"] == "M002", "v"])
    longer = measure_record(record(rows=4001), {"v": noisy}, 1.0, seed=4)
    for run, rows in both.groupby("run"):
        np.testing.assert_array_equal(longer.loc[longer["run"] == run, "v"].to_numpy()[: len(rows)], rows["v"])
    first, second = (both.loc[both["run"] == run, "v"].to_numpy() for run in ("M001", "M002"))
    assert not np.isin(first, second).any()
    assert not np.isin(first, measure_record(record(), {"v": noisy}, 1.0, seed=5)["v"]).any()
    noise, bias = (
        measure_record(record(), {"v": one}, 1.0, seed=4)["v"] for one in (Sensor(noise=0.1), Sensor(bias=0.1))
    )
    assert not np.isin(noise, bias).any()
    assert (
        abs(np.corrcoef(both["u"] - record()["u"][np.tile(np.arange(ROWS) % 20 == 0, 2)].to_numpy(), both["v"])[0, 1])
        < 0.3
    )


@pytest.mark.parametrize(
    "block", [{"noise": -0.1}, {"bias": -1.0}, {"latency": -1.0}, {"interval": 0.0}, {"quantum": -1}, {"drift": 1.0}]
)
def test_wrong_blocks_are_refused(block: dict[str, Any]) -> None:
    with pytest.raises(DocumentError, match=next(iter(block))):
        Sensor(**block)


def test_bias_is_constant_in_a_run_and_normal_over_runs() -> None:
    runs = tuple(f"M{number:03d}" for number in range(400))
    bias = measure_record(record(runs, rows=3), {"v": Sensor(bias=0.5)}, STEP, seed=3).groupby("run")["v"]
    assert (bias.nunique() == 1).all()
    assert bias.first().std() == pytest.approx(0.5, rel=0.12)
    assert abs(bias.first().mean()) < 4 * 0.5 / np.sqrt(400)


@pytest.mark.parametrize("interval", [0.5, 0.7, 3.0])
def test_samples_are_held_until_the_next(interval: float) -> None:
    log = measure_record(record(("M001",)), {"north": Sensor(interval=interval)}, 0.2, seed=1)
    taken = np.floor(log["t"] / interval + 1e-6) * interval
    np.testing.assert_allclose(log["north"], 3.0 * taken, atol=1e-9)
