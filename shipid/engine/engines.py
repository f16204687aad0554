"""The engines by name, with their abilities. To add one: write its file, and name it here.

An engine runs a job on a batch. Some engines can also compute distances during the rollout, or derivatives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from shipid.arguments import check_choice
from shipid.engine.adjoint import Adjoint, Loss, gradient_native
from shipid.engine.casadi import run_casadi
from shipid.engine.integrate import Array, RolloutBatch, RolloutJob
from shipid.engine.libraries import NoLibrary
from shipid.engine.native import find_compiler, measure_native, refuse_compiling, run_native
from shipid.engine.vectors import SINGLE
from shipid.errors import ShipidError
from shipid.vessel.dynamics import Dynamics

AUTO, REPEATED = "auto", "repeated"  # `repeated`: as `auto`, where so many calls follow that compiling pays
Result = TypeVar("Result")
COMPONENTS_A_STEP = 4  # drawn components that take as long as all the rest of a step
NATIVE_FROM = 2e5  # rate evaluations: below it compiling C (half a second, once) costs more than it saves
BATCH_FROM = 2048  # samples x variants: below it CasADi beats one tensor operation an instruction


@dataclass(frozen=True)
class Engine:
    """An implementation of rollouts.

    run : (model, batch, job) -> records (R, V, S, C) and the greatest speed (V, S) [m/s, rad/s].
    preferred : whether `auto` selects it, if none before it, for so many evaluations of the right-hand side, samples x
        variants, and a PyTorch device.
    available : whether it can run on this machine.
    measure : (model, batch, job, goal (T, 2, S)) -> sum of distances (V, S) of the job's two channels to the goal,
        tally (V, BINS) and greatest speed (V, S). None if it cannot.
    gradient : (model, batch of one variant, job, places of the wanted parameters, loss) -> Adjoint. None if it cannot.
    any_device : whether it runs on every PyTorch device, not on the CPU alone.
    checks : whether the greatest speed is no number wherever an input is none.
    """

    run: Callable[[Dynamics, RolloutBatch, RolloutJob], tuple[Array, Array]]
    preferred: Callable[[float, int, str], bool] = lambda *_: False
    available: Callable[[], bool] = lambda: True
    measure: Callable[[Dynamics, RolloutBatch, RolloutJob, Array], tuple[Array, Array, Array]] | None = None
    gradient: Callable[[Dynamics, RolloutBatch, RolloutJob, tuple[int, ...], Loss], Adjoint] | None = None
    any_device: bool = False
    checks: bool = False


def _run_eager(model: Dynamics, batch: RolloutBatch, job: RolloutJob) -> tuple[Array, Array]:
    from shipid.engine.torch import run_torch  # PyTorch takes a second to import

    return run_torch(model, batch, job)


def _torch_gradient(
    model: Dynamics, batch: RolloutBatch, job: RolloutJob, wanted: tuple[int, ...], loss: Loss
) -> Adjoint:
    from shipid.engine.torch import gradient_torch

    return gradient_torch(model, batch, job, wanted, loss)


ENGINES: dict[str, Engine] = {  # in the order in which `auto` asks them
    "native": Engine(
        run_native,
        preferred=lambda work, _, device: device == "cpu" and work > NATIVE_FROM,
        available=lambda: find_compiler() is not None,
        measure=measure_native,
        gradient=gradient_native,
        checks=True,
    ),
    "single": Engine(
        partial(run_native, precision=SINGLE),
        available=lambda: find_compiler() is not None,
        measure=partial(measure_native, precision=SINGLE),
        checks=True,
    ),
    "casadi": Engine(run_casadi, preferred=lambda _, width, device: device == "cpu" and width < BATCH_FROM),
    "torch": Engine(_run_eager, preferred=lambda *_: True, gradient=_torch_gradient, any_device=True),
}


def check_device(device: str) -> None:
    """Raise ShipidError unless PyTorch can compute on the device, such as `cpu` or `cuda:0`."""
    if device != "cpu":
        from shipid.engine.torch import check_torch_device

        check_torch_device(device)


def engine_by_name(name: str, device: str) -> Engine | None:
    """The engine with a name; None for `auto`, `repeated`. ShipidError for an unknown name or an unsupported device."""
    check_choice("engine", name, (AUTO, *ENGINES, REPEATED))
    engine = ENGINES.get(name)
    if device != "cpu" and engine is not None and not engine.any_device:
        raise ShipidError(f"engine {name!r} runs on the CPU: use 'torch' on {device!r}")
    check_device(device)
    return engine


def choose_engine(batch: RolloutBatch, job: RolloutJob, repeated: bool = False) -> Engine:
    """The engine that `auto` selects for a rollout, by its size and the available engines; or that `repeated` does."""
    weight = 1 + sum(drawn.shape[2] for drawn in batch.components) / COMPONENTS_A_STEP
    width = batch.state.shape[1] * len(batch.parameters)
    work = job.num_steps * width * (4 if job.method == "rk4" else 1) * weight
    work = max(work, 2 * NATIVE_FROM) if repeated else work
    return next(one for one in ENGINES.values() if one.preferred(work, width, job.device) and one.available())


def run_with_fallback(asked: Engine | None, choose: Callable[[], Engine], work: Callable[[Engine], Result]) -> Result:
    """Result of the engine that was asked for; else of the chosen one, or of another where it cannot compile here."""
    if asked is not None:
        return work(asked)
    try:
        return work(choose())
    except NoLibrary as error:
        refuse_compiling(error.message)
        return work(choose())


def choose_gradient_engine(name: str, device: str) -> Callable[[], Engine]:
    """Give the engine with a name, for gradients; for `auto` the first available. ShipidError if it has no gradient."""
    engine = engine_by_name(name, device)
    able = {key: entry for key, entry in ENGINES.items() if entry.gradient is not None}
    if engine is None:
        fit = [entry for entry in able.values() if device == "cpu" or entry.any_device]
        return lambda: next(entry for entry in fit if entry.available())
    if engine.gradient is None:
        raise ShipidError(f"engine {name!r} has no gradient: use {' or '.join(map(repr, able))}")
    return lambda: engine
