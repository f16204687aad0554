import numpy as np
import pytest

from shipid.errors import ShipidError
from shipid.simulation.measured import approach_words, manoeuvre_content, measure_standard
from shipid.units import DEGREE
from shipid.vessel.load import load_vessel
from shipid.vessel.template import Particulars, first_guess


@pytest.mark.parametrize("name", ["zigzag", "spiral"])
def test_a_manoeuvre_is_simulated_measured_and_shown(name):
    done = measure_standard(load_vessel("gunnerus-28.9"), name)
    assert {"t", "north", "east", "psi", "u", "v", "r"} <= set(done.frame.columns)
    assert not [column for column in done.frame if str(column).startswith("actual.")]
    measures = {row["measure"]: row["value"] for row in done.measures}
    assert np.isfinite(measures["execute heading" if name == "zigzag" else "loop width"])
    content = manoeuvre_content(done, "shipid manoeuvre")
    assert content.name == name
    assert set(content.first) <= measures.keys()
    assert (len(content.levels) > 0) == (name == "spiral")
    np.testing.assert_array_equal(content.log["t"], done.record.t)
    assert np.ptp(content.outline[:, 0]) == pytest.approx(31.25)  # over all [m]
    assert content.answer[0].figure == "measures"


def test_a_ship_that_does_not_go_straight_gets_a_helmsman():
    lame = load_vessel("gunnerus-28.9").with_values({"thruster.starboard.off": True})
    done = measure_standard(lame, "turning", (20,), duration=120.0)
    assert done.standard.manoeuvre.approach == "helmsman"
    assert approach_words(done).endswith("held on course by a helmsman")
    assert np.isfinite({row["measure"]: row["value"] for row in done.measures}["advance"])
    with pytest.raises(ShipidError, match="turns with the helm amidships"):
        measure_standard(lame, "turning", (20,), approach="steady")
    rest = measure_standard(lame, "turning", (20,), approach="rest", duration=60.0)
    assert rest.record.u[0] == 0
    assert approach_words(rest).startswith("from rest")


@pytest.mark.parametrize("length", [1.0, 1.5, 6.0, 30.0])
@pytest.mark.parametrize("propulsor", ["azimuth", "rudder"])
def test_a_ship_of_any_size_turns_to_the_side_that_is_asked(length: float, propulsor: str) -> None:
    """What helm does is tested where the ship is in balance: 1 m/s at 1 rev/s is no speed of a screw of 5 cm."""
    known = {} if propulsor == "rudder" else {"propulsor": propulsor}
    ship = first_guess(Particulars(length, 0.27 * length, 0.08 * length, 0.6, **known), "b", "b.toml").vessel
    for side, sign in (("starboard", 1.0), ("port", -1.0)):
        turned = measure_standard(ship, "turning", 35.0, side=side)
        assert sign * turned.frame["psi"].iloc[-1] > np.pi
        assert all(row["verdict"] != "not judged" for row in turned.criteria)


@pytest.mark.parametrize(("helm", "heading"), [(10, 9), (10, 11), (7.5, 7.5), (20, 19), (3, 0.5)])
def test_a_zigzag_is_measured_at_the_heading_at_which_it_was_ordered(helm: float, heading: float) -> None:
    """Of a log the heading is estimated, to a multiple of 5 deg where it is near; here it is known."""
    done = measure_standard(load_vessel("kvlcc2-l7"), "zigzag", (helm, heading))
    measures = {row["measure"]: row["value"] for row in done.measures}
    assert measures["execute heading"] == pytest.approx(heading)
    executes = np.flatnonzero(np.diff(done.record.helm)) + 1
    off = (done.record.psi - done.record.psi[0]) / DEGREE
    assert measures["overshoot 1"] == pytest.approx(off[executes[1] : executes[2]].max() - heading, abs=0.02)
    assert not done.criteria  # of 10/10 and 20/20
