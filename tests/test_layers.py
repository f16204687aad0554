"""The contracts of pyproject.toml: the package keeps them, and an import that breaks one is refused."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

FORBIDDEN = {
    "casadi": ("study/planted.py", "import casadi"),
    "torch": ("simulation/planted.py", "import torch"),
    "torch, inside a function": ("study/planted.py", "def work():\n    from torch import nn\n    return nn"),
    "optuna": ("identification/planted.py", "import optuna"),
    "dask": ("study/planted.py", "from dask.distributed import Client"),
    "plotly and jinja2": ("hybrid/planted.py", "import plotly.graph_objects"),
    "rich and typer": ("study/planted.py", "from rich.console import Console"),
    "readers of foreign formats": ("data/planted.py", "import pymap3d"),
    "floors: physics imports the vessel": ("physics/planted.py", "import shipid.vessel.load"),
    "floors: data import logs": ("data/planted.py", "from shipid.logs.importing import import_log"),
    "floors: hybrid and identification": ("hybrid/planted.py", "import shipid.identification.solve"),
    "floors: the report imports a study": ("report/planted.py", "from shipid.study import plan"),
    "floors: a module without a floor": ("planted.py", "import math"),
}
"""What is forbidden -> file of the package and its text."""


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package and of pyproject.toml."""
    folder = tmp_path_factory.mktemp("layers")
    shutil.copytree(ROOT / "shipid", folder / "shipid", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


@pytest.fixture
def planted(package: Path, request: pytest.FixtureRequest) -> Iterator[Path]:
    """The copy with one file more."""
    name, text = request.param
    file = package / "shipid" / name
    file.write_text(f'"""Planted."""\n\n{text}\n', encoding="utf-8")
    yield package
    file.unlink()


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """Check the contracts of the package in a folder, and of no other that is installed."""
    code = (
        "import sys; sys.path.insert(0, '.'); from importlinter.cli import lint_imports_command; lint_imports_command()"
    )
    command = [sys.executable, "-I", "-c", code, "--no-cache"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


def test_the_package_keeps_the_contracts(package: Path) -> None:
    result = lint(package)
    assert result.returncode == 0, result.stdout + result.stderr
    assert " 0 broken" in result.stdout


@pytest.mark.parametrize("planted", FORBIDDEN.values(), ids=FORBIDDEN, indirect=True)
def test_a_forbidden_import_is_refused(planted: Path) -> None:
    result = lint(planted)
    assert result.returncode == 1, result.stdout + result.stderr
    assert "planted" in result.stdout
