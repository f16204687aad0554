"""Blocks: functions of vectors that are at once CasADi functions and lines of C.

A predictor is a graph of few kinds of blocks: formulas (CasADi SX, printed operation by operation), dense layers,
trees, distances to centres, and graphs of these with loops over steps. Every block has one output vector. Each is
written once here, and the C and the CasADi that come from it say the same.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.engine.printing import ARITHMETIC, LIBM, Dialect, print_function
from shipid.errors import ShipidError

Array = np.ndarray
LONGEST = 600  # operations of one C function
_ARRAY = re.compile(r"real (\w+)\[\d+\];")
_VALUE, _TARGET = re.compile(r"\ba\d+\b"), re.compile(r"const real (a\d+) = ")

_TWO = {ca.OP_POW: "pow", ca.OP_CONSTPOW: "pow", ca.OP_ATAN2: "atan2", ca.OP_FMIN: "fmin", ca.OP_FMAX: "fmax"}
_OPERATIONS = {
    **{operation: f"M({name})({{0}})" for operation, name in (LIBM | {ca.OP_FABS: "fabs"}).items()},
    **{operation: f"M({name})({{0}}, {{1}})" for operation, name in _TWO.items()},
    ca.OP_SIGN: "(real)(({0} > 0) - ({0} < 0))",
    ca.OP_INV: "(1 / {0})",
    ca.OP_IF_ELSE_ZERO: "({0} != 0 ? {1} : 0)",
}


@dataclass(frozen=True)
class Precision:
    """How C writes numbers: in `double` or in `single` precision."""

    single: bool = False

    def number(self, value: float) -> str:
        """A literal that reads back as the value, rounded to the precision."""
        if self.single:
            with np.errstate(over="ignore", under="ignore"):
                value = float(str(np.float32(value)))
        if np.isnan(value):
            return "NAN"
        if np.isinf(value):
            return "INFINITY" if value > 0 else "(-INFINITY)"
        return repr(float(value)) + ("f" if self.single else "")

    def table(self, values: Array) -> str:
        """Literals of an array in a row, without needless zeros."""
        texts = (self.number(value) for value in np.asarray(values, dtype=float).ravel())
        return ",".join(text.removesuffix(".0") if not self.single else text for text in texts)

    @property
    def dialect(self) -> Dialect:
        """The dialect of C in which formulas are printed."""
        return Dialect(ARITHMETIC | _OPERATIONS, "const real {0} = {1};", self.number, "(real){0}")


class Block(ABC):
    """A function of vectors with one output vector.

    name : of the C function, with a number added where two share it.
    inputs : (name, size) of each input. size : of the output. Inputs without entries are left out of the C function.
    """

    name: str
    inputs: tuple[tuple[str, int], ...]
    size: int

    @property
    @abstractmethod
    def function(self) -> ca.Function:
        """The block as a CasADi function; ShipidError where CasADi has no such function."""

    def parts(self) -> Sequence[Block]:
        """Blocks that this one calls."""
        return ()

    @abstractmethod
    def statements(self, call: dict[int, str], precision: Precision) -> list[str]:
        """C statements that write `out[size]`; `call` names the C function of each block by its identity."""

    def numbers(self) -> int:
        """How many numbers its tables hold."""
        return 0


@dataclass(frozen=True, eq=False)
class Formula(Block):
    """A CasADi function of scalars (SX), printed operation by operation. A sparse input or output is made dense."""

    sx: ca.Function

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the CasADi function."""
        return str(self.sx.name())

    @property
    def inputs(self) -> tuple[tuple[str, int], ...]:  # type: ignore[override]
        """Names and sizes of the function."""
        return tuple((self.sx.name_in(i), int(self.sx.numel_in(i))) for i in range(self.sx.n_in()))

    @property
    def size(self) -> int:  # type: ignore[override]
        """Entries of the only output."""
        return int(self.sx.numel_out(0))

    @property
    def function(self) -> ca.Function:
        """The function of scalars as it was given."""
        return self.sx

    def statements(self, call: dict[int, str], precision: Precision) -> list[str]:  # noqa: ARG002
        """One line for each operation."""
        printed = print_function(self.sx, (), precision.dialect)
        return [*printed.lines[0], *(f"out[{i}] = {text};" for i, text in enumerate(printed.outputs))]


