import itertools
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid.report.error_map import error_map, lack


@pytest.fixture(scope="module")
def failing(simulation):
    """The simulation with one cell without result and one seed without."""
    cells = simulation.cells.copy()
    gone = cells.model.eq("high-2") & (cells.N_D.eq(10) | (cells.N_D.eq(30) & cells.seed.eq(1)))
    cells.loc[gone, ["H", "H_90", "rms"]] = np.nan
    cells.loc[gone, ["status", "sentence"]] = "diverged", "4 % of the <windows> diverged"
    return replace(simulation, cells=cells)


def flat(content):
    return error_map(content).views["0"][0].figure


def test_every_cell_lies_at_its_accuracy_and_size(simulation):
    bars = flat(simulation).data[0]
    assert len(bars.x) == 7 * 3
    where = {}
    for x, y, base, words in zip(bars.x, bars.y, bars.base, bars.customdata, strict=True):
        where[re.match(r"<b>(.*?)</b>", words)[1], x] = (base, base + y, words)
    for row in simulation.models.itertuples():
        for size in (10, 30, 100):
            low, high, words = where[row.model, size]
            if np.isfinite(row.A):
                assert low < np.sqrt(row.A) < high
            cells = simulation.cells[simulation.cells.model.eq(row.model) & simulation.cells.N_D.eq(size)]
            assert f"H {cells.H.mean():.2f} m, H_90 {cells.H_90.mean():.2f} m" in words
            assert f"{cells.H.min():.2f} to {cells.H.max():.2f} m over 2 seeds" in words
            assert "2 layers of 120" in words
    assert min(low for (name, _), (low, _, _) in where.items() if name == "no physics") > np.sqrt(13.0)
    assert list(flat(simulation).layout.yaxis.ticktext)[-1] == "no physics"
    assert flat(simulation).layout.yaxis.range[0] == 0


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
    assert (
        f"in {worse} of 18 cells with physics H is not below that of no physics, none of them below A = "
        in error_map(simulation).takeaway
    )


def test_colour_rises_with_the_error(simulation):
    bars = flat(simulation).data[0]
    H = [float(re.search(r"H ([\d.]+) m", words)[1]) for words in bars.customdata]
    shades = [int(re.search(r"\d+", colour)[0]) for colour in bars.marker.color]
    order = np.argsort(H)
    assert (np.diff(np.array(shades)[order]) >= 0).all()
    assert (min(shades), max(shades)) == (0, 23)


def test_a_failed_cell_is_a_cross_and_no_line_passes_it(failing):
    figure = flat(failing)
    bars, _, crosses = figure.data[:3]
    assert list(crosses.x) == [10]
    assert crosses.customdata[0].endswith("diverged: 4 % of the &lt;windows&gt; diverged")
    assert len(bars.x) == 20
    (words,) = (w for w in bars.customdata if "high-2" in w and "N_D = 30" in w)
    assert "1 of 2 seeds gave no result" in words
    # Between high-1 and high-2 the triangle at N_D = 10 has a corner without value.
    low, high = np.sqrt([7.5, 13.0])
    for line in figure.data[3:]:
        x, y = np.asarray(line.x), np.asarray(line.y)
        assert not ((x < 30) & (y > low + (high - low) * (x - 10) / 20 + 1e-4)).any()
    assert "high-2 at N_D = 10 (diverged)" in error_map(failing).how


def test_every_row_with_an_A_has_its_name_and_no_name_covers_another(simulation):
    figure, rows = flat(simulation), simulation.models[simulation.models.A.notna()]
    names = [note for note in figure.layout.annotations if note.xref == "paper"]
    assert {note.text for note in names} == set(rows.model)
    top, high = figure.layout.yaxis.range[1], 580 - figure.layout.margin.t - figure.layout.margin.b
    heights = sorted(note.y * high / top for note in names)  # px
    assert min(b - a for a, b in itertools.pairwise(heights)) >= 12.99


