"""Name the commands of a draft as a vessel document does, so that the imported log fits that vessel."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from shipid.logs.guess.clues import LIKELY, State, Suggestion, unit_of_another
from shipid.logs.guess.words import name_parts, number_in_name, side_in_name, words_of_side
from shipid.physics.signals import SIGNALS, is_command, is_shaft, is_steering, signal_of
from shipid.simulation.approach import Controls
from shipid.vessel.load import Vessel

PLACES = ("port", "starboard", "bow", "stern")
OPPOSITE = {"port": "starboard", "starboard": "port"}
GUESSED = 0.4  # confidence of a tunnel thruster whose name says no unit, and of a side that no name says


def name_commands(state: State, vessel: Vessel) -> None:
    """Rename the commands and outputs of the draft to those of the vessel; ask where the log lacks a command."""
    controls = Controls(vessel)
    drives, helm = controls.effects
    without = {
        name for name in controls.commands if (is_shaft(name) or is_steering(name)) and name not in (*drives, *helm)
    }
    idle = without if drives else set()
    _drop_guesses(state, {signal_of(name) for name in controls.commands})
    _take_tunnels(state, [name for name in controls.commands if name in idle and is_shaft(name)])
    components: dict[str, str] = {}
    named: list[Suggestion] = []
    for signal in dict.fromkeys(map(signal_of, controls.commands)):
        wanted = [name for name in controls.commands if signal_of(name) == signal]
        drafted = [one for one in state.suggestions if is_command(one.name) and signal_of(one.name) == signal]
        for name, one in _command_pairs(state, wanted, drafted, idle, vessel):
            components.setdefault(one.name.partition(".")[0], name.partition(".")[0])
            named.append(_with_sign(state, replace(one, name=name), helm))
        missing = [name for name in wanted if name not in {one.name for one in named}]
        named += [stopped for name in missing for stopped in _missing_command(state, name, idle, vessel)]
    used = {one.source for one in named}
    kept = [one for one in state.suggestions if not is_command(one.name) or one.source not in used]
    order = [one.source for one in state.suggestions if is_command(one.name)]
    named.sort(key=lambda one: order.index(one.source) if one.source in order else len(order))
    state.suggestions[:] = [_rename_output(one, components) for one in kept]
    state.suggestions += named


def _drop_guesses(state: State, signals: set[str]) -> None:
    """Take back what the names do not say and the vessel does not have, such as a rudder."""
    doubted = [
        one
        for one in state.suggestions
        if is_command(one.name) and signal_of(one.name) not in signals and one.confidence < LIKELY
    ]
    for one in doubted:
        state.suggestions.remove(one)
        state.taken.discard(one.source)


def _command_pairs(
    state: State, wanted: Sequence[str], drafted: Sequence[Suggestion], idle: set[str], vessel: Vessel
) -> Iterator[tuple[str, Suggestion]]:
    """Yield each command of the vessel with its column: by its name, then its side or end, then its number."""
    found = {name: one for name in wanted for one in drafted if state.command_of(one.source) == name}
    said = list(found.values())
    for group in _command_groups(wanted, idle, vessel):
        left = [one for one in drafted if one not in said]
        tunnel = group[0] in idle or _place_in_name(group[0]) in ("bow", "stern")
        missing = [name for name in group if name not in found]
        found |= _group_columns(state, missing, left, tunnel, vessel)
        if not tunnel:
            found |= _as_the_other_side(state, [name for name in group if name not in found], drafted, vessel)
    yield from ((name, found[name]) for name in wanted if name in found)


def _command_groups(wanted: Sequence[str], idle: set[str], vessel: Vessel) -> list[list[str]]:
    """Commands of the screws that drive or the angles that turn; and those of the tunnels at each end."""
    groups: dict[str, list[str]] = {}
    for name in wanted:
        place = _side_or_place(name, vessel)
        tunnel = name in idle or place in ("bow", "stern")
        groups.setdefault(f"tunnel {place}" if tunnel else "", []).append(name)
    return list(groups.values())


def _group_columns(
    state: State, names: Sequence[str], drafted: Sequence[Suggestion], tunnel: bool, vessel: Vessel
) -> dict[str, Suggestion]:
    if not names:
        return {}
    places = {name: _side_or_place(name, vessel) for name in names}
    if tunnel:
        columns = [one for one in drafted if places[names[0]] and _place_in_name(one.name) == places[names[0]]]
        return _match_in_order(state, names, columns)
    columns = [one for one in drafted if _place_in_name(one.name) not in ("bow", "stern")]
    found: dict[str, Suggestion] = {}
    for side in OPPOSITE:
        found |= _match_in_order(
            state,
            [name for name in names if places[name] == side],
            [one for one in columns if _place_in_name(one.name) == side],
        )
    left = [one for one in columns if not _place_in_name(one.name)]
    missing = [name for name in names if name not in found]
    if len(left) == 1 or len(missing) == 1:
        found |= _match_in_order(state, missing, left)
    elif len(left) > 1:
        found |= _by_number(state, missing, left, vessel)
    alone = [name for name in names if name not in found and not places[name]]
    if alone and columns and (len(names) == 1 or len(columns) == 1):
        found |= _match_in_order(state, alone, columns)
    return found


def _as_the_other_side(
    state: State, names: Sequence[str], drafted: Sequence[Suggestion], vessel: Vessel
) -> dict[str, Suggestion]:
    """Columns of the other side for commands of a side that the log does not have, each with a question."""
    found: dict[str, Suggestion] = {}
    for name in names:
        place = _side_or_place(name, vessel)
        other = [one for one in drafted if _place_in_name(one.name) == OPPOSITE.get(place, "none")]
        if other:
            state.ask((signal_of(name),), f"is {name} as {other[0].source!r}? The log has no column of that side")
            found[name] = other[0]
    return found


def _match_in_order(state: State, names: Sequence[str], columns: Sequence[Suggestion]) -> dict[str, Suggestion]:
    """One column for each command where there are as many; one column for all of them; else the first ones."""
    if not names or not columns:
        return {}
    sources = tuple(one.source for one in columns)
    if len(columns) == 1:
        return dict.fromkeys(names, columns[0])
    if len(names) == 1:
        rest = ", ".join(map(repr, sources[1:]))
        state.find("several columns for one command", sources, 0.6, f"{names[0]} is {sources[0]!r}, not {rest}")
        return {names[0]: columns[0]}
    by_number = _with_numbers(names, columns)
    return by_number or _ask_about_commands(state, names, columns, "Their names do not say which is which")


def _ask_about_commands(
    state: State, names: Sequence[str], columns: Sequence[Suggestion], why: str
) -> dict[str, Suggestion]:
    pairs = {
        name: replace(one, confidence=min(one.confidence, GUESSED)) for name, one in zip(names, columns, strict=False)
    }
    said = ", ".join(f"{name} as {one.source!r}" for name, one in pairs.items())
    state.ask((signal_of(names[0]),), f"is {said}? {why}")
    return pairs


def _with_numbers(names: Sequence[str], columns: Sequence[Suggestion]) -> dict[str, Suggestion]:
    """Commands whose components have numbers with the columns of the same numbers; none where one lacks it."""
    by_number = {number_in_name(one.source) or 1: one for one in reversed(columns)}
    numbers = {name: number_in_name(name.partition(".")[0]) or 1 for name in names}
    told = len(set(numbers.values())) == len(names) and len(by_number) == len(columns)
    return (
        {name: by_number[n] for name, n in numbers.items()} if told and set(numbers.values()) <= set(by_number) else {}
    )


def _by_number(
    state: State, names: Sequence[str], columns: Sequence[Suggestion], vessel: Vessel
) -> dict[str, Suggestion]:
    """Columns that differ by a number alone: for components with numbers, else from starboard to port, and asked."""
    sides = [_side_or_place(name, vessel) for name in names]
    if _with_numbers(names, columns) or not {"port", "starboard"} <= set(sides):
        return _match_in_order(state, names, columns)
    across = sorted(
        names,
        key=lambda name: (
            -_lateral_position(name, vessel)
            if _lateral_position(name, vessel)
            else -1.0 * (_place_in_name(name) == "starboard")
        ),
    )
    ordered = sorted(columns, key=lambda one: number_in_name(one.source) or 1)
    return _ask_about_commands(state, across, ordered, "Numbers are taken from starboard to port")


def _with_sign(state: State, one: Suggestion, helm: Mapping[str, float]) -> Suggestion:
    """The column of an angle with the sign that turns the vessel as the log says.

    helm : angle command -> sign that turns the vessel to starboard.
    """
    seen, right = state.turning.get(one.source), helm.get(one.name)
    if seen is None or right is None or (seen != right) == ("sign" in one.extra):
        return one
    kind = "wrong sign of rudder"
    state.findings[:] = [each for each in state.findings if (each.kind, each.columns) != (kind, (one.source,))]
    extra = {key: value for key, value in one.extra.items() if key != "sign"}
    if seen != right:
        extra["sign"] = -1
        sides = ("starboard", "port") if seen > 0 else ("port", "starboard")
        state.find(
            kind,
            (one.source,),
            one.confidence,
            f"positive {one.source!r} turns to {sides[0]}; {one.name} of the vessel to {sides[1]}",
        )
    return replace(one, extra=extra)


def _take_tunnels(state: State, names: Sequence[str]) -> None:
    """Suggest a column without a unit whose name says a tunnel thruster, in the unit of the other shafts."""
    for name in names:
        place = _place_in_name(name)
        if any(is_command(one.name) and _place_in_name(one.name) == place for one in state.suggestions):
            continue
        likely = [
            column
            for column in state.free()
            if {"thruster", place} <= set(name_parts(column)) and unit_of_another(column, "n") is None
        ]
        units = [one.unit for one in state.suggestions if is_command(one.name) and is_shaft(one.name)]
        if likely and units:
            about = (name, "n")
            state.ask(about, f"is {likely[0]!r} the shaft speed of thruster.{place}? {units[0]} is a guess")
            state.suggest(name, likely[0], units[0], GUESSED, f"by its name; in {units[0]} as the other shafts")


def _missing_command(state: State, name: str, idle: set[str], vessel: Vessel) -> Iterator[Suggestion]:
    """Yield a column of zeros for a command that does not drive the vessel; ask for any other."""
    if name in idle and is_shaft(name) and state.suggestions:
        why = f"no column of the log is {name}: taken as stopped"
        state.find("command not logged", (), GUESSED, why)
        yield Suggestion(
            name, state.suggestions[0].source, SIGNALS[signal_of(name)].read_in, GUESSED, why, {"factor": 0.0}
        )
        return
    state.ask((signal_of(name),), f"which column is {name}? {vessel.name} needs it")


def _rename_output(one: Suggestion, components: dict[str, str]) -> Suggestion:
    component, dot, signal = one.name.partition(".")
    return replace(one, name=f"{components[component]}.{signal}") if dot and component in components else one


def _place_in_name(name: str) -> str:
    component = name.partition(".")[0]
    place = next((one for one in PLACES if component.lower() in words_of_side(one)), None) or side_in_name(component)
    return place if place in PLACES else ""


def _lateral_position(name: str, vessel: Vessel) -> float:
    """Distance [m] of the component of a command to starboard of the centre line, 0 where the document has none."""
    return vessel.parameters.get(f"thruster.{name.partition('.')[0]}.y", 0.0)


def _side_or_place(name: str, vessel: Vessel) -> str:
    """Side or end that the name of a command says, else the side on which the vessel has it; empty where neither."""
    y = _lateral_position(name, vessel)
    return _place_in_name(name) or ("port" if y < 0 else "starboard" if y > 0 else "")
