"""Choose the commands: rudder, azimuth and shaft columns by name, their sign and unit by what they do to the ship."""

from __future__ import annotations

import re
from itertools import product
from typing import Any

import numpy as np

from shipid.data.dataset import Array
from shipid.logs.frames import may_wrap
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import SEEN, State, unit_in_name
from shipid.logs.guess.twins import choose_twins, twin_columns
from shipid.logs.guess.words import (
    is_electrical,
    is_engine,
    is_order,
    meaning_scores,
    name_parts,
    number_in_name,
    units_in_name,
)
from shipid.logs.mapping import to_si
from shipid.physics.signals import SIGNALS, is_command, is_shaft, is_steering, rows_of_role, signal_of

AZIMUTH = "thruster"  # component of the command of an azimuth unit whose name has no side
SCREW = SIGNALS["n"].component  # of a shaft speed or pitch without a side: that of the azimuth unit where there is one
FOLLOWED = 0.4  # correlation of the yaw rate with an order before it, from which its sign is taken, else
ADVANCE = 0.01  # way of the ship in one turn of the shaft, over the radius of a usual turn; of ships 0.002 to 0.05
FASTEST = 200.0  # rev/s: no shaft is faster, not that of a small craft that turns within a length, either
QUICK = 50.0  # rev/s: few screws are as fast, and per cent of a shaft speed are such numbers
TOGETHER = 0.2  # of the range of a column: how far twin rudders are apart
TUNNELS = ("bow", "stern")  # places of a screw that does not drive the ship
USUAL = np.radians(20.0)  # rudder angle of a usual turn
LARGEST = 47.0  # deg: of a rudder; what is larger may be no angle
BOTH_SIDES = 0.2  # of all turning, that is to the lesser side
SHARES = {
    ("per cent", "%", "pct", "percent", "prozent"): 100.0,
    ("per mille", "‰", "permille", "promille", "permil"): 1000.0,
    ("shares of 1", "norm", "normalised", "normalized", "-1..1", "-1...1", "-1 to 1", "p.u.", "pu"): 1.0,
}
"""Words for a share of the largest value -> what that value is in it."""
ASTERN = -0.5  # mean cosine of an azimuth angle, at most, that points aft
GEARED = 5.0  # rev/s: an engine that is faster usually has a gear
UNDER_WAY, NEARLY_ALWAYS = 0.3, 0.9  # of the usual way in a window; share of these windows
RUNS = 0.5  # of the larger speeds of a shaft: one that is slower may not drive the ship
NEAR = 15.0  # times from that: a unit further off is doubted


def choose_commands(state: State) -> None:
    """Choose angles that steer, then shafts and pitches; without any, throttles of two sides."""
    r = state.r if state.r is not None else np.gradient(state.psi, state.t)
    used: dict[str, int] = {}
    azimuth = _choose_steering(state, r, used)
    _choose_thrust(state, azimuth, used)
    if not any(is_command(one.name) and is_shaft(one.name) for one in state.suggestions):
        choose_twins(state, r)


