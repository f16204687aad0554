"""Windows against motion known in closed form, and splits against the law that no moment is seen twice."""

from itertools import pairwise
from typing import Any, Literal

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipid.data.windows import (
    Windows,
    covered_time,
    cut_windows,
    fold_masks,
    from_frame,
    gaps_of_runs,
    join_windows,
    nested_runs,
    part_folds,
    part_of_runs,
    run_folds,
    split_folds,
    to_frame,
    windows_over_spans,
)
from shipid.errors import DataError
from tests.logs.conftest import as_dataset, turning

T = np.arange(0.0, 60.5, 0.5)
finite = st.floats(-1e4, 1e4)
NAMES = [f"run {number}" for number in range(17)]


def runs_at(*starts_and_ends: tuple[float, float], **metadata: object) -> Windows:
    """Windows of 10 s of runs a, b, ... on one clock."""
    frames = [turning(np.arange(start, end + 0.25, 0.5)) for start, end in starts_and_ends]
    return cut_windows(as_dataset(*frames, **metadata), horizon=10)


@given(finite, finite, finite, finite, st.floats(-20, 20))
def test_frames_are_inverse_and_keep_distances(north: float, east: float, n0: float, e0: float, psi0: float) -> None:
    x, y = to_frame(north, east, n0, e0, psi0)
    np.testing.assert_allclose(from_frame(x, y, n0, e0, psi0), (north, east), atol=1e-8)
    assert np.hypot(x, y) == pytest.approx(np.hypot(north - n0, east - e0), abs=1e-8)


def test_frame_points_ahead_and_to_starboard() -> None:
    """Heading east: what lies east is ahead (x), what lies south is to starboard (y)."""
    np.testing.assert_allclose(to_frame(0.0, 7.0, 0.0, 0.0, np.pi / 2), (7.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(to_frame(-7.0, 0.0, 0.0, 0.0, np.pi / 2), (0.0, 7.0), atol=1e-12)


@pytest.mark.parametrize(("path", "tolerance"), [("position", 1e-9), ("velocity", 60 * (0.05 * 0.5) ** 2 / 12)])
def test_steady_turn(path: str, tolerance: float) -> None:
    """x_i = (u sin(r t) - v (1 - cos(r t))) / r, y_i = (u (1 - cos(r t)) + v sin(r t)) / r, the same everywhere."""
    u, v, r = 4.0, -0.5, 0.05
    windows = cut_windows(as_dataset(turning(T)), horizon=15, path=path)  # type: ignore[arg-type]
    turn = r * np.arange(1, 16)[:, None]
    x, y = (u * np.sin(turn) - v * (1 - np.cos(turn))) / r, (u * (1 - np.cos(turn)) + v * np.sin(turn)) / r
    np.testing.assert_allclose(windows.future[..., 0], np.broadcast_to(x, (15, 46)), atol=tolerance)
    np.testing.assert_allclose(windows.future[..., 1], np.broadcast_to(y, (15, 46)), atol=tolerance)


def weaving(t: np.ndarray) -> pd.DataFrame:
    """A consistent log on an irregular clock; positions by the trapezoid rule on a clock a hundred times finer."""
    fine = np.interp(np.linspace(0, len(t) - 1, 100 * (len(t) - 1) + 1), np.arange(len(t)), t)
    psi, u, v = 3.1 + 0.5 * np.sin(0.1 * fine), 5 + np.cos(0.07 * fine), 0.4 * np.sin(0.1 * fine)
    rates = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)
    north, east = (np.append(0, np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(fine))) for rate in rates)
    values = {"t": fine, "north": north, "east": east, "psi": psi, "u": u, "v": v, "r": 0.05 * np.cos(0.1 * fine)}
    return pd.DataFrame({name: column[::100] for name, column in values.items()}).assign(**{"port.n": 2.0})


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(("apart", "share"), [(2.0, 0.05), (5.0, 0.15)])
def test_between_coarse_rows_the_path_turns_with_the_ship(seed: int, apart: float, share: float) -> None:
    """Chords were the truth before: a predictor was judged by them and learned them. A current changes no digit."""
    rng = np.random.default_rng(seed)
    u, v, r = rng.uniform(2, 8), rng.uniform(-0.5, 0.5), rng.choice([-1, 1]) * rng.uniform(0.01, 0.04)
    few, many = (turning(np.arange(0.0, 101.0, step), u=u, v=v, r=r) for step in (apart, 1.0))
    coarse, true = (cut_windows(as_dataset(f), horizon=20, step=1.0, interval=apart) for f in (few, many))
    np.testing.assert_array_equal(coarse.t, true.t)
    whole = int(apart)
    np.testing.assert_allclose(coarse.future[whole - 1 :: whole], true.future[whole - 1 :: whole], atol=1e-9)
    sagitta = np.hypot(u, v) * abs(r) * apart**2 / 8
    assert np.linalg.norm(coarse.future - true.future, axis=-1).max() < share * sagitta
    adrift = few.assign(u=u - 0.3 * np.cos(few["psi"]), v=v + 0.3 * np.sin(few["psi"]))
    current = cut_windows(as_dataset(adrift), horizon=20, step=1.0, interval=apart)
    np.testing.assert_allclose(current.future, coarse.future, atol=0.01 * sagitta)


