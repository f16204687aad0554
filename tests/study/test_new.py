"""A study that is written for a vessel and its runs: it parses, it prepares, and its choices follow the data."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shipid.answer.pages import write_pages
from shipid.cli import app
from shipid.data.dataset import Dataset, cumulative_integral, write_dataset
from shipid.errors import DocumentError, ShipidError
from shipid.identification.diagnosis import NONE, Diagnosis
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from shipid.simulation.approach import Controls
from shipid.study.new import (
    LEAST_AMOUNT,
    SHARE_OF_RUN,
    Survey,
    _degraded_families,
    _ordinary_sensors,
    _ordinary_weather,
    _past_of_method,
    _proposed_method,
    _true_path,
    _turning_orders,
    amounts_of_data,
    draft_study,
    horizon_of,
    proposed_horizon,
    separation_of_sources,
    step_of,
    survey_dataset,
    typical_runs,
)
from shipid.study.plan import read_plan
from shipid.study.prepare import obtain_runs, prepare
from shipid.study.run import run_study
from shipid.vessel.load import load_vessel
from shipid.vessel.perturb import Family, draw_members, resolve_families
from shipid.vessel.template import Particulars, first_guess
from tests.logs.conftest import as_dataset, turning
from tests.study.tiny import logged, physics_errors

SHIP = "gunnerus-33.9"


def zigzag(speed: float, period: float, duration: float) -> dict[str, np.ndarray]:
    """Columns of a ship whose yaw rate follows a helm put over from side to side; aft units turn her the other way."""
    t = np.arange(0.0, duration + 0.5)
    side, u, r = np.where(np.sin(2 * np.pi * t / period) >= 0, 1.0, -1.0), np.full(len(t), speed), np.zeros(len(t))
    for row in range(1, len(t)):
        r[row] = r[row - 1] + 0.2 * (0.03 * side[row - 1] - r[row - 1])
    psi = cumulative_integral(t, r)
    track = {"north": cumulative_integral(t, u * np.cos(psi)), "east": cumulative_integral(t, u * np.sin(psi))}
    orders = {f"{unit}.alpha": -0.2 * side for unit in ("port", "starboard")}
    return {"psi": psi, "r": r, "u": u, **track, **orders, "port.n": u / 2, "starboard.n": u / 2}


def trial(count: int = 8, duration: float = 120.0, **changes: Any) -> Dataset:
    """Zigzags at speeds from 4 m/s on, 0.1 m/s apart; `changes` are factors of columns."""
    runs = {f"zz {i}": zigzag(4.0 + 0.1 * i, 40.0 + 2 * i, duration) for i in range(count)}
    scaled = {run: {key: x * changes.get(key, 1.0) for key, x in columns.items()} for run, columns in runs.items()}
    return logged(scaled, np.arange(0.0, duration + 0.5))


def drafted(folder: Path, dataset: Dataset, *vessels: str) -> tuple[Any, dict[str, Any]]:
    """Draft of a study of a dataset and its document, written to the folder."""
    data, out = write_dataset(dataset, folder / "log.parquet"), folder / "study.toml"
    draft = draft_study(vessels or [SHIP], data, out)
    out.write_text(draft.text)
    return draft, tomllib.loads(draft.text)


@pytest.fixture
def undiagnosed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nearly all of the time of a draft is the diagnosis of its vessel."""
    monkeypatch.setattr("shipid.study.new.diagnose", lambda *_: Diagnosis(NONE, sentence="not looked for"))


@pytest.mark.parametrize("total", [2, 3, 8, 22, 1000])
def test_amounts_rise_from_the_least_to_all_runs(total: int) -> None:
    amounts = amounts_of_data(total)
    assert amounts == sorted(set(amounts))
    assert amounts[0] == min(LEAST_AMOUNT, total)
    assert amounts[-1] == total
    assert len(amounts) <= 7


