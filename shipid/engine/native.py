"""The native engine: the step of a vessel as C; each SIMD lane integrates one sample, groups of lanes run on threads.

The source is printed from the symbolic step and compiled once for each structure, step and method. The library is kept
in the user's cache (XDG_CACHE_HOME) under the digest of source, compiler and processor.
"""

from __future__ import annotations

import hashlib
import logging
import math
import os
import platform
import shutil
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from shipid.engine.integrate import Array, Method, RolloutBatch, RolloutJob, count_threads, integrate_step
from shipid.engine.libraries import PROBE_LIMIT, NoLibrary, build_library, obtain_library, run_compiler
from shipid.engine.printing import ARITHMETIC, LIBM, STAGES, Dialect, PrintedFunction, print_function
from shipid.engine.tables import RampTable, even_tables, find_tables
from shipid.engine.threads import run_tasks, threaded_source
from shipid.engine.vectors import DOUBLE, CompilerTarget, Precision, vector_source
from shipid.errors import escape_unprintable
from shipid.metrics import BINS, BINS_AN_OCTAVE, FIRST_OCTAVE, LAST_OCTAVE, LEAST, SHIFT
from shipid.vessel.dynamics import Dynamics

log = logging.getLogger(__name__)

OPTIONS = ("-O3", "-fschedule-insns", "-fno-math-errno", "-fPIC", "-shared", "-pthread", "-w")  # of the C compiler
_OPERATIONS = {
    **{operation: f"v_{name}({{0}})" for operation, name in LIBM.items()},
    ca.OP_FABS: "v_fabs({0})",
    ca.OP_SIGN: "(NUMBER({0} > 0) - NUMBER({0} < 0))",
    ca.OP_INV: "(1 / {0})",
    ca.OP_POW: "v_pow({0}, {1})",
    ca.OP_CONSTPOW: "v_pow({0}, {1})",
    ca.OP_ATAN2: "v_atan2({0}, {1})",
    ca.OP_FMIN: "v_min({0}, {1})",
    ca.OP_FMAX: "v_max({0}, {1})",
    ca.OP_IF_ELSE_ZERO: "((V)(({0} != 0) & (M){1}))",
}


def _constant_in_c(value: float) -> str:
    """A plain number as a vector; C has words for what is not finite."""
    word = "NAN" if math.isnan(value) else repr(value) if math.isfinite(value) else "INFINITY"
    return f"K(-{word})" if value == -math.inf else f"K({word})"


C = Dialect(ARITHMETIC | _OPERATIONS, "__auto_type {0} = {1};", _constant_in_c, "NUMBER({0})")
_SUM_STAGES = (*STAGES, ("state", "memory"))  # what does not depend on the component is computed before the sum

_SIZES = ("parts", "stride", "samples", "steps", "every", "num_rows")
_ARRAYS = {
    **dict.fromkeys(("lengths", "counts", "rows"), "const long"), "drawn": "const REAL *const",
    **dict.fromkeys(("values", "start", "memory", "commands", "environment", "extra"), "REAL"), "goal": "const U",
    **dict.fromkeys(("records", "sums", "worst"), "REAL"), "tally": "unsigned",
}  # fmt: skip
_ADD = "for (int i = 0; i < {0}; ++i) {3}[i] = {1}[i] + K({4!r}) * {2}[i];"
_FOR_GCC = """#ifndef __clang__
#pragma GCC optimize "no-tree-pre" // else registers that a step needs hold what one branch has computed: 7 % slower
#pragma GCC optimize "sched-pressure" // else registers are too few for what is computed early: 5 % slower
#endif
"""
PARTS = 12  # tasks for each core at least: for an even load
NOTED = 128  # vectors of distances that are counted at a time: between the steps a count costs five times as much
BLOCK = 8  # groups that step together, so that records are written in runs; one where drawn components fill the cache


_refused: list[str] = []  # why this process compiles no more, if so
_interpreted: set[str] = set()  # functions that this process could not compile, while it goes on with others


