"""Tables of paths as physics: what they must hold, and methods that ask for more than paths."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import shipid
from shipid.errors import DataError, DocumentError, ResultError
from shipid.foundations.faults import doubt_of_places
from shipid.foundations.predictions import PredictionTable
from shipid.study.plan import Plan
from shipid.study.prepare import PreparedStudy, obtain_runs, prepare
from shipid.study.windows import StudyWindows, windows
from tests.cli.running import ended
from tests.foundations.ships import simulated_table, study_file
from tests.foundations.test_function import FAMILY
from tests.study.test_score import FAULTS

TABLE = '[[family]]\nname = "table"\npredictions = "paths.parquet"\n'
METHOD = '[[method]]\nname = "kernel"\nkind = "kernel"\nmemory = {error = [2.0]}\n'


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> StudyWindows:
    folder = tmp_path_factory.mktemp("cut")
    return windows(study_file(folder, TABLE, methods=METHOD), every=True)


@pytest.fixture(scope="module")
def made(cut: StudyWindows) -> pd.DataFrame:
    return simulated_table(cut).reset_index(drop=True)


def plan_with(folder: Path, table: pd.DataFrame, more: str = "", methods: str = METHOD) -> Plan:
    table.to_parquet(folder / "paths.parquet")
    return shipid.read_plan(study_file(folder, TABLE, more, methods))


def prepare_table(folder: Path, table: pd.DataFrame, more: str = "") -> PreparedStudy:
    plan = plan_with(folder, table, more)
    return prepare(plan, obtain_runs(plan))


def test_windows_list_what_a_memory_asks_for(cut: StudyWindows, made: pd.DataFrame) -> None:
    rows = cut.tables()["windows"]
    earlier = rows[rows["split"].eq("earlier")]
    others = pd.MultiIndex.from_frame(rows[~rows["split"].eq("earlier")][["run", "instant"]])
    assert len(earlier) == 2 * 12  # two steps before the first windows of a run; later ones are windows themselves
    assert not pd.MultiIndex.from_frame(earlier[["run", "instant"]]).isin(others).any()
    assert made.groupby(["run", "instant"]).size().isin([2, 5]).all()
    assert not made.duplicated(["run", "instant", "ahead"]).any()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.drop(columns="north"), "north: lacks this column"),
        (lambda t: t.drop(index=7), "1 of .* steps are missing: `shipid study windows --every` lists them"),
        (lambda t: t[t["ahead"] < 5], "steps are missing"),
        (lambda t: t.assign(run="Z" + t["run"]), "steps are missing"),
        (lambda t: pd.concat([t, t[3:5]]), "2 of .* steps are there twice"),
        (lambda t: t.assign(u=np.nan), "u: nan in row 0 is no number"),
    ],
)
def test_faults_of_rows_are_one_line(
    tmp_path: Path, made: pd.DataFrame, change: Callable[[pd.DataFrame], pd.DataFrame], words: str
) -> None:
    with pytest.raises((DataError, DocumentError), match=words) as error:
        prepare_table(tmp_path, change(made))
    assert "paths.parquet" in str(error.value)


@pytest.mark.parametrize("fault", [fault for fault in FAULTS if not fault.startswith("saw the future: at")])
def test_a_table_that_seems_wrong_is_refused_unless_it_is_meant(
    tmp_path: Path, cut: StudyWindows, made: pd.DataFrame, fault: str
) -> None:
    keys = pd.MultiIndex.from_frame(made[["run", "instant", "ahead"]].round(4))
    table = made.set_axis(keys)
    inside = shipid.prediction_table(cut.windows, cut.windows.future)
    at = pd.MultiIndex.from_frame(inside[["run", "instant", "ahead"]].round(4))
    places = table.loc[at][["north", "east"]].to_numpy().reshape(len(cut.windows), -1, 2).swapaxes(0, 1)
    now = cut.windows.columns
    turn = np.cos(now["psi"]), np.sin(now["psi"])
    north, east = places[..., 0] - now["north"], places[..., 1] - now["east"]
    path = np.stack([turn[0] * north + turn[1] * east, turn[0] * east - turn[1] * north], axis=-1)
    wrong = np.asarray(FAULTS[fault](path, cut.windows)).swapaxes(0, 1).reshape(-1, 2)
    table.loc[at, ["north", "east"]] = wrong
    with pytest.raises(DataError, match=f"{fault}.*; if it is meant so, write unusual = .*family.table.predictions"):
        prepare_table(tmp_path, table)
    meant = prepare_table(tmp_path, table, 'unusual = ["family.table.predictions"]')
    assert meant.known["table"].test_paths.size


def test_a_poor_ship_is_not_accused(cut: StudyWindows) -> None:
    training = cut.windows.select(cut.keys["split"].eq("train").to_numpy())
    ship, rng = shipid.load_vessel("gunnerus-28.9"), np.random.default_rng(8)
    for _ in range(20):
        factors = {path: rng.uniform(0.4, 1.6) for path in ship.parameters if path.startswith("hull.derivatives.")}
        poor = ship.with_values({path: ship.parameters[path] * factor for path, factor in factors.items()})
        paths = shipid.Physics(poor, training.horizon, training.step).paths(training.instants())
        table = shipid.prediction_table(training, paths)
        places = table[["north", "east"]].to_numpy().reshape(len(training), -1, 2).swapaxes(0, 1)
        assert doubt_of_places(places, training) == ""


def test_a_table_that_is_not_there_yet_is_refused_before_anything_is_computed(tmp_path: Path) -> None:
    file = study_file(tmp_path, TABLE)
    status, _, said = ended("study", "run", file, "--out", tmp_path / "run")
    assert status
    assert "paths.parquet: no such file: `shipid study windows STUDY --every --out FOLDER` writes what" in said
    assert not (tmp_path / "run").exists()


def test_a_table_that_has_changed_is_refused(tmp_path: Path, made: pd.DataFrame) -> None:
    plan = plan_with(tmp_path, made)
    made.assign(north=0.0).to_parquet(tmp_path / "paths.parquet")
    with pytest.raises(ResultError, match="is gone, or not as it was when the study was read"):
        prepare(plan, obtain_runs(plan))


@pytest.mark.parametrize(
    ("kind", "kept", "words"),
    [
        ("one-step", 9, "the method needs single steps from any state, which a function gives"),
        ("regression", 9, "the method needs single steps"),
        ("calibrator", 5, "the method needs psi, u, v, r along the path"),
        ("modules", 9, "the method needs the equations of a vessel"),
    ],
)
def test_a_method_that_asks_for_more_is_refused(
    tmp_path: Path, made: pd.DataFrame, kind: str, kept: int, words: str
) -> None:
    methods = f'[[method]]\nname = "some"\nkind = "{kind}"\n[[method]]\nname = "alone"\nkind = "alone"\n'
    with pytest.raises(DocumentError, match=f"table with {kind}: {words}"):
        plan_with(tmp_path, made.iloc[:, :kept], methods=methods)


@pytest.mark.parametrize(
    ("families", "words"),
    [
        (TABLE + 'base = "gunnerus-28.9"\n', "stands beside 'base': give one of base, predictions, function"),
        (
            TABLE + '[[family.perturb]]\nparameters = ["m"]\nfactor = 2.0\n',
            "perturb: goes with a vessel or a function, not with predictions: leave it out",
        ),
        (
            FAMILY.format("my_ship:simulate") + 'structure = {"wind.off" = true}\n',
            "structure: goes with a vessel, not with function: leave it out",
        ),
        ('[[family]]\nname = "none-at-all"\n', "missing: name a base vessel, or a family to extend"),
    ],
)
def test_a_family_of_two_minds_is_refused(tmp_path: Path, families: str, words: str) -> None:
    with pytest.raises(DocumentError, match=words):
        shipid.read_plan(study_file(tmp_path, families), trust=True)


def test_only_vessels_are_drawn_by_the_command_for_families(tmp_path: Path) -> None:
    status, _, said = ended("family", "show", study_file(tmp_path, TABLE))
    assert status
    assert "its members are no variants of one vessel: only a family with a base alone is drawn here" in said


def test_instants_of_nobody_knows_which_run_are_refused(tmp_path: Path, made: pd.DataFrame, cut: StudyWindows) -> None:
    made.to_parquet(tmp_path / "paths.parquet")
    (one,) = PredictionTable.read("paths.parquet", tmp_path, False)
    instants = cut.windows.instants()
    assert one.states(instants, 5, 1.0)["north"].shape == (5, len(cut.windows))
    with pytest.raises(DataError, match=r"lacks run .* ahead 6 s"):
        one.states(instants, 6, 1.0)
    with pytest.raises(DataError, match="nobody knows the runs of these instants"):
        one.states(shipid.Instants(instants.columns), 5, 1.0)
