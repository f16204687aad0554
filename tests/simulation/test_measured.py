import numpy as np
import pytest

from shipid.simulation.measured import manoeuvre_content, measure_standard
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
