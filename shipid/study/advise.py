"""From results to words: the answer in sentences, and verdicts on the findings of the paper, each with its numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd

from shipid.metrics import over_horizon, position_error
from shipid.study.plan import NO_MODEL
from shipid.study.results import Results, naive_summary

CLAIMS = {
    "R1": "compensation beats its own physics model, accurate or not",
    "R2": "the inaccurate model, compensated, is about as good as the accurate physics alone",
    "R3": "the gap between accurate and inaccurate physics shrinks after compensation",
    "R4": "pure data-driven prediction is worst over the whole horizon",
}
ABOUT = 0.10  # R2: "about as good" means a mean error at most 10 % above


def by_model(results: Results) -> pd.DataFrame:
    """Mean over seeds of A, H, H_90 [m] per model and N_D, with the spread of H over seeds; failed cells left out."""
    good = results.cells[results.cells["status"] == "ok"]
    grouped = good.groupby(["model", "kind", "N_D"], sort=False)
    frame = grouped.agg(
        A=("A", "mean"),
        H=("H", "mean"),
        H_90=("H_90", "mean"),
        rms=("rms", "mean"),
        low=("H", "min"),
        high=("H", "max"),
        seeds=("H", "size"),
    )
    return frame.reset_index()


def answer(results: Results) -> list[tuple[str, str]]:
    """Three to five sentences built from the results, each with the anchor of the figure that carries it."""
    table = by_model(results)
    ahead = results.test.horizon * results.test.step
    sentences = []
    if not results.complete:
        missing = results.plan.cells - len(results.cells)
        sentences.append(
            (f"{missing} of {results.plan.cells} cells are not finished: what follows is provisional.", "cells")
        )
    largest = int(table["N_D"].max()) if len(table) else 0
    top = table[table["N_D"] == largest]
    physics = top[top["kind"] != NO_MODEL]
    if physics.empty:
        return [*sentences, ("No cell with physics has finished, so nothing can be said yet.", "cells")]
    best = physics.iloc[int(physics["H"].argmin())]
    sentences.append(
        (
            f"With {largest} runs, {best['model']} (mean error {_m(best['A'])} on its own) predicts {ahead:g} s ahead with "
            f"{_m(best['H'])} mean error{_range(best)}; nine errors in ten are below {_m(best['H_90'])}.",
            "gain",
        )
    )
    pure = table[table["kind"] == NO_MODEL].set_index("N_D")
    if len(pure):
        sentences.append((_worth(table, pure, best), "gain"))
        harming = [row for _, row in physics.iterrows() if largest in pure.index and row["H"] > pure.loc[largest, "H"]]
        harmed = ", ".join(str(row["model"]) for row in harming)
        text = f"At {largest} runs {harmed} {'does' if len(harming) == 1 else 'do'} worse than no physics at all."
        smallest = int(table["N_D"].min())
        low = table[(table["N_D"] == smallest) & (table["kind"] != NO_MODEL)]
        beaten = [
            str(r["model"]) for _, r in low.iterrows() if smallest in pure.index and r["H"] > pure.loc[smallest, "H"]
        ]
        if not harming:
            text = f"At {largest} runs every physics model does better than none."
            if beaten and smallest != largest:
                text = (
                    f"At {smallest} runs {', '.join(beaten)} {'harms' if len(beaten) == 1 else 'harm'}: no physics at all "
                    f"does better; at {largest} runs every physics model does better than none."
                )
        sentences.append((text, "gain"))
    gains = physics["H"] / physics["A"]
    sentences.append(
        (
            f"Compensation with {largest} runs leaves {gains.min():.0%} to {gains.max():.0%} of the error of physics alone "
            f"(over {len(physics)} models).",
            "horizon",
        )
    )
    floor = naive_summary(results)["mean"]
    worse = top[top["H"] >= floor]
    beats = "every model beats it" if worse.empty else f"{', '.join(worse['model'])} do not beat it"
    sentences.append((f"Keeping u, v and r constant gives {_m(floor)}: at {largest} runs {beats}.", "gain"))
    return sentences


def _worth(table: pd.DataFrame, pure: pd.DataFrame, best: pd.Series) -> str:
    """How many runs pure data-driven needs for what the best physics does with the fewest."""
    fewest = int(table["N_D"].min())
    first = table[(table["model"] == best["model"]) & (table["N_D"] == fewest)]
    if first.empty:
        return "The best model has no result at the smallest amount of data, so its worth in runs cannot be told."
    level = float(first["H"].iloc[0])
    enough = pure[pure["H"] <= level]
    here = f"with {fewest} runs {best['model']} has {_m(level)}"
    if len(pure) == 1:
        return f"Without physics, {fewest} runs give {_m(float(pure['H'].iloc[0]))}, where {here}."
    if enough.empty:
        last = int(pure.index.max())
        return f"Without physics even {last} runs give {_m(float(pure['H'].loc[last]))}, where {here}."
    return f"Without physics it takes {int(enough.index.min())} runs to do as well: {here}."


def findings(results: Results) -> list[dict[str, str]]:
    """Verdicts on R1-R4 (method, section 5) at the largest amount of data; empty where the study makes no claims."""
    claims = results.plan.study.claims
    if claims is None:
        return []
    table = by_model(results)
    if table.empty:
        return []
    top = table[table["N_D"] == table["N_D"].max()].set_index("kind")
    needed = (claims.accurate, claims.inaccurate, NO_MODEL)
    if any(name not in top.index for name in needed):
        return [_finding(key, "undecided", "a cell that it needs has failed or is missing") for key in CLAIMS]
    good, bad = top.loc[claims.accurate], top.loc[claims.inaccurate]
    physics = top[top.index != NO_MODEL]
    gap_before, gap_after = abs(bad["A"] - good["A"]), abs(bad["H"] - good["H"])
    pairs = "; ".join(f"{row['model']} {_m(row['A'])} -> {_m(row['H'])}{_range(row)}" for _, row in physics.iterrows())
    worst, share = _worst_share(results, int(table["N_D"].max()))
    return [
        _finding(
            "R1",
            _verdict(bool((physics["high"] < physics["A"]).all()), bool((physics["H"] < physics["A"]).all())),
            pairs,
        ),
        _finding(
            "R2",
            _verdict(bad["high"] <= (1 + ABOUT) * good["A"], bad["H"] <= (1 + ABOUT) * good["A"]),
            f"inaccurate and compensated {_m(bad['H'])}{_range(bad)}, accurate alone {_m(good['A'])}",
        ),
        _finding(
            "R3",
            _verdict(gap_after < gap_before, gap_after < gap_before),
            f"gap {_m(gap_before)} before, {_m(gap_after)} after",
        ),
        _finding(
            "R4",
            _verdict(share == 1.0, share > 0.5),
            f"pure data-driven is worst at {share:.0%} of the steps, physics alone included; most often worst: {worst}",
        ),
    ]


def _worst_share(results: Results, N_D: int) -> tuple[str, float]:
    """Which predictor, physics alone included, is most often worst over the horizon; share of steps where `none` is."""
    curves: dict[str, list[np.ndarray]] = {}
    for row in results.cells[results.cells["N_D"] == N_D].itertuples():
        if row.cell in results.paths:
            error = position_error(results.paths[str(row.cell)], results.test.future)
            curves.setdefault(str(row.model), []).append(over_horizon(error)["mean"])
    for model, path in results.physics.items():
        if model != NO_MODEL and np.isfinite(path).all():
            error = position_error(path, results.test.future)
            curves[f"{model} alone"] = [over_horizon(error)["mean"]]
    names = list(curves)
    worst = np.argmax([np.mean(curves[name], axis=0) for name in names], axis=0)
    counts = np.bincount(worst, minlength=len(names))
    share = float(counts[names.index(NO_MODEL)] / counts.sum()) if NO_MODEL in names else 0.0
    return names[int(np.argmax(counts))], share


def _verdict(always: bool, on_average: bool) -> str:
    """Confirmed if it holds for every seed, undecided if only on average, else refuted."""
    return "confirmed" if always else "undecided" if on_average else "refuted"


def _finding(key: str, verdict: str, evidence: str) -> dict[str, str]:
    return {"id": key, "claim": CLAIMS[key], "verdict": verdict, "evidence": evidence}


def _m(value: float) -> str:
    return f"{value:.2f} m" if value < 10 else f"{value:.1f} m"


def _range(row: pd.Series) -> str:
    return f" [{row['low']:.2f}, {row['high']:.2f}] over {int(row['seeds'])} seeds" if row["seeds"] > 1 else ""
