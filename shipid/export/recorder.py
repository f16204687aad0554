"""What a recorder aboard computes with every row, as CasADi functions: state in, state out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.export.equations import (
    Equations,
    function_by_names,
    memory_advance,
    split_by_name,
    symbols_of,
)
from shipid.export.known import POSITION_ENTRIES, column_of_entries, turn_vectors
from shipid.export.model import ExportModel
from shipid.observer import (
    MEASURED_MOTION,
    NUM_LOW_STATES,
    FilterBank,
    filter_bank,
    filter_state_sizes,
    filters_function,
    first_filter_states,
    observer_function,
)
from shipid.physics.signals import SIGNALS, is_all_round, signal_row

FULL_TURN = 2 * np.pi
KEPT_ENTRIES = ("way_north", "way_east", "rate_north", "rate_east")
"""Entries of a kept row beside those of `Layout.now`: integrated way from the newest row [m], velocity [m/s]."""


def filters_of(model: ExportModel) -> FilterBank | None:
    """The filters of the observer, where there is one: of the vessel without the terms of the method, as in Python."""
    physics = model.predictor.physics
    return None if physics.observer is None or physics.vessel is None else filter_bank(physics.vessel, physics.observer)


def recorder_functions(model: ExportModel) -> dict[str, ca.Function]:
    """Functions by name: `keep`; where the model has them `past`, `begin`, `between`, `observe`."""
    functions = {"keep": keep_function(model)}
    if model.layout.num_past:
        functions["past"] = past_function(model)
    filters = filters_of(model)
    if filters is not None:
        functions["begin"] = begin_function(model, filters)
        functions |= {name: observer_step(model, filters, name == "observe") for name in ("between", "observe")}
    return functions


def kept_names(model: ExportModel) -> tuple[str, ...]:
    """Entries of a kept row."""
    return (*model.layout.now, *KEPT_ENTRIES)


def angles_of(names: Sequence[str]) -> list[str]:
    """Angles of thrusters and rudders: they may come by any turn, 350 deg for -10 deg."""
    rows = ((name, signal_row(name)) for name in names if "." in name)
    return [name for name, row in rows if row is not None and row.angle]


def keep_function(model: ExportModel) -> ca.Function:
    """(last, row, reached, dt, anew) -> kept row, what is added to all kept before, reached after dt [s].

    last : the newest kept row. anew : 1 for a row before which nothing is known. Angles go on by the turn of
    `angle_by_turn`, the first from the turn nearest to the training, where that is narrower than a turn; headings and
    directions go on by the nearest one.
    """
    names = model.layout
    sizes_ = {"last": len(kept_names(model)), "row": len(names.now), "reached": len(names.reached)}
    symbols = symbols_of(sizes_ | {"dt": 1, "anew": 1})
    dt, anew = symbols["dt"], symbols["anew"]
    last, row = split_by_name(kept_names(model), symbols["last"]), split_by_name(names.now, symbols["row"])
    moved: dict[str, MX] = {}
    for name in angles_of(names.now):
        least, most = model.limits.get(name, (-np.inf, np.inf))
        first = nearest_turn(row[name], (least + most) / 2) if most - least <= FULL_TURN else row[name]
        before = ca.if_else(anew, first, last[name])
        row[name], moved[name] = angle_by_turn(model, name, row[name], before)
        last[name] = last[name] + moved[name]
    for name in names.now:
        if name in SIGNALS and SIGNALS[name].angle:
            row[name] = ca.if_else(anew, row[name], nearest_turn(row[name], last[name]))
    rate = turn_vectors(column_of_entries(row, ("u", "v")), row["psi"])
    way = dt / 2 * (column_of_entries(last, KEPT_ENTRIES[2:]) + rate)
    kept = ca.vertcat(column_of_entries(row, names.now), MX(np.zeros(2)), rate)
    shift = ca.vertcat(column_of_entries(moved, names.now), -way, MX(np.zeros(2)))
    reached = symbols["reached"] + column_of_entries(moved, names.reached)
    if model.physics.vessel is not None and names.reached:
        equations = Equations(model.physics.vessel)
        orders = column_of_entries(last, equations.model.commands)
        reached = memory_advance(equations.model)(reached, orders, equations.values, dt)
    results = {"kept": kept, "moved": ca.if_else(anew, 0, shift)}
    results["after"] = ca.if_else(anew, column_of_entries(row, names.reached), reached)
    return function_by_names("keep", symbols, results)


def past_function(model: ExportModel) -> ca.Function:
    """(before, after, order, newest, since, share) -> a row of the past at a time between two kept rows.

    order : the kept row whose orders are in force. since : time from `before` [s]. share : of the time to `after`.
    """
    names, every = model.layout, kept_names(model)
    rows = ("before", "after", "order", "newest")
    symbols = symbols_of({**dict.fromkeys(rows, len(every)), "since": 1, "share": 1})
    before, after, order, newest = (split_by_name(every, symbols[key]) for key in rows)
    since, share = symbols["since"], symbols["share"]
    row = {name: before[name] + share * (after[name] - before[name]) for name in every}
    if model.physics.path == "velocity":  # the trapezoid of linear rates, exact between rows
        way, rate = column_of_entries(before, KEPT_ENTRIES[:2]), column_of_entries(before, KEPT_ENTRIES[2:])
        place = way + since / 2 * (rate + column_of_entries(row, KEPT_ENTRIES[2:]))
    else:
        place = column_of_entries(row, POSITION_ENTRIES) - column_of_entries(newest, POSITION_ENTRIES)
    row |= {name: order[name] for name in every if "." in name}
    row |= split_by_name("xy", turn_vectors(place, -newest["psi"]))
    return function_by_names("past", symbols, {"past": column_of_entries(row, names.past)})


def begin_function(model: ExportModel, filters: FilterBank) -> ca.Function:
    """(kept row) -> states and estimates of the observer at the first row, as `shipid.observer.first_filter_states`."""
    symbol = MX.sym("row", len(kept_names(model)))
    row, commands = split_by_name(kept_names(model), symbol), filters.model.commands
    seen = column_of_entries({name: row[name] for name in filters.settings.measured}, MEASURED_MOTION)
    unknown = filter_state_sizes(filters.model)
    given = ca.vertcat(
        seen,
        MX(unknown[0] + unknown[1] - len(MEASURED_MOTION), 1),
        column_of_entries(row, tuple(filters.model.memory)),
        MX(unknown[3], 1),
        column_of_entries(row, commands),
        MX(1, 1),
    )
    still = first_filter_states(filters, np.zeros(len(MEASURED_MOTION)), np.zeros(len(commands)))
    results = {
        "states": ca.vec(ca.DM(still) + ca.repmat(ca.densify(given), 1, filters.num_filters)),
        "estimates": ca.vertcat(seen, MX(np.zeros(NUM_LOW_STATES - len(MEASURED_MOTION)))),
    }
    return function_by_names("begin", {"row": symbol}, results)


def observer_step(model: ExportModel, filters: FilterBank, seen: bool) -> ca.Function:
    """(states, last, row, moved, dt) -> states and, where the new row is seen, estimates after dt [s].

    last, row : kept rows. moved : what was added to the rows before. Where the filters divide the time between two
    rows, the last part alone sees the new row.
    """
    every, count, inner = kept_names(model), filters.num_filters, filters.model
    size, places = sum(filter_state_sizes(inner)), np.cumsum([0, *filter_state_sizes(inner)])
    sizes = {"states": size * count, **dict.fromkeys(("last", "row", "moved"), len(every))}
    symbols = symbols_of(sizes | {"dt": 1})
    last, row = (split_by_name(every, symbols[key]) for key in ("last", "row"))
    turns = ca.DM(size, len(every))  # which orders and positions in a state move with the angles of the past
    for first, group in ((places[2], tuple(inner.memory)), (places[4], inner.commands)):
        for key in angles_of(group):
            turns[first + group.index(key), every.index(key)] = 1
    measured = filters.settings.measured if seen else ()
    moved = ca.repmat(ca.densify(ca.mtimes(turns, symbols["moved"])), 1, count)
    after, estimates, *_ = (observer_function if seen else filters_function)(inner, count).call(
        [
            ca.reshape(symbols["states"], size, count) + moved,
            column_of_entries(last, inner.commands),
            column_of_entries(last, inner.environment),
            Equations(filters.vessel).values,
            ca.vertcat(*(row[key] if key in measured else MX(np.nan) for key in MEASURED_MOTION)),
            MX(filters.noise),
            MX(filters.numbers.T),
            symbols["dt"],
        ]
    )
    results = {"after": ca.vec(after)} | ({"estimates": estimates} if seen else {})
    return function_by_names("observe", symbols, results)


def nearest_turn(angle: MX, goal: Any) -> MX:
    """Of all angles that differ by whole turns, the one nearest to a goal."""
    return MX(angle + FULL_TURN * ca.floor(0.5 + (goal - angle) / FULL_TURN))


def angle_by_turn(model: ExportModel, name: str, angle: MX, last: MX) -> tuple[MX, MX]:
    """An angle of a thruster or rudder, which may come by any turn, and by how much the past is to be moved to it.

    Between stops less than a turn apart, and of a rudder, the turn within them is taken, so a jump is real. A unit that
    turns all round goes on from the last angle by the shortest way; where that leaves the limits of training and a turn
    back lies within them, the past is moved by that turn.
    """
    component, _, signal = name.rpartition(".")
    numbers = {} if model.physics.vessel is None else model.physics.vessel.parameters
    stops = [numbers.get(f"thruster.{component}.actuator.{signal}.{end}", np.inf) for end in ("low", "high")]
    if np.isfinite(stops).all() and stops[1] - stops[0] < FULL_TURN:
        return nearest_turn(angle, sum(stops) / 2), MX(0)
    if not is_all_round(name):
        return nearest_turn(angle, 0), MX(0)
    least, most = model.limits.get(name, (-np.inf, np.inf))
    on = nearest_turn(angle, last)
    back = nearest_turn(on, (least + most) / 2) if np.isfinite(most - least) else on
    leaves = ca.logic_and(ca.fmax(least - on, on - most) > 0, ca.fmax(least - back, back - most) <= 0)
    goes = ca.if_else(leaves, back, on)
    return goes, goes - on
