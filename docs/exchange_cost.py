"""The advice on what to buy, as a decision: its regret in cost against rules of thumb, over ships that it has not seen.

`python docs/records.py exchange-cost python docs/exchange_cost.py CELLS` writes the record, of the ships of a table of
cells, each left out of the law that advises on it; without CELLS ships are drawn from a known law.
Prices and goals are drawn by seed. Each rule of thumb has one number, tuned on the other ships and then frozen.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd
from exchange_fit import fit_law
from numpy.typing import NDArray

from shipid.exchange.cost import Ways, errors_in_use
from shipid.exchange.law import ExchangeLaw, UnseenShip, check_cells
from shipid.study.schema import Cost

Array = NDArray[np.float64]
SEED, DRAWS, INSTANCES, RESAMPLES = 61_2026, 400, 10, 2000
SHARES = np.geomspace(0.003, 10, 20)  # what a rule of thumb may be tuned to
PILOT = 10  # runs of the fourth rule
SPREAD = 0.1  # of whoever knows far more than the law: what not knowing costs
HEAD = """| goal | who decides | regret: mean [%] | median [%] | of the best rule's |
| --- | --- | ---: | ---: | ---: |"""


@dataclass(frozen=True, eq=False)
class Instance:
    """A ship with prices and a goal.

    truth : errors (F, K) [m] that are true, as of `errors_in_use`. prices (F,), amounts (K,) : as of `Ways`.
    scale : error of constant u, v, r [m].
    """

    ship: str
    truth: Array
    cost: Cost
    prices: Array
    amounts: Array
    scale: float


@dataclass(frozen=True, eq=False)
class Bought:
    """What is paid: runs up to a place of the amounts, and some of the foundations."""

    place: int
    mask: Array

    def seen(self, instance: Instance) -> Array:
        """(F, K) errors that are known by now; NaN for the others. Without runs nothing is."""
        known = np.full_like(instance.truth, np.nan)
        if self.place:
            known[self.mask, : self.place + 1] = instance.truth[self.mask, : self.place + 1]
        return known


STOP = -1, -1
Step = tuple[int, int]  # place of the amount to run to and -1, or -1 and the foundation to buy; `STOP`
Policy = Callable[[Instance, Bought], Step]


def total_cost(instance: Instance, policy: Policy) -> float:
    """What a policy pays until it stops, with what the error costs then; towards a goal it stops there alone."""
    state, spent, last = Bought(0, instance.prices == 0), 0.0, len(instance.amounts) - 1
    cost, truth = instance.cost, instance.truth
    runs = np.where(instance.amounts > 0, cost.mobilisation + cost.run * instance.amounts, 0.0)
    while True:
        now = truth[state.mask, state.place]
        if cost.H_end_required is not None and state.place and now.min() <= cost.H_end_required:
            return spent
        place, bought = policy(instance, state)
        if cost.H_end_required is not None and (place, bought) == STOP:
            place = min(state.place + 1, last)
            bought = -1 if place > state.place else int(np.where(state.mask, np.inf, instance.prices).argmin())
            if state.mask.all() and place == state.place:
                return spent
        if bought >= 0:
            spent += float(instance.prices[bought])
            state = replace(state, mask=state.mask | (np.arange(len(truth)) == bought))
        elif place > state.place:
            spent += float(runs[place] - runs[state.place])
            state = replace(state, place=place)
        else:
            error = now.min() if state.place else truth[np.flatnonzero(state.mask)[-1], 0]
            return spent + float(cost.per_metre or 0) * float(error)


def least_cost(instance: Instance) -> float:
    """What the best way costs in hindsight."""
    runs = np.where(instance.amounts > 0, instance.cost.mobilisation + instance.cost.run * instance.amounts, 0.0)
    price = instance.prices[:, None] + runs
    if instance.cost.per_metre is not None:
        return float((price + instance.cost.per_metre * instance.truth).min())
    return float(price[(instance.truth <= instance.cost.H_end_required) & (instance.amounts > 0)].min())


# Rules of thumb: each spends by one number.


def dearest(instance: Instance, limit: float) -> int:
    """The dearest physics for at most so much, which rules take for the best; the free one where none is so cheap."""
    return int(np.where(instance.prices <= limit, instance.prices, -1.0).argmax())


def stake(instance: Instance) -> float:
    """What the error of constant u, v, r costs, or towards a goal 100 runs."""
    return instance.scale * instance.cost.per_metre if instance.cost.per_metre else 100 * instance.cost.run


def place_of(instance: Instance, runs: float) -> int:
    """Place of the amount nearest to so many runs, by ratio."""
    return int(np.abs(np.log1p(instance.amounts) - np.log1p(max(runs, 0.0))).argmin())


def spend(instance: Instance, state: Bought, physics: float, data: float) -> Step:
    """Buy the dearest physics for so much, and runs for so much; then stop, or towards a goal run on."""
    best = dearest(instance, physics)
    if not state.mask[best]:
        return -1, best
    runs = max((data - instance.cost.mobilisation) / instance.cost.run, float(best == 0))
    place = place_of(instance, runs)
    return (place, -1) if place > state.place else STOP


def all_on_data(share: float) -> Policy:
    """Spend on runs alone."""
    return lambda instance, state: spend(instance, state, 0.0, share * stake(instance))


def all_on_physics(share: float) -> Policy:
    """Spend on physics alone."""
    return lambda instance, state: spend(instance, state, share * stake(instance), 0.0)


def half_and_half(share: float) -> Policy:
    """Spend as much on physics as on runs; towards a goal, in turn."""

    def step(instance: Instance, state: Bought) -> Step:
        half = share * stake(instance) / 2
        if instance.cost.per_metre is not None:
            return spend(instance, state, half, half)
        runs = instance.cost.run * instance.amounts[state.place]
        paid = instance.prices[state.mask].sum()
        wanted = np.where(state.mask, np.inf, instance.prices)
        return (-1, int(wanted.argmin())) if paid + wanted.min() <= 10 * share * runs else STOP

    return step


def pilot(share: float) -> Policy:
    """Ten runs with the physics that is worth it, then as many as the power law of what was seen says."""

    def step(instance: Instance, state: Bought) -> Step:
        best, first = dearest(instance, share * stake(instance)), place_of(instance, PILOT)
        pilot_price = instance.cost.mobilisation + instance.cost.run * PILOT
        if not state.place and instance.cost.per_metre is not None and pilot_price > stake(instance):
            return STOP
        if not state.mask[best]:
            return -1, best
        if state.place < first:
            return first, -1
        if state.place > first:
            return STOP
        known = state.seen(instance)[:, 1:]
        mine = known[np.nanargmin(known[:, state.place - 1])][: state.place]
        slope, level = np.polyfit(np.log(instance.amounts[1 : state.place + 1]), np.log(mine), 1)
        later = instance.amounts[state.place :]
        curve = np.exp(level + min(slope, 0.0) * np.log(later))
        if instance.cost.per_metre is not None:
            place = state.place + int((instance.cost.run * later + instance.cost.per_metre * curve).argmin())
            return (place, -1) if place > state.place else STOP
        # Where the curve does not get there for the price of the next physics, that is bought.
        left = np.where(curve <= instance.cost.H_end_required, instance.cost.run * (later - later[0]), np.inf).min()
        wanted = np.where(state.mask, np.inf, instance.prices)
        return (-1, int(wanted.argmin())) if np.isfinite(wanted.min()) and wanted.min() < left else STOP

    return step


RULES: Mapping[str, Callable[[float], Policy]] = {
    "all on data": all_on_data,
    "all on physics": all_on_physics,
    "half and half": half_and_half,
    "ten pilot runs, then their curve": pilot,
}

Knowledge = Callable[[str, bytes, int, tuple[bool, ...]], Array]
"""Ship, what is seen (F, K) as bytes, place of the amount, mask -> predictive draws (draws, F, K) [m]."""


def advise_by(knowledge: Knowledge) -> Policy:
    """The policy that asks `Ways` at each step, with what is known of the ship by then."""

    def step(instance: Instance, state: Bought) -> Step:
        draws = knowledge(instance.ship, state.seen(instance).tobytes(), state.place, tuple(state.mask))
        prices = np.where(state.mask, 0.0, instance.prices)
        ways = Ways(
            instance.cost,
            [str(i) for i in range(len(prices))],
            instance.amounts[state.place :],
            draws[:, :, state.place :],
            prices,
        )
        best = next(iter(ways.steps))
        return (-1, best) if isinstance(best, int) else (state.place + 1, -1) if best == "run" else STOP

    return step


def knowledge_within(spread: float, truths: Mapping[str, Array]) -> Knowledge:
    """Draws of whoever knows the curve of each physics up to a factor, and each error on it up to half of that.

    The factor of a physics is known as soon as some error of it is. Factors are lognormal; what is known scatters about
    the truth as the draws do about what is known.
    """
    places = {ship: place for place, ship in enumerate(truths)}

    def draws(ship: str, seen: bytes, _place: int, _mask: tuple[bool, ...]) -> Array:
        truth, rng = truths[ship], np.random.default_rng([SEED, places[ship]])
        known = np.frombuffer(seen).reshape(truth.shape)
        level = np.where(np.isfinite(known).any(axis=1), 0.0, spread)[:, None]
        count = (DRAWS + 1, *truth.shape)  # the first is what is known
        apart = level * rng.normal(size=(*count[:2], 1)) + spread / 2 * rng.normal(size=count)
        found = errors_in_use(truth * np.exp(apart[1:] + apart[0]))
        return np.where(np.isfinite(known), known, found)

    return draws


# Ships of a known law.

FOUNDATIONS = ("none", "template", "sister", "moderate", "nominal")
TYPICAL = np.array([1.5, 0.9, 0.7, 0.45, 0.15])  # A of each over the error of constant u, v, r
GRID = np.array([0, 1, 2, 4, 8, 16, 32, 64, 100], dtype=float)
REST = 0.12  # standard deviation of ln H that no law explains


def draw_curves(count: int, rng: np.random.Generator) -> Array:
    """(count, F, K) mean errors of ships over that of constant u, v, r: a floor, and a part that data lower."""
    floor = np.exp(rng.normal(np.log(0.1), 0.5, (count, 1, 1)))
    first = np.exp(rng.normal(np.log(4.0), 0.7, (count, 1, 1)) + rng.normal(0, 0.3, (count, 5, 1)))
    power = np.exp(rng.normal(np.log(0.6), 0.25, (count, 1, 1)))
    A = np.exp(np.log(TYPICAL)[None, :, None] + rng.normal(0, 0.4, (count, 5, 1)))
    curves = np.sqrt(floor**2 + (A * (1 + GRID / first) ** -power) ** 2)
    curves[:, 0, 0] = 1.0
    return curves


def add_rest(curves: Array, rng: np.random.Generator) -> Array:
    """Errors in use, with what no law explains; that of constant u, v, r is known."""
    rest = np.exp(rng.normal(0, REST, curves.shape))
    rest[:, 0, 0] = 1.0
    return errors_in_use(curves * rest)


def ships_of_known_law(count: int, seed: int) -> dict[str, Array]:
    """Ship -> its errors (F, K), as cells would have them."""
    rng = np.random.default_rng(seed)
    curves = draw_curves(count, rng)
    return {f"ship {i}": one for i, one in enumerate(add_rest(curves, rng))}


def knowledge_of_known_law(seed: int) -> Knowledge:
    """Draws of the known law given what is seen: importance weights, tempered where few draws would be left."""
    rng = np.random.default_rng(seed)
    curves = draw_curves(30_000, rng)
    used = np.log(errors_in_use(curves))

    @lru_cache(4000)
    def draws(_ship: str, seen: bytes, _place: int, _mask: tuple[bool, ...]) -> Array:
        known = np.frombuffer(seen).reshape(curves.shape[1:])
        far = np.where(np.isfinite(known), (np.log(known) - used) / REST, 0.0)
        misfit = 0.5 * np.square(far).sum(axis=(1, 2))
        for temper in 0.7 ** np.arange(30):
            weights = np.exp(-temper * (misfit - misfit.min()))
            weights /= weights.sum()
            if 1 / np.square(weights).sum() >= 150:
                break
        taken = curves[rng.choice(len(curves), DRAWS, p=weights)]
        return np.where(np.isfinite(known), known, add_rest(taken, rng))

    return draws


def draw_instances(ships: Mapping[str, tuple[Array, Array]], seed: int, goal: str) -> list[Instance]:
    """Prices and goals for each ship: in runs, over wide ranges; better physics costs more.

    ships : name -> errors (F, K) and amounts (K,); those of no physics without runs are of constant u, v, r.
    """
    rng, result = np.random.default_rng(seed), []
    for ship, (truth, amounts) in ships.items():
        scale = float(truth[0, 0])
        for _ in range(INSTANCES):
            prices = np.append(0.0, np.sort(np.exp(rng.uniform(np.log(0.1), np.log(100), len(truth) - 1))))
            first = float(np.exp(rng.uniform(np.log(0.1), np.log(30))))
            best = truth[:, 1:].min()
            aim = {"per_metre": float(np.exp(rng.uniform(0, np.log(1000)))) / scale}
            required = {"H_end_required": float(np.exp(rng.uniform(np.log(1.02 * best), np.log(scale))))}
            cost = Cost(unit="run", run=1.0, mobilisation=first, **(aim if goal == "per_metre" else required))
            result.append(Instance(ship, truth, cost, prices, amounts, scale))
    return result


def regrets(instances: Sequence[Instance], policy: Policy) -> Array:
    """What the policy pays over the least in hindsight, less 1, of each instance."""
    return np.array([total_cost(one, policy) / max(least_cost(one), 1e-9) - 1 for one in instances])


def judge(instances: Sequence[Instance], advised: Mapping[str, Policy]) -> Iterator[str]:
    """Rows of the table for one goal; the number of each rule is tuned on the ships of the other folds."""
    names = np.array(list(dict.fromkeys(one.ship for one in instances)))
    ship = np.array([one.ship for one in instances])
    fold = {name: place % FOLDS for place, name in enumerate(np.random.default_rng(SEED).permutation(sorted(names)))}
    place = np.array([fold[one] for one in ship])
    found = {name: regrets(instances, policy) for name, policy in advised.items()}
    for name, rule in RULES.items():
        tried = np.array([regrets(instances, rule(share)) for share in SHARES])
        chosen = [int(tried[:, place != one].mean(axis=1).argmin()) for one in range(FOLDS)]
        found[name] = tried[np.array(chosen)[place], np.arange(len(place))]
    best = min(RULES, key=lambda name: float(found[name].mean()))
    by_ship = {name: np.array([values[ship == one].mean() for one in names]) for name, values in found.items()}
    drawn = np.random.default_rng(SEED).integers(len(names), size=(RESAMPLES, len(names)))
    needed = "required" if instances[0].cost.per_metre is None else "per metre"
    for name, values in found.items():
        means = by_ship[name][drawn].mean(axis=1)
        ratio = means / by_ship[best][drawn].mean(axis=1)
        low, high = np.quantile(means, [0.025, 0.975])
        less, more = np.quantile(ratio, [0.025, 0.975])
        part = by_ship[name].mean() / by_ship[best].mean()
        yield (
            f"| {needed} | {name} | {100 * values.mean():.0f} [{100 * low:.0f}, {100 * high:.0f}] | "
            f"{100 * np.median(values):.0f} | {part:.2f} [{less:.2f}, {more:.2f}] |"
        )


# Ships of a table of cells.

AHEAD, FOLDS = 2.0, 5
OPTIONS = ("none", "template", "sister", "moderate", "nominal")
"""Kinds of physics that are for sale, the dearer the later; of several members the first. Nominal: nothing is wrong."""


def ways_of_cells(cells: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Ship -> its cells at 2 ship lengths of what is for sale."""
    cells = cells[cells["kind"].isin(OPTIONS) & np.isclose(cells["ahead"], AHEAD)]
    first = cells.groupby(["ship", "kind"])["foundation"].transform("min")
    return {str(name): ship for name, ship in cells[cells["foundation"] == first].groupby("ship")}


