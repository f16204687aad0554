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

    title : heading.
    items : id of a figure or table, to which a sentence may link -> what draws it from the content of the page, or
        returns None where there is nothing to show, and the part of the content (a field, or a key of its `frames`)
        without which it is left out; empty for none.
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


def declared_anchors(sections: Mapping[str, Section]) -> set[str]:
    """Ids that a sentence of a page with these sections may link to."""
    return {name for section in sections.values() for name in section.items} | set(OF_EVERY_PAGE)


def draw_sections(
    sections: Mapping[str, Section], content: object, say: Callable[[str], object] | None = None
) -> list[DrawnSection]:
    """Draw the sections that have something to show, in order; `say` is called with the heading of each before."""
    result = []
    for name, section in sections.items():
        if say and any(not need or _has_part(content, need) for _, need in section.items.values()):
            say(f"drawing: {section.title}")
        items = [item for one in section.items if (item := section.draw_item(one, content)) is not None]
        result += [DrawnSection(name, section.title, items)] if items else []
    return result


def _has_part(content: object, name: str) -> bool:
    """Whether the content has a field of that name, or an entry of `frames`, that is not empty."""
    value = getattr(content, name, getattr(content, "frames", {}).get(name))
    return value is not None and not (isinstance(value, Sized) and len(value) == 0)
