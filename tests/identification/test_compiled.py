"""The compiled variational equations: packing of predictions by lanes, and agreement with CasADi's virtual machine."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.engine.native import compiler_target, find_compiler, pack_lanes
from shipid.identification.compiled import run_compiled
from shipid.identification.sensitivities import FitLayout, build_variation, run_machine
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel

SHIP = load_vessel("gunnerus-28.9")


@pytest.mark.skipif(find_compiler() is None, reason="needs a C compiler")
def test_compiled_outputs_are_those_of_the_virtual_machine() -> None:
    layout = FitLayout(vessel_dynamics(SHIP), (("inertia.m",),), ("u", "r"), (), (), 0, 0.5, "euler")
    model, rng, count, steps = build_variation(layout), np.random.default_rng(0), compiler_target().lanes + 2, 3
    x = np.zeros((count, model.size))
    x[:, :3] = rng.uniform([3.0, -0.1, -0.02], [5.0, 0.1, 0.02], (count, 3))
    x[:, 3:12] = np.eye(3).ravel()
    base = np.array(list(SHIP.parameters.values()))
    fixed = np.tile(np.concatenate([[1.05], base, [SHIP.parameters["inertia.m"]]]), (count, 1))
    known = rng.uniform(0.5, 2.0, (count, steps, model.rates.size1_in(3)))
    seen = np.concatenate([np.zeros((count, steps, 2)), np.ones((count, steps, 2))], axis=-1)
    expected = run_machine(layout, x, fixed, known, seen)[0]
    record = run_compiled(layout, x, fixed, pack_lanes(known), pack_lanes(seen))
    result = record.reshape(-1, *record.shape[2:])[:count]
    assert np.abs(expected).max() > 1
    assert np.allclose(result, expected, rtol=1e-9, atol=1e-12)
