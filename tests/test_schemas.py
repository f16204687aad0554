"""Schemas for editors: they take what the parser takes, and refuse what is no such document."""

from __future__ import annotations

import copy
import json
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit

from shipid.document import bundled_documents, bundled_documents_folder
from shipid.errors import DocumentError
from shipid.identification.outcome import read_settings
from shipid.logs.mapping import read_mapping
from shipid.schemas import SCHEMAS, add_schema_line, document_schema
from shipid.study.plan import build_plan, read_plan
from shipid.vessel.load import load_vessel

jsonschema = pytest.importorskip("jsonschema")

EVERY = {"vessel": "models", "study": "studies", "mapping": "studies/mappings"}
BUNDLED = [(kind, name) for kind, folder in EVERY.items() for name in bundled_documents(folder)]
#: keys and tables whose keys or values are paths, files, runs or other documents: the schema cannot know them
OPEN = {
    "set",
    "repeat",
    "prior",
    "bounds",
    "scale",
    "runs",
    "weights",
    "nuisance",
    "base",
    "vessel",
    "mapping",
    "unit",
    "table",
}
NAMED = {
    "thruster",
    "manoeuvre",
}  # tables whose keys are names of components, which others may refer to, or of commands
SETTINGS = {"identify": {"parameters": ["hull.*"], "prior": {"hull.*": 0.3}, "nuisance": ["current"], "horizon": 60}}


@pytest.fixture(scope="module")
def validators() -> dict[str, Any]:
    return {name: jsonschema.Draft7Validator(document_schema(name)) for name in SCHEMAS}


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the bundled vessels, beside which a spoilt one finds its tables."""
    return Path(shutil.copytree(bundled_documents_folder("models"), tmp_path_factory.mktemp("copy") / "models"))


def document_of(kind: str, name: str) -> dict[str, Any]:
    return tomllib.loads(bundled_documents(EVERY[kind])[name].read_text(encoding="utf-8"))


def refusal(kind: str, name: str, document: dict[str, Any], models: Path, known: dict[str, Any]) -> str | None:
    """What the parser says against a document; None if it takes it."""
    file = models / "spoilt.toml"
    if kind != "study":
        file.write_text(tomlkit.dumps(document), encoding="utf-8")
    try:
        if kind == "vessel":
            load_vessel(str(file))
        elif kind == "mapping":
            read_mapping(file)
        elif kind == "settings":
            read_settings(file)
        else:
            build_plan(document, bundled_documents("studies")[name], dict(known))
    except DocumentError as error:
        return str(error)
    return None


def tables(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of all tables that hold something."""
    if isinstance(node, dict) and node:
        yield path
    inner = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in inner:
        yield from tables(value, (*path, key))


def spoilt(document: dict[str, Any], rng: np.random.Generator) -> tuple[dict[str, Any], str, tuple[Any, ...]]:
    """A document with one key renamed, removed, or given a value of another type; how, and where."""
    result = copy.deepcopy(document)
    places = list(tables(result))
    place = places[rng.integers(len(places))]
    table = result
    for part in place:
        table = table[part]
    key = list(table)[rng.integers(len(table))]
    how = str(rng.choice(["rename", "text", "table", "list", "negative", "delete"]))
    if how == "rename":
        table[f"{key}x"] = table.pop(key)
    elif how == "delete":
        del table[key]
    else:
        table[key] = {"text": "some text", "table": {"a": 1}, "list": [[1.0]], "negative": -1.5}[how]
    return result, how, (*place, key)


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_schema_is_one(name: str) -> None:
    document = document_schema(name)
    jsonschema.Draft7Validator.check_schema(document)
    assert json.loads(json.dumps(document)) == document
    text = json.dumps(document)
    assert '"null"' not in text, "TOML has no null"
    assert "prefixItems" not in text, "no draft that editors know has it"
    with pytest.raises(DocumentError, match="no such document: did you mean 'vessel'"):
        document_schema("vesel")


@pytest.mark.parametrize(("kind", "name"), BUNDLED)
def test_every_bundled_document_is_valid(kind: str, name: str, validators: dict[str, Any]) -> None:
    faults = [
        (list(error.absolute_path), error.message) for error in validators[kind].iter_errors(document_of(kind, name))
    ]
    assert faults == []


def agree(kind: str, name: str, count: int, seed: int, models: Path, validators: dict[str, Any]) -> int:
    """Of documents with one fault: what the parser takes is valid, and what is no key or no type is invalid."""
    document = SETTINGS if kind == "settings" else document_of(kind, name)
    known = read_plan(name).vessels if kind == "study" else {}
    rng = np.random.default_rng([seed, len(name), ord(name[-1])])
    refused = 0
    for _ in range(count):
        one, how, path = spoilt(document, rng)
        table = [part for part in path[:-1] if isinstance(part, str)]
        renamed = how == "rename" and bool(table) and table[-1] in NAMED
        error, valid = refusal(kind, name, one, models, known), validators[kind].is_valid(one)
        if error is None:
            assert valid, (how, path, next(validators[kind].iter_errors(one)).message)
        elif how not in ("delete", "negative") and not renamed and not OPEN & {str(part) for part in path}:
            assert not valid, (how, path, error)
            refused += 1
    return refused


def test_schemas_and_parser_agree(models: Path, validators: dict[str, Any]) -> None:
    cases = (
        ("vessel", "kvlcc2-hsva"),
        ("vessel", "mariner"),
        ("mapping", "gunnerus-2022"),
        ("study", "quick"),
        ("settings", "x"),
    )
    assert sum(agree(*case, 12, 1, models, validators) for case in cases) > 15


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), [*BUNDLED, ("settings", "x")])
def test_schemas_and_parser_agree_on_every_document(
    kind: str, name: str, models: Path, validators: dict[str, Any]
) -> None:
    agree(kind, name, 12 if kind == "study" else 40, 7, models, validators)


def test_a_draft_names_the_schema_beside_it(tmp_path: Path) -> None:
    """The path is relative, so that folder, document and schema travel together."""
    file = tmp_path / "new" / "ship.toml"
    text = add_schema_line('name = "x"\n', file, "vessel")
    line, _, rest = text.partition("\n")
    assert line.startswith("#:schema ./")
    assert rest == 'name = "x"\n'
    named = file.parent / line.removeprefix("#:schema ")
    assert json.loads(named.read_text(encoding="utf-8")) == document_schema("vessel")
