from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipid.hybrid.units import VaryingInputs, solve_ridges

POINT = {"motion_scale": 2.0, "command_scale": 3.0, "wind_scale": 4.0, "offset": 1.0}
MIRROR = {"u": 1, "v": -1, "r": -1, "port.n": 1, "port.alpha": -1}


@pytest.fixture
def table():
    rng = np.random.default_rng(0)
    return {name: rng.normal(1.0, 2.0, 50) for name in MIRROR} | {"psi.steady": np.ones(50)}


def side(table):
    both = {name: values for name, values in table.items() if name in MIRROR}
    return both | {name.replace("port", "starboard"): values for name, values in both.items() if "port" in name}


def test_even_units_do_not_feel_the_mirror_and_odd_ones_change_sign(table):
    here = side(table)
    units = VaryingInputs.of(here, mirror=True).draw(POINT, 12, 0)
    image = {name: MIRROR[name.replace("starboard", "port")] * values for name, values in here.items()}
    (even, odd), (even_image, odd_image) = units.parts(here), units.parts(image)
    assert even.shape == (50, 13)
    assert odd.shape == (50, 12)
    np.testing.assert_allclose(even, even_image, atol=1e-12)
    np.testing.assert_allclose(odd, -odd_image, atol=1e-12)
    assert np.abs(odd).max() > 0.01
    plain, _ = replace(units, reflection=None).parts(here)
    np.testing.assert_allclose(even[:, 1:] + odd, plain[:, 1:], atol=1e-12)  # halves of the same units


def test_weights_and_offsets_are_drawn_apart_with_the_scales_of_their_inputs(table):
    units = VaryingInputs.of(table, mirror=False).draw({**POINT, "offset": 0.7}, 4000, 0)
    scale = [POINT["command_scale" if name.startswith("port") else "motion_scale"] for name in units.normaliser.names]
    drawn = np.vstack([units.weight, units.offset])
    np.testing.assert_allclose(drawn.std(axis=1), [*(1 / np.array(scale)), 0.7], rtol=0.05)
    np.testing.assert_allclose(np.corrcoef(drawn), np.eye(len(drawn)), atol=0.06)


def test_a_ridge_regression_is_the_normal_equations():
    rng = np.random.default_rng(1)
    features, targets, penalty = rng.normal(size=(40, 4)), rng.normal(size=(40, 2)), np.array([1.0, 2.0, 0.5, 1.0])
    for ridge, weights in zip((1e-3, 2.0), solve_ridges(features, targets, (1e-3, 2.0), penalty), strict=True):
        gram = features.T @ features / 40 + ridge * np.diag(penalty**2)
        np.testing.assert_allclose(weights, np.linalg.solve(gram, features.T @ targets / 40), atol=1e-10)
