"""How Sphinx builds the site. Nothing is fetched: equations are MathML with a font in `_static`."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from pages import commands_page, mapping_page, python_page, study_page, vessel_page  # noqa: E402
from paper_grid import figures_page  # noqa: E402
from pictures import PLOTLY  # noqa: E402
from records import unsupported  # noqa: E402

from shipid import __version__  # noqa: E402

project = "shipid"
author = "The shipid developers"
release = version = __version__
copyright = author

MADE = {
    "reference-python": python_page,
    "keys-study": study_page,
    "keys-vessel": vessel_page,
    "keys-mapping": mapping_page,
    "options": commands_page,
    "paper-grid": figures_page,
}

extensions = ["myst_nb"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 4
nb_execution_mode = "off"  # notebooks are stored with their results; tests execute them
exclude_patterns = ["_build", "README.md"]

html_theme = "furo"
html_title = "shipid"
html_static_path = ["_static", str(PLOTLY)]  # with what draws the figures of the reports
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
html_math_renderer = "mathml"
pygments_style = "default"
pygments_dark_style = "github-dark"


DOT = re.compile(r'<mover accent="true">(\s*<mi>[^<]*</mi>\s*<mo stretchy="false">\u02d9<)')
"""A dot over a letter: as an accent it would touch the letter."""


def mathml(translator: object, node: nodes.math | nodes.math_block) -> None:
    """Write an equation as MathML, which browsers typeset themselves."""
    block = isinstance(node, nodes.math_block)
    try:
        text = tex2mathml(node.astext(), as_block=block)
        text = DOT.sub(r"<mover>\1", text)
    except MathError as error:
        logging.getLogger(__name__).warning("equation: %s: %s", error, node.astext(), location=node)
        text = translator.encode(node.astext())
    translator.body.append(f'<div class="math">{text}</div>\n' if block else text)
    raise nodes.SkipNode


def write_pages(_: Sphinx) -> None:
    """Write the pages that are made from the code; a page that is the same is not written again."""
    folder = HERE / "generated"
    folder.mkdir(exist_ok=True)
    for name, page in MADE.items():
        file, text = folder / f"{name}.md", page()
        if not file.is_file() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def check_numbers(_: Sphinx, page: str, source: list[str]) -> None:
    """Warn of each number that a page quotes from a record which does not hold it."""
    for fault in unsupported(source[0]):
        logging.getLogger(__name__).warning(fault, location=page)


def setup(app: Sphinx) -> None:
    """Register what this site adds to Sphinx."""
    app.add_html_math_renderer("mathml", (mathml, None), (mathml, None))
    app.connect("builder-inited", write_pages)
    app.connect("source-read", check_numbers)
