"""A clean log passes every check; each defect put into it fails the check for it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from shipid.data.checks import (
    check_dataset,
    constant_commands,
    stuck_spans,
    warn_of_constant_commands,
    white_noise_of,
)
from shipid.data.dataset import Dataset, cumulative_integral
from tests.drawn import seeds
from tests.logs.conftest import as_dataset, turning

T = np.arange(0.0, 120.0, 0.5)


def failed(*frames: pd.DataFrame) -> set[str]:
    table = check_dataset(as_dataset(*frames))
    return set(table.loc[~table["ok"], "check"])


def test_clean_log_passes() -> None:
    table = check_dataset(as_dataset(turning(T), turning(T, r=-0.03).assign(t=T + 500.0)))
    assert table["ok"].all()
    assert list(table.columns) == ["check", "run", "value", "unit", "limit", "ok", "sentence"]
    assert not table.duplicated(["check", "run"]).any()


@pytest.mark.parametrize(
    ("defect", "caught"),
    [
        (lambda f: f.drop(index=range(50, 60)).reset_index(drop=True), {"gap", "jitter"}),
        (lambda f: f.assign(t=f["t"] + np.random.default_rng(0).uniform(-0.1, 0.1, len(f))), {"jitter"}),
        (lambda f: f.assign(r=np.degrees(f["r"])), {"range r"}),
        (lambda f: f.assign(r=60 * np.degrees(f["r"])), {"range r"}),
        (lambda f: f.assign(**{"port.n": f["port.n"] * 60}), {"range port.n"}),
        (lambda f: f.iloc[np.repeat(np.arange(0, 240, 2), 2)].reset_index(drop=True).assign(t=T), {"frozen"}),
    ],
)
def test_defect_fails_its_check(defect: Callable[[pd.DataFrame], pd.DataFrame], caught: set[str]) -> None:
    frame = turning(T)
    wobble = 0.02 * np.sin(0.1 * T)  # a rate that varies, so that correlation means something
    frame["r"] += wobble
    frame["psi"] += 0.2 * (1 - np.cos(0.1 * T))
    rates = [np.cos(frame["psi"]) * 4 + np.sin(frame["psi"]) / 2, np.sin(frame["psi"]) * 4 - np.cos(frame["psi"]) / 2]
    for name, rate in zip(("north", "east"), rates, strict=True):
        frame[name] = np.append(0.0, np.cumsum((rate[1:].to_numpy() + rate[:-1].to_numpy()) / 2 * 0.5))
    assert failed(frame) == set()
    assert caught <= failed(defect(frame))


def test_a_small_craft_on_the_spot_passes() -> None:
    """It turns at 36 to 200 deg/s, its electric screws at 60 rev/s."""
    for rate in np.radians([36.0, -120.0, 200.0]):
        t = np.arange(0.0, 30.0, 0.05)
        assert failed(turning(t, u=0.3, v=0.0, r=rate).assign(**{"port.n": 60.0 * np.sin(t)})) == set()


@pytest.mark.parametrize("signal", ["psi", "r", "course", "speed"])
@pytest.mark.parametrize("seed", seeds(1, 5))
def test_a_stuck_sensor_is_named_and_a_steady_one_is_not(signal: str, seed: int) -> None:
    """One sensor repeats its value for a fifth of a run in which the ship slows down, speeds up and turns."""
    random = np.random.default_rng(seed)
    pace = random.uniform(0.3, 10.0)  # s
    t = pace * np.arange(0.0, 100.0, random.choice([0.05, 0.1, 0.2]))
    swing, speed = 0.3 / pace * np.sin(0.21 * t / pace), random.uniform(0.3, 8.0) * (1 + 0.4 * np.sin(0.13 * t / pace))
    psi = random.uniform(-3, 3) + cumulative_integral(t, swing)
    course = psi - 0.3 * np.sin(0.21 * t / pace)
    place = cumulative_integral(t, speed * np.cos(course)) + 1j * cumulative_integral(t, speed * np.sin(course))
    for share in (0.0, 0.2):
        stuck = {"psi": psi.copy(), "r": swing.copy(), "course": course.copy(), "speed": speed.copy()}
        first = int(random.uniform(0.1, 0.7) * len(t))
        stuck[signal][first : first + int(share * len(t))] = stuck[signal][first]
        body = stuck["speed"] * np.exp(1j * (stuck["course"] - stuck["psi"]))
        frame = pd.DataFrame({"t": t, "north": place.real, "east": place.imag, "psi": stuck["psi"], "u": body.real})
        table = check_dataset(as_dataset(frame.assign(v=body.imag, r=stuck["r"])))
        (row,) = table[table["check"] == "frozen"].to_dict("records")
        assert row["ok"] == (share == 0.0)
        assert share == 0.0 or f"repeat the {signal} of the row before, which the other" in row["sentence"]


@pytest.mark.parametrize("seed", [1])
def test_uneven_times_fail_where_the_motion_contradicts_them(seed: int) -> None:
    """Steps of 0.95 and 1.04 s, as days with six decimals have, failed whatever the noise of the positions."""
    random, t = np.random.default_rng(seed), np.arange(0.0, 300.0)
    uneven = t + random.uniform(-0.2, 0.2, len(t))

    def logged(of: np.ndarray, times: np.ndarray, noise: float) -> set[str]:
        frame, sizes = (
            turning(of).assign(t=times, **{"port.n": 2.0}),
            {"north": noise, "east": noise, "psi": 0.01 * noise},
        )
        return failed(
            frame.assign(**{name: frame[name] + random.normal(0, std, len(t)) for name, std in sizes.items()})
        )

    assert logged(uneven, uneven, 0.1) == set()  # sampled at these times
    assert logged(t, uneven, 0.1) == {"jitter"}  # sampled each second
    assert logged(t, 0.0864 * np.round(t / 0.0864), 0.5) == set()


def test_shared_rows_are_reported() -> None:
    assert "overlap" in failed(turning(T), turning(T + 10.0))
    table = check_dataset(as_dataset(turning(T), turning(T)))
    assert table.loc[table["check"].eq("overlap"), "sentence"].str.startswith("100 % of the rows belong").all()


def noisy(seed: int) -> pd.DataFrame:
    """A run in good order with the noise of drawn sensors: a ship that weaves or turns."""
    random = np.random.default_rng(seed)
    step = random.choice([0.1, 0.5, 1.0])
    t = np.arange(0.0, 240.0, step)
    rate = random.uniform(0.01, 0.05) * np.sin(2 * np.pi * t / random.uniform(40, 150) + random.uniform(0, 6))
    psi = np.append(0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * step))
    way = 5.0 * np.exp(1j * psi)
    place = np.append(0.0, np.cumsum((way[1:] + way[:-1]) / 2 * step))
    noise = {"north": 0.5, "east": 0.5, "psi": np.radians(0.3), "u": 0.1, "v": 0.1, "r": np.radians(0.3)}
    frame = pd.DataFrame({"t": t, "north": place.real, "east": place.imag, "psi": psi, "u": 5.0, "v": 0.0, "r": rate})
    frame["port.n"] = 2.0
    scale = random.uniform(0, 2)
    return frame.assign(**{name: frame[name] + random.normal(0, scale * std, len(t)) for name, std in noise.items()})


@pytest.mark.slow
def test_noise_alone_is_no_finding() -> None:
    """Of a hundred clean runs with noise fewer than 2 % have a finding."""
    assert sum(bool(failed(noisy(seed))) for seed in range(100)) < 2


def test_a_run_contained_in_another_is_detected_on_another_clock() -> None:
    whole = noisy(1)
    part = whole.iloc[len(whole) // 3 : len(whole) // 2].assign(t=lambda f: f["t"] - f["t"].iloc[0])
    part = part.reset_index(drop=True)
    table = check_dataset(as_dataset(whole, part, clock="run"))
    row = table[(table["check"] == "overlap") & (table["run"] == "b")].iloc[0]
    assert not row["ok"]
    assert "'a'" in row["sentence"]
    assert table[(table["check"] == "overlap") & (table["run"] == "a")].iloc[0]["ok"]


def test_the_noise_of_a_straight_signal_is_that_put_into_it() -> None:
    line = 3.0 + 0.2 * np.arange(4000)
    noise = np.random.default_rng(0).normal(0, 0.5, len(line))
    assert white_noise_of(line + noise) == pytest.approx(0.5, rel=0.05)
    assert white_noise_of(line) < 1e-9
    assert white_noise_of(noise[:4]) == 0.0  # too few to say


@pytest.mark.parametrize("seed", seeds(1, 20))
def test_a_yaw_rate_in_degrees_fails_and_one_with_a_bias_and_noise_passes(seed: int) -> None:
    """On straight runs, steps of the helm to both sides and circles, of ships that turn slowly enough for any limit."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, 200.0, random.choice([0.2, 1.0, 2.0]))
    turn = np.radians(random.uniform(0.5, 3.0))  # 3 taken for rad/s is below the limit
    for true in (0.0 * t, turn * np.sign(np.sin(0.1 * t)), turn * (t > 60.0)):
        psi = cumulative_integral(t, true) + random.normal(0.0, 0.002, len(t))
        read = true + random.normal(0.0, 0.002, len(t)) + random.normal(0.0, 0.01)
        log = turning(t, u=3.0, v=0.0).assign(psi=np.angle(np.exp(1j * psi)))
        assert "range r" not in failed(log.assign(r=read))
        if true.any():
            assert "range r" in failed(log.assign(r=np.degrees(read)))


