"""First guesses: formulae against measured ships, documents that run, refusals in one line."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipid.errors import ShipidError
from shipid.simulation.manoeuvre import TurningCircle, Zigzag
from shipid.simulation.perform import perform_manoeuvres
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.template import Particulars, added_mass_values, first_guess, hull_values

MARINER = Particulars(160.93, 23.17, 7.47, 0.597, 7.7175)
KVLCC2 = Particulars(320.0, 58.0, 20.8, 0.810, 7.97, ship_type="tanker")
GUNNERUS = Particulars(33.9, 9.6, 2.6, 0.61, 5.0, "azimuth", "research")
BEAMY, SLENDER = Particulars(20.0, 6.0, 2.0, 0.55), Particulars(200.0, 25.0, 9.0, 0.65)


@pytest.mark.parametrize("propulsor", ["propeller-rudder", "azimuth"])
@pytest.mark.parametrize("given", [MARINER, KVLCC2, GUNNERUS, BEAMY, SLENDER])
def test_a_first_guess_turns_and_zigzags(given: Particulars, propulsor: str) -> None:
    """It holds its speed, turns in a few lengths, and does not spin or run away."""
    proposal = first_guess(replace(given, propulsor=propulsor), "ship", "ship.toml")
    pace = given.length / proposal.vessel.document["particulars"]["U_0"]
    kinds = [
        TurningCircle(name="turn", n_rpm=60 * proposal.n, duration=25 * pace),
        Zigzag(name="zigzag", n_rpm=60 * proposal.n, duration=25 * pace, approach="steady"),
    ]
    log = perform_manoeuvres(proposal.vessel, kinds, step=pace / 60)
    turn, zigzag = (log[log["run"] == name] for name in ("turn", "zigzag"))
    assert turn["u"].iloc[0] == pytest.approx(given.service, rel=0.02)
    assert 1.0 < (turn["east"].max() - turn["east"].min()) / given.length < 9.0
    assert np.abs(zigzag["psi"]).max() < np.radians(70)
    assert np.sign(zigzag["psi"]).nunique() >= 2


def test_clarke_near_the_mariner_as_measured() -> None:
    """Derivatives of Chislett and Stroem-Tejsen (1965), in 1e-5 of L^2 primes: four within 10 %, the moments less."""
    to_square = MARINER.draught / MARINER.length
    linear = {name: 1e5 * to_square * hull_values(MARINER)[name].number for name in ("Y_v", "N_r", "N_v")}
    masses = added_mass_values(MARINER)
    unit = 0.5 * 1025 * MARINER.length**3
    assert linear["Y_v"] == pytest.approx(-1160, rel=0.1)
    assert linear["N_r"] == pytest.approx(-184, rel=0.1)
    assert linear["N_v"] == pytest.approx(-264, rel=0.6)  # the formula gives half as much again
    assert 1e5 * masses["Y_vdot"].number / unit == pytest.approx(-748, rel=0.1)
    assert 1e5 * masses["N_rdot"].number / unit / MARINER.length**2 == pytest.approx(-43.8, rel=0.1)


def test_formulae_near_kvlcc2_as_measured() -> None:
    """Table 3 of Yasukawa and Yoshimura (2015)."""
    estimates = {name: value.number for name, value in hull_values(KVLCC2).items()}
    for name, measured in {"Y_v": -0.315, "Y_r": 0.083, "N_v": -0.137, "N_r": -0.049, "Y_vrr": -0.391}.items():
        assert estimates[name] == pytest.approx(measured, rel=0.25), name
    assert -added_mass_values(KVLCC2)["Y_vdot"].number / (0.5 * 1025 * 320**2 * 20.8) == pytest.approx(0.223, rel=0.1)


def dead_ships() -> list[Vessel]:
    """Ten ships from a model of 1 m to 400 m, without screws and wind, as beamy and as deep as the formulae allow."""
    rng, ships = np.random.default_rng(5), [Particulars(31.8, 9.22, 4.52, 0.85), Particulars(88.8, 27.1, 11.1, 0.86)]
    while len(ships) < 10:
        length, slender = np.exp(rng.uniform(0, np.log(400))), rng.uniform(2, 9)
        sizes = length, length / slender, length / slender / rng.uniform(1.8, 6), rng.uniform(0.4, 0.9)
        if sizes[3] / slender > 0.3 or not 0.1 < sizes[1] < 80 or not 0.02 < sizes[2] < 30:
            continue
        ships.append(Particulars(*sizes))
    return [dead(first_guess(one, "ship", "ship.toml").vessel) for one in ships]


def dead(vessel: Vessel) -> Vessel:
    off = {f"thruster.{name}.off": True for name in vessel.document["thruster"]}
    return vessel.with_values(off | {"wind.off": True})


def test_no_drift_drives_a_dead_ship_ahead_or_astern() -> None:
    """Those adrift in a beam wind went ahead faster than with it: the fourth power of the drift is for small angles.

    Astern the drift drove half of all ships on: its drag had the sign of one that goes ahead.
    """
    for ship in dead_ships():
        L, T, U = (ship.document["particulars"][name] for name in ("L_pp", "T", "U_0"))
        values, nothing = list(ship.parameters.values()), np.zeros(0)
        for angle in np.radians(range(0, 181, 5)):
            state = [0.0, 0.0, 0.0, U * np.cos(angle), U * np.sin(angle), 0.0]
            rates = np.array(vessel_dynamics(ship).rates(state, *[nothing] * 3, values, np.zeros(3))).ravel()[3:]
            on = (ship.mass @ rates)[0] * np.sign(np.cos(angle))
            assert on < 1e-9 * ship.document["constants"]["rho"] * L * T * U**2, angle


@pytest.mark.parametrize("propulsor", ["propeller-rudder", "azimuth", "differential"])
def test_every_number_says_where_it_comes_from(propulsor: str) -> None:
    text = first_guess(replace(MARINER, propulsor=propulsor), "ship", "ship.toml").text
    assert "FIRST GUESS" in text.splitlines()[0]
    assert tomllib.loads(text)["description"].startswith("A first guess")
    numbers = [line for line in text.splitlines() if " = " in line and '= "' not in line and not line.startswith("#")]
    assert len(numbers) > 60
    assert [line for line in numbers if line != "dof = 3" and "; " not in line] == []


def test_a_written_first_guess_loads(tmp_path: Path) -> None:
    file = tmp_path / "ship.toml"
    proposal = first_guess(KVLCC2, 'a "quoted" ship', str(file))
    file.write_text(proposal.text)
    assert load_vessel(str(file)).digest == proposal.vessel.digest
    assert load_vessel(str(file)).name == 'a "quoted" ship'


@pytest.mark.parametrize(
    "given",
    [
        Particulars(7.0, 1.27, 0.46, 0.81, 1.179, rpm=627, propeller_diameter=0.216, scale=45.7),
        Particulars(120.0, 18.0, 6.5, 0.65, 7.0, rpm=140, shafts=2),
        Particulars(4.0, 0.7, 0.25, 0.6, 1.2, rpm=700),
        Particulars(40.0, 9.0, 3.0, 0.6, 5.0, "azimuth", rpm=230),
        Particulars(30.0, 6.5, 2.4, 0.55, 4.5, "azimuth", shafts=1, rpm=300, tunnel_thruster=True),
    ],
)
def test_thrust_at_the_service_rpm_balances_the_resistance(given: Particulars) -> None:
    proposal = first_guess(given, "ship", "ship.toml")
    assert 60 * proposal.n == pytest.approx(given.rpm, rel=0.04)  # the air's drag is not in the balance


def test_times_of_a_model_are_those_of_the_ship_over_root_scale() -> None:
    ship, model = Particulars(160.0, 24.0, 9.0, 0.7), Particulars(4.0, 0.6, 0.225, 0.7, scale=40.0)
    numbers = [first_guess(given, "s", "s.toml").vessel.parameters for given in (ship, model)]
    for name, power in (("rate", 0.5), ("T", -0.5)):
        full, small = (values[f"thruster.rudder.actuator.delta.{name}"] for values in numbers)
        assert small / full == pytest.approx(40.0**power, rel=1e-4)
    assert numbers[1]["constants.rho"] == 1000.0
    unsaid = first_guess(replace(model, scale=None), "s", "s.toml")
    assert unsaid.vessel.parameters == numbers[1]  # 160 m is what a model without a scale is taken for
    assert any("--scale; it sets how fast rudder or azimuth turns" in remark for remark in unsaid.remarks)
    catamaran = first_guess(Particulars(2.0, 0.9, 0.2, 0.4, propulsor="differential"), "ship", "ship.toml")
    assert any("--scale; it sets fresh water and a smooth hull" in remark for remark in catamaran.remarks)


@pytest.mark.parametrize("propulsor", ["propeller-rudder", "azimuth"])
def test_the_engines_rpm_is_refused(propulsor: str) -> None:
    with pytest.raises(ShipidError, match="s it the engine's speed"):
        first_guess(replace(MARINER, rpm=1800, propulsor=propulsor), "m", "m.toml")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"length": -5.0}, "length [m] = -5: the formulae hold for 1 to 450"),
        ({"length": -5.0, "speed": None}, "length [m] = -5"),
        ({"draught": 0.0}, "draught [m] = 0"),
        (
            {"length": 300.0},
            "length / beam = 12.9: the formulae hold for 2 to 9: for another ship, take a similar vessel",
        ),
        ({"draught": 2.0}, "beam / draught = 11.6"),
        ({"block": 1.2}, "block = 1.2"),
        ({"block": float("nan")}, "block = nan"),
        (
            {"speed": 40.0},
            "speed [m/s] = 40: the formulae hold for 0.1 to 15.9: is it in m/s? For a faster craft, take",
        ),
        ({"speed": 0.0}, "speed [m/s] = 0"),
        ({"propulsor": "azimut"}, "did you mean 'azimuth'?"),
        ({"ship_type": "tnker"}, "did you mean 'tanker'?"),
        ({"propulsor": "azimuth", "rudder_area": 20.0}, "--rudder-area: there is none with azimuth: leave it out"),
        ({"propulsor": "differential", "rudder_area": 5.0}, "--rudder-area: there is none with differential"),
        (
            {"length": 60.0, "block": 0.8, "draught": 9.0},
            "block x beam / length = 0.309: the formulae hold for 0.04 to 0.3",
        ),
    ],
)
def test_what_the_formulae_do_not_know_is_refused(change: dict[str, object], complaint: str) -> None:
    with pytest.raises(ShipidError) as caught:
        first_guess(replace(MARINER, **change), "ship", "ship.toml")  # type: ignore[arg-type]
    assert complaint in str(caught.value)


def test_no_motion_of_the_water_has_an_energy_below_0() -> None:
    """Clarke's formulae couple sway and yaw of 4 % of drawn ships so much that it had."""
    rng = np.random.default_rng(61126)
    drawn = 0
    while drawn < 300:
        block, slenderness, flatness = rng.uniform((0.4, 2.0, 1.8), (0.9, 5.0, 6.0))
        if not 0.04 <= block / slenderness <= 0.3:
            continue
        drawn += 1
        water = {
            k: -v.number
            for k, v in added_mass_values(Particulars(1.0, 1 / slenderness, 1 / slenderness / flatness, block)).items()
        }
        coupling = (water["Y_rdot"] + water["N_vdot"]) / 2
        assert np.linalg.eigvalsh([[water["Y_vdot"], coupling], [coupling, water["N_rdot"]]]).min() > 0
        assert water["X_udot"] > 0
