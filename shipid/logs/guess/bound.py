"""Name the commands of a draft as a vessel document does, so that the imported log fits that vessel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from shipid.logs.guess.clues import LIKELY, State, Suggestion, unit_of_another
from shipid.logs.guess.commands import PULSES
from shipid.logs.guess.words import SIDE_WORDS, name_parts, number_in_name, side_in_name
from shipid.logs.mapping import to_si
from shipid.physics.signals import SIGNALS, is_command, is_shaft, is_steering, signal_of
from shipid.simulation.approach import Controls
from shipid.vessel.load import Vessel

PLACES = ("port", "starboard", "bow", "stern")
TUNNELS_AT = ("bow", "stern")
GUESSED = 0.4  # confidence of a tunnel thruster whose name says no unit, and of a side that no name says
SAME_NAME, SAME_PLACE, SAME_NUMBER, OTHER_SIDE, NEVER = -10.0, -3.0, -1.0, 6.0, 50.0
"""What speaks against a column for a command, least first: its name, its side or end, its number."""


def name_commands(state: State, vessel: Vessel) -> None:
    """Rename the commands and outputs of the draft to those of the vessel; ask where the log lacks a command."""
    controls = Controls(vessel)
    drives, helm = controls.effects
    moving = {name for name in controls.commands if is_shaft(name) or is_steering(name)}
    idle = moving - {*drives, *helm} if drives else set[str]()
    _fit_guesses(state, controls.commands, vessel)
    _take_tunnels(state, [name for name in controls.commands if name in idle and is_shaft(name)])
    components: dict[str, str] = {}
    named: list[Suggestion] = []
    for signal in dict.fromkeys(map(signal_of, controls.commands)):
        names = [name for name in controls.commands if signal_of(name) == signal]
        drafted = [one for one in state.suggestions if is_command(one.name) and signal_of(one.name) == signal]
        pairs = _columns_of_commands(state, names, drafted, idle, vessel)
        for name in names:
            if name in pairs:
                components.setdefault(pairs[name].name.partition(".")[0], name.partition(".")[0])
                named.append(_with_sign(state, replace(pairs[name], name=name), helm))
            else:
                named += _missing_command(state, name, idle, vessel)
    used = {one.source for one in named}
    kept = [one for one in state.suggestions if not is_command(one.name) or one.source not in used]
    order = [one.source for one in state.suggestions if is_command(one.name)]
    named.sort(key=lambda one: order.index(one.source) if one.source in order else len(order))
    state.suggestions[:] = [_rename_output(one, components) for one in kept] + named


def _columns_of_commands(
    state: State, names: Sequence[str], drafted: Sequence[Suggestion], idle: set[str], vessel: Vessel
) -> dict[str, Suggestion]:
    """The column of each command: the cheapest assignment by name, side and number; one column may serve several."""
    if not drafted:
        return {}
    from scipy.optimize import linear_sum_assignment  # most drafts are for no vessel, and it takes its time

    against = np.array([[_cost_of_column(state, name, one, names, idle, vessel) for one in drafted] for name in names])
    rows, columns = linear_sum_assignment(against)
    found = {names[row]: drafted[col] for row, col in zip(rows, columns, strict=True) if against[row, col] < OTHER_SIDE}
    places = [_side_or_place(name, vessel) for name in names]
    unsure = {
        name: one
        for name, one in found.items()
        if not state.command_of(one.source)
        and number_in_name(name.partition(".")[0]) is None
        and (not _place_in_name(one.name) or places.count(places[names.index(name)]) > 1)
    }
    if len({one.source for one in unsure.values()}) > 1:
        pairs = ", ".join(f"{name} as {one.source!r}" for name, one in unsure.items())
        state.ask((signal_of(names[0]),), f"is {pairs}? Numbers are taken from starboard to port")
        found |= {name: replace(one, confidence=min(one.confidence, GUESSED)) for name, one in unsure.items()}
    for row, name in enumerate(names):
        best = int(np.argmin(against[row]))
        if name in found or against[row, best] >= NEVER:
            continue
        found[name] = drafted[best]
        if against[row, best] >= OTHER_SIDE:
            words = f"is {name} as {drafted[best].source!r}? The log has no column of that side"
            state.ask((signal_of(name),), words)
    rest = [
        one.source for col, one in enumerate(drafted) if one not in found.values() and against[:, col].min() < NEVER
    ]
    if rest:
        words = ", ".join(f"{name} is {one.source!r}" for name, one in found.items())
        more = f"{words}, not {', '.join(map(repr, rest))}"
        state.find("several columns for one command", (*(one.source for one in found.values()), *rest), 0.6, more)
    return found


def _cost_of_column(
    state: State, name: str, one: Suggestion, names: Sequence[str], idle: set[str], vessel: Vessel
) -> float:
    """What speaks against a column for a command."""
    said = state.command_of(one.source)
    if said:
        return SAME_NAME if said == name else OTHER_SIDE + 1.0
    place, column = _side_or_place(name, vessel), _place_in_name(one.name)
    if (name in idle or place in TUNNELS_AT) != (column in TUNNELS_AT) or (place != column and column in TUNNELS_AT):
        return NEVER
    component, number = number_in_name(name.partition(".")[0]), number_in_name(one.source) or 1
    if place and column:
        return (SAME_PLACE if place == column else OTHER_SIDE) + 0.1 * abs((component or 1) - number)
    if component:
        return SAME_NUMBER if component == number else 1.0
    across = sorted(names, key=lambda each: _across(each, vessel))
    return 0.1 * abs(across.index(name) + 1 - number)


def _across(name: str, vessel: Vessel) -> float:
    """Place of a command from starboard to port."""
    y = _lateral_position(name, vessel)
    return -y if y else {"starboard": -1.0, "port": 1.0}.get(_place_in_name(name), 0.0)


def _fit_guesses(state: State, commands: Sequence[str], vessel: Vessel) -> None:
    """Draft what no name says as what the vessel has: a force for a screw, a swivel for a rudder; drop the rest."""
    signals = {signal_of(name) for name in commands}
    for one in [*state.suggestions]:
        said = signal_of(one.name)
        if is_command(one.name) and said not in signals and one.confidence < LIKELY:
            state.suggestions.remove(one)
            signal = {"n": "force", "delta": "alpha"}.get(said)
            alike = [f"thruster.{name.replace('.', '.actuator.')}" for name in commands if signal_of(name) == signal]
            limits = [vessel.parameters.get(f"{path}.{end}", 0.0) for path in alike[:1] for end in ("low", "high")]
            if signal and "factor" in one.extra and any(limits):
                _suggest_curve(state, one, signal, limits)
            else:
                state.taken.discard(one.source)


def _suggest_curve(state: State, one: Suggestion, signal: str, limits: Sequence[float]) -> None:
    """Suggest a throttle or pulses by a curve that ends at limits (low, high) [N, rad] of the vessel, and ask."""
    name, values = f"{one.name.partition('.')[0]}.{signal}", state.columns[one.source]
    unit, bend = ("N", 1.5) if signal == "force" else ("deg", 1.0)  # between 1 and the 2 of a shaft speed: a guess
    zero = -one.extra.get("sign", 1) * one.extra.get("offset", 0.0) / one.extra["factor"]
    far = max(400.0 * (PULSES[0] < zero < PULSES[1]), float(np.ceil(np.nanmax(np.abs(values[values != 0] - zero)))))
    low, high = np.array(limits) / to_si(unit, name)
    curve = [
        [zero + share * far, float(f"{(high if share > 0 else low) * abs(share) ** bend:.4g}")]
        for share in (-1.0, -0.5, 0.0, 0.5, 1.0)
    ]
    state.questions[:] = [
        each
        for each in state.questions
        if signal in each.about or signal_of(one.name) not in each.about or repr(one.source) not in each.sentence
    ]
    state.ask(
        (signal,),
        f"does {one.source!r} order {high:.4g} {unit} at {zero + far:g}? The vessel ends there: correct the curve, "
        f"and write the dead band about {zero:g} into it",
    )
    extra = {key: value for key, value in one.extra.items() if key == "sign"} | {"curve": curve}
    state.suggestions.append(replace(one, name=name, unit=unit, extra=extra))


def _with_sign(state: State, one: Suggestion, helm: Mapping[str, float]) -> Suggestion:
    """The column of an angle with the sign that turns the vessel as the log says.

    helm : angle command -> sign that turns the vessel to starboard.
    """
    seen, right = state.turning.get(one.source), helm.get(one.name)
    if seen is None or right is None or (seen != right) == ("sign" in one.extra):
        return one
    extra = {key: value for key, value in one.extra.items() if key != "sign"}
    sides = ("starboard", "port") if seen > 0 else ("port", "starboard")
    why = f"positive {one.source!r} turns to {sides[0]}; {one.name} of the vessel to {sides[seen != right]}"
    return replace(one, evidence=why, extra=extra | ({"sign": -1} if seen != right else {}))


def _take_tunnels(state: State, names: Sequence[str]) -> None:
    """Suggest a column without a unit whose name says a tunnel thruster, in the unit of the other shafts."""
    for name in names:
        place = _place_in_name(name)
        units = [one.unit for one in state.suggestions if is_command(one.name) and is_shaft(one.name)]
        if not units or any(is_command(one.name) and _place_in_name(one.name) == place for one in state.suggestions):
            continue
        for column in state.free():
            if {"thruster", place} <= {*name_parts(column)} and unit_of_another(column, "n") is None:
                state.ask((name, "n"), f"is {column!r} the shaft speed of thruster.{place}? {units[0]} is a guess")
                state.suggest(name, column, units[0], GUESSED, f"by its name; in {units[0]} as the other shafts")
                break


def _missing_command(state: State, name: str, idle: set[str], vessel: Vessel) -> Iterator[Suggestion]:
    """Yield a column of zeros for a command that does not drive the vessel; ask for any other."""
    if name in idle and is_shaft(name) and state.suggestions:
        why = f"no column of the log is {name}: taken as stopped"
        state.find("command not logged", (), GUESSED, why)
        source, unit = state.suggestions[0].source, SIGNALS[signal_of(name)].read_in
        yield Suggestion(name, source, unit, GUESSED, why, {"factor": 0.0})
        return
    state.ask((signal_of(name),), f"which column is {name}? {vessel.name} needs it")


def _rename_output(one: Suggestion, components: dict[str, str]) -> Suggestion:
    component, dot, signal = one.name.partition(".")
    return replace(one, name=f"{components[component]}.{signal}") if dot and component in components else one


def _place_in_name(name: str) -> str:
    component = name.partition(".")[0]
    place = next((one for one in PLACES if component.lower() in SIDE_WORDS[one]), None) or side_in_name(component)
    return place if place in PLACES else ""


def _lateral_position(name: str, vessel: Vessel) -> float:
    """Distance [m] of the component of a command to starboard of the centre line, 0 where the document has none."""
    return vessel.parameters.get(f"thruster.{name.partition('.')[0]}.y", 0.0)


def _side_or_place(name: str, vessel: Vessel) -> str:
    """Side or end that the name of a command says, else the side on which the vessel has it; empty where neither."""
    y = _lateral_position(name, vessel)
    return _place_in_name(name) or ("port" if y < 0 else "starboard" if y > 0 else "")