@pytest.mark.parametrize(
    ("length", "speed", "expected"),
    [(33.9, 5.0, 17.0), (28.9, 2.3, 31.0), (7.0, 1.0, 18.0), (320.0, 7.97, 100.0)],  # 2.5 L/U
)
def test_horizon_is_a_few_ship_lengths(length: float, speed: float, expected: float) -> None:
    horizon, why = horizon_of(length, speed, [600.0])
    assert horizon == expected
    assert "L/U" in why


def test_horizon_leaves_most_of_a_short_run() -> None:
    horizon, why = horizon_of(320.0, 8.0, [90.0, 60.0, 120.0])
    assert horizon <= 90.0 * SHARE_OF_RUN
    assert "third of the median run" in why


@pytest.mark.parametrize("horizon", [1.0, 15.0, 60.0, 300.0])
@pytest.mark.parametrize("log_step", [0.05, 0.5, 5.0])
def test_step_is_no_finer_than_the_log_and_leaves_two_if_it_can(horizon: float, log_step: float) -> None:
    """Between rows far apart there is no true path to predict: then two rows are the horizon."""
    step = step_of(horizon, log_step)
    assert log_step <= step <= max(log_step, horizon / 2)


def test_a_study_parses_prepares_and_says_why(tmp_path: Path) -> None:
    """Read from its file it is the very plan that was checked, and each value has a reason from the data."""
    draft, document = drafted(tmp_path, trial())
    plan = read_plan(tmp_path / "study.toml")
    assert plan.document == document
    assert [one.name for one in plan.foundations] == [SHIP, "inaccurate", "none"]
    prepared = prepare(plan, obtain_runs(plan))
    assert len(prepared.pool.spans) == plan.study.grid.N_D[-1] == 7
    assert len(prepared.folds(plan.batches[0], prepared.pool, "runs")) == 7  # every run is left out in its turn
    assert [way.kind for way in plan.methods] == ["stack"]
    assert document["split"]["test"] == ["zz 3"] or document["split"]["test"] == ["zz 4"]
    assert document["prediction"]["ahead"] == 19  # 2.5 x 33.9 m / 4.35 m/s
    assert "zigzag 8" in document["description"]
    first, *others = draft.warnings
    assert first == "R/V Gunnerus, 33.9 m: V_w, beta_w not measured, assumed 0"
    assert all("paths over" in one for one in others)  # curves that no ship sailed disagree with its physics
    reasons = {choice.path for choice in draft.choices if not choice.why}
    assert reasons <= {"question"}


@pytest.mark.parametrize(
    ("sigma", "adds_up", "speed", "path"),
    [
        (0.0, False, 1.0, "position"),
        (0.3, False, 1.0, "velocity"),  # jitter of 0.7 % of the way: the tutorial's log
        (0.02, False, 1.0, "position"),  # RTK: no floor that matters
        (0.5, True, 1.0, "velocity"),  # sqrt(20) x 0.7 m: 4 % of the way
        (0.03, True, 1.0, "position"),  # may be noise of the velocities
        (0.0, False, 1.1, "position"),
        (0.3, False, 1.1, "position"),
    ],
)
def test_positions_that_scatter_are_not_the_true_path(sigma: float, adds_up: bool, speed: float, path: str) -> None:
    """Jitter and scatter that adds up give way to the velocities, a wrong speed does not."""
    dataset, random = trial(u=speed), np.random.default_rng(5)
    noise = random.normal(0, sigma, (2, len(dataset.frame)))
    noise = np.cumsum(noise, axis=1) if adds_up else noise
    columns = {name: dataset.frame[name] + one for name, one in zip(("north", "east"), noise, strict=True)}
    log = Dataset(dataset.frame.assign(**columns), dataset.metadata)
    assert _true_path(log, 20.0, 4.35).value == path