STEP, COUNT, FIRST, LAST = 0.5, 600, 200, 300


@pytest.mark.parametrize("name", ["psi", "r", "course", "speed"])
@pytest.mark.parametrize("seed", seeds(2, 10))
def test_a_value_that_stays_in_a_turn_is_stuck_and_on_a_straight_course_it_is_not(seed: int, name: str) -> None:
    random, t = np.random.default_rng(seed), STEP * np.arange(COUNT)
    for most in (random.uniform(0.5, 1.5), 0.0):  # deg/s
        r = np.radians(most) * np.sin(t / random.uniform(20.0, 60.0)) + most * 1e-4
        psi, speed = np.cumsum(r) * STEP, 4.0 + most * np.sin(t / 30.0)
        velocity = speed * np.exp(1j * psi)
        seen = {"psi": psi, "r": r, "course": psi, "speed": speed}[name] + random.normal(0.0, 1e-4, COUNT)
        repeated = np.concatenate([seen[:FIRST], np.full(LAST - FIRST, seen[FIRST]), seen[LAST:]])
        parts = {"psi": psi, "r": r, "speed": speed}
        if most and name in parts:
            parts[name] = repeated
        pose, rates = (parts["psi"], np.cumsum(velocity) * STEP), (parts["r"], parts["speed"] * np.exp(1j * psi))
        spans = stuck_spans(name, t, repeated, pose, rates, np.ones(COUNT - 1, dtype=bool))
        assert spans == ([(FIRST, LAST - 1)] if most else [])


