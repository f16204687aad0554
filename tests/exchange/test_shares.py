"""Shares of H by number: right where the world is linear, silent where members tell nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.exchange.shares import estimate_parts, share_intervals, shares_frame
from shipid.study.results import Results, read_results

Array = Any
POINTS = 8  # of the errors: those of ships are alike in time, so that many are worth few


def linear_world(seed: int, members: int, numbers: int, rest: float) -> tuple[Array, Array, Array]:
    """Standard factors (M, P), products (M, M) and true shares (P,) of a world where all shares are 1 together."""
    rng = np.random.default_rng(seed)
    spectrum = 2.0 ** -np.arange(POINTS)
    share = rng.permutation(0.7 ** np.arange(numbers))
    share *= (1 - rest) / share.sum()
    slopes = rng.normal(size=(numbers, POINTS)) * np.sqrt(spectrum)
    slopes *= np.sqrt(share / np.square(slopes).sum(axis=1))[:, None]
    scores = rng.uniform(-np.sqrt(3), np.sqrt(3), (members, numbers))
    errors = scores @ slopes + rng.normal(size=(members, POINTS)) * np.sqrt(rest * spectrum / spectrum.sum())
    return scores, errors @ errors.T, share


def test_a_linear_world_gives_its_parts_to_the_digit() -> None:
    scores, products, share = linear_world(1, 40, 12, 0.0)
    np.testing.assert_allclose(estimate_parts(scores, products), [*share, 0.0], atol=1e-5)


def test_common_error_changes_no_part() -> None:
    scores, products, _ = linear_world(2, 20, 6, 0.2)
    rng = np.random.default_rng(3)
    common, each = rng.normal(), rng.normal(size=20)
    there = products + common**2 + common * (each[:, None] + each)  # of g_m + a common g with any angle to it
    np.testing.assert_allclose(estimate_parts(scores, there), estimate_parts(scores, products), atol=1e-6)


@pytest.mark.parametrize(("members", "numbers"), [(30, 6), (24, 30)])
def test_shares_are_right_on_average_and_their_intervals_hold(members: int, numbers: int) -> None:
    """Of 95 % intervals 90 % or more hold, also where members are fewer than numbers; the jackknife is wide there."""
    misses, held, sums = [], [], np.eye(numbers, numbers + 2)
    for seed in range(25):
        scores, products, true = linear_world(seed, members, numbers, 0.3)
        share, low, high = share_intervals(scores, products, sums)
        misses.append(share - true)
        held.append((low <= true) & (true <= high))
    assert np.mean(held) > 0.9
    bias = np.mean(misses, axis=(0, 1)) / (np.std(np.mean(misses, axis=1)) / np.sqrt(25))
    assert abs(bias) < 3


def test_members_that_differ_by_chance_tell_nothing() -> None:
    found = 0
    for seed in range(40):
        scores, products, _ = linear_world(seed, 20, 8, 1.0)
        found += bool((share_intervals(scores, products, np.eye(8, 10))[1] > 0).any())
    assert found <= 4  # of 40; 5 % would be 2


def test_a_number_that_one_member_alone_changes_makes_no_trouble() -> None:
    """Where that member is left out, nobody changes it."""
    scores, products, _ = linear_world(4, 20, 4, 0.2)
    scores[:, 3] = np.arange(20) == 7
    share, low, high = share_intervals(scores, products, np.eye(4, 6))
    assert np.isfinite([share, low, high]).all()
    assert low[3] <= 0 <= high[3]


@pytest.fixture(scope="module")
def members(tiny_run: Path) -> Results:
    """A tiny study whose family has 16 members by three numbers, two of them drawn together."""
    read, rng = read_results(tiny_run), np.random.default_rng(5)
    shape = read.test.future.shape
    one, other = rng.normal(size=(2, *shape))
    rows, physics = [], {}
    for k in range(16):
        a, b = rng.uniform(0.5, 1.5, 2)
        rows.append({"model": f"m-{k}", "family": "m", "factors": {"hull.a": a, "hull.b": b, "thruster.b": b}})
        physics[f"m-{k}"] = read.test.future + 3 * (a - 1) * one + 0.3 * (b - 1) * other
    rows += [{"model": "n", "family": "n", "factors": {"hull.a": 0.5}}, {"model": "none", "family": "none"}]
    return replace(read, models=pd.DataFrame(rows), physics=physics | {"n": read.test.future})


def test_the_physics_alone_is_shared_out(members: Results) -> None:
    frame = shares_frame(members)
    assert set(zip(frame["family"], frame["N_D"], strict=True)) == {("m", 0)}, "one member alone tells nothing"
    share = frame.set_index("number")["share"]
    assert list(share.index) == ["hull.a", "hull.b, thruster.b", "hull", "the rest", "what all members share"]
    assert share["hull.a"] > 0.7 > 0.1 > share["hull.b, thruster.b"]
    assert share.drop("hull").sum() == pytest.approx(1.0)
    errors = [np.linalg.norm(members.physics[f"m-{k}"] - members.test.future, axis=2).mean() for k in range(16)]
    np.testing.assert_allclose(frame["H"], np.mean(errors))


def test_cells_with_data_are_shared_out_over_draws(members: Results) -> None:
    """Two draws of the runs: shares are those of the mean product; a model that lacks a draw is left out."""
    cells = [
        {"cell": f"{model}/{seed}", "foundation": model, "method": members.cells["method"].iloc[0], "N_D": 2}
        | {"seed": seed, "status": "ok"}
        for model in members.models["model"].head(16)
        for seed in (0, 1)
    ][:-1]
    true = members.test.future
    paths = {one["cell"]: true + (members.physics[one["foundation"]] - true) / (2 + 2 * one["seed"]) for one in cells}
    with_data = shares_frame(replace(members, cells=pd.DataFrame(cells), paths=paths))
    alone = shares_frame(replace(members, models=members.models[members.models["model"].ne("m-15")]))
    mine = with_data[with_data["N_D"].eq(2)]
    assert set(mine["members"]) == {15}
    np.testing.assert_allclose(mine["share"], alone["share"], atol=1e-6)
    np.testing.assert_allclose(mine["H"], alone["H"] * (1 / 2 + 1 / 4) / 2)


def test_too_few_members_say_how_many_would_do(members: Results) -> None:
    few = replace(members, models=members.models[members.models["model"].isin(["m-0", "m-1", "m-2"])])
    (row,) = shares_frame(few).to_dict("records")
    assert (row["members"], row["needed"], row["kind"]) == (3, 6, "")
    assert np.isnan(row["share"])


def test_exact_physics_has_no_share(members: Results) -> None:
    exact = dict.fromkeys(members.physics, members.test.future)
    assert shares_frame(replace(members, physics=exact)).empty


def test_a_member_that_diverges_is_left_out(members: Results) -> None:
    broken = dict(members.physics) | {"m-3": np.full_like(members.test.future, np.inf)}
    assert set(shares_frame(replace(members, physics=broken))["members"]) == {15}
