"""Findings B1 and B2: what better physics is worth in the width of a band, and whether bands keep their promise.

The width is the mean radius [m] of the band of the study's level over the horizon, a mean over windows of each test
manoeuvre; it is judged as errors are (`shipid.evidence`).

B1 : at every N_D that has bands the width rises along ln A over the physics models, and it would hardly do so if the
    models had their A in any other order. At full scale, with one accurate and one inaccurate model: at the largest N_D
    the band of the model whose A is shown to be larger is wider, whichever the study calls accurate.
B2 : the share of whole test paths inside their bands is the level, at the largest N_D and in the mean over models; each
    test manoeuvre counts the same, however long it is, as in the promise.
    Confirmed if its 95 % interval lies above the level less 5 points, refuted if it lies below the level. Manoeuvres of
    a kind that no run of calibration has are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shipid.answer.bands import cell_regions, of_methods
from shipid.answer.error_table import PHYSICS_ONLY, ErrorTable, error_table
from shipid.answer.findings_simulation import trend_over_accuracy, trend_verdict
from shipid.answer.verdict import (
    EQUAL_A,
    ClaimRule,
    ClaimVerdict,
    Judgement,
    UndecidedClaim,
    count_manoeuvres,
    difference_with_interval,
    judge_claims,
    least_to_greatest,
    leave_undecided,
    length_in_metres,
    too_few_manoeuvres,
    verdict_of,
)
from shipid.evidence import all_significant, any_significant, share_interval
from shipid.metrics import coverage_share, rank_correlation
from shipid.report.wording import join_few_names
from shipid.study.declared import NO_MODEL
from shipid.study.plan import verdict_method
from shipid.study.results import Results
from shipid.units import level_text, percent_text

Array = NDArray[np.float64]
BROKEN_BY = 0.05  # B2: a share that lies so far below its level is a broken promise


@dataclass(frozen=True)
class Widths:
    """What B1 compares: widths in place of H, at the amounts of data at which every model has a band.

    physics : models with physics. rivals : whether they are the accurate and the inaccurate model.
    """

    table: ErrorTable
    physics: tuple[str, ...]
    rivals: bool = False


@dataclass(frozen=True)
class Promise:
    """What B2 judges: the share (S,) of models whose band of a level holds the path of a window, and its run (S,).

    kinds : (S,) kind of manoeuvre of each window. calibrated : kinds that calibrated every band; None if unknown.
    """

    held: Array
    run: NDArray[np.str_]
    level: float
    kinds: NDArray[np.str_] | None = None
    calibrated: frozenset[str] | None = None


@dataclass(frozen=True)
class BandEvidence:
    """What B1 and B2 judge, and the shares of paths that the bands of B1 hold."""

    widths: Widths
    promise: Promise
    shares: Sequence[float] = ()


def band_findings(results: Results, physics: Sequence[str], rivals: bool) -> list[ClaimVerdict]:
    """Verdicts on B1 and B2 for models with physics (none of them sees the test); undecided where none has a band.

    rivals : as in `Widths`.
    """
    if not results.complete:
        return leave_undecided(BAND_RULES, results.missing)
    level, run, of = (
        results.plan.study.bands.level,
        results.test.run,
        of_methods(results, [verdict_method(results.plan)]),
    )
    widths, held = {}, {}
    for row, by_level, apart in cell_regions(results, [level]):
        region, cell = by_level[level], str(row["cell"])
        widths[cell], held[cell] = results.by_run(region.radius.mean(axis=0)), region.holds(apart)
    errors, cells = error_table(results, physics), results.judged_cells
    cells = cells[cells["foundation"].isin(errors.H)]  # a model with a failed cell may have no band
    table = _width_table(errors, cells[~cells["N_D"].isin(cells["N_D"][~cells["cell"].isin(widths)])], widths)
    sound = tuple(name for name in physics if name in table.H and name in table.A)
    if not table.amounts or len(sound) < 2:
        return leave_undecided(BAND_RULES, f"no two models with physics{of} have a band of {level_text(level)}")
    cells = cells[(cells["N_D"] == table.amounts[-1]) & cells["foundation"].isin([*sound, NO_MODEL])]
    of_model = {str(name): [held[cell] for cell in mine] for name, mine in cells.groupby("foundation")["cell"]}
    kinds = np.array([results.kinds[str(name)] for name in run])
    known = [frozenset(results.bands[cell].kinds) for cell in cells["cell"] if results.bands[cell].kinds]
    case = BandEvidence(
        Widths(replace(table, A={name: table.A[name] for name in sound}), sound, rivals),
        Promise(
            np.mean([one for ones in of_model.values() for one in ones], axis=0),
            run,
            level,
            kinds,
            frozenset.intersection(*known) if known else None,
        ),
        [coverage_share(np.mean(of_model[name], axis=0), run) for name in sound],
    )
    notes = (f"bands{of}" if of else "", too_few_manoeuvres(table.runs))
    return judge_claims(BAND_RULES, case, "; ".join(note for note in notes if note))


def _width_table(errors: ErrorTable, cells: pd.DataFrame, widths: Mapping[str, Array]) -> ErrorTable:
    """Widths [m] of cells by test manoeuvre in place of H."""
    amounts = tuple(N for N in errors.amounts if N in set(cells["N_D"]))
    H = {
        str(name): np.array([[widths[cell] for cell in mine["cell"][mine["N_D"] == N]] for N in amounts])
        for name, mine in cells.sort_values("seed", kind="stable").groupby("foundation")
    }
    return replace(errors, amounts=amounts, H=H)


def _judge_widths(bands: BandEvidence) -> Judgement:
    decided, evidence, numbers = judge_width_trend(bands.widths)
    if not numbers:
        return decided, evidence, numbers
    hold = least_to_greatest(percent_text(min(bands.shares)), percent_text(max(bands.shares)))
    return decided, f"{evidence}; these bands hold {hold} of whole paths", numbers


def judge_width_trend(widths: Widths) -> Judgement:
    """Verdict on B1, without the shares that the bands hold."""
    table, models, last = widths.table, widths.physics, len(widths.table.amounts) - 1
    if widths.rivals:
        good, bad = sorted(models, key=lambda model: table.mean(model, PHYSICS_ONLY))
        wider = table.compare([[(1.0, bad, last), (-1.0, good, last)]])
        apart = all_significant(table.compare([[(1.0, bad, PHYSICS_ONLY), (-1.0, good, PHYSICS_ONLY)]]).above)
        evidence = (
            f"at N_D = {table.amounts[last]} the mean radius of the band is {length_in_metres(table.mean(bad, last))} "
            f"for {bad}, {length_in_metres(table.mean(good, last))} for {good}: {difference_with_interval(wider)} more"
            f"{'' if apart else f'; {EQUAL_A}'}"
        )
        decided = verdict_of(apart and all_significant(wider.above), apart and any_significant(wider.below))
        return decided, evidence, {"ratio of widths": table.mean(bad, last) / table.mean(good, last)}
    A, each = trend_over_accuracy(table, models)
    slopes = table.compare(each)
    order = np.array([[table.mean(model, k) for model in models] for k in range(len(each))])
    rises = [rank_correlation(A, values) for values in order]
    ends = [f"{difference_with_interval(slopes, k)} at N_D = {table.amounts[k]}" for k in sorted({0, last})]
    evidence = (
        f"for twice the A the mean radius rises by {' and by '.join(ends)}; rank correlation of width and A "
        f"{least_to_greatest(f'{min(rises):.2f}', f'{max(rises):.2f}')} over N_D ({len(A)} models)"
    )
    numbers = {"least rank correlation of width and A": min(rises)}
    numbers |= {f"rise for twice the A at N_D = {table.amounts[last]} [m]": float(slopes.mean[last])}
    return trend_verdict(slopes, A, order), evidence, numbers


def _judge_promise(bands: BandEvidence) -> Judgement:
    """Judge test runs of the kinds that runs of calibration have: bands promise nothing for others."""
    promise, left_out = bands.promise, ""
    if promise.kinds is not None and promise.calibrated is not None:
        like = np.isin(promise.kinds, list(promise.calibrated))
        these, count = sorted(set(promise.kinds[~like])), len(set(promise.run[~like]))
        if count:
            left_out = f"no run of the kind {join_few_names(these)} calibrated them, so they promise nothing for "
            left_out += count_manoeuvres(count)
        if not like.any():
            raise UndecidedClaim(left_out)
        promise = replace(promise, held=promise.held[like], run=promise.run[like])
    decided, evidence, numbers = judge_held_share(promise)
    return decided, f"{evidence}; {left_out}" if left_out else evidence, numbers


def judge_held_share(promise: Promise) -> Judgement:
    """Verdict on B2 over all of these test runs."""
    low, high = share_interval(promise.held, promise.run)
    share, sizes = coverage_share(promise.held, promise.run), np.unique(promise.run, return_counts=True)[1]
    few, level = too_few_manoeuvres(len(sizes)), promise.level
    interval = "" if few else f" [{percent_text(low)}, {percent_text(high)}]"
    each = "" if (sizes == sizes[0]).all() else ", each counts the same"
    hold = f"bands of {level_text(level)} hold {percent_text(share)}{interval} of whole paths"
    decided = "undecided" if few else verdict_of(low >= level - BROKEN_BY, high < level)
    return decided, f"{hold} ({count_manoeuvres(len(sizes))}{each})", {f"share at {level_text(level)}": share}


BAND_RULES: dict[str, ClaimRule[BandEvidence]] = {
    "B1": ClaimRule("more accurate physics gives a narrower band", _judge_widths),
    "B2": ClaimRule("bands hold the share of whole paths that they promise", _judge_promise),
}
