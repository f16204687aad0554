"""Exact gradients as C on SIMD vectors: a forward rollout that keeps its states, then a reverse (adjoint) sweep.

The integrator runs once on names, which records the operations of one step; the sweep processes them in reverse.
CasADi differentiates rates and memories in reverse mode, once for each structure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from casadi import SX

from shipid.engine.casadi import input_symbols, summed_rates
from shipid.engine.integrate import Array, Method, RolloutBatch, RolloutJob
from shipid.engine.native import (
    C,
    StagedSource,
    TapeLine,
    as_c_longs,
    compile_source,
    compiler_target,
    count_parts,
    forward_statement,
    pad_samples,
    padded_width,
    record_step,
    run_packed,
)
from shipid.engine.printing import STAGES, print_function
from shipid.engine.threads import run_tasks, threaded_source
from shipid.engine.vectors import CompilerTarget, vector_source
from shipid.errors import ShipidError
from shipid.vessel.dynamics import INPUTS, Dynamics

Loss = Callable[[Array], tuple[Array, Array]]
"""Path (T + 1, S, C) of the kept channels -> the loss of each sample (S,), and its slope in the path (T + 1, S, C)."""

_SIZES = ("parts", "stride", "steps", "num_rows")
_ARRAYS = {
    **dict.fromkeys(("lengths", "rows"), "const long"),
    **dict.fromkeys(("numbers", "path", "commands", "environment", "extra", "slopes"), "double"),
    **dict.fromkeys(("state_bar", "parameters_bar", "extra_bar"), "double"),
}


@dataclass(frozen=True)
class Adjoint:
    """A loss of each sample and its exact derivatives, channel first.

    loss : (S,). path : (T + 1, S, C) the kept channels. worst : (S,) greatest speed on the way.
    parameters : (K, S), in the order of the wanted ones. tau_extra : (T, n_dof, S), of the force of each step.
    state : (nx, S), of the states at the start.
    """

    loss: Array
    path: Array
    worst: Array
    parameters: Array
    tau_extra: Array
    state: Array


def evaluate_loss(loss: Loss, path: Array) -> tuple[Array, Array]:
    """Values (S,) and slopes (T + 1, S, C) of a loss for a path; ShipidError for wrong shapes."""
    values, slopes = (np.asarray(part, dtype=float) for part in loss(path))
    if values.shape != path.shape[1:2] or slopes.shape != path.shape:
        wanted = f"{path.shape[1:2]} and {path.shape}"
        raise ShipidError(f"a loss gives values and slopes of shapes {wanted}, not {values.shape} and {slopes.shape}")
    return values, slopes


def _needed_values(lines: Sequence[TapeLine]) -> set[str]:
    """Names of the forward values that the sweep needs: operands of rates and memories, and their operands."""
    needed = {name for line in lines if line.kind != "add" for name in line.operands}
    for line in reversed(lines):
        if line.out in needed:
            needed |= set(line.operands)
    return needed


class _AdjointSource(StagedSource):
    """C source of the reverse sweep of one model."""

    def __init__(self, model: Dynamics, wanted: tuple[int, ...], step: float, method: Method) -> None:
        self.model, self.wanted = model, wanted
        self.tape = record_step(step, method)
        inputs = input_symbols(model)
        tau, dt = SX.sym("tau_extra", model.num_dof), SX.sym("dt")
        rates = SX(summed_rates(model, inputs, tau, {}))
        later = SX(model.advance(*inputs, dt))
        start = inputs[0].numel() + inputs[1].numel()

        def function(name: str, result: SX, last: SX, *more: SX) -> ca.Function:
            given = [*inputs, last, *more]
            names = [*INPUTS, "dt" if last is dt else "tau_extra", *(["bar"] if more else [])]
            return ca.Function(name, given, [ca.densify(result)], names, ["result"], {"cse": True})

        def reverse(name: str, result: SX, last: SX) -> ca.Function:
            """(inputs, last, bar) -> bar^T d(result)/d(state, memory, wanted parameters, last)."""
            bar = SX.sym("bar", result.shape[0])
            slopes = ca.jtimes(result, ca.vertcat(*inputs[:2], inputs[4], last), bar, True)
            kept = [*range(start), *(start + place for place in wanted)]
            kept += [] if last is dt else range(start + len(model.parameters), slopes.shape[0])
            return function(name, slopes[kept], last, bar)

        functions = [
            function("rates", rates, tau),
            function("advance", later, dt),
            reverse("rates_back", rates, tau),
            reverse("advance_back", later, dt),
        ]
        self.all = [print_function(one, STAGES, C) for one in functions]

    def functions(self) -> str:
        """C functions: stages, rates, memories, and the reverse modes of both, which accumulate derivatives."""
        rates, advance, rates_back, advance_back = self.all
        nx, nm, count = len(self.model.state) + len(self.model.hidden), len(self.model.memory), len(self.wanted)

        def ends(texts: Sequence[str]) -> list[str]:
            return [f"out[{i}] = {text};" for i, text in enumerate(texts)]

        def adds(texts: Sequence[str]) -> list[str]:
            sizes = (("state_bar", nx), ("memory_bar", nm), ("grad", count), ("tau_bar", self.model.num_dof))
            names = [f"{name}[{i}]" for name, size in sizes for i in range(size)]
            pairs = zip(names, texts, strict=False)  # the memories take no force
            return [f"{name} += {text};" for name, text in pairs if text not in ("K(0.0)", "K(-0.0)")]

        inputs = "const V *state, const V *memory"
        saved = "const V *saved0, const V *saved1"
        bars = "const V *bar, V *state_bar, V *memory_bar, V *grad, V *tau_bar"
        return f"""
