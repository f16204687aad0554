"""Documents as nested data: read TOML, find bundled documents, get / replace / match by dotted path, digest."""

from __future__ import annotations

import copy
import fnmatch
import hashlib
import json
import os
import re
import tomllib
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, get_args

from shipid.errors import RETIRED, DocumentError, suggest_name
from shipid.files import open_file

Document = dict[str, Any]

MOST_NUMBER, MOST_INTEGER = 1e24, 10**15
DRAFTS = {
    "models": ("vessel", "vessel new"),
    "studies": ("study", "study new"),
    "studies/mappings": ("mapping", "data import --guess LOG"),
}
"""Kind of document -> its word, and the command that writes a first one."""
REQUIRED = {
    "missing": "missing",
    "string_type": "must be text",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "finite_number": "must be a finite number",
    "greater_than": "must be above {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be below {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "literal_error": "must be {expected}",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "too_short": "must be a {kind} of {min_length} or more entries (it has {actual_length})",
    "too_long": "must be a {kind} of {max_length} or fewer entries (it has {actual_length})",
    "string_too_short": "must have {min_length} or more characters",
    "string_too_long": "must have {max_length} or fewer characters",
    "string_pattern_mismatch": "must match the pattern {pattern}",
}
"""Type of a problem that pydantic reports -> what the value must be."""
LEAST_NUMBER = 1e-100  # but for 0: a quotient of two numbers of a document stays finite


def bundled_documents_folder(kind: str) -> Path:
    """Folder of the documents that come with shipid: `models`, `studies` or `studies/mappings`."""
    package = Path(__file__).parent
    installed = package / "_bundled" / kind
    return installed if installed.is_dir() else package.parent / kind


def bundled_documents(kind: str) -> dict[str, Path]:
    """Name -> file of every bundled document of a kind, sorted by name."""
    files = bundled_documents_folder(kind).glob("*.toml")
    return {file.stem: file for file in sorted(files, key=lambda file: file.stem)}


def find_document(name: str | Path, kind: str, relative_to: Path | None = None) -> Path:
    """File of a document: a bundled name, or a path if it contains a slash, ends in `.toml` or is a `Path`.

    A relative path is tried from the folder of the document that names it, then from the working folder.
    """
    if not isinstance(name, str | Path):
        raise DocumentError(f"{name!r} is no name of a document, nor a path of one: give a text or a Path")
    if isinstance(name, Path) or "/" in name or "\\" in name or name.endswith(".toml"):
        places = [folder / name for folder in (relative_to, Path()) if folder]
        for place in places:
            if os.path.isfile(place):  # a name that is too long is none
                return place
        raise DocumentError(
            "is a folder: name a document in it" if any(map(os.path.isdir, places)) else "no such file", file=name
        )
    available = bundled_documents(kind)
    if name not in available:
        label, draft = DRAFTS[kind]
        words = f"no {label} of this name comes with shipid: {suggest_name(name, available)}"
        remedy = f"a path to another file needs a slash or the ending .toml; `shipid {draft}` writes a first one"
        raise DocumentError(f"{words}; {remedy}", path=name or "''")
    return available[name]


def read_document(file: Path | str) -> Document:
    """Read a TOML document; DocumentError for invalid syntax, a wrong encoding, and what `check_values` refuses."""
    try:
        with open_file(file) as stream:
            text = stream.read().decode("utf-8").removeprefix("\ufeff")  # the mark that some editors write
    except UnicodeDecodeError as error:
        raise DocumentError(f"not UTF-8 text (byte {error.start}): save it as UTF-8", file=file) from None
    except OSError as error:
        raise DocumentError(f"cannot be read ({error.strerror})", file=file) from None
    document = parse_toml(text, file)
    check_values(document, file)
    return document


def parse_toml(text: str, file: Path | str | None = None) -> Document:
    """Parse TOML text; DocumentError for invalid syntax, and for what the parser cannot hold."""
    try:
        return tomllib.loads(text)
    except (RecursionError, ValueError) as error:
        said = re.sub(
            r" ?(?:\(['\"].*?['\"],?\)|'[^']{2,}')", "", str(error)
        )  # keys of what may be any file, of secrets too
        raise DocumentError(f"not valid TOML: {said}", file=file) from None


