"""Simulates manoeuvres in batches, one for each kind of helmsman, and logs them in the columns of a dataset."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.arguments import as_float_array, as_names, check_choice, check_mapping, check_positive, whole_steps
from shipid.engine.casadi import evaluate_samples
from shipid.engine.integrate import Array, Method
from shipid.engine.rollout import Trajectories, rollout
from shipid.errors import DocumentError, ShipidError, suggest_name
from shipid.physics.helm import Helmsman
from shipid.physics.signals import ACTUAL, measurable_signals
from shipid.simulation.approach import Controls, steady_approach
from shipid.simulation.log import log_columns, number_runs
from shipid.simulation.manoeuvre import ApproachedManoeuvre, Manoeuvre
from shipid.units import DEGREE
from shipid.vessel.dynamics import HELM, Dynamics, vessel_dynamics
from shipid.vessel.load import Vessel


def perform_manoeuvres(
    vessel: Vessel,
    manoeuvres: Iterable[Manoeuvre] | Manoeuvre,
    *,
    step: float,
    interval: float | None = None,
    duration: float | None = None,
    method: Method = "rk4",
    environment: Mapping[str, float | Array] | None = None,
    components: Mapping[str, Array] | None = None,
    outputs: Sequence[str] = (),
    engine: str = "auto",
) -> pd.DataFrame:
    """Simulate manoeuvres and log them; manoeuvres with equal helmsmen run in one rollout.

    Orders pass through the vessel's actuator models (lag, limits); without them commands act at once. The approach is
    in calm water; environment and sea act from t = 0 on.

    step, interval : of the integration, and between logged rows [s]; default: every step is logged.
    duration : length of every log [s]; default: that of each manoeuvre.
    environment : name (`V_w` [m/s], `beta_w` [rad, towards]) -> one value for all runs, (num_manoeuvres,), or a series
        (num_instants, num_manoeuvres) at t = 0, step, 2 step, ... to the end of the longest log; default 0.
    components : wave components for each manoeuvre, from `shipid.simulation.weather.wave_loads`; default: calm water.
    outputs : of the vessel's components, such as `propeller.thrust`, that are logged too.

    Returns
    -------
    DataFrame : `run`, `t` [s], the states (u, v, r in the horizontal plane), each command as ordered from that row on,
        actuator states (`actual.port.n`), wind if the vessel has wind forces, `flags` (0). Without `actual.*` these
        are the columns of a dataset. SI units and radians.

    DocumentError for a manoeuvre that this vessel cannot perform, ShipidError where an approach does not settle, a run
    diverges or an argument does not fit.
    """
    manoeuvres = _check_manoeuvres(manoeuvres)
    step = check_positive("step", step)
    between = step if interval is None else check_positive("interval", interval)
    if duration is not None:
        duration = check_positive("duration", duration)
    every = whole_steps(between, step)
    if not every:
        raise ShipidError(f"interval {between:g} s must be a multiple of step {step:g} s")
    names = _run_names(manoeuvres)
    rows = [
        max(whole_steps(length, between) or int(length / between), 1) + 1
        for length in (one.length if duration is None else duration for one in manoeuvres)
    ]
    environment = {} if environment is None else environment
    check_mapping("environment", environment, "a name to a number or an array")
    weather = _environment_series(vessel, environment, len(manoeuvres), every * (max(rows) - 1) + 1)
    check_choice("method", method, get_args(Method))
    seas = _check_components({} if components is None else components, len(manoeuvres))
    outputs = as_names("outputs", outputs)
    for name in outputs:
        check_choice("outputs", name, vessel_dynamics(vessel).outputs)
    controls = Controls(vessel)
    groups: dict[Helmsman | None, list[int]] = {}
    for place, one in enumerate(manoeuvres):
        groups.setdefault(one.helmsman(controls), []).append(place)
    how: dict[str, Any] = {"step": step, "method": method, "engine": engine}
    logs: list[dict[str, Array]] = [{}] * len(manoeuvres)
    for helmsman, places in groups.items():
        columns = _perform_batch(
            controls,
            helmsman,
            {names[place]: manoeuvres[place] for place in places},
            max(rows[place] for place in places),
            {channel: values[:, places] for channel, values in weather.items()},
            {path: drawn[places] for path, drawn in seas.items()},
            every,
            how,
            outputs,
        )
        for sample, place in enumerate(places):
            logs[place] = {name: values[: rows[place], sample] for name, values in columns.items()}
    frame: dict[str, Any] = {"run": np.repeat(names, rows)}
    frame["t"] = np.concatenate([np.arange(count) * (step * every) for count in rows])
    frame |= {name: np.concatenate([log[name] for log in logs]) for name in logs[0]}
    return pd.DataFrame(frame | {"flags": np.zeros(sum(rows), dtype=np.int64)})


def _check_manoeuvres(given: Any) -> list[Manoeuvre]:
    """One manoeuvre or several as a list; ShipidError for what is none, and for no manoeuvre."""
    manoeuvres = list(given) if isinstance(given, Iterable) and not isinstance(given, Manoeuvre | str) else [given]
    if not manoeuvres or not all(isinstance(one, Manoeuvre) for one in manoeuvres):
        raise ShipidError(f"give manoeuvres of `shipid.simulation.manoeuvre`, such as Zigzag(...), not {given!r}")
    return manoeuvres


def _run_names(manoeuvres: Sequence[Manoeuvre]) -> list[str]:
    """Name of each run, a number where the manoeuvre has none; DocumentError where two are the same."""
    names = [one.name or number for one, number in zip(manoeuvres, number_runs(len(manoeuvres)), strict=True)]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise DocumentError(f"two runs are named {twice!r}", path="manoeuvre.name")
    return names


def _check_components(components: Mapping[str, Array], count: int) -> dict[str, Array]:
    """Wave components (count, ...) by the path of their term; ShipidError for another number of ships."""
    check_mapping("components", components, "the path of a term to an array")
    seas = {path: np.atleast_1d(drawn) for path, drawn in components.items()}
    for path, drawn in seas.items():
        if len(drawn) != count:
            raise ShipidError(f"components of {path} are for {len(drawn)} ships, and there are {count} manoeuvres")
    return seas


def _perform_batch(
    controls: Controls,
    helmsman: Helmsman | None,
    named: Mapping[str, Manoeuvre],
    rows: int,
    environment: Mapping[str, Array],
    seas: Mapping[str, Array],
    every: int,
    how: Mapping[str, Any],
    outputs: Sequence[str],
) -> dict[str, Array]:
    """Columns (rows, num_samples) of the logs of manoeuvres with equal helmsmen, by name, from one rollout.

    rows : of the longest log. environment, seas : series of the channels, and wave components, of these manoeuvres.
    """
    vessel, num_steps, manoeuvres = controls.vessel, every * (rows - 1), list(named.values())
    model = vessel_dynamics(vessel, helmsman)
    weather = {name: values[: num_steps + 1] for name, values in environment.items()}
    commands, begun = rollout_inputs(controls, helmsman, manoeuvres, num_steps, how)
    constant = all((values == values[0]).all() for values in commands.values())  # which is faster in the engines
    path = rollout(
        vessel,
        commands={name: values[0] for name, values in commands.items()} if constant else commands,
        environment={name: values[0] if len(values) == 1 else values[:-1] for name, values in weather.items()},
        num_steps=num_steps,
        every=every,
        components=seas,
        keep=None if helmsman else (*model.state, *(f"{ACTUAL}{name}" for name in model.memory)),
        **begun,
        **how,
    )
    if path.diverged.any():
        worst = list(named)[int(np.argmax(path.diverged[0]))]
        raise ShipidError(
            f"{vessel.name} diverges in {worst}: take a smaller step than {how['step']:g} s, or mend what drives it"
        )
    moments = np.arange(rows) * every
    felt = {name: values[np.minimum(moments, len(values) - 1)] for name, values in weather.items()}
    log = log_columns(path, model.state)
    steps = np.minimum(moments, num_steps - 1)
    if helmsman is None:
        log |= {name: commands[name][steps] + 0.0 for name in model.ordered}
    else:
        log |= _evaluate_records(model.ordered, "orders", vessel, model, path, commands, felt, steps)
    if outputs:
        shown = _evaluate_records(tuple(model.outputs), "measured", vessel, model, path, commands, felt, steps)
        log |= {name: shown[name] for name in outputs}
    lagged = (name for name in model.memory if not name.startswith(f"{HELM}."))
    log |= {f"{ACTUAL}{name}": path[f"{ACTUAL}{name}"][:, 0] for name in lagged}
    return log | {name: felt[name] for name in measurable_signals(felt)}


def rollout_inputs(
    controls: Controls,
    helmsman: Helmsman | None,
    manoeuvres: Sequence[Manoeuvre],
    num_steps: int,
    how: Mapping[str, Any],
) -> tuple[dict[str, Array], dict[str, Any]]:
    """Commands (num_steps, num_manoeuvres) by name; start, actuator states and helmsman as arguments of `rollout`."""
    t = np.arange(num_steps) * how["step"]
    start, memory, helms = _initial_states(manoeuvres, controls, how)
    inputs = [one.inputs(controls, t, speed) for one, speed in zip(manoeuvres, start["u"], strict=True)]
    for sample, helm in helms.items():
        one = manoeuvres[sample]
        assert isinstance(one, ApproachedManoeuvre)
        inputs[sample] = one.held(inputs[sample], t, helm)
    commands = {name: np.stack([one[name] for one in inputs], axis=1) for name in inputs[0]}
    if helmsman is None:
        ready = [sample for sample, one in enumerate(manoeuvres) if one.start.at_order]
        for name, values in memory.items():
            values[ready] = commands[name][0, ready]
    return commands, {"start": start, "memory": memory, "helmsman": helmsman}


def _environment_series(
    vessel: Vessel, environment: Mapping[str, float | Array], count: int, instants: int
) -> dict[str, Array]:
    """Channel of the vessel's environment -> (1 or num_instants, num_manoeuvres)."""
    names = vessel_dynamics(vessel).environment
    unknown = next((name for name in environment if name not in names), None)
    if unknown is not None:
        raise DocumentError(
            f"{vessel.name} has no environment channel {unknown!r}: {suggest_name(unknown, names)}",
            file=vessel.file,
            path="environment",
        )
    given = {name: as_float_array(f"environment {name!r}", environment.get(name, 0.0)) for name in names}
    for name, values in given.items():
        if values.shape not in ((), (count,), (instants, count)):
            wanted = f"one value or {count}, one a manoeuvre, or a series ({instants}, {count})"
            raise ShipidError(f"environment {name!r} must be {wanted}: {values.shape}")
    return {
        name: np.array(values if values.ndim == 2 else np.broadcast_to(values, (1, count)))
        for name, values in given.items()
    }


