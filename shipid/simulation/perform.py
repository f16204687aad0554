"""Manoeuvres performed: batches of one helmsman each, logged in the columns of a dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.engine.integrate import Method
from shipid.engine.rollout import Trajectories, rollout
from shipid.errors import DocumentError, ShipidError, choices
from shipid.physics.helm import Helmsman
from shipid.simulation.approach import Controls, steady
from shipid.simulation.manoeuvre import Manoeuvre
from shipid.simulation.truth import ON_BOARD, logged, run_names
from shipid.units import DEGREE, RPM
from shipid.vessel.dynamics import HELM, dynamics
from shipid.vessel.load import Vessel

Array = NDArray[np.float64]


def perform(
    vessel: Vessel,
    manoeuvres: Sequence[Manoeuvre],
    *,
    step: float,
    interval: float | None = None,
    method: Method = "rk4",
    environment: Mapping[str, float | Array] | None = None,
    components: Mapping[str, Array] | None = None,
    engine: str = "auto",
) -> pd.DataFrame:
    """Run manoeuvres and log them: all that one helmsman (or the clock) orders in one rollout.

    The vessel's own actuators lag and limit what is ordered; a vessel without any follows at once. The approach is in
    calm water, from t = 0 on environment and sea act.

    Parameters
    ----------
    step, interval : of the integration, and between logged rows [s]; default: every step is logged.
    environment : name (`V_w` [m/s], `beta_w` [rad, towards]) -> a value for all runs or (num_manoeuvres,); default 0.
    components : a sea for each manoeuvre, as `rollout` takes it (`shipid.simulation.sea.wave_loads`); default: calm.

    Returns
    -------
    DataFrame : `run`, `t` [s], the states (u, v, r those of the horizontal plane), each command as ordered from that
        row on, what lagged ones have reached (`actual.port.n`), wind where the vessel feels it, `flags` (0). Without
        `actual.*`: the columns of a dataset.

    Raises
    ------
    DocumentError : a manoeuvre that this vessel cannot do.
    ShipidError : an approach that does not settle, a run that diverges, an interval that is no multiple of the step.
    """
    if not manoeuvres:
        raise ShipidError("there is no manoeuvre to perform")
    between = step if interval is None else interval
    every = round(between / step)
    if every < 1 or abs(every * step - between) > 1e-9 * step * every:
        raise ShipidError(f"interval {between:g} s must be a multiple of step {step:g} s")
    names = [own.name or number for own, number in zip(manoeuvres, run_names(len(manoeuvres)), strict=True)]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DocumentError(f"two runs are named {twice!r}", path="manoeuvre.name")
    controls, weather = Controls.of(vessel), _weather(vessel, environment or {}, len(manoeuvres))
    seas = {path: np.asarray(drawn) for path, drawn in (components or {}).items()}
    short = next((path for path, drawn in seas.items() if len(drawn) != len(manoeuvres)), None)
    if short is not None:
        found = f"components of {short} are for {len(seas[short])} ships"
        raise ShipidError(f"{found}, and there are {len(manoeuvres)} manoeuvres")
    groups: dict[Helmsman | None, dict[str, Manoeuvre]] = {}
    for name, own in zip(names, manoeuvres, strict=True):
        groups.setdefault(own.helmsman(controls), {})[name] = own
    how: dict[str, Any] = {"step": step, "method": method, "engine": engine}
    frames: dict[str, pd.DataFrame] = {}
    for helmsman, members in groups.items():
        chosen = [names.index(name) for name in members]
        here = {channel: values[chosen] for channel, values in weather.items()}
        sea = {path: drawn[chosen] for path, drawn in seas.items()}
        frames |= _together(controls, helmsman, members, here, every, {**how, "components": sea})
    return pd.concat([frames[name] for name in names], ignore_index=True)


def _together(
    controls: Controls,
    helmsman: Helmsman | None,
    members: Mapping[str, Manoeuvre],
    weather: Mapping[str, Array],
    every: int,
    how: Mapping[str, Any],
) -> dict[str, pd.DataFrame]:
    """Logs by name of manoeuvres that one helmsman orders, as one rollout of the longest."""
    vessel, manoeuvres, interval = controls.vessel, list(members.values()), how["step"] * every
    start, memory = _start(manoeuvres, controls, how)
    num_steps = every * max(_rows(own, interval) - 1 for own in manoeuvres)
    t = np.arange(num_steps) * how["step"]
    told = [own.told(controls, t, speed) for own, speed in zip(manoeuvres, start["u"], strict=True)]
    commands = {name: np.stack([one[name] for one in told], axis=1) for name in told[0]}
    given: dict[str, Any] = {"memory": memory, "helmsman": helmsman, **how}
    path = rollout(vessel, start, commands, weather, num_steps=num_steps, every=every, **given)
    if path.diverged.any():
        worst = list(members)[int(np.argmax(path.diverged[0]))]
        raise ShipidError(f"{vessel.name} diverges in {worst}: take a smaller step than {how['step']:g} s")
    columns = _columns(vessel, helmsman, path, commands, weather, every)
    frames = {}
    for sample, (name, own) in enumerate(members.items()):
        rows = _rows(own, interval)
        log = {column: values[:rows, sample] for column, values in columns.items()}
        head = {"run": name, "t": np.arange(rows) * interval}
        frames[name] = pd.DataFrame({**head, **log, "flags": np.zeros(rows, dtype=np.int64)})
    return frames


def _rows(manoeuvre: Manoeuvre, interval: float) -> int:
    """Rows of its log, the start included; at least two."""
    return max(int(manoeuvre.length / interval + 1e-9), 1) + 1


def _weather(vessel: Vessel, environment: Mapping[str, float | Array], count: int) -> dict[str, Array]:
    """Each channel of the vessel's environment, (num_manoeuvres,)."""
    names = dynamics(vessel).environment
    unknown = next((name for name in environment if name not in names), None)
    if unknown is not None:
        raise DocumentError(
            f"{vessel.name} feels no {unknown!r}: {choices(unknown, names)}", file=vessel.file, path="environment"
        )
    given = {name: np.asarray(environment.get(name, 0.0), dtype=float) for name in names}
    for name, values in given.items():
        if values.shape not in ((), (count,)):
            raise ShipidError(f"environment {name!r} must be one value or {count}, one a manoeuvre: {values.shape}")
    return {name: np.array(np.broadcast_to(values, count)) for name, values in given.items()}


