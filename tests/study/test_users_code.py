"""Code of a user: local workers have it, or one sentence says so before anything is computed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.documented import code
from tests.study.tiny import TINY

ROOT = Path(__file__).parents[2]
METHOD = code("A method")[0]
LISTED = """
from shipid.hybrid.methods import METHODS
METHODS["linear"] = Linear
"""
TERM = code("A term")[1]
SHIP = 'extends = "gunnerus-28.9"\n[hull.skeg]\nx = -10.0\nA = 6.0\nC = 1.8\nsource = "-"\n'
RUN = f"""
import shipid
if __name__ == "__main__":
    change = {{"method": [{{"name": "own", "kind": "linear", "trials": 2}}], "grid.N_D": [4]}}
    print(len(shipid.run({str(TINY)!r}, set=change, out="run", workers=1).cells))
"""
RUN_TERM = f"""
import shipid
if __name__ == "__main__":
    change = {{"truth.vessel": "./ship.toml", "family.0.base": "./ship.toml", "grid.N_D": [4]}}
    print(len(shipid.run({str(TINY)!r}, set=change, out="run", workers=1).cells))
"""


def ended(folder: Path, *command: str) -> str:
    """The last line that a command of Python prints, to either stream."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(folder)])}
    done = subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        env=environment,
        check=False,
    )
    return (done.stdout + done.stderr).splitlines()[-1]


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        (METHOD + LISTED + RUN, "there it does not go (AttributeError: "),
        (TERM + RUN_TERM, "workers lack the term 'hull.skeg': write it into a file that they can import"),
    ],
)
def test_code_that_workers_lack_is_one_line(cells: str, words: str, tmp_path: Path) -> None:
    """A method and a term of cells of a notebook."""
    (tmp_path / "ship.toml").write_text(SHIP)
    line = ended(tmp_path, "-c", cells)
    assert line.startswith("shipid.errors.ShipidError: ")
    assert words in line


@pytest.mark.slow
def test_code_in_a_file_or_for_this_process_runs(tmp_path: Path) -> None:
    """The line of a method, or of a term, may be in a cell: a worker imports the class. It ended with a KeyError."""
    (tmp_path / "mine.py").write_text(METHOD)
    assert ended(tmp_path, "-c", "from mine import Linear" + LISTED + RUN) == "4"
    assert ended(tmp_path, "-c", METHOD + LISTED + RUN.replace("workers=1", "workers=0")) == "4"
    (tmp_path / "ship.toml").write_text(SHIP)
    function, listed = TERM.split("\n\n\nTERMS")
    (tmp_path / "skeg.py").write_text(function)
    cell = f"from skeg import skeg\nfrom shipid.physics import TERMS, Term\nTERMS{listed}{RUN_TERM}"
    assert ended(tmp_path, "-c", cell.replace('"run"', '"term"')) == "4"
    assert ended(tmp_path, "-c", TERM + RUN_TERM.replace('"run", workers=1', '"other", workers=0')) == "4"


def test_a_script_from_standard_input_is_named(tmp_path: Path) -> None:
    alone = RUN.replace('"linear", "trials": 2', '"alone"')
    piped = f"import subprocess, sys; subprocess.run([sys.executable, '-'], input={alone!r}, text=True)"
    words = "a script from standard input cannot start workers: save it as a file, and run that"
    assert ended(tmp_path, "-c", piped) == f"shipid.errors.ShipidError: {words}"
    assert not (tmp_path / "run").exists()
