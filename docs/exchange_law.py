"""The law of exchange: fitted, and judged on ships and on types of ships that it has not seen.

`python docs/exchange_law.py CELLS --write` fits the law to the cells of
`docs/exchange_ships.py` and writes the file that comes with shipid;
`--figure` draws its picture. Without them it judges: `python docs/records.py exchange-law python docs/exchange_law.py
CELLS`. Every ship, and every type, is left out in turn: the law is fitted anew to the others.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from exchange_fit import fit_hierarchy, fit_law, save_law, ship_designs
from pictures import IMAGES, svg
from scipy.stats import t as student

from shipid import read_results
from shipid.exchange.expect import study_cells
from shipid.exchange.law import (
    FLAWS,
    LAW_FILE,
    NO_PHYSICS,
    RESPONSES,
    ExchangeLaw,
    Hierarchy,
    Response,
    UnseenShip,
    check_cells,
    feature_columns,
    response_rows,
    response_values,
)

FORM = RESPONSES["H"]
NEAREST = ("length", "froude")
SEARCH_ROWS, GAUSSIAN_ROWS = 400, 1000  # of a Gaussian process: its price grows with the cube
FORM_AHEAD = 2.0  # ship lengths
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


def foretell_begun(law: ExchangeLaw, rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Error and half of the 95 % interval (cells,) of ln H at later amounts, the first and no floor given.

    As of a study of a real ship, of which nobody knows the true physics; two ship lengths ahead.
    """
    rows = rows[(rows["ahead"] == FORM_AHEAD) & (rows["kind"] != "nominal")]
    amounts = sorted(rows["N_D"].unique())
    own, one = rows[rows["N_D"].isin(amounts[:FIRST])].assign(floor=np.nan), rows.iloc[0]
    later = rows[rows["foundation"].isin(own["foundation"])].pivot(index="foundation", columns="N_D", values="H")
    ship = UnseenShip(one["length"], one["speed"], one["baseline"])
    draws = law.given(own).expect_all(ship, [*later.index], amounts[FIRST:], FORM_AHEAD, 2000)
    low, middle, high = np.log(np.quantile(draws, [0.025, 0.5, 0.975], axis=0))
    known = np.log(later[amounts[FIRST:]].to_numpy())
    held = np.isfinite(known)
    return (known - middle)[held], ((high - low) / 2)[held]


def score(error: np.ndarray, inside: np.ndarray) -> list[str]:
    """Of ln ratios (cells,): median factor, bias as a factor, and the share of cells inside."""
    return [f"{np.exp(np.median(np.abs(error))):.2f}", f"{np.exp(error.mean()):.2f}", f"{100 * inside.mean():.1f}"]


