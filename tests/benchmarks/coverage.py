"""Whether the 95 % intervals cover: replicates of trials with noise whose truth is known, each fitted and judged.

The 28.9 m Gunnerus, 20 runs of 80 s at 1 Hz, eight hull derivatives; the moment of inertia and its added part as well,
which act as one sum and so cannot be separated. Every fit starts from factors off by up to 20 %.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shipid.data.dataset import Dataset
from shipid.engine.rollout import rollout
from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.identification.statistics import Statistics, fit_statistics
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.identification.trials import changed, trials

RUNS, STEPS, REPLICATES = 20, 80, 200
DERIVATIVES = ("X_u|u|", "X_rv", "Y_uv", "Y_ur", "Y_v|v|", "N_uv", "N_ur", "N_r|r|")
PAIR = ("inertia.I_z", "added_mass.N_rdot")
NOISE = {"u": 0.05, "v": 0.05, "r": np.radians(0.1)}  # m/s, rad/s, of what is logged
SHAKEN = {"u": 0.02, "v": 0.02, "r": np.radians(0.05)}  # m/s^2, rad/s^2, of a force that is drawn anew every step
WHOLE, SHORT, SHORTER = 0.0, 20.0, 10.0  # s
CASES = {  # noise -> how many times SHAKEN, horizons [s]
    "white noise": (0.0, (WHOLE, SHORT)),
    "process noise": (1.0, (WHOLE, SHORT)),
    "process noise doubled": (2.0, (WHOLE, SHORT, SHORTER)),
}
MOST = 0.5  # share of the replicates


def run(replicates: int = REPLICATES) -> dict[str, Any]:
    """Coverage of the identifiable factors, and how often the pair is named."""
    vessel = load_vessel("gunnerus-28.9")
    result: dict[str, Any] = {"replicates": replicates}
    for noise, (strength, horizons) in CASES.items():
        judged: dict[float, list[Statistics | None]] = {horizon: [] for horizon in horizons}
        for seed in range(replicates):
            data = _noisy(vessel, seed, strength)
            for horizon in horizons:
                judged[horizon].append(_judged(vessel, data, horizon))
        for horizon in horizons:
            case = f"{noise}, {f'{horizon:g} s' if horizon else 'whole runs'}"
            converged = [one for one in judged[horizon] if one is not None]
            result |= {f"{case}: {label}": value for label, value in _figures(converged).items()}
            result[f"{case}: did not converge"] = replicates - len(converged)
    return result


def _noisy(vessel: Vessel, seed: int, strength: float) -> Dataset:
    """The same orders each time, with other noise, shaken by forces that many times as strong as declared."""
    data, rng = trials(vessel, RUNS, STEPS), np.random.default_rng([seed, 5])
    columns = _shaken(vessel, data, rng, strength)
    return changed(data, **{name: columns[name] + rng.normal(0, s, len(data.frame)) for name, s in NOISE.items()})


def _shaken(vessel: Vessel, data: Dataset, rng: np.random.Generator, strength: float) -> dict[str, np.ndarray]:
    """Velocities of the runs with random accelerations, as forces on the mass that the ship has."""
    model = vessel_dynamics(vessel)
    table = {str(name): column.to_numpy() for name, column in data.frame.items() if name != "run"}
    table = {name: values.reshape(RUNS, STEPS + 1) for name, values in table.items()}
    still = np.zeros(len(model.environment))
    values = list(vessel.parameters.values())

    def rates(tau: np.ndarray) -> np.ndarray:
        given = ([0.0] * len(model.state), [], [0.0] * len(model.commands), still, values, tau)
        return np.array(model.rates(*given)).ravel()[3:]

    inverse = np.stack([rates(axis) - rates(np.zeros(3)) for axis in np.eye(3) * 1e6], axis=1) / 1e6
    accelerations = strength * rng.normal(0, list(SHAKEN.values()), (STEPS, RUNS, 3))
    path = rollout(
        vessel,
        {name: table[name][:, 0] for name in model.state},
        {name: table[name][:, :-1].T for name in model.commands},
        {name: np.zeros(RUNS) for name in model.environment},
        step=1.0,
        num_steps=STEPS,
        method="rk4",
        tau_extra=accelerations @ np.linalg.inv(inverse).T,
    )
    assert not path.diverged.any()
    return {name: path[name][:, 0].T.ravel() for name in NOISE}


def _judged(vessel: Vessel, data: Dataset, horizon: float) -> Statistics | None:
    paths = [*(f"hull.derivatives.{name}" for name in DERIVATIVES), *PAIR]
    settings = Identify(
        parameters=paths,
        weights=NOISE,
        horizon=horizon,
        nuisance=["initial_state"],
        start="base",
        current="none",
    )
    begin = dict(zip(paths, (1 + 0.2 * np.sin(np.arange(len(paths)))).tolist(), strict=True))
    solution = identify(vessel, data, data.runs, settings, start=begin)
    return fit_statistics(solution) if solution.status == "ok" else None


def _figures(judged: list[Statistics]) -> dict[str, Any]:
    """Shares of the replicates; identifiable is a factor that most of them call so."""
    paths = judged[0].fit.paths
    covered = np.mean([(one.low <= 1) & (one.high >= 1) for one in judged], axis=0)
    called = np.mean([one.identifiable for one in judged], axis=0)
    free = [j for j in range(len(paths)) if called[j] > MOST]
    worst = min(free, key=lambda j: float(covered[j]))
    others = [j for j in range(len(paths)) if j not in free]
    named = [
        any(set(PAIR) <= set(combination.paths) for combination in one.combinations)
        and not any(one.identifiable[paths.index(path)] for path in PAIR)
        for one in judged
    ]
    kinds = [one.chosen for one in judged]
    memory = [max(colour.memory for colour in one.whiteness.values()) for one in judged]
    return {
        "mean coverage of the identifiable": round(float(covered[free].mean()), 4),
        "worst coverage of them": f"{covered[worst]:.3f} ({paths[worst].rsplit('.', 1)[-1]})",
        "not identifiable: covered, called identifiable": ", ".join(
            f"{paths[j].rsplit('.', 1)[-1]} {covered[j]:.3f}, {called[j]:.3f}" for j in others
        ),
        "pair named as not identifiable": round(float(np.mean(named)), 4),
        "form": ", ".join(f"{kind} {kinds.count(kind)}" for kind in dict.fromkeys(kinds)),
        "residuals remember, median [s]": round(float(np.median(memory)), 1),
    }
