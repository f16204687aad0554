"""One study in several worlds: what is the same study, and how numbers of worlds become an interval."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shipid.answer import compare as module
from shipid.answer.compare import compare_errors, compare_findings, read_worlds
from shipid.cli import app
from shipid.errors import ResultError
from tests.answer.byhand import grid
from tests.study.tiny import run_here, tiny_plan


@pytest.fixture(scope="module")
def other_world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("world")
    run_here(tiny_plan(folder, {"seed": 1}), folder / "run")
    return folder / "run"


def test_worlds_of_one_study(tiny_run: Path, other_world: Path) -> None:
    """Another world has another truth, other members, other test runs, and cells of the same name but for the seed."""
    here, there = read_worlds([tiny_run, other_world])
    assert not (here.cells["H"].to_numpy() == there.cells["H"].to_numpy()).any()
    known = here.models["family"] == "right"
    assert (here.models["A"][known].to_numpy() != there.models["A"][known].to_numpy()).all()
    assert set(there.cells["seed"]) == {1000}
    assert set(here.test.spans) != set(there.test.spans)
    assert not here.dataset.frame["u"].equals(there.dataset.frame["u"])
    frame = compare_errors([here, there]).set_index(["family", "N_D"])
    assert set(frame.index) == {
        ("right", 0),
        ("wrong", 0),
        *((f, N) for f in ("right", "wrong", "none") for N in (4, 6)),
    }
    means = [results.cells.query("family == 'wrong' and N_D == 4")["H"].mean() for results in (here, there)]
    assert frame.loc[("wrong", 4), ["H", "H_low", "H_high"]].tolist() == pytest.approx(
        [sum(means) / 2, min(means), max(means)]
    )
    alone = [results.models.query("family == 'wrong'")["A"].mean() for results in (here, there)]
    assert frame.loc[("wrong", 0), "H"] == pytest.approx(sum(alone) / 2)
    assert compare_findings([here, there]).empty


def test_a_world_that_is_not_finished_is_refused(tmp_path: Path, tiny_run: Path) -> None:
    run_here(tiny_plan(tmp_path, {"seed": 5}), tmp_path / "half")
    batch = next((tmp_path / "half" / "batches").glob("*.json"))
    batch.unlink()
    (tmp_path / "half" / "seals" / f"{batch.stem}.sha256").unlink()
    with pytest.raises(ResultError, match="is not finished: continue with `shipid study resume"):
        read_worlds([tiny_run, tmp_path / "half"])


def test_verdicts_are_counted_and_numbers_have_an_interval(made: Any) -> None:
    H = {"good": (1.0,), "bad": (2.1,), "none": (9.0,)}
    worlds = [made(grid({**H, "bad": (bad,)}, (30,)), runs=8) for bad in (1.6, 1.7, 3.3)]
    frame = compare_findings(worlds).set_index(["id", "number"])
    row = frame.loc[("R2", "H inaccurate / A accurate")]
    assert row["verdicts"] == "2 confirmed, 1 refuted"
    wide = 4.3027 * np.std([0.8, 0.85, 1.65], ddof=1) / 3**0.5  # Student's t of three worlds
    assert row[["mean", "low", "high"]].tolist() == pytest.approx([1.1, 0.0, 1.1 + wide], abs=1e-4)
    assert wide > 1.1, "a ratio is not below 0"
    assert frame.loc[("R3", "gap after [m]"), "mean"] == pytest.approx(1.2)


@pytest.mark.parametrize(
    ("name", "limits"),
    [
        ("share shown to lead at N_D = 3", (0.0, 1.0)),
        ("rank correlation of H and H_90", (-1.0, 1.0)),
        ("roughness of true paths [m]", (0.0, 99.0)),
        ("H at N_D = 100 / at 10, median", (0.0, 99.0)),
        ("rise for twice the A at N_D = 3 [m]", (-99.0, 99.0)),
    ],
)
def test_each_kind_of_number_has_its_limits(
    name: str, limits: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Worlds that differ so much that Student's interval reaches far beyond any limit."""
    of_worlds = iter((0.0, 1.0, 0.4))
    monkeypatch.setattr(
        module,
        "judge_findings",
        lambda _: [{"id": "S", "claim": "", "verdict": "undecided", "numbers": {name: next(of_worlds)}}],
    )
    row = compare_findings([SimpleNamespace()] * 3).iloc[0]  # type: ignore[list-item]
    assert limits[0] <= row["low"] <= row["mean"] <= row["high"] <= limits[1]
    assert (row["low"] < 0) == (limits[0] < 0)
    assert (row["high"] > 1) == (limits[1] > 1)


