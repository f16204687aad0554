"""Choose the commands: names say what a column may be; what the ship does after it changes its sense, zero and unit."""

from __future__ import annotations

import re
from itertools import combinations
from typing import Any

import numpy as np

from shipid.data.dataset import Array
from shipid.logs.frames import may_wrap
from shipid.logs.guess import evidence
from shipid.logs.guess.clues import LIKELY, STRONG, State, unit_of_another
from shipid.logs.guess.settings import SETTINGS
from shipid.logs.guess.words import (
    ORDERS,
    SOURCES,
    is_electrical,
    is_engine,
    is_known_word,
    is_order,
    meaning_scores,
    name_parts,
    number_in_name,
    side_in_name,
    unit_in_name,
    units_in_name,
)
from shipid.logs.mapping import UNITS, to_si
from shipid.physics.signals import SIGNALS, is_command, is_shaft, is_steering, rows_of_role, signal_of

AZIMUTH = "thruster"  # component of the command of an azimuth unit whose name has no side
TUNNELS = ("bow", "stern")  # places of a screw that does not drive the ship
LARGEST = 47.0  # deg: of a rudder; what is larger may be no angle
FASTEST, GEARED = 200.0, 5.0  # rev/s: no shaft is faster; an engine that is faster usually has a gear
PULSES = (700.0, 2300.0)  # us: what a servo takes is about 1500, from 1000 to 2000
NOISE = 0.02  # of the range of an order: less is no motion of it
SERVO, OFF_SERVO = 1500.0, 100.0  # us: its middle, and how far a stopped screw may be from it
SHARES = {
    ("per cent", "%", "pct", "percent", "prozent"): 100.0,
    ("per mille", "‰", "permille", "promille", "permil"): 1000.0,
    ("shares of 1", "norm", "normalised", "normalized", "-1..1", "-1...1", "-1 to 1", "p.u.", "pu"): 1.0,
}
"""Words for a share of the largest value -> what that value is in it."""
OF_ACTUATORS = frozenset(
    "throttle throttles lever levers thrust thruster motor motors engine esc pwm power gas servo rcou "
    "chan channel out us raw actuator actuators outputs motors".split()
)
"""Words that say an order of an actuator, and not of which kind."""


def choose_commands(state: State) -> None:
    """Choose angles, shafts and pitches by name and effect; then orders of actuators by their effect alone."""
    r = state.r if state.r is not None else np.gradient(state.psi, state.t)
    used: dict[str, int] = {}
    angles = _columns_named_for(state, [signal for signal in rows_of_role("command") if is_steering(signal)])
    for name, signal in angles:
        _take_angle(state, r, name, signal, used)
    azimuth = any(signal == "alpha" for _, signal in angles)
    for signal in (signal for signal in rows_of_role("command") if not is_steering(signal)):
        named = _columns_named_for(state, [signal])
        for name, _ in sorted(named, key=lambda one: state.side_of(one[0]) in TUNNELS):
            _take_thrust(state, name, signal, azimuth, used)
    steered = bool(angles)
    if not any(is_command(one.name) and is_shaft(one.name) for one in state.suggestions):
        steered = _take_actuators(state, r, steered, used) or steered
    if not steered:
        _take_unnamed_rudder(state, r, used)
    if not any(is_command(one.name) and is_shaft(one.name) for one in state.suggestions):
        _take_unnamed_shafts(state, azimuth, used)


def _columns_named_for(state: State, signals: list[str]) -> list[tuple[str, str]]:
    """The columns whose names fit one of the signals best, and the signal: measured ones rather than orders."""
    fits: dict[str, tuple[float, str]] = {}
    for signal in signals:
        for name in state.free():
            scores, said = meaning_scores(name), state.command_of(name)
            score = (
                1.0
                if signal_of(said) == signal
                else 0.0
                if said or name not in state.called(signal)
                else scores[signal]
            )
            others = max((fit for meaning, fit in scores.items() if meaning not in signals), default=0.0)
            if score > fits.get(name, (0.0, ""))[0] and (said or score >= others):
                fits[name] = score, signal
    groups: dict[tuple[str | int | None, str], list[str]] = {}
    still = {name: not np.ptp(state.columns[name]) for name in fits}  # a feedback that is not connected comes last
    for name in sorted(fits, key=lambda one: (still[one], is_order(one), -fits[one][0])):
        side, number = state.side_of(name), number_in_name(name)
        both = f"{side} {number}" if side and number and state.commands else side or number
        if not both and (both := _unknown_place(name, [one for one in fits if fits[one][1] == fits[name][1]])):
            words = "is it of another side than those of like name, and of which, or an order or feedback of the same?"
            state.ask((fits[name][1],), f"{name!r}: {words} No word of the name says so")
        groups.setdefault((state.command_of(name) or both, fits[name][1]), []).append(name)
    sided = any(place and not str(place).startswith(TUNNELS) for place, _ in groups)
    chosen = []
    for (place, signal), names in groups.items():
        if not place and sided and is_order(names[0]):
            continue
        if len(names) > 1:
            rest = ", ".join(map(repr, names[1:]))
            words = f"{names[0]!r} is taken, of the same: {rest}"
            state.find("several columns for one command", tuple(names), 0.6, words)
        chosen.append((names[0], signal))
    order = list(state.columns)
    return sorted(chosen, key=lambda entry: order.index(entry[0]))


