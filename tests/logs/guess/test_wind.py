"""A wind is what stands still over ground while the ship turns; where the log does not show it, its names decide."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.logs.simulated import KNOT, as_bridge, drafted, si_log

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


@pytest.mark.parametrize(
    ("kind", "way", "unit", "names", "said"),
    [
        ("true", "from", 1.0, ("Wind speed", "Wind dir"), False),
        ("angle", "from", 1.0, ("TWS", "TWA"), False),
        ("apparent", "from", KNOT, ("AWS", "AWA"), True),
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


def test_a_gusty_true_wind_stays_a_true_one(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    size = 5.0 * np.exp(random.normal(0, 0.4, len(LOG)))
    angle = (random.uniform(0, 360) + random.normal(0, 25.0, len(LOG))) % 360.0
    frame = as_bridge(LOG).assign(**{"Wind speed": size.round(1), "Wind dir": angle.round()})
    assert "kind of wind" not in drafted(frame, tmp_path)[0].kinds
