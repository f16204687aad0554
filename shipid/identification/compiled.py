"""The variational equations compiled as C: each SIMD lane integrates one prediction, groups of lanes run on threads."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipid.engine.integrate import cores, integrate
from shipid.engine.native import C, compiled, target
from shipid.engine.printing import Printed, print_function
from shipid.engine.vectors import Target, head
from shipid.identification.sensitivities import Layout, Variation, variation

Array = NDArray[np.float64]
STAGES = (("fixed",), ("known",))  # once an interval; once a step
THREADS_FROM = 1e5  # vectors stepped: below it starting a thread costs more than it saves


class _Source:
    """C source of one variation: terms of parameters alone are computed once, terms of the inputs once per step."""

    def __init__(self, model: Variation) -> None:
        self.model = model
        self.parts = [print_function(f, STAGES, C) for f in (model.rates, model.advance, model.outputs)]

    def total(self, stage: int) -> int:
        """Number of values that stage `stage` saves, at least 1 (C has no empty arrays)."""
        return max(1, sum(len(printed.saved[stage]) for printed in self.parts))

    def stage(self, number: int) -> str:
        """Statements of stage `number` (0: once per prediction, 1: once per step) for all three functions."""
        return " ".join(
            self.block(
                printed,
                range(number),
                [
                    *printed.lines[number],
                    *(
                        f"saved[{self._offset(number, printed) + i}] = {t};"
                        for i, t in enumerate(printed.saved[number])
                    ),
                ],
            )
            for printed in self.parts
        )

    def block(self, printed: Printed, stages: Sequence[int], lines: Sequence[str]) -> str:
        """A C block with `lines`, preceded by pointers to the values that the given stages saved."""
        heads = [f"const V *s{stage} = saved{stage} + {self._offset(stage, printed)};" for stage in stages]
        return "{ " + "\n".join([*heads, *lines]) + " }"

    def _offset(self, stage: int, printed: Printed) -> int:
        before = self.parts[: next(i for i, other in enumerate(self.parts) if other is printed)]
        return sum(len(other.saved[stage]) for other in before)

    def main(self, number: int) -> str:
        """Body of function `number` (rates, advance, outputs): the part evaluated at every integrator stage."""
        printed = self.parts[number]
        ends = [f"out[{i}] = {text};" for i, text in enumerate(printed.outputs)]
        return self.block(printed, (0, 1), [*printed.lines[2], *ends])

    def one_step(self) -> str:
        """One integrator step as C statements: `integrate` runs on buffer names, and each operation emits a line."""
        lines: list[str] = []
        num_z, num_m = self.model.rates.size1_in(0), self.model.rates.size1_in(1)

        def name(size: int) -> str:
            lines.append(f"V b{len(lines)}[{max(1, size)}];")
            return f"b{len(lines) - 1}"

        def rates(z: str, m: str) -> str:
            out = name(num_z)
            lines.append(f"rates({z}, {m}, saved0, saved1, {out});")
            return out

        def advance(m: str, dt: float) -> str:
            out = name(num_m)
            lines.append(f"advance({m}, {dt!r}, saved0, saved1, {out});")
            return out

        def add(z: str, a: float, k: str) -> str:
            out = name(num_z)
            lines.append(f"for (int i = 0; i < {num_z}; ++i) {out}[i] = {z}[i] + {a!r} * {k}[i];")
            return out

        layout = self.model.layout
        after, later = integrate(rates, advance, add, "x", "m", layout.step, layout.method)
        lines.append(f"outputs({after}, {later}, saved0, saved1, seen, record);")
        lines.append(f"for (int i = 0; i < {num_z}; ++i) x[i] = {after}[i];")
        if layout.carried:
            lines.append(f"for (int i = 0; i < {num_m}; ++i) m[i] = {later}[i];")
        return "\n".join(lines)

    def text(self, wanted: Target) -> str:
        """The complete C source for the target processor."""
        model = self.model
        num_z, num_m = model.rates.size1_in(0), model.rates.size1_in(1)
        fixed, known = model.rates.size1_in(2), model.rates.size1_in(3)
        seen, record = model.outputs.size1_in(3), model.outputs.size1_out(0)
        memory = f"x + {num_z}" if model.layout.carried else f"given + {known - num_m}"
        return f"""{head(wanted)}