@cache
def _compiler_on_path() -> str | None:
    command = next(filter(None, map(shutil.which, ("gcc", "cc", "clang"))), None)
    if command is None:
        log.warning("engine 'native' is not used, others are slower: there is no C compiler (gcc, cc or clang)")
    return command


def find_compiler() -> str | None:
    """Path of a C compiler; None if there is none, or if one has failed in this process."""
    return None if _refused else _compiler_on_path()


def engine_description() -> str:
    """What computes rollouts on this machine: the native engine with its compiler and vectors, or CasADi."""
    command = find_compiler()
    if command is None:
        return "casadi"
    version = (compiler_version(command).splitlines() or ["?"])[0]
    wanted = compiler_target()
    missing = ", no libmvec" if wanted.fused and not wanted.prefix else ""  # other functions round otherwise
    apart = "".join(f", {name} by CasADi" for name in sorted(_interpreted))
    return f"native, {escape_unprintable(version)}, {wanted.lanes} lanes{missing}{apart}"


def noted_engine() -> str | None:
    """What computes rollouts in this process, as `engine_description`: not the native one once a model was refused.

    None where nothing has asked for a compiler yet; to look for one takes a moment.
    """
    return engine_description() if _refused or compiler_target.cache_info().currsize else None


def refuse_compiling(reason: str) -> None:
    """Say once that this process compiles no more, and why: from now on there is no compiler."""
    if not _refused:
        log.warning("engine 'native' is not used, others are slower: %s", escape_unprintable(reason))
    _refused.append(reason)


def note_interpretation(name: str, reason: str) -> None:
    """Say why this process does not compile a function: CasADi computes it, and rollouts keep their engine."""
    log.warning("%s is not compiled (%s): slower", name, escape_unprintable(reason))
    _interpreted.add(name)


def _user_cache() -> str:
    """The user's folder for what can be made anew."""
    wanted = os.environ.get("XDG_CACHE_HOME", "")
    return wanted if os.path.isabs(wanted) else os.path.join(os.path.expanduser("~"), ".cache")  # as it is specified


@cache
def _processor_flags() -> frozenset[str]:
    """Feature flags of the processor; empty if the system does not report them."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return frozenset()
    return frozenset(word for line in lines if line.startswith("flags") for word in line.split()[2:])


@cache
def compiler_target(precision: Precision = DOUBLE) -> CompilerTarget:
    """Widest vectors of this processor, with the vector functions of glibc if they can be linked."""
    command, x86, wide = find_compiler(), platform.machine() in ("x86_64", "AMD64"), 64 // precision.bits
    if x86 and "avx512f" in _processor_flags():
        flags = ("-march=native", "-mprefer-vector-width=512")
        best = CompilerTarget(8 * wide, flags, f"_ZGVeN{8 * wide}", fused=True, precision=precision)
    elif x86 and {"avx2", "fma"} <= _processor_flags():
        flags = ("-march=native", "-mtune=haswell")  # tuned for later AMD, GCC splits a * b + c: 12 % slower
        best = CompilerTarget(4 * wide, flags, f"_ZGVdN{4 * wide}", fused=True, precision=precision)
    else:
        best = CompilerTarget(2 * wide, precision=precision)
    if command is None or not best.prefix:
        return best
    called = f"{best.prefix}v_tanh{precision.letter}"
    probe = f"typedef {precision.real} V __attribute__((vector_size({precision.bits // 8 * best.lanes}))); "
    probe += f"V {called}(V); V run(V x) {{ return {called}(x); }}"
    try:
        with tempfile.TemporaryDirectory() as folder:
            build_library(_compiler_command(command, best), probe, Path(folder) / "probe.so", PROBE_LIMIT)
    except (NoLibrary, OSError):
        return replace(best, prefix="")
    return best


def _compiler_command(command: str, wanted: CompilerTarget, further: Sequence[str] = ()) -> list[str]:
    """Command that compiles `{source}` into the shared library `{library}`; later options take precedence."""
    mvec = ["-Wl,--no-undefined", "-lmvec"] if wanted.prefix else []
    return [command, *OPTIONS, *further, *wanted.flags, "{source}", "-o", "{library}", *mvec, "-lm"]


@cache
def compiler_version(command: str) -> str:
    """Version text of a compiler."""
    return run_compiler([command, "--version"], limit=PROBE_LIMIT)[1]


def _distance_source(of: Precision) -> str:
    """C functions: distances of a group, noted and later tallied. A number without its last bits is its bin's."""
    shift = SHIFT - DOUBLE.mantissa + of.mantissa
    first = ((1 << of.bits - of.mantissa - 2) - 1 + FIRST_OCTAVE) * BINS_AN_OCTAVE
    most = float(np.nextafter(of.dtype.type(2.0**LAST_OCTAVE), 0))
    return f"""
typedef struct {{ long count; unsigned short bins[{NOTED}][W]; }} Notes;
static __attribute__((noinline)) void count(Notes *notes, unsigned *tally) {{
  const unsigned short *bins = notes->bins[0];
  for (long i = 0; i < notes->count * W; ++i) ++tally[bins[i]];
  notes->count = 0;
}}
static inline V measured(V north, V east, long samples, Notes *notes, unsigned *tally) {{
  typedef unsigned short Bins __attribute__((vector_size(2 * W), aligned(2)));
  V distance = v_sqrt(north * north + east * east);
  M bins = ((M)v_min(v_max(distance, K({LEAST!r})), K({most!r})) >> {shift}) - {first};
  if (samples < W) {{
    for (int i = 0; i < samples; ++i) ++tally[bins[i]];
  }} else {{
    *(Bins *)notes->bins[notes->count++] = __builtin_convertvector(bins, Bins);
    if (notes->count == {NOTED}) count(notes, tally);
  }}
  return distance;
}}
"""


