"""The physics of a predictor: paths in the frame of the instant, their slopes, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shipid.data.windows import Instants, Windows, cut_windows, to_frame
from shipid.engine.rollout import rollout
from shipid.errors import DataError, ShipidError
from shipid.hybrid.physics import Physics, check_columns, missing_columns
from shipid.observer import MEASURED_MOTION, Observer, run_observer
from shipid.study.prepare import at_instants
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from shipid.vessel.perturb import Family, draw_members
from tests.conftest import variety
from tests.identification.trials import trials
from tests.study.test_whole import windy

SHIP = load_vessel("gunnerus-28.9")
RIGHT = Physics(SHIP, 5, 1.0)
WRONG = RIGHT.with_values({"hull.derivatives.N_ur": -3e5})


@pytest.fixture(scope="module")
def windows() -> Windows:
    """Windows of runs in wind."""
    return cut_windows(windy("ab"), horizon=5, interval=4.0)


def test_paths_are_the_rollout_seen_from_the_instant(windows: Windows) -> None:
    columns, model = windows.columns, vessel_dynamics(SHIP)
    start, orders, weather = (
        {name: columns[name] for name in names} for names in (model.state, model.commands, model.environment)
    )
    path = rollout(SHIP, start, orders, weather, step=1.0, num_steps=5)
    north, east = (path[name][1:, 0] for name in ("north", "east"))
    x, y = to_frame(north, east, columns["north"], columns["east"], columns["psi"])
    np.testing.assert_allclose(RIGHT.paths(windows.instants()), np.stack([x, y], axis=-1), atol=1e-9)


@pytest.mark.parametrize("kind", ["roll", "six"])
def test_a_ship_that_heels_leads_along_her_horizontal_log(kind: str) -> None:
    """A log's u, v and r are horizontal, the states of a ship with 4 or 6 degrees of freedom are along her axes."""
    ship = variety()[kind]
    data = trials(ship, runs=2, steps=30)
    assert np.abs(data.frame["phi"]).max() > 0.02
    windows = cut_windows(data, horizon=5)
    physics, instants = Physics(ship, 5, 1.0, "rk4"), windows.instants(known=True)
    np.testing.assert_allclose(physics.paths(instants), windows.future, atol=1e-9)
    states = physics.states(instants)
    for name in ("u", "v", "r", "psi"):
        np.testing.assert_allclose(states[name], windows.states[name], atol=1e-9)


@pytest.mark.parametrize("seen", [False, True])
def test_the_slope_of_the_error_is_that_of_differences(seen: bool) -> None:
    dataset = windy("ab")
    windows = cut_windows(dataset, horizon=5, interval=4.0)
    physics = replace(WRONG, observer=Observer()) if seen else WRONG
    known = at_instants(dataset, windows, run_observer(SHIP, dataset, Observer()) if seen else None)
    instants, names = windows.instants(estimates=known), ["hull.derivatives.N_ur", "inertia.m"]
    values = np.array(list(SHIP.with_values({"hull.derivatives.N_ur": -3e5}).parameters.values()))
    places = [list(SHIP.parameters).index(name) for name in names]
    value, slope = physics.gradient(instants, windows.future, names)
    error = np.square(physics.paths(instants) - windows.future).sum(axis=-1)
    assert value == pytest.approx(error.mean(), rel=1e-9)
    for place, each in zip(places, slope, strict=True):
        step = 1e-4 * abs(values[place])
        losses = []
        for sign in (-1, 1):
            moved = values.copy()
            moved[place] += sign * step
            losses.append(physics.gradient(instants, windows.future, names, moved)[0])
        assert each == pytest.approx((losses[1] - losses[0]) / (2 * step), rel=1e-4)


def test_distances_are_those_of_the_paths(windows: Windows) -> None:
    instants = windows.instants()
    measured = WRONG.distances(instants, windows.future)
    apart = np.linalg.norm(WRONG.paths(instants) - windows.future, axis=-1)
    np.testing.assert_allclose(measured.total[0], apart.sum(axis=0), rtol=1e-9)
    assert measured.tally.sum() == apart.size
    assert not measured.diverged.any()


