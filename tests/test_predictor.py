"""Predictors: what is saved is what is loaded, nothing else is; and they predict along a log."""

from __future__ import annotations

import json
import re
from dataclasses import MISSING, fields, replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset, read_dataset, write_dataset
from shipid.data.windows import Instants
from shipid.errors import DataError, ResultError, ShipidError
from shipid.hybrid.alone import UnchangedPath
from shipid.hybrid.features import Inputs
from shipid.hybrid.kernel_compensator import KernelCompensator
from shipid.hybrid.novelty import calibrate_alarm
from shipid.hybrid.physics import Physics
from shipid.observer import Observer
from shipid.predictor import FORMAT, Predictor
from shipid.study.apply import predict_log
from shipid.study.store import DATASET, cell_file, read_test
from shipid.vessel.load import load_vessel
from tests.hybrid.runs import made
from tests.study.tiny import logged

CELL, PURE = "wrong-1+kernel-N0006-s0", "none+kernel-N0006-s0"


@pytest.fixture(scope="module")
def predictor(tiny_run: Path) -> Predictor:
    return Predictor.load(cell_file(tiny_run, CELL))


@pytest.mark.parametrize("cell", [CELL, PURE])
def test_round_trip(tmp_path: Path, tiny_run: Path, cell: str) -> None:
    first = Predictor.load(cell_file(tiny_run, cell))
    again = Predictor.load(first.save(tmp_path / "deep" / "again.npz"))
    for name in ("physics", "method", "commands", "past", "limits", "provenance"):
        assert getattr(again, name) == getattr(first, name)
    assert (again.vessel is None) == (cell == PURE)
    assert again.vessel == first.vessel
    instants = read_test(tiny_run)[0].instants()
    np.testing.assert_array_equal(again.predict(instants), first.predict(instants))
    assert [file.name for file in (tmp_path / "deep").iterdir()] == ["again.npz"]


def test_every_field_survives_a_file(tmp_path: Path) -> None:
    """Each field has a value that is not its default, so that none can be left out of the file."""
    physics = Physics(load_vessel("gunnerus-28.9"), 7, 0.5, "rk4", Observer(current=0.0), "velocity")
    bands = made(0)[1]
    alarm = calibrate_alarm(Inputs(()), 0, {"u": np.arange(6.0), "v": np.ones(6)}, np.array([*"aabbcc"]))
    first = Predictor(
        physics, "alone", UnchangedPath({}), {"u": (1.0, 2.0)}, {"seed": 3}, "known", ("u", "v"), bands, 7.0, alarm
    )
    for one in (first, physics):
        for place in fields(one):
            value = getattr(one, place.name)
            assert place.default is MISSING or value != place.default, place.name
            assert place.default_factory is MISSING or value != place.default_factory(), place.name
    again = Predictor.load(first.save(tmp_path / "all.npz"))
    for place in fields(Predictor):
        if place.name not in ("bands", "alarm"):
            assert getattr(again, place.name) == getattr(first, place.name), place.name
    for read, kept in ((again.bands, bands), (again.alarm, alarm)):
        assert read.header() == kept.header()
        for name, values in kept.arrays().items():
            np.testing.assert_array_equal(read.arrays()[name], values)


def test_what_a_user_notes_of_the_origin_is_saved(tmp_path: Path) -> None:
    """Before, a number of NumPy's, a date or a path among it ended in a TypeError."""
    noted = {"runs": np.int64(3), "mean": np.array([1.0, 2.0]), "day": date(2026, 11, 26), "log": Path("trials.csv")}
    one = Predictor(Physics(load_vessel("mariner"), 3, 0.5), "alone", UnchangedPath({}), provenance=noted)
    known = Predictor.load(one.save(tmp_path / "one.npz")).provenance
    assert known == {"runs": 3, "mean": [1.0, 2.0], "day": "2026-11-26", "log": "trials.csv"}


