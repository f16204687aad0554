import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.hybrid.methods import method_of
from shipid.hybrid.one_step import OneStep
from shipid.hybrid.search import spread_points


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("kernel", {"trails": 4}, r"method\.trails: unknown key: did you mean 'trials'"),
        ("kernel", {"trials": 0}, r"method\.trials"),
        ("kernel", {"mirror": 1.5}, r"method\.mirror"),
        ("kernel", {"ridge": [1.0, 0.1]}, "ridge: a range goes from low to high"),
        ("kernel", {"scale": [0.0, 1.0]}, r"method\.scale"),  # searched by its logarithm
        ("kernel", {"epochs": 3}, r"method\.epochs: unknown key"),  # of the other method
        ("path-trained", {"hidden_dropout": 1.5}, r"method\.hidden_dropout"),
        ("path-trained", {"units": [64, 32]}, "units: a range goes from low to high"),
        ("path-trained", {"weight_decay": [0.0, 1.0]}, r"method\.weight_decay"),  # searched by its logarithm
        ("path-trained", {"ridge": 1.0}, r"method\.ridge: unknown key"),
        ("kernel", {"memory": {"turned": float("inf")}}, r"method\.memory\.turned: inf: must be a finite number"),
        ("recurrent", {"seconds": float("inf")}, r"method\.seconds: inf: must be a finite number"),
        ("hankel-dmd", {"delays": [float("inf")]}, r"method\.delays.*: inf: must be a finite number"),
    ],
)
def test_a_method_that_cannot_be_meant_is_refused_in_one_line(name, changes, message):
    with pytest.raises(DocumentError, match=message):
        method_of(name, changes)


def test_an_unknown_kind_is_refused_with_the_names_and_a_retired_one_with_what_to_take():
    with pytest.raises(DocumentError, match="did you mean 'path-trained'"):
        method_of("path-traind", {})
    for kind in ("path-drawn", "path-refined"):
        with pytest.raises(
            DocumentError, match=rf"method\.kind: '{kind}' is no kind of method: it is retired, take kernel$"
        ):
            method_of(kind, {})


def test_points_spread_evenly_and_keep_their_start():
    points = np.array(list(spread_points(3, 64)))
    np.testing.assert_array_equal(list(spread_points(3, 5)), points[:5])
    np.testing.assert_array_equal(points[0], 0.5)
    for quarter in range(4):  # each quarter of a range gets a quarter of the trials, give or take four
        share = (points >= quarter / 4) & (points < (quarter + 1) / 4)
        assert (abs(share.sum(axis=0) - 16) <= 4).all()


def test_trials_fill_their_ranges_by_the_logarithm():
    method = OneStep(trials=64, offset=1.5)
    points = list(method.points())
    assert len(points) == 64
    for name, (low, high) in method.ranges().items():
        if name == "ridge":
            continue
        values = np.array([point[name] for point in points])
        assert ((values >= low) & (values <= high)).all()
        assert np.log(values).mean() == pytest.approx(np.log([low, high]).mean(), abs=0.1)
        assert values.min() < low * (high / low) ** 0.1
        assert values.max() > low * (high / low) ** 0.9
    assert {point["offset"] for point in points} == {1.5}
    assert points[:5] == list(OneStep(trials=5, offset=1.5).points())