def _unknown_place(name: str, names: list[str]) -> str:
    """The only word in which a name differs from one of others, where neither is known: a side in another language.

    Of a name of one word its last letter, as of `podp` and `pods`.
    """
    for other in names:
        words = [re.findall(r"[^\W\d_]+", one) for one in (name, other)]
        if len(words[0]) == len(words[1]) == 1:
            words = [[one[0][:-1], one[0]] for one in words]
        odd = [pair for pair in zip(*words, strict=False) if pair[0] != pair[1]]
        if len(words[0]) == len(words[1]) and len(odd) == 1 and not any(map(is_known_word, odd[0])):
            return str(odd[0][0])
    return ""


# --- angles ---


def _take_angle(state: State, r: Array, name: str, signal: str, used: dict[str, int], sure: bool = True) -> None:
    """Suggest a column as an angle that steers, with the sign that the yaw rate shows; pulses as those of a servo."""
    if are_pulses(state.columns[name]):
        _take_servo(state, name, state.effect(r, state.columns[name]), used, signal)
        return
    turned = _centre_angle(state, name, signal)
    unit = likely_unit(state, name, signal)
    extra: dict[str, Any] = {"wrap": True} if turned else {}
    effect = state.effect(r, state.columns[name])
    top = float(np.abs(state.columns[name]).max())
    confidence = 0.5 if sure else 0.4
    why = "by its name; it is not seen to turn the ship, so that its sign is not known"
    seen = abs(effect) > SETTINGS.seen
    if seen:
        state.turning[name] = float(np.sign(effect))
        sides = ("starboard", "port") if effect > 0 else ("port", "starboard")
        confidence, why = 0.95 if sure else 0.55, f"positive turns the ship to {sides[0]} (t value {abs(effect):.0f})"
    share = _ask_for_share(state, name, signal, unit)
    unsided = signal == "delta" and not turned and not share and _is_unsided(state, name, r)
    if unsided:
        words = (
            f"{name!r} is never negative, but the ship turns to both sides: which column says the side of the rudder"
        )
        state.ask(("delta",), f"{words}, or which value is amidships (offset)?")
    if share or unsided:
        confidence, why = 0.3, f"{why if share else 'by its name'}; up to {top:.4g}{share or ', and never negative'}"
    if seen and not unsided and (effect > 0) != (SIGNALS[signal].turns > 0):  # an azimuth is one aft of the origin
        extra["sign"] = -1
    if signal == "alpha":
        _ask_for_half_turn(state, name, unit, int(extra.get("sign", 1)))
    state.suggest(_angle_of_column(state, name, signal, used), name, unit, confidence, why, **extra)


def _angle_of_column(state: State, name: str, signal: str, used: dict[str, int]) -> str:
    side = state.side_of(name)
    component = (f"{side}_rudder" if signal == "delta" else side) if side else SIGNALS[signal].component
    return _command_of_column(state, name, f"{component}.{signal}", used)


def _centre_angle(state: State, name: str, signal: str) -> bool:
    """Put an angle that jumps at a whole turn within half a turn of zero; return whether it does."""
    values, size = state.columns[name], to_si(likely_unit(state, name, signal), f"x.{signal}")
    turn = 2 * np.pi / size
    if not np.any(np.abs(np.diff(values)) > 0.8 * turn) or not may_wrap(size * values, f"x.{signal}"):
        return False
    state.columns[name] = np.asarray((values + turn / 2) % turn - turn / 2)
    return True