def check_values(document: Any, file: Path | str | None) -> None:
    """Raise DocumentError for a value that no document may hold, with its dotted path.

    That is an object that TOML has not or no document uses, a number that is too large or too near to 0, a control
    character, and nesting deeper than Python goes.
    """
    try:
        leaves = list(document_leaves(document))
    except RecursionError:
        raise DocumentError("is nested too deep: write fewer tables or lists inside one another", file=file) from None
    for path, value in leaves:
        fault = None
        if _has_control(path):
            fault = "a name with a control character"
        elif not isinstance(value, str | int | float | complex):
            fault = f"a {type(value).__name__}: give a number, a text, true or false, a list or a table"
        elif isinstance(value, int) and abs(value) > MOST_INTEGER:
            fault = f"an integer beyond {MOST_INTEGER:.0e}: write a smaller one"
        elif isinstance(value, float) and (MOST_NUMBER < abs(value) < float("inf") or 0 < abs(value) < LEAST_NUMBER):
            fault = f"{value:g}: no quantity of a ship in SI units is so large, or so near to 0"
        elif isinstance(value, str) and _has_control(value.translate({9: None, 10: None, 13: None})):
            fault = "text with a control character"
        if fault is not None:
            raise DocumentError(fault, file=file, path=path)


def _has_control(text: str) -> bool:
    return any(unicodedata.category(sign) == "Cc" for sign in text)


def digest_document(document: Any) -> str:
    """SHA-256 (first 16 hex digits) of the canonical JSON form: the same for any order of keys."""
    canonical = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=True)
    return hashlib.sha256(canonical.encode()).hexdigest()[:16]


def merge_documents(under: Document, over: Document) -> Document:
    """A new document: tables of both are merged; any other value in `over` replaces that in `under`.

    So does a table of another `kind`: the keys of one kind are not those of another.
    """
    result = dict(under)
    for key, value in over.items():
        below = result.get(key)
        if isinstance(below, dict) and isinstance(value, dict) and value.get("kind") in (None, below.get("kind")):
            value = merge_documents(below, value)
        result[key] = value
    return result


def document_leaves(document: Any, prefix: str = "", *, lists: bool = True) -> Iterator[tuple[str, Any]]:
    """Dotted path and value of every leaf, in document order.

    lists : entries of a list are leaves, addressed by index; else a list is one leaf.
    """
    items: Any
    if isinstance(document, Mapping):
        items = document.items()
    elif lists and isinstance(document, list):
        items = enumerate(document)
    else:
        yield prefix, document
        return
    for key, value in items:
        yield from document_leaves(value, f"{prefix}.{key}" if prefix else str(key), lists=lists)


def split_path(path: str) -> list[str]:
    """Keys of a dotted path; one in double quotes may hold dots: `truth.sensors."port.n".noise`."""
    if '"' not in path:
        return path.split(".")
    return [quoted or bare for quoted, bare in re.findall(r'"([^"]*)"|([^."]+)', path)]


def short_names(paths: Sequence[str]) -> tuple[str, ...]:
    """Name of each dotted path: its last part, with the one before it where it is one letter (`K_T.J`).

    Where that is not unique it is the whole path.
    """
    split = [path.split(".") for path in paths]
    last = [".".join(part[-1 if len(part[-1]) > 1 else -2 :]) for part in split]
    return tuple(name if last.count(name) == 1 else path for name, path in zip(last, paths, strict=True))


def _entry_name(entry: Any) -> str | None:
    """The name of an entry of a list; None where it has none that can stand in a path."""
    name = entry.get("name") if isinstance(entry, Mapping) else None
    return name if isinstance(name, str) and name and '"' not in name and not name.isdecimal() else None


def path_with_names(document: Any, path: str) -> str:
    """The path with the names of entries of lists in place of their numbers, where one entry alone has the name.

    `family.1.perturb.0` of a study whose second family is called wrong is `family.wrong.perturb.0`.
    """
    shown, value = [], document
    for part in split_path(path):
        if isinstance(value, list):
            names = [_entry_name(entry) for entry in value]
            number = int(part) if part.isdecimal() and int(part) < len(value) else None
            name = None if number is None else names[number]
            shown.append(name if name is not None and names.count(name) == 1 else part)
            value = None if number is None else value[number]
        else:
            shown.append(part)
            value = value.get(part) if isinstance(value, Mapping) else None
    return ".".join(f'"{part}"' if "." in part else part for part in shown)


def value_at_path(document: Any, path: str) -> Any:
    """Value at a dotted path; KeyError names the part that is missing."""
    value = document
    for part in split_path(path):
        if isinstance(value, list) and part.isdecimal() and int(part) < len(value):
            value = value[int(part)]
        elif isinstance(value, Mapping) and part in value:
            value = value[part]
        else:
            raise KeyError(f"{path}: there is no {part!r}")
    return value


