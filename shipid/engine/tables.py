"""Tables in the equations: piecewise linear functions, recognised in a CasADi function and looked up by vectors of C.

`shipid.physics.wind.interpolate_ramps` writes a table as a sum of ramps, which every engine can differentiate:
y_0 + b_0 (x - k_0) + sum_i (b_i - b_(i-1)) max(x - k_i, 0). In C the interval of x is computed once for all tables with
the same knots, which must be evenly apart; ordinate and slope are read lane by lane, or (AVX-512) by permutations of
vectors. The values are those of the ramps to rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import casadi as ca
import numpy as np

from shipid.engine.integrate import Array


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


LEAST = 6  # intervals: shorter tables are as fast as ramps
FEW = 4  # intervals: as ramps they cost less than another permutation of each table
EVEN = 1e-15  # of the greatest knot: what rounding moves one


@dataclass(frozen=True)
class RampTable:
    """A sum of ramps in a function; each entry is the number of the instruction that computes it.

    x, ordinate, slope : argument, and value and slope at the first knot. knots (n,), bends (n - 1,) : where intervals
    begin, and by how much the slope changes there, the first knot left out. ramps (n - 1,) : what each bend adds.
    """

    x: int
    ordinate: int
    slope: int
    knots: tuple[int, ...]
    bends: tuple[int, ...]
    ramps: tuple[int, ...]


@dataclass(frozen=True)
class TableLookup:
    """C that looks up tables in vectors of `lanes` numbers, lane by lane: the processor has no gather that is faster.

    A table lies in memory as pairs of ordinate and slope.
    """

    lanes: int

    apart: ClassVar = (2, "1")  # numbers from one ordinate to the next, and from an ordinate to its slope

    def head(self) -> str:
        """C functions. `v_place` gives the interval of x, and how far x is in it, in widths of an interval."""
        further, slope = self.apart
        return f"""{self.reading()}
static inline V v_place(V x, V first, V scale, int count, M *place) {{
  V along = (x - first) * scale, whole = v_min(v_max(along - K(0.5), K(0)), K(count - 1)) + K(ROUND);
  *place = (M)whole - (M)K(ROUND);
  return along - (whole - K(ROUND));
}}
static void v_table(V *table, REAL width, REAL y, REAL slope, const REAL *bends, int count, int rows) {{
  REAL *number = (REAL *)table;
  for (int i = 0; i < rows * W / 2; ++i) {{
    number[{further} * i] = y;
    number[{further} * i + {slope}] = slope * width;
    if (i < count - 1) {{ y += slope * width; slope += bends[i]; }}
  }}
}}
"""

    def reading(self) -> str:
        """C of `v_value`: the value of a table so far `along` the interval at `place`."""
        return """
static inline V v_value(const V *table, int rows, M place, V along) {
  const REAL *pairs = (const REAL *)table;
  V y, slope;
  M at = place + place;
  for (int i = 0; i < W; ++i) { y[i] = pairs[at[i]]; slope[i] = pairs[at[i] + 1]; }
  return y + along * slope;
}
"""

    def axis(self, name: str, first: str, last: str, size: int) -> tuple[str, list[str]]:
        """C of an axis of so many knots, and what is saved of it: the first knot, and one over an interval."""
        return f"V {name}[] = {{ {first}, K({size - 1}) / ({last} - {first}) }};", [f"{name}[0]", f"{name}[1]"]

    def table(self, name: str, axis: str, ordinate: str, slope: str, bends: Sequence[str]) -> tuple[str, list[str]]:
        """C that lays out a table on an axis, and what is saved of it."""
        size, rows = len(bends) + 1, self.rows(len(bends) + 1)
        line = f"const REAL bends_{name}[] = {{ {', '.join(f'({bend})[0]' for bend in bends)} }}; V {name}[{rows}]; "
        line += f"v_table({name}, 1 / {axis}[1][0], ({ordinate})[0], ({slope})[0], bends_{name}, {size}, {rows});"
        return line, [f"{name}[{i}]" for i in range(rows)]

    def place(self, name: str, x: str, axis: Sequence[str], size: int) -> str:
        """C that finds `x` on an axis, of which this was saved."""
        return f"M at_{name}; const V {name} = v_place({x}, {', '.join(axis)}, {size}, &at_{name});"

    def value(self, place: str, table: Sequence[str]) -> str:
        """C: the value of a table, of which this was saved."""
        return f"v_value(&{table[0]}, {len(table)}, at_{place}, {place})"

    def part(self, size: int) -> int:
        """How many of so many intervals to look up; the others are left to ramps."""
        return size

    def rows(self, size: int) -> int:
        """Vectors that hold a table of so many intervals."""
        return -(-2 * size // self.lanes)


@dataclass(frozen=True)
class PermutedLookup(TableLookup):
    """C that looks up all lanes at once, by the instructions `vpermt2{packed}` (AVX-512): each picks from two vectors.

    Ordinates of a table, then slopes, lie in an even number of vectors each.
    """

    packed: str

    apart: ClassVar = (1, "rows * W / 2")

    def reading(self) -> str:
        """C of `v_value`: the value of a table so far `along` the interval at `place`."""
        return f"""