def test_a_log_that_fails_its_checks_is_named_before_the_vessel(tmp_path: Path) -> None:
    """Knots taken for m/s are named with their factor. And 99 kn in one row: physics diverges there."""
    draft, document = drafted(tmp_path, trial(u=3600 / 1852))
    assert document["data"]["path"] == "position"
    assert "sensor u scale = 1.94" in draft.warnings[-1]
    assert "factor = 0.5144" in draft.warnings[-1]
    dataset = trial()
    spoilt = dataset.frame["u"].where(dataset.frame["t"] != dataset.frame["t"].iloc[40], 51.0)
    with pytest.raises(DocumentError, match=r"diverges on .* but first: `shipid data check .*u reaches 51 m/s"):
        drafted(tmp_path, Dataset(dataset.frame.assign(u=spoilt), dataset.metadata))


@pytest.mark.usefixtures("undiagnosed")
def test_windows_over_a_time_without_rows_warn(tmp_path: Path) -> None:
    """A recorder that paused for 15 s, in a log imported without max_gap."""
    dataset = trial()
    t, run = dataset.frame["t"], dataset.frame["run"]
    paused = (run == dataset.runs[0]) & (t > t.iloc[40]) & (t < t.iloc[40] + 15)
    warnings = drafted(tmp_path, Dataset(dataset.frame[~paused].reset_index(drop=True), dataset.metadata))[0].warnings
    assert sum("hold a time without rows, the longest 15 s" in warning for warning in warnings) == 1


@pytest.mark.usefixtures("undiagnosed")
def test_the_test_run_holds_the_past_of_the_method(tmp_path: Path) -> None:
    """Of runs of drawn lengths, some hold the horizon but not the past before it: none of these is set aside."""
    random = np.random.default_rng(0)
    dataset = trial(12, 150.0)
    ends = dict(zip(dataset.runs, random.choice([25.0, 150.0], 12, p=[0.25, 0.75]), strict=True))
    frame = dataset.frame
    begin = frame.groupby("run")["t"].transform("min")
    kept = frame[frame["t"] - begin <= frame["run"].map(ends)].reset_index(drop=True)
    _, document = drafted(tmp_path, Dataset(kept, dataset.metadata))
    assert "memory" in document["method"][0]["kernel"]
    assert all(ends[name] == 150.0 for name in document["split"]["test"])


@pytest.mark.usefixtures("undiagnosed")
def test_runs_shorter_than_the_horizon_are_named(tmp_path: Path) -> None:
    long = trial(6)
    short = long.frame[(long.frame["run"] == "zz 0") & (long.frame["t"] < 10)].assign(run="stub")
    frame = pd.concat([long.frame, short.astype({"run": long.frame["run"].dtype})], ignore_index=True)
    draft, document = drafted(tmp_path, Dataset(frame, long.metadata))
    assert "too short for it: stub" in draft.text.replace("\n# ", " ")
    assert document["grid"]["N_D"][-1] == 5


@pytest.mark.usefixtures("undiagnosed")
def test_commands_that_no_run_varies_are_named_first(tmp_path: Path) -> None:
    """Also before the study computes anything; orders that vary are no word worth."""
    usual = trial(4)
    held = Dataset(usual.frame.assign(**dict.fromkeys(usual.commands, 0.5)), usual.metadata)
    draft, _ = drafted(tmp_path, held)
    assert any("are the same in all 4 runs: what they do cannot be learnt" in warning for warning in draft.warnings)
    assert not any("the same in all" in warning for warning in drafted(tmp_path, usual)[0].warnings)


@pytest.fixture
def template(tmp_path: Path) -> Path:
    """A first guess from main particulars, as `shipid vessel new` writes it, in a folder with a blank in its name."""
    file = tmp_path / "my ship" / "ada.toml"
    file.parent.mkdir()
    file.write_text(first_guess(Particulars(30.0, 8.0, 2.8, 0.55, propulsor="azimuth"), "Ada", str(file)).text)
    return file


@pytest.mark.usefixtures("undiagnosed")
def test_a_template_vessel_is_studied(tmp_path: Path, template: Path) -> None:
    """Named by its path from the study; beside a bundled one, both as they are."""
    _, document = drafted(tmp_path, trial(), str(template), SHIP)
    assert [family["name"] for family in document["family"]] == ["ada", SHIP, "inaccurate"]
    assert document["family"][0]["base"] == "my ship/ada.toml"
    assert document["claims"] == {"accurate": "ada", "inaccurate": "inaccurate"}
    read_plan(tmp_path / "study.toml")