def test_a_level_gives_a_band_or_one_sentence(tiny_run: Path) -> None:
    predictor = Predictor.load(cell_file(tiny_run, CELL))
    instants = read_test(tiny_run)[0].instants()
    prediction = predictor.predict(instants, level=0.7)
    np.testing.assert_array_equal(prediction.paths, predictor.predict(instants))
    assert prediction.region.along.shape == prediction.paths.shape[:2]
    assert (prediction.region.radius > 0).all()
    np.testing.assert_array_equal(prediction.outside, predictor.raise_alarm(instants))
    alone = predictor.predict(instants, level=0.7, pointwise=True)
    assert alone.region.radius.mean() < prediction.region.radius.mean()
    with pytest.raises(DataError, match="a band of 90 % needs 9 runs or more to calibrate it: there are"):
        predictor.predict(instants, level=0.9)
    with pytest.raises(DataError, match="this predictor has no band: it was made without"):
        replace(predictor, bands=None).predict(instants, level=0.7)


def test_windows_of_another_step_are_refused(tiny_run: Path, predictor: Predictor) -> None:
    """Past and planned commands would be taken for those of other moments."""
    test = read_test(tiny_run)[0]
    with pytest.raises(DataError, match=r"instants of windows with steps of 0\.5 s, the predictor has 1 s"):
        predictor.predict(replace(test, step=0.5).instants())
    with pytest.raises(DataError, match="instants of windows with steps"):
        predictor.alone(replace(test, step=2.0).instants())


def test_physics_alone_and_compensation_alone(tiny_run: Path, predictor: Predictor) -> None:
    instants = read_test(tiny_run)[0].instants()
    compensator, physics = predictor.corrector, predictor.physics
    assert isinstance(compensator, KernelCompensator)
    alone = Predictor(physics, "alone", UnchangedPath({}))
    pure = Predictor(replace(physics, vessel=None), "kernel", compensator)
    np.testing.assert_array_equal(alone.predict(instants), predictor.alone(instants))
    table = compensator.inputs.table(physics, instants)
    np.testing.assert_array_equal(pure.predict(instants), compensator.compensation(table))
    np.testing.assert_allclose(alone.predict(instants) + pure.predict(instants), predictor.predict(instants))


def test_a_prediction_does_not_depend_on_where_north_is(tiny_run: Path, predictor: Predictor) -> None:
    """Frame (11): ship and wind turned and moved together, the path aboard is the same."""
    columns = read_test(tiny_run)[0].columns
    turned = {**columns, "psi": columns["psi"] + 1.1, "beta_w": columns["beta_w"] + 1.1}
    turned |= {"north": columns["north"] - 700.0, "east": columns["east"] + 30.0}
    np.testing.assert_allclose(predictor.predict(Instants(turned)), predictor.predict(Instants(columns)), atol=1e-8)


def test_outside_flags_each_column(predictor: Predictor) -> None:
    middle = {name: np.full(2, (low + high) / 2) for name, (low, high) in predictor.limits.items()}
    assert not predictor.outside(middle).any()
    edges = {name: np.array(pair) for name, pair in predictor.limits.items()}
    assert not predictor.outside(edges).any()
    for name, (low, high) in predictor.limits.items():
        width = high - low
        beyond = {**middle, name: np.array([low - 0.01 * width, high + 0.01 * width])}
        assert predictor.outside(beyond).all(), name
        one = {**middle, name: np.array([low, high + 0.01 * width])}
        assert predictor.outside(one).tolist() == [False, True]


# Files that are no predictors.