class StagedSource:
    """Base of a C source: functions printed in stages, whose saved values share one array for each stage."""

    all: Sequence[PrintedFunction]

    def offset(self, stage: int, printed: PrintedFunction) -> int:
        """Index of the first saved value of a function in the array of a stage."""
        before = self.all[: next(i for i, other in enumerate(self.all) if other is printed)]
        return sum(len(other.saved[stage]) for other in before)

    def total(self, stage: int) -> int:
        """Number of values that a stage saves, at least 1 (C has no empty arrays)."""
        return max(1, sum(len(printed.saved[stage]) for printed in self.all))

    def stage(self, number: int) -> str:
        """C statements of stage `number` of all functions."""
        texts = []
        for printed in self.all:
            first = self.offset(number, printed)
            saves = [f"saved[{first + i}] = {text};" for i, text in enumerate(printed.saved[number])]
            texts.append(self.block(printed, range(number), [*printed.lines[number], *saves]))
        return " ".join(texts)

    def block(self, printed: PrintedFunction, stages: Sequence[int], lines: Sequence[str]) -> str:
        """A C block with `lines`, preceded by pointers to the values that the given stages saved."""
        heads = [f"const V *s{stage} = saved{stage} + {self.offset(stage, printed)};" for stage in stages]
        return "{ " + "\n".join([*heads, *lines]) + " }"


@dataclass(frozen=True)
class TapeLine:
    """One line of a step: `out` = rates of (state, memory), memory after dt, or state + a k."""

    kind: str
    out: str
    operands: tuple[str, ...]
    number: float = 0.0


def record_step(step: float, method: Method) -> tuple[list[TapeLine], str, str]:
    """The lines of one step from `x` and `m`, and the names of the state and memory after it."""
    lines: list[TapeLine] = []

    def note(kind: str, *operands: str, number: float = 0.0) -> str:
        lines.append(TapeLine(kind, f"b{len(lines)}", operands, number))
        return lines[-1].out

    after, later = integrate_step(
        lambda x, m: note("rates", x, m),
        lambda m, dt: note("advance", m, number=dt),
        lambda x, a, k: note("add", x, k, number=a),
        "x", "m", step, method,
    )  # fmt: skip
    return lines, after, later


