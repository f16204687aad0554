"""Verdicts on what a study claims: R1-R4 at full scale, S1-S7 on the map H(A, N_D), B1-B2 on bands."""

from __future__ import annotations

from shipid.answer.findings_bands import BAND_RULES, band_findings
from shipid.answer.findings_full_scale import FULL_SCALE_RULES, full_scale_findings
from shipid.answer.findings_simulation import SIMULATION_RULES, simulation_findings
from shipid.answer.verdict import ClaimVerdict, leave_undecided
from shipid.study.plan import unfair_reason
from shipid.study.results import Results


def judge_findings(results: Results) -> list[ClaimVerdict]:
    """Verdicts on what the study claims: R1-R4 (method, section 5), S1-S7 (section 4), both or none; then B1-B2."""
    claims = results.plan.study.claims
    if claims is None or not (results.cells["status"] == "ok").any():
        return []
    unfair = unfair_reason(results.plan, results.test.spans)
    rivals, simulated = claims.accurate is not None, claims.moderate is not None
    roles = (claims.moderate, claims.high) if simulated else (claims.accurate, claims.inaccurate)
    physics = [one.name for role in roles for one in results.plan.foundations if one.family == role]
    verdicts: list[ClaimVerdict] = []
    if rivals:
        verdicts += leave_undecided(FULL_SCALE_RULES, unfair) if unfair else full_scale_findings(results)
    if simulated:
        verdicts += leave_undecided(SIMULATION_RULES, unfair) if unfair else simulation_findings(results)
    if rivals or simulated:
        of_bands = leave_undecided(BAND_RULES, unfair) if unfair else band_findings(results, physics, not simulated)
        verdicts += of_bands
    return verdicts
