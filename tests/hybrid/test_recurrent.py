from __future__ import annotations

import numpy as np
import pytest
import torch

from shipid.data.windows import Instants
from shipid.hybrid.compensator import Normaliser
from shipid.hybrid.recurrent import GatedNetwork, Recurrent, SequenceReader
from tests.hybrid.worlds import FINE, fitted, ship, world

MEMORY = 8.0  # s


def wake(_, commands):
    """A force of the mean orders of the last seconds."""
    last = commands[-round(MEMORY / FINE) :]
    n, alpha = (np.mean([here[name] for here in last], axis=0) for name in ("port.n", "port.alpha"))
    return np.stack([8e3 * (n - 2.2), 2e4 * alpha, -4e5 * alpha], axis=1)


@pytest.mark.slow
def test_home_a_force_of_past_orders():
    here = world(ship(), ship(), force=wake, past=10, known=True, hold=(5.0, 12.0))
    assert here.removed(fitted(Recurrent(trials=1), here)) > 0.8


def test_the_layers_by_name_are_a_gru_of_pytorch():
    rng = np.random.default_rng(0)
    gru = torch.nn.GRU(3, 4).double()
    names = dict(zip(("W_i", "W_h", "b_i", "b_h"), gru.parameters(), strict=True))
    layers = {name: part.detach().numpy() for name, part in names.items()}
    layers |= {"W_1": np.eye(4, 6), "c_1": np.zeros(4), "W_2": np.eye(4), "c_2": np.zeros(4)}
    past, now = rng.normal(size=(7, 5, 3)), rng.normal(size=(5, 2))
    plain = Normaliser(("u", "v"), np.zeros(2), np.ones(2))
    network = GatedNetwork(SequenceReader(plain, plain, None, 6), layers, np.ones((3, 2)))
    expected = np.tanh(gru(torch.tensor(past))[1][0].detach().numpy())
    np.testing.assert_allclose(network._outputs((past, now)), expected, rtol=0, atol=1e-12)


def test_x_is_even_and_y_odd_in_the_mirror():
    here = world(ship(), ship(), force=wake, runs=4, seconds=30, past=4)
    corrector = fitted(Recurrent(trials=1, seconds=4.0, epochs=2, units=5), here)
    instants = here.test.instants()
    flip = {"v": -1.0, "r": -1.0, "psi": -1.0, "port.alpha": -1.0, "starboard.alpha": -1.0}

    def image(columns):
        return {name: flip.get(name, 1.0) * values for name, values in columns.items()}

    nowhere = np.zeros((15, len(instants), 2))
    plain = corrector.predict(here.physics, instants, nowhere)
    other = corrector.predict(here.physics, Instants(image(instants.columns), image(instants.past)), nowhere)
    np.testing.assert_allclose(other, plain * [1.0, -1.0], rtol=0, atol=1e-9)
    assert np.abs(plain[..., 1]).max() > 1e-3
