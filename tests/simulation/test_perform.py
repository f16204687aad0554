"""The log of performed manoeuvres: columns, times, weather, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import ShipidError
from shipid.simulation.manoeuvre import (
    Manoeuvre,
    TurningCircle,
    Zigzag,
)
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.weather import Sea, draw_components, wave_loads
from shipid.units import DEGREE
from shipid.vessel.load import load_vessel
from tests.conftest import LAG

SHIP = load_vessel("gunnerus-28.9")
LAGGED = SHIP.with_values({f"thruster.{side}.actuator": LAG for side in ("port", "starboard")})
CIRCLE = TurningCircle(n_rpm=120, duration=20)


def test_log_is_a_dataset_without_what_the_actuators_reached() -> None:
    frame = perform_manoeuvres(LAGGED, [CIRCLE, Zigzag(n_rpm=120, duration=30)], step=0.1, interval=0.5)
    reached = [name for name in frame if str(name).startswith("actual.")]
    assert reached == ["actual.port.n", "actual.port.alpha", "actual.starboard.n", "actual.starboard.alpha"]
    data = Dataset(frame.drop(columns=reached), {"clock": "run", "flags": []})
    assert data.commands == ["port.n", "port.alpha", "starboard.n", "starboard.alpha"]
    assert list(frame["run"].unique()) == ["M001", "M002"]
    assert "V_w" in frame
    assert not any(str(name).startswith("actual.") for name in perform_manoeuvres(SHIP, [CIRCLE], step=0.1))


def test_a_helmsman_holds_the_approach_of_a_ship_that_does_not_go_straight() -> None:
    """On one screw: the course and the yaw rate stay until the execute, then the order of the manoeuvre counts."""
    lame = SHIP.with_values({"thruster.starboard.off": True})
    circle = TurningCircle(name="circle", approach="helmsman", n_rpm=145, execute_at=10, duration=20, angle_deg=20)
    zigzag = Zigzag(name="zigzag", approach="helmsman", n_rpm=145, execute_at=10, duration=20, course_deg=90)
    frame = perform_manoeuvres(lame, [circle, zigzag], step=0.1)
    for run, angle in (("circle", 20), ("zigzag", 20)):
        log = frame[frame["run"] == run].reset_index(drop=True)
        assert np.abs(log["r"].iloc[:100]).max() < 1e-4
        assert np.ptp(log["psi"].iloc[:100]) < 1e-3
        assert np.ptp(log["port.alpha"].iloc[:100]) == 0
        assert abs(log["port.alpha"].iloc[0]) > 0.01
        assert log["port.alpha"].iloc[101] == pytest.approx(-angle * DEGREE)


def test_weather_may_change_from_step_to_step() -> None:
    """A series that does not change is a constant; one that does is logged as it is, and felt by clock and helmsman."""
    two = [CIRCLE, Zigzag(name="zigzag", n_rpm=120, duration=30)]
    speeds = np.array([4.0, 6.0])
    held = perform_manoeuvres(SHIP, two, step=0.1, interval=0.5, environment={"V_w": speeds, "beta_w": 0.4})
    level = np.broadcast_to(speeds, (301, 2))
    same = perform_manoeuvres(SHIP, two, step=0.1, interval=0.5, environment={"V_w": level, "beta_w": 0.4})
    pd.testing.assert_frame_equal(same, held, rtol=1e-12)
    rising = np.linspace(0, 10, 301)[:, None] + [0.0, 1.0]
    blown = perform_manoeuvres(SHIP, two, step=0.1, interval=0.5, environment={"V_w": rising, "beta_w": 0.4})
    for place, (_, run) in enumerate(blown.groupby("run", sort=False)):
        np.testing.assert_allclose(run["V_w"], rising[::5, place][: len(run)])
    assert np.abs(blown["v"] - held["v"]).max() > 0.01


@pytest.mark.parametrize(
    ("manoeuvres", "how", "message"),
    [
        ([], {}, "give manoeuvres of"),
        ([CIRCLE], {"interval": 0.25}, "interval 0.25 s must be a multiple of step 0.1 s"),
        ([CIRCLE], {"interval": 0.01}, "must be a multiple"),
        ([CIRCLE.model_copy(update={"name": "a"})] * 2, {}, "two runs are named 'a'"),
        ([CIRCLE], {"environment": {"V_c": 1.0}}, "has no environment channel 'V_c'"),
    ],
)
def test_what_cannot_be_performed_is_reported(manoeuvres: list[Manoeuvre], how: dict[str, Any], message: str) -> None:
    with pytest.raises(ShipidError, match=message):
        perform_manoeuvres(SHIP, manoeuvres, **{"step": 0.1, **how})


def test_a_run_that_diverges_is_named() -> None:
    wild = SHIP.with_values({"hull.derivatives.N_r|r|": 1e9, "hull.derivatives.N_rrr": 1e10})
    chosen = [
        CIRCLE.model_copy(update={"name": "straight", "angle_deg": 1e-9}),
        CIRCLE.model_copy(update={"name": "wild"}),
    ]
    with pytest.raises(ShipidError, match="diverges in wild: take a smaller step"):
        perform_manoeuvres(wild, chosen, step=0.1)


def test_a_zigzag_in_waves_still_turns_at_the_execute_heading() -> None:
    """A sea for each manoeuvre: it moves the ship, starts at t = 0, and the helmsman sees the heading that it makes."""
    ship = load_vessel("gunnerus-28.9-6dof")
    sea = draw_components(Sea(H_s=1.0, T_p=5.0, components=20), np.array([0.5, 2.0]), ["a", "b"])
    zigzags = [Zigzag(n_rpm=120, duration=60), Zigzag(n_rpm=140, duration=60)]
    calm = perform_manoeuvres(ship, zigzags, step=0.05, interval=0.5)
    rough = perform_manoeuvres(ship, zigzags, step=0.05, interval=0.5, components=wave_loads(ship, sea))
    assert calm["z"].std() < 0.02 < 0.1 < rough["z"].std()
    for _, run in rough.groupby("run"):
        turned = run["psi"][np.flatnonzero(np.diff(np.sign(run["port.alpha"]))) + run.index[0]]
        assert len(turned) >= 2
        assert np.abs(np.abs(turned / DEGREE) - 20).max() < 3  # rows are 0.5 s apart


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"environment": {"V_w": [3.0, 4.0, 5.0]}}, "environment 'V_w' must be one value or 2"),
        ({"components": {"waves.drift": np.zeros((1, 1, 41))}}, "for 1 ships, and there are 2 manoeuvres"),
        ({"step": np.nan}, "step must be a number above 0 and finite, not nan"),
        ({"method": "RK4"}, "method 'RK4' is not known: did you mean 'rk4'"),
        ({"outputs": ["port.thrus"]}, r"outputs 'port\.thrus' is not known: did you mean 'port\.thrust'\?"),
        ({"environment": {"V_w": "3"}}, "environment 'V_w' must be an array of numbers, not str"),
    ],
)
def test_what_does_not_fit_the_manoeuvres_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ShipidError, match=message):
        perform_manoeuvres(SHIP, [CIRCLE, CIRCLE.model_copy(update={"name": "other"})], **{"step": 0.1, **given})


def test_execute_waits_and_orders_are_those_in_force() -> None:
    frame = perform_manoeuvres(
        SHIP, [TurningCircle(n_rpm=120, duration=20, execute_at=5, angle_deg=10, side="port")], step=0.1
    )
    before = frame["t"] < 4.95
    assert (frame.loc[before, "port.alpha"] == 0).all()
    np.testing.assert_allclose(frame.loc[~before, "port.alpha"], 10 * DEGREE)
    at_rest = np.abs(frame["r"].to_numpy())
    assert at_rest[50] < 1e-9 < at_rest[51]
