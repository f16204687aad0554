"""JSON Schemas of the documents, for editors: derived from the declarations that the parser checks them with.

They say which keys, kinds, types and ranges a document may have. What depends on several values at once, such as a
family that must exist, is checked when the document is read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, FiniteFloat, create_model

from shipid.errors import DocumentError, suggest_name
from shipid.files import write_json
from shipid.logs.mapping import UNITS, Clock, Column, File
from shipid.logs.mapping import Mapping as LogMapping
from shipid.logs.readers import READERS
from shipid.logs.repairs import REPAIRS
from shipid.simulation.draw import SHARED, ManoeuvreDraw, is_collection_type
from shipid.simulation.manoeuvre import KINDS
from shipid.vessel.load import VesselPatch
from shipid.vessel.perturb import Family, perturbation_model
from shipid.vessel.schema import TABLE, vessel_model

Schema = dict[str, Any]
DRAFT = "http://json-schema.org/draft-07/schema#"  # what editors of TOML know
FOLDER = ".shipid"  # in the folder of a document: holds the schema that its first line names
PARTIAL = "part of "  # of the names of blocks of which anything may be left out
NOISE = ("title", "discriminator")


def document_schema(name: str) -> Schema:
    """Return the JSON Schema (draft 7) of a kind of document: `vessel`, `study`, `mapping` or `settings`.

    A vessel may be whole, extend another, or be a patch. Raises DocumentError for another name.
    """
    if name not in SCHEMAS:
        raise DocumentError(f"no such document: {suggest_name(name, SCHEMAS)}", path=name)
    return {"$schema": DRAFT, "title": f"shipid {name} document", **SCHEMAS[name]()}


def add_schema_line(text: str, file: Path, name: str) -> str:
    """Return the text of a document with a first line that names its schema. The schema is written next to it.

    The line holds a relative path, so that it works wherever the folder goes: on another machine, or in a repository.
    """
    place = file.parent / FOLDER / f"{name}.schema.json"
    write_json(place, document_schema(name))
    return f"#:schema ./{FOLDER}/{place.name}\n{text}"


def _study_schema() -> Schema:
    from shipid.hybrid.methods import METHODS  # with PyTorch, which a draft of a vessel or a mapping needs not
    from shipid.identification.settings import Identify
    from shipid.observer import Observer
    from shipid.simulation.truth import Truth
    from shipid.study.schema import MethodBlock, Study

    shared = {name: (field.annotation, field) for name, field in MethodBlock.model_fields.items()}
    methods = [_model_of_kind("method", kind, method, shared) for kind, method in METHODS.items()]
    blocks: dict[str, Any] = {
        "perturb": (list[perturbation_model()], []),  # type: ignore[misc]
        "observer": (Observer | None, None),
        "identify": (Identify | None, None),
    }
    family = create_model("family", __base__=Family, **blocks)
    drawn: dict[str, Any] = {"manoeuvre": (list[_union_of_models(list(_draw_models()))], [])}  # type: ignore[misc]
    truth = create_model("truth", __base__=Truth, **drawn)
    fields: dict[str, Any] = {
        "truth": (truth | None, None),
        "family": (Annotated[list[family], *Study.model_fields["family"].metadata], ...),  # type: ignore[valid-type]
        "method": (Annotated[list[_union_of_models(methods)], *Study.model_fields["method"].metadata], []),  # type: ignore[misc]
    }
    return _model_schema(create_model("study", __base__=Study, **fields))


def _settings_schema() -> Schema:
    from shipid.identification.outcome import SettingsFile

    return _model_schema(SettingsFile)


class _ClosedModel(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _OrderedModel(BaseModel):
    """All other keys are commands: a number, a range, or a table of the commands of a component."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, FiniteFloat | tuple[FiniteFloat, FiniteFloat] | dict[str, Any]]


def _draw_models() -> Iterator[type[BaseModel]]:
    """A model for each kind of `[[truth.manoeuvre]]`: the keys of the kind, a range in place of a number."""
    default = ManoeuvreDraw.model_fields["kind"].default
    for kind, model in KINDS.items():
        fields: dict[str, Any] = {
            "share": (ManoeuvreDraw.model_fields["share"].annotation, ManoeuvreDraw.model_fields["share"])
        }
        for name, field in model.model_fields.items():
            if name in SHARED or name == "orders":
                continue
            one: Any = Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
            needed = field.is_required() and name != "seed"
            fields[name] = (
                one if is_collection_type(field.annotation) else _type_or_range(one),
                ... if needed else None,
            )
        fields["kind"] = (Literal[kind], kind if kind == default else ...)
        base = _OrderedModel if "orders" in model.model_fields else _ClosedModel
        yield create_model(f"manoeuvre_{kind}", __base__=base, **fields)


def _type_or_range(one: Any) -> Any:
    """A value, or a pair of numbers to draw from, or texts of which one is drawn."""
    bare = get_args(one)[0] if get_origin(one) is Annotated else one
    every = get_args(bare) if get_origin(bare) in (Union, UnionType, Literal) else (bare,)
    if all(isinstance(each, str) or each is str for each in every):
        return one | list[one]
    return one | tuple[FiniteFloat, FiniteFloat]


