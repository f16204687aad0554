"""C99 of a vessel alone: its rates and its step, with libm as the only dependency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipid.engine.integrate import Method
from shipid.engine.rollout import SPEED_LIMIT
from shipid.export.blocks import Block, Precision, c_functions
from shipid.export.c import NEARBY, Files, array_of, comment, refusals, source_head, tables_of_names
from shipid.export.equations import Equations
from shipid.physics.grammar import AXES
from shipid.physics.signals import ACTUAL, SIGNALS, row_of, signal_of
from shipid.simulation.log import column_of
from shipid.version import __version__
from shipid.vessel.load import Vessel


def vessel_files(vessel: Vessel, name: str, method: Method, precision: Precision) -> Files:
    """A vessel alone: its rates and its step, for simulation in C."""
    parts = VesselParts(vessel, name, method, precision)
    return Files(name, {f"{name}.h": parts.header(), f"{name}.c": parts.source(), "main.c": parts.example()})


@dataclass(frozen=True)
class VesselParts:
    """Text of the C of a vessel."""

    vessel: Vessel
    name: str
    method: Method
    precision: Precision

    @property
    def equations(self) -> Equations:
        """Blocks of the vessel."""
        return Equations(self.vessel)

    def groups(self) -> dict[str, tuple[str, ...]]:
        """Names of the entries of each argument."""
        model = self.equations.model
        return {
            "carry": (*model.state, *model.hidden, *(f"{ACTUAL}{name}" for name in model.memory)),
            "commands": model.commands,
            "environment": model.environment,
            "loads": tuple(AXES[axis] for axis in self.vessel.axes),
            "parameters": model.parameters,
        }

    def unit(self, group: str, name: str) -> str:
        """SI unit of an entry."""
        if group == "parameters":
            return self.vessel.units[name]
        if group == "loads":
            return "N" if name in "XYZ" else "N m"
        row = row_of(column_of(name))
        return _kept_unit(name) if row is None else row.unit

    def _tables(self) -> tuple[str, str]:
        declared, defined = [], []
        for group, names in self.groups().items():
            one, other = tables_of_names(self.name, group, names, {name: self.unit(group, name) for name in names})
            declared.append(one)
            defined.append(other)
        values = self.precision.table(np.array(list(self.vessel.parameters.values())))
        count = len(self.vessel.parameters)
        declared.append(f"extern const {self.name}_real {self.name}_defaults[{max(1, count)}];")
        defined.append(array_of(f"{self.name}_real", f"{self.name}_defaults", count, values))
        return "\n".join(declared), "\n".join(defined)

    def header(self) -> str:
        """The header: names, units, order, limits, functions."""
        name, groups, guard = self.name, self.groups(), f"{self.name.upper()}_H"
        numbers = {f"NUM_{group.upper()}": len(names) for group, names in groups.items()}
        constants = ",\n    ".join(f"{name}_{key} = {value}" for key, value in numbers.items())
        declared, _ = self._tables()
        real = "float" if self.precision.single else "double"
        return f"""{
            comment(
                [
                    f"{self.vessel.name}: equations of motion in C99, written by shipid {__version__}.",
                    f"Vessel document digest {self.vessel.digest}.",
                    "",
                    "SI units, radians, revolutions per second. The state is position and heading (psi, not the course over ground),",
                    "velocities over ground in body axes; then the hidden states of terms and the positions of actuators that",
                    "lag behind their orders. Names and units of every entry, in order, are in the tables below. Directions of",
                    "wind and current are towards.",
                    "Not in this file: waves that a simulated truth draws, a screening of inputs, a helmsman.",
                    *(NEARBY if self.precision.single else []),
                    "No memory is allocated and nothing is kept between calls.",
                ]
            )
        }
#ifndef {guard}
#define {guard}

