"""From results to words: the answer in sentences."""

from __future__ import annotations

import numpy as np
import pandas as pd

from shipid.study.plan import NO_MODEL
from shipid.study.results import Results, judged_cells, naive_summary
from shipid.study.verdict import interval, metres, named, runs, words


def by_model(results: Results) -> pd.DataFrame:
    """Mean over seeds of A, H, H_90 [m] and validation loss [m^2] per foundation and N_D, with the range of H.

    The method is the one that the study judges by. Failed cells are left out.
    """
    cells = judged_cells(results)
    loss = [min((t["value"] for t in trials if t["value"] is not None), default=np.nan) for trials in cells["trials"]]
    good = cells.assign(loss=loss)[cells["status"] == "ok"]
    grouped = good.groupby(["model", "family", "N_D"], sort=False)
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
    """Four to nine sentences built from the results, each with the anchor of the figure that carries it."""
    claims, every_model = results.plan.study.claims, by_model(results)
    table = every_model[~every_model["family"].isin(results.plan.aside)]
    sentences = [(text, "cells") for text in _caveats(results)]
    largest = int(table["N_D"].max()) if len(table) else 0
    top = table[table["N_D"] == largest]
    physics = top[top["family"] != NO_MODEL]
    if physics.empty:
        where = f" at {runs(largest)}" if largest else ""
        return [*sentences, (f"No cell with physics has a result{where}, so nothing can be said yet.", "cells")]
    best = physics.iloc[int(physics["loss"].argmin())]  # chosen by validation, never by the test
    chart = "map" if _has_map(table) else "gain"
    sentences.append((_headline(best, largest, results.test.horizon * results.test.step), "gain"))
    pure = table[table["family"] == NO_MODEL].set_index("N_D")
    if len(pure):
        cells = judged_cells(results)
        failed = cells[(cells["status"] != "ok") & (cells["family"] != NO_MODEL)]
        every = "every physics model" + (" with a result" if len(failed) else "")
        sentences += [(_worth(table, pure, best), chart), (_harm(table, pure, every), chart)]
    known = physics[physics["A"] > 0]  # an exact model has no error that could be left
    if len(known):
        left = known["H"] / known["A"]
        text = (
            f"Compensation with {runs(largest)} leaves {left.min():.0%} to {left.max():.0%} of the error of physics "
            f"alone (over {len(known)} model{'s' * (len(known) > 1)})."
        )
        sentences.append((text, "horizon"))
    if harmed := _alone(physics):
        sentences.append((harmed, "gain"))
    if trend := _trend(table):
        sentences.append((trend, "gain"))
    sentences.append((_floor(top, largest, naive_summary(results)["mean"]), "gain"))
    nominal = every_model[every_model["family"] == claims.nominal] if claims else every_model[:0]
    return [*sentences, *((text, "gain") for text in _nominal(nominal, largest))]


def _has_map(table: pd.DataFrame) -> bool:
    """Whether there is a map H(A, N_D): more than one amount, two physics models or more."""
    return table["N_D"].nunique() > 1 and table[table["family"] != NO_MODEL]["model"].nunique() > 1


def _nominal(nominal: pd.DataFrame, largest: int) -> list[str]:
    """The error that exact coefficients leave, alone and compensated with the largest amount of data."""
    return [
        f"Exact coefficients ({row['model']}) leave {metres(row['A'])} alone, the floor set by what is no "
        f"coefficient, such as waves, Euler steps and held commands, and {metres(row['H'])}{_spread(row)} compensated "
        f"with {runs(largest)}."
        for _, row in nominal[nominal["N_D"] == largest].iterrows()
    ]


def _headline(best: pd.Series, largest: int, ahead: float) -> str:
    """What the model that validation prefers does at the largest amount of data."""
    return (
        f"With {runs(largest)}, {best['model']} (best in validation; {metres(best['A'])} mean error on its own) "
        f"predicts {ahead:g} s ahead with {metres(best['H'])} mean error{_spread(best)}; nine errors in ten are below "
        f"{metres(best['H_90'])}."
    )


def _spread(row: pd.Series) -> str:
    return interval(row["low"], row["high"], int(row["seeds"]))


