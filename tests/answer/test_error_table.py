"""Errors by test manoeuvre: the means of a study are the weighted means of its table."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shipid.answer.error_table import PHYSICS_ONLY, error_table
from tests.answer.byhand import grid

H = {"good": (1.5, 1.0), "bad": (3.0, 2.0), "none": (9.0, 4.0)}


def test_means_are_those_of_the_cells(made: Any) -> None:
    table = error_table(made(grid(H), runs=8), ["good", "bad"])
    assert (table.amounts, table.runs) == ((10, 30), 8)
    assert [table.mean("good", k) for k in (0, 1)] == pytest.approx([1.5, 1.0])
    assert table.mean("bad", PHYSICS_ONLY) == pytest.approx(6.0)
    lead = table.lead("none", ["good", "bad"], 0)
    assert lead.mean.tolist() == pytest.approx([7.5, 6.0])
    assert (lead.low > 0).all()


def test_a_model_without_a_result_in_every_cell_is_not_there(made: Any) -> None:
    table = error_table(made(grid({**H, "bad": (3.0, None)}), runs=8), ["good", "bad"])
    assert set(table.H) == {"good", "none"}


def test_percentiles_are_taken_within_manoeuvres(made: Any) -> None:
    curves = {("good", 10, 0): [0.0, 0.0, 0.0, 10.0]}
    table = error_table(made(grid(H), curves=curves, runs=8), ["good"], "H_90")
    assert table.mean("good", 0) == pytest.approx(np.quantile([0.0, 0.0, 0.0, 10.0], 0.9))


def test_an_interval_of_an_error_is_that_of_its_difference_to_0_without_what_is_below_0(made: Any) -> None:
    results = made(grid(H), runs=8)
    table = error_table(results, ["good", "bad"])
    unbound = table.compare([[(1.0, "bad", 1)]])
    assert table.interval("bad", 1) == pytest.approx((unbound.low[0], unbound.high[0]), rel=1e-12)
    skewed = replace(table, H={**table.H, "bad": table.H["bad"] * np.array([0.01] * 7 + [9.0])})
    assert skewed.compare([[(1.0, "bad", 1)]]).low[0] < 0, "most of the error is in one manoeuvre"
    low, high = skewed.interval("bad", 1)
    assert low == 0 < skewed.mean("bad", 1) < high


def test_physics_alone_makes_the_training_noise_of_others_no_smaller(made: Any) -> None:
    """Its seeds are alike, since it learns nothing: they say nothing of models that do."""
    by_seed = {"good": (1.0, 1.5), "bad": (2.0, 3.0), "none": (4.0, 6.0)}
    learned = {(name, 10, seed): H for name, both in by_seed.items() for seed, H in enumerate(both)}
    still = {("still", 10, seed): 6.0 for seed in range(2)}
    methods = {"method": [{"name": "drawn", "kind": "path-drawn"}, {"name": "alone", "kind": "alone"}]}
    alone = dict.fromkeys(("good", "bad", "still"), 6.0)
    results = made(learned | still, alone=alone, runs=8, planned=8, changes=methods)
    cells = results.cells
    mixed = replace(results, cells=cells.assign(method=cells["method"].where(cells["model"] != "still", "alone")))
    table = error_table(mixed, ["good", "bad"])
    without = error_table(made(learned, runs=8), ["good", "bad"])
    for name in by_seed:
        assert table.interval(name, 0) == without.interval(name, 0)
