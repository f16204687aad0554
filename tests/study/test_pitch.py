"""A controllable-pitch propeller through a whole study: truth, log, corrections, identification, report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.identification.settings import Identify
from shipid.identification.solve import identify
from shipid.predictor import Predictor
from shipid.study import store
from shipid.study.plan import Plan, read_plan
from shipid.study.results import Results, read_results
from tests.study.tiny import run_here

SHIP = """
extends = "kvlcc2-l7"
name = "KVLCC2, 7 m model, with a controllable-pitch propeller"
source = "a line through the open-water curve of her screw"
[thruster.propeller]
off = true
[thruster.cpp]
kind = "controllable_pitch"
x = -3.36
D_p = 0.216
k_P = 0.4065
k_J = 0.3189
t_P = 0.22
w_P0 = 0.4
[thruster.rudder]
behind = "cpp"
"""
STUDY = """
question = "Does a pitch pass through the whole chain?"
[truth]
vessel = "./cpp.toml"
manoeuvres = 8
duration = 20.0
[[truth.manoeuvre]]
kind = "steps"
n_rpm = [500.0, 650.0]
pitch = [0.4, 0.9]
delta_deg = [-20.0, 20.0]
hold = [4.0, 8.0]
start_speed = [0.6, 1.2]
[split]
test = 2
[prediction]
ahead = 4.0
integrator = "rk4"
commands = "known"
[grid]
N_D = [6]
[[method]]
name = "kernel"
kind = "kernel"
trials = 2
steps = 2
terms = 3
[[method]]
name = "alone"
kind = "alone"
[[family]]
name = "weak"
base = "./cpp.toml"
[[family.perturb]]
parameters = ["thruster.cpp.k_P"]
factor = 0.6
[[family]]
name = "fitted"
extends = "weak"
[family.identify]
parameters = ["thruster.cpp.k_P"]
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Results]:
    folder = tmp_path_factory.mktemp("pitch")
    (folder / "cpp.toml").write_text(SHIP)
    (folder / "pitch.toml").write_text(STUDY)
    plan = read_plan(folder / "pitch.toml")
    run_here(plan, folder / "run")
    return plan, read_results(folder / "run")


def test_the_truth_draws_and_logs_the_pitch(finished: tuple[Plan, Results]) -> None:
    pitch = finished[1].dataset.frame.groupby("run")["cpp.pitch"]
    assert (pitch.min() >= 0.4).all()
    assert (pitch.max() <= 0.9).all()
    assert (pitch.nunique() > 1).all()
    assert set(finished[1].dataset.commands) == {"cpp.n", "cpp.pitch", "rudder.delta"}


def test_identification_finds_what_a_pitch_gives(finished: tuple[Plan, Results]) -> None:
    """The foundation that identifies misses next to nothing; k_P is near that of the truth."""
    plan, results = finished
    rows = store.read_rows(results.folder).set_index(["foundation", "method"])
    assert (rows["status"] == "ok").all(), rows["sentence"]
    assert rows.loc[("fitted", "alone"), "A"] < 0.2 * rows.loc[("weak", "alone"), "A"]
    weak = plan.truth.with_values({"thruster.cpp.k_P": 0.6 * 0.4065})
    fitted = identify(weak, results.dataset, results.dataset.runs, Identify(parameters=["thruster.cpp.*k_P"]))
    assert fitted.values["thruster.cpp.k_P"] == pytest.approx(0.4065, rel=0.03)  # orders change between rows


def test_the_correction_takes_the_pitch_as_an_input(finished: tuple[Plan, Results]) -> None:
    """Other pitches, other paths, beyond what the physics makes of them; half the error of weak thrust is gone."""
    _, results = finished
    rows = store.read_rows(results.folder).set_index(["foundation", "method"])
    assert rows.loc[("weak", "kernel"), "H"] < 0.7 * rows.loc[("weak", "alone"), "H"]
    cell = rows.loc[("none", "kernel"), "cell"]
    predictor = Predictor.load(store.cell_file(results.folder, cell))
    instants = results.test.instants(known=True)
    other = dict(instants.columns) | {"cpp.pitch": instants.columns["cpp.pitch"] + 0.2}
    moved = predictor.predict(replace(instants, columns=other)) - predictor.predict(instants)
    assert np.abs(moved).max() > 1e-3
