"""The pages of the site that are made from the code: public names of Python, and keys of the documents.

`docs/conf.py` writes them to `docs/generated/` whenever the site is built.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel
from sphinx.util.inspect import signature, stringify_signature

import shipid
from shipid.hybrid.features import Memory
from shipid.hybrid.methods import METHODS
from shipid.identification.settings import Identify
from shipid.logs.mapping import Mapping as LogMapping
from shipid.logs.readers import READERS
from shipid.logs.repairs import REPAIRS
from shipid.observer import Observer
from shipid.physics import TERMS
from shipid.simulation.manoeuvre import KINDS
from shipid.study.schema import Study
from shipid.vessel.schema import FIXED, term_model, vessel_model

Schema = Mapping[str, Any]
ENTRY = re.compile(r"^(\*{0,2}\w[\w, ]*?) : (.*)$")  # `name : text` and `one, other : text` of a docstring


# Python


def python_page() -> str:
    """Every public name of `shipid` with its signature and docstring."""
    names = [name for name in shipid.__all__ if not inspect.ismodule(getattr(shipid, name))]
    groups = {
        "Functions": [name for name in names if not inspect.isclass(getattr(shipid, name))],
        "Classes": [name for name in names if inspect.isclass(getattr(shipid, name))],
    }
    lines = [
        "# Python reference",
        "",
        "Made from the types and docstrings of the code. Arrays are time first, channel last. Units are SI and",
        "radians; shafts turn in rev/s. [From Python](../python.md) shows the names at work.",
        "",
    ]
    for heading, group in groups.items():
        lines += [f"## {heading}", ""]
        for name in group:
            lines += described(f"shipid.{name}", getattr(shipid, name))
    lines += ["## Figures", "", markdown(inspect.getdoc(shipid.figures) or ""), ""]
    for name in shipid.figures.__all__:
        lines += described(f"shipid.figures.{name}", getattr(shipid.figures, name))
    return "\n".join(lines)


def described(path: str, thing: Any) -> list[str]:
    """Lines of a directive for a function or a class with its public methods."""
    if not inspect.isclass(thing):
        return directive("py:function", path + signature_of(thing), markdown(inspect.getdoc(thing) or ""))
    body = [markdown(inspect.getdoc(thing) or "")]
    if issubclass(thing, BaseModel):
        own = settings_table(thing)
        body += ["", *own] if own else []
        head = path
    else:
        head = path + signature_of(thing).removesuffix(" -> None")
    for name, member in vars(thing).items():
        if name.startswith("_") or not (doc := getattr(member, "__doc__", None)) or name == "model_config":
            continue
        if isinstance(member, property) or type(member).__name__ == "cached_property":
            body += ["", *directive("py:property", name, markdown(inspect.cleandoc(doc)), fence="::::")]
        elif isinstance(member, classmethod | staticmethod) or inspect.isfunction(member):
            if hasattr(member, "__pydantic_validator__") or "decorator" in type(member).__name__.lower():
                continue
            call = name + signature_of(getattr(thing, name))
            kind = "py:classmethod" if isinstance(member, classmethod) else "py:method"
            body += ["", *directive(kind, call, markdown(inspect.cleandoc(doc)), fence="::::")]
    return directive("py:class", head, "\n".join(body))


def directive(kind: str, head: str, body: str, fence: str = ":::::") -> list[str]:
    """Return lines of a MyST directive."""
    return [f"{fence}{{{kind}}} {head}", "", body, "", fence, ""]


def signature_of(function: Any) -> str:
    """Return the signature with types, without the instance."""
    try:
        text = stringify_signature(signature(function), unqualified_typehints=True)
    except ValueError:
        return "()"
    text = re.sub(r"~?\b(?:[a-z]\w*\.)+(?=[A-Za-z])|~", "", text.replace("<factory>", "..."))
    return text.replace("(self, ", "(").replace("(self)", "()")


def markdown(docstring: str) -> str:
    """Return a docstring as Markdown: sections become bold words, `name : text` becomes an item of a list."""
    text = re.sub(r"^(\w+)\n-{3,}$", r"\n**\1**\n", docstring, flags=re.MULTILINE)
    out = []
    for block in re.split(r"\n\s*\n", text):
        lines = block.splitlines()
        if not any(ENTRY.match(line) for line in lines[:1]):
            out.append(block)
            continue
        items: list[str] = []
        for line in lines:
            match = ENTRY.match(line)
            if match:
                items.append(f"- `{match[1]}`: {match[2]}")
            else:
                items[-1] += " " + line.strip()
        out.append("\n".join(items))
    return "\n\n".join(out)


def settings_table(model: type[BaseModel]) -> list[str]:
    """Return the table of a model's keys."""
    schema = model.model_json_schema(by_alias=True)
    return table(schema, schema.get("$defs", {}))


# documents


