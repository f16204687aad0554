"""Choose the wind: true or apparent, by the names and by what stands still over ground while the ship turns."""

from __future__ import annotations

from itertools import pairwise, product
from typing import Any

import numpy as np

from shipid.data.dataset import Array
from shipid.logs.guess.clues import State, unit_in_name
from shipid.logs.guess.commands import likely_unit
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.guess.words import name_parts, wind_kind
from shipid.logs.mapping import to_si

FEW_ROWS, FAR, BRIEF = 30, np.radians(240.0), 600.0  # rows; turn of the ship; s: parts of a log that show the wind
TOWARDS = frozenset("towards toward to nach vers hacia verso naar mot".split())
WORDS = {"true": "the true wind, from north", "angle": "the true wind, from the bow", "apparent": "an apparent wind"}


def choose_wind(state: State) -> None:
    """Choose speed and direction of one wind; where the ship turns far, the motion decides how they are meant."""
    if {"apparent_angle", "apparent_speed"} <= {*state.free()}:
        why = "the sentence says that it is relative to the bow"
        state.suggest("V_w", "apparent_speed", "m/s", 0.9, why)
        state.suggest("beta_w", "apparent_angle", "deg", 0.9, why, direction="from", relative=True, wrap=True)
    pairs = list(product(state.called("V_w"), state.called("beta_w")))
    if not pairs:
        return
    kinds = {
        pair: [wind_kind(name) for name in pair] for pair in pairs
    }  # speed and direction of one wind, the true one
    pair = min(pairs, key=lambda one: (len({*kinds[one]} - {""}) > 1, "true" not in kinds[one]))
    speed, angle = pair
    said, parts = {*kinds[pair]} - {""}, name_parts(angle)
    towards = bool({"towards", "toward"} & {*parts}) or parts[-1] in TOWARDS
    named = "apparent" if said == {"apparent"} else "angle" if "twa" in parts else "true"
    drafted = named, unit_in_name(speed, "m/s") or "m/s", "towards" if towards else "from"
    change = _changes_of_readings(state, speed, angle, drafted)
    left = {one: float(np.log(size)) + _prior_cost(one, drafted) for one, size in change.items()}
    best = min(left, key=left.__getitem__)
    changes = change[best]
    steady = changes < SETTINGS.steady * float(np.mean(np.abs(state.columns[speed]))) * to_si(best[1], "V_w")
    sure, why = 0.5, f"the names say {named}" if said else "the log does not show whether it is true or apparent"
    if best != drafted and steady:
        sure, why = (
            0.8,
            f"while the ship turns, {WORDS[best[0]]} in {best[1]}, {best[2]!r}, changes by {changes:.2g} m/s",
        )
        usual = f"as {WORDS[named]} in {drafted[1]}, {drafted[2]!r}, by {change[drafted]:.2g}"
        state.find("kind of wind", pair, 0.8, f"{why} (RMS), and {usual}")
        rivals = {one[1] for one in left if one[0] == best[0] and left[one] < left[best] + SETTINGS.usual_unit}
        if best[0] == "apparent" and len(rivals) > 1:
            others = ", ".join(sorted(rivals - {best[1]}))
            state.ask(("V_w",), f"is {speed!r} in {best[1]}? The motion of the ship fits {others} nearly as well")
    else:
        best = drafted
    state.suggest("V_w", speed, best[1], sure, f"by its name; {why}")
    more: dict[str, Any] = {} if best[0] == "true" else {"relative": True if best[0] == "apparent" else "angle"}
    custom = ", as is usual at sea" * (not towards and "from" not in parts and best == drafted)
    meant = f"by its name; taken as {best[2]!r}{custom}"
    state.suggest(
        "beta_w", angle, likely_unit(state, angle, "beta_w"), sure, meant, direction=best[2], wrap=True, **more
    )


def _prior_cost(one: tuple[str, str, str], drafted: tuple[str, str, str]) -> float:
    """What speaks against a reading that is not as the names have it."""
    return 0.7 * ((one[0] != drafted[0]) + (one[1:] != drafted[1:]) + (one[1] == "mph" != drafted[1]))


def _changes_of_readings(
    state: State, speed: str, angle: str, drafted: tuple[str, str, str]
) -> dict[tuple[str, str, str], float]:
    """Kind, unit and direction of a wind -> RMS of its change [m/s] while the ship turns; 1 where it does not."""
    size, turn = state.columns[speed], to_si(likely_unit(state, angle, "beta_w"), "beta_w")
    edges = np.searchsorted(state.t, np.arange(state.t[0], state.t[-1] + BRIEF, BRIEF))
    spans = [slice(int(a), int(b)) for a, b in pairwise(edges) if b - a >= FEW_ROWS]
    spans = [span for span in spans if np.ptp(state.psi[span]) >= FAR]
    readings = [drafted, ("true", *drafted[1:]), ("angle", *drafted[1:])]
    written = unit_in_name(speed, "m/s")
    units = (written,) if written else ("m/s", "kn", "km/h", "mph")
    readings += [("apparent", unit, way) for unit in units for way in ("from", "towards")]
    change = {drafted: 1.0}
    for one in readings if spans and state.velocity is not None and np.ptp(size) > 0 else ():
        kind, unit, way = one
        wind = (-1.0 if way == "from" else 1.0) * to_si(unit, "V_w") * size * np.exp(1j * turn * state.columns[angle])
        wind = wind if kind == "true" else wind * np.exp(1j * state.psi)
        wind = wind + state.velocity if kind == "apparent" and state.velocity is not None else wind
        parts = [_wind_unevenness(state.t[span], wind[span]) for span in spans]
        change[one] = float(np.sqrt(np.mean(np.square(parts)))) + 1e-9
    return change


def _wind_unevenness(t: Array, wind: Complex) -> float:
    """RMS [m/s] by which a wind leaves one that drifts evenly."""
    still = np.stack([np.ones_like(t), t - t.mean()], axis=1)
    return float(np.std(wind - still @ np.linalg.lstsq(still, wind, rcond=None)[0]))