def test_a_vessel_that_is_stiff_in_yaw_takes_smaller_steps(tmp_path: Path) -> None:
    """Her yaw decays in 1/8 s: RK4 at half of the step diverges, at a quarter it does not."""
    ship = load_vessel(SHIP).parameters
    decay = -8.0 * (ship["inertia.I_z"] - ship["added_mass.N_rdot"])
    patch = f'name = "stiff"\nextends = "{SHIP}"\n[hull.derivatives]\nN_r = {decay}\n'
    file = tmp_path / "stiff.toml"
    file.write_text(patch, encoding="utf-8")
    draft, document = drafted(tmp_path, trial(), str(file))
    (found,) = draft.diagnoses.values()
    assert np.isfinite(found.error)
    _, step, _ = proposed_horizon(load_vessel(SHIP), survey_dataset(trial()))
    assert document["prediction"]["step"] == step / 4
    assert "4 times as long diverges" in draft.text


@pytest.mark.parametrize("vessel", ["kvlcc2-l7", "mariner", pytest.param("otter", marks=pytest.mark.slow)])
def test_without_data_the_vessel_is_simulated(tmp_path: Path, vessel: str) -> None:
    out = tmp_path / "study.toml"
    draft = draft_study([vessel], None, out)
    out.write_text(draft.text)
    plan = read_plan(out)
    assert plan.truth is not None
    assert {one.family for one in plan.foundations} == {"nominal", "moderate", "high", "none"}
    truth = plan.study.truth
    assert truth.duration >= plan.study.prediction.horizon * plan.study.prediction.step
    error = physics_errors(prepare(plan, obtain_runs(plan)), "nominal")["mean"]
    assert error > 1.2 * truth.sensors["north"].noise  # mean distance of a fix: sqrt(pi / 2) standard deviations
    assert max(plan.study.grid.N_D) == truth.manoeuvres - plan.study.split.test  # type: ignore[operator]


@pytest.mark.parametrize("name", ["otter", "kvlcc2-l7", "gunnerus-33.9"])
def test_every_coefficient_of_the_hull_is_degraded_families(name: str) -> None:
    """Also the drag of a cross-flow and the resistance: with linear damping alone a model is nearly the ship."""
    vessel = load_vessel(name)
    family = resolve_families([Family(**one) for one in _degraded_families(name, vessel)])[1]
    changed = draw_members(family, vessel)[0].values
    geometry = ("x_aft", "x_fwd", "T", "rho")
    assert set(changed) == {p for p in vessel.parameters if p.startswith("hull.") and not p.endswith(geometry)}


@pytest.mark.parametrize(
    ("length", "wind"),
    [(300.0, 6.0), (28.9, 6.0), (4.0, 2.2)],  # 6 sqrt(L / 28.9)
)
def test_wind_is_that_of_a_small_ship_by_froudes_rule(length: float, wind: float) -> None:
    given = {one.path: one.value for one in _ordinary_weather(load_vessel(SHIP), length, 5.0)}
    assert given["truth.wind_speed"] == [0.0, wind]
    assert given["truth.gusts.kind"] == "npd"
    assert "truth.gusts.kind" not in {one.path for one in _ordinary_weather(load_vessel("mariner"), length, 5.0)}


def test_the_past_is_a_time_of_the_ship_at_any_speed() -> None:
    """A slow model tanker, L / U = 16 s, had no memory: 11.6 sqrt(L / g) are 6 s. Short runs give a shorter past."""
    random = np.random.default_rng(3)
    for passing in [16.0, *random.uniform(0.5, 500.0, 20)]:
        method = _proposed_method(passing, passing / 12, 1e6)
        assert _past_of_method(method) / passing == pytest.approx(1.5, rel=0.05)  # whole steps
        short = random.uniform(3.0, 4.0) * passing
        past = _past_of_method(_proposed_method(passing, passing / 12, short))
        assert 0.95 * passing <= past <= 1.07 * short / 3
    for passing, step, spare in [(16.0, 4.0, 1e6), (16.0, 1.0, 20.0), (0.0, 1.0, 1e6), (16.0, 1.0, -5.0)]:
        assert "memory" not in _proposed_method(passing, step, spare).value[0]


