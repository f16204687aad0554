"""Vessels of public simulators against their published equations, written out apart: `tests/vessel/published`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.vessel.published import container, cybership2, naval, otter, supply, tanker

RPM, RADIAN = 1 / 60, 1 / (2 * math.pi)  # rev/s
STATES = 200


@dataclass(frozen=True)
class Published:
    """A bundled vessel and its published equations.

    orders : order of the vessel -> name in the source, and its factor; commands without one are at 0.
    """

    source: ModuleType
    orders: Mapping[str, tuple[str, float]] = field(default_factory=dict)


VESSELS = {
    "supply-vessel": Published(
        supply,
        {"bow.n": ("n1", RPM), "bow_aft.n": ("n2", RPM), "starboard.n": ("n3", RPM), "port.n": ("n4", RPM)},
    ),
    "esso-190k": Published(tanker, {"propeller.n": ("rpm", RPM), "rudder.delta": ("delta", -1.0)}),
    "container-175": Published(container, {"propeller.n": ("rpm", RPM), "rudder.delta": ("delta", 1.0)}),
    "naval-51": Published(naval),
    "otter": Published(otter, {"port.n": ("n1", RADIAN), "starboard.n": ("n2", RADIAN)}),
    "cybership2": Published(
        cybership2,
        {
            **{"port.n": ("n1", 1.0), "starboard.n": ("n2", 1.0), "bow.n": ("n3", 1.0)},
            **{"port_rudder.delta": ("d1", -1.0), "starboard_rudder.delta": ("d2", -1.0)},
        },
    ),
}


def drawn(source: ModuleType, count: int) -> list[dict[str, float]]:
    """Velocities, heel and orders by seed, where the source is defined; one in ten is at zero."""
    rng = np.random.default_rng(20)
    in_domain = getattr(source, "in_domain", lambda **_: True)
    result: list[dict[str, float]] = []
    while len(result) < count:
        one = {name: float(rng.uniform(*limits)) for name, limits in source.DRAWN.items()}
        one |= {name: 0.0 for name, (low, high) in source.DRAWN.items() if low <= 0 <= high and rng.uniform() < 0.1}
        if in_domain(**one):
            result.append(one)
    return result


@pytest.mark.parametrize("name", VESSELS)
def test_accelerations_are_those_of_the_published_equations(name: str) -> None:
    """To 1e-9 at 200 states and orders, all actuators at their orders; 1e-12 of the largest of an axis is rounding."""
    published, vessel = VESSELS[name], load_vessel(name)
    model, values = vessel_dynamics(vessel), list(vessel.parameters.values())
    axes = model.state[model.num_dof :]
    computed, expected = [], []
    for given in drawn(published.source, STATES):
        orders: dict[str, Any] = dict.fromkeys(model.commands, 0.0)
        orders |= {order: given[source] * factor for order, (source, factor) in published.orders.items()}
        state = [given.get(entry, 0.0) for entry in model.state]
        tau = [given.get(force, 0.0) for force in (("X", "Y", "K", "N") if "p" in axes else ("X", "Y", "N"))]
        memory = [orders[entry] for entry in model.memory]
        rates = model.rates(state, memory, list(orders.values()), [0.0] * len(model.environment), values, tau)
        computed.append(np.array(rates).ravel()[model.num_dof :])
        expected.append(published.source.accelerations(**given))
    for axis, here, there in zip(axes, np.array(computed).T, np.array(expected).T, strict=True):
        np.testing.assert_allclose(here, there, rtol=1e-9, atol=1e-12 * np.abs(there).max(), err_msg=axis)
