"""Commands that no run of a log varies: what they do cannot be learnt from it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from shipid.data.dataset import Array, Dataset
from shipid.physics.signals import signal_row
from shipid.units import DEGREE, join_names, plural_word

FEEDBACK_NOISE = {True: 0.5 * DEGREE, False: 0.01}
"""Standard deviation that counts as none, of angles [rad] and as a share of others: assumed for measured feedback."""
KICK_SIZE = 4.0  # times this noise: a departure that is an order, where it lasts
SPIKE_SECONDS, SPIKE_SHARE = (
    3.0,
    1e-3,
)  # s between the rows around a departure, and share of rows: below, faulty rows and no order


def constant_commands(dataset: Dataset, runs: Iterable[str]) -> tuple[str, ...]:
    """Commands that are the same in every row of some runs, but for measuring noise and a faulty row in a thousand.

    One that varies in one run varies, also where that is for a few seconds of a long run.
    """
    frame = dataset.frame[dataset.frame["run"].isin(list(runs))]
    by_run, held = frame.groupby("run", sort=False), []
    for name in dataset.commands:
        usual = by_run[name].median()
        row = signal_row(name)
        angle = row is not None and row.angle
        noise = FEEDBACK_NOISE[angle] * (1.0 if angle else float(usual.abs().max()))
        if (
            len(usual)
            and np.ptp(usual) <= noise
            and all(_is_constant(run["t"].to_numpy(float), run[name].to_numpy(float), noise) for _, run in by_run)
        ):
            held.append(name)
    return tuple(held)


def _is_constant(t: Array, values: Array, noise: float) -> bool:
    """Whether a command is the same in every row of a run; t, values : its rows; noise : standard deviation."""
    far = np.abs(values - np.median(values)) > KICK_SIZE * noise
    first, behind = np.flatnonzero(np.diff(far, prepend=False, append=False)).reshape(-1, 2).T
    lasting = t[np.minimum(behind, len(t) - 1)] - t[np.maximum(first - 1, 0)]
    return bool(far.mean() <= SPIKE_SHARE and (lasting < SPIKE_SECONDS).all() and values[~far].std() <= noise)


def warn_of_constant_commands(dataset: Dataset, runs: Iterable[str]) -> list[str]:
    """A sentence where some runs vary no command at all; none where they vary one, as ships at one shaft speed do."""
    runs = list(runs)
    held = constant_commands(dataset, runs)
    if not held or len(held) < len(dataset.commands):
        return []
    are, do = plural_word(len(held), "is", "are"), plural_word(len(held), "it does", "they do")
    where = f"in all {len(runs)} runs" if len(runs) > 1 else "throughout the only run"
    return [
        f"{join_names(held)} {are} the same {where}: what {do} cannot be learnt from this log, nor can damping be told "
        "from the force that steers, or resistance from thrust"
    ]
