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
        ("gunnerus-28.9", "inertia.m", 410.9, "is the unit kg"),
        ("gunnerus-28.9", "inertia.m", 4.1e8, "is the unit kg"),
    ],
)
def test_nonsense_is_refused(vessel: str, path: str, value: float, remedy: str) -> None:
    with pytest.raises(DocumentError, match=remedy) as caught:
        load_vessel(vessel).with_values({path: value})
    assert caught.value.path == path


def test_coupling_terms_of_added_mass_may_have_either_sign(bundled_vessel: Vessel) -> None:
    assert bundled_vessel.with_values({"added_mass.Y_rdot": 1.0, "added_mass.N_vdot": -1.0})
