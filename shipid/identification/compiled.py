"""The variational equations compiled as C: each SIMD lane integrates one prediction, groups of lanes run on threads."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from shipid.data.dataset import Array
from shipid.engine.native import C, StagedSource, compile_source, compiler_target, pack_lanes, step_statements
from shipid.engine.printing import print_function
from shipid.engine.threads import run_tasks, threaded_source
from shipid.engine.vectors import CompilerTarget, vector_source
from shipid.identification.sensitivities import FitLayout, Variation, build_variation

STAGES = (("fixed",), ("known",))  # once an interval; once a step
_ARRAYS = dict.fromkeys(("numbers", "inputs", "signals", "state", "records"), "double")


class _VariationSource(StagedSource):
    """C source of one variation: terms of parameters alone are computed once, terms of the inputs once per step."""

    def __init__(self, model: Variation) -> None:
        self.model = model
        self.all = [print_function(f, STAGES, C) for f in (model.rates, model.advance, model.outputs)]

    def main(self, number: int) -> str:
        """Body of function `number` (rates, advance, outputs): the part evaluated at every integrator stage."""
        printed = self.all[number]
        ends = [f"out[{i}] = {text};" for i, text in enumerate(printed.outputs)]
        return self.block(printed, (0, 1), [*printed.lines[2], *ends])

    def one_step(self) -> str:
        """C statements of one step, with the outputs after it."""
        num_z, num_m = self.model.rates.size1_in(0), self.model.rates.size1_in(1)
        layout, ends = self.model.layout, "saved0, saved1, {2});"
        lines, after, later = step_statements(
            num_z, num_m, f"rates({{0}}, {{1}}, {ends}", f"advance({{0}}, {{1!r}}, {ends}", layout.step, layout.method
        )
        lines.append(f"outputs({after}, {later}, saved0, saved1, seen, record);")
        lines.append(f"for (int i = 0; i < {num_z}; ++i) x[i] = {after}[i];")
        if layout.carried:
            lines.append(f"for (int i = 0; i < {num_m}; ++i) m[i] = {later}[i];")
        return "\n".join(lines)

    def text(self, wanted: CompilerTarget) -> str:
        """The complete C source for the target processor."""
        model = self.model
        num_z, num_m = model.rates.size1_in(0), model.rates.size1_in(1)
        fixed, known = model.rates.size1_in(2), model.rates.size1_in(3)
        seen, record = model.outputs.size1_in(3), model.outputs.size1_out(0)
        memory = f"x + {num_z}" if model.layout.carried else f"given + {known - num_m}"
        task = f"""V fixed[{max(1, fixed)}], given[{max(1, known)}], saved0[{self.total(0)}], saved1[{self.total(1)}];
V x[{model.size}];
const U *n = (const U *)numbers + number * {fixed};
for (int i = 0; i < {fixed}; ++i) fixed[i] = n[i];
const U *s = (const U *)state + number * {model.size};
for (int i = 0; i < {model.size}; ++i) x[i] = s[i];
stage0(fixed, saved0);
for (long k = number * steps; k < (number + 1) * steps; ++k) {{
  const U *now = (const U *)inputs + k * {known}, *seen = (const U *)signals + k * {seen};
  U *note = (U *)records + k * {record};
  for (int i = 0; i < {known}; ++i) given[i] = now[i];
  V *m = {memory}, record[{record}];
  stage1(given, saved0, saved1);
  {{ {self.one_step()} }}
  for (int i = 0; i < {record}; ++i) note[i] = record[i];
}}"""
        return f"""{vector_source(wanted)}
static void stage0(const V *fixed, V *saved) {{ {self.stage(0)} }}
static void stage1(const V *known, const V *saved0, V *saved) {{ {self.stage(1)} }}
static void rates(const V *z, const V *m, const V *saved0, const V *saved1, V *out) {{ {self.main(0)} }}
static void advance(const V *m, double step, const V *saved0, const V *saved1, V *out) {{
const V dt[1] = {{ K(step) }}; {self.main(1)} }}
static void outputs(const V *z, const V *m, const V *saved0, const V *saved1, const U *seen, V *out) {{
{self.main(2)} }}
{threaded_source(("steps",), _ARRAYS, task)}"""


@lru_cache(maxsize=32)
def _compile_variation(layout: FitLayout) -> Any:
    return compile_source(_VariationSource(build_variation(layout)).text(compiler_target()))


def run_compiled(layout: FitLayout, x: Array, fixed: Array, known: Array, seen: Array) -> Array:
    """Outputs (groups, lanes, N, .) of K predictions, by the compiled library.

    x : (K, size) initial states with their sensitivities. fixed : (K, .) constants of each prediction.
    known, seen : inputs and measured signals of each step, grouped by `pack_lanes`: (groups, N, ., lanes).
    """
    run, model = _compile_variation(layout), build_variation(layout)
    state, numbers = pack_lanes(x), pack_lanes(fixed)
    groups, num_steps = known.shape[:2]
    records = np.empty((groups, num_steps, model.outputs.size1_out(0), compiler_target().lanes))
    work = num_steps * model.size  # of one group
    run_tasks(run, (num_steps,), (numbers, known, seen, state, records), groups, work)
    return np.moveaxis(records, -1, 1)
