"""The tiny study as a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.study.tiny import TINY


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The tiny study in a new folder, which is the working folder."""
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "tiny.toml"
    file.write_text(TINY.read_text())
    return file