def _mapping_schema() -> Schema:
    texts = [_model_of_kind("format", kind, reader.options, default="text") for kind, reader in READERS.items()]
    format_: Any = _union_of_models(texts)
    repairs: Any = _union_of_models([_model_of_kind("repair", kind, pair[0]) for kind, pair in REPAIRS.items()])
    every: Any = Literal[tuple(dict.fromkeys(unit for units in UNITS.values() for unit in units))]
    of_time: Any = Literal[tuple(UNITS["s"])]
    column = create_model("column", __base__=Column, unit=(every, ...))
    clock = create_model("clock", __base__=Clock, unit=(of_time, "s"))
    file = create_model("file", __base__=File, format=(format_, None))
    fields: dict[str, Any] = {
        "format": (format_, None),
        "clock": (clock, ...),
        "columns": (dict[str, column], ...),  # type: ignore[valid-type]
        "file": (dict[str, file], {}),  # type: ignore[valid-type]
        "repair": (list[repairs], []),
    }
    schema = _model_schema(create_model("mapping", __base__=LogMapping, **fields))
    del schema["properties"]["digest"]  # is computed, not written
    schema["required"].remove("digest")
    return schema


def _vessel_schema() -> Schema:
    """A whole vessel; one that extends another, of which anything may be left out; or a patch on one."""
    whole, patch = _model_schema(vessel_model()), _model_schema(VesselPatch)
    blocks = whole.pop("$defs")
    for name, block in blocks.items():
        if TABLE in block.get("properties", {}):  # read from a file when the vessel is
            columns = block["properties"][TABLE]
            words = "path of a CSV file from this document's folder"
            blocks[name]["properties"][TABLE] = {"anyOf": [{"type": "string", "description": words}, columns]}
    extends = {"type": "string", "description": "bundled name or path of a vessel: what this document leaves out"}
    part = _partial_schema({**whole, "properties": {"extends": extends, **whole["properties"]}})
    keys = {**{name: {} for name in patch["properties"]}, **part["properties"]}
    return {
        "type": "object",
        "properties": keys,
        "if": {"required": ["base"]},
        "then": {"$ref": "#/$defs/patch"},
        "else": {
            "if": {"required": ["extends"]},
            "then": {"$ref": "#/$defs/extending vessel"},
            "else": {"$ref": "#/$defs/whole vessel"},
        },
        "$defs": {
            **blocks,
            **{f"{PARTIAL}{name}": _partial_schema(block) for name, block in blocks.items()},
            "whole vessel": whole,
            "extending vessel": part,
            "patch": {**patch, "required": ["base"]},
        },
    }


def _partial_schema(node: Any) -> Any:
    """The schema without any required key, at every level."""
    if isinstance(node, list):
        return [_partial_schema(entry) for entry in node]
    if not isinstance(node, Mapping):
        return node
    result = {
        key: _partial_schema(value) for key, value in node.items() if key != "required" or not isinstance(value, list)
    }
    if isinstance(result.get("$ref"), str):
        result["$ref"] = result["$ref"].replace("#/$defs/", f"#/$defs/{PARTIAL}")
    if "oneOf" in result:  # without what is required, several may fit
        result["anyOf"] = result.pop("oneOf")
    return result


def _model_of_kind(
    what: str, kind: str, model: type[BaseModel], further: Mapping[str, Any] | None = None, default: str = ""
) -> type[BaseModel]:
    """The model of a kind with a fixed `kind` and further fields."""
    fields: dict[str, Any] = {**(further or {}), "kind": (Literal[kind], kind if kind == default else ...)}
    return create_model(f"{what}_{kind}", __base__=model, **fields)


def _union_of_models(models: list[type[BaseModel]]) -> Any:
    return Union[tuple(models)]  # noqa: UP007  of a list


def _model_schema(model: type[BaseModel]) -> Schema:
    schema: Schema = _portable_schema(model.model_json_schema())
    return schema


def _portable_schema(node: Any) -> Any:
    """The schema as every draft since the sixth reads it: no null, which TOML has not, and pairs as lists of two."""
    if isinstance(node, list):
        return [_portable_schema(entry) for entry in node]
    if not isinstance(node, Mapping):
        return node
    result = {
        key: {name: _portable_schema(inner) for name, inner in value.items()}
        if key in ("properties", "$defs")
        else _portable_schema(value)
        for key, value in node.items()
        if key not in NOISE and not (key == "default" and value is None)
    }
    pair = result.pop("prefixItems", None)
    if pair is not None:
        result["items"] = pair[0] if all(entry == pair[0] for entry in pair) else {"anyOf": pair}
    if isinstance(options := result.get("anyOf"), list):
        left = [option for option in options if option != {"type": "null"}]
        if len(left) == 1:
            del result["anyOf"]
            result = {**left[0], **result}
        else:
            result["anyOf"] = left
    return result


SCHEMAS: dict[str, Callable[[], Schema]] = {
    "vessel": _vessel_schema,
    "study": _study_schema,
    "mapping": _mapping_schema,
    "settings": _settings_schema,
}
"""Kind of document -> what makes its schema."""
