from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.errors import DocumentError
from shipid.hybrid.hankel_dmd import HankelDMD, HankelProblem
from tests.hybrid.worlds import FINE, fitted, ship, world

AGO = 4.0  # s


def late(nus, commands):
    """A force of the velocities and orders four seconds ago."""
    then = max(len(nus) - 1 - round(AGO / FINE), 0)
    u, v, r = nus[then].T
    return np.stack([-3e3 * (u - 3.5), -2e4 * v - 2e5 * r, -1.5e6 * r + 2e5 * commands[then]["port.alpha"]], 1)


def test_home_a_force_that_comes_late():
    here = world(ship(), ship(), force=late, past=8, known=True)
    assert here.removed(fitted(HankelDMD(), here)) > 0.8


def test_what_the_physics_missed_before_is_what_it_missed_in_the_steps_before():
    """Also in wind, which a ship feels by her heading at the start of each step."""
    here = world(ship(), ship(), runs=2, seconds=30, past=3, known=True)
    wind = {"V_w": np.full(len(here.train), 12.0), "beta_w": np.full(len(here.train), 1.0)}
    past = {name: np.tile(values, (here.train.num_past, 1)) for name, values in wind.items()}
    windows = replace(here.train, columns=here.train.columns | wind, past=here.train.past | past)
    problem = HankelProblem(HankelDMD(), replace(here.task(), windows=windows), "physics")
    steps, table = problem.steps, problem.table(2)
    runs, t = windows.run[steps.window], windows.t[steps.window] + steps.number
    moments = {(run, round(float(moment))): i for i, (run, moment) in enumerate(zip(runs, t, strict=True))}
    after = [(moments[run, moment - ago], i, ago) for (run, moment), i in moments.items() for ago in (1, 2)
             if (run, moment - ago) in moments]  # fmt: skip
    assert len(after) > 80
    for first, then, ago in after:
        found = [table[f"missed.past-{ago}.{name}"][then] for name in "uvr"]
        np.testing.assert_allclose(found, steps.missing[first], rtol=0, atol=1e-9)


def test_trials_that_would_have_no_effect_are_refused():
    with pytest.raises(DocumentError, match=r"trials: each of `delays` is a trial: leave it out"):
        HankelDMD(trials=2)
    assert HankelDMD(budget=10.0).num_trials() is None