def test_names_of_many_rows_are_beside_their_cells(simulation):
    """Moved apart below the least A, the name of a model stood at an A that no model has."""
    models, cells = simulation.models, simulation.cells
    (model,), (cell, *_) = (frame[frame.model.eq("high-1")].to_dict("records") for frame in (models, cells))
    each = [{"model": f"m-{i}", "family": f"m-{i}", "A": 7.0 + 0.1 * i} for i in range(60)]
    many = [pd.DataFrame([{**row, **one} for one in each]) for row in (model, cell)]
    added = many[1].assign(N_D=30), many[1].assign(N_D=100)
    pure = [frame[frame.family.eq("none")] for frame in (models, cells)]
    content = replace(simulation, models=pd.concat([many[0], pure[0]]), cells=pd.concat([*added, pure[1]]))
    names = [note for note in flat(content).layout.annotations if note.xref == "paper"]
    places = {row["model"]: row["A"] ** 0.5 for row in each}
    line = 13 * flat(content).layout.yaxis.range[1] / (580 - 56)
    assert 6 < len(names) < 60
    assert all(abs(note.y - places[note.text]) < 1.5 * line for note in names)


def test_lines_carry_their_level_in_metres(simulation):
    figure = flat(simulation)
    texts = [note.text for note in figure.layout.annotations if note.xref != "paper"]
    assert texts
    assert all(re.fullmatch(r"[\d.]+ m", text) for text in texts)
    assert len(set(texts)) == len(texts)


def test_bars_stand_as_high_as_the_error(failing):
    """A box is its front, top and right side, then its side once more, shaded; what is nearer is drawn later."""
    traces = error_map(failing).views["1"][0].figure.data
    means = failing.cells.groupby(["model", "N_D"]).H.mean().dropna()
    bodies = [trace for trace in traces if trace.fill == "toself" and "var(--heat" in trace.fillcolor]
    crosses = [trace for trace in traces if trace.mode == "markers"]
    assert (len(bodies), len(crosses)) == (len(means), 1)
    heights = [np.asarray(body.y, dtype=float)[2] - np.asarray(body.y, dtype=float)[1] for body in bodies]
    np.testing.assert_allclose(np.sort(heights), np.sort(means), atol=2e-4)
    texts = [trace.text for trace in traces if trace.text]
    assert "N_D = 10:" in texts[0]
    assert "N_D = 100:" in texts[-1]


def test_the_front_row_stands_on_the_axis_and_no_bar_is_cut(simulation):
    """Its fronts began below 0, where they were cut, and ended below H by 4 % of the greatest."""
    figure = error_map(simulation).views["1"][0].figure
    sides = [trace for trace in figure.data if trace.text and "N_D = 100" in trace.text]
    assert len(sides) == simulation.cells.model.nunique()
    for side in sides:
        (H,) = re.findall(r"H ([\d.]+) m", side.text)
        corners = np.asarray(side.y, dtype=float)
        np.testing.assert_allclose(corners[[0, 3]], [0, float(H)], atol=0.006)
    tops = [np.nanmax(np.asarray(trace.y, dtype=float)) for trace in figure.data]
    low, high = figure.layout.yaxis.range
    assert low == 0
    assert max(tops) < high
    assert figure.layout.xaxis.ticktext[-1] == "no physics"


def test_sides_of_the_bars_have_units(simulation):
    layout = error_map(simulation).views["1"][0].figure.layout
    assert (layout.xaxis.title.text, layout.yaxis.title.text) == ("models by A [m]", "H, front row [m]")
    assert layout.yaxis.range[0] == 0
    assert {note.text for note in layout.annotations} == {"N_D = 10", "N_D = 30", "N_D = 100"}


