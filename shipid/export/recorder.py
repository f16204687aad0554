"""What a recorder aboard computes with every row, as CasADi functions: state in, state out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from casadi import MX

from shipid.export.equations import Equations, by_name, named_function, symbols_of
from shipid.export.known import PLACE, stacked, turned
from shipid.export.model import Model
from shipid.observer import LOW, MEASURED, Bank, bank, begin, filters_function, observer_function, sizes
from shipid.physics.signals import SIGNALS, is_all_round, signal_row

TURN = 2 * np.pi
KEPT = ("way_north", "way_east", "rate_north", "rate_east")
"""Entries of a kept row beside those of `Layout.now`: integrated way from the newest row [m], velocity [m/s]."""
BACK = 0.875  # of a turn: a unit that goes back by more goes round with the past instead


def filters_of(model: Model) -> Bank | None:
    """The filters of the observer, where there is one: of the vessel without the terms of the method, as in Python."""
    physics = model.predictor.physics
    return None if physics.observer is None or physics.vessel is None else bank(physics.vessel, physics.observer)


def recorder_functions(model: Model) -> dict[str, ca.Function]:
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


def kept_names(model: Model) -> tuple[str, ...]:
    """Entries of a kept row."""
    return (*model.layout.now, *KEPT)


def angles_of(names: Sequence[str]) -> list[str]:
    """Angles of thrusters and rudders: they may come by any turn, 350 deg for -10 deg."""
    rows = ((name, signal_row(name)) for name in names if "." in name)
    return [name for name, row in rows if row is not None and row.angle]


def keep_function(model: Model) -> ca.Function:
    """(last, row, reached, parameters, dt, anew) -> kept row, what is added to all kept before, reached after dt [s].

    last : the newest kept row. anew : 1 for a row before which nothing is known. Angles go on by the turn of
    `same_turn`; headings and directions by the nearest one.
    """
    names = model.layout
    sizes_ = {"last": len(kept_names(model)), "row": len(names.now), "reached": len(names.reached)}
    symbols = symbols_of(sizes_ | {"parameters": len(names.parameters), "dt": 1, "anew": 1})
    dt, anew = symbols["dt"], symbols["anew"]
    last, row = by_name(kept_names(model), symbols["last"]), by_name(names.now, symbols["row"])
    numbers, moved = by_name(names.parameters, symbols["parameters"]), dict[str, MX]()
    for name in angles_of(names.now):
        limits = model.limits.get(name, (-np.inf, np.inf))
        before = ca.if_else(anew, first_turn(row[name], limits), last[name])
        row[name], moved[name] = same_turn(name, row[name], before, limits, stops_of(model, name, numbers))
        last[name] = last[name] + moved[name]
    for name in names.now:
        if name in SIGNALS and SIGNALS[name].angle:
            row[name] = ca.if_else(anew, row[name], nearest_turn(row[name], last[name]))
    rate = turned(stacked(row, ("u", "v")), row["psi"])
    way = dt / 2 * (stacked(last, KEPT[2:]) + rate)
    kept = ca.vertcat(stacked(row, names.now), MX(np.zeros(2)), rate)
    shift = ca.vertcat(stacked(moved, names.now), -way, MX(np.zeros(2)))
    reached = symbols["reached"] + stacked(moved, names.reached)
    if model.vessel is not None and names.reached:
        equations = Equations(model.vessel)
        orders = stacked(last, equations.model.commands)
        reached = equations.advance(reached, orders, symbols["parameters"], dt)
    results = {"kept": kept, "moved": ca.if_else(anew, 0, shift)}
    results["after"] = ca.if_else(anew, stacked(row, names.reached), reached)
    return named_function("keep", symbols, results)


def past_function(model: Model) -> ca.Function:
    """(before, after, order, newest, since, share) -> a row of the past at a time between two kept rows.

    order : the kept row whose orders are in force. since : time from `before` [s]. share : of the time to `after`.
    """
    names, every = model.layout, kept_names(model)
    rows = ("before", "after", "order", "newest")
    symbols = symbols_of({**dict.fromkeys(rows, len(every)), "since": 1, "share": 1})
    before, after, order, newest = (by_name(every, symbols[key]) for key in rows)
    since, share = symbols["since"], symbols["share"]
    row = {name: before[name] + share * (after[name] - before[name]) for name in every}
    if model.physics.path == "velocity":  # the trapezoid of linear rates, exact between rows
        way, rate = stacked(before, KEPT[:2]), stacked(before, KEPT[2:])
        place = way + since / 2 * (rate + stacked(row, KEPT[2:]))
    else:
        place = stacked(row, PLACE) - stacked(newest, PLACE)
    row |= {name: order[name] for name in every if "." in name}
    row |= by_name("xy", turned(place, -newest["psi"]))
    return named_function("past", symbols, {"past": stacked(row, names.past)})


def plan_function(model: Model) -> ca.Function:
    """(planned, before, newest, parameters, first) -> orders of a step, its angles going on from `before`.

    newest : the newest kept row, from which the first step goes on.
    """
    names, every = model.layout, kept_names(model)
    sizes_ = {"planned": len(names.planned), "before": len(names.planned), "newest": len(every)}
    symbols = symbols_of(sizes_ | {"parameters": len(names.parameters), "first": 1})
    orders, before = by_name(names.planned, symbols["planned"]), by_name(names.planned, symbols["before"])
    newest, numbers = by_name(every, symbols["newest"]), by_name(names.parameters, symbols["parameters"])
    for name in angles_of(names.planned):
        limits = model.limits.get(name, (-np.inf, np.inf))
        last = ca.if_else(symbols["first"], newest[name], before[name])
        orders[name], _ = same_turn(name, orders[name], last, limits, stops_of(model, name, numbers), movable=False)
    return named_function("plan", symbols, {"orders": stacked(orders, names.planned)})


def begin_function(model: Model, filters: Bank) -> ca.Function:
    """(kept row) -> states and estimates of the observer at the first row, as `shipid.observer.begin`."""
    commands, measured = filters.model.commands, filters.settings.measured
    count = len(MEASURED) + len(commands)
    still = begin(filters, np.zeros(len(MEASURED)), np.zeros(len(commands))).ravel("F")
    slopes = [  # states are linear in what is measured, and in the commands
        begin(filters, one[: len(MEASURED)], one[len(MEASURED) :]).ravel("F") - still for one in np.eye(count)
    ]
    symbol = MX.sym("row", len(kept_names(model)))
    row = by_name(kept_names(model), symbol)
    given = ca.vertcat(stacked(row, MEASURED), stacked(row, commands))
    states = ca.DM(still) + ca.mtimes(ca.sparsify(ca.DM(np.stack(slopes, axis=1))), given)
    estimates: dict[str, MX] = {name: row[name] for name in measured}
    results = {
        "states": states,
        "estimates": ca.vertcat(stacked(estimates, MEASURED), MX(np.zeros(LOW - len(MEASURED)))),
    }
    return named_function("begin", {"row": symbol}, results)


def observer_step(model: Model, filters: Bank, name: str) -> ca.Function:
    """(states, last, row, moved, parameters, dt) -> states of the observer after dt [s], and with `observe` estimates.

    last, row : kept rows. moved : what was added to the rows before. Where the filters divide the time between two
    rows, `between` carries each on without a measurement: `observe` alone, the last part, knows the new row.
    """
    every, count, inner = kept_names(model), filters.num_filters, filters.model
    size, places = sum(sizes(inner)), np.cumsum([0, *sizes(inner)])
    rows = dict.fromkeys(("last", "row", "moved"), len(every))
    symbols = symbols_of({"states": size * count, **rows, "parameters": len(model.layout.parameters), "dt": 1})
    last, row = (by_name(every, symbols[key]) for key in ("last", "row"))
    turns = ca.DM(size, len(every))  # which orders and positions in a state move with the angles of the past
    for first, group in ((places[2], tuple(inner.memory)), (places[4], inner.commands)):
        for key in angles_of(group):
            turns[first + group.index(key), every.index(key)] = 1
    measured = {key: row[key] for key in filters.settings.measured if name == "observe"}
    given = [
        ca.reshape(symbols["states"], size, count)
        + ca.repmat(ca.densify(ca.mtimes(turns, symbols["moved"])), 1, count),
        stacked(last, inner.commands),
        stacked(last, inner.environment),
        symbols["parameters"][[model.layout.parameters.index(key) for key in inner.parameters]],
        ca.vertcat(*(measured.get(key, MX(np.nan)) for key in MEASURED)),
        MX(ca.DM(filters.noise)),
        MX(ca.DM(filters.numbers.T)),
        symbols["dt"],
    ]
    if name == "observe":
        after, estimates, *_ = observer_function(inner, count)(*given)
        return named_function(name, symbols, {"after": ca.vec(after), "estimates": estimates})
    after, *_ = filters_function(inner, count)(*given)
    return named_function(name, symbols, {"after": ca.vec(after)})


def nearest_turn(angle: MX, goal: Any) -> MX:
    """Of all angles that differ by whole turns, the one nearest to a goal."""
    return MX(angle + TURN * ca.floor(0.5 + (goal - angle) / TURN))


def first_turn(angle: MX, limits: tuple[float, float]) -> MX:
    """The first angle of a stretch of rows: the turn nearest to the training, where that is narrower than a turn."""
    least, most = limits
    return nearest_turn(angle, (least + most) / 2) if most - least <= TURN else angle


def stops_of(model: Model, command: str, numbers: Mapping[str, MX]) -> tuple[MX, MX]:
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


def same_turn(
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
    narrow, stopped = most - least <= TURN, high - low < TURN
    middle = nearest_turn(angle, ca.if_else(stopped, (low + high) / 2, 0))
    jump = middle if not narrow else ca.if_else(stopped, middle, first_turn(angle, limits))
    if narrow:
        lifted = angle + TURN * ca.ceil((least - angle) / TURN)
        jump = ca.if_else(lifted <= most, lifted, jump)
    jump = ca.if_else(ca.logic_and(stopped, _between(middle, low, high)), middle, jump)
    if not is_all_round(name):
        return jump, MX(0)
    on = nearest_turn(angle, last)
    up, down = TURN * ca.ceil((least - on) / TURN), TURN * ca.ceil((on - most) / TURN)
    back = ca.if_else(on < least, on + up, on - down)
    near: Any = ca.logic_and(_between(last, least, most), ca.fabs(back - last) <= BACK * TURN) if narrow else MX(0)
    leaves = ca.logic_and(ca.logic_not(_between(on, least, most)), _between(back, least, most))
    takes = ca.logic_and(leaves, MX(1) if movable else near)
    goes = ca.if_else(takes, back, on)
    moves = ca.if_else(ca.logic_and(takes, ca.logic_not(near)), back - on, 0)
    over = ca.logic_and(on < low, on + TURN <= high), ca.logic_and(on > high, on - TURN >= low)  # it turns at a stop
    for passed, turn in zip(over, (TURN, -TURN), strict=True):
        goes, moves = ca.if_else(passed, on + turn, goes), ca.if_else(passed, 0, moves)
    return ca.if_else(stopped, jump, goes), ca.if_else(stopped, 0, moves)


def _between(value: MX, low: Any, high: Any) -> MX:
    return MX(ca.logic_and(value >= low, value <= high))
