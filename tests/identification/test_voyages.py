"""A first guess and noisy voyages in gusty wind become a ship that predicts voyages which the fit has not seen."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.identification.free_run import ALL
from shipid.identification.outcome import run_identification
from tests.identification.voyages import SETTINGS, guess, voyages


@pytest.mark.slow
def test_a_first_guess_becomes_a_ship_that_predicts() -> None:
    data = voyages(6, 40.0, 80.0)
    settings = SETTINGS.model_copy(update={"step": 0.5})
    found = run_identification(guess().vessel, data, settings, held_out=data.runs[4:], ahead=30.0)
    assert len(found.solution.paths) == 20
    assert found.solution.status == "ok"
    errors = found.errors[(found.errors["set"] == "test") & (found.errors["run"] == ALL)].set_index("model")
    for signal in ("u", "v", "r", "position"):
        assert errors[signal]["after"] < 0.5 * errors[signal]["before"]
    assert np.isfinite(found.statistics.errors[~found.solution.at_bound]).all()