N = 200
HELD = {"rudder.delta": np.full(N, 0.35), "propeller.n": np.full(N, 10.0)}


def log(*changes: dict[str, np.ndarray]) -> Dataset:
    """Runs with one helm and one shaft speed, but for what changes."""
    motion = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    frames = [
        pd.DataFrame({"run": f"run {i}", "t": np.arange(float(N)), **motion, **HELD, **change, "flags": 0})
        for i, change in enumerate(changes)
    ]
    return Dataset(pd.concat(frames, ignore_index=True).astype({"run": "str"}), {"clock": "run", "flags": []})


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_commands_that_are_the_same_in_all_runs_are_named(noise: float) -> None:
    rng = np.random.default_rng(1)
    noisy = [{name: x + noise * np.abs(x) * rng.standard_normal(N) for name, x in HELD.items()} for _ in range(5)]
    dataset = log(*noisy)
    (words,) = warn_of_constant_commands(dataset, dataset.runs)
    assert set(constant_commands(dataset, dataset.runs)) == set(HELD)
    assert "rudder.delta" in words
    assert "are the same in all 5 runs: what they do cannot be learnt" in words
    assert "is the same" not in words
    assert "throughout the only run" in warn_of_constant_commands(dataset, ["run 0"])[0]


@pytest.mark.parametrize("where", ["one run", "a moment", "between runs"])
def test_a_command_that_varies_anywhere_varies(where: str) -> None:
    other = HELD["rudder.delta"].copy()
    other[slice(60, 65) if where == "a moment" else slice(100, N) if where == "one run" else slice(None)] = -0.1
    dataset = log({}, {}, {}, {"rudder.delta": other})
    assert constant_commands(dataset, dataset.runs) == ("propeller.n",)
    assert warn_of_constant_commands(dataset, dataset.runs) == []
    assert warn_of_constant_commands(dataset, ["run 0", "run 1"]) != []


