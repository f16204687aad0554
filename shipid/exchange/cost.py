"""What to buy: the cheapest physics and number of runs to a goal, what more of each would buy, and when to stop.

A way is one kind of physics with a number of runs. How far it errs is not known before: each way has predictive draws
of its error, and draw i of all ways is one and the same ship. A decision has the least expected loss over the draws
(Raiffa and Schlaifer 1961). What runs would tell before they are there is the expected least loss after them: losses
are regressed on the errors that would be seen (Strong, Oakley and Brennan 2014, Medical Decision Making 34).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

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
    def good(self) -> NDArray[np.bool_]:
        """(draws, F, K) whether a way errs by no more than the goal."""
        goal = self.cost.H_end_required
        return np.asarray(self.error <= (np.nan if goal is None else goal))

    @cached_property
    def losses(self) -> Array:
        """(draws, F, K) of each way: its price and its error in money, or, towards a goal, what is paid until it.

        Towards a goal the way (f, k) runs with what is paid already up to amount k, then buys f, and goes on until the
        goal is seen, which takes one run at least. Where all runs do not reach it, the surest physics is bought too,
        and everything where that does not help.
        """
        if self.cost.per_metre is not None:
            return np.asarray(self.price + self.cost.per_metre * self.error)
        last = len(self.amounts)
        good = self.good & (self.amounts > 0)
        first = np.where(good.any(axis=2), good.argmax(axis=2), last)  # (draws, F)
        paid = first[:, self.prices == 0].min(axis=1, initial=last)[:, None, None]
        place = np.arange(last)
        ends = np.minimum(np.maximum(first[:, :, None], place), np.maximum(paid, place))
        spent = np.append(self.runs, self.runs[-1])[ends] + self.prices[:, None]
        surest = int(np.where(self.prices > 0, (first < last).mean(axis=0), -1.0).argmax())
        left = self.prices.sum() - self.prices
        rest = np.where(first[:, [surest]] < last, np.minimum(self.prices[surest], left), left)[:, :, None]
        spent = np.where(ends == last, spent + rest, spent)
        return np.asarray(np.where(paid <= place, np.append(self.runs, 0.0)[paid], spent))

    @cached_property
    def expected(self) -> Array:
        """(F, K) expected loss of each way."""
        return np.asarray(self.losses.mean(axis=0))

    def look(self, place: int, seen: NDArray[np.bool_]) -> float:
        """Expected loss of whoever runs up to a place of the amounts, sees the errors of some physics, then decides.

        The decision is learned on one half of the draws and judged on the other: else it would look too good.
        """
        places = sorted({p for p in ((place + 1) // 2, place) if self.amounts[p] > 0})
        known = np.log(self.error[:, seen][:, :, places].reshape(len(self.error), -1))
        known = (known - known.mean(axis=0)) / np.maximum(known.std(axis=0), 1e-9)
        squares = [known[:, [i]] * known[:, i:] for i in range(known.shape[1])]
        basis = np.hstack([np.ones((len(known), 1)), known, *squares])
        losses = self.losses[:, :, place:].reshape(len(known), -1)
        values = []
        for learned, judged in ((slice(0, None, 2), slice(1, None, 2)), (slice(1, None, 2), slice(0, None, 2))):
            found = basis[judged] @ np.linalg.lstsq(basis[learned], losses[learned])[0]
            values.append(np.take_along_axis(losses[judged], found.argmin(axis=1)[:, None], axis=1).mean())
        return float(np.mean(values))

    @cached_property
    def after_runs(self) -> Array:
        """(K - 1,) expected loss of whoever goes on to each larger amount, looks at what is paid, and then decides."""
        return np.array([self.look(place, self.prices == 0) for place in range(1, len(self.amounts))])

    @cached_property
    def after_buying(self) -> Array:
        """(F,) expected loss of whoever buys each physics now, looks at it on the runs that are there, then decides.

        Without runs there is nothing to look at: it is bought now only by whoever stops there.
        """
        if self.amounts[0] == 0:
            return np.asarray(
                np.where((self.prices > 0) & (self.cost.per_metre is not None), self.expected[:, 0], np.inf)
            )
        values = np.full(len(self.prices), np.inf)
        for f in np.flatnonzero(self.prices > 0):
            one = np.arange(len(self.prices)) == f
            values[f] = self.prices[f] + replace(self, prices=np.where(one, 0.0, self.prices)).look(0, one)
        return values

    def next_step(self) -> tuple[int | None, int | None]:
        """The amount of runs to go on to at least, or the place of the physics to buy now; neither: it is time to stop.

        Each step is worth what it costs and what it tells. Towards a goal nobody stops as long as there is a way on.
        """
        stop = self.expected[self.prices == 0, 0].min() if self.cost.per_metre is not None else np.inf
        run, buy = self.after_runs.min(initial=np.inf), self.after_buying.min()
        if stop <= min(run, buy):
            return None, None
        return (int(self.amounts[1]), None) if run <= buy else (None, int(self.after_buying.argmin()))

    @property
    def reach(self) -> Array:
        """(F, K) chance that a way errs by no more than the goal; NaN without a goal."""
        return np.asarray(self.good.mean(axis=0) if self.cost.per_metre is None else np.full(self.price.shape, np.nan))

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
        goal = np.nan if self.cost.H_end_required is None else self.cost.H_end_required
        return frame.assign(frontier=frame["H_end"] < cheaper, unit=self.cost.unit, goal=goal)

    def sentences(self) -> list[str]:
        """What to buy, what the next runs and other physics would change, and when to stop."""
        cost, (f, k) = self.cost, self.best()
        money = partial(price_text, unit=cost.unit)
        goal, way = cost.H_end_required, self.way_text(f, k)
        aim = "The cheapest way in all" if goal is None else f"The cheapest way to {metres_text(goal)} at the horizon"
        lines = [f"{aim}, of those tried, is {way}."]
        if goal is not None and not self.reach[f, k] >= PROBABLE:
            lines = [f"No way that was tried is likely to reach {metres_text(goal)}; the surest is {way}."]
        if k + 1 < len(self.amounts):
            count, change = int(self.amounts[k + 1] - self.amounts[k]), self.expected[f, k + 1] - self.expected[f, k]
            more = f"{counted_text(count, 'further run')} would cost {money(self.runs[k + 1] - self.runs[k])}"
            gain = f"a chance of {percent_text(self.reach[f, k + 1])}" if goal else f"{money(change)} more in all"
            lines.append(f"{more}, for an error of {metres_text(np.median(self.error[:, f, k + 1]))}: {gain}.")
        others = [self.way_text(*self.best(g)) for g in range(len(self.prices)) if g != f]
        lines += [f"Not as good, with other physics: {'; '.join(others)}."] if others else []
        amount, bought = self.next_step()
        step = "stop here" if bought is None else f"buy {model_text(self.foundations[bought])}"
        step = step if amount is None else f"go on to {counted_text(amount, 'run')} and look again"
        if goal is None:
            least = metres_text(cost.run / (cost.per_metre or 1))
            return [*lines, f"Next: {step}. Stop when a further run lowers the error by less than {least}, its price."]
        total = money(min(self.after_runs.min(initial=np.inf), self.after_buying.min()))
        return [*lines, f"To see the goal reached on runs: {step}, and stop as soon as it is. Expect to pay {total}."]

    def way_text(self, f: int, k: int) -> str:
        """A way, its price, its error, and its chance or its loss, in words."""
        low, middle, high = np.quantile(self.error[:, f, k], [0.025, 0.5, 0.975])
        text = f"{model_text(self.foundations[f])} with {counted_text(int(self.amounts[k]), 'run')} for "
        text = f"{CONSTANT_MOTION} for " if self.foundations[f] == NO_MODEL and self.amounts[k] == 0 else text
        text += f"{price_text(self.price[f, k], self.cost.unit)}: {difference_text(middle, low, high)}"
        if self.cost.per_metre is None:
            return f"{text}, a chance of {percent_text(self.reach[f, k])}"
        return f"{text}, {price_text(self.expected[f, k], self.cost.unit)} with what the error costs"


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
        return [] if results.plan.study.cost is None else study_ways(results).sentences()
    except ShipidError as error:
        return [f"What to buy cannot be said: {error.message}."]
