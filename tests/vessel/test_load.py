from __future__ import annotations

import copy
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipid.document import bundled, leaves, replace
from shipid.errors import DocumentError
from shipid.vessel.bindings import bindings
from shipid.vessel.load import Vessel, _is_positive, check_vessel, load_vessel, sources

UNIT = re.compile(
    r"-|prime|bis|deg|rad(?:/s)?|rev/s(?:\^2)?|(?:(?:kg|m|s|N)(?:\^-?\d+)?)(?: (?:kg|m|s|N)(?:\^-?\d+)?)*"
)


def test_every_parameter_has_a_unit_and_a_value(vessel: Vessel) -> None:
    assert list(vessel.units) == list(vessel.parameters)
    assert [unit for unit in vessel.units.values() if not UNIT.fullmatch(unit)] == []
    assert np.isfinite(list(vessel.parameters.values())).all()


def test_every_number_of_a_switched_on_block_is_a_parameter(bundled_vessel: Vessel) -> None:
    """No number of a bundled vessel is read over: what is no parameter is structure, a particular, or switched off."""
    spare = ("particulars.", "constants.", "dof", "hull.crossflow.strips", "thruster.bow.", "waves.")
    numbers = [path for path, value in leaves(bundled_vessel.document) if type(value) in (int, float)]
    assert [path for path in numbers if path not in bundled_vessel.parameters and not path.startswith(spare)] == []


def test_every_block_names_its_source(bundled_vessel: Vessel) -> None:
    document = bundled_vessel.document
    blocks = [document, *(document[key] for key in ("particulars", "inertia", "added_mass", "wind") if key in document)]
    blocks += [*document["hull"].values(), *document["thruster"].values()]
    assert all(len(block["source"]) > 10 for block in blocks)


def test_set_a_has_its_32_derivatives() -> None:
    """8 X, 12 Y and 12 N, as the method perturbs them."""
    names = list(load_vessel("gunnerus-28.9").document["hull"]["derivatives"])
    names.remove("source")
    assert [sum(name.startswith(axis) for name in names) for axis in "XYN"] == [8, 12, 12]


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


def test_a_number_of_the_block_goes_before_the_shared_one() -> None:
    """33.9 m: T of the cross-flow is in its block; rho comes from [constants]; both are parameters once."""
    vessel = load_vessel("gunnerus-33.9")
    assert "hull.crossflow.T" in vessel.parameters
    assert "particulars.T" not in vessel.parameters
    shared = vessel.with_values({"hull": {"crossflow": _without(vessel.document["hull"]["crossflow"], "T")}})
    assert shared.parameters["particulars.T"] == 2.6
    changed = vessel.with_values({"thruster.port.rho": 1000.0})
    assert (changed.parameters["thruster.port.rho"], changed.parameters["constants.rho"]) == (1000.0, 1025.0)


def _without(block: dict[str, object], key: str) -> dict[str, object]:
    return {name: value for name, value in block.items() if name != key}


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


def test_the_digest_is_that_of_the_document_that_was_checked() -> None:
    """Whoever changes the document afterwards has other numbers beside old parameters; the digest stays with these."""
    document = copy.deepcopy(load_vessel("gunnerus-28.9").document)
    digests = {}
    for _ in range(3):
        vessel = check_vessel(document, "ship.toml")
        document["inertia"]["m"] *= 1.1
        digests[vessel.digest] = vessel.parameters["inertia.m"]
    assert len(digests) == 3


def test_the_digest_changes_with_every_number() -> None:
    base = load_vessel("gunnerus-28.9")
    digests = {base.with_values({path: value * 1.0000001 + 1e-9}).digest for path, value in base.parameters.items()}
    assert len(digests | {base.digest}) == len(base.parameters) + 1


def test_new_values_leave_the_old_vessel_alone() -> None:
    base = load_vessel("gunnerus-28.9")
    assert base.with_values({"inertia.m": 1.0e6}).parameters["inertia.m"] == 1.0e6
    assert base.parameters["inertia.m"] == 410931.81


def test_new_numbers_make_the_vessel_that_a_document_of_them_makes(vessel: Vessel) -> None:
    """The short way, for numbers alone, and the whole check agree."""
    values = {path: value * 1.01 for path, value in vessel.parameters.items() if not path.startswith("wind.gamma")}
    short, whole = vessel.with_values(values), check_vessel(replace(vessel.document, values), vessel.file)
    assert short == whole
    assert (short.parameters, short.units, short.structure) == (whole.parameters, whole.units, whole.structure)


