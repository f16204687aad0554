"""The digest of the code: one for one code wherever it lies, another for any change."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import shipid
from shipid.study.code import code_digest


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
