"""Race other settings of the search on drawn logs: `python -m tests.benchmarks.retune --logs 200`.

Each number is halved and doubled in turn, all others as they are. A change is out as soon as it has more logs that are
silent and wrong, or more that are not right, than the settings in use. Changes that end with fewer are tried together
on as many fresh logs. What no setting enters is computed once a log. It writes nothing.
"""

from __future__ import annotations

import argparse
import pickle
import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, fields
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

from shipid.identification import diagnosis
from shipid.logs.guess import columns, evidence
from shipid.logs.guess.settings import SETTINGS
from tests.logs import drawn_logs

FACTORS = (0.5, 2.0)
SEED = 51_000
KEPT: dict[ModuleType, tuple[str, ...]] = {
    columns: ("read_source",),
    diagnosis: ("diagnose",),
    drawn_logs: ("judge_guess",),
    evidence: ("fit_without_outliers", "heal_angle", "integrate_rate", "order_effects", "spike_rows"),
}
"""Module -> functions that take no setting; their results are kept for the other settings of a log."""


@dataclass
class Racer:
    """Settings that differ by `change` from those in use, and their logs so far.

    seen : all. silent : silent and wrong. faulty : not right. other : verdicts that the settings in use do not have.
    """

    change: Mapping[str, float]
    seen: int = 0
    silent: int = 0
    faulty: int = 0
    other: int = 0
    out: bool = False

    @property
    def wrong(self) -> tuple[int, int]:
        """Logs that are silent and wrong, and that are not right."""
        return self.silent, self.faulty

    def judge(self, log: drawn_logs.Drawn) -> drawn_logs.Verdict:
        """Judge a log, and count it."""
        usual = {name: getattr(SETTINGS, name) for name in self.change}
        try:
            _set_numbers(self.change)
            verdict = drawn_logs.judge(log)
        finally:
            _set_numbers(usual)
        self.seen += 1
        self.silent += verdict.word == "silent"
        self.faulty += verdict.word != "right"
        return verdict


def _set_numbers(numbers: Mapping[str, float]) -> None:
    for name, value in numbers.items():
        object.__setattr__(SETTINGS, name, value)


def changed_value(usual: float, factor: float) -> float:
    """A number times a factor; of a share near 1, 1 less what it lacks times the factor."""
    return type(usual)(1.0 - (1.0 - usual) * factor if 0.5 < usual < 1.0 else usual * factor)


def keep_results(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, which computes nothing twice."""
    results: dict[bytes, Any] = {}

    def kept(*arguments: Any) -> Any:
        key = pickle.dumps(arguments)
        if key not in results:
            results[key] = function(*arguments)
        return results[key]

    return kept


def race(racers: list[Racer], seeds: range) -> Racer:
    """Judge drawn logs with the settings in use, which are returned, and with every change that is not out.

    Ctrl-C ends it with the logs so far.
    """
    base = Racer({})
    kept = [(module, name, getattr(module, name)) for module, names in KEPT.items() for name in names]
    with suppress(KeyboardInterrupt):
        for seed in seeds:
            with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
                log = drawn_logs.draw(seed, Path(folder) / "logs")
                for module, name, function in kept:
                    stack.enter_context(patch.object(module, name, keep_results(function)))
                verdicts = [(racer, racer.judge(log)) for racer in racers if not racer.out]
                verdict = base.judge(log)  # last, so that Ctrl-C makes no change better
                for racer, own in verdicts:
                    racer.other += own != verdict
                    racer.out = racer.silent > base.silent or racer.faulty > base.faulty
    return base


def main() -> None:
    """Print each change with its logs, what is proposed, and what that does on fresh logs."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.retune", description=__doc__)
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=SEED)
    asked = parser.parse_args()
    usual = {one.name: getattr(SETTINGS, one.name) for one in fields(SETTINGS)}
    racers = [Racer({name: changed_value(value, factor)}) for name, value in usual.items() for factor in FACTORS]
    seeds = range(asked.seed, asked.seed + asked.logs)
    base = race(racers, seeds)
    print(base)
    print(*racers, sep="\n")
    better = [one for one in racers if one.wrong < base.wrong and not one.out]
    better.sort(key=lambda one: one.wrong, reverse=True)  # of two of one number the better is last
    proposed = Racer({name: value for one in better for name, value in one.change.items()})
    print("proposed:", dict(proposed.change))
    if better:
        print("on fresh logs:", race([proposed], range(seeds.stop, seeds.stop + asked.logs)), proposed)


if __name__ == "__main__":
    main()
