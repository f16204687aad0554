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
    identified = run_identification(guess().vessel, data, settings, held_out=data.runs[4:], ahead=30.0)
    assert len(identified.solution.paths) == 20
    assert identified.solution.status == "ok"
    errors = identified.errors[(identified.errors["set"] == "test") & (identified.errors["run"] == ALL)].set_index(
        "model"
    )
    for signal in ("u", "v", "r", "position"):
        assert errors[signal]["after"] < 0.5 * errors[signal]["before"]
    assert np.isfinite(identified.statistics.errors[~identified.solution.at_bound]).all()
