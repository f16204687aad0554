from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid.report.errors_over import horizon_figure as horizon
from shipid.report.errors_over import time_figure as over_time
from tests.report.test_page import render
from tests.report.views import views


def lines(figure, view):
    return {trace.name: trace for trace in views(figure)[view][0].data}


@pytest.mark.parametrize(("statistic", "column"), [(0, "mean"), (1, "p90")])
@pytest.mark.parametrize(("index", "size"), [(0, 10), (2, 100)])
def test_horizon_draws_the_rows_of_its_size(simulation, statistic, column, index, size):
    drawn = lines(horizon(simulation), f"{statistic}-{index}")
    frame = simulation.horizon
    for name, model, source, count in [
        ("moderate-2, compensated", "moderate-2", "cooperative", size),
        ("moderate-2, physics alone", "moderate-2", "physics", 0),
        ("no physics", "no physics", "cooperative", size),
        ("constant u, v, r", "", "naive", 0),
    ]:
        rows = frame[(frame.model == model) & (frame.source == source) & frame.N_D.eq(count)]
        np.testing.assert_allclose(drawn[name].x, rows.ahead)
        np.testing.assert_allclose(drawn[name].y, rows[column], rtol=1e-6)


def test_seeds_become_their_mean(full_scale):
    one = full_scale.horizon
    both = pd.concat([one, one.assign(seed=1, mean=3 * one["mean"])])
    before, after = (lines(horizon(replace(full_scale, horizon=frame)), "0-0") for frame in (one, both))
    name = "inaccurate, compensated"
    assert after[name].y[-1] == pytest.approx(2 * before[name].y[-1])


def test_errors_by_axis_where_they_are_known(full_scale):
    one = full_scale.horizon
    assert len(horizon(full_scale).controls[0].options) == 2
    known = one.assign(along=0.8 * one["mean"], across=0.5 * one["mean"])
    both = pd.concat([known, known.assign(seed=1, mean=3 * known["mean"], across=2 * known["across"])])
    figure = horizon(replace(full_scale, horizon=both))
    assert figure.controls[0].options[2:] == ["along (surge)", "across (sway)"]
    assert "no error of the heading" in figure.how
    name = "inaccurate, compensated"
    mean, across = (lines(figure, f"{i}-0")[name].y[-1] for i in (0, 3))
    assert across == pytest.approx(mean * 0.5 * 1.5 / 2)


def test_a_close_up_of_many_models_says_which(simulation, full_scale):
    figure = horizon(simulation)
    assert (
        "Of 7 models, some spread over A and the best in validation: "
        "nominal, moderate-2, moderate-3, high-2 and no physics." in figure.how
    )
    assert "high-1, compensated" not in lines(figure, "0-0")
    assert "middle one" not in horizon(full_scale).how


def test_commands_share_the_time_axis_but_not_the_unit(full_scale):
    figure = over_time(full_scale)
    plot = views(figure)["0"][0]
    titles = [plot.layout[name].title.text for name in ("yaxis", "yaxis2", "yaxis3")]
    assert titles == ["position error [m]", "azimuth [deg]", "shaft [rpm]"]
    domains = [plot.layout[name].domain for name in ("yaxis", "yaxis2", "yaxis3")]
    assert domains[0][0] > domains[1][1] > domains[1][0] > domains[2][1] > domains[2][0] >= 0
    assert {trace.xaxis for trace in plot.data} <= {None, "x"}
    assert {chip.label for chip in figure.chips} >= {"port azimuth", "starboard shaft"}


def test_runs_without_times_have_no_figure_over_time(full_scale):
    untimed = replace(full_scale, over_time=full_scale.over_time.assign(t=np.nan))
    assert over_time(untimed) is None
    assert "Error over time" not in render(untimed)


def test_takeaway_names_the_worst_instant(simulation):
    frame = simulation.over_time
    mine = frame[(frame.model == "nominal") & (frame.N_D == 100)]
    worst = mine.loc[mine.error.idxmax()]
    assert f"in {worst.run} at t = {worst.t:g} s: {worst.error:.2f} m" in over_time(simulation).takeaway
    alone = frame[(frame.model == "nominal") & (frame.source == "physics") & (frame.run == worst.run)]
    alone = alone[alone.t == worst.t].error.iloc[0]
    assert f"where its physics alone errs by {alone:.2f} m" in over_time(simulation).takeaway
