"""Guesses on logs drawn by seed: share right, wrong and reported, wrong and silent."""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from tests.logs.drawn_logs import draw, judge
from tests.logs.judged_raw import judge_raw
from tests.strangers_raw import raw_stranger

SEED = 393125  # of the first log; drawn after the words of the headers were written
WORST = 40  # failures that are printed


def run(logs: int = 400, seed: int = SEED, folders: int = 0) -> dict[str, Any]:
    """Shares of `logs` drawn logs and of raw `folders`, of consecutive seeds; failures are printed with their seed."""
    words: Counter[str] = Counter()
    for number in range(seed, seed + logs):
        with tempfile.TemporaryDirectory() as folder:
            drawn = draw(number, Path(folder) / "logs")
            verdict = judge(drawn)
        words[verdict.word] += 1
        if verdict.word != "right" and words.total() - words["right"] <= WORST:
            drawn_as = {key: drawn.story[key] for key in ("style", "layout", "velocity", "length", "step", "time")}
            print(f"{number}: {verdict.word}: {'; '.join(verdict.reasons)} {drawn_as}", file=sys.stderr, flush=True)
    figures = {"logs": logs, "seed": seed, **shares(words)}
    return figures | ({f"raw: {name}": value for name, value in raw(folders, seed).items()} if folders else {})


def raw(folders: int, seed: int) -> dict[str, Any]:
    """Shares of raw folders of made-up teams, of consecutive seeds."""
    words: Counter[str] = Counter()
    for number in range(seed, seed + folders):
        with tempfile.TemporaryDirectory() as folder:
            stranger = raw_stranger(number, Path(folder) / "raw")
            verdict = judge_raw(stranger)
        words[verdict.word] += 1
        if verdict.word != "right":
            print(
                f"{number}: {verdict.word}: {stranger.words}: {'; '.join(verdict.reasons)}", file=sys.stderr, flush=True
            )
    return {"folders": folders, **shares(words)}


def shares(words: Counter[str]) -> dict[str, float]:
    """Share of every verdict."""
    names = {"right": "right", "reported": "wrong and reported", "silent": "wrong and silent"}
    return {name: round(words[word] / max(1, words.total()), 4) for word, name in names.items()}
