"""Currents that the log does not have: whether the residuals of a fit show none, one of all runs, or one by run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from shipid.data.dataset import Array, Dataset
from shipid.identification.covariance import invert_information
from shipid.identification.free_run import with_current
from shipid.identification.residuals import CURRENT, build_problem, predict_residuals, typical_errors
from shipid.identification.settings import ENVIRONMENT, NUISANCES, run_overrides
from shipid.identification.solution import Solution
from shipid.identification.statistics import LinearFit, residual_whiteness
from shipid.units import percent_text, significant_digits

CurrentKind = Literal["none", "one", "by run"]
LEAST_RUNS = 2  # of one run a current is as well a wrong vessel


@dataclass(frozen=True)
class Stream:
    """Currents of one kind that fit best beside the factors, linearised.

    currents : (R, 2) [m/s] north and east.
    criterion : Schwarz's, sum over signals of n ln(squares left) + k ln(n), n being the independent residuals.
    """

    kind: CurrentKind
    currents: Array
    criterion: float


def current_sentence(before: Solution, after: Solution) -> str:
    """What residuals without a current show, and how the fit after, with currents, may be chosen otherwise."""
    which = {"one": "one current of all runs", "by run": "another current in each run"}[after.settings.current]
    currents = [[of_run[name] for name in NUISANCES["current"]] for of_run in after.nuisances.values()]
    size = np.sqrt(np.square(currents).sum(axis=1).mean())
    explained = 1 - np.square(after.residuals).sum() / max(np.square(before.residuals).sum(), 1e-300)
    return (
        f"residuals look like those of {which}, {significant_digits(float(size), 2)} m/s, which takes "
        f"{percent_text(float(explained))} of their squares away"
        f"{', or of wind that the log lacks' if 'wind' in before.vessel.document else ''}: "
        "it is estimated beside the numbers; compare with --set current=none"
    )


def estimate_currents(solution: Solution, dataset: Dataset) -> list[Stream]:
    """No current, one of all runs and one by run, each after one step of Gauss-Newton with the factors.

    solution : of `identify`, without currents; or with one of all runs, about which that one and those by run are
    linearised. Empty where currents are known or cannot be computed. Residuals count as those of a first-order process
    with the correlation that they have left with currents by run.

    Source: Schwarz, Annals of Statistics 6 (1978) 461.
    """
    one = solution.settings.current == "one"
    known = ("current" in solution.settings.widths and not one) or _is_set(solution)
    if len(solution.runs) < LEAST_RUNS or known or (solution.held | solution.at_bound).all():
        return []
    width = solution.settings.widths.get("current", 1.0)
    slopes = solution.jacobian[:, -2:] / width if one else _current_slopes(solution, dataset)
    if slopes is None:
        return []
    of_run = solution.clusters[:, None] == np.arange(len(solution.runs))  # (m, R)
    unknowns: dict[CurrentKind, Array] = {
        "none": slopes[:, :0],
        "one": slopes,
        "by run": (of_run[:, :, None] * slopes[:, None, :]).reshape(len(slopes), -1),
    }
    steps = {kind: _gauss_newton_step(solution, added) for kind, added in unknowns.items() if not one or kind != "none"}
    colours = residual_whiteness(replace(LinearFit.of(solution), residuals=steps["by run"][1]))
    signals, worth = np.array(solution.signals), sum(colour.effective for colour in colours.values())
    result = []
    for kind, (step, left) in steps.items():
        squares = {name: float(np.square(left[signals == name]).sum()) for name in colours}
        misfit = sum(colour.effective * np.log(max(squares[name], 1e-300)) for name, colour in colours.items())
        more = np.resize(step, (len(solution.runs), 2)) if len(step) else np.zeros((len(solution.runs), 2))
        criterion = float(misfit + len(step) * np.log(worth))
        result.append(Stream(kind, solution.common_current + more, criterion))
    return result


def _is_set(solution: Solution) -> bool:
    """Whether the settings have the current of a run; no log has one."""
    given = run_overrides(solution.settings, solution.runs)
    return any(key.endswith(f".{ENVIRONMENT}.{name}") for key in given for name in CURRENT)


def _current_slopes(solution: Solution, dataset: Dataset) -> Array | None:
    """(m, 2) d residual / d current of its run, to north and to east [s/m]; None where a prediction diverges."""
    point = solution.point
    before = build_problem(solution.vessel, dataset, solution.runs, solution.settings).model.node
    residuals = []
    trial = typical_errors(solution.vessel, dataset, solution.runs)["u"]
    for current in ((0.0, 0.0), (trial, 0.0), (0.0, trial)):
        vessel, settings = with_current(solution.vessel, solution.settings, solution.runs, current)
        problem = build_problem(vessel, dataset, solution.runs, settings)
        away = point.away
        if away.size:  # in a current the heading counts, too
            away = np.zeros((len(away), len(problem.model.node)))
            away[:, [problem.model.node.index(name) for name in before]] = point.away
        residuals.append(predict_residuals(problem, solution.factors, point.nuisances, away))
    here, *there = residuals
    changes = np.stack([one.r - here.r for one in there], axis=1) / trial
    if not np.isfinite(changes).all():
        return None
    with_changes = replace(here, by_factor=np.hstack([here.by_factor, changes]))
    return np.asarray(with_changes.marginal(solution.settings.linear_from, solution.within)[1][:, -2:])


def _gauss_newton_step(solution: Solution, added: Array) -> tuple[Array, Array]:
    """One step of Gauss-Newton in further unknowns (m, k) beside the factors: (k,), and the residuals (m,) left."""
    free = ~(solution.held | solution.at_bound) & [path not in NUISANCES["current"] for path in solution.paths]
    J = np.hstack([solution.jacobian[:, free], added])
    prior = np.append(solution.prior_widths[free], np.full(added.shape[1], np.inf))
    inverse = invert_information(J.T @ J + np.diag(prior**-2.0))[0]
    begin = int(free.sum())
    step = -inverse[:, begin:] @ (added.T @ solution.residuals)  # the factors are at their optimum
    return step[begin:], solution.residuals + J @ step