def test_only_rows_farther_apart_than_the_step_bend_the_path_and_only_by_right_velocities() -> None:
    """At rows, and where rows are no farther apart, a path is that of the positions to the bit; so with a stuck u."""
    frame = weaving(np.arange(0.0, 200.0, 5.0))
    stuck = frame.assign(u=0.0, v=0.0)
    for step, interval in ((5.0, 5.0), (7.5, 5.0), (10.0, 10.0)):
        one, other = (cut_windows(as_dataset(f), horizon=4, step=step, interval=interval) for f in (frame, stuck))
        np.testing.assert_array_equal(one.future, other.future)
    bent, straight = (cut_windows(as_dataset(f), horizon=20, step=1.0, interval=5.0, past=6) for f in (frame, stuck))
    at_row = np.arange(1, 21) % 5 == 0
    np.testing.assert_array_equal(bent.future[at_row], straight.future[at_row])
    assert np.abs(bent.future[~at_row] - straight.future[~at_row]).max() > 0.1
    chords = np.diff(np.concatenate([np.zeros((1, len(straight), 2)), straight.future]), axis=0)[:5]
    np.testing.assert_allclose(chords, np.broadcast_to(chords[:1], chords.shape), atol=1e-9)
    for name in ("x", "y"):  # pasts stay straight, as in exported predictors
        np.testing.assert_array_equal(bent.past[name], straight.past[name])


def test_instants_commands_and_columns() -> None:
    """The command of step i is the mean of the orders in force from i-1 to i; n changes every 7 s in this log."""
    windows = cut_windows(as_dataset(turning(T)), horizon=15, step=2.0, interval=3.0)
    assert windows.t.tolist() == list(range(0, 31, 3))
    first, second = (np.floor((windows.t + 2.0 * np.arange(15)[:, None] + later) / 7.0) for later in (0.0, 1.0))
    np.testing.assert_allclose(windows.planned["port.n"], (first + second) / 2, rtol=0, atol=1e-12)
    whole = first == second
    np.testing.assert_array_equal(windows.planned["port.n"][whole], first[whole])  # to the bit
    np.testing.assert_array_equal(windows.columns["port.n"], first[0])
    assert set(windows.columns) == {"north", "east", "psi", "u", "v", "r", "port.n", "flags"}
    assert windows.future.shape == (15, 11, 2)


def test_no_future_leaves_its_run_or_crosses_a_break() -> None:
    broken = turning(T).assign(flags=np.where(T == 25.0, 1, 0))
    windows = cut_windows(as_dataset(broken, turning(T[:41])), horizon=10)
    starts = [float(t) for t in windows.t[windows.run == "a"]]
    assert starts == [float(t) for t in (*range(15), *range(25, 51))]
    assert windows.t[windows.run == "b"].max() == 10.0


