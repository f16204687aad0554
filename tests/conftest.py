"""What the tests of all floors share: the data folder, and vessels of every structure that the equations know."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Callable, Generator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer.testing
from hypothesis import settings

from shipid.data.dataset import Dataset
from shipid.document import bundled_documents
from shipid.hybrid.device import use_threads
from shipid.logs.importing import import_log, read_mapping
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import Vessel, load_vessel

use_threads(1)  # the machine is shared
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
typer.testing._get_command = typer.main.get_command = cache(typer.main.get_command)  # 0.1 s each time otherwise

LAG = {
    "n": {"kind": "first_order", "T": 1.0, "rate": 0.17},
    "alpha": {"kind": "first_order", "T": 0.5, "rate": 0.21, "low": -2.0, "high": 2.0},
}
ROLL = {"inertia.I_x": 4.8e6, "inertia.z_G": -0.9, "added_mass.K_pdot": -2.3e6, "hull.derivatives.K_p": -4e5}
ROLL |= {"hull.derivatives.Y_phiuu": 400.0, "hull.derivatives.N_vvphi": -9e3}
PITCH = {"inertia.I_y": 3.8e7, "added_mass.Z_wdot": -1.2e6, "added_mass.M_qdot": -8e7, "added_mass.K_vdot": -1e5}
PRIME = {"L_pp": 28.9, "Y_v": -0.03, "Y_r": 0.008, "N_v": -0.01, "N_r": -0.006, "X_vv": -0.004, "Y_v|r|": -0.03}

WEIGHTS = {
    **{"u_scale": 5.0, "v_scale": 1.0, "r_scale": 0.1, "X_max": 2e4, "Y_max": 3e4, "N_max": 4e5},
    **{"w_u": [0.8, -0.3, 0.5], "w_v": [0.4, 1.1, -0.6], "w_r": [-0.7, 0.2, 0.9], "w_0": [0.1, -0.4, 0.3]},
    **{"c_X": [-0.5, 0.2, 0.4], "c_Y": [-0.6, -0.3, 0.1], "c_N": [0.2, -0.1, -0.4]},
}

#: name -> base and what is added: structures that no bundled vessel has (yet)
PATCHED: dict[str, tuple[str, Mapping[str, Any]]] = {
    "actuators": ("gunnerus-28.9", {"thruster.port.actuator": LAG, "thruster.starboard.actuator": LAG}),
    "tunnel": ("gunnerus-28.9", {"thruster.bow.off": False}),
    "current": ("gunnerus-28.9", {"current.kind": "uniform"}),
    "prime": ("gunnerus-28.9", {"hull.prime_derivatives": PRIME}),
    "learned": ("gunnerus-28.9", {"hull.learned": WEIGHTS}),
    "many-strips": ("gunnerus-33.9", {"hull.crossflow.strips": 40}),
    "roll": ("gunnerus-33.9", {"dof": 4, **ROLL}),
    "six": ("gunnerus-33.9", {"dof": 6, "current.kind": "uniform", **ROLL, **PITCH}),
}


#: ships of public simulators, each for another range of speeds: tests/vessel/test_published.py has their laws
SIMULATED = ("container-175", "cybership2", "esso-190k", "naval-51", "otter", "supply-vessel")
OF_LAWS = [name for name in bundled_documents("models") if name not in SIMULATED]


@cache
def structure(name: str) -> Vessel:
    """A bundled vessel, or a patched one."""
    if name not in PATCHED:
        return load_vessel(name)
    base, values = PATCHED[name]
    return load_vessel(base).with_values(values)


def variety() -> dict[str, Vessel]:
    """Every structure by name: bundled vessels, without the simulators' ships, and patched ones."""
    return {name: structure(name) for name in (*OF_LAWS, *PATCHED)}


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of public recorded data: SHIPID_DATA, else beside the repository."""
    folder = Path(os.environ.get("SHIPID_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("no folder with recorded data: set SHIPID_DATA")
    return folder


@pytest.fixture(scope="session")
def hsva(shared_data: Path) -> Dataset:
    """The published zigzags of a model of KVLCC2, as their bundled mapping reads them; not to be changed."""
    folder = shared_data / "kvlcc2_hsva"
    if not folder.is_dir():
        pytest.skip(f"no {folder.name} in the folder of recorded data")
    return import_log(read_mapping("kvlcc2-hsva"), folder)


@pytest.fixture(scope="session", params=list(variety()))
def vessel(request: pytest.FixtureRequest) -> Vessel:
    """Every structure in turn."""
    return structure(request.param)


@pytest.fixture(scope="session", params=list(bundled_documents("models")))
def bundled_vessel(request: pytest.FixtureRequest) -> Vessel:
    """Every vessel that comes with shipid, in turn."""
    return load_vessel(request.param)


Inputs = dict[str, dict[str, np.ndarray]]
ENVELOPE = {
    **{"north": (-200, 200), "east": (-200, 200), "down": (-0.2, 0.2), "phi": (-0.1, 0.1), "theta": (-0.05, 0.05)},
    **{"psi": (-3, 3), "u": (0, 6), "v": (-1, 1), "w": (-0.2, 0.2), "p": (-0.1, 0.1), "q": (-0.05, 0.05)},
    **{"r": (-0.13, 0.13), "n": (0, 3.4), "alpha": (-0.9, 0.9), "delta": (-0.6, 0.6), "V_w": (0, 12)},
    **{"beta_w": (0, 6.3), "V_c": (0, 1), "beta_c": (0, 6.3)},
}


SPEEDS = ("u", "v", "w", "V_c")
ORDINARY = 28.9  # m: the ship whose envelope this is


def pace(vessel: Vessel) -> float:
    """Speeds, and times, of a model smaller than the ordinary ship over hers, by Froude."""
    return float(min(vessel.document["particulars"]["L_pp"] / ORDINARY, 1.0) ** 0.5)


@pytest.fixture(scope="session")
def draw_inputs() -> Callable[[Vessel, int], Inputs]:
    """Start, commands and environment of a rollout, drawn from the envelope of the vessels."""

    def draw(vessel: Vessel, num_samples: int, seed: int = 7) -> Inputs:
        rng, model = np.random.default_rng(seed), vessel_dynamics(vessel)
        slow = pace(vessel)

        def group(names: tuple[str, ...]) -> dict[str, np.ndarray]:
            drawn = {name: rng.uniform(*ENVELOPE[name.rsplit(".", 1)[-1]], num_samples) for name in names}
            return {name: slow * x if name in SPEEDS else x for name, x in drawn.items()}

        return {
            "start": group(model.state),
            "commands": group(model.commands),
            "environment": group(model.environment),
        }

    return draw


@pytest.fixture(scope="session")
def tiny_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a finished run of the smallest study there is; not to be written to."""
    from tests.study.tiny import run_here, tiny_plan

    folder = tmp_path_factory.mktemp("tiny")
    run_here(tiny_plan(folder), folder / "run")
    return folder / "run"


def pytest_configure() -> None:
    """A job in the background of a shell ignores Ctrl-C; tests that raise it need the handler of Python."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What there is before the first test is never garbage: it is not searched again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()