def forward_statement(line: TapeLine, num_states: int, num_memory: int, rates: str, advance: str) -> str:
    """C statement of a line.

    rates : C call with places for state, memory and result. advance : the same for memory, time [s] and result.
    """
    size = num_memory if line.kind == "advance" else num_states
    if line.kind == "add":
        text = _ADD.format(size, *line.operands, line.out, line.number)
    elif line.kind == "rates":
        text = rates.format(*line.operands, line.out)
    else:
        text = advance.format(*line.operands, line.number, line.out)
    return f"V {line.out}[{max(1, size)}]; {text}"


def step_statements(
    num_states: int, num_memory: int, rates: str, advance: str, step: float, method: Method
) -> tuple[list[str], str, str]:
    """C statements of one step from `x` and `m`, and the names of the state and memory after it."""
    lines, after, later = record_step(step, method)
    return [forward_statement(line, num_states, num_memory, rates, advance) for line in lines], after, later


class _RolloutSource(StagedSource):
    """C source of one model: terms of parameters are computed once, terms of inputs once while they are constant."""

    def __init__(
        self, model: Dynamics, step: float, method: Method, wanted: CompilerTarget, tables: Mapping[int, RampTable]
    ) -> None:
        self.model, self.step, self.method, self.wanted = model, step, method, wanted
        rates = print_function(model.rates, STAGES, replace(C, lookup=wanted.lookup), tables)
        self.equations = [rates, print_function(model.advance, STAGES, C)]
        self.sums = [print_function(term.function, _SUM_STAGES, C) for term in model.sums]
        self.all = [*self.equations, *self.sums]

    def sum(self, i: int) -> str:
        """C loop over the components of sum `i`."""
        printed, term = self.sums[i], self.model.sums[i]
        before = [*printed.lines[2], f"V s2[] = {{ {', '.join((*printed.saved[2], 'K(0)'))} }};"]
        entries = sum(term.widths.values())
        if term.arrays is None:
            place = next(k for k, drawn in enumerate(self.model.drawn) if drawn is term)
            head = f"const U *component = drawn[{place}] + c * {entries};"
            count = f"counts[{place}]"
        else:
            rows = ", ".join("{" + ", ".join(repr(float(value)) for value in row) + "}" for row in term.arrays)
            before.append(f"static const REAL values[][{entries}] = {{ {rows} }};")
            head = f"V component[{entries}]; for (int j = 0; j < {entries}; ++j) component[j] = K(values[c][j]);"
            count = str(len(term.arrays))
        adds = [f"total[{j}] += {text};" for j, text in enumerate(printed.outputs)]
        loop = f"for (long c = 0; c < {count}; ++c) {{ {head}\n" + "\n".join([*printed.lines[3], *adds]) + " }"
        return self.block(printed, (0, 1), [*before, loop])

    def functions(self) -> str:
        """C functions: stages, rates and advance."""
        rates, advance = self.equations
        n = self.model.num_dof
        ends = [f"out[{i}] = {text};" for i, text in enumerate(rates.outputs)]
        lags = [f"out[{i}] = {text};" for i, text in enumerate(advance.outputs)]
        return f"""
static void stage0(const V *parameters, V *saved) {{ {self.stage(0)} }}
static void stage1(const V *commands, const V *environment, const V *saved0, V *saved) {{
{self.stage(1)} }}
static void rates(const V *state, const V *memory, const V *tau, const V *saved0, const V *saved1,
                  const U *const *drawn, const long *counts, V *out) {{
V total[{n}]; for (int i = 0; i < {n}; ++i) total[i] = tau[i];
{" ".join(self.sum(i) for i in range(len(self.sums)))}
const V *tau_extra = total;
{self.block(rates, (0, 1), [*rates.lines[2], *ends])} }}
static void advance(const V *state, const V *memory, double step, const V *saved0, const V *saved1, V *out) {{
const V dt[1] = {{ K(step) }};
{self.block(advance, (0, 1), [*advance.lines[2], *lags])} }}
"""

    def one_step(self) -> str:
        """C statements of one step."""
        nx, nm = len(self.model.state) + len(self.model.hidden), len(self.model.memory)
        rates = "rates({0}, {1}, tau, saved0, saved1, components, counts, {2});"
        lines, after, later = step_statements(
            nx, nm, rates, "advance(x, {0}, {1!r}, saved0, saved1, {2});", self.step, self.method
        )
        copy = f"for (int i = 0; i < {nx}; ++i) x[i] = {after}[i];"
        return "\n".join([*lines, copy, f"for (int i = 0; i < {nm}; ++i) m[i] = {later}[i];"])

    def text(self) -> str:
        """The complete C source for the target processor."""
        model, wanted = self.model, self.wanted
        nx, nm, n = len(model.state) + len(model.hidden), len(model.memory), model.num_dof
        nc, ne, parameters = len(model.commands), len(model.environment), len(model.parameters)
        widths = [sum(term.widths.values()) for term in model.drawn]
        block = 1 if widths else BLOCK
        drawn = " ".join(
            f"components[{i}] = (const U *)drawn[{i}] + g * counts[{i}] * {w};" for i, w in enumerate(widths)
        )
        check = " ".join(
            f"for (long c = 0; c < counts[{i}] * {w}; ++c) sum += ((const U *)drawn[{i}])[g * counts[{i}] * {w} + c];"
            for i, w in enumerate(widths)
        )
        task = f"""V parameters[{max(1, parameters)}], saved0[{self.total(0)}], known[{block}][{self.total(1)}];
V states[{block}][{nx}], memories[{block}][{max(1, nm)}], taus[{block}][{n}], greatest[{block}], distance[{block}];
V given = K(0); // its product with 0 is no number where a parameter is none
for (int i = 0; i < {parameters}; ++i) given += parameters[i] = K(values[number / parts * {parameters} + i]);
stage0(parameters, saved0);
const long groups = stride / W, part = number % parts, last = groups * (part + 1) / parts;
const long num_records = steps / every;
ONE_VARIANT(records, (num_records + 1) * num_rows * stride)
ONE_VARIANT(sums, stride)
ONE_VARIANT(worst, stride)
if (tally) tally += number * {BINS};
Notes notes;
notes.count = 0;
for (long front = groups * part / parts; front < last; front += {block}) {{
  long end = front + {block} < last ? front + {block} : last;
  EACH_GROUP(end) {{
    V *x = states[j], *m = memories[j], sum = given;
    {check}
    greatest[j] = distance[j] = K(0);
    for (int i = 0; i < {nx}; ++i) {{ x[i] = *AT(start, i); sum += x[i]; }}
    for (int i = 0; i < {nm}; ++i) {{ m[i] = *AT(memory, i); sum += m[i]; }}
    for (int i = {n}; i < {2 * n}; ++i) greatest[j] = v_max(v_fabs(x[i]), greatest[j]);
    greatest[j] += 0 * sum;
    if (records) NOTE(0)
  }}
  for (long k = 0, record = 0; k < steps; ++k) {{
    const int due = k + 1 == (record + 1) * every;
    record += due;
    EACH_GROUP(end) {{
      V *x = states[j], *m = memories[j], *tau = taus[j], *saved1 = known[j], all = K(0);
      const U *components[{max(1, len(widths))}];
      {drawn}
      if (k == 0 || k < lengths[2])
        for (int i = 0; i < {n}; ++i) all += tau[i] = *AT(extra, k * {n} + i);
      if (k == 0 || k < lengths[0] || k < lengths[1]) {{
        V c[{max(1, nc)}], e[{max(1, ne)}];
        for (int i = 0; i < {nc}; ++i) all += c[i] = *AT(commands, NOW(0, k) * {nc} + i);
        for (int i = 0; i < {ne}; ++i) all += e[i] = *AT(environment, NOW(1, k) * {ne} + i);
        stage1(c, e, saved0, saved1);
      }}
      {self.one_step()}
      for (int i = 0; i < {nm}; ++i) all += m[i];
      for (int i = {n}; i < {2 * n}; ++i) greatest[j] = v_max(v_fabs(x[i]), greatest[j]);
      greatest[j] += 0 * all;
      if (due && records) NOTE(record)
      if (due && goal) {{
        const U *there = goal + 2 * (g * num_records + record - 1);
        distance[j] += measured(ROW(0) - there[0], ROW(1) - there[1], samples - g * W, &notes, tally);
      }}
    }}
  }}
  EACH_GROUP(end) {{
    for (int i = 0; i < {nx}; ++i) greatest[j] += 0 * states[j][i]; // a state that is no number stays none
    if (goal) *AT(sums, 0) = distance[j];
    *AT(worst, 0) = greatest[j];
  }}
}}
if (tally) count(&notes, tally);"""
        return f"""{_FOR_GCC}{vector_source(wanted)}
{wanted.lookup.head() if wanted.lookup else ""}
{self.functions()}
{_distance_source(wanted.precision)}
#define AT(array, row) ((U *)((array) + (row) * stride + g * W))
#define NOW(series, k) ((k) < lengths[series] ? (k) : lengths[series] - 1)
#define ROW(i) (rows[i] < {nx} ? x[rows[i]] : m[rows[i] - {nx}])
#define NOTE(record) for (long i = 0; i < num_rows; ++i) *AT(records, (record) * num_rows + i) = ROW(i);
#define EACH_GROUP(end) for (long g = front, j = 0; g < end; ++g, ++j)
#define ONE_VARIANT(array, size) if (array) array += number / parts * (size);
{threaded_source(_SIZES, _ARRAYS, task)}"""


