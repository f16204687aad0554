"""A function on many samples: C and the virtual machine agree on every number, also on what is none."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from shipid.engine import native, samples
from shipid.engine.libraries import NoLibrary
from shipid.engine.native import find_compiler
from shipid.engine.samples import map_over_samples


@pytest.fixture(autouse=True)
def own_cache(libraries_kept: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("XDG_CACHE_HOME", str(libraries_kept))
    monkeypatch.setattr(native, "_refused", [])
    monkeypatch.setattr(native, "_interpreted", set())
    samples._compile_sample_function.cache_clear()
    yield
    samples._compile_sample_function.cache_clear()


def function() -> ca.Function:
    """Outputs of unlike sizes, an input that is not used, a choice by what is a number."""
    x, y, p, unused = ca.SX.sym("x", 3), ca.SX.sym("y", 2), ca.SX.sym("p", 2), ca.SX.sym("unused", 1)
    given = ca.fabs(y[0]) < np.inf
    one = ca.vertcat(ca.sin(x[0]) * p[0], x[1] / p[1] + ca.if_else(given, y[0], 7.0), ca.exp(-ca.fabs(x[2])))
    return ca.Function("f", [x, y, p, unused], [one, ca.atan2(y[1], x[0])], ["x", "y", "p", "number"], ["one", "two"])


def inputs(count: int, seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(3, count)), rng.normal(size=(2, count))
    y[0, ::3] = np.nan
    return [x, y, rng.uniform(1, 2, 2), np.zeros((1, count))]


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
@pytest.mark.parametrize("count", [1, 7, 8, 33])
def test_c_and_the_virtual_machine_agree(count: int) -> None:
    made = function()
    few, many = (map_over_samples(made, n, ["p"]) for n in (1, 1e12))
    assert samples._compile_sample_function(made, ("p",)) is not None
    for one, other in zip(few(*inputs(count)), many(*inputs(count)), strict=True):
        assert one.shape == other.shape
        np.testing.assert_allclose(other, one, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(many(*inputs(count))[0][1, 0], inputs(count)[0][1, 0] / inputs(count)[2][1] + 7.0)


def test_without_a_compiler_it_is_interpreted(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def none(*_: object) -> None:
        raise NoLibrary("the C compiler failed")

    monkeypatch.setattr(samples, "find_compiler", lambda: "gcc")
    monkeypatch.setattr(samples, "compile_source", none)
    made = function()
    with caplog.at_level("WARNING"):
        run = map_over_samples(made, 1e12, ["p"])
        map_over_samples(made, 1e12, ["p"])
    assert [record.getMessage() for record in caplog.records] == ["f is not compiled (the C compiler failed): slower"]
    assert native.engine_description().endswith((", f by CasADi", "casadi"))  # other digits than those of C
    for one, other in zip(run(*inputs(5)), map_over_samples(made, 1, ["p"])(*inputs(5)), strict=True):
        np.testing.assert_array_equal(one, other)
    assert native._refused == []  # rollouts keep their engine