def test_sensors_are_those_of_the_ship_at_any_scale() -> None:
    """A model at Froude's scale has the noise of its ship in its own lengths and times, but a ship has one fix."""
    random = np.random.default_rng(11)
    for length, scale in zip(random.uniform(1, 100, 20), random.uniform(0.01, 1, 20), strict=True):
        ship, model = (
            {one.path.split(".")[2]: one.value for one in _ordinary_sensors(length * k, 7.0 * k**0.5)}
            for k in (1.0, scale)
        )
        units = {"north": scale, "east": scale, "psi": 1.0, "u": scale**0.5, "v": scale**0.5, "r": scale**-0.5}
        assert all(model[name] == pytest.approx(ship[name] * units[name], rel=0.1) for name in units)  # two digits
        assert all(one.why and " 0 %" not in one.why for one in _ordinary_sensors(length, 7.0))
    assert _ordinary_sensors(400.0, 8.0)[0].value == 0.5


def test_a_ship_without_helm_gets_an_order_for_each_screw() -> None:
    for name, helm in (("otter", False), ("kvlcc2-l7", True)):
        order = _turning_orders(Controls(load_vessel(name)), 1.5, 300.0).value[0]
        keys = {"n_rpm", "delta_deg"} if helm else {"port.n_rpm", "starboard.n_rpm"}
        assert keys == set(order) - {"kind", "start_speed"}
        assert all(high in (300.0, 35.0) for _, high in (order[key] for key in keys))


def test_what_does_not_drive_a_ship_ahead_rests() -> None:
    """A tunnel thruster at the speed of the main shaft drove her to starboard in every run."""
    ship = first_guess(Particulars(100.0, 16.0, 6.0, 0.7, 7.0, tunnel_thruster=True), "b", "b.toml").vessel
    choice = _turning_orders(Controls(ship), 7.0, 130.0)
    assert choice.value[0]["bow.n_rpm"] == 0
    assert choice.value[0]["n_rpm"] == [65, 130]
    assert _turning_orders(Controls(load_vessel("supply-vessel")), 1.0, 100.0).value[0]["bow_aft.n_rpm"] == 0


def test_a_service_speed_that_no_shaft_gives_is_a_fault_of_the_vessel(tmp_path: Path) -> None:
    """The command has no option for a speed."""
    lame = tmp_path / "lame.toml"
    stops = 'actuator.n.kind = "rate_limit"\nactuator.n.rate = 1.0\nactuator.n.high = 0.5\n'
    lame.write_text(f'extends = "gunnerus-28.9"\nname = "lame"\n[thruster.port]\n{stops}[thruster.starboard]\n{stops}')
    with pytest.raises(DocumentError, match=r"lame.toml: particulars.U_0: no shaft speed or force drives"):
        draft_study([str(lame)], None, tmp_path / "study.toml")


def test_units_at_both_ends_are_ordered_apart() -> None:
    """With one angle for both a double-ended ferry goes aside and does not turn."""
    aft = load_vessel("gunnerus-28.9")
    x, y = ("thruster.starboard.x", "thruster.starboard.y")
    both = aft.with_values({x: -aft.parameters[x], y: 0.0, "thruster.port.y": 0.0})
    order = _turning_orders(Controls(both), 5.0, 140.0).value[0]
    assert order["port.alpha_deg"] == order["starboard.alpha_deg"] == [-35, 35]
    assert "alpha_deg" in _turning_orders(Controls(aft), 5.0, 140.0).value[0]
    rudder = {"kind": "rudder_derivatives", "N_delta": 0.002, "L_pp": 28.9, "U_0": 5.0}
    order = _turning_orders(Controls(aft.with_values({"thruster.rudder": rudder})), 5.0, 140.0)
    assert {"alpha_deg", "delta_deg"} <= order.value[0].keys()  # of other signs, but each by itself


