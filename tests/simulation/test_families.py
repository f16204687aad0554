from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import qmc

import shipid
from shipid.document import digest_document
from shipid.errors import DataError, DocumentError, ShipidError
from shipid.simulation.families import VesselFamily, compare_contents
from shipid.study.plan import read_plan
from shipid.vessel.perturb import Family, Perturbation, draw_members

HULL = {"parameters": ["hull.derivatives.*"], "factor": [0.4, 1.6]}
MASS = {"parameters": ["inertia.m", "added_mass.X_udot"], "factor": [0.8, 1.2], "together": True}
SAMPLES = ("independent", "latin-hypercube", "sobol")
DOCUMENT = """
vessel = "gunnerus-28.9"
[[family]]
name = "low"
members = 9
seed = 4
[[family.perturb]]
parameters = ["hull.derivatives.*"]
factor = [0.4, 1.6]
[[family]]
name = "high"
extends = "low"
members = 5
sample = "sobol"
[[family.perturb]]
parameters = ["inertia.m"]
bias = [-1e4, 1e4]
"""


def family(*perturb: dict[str, Any], **more: Any) -> VesselFamily:
    given = {"name": "f", "base": "gunnerus-28.9", "members": 8, "seed": 3, "perturb": list(perturb)}
    return VesselFamily(Family(**given | more), shipid.load_vessel("gunnerus-28.9"))


@pytest.fixture
def document(tmp_path: Path) -> Path:
    file = tmp_path / "families.toml"
    file.write_text(DOCUMENT)
    return file


@pytest.mark.parametrize("sample", SAMPLES)
def test_a_member_is_the_same_in_any_process_and_order(sample: str) -> None:
    """Law: digests are equal in another process, drawn backwards, one at a time, and with other blocks after."""
    here = family(HULL, MASS, sample=sample)
    code = (
        "from tests.simulation.test_families import *\n"
        f"print([digest_document(one.values) for one in family(HULL, MASS, sample={sample!r}).members])"
    )
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600, check=True)
    assert other.stdout.strip() == str([digest_document(one.values) for one in here.members])
    for number in range(7, -1, -1):
        assert draw_members(here.rules, here.base, numbers=[number])[0] == here.members[number]
    longer = family(HULL, MASS, {"parameters": ["inertia.I_z"], "bias": [-1e5, 1e5]}, sample=sample)
    for one, more in zip(here.members, longer.members, strict=True):
        assert one.values.items() < more.values.items()


@pytest.mark.parametrize("sample", ["independent", "sobol"])
def test_more_members_change_none(sample: str) -> None:
    few, many = family(HULL, sample=sample), family(HULL, sample=sample, members=21)
    assert [one.values for one in few.members] == [one.values for one in many.members[:8]]
    assert few.draw(4).table().ne(few.table()).all(axis=None)


def test_designed_samples_fill_the_ranges() -> None:
    """A Latin hypercube has one member in each eighth of every range; both designs fill the cube more evenly."""
    drawn = {s: family(HULL, sample=s, members=64).table().xs("factor", axis=1, level=1) for s in SAMPLES}
    units = {sample: (table.to_numpy()[:, :4] - 0.4) / 1.2 for sample, table in drawn.items()}
    assert (np.sort(np.floor(64 * units["latin-hypercube"]), axis=0) == np.arange(64)[:, None]).all()
    discrepancy = {sample: qmc.discrepancy(points) for sample, points in units.items()}
    assert discrepancy["sobol"] < discrepancy["latin-hypercube"] < discrepancy["independent"]
    with pytest.raises(DocumentError, match="no member 8: a sobol sample has 8"):
        draw_members(family(HULL, sample="sobol").rules, shipid.load_vessel("gunnerus-28.9"), numbers=[8])


@pytest.mark.parametrize(
    ("rule", "low", "high"),
    [({"range": [-3e4, -2e4]}, -3e4, -2e4), ({"bias": [-1e3, 1e3]}, None, None), ({"bias": 500.0}, None, None)],
)
def test_ranges_and_biases_keep_their_bounds(rule: dict[str, Any], low: float | None, high: float | None) -> None:
    path = "hull.derivatives.Y_uv"
    drawn = family({"parameters": [path], **rule}, members=50)
    values, base = drawn.table()[path, "value"], drawn.base.parameters[path]
    bias = np.broadcast_to(rule.get("bias", 0.0), 2)
    assert values.between(low or base + bias[0], high or base + bias[1]).all()
    assert values.nunique() == (1 if rule == {"bias": 500.0} else 50)


