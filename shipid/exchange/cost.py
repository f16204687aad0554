"""What to buy: the cheapest physics and number of runs to a goal, what more of each would buy, and when to stop.

A way is one kind of physics with a number of runs. How far it errs is not known before: each way has predictive draws
of its error, and draw i of all ways is one and the same ship. The step to take, more runs or other physics, has the
least expected loss over the draws (Raiffa and Schlaifer 1961), with all that may follow when its errors are seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations, product
from operator import itemgetter

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.errors import ShipidError
from shipid.exchange.expect import study_cells
from shipid.exchange.law import read_law
from shipid.report.content import model_text
from shipid.report.wording import CONSTANT_MOTION, counted_text, difference_text, metres_text, price_text
from shipid.study.declared import NO_MODEL
from shipid.study.results import Results
from shipid.study.schema import Cost
from shipid.units import percent_text

Array = NDArray[np.float64]
DRAWS = 1000
PROBABLE = 0.8  # chance from which on a way is said to reach a goal
MOST_BOUGHT = 4  # physics that are thought to be bought one after the other
AMOUNTS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 100)
"""Numbers of runs that are tried."""


@dataclass(frozen=True, eq=False)
class Ways:
    """All ways from here on, with their prices and predictive draws of their errors.

    foundations : names (F,) of the physics. amounts : (K,) runs in all, rising; the first are there already.
    error : (draws, F, K) mean error at the horizon [m]; no physics without runs is constant u, v, r.
    prices : (F,) of each physics, in the unit of `cost`; 0 of what is paid already or free.
    """

    cost: Cost
    foundations: Sequence[str]
    amounts: Array
    error: Array
    prices: Array

    @cached_property
    def runs(self) -> Array:
        """(K,) price of the runs that are not there yet; whoever has none mobilises first."""
        more = self.amounts - self.amounts[0]
        return np.where(more > 0, self.cost.run * more + self.cost.mobilisation * (self.amounts[0] == 0), 0.0)

    @property
    def price(self) -> Array:
        """(F, K) price of each way."""
        return np.asarray(self.prices[:, None] + self.runs)

    @property
    def goal(self) -> float:
        """Error that is to be reached [m]; NaN where a metre has a price."""
        return np.nan if self.cost.H_end_required is None else self.cost.H_end_required

    @property
    def expected(self) -> Array:
        """(F, K) expected loss of each way: its price and what its error costs; NaN towards a goal."""
        metre = np.nan if self.cost.per_metre is None else self.cost.per_metre
        return np.asarray(self.price + metre * self.error.mean(axis=0))

    def least(self, bought: Sequence[int] = ()) -> Array:
        """(draws, K) error in use of whoever has what is paid and some more physics: the least that is seen.

        Without runs nothing is seen: it is that of the physics which is expected to err least.
        """
        have = self.error[:, (self.prices == 0) | np.isin(np.arange(len(self.prices)), bought)]
        unseen = have[:, have[:, :, 0].mean(axis=0).argmin(), :1]
        return np.where(self.amounts > 0, have.min(axis=1), unseen)

    @cached_property
    def steps(self) -> dict[str | int, float]:
        """Expected loss from here on of each step that can be taken now, if every later one is the best; least first.

        Steps are "run", to the next amount, "stop", or the place of the physics to buy. Towards a goal whoever sees it
        reached stops, and nobody else does as long as there is a way on.

        States are amounts and sets of physics, the last first. In each the draws take the step of the least loss, as
        far as what is seen there tells (`take_best_steps`).
        """
        priced, metre = np.flatnonzero(self.prices > 0).tolist(), self.cost.per_metre
        later: dict[tuple[int, ...], Array] = {}  # physics to buy -> (draws,) loss from there on
        sets = [one for size in range(min(len(priced), MOST_BOUGHT), -1, -1) for one in combinations(priced, size)]
        least = {bought: self.least(bought) for bought in sets}
        for k, bought in product(reversed(range(len(self.amounts))), sets):
            wider = {g: tuple(sorted((*bought, g))) for g in priced if g not in bought}
            losses: dict[str | int, Array] = {}
            if bought in later:
                losses["run"] = self.runs[k + 1] - self.runs[k] + later[bought]
            if metre is not None:
                losses["stop"] = metre * least[bought][:, k]
            losses |= {g: self.prices[g] + later[one] for g, one in wider.items() if one in later}
            losses = losses or {"stop": np.full(len(self.error), self.prices[[*wider]].sum())}
            still = ~((least[bought][:, k] <= self.goal) & (self.amounts[k] > 0))
            if not (bought or k):
                break
            seen = [place for place in {(k + 1) // 2, k} if self.amounts[place] > 0]
            later[bought] = np.zeros(len(still))
            if still.any():
                each = np.stack([*losses.values()], axis=1)[still]
                later[bought][still] = take_best_steps(each, np.log(least[bought][still][:, seen]))
        expected = {step: float((loss * still).mean()) for step, loss in losses.items()}
        return dict(sorted(expected.items(), key=itemgetter(1)))

    @property
    def reach(self) -> Array:
        """(F, K) chance that a way errs by no more than the goal; NaN without a goal."""
        return np.asarray((self.error <= self.goal).mean(axis=0) + 0 * self.goal)

    def best(self, place: int | None = None) -> tuple[int, int]:
        """Places (f, k) of the best way, or of the best one with one physics.

        By expected loss; towards a goal the cheapest that reaches it with `PROBABLE`, or the surest where none does.
        """
        one = np.full(len(self.prices), place is None)[:, None] | (np.arange(len(self.prices)) == place)[:, None]
        rank = self.expected
        if self.cost.per_metre is None:
            rank = np.where(self.reach >= PROBABLE, self.price, (2 - self.reach) * (1 + self.price.max()))
        f, k = np.unravel_index(np.where(one, rank, np.inf).argmin(), rank.shape)
        return int(f), int(k)

    def table(self) -> pd.DataFrame:
        """A row per way: foundation, N_D, price, H_end, low, high, probability, expected loss.

        H_end is the median of the error [m], low and high its 95 % interval. chosen : the best of its foundation.
        frontier : every cheaper way has a larger error. unit, goal [m] : of all rows.
        """
        low, middle, high = np.quantile(self.error, [0.025, 0.5, 0.975], axis=0)
        chosen = np.zeros(middle.shape, dtype=bool)
        chosen[tuple(np.transpose([self.best(place) for place in range(len(self.prices))]))] = True
        names, amounts = np.meshgrid(list(self.foundations), self.amounts.astype(int), indexing="ij")
        columns = {"foundation": names, "N_D": amounts, "price": self.price, "H_end": middle, "low": low, "high": high}
        columns |= {"probability": self.reach, "expected": self.expected, "chosen": chosen}
        frame = pd.DataFrame({name: values.ravel() for name, values in columns.items()})
        cheaper = frame.sort_values(["price", "H_end"])["H_end"].cummin().shift(fill_value=np.inf).sort_index()
        return frame.assign(frontier=frame["H_end"] < cheaper, unit=self.cost.unit, goal=self.goal)

    def sentences(self) -> list[str]:
        """What to buy, what further runs and other physics would change, what to do next, and when to stop."""
        cost, (f, k) = self.cost, self.best()
        goal, way = cost.H_end_required, self.way_text(f, k)
        aim = "The cheapest way in all" if goal is None else f"The cheapest way to {metres_text(goal)} at the horizon"
        lines = [f"{aim}, of those tried, is {way}."]
        others = [self.way_text(*self.best(g)) for g in range(len(self.prices)) if g != f]
        if self.reach[f, k] < PROBABLE:
            lines = [f"No way that was tried is likely to reach {metres_text(self.goal)}; the surest is {way}."]
        lines += [f"The best with other physics: {'; '.join(others)}."] if others else []
        if self.reach[f, k] >= PROBABLE and self.price[f, k] == 0:
            return [*lines, "Stop here: nothing has to be bought."]
        step, *rest = self.steps
        money = {one: "about " + price_text(float(f"{loss:.2g}"), cost.unit) for one, loss in self.steps.items()}
        text = (
            f"Next: {self.step_text(step)}. If all later steps are the best, expect {money[step]} "
            f"{'in all' if goal else 'with what the error costs'}"
        )
        instead = [f"{money[one]} if you {self.step_text(one)}" for one in rest]
        text += f"; instead, {', '.join(instead)}" if instead else ""
        least = metres_text(cost.run / (cost.per_metre or 1))
        return [
            *lines,
            f"{text}.",
            f"Stop when a further run lowers the error by less than {least}: a run costs as much."
            if goal is None
            else f"Stop as soon as runs show {metres_text(goal)} or less.",
        ]

    def step_text(self, step: str | int) -> str:
        """What to do, what it costs, and the error that is expected then, in words."""
        if step == "stop":
            return f"stop (error {metres_text(np.median(self.least()[:, 0]))})"
        if isinstance(step, str):
            text = counted_text(int(self.amounts[1]), "run")
            text = f"go on from {int(self.amounts[0])} to {text}" if self.amounts[0] else f"make {text}"
            price, error = self.runs[1], self.least()[:, 1]
        else:
            price, error = self.prices[step], self.error[:, step, 0]
            text = f"buy {model_text(self.foundations[step])}"
        return f"{text} ({price_text(price, self.cost.unit)}, error {metres_text(np.median(error))})"

    def way_text(self, f: int, k: int) -> str:
        """A way, its price, its error, and its chance or its loss, in words."""
        low, middle, high = np.quantile(self.error[:, f, k], [0.025, 0.5, 0.975])
        text = f"{model_text(self.foundations[f])} with {counted_text(int(self.amounts[k]), 'run')} for "
        text = f"{CONSTANT_MOTION} for " if self.foundations[f] == NO_MODEL and self.amounts[k] == 0 else text
        text += f"{price_text(self.price[f, k], self.cost.unit)}: {difference_text(middle, low, high)}"
        if self.cost.per_metre is None:
            return f"{text}, a chance of {percent_text(self.reach[f, k])}"
        return f"{text}, {price_text(self.expected[f, k], self.cost.unit)} with what the error costs"


def take_best_steps(losses: Array, seen: Array) -> Array:
    """(draws,) loss of each draw by the step of the least loss (draws, steps), as far as what is seen tells.

    seen : (draws, S). Losses are regressed on it and its squares (Longstaff and Schwartz 2001, Review of Financial
    Studies 14), with ten draws or more for each number that is learned.
    """
    x = (seen - seen.mean(axis=0)) / np.maximum(seen.std(axis=0), 1e-9)
    basis = np.hstack([np.ones((len(x), 1)), x, *(x[:, [i]] * x[:, i:] for i in range(x.shape[1]))])
    basis = basis[:, : max(len(x) // 10, 1)]
    found = basis @ np.linalg.lstsq(basis, losses)[0]
    return np.asarray(np.take_along_axis(losses, found.argmin(axis=1)[:, None], axis=1)[:, 0])


def errors_in_use(error: Array) -> Array:
    """Errors (..., F, K) of whoever sees on runs that the physics alone, or constant u, v, r, err less, and takes them.

    The first amount is 0, where the errors are those of the physics alone, and for the first foundation, no physics,
    those of constant u, v, r.
    """
    least = np.minimum(error[..., :1], error[..., :1, :1])
    return np.concatenate([error[..., :1], np.minimum(error[..., 1:], least)], axis=-1)


@lru_cache(1)
def study_ways(results: Results) -> Ways:
    """Ways to the goal of a study that has `[cost]`, by the law given the cells of the study.

    Recorded runs that may train are there already. The runs that test are drawn again, alike for all ways (bootstrap).
    A name of `[cost.foundations]` is a family, of which each draw is one member, or a kind of physics that has not been
    tried. Raises ShipidError where no vessel has a length, or no cell a result.
    """
    cost = results.plan.study.cost
    assert cost is not None
    own, ship = study_cells(results)
    ends = results.judged_cells.query("status == 'ok'")
    have = results.pool if results.plan.study.data is not None else 0
    amounts = [have, *(amount for amount in AMOUNTS if amount > have)]
    names = [NO_MODEL, *cost.foundations]
    members = [list(own["foundation"][own["family"] == name].unique()) or [name] for name in names]
    law, asked = read_law().given(own), [one for several in members for one in several]
    drawn = law.expect_all(ship, asked, sorted({0, *amounts}), float(own["ahead"].iloc[0]), DRAWS)
    first = np.cumsum([0, *map(len, members[:-1])])
    taken = first + np.random.default_rng(0).integers([len(several) for several in members], size=(DRAWS, len(names)))
    error = errors_in_use(drawn[np.arange(DRAWS)[:, None], taken])[:, :, -len(amounts) :]
    error = error * float((ends["H_end"] / ends["H"]).median()) * _other_tests(results)[:, None, None]
    prices = np.array([0.0, *cost.foundations.values()])
    return Ways(cost, names, np.array(amounts, dtype=float), error, prices)


def _other_tests(results: Results) -> Array:
    """(DRAWS,) how many times as hard as this one other tests are: by constant u, v, r on its runs, drawn again."""
    _, run = np.unique(results.test.run, return_inverse=True)
    hard = np.bincount(run, results.naive.mean(axis=0)) / np.bincount(run)
    again = np.random.default_rng(1).integers(len(hard), size=(DRAWS, len(hard)))
    return np.asarray(hard[again].mean(axis=1) / hard.mean())


def cost_frame(results: Results) -> pd.DataFrame:
    """The table of the ways of a study, see `Ways.table`; empty where there are none."""
    try:
        return pd.DataFrame() if results.plan.study.cost is None else study_ways(results).table()
    except ShipidError:
        return pd.DataFrame()


def cost_sentences(results: Results) -> list[str]:
    """What a study says on what to buy; nothing where it has no `[cost]`."""
    try:
        study = results.plan.study
        if study.cost is None:
            return []
        there = f"Its {counted_text(results.pool, 'run')} of training are paid: they count."
        if study.data is None:
            most = counted_text(int(results.judged_cells["N_D"].max()), "run")
            there = f"This study simulated up to {most}; at sea none is there yet, so runs count from 0."
        return [*study_ways(results).sentences(), there]
    except ShipidError as error:
        return [f"What to buy cannot be said: {error.message}."]
