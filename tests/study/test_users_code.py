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
TERM = f"""
{code("A term")[1]}
from shipid.physics import TERMS, Term
TERMS["hull.skeg"] = Term(skeg)
"""
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
    shipid.run({str(TINY)!r}, set=change, out="run", workers=1)
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
    ("cells", "what", "remedy"),
    [
        (METHOD + LISTED + RUN, "method 'own'", ": write it into a file, such as my_method.py, and import it from"),
        (TERM + RUN_TERM, "term 'hull.skeg'", ": write it, with its line TERMS[...] = ..., into a script, as my.py"),
    ],
)
def test_what_a_notebook_registered_is_refused_before_anything_is_computed(
    cells: str, what: str, remedy: str, tmp_path: Path
) -> None:
    """Before, it ended with an AttributeError or a KeyError after the truth was simulated."""
    (tmp_path / "ship.toml").write_text(SHIP)
    line = ended(tmp_path, "-c", cells)
    words = "workers are processes, which do not see what a cell or a console defines: they lack the"
    assert line.startswith(f"shipid.errors.ShipidError: {words} {what}"), line
    assert remedy in line
    assert not (tmp_path / "run").exists()


def test_a_line_below_the_guard_is_named(tmp_path: Path) -> None:
    (tmp_path / "ship.toml").write_text(SHIP)
    (tmp_path / "my.py").write_text(TERM.replace("TERMS[", "if __name__ == '__main__':\n    TERMS[") + RUN_TERM)
    line = ended(tmp_path, "my.py")
    assert line.endswith('above the line `if __name__ == "__main__":`'), line
    assert "lack the term 'hull.skeg': they import your script" in line


def test_a_file_that_changed_after_its_import_is_named(tmp_path: Path) -> None:
    """A worker imports it as it is now: a notebook computed by another method than it had read."""
    (tmp_path / "mine.py").write_text(METHOD)
    known = "from mine import Linear\nimport shipid\nfrom shipid.study.code import users_code\n"
    later = "users_code((Linear, Linear.corrector))\nopen('mine.py', 'a').write('# edited')\n"
    line = ended(tmp_path, "-c", known + later + LISTED + RUN)
    assert "the file of the method 'own', or one that it imports, has changed since it was imported" in line


def test_a_file_that_a_changed_file_is_imported_by_is_not_said_to_have_changed(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(METHOD + "import helper\n")
    (tmp_path / "helper.py").write_text("SHARE = 0.5\n")
    known = "from mine import Linear\nimport shipid\nfrom shipid.study.code import users_code\n"
    later = "users_code((Linear, Linear.corrector))\nopen('helper.py', 'a').write('SHARE = 0.6')\n"
    line = ended(tmp_path, "-c", known + later + LISTED + RUN)
    assert line.endswith(", or one that it imports, has changed since it was imported: start this process again"), line


@pytest.mark.parametrize(
    ("in_a_worker", "error"),
    [
        ("raise OSError('no camera\\nis there')", "OSError: no camera is there"),
        ("{}['SHIPS']", "KeyError: 'SHIPS'"),
        ("raise AttributeError", "AttributeError"),
    ],
)
def test_a_file_that_a_worker_cannot_import_is_named_with_its_error(
    in_a_worker: str, error: str, tmp_path: Path
) -> None:
    """The class is in a file already: it said that workers do not see what a cell defines."""
    failing = f"import multiprocessing\nif multiprocessing.parent_process():\n    {in_a_worker}\n"
    (tmp_path / "mine.py").write_text(METHOD + failing)
    line = ended(tmp_path, "-c", "from mine import Linear" + LISTED + RUN)
    assert line == f"shipid.errors.ShipidError: a worker cannot import the method 'own': {error}"


def test_a_module_that_was_loaded_by_its_path_cannot_be_imported_by_a_worker(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "mine.py").write_text(METHOD)
    loaded = """
import sys
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location("by_path", "elsewhere/mine.py")
sys.modules["by_path"] = module = module_from_spec(spec)
spec.loader.exec_module(module)
Linear = module.Linear
"""
    line = ended(tmp_path, "-c", loaded + LISTED + RUN)
    error = "ModuleNotFoundError: No module named 'by_path'"
    assert line == f"shipid.errors.ShipidError: a worker cannot import the method 'own': {error}"


def test_a_term_of_a_file_whose_line_is_in_a_cell_needs_a_script(tmp_path: Path) -> None:
    (tmp_path / "ship.toml").write_text(SHIP)
    (tmp_path / "skegs.py").write_text(code("A term")[1])
    listed = "from shipid.physics import TERMS, Term\nTERMS['hull.skeg'] = Term(skeg)\n"
    line = ended(tmp_path, "-c", "from skegs import skeg\n" + listed + RUN_TERM)
    assert "they lack the term 'hull.skeg': write it, with its line TERMS[...] = ..., into a script, as my.py" in line


@pytest.mark.slow
def test_a_method_in_a_file_needs_no_script(tmp_path: Path) -> None:
    """Its line in METHODS may be in a cell: a worker imports the class. It ended with a KeyError."""
    (tmp_path / "mine.py").write_text(METHOD)
    assert ended(tmp_path, "-c", "from mine import Linear" + LISTED + RUN) == "4"


def test_a_script_from_standard_input_is_named(tmp_path: Path) -> None:
    program = RUN.replace('"linear", "trials": 2', '"alone"')
    with (tmp_path / "script.py").open("w+") as script:
        script.write(program)
        script.seek(0)
        done = subprocess.run(
            [sys.executable, "-"],
            stdin=script,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
    words = "a script from standard input cannot start workers: save it as a file, and run that"
    assert done.stderr.splitlines()[-1] == f"shipid.errors.ShipidError: {words}"
    assert not (tmp_path / "run").exists()
