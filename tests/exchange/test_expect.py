"""What to expect before there are data, and with more runs than a study has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipid import read_results
from shipid.errors import ShipidError
from shipid.exchange import expect
from shipid.exchange.law import CELL_COLUMNS, UnseenShip, check_cells, read_law

SHIP = UnseenShip(100.0, 7.0, baseline=50.0, floor=12.0)


@pytest.fixture(scope="module")
def law():
    return read_law()


def test_better_physics_and_more_runs_are_expected_to_err_less(law):
    table = expect.expected_errors(law, SHIP, ["moderate", "model-test", "identified"], [0, 4, 40], 2.0)
    H = table.pivot(index="physics", columns="N_D", values="H").loc[["moderate", "model-test", "identified"]]
    assert (np.diff(H, axis=0) < 0).all()
    assert (np.diff(H, axis=1) < 0).all()
    assert (table["low"] < table["H"]).all()
    assert (table["H"] < table["high"]).all()
    assert (H[0] > SHIP.floor).all()
    assert (table.loc[0, ["ratio", "ratio_low", "ratio_high"]] == 1.0).all()
    other = table.loc[table["physics"] == "identified"].iloc[-1]
    assert other["ratio"] == pytest.approx(other["H"] / table["H"][0], rel=0.1)
    assert other["ratio_high"] / other["ratio_low"] < (other["high"] / other["low"]) * (table["high"] / table["low"])[0]
    words = expect.comparison_sentence(table)
    assert words.startswith("On the same ship identified with 40 runs errs least of these, 0.")


def test_the_sentence_says_runs_physics_interval_and_horizon(law):
    table = expect.expected_errors(law, SHIP, [("template", 40.0)], [1], 2.0)
    words = expect.expectation_sentence(table.iloc[0], SHIP, 2.0)
    assert words.startswith("With 1 run and this physics (template, A 40.00 m), expect the path to err by ")
    assert words.endswith("in the mean over the next 38.1 s (2 ship lengths).")
    assert "m, 95 % interval " in words, "one ship is asked: its baseline is known"
    unseen = expect.expectation_sentence(table.iloc[0], UnseenShip(SHIP.length, SHIP.speed), 100.0)
    assert "m, 95 % of ships " in unseen
    assert "the next 1905 s (100 ship lengths)" in unseen


def test_it_says_itself_what_is_extrapolated(law):
    inside = expect.sentences_on_limits(law, SHIP, ["template", 30.0], [1, 64], 2.0)
    assert inside == []
    small = UnseenShip(0.5, 2.2)
    words = "\n".join(expect.sentences_on_limits(law, small, [9.0], [0, 200], 9.0))
    for name, value in {
        "length [m]": "0.5",
        "Froude number": "0.993",
        "runs": "200",
        "ship lengths ahead": "9",
    }.items():
        assert f"extrapolated: {name} {value}, the ships of the law have " in words
    assert "extrapolated: A / length 18, " in words
    assert "runs 0," not in words


def test_a_study_conditions_the_law(law, tiny_run: Path):
    results = read_results(tiny_run)
    cells, ship = expect.study_cells(results)
    assert set(CELL_COLUMNS) <= set(cells)
    assert set(check_cells(cells)["foundation"]) == set(results.models["model"])
    assert cells.set_index("foundation")["kind"].to_dict() == {
        "right": "",
        "wrong-1": "",
        "wrong-2": "",
        "none": "none",
    }
    assert ship.baseline == pytest.approx(results.naive.mean())
    table = expect.expected_errors(
        law.given(cells), ship, ["right", "none"], [*set(cells["N_D"]), 50], cells["ahead"].iloc[0]
    )
    mine = results.table()
    known = table[table["N_D"].isin(mine.columns)]
    for row in known.to_dict("records"):
        assert row["low"] <= mine.loc[row["physics"], row["N_D"]] <= row["high"]
        assert (row["low"] < row["high"]) == (row["N_D"] > 0)


def test_a_study_without_results_is_one_line(tiny_run: Path):
    results = read_results(tiny_run)
    with pytest.raises(ShipidError, match="no cell has a result: run the study first"):
        expect.study_cells(replace(results, cells=results.cells.assign(status="failed")))


def test_a_vessel_is_met_in_simulation(tmp_path: Path):
    near, far = (expect.meet_ship("cybership2", ahead, tmp_path / "study.toml") for ahead in (1.0, 3.0))
    assert near.length == 1.255
    for name in ("baseline", "floor"):
        assert 2.0 < getattr(far, name) / getattr(near, name) < 9.0, "errors grow with the horizon to a power of 1 to 2"
    assert far.floor < far.baseline < 3.0 * far.length


def test_what_is_asked_is_one_error_or_some_kinds():
    assert expect.likely_physics(None, None) == list(expect.OFFERED)
    assert expect.likely_physics(["template"], 4.0) == [("template", 4.0)]
    assert expect.likely_physics(None, 4.0) == [4.0]
    with pytest.raises(ShipidError, match="--A: is that of one physics"):
        expect.likely_physics(["template", "sister"], 4.0)
