"""The reverse sweep: checks of the loss, the recorded step, and the values that it needs."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.engine.adjoint import evaluate_loss
from shipid.errors import ShipidError


def test_a_loss_of_wrong_shapes_is_refused() -> None:
    with pytest.raises(ShipidError, match=r"shapes \(3,\) and \(4, 3, 2\), not \(\) and"):
        evaluate_loss(lambda path: (path.sum(), path), np.zeros((4, 3, 2)))