def test_select_and_concatenate_are_inverse() -> None:
    windows = runs_at((0, 30), (50, 80))
    mask = windows.run == "a"
    again = join_windows([windows.select(mask), windows.select(~mask)])
    np.testing.assert_array_equal(again.future, windows.future)
    np.testing.assert_array_equal(again.run, windows.run)
    assert len(windows.select([0, 5])) == 2
    np.testing.assert_array_equal(windows.select(slice(3, 5)).planned["port.n"], windows.planned["port.n"][:, 3:5])


def test_touching_is_closed_and_counts_the_future() -> None:
    windows = runs_at((0, 60))
    assert windows.t[windows.touching([(20.0, 25.0)])].tolist() == list(range(10, 26))
    assert windows.touching([]).sum() == 0


spans = st.tuples(st.integers(0, 150), st.integers(20, 60)).map(lambda pair: (float(pair[0]), float(sum(pair))))


@given(st.lists(spans, min_size=2, max_size=6), st.data())
def test_no_moment_is_seen_by_both_parts(runs: list[tuple[float, float]], data: st.DataObject) -> None:
    windows = runs_at(*runs)
    names = sorted(windows.spans)
    validating = data.draw(st.lists(st.sampled_from(names), min_size=1, unique=True))
    others = ~np.isin(windows.run, validating)
    if windows.touching([windows.spans[name] for name in validating])[others].all():
        with pytest.raises(DataError, match="no training window is left"):
            fold_masks(windows, validating)
        return
    training, validation = fold_masks(windows, validating)
    assert set(windows.run[validation]) == set(validating)
    apart = (windows.end[training][:, None] < windows.t[validation]) | (
        windows.t[training][:, None] > windows.end[validation]
    )
    assert apart.all()
    lost = ~training & ~validation
    inside = [windows.touching([windows.spans[name]]) for name in validating]
    np.testing.assert_array_equal(lost, np.any(inside, axis=0) & ~validation)  # and none is lost in vain


def test_runs_with_separate_clocks_do_not_exclude_each_other() -> None:
    windows = runs_at((0, 30), (0, 30), (0, 30), clock="run")
    training, validation = fold_masks(windows, ["b"])
    assert (training.sum(), validation.sum()) == (42, 21)
    with pytest.raises(DataError, match="no training window"):
        fold_masks(runs_at((0, 30), (0, 30), (0, 30)), ["b"])


@given(st.lists(spans, min_size=1, max_size=5), st.booleans(), st.data())
def test_covered_is_the_time_that_is_touched(
    runs: list[tuple[float, float]], shared: bool, data: st.DataObject
) -> None:
    """Counted second by second: windows of 10 s start at whole seconds."""
    windows = runs_at(*runs, clock="shared" if shared else "run")
    windows = windows.select(data.draw(st.lists(st.integers(0, len(windows) - 1), min_size=1)))
    seen = {
        ("" if shared else str(run), int(t) + second)
        for run, t in zip(windows.run, windows.t, strict=True)
        for second in range(10)
    }
    assert covered_time(windows) == pytest.approx(len(seen))


@given(st.integers(2, 17), st.integers(0, 2**32))
def test_folds_deal_every_run_once(num_folds: int, seed: int) -> None:
    folds = split_folds(NAMES, num_folds, seed)
    assert sorted(name for fold in folds for name in fold) == sorted(NAMES)
    assert max(map(len, folds)) - min(map(len, folds)) <= 1
    assert folds == split_folds(reversed(NAMES), num_folds, seed)


