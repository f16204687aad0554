from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from shipid.answer.pages import REPORT_FRAMES
from shipid.report import ReportContent, identification, logs, motion
from shipid.report.page import OF_EVERY_PAGE, Section, draw_sections, render_page
from shipid.report.sections import SECTIONS
from tests.documented import module
from tests.report import test_identification, test_logs, test_motion

PAGES = {
    "study": (SECTIONS, None),
    "check": (logs.CHECK_PAGE, lambda: test_logs.content("log")),
    "identification": (identification.IDENTIFICATION_PAGE, test_identification.content),
    "manoeuvre": (motion.MANOEUVRE_PAGE, lambda: test_motion.content("spiral")),
}


@pytest.mark.parametrize("page", PAGES)
def test_every_item_drawn_is_declared_and_no_id_twice(page, simulation_drawn):
    """What a section draws, its anchors name: a sentence may link to it."""
    sections, make = PAGES[page]
    seen = []
    for one in draw_sections(sections, make()) if make else simulation_drawn:
        ids = [item.id for item in one.items]
        assert set(ids) <= set(sections[one.id].items), one.id
        seen += ids
    assert len(seen) == len(set(seen))
    assert not set(seen) & set(sections), "a section and an item need different ids" if page == "study" else ""


@pytest.mark.parametrize("page", PAGES)
def test_no_id_is_declared_twice(page):
    """Of sections and items together, drawn or not: a link leads to one place."""
    sections = PAGES[page][0]
    ids = [*sections, *(anchor for section in sections.values() for anchor in section.items), *OF_EVERY_PAGE]
    twice = {one for one in ids if ids.count(one) > 1}
    assert not twice, f"give the section and each of its figures and tables another id than {', '.join(sorted(twice))}"


def test_the_section_of_the_page_on_adding_is_drawn(simulation, monkeypatch):
    """The code of docs/extending.md: a section, and a frame of what a study holds."""
    slow = module("A section of the report", "slow_of_the_page", monkeypatch)
    (section,) = draw_sections({"time": slow.SECTION}, simulation)
    (table,) = section.items
    longest = sorted(simulation.cells["seconds"], reverse=True)[:5]
    assert [row[1].text for row in table.rows] == [f"{seconds:.1f}" for seconds in longest]
    frame = module("A section of the report", "bias_of_the_page", monkeypatch, number=2).bias_frame
    future, off = np.zeros((3, 4, 2)), np.array([2.0, -1.0])
    cells = [{"cell": "a", "model": "one", "N_D": 5}, {"cell": "failed", "model": "two", "N_D": 5}]
    results = SimpleNamespace(rows=cells, paths={"a": future - off}, test=SimpleNamespace(future=future))
    assert frame(results).to_dict("records") == [{"model": "one", "N_D": 5, "ahead": 2.0, "starboard": -1.0}]
    bias = module("A section of the report", "bias_figure_of_the_page", monkeypatch, number=3).bias
    signed = Section("Bias", {"bias": (bias, "bias")})
    monkeypatch.setitem(SECTIONS, "signed", signed)
    shown = render_page("study", SECTIONS, replace(simulation, frames={"bias": frame(results)}))
    assert 'id="bias"' in shown


def test_a_full_study_draws_every_declared_item(simulation_drawn):
    for one in simulation_drawn:
        assert [item.id for item in one.items] == list(SECTIONS[one.id].items)


def test_needs_are_parts_of_the_content():
    known = {field.name for field in fields(ReportContent)} | set(REPORT_FRAMES)
    for name, section in SECTIONS.items():
        assert {need for _, need in section.items.values()} <= known, name
