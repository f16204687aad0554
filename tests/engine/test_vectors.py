"""The functions on vectors, in both precisions: close to the truth, odd and even to the bit, no number from none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from shipid.engine import native
from shipid.engine.native import compile_source, compiler_target, find_compiler
from shipid.engine.threads import run_tasks, threaded_source
from shipid.engine.vectors import SINGLE, CompilerTarget, vector_source

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

FUNCTIONS: dict[str, Callable[..., Any]] = {"sin": np.sin, "cos": np.cos, "tanh": np.tanh, "atan2": np.arctan2}
WORST = 4.0  # units in the last place
Array = np.ndarray[Any, Any]


def _half() -> CompilerTarget:
    return CompilerTarget(4, ("-march=native",), fused=True) if compiler_target().lanes > 4 else compiler_target()


TARGETS: dict[str, Callable[[], CompilerTarget]] = {  # looked at when a test runs, since that takes a compiler
    "widest": compiler_target,
    "glibc": lambda: replace(compiler_target(), fused=False),
    "lane by lane": lambda: replace(compiler_target(), fused=False, prefix=""),
    "half as wide": _half,
    "single": lambda: compiler_target(SINGLE),
    "single, glibc": lambda: replace(compiler_target(SINGLE), fused=False),
}


@pytest.fixture(params=TARGETS)
def wanted(request: pytest.FixtureRequest) -> CompilerTarget:
    """Vectors of this processor, with every way to their functions."""
    return TARGETS[request.param]()


@pytest.fixture
def call(wanted: CompilerTarget, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Array]:
    """Call a function by its name on arrays of one length."""
    monkeypatch.setattr(native, "compiler_target", lambda *_: wanted)

    def called(name: str, *arguments: Array) -> Array:
        places = ", ".join(f"a[{k} * n + i]" for k in range(len(arguments)))
        task = f"for (long i = 0; i < n; ++i) out[i] = v_{name}({places});"
        source = vector_source(wanted) + threaded_source(["n"], {"a": "const U", "out": "U"}, task)
        size = len(arguments[0])
        groups = -(-size // wanted.lanes)
        given = np.zeros((len(arguments), groups * wanted.lanes), wanted.precision.dtype)
        given[:, :size] = arguments
        out = np.empty(groups * wanted.lanes, wanted.precision.dtype)
        run_tasks(compile_source(source), [groups], [given, out], 1, 1.0)
        return out[:size]

    return called


def arguments(name: str, of: CompilerTarget) -> tuple[Array, ...]:
    """Arguments of all sizes; for the sine and cosine also close to multiples of a quarter of a turn."""
    rng = np.random.default_rng(0)
    near = rng.uniform(-10, 10, 4000)
    tiny, wide, far, turns = (-300, 150, 1e9, 60000) if of.precision is not SINGLE else (-37, 15, 1e4, 600)
    if name == "tanh":
        given = [np.concatenate([near, 10 ** rng.uniform(tiny, 3, 4000) * rng.choice([-1, 1], 4000)])]
    elif name == "atan2":
        sizes = 10 ** rng.uniform(-wide, wide, (2, 4000)) * rng.choice([-1, 1], (2, 4000))
        given = list(np.concatenate([rng.normal(size=(2, 4000)), sizes], axis=1))
    else:
        quarters = rng.integers(-turns, turns, 4000) * (np.pi / 2)
        given = [np.concatenate([near, rng.uniform(-far, far, 4000), quarters])]
    return tuple(values.astype(of.precision.dtype) for values in given)


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="no number with more digits here")
@pytest.mark.parametrize("name", FUNCTIONS)
def test_close_to_the_true_value(name: str, wanted: CompilerTarget, call: Callable[..., Array]) -> None:
    given = arguments(name, wanted)
    true = FUNCTIONS[name](*(values.astype(np.longdouble) for values in given))
    error = np.abs(call(name, *given) - true) / np.spacing(np.abs(true.astype(wanted.precision.dtype)))
    assert error.max() <= WORST


@pytest.mark.parametrize("name", FUNCTIONS)
def test_odd_and_even_to_the_bit(name: str, wanted: CompilerTarget, call: Callable[..., Array]) -> None:
    """A ship and its mirror image stay mirror images; glibc's cosine of -x may differ from that of x."""
    if not wanted.fused:
        pytest.skip("the functions of a library")
    first, *others = arguments(name, wanted)
    mirrored = call(name, -first, *others)
    assert np.array_equal(mirrored, call(name, first, *others) * (1 if name == "cos" else -1))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_what_is_no_number_gives_none(name: str, wanted: CompilerTarget, call: Callable[..., Array]) -> None:
    special = np.array([0.0, -0.0, np.nan, 1.0, -1.0])
    given = [np.array(values, wanted.precision.dtype) for values in zip(*product(special, repeat=2), strict=True)]
    given = given if name == "atan2" else given[:1]
    true, got = FUNCTIONS[name](*given), call(name, *given)
    assert np.array_equal(np.isnan(got), np.isnan(true))
    np.testing.assert_array_max_ulp(got, true, WORST)
    signed = ~np.isnan(true) & (true != 0 if name == "sin" else True)
    assert np.array_equal(np.signbit(got[signed]), np.signbit(true[signed]))


def test_tanh_ends_at_one(call: Callable[..., Array]) -> None:
    assert call("tanh", np.array([np.inf, -np.inf, 1e9, -1e9])).tolist() == [1, -1, 1, -1]
