"""Measured outputs beside those that a vessel predicts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.data.outputs import outputs_in_common, predicted_outputs
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from shipid.simulation.manoeuvre import Excitation
from shipid.simulation.perform import perform_manoeuvres
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel

SHIPS = {"kvlcc2-l7": 600.0, "gunnerus-28.9-6dof": 150.0, "container-175": 100.0, "cybership2": 900.0}
OPEN_WATER = {"1": 0.03668, "J": -0.01298, "JJ": -0.02347}  # K_Q of HSVA's model, parabola up to J = 0.9


def log_of(ship: Vessel, n_rpm: float) -> Dataset:
    """Two runs of random orders, with all outputs."""
    runs = [
        Excitation(
            name=name,
            angle_deg=10.0,
            n_rpm=n_rpm,
            amplitude_rpm=0.2 * n_rpm,
            duration=30.0,
            hold=(5.0, 9.0),
            seed=seed,
        )
        for seed, name in enumerate("ab")
    ]
    frame = perform_manoeuvres(ship, runs, step=0.5, outputs=list(vessel_dynamics(ship).outputs))
    frame = frame[[name for name in frame if not str(name).startswith("actual.")]]
    return Dataset(frame, {"clock": "run", "flags": []})


@pytest.mark.parametrize("name", SHIPS)
def test_a_vessel_predicts_what_was_simulated_on_it(name: str) -> None:
    """Beyond the first seconds, in which the log does not say where shaft and rudder were."""
    ship = load_vessel(name)
    log = log_of(ship, SHIPS[name])
    found, names = predicted_outputs(ship, log), outputs_in_common(ship, log)
    assert list(found.columns) == ["run", "t", *names]
    assert names
    assert names == list(vessel_dynamics(ship).outputs)
    late = (log.frame["t"] > 15).to_numpy()
    for output in names:
        true = log.frame[output].to_numpy()[late]
        np.testing.assert_allclose(found[output][late], true, atol=0.02 * np.abs(true).max())


def test_hsva_measured_what_the_open_water_curve_predicts(shared_data: Path, tmp_path: Path) -> None:
    """Thrust and torque of the free tank model, against her open-water curve, with a published wake."""
    text = Path("studies/mappings/kvlcc2-hsva.toml").read_text("utf-8")
    kept = [line for line in text.splitlines() if not line.startswith(("sha256", "url"))]
    more = [
        f'[columns."propeller.{name}"]\nfrom = "{name}"\nunit = "{unit}"'
        for name, unit in (("thrust", "N"), ("torque", "Nm"))
    ]
    file = tmp_path / "hsva.toml"
    file.write_text("\n".join(kept + more).replace('Z_*.dat"', 'Z_35*.dat"'), "utf-8")
    log = import_log(read_mapping(file), shared_data / "kvlcc2_hsva")
    ship = load_vessel("kvlcc2-hsva").with_values({"thruster.propeller.K_Q": OPEN_WATER})
    found = predicted_outputs(ship, log)
    for name, scale in (("propeller.thrust", 1.078), ("propeller.torque", 1.014)):
        y, f = log.frame[name].to_numpy(), found[name].to_numpy()
        assert f @ y / (f @ f) == pytest.approx(scale, abs=0.002)
    straight = log.frame[pd.Series(log.frame["t"] < 1.0)]
    K_T = straight["propeller.thrust"].mean() / (1000 * 10.2295**2 * 0.204**4)
    assert pytest.approx(0.229, abs=0.01) == K_T  # J = 0.36 in her open-water curve: a wake of 0.36, published 0.40
