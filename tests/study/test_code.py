"""The digest of the code: one for one code wherever it lies, another for any change."""

from __future__ import annotations

import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

import shipid
from shipid.study.code import code_digest, users_code


def digest_of(copy: Path) -> str:
    """What a process says that runs a copy of the package."""
    words = "from shipid.study.code import code_digest; print(code_digest())"
    command = [sys.executable, "-B", "-c", f"import sys; sys.path.insert(0, {str(copy)!r}); {words}"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def test_another_commit_of_the_same_version_has_another_digest(tmp_path: Path) -> None:
    package = Path(shipid.__file__).parent
    shutil.copytree(package, tmp_path / "shipid", ignore=shutil.ignore_patterns("__pycache__"))
    assert digest_of(tmp_path) == code_digest()
    file = tmp_path / "shipid" / "metrics.py"
    file.write_text(file.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    changed = digest_of(tmp_path)
    assert changed != code_digest()
    file.rename(file.with_name("measure.py"))
    assert digest_of(tmp_path) not in (changed, code_digest())


def test_what_a_method_of_a_user_imports_from_beside_it_is_part_of_its_code(tmp_path: Path) -> None:
    """A helper that changed left the digest as it was, so cells of two methods were mixed without a word."""
    files = {
        "mine.py": "import json\nfrom laws import *\nfrom parts.inner import law\nclass Mine: ...\n",
        "laws.py": "def load():\n    import slow.deep as deep\n",  # as late as when it is called
        "slow/deep.py": "import laws\n",  # a folder without __init__.py, and a ring
        "parts/__init__.py": "",
        "parts/inner.py": "from . import even\nfrom .odd import x as law\nimport beside\n",
        "parts/even.py": "",
        "parts/odd.py": "from ..parts.low import x\nx = 1\n",
        "parts/low.py": "x = 1\n",
        "parts/beside.py": "",  # what a script in the folder of a package imports
        "other.py": "",
        "json/other.py": "",
    }
    for name, text in files.items():
        place = tmp_path / name
        place.parent.mkdir(exist_ok=True)
        place.write_text(text, encoding="utf-8")

    def code() -> str:
        return users_code((type("Mine", (), {"__module__": "mine"}),))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("inspect.getfile", lambda _: str(tmp_path / "mine.py"))
        before = code()
        for name, text in files.items():
            (tmp_path / name).write_text(f"{text}# another\n", encoding="utf-8")
            assert (code() == before) == name.endswith("other.py"), name
            (tmp_path / name).write_text(text, encoding="utf-8")
        assert code() == before
        (tmp_path / "shipid").mkdir()
        (tmp_path / "shipid/__init__.py").write_text("x = 2")  # a copy of shipid has a digest of its own
        (tmp_path / "laws.py").write_text(f"{files['laws.py']}    import shipid.x\n", encoding="utf-8")
        with_it = code()
        (tmp_path / "shipid/__init__.py").write_text("x = 3")
        assert code() == with_it
        (tmp_path / "laws.py").write_text("def (", encoding="utf-8")
        assert code() != before


def test_other_installed_packages_are_no_part_of_a_method(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They lie beside its package, and so does all that is installed: a walk over that took minutes."""
    place = tmp_path / "site-packages"
    for name, text in {
        "mine/__init__.py": "import numpy, mine.law",
        "mine/law.py": "x = 1",
        "numpy.py": "x = 1",
    }.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_text(text, encoding="utf-8")
    monkeypatch.setattr("inspect.getfile", lambda _: str(place / "mine" / "__init__.py"))

    def code() -> str:
        return users_code((type("Mine", (), {"__module__": "mine"}),))

    before = code()
    (place / "numpy.py").write_text("x = 2", encoding="utf-8")
    assert code() == before
    (place / "mine/law.py").write_text("x = 2", encoding="utf-8")
    assert code() != before


def test_functions_of_a_user_have_a_digest_in_any_dress() -> None:
    """A term may hold a plain function, a part of one, or an object that is called."""

    class Called:
        def __call__(self) -> None: ...

    def plain() -> None: ...

    users = (plain, partial(plain), Called(), lambda: None)
    assert len({users_code((one,)) for one in users}) == 1  # all are in this file
    assert users_code(users) != "unknown"
