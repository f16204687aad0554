from dataclasses import replace

import pandas as pd

from shipid.report.selection import (
    close_up_models,
    errors_over_seeds,
    family_words,
    figure_sizes,
    models_by_accuracy,
    spread_items,
)


def test_few_models_are_all_drawn_of_many_some(simulation, full_scale):
    assert close_up_models(full_scale) == list(models_by_accuracy(full_scale).model)
    assert close_up_models(simulation) == ["nominal", "moderate-2", "moderate-3", "high-2", "no physics"]
    assert list(models_by_accuracy(simulation).model)[-1] == "no physics"


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


def test_a_family_without_a_description_is_not_described(simulation):
    """Below the first figure stood `mine: .`, of a simulator of somebody else."""
    models = simulation.models.assign(description="")
    models.loc[models["family"] == "high", "description"] = "+-60 %"
    assert family_words(replace(simulation, models=models), ["moderate", "high"]) == " high: +-60 %."
    asked = replace(simulation, models=models.assign(description="how much does it cost?"))
    assert family_words(asked, ["high"]) == " high: how much does it cost?"
