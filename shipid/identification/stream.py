"""Currents that the log does not have, one for each run: whether the residuals of a fit show them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Dataset
from shipid.identification.covariance import invert_information
from shipid.identification.residuals import CURRENT, build_problem, predict_residuals
from shipid.identification.settings import ENVIRONMENT, run_overrides
from shipid.identification.solve import Solution
from shipid.identification.statistics import Statistics
from shipid.units import percent_text, significant_digits

Array = NDArray[np.float64]
TRIAL = 0.05  # m/s of the derivatives
EXPLAINED = 0.4  # of the squares of the residuals that no steady error aboard takes: slow random forces have taken 0.37
LONG = 0.1  # of the mean length of a run, at least, over which residuals are then correlated
ALIKE = 1 / 3  # of the mean current: runs whose currents scatter less are taken to be in one and the same
LEAST_RUNS = 2  # of one run a current is as well a wrong vessel


@dataclass(frozen=True)
class Stream:
    """Currents of the runs, one for each, that fit best beside the factors, linearised.

    currents : (R, 2) [m/s] north and east. explained : share of the squares of the residuals that they take away, of
    those that a steady error of u and of v of all runs leaves.
    """

    currents: Array
    explained: float

    @property
    def size(self) -> float:
        """Root mean square over the runs [m/s]."""
        return float(np.sqrt(np.mean(np.sum(self.currents**2, axis=1))))

    @property
    def same(self) -> bool:
        """Whether the currents scatter little about their mean."""
        mean = self.currents.mean(axis=0)
        scatter = np.sum((self.currents - mean) ** 2) / (len(self.currents) - 1)
        return bool(np.sqrt(scatter) <= ALIKE * np.hypot(*mean))


def estimate_currents(solution: Solution, dataset: Dataset) -> Stream | None:
    """The currents after one step of Gauss-Newton with the factors; None where they are known or cannot be computed."""
    if len(solution.runs) < LEAST_RUNS or "current" in solution.settings.widths or _is_set(solution):
        return None
    slopes = _current_slopes(solution, dataset)
    if slopes is None:
        return None
    of_run = solution.clusters[:, None] == np.arange(len(solution.runs))  # (m, R)
    added = (of_run[:, :, None] * slopes[:, None, :]).reshape(len(slopes), -1)
    signals = np.array(solution.signals)
    steady = np.stack([np.where(signals == name, 1.0, 0.0) for name in ("u", "v")], axis=1)
    step, left = _gauss_newton_step(solution, added)
    before = _gauss_newton_step(solution, steady)[1]
    return Stream(step.reshape(-1, 2), 1 - left / before if before > 0 else 0.0)


def current_fit(solution: Solution, dataset: Dataset, judged: Statistics) -> str:
    """A sentence where currents, by run, would take most of the squares of the residuals; else none.

    It names wind, too, if the vessel feels it: the two look alike.
    """
    slow = (one.memory * len(solution.runs) / one.samples >= LONG for one in judged.whiteness.values() if not one.white)
    if not any(slow):
        return ""
    seen = estimate_currents(solution, dataset)
    if seen is None or seen.explained < EXPLAINED:
        return ""
    which = "a current, about the same in all runs" if seen.same else "another current in each run"
    wind = ", or of wind that the log lacks" if solution.vessel.document.get("wind") else ""
    return (
        f"residuals look like those of {which}, {significant_digits(seen.size, 2)} m/s, which takes "
        f"{percent_text(seen.explained)} of their squares away{wind}: estimates make up for it and may be far outside "
        f"of their intervals; identify again with --nuisance current={significant_digits(seen.size, 1)}"
    )


def _is_set(solution: Solution) -> bool:
    """Whether the settings have the current of a run; no log has one."""
    given = run_overrides(solution.settings, solution.runs)
    return any(key.endswith(f".{ENVIRONMENT}.{name}") for key in given for name in CURRENT)


def _current_slopes(solution: Solution, dataset: Dataset) -> Array | None:
    """(m, 2) d residual / d current of its run, to north and to east [s/m]; None where a prediction diverges."""
    vessel, point = solution.vessel, solution.point
    if "current" not in vessel.document:
        vessel = vessel.with_values({"current.kind": "uniform"})
    before = build_problem(solution.vessel, dataset, solution.runs, solution.settings).model.node
    residuals = []
    for V_c, beta_c in ((0.0, 0.0), (TRIAL, 0.0), (TRIAL, np.pi / 2)):
        runs = run_overrides(solution.settings, solution.runs)
        for name, value in zip(CURRENT, (V_c, beta_c), strict=True):
            runs |= {f"{run}.{ENVIRONMENT}.{name}": value for run in solution.runs}
        problem = build_problem(vessel, dataset, solution.runs, solution.settings.model_copy(update={"runs": runs}))
        away = point.away
        if away.size:  # in a current the heading counts, too
            away = np.zeros((len(away), len(problem.model.node)))
            away[:, [problem.model.node.index(name) for name in before]] = point.away
        residuals.append(predict_residuals(problem, solution.factors, point.nuisances, away))
    here, *there = residuals
    changes = np.stack([one.r - here.r for one in there], axis=1) / TRIAL
    if not np.isfinite(changes).all():
        return None
    with_changes = replace(here, by_factor=np.hstack([here.by_factor, changes]))
    return np.asarray(with_changes.marginal(solution.settings.linear_from, solution.within)[1][:, -2:])


def _gauss_newton_step(solution: Solution, added: Array) -> tuple[Array, float]:
    """One step of Gauss-Newton in further unknowns (m, k) beside the factors: (k,), and the squares that it leaves."""
    free = ~(solution.held | solution.at_bound)
    J = np.hstack([solution.jacobian[:, free], added])
    prior = np.append(solution.prior_widths[free], np.full(added.shape[1], np.inf))
    inverse = invert_information(J.T @ J + np.diag(prior**-2.0))[0]
    step = -inverse[:, -added.shape[1] :] @ (added.T @ solution.residuals)  # the factors are at their optimum
    left = solution.residuals + J @ step
    return step[-added.shape[1] :], float(left @ left)