def amounts_of(ship: pd.DataFrame) -> Array:
    """Amounts (K,) of the cells of a ship, 0 first."""
    return np.array(sorted({0.0, *ship["N_D"][ship["kind"] == "none"]}))


def kinds_of_ship(ship: pd.DataFrame) -> list[str]:
    """Kinds of physics of a ship that have an error at each of its amounts, in the order of `OPTIONS`."""
    known = ship[ship["N_D"].isin(amounts_of(ship))].groupby("kind")["N_D"].nunique()
    whole = len(amounts_of(ship)) - (known.index == "none")
    return [kind for kind in OPTIONS if kind in known.index[known == whole]]


def errors_of_ship(ship: pd.DataFrame) -> Array:
    """(F, K) errors of a ship by `kinds_of_ship` and `amounts_of`."""
    wide = ship.pivot_table(index="kind", columns="N_D", values="H").reindex(columns=amounts_of(ship))
    wide.loc["none", 0] = ship["baseline"].iloc[0]
    return errors_in_use(wide.loc[kinds_of_ship(ship)].to_numpy())


def knowledge_of_law(cells: pd.DataFrame, ships: Mapping[str, pd.DataFrame]) -> Knowledge:
    """Draws of the law fitted to the ships of the other folds, given what is seen of the ship itself."""
    names = np.random.default_rng(SEED).permutation(sorted(ships))
    laws: dict[str, ExchangeLaw] = {}
    for fold in range(FOLDS):
        out = names[fold::FOLDS]
        laws |= dict.fromkeys(out, fit_law(cells[~cells["ship"].isin(out)]))

    @lru_cache(None)
    def draws(ship: str, _seen: bytes, place: int, mask: tuple[bool, ...]) -> Array:
        mine, amounts = ships[ship], amounts_of(ships[ship])
        one, kinds = mine.iloc[0], kinds_of_ship(mine)
        paid = [kind for kind, bought in zip(kinds, mask, strict=True) if bought]
        known = mine[mine["kind"].isin(paid) & (mine["N_D"] <= amounts[place])]
        known = known.assign(floor=known["A"][known["kind"] == "nominal"].mean())  # seen of the true physics alone
        law = laws[ship].given(known) if place else laws[ship]
        called = mine.drop_duplicates("kind").set_index("kind")["foundation"]
        asked = [called[kind] if place and kind in paid else kind for kind in kinds]
        met = UnseenShip(one["length"], one["speed"], one["baseline"])
        drawn = errors_in_use(law.expect_all(met, asked, amounts.astype(int).tolist(), AHEAD, DRAWS))
        seen = np.frombuffer(_seen).reshape(drawn.shape[1:])
        return np.where(np.isfinite(seen), seen, drawn)

    return draws


def main() -> None:
    """Judge the advice on ships of a known law, or on those of a table of cells."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cells", type=Path, nargs="?", help="table of cells; default: ships of a known law")
    file = parser.parse_args().cells
    if file is None:
        mine = {name: (truth, GRID) for name, truth in ships_of_known_law(30, SEED + 3).items()}
        advice = advise_by(knowledge_of_known_law(SEED + 5))
    else:
        cells = check_cells(pd.read_csv(file), file)
        ships = ways_of_cells(cells)
        mine = {name: (errors_of_ship(ship), amounts_of(ship)) for name, ship in ships.items()}
        advice = advise_by(knowledge_of_law(cells, ships))
    truths = {name: truth for name, (truth, _) in mine.items()}
    within = advise_by(knowledge_within(SPREAD, truths))
    advised = {"the advice": advice, f"the advice, if curves were known within {100 * SPREAD:.0f} %": within}
    print(f"{len(mine)} ships, {INSTANCES} draws of prices and goals for each; physics: {', '.join(OPTIONS)}\n")
    print(HEAD)
    for goal in ("per_metre", "H_end_required"):
        for row in judge(draw_instances(mine, SEED + 4, goal), advised):
            print(row, flush=True)


if __name__ == "__main__":
    main()
