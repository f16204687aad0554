"""Ships whose cells teach the law: the same in any order, none of the template, each cell once; a start resumes."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from docs import exchange_ships
from docs.exchange_ships import (
    BUNDLED,
    HORIZONS,
    SHIP_TYPES,
    Dice,
    DrawnShip,
    _linear_derivatives,
    draw_ship,
    plan_ship,
    ship_names,
    studied_ship,
    study_ship,
)
from shipid.errors import ShipidError
from shipid.simulation.approach import Controls
from shipid.vessel.template import Particulars, first_guess

DRAWN, AMOUNTS = 10, (1, 2)
SEED = 611  # no record has it


@pytest.fixture(scope="module")
def fleet() -> list[DrawnShip]:
    return [draw_ship(SEED, number) for number in range(len(SHIP_TYPES))]


def test_a_ship_depends_on_its_seed_and_number_alone(fleet: list[DrawnShip]) -> None:
    alone = draw_ship(SEED, 7)
    assert alone == fleet[7]
    assert alone.vessel().digest == fleet[7].vessel().digest
    digests = {ship.vessel().digest for ship in (*fleet, draw_ship(SEED + 1, 7), draw_ship(SEED, 17))}
    assert len(digests) == len(fleet) + 2


def test_every_type_is_drawn_within_its_ranges(fleet: list[DrawnShip]) -> None:
    assert {ship.type for ship in fleet} == set(SHIP_TYPES)
    for ship in fleet:
        kind, given = SHIP_TYPES[ship.type], ship.particulars
        numbers = (
            given.length,
            given.service / np.sqrt(9.81 * given.length),
            given.length / given.beam,
            given.beam / given.draught,
            given.block,
        )
        ranges = (kind.length, kind.froude, kind.slender, kind.beamy, kind.block)
        assert all(
            low <= value * (1 + 1e-9) and value <= high * (1 + 1e-9)
            for value, (low, high) in zip(numbers, ranges, strict=True)
        )


def test_the_truth_is_not_what_the_template_gives(fleet: list[DrawnShip]) -> None:
    """Same commands, so that one log fits both; no hull number of the one is in the other, and the paths part."""
    for ship in fleet:
        truth, guess = ship.vessel(), first_guess(ship.particulars, "guess", "guess.toml").vessel
        assert Controls(truth).commands == Controls(guess).commands
        hulls = [
            {path for path in one.parameters if path.startswith("hull.") and "R_" not in path} for one in (truth, guess)
        ]
        assert not hulls[0] & hulls[1]


def test_the_regressions_are_those_of_the_mariner_within_their_scatter() -> None:
    """Planar motion tests of Chislett and Stroem-Tejsen (1965): Y_v -1160e-5, N_v -264e-5, N_r -166e-5."""
    mariner = Particulars(160.93, 23.17, 7.47, 0.597)
    drawn = [_linear_derivatives(mariner, Dice((SEED, number))) for number in range(60)]
    for name, measured in {"Y_v": -1160e-5, "N_v": -264e-5, "N_r": -166e-5}.items():
        values = np.array([one[name] for one in drawn])
        assert 0.6 < np.median(values) / measured < 1.8, name
        assert np.ptp(values) > 0.3 * abs(measured), name


def test_dice_of_another_name_change_no_draw() -> None:
    dice = Dice((1, "ship"))
    before = dice("length", 2.0, 300.0)
    dice("beam", 0.0, 1.0)
    assert dice("length", 2.0, 300.0) == before
    factors = [Dice((k,)).scatter("x", 0.25) for k in range(400)]
    assert 0.8 <= min(factors) < 0.82 < 1.22 < max(factors) <= 1.25
    assert abs(np.log(factors).mean()) < 0.02


def test_every_ship_is_named_once_and_a_part_is_mixed() -> None:
    names = ship_names()
    assert len(names) == len(set(names)) == len(BUNDLED) + 30
    assert 1 < sum(name in BUNDLED for name in names[:8]) < 5


@pytest.mark.parametrize("name", ["drawn-01", "drawn-03", "kvlcc2-l7"])
def test_the_study_of_a_ship_has_its_own_sizes(name: str) -> None:
    ship = studied_ship(name, SEED, DRAWN)
    plan = plan_ship(ship, SEED, DRAWN, AMOUNTS)
    truth, ahead = plan.study.truth, plan.study.prediction
    U, L = ship.physics.document["particulars"]["U_0"], ship.physics.length
    assert ahead.ahead * 0.75 * U / L == pytest.approx(max(HORIZONS), rel=0.05)
    assert ahead.horizon % 4 == 0
    assert truth.current_speed[1] <= 0.051 * U
    assert 0.0001 * U < truth.sensors["u"].noise < 0.0101 * U
    assert {one.kind for one in truth.manoeuvre} >= {"turning", "steps"}
    assert {one.family.partition("-")[0] for one in plan.foundations} == {
        *("nominal", "damping", "mass", "thrust", "missing", "moderate", "high", "template", "none"),
        *(["sister"] if name != "drawn-01" else []),  # the only one of ten ships that steers by its shafts
    }


@pytest.mark.slow
def test_the_table_has_each_cell_once_and_its_columns_agree() -> None:
    cells = study_ship("drawn-01", SEED, DRAWN, AMOUNTS)
    assert not cells.duplicated(["ship", "foundation", "N_D", "ahead"]).any()
    alone = cells[cells["N_D"] == 0]
    assert (alone["H"] == alone["A"]).all()
    assert (cells["kind"] == "none").equals(cells["A"].isna())
    nominal = cells[cells["kind"] == "nominal"]
    assert (nominal["A"] == nominal["floor"]).all()
    assert (cells.groupby("ahead")[["baseline", "floor"]].nunique() == 1).all(axis=None)
    wide = cells.pivot_table(index=["foundation", "N_D"], columns="ahead", values="H")
    assert (wide[4.0] > wide[1.0]).all()  # paths part with time


def test_a_start_goes_on_and_a_ship_that_fails_is_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    studied = []

    def study(name: str, *_: object) -> pd.DataFrame:
        studied.append(name)
        if name == "otter":
            raise ShipidError("it capsizes")
        return pd.DataFrame({"ship": [name], "H": [1.0]})

    monkeypatch.setattr(exchange_ships, "study_ship", study)
    for words in (["--ships", "mariner"], []):
        monkeypatch.setattr(sys, "argv", ["", str(tmp_path), *words, "--drawn", "10", "--workers", "0"])
        exchange_ships.main()
    assert sorted(studied) == sorted(ship_names(10))
    assert "otter: left out, it capsizes" in capsys.readouterr().out
    assert sorted(pd.read_csv(tmp_path / "cells.csv")["ship"]) == sorted({*studied} - {"otter"})
