"""Checks of what functions of symbols return: CasADi adds one number to all six axes of a wrench without a word."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from shipid.errors import ShipidError
from shipid.physics import symbols as ca
from shipid.physics.frames import SX
from shipid.plugins import definition_location, is_user_code
from shipid.units import join_names, plural_word


def check_returned(
    where: str, function: Callable[..., Any], value: Any, given: Iterable[Any], count: int, words: str = ""
) -> SX:
    """What a function returned, as symbols (count); ShipidError, with the place of a user's function, for all else.

    where : the function in words, the beginning of the line. words : what it must return.
    given : its arguments: symbols, numbers, lists and tables of them. A user's function may return no others.
    """
    symbols = _as_symbols(value)
    if symbols is None or symbols.shape != (count, 1):
        words = words or f"{count} {plural_word(count, 'number')}"
        returned = type(value).__name__ if symbols is None else f"a matrix of {symbols.shape}"
        raise ShipidError(f"{where} must return {words}, not {returned}{definition_location(function)}")
    if is_user_code(function) and (fault := _symbol_fault(symbols, ca.veccat(*_flatten_arguments(given)))):
        raise ShipidError(f"{where} {fault}{definition_location(function)}")
    return symbols


def _as_symbols(value: Any) -> SX | None:
    """A value as symbols, also numbers of CasADi and NumPy; None for what is none."""
    if isinstance(value, ca.SX):
        return value
    try:
        return ca.SX(value)
    except RuntimeError:  # of CasADi: rows of unequal length, or, as NotImplementedError, a value that is no matrix
        return None


def _flatten_arguments(given: Iterable[Any]) -> Iterable[Any]:
    for one in given:
        if isinstance(one, dict):
            yield from one.values()
        elif isinstance(one, list):
            yield from one
        else:
            yield one


def _symbol_fault(symbols: SX, given: SX) -> str:
    """What is wrong with symbols that a user's function returned for others; empty for nothing."""
    graph = ca.Function("term", [ca.veccat(*ca.symvar(given))], [symbols], {"allow_free": True})
    if graph.has_free():
        return f"returns symbols of its own, {join_names(graph.get_free())}: make them parameters, or numbers"
    constants = (
        graph.instruction_constant(k) for k in range(graph.n_instructions()) if graph.instruction_id(k) == ca.OP_CONST
    )
    if any(map(math.isnan, constants)):
        return "returns what is not a number (NaN): use functions of casadi, such as ca.sqrt, and not of `math`"
    return ""
