"""`make bench`: run every benchmark, print a table, write `results/bench.json` with machine and versions."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from shipid.estimation.training import use_threads
from shipid.study.run import machine
from tests.benchmarks import cells, commands, rollouts, truth

BENCHMARKS = {"rollouts": rollouts, "truth": truth, "commands": commands, "cells": cells}


def main(wanted: list[str]) -> None:
    """Run the benchmarks named, or all."""
    report = {"machine": machine(), "threads": 2}
    for name in wanted or BENCHMARKS:
        use_threads(1 if name == "cells" else 2)
        figures = BENCHMARKS[name].run()
        report[name] = figures
        print(f"\n{name}")
        for label, value in figures.items():
            print(f"  {label:40s} {value}")
    file = Path("results/bench.json")
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps(report, indent=1))
    print(f"\n-> {file}")


if __name__ == "__main__":
    main(sys.argv[1:])
