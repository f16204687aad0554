"""The study over ships: each cell once, the same digits in any order, and one line for a ship that fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shipid.errors import ResultError, ShipidError
from shipid.exchange import campaign
from shipid.exchange.campaign import (
    BUNDLED,
    HORIZONS,
    plan_ship,
    run_ships,
    ship_names,
    studied_ship,
    study_ship,
)
from shipid.files import read_json

DRAWN, SEED, AMOUNTS = 10, 612, (1, 2)
KEY = ["ship", "foundation", "N_D", "ahead"]


def test_every_ship_is_named_once_and_a_part_is_mixed() -> None:
    names = ship_names()
    assert len(names) == len(set(names)) == len(BUNDLED) + 30
    assert 1 < sum(name in BUNDLED for name in names[:8]) < 5
    assert ship_names(10)[0] in BUNDLED
    assert len(ship_names(10)) == len(BUNDLED) + 10


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
    assert ship.physics.digest == (plan.truth.digest if name in BUNDLED else ship.truth.digest) or truth.set


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return study_ship("drawn-01", SEED, DRAWN, AMOUNTS, tmp_path_factory.mktemp("ship") / "part.json")


@pytest.mark.slow
def test_the_table_has_each_cell_once_and_its_columns_agree(cells: pd.DataFrame) -> None:
    assert not cells.duplicated(KEY).any()
    alone = cells[cells["N_D"] == 0]
    assert (alone["H"] == alone["A"]).all()
    assert (cells["kind"] == "none").equals(cells["A"].isna())
    assert set(cells["ahead"]) == set(HORIZONS)
    nominal = cells[cells["kind"] == "nominal"]
    assert (nominal["A"] == nominal["floor"]).all()
    assert (cells.groupby("ahead")[["baseline", "floor"]].nunique() == 1).all(axis=None)
    wide = cells.pivot_table(index=["foundation", "N_D"], columns="ahead", values="H")
    assert (wide[4.0] > wide[1.0]).all()  # paths part with time


@pytest.mark.slow
def test_shards_and_an_interrupted_run_give_equal_digits(
    cells: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaign, "ship_names", lambda _=0: ["drawn-01", "otter"])
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert len([*run_ships(whole, SEED, DRAWN, AMOUNTS)]) == 2
    for shard in ((2, 2), (1, 2)):
        assert len([*run_ships(parts, SEED, DRAWN, AMOUNTS, shard=shard)]) == 1
    table = pd.read_csv(whole / "cells.csv")
    pd.testing.assert_frame_equal(table, pd.read_csv(parts / "cells.csv"), check_exact=True)
    pd.testing.assert_frame_equal(pd.read_parquet(whole / "drawn-01.parquet"), cells, check_exact=True)
    (whole / "drawn-01.parquet").unlink()
    assert [file.name for file in whole.glob("*.json")] == ["ships.json"]
    done, run_unit = list[str](), campaign.run_unit

    def interrupt(*given: Any) -> Any:
        if len(done) == 7:
            done.append("interrupted")
            raise KeyboardInterrupt
        done.append(given[2].key)
        return run_unit(*given)

    monkeypatch.setattr(campaign, "run_unit", interrupt)
    with pytest.raises(KeyboardInterrupt):
        next(run_ships(whole, SEED, DRAWN, AMOUNTS))
    assert len([*run_ships(whole, SEED, DRAWN, AMOUNTS)]) == 1  # the other one is kept
    assert len({*done}) == len(done)  # and no unit is computed twice
    pd.testing.assert_frame_equal(table, pd.read_csv(whole / "cells.csv"), check_exact=True)


def test_a_ship_that_fails_is_a_line_and_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def study(name: str, *_: object) -> pd.DataFrame:
        if name == "otter":
            raise ShipidError("it capsizes")
        return pd.DataFrame({"ship": [name], "H": [1.0]})

    monkeypatch.setattr(campaign, "study_ship", study)
    lines = [*run_ships(tmp_path, SEED, DRAWN)]
    assert [line for line in lines if "capsizes" in line] == ["otter is left out: it capsizes"]
    table = pd.read_csv(tmp_path / "cells.csv")
    assert sorted(table["ship"]) == sorted(set(ship_names(DRAWN)) - {"otter"})
    with pytest.raises(ResultError, match="take another folder"):
        next(run_ships(tmp_path, SEED + 1, DRAWN))
    with pytest.raises(ResultError, match="i from 1 to n"):
        next(run_ships(tmp_path, SEED, DRAWN, shard=(3, 2)))


def test_ships_of_other_code_are_not_mixed_and_a_damaged_file_of_a_ship_is_no_ship_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A ship that is left out is missing in the law, without an error."""

    def study(name: str, *given: Any) -> pd.DataFrame:
        if given[-1].exists():
            read_json(given[-1])
        return pd.DataFrame({"ship": [name], "H": [1.0]})

    monkeypatch.setattr(campaign, "study_ship", study)
    monkeypatch.setattr(campaign, "ship_names", lambda _=0: ["drawn-01", "otter"])
    first = run_ships(tmp_path, SEED, DRAWN)
    next(first)
    first.close()
    (tmp_path / "otter.json").write_text('{"drawn')
    with pytest.raises(ResultError, match=r"otter\.json"):
        list(run_ships(tmp_path, SEED, DRAWN))
    (tmp_path / "otter.json").unlink()
    monkeypatch.setattr(campaign, "code_digest", lambda: "00000000")
    with pytest.raises(ResultError, match="take another folder"):
        list(run_ships(tmp_path, SEED, DRAWN))
