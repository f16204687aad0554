"""The examples of the pages on exports run as they are printed."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from shipid.export.write import export_vessel
from shipid.vessel.load import load_vessel
from tests.export.compiled import compile_, compiler
from tests.export.strange import drawn

DOCS = Path(__file__).parents[2] / "docs"
AT_SEA = """
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <math.h>

static int count, given, alarms, missing;

static double measure(double *row)
{
    int i;
    if (count == 200) {
        printf("%d %d %d\\n", given, alarms, missing);
        exit(0);
    }
    for (i = 0; i < aboard_NUM_ROW; i++)
        row[i] = strcmp(aboard_row_names[i], "u") ? 0 : 4;
    return (double)count++;
}
static void warn(void) { alarms++; }
static void no_path(void) { missing++; }
"""


def blocks(page: str, language: str) -> list[str]:
    """Code of a language on a page, as it is printed."""
    return re.findall(rf"^```{language}\n(.*?)^```$", (DOCS / page).read_text(), re.M | re.S)


@pytest.mark.slow
def test_the_loop_in_c_predicts_with_a_band(tmp_path: Path) -> None:
    loop, banded = blocks("export-c.md", "c")
    predictor = drawn("path-trained", 3, vessel="gunnerus-28.9").predictor
    predictor.export("c", tmp_path, name="aboard")
    include, begin = loop.index("\n") + 1, loop.index("aboard_init")
    more = f"no_path();\n{banded}    given += isfinite(path[0]) && banded >= 0 ? 1 : 0;\n}}"
    body = loop[begin:].replace("no_path();\n}", more)
    assert body.count("given +=") == 1
    source = [loop[:include], AT_SEA, loop[include:begin]]
    source += ["int main(void)\n{\n", body, "}\n"]
    (tmp_path / "loop.c").write_text("".join(source))
    compile_([compiler()], tmp_path, "-O0", "-o", "loop", "loop.c", "aboard.c", "aboard_casadi.c")
    done = subprocess.run([tmp_path / "loop"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    given, alarms, missing = map(int, done.stdout.split())
    assert given + missing >= 200
    assert given > 150
    assert alarms <= 200


@pytest.mark.slow
def test_the_fmu_of_a_vessel_is_simulated_as_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("fmpy")
    monkeypatch.chdir(tmp_path)
    export_vessel(load_vessel("gunnerus-28.9"), "fmu", Path("ship.fmu"))
    here: dict[str, np.ndarray] = {}
    (code,) = blocks("export-fmu.md", "python")
    exec(code, here)
    assert here["result"]["time"][-1] == 60
    assert here["result"]["north"][-1] > 100


@pytest.mark.slow
def test_the_networks_run_as_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    monkeypatch.chdir(tmp_path)
    predictor = drawn("path-trained", 3).predictor
    predictor.export("onnx", "networks.onnx")
    here: dict[str, np.ndarray] = {}
    (code,) = blocks("export-onnx.md", "python")
    exec(code, here)
    assert here["compensation"].shape == (1, predictor.physics.horizon, 2)
