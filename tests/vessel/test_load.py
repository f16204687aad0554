from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from shipid.document import replace_values
from shipid.errors import DocumentError
from shipid.vessel.load import Vessel, check_document, load_vessel

UNIT = re.compile(
    r"-|prime|bis|deg|rad(?:/s)?|rev/s(?:\^2)?|(?:(?:kg|m|s|N)(?:\^-?\d+)?)(?: (?:kg|m|s|N)(?:\^-?\d+)?)*"
)


def test_every_parameter_has_a_unit_and_a_value(vessel: Vessel) -> None:
    assert list(vessel.units) == list(vessel.parameters)
    assert [unit for unit in vessel.units.values() if not UNIT.fullmatch(unit)] == []
    assert np.isfinite(list(vessel.parameters.values())).all()


def test_units_follow_from_names() -> None:
    units = load_vessel("gunnerus-28.9").units
    assert units["inertia.m"] == "kg"
    assert units["hull.derivatives.N_rrr"] == "kg m^2 s"
    assert units["added_mass.N_vdot"] == "kg m"
    assert units["thruster.port.D_p"] == "m"
    assert units["wind.gamma_deg.3"] == "deg"
    assert units["constants.rho"] == "kg m^-3"
    supply = load_vessel("supply-vessel")
    assert supply.units["hull.bis_derivatives.Y_v"] == "bis"  # it was called prime, which is another system


def test_structure_is_what_compiles() -> None:
    base = load_vessel("gunnerus-28.9")
    numbers = {path: value * 1.1 + 0.1 for path, value in base.parameters.items() if "gamma_deg" not in path}
    same = [base.with_values(numbers), base.with_values({"name": "other", "inertia.source": "other", "inertia.m": 1e6})]
    assert {vessel.structure for vessel in same} == {base.structure}
    other = [
        {"wind.off": True},
        {"thruster.bow.off": False},
        {"current.kind": "uniform"},
        {"hull.derivatives.Y_v": 0.0},
        {"thruster.port.K_x.JJJJ": 0.0},
    ]
    structures = {base.with_values(values).structure for values in other}
    assert len(structures | {base.structure}) == len(other) + 1
    crossflow = load_vessel("gunnerus-33.9")
    assert crossflow.with_values({"hull.crossflow.strips": 16}).structure != crossflow.structure


def test_new_numbers_make_the_vessel_that_a_document_of_them_makes(vessel: Vessel) -> None:
    """The short way, for numbers alone, and the whole check agree."""
    values = {path: value * 1.01 for path, value in vessel.parameters.items() if not path.startswith("wind.gamma")}
    short, whole = vessel.with_values(values), check_document(replace_values(vessel.document, values), vessel.file)
    assert short == whole
    assert (short.parameters, short.units, short.structure) == (whole.parameters, whole.units, whole.structure)


def test_what_must_be_above_0_is_refused_at_0_in_a_copy_as_in_a_document() -> None:
    vessel = load_vessel("gunnerus-28.9")
    assert {"inertia.m", "constants.rho", "thruster.port.D_p"} <= vessel.above_zero
    assert vessel.above_zero.isdisjoint({"hull.derivatives.Y_v", "thruster.port.y"})
    for path in vessel.above_zero:
        with pytest.raises(DocumentError, match=re.escape(path)):
            vessel.with_values({path: 0.0})


def test_patches_may_be_stacked(tmp_path: Path) -> None:
    (tmp_path / "lower.toml").write_text('base = "gunnerus-28.9"\n[set]\n"inertia.m" = 4e5\n"inertia.I_z" = 2e7\n')
    (tmp_path / "upper.toml").write_text('base = "./lower.toml"\nname = "upper"\n[set]\n"inertia.m" = 5e5\n')
    vessel = load_vessel(str(tmp_path / "upper.toml"))
    assert (vessel.parameters["inertia.m"], vessel.parameters["inertia.I_z"]) == (5e5, 2e7)
    assert (vessel.name, vessel.key) == ("upper", "upper")


