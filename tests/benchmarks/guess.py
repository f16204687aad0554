"""Guesses on logs drawn by seed: share right, wrong and reported, wrong and silent."""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from tests.logs.drawn_logs import draw, judge

SEED = 393125  # of the first log; drawn after the words of the headers were written
WORST = 40  # failures that are printed


def run(logs: int = 400, seed: int = SEED) -> dict[str, Any]:
    """Shares of `logs` drawn logs, of consecutive seeds; every failure is printed with its seed and what was drawn."""
    words: Counter[str] = Counter()
    for number in range(seed, seed + logs):
        with tempfile.TemporaryDirectory() as folder:
            drawn = draw(number, Path(folder) / "logs")
            verdict = judge(drawn)
        words[verdict.word] += 1
        if verdict.word != "right" and words.total() - words["right"] <= WORST:
            drawn_as = {key: drawn.story[key] for key in ("style", "layout", "velocity", "length", "step", "time")}
            print(f"{number}: {verdict.word}: {'; '.join(verdict.reasons)} {drawn_as}", file=sys.stderr, flush=True)
    shares = {"right": words["right"], "wrong and reported": words["reported"], "wrong and silent": words["silent"]}
    return {"logs": logs, "seed": seed} | {name: round(count / logs, 4) for name, count in shares.items()}