def documents_page() -> str:
    """Every key of every document, with what it takes and its default, from the models that check them."""
    lines = [
        "# Keys of the documents",
        "",
        "Made from the models that check the documents. For what a key means, and for examples,",
        "read the [study](../reference-study-document.md), [vessel](../reference-vessel-document.md) and",
        "[mapping](../reference-mapping-document.md) documents.",
        "",
        "## Study document",
        "",
        *blocks("", Study.model_json_schema(), 3),
    ]
    for path, model in (("family.identify", Identify), ("family.observer", Observer), ("method.memory", Memory)):
        lines += blocks(path, model.model_json_schema(), 3)
    lines += ["## Methods of a study", ""]
    for kind, method in METHODS.items():
        lines += blocks("method", method.model_json_schema(), 3, kind)
    lines += ["## Manoeuvres of a study", ""]
    for kind, manoeuvre in KINDS.items():
        lines += blocks("truth.manoeuvre", manoeuvre.model_json_schema(), 3, kind)
    lines += ["## Vessel document", ""]
    lines += blocks("", without(vessel_model().model_json_schema(), {*FIXED, "wind", "thruster"}), 3)
    for key in TERMS:
        group, kind = key.split(".")
        path, shown = (key, None) if group in FIXED else ("thruster.NAME" if group == "thruster" else group, kind)
        lines += blocks(path, term_model(key).model_json_schema(), 3, shown)
    lines += ["## Mapping document", "", *blocks("", LogMapping.model_json_schema(), 3)]
    for kind, reader in READERS.items():
        lines += blocks("format", reader.options.model_json_schema(), 3, kind)
    for kind, (repair, *_) in REPAIRS.items():
        lines += blocks("repair", repair.model_json_schema(), 3, kind)
    return "\n".join(lines)


def without(schema: Schema, names: set[str]) -> Schema:
    """Return a schema without some of its properties."""
    return {**schema, "properties": {name: own for name, own in schema["properties"].items() if name not in names}}


def blocks(path: str, schema: Schema, level: int, kind: str | None = None) -> list[str]:
    """Lines of a block of a document and of the blocks inside it: heading, words, table."""
    defs = schema.get("$defs", {})
    name = f"`[{path}]`" if path else "Top level"
    lines = [f"{'#' * level} {name}" + (f', `kind = "{kind}"`' if kind else ""), ""]
    words = str(schema.get("description", "")).split("\n\n")[0]
    lines += [words, ""] if path and words else []
    lines += [*table(schema, defs), ""]
    for key, own in schema.get("properties", {}).items():
        for inner in inside(own, defs):
            if inner.get("properties"):
                lines += blocks(f"{path}.{key}" if path else key, {**inner, "$defs": defs}, level)
    return lines


def inside(schema: Schema, defs: Schema) -> Iterator[Schema]:
    """Tables inside the schema of a key: of unions, lists, references."""
    if "$ref" in schema:
        yield defs[schema["$ref"].split("/")[-1]]
    for word in ("anyOf", "oneOf", "allOf"):
        for part in schema.get(word, ()):
            yield from inside(part, defs)
    for word in ("items", "additionalProperties"):
        if isinstance(schema.get(word), dict):
            yield from inside(schema[word], defs)


def table(schema: Schema, defs: Schema) -> list[str]:
    """Lines of the table of a block's keys."""
    rows = []
    for key, own in schema.get("properties", {}).items():
        default = "required" if key in schema.get("required", ()) else shown(own.get("default"))
        words = str(own.get("description", "")).replace("\n", " ")
        rows.append(f"| `{key}` | {cell(takes(own, defs))} | {cell(default)} | {cell(words)} |")
    if isinstance(more := schema.get("additionalProperties"), dict):
        rows.append(f"| any name | {cell(takes(more, defs))} | | |")
    return ["| key | takes | default | |", "| --- | --- | --- | --- |", *rows] if rows else []


def cell(text: str) -> str:
    """Return text that does not end a cell of a table."""
    return re.sub(r"(?<!\\)\|", r"\\|", text)


def shown(value: object) -> str:
    """Return a default as a document would have it; blocks have theirs in their own table."""
    if value is None:
        return ""
    if isinstance(value, dict) or (isinstance(value, list) and any(isinstance(item, dict) for item in value)):
        return "see there" if value else ""
    return f"`{json.dumps(value)}`"


def takes(schema: Schema, defs: Schema) -> str:
    """Return what a key takes, in words."""
    if "const" in schema:
        return f'`"{schema["const"]}"`'
    if "enum" in schema:
        return " or ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
    if "$ref" in schema:
        inner = defs[schema["$ref"].split("/")[-1]]
        return "a block" if inner.get("properties") else takes(inner, defs)
    parts = [part for word in ("anyOf", "oneOf", "allOf") for part in schema.get(word, ())]
    if parts:
        return " or ".join(dict.fromkeys(takes(part, defs) for part in parts if part.get("type") != "null"))
    kind = schema.get("type")
    if kind == "array":
        if "prefixItems" in schema:
            return "[" + ", ".join(takes(item, defs) for item in schema["prefixItems"]) + "]"
        return "list of " + (takes(schema["items"], defs) if schema.get("items") else "values")
    if kind == "object":
        more = schema.get("additionalProperties")
        return "table" + (f" of {takes(more, defs)}" if isinstance(more, dict) and more else "")
    words = {"number": "number", "integer": "whole number", "string": "text", "boolean": "`true` or `false`"}
    limits = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    told = [f"{sign} {schema[name]:g}" for name, sign in limits.items() if name in schema]
    return words.get(str(kind), "any value") + (" " + ", ".join(told) if told else "")