@pytest.mark.parametrize(
    "values",
    [
        {"inertia.m": -1.0},
        {"inertia.m": float("nan")},
        {"inertia.m": 410.9},
        {"added_mass.X_udot": 1.0},
        {"added_mass.Y_rdot": 1e9, "added_mass.N_vdot": 1e9},
        {"wind.gamma_deg.3": 5},
        {"thruster.port.D_p": 0.0},
    ],
)
def test_new_numbers_that_make_no_vessel_are_changed_as_in_a_document(values: dict[str, float]) -> None:
    base = load_vessel("gunnerus-28.9")
    changed = []
    for check in (base.with_values, lambda new: check_vessel(replace(base.document, new), base.file)):
        with pytest.raises(DocumentError) as caught:
            check(values)
        changed.append(str(caught.value))
    assert changed[0] == changed[1]


def test_patches_may_be_stacked(tmp_path: Path) -> None:
    (tmp_path / "lower.toml").write_text('base = "gunnerus-28.9"\n[set]\n"inertia.m" = 4e5\n"inertia.I_z" = 2e7\n')
    (tmp_path / "upper.toml").write_text('base = "./lower.toml"\nname = "upper"\n[set]\n"inertia.m" = 5e5\n')
    vessel = load_vessel(str(tmp_path / "upper.toml"))
    assert (vessel.parameters["inertia.m"], vessel.parameters["inertia.I_z"]) == (5e5, 2e7)
    assert (vessel.name, vessel.key) == ("upper", "upper")


def test_bundled_vessels_are_addressed_by_name_and_by_path() -> None:
    for name, file in bundled("models").items():
        assert load_vessel(name).digest == load_vessel(str(file)).digest
        assert load_vessel(name).key == name


def test_a_switched_off_block_is_still_checked() -> None:
    document = replace(load_vessel("gunnerus-28.9").document, {"thruster.bow.F_1": "much"})
    with pytest.raises(Exception, match=r"thruster\.bow\.F_1"):
        check_vessel(document, "x.toml")


BOW = '[thruster.bow]\nkind = "tunnel"\nx = 3.0\nz = 0.1\nF_1 = 300.0\nF_2 = 5.0\nF_3 = 60.0\n'


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


def test_a_source_is_that_of_the_document_that_wrote_the_block(tmp_path: Path) -> None:
    """A block added above is not given the source of the vessel below, nor one below that of the document above."""
    below = sources(load_vessel("kvlcc2-l7"))
    named, bare, patch = tmp_path / "named.toml", tmp_path / "bare.toml", tmp_path / "patch.toml"
    named.write_text(f'extends = "kvlcc2-l7"\nname = "N"\nsource = "the yard"\n{BOW}\n[hull.mmg]\nY_u = 0.0\n')
    bare.write_text(f'extends = "kvlcc2-l7"\nname = "B"\n{BOW}\n[hull.mmg]\nY_u = 0.0\n')
    patch.write_text('base = "./named.toml"\n[set]\n"hull.mmg.Y_u" = 0.0\n')
    expected = {**below, "thruster.bow": "the yard", "hull.mmg": "the yard"}
    assert sources(load_vessel(str(named))) == expected
    assert sources(load_vessel(str(patch))) == expected
    assert sources(load_vessel(str(bare))) == {**below, "thruster.bow": ""}
    text = named.read_text().replace("x = 3.0", 'x = 3.0\nsource = "a drawing"')
    named.write_text(text)
    assert sources(load_vessel(str(named)))["thruster.bow"] == "a drawing"


def test_every_term_of_a_bundled_vessel_names_its_source(bundled_vessel: Vessel) -> None:
    assert all(len(source) > 10 for source in sources(bundled_vessel).values())


@pytest.mark.parametrize("value", [None, 1e308, -1e30, 10**400, 1e-200])
@pytest.mark.parametrize("path", ["inertia.m", "particulars.L_pp", "constants.rho", "hull.derivatives.N_v"])
def test_a_new_value_that_no_document_may_hold_is_named(path: str, value: object) -> None:
    with pytest.raises(DocumentError) as raised:
        load_vessel("gunnerus-28.9").with_values({path: value})
    assert raised.value.path == path


