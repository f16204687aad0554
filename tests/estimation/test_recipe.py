import pytest

from shipid.errors import DocumentError
from shipid.estimation.recipe import Recipe, sequence


def test_the_paper_recipe_is_what_the_method_pins():
    assert Recipe.preset("paper").model_dump() == {
        "sampler": "tpe",
        "trials": 50,
        "layers": (1, 3),
        "units": (10, 500),
        "input_dropout": (0.0, 1.0),
        "hidden_dropout": (0.0, 1.0),
        "learning_rate": (1e-5, 1e-1),
        "weight_decay": 0.0,  # Adam
        "epochs": 3000,
        "min_steps": 0,
        "batch": 0,  # full
        "patience": 200,
        "one_cycle": False,
        "scale_targets": False,  # metres
        "refit": 0,
    }


def test_a_field_can_be_changed_in_either_preset():
    assert Recipe.preset("fast", trials=4, learning_rate=[1e-3, 1e-2]).ranges()["learning_rate"] == (1e-3, 1e-2)
    assert Recipe.preset("paper", trials=3, units=20).units == 20


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"trails": 4}, r"recipe\.trails: unknown key: did you mean 'trials'"),
        ({"trials": 0}, r"recipe\.trials"),
        ({"hidden_dropout": 1.5}, r"recipe\.hidden_dropout"),
        ({"units": [64, 32]}, "units: a range goes from low to high"),
        ({"weight_decay": [0.0, 1.0]}, r"recipe\.weight_decay"),  # searched by its logarithm
        ({"sampler": "grid"}, r"recipe\.sampler"),
    ],
)
def test_a_recipe_that_cannot_be_meant_is_refused_in_one_line(changes, message):
    with pytest.raises(DocumentError, match=message):
        Recipe.preset("fast", **changes)


def test_an_unknown_preset_is_told_the_names():
    with pytest.raises(DocumentError, match="did you mean 'paper'"):
        Recipe.preset("papr")


def test_the_sequence_spreads_evenly_and_keeps_its_start():
    ranges = {"units": (10, 500), "learning_rate": (1e-5, 1e-1), "hidden_dropout": (0.0, 1.0)}
    points = sequence(ranges, 64)
    assert sequence(ranges, 5) == points[:5]
    assert points[0] == {"units": 255, "learning_rate": pytest.approx(1e-3), "hidden_dropout": 0.5}
    for quarter in range(4):  # each quarter of a range gets a quarter of the trials, give or take two
        share = [p for p in points if quarter / 4 <= p["hidden_dropout"] < (quarter + 1) / 4]
        assert abs(len(share) - 16) <= 2
    assert all(10 <= p["units"] <= 500 and isinstance(p["units"], int) for p in points)


def test_one_dimension_is_the_golden_ratio():
    shares = [p["hidden_dropout"] for p in sequence({"hidden_dropout": (0.0, 1.0)}, 3)]
    assert shares == pytest.approx([0.5, 0.5 + 0.6180339887 - 1, 0.5 + 2 * 0.6180339887 - 1])
