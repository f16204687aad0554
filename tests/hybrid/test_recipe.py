import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.hybrid.recipe import Recipe, RidgeRecipe, spread


def test_the_paper_recipe_is_what_the_method_pins():
    assert Recipe.preset("paper").model_dump() == {
        "trials": 50,
        "layers": (1, 3),
        "units": (10, 500),
        "input_dropout": (0.0, 1.0),
        "hidden_dropout": (0.0, 1.0),
        "learning_rate": (1e-5, 1e-1),
        "weight_decay": 0.0,  # Adam
        "epochs": 3000,
        "batch": 0,  # full
        "patience": 200,
    }


def test_a_field_can_be_changed_in_either_preset():
    assert Recipe.preset("paper", trials=4, learning_rate=[1e-3, 1e-2]).ranges()["learning_rate"] == (1e-3, 1e-2)
    assert Recipe.preset("paper", trials=3, units=20).units == 20
    assert Recipe.preset("fast", ridge=[1e-3, 1]).ranges()["ridge"] == (1e-3, 1.0)
    assert "offset" not in Recipe.preset("fast", offset=1).ranges()


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("fast", {"trails": 4}, r"recipe\.trails: unknown key: did you mean 'trials'"),
        ("fast", {"trials": 0}, r"recipe\.trials"),
        ("fast", {"mirror": 1.5}, r"recipe\.mirror"),
        ("fast", {"ridge": [1.0, 0.1]}, "ridge: a range goes from low to high"),
        ("fast", {"motion_scale": [0.0, 1.0]}, r"recipe\.motion_scale"),  # searched by its logarithm
        ("fast", {"epochs": 3}, r"recipe\.epochs: unknown key"),  # of the other recipe
        ("paper", {"hidden_dropout": 1.5}, r"recipe\.hidden_dropout"),
        ("paper", {"units": [64, 32]}, "units: a range goes from low to high"),
        ("paper", {"weight_decay": [0.0, 1.0]}, r"recipe\.weight_decay"),  # searched by its logarithm
        ("paper", {"ridge": 1.0}, r"recipe\.ridge: unknown key"),
    ],
)
def test_a_recipe_that_cannot_be_meant_is_refused_in_one_line(name, changes, message):
    with pytest.raises(DocumentError, match=message) as caught:
        Recipe.preset(name, **changes)
    assert "\n" not in str(caught.value)


def test_an_unknown_preset_is_told_the_names():
    with pytest.raises(DocumentError, match="did you mean 'paper'"):
        Recipe.preset("papr")


def test_points_spread_evenly_and_keep_their_start():
    points = np.array(spread(3, 64))
    np.testing.assert_array_equal(spread(3, 5), points[:5])
    np.testing.assert_array_equal(points[0], 0.5)
    for quarter in range(4):  # each quarter of a range gets a quarter of the trials, give or take four
        share = (points >= quarter / 4) & (points < (quarter + 1) / 4)
        assert (abs(share.sum(axis=0) - 16) <= 4).all()


def test_one_dimension_is_the_golden_ratio():
    assert np.ravel(spread(1, 3)) == pytest.approx([0.5, 0.5 + 0.6180339887 - 1, 0.5 + 2 * 0.6180339887 - 1])


def test_trials_fill_their_ranges_by_the_logarithm():
    recipe = Recipe.preset("fast", trials=64, offset=1.5)
    assert isinstance(recipe, RidgeRecipe)
    points = recipe.points()
    assert len(points) == 64
    for name, (low, high) in recipe.ranges().items():
        if name == "ridge":
            continue
        found = np.array([point[name] for point in points])
        assert ((found >= low) & (found <= high)).all()
        assert np.log(found).mean() == pytest.approx(np.log([low, high]).mean(), abs=0.1)
        assert found.min() < low * (high / low) ** 0.1
        assert found.max() > low * (high / low) ** 0.9
    assert {point["offset"] for point in points} == {1.5}
    assert np.mean([point["mirror"] for point in points]) == pytest.approx(0.75, abs=0.05)
    assert points[:5] == RidgeRecipe.points(recipe.model_copy(update={"trials": 5}))


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_all_trials_or_none_can_be_mirrored(share):
    assert {point["mirror"] for point in Recipe.preset("fast", mirror=share).points()} == {share}


def test_ridges_go_from_low_to_high_by_one_factor():
    path = np.array(Recipe.preset("fast", ridge=[1e-4, 1e4]).path())
    assert path[[0, -1]] == pytest.approx([1e-4, 1e4])
    assert path[1:] / path[:-1] == pytest.approx(10.0)
    assert Recipe.preset("fast", ridge=2).path() == [2.0]
