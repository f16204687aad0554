"""The contracts of pyproject.toml: the package keeps them, and an import that breaks one is refused."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

FORBIDDEN = {
    "casadi": ("study", "import casadi"),
    "torch": ("simulation", "import torch"),
    "torch, inside a function": ("study", "def work():\n    from torch import nn\n    return nn"),
    "optuna": ("identification", "import optuna"),
    "dask": ("study", "from dask.distributed import Client"),
    "plotly and jinja2": ("hybrid", "import plotly.graph_objects"),
    "typer": ("study", "import typer"),
    "readers of foreign formats": ("data", "import pymap3d"),
    "floors: physics imports the vessel": ("physics", "import shipid.vessel.load"),
    "floors: data import logs": ("data", "from shipid.logs.importing import import_log"),
    "floors: hybrid and identification": ("hybrid", "import shipid.identification.solve"),
    "floors: the report imports a study": ("report", "from shipid.study import plan"),
    "floors: a module without a floor": ("", "import math"),
}
"""What is forbidden -> folder of the package and the text of a file there."""
PLANTED = {name: f"planted_{index}x" for index, name in enumerate(FORBIDDEN)}


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package and of pyproject.toml."""
    folder = tmp_path_factory.mktemp("layers")
    shutil.copytree(ROOT / "shipid", folder / "shipid", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


@pytest.fixture(scope="module")
def refused(package: Path) -> str:
    """The report on the copy with a file more for everything that is forbidden."""
    files = []
    for name, (folder, text) in FORBIDDEN.items():
        files.append(package / "shipid" / folder / f"{PLANTED[name]}.py")
        files[-1].write_text(f'"""Planted."""\n\n{text}\n', encoding="utf-8")
    result = lint(package)
    for file in files:
        file.unlink()
    assert result.returncode == 1, result.stdout + result.stderr
    return result.stdout


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """Check the contracts of the package in a folder, and of no other that is installed."""
    code = (
        "import sys; sys.path.insert(0, '.'); from importlinter.cli import lint_imports_command; lint_imports_command()"
    )
    command = [sys.executable, "-I", "-c", code, "--no-cache"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600, check=False)


def test_the_package_keeps_the_contracts(package: Path) -> None:
    result = lint(package)
    assert result.returncode == 0, result.stdout + result.stderr
    assert " 0 broken" in result.stdout


@pytest.mark.parametrize("name", FORBIDDEN)
def test_a_forbidden_import_is_refused(name: str, refused: str) -> None:
    assert PLANTED[name] in refused
