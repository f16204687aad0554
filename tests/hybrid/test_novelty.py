"""The alarm: laws that it keeps for any inputs, and a change of orders that no run of training had."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.hybrid.features import Inputs
from shipid.hybrid.novelty import ALARM_LEVEL, alarm_inputs, calibrate_alarm, range_of_orders
from shipid.hybrid.physics import Physics

ORDERS, WINDOWS = ("port.n", "port.alpha"), 20
Array = np.ndarray


def drawn(seed: int, count: int, turns: float = 0.0) -> tuple[dict[str, Array], Array]:
    """Inputs of windows of runs whose orders are constant, or change by `turns`, and the run of each."""
    rng = np.random.default_rng(seed)
    of = np.repeat(np.arange(count), WINDOWS)
    orders = {name: rng.uniform(1, 2, count)[of] for name in ORDERS}
    speed = rng.normal(0, 1, count)[of] + 0.3 * rng.standard_normal(len(of))
    table = {"u": 3 * orders["port.n"] + speed, "v": 0.2 * speed, "r": orders["port.alpha"] + 0.1 * speed**2, **orders}
    table |= {range_of_orders(name): np.full(len(of), turns) for name in ORDERS}
    return table, np.array([f"M{one:03d}" for one in of])


def alarm_of(table: dict[str, Array], run: Array):
    alarm = calibrate_alarm(Inputs(ORDERS), 5, table, run)
    return alarm


@pytest.mark.parametrize("count", [10, 40])
def test_new_runs_of_the_law_raise_it_as_often_as_was_wanted(count: int) -> None:
    """Each of two scores may leave 1 - level, or one run in count + 1; the mean is over 60 drawn worlds."""
    shares = [alarm_of(*drawn(seed, count)).is_raised(drawn(1000 + seed, 50)[0]).mean() for seed in range(60)]
    assert np.mean(shares) < 2 * max(1 - ALARM_LEVEL, 1 / (count + 1)) + 3 * np.std(shares) / 60**0.5


@pytest.mark.parametrize("name", [*map(range_of_orders, ORDERS), "current"])
def test_what_was_constant_and_varies_raises_it(name: str) -> None:
    table, run = drawn(1, 20)
    table["current"] = np.full(len(run), 0.2)
    alarm = alarm_of(table, run)
    before = alarm.is_raised(table)
    moved = {**table, name: table[name] + 1e-6}
    assert alarm.is_raised(moved).all()
    np.testing.assert_array_equal(alarm.is_raised({**table, name: table[name] + 1e-14}), before)


def test_orders_that_changed_in_training_too_are_no_alarm() -> None:
    still, often = alarm_of(*drawn(2, 20)), alarm_of(*drawn(2, 20, turns=0.5))
    changed = drawn(3, 20, turns=0.5)[0]
    assert still.is_raised(changed).all()
    assert often.is_raised(changed).mean() < 0.3


def test_a_unit_and_a_middle_change_nothing() -> None:
    (table, run), fresh = drawn(4, 20), drawn(5, 30)[0]
    for name in ("u", "v", "port.n"):

        def other(given: dict[str, Array], name: str = name) -> dict[str, Array]:
            return {**given, name: 1000 * given[name] + 7}

        right = alarm_of(table, run).is_raised(fresh)
        np.testing.assert_array_equal(alarm_of(other(table), run).is_raised(other(fresh)), right)


def test_it_is_one_sided() -> None:
    """Inputs nearer to the middle of the training are no alarm, far ones are, numbers that are none are."""
    table, run = drawn(6, 20)
    alarm, middle = alarm_of(table, run), {name: values.mean() for name, values in table.items()}

    def share(factor: float) -> float:
        moved = {n: middle[n] + factor * (v - middle[n]) for n, v in table.items() if n not in ORDERS}
        return float(alarm.is_raised({**table, **moved, **{n: np.full(len(run), middle[n]) for n in ORDERS}}).mean())

    assert share(0.2) == 0
    assert share(8.0) > 0.8
    assert alarm.is_raised({**table, "v": np.full(len(run), np.nan)}).all()


def test_too_few_runs_calibrate_none() -> None:
    assert calibrate_alarm(Inputs(ORDERS), 5, *drawn(7, 2)) is None


def test_a_change_of_order_is_seen_as_long_as_the_past_is() -> None:
    """An order that changed two rows ago: seen in three rows of the past, not in one."""
    columns = {"u": np.ones(1), "v": np.zeros(1), "r": np.zeros(1), "port.n": np.full(1, 2.0)}
    past = {"port.n": np.array([[1.5], [1.5], [2.0]])}
    nothing = Physics(None, 3, 1.0)
    ranges = [
        alarm_inputs(Inputs(("port.n",)), rows, nothing, Instants(columns, past))["port.range.n"] for rows in (0, 1, 3)
    ]
    assert np.concatenate(ranges).tolist() == [0.0, 0.0, 0.5]
