"""From results to words: the answer in sentences, and verdicts on the findings of the paper, each with its numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd

from shipid.metrics import over_horizon, position_error
from shipid.study.plan import NO_MODEL, Claims
from shipid.study.results import Results, naive_summary

CLAIMS = {
    "R1": "compensation beats its own physics model, accurate or not",
    "R2": "the inaccurate model, compensated, is about as good as the accurate physics alone",
    "R3": "the gap between accurate and inaccurate physics shrinks after compensation",
    "R4": "pure data-driven prediction is worst over the whole horizon",
}
ABOUT = 0.10  # R2: "about as good" means a mean error at most 10 % above


def by_model(results: Results) -> pd.DataFrame:
    """Mean over seeds of A, H, H_90 [m] and validation loss [m^2] per model and N_D, with the spread of H over seeds.

    Failed cells are left out.
    """
    loss = [
        min((t["value"] for t in trials if t["value"] is not None), default=np.nan)
        for trials in results.cells["trials"]
    ]
    good = results.cells.assign(loss=loss)[results.cells["status"] == "ok"]
    grouped = good.groupby(["model", "kind", "N_D"], sort=False)
    frame = grouped.agg(
        A=("A", "mean"),
        H=("H", "mean"),
        H_90=("H_90", "mean"),
        rms=("rms", "mean"),
        low=("H", "min"),
        high=("H", "max"),
        seeds=("H", "size"),
        loss=("loss", "mean"),
    )
    return frame.reset_index()


def answer(results: Results) -> list[tuple[str, str]]:
    """Four to eight sentences built from the results, each with the anchor of the figure that carries it."""
    claims = results.plan.study.claims
    table = by_model(results)
    table = table[~table["kind"].isin(claims.aside if claims else [])]
    sentences = [(text, "cells") for text in _caveats(results)]
    largest = int(table["N_D"].max()) if len(table) else 0
    top = table[table["N_D"] == largest]
    physics = top[top["kind"] != NO_MODEL]
    if physics.empty:
        where = f" at {largest} runs" if largest else ""
        return [*sentences, (f"No cell with physics has a result{where}, so nothing can be said yet.", "cells")]
    best = physics.iloc[int(physics["loss"].argmin())]  # chosen by validation, never by the test
    sentences.append((_headline(best, largest, results.test.horizon * results.test.step), "gain"))
    pure = table[table["kind"] == NO_MODEL].set_index("N_D")
    if len(pure):
        failed = results.cells[(results.cells["status"] != "ok") & (results.cells["kind"] != NO_MODEL)]
        every = "every physics model" + (" with a result" if len(failed) else "")
        sentences += [(_worth(table, pure, best), "gain"), (_harm(table, pure, every), "gain")]
    known = physics[physics["A"] > 0]  # an exact model has no error that could be left
    if len(known):
        left = known["H"] / known["A"]
        text = (
            f"Compensation with {largest} runs leaves {left.min():.0%} to {left.max():.0%} of the error of physics "
            f"alone (over {len(known)} model{'s' * (len(known) > 1)})."
        )
        sentences.append((text, "horizon"))
    if harmed := _alone(physics):
        sentences.append((harmed, "gain"))
    if trend := _trend(table):
        sentences.append((trend, "gain"))
    return [*sentences, (_floor(top, largest, naive_summary(results)["mean"]), "gain")]


def _headline(best: pd.Series, largest: int, ahead: float) -> str:
    """What the model that validation prefers does at the largest amount of data."""
    return (
        f"With {largest} runs, {best['model']} (best in validation; {_m(best['A'])} mean error on its own) predicts "
        f"{ahead:g} s ahead with {_m(best['H'])} mean error{_range(best)}; nine errors in ten are below "
        f"{_m(best['H_90'])}."
    )


def _caveats(results: Results) -> list[str]:
    """What limits every sentence that follows: cells that are missing, and cells without a result."""
    found, cells = [], results.cells
    if not results.complete:
        missing = results.plan.cells - len(cells)
        found.append(f"{missing} of {results.plan.cells} cells are not finished: what follows is provisional.")
    failed = cells[cells["status"] != "ok"]
    if len(failed):
        why = "; ".join(
            f"{_words(str(row.model))}: {row.sentence}" for row in failed.drop_duplicates("model").itertuples()
        )
        found.append(f"{len(failed)} of {len(cells)} cells have no result ({why}).")
    return found


def _harm(table: pd.DataFrame, pure: pd.DataFrame, every: str) -> str:
    """Which physics models do no better than none, at the largest and at the smallest amount of data."""
    largest, smallest = int(table["N_D"].max()), int(table["N_D"].min())
    if largest not in pure.index:
        return f"There is no result without physics at {largest} runs, so whether physics harms there cannot be told."

    def harming(amount: int) -> list[str]:
        rows = table[(table["N_D"] == amount) & (table["kind"] != NO_MODEL)]
        return [str(name) for name in rows[rows["H"] >= float(pure["H"].loc[amount])]["model"]]

    if names := harming(largest):
        verb = "does" if len(names) == 1 else "do"
        return f"At {largest} runs {', '.join(names)} {verb} no better than no physics at all."
    better = f"t {largest} runs {every} does better than none."
    if smallest in pure.index and (names := harming(smallest)):
        verb = "harms" if len(names) == 1 else "harm"
        return f"At {smallest} runs {', '.join(names)} {verb}: no physics at all does as well or better; a{better}"
    return f"A{better}"


def _alone(physics: pd.DataFrame) -> str:
    """Which models are better without their compensator, and the best physics alone if nothing compensated beats it."""
    names = list(physics[physics["H"] >= physics["A"]]["model"])
    if not names:
        return ""
    text = f"Compensation makes {', '.join(names)} no better than {'it is' if len(names) == 1 else 'they are'} alone"
    alone = physics.iloc[int(physics["A"].argmin())]
    if alone["A"] <= physics["H"].min():
        text += f"; {alone['model']} alone has {_m(alone['A'])}, less than any compensated model"
    return f"{text}."


def _trend(table: pd.DataFrame) -> str:
    """Which models are no better at the largest amount of data than at the smallest; empty where all are."""
    H = table.pivot(index="model", columns="N_D", values="H")
    least, most = H.columns.min(), H.columns.max()
    names = [_words(str(name)) for name in H.index[H[most] >= H[least]]] if least != most else []
    verb = "is" if len(names) == 1 else "are"
    return f"With {most} runs {', '.join(names)} {verb} no better than with {least}." if names else ""


def _floor(top: pd.DataFrame, largest: int, floor: float) -> str:
    """Which models do no better than constant motion, at the largest amount of data."""
    names = [_words(str(name)) for name in top[top["H"] >= floor]["model"]]
    beats = f"{', '.join(names)} {'does' if len(names) == 1 else 'do'} not beat it" if names else "every model beats it"
    return f"Keeping u, v and r constant gives {_m(floor)}: at {largest} runs {beats}."


def _worth(table: pd.DataFrame, pure: pd.DataFrame, best: pd.Series) -> str:
    """How many runs pure data-driven needs for what the best physics does with the fewest."""
    fewest = int(table["N_D"].min())
    if table["N_D"].max() == fewest:
        return f"Without physics the same runs give {_m(float(pure['H'].loc[fewest]))}."
    first = table[(table["model"] == best["model"]) & (table["N_D"] == fewest)]
    if first.empty:
        return f"{best['model']} has no result at {fewest} runs, so its worth in runs cannot be told."
    level = float(first["H"].iloc[0])
    here = f"with {fewest} runs {best['model']} has {_m(level)}"
    enough, last = pure[pure["H"] <= level], int(pure.index.max())
    if enough.empty:
        return f"Without physics {last} runs give {_m(float(pure['H'].loc[last]))}; {here}."
    if int(enough.index.min()) == fewest:
        return f"Without physics {fewest} runs do as well, {_m(float(pure['H'].loc[fewest]))}: {here}."
    return f"Without physics it takes {int(enough.index.min())} runs to do as well: {here}."


def findings(results: Results) -> list[dict[str, str]]:
    """Verdicts on R1-R4 (method, section 5) at the largest amount of data; empty where the study makes no claims."""
    claims = results.plan.study.claims
    if claims is None:
        return []
    table = by_model(results)
    if table.empty:
        return []
    largest = int(table["N_D"].max())
    top = table[table["N_D"] == largest].set_index("kind")
    needed = (claims.accurate, claims.inaccurate, NO_MODEL)
    if any(name not in top.index for name in needed):
        return [_finding(key, "undecided", "a cell that it needs has failed or is missing") for key in CLAIMS]
    good, bad = top.loc[[claims.accurate]].iloc[0], top.loc[[claims.inaccurate]].iloc[0]
    better = [row["H"] < row["A"] for row in (good, bad)]
    always = [row["high"] < row["A"] for row in (good, bad)]
    gap_before, gap_after = abs(bad["A"] - good["A"]), abs(bad["H"] - good["H"])
    pairs = "; ".join(f"{row['model']} {_m(row['A'])} -> {_m(row['H'])}{_range(row)}" for row in (good, bad))
    worst, share = _worst_share(results, largest)
    return [
        _finding(
            "R1",
            _verdict(all(always), all(better)),
            pairs,
        ),
        _finding(
            "R2",
            _verdict(bad["high"] <= (1 + ABOUT) * good["A"], bad["H"] <= (1 + ABOUT) * good["A"]),
            f"inaccurate and compensated {_m(bad['H'])}{_range(bad)}, accurate alone {_m(good['A'])}",
        ),
        _finding(
            "R3",
            _verdict(bool((_gaps(results, claims, largest) < gap_before).all()), gap_after < gap_before),
            f"gap {_m(gap_before)} before, {_m(gap_after)} after",
        ),
        _finding(
            "R4",
            _verdict(share == 1.0, share > 0.5),
            f"pure data-driven is worst at {share:.0%} of the steps, physics alone included; most often worst: {worst}",
        ),
    ]


def _gaps(results: Results, claims: Claims, N_D: int) -> pd.Series:
    """Difference [m] of H between the accurate and the inaccurate model, of every seed that has both."""
    cells = results.cells[(results.cells["status"] == "ok") & (results.cells["N_D"] == N_D)]
    H = cells.pivot_table(index="seed", columns="kind", values="H")
    return (H[claims.accurate] - H[claims.inaccurate]).dropna().abs()


def _worst_share(results: Results, N_D: int) -> tuple[str, float]:
    """Which predictor, physics alone included, is most often worst over the horizon; share of steps where `none` is."""
    curves: dict[str, list[np.ndarray]] = {}
    claims = results.plan.study.claims
    aside = {model.name for model in results.plan.models if claims and model.family in claims.aside}
    for row in results.cells[results.cells["N_D"] == N_D].itertuples():
        if row.cell in results.paths and row.model not in aside:
            error = position_error(results.paths[str(row.cell)], results.test.future)
            curves.setdefault(str(row.model), []).append(over_horizon(error)["mean"])
    for model, path in results.physics.items():
        if model not in (NO_MODEL, *aside) and np.isfinite(path).all():
            error = position_error(path, results.test.future)
            curves[f"{model} alone"] = [over_horizon(error)["mean"]]
    names = list(curves)
    worst = np.argmax([np.mean(curves[name], axis=0) for name in names], axis=0)
    counts = np.bincount(worst, minlength=len(names))
    share = float(counts[names.index(NO_MODEL)] / counts.sum()) if NO_MODEL in names else 0.0
    return names[int(np.argmax(counts))], share


def _verdict(always: bool, on_average: bool) -> str:
    """Confirmed if it holds for every seed (R4: at every step), undecided if only on average, else refuted."""
    return "confirmed" if always else "undecided" if on_average else "refuted"


def _finding(key: str, verdict: str, evidence: str) -> dict[str, str]:
    return {"id": key, "claim": CLAIMS[key], "verdict": verdict, "evidence": evidence}


def _words(model: str) -> str:
    """Name a model inside a sentence, where `none` would say something else."""
    return "pure data-driven" if model == NO_MODEL else model


def _m(value: float) -> str:
    return f"{value:.2f} m" if value < 10 else f"{value:.1f} m"


def _range(row: pd.Series) -> str:
    return f" [{row['low']:.2f}, {row['high']:.2f}] over {int(row['seeds'])} seeds" if row["seeds"] > 1 else ""
