"""A function of vectors on many samples at once: as C on SIMD vectors and threads, or by CasADi's virtual machine.

For long functions without a loop, such as one step of the observer: every sample is a column, and none sees another.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from shipid.engine.integrate import Array
from shipid.engine.libraries import NoLibrary
from shipid.engine.native import C, compiled_for, compiler, padded, refuse, target
from shipid.engine.printing import print_function
from shipid.engine.threads import in_parallel, threaded
from shipid.engine.vectors import head
from shipid.interrupts import uninterrupted

NATIVE_FROM = 1e9  # operations: below it compiling C (some seconds, once) costs more than it saves
OPTIONS = ("-O1", "-fno-schedule-insns")  # higher levels take twice as long and gain nothing without loops
A_MICROSECOND = 4e3  # operations of one vector, or so

OnSamples = Callable[..., list[Array]]


def on_samples(function: ca.Function, num_samples: float, shared: Sequence[str] = ()) -> OnSamples:
    """The function over samples: takes each input as (entries, S), gives each output as (entries, S).

    Parameters
    ----------
    function : of dense vectors, in SX.
    num_samples : in all calls to come; many are worth a compiler.
    shared : names of inputs that all samples share, given as (entries,).
    """
    same = tuple(shared)
    if num_samples * function.n_instructions() > NATIVE_FROM and compiler() is not None:
        try:
            return _native(function, same)
        except NoLibrary as error:
            refuse(error.message)
    return _interpreted(function, same)


def _interpreted(function: ca.Function, shared: tuple[str, ...]) -> OnSamples:
    """By the virtual machine, sample by sample."""
    repeated = [i for i in range(function.n_in()) if function.name_in(i) in shared]

    def run(*inputs: Array) -> list[Array]:
        count = next(part.shape[1] for i, part in enumerate(inputs) if i not in repeated)
        with uninterrupted():
            return [np.array(part) for part in _mapped(function, count, tuple(repeated)).call(list(inputs))]

    return run


@lru_cache(maxsize=64)
def _mapped(function: ca.Function, count: int, repeated: tuple[int, ...]) -> ca.Function:
    return function.map("on_samples", "serial", count, list(repeated), [])


def _native(function: ca.Function, shared: tuple[str, ...]) -> OnSamples:
    """By a compiled library, a vector of samples at a time; NoLibrary if it cannot be compiled."""
    library, lanes = _library(function, shared), target().lanes
    ends = np.cumsum([function.size1_out(i) for i in range(function.n_out())])
    work = 10 * function.n_instructions() / A_MICROSECOND

    def run(*inputs: Array) -> list[Array]:
        given = list(zip((function.name_in(i) for i in range(function.n_in())), inputs, strict=True))
        count = next(part.shape[1] for name, part in given if name not in shared)
        wide = -(-count // lanes) * lanes
        arrays = [np.ascontiguousarray(a, dtype=float) if name in shared else padded(a, wide) for name, a in given]
        results = np.empty((int(ends[-1]), wide))
        in_parallel(library, (wide,), (*arrays, results), wide // lanes, work)
        return np.split(results[:, :count], ends[:-1])

    return run


@lru_cache(maxsize=32)
def _library(function: ca.Function, shared: tuple[str, ...]) -> Any:
    return compiled_for(lambda: _source(function, shared), OPTIONS)


def _source(function: ca.Function, shared: tuple[str, ...]) -> str:
    """C of the function."""
    names = [function.name_in(i) for i in range(function.n_in())]
    inputs = [ca.SX.sym(name, function.size1_in(i)) for i, name in enumerate(names)]
    column = ca.vertcat(*(ca.densify(part) for part in function.call(inputs)))
    printed = print_function(ca.Function("f", inputs, [column], names, ["out"], {"cse": True}), (), C)
    loads = []
    for i, name in enumerate(names):
        read = f"K({name}_[i])" if name in shared else f"*(const U *)({name}_ + i * stride + number * W)"
        loads.append(f"V {name}[{function.size1_in(i)}];")
        loads.append(f"for (long i = 0; i < {function.size1_in(i)}; ++i) {name}[i] = {read};")
    stores = [f"*(U *)(results + {i} * stride + number * W) = {text};" for i, text in enumerate(printed.outputs)]
    arrays = {f"{name}_": "const REAL" for name in names} | {"results": "REAL"}
    task = "\n".join([*loads, *printed.lines[0], *stores])
    return head(target()) + threaded(("stride",), arrays, task)
