"""The law of exchange: it finds the law that cells are drawn from, and its intervals hold on ships not seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from docs.exchange_fit import FLOOR_CENTRE, fit_hierarchy, fit_law, prior_of, save_law, ship_designs
from shipid.errors import DataError, ResultError, ShipidError
from shipid.exchange.law import (
    CELL_COLUMNS,
    RESPONSES,
    SEAS,
    Hierarchy,
    UnseenShip,
    check_cells,
    read_law,
    response_rows,
    response_values,
)
from shipid.units import GRAVITY

AMOUNTS, HORIZONS = (1, 2, 4, 8, 16, 32, 64), (1.0, 2.0, 4.0)
TRUE_THETA = {
    "1": -1.5, "n": -0.4, "a": 0.8, "a:n": -0.1, "h": 0.1, "damping": 0.2, "mass": -0.2,
}  # fmt: skip
TRUE_SPREAD = {
    ("ship", "1"): 0.2, ("ship", "n"): 0.08, ("ship foundation", "1"): 0.1, ("ship N_D", "few"): 0.2,
    ("ship foundation N_D", "1"): 0.1, ("ship foundation N_D ahead", "1"): 0.05,
}  # fmt: skip


def true_law() -> Hierarchy:
    """The law of H that the cells are drawn from: nothing of it is unknown."""
    form = RESPONSES["H"]
    floor = {**FLOOR_CENTRE, "n": -0.1, "none": 0.5, "none:n": -0.2}
    theta = np.array(
        [*(TRUE_THETA.get(name, 0.0) for name in form.features), *(floor.get(name, 0.0) for name in form.floor)]
    )
    variances = np.array([TRUE_SPREAD.get(level, 0.0) ** 2 for level in form.levels])
    return Hierarchy(form, theta, np.zeros((len(theta),) * 2), variances, 1000)


def draw_cells(ships: int, seed: int, kinds: tuple[str, ...]) -> pd.DataFrame:
    """Cells of some ships; effects and rest of H are those of `true_law`."""
    rng, law, frames = np.random.default_rng(seed), true_law(), []
    for number in range(ships):
        length, froude = np.exp(rng.uniform(np.log(2), np.log(320))), rng.uniform(0.1, 0.35)
        size = {"length": length, "froude": froude, "speed": froude * np.sqrt(GRAVITY * length)}
        base = np.exp(rng.normal(-2, 0.2))
        floor = base * np.exp(rng.normal(-1.5, 0.4))
        scatter = {ahead: np.exp(rng.normal(0, 0.03, 2)) for ahead in HORIZONS}
        rows = [
            {
                "ship": f"ship-{number}", "type": f"type-{number % 8}", "bundled": number % 5 == 0, **size,
                "foundation": f"{kind}-{place}", "kind": kind,
                "A": np.nan if kind == "none" else length * ahead**1.5 * np.hypot(error * (kind != "nominal"), floor),
                "N_D": amount, "ahead": ahead, "H": 1.0, "baseline": length * base * ahead**1.6 * scatter[ahead][0],
                "floor": length * floor * ahead**1.5 * scatter[ahead][1],
            }
            for place, kind in enumerate(kinds)
            for error in [base * np.exp(rng.normal(-0.3, 0.6))]
            for amount in AMOUNTS
            for ahead in HORIZONS
        ]  # fmt: skip
        part = pd.DataFrame(rows)
        mean, jacobian = law.mean(part)
        root = np.linalg.cholesky(law.spread(part, jacobian) + 1e-12 * np.eye(len(part)))
        frames.append(part.assign(H=part["baseline"] * np.exp(mean + root @ rng.standard_normal(len(part)))))
    return pd.concat(frames, ignore_index=True)[[*CELL_COLUMNS]]


KINDS = ("nominal", "damping", "mass", "thrust", "moderate", "high", "none")


@pytest.fixture(scope="module")
def cells():
    return draw_cells(16, 1, KINDS)


@pytest.fixture(scope="module")
def law(cells):
    return fit_law(cells)


def test_it_finds_the_law_that_cells_are_drawn_from(law):
    fit, true = law.parts["H"], true_law()
    apart = (fit.theta - true.theta) / np.sqrt(np.diag(fit.covariance))
    assert np.sqrt(np.mean(apart**2)) < 1.4
    assert np.abs(fit.theta - true.theta)[fit.response.features.index("a")] < 0.05 * TRUE_THETA["a"] + 0.03
    spread = dict(zip(fit.response.levels, np.sqrt(fit.variances), strict=True))
    for level, true_spread in TRUE_SPREAD.items():
        assert spread[level] == pytest.approx(true_spread, rel=0.5), level
    assert spread["ship foundation N_D ahead", "1"] == pytest.approx(0.05, rel=0.1)
    assert spread["ship", "h"] < 0.03


def test_the_fit_solves_the_normal_equations_of_dense_matrices(law, cells):
    """The sums by cell and the small matrices of `fit_hierarchy` against the covariance of each ship, inverted."""
    for fit in law.parts.values():
        centre, widths = prior_of(fit.response)
        normal, right = np.diag(widths**-2), (centre - fit.theta) / widths**2
        for _, rows in response_rows(fit.response, cells).groupby("ship"):
            mean, jacobian = fit.mean(rows)
            inverse = np.linalg.inv(fit.spread(rows, 0 * jacobian))
            normal += jacobian.T @ inverse @ jacobian
            right += jacobian.T @ inverse @ (response_values(fit.response, rows) - mean)
        errors = np.sqrt(np.diag(fit.covariance))
        assert np.abs(np.linalg.solve(normal, right) / errors).max() < 0.1  # what the last step left
        assert np.sqrt(np.diag(np.linalg.inv(normal))) == pytest.approx(errors, rel=0.05)


def test_the_variances_stand_where_the_restricted_likelihood_is_greatest(law, cells):
    fit = law.parts["floor"]

    def loss(variances):
        one = replace(fit, variances=variances)
        total, normal = 0.0, np.diag(prior_of(fit.response)[1] ** -2)
        for _, rows in response_rows(fit.response, cells).groupby("ship"):
            mean, jacobian = fit.mean(rows)
            spread = one.spread(rows, 0 * jacobian)
            apart = response_values(fit.response, rows) - mean
            total += np.linalg.slogdet(spread)[1] + apart @ np.linalg.solve(spread, apart)
            normal += jacobian.T @ np.linalg.solve(spread, jacobian)
        return total + np.linalg.slogdet(normal)[1]

    best = loss(fit.variances)
    assert loss(fit.variances * [1.5, 1, 1]) > best
    assert loss(fit.variances * [0.67, 1, 1]) > best


def test_units_and_the_order_of_rows_do_not_matter(law, cells):
    metres = ["A", "H", "baseline", "floor", "length"]
    other = cells.sample(frac=1, random_state=3)
    other[metres] *= 10.0
    other = fit_hierarchy(RESPONSES["H"], [*ship_designs(RESPONSES["H"], other).values()])
    assert other.theta == pytest.approx(law.parts["H"].theta, abs=1e-6)


def covered(draws, true, level):
    low, high = np.quantile(draws, [(1 - level) / 2, (1 + level) / 2], axis=0)
    return float(((low <= true) & (true <= high)).mean())


@pytest.mark.parametrize(
    ("known", "hidden"),
    [(0, False), (3, False), (3, True)],
    ids=["before any run", "after three amounts", "and the floor is not known"],
)
def test_intervals_hold_on_ships_that_it_has_not_seen(law, known, hidden):
    shares = []
    for _, ship in draw_cells(14, 2, KINDS).groupby("ship"):
        rows = ship[ship["ahead"] == 2.0].sort_values(["foundation", "N_D"])
        if hidden:
            rows = rows[rows["kind"] != "nominal"].assign(floor=np.nan)
        amounts = sorted(set(rows["N_D"]))
        asked = UnseenShip(*rows[["length", "speed", "baseline"]].iloc[0], None if hidden else rows["floor"].iloc[0])
        own = rows[rows["N_D"].isin(amounts[:known])]
        one = law.given(own) if known else law
        names = list(dict.fromkeys(rows["foundation"]))
        first = rows.drop_duplicates("foundation")
        kinds = names if known else [*zip(first["kind"], first["A"], strict=True)]
        draws = one.expect_all(asked, kinds, amounts[known:], 2.0, 500)
        true = rows["H"].to_numpy().reshape(len(names), -1)[:, known:]
        shares.append([covered(draws, true, level) for level in (0.95, 0.5)])
    wide, narrow = np.mean(shares, axis=0)
    assert 0.90 < wide < 0.995
    assert 0.37 < narrow < 0.63


def test_a_known_cell_is_one_draw_of_runs_and_a_surprising_ship_is_less_certain(law, cells):
    """A cell that was measured came out with an interval of no width, and one run more was worse."""
    ship = cells[(cells["ship"] == "ship-3") & (cells["ahead"] == 1.0)]
    own, asked = ship[ship["N_D"] <= 4], UnseenShip(100.0, 7.0)
    known = own[own["foundation"] == "mass-2"].set_index("N_D")
    draws = law.given(own).expect(asked, "mass-2", [0, 1, 2, 4, 5], 1.0, 1000)
    assert draws[:, 0] == pytest.approx(known["A"].iloc[0])
    low, middle, high = np.log(np.quantile(draws[:, 1:], [0.025, 0.5, 0.975], axis=0))
    assert (low[:3] < np.log(known["H"])).all()
    assert (np.log(known["H"]) < high[:3]).all()
    assert (np.diff(middle) < 0.02).all(), "more runs do not make it worse"
    assert (high - low)[2] == pytest.approx((high - low)[3], rel=0.15), "four runs that are known, or five"
    assert (high - low)[2] < np.ptp(np.log(np.quantile(law.expect(asked, "mass", [4], 1.0, 1000), [0.025, 0.975])))
    wild = own.assign(H=own["H"] * np.exp(np.resize([-1, 1, 0, 2], len(own))))
    widths = [np.log(law.given(one).expect(asked, "mass-2", [64], 1.0, 500)).std() for one in (own, wild)]
    assert widths[1] > 2 * widths[0]


def test_no_runs_give_the_physics_alone_and_the_same_ship_stands_behind_all_foundations(law):
    asked = UnseenShip(100.0, 7.0, baseline=50.0)
    draws = law.expect_all(asked, [40.0, "none", "high"], [0, 16], 2.0, 2000)
    assert (draws[:, 0, 0] == 40.0).all()
    assert (draws[:, 1, 0] == 50.0).all()
    assert draws[:, 2, 0].std() > 0
    assert np.corrcoef(np.log(draws[:, :2, 1].T))[0, 1] > 0.3
    assert (law.expect(asked, 40.0, [0, 16], 2.0, 2000) > 0).all()


def test_a_rougher_sea_has_a_higher_floor(law):
    asked = [UnseenShip(100.0, 7.0, baseline=50.0, sea=sea) for sea in SEAS]
    middle = [np.median(law.expect(one, "nominal", [0, 32], 2.0, 1000), axis=0) for one in asked]
    assert (np.diff(middle, axis=0) > 0).all()


def test_an_accurate_physics_tells_of_a_low_floor(law):
    asked = UnseenShip(100.0, 7.0, baseline=50.0)
    alone, beside = (law.expect_all(asked, kinds, [64], 2.0, 1000)[:, 0, 0] for kinds in (["high"], ["high", 1.0]))
    assert np.median(beside) < 0.7 * np.median(alone)
    true = law.expect_all(asked, [("nominal", 3.0), "nominal"], [0], 2.0, 100)
    assert np.allclose(true, 3.0)  # the floor itself


def test_a_law_is_written_and_read(law, tmp_path):
    save_law(law, tmp_path / "law.json")
    asked, other = UnseenShip(100.0, 7.0), read_law(tmp_path / "law.json")
    one, two = (each.expect(asked, "template", [0, 4], 2.0, 100) for each in (law, other))
    assert np.quantile(two, [0.1, 0.5, 0.9]) == pytest.approx(np.quantile(one, [0.1, 0.5, 0.9]), rel=1e-3)
    assert other.limits == law.limits
    assert other.provenance["ships"] == 16
    text = (tmp_path / "law.json").read_text()
    changes = ('"a:n"', '"a:p"'), ('"none:few"', '"p:few"'), ('"ship : h"', '"ship : n"'), ('"A": [', '"B": [')
    for words in ("{}", "[1]", *(text.replace(*one) for one in (*changes, ('"limits"', '"limit"')))):
        (tmp_path / "law.json").write_text(words)
        with pytest.raises(ResultError, match=r"law\.json: "):
            read_law(tmp_path / "law.json")


def test_a_foundation_that_is_no_kind_is_refused(law):
    with pytest.raises(ShipidError, match="'guess' is no kind: give one of model-test"):
        law.expect(UnseenShip(100.0, 7.0), "guess", [1], 2.0, 10)


@pytest.mark.parametrize(("kind", "part"), [("model-test", 9), ("identified", 25)])
def test_tank_tests_have_a_third_and_identification_a_fifth_of_what_moderate_adds_to_the_floor(law, kind, part):
    """In squares, as errors of different causes add."""
    asked = UnseenShip(100.0, 7.0, baseline=50.0, floor=2.0)
    better, moderate = (law.expect(asked, one, [0], 2.0, 50) for one in (kind, "moderate"))
    assert better**2 - 2.0**2 == pytest.approx((moderate**2 - 2.0**2) / part)


def test_a_floor_that_is_not_known_is_what_the_law_expects(law, cells):
    """Within what floors of ships scatter about it, and at most the least A."""
    ratios = []
    for _, ship in cells[(cells["kind"] != "nominal") & (cells["ahead"] == 2.0)].groupby("ship"):
        found = law.given(ship.assign(floor=np.nan))._own_rows()["floor"]
        assert found.max() <= ship["A"].min()
        ratios.append(np.log(found.iloc[0] / ship["floor"].iloc[0]))
    assert np.abs(ratios).mean() < 0.7


def test_what_was_seen_of_a_ship_tells_of_its_floor(law):
    """Runs with rough physics, and no true physics: the errors of that are then foretold better than before them."""
    misses, inside = [], []
    for _, ship in draw_cells(14, 3, KINDS).groupby("ship"):
        true = ship[(ship["ahead"] == 2.0) & (ship["kind"] == "nominal")]
        own = ship[(ship["ahead"] == 2.0) & (ship["kind"] != "nominal")].assign(floor=np.nan)
        asked = UnseenShip(*true[["length", "speed", "baseline"]].iloc[0])
        draws = [np.log(one.expect(asked, "nominal", [0], 2.0, 1000)[:, 0]) for one in (law, law.given(own))]
        misses.append([np.abs(one - np.log(true["floor"].iloc[0])).mean() for one in draws])
        inside.append(covered(draws[1][:, None], np.log(true["floor"].iloc[0]), 0.95))
    before, after = np.mean(misses, axis=0)
    assert after < 0.6 * before
    assert np.mean(inside) > 0.8


def test_cells_that_diverged_are_left_out(cells):
    wild = cells.assign(H=cells["H"].where(cells["N_D"] > 1, np.nan))
    assert set(check_cells(wild)["N_D"]) == {2, 4, 8, 16, 32, 64}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"kind": "guess"}, "kind: 'guess' is no kind: give one of nominal, "),
        ({"baseline": 0.0}, "baseline: 0 is not above 0"),
        ({"A": -1.0}, "A: -1 is not above 0"),
        ({"H": 0.0}, "H: 0 is not above 0"),
        ({"floors": 1.0}, "floor: missing: a table of cells has the columns ship, type"),
    ],
)
def test_a_wrong_value_is_one_line(cells, changed, words):
    cells = cells.drop(columns="floor") if "floors" in changed else cells
    with pytest.raises(DataError) as error:
        check_cells(cells.assign(**changed))
    assert words in str(error.value)
