"""The simulated truth: draws, ranges, and a log that a ship could have written."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.engine.rollout import rollout
from shipid.errors import DocumentError
from shipid.simulation.truth import Sensor, Truth, check_truth, measure_record, simulate_truth
from shipid.simulation.weather import Sea, draw_components, wave_loads
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.conftest import PATCHED

SHIP = load_vessel("gunnerus-28.9")


TURNS = {"n_rpm": (50.0, 200.0), "alpha_deg": (-50.0, 50.0)}


def truth(**changes: Any) -> Truth:
    """A short truth; keys of the manoeuvre go into a block of turns."""
    block = TURNS | {key: changes.pop(key) for key in ("start_speed", "actuators_at", *TURNS) if key in changes}
    short = {"vessel": "gunnerus-28.9", "manoeuvres": 6, "duration": 4.0, "step": 0.1, "seed": 5}
    return Truth(**{**short, "manoeuvre": [block], **changes})


def first_rows(frame: pd.DataFrame) -> pd.DataFrame:
    return frame[frame["t"] == 0.0].reset_index(drop=True)


def planar_rates(run: pd.DataFrame) -> dict[str, np.ndarray]:
    """Rates of position and heading that the logged u, v and r mean."""
    psi, u, v = (run[name].to_numpy() for name in ("psi", "u", "v"))
    north, east = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)
    return {"north": north, "east": east, "psi": run["r"].to_numpy()}


def test_more_manoeuvres_change_none_that_exist() -> None:
    few, many = simulate_truth(truth(), SHIP), simulate_truth(truth(manoeuvres=12), SHIP)
    assert many["run"].nunique() == 12
    pd.testing.assert_frame_equal(many.iloc[: len(few)], few)


def test_draws_fill_their_ranges() -> None:
    """400 draws: inside, uniform (mean within 5 standard errors), and close to both ends."""
    count = 400
    rows = first_rows(simulate_truth(truth(manoeuvres=count, duration=1.0, step=1.0, start_speed=(0.5, 2.5)), SHIP))
    ranges = {
        "port.n": (50 / 60, 200 / 60),
        "port.alpha": (-50 * np.pi / 180, 50 * np.pi / 180),
        "V_w": (0.0, 6.0),
        "beta_w": (0.0, 2 * np.pi),
        "psi": (0.0, 2 * np.pi),
        "u": (0.5, 2.5),
    }
    for name, (low, high) in ranges.items():
        values, width = rows[name].to_numpy(), high - low
        assert low <= values.min() < low + 0.03 * width, name
        assert high - 0.03 * width < values.max() <= high, name
        assert abs(values.mean() - (low + high) / 2) < 5 * width / np.sqrt(12 * count), name
    drawn = rows[list(ranges)].to_numpy()
    off_diagonal = np.corrcoef(drawn.T) - np.eye(len(ranges))
    assert np.abs(off_diagonal).max() < 5 / np.sqrt(count)  # each quantity alone


def test_log_obeys_kinematics() -> None:
    """Positions are the integral of the logged velocities: trapezoid on a fine log."""
    frame = simulate_truth(truth(interval=0.1, duration=8.0, start_speed=(1.0, 3.0)), SHIP)
    for _, run in frame.groupby("run"):
        t = run["t"].to_numpy()
        for name, rate in planar_rates(run).items():
            moved = np.sum((rate[1:] + rate[:-1]) / 2 * np.diff(t))
            assert run[name].iloc[-1] - run[name].iloc[0] == pytest.approx(moved, abs=2e-3)


@pytest.mark.parametrize("name", list(PATCHED))
def test_every_structure_logs_a_dataset(name: str) -> None:
    """What is not measured on board (current) is not logged; heave has the name that datasets give it."""
    base, values = PATCHED[name]
    frame = simulate_truth(truth(manoeuvres=2, duration=2.0), load_vessel(base).with_values(values))
    columns = Dataset(frame, {"clock": "run", "flags": []}).frame.columns
    assert "V_c" not in columns
    assert ("z" in columns) == (name == "six")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"interval": 0.25}, "multiple of step"),
        ({"duration": 0.5}, "holds no interval"),
        ({"n_rpm": (200.0, 50.0)}, "n_rpm has low > high"),
        ({"manoeuvres": 1}, "must be at least 2"),
        ({"wind": 3.0}, "unknown key"),
        ({"wind_speed": (-3.0, -1.0)}, "must be at least 0"),
        ({"current_speed": (-1.0, 0.0)}, "must be at least 0"),
    ],
)
def test_impossible_truths_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(DocumentError, match=message):
        truth(**changes)


SIX = load_vessel("gunnerus-28.9-6dof")
SEA = {"H_s": 1.0, "T_p": 5.0, "components": 20}


def test_waves_move_the_ship_and_differ_by_run() -> None:
    """A sea heaves and rolls her; calm water does not; another manoeuvre has another sea."""
    calm, rough = simulate_truth(truth(duration=20.0), SIX), simulate_truth(truth(duration=20.0, waves=SEA), SIX)
    late = calm["t"] > 5.0
    assert calm.loc[late, "z"].abs().max() < 0.1 < rough.loc[late, "z"].std()
    heave = rough.pivot(index="t", columns="run", values="z").to_numpy()
    assert np.abs(np.corrcoef(heave.T) - np.eye(6)).max() < 0.9
    flat = simulate_truth(truth(duration=20.0, waves={**SEA, "H_s": 0.0}), SIX)
    pd.testing.assert_frame_equal(flat, calm, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "path", "message"),
    [
        ({"waves": SEA}, "truth.waves", "has no [waves]"),
        ({"current_speed": (0.0, 1.0)}, "truth.current_speed", "has no [current]"),
    ],
)
def test_what_a_vessel_cannot_feel_is_refused(changes: dict[str, Any], path: str, message: str) -> None:
    with pytest.raises(DocumentError) as caught:
        simulate_truth(truth(**changes), SHIP)
    assert (caught.value.path, message in str(caught.value)) == (path, True)


@pytest.mark.parametrize(("T_p", "refused"), [(5.0, False), (12.0, False), (20.0, True), (2.5, True)])
def test_a_sea_beyond_the_tables_is_refused(T_p: float, refused: bool) -> None:
    """Short and long waves have no loads in the tables: more than 5 % of the energy may not be lost in silence."""
    given = truth(waves={**SEA, "T_p": T_p})
    if not refused:
        check_truth(given, SIX)
        return
    with pytest.raises(DocumentError, match="of the sea's energy lies outside") as caught:
        check_truth(given, SIX)
    assert caught.value.path == "truth.waves.T_p"


def test_a_current_carries_ship_and_sea_along() -> None:
    """Galilei: the same start through the water, in waves, wind off: heave, roll, pitch and course are the same."""
    ship = SIX.with_values({"current.kind": "uniform", "wind.off": True})
    zero, psi, V_c, beta_c = np.zeros(2), np.array([0.4, 0.4]), np.array([0.0, 1.5]), np.array([0.0, 2.2])
    loads = wave_loads(ship, draw_components(Sea(**SEA), np.array([1.0, 1.0]), ["same", "same"]))
    start = dict.fromkeys(vessel_dynamics(ship).state, zero) | {"psi": psi, "down": zero + 0.2, "theta": zero + 0.05}
    start |= {"u": 3.0 + V_c * np.cos(beta_c - psi) * np.cos(0.05), "v": V_c * np.sin(beta_c - psi)}
    start |= {"w": V_c * np.cos(beta_c - psi) * np.sin(0.05)}
    orders = {name: zero + (2.0 if name.endswith("n") else 0.3) for name in vessel_dynamics(ship).commands}
    path = rollout(
        ship,
        start,
        orders,
        {"V_c": V_c, "beta_c": beta_c},
        step=0.05,
        num_steps=600,
        every=20,
        method="rk4",
        components=loads,
    )
    for name in ("down", "phi", "theta", "psi", "p", "q", "r"):
        np.testing.assert_allclose(path[name][:, 0, 1], path[name][:, 0, 0], atol=1e-8, err_msg=name)
    drift = V_c[1] * 30.0
    np.testing.assert_allclose(path["north"][-1, 0, 1] - path["north"][-1, 0, 0], drift * np.cos(2.2), atol=1e-7)


def test_a_sensor_of_an_output_logs_it() -> None:
    """With a noisy sensor the log has the thrust of one unit, true but for the noise; without one it has none."""
    assert not [name for name in simulate_truth(truth(duration=10.0), SHIP) if str(name).endswith(".thrust")]
    exact, noisy = (
        simulate_truth(truth(duration=10.0, sensors={"port.thrust": {"noise": noise}}), SHIP)["port.thrust"]
        for noise in (0.0, 50.0)
    )
    assert exact.abs().max() > 1000
    assert 20 < np.std(noisy - exact) < 80
    with pytest.raises(DocumentError, match=r"truth.sensors.port.torque: no logged column"):
        simulate_truth(truth(duration=10.0, sensors={"port.torque": {}}), SHIP)


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
