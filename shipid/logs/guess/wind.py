"""Choose the wind: true or apparent, by the names and by what stands still over ground while the ship turns."""

from __future__ import annotations

from itertools import pairwise, product
from typing import Any

import numpy as np

from shipid.data.dataset import Array
from shipid.logs.guess.clues import State
from shipid.logs.guess.commands import likely_unit
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.guess.words import name_parts, unit_in_name, wind_kind
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
    pairs = {pair: [wind_kind(name) for name in pair] for pair in product(state.called("V_w"), state.called("beta_w"))}
    if not pairs:
        return
    # speed and direction of one wind, the true one
    pair = min(pairs, key=lambda one: (len({*pairs[one]} - {""}) > 1, "true" not in pairs[one]))
    speed, angle = pair
    said, parts = {*pairs[pair]} - {""}, name_parts(angle)
    towards = bool({"towards", "toward"} & {*parts}) or parts[-1] in TOWARDS
    named = "apparent" if said == {"apparent"} else "angle" if "twa" in parts else "true"
    drafted = named, unit_in_name(speed, "m/s") or "m/s", "towards" if towards else "from"
    change = _changes_of_readings(state, speed, angle, drafted)
    left = {
        one: float(np.log(size))
        + 0.7 * ((one[0] != named) + (one[1:] != drafted[1:]) + (one[1] == "mph" != drafted[1]))
        for one, size in change.items()
    }  # 0.7 for each part that is not as the names have it
    best = min(left, key=left.__getitem__)
    sure, why = 0.5, f"the names say {named}" if said else "the log does not show whether it is true or apparent"
    steady = change[best] < SETTINGS.steady * float(np.mean(np.abs(state.columns[speed]))) * to_si(best[1], "V_w")
    if best == drafted or not steady:
        best = drafted
    else:
        sure, why = 0.8, f"while the ship turns, {WORDS[best[0]]} in {best[1]}, {best[2]!r}, changes by"
        why += f" {change[best]:.2g} m/s (RMS)"
        usual = f"as {WORDS[named]} in {drafted[1]}, {drafted[2]!r}, by {change[drafted]:.2g}"
        state.find("kind of wind", pair, 0.8, f"{why}, and {usual}")
        rivals = {one[1] for one in left if one[0] == best[0] and left[one] < left[best] + SETTINGS.usual_unit}
        if best[0] == "apparent" and len(rivals) > 1:
            others = ", ".join(sorted(rivals - {best[1]}))
            state.ask(("V_w",), f"is {speed!r} in {best[1]}? The motion of the ship fits {others} nearly as well")
    state.suggest("V_w", speed, best[1], sure, f"by its name; {why}")
    more: dict[str, Any] = {} if best[0] == "true" else {"relative": True if best[0] == "apparent" else "angle"}
    custom = ", as is usual at sea" * (not towards and "from" not in parts and best == drafted)
    why, unit = f"by its name; taken as {best[2]!r}{custom}", likely_unit(state, angle, "beta_w")
    state.suggest("beta_w", angle, unit, sure, why, direction=best[2], wrap=True, **more)


def _changes_of_readings(
    state: State, speed: str, angle: str, drafted: tuple[str, str, str]
) -> dict[tuple[str, str, str], float]:
    """Kind, unit and direction of a wind -> RMS of its change [m/s] while the ship turns; 1 where it does not."""
    size, turn = state.columns[speed], to_si(likely_unit(state, angle, "beta_w"), "beta_w")
    edges = np.searchsorted(state.t, np.arange(state.t[0], state.t[-1] + BRIEF, BRIEF))
    spans = [slice(int(a), int(b)) for a, b in pairwise(edges) if b - a >= FEW_ROWS and np.ptp(state.psi[a:b]) >= FAR]
    if not spans or state.velocity is None or not np.ptp(size) > 0:
        return {drafted: 1.0}
    written = unit_in_name(speed, "m/s")
    readings = [drafted, *((kind, *drafted[1:]) for kind in ("true", "angle"))]
    readings += product(["apparent"], [written] if written else ["m/s", "kn", "km/h", "mph"], ["from", "towards"])
    change = {}
    for kind, unit, way in readings:
        wind = (-1.0 if way == "from" else 1.0) * to_si(unit, "V_w") * size * np.exp(1j * turn * state.columns[angle])
        wind = wind if kind == "true" else wind * np.exp(1j * state.psi) + state.velocity * (kind == "apparent")
        parts = [_wind_unevenness(state.t[span], wind[span]) for span in spans]
        change[kind, unit, way] = float(np.sqrt(np.mean(np.square(parts)))) + 1e-9
    return change


def _wind_unevenness(t: Array, wind: Complex) -> float:
    """RMS [m/s] by which a wind leaves one that drifts evenly."""
    still = np.stack([np.ones_like(t), t - t.mean()], axis=1)
    return float(np.std(wind - still @ np.linalg.lstsq(still, wind, rcond=None)[0]))
