"""What a study declares: names that are one file, members of identified families, observers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import tomlkit

from shipid.errors import DocumentError
from shipid.study.declared import NO_MODEL
from shipid.study.plan import build_plan, fitted_families, read_plan
from shipid.vessel.load import load_vessel
from tests.study.tiny import tiny_plan

FOLDER = Path(__file__).parents[1] / "bad" / "studies"


@pytest.mark.parametrize(
    ("changes", "path", "names"),
    [
        ({"family.right.name": "WRONG-2"}, "family", "'WRONG-2' and 'wrong-2'"),
        ({"method": [{"name": name, "kind": "alone"} for name in ("a", "b", "A")]}, "method.A.name", "'a' and 'A'"),
        ({"condition": [{"name": "Held"}, {"name": "held"}]}, "condition.held.name", "'Held' and 'held'"),
    ],
)
def test_names_that_differ_in_capitals_alone_are_one_file(changes: dict[str, Any], path: str, names: str) -> None:
    """Where a file system does not tell them apart, the cells of one would be those of the other."""
    with pytest.raises(DocumentError, match=f"called {names}, which are one file on many systems") as caught:
        read_plan(FOLDER / "plain.toml", changes)
    assert caught.value.path == path


@pytest.mark.parametrize("integrator", ["euler", "rk4"])
def test_what_is_identified_is_integrated_as_it_predicts(tmp_path: Path, integrator: str) -> None:
    document = tiny_plan(tmp_path).document
    document["prediction"] |= {"integrator": integrator, "step": 0.5}
    document["family"].append({"name": "fit", "extends": "right", "identify": {"parameters": ["inertia.m"]}})
    plan = build_plan(document, tmp_path / "tiny.toml")
    settings = next(one.identify for one in plan.foundations if one.name == "fit")
    assert (settings.method, settings.step, settings.horizon) == (integrator, 0.5, plan.study.prediction.ahead)
    assert settings.current == "none"  # the cell predicts without one


@pytest.mark.parametrize(
    ("kind", "drop", "words"),
    [
        ("learned-force", "particulars", "the vessel has no particulars.L_pp, which scales the learned force: give it"),
        ("modules", "hull", "the vessel has no hull, thruster or rudder whose factor could be learned: give one"),
    ],
)
def test_what_a_method_cannot_work_with_is_said_before_anything_is_computed(
    tmp_path: Path, kind: str, drop: str, words: str
) -> None:
    """A bare KeyError ended the study, or its cells failed, after the truth was made."""
    document = tiny_plan(tmp_path).document
    vessel = dict(load_vessel("gunnerus-28.9").document)
    for key in {drop, *({"thruster", "wind"} if drop == "hull" else {"wind"})}:
        vessel.pop(key, None)
    (tmp_path / "odd.toml").write_text(tomlkit.dumps(vessel))
    document["family"] = [{"name": "odd", "base": "odd.toml"}]
    document["method"] = [{"name": "mine", "kind": kind, "families": ["odd"]}, {"name": "alone", "kind": "alone"}]
    with pytest.raises(DocumentError) as caught:
        build_plan(document, tmp_path / "tiny.toml")
    assert caught.value.message == f"odd with {kind}: {words}"
    assert caught.value.path == "method.mine"


def test_an_observer_measures_no_position_where_velocities_make_the_path(tmp_path: Path) -> None:
    document = tiny_plan(tmp_path).document
    document["family"].append({"name": "seen", "extends": "right", "observer": {}})
    document["method"] = [{"name": "alone", "kind": "alone"}]
    simulated = build_plan(document, tmp_path / "tiny.toml")
    del document["truth"]
    document |= {"data": {"dataset": "log.parquet", "path": "velocity"}, "split": {"test": ["f"]}}
    recorded = build_plan(document, tmp_path / "tiny.toml")
    here, there = (next(one.observer for one in plan.foundations if one.observer) for plan in (simulated, recorded))
    assert {"north", "east"} <= set(here.measured)
    assert set(there.measured) == {"psi", "u", "v", "r"}
    assert here.current != 0.0
    assert there.current == 0.0  # without a position nobody sees one


def test_an_identified_family_on_an_identified_one_has_the_members_of_the_first(tmp_path: Path) -> None:
    block = {"parameters": ["hull.derivatives.N_ur"]}
    families = [
        {"name": "right", "base": "gunnerus-28.9"},
        {"name": "fitted", "extends": "right", "identify": block},
        {"name": "again", "extends": "fitted", "identify": {**block, "horizon": 9.0}},
    ]
    plan = tiny_plan(tmp_path, {"family": families})
    assert [one.name for one in plan.foundations] == ["right", "fitted", "again", NO_MODEL]
    right, fitted, again, _ = plan.foundations
    assert right.variant == fitted.variant == again.variant
    assert fitted_families(plan) == {"fitted", "again"}
    assert (fitted.identify.horizon, again.identify.horizon) == (5.0, 9.0)


def test_similar_ships_are_the_members_of_a_family(tmp_path: Path) -> None:
    """Each is the same to the bit whatever else is declared, and a stored study needs no folder of ships."""
    document = tiny_plan(tmp_path).document
    folder = tmp_path / "fleet"
    folder.mkdir()
    ship = load_vessel("gunnerus-33.9").document
    (folder / "long.toml").write_text(tomlkit.dumps(ship | {"particulars": ship["particulars"] | {"B": 8.0}}))
    near = {"name": "near", "base": "gunnerus-28.9", "similar": 3, "ships": "fleet"}
    fit = {"name": "fit", "extends": "near", "identify": {"parameters": ["inertia.m"]}}
    document["family"] = [*document["family"], near, fit]
    plan = build_plan(document, tmp_path / "tiny.toml")
    of = {one.name: one for one in plan.foundations}
    assert {f"near-{place}" for place in (1, 2, 3)} | {f"fit-{place}" for place in (1, 2, 3)} < of.keys()
    sizes = [of[f"near-{place}"].vessel for place in (1, 2, 3)]
    assert all(one is not None and one.length == pytest.approx(28.9) for one in sizes)
    assert "long" in {one.key for one in sizes if one is not None}
    document["family"] = [near | {"name": "alone"}]
    other = {one.name: one for one in build_plan(document, tmp_path / "tiny.toml").foundations}
    for place, one in enumerate(sizes, start=1):
        again = other[f"alone-{place}"].vessel
        assert again.digest == one.digest
    (folder / "long.toml").unlink()
    assert build_plan(plan.document, tmp_path / "tiny.toml", vessels=plan.vessels).digest == plan.digest


@pytest.mark.parametrize(
    ("block", "path", "words"),
    [
        ({"base": "gunnerus-28.9", "similar": 60}, "family.near.similar", "ships can be scaled: ask for fewer"),
        ({"base": "gunnerus-28.9", "similar": 1, "ships": "none"}, "family.near.similar", "no vessel in the TOML"),
        ({"predictions": "a.parquet", "similar": 1}, "family.near.similar", "needs a `base`"),
        ({"base": "gunnerus-28.9", "similar": 0}, "family.near.similar", "0: must be at least 1"),
    ],
)
def test_similar_ships_that_are_not_there_are_one_line(
    tmp_path: Path, block: dict[str, Any], path: str, words: str
) -> None:
    document = tiny_plan(tmp_path).document
    document["family"].append({"name": "near", **block})
    with pytest.raises(DocumentError, match=words) as caught:
        build_plan(document, tmp_path / "tiny.toml")
    assert caught.value.path == path
