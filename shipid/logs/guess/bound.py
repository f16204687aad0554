"""Name the commands of a draft as a vessel document does, so that the imported log fits that vessel.

Signal and side decide. One column may feed the commands of both sides. A screw of the vessel that does not drive it,
such as a tunnel thruster, is taken as stopped where the log does not have it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from shipid.logs.guess.clues import LIKELY, State, Suggestion, unit_of_another
from shipid.logs.guess.words import parts_of, side_of, words_of_side
from shipid.physics.signals import is_command, is_shaft, row_of, signal_of
from shipid.simulation.approach import Controls
from shipid.vessel.load import Vessel

PLACES = ("port", "starboard", "bow", "stern")
OPPOSITE = {"port": "starboard", "starboard": "port"}
GUESSED = 0.4  # confidence of a tunnel thruster whose name says no unit


def name_commands(state: State, vessel: Vessel) -> None:
    """Rename the commands and outputs of the draft to those of the vessel; ask where the log lacks a command.

    Raises DocumentError for a vessel that no command drives or turns.
    """
    controls = Controls(vessel)
    helm = () if controls.differential else tuple(controls.helm)
    idle = {name for name in controls.commands if name not in controls.drives and name not in helm}
    _drop_guesses(state, {signal_of(name) for name in controls.commands})
    _take_tunnels(state, [name for name in controls.commands if name in idle and is_shaft(name)])
    components: dict[str, str] = {}
    named: list[Suggestion] = []
    for signal in dict.fromkeys(map(signal_of, controls.commands)):
        wanted = [name for name in controls.commands if signal_of(name) == signal]
        drafted = [one for one in state.suggestions if is_command(one.name) and signal_of(one.name) == signal]
        for name, one in _pairs(state, wanted, drafted, idle, vessel):
            components.setdefault(one.name.partition(".")[0], name.partition(".")[0])
            named.append(replace(one, name=name))
        missing = [name for name in wanted if name not in {one.name for one in named}]
        named += [stopped for name in missing for stopped in _missing(state, name, idle, vessel)]
    used = {one.source for one in named}
    kept = [one for one in state.suggestions if not is_command(one.name) or one.source not in used]
    order = [one.source for one in state.suggestions if is_command(one.name)]
    named.sort(key=lambda one: order.index(one.source) if one.source in order else len(order))
    state.suggestions[:] = [_renamed(one, components) for one in kept]
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


def _pairs(
    state: State, wanted: Sequence[str], drafted: Sequence[Suggestion], idle: set[str], vessel: Vessel
) -> Iterator[tuple[str, Suggestion]]:
    """Yield each command of the vessel with the column for it: that of its side, or the only one."""
    main = [one for one in drafted if _place(one.name) not in ("bow", "stern")]
    for name in wanted:
        place = _place(name) or _side(name, vessel)
        if name in idle or place in ("bow", "stern"):
            alike = [one for one in drafted if _place(one.name) == place and one not in main]
        else:
            alike = [one for one in main if _place(one.name) == place] or [one for one in main if not _place(one.name)]
            if not alike and place in OPPOSITE and main:
                alike = [one for one in main if _place(one.name) == OPPOSITE[place]]
                state.ask((signal_of(name),), f"is {name} as {alike[0].source!r}? The log has no column of that side")
            if not alike and not place and (len(wanted) == 1 or len(main) == 1):
                alike = main
        if alike:
            if len(alike) > 1 and len(wanted) < len(alike):
                rest = ", ".join(repr(one.source) for one in alike[1:])
                sources = tuple(one.source for one in alike)
                state.find("several columns for one command", sources, 0.6, f"{name} is {sources[0]!r}, not {rest}")
            yield name, alike[0]


def _take_tunnels(state: State, names: Sequence[str]) -> None:
    """Suggest a column without a unit whose name says a tunnel thruster, in the unit of the other shafts."""
    for name in names:
        place = _place(name)
        if any(is_command(one.name) and _place(one.name) == place for one in state.suggestions):
            continue
        likely = [
            column
            for column in state.free()
            if {"thruster", place} <= set(parts_of(column)) and unit_of_another(column, "n") is None
        ]
        units = [one.unit for one in state.suggestions if is_command(one.name) and is_shaft(one.name)]
        if likely and units:
            about = (name, "n")
            state.ask(about, f"is {likely[0]!r} the shaft speed of thruster.{place}? {units[0]} is a guess")
            state.suggest(name, likely[0], units[0], GUESSED, f"by its name; in {units[0]} as the other shafts")


def _missing(state: State, name: str, idle: set[str], vessel: Vessel) -> Iterator[Suggestion]:
    """Yield a column of zeros for a command that does not drive the vessel; ask for any other."""
    if name in idle and is_shaft(name) and state.suggestions:
        why = f"no column of the log is {name}: taken as stopped"
        state.find("command not logged", (), GUESSED, why)
        yield Suggestion(name, state.suggestions[0].source, _shown(name), GUESSED, why, {"factor": 0.0})
        return
    state.ask((signal_of(name),), f"which column is {name}? {vessel.name} needs it")


def _renamed(one: Suggestion, components: dict[str, str]) -> Suggestion:
    """An output of a component that has another name in the vessel."""
    component, dot, signal = one.name.partition(".")
    return replace(one, name=f"{components[component]}.{signal}") if dot and component in components else one


def _place(name: str) -> str:
    """Side or end in the name of a command; empty where there is none."""
    component = name.partition(".")[0]
    place = next((one for one in PLACES if component.lower() in words_of_side(one)), None) or side_of(component)
    return place if place in PLACES else ""


def _side(name: str, vessel: Vessel) -> str:
    """Side on which the vessel has the component of a command; empty on the centre line."""
    y = vessel.parameters.get(f"thruster.{name.partition('.')[0]}.y", 0.0)
    return "port" if y < 0 else "starboard" if y > 0 else ""


def _shown(name: str) -> str:
    row = row_of(name)
    assert row is not None
    return row.read_in
