"""Exact gradients of a loss through a rollout, with respect to parameters, to the extra force and to the start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shipid.arguments import check_choice
from shipid.engine.adjoint import Adjoint, Loss
from shipid.engine.engines import AUTO, Engine, choose_gradient_engine, run_with_fallback
from shipid.engine.integrate import Array, Method, RolloutJob
from shipid.engine.rollout import SPEED_LIMIT, channel_names, channel_places, finite_samples, prepare_batch
from shipid.errors import ShipidError
from shipid.vessel.load import Vessel

PATH = ("north", "east")


@dataclass(frozen=True)
class Gradient:
    """A loss of each sample and its derivatives; they are invalid for samples that diverged.

    loss : (S,) in the unit of the loss.
    parameters : (S, K) d(loss)/d(parameter), by `names`; their sum over samples is the gradient of the summed loss.
    tau_extra : (num_steps, S, n_dof) d(loss)/d(extra force during each step) [1/N, 1/(N m)].
    start : state name -> (S,) d(loss)/d(state at the start).
    path : (num_steps + 1, S, C) the kept channels, the start first.
    diverged : (S,) as in `Trajectories`.
    """

    loss: Array
    parameters: Array
    names: tuple[str, ...]
    tau_extra: Array
    start: Mapping[str, Array]
    path: Array
    diverged: Array


def rollout_gradient(
    vessel: Vessel,
    start: Mapping[str, Array],
    commands: Mapping[str, Array],
    environment: Mapping[str, Array] | None,
    loss: Loss,
    *,
    step: float,
    num_steps: int,
    names: Sequence[str] = (),
    keep: Sequence[str] = PATH,
    method: Method = "euler",
    parameters: Array | None = None,
    memory: Mapping[str, Array] | None = None,
    tau_extra: Array | None = None,
    engine: str = "auto",
    device: str = "cpu",
) -> Gradient:
    """Value and exact gradient of a loss on a rollout of many samples by one variant.

    Reverse mode, of the discrete motion: it agrees with finite differences of `rollout` for any step. On a kink, as |v|
    at v = 0, it is finite; where several meet, as at rest, it may be the derivative of neither side.

    start, commands, environment, memory, tau_extra, step, num_steps, method : as in `rollout`.
    loss : path (num_steps + 1, S, C) of the channels `keep` -> (loss (S,), slope d(loss)/d(path), shaped as the path);
        such as `squared_distance_loss(goal)`.
    names : dotted paths of the parameters to differentiate by; ShipidError for one that the vessel does not have.
    keep : states and memories that are the input of the loss.
    parameters : (P,) in the order of `vessel.parameters`; default: those of the vessel.
    engine : `native`, `torch`, or `auto`: native if there is a C compiler.

    The initial memories are constants: they do not depend on parameters. ShipidError for a vessel with terms whose
    components are drawn (waves), unless they are switched off.
    """
    way = choose_gradient_engine(engine, device)
    if num_steps < 1:
        raise ShipidError(f"num_steps must be 1 or more, not {num_steps}")
    values = None if parameters is None else np.asarray(parameters, dtype=float).reshape(1, -1)
    weather = environment or {}
    model, batch = prepare_batch(vessel, start, commands, weather, {}, num_steps, values, memory, tau_extra, None)
    if model.drawn:
        raise ShipidError(f"{model.drawn[0].path} draws its components and has no gradient: switch it off")
    for name in names:
        check_choice(f"parameter of {vessel.name}", name, model.parameters)
    job = RolloutJob(step, num_steps, method, 1, channel_places(keep, channel_names(model), vessel), device)
    wanted = tuple(model.parameters.index(name) for name in names)

    def gradient(engine: Engine) -> Adjoint:
        assert engine.gradient is not None
        return engine.gradient(model, batch, job, wanted, loss)

    with np.errstate(all="ignore"):
        adjoint = run_with_fallback(None if engine == AUTO else way(), way, gradient)
    return Gradient(
        loss=adjoint.loss,
        parameters=adjoint.parameters.T,
        names=tuple(names),
        tau_extra=adjoint.tau_extra.transpose(0, 2, 1),
        start=dict(zip((*model.state, *model.hidden), adjoint.state, strict=True)),
        path=adjoint.path,
        diverged=(~(adjoint.worst <= SPEED_LIMIT) | ~finite_samples(batch))[0],
    )


def squared_distance_loss(goal: Array, weights: Array | float = 1.0) -> Loss:
    """Mean over the steps of the weighted squared distance to `goal` (num_steps, S, C), the start left out.

    weights : broadcast against (num_steps, S, C); with the channels north and east and weight 1 the loss is in m^2.
    """

    def loss(path: Array) -> tuple[Array, Array]:
        apart = path[1:] - goal
        slope = np.zeros(path.shape)
        slope[1:] = 2 * weights * apart / len(goal)
        return (weights * apart**2).sum(axis=(0, 2)) / len(goal), slope

    return loss
