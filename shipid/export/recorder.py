"""What a recorder aboard computes with every row, as CasADi functions: state in, state out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.export.equations import Equations, function_by_names, split_by_name, symbols_of
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
MOST_TURN_BACK = 0.875  # of a turn: a unit that goes back by more goes round with the past instead


def filters_of(model: ExportModel) -> FilterBank | None:
    """The filters of the observer, where there is one: of the vessel without the terms of the method, as in Python."""
    physics = model.predictor.physics
    return None if physics.observer is None or physics.vessel is None else filter_bank(physics.vessel, physics.observer)


def recorder_functions(model: ExportModel) -> dict[str, ca.Function]:
    """Functions by name: `keep`; where the model has them `past`, `plan`, `begin`, `between` and `observe`."""
    functions = {"keep": keep_function(model)}
    if model.layout.num_past:
        functions["past"] = past_function(model)
    if angles_of(model.layout.planned):
        functions["plan"] = plan_function(model)
    filters = filters_of(model)
    if filters is not None:
        functions["begin"] = begin_function(model, filters)
        functions |= {name: observer_step(model, filters, name) for name in ("between", "observe")}
    return functions


def kept_names(model: ExportModel) -> tuple[str, ...]:
    """Entries of a kept row."""
    return (*model.layout.now, *KEPT_ENTRIES)


def angles_of(names: Sequence[str]) -> list[str]:
    """Angles of thrusters and rudders: they may come by any turn, 350 deg for -10 deg."""
    rows = ((name, signal_row(name)) for name in names if "." in name)
    return [name for name, row in rows if row is not None and row.angle]


def keep_function(model: ExportModel) -> ca.Function:
    """(last, row, reached, parameters, dt, anew) -> kept row, what is added to all kept before, reached after dt [s].

    last : the newest kept row. anew : 1 for a row before which nothing is known. Angles go on by the turn of
    `angle_by_turn`; headings and directions by the nearest one.
    """
    names = model.layout
    sizes_ = {"last": len(kept_names(model)), "row": len(names.now), "reached": len(names.reached)}
    symbols = symbols_of(sizes_ | {"parameters": len(names.parameters), "dt": 1, "anew": 1})
    dt, anew = symbols["dt"], symbols["anew"]
    last, row = split_by_name(kept_names(model), symbols["last"]), split_by_name(names.now, symbols["row"])
    numbers, moved = split_by_name(names.parameters, symbols["parameters"]), dict[str, MX]()
    for name in angles_of(names.now):
        limits = model.limits.get(name, (-np.inf, np.inf))
        before = ca.if_else(anew, first_turn(row[name], limits), last[name])
        row[name], moved[name] = angle_by_turn(name, row[name], before, limits, stops_of(model, name, numbers))
        last[name] = last[name] + moved[name]
    for name in names.now:
        if name in SIGNALS and SIGNALS[name].angle:
            row[name] = ca.if_else(anew, row[name], nearest_turn(row[name], last[name]))
    rate = turn_vectors(column_of_entries(row, ("u", "v")), row["psi"])
    way = dt / 2 * (column_of_entries(last, KEPT_ENTRIES[2:]) + rate)
    kept = ca.vertcat(column_of_entries(row, names.now), MX(np.zeros(2)), rate)
    shift = ca.vertcat(column_of_entries(moved, names.now), -way, MX(np.zeros(2)))
    reached = symbols["reached"] + column_of_entries(moved, names.reached)
    if model.vessel is not None and names.reached:
        equations = Equations(model.vessel)
        orders = column_of_entries(last, equations.model.commands)
        reached = equations.advance(reached, orders, symbols["parameters"], dt)
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


def plan_function(model: ExportModel) -> ca.Function:
    """(planned, before, newest, parameters, first) -> orders of a step, its angles going on from `before`.

    newest : the newest kept row, from which the first step goes on.
    """
    names, every = model.layout, kept_names(model)
    sizes_ = {"planned": len(names.planned), "before": len(names.planned), "newest": len(every)}
    symbols = symbols_of(sizes_ | {"parameters": len(names.parameters), "first": 1})
    orders, before = split_by_name(names.planned, symbols["planned"]), split_by_name(names.planned, symbols["before"])
    newest, numbers = split_by_name(every, symbols["newest"]), split_by_name(names.parameters, symbols["parameters"])
    for name in angles_of(names.planned):
        limits = model.limits.get(name, (-np.inf, np.inf))
        last = ca.if_else(symbols["first"], newest[name], before[name])
        orders[name], _ = angle_by_turn(name, orders[name], last, limits, stops_of(model, name, numbers), movable=False)
    return function_by_names("plan", symbols, {"orders": column_of_entries(orders, names.planned)})


def begin_function(model: ExportModel, filters: FilterBank) -> ca.Function:
    """(kept row) -> states and estimates of the observer at the first row, as `shipid.observer.first_filter_states`."""
    commands, measured = filters.model.commands, filters.settings.measured
    count = len(MEASURED_MOTION) + len(commands)
    still = first_filter_states(filters, np.zeros(len(MEASURED_MOTION)), np.zeros(len(commands))).ravel("F")
    slopes = [  # states are linear in what is measured, and in the commands
        first_filter_states(filters, one[: len(MEASURED_MOTION)], one[len(MEASURED_MOTION) :]).ravel("F") - still
        for one in np.eye(count)
    ]
    symbol = MX.sym("row", len(kept_names(model)))
    row = split_by_name(kept_names(model), symbol)
    given = ca.vertcat(column_of_entries(row, MEASURED_MOTION), column_of_entries(row, commands))
    states = ca.DM(still) + ca.mtimes(ca.sparsify(ca.DM(np.stack(slopes, axis=1))), given)
    estimates: dict[str, MX] = {name: row[name] for name in measured}
    results = {
        "states": states,
        "estimates": ca.vertcat(
            column_of_entries(estimates, MEASURED_MOTION), MX(np.zeros(NUM_LOW_STATES - len(MEASURED_MOTION)))
        ),
    }
    return function_by_names("begin", {"row": symbol}, results)


def observer_step(model: ExportModel, filters: FilterBank, name: str) -> ca.Function:
    """(states, last, row, moved, parameters, dt) -> states of the observer after dt [s], and with `observe` estimates.

    last, row : kept rows. moved : what was added to the rows before. Where the filters divide the time between two
    rows, `between` carries each on without a measurement: `observe` alone, the last part, knows the new row.
    """
    every, count, inner = kept_names(model), filters.num_filters, filters.model
    size, places = sum(filter_state_sizes(inner)), np.cumsum([0, *filter_state_sizes(inner)])
    rows = dict.fromkeys(("last", "row", "moved"), len(every))
    symbols = symbols_of({"states": size * count, **rows, "parameters": len(model.layout.parameters), "dt": 1})
    last, row = (split_by_name(every, symbols[key]) for key in ("last", "row"))
    turns = ca.DM(size, len(every))  # which orders and positions in a state move with the angles of the past
    for first, group in ((places[2], tuple(inner.memory)), (places[4], inner.commands)):
        for key in angles_of(group):
            turns[first + group.index(key), every.index(key)] = 1
    measured = {key: row[key] for key in filters.settings.measured if name == "observe"}
    given = [
        ca.reshape(symbols["states"], size, count)
        + ca.repmat(ca.densify(ca.mtimes(turns, symbols["moved"])), 1, count),
        column_of_entries(last, inner.commands),
        column_of_entries(last, inner.environment),
        symbols["parameters"][[model.layout.parameters.index(key) for key in inner.parameters]],
        ca.vertcat(*(measured.get(key, MX(np.nan)) for key in MEASURED_MOTION)),
        MX(ca.DM(filters.noise)),
        MX(ca.DM(filters.numbers.T)),
        symbols["dt"],
    ]
    if name == "observe":
        after, estimates, *_ = observer_function(inner, count)(*given)
        return function_by_names(name, symbols, {"after": ca.vec(after), "estimates": estimates})
    after, *_ = filters_function(inner, count)(*given)
    return function_by_names(name, symbols, {"after": ca.vec(after)})


def nearest_turn(angle: MX, goal: Any) -> MX:
    """Of all angles that differ by whole turns, the one nearest to a goal."""
    return MX(angle + FULL_TURN * ca.floor(0.5 + (goal - angle) / FULL_TURN))


def first_turn(angle: MX, limits: tuple[float, float]) -> MX:
    """The first angle of a stretch of rows: the turn nearest to the training, where that is narrower than a turn."""
    least, most = limits
    return nearest_turn(angle, (least + most) / 2) if most - least <= FULL_TURN else angle


def stops_of(model: ExportModel, command: str, numbers: Mapping[str, MX]) -> tuple[MX, MX]:
    """Stops of a unit: numbers of the vessel that may be changed aboard, or constants; infinite where it has none."""
    component, _, signal = command.rpartition(".")
    document: Mapping[str, Any] = {} if model.vessel is None else model.vessel.document
    gear = document.get("thruster", {}).get(component, {}).get("actuator", {}).get(signal, {})
    path = f"thruster.{component}.actuator.{signal}"
    low, high = (
        numbers.get(f"{path}.{end}", MX(float(gear.get(end, none))))
        for end, none in (("low", -np.inf), ("high", np.inf))
    )
    return low, high


def angle_by_turn(
    name: str, angle: MX, last: MX, limits: tuple[float, float], stops: tuple[MX, MX], movable: bool = True
) -> tuple[MX, MX]:
    """An angle of a thruster or rudder, which may differ by whole turns, by the turn that goes on from the last one.

    Between stops that are less than a turn apart the angle within them is taken, so a jump is real. A unit that turns
    all round goes the shortest way; where that leaves the limits of training and a turn back lies within, it is taken.

    Returns
    -------
    The angle, and by how much the past is to be moved so that it goes on to it; 0 unless it is `movable`.
    """
    (least, most), (low, high) = limits, stops
    narrow, stopped = most - least <= FULL_TURN, high - low < FULL_TURN
    middle = nearest_turn(angle, ca.if_else(stopped, (low + high) / 2, 0))
    jump = middle if not narrow else ca.if_else(stopped, middle, first_turn(angle, limits))
    if narrow:
        lifted = angle + FULL_TURN * ca.ceil((least - angle) / FULL_TURN)
        jump = ca.if_else(lifted <= most, lifted, jump)
    jump = ca.if_else(ca.logic_and(stopped, _is_between(middle, low, high)), middle, jump)
    if not is_all_round(name):
        return jump, MX(0)
    on = nearest_turn(angle, last)
    up, down = FULL_TURN * ca.ceil((least - on) / FULL_TURN), FULL_TURN * ca.ceil((on - most) / FULL_TURN)
    back = ca.if_else(on < least, on + up, on - down)
    near: Any = (
        ca.logic_and(_is_between(last, least, most), ca.fabs(back - last) <= MOST_TURN_BACK * FULL_TURN)
        if narrow
        else MX(0)
    )
    leaves = ca.logic_and(ca.logic_not(_is_between(on, least, most)), _is_between(back, least, most))
    takes = ca.logic_and(leaves, MX(1) if movable else near)
    goes = ca.if_else(takes, back, on)
    moves = ca.if_else(ca.logic_and(takes, ca.logic_not(near)), back - on, 0)
    over = (
        ca.logic_and(on < low, on + FULL_TURN <= high),
        ca.logic_and(on > high, on - FULL_TURN >= low),
    )  # it turns at a stop
    for passed, turn in zip(over, (FULL_TURN, -FULL_TURN), strict=True):
        goes, moves = ca.if_else(passed, on + turn, goes), ca.if_else(passed, 0, moves)
    return ca.if_else(stopped, jump, goes), ca.if_else(stopped, 0, moves)


def _is_between(value: MX, low: Any, high: Any) -> MX:
    return MX(ca.logic_and(value >= low, value <= high))
