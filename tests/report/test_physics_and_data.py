import itertools
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid.report.content import AnswerSentence
from shipid.report.figure import PageFigure
from shipid.report.physics_and_data import gain_figure, gain_lack, map_figure, map_lack
from shipid.report.wording import metres_text
from tests.report.views import first_panel, views


@pytest.fixture(scope="module")
def failing(simulation):
    """The simulation with one cell without result and one seed without."""
    cells = simulation.cells.copy()
    gone = cells.model.eq("high-2") & (cells.N_D.eq(10) | (cells.N_D.eq(30) & cells.seed.eq(1)))
    cells.loc[gone, ["H", "H_90", "rms"]] = np.nan
    cells.loc[gone, ["status", "sentence"]] = "diverged", "4 % of the <windows> diverged"
    return replace(simulation, cells=cells)


def flat(content):
    return first_panel(map_figure(content))


def test_every_cell_lies_at_its_accuracy_and_size(simulation):
    bars = flat(simulation).data[0]
    assert len(bars.x) == 7 * 3 + 6, "and the physics alone"
    where = {}
    for x, y, base, words in zip(bars.x, bars.y, bars.base, bars.customdata, strict=True):
        where[re.match(r"<b>(.*?)</b>", words)[1], x] = (base, base + y, words)
    for row in simulation.models.itertuples():
        for size in (10, 30, 100):
            low, high, words = where[row.model, str(size)]
            if np.isfinite(row.A):
                assert low < np.sqrt(row.A) < high
                assert "the physics alone" in where[row.model, "0"][2]
            cells = simulation.cells[simulation.cells.model.eq(row.model) & simulation.cells.N_D.eq(size)]
            assert f"H {cells.H.mean():.2f} m, H_90 {cells.H_90.mean():.2f} m" in words
    assert min(low for (name, _), (low, _, _) in where.items() if name == "no physics") > np.sqrt(13.0)
    least, ends = min(bars.base), flat(simulation).layout.yaxis.range
    assert ends[0] < least < ends[0] + 0.05 * (ends[1] - ends[0]), "from the least A on"
    assert list(flat(simulation).layout.xaxis.categoryarray) == ["0", "10", "30", "100"]
    numbers = flat(simulation).data[3]
    assert numbers.text[0] == "0.90"
    assert numbers.textfont.color[0].startswith("var(--on-heat-")


@pytest.mark.parametrize("seed", range(4))
def test_rows_of_nearly_equal_A_are_legible_and_in_order(simulation, seed):
    """By drawn A, some nearly equal: every row has room for its number, and rows rise with A."""
    rng = np.random.default_rng(seed)
    names = [f"m-{number}" for number in range(12)]
    A = np.sort(rng.choice([1.0, 1.001, 2.5, 9.0, 9.01, 20.0], len(names)) * rng.uniform(1.0, 1.002, len(names)))
    frames = {}
    for key, every in (("cells", simulation.cells), ("models", simulation.models)):
        one, pure = every[every.model.eq("moderate-1")], every[every.A.isna()]
        many = [one.assign(model=name, A=a) for name, a in zip(names, A, strict=True)]
        frames[key] = pd.concat([*many, pure], ignore_index=True)
    panel = flat(replace(simulation, **frames))
    bars = panel.data[0]
    high = (580 - panel.layout.margin.t - panel.layout.margin.b) / np.ptp(panel.layout.yaxis.range)
    assert min(bars.y) * high > 14
    of = {re.match(r"<b>(.*?)</b>", words)[1]: base for words, base in zip(bars.customdata, bars.base, strict=True)}
    assert [of[name] for name in names] == sorted(of[name] for name in names)
    assert any("m-0" in note.text for note in panel.layout.annotations)


def test_rows_do_not_cover_each_other(simulation):
    bars = flat(simulation).data[0]
    edges = sorted({(base, base + y) for y, base in zip(bars.y, bars.base, strict=True)})
    assert all(below[1] <= above[0] + 1e-3 for below, above in itertools.pairwise(edges))


def test_what_is_no_better_than_data_driven_is_hatched(simulation):
    means = simulation.cells.groupby(["model", "N_D"]).H.mean().unstack()
    worse = (means.drop("no physics") >= means.loc["no physics"]).sum().sum()
    hatched = flat(simulation).data[1]
    assert worse > 0
    assert len(hatched.x) == worse
    assert hatched.marker.pattern.shape == "/"