def test_structure_changes_every_member_and_its_patch(tmp_path: Path) -> None:
    file = tmp_path / "calm.toml"
    file.write_text(DOCUMENT.replace('name = "low"', 'name = "low"\nstructure = {"wind.off" = true}'))
    calm = shipid.read_family(file, "high")
    assert not any(path.startswith("wind") for path in calm.base.parameters)
    calm.export(tmp_path / "out")
    again = shipid.load_vessel(tmp_path / "out" / "high-2.toml")
    assert list(again.parameters.values()) == calm.members[1].parameters
    assert again.structure == calm.base.structure
    file.write_text(file.read_text().replace("wind.off", "wind.of"))
    with pytest.raises(DocumentError, match=r"family\.low\.structure: wind\.of"):
        shipid.read_families(file)


def test_what_is_likely_a_mistake_is_refused_with_the_word_that_allows_it(document: Path) -> None:
    block = {"parameters": ["inertia.m"], "factor": (-0.3, 0.3)}
    with pytest.raises(DocumentError, match=r"\+-30 % is \[0.7, 1.3\]; change_sign = true"):
        Perturbation(**block)
    assert Perturbation(**block, change_sign=True).drawn
    document.write_text(DOCUMENT.replace("[0.4, 1.6]", "0.4"))
    with pytest.raises(DocumentError, match=r"the 9 members are equal: .* equal = true allows it"):
        shipid.read_families(document)


def test_a_table_has_a_row_a_member_and_two_columns_a_path() -> None:
    drawn = family(HULL, {"set": {"inertia.x_G": 1.0}})
    table = drawn.table()
    assert table.shape == (8, 2 * 33)
    for number, one in enumerate(drawn.members):
        assert table.xs("value", axis=1, level=1).iloc[number].to_dict() == one.values
        assert table.xs("factor", axis=1, level=1).iloc[number].dropna().to_dict() == one.factors


@pytest.mark.parametrize(("name", "angles"), [("zigzag", (10, 10)), ("turning", 20)])
def test_trajectories_are_those_of_the_manoeuvre(name: str, angles: Any) -> None:
    """Law: the base in a family is the base alone; a member is the same in any family; one rollout holds all."""
    alike = {"parameters": ["inertia.m"], "factor": [1.0, 1.0]}
    alone = shipid.measure_standard(family(alike).base, name, angles, approach="helmsman").frame
    path = family(alike, members=2).trajectories(name, angles)
    for channel in ("north", "east", "psi", "u", "v", "r"):
        np.testing.assert_allclose(path[channel][:, 1, 0], alone[channel].to_numpy(), atol=1e-8)
    many, few = family(HULL, members=6), family(HULL, members=3)
    np.testing.assert_allclose(
        many.trajectories(name, angles).states[:, :3], few.trajectories(name, angles).states, atol=1e-8
    )
    orders = {"port.n": 2.0, "starboard.n": 2.0, "port.alpha": 0.1, "starboard.alpha": 0.1}
    motion = few.rollout({"u": 2.0}, orders)
    alone_too = VesselFamily(Family(name="one"), few.base.with_values(few.members[2].values)).rollout(
        {"u": 2.0}, orders
    )
    np.testing.assert_allclose(motion.states[:, 2], alone_too.states[:, 0], atol=1e-9)


def test_a_lock_is_verified_and_says_what_is_another(document: Path, tmp_path: Path) -> None:
    """Law: whatever is changed in a lock, one line names it."""
    document.write_text(DOCUMENT.replace("[0.4, 1.6]", "[-40.0, 40.0]\nchange_sign = true"))
    lock = shipid.read_family(document, "high").export(tmp_path / "out")
    assert len(shipid.verify_lock(lock)) == 16
    assert not compare_contents(*(shipid.read_family(file, "high").content() for file in (document, lock)))
    text = lock.read_text()
    for old, new, path in (
        (r"bias = \[-10000.0", "bias = [-9000.0", "rules"),
        (r'"inertia.m" = \[', '"inertia.m" = [1.0, ', r"m\.0"),
        ('trial = "zigzag', 'trial = "turning', "trial turning"),
        (r"(diverges_at_s\]\n\S+ = )\S+", r"\g<1>0.5", r"diverges_at_s\.high-\d 0\.5 in the file"),
        ("\nbase = ", "\nbase = '0' # ", "base 0 in the file"),
        ("\ndigest = ", "\ndigest = '0' # ", "digest 0 in the file"),
    ):
        lock.write_text(re.sub(old, new, text, count=1))
        assert lock.read_text() != text
        with pytest.raises(ShipidError, match=f"not as locked: .*{path}"):
            shipid.verify_lock(lock)
    with pytest.raises(DocumentError, match=r"holds no \[lock\]"):
        shipid.verify_lock(document)


