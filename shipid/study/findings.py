"""Verdicts on the findings of the method, each with its numbers: R1-R4 here, S1-S7 beside."""

from __future__ import annotations

import numpy as np
import pandas as pd

from shipid.metrics import over_horizon, position_error
from shipid.study.advise import by_model
from shipid.study.findings_simulation import simulation_findings
from shipid.study.plan import NO_MODEL, Claims
from shipid.study.results import Results, judged_cells
from shipid.study.verdict import Finding, interval, metres, undecided, verdict

CLAIMS = {
    "R1": "compensation beats its own physics model, accurate or not",
    "R2": "the inaccurate model, compensated, is about as good as the accurate physics alone",
    "R3": "the gap between accurate and inaccurate physics shrinks after compensation",
    "R4": "pure data-driven prediction is worst over the whole horizon",
}
ABOUT = 0.10  # R2: "about as good" means a mean error at most 10 % above


def findings(results: Results) -> list[Finding]:
    """Verdicts on what the study claims: R1-R4 (method, section 5), S1-S7 (section 4), both or none."""
    claims = results.plan.study.claims
    if claims is None or not (results.cells["status"] == "ok").any():
        return []
    found = _full_scale(results, claims) if claims.accurate is not None else []
    return [*found, *(simulation_findings(results) if claims.moderate is not None else [])]


def _full_scale(results: Results, claims: Claims) -> list[Finding]:
    """R1-R4 at the largest amount of data."""
    table = by_model(results)
    largest = int(table["N_D"].max())
    top = table[table["N_D"] == largest].set_index("family")
    if any(name not in top.index for name in (claims.accurate, claims.inaccurate, NO_MODEL)):
        return undecided(CLAIMS, "a cell that it needs has failed or is missing")
    good, bad = top.loc[[claims.accurate]].iloc[0], top.loc[[claims.inaccurate]].iloc[0]
    worst, share = _worst_share(results, largest)
    gaps = _gaps(results, claims, largest)
    gap_before, gap_after = abs(bad["A"] - good["A"]), abs(bad["H"] - good["H"])
    verdicts = {
        "R1": verdict(all(row["high"] < row["A"] for row in (good, bad)), all(r["H"] < r["A"] for r in (good, bad))),
        "R2": verdict(bad["high"] <= (1 + ABOUT) * good["A"], bad["H"] <= (1 + ABOUT) * good["A"]),
        "R3": verdict(bool((gaps < gap_before).all()), gap_after < gap_before),
        "R4": verdict(share == 1.0, share > 0.5),
    }
    H = {
        role: metres(row["H"]) + interval(row["low"], row["high"], int(row["seeds"]))
        for role, row in (("good", good), ("bad", bad))
    }
    evidence = {
        "R1": f"{good['model']} {metres(good['A'])} -> {H['good']}; {bad['model']} {metres(bad['A'])} -> {H['bad']}",
        "R2": f"inaccurate and compensated {H['bad']}, accurate alone {metres(good['A'])}",
        "R3": f"gap {metres(gap_before)} before, {metres(gap_after)} after",
        "R4": f"pure data-driven is worst at {share:.0%} of the steps, physics alone included; "
        f"most often worst: {worst}",
    }
    numbers = {
        "R1": {"H / A, accurate": good["H"] / good["A"], "H / A, inaccurate": bad["H"] / bad["A"]},
        "R2": {"H inaccurate / A accurate": bad["H"] / good["A"]},
        "R3": {"gap before [m]": gap_before, "gap after [m]": gap_after},
        "R4": {"share of steps where it is worst": share},
    }
    return [
        Finding(id=key, claim=claim, verdict=verdicts[key], evidence=evidence[key], numbers=numbers[key])
        for key, claim in CLAIMS.items()
    ]


def _gaps(results: Results, claims: Claims, N_D: int) -> pd.Series:
    """Difference [m] of H between the accurate and the inaccurate model, of every seed that has both."""
    cells = judged_cells(results)
    cells = cells[(cells["status"] == "ok") & (cells["N_D"] == N_D)]
    H = cells.pivot_table(index="seed", columns="family", values="H")
    return (H[claims.accurate] - H[claims.inaccurate]).dropna().abs()


def _worst_share(results: Results, N_D: int) -> tuple[str, float]:
    """Which predictor, physics alone included, is most often worst over the horizon; share of steps where `none` is."""
    curves: dict[str, list[np.ndarray]] = {}
    aside = {one.name for one in results.plan.foundations if one.family in results.plan.aside}
    cells = judged_cells(results)
    for row in cells[cells["N_D"] == N_D].itertuples():
        if row.cell in results.paths and row.model not in aside:
            error = position_error(results.paths[str(row.cell)], results.test.future)
            curves.setdefault(str(row.model), []).append(over_horizon(error)["mean"])
    for model, path in results.physics.items():
        if model not in (NO_MODEL, *aside) and np.isfinite(path).all():
            error = position_error(path, results.test.future)
            curves[f"{model} alone"] = [over_horizon(error)["mean"]]
    names = list(curves)
    worst = np.argmax([np.mean(curves[name], axis=0) for name in names], axis=0)
    counts = np.bincount(worst, minlength=len(names))
    share = float(counts[names.index(NO_MODEL)] / counts.sum()) if NO_MODEL in names else 0.0
    return names[int(np.argmax(counts))], share
