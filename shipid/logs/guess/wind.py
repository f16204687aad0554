"""Choose the wind: true or apparent, by the names and by what stands still over ground while the ship turns."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, Literal

import numpy as np

from shipid.data.dataset import Array
from shipid.logs.guess.clues import State, unit_in_name
from shipid.logs.guess.commands import likely_unit
from shipid.logs.guess.evidence import Complex
from shipid.logs.guess.words import name_parts, wind_kind
from shipid.logs.mapping import to_si

FEW_ROWS, FAR, BRIEF = 30, np.radians(240.0), 600.0  # rows; turn of the ship; s: parts of a log that show the wind
CLEARLY, STEADY = 0.5, 0.3  # of the change of the wind as the names have it, of the wind speed: less decides
SPEEDS, RARE = ("m/s", "kn", "km/h"), "mph"  # units of a wind without one; that which must fit clearly better
TOWARDS = frozenset("towards toward to nach vers hacia verso naar mot".split())
Kind = Literal["true", "angle", "apparent"]
WORDS = {"true": "the true wind, from north", "angle": "the true wind, from the bow", "apparent": "an apparent wind"}


@dataclass(frozen=True)
class Reading:
    """A way to read two columns: the kind of wind, the unit of its speed, and its direction."""

    kind: Kind
    unit: str
    direction: str


def choose_wind(state: State) -> None:
    """Choose speed and direction of one wind; where the ship turns far, the motion decides how they are meant."""
    if {"apparent_angle", "apparent_speed"} <= set(state.free()):
        why = "the sentence says that it is relative to the bow"
        state.suggest("V_w", "apparent_speed", "m/s", 0.9, why)
        state.suggest("beta_w", "apparent_angle", "deg", 0.9, why, direction="from", relative=True, wrap=True)
    pairs = list(product(state.called("V_w"), state.called("beta_w")))
    if not pairs:
        return
    speed, angle = min(pairs, key=_wind_order)
    kind, said = _wind_kind_of_names(speed, angle)
    parts = name_parts(angle)
    towards = bool({"towards", "toward"} & set(parts)) or parts[-1] in TOWARDS
    drafted = Reading(kind, unit_in_name(speed, "m/s") or "m/s", "towards" if towards else "from")
    seen, why = _by_motion(state, speed, angle, drafted)
    reason = why or (f"the names say {said}" if said else "the log does not show whether it is true or apparent")
    sure = 0.8 if why else 0.5
    state.suggest("V_w", speed, seen.unit, sure, f"by its name; {reason}")
    custom = "" if {"from"} & set(parts) or towards else ", as is usual at sea"
    meant = f"by its name; taken as {seen.direction!r}{custom if seen.direction == drafted.direction else ''}"
    more: dict[str, Any] = {} if seen.kind == "true" else {"relative": True if seen.kind == "apparent" else "angle"}
    turn = likely_unit(state, angle, "beta_w")
    state.suggest("beta_w", angle, turn, sure, meant, direction=seen.direction, wrap=True, **more)


def _wind_order(pair: tuple[str, str]) -> tuple[bool, bool]:
    """Speed and direction of one wind first, then those of the true wind; else the order of the names."""
    kinds = [wind_kind(name) for name in pair]
    return len({*kinds} - {""}) > 1, "true" not in kinds


def _wind_kind_of_names(speed: str, angle: str) -> tuple[Kind, str]:
    """Kind of wind by the names, and the words for it; empty where they do not say it."""
    kinds = {wind_kind(speed), wind_kind(angle)} - {""}
    said = kinds.pop() if len(kinds) == 1 else ""
    if said == "apparent":
        return "apparent", said
    if "twa" in name_parts(angle):
        return "angle", "the angle of the true wind from the bow"
    return "true", said


def _by_motion(state: State, speed: str, angle: str, drafted: Reading) -> tuple[Reading, str]:
    """The reading in which the wind stands still while the ship turns, and why; the drafted one where none does."""
    if state.velocity is None:
        return drafted, ""
    size = state.columns[speed]
    beta = state.columns[angle] * to_si(likely_unit(state, angle, "beta_w"), "beta_w")
    spans = _turning_parts(state.t, state.psi)
    written = unit_in_name(speed, "m/s")
    units: tuple[str, ...] = (written,) if written else (*SPEEDS, RARE)
    readings = [drafted, Reading("true", drafted.unit, drafted.direction)]
    readings += [Reading("angle", drafted.unit, drafted.direction)]
    readings += [Reading("apparent", unit, way) for unit in units for way in ("from", "towards")]
    readings = list(dict.fromkeys(readings))
    if not spans or np.ptp(size) == 0 == np.ptp(beta):
        return drafted, ""
    left: dict[Reading, float] = {}
    for one in readings:
        wind = _over_ground(state, one, size * to_si(one.unit, "V_w"), beta)
        parts = [_wind_unevenness(state.t[span], wind[span]) for span in spans]
        left[one] = float(np.sqrt(np.mean(np.square(parts))))
    best = min(left, key=left.__getitem__)
    usual = min((one for one in readings if written or one.unit != RARE), key=left.__getitem__)
    best = usual if left[best] > CLEARLY * left[usual] else best
    mean = float(np.mean(np.abs(size))) * to_si(best.unit, "V_w")
    if best == drafted or left[best] > CLEARLY * left[drafted] or left[best] > STEADY * max(mean, 1e-9):
        return drafted, ""
    plain = Reading(best.kind, drafted.unit, drafted.direction)
    if best != plain and left[best] > CLEARLY * left.get(plain, np.inf):
        best = plain  # the kind is sure, unit and direction are not
    alike = {one.unit for one in left if one.kind == best.kind and left[one] < left[best] / CLEARLY}
    if best.kind == "apparent" and len(alike) > 1:
        rivals = ", ".join(sorted(alike - {best.unit}))
        state.ask(("V_w",), f"is {speed!r} in {best.unit}? The motion of the ship fits {rivals} nearly as well")
    how = {"apparent": f" in {best.unit}, {best.direction!r}"}.get(best.kind, "")
    turned = f"while the ship turns, {WORDS[best.kind]}{how}, changes by {left[best]:.2g} m/s (RMS)"
    state.find(
        "kind of wind",
        (speed, angle),
        0.8,
        f"{turned}, and as {WORDS[drafted.kind]} in {drafted.unit}, {drafted.direction!r}, by {left[drafted]:.2g}",
    )
    return best, turned


def _turning_parts(t: Array, psi: Array) -> list[slice]:
    """Parts of a log in which the ship turns far."""
    edges = np.searchsorted(t, np.arange(t[0], t[-1] + BRIEF, BRIEF))
    spans = [slice(int(a), int(b)) for a, b in pairwise(edges) if b - a >= FEW_ROWS]
    return [span for span in spans if np.ptp(psi[span]) >= FAR]


def _over_ground(state: State, reading: Reading, size: Array, beta: Array) -> Complex:
    """The true wind (N,) [m/s] towards which it blows, north + i east, as one reading has it."""
    assert state.velocity is not None
    way = -1.0 if reading.direction == "from" else 1.0
    wind = way * size * np.exp(1j * beta)
    if reading.kind == "true":
        return np.asarray(wind)
    wind = wind * np.exp(1j * state.psi)
    return np.asarray(wind + state.velocity if reading.kind == "apparent" else wind)


def _wind_unevenness(t: Array, wind: Complex) -> float:
    """RMS [m/s] by which a wind leaves one that drifts evenly."""
    since = t - t.mean()
    still = np.stack([np.ones_like(since), since], axis=1)
    return float(np.std(wind - still @ np.linalg.lstsq(still, wind, rcond=None)[0]))
