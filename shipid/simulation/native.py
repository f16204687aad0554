"""The native engine: a vessel's step as C on SIMD vectors, several samples a vector, groups of them on threads.

The source is printed from the symbolic step and compiled once for each structure, step and method; the library stays
in the user's cache (XDG_CACHE_HOME), by the digest of source, compiler and processor.
"""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from shipid.errors import ShipidError
from shipid.simulation.integrate import Array, Batch, Method, cores, integrate
from shipid.simulation.printing import ARITHMETIC, STAGES, Dialect, Printed, print_function
from shipid.vessel.dynamics import Dynamics

_CALLS = {
    ca.OP_EXP: "exp", ca.OP_LOG: "log", ca.OP_SQRT: "sqrt", ca.OP_SIN: "sin", ca.OP_COS: "cos", ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin", ca.OP_ACOS: "acos", ca.OP_ATAN: "atan", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh", ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil",
}  # fmt: skip
_OPERATIONS = {
    **{operation: f"v_{name}({{0}})" for operation, name in _CALLS.items()},
    ca.OP_FABS: "v_abs({0})",
    ca.OP_SIGN: "(NUMBER({0} > 0) - NUMBER({0} < 0))",
    ca.OP_INV: "(1 / {0})",
    ca.OP_POW: "v_pow({0}, {1})",
    ca.OP_CONSTPOW: "v_pow({0}, {1})",
    ca.OP_ATAN2: "v_atan2({0}, {1})",
    ca.OP_FMIN: "CHOOSE({0} < {1}, {0}, {1})",
    ca.OP_FMAX: "CHOOSE({0} > {1}, {0}, {1})",
    ca.OP_IF_ELSE_ZERO: "((V)(({0} != 0) & (M){1}))",
}
_C = Dialect(ARITHMETIC | _OPERATIONS, "__auto_type {0} = {1};", lambda value: f"K({value!r})", "NUMBER({0})")
_SUM_STAGES = (*STAGES, ("state", "memory"))  # what does not depend on the component is computed before the sum
_ONE, _TWO = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log"), ("pow", "atan2")

_HEAD = """
#include <math.h>
typedef double V __attribute__((vector_size(8 * W)));
typedef long long M __attribute__((vector_size(8 * W)));
typedef double U __attribute__((vector_size(8 * W), aligned(8), may_alias));
#define K(x) ((V){} + (x))
#define NUMBER(m) ((V)((m) & (M)K(1.0)))
#define CHOOSE(m, a, b) ((V)(((m) & (M)(V)(a)) | (~(m) & (M)(V)(b))))
#define EACH(f) V r; for (int i = 0; i < W; ++i) r[i] = f(x[i]); return r;
#define EACH2(f) V r; for (int i = 0; i < W; ++i) r[i] = f(x[i], y[i]); return r;
static inline V v_abs(V x) { return CHOOSE(x < 0, -x, x); }
static inline V v_sqrt(V x) { EACH(__builtin_sqrt) }
static inline V v_floor(V x) { EACH(__builtin_floor) }
static inline V v_ceil(V x) { EACH(__builtin_ceil) }
"""


@dataclass(frozen=True)
class Target:
    """What the processor and the C library offer: lanes of a vector, flags, and the prefix of vector functions."""

    lanes: int
    flags: tuple[str, ...]
    prefix: str


@cache
def compiler() -> str | None:
    """The C compiler, if there is one that makes a library."""
    trial = "#include <math.h>\ndouble probe(double x) { return sin(x); }"
    for name in ("gcc", "cc", "clang"):
        found = shutil.which(name)
        if found is not None:
            with tempfile.TemporaryDirectory() as folder:
                if _compile(found, trial, Path(folder) / "probe.so", Target(1, (), "")) is None:
                    return found
    return None


