"""`shipid data`."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.data.dataset import read_dataset, write_dataset
from shipid.study.store import DATASET
from tests.cli.running import BAD, output_of
from tests.logs.simulated import as_bridge, si_log


def test_data_import_and_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = output_of("data", "import", BAD / "logs" / "plain.toml", BAD / "logs" / "good.csv")
    assert "41 rows in 1 run -> plain.parquet" in text
    assert read_dataset("plain.parquet").runs == ["good"]
    output_of("data", "import", BAD / "logs" / "plain.toml", BAD / "logs" / "good.csv", "--out", "deep/other.parquet")
    assert re.search(r"(\d+) of \1 checks passed", output_of("data", "check", "deep/other.parquet"))


def test_data_check_tells_what_fails(tmp_path: Path, tiny_run: Path) -> None:
    dataset = read_dataset(tiny_run / DATASET)
    wrong = dataset.frame.assign(r=dataset.frame["r"] + 0.5)
    file = write_dataset(type(dataset)(wrong, dataset.metadata), tmp_path / "wrong.parquet")
    result = CliRunner().invoke(app, ["data", "check", str(file)])
    assert result.exit_code == 1
    assert "sensor r bias = 0.5" in result.output
    assert "the same in all" not in result.output
    held = dataset.frame.assign(**dict.fromkeys(dataset.commands, 0.2))
    file = write_dataset(type(dataset)(held, dataset.metadata), tmp_path / "held.parquet")
    assert re.search(r"note: .* the same in all \d+ runs", output_of("data", "check", file))


def test_data_guess_segment_and_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    as_bridge(si_log()).to_csv("trial.csv", index=False)
    text = output_of("data", "import", "--guess", "trial.csv")
    assert "draft -> trial.toml" in text
    assert "positive turns the ship to starboard" in text
    output_of("data", "import", "trial.toml", "trial.csv")
    named = output_of(
        *("data", "import", "--guess", "trial.csv", "--vessel", "mariner", "--frame", "ned", "--out", "mariner.toml")
    )
    assert "draft -> mariner.toml" in named
    assert "7 segments -> trial-segments.toml" in output_of("data", "segment", "trial.toml", "trial.csv")
    assert "checks passed" in output_of("data", "check", "trial.parquet", "--html", "deep/page.html")
    assert "plotly" in Path("deep/page.html").read_text(encoding="utf-8")
    for arguments, remedy in {
        ("import", "--guess", "trial.csv"): "not written over",
        ("import", "trial.toml", "--guess", "trial.csv"): "give neither mapping nor repairs",
        ("import",): "draft one with --guess",
        ("import", "trial.toml", "trial.csv", "--vessel", "mariner"): "is for drafts: give it with --guess",
    }.items():
        assert remedy in str(CliRunner().invoke(app, ["data", *arguments]).exception)


def test_data_fetch_from_the_folder(shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHIPID_DATA", str(shared_data))
    file = Path(output_of("data", "fetch", "gunnerus-2022").strip())
    assert file.is_file()
    assert shared_data in file.parents
