"""Do the 95 % intervals cover? Replicates of trials with noise whose truth is known, each fitted and judged.

The 28.9 m Gunnerus, 20 runs of 80 s at 1 Hz, eight hull derivatives; the moment of inertia and its added part as well,
which act as one sum and so cannot be told apart. Every fit starts from factors off by up to 20 %.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shipid.data.dataset import Dataset
from shipid.identification.agreement import agreement
from shipid.identification.problem import Identify
from shipid.identification.solve import identify
from shipid.identification.statistics import Fit, Statistics, statistics
from shipid.simulation.rollout import rollout
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.identification.trials import changed, trials

RUNS, STEPS, REPLICATES = 20, 80, 200
DERIVATIVES = ("X_u|u|", "X_rv", "Y_uv", "Y_ur", "Y_v|v|", "N_uv", "N_ur", "N_r|r|")
PAIR = ("inertia.I_z", "added_mass.N_rdot")
NOISE = {"u": 0.05, "v": 0.05, "r": np.radians(0.1)}  # m/s, rad/s, of what is logged
SHAKEN = {"u": 0.02, "v": 0.02, "r": np.radians(0.05)}  # m/s^2, rad/s^2, of a force that is drawn anew every step
WHOLE, SHORT = 0.0, 20.0  # s
CASES = {
    "white noise, 20 s": (False, SHORT),
    "white noise, whole runs": (False, WHOLE),
    "process noise, whole runs": (True, WHOLE),
    "process noise, 20 s": (True, SHORT),
}
BROAD = 1e-9  # of the largest number: where a prior must say nothing and the equations still be solved


def run(replicates: int = REPLICATES) -> dict[str, Any]:
    """Coverage of the identifiable factors, how often the pair is named, how often two horizons disagree."""
    vessel = load_vessel("gunnerus-28.9")
    result: dict[str, Any] = {"replicates": replicates}
    judged: dict[str, list[Statistics]] = {}
    for case, (shaken, horizon) in CASES.items():
        judged[case] = [_judged(vessel, _noisy(vessel, seed, shaken), horizon) for seed in range(replicates)]
        result |= {f"{case}: {label}": value for label, value in _figures(judged[case]).items()}
    for noise in ("white noise", "process noise"):
        pairs = zip(judged[f"{noise}, whole runs"], judged[f"{noise}, 20 s"], strict=True)
        told = sum(not agreement(whole, short).agree for whole, short in pairs)
        result[f"{noise}: whole runs and 20 s are said to disagree"] = round(told / replicates, 3)
    return result


def _noisy(vessel: Vessel, seed: int, shaken: bool) -> Dataset:
    """The same orders each time, with noise of their own; shaken by forces too, or not."""
    data, rng = trials(vessel, RUNS, STEPS), np.random.default_rng([seed, 5])
    columns = _shaken(vessel, data, rng) if shaken else {name: data.frame[name].to_numpy() for name in NOISE}
    return changed(data, **{name: columns[name] + rng.normal(0, s, len(data.frame)) for name, s in NOISE.items()})


def _shaken(vessel: Vessel, data: Dataset, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Velocities of the runs with random accelerations, as forces on the mass that the ship has."""
    model = dynamics(vessel)
    table = {str(name): column.to_numpy() for name, column in data.frame.items() if name != "run"}
    table = {name: values.reshape(RUNS, STEPS + 1) for name, values in table.items()}
    still = np.zeros(len(model.environment))
    values = list(vessel.parameters.values())

    def rates(tau: np.ndarray) -> np.ndarray:
        given = ([0.0] * len(model.state), [], [0.0] * len(model.commands), still, values, tau)
        return np.array(model.rates(*given)).ravel()[3:]

    inverse = np.stack([rates(axis) - rates(np.zeros(3)) for axis in np.eye(3) * 1e6], axis=1) / 1e6
    accelerations = rng.normal(0, list(SHAKEN.values()), (STEPS, RUNS, 3))
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


def _judged(vessel: Vessel, data: Dataset, horizon: float) -> Statistics:
    settings = Identify(
        parameters=[*(f"hull.derivatives.{name}" for name in DERIVATIVES), *PAIR],
        weights=NOISE,
        horizon=horizon,
        nuisance=["initial_state"],
        start="base",
    )
    paths = [*(f"hull.derivatives.{name}" for name in DERIVATIVES), *PAIR]
    begin = dict(zip(paths, (1 + 0.2 * np.sin(np.arange(len(paths)))).tolist(), strict=True))
    found = identify(vessel, data, data.runs, settings, start=begin)
    assert found.status == "ok", found.sentence
    return statistics(Fit.of(found))


def _figures(judged: list[Statistics]) -> dict[str, Any]:
    """Shares of the replicates; a factor counts where it is said to be identifiable."""
    paths = judged[0].fit.paths
    free = [j for j, path in enumerate(paths) if path not in PAIR]
    covered = np.array([(one.low <= 1) & (one.high >= 1) for one in judged])
    told = np.array([one.identifiable for one in judged])
    share = np.array([covered[told[:, j], j].mean() if told[:, j].any() else np.nan for j in free])
    worst = int(np.nanargmin(share))
    named = [
        any(set(PAIR) <= set(own.paths) for own in one.collinearity.combinations)
        and not any(one.identifiable[paths.index(path)] for path in PAIR)
        for one in judged
    ]
    kinds = [one.chosen for one in judged]
    return {
        "mean coverage": round(float(np.nanmean(share)), 4),
        "worst coverage": f"{share[worst]:.3f} ({paths[free[worst]].rsplit('.', 1)[-1]})",
        "said to be identifiable": round(float(told[:, free].mean()), 4),
        "pair named as unidentifiable": round(float(np.mean(named)), 4),
        "form": ", ".join(f"{kind} {kinds.count(kind)}" for kind in dict.fromkeys(kinds)),
    }
