"""Numbers that no ship has are refused with the range; the word `unusual` overrides it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.vessel.load import Vessel, load_vessel

NONSENSE: dict[str, tuple[str, Any]] = {
    "inertia of nothing": ("inertia.I_z", 1e-3),
    "inertia of a moon": ("inertia.I_z", 1e15),
    "thruster beyond the horizon": ("thruster.port.x", 1.2e7),
    "water of lead": ("constants.rho", 11340.0),
    "density in t/m3": ("constants.rho", 1.025),
    "air of iron": ("constants.rho_a", 7800.0),
    "area of a town": ("wind.A_LW", 1e7),
    "length in mm": ("particulars.L_pp", 28900.0),
}


@pytest.mark.parametrize("name", NONSENSE)
def test_nonsense_is_refused_and_may_be_meant(name: str) -> None:
    path, value = NONSENSE[name]
    ship = load_vessel("gunnerus-28.9")
    with pytest.raises(DocumentError) as caught:
        ship.with_values({path: value})
    assert caught.value.path in (path, "inertia", "inertia.m")  # of the mass of a ship of another length


@pytest.mark.parametrize("name", ["inertia of nothing", "thruster beyond the horizon", "area of a town"])
def test_the_word_overrides(name: str) -> None:
    path, value = NONSENSE[name]
    ship = load_vessel("gunnerus-28.9")
    with pytest.raises(DocumentError, match=f'write unusual = \\["{path}"\\]'):
        ship.with_values({path: value})
    meant = {path: value, "unusual": [path]} | ({"added_mass.N_rdot": -1e6} if "inertia" in path else {})
    assert ship.with_values(meant).parameters[path] == value


def test_a_wind_table_in_radians_is_seen() -> None:
    ship = load_vessel("gunnerus-28.9")
    degrees = ship.document["wind"]["gamma_deg"]
    with pytest.raises(DocumentError, match="are these radians"):
        ship.with_values({"wind.gamma_deg": np.radians(degrees).tolist()})


@pytest.mark.parametrize("path", ["wind.gamma_deg", "wind.A_LW", "thruster.port.x"])
def test_the_remedy_of_the_message_helps(path: str) -> None:
    ship = load_vessel("gunnerus-28.9")
    value = np.radians(ship.document["wind"]["gamma_deg"]).tolist() if path.endswith("_deg") else 1.2e7
    with pytest.raises(DocumentError) as caught:
        ship.with_values({path: value})
    word = re.search(r'write unusual = \["(.*?)"\]', str(caught.value))
    assert word is not None
    assert ship.with_values({path: value, "unusual": [word[1]]}).document["unusual"] == [word[1]]


def test_every_bundled_vessel_is_usual(bundled_vessel: Vessel) -> None:
    assert "unusual" not in bundled_vessel.document


def test_the_word_is_no_part_of_the_structure() -> None:
    ship = load_vessel("gunnerus-28.9")
    assert ship.with_values({"unusual": ["thruster.*"]}).structure == ship.structure


def test_a_patch_may_mean_it(tmp_path: Path) -> None:
    file = tmp_path / "far.toml"
    file.write_text('base = "gunnerus-28.9"\nunusual = ["thruster.*.x"]\n[set]\n"thruster.port.x" = 1e6\n')
    assert load_vessel(str(file)).parameters["thruster.port.x"] == 1e6
