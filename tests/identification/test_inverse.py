"""Inverse dynamics: simulated forces are recovered, whatever they are made of."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DataError
from shipid.identification.collinearity import collinear_sets
from shipid.identification.inverse import _Problem, _solve_weighted, inverse_dynamics
from shipid.simulation.truth import Truth, simulate_truth
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel
from tests.conftest import variety

SHIP = load_vessel("gunnerus-28.9")
MAIN = tuple(f"hull.derivatives.{name}" for name in ("X_u|u|", "X_rv", "Y_ur", "Y_rrr", "N_ur", "N_rrr", "N_r|r|"))
MASS = ("inertia.m", "added_mass.Y_vdot", "added_mass.N_rdot")
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


def test_derivatives_are_recovered() -> None:
    base = wrong(MAIN)
    estimate = inverse_dynamics(base, LOG, LOG.runs, [[path] for path in MAIN])
    assert estimate.linear.all()
    assert estimate.settled
    assert max(estimate.levels.values()) < 1e-3
    np.testing.assert_allclose(estimate.factors, truth(base, MAIN), rtol=2e-3)


def test_inertia_is_linear_too() -> None:
    """M multiplies out: mass and added mass next to derivatives."""
    base = wrong(MAIN + MASS, 0.9, 1.1)
    estimate = inverse_dynamics(base, LOG, LOG.runs, [[path] for path in MAIN + MASS])
    assert estimate.linear.all()
    np.testing.assert_allclose(estimate.factors, truth(base, MAIN + MASS), rtol=1e-2)


def test_a_diameter_is_not_linear_and_needs_iterations() -> None:
    """Both propellers share one factor; thrust goes with its fourth power and more."""
    base = wrong((*MAIN, *D_P[0])).with_values(dict.fromkeys(D_P[0], 1.9 / 1.15))
    estimate = inverse_dynamics(base, LOG, LOG.runs, [*([path] for path in MAIN), *D_P])
    assert estimate.linear.tolist() == [True] * len(MAIN) + [False]
    assert estimate.paths[-1] == D_P[0][0]
    np.testing.assert_allclose(estimate.factors, [*truth(base, MAIN), 1.15], rtol=5e-3)


def test_a_derivative_that_the_base_lacks_needs_a_scale() -> None:
    base = SHIP.with_values({"hull.derivatives.N_ur": 0.0})
    estimate = inverse_dynamics(base, LOG, LOG.runs, [["hull.derivatives.N_ur"]], scale=[[-1e6]])
    assert estimate.factors[0] * -1e6 == pytest.approx(SHIP.parameters["hull.derivatives.N_ur"], rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gunnerus-33.9", "kvlcc2-l7", "actuators", "six"])
def test_every_structure_is_recovered(name: str) -> None:
    """Its greatest forces: the first three hull parameters that data see best."""
    vessel = variety()[name]
    small = name == "kvlcc2-l7"
    speeds = {"n_rpm": (300.0, 700.0), "start_speed": (0.6, 1.2)} if small else {"start_speed": (3.0, 7.0)}
    log = log_of(vessel, alpha_deg=(-30, 30), **speeds)  # type: ignore[arg-type]
    paths = tuple(path for path in vessel.parameters if path.startswith("hull."))
    seen = np.linalg.norm(inverse_dynamics(vessel, log, log.runs, [[path] for path in paths]).jacobian, axis=0)
    main = tuple(paths[j] for j in np.argsort(-seen)[:3])
    base = wrong(main, 0.8, 1.2, vessel)
    estimate = inverse_dynamics(base, log, log.runs, [[path] for path in main])
    np.testing.assert_allclose(estimate.factors, truth(base, main, vessel), rtol=2e-2)


def test_orders_that_jump_within_a_bump_do_no_harm() -> None:
    """The helm goes over in the middle of a run: forces jump, and the integral has the jump where it is."""
    from shipid.simulation.manoeuvre import TurningCircle
    from shipid.simulation.perform import perform_manoeuvres

    circle = TurningCircle(n_rpm=150, duration=80, execute_at=30)
    log = Dataset(perform_manoeuvres(SHIP, [circle], step=0.05, interval=0.2), {})
    base = wrong(MAIN)
    estimate = inverse_dynamics(base, log, log.runs, [["hull.derivatives.N_ur"]])
    exact = inverse_dynamics(SHIP, log, log.runs, [["hull.derivatives.N_ur"]])
    assert exact.factors[0] == pytest.approx(1, abs=1e-3)
    assert abs(estimate.factors[0] - 1) > 0.01  # what the others lack goes somewhere


def test_what_data_do_not_see_stays_at_the_base_and_priors_hold() -> None:
    still = ["wind.A_FW"]  # no wind in these runs but that of the ship's motion
    low = Dataset(LOG.frame.assign(V_w=0.0), LOG.metadata)
    free = inverse_dynamics(SHIP, low, low.runs, [["hull.derivatives.N_ur"], ["thruster.port.k_over2"]])
    assert free.factors[1] == pytest.approx(1)
    base = SHIP.with_values({"hull.derivatives.N_ur": -2e6})
    tight = inverse_dynamics(base, low, low.runs, [["hull.derivatives.N_ur"], still], prior=np.array([1e-9, 1e-9]))
    np.testing.assert_allclose(tight.factors, 1, atol=1e-6)


def noisy(seed: int, level: float = 0.02) -> Dataset:
    rng, frame = np.random.default_rng(seed), LOG.frame.copy()
    for name, size in {"u": level, "v": level, "r": 0.1 * level, "psi": 0.002, "north": 0.3, "east": 0.3}.items():
        frame[name] = frame[name] + rng.normal(0, size, len(frame))
    return Dataset(frame, LOG.metadata)


def test_noise_is_averaged_not_differentiated() -> None:
    """0.02 m/s at 5 Hz would be an acceleration noise of 0.14 m/s^2; each equation errs by a twentieth of that."""
    log = noisy(0)
    estimate = inverse_dynamics(SHIP, log, log.runs, [[path] for path in MAIN])
    assert estimate.levels["u"] < 0.007


def test_wind_may_be_given_for_a_run_instead_of_its_columns() -> None:
    some = LOG.runs[:3]
    bare = Dataset(LOG.frame.drop(columns=["V_w", "beta_w"]), LOG.metadata)
    felt = {
        str(run): {name: float(rows[name].iloc[0]) for name in ("V_w", "beta_w")}
        for run, rows in LOG.frame.groupby("run")
    }
    groups = [["wind.A_LW"], ["hull.derivatives.N_ur"]]
    logged = inverse_dynamics(SHIP, LOG, some, groups)
    given = inverse_dynamics(SHIP, bare, some, groups, environment=felt)
    np.testing.assert_allclose(given.factors, logged.factors, rtol=1e-9)
    assert inverse_dynamics(SHIP, bare, some, groups).factors[1] != pytest.approx(logged.factors[1], rel=1e-4)


def test_a_start_can_be_simulated() -> None:
    """Y_v|r| and Y_r|v| do the same: with noise they would run away from each other by hundreds of base values."""
    pair = [["hull.derivatives.Y_v|r|"], ["hull.derivatives.Y_r|v|"]]
    estimate = inverse_dynamics(SHIP, noisy(1, 0.1), LOG.runs, pair)
    assert np.abs(estimate.factors - 1).max() < 2
    assert collinear_sets(estimate.jacobian, estimate.paths)


def test_order_of_groups_and_rows_of_other_runs_are_of_no_account() -> None:
    some = LOG.runs[:5]
    one = inverse_dynamics(wrong(MAIN), LOG, some, [[path] for path in MAIN])
    only = Dataset(LOG.frame[LOG.frame["run"].isin(some)].reset_index(drop=True), LOG.metadata)
    other = inverse_dynamics(wrong(MAIN), only, some[::-1], [[path] for path in MAIN[::-1]])
    np.testing.assert_allclose(one.factors, other.factors[::-1], rtol=1e-6)


def test_mistakes_are_reported() -> None:
    with pytest.raises(DataError, match="no run 'M999'"):
        inverse_dynamics(SHIP, LOG, ["M999"], [[MAIN[0]]])
    without = Dataset(LOG.frame.drop(columns="port.n"), LOG.metadata)
    with pytest.raises(DataError, match=r"port\.n"):
        inverse_dynamics(SHIP, without, LOG.runs, [[MAIN[0]]])
    short = Dataset(pd.DataFrame(LOG.frame.groupby("run").head(4)), LOG.metadata)
    with pytest.raises(DataError, match="longer"):
        inverse_dynamics(SHIP, short, LOG.runs, [[MAIN[0]]])


class Bent(_Problem):
    """One residual, arctan(100 (f - 0.5)) with a constant beside it; steps of a tangent are far too long."""

    signals = ("u",)

    def __init__(self, slope: float) -> None:
        self.slope = slope  # of the derivative that it says, over the true one

    def evaluate(self, factors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        bend = 100.0 * (factors[0] - 0.5)
        return np.array([np.arctan(bend), 1.0]), np.array([[self.slope * 100.0 / (1.0 + bend**2)], [0.0]])

    def levels(self, residual: np.ndarray) -> dict[str, float]:
        return {"u": float(np.sqrt(np.mean(residual**2)))}


@pytest.mark.parametrize("slope", [1.0, -1.0])
def test_a_step_that_lowers_nothing_is_not_taken(slope: float) -> None:
    """The last of the halved steps was taken, whatever it did to the cost."""
    problem, centre = Bent(slope), np.array([0.51])
    factors, _, settled = _solve_weighted(problem, centre, np.array([1.0]), linear=False)
    before, after = (float(np.sum(problem.evaluate(one)[0] ** 2)) for one in (centre, factors))
    assert after <= before
    assert settled == (slope > 0)
    if slope < 0:
        np.testing.assert_array_equal(factors, centre)
