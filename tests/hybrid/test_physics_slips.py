"""The physics of a predictor: its gradient is that of its paths, in moving water too."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.windows import Instants
from shipid.hybrid.physics import Physics
from shipid.observer import MEASURED, Observer
from shipid.vessel.load import load_vessel

SHIP = load_vessel("gunnerus-28.9")
NAME = "hull.derivatives.X_u|u|"


def instants(count: int = 4) -> Instants:
    """Instants anywhere on the chart, with what an observer knows: another filtered state, forces and a current."""
    rng = np.random.default_rng(7)
    spread = {"north": 50.0, "east": 50.0, "psi": 2.0, "u": 0.3, "v": 0.1, "r": 0.01}
    columns = {name: rng.normal(0.0, width, count) for name, width in spread.items()}
    columns["u"] += 3.0
    columns |= {f"{side}.n": rng.uniform(1.0, 3.0, count) for side in ("port", "starboard")}
    columns |= {f"{side}.alpha": rng.uniform(-0.3, 0.3, count) for side in ("port", "starboard")}
    known = {f"observer.{name}": columns[name] + 0.01 * rng.normal(size=count) for name in MEASURED}
    known |= {f"observer.{name}": 1e-3 * rng.normal(size=count) for name in "XYN"}
    known |= {f"observer.current_{name}": rng.uniform(0.2, 0.5, count) for name in ("north", "east")}
    return Instants(columns, estimates=known)


@pytest.mark.parametrize("observer", [None, Observer()])
def test_the_error_of_a_gradient_is_that_of_the_paths(observer: Observer | None) -> None:
    physics, here = Physics(SHIP, 6, 1.0, "euler", observer), instants()
    future = physics.paths(here) + np.random.default_rng(1).normal(size=(6, len(here), 2))
    value, slope = physics.gradient(here, future, [NAME])
    assert value == pytest.approx(np.square(physics.paths(here) - future).sum(axis=-1).mean(), rel=1e-9)
    number, step = SHIP.parameters[NAME], 1e-4 * SHIP.parameters[NAME]
    moved = [physics.with_values({NAME: number + sign * step}).gradient(here, future, [])[0] for sign in (1, -1)]
    assert slope[0] == pytest.approx((moved[0] - moved[1]) / (2 * step), rel=1e-5)


def test_water_and_air_that_move_together_carry_the_path_along() -> None:
    """Heading north in still water and air, or in a stream to the east with its air: the stream's way apart."""
    here, zero = instants(1), np.zeros(1)
    still = {f"observer.{name}": zero for name in ("psi", "v", "X", "Y", "N", "current_north", "current_east")}
    still = {**here.estimates, **still}
    stream = {**still, "observer.current_east": zero + 0.4, "observer.v": zero + 0.4}
    calm = {**here.columns, "psi": zero, "V_w": zero, "beta_w": zero}
    windy = {**calm, "V_w": zero + 0.4, "beta_w": zero + np.pi / 2}
    physics = Physics(SHIP, 6, 1.0, "euler", Observer())
    one = physics.paths(Instants(calm, estimates=still))
    other = physics.paths(Instants(windy, estimates=stream))
    np.testing.assert_allclose((other - one)[:, 0], 0.4 * np.arange(1, 7)[:, None] * [0.0, 1.0], atol=1e-9)