static void stage0(const V *fixed, V *saved) {{ {self.stage(0)} }}
static void stage1(const V *known, const V *saved0, V *saved) {{ {self.stage(1)} }}
static void rates(const V *z, const V *m, const V *saved0, const V *saved1, V *out) {{ {self.main(0)} }}
static void advance(const V *m, double step, const V *saved0, const V *saved1, V *out) {{
const V dt[1] = {{ K(step) }}; {self.main(1)} }}
static void outputs(const V *z, const V *m, const V *saved0, const V *saved1, const U *seen, V *out) {{
{self.main(2)} }}
void run(long first, long last, long steps, double *numbers, double *given_, double *seen_, double *state,
         double *records) {{
V fixed[{max(1, fixed)}], given[{max(1, known)}], saved0[{self.total(0)}], saved1[{self.total(1)}], x[{model.size}];
for (long g = first; g < last; ++g) {{
  const U *n = (const U *)numbers + g * {fixed};
  for (int i = 0; i < {fixed}; ++i) fixed[i] = n[i];
  U *s = (U *)state + g * {model.size};
  for (int i = 0; i < {model.size}; ++i) x[i] = s[i];
  stage0(fixed, saved0);
  for (long k = 0; k < steps; ++k) {{
    const U *now = (const U *)given_ + (g * steps + k) * {known};
    const U *seen = (const U *)seen_ + (g * steps + k) * {seen};
    U *note = (U *)records + (g * steps + k) * {record};
    for (int i = 0; i < {known}; ++i) given[i] = now[i];
    V *m = {memory}, record[{record}];
    stage1(given, saved0, saved1);
    {{ {self.one_step()} }}
    for (int i = 0; i < {record}; ++i) note[i] = record[i];
  }}
  for (int i = 0; i < {model.size}; ++i) s[i] = x[i];
}} }}
"""


@lru_cache(maxsize=32)
def _library(layout: Layout) -> Any:
    return compiled(_Source(variation(layout)).text(target()))


def pack(array: Array) -> Array:
    """Group predictions by SIMD lanes: (K, ..., entries) -> (groups, ..., entries, lanes); the last one is repeated."""
    lanes, count = target().lanes, len(array)
    filled = np.concatenate([array, np.repeat(array[-1:], -count % lanes, axis=0)])
    return np.ascontiguousarray(np.moveaxis(filled.reshape(-1, lanes, *array.shape[1:]), 1, -1), dtype=float)


def run_compiled(layout: Layout, x: Array, fixed: Array, known: Array, seen: Array) -> Array:
    """Outputs (groups, lanes, N, .) of K predictions, by the compiled library.

    x : (K, size) initial states with their sensitivities. fixed : (K, .) numbers that are constant along a prediction.
    known, seen : inputs and measured signals of each step, grouped by `pack`: (groups, N, ., lanes).
    """
    run, model = _library(layout), variation(layout)
    state, numbers = pack(x), pack(fixed)
    groups, num_steps = known.shape[:2]
    records = np.empty((groups, num_steps, model.outputs.size1_out(0), target().lanes))
    arrays = [ctypes.c_void_p(array.ctypes.data) for array in (numbers, known, seen, state, records)]

    def part(first: int, last: int) -> None:
        run(ctypes.c_long(first), ctypes.c_long(last), ctypes.c_long(num_steps), *arrays)

    threads = min(cores(), groups) if groups * num_steps * model.size > THREADS_FROM else 1
    if threads == 1:
        part(0, groups)
    else:
        edges = np.linspace(0, groups, threads + 1).astype(int).tolist()
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(part, edges[:-1], edges[1:]))
    return np.moveaxis(records, -1, 1)
