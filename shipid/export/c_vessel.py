"""C99 of a vessel alone: CasADi's C of its rates and its step, behind a header with names, units and order."""

from __future__ import annotations

import numpy as np

from shipid.engine.integrate import Method
from shipid.engine.rollout import SPEED_LIMIT
from shipid.export.c import SourceFiles, Wrapper, array_of, source_files
from shipid.export.equations import Equations
from shipid.version import __version__
from shipid.vessel.load import Vessel


def vessel_files(vessel: Vessel, name: str, method: Method) -> SourceFiles:
    """A vessel alone: its rates and its step, for simulation in C."""
    equations = Equations(vessel)
    about = [
        f"{vessel.name}: equations of motion in C99, written by shipid {__version__}.",
        f"Vessel document digest {vessel.digest}.",
        "",
        "SI units, radians, revolutions per second. The state is position and heading (psi, not the course over ground),",
        "velocities over ground in body axes; then the hidden states of terms and the positions of actuators that",
        "lag behind their orders. Names and units of every entry, in order, are in the tables below. Directions of",
        "wind and current are towards.",
        "Not in this file: waves that a simulated truth draws, a screening of inputs, a helmsman.",
        "No memory is allocated and nothing is kept between calls.",
    ]
    num_dof, entries = equations.model.num_dof, list(equations.groups["carry"])
    values = {"FIRST": num_dof, "LAST": 2 * num_dof, "LIMIT": f"{SPEED_LIMIT:g}", "RULE": method}
    above = [place for place, name in enumerate(equations.groups["parameters"]) if name in vessel.above_zero]
    values |= {"SPEED": entries.index("u"), "ABOVE": array_of("int", "above_zero", above), "NUM_ABOVE": len(above)}
    defaults = {"defaults": np.array(list(vessel.parameters.values()))}
    return source_files(name, about, equations.functions(method), equations.groups, defaults, _WRAPPER, values)


_HEADER = """enum {
$SIZES
    /* Results of @_step: 0, or a sum of these. The carry is as it was unless the result is 0. */
    @_NOT_FINITE = 1, /* an input is not a finite number */
    @_TIME = 2,       /* the step is not above 0 */
    @_DIVERGED = 4,   /* the state after the step is not finite, or a velocity is above $LIMIT */
    @_PARAMETER = 8   /* a parameter that must be above 0 is not, such as inertia.m */
};

/* Actuators of a carry take the positions that the commands order, within the stops of the parameters. */
void @_begin(double *carry, const double *commands, const double *parameters);

/* d(state)/dt of @_NUM_CARRY less the actuators. loads: forces and moments that are added, such as waves or a tug. */
void @_rates(const double *carry, const double *commands, const double *environment,
             const double *loads, const double *parameters, double *rates);

/* One step of $RULE over dt seconds; actuators move exactly. Any dt above 0; up to a tenth of the
 * ship's shortest time constant is accurate. parameters: @_defaults, or a changed copy of it. */
int @_step(double *carry, const double *commands, const double *environment,
           const double *loads, const double *parameters, double dt);
"""

_SOURCE = """
static $ABOVE

static int are_above_zero(const double *parameters)
{
    int i;
    for (i = 0; i < $NUM_ABOVE; ++i) if (!(parameters[above_zero[i]] > 0)) return 0;
    return 1;
}

void @_begin(double *carry, const double *commands, const double *parameters)
{
    double begun[@_NUM_CARRY], w[$WORK];
    $ARRAYS
    arg[0] = carry;
    arg[1] = commands;
    arg[4] = parameters;
    res[0] = begun;
    @_casadi_begin(arg, res, iw, w, 0);
    memcpy(carry, begun, sizeof begun);
}

void @_rates(const double *carry, const double *commands, const double *environment,
             const double *loads, const double *parameters, double *rates)
{
    double w[$WORK];
    $ARRAYS
    arg[0] = carry;
    arg[1] = commands;
    arg[2] = environment;
    arg[3] = loads;
    arg[4] = parameters;
    res[0] = rates;
    @_casadi_rates(arg, res, iw, w, 0);
}

int @_step(double *carry, const double *commands, const double *environment,
           const double *loads, const double *parameters, double dt)
{
    double after[@_NUM_CARRY], w[$WORK];
    int i;
    $ARRAYS
    if (!are_finite(carry, @_NUM_CARRY) || !are_finite(commands, @_NUM_COMMANDS) || !are_finite(loads, @_NUM_LOADS)
        || !are_finite(environment, @_NUM_ENVIRONMENT) || !are_finite(parameters, @_NUM_PARAMETERS) || !isfinite(dt))
        return @_NOT_FINITE;
    if (!are_above_zero(parameters)) return @_PARAMETER;
    if (!(dt > 0)) return @_TIME;
    arg[0] = carry;
    arg[1] = commands;
    arg[2] = environment;
    arg[3] = loads;
    arg[4] = parameters;
    arg[5] = &dt;
    res[0] = after;
    @_casadi_step(arg, res, iw, w, 0);
    if (!are_finite(after, @_NUM_CARRY)) return @_DIVERGED;
    for (i = $FIRST; i < $LAST; ++i) if (!(fabs(after[i]) <= $LIMIT)) return @_DIVERGED;
    memcpy(carry, after, sizeof after);
    return 0;
}
"""

_EXAMPLE = """/* A minute of @ that nobody steers, from 1 m/s ahead. cc -std=c99 main.c @.c @_casadi.c -lm */
#include <stdio.h>

#include "@.h"

int main(void)
{
    double carry[@_NUM_CARRY] = {0};
    const double commands[@_NUM_COMMANDS + 1] = {0}, environment[@_NUM_ENVIRONMENT + 1] = {0};
    const double loads[@_NUM_LOADS] = {0};
    int i, status = 0;
    carry[$SPEED] = 1;
    @_begin(carry, commands, @_defaults);
    for (i = 0; i < 600 && status == 0; ++i)
        status = @_step(carry, commands, environment, loads, @_defaults, 0.1);
    for (i = 0; i < @_NUM_CARRY; ++i) printf("%s %.6g %s\\n", @_carry_names[i], carry[i], @_carry_units[i]);
    return status;
}
"""

_WRAPPER = Wrapper(_HEADER, _SOURCE, _EXAMPLE)