def _start(
    manoeuvres: Sequence[Manoeuvre], controls: Controls, how: Mapping[str, Any]
) -> tuple[dict[str, Array], dict[str, Array]]:
    """States and memories at t = 0, name -> (num_manoeuvres,): at rest, or steady at the ordered shaft speed."""
    model, count = dynamics(controls.vessel), len(manoeuvres)
    start = {name: np.zeros(count) for name in (*model.state, *model.hidden)}
    memory = {name: np.zeros(count) for name in model.memory}
    moving = [number for number, own in enumerate(manoeuvres) if own.approach == "steady"]
    if moving:
        speeds, which = np.unique([manoeuvres[number].n_rpm * RPM for number in moving], return_inverse=True)
        for into, found in zip(
            (start, memory),
            steady(controls, speeds, **{name: how[name] for name in ("step", "method", "engine")}),
            strict=True,
        ):
            for name, values in found.items():
                into[name][moving] = values[which]
    start["psi"] = start["psi"] + np.array([own.course_deg * DEGREE for own in manoeuvres])
    return start, memory


def _columns(
    vessel: Vessel,
    helmsman: Helmsman | None,
    path: Trajectories,
    commands: Mapping[str, Array],
    weather: Mapping[str, Array],
    every: int,
) -> dict[str, Array]:
    """Columns of the log, (num_records, num_samples)."""
    model = dynamics(vessel, helmsman)
    log = logged(path, model.state)
    log |= _orders(vessel, helmsman, path, commands, weather, every)
    lagged = (name for name in model.memory if not name.startswith(f"{HELM}."))
    log |= {f"actual.{name}": path[f"actual.{name}"][:, 0] for name in lagged}
    shape = path.states.shape[0], path.states.shape[2]
    return log | {name: np.broadcast_to(values, shape) for name, values in weather.items() if name in ON_BOARD}


def _orders(
    vessel: Vessel,
    helmsman: Helmsman | None,
    path: Trajectories,
    commands: Mapping[str, Array],
    weather: Mapping[str, Array],
    every: int,
) -> dict[str, Array]:
    """What is ordered from each record on, (num_records, num_samples); the last record repeats the last command."""
    model = dynamics(vessel, helmsman)
    records, samples = path.states.shape[0], path.states.shape[2]

    moments = np.minimum(np.arange(records) * every, len(commands[model.commands[0]]) - 1)
    told = np.stack([commands[name][moments] for name in model.commands], axis=-1)
    if helmsman is None:
        return {name: told[..., model.commands.index(name)] + 0.0 for name in model.ordered}
    felt = np.zeros((records, samples, len(model.environment)))
    for channel, name in enumerate(model.environment):
        felt[..., channel] = weather[name]
    memory = [path.names.index(f"actual.{name}") for name in model.memory]
    states = path.states[:, 0, :, : len(model.state) + len(model.hidden)]
    values = np.array(list(vessel.parameters.values()))
    # record by record: a map of all is slow to build
    rows = model.orders.map("rows", "serial", samples, [model.orders.n_in() - 1], [])
    inputs = (states, path.states[:, 0][..., memory], told, felt)  # (num_records, num_samples, channel)
    found = np.array([np.array(rows(*(part[k].T for part in inputs), values)) for k in range(records)])
    return {name: found[:, channel] + 0.0 for channel, name in enumerate(model.ordered)}
