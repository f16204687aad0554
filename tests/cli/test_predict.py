"""`shipid predict`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from shipid.data.dataset import read_dataset, write_dataset
from shipid.errors import ShipidError
from shipid.study.store import DATASET, read_rows
from tests.cli.running import BAD, output_of


def test_predict_on_a_raw_log(tmp_path: Path, tiny_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A log with other commands than the ship's is one line."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ShipidError, match=r"needs this command; the data have propeller\.n"):
        output_of(
            *("predict", tiny_run, BAD / "logs" / "good.csv", "--cell", "right+kernel-N0004-s0"),
            *("--mapping", BAD / "logs" / "plain.toml"),
        )


def test_the_default_file_is_not_written_over_the_log(
    tmp_path: Path, tiny_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    cell = read_rows(tiny_run)["cell"].iloc[0]
    log = Path(f"{cell}.parquet")
    log.write_bytes((tiny_run / DATASET).read_bytes())
    with pytest.raises(ShipidError, match="--out: is named twice, and would be written over"):
        output_of("predict", tiny_run, log, "--cell", cell)
    assert log.read_bytes() == (tiny_run / DATASET).read_bytes()


def test_a_log_whose_rows_are_farther_apart_than_the_step_is_said(tmp_path: Path, tiny_run: Path) -> None:
    cell = read_rows(tiny_run)["cell"].iloc[0]
    whole = read_dataset(tiny_run / DATASET)
    rare = replace(whole, frame=whole.frame[whole.frame["t"] % 5 == 0])
    words = "rows are 5 s apart and the step is 1 s: path and motion between rows are interpolated"
    for dataset, said in ((whole, False), (rare, True)):
        log = write_dataset(dataset, tmp_path / "log.parquet")
        assert (words in output_of("predict", tiny_run, log, "--cell", cell, "--out", tmp_path / "out.csv")) is said