@given(st.sets(st.integers(1, 17), min_size=1), st.integers(0, 2**32))
def test_draws_are_nested(amounts: set[int], seed: int) -> None:
    draws = nested_runs(NAMES, amounts, seed)
    assert {amount: len(set(names)) for amount, names in draws.items()} == {amount: amount for amount in amounts}
    ordered = [set(draws[amount]) for amount in sorted(amounts)]
    assert all(smaller < larger for smaller, larger in pairwise(ordered))
    assert draws[max(amounts)] == nested_runs(NAMES, [max(amounts)], seed)[max(amounts)]


@pytest.mark.parametrize(
    ("validation", "num_folds", "expected"),
    [("runs", 1, [1] * 10), ("share", 1, [2]), ("runs", 3, [3, 3, 4]), ("share", 4, [2, 2, 3, 3])],
)
def test_few_runs_validate_and_all_others_train(validation: str, num_folds: int, expected: list[int]) -> None:
    """Every run in turn; a fifth of them; or dealt into folds: the second indices are those that judge."""
    windows = runs_at(*((100.0 * k, 100.0 * k + 30.0) for k in range(10)), clock="run")
    judges = []
    for training, judged in run_folds(windows, validation, 3, num_folds):
        names = set(windows.run[judged])
        judges.append(sorted(names))
        assert names.isdisjoint(windows.run[training])
        np.testing.assert_array_equal(np.sort(np.concatenate([training, judged])), np.arange(len(windows)))
    assert sorted(map(len, judges)) == expected
    if len(judges) > 1:
        assert sorted(name for names in judges for name in names) == sorted(windows.spans)


@given(st.integers(10, 60), st.integers(1, 12))
def test_parts_of_one_run_share_no_moment(length: int, horizon: int) -> None:
    windows = cut_windows(as_dataset(turning(np.arange(0.0, length + horizon + 0.5))), horizon=horizon)
    second = -(-(length + 1) // 2)  # instant where the second half begins: each half must see an end of the other
    if horizon >= second or second - 1 + horizon >= length:
        with pytest.raises(DataError, match="too short"):
            part_folds(windows)
        return
    folds = part_folds(windows)
    np.testing.assert_array_equal(np.sort(np.concatenate([part for _, part in folds])), np.arange(len(windows)))
    for training, validation in folds:
        seen = windows.select(validation)
        span = float(seen.t.min()), float(seen.end.max())
        assert len(training)
        assert not windows.select(training).touching([span]).any()


# Nothing looks ahead.


def wandering(seed: int, offset: float) -> pd.DataFrame:
    """A run on an irregular clock: steps of 0.05 to 3 s, angles that wrap, an order at random rows."""
    rng = np.random.default_rng(seed)
    t = offset + np.cumsum(rng.choice([0.05, 0.1, 0.5, 1.0, 1.0, 1.0, 1.3, 3.0], 120) * rng.uniform(1.0, 1.0005, 120))
    frame = turning(t - offset).assign(t=t, **{"port.n": np.round(rng.uniform(0, 2, 120), 1)})
    return frame.assign(
        psi=frame["psi"] % (2 * np.pi), u=rng.normal(5.0, 1.0, 120), V_w=3.0, beta_w=rng.uniform(0, 6, 120)
    )


@pytest.mark.parametrize("path", ["position", "velocity"])
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.0, 1.7e9]),
    st.sampled_from([0.3, 0.5, 1.0]),
    st.sampled_from([0.4, 1.0, 2.5]),
    st.integers(0, 4),
    st.floats(0.2, 0.9),
)
@settings(max_examples=40, deadline=None)
def test_a_later_row_changes_no_input(
    path: Literal["position", "velocity"],
    seed: int,
    offset: float,
    step: float,
    interval: float,
    past: int,
    share: float,
) -> None:
    """Every row after a moment changed: inputs of windows up to it stay, bit for bit, whatever the clock of the log."""
    frame = wandering(seed, offset)
    now = float(frame["t"].iloc[int(share * len(frame))])
    later, changed = frame["t"].to_numpy() > now, frame.copy()
    for name in ("north", "east", "psi", "u", "v", "r", "port.n", "V_w", "beta_w"):
        changed.loc[later, name] += 7.0
    one, other = (
        cut_windows(as_dataset(f), horizon=5, step=step, interval=interval, path=path, past=past)
        for f in (frame, changed)
    )
    np.testing.assert_array_equal(one.t, other.t)
    assert set(one.t) <= set(frame["t"])
    known = one.t <= now
    assert known.any()
    for name, values in one.columns.items():
        np.testing.assert_array_equal(other.columns[name][known], values[known], err_msg=name)
    for name, values in one.past.items():
        np.testing.assert_array_equal(other.past[name][:, known], values[:, known], err_msg=name)
    np.testing.assert_array_equal(other.columns["u"] != one.columns["u"], ~known)
    # whole pasts and futures, and no instant twice
    assert (one.begin >= frame["t"].iloc[0] - 1e-4).all()
    assert (one.end <= frame["t"].iloc[-1] + 1e-4).all()
    assert len(np.unique(one.t)) == len(one)