@lru_cache(maxsize=64)
def _compile_rollout(
    model: Dynamics, step: float, method: Method, precision: Precision, looked_up: Sequence[int]
) -> Any:
    """The compiled function `run` of a model, from the cache if possible; some of its tables are looked up."""
    tables = {k: find_tables(model.rates)[k] for k in looked_up}
    return compile_source(_RolloutSource(model, step, method, compiler_target(precision), tables).text())


def compile_source(source: str, further: Sequence[str] = ()) -> Any:
    """The compiled function `run` of C source, from the cache if possible; `further`: options of the compiler.

    NoLibrary if the compiler fails or hangs, or where nothing can be written.
    """
    command = find_compiler()
    if command is None:
        why = _refused[0] if _refused else "install gcc"
        raise NoLibrary(f"engines 'native' and 'single' need a C compiler ({why}), or use engine 'torch'")
    options, processor = (*OPTIONS, *further), (platform.machine(), *sorted(_processor_flags()))
    words = [source, *options, command, compiler_version(command), *processor]
    name = f"{hashlib.sha256(chr(10).join(words).encode()).hexdigest()[:24]}.so"
    return obtain_library(_compiler_command(command, compiler_target(), further), source, _user_cache(), name)


def pad_samples(array: Array, wide: int, precision: Precision = DOUBLE) -> Array:
    """Pad samples to whole vectors: (..., S) -> (..., wide), the last sample repeated."""
    fill = wide - array.shape[-1]
    filled = np.concatenate([array, np.repeat(array[..., -1:], fill, axis=-1)], axis=-1) if fill else array
    return np.ascontiguousarray(filled, dtype=precision.dtype)