def _choose_steering(state: State, r: Array, used: dict[str, int]) -> bool:
    """Choose the columns that steer, with their sign; return whether one is of an azimuth unit."""
    angles = _columns_named_for(state, [signal for signal in rows_of_role("command") if is_steering(signal)])
    turned = {name for name, signal in angles if _centre_angle(state, name, signal)}
    power = {name: state.effect(r, state.columns[name]) for name in state.eligible()}
    by_name = bool(angles)
    if not angles:
        # an order is held: rows repeat the value before, to 1/100 of the range; a response such as roll does not
        screws = _screw_columns(state)
        strength = {
            name: power[name] * (0.05 + float(np.mean(np.abs(np.diff(values)) < 1e-2 * np.ptp(values))))
            for name in power
            for values in [state.columns[name]]
            if _is_small_angle(values) and name not in screws
        }
        likely = max(strength, key=lambda name: abs(strength[name]), default="")
        angles = [(likely, "delta")] if likely and abs(strength[likely]) > SEEN else []
    azimuth = any(SIGNALS[signal].component == AZIMUTH for _, signal in angles)
    for name, signal in angles:
        unit = likely_unit(state, name, signal)
        effect = power.get(name, 0.0)
        extra: dict[str, Any] = {"wrap": True} if name in turned else {}
        followed = 0.0
        why = "by its name; it is not seen to turn the ship, so that its sign is not known"
        confidence = 0.5 if by_name else 0.4
        if by_name and abs(effect) <= SEEN:
            span = float(np.median(state.t[state.chosen.last] - state.t[state.chosen.first]))
            followed = evidence.order_correlation(state.t, r, state.columns[name], span)
            if abs(followed) > FOLLOWED:
                effect = float(1.01 * SEEN * np.sign(followed))
            else:
                followed = 0.0
        if state.astern and signal == "delta":
            effect = -effect
            state.ask(
                (signal,),
                "the ship goes astern, and a rudder is taken to turn her the other way there"
                f": is {name!r} positive to {'starboard' if effect > 0 else 'port'}?",
            )
        if abs(effect) > SEEN:
            state.turning[name] = float(np.sign(effect))
            confidence = 0.95 if by_name else 0.55
            # sides to which it turns the ship, and to which it does not
            sides = ("starboard", "port") if effect > 0 else ("port", "starboard")
            seen = f"t value {abs(effect):.0f}" if followed == 0.0 else f"correlation {abs(followed):.2f}"
            seen += ", the other way astern" * (state.astern and signal == "delta")
            why = f"positive turns the ship to {sides[0]} ({seen})"
            if (effect > 0) != (SIGNALS[signal].turns > 0):  # an azimuth is taken for one aft of the origin
                extra["sign"] = -1
                state.find(
                    "wrong sign of rudder",
                    (name,),
                    confidence,
                    f"positive {name!r} turns to {sides[0]} ({seen}); here to {sides[1]}",
                )
        share = _ask_for_share(state, name, signal, unit)
        if share or (signal == "delta" and name not in turned and _ask_for_side(state, name, r)):
            confidence, why = 0.3, f"by its name; up to {float(np.abs(state.columns[name]).max()):.4g}"
            why += share or ", and never negative"
            if not share:
                extra.pop("sign", None)
                state.findings[:] = [one for one in state.findings if one.columns != (name,)]
        if signal == "alpha":
            _ask_for_half_turn(state, name, unit, int(extra.get("sign", 1)))
        side = state.side_of(name)
        component = side or SIGNALS[signal].component
        if signal == "delta" and side:
            component = f"{side}_rudder"
        state.suggest(
            _command_of_column(state, name, f"{component}.{signal}", used), name, unit, confidence, why, **extra
        )
    _ask_if_opposite(state)
    return azimuth


def _ask_if_opposite(state: State) -> None:
    angles = [one for one in state.suggestions if is_command(one.name) and one.source in state.turning]
    for port, starboard in product(angles, angles):
        sides = state.side_of(port.source), state.side_of(starboard.source)
        same = signal_of(port.name) == signal_of(starboard.name) and sides == ("port", "starboard")
        if same and state.turning[port.source] != state.turning[starboard.source]:
            state.ask(
                (port.name, starboard.name),
                f"{port.source!r} and {starboard.source!r} are seen to turn the ship to opposite sides"
                f": do they count so, or is the sign of one wrong?",
            )


def _ask_for_share(state: State, name: str, signal: str, unit: str) -> str:
    """Ask where an angle may be a share of its largest one, or has an unknown unit; what its name says of that."""
    top = float(np.abs(state.columns[name]).max())
    said = {text.strip().lower() for text in units_in_name(name)} | {*name_parts(name)[-1:], *re.findall("[%‰]", name)}
    for words, full in SHARES.items():
        if said & set(words):
            remedy = f"Write factor = (deg at {full:g}) / {full:g}"
            state.ask((signal,), f"{name!r} is in {words[0]}: of which angle? {remedy}")
            return " of an angle that the log does not say"
    if unit_in_name(name, SIGNALS[signal].unit) is not None or not is_steering(signal):
        return ""
    if state.ask_for_unit(signal, name, unit):
        return " in a unit that is not known"
    others = next((one.unit for one in state.suggestions if one.name == "psi"), None)
    if unit == "rad" and (others == "deg" or top == 1.0) and top <= 1.0:
        state.ask(
            (signal,),
            f"{name!r}, up to {top:.4g}, has no unit: rad, deg, or a share (-1 to 1) of the largest angle?"
            f" rad is a guess",
        )
    elif signal == "delta" and top > LARGEST:
        state.ask(
            (signal,),
            f"{name!r}, up to {top:.4g}, has no unit: deg, or per cent or per mille of the largest angle?"
            f" deg is a guess",
        )
    return ""


