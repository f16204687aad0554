from types import SimpleNamespace

import pandas as pd
import pytest

from shipid.report.page import Section, draw_sections
from shipid.report.tables import PageTable

EMPTY = pd.DataFrame()
FULL = pd.DataFrame({"a": [1.0]})


def table(name: str) -> PageTable:
    return PageTable(name, name, "", ["a"], [True], [])


@pytest.mark.parametrize(("need", "shown"), [("full", True), ("empty", False), ("absent", False), ("number", True)])
def test_a_section_needs_its_parts(need, shown):
    content = SimpleNamespace(full=FULL, empty=EMPTY, number=0.0)
    section = Section("A", {"a": (lambda _: table("a"), need)})
    assert [one.id for one in draw_sections({"a": section}, content)] == ["a"] * shown


def test_order_and_gaps():
    sections = {
        "b": Section("B", {"none": (lambda _: None, ""), "b": (lambda _: table("b"), "")}),
        "none": Section("Nothing", {"nothing": (lambda _: None, "")}),
        "a": Section("A", {"a": (lambda _: table("a"), "")}),
    }
    assert [(one.id, one.title, [i.id for i in one.items]) for one in draw_sections(sections, None)] == [
        ("b", "B", ["b"]),
        ("a", "A", ["a"]),
    ]
