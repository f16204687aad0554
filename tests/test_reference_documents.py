"""The reference pages name every key of the documents, in the section of its block, with the defaults of methods."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest
from pydantic import BaseModel

from shipid.cli.simulation import manoeuvre
from shipid.hybrid.features import Memory
from shipid.hybrid.methods import METHODS
from shipid.identification.settings import Identify
from shipid.logs.mapping import Mapping
from shipid.logs.readers import READERS
from shipid.logs.repairs import REPAIRS
from shipid.observer import Observer
from shipid.physics import ACTUATORS, TERMS
from shipid.simulation.draw import SHARED
from shipid.simulation.manoeuvre import KINDS
from shipid.simulation.standard import standards
from shipid.study.schema import Study
from shipid.vessel.load import Patch
from shipid.vessel.perturb import Perturbation
from shipid.vessel.schema import term_model, vessel_model
from shipid.vessel.terms import FIXED
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


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Pydantic models inside an annotation: of unions, lists, tables."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from models_in(part)


def blocks(model: type[BaseModel], path: str = "") -> Iterator[tuple[str, type[BaseModel]]]:
    """Dotted path and model of every block of a document, the document itself first."""
    yield path, model
    for name, field in model.model_fields.items():
        for inner in models_in(field.annotation):
            yield from blocks(inner, f"{path}.{name}" if path else name)


def keys(model: type[BaseModel]) -> set[str]:
    """Keys of a block as a document writes them."""
    return {field.alias or name for name, field in model.model_fields.items()} - {"digest", "source"}


STUDY = {path: keys(model) for path, model in blocks(Study)} | {
    "family.perturb": set(Perturbation.keys()),
    "family.identify": keys(Identify),
    "family.observer": keys(Observer),
    "method.memory": keys(Memory),
}


@pytest.mark.parametrize("path", STUDY)
def test_every_key_of_a_study_is_in_the_section_of_its_block(path: str) -> None:
    text = page("reference-study-document")
    missing = STUDY[path] - named(section(text, f"[{path}" if path else "Top level"))
    assert not missing, f"docs/reference-study-document.md, [{path}]: {', '.join(sorted(missing))}"


def test_the_law_sees_a_key_that_is_left_out() -> None:
    """Without its row, `causal` is missing, though other pages and sections have the word."""
    text = re.sub(r"^\| `causal`.*\n", "", page("reference-study-document"), flags=re.MULTILINE)
    assert STUDY["data"] - named(section(text, "[data")) == {"causal"}


def settings(kind: str) -> dict[str, str]:
    """Field -> default as the table of a method of the reference page writes it; none without a table."""
    match = re.search(rf"^\| field \| `{kind}` \|.*\n\|[ |-]*\n((?:\|.*\n)+)", page("reference-study-document"), re.M)
    rows = match[1].splitlines() if match else []
    cells = [[cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:3]] for row in rows]
    return {name.strip("`"): default for name, default in cells}


@pytest.mark.parametrize("kind", METHODS)
def test_every_setting_of_a_method_is_listed_with_its_default(kind: str) -> None:
    """A method that is another one with more settings lists those alone."""
    listed, parent = settings(kind), next(k for k in (*METHODS, "") if not k or METHODS[k] in METHODS[kind].__bases__)
    inherited = METHODS[parent].model_fields if parent else {}
    fields = METHODS[kind].model_fields
    of_all = {"budget"} & named(section(page("reference-study-document"), "[method"))  # a row for all methods at once
    wanted_names = {name for name in fields if name not in inherited} - of_all
    remedy = f"docs/reference-study-document.md needs a table `| field | `{kind}` | |` with a row for each setting"
    assert set(listed) == wanted_names, remedy
    for name, text in listed.items():
        default = fields[name].default
        words = {"nothing": Memory(), "none": None}
        wanted = words[text] if text in words else tomllib.loads(f"value = {text}")["value"]
        assert (list(default) if isinstance(default, tuple) else default) == wanted, name
    kinds = re.search(r"^\| `kind` \|.*$", section(page("reference-study-document"), "[[method]]"), re.MULTILINE)
    assert kinds, "docs/reference-study-document.md, [[method]], has no row `kind`"
    assert f"`{kind}`" in kinds[0], f"docs/reference-study-document.md, [[method]], row `kind`: {kind} is missing"
    row = re.search(rf"^\| `{kind}` \|", page("methods"), re.MULTILINE)
    assert row, f"docs/methods.md: the table at its beginning has no row for {kind}"


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_of_a_manoeuvre_is_named(kind: str) -> None:
    text = page("manoeuvres")
    (row,) = re.findall(rf"^\| `{kind}` \|.*$", section(text, "Kinds"), re.MULTILINE)
    missing = set(KINDS[kind].model_fields) - named(row) - named(section(text, "Common to all")) - set(SHARED)
    assert not missing, missing


def test_the_kinds_that_a_helmsman_steers_are_named() -> None:
    (sentence,) = re.findall(r"^A helmsman steers (.*?)\.", page("manoeuvres"), re.MULTILINE)
    assert named(sentence) == {name for name, kind in KINDS.items() if kind.reacts()}


@pytest.mark.parametrize("name", standards())
def test_every_standard_manoeuvre_and_every_measure_is_named(name: str) -> None:
    """In the help of the command, in the table of the names that it takes, and in that of the measures."""
    text = page("manoeuvres")
    rows = section(text, "From the command line")
    assert re.search(rf"^\| `{name}` \|", rows, re.MULTILINE), (
        f"docs/manoeuvres.md: no row for `shipid manoeuvre {name}`"
    )
    argument = get_type_hints(manoeuvre, include_extras=True)["name"].__metadata__[0]
    assert name in re.split(r", | or ", argument.help), f"shipid/cli/simulation.py: the help of NAME lacks {name}"
    measures = standards()[name].measures(every(RECORDS[name](), 0.5))
    listed = {re.sub(r"_[234]$", "_1", measure) for measure in measures}  # `overshoot_1` ... `overshoot_4`
    assert not listed - named(section(text, "Measures")), "docs/manoeuvres.md: the table of the measures lacks some"


VESSEL_BLOCKS = {"": vessel_model()} | {
    name: model for name, model in blocks(vessel_model()) if name in ("particulars", "constants", "inertia", "current")
}


@pytest.mark.parametrize("path", VESSEL_BLOCKS)
def test_every_key_of_a_vessel_is_in_the_section_of_its_block(path: str) -> None:
    text = page("reference-vessel-document")
    text = section(text, f"[{path}]") if path else text
    assert not keys(VESSEL_BLOCKS[path]) - named(text)


@pytest.mark.parametrize("key", TERMS)
def test_every_key_of_a_term_is_named_where_its_kind_is(key: str) -> None:
    group, kind = key.split(".")
    text = page("reference-vessel-document")
    here = section(text, f"[{key}]" if group in FIXED else f"[{group}")
    shared = named(section(text, "[particulars]")) | named(section(text, "[constants]")) | {"off", "kind", "actuator"}
    wanted = keys(term_model(key)) - shared
    documented = named(here) | set(re.findall(r"\b[A-Z]_\d\b", here))  # coefficients of a formula that is written out
    assert not wanted - documented, f"{key}: {', '.join(sorted(wanted - documented))}"
    assert group in FIXED or f'kind = "{kind}"' in here


@pytest.mark.parametrize("kind", ACTUATORS)
def test_every_kind_of_actuator_is_shown(kind: str) -> None:
    assert f'kind = "{kind}"' in section(page("reference-vessel-document"), "[thruster.")


def test_every_key_of_a_patch_is_named() -> None:
    assert not keys(Patch) - named(section(page("reference-vessel-document"), "Patch document"))


MAPPING = {
    "": ("Top level", set()),
    "source": ("[source]", set()),
    "clock": ("[clock]", set()),
    "file": ("Channels", {"path", "format", "clock"}),  # the block of TOML shows them
    "file.clock": ("[clock]", set()),
    "origin": ("[columns", set()),
    "columns": ("[columns", {"file", "latency", "interpolation"}),  # in the section on channels
    "estimate": ("[estimate]", set()),
    "repair": ("[[repair]]", set()),
    "segment": ("[[segment]]", set()),
    "parts": ("[parts]", set()),
    "resample": ("[resample]", set()),
    "format": ("[format]", set()),
    "file.format": ("[format]", set()),
}


@pytest.mark.parametrize(("path", "model"), list(blocks(Mapping)))
def test_every_key_of_a_mapping_is_in_the_section_of_its_block(path: str, model: type[BaseModel]) -> None:
    heading, elsewhere = MAPPING[path]
    text = page("reference-mapping-document")
    tables = {"format", "clock", "columns", "file", "repair", "segment", "parts", "resample", "estimate", "origin"}
    missing = keys(model) - named(section(text, heading)) - elsewhere - (tables if not path else set())
    assert not missing, missing
    channels = section(text, "Channels")
    assert all(re.search(rf"\b{key}\b", channels) for key in elsewhere)
    assert path or all(f"[{table}" in text for table in tables)


@pytest.mark.parametrize("kind", READERS)
def test_every_key_of_a_format_is_named(kind: str) -> None:
    text = page("reference-mapping-document")
    documented = named(section(text, "[format]")) | named(section(text, "NMEA"))
    assert not keys(READERS[kind].options) - documented
    assert kind in {word.lower() for word in documented}


@pytest.mark.parametrize("kind", REPAIRS)
def test_every_key_of_a_repair_is_in_its_row(kind: str) -> None:
    text = section(page("reference-mapping-document"), "[[repair]]")
    (row,) = re.findall(rf"^\| `{kind}` \|.*$", text, re.MULTILINE)
    common = {"kind", "reason", "enabled"}
    assert common <= named(text)
    assert not keys(REPAIRS[kind][0]) - common - named(row)


def test_the_tables_to_add_to_are_there() -> None:
    text = re.sub(r"```.*?```", "", page("extending"), flags=re.DOTALL)
    code = "\n".join(file.read_text(encoding="utf-8") for file in (DOCS.parent / "shipid").rglob("*.py"))
    tables = set(re.findall(r"`([A-Z][A-Z_]+[A-Z])`", text))
    missing = {table for table in tables if not re.search(rf"^ *{table}\b[^\n]* = ", code, re.MULTILINE)}
    assert tables
    assert not missing
