"""Sections of a page, and the one file that needs nothing else into which they are put."""

from __future__ import annotations

import base64
import json
import re
import zlib
from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup, escape
from plotly.io.json import to_json_plotly

from shipid.files import write_text
from shipid.report.content import AnswerSentence
from shipid.report.figure import PageFigure, Panel, page_colours
from shipid.report.tables import PageTable, cell_html
from shipid.report.wording import number_text, set_sentence

Item = PageFigure | PageTable
OF_EVERY_PAGE = ("findings", "provenance")  # ids that the template itself makes
HEAD = "head"  # id of the section that stands beside the headline, without a heading
FIRST_SENTENCES, FIRST_WORDS = 3, 60  # of the answer that a reader sees at most; the others unfold


@dataclass(frozen=True)
class Section:
    """A section of a page, as a registry such as `sections.SECTIONS` holds it.

    items : id of a figure or table, to which a sentence may link -> what draws it from the content of the page, or
    returns None, and the part of the content (a field, or a key of its `frames`) without which it is left out.
    """

    title: str
    items: Mapping[str, tuple[Callable[[Any], Item | None], str]]

    def draw_item(self, name: str, content: object) -> Item | None:
        """Draw an item; None where the content lacks what it needs, or has nothing to show."""
        draw, need = self.items[name]
        return draw(content) if not need or _has_part(content, need) else None


@dataclass(frozen=True)
class DrawnSection:
    """A section ready for the page: its id, its heading, its figures and tables."""

    id: str
    title: str
    items: Sequence[Item]


def draw_sections(sections: Mapping[str, Section], content: object) -> list[DrawnSection]:
    """Draw the sections that have something to show, in order."""
    result = []
    for name, section in sections.items():
        items = [item for one in section.items if (item := section.draw_item(one, content)) is not None]
        result += [DrawnSection(name, section.title, items)] if items else []
    return result


def _has_part(content: object, name: str) -> bool:
    """Whether the content has a field of that name, or an entry of `frames`, that is not empty."""
    value = getattr(content, name, getattr(content, "frames", {}).get(name))
    return value is not None and not (isinstance(value, Sized) and len(value) == 0)


def split_answer(answer: Sequence[AnswerSentence]) -> tuple[Sequence[AnswerSentence], Sequence[AnswerSentence]]:
    """The headline, of a few sentences and words but one sentence at least, and the rest of an answer."""
    words = np.cumsum([len(sentence.text.split()) for sentence in answer[:FIRST_SENTENCES]])
    first = max(1, int((words <= FIRST_WORDS).sum()))
    return answer[:first], answer[first:]


def render_page(
    kind: str, sections: Mapping[str, Section], content: Any, windows: Mapping[str, Any] | None = None
) -> str:
    """Write the sections that have something to show as one page of HTML.

    kind : above the title. content : `PageContent` with an `answer`.
    windows : what page.js lets a reader browse, as `window_data` returns it.
    """
    parts = draw_sections(sections, content)
    items = [item for part in parts for item in part.items]
    figures = [item for item in items if isinstance(item, PageFigure)]
    headline, details = split_answer(content.answer)
    return _template().render(
        content=content,
        kicker=kind,
        answer=headline,
        details=details,
        warned=any(sentence.text.startswith("Careful: ") for sentence in details),
        head=[item for part in parts if part.id == HEAD for item in part.items],
        sections=[part for part in parts if part.id != HEAD],
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


def write_page(
    kind: str, sections: Mapping[str, Section], content: Any, file: Path, windows: Mapping[str, Any] | None = None
) -> Path:
    """Write a page as one HTML file that makes no request; returns the file. Raises OSError if it cannot."""
    write_text(file, render_page(kind, sections, content, windows))
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


MEANINGS = {
    "H_90": "90th percentile of the position error of the prediction [m]: nine errors in ten are smaller",
    "N_D": "number of recorded runs (manoeuvres) used to train and to validate",
    "H": "mean position error over the horizon, compensated or of no physics, over all tests [m], equation (15)",
    "A": "mean position error over the horizon of the physics alone, over all tests [m], equation (14)",
    "(11)": "equation (11): the frame with x ahead and y to starboard at the instant of prediction",
    "(14)": "equation (14): A, the mean distance between true and predicted places, physics alone",
    "(15)": "equation (15): H, the mean distance between true and predicted places, with compensation",
    "(16)": "equation (16): each derivative of the hull times a random factor",
}
# A and H are words, too ("A runs from"): a letter counts before = [ (, or after a small word, never at the start alone.
LETTER = r"(?<![\w.>-])(?:A|H)(?=\s(?:=|\[m\]|of\b|over\b|against\b|falls\b|rises\b|and\s[AH]\b|runs\s(?:from|over)))"
PATTERN = re.compile(rf"H_90|N_D(?![\w])|\((?:11|14|15|16)\)|{LETTER}")
AFTER = re.compile(r"\b(by|its|is|has|error|below|equal|along|less) (A|H)(?![\w-])")


def mark_short_names(text: str) -> Markup:
    """Escape a text and mark its short names with what they mean."""
    marked = PATTERN.sub(lambda match: _abbreviation(match[0]), str(escape(text)))
    return Markup(AFTER.sub(lambda match: f"{match[1]} {_abbreviation(match[2])}", marked))


def _abbreviation(name: str) -> str:
    return f'<abbr title="{escape(MEANINGS[name])}">{name}</abbr>'
