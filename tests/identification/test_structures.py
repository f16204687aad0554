"""A hull exchanged for another: the same forces, the numbers that stay free, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DataError, DocumentError, ShipidError
from shipid.identification.settings import Identify, free_factors
from shipid.identification.structures import (
    PRESENT,
    STRUCTURES,
    check_structures,
    exchange_structure,
)
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.identification.trials import trials

KVLCC2, GUNNERUS = load_vessel("kvlcc2-l7"), load_vessel("gunnerus-28.9")
SETTINGS = Identify(
    parameters=["hull.*", "added_mass.Y_vdot", "thruster.*.f_alpha"],
    prior={"hull.*": 0.4, "added_mass.*": 0.2},
    bounds={"thruster.rudder.f_alpha": (0.5, 2.0)},
)


LOGS: dict[str, Dataset] = {}


def log_of(ship: Vessel) -> Dataset:
    """Runs of a ship, made once and not to be changed."""
    if ship.digest not in LOGS:
        LOGS[ship.digest] = trials(ship, runs=3, steps=60)
    return LOGS[ship.digest]


def rates(vessel: Vessel, nu: tuple[float, float, float], orders: dict[str, float]) -> np.ndarray:
    model = vessel_dynamics(vessel)
    commands = [orders[name.rsplit(".", 1)[-1]] for name in model.commands]
    memory = [orders[name.rsplit(".", 1)[-1]] for name in model.memory]
    weather, none = np.zeros(len(model.environment)), np.zeros(model.num_dof)
    result = model.rates([0, 0, 0, *nu], memory, commands, weather, list(vessel.parameters.values()), none)
    return np.array(result).ravel()[3:]


@pytest.mark.parametrize("ship", [KVLCC2, GUNNERUS], ids=["kvlcc2", "gunnerus"])
@pytest.mark.parametrize("name", list(STRUCTURES))
def test_the_new_hull_makes_nearly_the_forces_of_the_old_one(name: str, ship: Vessel) -> None:
    data = log_of(ship)
    asked = SETTINGS if ship is KVLCC2 else Identify(parameters=["hull.*"])
    exchanged = exchange_structure(ship, name, data, data.runs, asked)
    assert max(exchanged.misfit.values()) < 0.16
    moving = data.frame[["u", "v", "r", *vessel_dynamics(ship).commands]].iloc[10::17]
    short = [column.rsplit(".", 1)[-1] for column in moving.columns]
    pairs = []
    for row in moving.to_numpy():
        values = dict(zip(short, row.tolist(), strict=True))
        nu = (values["u"], values["v"], values["r"])
        pairs.append((rates(ship, nu, values), rates(exchanged.vessel, nu, values)))
    old, new = np.array(pairs).swapaxes(0, 1)
    assert (np.sqrt(((old - new) ** 2).mean(axis=0)) < 0.3 * np.sqrt((old**2).mean(axis=0))).all()
    free = free_factors(exchanged.vessel, exchanged.settings)  # the vessel accepts its settings
    assert set(STRUCTURES[name].hull) <= set(free.paths)


def test_the_same_structure_is_recovered() -> None:
    data = log_of(KVLCC2)
    exchanged = exchange_structure(KVLCC2, "mmg", data, data.runs, SETTINGS)
    for path, value in KVLCC2.parameters.items():
        assert exchanged.vessel.parameters[path] == pytest.approx(value, rel=1e-4, abs=1e-6), path
    assert max(exchanged.misfit.values()) < 1e-6
    present = exchange_structure(KVLCC2, PRESENT, data, data.runs, SETTINGS)
    assert present.vessel is KVLCC2
    assert present.settings is SETTINGS


def test_numbers_outside_of_the_hull_stay_as_the_settings_say() -> None:
    data = trials(KVLCC2, runs=2, steps=40)
    exchanged = exchange_structure(KVLCC2, "cubic", data, data.runs, SETTINGS).settings
    assert {"added_mass.Y_vdot", "thruster.rudder.f_alpha"} <= set(exchanged.parameters)
    assert not [path for path in exchanged.parameters if path.startswith("hull.mmg")]
    assert exchanged.prior["added_mass.Y_vdot"] == 0.2
    assert exchanged.bounds == {"thruster.rudder.f_alpha": (0.5, 2.0)}
    polynomial = exchange_structure(KVLCC2, "abkowitz", data, data.runs, SETTINGS)
    assert "thruster.rudder.f_alpha" not in polynomial.settings.parameters  # that rudder is gone, its gear is not
    rudder, before = (one.document["thruster"]["rudder"] for one in (polynomial.vessel, KVLCC2))
    assert rudder["kind"] == "rudder_derivatives"
    assert rudder["actuator"] == before["actuator"]


@pytest.mark.parametrize("name", list(STRUCTURES))
def test_a_hull_in_the_bis_system_is_replaced(name: str) -> None:
    """It stayed beside the new one, whose coefficients all began at 0: its numbers were fixed in every structure."""
    tanker = load_vessel("esso-190k")
    data = log_of(tanker)
    exchanged = exchange_structure(tanker, name, data, data.runs, Identify(parameters=["hull.*"]))
    assert "bis_derivatives" not in exchanged.vessel.document["hull"]
    assert max(exchanged.misfit.values()) < 0.02
    values = exchanged.vessel.parameters
    assert any(values[path] for path in STRUCTURES[name].hull if path.rpartition(".")[2].startswith("N_"))


HEELING = {
    "derivatives": (load_vessel("naval-51"), "K_p|p|"),
    "prime_derivatives": (load_vessel("container-175"), "N_vphiphi"),
}


@pytest.mark.parametrize("name", list(STRUCTURES))
@pytest.mark.parametrize("block", list(HEELING))
def test_roll_and_heel_stay_in_the_hull(block: str, name: str) -> None:
    """Without damping and moment of heel a roll of 0.1 rad would grow in still water."""
    ship, coefficient = HEELING[block]
    data = log_of(ship)
    vessel = exchange_structure(ship, name, data, data.runs, Identify(parameters=["hull.*"])).vessel
    assert vessel.document["hull"][block][coefficient] == ship.document["hull"][block][coefficient]


@pytest.mark.parametrize("name", list(STRUCTURES))
def test_a_rudder_that_is_off_stays_off(name: str) -> None:
    """No coefficient of it is free, it takes no order, and its block is as before."""
    without = KVLCC2.with_values({"thruster.rudder.off": True})
    data = log_of(KVLCC2)
    exchanged = exchange_structure(without, name, data, data.runs, Identify(parameters=["hull.*"]))
    assert vessel_dynamics(exchanged.vessel).commands == vessel_dynamics(without).commands
    assert not [path for path in exchanged.settings.parameters if path.startswith("thruster.rudder")]
    assert exchanged.vessel.document["thruster"]["rudder"] == without.document["thruster"]["rudder"]


def test_resistance_is_taken_over_once() -> None:
    data = trials(GUNNERUS, runs=2, steps=40)
    for name in STRUCTURES:
        vessel = exchange_structure(GUNNERUS, name, data, data.runs, Identify(parameters=["hull.*"])).vessel
        straight = [rates(one, (3.0, 0.0, 0.0), {"n": 2.0, "alpha": 0.0})[0] for one in (GUNNERUS, vessel)]
        assert straight[1] == pytest.approx(straight[0], abs=0.02), name


def test_what_is_no_structure_or_lacks_a_size_is_refused() -> None:
    data = trials(KVLCC2, runs=2, steps=40)
    with pytest.raises(ShipidError, match="'cubik' is no structure: did you mean 'cubic'"):
        check_structures(["cubik"])
    with pytest.raises(ShipidError, match="named twice"):
        check_structures(["mmg", "cubic", "mmg"])
    mariner = load_vessel("mariner")
    sizes = {"particulars": {"L_pp": 160.93, "U_0": 7.7175}}
    with pytest.raises(DocumentError, match=r"particulars.T: missing: a structure of the hull needs it"):
        exchange_structure(
            Vessel(mariner.document | sizes, mariner.file), "mmg", data, ["M01"], Identify(parameters=["hull.*"])
        )
    with pytest.raises(DataError, match="needs this command"):
        exchange_structure(GUNNERUS, "mmg", data, ["M01"], Identify(parameters=["hull.*"]))
