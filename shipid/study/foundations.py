"""Foundations of one batch: variants as they are, and those whose numbers or observer are first fitted to its runs."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from shipid.data.dataset import Dataset
from shipid.data.windows import Windows
from shipid.errors import ShipidError
from shipid.observer import Estimates
from shipid.study.declared import Foundation
from shipid.study.prepare import PreparedStudy, chosen_observer, estimates_of, paths_of, rows_apart_from_test

if TYPE_CHECKING:
    from shipid.identification.settings import Identify
    from shipid.identification.solve import Solution

Array = np.ndarray


@dataclass(frozen=True)
class FoundationPrediction:
    """What a foundation of one batch predicts before any method improves it.

    foundation : with the numbers that were identified and the observer that was chosen, if any.
    paths, test_paths : (T, S, 2) [m] in the frame (11) on the batch's windows and the test's; zeros without physics.
    sentence : the message of the identification; empty where nothing was identified. seconds : core-seconds that
        identification and choice took.
    estimates : what the observer knows at every row of the runs; None without one.
    """

    foundation: Foundation
    paths: Array
    test_paths: Array
    sentence: str = ""
    seconds: float = 0.0
    estimates: Estimates | None = None


def predictions(
    prepared: PreparedStudy, runs: tuple[str, ...], device: str, wanted: Collection[str] | None = None
) -> dict[str, FoundationPrediction]:
    """Every foundation for some runs of the pool; those to be fitted see these runs, and no moment of the test.

    wanted : names of foundations; None: all.
    """
    mask = np.isin(prepared.pool.run, runs)
    windows = prepared.pool.select(mask)
    result = {}
    data: Dataset | None = None
    known: dict[Any, Solution] = {}
    for one in prepared.foundations:
        if wanted is not None and one.name not in wanted:
            continue
        if not one.fitted:
            paths = prepared.pool_paths[one.name][:, mask], prepared.test_paths[one.name]
            result[one.name] = FoundationPrediction(one, *paths, estimates=prepared.estimates.get(one.name))
        else:
            data = rows_apart_from_test(prepared.data, prepared.test) if data is None else data
            result[one.name] = _fit_foundation(prepared, one, runs, data, windows, device, known)
    return result


def _fit_foundation(
    prepared: PreparedStudy,
    foundation: Foundation,
    runs: tuple[str, ...],
    data: Dataset,
    windows: Windows,
    device: str,
    known: dict[Any, Solution],
) -> FoundationPrediction:
    """One foundation fitted to the runs; `known` keeps solutions for foundations that differ in the observer alone.

    Where that fails, its paths are no numbers, and the sentence says why.
    """
    study = prepared.study
    now, sentence, seconds, estimates = foundation, "", 0.0, None
    try:
        if foundation.identify is not None:
            solution = _solution(foundation, foundation.identify, runs, data, known)
            if solution.status != "ok":
                raise ShipidError(solution.sentence)
            assert foundation.variant is not None
            values: Mapping[str, float] = {**foundation.variant.values, **solution.values}
            now = replace(foundation, variant=replace(foundation.variant, values=values))
            sentence, seconds = solution.sentence, solution.seconds
        if now.observer is not None:
            begun = time.thread_time()
            if now.observer.choose:
                now = replace(now, observer=chosen_observer(study, now, data.select(runs), windows))
                seconds += time.thread_time() - begun
            calls = sum(one.observer is not None for one in prepared.foundations)
            estimates = estimates_of(study, now, prepared.data, prepared.test, calls)
        pair = paths_of(study, prepared.data, (windows, prepared.test), now, device, estimates)
        if not np.isfinite(pair[0]).all():
            raise ShipidError("the model diverges on training windows")
    except ShipidError as error:
        words = "identification" if foundation.identify is not None else "observer"
        here, there = (np.full_like(part.future, np.nan) for part in (windows, prepared.test))
        return FoundationPrediction(foundation, here, there, f"{words}: {error.message}")
    return FoundationPrediction(now, *pair, sentence, seconds, estimates)


def _solution(
    foundation: Foundation, settings: Identify, runs: tuple[str, ...], data: Dataset, known: dict[Any, Solution]
) -> Solution:
    """What identification from the runs gives, once for a variant and its settings."""
    from shipid.identification.solve import identify  # SciPy's statistics: a quarter of what workers would import

    assert foundation.variant is not None
    assert foundation.vessel is not None
    key = foundation.variant.name, settings.model_dump_json()
    if key not in known:
        known[key] = identify(foundation.vessel, data, runs, settings)
    return known[key]