def _is_unsided(state: State, name: str, r: Array) -> bool:
    """Whether an angle is never negative although the ship turns to both sides."""
    sides = [float(np.sum(np.clip(sign * r, 0, None))) for sign in (1, -1)]
    return bool(state.columns[name].min() >= 0 < np.ptp(state.columns[name]) and min(sides) > 0.2 * sum(sides))


def _ask_for_share(state: State, name: str, signal: str, unit: str) -> str:
    """Ask where an angle may be a share of its largest one, or has an unknown unit; what its name says of that."""
    top = float(np.abs(state.columns[name]).max())
    said = {text.strip().lower() for text in units_in_name(name)} | {*name_parts(name)[-1:], *re.findall("[%‰]", name)}
    for words, full in SHARES.items():
        if said & set(words):
            state.ask(
                (signal,), f"{name!r} is in {words[0]}: of which angle? Write factor = (deg at {full:g}) / {full:g}"
            )
            return " of an angle that the log does not say"
    if unit_in_name(name, SIGNALS[signal].unit) is not None:
        return ""
    if state.ask_for_unit(signal, name, unit):
        return " in a unit that is not known"
    others = next((one.unit for one in state.suggestions if one.name == "psi"), None)
    begins = f"{name!r}, up to {top:.4g}, has no unit"
    if unit == "rad" and (others == "deg" or top == 1.0) and top <= 1.0:
        state.ask((signal,), f"{begins}: rad, deg, or a share (-1 to 1) of the largest angle? rad is a guess")
    elif signal == "delta" and top > LARGEST:
        state.ask((signal,), f"{begins}: deg, or per cent or per mille of the largest angle? deg is a guess")
    return ""


def _ask_for_half_turn(state: State, name: str, unit: str, sign: int) -> None:
    """Ask where an azimuth angle is about half a turn while the ship goes ahead: it may say where the water goes."""
    turn = to_si(unit, "x.alpha")
    astern = any(np.mean(state.columns[one] < 0) > 0.5 for one in state.called("n"))
    if not astern and np.mean(np.cos(turn * state.columns[name])) <= -0.5:
        words = f"{name!r} is about half a turn while the ship goes ahead: does it say where the water goes?"
        half = f"offset = {-sign * np.pi / turn:.9g} ({unit})"
        state.ask(("alpha",), f"{words} Then write {half}; here 0 is a thrust ahead")


def _take_unnamed_rudder(state: State, r: Array, used: dict[str, int]) -> None:
    """Suggest the column that turns the ship most as a rudder: one that is held, as orders are, and no screw."""
    screws = {name for pair in side_pairs(state) if _differ_in_motion(state, pair) for name in pair}
    screws |= {name for signal in rows_of_role("command") for name in state.called(signal) if not is_steering(signal)}
    strength = {}
    for name in state.eligible():
        values = state.columns[name]
        if 0 < np.abs(values).max() < 95 and name not in screws and unit_of_another(name, "delta") is None:
            held = 0.05 + float(np.mean(np.abs(np.diff(values)) < 1e-2 * np.ptp(values)))
            strength[name] = abs(state.effect(r, values)) * held
    likely = max(strength, key=strength.__getitem__, default="")
    if likely and strength[likely] > SETTINGS.seen:
        for name in (likely, *_alike(state, likely)):
            _take_angle(state, r, name, "delta", used, sure=False)


def _take_unnamed_shafts(state: State, azimuth: bool, used: dict[str, int]) -> None:
    """Suggest the column that drives the ship most as a shaft, with those of like names; ask where none does."""
    columns = [name for name in state.eligible() if not meaning_scores(name) and unit_of_another(name, "n") is None]
    columns = [name for name in columns if not _says_actuator(state, name) or _is_plain_actuator(name)]
    push = {name: state.effect(_speed_ahead(state), state.columns[name]) for name in columns}
    likely = max(push, key=push.__getitem__, default="")
    if likely and (push[likely] > SETTINGS.seen or unit_in_name(likely, "rev/s")):
        names = (likely, *_alike(state, likely))
        words = (
            f"{' and '.join(map(repr, names))}: is it the speed of a shaft, and of which side? The name does not say"
        )
        state.ask(("n",), f"{words}; its t value of driving the ship ahead is {push[likely]:.0f}")
        for name in names:
            _take_thrust(state, name, "n", azimuth, used)
    elif columns:
        state.ask(("n",), f"no column is read as the speed of a shaft: is one of {', '.join(map(repr, columns))}?")


