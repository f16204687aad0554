from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.physics.grammar import hull_derivative
from shipid.vessel.load import Vessel, load_vessel
from shipid.vessel.perturb import (
    Family,
    Perturbation,
    Variant,
    draw_members,
    draw_variant,
    resolve_families,
    uniform_draw,
)

HULL = {"parameters": ["hull.derivatives.*"], "factor": (0.4, 1.6)}
MASS = {"parameters": ["inertia.m"], "factor": (0.6, 1.4)}
PROPELLERS = {
    "parameters": ["thruster.port.D_p", "thruster.starboard.D_p"],
    "factor": (0.6, 1.4),
    "together": True,
}


@pytest.fixture(scope="module")
def base() -> Vessel:
    return load_vessel("gunnerus-28.9")


def family(*perturb: dict[str, Any], **more: Any) -> Family:
    given = {"name": "high", "base": "gunnerus-28.9", "members": 8, "seed": 2, "perturb": list(perturb)}
    return Family(**{**given, **more})


HIGH = family(HULL, MASS, PROPELLERS)


def test_draws_are_pinned_to_the_bit(base: Vessel) -> None:
    """Studies are repeated years later on other machines: these three may never change."""
    assert draw_variant(HIGH, 0, base).values["hull.derivatives.Y_uv"] == float.fromhex("-0x1.b61404608a1acp+14")
    assert draw_variant(HIGH, 3, base).values["inertia.m"] == float.fromhex("0x1.ab6a56474a5bbp+18")
    assert draw_variant(HIGH, 7, base).values["thruster.port.D_p"] == float.fromhex("0x1.0760ee106f0c7p+1")


def test_more_paths_change_no_other_draw(base: Vessel) -> None:
    one = draw_variant(family({**MASS, "parameters": ["inertia.m"]}), 4, base)
    two = draw_variant(family({**MASS, "parameters": ["inertia.*", "added_mass.X_udot"]}), 4, base)
    assert two.values["inertia.m"] == one.values["inertia.m"]
    assert len(two.values) > len(one.values)
    longer = draw_variant(family({**PROPELLERS, "parameters": [*PROPELLERS["parameters"], "thruster.*.k_T"]}), 4, base)
    assert longer.factors["thruster.port.k_T"] == draw_variant(HIGH, 4, base).factors["thruster.port.D_p"]


@pytest.mark.parametrize("change", [{"seed": 3}, {"name": "other"}])
def test_seed_and_name_make_other_draws(base: Vessel, change: dict[str, Any]) -> None:
    assert draw_variant(family(HULL, **change), 0, base).values != draw_variant(family(HULL), 0, base).values


def test_members_differ_and_each_parameter_has_a_separate_draw(base: Vessel) -> None:
    drawn = draw_members(family(HULL), base)
    assert len({variant.values["hull.derivatives.Y_uv"] for variant in drawn}) == 8
    assert len(set(drawn[0].factors.values())) == 32


def test_uniform_is_uniform() -> None:
    """Kolmogorov-Smirnov distance of 4,000 draws below its 0.1 % limit; neighbours are not correlated."""
    drawn = np.array([uniform_draw(2, "high", member, "inertia.m", 0, 0) for member in range(4000)])
    assert drawn.min() >= 0
    assert drawn.max() < 1
    steps = np.arange(4000) / 4000
    assert np.abs(np.sort(drawn) - steps).max() < 1.95 / np.sqrt(4000)
    assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 0.06


def test_keys_of_a_draw_do_not_run_together() -> None:
    assert uniform_draw("a", "bc") != uniform_draw("ab", "c")
    assert uniform_draw(1, 23) != uniform_draw(12, 3)


def test_together_is_one_factor(base: Vessel) -> None:
    for variant in draw_members(HIGH, base):
        assert variant.values["thruster.port.D_p"] == variant.values["thruster.starboard.D_p"] != 1.9


