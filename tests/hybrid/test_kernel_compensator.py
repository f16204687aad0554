"""The kernel by hand, and the group of every input."""

from __future__ import annotations

import numpy as np

from shipid.hybrid.kernel_compensator import GROUPS, kernel_group, weighed_kernels


def test_groups_and_values_by_hand() -> None:
    names = ("u", "port.n", "V_w_rw", "port.past-2.n", "turned-5.psi", "past-4.x", "past-4.y", "past-4.u", "error-8.x")
    groups = ("motion", "command", "wind", "history", "turned", "position", "position", "history", "error")
    assert tuple(map(kernel_group, names)) == groups
    assert set(groups) <= set(GROUPS)
    made = weighed_kernels(np.array([[[1.0, 2.0]]]), np.array([[1.0, 2.0], [3.0, 2.0]]), 0.5, np.eye(2))
    np.testing.assert_allclose(made, [[1 + 0.5 * 6, np.exp(-2) + 0.5 * 8]])
