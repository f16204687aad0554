"""The instructions of a CasADi SX function as a graph."""

from __future__ import annotations

import casadi as ca


class InstructionGraph:
    """Operation and operands of each instruction of a function, by its number.

    operation : of each, a number of CasADi's. operands : of each, the instructions that compute them.
    """

    def __init__(self, function: ca.Function) -> None:
        self.function = function
        self.operation: list[int] = []
        self.operands: list[tuple[int, ...]] = []
        slots: dict[int, int] = {}
        for k in range(function.n_instructions()):
            operation = function.instruction_id(k)
            source = () if operation in (ca.OP_CONST, ca.OP_INPUT) else function.instruction_input(k)
            self.operation.append(operation)
            self.operands.append(tuple(slots[i] for i in source))
            if operation != ca.OP_OUTPUT:
                slots[function.instruction_output(k)[0]] = k


def apply_operation(operation: int, operands: list[ca.SX]) -> ca.SX:
    """One operation of CasADi on one or two expressions."""
    return ca.SX.unary(operation, operands[0]) if len(operands) == 1 else ca.SX.binary(operation, *operands)