def test_an_observer_needs_its_estimates_and_takes_no_screening(windows: Windows) -> None:
    physics = replace(RIGHT, observer=Observer())
    with pytest.raises(DataError, match="instants must hold its estimates"):
        physics.paths(windows.instants())
    with pytest.raises(ShipidError, match="screening takes no observer"):
        physics.distances(windows.instants(), windows.future)


def test_what_is_not_measured_is_zero_and_reported() -> None:
    columns = {name: np.full(3, 0.5) for name in ("u", "v", "psi", *vessel_dynamics(SHIP).commands)}
    assert missing_columns(SHIP, columns) == ["north", "east", "r", "V_w", "beta_w"]
    zero = dict.fromkeys(missing_columns(SHIP, columns), np.zeros(3))
    np.testing.assert_array_equal(RIGHT.paths(Instants(columns)), RIGHT.paths(Instants(columns | zero)))


def test_a_missing_command_is_one_line_with_those_there_are() -> None:
    with pytest.raises(DataError, match=r"the data have rudder\.delta") as caught:
        check_columns(SHIP, {"u": np.zeros(1), "rudder.delta": np.zeros(1)}, "log.csv")
    assert caught.value.path == "port.n"


def afloat(count: int = 4) -> Instants:
    """Instants anywhere on the chart, with what an observer knows: another filtered state, forces and a current."""
    rng = np.random.default_rng(7)
    spread = {"north": 50.0, "east": 50.0, "psi": 2.0, "u": 0.3, "v": 0.1, "r": 0.01}
    columns = {name: rng.normal(0.0, width, count) for name, width in spread.items()}
    columns["u"] += 3.0
    columns |= {f"{side}.n": rng.uniform(1.0, 3.0, count) for side in ("port", "starboard")}
    columns |= {f"{side}.alpha": rng.uniform(-0.3, 0.3, count) for side in ("port", "starboard")}
    known = {f"observer.{name}": columns[name] + 0.01 * rng.normal(size=count) for name in MEASURED_MOTION}
    known |= {f"observer.{name}": 1e-3 * rng.normal(size=count) for name in "XYN"}
    known |= {f"observer.current_{name}": rng.uniform(0.2, 0.5, count) for name in ("north", "east")}
    return Instants(columns, estimates=known)


def test_the_error_does_not_fall_where_a_window_diverges(windows: Windows) -> None:
    """It was the mean over the other windows: what trains on it was led to where a hard window diverges."""
    instants, number = windows.instants(), len(windows)
    hard = WRONG.gradient(instants, windows.future + 10.0 * (np.arange(number) == 3)[:, None], [])[0]
    u = np.where(np.arange(number) == 3, 1e9, instants.columns["u"])
    columns = Instants({**instants.columns, "u": u})
    assert WRONG.variant_paths(columns)[1][0].nonzero()[0].tolist() == [3]
    assert np.isfinite(hard)
    assert WRONG.gradient(columns, windows.future, ["inertia.m"])[0] == np.inf
    rest = np.flatnonzero(np.arange(number) != 3)
    assert np.isfinite(WRONG.gradient(columns.select(rest), windows.future[:, rest], [])[0])


def test_water_and_air_that_move_together_carry_the_path_along() -> None:
    """Heading north in still water and air, or in a stream to the east with its air: the stream's way apart."""
    here, zero = afloat(1), np.zeros(1)
    still = {f"observer.{name}": zero for name in ("psi", "v", "X", "Y", "N", "current_north", "current_east")}
    still = {**here.estimates, **still}
    stream = {**still, "observer.current_east": zero + 0.4, "observer.v": zero + 0.4}
    calm = {**here.columns, "psi": zero, "V_w": zero, "beta_w": zero}
    windy = {**calm, "V_w": zero + 0.4, "beta_w": zero + np.pi / 2}
    physics = Physics(SHIP, 6, 1.0, "euler", Observer())
    one = physics.paths(Instants(calm, estimates=still))
    other = physics.paths(Instants(windy, estimates=stream))
    np.testing.assert_allclose((other - one)[:, 0], 0.4 * np.arange(1, 7)[:, None] * [0.0, 1.0], atol=1e-9)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"integrator": "Euler"}, r"integrator 'Euler' is not known: did you mean 'euler'\?"),
        ({"path": "speed"}, "path 'speed' is not known: valid: position, velocity"),
        ({"horizon": 2.5}, "horizon must be a whole number, 1 or more, not 2.5"),
        ({"step": 0.0}, "step must be a number above 0"),
        ({"vessel": "mariner"}, "vessel must be a Vessel, as of `load_vessel`, or None, not 'mariner'"),
    ],
)
def test_physics_of_a_wrong_argument_is_refused(wrong: dict[str, Any], message: str) -> None:
    """Before, every integrator but `euler` was rk4, `Euler` too."""
    with pytest.raises(ShipidError, match=message):
        Physics(**{"vessel": SHIP, "horizon": 5, "step": 1.0, **wrong})