static inline V v_picked(const V *table, M place, int rows) {{
  V all = K(0);
  for (int i = 0; i < rows; i += 2) {{
    V r = table[i];
    __asm__("vpermt2{self.packed} %2, %1, %0" : "+v"(r) : "v"(place), "vm"(table[i + 1]));
    all = i ? v_pick(place >= i * W, r, all) : r;
  }}
  return all;
}}
static inline V v_value(const V *table, int rows, M place, V along) {{
  return v_picked(table, place, rows / 2) + along * v_picked(table + rows / 2, place, rows / 2);
}}
"""

    def part(self, size: int) -> int:
        """A few intervals beyond those of whole permutations are left to ramps."""
        beyond = size % (2 * self.lanes)
        return size - beyond if beyond <= FEW and beyond < size else size

    def rows(self, size: int) -> int:
        """Vectors that hold a table of so many intervals."""
        return 4 * -(-size // (2 * self.lanes))


@lru_cache(maxsize=64)
def find_tables(function: ca.Function) -> Mapping[int, RampTable]:
    """Tables of an SX function with at least `LEAST` intervals, by the number of the instruction that gives them."""
    return _TableSearch(function).tables()


def even_tables(function: ca.Function, parameters: Array) -> Mapping[int, RampTable]:
    """Tables whose knots depend on the input `parameters` alone, and are evenly apart for all rows (V, P) of these."""
    tables = find_tables(function)
    even = {
        knots for knots in {table.knots for table in tables.values()} if _have_even_knots(function, knots, parameters)
    }
    return {k: table for k, table in tables.items() if table.knots in even}


def _have_even_knots(function: ca.Function, wanted: tuple[int, ...], parameters: Array) -> bool:
    known = _knot_function(function, wanted)
    if known is None:
        return False
    rows = parameters[:, known[0]]
    alike = (rows == rows[0]).all()  # as a rule: angles of a table are not varied
    return all(_is_even_grid(known[1], row.tobytes()) for row in (rows[:1] if alike else np.unique(rows, axis=0)))


@lru_cache(maxsize=1024)
def _is_even_grid(knots: ca.Function, numbers: bytes) -> bool:
    """Whether the knots are evenly apart, and increase, for these parameters."""
    values = np.array(knots(np.frombuffer(numbers))).ravel()
    even = np.linspace(values[0], values[-1], len(values))
    return bool(values[-1] > values[0] and (np.abs(values - even) <= EVEN * np.abs(values).max()).all())


@lru_cache(maxsize=64)
def _knot_function(function: ca.Function, wanted: tuple[int, ...]) -> tuple[list[int], ca.Function] | None:
    """Entries of `parameters` that give the knots, and their function; None if the knots depend on other inputs."""
    return _TableSearch(function).of_parameters(wanted)


class _TableSearch(InstructionGraph):
    """Tables among the instructions of a function."""

    def tables(self) -> dict[int, RampTable]:
        """All tables; one that is the beginning of a longer one is left out."""
        found: dict[int, RampTable] = {}
        for k in range(len(self.operation)):
            table = self.extended(k, found) or self.begun(k)
            if table is not None:
                found[k] = table
        beginnings = {part for k in found for part in self.operands[k]}
        return {k: table for k, table in found.items() if k not in beginnings and len(table.knots) >= LEAST}

    def extended(self, k: int, found: dict[int, RampTable]) -> RampTable | None:
        """A table and one more ramp."""
        for before, ramp in self.pairs(k, ca.OP_ADD):
            table = found.get(before)
            for bend, corner in self.pairs(ramp, ca.OP_MUL) if table else ():
                for beyond, zero in self.pairs(corner, ca.OP_FMAX):
                    if (
                        self.operation[beyond] == ca.OP_SUB
                        and self.operation[zero] == ca.OP_CONST
                        and not self.function.instruction_constant(zero)
                    ):
                        x, knot = self.operands[beyond]
                        if table is not None and x == table.x:
                            knots, bends, ramps = (*table.knots, knot), (*table.bends, bend), (*table.ramps, ramp)
                            return RampTable(x, table.ordinate, table.slope, knots, bends, ramps)
        return None

    def begun(self, k: int) -> RampTable | None:
        """The line before the second knot: ordinate + slope * (x - knot)."""
        for ordinate, line in self.pairs(k, ca.OP_ADD):
            for slope, beyond in self.pairs(line, ca.OP_MUL):
                if self.operation[beyond] == ca.OP_SUB:
                    x, knot = self.operands[beyond]
                    return RampTable(x, ordinate, slope, (knot,), (), ())
        return None

    def pairs(self, k: int, operation: int) -> tuple[tuple[int, int], ...]:
        """Both orders of the operands of an instruction that commutes; nothing if it is another operation."""
        if self.operation[k] != operation:
            return ()
        first, second = self.operands[k]
        return (first, second), (second, first)

    def of_parameters(self, wanted: Sequence[int]) -> tuple[list[int], ca.Function] | None:
        """Entries of the input `parameters` that give some instructions, and their function; None for other inputs."""
        place = self.function.name_in().index("parameters")
        entries: dict[int, ca.SX] = {}

        def value(k: int) -> ca.SX:
            operation, source = self.operation[k], [value(i) for i in self.operands[k]]
            if operation == ca.OP_CONST:
                return ca.SX(self.function.instruction_constant(k))
            if operation == ca.OP_INPUT:
                given, entry = self.function.instruction_input(k)
                if given != place:
                    raise LookupError
                return entries.setdefault(entry, ca.SX.sym(f"p{entry}"))
            return apply_operation(operation, source)

        try:
            knots = ca.vertcat(*map(value, wanted))
        except LookupError:
            return None
        return list(entries), ca.Function("knots", [ca.vertcat(*entries.values())], [knots])
