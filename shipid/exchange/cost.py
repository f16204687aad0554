"""What to buy: the cheapest physics and number of runs to a goal, what more of each would buy, and when to stop.

A way is one kind of physics with a number of runs. How far it errs is not known before: each way has predictive draws
of its error, and draw i of all ways is one and the same ship. A decision has the least expected loss over the draws
(Raiffa and Schlaifer 1961). What runs would tell before they are there is the expected least loss after them: losses
are regressed on the errors that would be seen (Strong, Oakley and Brennan 2014, Medical Decision Making 34).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.study.schema import Cost

Array = NDArray[np.float64]
PROBABLE = 0.8  # chance from which on a way is said to reach a goal
AMOUNTS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 100)
"""Numbers of runs that are tried."""


@dataclass(frozen=True, eq=False)
class Ways:
    """All ways from here on, with their prices and predictive draws of their errors.

    foundations : names (F,) of the physics. amounts : (K,) runs in all, rising; the first are there already.
    error : (draws, F, K) mean error at the horizon [m]; NaN where there is no such way.
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
            return self.price + self.cost.per_metre * np.where(np.isnan(self.error), np.inf, self.error)
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
        losses = losses[:, np.isfinite(losses).all(axis=0)]
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
        """(F, K) chance that a way errs by no more than the goal; NaN where there is no way, or no goal."""
        known = np.isfinite(self.error) & (self.cost.H_end_required is not None)
        return np.where(known, self.good, np.nan).mean(axis=0)

    def table(self) -> pd.DataFrame:
        """A row per way that there is: foundation, N_D, price, H_end, low, high, probability, expected loss.

        H_end is the median of the error [m], low and high its 95 % interval.
        """
        low, middle, high = np.quantile(self.error, [0.025, 0.5, 0.975], axis=0)
        columns = {"price": self.price, "H_end": middle, "low": low, "high": high}
        columns |= {"probability": self.reach, "expected": self.expected}
        names, amounts = np.repeat(list(self.foundations), len(self.amounts)), np.tile(self.amounts, len(low))
        frame = pd.DataFrame({"foundation": names, "N_D": amounts.astype(int)})
        frame = frame.assign(**{name: values.ravel() for name, values in columns.items()})
        return frame[frame["H_end"].notna()].reset_index(drop=True)
