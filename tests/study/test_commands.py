"""Commands held or known over the horizon: one number fewer to guess, and the same where nothing changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipid.data.dataset import Dataset, sample_columns, write_dataset
from shipid.data.windows import cut_windows
from shipid.engine.rollout import rollout
from shipid.errors import DataError
from shipid.hybrid.kernel_compensator import KernelCompensator
from shipid.hybrid.physics import Physics
from shipid.metrics import position_error, summarise_errors
from shipid.predictor import Predictor
from shipid.simulation.manoeuvre import Zigzag
from shipid.simulation.perform import perform_manoeuvres
from shipid.study import store
from shipid.study.apply import predict_log
from shipid.study.plan import Plan
from shipid.study.prepare import prepare
from shipid.vessel.load import load_vessel
from tests.study.tiny import logged, physics_errors, run_here, tiny_plan

KNOWN = {"prediction.commands": "known"}


def weaving(names: str = "abcdef") -> Dataset:
    """Runs of the 28.9 m ship itself, each with a helm that goes over at other times."""
    ship, t = load_vessel("gunnerus-28.9"), np.arange(41.0)
    runs: dict[str, Mapping[str, Any]] = {}
    for number, name in enumerate(names):
        helm = np.where((t // (6 + number)) % 2 == 0, 0.3, -0.3)
        orders = {f"{side}.n": np.full(len(t), 2.0) for side in ("port", "starboard")}
        orders |= {f"{side}.alpha": helm for side in ("port", "starboard")}
        start = {name: np.zeros(1) for name in ("north", "east", "psi", "v", "r")} | {"u": np.array([3.0])}
        wind = {"V_w": np.zeros(1), "beta_w": np.zeros(1)}
        path = rollout(
            ship, start, {key: values[:-1, None] for key, values in orders.items()}, wind, step=1.0, num_steps=40
        )
        runs[name] = {key: path[key][:, 0, 0] for key in ("north", "east", "psi", "u", "v", "r")} | orders
    return logged(runs, t)


def test_where_no_command_changes_knowing_it_changes_nothing(tmp_path: Path, tiny_run: Path) -> None:
    """The turns of the tiny study hold one order each: physics, inputs and results are those of held commands."""
    run_here(tiny_plan(tmp_path, KNOWN), tmp_path / "known")
    known, held = store.read_rows(tmp_path / "known"), store.read_rows(tiny_run)
    assert len(known) == len(held) == 8
    for name in ("A", "H", "H_90"):
        np.testing.assert_allclose(known[name], held[name], rtol=1e-9)


def test_orders_that_change_within_a_step_count_for_the_rest_of_it() -> None:
    """Gunnerus, rows of 0.1 s, steps of 1 s: held from the start of their step, such orders tripled the error."""
    ship = load_vessel("gunnerus-28.9")
    kinds = [Zigzag(n_rpm=145, angle_deg=angle, duration=100, execute_at=20.43) for angle in (10, 20)]
    frame = perform_manoeuvres(ship, kinds, step=0.05, interval=0.1).astype({"run": "str"})
    frame = frame[[name for name in frame if not str(name).startswith("actual.")]]
    windows = cut_windows(Dataset(frame, {"clock": "run", "flags": []}), horizon=30, step=1.0, interval=3.7)
    physics, held = Physics(ship, 30, 1.0, "rk4"), {}
    for name in windows.planned:
        rows = [frame[frame["run"] == run] for run in windows.run]
        starts = windows.t + np.arange(30)[:, None]
        values = [sample_columns(one, starts[:, i])[name] for i, one in enumerate(rows)]
        held[name] = np.stack(values, axis=1)
    now, before = (
        position_error(physics.paths(one.instants(known=True)), windows.future).mean()
        for one in (windows, replace(windows, planned=held))
    )
    assert now < before / 3


def test_right_physics_with_known_commands_misses_nothing(recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    plans = {
        kind: recorded(weaving(), split={"test": 2}, prediction={"ahead": 5.0, "commands": kind})
        for kind in ("held", "known")
    }
    A = {kind: physics_errors(prepare(plan, dataset), "right")["mean"] for kind, (plan, dataset) in plans.items()}
    assert A["known"] < 1e-9
    assert A["held"] > 0.01


def test_a_stored_predictor_takes_the_plan(tmp_path: Path, recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    """What it predicts from the stored windows is the H of its cell; without a plan it says what it needs."""
    plan, _ = recorded(weaving(), split={"test": 2}, prediction={"ahead": 5.0, "commands": "known"})
    run_here(plan, tmp_path / "run")
    test, *_ = store.read_test(tmp_path / "run")
    rows = store.read_rows(tmp_path / "run")
    for row in rows.itertuples():
        predictor = Predictor.load(store.cell_file(tmp_path / "run", str(row.cell)))
        assert predictor.commands == "known"
        paths = predictor.predict(test.instants(known=True))
        assert summarise_errors(position_error(paths, test.future))["mean"] == pytest.approx(row.H, rel=1e-9)
        with pytest.raises(DataError, match="made for known commands"):
            predictor.predict(test.instants())
    pure = Predictor.load(store.cell_file(tmp_path / "run", str(rows[rows["foundation"] == "none"]["cell"].iloc[0])))
    assert isinstance(pure.corrector, KernelCompensator)
    assert any(".planned-" in name for name in pure.corrector.normaliser.names)


def test_a_log_holds_the_plan(tmp_path: Path, recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    """Along a log the later orders are the plan; the last instants have none and are left out."""
    plan, dataset = recorded(weaving(), split={"test": 2}, prediction={"ahead": 5.0, "commands": "known"})
    run_here(plan, tmp_path / "run")
    log = write_dataset(dataset, tmp_path / "log.parquet")
    cell = plan.batches[0].cell("right", "kernel")
    frame, _ = predict_log(tmp_path / "run", cell, log, None, tmp_path / "paths.csv")
    assert frame.groupby("run")["t"].max().eq(36.0).all()  # orders are needed until the start of the last step
    run = frame[(frame["run"] == "a") & (frame["ahead"] == 4.0) & (frame["t"] == 10.0)].iloc[0]
    rows = dataset.frame[(dataset.frame["run"] == "a") & (dataset.frame["t"] == 14.0)].iloc[0]
    assert (run["physics_north"], run["physics_east"]) == pytest.approx((rows["north"], rows["east"]), abs=1e-6)
    short = dataset.frame[dataset.frame["t"] < 4.0].reset_index(drop=True)
    tiny = write_dataset(Dataset(short, dataset.metadata), tmp_path / "short.parquet")
    with pytest.raises(DataError, match="no run has 5 s for"):
        predict_log(tmp_path / "run", cell, tiny, None, tmp_path / "none.csv")
    assert not (tmp_path / "none.csv").exists()
