"""Exported C, compiled and called from Python."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.data.windows import Instants
from shipid.export.c import SourceFiles
from shipid.export.c_predictor import predictor_files
from shipid.export.model import ExportModel, build_model
from shipid.hybrid.mean import DeployedMethod

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
GENERATED = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
SANITIZERS = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


def compiler(*names: str) -> str:
    """The first C compiler of these names that there is, or any; the test is skipped where there is none."""
    program = next(filter(None, map(shutil.which, names or ("gcc", "cc", "clang"))), None)
    if program is None:
        pytest.skip(f"there is no {' or '.join(names) or 'C compiler'} here")
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


def run_example(files: SourceFiles, folder: Path, *options: str, names: Sequence[str] = ()) -> str:
    """Output of the example, by a compiler of these names."""
    write(files, folder)
    compile_([compiler(*names)], folder, *(options or ("-O0",)), "-o", "example", "main.c", *sources(files))
    result = subprocess.run([folder / "example"], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


class Recorder:
    """An exported predictor that is given rows."""

    def __init__(self, predictor: DeployedMethod, folder: Path) -> None:
        self.model = build_model(predictor)
        self.files = predictor_files(self.model, "odd")
        write(self.files, folder)
        (folder / "size.c").write_text(
            '#include <stdio.h>\n#include "odd.h"\nint main(void) { printf("%d", (int)sizeof(odd_recorder)); }\n'
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
        row = np.array([values.get(name, 0.0) for name in self.model.layout.now])
        return int(self.loaded.odd_record(pointer(self.kept), t, pointer(row)))

    def predict(self, plan: np.ndarray | None = None) -> tuple[np.ndarray, int]:
        """Path (T, 2) from the newest row, and its result."""
        path = np.zeros((self.model.layout.horizon, 2))
        given = None if plan is None else pointer(np.ascontiguousarray(plan))
        return path, int(self.loaded.odd_predict(pointer(self.kept), given, None, pointer(path), None))

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


def inputs_of_model(model: ExportModel, instants: Instants) -> dict[str, np.ndarray]:
    """The inputs of the function for S instants, name -> (S, entries); what a log does not hold is 0."""
    names, count, zero = model.layout, len(instants), np.zeros(len(instants))
    planned, columns = instants.planned or {}, {"down": instants.columns.get("z", zero), **instants.columns}
    past = {"down": instants.past.get("z", np.zeros((names.num_past, count))), **instants.past}
    orders = {name: planned.get(name, [columns.get(name)])[0] for name in names.reached}
    steps = range(-names.num_past, 0)
    groups = {
        "now": [columns.get(name, zero) for name in names.now],
        "reached": [(instants.hidden or orders)[name] for name in names.reached],
        "past": [past[name][k] if name in past else zero for k in steps for name in names.past],
        "planned": [planned[name][k] for k in range(names.horizon) for name in names.planned],
        "estimates": [instants.estimates[name] for name in names.estimates],
    }
    return {key: np.array(rows, dtype=float).reshape(-1, count).T.copy() for key, rows in groups.items()}


def paths(
    loaded: ctypes.CDLL, name: str, exported: ExportModel, instants: Instants, *choice: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Paths (T, S, 2) of the pure function, rows (T, S, 4) of bands for level, pointwise, kind, and results (S,)."""
    given, size = inputs_of_model(exported, instants), (len(instants), exported.layout.horizon)
    predicted, regions, work = np.zeros((*size, 2)), np.zeros((*size, 4)), np.zeros(1_000_000)
    wanted = pointer(np.array(choice, dtype=float)) if choice else None
    results = [
        getattr(loaded, f"{name}_path")(
            *(pointer(given[key][i]) for key in exported.layout.sizes), wanted,
            *map(pointer, (predicted[i], regions[i], work)),
        )
        for i in range(len(instants))
    ]  # fmt: skip
    return predicted.swapaxes(0, 1), regions.swapaxes(0, 1), np.array(results)
