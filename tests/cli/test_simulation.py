"""`shipid simulate` and `shipid manoeuvre`."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
import pytest

from shipid.data.dataset import read_dataset
from tests.cli.running import ended, output_of


def test_manoeuvre_measures_what_it_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Table, page, CSV and log of one run; the log measures the same."""
    monkeypatch.chdir(tmp_path)
    text = output_of(
        "manoeuvre", "gunnerus-28.9", "zigzag", 20, 10, "--csv", "z.csv", "--log", "z.parquet", "--speed", 4
    )
    assert "approach at 4 m/s" in text
    assert "zigzag 20/10, first to starboard" in text
    assert Path("gunnerus-28.9-zigzag.html").is_file()
    table = pd.read_csv("z.csv").set_index("measure")
    assert table.loc["execute heading", "value"] == pytest.approx(10)
    assert f"{table.loc['overshoot 1', 'value']:.3g}" in text
    text = output_of("data", "measures", "z.parquet", "--length", 28.9, "--csv", "again.csv")
    assert "1 run measured, 0 not" in text
    again = pd.read_csv("again.csv").set_index("measure")
    pd.testing.assert_series_equal(again["value"], table["value"])


def test_manoeuvres_that_cannot_be() -> None:
    for arguments, expected in (
        (("manoeuvre", "gunnerus-28.9", "zigzak"), "error: manoeuvre 'zigzak' is not known"),
        (
            ("manoeuvre", "gunnerus-28.9", "turning", "--log", "x.csv"),
            "error: x.csv: --log: let the name end in .parquet",
        ),
    ):
        status, _, err = ended(*arguments)
        assert status == 1
        assert err.startswith(expected)
        assert err.count("\n") == 1


def test_simulate_writes_the_runs_and_shows_their_envelope(study: Path) -> None:
    text = output_of("simulate", study, "--out", "runs.parquet")
    dataset = read_dataset("runs.parquet")
    assert f"{len(dataset.frame)} rows in {len(dataset.runs)} runs -> runs.parquet" in text
    assert len(dataset.runs) == 12
    assert re.search(r"^ *test +u +m/s +-?\d\S* +-?\d\S* +-?\d\S*$", text, re.MULTILINE)
