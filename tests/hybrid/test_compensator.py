import numpy as np
import pytest
import torch

from shipid.errors import DataError
from shipid.hybrid.compensator import Compensator, Network, smooth_basis
from shipid.hybrid.features import Inputs, choose_features, feature_table
from shipid.hybrid.units import VaryingInputs
from tests.hybrid.tasks import azimuth_columns, compensation

COMMANDS = ("port.n", "port.alpha", "starboard.n", "starboard.alpha")


columns = pytest.fixture(azimuth_columns)


@pytest.fixture
def compensator(columns):
    rng = np.random.default_rng(1)
    table = feature_table(columns, COMMANDS)
    features = choose_features(table)
    networks = []
    for fold in range(2):
        layers = tuple((rng.normal(size=(i, o)), rng.normal(size=o)) for i, o in ((7, 5), (5, 5), (5, 8)))
        seen = {name: values[fold::2] for name, values in table.items()}
        networks.append(
            Network(features, VaryingInputs.of(seen, mirror=False).normaliser, rng.normal(size=(6, 4)), layers)
        )
    return Compensator(Inputs(COMMANDS), tuple(networks), {"layers": 2, "units": 5, "learning_rate": 0.01})


def test_a_compensator_trained_with_wind_asks_for_wind(compensator, columns):
    del columns["V_w"]
    with pytest.raises(DataError, match="u_rw"):
        compensation(compensator, columns)


def test_prediction_is_the_mean_of_pytorch_networks(compensator, columns):
    table = feature_table(columns, COMMANDS)
    expected = []
    for network in compensator.networks:
        h = torch.tensor(network.normaliser.apply(table))
        for i, (weight, bias) in enumerate(network.layers):
            h = torch.nn.functional.linear(h, torch.tensor(weight.T.copy()), torch.tensor(bias))
            h = h.tanh() if i < 2 else h
        x, y = h[:, :4].numpy().T, h[:, 4:].numpy().T  # (12): all dx, then all dy
        expected.append(np.stack([network.basis @ x, network.basis @ y], axis=-1))
    np.testing.assert_allclose(compensation(compensator, columns), np.mean(expected, axis=0), atol=1e-10)


@pytest.mark.parametrize(("horizon", "terms"), [(30, 8), (15, 1), (50, 12), (2, 8), (1, 8)])
def test_shapes_are_orthonormal_and_hold_all_polynomials_from_0(horizon, terms):
    basis = smooth_basis(horizon, terms)
    assert basis.shape == (horizon, min(terms, horizon))
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-12)
    t = np.arange(1, horizon + 1) / horizon
    powers = t[:, None] ** np.arange(1, basis.shape[1] + 1)
    np.testing.assert_allclose(basis @ (basis.T @ powers), powers, atol=1e-12)
    if terms < horizon - 1:
        above = t ** (terms + 1)
        assert np.abs(basis @ (basis.T @ above) - above).max() > 1e-10
        assert np.abs(basis @ (basis.T @ np.ones(horizon)) - 1.0).max() > 1e-3  # an error starts from 0
