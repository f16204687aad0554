"""Put the figures and tables into one file that needs nothing else."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup
from plotly.io.json import to_json_plotly

from shipid.errors import ResultError
from shipid.files import write_text
from shipid.report.figure import PageFigure, Panel, page_colours
from shipid.report.glossary import mark_short_names
from shipid.report.section import OF_EVERY_PAGE, Section, declared_anchors, draw_sections
from shipid.report.tables import cell_html
from shipid.report.wording import number_text, set_sentence

FIRST_SENTENCES = 3  # sentences of the answer that a reader sees; the others unfold


def render_page(
    kind: str,
    sections: Mapping[str, Section],
    content: Any,
    windows: Mapping[str, Any] | None = None,
    say: Callable[[str], object] | None = None,
) -> str:
    """Write the sections that have something to show as one page of HTML.

    Parameters
    ----------
    kind : what kind of page it is, above the title.
    sections : registry of the page: id -> section, in order.
    content : `PageContent` with an `answer`; what `draw` of each section takes.
    windows : what page.js lets a reader browse, as `window_data` returns it.
    say : called with the heading of each section that is about to be drawn.

    Raises ValueError for a sentence that links to a figure which no section declares.
    """
    parts = draw_sections(sections, content, say)
    items = [item for part in parts for item in part.items]
    figures = [item for item in items if isinstance(item, PageFigure)]
    known = {item.id for item in items} | declared_anchors(sections)
    if unknown := {sentence.figure for sentence in content.answer} - known - {""}:
        raise ValueError(f"no figure is called {min(unknown)!r}; valid: {', '.join(sorted(known))}")
    return _template().render(
        content=content,
        kicker=kind,
        answer=content.answer[:FIRST_SENTENCES],
        details=content.answer[FIRST_SENTENCES:],
        warned=any(sentence.text.startswith("Careful: ") for sentence in content.answer[FIRST_SENTENCES:]),
        sections=parts,
        titles={name: name.capitalize() for name in OF_EVERY_PAGE} | {item.id: item.title for item in items},
        numbers={figure.id: i for i, figure in enumerate(figures, start=1)},
        views={figure.id: _draw_views(figure) for figure in figures if not figure.browser},
        windows=pack_text(json.dumps(windows, separators=(",", ":"), allow_nan=False)) if windows else "",
        palette={
            theme: Markup(" ".join(f"--{name}: {colour};" for name, colour in page_colours(theme).items()))
            for theme in ("light", "dark")
        },
        style=Markup(_resource("style.css")),
        script=Markup(_resource("page.js")),
        plotly=_plotly() if figures else None,
    )


def write_page(kind: str, sections: Mapping[str, Section], content: Any, file: Path) -> Path:
    """Write a page as one HTML file that makes no request; returns the file. Raises ResultError if it cannot."""
    return write_whole(render_page(kind, sections, content), file)


def write_whole(text: str, file: Path) -> Path:
    """Write text whole or not at all, making the folder if need be; ResultError if the place cannot be written."""
    try:
        write_text(file, text)
    except OSError as error:
        raise ResultError(f"cannot be written ({error.strerror})", file=file) from None
    return file


def _draw_views(figure: PageFigure) -> dict[str, Any]:
    """The panels of a figure for every choice of its controls, packed, and how many there are."""
    views = {}
    for places in product(*(range(len(control.options)) for control in figure.controls)):
        options = [control.options[place] for control, place in zip(figure.controls, places, strict=True)]
        views["-".join(map(str, places))] = figure.draw(*options)
    text = ",".join(f'"{key}":[{",".join(map(_panel_json, panels))}]' for key, panels in views.items())
    return {"packed": pack_text(f"{{{text}}}"), "panels": max(map(len, views.values()))}


def _panel_json(panel: Panel) -> str:
    """A panel as JSON; arrays of x and y, in single precision, as the typed arrays of Plotly."""
    data = [
        trace
        | {
            axis: {"dtype": "f4", "bdata": base64.b64encode(trace[axis].tobytes()).decode("ascii")}
            for axis in ("x", "y")
            if isinstance(trace.get(axis), np.ndarray)
        }
        for trace in panel["data"]
    ]
    return str(to_json_plotly({**panel, "data": data}))


def pack_text(text: str) -> Markup:
    """Compress a text (zlib, base64) for a script element: no character in it can end the element or start a tag."""
    return Markup(base64.b64encode(zlib.compress(text.encode(), 9)).decode("ascii"))


@cache
def _plotly() -> dict[str, Markup]:
    """Plotly, packed, and the notice of its authors and licence, which a reader of the file is to see."""
    script = _resource("vendor/plotly-cartesian.min.js")
    notice = script[script.index("/**") + 3 : script.index("*/")]
    return {"script": pack_text(script), "notice": Markup(notice.replace("--", "-").strip())}


@cache
def _template() -> Template:
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {
        "number": number_text,
        "bound": set_sentence,
        "glossed": mark_short_names,
        "cell": cell_html,
    }
    return environment.from_string(_resource("template.html.j2"))


def _resource(name: str) -> str:
    return files("shipid.report").joinpath(name).read_text(encoding="utf-8")
