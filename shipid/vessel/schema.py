"""Schema of vessel documents, derived from the signatures of the physics functions, and the bindings to these."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, reduce
from numbers import Real
from operator import or_
from types import GenericAlias
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, create_model, model_validator

from shipid.document import Document
from shipid.errors import ShipidError, suggest_name
from shipid.physics import ACTUATORS, GIVEN, MOTION, TERMS, ActuatorModel, Term
from shipid.physics.grammar import POSITIVE, Grammar
from shipid.physics.inertia import added_mass_entries, rigid_body_entries
from shipid.physics.signals import SIGNALS, rows_of_role
from shipid.physics.symbols import argument_types
from shipid.plugins import definition_location, error_location, locate_errors
from shipid.units import join_names, unit_fault
from shipid.vessel.ranges import UNUSUAL

FIXED = ("hull", "restoring", "radiation", "waves")  # groups whose members go by the name of their kind, one of each
GROUPS = (*FIXED, "wind", "thruster")
NAME = r"[A-Za-z][A-Za-z0-9_-]*"  # of a kind
RESERVED = ("off", "source", "kind", "actuator", "behind")  # keys that blocks have beside parameters
POSITIONAL = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
DOFS = {3: (0, 1, 5), 4: (0, 1, 3, 5), 6: (0, 1, 2, 3, 4, 5)}
PARTICULARS = {
    "L_pp": "m",
    "L_oa": "m",
    "B": "m",
    "T": "m",
    "C_b": "-",
    "U_0": "m s^-1",
}
CONSTANTS = {"rho": "kg m^-3", "rho_a": "kg m^-3", "g": "m s^-2"}
SHARED = {**dict.fromkeys(PARTICULARS, "particulars"), **dict.fromkeys(CONSTANTS, "constants")}
BEHIND = "behind"  # the key that names another component
TABLE = "table"  # the structural key that names a file of columns; every other one is a whole number
_CORIOLIS = Annotated[Literal["full", "mmg", "none"], Field(description="what the hull's derivatives do not hold")]
_TURNING = Annotated[Literal["full", "none"], Field(description="whether the mass turns with the ship")]
_Table = dict[str, Annotated[list[FiniteFloat], Field(min_length=4)]]
Binding = dict[str, str | list[str] | dict[str, str] | float]


@cache
def split_keys(keys: tuple[Any, ...]) -> tuple[tuple[str, str], ...]:
    """Group and kind of each key of TERMS; ShipidError for a key that is not `<group>.<kind>`."""
    pairs = []
    for key in keys:
        group, _, kind = str(key).partition(".")
        if not isinstance(key, str) or group not in GROUPS or not re.fullmatch(NAME, kind) or kind in RESERVED:
            place = definition_location(TERMS[key].function) if key in TERMS else ""
            remedy = f"write <block>.<kind>, such as TERMS['hull.drag'], with one of the blocks {join_names(GROUPS)}"
            raise ShipidError(f"TERMS[{key!r}]: no block of a vessel document and a kind in it: {remedy}{place}")
        pairs.append((group, kind))
    return tuple(pairs)


def check_term(key: str) -> Term:
    """The term of a key of TERMS; ShipidError, one line with its place, where its functions cannot be used."""
    term = TERMS[key]
    split_keys((key,))
    _check_functions(key, term)
    return term


TERMS.check = check_term  # of packages: physics knows no documents


@cache
def _check_functions(key: str, term: Term) -> None:
    gives = {f"{name} of {key}": function for name, function in term.gives.items()}
    read = {key: term.function, **gives, f"rates of {key}": term.rates}  # whose arguments are signals and parameters
    others = {"components": term.components, "drawn": term.drawn, "states": term.states}
    for where, function in {**read, **{f"{part} of {key}": one for part, one in others.items()}}.items():
        if function is not None and not callable(function):
            raise ShipidError(f"{where} must be a function, not {function!r}")
    place = definition_location(term.function)
    if (term.states is None) != (term.rates is None):
        raise ShipidError(f"{key}: `states` and `rates` belong together: it needs both, or neither{place}")
    outputs = [*rows_of_role("output"), *GIVEN]
    unknown = next((name for name in term.gives if name not in outputs), None)
    if unknown is not None:
        raise ShipidError(f"{key}: it gives {unknown!r}, which is no output: {suggest_name(unknown, outputs)}{place}")
    for where, function in read.items():
        if function is not None:
            _check_signature(where, term, function)


def _check_signature(where: str, term: Term, function: Any) -> None:
    """ShipidError for an argument that is neither a signal nor a parameter with its unit."""
    place = definition_location(function)
    try:
        hints = argument_types(function)
        arguments = inspect.signature(function).parameters
    except (TypeError, ValueError, NameError, AttributeError, SyntaxError) as error:
        raise ShipidError(f"{where}: its arguments cannot be read ({error}): write a plain function{place}") from None
    sums = function is term.function and bool(term.components or term.drawn)  # over arrays named as they are called
    for argument in arguments.values():
        if fault := _argument_fault(argument, hints.get(argument.name), () if sums else term_signals(term)):
            raise ShipidError(f"{where}: {fault}{place}")


def _argument_fault(argument: inspect.Parameter, hint: Any, signals: tuple[str, ...]) -> str:
    """What is wrong with an argument; empty for nothing. signals : names of positional ones; empty: any."""
    name, known = argument.name, get_origin(hint) is Annotated
    parameter = f'{name}: Annotated[SX, "m"]'
    if argument.kind in (*POSITIONAL, argument.VAR_POSITIONAL):
        if argument.kind in POSITIONAL and not known and (not signals or name in signals):
            return ""
        remedy = f"a parameter is behind a `*`, with its unit: `*, {parameter}`"
        return f"its positional argument {name!r} is no signal: {suggest_name(name, signals)}: {remedy}"
    base, unit = get_args(hint)[:2] if known else (hint, None)
    tables = any(get_origin(one) in (Mapping, dict) or one in (Mapping, dict) for one in (base, *get_args(base)))
    if name in RESERVED:
        return f"its parameter {name!r} is a key that blocks have anyway: use another name"
    if argument.kind is argument.VAR_KEYWORD or tables:
        return "" if isinstance(unit, Grammar) else f"{name!r} is a table and needs a grammar of shipid.physics.grammar"
    if not isinstance(unit, str | Grammar):
        return f"its parameter {name!r} has no unit: write `{parameter}`; a constant belongs outside the signature"
    if isinstance(unit, str) and (remedy := unit_fault(unit)):
        return f"the unit {unit!r} of its parameter {name!r} is not known: {remedy}"
    default = argument.default
    if default not in (argument.empty, None) and (isinstance(default, bool) or not isinstance(default, Real)):
        return f"the default of its parameter {name!r} must be a number, not {default!r}"
    return ""


def term_signals(term: Term) -> tuple[str, ...]:
    """Positional arguments that the functions of a term may have, beside the arrays that it sums over."""
    own = [name for name in MOTION if name != "state" or term.states is not None]
    return (*own, *GIVEN, *rows_of_role("command"), *rows_of_role("environment"))


def term_states(key: str, block: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the additional states of a term; empty for a term without; ShipidError for what is no such names."""
    function = TERMS[key].states
    if function is None:
        return ()
    names = call_user_function(f"states of {key}", function, block)
    if not isinstance(names, tuple | list) or not all(isinstance(name, str) for name in names) or not names:
        raise ShipidError(
            f"states of {key} must return names, such as ('x', 'y'), not {names!r}{definition_location(function)}"
        )
    return tuple(names)


