"""What the tests of engines share."""

from __future__ import annotations

from pathlib import Path

import pytest

QUICK = ("-O0", "-fPIC", "-shared", "-pthread", "-w")  # options of the C compiler where speed is not the point


@pytest.fixture(scope="session")
def libraries_kept(pytestconfig: pytest.Config, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the tests compile: not in the user's cache, but in that of pytest, which keeps it from run to run."""
    kept = getattr(pytestconfig, "cache", None)
    return tmp_path_factory.mktemp("libraries") if kept is None else Path(kept.mkdir("libraries"))
