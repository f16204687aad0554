"""What no ship can be is refused, with the number and what would be right."""

import pytest

from shipid.errors import DocumentError
from shipid.vessel.load import Vessel, load_vessel


@pytest.mark.parametrize(
    ("vessel", "path", "value", "remedy"),
    [
        ("gunnerus-28.9", "added_mass.X_udot", 79320.0, "X_udot is negative"),
        ("gunnerus-28.9", "added_mass.N_rdot", 1.0, "N_rdot is negative"),
        ("gunnerus-33.9", "hull.crossflow.x_fwd", -16.0, "ahead of x_aft"),
        ("mariner", "inertia.m", 1.4e6, "is the unit kg"),
        ("mariner", "inertia.m", 6.8e7, "is the unit kg"),
        ("kvlcc2-l7", "thruster.rudder.actuator.delta.high", 35.0, "in rad"),
        ("kvlcc2-l7", "thruster.rudder.actuator.delta.low", -35.0, "in rad"),
    ],
)
def test_nonsense_is_refused(vessel: str, path: str, value: float, remedy: str) -> None:
    with pytest.raises(DocumentError, match=remedy) as caught:
        load_vessel(vessel).with_values({path: value})
    assert caught.value.path == path


def test_coupling_terms_of_added_mass_may_have_either_sign(bundled_vessel: Vessel) -> None:
    assert bundled_vessel.with_values({"added_mass.Y_rdot": 1.0, "added_mass.N_vdot": -1.0})


def test_limits_of_an_actuator_leave_a_range() -> None:
    limits = {"thruster.rudder.actuator.delta": {"kind": "rate_limit", "rate": 0.04, "low": 0.6, "high": -0.6}}
    with pytest.raises(DocumentError, match="above low") as caught:
        load_vessel("kvlcc2-l7").with_values(limits)
    assert caught.value.path == "thruster.rudder.actuator.delta.high"


@pytest.mark.parametrize(
    ("beta", "thrust"),
    [([0.0, 90.0, 180.0], [0.5, -0.6, -0.3]), ([-180.0, 20.0, 180.0], [-0.4, 0.5, -0.3])],
)
def test_a_screw_in_four_quadrants_has_the_whole_circle(beta: list[float], thrust: list[float]) -> None:
    block = {"kind": "four_quadrant", "x": -3.4, "D_p": 0.2, "beta_deg": beta, "C_T": thrust}
    with pytest.raises(DocumentError, match="from -180 to 180"):
        load_vessel("kvlcc2-l7").with_values({"thruster.propeller": block})
