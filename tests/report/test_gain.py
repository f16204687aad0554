import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid.errors import ShipidError
from shipid.report.figure import Figure
from shipid.report.gain import gain, lack
from shipid.report.standalone import standalone

LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def traces(figure: Figure, view: str) -> dict[str, list]:
    """Traces of a view by name."""
    by_name: dict[str, list] = {}
    for trace in figure.views[view][0].figure.data:
        by_name.setdefault(trace.name, []).append(trace)
    return by_name


@pytest.mark.parametrize(("view", "column", "floor"), [("0-0", "H", 5.01), ("1-0", "H_90", 11.2), ("2-1", "rms", 6.3)])
def test_lines_are_means_over_seeds(simulation, view, column, floor):
    drawn = traces(gain(simulation), view)
    cells = simulation.cells
    for model in cells.model.unique():
        (line,) = drawn[model]
        expected = [cells[(cells.model == model) & cells.N_D.eq(size)][column].mean() for size in (10, 30, 100)]
        assert list(line.x) == [10, 30, 100]
        np.testing.assert_allclose(line.y, expected, rtol=1e-6)
        (points,) = drawn[f"{model}, seed"]
        np.testing.assert_allclose(sorted(points.y), sorted(cells[cells.model == model][column]), rtol=1e-6)
    np.testing.assert_allclose(drawn["constant u, v, r"][0].y, floor, rtol=1e-6)


def test_a_failed_size_leaves_a_gap(simulation):
    cells = simulation.cells.copy()
    failed = (cells.model == "high-1") & (cells.N_D == 30)
    cells.loc[failed, ["H", "H_90", "rms"]] = np.nan
    cells.loc[failed, "status"] = "diverged"
    figure = gain(replace(simulation, cells=cells))
    (line,) = traces(figure, "0-0")["high-1"]
    assert list(np.isfinite(line.y)) == [True, False, True]
    assert line.connectgaps is False
    assert "Not plotted: high-1 at N_D = 30 (diverged)" in figure.how


def test_a_seed_that_failed_is_distinguished_from_a_cell_that_failed(simulation):
    cells = simulation.cells.copy()
    failed = cells.model.eq("high-1") & cells.N_D.eq(30) & cells.seed.eq(1)
    cells.loc[failed, ["H", "H_90", "rms"]] = np.nan
    cells.loc[failed, "status"] = "diverged"
    assert "high-1 at N_D = 30 (diverged, 1 of 2 seeds)" in gain(replace(simulation, cells=cells)).how


def test_a_logarithmic_axis_is_offered(simulation):
    figure = gain(simulation)
    kinds = [figure.views[view][0].figure.layout.yaxis.type for view in ("0-0", "0-1")]
    assert kinds == [None, "log"]
    ticks = figure.views["0-1"][0].figure.layout.yaxis
    powers = [re.sub(r"^10(?=\D|[⁰-⁹¹²³])", "1 × 10", word) for word in ticks.ticktext]
    written = [float(word.replace(" × 10", "e").translate(LOWERED)) for word in powers]
    assert written == list(ticks.tickvals)


def test_of_many_models_some_have_a_line(simulation):
    """41 lines are not told apart; those drawn are spread over A, with the best in validation and the rival."""
    mine = [frame[frame.model.eq("high-1")] for frame in (simulation.models, simulation.cells)]
    names = [f"f{k:02d}" for k in range(41)]
    many = [pd.concat([one.assign(model=n, family=n, A=1.0 + k) for k, n in enumerate(names)]) for one in mine]
    pure = [frame[frame.model.eq("no physics")] for frame in (simulation.models, simulation.cells)]
    models, cells = (pd.concat(pair, ignore_index=True) for pair in zip(many, pure, strict=True))
    figure = gain(replace(simulation, models=models, cells=cells, best="f02"))
    drawn = [name for name in traces(figure, "0-0") if name.startswith("f") and "seed" not in name]
    assert len(drawn) == 13
    assert {"f00", "f02", "f40"} <= set(drawn)
    assert {chip.key for chip in figure.chips} == {*(f"model:{name}" for name in drawn), "model:no physics", "naive"}
    words = (
        "Of 41 models with physics, 13 have a line: some spread over A and the best in validation; the others are in"
    )
    assert words in figure.how
    assert "have a line" not in gain(simulation).how


