import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.hybrid.methods import method_of
from shipid.hybrid.path_drawn import PathDrawn
from shipid.hybrid.search import spread_points


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("path-drawn", {"trails": 4}, r"method\.trails: unknown key: did you mean 'trials'"),
        ("path-drawn", {"trials": 0}, r"method\.trials"),
        ("path-drawn", {"mirror": 1.5}, r"method\.mirror"),
        ("path-drawn", {"ridge": [1.0, 0.1]}, "ridge: a range goes from low to high"),
        ("path-drawn", {"motion_scale": [0.0, 1.0]}, r"method\.motion_scale"),  # searched by its logarithm
        ("path-drawn", {"epochs": 3}, r"method\.epochs: unknown key"),  # of the other method
        ("path-trained", {"hidden_dropout": 1.5}, r"method\.hidden_dropout"),
        ("path-trained", {"units": [64, 32]}, "units: a range goes from low to high"),
        ("path-trained", {"weight_decay": [0.0, 1.0]}, r"method\.weight_decay"),  # searched by its logarithm
        ("path-trained", {"ridge": 1.0}, r"method\.ridge: unknown key"),
        ("path-drawn", {"memory": {"turned": float("inf")}}, r"method\.memory\.turned: inf: must be a finite number"),
        ("recurrent", {"seconds": float("inf")}, r"method\.seconds: inf: must be a finite number"),
        ("hankel-dmd", {"delays": [float("inf")]}, r"method\.delays.*: inf: must be a finite number"),
    ],
)
def test_a_method_that_cannot_be_meant_is_refused_in_one_line(name, changes, message):
    with pytest.raises(DocumentError, match=message):
        method_of(name, changes)


def test_an_unknown_kind_is_refused_with_the_names():
    with pytest.raises(DocumentError, match="did you mean 'path-trained'"):
        method_of("path-traind", {})


def test_points_spread_evenly_and_keep_their_start():
    points = np.array(list(spread_points(3, 64)))
    np.testing.assert_array_equal(list(spread_points(3, 5)), points[:5])
    np.testing.assert_array_equal(points[0], 0.5)
    for quarter in range(4):  # each quarter of a range gets a quarter of the trials, give or take four
        share = (points >= quarter / 4) & (points < (quarter + 1) / 4)
        assert (abs(share.sum(axis=0) - 16) <= 4).all()


def test_trials_fill_their_ranges_by_the_logarithm():
    method = PathDrawn(trials=64, offset=1.5)
    points = list(method.points())
    assert len(points) == 64
    mirrored = [point["mirror"] for point in points]
    for name, (low, high) in method.ranges().items():
        if name == "ridge":
            continue
        values = np.array([point[name] for point in points])
        assert ((values >= low) & (values <= high)).all()
        assert np.log(values).mean() == pytest.approx(np.log([low, high]).mean(), abs=0.1)
        assert values.min() < low * (high / low) ** 0.1
        assert values.max() > low * (high / low) ** 0.9
        assert abs(np.corrcoef(np.log(values), mirrored)[0, 1]) < 0.2  # else the mirror would be judged by the range
    assert {point["offset"] for point in points} == {1.5}
    assert np.mean(mirrored) == pytest.approx(0.75, abs=0.05)
    assert points[:5] == list(PathDrawn(trials=5, offset=1.5).points())
