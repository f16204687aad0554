"""C99 of a vessel alone: CasADi's C of its rates and its step, behind a header with names, units and order."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from casadi import MX

from shipid.engine.integrate import Method
from shipid.engine.rollout import SPEED_LIMIT
from shipid.export.c import (
    ARE_FINITE,
    SINGLE_PRECISION_NOTE,
    SOURCE_HEAD,
    NumberPrecision,
    SourceFiles,
    array_of,
    c_comment,
    fill_template,
    generate_c,
    places_above_zero,
    tables_of,
)
from shipid.export.equations import Equations, function_by_names, symbols_of
from shipid.physics.grammar import AXES
from shipid.physics.signals import ACTUAL, SIGNALS, signal_of, signal_row
from shipid.simulation.log import state_column
from shipid.version import __version__
from shipid.vessel.load import Vessel


@dataclass(frozen=True, eq=False)
class VesselParts:
    """What is written of a vessel: names and units of each argument, and its functions."""

    vessel: Vessel
    method: Method

    @cached_property
    def equations(self) -> Equations:
        """Functions of the vessel."""
        return Equations(self.vessel)

    def groups(self) -> dict[str, tuple[str, ...]]:
        """Names of the entries of each argument."""
        model = self.equations.model
        return {
            "carry": (*self.equations.states, *(f"{ACTUAL}{name}" for name in model.memory)),
            "commands": model.commands,
            "environment": model.environment,
            "loads": tuple(AXES[axis] for axis in self.vessel.axes),
            "parameters": model.parameters,
        }

    def units(self) -> dict[str, dict[str, str]]:
        """SI unit of each entry of each argument."""
        return {group: {name: self._unit(group, name) for name in names} for group, names in self.groups().items()}

    def _unit(self, group: str, name: str) -> str:
        if group == "parameters":
            return self.vessel.units[name]
        if group == "loads":
            return "N" if name in "XYZ" else "N m"
        row = signal_row(state_column(name))
        return _unit_of_hidden_state(name) if row is None else row.unit

    @cached_property
    def functions(self) -> dict[str, ca.Function]:
        """`step`: (carry, commands, environment, loads, parameters, dt) -> carry after dt; `rates` and `begin` of a carry."""
        equations, groups = self.equations, self.groups()
        inputs, count = symbols_of({key: len(names) for key, names in groups.items()}), len(equations.states)
        carry, commands, environment, loads, parameters = inputs.values()
        dt = MX.sym("dt")
        after = equations.step(self.method)(carry, commands, environment, loads, parameters, dt)
        rates = equations.rates(carry[:count], carry[count:], commands, environment, parameters, loads)
        begun = ca.vertcat(carry[:count], equations.begun(commands, parameters))
        return {
            "step": function_by_names("step", {**inputs, "dt": dt}, {"after": after}),
            "rates": function_by_names("rates", inputs, {"rates": rates}),
            "begin": function_by_names("begin", inputs, {"begun": begun}),
        }


def vessel_files(vessel: Vessel, name: str, method: Method, precision: NumberPrecision) -> SourceFiles:
    """A vessel alone: its rates and its step, for simulation in C."""
    parts = VesselParts(vessel, method)
    made = generate_c(parts.functions, name, precision)
    defaults = {"defaults": np.array(list(vessel.parameters.values()))}
    declared, defined = tables_of(name, parts.units(), defaults, precision)
    sizes = {f"NUM_{group.upper()}": len(names) for group, names in parts.groups().items()}
    places, num_dof = places_above_zero(parts.groups()["parameters"], vessel), parts.equations.model.num_dof
    replaced = {
        "GUARD": f"{name.upper()}_H",
        "REAL": precision.real,
        "SIZES": ",\n    ".join(f"{name}_{key} = {value}" for key, value in sizes.items()),
        "DECLARED": declared,
        "DEFINED": defined,
        "FUNCTIONS": made.declared,
        "ABOVE": f"static {array_of('int', 'above_zero', places)}",
        "NUM_ABOVE": str(len(places)),
        "ARRAYS": made.arrays + f"\n    real w[{made.num_w}];",
        "FIRST": str(num_dof),
        "LAST": str(2 * num_dof),
        "LIMIT": f"{SPEED_LIMIT:g}",
        "RULE": "explicit Euler" if method == "euler" else "classical Runge-Kutta (RK4)",
    }

    head = c_comment(
        [
            f"{vessel.name}: equations of motion in C99, written by shipid {__version__}.",
            f"Vessel document digest {vessel.digest}.",
            "",
            "SI units, radians, revolutions per second. The state is position and heading (psi, not the course over ground),",
            "velocities over ground in body axes; then the hidden states of terms and the positions of actuators that",
            "lag behind their orders. Names and units of every entry, in order, are in the tables below. Directions of",
            "wind and current are towards.",
            "Not in this file: waves that a simulated truth draws, a screening of inputs, a helmsman.",
            *(SINGLE_PRECISION_NOTE if precision.single else []),
            "No memory is allocated and nothing is kept between calls.",
        ]
    )
    origin = c_comment([f"{vessel.name}, written by shipid {__version__}; see {name}.h."])
    texts = {
        f"{name}.h": f"{head}\n{fill_template(_VESSEL_HEADER, name, replaced)}",
        f"{name}.c": f"{origin}\n{fill_template(SOURCE_HEAD + _VESSEL_SOURCE, name, replaced)}",
        f"{name}_casadi.c": made.text,
        "main.c": fill_template(_example(parts, precision), name, {}),
    }
    return SourceFiles(name, texts)


_VESSEL_HEADER = """#ifndef $GUARD
#define $GUARD

