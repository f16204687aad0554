"""Which number buys H: the share of H that the error of each number of the physics makes, after compensation.

Members of a family differ by the factors of P numbers. An error e of a path is written as g = e / sqrt|e|, whose square
is |e|: one member that goes astray weighs as it does in H, the mean of |e|. To first order the member m has

    g_m = g + sum_k z_mk s_k + rest_m,

with z the standardised factors, so that H, the mean over members, is |g|^2, which all members share (sea, held orders,
method), plus |s_k|^2 of each number, plus the rest (curvature, interaction, training). The parts are variance
components, as of genes in genetics (Yang et al. 2011, American Journal of Human Genetics 88): they follow from the mean
products g_m . g_n of every two members by restricted maximum likelihood (Patterson and Thompson 1971, Biometrika 58),
also where members are fewer than numbers. They have no bound: what is nothing is estimated below 0 as often as above.
Intervals leave out a part of the members in turn (jackknife, Tukey 1958).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from shipid.evidence import ROUNDING, SIGNIFICANT, SMALLEST_ERROR
from shipid.metrics import Array, vector_lengths
from shipid.report.figure import even_places
from shipid.study.results import Results

ROUNDS = 8  # of Fisher scoring: half as many reach the same digits
SMALLEST_REST = 1e-6  # of H, in the weights of the members
MOST_FOLDS = 40  # parts of the members that are left out in turn
LEAST_SHARE = 0.01  # of H, that is worth finding
MOST_WINDOWS = 1000  # test windows, at even distances, whose errors are compared
SHARE_COLUMNS = ["family", "N_D", "members", "needed", "H", "number", "kind", "share", "low", "high"]


def estimate_parts(scores: Array, products: Array) -> Array:
    """Parts (P + 1,) [m] that P numbers and the rest make, by Fisher scoring of the restricted likelihood.

    scores : (M, P) standardised factors of M members. products : (M, M) mean products g_m . g_n [m].
    """
    members, numbers = scores.shape
    H = np.trace(products) / members
    parts = np.full(numbers + 1, H / (numbers + 1))
    for _ in range(ROUNDS):
        rest = max(parts[-1], SMALLEST_REST * H)
        weights = np.linalg.inv((scores * np.maximum(parts[:-1], 0)) @ scores.T + rest * np.eye(members))
        weights -= np.outer(weights.sum(axis=0), weights.sum(axis=0)) / weights.sum()
        basis = weights @ scores
        beside, alone = np.square(basis).sum(axis=0), np.square(weights).sum()
        information = np.block([[np.square(scores.T @ basis), beside[:, None]], [beside[None], alone[None, None]]])
        measured = np.append(np.sum(basis * (products @ basis), axis=0), np.sum(weights @ weights * products))
        size = np.sqrt(np.diag(information) + ROUNDING**2 * information.max())  # 0 of a number that no member changes
        parts = np.linalg.lstsq(information / np.outer(size, size), measured / size, rcond=None)[0] / size
    return np.asarray(parts)


def share_intervals(scores: Array, products: Array, sums: Array) -> tuple[Array, Array, Array]:
    """Shares (K,) of H and the ends of their 95 % intervals, of K sums of P + 2 parts.

    The parts are those of `estimate_parts`, and last what all members share. sums : (K, P + 2) of 0 and 1.
    """

    def sum_parts(kept: Any) -> Array:
        mine = products[np.ix_(kept, kept)]
        parts = estimate_parts(scores[kept], mine) * len(mine) / np.trace(mine)
        return np.asarray(sums @ np.append(parts, 1 - parts.sum()))

    every = np.arange(len(scores))
    folds = np.array_split(every, min(len(every), MOST_FOLDS))
    spread = np.std([sum_parts(np.setdiff1d(every, fold)) for fold in folds], axis=0)
    share, reach = sum_parts(every), stdtrit(len(folds) - 1, 1 - SIGNIFICANT) * np.sqrt(len(folds) - 1) * spread
    return share, share - reach, share + reach


def shares_frame(results: Results) -> pd.DataFrame:
    """Share of H, mean over a family, that the error of each of its numbers makes, at each N_D.

    Columns: family, N_D (0: the physics alone), members, needed (how many might tell at least one number), H [m],
    number (paths that are drawn together are one), kind (`number`; `block`: all numbers of one; `rest`; `common`: what
    all members share; empty where members are too few for any), share [1] with low, high (95 %). Of the method that the
    study judges by; seeds together.

    A share is that of the number's own error, on average over the others. What H of one ship falls by were the number
    right may be more or less: errors of numbers offset each other.
    """
    rows: list[tuple[Any, ...]] = []
    for family, models in results.models.groupby("family", sort=False):
        known = {row["model"]: row["factors"] for row in models.to_dict("records") if "factors" in row}
        for N_D in map(int, (0, *sorted(results.cells["N_D"].unique()))):
            errors = _member_errors(results, [model for model in known if isinstance(known[model], Mapping)], N_D)
            factors = pd.DataFrame({model: known[model] for model in errors}, dtype=float).fillna(1.0)
            factors = factors[factors.nunique(axis=1) > 1]
            if len(factors) and np.any([*errors.values()]):  # exact physics has no error to share out
                rows += [(family, N_D, *row) for row in _family_rows(factors, np.array([*errors.values()]))]
    return pd.DataFrame(rows, columns=SHARE_COLUMNS)


def _member_errors(results: Results, models: Sequence[str], N_D: int) -> dict[str, Array]:
    """Model -> g [m^1/2] over windows and draws of runs; what lacks a draw or a finite path is left out."""
    cells, true = results.judged_cells, results.test.future
    mine = cells[cells["N_D"].eq(N_D) & cells["status"].eq("ok")].groupby("model")["cell"]
    found = {str(model): [results.paths[cell] for cell in drawn] for model, drawn in mine if model in models}
    found = found if N_D else {model: [results.physics[model]] for model in models if model in results.physics}
    draws, windows = max(map(len, found.values()), default=0), even_places(true.shape[1], MOST_WINDOWS)
    result = {}
    for model, paths in found.items():
        errors = np.array([(path - true)[:, windows] for path in paths])
        if len(paths) == draws and np.isfinite(errors).all():
            size = np.maximum(vector_lengths(errors), SMALLEST_ERROR)
            result[model] = (errors / np.sqrt(size.size * size[..., None])).ravel()
    return result


def _family_rows(factors: pd.DataFrame, errors: Array) -> list[tuple[Any, ...]]:
    """Rows of one family at one amount, from `members` on; factors (paths, members), errors (members, points)."""
    drawn, products = factors.drop_duplicates(), errors @ errors.T
    names = [", ".join(factors.index[factors.eq(row).all(axis=1)]) for _, row in drawn.iterrows()]
    numbers, members = drawn.shape
    H = float(np.trace(products)) / members
    if members * (members - 1) < 4 * (numbers + 1):  # half the pairs against the parts
        return [(members, 2 * (numbers + 1), H, "cannot be told", "", *[np.nan] * 3)]
    blocks = pd.Series([name.partition(".")[0] for name in names])
    several = blocks.value_counts(sort=False).loc[lambda counts: counts > 1].index
    each = np.eye(numbers + 2)
    sums = np.vstack([each[:numbers], *(np.append(blocks.eq(name), [0, 0]) for name in several), each[numbers:]])
    deviations = (drawn.T - drawn.mean(axis=1)) / drawn.std(axis=1)
    share, low, high = share_intervals(deviations.to_numpy(), products, sums)
    width = (share - low)[:numbers] / np.maximum(share[:numbers], LEAST_SHARE)  # below 1: told apart from 0
    needed = int(np.ceil(members * max(1.0, width.min()) ** 2))
    kinds = ["number"] * numbers + ["block"] * len(several) + ["rest", "common"]
    names += [*several, "the rest", "what all members share"]
    return [(members, needed, H, *row) for row in zip(names, kinds, share, low, high, strict=True)]
