"""The schema refuses what it should, and Parquet gives back what went in."""

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet
import pytest

from shipid.data.dataset import (
    Dataset,
    mean_commands,
    read_dataset,
    sample_columns,
    stretches_by_run,
    stretches_of_runs,
    without_shared_moments,
    write_dataset,
)
from shipid.errors import DataError
from tests.logs.conftest import as_dataset, turning

T = np.arange(0.0, 20.0, 0.5)


def test_round_trip(tmp_path: Path) -> None:
    dataset = as_dataset(
        turning(T), turning(T, r=-0.02), vessel="gunnerus-33.9", repairs=[{"kind": "scale", "count": 3}]
    )
    file = write_dataset(dataset, tmp_path / "sub" / "trial.parquet")
    back = read_dataset(file)
    pd.testing.assert_frame_equal(back.frame, dataset.frame)
    assert back.metadata == {"units": back.metadata["units"], **dataset.metadata}
    assert back.metadata["units"]["port.n"] == "rev/s"
    assert back.runs == ["a", "b"]
    assert back.commands == ["port.n"]
    assert [entry.name for entry in file.parent.iterdir()] == ["trial.parquet"]  # nothing temporary stays


def test_the_digest_changes_with_everything_in_the_table_and_nothing_else(tmp_path: Path) -> None:
    dataset = as_dataset(turning(T), turning(T, r=-0.02))
    frame, metadata = dataset.frame, dataset.metadata
    changed = [
        frame.rename(columns={"port.n": "starboard.n"}),
        frame.rename(columns={"u": "v", "v": "u"}),
        frame.assign(u=frame["u"].where(frame["t"] != 3.0, np.nextafter(4.0, 5.0))),
        frame.assign(run=frame["run"].replace("b", "c")),
        frame.assign(run=np.where(frame.index < len(T) - 1, "a", "b")).assign(t=np.arange(len(frame)) * 0.5),
        frame.assign(t=np.arange(len(frame)) * 0.5),
        frame.assign(flags=frame["flags"].where(frame["t"] != 3.0, 1)),
        frame.assign(std_r=0.01),
        frame.iloc[:-1],
        frame.iloc[np.r_[len(T) : len(frame), : len(T)]],
    ]
    digests = {dataset.digest, *(Dataset(other, metadata).digest for other in changed)}
    assert len(digests) == 1 + len(changed)
    again = Dataset(frame.copy().reset_index(drop=True), {**metadata, "source": "another file"})
    assert again.digest == dataset.digest
    assert read_dataset(write_dataset(dataset, tmp_path / "trial.parquet")).digest == dataset.digest


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    file = write_dataset(as_dataset(turning(T)), tmp_path / "trial.parquet")
    before = file.read_bytes()
    with pytest.raises(DataError, match="the metadata must be plain data"):
        write_dataset(as_dataset(turning(T), bad=object()), file)
    assert file.read_bytes() == before


@pytest.mark.parametrize(
    ("change", "place", "remedy"),
    [
        (lambda f: f.drop(columns="psi"), "psi", "missing column; there are: t, north"),
        (lambda f: f.assign(Psi=1.0), "Psi", "did you mean 'psi'?"),
        (lambda f: f.assign(**{"port.rpm": 1.0}), "port.rpm", "<component>.<signal>"),
        (lambda f: f.assign(u=f["u"].astype("float32")), "u", "must hold float64 in m/s"),
        (lambda f: f.assign(u="fast"), "u", "must hold float64 in m/s"),
        (lambda f: f.assign(run=1), "run", "must hold text"),
        (lambda f: f.assign(flags=0.0), "flags", "must hold integers"),
        (lambda f: f.assign(flags=2), "flags", "metadata['flags']"),
        (lambda f: f.assign(v=f["v"].where(f["t"] != 3.0)), "v", "1 values are not finite, the first in row 6"),
        (lambda f: f.assign(t=f["t"].where(f["t"] != 3.0, 2.5)), "t", "does not increase at t = 2.5 s"),
        (lambda f: f.assign(V_w=1.0), "V_w", "beta_w is missing"),
        (lambda f: f.iloc[:0], None, "no rows"),
    ],
)
def test_schema_names_what_is_wrong(change: object, place: str | None, remedy: str) -> None:
    dataset = as_dataset(turning(T))
    with pytest.raises(DataError) as caught:
        Dataset(change(dataset.frame), dataset.metadata)  # type: ignore[operator]
    assert caught.value.path == place
    assert remedy in caught.value.message


