"""Rows of the campaign: mutated documents, read and used as a user would."""

from __future__ import annotations

import tempfile
from pathlib import Path
from unittest.mock import patch

import numpy as np

from shipid.engine.rollout import rollout
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from shipid.study.plan import read_plan
from shipid.study.prepare import obtain, prepare
from shipid.study.run import run_batch
from shipid.vessel.dynamics import dynamics
from shipid.vessel.load import load_vessel
from tests.faults.mutations import mutated

BAD = Path(__file__).parents[1] / "bad"
RUNNABLE = 2e5  # steps of a truth, or cells: a larger one is planned only


def study(seed: int) -> None:
    """Plan a mutated study; run a small one as far as its first batch, as it may not fail later."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "x.toml"
        file.write_bytes(mutated("study", seed)[0])
        plan = read_plan(file)
        plan.text()
        truth = plan.study.truth
        if truth is None or plan.cells > 40:
            return
        steps = truth.manoeuvres * truth.length / truth.step
        if steps < RUNNABLE and plan.study.prediction.horizon < 200 and seed % 2 == 0:
            prepared = prepare(plan, obtain(plan))
            run_batch(plan, prepared, plan.batches[-1], "cpu")


def vessel(seed: int) -> None:
    """Load a mutated vessel and let it move one second."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "x.toml"
        file.write_bytes(mutated("vessel", seed)[0])
        found = load_vessel(str(file))
        model = dynamics(found)
        rest = [{name: np.ones(1) for name in names} for names in (model.state, model.commands, model.environment)]
        rollout(found, *rest, step=0.5, num_steps=2, engine="casadi")


def mapping(seed: int) -> None:
    """Import a sound log by a mutated mapping."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "x.toml"
        file.write_bytes(mutated("mapping", seed)[0])
        found = read_mapping(file)
        with patch("shipid.logs.catalogue.fetch", side_effect=AssertionError):
            import_log(found, BAD / "logs" / "good.csv")


def chain(seed: int) -> None:
    """Patches on patches, or vessels that extend vessels, in a long chain or a ring."""
    length, ring, word = [1, 5, 80, 1200][seed % 4], seed % 3 == 0, ("base", "extends")[seed // 4 % 2]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(length):
            last = "./0.toml" if ring else "gunnerus-28.9"
            other = f"./{number + 1}.toml" if number + 1 < length else last
            (folder / f"{number}.toml").write_text(f'{word} = "{other}"\n')
        load_vessel(str(folder / "0.toml"))
