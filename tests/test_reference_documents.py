"""Pages list what the code has: keys and options are made from it; methods, manoeuvres and measures have a row."""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import get_type_hints

import pytest

from shipid.cli.simulation import manoeuvre_command
from shipid.hybrid.methods import METHODS
from shipid.logs.readers import READERS
from shipid.logs.repairs import REPAIRS
from shipid.physics import TERMS
from shipid.simulation.manoeuvre import KINDS
from shipid.simulation.standard import standard_manoeuvres
from tests.measures.made_records import RECORDS, every

DOCS = Path(__file__).parents[1] / "docs"


def page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def section(text: str, heading: str) -> str:
    """The text from the heading that holds some words to the next heading of its level or above."""
    match = re.search(rf"^(#+) [^\n]*{re.escape(heading)}[^\n]*$", text, re.MULTILINE)
    assert match, f"no heading holds {heading!r}"
    after = text[match.end() :]
    end = re.search(rf"^#{{2,{len(match[1])}}} ", after, re.MULTILINE)
    return after[: end.start()] if end else after


def named(text: str) -> set[str]:
    """Every key that a text names: whole words of what is in backquotes."""
    return {word for quoted in re.findall(r"`+([^`]+)`+", text) for word in re.findall(r"[A-Za-z_]\w*", quoted)}


@pytest.fixture(scope="module")
def made() -> ModuleType:
    """The module that makes pages, where what builds the site is installed."""
    pytest.importorskip("sphinx", reason="`make docs` installs what builds the site")
    sys.path.insert(0, str(DOCS))
    try:
        return import_module("pages")
    finally:
        sys.path.remove(str(DOCS))


def test_pages_of_keys_have_every_kind_with_its_keys_and_their_words(made: ModuleType) -> None:
    study, vessel, mapping = made.study_page(), made.vessel_page(), made.mapping_page()
    for kind, method in METHODS.items():
        block = section(study, f'`[method]`, `kind = "{kind}"`')
        assert {field.alias or name for name, field in method.model_fields.items()} <= named(block), kind
    assert all(f'kind = "{kind}"' in study for kind in KINDS)
    assert all(f"`[{key}]`" in vessel or f'kind = "{key.partition(".")[2]}"' in vessel for key in TERMS)
    assert vessel.count("`propeller_inflow`: u_P = (1 - w_P) u") == 1, "what a docstring refers to is explained once"
    assert all(f'kind = "{kind}"' in mapping for kind in (*READERS, *REPAIRS))
    row = re.search(r"^\| `offset` \|.*$", section(study, '`kind = "one-step"`'), re.MULTILINE)
    assert row, "one-step has a row for `offset`"
    assert "large bends more" in row[0], "words of a docstring stand beside its key"


def test_a_block_that_kinds_share_is_listed_once(made: ModuleType) -> None:
    headings = re.findall(r"^## .*$", made.vessel_page(), re.MULTILINE)
    assert sum("actuator.delta" in heading for heading in headings) == 2, "first_order and rate_limit"


def test_the_page_of_options_has_every_command(made: ModuleType) -> None:
    text = made.commands_page()
    for command in ("study run STUDY", "vessel new", "predict FOLDER LOG"):
        assert f"## `shipid {command}" in text, command
    assert {"--workers", "--set"} <= set(re.findall(r"`(--[a-z-]+)`", section(text, "`shipid study run")))


@pytest.mark.parametrize("kind", METHODS)
def test_every_method_has_a_row(kind: str) -> None:
    row = re.search(rf"^\| `{kind}` \|", page("methods"), re.MULTILINE)
    assert row, f"docs/methods.md: the table at its beginning has no row for {kind}"


@pytest.mark.parametrize("kind", KINDS)
def test_every_manoeuvre_has_a_row(kind: str) -> None:
    assert re.search(rf"^\| `{kind}` \|", section(page("manoeuvres"), "Kinds"), re.MULTILINE)


def test_the_kinds_that_a_helmsman_steers_are_named() -> None:
    (sentence,) = re.findall(r"^A helmsman steers (.*?)\.", page("manoeuvres"), re.MULTILINE)
    assert named(sentence) == {name for name, kind in KINDS.items() if kind.reacts()}


@pytest.mark.parametrize("name", standard_manoeuvres())
def test_every_standard_manoeuvre_and_every_measure_is_named(name: str) -> None:
    """In the help of the command, in the table of the names that it takes, and in that of the measures."""
    text = page("manoeuvres")
    rows = section(text, "From the command line")
    assert re.search(rf"^\| `{name}` \|", rows, re.MULTILINE), f"docs/manoeuvres.md: no row for `{name}`"
    argument = get_type_hints(manoeuvre_command, include_extras=True)["name"].__metadata__[0]
    assert name in re.split(r", | or ", argument.help), f"shipid/cli/simulation.py: the help of NAME lacks {name}"
    measures = standard_manoeuvres()[name].measures(every(RECORDS[name](), 0.5))
    listed = {re.sub(r"_[234]$", "_1", measure) for measure in measures}  # `overshoot_1` ... `overshoot_4`
    assert not listed - named(section(text, "Measures")), "docs/manoeuvres.md: the table of the measures lacks some"


def test_the_tables_to_add_to_are_there() -> None:
    text = re.sub(r"```.*?```", "", page("extending"), flags=re.DOTALL)
    code = "\n".join(file.read_text(encoding="utf-8") for file in (DOCS.parent / "shipid").rglob("*.py"))
    tables = set(re.findall(r"`([A-Z][A-Z_]+[A-Z])`", text)) - {"QUICK", "SMALL", "TOY"}  # of the tests, and a word
    missing = {table for table in tables if not re.search(rf"^ *{table}\b[^\n]* = ", code, re.MULTILINE)}
    assert tables
    assert not missing
