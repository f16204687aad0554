"""The law of exchange: fitted, and judged on ships and on types of ships that it has not seen.

`python docs/exchange_law.py CELLS --write` fits the law to a table of cells and writes the file that comes with shipid;
without `--write` it judges: `python docs/records.py exchange-law python docs/exchange_law.py CELLS`. Every ship, and
every type, is left out in turn: the law is fitted anew to the others.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import t as student

from shipid import __version__
from shipid.exchange.cells import read_cell_table
from shipid.exchange.law import (
    FLAWS,
    LAW_FILE,
    RESPONSES,
    Hierarchy,
    feature_columns,
    fit_hierarchy,
    fit_law,
    response_rows,
    response_values,
    save_law,
)

FORM = RESPONSES["H"]
NEAREST = ("length", "froude")
GAUSSIAN_ROWS = 1200  # of a Gaussian process: its price grows with the cube
FIRST = 3  # amounts that are given before the others are foretold


def interval_of(part: Hierarchy, rows: pd.DataFrame, known: pd.DataFrame | None = None) -> tuple[np.ndarray, ...]:
    """Mean and half of the 95 % interval (rows,) of ln(H / baseline), and those of the mean over rows."""
    rng = np.random.default_rng(0)
    mean, jacobian = part.mean(rows)
    if known is None:
        spread, half = part.spread(rows, jacobian), float(student.ppf(0.975, part.freedom))
        return mean, half * np.sqrt(np.diag(spread)), half * np.sqrt(spread.mean())
    low, middle, high = np.quantile(part.deviations(rows, 2000, rng, known), [0.025, 0.5, 0.975], axis=0)
    return mean + middle, (high - low) / 2, np.array(np.nan)


def left_out(cells: pd.DataFrame, column: str) -> Iterator[tuple[str, pd.DataFrame, pd.DataFrame]]:
    """Each ship, or type: its name, the cells of the others and its own, with runs."""
    for name in pd.unique(cells[column]):
        mine = cells[column] == name
        yield str(name), cells[~mine], response_rows(FORM, cells[mine])


def score(error: np.ndarray, inside: np.ndarray) -> list[str]:
    """Of ln ratios (cells,): median factor, bias as a factor, and the share of cells inside."""
    return [f"{np.exp(np.median(np.abs(error))):.2f}", f"{np.exp(error.mean()):.2f}", f"{100 * inside.mean():.1f}"]


def linear_form() -> object:
    """The rival: the same effects, no floor beside them."""
    return FORM._replace(floor=())


def gaussian_process(train: pd.DataFrame, rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Mean and half of the 95 % interval of a Gaussian process over the numbers that the law has."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    names = ["n", "a", "p", "h", "none", "froude", "size", *FLAWS]
    train = response_rows(FORM, train)
    train = train.sample(min(GAUSSIAN_ROWS, len(train)), random_state=0)
    inputs, asked = feature_columns(train, names), feature_columns(rows, names)
    values = response_values(FORM, train)
    kernel = ConstantKernel() * RBF(np.ones(len(names)), (0.1, 1e3)) + WhiteKernel(0.05)
    process = GaussianProcessRegressor(kernel, normalize_y=True).fit(inputs, values)
    mean, spread = process.predict(asked, return_std=True)
    return mean, 1.96 * spread


def nearest_curve(train: pd.DataFrame, rows: pd.DataFrame) -> np.ndarray:
    """ln(H / baseline) of the nearest ship at the same amount and horizon, of its foundation with the nearest A."""
    train = response_rows(FORM, train)
    places = np.log(train.drop_duplicates("ship").set_index("ship")[[*NEAREST]])
    apart = ((places - np.log(rows[[*NEAREST]].iloc[0])) / places.std()) ** 2
    other = train[train["ship"] == apart.sum(axis=1).idxmin()]
    values, known = response_values(FORM, other), feature_columns(other, ["n", "h", "a", "none"])
    asked = feature_columns(rows, ["n", "h", "a", "none"])
    weights = np.array([100.0, 100.0, 1.0, 10.0])
    return values[[int((((known - one) * weights) ** 2).sum(axis=1).argmin()) for one in asked]]


def judge(cells: pd.DataFrame, start: dict[str, Hierarchy]) -> None:
    """Print how well ships and types that were left out are foretold, by the law and its rivals."""
    scores: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    rows_of_ships, biases = [], []
    for column in ("ship", "type"):
        for name, others, mine in left_out(cells, column):
            part = fit_hierarchy(FORM, others, start["law"], 5)
            for ship, rows in mine.groupby("ship"):
                value = response_values(FORM, rows)
                mean, half, of_mean = interval_of(part, rows)
                error = value - mean
                scores.setdefault(f"law, {column} left out", []).append((error, np.abs(error) <= half))
                if column == "type":
                    continue
                inside = abs(error.mean()) <= of_mean
                biases.append(inside)
                rows_of_ships.append([str(ship), str(rows["type"].iloc[0]), f"{rows['length'].iloc[0]:.3g}",
                                      *score(error, np.abs(error) <= half), "yes" if inside else "no"])  # fmt: skip
                line = fit_hierarchy(linear_form(), others, start["linear"], 5)
                mean, half, _ = interval_of(line, rows)
                scores.setdefault("mixed model without a floor", []).append(
                    (value - mean, np.abs(value - mean) <= half)
                )
                mean, half = gaussian_process(others, rows)
                scores.setdefault("Gaussian process", []).append((value - mean, np.abs(value - mean) <= half))
                error = value - nearest_curve(others, rows)
                scores.setdefault("curve of the nearest ship", []).append((error, np.full(len(error), np.nan)))
                amounts = sorted(rows["N_D"].unique())
                known, later = rows[rows["N_D"].isin(amounts[:FIRST])], rows[rows["N_D"].isin(amounts[FIRST:])]
                mean, half, _ = interval_of(part, later, known)
                error = response_values(FORM, later) - mean
                scores.setdefault("law, first three amounts given", []).append((error, np.abs(error) <= half))
                _ = name
    print("| foretold | median factor | bias | ships' median bias | inside 95 % |\n| --- | ---: | ---: | ---: | ---: |")
    for name, parts in scores.items():
        error, inside = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
        typical = np.exp(np.median([abs(part[0].mean()) for part in parts]))
        factor, bias, held = score(error, inside)
        print(f"| {name} | {factor} | {bias} | {typical:.2f} | {held} |")
    print(f"\nThe bias of a ship lies inside its interval for {sum(biases)} of {len(biases)} ships.\n")
    print("| ship left out | type | length [m] | median factor | bias | inside 95 % | bias inside |")
    print("| --- | --- | ---: | ---: | ---: | ---: | --- |")
    for row in rows_of_ships:
        print(f"| {' | '.join(row)} |")


def print_kinds(part: Hierarchy) -> None:
    """Print how much larger H is at equal A for each kind of error, against the mean of four kinds, with 95 %."""
    four = ("damping", "mass", "thrust", "missing")
    print("\n| what is wrong | 2 runs | 8 runs | 32 runs |\n| --- | ---: | ---: | ---: |")
    for kind in FLAWS:
        texts = []
        for runs in (2, 8, 32):
            weights = np.zeros(len(part.theta))
            for name, weight in [(kind, 1.0), *((one, -1 / len(four)) for one in four)]:
                weights[FORM.features.index(name)] += weight
                weights[FORM.features.index(f"{name}:n")] += weight * np.log(runs / 8)
            value, error = weights @ part.theta, np.sqrt(weights @ part.covariance @ weights)
            low, high = value - 1.96 * error, value + 1.96 * error
            texts.append(f"{np.exp(value):.2f} [{np.exp(low):.2f}, {np.exp(high):.2f}]")
        print(f"| {kind} | {' | '.join(texts)} |")


def main() -> None:
    """Fit the law and write it, or judge it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cells", type=Path)
    parser.add_argument("--write", action="store_true", help="write the law that comes with shipid")
    given = parser.parse_args()
    warnings.filterwarnings("ignore", module="sklearn")
    cells = read_cell_table(given.cells)
    law = fit_law(cells)
    digest = hashlib.sha256(given.cells.read_bytes()).hexdigest()[:12]
    provenance = {
        "cells": len(cells), "ships": int(cells["ship"].nunique()), "digest": digest, "version": __version__,
        "date": datetime.date.today().isoformat(), "command": f"python docs/exchange_law.py {given.cells.name} --write",
    }  # fmt: skip
    if given.write:
        save_law(replace(law, provenance=provenance), LAW_FILE)
        return
    part = law.parts["H"]
    print(f"{provenance['cells']} cells of {provenance['ships']} ships, digest {digest}\n")
    print("| feature | theta | error |\n| --- | ---: | ---: |")
    for name, value, error in zip(
        [*FORM.features, *(f"floor: {one}" for one in FORM.floor)],
        part.theta,
        np.sqrt(np.diag(part.covariance)),
        strict=True,
    ):
        print(f"| {name} | {value:.3f} | {error:.3f} |")
    print("\n| level | feature | standard deviation |\n| --- | --- | ---: |")
    for (level, feature), variance in zip(FORM.levels, part.variances, strict=True):
        print(f"| {level} | {feature} | {np.sqrt(variance):.3f} |")
    print_kinds(part)
    print()
    judge(cells, {"law": part, "linear": fit_hierarchy(linear_form(), cells)})


if __name__ == "__main__":
    main()