def test_rows_of_runs_may_be_mixed_and_time_is_each_runs_own() -> None:
    dataset = as_dataset(turning(T))
    other = dataset.frame.assign(run="other", t=dataset.frame["t"] + 0.1)
    mixed = pd.concat([dataset.frame, other]).sort_values("t", ignore_index=True)
    assert Dataset(mixed, dataset.metadata).runs == [*dataset.runs, "other"]
    both = pd.concat([other, dataset.frame], ignore_index=True)  # the second begins before the first has ended
    assert Dataset(both, dataset.metadata).runs == ["other", *dataset.runs]
    back = mixed.assign(t=mixed["t"].where(mixed["run"] != "other", -mixed["t"]))
    with pytest.raises(DataError, match="run 'other': time does not increase at t = "):
        Dataset(back, dataset.metadata)


def test_units_that_contradict_the_schema_are_refused() -> None:
    with pytest.raises(DataError, match="must be 'rad'"):
        as_dataset(turning(T), units={"psi": "deg"})


@pytest.mark.parametrize(
    ("content", "remedy"),
    [(b"time,N,E\n", "not a Parquet file"), (None, "cannot be read"), ("foreign", "not a dataset of")],
)
def test_foreign_files_are_refused(tmp_path: Path, content: bytes | str | None, remedy: str) -> None:
    file = tmp_path / "x.parquet"
    if content == "foreign":
        pd.DataFrame({"t": [1.0]}).to_parquet(file)
    elif isinstance(content, bytes):
        file.write_bytes(content)
    with pytest.raises(DataError, match=remedy) as caught:
        read_dataset(file)
    assert caught.value.file == str(file)


def test_read_names_file_and_column(tmp_path: Path) -> None:
    file = write_dataset(as_dataset(turning(T)), tmp_path / "x.parquet")
    table = pyarrow.parquet.read_table(file)
    pyarrow.parquet.write_table(table.drop_columns(["u"]), file)
    with pytest.raises(DataError) as caught:
        read_dataset(file)
    assert (caught.value.file, caught.value.path) == (str(file), "u")


def test_some_runs_keep_their_rows_and_their_order() -> None:
    whole = as_dataset(*(turning(np.arange(9.0), u=u) for u in (3.0, 4.0, 5.0)))
    part = whole.select(["c", "a", "x"])
    assert part.runs == ["a", "c"]
    for name in "ac":
        rows = (each.frame[each.frame["run"] == name].reset_index(drop=True) for each in (whole, part))
        pd.testing.assert_frame_equal(*rows)
    assert part.metadata == whole.metadata
    assert whole.select("c").runs == ["c"]
    for none in ("x", ["x"], np.array(["x"])):
        with pytest.raises(DataError, match="no run is named x: there are a, b, c"):
            whole.select(none)


def test_a_table_that_changes_later_does_not_change_the_dataset() -> None:
    frame, metadata = as_dataset(turning(T)).frame.copy(), {"flags": ["break"]}
    dataset = Dataset(frame, metadata)
    digest, u = dataset.digest, frame["u"].iloc[0]
    frame.loc[0, "u"] = np.nan
    frame["v"] = 7.0
    metadata["flags"].clear()
    metadata["clock"] = "none"
    assert dataset.digest == digest
    assert dataset.frame["u"].iloc[0] == u
    assert dataset.metadata == {"flags": ["break"]}