def test_errors_far_apart_begin_on_a_logarithmic_axis(simulation):
    cells = simulation.cells
    far = cells.assign(H=cells.H.where(cells.model.ne("no physics"), 50.0))
    starts = [gain(replace(simulation, cells=one)).controls[1].start for one in (cells, far)]
    assert starts == [0, 1]


def test_takeaway_speaks_of_the_best_in_validation_and_its_rival(simulation):
    cells = simulation.cells
    means = cells[cells.N_D == 10].groupby("model").H.mean()
    text = gain(simulation).takeaway
    assert f'At N_D = 10, nominal has H = {means["nominal"]:.2f} m and "no physics" has H = ' in text
    assert f"has H = {means['no physics']:.2f} m; at N_D = 100, " in text
    assert text.endswith("nominal is the best in validation.")


def test_data_driven_is_thick_ink_and_accuracy_is_ordered_colour(simulation):
    drawn = {name: lines[0] for name, lines in traces(gain(simulation), "0-0").items()}
    assert drawn["no physics"].line.color == "var(--ink)"
    assert drawn["no physics"].line.width > drawn["nominal"].line.width
    models = ["nominal", "moderate-1", "moderate-2", "moderate-3", "high-1", "high-2"]
    levels = [int(drawn[name].line.color.removeprefix("var(--scale-").rstrip(")")) for name in models]
    assert levels == sorted(levels)
    assert levels[0] == 0
    assert levels[-1] == 23


def test_one_size_is_a_dumbbell(full_scale):
    figure = gain(full_scale)
    drawn = traces(figure, "0")
    bar, before, after = drawn["inaccurate"]
    np.testing.assert_allclose(bar.x, [5.2, 2.05], rtol=1e-6)
    assert (before.x[0], after.x[0]) == pytest.approx((5.2, 2.05))
    assert before.marker.symbol == "circle-open"
    assert after.marker.symbol == "circle"
    assert figure.takeaway == (
        "accurate (Gunnerus, 28.9 m), best in validation, has H = 0.94 m; compensation improves 2 of 2 physics models; "
        '"no physics" has H = 4.30 m; constant u, v, r 5.01 m.'
    )


def test_without_a_result_of_physics_nothing_is_counted(full_scale):
    cells = full_scale.cells.copy()
    lost = cells.family.ne("none")
    cells.loc[lost, ["H", "H_90", "rms"]] = np.nan
    cells.loc[lost, "status"] = "failed"
    text = gain(replace(full_scale, cells=cells, best="")).takeaway
    assert text.startswith('No physics model has a result with data; "no physics" has H = 4.30 m;')


def test_a_failed_model_keeps_its_physics_and_shows_no_result(full_scale):
    figure = gain(full_scale)
    plot = figure.views["0"][0].figure
    drawn = [t for t in plot.data if t.name.startswith("bare hull")]
    assert [np.isfinite(np.asarray(t.x)).tolist() for t in drawn] == [[True, False], [True], [False]]
    (text,) = (a.text for a in plot.layout.annotations if "bare hull" in a.text)
    assert "6.40 m → no result" in text
    assert "<script>" not in text


def test_why_nothing_is_drawn_is_named(simulation):
    """Where nothing learns, it was said that there were no rows."""
    physics = simulation.cells[simulation.cells.family.ne("none")]
    alike = physics.assign(H=physics.A, status="ok")
    still = replace(simulation, cells=alike, alone=set(alike.model))
    moving = replace(still, cells=alike.assign(H=alike.A + alike.N_D))  # as of physics that each cell identifies
    reasons = {"it needs rows of cells": replace(simulation, cells=physics[:0]), "no method learns from data": still}
    for reason, content in reasons.items():
        assert gain(content) is None
        assert lack(content).startswith(reason)
    with pytest.raises(
        ShipidError, match=r"gain: there is nothing to draw: no method learns from data, so that every H"
    ):
        standalone("gain", still)
    for content in (simulation, moving):
        assert gain(content) is not None
        assert lack(content) == ""
