"""Inputs by hand: what is measured at the instant, and what the past says."""

from dataclasses import replace

import numpy as np
import pytest

from shipid.data.windows import Instants, cut_windows, to_frame
from shipid.errors import DataError
from shipid.hybrid.features import (
    Inputs,
    Memory,
    choose_features,
    feature_table,
    input_group,
    observer_inputs,
    past_error,
    planned_means,
)
from shipid.hybrid.physics import Physics
from shipid.observer import Observer
from shipid.physics.signals import mirror_sign
from shipid.vessel.load import load_vessel
from tests.hybrid.tasks import azimuth_columns
from tests.study.test_commands import weaving

COMMANDS = ("port.n", "port.alpha", "starboard.n", "starboard.alpha")
SHIP = load_vessel("gunnerus-28.9")


columns = pytest.fixture(azimuth_columns)


def test_equal_azimuths_leave_the_seven_inputs_of_13(columns):
    table = feature_table(columns, COMMANDS)
    assert list(table) == ["u", "v", "r", *COMMANDS, "u_rw", "v_rw"]
    chosen = choose_features(table)
    assert list(chosen) == ["u", "v", "r", "port.n", "port.alpha", "u_rw", "v_rw"]
    assert chosen["port.n"] == ("port.n", "starboard.n")


def test_columns_that_differ_by_rounding_are_one_and_vary_by_more(columns):
    columns["starboard.n"] *= 1 + 1e-15
    columns["u"] = 4.0 + 1e-12 * columns["u"]
    chosen = choose_features(feature_table(columns, COMMANDS))
    assert chosen["port.n"] == ("port.n", "starboard.n")
    assert "u" not in chosen


def test_relative_wind_by_hand():
    columns = {name: np.array([value]) for name, value in {"u": 4.0, "v": 0.5, "r": 0.0, "V_w": 6.0}.items()}
    head = feature_table(columns | {"psi": np.zeros(1), "beta_w": np.array([np.pi])}, ())
    assert (head["u_rw"][0], head["v_rw"][0]) == pytest.approx((10.0, 0.5))  # wind towards the stern
    beam = feature_table(columns | {"psi": np.array([1.0]), "beta_w": np.array([1.0 + np.pi / 2])}, ())
    assert (beam["u_rw"][0], beam["v_rw"][0]) == pytest.approx((4.0, -5.5))  # wind towards starboard


def test_a_missing_column_is_named(columns):
    del columns["starboard.n"]
    with pytest.raises(DataError, match=r"starboard\.n"):
        feature_table(columns, COMMANDS)


# Memory.


@pytest.fixture(scope="module")
def past():
    """Windows of Euler runs of the ship with 8 s of past."""
    return cut_windows(weaving("ab"), horizon=5, past=8)


def test_history_and_turned_by_hand(past):
    memory = Memory(history=(4.0,), turned=(8.0,))
    table = Inputs(COMMANDS, memory).table(Physics(None, 5, 1.0), past.instants())
    for name, label in (("u", "past-4.u"), ("port.alpha", "port.past-4.alpha")):
        np.testing.assert_array_equal(table[label], past.past[name][-4] - past.columns[name])
    np.testing.assert_array_equal(table["turned-8.psi"], past.columns["psi"] - past.past["psi"][0])
    assert memory.past == 8.0


def test_positions_are_those_of_earlier_instants_in_the_present_frame(past):
    """A ship that heads east and came from the south-west was astern and to starboard."""
    table = Inputs(COMMANDS, Memory(positions=(4.0,))).table(Physics(None, 5, 1.0), past.instants())
    rows = [
        np.flatnonzero((past.run == run) & np.isclose(past.t, t - 4)) for run, t in zip(past.run, past.t, strict=True)
    ]
    later = np.array([place for place, found in enumerate(rows) if len(found)])
    before = np.concatenate([rows[place] for place in later])
    north, east, psi = (past.columns[name] for name in ("north", "east", "psi"))
    place = to_frame(north[before], east[before], north[later], east[later], psi[later])
    np.testing.assert_allclose([table["past-4.x"][later], table["past-4.y"][later]], place, atol=1e-9)
    assert len(later) > 10
    assert to_frame(-3.0, -8.0, 0.0, 0.0, np.pi / 2) == pytest.approx((-8.0, 3.0))
    assert [mirror_sign(f"past-4.{axis}") for axis in "xy"] == [1, -1]
    assert {input_group(f"past-4.{axis}") for axis in "xy"} == {"history"}


def test_further_states_are_inputs_with_their_history(past):
    """Roll as measured and as a difference; a log without it is one line, and a mirror turns it round."""
    columns = past.columns | {"phi": 0.1 * past.columns["r"]}
    given = Instants(columns, past.past | {"phi": 0.1 * past.past["r"]})
    inputs = Inputs(COMMANDS, Memory(states=("phi",), history=(2.0,)))
    table = inputs.table(Physics(None, 5, 1.0), given)
    np.testing.assert_array_equal(table["phi"], columns["phi"])
    np.testing.assert_array_equal(table["past-2.phi"], given.past["phi"][-2] - columns["phi"])
    assert (input_group("phi"), mirror_sign("phi"), mirror_sign("past-2.phi")) == ("motion", -1, -1)
    with pytest.raises(DataError, match="phi"):
        inputs.table(Physics(None, 5, 1.0), past.instants())


