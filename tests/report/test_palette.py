import re
from dataclasses import replace

import numpy as np
import pandas as pd

from shipid.report.figure import colour_level, page_colours
from shipid.report.selection import accuracy_range, close_styles, model_styles


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2."""
    parts = re.findall(r"\d+", colour) if colour.startswith("rgb") else [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (int(p) / 255 for p in parts)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def scale(dark: bool) -> list[float]:
    return [
        luminance(c)
        for c in [
            colour for name, colour in page_colours("dark" if dark else "light").items() if name.startswith("scale-")
        ]
    ]


def test_the_scale_is_ordered_and_has_contrast_on_both_pages():
    for dark, page in ((False, "#ffffff"), (True, "#12151a")):
        levels = scale(dark)
        assert len(levels) == 24
        assert levels == sorted(levels)
        paper = luminance(page)
        contrast = [(max(level, paper) + 0.05) / (min(level, paper) + 0.05) for level in levels]
        assert min(contrast) > 2


def test_named_colours_are_distinct_and_the_first_has_most_contrast():
    for dark, page in ((False, "#ffffff"), (True, "#12151a")):
        named = [page_colours("dark" if dark else "light")[f"category-{i}"] for i in range(6)]
        assert len(set(named)) == 6
        paper = luminance(page)
        first = luminance(named[0])
        assert (max(first, paper) + 0.05) / (min(first, paper) + 0.05) >= 4.5


def test_few_models_have_names_many_have_a_scale(simulation, full_scale):
    assert accuracy_range(full_scale) is None
    assert accuracy_range(simulation) == (0.9, 13.0)
    colours = [style.colour for style in model_styles(full_scale).values()]
    assert len(set(colours)) == len(colours)
    symbols = {name.split("-")[0]: style.symbol for name, style in model_styles(simulation).items()}
    assert len(set(symbols.values())) == len(symbols)


def test_errors_of_a_model_ship_have_colours():
    """A scale from 0.1 mm to 10 km, and one whose first value is that of an exact model."""
    decades = [colour_level(10.0**k, (1e-4, 1e4)) for k in range(-4, 5)]
    assert decades[0] == 0
    assert decades[-1] == 23
    assert min(np.diff(decades)) >= 2
    assert colour_level(4e-4, (2e-4, 8e-4)) == 12
    for exact in (0.0, 1e-15):
        assert [colour_level(value, (exact, 10.0)) for value in (exact, 0.1, 10.0)] == [0, 12, 23]
    assert colour_level(0.0, (0.0, 0.0)) == 0


def test_methods_on_one_model_and_models_without_physics_have_markers_of_their_own(simulation):
    cells, pure = simulation.cells, simulation.cells.model.eq("no physics")
    more = [cells[cells.model.eq("high-1")].assign(model="high-1 + alone")]
    more += [cells[pure].assign(model=f"none + {name}") for name in ("plain", "forest", "step")]
    looks = model_styles(replace(simulation, cells=pd.concat([cells, *more], ignore_index=True)))
    drawn = [(look.colour, look.symbol) for name, look in looks.items() if name.startswith(("high-1", "no"))]
    assert len(drawn) == 1 + 6  # nominal
    assert len(set(drawn)) == len(drawn)


def test_models_of_many_families_are_told_apart_in_close_ups(simulation):
    mine = [frame[frame.model.eq("high-1")] for frame in (simulation.models, simulation.cells)]
    many = [pd.concat([frame.assign(model=f"m-{i:02d}", family=f"m-{i:02d}") for i in range(36)]) for frame in mine]
    looks = close_styles(replace(simulation, models=many[0], cells=many[1], best="m-00"))
    assert len(looks) == len({(look.colour, look.symbol) for look in looks.values()}) == 36