def _alike(state: State, name: str) -> list[str]:
    """The free columns whose names differ from this one by a side, or by an unknown word and not much in range."""
    own, found = state.columns[name], [one for pair in side_pairs(state) if name in pair for one in pair]
    for one in (one for one in state.free() if _unknown_place(one, [name])):
        both = np.array([[values.min(), values.max()] for values in (own, state.columns[one])])
        found += [one] if both[:, 1].min() - both[:, 0].max() > np.ptp(both, axis=1).max() / 2 else []
    return [one for one in dict.fromkeys(found) if one != name]


def _speed_ahead(state: State) -> Array:
    return np.real(np.gradient(state.position, state.t) * np.exp(-1j * state.psi))


# --- shafts ---


def _take_thrust(state: State, name: str, signal: str, azimuth: bool, used: dict[str, int]) -> None:
    """Suggest a column as the speed of a shaft, or a pitch, in the unit that the way of the ship shows."""
    usual = SIGNALS[signal].component
    component = state.side_of(name) or (AZIMUTH if azimuth and usual == SIGNALS["n"].component else usual)
    top = float(np.abs(state.columns[name]).max())
    why = f"by its name; up to {top:.4g}"
    extra: dict[str, Any] = {}
    written = unit_in_name(name, SIGNALS[signal].unit)
    if not SIGNALS[signal].shaft:
        unit, confidence = likely_unit(state, name, signal), 0.9 if written else 0.7
        confidence = 0.3 if not written and state.ask_for_unit(signal, name, unit) else confidence
    else:
        tunnel = component in TUNNELS and not is_electrical(name)
        unit, confidence, more, extra = _unit_of_shaft(state, name, written, top, tunnel)
        why += more
        if not tunnel and not azimuth and _runs_astern(state, name):
            extra = {**extra, "sign": -1}
            why += "; negative while the ship goes ahead"
        if not tunnel and _hides_astern(state, name):
            state.ask(
                ("n",),
                f"{name!r} is never negative, but turns while the ship goes astern, or stops: which column says its "
                "sense? Without one its turns astern are taken as ahead",
            )
    state.suggest(_command_of_column(state, name, f"{component}.{signal}", used), name, unit, confidence, why, **extra)


def _unit_of_shaft(
    state: State, name: str, written: str | None, top: float, tunnel: bool
) -> tuple[str, float, str, dict[str, Any]]:
    """Unit, confidence, reason and further keys of a shaft speed, by its name and the way of the ship in one turn."""
    begins, about = f"{name!r}, up to {top:.4g}", ("n",)
    if is_electrical(name) or written == "%":
        electrical = f"{begins}, is the electrical speed of a motor: of how many poles? Write factor = 2 / poles"
        share = f"{name!r} is in per cent: of which shaft speed? Write factor = (rpm at 100 %) / 100"
        state.ask(about, electrical if is_electrical(name) else share)
        return "rpm", 0.3, " of what the log does not say", {"factor": 1.0}
    in_radians = any(one.name == "psi" and one.unit == "rad" for one in state.suggestions)
    prior = {"rpm": 0.0, "rev/s": 0.0, "rad/s": 1.0 if in_radians else SETTINGS.rare}
    off = {unit: np.log(_off_advance(state, state.columns[name], unit)) ** 2 for unit in prior}
    cost = {unit: prior[unit] + one + SETTINGS.rare * (written not in (None, unit)) for unit, one in off.items()}
    unit = min(cost, key=cost.__getitem__)
    if written is not None:
        unit = written if tunnel or not np.isfinite(cost[unit]) else unit
        if unit == written != "rad/s" and top * to_si(unit, "propeller.n") > GEARED and is_engine(name):
            state.ask(
                about, f"{begins} {unit}, is the speed of an engine: is there a gear? Write factor = 1 / its ratio"
            )
        return (
            (unit, 0.9, "", {}) if unit == written else (unit, 0.6, f"; as the way in a turn says, not {written}", {})
        )
    if state.ask_for_unit("n", name, unit):
        return unit, 0.3, " in a unit that is not known", {}
    shafts = [one.unit for one in state.suggestions if one.name.endswith(".n")]
    if tunnel or not off[unit] < SETTINGS.rare:
        unit = shafts[0] if tunnel and shafts else likely_unit(state, name, "n")
        state.ask(about, f"in which unit is {begins}? The way of the ship does not say: {unit} is a guess")
        return unit, 0.4, f"; in {unit} as the other shafts" * bool(tunnel and shafts), {}
    rivals = [one for one in cost if one != unit and cost[one] < cost[unit] + SETTINGS.rare * in_radians]
    rivals += ["per cent of a shaft speed"] * (top <= 130.0 and (unit == "rpm" or top > 50.0))
    if rivals:
        why = ", as angles are in rad here" * ("rad/s" in rivals)
        state.ask(about, f"{begins}, has no unit: {unit}, or {', or '.join(rivals)}{why}?")
    why = f"; the way in a turn of the shaft says {' or '.join([unit, *rivals])}"
    return unit, 0.5 if "rad/s" in rivals else 0.7, why, {}


