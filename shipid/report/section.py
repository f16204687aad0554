"""Sections of a page: the parts of the content that each needs, and how it is drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import dataclass
from typing import Any

from shipid.report.figure import PageFigure
from shipid.report.tables import PageTable

Item = PageFigure | PageTable
OF_EVERY_PAGE = ("findings", "provenance")  # ids that the template itself makes


@dataclass(frozen=True)
class Section:
    """A section of a page, as a registry such as `sections.SECTIONS` holds it.

    Parameters
    ----------
    title : heading.
    draw : content of the page -> figures and tables in order; None in place of one that has nothing to show.
    needs : names of parts of the content (fields, or keys of its `frames`). The section is left out where one of them
        is absent or empty.
    anchors : ids of the figures and tables that `draw` may return; a sentence may link to each of them.
    """

    title: str
    draw: Callable[[Any], Sequence[Item | None]]
    needs: Sequence[str] = ()
    anchors: Sequence[str] = ()


@dataclass(frozen=True)
class DrawnSection:
    """A section ready for the page: its id, its heading, its figures and tables."""

    id: str
    title: str
    items: Sequence[Item]


def declared_anchors(sections: Mapping[str, Section]) -> set[str]:
    """Ids that a sentence of a page with these sections may link to."""
    return {anchor for section in sections.values() for anchor in section.anchors} | set(OF_EVERY_PAGE)


def draw_sections(
    sections: Mapping[str, Section], content: object, say: Callable[[str], object] | None = None
) -> list[DrawnSection]:
    """Draw the sections that have something to show, in the order of the registry.

    say : called with the heading of each before it is drawn.
    """
    result = []
    for name, section in sections.items():
        if not all(_has_part(content, need) for need in section.needs):
            continue
        if say is not None:
            say(f"drawing: {section.title}")
        items = [item for item in section.draw(content) if item is not None]
        if items:
            result.append(DrawnSection(name, section.title, items))
    return result


def _has_part(content: object, name: str) -> bool:
    """Whether the content has a field of that name, or an entry of `frames`, that is not empty."""
    value = getattr(content, name, getattr(content, "frames", {}).get(name))
    return value is not None and not (isinstance(value, Sized) and len(value) == 0)
