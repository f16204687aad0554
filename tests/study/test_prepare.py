"""From plan to arrays: splits that share nothing, redraws that never look at the test, hidden states, floors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest
import tomlkit

from shipid.answer.sentences import answer_sentences
from shipid.data.dataset import Dataset
from shipid.data.windows import Windows, constant_motion, cut_windows, from_frame
from shipid.errors import DataError, DivergenceError, DocumentError, ResultError
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.learned_force import ForceCorrector
from shipid.hybrid.physics import Physics
from shipid.logs.kinds import LOW_SPEED, RANDOM
from shipid.metrics import position_error
from shipid.predictor import Predictor
from shipid.study import prepare as module
from shipid.study import run, seals
from shipid.study.envelope import input_envelope
from shipid.study.plan import Plan, read_plan
from shipid.study.prepare import (
    PreparedStudy,
    all_windows,
    estimates_of,
    instants_of,
    kinds_of_runs,
    obtain_runs,
    over_gaps,
    partition,
    prepare,
    runs_by_amount,
    window_memory,
)
from shipid.study.results import read_results
from shipid.study.run import run_unit
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import draw_variant, resolve_families
from tests.study.test_commands import weaving
from tests.study.tiny import logged, physics_errors, run_here, tiny_plan, whole_unit

SHIP = load_vessel("gunnerus-28.9")


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Dataset, PreparedStudy]:
    plan = tiny_plan(tmp_path_factory.mktemp("plan"), {"grid.seeds": [0, 1], "grid.N_D": [2, 4, 6, 8]})
    dataset = obtain_runs(plan)
    return plan, dataset, prepare(plan, dataset)


def test_the_order_of_columns_changes_no_digit(tmp_path: Path) -> None:
    """Columns the other way round changed H of drawn networks by up to a half, as another seed would."""
    drawn = {"name": "kernel", "kind": "kernel", "trials": 2, "steps": 2, "terms": 4}
    stepped = {"name": "stepped", "kind": "one-step", "trials": 1, "units": 8, "families": ["right", "none"]}
    plan = tiny_plan(tmp_path, {"method": [drawn, stepped], "grid.N_D": [4]})
    dataset = obtain_runs(plan)
    turned = Dataset(dataset.frame[["run", *[name for name in dataset.frame if name != "run"][::-1]]], dataset.metadata)
    assert turned.commands == dataset.commands[::-1]
    first, again = (
        [row["H"] for row, *_ in run_unit(plan, prepare(plan, one), whole_unit(plan, plan.batches[0]), "cpu")]
        for one in (dataset, turned)
    )
    assert first == again
    assert prepare(plan, turned).commands == tuple(dataset.commands), "the order of the vessel"


def test_data_sets_are_nested_and_never_hold_a_test_run(tiny: tuple[Plan, Dataset, PreparedStudy]) -> None:
    plan, dataset, prepared = tiny
    test = set(prepared.test.spans)
    assert len(test) == 4
    assert test | set(prepared.pool.spans) == set(dataset.runs)
    for seed in (0, 1):
        batches = sorted((batch for batch in plan.batches if batch.seed == seed), key=lambda batch: batch.N_D)
        drawn = [set(prepared.runs(batch)) for batch in batches]
        assert [len(runs) for runs in drawn] == [2, 4, 6, 8]
        assert all(small < large for small, large in pairwise(drawn))
        assert not drawn[-1] & test
    first, second = (prepared.runs(next(b for b in plan.batches if b.N_D == 4 and b.seed == s)) for s in (0, 1))
    assert set(first) != set(second)


def test_constant_motion_is_the_integral(tiny: tuple[Plan, Dataset, PreparedStudy]) -> None:
    """Midpoint rule with 2,000 steps a second; r = 0 included."""
    windows = tiny[2].test.select(slice(0, 12))
    windows.columns["r"][0] = 0.0
    u, v, r = (windows.columns[name] for name in ("u", "v", "r"))
    steps = 2000
    time = (np.arange(windows.horizon * steps) + 0.5)[:, None] / steps
    rate = np.stack([u * np.cos(r * time) - v * np.sin(r * time), u * np.sin(r * time) + v * np.cos(r * time)], axis=-1)
    path = np.cumsum(rate, axis=0)[steps - 1 :: steps] / steps
    np.testing.assert_allclose(constant_motion(windows), path, atol=1e-6)


def test_the_model_of_the_truth_is_exact(tmp_path: Path) -> None:
    """A truth of the same equations, step and rule leaves A = 0: windows, frames and held commands add no error."""
    plan = tiny_plan(tmp_path, {"truth.step": 1.0, "truth.method": "euler"})
    prepared = prepare(plan, obtain_runs(plan))
    assert physics_errors(prepared, "right")["rms"] < 1e-9
    assert physics_errors(prepared, "wrong-1")["mean"] > 0.01
    np.testing.assert_array_equal(prepared.known["none"].test_paths, 0.0)


def test_noisy_fixes_are_judged_against_the_exact_path(tmp_path: Path) -> None:
    """Exact physics errs by the fix that it starts from; what trains is the log, and the tracks are the same."""
    exact, noisy = (
        tiny_plan(tmp_path, {"truth.interval": 1.0, "truth.sensors": sensors})
        for sensors in ({}, {name: {"noise": 0.5} for name in ("north", "east")})
    )
    one, two = (partition(plan, obtain_runs(plan)) for plan in (exact, noisy))
    start = [two[1].columns[name] - one[1].columns[name] for name in ("north", "east")]
    tracks = [from_frame(*np.moveaxis(w.future, -1, 0), *(w.columns[name] for name in ("north", "east", "psi")))
              for w in (one[1], two[1])]  # fmt: skip
    np.testing.assert_allclose(tracks[0], tracks[1], atol=1e-9)
    errors = position_error(one[1].future, two[1].future)
    np.testing.assert_allclose(errors, np.broadcast_to(np.hypot(*start), errors.shape), atol=1e-9)
    assert position_error(one[0].future, two[0].future).mean() == pytest.approx(0.5 * np.sqrt(np.pi), rel=0.1)


def test_members_that_diverge_in_training_are_redrawn_where_the_family_asks_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next counter draws anew, the others keep theirs, and it is reported; the same again gives the same.

    The actuators, which all members have alike, are followed once for the pool and once for the test, not every round.
    """
    followed: list[int] = []

    def counted(vessel: Vessel, dataset: Dataset, windows: Windows) -> Any:
        followed.append(len(windows))
        return window_memory(vessel, dataset, windows)

    monkeypatch.setattr(module, "window_memory", counted)
    family: dict[str, Any] = {"name": "wild", "base": "gunnerus-28.9", "members": 6, "redraw": True}
    family["perturb"] = [{"parameters": ["hull.derivatives.*"], "factor": [-6.0, 6.0], "change_sign": True}]
    plan = tiny_plan(tmp_path, {"family": [family]})
    prepared = prepare(plan, obtain_runs(plan))
    rule = resolve_families(plan.study.family)[0]
    redrawn = 0
    for planned, model in zip(plan.foundations[:-1], prepared.foundations[:-1], strict=True):
        counter = model.variant.counter
        assert model.variant == draw_variant(rule, model.member, SHIP, counter)
        assert sum(model.name in note for note in prepared.notes) == counter
        redrawn += counter > 0
        if counter == 0:
            assert model.variant == planned.variant
        assert np.isfinite(prepared.known[model.name].paths).all()
    assert 0 < redrawn < 6
    assert len(followed) == 2
    again = prepare(plan, obtain_runs(plan))
    assert [m.variant for m in again.foundations] == [m.variant for m in prepared.foundations]