def test_a_new_value_below_a_number_is_refused() -> None:
    """Before, it was a TypeError of a dict."""
    ship = load_vessel("gunnerus-28.9")
    with pytest.raises(DocumentError, match=r"inertia\.m is no table: nothing can be below it") as raised:
        ship.with_values({"inertia.m.x": 1.0})
    assert (raised.value.path, raised.value.file) == ("inertia.m.x", ship.file)


@pytest.mark.parametrize("name", ["gunnerus-28.9", "kvlcc2-l7", "mariner", "gunnerus-33.9"])
def test_numbers_of_numpy_are_numbers(name: str) -> None:
    """Equations assembled from them first hold every term, and the document is the one of plain numbers."""
    ship = load_vessel(name)
    scale = 1.0 + 2.0**-20  # a structure is compiled once: the equations of NumPy's numbers come first
    numbers = {path: value * scale for path, value in ship.parameters.items() if path.startswith("hull.")}
    changed = ship.with_values({path: np.float64(value) for path, value in numbers.items()})
    assert dict(bindings(changed.document)) == dict(bindings(ship.document))
    assert all(type(value) in (int, float, str, bool) for _, value in leaves(changed.document))
    again = ship.with_values(numbers)
    assert (changed.digest, changed.parameters) == (again.digest, again.parameters)


def test_arrays_are_lists_of_numbers() -> None:
    ship, lists = load_vessel("gunnerus-28.9"), ("w_u", "w_v", "w_r", "w_0", "c_X", "c_Y", "c_N")
    scales = {"u_scale": 5.0, "v_scale": 1.0, "r_scale": 0.1, "X_max": 1e4, "Y_max": 1e4, "N_max": 1e5}
    block = {name: np.float64(value) for name, value in scales.items()} | {name: np.ones(3) for name in lists}
    learned = ship.with_values({"hull.learned": block})
    assert learned.document["hull"]["learned"]["w_u"] == [1.0, 1.0, 1.0]
    assert learned.with_values({"hull.learned.w_u.1": np.float64(2.0)}).parameters["hull.learned.w_u.1"] == 2.0


def test_what_a_vessel_returns_is_free_to_be_changed() -> None:
    """Before, a change of the parameters changed the ship and its rollouts, but not its digest."""
    base = load_vessel("gunnerus-28.9")
    light = base.with_values({"inertia.m": 4e5})
    for ship in (base, light):
        parameters, units, mass = ship.parameters, ship.units, ship.mass
        before = dict(parameters), dict(units), mass.copy()
        parameters["inertia.m"] *= 2
        units["inertia.m"] = "t"
        mass *= 2
        assert (ship.parameters, ship.units) == before[:2]
        np.testing.assert_array_equal(ship.mass, before[2])
    assert base.with_values({"inertia.m": 4e5}) == light


@pytest.mark.parametrize("size", [3, 4, 6])
def test_a_mass_is_positive_where_all_its_eigenvalues_are(size: int) -> None:
    """One by one, and of several members together; the part that is not symmetric does no work."""
    rng = np.random.default_rng(size)
    turns = np.linalg.qr(rng.normal(size=(40, size, size)))[0]
    values = 10 ** rng.uniform(-3, 3, (40, size))
    values[::2, 0] *= -1
    twists = rng.normal(size=(40, size, size))
    masses = turns * values[:, None, :] @ turns.swapaxes(1, 2) + twists - twists.swapaxes(1, 2)
    assert [_is_positive(M.tolist()) for M in masses] == [False, True] * 20
    assert _is_positive(list(masses[1::2].transpose(1, 2, 0)))
    assert not _is_positive(list(masses[:2].transpose(1, 2, 0)))


@pytest.mark.parametrize("values", [None, [("inertia.m", 4e5)], {5: 1.0}, "inertia.m"])
def test_values_are_a_mapping_by_path(values: Any) -> None:
    with pytest.raises(DocumentError, match="values must be a mapping of dotted paths"):
        load_vessel("mariner").with_values(values)


def test_a_folder_may_be_a_text(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('base = "mariner"\nname = "mine"\n', encoding="utf-8")
    for folder in (tmp_path, str(tmp_path)):
        assert load_vessel("mine.toml", relative_to=folder).name == "mine"
