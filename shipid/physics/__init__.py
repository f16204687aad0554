"""Every force on a ship as a pure CasADi function of symbols.

The signature of a function is the schema of its block. Positional arguments are signals. Keyword-only arguments are
parameters with their unit. A `**` table is open and checked by its grammar. To add a term: write the function and name
it here. To add a signal: add one row to `signals.SIGNALS`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from shipid.physics import hull, learned, propeller, radiation, restoring, rudder, thruster, waves, wind
from shipid.physics.signals import SIGNALS
from shipid.plugins import Registry, fault_of_kind


@dataclass(frozen=True)
class Term:
    """One term of the sum of forces.

    function : signals (and component arrays) in, wrench (6) [N, N m] out.
    components : of a sum, structural keys -> one array per component argument; `function` is of one component.
    drawn : of a sum over inputs of a rollout (random waves), structural keys -> width of each component argument.
    states : of a term with own states, its block -> their names; functions take them as the signal `state`.
    rates : d(state)/dt from signals.
    gives : signal -> function of signals: one of `GIVEN` for a term that is `behind` this one, or an output (`thrust`)
        that a log may have as `<component>.thrust`; None where the block lacks its parameters.

    The parameters of a block are those of `function`, `gives` and `rates` together; each takes those that it declares.
    """

    function: Callable[..., Any]
    components: Callable[..., Mapping[str, Any]] | None = None
    drawn: Callable[..., Mapping[str, int]] | None = None
    states: Callable[[Mapping[str, Any]], tuple[str, ...]] | None = None
    rates: Callable[..., Any] | None = None
    gives: Mapping[str, Callable[..., Any]] = field(default_factory=dict, hash=False)

    @property
    def functions(self) -> tuple[Callable[..., Any], ...]:
        """Every function that the term holds."""
        every = (self.function, self.components, self.drawn, self.states, self.rates, *self.gives.values())
        return tuple(one for one in every if one is not None)


@dataclass(frozen=True)
class ActuatorModel:
    """An actuator model: `output(state)` replaces the command, `advance(command, state, dt)` gives the next state.

    Its parameters are those of `advance`; `output` may take some of them.
    """

    output: Callable[..., Any]
    advance: Callable[..., Any]

    @property
    def functions(self) -> tuple[Callable[..., Any], ...]:
        """Both functions."""
        return self.output, self.advance


MOTION = ("eta", "nu", "nu_r", "psi", "state")
"""Positional arguments that every term may have, besides the commands and environment of `signals.SIGNALS`."""
GIVEN = ("wash",)
"""Positional arguments that another component provides: the one named by the key `behind` of the block."""


def fault_of_term(term: Any) -> str:
    """What an object lacks to be a term, one sentence; the signals that a term takes are loaded."""
    fault = fault_of_kind(Term, term)
    for function in () if fault else filter(callable, term.functions):
        for name in inspect.signature(function).parameters:
            SIGNALS.get(name)
    return fault


TERMS: Registry[Term] = Registry("shipid.terms", fault_of_term)
TERMS |= {
    "hull.derivatives": Term(hull.derivatives_wrench),
    "hull.prime_derivatives": Term(hull.prime_derivatives),
    "hull.bis_derivatives": Term(hull.bis_derivatives),
    "hull.mmg": Term(hull.mmg_wrench),
    "hull.abkowitz": Term(hull.abkowitz_wrench),
    "hull.crossflow": Term(hull.cross_flow, components=hull.hull_strips),
    "hull.resistance": Term(hull.resistance_wrench),
    "hull.learned": Term(learned.learned_wrench),
    "restoring.hydrostatic": Term(restoring.hydrostatic),
    "radiation.heave_pitch": Term(
        radiation.heave_pitch, states=radiation.heave_pitch_states, rates=radiation.heave_pitch_rates
    ),
    "radiation.roll": Term(radiation.roll, states=radiation.roll_states, rates=radiation.roll_rates),
    "waves.first_order": Term(
        waves.first_order, drawn=waves.first_order_widths, states=waves.passage_states, rates=waves.passage_rates
    ),
    "waves.drift": Term(waves.drift_wrench, drawn=waves.drift_widths),
    "wind.table": Term(wind.wind_table_wrench),
    "wind.blendermann": Term(wind.blendermann_wrench),
    "thruster.azimuth": Term(thruster.azimuth_wrench, gives={"thrust": thruster.azimuth_thrust}),
    "thruster.tunnel": Term(thruster.tunnel_wrench, gives={"side_force": thruster.tunnel_side_force}),
    "thruster.force": Term(thruster.force_wrench, gives={"thrust": thruster.swivel_thrust}),
    "thruster.swivel_force": Term(thruster.swivel_force_wrench, gives={"thrust": thruster.swivel_thrust}),
    "thruster.propeller": Term(
        propeller.propeller_wrench,
        gives={
            "wash": propeller.propeller_wash,
            "thrust": propeller.shaft_thrust(propeller.propeller_wrench),
            "torque": propeller.propeller_torque,
        },
    ),
    "thruster.controllable_pitch": Term(
        propeller.controllable_pitch,
        gives={"wash": propeller.controllable_wash, "thrust": propeller.shaft_thrust(propeller.controllable_pitch)},
    ),
    "thruster.four_quadrant": Term(
        propeller.four_quadrant,
        gives={"wash": propeller.four_quadrant_wash, "thrust": propeller.shaft_thrust(propeller.four_quadrant)},
    ),
    "thruster.quadratic": Term(
        propeller.quadratic_propeller_wrench,
        gives={
            "wash": propeller.quadratic_wash,
            "thrust": propeller.shaft_thrust(propeller.quadratic_propeller_wrench),
        },
    ),
    "thruster.service_speed": Term(propeller.service_speed_wrench),
    "thruster.rudder": Term(rudder.rudder_wrench, gives={"normal_force": rudder.normal_force}),
    "thruster.rudder_polynomial": Term(
        rudder.rudder_polynomial, gives={"normal_force": rudder.polynomial_normal_force}
    ),
    "thruster.rudder_coefficients": Term(
        rudder.rudder_coefficients, gives={"normal_force": rudder.coefficients_normal_force}
    ),
    "thruster.rudder_derivatives": Term(rudder.rudder_derivatives),
}

ACTUATORS: dict[str, ActuatorModel] = {
    "first_order": ActuatorModel(thruster.bounded_output, thruster.first_order_advance),
    "rate_limit": ActuatorModel(thruster.bounded_output, thruster.rate_limit_advance),
}
