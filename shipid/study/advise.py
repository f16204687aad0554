"""From results to words: the answer in sentences.

Every comparison is paired over test manoeuvres; brackets are 95 % intervals. "Best" is always the model that validation
prefers at the largest amount of data, never the one with the lowest error on the test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd

from shipid.report.wording import listed
from shipid.study.declared import NO_MODEL
from shipid.study.error_table import ALONE, PLAIN, ErrorTable, error_table
from shipid.study.evidence import Contrasts, contrasts
from shipid.study.plan import (
    Plan,
    disturbances_of,
    families_set_from,
    fitted_families,
    judged_method,
    learning_methods,
    orders_may_react,
)
from shipid.study.results import Results, judged_cells, naive_summary
from shipid.study.verdict import interval, manoeuvres, metres, named, runs, shown, span, too_few
from shipid.study.worth import Estimate, break_even, runs_without_physics
from shipid.units import percent, plural

ROUNDING = 1e-9  # relative: an A that is the end of an interval is not beyond it
MANY = 3  # methods that learn: their comparison is what the study asks
SHOWN = 5  # models that a sentence lists
BEST = "best in validation"


def by_model(results: Results) -> pd.DataFrame:
    """Mean over seeds of A, H, H_90 [m] and validation loss [m^2] per foundation and N_D.

    The method is the one that the study judges by. Failed cells are left out.
    """
    cells = judged_cells(results)
    ended = [[trial["value"] for trial in trials if trial["state"] == "complete"] for trials in cells["trials"]]
    loss = [min((value for value in values if value is not None), default=np.nan) for values in ended]
    good = cells.assign(loss=loss)[cells["status"] == "ok"]
    grouped = good.groupby(["model", "family", "N_D"], sort=False)
    frame = grouped.agg(
        A=("A", "mean"),
        H=("H", "mean"),
        H_90=("H_90", "mean"),
        rms=("rms", "mean"),
        seeds=("H", "size"),
        loss=("loss", "mean"),
    )
    return frame.reset_index()


def best_model(results: Results) -> str | None:
    """Name of the physics model with the lowest validation loss at the largest amount of data; None without one.

    Where the judged method learns nothing there is no validation loss, and so no best model.

    Models that were fitted to the runs are left out where there are others: their validation runs are among these, so
    their loss says too little. So are families that a study sets aside.
    """
    table = by_model(results)
    table = table[~table["family"].isin(results.aside)]
    top = table[(table["N_D"] == table["N_D"].max()) & (table["family"] != NO_MODEL)]
    fair = top[~top["family"].isin(fitted_families(results.plan))]
    chosen = top if fair.empty else fair
    return None if chosen["loss"].isna().all() else str(chosen.iloc[int(chosen["loss"].argmin())]["model"])


@dataclass(frozen=True)
class Sides:
    """Names of models that are shown to be better than a rival, shown to be worse, and the others.

    left_out : how many are not compared, since another cell of theirs has no result. lacking : whether there are models
        without a result at this amount of data.
    """

    better: list[str]
    worse: list[str]
    open: list[str]
    left_out: int = 0
    lacking: bool = False


@dataclass(frozen=True)
class Case:
    """Inputs of the sentences of one study: `rows` are `by_model` without families set aside.

    best : as of `best_model`; None where no trial of a physics model has a value.
    """

    results: Results
    rows: pd.DataFrame
    best: str | None

    @property
    def smallest(self) -> int:
        """Least N_D."""
        return int(self.rows["N_D"].min())

    @property
    def largest(self) -> int:
        """Greatest N_D."""
        return int(self.rows["N_D"].max())

    @cached_property
    def table(self) -> ErrorTable:
        """Errors by test manoeuvre, at the amounts of data at which a model has a result."""
        return error_table(self.results, list(self.rows["model"].unique()), amounts=sorted(set(self.rows["N_D"])))

    def at(self, amount: int) -> pd.DataFrame:
        """Rows of physics models at an amount of data."""
        return self.rows[(self.rows["N_D"] == amount) & (self.rows["family"] != NO_MODEL)]

    def lacks(self, amount: int) -> bool:
        """Whether a physics model has no result at an amount of data, failed or not finished."""
        cells = judged_cells(self.results)
        here = cells[(cells["N_D"] == amount) & ~cells["family"].isin([NO_MODEL, *self.results.aside])]
        return not self.results.complete or here["model"].nunique() > len(self.at(amount))

    def place(self, amount: int) -> int:
        """Index of an amount of data in the error table; ValueError if it is not there."""
        return self.table.amounts.index(amount)

    def H(self, model: str, amount: int) -> str:
        """H of a model with its interval, in words."""
        row = self.rows[(self.rows["model"] == model) & (self.rows["N_D"] == amount)].iloc[0]
        error = float(row["H"])
        known = model in self.table.H
        return metres(error) + (interval(*self.table.interval(model, self.place(amount)), error) if known else "")

    def sides(self, models: Sequence[str], differences: Contrasts) -> Sides:
        """Models that are better (above 0) and worse; by sign alone where there are too few test manoeuvres."""
        if too_few(self.table.runs):
            above, below = differences.mean > 0, differences.mean < 0
        else:
            above, below = shown(differences.above), shown(differences.below)
        pairs = list(zip(models, above, below, strict=True))
        return Sides(
            [m for m, up, _ in pairs if up], [m for m, _, down in pairs if down], [m for m, u, d in pairs if not u | d]
        )

    @property
    def fixed(self) -> list[str]:
        """Physics models whose numbers do not depend on the cell and that have a result in every one."""
        names = self.at(self.largest)
        names = names[~names["family"].isin(fitted_families(self.results.plan))]
        return [str(m) for m in names["model"] if m in self.table.H and m in self.table.A]

    @property
    def whole(self) -> str:
        """What `fixed` models have, where other models were tried too: the worst of these may be worse."""
        tried = self.rows[~self.rows["family"].isin([NO_MODEL, *fitted_families(self.results.plan)])]
        return "" if set(tried["model"]) <= set(self.fixed) else " with a result in every cell"


def answer(results: Results, methods: Sequence[str] = ()) -> list[tuple[str, str]]:
    """A few sentences built from the results, each with the anchor of the figure that carries it.

    methods : sentences that compare the methods; of a study of many methods they come first.
    """
    claims, every_model = results.plan.study.claims, by_model(results)
    rows = every_model[~every_model["family"].isin(results.aside)]
    caveats = _caveats(results)
    sentences = [(f"{'; '.join(caveats)}.", "cells")] if caveats else []
    not_judged = [(text, "models") for text in _not_judged(results)]
    largest = int(rows["N_D"].max()) if len(rows) else 0
    best = best_model(results)
    meets = {name for name, way in results.plan.pairs if way.name == judged_method(results.plan)}
    judged_by = next(way.method for way in results.plan.methods if way.name == judged_method(results.plan))
    if len(rows) and not judged_by.compensates:
        return [*sentences, (_nothing_learns(results, rows[rows["N_D"] == largest]), "cells"), *not_judged]
    if len(rows) and meets == {NO_MODEL}:
        return [*sentences, (_apart(results, largest), "cells"), *not_judged]
    if rows[(rows["N_D"] == largest) & (rows["family"] != NO_MODEL)].empty:
        where = f" at {runs(largest)}" if largest else ""
        of = f" of the method {judged_method(results.plan)!r}" if len(results.plan.methods) > 1 else ""
        counts = " that counts" if not_judged else ""
        text = f"No cell{of} with physics{counts} has a result{where}, so there is no conclusion yet."
        return [*sentences, (text, "cells"), *not_judged]
    case = Case(results, rows, best)
    chart = "map" if _has_map(rows) else "gain"
    pure = rows[rows["family"] == NO_MODEL]
    judged = NO_MODEL in case.table.H
    learning = learning_methods(results.plan)
    which = [(text, "methods") for text in methods]
    sentences += which if len(learning) >= MANY else []
    if judged and (good := _good_enough(case)):
        sentences.append((good, chart))
    if len(pure) and case.smallest < largest and best is not None:
        sentences.append((_enough_runs(case, best), chart))
    sentences.append((_headline(case, any(BEST in text for text, _ in sentences)), "gain"))
    if len(learning) > 1:
        spoken = f"The study has {len(learning)} methods that learn from data; the other sentences speak of "
        sentences.append((f"{spoken}{judged_method(results.plan)!r}, the one that the study judges by.", "cells"))
        sentences += which if len(learning) < MANY else []
    sentences += [(text, chart) for text in _physics_or_none(case, judged, NO_MODEL in meets)]
    known = case.at(largest)
    known = known[known["A"] > 0]  # an exact model has no error that could be left
    if len(known):
        left = known["H"] / known["A"]
        share = span(percent(left.min()), percent(left.max()))
        text = (
            f"Compensation with {runs(largest)} leaves {share} of the error of physics "
            f"alone (over {len(known)} {plural(len(known), 'model')})."
        )
        sentences.append((text, "horizon"))
    sentences += [(text, "gain") for text in (*_alone(case), *_trend(case), _floor(case))]
    nominal = every_model[every_model["family"] == claims.nominal] if claims else every_model[:0]
    sentences += [(text, "gain") for text in _nominal(nominal, largest, results.plan)]
    return [*sentences, *not_judged, *((text, "cells") for text in _how_to_read(case))]


def _not_judged(results: Results) -> list[str]:
    """Which families saw the test runs, so that no other sentence counts them; nothing where none did."""
    saw = families_set_from(results.plan, results.test.spans)
    it, them = plural(len(saw), "it is", "they are"), plural(len(saw), "it", "them")
    text = f"The numbers of {named(saw)} were set from runs that test: {it} shown, and no other sentence counts {them}."
    return [text] if saw else []


def _nothing_learns(results: Results, rows: pd.DataFrame) -> str:
    """What physics alone reaches, where the method that the study judges by learns nothing from data."""
    begins = f"The method {judged_method(results.plan)!r} learns nothing from data. Mean errors of physics alone"
    return f"{begins}, {_ahead(results)} ahead{_least(rows.set_index('model')['H'])}."


def _apart(results: Results, amount: int) -> str:
    """What methods without physics reach, and what physics alone, where no method that learns has physics."""
    cells = results.cells[(results.cells["status"] == "ok") & (results.cells["N_D"] == amount)]
    pure = cells["foundation"] == NO_MODEL
    learned, alone = (cells[which].groupby(by)["H"].mean() for which, by in ((pure, "method"), (~pure, "foundation")))
    begins = "No method that learns from data has physics in this study. Mean errors"
    physics = f"; of physics alone{_least(alone)}" if len(alone) else ""
    return f"{begins} {_ahead(results)} ahead, with {runs(amount)} and without physics{_least(learned)}{physics}."


def _least(errors: pd.Series[float]) -> str:
    """The least of some errors [m] by name, as the end of a sentence."""
    shown = errors.sort_values(kind="stable")[:SHOWN]
    of = f" (the least of {len(errors)})" if len(errors) > SHOWN else ""
    return f"{of}: {listed([f'{name} {metres(value)}' for name, value in shown.items()], SHOWN)}"


def _has_map(table: pd.DataFrame) -> bool:
    """Whether there is a map H(A, N_D): more than one amount, two physics models or more."""
    return table["N_D"].nunique() > 1 and table[table["family"] != NO_MODEL]["model"].nunique() > 1


def _ahead(results: Results) -> str:
    return f"{results.test.horizon * results.test.step:g} s"


def _good_enough(case: Case) -> str:
    """How good physics must be to pay, at the smallest and at the largest amount of data."""
    parts, limits = [], False
    every = {amount: _against_none(case, amount) for amount in dict.fromkeys((case.smallest, case.largest))}
    if not any(sides.better or sides.worse for sides in every.values()):
        amounts = " or ".join(map(str, every))
        models = _any(len(case.at(case.largest)))
        return f"How good must the physics be? With {amounts} runs the test cannot tell {models} from no physics."
    for amount, sides in every.items():
        limit = _limit_of_A(case, amount, sides)
        if not sides.better and not sides.worse:
            parts.append(f"the test cannot tell {_any(len(sides.open))} from no physics")
        elif limit is None:
            parts.append(_uncrossed(case, sides))
        else:
            parts.append(_limit(limit, case.whole) + _but(case, limit, sides))
            limits = True
    begins = f"How good must the physics be, {_ahead(case.results)} ahead? " if limits else ""
    if len(parts) == 2 and (once := _once(parts, list(every))):
        return f"{begins}With {case.smallest} or {runs(case.largest)} {once}."
    each = "; ".join(f"with {runs(amount)} {part}" for amount, part in zip(every, parts, strict=True))
    return f"{begins}{each[0].upper()}{each[1:]}."


def _once(said: Sequence[str], amounts: Sequence[int]) -> str:
    """What is said of two amounts of data, once, each interval with its amount; empty where more than these differ."""
    if said[0] == said[1]:
        return said[0]
    (text, *_), (again, *_) = ends = [part.partition(" [") for part in said]
    known = [
        f"with {runs(amount)} {end[2].removesuffix(']')}" for amount, end in zip(amounts, ends, strict=True) if end[2]
    ]
    return f"{text} [{'; '.join(known)}]" if text == again else ""


def _limit_of_A(case: Case, amount: int, sides: Sides) -> Estimate | None:
    """Up to which error A physics pays; None where too few models are known, or A does not divide them.

    A line that says that all models pay, or none, is wrong where a model is shown to do the opposite.
    """
    limit = break_even(case.table, case.fixed, case.place(amount))
    if limit is None or (limit.above and sides.worse) or (limit.below and sides.better):
        return None
    return limit


def _but(case: Case, limit: Estimate, sides: Sides) -> str:
    """Models that are shown to do the opposite of what the interval of a limit says of their A."""
    low, high = (limit.low, limit.high) if np.isfinite(limit.low) else (limit.value, limit.value)
    A = {model: case.table.mean(model, ALONE) for model in case.fixed}
    worse = [model for model in sides.worse if model in A and A[model] < low * (1 - ROUNDING)]
    better = [model for model in sides.better if model in A and A[model] > high * (1 + ROUNDING)]
    parts = [f"{named(worse)} with less {plural(len(worse), 'does', 'do')} worse"] if worse else []
    parts += [f"{named(better)} with more {plural(len(better), 'does', 'do')} better"] if better else []
    return f", but {' and '.join(parts)}" if parts else ""


def _uncrossed(case: Case, sides: Sides) -> str:
    """What is known at an amount without a limit of A: who pays, up to which A."""
    worst = max((case.table.mean(model, ALONE) for model in case.fixed), default=0.0)
    paying = not sides.worse and not sides.open and worst > 0
    return _counted(sides) + (f", even with an error A of {metres(worst)}" if paying else "")


def _any(count: int) -> str:
    return "the physics model" if count == 1 else f"any of {count} physics models"


def _limit(estimate: Estimate, whole: str = "") -> str:
    """Up to which error A physics pays, in words; whole : what else is said of the models that were tried."""
    least, most = estimate.limits
    bounds = ""
    if np.isfinite(estimate.low):
        low = f"under {_length(least)}" if estimate.low <= least else _length(estimate.low)
        bounds = f" [{low}, {f'over {_length(most)}' if estimate.high >= most else _length(estimate.high)}]"
    if estimate.above:
        low = f" [at least {_length(estimate.low)}]" if np.isfinite(estimate.low) and estimate.low < most else ""
        low = bounds if estimate.unknown else low
        return f"physics pays even with an error A of {metres(most)}, the worst tried{whole}{low}"
    if estimate.below:
        high = f" [at most {_length(estimate.high)}]" if np.isfinite(estimate.high) and estimate.high > least else ""
        high = bounds if estimate.unknown else high
        return f"physics does not pay even with an error A of {metres(least)}, the best tried{whole}{high}"
    return f"physics pays if its error A is below about {_length(estimate.value)} m{bounds}"


def _length(value: float) -> str:
    """A length with two digits: more would be pretence."""
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


def _against_none(case: Case, amount: int) -> Sides:
    """Which physics models do better than none, at an amount of data."""
    models = [str(name) for name in case.at(amount)["model"] if name in case.table.H]
    if not models:
        return Sides([], [], [])
    sides = case.sides(models, case.table.against(NO_MODEL, models, case.place(amount)))
    return replace(sides, left_out=len(case.at(amount)) - len(models), lacking=case.lacks(amount))


def _enough_runs(case: Case, best: str) -> str:
    """Error of the best model with the fewest runs, and how many runs give the same error without physics."""
    fewest, largest = case.smallest, case.largest
    first = case.rows[(case.rows["model"] == best) & (case.rows["N_D"] == fewest)]
    if first.empty:
        return f"{best} has no result at {runs(fewest)}, so its worth in runs is unknown."
    begins = f"How many runs? With {runs(fewest)}, {best} ({BEST}) has {case.H(best, fewest)} mean error"
    if missing := [name for name in (NO_MODEL, best) if name not in case.table.H]:
        where = "without physics" if missing[0] == NO_MODEL else f"of {best}"
        return f"{begins}; {where} not every cell has a result, so its worth in runs is unknown."
    estimate = runs_without_physics(case.table, best, case.place(fewest))
    bounds = (
        f" [{_count(estimate.low, estimate)}, {_count(estimate.high, estimate)}]" if np.isfinite(estimate.low) else ""
    )
    if estimate.above:
        known = np.isfinite(estimate.low) and not estimate.low >= estimate.limits[1]
        least = (bounds if estimate.unknown else f" [at least {estimate.low:.0f}]") if known else ""
        text = f"without physics {runs(largest)} are not enough for that{least}: they give {case.H(NO_MODEL, largest)}"
    elif estimate.below:
        text = f"without physics the same {runs(fewest)} do as well{bounds}, {case.H(NO_MODEL, fewest)}"
    else:
        count = f"{estimate.value:.0f} runs{bounds}"
        text = f"without physics the same error takes about {count}, interpolated between amounts"
    return f"{begins}; {text}."


def _count(value: float, estimate: Estimate) -> str:
    """A number of runs, which may be a bound."""
    if value >= estimate.limits[1]:
        return f"over {value:.0f}"
    return f"{value:.0f} or fewer" if value <= estimate.limits[0] else f"{value:.0f}"


def _headline(case: Case, introduced: bool) -> str:
    """Error of the model with the lowest validation loss at the largest amount of data; of all models without a loss.

    introduced : whether a sentence before has said that this model is the best in validation.
    """
    rows = case.at(case.largest).set_index("model")
    if case.best is None:
        method, errors = judged_method(case.results.plan), _least(rows["H"])
        text = f"With {runs(case.largest)} no trial of the method {method!r} has a value, so no model is {BEST}. "
        text += f"Mean errors {_ahead(case.results)} ahead{errors}"
    else:
        alone, worst = float(str(rows.at[case.best, "A"])), float(str(rows.at[case.best, "H_90"]))
        chosen = "" if introduced else f"{BEST}; "
        text = (
            f"With {runs(case.largest)}, {case.best} ({chosen}{metres(alone)} mean error alone) "
            f"predicts {_ahead(case.results)} ahead with {case.H(case.best, case.largest)} mean error; "
            f"nine errors in ten are below {metres(worst)}"
        )
    pure = case.rows[(case.rows["family"] == NO_MODEL) & (case.rows["N_D"] == case.largest)]
    return f"{text}. Without physics: {case.H(NO_MODEL, case.largest)}." if len(pure) else f"{text}."


def _caveats(results: Results) -> list[str]:
    """What limits every sentence that follows: cells that are missing, and cells without a result."""
    sentences, cells = [], results.cells
    if not results.complete:
        missing = results.plan.cells - len(cells)
        sentences.append(f"{missing} of {results.plan.cells} cells are not finished: what follows is provisional")
    failed = cells[cells["status"] != "ok"]
    if len(failed):
        by_reason = failed.drop_duplicates("model").groupby("sentence", sort=False)["model"]
        why = "; ".join(f"{named(map(str, models))}: {reason}" for reason, models in by_reason)
        sentences.append(f"{len(failed)} of {len(cells)} cells {plural(len(failed), 'has', 'have')} no result ({why})")
    return sentences


def _physics_or_none(case: Case, judged: bool, planned: bool) -> list[str]:
    """Which physics models, compensated, beat none and which harm, at the smallest and the largest amount of data.

    judged, planned : whether every cell without physics has a result, and whether the study has such cells.
    """
    if not planned:
        method = repr(judged_method(case.results.plan))
        return [f"The method {method} has no cell without physics, so it is unknown whether physics harms."]
    if not judged:
        where = runs(case.largest)
        return [f"Not every cell has a result without physics, so it is unknown whether physics harms at {where}."]
    every = {amount: _against_none(case, amount) for amount in dict.fromkeys((case.smallest, case.largest))}
    spoken = {  # else the first sentence names them
        amount: _counted(sides)
        for amount, sides in every.items()
        if (sides.better or sides.worse) and _limit_of_A(case, amount, sides) is not None
    }
    if len(spoken) == 2 and len(set(spoken.values())) == 1:
        return [f"At {case.smallest} and at {runs(case.largest)} {spoken[case.largest]}."]
    return [f"At {runs(amount)} {words}." for amount, words in spoken.items()]


def _counted(sides: Sides) -> str:
    """Which models are better than no physics and which are worse, as one sentence."""
    count = len(sides.better) + len(sides.worse) + len(sides.open)
    if len(sides.better) == count:
        which = " with a result in every cell" if sides.left_out else " with a result" if sides.lacking else ""
        return f"every physics model{which} does better than no physics"
    verb = "do" if len(sides.better) > 1 else "does"  # none does
    verb = "is shown to do" if sides.open and not sides.better else verb
    parts = [f"{len(sides.better) or 'none'} of {count} physics models {verb} better than no physics"]
    if sides.worse:
        parts.append(f"{named(sides.worse)} {plural(len(sides.worse), 'does', 'do')} worse")
    if sides.open:
        parts.append(f"for {named(sides.open)} the test cannot tell")
    return "; ".join(parts)


def _alone(case: Case) -> list[str]:
    """Which models are better without their compensator, and the best physics alone if nothing compensated beats it."""
    models = case.fixed
    if not models:
        return []
    place = case.place(case.largest)
    compared = case.table.compare([[(1.0, model, ALONE), (-1.0, model, place)] for model in models])
    sides = case.sides(models, compared)
    parts = []
    if sides.worse:
        parts.append(f"Compensation harms {named(sides.worse)}.")
    if sides.open:
        parts.append(f"It is not shown that compensation helps {named(sides.open)}.")
    accuracy = {model: case.table.mean(model, ALONE) for model in models}
    first = min(models, key=accuracy.__getitem__)
    if parts and accuracy[first] < case.at(case.largest)["H"].min():
        parts[-1] = parts[-1][:-1] + f"; {first} alone has {metres(accuracy[first])}, less than any compensated model."
    return parts


def _trend(case: Case) -> list[str]:
    """Which models are worse with the most data than with the least; empty where none is."""
    if case.smallest == case.largest:
        return []
    models = [str(name) for name in dict.fromkeys(case.rows["model"]) if name in case.table.H]
    first, last = case.place(case.smallest), case.place(case.largest)
    sides = case.sides(models, case.table.compare([[(1.0, m, first), (-1.0, m, last)] for m in models]))
    parts = []
    if sides.worse:
        verb = plural(len(sides.worse), "is", "are")
        parts.append(f"With {runs(case.largest)} {named(sides.worse)} {verb} no better than with {case.smallest}.")
    if sides.open:
        parts.append(
            f"It is not shown that {runs(case.largest)} serve {named(sides.open)} better than {case.smallest}."
        )
    return parts


def _floor(case: Case) -> str:
    """Which models do no better than constant u, v, r, at the largest amount of data."""
    results, table, place = case.results, case.table, case.place(case.largest)
    rows = case.rows[case.rows["N_D"] == case.largest]
    models = [str(name) for name in rows["model"] if name in table.H]
    floor = naive_summary(results)["mean"]
    _, run = np.unique(results.test.run, return_inverse=True)
    still = np.bincount(run, results.naive.mean(axis=0)) / np.bincount(run)
    if not models:
        return f"Constant u, v, r give {metres(floor)}."
    errors = np.stack([table.by_run(model, place) for model in models])
    training = np.array([table.mean(model, place) for model in models]) * table.noise[place]
    sides = case.sides(models, contrasts(still - errors, table.counts, training))
    if len(sides.better) == len(models):
        whole = "" if len(models) == len(rows) else " with a result in every cell"
        return f"Constant u, v, r give {metres(floor)}: at {runs(case.largest)} every model{whole} beats them."
    parts = []
    if sides.worse:
        parts.append(f"{named(sides.worse)} {plural(len(sides.worse), 'is', 'are')} worse")
    if sides.open:
        parts.append(f"{named(sides.open)} {plural(len(sides.open), 'is', 'are')} not shown to beat them")
    return f"Constant u, v, r give {metres(floor)}: at {runs(case.largest)} {', and '.join(parts)}."


def _nominal(nominal: pd.DataFrame, largest: int, plan: Plan) -> list[str]:
    """The error that exact coefficients leave, alone and compensated with the largest amount of data."""
    causes = [*disturbances_of(plan)]
    causes += ["Euler steps"] if (plan.study.prediction.integrator == "euler") else []
    causes += [] if plan.study.prediction.known else ["held commands"]
    such = f", such as {listed(causes)}," if causes else ","
    return [
        f"Exact coefficients ({row['model']}) leave {metres(row['A'])} alone, the floor set by what is no coefficient"
        f"{such} and {metres(row['H'])} compensated with {runs(largest)}."
        for _, row in nominal[nominal["N_D"] == largest].iterrows()
    ]


def _how_to_read(case: Case) -> list[str]:
    """What "no physics" is, what identified models, models set from the runs and known commands mean, and brackets."""
    plan, table, sentences = case.results.plan, case.table, []
    judged = next(way.method for way in plan.methods if way.name == judged_method(plan))
    if NO_MODEL in table.H and judged.traits.mirror:
        text = '"No physics" may use that port and starboard are mirror images, which is a little physics'
        if PLAIN in table.H:
            first, last = (table.mean(PLAIN, case.place(amount)) for amount in (case.smallest, case.largest))
            mirrored_first = table.mean(NO_MODEL, case.place(case.smallest))
            text += (
                f"; without that it has {metres(first)} at {runs(case.smallest)} instead of {metres(mirrored_first)}"
            )
            text += f", and {metres(last)} at {runs(case.largest)}" if case.largest > case.smallest else ""
        sentences.append(f"{text}.")
    top = case.at(case.largest)
    fitted = top[top["family"].isin(fitted_families(plan))]
    if fitted["loss"].notna().any() and case.best not in set(fitted["model"]):
        lowest = fitted.iloc[int(fitted["loss"].argmin())]
        sentences.append(
            "Models that were identified, or whose observer was chosen, were fitted to their validation runs, too, so "
            "they cannot be called best in validation: "
            f"{lowest['model']} has {case.H(str(lowest['model']), case.largest)} with {runs(case.largest)}."
        )
    trained = set(case.results.dataset.runs) - set(case.results.test.spans)
    saw = [name for name in families_set_from(plan, trained) if name in set(top["family"])]
    if saw and case.smallest < case.largest:
        sentences.append(
            f"The numbers of {named(saw)} were set from runs that train, whatever the amount of data: the errors with "
            "few runs rest on the other runs, too."
        )
    if plan.study.prediction.known and orders_may_react(plan):
        sentences.append(
            "The orders of the next seconds were known. In a zigzag they reveal when the heading will reach its limit, "
            "so these errors show at best what knowing the plan can give: an upper bound of its worth."
        )
    if note := too_few(table.runs):
        sentences.append(
            f"{note[0].upper()}{note[1:]}: every comparison here holds on this test and may not on another."
        )
    else:
        sentences.append(
            f"Brackets are 95 % intervals over {manoeuvres(table.runs)} of one world. A test of several models is "
            "corrected for their number (Holm): one that a short list names may be missing in a longer one."
        )
        if case.smallest < case.largest and case.results.cells["seed"].nunique() == 1:
            sentences.append(
                f"One seed drew the training runs. With other draws of {runs(case.smallest)} the errors may lie "
                "outside the brackets: more grid.seeds would show it."
            )
    return sentences
