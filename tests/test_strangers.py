"""Strangers are ships: a seed makes one, its log is a dataset, and a first guess of it is checked by its log."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.identification.diagnosis import diagnose
from shipid.vessel.template import Particulars, first_guess
from tests.benchmarks.strangers import true_dataset
from tests.strangers import Stranger, stranger
from tests.strangers_raw import RawStranger, raw_stranger

SEED = 102  # a model with another rudder law, of which the template knows nothing


@pytest.fixture(scope="module")
def ship() -> Stranger:
    return stranger(SEED, 4)


@pytest.fixture(scope="module")
def raw(tmp_path_factory: pytest.TempPathFactory) -> RawStranger:
    return raw_stranger(611, tmp_path_factory.mktemp("raw"), 3)


@pytest.mark.slow
def test_its_first_guess_is_judged_by_its_log(ship: Stranger) -> None:
    """What people know is enough for a vessel that takes the log's commands, and a wrong one is never passed over."""
    known = ship.known
    sizes = [float(known[name]) for name in ("length", "beam", "draught", "block")]
    given = Particulars(*sizes, speed=float(known["speed"]), rpm=float(known["rpm"]), scale=float(known["scale"]))
    guess = first_guess(given, "guess", "guess.toml").vessel
    pace = sizes[0] / float(known["speed"])
    found = diagnose(guess, ship.dataset)
    assert found.ahead == pytest.approx(5.0 * pace, rel=1.0)
    assert f"err by {found.error:.3g} m" in found.sentence


@pytest.mark.parametrize("way", [1, -1], ids=["as it is", "mirrored"])
def test_orders_of_the_truth_are_found_for_an_import(raw: RawStranger, way: int) -> None:
    """An import of another clock, frame and sensor comes back to the rows of the truth."""
    frame = raw.dataset.frame
    ahead, arm = np.exp(1j * frame["psi"]), 0.3 * float(raw.known["length"])
    place = (frame["north"] + 1j * frame["east"] + arm * ahead).to_numpy()
    other = frame.assign(north=place.real, east=way * place.imag, psi=way * frame["psi"], r=way * frame["r"])
    other = other.assign(v=way * (frame["v"] + arm * frame["r"]), t=frame["t"] + 1e6)
    commands = raw.dataset.commands
    lost = Dataset(other.drop(columns=commands), raw.dataset.metadata)
    found = true_dataset(raw, lost, raw.dataset.runs).frame
    pd.testing.assert_frame_equal(found[commands], frame[commands])
    moved = ["north", "east", "psi", "v", "r"]
    np.testing.assert_allclose(found[moved], frame[moved], atol=1e-6 * float(np.abs(place).max()))
