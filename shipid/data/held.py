"""Commands that no run of a log varies: what they do cannot be learnt from it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from shipid.data.dataset import Dataset
from shipid.physics.signals import row_of
from shipid.units import DEGREE, listed, plural

NOISE = {True: 0.5 * DEGREE, False: 0.01}  # standard deviation that still counts as none: of angles, and of the mean


def held_commands(dataset: Dataset, runs: Iterable[str]) -> tuple[str, ...]:
    """Commands that are the same, to measuring noise, in every row of some runs. One that varies in one run varies."""
    frame = dataset.frame[dataset.frame["run"].isin(list(runs))]
    by_run, held = frame.groupby("run", sort=False), []
    for name in dataset.commands:
        means, scatter = by_run[name].mean(), by_run[name].std(ddof=0)
        row = row_of(name)
        angle = row is not None and row.angle
        noise = NOISE[angle] * (1.0 if angle else float(means.abs().max()))
        if len(means) and np.ptp(means) <= noise and float(scatter.max()) <= noise:
            held.append(name)
    return tuple(held)


def nothing_varies(dataset: Dataset, runs: Iterable[str]) -> list[str]:
    """A sentence where some runs vary no command at all; none where they vary one, as ships at one shaft speed do."""
    runs = list(runs)
    held = held_commands(dataset, runs)
    if not held or len(held) < len(dataset.commands):
        return []
    are, do = plural(len(held), "is", "are"), plural(len(held), "it does", "they do")
    where = f"in all {len(runs)} runs" if len(runs) > 1 else "throughout the only run"
    return [
        f"{listed(held)} {are} the same {where}: what {do} cannot be learnt from this log, nor can damping be told "
        "from the force that steers, or resistance from thrust"
    ]