@pytest.mark.parametrize(
    ("vessels", "runs", "message"),
    [
        (["kvlcc2-l7"], 5, "propeller.n: KVLCC2 tanker, 7 m model (MMG) needs this command; the data have"),
        ([SHIP], 2, "2 runs of 21 s or more, a study needs 3"),
        ([SHIP], 1, "1 run of 21 s or more, a study needs 3"),
        (["gunnerus"], 5, "no vessel of this name comes with shipid"),
        (["./no.toml"], 5, "no such file"),
    ],
)
def test_what_cannot_be_studied_is_one_line(tmp_path: Path, vessels: list[str], runs: int, message: str) -> None:
    data = write_dataset(trial(runs), tmp_path / "log.parquet")
    with pytest.raises(ShipidError) as error:
        draft_study(vessels, data, tmp_path / "study.toml")
    assert message in str(error.value)


def test_one_vessel_makes_a_truth(tmp_path: Path) -> None:
    with pytest.raises(ShipidError, match="one vessel makes the truth"):
        draft_study([SHIP, "mariner"], None, tmp_path / "study.toml")


@pytest.mark.usefixtures("undiagnosed")
def test_the_command_writes_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_dataset(trial(), Path("log.parquet"))
    command = ["study", "new", "--vessel", SHIP, "--data", "log.parquet"]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    assert "shipid study run log-study.toml" in result.output
    lines = result.output.splitlines()
    assert len(lines) < 40
    assert any(re.match(r"prediction\.ahead = \S+  # \w", line) for line in lines), result.output  # piped: a line each
    assert all(line == line.rstrip() for line in lines)
    before = Path("log-study.toml").read_text()
    again = CliRunner().invoke(app, command)
    assert isinstance(again.exception, ShipidError)
    assert "not written over" in str(again.exception)
    assert Path("log-study.toml").read_text() == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mapping", "log", "vessel", "path", "ahead", "tests"),
    [
        ("gunnerus-2022", "gunnerus_2022/RVG_ManeuveringTests.csv", "gunnerus-28.9", "velocity", 15, ["ZZ", "TC"]),
        ("kvlcc2-hsva", "kvlcc2_hsva", "kvlcc2-l7", "position", 17, ["15_05"]),
    ],
)
def test_recorded_sets(
    tmp_path: Path, shared_data: Path, mapping: str, log: str, vessel: str, path: str, ahead: float, tests: list[str]
) -> None:
    """Public trials: GPS of some metres gives way, a towing carriage does not; the paper looks 15 s ahead."""
    dataset = import_log(read_mapping(mapping), shared_data / log)
    _, document = drafted(tmp_path, dataset, vessel)
    assert document["data"]["path"] == path
    assert document["prediction"]["ahead"] == ahead
    tested = document["split"]["test"]
    assert [start for start in tests if any(name.startswith(start) for name in tested)] == tests  # and other kinds
    runs = survey_dataset(dataset).runs["duration"]
    assert all(runs[name] < runs.max() for name in document["split"]["test"])