static void stage0(const V *parameters, V *saved) {{ {self.stage(0)} }}
static void stage1(const V *commands, const V *environment, const V *saved0, V *saved) {{
{self.stage(1)} }}
static void rates({inputs}, const V *tau_extra, {saved}, V *out) {{
{self.block(rates, (0, 1), [*rates.lines[2], *ends(rates.outputs)])} }}
static void advance({inputs}, double step, {saved}, V *out) {{ const V dt[1] = {{ K(step) }};
{self.block(advance, (0, 1), [*advance.lines[2], *ends(advance.outputs)])} }}
static void rates_back({inputs}, const V *tau_extra, {saved}, {bars}) {{
{self.block(rates_back, (0, 1), [*rates_back.lines[2], *adds(rates_back.outputs)])} }}
static void advance_back({inputs}, double step, {saved}, {bars}) {{ const V dt[1] = {{ K(step) }};
{self.block(advance_back, (0, 1), [*advance_back.lines[2], *adds(advance_back.outputs)])} }}
"""

    def one_step(self) -> str:
        """C statements of one step: the needed forward values, computed again, then the reverse of the step."""
        lines, after, memory_after = self.tape
        sizes = {"rates": len(self.model.state) + len(self.model.hidden), "advance": len(self.model.memory)}
        sizes["add"] = sizes["rates"]
        needed = _needed_values(lines)
        calls = "rates({0}, {1}, tau, saved0, saved1, {2});", "advance(x, {0}, {1!r}, saved0, saved1, {2});"
        forward = [
            forward_statement(line, sizes["rates"], sizes["advance"], *calls) for line in lines if line.out in needed
        ]
        bars = [f"V {line.out}_bar[{max(1, sizes[line.kind])}] = {{}};" for line in lines]
        bars += [f"V x_bar[{sizes['rates']}] = {{}}, m_bar[{max(1, sizes['advance'])}] = {{}};"]
        bars += [f"for (int i = 0; i < {sizes['rates']}; ++i) {after}_bar[i] = x_next[i];"]
        bars += [f"for (int i = 0; i < {sizes['advance']}; ++i) {memory_after}_bar[i] = m_next[i];"]
        backward = [self._backward(line, sizes[line.kind]) for line in reversed(lines)]
        ends = [f"for (int i = 0; i < {sizes['rates']}; ++i) x_next[i] = x_bar[i];"]
        ends += [f"for (int i = 0; i < {sizes['advance']}; ++i) m_next[i] = m_bar[i];"]
        return "\n".join([*forward, *bars, *backward, *ends])

    def _backward(self, line: TapeLine, size: int) -> str:
        bar = f"{line.out}_bar"
        if line.kind == "rates":
            x, m = line.operands
            return f"rates_back({x}, {m}, tau, saved0, saved1, {bar}, {x}_bar, {m}_bar, grad, tau_bar);"
        if line.kind == "advance":
            m = line.operands[0]
            if not size:
                return ""
            return f"advance_back(x, {m}, {line.number!r}, saved0, saved1, {bar}, x_bar, {m}_bar, grad, tau_bar);"
        x, k = line.operands
        return (
            f"for (int i = 0; i < {size}; ++i) {{ {x}_bar[i] += {bar}[i]; {k}_bar[i] += {line.number!r} * {bar}[i]; }}"
        )

    def text(self, wanted: CompilerTarget) -> str:
        """The complete C source for the target processor."""
        model = self.model
        nx, nm, n = len(model.state) + len(model.hidden), len(model.memory), model.num_dof
        nc, ne, parameters, count = len(model.commands), len(model.environment), len(model.parameters), len(self.wanted)
        task = f"""V parameters[{max(1, parameters)}], saved0[{self.total(0)}], saved1[{self.total(1)}];
