"""A folder, its sub-folders and a glob are one source of several runs; a file that cannot be read is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.errors import DataError
from shipid.files import write_new
from shipid.logs.guess.columns import guess
from shipid.logs.guess.draft import draft_mapping
from shipid.logs.guess.sources import read_source
from shipid.logs.importing import import_log, read_mapping
from tests.drawn import seeds
from tests.logs.simulated import as_bridge, si_log

LOG = as_bridge(si_log()).round(4)


def folder_of(path: Path, *names: str) -> Path:
    for index, name in enumerate(names):
        file = path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        LOG.iloc[240 * (index + 1) : 240 * (index + 1) + 900].to_csv(file, index=False)
    return path


def test_a_folder_is_one_source_that_imports(tmp_path: Path) -> None:
    logs = folder_of(tmp_path / "logs", "day1/ZZ20-20_1.csv", "day2/TC25_1.csv", "day2/run3.csv")
    (logs / "day2" / "notes.csv").write_text("nothing to see\nhere\n")
    proposal = guess(logs)
    assert proposal.source.pattern == "**/*.csv"
    assert list(proposal.source.skipped) == ["day2/notes.csv"]
    mapping = write_new(draft_mapping(proposal), tmp_path / "draft.toml")
    dataset = import_log(read_mapping(mapping), logs)
    assert dataset.runs == ["day1/ZZ20-20_1", "day2/TC25_1", "day2/run3"]
    assert dataset.metadata["manoeuvres"] == {"day1/ZZ20-20_1": "zigzag", "day2/TC25_1": "turning"}
    assert "notes.csv is left out" in mapping.read_text()


def test_a_glob_takes_the_files_that_fit(tmp_path: Path) -> None:
    folder_of(tmp_path, "ZZ_1.csv", "ZZ_2.csv", "other.csv")
    source = read_source(tmp_path / "ZZ_*.csv")
    assert (source.path, source.pattern, sorted(source.files)) == (tmp_path, "ZZ_*.csv", ["1", "2"])


def test_a_file_with_other_columns_is_left_out_and_named(tmp_path: Path) -> None:
    folder_of(tmp_path, "a.csv", "b.csv", "c.csv")
    LOG.drop(columns="psi").to_csv(tmp_path / "d.csv", index=False)
    source = read_source(tmp_path)
    assert sorted(source.files) == ["a", "b", "c"]
    assert "lacks 'psi'" in source.skipped["d.csv"]


def test_a_folder_without_a_log(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="a folder without a log"):
        read_source(tmp_path)
    (tmp_path / "a.csv").write_text("no\n")
    with pytest.raises(DataError, match=r"no file of this folder can be read: a\.csv"):
        read_source(tmp_path)


@pytest.mark.parametrize("column", [True, False])
def test_files_of_several_runs_are_parted(column: bool, tmp_path: Path) -> None:
    for day in ("one", "two"):
        parts = [LOG.iloc[start : start + 400] for start in (240, 1000, 1800)]
        runs = [part.assign(**({"Test no": 7 + number} if column else {})) for number, part in enumerate(parts)]
        folder = tmp_path / "days"
        folder.mkdir(exist_ok=True)
        pd.concat(runs).to_csv(folder / f"{day}.csv", index=False)
    found = guess(folder)
    assert found.source.held == 6
    assert found.source.parts.get("from") == ("Test no" if column else None)
    dataset = import_log(read_mapping(write_new(draft_mapping(found), tmp_path / "draft.toml")), folder)
    assert dataset.runs == [
        f"{day} {number + 7 * column}" for day in ("one", "two") for number in range(1 - column, 4 - column)
    ]
    assert set(dataset.frame.groupby("run", sort=False).size()) == {400}


@pytest.mark.parametrize(("names", "unit"), [((1, 2, 3), "s"), (("out", "home", "out"), "ms")])
def test_a_clock_that_begins_again_with_each_run_is_one_of_each_run(
    names: tuple[object, ...], unit: str, tmp_path: Path
) -> None:
    """Every run is on a clock from its start."""
    clock = {"s": "time", "ms": "time [ms]"}[unit]
    pieces = []
    for start in (240, 1000, 1800):
        part = LOG.iloc[start : start + 500].copy()
        part["time"] = (part["time"] - part["time"].iloc[0]) * (1000 if unit == "ms" else 1)
        pieces.append(part.rename(columns={"time": clock}))
    file = tmp_path / "all.csv"
    pd.concat([part.assign(run=name) for part, name in zip(pieces, names, strict=True)]).to_csv(file, index=False)
    found = guess(file)
    assert found.source.parts == {"from": "run"}
    assert found.source.held == 3
    assert "holes in time" not in found.kinds
    dataset = import_log(read_mapping(write_new(draft_mapping(found), tmp_path / "draft.toml")), file)
    expected = ("all out", "all home", "all out (2)") if names[0] == "out" else tuple(f"all {name}" for name in names)
    assert dataset.runs == list(expected)
    assert dataset.metadata["clock"] == "run"


@pytest.mark.parametrize("seed", seeds(2, 12))
def test_files_of_the_same_time_are_channels_of_one_log(seed: int, tmp_path: Path) -> None:
    """A folder of position, attitude and actuators, each in a file, was refused: no column can be the position."""
    draw, names = np.random.default_rng(seed), list(LOG.columns[1:])
    draw.shuffle(names)
    cuts = np.sort(draw.choice(np.arange(1, len(names)), 2, replace=False))
    for number, group in enumerate(np.split(np.array(names), cuts)):
        every = int(draw.integers(1, 4))
        LOG.iloc[number % every :: every][["time", *group]].to_csv(tmp_path / f"part {number}.csv", index=False)
    proposal = guess(tmp_path)
    draft = write_new(draft_mapping(proposal), tmp_path / "draft.toml")
    rows = import_log(read_mapping(draft).model_copy(update={"segment": ()}), proposal.file).frame
    for name, source in (("north", "N"), ("east", "E"), ("u", "u")):
        true = np.interp(rows["t"], LOG["time"], LOG[source])
        assert np.abs(rows[name] - true).max() < (1.0 if name != "u" else 0.2)
    assert {"propeller.n", "rudder.delta"} <= {*rows.columns}
    assert any("begin at one moment" in one.sentence for one in proposal.questions)
