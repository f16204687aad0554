"""Whole commands: what a user waits for."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from typing import Any

ROUNDS = 7


def run() -> dict[str, Any]:
    """Least processor time [s] of commands beside that of what they stand on, in turn, and the ratios."""
    commands = {
        "python -c pass": ["-c", "pass"],
        "import typer": ["-c", "import typer"],
        "import typer and pydantic": ["-c", "import typer, pydantic"],
        "shipid --help": ["-m", "shipid", "--help"],
        "shipid vessel show": ["-m", "shipid", "vessel", "show", "gunnerus-28.9"],
    }
    alone = os.environ | {"OPENBLAS_NUM_THREADS": "1"}  # as the command sets it for itself
    least = dict.fromkeys(commands, float("inf"))
    for _ in range(ROUNDS):
        for name, arguments in commands.items():
            start = _spent()
            subprocess.run([sys.executable, *arguments], check=True, capture_output=True, env=alone)
            least[name] = min(least[name], _spent() - start)
    result = {f"{name} [s]": round(value, 3) for name, value in least.items()}
    result["shipid --help / import typer"] = round(least["shipid --help"] / least["import typer"], 2)
    beside = least["import typer and pydantic"]
    return result | {"vessel show / import typer and pydantic": round(least["shipid vessel show"] / beside, 2)}


def _spent() -> float:
    """Processor time [s] of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
