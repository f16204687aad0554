"""A log played as if at sea: no prediction sees a later row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset, read_dataset, stretches_of_runs, write_dataset
from shipid.data.windows import cut_windows
from shipid.errors import DataError
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.features import Memory
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.physics import Physics
from shipid.observer import Observer
from shipid.predictor import Predictor, fit
from shipid.study.aboard import Replay, play_aboard, replay_summary, write_replay_points
from shipid.study.apply import table_of_stretch
from shipid.units import length_text, percent_text
from shipid.vessel.load import load_vessel
from tests.export.strange import bands_of, drawn

STEP = 5.0


def summary(played: Replay) -> list[str]:
    return [line.text for line in replay_summary(played)]


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
def banded(tmp_path_factory):
    """Physics alone whose band ten runs calibrated, as if they were like the logs of this file."""
    physics = Physics(load_vessel("mariner"), 4, STEP, "rk4")
    rng = np.random.default_rng(0)
    instants = drawn("alone", 6, vessel="mariner").instants
    names = ("u", "r", "rudder.delta")
    bands = bands_of(rng, physics, instants, names, 1.0)
    bands = replace(bands, runs=10, kinds={"zigzag": 4}, by_kind=2 * bands.whole[None], far=100.0, slopes=np.zeros(5))
    half = np.outer(np.arange(1, 5), [50.0, 30.0])
    fitted = Predictor(
        physics, "alone", UnchangedPath({}), {"rudder.delta": (-0.1, 0.1)},
        bands=replace(bands, along=half[:, 0], across=half[:, 1], scales=half[None]),
    )  # fmt: skip
    return fitted, fitted.save(tmp_path_factory.mktemp("cell") / "banded.npz")


@pytest.fixture(scope="module")
def predictor(tmp_path_factory):
    physics = Physics(load_vessel("mariner"), 4, STEP, "rk4")
    file = tmp_path_factory.mktemp("cell") / "cell.npz"
    return Predictor(physics, "alone", UnchangedPath({}), {"rudder.delta": (-0.1, 0.1)}, {}, "known").save(file)


def saved(frame, folder):
    return write_dataset(Dataset(frame, {"clock": "run"}), folder / "log.parquet") or folder / "log.parquet"


def test_later_rows_change_nothing_that_was_seen(predictor, tmp_path):
    whole = log()
    changed = whole.copy()
    later = changed["t"] > 150
    changed.loc[later, ["u", "rudder.delta"]] = [3.0, 0.3]
    (tmp_path / "b").mkdir()
    first, second = (
        play_aboard(predictor, saved(f, d)).points for f, d in ((whole, tmp_path), (changed, tmp_path / "b"))
    )
    early = first["t"] <= 150
    columns = ["t", "ahead", "north", "east"]
    pd.testing.assert_frame_equal(first.loc[early, columns], second.loc[early, columns])
    assert not first.loc[~early, "north"].equals(second.loc[~early, "north"])


def test_the_alarm_stands_until_the_observer_has_run_as_long_as_in_training(predictor, tmp_path):
    """Each unbroken stretch begins anew, aboard and in a table of predictions alike; it is in the file of the cell."""
    frame, run_up = log(), 5.0
    frame.loc[30:, "t"] += 100.0  # a hole
    names = ["break"]
    frame["flags"] = (np.arange(len(frame)) == 30).astype(np.int64)
    dataset = write_dataset(Dataset(frame, {"clock": "run", "flags": names}), tmp_path / "log.parquet")
    whole = replace(Predictor.load(predictor), limits={"u": (0.0, 9.0)}, run_up=run_up)
    whole = replace(whole, physics=replace(whole.physics, observer=Observer(waves=(0.0,), change=(1.0,))))
    cell = whole.save(tmp_path / "cell.npz")
    since = 5.0 * (np.arange(len(frame)) % 30)
    played = play_aboard(cell, dataset, every=5.0)
    np.testing.assert_array_equal(played.instants["outside"], since[: len(played.instants)] < run_up)
    known = read_dataset(dataset)
    tables = [table_of_stretch(Predictor.load(cell), known, run, rows) for run, rows in stretches_of_runs(known)]
    table = pd.concat(tables).groupby("t")["outside"].first()
    np.testing.assert_array_equal(table, pd.Series(since < run_up, index=frame["t"].to_numpy())[table.index])


def test_an_officer_sees_path_alarm_and_latency(predictor, tmp_path):
    frame = log()
    played = play_aboard(predictor, saved(frame, tmp_path), every=10.0)
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
    kinds = {line.text.partition(":")[0]: line.kind for line in replay_summary(played)}
    assert next(iter(kinds.values())) == "predictions"
    assert (kinds["alarm"], kinds["the plan was"], kinds["latency"]) == ("alarm", "limit", "detail")
    write_replay_points(played, tmp_path / "seen.csv")
    assert {"ahead", "north", "outside", "latency"} <= set(pd.read_csv(tmp_path / "seen.csv").columns)


def test_the_band_is_that_of_the_predictor_and_its_promise_is_counted(banded, tmp_path):
    _, file = banded
    frame = log()
    played = play_aboard(file, saved(frame, tmp_path), level=0.9)
    assert (played.instants["factor"] == 1).all()
    instants, points = played.instants, played.points
    turned = np.hypot(points["north"], points["east"]).notna()
    assert turned.all()
    held = []
    for i in range(len(instants)):
        t = instants["t"][i]
        path = points[points["t"] == t]
        course = path["band_course"].to_numpy()
        true = frame[frame["t"].isin(path["t"] + path["ahead"])]
        if len(true) < 4:
            assert np.isnan(instants["reach"][i])
            continue
        off = true[["north", "east"]].to_numpy() - path[["north", "east"]].to_numpy()
        along = off[:, 0] * np.cos(course) + off[:, 1] * np.sin(course)
        across = off[:, 1] * np.cos(course) - off[:, 0] * np.sin(course)
        reach = np.hypot(along / path["band_along"], across / path["band_across"]).max()
        assert instants["reach"][i] == pytest.approx(reach, rel=1e-9)
        held.append(reach <= 1)
    (line,) = (line for line in summary(played) if line.startswith("band of 90 %"))
    assert [one.text for one in replay_summary(played) if one.kind == "band"] == [line]
    assert f"held {percent_text(np.mean(held))} of the {len(held)} whole paths" in line
    write_replay_points(played, tmp_path / "seen.csv")
    assert {"band_along", "band_across", "band_course", "band_factor"} <= set(
        pd.read_csv(tmp_path / "seen.csv").columns
    )


def test_a_band_made_for_known_orders_is_empty_where_they_are_held(banded, tmp_path):
    """Neither the table, nor the page, nor the summary has a half axis; what is no band is as without one."""
    file = replace(banded[0], commands="known").save(tmp_path / "cell.npz")
    played, plain = (play_aboard(file, saved(log(), tmp_path), level=level) for level in (0.9, None))
    pd.testing.assert_frame_equal(played.points[plain.points.columns], plain.points)
    write_replay_points(played, tmp_path / "seen.csv")
    written = pd.read_csv(tmp_path / "seen.csv")
    assert written[["band_along", "band_across", "band_course"]].isna().all(axis=None)
    (line,) = (line.text for line in replay_summary(played) if line.kind == "band")
    assert line.startswith("no band of 90 %: later orders were known in calibration")
    assert summary(played)[-1].split()[-2:] == ["-", "-"]


def test_runs_that_trained_and_physics_that_diverges_are_said(banded, tmp_path):
    """A mariner with steps of 60 s; its runs by name."""
    frame = log()
    fast = replace(banded[0], physics=Physics(load_vessel("mariner"), 4, 60.0), bands=None)
    for runs, said in ((["a", "b"], True), (["b"], False)):
        file = replace(fast, provenance={"runs": runs}).save(tmp_path / "cell.npz")
        played = play_aboard(file, saved(frame.assign(**{"rudder.delta": 0.5}), tmp_path))
        text = " ".join(played.limits)
        assert ("1 of 1 run named like runs that trained" in text) == said
        assert f"diverges on {percent_text(played.instants['diverged'].mean(), 1)}" in text
        legs = played.points.assign(way=np.hypot(played.points["north"], played.points["east"]))
        assert np.isfinite(legs["way"]).all()
    played = play_aboard(banded[1], saved(frame, tmp_path))
    assert not played.limits
    assert "band" not in " ".join(line.text for line in replay_summary(played))


def test_a_log_without_an_input_of_the_training_is_one_line_with_its_file(tmp_path):
    file = drawn("kernel", 6, vessel="gunnerus-28.9").predictor.save(tmp_path / "cell.npz")
    rows = log().rename(columns={"propeller.n": "port.n", "rudder.delta": "port.alpha"})
    rows = rows.assign(**{"starboard.n": rows["port.n"], "starboard.alpha": rows["port.alpha"], "t": np.arange(60.0)})
    with pytest.raises(DataError, match=r"log.parquet: phi: the compensator needs this column"):
        play_aboard(file, saved(rows, tmp_path))


def test_a_heading_in_degrees_is_one_line(banded, tmp_path):
    """By drawn logs; in radians it may turn many times, wrapped or not."""
    for seed in range(3):
        frame = log(seed)
        turned = frame.assign(r=0.2, psi=0.2 * frame["t"])
        wrapped = turned.assign(psi=np.mod(turned["psi"], 2 * np.pi))
        for good in (frame, turned, wrapped):
            play_aboard(banded[1], saved(good, tmp_path), every=200.0)
        for bad in (
            turned.assign(psi=np.degrees(turned["psi"])),
            wrapped.assign(psi=np.degrees(wrapped["psi"]), r=0.0),
        ):
            with pytest.raises(DataError, match=r"psi: changes by \d+ rad in run 'a', .* are these degrees\?"):
                play_aboard(banded[1], saved(bad, tmp_path))


def test_a_summary_says_when_bands_hold_less_than_promised_by_more_than_chance(banded, tmp_path):
    """Eight runs like those of training; then of a ship that is far faster than her log says."""
    fitted, _ = banded
    file = replace(fitted, limits={"u": (0.0, 9.0)}, commands="held").save(tmp_path / "cell.npz")
    said = []
    for share in (1.0, 10.0):
        parts = [log(seed, 20).assign(run=f"r{seed}") for seed in range(8)]
        for part in parts:
            part[["north", "east"]] *= share
        played = play_aboard(file, saved(pd.concat(parts, ignore_index=True), tmp_path), level=0.8)
        said.append(any("by more than chance" in line for line in summary(played)))
    assert said == [False, True]


def test_a_kind_of_run_that_calibrated_no_band_is_all_alarm(banded, tmp_path):
    _, file = banded
    for kind, alarm in (("zigzag", False), ("spiral", True)):
        known = {"clock": "run", "manoeuvres": {"a": kind}}
        write_dataset(Dataset(log(), known), tmp_path / f"{kind}.parquet")
        assert play_aboard(file, tmp_path / f"{kind}.parquet", every=50.0).instants["outside"].all() == alarm


def test_a_band_adapts_to_the_past_alone(banded, tmp_path):
    _, file = banded
    whole = log()
    changed = whole.copy()
    later = changed["t"] > 150
    changed.loc[later, "north"] += 5000.0
    (tmp_path / "b").mkdir()
    first, second = (
        play_aboard(file, saved(f, d), level=0.5, rate=0.3) for f, d in ((whole, tmp_path), (changed, tmp_path / "b"))
    )
    early = first.instants["t"] <= 150
    pd.testing.assert_series_equal(first.instants["factor"][early], second.instants["factor"][early])
    wider = second.instants["factor"][~early] - first.instants["factor"][~early]
    assert wider.iloc[:5].gt(0).all()  # when the change is known, and before rows without another one bring it back
    assert first.instants["factor"].iloc[:4].eq(1).all()  # no path has ended yet
    for played in (first, second):
        held = (played.instants["reach"] <= played.instants["factor"])[played.instants["reach"].notna()].mean()
        (line,) = (line for line in summary(played) if "adapting at 0.3 up to " in line)
        assert f"times: it held {percent_text(held)}" in line


def test_a_band_that_cannot_be_promised_is_refused(banded, predictor, tmp_path):
    _, file = banded
    target = saved(log(), tmp_path)
    with pytest.raises(DataError, match="needs 19 runs or more"):
        play_aboard(file, target, level=0.95)
    with pytest.raises(DataError, match="of the kind 'zigzag'"):
        play_aboard(file, target, level=0.9, kind="zigzag")
    with pytest.raises(DataError, match="has no band"):
        play_aboard(predictor, target, level=0.9)
    wider, usual = (play_aboard(file, target, every=50.0, level=0.5, kind=kind).points for kind in ("zigzag", None))
    np.testing.assert_allclose(wider["band_along"], 2 * usual["band_along"])
    short = play_aboard(file, saved(log().iloc[:4], tmp_path), level=0.5)
    assert any("no whole path can be judged" in line for line in summary(short))


def test_a_log_without_the_past_that_is_needed_is_one_line(tmp_path):
    file = drawn("kernel", 2, vessel="mariner").predictor.save(tmp_path / "cell.npz")  # a past of 1 s
    target = saved(log().assign(V_w=0.0, beta_w=0.0, phi=0.0), tmp_path)
    assert len(play_aboard(file, target, every=3.0).instants)
    with pytest.raises(DataError, match="no instant has the past of 1 s that the predictor needs"):
        play_aboard(file, target, every=1e4)


def test_where_the_log_has_no_rows_there_is_no_error(banded, tmp_path):
    """Nor is a path over it counted by the band; before, errors were those to a straight line over the gap."""
    whole, file = log(), banded[1]
    gap = whole[(whole["t"] <= 100) | (whole["t"] >= 150)].reset_index(drop=True)
    (tmp_path / "gap").mkdir()
    first, second = (play_aboard(file, saved(f, d), level=0.5) for f, d in ((whole, tmp_path), (gap, tmp_path / "gap")))
    before = second.instants["t"] <= 100
    inside = second.points["t"] + second.points["ahead"]
    inside = (inside > 100) & (inside < 150)
    assert inside.any()
    assert second.points.loc[inside, "error"].isna().all()
    early = second.points["t"] <= 100
    same = first.points[first.points["t"] <= 100].reset_index(drop=True)
    pd.testing.assert_series_equal(
        second.points.loc[early & ~inside, "error"], same.loc[(early & ~inside)[early], "error"]
    )
    assert second.instants.loc[before & (second.instants["t"] > 80), "reach"].isna().all()
    gap = "1 time without rows, the longest 50 s after t = 100 s of 'a': no errors there"
    assert [any(gap in line for line in summary(one)) for one in (first, second)] == [False, True]


def test_a_heading_that_wraps_changes_no_prediction():
    """Aboard and along a log: a change of heading over so long is that of the ship, wherever the compass begins."""
    frame = log(rows=120)
    frame["psi"] += 6.2 + np.linspace(0.0, 1.0, len(frame))
    wrapped = frame.assign(psi=frame["psi"] % (2 * np.pi))
    assert np.abs(np.diff(wrapped["psi"])).max() > 6
    data, turned = (Dataset(one, {"clock": "run", "flags": []}) for one in (frame, wrapped))
    windows = cut_windows(data, horizon=4, step=STEP, interval=5.0, past=4)
    method = Kernel(trials=1, steps=2, terms=2, memory=Memory(turned=(20.0,)))
    fitted = fit(method, Physics(None, 4, STEP), windows)
    tables = [
        table_of_stretch(fitted, one, run, rows) for one in (data, turned) for run, rows in stretches_of_runs(one)
    ]
    for name in ("cooperative_north", "cooperative_east"):
        np.testing.assert_allclose(tables[1][name], tables[0][name], atol=1e-6)


def test_a_table_of_errors_has_the_half_axes_of_a_band_unless_it_is_wider_than_a_ship_can_go(banded, tmp_path):
    played = play_aboard(banded[1], saved(log(), tmp_path), level=0.9)
    points = played.points.copy()
    points.loc[points["ahead"] < 20.0, ["band_along", "band_across"]] = 0.5
    points.loc[points["ahead"] == 20.0, ["band_along", "band_across"]] = 1e6
    head, *some, last = (line.text for line in replay_summary(replace(played, points=points))[-5:])
    assert head.endswith("in alarm  band along band across")
    assert all(line.split()[-2:] == ["0.50", "0.50"] for line in some)
    assert last.split()[-2:] == ["-", "-"]
    error = points["error"][points["ahead"] == 20.0]
    assert last.split()[1:4] == [length_text(one) for one in (error.median(), error.quantile(0.9), error.max())]
