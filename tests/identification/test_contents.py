"""The page of an identification holds what was identified."""

from pathlib import Path

import pytest

from shipid.data.dataset import Dataset
from shipid.identification.contents import identification_content
from shipid.identification.outcome import run_identification
from shipid.identification.settings import Identify
from shipid.simulation.measured import measure_standard
from shipid.vessel.load import load_vessel


@pytest.mark.slow
def test_the_page_holds_what_was_identified():
    ship = load_vessel("gunnerus-28.9")
    frame = measure_standard(ship, "zigzag", (20.0, 10.0)).frame
    log = Dataset(frame, {"clock": "run", "flags": [], "source": "simulated"})
    wanted = ["hull.derivatives.Y_uv", "hull.derivatives.N_ur"]
    identified = run_identification(ship, log, Identify(parameters=wanted))
    content = identification_content(identified, "z.parquet", "shipid identify")
    assert list(content.estimates["path"]) == wanted
    assert content.correlations.shape == (2, 2)
    assert content.provenance["Dataset"] == f"z.parquet, digest {identified.digest}"
    assert content.provenance["Held out"] == "none"
    assert content.study_document == identified.patch(Path())
    assert len(content.profiles) == 0
    assert content.answer[0].text == "2 of 2 parameters are identified by these runs."