def test_a_past_that_is_too_short_is_said_in_seconds(past):
    held = len(past.past["x"])
    with pytest.raises(DataError, match=rf"needs 1000 s of the past, there are {2 * held} s"):
        past_error(Physics(SHIP, 5, 2.0), past.instants(), 1000.0)


def test_past_error_of_wrong_physics_grows_and_is_the_rollout_by_hand(past):
    wrong = Physics(SHIP.with_values({"hull.derivatives.X_u|u|": -9000.0}), 5, 1.0)
    errors = {seconds: past_error(wrong, past.instants(), seconds) for seconds in (2.0, 8.0)}
    assert np.abs(errors[8.0]["x"]).mean() > 3 * np.abs(errors[2.0]["x"]).mean() > 0
    then = {name: values[0] for name, values in past.past.items()}
    given = {name: past.past[name] for name in COMMANDS}
    states = replace(wrong, horizon=8).states(Instants(then, planned=given))
    turned = past.columns["psi"] - then["psi"]
    # predicted position, from the frame of the start to the one of now: turned, then moved to where the ship began
    x = np.cos(turned) * states["x"][-1] + np.sin(turned) * states["y"][-1] + then["x"]
    y = np.cos(turned) * states["y"][-1] - np.sin(turned) * states["x"][-1] + then["y"]
    np.testing.assert_allclose(errors[8.0]["x"], -x, atol=1e-9)
    np.testing.assert_allclose(errors[8.0]["y"], -y, atol=1e-9)
    np.testing.assert_allclose(errors[8.0]["u"], past.columns["u"] - states["u"][-1], atol=1e-12)


def test_estimates_of_the_observer_are_in_body_axes():
    """Heading east, water that moves east comes from astern, and water that moves north goes to port."""
    columns = {"psi": np.array([0.0, np.pi / 2]), "u": np.full(2, 3.0), "v": np.full(2, 0.2), "r": np.full(2, 0.01)}
    known = {"observer.u": 2.5, "observer.v": 0.3, "observer.r": 0.02, "observer.X": 1.0, "observer.Y": 2.0}
    known |= {"observer.N": 3.0, "observer.current_north": 0.1, "observer.current_east": 0.4}
    table = observer_inputs(Instants(columns, estimates={name: np.full(2, value) for name, value in known.items()}))
    by_hand = {"observer-current.u": [0.1, 0.4], "observer-current.v": [0.4, -0.1], "observer-wave.u": [0.5, 0.5]}
    by_hand |= {"observer-wave.v": [-0.1, -0.1], "observer-wave.r": [-0.01, -0.01]}
    by_hand |= {f"observer-force.{name}": [value, value] for name, value in zip("uvr", (1.0, 2.0, 3.0), strict=True)}
    assert set(table) == set(by_hand)
    for name, values in by_hand.items():
        np.testing.assert_allclose(table[name], values, atol=1e-12, err_msg=name)


def test_estimates_are_inputs_where_method_and_physics_both_have_the_observer(columns):
    known = {
        f"observer.{name}": np.zeros(50) for name in ("u", "v", "r", "X", "Y", "N", "current_north", "current_east")
    }
    instants, physics = Instants(columns, estimates=known), Physics(SHIP, 5, 1.0)
    observed = replace(physics, observer=Observer())
    for memory, one in ((Memory(observer=True), physics), (Memory(), observed)):
        assert Inputs(COMMANDS, memory).of_physics(one, instants) == {}
    assert (
        Inputs(COMMANDS, Memory(observer=True)).of_physics(observed, instants).keys()
        == observer_inputs(instants).keys()
    )


def test_an_order_that_stays_is_no_change_to_the_last_bit() -> None:
    """A mean of equal numbers rounds; divided by its spread that was an input of 1e16 where the order changed later."""
    orders = np.random.default_rng(5).uniform(-40, 40, 200)
    for steps in (3, 7, 28, 32):
        means = planned_means({"port.n": orders}, {"port.n": np.tile(orders, (steps, 1))})
        assert all((change == 0).all() for change in means.values())


def test_planned_means_by_hand() -> None:
    """Seven steps in three parts of 3, 2 and 2; what is planned to stay adds nothing."""
    planned = {"port.n": np.array([2.0, 2, 2, 5, 6, 8, 9])[:, None], "port.alpha": np.full((7, 1), 0.3)}
    means = planned_means({"port.n": np.array([2.0]), "port.alpha": np.array([0.3])}, planned)
    assert {name: float(value[0]) for name, value in means.items()} == pytest.approx(
        {"port.planned-1.n": 0.0, "port.planned-2.n": 3.5, "port.planned-3.n": 6.5}
        | {f"port.planned-{number}.alpha": 0.0 for number in (1, 2, 3)}
    )
    assert list(planned_means({"a.n": np.zeros(1)}, {"a.n": np.ones((2, 1))})) == ["a.planned-1.n", "a.planned-2.n"]
