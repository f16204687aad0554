"""A CasADi SX function as text in another language, one operation an instruction, so that whole batches go at once.

What depends on parameters alone, or on commands and weather, is printed into stages that run early; the rest goes over
(variant, sample). PyTorch (`torch`) and C (`native`) are two dialects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import casadi as ca

from shipid.engine.tables import InstructionGraph, RampTable, TableLookup, apply_operation

ARITHMETIC = {  # the same in every dialect
    ca.OP_NEG: "(-{0})",
    ca.OP_SQ: "({0} * {0})",
    ca.OP_TWICE: "({0} + {0})",
    ca.OP_NOT: "({0} == 0)",
    ca.OP_ADD: "({0} + {1})",
    ca.OP_SUB: "({0} - {1})",
    ca.OP_MUL: "({0} * {1})",
    ca.OP_DIV: "({0} / {1})",
    ca.OP_LT: "({0} < {1})",
    ca.OP_LE: "({0} <= {1})",
    ca.OP_EQ: "({0} == {1})",
    ca.OP_NE: "({0} != {1})",
    ca.OP_AND: "(({0} != 0) & ({1} != 0))",
    ca.OP_OR: "(({0} != 0) | ({1} != 0))",
}
LIBM = {  # functions of one number in the library of C
    ca.OP_EXP: "exp", ca.OP_LOG: "log", ca.OP_SQRT: "sqrt", ca.OP_SIN: "sin", ca.OP_COS: "cos", ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin", ca.OP_ACOS: "acos", ca.OP_ATAN: "atan", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh", ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil",
}  # fmt: skip
_TRUTH = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT}  # give booleans
_TAKES_TRUTH = {ca.OP_NOT: 1, ca.OP_AND: 2, ca.OP_OR: 2, ca.OP_IF_ELSE_ZERO: 1}  # so many operands, from the first


@dataclass(frozen=True)
class Dialect:
    """How a language writes an operation, an assignment `a = ...`, a plain number, and a truth value as a number.

    lookup : how it looks up a table whose numbers are known early; None: the table is the sum that it is.
    """

    operations: Mapping[int, str]
    assignment: str
    constant: Callable[[float], str]
    number: str
    lookup: TableLookup | None = None


STAGES = (("parameters",), ("commands", "environment"))  # once a rollout; once a window while commands are held


@dataclass(frozen=True)
class PrintedFunction:
    """A function as text, in stages: what depends on early inputs alone is computed early, and once.

    lines : of each stage, then of main; a value `a7` of an earlier stage is read as `s0[3]`.
    saved : of each stage, what later ones read, in order.
    outputs : text of each output entry, in order.
    names, stage_of : the function's inputs in order, and the stage that takes each (main takes the last).
    """

    lines: tuple[tuple[str, ...], ...]
    saved: tuple[tuple[str, ...], ...]
    outputs: tuple[str, ...]
    names: tuple[str, ...]
    stage_of: tuple[int, ...]

    def inputs(self, stage: int) -> list[str]:
        """Names of the inputs that a stage takes."""
        return [name for name, place in zip(self.names, self.stage_of, strict=True) if place == stage]


def print_function(
    function: ca.Function,
    stages: Sequence[Sequence[str]],
    dialect: Dialect,
    tables: Mapping[int, RampTable] = MappingProxyType({}),
) -> PrintedFunction:
    """Print an SX function of dense vectors with one output; ValueError for an instruction the dialect lacks.

    tables : those to be looked up, by the number of the instruction that gives them.
    """
    printer = _Printer(function, stages, dialect, tables)
    for k, operation in enumerate(printer.graph.operation):
        printer.instruction(k, operation)
    return printer.finish()


@dataclass(frozen=True)
class _PrintedValue:
    """What an instruction gives: its text, the stage that computes it (-1: a plain number), and if it is a boolean."""

    text: str
    stage: int
    truth: bool = False


class _Printer:
    """Prints instructions as lines, each in the earliest stage that knows its operands."""

    def __init__(
        self, function: ca.Function, stages: Sequence[Sequence[str]], dialect: Dialect, tables: Mapping[int, RampTable]
    ) -> None:
        self.function = function
        self.dialect = dialect
        self.names = [function.name_in(i) for i in range(function.n_in())]
        early = {name: number for number, stage in enumerate(stages) for name in stage}
        self.last = len(stages)
        self.stage_of = [early.get(name, self.last) for name in self.names]
        self.lines: list[list[str]] = [[] for _ in range(self.last + 1)]
        self.saved: list[dict[str, int]] = [{} for _ in stages]
        self.graph = InstructionGraph(function)
        self.values: dict[int, _PrintedValue] = {}  # of instructions
        self.outputs: dict[int, _PrintedValue] = {}
        self.tables = tables if dialect.lookup else {}
        self.axes: dict[tuple[int, ...], str] = {}  # where x of tables on one axis lies

    def instruction(self, k: int, operation: int) -> None:
        """Print one instruction, or note a number, an input or an output."""
        operands = [self.values[i] for i in self.graph.operands[k]]
        if operation == ca.OP_CONST:
            self.values[k] = _PrintedValue(repr(float(self.function.instruction_constant(k))), -1)
        elif operation == ca.OP_INPUT:
            source, entry = self.function.instruction_input(k)
            self.values[k] = _PrintedValue(f"{self.names[source]}[{entry}]", self.stage_of[source])
        elif operation == ca.OP_OUTPUT:
            self.outputs[self.function.instruction_output(k)[1]] = operands[0]
        else:
            value = self.looked_up(k) if k in self.tables else None
            self.values[k] = value or self.operation(k, operation, operands)

    def looked_up(self, k: int) -> _PrintedValue | None:
        """Print a lookup in a table whose numbers the first stage knows; None for another table."""
        table, lookup = self.tables[k], self.dialect.lookup
        x, size = self.values[table.x], len(table.knots)
        numbers = [self.values[i] for i in (*table.knots, table.ordinate, table.slope, *table.bends)]
        if lookup is None or x.stage != self.last or any(value.stage > 0 for value in numbers):
            return None
        texts, part = [self.use(value, 0) for value in numbers], lookup.part(size)
        axis = self.axes.setdefault((table.x, *table.knots), f"axis{k}")
        if axis == f"axis{k}":
            on = self.kept(*lookup.axis(axis, texts[0], texts[size - 1], size))
            self.lines[-1].append(lookup.place(axis, self.use(x, self.last), on, part))
        ordinate, slope, *bends = texts[size:]
        rows = self.kept(*lookup.table(f"table{k}", axis, ordinate, slope, bends[: part - 1]))
        terms = [lookup.value(axis, rows), *(self.values[i].text for i in table.ramps[part - 1 :])]
        self.lines[-1].append(self.dialect.assignment.format(f"a{k}", " + ".join(terms)))
        return _PrintedValue(f"a{k}", self.last)

    def kept(self, line: str, texts: Sequence[str]) -> list[str]:
        """Print a line into the first stage and save what it computes: the texts of it in main."""
        self.lines[0].append(line)
        return [self.use(_PrintedValue(text, 0), self.last) for text in texts]

    def operation(self, k: int, operation: int, operands: list[_PrintedValue]) -> _PrintedValue:
        """Print an operation; one on numbers alone is done here and now."""
        template = self.dialect.operations.get(operation)
        if template is None:
            raise ValueError(f"CasADi operation {operation} of {self.function.name()} has no counterpart")
        stage = max(operand.stage for operand in operands)
        if stage < 0:
            return _PrintedValue(
                repr(float(ca.evalf(apply_operation(operation, [ca.SX(float(o.text)) for o in operands])))), -1
            )
        if operation == ca.OP_DIV and 0 <= operands[1].stage < stage:  # divide once, early; then multiply
            operands[1] = self.reciprocal(operands[1])
            template = self.dialect.operations[ca.OP_MUL]
        bare = _TAKES_TRUTH.get(operation, 0)
        texts = [self.use(operand, stage, place < bare) for place, operand in enumerate(operands)]
        self.lines[stage].append(self.dialect.assignment.format(f"a{k}", template.format(*texts)))
        return _PrintedValue(f"a{k}", stage, operation in _TRUTH)

    def use(self, value: _PrintedValue, stage: int, truth_is_fine: bool = False) -> str:
        """Text of a value inside a stage; one of an earlier stage is saved there, as a number."""
        if value.stage < 0:
            return self.dialect.constant(float(value.text))
        if value.stage == stage:
            return self.dialect.number.format(value.text) if value.truth and not truth_is_fine else value.text
        text = self.dialect.number.format(value.text) if value.truth else value.text
        saved = self.saved[value.stage]
        return f"s{value.stage}[{saved.setdefault(text, len(saved))}]"

    def reciprocal(self, value: _PrintedValue) -> _PrintedValue:
        """One over a value, in the stage that computes it."""
        text = self.dialect.number.format(value.text) if value.truth else value.text
        return _PrintedValue(self.dialect.operations[ca.OP_INV].format(text), value.stage)

    def finish(self) -> PrintedFunction:
        """The lines of all stages, what they save for later stages, and the expressions of the outputs."""
        outputs = tuple(self.use(self.outputs[i], self.last) for i in sorted(self.outputs))
        lines = tuple(tuple(stage) for stage in self.lines)
        return PrintedFunction(lines, tuple(map(tuple, self.saved)), outputs, tuple(self.names), tuple(self.stage_of))