def replace_values(document: Any, changes: Mapping[str, Any], file: Path | str | None = None) -> Any:
    """A new document with the values at the given dotted paths replaced or added; other parts are shared.

    Entries of a list are addressed by number or by name. Raises DocumentError for a path that reaches nothing.
    """
    for path, value in changes.items():
        try:
            document = _replace_value(document, split_path(path), value)
        except KeyError as error:
            raise DocumentError(error.args[0], file=file, path=path) from None
    return document


def _replace_value(node: Any, parts: Sequence[str], value: Any) -> Any:
    """The node with the value at the place that the parts lead to; KeyError says which of them reaches nothing."""
    key: Any = parts[0]
    if isinstance(node, list):
        names = [_entry_name(entry) or str(number) for number, entry in enumerate(node)]
        key = int(key) if key.isdecimal() and int(key) < len(node) else names.index(key) if key in names else None
    if not isinstance(node, Mapping | list) or key is None:
        hint = suggest_name(parts[0], names if isinstance(node, list) else ())
        raise KeyError(f"there is no {parts[0]!r}: {hint}")
    result: Any = copy.copy(node)
    if len(parts) > 1:
        below = node[key] if isinstance(node, list) else node.get(key, {})
        value = _replace_value(below, parts[1:], value)
    result[key] = value
    return result


