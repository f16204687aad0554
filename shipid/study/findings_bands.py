"""Findings B1 and B2: what better physics is worth in the width of a band, and whether bands keep their promise.

The width is the mean radius [m] of the band of the study's level over the horizon, a mean over windows of each test
manoeuvre; it is judged as errors are (`shipid.study.evidence`).

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
from numpy.typing import NDArray

from shipid.metrics import rank_correlation, share_of
from shipid.report.wording import listed
from shipid.study.bands import of_methods, regions, share_interval
from shipid.study.declared import NO_MODEL
from shipid.study.error_table import ALONE, ErrorTable, error_table
from shipid.study.evidence import FEWEST_MODELS, by_chance, doubling
from shipid.study.plan import judged_method
from shipid.study.results import Results, judged_cells
from shipid.study.verdict import (
    SAME_A,
    WHICH,
    Finding,
    every,
    finding,
    manoeuvres,
    measured,
    metres,
    some,
    span,
    too_few,
    undecided,
    verdict,
)
from shipid.units import level_text, percent

Array = NDArray[np.float64]
CLAIMS = {
    "B1": "more accurate physics gives a narrower band",
    "B2": "bands hold the share of whole paths that they promise",
}
SHORT = 0.05  # B2: a share that lies so far below its level is a broken promise


@dataclass(frozen=True)
class Widths:
    """What B1 compares: widths in place of H, at the amounts of data at which every model has a band.

    physics : models with physics. rivals : whether they are the accurate and the inaccurate model.
    """

    table: ErrorTable
    physics: tuple[str, ...]
    rivals: bool = False


def band_findings(results: Results, physics: Sequence[str], rivals: bool) -> list[Finding]:
    """Verdicts on B1 and B2 for models with physics (none of them sees the test); undecided where none has a band.

    rivals : as in `Widths`.
    """
    if not results.complete:
        return undecided(CLAIMS, results.missing)
    level, run = results.plan.study.bands.level, results.test.run
    of = of_methods(results, [judged_method(results.plan)])
    bands = {
        str(row["cell"]): (by_level[level].radius.mean(axis=0), by_level[level].holds(errors))
        for row, by_level, errors in regions(results, [level])
    }
    table = _width_table(results, physics, {cell: width for cell, (width, _) in bands.items()})
    sound = tuple(name for name in physics if name in table.H and name in table.A)
    if not table.amounts or len(sound) < 2:
        return undecided(CLAIMS, f"no two models with physics{of} have a band of {level_text(level)}")
    cells = judged_cells(results)
    judged = [name for name in (*sound, NO_MODEL) if name in table.H]  # a model with a failed cell may have no band
    cells = cells[(cells["N_D"] == table.amounts[-1]) & cells["foundation"].isin(judged)]
    held = {name: [bands[cell][1] for cell in mine] for name, mine in cells.groupby("foundation")["cell"]}
    shares = [share_of(np.mean(held[name], axis=0), run) for name in sound]
    first = narrower(Widths(replace(table, A={name: table.A[name] for name in sound}), sound, rivals))
    first["evidence"] += f"; these bands hold {span(percent(min(shares)), percent(max(shares)))} of whole paths"
    whole = np.mean([one for ones in held.values() for one in ones], axis=0)
    second = _of_known_kinds(whole, run, level, results.kinds, [results.bands[cell].kinds for cell in cells["cell"]])
    notes = "".join(f"; {note}" for note in (f"bands{of}" if of else "", too_few(table.runs)) if note)
    return [Finding(**{**one, "evidence": one["evidence"] + notes}) for one in (first, second)]


def _of_known_kinds(
    held: Array, run: NDArray[np.str_], level: float, kinds: Mapping[str, str], calibrated: Sequence[Mapping[str, int]]
) -> Finding:
    """Verdict on B2 without test runs of a kind that no run of calibration has: bands promise nothing for them.

    held, run : as for `kept_promise`. kinds : test run -> kind of manoeuvre. calibrated : kinds of each band, if known.
    """
    new = {str(name) for name in run if any(known and kinds[str(name)] not in known for known in calibrated)}
    if not new:
        return kept_promise(held, run, level)
    these = listed(sorted({kinds[name] for name in new}))
    left_out = f"no run of the kind {these} calibrated them, so they promise nothing for {manoeuvres(len(new))}"
    like = ~np.isin(run, list(new))
    if not like.any():
        return finding(CLAIMS, "B2", "undecided", left_out)
    kept = kept_promise(held[like], run[like], level)
    return Finding(**{**kept, "evidence": f"{kept['evidence']}; {left_out}"})


def narrower(widths: Widths) -> Finding:
    """Verdict on B1, without the shares that the bands hold."""
    table, models = widths.table, widths.physics
    last = len(table.amounts) - 1
    if widths.rivals:
        good, bad = sorted(models, key=lambda model: table.mean(model, ALONE))  # the roles say nothing of the test
        wider = table.compare([[(1.0, bad, last), (-1.0, good, last)]])
        apart = every(table.compare([[(1.0, bad, ALONE), (-1.0, good, ALONE)]]).above)
        evidence = (
            f"at N_D = {table.amounts[last]} the mean radius of the band is {metres(table.mean(bad, last))} for {bad}, "
            f"{metres(table.mean(good, last))} for {good}: {measured(wider, 0)} more"
        )
        evidence += "" if apart else f"; {WHICH}"
        ratio = table.mean(bad, last) / table.mean(good, last)
        decided = verdict(apart and every(wider.above), apart and some(wider.below))
        return finding(CLAIMS, "B1", decided, evidence, **{"ratio of widths": ratio})
    if len(models) < FEWEST_MODELS:
        return finding(CLAIMS, "B1", "undecided", f"{len(models)} models with physics, a trend needs {FEWEST_MODELS}")
    A = np.array([table.mean(model, ALONE) for model in models])
    if np.isclose(A.min(), A.max()):
        return finding(CLAIMS, "B1", "undecided", SAME_A)
    weights, places = doubling(np.log(A)), range(len(table.amounts))
    slopes = table.compare([[(float(w), m, k) for w, m in zip(weights, models, strict=True)] for k in places])
    order = np.array([[table.mean(model, k) for model in models] for k in places])
    rises = [rank_correlation(A, values) for values in order]
    shown = (np.maximum(side, by_chance(A, sign * order)) for side, sign in ((slopes.above, 1), (slopes.below, -1)))
    risen, fallen = shown
    ends = [f"{measured(slopes, k)} at N_D = {table.amounts[k]}" for k in sorted({0, last})]
    evidence = (
        f"for twice the A the mean radius rises by {' and by '.join(ends)}; rank correlation of width and A "
        f"{span(f'{min(rises):.2f}', f'{max(rises):.2f}')} over N_D ({len(A)} models)"
    )
    numbers = {"least rank correlation of width and A": min(rises)}
    numbers |= {f"rise for twice the A at N_D = {table.amounts[last]} [m]": float(slopes.mean[last])}
    return finding(CLAIMS, "B1", verdict(every(risen), some(fallen)), evidence, **numbers)


def kept_promise(held: Array, run: NDArray[np.str_], level: float) -> Finding:
    """Verdict on B2 from held (S,), the share of models whose band holds the path of a window, and its run (S,)."""
    low, high = share_interval(held, run)
    share, sizes = share_of(held, run), np.unique(run, return_counts=True)[1]
    count = len(sizes)
    interval = "" if too_few(count) else f" [{percent(low)}, {percent(high)}]"
    each = "" if (sizes == sizes[0]).all() else ", each counts the same"
    hold = f"bands of {level_text(level)} hold {percent(share)}{interval} of whole paths"
    evidence = f"{hold} ({manoeuvres(count)}{each})"
    decided = verdict(low >= level - SHORT, high < level)
    numbers = {f"share at {level_text(level)}": share}
    return finding(CLAIMS, "B2", decided if not too_few(count) else "undecided", evidence, **numbers)


def _width_table(results: Results, physics: Sequence[str], widths: Mapping[str, Array]) -> ErrorTable:
    """Widths of cells (S,) [m] in place of H, by test manoeuvre, at the amounts at which every judged cell has one."""
    cells, errors = judged_cells(results), error_table(results, physics)
    mine = cells[cells["foundation"].isin(errors.H)]
    without = set(mine["N_D"][~mine["cell"].isin(widths)])
    amounts = tuple(N for N in errors.amounts if N not in without)
    run = results.test.run
    known = {
        (row.foundation, row.N_D, row.seed): [widths[str(row.cell)][run == one].mean() for one in np.unique(run)]
        for row in mine[~mine["N_D"].isin(without)].itertuples()
    }
    seeds, names = sorted(set(cells["seed"])), sorted(set(mine["foundation"]))
    H = {name: np.array([[known[name, N, seed] for seed in seeds] for N in amounts]) for name in names}
    return replace(errors, amounts=amounts, H=H)