def call_user_function(where: str, function: Callable[..., Any], *signals: Any, **keywords: Any) -> Any:
    """What a function of a term returns; ShipidError with its place for an error in one that a user wrote.

    where : the function in words, the beginning of the line.
    """
    with locate_errors(where, function, "term"):
        try:
            return function(*signals, **keywords)
        except RuntimeError as error:
            if "truth value" not in str(error):
                raise
            words = "Python's `if`, `and`, `or`, `min` and `max` cannot decide by a symbol"
            remedy = "write ca.if_else(condition, one, other), ca.fmin or ca.fmax"
            raise ShipidError(f"{where}: {words}: {remedy}{error_location(error, function)}") from error


@dataclass(frozen=True)
class Parameter:
    """One keyword argument of a physics function: its unit (or grammar), shape and default.

    optional : whether a block may do without it, though it has no default: a table that is None by default.
    """

    name: str
    unit: str | Grammar
    kind: Literal["number", "list", "table", "open"]
    positive: bool
    default: float | None
    optional: bool = False


@cache
def function_parameters(function: Callable[..., Any]) -> tuple[Parameter, ...]:
    """Parameters of a physics function, in order, from its keyword-only arguments and `**` table."""
    hints = argument_types(function)
    result = []
    for name, argument in inspect.signature(function).parameters.items():
        read = argument.kind in (argument.KEYWORD_ONLY, argument.VAR_KEYWORD)
        if not read or get_origin(hints.get(name)) is not Annotated:
            continue
        base, unit, *marks = get_args(hints[name])
        kind: Literal["number", "list", "table", "open"] = "number"
        if argument.kind is argument.VAR_KEYWORD:
            kind = "open"
        elif get_origin(base) is list:
            kind = "list"
        elif isinstance(unit, Grammar):
            kind = "table"
        default = None if argument.default in (argument.empty, None) else float(argument.default)
        result.append(Parameter(name, unit, kind, POSITIVE in marks, default, argument.default is None))
    return tuple(result)


