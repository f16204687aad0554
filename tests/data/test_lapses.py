"""Zeros and spikes of commands are found in noisy and plain columns, and in clean ones nothing is."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from shipid.data.dataset import Array
from shipid.data.lapses import LONGEST_ZERO, find_command_faults

SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 6))]
NAMES = {"rudder.delta": np.radians(1.0), "propeller.n": 1 / 60}
"""Commands, and the SI units in what their columns count."""


def column(name: str, seed: int, noise: bool) -> tuple[Array, Array]:
    """t [s], and a zigzag's rudder [deg] or a shaft [rpm] at two speeds, in tenths."""
    random = np.random.default_rng(seed)
    t = np.arange(2000.0)
    order = 20.0 * np.sign(np.sin(2 * np.pi * t / random.uniform(60.0, 120.0)))
    rudder = np.zeros(len(t))
    for row in range(1, len(t)):
        rudder[row] = rudder[row - 1] + np.clip(order[row] - rudder[row - 1], -3.0, 3.0)
    values = rudder if name == "rudder.delta" else np.where(t < 1000.0, 84.0, 60.0 + 24.0 * np.exp((1000.0 - t) / 10))
    return t, np.round(values + noise * random.normal(0, 0.1, len(t)), 1)


def found(name: str, t: Array, values: Array) -> tuple[set[str], set[int]]:
    """Kinds and rows of all lapses."""
    some = find_command_faults(name, t, NAMES[name] * values, np.diff(t) < 3 * np.median(np.diff(t)))
    return {one.kind for one in some}, {row for one in some for row in range(one.first, one.end)}


@pytest.mark.parametrize("noise", [True, False])
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", SEEDS)
def test_lapses_are_found_and_nothing_else(seed: int, name: str, noise: bool) -> None:
    t, values = column(name, seed, noise)
    assert found(name, t, values) == (set(), set())
    away = [place for place in range(50, 1900) if np.abs(values[place - 2 : place + 8]).min() > 15.0]
    places = [away[0]]
    places += [place for last, place in pairwise(away) if place // 150 > last // 150]
    assert len(places) > 9
    four = values.copy()
    for place in places:
        four[place : place + 4] = 0.0
    rows = {place + row for place in places for row in range(4)}
    assert found(name, t, four) == ({"zero"}, rows)
    wild = values.copy()
    wild[places] = 90.0 if name == "rudder.delta" else 4 * values[places]
    assert found(name, t, wild) == ({"spike"}, {*places})


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("step", [0.2, 1.0, 10.0])
def test_orders_that_go_to_0_and_back_are_no_lapses(step: float, seed: int) -> None:
    """Bang-bang, kicks, a binary order and a telegraph, plain and as a fast gear with noise follows them."""
    random = np.random.default_rng([seed, round(10 * step)])
    count = 3000
    t = step * np.arange(count)
    hold = max(1, round(4.0 / step))

    def held(levels: list[float], rows: int) -> Array:
        return np.repeat(random.choice(levels, count // rows + 1), rows)[:count]

    kicks = np.zeros(count)
    for place in random.choice(count - 100, 6):
        kicks[place : place + hold] = 20.0
    helm = {"bang-bang": held([20.0, 0.0, -20.0], hold), "binary": held([0.0, 10.0], hold), "kicks": kicks}
    for what, values in helm.items():
        for noise in (0.0, 0.1):
            noisy = np.round(values + random.normal(0, noise, count), 1)
            assert found("rudder.delta", t, noisy) == (set(), set()), (what, noise)
    telegraph = held([0.0, 40.0, 80.0, -40.0], max(1, round(1.5 * LONGEST_ZERO / step)))
    assert found("propeller.n", t, telegraph) == (set(), set())
