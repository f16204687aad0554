"""The contracts of pyproject.toml: the package keeps them, and an import that breaks one is refused."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import grimp
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

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


def cycles(graph: grimp.ImportGraph) -> list[set[str]]:
    """Sets of two modules or more that reach each other."""
    modules = sorted(graph.modules)
    imports = [
        (row, modules.index(other))
        for row, one in enumerate(modules)
        for other in graph.find_modules_directly_imported_by(one)
    ]
    ends = tuple(zip(*imports, strict=True))
    edges = coo_array(([1] * len(imports), ends), shape=(len(modules), len(modules)))
    count, labels = connected_components(edges, connection="strong")
    parts = [{module for module, label in zip(modules, labels, strict=True) if label == part} for part in range(count)]
    return [part for part in parts if len(part) > 1]


def test_no_module_imports_itself_by_way_of_others() -> None:
    """A type alone may be imported both ways: nothing runs then."""
    graph = grimp.build_graph("shipid", cache_dir=None, exclude_type_checking_imports=True)
    assert cycles(graph) == []


def test_no_two_modules_name_each_other() -> None:
    """Not even for a type: a file can be understood without those that use it."""
    graph = grimp.build_graph("shipid", cache_dir=None)
    imports = {(one, other) for one in graph.modules for other in graph.find_modules_directly_imported_by(one)}
    assert [pair for pair in sorted(imports) if pair[::-1] in imports] == []


def test_a_planted_circle_is_seen() -> None:
    graph = grimp.build_graph("shipid", cache_dir=None)
    graph.add_import(importer="shipid.units", imported="shipid.predictor")
    graph.add_import(importer="shipid.predictor", imported="shipid.units")
    assert any({"shipid.units", "shipid.predictor"} <= circle for circle in cycles(graph))
