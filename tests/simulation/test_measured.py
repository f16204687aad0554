import numpy as np
import pytest

from shipid.errors import ShipidError
from shipid.simulation.measured import approached, manoeuvre_content, measure_standard
from shipid.vessel.load import load_vessel


@pytest.mark.parametrize("name", ["zigzag", "spiral"])
def test_a_manoeuvre_is_simulated_measured_and_shown(name):
    done = measure_standard(load_vessel("gunnerus-28.9"), name)
    assert {"t", "north", "east", "psi", "u", "v", "r"} <= set(done.frame.columns)
    assert not [column for column in done.frame if str(column).startswith("actual.")]
    measures = {row["measure"]: row["value"] for row in done.measures}
    assert np.isfinite(measures["execute heading" if name == "zigzag" else "loop width"])
    content = manoeuvre_content(done, "shipid manoeuvre")
    assert content.kind == name
    assert (len(content.levels) > 0) == (name == "spiral")
    np.testing.assert_array_equal(content.log["t"], done.record.t)
    assert np.ptp(content.outline[:, 0]) == pytest.approx(31.25)  # over all [m]
    assert content.answer[0].figure == "measures"


def test_a_ship_that_does_not_go_straight_gets_a_helmsman():
    lame = load_vessel("gunnerus-28.9").with_values({"thruster.starboard.off": True})
    done = measure_standard(lame, "turning", (20,), duration=120.0)
    assert done.standard.manoeuvre.approach == "helmsman"
    assert approached(done.standard).endswith("held on course by a helmsman")
    assert np.isfinite({row["measure"]: row["value"] for row in done.measures}["advance"])
    with pytest.raises(ShipidError, match="turns with the helm amidships"):
        measure_standard(lame, "turning", (20,), approach="steady")
    rest = measure_standard(lame, "turning", (20,), approach="rest", duration=60.0)
    assert rest.record.u[0] == 0
    assert approached(rest.standard).startswith("from rest")
