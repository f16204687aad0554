"""FMUs in studies: as families beside the vessel that they were exported from, and as the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import shipid
from shipid.errors import DataError, DocumentError
from shipid.export.fmu import vessel_unit, write_fmu
from shipid.study.plan import build_plan
from shipid.study.prepare import obtain_runs, prepare
from shipid.study.store import provenance
from shipid.vessel.load import load_vessel
from tests.cli.running import ended, output_of
from tests.foundations.foreign import build_ship, motion_of_ship, write_table

STEPS = {"kind": "steps", "hold": [5.0, 15.0], "n_rpm": [60, 100], "delta_deg": [-20, 20], "start_speed": [4.0, 6.0]}


TRUTH = {"vessel": "mariner", "manoeuvres": 5, "duration": 30.0, "run_up": 4.0, "manoeuvre": [STEPS]}


def study_of(folder, family, truth=None, commands="held"):
    document = {
        "question": "Does an FMU do as its ship?",
        "truth": {**TRUTH, **(truth or {})},
        "split": {"test": 2},
        "prediction": {"ahead": 10.0, "step": 1.0, "integrator": "rk4", "commands": commands},
        "grid": {"N_D": [2], "seeds": [0]},
        "method": [{"name": "alone", "kind": "alone"}],
        "family": [{"name": "one", "members": 2} | family],
    }  # fmt: skip
    return build_plan(document, folder / "study.toml", trust=True)


@pytest.mark.slow
@pytest.mark.parametrize("commands", ["held", "known"])
def test_a_family_of_an_exported_vessel_is_that_of_the_vessel(tmp_path, commands):
    """Its rudder lags: it begins as it has been along the run. Both draw the same factors of the same numbers."""
    pytest.importorskip("fmpy")
    write_fmu(vessel_unit(load_vessel("mariner"), "ship", "rk4"), tmp_path / "ship.fmu")
    factors = {"parameters": ["hull.*.N_*", "inertia.m"], "factor": [0.8, 1.2]}
    own = study_of(tmp_path, {"base": "mariner", "perturb": [factors]}, commands=commands)
    rules = [factors, {"set": {"solver.step": 1.0}}]
    theirs = study_of(tmp_path, {"fmu": "ship.fmu", "perturb": rules}, commands=commands)
    dataset = obtain_runs(own)
    one, other = prepare(own, dataset), prepare(theirs, dataset)
    for name in ("one-1", "one-2"):
        assert np.abs(one.known[name].paths - one.known["one-1"].paths).max() > 0.1 or name == "one-1"
        np.testing.assert_allclose(other.known[name].paths, one.known[name].paths, rtol=0, atol=1e-9)
        np.testing.assert_allclose(other.known[name].test_paths, one.known[name].test_paths, rtol=0, atol=1e-9)
    assert any("starts from the state" in note for note in other.notes)
    assert any("rudder.delta +" in note and "turns to" in note for note in other.notes)


@pytest.mark.slow
@pytest.mark.parametrize("starts", [True, False])
def test_the_truth_and_its_own_physics_agree(tmp_path, starts):
    """A ship of C is the truth, and its own family: no error. Without start values it runs along each run."""
    table = write_table(build_ship(tmp_path / "ship.fmu", 3, starts=starts, branches=not starts), starts)
    perturb = [{"parameters": ["X_uu"], "factor": [0.5, 2.0]}]
    plan = study_of(tmp_path, {"fmu": table.name, "perturb": perturb}, {"fmu": table.name}, "known")
    dataset = obtain_runs(plan)
    run = dataset.frame[dataset.frame["run"] == "M001"]
    orders = {name: run[name].to_numpy()[None, :-1] for name in ("rudder.delta", "propeller.n")}
    names = ["north", "east", "psi", "u", "v", "r"]
    begun = run[names].to_numpy()[:1]
    np.testing.assert_allclose(run[names].to_numpy()[1:], motion_of_ship(begun, orders, 1.0)[0], rtol=0, atol=1e-9)
    assert (begun[0, 3] > 3) == starts  # else at rest, as it begins itself
    exact = study_of(tmp_path, {"fmu": table.name, "members": 1}, {"fmu": table.name}, "known")
    prepared = prepare(exact, dataset)
    np.testing.assert_allclose(prepared.known["one"].test_paths, prepared.test.future, rtol=0, atol=1e-9)
    family = prepare(plan, dataset)
    errors = [np.abs(family.known[f"one-{k}"].test_paths - family.test.future).max() for k in (1, 2)]
    assert min(errors) > 0.01
    way = "starts from the state" if starts else "runs along each run"
    assert any(way in note for note in family.notes)


FAILING = """
question = "What do members that fail do to a study?"
[truth]
vessel = "mariner"
fmu = "ship.toml"
manoeuvres = 6
duration = 30.0
run_up = 8.0
[[truth.manoeuvre]]
kind = "steps"
n_rpm = [60, 100]
delta_deg = [-20, 20]
start_speed = [4.0, 6.0]
[split]
test = 2
[prediction]
ahead = 6.0
step = 1.0
[grid]
N_D = [2, 3]
seeds = [0]
[[method]]
name = "kernel"
kind = "kernel"
trials = 1
steps = 2
terms = 4
memory = {error = [2.0]}
[[family]]
name = "sound"
fmu = "ship.toml"
members = 2
[[family.perturb]]
parameters = ["X_uu", "K"]
factor = [0.4, 1.6]
"""


@pytest.mark.slow
def test_members_that_hang_or_fail_end_no_study(tmp_path, caplog):
    """Truth, families, memory, workers, report: the sound members have the numbers of a study without the others."""
    write_table(build_ship(tmp_path / "ship.fmu"), more="limit = 1")
    (tmp_path / "sound.toml").write_text(FAILING)
    more = [
        f'[[family]]\nname = "fault-{fault}"\nextends = "sound"\n[[family.perturb]]\nset = {{fault = {fault}}}'
        for fault in (1, 2, 3)
    ]
    (tmp_path / "study.toml").write_text("\n".join([FAILING, *more]))
    status, _, said = ended("study", "run", tmp_path / "study.toml", "--out", tmp_path / "out")
    assert status
    assert "family.sound.fmu: ship.toml is code that this document names" in said.replace("family.0", "family.sound")
    tables = {}
    for name in ("sound", "study"):
        words = ["--out", tmp_path / name, "--workers", "2", "--trust"]
        assert (tmp_path / name / "report.html").is_file() or output_of(
            "study", "run", tmp_path / f"{name}.toml", *words
        )
        cells = shipid.read_results(tmp_path / name).cells
        assert cells["status"].eq("ok").all()
        tables[name] = cells[cells["family"].eq("sound")].set_index(["foundation", "N_D"])[["A", "H"]].dropna()
    assert len(tables["sound"]) >= 4
    np.testing.assert_array_equal(tables["sound"], tables["study"])
    assert "takes longer than 1 s" in caplog.text
    assert "ends its process" in caplog.text
    notes = " ".join(provenance(tmp_path / "study")["notes"])
    assert "fault-1 diverges on 100" in notes


def test_a_helmsman_cannot_steer_an_fmu(tmp_path):
    table = write_table(build_ship(tmp_path / "ship.fmu"))
    zigzag = {"manoeuvre": [{"kind": "zigzag", "n_rpm": 80}], "fmu": table.name}
    with pytest.raises(DocumentError, match="the helmsman of zigzag steers mariner, not the FMU") as error:
        study_of(tmp_path, {"base": "mariner", "equal": True}, zigzag)
    assert error.value.path == "truth.manoeuvre.0.kind"


@pytest.mark.slow
def test_a_ship_that_turns_the_other_way_is_refused(tmp_path):
    table = write_table(build_ship(tmp_path / "ship.fmu"))
    plan = study_of(tmp_path, {"fmu": table.name, "equal": True}, {"fmu": table.name})
    dataset = obtain_runs(plan)
    table.write_text(table.read_text().replace('"rudder", unit = "deg"', '"rudder", unit = "deg", scale = -1'))
    turned, key = study_of(tmp_path, {"fmu": table.name, "equal": True}), "family.one.fmu"
    with pytest.raises(DataError, match=rf'acts the other way in the runs.*write unusual = \["{key}"\]') as error:
        prepare(turned, dataset)
    assert str(error.value.file) == str(table)
    assert error.value.message.startswith("rudder.delta")
    meant = replace(turned, study=turned.study.model_copy(update={"unusual": [key]}))
    assert prepare(meant, dataset).known["one-1"].test_paths.size