#ifdef __cplusplus
extern "C" {
#endif

typedef $REAL @_real;

enum {
    $SIZES
};

/* Results of @_step: 0, or a sum of these. The carry is as it was unless the result is 0. */
enum {
    @_NOT_FINITE = 1, /* an input is not a finite number */
    @_TIME = 2,       /* the step is not above 0 */
    @_DIVERGED = 4,   /* the state after the step is not finite, or a velocity is above $LIMIT */
    @_PARAMETER = 8   /* a parameter that must be above 0 is not, such as inertia.m */
};

$DECLARED

/* Actuators of a carry take the positions that the commands order, within the stops of @_defaults. */
void @_begin(@_real *carry, const @_real *commands);

/* d(state)/dt of @_NUM_CARRY less the actuators. loads: forces and moments that are added, such as waves or a tug. */
void @_rates(const @_real *carry, const @_real *commands, const @_real *environment,
             const @_real *loads, const @_real *parameters, @_real *rates);

/* One step of $RULE over dt seconds; actuators move exactly. Any dt above 0; up to a tenth of the
 * ship's shortest time constant is accurate. parameters: @_defaults, or a changed copy of it. */
int @_step(@_real *carry, const @_real *commands, const @_real *environment,
           const @_real *loads, const @_real *parameters, @_real dt);

#ifdef __cplusplus
}
#endif
#endif
"""

_VESSEL_SOURCE = (
    """
$FUNCTIONS

$DEFINED

"""
    + ARE_FINITE
    + """
/* One of CasADi's functions of the same inputs. */
static void evaluate(int function, const real *carry, const real *commands, const real *environment,
    const real *loads, const real *parameters, const real *dt, real *result)
{
    $ARRAYS
    arg[0] = carry;
    arg[1] = commands;
    arg[2] = environment;
    arg[3] = loads;
    arg[4] = parameters;
    arg[5] = dt;
    res[0] = result;
    if (function == 0) @_casadi_step(arg, res, iw, w, 0);
    else if (function == 1) @_casadi_rates(arg, res, iw, w, 0);
    else @_casadi_begin(arg, res, iw, w, 0);
}

static void begin_within(real *carry, const real *commands, const real *parameters)
{
    real begun[@_NUM_CARRY];
    evaluate(2, carry, commands, 0, 0, parameters, 0, begun);
    memcpy(carry, begun, sizeof begun);
}

void @_begin(@_real *carry, const @_real *commands)
{
    begin_within(carry, commands, @_defaults);
}

void @_rates(const @_real *carry, const @_real *commands, const @_real *environment,
             const @_real *loads, const @_real *parameters, @_real *rates)
{
    evaluate(1, carry, commands, environment, loads, parameters, 0, rates);
}

int @_step(@_real *carry, const @_real *commands, const @_real *environment,
           const @_real *loads, const @_real *parameters, @_real dt)
{
    $ABOVE
    real after[@_NUM_CARRY];
    int i;
    if (!are_finite(carry, @_NUM_CARRY) || !are_finite(commands, @_NUM_COMMANDS) || !are_finite(loads, @_NUM_LOADS)
        || !are_finite(environment, @_NUM_ENVIRONMENT) || !are_finite(parameters, @_NUM_PARAMETERS) || !isfinite(dt))
        return @_NOT_FINITE;
    for (i = 0; i < $NUM_ABOVE; ++i) if (!(parameters[above_zero[i]] > 0)) return @_PARAMETER;
    if (!(dt > 0)) return @_TIME;
    evaluate(0, carry, commands, environment, loads, parameters, &dt, after);
    if (!are_finite(after, @_NUM_CARRY)) return @_DIVERGED;
    for (i = $FIRST; i < $LAST; ++i) if (!(fabs((double)after[i]) <= $LIMIT)) return @_DIVERGED;
    memcpy(carry, after, sizeof after);
    return 0;
}
"""
)


def _example(parts: VesselParts, precision: NumberPrecision) -> str:
    """An example: a minute with the helm over."""
    groups, orders = parts.groups(), []
    for command in groups["commands"]:
        row = SIGNALS[signal_of(command)]
        orders.append(np.deg2rad(10) if row.turns else row.usual[0] + 0.5 * (row.usual[1] - row.usual[0]))
    speed = groups["carry"].index("u")
    return f"""/* A minute of @ with the helm over. cc -std=c99 main.c @.c @_casadi.c -lm */
#include <stdio.h>

#include "@.h"

int main(void)
{{
    @_real carry[@_NUM_CARRY] = {{0}};
    {array_of("@_real", "commands", orders, precision.table(np.array(orders)))}
    const @_real environment[{max(1, len(groups["environment"]))}] = {{0}};
    const @_real loads[@_NUM_LOADS] = {{0}};
    int i, status = 0;
    carry[{speed}] = 1; /* {groups["carry"][speed]} */
    @_begin(carry, commands);
    for (i = 0; i < 600 && status == 0; ++i)
        status = @_step(carry, commands, environment, loads, @_defaults, {precision.number(0.1)});
    for (i = 0; i < @_NUM_CARRY; ++i)
        printf("%s %.6g %s\\n", @_carry_names[i], (double)carry[i], @_carry_units[i]);
    return status;
}}
"""


def _unit_of_hidden_state(name: str) -> str:
    """Unit of a state that a term keeps: the time of waves, or what the velocity that drives a mode adds up to."""
    state = signal_of(name)
    return "s" if state == "t" else SIGNALS[state[0]].unit.removesuffix("/s")