def _caveats(results: Results) -> list[str]:
    """What limits every sentence that follows: cells that are missing, and cells without a result."""
    found, cells = [], results.cells
    if not results.complete:
        missing = results.plan.cells - len(cells)
        found.append(f"{missing} of {results.plan.cells} cells are not finished: what follows is provisional.")
    failed = cells[cells["status"] != "ok"]
    if len(failed):
        why = "; ".join(
            f"{words(str(row.model))}: {row.sentence}" for row in failed.drop_duplicates("model").itertuples()
        )
        found.append(f"{len(failed)} of {len(cells)} cells have no result ({why}).")
    return found


def _harm(table: pd.DataFrame, pure: pd.DataFrame, every: str) -> str:
    """Which physics models do no better than none, at the largest and at the smallest amount of data."""
    largest, smallest = int(table["N_D"].max()), int(table["N_D"].min())
    if largest not in pure.index:
        return f"There is no result without physics at {runs(largest)}, so it is unknown whether physics harms there."

    def harming(amount: int) -> list[str]:
        rows = table[(table["N_D"] == amount) & (table["family"] != NO_MODEL)]
        return [str(name) for name in rows[rows["H"] >= float(pure["H"].loc[amount])]["model"]]

    if names := harming(largest):
        verb = "does" if len(names) == 1 else "do"
        return f"At {runs(largest)} {named(names)} {verb} no better than no physics at all."
    better = f"t {runs(largest)} {every} does better than none."
    if smallest in pure.index and (names := harming(smallest)):
        verb = "harms" if len(names) == 1 else "harm"
        return f"At {runs(smallest)} {named(names)} {verb}: no physics at all does as well or better; a{better}"
    return f"A{better}"


def _alone(physics: pd.DataFrame) -> str:
    """Which models are better without their compensator, and the best physics alone if nothing compensated beats it."""
    names = list(physics[physics["H"] >= physics["A"]]["model"])
    if not names:
        return ""
    text = f"Compensation makes {named(names)} no better than {'it is' if len(names) == 1 else 'they are'} alone"
    alone = physics.iloc[int(physics["A"].argmin())]
    if alone["A"] <= physics["H"].min():
        text += f"; {alone['model']} alone has {metres(alone['A'])}, less than any compensated model"
    return f"{text}."


def _trend(table: pd.DataFrame) -> str:
    """Which models are no better at the largest amount of data than at the smallest; empty where all are."""
    H = table.pivot(index="model", columns="N_D", values="H")
    least, most = H.columns.min(), H.columns.max()
    names = [str(name) for name in H.index[H[most] >= H[least]]] if least != most else []
    verb = "is" if len(names) == 1 else "are"
    return f"With {runs(int(most))} {named(names)} {verb} no better than with {least}." if names else ""


def _floor(top: pd.DataFrame, largest: int, floor: float) -> str:
    """Which models do no better than constant motion, at the largest amount of data."""
    names = [str(name) for name in top[top["H"] >= floor]["model"]]
    beats = f"{named(names)} {'does' if len(names) == 1 else 'do'} not beat it" if names else "every model beats it"
    return f"Keeping u, v and r constant gives {metres(floor)}: at {runs(largest)} {beats}."


def _worth(table: pd.DataFrame, pure: pd.DataFrame, best: pd.Series) -> str:
    """How many runs pure data-driven needs for what the best physics does with the fewest."""
    fewest = int(table["N_D"].min())
    if table["N_D"].max() == fewest:
        return f"Without physics the same runs give {metres(float(pure['H'].loc[fewest]))}."
    first = table[(table["model"] == best["model"]) & (table["N_D"] == fewest)]
    if first.empty:
        return f"{best['model']} has no result at {runs(fewest)}, so its worth in runs is unknown."
    level = float(first["H"].iloc[0])
    here = f"with {runs(fewest)} {best['model']} has {metres(level)}"
    enough, last = pure[pure["H"] <= level], int(pure.index.max())
    if enough.empty:
        return f"Without physics {runs(last)} give {metres(float(pure['H'].loc[last]))}; {here}."
    if int(enough.index.min()) == fewest:
        return f"Without physics {runs(fewest)} do as well, {metres(float(pure['H'].loc[fewest]))}: {here}."
    return f"Without physics it takes {runs(int(enough.index.min()))} to do as well: {here}."
