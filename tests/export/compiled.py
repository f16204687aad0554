"""Exported C, compiled and called from Python."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.export.c import Files
from shipid.export.model import Model

FLAGS = ("-std=c99", "-include", "stdbool.h", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
SANITIZERS = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def compiler() -> str:
    """A C compiler; the test is skipped where there is none."""
    program = shutil.which("gcc") or shutil.which("cc") or shutil.which("clang")
    if program is None:
        pytest.skip("no C compiler")
    return program


def write(files: Files, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def compile_(command: list[str], folder: Path, *arguments: str) -> None:
    """Run a compiler in an empty environment; the test fails with its message."""
    result = subprocess.run(
        [*command, *FLAGS, *arguments, "-lm"],
        cwd=folder, capture_output=True, text=True, env={"PATH": "/usr/bin:/bin", "TMPDIR": str(folder)},
    )  # fmt: skip
    assert result.returncode == 0, result.stderr[:2000]
    assert not result.stderr


_BUILT: dict[tuple[object, ...], Path] = {}  # text and options -> the library of the first test that compiled them


def library(files: Files, folder: Path, *options: str) -> ctypes.CDLL:
    """The source as a shared library; the same source is compiled once."""
    write(files, folder)
    key = (files.name, *sorted(files.texts.items()), *options)
    if key not in _BUILT:
        compile_([compiler()], folder, *(options or ("-O0",)), "-shared", "-fPIC", "-o", "model.so", f"{files.name}.c")
        _BUILT[key] = folder / "model.so"
    return ctypes.CDLL(str(_BUILT[key]))


def run_example(files: Files, folder: Path, *options: str) -> str:
    """Output of the example."""
    write(files, folder)
    compile_([compiler()], folder, *(options or ("-O0",)), "-o", "example", "main.c", f"{files.name}.c")
    result = subprocess.run([folder / "example"], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def paths(
    loaded: ctypes.CDLL, name: str, model: Model, instants: Instants, kind: type = np.float64
) -> tuple[np.ndarray, np.ndarray]:
    """Paths (T, S, 2) and results (S,) of the pure function."""
    given = {key: np.ascontiguousarray(values, dtype=kind) for key, values in model.inputs(instants).items()}
    function = getattr(loaded, f"{name}_path")
    predicted = np.zeros((len(instants), model.layout.horizon, 2), dtype=kind)
    results = [
        function(*(pointer(given[key][i]) for key in model.layout.sizes), pointer(predicted[i]))
        for i in range(len(instants))
    ]
    return predicted.swapaxes(0, 1), np.array(results)


def bands(
    loaded: ctypes.CDLL, name: str, model: Model, instants: Instants, path: np.ndarray, *asked: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (T, S, 4) of the band around paths (T, S, 2) for level, pointwise, kind, and results (S,)."""
    now = np.ascontiguousarray(model.inputs(instants)["now"], dtype=float)
    function, around = getattr(loaded, f"{name}_band"), np.ascontiguousarray(path.swapaxes(0, 1))
    function.argtypes = [ctypes.c_void_p] * 2 + [ctypes.c_double] + [ctypes.c_int] * 2 + [ctypes.c_void_p]
    regions = np.zeros((len(instants), model.layout.horizon, 4))
    results = [function(pointer(now[i]), pointer(around[i]), *asked, pointer(regions[i])) for i in range(len(instants))]
    return regions.swapaxes(0, 1), np.array(results)