@cache
def _processor() -> frozenset[str]:
    """Features of the processor, where the system tells them."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return frozenset()
    return frozenset(word for line in lines if line.startswith("flags") for word in line.split()[2:])


@cache
def target() -> Target:
    """Widest vectors of this processor; vector functions of glibc where they link, else one lane at a time."""
    found, x86 = compiler(), platform.machine() in ("x86_64", "AMD64")
    if x86 and "avx512f" in _processor():
        best = Target(8, ("-march=native", "-mprefer-vector-width=512"), "_ZGVeN8")
    elif x86 and {"avx2", "fma"} <= _processor():
        best = Target(4, ("-march=native",), "_ZGVdN4")
    else:
        best = Target(2, (), "")
    if found is None or not best.prefix:
        return best
    probe = f"typedef double V __attribute__((vector_size({8 * best.lanes}))); V {best.prefix}v_tanh(V); "
    with tempfile.TemporaryDirectory() as folder:
        linked = _compile(
            found, probe + f"V probe(V x) {{ return {best.prefix}v_tanh(x); }}", Path(folder) / "p.so", best
        )
    return best if linked is None else Target(best.lanes, best.flags, "")


def _compile(found: str, source: str, library: Path, wanted: Target) -> str | None:
    """Compile C into a shared library, whole or not at all; what the compiler says if it fails."""
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        text, fresh = Path(folder) / "step.c", Path(folder) / "step.so"
        text.write_text(source, encoding="utf-8")
        mvec = ["-Wl,--no-undefined", "-lmvec"] if wanted.prefix else []
        options = ["-O2", "-fno-math-errno", "-fPIC", "-shared", "-w", *wanted.flags]
        command = [found, *options, str(text), "-o", str(fresh), *mvec, "-lm"]
        result = subprocess.run(command, capture_output=True, text=True)
        if result.returncode:
            return result.stderr.strip() or "it gave no reason"
        os.replace(fresh, library)
    return None


@cache
def _version(found: str) -> str:
    """What a compiler calls itself."""
    return subprocess.run([found, "--version"], capture_output=True, text=True).stdout


def _vector_functions(wanted: Target) -> str:
    lines = []
    for name in _ONE:
        if wanted.prefix:
            lines.append(f"V {wanted.prefix}v_{name}(V);\n#define v_{name} {wanted.prefix}v_{name}")
        else:
            lines.append(f"static inline V v_{name}(V x) {{ EACH({name}) }}")
    for name in _TWO:
        if wanted.prefix:
            lines.append(f"V {wanted.prefix}vv_{name}(V, V);\n#define v_{name} {wanted.prefix}vv_{name}")
        else:
            lines.append(f"static inline V v_{name}(V x, V y) {{ EACH2({name}) }}")
    return "\n".join(lines)


class _Source:
    """Writes the C of one model: parameters once, held inputs once while held, rates and advance at every stage."""

    def __init__(self, model: Dynamics, step: float, method: Method) -> None:
        self.model, self.step, self.method = model, step, method
        self.own = [print_function(f, STAGES, _C) for f in (model.rates, model.advance)]
        self.sums = [print_function(term.function, _SUM_STAGES, _C) for term in model.sums]
        self.all = [*self.own, *self.sums]

    def offset(self, stage: int, printed: Printed) -> int:
        """Where a function's saved values of a stage begin."""
        before = self.all[: next(i for i, other in enumerate(self.all) if other is printed)]
        return sum(len(other.saved[stage]) for other in before)

    def total(self, stage: int) -> int:
        """How many values a stage saves, at least one."""
        return max(1, sum(len(printed.saved[stage]) for printed in self.all))

    def stage(self, number: int, printed: Printed) -> str:
        """One early stage of one function."""
        saves = [f"saved[{self.offset(number, printed) + i}] = {text};" for i, text in enumerate(printed.saved[number])]
        return self.block(printed, range(number), [*printed.lines[number], *saves])

    def block(self, printed: Printed, stages: Sequence[int], lines: Sequence[str]) -> str:
        """Lines that read what the named stages saved."""
        heads = [f"const U *s{stage} = saved{stage} + {self.offset(stage, printed)};" for stage in stages]
        return "{ " + "\n".join([*heads, *lines]) + " }"

    def sum(self, i: int) -> str:
        """The loop over components of one sum."""
        printed, term = self.sums[i], self.model.sums[i]
        before = [*printed.lines[2], f"V s2[] = {{ {', '.join((*printed.saved[2], 'K(0)'))} }};"]
        entries = sum(term.widths.values())
        if term.arrays is None:
            place = next(k for k, drawn in enumerate(self.model.drawn) if drawn is term)
            head = f"const U *component = drawn[{place}] + c * {entries};"
            count = f"counts[{place}]"
        else:
            rows = ", ".join("{" + ", ".join(repr(float(value)) for value in row) + "}" for row in term.arrays)
            before.append(f"static const double values[][{entries}] = {{ {rows} }};")
            head = f"V component[{entries}]; for (int j = 0; j < {entries}; ++j) component[j] = K(values[c][j]);"
            count = str(len(term.arrays))
        adds = [f"total[{j}] += {text};" for j, text in enumerate(printed.outputs)]
        loop = f"for (long c = 0; c < {count}; ++c) {{ {head}\n" + "\n".join([*printed.lines[3], *adds]) + " }"
        return self.block(printed, (0, 1), [*before, loop])

    def functions(self) -> str:
        """Stages, rates and advance."""
        rates, advance = self.own
        n = self.model.num_dof
        ends = [f"out[{i}] = {text};" for i, text in enumerate(rates.outputs)]
        lags = [f"out[{i}] = {text};" for i, text in enumerate(advance.outputs)]
        return f"""
static void stage0(const U *parameters, U *saved) {{ {" ".join(self.stage(0, p) for p in self.all)} }}
static void stage1(const U *commands, const U *environment, const U *saved0, U *saved) {{
{" ".join(self.stage(1, p) for p in self.all)} }}
static void rates(const U *state, const U *memory, const U *tau, const U *saved0, const U *saved1,
                  const U *const *drawn, const long *counts, U *out) {{
V total[{n}]; for (int i = 0; i < {n}; ++i) total[i] = tau[i];
{" ".join(self.sum(i) for i in range(len(self.sums)))}
const V *tau_extra = total;
{self.block(rates, (0, 1), [*rates.lines[2], *ends])} }}
static void advance(const U *state, const U *memory, double step, const U *saved0, const U *saved1, U *out) {{
const V dt[1] = {{ K(step) }};
{self.block(advance, (0, 1), [*advance.lines[2], *lags])} }}
"""

    def one_step(self) -> str:
        """The integrator, by running it on names: what it would compute is written down instead."""
        lines: list[str] = []
        num_states = len(self.model.state) + len(self.model.hidden)

        def name(size: int) -> str:
            lines.append(f"U b{len(lines)}[{max(1, size)}];")
            return f"b{len(lines) - 1}"

        def rates(state: str, memory: str) -> str:
            out = name(num_states)
            lines.append(f"rates({state}, {memory}, tau, saved0, saved1, own, counts, {out});")
            return out

        def advance(memory: str, dt: float) -> str:
            out = name(len(self.model.memory))
            lines.append(f"advance(x, {memory}, {dt!r}, saved0, saved1, {out});")
            return out

        def add(state: str, a: float, k: str) -> str:
            out = name(num_states)
            lines.append(f"for (int i = 0; i < {num_states}; ++i) {out}[i] = {state}[i] + {a!r} * {k}[i];")
            return out

        after, memory_after = integrate(rates, advance, add, "x", "m", self.step, self.method)
        copy = f"for (int i = 0; i < {num_states}; ++i) x[i] = {after}[i];"
        lags = f"for (int i = 0; i < {len(self.model.memory)}; ++i) m[i] = {memory_after}[i];"
        return "\n".join([*lines, copy, lags])

    def text(self, wanted: Target) -> str:
        """The whole source."""
        model = self.model
        nx, nm, n = len(model.state) + len(model.hidden), len(model.memory), model.num_dof
        nc, ne, parameters = len(model.commands), len(model.environment), len(model.parameters)
        widths = [sum(term.widths.values()) for term in model.drawn]
        drawn = " ".join(f"own[{i}] = (const U *)drawn[{i}] + g * counts[{i}] * {w};" for i, w in enumerate(widths))
        return f"""#define W {wanted.lanes}
{_HEAD}
{_vector_functions(wanted)}
{self.functions()}
void run(long first, long last, long steps, long every, const long *lengths, const double *numbers, const U *start,
         const U *memory, const U *commands, const U *environment, const U *extra, const double *const *drawn,
         const long *counts, const long *rows, long num_rows, U *records, U *worst) {{
U parameters[{max(1, parameters)}], saved0[{self.total(0)}], saved1[{self.total(1)}];
for (int i = 0; i < {parameters}; ++i) parameters[i] = K(numbers[i]);
stage0(parameters, saved0);
for (long g = first; g < last; ++g) {{
  U x[{nx}], m[{max(1, nm)}];
  const U *own[{max(1, len(widths))}];
  {drawn}
  V greatest = K(0), sum = K(0);
  for (int i = 0; i < {nx}; ++i) {{ x[i] = start[g * {nx} + i]; sum += x[i]; }}
  for (int i = 0; i < {nm}; ++i) {{ m[i] = memory[g * {nm} + i]; sum += m[i]; }}
  for (int i = {n}; i < {2 * n}; ++i) greatest = CHOOSE(v_abs(x[i]) > greatest, v_abs(x[i]), greatest);
  greatest += 0 * sum;
  U *record = records + g * (steps / every + 1) * num_rows;
  for (long i = 0; i < num_rows; ++i) record[i] = rows[i] < {nx} ? x[rows[i]] : m[rows[i] - {nx}];
  for (long k = 0; k < steps; ++k) {{
    const U *tau = extra + (g * lengths[2] + (k < lengths[2] ? k : lengths[2] - 1)) * {n};
    if (k == 0 || (k < lengths[0] && lengths[0] > 1) || (k < lengths[1] && lengths[1] > 1))
      stage1(commands + (g * lengths[0] + (k < lengths[0] ? k : lengths[0] - 1)) * {nc},
             environment + (g * lengths[1] + (k < lengths[1] ? k : lengths[1] - 1)) * {ne}, saved0, saved1);
    {self.one_step()}
    V all = K(0);
    for (int i = 0; i < {nx}; ++i) all += x[i];
    for (int i = 0; i < {nm}; ++i) all += m[i];
    for (int i = {n}; i < {2 * n}; ++i) greatest = CHOOSE(v_abs(x[i]) > greatest, v_abs(x[i]), greatest);
    greatest += 0 * all;
    if ((k + 1) % every == 0)
      for (long i = 0; i < num_rows; ++i)
        record[(k + 1) / every * num_rows + i] = rows[i] < {nx} ? x[rows[i]] : m[rows[i] - {nx}];
  }}
  worst[g] = greatest;
}} }}
"""


