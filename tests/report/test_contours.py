import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipid.report.contours import contour, length, nice_levels, smoothed

X, Y = np.array([10.0, 20.0, 50.0, 100.0]), np.array([0.0, 1.0, 3.0])


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(0.05, 0.95))
def test_the_level_of_a_plane_is_where_the_plane_has_it(a, b, share):
    values = a * X + 30 * b * Y[:, None]
    level = values.min() + share * np.ptp(values)
    for piece in contour(X, Y, values, level):
        np.testing.assert_allclose(a * piece[:, 0] + 30 * b * piece[:, 1], level, atol=1e-6 * max(1, np.ptp(values)))


def test_a_straight_level_is_one_piece_from_side_to_side():
    (piece,) = contour(X, Y, np.tile(Y[:, None], 4), 2.0)
    assert sorted(piece[[0, -1], 0]) == [10, 100]
    assert length(piece) == pytest.approx(90)


def test_a_hill_is_closed():
    values = np.zeros((3, 3))
    values[1, 1] = 1.0
    (piece,) = contour(np.arange(3.0), np.arange(3.0), values, 0.5)
    np.testing.assert_allclose(piece[0], piece[-1])


def test_nothing_is_drawn_beside_a_hole():
    values = np.tile(Y[:, None], 4)
    values[1, 1] = np.nan
    pieces = contour(X, Y, values, 0.5) + contour(X, Y, values, 2.0)
    assert pieces
    inside = np.concatenate(pieces)
    # The triangles that touch the hole at (20, 1): no point of a line lies strictly inside their star.
    assert not (
        (inside[:, 0] > 10) & (inside[:, 0] < 20) & (inside[:, 1] < 1) & (inside[:, 1] > inside[:, 0] / 10 - 1)
    ).any()
    assert not ((inside[:, 0] == 20) & (inside[:, 1] > 0) & (inside[:, 1] < 3)).any()


def test_levels_are_round_and_inside():
    levels = nice_levels(np.geomspace(0.4, 12, 50), 5)
    assert levels == sorted(levels)
    assert len(levels) == 5
    assert min(levels) > 0.4
    assert max(levels) < 12
    assert {float(f"{level:.2g}") for level in levels} == set(levels)
    assert nice_levels(np.array([np.nan, 1.0, 2.0]), 5) == []


def test_levels_of_small_values_beside_zeros_are_those_of_the_small_values():
    small = np.geomspace(0.02, 0.5, 50)
    assert nice_levels(np.concatenate([np.zeros(50), -small, small]), 5) == nice_levels(small, 5) != []


def test_every_digit_of_a_level_occurs_once():
    assert nice_levels(np.geomspace(0.9, 1.2, 50), 9) == [1.0]
    assert nice_levels(np.geomspace(0.8, 14, 50), 9) == [1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0]


@pytest.mark.parametrize("corner", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_a_line_that_cuts_off_one_corner_is_drawn(corner):
    values = np.zeros((2, 2))
    values[corner] = 1.0
    (piece,) = contour(np.array([0.0, 1.0]), np.array([0.0, 1.0]), values, 0.5)
    ends = {tuple(np.abs(end - corner[::-1])) for end in piece[[0, -1]]}  # x is the column
    assert ends == {(0.5, 0.0), (0.0, 0.5)}


def test_smoothing_keeps_what_is_smooth_and_calms_what_is_not():
    rng = np.random.default_rng(3)
    flat = np.full((16, 9), 2.0)
    np.testing.assert_allclose(smoothed(flat, (2.0, 1.0)), flat)
    rough = flat * np.exp(0.2 * rng.normal(size=flat.shape))
    calm = smoothed(rough, (2.0, 1.0))
    assert np.std(np.log(calm)) < 0.5 * np.std(np.log(rough))
    assert np.isclose(np.log(calm).mean(), np.log(rough).mean(), atol=0.03)


def test_smoothing_neither_fills_gaps_nor_takes_from_them():
    values = np.full((8, 9), 2.0)
    values[3, 4] = np.nan
    smooth = smoothed(values, (2.0, 1.0))
    assert np.isnan(smooth[3, 4])
    assert np.isnan(smooth).sum() == 1
    np.testing.assert_allclose(smooth[np.isfinite(smooth)], 2.0)


def test_a_few_models_are_not_averaged_over():
    """Six models of which two err twenty times as much: a line of 3 m does not run through their cells of 10 m."""
    errors = np.repeat([[0.3], [0.6], [0.7], [0.6], [11.0], [10.0]], 2, axis=1)
    np.testing.assert_allclose(smoothed(errors, (2.0, 1.0)), errors)
    many = np.repeat(errors, 2, axis=0)
    assert not np.allclose(smoothed(many, (2.0, 1.0)), many)
