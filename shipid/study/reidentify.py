"""Foundations of one batch: models as they are, and those whose numbers are identified first, from the same runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shipid.data.dataset import BREAK, Dataset
from shipid.data.windows import Windows
from shipid.errors import ShipidError
from shipid.metrics import position_error, summary
from shipid.study.plan import Batch, Model, Plan
from shipid.study.prepare import Prepared, own_vessel, paths_of

Array = np.ndarray


@dataclass(frozen=True)
class Foundation:
    """What a compensator of one batch stands on.

    model : with the numbers that were identified, if they were.
    paths, test_paths : (T, S, 2) [m] in the frame (11) on the batch's windows and the test's; zeros without physics.
    sentence : what identification said; empty where nothing was identified. seconds : that it took.
    """

    model: Model
    paths: Array
    test_paths: Array
    sentence: str = ""
    seconds: float = 0.0

    def accuracy(self, test: Windows) -> Mapping[str, Any]:
        """Mean (A, method eq. 14), 90th percentile and RMS error [m] of the physics alone on the test windows."""
        return summary(position_error(self.test_paths, test.future))


def foundations(plan: Plan, prepared: Prepared, batch: Batch, device: str) -> dict[str, Foundation]:
    """Every model of a batch by name; those to be identified see the batch's runs alone, and no moment of the test."""
    mask = np.isin(prepared.pool.run, prepared.runs(plan, batch))
    windows = prepared.pool.select(mask)
    found = {
        model.name: Foundation(model, prepared.pool_paths[model.name][:, mask], prepared.test_paths[model.name])
        for model in prepared.models
        if model.identify is None
    }
    waiting = [model for model in prepared.models if model.identify is not None]
    if waiting:
        runs = prepared.runs(plan, batch)
        data = apart(prepared.data, prepared.test)
        known: dict[str, Foundation] = {}  # by variant: with a compensator and without one are the same physics
        for model in waiting:
            assert model.variant is not None
            key = model.variant.name
            if key not in known:
                known[key] = _identified(plan, prepared, model, runs, data, windows, device)
            same = replace(known[key].model, name=model.name, family=model.family, compensated=model.compensated)
            found[model.name] = replace(known[key], model=same)
    return {model.name: found[model.name] for model in prepared.models}


def apart(dataset: Dataset, test: Windows) -> Dataset:
    """The dataset without the moments that the test windows see, broken there: on a shared clock runs may overlap."""
    if not test.shared_clock:
        return dataset
    t = dataset.frame["t"].to_numpy()
    seen = np.zeros(len(t), dtype=bool)
    for start, end in test.spans.values():
        seen |= (t >= start) & (t <= end)
    names = list(dict.fromkeys([*dataset.metadata["flags"], BREAK]))
    after = np.concatenate([[False], seen[:-1]])
    flags = dataset.frame["flags"] | np.where(after, 1 << names.index(BREAK), 0)
    frame = dataset.frame.assign(flags=flags)[~seen].reset_index(drop=True)
    return replace(dataset, frame=frame, metadata={**dataset.metadata, "flags": names})


def _identified(
    plan: Plan,
    prepared: Prepared,
    model: Model,
    runs: tuple[str, ...],
    data: Dataset,
    windows: Windows,
    device: str,
) -> Foundation:
    from shipid.identification.solve import identify  # SciPy's statistics: a quarter of what workers would import

    assert model.identify is not None
    assert model.variant is not None
    try:
        solution = identify(own_vessel(model), data, runs, model.identify)
        if solution.status != "ok":
            return _nothing(model, windows, prepared.test, solution.sentence)
        values: Mapping[str, float] = {**model.variant.values, **solution.values}
        now = replace(model, variant=replace(model.variant, values=values))
        pair = paths_of(plan, prepared.data, (windows, prepared.test), now, device)
    except ShipidError as error:
        return _nothing(model, windows, prepared.test, error.message)
    if not np.isfinite(pair[0]).all():
        return _nothing(model, windows, prepared.test, "the identified model diverges on training windows")
    return Foundation(now, *pair, sentence=solution.sentence, seconds=solution.seconds)


def _nothing(model: Model, windows: Windows, test: Windows, sentence: str) -> Foundation:
    """A foundation that is not there: paths that are no numbers, and why."""
    here, there = (np.full_like(part.future, np.nan) for part in (windows, test))
    return Foundation(model, here, there, f"identification: {sentence}")