def test_what_cannot_be_drawn_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fixed factor draws nothing else; a hopeless range is given up."""
    monkeypatch.setattr(module, "MOST_REDRAWS", 9)
    for factor, message in ((-1e4, "diverges on"), ([-2e4, -1e4], "after 9 redraws")):
        block = {"parameters": ["hull.derivatives.X_u|u|"], "factor": factor, "change_sign": True}
        family = {"name": "lost", "base": "gunnerus-28.9", "redraw": True, "perturb": [block]}
        plan = tiny_plan(tmp_path, {"family": [family], "unusual": ["family.0.perturb.0.factor*"]})
        with pytest.raises(DivergenceError, match=message) as caught:
            prepare(plan, obtain_runs(plan))
        assert caught.value.path == "family.lost"


def test_members_that_diverge_stay_and_go_no_farther_than_the_ship_at_its_present_speed(tmp_path: Path) -> None:
    """No cell of them lacks a result, the saved predictor has the paths of the study, and the page counts windows."""
    family: dict[str, Any] = {"name": "wild", "base": "gunnerus-28.9", "members": 6}
    family["perturb"] = [{"parameters": ["hull.derivatives.*"], "factor": [-6.0, 6.0], "change_sign": True}]
    plan = tiny_plan(tmp_path, {"family": [family]})
    prepared = prepare(plan, obtain_runs(plan))
    run_here(plan, tmp_path / "run")
    results = read_results(tmp_path / "run")
    assert (results.cells["status"] == "ok").all()
    speed = np.hypot(prepared.test.columns["u"], prepared.test.columns["v"])
    models, counts = results.models.set_index("model"), 0
    for planned, model in zip(plan.foundations[:-1], prepared.foundations[:-1], strict=True):
        assert model.variant == planned.variant
        pool, test = prepared.known[model.name].diverged, prepared.known[model.name].test_diverged
        error = position_error(results.physics[model.name], prepared.test.future)
        way = np.linalg.norm(results.physics[model.name][:, test], axis=-1)
        assert (way <= np.outer(np.arange(1, len(way) + 1), prepared.test.step * speed[test]) * (1 + 1e-9)).all()
        assert error.mean() == pytest.approx(models.loc[model.name, "A"])
        cell = next(row["cell"] for row in results.rows if row["model"] == model.name)
        aboard = Predictor.load(tmp_path / "run" / "cells" / f"{cell}.npz").alone(prepared.test.instants())
        np.testing.assert_array_equal(results.physics[model.name], aboard)
        assert np.isfinite(prepared.known[model.name].test_paths).all()
        assert sum(model.name in note for note in prepared.notes) == pool.any()
        assert models.loc[model.name, "diverged_training"] == pool.sum()
        assert models.loc[model.name, "diverged_test"] == test.sum()
        counts += pool.any()
    assert 0 < counts < 6
    assert any(
        "test windows: a path then keeps its last velocity, no farther" in text for text, _ in answer_sentences(results)
    )


def test_a_folder_with_members_of_an_earlier_version_is_not_gone_on_with(tmp_path: Path) -> None:
    """Before, they were drawn again: cells of both in one table would be of two models by one name."""
    family: dict[str, Any] = {"name": "wild", "base": "gunnerus-28.9", "members": 6}
    family["perturb"] = [{"parameters": ["hull.derivatives.*"], "factor": [-6.0, 6.0], "change_sign": True}]
    plan, folder = tiny_plan(tmp_path, {"family": [family], "grid.N_D": [4]}), tmp_path / "run"
    older = replace(plan, families=tuple(one.model_copy(update={"redraw": True}) for one in plan.families))
    with patch.object(run, "prepare", lambda _, *given: prepare(older, *given)):
        run_here(plan, folder)
    assert run_here(plan, folder)[-1].done == 7, "nothing is left to compute"
    seals.remove_seal(folder, plan.units[0].key)
    with pytest.raises(ResultError, match=r"test paths of wild-\d by another version"):
        run_here(plan, folder)


def test_a_force_that_lets_the_physics_diverge_errs_by_the_distance_run_at_most(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its windows count, and not those of the physics without it."""
    method = {"name": "force", "kind": "learned-force", "trials": 1, "units": 2, "iterations": 1, "samples": 20}
    plan = tiny_plan(tmp_path, {"method": [method], "grid.N_D": [4]})
    prepared, given = prepare(plan, obtain_runs(plan)), ForceCorrector.with_force
    wild = {"hull.derivatives.X_u|u|": 1e6}
    monkeypatch.setattr(ForceCorrector, "with_force", lambda one, physics: given(one, physics).with_values(wild))
    cells = [cell for cell in run_unit(plan, prepared, whole_unit(plan, plan.batches[0]), "cpu") if cell.row["member"]]
    assert [cell.row["status"] for cell in cells] == ["ok"] * len(cells)
    way = np.cumsum(np.linalg.norm(np.diff(prepared.test.future, axis=0, prepend=0.0), axis=-1), axis=0)
    for row, _, paths in cells:
        assert (position_error(paths, prepared.test.future) <= way * (1 + 1e-9)).all()
        assert "physics diverges on 100.0 % of the test windows" in row["sentence"]
    assert cells