def rewritten(source: Path, target: Path, **changes: Any) -> Path:
    """A saved predictor with another header or other arrays; None removes."""
    with np.load(source, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    header = json.loads(str(arrays["header"]))
    for key, value in changes.items():
        place = arrays if key in arrays else header
        if value is None:
            del place[key]
        else:
            place[key] = value
    if "header" not in changes:
        arrays["header"] = np.array(json.dumps(header))
    np.savez(target, **arrays)
    return target


class Trap:
    """Its pickle would run code."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (pytest.fail, ("a pickle was opened",))


def test_a_pickle_inside_is_refused(tmp_path: Path, tiny_run: Path) -> None:
    trap = np.empty(1, dtype=object)
    trap[0] = Trap()
    for changes in ({"header": trap}, {"normaliser.mean": trap}):
        file = rewritten(cell_file(tiny_run, CELL), tmp_path / "trap.npz", **changes)
        with pytest.raises(ResultError, match="not a predictor of shipid"):
            Predictor.load(file)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": FORMAT + 1}, f"written in format {FORMAT + 1}, this shipid reads {FORMAT}"),
        ({"format": None}, "written in format None"),
        ({"header": np.array("[1, 2]")}, "not a predictor"),
        ({"header": np.array("{")}, "not a predictor"),
        ({"header": None}, "not a predictor"),
        ({"horizon": None}, "damaged"),
        ({"limits": {"u": [1.0]}}, "damaged"),
        ({"corrector": 3}, "damaged"),
        ({"method": "knn"}, r"the method 'knn', which is not known here: .*\(one that you wrote needs its package"),
        ({"method": None}, "damaged"),
        ({"basis": None}, "missing in the saved method"),
        ({"normaliser.mean": np.zeros(3)}, "do not fit together"),
        ({"normaliser.std": np.zeros(1)}, "std' must be above 0"),
        ({"bands.spread": np.array([1.0, 0.0])}, "'bands.spread' must be above 0"),
        ({"bands.deviation": -np.ones(5)}, "'bands.deviation' must be above 0"),
        ({"bands.whole": np.arange(98.0)}, "whole: the arrays of the saved method do not fit"),
        ({"vessel": {"document": {"name": "x"}, "file": "x.toml"}}, "damaged"),
    ],
)
def test_foreign_contents_are_one_line(tmp_path: Path, tiny_run: Path, changes: dict[str, Any], message: str) -> None:
    file = rewritten(cell_file(tiny_run, CELL), tmp_path / "foreign.npz", **changes)
    with pytest.raises(ShipidError, match=message) as caught:
        Predictor.load(file)
    assert isinstance(caught.value, ResultError)
    assert str(caught.value).startswith(f"{file}: ")


def test_files_of_other_kinds_are_one_line(tmp_path: Path, tiny_run: Path) -> None:
    whole = cell_file(tiny_run, CELL).read_bytes()
    flipped = bytearray(whole)
    flipped[300:360] = bytes(60)
    contents = {
        "empty": b"",
        "text": b"hello",
        "half": whole[: len(whole) // 2],
        "flipped": bytes(flipped),
        "zip of nothing": b"PK\x05\x06" + bytes(18),
    }
    for name, content in contents.items():
        file = tmp_path / f"{name}.npz"
        file.write_bytes(content)
        with pytest.raises(ResultError, match="not a predictor"):
            Predictor.load(file)
    np.save(tmp_path / "array.npy", np.zeros(3))
    for file, message in (
        (tmp_path / "array.npy", "not a predictor"),
        (tmp_path, "a folder: name one"),
        (tmp_path / "x", "No such"),
    ):
        with pytest.raises(ResultError, match=message):
            Predictor.load(file)


# Along a log.


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_predictions_for_every_instant_of_a_log(tmp_path: Path, tiny_run: Path, ending: str) -> None:
    out = tmp_path / "new" / f"paths{ending}"
    frame, outside = predict_log(tiny_run, CELL, tiny_run / DATASET, None, out)
    log = read_dataset(tiny_run / DATASET).frame
    assert len(frame) == 5 * len(log)
    written = pd.read_csv(out) if ending == ".csv" else pd.read_parquet(out)
    pd.testing.assert_frame_equal(written, frame, check_dtype=False)
    assert sorted(frame["ahead"].unique()) == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert 0.0 <= outside < 1.0
    merged = frame.merge(log[["run", "t", "north", "east", "psi", "u", "v"]], on=["run", "t"])
    near = merged[merged["ahead"] == 1.0]
    # The first second of an Euler path is exactly R(psi) (u, v) away from where the ship is.
    north = near["north"] + near["u"] * np.cos(near["psi"]) - near["v"] * np.sin(near["psi"])
    east = near["east"] + near["u"] * np.sin(near["psi"]) + near["v"] * np.cos(near["psi"])
    np.testing.assert_allclose(near["physics_north"], north, atol=1e-9)
    np.testing.assert_allclose(near["physics_east"], east, atol=1e-9)


def test_errors_along_the_test_runs_are_the_studys(tmp_path: Path, tiny_run: Path) -> None:
    """North-east paths against the logged positions give A and H of the cell: the turn back is right."""
    from shipid.study.store import read_rows

    frame, _ = predict_log(tiny_run, CELL, tiny_run / DATASET, None, tmp_path / "paths.csv")
    assert re.match(r"5 s ahead predictions err by \d\.\d+ m on average, nine in ten below", frame.attrs["errors"])
    knew, every = len(Predictor.load(cell_file(tiny_run, CELL)).provenance["runs"]), len(frame["run"].unique())
    assert frame.attrs["limits"] == [
        f"{knew} of {every} runs named like runs that trained this predictor: "
        "if they are the same, their errors are no evidence"
    ]
    log = read_dataset(tiny_run / DATASET).frame
    true = log[["run", "t", "north", "east"]].rename(columns={"t": "at"})
    whole = frame["run"].isin(list(read_test(tiny_run)[0].spans)) & (frame["t"] <= 15.0)  # the future is all logged
    joined = frame[whole].assign(at=frame["t"] + frame["ahead"]).merge(true, on=["run", "at"])
    assert len(joined) == 4 * 16 * 5
    row = read_rows(tiny_run).set_index("cell").loc[CELL]
    for kind, metric in (("physics", "A"), ("cooperative", "H")):
        error = np.hypot(joined[f"{kind}_north"] - joined["north"], joined[f"{kind}_east"] - joined["east"])
        assert error.mean() == pytest.approx(row[metric], rel=1e-9)


def test_a_log_is_predicted_by_what_was_known(tmp_path: Path) -> None:
    """Speeds interpolated between fixes: another fix at 12 s changes no path that begins up to 10 s."""
    physics = Physics(load_vessel("gunnerus-28.9"), 5, 1.0)
    Predictor(physics, "alone", UnchangedPath({}), causal=("u",)).save(cell_file(tmp_path, "one"))
    t, fixes = np.arange(31.0), np.arange(0.0, 31.0, 3.0)
    frames = []
    for later in (0.0, 1.0):
        speeds = 2.0 + np.sin(fixes) + later * (fixes > 11.0)
        file = write_dataset(logged({"a": {"u": np.interp(t, fixes, speeds)}}, t), tmp_path / f"{later}.parquet")
        frames.append(predict_log(tmp_path, "one", file, None, tmp_path / "paths.csv")[0])
    early = frames[0]["t"] <= 10.0
    pd.testing.assert_frame_equal(frames[0][early], frames[1][early])
    assert not frames[0].equals(frames[1])


def test_what_is_wrong_with_a_request_is_one_line(tmp_path: Path, tiny_run: Path) -> None:
    log, out = tiny_run / DATASET, tmp_path / "paths.csv"
    with pytest.raises(ResultError, match=r"did you mean 'wrong-1\+kernel-N0006-s0'"):
        predict_log(tiny_run, "wrong-1+kernel-N06-s0", log, None, out)
    with pytest.raises(ResultError, match="holds no finished cells"):
        predict_log(tmp_path, CELL, log, None, out)
    with pytest.raises(DataError, match=r"ending in \.parquet or \.csv"):
        predict_log(tiny_run, CELL, log, None, tmp_path / "paths.xlsx")
    with pytest.raises(DataError, match="cannot be read"):
        predict_log(tiny_run, CELL, tmp_path / "gone.parquet", None, out)
    dataset = read_dataset(log)
    for missing, message in (("port.n", "needs this command"), ("V_w", "measure wind")):
        columns = ["V_w", "beta_w"] if missing == "V_w" else [missing]
        fewer = Dataset(dataset.frame.drop(columns=columns), {**dataset.metadata, "units": {}})
        file = write_dataset(fewer, tmp_path / "fewer.parquet")
        with pytest.raises(DataError, match=message):
            predict_log(tiny_run, CELL, file, None, out)
    assert not out.exists()
