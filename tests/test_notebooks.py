"""What an object shows of itself: one short line, and a table that has what it is and escapes what it is called."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from types import ModuleType

import pytest

import shipid
from shipid.data.dataset import read_dataset
from shipid.predictor import Predictor
from shipid.study.results import read_results
from tests.study.tiny import TINY, run_here, tiny_plan


def test_every_object_shows_itself(tiny_run: Path, tmp_path: Path) -> None:
    run_here(tiny_plan(tmp_path, {"grid.seeds": [0, 1]}), tmp_path / "run")
    vessel, results = shipid.load_vessel("gunnerus-28.9"), read_results(tiny_run)
    start = {name: [0.0] for name in ("north", "east", "psi", "u", "v", "r")}
    orders = {f"{side}.{signal}": [1.0] for side in ("port", "starboard") for signal in ("n", "alpha")}
    calm = {"V_w": [0.0], "beta_w": [0.0]}
    cell = next((tiny_run / "cells").glob("right+*"))
    family = shipid.read_families("quick")["moderate"]
    path = shipid.rollout(vessel, start, orders, calm, step=0.5, num_steps=4)
    of_model = results.cells["model"].eq("right")
    mean = f"{results.cells.loc[of_model & results.cells['N_D'].eq(4), 'H'].mean():.4g}"
    shows = [
        (vessel, "name R/V Gunnerus, 28.9 m", "inertia.m"),
        (family, "rules.members", "factor"),
        (read_dataset(tiny_run / "dataset.parquet"), "commands port.n", "north"),
        (path, "states 5 x 1 x 1 x", "interval"),
        (results, "missing 0 of 8", mean),
        (shipid.compare([tiny_run, tmp_path / "run"]), "names", "identical"),
        (Predictor.load(cell), "method kernel", "physics.horizon"),
    ]
    for one, line, words in shows:
        assert line in repr(one)
        assert len(repr(one)) < 450, repr(one)
        page = one._repr_html_()
        assert page.startswith("<table")
        assert words in page


def test_a_name_is_escaped() -> None:
    vessel = dataclasses.replace(shipid.load_vessel("gunnerus-28.9"), file="<b>.toml")
    assert "&lt;b&gt;.toml" in vessel._repr_html_()


def test_a_notebook_has_a_bar(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "ipykernel", ModuleType("ipykernel"))
    shipid.run(TINY, {"grid.N_D": [4]}, tmp_path / "run", workers=0)
    assert "4/4" in capsys.readouterr().err
    monkeypatch.delitem(sys.modules, "ipykernel")
    shipid.run(TINY, {"grid.N_D": [4]}, tmp_path / "run", workers=0)
    assert not capsys.readouterr().err