def test_divergence_on_test_windows_only_is_shown_never_redrawn(
    recorded: Callable[..., tuple[Plan, Dataset]],
) -> None:
    """u' = k u^2 / m blows up for a fast ship and not for a slow one; one of two test runs is fast."""
    t, rng = np.arange(21.0), np.random.default_rng(0)
    runs = {f"slow{k}": {"u": rng.uniform(0.0, 0.1, 21), "port.n": rng.uniform(0.0, 0.2, 21)} for k in range(4)}
    runs["fast"] = {"u": np.full(21, 6.0)}
    family = {"name": "brittle", "base": "gunnerus-28.9", "members": 2}
    family["perturb"] = [
        {"set": {"hull.derivatives.X_u|u|": 1.0e6}},
        {"parameters": ["hull.derivatives.Y_uv"], "factor": [0.9, 1.1]},
    ]
    plan, dataset = recorded(logged(runs, t), split={"test": ["fast", "slow0"]}, family=[family])
    prepared = prepare(plan, dataset)
    for model in prepared.foundations[:-1]:
        assert model.variant.counter == 0
        one = prepared.known[model.name]
        assert [part.mean() for part in (one.diverged, one.test_diverged)] == [0.0, 0.5]
    rows = {row["foundation"]: row for row, *_ in run_unit(plan, prepared, whole_unit(plan, plan.batches[0]), "cpu")}
    assert "physics diverges on 50.0 % of the test windows" in rows["brittle-1"]["sentence"]
    assert rows["brittle-1"]["H"] > 6.0, "the ship of this log stays where it is, though its speed is 6 m/s"
    assert rows["none"]["sentence"] == ""


