"""Bindings of the numbers of a vessel document to the keyword arguments of the physics functions, with units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from shipid.document import Document
from shipid.physics import ACTUATORS, TERMS
from shipid.physics.grammar import Grammar
from shipid.physics.inertia import added_mass_entries, rigid_body_entries
from shipid.physics.signals import SIGNALS
from shipid.vessel.schema import SHARED, Parameter, active_actuators, function_parameters, term_blocks, term_parameters

Binding = dict[str, str | list[str] | dict[str, str] | float]


def bind_block(path: str, block: Mapping[str, Any], declared: tuple[Parameter, ...]) -> Binding:
    """Keyword -> dotted path, list or table of paths, or default value, for one physics function.

    path, block : of the document. declared : parameters of the function.
    """
    result: Binding = {}
    for parameter in declared:
        name = parameter.name
        if parameter.kind == "open":
            closed = {other.name for other in declared}
            numbers = [  # not `kind`, `off`, actuators
                key for key, value in block.items() if isinstance(value, int | float) and not isinstance(value, bool)
            ]
            result.update({key: f"{path}.{key}" for key in numbers if key not in closed})
        elif parameter.kind == "list":
            result[name] = [f"{path}.{name}.{i}" for i in range(len(block[name]))]
        elif parameter.kind == "table":
            if name in block or not parameter.optional:
                result[name] = {key: f"{path}.{name}.{key}" for key in block[name]}
        elif name in block:
            result[name] = f"{path}.{name}"
        elif name in SHARED:
            result[name] = f"{SHARED[name]}.{name}"
        elif parameter.default is not None:
            result[name] = parameter.default
    return result


def _equation_blocks(
    document: Document,
) -> Iterator[tuple[str, Mapping[str, Any], tuple[Parameter, ...], str | None]]:
    """Dotted path, block and parameters of all that the equations use; of an actuator, too, the unit that it moves."""
    yield "inertia", document["inertia"], function_parameters(rigid_body_entries), None
    yield "added_mass", document.get("added_mass", {}), function_parameters(added_mass_entries), None
    for path, key, block in term_blocks(document):
        yield path, block, term_parameters(TERMS[key]), None
        for command, actuator in active_actuators(block):
            declared = function_parameters(ACTUATORS[actuator["kind"]].advance)
            yield f"{path}.actuator.{command}", actuator, declared, SIGNALS[command].unit


def bind_document(document: Document) -> dict[str, Binding]:
    """Dotted path of every block that the equations use -> the binding of its function's keywords."""
    return {path: bind_block(path, block, declared) for path, block, declared, _ in _equation_blocks(document)}


def parameter_units(document: Document) -> dict[str, str]:
    """Dotted path -> unit of every parameter, in the order of use."""
    rows: list[tuple[str, str]] = []
    for path, block, parameters, moved in _equation_blocks(document):
        declared = {parameter.name: parameter.unit for parameter in parameters}
        table = next((parameter.unit for parameter in parameters if parameter.kind == "open"), "")
        for keyword, target in bind_block(path, block, parameters).items():
            unit = declared.get(keyword, table)
            if isinstance(target, str):
                rows.append((target, unit.unit(keyword) if isinstance(unit, Grammar) else _resolve_unit(unit, moved)))
            elif isinstance(target, list):
                rows += [(entry, str(unit)) for entry in target]
            elif isinstance(target, dict) and isinstance(unit, Grammar):
                rows += [(entry, unit.unit(key)) for key, entry in target.items()]
    return dict(rows)


def _resolve_unit(unit: str, moved: str | None) -> str:
    """The unit of a number; of one of an actuator that is `of the command`, with the unit of what is moved."""
    if moved is None or not unit.endswith("of the command"):
        return unit
    if unit == "of the command":
        return moved
    return "1/s" if moved == "-" else f"{moved}^2" if moved.endswith("/s") else f"{moved}/s"
