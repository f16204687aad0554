"""Intervals of one world against what other worlds give: other test runs, other training runs, the same models.

`python docs/worlds.py compute FOLDER STUDY --worlds 30` runs a study in worlds whose seeds of truth and split are drawn
and keeps the errors by test run of each; worlds that are there are not computed again.
`python docs/records.py worlds python docs/worlds.py measure FOLDER` writes the record. Choices were made on
the first third of the worlds, the table is of the others.
"""

from __future__ import annotations

import argparse
import pickle
import shutil
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student

from shipid import read_plan
from shipid.answer.error_table import ErrorTable, break_even, error_table, runs_without_physics
from shipid.evidence import share_interval
from shipid.study.declared import NO_MODEL
from shipid.study.results import read_results
from shipid.study.run import run_study

Known = tuple[float, float, float]  # a number of one world with its interval, as logarithms
METRICS = ("H", "H_end")
FIRST_SEED, PLAIN = 57_2026, 0.2  # PLAIN: a mean gain over worlds from which on an effect is plain
HEAD = """| number | N_D | held [%] | width / spread | width (log) | plain gains shown [%] (of models) | disjoint [%] |
| --- | ---: | ---: | ---: | ---: | ---: | ---: |"""


def compute_world(study: str, seed: int, folder: Path) -> None:
    """Run a study in one world; only its tables of errors stay."""
    run = folder / f"run-{seed}"
    for _ in run_study(read_plan(study, {"truth.seed": seed, "split.seed": seed}), run, workers=1):
        pass
    results = read_results(run)
    names = [one.name for one in results.plan.foundations if one.name != NO_MODEL]
    tables = {metric: error_table(results, names, metric) for metric in METRICS}  # type: ignore[arg-type]
    (folder / f"{seed}.pkl").write_bytes(pickle.dumps(tables))
    shutil.rmtree(run)


def known_numbers(tables: dict[str, ErrorTable]) -> Iterator[tuple[str, int, Known]]:
    """Every number of the answer of one world: its name, N_D, and its value with its interval."""
    table = tables["H"]
    physics = [model for model in table.A if model in table.H]
    for place, amount in enumerate(table.amounts):
        for metric, of in tables.items():
            for model in of.H:
                yield f"{metric} {model}", amount, as_logs(of.mean(model, place), *of.interval(model, place))
        lead = table.lead(NO_MODEL, physics, place)
        for model, *known in zip(physics, lead.mean, lead.low, lead.high, strict=True):
            yield f"gain {model}", amount, tuple(map(float, known))  # type: ignore[misc]
        if limit := break_even(table, physics, place):
            yield "break-even A", amount, open_ends(limit)
        if place < len(table.amounts) - 1:
            for model in physics:
                yield f"worth {model}", amount, open_ends(runs_without_physics(table, model, place))


def as_logs(*values: float) -> Known:
    """Logarithms of a number and of the ends of its interval."""
    return tuple(np.log(np.maximum(values, 1e-300)))  # type: ignore[return-value]


def open_ends(estimate: Any) -> Known:
    """Logarithms; an end at the least or the greatest value that the study covers is open."""
    value, low, high = as_logs(estimate.value, estimate.low, estimate.high)
    return (
        value,
        low if estimate.low > estimate.limits[0] else -np.inf,
        high if estimate.high < estimate.limits[1] else np.inf,
    )