def stepped(order: float, T: float, rate: float) -> tuple[Any, Dataset]:
    """A ship with lagged shafts, and a log whose order steps from 1 rev/s at t = 10 s."""
    lag = {"n": {"kind": "first_order", "T": T, "rate": rate}}
    ship = SHIP.with_values({"thruster.port.actuator": lag, "thruster.starboard.actuator": lag})
    t = np.arange(31.0)
    n = np.where(t < 10, 1.0, order)
    return ship, logged({name: {"u": 2.0, "port.n": n, "starboard.n": n} for name in "abc"}, t)


def test_hidden_states_follow_the_earlier_orders() -> None:
    """First order, exactly: 1 before the step, 2 - exp(-(t - 10) / T) after it; limited by the rate."""
    ship, dataset = stepped(order=2.0, T=4.0, rate=100.0)
    windows = cut_windows(dataset, horizon=5)
    memory = window_memory(ship, dataset, windows)
    late = np.maximum(windows.t - 10.0, 0.0)
    for side in ("port", "starboard"):
        np.testing.assert_allclose(memory[f"{side}.n"], 2.0 - np.exp(-late / 4.0), rtol=1e-12)
    slow, _ = stepped(order=2.0, T=4.0, rate=0.01)
    limited = window_memory(slow, dataset, windows)
    np.testing.assert_allclose(limited["port.n"], 1.0 + 0.01 * late, rtol=1e-12)
    assert window_memory(SHIP, dataset, windows) is None


