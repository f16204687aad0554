"""Strangers are ships: a seed makes one, its log is a dataset, and a first guess of it is checked by its log."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.study.first_look import first_look
from shipid.vessel.template import Particulars, first_guess
from tests.benchmarks.strangers import one
from tests.strangers import Stranger, stranger

SEED = 104  # a model with another rudder law, of which the template knows nothing


@pytest.fixture(scope="module")
def ship() -> Stranger:
    return stranger(SEED, 4)


def test_a_seed_makes_one_ship(ship: Stranger) -> None:
    again = stranger(SEED, 4)
    assert again.truth.digest == ship.truth.digest
    assert again.dataset.digest == ship.dataset.digest
    assert "V_c" not in ship.dataset.frame
    assert "V_w" not in ship.dataset.frame
    assert len(ship.dataset.runs) == 4


@pytest.mark.slow
def test_its_first_guess_is_judged_by_its_log(ship: Stranger) -> None:
    """What people know is enough for a vessel that takes the log's commands, and a wrong one is never passed over."""
    known = ship.known
    sizes = [float(known[name]) for name in ("length", "beam", "draught", "block")]
    given = Particulars(*sizes, speed=float(known["speed"]), rpm=float(known["rpm"]), scale=float(known["scale"]))
    guess = first_guess(given, "guess", "guess.toml").vessel
    pace = sizes[0] / float(known["speed"])
    view = first_look(guess, ship.dataset, ship.dataset.runs, ahead=2.5 * pace, step=pace / 4)
    assert np.isfinite([view.alone, view.constant]).all()
    assert view.wrong == (bool(view.changes) or view.alone >= view.constant)
    assert view.corrected <= view.alone
    assert f"{view.constant:.3g} m" in view.sentence


@pytest.mark.slow
def test_a_stranger_is_predicted_without_an_edit() -> None:
    """From particulars and log to a report by commands; the goal of the campaign, for one ship."""
    assert one(SEED)["1x"]["passed"]