@cache
def term_parameters(term: Term) -> tuple[Parameter, ...]:
    """Parameters of a term: of its function, then those that only what it gives, or its rates, take."""
    functions = (term.function, *term.gives.values(), *([term.rates] if term.rates else []))
    result: dict[str, Parameter] = {}
    for function in functions:
        for parameter in function_parameters(function):
            result.setdefault(parameter.name, parameter)
    return tuple(result.values())


@cache
def function_signals(function: Callable[..., Any]) -> tuple[str, ...]:
    """Positional arguments of a physics function."""
    return tuple(
        name for name, argument in inspect.signature(function).parameters.items() if argument.kind in POSITIONAL
    )


@cache
def structural_keys(term: Term) -> tuple[str, ...]:
    """Structural keys of a term that sums over components, such as the whole number `strips`, or a `table`."""
    source = term.components or term.drawn
    return tuple(inspect.signature(source).parameters) if source else ()


@cache
def upstream_signals(term: Term) -> tuple[str, ...]:
    """Signals that a term takes from the component that its block says it is behind."""
    return tuple(name for name in function_signals(term.function) if name in GIVEN)


class VesselBlock(BaseModel):
    """Base model of a block of a vessel document: only declared keys, and `source`."""

    model_config = ConfigDict(extra="forbid", strict=True)  # strict: the document itself is used, not a converted copy
    source: str | None = Field(default=None, description="where the numbers come from")


def _number_type(parameter: Parameter) -> Any:
    return Annotated[FiniteFloat, Field(gt=0)] if parameter.positive else FiniteFloat


def block_model(name: str, declared: tuple[Parameter, ...], **extra: Any) -> type[VesselBlock]:
    """Pydantic model of the block that feeds a physics function; `extra` fields go beside its parameters."""
    fields: dict[str, Any] = dict(extra)
    validators: dict[str, Any] = {}
    config: dict[str, Any] = {}
    for parameter in declared:
        if parameter.kind == "open" and isinstance(parameter.unit, Grammar):
            config = {"extra": "allow", "json_schema_extra": {"additionalProperties": False}}  # on a page of keys
            fields["__pydantic_extra__"] = (dict[str, FiniteFloat], Field(init=False))
            validators["names_are_formulas"] = model_validator(mode="after")(_name_check(parameter.unit))
            continue
        note = Field(description=parameter.unit if isinstance(parameter.unit, str) else "by name")
        if parameter.kind == "list":
            fields[parameter.name] = (
                Annotated[GenericAlias(list, (_number_type(parameter),)), Field(min_length=2), note],
                ...,
            )
        elif isinstance(parameter.unit, Grammar):
            table: Any = Annotated[dict[str, FiniteFloat], AfterValidator(parameter.unit.check)]
            fields[parameter.name] = (
                (Annotated[table | None, note], None) if parameter.optional else (Annotated[table, note], ...)
            )
        elif parameter.name in SHARED:
            fields[parameter.name] = (Annotated[_number_type(parameter) | None, note], None)
        else:
            default = ... if parameter.default is None else parameter.default
            fields[parameter.name] = (Annotated[_number_type(parameter), note], default)
    return create_model(name, __base__=VesselBlock, __cls_kwargs__=config, __validators__=validators, **fields)


def _name_check(grammar: Grammar) -> Callable[[Any], Any]:
    def check(block: Any) -> Any:
        grammar.check(block.model_extra or {})
        return block

    return check


def _dimension_model(name: str, units: Mapping[str, str]) -> type[VesselBlock]:
    fields: dict[str, Any] = {
        key: (Annotated[FiniteFloat, Field(gt=0, description=unit)] | None, None) for key, unit in units.items()
    }
    return create_model(name, __base__=VesselBlock, **fields)


def term_model(key: str) -> type[VesselBlock]:
    """Model of one kind of term: its parameters, its structural counts, its actuators, and `off`."""
    term = check_term(key)
    known = rows_of_role("command")
    commands = tuple(signal for signal in function_signals(term.function) if signal in known)
    return _term_model(key, term, commands, tuple(ACTUATORS.items()))


@cache
def _term_model(
    key: str, term: Term, commands: tuple[str, ...], memories: tuple[tuple[str, ActuatorModel], ...]
) -> type[VesselBlock]:
    """Model of a term with these commands and kinds of actuator; kept by them, for a notebook may put in others."""
    group, kind = key.split(".")
    extra: dict[str, Any] = {"off": (bool, False)}
    if group not in FIXED:
        extra["kind"] = (Literal[kind], ...)
    for name in structural_keys(term):
        extra[name] = (_Table, ...) if name == TABLE else (Annotated[int, Field(ge=1, le=1000)], ...)
    if commands:
        fields: dict[str, Any] = {command: (_actuator_model(memories) | None, None) for command in commands}
        extra["actuator"] = (create_model(f"{kind}_actuators", __base__=VesselBlock, **fields) | None, None)
    if upstream_signals(term):
        extra[BEHIND] = (Annotated[str, Field(description="the propeller in whose slipstream it is")], ...)
    return block_model(f"{group}_{kind}", term_parameters(term), **extra)