def formula(name: str, inputs: Sequence[tuple[str, ca.SX]], output: Any) -> Formula:
    """A formula from symbols (name, vector) and an expression of them."""
    names = [key for key, _ in inputs]
    dense = ca.densify(ca.vertcat(*output) if isinstance(output, list) else ca.SX(output))
    return Formula(ca.Function(name, [vector for _, vector in inputs], [dense], names, ["out"], {"cse": True}))


@dataclass(frozen=True, eq=False)
class Dense(Block):
    """out = activation(x @ weight + bias), weight (i, o), bias (o,)."""

    weight: Array
    bias: Array
    tanh: bool = False
    name: str = "layer"

    @property
    def inputs(self) -> tuple[tuple[str, int], ...]:  # type: ignore[override]
        """The vector x (i,)."""
        return (("x", len(self.weight)),)

    @property
    def size(self) -> int:  # type: ignore[override]
        """Number of outputs."""
        return len(self.bias)

    @cached_property
    def function(self) -> ca.Function:
        """The layer with matrices as constants."""
        x = MX.sym("x", len(self.weight))
        y = ca.mtimes(ca.DM(self.weight.T), x) + ca.DM(self.bias)
        return ca.Function(self.name, [x], [ca.tanh(y) if self.tanh else y], ["x"], ["out"])

    def numbers(self) -> int:
        """Weights and biases."""
        return int(self.weight.size + self.bias.size)

    def statements(self, call: dict[int, str], precision: Precision) -> list[str]:  # noqa: ARG002
        """Two tables and three loops."""
        rows, columns = self.weight.shape
        lines = [
            f"static const real weight[{max(1, rows * columns)}] = {{{precision.table(self.weight) or '0'}}};",
            f"static const real bias[{columns}] = {{{precision.table(self.bias)}}};",
            "int i, j;",
            f"for (j = 0; j < {columns}; ++j) out[j] = bias[j];",
            f"for (i = 0; i < {rows}; ++i)",
            f"    for (j = 0; j < {columns}; ++j) out[j] += x[i] * weight[i * {columns} + j];",
        ]
        if self.tanh:
            lines.append(f"for (j = 0; j < {columns}; ++j) out[j] = M(tanh)(out[j]);")
        return lines


