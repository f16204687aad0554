"""Try other settings of the search on drawn logs: `python -m tests.benchmarks.retune --logs 40`.

Each number is made smaller and larger in turn, all others as they are; a change that serves both the logs of one seed
and those of another may be taken. It writes nothing.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from dataclasses import fields
from pathlib import Path

from shipid.logs.guess.settings import SETTINGS
from tests.logs.drawn_logs import Drawn, draw, judge

FACTORS = (0.7, 1.4)
SEED = 51_000


def score(logs: list[Drawn]) -> tuple[int, int]:
    """How many guesses are silent and wrong, and how many are not right: less is better."""
    words = Counter(judge(drawn).word for drawn in logs)
    return words["silent"], len(logs) - words["right"]


def main() -> None:
    """Print each setting with its scores, before and after."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.retune", description=__doc__)
    parser.add_argument("--logs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=SEED)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        seeds = range(asked.seed, asked.seed + asked.logs)
        logs = [draw(seed, Path(folder) / str(seed) / "logs") for seed in seeds]
        print("as they are", score(logs))
        for name in (one.name for one in fields(SETTINGS)):
            usual = getattr(SETTINGS, name)
            for factor in FACTORS:
                object.__setattr__(SETTINGS, name, type(usual)(usual * factor))
                print(name, getattr(SETTINGS, name), score(logs), flush=True)
            object.__setattr__(SETTINGS, name, usual)


if __name__ == "__main__":
    main()