def active_actuators(block: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Command and block of every actuator of a term that is not off."""
    for command, actuator in (block.get("actuator") or {}).items():
        if isinstance(actuator, Mapping) and not actuator.get("off", False):
            yield command, actuator


@cache
def _actuator_model(memories: tuple[tuple[str, ActuatorModel], ...]) -> Any:
    """Model of any kind of actuator."""
    return _union_by_kind(
        [
            block_model(
                f"actuator_{kind}", function_parameters(memory.advance), kind=(Literal[kind], ...), off=(bool, False)
            )
            for kind, memory in memories
        ]
    )


def _union_by_kind(models: list[type[VesselBlock]]) -> Any:
    return Annotated[reduce(or_, models), Field(discriminator="kind")] if len(models) > 1 else models[0]


def _keys_of_group(group: str) -> list[str]:
    return [key for key, (of, _) in zip(TERMS, split_keys(tuple(TERMS)), strict=True) if of == group]


def vessel_model(document: Mapping[str, Any]) -> type[BaseModel]:
    """Pydantic model of a whole vessel document, with the terms of installed packages that it names."""
    for _, key, _ in (*term_blocks(document), *term_blocks(document, off=True)):
        TERMS.get(key)
    return _vessel_model(tuple(TERMS.items()), tuple(ACTUATORS.items()), tuple(rows_of_role("command")))


@cache
def _vessel_model(terms: tuple[tuple[str, Term], ...], *_: object) -> type[BaseModel]:
    """Model of a vessel document with these terms; kept by all that it is made of, for a notebook may put in others."""
    split_keys(tuple(key for key, _ in terms))
    of = {key: term_model(key) for key, _ in terms}
    wind, thruster = (_union_by_kind([of[key] for key in _keys_of_group(group)]) for group in ("wind", "thruster"))
    fixed: dict[str, dict[str, Any]] = {
        group: {key.split(".")[1]: (of[key] | None, None) for key in _keys_of_group(group)} for group in FIXED
    }
    current: dict[str, Any] = {"kind": (Literal["uniform"], ...)}
    fields: dict[str, Any] = {
        "name": (str, ...),
        "description": (str | None, None),
        "dof": (Literal[3, 4, 6], ...),
        UNUSUAL: (Annotated[list[str], Field(description="paths of numbers that may be outside their range")], []),
        "particulars": (_dimension_model("particulars", PARTICULARS) | None, None),
        "constants": (_dimension_model("constants", CONSTANTS) | None, None),
        "inertia": (block_model("inertia", function_parameters(rigid_body_entries), coriolis=(_TURNING, "full")), ...),
        "added_mass": (
            block_model("added_mass", function_parameters(added_mass_entries), coriolis=(_CORIOLIS, "full")) | None,
            None,
        ),
        **{group: (create_model(group, __base__=VesselBlock, **fixed[group]) | None, None) for group in FIXED},
        "wind": (wind | None, None),
        "thruster": (GenericAlias(dict, (Annotated[str, Field(pattern=f"^{NAME}$")], thruster)), {}),
        "current": (create_model("current", __base__=VesselBlock, **current) | None, None),
    }
    return create_model("vessel", __base__=VesselBlock, **fields)


def term_blocks(document: Mapping[str, Any], off: bool = False) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Dotted path, TERMS key and block of every term of a vessel document that acts, or of those that are off."""
    for group in dict.fromkeys(group for group, _ in split_keys(tuple(TERMS))):
        block = document.get(group)
        if not isinstance(block, Mapping):
            continue
        named = {"": block} if "kind" in block else {k: v for k, v in block.items() if isinstance(v, Mapping)}
        for name, entry in named.items():
            if bool(entry.get("off", False)) == off:
                yield (f"{group}.{name}" if name else group), f"{group}.{entry.get('kind', name)}", entry


def equation_functions(document: Mapping[str, Any]) -> dict[str, tuple[Callable[..., Any], ...]]:
    """TERMS key of every term that acts, `actuator.KIND` of its actuators -> the functions that are their equations."""
    found: dict[str, tuple[Callable[..., Any], ...]] = {}
    for _, key, block in term_blocks(document):
        found[key] = TERMS[key].functions
        for _, actuator in active_actuators(block):
            found[f"actuator.{actuator['kind']}"] = ACTUATORS[actuator["kind"]].functions
    return found


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