def test_a_path_drawn_twice_multiplies_two_draws(base: Vessel) -> None:
    once, twice = draw_variant(family(MASS), 0, base), draw_variant(family(MASS, MASS), 0, base)
    second = twice.factors["inertia.m"] / once.factors["inertia.m"]
    assert 0.6 <= second <= 1.4
    assert second != pytest.approx(once.factors["inertia.m"])


@pytest.mark.parametrize(
    ("condition", "count"), [(">= 3", 15), ("<=2", 17), ("== 3", 15), ("> 3", 0), ("< 3", 17), (">=2", 32)]
)
def test_selection_by_order(base: Vessel, condition: str, count: int) -> None:
    block = {"remove": [f"hull.derivatives.*[order {condition}]"]}
    if count:
        assert len(draw_variant(family(block), 0, base).values) == count
        return
    with pytest.raises(DocumentError, match="selects nothing"):
        draw_variant(family(block), 0, base)


def rebuilt(variant: Variant, folder: Path) -> Vessel:
    file = folder / f"{variant.name}.toml"
    file.write_text(variant.document())
    return load_vessel(str(file))


def test_the_patch_document_rebuilds_the_variant_exactly(base: Vessel, tmp_path: Path) -> None:
    for variant in draw_members(HIGH, base):
        vessel = rebuilt(variant, tmp_path)
        assert list(vessel.parameters.values()) == variant.parameters
        assert list(vessel.parameters) == list(base.parameters)
        assert vessel.structure == base.structure
        assert (vessel.name, vessel.key) == (variant.name, variant.name)


def test_a_pattern_that_selects_nothing_is_refused(base: Vessel) -> None:
    with pytest.raises(DocumentError, match="selects nothing") as caught:
        draw_variant(family({"parameters": ["inertia.mass"], "factor": 1.1}), 0, base, file="study.toml")
    assert "'inertia.m'" in str(caught.value)
    assert str(caught.value).startswith("study.toml: ")


def test_setting_an_unknown_path_is_refused(base: Vessel) -> None:
    with pytest.raises(DocumentError, match=r"no parameter 'inertia.M': did you mean 'inertia.m'"):
        draw_variant(family({"set": {"inertia.M": 1.0}}), 0, base)


@pytest.mark.parametrize("block", [{"set": {"wind.off": 1.0}}, {"remove": ["wind.*"]}])
def test_who_would_leave_out_a_term_reads_how(base: Vessel, block: dict[str, Any]) -> None:
    with pytest.raises(DocumentError, match=r'structure = {"wind.off" = true} of the family'):
        draw_variant(family(block), 0, base)


def test_a_complaint_counts_the_blocks_that_the_family_has_in_the_document(base: Vessel) -> None:
    wrong = {"set": {"inertia.M": 1.0}}
    for parent, child, path in (
        ([HULL, MASS], [PROPELLERS, wrong], "family.high.perturb.1.set"),
        ([HULL, wrong], [MASS], "family.high.extends.perturb.1.set"),
    ):
        low = family(*parent, name="low")
        high = resolve_families([low, family(*child, base=None, extends="low")])[1]
        with pytest.raises(DocumentError) as caught:
            draw_variant(high, 0, base)
        assert caught.value.path == path


def test_what_was_0_has_no_factor(base: Vessel) -> None:
    variant = draw_variant(family({"set": {"inertia.x_G": 2.5}}, MASS), 0, base)
    assert variant.values["inertia.x_G"] == 2.5
    assert set(variant.factors) == {"inertia.m"}


@pytest.mark.parametrize("block", [{"remove": ["inertia.m"]}, {"parameters": ["inertia.I_z"], "factor": -1.0}])
def test_a_member_that_is_no_vessel_is_refused(base: Vessel, block: dict[str, Any]) -> None:
    with pytest.raises(DocumentError, match="would not be a valid vessel: inertia") as caught:
        draw_variant(family(block), 0, base, file="study.toml")
    assert caught.value.file == "study.toml"