def test_a_long_chain_of_documents_is_one_line(tmp_path: Path) -> None:
    for number in range(30):
        base = f"./{number + 1}.toml" if number < 29 else "gunnerus-28.9"
        (tmp_path / f"{number}.toml").write_text(f'name = "x"\nextends = "{base}"\n')
    with pytest.raises(DocumentError, match="a chain of more than 20 documents: write the vessel out"):
        load_vessel(str(tmp_path / "0.toml"))
    assert load_vessel(str(tmp_path / "15.toml")).name == "x"


def test_a_block_of_another_kind_is_replaced_whole(tmp_path: Path) -> None:
    """What stayed of the other kind was refused as an unknown key that the file does not have: a wind has one block."""
    windy, geared = tmp_path / "windy.toml", tmp_path / "geared.toml"
    shape = 'kind = "blendermann"\nC_Dt = 0.85\nC_Dl_bow = 0.55\nC_Dl_stern = 0.65\ndelta = 0.6\nkappa = 1.4\n'
    sizes = "s_L = 0.5\ns_H = 2.5\nA_FW = 90.0\nA_LW = 190.0\nL_oa = 34.0\n"
    windy.write_text(f'extends = "gunnerus-28.9"\n[wind]\n{shape}{sizes}')
    assert load_vessel(windy).document["wind"] == tomllib.loads(shape + sizes)
    geared.write_text('extends = "kvlcc2-l7"\n[thruster.rudder.actuator.delta]\nkind = "rate_limit"\nrate = 0.3\n')
    below, above = (load_vessel(one).document["thruster"]["rudder"] for one in ("kvlcc2-l7", geared))
    assert above == {**below, "actuator": {"delta": {"kind": "rate_limit", "rate": 0.3}}}


@pytest.mark.parametrize(
    ("vessel", "path", "value", "remedy"),
    [
        ("gunnerus-28.9", "added_mass.X_udot", 79320.0, "X_udot is negative"),
        ("gunnerus-28.9", "added_mass.N_rdot", 1.0, "N_rdot is negative"),
        ("gunnerus-33.9", "hull.crossflow.x_fwd", -16.0, "ahead of x_aft"),
        ("mariner", "inertia.m", 1.4e6, "is the unit kg"),
        ("mariner", "inertia.m", 6.8e7, "is the unit kg"),
        ("kvlcc2-l7", "thruster.rudder.actuator.delta.high", 35.0, "in rad"),
        ("kvlcc2-l7", "thruster.rudder.actuator.delta.low", -35.0, "in rad"),
    ],
)
def test_nonsense_is_refused(vessel: str, path: str, value: float, remedy: str) -> None:
    with pytest.raises(DocumentError, match=remedy) as caught:
        load_vessel(vessel).with_values({path: value})
    assert caught.value.path == path


def test_coupling_terms_of_added_mass_may_have_either_sign(bundled_vessel: Vessel) -> None:
    assert bundled_vessel.with_values({"added_mass.Y_rdot": 1.0, "added_mass.N_vdot": -1.0})


def test_limits_of_an_actuator_leave_a_range() -> None:
    limits = {"thruster.rudder.actuator.delta": {"kind": "rate_limit", "rate": 0.04, "low": 0.6, "high": -0.6}}
    with pytest.raises(DocumentError, match="above low") as caught:
        load_vessel("kvlcc2-l7").with_values(limits)
    assert caught.value.path == "thruster.rudder.actuator.delta.high"


@pytest.mark.parametrize(
    ("beta", "thrust"),
    [([0.0, 90.0, 180.0], [0.5, -0.6, -0.3]), ([-180.0, 20.0, 180.0], [-0.4, 0.5, -0.3])],
)
def test_a_screw_in_four_quadrants_has_the_whole_circle(beta: list[float], thrust: list[float]) -> None:
    block = {"kind": "four_quadrant", "x": -3.4, "D_p": 0.2, "beta_deg": beta, "C_T": thrust}
    with pytest.raises(DocumentError, match="from -180 to 180"):
        load_vessel("kvlcc2-l7").with_values({"thruster.propeller": block})
