"""What error to expect before there are data, or with more runs than a study has: the law asked, in words."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shipid.errors import ShipidError
from shipid.exchange.law import CELL_KINDS, ExchangeLaw, Physics, UnseenShip
from shipid.metrics import error_of_windows, position_error
from shipid.simulation.approach import vessel_service_speed
from shipid.study.declared import NO_MODEL
from shipid.study.new import draft_simulated
from shipid.study.plan import build_plan
from shipid.study.prepare import obtain_runs, prepare
from shipid.study.results import Results
from shipid.units import length_text, plural_word, significant_digits
from shipid.vessel.load import load_vessel

OFFERED = ("template", "sister", "model-test", "identified", "none")
LIMITS = "Simulated ships taught this law ({ships} of them, {cells} cells, shipid {version}); a real ship may differ."
USUAL_SPEED = 0.75  # of the service speed: ship lengths ahead are run at it, in the ships of the law too
RUNS_TRIED, TESTS_TRIED = 2, 20  # runs of the simulation that gives baseline and floor
DRAWS = 20000


def meet_ship(vessel: str, ahead: float, out: Path) -> UnseenShip:
    """Simulate a vessel as `study new` drafts it, for baseline and floor [m] over a horizon [ship lengths].

    Raises ShipidError where the vessel cannot make the truth of a study.
    """
    ship = load_vessel(vessel)
    draft = draft_simulated({ship.key: ship}, out, ahead).plan
    document: dict[str, Any] = deepcopy(dict(draft.document))
    document["truth"]["manoeuvres"] = RUNS_TRIED + TESTS_TRIED
    document["split"]["test"], document["grid"]["N_D"] = TESTS_TRIED, [RUNS_TRIED]
    document["family"] = [one for one in document["family"] if one["name"] == "nominal"]
    document.pop("claims")
    plan = build_plan(document, out, draft.vessels)
    prepared = prepare(plan, obtain_runs(plan))
    floor = position_error(prepared.known["nominal"].test_paths, prepared.test.future).mean()
    return UnseenShip(
        float(ship.length or np.nan), vessel_service_speed(ship), float(prepared.naive.mean()), float(floor)
    )


def study_cells(results: Results) -> tuple[pd.DataFrame, UnseenShip]:
    """Cells of a finished study as those of the law, the mean over seeds, and its ship.

    The kind of a foundation is the name of its family where that is one of `CELL_KINDS`, else unknown; the floor is A
    of a family `nominal`. Raises ShipidError for a study without a vessel of known length or without results.
    """
    vessels = [one for one in results.plan.vessels.values() if one.length]
    if not vessels:
        raise ShipidError("the law needs a vessel with particulars.L_pp: the study has none", file=results.folder)
    length, speed = float(vessels[0].length or np.nan), vessel_service_speed(vessels[0])
    cells = results.judged_cells
    cells = cells[cells["status"] == "ok"].groupby(["foundation", "family", "N_D"], as_index=False)[["A", "H"]].mean()
    if cells.empty:
        raise ShipidError("no cell has a result: run the study first", file=results.folder)
    ship = UnseenShip(length, speed, float(error_of_windows(results.naive).mean()))
    kinds = cells["family"].where(cells["family"].isin([*CELL_KINDS]), "")
    known: dict[str, Any] = {
        "ship": results.plan.name, "type": "", "bundled": False, "length": length, "speed": speed,
        "froude": ship.froude, "kind": kinds.mask(cells["foundation"] == NO_MODEL, "none"),
        "ahead": results.test.horizon * results.test.step * USUAL_SPEED * speed / length,
        "baseline": ship.baseline, "floor": cells["A"][cells["family"] == "nominal"].mean(),
    }  # fmt: skip
    return cells.assign(**known), ship


def expected_errors(
    law: ExchangeLaw, ship: UnseenShip, foundations: Sequence[Physics], amounts: Sequence[int], ahead: float
) -> pd.DataFrame:
    """A row for each foundation and number of runs: H, the middle, and low and high, its 95 % interval [m].

    ratio, ratio_low, ratio_high : H over that of the first row on the same ship, and its 95 % interval.
    """
    draws = law.expect_all(ship, foundations, amounts, ahead, DRAWS).reshape(DRAWS, -1)
    rows = [(foundation_text(one), amount) for one in foundations for amount in amounts]
    table = pd.DataFrame(rows, columns=["physics", "N_D"])
    for name, values in {"{}": draws, "ratio_{}": draws / draws[:, :1]}.items():
        low, middle, high = np.quantile(values, [0.025, 0.5, 0.975], axis=0)
        table = table.assign(**{name.format("H"): middle, name.format("low"): low, name.format("high"): high})
    return table.rename(columns={"ratio_H": "ratio"})


def foundation_text(foundation: Physics) -> str:
    """Physics in a few words."""
    if isinstance(foundation, tuple):
        return f"{foundation[0]}, A {length_text(foundation[1])} m"
    return foundation if isinstance(foundation, str) else f"A {length_text(foundation)} m"


def likely_physics(kinds: Sequence[str] | None, error: float | None) -> list[Physics]:
    """Physics of some kinds, `OFFERED` where neither is known, or of an error A [m], of a kind or of any."""
    if error is None:
        return list(kinds or OFFERED)
    if len(kinds or []) > 1 or kinds == [NO_MODEL]:
        raise ShipidError("is that of one physics: give one --kind at most, and not 'none'", path="--A")
    return [(kinds[0], error) if kinds else error]


def expectation_sentence(row: pd.Series[Any], ship: UnseenShip, ahead: float) -> str:
    """One row of `expected_errors` in a plain sentence."""
    seconds = ahead * ship.length / (USUAL_SPEED * ship.speed)
    seconds_text = f"{seconds:.0f}" if seconds >= 100 else f"{seconds:.3g}"
    low, middle, high = (significant_digits(float(row[name]), 2) for name in ("low", "H", "high"))
    share = "95 % of ships" if ship.baseline is None else "95 % interval"
    return (
        f"With {row['N_D']} {plural_word(row['N_D'], 'run')} and this physics ({row['physics']}), expect the path to "
        f"err by {middle} m, {share} {low} to {high} m, in the mean over the next {seconds_text} s "
        f"({ahead:.3g} ship lengths)."
    )


def comparison_sentence(table: pd.DataFrame) -> str:
    """Which row of `expected_errors` errs least on the same ship, against the first row."""
    best = table.iloc[int(table["ratio"].argmin())]
    low, middle, high = (significant_digits(float(best[name]), 2) for name in ("ratio_low", "ratio", "ratio_high"))
    way = f"{best['physics']} with {best['N_D']} {plural_word(best['N_D'], 'run')}"
    return f"On the same ship {way} errs least of these, {middle} times as much, 95 % interval {low} to {high}."


def sentences_on_limits(
    law: ExchangeLaw, ship: UnseenShip, foundations: Sequence[Physics], amounts: Sequence[int], ahead: float
) -> list[str]:
    """What lies outside the ships that the law was learned from, a sentence for each."""
    errors = [one[1] if isinstance(one, tuple) else one for one in foundations if not isinstance(one, str)]
    values: dict[str, tuple[str, Sequence[float]]] = {
        "length": ("length [m]", [ship.length]),
        "froude": ("Froude number", [ship.froude]),
        "N_D": ("runs", [amount for amount in amounts if amount > 0]),
        "ahead": ("ship lengths ahead", [ahead]),
        "A": ("A / length", [error / ship.length for error in errors]),
    }
    return [
        f"extrapolated: {words} {value:.3g}, the ships of the law have {low:.3g} to {high:.3g}"
        for name, (words, several) in values.items()
        for low, high in [law.limits[name]]
        for value in several
        if not low * 0.98 <= value <= high * 1.02
    ]