for (int i = 0; i < {parameters}; ++i) parameters[i] = K(numbers[i]);
stage0(parameters, saved0);
const long groups = stride / W;
for (long g = groups * number / parts; g < groups * (number + 1) / parts; ++g) {{
  V x_next[{nx}] = {{}}, m_next[{max(1, nm)}] = {{}}, grad[{max(1, count)}] = {{}}, tau[{n}];
  for (long k = steps - 1; k >= 0; --k) {{
    V x[{nx}], m[{max(1, nm)}], tau_bar[{n}] = {{}};
    SLOPES(k + 1)
    for (int i = 0; i < {nx}; ++i) x[i] = *AT(path, k * {nx + nm} + i);
    for (int i = 0; i < {nm}; ++i) m[i] = *AT(path, k * {nx + nm} + {nx} + i);
    if (k == steps - 1 || lengths[2] > 1)
      for (int i = 0; i < {n}; ++i) tau[i] = *AT(extra, NOW(2, k) * {n} + i);
    if (k == steps - 1 || lengths[0] > 1 || lengths[1] > 1) {{
      V c[{max(1, nc)}], e[{max(1, ne)}];
      for (int i = 0; i < {nc}; ++i) c[i] = *AT(commands, NOW(0, k) * {nc} + i);
      for (int i = 0; i < {ne}; ++i) e[i] = *AT(environment, NOW(1, k) * {ne} + i);
      stage1(c, e, saved0, saved1);
    }}
    {self.one_step()}
    for (int i = 0; i < {n}; ++i) *AT(extra_bar, k * {n} + i) = tau_bar[i];
  }}
  SLOPES(0)
  for (int i = 0; i < {nx}; ++i) *AT(state_bar, i) = x_next[i];
  for (int i = 0; i < {count}; ++i) *AT(parameters_bar, i) = grad[i];
}}"""
        return f"""{vector_source(wanted)}
{self.functions()}
#define AT(array, row) ((U *)((array) + (row) * stride + g * W))
#define NOW(series, k) ((k) < lengths[series] ? (k) : lengths[series] - 1)
#define SLOPES(record) for (long i = 0; i < num_rows; ++i) {{ \\
  V slope = *AT(slopes, (record) * num_rows + i); \\
  if (rows[i] < {nx}) x_next[rows[i]] += slope; else m_next[rows[i] - {nx}] += slope; }}
{threaded_source(_SIZES, _ARRAYS, task)}"""


@lru_cache(maxsize=32)
def _compile_adjoint(model: Dynamics, wanted: tuple[int, ...], step: float, method: Method) -> Any:
    """The compiled function `run` of a sweep, from the cache if possible."""
    return compile_source(_AdjointSource(model, wanted, step, method).text(compiler_target()))


def gradient_native(
    model: Dynamics, batch: RolloutBatch, job: RolloutJob, wanted: tuple[int, ...], loss: Loss
) -> Adjoint:
    """A loss on the job's channels and its derivatives, samples on SIMD lanes and threads.

    wanted : indices of the parameters to differentiate by. The batch has one variant and no drawn components.
    """
    nx, nm, num_samples, wide = len(batch.state), len(batch.memory), batch.state.shape[1], padded_width(batch)
    records, worst = run_packed(model, batch, replace(job, every=1, rows=tuple(range(nx + nm))))
    path = records[0][:, list(job.rows)].transpose(0, 2, 1)[:, :num_samples]
    values, slopes = evaluate_loss(loss, path)
    series = [pad_samples(part, wide) for part in (batch.commands, batch.environment, batch.tau_extra)]
    force = np.empty((job.num_steps, model.num_dof, wide))
    state, slope = np.empty((nx, wide)), np.empty((len(wanted), wide))
    given = [
        as_c_longs(len(part) for part in series),
        as_c_longs(job.rows),
        np.ascontiguousarray(batch.parameters[0], dtype=float),
        records,
        *series,
        pad_samples(slopes.transpose(0, 2, 1), wide),
    ]
    parts = count_parts(batch)
    work = wide / compiler_target().lanes / parts * job.num_steps
    sizes = parts, wide, job.num_steps, len(job.rows)
    run = _compile_adjoint(model, wanted, job.step, job.method)
    run_tasks(run, sizes, [*given, state, slope, force], parts, work)
    return Adjoint(
        values, path, worst[0, :num_samples], slope[:, :num_samples], force[:, :, :num_samples], state[:, :num_samples]
    )