def test_a_failed_cell_is_a_cross(failing):
    figure = flat(failing)
    bars, _, crosses = figure.data[:3]
    assert list(crosses.x) == ["10"]
    assert crosses.customdata[0].endswith("diverged: 4 % of the &lt;windows&gt; diverged")
    assert len(bars.x) == 20 + 6
    (words,) = (w for w in bars.customdata if "high-2" in w and "N_D = 30" in w)
    assert "1 of 2 seeds gave no result" in words
    assert "high-2 at N_D = 10 (diverged)" in map_figure(failing).how


def test_every_row_with_an_A_has_its_name_and_no_name_covers_another(simulation):
    figure, rows = flat(simulation), simulation.models
    names = [note for note in figure.layout.annotations if note.xref == "paper"]
    assert {note.text for note in names} == set(rows.model)
    top, high = np.ptp(figure.layout.yaxis.range), 580 - figure.layout.margin.t - figure.layout.margin.b
    heights = sorted(note.y * high / top for note in names)  # px
    assert min(b - a for a, b in itertools.pairwise(heights)) >= 12.99


def test_two_methods_on_the_same_physics_do_not_hide_each_other(simulation):
    names = simulation.cells.model.isin(["moderate-1", "moderate-2"])
    others = simulation.cells[names].assign(model=lambda cells: cells.model + " + alone", H=1.7)
    figure = map_figure(replace(simulation, cells=pd.concat([simulation.cells, others], ignore_index=True)))
    bars = first_panel(figure).data[0]
    assert len(bars.x) == 7 * 3 + 6
    assert min(bars.y) > 0.05
    assert not any("+ alone" in words for words in bars.customdata)
    assert (
        "Not on the map, where another method has their place: moderate-1 + alone and moderate-2 + alone." in figure.how
    )
    assert "another method" not in map_figure(simulation).how


@pytest.mark.parametrize(
    ("kept", "needs"),
    [
        (lambda cells: cells[:0], "rows of cells"),
        (lambda cells: cells[cells.N_D.eq(10)], "two N_D or more"),
        (lambda cells: cells[cells.model.isin(["nominal", "no physics"])], "two models with physics or more"),
        (lambda cells: cells.assign(A=np.nan), r"the column A \[m\], a number for two models"),
        (lambda cells: cells.assign(H=np.nan, status="failed"), "cells with a result"),
    ],
)
def test_what_a_map_lacks_is_named(simulation, kept, needs):
    """Every one of them was said to be `no rows`."""
    content = replace(simulation, cells=kept(simulation.cells))
    assert map_figure(content) is None
    assert re.match(f"it needs {needs}", map_lack(content))
    assert map_lack(simulation) == ""


@pytest.mark.parametrize("factor", [0.001, 1000.0])
def test_axes_have_ticks_at_any_size_of_error(simulation, factor):
    lengths = ["A", "A_90", "H", "H_90", "rms"]
    cells = simulation.cells.assign(**{name: factor * simulation.cells[name] for name in lengths})
    models = simulation.models.assign(A=factor * simulation.models.A)
    axis = flat(replace(simulation, cells=cells, models=models)).layout.yaxis
    assert len(axis.ticktext) >= 4
    np.testing.assert_allclose([float(word) ** 0.5 for word in axis.ticktext], axis.tickvals)


def traces(figure: PageFigure, view: str) -> dict[str, list]:
    """Traces of a view by name."""
    by_name: dict[str, list] = {}
    for trace in views(figure)[view][0].data:
        by_name.setdefault(trace.name, []).append(trace)
    return by_name