@dataclass(frozen=True, eq=False)
class Mirrored(Block):
    """Hidden tanh units in mirrored pairs and an output layer, each number kept once.

    h = tanh(z w + c), g = tanh((z R) w + c); out = [(h + g) x + b_x, (h - g) y + b_y].
    weight : (d, M). offset : (M,). image : (d,) z R = sign * z[place], as `place` and `sign`. x : (M, p). y : (M, q),
    q may be 0.
    """

    weight: Array
    offset: Array
    place: Array
    sign: Array
    x: Array
    y: Array
    bias: Array
    name: str = "mirrored"

    @property
    def inputs(self) -> tuple[tuple[str, int], ...]:  # type: ignore[override]
        """Normalised inputs z (d,)."""
        return (("z", len(self.weight)),)

    @property
    def size(self) -> int:  # type: ignore[override]
        """Number of outputs p + q."""
        return int(self.x.shape[1] + self.y.shape[1])

    @cached_property
    def function(self) -> ca.Function:
        """The block with matrices as constants."""
        z = MX.sym("z", len(self.weight))
        image = ca.vertcat(*(float(s) * z[int(p)] for p, s in zip(self.place, self.sign, strict=True)))
        weight, offset = ca.DM(self.weight.T), ca.DM(self.offset)
        h, g = ca.tanh(ca.mtimes(weight, z) + offset), ca.tanh(ca.mtimes(weight, image) + offset)
        outputs = ca.mtimes(ca.DM(self.x.T), h + g)
        if self.y.shape[1]:
            outputs = ca.vertcat(outputs, ca.mtimes(ca.DM(self.y.T), h - g))
        return ca.Function(self.name, [z], [outputs + ca.DM(self.bias)], ["z"], ["out"])

    def numbers(self) -> int:
        """Weights, offsets and output weights."""
        return int(self.weight.size + self.offset.size + self.x.size + self.y.size)

    def statements(self, call: dict[int, str], precision: Precision) -> list[str]:  # noqa: ARG002
        """Tables and loops."""
        (d, m), p, q, t = self.weight.shape, self.x.shape[1], self.y.shape[1], precision
        lines = [
            f"static const real weight[{d * m}] = {{{t.table(self.weight)}}};",
            f"static const real offset[{m}] = {{{t.table(self.offset)}}};",
            f"static const real x[{m * p}] = {{{t.table(self.x)}}};",
            *([f"static const real y[{m * q}] = {{{t.table(self.y)}}};"] if q else []),
            f"static const real bias[{p + q}] = {{{t.table(self.bias)}}};",
            f"static const int place[{d}] = {{{','.join(str(int(at)) for at in self.place)}}};",
            f"static const real sign[{d}] = {{{t.table(self.sign)}}};",
            f"real h[{m}], g[{m}];",
            "int i, j;",
            f"for (j = 0; j < {m}; ++j) h[j] = g[j] = offset[j];",
            f"for (i = 0; i < {d}; ++i) {{",
            "    const real a = z[i], b = sign[i] * z[place[i]];",
            f"    for (j = 0; j < {m}; ++j) {{",
            f"        h[j] += a * weight[i * {m} + j];",
            f"        g[j] += b * weight[i * {m} + j];",
            "    }",
            "}",
            f"for (j = 0; j < {p + q}; ++j) out[j] = bias[j];",
            f"for (i = 0; i < {m}; ++i) {{",
            "    const real a = M(tanh)(h[i]), b = M(tanh)(g[i]), even = a + b;",
            f"    for (j = 0; j < {p}; ++j) out[j] += even * x[i * {p} + j];",
        ]
        if q:
            lines.append(f"    for (j = 0; j < {q}; ++j) out[{p} + j] += (a - b) * y[i * {q} + j];")
        return [*lines, "}"]


@dataclass(frozen=True, eq=False)
class Nearest(Block):
    """Distance of a point (d,) to the nearest of some centres (C, d), as one number."""

    centres: Array
    name: str = "nearest"
    size: int = 1

    @property
    def inputs(self) -> tuple[tuple[str, int], ...]:  # type: ignore[override]
        """Coordinates z (d,) of the point."""
        return (("z", self.centres.shape[1]),)

    @cached_property
    def function(self) -> ca.Function:
        """The smallest of all distances."""
        z = MX.sym("z", self.centres.shape[1])
        apart = ca.DM(self.centres.T) - ca.repmat(z, 1, len(self.centres))
        least = ca.mmin(ca.sum1(apart**2))
        distance = ca.if_else(least == 0, 0, ca.sqrt(ca.if_else(least == 0, 1, least)))  # 0 has a slope, too
        return ca.Function(self.name, [z], [distance], ["z"], ["out"])

    def numbers(self) -> int:
        """Coordinates of the centres."""
        return int(self.centres.size)

    def statements(self, call: dict[int, str], precision: Precision) -> list[str]:  # noqa: ARG002
        """One table and two loops."""
        count, d = self.centres.shape
        return [
            f"static const real centres[{count * d}] = {{{precision.table(self.centres)}}};",
            "real least = INFINITY;",
            "int i, j;",
            f"for (i = 0; i < {count}; ++i) {{",
            "    real sum = 0;",
            f"    for (j = 0; j < {d}; ++j)",
            f"        sum += (z[j] - centres[i * {d} + j]) * (z[j] - centres[i * {d} + j]);",
            "    if (!(sum >= least)) least = sum;",
            "}",
            "out[0] = M(sqrt)(least);",
        ]


