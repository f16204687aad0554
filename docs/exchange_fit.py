"""The fit of the law of exchange to the cells of many ships: `docs/exchange_law.py` writes and judges it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from shipid.exchange.law import (
    CELL,
    FLAWS,
    LIMITED,
    NO_PHYSICS,
    RESPONSES,
    Array,
    ExchangeLaw,
    Hierarchy,
    Response,
    both_features,
    check_cells,
    feature_columns,
    group_codes,
    mean_of_features,
    response_names,
    response_rows,
    response_values,
)
from shipid.files import write_json
from shipid.version import __version__

CENTRE, FLOOR_CENTRE = {"1": -2.0, "a": 1.0, "n": -0.4}, {"1": -0.5, "p": 1.0}
"""Means of the priors of H that are not 0: a share of A, falling with runs, beside a share of the floor."""
MOST_STEP = 0.5  # of theta in one round
WIDE, NARROW = 3.0, 0.3  # standard deviations of the Gaussian priors of features, and of those of a kind


@dataclass(frozen=True)
class ShipDesign:
    """Rows of one ship, sorted by cell: values (rows,), both features, and what makes their covariance.

    effects (rows, G) with their levels (G,), all but those of a cell and a row. starts, counts (cells,): rows of each
    cell; weights (cells, inner levels): squared features of the levels of a cell.
    """

    values: Array
    features: Array
    floor: Array
    effects: Array
    levels: Array
    starts: Array
    counts: Array
    weights: Array

    @classmethod
    def of(cls, response: Response, cells: pd.DataFrame) -> ShipDesign:
        """Design of the rows of one ship."""
        rows = cells.iloc[np.argsort(group_codes(cells, CELL), kind="stable")]
        features = feature_columns(rows, [feature for _, feature in response.levels])
        effects, levels = [], []
        for place, (level, _) in enumerate(response.levels[:-1]):
            if level != CELL:
                code = group_codes(rows, level)
                effects.append(np.where(code[:, None] == np.unique(code), features[:, [place]], 0.0))
                levels += [place] * effects[-1].shape[1]
        starts = np.unique(group_codes(rows, CELL), return_index=True)[1]
        inner = [place for place, (level, _) in enumerate(response.levels) if level == CELL]
        return cls(
            response_values(response, rows),
            *both_features(response, rows),
            np.hstack(effects),
            np.array(levels),
            starts,
            np.diff([*starts, len(rows)]),
            features[starts][:, inner] ** 2,
        )

    def sums(self, columns: Array) -> Array:
        """Sums (cells, ...) of columns (rows, ...) over the rows of each cell."""
        return np.asarray(np.add.reduceat(columns, self.starts, axis=0))

    def whiten(self, columns: Array, shrink: Array, rest: float) -> Array:
        """Columns (rows, K) times the inverse root of the covariance of cells and rows."""
        means = self.sums(columns) / self.counts[:, None]
        return np.asarray((columns - np.repeat(shrink[:, None] * means, self.counts, axis=0)) / np.sqrt(rest))


def ship_designs(response: Response, cells: pd.DataFrame) -> dict[str, ShipDesign]:
    """Ship -> design of the cells that teach a response."""
    ships = response_rows(response, cells).groupby("ship", sort=False)
    return {str(name): ShipDesign.of(response, part) for name, part in ships}


def fit_hierarchy(
    response: Response, ships: Sequence[ShipDesign], start: Hierarchy | None = None, rounds: int = 100
) -> Hierarchy:
    """Fit a response to the cells of many ships by restricted maximum likelihood and Gaussian priors.

    Each round is a step of Gauss and Newton for theta and one of minorisation and maximisation for the variances
    (Zhou et al., Journal of Computational and Graphical Statistics 28 (2019) 350), which never lowers the likelihood:

        s <- s sqrt(r' V^-1 K V^-1 r / tr(P K)),    r = y - mean,    P = V^-1 - V^-1 J C J' V^-1

    start : a fit to begin with. rounds : at most; they end where no standard deviation changes by more than 1 %.
    """
    centre, widths = prior_of(response)
    theta = start.theta if start else centre
    variances = start.variances if start else np.full(len(response.levels), 0.03)
    for _ in range(rounds):
        theta, covariance, factor = _improve(response, ships, theta, variances, centre, np.diag(widths**-2))
        variances = np.maximum(variances * factor, 1e-8)
        if np.abs(np.log(factor[variances > 1e-4])).max(initial=0.0) < 0.02:
            break
    return Hierarchy(response, theta, covariance, variances, len(ships))


def prior_of(response: Response) -> tuple[Array, Array]:
    """Means and standard deviations (P,) of the Gaussian priors of theta."""
    widths = [NARROW if name.split(":")[0] in FLAWS and response.floor else WIDE for name in response.features]
    centre = [CENTRE.get(name, 0.0) * bool(response.floor) for name in response.features]
    centre += [FLOOR_CENTRE.get(name, 0.0) for name in response.floor]
    return np.array(centre), np.array(widths + [WIDE if name in NO_PHYSICS else 1.0 for name in response.floor])


def _improve(
    response: Response, ships: Sequence[ShipDesign], theta: Array, variances: Array, centre: Array, prior: Array
) -> tuple[Array, Array, Array]:
    """Theta after one step, its covariance, and the factors (levels,) of the variances."""
    inner = np.array([level == CELL for level, _ in response.levels])
    rest, normal, right, solved = variances[-1], prior.copy(), prior @ (centre - theta), []
    for ship in ships:
        within = ship.weights @ variances[inner]
        shrink = 1 - np.sqrt(rest / (rest + ship.counts * within))
        mean, jacobian = mean_of_features(theta, ship.features, ship.floor)
        joined = ship.whiten(np.column_stack([ship.effects, jacobian, ship.values - mean]), shrink, rest)
        effects, plain = np.split(joined, [ship.effects.shape[1]], axis=1)
        scaled = effects * np.sqrt(variances[ship.levels])
        root = np.linalg.cholesky(np.eye(scaled.shape[1]) + scaled.T @ scaled)
        taken = np.linalg.solve(root, scaled.T).T
        slopes = plain - taken @ (taken.T @ plain)
        normal += plain[:, :-1].T @ slopes[:, :-1]
        right += slopes[:, :-1].T @ plain[:, -1]
        solved.append((ship, effects, taken, slopes, within, shrink))
    covariance = np.linalg.inv(normal)
    step, spread = np.clip(covariance @ right, -MOST_STEP, MOST_STEP), np.linalg.cholesky(covariance)
    quadratic, trace = np.zeros((2, len(variances)))
    for ship, effects, taken, slopes, within, shrink in solved:
        residual = slopes[:, -1:] - slopes[:, :-1] @ step[:, None]
        taken = np.hstack([taken, slopes[:, :-1] @ spread])
        np.add.at(quadratic, ship.levels, (effects.T @ residual)[:, 0] ** 2)
        np.add.at(trace, ship.levels, (effects**2).sum(axis=0) - ((taken.T @ effects) ** 2).sum(axis=0))
        residual, taken = (ship.whiten(one, shrink, rest) for one in (residual, taken))
        total = rest + ship.counts * within
        quadratic[inner] += ship.weights.T @ ship.sums(residual)[:, 0] ** 2
        trace[inner] += ship.weights.T @ (ship.counts / total - (ship.sums(taken) ** 2).sum(axis=1))
        quadratic[-1] += (residual**2).sum()
        trace[-1] += ((ship.counts - 1 + rest / total) / rest).sum() - (taken**2).sum()
    return theta + step, covariance, np.sqrt(quadratic / trace)


def fit_law(cells: pd.DataFrame) -> ExchangeLaw:
    """Fit the law to the cells of many ships; see `fit_hierarchy`."""
    cells = check_cells(cells)
    parts = {
        name: fit_hierarchy(response, [*ship_designs(response, cells).values()]) for name, response in RESPONSES.items()
    }
    sizes = cells.assign(A=cells["A"] / cells["length"])
    limits = {name: (float(sizes[name].min()), float(sizes[name].max())) for name in LIMITED}
    taught = {"cells": len(cells), "ships": int(cells["ship"].nunique()), "version": __version__}
    return ExchangeLaw(parts, limits, taught)


def save_law(law: ExchangeLaw, file: Path) -> None:
    """Write a law as JSON: of each response theta, covariance, variances and ships, then limits and provenance."""
    parts = {
        name: response_names(part.response)
        | {key: getattr(part, key) for key in ("theta", "covariance", "variances", "ships")}
        for name, part in law.parts.items()
    }
    write_json(file, {"parts": parts, "limits": law.limits, "provenance": law.provenance})