def _ask_for_side(state: State, name: str, r: Array) -> bool:
    """Ask where a rudder angle is never negative and the ship turns to both sides; return whether it is so."""
    values = state.columns[name]
    if values.min() < 0 or np.ptp(values) == 0:
        return False
    sides = [float(np.sum(np.clip(sign * r, 0, None))) for sign in (1, -1)]
    if min(sides) < BOTH_SIDES * sum(sides):
        return False
    state.ask(
        ("delta",),
        f"{name!r} is never negative, but the ship turns to both sides: which column says the side of the rudder, "
        f"or which value is amidships (offset)?",
    )
    return True


def _ask_for_half_turn(state: State, name: str, unit: str, sign: int) -> None:
    """Ask where an azimuth angle is about half a turn while the ship goes ahead: it may say where the water goes."""
    turn = to_si(unit, "x.alpha")
    astern = state.astern or any(np.mean(state.columns[one] < 0) > 0.5 for one in state.called("n"))
    if astern or np.mean(np.cos(turn * state.columns[name])) > ASTERN:
        return
    half = f"offset = {-sign * np.pi / turn:.9g} ({unit})"
    state.ask(
        ("alpha",),
        f"{name!r} is about half a turn while the ship goes ahead: does it say where the water goes?"
        f" Then write {half}; here 0 is a thrust ahead",
    )


def _screw_columns(state: State) -> set[str]:
    """Columns that are no rudder: their names say a screw, or the two sides do not move together as twin rudders do."""
    columns = state.columns
    apart = {
        name
        for pair in twin_columns(state)
        if np.ptp(columns[pair[0]] - columns[pair[1]]) > TOGETHER * max(np.ptp(columns[name]) for name in pair)
        for name in pair
    }
    return apart | {
        name for signal in rows_of_role("command") if not is_steering(signal) for name in state.called(signal)
    }


def _centre_angle(state: State, name: str, signal: str) -> bool:
    """Put an angle that jumps at a whole turn within half a turn of zero; return whether it does."""
    values = state.columns[name]
    size = to_si(likely_unit(state, name, signal), f"x.{signal}")
    turn = 2 * np.pi / size
    jumps = np.abs(np.diff(values)) > 0.8 * turn
    if not jumps.any() or not may_wrap(size * values, f"x.{signal}"):
        return False
    state.columns[name] = np.asarray((values + turn / 2) % turn - turn / 2)
    return True


def _columns_named_for(state: State, signals: list[str]) -> list[tuple[str, str]]:
    """The columns whose names fit one of the signals best, and the signal: measured ones rather than orders."""
    orders: dict[str, tuple[float, str]] = {}
    for signal in signals:
        said = [name for name in state.free() if signal_of(state.command_of(name)) == signal]
        for name in said:
            orders[name] = (1.0, signal)
        for name in state.called(signal):
            score = meaning_scores(name)[signal]
            others = max(
                (value for meaning, value in meaning_scores(name).items() if meaning not in signals), default=0.0
            )
            if (
                not state.command_of(name)
                and score >= others
                and score > orders.get(name, (0.0, ""))[0]
                and np.ptp(state.columns[name]) >= 0
            ):
                orders[name] = (score, signal)
    groups: dict[tuple[str | int | None, str], list[str]] = {}
    sides = {name: state.side_of(name) for name in orders}
    still = {name: not np.ptp(state.columns[name]) for name in orders}  # a feedback that is not connected comes last
    for name in sorted(orders, key=lambda one: (still[one], is_order(one), -orders[one][0])):
        side, number = sides[name], number_in_name(name)
        both = f"{side} {number}" if side and number and state.commands else side or number
        groups.setdefault((state.command_of(name) or both, orders[name][1]), []).append(name)
    chosen = []
    sided = any(place is not None and not str(place).startswith(TUNNELS) for place, _ in groups)
    for (place, signal), names in groups.items():
        if place is None and sided and is_order(names[0]):
            continue
        kept = names[:1]
        if len(names) > 1:
            rest = ", ".join(map(repr, names[1:]))
            state.find(
                "several columns for one command", tuple(names), 0.6, f"{names[0]!r} is taken, of the same: {rest}"
            )
        chosen += [(name, signal) for name in kept]
    order = list(state.columns)
    return sorted(chosen, key=lambda entry: order.index(entry[0]))


