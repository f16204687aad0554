import re

from shipid.report.figure import page_colours
from shipid.report.selection import accuracy_range, model_styles


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
