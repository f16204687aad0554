"""Measures of the runs of a dataset."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DataError
from shipid.logs.measuring import NO_HELM, measure_dataset
from shipid.measures.zigzag import zigzag_measures
from tests.measures.made_records import RECORDS, every


def rows_of(kind: str, run: str) -> pd.DataFrame:
    record = every(RECORDS[kind](), 0.5)
    states = {name: getattr(record, name) for name in ("t", "north", "east", "psi", "u", "v", "r")}
    shaft = np.full(len(record.t), 2.0) if record.shaft is None else record.shaft
    return pd.DataFrame({"run": run, **states, "rudder.delta": record.helm, "main.n": shaft, "flags": 0})


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    still = rows_of("zigzag", "still").assign(**{"rudder.delta": 0.0})
    runs = [rows_of("zigzag", "Z"), rows_of("pull-out", "P"), rows_of("stop", "S"), still, rows_of("turning", "T")]
    frame = pd.concat(runs, ignore_index=True)
    cut = np.flatnonzero((frame["run"] == "T") & (frame["t"] == 240.0))[0]
    frame.loc[cut, "flags"] = 1
    return Dataset(frame, {"clock": "run", "flags": ["break"]})


def test_each_run_is_measured_as_what_it_is(dataset: Dataset) -> None:
    measured = measure_dataset(dataset, length=50.0)
    kinds = measured.measures.groupby("run", sort=False)["kind"].unique().map(list).to_dict()
    assert kinds == {"Z": ["zigzag"], "P": ["turning", "pull-out"], "S": ["stop"], "T/1": ["turning"]}
    assert set(measured.left) == {"still", "T/2"}
    first = measured.measures.set_index(["run", "measure"]).loc[("Z", "overshoot 1")]
    exact = zigzag_measures(every(RECORDS["zigzag"](), 0.5))["overshoot_1"].value
    assert (first["value"], first["unit"]) == (pytest.approx(np.degrees(exact)), "deg")
    assert set(measured.criteria["run"]) == {"Z", "P", "S", "T/1"}


def test_a_kind_may_be_declared(dataset: Dataset) -> None:
    measured = measure_dataset(dataset, "pull-out")
    assert set(measured.measures["kind"]) == {"pull-out"}
    assert not measured.left
    stop = measured.measures[measured.measures["run"] == "S"]
    assert (stop["note"] != "").any()
    with pytest.raises(DataError, match="--manoeuvre: no manoeuvre is called 'zigzap'"):
        measure_dataset(dataset, "zigzap")
    with pytest.raises(DataError, match="--length"):
        measure_dataset(dataset, length=0.0)


def test_measures_do_not_depend_on_the_year(dataset: Dataset) -> None:
    """A clock with dates counts from 1970; an execute at 1748938848.8 s says nothing."""
    dated = Dataset(dataset.frame.assign(t=dataset.frame["t"] + 2.0**31), dataset.metadata)
    here, there = (measure_dataset(one, length=50.0) for one in (dataset, dated))
    late = here.measures["run"].eq("T/2") & here.measures["measure"].eq("execute")
    pd.testing.assert_frame_equal(here.measures[~late], there.measures[~late])
    pd.testing.assert_frame_equal(here.criteria, there.criteria)


def test_a_log_without_a_helm_says_what_is_missing() -> None:
    frame = rows_of("zigzag", "Z").rename(columns={"rudder.delta": "port.n"})
    log = Dataset(frame.assign(**{"port.n": 3.0}), {"clock": "run", "flags": ["break"]})
    assert measure_dataset(log).left["Z"] == NO_HELM, "it has none that moves by less than 3 deg"
