"""One edit is enough: a signal, a term, a manoeuvre is one entry, added while they run."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import casadi as ca
import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.data.checks import check_dataset
from shipid.data.dataset import Dataset, write_dataset
from shipid.data.windows import Instants, cut_windows
from shipid.engine.rollout import rollout
from shipid.errors import DataError, DocumentError, ShipidError
from shipid.export.model import build_model
from shipid.export.write import export_predictor
from shipid.hybrid.features import input_group
from shipid.hybrid.one_step import OneStep
from shipid.hybrid.physics import Physics
from shipid.hybrid.stepping import Stepper, step_alone
from shipid.logs.guess.columns import guess
from shipid.physics import TERMS, Term, helm, signals
from shipid.physics.frames import wrench_of_force
from shipid.physics.signals import Signal
from shipid.predictor import fit
from shipid.report.wording import number_text
from shipid.simulation import manoeuvre
from shipid.simulation.approach import Controls
from shipid.simulation.perform import perform_manoeuvres
from shipid.simulation.standard import define_standard
from shipid.simulation.truth import Truth, simulate_truth
from shipid.study.envelope import envelope_table
from shipid.study.plan import Plan, build_plan, orders_may_react
from shipid.study.schema import PublishedEnvelope
from shipid.units import DEGREE
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, check_document, load_vessel
from tests.documented import entries, module, new_module
from tests.export.compiled import inputs_of_model
from tests.logs.conftest import PLAIN, as_log, import_written, turning
from tests.logs.simulated import as_bridge, si_log

FLAP = Signal(
    "command",
    "rad",
    "rudder flap",
    shown="deg",
    factor=DEGREE,
    angle=True,
    turns=1,
    mirror=-1,
    names=r"flap\w*",
    plausible=1.0,
    read_as_SI=1.6,
    reach=(-0.5, 0.5),
    usual=(-0.3, 0.3),
    component="flap",
)
T = np.arange(0.0, 60.0, 0.5)


def flap_force(nu_r: Any, flap: Any, *, x: Annotated[Any, "m"], k: Annotated[Any, "kg m^-1"]) -> Any:
    """Sway force -k u|u| flap at x: a positive flap aft turns the ship to starboard."""
    return wrench_of_force(x, ca.SX(0), ca.SX(0), ca.SX(0), -k * nu_r[0] * ca.fabs(nu_r[0]) * flap)


@pytest.fixture
def flap(monkeypatch: pytest.MonkeyPatch) -> None:
    """A signal `flap` and a term that takes it."""
    monkeypatch.setitem(signals.SIGNALS, "flap", FLAP)
    monkeypatch.setitem(TERMS, "thruster.flap", Term(flap_force))


def with_flap() -> Vessel:
    """A tanker model with a flap behind her rudder, which follows its order with a lag."""
    lag = {"flap": {"kind": "first_order", "T": 0.5, "rate": 0.2}}
    document = load_vessel("kvlcc2-l7").document
    block = {"kind": "flap", "x": -3.5, "k": 50.0, "actuator": lag}
    return check_document({**document, "thruster": {**document["thruster"], "tail": block}}, "with a flap")


@pytest.mark.usefixtures("flap")
def test_a_term_takes_it_and_its_actuator_lags() -> None:
    model = vessel_dynamics(with_flap())
    assert model.commands == ("propeller.n", "rudder.delta", "tail.flap")
    assert model.memory == {"rudder.delta": "rad", "tail.flap": "rad"}
    start = {**dict.fromkeys(("north", "east", "psi", "v", "r"), np.zeros(1)), "u": np.ones(1)}
    orders = {"propeller.n": np.full(1, 10.0), "rudder.delta": np.zeros(1), "tail.flap": np.full(1, 0.3)}
    path = rollout(
        with_flap(), start, orders, {}, step=0.1, num_steps=100, memory=dict.fromkeys(model.memory, np.zeros(1))
    )
    assert path["r"][-1, 0, 0] > 0.01
    lagged = path["actual.tail.flap"][:, 0, 0]
    assert 0 == lagged[0] < lagged[5] < lagged[-1] == pytest.approx(0.3)


@pytest.mark.usefixtures("flap")
def test_the_envelope_reads_in_degrees_beside_what_is_published() -> None:
    rows = [{"set": "D_4", "quantity": "tail.flap", "min": -0.1, "mean": 0.0, "max": 0.2}]
    published = PublishedEnvelope(source="a table", envelope={"flap_deg": (-6.0, 0.0, 12.0)})
    table = envelope_table(rows, published).set_index("set")
    assert set(table["unit"]) == {"deg"}
    assert table.loc["D_4", "max"] == pytest.approx(np.degrees(0.2))
    assert table.loc["published", "max"] == pytest.approx(12.0)


def rows_of_the_page() -> dict[str, Signal]:
    """The rows that docs/extending.md adds to the table of signals."""
    rows: dict[str, Signal] = eval("{" + entries("A signal", "SIGNALS") + "}", {"Signal": Signal})
    return rows


@pytest.fixture
def jet(monkeypatch: pytest.MonkeyPatch) -> None:
    """The water jet of docs/extending.md: a signal and its term."""
    row = rows_of_the_page()
    monkeypatch.setitem(signals.SIGNALS, "throttle", row["throttle"])
    monkeypatch.setitem(TERMS, "thruster.jet", Term(module("A term", "jet_of_the_page", monkeypatch).jet))


def with_jets(*names: str) -> Vessel:
    """A ship that jets alone drive: no shaft, so no manoeuvre by the helm."""
    document = load_vessel("gunnerus-28.9").document
    jets = {name: {"kind": "jet", "x": -13.0, "F_max": 6e4} for name in names}
    return check_document({**document, "thruster": jets}, "under jets")


@pytest.mark.usefixtures("jet")
@pytest.mark.parametrize(
    ("columns", "names"), [(("throttle",), ("main",)), (("throttle port", "throttle stbd"), ("port", "starboard"))]
)
def test_a_guess_names_the_commands_of_a_vessel_without_a_shaft(
    tmp_path: Path, columns: tuple[str, ...], names: tuple[str, ...]
) -> None:
    log = as_bridge(si_log()).drop(columns=["rudder", "rpm"])
    for place, column in enumerate(columns):
        log[column] = 0.5 + 0.1 * np.sin((1 + place) * log["time"])
    log.to_csv(tmp_path / "log.csv", index=False)
    proposal = guess(tmp_path / "log.csv", vessel=with_jets(*names))
    found = {column.name: column.source for column in proposal.columns if "." in column.name}
    assert found == {f"{name}.throttle": column for name, column in zip(names, columns, strict=True)}
    assert not [question for question in proposal.questions if "throttle" in str(question)]


@pytest.mark.usefixtures("jet")
def test_a_manoeuvre_by_shaft_and_helm_names_those_that_a_vessel_without_a_shaft_takes() -> None:
    with pytest.raises(DocumentError, match=r"needs a shaft speed `n`, or a `force`, the kinds .* order"):
        _ = Controls(with_jets("main")).helm
    assert Controls(with_jets("main")).effects == ((), {})
    truth = Truth(**SHALLOWS, manoeuvre=[{"kind": "steps", "throttle": (0.2, 0.8)}])
    assert simulate_truth(truth, with_jets("main"))["main.throttle"].between(0.2, 0.8).all()


SHALLOWS = {"vessel": "shallow", "manoeuvres": 3, "duration": 40.0, "step": 0.2, "wind_speed": (0.0, 0.0), "seed": 2}
ALIKE = {"kind": "turning", "n_rpm": 120.0, "alpha_deg": 5.0, "start_speed": 4.0}


@pytest.fixture
def depth(monkeypatch: pytest.MonkeyPatch) -> Vessel:
    """The depth of docs/extending.md with a term that takes it, and a ship that feels it."""
    row = rows_of_the_page()["depth"]
    monkeypatch.setitem(signals.SIGNALS, "depth", row)
    shallow = new_module("A signal", "shallow_of_the_page", monkeypatch)
    monkeypatch.setitem(TERMS, "hull.shallow", Term(shallow.shallow_drag))
    document = load_vessel("gunnerus-28.9").document
    block = {"c": 0.1, "T": 2.65, "L_pp": 28.9}
    return check_document({**document, "hull": {**document["hull"], "shallow": block}}, "shallow")


def test_a_truth_draws_the_depth_of_each_run_and_logs_it(depth: Vessel) -> None:
    """And a shallower run is slower: all else is equal but the course."""
    log = simulate_truth(Truth(**SHALLOWS, environment={"depth": (3.0, 20.0)}, manoeuvre=[ALIKE]), depth)
    runs = log.groupby("run")
    assert (runs["depth"].nunique() == 1).all()
    ends = pd.DataFrame({"depth": runs["depth"].last(), "u": runs["u"].last()}).sort_values("depth")
    assert ends["depth"].between(3, 20).all()
    assert ends["u"].is_monotonic_increasing
    assert ends["u"].iloc[0] < 0.98 * ends["u"].iloc[-1]
    assert check_dataset(Dataset(log, {"clock": "run"})).set_index("check").loc["range depth", "ok"].all()


@pytest.mark.usefixtures("depth")
def test_a_guess_and_the_importer_take_the_depth(tmp_path: Path) -> None:
    as_bridge(si_log()).assign(**{"Water depth [m]": 12.5}).to_csv(tmp_path / "log.csv", index=False)
    proposal = guess(tmp_path / "log.csv").column("depth")
    assert (proposal.source, proposal.unit) == ("Water depth [m]", "m")
    log = pd.read_csv(as_log(turning(T), tmp_path / "plain.csv")).assign(d=1250.0)
    mapping = PLAIN.read_text() + '[columns.depth]\nfrom = "d"\nunit = "cm"\n'
    assert (import_written(mapping, log, tmp_path).frame["depth"] == 12.5).all()


def test_physics_feels_the_depth_and_methods_see_it(depth: Vessel, tmp_path: Path) -> None:
    """Also where a method goes step by step, and in what is exported."""
    log = simulate_truth(Truth(**SHALLOWS, environment={"depth": (3.0, 20.0)}, manoeuvre=[ALIKE]), depth)
    windows = cut_windows(Dataset(log, {"clock": "run"}), horizon=5)
    physics, instants = Physics(depth, horizon=5, step=1.0, integrator="rk4"), windows.instants()
    deep = Instants({name: values for name, values in instants.columns.items() if name != "depth"})
    far, near = (np.abs(physics.paths(one) - windows.future).max() for one in (deep, instants))
    assert near < 0.05 * far
    motion = {name: instants.columns[name] for name in ("u", "v", "r", "psi")}
    stepped = step_alone(physics, Stepper(physics, instants).at(0, motion))
    np.testing.assert_allclose(stepped, step_alone(physics, instants), atol=1e-12)
    assert np.abs(stepped - step_alone(physics, deep)).max() > 1e-3
    assert input_group("depth") == "wind"
    predictor = fit(OneStep(trials=2, units=8), replace(physics, vessel=load_vessel("gunnerus-28.9")), windows)
    assert "depth" in build_model(predictor).layout.now
    assert predictor.limits["depth"] == (log["depth"].min(), log["depth"].max())
    few = instants.select(slice(4))
    expected, given = predictor.predict(few), inputs_of_model(build_model(predictor), few)
    unknown = Instants({name: values for name, values in few.columns.items() if name != "depth"})
    with pytest.raises(DataError, match="depth: the method was trained with this input; the data must hold"):
        predictor.predict(unknown)
    file, *_ = export_predictor(predictor, "casadi", tmp_path / "shallow.casadi")
    for i in range(4):
        path = np.array(ca.Function.load(str(file))(**{key: values[i] for key, values in given.items()})["path"])
        np.testing.assert_allclose(path.T, expected[:, i], atol=1e-9)


@pytest.fixture
def coast_down(monkeypatch: pytest.MonkeyPatch) -> None:
    """The manoeuvre of docs/extending.md."""
    made = module("A manoeuvre", "coast_down_of_the_page", monkeypatch)
    monkeypatch.setitem(manoeuvre.KINDS, "coast_down", made.CoastDown)


def command(*words: object) -> Any:
    """What a command writes with `--json`."""
    result = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert result.exit_code == 0, result.output + repr(result.exception)
    return json.loads(result.output)


def coasting_study(folder: Path, kind: str = "coast_down") -> Plan:
    """A study of simulated runs of one kind."""
    block = {"kind": kind, "n_rpm": [400.0, 700.0]}
    truth = {"vessel": "kvlcc2-l7", "manoeuvres": 8, "duration": 20.0, "step": 0.1, "manoeuvre": [block]}
    known = {"ahead": 5.0, "commands": "known"}
    head = {"question": "How far does she run?", "truth": truth, "split": {"test": 2}, "prediction": known}
    family = [{"name": "exact", "base": "kvlcc2-l7"}]
    return build_plan({**head, "grid": {"N_D": [4]}, "family": family}, folder / "study.toml")


@pytest.mark.usefixtures("coast_down")
def test_the_measures_of_a_log_and_the_command_take_the_manoeuvre(tmp_path: Path) -> None:
    """From a log to its measures; and by the command at the scale of the ship."""
    log, page = tmp_path / "log.parquet", tmp_path / "page.html"
    run = manoeuvre.KINDS["coast_down"].model_validate({"n_rpm": 600, "execute_at": 15, "duration": 300})
    frame = perform_manoeuvres(load_vessel("kvlcc2-l7"), run, step=0.1, interval=0.5)
    frame = frame[[name for name in frame if not name.startswith("actual.")]]
    write_dataset(Dataset(frame, {"clock": "run", "flags": []}), log)
    assert set(frame["propeller.n"].round(9)) == {10.0, 0.0}
    rows = {row["measure"]: row for row in command("data", "measures", log, "--manoeuvre", "coast-down")["measures"]}
    assert rows["execute"]["value"] == 15
    halved = np.interp(15 + rows["half time"]["value"], frame["t"], np.hypot(frame["u"], frame["v"]))
    assert halved == pytest.approx(frame["u"].iloc[0] / 2, rel=1e-3)
    done = command("manoeuvre", "kvlcc2-l7", "coast-down", "--out", page)
    assert done["title"] == "coast down"
    assert [row["measure"] for row in done["measures"]] == list(rows)
    assert re.search(rf"half run: {number_text(done['measures'][2]['value'])}\sm", page.read_text())
    with pytest.raises(ShipidError, match="coast-down takes no angles"):
        define_standard(load_vessel("kvlcc2-l7"), "coast-down", 10)


@pytest.mark.usefixtures("coast_down")
def test_a_study_takes_the_manoeuvre(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = coasting_study(tmp_path)
    assert not orders_may_react(plan)
    assert simulate_truth(plan.study.truth, plan.truth)["propeller.n"].eq(0).all()
    coasting = manoeuvre.KINDS["coast_down"]
    helmed = {"helmsman": lambda _, controls: helm.course_helmsman(controls.commands)}
    monkeypatch.setitem(manoeuvre.KINDS, "coast_on_course", type("CoastOnCourse", (coasting,), helmed))
    assert orders_may_react(coasting_study(tmp_path, "coast_on_course"))
