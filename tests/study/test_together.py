"""Many processes on one plan in one folder, as users start them: they die, join and leave, and change no digit."""

from __future__ import annotations

import os
import re
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pytest
import tomlkit

from shipid.files import TEMPORARY
from shipid.study import seals
from shipid.study.claims import held
from tests.faults.folders import stored
from tests.study.tiny import mixed_plan

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "cluster.md"
PROGRAM = [sys.executable, "-m", "shipid", "study", "run"]
#: A stand-in for SLURM: every task of the array at once, each a process, with what SLURM sets; the job ends with them.
SBATCH = """#!{python}
import os, re, subprocess, sys
script = sys.argv[-1]
text = open(script).read()
array = [word for word in sys.argv[1:-1] if word.startswith("--array=")]
array = array or re.findall(r"^#SBATCH (--array=\\S+)", text, re.M)
first, last = map(int, array[-1].removeprefix("--array=").split("-"))
assert last - first < 5, "a test starts no more"
tasks = []
for number in range(first, last + 1):
    log = open(f"task-{{number}}.log", "w")
    given = {{"SLURM_ARRAY_TASK_ID": str(number), "SLURM_SUBMIT_DIR": os.getcwd()}}
    tasks.append(subprocess.Popen(["bash", script], env=os.environ | given, stdout=log, stderr=log))
print("Submitted batch job 1")
sys.exit(max(task.wait() for task in tasks))
"""


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT), **more}


@contextmanager
def process(study: Path, folder: Path, *more: str) -> Iterator[subprocess.Popen[str]]:
    """One of the processes, ended with its workers."""
    command = [*PROGRAM, str(study), "--out", str(folder), "--workers", "1", *more]
    out = subprocess.PIPE
    with subprocess.Popen(command, env=environment(), stdout=out, stderr=subprocess.STDOUT, text=True) as one:
        try:
            yield one
        finally:
            one.kill()


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """Two amounts of data, 14 units of work, some of which take a second."""
    plan = mixed_plan(tmp_path, {"grid": {"N_D": [4, 6]}})
    methods = [{**method, **({"epochs": 300} if "epochs" in method else {})} for method in plan.document["method"]]
    file = tmp_path / "mixed.toml"
    file.write_text(tomlkit.dumps({**plan.document, "method": methods}))
    return file


@pytest.fixture
def alone(study: Path, tmp_path: Path) -> Path:
    """The folder of a single process."""
    with process(study, tmp_path / "alone") as one:
        text, _ = one.communicate(timeout=600)
    assert one.returncode == 0, text
    return tmp_path / "alone"


def same(folder: Path, other: Path) -> None:
    """Every predictor and row equal, bit by bit; the tables; nothing is left over."""
    files, expected = stored(folder), stored(other)
    assert files.keys() == expected.keys()
    assert [name for name in files if files[name] != expected[name]] == []
    tables = [pd.read_parquet(place / "results.parquet") for place in (folder, other)]
    pd.testing.assert_frame_equal(*(table[table["metric"] != "seconds"] for table in tables), check_exact=True)
    assert seals.faults(folder) == []
    assert held(folder) == []
    assert not list(folder.rglob(f"{TEMPORARY}*"))
    assert (folder / "report.html").is_file()


def until(what: str, folder: Path, count: int) -> None:
    """Wait until so many files match a pattern in a folder."""
    for _ in range(3000):
        if len(list(folder.glob(what))) >= count:
            return
        time.sleep(0.05)
    raise AssertionError(f"no {what}")


@pytest.mark.slow
def test_three_processes_one_killed_one_joining(study: Path, alone: Path, tmp_path: Path) -> None:
    folder = tmp_path / "together"
    with process(study, folder) as first, process(study, folder, "--leave") as second:
        until("seals/*-s0.sha256", folder, 2)
        first.send_signal(signal.SIGKILL)
        with process(study, folder) as third:
            text, _ = third.communicate(timeout=600)
            output, _ = second.communicate(timeout=600)
    assert (second.returncode, third.returncode) == (0, 0), output + text
    assert f"report: {folder / 'report.html'}" in text
    same(folder, alone)


@pytest.mark.slow
def test_the_documented_job_array(study: Path, alone: Path, tmp_path: Path) -> None:
    """The script of the page, submitted to a stand-in that runs the tasks of the array on this machine."""
    (script,) = re.findall(r"```bash\n(#!/bin/bash\n.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    work = tmp_path / "work"
    (tmp_path / "bin").mkdir()
    work.mkdir()
    (work / "shipid.sh").write_text(script)
    programs = {"sbatch": SBATCH.format(python=sys.executable)}
    programs["shipid"] = f'#!/bin/bash\nexec {sys.executable} -m shipid "$@"\n'
    for name, text in programs.items():
        file = tmp_path / "bin" / name
        file.write_text(text)
        file.chmod(file.stat().st_mode | stat.S_IXUSR)
    given = environment(PATH=f"{tmp_path / 'bin'}:{os.environ['PATH']}", STUDY=str(study), FOLDER="results/mixed")
    command = ["sbatch", "--array=1-3", "shipid.sh"]
    done = subprocess.run(command, cwd=work, env=given, capture_output=True, text=True, timeout=900)
    logs = [file.read_text() for file in sorted(work.glob("task-*.log"))]
    assert done.returncode == 0, (done.stderr, logs)
    assert len(logs) == 3
    assert sum("report: " in text for text in logs) >= 1
    assert all("report: " in text or "others work on the last" in text for text in logs)
    same(work / "results" / "mixed", alone)
