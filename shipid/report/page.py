"""Put the figures and tables into one file that needs nothing else."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from shipid.errors import ResultError
from shipid.report import error_map, errors_over, factors, gain, logs, palette, paths, search, tables
from shipid.report.content import Finding, ReportContent, Sentence
from shipid.report.figure import Figure
from shipid.report.tables import Table
from shipid.report.wording import bound, number


@dataclass(frozen=True)
class Section:
    """A heading of the page with its figures and tables; one without any is left out."""

    id: str
    title: str
    items: tuple[Figure | Table | None, ...]


def sections(content: ReportContent) -> list[Section]:
    """Follow the storyboard; a new figure is one more entry here."""
    listing = [
        Section("results", "What physics and data buy", (error_map.error_map(content), gain.gain(content))),
        Section("errors", "Where the error grows", (errors_over.horizon(content), errors_over.over_time(content))),
        Section("predictions", "The predictions", (paths.browser(content), paths.snapshots(content))),
        Section("the-models", "The models", (factors.factors(content), tables.models(content))),
        Section(
            "data",
            "The data",
            (logs.manoeuvres(content), logs.envelope(content), tables.envelope(content), tables.repairs(content)),
        ),
        Section("the-search", "The search", (search.search(content), search.table(content))),
        Section("all-cells", "The cells", (tables.cells(content),)),
    ]
    return [section for section in listing if any(section.items)]


class Shown(Protocol):
    """What every page says beside its sections."""

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
        """What reproduces the page; empty for none."""
        ...


def render(content: ReportContent) -> str:
    """Write the page of a study as text."""
    windows = paths.window_data(content) if content.snapshots else None
    return page(content, sections(content), "study", windows)


def page(content: Shown, parts: Sequence[Section], kicker: str, windows: dict[str, Any] | None = None) -> str:
    """Write sections as one page: `kicker` says above the title what it is; `windows` is what page.js browses."""
    anchors = {item.id for section in parts for item in section.items if item} | {"findings", "provenance"}
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"number": number, "bound": bound}
    template = environment.from_string(_resource("template.html.j2"))
    return template.render(
        content=content,
        kicker=kicker,
        sections=parts,
        anchors=anchors,
        numbers={item.id: i for i, item in enumerate(_figures(parts), start=1)},
        views={item.id: _embedded(_views(item)) for item in _figures(parts)},
        fixed={
            item.id: _embedded(paths.fixed_data(item.windows, windows))
            for item in _figures(parts)
            if item.windows and windows
        },
        windows=_embedded(windows) if windows else "",
        palette={"light": Markup(palette.variables(dark=False)), "dark": Markup(palette.variables(dark=True))},
        style=Markup(_resource("style.css")),
        script=Markup(_resource("page.js")),
        plotly=Markup(get_plotlyjs()),
    )


def write_report(content: ReportContent, file: Path) -> Path:
    """Write the report as one HTML file that makes no request; returns the file. Raises ResultError if it cannot."""
    return write(render(content), file)


def write(text: str, file: Path) -> Path:
    """Write text, making the folder if need be; ResultError if the place cannot be written."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise ResultError(f"cannot be written ({error.strerror})", file=file) from None
    return file


def _figures(parts: Sequence[Section]) -> list[Figure]:
    return [item for section in parts for item in section.items if isinstance(item, Figure)]


def _views(figure: Figure) -> dict[str, Any]:
    return {
        key: [
            {"data": spec["data"], "layout": spec["layout"]}
            for spec in (json.loads(p.figure.to_json()) for p in panels)
        ]
        for key, panels in figure.views.items()
    }


def _embedded(data: Any) -> Markup:
    """JSON inside a script element: no character in it can end the element or start a tag."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


def _resource(name: str) -> str:
    return files("shipid.report").joinpath(name).read_text(encoding="utf-8")