@pytest.mark.slow
def test_a_log_without_commands_is_studied_without_physics(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the command line, as it is drafted: data alone, a regression and constant u, v, r; a vessel needs orders."""
    monkeypatch.chdir(tmp_path)
    dataset = trial(8, duration=200.0)
    orders = [name for name in dataset.frame if "." in str(name)]
    write_dataset(Dataset(dataset.frame.drop(columns=orders), dataset.metadata), Path("ais.parquet"))
    refused = CliRunner().invoke(app, ["study", "new", "--data", "ais.parquet", "--vessel", SHIP])
    assert "the data have no commands: `shipid study new` without --vessel needs none" in str(refused.exception)
    written = CliRunner().invoke(app, ["study", "new", "--data", "ais.parquet"])
    assert written.exit_code == 0, written.output
    assert "30 rows of the log: no vessel gives a length" in " ".join(written.output.split())
    plan = read_plan("ais-study.toml", {"grid.N_D": [2], "method.0.kernel.trials": 4})
    assert [one.name for one in plan.foundations] == ["none"]
    folder = tmp_path / "results"
    for _ in run_study(plan, folder, workers=1):
        pass
    write_pages(folder)
    answer = (folder / "answer.txt").read_text()
    assert re.search(
        r"^30 s ahead, [a-z ]+ \(best in validation\) with 2 runs errs by [\d.]+ m on average, nine in ten", answer
    )
    assert "regression on accelerations of 2 runs" in answer
    assert "constant u, v, r" in answer


def test_without_a_vessel_short_runs_set_the_horizon_and_say_so() -> None:
    """A third of the median run is below 30 rows."""
    ahead, _, why = proposed_horizon(None, survey_dataset(trial(2, duration=60.0)))
    assert (ahead, why[:25]) == (pytest.approx(20.0), "a third of the median run")


def test_neither_a_vessel_nor_runs_is_refused() -> None:
    refused = CliRunner().invoke(app, ["study", "new"])
    assert "--vessel: missing: give a vessel, or recorded runs as --data, or both" in str(refused.exception)


T = np.arange(0.0, 100.0, 0.5)


def test_a_steady_turn_is_described_by_its_numbers() -> None:
    summary = survey_dataset(as_dataset(turning(T), turning(T[:81])))
    assert list(summary.runs.index) == ["a", "b"]
    assert summary.runs["duration"].tolist() == [99.5, 40.0]
    assert summary.step == 0.5
    assert summary.speed == pytest.approx(np.hypot(4.0, 0.5))
    np.testing.assert_allclose(summary.runs["rate"], 0.05)
    assert summary.runs["whole"].all()


def test_a_broken_run_is_judged_by_its_longest_piece() -> None:
    frame = turning(T)
    frame["flags"] = np.where(T == 30.0, 1, 0)
    summary = survey_dataset(as_dataset(frame)).runs.loc["a"]
    assert not summary["whole"]
    assert summary["duration"] == 99.5 - 30.0


def test_jitter_does_not_grow_with_the_lag_and_a_wrong_speed_does() -> None:
    rng, frame = np.random.default_rng(2), turning(T)
    jitter = as_dataset(frame.assign(north=frame["north"] + rng.normal(0, 2.0, len(T))))
    wrong = as_dataset(frame.assign(u=1.1 * frame["u"]))
    assert separation_of_sources(jitter, 20.0) == pytest.approx(separation_of_sources(jitter, 5.0), rel=0.3)
    assert separation_of_sources(wrong, 20.0) > 3 * separation_of_sources(wrong, 5.0)
    assert separation_of_sources(wrong, 1000.0) == 0.0


def surveyed(kinds: list[str], speeds: list[float], failed: str = "") -> Survey:
    numbers = {"kind": kinds, "speed": speeds, "rate": 0.05, "helm": 0.2, "whole": True, "duration": 60.0}
    runs = pd.DataFrame(numbers, index=list("abcdefgh"[: len(kinds)]))
    runs.loc["a", "duration"] = 90.0
    return Survey(runs, 1.0, pd.DataFrame({"run": list(failed)}))


def test_the_typical_run_is_the_middle_one_and_neither_broken_nor_faulty() -> None:
    one = surveyed(["zigzag"] * 5, [5.0, 3.0, 3.9, 4.0, 4.1])
    assert typical_runs(one) == ["d"]
    one.runs.loc["d", "whole"] = False
    assert typical_runs(one)[0] in ("c", "e")
    assert typical_runs(surveyed(["zigzag"] * 5, [5.0, 3.0, 3.9, 4.0, 4.1], "ed")) == ["c"]


def test_each_kind_gives_a_typical_run_where_more_than_six_runs_are_there() -> None:
    for count, chosen in ((6, 1), (8, 2)):
        assert len(typical_runs(surveyed(["zigzag", "turning"] * (count // 2), [3.0] * count))) == chosen
