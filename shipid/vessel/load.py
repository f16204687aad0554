"""From a document to a vessel: every number checked and addressed by its dotted path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, FiniteFloat

from shipid import document as documents
from shipid.document import Document
from shipid.errors import DocumentError, choices
from shipid.physics import ACTUATORS, TERMS
from shipid.physics.grammar import Grammar
from shipid.physics.inertia import added_mass, rigid_body
from shipid.vessel.schema import (
    DOFS,
    SHARED,
    Parameter,
    parameters,
    term_blocks,
    vessel_model,
)

Binding = dict[str, str | list[str] | dict[str, str] | float]


@dataclass(frozen=True)
class Vessel:
    """A checked vessel document.

    document : plain nested data, after any patch.
    file : where it was read from.
    digest : of the document, so that a patch knows its base.
    """

    document: Document
    file: str
    digest: str = field(default="")

    @property
    def name(self) -> str:
        """Name for people, such as `R/V Gunnerus, 28.9 m`."""
        return str(self.document["name"])

    @property
    def key(self) -> str:
        """Short name: the file's stem."""
        return Path(self.file).stem

    @property
    def axes(self) -> tuple[int, ...]:
        """Rows of the six degrees of freedom that this vessel moves in."""
        return DOFS[self.document["dof"]]

    @cached_property
    def units(self) -> dict[str, str]:
        """Dotted path -> unit of every parameter, in document order of use."""
        return dict(_all_units(self))

    @cached_property
    def parameters(self) -> dict[str, float]:
        """Dotted path -> value of every number that the equations use."""
        return {path: float(documents.get(self.document, path)) for path in self.units}

    @cached_property
    def structure(self) -> str:
        """Digest of the document without its parameters' values: vessels of one structure compile once."""
        return documents.digest(documents.replace(_without_words(self.document), dict.fromkeys(self.parameters, 0)))

    def with_values(self, values: Mapping[str, Any]) -> Vessel:
        """The same vessel with numbers replaced or blocks added at dotted paths; checked like any document."""
        return check_vessel(documents.replace(self.document, values), self.file)


def load_vessel(name: str, relative_to: Path | None = None) -> Vessel:
    """Read a bundled vessel by name, or a vessel or patch document by path.

    A patch has `base` (a vessel), optionally `base_digest`, and `[set]` with dotted paths; see `shipid.vessel.perturb`.
    """
    file = documents.find(name, "models", relative_to)
    document = documents.read(file)
    if "base" in document:
        return _patched(document, file)
    return check_vessel(document, str(file))


class Patch(BaseModel):
    """A patch document: a base vessel, the digest it was made for, and values by dotted path."""

    model_config = ConfigDict(extra="forbid")
    base: str
    base_digest: str | None = None
    name: str | None = None
    source: str | None = None
    set: dict[str, Annotated[FiniteFloat, "value"]] = {}
    provenance: dict[str, Any] = {}


def _patched(document: Document, file: Path) -> Vessel:
    patch: Patch = documents.parse(Patch, document, file)
    base = load_vessel(patch.base, relative_to=file.parent)
    if patch.base_digest not in (None, base.digest):
        raise DocumentError(
            f"{patch.base_digest!r}: the base {patch.base!r} has changed since (now {base.digest!r}); make the patch anew",
            file=file,
            path="base_digest",
        )
    for path in patch.set:
        if path not in base.parameters:
            raise DocumentError(
                f"{patch.base} has no such parameter: {choices(path, base.parameters)}", file=file, path=f"set.{path}"
            )
    named = documents.replace(base.document, {**patch.set, "name": patch.name or f"{base.name} ({file.stem})"})
    return check_vessel(named, str(file))


def check_vessel(document: Document, file: str) -> Vessel:
    """Check a whole document; the first fault raises DocumentError with file, dotted path and remedy."""
    documents.parse(vessel_model(), document, file)
    vessel = Vessel(document, file, documents.digest(document))
    names = [path.rsplit(".", 1)[-1] for path, _, _ in term_blocks(document)]
    for name in names:
        if names.count(name) > 1:
            raise DocumentError(f"two components are called {name!r}: commands go by this name", file=file, path=name)
    for path, _, block in term_blocks(document):
        _check_lists(path, block, file)
    _check_units(vessel)
    return vessel


