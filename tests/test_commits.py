"""Every example of docs/extending.md as a commit in a copy of the tree: it passes `make check` and the laws there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.documented import add, commit

ROOT = Path(__file__).parents[1]
#: sections of the page that are one commit -> what is asked of the copy then: tests, and words that select some of them
LAWS = {
    ("A signal", "A term"): ["tests/test_laws.py", "tests/physics", "tests/logs/guess/test_words.py"],
    ("A manoeuvre",): [
        *("tests/simulation/test_manoeuvre.py", "tests/simulation/test_standard.py"),
        *("-k", "not (example or first_order_after)"),  # they ask for the example that a commit brings
    ],
    ("A log reader",): ["tests/logs/test_readers.py"],
    ("A family rule",): ["tests/vessel/test_perturb.py"],
    ("A method",): ["tests/hybrid/test_methods.py", "tests/hybrid/test_search.py", "-k", "linear"],
    ("A section of the report",): ["tests/report/test_sections.py", "tests/report/test_page.py"],
}


def run(tree: Path, *words: str) -> None:
    """Run a module of Python in a tree; its output where it fails."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONHASHSEED": "0", "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", *words]
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(words)}\n{done.stdout[-4000:]}{done.stderr[-2000:]}"


def tree_of(folder: Path) -> Path:
    """A copy of the files of the repository."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes((ROOT / name).read_bytes())
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("headings", LAWS, ids=" and ".join)
def test_an_example_of_the_page_is_a_good_commit(headings: tuple[str, ...], tmp_path: Path) -> None:
    tree = tree_of(tmp_path)
    files = [file for heading in headings for file in commit(tree, heading)]
    names = sorted({str(file.relative_to(tree)) for file in files})
    run(tree, "ruff", "check", "--quiet", "--fix", "--select", "I,F811", *names)  # the order of imports is the tool's
    run(tree, "ruff", "format", "--quiet", *names)
    for words in (["ruff", "check", "--quiet"], ["mypy", "--no-incremental"]):
        run(tree, *words, *names)
    laws = ["tests/test_mirror.py", *LAWS[headings]]
    run(tree, "pytest", "-n", "0", "-q", "-m", "not slow", "-p", "no:cacheprovider", *laws)


def test_a_wrong_example_is_seen(tmp_path: Path) -> None:
    """An entry for a table that the file does not have, and one that no import of the file reaches."""
    file = tmp_path / "shipid" / "tables.py"
    file.parent.mkdir()
    file.write_text('"""Tables."""\n\nimport math\n\nNAMES: dict[str, float] = {\n    "one": math.pi,\n}\n')
    add(file, 'import cmath\n\nNAMES = {\n    "two": cmath.pi,\n}\n')
    space: dict[str, dict[str, float]] = {}
    exec(file.read_text(), space)
    assert list(space["NAMES"]) == ["one", "two"]
    with pytest.raises(AssertionError, match="no table OTHERS"):
        add(file, 'OTHERS = {\n    "three": 3.0,\n}\n')
