from __future__ import annotations

from typing import Any

import casadi as ca
import pytest

from shipid.physics import ACTUATORS, GIVEN, MOTION, TERMS
from shipid.physics.signals import rows_of_role
from shipid.vessel.schema import (
    function_parameters,
    function_signals,
    structural_keys,
    term_parameters,
)


@pytest.mark.parametrize("key", list(TERMS))
def test_every_argument_of_a_term_is_declared(key: str) -> None:
    """Positional arguments are signals or component arrays; keyword-only ones have a unit."""
    term = TERMS[key]
    given = {*MOTION, *rows_of_role("command"), *rows_of_role("environment")}
    source = term.components or term.drawn
    if source is not None:
        given |= set(source(**dict.fromkeys(structural_keys(term), 3)))
    given |= set(GIVEN)
    if term.rates is not None:
        assert term.states is not None
        assert set(function_signals(term.rates)) <= given
    assert set(function_signals(term.function)) <= given
    known = {"return", *function_signals(term.function), *(p.name for p in function_parameters(term.function))}
    assert known == set(term.function.__annotations__)


def _properties(schema: dict[str, Any], node: dict[str, Any]) -> list[dict[str, Any]]:
    """The alternatives that a node of a JSON schema allows, references followed."""
    if "$ref" in node:
        return _properties(schema, schema["$defs"][node["$ref"].rsplit("/", 1)[-1]])
    options = [*node.get("anyOf", []), *node.get("oneOf", [])]
    return [node_ for option in options for node_ in _properties(schema, option)] if options else [node]


@pytest.mark.parametrize("kind", list(ACTUATORS))
def test_an_actuator_is_a_pair_of_pure_functions(kind: str) -> None:
    """`output(state)` and `advance(command, state, dt)`; a reached command stays reached."""
    memory = ACTUATORS[kind]
    assert function_signals(memory.output) == ("state",)
    assert function_signals(memory.advance) == ("command", "state", "dt")
    numbers = {p.name: 1.0 for p in function_parameters(memory.advance) if p.default is None}
    assert float(memory.advance(ca.SX(0.7), ca.SX(0.7), ca.SX(0.5), **numbers)) == pytest.approx(0.7)


@pytest.mark.parametrize("key", [key for key, term in TERMS.items() if term.gives])
def test_what_a_term_gives_has_its_parameters_in_the_same_block(key: str) -> None:
    """Those that only the wash takes are keys of the block too, and the force does not list them."""
    term = TERMS[key]
    names = [parameter.name for parameter in term_parameters(term)]
    assert len(names) == len(set(names))
    for function in (term.function, *term.gives.values()):
        assert {parameter.name for parameter in function_parameters(function)} <= set(names)
    if key == "thruster.quadratic":
        assert "c_uu" in set(names) - {parameter.name for parameter in function_parameters(term.function)}
