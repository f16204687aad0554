"""Put the figures and tables into one file that needs nothing else."""

from __future__ import annotations

import base64
import json
import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup

from shipid.errors import ResultError
from shipid.files import write_text
from shipid.report import palette, paths
from shipid.report.content import Finding, ReportContent, Sentence
from shipid.report.figure import Figure
from shipid.report.glossary import glossed
from shipid.report.section import OF_EVERY_PAGE, Drawn, Section, declared, drawn
from shipid.report.sections import SECTIONS
from shipid.report.sketch import sketch
from shipid.report.tables import cell_html
from shipid.report.wording import bound, number

LEAD = 3  # sentences of the answer that a reader sees; the others unfold


class Shown(Protocol):
    """The parts of every page besides its sections."""

    @property
    def title(self) -> str:
        """Heading of the page."""
        ...

    @property
    def name(self) -> str:
        """Short name beside the kicker."""
        ...

    @property
    def answer(self) -> Sequence[Sentence]:
        """Sentences below the title."""
        ...

    @property
    def findings(self) -> Sequence[Finding]:
        """Claims with verdicts; empty for none."""
        ...

    @property
    def provenance(self) -> Mapping[str, str]:
        """Label -> value."""
        ...

    @property
    def study_document(self) -> str:
        """Document as text; empty for none."""
        ...

    @property
    def command(self) -> str:
        """The command that reproduces the page; empty for none."""
        ...


def render(content: ReportContent, say: Callable[[str], object] | None = None) -> str:
    """Write the page of a study as text."""
    windows = paths.window_data(content) if content.snapshots else None
    return page(content, SECTIONS, "study", windows, say)


def page(
    content: Shown,
    sections: Mapping[str, Section],
    kicker: str,
    windows: dict[str, Any] | None = None,
    say: Callable[[str], object] | None = None,
) -> str:
    """Write the sections that have something to show as one page of HTML.

    Parameters
    ----------
    content : what `draw` of each section takes.
    sections : registry of the page: id -> section, in order.
    kicker : what kind of page it is, above the title.
    windows : what page.js lets a reader browse, as `paths.window_data` returns it.
    say : called with the heading of each section that is about to be drawn.

    Raises ValueError for a sentence that links to a figure which no section declares.
    """
    parts = drawn(sections, content, say)
    anchors = {item.id for section in parts for item in section.items} | set(OF_EVERY_PAGE)
    _check_links(content.answer, anchors | declared(sections))
    titles = {"findings": "Findings", "provenance": "Provenance"}
    titles |= {item.id: item.title for section in parts for item in section.items}
    sentences = list(content.answer)
    return _template().render(
        content=content,
        kicker=kicker,
        answer=sentences[:LEAD],
        details=sentences[LEAD:],
        sections=parts,
        anchors=anchors,
        titles=titles,
        numbers={item.id: i for i, item in enumerate(_figures(parts), start=1)},
        views={item.id: packed(_json(_views(item))) for item in _figures(parts)},
        fixed={
            item.id: packed(_json(paths.fixed_data(item.windows, windows)))
            for item in _figures(parts)
            if item.windows and windows
        },
        sketches=_first_sketches(_figures(parts)),
        windows=packed(_json(windows)) if windows else "",
        palette={"light": Markup(palette.variables(dark=False)), "dark": Markup(palette.variables(dark=True))},
        style=Markup(_resource("style.css")),
        script=Markup(_resource("page.js")),
        plotly=_plotly() if any(_figures(parts)) else None,
    )


def _check_links(answer: Sequence[Sentence], known: set[str]) -> None:
    for sentence in answer:
        if sentence.figure and sentence.figure not in known:
            raise ValueError(f"no figure is called {sentence.figure!r}; valid: {', '.join(sorted(known))}")


def write_report(content: ReportContent, file: Path, say: Callable[[str], object] | None = None) -> Path:
    """Write the report as one HTML file that makes no request; returns the file. Raises ResultError if it cannot."""
    return write(render(content, say), file)


def write(text: str, file: Path) -> Path:
    """Write text whole or not at all, making the folder if need be; ResultError if the place cannot be written."""
    try:
        write_text(file, text)
    except OSError as error:
        raise ResultError(f"cannot be written ({error.strerror})", file=file) from None
    return file


def _figures(parts: Sequence[Drawn]) -> list[Figure]:
    return [item for section in parts for item in section.items if isinstance(item, Figure)]


def _views(figure: Figure) -> dict[str, Any]:
    return {
        key: [{"data": _plain(panel.plot.traces), "layout": _plain(panel.plot.layout)} for panel in panels]
        for key, panels in figure.views.items()
    }


def _plain(value: Any) -> Any:
    """Content of JSON as Plotly.js takes it: columns of numbers as bytes, and what is not finite as null."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind == "f":
        data = base64.b64encode(np.ascontiguousarray(value, dtype="<f4").tobytes()).decode("ascii")
        return {"dtype": "f4", "bdata": data}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _first_sketches(figures: Sequence[Figure]) -> dict[str, list[Markup]]:
    """Sketch of each panel of the first figure, by its id; empty where the page draws it from its windows."""
    for figure in figures[:1]:
        panels = figure.views.get("-".join(str(control.start) for control in figure.controls), ())
        return {figure.id: [sketch(panel.plot, figure.height) for panel in panels]}
    return {}


def packed(text: str) -> Markup:
    """Compress a text (zlib, base64) for a script element: no character in it can end the element or start a tag."""
    return Markup(base64.b64encode(zlib.compress(text.encode(), 9)).decode("ascii"))


def _json(data: Any) -> str:
    return json.dumps(data, separators=(",", ":"), allow_nan=False)


@cache
def _plotly() -> dict[str, Markup]:
    """Plotly, packed, and the notice of its authors and licence, which a reader of the file is to see."""
    script = _resource("vendor/plotly-cartesian.min.js")
    notice = script[script.index("/**") + 3 : script.index("*/")]
    return {"script": packed(script), "notice": Markup(notice.replace("--", "-").strip())}


@cache
def _template() -> Template:
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"number": number, "bound": bound, "glossed": glossed, "cell": cell_html}
    return environment.from_string(_resource("template.html.j2"))


def _resource(name: str) -> str:
    return files("shipid.report").joinpath(name).read_text(encoding="utf-8")
