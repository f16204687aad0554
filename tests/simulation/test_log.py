"""What a simulated ship logs: velocities of the horizontal plane and back, names of runs and columns."""

from __future__ import annotations

import numpy as np

from shipid.simulation.log import body_velocities, horizontal_velocities, number_runs, state_column


def test_horizontal_velocities_are_those_of_the_rotation() -> None:
    """u and v are the first two components of R_y(theta) R_x(phi) (u, v, w), r the third of the Euler rates."""
    rng = np.random.default_rng(3)
    body = {name: rng.normal(size=50) for name in ("u", "v", "w", "q", "r")}
    body |= {"phi": rng.uniform(-0.5, 0.5, 50), "theta": rng.uniform(-0.3, 0.3, 50)}
    velocities = horizontal_velocities(body)
    for k in range(50):
        c, s = np.cos(body["phi"][k]), np.sin(body["phi"][k])
        roll = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        c, s = np.cos(body["theta"][k]), np.sin(body["theta"][k])
        trim = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        level = trim @ roll @ [body[name][k] for name in ("u", "v", "w")]
        np.testing.assert_allclose([velocities["u"][k], velocities["v"][k]], level[:2], atol=1e-12)
        rate = (body["q"][k] * np.sin(body["phi"][k]) + body["r"][k] * np.cos(body["phi"][k])) / c
        np.testing.assert_allclose(velocities["r"][k], rate, atol=1e-12)
    back = body_velocities({**body, **velocities})
    for name in ("u", "v", "r"):
        np.testing.assert_allclose(back[name], body[name], atol=1e-12)


def test_names_sort_as_they_count() -> None:
    assert number_runs(2) == ["M001", "M002"]
    many = number_runs(1200)
    assert many == sorted(many)
    assert (many[0], state_column("down"), state_column("psi")) == ("M0001", "z", "psi")