@pytest.mark.parametrize(
    ("block", "remedy"),
    [
        ({"parameters": ["inertia.m"]}, "together with factor"),
        ({"factor": 1.1}, "together with factor"),
        ({}, "or one of remove, set"),
        ({"parameters": ["inertia.m"], "factor": (1.4, 0.6)}, "low > high"),
        ({"parameters": ["inertia.m"], "factor": (0.5, float("nan"))}, "finite"),
        ({"parameters": ["inertia.m"], "factor": 1.1, "factors": 2}, "unknown key"),
    ],
)
def test_a_block_has_one_meaning(block: dict[str, Any], remedy: str) -> None:
    with pytest.raises(DocumentError, match=remedy):
        Perturbation(**block)


def test_extends_puts_the_other_rules_first(base: Vessel) -> None:
    moderate = family(HULL, name="moderate", seed=1)
    high = family(MASS, name="high", base=None, extends="moderate")
    written_out = resolve_families([high, moderate])[0]
    assert (written_out.base, written_out.seed, written_out.extends) == ("gunnerus-28.9", 2, None)
    assert draw_variant(written_out, 0, base) == draw_variant(family(HULL, MASS), 0, base)


@pytest.mark.parametrize(
    ("families", "remedy", "path"),
    [
        ([{"name": "a", "extends": "b"}, {"name": "b", "extends": "a"}], "extends itself", "family.0.extends"),
        ([{"name": "a", "extends": "a"}], "extends itself", "family.0.extends"),
        ([{"name": "a", "base": "x"}, {"name": "b", "extends": "aa"}], "did you mean 'a'", "family.1.extends"),
        ([{"name": "a"}], "name a base vessel", "family.0.base"),
        (
            [{"name": f"a{k}", "extends": f"a{k + 1}"} for k in range(2000)],
            "more than 20 families",
            "family.20.extends",
        ),
        ([{"name": "a", "base": "x"}, {"name": "a", "base": "y"}], "two families are called 'a'", "family.1.name"),
    ],
)
def test_families_that_cannot_be_written_out(families: list[dict[str, Any]], remedy: str, path: str) -> None:
    with pytest.raises(DocumentError, match=remedy) as caught:
        resolve_families([Family(**given) for given in families], "study.toml")
    assert caught.value.path == path


def test_a_member_is_a_whole_number() -> None:
    """A draw is a hash of its number: before, member 1.0 was another ship than member 1 and had the same name."""
    base = load_vessel("gunnerus-28.9")
    family = Family(name="f", members=3, perturb=[{"parameters": ["hull.*"], "factor": (0.6, 1.4)}])
    first = draw_variant(family, 1, base)
    for one in (np.int64(1), 1.0, np.float64(1)):
        assert draw_variant(family, one, base) == first  # type: ignore[arg-type]
    assert draw_members(family, base, numbers=np.arange(3.0))[1] == first  # type: ignore[arg-type]


def test_removal_is_zero_and_leaves_the_structure(base: Vessel, tmp_path: Path) -> None:
    variant = draw_variant(family({"remove": ["hull.derivatives.*[order >= 3]"]}, members=1), 0, base)
    third = {
        path for path in base.parameters if "hull.d" in path and hull_derivative(path.rsplit(".", 1)[-1]).order >= 3
    }
    assert set(variant.values) == third
    assert len(third) == 3 + 6 + 6
    assert set(variant.values.values()) == {0.0}
    assert {f"{factor:g}" for factor in variant.factors.values()} == {"0"}, "of negative numbers, too, not -0"
    assert rebuilt(variant, tmp_path).structure == base.structure


def test_a_changed_base_is_refused(base: Vessel, tmp_path: Path) -> None:
    text = draw_variant(HIGH, 0, base).document()
    assert base.digest in text
    file = tmp_path / "patch.toml"
    file.write_text(text.replace(base.digest, "0" * 16))
    with pytest.raises(DocumentError, match="has changed since") as caught:
        load_vessel(str(file))
    assert caught.value.path == "base_digest"
