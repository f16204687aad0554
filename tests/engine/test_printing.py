"""Printing of SX functions: stages, saved values, and operations without a counterpart."""

from __future__ import annotations

import casadi as ca
import pytest

from shipid.engine.printing import ARITHMETIC, Dialect, print_function

PLAIN = Dialect({**ARITHMETIC, ca.OP_INV: "(1 / {0})"}, "{0} = {1}", repr, "float({0})")


def function(result: ca.SX, p: ca.SX, x: ca.SX) -> ca.Function:
    return ca.Function("f", [p, x], [ca.densify(result)], ["parameters", "state"], ["result"])


def value(made: ca.Function, p: float, x: float) -> float:
    """Run the printed text of both stages as Python."""
    printed = print_function(made, (("parameters",),), PLAIN)
    names = {"parameters": [p], "state": [x]}
    exec("\n".join(printed.lines[0]), names)
    names["s0"] = [eval(text, names) for text in printed.saved[0]]
    exec("\n".join(printed.lines[1]), names)
    return float(eval(printed.outputs[0], names))


def test_the_printed_text_computes_the_function() -> None:
    p, x = ca.SX.sym("p"), ca.SX.sym("x")
    made = function((p * p + 3) * x - x / p + (x < p), p, x)
    assert value(made, 2.0, 1.5) == pytest.approx(float(made(2.0, 1.5)))


def test_what_depends_on_parameters_alone_is_printed_into_the_first_stage() -> None:
    p, x = ca.SX.sym("p"), ca.SX.sym("x")
    printed = print_function(function(p * p * x, p, x), (("parameters",),), PLAIN)
    assert len(printed.lines[0]) == len(printed.lines[1]) == 1
    assert len(printed.saved[0]) == 1
    assert printed.inputs(0) == ["parameters"]
    assert printed.inputs(1) == ["state"]


def test_an_operation_without_counterpart_is_refused() -> None:
    p, x = ca.SX.sym("p"), ca.SX.sym("x")
    with pytest.raises(ValueError, match="of f has no counterpart"):
        print_function(function(ca.sin(x), p, x), (("parameters",),), PLAIN)
