"""First guesses of small craft: top speed, turns and straight run of drawn ones, and refusals in one line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.engine.rollout import Trajectories, rollout
from shipid.errors import ShipidError
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel
from shipid.vessel.template import FirstGuess
from shipid.vessel.usv import SmallCraft, guess_craft

OTTER = SmallCraft(2.0, 1.08, 80.0, 3.09, ((-0.8, -0.395), (-0.8, 0.395)))


def draw_craft(seed: int) -> SmallCraft:
    """A craft of 0.8 to 8 m; every third one has one thruster that swivels."""
    rng = np.random.default_rng([59, seed])
    length = float(np.exp(rng.uniform(np.log(0.8), np.log(8.0))))
    two = rng.random() < 0.6
    beam = length / rng.uniform(*((1.7, 2.4) if two else (2.8, 4.5)))
    mass = length**2 * beam * rng.uniform(3.0, 20.0)  # the WAM-V 16 has 3, the Otter 18.5
    speed = rng.uniform(0.3, 0.9) * np.sqrt(9.81 * length)
    x, y, swivels = -0.4 * length, 0.38 * beam, seed % 3 == 2
    places = ((x, 0.0),) if swivels else ((x, -y), (x, y))
    return SmallCraft(length, beam, mass, speed, places, swivel=40.0 if swivels else 0.0)


def run(vessel: Vessel, seconds: float, speed: float, orders: dict[str, float], r: float = 0.0) -> Trajectories:
    """Motion with constant orders that the actuators have reached, from a speed ahead and a yaw rate."""
    model = vessel_dynamics(vessel)
    start = dict.fromkeys(model.state, np.zeros(1)) | {"u": np.array([speed]), "r": np.array([r])}
    values = {name: np.array([orders.get(name, 0.0)]) for name in model.commands}
    step = 0.005 * (vessel.length or 1.0) ** 0.5
    return rollout(
        vessel,
        start,
        values,
        {},
        step=step,
        num_steps=10 * round(seconds / step / 10),
        every=10,
        memory={name: values[name] for name in model.memory},
    )


def full_ahead(guess: FirstGuess) -> dict[str, float]:
    forces = {name for name in vessel_dynamics(guess.vessel).commands if name.endswith(".force")}
    return {name: guess.vessel.parameters[f"thruster.{name[:-6]}.actuator.force.high"] for name in forces}


@pytest.mark.parametrize("seed", range(10))
def test_a_drawn_craft_reaches_its_top_speed_and_turns(seed: int) -> None:
    """Within 2 % from half of it; turned, it slows down, turns to the side ordered, and drifts less than 27 deg."""
    given = draw_craft(seed)
    guess = guess_craft(given, "craft", "craft.toml")
    orders, passing = full_ahead(guess), given.length / given.top_speed
    ahead = run(guess.vessel, 100 * passing, given.top_speed / 2, orders)
    assert ahead["u"][-1].item() == pytest.approx(given.top_speed, rel=0.02)
    helm = {"middle.alpha": -0.4} if given.swivel else {"starboard.force": 0.3 * orders["starboard.force"]}
    turn = run(guess.vessel, 60 * passing, given.top_speed, orders | helm)
    u, v, r = (turn[name][-1].item() for name in "uvr")
    assert not turn.diverged.any()
    assert r > 0
    assert 0 < u < given.top_speed
    assert abs(v) < u / 2
    assert 0.8 < 2 * np.hypot(u, v) / r / given.length < 40.0  # steady turning diameter in lengths


@pytest.mark.parametrize("seed", range(10))
def test_a_straight_run_is_stable_or_said_not_to_be(seed: int) -> None:
    """A small yaw rate dies out, or grows, at the rate that the head of the document says."""
    guess = guess_craft(draw_craft(seed), "craft", "craft.toml")
    assert ("is course-stable" in guess.text) == (guess.growth < 0)
    length, speed = guess.vessel.length or 0.0, guess.speed
    orders = dict.fromkeys(full_ahead(guess), 60 * guess.n)
    path = run(guess.vessel, 12 * length / speed, speed, orders, r=1e-6 * speed / length)
    size = np.abs(path["r"][:, 0, 0])
    assert (size[-1] < size[len(size) // 2]) == (guess.growth < 0)


def test_the_draught_is_that_of_the_otter_and_the_thrust_given_is_kept() -> None:
    """0.195 m with 80 kg, of the published model; 120 N of each thruster make the top speed."""
    assert guess_craft(OTTER, "a", "a.toml").vessel.document["particulars"]["T"] == pytest.approx(0.1951, rel=0.01)
    strong = guess_craft(replace(OTTER, thrust=120.0), "otter", "otter.toml")
    assert set(full_ahead(strong).values()) == {120.0}
    assert "the ship needs 58.8 N of each thruster" in strong.text  # 0.49 of it
    slim = replace(OTTER, length=4.0, beam=1.44, mass=96.0, hulls=2)
    assert guess_craft(slim, "a", "a.toml").vessel.parameters["added_mass.X_udot"] < 0  # charts of beamy ships say > 0
    heavy = SmallCraft(15.0, 5.0, 2e4, 12.0, ((-6.0, -2.0), (-6.0, 2.0)), 2e5)
    assert 60 * guess_craft(heavy, "a", "a.toml").n == pytest.approx(0.49 * 2e5)
    assert strong.vessel.parameters["hull.derivatives.X_u|u|"] == pytest.approx(-240.0 / 3.09**2, rel=1e-5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"thrusters": ((-0.8, 0.0),)}, "--thruster: nothing turns this craft"),
        ({"thrusters": ()}, "--thruster: missing: give the place"),
        (
            {"thrusters": ((-0.8, 0.1), (-0.8, 0.4))},
            "--thruster: nothing turns this craft: give thrusters at two sides",
        ),
        ({"thrusters": ((0.0, 0.0),), "swivel": 30.0}, "nothing turns this craft: give X other than 0"),
        ({"hulls": 1, "beam": 1.6}, "--beam: 1.6: small craft have 0.16 to 0.909"),
        ({"mass": 0.1}, "--mass: each hull would have a draught of"),
        ({"mass": 0.0}, "--mass: 0: small craft have"),
        ({"top_speed": 30.0}, "--speed: 30: small craft have 0.1 to 8.86"),
        ({"mass": 1500.0}, "--mass: each hull would have a draught of"),
        ({"beam": 5.0}, "--beam: 5: small craft have 0.16 to 2"),
    ],
)
def test_a_craft_that_cannot_be_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ShipidError) as error:
        guess_craft(replace(OTTER, **changes), "craft", "craft.toml")  # type: ignore[arg-type]
    assert message in str(error.value)