def wild_members(seed: int, count: int = 40) -> np.ndarray:
    """Numbers (V, P) of drawn members, many of which diverge."""
    block = {"parameters": ["hull.derivatives.*"], "factor": [-6.0, 6.0], "change_sign": True}
    family = Family(name="wild", base="gunnerus-28.9", members=count, seed=seed, perturb=[block])  # type: ignore[list-item]
    return np.array([one.parameters for one in draw_members(family, SHIP)])


@pytest.mark.parametrize("method", ["euler", "rk4"])
@pytest.mark.parametrize("seed", [1, 2])
def test_every_member_has_a_path_that_keeps_its_last_velocity(windows: Windows, seed: int, method: Any) -> None:
    """One that does not diverge has its rollout to the bit; one that does goes on, as far as the ship would."""
    physics, members, columns = Physics(SHIP, 25, 1.0, method), wild_members(seed), windows.columns
    paths, diverged = physics.variant_paths(windows.instants(), members)
    assert np.isfinite(paths).all()
    assert 0 < diverged.any(axis=1).sum() < len(members)
    model = vessel_dynamics(SHIP)
    given = ({name: columns[name] for name in names} for names in (model.state, model.commands, model.environment))
    raw = rollout(SHIP, *given, step=1.0, num_steps=25, method=method, parameters=members)
    with np.errstate(all="ignore"):
        x, y = to_frame(raw["north"][1:], raw["east"][1:], columns["north"], columns["east"], columns["psi"])
        unheld = np.stack([x, y], axis=-1)
        steps = np.diff(unheld, axis=0, prepend=0.0)
        gone = ~np.logical_and.accumulate(np.hypot(steps[..., 0], steps[..., 1]) <= 100.0) & diverged
    np.testing.assert_array_equal(raw.diverged, diverged)
    np.testing.assert_array_equal(paths[:, ~diverged], unheld[:, ~diverged])
    step = np.broadcast_to(np.stack([columns["u"], columns["v"]], axis=-1), unheld.shape[1:])
    speed, place = np.hypot(step[..., 0], step[..., 1]), 0.0
    for k in range(25):
        step = np.where(gone[k][..., None], step, steps[k])
        place = place + step
        size = np.maximum(np.hypot(place[..., 0], place[..., 1]), 1e-12)
        expected = place * np.minimum((k + 1) * speed / size, 1.0)[..., None]
        np.testing.assert_allclose(paths[k][diverged], expected[diverged], atol=1e-6)
    assert gone[1:].any()


def test_an_input_that_is_no_number_gives_no_path(windows: Windows) -> None:
    """A force may hide it: a path that keeps its velocity must not."""
    lost = np.arange(len(windows)) == 2
    columns = windows.columns | {"V_w": np.where(lost, np.nan, windows.columns["V_w"])}
    np.testing.assert_array_equal(np.isnan(RIGHT.paths(Instants(columns))).all(axis=(0, 2)), lost)


def test_without_a_vessel_there_is_nothing_to_roll_out(windows: Windows) -> None:
    """Before, an AssertionError; paths are zero, and do not diverge."""
    none = Physics(None, windows.horizon, windows.step)
    for ask in (
        lambda: none.states(windows.instants()),
        lambda: none.distances(windows.instants(), windows.future),
        lambda: none.gradient(windows.instants(), windows.future, []),
    ):
        with pytest.raises(ShipidError, match="no physics, so nothing to roll out"):
            ask()