def _off_advance(state: State, values: Array, unit: str) -> float:
    """How many times the way in a turn of the shaft, in turning radii, is off that of a usual ship."""
    size = to_si(unit, "propeller.n")
    shaft = np.abs(values[(state.chosen.first + state.chosen.last) // 2]) * size
    runs = shaft > 0.5 * np.percentile(shaft, 95)
    turned = state.chosen.change(state.psi).real / (state.t[state.chosen.last] - state.t[state.chosen.first])
    rate = float(np.percentile(np.abs(turned[runs]), 90)) / _hard_over(state) if runs.any() else 0.0
    if rate == 0.0 or np.abs(values).max() * size > FASTEST:
        return np.inf
    ratio = rate / float(np.median(shaft[runs])) / SETTINGS.advance
    return max(ratio, 1.0 / ratio)


def _hard_over(state: State) -> float:
    """The larger rudder angles over the 20 deg of a usual turn, at most 1: small ones turn the ship less."""
    rudders = [one for one in state.suggestions if one.name.endswith(".delta")]
    angles = [np.abs(state.columns[one.source]) * to_si(one.unit, "rudder.delta") for one in rudders[:1]]
    return float(np.clip(np.percentile(angles, 90) / np.radians(20.0), 0.05, 1.0)) if angles else 1.0


def _runs_astern(state: State, name: str) -> bool:
    """Whether a shaft is negative nearly always when the ship goes ahead."""
    ahead, shaft = _way_and_shaft(state, name)
    return bool(np.sum((shaft < 0) & (ahead > 0.3)) > SETTINGS.astern * np.sum(ahead > 0.3))


def _hides_astern(state: State, name: str) -> bool:
    """Whether a shaft that is never negative turns while the ship goes astern or is stopped, on a steady course.

    A ship with half the usual way at that shaft speed, or less, gains way; only a turn, or a screw astern, slows it.
    """
    ahead, shaft = _way_and_shaft(state, name)
    first, last, turned = state.chosen.first, state.chosen.last, np.abs(state.chosen.change(state.psi))
    before, after = (np.interp(state.t[rows], state.t[(first + last) // 2], ahead) for rows in (first, last))
    stopped = (before - after > 0.03) & (ahead * np.percentile(shaft, 90) < 0.5 * shaft)
    astern = (ahead < -0.1) | stopped & (turned < 0.3 * np.percentile(turned, 90))
    t, spans = state.t, evidence.row_spans(astern & (shaft > 0.2 * shaft.max()))
    long = t[first[spans[:, 1] - 1]] - t[first[spans[:, 0]]] > 0.5 * np.median(t[last] - t[first])  # no mere change
    return bool(state.columns[name].min() >= 0.0 and long.any())


def _way_and_shaft(state: State, name: str) -> tuple[Array, Array]:
    """The way ahead over each window, as a share of the usual way, and the shaft in its middle, (W,) each."""
    middle = (state.chosen.first + state.chosen.last) // 2
    ahead = (state.chosen.change(state.position) * np.exp(-1j * state.psi[middle])).real
    return ahead / max(float(np.percentile(np.abs(ahead), 90)), 1e-12), state.columns[name][middle]


# --- actuators whose quantity no name says ---


def _take_actuators(state: State, r: Array, steered: bool, used: dict[str, int]) -> bool:
    """Suggest throttles, pulses and shares by what they do to the ship; return whether one steers.

    Two that turn the ship against each other are screws of two sides, one that turns it a rudder, one that drives it
    a screw.
    """
    speed = _speed_ahead(state)
    columns = [name for name in state.free() if np.ptp(state.columns[name]) > 0 and _may_be_actuator(state, name)]
    pairs = [pair for pair in side_pairs(state) if {*pair} <= {*columns}]
    twins = [pair for pair in pairs if _differ_in_motion(state, pair)]
    turn = {name: state.effect(r, state.columns[name]) for name in columns}
    push = {name: state.effect(speed, state.columns[name]) for name in columns}
    sure = [name for name in columns if _says_actuator(state, name)]
    if not twins:
        twins = [
            (one, other) if both[0] > 0 else (other, one)
            for one, other in combinations(sure, 2)
            for both in [
                evidence.order_effects(state.t, r, np.stack([state.columns[k] for k in (one, other)]), state.part)
            ]
            if both[0] * both[1] < 0.0
            and np.abs(both).min() > SETTINGS.seen
            and state.effect(speed, state.columns[one] + state.columns[other]) > SETTINGS.seen / 2
            and not {state.side_of(one), state.side_of(other)} & {"port", "starboard"}
        ]
    turning = {pair: state.effect(r, state.columns[pair[0]] - state.columns[pair[1]]) for pair in twins}
    pair = max(turning, key=lambda one: abs(turning[one]), default=None)
    if pair is not None and abs(turning[pair]) >= SETTINGS.seen:
        _take_twins(state, pair, turning[pair])
        return True
    steers = max(sure, key=lambda name: abs(turn[name]), default="")
    if steers and not steered and abs(turn[steers]) > SETTINGS.seen:
        for name in (steers, *_alike(state, steers)):
            _take_servo(state, name, turn.get(name, turn[steers]), used)
        steered = True
    drives = max((one for one in sure if one in state.free()), key=push.__getitem__, default="")
    alike = (drives, *(_alike(state, drives) if drives else ()))
    seen = bool(drives) and (push[drives] > SETTINGS.seen or are_pulses(state.columns[drives]))
    if seen or (drives and _is_plain_actuator(drives)):
        zero, why = _neutral_value(state, drives)
        words = (
            f"more of {' and '.join(map(repr, alike))} drives the ship ahead. Of which shaft speed is a value of 1? "
        )
        words += f"Write factor, and offset = -factor * {zero:g}; in which dead band about it does the screw stop?"
        state.ask(("n",), words)
        extra = {"factor": 1.0} | ({"offset": -zero} if zero else {})
        why = f"it drives the ship ahead (t value {push[drives]:.0f}){why}"
        for name in alike:
            usual = f"{state.side_of(name) or SIGNALS['n'].component}.n"
            state.suggest(_command_of_column(state, name, usual, used), name, "rpm", 0.5, why, **extra)
    return steered


def _take_servo(state: State, name: str, effect: float, used: dict[str, int], signal: str = "delta") -> None:
    """Suggest pulses or a share as an angle: 45 deg at the largest value is a guess, and asked."""
    zero, why = _neutral_value(state, name)
    full = 400.0 if are_pulses(state.columns[name]) else float(np.abs(state.columns[name] - zero).max())
    factor = float(f"{45.0 / full:.6g}")
    state.turning[name] = float(np.sign(effect))
    sign = {"sign": -1} if (effect > 0) != (SIGNALS[signal].turns > 0) else {}
    words = f"{name!r} turns the ship to {'starboard' if effect > 0 else 'port'} above {zero:g}: which angle is"
    state.ask(
        ("delta", "alpha"), f"{words} {zero + full:g}? 45 deg is a guess; is it a rudder, or an outboard that swivels?"
    )
    extra = {"factor": factor, "offset": -sign.get("sign", 1) * factor * zero, **sign}
    column = _angle_of_column(state, name, signal, used)
    state.suggest(column, name, "deg", 0.5, f"it turns the ship (t value {abs(effect):.0f}){why}", **extra)


def _take_twins(state: State, pair: tuple[str, str], effect: float) -> None:
    """Suggest two columns as screws to port and to starboard, whose difference turns the ship."""
    turned = "starboard" if effect > 0 else "port"
    by_name = state.side_of(pair[0]) is not None
    why = f"{'by its side; ' * by_name}the difference turns the ship to {turned} (t value {abs(effect):.0f})"
    both, units = f"{pair[0]!r} and {pair[1]!r}", {unit_in_name(name, "rev/s") for name in pair}
    known = len(units) == 1 and units <= UNITS["rev/s"].keys()
    zeros = {name: _neutral_value(state, name) for name in pair}
    if not known:
        state.ask(
            ("n",), f"{both} turn the ship by their difference. Of which shaft speed is a value of 1? Write factor"
        )
        if not all(why for _, why in zeros.values()):
            guesses = " and ".join(f"{zero:g}" for zero, _ in zeros.values())
            words = f"which value of {both} is a stopped screw? Drafted: {guesses}. Write offset = -factor * value"
            state.ask(("n",), words)
    if not by_name:
        state.ask(
            ("n", "force"),
            f"is {pair[0]!r} to port and {pair[1]!r} to starboard? More of the first turns to starboard",
        )
    for side, name in zip(("port", "starboard"), pair, strict=True):
        zero, seen = zeros[name]
        extra = {} if known else {"factor": 1.0} | ({"offset": -zero} if zero else {})
        unit = str(units.copy().pop()) if known else "rpm"
        state.suggest(f"{side}.n", name, unit, LIKELY if known else 0.5, why + seen * (not known), **extra)
    if effect < 0:
        words = f"more of {pair[0]!r} turns the ship to port: are the sides swapped, or the yaw rate's sign?"
        state.find("sides of the screws", pair, 0.6, words)


def _neutral_value(state: State, name: str) -> tuple[float, str]:
    """The value of a stopped screw, and why: 0 in numbers of both signs, else that of a ship at rest, else 1500 us."""
    values = state.columns[name]
    if values.min() < -NOISE * np.ptp(values):
        return 0.0, "; astern is negative"
    span = state.t[state.chosen.last] - state.t[state.chosen.first]
    speed = np.abs(state.chosen.change(state.position)) / span
    still = values[state.chosen.first[speed < 0.05 * np.quantile(speed, 0.9)]]
    usual = float(np.median(still)) if len(still) >= 5 else 0.0
    if len(still) >= 5 and float(np.median(np.abs(still - usual))) < NOISE * float(np.ptp(values)):
        other = are_pulses(values) and abs(usual - SERVO) > OFF_SERVO  # the ship may stop for a moment as it turns
        return usual, "" if other else f"; {usual:g} while the ship is at rest"
    return (SERVO, f"; {SERVO:g} is the middle of a servo") if are_pulses(values) else (0.0, "")


def are_pulses(values: Array) -> bool:
    """Whether a column may be the pulses of a servo [us]."""
    running = values[values != 0.0]  # 0 is no pulse
    return bool(len(running) and PULSES[0] < running.min() and running.max() < PULSES[1] and np.ptp(running) > 20)


def side_pairs(state: State) -> list[tuple[str, str]]:
    """The pairs of free columns, port and starboard, whose names are equal but for the side."""
    sides: dict[tuple[str, ...], dict[str, str]] = {}
    for name in state.free():
        side = state.side_of(name)
        if side in ("port", "starboard"):
            key = tuple(
                part for part in name_parts(name) if state.side_of(f"x {part}") != side and part not in ("l", "r")
            )
            sides.setdefault(key, {}).setdefault(side, name)
    return [(pair["port"], pair["starboard"]) for pair in sides.values() if len(pair) == 2]


def _differ_in_motion(state: State, pair: tuple[str, str]) -> bool:
    """Whether the difference of two columns has a fifth of their range at least: that of twin rudders has less."""
    one, other = (state.columns[name] for name in pair)
    return bool(np.ptp(one - other) > 0.2 * max(np.ptp(one), np.ptp(other)) > 0)


def _says_actuator(state: State, name: str) -> bool:
    """Whether a name says an order, a throttle or per cent, or its numbers are pulses."""
    said = is_order(name) or bool(OF_ACTUATORS & {*name_parts(name)}) or unit_in_name(name, "rev/s") == "%"
    return said or are_pulses(state.columns[name])


def _is_plain_actuator(name: str) -> bool:
    """Whether a name says an actuator, its side, its number, an order and nothing else: no `motor temp`."""
    aside = OF_ACTUATORS | ORDERS | SOURCES
    return all(part in aside or part.isdigit() or side_in_name(f"x {part}") for part in name_parts(name))


def _may_be_actuator(state: State, name: str) -> bool:
    """Whether a name says an actuator or nothing at all, and no unit of another quantity."""
    fit, said = meaning_scores(name), _says_actuator(state, name)
    foreign = unit_of_another(name, "n") is not None or (fit.get("", 0.0) >= STRONG and not said)
    return not foreign and (said or not fit)


# --- names and units ---


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