def test_a_member_weighs_once_and_a_failed_cell_nothing() -> None:
    """A of a family is the mean over its members, however many cells each has; what is identified has no one A."""
    columns = ["foundation", "family", "method", "N_D", "status", "A", "H", "coverage", "width"]
    rows: list[tuple[Any, ...]] = [
        ("f-1", "f", "kernel", 4, "ok", 1.0, 0.6, 0.8, 2.0),
        ("f-1", "f", "kernel", 6, "ok", 1.0, 0.5, 0.9, 1.5),
        ("f-2", "f", "kernel", 4, "ok", 3.0, 1.0, 0.6, 4.0),
        ("f-2", "f", "kernel", 6, "failed", 3.0, 99.0, 0.0, 99.0),
        ("i", "i", "kernel", 4, "ok", 7.0, 0.2, 0.9, 1.0),
        ("none", "none", "kernel", 4, "ok", 50.0, 9.0, np.nan, np.nan),
    ]
    plan = SimpleNamespace(foundations=[SimpleNamespace(family="i", fitted=True)])
    worlds: Any = [SimpleNamespace(cells=pd.DataFrame(rows, columns=columns), plan=plan)] * 2
    bands = compare_errors(worlds).set_index(["family", "N_D"])
    assert bands["H"].to_dict() == {("f", 0): 2.0, ("f", 4): 0.8, ("f", 6): 0.5, ("i", 4): 0.2, ("none", 4): 9.0}
    assert bands["coverage"].dropna().to_dict() == pytest.approx({("f", 4): 0.7, ("f", 6): 0.9, ("i", 4): 0.9})
    assert bands["width"].dropna().to_dict() == {("f", 4): 3.0, ("f", 6): 1.5, ("i", 4): 1.0}
    assert set(bands["worlds"]) == {2}


def test_the_command_prints_both_tables(made: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    H = {"good": (1.0,), "bad": (2.1,), "none": (9.0,)}
    worlds = [made(grid({**H, "good": (good,)}, (30,)), runs=8) for good in (1.0, 1.25, 1.5)]
    monkeypatch.setattr(module, "are_worlds", lambda _: True)
    monkeypatch.setattr(module, "read_worlds", lambda _: worlds)
    result = CliRunner().invoke(app, ["study", "compare", "one", "other"])
    assert result.exit_code == 0, result.output
    lines = [" ".join(line.split()) for line in result.output.splitlines()]
    assert "finding in 3 worlds number mean over worlds 95 % from to" in lines
    assert "R1 3 confirmed H / A, accurate 0.625 0.3145 0.9355" in lines
    assert "family method N_D H [m] least greatest worlds" in lines
    assert any(line.startswith("good ") and line.endswith(" 30 1.25 1 1.5 3") for line in lines)


def test_which_folders_are_worlds_of_one_study(tmp_path: Path, tiny_run: Path, other_world: Path) -> None:
    run_here(tiny_plan(tmp_path, {"grid.N_D": [4]}), tmp_path / "run")
    assert module.are_worlds([tiny_run, other_world])
    assert not module.are_worlds([tiny_run, tmp_path / "run"])
    assert not module.are_worlds([tiny_run, tiny_run])
