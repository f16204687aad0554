"""A log played as if at sea: no prediction sees a later row."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset, write_dataset
from shipid.errors import DataError
from shipid.hybrid.alone import Unchanged
from shipid.hybrid.physics import Physics
from shipid.predictor import Predictor
from shipid.study.aboard import play, summary, write
from shipid.vessel.load import load_vessel

STEP = 5.0


def log(seed=0, rows=60):
    rng = np.random.default_rng(seed)
    t = np.arange(rows) * 5.0
    psi = np.cumsum(0.002 * rng.normal(size=rows)) * 5
    frame = pd.DataFrame({"run": "a", "t": t, "flags": 0, "psi": psi})
    frame["u"], frame["v"], frame["r"] = 7.0 + 0.1 * rng.normal(size=rows), 0.0, np.gradient(psi, t)
    frame["north"] = np.cumsum(np.r_[0, 35.0 * np.cos(psi[1:])])
    frame["east"] = np.cumsum(np.r_[0, 35.0 * np.sin(psi[1:])])
    frame["propeller.n"], frame["rudder.delta"] = 1.3, np.repeat(rng.uniform(-0.2, 0.2, rows // 10), 10)
    return frame


@pytest.fixture(scope="module")
def predictor(tmp_path_factory):
    physics = Physics(load_vessel("mariner"), 4, STEP, "rk4")
    file = tmp_path_factory.mktemp("cell") / "cell.npz"
    return Predictor(physics, "alone", Unchanged({}), {"rudder.delta": (-0.1, 0.1)}, {}, "known").save(file)


def saved(frame, folder):
    return write_dataset(Dataset(frame, {"clock": "run"}), folder / "log.parquet") or folder / "log.parquet"


def test_later_rows_change_nothing_that_was_seen(predictor, tmp_path):
    whole = log()
    changed = whole.copy()
    later = changed["t"] > 150
    changed.loc[later, ["u", "rudder.delta"]] = [3.0, 0.3]
    (tmp_path / "b").mkdir()
    first, second = (play(predictor, saved(f, d)).points for f, d in ((whole, tmp_path), (changed, tmp_path / "b")))
    early = first["t"] <= 150
    columns = ["t", "ahead", "north", "east"]
    pd.testing.assert_frame_equal(first.loc[early, columns], second.loc[early, columns])
    assert not first.loc[~early, "north"].equals(second.loc[~early, "north"])


def test_an_officer_sees_path_alarm_and_latency(predictor, tmp_path):
    frame = log()
    played = play(predictor, saved(frame, tmp_path), every=10.0)
    assert len(played.instants) == 30
    expected = frame["rudder.delta"].abs().to_numpy()[::2] > 0.1
    np.testing.assert_array_equal(played.instants["outside"], expected)
    assert (played.instants["latency"] > 0).all()
    last = played.points[played.points["t"] == 290.0]
    assert last["error"].notna().sum() == 1  # the log ends at 295 s
    lines = summary(played)
    assert any("latency" in line for line in lines)
    assert any("orders stay as they are" in line for line in lines)
    assert any("alarm" in line for line in lines)
    write(played, tmp_path / "seen.csv")
    assert {"ahead", "north", "outside", "latency"} <= set(pd.read_csv(tmp_path / "seen.csv").columns)


def test_a_wrong_interval_is_refused(predictor, tmp_path):
    with pytest.raises(DataError, match="--every"):
        play(predictor, saved(log(), tmp_path), every=0.0)
