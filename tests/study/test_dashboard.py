"""The trials of a run open in optuna-dashboard: its page, and every trial of every cell behind it."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from shipid.study.store import TRIALS, read_rows

START = """
from importlib.metadata import entry_points
(script,) = entry_points(group="console_scripts", name="optuna-dashboard")
script.load()()
"""


@pytest.fixture
def dashboard(tiny_run: Path, tmp_path: Path) -> Iterator[str]:
    """Address of a dashboard that shows the journal of a run, as `optuna-dashboard trials.log` does."""
    pytest.importorskip("optuna_dashboard", reason="optuna-dashboard is not installed: pip install 'shipid[dashboard]'")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-c", START, str(tiny_run / TRIALS), "--port", str(port), "--host", "127.0.0.1"]
    with (
        (tmp_path / "output.txt").open("w") as output,
        subprocess.Popen(command, stdout=output, stderr=output) as process,
    ):
        address = f"http://127.0.0.1:{port}"
        for _ in range(200):
            try:
                get(f"{address}/dashboard/")
                break
            except (urllib.error.URLError, ConnectionError):
                assert process.poll() is None, (tmp_path / "output.txt").read_text()
                time.sleep(0.5)
        yield address
        process.terminate()


def get(address: str) -> str:
    with urllib.request.urlopen(address, timeout=20) as answer:
        text: str = answer.read().decode()
        return text


@pytest.mark.slow
def test_the_dashboard_shows_every_trial(dashboard: str, tiny_run: Path) -> None:
    page = get(f"{dashboard}/dashboard/")
    assert "<title>Optuna Dashboard</title>" in page
    assert len(get(f"{dashboard}/static/bundle.js")) > 100_000, "the program of the page"
    rows = {row["cell"]: row["trials"] for row in read_rows(tiny_run).to_dict("records")}
    studies = json.loads(get(f"{dashboard}/api/studies"))["study_summaries"]
    assert {study["study_name"] for study in studies} == set(rows)
    for study in studies:
        shown = json.loads(get(f"{dashboard}/api/studies/{study['study_id']}"))["trials"]
        known = rows[study["study_name"]]
        assert [trial["values"][0] for trial in shown] == pytest.approx([trial["value"] for trial in known])