def one_run(rows: int, step: float = 1.0, **commands: np.ndarray) -> Dataset:
    """A run of so many rows; names of commands with _ for the point."""
    columns = {name.replace("_", "."): x for name, x in commands.items()}
    motion = dict.fromkeys(("north", "east", "psi", "u", "v", "r"), 0.0)
    frame = pd.DataFrame({"run": "long", "t": step * np.arange(rows), **motion, **columns, "flags": 0})
    return Dataset(frame.astype({"run": "str"}), {"clock": "run", "flags": []})


@pytest.mark.parametrize(
    ("hours", "step", "lasts", "size", "held"),
    [
        (1, 1.0, 20.0, 5.0, False),
        (1 / 6, 1.0, 5.0, 5.0, False),
        (10, 1.0, 5.0, 5.0, False),
        (10, 0.1, 5.0, 5.0, False),
        (10, 10.0, 10.0, 5.0, False),
        (1, 1.0, 20.0, 3.0, False),
        (1, 1.0, 20.0, 1.5, True),
        (1, 1.0, 1.0, 35.0, True),
        (1, 0.1, 1.0, 35.0, True),
        (1 / 6, 1.0, 1.0, 35.0, False),
    ],
)
def test_a_short_kick_in_a_long_run_varies(hours: float, step: float, lasts: float, size: float, held: bool) -> None:
    """The scatter of a whole run shrinks with its length; what is one faulty row in a thousand is no kick."""
    rows = round(3600 * hours / step)
    helm = np.zeros(rows)
    for begin in (0, rows // 2, rows - round(lasts / step)):
        moved = helm.copy()
        moved[begin : begin + round(lasts / step)] = np.radians(size)
        log = one_run(rows, step, rudder_delta=moved, propeller_n=np.full(rows, 2.0))
        assert ("rudder.delta" in constant_commands(log, log.runs)) == held
        assert bool(warn_of_constant_commands(log, log.runs)) == held


@pytest.mark.parametrize(("angle", "share", "held"), [(0.4, 0.008, True), (0.65, 0.013, False)])
def test_noise_of_feedback_is_no_order(angle: float, share: float, held: bool) -> None:
    """Standard deviations of 0.5 deg and of 1 % count as none, in a run of any length."""
    rng = np.random.default_rng(2)
    for rows in (100, 100_000):
        helm = 0.1 + np.radians(angle) * rng.standard_normal(rows)
        log = one_run(rows, rudder_delta=helm, propeller_n=2.0 * (1 + share * rng.standard_normal(rows)))
        assert constant_commands(log, log.runs) == (("rudder.delta", "propeller.n") if held else ())
