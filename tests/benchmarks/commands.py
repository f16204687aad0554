"""Whole commands: what a user waits for."""

from __future__ import annotations

import subprocess
import sys
import time
from typing import Any


def run() -> dict[str, Any]:
    """Least wall time [s] of `shipid --help`, of a bare interpreter, and of `shipid vessel show`."""
    commands = {
        "python -c pass [s]": ["-c", "pass"],
        "shipid --help [s]": ["-c", "import sys; sys.argv = ['shipid', '--help']; from shipid.cli import main; main()"],
        "shipid vessel show [s]": [
            "-c", "import sys; sys.argv = ['shipid', 'vessel', 'show', 'gunnerus-28.9']; from shipid.cli import main; main()"
        ],
    }  # fmt: skip
    result = {}
    for name, arguments in commands.items():
        best = float("inf")
        for _ in range(5):
            start = time.perf_counter()
            subprocess.run([sys.executable, *arguments], check=False, capture_output=True)
            best = min(best, time.perf_counter() - start)
        result[name] = round(best, 3)
    return result