def _is_small_angle(values: Array) -> bool:
    return bool(0 < np.abs(values).max() < 95 and np.ptp(values) > 0)


def _choose_thrust(state: State, azimuth: bool, used: dict[str, int]) -> None:
    for signal in (signal for signal in rows_of_role("command") if not is_steering(signal)):
        for name, _ in sorted(_columns_named_for(state, [signal]), key=lambda one: state.side_of(one[0]) in TUNNELS):
            usual = SIGNALS[signal].component
            fallback = AZIMUTH if azimuth and usual == SCREW else usual
            component = state.side_of(name) or fallback
            if SIGNALS[signal].shaft:
                tunnel = component in TUNNELS and not is_electrical(name)
                unit, confidence, why, extra = (_tunnel_unit if tunnel else _shaft_unit)(state, name)
                if not tunnel and not azimuth and _runs_astern(state, name):
                    extra = {**extra, "sign": -1}
                    state.find(
                        "wrong sign of the shaft",
                        (name,),
                        0.9,
                        f"{name!r} is negative while the ship goes ahead; here ahead is positive",
                    )
            else:
                written = unit_in_name(name, SIGNALS[signal].unit)
                unit, confidence, extra = likely_unit(state, name, signal), 0.9 if written else 0.7, {}
                confidence = 0.3 if not written and state.ask_for_unit(signal, name, unit) else confidence
                why = f"by its name; up to {float(np.abs(state.columns[name]).max()):.4g}"
            state.suggest(
                _command_of_column(state, name, f"{component}.{signal}", used), name, unit, confidence, why, **extra
            )


def _runs_astern(state: State, name: str) -> bool:
    middle = (state.chosen.first + state.chosen.last) // 2
    ahead = (state.chosen.change(state.position) * np.exp(-1j * state.psi[middle])).real
    fast = ahead > UNDER_WAY * float(np.percentile(np.abs(ahead), 90))
    return bool(fast.any() and np.mean(state.columns[name][middle[fast]] < 0) > NEARLY_ALWAYS)


def _tunnel_unit(state: State, name: str) -> tuple[str, float, str, dict[str, Any]]:
    """The same as `_shaft_unit` of a screw that does not drive the ship: her way says nothing of its unit."""
    top = float(np.abs(state.columns[name]).max())
    why = f"by its name; up to {top:.4g}"
    written = unit_in_name(name, "rev/s")
    if written is not None and written != "%":
        return written, 0.9, why, {}
    if written == "%":
        return _shaft_unit(state, name)
    others = [one.unit for one in state.suggestions if one.name.endswith(".n")]
    unit = others[0] if others else likely_unit(state, name, "n")
    state.ask(
        ("n",), f"in which unit is {name!r}, up to {top:.4g}? The way of the ship does not say: {unit} is a guess"
    )
    return unit, 0.4, f"{why}; in {unit} as the other shafts" if others else why, {}