@pytest.mark.parametrize(
    ("key", "one", "other"),
    [
        ("identify", {"parameters": ["inertia.m"]}, {"parameters": ["inertia.I_z"]}),
        ("observer", {"disturbance_time": 30.0}, {"disturbance_time": 60.0}),
        ("seen", ["trial-1"], ["trial-2"]),
    ],
)
def test_a_lock_holds_all_that_a_family_does(key: str, one: Any, other: Any, tmp_path: Path) -> None:
    """Law: two families that differ in a key alone have other digests and contents; a lock is read as it was."""
    plain, first, second = (family(members=1, **more) for more in ({}, {key: one}, {key: other}))
    assert len({drawn.lock()["digest"] for drawn in (plain, first, second)}) == 3
    assert all(path.startswith(f"rules.{key}") for path in compare_contents(first.content(), second.content()))
    lock = first.export(tmp_path / "out")
    assert shipid.read_family(lock).content() == first.content()
    assert shipid.verify_lock(lock) == first.lock()["digest"]


def test_a_patch_beside_a_lock_is_verified_with_it(document: Path, tmp_path: Path) -> None:
    """A number or the digest of a base that somebody changed is named; a patch that was taken away is not missed."""
    lock = shipid.read_family(document, "high").export(tmp_path / "out")
    patch = lock.with_name("high-3.toml")
    text, again = patch.read_text(), shipid.load_vessel(patch).parameters["inertia.m"]
    for old, new, path in (
        (f'"inertia.m" = {again!r}', '"inertia.m" = 4e5', r"set\.inertia\.m 400000\.0 in the file"),
        ('base_digest = "', 'base_digest = "0', "base_digest"),
    ):
        patch.write_text(text.replace(old, new))
        with pytest.raises(ShipidError, match=rf"1 entry is not as locked: high-3\.toml\.{path}"):
            shipid.verify_lock(lock)
    patch.unlink()
    assert len(shipid.verify_lock(lock)) == 16


@pytest.mark.parametrize("taken", ["low.lock.toml", "low-1.toml", "low-9.toml"])
def test_an_export_writes_over_nothing(document: Path, tmp_path: Path, taken: str) -> None:
    """Law: whichever file of the set exists, it is named, it stays as it is, and no other is written."""
    place = tmp_path / "out" / taken
    place.parent.mkdir()
    place.write_text("mine")
    with pytest.raises(DataError, match=f"{taken}.*not written over: name another folder"):
        shipid.read_family(document, "low").export(place.parent)
    assert [file.read_text() for file in place.parent.iterdir()] == ["mine"]


def test_a_family_called_as_its_own_document_replaces_it_not(document: Path) -> None:
    document.write_text(DOCUMENT.partition("[[family]]")[0] + '[[family]]\nname = "families"\n')
    with pytest.raises(DataError, match=r"families\.toml.*not written over"):
        shipid.read_family(document).export(document.parent)
    assert shipid.read_family(document).rules.name == "families"


def test_a_member_that_diverges_is_locked_with_its_time() -> None:
    wild = family({"parameters": ["hull.derivatives.*"], "factor": [-40.0, 40.0], "change_sign": True}, members=6)
    path = wild.trajectories("zigzag", 20)
    times = wild.lock()["diverges_at_s"]
    assert len(times) == path.diverged.sum() > 0
    assert all(0 < time < path.interval * len(path.states) for time in times.values())
    lost = wild.motion_table(path).groupby("member")["u"].apply(lambda u: u.isna().all())
    assert set(lost.index[lost]) == set(times)


def test_a_study_takes_families_by_path_and_by_name(document: Path, tmp_path: Path) -> None:
    """The study of blocks and that of the document are one: their digests, so their results, are equal."""
    head = Path(read_plan("quick").file).read_text().partition("[[family]]")[0]
    study, written = tmp_path / "study.toml", tmp_path / "written.toml"
    study.write_text(f'families = "families.toml"\n{head}')
    low = 'name = "low"\nbase = "gunnerus-28.9"'
    written.write_text(head + DOCUMENT.replace('vessel = "gunnerus-28.9"', "").replace('name = "low"', low))
    one, two = read_plan(study), read_plan(written)
    assert one.digest == two.digest
    values = [f.variant.values for f in one.foundations if f.variant]
    assert values == [m.values for name in ("low", "high") for m in shipid.read_family(document, name).members]


def test_a_fault_of_a_rule_is_named_with_its_document(tmp_path: Path) -> None:
    file = tmp_path / "own.toml"
    file.write_text(
        'vessel = "mariner"\n[[family]]\nname = "own"\n[[family.perturb]]\nparameters = ["x.y"]\nfactor = [0.5, 1.5]\n'
    )
    own = shipid.read_family(file)
    with pytest.raises(DocumentError, match=r"own\.toml: family\.own\.perturb\.\d\.parameters: 'x\.y' selects nothing"):
        own.table()