def test_an_instant_between_rows_is_the_row_before() -> None:
    """By hand: rows every 0.7 s, an instant wished every 1 s; the motion, the order and the past are those by then."""
    t = 0.7 * np.arange(40)
    frame = turning(t).assign(u=np.arange(40.0), **{"port.n": np.arange(40.0)})
    windows = cut_windows(as_dataset(frame), horizon=4, step=1.4, past=1)
    rows = np.array([2, 3, 4, 6, 7, 9])  # the last at or before 1.4, 2.4, 3.4 ... s
    np.testing.assert_allclose(windows.t[:6], 0.7 * rows)
    np.testing.assert_array_equal(windows.columns["u"][:6], rows)
    np.testing.assert_array_equal(windows.columns["port.n"][:6], rows)
    np.testing.assert_allclose(windows.past["u"][0, :6], rows - 2)
    np.testing.assert_allclose(windows.states["u"][:, 0], 2 + 2 * np.arange(1, 5))


# Windows with a past.


@pytest.mark.parametrize("path", ["position", "velocity"])
def test_a_past_is_in_the_frame_of_the_instant(path: str) -> None:
    """In a steady turn the past is the future with time reversed."""
    u, v, r = 4.0, -0.5, 0.05
    windows = cut_windows(as_dataset(turning(T)), horizon=15, path=path, past=6)  # type: ignore[arg-type]
    assert windows.t[0] == T[0] + 6.0
    assert windows.num_past == 6
    assert {values.shape for values in windows.past.values()} == {(6, len(windows))}
    turn = r * np.arange(-6, 0)[:, None]
    x, y = (u * np.sin(turn) - v * (1 - np.cos(turn))) / r, (u * (1 - np.cos(turn)) + v * np.sin(turn)) / r
    np.testing.assert_allclose(
        windows.past["x"], np.broadcast_to(x, (6, len(windows))), atol=60 * (0.05 * 0.5) ** 2 / 12
    )
    np.testing.assert_allclose(
        windows.past["y"], np.broadcast_to(y, (6, len(windows))), atol=60 * (0.05 * 0.5) ** 2 / 12
    )
    np.testing.assert_allclose(
        windows.states["psi"] - windows.columns["psi"], r * np.arange(1, 16)[:, None] + 0 * windows.t
    )
    for name, value in (("u", u), ("v", v), ("r", r)):
        np.testing.assert_allclose(windows.states[name], value)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"horizon": 5.5}, "horizon must be a whole number"),
        ({"horizon": "5"}, "horizon must be a whole number"),
        ({"past": 2.5}, "past must be a whole number, 0 or more, not 2.5"),
        ({"past": -3}, "past must be a whole number, 0 or more, not -3"),
        ({"path": "speed"}, "path 'speed' is not known: valid: position, velocity"),
        ({"step": "1"}, "step must be a number"),
        ({"step": np.nan}, "step must be a number above 0 and finite, not nan"),
        ({"interval": 0.0}, "interval must be a number above 0 and finite, not 0"),
        ({"horizon": 200}, "no run is as long as the horizon of 200 s"),
        ({"step": 1e300}, "no run is as long as the horizon of"),
    ],
)
def test_windows_of_a_wrong_argument_are_refused(wrong: dict[str, Any], message: str) -> None:
    """Before, half a step of the past was cut off at the begin of a run, and an unknown path was the position."""
    with pytest.raises(DataError, match=message):
        cut_windows(as_dataset(turning(T)), **{"horizon": 5, **wrong})


