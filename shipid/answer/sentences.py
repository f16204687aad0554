"""From results to words: the answer in sentences, each with the anchor of the figure or table that carries it.

Every comparison is paired over test manoeuvres; brackets are 95 % intervals. "Best" is always the model that validation
prefers at the largest amount of data, never the one with the lowest error on the test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from shipid.answer.error_table import PHYSICS_ONLY, ErrorTable, error_table
from shipid.answer.verdict import (
    count_manoeuvres,
    count_runs,
    interval_after,
    least_to_greatest,
    length_in_metres,
    model_list,
    quoted_model,
    too_few_manoeuvres,
)
from shipid.answer.worth import Estimate, break_even, runs_without_physics
from shipid.evidence import Differences, paired_difference, which_significant
from shipid.metrics import error_of_windows
from shipid.report.wording import join_few_names
from shipid.study.declared import NO_MODEL
from shipid.study.plan import families_set_from, fitted_families, learning_methods, orders_may_react, verdict_method
from shipid.study.results import Results
from shipid.units import percent_text, plural_word

MOST_SHOWN = 5  # models that a sentence lists with their errors
BEST = "best in validation"
IN_EVERY_CELL = " with a result in every cell"


def errors_by_model(results: Results) -> pd.DataFrame:
    """Mean over seeds of A, H, H_90 [m] and validation loss [m^2] per foundation and N_D.

    The method is the one that the study judges by. Failed cells are left out.
    """
    cells = results.judged_cells
    ended = [[trial["value"] for trial in trials if trial["state"] == "complete"] for trials in cells["trials"]]
    loss = [min((value for value in values if value is not None), default=np.nan) for values in ended]
    grouped = cells.assign(loss=loss)[cells["status"] == "ok"].groupby(["model", "family", "N_D"], sort=False)
    return grouped[["A", "H", "H_90", "loss"]].mean().reset_index()


def best_model(results: Results) -> str | None:
    """Name of the physics model with the lowest validation loss at the largest amount of data; None without one.

    Where the judged method learns nothing there is no validation loss, and so no best model.

    Models that were fitted to the runs are left out where there are others: their validation runs are among these, so
    their loss says too little. So are families that a study sets aside.
    """
    table = errors_by_model(results)
    table = table[~table["family"].isin(results.aside)]
    top = table[(table["N_D"] == table["N_D"].max()) & (table["family"] != NO_MODEL)]
    fair = top[~top["family"].isin(fitted_families(results.plan))]
    chosen = top if fair.empty else fair
    return None if chosen["loss"].isna().all() else str(chosen.iloc[int(chosen["loss"].argmin())]["model"])


@dataclass(frozen=True)
class ModelSides:
    """Names of models that are shown to be better than a rival, shown to be worse, and the others."""

    better: list[str]
    worse: list[str]
    unknown: list[str]


@dataclass(frozen=True)
class AnswerCase:
    """Inputs of the sentences of one study: `rows` are `errors_by_model` without families set aside.

    best : as of `best_model`; None where no trial of a physics model has a value.
    """

    results: Results
    rows: pd.DataFrame
    best: str | None

    @cached_property
    def table(self) -> ErrorTable:
        """Errors by test manoeuvre, at the amounts of data at which a model has a result."""
        return error_table(self.results, list(self.rows["model"].unique()), amounts=sorted(set(self.rows["N_D"])))

    @property
    def smallest(self) -> int:
        """Least N_D."""
        return self.table.amounts[0]

    @property
    def largest(self) -> int:
        """Greatest N_D."""
        return self.table.amounts[-1]

    @property
    def ends(self) -> dict[int, int]:
        """The least and the greatest N_D, each with its place in the error table."""
        return {self.smallest: 0, self.largest: len(self.table.amounts) - 1}

    def at(self, amount: int) -> pd.DataFrame:
        """Rows of physics models at an amount of data."""
        return self.rows[(self.rows["N_D"] == amount) & (self.rows["family"] != NO_MODEL)]

    def H(self, model: str, amount: int) -> str:
        """H of a model with its interval, in words."""
        error = float(self.rows[(self.rows["model"] == model) & (self.rows["N_D"] == amount)]["H"].iloc[0])
        known = model in self.table.H
        interval = self.table.interval(model, self.ends[amount]) if known else (np.nan, np.nan)
        return length_in_metres(error) + interval_after(*interval, error)

    def sides(self, models: Sequence[str], differences: Differences) -> ModelSides:
        """Models that are better (above 0) and worse; by sign alone where there are too few test manoeuvres."""
        if too_few_manoeuvres(self.table.runs):
            above, below = differences.mean > 0, differences.mean < 0
        else:
            above, below = which_significant(differences.above), which_significant(differences.below)
        groups = (above, below, ~(above | below))
        return ModelSides(*([m for m, chosen in zip(models, group, strict=True) if chosen] for group in groups))

    @cached_property
    def against_none(self) -> dict[int, tuple[ModelSides, Estimate | None]]:
        """Which physics models do better than none at the least and the greatest N_D, and up to which error A they do.

        No such A where too few models are known, or where it does not divide them: a line that says that all pay, or
        none, is wrong where a model is shown to do the opposite.
        """
        known = {}
        for amount, place in self.ends.items():
            models = [str(name) for name in self.at(amount)["model"] if name in self.table.H]
            sides = self.sides(models, self.table.lead(NO_MODEL, models, place))
            limit = break_even(self.table, self.fixed, place)
            wrong = limit is not None and ((limit.above and sides.worse) or (limit.below and sides.better))
            known[amount] = sides, None if wrong else limit
        return known

    @property
    def fixed(self) -> list[str]:
        """Physics models whose numbers do not depend on the cell and that have a result in every one."""
        top = self.at(self.largest)
        names = map(str, top["model"][~top["family"].isin(fitted_families(self.results.plan))])
        return [name for name in names if name in self.table.H and name in self.table.A]

    @property
    def whole(self) -> str:
        """What the compared physics models have, where others have not."""
        cells = self.results.judged_cells
        tried = set(cells["model"][~cells["family"].isin([NO_MODEL, *self.results.aside])])
        return "" if tried <= set(self.table.H) else IN_EVERY_CELL


def answer_sentences(results: Results, methods: Sequence[str] = ()) -> list[tuple[str, str]]:
    """A few sentences built from the results, each with the anchor of the figure that carries it.

    methods : sentences that compare the methods; of a study of several that learn they come first.
    """
    rows, saw_test = errors_by_model(results), _families_that_saw_the_test(results)
    rows = rows[~rows["family"].isin(results.aside)]
    caveats = [(text, "cells") for text in _missing_cells(results)]
    if reason := _no_comparison(results, rows):
        return [*caveats, (reason, "cells"), *((text, "models") for text in saw_test)]
    case, learning = AnswerCase(results, rows, best_model(results)), learning_methods(results.plan)
    chart = "map" if case.smallest < case.largest and case.at(case.largest)["model"].nunique() > 1 else "gain"
    several = len(learning) > 1
    parts: list[tuple[str, Iterable[str]]] = [
        ("methods", methods if several else ()),
        (chart, _physics_that_pays(case)),
        (chart, _runs_that_physics_saves(case)),
        ("gain", _headline(case)),
        ("cells", _method_sentence(case) if several else ()),
        ("horizon", _error_left(case)),
        ("gain", (*_harm_of_compensation(case), *_harm_of_data(case), *_against_constant_motion(case))),
        ("models", saw_test),
        ("cells", _how_to_read(case)),
    ]
    return [*caveats, *((text, anchor) for anchor, texts in parts for text in texts)]


def _missing_cells(results: Results) -> Iterator[str]:
    """What limits every sentence that follows: cells that are missing, and cells without a result."""
    cells, sentences = results.cells, []
    if not results.complete:
        sentences.append(f"{results.missing}: what follows is provisional")
    failed = cells[cells["status"] != "ok"]
    if len(failed):
        by_reason = failed.drop_duplicates("model").groupby("sentence", sort=False)["model"]
        why = "; ".join(f"{model_list(map(str, models))}: {reason}" for reason, models in by_reason)
        sentences.append(
            f"{len(failed)} of {len(cells)} cells {plural_word(len(failed), 'has', 'have')} no result ({why})"
        )
    if sentences:
        yield f"{'; '.join(sentences)}."


def _families_that_saw_the_test(results: Results) -> Iterator[str]:
    """Which families saw the test runs, so that no other sentence counts them."""
    if saw := families_set_from(results.plan, results.test.spans):
        it, them = plural_word(len(saw), "it is", "they are"), plural_word(len(saw), "it", "them")
        names = model_list(saw)
        yield f"The numbers of {names} were set from runs that test: {it} shown, and no other sentence counts {them}."


def _no_comparison(results: Results, rows: pd.DataFrame) -> str:
    """Why physics with data is compared with nothing, and the errors that are known; empty where it is compared."""
    plan, largest = results.plan, int(rows["N_D"].max()) if len(rows) else 0
    learns = any(way.method.compensates for way in plan.methods if way.name == verdict_method(plan))
    if learns and not rows[(rows["N_D"] == largest) & (rows["family"] != NO_MODEL)].empty:
        return ""
    if not learns:
        reason = f"The method {verdict_method(plan)!r} learns nothing from data"
    elif {name for name, way in plan.pairs if way.name == verdict_method(plan)} == {NO_MODEL}:
        reason = "No method that learns from data has physics in this study"
    else:
        return "No cell with physics and data that counts has a result yet, so there is no conclusion."
    cells = results.cells[(results.cells["status"] == "ok") & (results.cells["N_D"] == largest)]
    errors = _least_errors(cells.groupby("model")["H"].mean())
    return f"{reason}. Mean errors {_horizon_in_words(results)} ahead, with {count_runs(largest)}{errors}."


def _least_errors(errors: pd.Series[float]) -> str:
    """The least of some errors [m] by name, as the end of a sentence."""
    shown = errors.sort_values(kind="stable")[:MOST_SHOWN]
    of = f" (the least of {len(errors)})" if len(errors) > MOST_SHOWN else ""
    words = [f"{quoted_model(str(name))} {length_in_metres(value)}" for name, value in shown.items()]
    return f"{of}: {join_few_names(words, MOST_SHOWN)}"


def _horizon_in_words(results: Results) -> str:
    return f"{results.test.horizon * results.test.step:g} s"


def _physics_that_pays(case: AnswerCase) -> Iterator[str]:
    """How good physics must be to pay, at the smallest and at the largest amount of data."""
    if NO_MODEL not in case.table.H:
        planned = (NO_MODEL, verdict_method(case.results.plan)) in {
            (name, way.name) for name, way in case.results.plan.pairs
        }
        reason = "not every cell without physics has a result" if planned else "the study has no cell without physics"
        yield f"It is unknown whether physics harms, since {reason}."
        return
    parts = {amount: _limit_or_sides(case, amount) for amount in case.ends}
    each = ". With ".join(f"{count_runs(amount)} {part}" for amount, part in parts.items())
    if len(parts) == 2 and len(set(parts.values())) == 1:
        each = f"{case.smallest} or {count_runs(case.largest)} {parts[case.largest]}"
    yield f"How good must the physics be, {_horizon_in_words(case.results)} ahead? With {each}."


def _limit_or_sides(case: AnswerCase, amount: int) -> str:
    """Up to which error A physics pays, and which models do better than none; these alone where no A divides them."""
    sides, limit = case.against_none[amount]
    if not sides.better and not sides.worse:
        count = len(sides.unknown)
        which = "the physics model" if count == 1 else f"any of {count} physics models"
        return f"the test cannot tell {which} from no physics"
    models = _sides_in_words(case, sides)
    if limit is None:
        worst = max((case.table.mean(model, PHYSICS_ONLY) for model in case.fixed), default=0.0)
        all_pay = worst > 0 and not sides.worse and not sides.unknown
        return models + (f", even with an error A of {length_in_metres(worst)}" if all_pay else "")
    (least, most), bounds = map(length_in_metres, limit.limits), _bounds(limit, _short_length)
    if limit.above:
        return f"physics pays even with an error A of {most}, the worst tried{case.whole}{bounds}: {models}"
    if limit.below:
        return f"physics does not pay even with an error A of {least}, the best tried{case.whole}{bounds}: {models}"
    return f"physics pays if its error A is below about {_short_length(limit.value)} m{bounds}: {models}"


def _short_length(value: float) -> str:
    """A length with two digits: more would be pretence."""
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


def _bounds(estimate: Estimate, write: Callable[[float], str]) -> str:
    """` [low, high]` of an estimate, with what lies beyond all that was tried; nothing where all of it does."""
    (least, most), low, high = estimate.limits, estimate.low, estimate.high
    if not np.isfinite(low) or low >= most or high <= least:
        return ""
    low_words = f"at most {write(least)}" if low <= least else write(low)
    return f" [{low_words}, {f'over {write(most)}' if high >= most else write(high)}]"


def _runs_that_physics_saves(case: AnswerCase) -> Iterator[str]:
    """Error of the best model with the fewest runs, and how many runs give the same error without physics."""
    best, fewest, largest = case.best, case.smallest, case.largest
    if best is None or fewest == largest or NO_MODEL not in set(case.rows["family"]):
        return
    for name, of in ((NO_MODEL, "without physics"), (best, f"of {best}")):
        if name not in case.table.H:
            yield f"How many runs? Unknown: {of} not every cell has a result."
            return
    estimate = runs_without_physics(case.table, best, 0)
    bounds = _bounds(estimate, "{:.0f}".format)
    if estimate.above:
        pure = case.H(NO_MODEL, largest)
        text = f"without physics {count_runs(largest)} are not enough for that{bounds}: they give {pure}"
    elif estimate.below:
        do = plural_word(fewest, "does", "do")
        text = f"without physics the same {count_runs(fewest)} {do} as well{bounds}, {case.H(NO_MODEL, fewest)}"
    else:
        count = f"{estimate.value:.0f} runs{bounds}"
        text = f"without physics the same error takes about {count}, interpolated between amounts"
    yield f"How many runs? With {count_runs(fewest)}, {best} ({BEST}) has {case.H(best, fewest)} mean error; {text}."


def _headline(case: AnswerCase) -> Iterator[str]:
    """Error of the best model at the largest amount of data; of all models where none is known to be the best."""
    largest, rows = case.largest, case.at(case.largest).set_index("model")
    pure = case.rows[(case.rows["family"] == NO_MODEL) & (case.rows["N_D"] == largest)]
    without = f" Without physics: {case.H(NO_MODEL, largest)}." if len(pure) else ""
    if case.best is None:
        method = verdict_method(case.results.plan)
        text = f"no trial of the method {method!r} has a value, so no model is {BEST}. Mean errors "
        text += f"{_horizon_in_words(case.results)} ahead{_least_errors(rows['H'])}"
    else:
        alone, worst = (length_in_metres(float(rows[name][case.best])) for name in ("A", "H_90"))
        text = (
            f"{case.best} ({BEST}; {alone} mean error alone) predicts {_horizon_in_words(case.results)} ahead with "
            f"{case.H(case.best, largest)} mean error; nine errors in ten are below {worst}"
        )
    yield f"With {count_runs(largest)}, {text}.{without}"


def _method_sentence(case: AnswerCase) -> Iterator[str]:
    plan = case.results.plan
    words = f"The study has {len(learning_methods(plan))} methods that learn from data; the other sentences speak of"
    yield f"{words} {verdict_method(plan)!r}, the one that the study judges by."


def _sides_in_words(case: AnswerCase, sides: ModelSides) -> str:
    """Which models are better than no physics and which are worse."""
    count = len(sides.better) + len(sides.worse) + len(sides.unknown)
    if len(sides.better) == count:
        return f"every physics model{case.whole} does better than no physics"
    verb = "do" if len(sides.better) > 1 else "does" if sides.better or not sides.unknown else "is shown to do"
    parts = [f"{len(sides.better) or 'none'} of {count} physics models {verb} better than no physics"]
    if sides.worse:
        parts.append(f"{model_list(sides.worse)} {plural_word(len(sides.worse), 'does', 'do')} worse")
    if sides.unknown:
        parts.append(f"for {model_list(sides.unknown)} the test cannot tell")
    return "; ".join(parts)


def _error_left(case: AnswerCase) -> Iterator[str]:
    """How much of the error of physics alone is left, over the models that are not exact."""
    known = case.at(case.largest)
    known = known[known["A"] > 0]
    if len(known):
        left = known["H"] / known["A"]
        share, count = least_to_greatest(percent_text(left.min()), percent_text(left.max())), len(known)
        models = f"(over {count} {plural_word(count, 'model')})"
        yield f"Compensation with {count_runs(case.largest)} leaves {share} of the error of physics alone {models}."


def _harm_of_compensation(case: AnswerCase) -> Iterator[str]:
    """Which models are better without their compensator, and the best physics alone if nothing compensated beats it."""
    models, last = case.fixed, case.ends[case.largest]
    if not models:
        return
    sides = case.sides(
        models, case.table.compare([[(1.0, model, PHYSICS_ONLY), (-1.0, model, last)] for model in models])
    )
    if sides.worse:
        yield f"Compensation harms {model_list(sides.worse)}."
    if sides.unknown:
        yield f"It is not shown that compensation helps {model_list(sides.unknown)}."
    error, best = min((case.table.mean(model, PHYSICS_ONLY), model) for model in models)
    if len(sides.better) < len(models) and error < case.at(case.largest)["H"].min():
        yield f"Alone, {best} has {length_in_metres(error)}, less than any compensated model."


def _harm_of_data(case: AnswerCase) -> Iterator[str]:
    """Which models are not better with the most data than with the least."""
    if case.smallest == case.largest:
        return
    models = [name for name in dict.fromkeys(map(str, case.rows["model"])) if name in case.table.H]
    last, than = case.ends[case.largest], f"better than with {case.smallest}"
    sides = case.sides(models, case.table.compare([[(1.0, model, 0), (-1.0, model, last)] for model in models]))
    for names, how in ((sides.worse, "no"), (sides.unknown, "not clearly")):
        if names:
            are = plural_word(len(names), "is", "are")
            yield f"With {count_runs(case.largest)} {model_list(names)} {are} {how} {than}."


def _against_constant_motion(case: AnswerCase) -> Iterator[str]:
    """Which models do no better than constant u, v, r, at the largest amount of data."""
    results, table, last = case.results, case.table, case.ends[case.largest]
    models = [str(name) for name in case.rows["model"][case.rows["N_D"] == case.largest] if name in table.H]
    begins = f"Constant u, v, r give {length_in_metres(float(results.naive.mean()))}"
    if not models:
        yield f"{begins}."
        return
    errors = np.stack([table.by_run(model, last) for model in models])
    ahead = results.by_run(error_of_windows(results.naive)) - errors
    sides = case.sides(models, paired_difference(ahead, table.counts, errors @ table.weights * table.noise[last]))
    worse, unknown = sides.worse, sides.unknown
    parts = [f"{model_list(worse)} {plural_word(len(worse), 'is', 'are')} worse"] if worse else []
    parts += (
        [f"{model_list(unknown)} {plural_word(len(unknown), 'is', 'are')} not shown to beat them"] if unknown else []
    )
    text = ", and ".join(parts) or f"every model{case.whole} beats them"
    yield f"{begins}: at {count_runs(case.largest)} {text}."


def _how_to_read(case: AnswerCase) -> Iterator[str]:
    """What "no physics" is, what identified models, models set from the runs and known commands mean, and brackets."""
    results, plan, top = case.results, case.results.plan, case.at(case.largest)
    judged = next(way.method for way in plan.methods if way.name == verdict_method(plan))
    if NO_MODEL in case.table.H and judged.traits.mirror:
        yield '"No physics" may use that port and starboard are mirror images, which is a little physics.'
    fitted = top[top["family"].isin(fitted_families(plan))]
    if fitted["loss"].notna().any() and case.best not in set(fitted["model"]):
        lowest = str(fitted.iloc[int(fitted["loss"].argmin())]["model"])
        yield (
            "Models that were identified, or whose observer was chosen, were fitted to their validation runs, too, so "
            f"they cannot be called {BEST}: {lowest} has {case.H(lowest, case.largest)} with "
            f"{count_runs(case.largest)}."
        )
    trained = set(results.dataset.runs) - set(results.test.spans)
    saw = [name for name in families_set_from(plan, trained) if name in set(top["family"])]
    if saw and case.smallest < case.largest:
        yield (
            f"The numbers of {model_list(saw)} were set from runs that train, whatever the amount of data: the errors "
            "with few runs rest on the other runs, too."
        )
    if plan.study.prediction.commands == "known" and orders_may_react(plan):
        yield (
            "The orders of the next seconds were known. In a zigzag they reveal when the heading will reach its limit, "
            "so these errors show at best what knowing the plan can give: an upper bound of its worth."
        )
    if note := too_few_manoeuvres(case.table.runs):
        yield f"{note[0].upper()}{note[1:]}: every comparison here holds on this test and may not on another."
        return
    yield (
        f"Brackets are 95 % intervals over {count_manoeuvres(case.table.runs)} of one world. A test of several models "
        "is corrected for their number (Holm): one that a short list names may be missing in a longer one."
    )
    if case.smallest < case.largest and results.cells["seed"].nunique() == 1:
        yield (
            f"One seed drew the training runs. With other draws of {count_runs(case.smallest)} the errors may lie "
            "outside the brackets: more grid.seeds would show it."
        )
