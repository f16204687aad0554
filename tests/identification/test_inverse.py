"""Inverse dynamics: simulated forces are recovered, whatever they are made of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DataError
from shipid.identification.inverse import inverse_dynamics
from shipid.simulation.truth import Truth, simulate_truth
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel

SHIP = load_vessel("gunnerus-28.9")
MAIN = tuple(f"hull.derivatives.{name}" for name in ("X_u|u|", "X_rv", "Y_ur", "Y_rrr", "N_ur", "N_rrr", "N_r|r|"))
D_P = [("thruster.port.D_p", "thruster.starboard.D_p")]


def log_of(vessel: Vessel = SHIP, interval: float = 0.2, **more: object) -> Dataset:
    orders = {"n_rpm": (50, 200), "alpha_deg": (-50, 50), "start_speed": (1, 4)}
    block = orders | {key: more.pop(key) for key in orders if key in more}
    if "rudder.delta" in vessel_dynamics(vessel).commands:
        block["delta_deg"] = block.pop("alpha_deg")
    given = {"vessel": vessel.key, "manoeuvres": 8, "duration": 60, "step": 0.05, "manoeuvre": [block], **more}
    return Dataset(simulate_truth(Truth(interval=interval, **given), vessel), {})  # type: ignore[arg-type]


LOG = log_of()


def wrong(paths: tuple[str, ...], low: float = 0.7, high: float = 1.3, vessel: Vessel = SHIP) -> Vessel:
    """The ship with other values at these paths."""
    factors = np.random.default_rng(0).uniform(low, high, len(paths))
    return vessel.with_values({path: vessel.parameters[path] / k for path, k in zip(paths, factors, strict=True)})


def truth(base: Vessel, paths: tuple[str, ...], vessel: Vessel = SHIP) -> np.ndarray:
    return np.array([vessel.parameters[path] / base.parameters[path] for path in paths])


def estimated(
    vessel: Vessel,
    log: Dataset,
    groups: Sequence[Sequence[str]],
    sizes: Sequence[float] | None = None,
    prior: float = np.inf,
) -> tuple[np.ndarray, dict[str, float]]:
    """Factors and levels; sizes : value at factor 1 of every group."""
    values = (
        [[vessel.parameters[path] for path in group] for group in groups] if sizes is None else [[x] for x in sizes]
    )
    return inverse_dynamics(vessel, log, log.runs, groups, values, np.full(len(groups), prior), {})


def test_derivatives_are_recovered() -> None:
    base = wrong(MAIN)
    factors, levels = estimated(base, LOG, [[path] for path in MAIN])
    assert max(levels.values()) < 1e-3
    np.testing.assert_allclose(factors, truth(base, MAIN), rtol=2e-3)


def test_a_diameter_is_not_linear_and_needs_iterations() -> None:
    """Both propellers share one factor; thrust goes with its fourth power and more."""
    base = wrong((*MAIN, *D_P[0])).with_values(dict.fromkeys(D_P[0], 1.9 / 1.15))
    factors, _ = estimated(base, LOG, [*([path] for path in MAIN), *D_P])
    np.testing.assert_allclose(factors, [*truth(base, MAIN), 1.15], rtol=5e-3)


def test_a_derivative_that_the_base_lacks_needs_a_scale() -> None:
    base = SHIP.with_values({"hull.derivatives.N_ur": 0.0})
    factors, _ = estimated(base, LOG, [["hull.derivatives.N_ur"]], [-1e6])
    assert factors[0] * -1e6 == pytest.approx(SHIP.parameters["hull.derivatives.N_ur"], rel=1e-3)


def test_what_data_do_not_see_stays_at_the_base_and_priors_hold() -> None:
    still = ["wind.A_FW"]  # no wind in these runs but that of the ship's motion
    low = Dataset(LOG.frame.assign(V_w=0.0), LOG.metadata)
    free, _ = estimated(SHIP, low, [["hull.derivatives.N_ur"], ["thruster.port.k_over2"]])
    assert free[1] == pytest.approx(1)
    base = SHIP.with_values({"hull.derivatives.N_ur": -2e6})
    tight, _ = estimated(base, low, [["hull.derivatives.N_ur"], still], prior=1e-9)
    np.testing.assert_allclose(tight, 1, atol=1e-6)


def noisy(seed: int, level: float = 0.02) -> Dataset:
    rng, frame = np.random.default_rng(seed), LOG.frame.copy()
    for name, size in {"u": level, "v": level, "r": 0.1 * level, "psi": 0.002, "north": 0.3, "east": 0.3}.items():
        frame[name] = frame[name] + rng.normal(0, size, len(frame))
    return Dataset(frame, LOG.metadata)


def test_noise_is_averaged_not_differentiated() -> None:
    """0.02 m/s at 5 Hz would be an acceleration noise of 0.14 m/s^2; each equation errs by a twentieth of that."""
    _, levels = estimated(SHIP, noisy(0), [[path] for path in MAIN])
    assert levels["u"] < 0.007


def test_a_start_can_be_simulated() -> None:
    """Y_v|r| and Y_r|v| do the same: with noise they would run away from each other by hundreds of base values."""
    pair = [["hull.derivatives.Y_v|r|"], ["hull.derivatives.Y_r|v|"]]
    factors, _ = estimated(SHIP, noisy(1, 0.1), pair)
    assert np.abs(factors - 1).max() < 2


def test_runs_too_short_are_reported() -> None:
    short = Dataset(pd.DataFrame(LOG.frame.groupby("run").head(4)), LOG.metadata)
    with pytest.raises(DataError, match="longer"):
        estimated(SHIP, short, [[MAIN[0]]])