def test_pieces_start_at_breaks() -> None:
    frame = turning(T).assign(flags=np.where(np.isin(T, [0.0, 5.0, 12.0]), 1, 0))
    starts = [(run, rows["t"].iloc[0], len(rows)) for run, rows in stretches_of_runs(as_dataset(frame, turning(T)))]
    assert starts == [("a", 0.0, 10), ("a", 5.0, 14), ("a", 12.0, 16), ("b", 0.0, 40)]
    other = Dataset(as_dataset(frame).frame, {"flags": ["interpolated"]})
    assert [len(rows) for _, rows in stretches_of_runs(other)] == [40], "a flag of another name"


def test_sample_holds_commands_and_interpolates_states() -> None:
    rows = turning(np.array([0.0, 0.1, 0.1 + 0.2, 0.6])).assign(
        u=[0.0, 1.0, 2.0, 3.0], **{"port.n": [1.0, 2.0, 3.0, 4.0]}
    )
    values = sample_columns(rows, np.array([[0.0, 0.3], [0.29, 0.45]]))  # 0.3 < 0.1 + 0.2 by one bit
    np.testing.assert_allclose(values["u"], [[0.0, 2.0], [1.95, 2.5]])
    np.testing.assert_array_equal(values["port.n"], [[1.0, 3.0], [2.0, 3.0]])


def test_sample_finds_the_row_that_rounding_moved() -> None:
    """At Unix time doubles lie 2.4e-7 s apart: start + 0.1 k and start + k / 10 are two numbers for some k."""
    k = np.arange(1000)
    rows = turning(1.7e9 + k / 10).assign(**{"port.n": k.astype(float)})
    np.testing.assert_array_equal(sample_columns(rows, 1.7e9 + 0.3 + 0.1 * k[:900])["port.n"], k[3:903])
    alone = sample_columns(rows.iloc[:1], np.array([1.7e9, 1.7e9 + 5.0]))
    np.testing.assert_array_equal(alone["port.n"], [0.0, 0.0])


@pytest.mark.parametrize("seed", range(5))
def test_commands_in_force_have_the_integral_of_those_that_hold(seed: int) -> None:
    """Steps of any length, beyond the last row, too; what does not change within a step is the same to the bit."""
    rng = np.random.default_rng(seed)
    t = 1.7e9 * (seed % 2) + np.cumsum(rng.uniform(0.05, 0.4, 200))
    orders = np.repeat(rng.normal(0, 3, 20), 10)
    rows = {"t": t, "port.n": orders, "port.alpha": np.full(200, 0.1), "u": rng.normal(size=200)}
    edges = t[0] + rng.uniform(0, 10, 7) + rng.uniform(0.1, 2.0, (40, 7)).cumsum(axis=0)
    found = mean_commands(rows, edges)
    assert list(found) == ["port.n", "port.alpha"]
    np.testing.assert_array_equal(found["port.alpha"], 0.1)
    fine = (np.arange(4000) + 0.5) / 4000
    instants = edges[:-1] + fine[:, None, None] * np.diff(edges, axis=0)
    held = sample_columns(rows, instants)["port.n"]
    np.testing.assert_allclose(found["port.n"], held.mean(axis=0), rtol=0, atol=0.01)
    same = (held == held[0]).all(axis=0)
    assert 0.2 < same.mean() < 1
    np.testing.assert_array_equal(found["port.n"][same], held[0][same])


def test_no_other_run_keeps_a_moment_of_runs_that_are_set_apart() -> None:
    """On one clock: the run that is set apart stays whole, the other loses what it shares, and is broken there."""
    middle = turning(T[10:20])
    log = without_shared_moments(as_dataset(middle, turning(T)), ["a"])
    by_run = {run: [list(rows["t"]) for rows in parts] for run, parts in stretches_by_run(log).items()}
    assert by_run == {"a": [list(T[10:20])], "b": [list(T[:10]), list(T[20:])]}
    separate = as_dataset(middle, turning(T), clock="run")
    assert without_shared_moments(separate, ["a"]) is separate
