"""Numbers that no ship has are refused with the range; the word `unusual` overrides it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.vessel.load import load_vessel
from shipid.vessel.template import Particulars, first_guess

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


@pytest.mark.parametrize("path", ["wind.A_LW", "thruster.port.x"])
def test_the_remedy_of_the_message_helps(path: str) -> None:
    ship = load_vessel("gunnerus-28.9")
    with pytest.raises(DocumentError) as caught:
        ship.with_values({path: 1.2e7})
    word = re.search(r'write unusual = \["(.*?)"\]', str(caught.value))
    assert ship.with_values({path: 1.2e7, "unusual": [word[1]]}).document["unusual"] == [word[1]]


CONTRADICTIONS: dict[str, tuple[str, float, str]] = {
    "rudder at the bow": ("thruster.rudder.x", 3.5, "thruster.rudder.x_H"),
    "rudder ahead of the screw": ("thruster.rudder.x", -1.0, "thruster.rudder.x"),
    "force on the hull at the other end": ("thruster.rudder.x_H", 3.0, "thruster.rudder.x_H"),
    "deg/s for rad/s": ("thruster.rudder.actuator.delta.rate", 15.8, "thruster.rudder.actuator.delta.rate"),
    "as broad as long": ("particulars.B", 7.0, "particulars.B"),
    "beam and draught exchanged": ("particulars.T", 1.3, "particulars.T"),
    "per cent of a block": ("particulars.C_b", 80.0, "particulars.C_b"),
    "flow of the other end": ("thruster.rudder.ell_R", 4.97, "thruster.rudder.ell_R"),
    "per cent of a wake": ("thruster.propeller.w_P0", 40.0, "thruster.propeller.w_P0"),
    "thrust that the hull takes whole": ("thruster.propeller.t_P", 1.2, "thruster.propeller.t_P"),
    "no range of advance ratios": ("thruster.propeller.J_max", -1.0, "thruster.propeller.J_max"),
}
"""What is wrong -> the number, its value, and the number that the message names."""


def test_a_wind_table_in_radians_is_seen() -> None:
    ship = load_vessel("gunnerus-28.9")
    radians = np.radians(ship.document["wind"]["gamma_deg"]).tolist()
    with pytest.raises(DocumentError, match="are these radians"):
        ship.with_values({"wind.gamma_deg": radians})
    assert ship.with_values({"wind.gamma_deg": radians, "unusual": ["wind.gamma_deg"]})


def test_a_lag_of_many_ship_lengths_is_seen(tmp_path: Path) -> None:
    change = "[thruster.rudder.actuator.delta]\nT = 1000.0\n"
    (tmp_path / "ship.toml").write_text(f'extends = "container-175"\n{change}')
    with pytest.raises(DocumentError, match=r"expected at most .* s, 100 sqrt\(L / g\)"):
        load_vessel(tmp_path / "ship.toml")


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_what_contradicts_itself_is_refused_and_may_be_meant(name: str, tmp_path: Path) -> None:
    """In a document and in a patch on one that is sound."""
    path, value, fault = CONTRADICTIONS[name]
    block, _, key = path.rpartition(".")
    change = f'extends = "kvlcc2-l7"\n[{block}]\n{key} = {value}\n'
    (tmp_path / "ship.toml").write_text(change)
    with pytest.raises(DocumentError) as caught:
        load_vessel(tmp_path / "ship.toml")
    assert caught.value.path == fault
    assert "unusual = [" in caught.value.message
    (tmp_path / "ship.toml").write_text('unusual = ["particulars.*", "thruster.*"]\n' + change)
    load_vessel(tmp_path / "ship.toml")
    if path in load_vessel("kvlcc2-l7").parameters:
        (tmp_path / "patch.toml").write_text(f'base = "kvlcc2-l7"\n[set]\n"{path}" = {value}\n')
        with pytest.raises(DocumentError, match="unusual = "):
            load_vessel(tmp_path / "patch.toml")


OF_GUNNERUS: dict[str, tuple[str, str, str]] = {
    "unit on the other side": ("[thruster.port]\ny = 2.7", "thruster.port.y", "the name says port"),
}
"""What is wrong -> what is laid on R/V Gunnerus, the number that the message names, and what it says."""


@pytest.mark.parametrize("name", OF_GUNNERUS)
def test_sides_are_refused_and_may_be_meant(name: str, tmp_path: Path) -> None:
    change, fault, words = OF_GUNNERUS[name]
    file = tmp_path / "ship.toml"
    file.write_text(f'extends = "gunnerus-28.9-6dof"\n{change}\n')
    with pytest.raises(DocumentError, match=words) as caught:
        load_vessel(file)
    assert caught.value.path == fault
    file.write_text(f'extends = "gunnerus-28.9-6dof"\nunusual = ["{fault}"]\n{change}\n')
    load_vessel(file)


def test_a_rudder_behind_the_screw_of_the_other_side_is_refused(tmp_path: Path) -> None:
    twin = first_guess(Particulars(60.0, 12.0, 3.5, 0.6, shafts=2), "twin", "twin.toml").text
    (tmp_path / "twin.toml").write_text(twin)
    load_vessel(tmp_path / "twin.toml")
    swapped = re.sub(r'behind = "(port|starboard)"', 'behind = "port"', twin)
    assert swapped != twin
    (tmp_path / "twin.toml").write_text(swapped)
    with pytest.raises(DocumentError, match=r"starboard_rudder.behind: 'port' at y = .* is on the other side"):
        load_vessel(tmp_path / "twin.toml")
