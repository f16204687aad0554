import numpy as np
import pytest
import torch

from shipid.errors import DataError
from shipid.hybrid.compensator import Compensator, Network
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
