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
    pairs = []
    for key in keys:
        group, _, kind = str(key).partition(".")
        if not isinstance(key, str) or group not in GROUPS or not re.fullmatch(NAME, kind) or kind in RESERVED:
            function = getattr(TERMS[key], "function", None)
            place = definition_location(function) if callable(function) else ""
            remedy = f"write <block>.<kind>, such as TERMS['hull.drag'], with one of the blocks {join_names(GROUPS)}"
            raise ShipidError(f"TERMS[{key!r}]: no block of a vessel document and a kind in it: {remedy}{place}")
        pairs.append((group, kind))
    return tuple(pairs)


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