def test_windows_are_chosen_by_masks_indices_and_slices() -> None:
    windows = cut_windows(as_dataset(turning(T)), horizon=5, past=2)
    some = windows.select(slice(1, 3))
    every: tuple[Any, ...] = ((1, 2), range(1, 3), np.array([1, 2], dtype=np.uint8), windows.t == windows.t[1:3, None])
    for chosen in (*every[:3], every[3].any(axis=0), pd.Series(every[3].any(axis=0))):
        np.testing.assert_array_equal(windows.select(chosen).future, some.future)
        np.testing.assert_array_equal(windows.instants().select(chosen).past["x"], some.past["x"])
    assert len(windows.select(np.array([]))) == 0


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        (None, "give a mask, indices or a slice of .* entries to select by, not None"),
        (0, "give a mask"),
        ([[0, 1]], "give a mask"),
        ([0.0], "give a mask"),
        ([True, False], "give a mask"),
        ([99], r"not \[99\]"),
    ],
)
def test_what_chooses_no_windows_is_refused(chosen: Any, message: str) -> None:
    """Before, None gave one window with all the others in it."""
    windows = cut_windows(as_dataset(turning(T)), horizon=5)
    for part in (windows, windows.instants()):
        with pytest.raises(DataError, match=message):
            part.select(chosen)


def test_an_interval_far_below_the_rows_gives_every_row() -> None:
    dataset = as_dataset(turning(np.arange(0.0, 60.0, 0.5)))
    every = cut_windows(dataset, horizon=5, step=1.0, interval=0.5)
    for interval in (0.1, 1e-3, 1e-12):
        np.testing.assert_array_equal(cut_windows(dataset, horizon=5, step=1.0, interval=interval).t, every.t)


def test_windows_over_a_time_without_rows_are_found() -> None:
    """A recorder that paused from 20 to 30 s; windows of 10 s that end at 20 s, or begin at 30 s, see nothing of it."""
    paused = turning(T[(T <= 20) | (T >= 30)])
    dataset = as_dataset(paused, turning(T))
    spans = gaps_of_runs(dataset, 1.0)
    assert spans == {"a": [(20.0, 30.0)]}
    windows = cut_windows(dataset, horizon=10)
    over = windows_over_spans(windows, spans)
    np.testing.assert_array_equal(over, (windows.run == "a") & (windows.t > 10) & (windows.t < 30))
    assert gaps_of_runs(dataset, 10.0) == {}  # a step of the prediction as long
    assert gaps_of_runs(as_dataset(turning(T[::2]), turning(T)), 0.1) == {}  # rows of another interval are no hole


@pytest.mark.parametrize("seed", range(5))
def test_windows_are_taken_evenly_from_each_run(seed):
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 60, rng.integers(1, 12))
    run = np.repeat([f"run {number}" for number in range(len(lengths))], lengths)
    most = int(rng.integers(1, 2 * len(run)))
    taken = part_of_runs(run, most)
    if len(run) <= most:
        np.testing.assert_array_equal(taken, np.arange(len(run)))
        return
    assert (np.diff(taken) > 0).all()
    counts = np.array([(run[taken] == name).sum() for name in np.unique(run)])
    shares = np.array([(run == name).sum() for name in np.unique(run)]) * most / len(run)
    assert (counts >= 1).all()
    assert (np.abs(counts - np.maximum(shares, 1)) <= 0.5).all()
    for name in np.unique(run):
        steps = np.diff(taken[run[taken] == name])
        assert len(steps) == 0 or np.ptp(steps) <= 1
