"""One version: of the package, of its metadata and of its file."""

from __future__ import annotations

import re
from pathlib import Path

import shipid
from shipid import version


def test_the_version_is_the_one_of_the_file() -> None:
    assert shipid.__version__ == version.__version__
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.dev\d+|rc\d+)?", version.__version__)


def test_the_file_imports_nothing() -> None:
    assert "import" not in Path(version.__file__).read_text(encoding="utf-8").split('"""')[2]
