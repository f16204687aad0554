"""`make bench`: measure, print tables, write `results/bench.json`, and fail where a ratio regressed."""

from __future__ import annotations

import argparse
import json
import sys
from datetime import date
from importlib import import_module
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from shipid.hybrid.device import use_threads
from shipid.study.run import machine
from tests.benchmarks.compare import RECORDED, TOLERANCE, Ratio, accepted, best, compare, read_recorded

THREADS = {  # group, the module of that name -> threads that PyTorch may use
    "rollouts": 2,
    "gradient": 2,
    "screening": 2,
    "truth": 2,
    "growth": 2,
    "commands": 2,
    "first": 2,
    "methods": 1,
    "orchestration": 1,
    "identification": 2,
}
ASKED = {
    "coverage": 1,
    "strangers": 1,
    "bands": 1,
    "verdicts": 1,
    "guess": 1,
    "gpu": 1,
    "kernel": 1,
    "peers": 1,
    "memory": 1,
}  # the same, only where named: they take minutes and are no matter of time, or need a GPU
GROUPS = THREADS | ASKED
RESULTS = Path("results/bench.json")
WIDTH = 140


def main() -> int:
    """Run the benchmarks named, or all; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument(
        "groups", nargs="*", metavar="group", help=f"of {', '.join(GROUPS)}; default: all that are timed"
    )
    parser.add_argument("--record", action="store_true", help="accept the ratios measured now")
    parser.add_argument("--replicates", type=int, default=200, help="of the groups coverage, bands and verdicts")
    parser.add_argument("--logs", type=int, default=400, help="of the group guess")
    parser.add_argument("--folders", type=int, default=0, help="raw folders of the group guess")
    parser.add_argument("--first", type=int, help="seed of the first ship of strangers")
    parser.add_argument("--whole", action="store_true", help="run the studies of strangers as written, too")
    asked = parser.parse_args()
    unknown = [name for name in asked.groups if name not in GROUPS]
    if unknown:
        parser.error(f"no such group: {', '.join(unknown)}")
    recorded = read_recorded()
    options = {
        "coverage": {"replicates": asked.replicates},
        "bands": {"replicates": asked.replicates},
        "verdicts": {"tables": asked.replicates},
        "guess": {"logs": asked.logs, "folders": asked.folders},
        "strangers": {"whole": asked.whole} | ({} if asked.first is None else {"first": asked.first}),
    }
    figures = {name: measure(name, **options.get(name, {})) for name in asked.groups or THREADS}
    again = {ratio.group for ratio in compare(figures, recorded) if ratio.regressed and not asked.record}
    if again:
        print(f"measured once more: {', '.join(sorted(again))}", file=sys.stderr)
        figures = best(figures, {name: measure(name) for name in figures if name in again}, recorded)
    ratios = compare(figures, recorded)
    show(figures, ratios)
    write(figures, ratios)
    if asked.record:
        RECORDED.write_text(json.dumps(accepted(figures, recorded), indent=1) + "\n")
        print(f"recorded -> {RECORDED}")
        return 0
    return verdict(ratios)


def measure(name: str, **options: Any) -> dict[str, Any]:
    """Figures of one group; options are those of its `run`."""
    print(f"{name} ...", file=sys.stderr)
    use_threads(GROUPS[name])
    figures: dict[str, Any] = import_module(f"tests.benchmarks.{name}").run(**options)
    return figures


def show(figures: dict[str, dict[str, Any]], ratios: list[Ratio]) -> None:
    """Print all figures, then the ratios beside what was recorded and promised."""
    console = Console(width=WIDTH, markup=False, highlight=False)
    table = Table("group", "figure", "value")
    for group, measured in figures.items():
        for label, value in measured.items():
            table.add_row(group, label, f"{value:g}" if isinstance(value, float) else str(value))
        table.add_section()
    console.print(table)
    table = Table("group", "ratio", "now", "recorded", "worse by", "better", "promise", "")
    for ratio in ratios:
        was = "-" if ratio.recorded is None else f"{ratio.recorded:g}"
        bound = "-" if ratio.promise is None else f"{ratio.promise:g}"
        word = "regressed" if ratio.regressed else "promise missed" if ratio.kept is False else ""
        table.add_row(
            ratio.group, ratio.label, f"{ratio.value:g}", was, f"{ratio.worse_by:+.0%}", ratio.better, bound, word
        )
    console.print(table)


def write(figures: dict[str, dict[str, Any]], ratios: list[Ratio]) -> None:
    """Write `results/bench.json`: date, machine with versions, figures, ratios."""
    compared = [
        {"group": one.group, "ratio": one.label, "value": one.value, "recorded": one.recorded, "better": one.better}
        | {"worse_by": round(one.worse_by, 3), "regressed": one.regressed, "promise": one.promise, "kept": one.kept}
        for one in ratios
    ]
    report = {"date": date.today().isoformat(), "machine": machine()}
    report |= {"threads": {name: GROUPS[name] for name in figures}, "figures": figures, "ratios": compared}
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(report, indent=1) + "\n")
    print(f"-> {RESULTS}")


def verdict(ratios: list[Ratio]) -> int:
    """Name what regressed; 1 if anything did."""
    worse = [ratio for ratio in ratios if ratio.regressed]
    for ratio in worse:
        print(
            f"{ratio.group}: {ratio.label}: {ratio.value:g}, recorded {ratio.recorded:g} ({ratio.better} is better): "
            f"worse by {ratio.worse_by:.0%}, more than {TOLERANCE:.0%}",
            file=sys.stderr,
        )
    if worse:
        names = " ".join(dict.fromkeys(ratio.group for ratio in worse))
        print(f"to accept the new values: python -m tests.benchmarks {names} --record", file=sys.stderr)
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
