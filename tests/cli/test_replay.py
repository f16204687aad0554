"""`shipid replay`: a run on the vessel that made it comes back; another vessel errs; mistakes are one line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.data.dataset import Dataset, read_dataset, write_dataset
from shipid.errors import ShipidError
from shipid.report import replay
from shipid.simulation.manoeuvre import Zigzag
from shipid.simulation.perform import perform
from shipid.vessel.load import load_vessel

SHIP = "kvlcc2-l7"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    kinds = [Zigzag(name=f"zz {angle}", n_rpm=627, angle_deg=angle, duration=40, execute_at=5) for angle in (10, 20)]
    frame = perform(load_vessel(SHIP), kinds, step=0.1)
    frame = frame[[name for name in frame if not str(name).startswith("actual.")]].astype({"run": "str"})
    file = tmp_path_factory.mktemp("replay") / "log.parquet"
    return write_dataset(Dataset(frame, {"clock": "run", "flags": []}), file)


def test_the_vessel_that_made_a_run_repeats_it(log: Path, tmp_path: Path) -> None:
    csv, page = tmp_path / "both.csv", tmp_path / "page.html"
    words = ["replay", SHIP, str(log), "--run", "zz 1*", "--out", str(page), "--csv", str(csv)]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    both = pd.read_csv(csv)
    assert set(both["run"]) == {"zz 10"}
    measured, replayed = (both[both["model"] == name] for name in ("measured", "replayed"))
    for name, tolerance in (("north", 0.3), ("east", 0.3), ("psi", 0.02), ("u", 0.01)):
        assert measured[name].to_numpy() == pytest.approx(replayed[name].to_numpy(), abs=tolerance), name
    shown = re.search(r"^ *zz 10 +(\S+) +(\S+) +(\S+) +(\S+) *$", result.output, re.MULTILINE)
    assert shown is not None, result.output
    off = {name: measured[name].to_numpy() - replayed[name].to_numpy() for name in ("u", "v", "r", "north", "east")}
    rms = {name: float(np.sqrt(np.mean(values**2))) for name, values in off.items()}
    expected = [rms["u"], rms["v"], np.degrees(rms["r"]), np.hypot(rms["north"], rms["east"])]
    assert [float(value) for value in shown.groups()] == pytest.approx(expected, rel=0.01)
    assert "zz 10" in page.read_text()
    assert "Recorded and replayed" in page.read_text()


def test_weather_that_is_not_in_the_log_is_named(log: Path, tmp_path: Path) -> None:
    ship = tmp_path / "ship.toml"
    ship.write_text(f'extends = "{SHIP}"\nname = "in a stream"\n[current]\nkind = "uniform"\n')
    words = ["replay", str(ship), str(log), "--out", str(tmp_path / "page.html")]
    result = CliRunner().invoke(app, words)
    assert "not in the log, taken as 0: V_c, beta_c" in result.output
    assert "V_c, beta_c taken as 0" in (tmp_path / "page.html").read_text()
    assert json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)["assumed"] == ["V_c", "beta_c"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--run", "zz 30"], "is no run"),
        (["--out", "page.txt"], "a page is an HTML file"),
        (["--step", "-1"], "must be positive"),
        (["--step", "inf"], "must be a finite number"),
        (["--step", "nan"], "must be a finite number"),
        (["--step", "1e-7"], "steps of these runs, at most 1e+07: give a longer step"),
        (["--step", "30", "--ahead", "20"], "must hold two steps of 30 s"),
        (["--csv", "both.doc"], "csv"),
    ],
)
def test_a_mistake_is_one_line(log: Path, words: list[str], message: str) -> None:
    result = CliRunner().invoke(app, ["replay", SHIP, str(log), *words])
    assert isinstance(result.exception, ShipidError)
    assert message in str(result.exception)
    assert "\n" not in str(result.exception)


def test_the_page_draws_runs_in_the_units_of_its_axes() -> None:
    """Two pieces of a run that turns by 2 deg/s and moves north: a gap between them, time from the start of the run."""
    t = np.arange(100.0, 110.0)
    one = pd.DataFrame({"run": "zz", "piece": np.arange(10) // 5, "t": t, "model": "measured", "u": 5.0, "v": 0.1})
    one = one.assign(r=np.radians(2.0), north=3.0 * t, east=7.0)
    series = pd.concat([one, one.assign(model="replayed", north=3.0 * t + 1.0)])
    names = ["run", "u", "v", "r", "position"]
    errors = pd.DataFrame([("all", 0.1, 0.2, np.radians(4.0), 9.0)], columns=names)
    content = replay.ReplayContent(
        title="", name="", series=series, errors=errors, ahead=5.0, provenance={}, command=""
    )
    panels = replay.replayed_motion(content).draw(series["run"].iloc[0])
    *over_time, (track, _) = (list(panel.data) for panel in panels)
    for (measured, _), value in zip(over_time, (5.0, 0.1, 2.0), strict=True):
        y = np.asarray(measured["y"], dtype=float)
        assert y[np.isfinite(y)] == pytest.approx(value)
        assert np.flatnonzero(np.isnan(y)).tolist() == [5, 11]
        assert measured["x"][0] == 0.0
    north = np.asarray(track["y"], dtype=float)
    assert np.ptp(north[np.isfinite(north)]) == pytest.approx(27.0)
    assert {float(x) for x in track["x"] if np.isfinite(x)} == {7.0}
    table = replay.replay_errors(content)
    assert table.columns[3] == "r [deg/s]"
    assert [float(cell.text) for cell in table.rows[0][1:]] == pytest.approx([0.1, 0.2, 4.0, 9.0])


def test_commands_that_come_late_are_said_and_may_change_between_the_rows(tmp_path: Path) -> None:
    """Gunnerus, rows of 1 s, orders between them."""
    kinds = [Zigzag(n_rpm=145, angle_deg=angle, duration=100, execute_at=20.43) for angle in (10, 20)]
    frame = perform(load_vessel("gunnerus-28.9"), kinds, step=0.05, interval=0.1)
    frame = frame.groupby("run", sort=False).nth(slice(3, None, 10)).reset_index(drop=True)
    write_dataset(Dataset(frame.astype({"run": "str"}), {"clock": "run", "flags": []}), tmp_path / "log.parquet")
    errors = {}
    for commands in ("held", "between"):
        words = [
            "replay",
            "gunnerus-28.9",
            str(tmp_path / "log.parquet"),
            "--out",
            str(tmp_path / "page.html"),
            "--json",
        ]
        result = CliRunner().invoke(app, [*words, "--commands", commands])
        assert result.exit_code == 0, result.output
        said = json.loads(result.stdout)
        errors[commands] = said["errors"][0]["r"]
        late = "rows are 1 s apart and commands count from their row, 0.5 s late on average"
        assert said["late"] == (late if commands == "held" else None)
    assert errors["between"] < 0.6 * errors["held"]


def test_a_run_of_one_row_is_left_out_and_times_without_rows_are_named(log: Path, tmp_path: Path) -> None:
    whole = read_dataset(log)
    frame, first = whole.frame, whole.runs[0]
    gap = frame[(frame["run"] != first) | (frame["t"] < 20) | (frame["t"] > 25)]
    one = frame[frame["run"] == whole.runs[1]].iloc[:1].assign(run="single")
    file = write_dataset(Dataset(pd.concat([gap, one], ignore_index=True), whole.metadata), tmp_path / "some.parquet")
    result = CliRunner().invoke(app, ["replay", SHIP, str(file), "--out", str(tmp_path / "page.html")])
    assert result.exit_code == 0, result.output
    assert "too short, left out: single" in result.output
    assert (
        f"1 time without rows, the longest 5.2 s after t = 19.9 s of {first!r}: orders are held there" in result.output
    )
    alone = write_dataset(Dataset(one, whole.metadata), tmp_path / "one.parquet")
    refused = CliRunner().invoke(app, ["replay", SHIP, str(alone)])
    assert isinstance(refused.exception, ShipidError)
    assert "'single' has no unbroken stretch" in str(refused.exception)
