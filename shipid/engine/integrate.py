"""The integrator, written once for all engines, and the batch and job that are their inputs."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from shipid.arguments import check_choice, check_positive
from shipid.capacity import usable_cores

Array = np.ndarray
Method = Literal["euler", "rk4"]


@dataclass(frozen=True)
class RolloutBatch:
    """Inputs of a rollout as plain arrays, channel first: the layout that all engines share.

    state (nx, S), memory (nm, S), commands (T, nc, S), environment (T, ne, S), tau_extra (T, n_dof, S) with T = 1 when
    held over the horizon, parameters (V, P). state holds the hidden states of terms after eta and nu; components holds,
    for each sum whose components are drawn, (num_entries, S, num_components).
    """

    state: Array
    memory: Array
    commands: Array
    environment: Array
    tau_extra: Array
    parameters: Array
    components: tuple[Array, ...] = ()


@dataclass(frozen=True)
class RolloutJob:
    """Settings of a rollout.

    step : seconds of one step. num_steps : steps of the rollout. every : steps from record to record.
    rows : channels to record, as places in state and memory, one after the other. device : a PyTorch device.
    """

    step: float
    num_steps: int
    method: Method
    every: int
    rows: tuple[int, ...]
    device: str = "cpu"

    def __post_init__(self) -> None:
        check_choice("method", self.method, get_args(Method))
        object.__setattr__(self, "step", check_positive("step", self.step))  # engines write it into their code


def count_threads() -> int:
    """Number of threads of a rollout: of the cores that this process may use, at most `OMP_NUM_THREADS`."""
    count = usable_cores()
    limit = os.environ.get("OMP_NUM_THREADS", "")
    return min(count, int(limit)) if limit.isdecimal() and int(limit) > 0 else count


def integrate_step(
    rates: Callable[[Any, Any], Any],
    advance: Callable[[Any, float], Any],
    add: Callable[[Any, float, Any], Any],
    state: Any,
    memory: Any,
    step: float,
    method: Method,
) -> tuple[Any, Any]:
    """One step of explicit Euler or classical RK4; `add(x, a, k)` is x + a k in the arithmetic at hand.

    Memories advance exactly. Each stage of RK4 uses them at the time of the stage, so RK4 keeps its order of accuracy
    for constant commands.
    """
    if method == "euler":
        return add(state, step, rates(state, memory)), advance(memory, step)
    half, full = advance(memory, step / 2), advance(memory, step)
    k1 = rates(state, memory)
    k2 = rates(add(state, step / 2, k1), half)
    k3 = rates(add(state, step / 2, k2), half)
    k4 = rates(add(state, step, k3), full)
    for weight, slope in ((1, k1), (2, k2), (2, k3), (1, k4)):
        state = add(state, step * weight / 6, slope)
    return state, full
