"""`shipid study`."""

from __future__ import annotations

import errno
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from shipid.cli import app
from shipid.errors import ShipidError
from shipid.study import run
from shipid.study.store import DATASET, read_rows
from tests.cli.running import ended, output_of
from tests.study.tiny import TINY, without_figures, without_workers


def test_a_table_replaces_nothing_that_the_study_reads(study: Path) -> None:
    output_of("simulate", study, "--out", "data.parquet")
    text = study.read_text()
    head, rest = text[: text.index("[truth]")], text[text.index("[split]") :]
    study.write_text(f'{head}[data]\ndataset = "data.parquet"\n{rest}')
    before = Path("data.parquet").read_bytes()
    status, _, error = ended("study", "screen", study, "--out", "data.parquet")
    assert status == 1
    assert "data.parquet: --out: is named twice" in error
    assert Path("data.parquet").read_bytes() == before


def test_screen_writes_a_row_per_member(study: Path) -> None:
    text = output_of("study", "screen", study, "--members", "6")
    frame = pd.read_csv("tiny-screen.csv")
    assert list(frame["member"]) == [f"wrong-{k}" for k in range(1, 7)]
    shown = re.search(r"^ *wrong +6 +0 +([\d. ]+)$", text, re.MULTILINE)
    assert shown
    expected = np.quantile(frame["A"], [0.05, 0.25, 0.5, 0.75, 0.95])
    np.testing.assert_allclose([float(word) for word in shown[1].split()], expected, atol=0.001)
    output_of("study", "screen", study, "wrong", "--members", "2", "--out", "new/rows.parquet")
    pd.testing.assert_frame_equal(pd.read_parquet("new/rows.parquet"), frame[:2], rtol=1e-12)
    for arguments, remedy in (
        (["right"], "'right' draws no factor from a range"),
        (["--out", "rows.txt"], "end in .parquet or .csv"),
    ):
        with pytest.raises(ShipidError, match=re.escape(remedy)):
            output_of("study", "screen", study, *arguments)


def test_run_report_resume_and_predict(study: Path, tiny_run: Path) -> None:
    """The whole way, as a user goes it; the run on one worker."""
    text = output_of("study", "run", study, "--workers", "1")
    folder = next(Path("results").iterdir())
    assert re.fullmatch(r"tiny-[0-9a-f]{8}", folder.name)
    assert "8 of 8 cells to do" in text
    metres = r"\d+\.\d{3} m, "
    words = rf"^\[8/8\] \S+: at the horizon {metres}nine in ten below {metres}H {metres}"
    assert re.search(words, text, re.MULTILINE)
    assert text.rstrip().endswith(f"report: {folder / 'report.html'}")
    answer = (folder / "answer.txt").read_text().splitlines()
    assert all(f"  {line}" in text for line in answer)
    assert len(answer) >= 4
    assert read_rows(folder)["H"].tolist() == read_rows(tiny_run)["H"].tolist()

    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Does the whole chain hold together?" in page
    assert re.search(r"shipid study run \S+tiny\.toml", page)
    assert "Does the whole chain hold together?" in (folder / "summary.md").read_text()

    (folder / "report.html").unlink()
    with without_figures():
        assert output_of("study", "report", folder).strip() == str(folder / "report.html")
    assert (folder / "report.html").is_file()
    next((folder / "batches").iterdir()).unlink()
    with without_workers(), without_figures():
        text = output_of("study", "resume", folder, "--workers", "1")
    assert "missing: computed again" in text
    assert "1 of 8 cells to do" in text
    assert output_of("study", "check", folder).strip() == "8 of 8 cells finished, 0 faults"

    cell = next(name for name in read_rows(folder)["cell"] if re.match(r"none\b.*-N0004-s0$", name))
    text = output_of("predict", folder, folder / DATASET, "--cell", cell)
    assert f"{12 * 21} instants, {12 * 21 * 5} points -> {cell}.parquet" in text
    points = pd.read_parquet(f"{cell}.parquet")
    assert len(points) == 12 * 21 * 5
    assert ("outside what the cell was trained on" in text) == points["outside"].any()


def test_an_incomplete_folder_has_a_provisional_report(tmp_path: Path, tiny_run: Path) -> None:
    import shutil

    folder = tmp_path / "run"
    shutil.copytree(tiny_run, folder)
    (folder / "batches" / "none+kernel-N0004-s0.json").unlink()
    (folder / "seals" / "none+kernel-N0004-s0.sha256").unlink()
    with without_figures():
        output_of("study", "report", folder)
    assert (folder / "answer.txt").read_text().startswith("1 of 8 cells are not finished")
    assert len(pd.read_parquet(folder / "results.parquet")["cell"].unique()) == 7


@pytest.mark.parametrize(("folder", "typed"), [("mine", "mine"), ("-my run", "'./-my run'")])
def test_interruption_says_how_to_go_on(folder: str, typed: str, study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from shipid.study import run

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "run_study", interrupted)
    result = CliRunner().invoke(app, ["study", "run", str(study), "--out", folder])
    assert result.exit_code == 130
    assert f"Continue with: shipid study resume {typed}\n" in result.stderr


def test_check_ends_with_1_where_a_file_is_wrong(tmp_path: Path, tiny_run: Path) -> None:
    import shutil

    folder = tmp_path / "run"
    shutil.copytree(tiny_run, folder)
    next((folder / "cells").iterdir()).unlink()
    result = CliRunner().invoke(app, ["study", "check", str(folder)])
    assert result.exit_code == 1
    assert "missing: `shipid study resume` computes it again" in result.output


def test_a_run_whose_lines_cannot_be_printed_gives_its_lock_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Standard output on a full disk: the events end before the process does."""
    taken: list[Any] = []

    def full(_: Any) -> str:
        raise OSError(errno.ENOSPC, "No space left on device")

    made = run.run_study
    monkeypatch.setattr(run, "run_study", lambda *given, **how: taken.append(made(*given, **how)) or taken[0])
    monkeypatch.setattr("shipid.answer.start.event_line", full)
    code, _, error = ended("study", "run", TINY, "--out", tmp_path / "run", "--workers", "1")
    assert (code, error) == (1, "error: system: No space left on device\n")
    assert taken[0].gi_frame is None, "the generator is closed"
