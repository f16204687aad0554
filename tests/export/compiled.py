"""Exported C, compiled and called from Python."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.data.windows import Instants
from shipid.export.c import NumberPrecision, SourceFiles
from shipid.export.c_predictor import predictor_files
from shipid.export.model import ExportModel, build_model
from shipid.hybrid.deployed import DeployedMethod

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
GENERATED = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wno-unused-parameter")
SANITIZERS = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def compiler() -> str:
    """A C compiler; the test is skipped where there is none."""
    program = shutil.which("gcc") or shutil.which("cc") or shutil.which("clang")
    if program is None:
        pytest.skip("no C compiler")
    return program


def write(files: SourceFiles, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def compile_(command: list[str], folder: Path, *arguments: str) -> None:
    """Run a compiler in an empty environment, CasADi's sources apart; the test fails with its message."""
    generated = [one for one in arguments if one.endswith("_casadi.c")]
    others = [one.replace("_casadi.c", "_casadi.o") for one in arguments]
    options = [one for one in arguments if one[0] == "-" and one not in ("-o", "-shared", "-Wsign-conversion")]
    calls = [[*command, *GENERATED, *options, "-c", one, "-o", one[:-1] + "o"] for one in generated]
    for call in (*calls, [*command, *FLAGS, *others, "-lm"]):
        environment = {"PATH": "/usr/bin:/bin", "TMPDIR": str(folder)}
        result = subprocess.run(call, cwd=folder, capture_output=True, text=True, env=environment)
        assert (result.returncode, result.stderr[:2000]) == (0, "")


_BUILT: dict[tuple[object, ...], Path] = {}  # text and options -> the library of the first test that compiled them


def sources(files: SourceFiles) -> list[str]:
    return [name for name in files.texts if name.endswith(".c") and name != "main.c"]


def library(files: SourceFiles, folder: Path, *options: str) -> ctypes.CDLL:
    """The source as a shared library; the same source is compiled once."""
    write(files, folder)
    key = (files.name, *sorted(files.texts.items()), *options)
    if key not in _BUILT:
        compile_([compiler()], folder, *(options or ("-O0",)), "-shared", "-fPIC", "-o", "model.so", *sources(files))
        _BUILT[key] = folder / "model.so"
    return ctypes.CDLL(str(_BUILT[key]))


def run_example(files: SourceFiles, folder: Path, *options: str) -> str:
    """Output of the example."""
    write(files, folder)
    compile_([compiler()], folder, *(options or ("-O0",)), "-o", "example", "main.c", *sources(files))
    result = subprocess.run([folder / "example"], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


class Recorder:
    """An exported predictor that is given rows."""

    def __init__(self, predictor: DeployedMethod, folder: Path, precision: NumberPrecision | None = None) -> None:
        self.model, precision = build_model(predictor), precision or NumberPrecision()
        self.files, self.real = predictor_files(self.model, "odd", precision), np.dtype(precision.real)
        write(self.files, folder)
        (folder / "size.c").write_text(
            '#include <stdio.h>\n#include "odd.h"\nint main(void) { printf("%d", (int)sizeof(odd)); return 0; }\n'
        )
        compile_([compiler()], folder, "-O0", "-o", "size", "size.c")
        size = int(subprocess.run([folder / "size"], capture_output=True, text=True, check=True).stdout)
        self.loaded, self.kept = library(self.files, folder), np.zeros(size, dtype=np.uint8)
        self.loaded.odd_record.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
        self.begin()

    def begin(self) -> None:
        self.loaded.odd_init(pointer(self.kept))

    def record(self, t: float, values: Mapping[str, float]) -> int:
        """Result of a row; what `values` lacks is 0."""
        row = np.array([values.get(name, 0.0) for name in self.model.layout.now], dtype=self.real)
        return int(self.loaded.odd_record(pointer(self.kept), t, pointer(row)))

    def predict(self, plan: np.ndarray | None = None) -> tuple[np.ndarray, int]:
        """Path (T, 2) from the newest row, and its result."""
        path = np.zeros((self.model.layout.horizon, 2), dtype=self.real)
        given = None if plan is None else pointer(np.ascontiguousarray(plan, dtype=self.real))
        return path, int(self.loaded.odd_predict(pointer(self.kept), given, pointer(path)))

    def path(self, t: float, values: Mapping[str, float], plan: np.ndarray | None = None) -> tuple[np.ndarray, int]:
        """Path and result after one more row, which is kept."""
        assert self.record(t, values) == 0
        return self.predict(plan)

    def follow(self, rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
        """Paths (T, N, 2) and results (N,) from each row of a log, from the first on."""
        self.begin()
        paths, results = zip(*(self.path(row["t"], row) for row in rows.to_dict("records")), strict=True)
        return np.stack(paths, axis=1), np.array(results)


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def paths(
    loaded: ctypes.CDLL, name: str, exported: ExportModel, instants: Instants, kind: type = np.float64
) -> tuple[np.ndarray, np.ndarray]:
    """Paths (T, S, 2) and results (S,) of the pure function."""
    given = {key: np.ascontiguousarray(values, dtype=kind) for key, values in exported.inputs(instants).items()}
    function = getattr(loaded, f"{name}_path")
    predicted = np.zeros((len(instants), exported.layout.horizon, 2), dtype=kind)
    work = np.zeros(1_000_000)
    results = [
        function(*(pointer(given[key][i]) for key in exported.layout.sizes), pointer(predicted[i]), pointer(work))
        for i in range(len(instants))
    ]
    return predicted.swapaxes(0, 1), np.array(results)


def bands(
    loaded: ctypes.CDLL, name: str, exported: ExportModel, instants: Instants, *asked: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Paths (T, S, 2) and rows (T, S, 4) of their bands for level, pointwise, kind, and results (S,)."""
    given = {key: np.ascontiguousarray(values, dtype=float) for key, values in exported.inputs(instants).items()}
    function, size = getattr(loaded, f"{name}_path_band"), (len(instants), exported.layout.horizon)
    function.argtypes = [ctypes.c_void_p] * 6 + [ctypes.c_double] + [ctypes.c_int] * 2 + [ctypes.c_void_p] * 3
    predicted, regions, work = np.zeros((*size, 2)), np.zeros((*size, 4)), np.zeros(1_000_000)
    results = [
        function(*(pointer(given[key][i]) for key in exported.layout.sizes), *asked,
                 *map(pointer, (predicted[i], regions[i], work)))
        for i in range(len(instants))
    ]  # fmt: skip
    return predicted.swapaxes(0, 1), regions.swapaxes(0, 1), np.array(results)
