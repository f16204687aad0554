"""Verdicts on the findings of the method, each with its numbers: R1-R4 here, S1-S7 and B1-B2 (bands) beside.

R1-R4 (method, section 5) are taken at the largest amount of data, from paired differences over test manoeuvres, as
S1-S7 are: "shown" means a 95 % interval free of 0.

R1 : both models have H below A.
R2 : H of the inaccurate model is less than 10 % above A of the accurate one: the one whose A is smaller on the test,
    whichever the study calls accurate. Where that is not shown of either, it must hold of both.
R3 : the models differ less in H than in A: both A gap - H gap and A gap + H gap are above 0, where a gap is the error
    of the model with the larger A less that of the other.
R4 : at every step ahead no physics has a larger error than every other predictor, physics alone included; refuted
    if one of them is worse over the whole horizon.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipid.metrics import position_error
from shipid.study import findings_bands as of_bands
from shipid.study import findings_simulation as simulated
from shipid.study.declared import NO_MODEL
from shipid.study.error_table import ALONE, ErrorTable, error_table
from shipid.study.evidence import contrasts
from shipid.study.plan import unfair_reason
from shipid.study.results import Results, judged_cells
from shipid.study.schema import Claims
from shipid.study.verdict import (
    WHICH,
    Finding,
    Verdict,
    every,
    manoeuvres,
    measured,
    metres,
    some,
    too_few,
    undecided,
    verdict,
    words,
)
from shipid.units import percent

Array = NDArray[np.float64]
CLAIMS = {
    "R1": "compensated physics beats the physics alone, accurate or not",
    "R2": "the inaccurate model, compensated, is about as good as the accurate physics alone",
    "R3": "the gap between accurate and inaccurate physics shrinks after compensation",
    "R4": f"{words(NO_MODEL)} is worst over the whole horizon",
}
ABOUT = 0.10  # R2: "about as good" means a mean error at most 10 % above


@dataclass(frozen=True)
class Rivals:
    """What R1-R4 compare at one amount of data.

    table : errors by test manoeuvre; its last amount counts.
    good, bad : the accurate and the inaccurate model.
    steps : predictor -> (T, R) mean error [m] at every step ahead; `none` and all others that do not see the test.
    """

    table: ErrorTable
    good: str
    bad: str
    steps: dict[str, Array]


def findings(results: Results) -> list[Finding]:
    """Verdicts on what the study claims: R1-R4 (method, section 5), S1-S7 (section 4), both or none; then B1-B2."""
    claims = results.plan.study.claims
    if claims is None or not (results.cells["status"] == "ok").any():
        return []
    unfair = unfair_reason(results.plan, results.test.spans)
    verdicts: list[Finding] = []
    if claims.accurate is not None:
        verdicts += undecided(CLAIMS, unfair) if unfair else _full_scale(results, claims)
    if claims.moderate is not None:
        verdicts += undecided(simulated.CLAIMS, unfair) if unfair else simulated.simulation_findings(results)
    roles = (claims.accurate, claims.inaccurate) if claims.moderate is None else (claims.moderate, claims.high)
    physics = [one.name for role in roles for one in results.plan.foundations if one.family == role]
    if unfair:
        return [*verdicts, *undecided(of_bands.CLAIMS, unfair)]
    return [*verdicts, *of_bands.band_findings(results, physics, claims.moderate is None)] if verdicts else []


def _full_scale(results: Results, claims: Claims) -> list[Finding]:
    """R1-R4 on the test manoeuvres of a study."""
    names = {one.family: one.name for one in results.plan.foundations if one.family in claims.roles.values()}
    good, bad = names[str(claims.accurate)], names[str(claims.inaccurate)]
    table = error_table(results, (good, bad))
    if any(name not in table.H for name in (good, bad, NO_MODEL)):
        return undecided(CLAIMS, "a cell that it needs has failed or is missing")
    if any(name not in table.A for name in (good, bad)):
        return undecided(CLAIMS, "the physics of a claim is identified again in every cell, so it has no single A")
    return judged(Rivals(table, good, bad, _steps(results, table.amounts[-1])))


def judged(rivals: Rivals, remedy: str = "`shipid study rotate` tests other runs in turn") -> list[Finding]:
    """Verdicts on R1-R4; all undecided with fewer test manoeuvres than give an interval, which needs a remedy."""
    table, good, bad = rivals.table, rivals.good, rivals.bad
    place = len(table.amounts) - 1
    gains = table.compare([[(1.0, model, ALONE), (-1.0, model, place)] for model in (good, bad)])
    less, more = sorted((good, bad), key=lambda model: table.mean(model, ALONE))  # the roles say nothing of the test
    gap = [(1.0, more, ALONE), (-1.0, less, ALONE)]
    about = table.compare(
        [
            [(1 + ABOUT, less, ALONE), (-1.0, more, place)],
            [(1 + ABOUT, more, ALONE), (-1.0, less, place)],
            [(1.0, less, ALONE), (-1.0, more, place)],
        ]
    )
    apart = every(table.compare([gap]).above)
    either = slice(0, 1 if apart else 2)
    gaps = table.compare([[*gap, (sign, more, place), (-sign, less, place)] for sign in (-1.0, 1.0)])
    before, after = (abs(table.mean(bad, at) - table.mean(good, at)) for at in (ALONE, place))
    narrower = gaps.mean[0] < gaps.mean[1]  # the one that counts: the gap of H has the sign of that of A, or not
    share, worst, worst_of_all = _worst(rivals)
    verdicts: dict[str, Verdict] = {
        "R1": verdict(every(gains.above), some(gains.below)),
        "R2": verdict(every(about.above[either]), every(about.below[either])),
        "R3": verdict(every(gaps.above), some(gaps.below)),
        "R4": worst_of_all,
    }
    alone, H = ({model: table.mean(model, at) for model in (good, bad)} for at in (ALONE, place))
    evidence = {
        "R1": "; ".join(
            f"{model} {metres(alone[model])} -> {metres(H[model])}, {measured(gains, k)} less"
            for k, model in enumerate((good, bad))
        ),
        "R2": f"inaccurate and compensated {metres(H[more])}, accurate alone {metres(alone[less])}: "
        f"{measured(about, 2)} less{'' if apart else f'; {WHICH}'}",
        "R3": f"gap {metres(before)} before, {metres(after)} after: {measured(gaps, 0 if narrower else 1)} less",
        "R4": (
            f"{words(NO_MODEL)} is worst at {percent(share)} of the steps, physics alone included; "
            f"most often worst: {worst}"
            if len(rivals.steps[NO_MODEL]) > 1
            else f"worst over the horizon, physics alone included: {worst}"
        ),
    }
    numbers = {
        "R1": {"H / A, accurate": H[good] / alone[good], "H / A, inaccurate": H[bad] / alone[bad]},
        "R2": {"H inaccurate / A accurate": H[more] / alone[less]},
        "R3": {"gap before [m]": before, "gap after [m]": after},
        "R4": {"share of steps where it is worst": share},
    }
    note = too_few(table.runs)
    if note:
        note += f": {remedy}"
    return [
        Finding(
            id=key,
            claim=claim,
            verdict=verdicts[key],
            evidence=f"{evidence[key]}; {note or manoeuvres(table.runs)}",
            numbers=numbers[key],
        )
        for key, claim in CLAIMS.items()
    ]


def _worst(rivals: Rivals) -> tuple[float, str, Verdict]:
    """Share of steps at which `none` has the largest mean error, who most often has it, and the verdict on R4."""
    weights = rivals.table.weights
    means = np.stack([error @ weights for error in rivals.steps.values()])
    names = list(rivals.steps)
    worst = np.bincount(means.argmax(axis=0), minlength=len(names))
    pure = rivals.steps[NO_MODEL]
    others = [error for name, error in rivals.steps.items() if name != NO_MODEL]
    noise = float(rivals.table.noise[-1])
    ahead = np.concatenate([pure - error for error in others])
    training = noise * np.concatenate([np.hypot(pure @ weights, error @ weights) for error in others])
    each = contrasts(ahead, rivals.table.counts, training)
    whole = np.stack([(pure - error).mean(axis=0) for error in others])
    over = noise * np.array([np.hypot((pure @ weights).mean(), (error @ weights).mean()) for error in others])
    decided = verdict(every(each.above), some(contrasts(whole, rivals.table.counts, over).below))
    return float(worst[names.index(NO_MODEL)] / worst.sum()), words(names[int(worst.argmax())]), decided


def by_step(path: Array, future: Array, run: NDArray[np.str_]) -> Array:
    """(T, R) mean error [m] of a path at every step ahead in every test manoeuvre, by name."""
    error = position_error(path, future)
    return np.stack([error[:, run == name].mean(axis=1) for name in np.unique(run)], axis=1)


def _steps(results: Results, N_D: int) -> dict[str, Array]:
    """Errors by step of every predictor at an amount of data, mean over seeds, and of physics alone."""
    aside = {one.name for one in results.plan.foundations if one.family in results.aside}
    test = results.test
    parts: dict[str, list[Array]] = {}
    cells = judged_cells(results)
    for row in cells[cells["N_D"] == N_D].itertuples():
        if row.cell in results.paths and row.model not in aside:
            parts.setdefault(str(row.model), []).append(by_step(results.paths[str(row.cell)], test.future, test.run))
    for model, path in results.physics.items():
        if model not in (NO_MODEL, *aside) and np.isfinite(path).all():
            parts[f"{model} alone"] = [by_step(path, test.future, test.run)]
    return {name: np.mean(errors, axis=0) for name, errors in parts.items()}
