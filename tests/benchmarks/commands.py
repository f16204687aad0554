"""Whole commands: what a user waits for."""

from __future__ import annotations

import subprocess
import sys
import time
from typing import Any


def run() -> dict[str, Any]:
    """Least wall time [s] of `shipid --help`, of a bare interpreter, and of `shipid vessel show`."""
    call = "import sys; from shipid.cli import main; sys.argv = ['shipid', {}]; main()"
    commands = {
        "python -c pass [s]": ["-c", "pass"],
        "shipid --help [s]": ["-c", call.format("'--help'")],
        "shipid vessel show [s]": ["-c", call.format("'vessel', 'show', 'gunnerus-28.9'")],
    }
    result = {}
    for name, arguments in commands.items():
        best = float("inf")
        for _ in range(5):
            start = time.perf_counter()
            subprocess.run([sys.executable, *arguments], check=False, capture_output=True)
            best = min(best, time.perf_counter() - start)
        result[name] = round(best, 3)
    return result