def test_perturbed_lags_have_separate_hidden_states(
    tmp_path: Path, recorded: Callable[..., tuple[Plan, Dataset]]
) -> None:
    """What a stored predictor predicts is what the study has seen: each variant models its actuators."""
    ship, dataset = stepped(order=2.0, T=4.0, rate=1.0)
    (tmp_path / "lagged.toml").write_text(tomlkit.dumps(ship.document))
    family = {"name": "lagged", "base": "./lagged.toml", "members": 3}
    family["perturb"] = [{"parameters": ["thruster.*.actuator.n.T"], "factor": [0.2, 3.0], "together": True}]
    plan, _ = recorded(dataset, split={"test": 1}, family=[family])
    prepared = prepare(plan, dataset)
    assert not np.allclose(prepared.known["lagged-1"].test_paths, prepared.known["lagged-2"].test_paths)
    for model in prepared.foundations[:-1]:
        vessel = model.vessel
        predictor = Predictor(Physics(vessel, 5, 1.0), "alone", UnchangedPath({}))
        paths = predictor.predict(instants_of(plan.study, vessel, dataset, prepared.test))
        np.testing.assert_allclose(paths, prepared.known[model.name].test_paths, atol=1e-9)


def test_nothing_that_a_prediction_knows_depends_on_a_later_fix(
    recorded: Callable[..., tuple[Plan, Dataset]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Speeds interpolated between fixes: another fix at 12 s changes no input up to 11 s, past and observer too."""
    t, fixes = np.arange(31.0), np.arange(0.0, 31.0, 3.0)
    speeds = 2.0 + np.random.default_rng(2).normal(size=(2, len(fixes)))
    speeds[1, fixes < 11.0] = speeds[0, fixes < 11.0]
    data = [logged({name: {"u": np.interp(t, fixes, one)} for name in "abcd"}, t) for one in speeds]
    causal = {"dataset": "log.parquet", "causal": ["u"]}
    plan, _ = recorded(data[0], data=causal, split={"test": 1}, prediction={"ahead": 5.0, "past": 4.0})
    one, other = (all_windows(plan, dataset) for dataset in data)
    early = one.t <= 11.0
    assert early.sum() == 4 * 8
    assert not np.array_equal(data[0].frame["u"][10:11], data[1].frame["u"][10:11])  # row 10 s is on the way to 12 s
    np.testing.assert_array_equal(one.columns["u"][early], other.columns["u"][early])
    np.testing.assert_array_equal(one.past["u"][:, early], other.past["u"][:, early])
    monkeypatch.setattr("shipid.study.prepare.run_observer", lambda _, dataset, *__, **___: dataset.frame)
    frames = [estimates_of(plan.study, plan.foundations[0], dataset, one) for dataset in data]
    rows = data[0].frame["t"] <= 11.0
    assert frames[0][rows].equals(frames[1][rows])  # type: ignore[index]
    assert not frames[0].equals(frames[1])  # type: ignore[attr-defined]


def test_what_is_not_measured_is_reported(recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    t = np.arange(21.0)
    plan, dataset = recorded(logged({name: {"u": 2.0 + 0.01 * t} for name in "abcd"}, t), split={"test": 1})
    assert any("V_w, beta_w not measured, assumed 0" in note for note in prepare(plan, dataset).notes)


@pytest.mark.parametrize(
    ("changes", "path", "message"),
    [
        ({"split": {"test": ["z"]}}, "split.test", "'z' is no run with windows: valid: a, b, c, d"),
        ({"split": {"test": 4}}, "split.test", "only 4 runs"),
        ({"split": {"test": 2}, "grid": {"N_D": [3]}}, "grid.N_D", "only 2 runs are left"),
        ({"split": {"test": 1}, "prediction": {"ahead": 40.0}}, "prediction.ahead", "as long as the horizon of 40 s"),
        (
            {
                "split": {"test": 1},
                "method": [{"name": "rolling", "kind": "kernel", "memory": {"states": ["phi"]}}],
                "grid": {"N_D": [3]},
            },
            "method.rolling.memory.states",
            "the runs have no 'phi'; there are .*north, .*psi, r",
        ),
    ],
)
def test_a_study_that_asks_too_much_of_its_log(
    recorded: Callable[..., tuple[Plan, Dataset]], changes: dict[str, Any], path: str, message: str
) -> None:
    t = np.arange(21.0)
    plan, dataset = recorded(logged({name: {"u": 2.0 + 0.01 * t} for name in "abcd"}, t), **changes)
    with pytest.raises(DocumentError, match=message) as caught:
        prepare(plan, dataset)
    assert (caught.value.path, caught.value.file) == (path, plan.file)


def test_a_log_without_the_ships_commands(recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    t = np.arange(21.0)
    dataset = logged({name: {"u": 2.0} for name in "abcd"}, t)
    fewer = Dataset(dataset.frame.drop(columns=["starboard.n"]), dataset.metadata)
    plan, _ = recorded(fewer, split={"test": 1})
    with pytest.raises(DataError, match=r"needs this command; the data have port\.alpha, port\.n") as caught:
        prepare(plan, fewer)
    assert caught.value.path == "starboard.n"


def test_files_are_looked_for_beside_the_study(
    tmp_path: Path, recorded: Callable[..., tuple[Plan, Dataset]], monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, dataset = recorded(logged({name: {"u": 2.0} for name in "abcd"}, np.arange(21.0)), split={"test": 1})
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    plan.study.data.dataset = "log.parquet"
    assert obtain_runs(plan).runs == dataset.runs


def test_the_envelope_is_of_the_instants_of_prediction(tiny: tuple[Plan, Dataset, PreparedStudy]) -> None:
    """Per D_4, D_6 and test, from the windows that each sees."""
    plan, _, prepared = tiny
    rows = {
        (row["set"], row["quantity"]): row
        for row in input_envelope(
            prepared.pool, prepared.test, runs_by_amount(plan.study, prepared.pool), prepared.commands
        )
    }
    batches = {f"D_{batch.N_D}": batch for batch in plan.batches if batch.seed == min(plan.study.grid.seeds)}
    assert {name for name, _ in rows} == {*batches, "test"}
    for name in ("test", *batches):
        chosen = prepared.runs(batches[name]) if name in batches else ()
        windows = prepared.pool.select(np.isin(prepared.pool.run, chosen)) if chosen else prepared.test
        u, V_w = windows.columns["u"], windows.columns["V_w"]
        u_rw = u - V_w * np.cos(windows.columns["beta_w"] - windows.columns["psi"])
        for quantity, values in (("u", u), ("u_rw", u_rw)):
            row = rows[name, quantity]
            assert (row["min"], row["mean"], row["max"]) == pytest.approx((values.min(), values.mean(), values.max()))


@pytest.mark.slow
def test_the_sea_trials_test_is_untouched(shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Method, section 5: the 20/20 zigzag at 4150-4350 s; no other window, nor the other part of its fold, sees it."""
    monkeypatch.setenv("SHIPID_DATA", str(shared_data))
    plan = read_plan("full-scale")
    prepared = prepare(plan, obtain_runs(plan))
    assert list(prepared.test.spans) == ["ZZ 20/20"]
    first, last = prepared.test.spans["ZZ 20/20"]
    assert 4150 <= first < last <= 4350
    assert not ((prepared.pool.t <= last) & (prepared.pool.t + 15.0 >= first)).any()
    assert len(prepared.pool.spans) >= 22
    assert any("V_w, beta_w not measured, assumed 0" in note for note in prepared.notes)
    assert "V_w" not in prepared.pool.columns
    for batch in plan.batches:
        windows = prepared.pool.select(np.isin(prepared.pool.run, prepared.runs(batch)))
        for train, validation in prepared.folds(batch, windows, plan.methods[0].method.validation):
            gaps = np.abs(windows.t[train][:, None] - windows.t[validation])
            assert gaps.min() > 15.0
    assert physics_errors(prepared, "accurate")["mean"] < physics_errors(prepared, "inaccurate")["mean"]


def test_a_test_run_that_is_a_copy_of_one_that_trains_is_named(
    recorded: Callable[..., tuple[Plan, Dataset]],
) -> None:
    """With separate clocks nothing kept them apart: a study of copies had an error of millimetres, without a word."""
    log = weaving()
    copy = log.frame[log.frame["run"] == "a"].assign(run="again", t=lambda rows: rows["t"] + 1e4)
    twice = Dataset(pd.concat([log.frame, copy], ignore_index=True), {**log.metadata, "clock": "run"})
    for test, other in (("a", "again"), ("again", "a")):
        plan, dataset = recorded(twice, split={"test": [test, "c"]}, prediction={"ahead": 5.0})
        (note,) = (words for words in prepare(plan, dataset).notes if "copies" in words)
        assert note.startswith(f"runs that move as others do ({test!r} as {other!r}): ")


def test_a_ship_at_rest_is_no_copy(recorded: Callable[..., tuple[Plan, Dataset]]) -> None:
    log = weaving()
    still = log.frame["run"].isin(["a", "b"])
    frame = log.frame.assign(**{name: log.frame[name].mask(still, 0.0) for name in ("u", "v", "r", "psi")})
    plan, dataset = recorded(Dataset(frame, log.metadata), split={"test": ["a"]}, prediction={"ahead": 5.0})
    assert not [words for words in prepare(plan, dataset).notes if "copies" in words]


def test_a_note_counts_the_windows_over_a_time_without_rows(tiny: tuple[Plan, Dataset, PreparedStudy]) -> None:
    """Without max_gap the import leaves a pause of the recorder whole: the study says which windows hold it."""
    plan, dataset, prepared = tiny
    assert not prepared.notes
    run, t = dataset.runs[0], dataset.frame["t"]
    paused = (dataset.frame["run"] == run) & (t > 5) & (t < 12)
    holed = replace(dataset, frame=dataset.frame[~paused].reset_index(drop=True))
    (note,) = over_gaps(holed, all_windows(plan, holed))
    assert f"the longest 7 s after t = 5 s of {run!r}" in note
    assert "set max_gap in [clock]" in note
    assert prepare(plan, holed).notes == (note,)


def test_a_note_says_that_rows_are_farther_apart_than_the_step(tiny: tuple[Plan, Dataset, PreparedStudy]) -> None:
    plan, dataset, _ = tiny
    rare = replace(dataset, frame=dataset.frame[dataset.frame["t"] % 5 == 0].reset_index(drop=True))
    assert prepare(plan, rare).notes == (
        "rows are 5 s apart and the step is 1 s: path and motion between rows are interpolated",
    )


T = np.arange(0.0, 200.0)


def steps(levels: list[float]) -> np.ndarray:
    return np.repeat(np.radians(levels), len(T) // len(levels))


def test_the_mapping_wins_over_the_name_and_the_name_over_the_motion() -> None:
    helm = steps([10, -10, 10, -10, 10, -10, 10, -10])
    columns = {"psi": np.cumsum(-0.05 * helm), "r": -0.05 * helm, "u": 4.0, "port.n": 2.0, "port.alpha": helm}
    runs = {"ZZ 1": columns, "berthing 1": columns, "run 3": columns}
    log = logged(runs, T, manoeuvres={"ZZ 1": "turning"})
    assert kinds_of_runs(log) == {"ZZ 1": "turning", "berthing 1": LOW_SPEED, "run 3": "zigzag"}


def test_a_simulated_run_is_of_the_kind_that_was_drawn(tmp_path: Path) -> None:
    """What its motion looks like is another question: turns of random length look like anything."""
    blocks = [
        {"kind": "zigzag", "n_rpm": 150.0},
        {"kind": "turning", "n_rpm": [100.0, 200.0], "alpha_deg": [-30.0, 30.0]},
        {"kind": "turning_circle", "n_rpm": 150.0},
        {"kind": "excitation", "n_rpm": [100.0, 200.0], "angle_deg": 20.0},
        {"kind": "steps", "n_rpm": [100.0, 200.0], "alpha_deg": [-30.0, 30.0]},
    ]
    for block, kind in zip(blocks, ["zigzag", "turning", "turning", RANDOM, RANDOM], strict=True):
        plan = tiny_plan(tmp_path, {"truth.manoeuvre": [block], "truth.manoeuvres": 10})
        assert set(kinds_of_runs(obtain_runs(plan)).values()) == {kind}
