"""`shipid replay`: a run on the vessel that made it comes back; another vessel errs; mistakes are one line."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.data.dataset import Dataset, write_dataset
from shipid.errors import ShipidError
from shipid.report import motion as replay
from shipid.simulation.manoeuvre import Zigzag
from shipid.simulation.perform import perform_manoeuvres
from shipid.vessel.load import load_vessel
from tests.cli.running import output_of

SHIP = "kvlcc2-l7"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    kinds = [Zigzag(name=f"zz {angle}", n_rpm=627, angle_deg=angle, duration=40, execute_at=5) for angle in (10, 20)]
    frame = perform_manoeuvres(load_vessel(SHIP), kinds, step=0.1)
    frame = frame[[name for name in frame if not str(name).startswith("actual.")]].astype({"run": "str"})
    file = tmp_path_factory.mktemp("replay") / "log.parquet"
    return write_dataset(Dataset(frame, {"clock": "run", "flags": []}), file)


def test_the_vessel_that_made_a_run_repeats_it(log: Path, tmp_path: Path) -> None:
    csv, page = tmp_path / "both.csv", tmp_path / "page.html"
    said = output_of("replay", SHIP, log, "--run", "zz 1*", "--out", page, "--csv", csv)
    both = pd.read_csv(csv)
    assert set(both["run"]) == {"zz 10"}
    measured, replayed = (both[both["model"] == name] for name in ("measured", "replayed"))
    for name, tolerance in (("north", 0.3), ("east", 0.3), ("psi", 0.02), ("u", 0.01)):
        assert measured[name].to_numpy() == pytest.approx(replayed[name].to_numpy(), abs=tolerance), name
    shown = re.search(r"^ *zz 10 +(\S+) +(\S+) +(\S+) +(\S+) *$", said, re.MULTILINE)
    assert shown is not None, said
    off = {name: measured[name].to_numpy() - replayed[name].to_numpy() for name in ("u", "v", "r", "north", "east")}
    rms = {name: float(np.sqrt(np.mean(values**2))) for name, values in off.items()}
    expected = [rms["u"], rms["v"], np.degrees(rms["r"]), np.hypot(rms["north"], rms["east"])]
    assert [float(value) for value in shown.groups()] == pytest.approx(expected, rel=0.01)
    assert "zz 10" in page.read_text()
    assert "Recorded and replayed" in page.read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--run", "zz 30"], "is no run"),
        (["--out", "page.txt"], "let the name end in .html"),
        (["--step", "1e-7"], "steps of these runs, at most 1e+07: give a longer step"),
        (["--step", "30", "--ahead", "20"], "must hold two steps of 30 s"),
        (["--csv", "both.doc"], "csv"),
    ],
)
def test_a_mistake_is_one_line(log: Path, words: list[str], message: str) -> None:
    result = CliRunner().invoke(app, ["replay", SHIP, str(log), *words])
    assert isinstance(result.exception, ShipidError)
    assert message in str(result.exception)


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
    *over_time, (track, _) = (list(panel["data"]) for panel in panels)
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