def plain_values(value: Any) -> Any:
    """A value as a TOML document holds it: NumPy numbers and arrays become numbers and lists, in tables too."""
    if type(value) is float:  # the usual case, first for speed
        return value
    if isinstance(value, Mapping):
        return {key: plain_values(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain_values(inner) for inner in value]
    return value.tolist() if hasattr(value, "tolist") else value


def match_paths(pattern: str, paths: Iterator[str] | list[str]) -> list[str]:
    """Paths that match a pattern; `*` matches any characters, also dots."""
    return [path for path in paths if _path_expression(pattern).match(path)]


@lru_cache(maxsize=1000)
def _path_expression(pattern: str) -> re.Pattern[str]:
    return re.compile(fnmatch.translate(pattern.replace("[", "[[]").replace("?", "[?]")))


def parse_model(model: Any, data: Any, file: Path | str | None, prefix: str = "") -> Any:
    """Validate data by a pydantic model; DocumentError with path, value and remedy for the first problem.

    An unknown key goes before a missing one: it is usually that key, mistyped. A retired key goes first.
    """
    from pydantic import ValidationError

    try:
        parsed = model.__pydantic_validator__.validate_python(data)  # what `model_validate` does, see `checked.Checked`
        check_numbers(data, parsed, file, prefix)
        return parsed
    except ValidationError as error:
        problems = error.errors(include_url=False)
        unknown = [entry for entry in problems if entry["type"] == "extra_forbidden"]
        retired = [entry for entry in unknown if entry["loc"][-1] in RETIRED]
        first = [*retired, *unknown, *problems][0]
        places = [".".join(filter(None, (prefix, *_location_in_data(data, entry)))) for entry in problems]
        path = places[problems.index(first)]
        if first["type"] == "extra_forbidden":
            message = f"unknown key: {suggest_name(first['loc'][-1], _field_names(model, first['loc'][:-1]))}"
        elif first["type"] == "missing":
            message = "missing" + _field_note(model, first["loc"])
        elif first["type"] in ("union_tag_invalid", "union_tag_not_found"):
            path, message = _unknown_kind(path, first)
        else:
            shown = "" if isinstance(first["input"], dict | list) else f"{first['input']!r}: "
            message = shown + requirement_words(
                *(entry for entry, place in zip(problems, places, strict=True) if place == path)
            )
        raise DocumentError(message, file=file, path=path) from None


def is_valid_for(model: Any, data: Any) -> bool:
    """Whether a pydantic model takes data that have a number, not true or "5", wherever the model asks for one."""
    from pydantic import ValidationError

    try:
        model.__pydantic_validator__.validate_python(data)
    except ValidationError:
        return False
    return True


def check_numbers(data: Any, parsed: Any, file: Path | str | None, prefix: str) -> None:
    """Raise DocumentError for a truth value or a text that pydantic has taken for a number."""
    for path, value in taken_for_numbers(data, parsed):
        where = ".".join(filter(None, (prefix, path)))
        raise DocumentError(f"{value!r}: must be a number", file=file, path=where)


def taken_for_numbers(data: Any, parsed: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Path and value of truth values and texts that pydantic has taken for numbers: true for 1, "5" for 5."""
    if isinstance(data, bool | str):
        taken = parsed if isinstance(parsed, list | tuple) else [parsed]  # a key may take one value for a list of it
        if any(isinstance(one, int | float) and not isinstance(one, bool) for one in taken):
            yield path, data
    elif isinstance(data, list | tuple) and isinstance(parsed, list | tuple):
        for number, pair in enumerate(zip(data, parsed, strict=False)):
            yield from taken_for_numbers(*pair, f"{path}.{number}".removeprefix("."))
    elif isinstance(data, Mapping):
        names = {field.alias or name: name for name, field in getattr(type(parsed), "model_fields", {}).items()}
        values = parsed if isinstance(parsed, Mapping) else {key: getattr(parsed, name) for key, name in names.items()}
        values = {**values, **(getattr(parsed, "model_extra", None) or {})}
        for key, value in data.items():
            if key in values:
                yield from taken_for_numbers(value, values[key], f"{path}.{key}".removeprefix("."))


def _unknown_kind(path: str, problem: Mapping[str, Any]) -> tuple[str, str]:
    """Path of the key that chooses between kinds of a block, and what is wrong with it."""
    key = problem["ctx"]["discriminator"].strip("'")
    if problem["type"] == "union_tag_not_found":
        return f"{path}.{key}", "missing"
    tag = problem["ctx"]["tag"]
    valid = [name.strip("' ") for name in problem["ctx"]["expected_tags"].split(",")]
    return f"{path}.{key}", f"{tag!r} is no {key}: {suggest_name(tag, valid)}"


def requirement_words(*problems: Mapping[str, Any]) -> str:
    """What pydantic's problems with a value say would be right: one, or one for each member of a union."""
    sentences = []
    for one in problems:
        limits = one.get("ctx", {})
        kind = "table" if limits.get("field_type") == "Dictionary" else "list"
        words = REQUIRED.get(one["type"])
        sentences.append(words.format(kind=kind, **limits) if words else one["msg"].removeprefix("Value error, "))
    if not all(one.startswith("must ") for one in sentences):
        return sentences[0]
    return " or ".join(dict.fromkeys(sentences)).replace(" or must be ", " or ").replace(" or must ", " or ")


def _location_in_data(data: Any, problem: Mapping[str, Any]) -> Iterator[str]:
    """The parts of a pydantic location that are in the data, such as keys, without the names of union members."""
    location = problem["loc"]
    for position, part in enumerate(location):
        listed = isinstance(data, list) and isinstance(part, int) and part < len(data)
        if listed or (isinstance(data, Mapping) and part in data):
            data = data[part]
        elif problem["type"] != "missing" or position < len(location) - 1:
            continue
        yield str(part)


def _field_note(model: Any, location: tuple[int | str, ...]) -> str:
    """What a key is, in parentheses, as its declaration says; empty where it says nothing."""
    fields = (kind.model_fields.get(str(location[-1])) for kind in _models_at(model, location[:-1]))
    notes = (field.description for field in fields if field is not None)
    return next((f" ({note})" for note in notes if note and note != "-"), "")


def _field_names(model: Any, location: tuple[int | str, ...]) -> list[str]:
    """Keys that a pydantic model allows at a place inside it, over all members of a union."""
    kinds = _models_at(model, location)
    return [name for kind in kinds for name in (kind.keys() if hasattr(kind, "keys") else kind.model_fields)]


def _models_at(model: Any, location: tuple[int | str, ...]) -> list[Any]:
    """The pydantic models at a place inside a model, over all members of a union.

    A part that is no key is the number of an entry, or the name of a member of the union: then its `kind`.
    """
    kinds = _models_in(model)
    for part in location:
        fields = [(kind, kind.model_fields.get(str(part))) for kind in kinds]
        inner = [one for _, field in fields if field for one in _models_in(field.annotation)]
        named = [kind for kind in kinds if "kind" in kind.model_fields]
        kinds = inner or [one for one in named if get_args(one.model_fields["kind"].annotation) == (part,)] or kinds
    return kinds


def _models_in(annotation: Any) -> list[Any]:
    """The pydantic models in a type: of a union's members, of a list's entries, of a table's values."""
    if hasattr(annotation, "model_fields"):
        return [annotation]
    return [kind for inner in get_args(annotation) for kind in _models_in(inner)]
