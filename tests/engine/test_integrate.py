"""The integrator: order of accuracy of Euler and RK4, and exact memories."""

from __future__ import annotations

import math

import pytest

from shipid.engine.integrate import count_threads, integrate_step


def end(method: str, num_steps: int) -> float:
    """x(1) of x' = -x m, m' = 0 with m = 1 and x(0) = 1: exp(-1)."""
    x, m = 1.0, 1.0
    for _ in range(num_steps):
        x, m = integrate_step(
            lambda x, m: -x * m, lambda m, _dt: m, lambda x, a, k: x + a * k, x, m, 1 / num_steps, method
        )  # type: ignore[arg-type]
    return x


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("rk4", 4)])
def test_the_error_falls_with_the_order_of_the_method(method: str, order: int) -> None:
    coarse, fine = (abs(end(method, num_steps) - math.exp(-1)) for num_steps in (10, 20))
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.15)


def test_stages_of_rk4_use_the_memory_at_their_time() -> None:
    """x' = m with m = exp(t), advanced exactly: Simpson's rule for the integral of exp."""
    x, m = integrate_step(
        lambda _x, m: m, lambda m, dt: m * math.exp(dt), lambda x, a, k: x + a * k, 0.0, 1.0, 1.0, "rk4"
    )
    assert m == pytest.approx(math.e)
    assert x == pytest.approx((1 + 4 * math.exp(0.5) + math.e) / 6)


def test_cores_respect_the_thread_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert count_threads() == 1
    monkeypatch.setenv("OMP_NUM_THREADS", "none")
    assert count_threads() >= 1
