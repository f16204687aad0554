"""Rollouts on one core beside the strongest peers: `torch.compile`, JAX, CasADi's generated C, and a step by hand.

All take the equations of the 28.9 m Gunnerus and give the final states. PyTorch and JAX get them in the stages of our
engines, numbers of one vessel as constants, JAX those of a family, too. Times are of the processor, so that other
processes may take turns. A ratio is the median of the rounds; in each all ways run in turn.
"""

from __future__ import annotations

import importlib.util
import os
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import torch

from shipid.engine.printing import STAGES, print_function
from shipid.engine.rollout import rollout
from shipid.engine.torch import PYTORCH
from shipid.vessel.dynamics import Dynamics, vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.benchmarks.by_hand import roll_out_by_hand
from tests.benchmarks.rollouts import FAMILY, FLAGS, SAMPLES, STEPS, inputs, variants

ROUNDS, LEAST = 5, 0.1  # s of a way in a round
Way = Callable[[], Any]


def run() -> dict[str, Any]:
    """Million steps per second and ratios of each precision, for one vessel and a family; versions of the peers."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    torch.set_num_threads(1)
    vessel = load_vessel("gunnerus-28.9")
    figures: dict[str, Any] = {"torch": torch.__version__, "casadi": ca.__version__}
    if importlib.util.find_spec("jax"):
        import jax

        jax.config.update("jax_enable_x64", True)
        figures["jax"] = jax.__version__
    for precision, engine in (("float64", "native"), ("float32", "single")):
        for members in (1, FAMILY):
            figures |= _compared(vessel, precision, engine, members, "jax" in figures)
    return figures


def _compared(vessel: Vessel, precision: str, engine: str, members: int, with_jax: bool) -> dict[str, Any]:
    """Figures of one precision and number of members; every way must agree with the native engine."""
    values = variants(vessel, FAMILY) if members > 1 else np.array([list(vessel.parameters.values())])
    given = inputs(SAMPLES)

    def ours(engine: str) -> np.ndarray:
        paths = rollout(vessel, *given, step=1.0, num_steps=STEPS, every=STEPS, parameters=values, engine=engine)
        return paths.states[-1].transpose(2, 0, 1)

    arrays = [np.stack(list(part.values())) for part in given]
    ways: dict[str, Way] = {
        engine: lambda: ours(engine),
        "torch.compile": _torch_way(vessel, arrays, values, getattr(torch, precision)),
        "by hand": roll_out_by_hand(vessel, arrays, values, precision, STEPS),
    }
    if with_jax:
        ways["jax"] = _jax_way(vessel, arrays, values, precision)
    if precision == "float64":
        ways["casadi"] = _casadi_way(vessel, arrays, values)
    expected = ours("native")
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    for name, way in ways.items():
        worst = float((np.abs(np.asarray(way()) - expected) / size).max())
        assert worst < {"float64": 1e-12, "float32": 1e-3}[precision], f"{name}: {worst}"
    rounds = [{name: _seconds(way) for name, way in ways.items()} for _ in range(ROUNDS)]
    label, figures = f"{precision}, {members}", dict[str, Any]()
    for name in ways:
        seconds = [each[name] for each in rounds]
        figures[f"{label}: {name} [million steps/s]"] = SAMPLES * STEPS * members / 1e6 / statistics.median(seconds)
        if name != engine:
            ratios = [each[name] / each[engine] for each in rounds]
            spread = f"{min(ratios):.2f} to {max(ratios):.2f}"
            figures[f"{label}: {engine} / {name}"] = f"{statistics.median(ratios):.2f} ({spread})"
        print(*list(figures.items())[-2:], file=sys.stderr)
    return figures


def _seconds(way: Way) -> float:
    """Processor time of a call, from as many as take `LEAST`."""
    begun, calls = time.process_time(), 0
    while time.process_time() - begun < LEAST:
        way()
        calls += 1
    return (time.process_time() - begun) / calls


def _lower_stages(model: Dynamics, space: dict[str, Any]) -> list[Callable[..., list[Any]]]:
    """The rates of a model in stages, in the names of PyTorch, that `space` may take elsewhere."""
    printed, stages = print_function(model.rates, STAGES, PYTORCH), []
    for number, lines in enumerate(printed.lines):
        arguments = ", ".join([*printed.inputs(number), *(f"s{earlier}" for earlier in range(number))])
        end = printed.outputs if number == len(STAGES) else printed.saved[number]
        known = dict(space)
        exec("\n".join([f"def stage({arguments}):", *lines, f"    return [{', '.join(end)}]"]), known)
        stages.append(known["stage"])
    return stages


def _torch_way(vessel: Vessel, arrays: list[np.ndarray], values: np.ndarray, dtype: torch.dtype) -> Way:
    """A compiled step, called in a loop: whole rollouts compile for minutes."""

    def as_tensor(value: Any) -> torch.Tensor:
        return torch.as_tensor(value, dtype=dtype)

    model = vessel_dynamics(vessel)
    space = {
        "torch": torch,
        "_atan2": torch.atan2,
        "_minimum": lambda a, b: torch.minimum(as_tensor(a), as_tensor(b)),
        "_maximum": lambda a, b: torch.maximum(as_tensor(a), as_tensor(b)),
        "_where": lambda truth, value: torch.where(truth != 0, as_tensor(value), as_tensor(0.0)),
        "_number": lambda truth: truth.to(dtype),
    }
    first, second, main = _lower_stages(model, space)
    state, commands, wind = (torch.tensor(part, dtype=dtype)[:, None] for part in arrays)
    shape = (len(values), state.shape[-1])
    known: Any = first(torch.tensor(values.T[..., None], dtype=dtype))
    known = (
        [float(one) for one in known] if len(values) == 1 else torch.stack([one.expand(shape[0], 1) for one in known])
    )

    @torch.compile(dynamic=False)
    def step(x: torch.Tensor, known: Any, held: torch.Tensor) -> torch.Tensor:
        return x + torch.stack([torch.broadcast_to(one, x.shape[1:]) for one in main(x, [], [0.0] * 3, known, held)])

    def roll_out() -> torch.Tensor:
        with torch.no_grad():
            held = torch.stack([as_tensor(one).expand(shape) for one in second(commands, wind, known)])
            x = state.expand(-1, *shape).contiguous()
            for _ in range(STEPS):
                x = step(x, known, held)
        return x

    return roll_out


def _jax_way(vessel: Vessel, arrays: list[np.ndarray], values: np.ndarray, precision: str) -> Way:
    """One sample as a scan over the steps, mapped over samples and members, and compiled as a whole."""
    import jax
    import jax.numpy as jnp

    space = {
        "torch": jnp,
        "_atan2": jnp.arctan2,
        "_minimum": jnp.minimum,
        "_maximum": jnp.maximum,
        "_where": lambda truth, value: jnp.where(truth != 0, value, 0.0),
        "_number": lambda truth: truth.astype(precision),
    }
    first, second, main = _lower_stages(vessel_dynamics(vessel), space)

    def roll_out(known: Any, x: Any, commands: Any, wind: Any) -> Any:
        held = second(commands, wind, known)
        return jax.lax.scan(lambda x, _: (x + jnp.stack(main(x, [], [0.0] * 3, known, held)), None), x, length=STEPS)[0]

    known = [np.asarray(one) for one in first(jnp.asarray(values.T.astype(precision)))]
    inputs_ = [jnp.asarray(part.astype(precision)) for part in arrays]
    samples = jax.vmap(roll_out, (None, 1, 1, 1), 1)
    if len(values) == 1:
        compiled = jax.jit(lambda *given: samples([one.item() for one in known], *given)[:, None])
    else:
        compiled = jax.jit(lambda *given: jax.vmap(samples, (0, None, None, None), 1)(known, *given))
    return lambda: compiled(*inputs_).block_until_ready()


def _casadi_way(vessel: Vessel, arrays: list[np.ndarray], values: np.ndarray) -> Way:
    """As a user of CasADi writes it: `mapaccum` over steps, generated C, `map` over samples, members in a loop."""
    model = vessel_dynamics(vessel)
    x, c, e = ca.SX.sym("x", 6), ca.SX.sym("c", 4), ca.SX.sym("e", 2)
    alone = len(values) == 1
    p = ca.SX.sym("p", 0 if alone else values.shape[1])
    numbers = ca.SX(values[0]) if alone else p
    one = ca.Function("step", [x, c, e, p], [x + model.rates(x, ca.SX(0, 1), c, e, numbers, ca.SX.zeros(3))])
    given = [ca.MX.sym(name, one.size1_in(i)) for i, name in enumerate("xcep")]
    path = one.mapaccum(STEPS)(given[0], *(ca.repmat(part, 1, STEPS) for part in given[1:]))
    jit = {"jit": True, "compiler": "shell", "jit_options": {"compiler": "gcc", "flags": FLAGS["O3"]}}
    mapped = ca.Function("last", given, [path[:, -1]], jit).map("samples", "serial", SAMPLES, [3], [])
    return lambda: np.stack([np.array(mapped(*arrays, row[: p.numel()])) for row in values], axis=1)