@dataclass(frozen=True, eq=False)
class Forest(Block):
    """Mean over regression trees; nodes as in `shipid.hybrid.forest.Trees`. Inputs are compared in single precision."""

    first: Array
    left: Array
    right: Array
    feature: Array
    threshold: Array
    value: Array
    num_inputs: int
    name: str = "forest"

    @property
    def inputs(self) -> tuple[tuple[str, int], ...]:  # type: ignore[override]
        """Inputs of the trees."""
        return (("x", self.num_inputs),)

    @property
    def size(self) -> int:  # type: ignore[override]
        """Outputs of a leaf."""
        return int(self.value.shape[1])

    @property
    def function(self) -> ca.Function:
        """There is none: a tree has no derivatives."""
        raise ShipidError("a forest has steps and no derivatives, so CasADi cannot take it: export it to c or fmu")

    def numbers(self) -> int:
        """Values of leaves and thresholds of the others."""
        leaves = int((self.left < 0).sum())
        return leaves * self.size + 4 * (len(self.left) - leaves)

    def statements(self, call: dict[int, str], precision: Precision) -> list[str]:  # noqa: ARG002
        """Tables of nodes, those of leaves apart: a child below 0 is leaf -1 - child."""
        leaf = np.asarray(self.left < 0)
        place = np.where(leaf, np.negative(np.cumsum(leaf, dtype=np.int64)), np.cumsum(np.logical_not(leaf)) - 1)
        inner = np.flatnonzero(np.logical_not(leaf))
        rows = {
            "left": place[self.left[inner]],
            "right": place[self.right[inner]],
            "feature": self.feature[inner],
        }
        roots = place[self.first]

        def whole(values: Array) -> str:
            return ",".join(str(int(value)) for value in values) or "0"

        count, outputs = max(1, len(inner)), self.size
        return [
            *(f"static const int {name}[{count}] = {{{whole(values)}}};" for name, values in rows.items()),
            f"static const double threshold[{count}] = "
            f"{{{Precision().table(self.threshold[inner]) or '0'}}};",  # halfway between singles: kept in double
            f"static const real value[{int(leaf.sum()) * outputs}] = {{{precision.table(self.value[leaf])}}};",
            f"static const int root[{len(roots)}] = {{{whole(roots)}}};",
            f"float seen[{max(1, self.num_inputs)}];",
            "int i, j;",
            f"for (i = 0; i < {self.num_inputs}; ++i) {{",
            "    const double least = -3.4028234663852886e38, most = 3.4028234663852886e38;",
            "    seen[i] = (float)(x[i] < least ? least : x[i] > most ? most : x[i]);",
            "}",
            f"for (j = 0; j < {outputs}; ++j) out[j] = 0;",
            f"for (i = 0; i < {len(roots)}; ++i) {{",
            "    int node = root[i];",
            "    while (node >= 0) node = seen[feature[node]] <= threshold[node] ? left[node] : right[node];",
            f"    for (j = 0; j < {outputs}; ++j) out[j] += value[(-1 - node) * {outputs} + j];",
            "}",
            f"for (j = 0; j < {outputs}; ++j) out[j] /= {len(roots)};",
        ]


@dataclass(frozen=True)
class Value:
    """A part of an array of a graph: its C text, its CasADi expression, and its size."""

    array: str
    start: int
    symbol: MX

    @property
    def size(self) -> int:
        """Number of entries."""
        return int(self.symbol.numel())

    @property
    def text(self) -> str:
        """C pointer to the first entry."""
        return f"{self.array} + {self.start}" if self.start else self.array

    def __getitem__(self, place: slice | int) -> Value:
        """Entries next to each other, or one."""
        start, stop, step = (slice(place, place + 1) if isinstance(place, int) else place).indices(self.size)
        assert step == 1
        return Value(self.array, self.start + start, self.symbol[start:stop])


@dataclass(frozen=True)
class Duration:
    """A time step that is an input: the arithmetic that `integrate` asks of it, in C and in CasADi."""

    text: str
    symbol: MX

    def __truediv__(self, other: float) -> Duration:
        """The step over a number."""
        return Duration(f"({self.text} / {other:g})", self.symbol / other)

    def __mul__(self, other: float) -> Duration:
        """The step times a number."""
        return Duration(f"({self.text} * {other:g})", self.symbol * other)


