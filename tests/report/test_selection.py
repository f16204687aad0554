import itertools

import numpy as np
import pandas as pd
from hypothesis import given
from hypothesis import strategies as st

from shipid.report.selection import (
    close_up_models,
    errors_over_seeds,
    figure_sizes,
    middle_models,
    models_by_accuracy,
    spread_items,
    thin_lines,
)


def test_few_models_are_all_drawn_many_by_their_middle(simulation, full_scale):
    assert close_up_models(full_scale) == list(models_by_accuracy(full_scale).model)
    assert close_up_models(simulation) == ["nominal", "moderate-2", "high-2", "no physics"]
    assert list(models_by_accuracy(simulation).model)[-1] == "no physics"


def test_the_largest_families_come_first(simulation):
    assert list(middle_models(simulation).items())[:2] == [("moderate", "moderate-2"), ("high", "high-2")]


def test_sizes_are_ends_and_middle():
    assert figure_sizes(pd.Series([0, 30, 10, 100, 50, 10])) in ([10, 30, 100], [10, 50, 100])
    assert figure_sizes(pd.Series([0, 30, 10, 100])) == [10, 30, 100]
    assert figure_sizes(pd.Series([15, 15])) == [15]
    assert figure_sizes(pd.Series([0, 0])) == [0]
    assert spread_items(["a", "b"], 3) == ["a", "b"]


def test_cells_without_result_do_not_enter_the_mean(full_scale):
    means = errors_over_seeds(full_scale)
    assert len(means) == 3
    assert means.H.notna().all()
    assert (means.seeds == 1).all()


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=40), st.floats(0.01, 5))
def test_no_dropped_point_is_farther_than_the_tolerance(points, tolerance):
    line = np.asarray(points)
    (kept,) = thin_lines([line], tolerance)
    assert kept[0] == 0
    assert kept[-1] == len(line) - 1
    for first, last in itertools.pairwise(kept):
        a, along = line[first], line[last] - line[first]
        for point in line[first : last + 1]:
            length = along @ along
            share = np.clip((point - a) @ along / length, 0, 1) if length > 0 else 0.0
            assert np.linalg.norm(point - a - share * along) <= tolerance + 1e-9


def test_a_straight_line_needs_two_points_and_a_loop_more():
    straight = np.column_stack([np.arange(100.0), 2 * np.arange(100.0)])
    assert list(thin_lines([straight], 0.1)[0]) == [0, 99]
    angle = np.linspace(0, 2 * np.pi, 200)
    loop = np.column_stack([np.cos(angle), np.sin(angle)])
    assert 10 < len(thin_lines([loop], 0.01)[0]) < 60
    together = thin_lines([straight, loop, straight[:1]], 0.1)
    alone = [thin_lines([line], 0.1)[0] for line in (straight, loop, straight[:1])]
    for one, other in zip(together, alone, strict=True):
        np.testing.assert_array_equal(one, other)
    assert thin_lines([], 0.1) == []