def _initial_states(
    manoeuvres: Sequence[Manoeuvre], controls: Controls, how: Mapping[str, Any]
) -> tuple[dict[str, Array], dict[str, Array], dict[int, dict[str, float]]]:
    """States and actuator states at t = 0, name -> (num_manoeuvres,); actuators are at 0 without an approach.

    Also, for each manoeuvre whose approach a helmsman holds, angle command -> helm [rad].
    """
    model, count = vessel_dynamics(controls.vessel), len(manoeuvres)
    starts = [one.start for one in manoeuvres]
    start = {name: np.zeros(count) for name in (*model.state, *model.hidden)}
    memory = {name: np.zeros(count) for name in model.memory}
    helms: dict[int, dict[str, float]] = {}
    for held in (False, True):
        moving = [sample for sample, one in enumerate(starts) if one.shaft is not None and one.held == held]
        if not moving:
            continue
        speeds, which = np.unique([starts[sample].shaft for sample in moving], return_inverse=True)
        settled = steady_approach(controls, speeds, held=held, **how)
        for into, values_of in ((start, settled.state), (memory, settled.memory)):
            for name, values in values_of.items():
                into[name][moving] = values[which]
        for sample, place in zip(moving if held else (), which, strict=False):
            helms[sample] = {name: float(values[place]) for name, values in settled.helm.items()}
    start["u"] = start["u"] + np.array([0.0 if one.shaft is not None else one.speed for one in starts])
    start["psi"] = start["psi"] + np.array([one.course_deg * DEGREE for one in manoeuvres])
    return start, memory, helms


def _evaluate_records(
    names: Sequence[str],
    function: Literal["orders", "measured"],
    vessel: Vessel,
    model: Dynamics,
    path: Trajectories,
    commands: Mapping[str, Array],
    weather: Mapping[str, Array],
    steps: NDArray[np.intp],
) -> dict[str, Array]:
    """Orders of a helmsman, or outputs of components: name -> (num_records, num_samples).

    commands : (num_steps, num_samples). steps : (num_records,) step from each record on; the last record repeats the
    last. weather : (num_records, ...).
    """
    records, samples = path.states.shape[0], path.states.shape[2]
    still = np.zeros((records, samples))
    states = [path[name][:, 0] if name in path.names else still for name in (*model.state, *model.hidden)]
    memory = [path[f"{ACTUAL}{name}"][:, 0] for name in model.memory]
    given = [commands[name][steps] for name in model.commands]
    felt = [still + weather[name] for name in model.environment]
    inputs = [[channel.ravel() for channel in part] for part in (states, memory, given, felt)]
    values = evaluate_samples(model, function, inputs, np.array(list(vessel.parameters.values())))
    values = values.reshape(-1, records, samples)
    return {name: value + 0.0 for name, value in zip(names, values, strict=True)}