@dataclass(eq=False)
class Graph(Block):
    """A function made of calls of blocks, loops over them, and additions.

    Lines of C and the CasADi expression grow together; `finish` says what is the output.
    """

    name: str
    inputs: tuple[tuple[str, int], ...] = ()
    size: int = 0
    _lines: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)
    _blocks: dict[int, Block] = field(default_factory=dict)
    _symbols: list[MX] = field(default_factory=list)
    _output: Value | None = None
    _count: int = 0

    def input(self, name: str, size: int) -> Value:
        """One more input."""
        self.inputs = (*self.inputs, (name, size))
        self._symbols.append(MX.sym(name, size))
        return Value(name, 0, self._symbols[-1])

    def _new(self, size: int) -> str:
        self._count += 1
        name = f"v{self._count}"
        self._lines.append(("array", (name, max(1, size))))
        return name

    def _note(self, block: Block) -> Block:
        self._blocks.setdefault(id(block), block)
        return block

    def constant(self, values: Any) -> Value:
        """A table of numbers."""
        flat = np.asarray(values, dtype=float).ravel()
        self._count += 1
        name = f"c{self._count}"
        self._lines.append(("table", (name, flat)))
        return Value(name, 0, MX(ca.DM(flat)))

    def pack(self, *values: Value) -> Value:
        """Values one after the other in one array."""
        kept = [value for value in values if value.size]
        if len(kept) == 1:
            return kept[0]
        total = sum(value.size for value in kept)
        name, place = self._new(total), 0
        for value in kept:
            self._lines.append(("copy", (name, place, value.text, value.size)))
            place += value.size
        return Value(name, 0, ca.vertcat(MX(0, 1), *(value.symbol for value in kept)))

    def call(self, block: Block, *values: Value) -> Value:
        """The output of a block."""
        assert [value.size for value in values] == [size for _, size in block.inputs], (block.name, block.inputs)
        name = self._new(block.size)
        given = [value.text for value in values if value.size]
        self._lines.append(("call", (self._note(block), (*given, name))))
        symbol = block.function(*(value.symbol for value in values)) if _smooth(block) else MX(block.size, 1)
        return Value(name, 0, symbol)

    def add(self, x: Value, factor: float | Duration, k: Value) -> Value:
        """The vector x + factor k, both of one size."""
        name = self._new(x.size)
        self._lines.append(("add", (name, x.size, x.text, factor, k.text)))
        return Value(name, 0, x.symbol + (factor.symbol if isinstance(factor, Duration) else factor) * k.symbol)

    def total(self, values: Sequence[Value], divisor: float = 1.0) -> Value:
        """The sum of vectors of one size, over a number."""
        name = self._new(values[0].size)
        self._lines.append(("total", (name, values[0].size, [value.text for value in values], divisor)))
        symbol = values[0].symbol
        for value in values[1:]:
            symbol = symbol + value.symbol
        return Value(name, 0, symbol if divisor == 1.0 else symbol / divisor)

    def number(self, value: float | Duration) -> Value:
        """One number."""
        if not isinstance(value, Duration):
            return self.constant([value])
        name = self._new(1)
        self._lines.append(("number", (name, value.text)))
        return Value(name, 0, value.symbol)

    def scan(self, body: Block, start: Value, each: Sequence[Value], fixed: Sequence[Value], count: int) -> Value:
        """`x_k = body(x_(k-1), row k of each, fixed)`: all x_1 ... x_count one after the other."""
        n = start.size
        sizes = [value.size // count for value in each]
        name = self._new(n * count)
        self._lines.append(("scan", (name, self._note(body), n, start.text, _rows(each, sizes), _texts(fixed), count)))
        if not _smooth(body):
            return Value(name, 0, MX(n * count, 1))
        x, outputs = start.symbol, []
        parts = [_split(value.symbol, count) for value in each]
        for k in range(count):
            x = body.function(x, *(part[k] for part in parts), *(value.symbol for value in fixed))
            outputs.append(x)
        return Value(name, 0, ca.vertcat(*outputs))

    def map(self, body: Block, each: Sequence[Value], fixed: Sequence[Value], count: int) -> Value:
        """`body(row k of each, fixed)` for all rows, one after the other."""
        n = body.size
        sizes = [value.size // count for value in each]
        name = self._new(n * count)
        self._lines.append(("map", (name, self._note(body), n, _rows(each, sizes), _texts(fixed), count)))
        if not _smooth(body):
            return Value(name, 0, MX(n * count, 1))
        parts = [_split(value.symbol, count) for value in each]
        rest = [value.symbol for value in fixed]
        results = [body.function(*(part[k] for part in parts), *rest) for k in range(count)]
        return Value(name, 0, ca.vertcat(*results))

    def finish(self, output: Value) -> Graph:
        """Return the graph with its output."""
        self._output, self.size = output, output.size
        return self

    @cached_property
    def function(self) -> ca.Function:
        """The graph as a CasADi function; ShipidError where a part has none."""
        assert self._output is not None
        for block in self.parts():
            _ = block.function
        names = [name for name, _ in self.inputs]
        return ca.Function(self.name, self._symbols, [self._output.symbol], names, ["out"])

    def parts(self) -> Sequence[Block]:
        """Blocks that are called."""
        return tuple(self._blocks.values())

    def statements(self, call: dict[int, str], precision: Precision) -> list[str]:
        """Arrays first, then the calls."""
        assert self._output is not None
        tables = [line for line in self._lines if line[0] == "table"]
        arrays = [line for line in self._lines if line[0] == "array"]
        rest = [line for line in self._lines if line[0] not in ("table", "array")]
        loops = any(kind not in ("call", "number") for kind, _ in rest) or self.size
        texts = [_statement(kind, given, call, precision) for kind, given in (*tables, *arrays, *rest)]
        end = f"for (i = 0; i < {self.size}; ++i) out[i] = ({self._output.text})[i];"
        heads = ["int i;"] if loops else []
        heads += ["int k;"] if any(kind in ("scan", "map") for kind, _ in rest) else []
        return [*heads, *texts, end]


def _smooth(block: Block) -> bool:
    """Whether a block is a CasADi function all through."""
    return not isinstance(block, Forest) and all(_smooth(part) for part in block.parts())


def _rows(each: Sequence[Value], sizes: Sequence[int]) -> list[tuple[str, int]]:
    return [(value.text, size) for value, size in zip(each, sizes, strict=True) if size]


def _texts(fixed: Sequence[Value]) -> list[str]:
    return [value.text for value in fixed if value.size]


def _split(symbol: MX, count: int) -> list[MX]:
    size = int(symbol.numel()) // count
    return [MX(0, 1)] * count if not size else ca.vertsplit(symbol, size)


def _statement(kind: str, given: tuple[Any, ...], call: dict[int, str], precision: Precision) -> str:
    """One C statement of a graph."""
    if kind == "array":
        return f"real {given[0]}[{given[1]}];"
    if kind == "table":
        name, values = given
        return f"static const real {name}[{max(1, len(values))}] = {{{precision.table(values) or '0'}}};"
    if kind == "copy":
        target, place, source, size = given
        return f"for (i = 0; i < {size}; ++i) {target}[{place} + i] = ({source})[i];"
    if kind == "call":
        block, arguments = given
        return f"{call[id(block)]}({', '.join(arguments)});"
    if kind == "add":
        target, size, x, factor, k = given
        text = factor.text if isinstance(factor, Duration) else precision.number(factor)
        return f"for (i = 0; i < {size}; ++i) {target}[i] = ({x})[i] + {text} * ({k})[i];"
    if kind == "total":
        target, size, sources, divisor = given
        text = " + ".join(f"({source})[i]" for source in sources)
        over = "" if divisor == 1.0 else f" / {precision.number(divisor)}"
        return f"for (i = 0; i < {size}; ++i) {target}[i] = ({text}){over};"
    if kind == "number":
        return f"{given[0]}[0] = {given[1]};"
    if kind == "scan":
        target, block, n, start, each, fixed, count = given
        rows = [f"{text} + k * {size}" for text, size in each]
        before = f"k ? {target} + (k - 1) * {n} : {start}"
        arguments = ", ".join([before, *rows, *fixed, f"{target} + k * {n}"])
        return f"for (k = 0; k < {count}; ++k) {call[id(block)]}({arguments});"
    target, block, n, each, fixed, count = given
    rows = [f"{text} + k * {size}" for text, size in each]
    return f"for (k = 0; k < {count}; ++k) {call[id(block)]}({', '.join([*rows, *fixed, f'{target} + k * {n}'])});"


def in_order(block: Block) -> list[Block]:
    """A block and all that it calls, each once, those that are called first."""
    ordered: list[Block] = []
    seen: set[int] = set()

    def visit(one: Block) -> None:
        if id(one) not in seen:
            seen.add(id(one))
            for part in one.parts():
                visit(part)
            ordered.append(one)

    visit(block)
    return ordered


def num_numbers(block: Block) -> int:
    """Numbers in the tables of a block and of all that it calls."""
    return sum(part.numbers() for part in in_order(block))


def c_functions(blocks: Sequence[Block], precision: Precision) -> tuple[str, dict[int, str]]:
    """C functions of some blocks with all that they call, and the name of each by its identity."""
    call: dict[int, str] = {}
    texts, kept = [], []
    for block in blocks:
        for part in in_order(block):
            if id(part) in call:
                continue
            call[id(part)] = f"f{len(call)}_{part.name}"
            kept.append(part)
            texts.append(c_function(part, call, precision))
    return "\n".join(texts), call


def c_function(block: Block, call: dict[int, str], precision: Precision) -> str:
    """One static C function; a long formula is a chain of functions, since compilers take long for long ones."""
    lines = block.statements(call, precision)
    given = [name for name, size in block.inputs if size]
    if isinstance(block, Formula) and len(lines) > LONGEST:
        return _chain(lines, given, call[id(block)])
    return _function(lines, given, call[id(block)])


def _function(lines: Sequence[str], given: Sequence[str], name: str, more: Sequence[str] = ("real *out",)) -> str:
    body = "\n".join(lines)
    unused = [
        f"(void){key};" for key in (*given, *(one.rpartition("*")[2] for one in more)) if not _mentions(body, key)
    ]
    heads = ", ".join([*(f"const real *{key}" for key in given), *more])
    declared = [line for line in lines if line.startswith(("static const", "int ", "real ", "float "))]
    rest = lines[len(declared) :] if lines[: len(declared)] == declared else lines
    declared = [line for line in declared if _is_used(line, "\n".join(rest))] if rest is not lines else []
    text = "\n".join(f"    {line}" for line in (*declared, *unused, *rest))
    return f"static void {name}({heads})\n{{\n{text}\n}}\n"


def _chain(lines: Sequence[str], given: Sequence[str], name: str) -> str:
    """Lines `const real a7 = ...;` in parts of `LONGEST`, values in slots of one array that are used again."""
    last: dict[str, int] = {}
    for number, line in enumerate(lines):
        for key in _VALUE.findall(line):
            last[key] = number
    slots: dict[str, int] = {}
    free: list[int] = []
    count, written = 0, []
    for number, line in enumerate(lines):
        target = _TARGET.match(line)
        used = [key for key in dict.fromkeys(_VALUE.findall(line)) if target is None or key != target[1]]
        text = line if target is None else line[target.end() :]
        text = _VALUE.sub(lambda match: f"w[{slots[match[0]]}]", text)
        free += [slots[key] for key in used if last[key] == number]
        if target is not None:
            if not free:
                free.append(count)
                count += 1
            slots[target[1]] = free.pop()
            text = f"w[{slots[target[1]]}] = {text}"
        written.append(text)
    parts = [written[first : first + LONGEST] for first in range(0, len(written), LONGEST)]
    texts = [_function(part, given, f"{name}_{k}", ("real *w", "real *out")) for k, part in enumerate(parts)]
    calls = [f"{name}_{k}({', '.join([*given, 'w', 'out'])});" for k in range(len(parts))]
    return "\n".join([*texts, _function([f"real w[{max(1, count)}];", *calls], given, name)])


def _is_used(declaration: str, text: str) -> bool:
    """Whether a text uses the array of a declaration: one without entries, as of a ship without orders, is not."""
    array = _ARRAY.fullmatch(declaration)
    return array is None or _mentions(text, array[1])


def _mentions(text: str, name: str) -> bool:
    start = text.find(name)
    while start >= 0:
        before, after = text[start - 1 : start], text[start + len(name) : start + len(name) + 1]
        if not (before.isalnum() or before == "_") and not (after.isalnum() or after == "_"):
            return True
        start = text.find(name, start + 1)
    return False
