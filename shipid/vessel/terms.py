"""Checks of the entries of TERMS: a mistake in the signature of a term that a user wrote is one line with its place."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from functools import cache
from numbers import Real
from typing import Annotated, Any, get_args, get_origin

from shipid.errors import ShipidError, suggest_name
from shipid.physics import GIVEN, MOTION, TERMS, Term
from shipid.physics.grammar import Grammar
from shipid.physics.signals import rows_of_role
from shipid.physics.symbols import argument_types
from shipid.units import join_names, unit_fault
from shipid.users import definition_location, error_location, locate_errors

FIXED = ("hull", "restoring", "radiation", "waves")  # groups whose members go by the name of their kind, one of each
GROUPS = (*FIXED, "wind", "thruster")
NAME = r"[A-Za-z][A-Za-z0-9_-]*"  # of a kind
RESERVED = ("off", "source", "kind", "actuator", "behind")  # keys that blocks have beside parameters
POSITIONAL = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


@cache
def split_keys(keys: tuple[Any, ...]) -> tuple[tuple[str, str], ...]:
    """Group and kind of each key of TERMS; ShipidError for a key that is not `<group>.<kind>`."""
    return tuple(map(_split_key, keys))


def _split_key(key: Any) -> tuple[str, str]:
    group, _, kind = str(key).partition(".")
    entry = TERMS[key]
    place = definition_location(entry.function) if isinstance(entry, Term) and callable(entry.function) else ""
    if isinstance(key, str) and group in GROUPS and re.fullmatch(NAME, kind) and kind not in RESERVED:
        return group, kind
    remedy = f"write <block>.<kind>, such as TERMS['hull.drag'], with one of the blocks {join_names(GROUPS)}"
    raise ShipidError(f"TERMS[{key!r}]: no block of a vessel document and a kind in it: {remedy}{place}")


def check_term(key: str) -> Term:
    """The term of a key of TERMS; ShipidError, one line with its place, where its functions cannot be used."""
    term: Any = TERMS[key]
    if not isinstance(term, Term):
        name = getattr(term, "__name__", repr(term))
        place = definition_location(term) if callable(term) else ""
        raise ShipidError(f"TERMS[{key!r}] is no Term: write TERMS[{key!r}] = Term({name}){place}")
    _check_functions(key, term)
    return term


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
    for name, argument in arguments.items():
        is_parameter = get_origin(hints.get(name)) is Annotated
        if argument.kind is argument.VAR_POSITIONAL:
            fault = f"`*{name}` cannot be filled: name each signal"
        elif argument.kind in POSITIONAL:
            sums = function is term.function and (term.components or term.drawn)  # over arrays named as they are called
            fault = "" if sums else no_signal(name, term_signals(term))
            fault = f"its parameter {name!r} must be behind a `*` in `def`" if is_parameter else fault
        else:
            fault = (
                _parameter_fault(name, argument, get_args(hints[name]))
                if is_parameter
                else _without_unit(name, argument)
            )
        if fault:
            raise ShipidError(f"{where}: {fault}{place}")


def term_signals(term: Term) -> tuple[str, ...]:
    """Positional arguments that the functions of a term may have, beside the arrays that it sums over."""
    own = [name for name in MOTION if name != "state" or term.states is not None]
    return (*own, *GIVEN, *rows_of_role("command"), *rows_of_role("environment"))


def no_signal(name: str, valid: tuple[str, ...]) -> str:
    """What is wrong with a positional argument; empty for the name of a signal."""
    if name in valid:
        return ""
    if name == "state":
        return "it takes `state` and has no `states`: write Term(..., states=..., rates=...)"
    remedy = f'a parameter is behind a `*`, with its unit: `*, {name}: Annotated[SX, "m"]`'
    return f"its positional argument {name!r} is no signal: {suggest_name(name, valid)}: {remedy}"


def _without_unit(name: str, argument: inspect.Parameter) -> str:
    if argument.kind is argument.VAR_KEYWORD:
        return f"`**{name}` has no grammar: write `**{name}: Annotated[SX, ...]` with one of shipid.physics.grammar"
    constant = "" if argument.default is argument.empty else "; a constant belongs outside the signature"
    return f'its parameter {name!r} has no unit: write `{name}: Annotated[SX, "m"]` with its unit{constant}'


def _parameter_fault(name: str, argument: inspect.Parameter, parts: tuple[Any, ...]) -> str:
    """What is wrong with a parameter of the type `Annotated[*parts]`; empty for nothing."""
    base, unit, *_ = parts
    tables = any(get_origin(one) in (Mapping, dict) or one in (Mapping, dict) for one in (base, *get_args(base)))
    if name in RESERVED:
        return f"its parameter {name!r} is a key that blocks have anyway: use another name"
    if argument.kind is argument.VAR_KEYWORD or tables:
        of = "a table" if tables else "`**`"
        return "" if isinstance(unit, Grammar) else f"{name!r} is {of} and needs a grammar of shipid.physics.grammar"
    if not isinstance(unit, str | Grammar):
        return f"the unit of its parameter {name!r} must be a text, such as 'm', not {unit!r}"
    if isinstance(unit, str) and (remedy := unit_fault(unit)):
        return f"the unit {unit!r} of its parameter {name!r} is not known: {remedy}"
    default = None if argument.default is argument.empty else argument.default
    if default is not None and (isinstance(default, bool) or not isinstance(default, Real)):
        return f"the default of its parameter {name!r} must be a number, not {default!r}"
    return ""


def term_states(key: str, block: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the additional states of a term; empty for a term without; ShipidError for what is no such names."""
    function = TERMS[key].states
    if function is None:
        return ()
    names = call_user_function(f"states of {key}", function, block)
    if not isinstance(names, tuple | list) or not all(isinstance(name, str) for name in names) or not names:
        message = f"states of {key} must return names, such as ('x', 'y'), not {names!r}"
        raise ShipidError(f"{message}{definition_location(function)}")
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
