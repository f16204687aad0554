import numpy as np
import pytest
from scipy.stats import spearmanr

from shipid import metrics
from shipid.metrics import BINS, tally_errors, tally_quantile


@pytest.fixture
def paths():
    rng = np.random.default_rng(0)
    true = rng.normal(size=(30, 40, 2)).cumsum(axis=0)
    return true + rng.normal(size=true.shape), true


def test_lengths_are_those_of_hypot_in_every_layout_and_size() -> None:
    rng = np.random.default_rng(3)
    plain = rng.normal(size=(7, 33, 2)) * 10.0 ** rng.uniform(-150, 150, (7, 33, 1))
    plain[0, 0], plain[0, 1], plain[0, 2] = (np.nan, 1.0), (np.inf, np.nan), (0.0, 0.0)
    expected = np.hypot(plain[..., 0], plain[..., 1])
    for vectors in (plain, np.asfortranarray(plain), plain.repeat(2, axis=1)[:, ::2]):
        np.testing.assert_allclose(metrics.vector_lengths(vectors), expected, rtol=4 * np.finfo(float).eps)
        np.testing.assert_array_equal(metrics.vector_lengths(vectors), metrics.vector_lengths(plain))
    short = np.float32([[3.0, 4.0]])
    assert metrics.vector_lengths(short).tolist() == [5.0]


def test_position_error_by_hand():
    predicted = np.array([[[3.0, 4.0], [1.0, 1.0]]])
    assert metrics.position_error(predicted, np.zeros((1, 2, 2))) == pytest.approx(np.array([[5.0, 2**0.5]]))


def test_summary_by_hand():
    error = np.arange(11.0).reshape(1, 11)
    assert metrics.summarise_errors(error) == {
        "mean": pytest.approx(5.0),
        "p90": pytest.approx(9.0),
        "rms": pytest.approx(35.0**0.5),  # (0 + 1 + ... + 100) / 11 = 385 / 11
        "end": pytest.approx(5.0),
        "end_90": pytest.approx(9.0),
        "status": "ok",
    }


def test_a_diverged_window_is_reported_and_not_averaged_away():
    error = np.ones((3, 8))
    error[2, 5] = np.inf
    error[1:, 6] = np.nan
    result = metrics.summarise_errors(error)
    assert result["status"] == "diverged"
    assert np.isnan([result["mean"], result["p90"], result["rms"]]).all()


def test_roughness_by_hand():
    """A zigzag of 1 m has second differences of 2 m; a circle of radius R has (speed x step)^2 / R."""
    zigzag = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0], [3.0, 1.0]])[:, None, :]
    assert metrics.path_roughness(zigzag) == pytest.approx(2.0)
    angle = 0.01 * np.arange(30)
    circle = 50.0 * np.stack([np.sin(angle), 1 - np.cos(angle)], axis=-1)[:, None, :]
    assert metrics.path_roughness(circle) == pytest.approx(0.5**2 / 50.0, rel=1e-4)
    assert metrics.path_roughness(np.concatenate([zigzag, np.zeros_like(zigzag)], axis=1)) == pytest.approx(1.0)
    assert metrics.path_roughness(zigzag[:3]) == pytest.approx(2.0)


def test_a_long_run_counts_as_much_as_a_short_one():
    held = np.array([True, False, True, True, False])
    run = np.array(["b", "b", "a", "b", "b"])
    np.testing.assert_array_equal(metrics.coverage_by_run(held, run), [1.0, 0.5])
    assert metrics.coverage_share(held, run) == 0.75


def test_rank_correlation_knows_order_alone():
    x = np.array([1.0, 2.0, 5.0, 9.0])
    assert metrics.rank_correlation(x, np.exp(x)) == pytest.approx(1.0)
    assert metrics.rank_correlation(x, -(x**3)) == pytest.approx(-1.0)
    assert metrics.rank_correlation(x, np.array([1.0, 3.0, 2.0, 4.0])) == pytest.approx(0.8)  # 1 - 6 x 2 / (4 x 15)
    assert metrics.rank_correlation(np.array([1.0, 1.0, 2.0]), np.array([3.0, 3.0, 8.0])) == pytest.approx(1.0)
    assert metrics.rank_correlation(x, np.ones(4)) == 0.0
    first, second = np.random.default_rng(0).integers(0, 4, (2, 30)).astype(float)
    assert metrics.rank_correlation(first, second) == pytest.approx(spearmanr(first, second).statistic)


def test_a_tally_has_every_error_in_its_bin() -> None:
    """Bins double in 512 equal steps from 1 mm on; what lies beyond, or is no number, joins an end."""
    edges = np.array([2.0**-10, 2.0**-10 * (1 + 1 / 512), 1.0, 3.0, 2.0**20])
    places = [0, 1, 10 * 512, 11 * 512 + 256, BINS - 1]
    for edge, place in zip(edges, places, strict=True):
        assert tally_errors(np.array([edge])).nonzero()[0] == [place]
    ends = tally_errors(np.array([0.0, np.nan, 1e-9, np.inf, 1e12]))
    assert (ends[0], ends[-1], ends.sum()) == (3, 2, 5)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("count", [1, 2, 10, 5000])
def test_quantiles_of_a_tally(share: float, count: int) -> None:
    """Within the width of a bin of the quantile of the errors themselves, as `summary` takes it."""
    rng = np.random.default_rng(count)
    errors = rng.gamma(2.0, 3.0, (3, count))
    quantiles = tally_quantile(np.array([tally_errors(one) for one in errors]), share)
    low, high = (np.quantile(errors, share, axis=1, method=end) for end in ("lower", "higher"))
    assert (quantiles >= low * (1 - 1 / 512)).all()
    assert (quantiles <= high * (1 + 1 / 512)).all()
    if count == 5000:
        np.testing.assert_allclose(quantiles, np.quantile(errors, share, axis=1), rtol=2e-3)


@pytest.mark.parametrize(("angle", "speed"), [(0.0, 1.0), (-0.4, 0.3), (1.7, 8.0), (3.0, 2.0)])
def test_the_error_of_the_course_is_the_angle_between_tracks(angle: float, speed: float) -> None:
    ahead = speed * 2.0 * np.arange(1, 6)[:, None]
    true = np.stack([ahead, np.zeros_like(ahead)], axis=-1)
    turned = np.stack([ahead * np.cos(angle), ahead * np.sin(angle)], axis=-1)
    np.testing.assert_allclose(metrics.course_over_horizon(turned, true, 2.0), abs(angle), atol=1e-9)


def test_a_ship_that_hardly_moves_has_no_course() -> None:
    true = np.zeros((3, 2, 2))
    assert np.isnan(metrics.course_over_horizon(true + 1.0, true, 1.0)).all()
    true[:, 1, 0] = [1.0, 2.0, 3.0]
    sideways = np.flip(true, axis=-1)
    np.testing.assert_allclose(metrics.course_over_horizon(sideways, true, 1.0), np.pi / 2)
