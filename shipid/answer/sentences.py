"""From results to words: the answer in sentences, each with the anchor of the figure or table that carries it.

"Best" is always the model that validation prefers at the largest amount of data, never the lowest error on the test.
The first sentence names the best of all that a reader could use: physics, no physics, or the regression.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import pandas as pd

from shipid.answer.error_table import PHYSICS_ONLY, ErrorTable, Estimate, break_even, error_table, runs_without_physics
from shipid.answer.verdict import (
    length_with_interval,
    model_list,
    quoted_model,
    stricter_list,
    too_few_manoeuvres,
)
from shipid.evidence import SIGNIFICANT, Differences, log_error, paired_difference
from shipid.metrics import error_of_windows, position_error, summarise_errors
from shipid.report.wording import REGRESSION, counted_text, join_few_names, metres_text
from shipid.study.cells import EQUAL_WEIGHTS
from shipid.study.declared import NO_MODEL
from shipid.study.plan import families_set_from, fitted_families, learning_methods, orders_may_react, verdict_method
from shipid.study.results import Results
from shipid.units import plural_word

BEST = "best in validation"


def errors_by_model(results: Results) -> pd.DataFrame:
    """Mean over seeds of A, H_end, H_end_90, H [m] and validation loss [m^2] per foundation and N_D.

    The method is the one that the study judges by. Failed cells are left out.
    """
    cells = results.judged_cells
    ended = [[trial["value"] for trial in trials if trial["state"] == "complete"] for trials in cells["trials"]]
    loss = [min((value for value in values if value is not None), default=np.nan) for values in ended]
    grouped = cells.assign(loss=loss)[cells["status"] == "ok"].groupby(["model", "family", "N_D"], sort=False)
    return grouped[["A", "H_end", "H_end_90", "H", "loss"]].mean().reset_index()


def best_model(results: Results) -> str | None:
    """Name of the physics model with the lowest validation loss at the largest amount of data; None without a loss.

    Left out are families that a study sets aside and, where there are others, models fitted to the runs that validate
    them.
    """
    table = errors_by_model(results)
    table = table[~table["family"].isin(results.aside)]
    top = table[(table["N_D"] == table["N_D"].max()) & (table["family"] != NO_MODEL)]
    fair = top[~top["family"].isin(fitted_families(results.plan))]
    chosen = top if fair.empty else fair
    return None if chosen["loss"].isna().all() else str(chosen.iloc[int(chosen["loss"].argmin())]["model"])


@dataclass(frozen=True)
class AnswerCase:
    """Inputs of the sentences of one study, without families that are set aside.

    rows : as of `errors_by_model`. table : errors by test manoeuvre. at_horizon : those at the end of the horizon.
    best : as of `best_model`.
    """

    results: Results
    rows: pd.DataFrame
    table: ErrorTable
    at_horizon: ErrorTable
    best: str | None

    @cached_property
    def leader(self) -> str | None:
        """The best of the best physics model, no physics and the regression by validation loss with the most runs."""
        largest, plan, losses = self.table.amounts[-1], self.results.plan, self.results.regression_loss
        top = self.rows[self.rows["N_D"] == largest].set_index("model")["loss"]
        known = {name: float(top[name]) for name in (self.best, NO_MODEL) if name is not None and name in top}
        of_batches = [losses.get(batch.key, np.nan) for batch in plan.batches if largest == batch.N_D]
        known |= {REGRESSION: float(np.mean(of_batches))} if REGRESSION in self.table.H else {}
        first = self.best if plan.families else NO_MODEL
        ended = {name: loss for name, loss in known.items() if np.isfinite(loss)}
        return min(ended, key=ended.__getitem__) if first in ended else first

    @property
    def ends(self) -> dict[int, int]:
        """The least and the greatest N_D, each with its place in the error table."""
        return {self.table.amounts[place]: place for place in (0, len(self.table.amounts) - 1)}

    def with_physics(self, amount: int) -> pd.DataFrame:
        """Rows of physics models at an amount of data."""
        apart = [NO_MODEL, *(block.name for block in self.results.plan.study.model)]  # a mean has no A
        return self.rows[(self.rows["N_D"] == amount) & ~self.rows["family"].isin(apart)]

    def fixed_physics(self) -> list[str]:
        """Physics models whose numbers do not depend on the cell and that have a result in every one."""
        top = self.with_physics(self.table.amounts[-1])
        names = top["model"][~top["family"].isin(fitted_families(self.results.plan))]
        return [name for name in map(str, names) if name in self.table.H and name in self.table.A]

    @property
    def ahead(self) -> str:
        """The horizon in words."""
        return f"{self.results.test.horizon * self.results.test.step:g} s"

    def error(self, model: str, amount: int, metric: Literal["H", "H_end"] = "H") -> str:
        """H of a model, or its error at the horizon, with its interval, in words."""
        table = self.table if metric == "H" else self.at_horizon
        row, known = self.rows[(self.rows["model"] == model) & (self.rows["N_D"] == amount)], model in table.H
        error = float(row[metric].iloc[0]) if len(row) else table.mean(model, self.ends[amount])
        return length_with_interval(error, *(table.interval(model, self.ends[amount]) if known else (np.nan, np.nan)))

    def rival(self, name: str, best: str, amount: int, metric: Literal["H", "H_end"] = "H") -> str:
        """The same error of a rival, and whether the test shows that it differs from that of the best model."""
        error, table = self.error(name, amount, metric), self.table if metric == "H" else self.at_horizon
        if too_few_manoeuvres(table.runs):
            return f"{error}, too few test runs"
        if not {name, best} <= set(table.H):
            return f"{error}, not compared"
        more, less, _ = self.sides([best], table.lead(name, [best], self.ends[amount]))
        return f"{error}, {'shown to be larger' if more else 'shown to be less' if less else 'not shown to differ'}"

    def sides(self, models: Sequence[str], differences: Differences) -> list[list[str]]:
        """Models shown to be better (above 0), to be worse, and the others, each by its own test.

        By sign alone with too few manoeuvres.
        """
        if too_few_manoeuvres(self.table.runs):
            above, below = differences.mean > 0, differences.mean < 0
        else:
            above, below = differences.above <= SIGNIFICANT, differences.below <= SIGNIFICANT
        return [list(np.array(models)[chosen]) for chosen in (above, below, ~(above | below))]


def answer_sentences(results: Results, methods: Sequence[str] = ()) -> list[tuple[str, str]]:
    """A few sentences built from the results, each with the anchor of the figure that carries it.

    The error at the horizon comes first. methods : sentences that compare the methods; of a study of several that learn
    they come next.
    """
    rows, plan = errors_by_model(results), results.plan
    rows = rows[~rows["family"].isin(results.aside)]
    caveats = [(text, "cells") for text in _missing_cells(results)]
    seen = [(text, "models") for text in _caveats_of_families(results)]
    learns = any(way.method.compensates for way in plan.methods if way.name == verdict_method(plan))
    top = rows[rows["family"].ne(NO_MODEL) & rows["N_D"].eq(rows["N_D"].max())]
    if rows.empty or not learns or (top.empty and plan.families):
        cells = results.cells[results.cells["status"] == "ok"]
        cells = cells[cells["N_D"] == cells["N_D"].max()]
        words = "No result joins physics and data, so there is no conclusion."
        words += f" {_mean_errors(results, cells.groupby('model')['H_end'].mean())}" if len(cells) else ""
        return [*caveats, (words, "cells"), *seen]
    names, amounts = list(rows["model"].unique()), sorted(set(rows["N_D"]))
    table, at_horizon = (error_table(results, names, metric, amounts) for metric in ("H", "H_end"))
    case, learning = AnswerCase(results, rows, table, at_horizon, best_model(results)), learning_methods(plan)
    chart = "map" if len(case.ends) > 1 and top["model"].nunique() > 1 else "gain"
    several = f"Of {len(learning)} methods that learn from data the other sentences speak of {verdict_method(plan)!r}."
    of_physics: list[tuple[str, Iterable[str]]] = [
        (chart, _physics_that_pays(case)),
        ("gain", _mean_over_horizon(case)),
        ("gain", _means_over_foundations(case)),
        (chart, _runs_that_physics_saves(case)),
    ]
    parts: list[tuple[str, Iterable[str]]] = [
        ("horizon", _headline(case)),
        ("methods", methods if len(learning) > 1 else ()),
        *(of_physics if plan.families else ()),
        ("cells", [several] if len(learning) > 1 else ()),
        ("gain", _reservations(case)),
        ("cells", _how_to_read(case)),
    ]
    return [*caveats, *((text, anchor) for anchor, texts in parts for text in texts), *seen]


def _missing_cells(results: Results) -> Iterator[str]:
    """What limits every sentence that follows: cells that are missing, and cells without a result."""
    if not results.complete:
        yield f"{results.missing}: what follows is provisional."
    failed = results.cells[results.cells["status"] != "ok"]
    if len(failed):
        by_reason = failed.drop_duplicates("model").groupby("sentence", sort=False)["model"]
        why = "; ".join(f"{model_list(map(str, models))}: {reason}" for reason, models in by_reason)
        have = plural_word(len(failed), "has", "have")
        yield f"{len(failed)} of {len(results.cells)} cells {have} no result ({why})."


def _caveats_of_families(results: Results) -> Iterator[str]:
    """Which models diverge, and which families know more runs than the others, of the test or of training."""
    counts = results.models.filter(like="diverged_").sum(axis=1)
    if counts.any():
        lost = results.models[counts > 0]
        training, test = lost.filter(like="diverged_").sum()
        yield (
            f"The physics of {model_list(lost['model'])} diverges on {training:.0f} training and {test:.0f} test "
            "windows: a path then keeps its last velocity, no farther than the present speed takes the ship."
        )
    cells = results.cells[
        results.cells["family"].isin(fitted_families(results.plan)) & (results.cells["physics_diverged"] > 0)
    ]
    if len(cells):
        where = f"on test windows of {counted_text(len(cells), 'cell')}"
        yield f"Fitted to the runs, the physics of {model_list(cells['model'].unique())} diverges {where}."
    if floor := sorted(results.aside - results.saw_test):
        yield (
            f"The family {model_list(floor)} is set aside ([claims] nominal): the base as it is, the floor for models "
            "made worse. It is in figures, tables and bands, but not among the models compared above."
        )
    saw = families_set_from(results.plan, results.test.spans)
    if saw:
        yield f"The numbers of {model_list(saw)} were set from runs that test: shown, but counted in no other sentence."
    trained = families_set_from(results.plan, set(results.dataset.runs) - set(results.test.spans))
    if knew := [name for name in trained if name not in saw]:
        yield f"The numbers of {model_list(knew)} were set from runs that train, whatever the amount of data."


def _mean_errors(results: Results, errors: pd.Series[float]) -> str:
    """Some errors [m] by name, the least of them first, as a sentence."""
    known = errors.sort_values(kind="stable").items()
    words = [f"{quoted_model(str(name))} {metres_text(value)}" for name, value in known]
    return f"Mean errors {results.test.horizon * results.test.step:g} s ahead: {join_few_names(words)}."


def _physics_that_pays(case: AnswerCase) -> Iterator[str]:
    """How good physics must be to pay, at the smallest and at the largest amount of data; then which models do."""
    if NO_MODEL not in case.table.H:
        planned = NO_MODEL in set(case.rows["model"])
        why = "not every cell without physics has a result" if planned else "no method here predicts without physics"
        yield f"It is unknown whether physics harms, since {why}."
        return
    limits, counts = {}, {}
    for amount, place in case.ends.items():
        models = [str(name) for name in case.with_physics(amount)["model"] if name in case.table.H]
        lead = case.table.lead(NO_MODEL, models, place)
        counts[amount] = _count_of_better(models, lead, case.sides(models, lead))
        if limit := _limit_of_accuracy(case, place, models, lead):
            limits[amount] = limit
    for words in (limits, counts):
        alike = len(words) == len(case.ends) == 2 and len(set(words.values())) == 1
        ends = " or ".join(map(str, words))
        for amount, part in [*words.items()][: 1 if alike else None]:
            yield f"With {ends if alike else amount} {plural_word(max(words) if alike else amount, 'run')}, {part}."


def _count_of_better(models: Sequence[str], lead: Differences, sides: Sequence[list[str]]) -> str:
    """How many physics models do better than none, and which do worse or cannot be told."""
    better, worse, unknown = sides
    how = "worse" if len(worse) == len(models) else "better"
    named, shown = (worse, lead.below) if how == "worse" else (better, lead.above)
    count = f"{len(named) or 'none'} of {len(models)}"
    if len(named) == len(models) > 1:
        count = "both" if len(models) == 2 else f"all {len(models)}"
    verb = plural_word(len(named), "does", "do") if named else "is shown to do"
    words = [
        f"{count} physics models {verb} {how} than no physics over the whole horizon"
        + (f": {model_list(named)}" if 0 < len(named) < len(models) else "")
        + stricter_list(models, shown)
    ]
    do, unsure = plural_word(len(worse), "does", "do"), model_list(unknown) if better or worse else "all of them"
    words += [f"{model_list(worse)} {do} worse{stricter_list(models, lead.below)}"] if worse and how == "better" else []
    words += [f"for {unsure} the test cannot tell"] if unknown else []
    return "; ".join(words)


def _limit_of_accuracy(case: AnswerCase, place: int, models: Sequence[str], lead: Differences) -> str:
    """Up to which error A physics pays; empty where no A is shown to pay, or not to.

    models, lead : those that the next sentence counts: which of them do not go by this limit is said at once.
    """
    limit = break_even(case.table, case.fixed_physics(), place)
    if limit is None or (limit.low <= limit.limits[0] and limit.high >= limit.limits[1]):
        return ""
    odd_words, A = "", "its own mean error over the horizon, A,"
    known = {name: case.table.mean(name, PHYSICS_ONLY) for name in models if name in case.table.A}
    better, worse, _ = case.sides(models, lead)
    odd = {"better": [name for name in better if known.get(name, 0) > limit.value]}
    odd["worse"] = [name for name in worse if known.get(name, np.inf) < limit.value]
    for how, names in odd.items():
        named = join_few_names([f"{name} (A {metres_text(known[name])})" for name in names])
        odd_words += f"; yet {named} {plural_word(len(names), 'does', 'do')} {how}" if names else ""
    bounds = _bounds(limit, _two_digits) + odd_words
    if limit.above:
        return f"physics pays even if {A} is {metres_text(limit.limits[1])}, the worst tried{bounds}"
    if limit.below:
        return f"physics does not pay even if {A} is {metres_text(limit.limits[0])}, the best tried{bounds}"
    if not better and limit.low <= limit.limits[0]:
        return f"physics is not shown to pay; where {A} is above {_two_digits(limit.high)} m, it does not{odd_words}"
    return f"physics pays if {A} is below about {_two_digits(limit.value)} m{bounds}"


def _two_digits(value: float) -> str:
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
    best, fewest, largest = case.best, case.table.amounts[0], case.table.amounts[-1]
    if best is None or fewest == largest or not {NO_MODEL, best} <= set(case.table.H):
        return
    estimate = runs_without_physics(case.table, best, 0)
    bounds, runs = _bounds(estimate, "{:.0f}".format), counted_text(fewest, "run")
    text = f"Without physics the same error takes about {estimate.value:.0f} runs{bounds}, interpolated between amounts"
    if estimate.above:
        text = f"Without physics {counted_text(largest, 'run')} are not shown to be enough for that{bounds}. They give "
        text += case.error(NO_MODEL, largest)
    elif estimate.below:
        do = plural_word(fewest, "does", "do")
        text = f"Without physics the same {runs} {do} as well{bounds}. H is then {case.error(NO_MODEL, fewest)}"
    called = f" ({BEST})" * (best == case.leader)
    yield f"How many runs? With {runs}, H of {best}{called} is {case.error(best, fewest)}. {text}."


def _headline(case: AnswerCase) -> Iterator[str]:
    """Error at the horizon of the best model at the largest amount of data; of all where none is known as best."""
    best, largest = case.best, case.table.amounts[-1]
    rows, runs = case.rows[case.rows["N_D"] == largest].set_index("model"), counted_text(largest, "run")
    leader, plan, of_others = str(case.leader), case.results.plan, list[str]()
    if case.leader is None:
        yield f"With {runs}, no model is {BEST}. {_mean_errors(case.results, rows['H_end'])}"
        return
    for name, text in ((best, f"With physics ({best})"), (NO_MODEL, "Without physics")):
        if name != leader and name in rows.index:
            of_others.append(f" {text}: {case.rival(str(name), leader, largest, 'H_end')}.")
    place, table = case.ends[largest], case.at_horizon
    if leader == REGRESSION:
        paths = [case.results.regression[batch.key] for batch in plan.batches if largest == batch.N_D]
        most = float(np.mean([summarise_errors(position_error(p, case.results.test.future))["end_90"] for p in paths]))
    else:
        most = float(rows["H_end_90"][leader])
        if {REGRESSION, leader} <= set(table.H) and table.mean(REGRESSION, place) < table.mean(leader, place):
            of_others.append(f" A regression errs by less: {case.rival(REGRESSION, leader, largest, 'H_end')}.")
    names = {NO_MODEL: "no physics" if plan.families else "data alone", REGRESSION: "a regression on accelerations"}
    yield (
        f"{case.ahead} ahead, {names.get(leader, leader)} ({BEST}) with {runs} errs by "
        f"{case.error(leader, largest, 'H_end')} on average, nine in ten below {metres_text(most)}.{''.join(of_others)}"
    )


def _mean_over_horizon(case: AnswerCase) -> Iterator[str]:
    """H of the best model at the largest amount of data, and what it is the mean of."""
    best, largest = case.best, case.table.amounts[-1]
    rows = case.rows[case.rows["N_D"] == largest].set_index("model")
    if best is not None:
        yield (
            f"H is the mean error over all {case.ahead}, not only at their end: {case.error(best, largest)} for {best} "
            f"with {counted_text(largest, 'run')}. Its physics alone has A = {metres_text(float(rows['A'][best]))}."
            + (f" Without physics H is {case.rival(NO_MODEL, best, largest)}." if NO_MODEL in rows.index else "")
        )


def _means_over_foundations(case: AnswerCase) -> Iterator[str]:
    """H of each mean over foundations at the largest amount of data, beside the best model."""
    table, largest = case.table, case.table.amounts[-1]
    for name in (block.name for block in case.results.plan.study.model if {block.name, case.best} <= set(table.H)):
        sides = case.sides([name], table.lead(str(case.best), [name], case.ends[largest]))
        verdict = ("lower than", "higher than", "not shown to differ from")[[bool(side) for side in sides].index(True)]
        text = f"With {counted_text(largest, 'run')} {name}, a mean of foundations, has H {case.error(name, largest)}"
        notes = case.results.judged_cells.set_index("foundation")["sentence"][[name]]
        equal = f"; {EQUAL_WEIGHTS}" if notes.str.contains(EQUAL_WEIGHTS, regex=False).any() else ""
        yield f"{text}: {verdict} that of {case.best}{equal}."


def _reservations(case: AnswerCase) -> Iterator[str]:
    """Which models compensation, more data or a prediction at all does not make better than what is simpler."""
    table, fixed, smallest, largest = case.table, case.fixed_physics(), case.table.amounts[0], case.table.amounts[-1]
    last, models = case.ends[largest], [str(name) for name in case.rows["model"].unique() if name in table.H]
    if fixed:
        gain = table.compare([[(1.0, name, PHYSICS_ONLY), (-1.0, name, last)] for name in fixed])
        sides = case.sides(fixed, gain)
        yield from _sentences_on_sides(sides, "Compensation harms", "It is not shown that compensation helps")
    if models and smallest < largest:
        gain = table.compare([[(1.0, name, 0), (-1.0, name, last)] for name in models])
        are = f"{counted_text(largest, 'run')} are"
        sides = case.sides(models, gain)
        yield from _sentences_on_sides(
            sides, f"{are} worse than {smallest} for", f"{are} not clearly better than {smallest} for"
        )
    if models:
        yield from _no_better_than_constant(case, models)
    if models and REGRESSION in table.H:
        yield from _no_better_than_regression(case, models)


def _no_better_than_constant(case: AnswerCase, models: Sequence[str]) -> Iterator[str]:
    """Which models do not beat constant u, v, r, with the fewest and with the most runs."""
    constant, beaten = f"constant u, v, r (H {metres_text(float(case.results.naive.mean()))})", []
    naive = log_error(case.results.by_run(error_of_windows(case.results.naive)))
    for amount, place in case.ends.items():
        ahead = naive - np.stack([log_error(case.table.draws(name, place)).mean(axis=0) for name in models])
        noise = case.table.noise([[(1.0, name, place)] for name in models])
        sides, runs = case.sides(models, paired_difference(ahead, *noise)), counted_text(amount, "run")
        unknown = f"With {runs} it is not shown that {constant} are beaten by"
        yield from _sentences_on_sides(sides, f"With {runs} {constant} beat", unknown)
        beaten += [str(amount)] if len(sides[0]) == len(models) else []
    if beaten:
        run = plural_word(int(beaten[-1]), "run")
        yield f"With {' and '.join(beaten)} {run}, every compared model beats {constant}."


def _no_better_than_regression(case: AnswerCase, models: Sequence[str]) -> Iterator[str]:
    """Which models, and which physics alone, do not beat a regression on the same runs."""
    table, fixed = case.table, case.fixed_physics()
    for amount, place in case.ends.items():
        words, too = [], ", physics alone too," if fixed else ""
        rivals = [(models, place, "with the same runs"), (fixed, PHYSICS_ONLY, "as physics alone")]
        for names, column, how in rivals[: 2 if fixed else 1]:
            lead = table.compare([[(1.0, REGRESSION, place), (-1.0, name, column)] for name in names])
            _, worse, unknown = case.sides(names, lead)
            words += [f"beats {model_list(worse)} {how}"] if worse else []
            words += [f"is not shown to be beaten by {model_list(unknown)} {how}"] if unknown else []
        one = f"regression on accelerations of {counted_text(amount, 'run')} (H {table.metres(REGRESSION, place)})"
        yield f"A {one} {'; it '.join(words)}." if words else f"All compared models{too} beat a {one}."


def _sentences_on_sides(sides: Sequence[Sequence[str]], worse: str, unknown: str) -> Iterator[str]:
    """A sentence on the models that are worse and one on those that are not known to be better, if there are any."""
    for words, models in ((worse, sides[1]), (unknown, sides[2])):
        if models:
            yield f"{words} {model_list(models)}."


def _how_to_read(case: AnswerCase) -> Iterator[str]:
    """What identified models and known commands mean, and what the brackets are."""
    plan, amounts, runs = case.results.plan, case.table.amounts, case.table.runs
    if set(case.rows["family"]) & set(fitted_families(plan)):
        yield f"Identified models were fitted to the runs that validate them: they are not called {BEST}."
    if plan.study.prediction.commands == "known" and orders_may_react(plan):
        yield (
            "The orders of the next seconds were known. In a zigzag they reveal when the heading will reach its limit, "
            "so these errors are an upper bound of what knowing the plan is worth."
        )
    if note := too_few_manoeuvres(runs):
        yield f"{note[0].upper()}{note[1:]}: every comparison here holds on this test and may not on another."
        return
    drawn = max((len(errors[0]) for errors in case.table.H.values()), default=1)
    draws = (
        f"and {drawn} draws of {counted_text(amounts[0], 'training run')}: where the mean of many such runs is expected"
    )
    alone = "of one draw of training runs: errors with other draws may lie outside"
    yield (
        f"Brackets are 95 % intervals over {counted_text(runs, 'test manoeuvre')} {draws if drawn > 1 else alone}. "
        "Models are compared run by run, by the logarithm of H."
    )
