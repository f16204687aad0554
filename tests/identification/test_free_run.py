"""Free runs: a vessel reproduces its simulated log, pieces begin at measured states, errors are root mean squares."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DataError
from shipid.identification.free_run import ALL, MEASURED, missing_inputs, simulate_free_runs
from shipid.identification.settings import Identify
from shipid.vessel.load import load_vessel
from tests.conftest import variety
from tests.identification.trials import trials

SHIP = load_vessel("gunnerus-28.9")
OTHER = SHIP.with_values({"hull.derivatives.N_ur": 1.2 * SHIP.parameters["hull.derivatives.N_ur"]})
DATA = trials(SHIP, runs=2, steps=30)
SETTINGS = Identify(parameters=["hull.derivatives.N_ur"])


def test_the_simulating_vessel_reproduces_its_log() -> None:
    errors = simulate_free_runs({"true": SHIP}, DATA, DATA.runs, SETTINGS).errors
    assert errors["run"].tolist() == [ALL, *DATA.runs]
    assert errors["samples"].tolist() == [60, 30, 30]
    assert errors[["u", "v", "r", "position"]].to_numpy().max() < 1e-9


def test_a_piece_begins_where_the_actuators_are() -> None:
    """Rudders and shafts that lag are in motion where a piece begins; the log holds their orders."""
    ship = variety()["actuators"]
    data = trials(ship, runs=2, steps=30)
    errors = simulate_free_runs({"true": ship}, data, data.runs, SETTINGS, length=7.0).errors
    assert errors[["u", "v", "r", "position"]].to_numpy().max() < 1e-6


def test_a_ship_that_heels_reproduces_her_horizontal_log() -> None:
    """A log's u, v and r are horizontal, the states of a ship with 4 degrees of freedom are along her own axes."""
    ship = variety()["roll"]
    data = trials(ship, runs=2, steps=30)
    assert np.abs(data.frame["phi"]).max() > 0.02
    errors = simulate_free_runs({"true": ship}, data, data.runs, SETTINGS, length=7.0).errors
    assert errors[["u", "v", "r", "position"]].to_numpy().max() < 1e-9


def test_errors_are_root_mean_squares_of_the_series() -> None:
    result = simulate_free_runs({"other": OTHER}, DATA, DATA.runs, SETTINGS)
    log, other = (result.series[result.series["model"] == name].set_index(["run", "t"]) for name in (MEASURED, "other"))
    away = other.select_dtypes(float) - log.select_dtypes(float)
    away["position"] = np.hypot(away["north"], away["east"])
    away = away[away.index.get_level_values("t") > 0]
    assert np.abs(away["u"]).max() > 1e-4
    errors = result.errors.set_index("run")
    for name in ("u", "v", "r", "position"):
        squares = away[name] ** 2
        assert errors[name][ALL] == pytest.approx(np.sqrt(squares.mean()))
        for run in DATA.runs:
            assert errors[name][run] == pytest.approx(np.sqrt(squares[run].mean()))
    assert errors["u"][DATA.runs[0]] != errors["u"][DATA.runs[1]]


def test_a_piece_shorter_than_two_steps_is_refused() -> None:
    with pytest.raises(DataError, match="must hold two steps of 1 s"):
        simulate_free_runs({"true": SHIP}, DATA, DATA.runs, SETTINGS, length=1.0)


def test_what_nobody_measured_is_named_unless_it_is_estimated_or_set() -> None:
    """A current or wind that is taken as 0 goes into the errors, and into the numbers of a fit."""
    ship = SHIP.with_values({"current.kind": "uniform"})
    calm = Dataset(DATA.frame.drop(columns=["V_w", "beta_w"], errors="ignore"), DATA.metadata)
    assert missing_inputs(ship, calm, SETTINGS, DATA.runs) == ["V_w", "beta_w", "V_c", "beta_c"]
    estimated = SETTINGS.model_copy(update={"nuisance": {"current": 0.2}})
    assert missing_inputs(ship, calm, estimated, DATA.runs) == ["V_w", "beta_w"]
    wind = {"environment": {"V_w": 3.0, "beta_w": 0.5}}
    one, both = (SETTINGS.model_copy(update={"runs": dict.fromkeys(runs, wind)}) for runs in (DATA.runs[:1], DATA.runs))
    assert missing_inputs(ship, calm, one, DATA.runs) == ["V_w", "beta_w", "V_c", "beta_c"]
    assert missing_inputs(ship, calm, both, DATA.runs) == ["V_c", "beta_c"]
    measured = Dataset(calm.frame.assign(V_w=3.0, beta_w=0.5), DATA.metadata)
    assert missing_inputs(SHIP, measured, SETTINGS, DATA.runs) == []