@pytest.mark.parametrize(
    ("view", "column", "floor"),
    [("0-0", "H_end", 11.6), ("1-0", "H_end_90", 22.0), ("2-0", "H", 5.01), ("3-0", "H_90", 11.2), ("4-1", "rms", 6.3)],
)
def test_lines_are_means_over_seeds(simulation, view, column, floor):
    drawn = traces(gain_figure(simulation), view)
    cells = simulation.cells
    for model in cells.model.unique():
        (line,) = drawn[model]
        alone = cells[cells.model == model][column.replace("H", "A").replace("rms", "A_rms")].iloc[0]
        expected = [cells[(cells.model == model) & cells.N_D.eq(size)][column].mean() for size in (10, 30, 100)]
        assert list(line.x) == [0, 10, 30, 100]
        np.testing.assert_allclose(line.y, [alone, *expected], rtol=1e-6)
        (points,) = drawn[f"{model}, seed"]
        np.testing.assert_allclose(sorted(points.y), sorted(cells[cells.model == model][column]), rtol=1e-6)
    np.testing.assert_allclose(drawn["constant u, v, r"][0].y, floor, rtol=1e-6)


def test_a_logarithmic_axis_is_offered(simulation):
    figure = gain_figure(simulation)
    axes = [views(figure)[view][0].layout.yaxis for view in ("0-0", "0-1")]
    assert [(axis.type, axis.tickformat) for axis in axes] == [("log", "~g"), (None, None)], "Plotly writes 0.5 as 5"


def test_data_driven_is_thick_ink_and_accuracy_is_ordered_colour(simulation):
    drawn = {name: lines[0] for name, lines in traces(gain_figure(simulation), "0-0").items()}
    assert drawn["no physics"].line.color == "var(--ink)"
    assert drawn["no physics"].line.width > drawn["nominal"].line.width
    models = ["nominal", "moderate-1", "moderate-2", "moderate-3", "high-1", "high-2"]
    levels = [int(drawn[name].line.color.removeprefix("var(--scale-").rstrip(")")) for name in models]
    assert levels == sorted(levels)
    assert levels[0] == 0
    assert levels[-1] == 23
    dashes = {name: drawn[name].line.dash for name in models}
    assert dashes["moderate-1"] == dashes["moderate-3"] != dashes["high-1"] == dashes["high-2"], "families are apart"


def test_a_single_size_begins_at_the_physics_alone(full_scale):
    """A at N_D = 0, H at the only N_D; a model without a result keeps its physics."""
    figure = gain_figure(full_scale)
    drawn = traces(figure, "2-0")
    bare = next(name for name in drawn if name.startswith("bare hull"))
    (one,), (failed,), (pure,) = (drawn[name] for name in ("inaccurate", bare, "no physics"))
    assert list(one.x) == [0, 15]
    np.testing.assert_allclose(one.y, [5.2, 2.05], rtol=1e-6)
    assert np.isfinite(failed.y).tolist() == [True, False]
    assert np.isfinite(pure.y).tolist() == [False, True]


def test_a_figure_says_what_the_answer_says_by_it(simulation):
    """One report gave three verdicts on the same cells, by means and by tests."""
    said = [AnswerSentence(f"{words}, {figure}.", figure) for figure in ("gain", "map") for words in ("First", "Next")]
    told, bare = replace(simulation, answer=said), replace(simulation, answer=())
    assert (map_figure(told).takeaway, gain_figure(told).takeaway) == ("First, map.", "First, gain.")
    good = simulation.cells[simulation.cells.H.notna()].groupby(["model", "N_D"], as_index=False).H.mean()
    least, most = (good.loc[good.H.agg(which)] for which in ("idxmin", "idxmax"))
    assert map_figure(bare).takeaway == (
        f"H runs from {metres_text(least.H)} ({least.model}, N_D = {least.N_D}) to "
        f"{metres_text(most.H)} ({most.model}, N_D = {most.N_D})."
    )


def test_why_nothing_is_drawn_is_named(simulation):
    """Where nothing learns, it was said that there were no rows."""
    physics = simulation.cells[simulation.cells.family.ne("none")]
    alike = physics.assign(H=physics.A, status="ok")
    still = replace(simulation, cells=alike, alone=set(alike.model))
    moving = replace(still, cells=alike.assign(H=alike.A + alike.N_D))  # as of physics that each cell identifies
    reasons = {"it needs rows of cells": replace(simulation, cells=physics[:0]), "no method learns from data": still}
    for reason, content in reasons.items():
        assert gain_figure(content) is None
        assert gain_lack(content).startswith(reason)
    for content in (simulation, moving):
        assert gain_figure(content) is not None
        assert gain_lack(content) == ""