def measure_intervals(worlds: list[dict[str, ErrorTable]]) -> list[str]:
    """Rows of the table: how many intervals hold the mean over worlds, and how wide they are."""
    first = len(worlds) // 3
    numbers: dict[tuple[str, int], list[Known]] = {}
    for tables in worlds:
        for name, amount, known in known_numbers(tables):
            numbers.setdefault((name, amount), []).append(known)
    rows: dict[tuple[str, int], list[tuple[Any, ...]]] = {}
    for (name, amount), known in numbers.items():
        if len(known) == len(worlds):
            values, low, high = np.array(known).T
            mean, spread = values.mean(), 2 * 1.96 * values.std(ddof=1)
            held, wide = ((low <= mean) & (mean <= high))[first:], (high - low)[first:]
            shown = (low > 0)[first:].mean() if name.startswith("gain") and mean > np.log(1 + PLAIN) else np.nan
            apart = np.mean([max(low[a], low[b]) > min(high[a], high[b]) for a, b in combinations(range(len(low)), 2)])
            width = np.median(wide) / spread if spread and np.isfinite(np.median(wide)) else np.nan
            rows.setdefault((name.split()[0], amount), []).append((held, width, np.median(wide), shown, apart))
    lines = [HEAD]
    for (kind, amount), each in sorted(rows.items()):
        held, width, wide, shown, apart = zip(*each, strict=True)
        every, world = np.concatenate(held), np.concatenate([np.arange(len(one)) for one in held])
        low, high = share_interval(every, world)
        numbers_ = [f"{100 * every.mean():.0f} [{100 * low:.0f}, {100 * high:.0f}]", f"{np.nanmedian(width):.2f}"]
        numbers_ += [
            f"{np.nanmedian(wide):.2f}",
            "" if np.isnan(shown).all() else f"{100 * np.nanmean(shown):.0f} ({np.isfinite(shown).sum()})",
        ]
        numbers_ += [f"{100 * np.mean(apart):.1f}" if kind == "break-even" else ""]
        lines.append(f"| {kind} | {amount} | {' | '.join(numbers_)} |")
    return lines


def compare_folders(worlds: list[tuple[dict[str, ErrorTable], dict[str, ErrorTable]]]) -> Iterator[str]:
    """Rows of a table: by how much H differs from that of another folder in the same worlds, mean over models.

    A model counts where both have the same physics. The interval is Student's over worlds.
    """
    yield "| family | N_D | models | difference of H [%] | worlds in which it is lower |"
    yield "| --- | ---: | ---: | ---: | ---: |"
    ratios: dict[tuple[str, int], list[dict[str, float]]] = {}
    for mine, other in ((one["H"], two["H"]) for one, two in worlds):
        same = [m for m in mine.A if m in other.A and np.allclose(mine.A[m], other.A[m])]
        for place, N_D in enumerate(mine.amounts):
            ratio = {m: float(np.log(mine.mean(m, place) / other.mean(m, place))) for m in (*same, NO_MODEL)}
            for family in ("all", *dict.fromkeys(m.split("-")[0] for m in ratio)):
                taken = {m: value for m, value in ratio.items() if family in ("all", m.split("-")[0])}
                ratios.setdefault((family, N_D), []).append(taken)
    for (family, N_D), each in ratios.items():
        means = np.array([np.mean(list(one.values())) for one in each])
        half = student.ppf(0.975, len(means) - 1) * means.std(ddof=1) / np.sqrt(len(means))
        low, value, high = (f"{100 * np.expm1(means.mean() + k * half):.0f}" for k in (-1, 0, 1))
        yield f"| {family} | {N_D} | {len(each[0])} | {value} [{low}, {high}] | {(means < 0).sum()} of {len(means)} |"


def main() -> None:
    """Compute worlds, measure the intervals of those that are there, or compare their errors with another folder's."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["compute", "measure", "compare"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("study", nargs="?", default="quick")
    parser.add_argument("--worlds", type=int, default=30)
    parser.add_argument("--with", dest="other", type=Path, help="folder to compare with")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    seeds = np.random.default_rng(FIRST_SEED).choice(900_000, size=400, replace=False) + 1000
    files = [given.folder / f"{seed}.pkl" for seed in seeds[: given.worlds]]
    for seed, file in zip(seeds, files, strict=False):
        if given.what == "compute" and not file.exists():
            compute_world(given.study, int(seed), given.folder)
    worlds = [pickle.loads(file.read_bytes()) for file in files if file.exists()]
    print(f"{given.folder.name}, {len(worlds)} worlds:\n")
    if given.what == "compare":
        pairs = [(one, given.other / one.name) for one in files if one.exists() and (given.other / one.name).exists()]
        known = [(pickle.loads(one.read_bytes()), pickle.loads(two.read_bytes())) for one, two in pairs]
        print("\n".join(compare_folders(known)))
        return
    print("\n".join(measure_intervals(worlds)))


if __name__ == "__main__":
    main()
