"""Laws of late orders: zigzags whose orders fall between rows are named and mended; sound logs are not blamed."""

from __future__ import annotations

import functools
import tomllib

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.identification.late_fit import command_lateness, late_fit
from shipid.identification.settings import Identify
from shipid.identification.solution import Solution
from shipid.identification.solve import identify
from shipid.identification.statistics import LinearFit, fit_statistics
from shipid.simulation.manoeuvre import Zigzag
from shipid.simulation.perform import perform_manoeuvres
from shipid.vessel.load import Vessel
from shipid.vessel.template import Particulars, first_guess

FERRY = Particulars(length=120, beam=18, draught=5, block=0.6, speed=9)
FEW = ["hull.mmg.Y_v", "hull.mmg.Y_r", "hull.mmg.N_v", "hull.mmg.N_r"]
NOISE = {"u": 0.01, "v": 0.01, "r": 2.4e-4}


@functools.cache
def ferry() -> Vessel:
    text = first_guess(FERRY, "ferry", "ferry.toml").text
    return Vessel(tomllib.loads(text), "ferry.toml")


@functools.cache
def zigzags(seed: int, step: float) -> pd.DataFrame:
    """Four zigzags; orders are given at steps of the simulation."""
    rng = np.random.default_rng(seed)
    runs = [
        Zigzag(
            n_rpm=258,
            angle_deg=angle,
            execute_heading_deg=heading * rng.uniform(0.8, 1.2),
            duration=260,
            execute_at=round(rng.uniform(13, 26) / step) * step,
        )
        for angle, heading in ((10, 10), (20, 20), (15, 10), (10, 5))
    ]
    return perform_manoeuvres(ferry(), runs, step=step)


def log_of(seed: int, step: float, interval: float) -> Dataset:
    rows = zigzags(seed, step)
    every = round(interval / step)
    rows = pd.concat([run.iloc[::every] for _, run in rows.groupby("run", sort=False)], ignore_index=True)
    rows = rows[[name for name in rows if not name.startswith("actual.")]].copy()
    rng = np.random.default_rng(seed)
    for name, deviation in NOISE.items():
        rows[name] += rng.normal(0, deviation, len(rows))
    return Dataset(rows, {"vessel": ferry().name, "units": {}, "clock": "run"})


def fitted(log: Dataset, step: float, commands: str = "held", vessel: Vessel | None = None, **more: object) -> Solution:
    how = {"parameters": FEW, "weights": NOISE, "horizon": 66, "step": step, "commands": commands, "start": "base"}
    how |= more
    solution = identify(vessel or ferry(), log, log.runs, Identify(**how))
    assert solution.status == "ok"
    return solution


def sentence(solution: Solution, log: Dataset) -> str:
    return late_fit(solution, log, fit_statistics(LinearFit.of(solution)))


def test_orders_between_slow_rows_are_named_with_the_change_that_the_remedy_makes() -> None:
    """Before, no command said it: the estimates were off by more than their intervals without a word."""
    log = log_of(1, 0.05, 1.0)
    held, mended = fitted(log, 1.0), fitted(log, 0.5, "between")
    off, left = np.abs(held.factors - 1), np.abs(mended.factors - 1)
    late = command_lateness(held, log)
    assert late is not None
    place = FEW.index("hull.mmg.N_v")
    noise = fit_statistics(LinearFit.of(mended)).errors[place]
    assert left[place] < 0.4 * off[place] + noise
    assert late.changes[place] == pytest.approx(1 - held.factors[place], abs=0.5 * off[place])
    assert sentence(held, log).startswith("commands count from their row, on average 0.5 s late")
    assert "--set commands=between --set step=0.5" in sentence(held, log)
    assert sentence(mended, log) == ""


@pytest.mark.parametrize(("step", "interval"), [(0.05, 0.1), (1.0, 1.0)], ids=["fast rows", "orders on the rows"])
def test_logs_that_have_their_orders_in_time_are_not_blamed(step: float, interval: float) -> None:
    log = log_of(1, step, interval)
    solution = fitted(log, interval)
    assert sentence(solution, log) == ""


def late_by(rows: int, log: Dataset, column: pd.Series) -> Dataset:
    """The log with the helm of a column, so many rows late."""
    late = column.groupby(log.frame["run"]).shift(rows).bfill()
    return Dataset(log.frame.assign(**{"rudder.delta": late}), log.metadata)


def test_commands_that_the_log_has_late_or_early_are_named_with_what_that_does() -> None:
    """Before, half a row alone was judged: longer delays were named less often, a lag that the vessel lacks never."""
    log, bare = log_of(1, 1.0, 1.0), ferry().with_values({"thruster.rudder.actuator.delta.off": True})
    orders, angles = log.frame["rudder.delta"], zigzags(1, 1.0)["actual.rudder.delta"]
    for given, vessel, when, cause in (
        (late_by(3, log, orders), ferry(), "earlier", "an actuator is too slow, or the log has its commands late"),
        (late_by(0, log, angles), ferry(), "earlier", "measured angles and no orders (thruster.rudder.actuator.delta:"),
        (late_by(3, log, angles), bare, "earlier", "the log has its commands late, as a feedback may be"),
        (late_by(0, log, orders), bare, "later", "the vessel lacks an actuator"),
    ):
        solution = fitted(given, 1.0, vessel=vessel)
        found, late = sentence(solution, given), command_lateness(solution, given)
        assert late is not None
        assert f"rows) {when} than in the log: that moves" in found
        assert cause in found
        moved = late.changes * late.rows / 0.5
        place = int(np.argmax(np.abs(moved)))
        assert np.sign(moved[place]) == np.sign(1 - solution.factors[place])
