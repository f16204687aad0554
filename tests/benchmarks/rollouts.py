"""Rollout throughput of set A in float64: native, eager, CasADi with threads, and NumPy by hand.

CasADi and NumPy are used as a user would who has one ship: its numbers are written into the equations.
All deliver the final states. `native_paths` delivers the states after every step, `native_family_paths` the positions:
their difference is the time of the system for new memory.
"""

from __future__ import annotations

import tempfile
import time
from typing import Any

import casadi as ca
import numpy as np
import pytest

from shipid.engine.rollout import rollout
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.benchmarks.by_numpy import Fleet
from tests.benchmarks.timing import best_of

SAMPLES, STEPS, FAMILY = 6016, 30, 16
FLAGS = {"O2": ["-O2"], "O3": ["-O3", "-march=native"], "Ofast": ["-Ofast", "-march=native"]}  # of generated C


def run() -> dict[str, Any]:
    """Million steps per second of each way, ratios to CasADi's VM and generated C, and the time to compile."""
    vessel = load_vessel("gunnerus-28.9")
    start, commands, environment = inputs(SAMPLES)
    family = variants(vessel, FAMILY)

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
    arrays = [np.stack(list(part.values())) for part in (start, commands, environment)]
    fleet = Fleet(vessel)
    ways = {
        "casadi_vm": _casadi(*arrays, {}),
        **{f"casadi_{name}": _casadi(*arrays, _jit(flags)) for name, flags in FLAGS.items()},
        "numpy": lambda: fleet.roll_out(*arrays, 1.0, STEPS),
        "eager": lambda: lowered("torch"),
        "native": lambda: lowered("native"),
        "native_paths": lambda: lowered("native", every=1),
        "native_family": lambda: lowered("native", family),
        "native_family_paths": lambda: lowered("native", family, ("north", "east"), every=1),
    }
    for rival in ("casadi_vm", "casadi_O3", "numpy"):
        assert np.allclose(ways[rival](), reference.states[-1, 0].T, rtol=1e-9, atol=1e-9)
    seconds = best_of(ways, rounds=9, settled=True)  # PyTorch's threads wait actively for some ms
    seconds["casadi_jit"] = min(seconds.pop(f"casadi_{name}") for name in FLAGS)
    work = {name: SAMPLES * STEPS * (FAMILY if "family" in name else 1) / 1e6 for name in seconds}
    speed = {name: work[name] / seconds[name] for name in seconds}
    return {
        **{f"{name} [million steps/s]": round(value, 2) for name, value in speed.items()},
        **{
            f"{ours} / {rival}": round(speed[ours] / speed[rival], 1)
            for ours in ("native", "native_family")
            for rival in ("casadi_vm", "casadi_jit", "numpy")
        },
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


def variants(vessel: Vessel, count: int) -> np.ndarray:
    """Values (count, num_values) within 20 % of the vessel's; angles of a table are no accuracy and stay."""
    values = np.array(list(vessel.parameters.values()))
    fixed = (values == 0) | ["gamma_deg" in name for name in vessel.parameters]
    return values * np.where(fixed, 1, np.random.default_rng(1).uniform(0.8, 1.2, (count, len(values))))


def _jit(flags: list[str]) -> dict[str, Any]:
    return {"jit": True, "compiler": "shell", "jit_options": {"compiler": "gcc", "flags": flags}}


def _casadi(state: np.ndarray, commands: np.ndarray, environment: np.ndarray, options: dict[str, Any]) -> Any:
    """As a user of CasADi writes it for one ship: numbers in the equations, mapaccum over steps, two threads."""
    vessel = load_vessel("gunnerus-28.9")
    model = vessel_dynamics(vessel)
    x, c, e = ca.SX.sym("x", 6), ca.SX.sym("c", 4), ca.SX.sym("e", 2)
    rates = model.rates(x, ca.SX(0, 1), c, e, ca.SX(list(vessel.parameters.values())), ca.SX.zeros(3))
    one = ca.Function("step", [x, c, e], [x + rates])
    start, held, wind = ca.MX.sym("x", 6), ca.MX.sym("c", 4), ca.MX.sym("e", 2)
    path = one.mapaccum(STEPS)(start, ca.repmat(held, 1, STEPS), ca.repmat(wind, 1, STEPS))
    last = ca.Function("last", [start, held, wind], [path[:, -1]], options)
    mapped = last.map(SAMPLES // 2).map(2, "thread")
    return lambda: np.array(mapped(state, commands, environment))