@cache
def _folder(wanted: str) -> Path:
    """The user's cache, if libraries can be kept there, else a folder for this process."""
    folder = Path(wanted) / "shipid"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        own = tempfile.TemporaryDirectory(prefix="shipid-")
        atexit.register(own.cleanup)
        return Path(own.name)


@lru_cache(maxsize=64)
def _library(model: Dynamics, step: float, method: Method) -> Any:
    """The `run` of a model, compiled or from the cache; ShipidError if there is no compiler or it fails."""
    found = compiler()
    if found is None:
        raise ShipidError("engine 'native' needs a C compiler, and there is none: install gcc, or use 'torch'")
    source = _Source(model, step, method).text(target())
    words = "\n".join([source, found, _version(found), platform.machine(), *sorted(_processor())])
    folder = _folder(os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache"))
    library = folder / f"{hashlib.sha256(words.encode()).hexdigest()[:24]}.so"
    try:
        return _loaded(library)
    except OSError:  # not there, or not whole
        failure = _compile(found, source, library, target())
    if failure is not None:
        raise ShipidError(f"the C compiler failed ({failure.splitlines()[0]}): use engine 'torch'")
    return _loaded(library)


def _loaded(library: Path) -> Any:
    run = ctypes.CDLL(str(library)).run
    run.restype = None
    return run


def _packed(array: Array, lanes: int) -> Array:
    """(..., channel, S) -> (groups, ..., channel, lanes), the last sample repeated."""
    groups = -(-array.shape[-1] // lanes)
    fill = groups * lanes - array.shape[-1]
    filled = np.concatenate([array, np.repeat(array[..., -1:], fill, axis=-1)], axis=-1)
    return np.ascontiguousarray(np.moveaxis(filled.reshape(*array.shape[:-1], groups, lanes), -2, 0), dtype=float)


def run_native(
    model: Dynamics, batch: Batch, step: float, num_steps: int, method: Method, every: int, rows: list[int]
) -> tuple[Array, Array]:
    """Records (R, V, S, C) and the greatest speed (V, S): groups of samples on threads, variants one after another."""
    run, lanes = _library(model, step, method), target().lanes
    num_samples, num_variants = batch.state.shape[1], len(batch.parameters)
    groups, num_records = -(-num_samples // lanes), num_steps // every + 1
    series = [_packed(part, lanes) for part in (batch.commands, batch.environment, batch.tau_extra)]
    lengths = (ctypes.c_long * 3)(*(part.shape[1] for part in series))
    drawn = [_packed(part.transpose(2, 0, 1), lanes) for part in batch.components]
    counts = (ctypes.c_long * max(1, len(drawn)))(*(part.shape[1] for part in drawn))
    pointers = (ctypes.c_void_p * max(1, len(drawn)))(*(part.ctypes.data for part in drawn))
    places = (ctypes.c_long * len(rows))(*rows)
    start, memory = _packed(batch.state, lanes), _packed(batch.memory, lanes)
    records = np.empty((num_variants, groups, num_records, len(rows), lanes))
    worst = np.empty((num_variants, groups, lanes))
    values = np.ascontiguousarray(batch.parameters, dtype=float)
    threads = cores()
    size = max(1, -(-groups // (4 * threads)))

    def part(variant: int, first: int) -> None:
        run(
            *(ctypes.c_long(n) for n in (first, min(first + size, groups), num_steps, every)),
            lengths,
            *(ctypes.c_void_p(a.ctypes.data) for a in (values[variant], start, memory, *series)),
            pointers,
            counts,
            places,
            ctypes.c_long(len(rows)),
            *(ctypes.c_void_p(a.ctypes.data) for a in (records[variant], worst[variant])),
        )

    with ThreadPoolExecutor(threads) as pool:
        tasks = [pool.submit(part, v, g) for v in range(num_variants) for g in range(0, groups, size)]
        try:
            for task in tasks:
                task.result()
        except BaseException:
            for task in tasks:
                task.cancel()
            raise
    result = records.transpose(2, 0, 1, 4, 3).reshape(num_records, num_variants, groups * lanes, len(rows))
    return result[:, :, :num_samples], worst.reshape(num_variants, -1)[:, :num_samples]