def test_two_methods_on_the_same_physics_do_not_hide_each_other(simulation):
    names = simulation.cells.model.isin(["moderate-1", "moderate-2"])
    others = simulation.cells[names].assign(model=lambda cells: cells.model + " + alone", H=1.7)
    figure = error_map(replace(simulation, cells=pd.concat([simulation.cells, others], ignore_index=True)))
    bars = figure.views["0"][0].figure.data[0]
    assert len(bars.x) == 7 * 3
    assert min(bars.y) > 0.05
    assert not any("alone" in words for words in bars.customdata)
    assert (
        "Not on the map, where another method has their place: moderate-1 + alone and moderate-2 + alone." in figure.how
    )
    assert figure.takeaway.endswith(" Of several methods, the first is drawn.")
    assert "another method" not in error_map(simulation).how
    assert "Of several methods" not in error_map(simulation).takeaway
    both = pd.concat([simulation.cells.assign(method="learned"), others.assign(method="alone")], ignore_index=True)
    assert error_map(replace(simulation, cells=both)).takeaway.endswith(" Of several methods, learned is drawn.")


def test_rows_of_one_method_alone_are_named_without_it(simulation):
    """Names of twelve characters were the same `moder… drawn` in every row."""
    plain = [note.text for note in flat(simulation).layout.annotations if note.xref == "paper"]
    cells, models = (frame.assign(model=frame.model + " + drawn") for frame in (simulation.cells, simulation.models))
    layout = flat(replace(simulation, cells=cells, models=models)).layout
    assert [note.text for note in layout.annotations if note.xref == "paper"] == plain
    assert layout.yaxis.ticktext == flat(simulation).layout.yaxis.ticktext


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
    assert error_map(content) is None
    assert re.match(f"it needs {needs}", lack(content))
    assert lack(simulation) == ""


@pytest.mark.parametrize("factor", [0.001, 0.02, 1.0, 1000.0])
def test_axes_have_ticks_at_any_size_of_error(simulation, factor):
    lengths = ["A", "A_90", "H", "H_90", "rms"]
    cells = simulation.cells.assign(**{name: factor * simulation.cells[name] for name in lengths})
    models = simulation.models.assign(A=factor * simulation.models.A)
    views = error_map(replace(simulation, cells=cells, models=models)).views
    axis = views["0"][0].figure.layout.yaxis
    words = [word for word in axis.ticktext if word != "no physics"]
    assert len(words) >= 4
    np.testing.assert_allclose([float(word) ** 0.5 for word in words], axis.tickvals[: len(words)])
    heights = views["1"][0].figure.layout.yaxis.tickvals
    assert 3 <= len(heights) <= 7
    assert len(set(heights)) == len(heights)


def test_names_of_lines_are_apart(simulation):
    rng = np.random.default_rng(0)
    for _ in range(20):
        errors = dict.fromkeys(zip(simulation.cells.model, simulation.cells.N_D, strict=True))
        errors = {key: float(np.exp(rng.normal())) for key in errors}
        pairs = zip(simulation.cells.model, simulation.cells.N_D, strict=True)
        figure = flat(replace(simulation, cells=simulation.cells.assign(H=[errors[pair] for pair in pairs])))
        lines = np.concatenate([np.column_stack([t.x, t.y]) for t in figure.data if t.meta == ("iso",)])
        span = np.ptp(lines, axis=0)
        places = [np.array([note.x, note.y]) / span for note in figure.layout.annotations if note.xref != "paper"]
        assert len(places) > 2
        assert min(np.hypot(*(a - b)) for a, b in itertools.combinations(places, 2)) > 0.15


def test_of_several_models_without_physics_the_rival_has_its_name(simulation):
    """Another may err less than all models with physics: H is not below that of every no physics model."""
    better = simulation.cells[simulation.cells.model.eq("no physics")].assign(model="none + plain", H=0.01)
    figure = error_map(replace(simulation, cells=pd.concat([simulation.cells, better], ignore_index=True)))
    assert "H is not below that of no physics" in figure.takeaway
    assert "Hatched: H is not below that of no physics at the same N_D." in figure.how


def test_a_map_of_physics_alone_speaks_of_no_rival_and_no_training(simulation):
    models, cells = (frame[frame.model.ne("no physics")] for frame in (simulation.models, simulation.cells))
    figure = error_map(replace(simulation, models=models, cells=cells))
    assert "Hatched" not in figure.how
    assert "trained" not in figure.how


