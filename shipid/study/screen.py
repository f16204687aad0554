"""Screening: how accurate each of many members of a family is on every window, before any training is paid for.

Members run in blocks, and their errors are summed and tallied on the way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from typing import Any

import numpy as np
import pandas as pd

from shipid.arguments import check_choice, check_class, check_whole_number
from shipid.data.dataset import Dataset
from shipid.data.windows import Windows, cut_windows
from shipid.engine.engines import REPEATED
from shipid.errors import DocumentError, suggest_name
from shipid.hybrid.physics import Physics, check_columns
from shipid.metrics import BINS, position_error, summarise_errors, tally_quantile
from shipid.study.new import proposed_horizon, survey_dataset
from shipid.study.plan import Plan
from shipid.study.prepare import instants_of, not_measured, partition, physics_of, window_memory
from shipid.vessel.load import Vessel
from shipid.vessel.perturb import Family, Variant, change_structure, draw_members

Array = np.ndarray
CutWindows = tuple[Windows, Windows, list[str]]  # what `partition` gives
MEMBERS_OF_BLOCK = 512  # of a block
# Sums of windows and tallies of a block, for each of pool and test: fewer members if windows are many.
NUMBERS_OF_BLOCK = 12_000_000
QUANTILES_OF_A = (0.05, 0.25, 0.5, 0.75, 0.95)
PER_HORIZON = 8  # instants of prediction in one horizon, of ranks by a log
ROW_COLUMNS = ("family", "member", "A", "A_90", "diverged")


def drawn_families(plan: Plan, name: str | None = None) -> list[Family]:
    """The named family of vessels, or all that draw factors from a range; DocumentError if nothing is drawn."""
    drawn = [
        one
        for one in plan.families
        if one.base is not None and not one.similar and any(block.drawn for block in one.perturb)
    ]
    chosen = [family for family in drawn if name in (None, family.name)]
    if not chosen:
        which = "no family draws a" if name is None else f"{name!r} draws no"
        hint = suggest_name(name or "", [family.name for family in drawn])
        raise DocumentError(f"{which} factor from a range: {hint}", file=plan.file, path="family")
    return chosen


def notes_on_windows(plan: Plan, cut: CutWindows, wanted: Sequence[Family]) -> list[str]:
    """Windows that a study leaves out, and inputs that the base vessels need and the runs do not have."""
    pool, _, left_out = cut
    bases = [change_structure(family, plan.vessels[str(family.base)]) for family in wanted]
    return [*left_out, *dict.fromkeys(note for base in bases for note in not_measured(base, pool))]


def screen(
    plan: Plan,
    dataset: Dataset,
    wanted: Sequence[Family],
    count: int,
    device: str = "cpu",
    engine: str = REPEATED,
    cut: CutWindows | None = None,
) -> Iterator[pd.DataFrame]:
    """Roll `count` members of each family out on all windows of a study, pool and test; yield the rows block by block.

    A row has family, member, accuracy A (method, eq. 14) and A_90 [m] over all windows (exact to 0.2 %), the share of
    windows on which the member diverged (their paths go on as in a study, see `hold_velocity`), and the factor on the
    base of each drawn parameter. Members are those that the study itself draws, none redrawn.

    engine : as of `rollout`; "single" takes half the time and gives A to about six digits.
    cut : the windows of the study as of `partition`, where they are cut already.
    """
    check_class("plan", plan, Plan, "as of `read_plan`")
    check_class("dataset", dataset, Dataset, "as of `read_dataset`")
    for family in wanted:
        check_choice(f"base of the family {family.name!r}", family.base, plan.vessels)
    count = check_whole_number("count", count, 1)
    pool, test, _ = partition(plan, dataset) if cut is None else cut
    size = min(MEMBERS_OF_BLOCK, max(1, NUMBERS_OF_BLOCK // (len(pool) + len(test) + BINS)))
    for family in wanted:
        base = change_structure(family, plan.vessels[str(family.base)])
        check_columns(base, test.columns, plan.file)
        for first in range(0, count, size):
            numbers = range(first, min(first + size, count))
            named = family.model_copy(update={"members": count})
            variants = draw_members(named, base, plan.file, numbers)
            yield _rows_of_block(plan, dataset, (pool, test), base, variants, device, engine)


def errors_on_runs(vessels: Sequence[Vessel], dataset: Dataset, count: int) -> list[float]:
    """Mean position error [m] of the physics alone of each vessel over the first runs, so many of them.

    Over the horizon and at the step that `study new` proposes for the first vessel, with held orders.
    """
    first = dataset.select(dataset.runs[:count])
    ahead, step, _ = proposed_horizon(vessels[0], survey_dataset(first))
    steps = round(ahead / step)
    windows = cut_windows(first, horizon=steps, step=step, interval=max(round(steps / PER_HORIZON), 1) * step)
    errors = []
    for vessel in vessels:
        check_columns(vessel, windows.columns, vessel.file)
        instants = windows.instants(known=False, hidden=window_memory(vessel, first, windows))
        paths, _ = Physics(vessel, steps, step, "rk4", None, "position").variant_paths(instants)
        errors.append(float(position_error(paths[:, 0], windows.future).mean()))
    return errors


def _rows_of_block(
    plan: Plan,
    dataset: Dataset,
    parts: Sequence[Windows],
    base: Vessel,
    variants: Sequence[Variant],
    device: str,
    engine: str,
) -> pd.DataFrame:
    """A row per member of a block."""
    values = np.array([variant.parameters for variant in variants])
    mean, p90, diverged = (np.empty(len(variants)) for _ in range(3))
    num_windows = sum(map(len, parts))
    for same in _equal_lags(base, values):
        vessel = base.with_values(dict(zip(base.parameters, values[same[0]].tolist(), strict=True)))
        measured = [
            physics_of(plan.study, vessel).distances(
                instants_of(plan.study, vessel, dataset, windows),
                windows.future,
                values[same],
                engine=engine,
                device=device,
            )
            for windows in parts
        ]
        mean[same] = sum(one.total.sum(axis=1) for one in measured) / (num_windows * parts[0].horizon)
        p90[same] = tally_quantile(reduce(np.add, (one.tally for one in measured)), 0.9)
        diverged[same] = sum(one.diverged.sum(axis=1) for one in measured) / num_windows
        for k in same[diverged[same] > 0]:
            errors = []
            for windows in parts:
                instants = instants_of(plan.study, vessel, dataset, windows)
                paths, _ = physics_of(plan.study, vessel).variant_paths(instants, values[[k]], device)
                errors.append(position_error(paths[:, 0], windows.future))
            known: Mapping[str, Any] = summarise_errors(np.concatenate(errors, axis=1))
            mean[k], p90[k] = known["mean"], known["p90"]
    rows: dict[str, Any] = {
        "family": [variant.family for variant in variants],
        "member": [variant.name for variant in variants],
        "A": mean,
        "A_90": p90,
        "diverged": diverged,
    }
    factors = {path: [variant.factors[path] for variant in variants] for path in variants[0].factors}  # all draw alike
    return pd.DataFrame(rows | factors)


def _equal_lags(base: Vessel, values: Array) -> list[Array]:
    """Members in groups whose actuators lag alike: equal hidden states at the start of a window."""
    lags = [place for place, path in enumerate(base.parameters) if ".actuator." in path]
    _, group = np.unique(values[:, lags], axis=0, return_inverse=True)
    return [np.flatnonzero(group == number) for number in range(int(group.max()) + 1)]


def join_blocks(blocks: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """All rows as one frame; a parameter that a family leaves alone has the factor 1."""
    frame = pd.concat(blocks, ignore_index=True)
    drawn = [name for name in frame.columns if name not in ROW_COLUMNS]
    return frame.fillna(dict.fromkeys(drawn, 1.0))


def accuracy_quantiles(frame: pd.DataFrame) -> pd.DataFrame:
    """A row per family: members, how many diverged on some window, and quantiles of A [m]."""
    A = frame.groupby("family", sort=False)["A"]
    counts = {"members": A.size(), "diverged": frame["diverged"].gt(0).groupby(frame["family"], sort=False).sum()}
    return pd.DataFrame(counts | {share: A.quantile(share) for share in QUANTILES_OF_A}).reset_index()
