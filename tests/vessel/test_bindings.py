"""Bindings: every keyword of a physics function has a path, shared numbers come from the particulars."""

from __future__ import annotations

import copy

import pytest

from shipid.document import value_at_path
from shipid.vessel.bindings import bind_document, parameter_units
from shipid.vessel.load import load_vessel


@pytest.mark.parametrize("name", ["gunnerus-28.9", "kvlcc2-l7", "mariner"])
def test_every_path_leads_to_a_number(name: str) -> None:
    document = load_vessel(name).document
    known = parameter_units(document)
    assert known["inertia.m"] == "kg"
    assert all(isinstance(value_at_path(document, path), int | float) for path in known)


def test_numbers_of_an_actuator_have_the_unit_of_its_command() -> None:
    """Exports and tables said `1/s of the command`."""
    document = copy.deepcopy(load_vessel("gunnerus-28.9-6dof").document)
    gear = {"kind": "first_order", "T": 2.0, "rate": 0.2, "low": -1.0, "high": 1.0}
    document["thruster"]["port"]["actuator"] = {"n": gear, "alpha": gear}
    known = parameter_units(document)
    shaft, unit = "thruster.port.actuator.n", "thruster.port.actuator.alpha"
    assert [known[f"{shaft}.{name}"] for name in ("T", "rate", "low", "high")] == ["s", "rev/s^2", "rev/s", "rev/s"]
    assert [known[f"{unit}.{name}"] for name in ("rate", "low", "high")] == ["rad/s", "rad", "rad"]
    document["thruster"]["port"] = {
        "kind": "controllable_pitch", "x": -10.0, "D_p": 1.0, "k_P": 0.4, "k_J": 0.4, "actuator": {"pitch": gear},
    }  # fmt: skip
    known = parameter_units(document)
    assert [known[f"thruster.port.actuator.pitch.{name}"] for name in ("rate", "low")] == ["1/s", "-"]


def test_shared_numbers_come_from_the_particulars() -> None:
    bound = bind_document(load_vessel("kvlcc2-l7").document)
    assert bound["hull.mmg"]["L_pp"] == "particulars.L_pp"
    assert bound["hull.mmg"]["rho"] == "constants.rho"
    assert bound["thruster.propeller"]["D_p"] == "thruster.propeller.D_p"
