from dataclasses import replace
from functools import lru_cache

import numpy as np
import pandas as pd
import pytest
from scipy.stats import spearmanr

from shipid.report.search import (
    DIVERGED_RATIO,
    HIGHEST_RATIO,
    search_table,
    searched_names,
    trial_rank_correlation,
)
from shipid.report.search import search_figure as drawn_anew
from tests.report.views import views

search = lru_cache(maxsize=2)(drawn_anew)  # the same content is drawn once


def panels(content, view="0"):
    return {panel.layout.xaxis.title.text.split(" [")[0]: panel for panel in views(search(content))[view]}


def dots(panel):
    return {trace.name: trace for trace in panel.data}


def test_a_panel_per_hyperparameter_that_varies(simulation):
    fixed = replace(simulation, trials=simulation.trials.assign(units=64.0))
    assert searched_names(simulation) == ["learning_rate", "weight_decay", "units"]
    assert list(panels(fixed)) == ["learning rate", "weight decay"]
    assert panels(simulation)["learning rate"].layout.xaxis.type == "log"
    dropped = replace(simulation, trials=simulation.trials.assign(hidden_dropout=simulation.trials.number / 20))
    assert panels(dropped)["hidden dropout"].layout.xaxis.type is None


def test_dots_are_relative_to_the_best_of_their_cell(simulation):
    trials = simulation.trials
    drawn = dots(panels(simulation)["learning rate"])
    assert sum(len(drawn[name].x) for name in ("complete", "stopped", "diverged", "chosen")) == len(trials)
    assert (np.asarray(drawn["diverged"].y) == np.float32(DIVERGED_RATIO)).all()
    assert len(drawn["diverged"].x) == trials.state.eq("diverged").sum()
    ended = trials.value.where(trials.state.eq("complete"))
    best = np.sqrt(trials.value / ended.groupby(trials.cell).transform("min"))
    stopped = trials.state.eq("stopped")
    np.testing.assert_allclose(drawn["stopped"].y, best[stopped].clip(upper=HIGHEST_RATIO), atol=1e-3)
    np.testing.assert_allclose(drawn["chosen"].x, trials.learning_rate[trials.chosen], rtol=1e-5)


def test_of_many_trials_some_are_drawn(simulation):
    many = pd.concat([simulation.trials] * 5, ignore_index=True)
    content = replace(simulation, trials=many)
    drawn = dots(panels(content)["weight decay"])
    assert sum(len(trace.x) for name, trace in drawn.items() if name != "median") == 1200
    assert "at most 1,200 are drawn" in search(content).how
    assert "are drawn" not in search(simulation).how


def test_the_rank_correlation_is_scipys_mean_over_cells():
    rng = np.random.default_rng(5)
    for _ in range(10):
        cell = rng.choice(["a", "b", "c", None], 40)
        rate = np.where(rng.random(40) < 0.1, np.nan, rng.integers(0, 4, 40))
        value = np.where(rng.random(40) < 0.1, np.nan, rng.normal(size=40).round(1))
        trials = pd.DataFrame({"cell": cell, "rate": rate, "value": value})
        parts = [part for _, part in trials.dropna().groupby("cell")]
        parts = [part for part in parts if len(part) > 2 and part.rate.nunique() > 1 and part.value.nunique() > 1]
        expected = np.mean([spearmanr(part.rate, part.value).statistic for part in parts])
        assert trial_rank_correlation(trials, "rate") == pytest.approx(expected)
        assert trial_rank_correlation(trials.astype({"rate": "Int64"}), "rate") == pytest.approx(expected)


def test_takeaway_names_what_goes_with_the_error(simulation):
    correlation = trial_rank_correlation(simulation.trials, "learning_rate")
    text = f"errors vary most with learning rate, rank correlation {correlation:.2f}.".replace("-", "−")
    assert text in search(simulation).takeaway


def test_the_table_sums_up_by_size(simulation):
    rows = {
        int(row[0].key): dict(zip(search_table(simulation).columns, row, strict=True))
        for row in search_table(simulation).rows
    }
    mine = simulation.trials[simulation.trials.N_D == 30]
    assert list(rows) == [10, 30, 100]
    assert rows[30]["cells [1]"].key == 14
    assert rows[30]["trials [1]"].key == len(mine)
    assert rows[30]["diverged [1]"].key == mine.state.eq("diverged").sum()
    assert rows[30]["time per cell [s]"].key == pytest.approx(mine.seconds.sum() / 14)


def test_a_search_in_closed_form_says_what_there_was(simulation):
    """No epochs, nothing stopped, and a choice of yes or no."""
    trials = simulation.trials.drop(columns=["learning_rate", "weight_decay", "units"])
    trials = trials.assign(state="complete", value=1.0 + trials.number, epochs=0, chosen=trials.number < 4)
    trials = trials.assign(motion_scale=2.0 + trials.number, mirror=trials.number.mod(4).ne(0).astype(float))
    content = replace(simulation, trials=trials)
    drawn = panels(content)
    assert list(drawn) == ["motion scale", "mirror"]
    assert list(drawn["mirror"].layout.xaxis.ticktext) == ["no", "yes"]
    assert [chip.label for chip in search(content).chips] == ["trial", "chosen", "median"]
    printed = search_table(content)
    assert "epochs [1]" not in printed.columns
    assert "504 trials in 42 cells: none stopped early, none diverged" in printed.takeaway
    assert {"stopped early", "diverged"} < {chip.label for chip in search(simulation).chips}


def test_delays_are_seconds(simulation):
    trials = simulation.trials.drop(columns=["learning_rate", "weight_decay", "units"])
    trials = trials.assign(delays=2.0 + trials.number.mod(3))
    content = replace(simulation, trials=trials)
    assert {panel.layout.xaxis.title.text for panel in views(search(content))["0"]} == {"delays [s]"}
    assert all(
        "%{x:.3g} s" in dot.hovertemplate for name, dot in dots(panels(content)["delays"]).items() if name != "median"
    )


def test_trials_that_all_diverged_stand(simulation):
    lost = simulation.trials.assign(state="diverged", value=np.nan, chosen=False)
    content = replace(simulation, trials=lost)
    assert search(content).takeaway.startswith("None of 504 trials ended")