class GaussianProcess:
    """A Gaussian process over the numbers that the law has; its length scales are fitted once, to all ships."""

    names = ("n", "a", "p", "h", "none", "froude", "size", *FLAWS)

    def __init__(self, cells: pd.DataFrame) -> None:
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

        kernel = ConstantKernel() * RBF(np.ones(len(self.names)), (0.1, 1e3)) + WhiteKernel(0.05)
        self.kernel = self._fit(cells, SEARCH_ROWS, kernel=kernel).kernel_

    def _fit(self, cells: pd.DataFrame, most: int, **options: object) -> object:
        from sklearn.gaussian_process import GaussianProcessRegressor

        rows = response_rows(FORM, cells)
        rows = rows.sample(min(most, len(rows)), random_state=0)
        process = GaussianProcessRegressor(normalize_y=True, **options)
        return process.fit(feature_columns(rows, self.names), response_values(FORM, rows))

    def foretell(self, others: pd.DataFrame, rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
        """Mean and half of the 95 % interval (rows,) of ln(H / baseline), from the cells of other ships."""
        process = self._fit(others, GAUSSIAN_ROWS, kernel=self.kernel, optimizer=None)
        mean, spread = process.predict(feature_columns(rows, self.names), return_std=True)
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


def judge(cells: pd.DataFrame, law: ExchangeLaw) -> None:
    """Print how well ships and types that were left out are foretold, by the law and its rivals."""
    linear, rows_of = (
        FORM._replace(features=(*FORM.features, "p", "p:n", *NO_PHYSICS), floor=()),
        dict(tuple(response_rows(FORM, cells).groupby("ship", sort=False))),
    )
    forms = {name: one.response for name, one in law.parts.items()}
    designs = {form: ship_designs(form, cells) for form in (*forms.values(), linear)}
    starts = {form: law.parts[name] for name, form in forms.items()}
    starts[linear] = fit_hierarchy(linear, [*designs[linear].values()])
    scores: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    gains: dict[str, list[np.ndarray]] = {}  # log scores, larger is better, less a constant
    table, inside_biases, process = [], [], GaussianProcess(cells)

    def fit_without(form: Response, absent: set[str]) -> Hierarchy:
        return fit_hierarchy(form, [one for name, one in designs[form].items() if name not in absent], starts[form], 2)

    def note(name: str, error: np.ndarray, half: np.ndarray) -> None:
        spread = half / 1.96
        gains.setdefault(name, []).append(-np.log(spread) - (error / spread) ** 2 / 2)
        scores.setdefault(name, []).append((error, np.where(np.isnan(half), np.nan, np.abs(error) <= half)))

    for ship, rows in rows_of.items():
        value, one, others = response_values(FORM, rows), fit_without(FORM, {ship}), cells[cells["ship"] != ship]
        mean, half, of_mean = interval_of(one, rows)
        error = value - mean
        note("law, each ship left out", error, half)
        inside_biases.append(abs(error.mean()) <= of_mean)
        table.append([ship, str(rows["type"].iloc[0]), f"{rows['length'].iloc[0]:.3g}",
                      *score(error, np.abs(error) <= half), "yes" if inside_biases[-1] else "no"])  # fmt: skip
        mean, half, _ = interval_of(fit_without(linear, {ship}), rows)
        note("mixed model without a floor", value - mean, half)
        mean, half = process.foretell(others, rows)
        note("Gaussian process", value - mean, half)
        note("curve of the nearest ship", value - nearest_curve(others, rows), np.full(len(rows), np.nan))
        first = rows["N_D"].isin(sorted(rows["N_D"].unique())[:FIRST])
        mean, half, _ = interval_of(one, rows[~first], rows[first])
        note("law, first three amounts given", value[~first] - mean, half)
        begun = replace(law, parts={name: fit_without(form, {ship}) for name, form in forms.items()} | {"H": one})
        note("law, first three amounts given, floor not known", *foretell_begun(begun, rows))
    for _, group in cells.groupby("type"):
        absent = {*group["ship"]}
        one = fit_without(FORM, absent)
        for ship in absent & {*rows_of}:
            mean, half, _ = interval_of(one, rows_of[ship])
            note("law, each type left out", response_values(FORM, rows_of[ship]) - mean, half)
    print("| foretold | median factor | bias | median bias of a ship | inside 95 % | log score |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for name, parts in scores.items():
        factor, bias, held = score(*(np.concatenate([part[k] for part in parts]) for k in (0, 1)))
        typical = np.exp(np.median([abs(part[0].mean()) for part in parts]))
        print(f"| {name} | {factor} | {bias} | {typical:.2f} | {held} | {np.concatenate(gains[name]).mean():.2f} |")
    print(f"\nThe bias of a ship lies inside its interval for {sum(inside_biases)} of {len(inside_biases)} ships.\n")
    print("| ship left out | type | length [m] | median factor | bias | inside 95 % | bias inside |")
    print("| --- | --- | ---: | ---: | ---: | ---: | --- |")
    for row in table:
        print(f"| {' | '.join(row)} |")


def print_kinds(part: Hierarchy) -> None:
    """Print H for each kind of error over the mean of four kinds, where A is the baseline and the floor a third of it.

    Two ship lengths ahead; 95 % intervals over ships.
    """
    print(
        "\nH for each kind over the mean of damping, mass, thrust and missing, at equal A (the baseline), 2 lengths:\n"
    )
    print("| what is wrong | 2 runs | 8 runs | 32 runs |\n| --- | ---: | ---: | ---: |")
    same = {"A": 1.0, "baseline": 1.0, "floor": 1 / 3, "ahead": 2.0, "froude": 0.2, "length": 50.0}
    texts: dict[str, list[str]] = {kind: [] for kind in FLAWS}
    for runs in (2, 8, 32):
        mean, jacobian = part.mean(pd.DataFrame([{"kind": kind, "N_D": runs, **same} for kind in FLAWS]))
        four = [FLAWS.index(kind) for kind in ("damping", "mass", "thrust", "missing")]
        mean, jacobian = mean - mean[four].mean(), jacobian - jacobian[four].mean(axis=0)
        errors = 1.96 * np.sqrt(np.einsum("ij,jk,ik->i", jacobian, part.covariance, jacobian))
        for kind, value, error in zip(FLAWS, mean, errors, strict=True):
            texts[kind].append("{:.2f} [{:.2f}, {:.2f}]".format(*np.exp([value, value - error, value + error])))
    for kind, row in texts.items():
        print(f"| {kind} | {' | '.join(row)} |")


def print_unseen(law: ExchangeLaw, folders: list[Path]) -> None:
    """Print H of recorded ships, which taught the law nothing, beside what it expects of their A and baseline."""
    print("\n| recorded | physics | A [m] | runs | H [m] | expected | 95 % | inside |")
    print("| --- | --- | ---: | ---: | ---: | ---: | --- | --- |")
    totals = []
    for folder in folders:
        inside = []
        results = read_results(folder)
        cells, ship = study_cells(results)
        cells = cells[~cells["family"].isin(results.saw_test)]
        for name, rows in cells.groupby("foundation", sort=False):
            kind, error = rows[["kind", "A"]].iloc[0]
            physics = error if kind == "" else (kind, error)
            draws = law.expect(ship, physics, [*rows["N_D"]], float(rows["ahead"].iloc[0]), 1000)
            for row, (low, middle, high) in zip(
                rows.to_dict("records"), np.quantile(draws, [0.025, 0.5, 0.975], axis=0).T, strict=True
            ):
                inside.append(low <= row["H"] <= high)
                words = f"{row['H']:.3g} | {middle:.2g} | {low:.2g} to {high:.2g} | {'yes' if inside[-1] else 'no'}"
                print(f"| {folder.name} | {name} | {error:.3g} | {row['N_D']} | {words} |")
        totals.append(f"{folder.name}, inside: {sum(inside)} of {len(inside)}")
    print("\n" + "\n".join(totals))


def law_figure(cells: pd.DataFrame, part: Hierarchy) -> go.Figure:
    """H over the baseline against runs, 2 ship lengths ahead: each ship, and the law at the median A and floor."""
    figure, inks = go.Figure(), {"nominal": "#2a7", "moderate": "#27c", "template": "#c72", "none": "#777"}
    rows = response_rows(FORM, cells[(cells["ahead"] == 2.0) & cells["kind"].isin(inks)])
    rows = rows.assign(
        share=rows["H"] / rows["baseline"], A=rows["A"] / rows["baseline"], floor=rows["floor"] / rows["baseline"]
    )
    for kind, mine in rows.groupby("kind"):
        place = mine["N_D"] * 1.04 ** (list(inks).index(str(kind)) - 1.5)
        dots = {"color": inks[str(kind)], "size": 4, "opacity": 0.4}
        figure.add_scatter(x=place, y=mine["share"], mode="markers", marker=dots, showlegend=False)
        amounts = np.geomspace(1, 64, 30)
        same = {"kind": kind, "A": mine["A"].median(), "floor": mine["floor"].median(), "baseline": 1.0, "ahead": 2.0}
        line = pd.DataFrame({"N_D": amounts, **same, "length": 50.0, "froude": 0.2})
        figure.add_scatter(
            x=amounts, y=np.exp(part.mean(line)[0]), name=str(kind), line={"color": inks[str(kind)], "width": 3}
        )
    figure.update_xaxes(type="log", title="runs", tickvals=[1, 2, 4, 8, 16, 32, 64])
    figure.update_yaxes(type="log", title="H / error of constant u, v, r", range=[-1.2, 0.8])
    words = "Dots: ships. Lines: the law at the median A and floor of the kind."
    return figure.update_layout(
        template="plotly_white", title=f"Two ship lengths ahead<br><sup>{words}</sup>", width=760
    )


def main() -> None:
    """Fit the law and write it, or judge it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cells", type=Path)
    parser.add_argument("--write", action="store_true", help="write the law that comes with shipid")
    parser.add_argument("--unseen", type=Path, nargs="*", help="folders of studies of recorded ships")
    parser.add_argument("--figure", action="store_true", help="draw the picture of the page")
    given = parser.parse_args()
    warnings.filterwarnings("ignore", module="sklearn")
    cells = check_cells(pd.read_csv(given.cells), given.cells)
    law = fit_law(cells)
    digest = hashlib.sha256(given.cells.read_bytes()).hexdigest()[:12]
    command = f"python docs/exchange_law.py {given.cells.name} --write"
    provenance = {**law.provenance, "digest": digest, "date": datetime.date.today().isoformat(), "command": command}
    if given.write:
        save_law(replace(law, provenance=provenance), LAW_FILE)
        return
    part = law.parts["H"]
    if given.figure:
        (IMAGES / "exchange-law.svg").write_text(svg(law_figure(cells, part)), encoding="utf-8")
        return
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
    if given.unseen:
        print_unseen(law, given.unseen)
    print(flush=True)
    judge(cells, law)


if __name__ == "__main__":
    main()
