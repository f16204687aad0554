"""Instructions of a function as a graph."""

from __future__ import annotations

import casadi as ca

from shipid.engine.graph import InstructionGraph, apply_operation


def test_operands_are_the_instructions_that_compute_them() -> None:
    """Evaluated instruction by instruction, the graph gives what the function gives."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    function = ca.Function("f", [x, y], [ca.fmax(x * y, 2.0) - ca.sin(x) / y + x * y])
    graph, values, given = InstructionGraph(function), {}, (0.7, 3.1)
    for k, (operation, operands) in enumerate(zip(graph.operation, graph.operands, strict=True)):
        if operation == ca.OP_INPUT:
            values[k] = ca.SX(given[function.instruction_input(k)[0]])
        elif operation == ca.OP_CONST:
            values[k] = ca.SX(function.instruction_constant(k))
        elif operation == ca.OP_OUTPUT:
            result = values[operands[0]]
        else:
            values[k] = apply_operation(operation, [values[i] for i in operands])
    assert float(result) == float(function(*given))
