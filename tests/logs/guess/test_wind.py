"""A wind is what stands still over ground while the ship turns; where the log does not show it, its names decide."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.files import write_new
from shipid.logs.guess.columns import Guess, guess
from shipid.logs.guess.draft import draft_mapping
from shipid.logs.importing import import_log, read_mapping
from tests.logs.simulated import KNOT, as_bridge, si_log

MPH = 0.44704  # m/s
LOG = si_log()
TURNED = np.exp(1j * LOG["psi"].to_numpy())
SHIP = (LOG["u"] + 1j * LOG["v"]).to_numpy() * TURNED


def _blowing(seed: int = 3) -> np.ndarray:
    """A true wind of 7 m/s towards 150 deg with gusts of 15 % and 20 s, and noise of the direction of 3 deg."""
    random = np.random.default_rng(seed)
    gusts, kept = np.zeros(len(LOG)), np.exp(-0.5 / 20.0)
    for row in range(1, len(LOG)):
        gusts[row] = kept * gusts[row - 1] + random.normal(0, 0.15 * np.sqrt(1 - kept**2))
    return 7.0 * (1 + gusts) * np.exp(1j * np.radians(150.0 + random.normal(0, 3.0, len(LOG))))


WIND = _blowing()


def logged(kind: str, way: str, unit: float, names: tuple[str, str], rows: slice = slice(None)) -> pd.DataFrame:
    """The log with that wind in two columns, as an anemometer of that kind shows it."""
    vector = {"true": WIND, "angle": WIND / TURNED, "apparent": (WIND - SHIP) / TURNED}[kind]
    angle = np.degrees(np.angle(vector if way == "towards" else -vector)) % 360.0
    return as_bridge(LOG).assign(**{names[0]: (np.abs(vector) / unit).round(1), names[1]: angle.round()}).iloc[rows]


def drafted(frame: pd.DataFrame, folder: Path) -> tuple[Guess, Dataset]:
    frame.to_csv(folder / "log.csv", index=False)
    proposal = guess(folder / "log.csv")
    mapping = write_new(draft_mapping(proposal), folder / "draft.toml")
    return proposal, import_log(read_mapping(mapping).model_copy(update={"segment": ()}), folder / "log.csv")


@pytest.mark.parametrize(
    ("kind", "way", "unit", "names", "said"),
    [
        ("true", "from", 1.0, ("Wind speed", "Wind dir"), False),
        ("true", "towards", 1.0, ("Wind speed", "Wind direction to"), False),
        ("true", "towards", 1.0, ("Wind speed", "Wind direction towards"), False),
        ("angle", "from", 1.0, ("TWS", "TWA"), False),
        ("angle", "from", 1.0, ("Wind speed", "Wind angle"), True),
        ("apparent", "from", 1.0, ("AWS", "AWA"), False),
        ("apparent", "from", KNOT, ("AWS", "AWA"), True),
        ("apparent", "from", KNOT, ("AWS [kn]", "AWA"), False),
        ("apparent", "from", 1.0, ("Wind speed", "Wind angle"), True),
        ("apparent", "towards", 1.0, ("Wind speed", "Wind angle"), True),
    ],
)
def test_the_wind_over_ground_is_the_true_one(
    kind: str, way: str, unit: float, names: tuple[str, str], said: bool, tmp_path: Path
) -> None:
    proposal, dataset = drafted(logged(kind, way, unit, names), tmp_path)
    run = dataset.frame
    imported = run["V_w"].to_numpy() * np.exp(1j * run["beta_w"].to_numpy())
    assert np.sqrt(np.mean(np.abs(imported - WIND) ** 2)) < 0.2
    assert ("kind of wind" in proposal.kinds) == said
    assert [
        one.sentence for one in proposal.findings if one.kind == "kind of wind" and "m/s (RMS)" in one.sentence
    ] or (not said)


def test_a_ship_that_goes_straight_shows_no_wind(tmp_path: Path) -> None:
    """In the first 110 s the ship does not turn: the names alone decide, and the draft says so."""
    proposal = drafted(logged("apparent", "from", 1.0, ("Wind speed", "Wind dir"), slice(0, 220)), tmp_path)[0]
    column = proposal.column("V_w")
    assert column is not None
    assert "the log does not show whether it is true or apparent" in column.evidence
    assert "kind of wind" not in proposal.kinds


@pytest.mark.parametrize("seed", range(4))
def test_a_gusty_true_wind_stays_a_true_one(seed: int, tmp_path: Path) -> None:
    random = np.random.default_rng(seed)
    size = 5.0 * np.exp(random.normal(0, 0.4, len(LOG)))
    angle = (random.uniform(0, 360) + random.normal(0, 25.0, len(LOG))) % 360.0
    frame = as_bridge(LOG).assign(**{"Wind speed": size.round(1), "Wind dir": angle.round()})
    assert "kind of wind" not in drafted(frame, tmp_path)[0].kinds


@pytest.mark.parametrize("gusty", [True, False])
def test_an_apparent_wind_in_miles_per_hour_is_read_or_asked(gusty: bool, tmp_path: Path) -> None:
    """In knots it would be 15 % more: gusts hide that, and a steady wind shows it."""
    frame = logged("apparent", "from", MPH, ("AWS", "AWA"))
    if not gusty:
        vector = (7.0 * np.exp(1j * np.radians(150.0)) - SHIP) / TURNED
        frame = frame.assign(AWS=(np.abs(vector) / MPH).round(1), AWA=(np.degrees(np.angle(-vector)) % 360).round(1))
    proposal, dataset = drafted(frame, tmp_path)
    asked = [one.sentence for one in proposal.questions if "'AWS'" in one.sentence]
    assert any("mph" in one for one in asked) == gusty
    if not gusty:
        assert dataset.frame["V_w"].to_numpy() == pytest.approx(7.0, abs=0.1)
