"""The functions on vectors: close to the true value, odd and even to the bit, and no number where there is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from shipid.engine import native
from shipid.engine.native import address, compiled, compiler, longs, target
from shipid.engine.vectors import Target, head

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine")

FUNCTIONS: dict[str, Callable[..., Any]] = {"sin": np.sin, "cos": np.cos, "tanh": np.tanh, "atan2": np.arctan2}
WORST = 4.0  # units in the last place
Array = np.ndarray[Any, Any]


def vectors() -> list[Target]:
    """The widest vectors of this processor with every way to its functions, and half as wide ones."""
    widest = target()
    if not widest.fused:
        return [widest]
    narrow = [Target(4, ("-march=native",), fused=True)] if widest.lanes > 4 else []
    return [widest, replace(widest, fused=False), replace(widest, fused=False, prefix=""), *narrow]


@pytest.fixture(params=vectors(), ids=lambda t: f"{t.lanes}{'-fused' * t.fused}{'-glibc' * bool(t.prefix)}")
def call(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Array]:
    """Call a function by its name on arrays of one length."""
    wanted: Target = request.param
    monkeypatch.setattr(native, "target", lambda: wanted)

    def called(name: str, *arguments: Array) -> Array:
        places = ", ".join(f"a[{k} * n + i]" for k in range(len(arguments)))
        source = f"{head(wanted)}\nvoid run(long n, const U *a, U *out) {{"
        source += f" for (long i = 0; i < n; ++i) out[i] = v_{name}({places}); }}"
        size = len(arguments[0])
        groups = -(-size // wanted.lanes)
        given = np.zeros((len(arguments), groups * wanted.lanes))
        given[:, :size] = arguments
        out = np.empty(groups * wanted.lanes)
        compiled(source)(*longs(groups), address(given), address(out))
        return out[:size]

    return called


def arguments(name: str) -> tuple[Array, ...]:
    """Arguments of all sizes; for the sine and cosine also close to multiples of a quarter of a turn."""
    rng = np.random.default_rng(0)
    near = rng.uniform(-10, 10, 4000)
    if name == "tanh":
        return (np.concatenate([near, 10 ** rng.uniform(-300, 3, 4000) * rng.choice([-1, 1], 4000)]),)
    if name == "atan2":
        sizes = 10 ** rng.uniform(-150, 150, (2, 4000)) * rng.choice([-1, 1], (2, 4000))
        return tuple(np.concatenate([rng.normal(size=(2, 4000)), sizes], axis=1))
    quarters = rng.integers(-60000, 60000, 4000) * (np.pi / 2)
    return (np.concatenate([near, rng.uniform(-1e9, 1e9, 4000), quarters]),)


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 63, reason="no number with more digits here")
@pytest.mark.parametrize("name", FUNCTIONS)
def test_close_to_the_true_value(name: str, call: Callable[..., Array]) -> None:
    given = arguments(name)
    true = FUNCTIONS[name](*(values.astype(np.longdouble) for values in given))
    error = np.abs(call(name, *given) - true) / np.spacing(np.abs(true.astype(float)))
    assert error.max() <= WORST


@pytest.mark.parametrize("name", FUNCTIONS)
def test_odd_and_even_to_the_bit(name: str, call: Callable[..., Array]) -> None:
    """A ship and its mirror image stay mirror images; glibc's cosine of -x may differ from that of x."""
    if not native.target().fused:
        pytest.skip("the functions of a library")
    first, *others = arguments(name)
    mirrored = call(name, -first, *others)
    assert np.array_equal(mirrored, call(name, first, *others) * (1 if name == "cos" else -1))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_what_is_no_number_gives_none(name: str, call: Callable[..., Array]) -> None:
    special = np.array([0.0, -0.0, np.nan, 1.0, -1.0, 1e-310])
    given = [np.array(values) for values in zip(*product(special, repeat=2), strict=True)]
    given = given if name == "atan2" else given[:1]
    wanted = FUNCTIONS[name](*given)
    got = call(name, *given)
    plain = np.all(np.abs(given) != 1e-310, axis=0)  # of two numbers that small no quotient is promised
    assert np.array_equal(np.isnan(got), np.isnan(wanted))
    assert np.allclose(got[plain], wanted[plain], rtol=1e-15, atol=0, equal_nan=True)
    signed = plain & ~np.isnan(wanted) & (wanted != 0 if name == "sin" else True)
    assert np.array_equal(np.signbit(got[signed]), np.signbit(wanted[signed]))


def test_tanh_ends_at_one(call: Callable[..., Array]) -> None:
    assert call("tanh", np.array([np.inf, -np.inf, 1e9, -1e9])).tolist() == [1, -1, 1, -1]