def _check_lists(path: str, block: Mapping[str, Any], file: str) -> None:
    lists = {key: value for key, value in block.items() if isinstance(value, list)}
    lengths = {len(value) for value in lists.values()}
    if len(lengths) > 1:
        found = ", ".join(f"{key} {len(value)}" for key, value in lists.items())
        raise DocumentError(f"the columns of a table must be equally long, found {found}", file=file, path=path)
    for key, value in lists.items():
        if key.endswith("_deg") and any(b <= a for a, b in zip(value, value[1:], strict=False)):
            raise DocumentError("must rise from entry to entry", file=file, path=f"{path}.{key}")


def _check_units(vessel: Vessel) -> None:
    for path in vessel.units:
        try:
            documents.get(vessel.document, path)
        except KeyError:
            group, name = path.rsplit(".", 1)
            raise DocumentError(f"missing: a term needs {name}, here or in its own block", file=vessel.file, path=f"{group}.{name}") from None


def bind(document: Document, path: str, block: Mapping[str, Any], declared: tuple[Parameter, ...]) -> Binding:
    """Keyword -> dotted path (or list, table of paths, or default value) for one physics function."""
    result: Binding = {}
    for parameter in declared:
        name = parameter.name
        if parameter.kind == "open":
            closed = {other.name for other in declared} | {"source", "off", "kind"}
            result.update({key: f"{path}.{key}" for key in block if key not in closed})
        elif parameter.kind == "list":
            result[name] = [f"{path}.{name}.{i}" for i in range(len(block[name]))]
        elif parameter.kind == "table":
            result[name] = {key: f"{path}.{name}.{key}" for key in block[name]}
        elif name in block:
            result[name] = f"{path}.{name}"
        elif name in SHARED:
            result[name] = f"{SHARED[name]}.{name}"
        elif parameter.default is not None:
            result[name] = parameter.default
    return result


def bindings(vessel: Vessel) -> dict[str, Binding]:
    """Dotted path of every block that the equations use -> the binding of its function's keywords."""
    document = vessel.document
    found = {"inertia": bind(document, "inertia", document["inertia"], parameters(rigid_body))}
    found["added_mass"] = bind(document, "added_mass", document.get("added_mass", {}), parameters(added_mass))
    for path, key, block in term_blocks(document):
        found[path] = bind(document, path, block, parameters(TERMS[key].function))
        for command, actuator in (block.get("actuator") or {}).items():
            if isinstance(actuator, Mapping):
                where = f"{path}.actuator.{command}"
                found[where] = bind(document, where, actuator, parameters(ACTUATORS[actuator["kind"]].advance))
    return found


def _all_units(vessel: Vessel) -> list[tuple[str, str]]:
    document = vessel.document
    functions: dict[str, Any] = {"inertia": rigid_body, "added_mass": added_mass}
    for path, key, block in term_blocks(document):
        functions[path] = TERMS[key].function
        for command, actuator in (block.get("actuator") or {}).items():
            if isinstance(actuator, Mapping):
                functions[f"{path}.actuator.{command}"] = ACTUATORS[actuator["kind"]].advance
    rows: list[tuple[str, str]] = []
    for where, binding in bindings(vessel).items():
        declared = {parameter.name: parameter for parameter in parameters(functions[where])}
        table = next((parameter for parameter in declared.values() if parameter.kind == "open"), None)
        for keyword, target in binding.items():
            parameter = declared.get(keyword, table)
            assert parameter is not None
            unit = parameter.unit
            if isinstance(target, str):
                rows.append((target, unit.unit(keyword) if isinstance(unit, Grammar) else unit))
            elif isinstance(target, list):
                rows += [(path, str(unit)) for path in target]
            elif isinstance(target, dict):
                assert isinstance(unit, Grammar)
                rows += [(path, unit.unit(key)) for key, path in target.items()]
    return list(dict.fromkeys(rows))


def _without_words(document: Document) -> Document:
    """The document without names and sources, which change nothing in the equations."""
    return {
        key: _without_words(value) if isinstance(value, dict) else value
        for key, value in document.items()
        if key not in ("source", "name", "description")
    }
