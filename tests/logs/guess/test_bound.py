"""Commands of a draft take the names of a vessel: by signal and side; what is not logged is stopped, or asked."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.logs.guess.bound import name_commands
from shipid.logs.guess.clues import State
from shipid.logs.guess.commands import choose_commands
from shipid.logs.guess.motion import report_misnomers
from shipid.logs.guess.outputs import reserve_outputs, suggest_outputs
from shipid.logs.guess.words import number_in_name
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel
from shipid.vessel.template import Particulars, first_guess
from shipid.vessel.usv import SmallCraft, guess_craft
from tests.drawn import seeds
from tests.logs.guess.test_twin_screws import craft, guessed
from tests.logs.simulated import si_log, state_with_pose

LOG = si_log()
R, ALPHA, N = (LOG[name].to_numpy() for name in ("r", "alpha", "n"))
RUDDER, RPM = -np.degrees(ALPHA), 60.0 * N
TWIN = {"port_rudder.delta", "starboard_rudder.delta", "port.n", "starboard.n"}


def vessel(**known: object) -> Vessel:
    return first_guess(Particulars(30.0, 8.0, 2.8, 0.55, **known), "guess", "guess.toml").vessel  # type: ignore[arg-type]


def drafted(columns: dict[str, np.ndarray], ship: Vessel) -> tuple[State, dict[str, str]]:
    state = state_with_pose(columns)
    state.r, state.commands = R, vessel_dynamics(ship).commands
    outputs = reserve_outputs(state)
    choose_commands(state)
    suggest_outputs(state, outputs)
    name_commands(state, ship)
    report_misnomers(state)
    return state, {one.name: one.source for one in state.suggestions}


@pytest.mark.parametrize(
    ("columns", "asked"),
    [
        (("rudder port", "rudder stbd", "rpm port", "rpm stbd"), 0),
        (("rudder", "rpm"), 0),
        (("rudder port", "rpm port", "rpm stbd"), 1),
    ],
)
def test_two_shafts_have_their_sides_or_share_a_column(columns: tuple[str, ...], asked: int) -> None:
    values = {name: RUDDER if "rudder" in name else RPM for name in columns}
    state, names = drafted(values, vessel(shafts=2))
    assert set(names) == TWIN
    assert len(state.questions) == asked
    assert names["starboard.n"] in ("rpm stbd", "rpm")


def test_a_ship_with_one_rudder_takes_one_of_two_columns_and_says_so() -> None:
    state, names = drafted({"rudder port": RUDDER, "rudder stbd": RUDDER, "rpm": RPM, "thrust [kN]": RPM}, vessel())
    assert names["rudder.delta"] == "rudder port"
    assert names["propeller.thrust"] == "thrust [kN]"
    assert [one.kind for one in state.findings] == ["several columns for one command"]


def test_a_tunnel_thruster_that_is_not_logged_is_stopped() -> None:
    state, names = drafted({"rudder": RUDDER, "rpm": RPM}, vessel(tunnel_thruster=True))
    assert set(names) == {"rudder.delta", "propeller.n", "bow.n"}
    (bow,) = (one for one in state.suggestions if one.name == "bow.n")
    assert bow.extra == {"factor": 0.0}
    assert [one.sentence for one in state.findings] == ["no column of the log is bow.n: taken as stopped"]


def test_a_tunnel_thruster_without_a_unit_is_asked() -> None:
    state, names = drafted({"rudder": RUDDER, "rpm": RPM, "bt": RPM}, vessel(tunnel_thruster=True))
    assert names["bow.n"] == "bt"
    assert "'bt' the shaft speed of thruster.bow? rpm is a guess" in state.questions[-1].sentence


def test_a_command_that_the_ship_needs_is_asked() -> None:
    state, names = drafted({"rudder": RUDDER}, vessel())
    assert set(names) == {"rudder.delta"}
    assert "which column is propeller.n?" in state.questions[-1].sentence


def fleet(screws: dict[str, float], rudders: dict[str, float], tunnels: tuple[str, ...] = ()) -> Vessel:
    """A ship with such screws and rudders, name -> place to starboard [m], and tunnels at the bow."""
    whole = vessel(shafts=2, tunnel_thruster=True).document
    screw, rudder, tunnel = (whole["thruster"][name] for name in ("port", "port_rudder", "bow"))
    thrusters = {name: {**screw, "y": y} for name, y in screws.items()}
    behind = dict(zip(rudders, list(screws) * 2, strict=False))
    thrusters |= {name: {**rudder, "y": y, "behind": behind[name]} for name, y in rudders.items()}
    thrusters |= {name: {**tunnel, "x": tunnel["x"] - 3.0 * number} for number, name in enumerate(tunnels)}
    return Vessel({**whole, "thruster": thrusters}, "made.toml")


SHIPS = {
    "twin": fleet({"port": -2.0, "starboard": 2.0}, {"port_rudder": -2.0, "starboard_rudder": 2.0}),
    "numbers": fleet({"m1": 2.0, "m2": -2.0}, {"r1": 2.0, "r2": -2.0}),
    "four": fleet({"po": -4.0, "pi": -2.0, "si": 2.0, "so": 4.0}, {"pr": -2.0, "sr": 2.0}),
    "tunnels": fleet(
        {"port": -2.0, "starboard": 2.0}, {"port_rudder": -2.0, "starboard_rudder": 2.0}, ("bow", "bow_aft")
    ),
}
SAYINGS = {
    "the name of shipid": lambda component, signal: f"{component}.{signal}",
    "with its unit": lambda component, signal: f"{component}.{signal} [{'rpm' if signal == 'n' else 'deg'}]",
    "behind": lambda component, signal: f"{'rpm' if signal == 'n' else 'angle delta'} {component}",
    "amid": lambda component, signal: f"{signal}_{component}_{'rpm' if signal == 'n' else 'deg'}",
}


@pytest.mark.parametrize("ship", SHIPS)
@pytest.mark.parametrize("saying", SAYINGS)
def test_a_name_that_says_the_component_is_taken_for_it(ship: str, saying: str) -> None:
    """In any order of the columns, none for two components, and nothing is asked about which is which."""
    commands, random = vessel_dynamics(SHIPS[ship]).commands, np.random.default_rng(0)
    said = {name: SAYINGS[saying](*name.split(".")) for name in commands}
    columns = {
        said[name]: (RUDDER if name.endswith("delta") else RPM) * random.uniform(0.7, 1.2)
        + random.normal(0, 0.3, len(R))
        for name in random.permutation(commands).tolist()
    }
    state, names = drafted(columns, SHIPS[ship])
    assert names == said
    assert not any("which is which" in one.sentence or "which column" in one.sentence for one in state.questions)
    assert "several columns for one command" not in {one.kind for one in state.findings}


@pytest.mark.parametrize(
    ("ship", "columns", "expected"),
    [
        ("twin", ("RPM 1", "RPM 2"), {"starboard.n": "RPM 1", "port.n": "RPM 2"}),
        ("twin", ("rpm", "rpm_2"), {"starboard.n": "rpm", "port.n": "rpm_2"}),  # of NMEA 0183
        ("twin", ("n_l", "n_r"), {"port.n": "n_l", "starboard.n": "n_r"}),
        ("twin", ("RPM L", "RPM R"), {"port.n": "RPM L", "starboard.n": "RPM R"}),
        ("numbers", ("rpm2", "rpm1"), {"m1.n": "rpm1", "m2.n": "rpm2"}),
        (
            "four",
            ("rpm 1", "rpm 2", "rpm 3", "rpm 4"),
            dict(zip(("so.n", "si.n", "pi.n", "po.n"), ("rpm 1", "rpm 2", "rpm 3", "rpm 4"), strict=True)),
        ),
        (
            "tunnels",
            ("bow thruster 1 [rpm]", "bow thruster 2 [rpm]"),
            {"bow.n": "bow thruster 1 [rpm]", "bow_aft.n": "bow thruster 2 [rpm]"},
        ),
    ],
)
def test_sides_letters_and_numbers_take_a_column_each(
    ship: str, columns: tuple[str, ...], expected: dict[str, str]
) -> None:
    """Numbers count from starboard, and that is asked."""
    random = np.random.default_rng(1)
    rudders = {name: RUDDER for name in vessel_dynamics(SHIPS[ship]).commands if name.endswith("delta")}
    values = {name: RPM * random.uniform(0.7, 1.2) for name in columns}
    state, names = drafted(rudders | values, SHIPS[ship])
    assert {name: source for name, source in names.items() if source in columns} == expected
    by_number = ship != "numbers" and any(number_in_name(name) for name in columns)
    assert any("?" in one.sentence and columns[0] in one.sentence for one in state.questions) == (
        by_number and "L" not in columns[0]
    )


@pytest.mark.parametrize(("x", "turns"), [(-10.0, 1.0), (9.0, -1.0)])
def test_the_sign_of_an_azimuth_unit_is_that_of_its_place(x: float, turns: float) -> None:
    """A unit forward of the origin turns the ship the other way; only a log against the vessel has its sign changed."""
    document = vessel(propulsor="azimuth").document
    units = {
        name: {**block, "x": x} if name in ("port", "starboard") else block
        for name, block in document["thruster"].items()
    }
    ship = Vessel({**document, "thruster": units}, "made.toml")
    right = -1.0 if x > 0 else 1.0  # of ALPHA, which is of units aft
    state, _ = drafted({"azimuth port": right * turns * ALPHA, "azimuth stbd": right * turns * ALPHA, "rpm": RPM}, ship)
    signs = {one.name: one.extra.get("sign", 1) for one in state.suggestions if one.name.endswith("alpha")}
    assert signs == dict.fromkeys(("port.alpha", "starboard.alpha"), turns)
    assert ("other sign" in {one.kind for one in state.findings}) == (turns < 0)


@pytest.mark.parametrize("seed", seeds(2, 3))
@pytest.mark.parametrize("neutral", [1500.0, 0.0])
@pytest.mark.parametrize("names", [("pwm_port", "pwm_stbd"), ("RCOU.C1", "RCOU.C3")])
def test_throttles_without_a_unit_are_forces_within_the_limits_of_a_small_craft(
    seed: int, neutral: float, names: tuple[str, str]
) -> None:
    """Nothing at neutral, the vessel's limits at the ends, more for more; the factor of a shaft speed is not asked."""
    log, far = craft(seed), 400.0 if neutral else 100.0
    sides = ("port", "starboard")
    pair = {name: neutral + far * log[side].to_numpy() for name, side in zip(names, sides, strict=True)}
    ship = guess_craft(
        SmallCraft(2.0, 1.0, 80.0, 2.5, ((-0.8, -0.4), (-0.8, 0.4)), thrust=55.0), "craft", "c.toml"
    ).vessel
    state = guessed(log, pair)
    name_commands(state, ship)
    assert {one.name: one.source for one in state.suggestions} == {
        "port.force": names[0],
        "starboard.force": names[1],
    }
    for one in state.suggestions:
        ends, forces = np.array(one.extra["curve"]).T
        actuator = f"thruster.{one.name.replace('.', '.actuator.')}"
        assert np.interp(neutral, ends, forces) == 0.0
        assert (np.diff(forces) > 0).all()
        limits = [ship.parameters[f"{actuator}.{end}"] for end in ("low", "high")]
        assert forces[[0, -1]] == pytest.approx(limits, rel=1e-3)
        assert ends[0] <= pair[one.source].min()
        assert pair[one.source].max() <= ends[-1]
        assert one.unit == "N"
    of_sides = [("n", "force")] * (names[0] == "RCOU.C1")  # no name says them
    assert [each.about for each in state.questions] == [*of_sides, ("force",), ("force",)]


def test_a_servo_is_the_swivel_of_an_outboard_with_the_sign_that_turns_it() -> None:
    ship = guess_craft(SmallCraft(2.0, 1.0, 80.0, 2.5, ((-0.8, 0.0),), swivel=35.0), "craft", "craft.toml").vessel
    state, names = drafted({"steering_pwm": 1500.0 + 600.0 * ALPHA, "throttle_pwm": 1500.0 + 20.0 * N}, ship)
    assert names == {"middle.alpha": "steering_pwm", "middle.force": "throttle_pwm"}
    angle = next(one for one in state.suggestions if one.name == "middle.alpha")
    assert np.array(angle.extra["curve"])[[0, -1], 1] == pytest.approx([-35.0, 35.0])
    turned = np.sign(np.corrcoef(R, ALPHA)[0, 1])
    assert angle.extra.get("sign", 1) == -turned  # an angle astern of the middle turns the craft the other way
