"""Rollout throughput of set A in float64: native, eager, and CasADi's own threaded map.

All deliver the final states; `native_paths` delivers the states after every step, `native_family` the positions.
"""

from __future__ import annotations

import tempfile
import time
from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.engine.casadi import casadi_scan
from shipid.engine.rollout import rollout
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import load_vessel
from tests.benchmarks.timing import best_of

SAMPLES, STEPS, FAMILY = 6016, 30, 16
JIT = {"jit": True, "compiler": "shell", "jit_options": {"compiler": "gcc", "flags": ["-O3", "-march=native"]}}


def run() -> dict[str, Any]:
    """Million steps per second of each way, ratios to CasADi's VM and generated C, and the time to compile."""
    vessel = load_vessel("gunnerus-28.9")
    start, commands, environment = inputs(SAMPLES)
    rng = np.random.default_rng(1)
    values = np.array(list(vessel.parameters.values()))
    family = values * np.where(values == 0, 1, rng.uniform(0.8, 1.2, (FAMILY, len(values))))

    def lowered(engine: str, parameters: np.ndarray | None = None, keep: Any = None, every: int = STEPS) -> Any:
        return rollout(
            vessel, start, commands, environment, step=1.0, num_steps=STEPS, every=every,
            parameters=parameters, keep=keep, engine=engine,  # type: ignore[arg-type]
        )  # fmt: skip

    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", folder)
        begun = time.perf_counter()
        reference = lowered("native")
        compile_seconds = time.perf_counter() - begun
    ways = {
        "casadi_vm": _casadi(start, commands, environment, {}),
        "casadi_jit": _casadi(start, commands, environment, JIT),
        "eager": lambda: lowered("torch"),
        "native": lambda: lowered("native"),
        "native_paths": lambda: lowered("native", every=1),
        "native_family": lambda: lowered("native", family, ("north", "east"), every=1),
    }
    assert np.allclose(ways["casadi_vm"](), reference.states[-1, 0].T, rtol=1e-9, atol=1e-9)
    seconds = best_of(ways, rounds=9)
    work = {name: SAMPLES * STEPS * (FAMILY if name == "native_family" else 1) / 1e6 for name in ways}
    speed = {name: work[name] / seconds[name] for name in ways}
    return {
        **{f"{name} [million steps/s]": round(value, 2) for name, value in speed.items()},
        "native / casadi_vm": round(speed["native"] / speed["casadi_vm"], 1),
        "native / casadi_jit": round(speed["native"] / speed["casadi_jit"], 1),
        "native_family / casadi_vm": round(speed["native_family"] / speed["casadi_vm"], 1),
        "native_family / casadi_jit": round(speed["native_family"] / speed["casadi_jit"], 1),
        "compile [s]": round(compile_seconds, 1),
    }


def inputs(num_samples: int) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Random starts, commands and winds within the envelope of the method's Table 1, SI."""
    rng = np.random.default_rng(0)

    def draw(low: float, high: float) -> np.ndarray:
        return rng.uniform(low, high, num_samples)

    zero = np.zeros(num_samples)
    start = {"north": zero, "east": zero, "psi": draw(0, 2 * np.pi), "u": draw(0, 6), "v": draw(-1.1, 1.1)}
    start["r"] = draw(-0.14, 0.14)
    n, alpha = draw(50 / 60, 200 / 60), draw(-0.87, 0.87)
    commands = {"port.n": n, "port.alpha": alpha, "starboard.n": n, "starboard.alpha": alpha}
    return start, commands, {"V_w": draw(0, 6), "beta_w": draw(0, 2 * np.pi)}


def _casadi(start: Any, commands: Any, environment: Any, options: dict[str, Any]) -> Any:
    """CasADi's own way: mapaccum over steps, map over samples on two threads; generated C if the options say so."""
    vessel = load_vessel("gunnerus-28.9")
    model = dynamics(vessel)
    scan = casadi_scan(model, 1.0, STEPS, "euler", 1)
    x, c, e = ca.MX.sym("x", 6), ca.MX.sym("c", 4), ca.MX.sym("e", 2)
    p = ca.MX.sym("p", len(model.parameters))
    path = scan(ca.vertcat(x, 0), ca.repmat(c, 1, STEPS), ca.repmat(e, 1, STEPS), ca.MX.zeros(3, STEPS), p)
    one = ca.Function("one", [x, c, e, p], [path[:6, -1]], options)
    mapped = one.map(SAMPLES // 2).map(2, "thread")
    arrays = [
        np.stack([start[name] for name in model.state]),
        np.stack([commands[name] for name in model.commands]),
        np.stack([environment[name] for name in model.environment]),
        np.tile(np.array(list(vessel.parameters.values()))[:, None], (1, SAMPLES)),
    ]
    return lambda: np.array(mapped(*arrays))
