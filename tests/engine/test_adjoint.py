"""The reverse sweep: checks of the loss, the recorded step, and the values that it needs."""

from __future__ import annotations

import numpy as np
import pytest

from shipid.engine.adjoint import _needed_values, evaluate_loss, record_step
from shipid.errors import ShipidError


def test_a_loss_of_the_right_shapes_is_taken() -> None:
    path = np.arange(24.0).reshape(4, 3, 2)
    values, slopes = evaluate_loss(lambda path: (path.sum(axis=(0, 2)), np.ones_like(path)), path)
    assert values.tolist() == path.sum(axis=(0, 2)).tolist()
    assert slopes.shape == path.shape


def test_a_loss_of_wrong_shapes_is_refused() -> None:
    with pytest.raises(ShipidError, match=r"shapes \(3,\) and \(4, 3, 2\), not \(\) and"):
        evaluate_loss(lambda path: (path.sum(), path), np.zeros((4, 3, 2)))


@pytest.mark.parametrize(("method", "stages"), [("euler", 1), ("rk4", 4)])
def test_the_recorded_step_has_the_stages_of_the_method(method: str, stages: int) -> None:
    lines, after, memory_after = record_step(0.5, method)  # type: ignore[arg-type]
    assert sum(line.kind == "rates" for line in lines) == stages
    assert {after, memory_after} <= {line.out for line in lines}
    advances = [line.number for line in lines if line.kind == "advance"]
    assert max(advances) == 0.5


def test_only_operands_of_nonlinear_functions_are_needed() -> None:
    lines, after, _ = record_step(0.5, "rk4")
    needed = _needed_values(lines)
    assert after not in needed  # the last sum is linear
    assert {line.operands[0] for line in lines if line.kind == "rates"} <= needed
