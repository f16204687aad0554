from dataclasses import fields

import pytest

from shipid.report import ReportContent, checks, identification, manoeuvre
from shipid.report.section import drawn
from shipid.report.sections import SECTIONS
from shipid.study.contents import FRAMES
from tests.report import test_checks, test_identification, test_manoeuvre

PAGES = {
    "study": (SECTIONS, None),
    "check": (checks.SECTIONS, lambda: test_checks.content("log")),
    "identification": (identification.SECTIONS, test_identification.content),
    "manoeuvre": (manoeuvre.SECTIONS, lambda: test_manoeuvre.content("spiral")),
}


@pytest.mark.parametrize("page", PAGES)
def test_every_item_drawn_is_declared_and_no_id_twice(page, simulation_drawn):
    """What a section draws, its anchors name: a sentence may link to it."""
    sections, make = PAGES[page]
    seen = []
    for one in drawn(sections, make()) if make else simulation_drawn:
        ids = [item.id for item in one.items]
        assert set(ids) <= set(sections[one.id].anchors), one.id
        seen += ids
    assert len(seen) == len(set(seen))
    assert not set(seen) & set(sections), "a section and an item need different ids" if page == "study" else ""


def test_a_full_study_draws_every_declared_item(simulation_drawn):
    for one in simulation_drawn:
        assert [item.id for item in one.items] == list(SECTIONS[one.id].anchors)


def test_needs_are_parts_of_the_content():
    known = {field.name for field in fields(ReportContent)} | set(FRAMES)
    for name, section in SECTIONS.items():
        assert set(section.needs) <= known, name