#ifdef __cplusplus
extern "C" {{
#endif

typedef {real} {name}_real;

enum {{
    {constants}
}};

/* Results of {name}_step: 0, or a sum of these. The carry is as it was unless the result is 0. */
enum {{
    {name}_NOT_FINITE = 1, /* an input is not a finite number */
    {name}_TIME = 2,       /* the step is not above 0 */
    {name}_DIVERGED = 4,   /* the state after the step is not finite, or a velocity is above {SPEED_LIMIT:g} */
    {name}_PARAMETER = 8   /* a parameter that must be above 0 is not, such as inertia.m */
}};

{declared}

/* Actuators of a carry take the positions that the commands order, within the stops of {name}_defaults. */
void {name}_begin({name}_real *carry, const {name}_real *commands);

/* d(state)/dt of {
            name
        }_NUM_CARRY less the actuators. loads: forces and moments that are added, such as waves or a tug. */
void {name}_rates(const {name}_real *carry, const {name}_real *commands, const {name}_real *environment,
                  const {name}_real *loads, const {name}_real *parameters, {name}_real *rates);

/* One step of {
            "explicit Euler" if self.method == "euler" else "classical Runge-Kutta (RK4)"
        } over dt seconds; actuators move exactly. Any dt above 0; up to a tenth of the
 * ship's shortest time constant is accurate. parameters: {name}_defaults, or a changed copy of it. */
int {name}_step({name}_real *carry, const {name}_real *commands, const {name}_real *environment,
                const {name}_real *loads, const {name}_real *parameters, {name}_real dt);

#ifdef __cplusplus
}}
#endif
#endif
"""

    def source(self) -> str:
        """Text of the C file: functions of the blocks, and the functions of the header."""
        name, equations, groups = self.name, self.equations, self.groups()
        model, n = equations.model, equations.num_carry
        step = equations.step(self.method)
        begun = equations.begun()
        blocks: list[Block] = [equations.rates, step, *([begun] if model.memory else [])]
        text, call = c_functions(blocks, self.precision)
        sizes_ = {group: len(names) for group, names in groups.items()}
        arguments = {
            "carry": "carry",
            "commands": "commands",
            "environment": "environment",
            "tau_extra": "loads",
            "parameters": "parameters",
            "dt": "&dt",
            "state": "carry",
            "memory": f"carry + {equations.num_states}",
        }

        def given(block: Block, *out: str) -> str:
            return ", ".join([*(arguments[key] for key, size in block.inputs if size), *out])

        checks = "\n".join(
            f"    for (i = 0; i < {size}; ++i) if (!isfinite({group}[i])) return {name}_NOT_FINITE;"
            for group, size in sizes_.items()
            if size
        )
        above_zero, refused = refusals(groups["parameters"], self.vessel, f"{name}_PARAMETER") or ("", "")
        speeds = range(model.num_dof, 2 * model.num_dof)
        idle = [key for key in ("commands", "environment", "parameters") if not sizes_[key]]
        voids = "".join(f"    (void){key};\n" for key in idle)
        begin = (
            f"    {call[id(begun)]}({given(begun, f'carry + {equations.num_states}')});"
            if model.memory
            else "    (void)carry;\n    (void)commands;\n    (void)parameters;"
        )
        return f"""{comment([f"{self.vessel.name}, written by shipid {__version__}; see {name}.h."])}
{source_head(name, self.precision)}
{self._tables()[1]}

{text}
static void begin_within(real *carry, const real *commands, const real *parameters)
{{
{begin}
}}

void {name}_begin({name}_real *carry, const {name}_real *commands)
{{
    begin_within(carry, commands, {name}_defaults);
}}

void {name}_rates(const {name}_real *carry, const {name}_real *commands, const {name}_real *environment,
                  const {name}_real *loads, const {name}_real *parameters, {name}_real *rates)
{{
{voids}    {call[id(equations.rates)]}({given(equations.rates, "rates")});
}}

int {name}_step({name}_real *carry, const {name}_real *commands, const {name}_real *environment,
                const {name}_real *loads, const {name}_real *parameters, {name}_real dt)
{{
    {above_zero}
    real after[{n}];
    int i;
{voids}{checks}
    {refused}
    if (!isfinite(dt)) return {name}_NOT_FINITE;
    if (!(dt > 0)) return {name}_TIME;
    {call[id(step)]}({given(step, "after")});
    for (i = 0; i < {n}; ++i) if (!isfinite(after[i])) return {name}_DIVERGED;
    for (i = {speeds.start}; i < {speeds.stop}; ++i) if (!(M(fabs)(after[i]) <= {SPEED_LIMIT:g})) return {name}_DIVERGED;
    memcpy(carry, after, sizeof after);
    return 0;
}}
"""

    def example(self) -> str:
        """An example: a minute with the helm over."""
        name, groups = self.name, self.groups()
        orders = []
        for command in groups["commands"]:
            row = SIGNALS[signal_of(command)]
            usual = np.deg2rad(10) if row.turns else row.usual[0] + 0.5 * (row.usual[1] - row.usual[0])
            orders.append(self.precision.number(usual))
        speed = groups["carry"].index("u")
        return f"""/* A minute of {self.name} with the helm over. cc -std=c99 main.c {name}.c -lm */
#include <stdio.h>

#include "{name}.h"

int main(void)
{{
    {name}_real carry[{name}_NUM_CARRY] = {{0}};
    const {name}_real commands[{max(1, len(orders))}] = {{{", ".join(orders) or "0"}}};
    const {name}_real environment[{max(1, len(groups["environment"]))}] = {{0}};
    const {name}_real loads[{name}_NUM_LOADS] = {{0}};
    int i, status = 0;
    carry[{speed}] = 1; /* {groups["carry"][speed]} */
    {name}_begin(carry, commands);
    for (i = 0; i < 600 && status == 0; ++i)
        status = {name}_step(carry, commands, environment, loads, {name}_defaults, {self.precision.number(0.1)});
    for (i = 0; i < {name}_NUM_CARRY; ++i)
        printf("%s %.6g %s\\n", {name}_carry_names[i], (double)carry[i], {name}_carry_units[i]);
    return status;
}}
"""


def _kept_unit(name: str) -> str:
    """Unit of a state that a term keeps: the time of waves, or what the velocity that drives a mode adds up to."""
    state = signal_of(name)
    return "s" if state == "t" else SIGNALS[state[0]].unit.removesuffix("/s")
