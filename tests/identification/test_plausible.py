"""Ranges hold for every bundled vessel, and refuse what no ship has."""

from __future__ import annotations

import pytest

from shipid.identification.plausible import implausibility, plausible_factors
from shipid.vessel.load import Vessel, check_document, load_vessel


def test_every_bundled_vessel_is_a_ship(bundled_vessel: Vessel) -> None:
    assert [
        objection for path in bundled_vessel.parameters if (objection := implausibility(bundled_vessel, path, {}))
    ] == []


@pytest.mark.parametrize(
    ("path", "factor", "message"),
    [
        ("added_mass.Y_vdot", 1e-5, "added mass in sway over the mass is 7.69e-06, of ships 0.25 to 1.8"),
        ("added_mass.Y_vdot", 0.3, "no ship has that"),
        ("added_mass.N_rdot", 5.0, "added moment in yaw"),
        ("inertia.I_z", 0.3, "radius of gyration"),
        ("hull.mmg.Y_v", -1.0, "of ships below 0"),
        ("hull.mmg.N_r", -0.5, "of ships below 0"),
        ("thruster.rudder.gamma_R_plus", 2.4, "flow straightening is 1.54"),
        ("thruster.rudder.a_H", 2.87, "at the end of the range of ships 0 to 0.9"),
        ("thruster.rudder.ell_R", -1.0, "lever of the flow"),
    ],
)
def test_what_no_ship_has_is_reported(path: str, factor: float, message: str) -> None:
    vessel = load_vessel("kvlcc2-l7")
    sentence = implausibility(vessel, path, {path: factor * vessel.parameters[path]})
    assert message in sentence
    assert sentence.startswith(path)
    assert "\n" not in sentence


@pytest.mark.parametrize("path", ["hull.abkowitz.Y_v", "hull.abkowitz.N_r"])
def test_a_damping_of_abkowitz_that_changes_its_sign_is_reported(path: str) -> None:
    """A fit of logs in a current made Y_v -0.145 times what it is, and no line said so."""
    vessel = load_vessel("mariner")
    assert "of ships below 0" in implausibility(vessel, path, {path: -0.145 * vessel.parameters[path]})
    assert implausibility(vessel, path, {path: 0.5 * vessel.parameters[path]}) == ""


def test_added_mass_is_judged_by_the_mass_that_was_fitted_too() -> None:
    vessel = load_vessel("kvlcc2-l7")
    heavier = {"inertia.m": 5 * vessel.parameters["inertia.m"]}
    assert "added mass in sway" in implausibility(vessel, "added_mass.Y_vdot", heavier)


def test_what_has_no_range_or_no_length_to_judge_by_has_no_bounds() -> None:
    assert plausible_factors(load_vessel("kvlcc2-l7"), "hull.mmg.Y_vvr") == (-float("inf"), float("inf"))
    document = load_vessel("gunnerus-28.9").document
    sizes = {name: size for name, size in document["particulars"].items() if name != "L_pp"}
    without = check_document({**document, "particulars": sizes}, "without L_pp")
    assert plausible_factors(without, "inertia.I_z") == (-float("inf"), float("inf"))
    assert implausibility(without, "inertia.I_z", {"inertia.I_z": 1.0}) == ""


@pytest.mark.parametrize("factor", [0.02, 0.3, 0.9, 1.1, 3.0, 30.0, -1.0])
def test_outside_is_what_the_verdict_says_no_ship_has(factor: float) -> None:
    ship = load_vessel("kvlcc2-l7")
    for path, base in ship.parameters.items():
        low, high = plausible_factors(ship, path)
        judged = implausibility(ship, path, {path: factor * base})
        assert (base != 0 and not low <= factor <= high) == ("no ship has that" in judged), path
