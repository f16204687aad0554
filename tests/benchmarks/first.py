"""The first answer: `shipid study run quick` from a cold start, nothing compiled, a fresh process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from typing import Any

PHASES = {  # how a line of the output begins -> what is over then
    "simulating": "until the truth is simulated: imports, checks [s]",
    "rolling out": "truth, compilation included [s]",
    "18 of 18": "rolling out, compilation included [s]",
    "[18/18]": "cells, workers' start included [s]",
    "report:": "report [s]",
}


def run() -> dict[str, Any]:
    """Wall time [s] of the command, of its phases by the lines it prints."""
    with tempfile.TemporaryDirectory() as folder:
        empty = {"XDG_CACHE_HOME": f"{folder}/cache", "TORCHINDUCTOR_CACHE_DIR": f"{folder}/inductor"}
        call = "from shipid.cli import main; main()"
        command = [sys.executable, "-u", "-c", call, "study", "run", "quick", "--out", f"{folder}/run"]
        moments, begun = {}, time.perf_counter()
        with subprocess.Popen(command, env=os.environ | empty, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            for line in process.stdout:
                moments |= {
                    name: time.perf_counter() - begun for start, name in PHASES.items() if line.startswith(start)
                }
        whole = time.perf_counter() - begun
    assert process.returncode == 0
    assert moments.keys() == set(PHASES.values()), "the lines that `shipid study run` prints have changed"
    ends = list(moments.values())
    phases = {
        name: round(end - start, 2) for (name, end), start in zip(moments.items(), [0.0, *ends[:-1]], strict=True)
    }
    return {**phases, "whole command [s]": round(whole, 1)}