def _shaft_unit(state: State, name: str) -> tuple[str, float, str, dict[str, Any]]:
    """Unit, confidence, reason and further keys of a shaft speed, by the distance of the ship in one turn."""
    values = state.columns[name]
    top = float(np.abs(values).max())
    written = unit_in_name(name, "rev/s")
    why = f"by its name; up to {top:.4g}"
    if is_electrical(name):
        remedy = "Write factor = 2 / poles; a gear divides it further"
        state.ask(("n",), f"{name!r}, up to {top:.4g}, is the electrical speed of a motor: of how many poles? {remedy}")
        return "rpm", 0.3, f"{why} electrical rpm, of a number of poles that the log does not say", {"factor": 1.0}
    if written == "%":
        state.ask(("n",), f"{name!r} is in per cent: of which shaft speed? Write factor = (rpm at 100 %) / 100")
        return "rpm", 0.3, f"{why} per cent of a shaft speed that the log does not say", {"factor": 1.0}
    off = {unit: _off_advance(state, values, unit) for unit in ("rpm", "rev/s")}
    by_motion = min(off, key=lambda unit: off[unit])
    if written is not None:
        far = off.get(written, 1.0)
        if written in off and far > NEAR and off[by_motion] < NEAR / 3 and by_motion != written:
            state.find(
                "unit of the shaft",
                (name,),
                0.6,
                f"{name!r} says {written}, but the ship would run {far:.0f} times too far or too little in a turn"
                f" of the shaft: it is read in {by_motion}",
            )
            return by_motion, 0.6, f"{why}; the way in a turn of the shaft says {by_motion}", {}
        if written in ("rpm", "rev/s") and top * to_si(written, "propeller.n") > GEARED and is_engine(name):
            state.ask(
                ("n",),
                f"{name!r}, up to {top:.4g} {written}, is the speed of an engine: is there a gear?"
                f" Write factor = 1 / its ratio",
            )
        return written, 0.9, why, {}
    if state.ask_for_unit("n", name, by_motion):
        return by_motion, 0.3, f"{why} in a unit that is not known", {}
    if top <= 130.0 and off[by_motion] < NEAR and (by_motion == "rpm" or top > QUICK):
        state.ask(("n",), f"{name!r}, up to {top:.4g}, has no unit: {by_motion}, or per cent of a shaft speed?")
    if off[by_motion] > NEAR or not np.isfinite(off[by_motion]):
        unit = likely_unit(state, name, "n")
        state.ask(("n",), f"in which unit is {name!r}, up to {top:.4g}? {unit} is a guess")
        return unit, 0.4, why, {}
    angles = next((one.unit for one in state.suggestions if one.name == "psi"), "")
    if by_motion == "rev/s" and angles == "rad" and _off_advance(state, values, "rad/s") < NEAR:
        state.ask(("n",), f"{name!r}, up to {top:.4g}, has no unit: rev/s, or rad/s, as angles are in rad here?")
        return by_motion, 0.5, f"{why}; the way in a turn of the shaft says rev/s or rad/s", {}
    return by_motion, 0.7, f"{why}; the way in a turn of the shaft says {by_motion}", {}


def _off_advance(state: State, values: Array, unit: str) -> float:
    """How many times the way in a turn of the shaft, in turning radii, is off that of a usual ship."""
    if np.abs(values).max() * to_si(unit, "propeller.n") > FASTEST:
        return np.inf
    shaft = np.abs(values[(state.chosen.first + state.chosen.last) // 2]) * to_si(unit, "propeller.n")
    runs = shaft > RUNS * np.percentile(shaft, 95)
    turned = state.chosen.change(state.psi).real / (state.t[state.chosen.last] - state.t[state.chosen.first])
    rate = float(np.percentile(np.abs(turned[runs]), 90)) / _hard_over(state) if runs.any() else 0.0
    if rate == 0.0:
        return np.inf
    ratio = rate / float(np.median(shaft[runs])) / ADVANCE
    return max(ratio, 1.0 / ratio)


def _hard_over(state: State) -> float:
    """The larger rudder angles over that of a usual turn, at most 1: small ones turn the ship less."""
    for column in state.suggestions:
        if column.name.endswith(".delta"):
            angle = np.abs(state.columns[column.source]) * to_si(column.unit, "rudder.delta")
            return float(np.clip(np.percentile(angle, 90) / USUAL, 0.05, 1.0))
    return 1.0


def likely_unit(state: State, name: str, signal: str) -> str:
    """The unit of a column taken as this signal: the unit in its name, else the likely one by its magnitude."""
    row = SIGNALS[signal]
    large = row.read_as_SI is not None and float(np.abs(state.columns[name]).max()) > row.read_as_SI
    written = unit_in_name(name, row.unit)
    if written is not None and written != "%":
        return written
    heading = next((one.unit for one in state.suggestions if one.name == "psi"), None)
    if row.angle and row.role == "motion" and heading == row.read_in:  # a roll of a degree is no roll of a radian
        return row.read_in
    return row.read_in if large or (row.shaft and re.search(row.read_in, name.lower())) else row.unit


def _command_of_column(state: State, column: str, usual: str, used: dict[str, int]) -> str:
    """The command that a column orders: that of the vessel which its name says, else the usual one."""
    said = state.command_of(column)
    if said:
        return said
    for one in filter(None, map(state.command_of, state.columns)):
        used.setdefault(one, 1)
    return unique_name(usual, used)


def unique_name(name: str, used: dict[str, int]) -> str:
    """The name of a column, with a number after its component where it is used already."""
    used[name] = used.get(name, 0) + 1
    component, _, signal = name.partition(".")
    new = name if used[name] == 1 else f"{component}_{used[name]}.{signal}"
    return unique_name(name, used) if new != name and new in used else new