def test_there_is_no_map_of_one_size_or_one_model(simulation, full_scale):
    assert error_map(full_scale) is None
    names = ["nominal", "no physics"]
    one = replace(
        simulation,
        cells=simulation.cells[simulation.cells.model.isin(names)],
        models=simulation.models[simulation.models.model.isin(names)],
    )
    assert error_map(one) is None
    assert error_map(replace(simulation, cells=simulation.cells.assign(H=np.nan, status="failed"))) is None


def test_without_data_driven_nothing_is_compared(simulation):
    kept = simulation.cells.model.ne("no physics")
    figure = error_map(
        replace(simulation, cells=simulation.cells[kept], models=simulation.models[simulation.models.family != "none"])
    )
    assert "not below that of" not in figure.takeaway
    assert len(figure.views["0"][0].figure.data[1].x) == 0


def test_a_model_without_accuracy_has_a_separate_strip(simulation):
    lost = simulation.models.A.where(simulation.models.model != "high-2")
    cells = simulation.cells.assign(A=simulation.cells.A.where(simulation.cells.model != "high-2"))
    figure = flat(replace(simulation, models=simulation.models.assign(A=lost), cells=cells))
    assert set(figure.layout.yaxis.ticktext) >= {"no physics", "high-2"}
    assert len(figure.data[0].x) == 21


def test_bands_of_lines_of_equal_error_hold_the_lines(simulation):
    """An interval about H moves every line towards both sides; without intervals there is no band."""
    means = simulation.cells.groupby(["model", "N_D"], as_index=False).H.mean()
    wide = means.assign(low=0.8 * means.H, high=1.25 * means.H)
    plain, banded = (flat(replace(simulation, frames=frames)) for frames in ({}, {"intervals": wide}))
    assert not [trace for trace in plain.data if trace.meta == ("bounds",)]
    lines = [trace for trace in banded.data if trace.meta == ("iso",)]
    bounds = [trace for trace in banded.data if trace.meta == ("bounds",)]
    assert bounds
    for level in {trace.name for trace in lines}:
        at = np.concatenate([trace.y for trace in lines if trace.name == level])
        sides = [np.nanmean(trace.y) for trace in bounds if trace.name == level]
        if len(sides) == 2:
            assert min(sides) < np.nanmean(at) < max(sides)
    narrow = flat(replace(simulation, frames={"intervals": means.assign(low=means.H, high=means.H)}))
    same = [trace for trace in narrow.data if trace.meta == ("bounds",)]
    assert len(same) == 2 * len(lines) // 2


def test_a_dotted_line_is_of_a_level_that_has_a_line(simulation):
    """Else a reader takes the dotted line of 1.5 m for the end of the interval of the line of 1 m."""
    means = simulation.cells.groupby(["model", "N_D"], as_index=False).H.mean()
    corner = simulation.cells.model.eq("high-1") & simulation.cells.N_D.eq(10)
    one_cell = simulation.cells.assign(H=np.where(corner, 8.0, 1.0))  # the lines around it are too short to be drawn
    ends = means.assign(low=means.H / means.H.median(), high=means.H / means.H.median() * 1.4)
    drawn = flat(replace(simulation, cells=one_cell, frames={"intervals": ends})).data
    names = {kind: {trace.name for trace in drawn if trace.meta == (kind,)} for kind in ("iso", "bounds")}
    assert not names["iso"]
    assert not names["bounds"]


def test_too_few_test_manoeuvres_give_no_band(simulation):
    means = simulation.cells.groupby(["model", "N_D"], as_index=False).H.mean()
    blank = replace(simulation, frames={"intervals": means.assign(low=np.nan, high=np.nan)})
    assert not [trace for trace in flat(blank).data if trace.meta == ("bounds",)]
    assert "95 % interval" not in error_map(blank).how
