"""A function of vectors on many samples at once: as C on SIMD vectors and threads, or by CasADi's virtual machine.

For long functions without a loop, such as one step of the observer. Every sample is a column; samples do not depend on
each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from shipid.engine.integrate import Array
from shipid.engine.libraries import NoLibrary
from shipid.engine.native import C, compile_source, compiler_target, find_compiler, note_interpretation, pad_samples
from shipid.engine.printing import print_function
from shipid.engine.threads import run_tasks, threaded_source
from shipid.engine.vectors import vector_source
from shipid.interrupts import hold_interrupts

COMPILE_FROM = 1e9  # operations: below it compiling C (five seconds or more, once) costs more than it saves
QUICKER = ("-O1", "-fno-schedule-insns")  # of the compiler; higher levels take twice as long and gain nothing here
OPERATIONS_A_UNIT = 400.0  # of one vector, in a tenth of a microsecond


def map_over_samples(
    function: ca.Function, num_samples: float, shared: Sequence[str] = ()
) -> Callable[..., list[Array]]:
    """The function over samples: takes each input as (entries, S), gives each output as (entries, S), S >= 1.

    function : of dense vectors, in SX.
    num_samples : in all calls to come; for many it pays to compile.
    shared : names of inputs that all samples share, given as (entries,).
    """
    same = tuple(shared)
    if num_samples * function.n_instructions() > COMPILE_FROM and find_compiler() is not None:
        library = _compile_sample_function(function, same)
        if library is not None:
            return _map_by_library(function, same, library)
    return _map_by_casadi(function, same)


def _map_by_casadi(function: ca.Function, shared: tuple[str, ...]) -> Callable[..., list[Array]]:
    """By the virtual machine, sample by sample."""
    repeated = [i for i in range(function.n_in()) if function.name_in(i) in shared]

    def run(*inputs: Array) -> list[Array]:
        count = next(part.shape[1] for i, part in enumerate(inputs) if i not in repeated)
        with hold_interrupts():
            return [np.array(part) for part in _map_serially(function, count, tuple(repeated)).call(list(inputs))]

    return run


@lru_cache(maxsize=64)
def _map_serially(function: ca.Function, count: int, repeated: tuple[int, ...]) -> ca.Function:
    return function.map("on_samples", "serial", count, list(repeated), [])


def _map_by_library(function: ca.Function, shared: tuple[str, ...], library: Any) -> Callable[..., list[Array]]:
    """By a compiled library, a vector of samples at a time."""
    lanes, common = compiler_target().lanes, [function.name_in(i) in shared for i in range(function.n_in())]
    ends = np.cumsum([function.size1_out(i) for i in range(function.n_out())])
    work = function.n_instructions() / OPERATIONS_A_UNIT

    def run(*inputs: Array) -> list[Array]:
        given = list(zip(common, inputs, strict=True))
        count = next(part.shape[1] for same, part in given if not same)
        wide = -(-count // lanes) * lanes
        arrays = [np.ascontiguousarray(part, dtype=float) if same else pad_samples(part, wide) for same, part in given]
        results = np.empty((int(ends[-1]), wide))
        run_tasks(library, (wide,), (*arrays, results), wide // lanes, work)
        return np.split(results[:, :count], ends[:-1])

    return run


@lru_cache(maxsize=32)
def _compile_sample_function(function: ca.Function, shared: tuple[str, ...]) -> Any:
    """The compiled function `run`; None where it cannot be compiled, which is logged once."""
    try:
        return compile_source(_sample_source(function, shared), QUICKER)
    except (NoLibrary, ValueError) as error:
        note_interpretation(function.name(), str(error))
    return None


def _sample_source(function: ca.Function, shared: tuple[str, ...]) -> str:
    """C of the function; inputs are `in0`, `in1`, ... in their order."""
    names = [f"in{i}" for i in range(function.n_in())]
    inputs = [ca.SX.sym(name, function.size1_in(i)) for i, name in enumerate(names)]
    column = ca.vertcat(*(ca.densify(part) for part in function.call(inputs)))
    printed = print_function(ca.Function("f", inputs, [column], names, ["out"], {"cse": True}), (), C)
    loads = []
    for i, name in enumerate(names):
        same = function.name_in(i) in shared
        read = f"K(all_{name}[i])" if same else f"*(const U *)(all_{name} + i * stride + number * W)"
        loads.append(f"V {name}[{max(1, function.size1_in(i))}];")
        loads.append(f"for (long i = 0; i < {function.size1_in(i)}; ++i) {name}[i] = {read};")
    stores = [f"*(U *)(results + {i} * stride + number * W) = {text};" for i, text in enumerate(printed.outputs)]
    arrays = {f"all_{name}": "const REAL" for name in names} | {"results": "REAL"}
    return vector_source(compiler_target()) + threaded_source(
        ("stride",), arrays, "\n".join([*loads, *printed.lines[0], *stores])
    )
