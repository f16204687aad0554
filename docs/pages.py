"""The pages of the site that are made from the code: public names of Python, keys of documents, options of commands.

`docs/conf.py` writes them to `docs/generated/` whenever the site is built.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import typer
from pydantic import BaseModel
from sphinx.util.inspect import signature, stringify_signature

import shipid
from shipid.cli import app
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
Seen = set[str]
"""Blocks that a page has already: equal blocks of several kinds are listed once."""
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


def study_page() -> str:
    """Every key of a study document, of its methods and of its manoeuvres."""
    seen: Seen = set()
    lines = [*title("Keys of the study document", "reference-study-document"), *blocks("", schema_of(Study), seen)]
    for path, model in (("family.identify", Identify), ("family.observer", Observer), ("method.memory", Memory)):
        lines += blocks(path, schema_of(model), seen)
    for kind, method in METHODS.items():
        lines += blocks("method", schema_of(method), seen, kind)
    for kind, manoeuvre in KINDS.items():
        lines += blocks("truth.manoeuvre", schema_of(manoeuvre), seen, kind)
    return "\n".join(lines)


def vessel_page() -> str:
    """Every key of a vessel document: its blocks, then a block for each term."""
    seen: Seen = set()
    lines = title("Keys of the vessel document", "reference-vessel-document")
    lines += blocks("", without(schema_of(vessel_model({})), {*FIXED, "wind", "thruster"}), seen)
    for key, term in TERMS.items():
        group, kind = key.split(".")
        path, shown_kind = (key, None) if group in FIXED else ("thruster.NAME" if group == "thruster" else group, kind)
        words = "\n\n".join([inspect.getdoc(term.function) or "", *helpers(term.function, seen)])
        lines += blocks(path, {**schema_of(term_model(key)), "description": words}, seen, shown_kind)
    return "\n".join(lines)


def helpers(function: Callable[..., Any], seen: Seen) -> Iterator[str]:
    """Words of the functions of its module that a docstring refers to, each once a page."""
    module = inspect.getmodule(function)
    for name in re.findall(r"`(\w+)`", inspect.getdoc(function) or ""):
        helper = getattr(module, name, None)
        if inspect.isfunction(helper) and helper is not function and name not in seen:
            seen.add(name)
            yield f"`{name}`: {inspect.getdoc(helper)}"


def mapping_page() -> str:
    """Every key of a mapping document, of its formats and of its repairs."""
    seen: Seen = set()
    lines = title("Keys of the mapping document", "reference-mapping-document")
    lines += blocks("", without(schema_of(LogMapping), {"digest"}), seen)
    for kind, reader in READERS.items():
        lines += blocks("format", schema_of(reader.options), seen, kind)
    for kind, (repair, *_) in REPAIRS.items():
        lines += blocks("repair", schema_of(repair), seen, kind)
    return "\n".join(lines)


def title(words: str, page: str) -> list[str]:
    """Return the first lines of a page of keys."""
    made = f"Made from the models that check the documents. [What the keys mean](../{page}.md) has examples."
    return [f"# {words}", "", f"{made} A block that several kinds share is listed once.", ""]


def schema_of(model: type[BaseModel]) -> Schema:
    """Return the JSON Schema of a model, with the keys that a document writes."""
    return model.model_json_schema(by_alias=True)


def without(schema: Schema, names: set[str]) -> Schema:
    """Return a schema without some of its properties."""
    return {**schema, "properties": {name: own for name, own in schema["properties"].items() if name not in names}}


def blocks(path: str, schema: Schema, seen: Seen, kind: str | None = None) -> list[str]:
    """Lines of a block of a document and of the blocks inside it: heading, words, table."""
    defs, text = schema.get("$defs", {}), str(schema.get("description", ""))
    name = f"`[{path}]`" if path else "Top level"
    content = json.dumps([name, schema.get("properties"), kind], sort_keys=True)
    if content in seen:
        return []
    seen.add(content)
    lines = [f"## {name}" + (f', `kind = "{kind}"`' if kind else ""), ""]
    lines += [escaped(prose(text)), ""] if path and text else []
    lines += [*table(schema, defs), ""]
    for key, own in schema.get("properties", {}).items():
        for inner in inside(own, defs):
            if inner.get("properties"):
                lines += blocks(f"{path}.{key}" if path else key, {**inner, "$defs": defs}, seen)
    return lines


def prose(docstring: str) -> str:
    """Return a docstring without its list of parameters, which is in the table."""
    text = docstring.partition("\nParameters\n")[0]
    return "\n\n".join(part for part in re.split(r"\n\s*\n", text) if not ENTRY.match(part.strip())).strip()


def entries(docstring: str) -> dict[str, str]:
    """Return name -> words of the list `name : words` or `one, other : words` of a docstring."""
    words: dict[str, str] = {}
    names: list[str] = []
    for line in docstring.splitlines():
        if match := ENTRY.match(line.strip() if not names else line):
            names = [name.strip() for name in match[1].split(",")]
            words |= dict.fromkeys(names, match[2])
        elif line.strip() and line.startswith(" "):
            words |= {name: f"{words[name]} {line.strip()}" for name in names}
        else:
            names = []
    return words


def escaped(text: str) -> str:
    """Return text in which signs of Markdown and HTML are signs."""
    text = re.sub(r"(?<![`\w-])(--[a-z][a-z-]*)", r"`\1`", text)
    return re.sub(r"(?<![`\\])([<*|$])", r"\\\1", text)


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
    rows, listed = [], entries(str(schema.get("description", "")))
    for key, own in schema.get("properties", {}).items():
        default = "required" if key in schema.get("required", ()) else shown(own.get("default"))
        words = str(own.get("description") or listed.get(key, "")).replace("\n", " ")
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
    return f"`{json.dumps(value, default=str)}`"


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
    within = [f"{sign} {schema[name]:g}" for name, sign in limits.items() if name in schema]
    return words.get(str(kind), "any value") + (" " + ", ".join(within) if within else "")


# commands


def commands_page() -> str:
    """Every command with its arguments and options, from the declarations that the command line uses."""
    lines = ["# Options of the commands", "", "Made from the commands. [What they do](../reference-commands.md).", ""]
    for path, command in every_command(typer.main.get_command(app)):
        given = [parameter for parameter in command.params if not getattr(parameter, "hidden", False)]
        arguments = [one.metavar or str(one.name).upper() for one in given if one.param_type_name == "argument"]
        lines += [f"## `{' '.join(('shipid', *path, *arguments))}`", "", escaped(str(command.help or "")), ""]
        rows = []
        for parameter in given:
            names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts))
            words = " ".join(str(getattr(parameter, "help", None) or "").split())
            default = "required" if parameter.required else shown(parameter.default or None)
            rows.append(f"| {names} | {cell(default)} | {cell(escaped(words))} |")
        lines += ["| argument or option | default | |", "| --- | --- | --- |", *rows, ""] if rows else []
    return "\n".join(lines)


def every_command(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Words and object of every command that does something, groups left out."""
    inner = getattr(command, "commands", None)
    if inner is None:
        yield path, command
    for name, one in (inner or {}).items():
        yield from every_command(one, (*path, name))
