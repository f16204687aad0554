import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from shipid.errors import DataError, ResultError
from shipid.hybrid import compensator as module
from shipid.hybrid.compensator import (
    Compensator,
    Network,
    Normaliser,
    flatten,
    shared_units,
    unflatten,
)
from shipid.hybrid.features import Inputs, choose_features, feature_table
from tests.hybrid.tasks import compensation

COMMANDS = ("port.n", "port.alpha", "starboard.n", "starboard.alpha")


@pytest.fixture
def columns():
    rng = np.random.default_rng(0)
    columns = {name: rng.normal(size=50) for name in ("north", "east", "psi", "u", "v", "r", "V_w", "beta_w")}
    columns["port.n"], columns["port.alpha"] = rng.uniform(1, 3, 50), rng.uniform(-1, 1, 50)
    return columns | {"starboard.n": columns["port.n"].copy(), "starboard.alpha": columns["port.alpha"].copy()}


@pytest.fixture
def compensator(columns):
    rng = np.random.default_rng(1)
    table = feature_table(columns, COMMANDS)
    features = choose_features(table)
    networks = []
    for fold in range(2):
        layers = tuple((rng.normal(size=(i, o)), rng.normal(size=o)) for i, o in ((7, 5), (5, 5), (5, 8)))
        seen = {name: values[fold::2] for name, values in table.items()}
        networks.append(Network(features, Normaliser.fit(seen, tuple(features)), rng.normal(size=(6, 4)), layers))
    return Compensator(Inputs(COMMANDS), tuple(networks), {"layers": 2, "units": 5, "learning_rate": 0.01})


def test_a_compensator_trained_with_wind_asks_for_wind(compensator, columns):
    del columns["V_w"]
    with pytest.raises(DataError, match="u_rw"):
        compensation(compensator, columns)


def test_the_normaliser_centres_and_scales_by_name(columns):
    table = feature_table(columns, COMMANDS)
    normaliser = Normaliser.fit(table, ("r", "port.n"))
    inputs = normaliser.apply(table)
    np.testing.assert_allclose(inputs.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(inputs.std(axis=0), 1.0)
    np.testing.assert_allclose(inputs[:, 1] * table["port.n"].std() + table["port.n"].mean(), table["port.n"])


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


@pytest.mark.parametrize(("kept", "computed"), [(module.KEPT, 4), (0, 8)])
def test_shared_hidden_layers_change_no_digit(compensator, columns, monkeypatch, kept, computed):
    """Two compensators that differ in their output weights, two sets of inputs, each of two networks."""
    turned = [
        replace(one, layers=(*one.layers[:-1], (-one.layers[-1][0], one.layers[-1][1]))) for one in compensator.networks
    ]
    both = compensator, replace(compensator, networks=tuple(turned))
    tables = columns, columns | {"u": columns["u"] + 1.0}
    expected = [compensation(one, table) for table in tables for one in both]
    calls, plain = [], module._of_layers
    monkeypatch.setattr(module, "KEPT", kept)
    monkeypatch.setattr(module, "_of_layers", lambda layers, inputs: calls.append(1) or plain(layers, inputs))
    with shared_units():
        made = [compensation(one, table) for table in tables for one in both]
    np.testing.assert_array_equal(made, expected)
    assert len(calls) == computed
    compensation(compensator, columns)
    assert len(calls) == computed + 2  # nothing is kept after the block


def test_columns_are_matched_by_name(compensator, columns):
    shuffled = dict(reversed(columns.items()))
    np.testing.assert_array_equal(compensation(compensator, shuffled), compensation(compensator, columns))


def test_paths_survive_the_order_of_12():
    paths = np.random.default_rng(0).normal(size=(30, 9, 2))
    assert flatten(paths).shape == (9, 60)
    np.testing.assert_array_equal(flatten(paths)[4, 30:], paths[:, 4, 1])
    np.testing.assert_array_equal(unflatten(flatten(paths)), paths)


def test_it_survives_json_and_arrays(compensator, columns, tmp_path):
    header = json.loads(json.dumps(compensator.header()))
    np.savez(tmp_path / "arrays.npz", **compensator.arrays())
    with np.load(tmp_path / "arrays.npz", allow_pickle=False) as stored:
        again = Compensator.from_arrays(header, dict(stored))
    np.testing.assert_array_equal(compensation(again, columns), compensation(compensator, columns))
    assert again.header() == compensator.header()


def test_damaged_arrays_are_refused(compensator):
    header, arrays = compensator.header(), compensator.arrays()
    with pytest.raises(ResultError, match=r"1\.weight\.2"):
        Compensator.from_arrays(header, {k: v for k, v in arrays.items() if k != "1.weight.2"})
    with pytest.raises(ResultError, match="do not fit"):
        Compensator.from_arrays(header, arrays | {"0.weight.1": np.zeros((5, 6))})
    with pytest.raises(ResultError, match="do not fit"):
        Compensator.from_arrays(header, arrays | {"0.mean": np.zeros(3)})
    with pytest.raises(ResultError, match="do not fit"):
        Compensator.from_arrays(header, arrays | {"0.basis": np.zeros((6, 3))})