def pack_lanes(array: Array, precision: Precision = DOUBLE) -> Array:
    """Group samples by SIMD lanes: (S, ..., entries) -> (groups, ..., entries, lanes); the last one is repeated.

    What one group reads at every step lies together.
    """
    lanes = compiler_target(precision).lanes
    filled = np.concatenate([array, np.repeat(array[-1:], -len(array) % lanes, axis=0)])
    groups = filled.reshape(-1, lanes, *array.shape[1:])
    return np.ascontiguousarray(np.moveaxis(groups, 1, -1), dtype=precision.dtype)


def run_native(
    model: Dynamics, batch: RolloutBatch, job: RolloutJob, precision: Precision = DOUBLE
) -> tuple[Array, Array]:
    """Records (R, V, S, C) and the greatest speed (V, S)."""
    num_samples = batch.state.shape[1]
    records, worst = run_packed(model, batch, job, precision)
    return records.transpose(1, 0, 3, 2)[:, :, :num_samples].astype(float, copy=False), worst[:, :num_samples]


def run_packed(
    model: Dynamics, batch: RolloutBatch, job: RolloutJob, precision: Precision = DOUBLE
) -> tuple[Array, Array]:
    """Records (V, R, C, width) and the greatest speed (V, width) as C writes them, whole vectors of samples."""
    num_variants, wide = len(batch.parameters), padded_width(batch, precision)
    records = np.empty((num_variants, job.num_steps // job.every + 1, len(job.rows), wide), precision.dtype)
    worst = np.empty((num_variants, wide), precision.dtype)
    _run_job(model, batch, job, precision, worst=worst, records=records)
    return records, worst


def measure_native(
    model: Dynamics, batch: RolloutBatch, job: RolloutJob, goal: Array, precision: Precision = DOUBLE
) -> tuple[Array, Array, Array]:
    """Sum of distances (V, S), tally of distances (V, BINS) and the greatest speed (V, S), with no path kept.

    The distances are those of the job's two channels to `goal` (T, 2, S), after every step.
    """
    num_samples, num_variants, wide = batch.state.shape[1], len(batch.parameters), padded_width(batch, precision)
    sums, worst = (np.empty((num_variants, wide), precision.dtype) for _ in range(2))
    tally = np.zeros((num_variants, count_parts(batch, precision), BINS), dtype=np.uint32)
    there = pack_lanes(goal.transpose(2, 0, 1), precision)
    _run_job(model, batch, job, precision, worst=worst, goal=there, sums=sums, tally=tally)
    whole = tally[:, 0] if tally.shape[1] == 1 else tally.sum(axis=1, dtype=np.uint32)
    return sums[:, :num_samples].astype(float, copy=False), whole, worst[:, :num_samples]


def padded_width(batch: RolloutBatch, precision: Precision = DOUBLE) -> int:
    """Number of samples, rounded up to whole vectors."""
    lanes = compiler_target(precision).lanes
    return -(-int(batch.state.shape[1]) // lanes) * lanes


def count_parts(batch: RolloutBatch, precision: Precision = DOUBLE) -> int:
    """Number of parts of the samples of a variant, each a task: enough for an even load on all cores."""
    return min(
        PARTS * count_threads() // len(batch.parameters) + 1,
        padded_width(batch, precision) // compiler_target(precision).lanes,
    )


def _run_job(model: Dynamics, batch: RolloutBatch, job: RolloutJob, precision: Precision, **wanted: Array) -> None:
    """Run a job and fill the arrays in `wanted`: `worst`, and `records`, or `sums` and `tally` for a `goal`."""
    lanes, wide, parts = compiler_target(precision).lanes, padded_width(batch, precision), count_parts(batch, precision)
    series = {
        "commands": pad_samples(batch.commands, wide, precision),
        "environment": pad_samples(batch.environment, wide, precision),
        "extra": pad_samples(batch.tau_extra, wide, precision),
    }
    drawn = [pack_lanes(part.transpose(1, 2, 0), precision) for part in batch.components]
    arrays: dict[str, Array] = {
        "lengths": as_c_longs(len(part) for part in series.values()),
        "counts": as_c_longs(part.shape[1] for part in drawn),
        "rows": as_c_longs(job.rows),
        "drawn": np.array([part.ctypes.data for part in drawn], dtype=np.uintp),
        "values": np.ascontiguousarray(batch.parameters, dtype=precision.dtype),
        "start": pad_samples(batch.state, wide, precision),
        "memory": pad_samples(batch.memory, wide, precision),
        **series,
        **wanted,
    }
    sizes = (parts, wide, batch.state.shape[1], job.num_steps, job.every, len(job.rows))
    work = wide / lanes / parts * job.num_steps * (1 + sum(part.shape[1] for part in drawn))
    looked_up = tuple(even_tables(model.rates, batch.parameters)) if compiler_target(precision).lookup else ()
    run = _compile_rollout(model, job.step, job.method, precision, looked_up)
    run_tasks(run, sizes, (arrays.get(name) for name in _ARRAYS), parts * len(batch.parameters), work)


def as_c_longs(numbers: Iterable[int]) -> Array:
    """Integers as C `long`."""
    return np.array(list(numbers), dtype=np.dtype("l"))
